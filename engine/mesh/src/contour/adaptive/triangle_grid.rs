//! The triangles in one cube, and which of them meet.

use super::bounds::{Bounds, Sector, TriangleCorners, are_apart, is_fan, meets, normal, wide};
use super::cross_leaf::{Merge, MergeTarget, is_wide};
use super::vertex_merge::{bits, hash as names_hash};
use crate::predicates::{has_area, meet_by_place};
use crate::wide::{Simd, SimdBase, SimdMask, dispatch, f32x16, level};
use glam::DVec3;
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;

/// A cube is divided into this many blocks an axis.
const BLOCKS: usize = 8;

/// Where a block is, by axis.
type Block = [u8; 3];

/// A triangle in a room.
struct GridTriangle {
    corners: [u32; 3],
    bounds: Bounds,
    /// The blocks that the least and the greatest coordinates are in or next to.
    blocks: [Block; 2],
    /// It is others than when it was last looked at.
    is_fresh: bool,
    /// It may reach farther than the leaves around its own.
    is_wide: bool,
}

/// A cube and the triangles whose boxes meet it.
pub(super) struct TriangleGrid {
    /// Lower and upper corner; the upper border is another cube's.
    cube: Bounds,
    /// Only triangles that meet one of these may meet fresh ones.
    reach: Vec<Bounds>,
    /// Blocks per world unit, by axis.
    blocks_per_unit: [f32; 3],
    places: Vec<[f32; 3]>,
    merges: Vec<Option<Merge>>,
    numbers: HashTable<u32>,
    /// Those of polygons with a merged corner.
    merged: Vec<GridTriangle>,
    /// As [`super::leaf_triangles::LeafTriangles::lone`].
    lone: Vec<(u32, Merge)>,
    /// The others.
    plain: Vec<GridTriangle>,
}

impl TriangleGrid {
    /// A cube in which every fresh triangle is within one of the boxes `reach`.
    pub(super) fn new(cube: Bounds, reach: Vec<Bounds>) -> TriangleGrid {
        let blocks = |n: usize| BLOCKS as f32 / (cube[1][n] - cube[0][n]);
        TriangleGrid {
            cube,
            reach,
            blocks_per_unit: [blocks(0), blocks(1), blocks(2)],
            places: Vec::new(),
            merges: Vec::new(),
            numbers: HashTable::new(),
            merged: Vec::new(),
            lone: Vec::new(),
            plain: Vec::new(),
        }
    }

    /// Whether a triangle with these bounds is to be added.
    pub(super) fn wants(&self, own: &Bounds) -> bool {
        meets(own, &self.cube) && self.reach.iter().any(|reach| meets(own, reach))
    }

    /// Makes room for so many more vertices.
    pub(super) fn reserve(&mut self, vertices: usize) {
        let TriangleGrid { places, merges, numbers, .. } = self;
        places.reserve(vertices);
        merges.reserve(vertices);
        numbers.reserve(vertices, |&number| hash(&places[number as usize]));
    }

    /// The number of the vertex at a place.
    pub(super) fn number(&mut self, place: [f32; 3], merge: Option<Merge>) -> u32 {
        let TriangleGrid { places, merges, numbers, .. } = self;
        let is_same = |&number: &u32| places[number as usize] == place;
        match numbers.entry(hash(&place), is_same, |&number| hash(&places[number as usize])) {
            Entry::Occupied(entry) => *entry.get(),
            Entry::Vacant(entry) => {
                let number = places.len() as u32;
                entry.insert(number);
                places.push(place);
                merges.push(merge);
                number
            }
        }
    }

    /// Adds a triangle of numbered vertices, with these bounds; without a merged one, `lone` is what is merged at its
    /// polygon.
    pub(super) fn add(&mut self, corners: [u32; 3], bounds: &Bounds, lone: Option<Merge>, is_fresh: bool) {
        let merges = corners.map(|corner| self.merges[corner as usize]);
        let is_wide = merges.into_iter().any(is_wide);
        let blocks = bounds.map(|end| self.block(end));
        let placed = GridTriangle { corners, bounds: *bounds, blocks, is_fresh, is_wide };
        self.lone.extend(lone.map(|merge| (self.merged.len() as u32, merge)));
        match lone.is_some() || merges.iter().any(Option::is_some) {
            true => self.merged.push(placed),
            false => self.plain.push(placed),
        }
    }

