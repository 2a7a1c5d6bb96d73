//! Hermite edges as contouring wants them: decoded.

use super::symmetric::dot;
use crate::brick::{HermiteEdge, OctNormal};
use crate::wide::{
    Select, Simd, SimdBase, SimdFloat, dispatch, f32x4, f32x8, f64x8, in_fours, level, narrowed,
};

/// Edges decoded at a time.
const GROUP: usize = 8;

/// A sign change on the boundary of a cell: where it lies in cell coordinates and the normal there.
pub(super) type HermitePlane = ([f64; 3], [f64; 3]);

/// How far a point is from such a plane.
#[inline]
pub(super) fn distance((point, normal): &HermitePlane, at: [f64; 3]) -> f64 {
    dot(*normal, std::array::from_fn(|a| at[a] - point[a])).abs()
}

/// A decoded Hermite edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct EdgePlane {
    /// Distance from the edge's lower sample as a fraction of the edge.
    pub fraction: f32,
    /// Unit length.
    pub normal: [f32; 3],
}

impl EdgePlane {
    /// All of it as one vector: the fraction, then the normal.
    #[inline(always)]
    pub(super) fn terms<S: Simd>(&self, simd: S) -> f32x4<S> {
        let [x, y, z] = self.normal;
        f32x4::from_slice(simd, &[self.fraction, x, y, z])
    }

    /// The fraction in 65536ths, rounded down, as polygons have it ([`super::edges::Quad`]).
    #[inline]
    pub(super) fn offset(&self) -> u16 {
        (self.fraction * 65536.0) as u16
    }

    /// The same as a fraction.
    pub(super) fn rounded_down(&self) -> f32 {
        f32::from(self.offset()) / 65536.0
    }
}

/// Appends the decoded `edges`: normals as [`crate::brick::OctNormal::to_vector`] gives them, rounded.
pub(super) fn decode(edges: &[HermiteEdge], planes: &mut Vec<EdgePlane>) {
    dispatch!(level(), simd => decode_groups(simd, edges, planes))
}

#[inline(always)]
fn decode_groups<S: Simd>(simd: S, edges: &[HermiteEdge], planes: &mut Vec<EdgePlane>) {
    let (groups, rest) = edges.as_chunks::<GROUP>();
    for group in groups {
        planes.extend(decode_group(simd, group));
    }
    if let Some(first) = rest.first() {
        let mut group = [*first; GROUP];
        group[..rest.len()].copy_from_slice(rest);
        planes.extend_from_slice(&decode_group(simd, &group)[..rest.len()]);
    }
}

#[inline(always)]
fn decode_group<S: Simd>(simd: S, group: &[HermiteEdge; GROUP]) -> [EdgePlane; GROUP] {
    let (one, zero) = (f64x8::splat(simd, 1.0), f64x8::splat(simd, 0.0));
    let (mut offset, mut u, mut v) = ([0.0; GROUP], [0.0; GROUP], [0.0; GROUP]);
    for lane in 0..GROUP {
        let HermiteEdge { offset: at, normal: OctNormal(code) } = group[lane];
        offset[lane] = f32::from(at);
        u[lane] = f64::from(code as u16 as i16);
        v[lane] = f64::from((code >> 16) as u16 as i16);
    }
    let fraction = f32x8::from_slice(simd, &offset) / 65536.0;
    let u = f64x8::from_slice(simd, &u) / 32767.0;
    let v = f64x8::from_slice(simd, &v) / 32767.0;
    let z = one - u.abs() - v.abs();
    let fold = (zero - z).max(zero);
    let x = u.simd_lt(zero).select(u + fold, u - fold);
    let y = v.simd_lt(zero).select(v + fold, v - fold);
    let length = (x * x + y * y + z * z).sqrt();
    let normal = [narrowed(simd, x / length), narrowed(simd, y / length), narrowed(simd, z / length)];
    let decoded = in_fours([fraction, normal[0], normal[1], normal[2]]);
    let mut planes = [EdgePlane::default(); GROUP];
    for lane in 0..GROUP {
        let [fraction, x, y, z] = decoded[lane];
        planes[lane] = EdgePlane { fraction, normal: [x, y, z] };
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::OctNormal;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn groups_decode_as_single_edges_do(edges in prop::collection::vec(any::<(u16, u32)>(), 0..20)) {
            let edges: Vec<_> =
                edges.into_iter().map(|(offset, code)| HermiteEdge { offset, normal: OctNormal(code) }).collect();
            let mut planes = Vec::new();
            decode(&edges, &mut planes);
            let expected: Vec<_> = edges.iter().map(|edge| EdgePlane {
                fraction: edge.fraction() as f32, normal: edge.normal.to_vector().map(|c| c as f32),
            }).collect();
            prop_assert_eq!(planes, expected);
        }
    }
}
