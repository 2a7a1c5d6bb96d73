//! A unit: the cells into which those of a node are divided, coded given these.

use super::cells::{Cell, Cells, Clip, Splat, SplatInput, PAIRS, SPLATS_MAX};
use super::directions::{Directions, ONE};
use super::model::{Model, CANDIDATES_MAX, COARSE_BINS, NO_BIN};
use super::planes::{at_cell, bin, support, NeighbourPlanes, SUB};
use crate::range::Coder;

/// A plane as far from a cell as this, in 1/16 of the cell, cannot be told.
const OFFSET_MAX: i32 = 31;
/// A normal is taken over if its cosine with the wanted one is at least this, in 1/16384^2: within 2 degrees.
const SAME_COSINE: i64 = 268_271_926;
/// An offset is taken over if it is as near as this, in 1/256 of its unit.
const SAME_OFFSET: i32 = 190;

/// What coding a unit needs to know.
pub struct Setting<'a> {
    /// The directions that normals may have.
    pub directions: &'a Directions,
    /// Whether cells may be divided once more.
    pub may_divide: bool,
    /// Whether every divided cell has cells with splats in it, as all have but those above the root's.
    pub has_parents: bool,
}

/// What is coded, and how far the worst of the splats is from what it stands for, in 1/4096 of a cell; not known to decoders.
pub struct CodedUnit {
    /// The cells.
    pub cells: Cells<Splat>,
    /// The distance.
    pub error: u32,
}

/// Codes the cells into which those of `parents` are divided; of an encoder those of `wanted`.
///
/// Returns nothing if what was read cannot be.
pub fn unit<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    setting: &Setting<'_>,
    parents: &Cells<Splat>,
    wanted: Option<&Cells<SplatInput>>,
) -> Option<CodedUnit> {
    let mut out = CodedUnit { cells: Cells::new(parents.side() * 2), error: 0 };
    for parent in parents.piece.cells.iter().filter(|parent| parent.divided) {
        let around = NeighbourPlanes::new(setting.directions, parents, parent);
        let mut found = 0usize;
        for octant in 0..8usize {
            let at = [0, 1, 2].map(|axis| parent.at[axis] * 2 + (octant >> axis & 1) as u8);
            let given = wanted.and_then(|wanted| Some((wanted, wanted.get(at)?)));
            let is_last = setting.has_parents && octant == 7 && found == 0;
            if is_last
                || is_occupied(coder, model, setting, &around, &out.cells, at, octant, found, given.is_some())
            {
                found += 1;
                cell(coder, model, setting, &around, at, given, &mut out)?;
            }
        }
    }
    Some(out)
}

/// Codes whether a cell has splats.
#[allow(clippy::too_many_arguments)]
#[inline]
fn is_occupied<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    setting: &Setting<'_>,
    around: &NeighbourPlanes<'_>,
    cells: &Cells<Splat>,
    at: [u8; 3],
    octant: usize,
    found: usize,
    value: bool,
) -> bool {
    let causal = CausalContext::new(setting.directions, cells, at);
    let (parent, beside) = around.bins(octant);
    let near = causal.bin();
    let set = causal.planes + if around.count > 1 { 4 } else { 0 } + if octant == 0 { 8 } else { 0 };
    let coarse = |bin: usize| if bin == NO_BIN { COARSE_BINS - 1 } else { bin / 3 };
    let contexts = [
        parent * 32 + octant.count_ones() as usize * 8 + found.min(3) * 2 + usize::from(around.count > 1),
        (near * 4 + causal.planes) * 2 + usize::from(found > 0),
        around.faces * 8 + octant,
        causal.bits * 8 + octant,
        (coarse(parent) * COARSE_BINS + coarse(near)) * 8 + causal.planes * 2 + usize::from(found > 0),
        beside * 8 + causal.planes * 2 + usize::from(around.count > 1),
    ];
    model.occupied.code(coder, &model.logistic, contexts, set, value)
}

/// What is known of the cells before one.
struct CausalContext {
    /// Which of seven cells before it have splats.
    bits: usize,
    /// Of how many beside it a plane is known.
    planes: usize,
    /// Sum of how far these planes pass its middle.
    passes: i32,
}

/// Cells before one: three beside it, then those across edges and the corner.
const BEFORE: [[i8; 3]; 7] =
    [[-1, 0, 0], [0, -1, 0], [0, 0, -1], [-1, -1, 0], [-1, 0, -1], [0, -1, -1], [-1, -1, -1]];

