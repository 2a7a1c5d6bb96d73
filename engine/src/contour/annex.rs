//! Creases that leave their cells.
//!
//! A crease, the sharper the more, reaches through faces without a sign change: into cells whose corners are all on one
//! side and which have no vertex, or into active ones to which no mesh edge leads there.
//!
//! *Annexed cells.* A cell with one loop may annex one cell without a sign change that shares a face with it, if its
//! crease passes there. Its region is the box of the two, in which its vertex may lie. Regions have no inner point in
//! common, and no sign-changing edge lies between the two cells of one. So where mesh edges pass through the
//! rectangles that regions share, envelopes have no inner point in common either ([`super::envelope`]): seen from a vertex
//! in its box, what belongs to different edges lies side by side on the surface of the box. Two regions share
//! the face between their active cells, and that between their annexed ones too if both lie in one direction; where a mesh
//! edge would pass elsewhere it gets a vertex on the face ([`super::faces`]). Who annexes a cell follows from the
//! crossings of the cells around it alone, which all leaves see alike through [`super::halo`].
//!
//! *Gaps.* Where a crease goes on into a region that shares no mesh edge with this one, the mesh runs below it from the one
//! vertex to the other. Along a crease a vertex is as good in one place as in another, so there it goes to the end of the
//! region, and the gap is as short as it can be. The points of true edges of a part at 256³ are 0.018 cells from the mesh on
//! average with annexed cells alone, 0.015 with shorter gaps alone, 0.009 with both, and 0.021 with none.

use super::cells::Builder;
use super::edges::EDGE_PLACES;
use super::halo::{Halo, Place};
use super::outliers::minimiser;
use super::planes::{Plane, distance};
use super::qef::{Qef, TRUNCATION_SQUARED, Vector};
use super::surface::Changes;
use super::symmetric::dot;
use super::topology::{Kind, edge_lower};
use crate::error::Result;
use crate::lattice::BRICK_CELLS;
use std::rc::Rc;

/// How far, in cells, planes may pass by a crease or a corner that they form: faces that are curved a little have one, too.
const FIT: f64 = 0.1;

/// tan² of half the angle between the normals of two faces, 30°, from which on their crease is followed: the flatter it is
/// the less of it is lost.
pub(super) const SHARP: f64 = 0.071_796_769_724_490_83;

/// Least length, in cells, of a crease in a cell for which it is annexed.
const LEAST: f64 = 1.0 / 64.0;

/// How far vertices at the ends of creases stay within their regions, in cells: triangles in gaps keep some width.
const INSET: f64 = 1.0 / 32.0;

/// A direction to a neighbour across a face, 2·axis + side.
pub(super) type Direction = u8;

/// The neighbour of a cell in a direction.
pub(super) fn neighbour(mut cell: Place, direction: Direction) -> Place {
    cell[usize::from(direction / 2)] += 2 * i32::from(direction % 2) - 1;
    cell
}

/// The box of a cell, as the cell sees it, and of its neighbour if it has annexed one, `margin` within.
fn region(annexed: Option<Direction>, margin: f64) -> [Vector; 2] {
    let mut bounds = [[margin; 3], [1.0 - margin; 3]];
    if let Some(direction) = annexed {
        let (axis, side) = (usize::from(direction / 2), usize::from(direction % 2));
        bounds[side][axis] += if side == 1 { 1.0 } else { -1.0 };
    }
    bounds
}

fn holds([low, high]: &[Vector; 2], at: &Vector) -> bool {
    (0..3).all(|a| (low[a]..=high[a]).contains(&at[a]))
}

/// Whether a face of a cell with this corner mask has corners on both sides.
fn is_crossed(mask: u8, face: Direction) -> bool {
    let upper = [0b1010_1010, 0b1100_1100, 0b1111_0000][usize::from(face / 2)];
    let corners: u8 = if face % 2 == 1 { upper } else { !upper };
    mask & corners != 0 && mask & corners != corners
}

/// Where the planes of a cell with one loop meet, as the cell sees it.
#[derive(Clone)]
struct Crease {
    /// Matrix, right-hand side and so on, as in [`super::outliers::Terms`].
    terms: [f64; 16],
    /// The minimiser anywhere.
    free: Vector,
    /// Along the crease, if the planes meet in one and not in a corner.
    along: Option<Vector>,
}

