//! Sorting triangles into the cubes they touch.

use crate::lattice::{NodeKey, ROOT_BITS, Triangle, Units, bounds, normal, touches_cube};

/// Finds the descendants of a node, `stride` levels below it, that a triangle touches. A descendant's cube
/// is the closed one from its sample 0 to its sample 32.
#[derive(Clone, Copy)]
pub(super) struct Binner {
    origin: Units,
    /// log₂ of a descendant's edge in units.
    shift: u32,
    /// Descendants along an axis, minus one.
    last: i32,
    stride: u32,
}

impl Binner {
    pub fn new(node: NodeKey, stride: u8) -> Binner {
        let stride = u32::from(stride);
        let shift = ROOT_BITS - u32::from(node.level()) - stride;
        Binner { origin: node.base().map(|b| b + 1), shift, last: (1 << stride) - 1, stride }
    }

    /// Number of descendants.
    pub fn cells(&self) -> usize {
        1 << (3 * self.stride)
    }

    /// Calls `cell` with the Morton number, within the node, of every descendant touched.
    #[inline]
    pub fn for_touched(&self, t: &Triangle, mut cell: impl FnMut(usize)) {
        let (min, max) = bounds(t);
        // Vertices are even and cube faces odd, so no coordinate lies on a face.
        let from: Units = std::array::from_fn(|a| (min[a] - self.origin[a]) >> self.shift);
        let to: Units = std::array::from_fn(|a| (max[a] - self.origin[a]) >> self.shift);
        let within = (0..3).all(|a| from[a] >= 0 && to[a] <= self.last);
        if within && from == to {
            return cell(self.morton(from));
        }
        self.for_touched_of_many(t, from, to, within, &mut cell);
    }

    #[inline(never)]
    fn for_touched_of_many(
        &self,
        t: &Triangle,
        from: Units,
        to: Units,
        within: bool,
        cell: &mut dyn FnMut(usize),
    ) {
        // A triangle that leaves the node may miss a cube that its bounding box meets. One that stays inside
        // and spans cubes along one axis only touches them all, because it is connected.
        let surely = within && (0..3).filter(|&a| from[a] < to[a]).count() == 1;
        let (first, last) = (from.map(|c| c.max(0)), to.map(|c| c.min(self.last)));
        let size = 1 << self.shift;
        let corners: [Units; 3] = t.map(|p| std::array::from_fn(|a| (p[a] - self.origin[a]) >> self.shift));
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let at = [x, y, z];
                    let low = std::array::from_fn(|a| self.origin[a] + (at[a] << self.shift));
                    // A cube that holds a vertex needs no test; for a small facet that is most of them.
                    if surely || corners.contains(&at) || touches_cube(t, low, size) {
                        cell(self.morton(at));
                    }
                }
            }
        }
    }

    #[inline]
    fn morton(&self, at: Units) -> usize {
        (0..self.stride).fold(0, |m, bit| {
            let octant = (at[0] >> bit & 1) | (at[1] >> bit & 1) << 1 | (at[2] >> bit & 1) << 2;
            m | (octant as usize) << (3 * bit)
        })
    }

    /// Indices of `triangles` by descendant. Triangles without area are left out: they cross nothing.
    pub fn sort_indices(&self, triangles: &[Triangle]) -> CellLists {
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(triangles.len() * 3 / 2);
        let mut starts = vec![0u32; self.cells() + 1];
        for (index, t) in triangles.iter().enumerate() {
            if normal(t) == [0; 3] {
                continue;
            }
            self.for_touched(t, |cell| {
                pairs.push((cell as u32, index as u32));
                starts[cell + 1] += 1;
            });
        }
        (1..starts.len()).for_each(|c| starts[c] += starts[c - 1]);
        let mut next = starts.clone();
        let mut indices = vec![0; pairs.len()];
        for (cell, index) in pairs {
            indices[next[cell as usize] as usize] = index;
            next[cell as usize] += 1;
        }
        CellLists { starts, indices }
    }
}

/// For each descendant, in Morton order, the indices of the triangles that touch it.
pub(super) struct CellLists {
    starts: Vec<u32>,
    indices: Vec<u32>,
}

impl CellLists {
    pub fn of(&self, cell: usize) -> &[u32] {
        &self.indices[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

/// A run of snapped triangles sorted by the job that needs them; one that touches several jobs' cubes is
/// repeated.
pub(super) struct SortedRun {
    starts: Vec<u32>,
    triangles: Vec<Triangle>,
}

impl SortedRun {
    /// Sorts `triangles`; those without area are left out.
    pub fn new(binner: &Binner, triangles: &[Triangle]) -> SortedRun {
        let lists = binner.sort_indices(triangles);
        let triangles = lists.indices.iter().map(|&i| triangles[i as usize]).collect();
        SortedRun { starts: lists.starts, triangles }
    }

    pub fn of(&self, cell: usize) -> &[Triangle] {
        &self.triangles[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}
