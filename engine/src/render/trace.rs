//! One ray through the tree: from node to node, past whatever holds nothing to be seen, and from cell to cell in bricks.

use super::Scene;
use super::bricks::{Lane, Prepared};
use super::camera::{Ray, Vector, scaled, unit};
use super::clip::Span;
use super::field::{Cell, Field};
use super::nodes::Node;
use super::style::{Gathered, Style};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, MAX_LEVEL, NodeKey, Octant, ROOT_BITS};
use std::ops::ControlFlow;

/// Interior nodes stand for what is below them where their cells are smaller than this share of a pixel.
const CELL_IN_PIXEL: f64 = 0.5;
/// Steps of halving a stretch of a cell on which the boundary lies: to 1/2000 of the cell.
const HALVINGS: usize = 10;
/// Opacity of a cell's length of what is seen in the style of boundaries, and steps in it.
const OPACITY_A_CELL: f64 = 0.35;
const STEPS_A_CELL: f64 = 3.0;

/// A ray on its way.
pub(super) struct Tracer<'a> {
    scene: &'a Scene<'a>,
    lane: Lane,
    line: Line,
    span: Span,
    gathered: Gathered,
    /// Where the ray met the first opaque thing, along its length.
    hit: Option<f64>,
}

/// A ray in units from the root's first sample, by world length along it.
#[derive(Clone, Copy)]
struct Line {
    origin: Vector,
    direction: Vector,
}

impl Line {
    fn at(&self, t: f64) -> Vector {
        std::array::from_fn(|a| self.origin[a] + t * self.direction[a])
    }

    /// Where it passes a coordinate of an axis; infinity if it never does.
    fn passes(&self, axis: usize, at: f64) -> f64 {
        let d = self.direction[axis];
        if d == 0.0 { f64::INFINITY } else { (at - self.origin[axis]) / d }
    }
}

/// Where a brick's cells lie.
#[derive(Clone, Copy)]
struct Place {
    key: NodeKey,
    base: Vector,
    /// Of a cell, in units.
    spacing: f64,
}

impl Place {
    /// A point in cells from the brick's first one.
    fn local(&self, point: Vector) -> Vector {
        std::array::from_fn(|a| (point[a] - self.base[a]) / self.spacing)
    }

    /// The cell that holds a point, or the nearest.
    fn cell(&self, point: Vector) -> [usize; 3] {
        self.local(point).map(|c| (c.max(0.0) as usize).min(BRICK_CELLS - 1))
    }

    /// The point within that cell, 0..1 an axis.
    fn within(&self, cell: [usize; 3], point: Vector) -> Vector {
        let local = self.local(point);
        std::array::from_fn(|a| (local[a] - cell[a] as f64).clamp(0.0, 1.0))
    }
}

/// A stretch of a ray within a cell.
struct Stretch<'a> {
    tracer: &'a Line,
    place: Place,
    ijk: [usize; 3],
    cell: Cell,
    /// Where it ends.
    to: f64,
}

impl Stretch<'_> {
    fn value(&self, t: f64) -> f64 {
        self.cell.value(self.place.within(self.ijk, self.tracer.at(t)))
    }

    /// Outward normal of the level through the ray's point.
    fn normal(&self, t: f64) -> Vector {
        scaled(unit(self.cell.gradient(self.place.within(self.ijk, self.tracer.at(t)))), -1.0)
    }

    /// The first place from `from` on where the field passes 0, and whether inward.
    fn passage(&self, from: f64) -> Option<(f64, bool)> {
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
        Some((high, !was_inside))
    }
}