impl CausalContext {
    #[inline]
    fn new(directions: &Directions, cells: &Cells<Splat>, at: [u8; 3]) -> CausalContext {
        let mut causal = CausalContext { bits: 0, planes: 0, passes: 0 };
        for (n, step) in BEFORE.iter().enumerate() {
            let cell = match cells.beside(at, *step) {
                Some(cell) => cell,
                None => continue,
            };
            causal.bits |= 1 << n;
            if n < 3 {
                let passes = cells.of(cell).iter().map(|splat| passes(directions, splat, *step));
                causal.planes += 1;
                causal.passes += passes.min_by_key(|p| p.abs()).unwrap_or(0);
            }
        }
        causal
    }

    fn bin(&self) -> usize {
        if self.planes == 0 {
            NO_BIN
        } else {
            bin(self.passes / self.planes as i32)
        }
    }
}

/// How far the plane of a splat a step away passes the middle of a cell, in 1/16 of the farthest at which it meets it.
#[inline]
fn passes(directions: &Directions, splat: &Splat, step: [i8; 3]) -> i32 {
    let n = directions.vector(splat.normal);
    let distance = at_cell(n, i32::from(splat.offset), step, 1);
    distance * 16 / (support(n) + 1)
}

/// Codes what is in a cell that has splats.
fn cell<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    setting: &Setting<'_>,
    around: &NeighbourPlanes<'_>,
    at: [u8; 3],
    given: Option<(&Cells<SplatInput>, &Cell)>,
    out: &mut CodedUnit,
) -> Option<()> {
    let wanted = given.map_or(&[][..], |(cells, cell)| cells.of(cell));
    let octant = (0..3).map(|axis| usize::from(at[axis] & 1) << axis).sum::<usize>();
    let beside = BEFORE.map(|step| out.cells.beside(at, step).copied());
    let several = beside[..3].iter().flatten().filter(|cell| cell.count > 1).count();
    let mut count = 1;
    if coder.bit(&mut model.more[around.count.min(2)][several], wanted.len() > 1) {
        count = 2 + usize::from(coder.bit(&mut model.third[several], wanted.len() > 2));
    }
    let mut splats = [Splat { normal: [0; 3], offset: 0 }; SPLATS_MAX];
    for n in 0..count {
        let sources = Sources::new(setting.directions, around, &out.cells, &beside, octant, &splats[..n]);
        splats[n] = splat(coder, model, setting.directions, &sources, wanted.get(n))?;
        if let Some(wanted) = wanted.get(n) {
            out.error = out.error.max(error(setting.directions, &splats[n], wanted));
        }
    }
    let mut clips = 0;
    for (pair, _) in PAIRS.iter().enumerate().filter(|(_, pair)| pair[1] < count) {
        let clip = given.map_or(Clip::None, |(_, cell)| cell.clip(pair));
        if coder.bit(&mut model.clipped[usize::from(count > 2)], clip != Clip::None) {
            let context = beside.iter().flatten().map(|cell| cell.clip(0)).find(|clip| *clip != Clip::None);
            let context = context.map_or(0, |clip| if clip == Clip::Convex { 1 } else { 2 });
            let is_convex = coder.bit(&mut model.convex[context], clip == Clip::Convex);
            clips |= (if is_convex { Clip::Convex } else { Clip::Concave }).of_pair(pair);
        }
    }
    let mut divided = false;
    if setting.may_divide {
        let before = beside[..3].iter().flatten().filter(|cell| cell.divided).count();
        divided = coder.bit(&mut model.divided[before], given.map_or(false, |(_, cell)| cell.divided));
    }
    out.cells.push(at, &splats[..count], clips, divided);
    Some(())
}

/// A normal that may be taken over.
#[derive(Clone, Copy)]
struct Candidate {
    normal: [i8; 3],
    /// Whether its plane passes through the cell, and how many splats around have it.
    passes: bool,
    votes: usize,
}

/// What the splats around a cell say of one in it.
struct Sources {
    candidates: [Candidate; CANDIDATES_MAX],
    count: usize,
    /// Signed distances of their planes, in 1/256 of the cell, and their normals, of those that count.
    planes: [([i8; 3], i32); 8],
    known: usize,
    /// The direction that is foretold.
    normal: [i8; 3],
    spread: usize,
}

