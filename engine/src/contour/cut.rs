//! Polygons cut into facets, eight at a time in vectors, with normals, area and volume.

use super::polygons::Facet;
use super::sink::Encoding;
use crate::wide::{
    Select, Simd, SimdBase, SimdFloat, SimdMask, dispatch, f32x8, f64x8, level, transposed, widened,
};

/// Polygons in a vector.
const GROUP: usize = 8;

/// Area and volume of facets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measured {
    /// In square world units.
    pub area: f64,
    /// Signed volume under the facets, seen from the centre, in cubic world units.
    pub volume: f64,
}

/// Number and position of a vertex.
pub(super) type Vertex = (u32, [f32; 3]);

/// How four corners become facets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Shape {
    /// Two facets in the sense of the corners, along the shorter diagonal, from the first corner if they are equal.
    #[default]
    Quad,
    /// The same two, turned over.
    Turned,
    /// Those in the other order.
    TurnedBack,
    /// One facet of the first three corners.
    Triangle,
}

/// The corners of a facet, and whether it is the first or the second in the sense of the polygon's corners.
type Order = ([usize; 3], usize);

/// The facets of each shape where it is cut from its second corner or from its first.
static ORDERS: [[&[Order]; 2]; 4] = [
    [&[([1, 2, 3], 0), ([1, 3, 0], 1)], &[([0, 1, 2], 0), ([0, 2, 3], 1)]],
    [&[([1, 3, 2], 0), ([1, 0, 3], 1)], &[([0, 2, 1], 0), ([0, 3, 2], 1)]],
    [&[([1, 0, 3], 1), ([1, 3, 2], 0)], &[([0, 3, 2], 1), ([0, 2, 1], 0)]],
    [&[([0, 1, 2], 0)]; 2],
];

/// Up to eight polygons that are cut.
pub struct Cuts {
    count: usize,
    ids: [[u32; 4]; GROUP],
    /// Positions, and a zero that makes them a vector.
    corners: [[[f32; 4]; 4]; GROUP],
    shapes: [Shape; GROUP],
    /// Bit per polygon: it is cut from its first corner.
    from_first: u64,
    /// By facet in the sense of the corners, and a zero.
    normals: [[[f32; 4]; GROUP]; 2],
}

impl Cuts {
    /// How many facets there are at most.
    pub(super) const MOST_FACETS: usize = 2 * GROUP;

    /// Calls `each` with the facets in order: numbers of the corners, their positions, and the normal, of length one by the
    /// right-hand rule, zero for a facet without area; vectors end in a zero.
    #[inline(always)]
    pub(super) fn for_each(&self, mut each: impl FnMut([u32; 3], [&[f32; 4]; 3], &[f32; 4])) {
        for lane in 0..self.count {
            let (ids, corners) = (&self.ids[lane], &self.corners[lane]);
            let is_first = (self.from_first >> lane & 1) as usize;
            for &([a, b, c], n) in ORDERS[self.shapes[lane] as usize][is_first] {
                let [a, b, c, n] = [a & 3, b & 3, c & 3, n & 1];
                each(
                    [ids[a], ids[b], ids[c]],
                    [&corners[a], &corners[b], &corners[c]],
                    &self.normals[n][lane],
                );
            }
        }
    }
}

/// Takes the polygons of a leaf and makes its facets, in the same order.
pub(super) struct Cutter {
    centre: [f64; 3],
    encoding: Option<Encoding>,
    cuts: Cuts,
    /// All facets if there is no encoding.
    pub facets: Vec<Facet>,
    /// What the encoding makes of them.
    pub bytes: Vec<u8>,
    /// Number of facets.
    pub count: usize,
    pub measured: Measured,
}

impl Cutter {
    /// What the encoding makes of facets is appended to `bytes`.
    pub(super) fn new(centre: [f64; 3], encoding: Option<Encoding>, bytes: Vec<u8>) -> Cutter {
        let cuts = Cuts {
            count: 0,
            ids: [[0; 4]; GROUP],
            corners: [[[0.0; 4]; 4]; GROUP],
            shapes: [Shape::Quad; GROUP],
            from_first: 0,
            normals: [[[0.0; 4]; GROUP]; 2],
        };
        Cutter { centre, encoding, cuts, facets: Vec::new(), bytes, count: 0, measured: Measured::default() }
    }

