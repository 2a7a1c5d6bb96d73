//! Hermite edges as contouring wants them: decoded.

use super::symmetric::dot;
use crate::brick::HermiteEdge;
use crate::wide::{Select, Simd, SimdBase, SimdFloat, dispatch, f64x8, level};

/// Edges decoded at a time.
const GROUP: usize = 8;

/// A sign change on the boundary of a cell: where it lies in cell coordinates and the normal there.
pub(super) type Plane = ([f64; 3], [f64; 3]);

/// How far a point is from such a plane.
#[inline]
pub(super) fn distance((point, normal): &Plane, at: [f64; 3]) -> f64 {
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
    let groups = edges.chunks(GROUP);
    let (one, zero) = (f64x8::splat(simd, 1.0), f64x8::splat(simd, 0.0));
    for group in groups {
        let (mut u, mut v) = ([0.0; GROUP], [0.0; GROUP]);
        for (lane, edge) in group.iter().enumerate() {
            u[lane] = f64::from(edge.normal.0 as u16 as i16);
            v[lane] = f64::from((edge.normal.0 >> 16) as u16 as i16);
        }
        let u = f64x8::from_slice(simd, &u) / 32767.0;
        let v = f64x8::from_slice(simd, &v) / 32767.0;
        let z = one - u.abs() - v.abs();
        let fold = (zero - z).max(zero);
        let x = u.simd_lt(zero).select(u + fold, u - fold);
        let y = v.simd_lt(zero).select(v + fold, v - fold);
        let length = (x * x + y * y + z * z).sqrt();
        let (x, y, z) = (x / length, y / length, z / length);
        for (lane, edge) in group.iter().enumerate() {
            let normal = [x[lane] as f32, y[lane] as f32, z[lane] as f32];
            planes.push(EdgePlane { fraction: edge.fraction() as f32, normal });
        }
    }
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
