//! The polygons of the dual contour around the crossings of a leaf, and which of them share corners.

use super::patch::Crossing;
use crate::contour::EdgeFacet;
use crate::lattice::mix;

/// Crossings, and the corners of the polygons around them.
#[derive(Default)]
pub(super) struct LeafPolygons {
    pub crossings: Vec<Crossing>,
    corners: Vec<[f32; 3]>,
    /// Where the corners of each polygon end.
    ends: Vec<usize>,
    /// Sides that have no opposite yet, of the polygon that is made.
    sides: Vec<[[f32; 3]; 2]>,
}

/// Which polygons have a corner in common.
pub(super) struct SharedCorners {
    /// The polygon of each corner.
    owners: Vec<u32>,
    /// Corners at the same place, in a circle.
    next: Vec<u32>,
}

fn bits(corner: [f32; 3]) -> [u32; 3] {
    corner.map(f32::to_bits)
}

impl LeafPolygons {
    /// Adds the polygon around a crossing, which is what triangles make up; drops it if it has no area.
    pub fn add(&mut self, crossing: Crossing, triangles: &[&EdgeFacet]) {
        let first = self.corners.len();
        self.outline(triangles);
        if self.corners.len() - first < 3 {
            self.corners.truncate(first);
            return;
        }
        self.crossings.push(crossing);
        self.ends.push(self.corners.len());
    }

    /// Appends the corners of the polygon that triangles make up, in order.
    fn outline(&mut self, triangles: &[&EdgeFacet]) {
        let sides = &mut self.sides;
        sides.clear();
        for facet in triangles {
            let [a, b, c] = facet.corners;
            for [from, to] in [[a, b], [b, c], [c, a]] {
                // A diagonal is a side of two triangles.
                match sides.iter().position(|[f, t]| bits(*f) == bits(to) && bits(*t) == bits(from)) {
                    Some(n) => drop(sides.swap_remove(n)),
                    None => sides.push([from, to]),
                }
            }
        }
        let Some(&[first, mut at]) = sides.first() else { return };
        let most = self.corners.len() + sides.len();
        self.corners.push(first);
        while bits(at) != bits(first) && self.corners.len() < most {
            self.corners.push(at);
            match sides.iter().find(|[from, _]| bits(*from) == bits(at)) {
                Some([_, to]) => at = *to,
                None => break,
            }
        }
    }

    fn range(&self, polygon: usize) -> std::ops::Range<usize> {
        let first = if polygon > 0 { self.ends[polygon - 1] } else { 0 };
        first..self.ends[polygon]
    }

    /// The corners of a polygon, in order.
    pub fn corners(&self, polygon: usize) -> &[[f32; 3]] {
        &self.corners[self.range(polygon)]
    }

    /// Finds what shares corners, in a table of places with room for twice as many.
    pub fn shared(&self) -> SharedCorners {
        let owners: Vec<u32> =
            (0..self.ends.len()).flat_map(|n| self.range(n).map(move |_| n as u32)).collect();
        let mut next: Vec<u32> = (0..self.corners.len() as u32).collect();
        let size = (2 * self.corners.len()).next_power_of_two();
        let mut table = vec![u32::MAX; size];
        for (n, corner) in self.corners.iter().enumerate() {
            let [x, y, z] = bits(*corner).map(u64::from);
            let mut slot = mix(mix(x << 32 | y) ^ z) as usize % size;
            loop {
                match table[slot] {
                    u32::MAX => table[slot] = n as u32,
                    other if bits(self.corners[other as usize]) == bits(*corner) => {
                        next.swap(n, other as usize);
                    }
                    _ => {
                        slot = (slot + 1) % size;
                        continue;
                    }
                }
                break;
            }
        }
        SharedCorners { owners, next }
    }

    /// The other polygons that share a corner with one, in order.
    pub fn beside(&self, polygon: usize, shared: &SharedCorners, found: &mut Vec<u32>) {
        found.clear();
        for corner in self.range(polygon) {
            let mut at = shared.next[corner] as usize;
            while at != corner {
                found.push(shared.owners[at]);
                at = shared.next[at] as usize;
            }
        }
        found.sort_unstable();
        found.dedup();
        found.retain(|&other| other != polygon as u32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Axis;

    #[test]
    fn polygons_beside_one_share_a_corner() {
        let facet = |corners: [[f32; 3]; 3]| EdgeFacet {
            axis: Axis::X,
            low: [0; 3],
            low_is_inside: true,
            fraction: 0.5,
            corners,
        };
        let place = |n: u64| [0, 1, 2].map(|a| (mix(3 * n + a) % 3) as f32);
        let mut polygons = LeafPolygons::default();
        let mut expected: Vec<Vec<[u32; 3]>> = Vec::new();
        for n in 0..60 {
            let corners = [place(4 * n), place(4 * n + 1), place(4 * n + 2), place(4 * n + 3)];
            let [a, b, c, d] = corners;
            let halves = [facet([a, b, c]), facet([a, c, d])];
            let before = polygons.crossings.len();
            polygons.add(([0.0; 3], [0.0, 0.0, 1.0]), &halves.iter().collect::<Vec<_>>());
            if polygons.crossings.len() > before {
                expected.push(polygons.corners(before).iter().map(|c| bits(*c)).collect());
            }
        }
        assert!(expected.len() > 30);
        let shared = polygons.shared();
        let mut found = Vec::new();
        for (n, corners) in expected.iter().enumerate() {
            polygons.beside(n, &shared, &mut found);
            let meets = |other: &Vec<[u32; 3]>| other.iter().any(|corner| corners.contains(corner));
            let all = (0..expected.len()).filter(|&m| m != n && meets(&expected[m]));
            assert_eq!(found, all.map(|m| m as u32).collect::<Vec<_>>());
        }
    }
}
