//! Whether the infill of a part is sparse, by how far apart its lines lie.

use super::around::{SurroundingSegments, Tracer};
use super::role::may_be_sparse;
use crate::lattice::{dot, length, minus};
use crate::store::BeadSegment;
use std::collections::BTreeMap;

/// Infill is sparse if its lines lie farther apart than this many widths.
const SPARSE: f64 = 1.5;
/// Lines nearer than this share of their width are one line, laid twice or joined end to end.
const JOINED: f64 = 0.25;
/// The least cosine of the angle between lines that lie beside each other.
const PARALLEL: f64 = 0.9;
/// The share of the shorter line along which both run, if they lie beside each other.
const BESIDE: f64 = 0.3;
/// Lines whose neighbours are looked for; of more, evenly taken.
const SAMPLED: usize = 2000;

/// A line of infill.
struct Line {
    from: [f64; 3],
    along: [f64; 3],
    length: f64,
    width: f64,
}

/// Whether infill that may be sparse is: of its lines around voids most, by length, lie farther from the next one beside them, in
/// the same layer, than half their width more than they are wide. The lines of dense infill touch.
pub(super) fn has_sparse_infill<'b>(
    all: impl Iterator<Item = &'b SurroundingSegments>,
    tracer: &Tracer<'_>,
) -> bool {
    let tables = tracer.tables();
    let mut segments: BTreeMap<(u32, u64), BeadSegment> = BTreeMap::new();
    for around in all {
        segments.extend(around.segments.iter().map(|(name, (_, segment))| (*name, *segment)));
    }
    let mut layers: BTreeMap<(u32, u32), Vec<Line>> = BTreeMap::new();
    for segment in segments.values() {
        let bead = tables.beads[tables.bead_of(segment.pass).0 as usize];
        if may_be_sparse(&tables.features[usize::from(bead.feature)]) {
            let line = Line::of(segment, tracer.width(segment));
            layers.entry((bead.source, bead.layer)).or_default().extend(line);
        }
    }
    is_sparse(&layers.into_values().collect::<Vec<_>>())
}

/// See [`has_sparse_infill`], of the lines of each layer.
fn is_sparse(layers: &[Vec<Line>]) -> bool {
    let count: usize = layers.iter().map(Vec::len).sum();
    let all = layers.iter().flat_map(|layer| layer.iter().map(move |line| (line, layer)));
    let sampled = all.step_by(count.div_ceil(SAMPLED).max(1));
    let mut spacings: Vec<(f64, f64)> = sampled
        .filter_map(|(line, layer)| {
            let beside = layer.iter().filter_map(|other| line.spacing(other));
            Some((beside.min_by(f64::total_cmp)?, line.length))
        })
        .collect();
    spacings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * spacings.iter().map(|(_, length)| length).sum::<f64>();
    let mut sum = 0.0;
    let median = spacings.iter().find(|(_, length)| {
        sum += length;
        sum >= half
    });
    median.is_some_and(|(spacing, _)| *spacing > SPARSE)
}

impl Line {
    /// `None` of a segment without length.
    fn of(segment: &BeadSegment, width: f64) -> Option<Line> {
        let [from, to] = [segment.a, segment.b].map(|p| p.map(f64::from));
        let way = minus(to, from);
        let length = length(way);
        (length > 0.0).then(|| Line { from, along: way.map(|c| c / length), length, width })
    }

    /// The distance of another line that runs beside this one, in widths of the wider; `None` if it does not, or is the same line.
    fn spacing(&self, other: &Line) -> Option<f64> {
        let turned = dot(self.along, other.along);
        if turned.abs() < PARALLEL {
            return None;
        }
        let begin = dot(minus(other.from, self.from), self.along);
        let end = begin + turned * other.length;
        let (low, high) = (begin.min(end).max(0.0), begin.max(end).min(self.length));
        if high - low < BESIDE * self.length.min(other.length) {
            return None;
        }
        let middle = 0.5 * (low + high);
        let at: [f64; 3] = std::array::from_fn(|a| self.from[a] + middle * self.along[a]);
        let part = (middle - begin) / turned;
        let foot: [f64; 3] = std::array::from_fn(|a| other.from[a] + part * other.along[a]);
        let widths = length(minus(at, foot)) / self.width.max(other.width);
        (widths > JOINED).then_some(widths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines of a layer along a path, 0.5 wide.
    fn path(points: &[[f64; 2]]) -> Vec<Line> {
        let line = |ends: &[[f64; 2]]| {
            let [from, to] = [ends[0], ends[1]].map(|[x, y]| [x, y, 0.2]);
            let way = minus(to, from);
            Line { from, along: way.map(|c| c / length(way)), length: length(way), width: 0.5 }
        };
        points.windows(2).map(line).collect()
    }

    /// A raster whose lines are joined at their ends by connectors.
    fn zigzag(spacing: f64) -> Vec<Line> {
        let ends = |n: usize| if n.is_multiple_of(2) { [0.0, 30.0] } else { [30.0, 0.0] };
        let points: Vec<[f64; 2]> = (0..20).flat_map(|n| ends(n).map(|x| [x, spacing * n as f64])).collect();
        path(&points)
    }

    #[test]
    fn lines_are_sparse_whether_they_are_joined_or_not() {
        assert!(is_sparse(&[zigzag(3.0)]) && !is_sparse(&[zigzag(0.5)]));
        let apart = |spacing: f64| zigzag(spacing).into_iter().step_by(2).collect::<Vec<_>>();
        assert!(is_sparse(&[apart(3.0)]) && !is_sparse(&[apart(0.5)]));
    }

    #[test]
    fn curves_of_short_segments_are_measured_across() {
        // Waves as of gyroid infill.
        let wave = |y: f64| -> Vec<[f64; 2]> {
            (0..100).map(|n| 0.3 * f64::from(n)).map(|x| [x, y + (0.8 * x).sin()]).collect()
        };
        let layer =
            |spacing: f64| (0..12).flat_map(|n| path(&wave(spacing * f64::from(n)))).collect::<Vec<_>>();
        assert!(is_sparse(&[layer(2.5)]) && !is_sparse(&[layer(0.5)]));
    }

    #[test]
    fn lines_that_cross_are_no_neighbours() {
        let across: Vec<Line> = (0..10)
            .flat_map(|n| path(&[[3.0 * f64::from(n), 0.0], [3.0 * f64::from(n), 30.0]]))
            .chain((0..10).flat_map(|n| path(&[[0.0, 3.0 * f64::from(n)], [30.0, 3.0 * f64::from(n)]])))
            .collect();
        assert!(is_sparse(&[across]));
        assert!(!is_sparse(&[]) && !is_sparse(&[path(&[[0.0, 0.0], [1.0, 0.0]])]));
    }
}