    /// What is to be given up for triangles that meet: of each pair what has the largest nodes.
    pub(super) fn meetings(mut self) -> Vec<MergeTarget> {
        if self.merged.is_empty() {
            return Vec::new();
        }
        let count = self.merged.len();
        let is_near = self.blocks_of_merged();
        let mut plain = std::mem::take(&mut self.plain);
        plain.retain(|placed| {
            let mut is_any = false;
            for_blocks(&placed.blocks, |block| is_any |= is_near[block]);
            is_any
        });
        let mut all = std::mem::take(&mut self.merged);
        all.append(&mut plain);
        let normals: Vec<DVec3> = all.iter().map(|placed| normal(&self.corners(placed))).collect();
        let mut search = Search {
            room: &self,
            all: &all,
            merged: count,
            is_near: &is_near,
            normals: &normals,
            found: Vec::new(),
        };
        search.slim();
        search.around_vertices();
        search.elsewhere();
        let mut found = search.found;
        found.sort_unstable();
        found.dedup();
        found
    }

    /// For each block whether a triangle of a polygon with a merged corner may be there.
    fn blocks_of_merged(&self) -> Vec<bool> {
        let mut found = vec![false; BLOCKS.pow(3)];
        self.merged.iter().for_each(|placed| for_blocks(&placed.blocks, |block| found[block] = true));
        found
    }

    fn corners(&self, placed: &GridTriangle) -> TriangleCorners {
        at(&self.places, &placed.corners)
    }

    /// Whether a place is in the cube and in no other one.
    fn holds(&self, place: &[f32; 3]) -> bool {
        (0..3).all(|a| self.cube[0][a] <= place[a] && place[a] < self.cube[1][a])
    }

    /// The block that a place is in or next to.
    #[inline]
    fn block(&self, place: [f32; 3]) -> Block {
        let along = |a: usize| (place[a] - self.cube[0][a]) * self.blocks_per_unit[a];
        [0, 1, 2].map(|a| along(a).clamp(0.0, (BLOCKS - 1) as f32) as u8)
    }
}

#[inline]
fn block_number([i, j, k]: Block) -> usize {
    (usize::from(k) * BLOCKS + usize::from(j)) * BLOCKS + usize::from(i)
}

/// Calls `each` with the numbers of all blocks between two.
#[inline]
fn for_blocks([low, high]: &[Block; 2], mut each: impl FnMut(usize)) {
    for k in low[2]..=high[2] {
        for j in low[1]..=high[1] {
            let row = block_number([0, j, k]);
            (low[0]..=high[0]).for_each(|i| each(row + usize::from(i)));
        }
    }
}

#[inline]
fn at(places: &[[f32; 3]], [a, b, c]: &[u32; 3]) -> TriangleCorners {
    [places[*a as usize], places[*b as usize], places[*c as usize]]
}

fn hash(place: &[f32; 3]) -> u64 {
    names_hash(&bits(place))
}

/// Looks for triangles of a room that meet.
struct Search<'a> {
    room: &'a TriangleGrid,
    /// All triangles, the first `merged` of which are of polygons with a merged corner.
    all: &'a [GridTriangle],
    merged: usize,
    /// By block, whether there is one of those.
    is_near: &'a [bool],
    normals: &'a [DVec3],
    found: Vec<MergeTarget>,
}

