//! Correction for the radius of the tool (G41, G42): the path of its centre beside the contour that is programmed.
//!
//! Lines and arcs are moved sideways by the radius. At outer corners an arc about the corner joins them, at inner ones they end
//! where they meet. The first move in the plane leads to beside the begin of the second one, square to it, and after G40 the next
//! move begins beside the end of the last one. So controls have it that start up at right angles (Fanuc's type A).

use super::moves::Moves;
use crate::error::Result;
use crate::toolpath::gcode::arc::{Arc, Centre};

/// Sines below this are none.
const STRAIGHT: f64 = 1e-9;

/// A move of the contour, from where the last one ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContourMove {
    pub line: u64,
    pub rapid: bool,
    pub from: [f64; 3],
    pub to: [f64; 3],
    /// The centre of an arc from its begin, and whether it is clockwise.
    pub arc: Option<([f64; 2], bool, u32)>,
}

/// A contour that is being read.
#[derive(Clone, Debug)]
pub(super) struct Compensation {
    /// How far the tool's centre is to the left of the contour, in mm; negative to the right.
    pub aside: f64,
    moves: Vec<ContourMove>,
    has_lead: bool,
}

/// The path of the centre along one move.
struct Piece {
    line: u64,
    rapid: bool,
    points: Vec<[f64; 3]>,
    /// Directions of the contour at its ends, and where it ends.
    ways: [[f64; 2]; 2],
    corner: [f64; 3],
}

impl Compensation {
    pub fn new(aside: f64) -> Compensation {
        Compensation { aside, moves: Vec::new(), has_lead: false }
    }

    /// Where the first move begins.
    pub fn begin(&self) -> Option<[f64; 3]> {
        self.moves.first().map(|first| first.from)
    }

    /// Takes a move.
    pub fn add(&mut self, of: ContourMove, out: &Moves<'_>) -> Result<()> {
        let is_plane = of.from[..2] != of.to[..2] || of.arc.is_some();
        if is_plane && !self.has_lead {
            if of.arc.is_some() {
                return Err(out.fault(b"G41", "begins with an arc: a straight move must lead to the contour"));
            }
            self.has_lead = true;
        }
        self.moves.push(of);
        Ok(())
    }

    /// The moves of the tool's centre, each a line of the program, whether it is rapid, and where it leads.
    pub fn path(&self, out: &mut Moves<'_>) -> Result<Vec<(u64, bool, [f64; 3])>> {
        let is_plane = |m: &ContourMove| m.from[..2] != m.to[..2] || m.arc.is_some();
        let lead = self.moves.iter().position(is_plane).unwrap_or(self.moves.len());
        let mut path: Vec<(u64, bool, [f64; 3])> = Vec::new();
        path.extend(self.moves[..lead].iter().map(|m| (m.line, m.rapid, m.to)));
        let Some(first) = self.moves.get(lead) else { return Ok(path) };
        // Moves along the axis stand between pieces.
        let mut pieces: Vec<Piece> = Vec::new();
        let mut upright: Vec<Vec<&ContourMove>> = vec![Vec::new()];
        for of in &self.moves[lead + 1..] {
            if is_plane(of) {
                pieces.push(self.piece(of, out)?);
                upright.push(Vec::new());
            } else if let Some(last) = upright.last_mut() {
                last.push(of);
            }
        }
        let beside = match pieces.first() {
            Some(piece) => piece.points[0],
            None => self.piece(first, out)?.points[1],
        };
        path.push((first.line, first.rapid, [beside[0], beside[1], first.to[2]]));
        for n in 0..pieces.len() {
            if n > 0 {
                self.join(&mut pieces, n, out)?;
            }
        }
        for (n, piece) in pieces.iter().enumerate() {
            // Up and down beside the end of the piece before.
            if let Some((_, _, [x, y, _])) = path.last().copied() {
                path.extend(upright[n].iter().map(|m| (m.line, m.rapid, [x, y, m.to[2]])));
            }
            path.extend(piece.points.iter().map(|point| (piece.line, piece.rapid, *point)));
        }
        if let (Some((_, _, [x, y, _])), Some(last)) =
            (path.last().copied(), upright.last().filter(|_| !pieces.is_empty()))
        {
            path.extend(last.iter().map(|m| (m.line, m.rapid, [x, y, m.to[2]])));
        } else if pieces.is_empty() {
            path.extend(upright[0].iter().map(|m| (m.line, m.rapid, [beside[0], beside[1], m.to[2]])));
        }
        Ok(path)
    }

