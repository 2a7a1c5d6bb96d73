//! One ray through the tree: from node to node, past whatever holds nothing to be seen, and from cell to cell in bricks.

use super::Frame;
use super::bricks::{RayBrick, ThreadBricks};
use super::camera::{Ray, Vector, scaled, unit};
use super::clip::RaySpan;
use super::field::{BLOCK_CELLS, FieldCell, RayField};
use super::light::RayLight;
use super::nodes::RayNode;
use super::style::{IsoSurface, SURFACES_MAX};
use super::tint::{Asked, Met};
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, MAX_LEVEL, NodeKey, Octant, ROOT_BITS};
use std::ops::ControlFlow;

/// Steps of halving a stretch of a cell on which the boundary lies: to 1/2000 of the cell.
const HALVINGS: usize = 10;
/// Steps through a stretch of haze, or through a cell if that is longer.
const STEPS_A_STRETCH: f64 = 3.0;
/// What rounding may add to a number of steps: a ray along an axis takes as many in every cell.
const STEPS_SLACK: f64 = 1e-3;

/// A ray on its way.
pub(super) struct RayTracer<'a> {
    frame: &'a Frame<'a>,
    lane: ThreadBricks,
    line: Line,
    span: RaySpan,
    gathered: RayLight,
    /// Where the ray met the first opaque thing, along its length.
    hit: Option<f64>,
    asked: Asked<'a>,
    /// Bricks that were needed and are not here, if rays end there.
    missing: Option<Vec<NodeKey>>,
}

/// A ray in units from the root's first sample, by world length along it.
#[derive(Clone, Copy)]
struct Line {
    origin: Vector,
    direction: Vector,
    /// Of the direction's parts; infinity where they are 0. A product takes a quarter of a quotient's time.
    inverse: Vector,
}

impl Line {
    fn new(origin: Vector, direction: Vector) -> Line {
        Line { origin, direction, inverse: direction.map(|c| 1.0 / c) }
    }

    fn at(&self, t: f64) -> Vector {
        std::array::from_fn(|a| self.origin[a] + t * self.direction[a])
    }

    /// Where it passes a coordinate of an axis; infinity if it never does.
    fn passes(&self, axis: usize, at: f64) -> f64 {
        let is_along = self.direction[axis] == 0.0;
        if is_along { f64::INFINITY } else { (at - self.origin[axis]) * self.inverse[axis] }
    }
}

/// Where a brick's cells lie.
#[derive(Clone, Copy)]
pub(super) struct BrickPlacement {
    pub key: NodeKey,
    base: Vector,
    /// Of a cell, in units.
    spacing: f64,
}

impl BrickPlacement {
    /// A point in cells from the brick's first one.
    fn local(&self, point: Vector) -> Vector {
        std::array::from_fn(|a| (point[a] - self.base[a]) / self.spacing)
    }

    fn cells(&self) -> Grid {
        Grid { base: self.base, spacing: self.spacing, across: BRICK_CELLS }
    }

    fn blocks(&self) -> Grid {
        let spacing = self.spacing * BLOCK_CELLS as f64;
        Grid { base: self.base, spacing, across: BRICK_CELLS / BLOCK_CELLS }
    }

    /// The cell that holds a point, or the nearest.
    fn cell(&self, point: Vector) -> [usize; 3] {
        self.cells().cube(point)
    }

    /// The point within that cell, 0..1 an axis.
    fn within(&self, cell: [usize; 3], point: Vector) -> Vector {
        let local = self.local(point);
        std::array::from_fn(|a| (local[a] - cell[a] as f64).clamp(0.0, 1.0))
    }
}

/// A stretch of a ray within a cell.
struct Stretch<'a> {
    line: &'a Line,
    place: BrickPlacement,
    ijk: [usize; 3],
    cell: FieldCell,
    /// Where it ends.
    to: f64,
}