impl Crease {
    /// That of such a cell; `None` where its planes are as good as one, or do not meet.
    fn of(changes: &Changes, cell: [usize; 3], kind: Kind) -> Option<Crease> {
        let mut planes = [Plane::default(); 12];
        let (mut qef, mut count) = (Qef::default(), 0);
        for edge in kind.loops().edges_of(0) {
            let (axis, offset) = edge_lower(edge);
            let plane = &changes.planes[changes.slot(axis, std::array::from_fn(|a| cell[a] + offset[a]))];
            let [x, y, z, _] = EDGE_PLACES[edge].seen_from_centre(plane);
            planes[count] = ([x, y, z].map(|c| f64::from(c) + 0.5), plane.normal.map(f64::from));
            qef.add(planes[count].0, planes[count].1);
            count += 1;
        }
        let agreed = dot(qef.normal_sum, qef.normal_sum) / qef.count;
        if qef.count - agreed <= agreed * SHARP {
            return None;
        }
        let mean = qef.point_sum.map(|c| c / qef.count);
        let moved = qef.matrix.times(mean);
        let rhs: Vector = std::array::from_fn(|a| qef.rhs[a] - moved[a]);
        let (values, vectors) = qef.matrix.eigen();
        let largest = values.into_iter().fold(0.0, f64::max);
        let mass = mean.map(|c| c + 0.5);
        let (mut free, mut flat, mut flats) = (mass, None, 0);
        for (value, vector) in values.into_iter().zip(vectors) {
            if value > largest * TRUNCATION_SQUARED {
                let along = dot(vector, rhs) / value;
                (0..3).for_each(|a| free[a] += vector[a] * along);
            } else {
                flat = Some(vector);
                flats += 1;
            }
        }
        if flats > 1 || planes[..count].iter().any(|plane| misses(plane, &free)) {
            return None;
        }
        let [xx, yy, zz, xy, yz, zx] = qef.matrix.0;
        let ([ra, rb, rc], [ma, mb, mc], [fa, fb, fc]) = (rhs, mass, free);
        let terms = [xx, yy, zz, xy, yz, zx, ra, rb, rc, ma, mb, mc, fa, fb, fc, largest];
        Some(Crease { terms, free, along: flat })
    }

    /// From where to where the crease lies in a box, along it from the minimiser, if it does.
    fn within(&self, [low, high]: &[Vector; 2]) -> Option<[f64; 2]> {
        let along = self.along?;
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for a in 0..3 {
            let [low, high] = [low[a] - self.free[a], high[a] - self.free[a]];
            if along[a].abs() < 1e-9 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (s, t) = (low / along[a], high / along[a]);
            (enter, leave) = (enter.max(s.min(t)), leave.min(s.max(t)));
        }
        (enter < leave).then_some([enter, leave])
    }

    /// The point of the crease so far from the minimiser.
    fn at(&self, distance: f64) -> Vector {
        let along = self.along.unwrap_or_default();
        std::array::from_fn(|a| self.free[a] + distance * along[a])
    }

    /// The face of a box through which the crease leaves it at its end `at`, upwards along the crease or downwards.
    fn exit(&self, [low, high]: &[Vector; 2], at: &Vector, is_up: bool) -> Direction {
        let along = self.along.unwrap_or_default();
        let faces = (0..3u8).map(|axis| {
            let a = usize::from(axis);
            let is_high = (along[a] > 0.0) == is_up;
            let off = if is_high { high[a] - at[a] } else { at[a] - low[a] };
            (off / along[a].abs(), 2 * axis + u8::from(is_high))
        });
        let nearest = faces.reduce(|best, face| if face.0 < best.0 { face } else { best });
        nearest.map_or(0, |(_, face)| face)
    }

    /// Whether it stays where mesh edges lead: within faces of the cell that have corners on both sides.
    fn is_led(&self, mask: u8) -> bool {
        let cell = region(None, 0.0);
        if self.along.is_none() {
            return holds(&cell, &self.free);
        }
        let ends = self.within(&cell);
        holds(&cell, &self.free)
            && ends.is_some_and(|ends| {
                [false, true]
                    .into_iter()
                    .zip(ends)
                    .all(|(is_up, end)| is_crossed(mask, self.exit(&cell, &self.at(end), is_up)))
            })
    }

    /// How much of it is in the neighbour in a direction; below one only where it passes both by, which then counts as less.
    fn worth(&self, direction: Direction) -> f64 {
        let low = neighbour([0; 3], direction).map(f64::from);
        let length = self.within(&[low, low.map(|c| c + 1.0)]).map_or(0.0, |[enter, leave]| leave - enter);
        if length > LEAST {
            return 1.0 + length;
        }
        let at = self.free[usize::from(direction / 2)];
        (if direction % 2 == 1 { at - 1.0 } else { -at }).min(1.0)
    }

    /// Squared distance from the middle of the neighbour in a direction to the minimiser.
    fn distance(&self, direction: Direction) -> f64 {
        let middle = neighbour([0; 3], direction).map(|c| f64::from(c) + 0.5);
        let off: Vector = std::array::from_fn(|a| self.free[a] - middle[a]);
        dot(off, off)
    }

