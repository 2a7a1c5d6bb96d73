//! Offsets and shells of a part as new stores: a lattice of signs of distance − length, with exact crossings.

use super::answers::{Foot, Place};
use super::mitre::Mitres;
use super::sample_box::SampleBox;
use super::sides::{DeepBrick, FAR, Sides};
use super::surface::Surface;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges, point_index};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, MAX_LEVEL, NodeKey, RootCube, length, minus};
use crate::progress::Progress;
use crate::store::{BrickTree, CoarseSamples, Divided, Meta, Stats, Store, StoreWriter, write_divided};
use std::path::Path;

/// A node or a run of samples is decided as a whole where the field at its middle exceeds its reach by this many cells: far
/// more than errors of distances, so that all who share a sample decide alike.
const CERTAIN: f64 = 0.1;
/// A place on an edge whose ends are on one side of the part is on that side as well, if the surface is farther from it than
/// this, in cells: else it would pass between the place and the nearer end. That is half a cell, and what patches are off by at
/// corners.
const BETWEEN: f64 = 0.75;
/// A crossing is found where the field is this small, in cells, or after so many steps.
const ROOT: f64 = 2e-5;
const STEPS: usize = 12;
/// Heights and distances are alike within so many cells.
const EQUAL: f64 = 1e-3;
/// Bytes of the creases that mitres need.
const MITRE_BYTES: u64 = 256 << 20;
/// The least cosine between the way from the surface and its normal where it has no edge.
const SMOOTH: f64 = 0.98;
/// By how much the components of a normal are scaled before they are rounded.
const NORMAL_SCALE: f64 = 1e12;

/// What of the distance from a surface becomes solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// What is nearer to the part than so many world units, or what lies deeper in it, if the number is below 0.
    Offset(f64),
    /// As an offset outward, but edges stay sharp: faces that meet in a convex edge are offset by the length and extended up to
    /// where they meet. No farther from the edge than so many times the length, where they end round.
    Mitred(f64, f64),
    /// What of the part is nearer to its surface than this.
    Shell(f64),
}

impl Solid {
    /// The length, in world units.
    pub fn length(self) -> f64 {
        match self {
            Solid::Offset(by) | Solid::Mitred(by, _) | Solid::Shell(by) => by,
        }
    }

    /// How far outside of the part solid may lie, in world units.
    fn beyond(self) -> f64 {
        match self {
            Solid::Offset(by) => by.max(0.0),
            Solid::Mitred(by, limit) => by.max(0.0) * limit.max(1.0),
            Solid::Shell(_) => 0.0,
        }
    }

    /// What it is called, before the length.
    pub fn name(self) -> &'static str {
        match self {
            Solid::Offset(_) => "offset by",
            Solid::Mitred(..) => "offset with sharp edges by",
            Solid::Shell(_) => "shell of",
        }
    }
}

/// Writes the offset or shell of a store to another, on the same lattice. Where it does not fit into the root, that is doubled,
/// about the same lattice. What waits to be written takes a third of the surface's memory at most.
///
/// # Errors
/// [`Error::Setting`] if nothing is left or no room is; what reading and writing give.
pub fn offset(
    store: &Store,
    surface: &Surface,
    solid: Solid,
    output: &Path,
    progress: &dyn Progress,
) -> Result<Stats> {
    let mut grown = OffsetField::of(store, surface, solid)?;
    if let Solid::Mitred(_, limit) = solid {
        grown.mitres = Some(Mitres::of(surface, limit, MITRE_BYTES, progress)?);
    }
    let meta = grown.meta(store, solid);
    let mut writer = StoreWriter::create(output, &meta)?;
    if let CoarseSamples::Uniform(_) =
        write_divided(&grown, &mut writer, surface.memory() / 3, ("offset", progress))?
    {
        return Err(Error::setting("nothing is left of the part", "choose a shorter length"));
    }
    progress.phase("finishing", None, "bytes");
    writer.finish(meta)
}

/// The field on the new lattice. Lengths are in cells.
pub(super) struct OffsetField<'a> {
    sides: Sides<'a>,
    surface: &'a Surface,
    solid: Solid,
    by: f64,
    /// Creases beyond which planes are extended.
    mitres: Option<Mitres>,
    root: RootCube,
    depth: u8,
    /// The old lattice's first sample on the new one.
    shift: i64,
}