impl Stretch<'_> {
    fn value(&self, t: f64) -> f64 {
        self.cell.value(self.place.within(self.ijk, self.line.at(t)))
    }

    /// Outward normal of the level through the ray's point.
    fn normal(&self, t: f64) -> Vector {
        scaled(unit(self.cell.gradient(self.place.within(self.ijk, self.line.at(t)))), -1.0)
    }

    /// The first place from `from` on where the field passes 0.
    fn passage(&self, from: f64) -> Option<f64> {
        let middle = (from + self.to) / 2.0;
        let was_inside = self.value(from) >= 0.0;
        let (mut low, mut high) = (from, self.to);
        if (self.value(middle) >= 0.0) != was_inside {
            high = middle;
        } else {
            low = middle;
            if (self.value(high) >= 0.0) == was_inside {
                return None;
            }
        }
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            if (self.value(middle) >= 0.0) == was_inside { low = middle } else { high = middle }
        }
        Some(high)
    }
}

impl<'a> RayTracer<'a> {
    pub fn new(frame: &'a Frame<'a>) -> RayTracer<'a> {
        let line = Line::new([0.0; 3], [0.0; 3]);
        let span = RaySpan { from: 0.0, to: 0.0, cut: None };
        let asked = Asked::new(frame.scene.tint);
        RayTracer {
            frame,
            lane: ThreadBricks::default(),
            line,
            span,
            gathered: RayLight::default(),
            hit: None,
            asked,
            missing: None,
        }
    }

    /// Notes bricks that are not here, and ends rays there.
    pub fn noting(self) -> RayTracer<'a> {
        RayTracer { missing: Some(Vec::new()), ..self }
    }

    /// The bricks that were noted since it was asked last.
    pub fn take_missing(&mut self) -> Vec<NodeKey> {
        self.missing.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Begins with the rays of another pixel.
    pub fn begin_pixel(&mut self) {
        self.asked.clear();
    }

    /// Follows a ray. What it gathers, and the distance of the first opaque thing.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn follow(&mut self, ray: &Ray) -> Result<(RayLight, Option<f64>)> {
        (self.gathered, self.hit) = (RayLight::default(), None);
        let Some(span) = self.frame.scene.clip.span(ray) else { return Ok((self.gathered, None)) };
        let root = self.frame.scene.bricks.tree.root();
        let edge = f64::from(1u32 << ROOT_BITS);
        let origin = root.to_units(ray.origin).map(|c| c - 1.0);
        self.line = Line::new(origin, ray.direction.map(|c| c * (edge / root.edge)));
        self.span = span;
        // The root's cells begin at its first sample.
        let (mut from, mut to) = (span.from, span.to);
        for (a, at) in origin.into_iter().enumerate() {
            let [p, q] = [0.0, edge].map(|at| self.line.passes(a, at));
            if self.line.direction[a] != 0.0 {
                (from, to) = (from.max(p.min(q)), to.min(p.max(q)));
            } else if !(0.0..edge).contains(&at) {
                return Ok((self.gathered, None));
            }
        }
        if from < to {
            let _ = self.descend(0, NodeKey::ROOT, [from, to])?;
        }
        Ok((self.gathered, self.hit))
    }

    /// Passes a node between two places of the ray; `Break` where nothing behind is seen any more.
    fn descend(&mut self, number: u32, key: NodeKey, [from, to]: [f64; 2]) -> Result<ControlFlow<()>> {
        let node = self.frame.scene.nodes.get(number);
        if !self.frame.style().sees(&node) {
            return Ok(ControlFlow::Continue(()));
        }
        let spacing = f64::from(1u32 << key.spacing_bits());
        if node.children == 0 || self.is_small(&node, key, from) || key.level() == MAX_LEVEL {
            let place = BrickPlacement { key, base: key.base().map(f64::from), spacing };
            return self.brick(&node, place, [from, to]);
        }
        let middle = key.base().map(|b| f64::from(b) + spacing * (BRICK_CELLS / 2) as f64);
        let passes: Vector = std::array::from_fn(|a| self.line.passes(a, middle[a]));
        let mut upper: [bool; 3] = std::array::from_fn(|a| {
            let d = self.line.direction[a];
            if d == 0.0 { self.line.origin[a] >= middle[a] } else { (d > 0.0) == (passes[a] <= from) }
        });
        let mut at = from;
        while at < to {
            let next = passes.into_iter().filter(|t| *t > at).fold(to, f64::min);
            let octant = upper.iter().enumerate().map(|(a, up)| usize::from(*up) << a).sum::<usize>();
            let child = Octant::all().nth(octant).map_or(key, |octant| key.child(octant));
            if self.descend(node.children + octant as u32, child, [at, next])?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
            for a in 0..3 {
                upper[a] ^= passes[a] == next;
            }
            at = next;
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Whether a node's own cells are small enough at this distance to stand for what is below.
    fn is_small(&self, node: &RayNode, key: NodeKey, distance: f64) -> bool {
        let cell = self.frame.scene.bricks.tree.root().spacing(key.level());
        cell <= self.frame.cell_pixels * self.frame.eye.camera.pixel_at(distance)
            && self.frame.style().is_told_by(node)
            && self.frame.scene.tint.is_none_or(|tint| tint.is_plain(key))
    }

    fn brick(&mut self, node: &RayNode, place: BrickPlacement, t: [f64; 2]) -> Result<ControlFlow<()>> {
        let (low, high) = node.own;
        if low == high && !node.fractions {
            // The index knows; no need to read the brick.
            return self.uniform(low.into(), place, t);
        }
        if let Some(missing) = &mut self.missing
            && !self.frame.scene.bricks.holds(place.key)
        {
            missing.push(place.key);
            return Ok(ControlFlow::Break(()));
        }
        let prepared = self.frame.scene.bricks.get(place.key, &mut self.lane)?;
        if let Some(colour) = self.begins_within(&prepared, place, t)? {
            return Ok(self.meet(t[0], colour));
        }
        let (line, asked) = (&self.line, &self.asked);
        let sight = BrickRay { frame: self.frame, prepared: &prepared, place, line, asked };
        let gathered = &mut self.gathered;
        // Most of a brick is not worth a look, and goes by in blocks.
        let seen = walk(&self.line, place.blocks(), t, |block, t| {
            let look = |ijk, t| sight.cell(gathered, ijk, t);
            prepared.blocks.is_active(block).then(|| walk(&self.line, place.cells(), t, look))?
        });
        Ok(match seen {
            Some(RayEnd::Opaque(t, colour)) => self.meet(t, colour),
            Some(RayEnd::Enough) => ControlFlow::Break(()),
            Some(RayEnd::Failed(error)) => return Err(error),
            None => ControlFlow::Continue(()),
        })
    }

    /// Whether the ray begins here, at a cut: its normal.
    fn cut_at(&self, t: f64) -> Option<Vector> {
        self.span.cut.filter(|_| t <= self.span.from)
    }

    fn meet(&mut self, t: f64, colour: [f64; 3]) -> ControlFlow<()> {
        self.gathered.add(colour, 1.0);
        self.hit = Some(t);
        ControlFlow::Break(())
    }

    /// A brick whose samples are all the same.
    fn uniform(&mut self, w: f64, place: BrickPlacement, [from, to]: [f64; 2]) -> Result<ControlFlow<()>> {
        let Frame { scene, eye, .. } = self.frame;
        let style = self.frame.style();
        if let Some(surface) = style.surfaces.iter().find(|surface| surface.is_opaque() && w >= surface.w) {
            let normal = eye.camera.axes[2];
            let colour = match self.cut_at(from) {
                Some(normal) if scene.tint.is_some() => eye.light.plain_cap(normal),
                Some(normal) => eye.light.cap(w, normal),
                None => {
                    match tinted((self.frame, &self.asked), surface, &self.line, place, (from, normal))? {
                        Some(colour) => colour,
                        None => eye.light.surface(surface, w, normal).0,
                    }
                }
            };
            return Ok(self.meet(from, colour));
        }
        if let Some(volume) = style.volume.as_ref().filter(|volume| volume.sees(w)) {
            let stretches = (to - from) / self.frame.stretch(volume, place.key);
            let [opacity] = volume.opacity.at(w);
            // As much as the steps through cells would gather.
            let left = libm::pow(1.0 - opacity / STEPS_A_STRETCH, STEPS_A_STRETCH * stretches);
            self.gathered.add(volume.colour.at(w), 1.0 - left);
            if self.gathered.is_full() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// What is seen of an opaque surface that the ray is within as it enters a brick: at a cut, or where the brick before
    /// knew it less exactly.
    fn begins_within(
        &self,
        prepared: &RayBrick,
        place: BrickPlacement,
        [from, to]: [f64; 2],
    ) -> Result<Option<[f64; 3]>> {
        let Frame { scene, eye, .. } = self.frame;
        let sight = BrickRay { frame: self.frame, prepared, place, line: &self.line, asked: &self.asked };
        let ijk = place.cell(self.line.at(from));
        let passages = scene.bricks.style.surfaces.iter().zip(&prepared.surfaces);
        for (surface, passage) in passages.filter(|(surface, _)| surface.is_opaque()) {
            let stretch = passage.field.as_ref().map(|field| sight.stretch(field, ijk, to));
            if !stretch.as_ref().map_or(passage.is_inside, |stretch| stretch.value(from) >= 0.0) {
                continue;
            }
            return Ok(Some(match self.cut_at(from) {
                Some(normal) if scene.tint.is_some() => eye.light.plain_cap(normal),
                // A cap shows what lies just within, not what the cut has taken.
                Some(normal) => eye.light.cap(self.sample(place, from)?.max(surface.least()), normal),
                None => {
                    let normal = stretch.map_or(eye.camera.axes[2], |stretch| stretch.normal(from));
                    match tinted((self.frame, &self.asked), surface, &self.line, place, (from, normal))? {
                        Some(colour) => colour,
                        None => eye.light.surface(surface, sight.most(ijk), normal).0,
                    }
                }
            }));
        }
        Ok(None)
    }

    /// w of the sample nearest to the ray's point.
    fn sample(&self, place: BrickPlacement, t: f64) -> Result<f64> {
        let brick = self.frame.scene.bricks.tree.brick(place.key)?;
        let at = place.local(self.line.at(t)).map(|c| ((c + 0.5).max(0.0) as usize).min(BRICK_CELLS));
        Ok(f64::from(brick.sample(at)))
    }
}

/// The colour in light where a ray meets the boundary, if something else than w decides it.
fn tinted(
    (frame, asked): (&Frame<'_>, &Asked<'_>),
    surface: &IsoSurface,
    line: &Line,
    place: BrickPlacement,
    (t, normal): (f64, Vector),
) -> Result<Option<[f64; 3]>> {
    if surface.w != 0.5 {
        return Ok(None);
    }
    let at = frame.scene.bricks.tree.root().to_world(line.at(t).map(|c| c + 1.0));
    let colour = asked.colour(Met { key: place.key, at, normal }, frame.eye.camera.pixel_at(t))?;
    Ok(colour.map(|colour| frame.eye.light.tinted(colour, normal)))
}

/// Why a ray goes no farther.
enum RayEnd {
    /// It has met something opaque: where, and its colour.
    Opaque(f64, [f64; 3]),
    /// What it has gathered hides all the rest.
    Enough,
    /// What could not be read.
    Failed(Error),
}

/// A ray in a brick.
struct BrickRay<'a> {
    frame: &'a Frame<'a>,
    prepared: &'a RayBrick,
    place: BrickPlacement,
    line: &'a Line,
    asked: &'a Asked<'a>,
}

impl BrickRay<'_> {
    /// The stretch of the ray in a cell up to `to`.
    fn stretch(&self, field: &RayField, ijk: [usize; 3], to: f64) -> Stretch<'_> {
        Stretch { line: self.line, place: self.place, ijk, cell: field.cell(ijk), to }
    }

    /// Gathers what is seen in a cell: the surfaces in the order in which the ray meets them, and the haze in between.
    fn cell(&self, gathered: &mut RayLight, ijk: [usize; 3], [from, to]: [f64; 2]) -> Option<RayEnd> {
        let mut met = [(0.0, 0); SURFACES_MAX];
        let mut count = 0;
        for (number, passage) in self.prepared.surfaces.iter().enumerate() {
            if let Some(field) = &passage.field
                && field.is_active(ijk)
                && let Some(t) = self.stretch(field, ijk, to).passage(from)
            {
                met[count] = (t, number);
                count += 1;
            }
        }
        let haze = self.prepared.volume.as_ref().filter(|field| field.is_active(ijk));
        if count == 0 && haze.is_none() {
            return None;
        }
        let (met, mut at) = (&mut met[..count], from);
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        for &(t, number) in &*met {
            self.haze(gathered, haze, ijk, [at, t]);
            at = t;
            let (surface, field) =
                (&self.frame.style().surfaces[number], &self.prepared.surfaces[number].field);
            let normal = field.as_ref().map_or([0.0; 3], |field| self.stretch(field, ijk, to).normal(t));
            match tinted((self.frame, self.asked), surface, self.line, self.place, (t, normal)) {
                Err(error) => return Some(RayEnd::Failed(error)),
                Ok(Some(colour)) => return Some(RayEnd::Opaque(t, colour)),
                Ok(None) => {}
            }
            let (colour, opacity) = self.frame.eye.light.surface(surface, self.most(ijk), normal);
            if surface.is_opaque() {
                return Some(RayEnd::Opaque(t, colour));
            }
            gathered.add(colour, opacity);
        }
        self.haze(gathered, haze, ijk, [at, to]);
        gathered.is_full().then_some(RayEnd::Enough)
    }

    /// Gathers the haze between two places in a cell.
    fn haze(&self, gathered: &mut RayLight, field: Option<&RayField>, ijk: [usize; 3], [from, to]: [f64; 2]) {
        let (Some(field), Some(volume)) = (field, &self.frame.style().volume) else { return };
        let stretch = self.stretch(field, ijk, to);
        let [low, high] = volume.range();
        let length = (to - from) / self.frame.stretch(volume, self.place.key);
        let in_cells = (to - from) / self.frame.scene.bricks.tree.root().spacing(self.place.key.level());
        let steps = (length.min(in_cells) * STEPS_A_STRETCH - STEPS_SLACK).ceil().max(1.0);
        for step in 0..steps as usize {
            let t = from + (to - from) * (step as f64 + 0.5) / steps;
            let w = low + stretch.value(t) * (high - low);
            if volume.sees(w) {
                let [opacity] = volume.opacity.at(w);
                let mut colour = volume.colour.at(w);
                if volume.shaded {
                    colour = self.frame.eye.light.haze(colour, stretch.normal(t));
                }
                gathered.add(colour, (opacity * length / steps).min(1.0));
            }
        }
    }

    /// The largest winding number at a cell's corners, if the style asks for it.
    fn most(&self, ijk: [usize; 3]) -> f64 {
        self.prepared.counts.as_ref().map_or(0.0, |counts| counts.most(ijk))
    }
}

