//! The triangles in one cube, and which of them meet.

use super::across::Taken;
use super::bounds::{Bounds, Corners, Sector, are_apart, bounds, is_fan, meets, normal, wide};
use super::made::{Merge, is_wide};
use crate::check::{has_area, hash_bits, meet_by_place};
use glam::DVec3;
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;

/// A cube is divided into this many blocks an axis.
const BLOCKS: usize = 8;

/// A triangle in a room.
struct Placed {
    corners: [u32; 3],
    bounds: Bounds,
    /// As [`super::made::Made::lone`].
    lone: Option<Merge>,
    /// It is others than when it was last looked at.
    is_fresh: bool,
    /// It may reach farther than the leaves around its own.
    is_wide: bool,
}

/// A cube and the triangles whose boxes meet it.
pub(super) struct Room {
    /// Lower and upper corner; the upper border is another cube's.
    cube: Bounds,
    /// Only triangles that meet this may meet fresh ones.
    reach: Bounds,
    /// Blocks per world unit, by axis.
    blocks_per_unit: [f32; 3],
    places: Vec<[f32; 3]>,
    merges: Vec<Option<Merge>>,
    numbers: HashTable<u32>,
    /// Those of polygons with a merged corner.
    merged: Vec<Placed>,
    /// The others.
    plain: Vec<Placed>,
}

impl Room {
    /// A cube in which all fresh triangles are within `reach`.
    pub(super) fn new(cube: Bounds, reach: Bounds) -> Room {
        let blocks = |n: usize| BLOCKS as f32 / (cube[1][n] - cube[0][n]);
        Room {
            cube,
            reach,
            blocks_per_unit: [blocks(0), blocks(1), blocks(2)],
            places: Vec::new(),
            merges: Vec::new(),
            numbers: HashTable::new(),
            merged: Vec::new(),
            plain: Vec::new(),
        }
    }

    /// Whether a triangle with these bounds is to be added.
    pub(super) fn wants(&self, own: &Bounds) -> bool {
        meets(own, &self.cube) && meets(own, &self.reach)
    }