impl<'a> OffsetField<'a> {
    pub(super) fn of(tree: &'a dyn BrickTree, surface: &'a Surface, solid: Solid) -> Result<OffsetField<'a>> {
        surface.require_any()?;
        let length = solid.length();
        if solid.beyond() > 0.0 {
            surface.require_within_diagonal(solid.name(), length, "choose a shorter length")?;
        }
        let depth = tree.deepest_level();
        let mut grown = OffsetField {
            sides: Sides::new(tree)?,
            surface,
            solid,
            by: length / surface.cell(),
            mitres: None,
            root: tree.root(),
            depth,
            shift: 0,
        };
        let [low, high] = surface.bounds().unwrap_or_default().map(|end| surface.to_cells(end));
        let margin = solid.beyond() / surface.cell() + 2.0;
        let mut cells = (BRICK_CELLS as i64) << depth;
        while (0..3)
            .any(|a| low[a] - margin < -grown.shift as f64 || high[a] + margin > (cells - grown.shift) as f64)
        {
            // Whole bricks, so that those of both lattices coincide.
            let half = (cells / 2).max(BRICK_CELLS as i64);
            if grown.depth == MAX_LEVEL {
                return Err(Error::setting(
                    "the offset part does not fit into the lattice",
                    "choose a shorter length, or build the store with other cells",
                ));
            }
            let cell = surface.cell();
            let RootCube { origin, edge } = grown.root;
            let unit = grown.root.unit();
            grown.root = RootCube { origin: origin.map(|c| c - unit - half as f64 * cell), edge: 2.0 * edge };
            grown.shift += half;
            grown.depth += 1;
            cells *= 2;
        }
        Ok(grown)
    }

    fn meta(&self, store: &Store, solid: Solid) -> Meta {
        let old = store.meta();
        let (name, length, wider) = (solid.name(), solid.length(), solid.beyond());
        Meta {
            root: self.root,
            bounds_min: old.bounds_min.map(|c| c - wider),
            bounds_max: old.bounds_max.map(|c| c + wider),
            depth: self.depth,
            ..old.remade(name, length)
        }
    }

    /// The field: below 0 in the new part. With the outward normal of its surface.
    fn field(&self, foot: &Foot, from: [f64; 3], inside: bool) -> (f64, [f64; 3]) {
        let distance = if inside { -foot.distance } else { foot.distance };
        let way: [f64; 3] = std::array::from_fn(|a| (from[a] - foot.at[a]) / distance);
        // Where the surface is smooth its normal is right, even where the foot stands at the seam of two patches.
        let is_smooth = foot.distance < 1e-4 || crate::lattice::dot(way, foot.normal) > SMOOTH;
        let outward = if is_smooth { foot.normal } else { way };
        match self.solid {
            Solid::Offset(_) => (distance - self.by, outward),
            Solid::Mitred(..) => self.mitred(foot, from, (distance, outward)),
            Solid::Shell(_) if distance >= -distance - self.by => (distance, outward),
            Solid::Shell(_) => (-distance - self.by, outward.map(|c| -c)),
        }
    }

    /// The field with mitres, given the signed distance, and the normal without them.
    fn mitred(&self, foot: &Foot, from: [f64; 3], (distance, outward): (f64, [f64; 3])) -> (f64, [f64; 3]) {
        // What is so near to the part is solid whatever planes do.
        let mitres = self.mitres.as_ref().filter(|_| foot.distance > 0.5 * self.by);
        let mitre = mitres.and_then(|mitres| mitres.at(from, mitres.limit * self.by + 1.0));
        let is_sample = from.iter().all(|c| c.fract() == 0.0);
        match mitre {
            // Planes know the side, which patches may mistake at corners. But samples are solid where whole boxes would be.
            Some(mitre) if mitre.knows(foot.at) && !(is_sample && distance < self.by - 0.5 * CERTAIN) => {
                (mitre.height - self.by, mitre.normal)
            }
            // Where both are as far the normal is that of a plane.
            Some(mitre) if mitre.height < distance + EQUAL => {
                (mitre.height.min(distance) - self.by, mitre.normal)
            }
            _ => (distance - self.by, outward),
        }
    }

    /// The nearest point of the surface, given the patch of a place beside, if one is known.
    fn closest(&self, from: [f64; 3], beside: Option<Place>) -> Result<Foot> {
        let found = match beside {
            Some(patch) => self.surface.closest_after(from, f64::INFINITY, patch),
            None => self.surface.closest(from, f64::INFINITY),
        };
        found.ok_or_else(no_surface)
    }

    /// The field at a sample of the old lattice, or on an edge between two; `inside` where that is known of the sample, or of
    /// both.
    fn at(&self, from: [f64; 3], inside: Option<bool>, beside: Option<Place>) -> Result<FieldAt> {
        let is_sample = from.iter().all(|c| c.fract() == 0.0);
        let foot = self.closest(from, beside)?;
        // A sample's side is certain; of what lies between two only away from the surface.
        let inside = inside.filter(|_| is_sample || foot.distance > BETWEEN).unwrap_or(foot.inside);
        let (value, normal) = self.field(&foot, from, inside);
        Ok(FieldAt { value, normal, patch: foot.place })
    }

    /// Whether a cube of so many cells whose first sample is at a place of the old lattice is solid, if all of it is alike for
    /// sure.
    pub(super) fn side(&self, first: [f64; 3], size: i64) -> Result<Option<bool>> {
        let middle = first.map(|c| c + (size / 2) as f64);
        let reach = 0.5 * 3f64.sqrt() * size as f64 + CERTAIN;
        let foot = self.closest(middle, None)?;
        let is_far = foot.distance > FAR;
        let inside = if is_far { self.sides.sample(middle.map(|c| c.round() as i64))? } else { None };
        Ok(self.agreed(&foot, middle, inside, reach))
    }

    /// Whether all within a reach of a place is solid, or none of it. Where it is not known whether the place is in the part,
    /// what its foot says may be wrong, at corners that no cell resolves; then both must come to the same.
    fn agreed(&self, foot: &Foot, from: [f64; 3], inside: Option<bool>, reach: f64) -> Option<bool> {
        let of = |inside: bool| {
            if let Some(mitres) = &self.mitres {
                if inside {
                    return (foot.distance + self.by > reach).then_some(true);
                }
                let far = self.by * mitres.limit + reach;
                let is_solid = foot.distance + reach < self.by;
                let is_empty = foot.distance > self.by + reach && !mitres.may_be_within(from, far + 1.0);
                return (is_solid || is_empty || foot.distance > far).then_some(is_solid);
            }
            let (value, _) = self.field(foot, from, inside);
            (value.abs() > reach).then_some(value < 0.0)
        };
        match inside {
            Some(inside) => of(inside),
            None => of(true).filter(|solid| of(false) == Some(*solid)),
        }
    }

    /// Whether a sample is solid whose distance from the surface is between two numbers, if that suffices to tell.
    fn agreed_between(&self, inside: bool, [least, most]: [f64; 2]) -> Option<bool> {
        let Solid::Offset(_) = self.solid else { return None };
        let field = |distance: f64| if inside { -distance - self.by } else { distance - self.by };
        let [a, b] = [least, most].map(field);
        (a.abs().min(b.abs()) > CERTAIN && (a < 0.0) == (b < 0.0)).then_some(a < 0.0)
    }

    /// The samples of the brick whose first one is this of the old lattice.
    pub(super) fn block(&self, first: [i64; 3]) -> Result<OffsetBrick<'_>> {
        let mut samples = OffsetBrick {
            grown: self,
            first,
            part: self.sides.part(first)?,
            values: vec![f32::NAN; BRICK_POINTS.pow(3)],
            patches: vec![Place::default(); BRICK_POINTS.pow(3)],
        };
        samples.decide(SampleBox::BRICK, None)?;
        Ok(samples)
    }

    /// A sample of the new lattice on the old one.
    fn old(&self, sample: [i64; 3]) -> [f64; 3] {
        sample.map(|c| (c - self.shift) as f64)
    }
}