    /// The next polygon.
    #[inline(always)]
    pub(super) fn push(&mut self, corners: [Vertex; 4], shape: Shape) {
        let lane = self.cuts.count % GROUP;
        for (n, (id, [x, y, z])) in corners.into_iter().enumerate() {
            self.cuts.ids[lane][n] = id;
            self.cuts.corners[lane][n] = [x, y, z, 0.0];
        }
        self.cuts.shapes[lane] = shape;
        self.cuts.count += 1;
        if self.cuts.count == GROUP {
            self.cut();
        }
    }

    /// The next polygon, a triangle.
    pub(super) fn push_triangle(&mut self, [a, b, c]: [Vertex; 3]) {
        self.push([a, b, c, a], Shape::Triangle);
    }

    /// To be called after the last polygon.
    pub(super) fn finish(mut self) -> Cutter {
        if self.cuts.count > 0 {
            // Lanes that are left have no area.
            self.cuts.corners[self.cuts.count..].fill([[0.0; 4]; 4]);
            self.cut();
        }
        self
    }

    fn cut(&mut self) {
        let measured = dispatch!(level(), simd => cut(simd, self.centre, &mut self.cuts));
        self.measured.area += measured.area;
        self.measured.volume += measured.volume;
        let facets = |cuts: &Cuts, lane: usize| ORDERS[cuts.shapes[lane] as usize][0].len();
        self.count += (0..self.cuts.count).map(|lane| facets(&self.cuts, lane)).sum::<usize>();
        match self.encoding {
            Some(encoding) => (encoding.facets)(&self.cuts, &mut self.bytes),
            None => self.cuts.for_each(|ids, corners, _| {
                self.facets.push(Facet { ids, corners: corners.map(|&[x, y, z, _]| [x, y, z]) });
            }),
        }
        self.cuts.count = 0;
    }
}

#[inline(always)]
fn cut<S: Simd>(simd: S, centre: [f64; 3], cuts: &mut Cuts) -> Measured {
    let zero = f64x8::splat(simd, 0.0);
    let mut p = [[zero; 3]; 4];
    for half in 0..2 {
        let mut polygons = [f32x8::splat(simd, 0.0); GROUP];
        for (polygon, corners) in polygons.iter_mut().zip(&cuts.corners) {
            *polygon = f32x8::from_slice(simd, corners[2 * half..2 * half + 2].as_flattened());
        }
        let [a, b, c, _, d, e, f, _] = transposed(polygons);
        p[2 * half] = [widened(simd, a), widened(simd, b), widened(simd, c)];
        p[2 * half + 1] = [widened(simd, d), widened(simd, e), widened(simd, f)];
    }
    let (mut turned, mut lone) = ([0.0; GROUP], [0.0; GROUP]);
    for lane in 0..GROUP {
        turned[lane] = f64::from(u8::from(matches!(cuts.shapes[lane], Shape::Turned | Shape::TurnedBack)));
        lone[lane] = f64::from(u8::from(cuts.shapes[lane] == Shape::Triangle));
    }
    let is_turned = f64x8::from_slice(simd, &turned).simd_gt(zero);
    let is_lone = f64x8::from_slice(simd, &lone).simd_gt(zero);
    let is_first = squared(p[0], p[2]).simd_le(squared(p[1], p[3])) | is_lone;
    let [mut u, mut v, mut w, mut from] = [[zero; 3]; 4];
    for a in 0..3 {
        let apex = is_first.select(p[0][a], p[1][a]);
        u[a] = is_first.select(p[1][a], p[2][a]) - apex;
        v[a] = is_first.select(p[2][a], p[3][a]) - apex;
        w[a] = is_first.select(p[3][a], p[0][a]) - apex;
        from[a] = apex - centre[a];
    }
    let (mut doubled, mut sixfold) = (zero, zero);
    for (facet, (u, v)) in [(u, v), (v, w)].into_iter().enumerate() {
        let (mut s, mut t) = (u, v);
        for a in 0..3 {
            // Turned by exchange: with another sign zeros would have one, too.
            s[a] = is_turned.select(v[a], u[a]);
            t[a] = is_turned.select(u[a], v[a]);
        }
        let n = [s[1] * t[2] - s[2] * t[1], s[2] * t[0] - s[0] * t[2], s[0] * t[1] - s[1] * t[0]];
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        doubled += length;
        sixfold += n[0] * from[0] + n[1] * from[1] + n[2] * from[2];
        let has_area = length.simd_gt(zero);
        let normals = &mut cuts.normals[facet];
        for a in 0..3 {
            let unit = has_area.select(n[a] / length, zero);
            let unit = unit.as_array();
            for lane in 0..GROUP {
                normals[lane][a] = unit[lane] as f32;
            }
        }
    }
    cuts.from_first = is_first.to_bitmask();
    let (mut area, mut volume) = (0.0, 0.0);
    for lane in 0..GROUP {
        area += doubled[lane];
        volume += sixfold[lane];
    }
    Measured { area: area / 2.0, volume: volume / 6.0 }
}