    /// The number of the vertex at a place.
    pub(super) fn number(&mut self, place: [f32; 3], merge: Option<Merge>) -> u32 {
        let Room { places, merges, numbers, .. } = self;
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

    /// Adds a triangle of numbered vertices; without a merged one, `lone` is what is merged at its polygon.
    pub(super) fn add(&mut self, corners: [u32; 3], lone: Option<Merge>, is_fresh: bool) {
        let bounds = bounds(&at(&self.places, &corners));
        let is_wide = corners.iter().any(|corner| is_wide(self.merges[*corner as usize]));
        let placed = Placed { corners, bounds, lone, is_fresh, is_wide };
        match lone.is_some() || corners.iter().any(|corner| self.merges[*corner as usize].is_some()) {
            true => self.merged.push(placed),
            false => self.plain.push(placed),
        }
    }

    /// What is to be given up for triangles that meet: of each pair what has the largest nodes.
    pub(super) fn meetings(mut self) -> Vec<Taken> {
        if self.merged.is_empty() {
            return Vec::new();
        }
        let count = self.merged.len();
        let mut all = std::mem::take(&mut self.merged);
        all.append(&mut self.plain);
        let normals: Vec<DVec3> = all.iter().map(|placed| normal(&self.corners(placed))).collect();
        let mut search =
            Search { room: &self, all: &all, merged: count, normals: &normals, found: Vec::new() };
        search.slim();
        search.around_vertices();
        search.elsewhere();
        let mut found = search.found;
        found.sort_unstable();
        found.dedup();
        found
    }

    fn corners(&self, placed: &Placed) -> Corners {
        at(&self.places, &placed.corners)
    }

    /// Whether a place is in the cube and in no other one.
    fn holds(&self, place: &[f32; 3]) -> bool {
        (0..3).all(|a| self.cube[0][a] <= place[a] && place[a] < self.cube[1][a])
    }

    /// The block of the cube that a coordinate is in or next to.
    #[inline]
    fn block(&self, axis: usize, at: f32) -> usize {
        // A cast takes what is below for 0.
        (((at - self.cube[0][axis]) * self.blocks_per_unit[axis]) as usize).min(BLOCKS - 1)
    }

    /// The number of the block that a place is in or next to.
    #[inline]
    fn block_at(&self, [x, y, z]: [f32; 3]) -> usize {
        (self.block(2, z) * BLOCKS + self.block(1, y)) * BLOCKS + self.block(0, x)
    }

    /// The numbers of all blocks that a box meets.
    fn blocks(&self, [low, high]: &Bounds) -> impl Iterator<Item = usize> {
        let along = |axis: usize| self.block(axis, low[axis])..=self.block(axis, high[axis]);
        let (i, j, k) = (along(0), along(1), along(2));
        k.flat_map(move |k| j.clone().map(move |j| (k * BLOCKS + j) * BLOCKS))
            .flat_map(move |row| i.clone().map(move |i| row + i))
    }
}

#[inline]
fn at(places: &[[f32; 3]], [a, b, c]: &[u32; 3]) -> Corners {
    [places[*a as usize], places[*b as usize], places[*c as usize]]
}

fn hash(place: &[f32; 3]) -> u64 {
    // Zeros with a sign are the same place.
    hash_bits(place.map(|c| u64::from((c + 0.0).to_bits())))
}

/// Looks for triangles of a room that meet.
struct Search<'a> {
    room: &'a Room,
    /// All triangles, the first `merged` of which are of polygons with a merged corner.
    all: &'a [Placed],
    merged: usize,
    normals: &'a [DVec3],
    found: Vec<Taken>,
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
        let (starts, numbers) = listed(self.room.places.len(), self.all, |placed| {
            placed.corners.iter().map(|corner| *corner as usize)
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
        let (starts, numbers) = listed(BLOCKS.pow(3), self.all, |placed| self.room.blocks(&placed.bounds));
        let merged = self.merged as u32;
        for block in 0..BLOCKS.pow(3) {
            let here = &numbers[starts[block] as usize..starts[block + 1] as usize];
            for (n, &first) in here.iter().enumerate().take_while(|(_, first)| **first < merged) {
                for &second in &here[n + 1..] {
                    let (a, b) = (&self.all[first as usize], &self.all[second as usize]);
                    if meets(&a.bounds, &b.bounds) && self.is_asked(block, a, b) {
                        self.compare_apart(first as usize, second as usize);
                    }
                }
            }
        }
    }

    /// Whether two triangles whose boxes meet have no common vertex and are to be compared here, and not in a block or a cube
    /// before.
    fn is_asked(&self, block: usize, a: &Placed, b: &Placed) -> bool {
        if a.corners.iter().any(|corner| b.corners.contains(corner)) {
            return false;
        }
        let low = |n: usize| a.bounds[0][n].max(b.bounds[0][n]);
        let first = [low(0), low(1), low(2)];
        // Not every cube that the box of a wide triangle meets knows of it.
        self.room.block_at(first) == block
            && (a.is_fresh || b.is_fresh)
            && (a.is_wide || b.is_wide || self.room.holds(&first))
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
        let of = |placed: &Placed| placed.corners.map(|corner| self.room.merges[corner as usize]);
        let all = triangles.iter().map(|n| &self.all[*n]);
        let merges: Vec<Merge> =
            all.flat_map(|placed| of(placed).into_iter().chain([placed.lone])).flatten().collect();
        let most = merges.iter().map(|(_, level)| *level).max();
        self.found.extend(merges.iter().filter(|(_, level)| Some(*level) == most).map(|(taken, _)| *taken));
    }
}

/// For each of `count` places where in the second list the numbers of the triangles at it begin, ascending; `at` says at
/// which places one is.
fn listed<'a, I: Iterator<Item = usize>>(
    count: usize,
    all: &'a [Placed],
    at: impl Fn(&'a Placed) -> I,
) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; count + 2];
    for one in all {
        at(one).for_each(|place| starts[place + 2] += 1);
    }
    for n in 2..starts.len() {
        starts[n] += starts[n - 1];
    }
    let mut numbers = vec![0; starts[count + 1] as usize];
    for (n, one) in (0..).zip(all) {
        at(one).for_each(|place| {
            numbers[starts[place + 1] as usize] = n;
            starts[place + 1] += 1;
        });
    }
    (starts, numbers)
}