    /// The minimiser over the cell and what it has annexed: on the crease, if any of that lies there.
    fn minimiser(&self, annexed: Option<Direction>, margin: f64) -> Vector {
        let bounds = region(annexed, margin);
        if holds(&bounds, &self.free) {
            return self.free;
        }
        match self.within(&bounds) {
            Some([enter, leave]) => self.at(if enter > 0.0 { enter } else { leave }),
            None => minimiser(&self.terms, bounds),
        }
    }
}

/// True if a point is not on a plane.
fn misses(plane: &Plane, at: &Vector) -> bool {
    distance(plane, *at) > FIT
}

/// The cell that a cell would annex.
#[derive(Clone, Copy)]
struct Claim {
    direction: Direction,
    /// Squared, from the middle of the cell to where the vertex would best lie; of several cells the nearest has it.
    distance: f64,
}

/// Who annexes what about a leaf.
pub(super) struct Claims<'a> {
    pub halo: Halo<'a>,
    /// Whether creases are followed. Where vertices are merged they are not: what stands for several cells' is placed anew.
    pub may_annex: bool,
    /// For each cell of the leaf and those up to two cells around it, one more than its place in `known`, if it has one.
    places: Vec<u32>,
    known: Vec<Known>,
}

/// What is known of a cell whose crease leaves it where no mesh edge leads; none of others.
type Known = Option<(Rc<Crease>, u8, Option<Claim>)>;

/// Cells along each axis of which something is known.
const KNOWN: i32 = BRICK_CELLS as i32 + 8;

