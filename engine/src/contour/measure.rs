//! Normals, area and volume of facets, eight at a time in vectors, and what a file needs of them.

use super::polygons::Facet;
use super::sink::Encoding;
use crate::wide::{Select, Simd, SimdBase, SimdFloat, dispatch, f64x8, level};

/// Facets in a vector.
const GROUP: usize = 8;
/// Facets that are measured before they are encoded: few enough to stay in the nearest cache.
const BLOCK: usize = 128;

/// Area and volume of facets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measured {
    /// In square world units.
    pub area: f64,
    /// Signed volume under the facets, seen from the centre, in cubic world units.
    pub volume: f64,
}

/// Measures the facets, and appends to `bytes` what the encoding makes of them.
pub(super) fn measure(
    facets: &[Facet],
    centre: [f64; 3],
    encoding: Option<Encoding>,
    bytes: &mut Vec<u8>,
) -> Measured {
    let mut measured = Measured::default();
    for block in facets.chunks(BLOCK) {
        let mut normals = [[0.0; 3]; BLOCK];
        let sums = dispatch!(level(), simd => measure_block(simd, block, centre, &mut normals));
        measured.area += sums.area;
        measured.volume += sums.volume;
        if let Some(encoding) = encoding {
            (encoding.facets)(block, &normals[..block.len()], bytes);
        }
    }
    measured
}

#[inline(always)]
fn measure_block<S: Simd>(
    simd: S,
    facets: &[Facet],
    centre: [f64; 3],
    normals: &mut [[f32; 3]; BLOCK],
) -> Measured {
    let zero = f64x8::splat(simd, 0.0);
    let (mut doubled, mut sixfold) = (zero, zero);
    for (group, normals) in facets.chunks(GROUP).zip(normals.chunks_mut(GROUP)) {
        // Lanes that are left are facets without area.
        let mut corners = [[[0.0; GROUP]; 3]; 3];
        for (lane, facet) in group.iter().enumerate() {
            for (corner, at) in corners.iter_mut().zip(&facet.corners) {
                for (lanes, &c) in corner.iter_mut().zip(at) {
                    lanes[lane] = f64::from(c);
                }
            }
        }
        let [mut from, mut u, mut v] = [[zero; 3]; 3];
        for a in 0..3 {
            let at = f64x8::from_slice(simd, &corners[0][a]);
            u[a] = f64x8::from_slice(simd, &corners[1][a]) - at;
            v[a] = f64x8::from_slice(simd, &corners[2][a]) - at;
            from[a] = at - centre[a];
        }
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        doubled += length;
        sixfold += n[0] * from[0] + n[1] * from[1] + n[2] * from[2];
        let has_area = length.simd_gt(zero);
        for a in 0..3 {
            let unit = has_area.select(n[a] / length, zero);
            let unit = unit.as_array();
            for (lane, normal) in normals.iter_mut().enumerate() {
                normal[a] = unit[lane] as f32;
            }
        }
    }
    let (mut area, mut volume) = (0.0, 0.0);
    for lane in 0..GROUP {
        area += doubled[lane];
        volume += sixfold[lane];
    }
    Measured { area: area / 2.0, volume: volume / 6.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tetrahedron_is_measured_and_facets_without_area_have_no_normal() {
        let at = |n: u32| [[5.0, 0.0, 0.0], [7.0, 0.0, 0.0], [5.0, 2.0, 0.0], [5.0, 0.0, 2.0]][n as usize];
        let corners = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [0, 1, 1]];
        let facets = corners.map(|ids: [u32; 3]| Facet { ids, corners: ids.map(at) });
        let encoding = Encoding {
            vertices: |_, _| {},
            facets: |_, normals, bytes| {
                bytes.extend(normals.as_flattened().iter().map(|&c| (c * 100.0).round() as i8 as u8));
            },
        };
        let mut bytes = Vec::new();
        let Measured { area, volume } = measure(&facets, [1.0, 2.0, 3.0], Some(encoding), &mut bytes);
        assert!((area - 6.0 - 2.0 * 3f64.sqrt()).abs() < 1e-12 && (volume - 4.0 / 3.0).abs() < 1e-12);
        let normals: Vec<i8> = bytes.iter().map(|&b| b as i8).collect();
        assert_eq!(normals, [0, 0, -100, 0, -100, 0, -100, 0, 0, 58, 58, 58, 0, 0, 0]);
        let many: Vec<Facet> = facets.iter().copied().cycle().take(5 * 77).collect();
        let all = measure(&many, [1.0, 2.0, 3.0], None, &mut bytes);
        assert!((all.area / area - 77.0).abs() < 1e-9 && (all.volume / volume - 77.0).abs() < 1e-9);
    }
}
