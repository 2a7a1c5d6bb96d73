//! Cells next to finer leaves with several loops, of which no table knows.
//!
//! What belongs to a loop within such a cell is the cone from its vertex over the line in which the surface passes the
//! cell's boundary. All faces of these cells have vertices, whose places follow from the crossings alone, as do those
//! on edges, so the lines are known before any vertex is.
//!
//! Where cones meet, vertices go to others of some places until they do not; what none of these separates stays, and
//! is counted.

use super::builder::CellsBuilder;
use super::several::{LinePoint, LoopLine, MultiLoopCell};
use crate::predicates::meet_by_place;

/// Where a vertex may go: from the mean of points of its loop this share of the way to the middle of the cell, or, if they are
/// on one face, this share of their extent into the cell, times their extent in cells to this power: of lines that lie
/// within each other on a face the cone of the outer one must be over that of the inner one.
const PLACES: [(f64, i32); 7] = [
    (0.0, 0),
    (1.0 / 8.0, 0),
    (1.0 / 8.0, 1),
    (1.0 / 64.0, 0),
    (1.0 / 64.0, 1),
    (1.0 / 2.0, 0),
    (1.0 / 2.0, 1),
];
/// How often all vertices of a cell are looked at.
const ROUNDS: usize = 4;
/// Pieces of lines in a cell at most of which vertices are moved: as many as noise four levels deeper has, some 0.1 s.
const MOST_PIECES: usize = 1024;

impl MultiLoopCell {
    /// In how many places the cone of a loop, from this vertex, meets those of the others from theirs.
    fn meetings(&self, of: usize, vertex: LinePoint, vertices: &[LinePoint]) -> usize {
        let cone = |n: usize, from: LinePoint| {
            self.lines[n].iter().map(move |piece| [from, piece.on_edge, piece.on_face])
        };
        let with = |other: usize| {
            let pairs = cone(of, vertex).flat_map(|a| cone(other, vertices[other]).map(move |b| (a, b)));
            let meeting = pairs.filter(|(a, b)| are_near(a, b) && meet_by_place(a, b)).count();
            meeting + usize::from(vertex == vertices[other])
        };
        (0..vertices.len()).filter(|&other| other != of).map(with).sum()
    }

    /// In how many any two of them meet, each counted twice.
    fn all_meetings(&self, vertices: &[LinePoint]) -> usize {
        (0..vertices.len()).map(|n| self.meetings(n, vertices[n], vertices)).sum()
    }

    /// Moves vertices until cones do not meet, or no place is better. Returns whether they are known not to.
    fn separate(&self, vertices: &mut [LinePoint], places: impl Fn(&LoopLine) -> Vec<LinePoint>) -> bool {
        if self.lines.iter().map(Vec::len).sum::<usize>() > MOST_PIECES {
            return false;
        }
        if self.all_meetings(vertices) == 0 {
            return true;
        }
        let places: Vec<Vec<LinePoint>> = self.lines.iter().map(places).collect();
        if self.move_singly(vertices, &places) {
            return true;
        }
        // A vertex far from its own line may be in the way of all places of another.
        let mut others: Vec<LinePoint> = places.iter().map(|places| places[0]).collect();
        let is_apart = self.move_singly(&mut others, &places);
        if is_apart || self.all_meetings(&others) < self.all_meetings(vertices) {
            vertices.copy_from_slice(&others);
        }
        is_apart
    }

    /// Moves one vertex after another to where its cone meets others in fewer places. Returns whether none do any more.
    fn move_singly(&self, vertices: &mut [LinePoint], places: &[Vec<LinePoint>]) -> bool {
        for _ in 0..ROUNDS {
            let mut is_left = false;
            for n in 0..vertices.len() {
                let mut least = self.meetings(n, vertices[n], vertices);
                if least == 0 {
                    continue;
                }
                for &at in &places[n] {
                    let now = self.meetings(n, at, vertices);
                    if now < least {
                        (least, vertices[n]) = (now, at);
                    }
                }
                is_left |= least > 0;
            }
            if !is_left {
                return true;
            }
        }
        // The last ones moved may have left those before them alone.
        self.all_meetings(vertices) == 0
    }
}

/// Whether the boxes of two triangles touch.
fn are_near(a: &[LinePoint; 3], b: &[LinePoint; 3]) -> bool {
    (0..3).all(|n| {
        let [a, b] = [a, b].map(|corners| {
            let along = corners.map(|corner| corner[n]);
            [along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2])]
        });
        a[0] <= b[1] && b[0] <= a[1]
    })
}

impl CellsBuilder<'_> {
    /// Sees to it that cones in one cell do not meet, if any of the known places will do.
    pub(super) fn separate_cones(&mut self) {
        for several in std::mem::take(&mut self.several) {
            let own = several.first..several.first + several.lines.len();
            let mut vertices = self.cells.positions[own.clone()].to_vec();
            let is_apart = several.separate(&mut vertices, |line| self.places(several.cell, line));
            self.cells.unseparated += u64::from(!is_apart);
            self.cells.positions[own].copy_from_slice(&vertices);
        }
    }

    /// Where the vertex of a line may go, after the mean of the line and that of the middles of its edges: where the surface
    /// passes edges next to samples lines of several loops may all but touch there.
    fn places(&self, cell: [usize; 3], line: &LoopLine) -> Vec<LinePoint> {
        let passed: Vec<LinePoint> = line.iter().flat_map(|piece| [piece.on_edge, piece.on_face]).collect();
        let middles: Vec<LinePoint> = line.iter().map(|piece| piece.edge.middle()).collect();
        PLACES
            .iter()
            .flat_map(|place| [&passed, &middles].map(|points| self.over(cell, points, *place)))
            .collect()
    }

    fn over(&self, cell: [usize; 3], points: &[LinePoint], (share, power): (f64, i32)) -> LinePoint {
        let points: Vec<[f64; 3]> = points.iter().map(|point| self.frame.local(*point)).collect();
        let (mut low, mut high, mut mean) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], [0.0; 3]);
        for point in &points {
            for a in 0..3 {
                (low[a], high[a]) = (low[a].min(point[a]), high[a].max(point[a]));
                mean[a] += point[a] / points.len() as f64;
            }
        }
        let extents: [f64; 3] = std::array::from_fn(|a| high[a] - low[a]);
        let extent = extents.into_iter().fold(0.0, f64::max);
        let middle = cell.map(|c| c as f64 + 0.5);
        // On a face, but for rounding.
        let flat = (0..3).find(|&a| extents[a] < self.frame.margin);
        let at = match flat {
            Some(axis) => {
                let depth = share * extent * extent.powi(power);
                mean[axis] += if mean[axis] < middle[axis] { depth } else { -depth };
                mean
            }
            None => std::array::from_fn(|a| mean[a] + share * (middle[a] - mean[a])),
        };
        self.frame.world_within(cell.map(|c| c as i32), at)
    }
}