    fn piece(&self, of: &ContourMove, out: &mut Moves<'_>) -> Result<Piece> {
        out.line = of.line;
        let ContourMove { line, rapid, from, to, .. } = *of;
        let piece = |points, ways| Piece { line, rapid, points, ways, corner: to };
        let Some((centre, clockwise, turns)) = of.arc else {
            let way = unit([to[0] - from[0], to[1] - from[1]]);
            let points = [from, to].map(|p| [p[0] - way[1] * self.aside, p[1] + way[0] * self.aside, p[2]]);
            return Ok(piece(points.to_vec(), [way; 2]));
        };
        let middle = [from[0] + centre[0], from[1] + centre[1]];
        let radius = centre[0].hypot(centre[1]);
        // The left of a counter-clockwise arc is its inside.
        let moved = if clockwise { radius + self.aside } else { radius - self.aside };
        if moved <= 1e-6 {
            return Err(out.fault(b"G41", "corrects an inner arc for a tool that does not fit into it"));
        }
        let beside = |p: [f64; 3]| {
            let spoke = unit([p[0] - middle[0], p[1] - middle[1]]);
            [middle[0] + spoke[0] * moved, middle[1] + spoke[1] * moved]
        };
        let way = |p: [f64; 3]| {
            let spoke = unit([p[0] - middle[0], p[1] - middle[1]]);
            if clockwise { [spoke[1], -spoke[0]] } else { [-spoke[1], spoke[0]] }
        };
        let (start, mut end) = (beside(from), beside(to));
        if from[..2] == to[..2] {
            end = start;
        }
        let offset = Centre::Offset([middle[0] - start[0], middle[1] - start[1]]);
        let arc = Arc { start, end, centre: offset, clockwise, turns };
        let chords = out.chords(&arc, b"G2")?;
        let mut points = vec![[start[0], start[1], from[2]]];
        points
            .extend(chords.inner_points().map(|(p, part)| [p[0], p[1], from[2] + (to[2] - from[2]) * part]));
        points.push([end[0], end[1], to[2]]);
        out.program.arcs += 1;
        Ok(piece(points, [way(from), way(to)]))
    }

    /// Joins a piece to the one before it.
    fn join(&self, pieces: &mut [Piece], n: usize, out: &mut Moves<'_>) -> Result<()> {
        let (before, rest) = pieces.split_at_mut(n);
        let (Some(before), Some(after)) = (before.last_mut(), rest.first_mut()) else { return Ok(()) };
        out.line = after.line;
        let (p, q) = (before.ways[1], after.ways[0]);
        let (sine, cosine) = (p[0] * q[1] - p[1] * q[0], p[0] * q[0] + p[1] * q[1]);
        if self.aside == 0.0 || (sine.abs() < STRAIGHT && cosine > 0.0) {
            return Ok(());
        }
        if sine * self.aside > STRAIGHT * self.aside.abs() {
            let Some((m, k, at)) = meeting(&before.points, &after.points) else {
                let what = "corrects an inner corner for a tool that does not fit into it";
                return Err(out.fault(b"G41", what));
            };
            before.points.truncate(m + 1);
            let z = before.points[m][2];
            before.points.push([at[0], at[1], z]);
            let z = after.points[0][2];
            after.points.drain(..=k);
            after.points.insert(0, [at[0], at[1], z]);
            return Ok(());
        }
        // Around an outer corner, at the height of what follows.
        let corner = before.corner;
        let [start, end] = [before.points[before.points.len() - 1], after.points[0]];
        let arc = Arc {
            start: [start[0], start[1]],
            end: [end[0], end[1]],
            centre: Centre::Offset([corner[0] - start[0], corner[1] - start[1]]),
            clockwise: self.aside > 0.0,
            turns: 0,
        };
        let chords = out.chords(&arc, b"G41")?;
        let around: Vec<[f64; 3]> = chords.inner_points().map(|(p, _)| [p[0], p[1], end[2]]).collect();
        after.points.splice(0..0, around);
        Ok(())
    }
}

/// Where two paths meet: the numbers of their segments and the place, nearest to the end of the first and the begin of the second.
fn meeting(one: &[[f64; 3]], other: &[[f64; 3]]) -> Option<(usize, usize, [f64; 2])> {
    for m in (0..one.len() - 1).rev() {
        for k in 0..other.len() - 1 {
            if let Some(at) = crossing([one[m], one[m + 1]], [other[k], other[k + 1]]) {
                return Some((m, k, at));
            }
        }
    }
    None
}

/// Where two segments cross in the plane.
fn crossing([a, b]: [[f64; 3]; 2], [c, d]: [[f64; 3]; 2]) -> Option<[f64; 2]> {
    /// Ends that meet but for rounding, as a share of a segment.
    const ROUNDING: f64 = 1e-9;
    let (p, q) = ([b[0] - a[0], b[1] - a[1]], [d[0] - c[0], d[1] - c[1]]);
    let off = [c[0] - a[0], c[1] - a[1]];
    let sine = p[0] * q[1] - p[1] * q[0];
    if sine == 0.0 {
        return None;
    }
    let s = (off[0] * q[1] - off[1] * q[0]) / sine;
    let t = (off[0] * p[1] - off[1] * p[0]) / sine;
    let within = -ROUNDING..=1.0 + ROUNDING;
    (within.contains(&s) && within.contains(&t)).then(|| [a[0] + p[0] * s, a[1] + p[1] * s])
}

fn unit(v: [f64; 2]) -> [f64; 2] {
    let length = (v[0] * v[0] + v[1] * v[1]).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { [1.0, 0.0] }
}
