//! The oracle: the judge's exact count behind an index, and all crossings of one lattice edge.

use brickfield_bench_data::judge::winding::{crossing_number, solid_angle_sum};
use brickfield_bench_data::{Facet64, LatticeFacet};

/// Columns along each side of the grids that find facets.
const ACROSS: usize = 256;

/// A snapped soup, with a grid over each of the three projections.
pub struct Oracle {
    pub facets: Vec<LatticeFacet>,
    grids: [Grid; 3],
}

/// Facets by the column along one axis that their bounding box meets.
struct Grid {
    low: [i32; 2],
    shift: u32,
    columns: Vec<Vec<u32>>,
}

/// One crossing of a lattice edge.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Distance from the lower sample in 1/65536 of the edge, rounded, at most 65535.
    pub offset: i64,
    /// Change of the winding number towards the upper sample.
    pub jump: i64,
    /// Area vector, not normalised.
    pub normal: [i64; 3],
    /// A vertex of the facet.
    pub vertex: [i32; 3],
}

/// The axes other than `axis`, the lower first.
pub fn others(axis: usize) -> (usize, usize) {
    [(1, 2), (0, 2), (0, 1)][axis]
}

fn extent(t: &LatticeFacet, axis: usize) -> (i32, i32) {
    let c = t.map(|v| v[axis]);
    (c[0].min(c[1]).min(c[2]), c[0].max(c[1]).max(c[2]))
}

impl Grid {
    fn new(facets: &[LatticeFacet], axis: usize) -> Grid {
        let (u, v) = others(axis);
        let all = |a| {
            let extents = facets.iter().map(|t| extent(t, a));
            extents.fold((i32::MAX, i32::MIN), |m, e| (m.0.min(e.0), m.1.max(e.1)))
        };
        let (us, vs) = (all(u), all(v));
        let longest = (us.1 - us.0).max(vs.1 - vs.0) as usize;
        let shift = (0..).find(|s| longest >> s < ACROSS).expect("an i32 runs out of bits");
        let mut grid = Grid { low: [us.0, vs.0], shift, columns: vec![Vec::new(); ACROSS * ACROSS] };
        for (number, t) in facets.iter().enumerate() {
            let ((u0, u1), (v0, v1)) = (extent(t, u), extent(t, v));
            for cv in grid.cell(1, v0)..=grid.cell(1, v1) {
                for cu in grid.cell(0, u0)..=grid.cell(0, u1) {
                    grid.columns[cv as usize * ACROSS + cu as usize].push(number as u32);
                }
            }
        }
        grid
    }

    fn cell(&self, side: usize, c: i32) -> i32 {
        (c - self.low[side]) >> self.shift
    }

    fn column(&self, u: i32, v: i32) -> &[u32] {
        let (cu, cv) = (self.cell(0, u), self.cell(1, v));
        let within = |c: i32| (0..ACROSS as i32).contains(&c);
        if within(cu) && within(cv) { &self.columns[cv as usize * ACROSS + cu as usize] } else { &[] }
    }
}

impl Oracle {
    pub fn new(facets: Vec<LatticeFacet>) -> Oracle {
        let grids = [0, 1, 2].map(|axis| Grid::new(&facets, axis));
        Oracle { facets, grids }
    }

    /// The facets that a line through `p` along `axis` may meet: those whose bounding box it does. A facet
    /// left out cannot contribute to a count along that line, moved by however small an ε.
    pub fn along(&self, axis: usize, p: [i32; 3]) -> Vec<LatticeFacet> {
        let (u, v) = others(axis);
        let meets = |t: &LatticeFacet| {
            let ((u0, u1), (v0, v1)) = (extent(t, u), extent(t, v));
            u0 <= p[u] && p[u] <= u1 && v0 <= p[v] && p[v] <= v1
        };
        let column = self.grids[axis].column(p[u], p[v]).iter().map(|&i| self.facets[i as usize]);
        column.filter(meets).collect()
    }

