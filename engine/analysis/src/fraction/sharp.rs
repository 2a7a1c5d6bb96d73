//! Where the crossings of the fine level around a coarse sample agree on a few planes: there its side and its crossings are
//! those of the part, so that edges of the part stay sharp.

use super::kernel::{BEFORE, floor};
use super::plan::Plan;
use crate::brick::{Brick, Hermite, HermiteEdge, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, NodeKey, dot};
use std::collections::BTreeMap;

/// Planes that may meet at a corner.
const MOST_PLANES: usize = 3;
/// The least cosine between the normals of crossings of one plane.
const ALIKE: f64 = 0.99;
/// How far crossings of one plane may lie from it, in coarse cells.
const NEAR: f64 = 0.06;
/// The least cosine between two planes that meet in an edge: those of a thin wall face each other.
const LEAST_TURN: f64 = -0.5;
/// The greatest one: between two that are more alike, there is a step.
const MOST_TURN: f64 = 0.9;

/// The planes of all crossings within a coarse cell of a sample along each axis.
#[derive(Clone, Copy, Default)]
pub(super) struct AgreeingPlanes {
    /// Unit normals, and distances from the sample along them in coarse cells.
    planes: [([f64; 3], f64); MOST_PLANES],
    count: u8,
    /// Whether there are more planes, or some that do not meet in edges.
    disagree: bool,
}

impl AgreeingPlanes {
    /// Adds the plane of a crossing.
    fn add(&mut self, normal: [f64; 3], at: [f64; 3]) {
        if self.disagree {
            return;
        }
        let away = dot(normal, at);
        for (other, distance) in &self.planes[..usize::from(self.count)] {
            let turn = dot(*other, normal);
            if turn > ALIKE && (dot(*other, at) - distance).abs() < NEAR {
                return;
            }
            self.disagree |= !(LEAST_TURN..=MOST_TURN).contains(&turn);
        }
        match self.planes.get_mut(usize::from(self.count)) {
            Some(plane) => (*plane, self.count) = ((normal, away), self.count + 1),
            None => self.disagree = true,
        }
    }

    fn join(&mut self, other: &AgreeingPlanes) {
        self.disagree |= other.disagree;
        for &(normal, distance) in &other.planes[..usize::from(other.count)] {
            self.add(normal, normal.map(|c| c * distance));
        }
    }

    fn agree(&self) -> bool {
        self.count > 0 && !self.disagree
    }
}

/// A crossing of a coarse edge: its axis, the edge's lower sample, and where it is between both.
type CoarseCrossing = (u8, [i64; 3], HermiteEdge);

/// A brick, one of its rows, and bits of that.
type Row = ([i64; 3], u16, u32);

/// What one leaf knows of the coarse samples around, which are counted from the first one of the tree.
#[derive(Default)]
pub(super) struct LeafPlanes {
    /// Samples with crossings around.
    planes: Vec<([i64; 3], AgreeingPlanes)>,
    /// Samples of the leaf that are inside, by rows of bricks.
    inside: Vec<Row>,
    crossings: Vec<CoarseCrossing>,
}

impl LeafPlanes {
    /// At how many samples planes agree, and at how many they do not.
    pub fn agreeing(&self) -> [u64; 2] {
        let agreeing = self.planes.iter().filter(|(_, planes)| planes.agree()).count() as u64;
        [agreeing, self.planes.len() as u64 - agreeing]
    }

    /// Of a leaf that begins at a sample of the finest level, which is `fine` of its own cells wide, `factor` of those a coarse
    /// cell.
    pub fn of(plan: &Plan, begins: [usize; 3], fine: usize, factor: usize, brick: &Brick) -> LeafPlanes {
        let mut made = LeafPlanes::default();
        match brick {
            Brick::Uniform(w) if *w < 1 => {}
            Brick::Uniform(_) => made.add_inside(begins, fine, factor, |_| true),
            Brick::Counts { samples, hermite } => {
                let signs = SignChanges::of(samples);
                made.add_inside(begins, fine, factor, |place| fine == 1 && signs.is_inside(place));
                made.add_crossings(plan, begins, (fine, factor), &signs, hermite);
            }
        }
        made
    }