impl Divided for OffsetField<'_> {
    fn depth(&self) -> u8 {
        self.depth
    }

    fn decided(&self, key: NodeKey) -> Result<Option<i16>> {
        let size = (BRICK_CELLS as i64) << (self.depth - key.level());
        let first = key.position().map(|p| i64::from(p) * size);
        Ok(self.side(self.old(first), size)?.map(i16::from))
    }

    fn brick(&self, key: NodeKey) -> Result<Brick> {
        self.block(key.first_sample().map(|c| i64::from(c) - self.shift))?.brick()
    }
}

/// The field of a sample of which only the side is known.
fn sign(is_solid: bool) -> f32 {
    if is_solid { f32::NEG_INFINITY } else { f32::INFINITY }
}

/// The lower or the upper sample of an edge.
fn end_of(axis: Axis, mut low: [usize; 3], end: usize) -> [usize; 3] {
    low[axis.index()] += end;
    low
}

fn no_surface() -> Error {
    Error::setting("the store has no surface", "build it with finer cells")
}

/// The samples of a brick while they are decided.
pub(super) struct OffsetBrick<'a> {
    grown: &'a OffsetField<'a>,
    /// Its first sample on the old lattice.
    first: [i64; 3],
    part: DeepBrick,
    /// The field at samples that were asked for, or only its sign, as an infinite number.
    values: Vec<f32>,
    /// For each sample a patch near by.
    patches: Vec<Place>,
}