impl<'a> Tracer<'a> {
    pub fn new(scene: &'a Scene<'a>) -> Tracer<'a> {
        let line = Line { origin: [0.0; 3], direction: [0.0; 3] };
        let span = Span { from: 0.0, to: 0.0, cut: None };
        Tracer { scene, lane: Lane::default(), line, span, gathered: Gathered::default(), hit: None }
    }

    /// Follows a ray. What it gathers, and the distance of the first opaque thing.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn follow(&mut self, ray: &Ray) -> Result<(Gathered, Option<f64>)> {
        (self.gathered, self.hit) = (Gathered::default(), None);
        let Some(span) = self.scene.clip.span(ray) else { return Ok((self.gathered, None)) };
        let root = self.scene.bricks.tree.root();
        let edge = f64::from(1u32 << ROOT_BITS);
        let origin = root.to_units(ray.origin).map(|c| c - 1.0);
        self.line = Line { origin, direction: ray.direction.map(|c| c * (edge / root.edge)) };
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
        let node = self.scene.nodes.get(number);
        if !self.scene.style.sees(&node) {
            return Ok(ControlFlow::Continue(()));
        }
        let spacing = f64::from(1u32 << key.spacing_bits());
        if node.children == 0 || self.is_small(key, from) || key.level() == MAX_LEVEL {
            let place = Place { key, base: key.base().map(f64::from), spacing };
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

    /// Whether a node's own cells are small enough at this distance.
    fn is_small(&self, key: NodeKey, distance: f64) -> bool {
        let cell = self.scene.bricks.tree.root().spacing(key.level());
        cell <= CELL_IN_PIXEL * self.scene.camera.pixel_at(distance) / f64::from(self.scene.supersample)
    }

    fn brick(&mut self, node: &Node, place: Place, t: [f64; 2]) -> Result<ControlFlow<()>> {
        let (low, high) = node.own;
        if low == high && !node.fractions {
            // The index knows; no need to read the brick.
            return Ok(self.uniform(low, t[0]));
        }
        let prepared = self.scene.bricks.get(place.key, &mut self.lane)?;
        match self.scene.style {
            Style::Solid => self.solid(&prepared, place, t),
            Style::Boundary => Ok(self.boundary(&prepared, place, t)),
            Style::Overlap => self.overlap(&prepared, place, t),
        }
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

    /// A brick whose samples are all the same begins at `t`.
    fn uniform(&mut self, w: i16, t: f64) -> ControlFlow<()> {
        let light = &self.scene.light;
        let is_seen = match self.scene.style {
            Style::Solid => w >= 1,
            Style::Boundary => false,
            Style::Overlap => w >= 2,
        };
        if !is_seen {
            return ControlFlow::Continue(());
        }
        let colour = match self.cut_at(t) {
            Some(normal) => light.cap(w.into(), normal),
            None => light.counted(w.into(), self.scene.camera.axes[2]),
        };
        self.meet(t, colour)
    }

    /// w of the sample nearest to the ray's point.
    fn sample(&self, place: Place, t: f64) -> Result<f64> {
        let brick = self.scene.bricks.tree.brick(place.key)?;
        let at = place.local(self.line.at(t)).map(|c| ((c + 0.5).max(0.0) as usize).min(BRICK_CELLS));
        Ok(f64::from(brick.sample(at)))
    }

    fn solid(&mut self, prepared: &Prepared, place: Place, [from, to]: [f64; 2]) -> Result<ControlFlow<()>> {
        let scene = self.scene;
        let begins_inside = match &prepared.boundary {
            None => prepared.is_inside,
            Some(field) => self.stretch(field, place, [from, to]).value(from) >= 0.0,
        };
        if begins_inside {
            let colour = match (self.cut_at(from), &prepared.boundary) {
                // A cap shows what lies just within, not what the cut has taken.
                (Some(normal), _) => scene.light.cap(self.sample(place, from)?.max(1.0), normal),
                (None, Some(field)) => scene.light.body(self.stretch(field, place, [from, to]).normal(from)),
                (None, None) => scene.light.body(scene.camera.axes[2]),
            };
            return Ok(self.meet(from, colour));
        }
        let Some(field) = &prepared.boundary else { return Ok(ControlFlow::Continue(())) };
        let line = self.line;
        let met = cells(&line, place, [from, to], |ijk, [from, to]| {
            if !field.is_active(ijk) {
                return None;
            }
            let stretch = Stretch { tracer: &line, place, ijk, cell: field.cell(ijk), to };
            let (t, _) = stretch.passage(from)?;
            Some((t, stretch.normal(t)))
        });
        Ok(match met {
            Some((t, normal)) => self.meet(t, scene.light.body(normal)),
            None => ControlFlow::Continue(()),
        })
    }

    /// The stretch of the ray in the cell where it begins.
    fn stretch(&self, field: &Field, place: Place, [from, to]: [f64; 2]) -> Stretch<'_> {
        let ijk = place.cell(self.line.at(from));
        Stretch { tracer: &self.line, place, ijk, cell: field.cell(ijk), to }
    }

    fn boundary(&mut self, prepared: &Prepared, place: Place, t: [f64; 2]) -> ControlFlow<()> {
        let Some(field) = &prepared.shown else { return ControlFlow::Continue(()) };
        let (line, light) = (self.line, &self.scene.light);
        let gathered = &mut self.gathered;
        let a_cell = self.scene.bricks.tree.root().spacing(place.key.level());
        let full = cells(&line, place, t, |ijk, [from, to]| {
            if !field.is_active(ijk) {
                return None;
            }
            let stretch = Stretch { tracer: &line, place, ijk, cell: field.cell(ijk), to };
            let length = (to - from) / a_cell;
            let steps = (length * STEPS_A_CELL).ceil().max(1.0);
            for step in 0..steps as usize {
                let t = from + (to - from) * (step as f64 + 0.5) / steps;
                let w = stretch.value(t);
                if w > super::LEAST_SEEN && w < 1.0 {
                    let opacity = (OPACITY_A_CELL * length / steps).min(1.0);
                    gathered.add(light.rainbow(w, stretch.normal(t)), opacity);
                }
            }
            gathered.is_full().then_some(())
        });
        if full.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn overlap(&mut self, prepared: &Prepared, place: Place, t: [f64; 2]) -> Result<ControlFlow<()>> {
        let scene = self.scene;
        let overlaps = |field: &Field, at: Vector| field.is_inside(place.cell(at));
        if let (Some(field), Some(normal)) = (&prepared.shown, self.cut_at(t[0]))
            && overlaps(field, self.line.at(t[0]))
        {
            let w = self.sample(place, t[0])?;
            return Ok(self.meet(t[0], scene.light.cap(w.max(2.0), normal)));
        }
        let (line, gathered) = (self.line, &mut self.gathered);
        let met = cells(&line, place, t, |ijk, [from, to]| {
            let stretch = |field: &Field| Stretch { tracer: &line, place, ijk, cell: field.cell(ijk), to };
            let ghost = prepared.boundary.as_ref().filter(|field| field.is_active(ijk)).map(stretch);
            let passage = ghost.and_then(|stretch| Some((stretch.passage(from)?.0, stretch)));
            let shown = prepared.shown.as_ref().filter(|field| field.is_active(ijk)).map(stretch);
            let shown = shown.and_then(|shown| match shown.value(from) >= 0.0 {
                true => Some((from, shown)),
                false => Some((shown.passage(from)?.0, shown)),
            });
            if let Some((at, stretch)) = passage
                && shown.as_ref().is_none_or(|(first, _)| at <= *first)
            {
                let (colour, opacity) = scene.light.ghost(stretch.normal(at));
                gathered.add(colour, opacity);
            }
            shown.map(|(at, stretch)| (at, stretch.normal(at), ijk))
        });
        let Some((t, normal, ijk)) = met else { return Ok(ControlFlow::Continue(())) };
        let most = |brick: &crate::brick::Brick| {
            let corner =
                |c: usize| brick.sample([ijk[0] + (c & 1), ijk[1] + (c >> 1 & 1), ijk[2] + (c >> 2)]);
            (0..8).map(corner).max().unwrap_or(0)
        };
        let w = prepared.brick.as_ref().map_or(2, |brick| most(brick));
        Ok(self.meet(t, scene.light.counted(w.into(), normal)))
    }
}

/// Shows `look` each cell that a line passes between two places, with the places where it enters and leaves, until it
/// has seen something (Amanatides & Woo 1987).
fn cells<T>(
    line: &Line,
    place: Place,
    [from, to]: [f64; 2],
    mut look: impl FnMut([usize; 3], [f64; 2]) -> Option<T>,
) -> Option<T> {
    let mut ijk = place.cell(line.at(from));
    let face = |a: usize, cell: usize| {
        let upper = cell + usize::from(line.direction[a] > 0.0);
        line.passes(a, place.base[a] + upper as f64 * place.spacing)
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
        if at >= to || beyond >= BRICK_CELLS {
            return None;
        }
        ijk[axis] = beyond;
        next[axis] = face(axis, beyond);
    }
}