impl Sources {
    fn new(
        directions: &Directions,
        around: &NeighbourPlanes<'_>,
        cells: &Cells<Splat>,
        beside: &[Option<Cell>; 7],
        octant: usize,
        taken: &[Splat],
    ) -> Sources {
        let none = Candidate { normal: [0; 3], passes: false, votes: 0 };
        let mut sources = Sources {
            candidates: [none; CANDIDATES_MAX],
            count: 0,
            planes: [([0; 3], 0); 8],
            known: 0,
            normal: [0; 3],
            spread: 0,
        };
        for (n, cell) in beside.iter().enumerate().filter_map(|(n, cell)| Some((n, cell.as_ref()?))) {
            for splat in cells.of(cell) {
                let distance =
                    at_cell(directions.vector(splat.normal), i32::from(splat.offset), BEFORE[n], 1);
                sources.add(directions, splat.normal, distance, taken, n < 3);
            }
        }
        for splat in around.splats {
            let distance = around.distance(splat, octant);
            sources.add(directions, splat.normal, distance, taken, sources.known < 2);
        }
        // Those whose plane passes, and that many have, first.
        sources.candidates[..sources.count].sort_by_key(|c| (!c.passes, std::cmp::Reverse(c.votes)));
        sources.foretell(directions);
        sources
    }

    fn add(
        &mut self,
        directions: &Directions,
        normal: [i8; 3],
        distance: i32,
        taken: &[Splat],
        counts: bool,
    ) {
        if taken.iter().any(|splat| splat.normal == normal) {
            return;
        }
        let n = directions.vector(normal);
        let passes = distance.abs() <= support(n) + 2 * SUB / 16;
        match self.candidates[..self.count].iter_mut().find(|c| c.normal == normal) {
            Some(candidate) => {
                candidate.votes += 1;
                candidate.passes |= passes;
            }
            None if self.count < CANDIDATES_MAX => {
                self.candidates[self.count] = Candidate { normal, passes, votes: 1 };
                self.count += 1;
            }
            None => {}
        }
        if counts && passes && self.known < self.planes.len() {
            self.planes[self.known] = (normal, distance);
            self.known += 1;
        }
    }

    /// The mean of the normals around, and how far they are from each other.
    fn foretell(&mut self, directions: &Directions) {
        let mut sum = [0i64; 3];
        for (normal, _) in &self.planes[..self.known] {
            let n = directions.vector(*normal);
            (0..3).for_each(|axis| sum[axis] += i64::from(n[axis]));
        }
        if sum == [0; 3] {
            sum = match self.candidates[..self.count].first() {
                Some(first) => first.normal.map(i64::from),
                None => [0, 0, 1],
            };
        }
        self.normal = directions.near(sum);
        let apart = |(normal, _): &([i8; 3], i32)| {
            (0..3).map(|axis| (i32::from(normal[axis]) - i32::from(self.normal[axis])).abs()).sum::<i32>()
        };
        let apart = self.planes[..self.known].iter().map(apart).max().unwrap_or(directions.radius());
        self.spread = match apart * 32 / directions.radius() {
            0..=1 => 0,
            2..=4 => 1,
            5..=8 => 2,
            9..=14 => 3,
            15..=24 => 4,
            _ => 5,
        };
    }

    /// Signed distance of a plane of this normal from the middle of the cell along it, in 1/256 of the cell; and its class.
    fn offset(&self, directions: &Directions, normal: [i8; 3]) -> (i32, usize) {
        let n = directions.vector(normal);
        let (mut sum, mut count, mut same) = (0, 0, 0);
        for (other, distance) in &self.planes[..self.known] {
            let m = directions.vector(*other);
            let cosine = (0..3).map(|axis| n[axis] * m[axis]).sum::<i32>();
            if *other == normal {
                same += 1;
            }
            if cosine > ONE * ONE / 5 * 4 {
                sum -= distance;
                count += 1;
            }
        }
        match (count, same) {
            (0, _) => (0, 5),
            (_, 0) => (sum / count, if count == 1 { 4 } else { 3 }),
            (_, 1) => (sum / count, 2),
            (_, 2) => (sum / count, 1),
            _ => (sum / count, 0),
        }
    }
}