/// The field at a place, its normal there, and the patch that it is the distance from.
pub(super) struct FieldAt {
    pub value: f64,
    pub normal: [f64; 3],
    pub patch: Place,
}

impl OffsetBrick<'_> {
    fn place(&self, ijk: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| (self.first[a] + ijk[a] as i64) as f64)
    }

    /// Whether a sample is solid.
    pub(super) fn is_solid(&self, n: usize) -> bool {
        self.values[n] < 0.0
    }

    fn inside(&self, ijk: [usize; 3]) -> Option<bool> {
        match &self.part {
            DeepBrick::All(inside) => Some(*inside),
            DeepBrick::Samples(brick) => Some(brick.sample(ijk) >= 1),
            DeepBrick::Unknown => None,
        }
    }

    /// Decides a box of samples.
    fn decide(&mut self, samples: SampleBox, beside: Option<Place>) -> Result<()> {
        if samples.is_single() {
            return self.ask(samples.low, beside);
        }
        let (middle, corner) = (samples.middle(), self.place([0; 3]));
        let here = std::array::from_fn(|a| corner[a] + middle[a]);
        let foot = self.grown.closest(here, beside)?;
        samples.fill(&mut self.patches, foot.place);
        // That far from the surface the sample beside is on the same side.
        let inside = if foot.distance > FAR { self.inside(middle.map(|c| c as usize)) } else { None };
        if let Some(is_solid) = self.grown.agreed(&foot, here, inside, samples.reach() + CERTAIN) {
            samples.fill(&mut self.values, sign(is_solid));
            return Ok(());
        }
        if samples.is_small() {
            return samples.singles().try_for_each(|sample| self.decide_beside(sample.low, here, &foot));
        }
        samples.halves().into_iter().try_for_each(|half| self.decide(half, Some(foot.place)))
    }

    /// Decides a sample that is near a place whose foot is known.
    fn decide_beside(&mut self, ijk: [usize; 3], here: [f64; 3], foot: &Foot) -> Result<()> {
        let at = self.place(ijk);
        let between = [foot.distance - length(minus(at, here)), length(minus(at, foot.at))];
        match self.inside(ijk).and_then(|inside| self.grown.agreed_between(inside, between)) {
            Some(is_solid) => self.values[point_index(ijk)] = sign(is_solid),
            None => self.ask(ijk, Some(foot.place))?,
        }
        Ok(())
    }

    /// Asks the surface from a sample.
    fn ask(&mut self, ijk: [usize; 3], beside: Option<Place>) -> Result<()> {
        let FieldAt { value, patch, .. } = self.grown.at(self.place(ijk), self.inside(ijk), beside)?;
        // Never zero or no number, which would be neither side.
        let value = value as f32;
        self.values[point_index(ijk)] = if value == 0.0 { f32::MIN_POSITIVE } else { value };
        self.patches[point_index(ijk)] = patch;
        Ok(())
    }

    fn brick(mut self) -> Result<Brick> {
        let signs = SignChanges::from_fn(|n| self.values[n] < 0.0);
        let mut samples = Samples::filled(0);
        samples.0.iter_mut().zip(&self.values).for_each(|(s, value)| *s = i16::from(*value < 0.0));
        let lows = Axis::ALL.map(|axis| {
            let mut lows = Vec::new();
            signs.for_edges(axis, |low| lows.push(low));
            lows
        });
        for (axis, lows) in Axis::ALL.into_iter().zip(&lows) {
            for low in lows {
                (0..2).try_for_each(|end| self.require_end(axis, *low, end))?;
            }
        }
        let mut hermite = Hermite::default();
        for (axis, lows) in Axis::ALL.into_iter().zip(lows) {
            let edges = lows.into_iter().map(|low| self.crossing(axis, low)).collect::<Result<_>>()?;
            hermite.edges[axis.index()] = edges;
        }
        Ok(Brick::from_samples(samples, hermite))
    }

    /// Asks the surface from the end of an edge, of which several edges need to know.
    fn require_end(&mut self, axis: Axis, low: [usize; 3], end: usize) -> Result<()> {
        let ijk = end_of(axis, low, end);
        let known = self.values[point_index(ijk)];
        if known.is_finite() {
            return Ok(());
        }
        self.ask(ijk, Some(self.patches[point_index(ijk)]))?;
        let value = &mut self.values[point_index(ijk)];
        // What was certain stays so.
        if (*value < 0.0) != (known < 0.0) {
            *value = known;
        }
        Ok(())
    }

    /// Where the field is zero between two samples.
    pub(super) fn crossing(&self, axis: Axis, low: [usize; 3]) -> Result<HermiteEdge> {
        self.root_between(axis, low, [(0.0, self.end(axis, low, 0)?), (1.0, self.end(axis, low, 1)?)])
    }

    /// The field at the lower or the upper end of an edge.
    pub(super) fn end(&self, axis: Axis, low: [usize; 3], end: usize) -> Result<f64> {
        let ijk = end_of(axis, low, end);
        let known = self.values[point_index(ijk)];
        if known.is_finite() {
            return Ok(f64::from(known));
        }
        let beside = Some(self.patches[point_index(ijk)]);
        // Rounded as those that are known, so that every brick finds the same crossing.
        Ok(f64::from(self.grown.at(self.place(ijk), self.inside(ijk), beside)?.value as f32))
    }

    /// Of a part that both ends of an edge are in, or both are not, the edge is in, or not, where it is far from the surface.
    fn side_of(&self, axis: Axis, low: [usize; 3]) -> Option<bool> {
        self.inside(low).filter(|inside| self.inside(end_of(axis, low, 1)) == Some(*inside))
    }

    /// The field on an edge, at a part of the way from its lower sample, given the patch of a place beside, or that of the sample.
    pub(super) fn on_edge(
        &self,
        axis: Axis,
        low: [usize; 3],
        t: f64,
        beside: Option<Place>,
    ) -> Result<FieldAt> {
        let mut at = self.place(low);
        at[axis.index()] += t;
        let beside = beside.unwrap_or(self.patches[point_index(low)]);
        self.grown.at(at, self.side_of(axis, low), Some(beside))
    }

    /// Where the field is zero on an edge between two places where it has these values, the lower place first, by the false
    /// position with its ends weighed (Illinois).
    pub(super) fn root_between(
        &self,
        axis: Axis,
        low: [usize; 3],
        [lower, upper]: [(f64, f64); 2],
    ) -> Result<HermiteEdge> {
        let mut ends = [lower.0, upper.0];
        let mut values = [lower.1, upper.1];
        let (mut normal, mut beside) = ([0.0; 3], None);
        let is_low_inside = values[0] < 0.0;
        let (mut t, mut kept) = (0.5, None);
        for step in 0..STEPS {
            let [a, b] = values;
            let cut = ends[0] + (ends[1] - ends[0]) * a / (a - b);
            // Where ends contradict their signs, halves.
            t = if cut > ends[0] && cut < ends[1] && step < STEPS - 3 {
                cut
            } else {
                0.5 * (ends[0] + ends[1])
            };
            let there = self.on_edge(axis, low, t, beside)?;
            let value = there.value;
            (normal, beside) = (there.normal, Some(there.patch));
            if value.abs() < ROOT || ends[1] - ends[0] < 1e-5 {
                break;
            }
            let side = usize::from((value < 0.0) != is_low_inside);
            ends[side] = t;
            values[side] = value;
            if kept == Some(side) {
                values[1 - side] *= 0.5;
            }
            kept = Some(side);
        }
        let offset = (t * 65536.0).round().clamp(0.0, 65535.0) as u16;
        let mut direction = normal.map(|c| (c * NORMAL_SCALE) as i64);
        if direction == [0; 3] {
            direction[axis.index()] = if is_low_inside { 1 } else { -1 };
        }
        Ok(HermiteEdge { offset, normal: OctNormal::from_integer(direction) })
    }
}