impl Search<'_> {
    /// Triangles whose corners are on a line.
    fn slim(&mut self) {
        for n in (0..self.merged).filter(|n| self.normals[*n] == DVec3::ZERO) {
            if !has_area(&self.room.corners(&self.all[n])) {
                self.give_up(&[n]);
            }
        }
    }

    /// Triangles with a common vertex in the cube.
    fn around_vertices(&mut self) {
        let (starts, numbers) = listed(self.room.places.len(), self.all, |placed, each| {
            placed.corners.iter().for_each(|corner| each(*corner as usize));
        });
        let mut sectors: Vec<Sector> = Vec::new();
        for vertex in 0..self.room.places.len() {
            let star = &numbers[starts[vertex] as usize..starts[vertex + 1] as usize];
            let has_merged = star.first().is_some_and(|first| (*first as usize) < self.merged);
            let is_fresh = |n: &u32| self.all[*n as usize].is_fresh;
            if !has_merged || !self.room.holds(&self.room.places[vertex]) || !star.iter().any(is_fresh) {
                continue;
            }
            sectors.clear();
            sectors.extend(star.iter().map(|n| self.sector(*n as usize, vertex as u32)));
            if is_fan(&sectors) {
                continue;
            }
            for (n, &first) in star.iter().enumerate() {
                for &second in &star[n + 1..] {
                    self.compare(first as usize, second as usize);
                }
            }
        }
    }

    fn sector(&self, triangle: usize, vertex: u32) -> Sector {
        let corners = self.all[triangle].corners;
        let n = (0..3).find(|n| corners[*n] == vertex).unwrap_or(0);
        let at = |n: usize| wide(self.room.places[corners[n % 3] as usize]);
        (self.normals[triangle], [at(n + 1) - at(n), at(n + 2) - at(n)])
    }

    /// Triangles without a common vertex.
    fn elsewhere(&mut self) {
        let (starts, numbers) = listed(BLOCKS.pow(3), self.all, |placed, each| {
            for_blocks(&placed.blocks, |block| {
                if self.is_near[block] {
                    each(block);
                }
            });
        });
        let boxes = Boxes::of(numbers.iter().map(|n| &self.all[*n as usize].bounds));
        let mut pairs = Vec::new();
        for block in 0..BLOCKS.pow(3) {
            let [start, end] = [starts[block], starts[block + 1]].map(|n| n as usize);
            let merged = numbers[start..end].partition_point(|n| (*n as usize) < self.merged);
            if merged == 0 {
                continue;
            }
            pairs.clear();
            dispatch!(level(), simd => boxes.that_meet(simd, start, start + merged, end, &mut pairs));
            for &(first, second) in &pairs {
                let [first, second] = [first, second].map(|n| numbers[n as usize] as usize);
                if self.is_asked(block, &self.all[first], &self.all[second]) {
                    self.compare_apart(first, second);
                }
            }
        }
    }

    /// Whether two triangles whose boxes meet have no common vertex and are to be compared here, and not in a block or a cube
    /// before.
    #[inline]
    fn is_asked(&self, block: usize, a: &GridTriangle, b: &GridTriangle) -> bool {
        // Of the least coordinates that they have in common, because these blocks are in order.
        let first = [0, 1, 2].map(|n| a.blocks[0][n].max(b.blocks[0][n]));
        if block_number(first) != block
            || !(a.is_fresh || b.is_fresh)
            || a.corners.iter().any(|corner| b.corners.contains(corner))
        {
            return false;
        }
        // Not every cube that the box of a wide triangle meets knows of it.
        let first = [0, 1, 2].map(|n| a.bounds[0][n].max(b.bounds[0][n]));
        a.is_wide || b.is_wide || self.room.holds(&first)
    }

    fn compare_apart(&mut self, first: usize, second: usize) {
        let (a, b) = (self.room.corners(&self.all[first]), self.room.corners(&self.all[second]));
        if !are_apart(&a, &b, [self.normals[first], self.normals[second]]) {
            self.compare(first, second);
        }
    }

    /// Gives something up if two triangles, one of them of a polygon with a merged corner, meet.
    fn compare(&mut self, first: usize, second: usize) {
        let [a, b] = [first, second].map(|n| &self.all[n]);
        if first.min(second) >= self.merged || !(a.is_fresh || b.is_fresh) {
            return;
        }
        if meet_by_place(&self.room.corners(a), &self.room.corners(b)) {
            self.give_up(&[first, second]);
        }
    }

    /// Gives up what has the largest nodes at the corners of some triangles, or of their polygons.
    fn give_up(&mut self, triangles: &[usize]) {
        let of = |n: &usize| {
            let lone = self.room.lone.binary_search_by_key(&(*n as u32), |(at, _)| *at);
            let lone = lone.ok().map(|at| self.room.lone[at].1).filter(|_| *n < self.merged);
            self.all[*n].corners.map(|corner| self.room.merges[corner as usize]).into_iter().chain([lone])
        };
        let merges: Vec<Merge> = triangles.iter().flat_map(of).flatten().collect();
        let most = merges.iter().map(|(_, level)| *level).max();
        self.found.extend(merges.iter().filter(|(_, level)| Some(*level) == most).map(|(taken, _)| *taken));
    }
}