    /// The coarse samples of a leaf that are inside.
    fn add_inside(
        &mut self,
        begins: [usize; 3],
        fine: usize,
        factor: usize,
        is_inside: impl Fn([usize; 3]) -> bool,
    ) {
        let range = |a: usize| begins[a].div_ceil(factor)..(begins[a] + BRICK_CELLS * fine).div_ceil(factor);
        for z in range(2) {
            for y in range(1) {
                let mut row: Option<Row> = None;
                for x in range(0) {
                    let sample = [x, y, z];
                    if !is_inside(std::array::from_fn(|a| sample[a] * factor - begins[a])) {
                        continue;
                    }
                    let (brick, place) = split(sample.map(|c| c as i64 + BEFORE));
                    match &mut row {
                        Some((known, _, bits)) if *known == brick => *bits |= 1 << (place & 31),
                        _ => self.inside.extend(row.replace((brick, place >> 5, 1 << (place & 31)))),
                    }
                }
                self.inside.extend(row);
            }
        }
    }

    fn add_crossings(
        &mut self,
        plan: &Plan,
        begins: [usize; 3],
        (fine, factor): (usize, usize),
        signs: &SignChanges,
        hermite: &Hermite,
    ) {
        let size = plan.size;
        let strides = [1, size[0], size[0] * size[1]];
        let mut around = vec![AgreeingPlanes::default(); size.iter().product()];
        // By the first of their samples, coarse cells none of whose samples has planes that agree: of beads soon all.
        let mut spent = vec![false; around.len()];
        // Of each line of samples the coarse cell that it is in, from the first of the plan, and whether it is a coarse line.
        let lines: [[(usize, bool); BRICK_CELLS]; 3] = std::array::from_fn(|n| {
            std::array::from_fn(|i| {
                let cell = floor(plan.base[n] + i as f64 * plan.step) - plan.first[n];
                (cell as usize * strides[n], fine == 1 && (begins[n] + i).is_multiple_of(factor))
            })
        });
        for axis in Axis::ALL {
            let a = axis.index();
            let [u, v] = axis.others_in_order().map(Axis::index);
            signs.for_crossings(axis, hermite, |from, edge| {
                if from.iter().any(|&c| c >= BRICK_CELLS) {
                    return;
                }
                let ((of_u, u_is_coarse), (of_v, v_is_coarse)) = (lines[u][from[u]], lines[v][from[v]]);
                let along = plan.base[a] + (from[a] as f64 + edge.fraction()) * plan.step;
                let cell = (floor(along) - plan.first[a]) as usize * strides[a] + of_u + of_v;
                if !spent[cell] {
                    let mut at: [f64; 3] = std::array::from_fn(|n| plan.base[n] + from[n] as f64 * plan.step);
                    at[a] = along;
                    let (within, normal) = (at.map(|c| c - floor(c) as f64), edge.normal.to_vector());
                    spent[cell] = true;
                    for corner in 0..8usize {
                        let ahead: [usize; 3] = std::array::from_fn(|n| corner >> n & 1);
                        let planes = &mut around[cell + (0..3).map(|n| ahead[n] * strides[n]).sum::<usize>()];
                        // Leaves of larger cells have no sample at every coarse one.
                        planes.disagree |= fine > 1;
                        planes.add(normal, std::array::from_fn(|n| within[n] - ahead[n] as f64));
                        spent[cell] &= planes.disagree;
                    }
                }
                if u_is_coarse && v_is_coarse {
                    let begin: [usize; 3] = std::array::from_fn(|n| begins[n] + from[n]);
                    let along = (begin[a] % factor) as f64 + edge.fraction();
                    let offset = (along / factor as f64 * 65536.0).min(65535.0) as u16;
                    let low = begin.map(|c| (c / factor) as i64);
                    self.crossings.push((a as u8, low, HermiteEdge { offset, normal: edge.normal }));
                }
            });
        }
        for (n, planes) in
            around.into_iter().enumerate().filter(|(_, planes)| planes.count > 0 || planes.disagree)
        {
            let place = [n % size[0], n / size[0] % size[1], n / size[0] / size[1]];
            self.planes.push((std::array::from_fn(|a| plan.first[a] + place[a] as i64), planes));
        }
    }
}