    /// The exact winding number at `p`.
    pub fn at(&self, p: [i32; 3]) -> i64 {
        crossing_number(&self.along(0, p), p)
    }

    /// The exact winding number along the x line through `p`, as a function of the position on it.
    pub fn row(&self, p: [i32; 3]) -> impl Fn([i32; 3]) -> i64 {
        let near = self.along(0, p);
        move |q| {
            assert!(q[1..] == p[1..]);
            crossing_number(&near, q)
        }
    }

    /// The judge's count over all facets, without the index.
    pub fn at_without_index(&self, p: [i32; 3]) -> i64 {
        crossing_number(&self.facets, p)
    }

    /// The sum of all solid angles over 4π.
    pub fn solid_angles(&self, p: [i32; 3]) -> f64 {
        let world: Vec<Facet64> = self.facets.iter().map(|t| t.map(|v| v.map(f64::from))).collect();
        solid_angle_sum(&world, p.map(f64::from))
    }

    /// True if `p` lies in the plane of a facet and in its bounding box, as it does if it lies on one.
    pub fn may_lie_on_a_facet(&self, p: [i32; 3]) -> bool {
        self.along(0, p).iter().any(|t| {
            let (x0, x1) = extent(t, 0);
            x0 <= p[0] && p[0] <= x1 && plane_at(t, p) == 0
        })
    }

    /// All crossings of the lattice edge from `lower` along `axis`, in no particular order.
    pub fn crossings(&self, lower: [i32; 3], axis: usize, spacing: i32) -> Vec<Crossing> {
        let near = self.along(axis, lower);
        near.iter().filter_map(|t| crossing(t, lower, axis, spacing)).collect()
    }
}

/// The area vector, twice the area long.
pub fn normal(t: &LatticeFacet) -> [i64; 3] {
    let d = |i: usize, a: usize| i64::from(t[i][a]) - i64::from(t[0][a]);
    [(1, 2), (2, 0), (0, 1)].map(|(a, b)| d(1, a) * d(2, b) - d(1, b) * d(2, a))
}

/// Positive outside of the facet's plane.
fn plane_at(t: &LatticeFacet, p: [i32; 3]) -> i128 {
    let n = normal(t);
    (0..3).map(|a| i128::from(n[a]) * (i128::from(p[a]) - i128::from(t[0][a]))).sum()
}

fn first_sign(values: &[i128]) -> i128 {
    values.iter().map(|v| v.signum()).find(|&s| s != 0).unwrap_or(0)
}

/// The crossing of one facet with one lattice edge whose samples count as p + (ε, ε², ε³).
fn crossing(t: &LatticeFacet, lower: [i32; 3], axis: usize, spacing: i32) -> Option<Crossing> {
    let (u, v) = others(axis);
    let at = |i: usize| {
        let p = t[i % 3];
        [u, v].map(|a| i128::from(p[a]) - i128::from(lower[a]))
    };
    let side = |i: usize| {
        let (a, b) = (at(i), at(i + 1));
        // The area spanned with the line, then its derivatives by the larger and the smaller ε.
        first_sign(&[a[0] * b[1] - a[1] * b[0], a[1] - b[1], b[0] - a[0]])
    };
    if side(0) == 0 || side(0) != side(1) || side(1) != side(2) {
        return None;
    }
    let n = normal(t);
    let below = plane_at(t, lower);
    let above = below + i128::from(n[axis]) * i128::from(spacing);
    let sign = |value| first_sign(&[value, n[0].into(), n[1].into(), n[2].into()]);
    if sign(below) == sign(above) {
        return None;
    }
    let (share, whole) = (below.abs(), (above - below).abs());
    let offset = ((share << 17) + whole).div_euclid(2 * whole).min(65535) as i64;
    Some(Crossing { offset, jump: -n[axis].signum(), normal: n, vertex: t[0] })
}