/// For each of `count` places where in the second list the numbers of the triangles at it begin, ascending; `at` calls what
/// it is given with the places that one is at.
fn listed(
    count: usize,
    all: &[GridTriangle],
    at: impl Fn(&GridTriangle, &mut dyn FnMut(usize)),
) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; count + 2];
    for one in all {
        at(one, &mut |place| starts[place + 2] += 1);
    }
    for n in 2..starts.len() {
        starts[n] += starts[n - 1];
    }
    let mut numbers = vec![0; starts[count + 1] as usize];
    for (n, one) in (0..).zip(all) {
        at(one, &mut |place| {
            numbers[starts[place + 1] as usize] = n;
            starts[place + 1] += 1;
        });
    }
    (starts, numbers)
}

/// Boxes, to be compared sixteen at a time.
struct Boxes {
    /// By axis and end, one number a box, and [`LANES`] more.
    ends: [Vec<f32>; 6],
}

/// Boxes in a vector.
const LANES: usize = 16;

impl Boxes {
    fn of<'a>(boxes: impl ExactSizeIterator<Item = &'a Bounds>) -> Boxes {
        let mut ends = [const { Vec::new() }; 6];
        ends.iter_mut().for_each(|end| end.reserve_exact(boxes.len() + LANES));
        for [low, high] in boxes {
            for a in 0..3 {
                ends[a].push(low[a]);
                ends[3 + a].push(high[a]);
            }
        }
        ends.iter_mut().for_each(|end| end.resize(end.len() + LANES, f32::NAN));
        Boxes { ends }
    }

    /// Adds the pairs of which the first is from `start` on and before `middle` and the second after it and before `end`
    /// and that have a point in common, as [`meets`] says.
    #[inline(always)]
    fn that_meet<S: Simd>(
        &self,
        simd: S,
        start: usize,
        middle: usize,
        end: usize,
        pairs: &mut Vec<(u32, u32)>,
    ) {
        let [x, y, z, far_x, far_y, far_z] = &self.ends;
        for first in start..middle {
            // Spelled out: a closure may stay a call, compiled for the narrowest vectors.
            let low =
                [f32x16::splat(simd, x[first]), f32x16::splat(simd, y[first]), f32x16::splat(simd, z[first])];
            let high = [
                f32x16::splat(simd, far_x[first]),
                f32x16::splat(simd, far_y[first]),
                f32x16::splat(simd, far_z[first]),
            ];
            let mut at = first + 1;
            while at < end {
                let along_x = low[0].simd_le(f32x16::from_slice(simd, &far_x[at..at + LANES]))
                    & f32x16::from_slice(simd, &x[at..at + LANES]).simd_le(high[0]);
                let along_y = low[1].simd_le(f32x16::from_slice(simd, &far_y[at..at + LANES]))
                    & f32x16::from_slice(simd, &y[at..at + LANES]).simd_le(high[1]);
                let along_z = low[2].simd_le(f32x16::from_slice(simd, &far_z[at..at + LANES]))
                    & f32x16::from_slice(simd, &z[at..at + LANES]).simd_le(high[2]);
                let mut bits = (along_x & along_y & along_z).to_bitmask();
                if end - at < LANES {
                    bits &= (1 << (end - at)) - 1;
                }
                while bits != 0 {
                    pairs.push((first as u32, (at + bits.trailing_zeros() as usize) as u32));
                    bits &= bits - 1;
                }
                at += LANES;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn boxes_meet_many_at_a_time_as_one_by_one(
            places in prop::collection::vec(prop::array::uniform6(0u8..9), 1..60),
            [start, middle, end] in prop::array::uniform3(0usize..60),
        ) {
            let bounds = |place: &[u8; 6]| -> Bounds {
                let [low, size] = [0, 3].map(|n| [0, 1, 2].map(|a| f32::from(place[n + a])));
                [low, std::array::from_fn(|a| low[a] + size[a])]
            };
            let all: Vec<Bounds> = places.iter().map(bounds).collect();
            let mut range = [start, middle, end].map(|n| n.min(all.len()));
            range.sort_unstable();
            let [start, middle, end] = range;
            let mut found = Vec::new();
            let boxes = Boxes::of(all.iter());
            dispatch!(level(), simd => boxes.that_meet(simd, start, middle, end, &mut found));
            let pairs = (start..middle).flat_map(|a| (a + 1..end).map(move |b| (a, b)));
            let met = pairs.filter(|(a, b)| meets(&all[*a], &all[*b]));
            prop_assert_eq!(found, met.map(|(a, b)| (a as u32, b as u32)).collect::<Vec<_>>());
        }
    }
}