/// What a leaf knows of the planes around coarse samples.
pub(super) fn planes(key: NodeKey, brick: &Brick, finest: u8, factor: u32) -> LeafPlanes {
    let fine = 1usize << (finest - key.level());
    let begins = key.first_sample().map(|n| n as usize * fine);
    LeafPlanes::of(&Plan::new(key, finest, factor), begins, fine, factor as usize, brick)
}

/// What is known of a brick of coarse samples while leaves add to it.
#[derive(Default)]
pub(super) struct OpenSharp {
    planes: BTreeMap<u16, AgreeingPlanes>,
    inside: BTreeMap<u16, u32>,
    crossings: Vec<(u32, HermiteEdge)>,
}

/// Place of a sample in a brick, and which brick that is.
fn split(sample: [i64; 3]) -> ([i64; 3], u16) {
    let [x, y, z] = sample.map(|c| (c & 31) as u16);
    (sample.map(|c| c >> 5), (z << 5 | y) << 5 | x)
}

/// Adds what a leaf knows to bricks, by their positions.
pub(super) fn add(made: LeafPlanes, bricks: &mut BTreeMap<[i64; 3], OpenSharp>) {
    for (sample, planes) in made.planes {
        let (brick, place) = split(sample.map(|c| c + BEFORE));
        bricks.entry(brick).or_default().planes.entry(place).or_default().join(&planes);
    }
    for (brick, row, bits) in made.inside {
        *bricks.entry(brick).or_default().inside.entry(row).or_default() |= bits;
    }
    for (axis, low, edge) in made.crossings {
        let (brick, place) = split(low.map(|c| c + BEFORE));
        bricks.entry(brick).or_default().crossings.push((u32::from(axis) << 16 | u32::from(place), edge));
    }
}

/// Where the samples of a brick, and the crossings of its edges, are those of the part.
pub(super) struct Sharp {
    /// By row, the samples that are, and those of them that are inside.
    rows: BTreeMap<u16, [u32; 2]>,
    /// By axis and place, in order, crossings of edges that have one.
    crossings: Vec<(u32, HermiteEdge)>,
}

impl OpenSharp {
    /// At how many samples planes agree, and at how many they do not.
    pub fn agreeing(&self) -> [u64; 2] {
        let agreeing = self.planes.values().filter(|planes| planes.agree()).count() as u64;
        [agreeing, self.planes.len() as u64 - agreeing]
    }

    /// All that leaves have added; `None` if nowhere planes agree.
    pub fn complete(mut self) -> Option<Sharp> {
        let mut rows: BTreeMap<u16, [u32; 2]> = BTreeMap::new();
        for (place, _) in self.planes.iter().filter(|(_, planes)| planes.agree()) {
            rows.entry(place >> 5).or_default()[0] |= 1 << (place & 31);
        }
        for (row, [exact, inside]) in &mut rows {
            *inside = self.inside.get(row).copied().unwrap_or_default() & *exact;
        }
        self.crossings.sort_by_key(|(key, _)| *key);
        // Edges that are crossed more than once say nothing.
        let mut crossings = Vec::new();
        for run in self.crossings.chunk_by(|a, b| a.0 == b.0) {
            crossings.extend(run.first().filter(|_| run.len() == 1));
        }
        (!rows.is_empty()).then_some(Sharp { rows, crossings })
    }

    pub fn bytes(&self) -> u64 {
        (self.planes.len() * 160 + self.inside.len() * 16 + self.crossings.len() * 12) as u64
    }
}

impl Sharp {
    /// Of a row of samples, those that are the part's, and those of them that are inside.
    pub fn row(&self, j: usize, k: usize) -> [u32; 2] {
        self.rows.get(&((k << 5 | j) as u16)).copied().unwrap_or_default()
    }

    /// Whether a sample is the part's.
    pub fn is_exact(&self, place: usize) -> bool {
        self.row(place >> 5 & 31, place >> 10)[0] >> (place & 31) & 1 != 0
    }

    /// The crossing of an edge, if it has one.
    pub fn crossing(&self, axis: Axis, [i, j, k]: [usize; 3]) -> Option<HermiteEdge> {
        let key = (axis.index() << 16 | k << 10 | j << 5 | i) as u32;
        self.crossings.binary_search_by_key(&key, |(key, _)| *key).ok().map(|n| self.crossings[n].1)
    }

    pub fn bytes(&self) -> u64 {
        (self.rows.len() * 16 + self.crossings.len() * 12) as u64
    }
}