impl<'a> Claims<'a> {
    pub(super) fn new(halo: Halo<'a>, may_annex: bool) -> Claims<'a> {
        let places = if may_annex { vec![0; KNOWN.pow(3) as usize] } else { Vec::new() };
        Claims { halo, may_annex, places, known: Vec::new() }
    }

    /// Where the planes of a plain cell with one loop meet, its corner mask and what it would annex, if its crease leaves it
    /// where no mesh edge leads.
    fn crease(&mut self, cell: Place) -> Result<Known> {
        if !self.may_annex {
            return Ok(None);
        }
        let [x, y, z] = cell.map(|c| c + 4);
        let place = (x + KNOWN * (y + KNOWN * z)) as usize;
        if self.places[place] == 0 {
            let known = self.found(cell)?;
            self.known.push(known);
            self.places[place] = self.known.len() as u32;
        }
        Ok(self.known[self.places[place] as usize - 1].clone())
    }

    fn found(&mut self, cell: Place) -> Result<Known> {
        self.fetch_around(cell)?;
        let Some((changes, local, kind)) = self.halo.lone(cell)? else { return Ok(None) };
        let mask = kind.loops().mask;
        let Some(crease) = Crease::of(changes, local, kind).filter(|crease| !crease.is_led(mask)) else {
            return Ok(None);
        };
        let claim = self.claim_of(cell, &crease, mask);
        Ok(Some((Rc::new(crease), mask, claim)))
    }

    fn fetch_around(&mut self, cell: Place) -> Result<()> {
        self.halo.fetch(cell.map(|c| c - 1), cell.map(|c| c + 2))
    }

    fn claim(&mut self, cell: Place) -> Result<Option<Claim>> {
        Ok(self.crease(cell)?.and_then(|(_, _, claim)| claim))
    }

    /// What a cell with this crease would annex, which must have been fetched with all around it.
    fn claim_of(&self, cell: Place, crease: &Crease, mask: u8) -> Option<Claim> {
        let mut best: Option<(f64, Direction)> = None;
        for direction in (0..6).filter(|&direction| !is_crossed(mask, direction)) {
            let worth = crease.worth(direction);
            let is_better = worth > best.map_or(0.0, |(most, _)| most);
            if is_better && self.is_inactive(neighbour(cell, direction)) {
                best = Some((worth, direction));
            }
        }
        let (_, direction) = best?;
        // Only faces between plain cells of one size are looked at where mesh edges pass elsewhere.
        let is_plain = |direction| self.halo.plain_mask(neighbour(cell, direction)).is_some();
        (0..6).all(is_plain).then(|| Claim { direction, distance: crease.distance(direction) })
    }

    /// Whether a plain cell has no sign change; what is about it must have been fetched.
    pub(super) fn is_inactive(&self, cell: Place) -> bool {
        matches!(self.halo.plain_mask(cell), Some(0 | u8::MAX))
    }

    /// The cell that annexes one without a sign change, if any does.
    pub(super) fn annexer(&mut self, cell: Place) -> Result<Option<Place>> {
        let mut best: Option<(f64, Place)> = None;
        for direction in 0..6 {
            let next = neighbour(cell, direction);
            if let Some(claim) = self.claim(next)?
                && claim.direction == direction ^ 1
                && best.is_none_or(|(least, _)| claim.distance < least)
            {
                best = Some((claim.distance, next));
            }
        }
        Ok(best.map(|(_, cell)| cell))
    }

    /// What a cell annexes, and where its vertex goes then or for the gaps beside it, as the cell sees it.
    fn reach(&mut self, cell: Place, margin: f64) -> Result<Option<(Option<Direction>, Vector)>> {
        let Some((crease, mask, claim)) = self.crease(cell)? else { return Ok(None) };
        let mut annexed = None;
        if let Some(Claim { direction, .. }) = claim
            && self.annexer(neighbour(cell, direction))? == Some(cell)
        {
            annexed = Some(direction);
        }
        if let Some(at) = self.end_at_gap(cell, (&crease, mask), annexed)? {
            return Ok(Some((annexed, at)));
        }
        let is_moved = annexed.is_some() || crease.within(&region(None, margin)).is_some();
        Ok(is_moved.then(|| (annexed, crease.minimiser(annexed, margin))))
    }

    /// The end of a crease in a region beyond which there is a gap, if that is so at one end.
    fn end_at_gap(
        &mut self,
        cell: Place,
        (crease, mask): (&Crease, u8),
        annexed: Option<Direction>,
    ) -> Result<Option<Vector>> {
        let bounds = region(annexed, INSET);
        let Some(ends) = crease.within(&bounds) else { return Ok(None) };
        let mut is_gap = [false; 2];
        for (n, end) in ends.into_iter().enumerate() {
            let at = crease.at(end);
            let exit = crease.exit(&bounds, &at, n == 1);
            // Whether the crease leaves through a face of the annexed cell.
            let far = annexed.filter(|&direction| {
                let along = at[usize::from(direction / 2)];
                exit == direction || if direction % 2 == 1 { along > 1.0 } else { along < 0.0 }
            });
            let next = neighbour(far.map_or(cell, |direction| neighbour(cell, direction)), exit);
            let is_led = match far {
                Some(direction) if exit == direction => false,
                Some(_) => self.annexer(next)? == Some(neighbour(cell, exit)),
                None => is_crossed(mask, exit),
            };
            let beyond = [end, end + if n == 1 { 0.5 } else { -0.5 }].map(|end| crease.at(end));
            is_gap[n] = !is_led && self.goes_on(cell, next, beyond)?;
        }
        Ok(match is_gap {
            [true, false] => Some(crease.at(ends[0])),
            [false, true] => Some(crease.at(ends[1])),
            _ => None,
        })
    }

    /// Whether the cell `next`, or the one that annexes it, knows of a crease through these points, as `cell` sees them.
    fn goes_on(&mut self, cell: Place, next: Place, points: [Vector; 2]) -> Result<bool> {
        self.fetch_around(next)?;
        let owner = if self.is_inactive(next) { self.annexer(next)? } else { Some(next) };
        let Some(owner) = owner else { return Ok(false) };
        self.fetch_around(owner)?;
        if self.halo.plain_mask(owner).is_none() {
            return Ok(false);
        }
        let points = points.map(|at| -> Vector { std::array::from_fn(|a| at[a] + f64::from(cell[a])) });
        let is_off = |plane| points.iter().any(|at| misses(&plane, at));
        Ok(!self.halo.any_plane(owner, owner.map(|c| c + 1), false, is_off))
    }
}

/// A vertex that goes elsewhere.
pub(super) type Moved = (usize, [f32; 3]);

impl Builder<'_> {
    /// Where the vertices of creased cells go whose crease leaves them where no mesh edge leads, but for those that `stay`
    /// where they are or go to a corner. Notes what they annex; those that `keep` their place may annex, too.
    pub(super) fn follow_creases(
        &mut self,
        claims: &mut Claims,
        stay: impl Fn(usize) -> bool,
        keep: impl Fn(usize) -> bool,
    ) -> Result<Vec<Moved>> {
        let mut moved = Vec::new();
        if !claims.may_annex {
            return Ok(moved);
        }
        for cell in std::mem::take(&mut self.sharp) {
            let Some(vertex) = self.lone_vertex(cell.map(|c| c as i32)).filter(|&vertex| !stay(vertex))
            else {
                continue;
            };
            let Some((annexed, at)) = claims.reach(cell.map(|c| c as i32), self.frame.margin)? else {
                continue;
            };
            if !keep(vertex) {
                moved.push((vertex, self.frame.world(cell, at)));
            }
            if let Some(direction) = annexed {
                self.annex(cell, direction);
            }
        }
        self.cells.annexed.sort_unstable();
        Ok(moved)
    }

    /// Notes that a cell annexes its neighbour in a direction.
    pub(super) fn annex(&mut self, cell: [usize; 3], direction: Direction) {
        self.cells.annexed.push((cell.map(|c| c as u8), direction));
        self.let_stray(cell);
    }
}
