//! A unit: the cells into which those of a node are divided, coded given these.

use super::cells::{Cell, Cells, CellsBefore, Clip, Splat, SplatInput, BEFORE, PAIRS, SPLATS_MAX};
use super::directions::{Directions, ONE, SUB};
use super::model::{Model, CANDIDATES_MAX, COARSE_BINS, NO_BIN, SPREADS};
use super::planes::{at_cell, bin, NeighbourPlanes};
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
            let before = out.cells.before(at);
            let causal = (&out.cells, &before);
            if is_last || is_occupied(coder, model, setting, &around, causal, octant, found, given.is_some())
            {
                found += 1;
                cell(coder, model, setting, &around, (at, &before), given, &mut out)?;
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
    (cells, before): (&Cells<Splat>, &CellsBefore),
    octant: usize,
    found: usize,
    value: bool,
) -> bool {
    let causal = CausalContext::new(setting.directions, cells, before);
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

impl CausalContext {
    #[inline]
    fn new(directions: &Directions, cells: &Cells<Splat>, before: &CellsBefore) -> CausalContext {
        let mut causal = CausalContext { bits: before.bits(), planes: 0, passes: 0 };
        for (n, step) in BEFORE.iter().enumerate().take(3) {
            if let Some(cell) = before.get(cells, n) {
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
    let (normal, support) = directions.supported(splat.normal);
    directions.in_support(at_cell(normal, i32::from(splat.offset), step, 1), support)
}

/// Codes what is in a cell that has splats.
fn cell<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    setting: &Setting<'_>,
    around: &NeighbourPlanes<'_>,
    (at, before): ([u8; 3], &CellsBefore),
    given: Option<(&Cells<SplatInput>, &Cell)>,
    out: &mut CodedUnit,
) -> Option<()> {
    let wanted = given.map_or(&[][..], |(cells, cell)| cells.of(cell));
    let octant = (0..3).map(|axis| usize::from(at[axis] & 1) << axis).sum::<usize>();
    let beside = || (0..3).filter_map(|n| before.get(&out.cells, n));
    let several = beside().filter(|cell| cell.count > 1).count();
    let mut count = 1;
    if coder.bit(&mut model.more[around.count.min(2)][several], wanted.len() > 1) {
        count = 2 + usize::from(coder.bit(&mut model.third[several], wanted.len() > 2));
    }
    let mut splats = [Splat { normal: [0; 3], offset: 0 }; SPLATS_MAX];
    for n in 0..count {
        let sources = Sources::new(setting.directions, around, (&out.cells, before), octant, &splats[..n]);
        splats[n] = splat(coder, model, setting.directions, &sources, wanted.get(n))?;
        if let Some(wanted) = wanted.get(n) {
            out.error = out.error.max(error(setting.directions, &splats[n], wanted));
        }
    }
    let mut clips = 0;
    for (pair, _) in PAIRS.iter().enumerate().filter(|(_, pair)| pair[1] < count) {
        let clip = given.map_or(Clip::None, |(_, cell)| cell.clip(pair));
        if coder.bit(&mut model.clipped[usize::from(count > 2)], clip != Clip::None) {
            let context =
                before.each(&out.cells).map(|(_, cell)| cell.clip(0)).find(|clip| *clip != Clip::None);
            let context = context.map_or(0, |clip| if clip == Clip::Convex { 1 } else { 2 });
            let is_convex = coder.bit(&mut model.convex[context], clip == Clip::Convex);
            clips |= (if is_convex { Clip::Convex } else { Clip::Concave }).of_pair(pair);
        }
    }
    let mut divided = false;
    if setting.may_divide {
        let divided_before = beside().filter(|cell| cell.divided).count();
        divided =
            coder.bit(&mut model.divided[divided_before], given.map_or(false, |(_, cell)| cell.divided));
    }
    out.cells.push(at, &splats[..count], clips, divided);
    Some(())
}

/// A normal that may be taken over.
#[derive(Clone, Copy)]
struct Candidate {
    normal: [i8; 3],
    /// How many splats around have it, and [`PASSES`] if its plane passes through the cell.
    rank: u8,
}

/// More than the votes of a candidate: three splats in each of eight cells.
const PASSES: u8 = 64;

/// A plane around a cell.
#[derive(Clone, Copy)]
struct PlaneAround {
    normal: [i8; 3],
    vector: [i16; 3],
    /// Signed distance from the middle of the cell, in 1/256 of it.
    distance: i16,
}

impl PlaneAround {
    #[inline(always)]
    fn new(splat: &Splat, vector: [i32; 3], distance: i32) -> PlaneAround {
        // Whatever a file says, distances are below 2^12.
        PlaneAround { normal: splat.normal, vector: vector.map(|c| c as i16), distance: distance as i16 }
    }
}

/// What the splats around a cell say of one in it.
struct Sources {
    candidates: [Candidate; CANDIDATES_MAX],
    count: usize,
    /// Of those that count.
    planes: [PlaneAround; 8],
    known: usize,
    /// The direction that is foretold.
    normal: [i8; 3],
    spread: usize,
}

/// Whether a normal is not one of those that the cell has by now.
#[inline(always)]
fn is_new(splat: &Splat, taken: &[Splat]) -> bool {
    taken.iter().all(|other| other.normal != splat.normal)
}

impl Sources {
    fn new(
        directions: &Directions,
        around: &NeighbourPlanes<'_>,
        (cells, before): (&Cells<Splat>, &CellsBefore),
        octant: usize,
        taken: &[Splat],
    ) -> Sources {
        let mut sources = Sources {
            candidates: [Candidate { normal: [0; 3], rank: 0 }; CANDIDATES_MAX],
            count: 0,
            planes: [PlaneAround { normal: [0; 3], vector: [0; 3], distance: 0 }; 8],
            known: 0,
            normal: [0; 3],
            spread: 0,
        };
        for (n, cell) in before.each(cells) {
            for splat in cells.of(cell).iter().filter(|splat| is_new(splat, taken)) {
                let (vector, support) = directions.supported(splat.normal);
                let distance = at_cell(vector, i32::from(splat.offset), BEFORE[n], 1);
                sources.add(PlaneAround::new(splat, vector, distance), support, n < 3);
            }
        }
        for splat in around.splats.iter().filter(|splat| is_new(splat, taken)) {
            let (vector, support) = directions.supported(splat.normal);
            let distance = around.distance(splat, vector, octant);
            let counts = sources.known < 2;
            sources.add(PlaneAround::new(splat, vector, distance), support, counts);
        }
        sources.order();
        sources.foretell(directions);
        sources
    }

    #[inline(always)]
    fn add(&mut self, plane: PlaneAround, support: i32, counts: bool) {
        let passes = i32::from(plane.distance).abs() <= support + 2 * SUB / 16;
        let rank = if passes { PASSES } else { 0 };
        match self.candidates[..self.count].iter_mut().find(|c| c.normal == plane.normal) {
            Some(candidate) => candidate.rank = (candidate.rank + 1) | rank,
            None if self.count < CANDIDATES_MAX => {
                self.candidates[self.count] = Candidate { normal: plane.normal, rank: 1 | rank };
                self.count += 1;
            }
            None => {}
        }
        if counts && passes && self.known < self.planes.len() {
            self.planes[self.known] = plane;
            self.known += 1;
        }
    }

    /// Sorts candidates: those whose plane passes, and that many have, first. There are few; equal ones keep their order.
    #[inline(always)]
    fn order(&mut self) {
        for end in 1..self.count {
            let next = self.candidates[end];
            let mut at = end;
            while at > 0 && self.candidates[at - 1].rank < next.rank {
                self.candidates[at] = self.candidates[at - 1];
                at -= 1;
            }
            self.candidates[at] = next;
        }
    }

    /// The mean of the normals around, and how far they are from each other.
    #[inline(always)]
    fn foretell(&mut self, directions: &Directions) {
        let planes = &self.planes[..self.known];
        let mut sum = [0i32; 3];
        for plane in planes {
            (0..3).for_each(|axis| sum[axis] += i32::from(plane.vector[axis]));
        }
        if sum == [0; 3] {
            sum = match self.candidates[..self.count].first() {
                Some(first) => first.normal.map(i32::from),
                None => [0, 0, 1],
            };
        }
        self.normal = directions.near(sum.map(i64::from));
        let apart = |plane: &PlaneAround| {
            (0..3)
                .map(|axis| (i32::from(plane.normal[axis]) - i32::from(self.normal[axis])).abs())
                .sum::<i32>()
        };
        let apart = planes.iter().map(apart).max().unwrap_or(directions.radius());
        // In 1/32 of the radius.
        self.spread = SPREAD_ENDS.iter().filter(|end| apart * 32 >= **end * directions.radius()).count();
    }

    /// Signed distance of a plane of this normal from the middle of the cell along it, in 1/256 of the cell; and its class.
    #[inline(always)]
    fn offset(&self, directions: &Directions, normal: [i8; 3]) -> (i32, usize) {
        let n = directions.vector(normal);
        let (mut sum, mut count, mut same) = (0, 0, 0);
        for plane in &self.planes[..self.known] {
            let cosine = (0..3).map(|axis| n[axis] * i32::from(plane.vector[axis])).sum::<i32>();
            same += usize::from(plane.normal == normal);
            if cosine > ONE * ONE / 5 * 4 {
                sum -= i32::from(plane.distance);
                count += 1;
            }
        }
        match (count, same) {
            (0, _) => (0, 5),
            (1, 0) => (sum, 4),
            (_, 0) => (sum / count, 3),
            (_, 1) => (sum / count, 2),
            (_, 2) => (sum / count, 1),
            _ => (sum / count, 0),
        }
    }
}

/// Where classes of how far normals are apart end, in 1/32 of the radius.
const SPREAD_ENDS: [i32; SPREADS - 1] = [2, 5, 9, 15, 25];

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
        let passes = candidate.rank >= PASSES;
        let votes = usize::from(candidate.rank % PASSES);
        let context = ((n * 2 + usize::from(passes)) * 5 + votes.min(4)) * 3;
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