/// Cubes in rows along the axes.
#[derive(Clone, Copy)]
struct Grid {
    base: Vector,
    /// Size of a cube, in units.
    spacing: f64,
    /// Cubes along an axis.
    across: usize,
}

impl Grid {
    /// The cube that holds a point, or the nearest.
    fn cube(&self, point: Vector) -> [usize; 3] {
        let cube = |a: usize| ((point[a] - self.base[a]) / self.spacing).max(0.0) as usize;
        [0, 1, 2].map(|a| cube(a).min(self.across - 1))
    }
}

/// Shows `look` each cube that a line passes between two places, with the places where it enters and leaves, until it
/// has seen something (Amanatides & Woo 1987).
fn walk<T>(
    line: &Line,
    grid: Grid,
    [from, to]: [f64; 2],
    mut look: impl FnMut([usize; 3], [f64; 2]) -> Option<T>,
) -> Option<T> {
    let mut ijk = grid.cube(line.at(from));
    let face = |a: usize, cube: usize| {
        let upper = cube + usize::from(line.direction[a] > 0.0);
        line.passes(a, grid.base[a] + upper as f64 * grid.spacing)
    };
    let mut next: Vector = std::array::from_fn(|a| face(a, ijk[a]));
    let mut at = from;
    loop {
        let axis = if next[0] <= next[1] && next[0] <= next[2] {
            0
        } else if next[1] <= next[2] {
            1
        } else {
            2
        };
        let leaves = next[axis].clamp(at, to);
        if let Some(seen) = look(ijk, [at, leaves]) {
            return Some(seen);
        }
        at = leaves;
        let beyond = if line.direction[axis] > 0.0 { ijk[axis] + 1 } else { ijk[axis].wrapping_sub(1) };
        if at >= to || beyond >= grid.across {
            return None;
        }
        ijk[axis] = beyond;
        next[axis] = face(axis, beyond);
    }
}