/// Codes a splat.
fn splat<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    directions: &Directions,
    sources: &Sources,
    wanted: Option<&SplatInput>,
) -> Option<Splat> {
    let mut normal = None;
    for (n, candidate) in sources.candidates[..sources.count].iter().enumerate() {
        let is_same = wanted.map_or(false, |wanted| is_same(directions, candidate.normal, wanted));
        let context = ((n * 2 + usize::from(candidate.passes)) * 5 + candidate.votes.min(4)) * 3;
        if coder.bit(&mut model.same[context + (sources.spread / 2).min(2)], is_same) {
            normal = Some(candidate.normal);
            break;
        }
    }
    let normal = match normal {
        Some(normal) => normal,
        None => residual(coder, model, directions, sources, wanted)?,
    };
    let (foretold, class) = sources.offset(directions, normal);
    let base = (foretold + SUB / 32).div_euclid(SUB / 16);
    let mut change = 0;
    if let Some(wanted) = wanted {
        let exact = offset(directions, normal, wanted);
        if (exact - base * 256).abs() > SAME_OFFSET {
            change = (exact + 128).div_euclid(256) - base;
        }
    }
    let change = i32::from(model.offsets[class].signed(coder, change as i16));
    let offset = base + change;
    if offset.abs() > OFFSET_MAX {
        return None;
    }
    Some(Splat { normal, offset: offset as i8 })
}

/// Codes a normal by how it differs from the one that is foretold.
fn residual<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    directions: &Directions,
    sources: &Sources,
    wanted: Option<&SplatInput>,
) -> Option<[i8; 3]> {
    let (foretold, spread, radius) = (sources.normal, sources.spread, directions.radius());
    // The axis along which it points is told last, by what the others leave.
    let main = (0..3).max_by_key(|&axis| (foretold[axis].unsigned_abs(), axis)).unwrap_or(2);
    let [a, b] = [(main + 1) % 3, (main + 2) % 3];
    let exact = wanted.map_or(foretold, |wanted| directions.near(wanted.normal.map(i64::from)));
    let difference = |axis: usize| i16::from(exact[axis]) - i16::from(foretold[axis]);
    let da = model.residuals[0][spread].signed(coder, difference(a));
    let second = 1 + usize::from(da.abs() > 1 + spread as i16);
    let db = model.residuals[second][spread].signed(coder, difference(b));
    let va = i32::from(foretold[a]) + i32::from(da);
    let vb = i32::from(foretold[b]) + i32::from(db);
    let left = radius - va.abs() - vb.abs();
    if va.abs() > radius || vb.abs() > radius || left < 0 {
        return None;
    }
    let is_opposite = (exact[main] < 0) != (foretold[main] < 0);
    let flips = left > 0 && coder.bit(&mut model.below[spread], is_opposite);
    let is_negative = (foretold[main] < 0) != flips;
    let mut normal = [0i8; 3];
    normal[a] = va as i8;
    normal[b] = vb as i8;
    normal[main] = if is_negative { -left } else { left } as i8;
    Some(normal)
}

fn is_same(directions: &Directions, normal: [i8; 3], wanted: &SplatInput) -> bool {
    let n = directions.vector(normal);
    let cosine = (0..3).map(|axis| i64::from(n[axis]) * i64::from(wanted.normal[axis])).sum::<i64>();
    cosine >= SAME_COSINE
}

/// Distance of the wanted plane with this normal from the middle of the cell, in 1/4096 of the cell.
fn offset(directions: &Directions, normal: [i8; 3], wanted: &SplatInput) -> i32 {
    let n = directions.vector(normal);
    let limit = OFFSET_MAX * 256;
    let exact = (0..3).map(|axis| n[axis] * i32::from(wanted.mean[axis])).sum::<i32>() / ONE;
    exact.clamp(-limit, limit)
}

/// Greatest distance of what a splat stands for from its plane, in 1/4096 of the cell.
fn error(directions: &Directions, splat: &Splat, wanted: &SplatInput) -> u32 {
    let n = directions.vector(splat.normal);
    let tilt = (0..3).map(|axis| (n[axis] - i32::from(wanted.normal[axis])).pow(2)).sum::<i32>();
    let tilt = f64::from(tilt).sqrt() / f64::from(ONE);
    // Both the mean and what it stands for are in the cell.
    let reach = 3f64.sqrt() * 4096.0;
    let shift = (offset(directions, splat.normal, wanted) - i32::from(splat.offset) * 256).unsigned_abs() + 1;
    wanted.error + (tilt * reach).ceil() as u32 + shift
}