#[inline(always)]
fn squared<S: Simd>(p: [f64x8<S>; 3], q: [f64x8<S>; 3]) -> f64x8<S> {
    let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// What the encoding makes of facets.
pub(super) fn encoded(facets: &[Facet], encoding: Encoding) -> Vec<u8> {
    let mut cutter = Cutter::new([0.0; 3], Some(encoding), Vec::new());
    for facet in facets {
        cutter.push_triangle([0, 1, 2].map(|n| (facet.ids[n], facet.corners[n])));
    }
    cutter.finish().bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AS_NUMBERS: Encoding = Encoding {
        vertices: |_, _| {},
        facets: |cuts, bytes| {
            cuts.for_each(|_, _, n| bytes.extend(n[..3].iter().map(|&c| (c * 100.0).round() as i8 as u8)));
        },
    };

    #[test]
    fn a_tetrahedron_is_measured_and_facets_without_area_have_no_normal() {
        let at =
            |n: u32| (n, [[5.0, 0.0, 0.0], [7.0, 0.0, 0.0], [5.0, 2.0, 0.0], [5.0, 0.0, 2.0]][n as usize]);
        let facets = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [0, 1, 1]];
        let made = |times: usize| {
            let mut cutter = Cutter::new([1.0, 2.0, 3.0], Some(AS_NUMBERS), Vec::new());
            for facet in facets.iter().cycle().take(5 * times) {
                cutter.push_triangle(facet.map(at));
            }
            cutter.finish()
        };
        let one = made(1);
        let Measured { area, volume } = one.measured;
        assert!((area - 6.0 - 2.0 * 3f64.sqrt()).abs() < 1e-12 && (volume - 4.0 / 3.0).abs() < 1e-12);
        let normals: Vec<i8> = one.bytes.iter().map(|&b| b as i8).collect();
        assert_eq!(normals, [0, 0, -100, 0, -100, 0, -100, 0, 0, 58, 58, 58, 0, 0, 0]);
        let many = made(77);
        assert_eq!(many.count, 5 * 77);
        let ratios = [many.measured.area / area, many.measured.volume / volume];
        assert!(ratios.iter().all(|ratio| (ratio - 77.0).abs() < 1e-9));
    }

    proptest! {
        #[test]
        fn quadrilaterals_are_cut_along_the_shorter_diagonal_in_their_sense(
            polygons in prop::collection::vec((prop::array::uniform4(prop::array::uniform3(-4i8..4)), 0usize..3), 1..40),
        ) {
            let shapes = [Shape::Quad, Shape::Turned, Shape::TurnedBack];
            let mut cutter = Cutter::new([0.0; 3], None, Vec::new());
            for (corners, shape) in &polygons {
                let corner = |n: usize| (n as u32, corners[n].map(f32::from));
                cutter.push([0, 1, 2, 3].map(corner), shapes[*shape]);
            }
            let cut = cutter.finish();
            prop_assert_eq!(cut.count, 2 * polygons.len());
            for ((corners, shape), facets) in polygons.iter().zip(cut.facets.chunks_exact(2)) {
                let squared = |p: usize, q: usize| -> i32 {
                    (0..3).map(|a| (i32::from(corners[p][a]) - i32::from(corners[q][a])).pow(2)).sum()
                };
                let first = usize::from(squared(0, 2) > squared(1, 3)) as u32;
                let corner = |n: u32| (first + n) % 4;
                let mut expected = [[0, 1, 2], [0, 2, 3]].map(|facet| facet.map(corner));
                if *shape > 0 {
                    expected.iter_mut().for_each(|facet| facet.swap(1, 2));
                }
                if *shape == 2 {
                    expected.reverse();
                }
                prop_assert_eq!([facets[0].ids, facets[1].ids], expected);
                for facet in facets {
                    prop_assert_eq!(facet.corners, facet.ids.map(|n| corners[n as usize].map(f32::from)));
                }
            }
        }
    }
}
