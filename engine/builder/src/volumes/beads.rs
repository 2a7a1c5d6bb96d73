//! Volumes of beads as solids.

use super::estimate::StratumMoments;
use super::strata::{LINES, LineQuery, Strata};
use super::tally::{LineCrossing, LineLengths, walk};
use crate::error::Result;
use crate::lattice::{RootCube, Units};
use crate::progress::Progress;
use crate::solid::{Outline, Segment, Solids};
use crate::store::{Estimate, LayerVolumes, SourceVolumes, SweptVolumes};
use crate::toolpath::{Passes, Toolpath};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::Range;

/// Most lines, which have numbers of 32 bits.
const LINES_MAX: usize = 1 << 30;
/// Thickness of a stratum, in heights of layers: where beads lie beside each other, what they have in common depends on the
/// height within the layer. Half as thick there are fewer, longer cells for as many intervals: ± of overlap 12 % less for
/// spot300, and 12 % more for the clover.
const THICKNESS: f64 = 0.5;
/// Directions that lines may have, evenly over a half turn.
const DIRECTIONS: usize = 24;
/// Segments that are asked for the direction, at most.
const SEGMENTS_ASKED: usize = 1 << 16;
/// The least sine of the angle between a line and a segment that counts as another.
const SINE_MIN: f64 = 0.02;
/// Intervals that are sought for each segment: few, so that they take a small part of the time of a build.
const INTERVALS_A_SEGMENT: f64 = 8.0;
/// Bounds on the intervals that are sought.
const INTERVALS: (f64, f64) = ((1 << 19) as f64, (1 << 21) as f64);
/// Strata whose moments are summed before they are added to the others, in order.
const STRATA_AT_ONCE: usize = 4096;
/// Segments that a thread takes at once.
const SEGMENTS_AT_ONCE: usize = 1 << 12;
/// Most layers that are told apart.
const LAYERS_MAX: usize = 10_000;

/// Where a line meets a segment.
#[derive(Clone, Copy, PartialEq)]
struct Interval {
    line: u32,
    pass: u32,
    /// Of the round end where the pass follows another, instead of one of its segments.
    is_joint: bool,
    from: f64,
    to: f64,
    /// What of it lies between the segment's end planes.
    prism: f64,
}

/// Volumes of the beads of all toolpaths together, whose box is `bounds`. Intervals take 40 bytes each, 2 million or so at
/// most; where `memory` has no room for them, the segments are gone through once more for each part of the lines.
///
/// # Errors
/// As [`Solids::of_passes`]; if the user interrupts.
pub fn bead_volumes(
    paths: &[(&Toolpath, &Passes)],
    outline: Outline,
    bounds: ([f64; 3], [f64; 3]),
    memory: u64,
    progress: &dyn Progress,
) -> Result<SourceVolumes> {
    // A cube of its own: that of the tree may follow from its cells.
    let Some(root) = RootCube::around(bounds.0, bounds.1) else { return Ok(SourceVolumes::default()) };
    let (solids, segments) = Solids::of_passes(paths, root, outline)?;
    let unit = root.unit();
    let turn = direction(&segments);
    let scene = Scene { solids: &solids, segments: &segments, turn };
    let known = scene.known();
    let (low, high) = scene.bounds(root, bounds);
    let tops: Vec<f64> = tops(paths).iter().map(|top| (top - root.origin[2]) / unit).collect();
    let sheet = sheet(&tops).unwrap_or((THICKNESS * known.boxes / known.plan, f64::from(low[0])));
    let wanted = (segments.len() as f64 * INTERVALS_A_SEGMENT).clamp(INTERVALS.0, INTERVALS.1);
    let mut lines = LINES_MAX;
    let mut strata = Strata::sheets(low, high, sheet, lines);
    while lines > 4 * LINES && known.intervals(&strata) > wanted {
        lines = lines / 10 * 9;
        strata = Strata::sheets(low, high, sheet, lines);
    }
    let mut sums = Sums::new(tops.len());
    let bytes = known.intervals(&strata) * 2.0 * size_of::<Interval>() as f64;
    for numbers in strata.parts(bytes, memory, STRATA_AT_ONCE) {
        let first = numbers.start;
        let found = scene.intervals(&strata, numbers, progress)?;
        sums.add_strata(&strata, first, &found, &tops);
    }
    let scale =
        Scale { area: strata.area_of_line(), volume: unit.powi(3), length: unit, base: root.origin[2] };
    let swept = SweptVolumes {
        sections: known.swept * scale.volume,
        ends: known.ends * scale.volume,
        fed: fed(paths),
    };
    let volumes = sums.volumes(&scale, known.swept, strata.len() as u64, &tops);
    Ok(SourceVolumes { swept: Some(swept), ..volumes })
}

/// Material fed for all beads, if it is known.
fn fed(paths: &[(&Toolpath, &Passes)]) -> Option<f64> {
    paths.iter().flat_map(|(path, _)| (0..path.len()).map(|bead| path.attributes(bead).fed)).sum()
}

/// The upper ends of the layers, in world coordinates; none where layers do not lie one above the other.
fn tops(paths: &[(&Toolpath, &Passes)]) -> Vec<f64> {
    let [(path, _)] = paths else { return Vec::new() };
    let mut tops: Vec<(u32, f64)> = Vec::new();
    for bead in 0..path.len() {
        let layer = path.attributes(bead).layer;
        let top = path.points(bead).iter().map(|p| p[2]).fold(f64::NEG_INFINITY, f64::max);
        match tops.last_mut() {
            Some((last, highest)) if *last == layer => *highest = highest.max(top),
            _ => tops.push((layer, top)),
        }
    }
    let tops: Vec<f64> = tops.into_iter().map(|(_, top)| top).collect();
    let is_stack = tops.windows(2).all(|pair| pair[0] < pair[1]) && tops.len() <= LAYERS_MAX;
    if is_stack { tops } else { Vec::new() }
}

/// The thickness of strata, so that none lies in two layers where all layers are as high, and where one of them begins; `None`
/// without several layers.
fn sheet(tops: &[f64]) -> Option<(f64, f64)> {
    let mut heights: Vec<f64> = tops.windows(2).map(|pair| pair[1] - pair[0]).collect();
    heights.sort_unstable_by(f64::total_cmp);
    Some((THICKNESS * heights.get(heights.len() / 2)?, tops[0]))
}

/// What is known of all segments, in cubic units.
#[derive(Clone, Copy, Default)]
struct SegmentTotals {
    swept: f64,
    ends: f64,
    /// About the area of their shadows along the lines, in square units.
    shadow: f64,
    /// About the area of those along z.
    plan: f64,
    /// The boxes above these, in cubic units.
    boxes: f64,
}

impl SegmentTotals {
    /// About how many intervals lie on the lines of `strata`: a line meets what
    /// its own length and that of a segment reach.
    fn intervals(&self, strata: &Strata) -> f64 {
        let [z, across, along] = strata.cell();
        LINES as f64 * (self.boxes / along + self.shadow) / (z * across)
    }
}

#[derive(Clone, Copy)]
struct Scene<'a> {
    solids: &'a Solids,
    segments: &'a [Segment],
    /// Cosine and sine of the turn about z after which lines run along x.
    turn: [f64; 2],
}

/// The turn about z after which lines along x cross segments best. Where beads lie beside each other, the variance of what
/// they have in common is as the reciprocal sine of the angle between line and bead.
fn direction(segments: &[Segment]) -> [f64; 2] {
    let asked = segments.iter().step_by(segments.len().div_ceil(SEGMENTS_ASKED).max(1));
    let mut costs = [0.0; DIRECTIONS];
    // Half a step, so that none is along an axis.
    let turn = |n: usize| (n as f64 + 0.5) * PI / DIRECTIONS as f64;
    let turns: [[f64; 2]; DIRECTIONS] = std::array::from_fn(|n| [turn(n).cos(), turn(n).sin()]);
    for segment in asked {
        let [x, y] = [0, 1].map(|a| f64::from(segment.b[a] - segment.a[a]));
        let length = (x * x + y * y).sqrt();
        for (cost, [cosine, sine]) in costs.iter_mut().zip(turns) {
            let across = (sine * x + cosine * y).abs().max(SINE_MIN * length);
            *cost += if length > 0.0 { length * length / across } else { 0.0 };
        }
    }
    let best = (0..DIRECTIONS).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
    turns[best]
}

impl Scene<'_> {
    /// Turned so that lines run along x.
    fn turned(self, v: [f64; 3]) -> [f64; 3] {
        let [cosine, sine] = self.turn;
        [cosine * v[0] - sine * v[1], sine * v[0] + cosine * v[1], v[2]]
    }

    /// A box around all, in units: height, across the lines, along them.
    fn bounds(self, root: RootCube, (min, max): ([f64; 3], [f64; 3])) -> (Units, Units) {
        let [min, max] = [min, max].map(|corner| root.to_units(corner));
        let corners =
            [0usize, 1, 2, 3].map(|n| [0, 1].map(|a| if n >> a & 1 == 1 { max[a] } else { min[a] }));
        let turned = corners.map(|[x, y]| self.turned([x, y, 0.0]));
        let ends = |axis: usize| {
            let of_axis = turned.map(|corner| corner[axis]);
            (
                of_axis.iter().copied().fold(f64::INFINITY, f64::min),
                of_axis.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            )
        };
        let all = [(min[2], max[2]), ends(1), ends(0)];
        // Vertices are snapped to even units.
        (all.map(|(low, _)| low.floor() as i32 - 2), all.map(|(_, high)| high.ceil() as i32 + 2))
    }

    /// Sums over all segments, in the order of the toolpaths.
    fn known(self) -> SegmentTotals {
        let mut known = SegmentTotals::default();
        for segment in self.segments {
            let profile = self.solids.profile(segment);
            if !profile.is_solid() {
                continue;
            }
            let length = segment.length();
            known.swept += profile.area() * length;
            known.ends += profile.end_volume();
            let [width, height] = [2.0 * profile.half_width, 2.0 * profile.half_height];
            let [_, across, rise] = self.turned([0, 1, 2].map(|a| f64::from(segment.b[a] - segment.a[a])));
            let plan = width * (length + width);
            known.plan += plan;
            known.shadow += height * (across.abs() + width) + width * rise.abs();
            known.boxes += height * plan;
        }
        known
    }

    /// All intervals on some lines, sorted by line, pass and position.
    fn intervals(
        self,
        strata: &Strata,
        numbers: Range<u32>,
        progress: &dyn Progress,
    ) -> Result<Vec<Interval>> {
        let of_run = |(run, is_joint): (&[Segment], bool)| {
            progress.check()?;
            let mut found = Vec::new();
            for segment in run.iter().filter(|segment| self.solids.profile(segment).is_solid()) {
                let body = self.solids.body(segment).turned(self.turn);
                let a = self.turned(segment.a.map(f64::from));
                let end = body.end();
                let corners = [[a[0], a[1]], [a[0] + end[0], a[1] + end[1]]];
                // From x, y, z to the axes of the strata: height, across the lines, along them.
                let bounds = [2, 1, 0].map(|axis| (a[axis], body.extent(axis)));
                let low = bounds.map(|(a, (low, _))| (a + low).floor() as i32);
                let high = bounds.map(|(a, (_, high))| (a + high).ceil() as i32);
                let shape =
                    LineQuery { bounds: (low, high), axis: 2, corners: &corners, reach: body.reach() };
                strata.near(&shape, &numbers, |line, [z, across]| {
                    let from_a = [0.0, f64::from(across) - a[1], f64::from(z) - a[2]];
                    let (low, high) = strata.ends(line);
                    let clip = |(from, to): (f64, f64)| ((a[0] + from).max(low), (a[0] + to).min(high));
                    if let Some(interval) = body.line(0, from_a) {
                        let (from, to) = clip(interval);
                        if from < to {
                            let (first, last) = clip(body.between_ends(0, from_a, interval));
                            let prism = (last - first).max(0.0);
                            let line = line - numbers.start;
                            found.push(Interval { line, pass: segment.pass, is_joint, from, to, prism });
                        }
                    }
                });
            }
            Ok(found)
        };
        let of_segments = self.segments.par_chunks(SEGMENTS_AT_ONCE).map(|run| (run, false));
        let of_joints = self.solids.joints().par_chunks(SEGMENTS_AT_ONCE).map(|run| (run, true));
        let parts: Vec<Vec<Interval>> = of_segments.chain(of_joints).map(of_run).collect::<Result<_>>()?;
        let mut all = parts.concat();
        drop(parts);
        all.par_sort_unstable_by(|a, b| {
            let ends = || a.from.total_cmp(&b.from).then(a.to.total_cmp(&b.to));
            (a.line, a.pass, a.is_joint).cmp(&(b.line, b.pass, b.is_joint)).then_with(ends)
        });
        Ok(all)
    }
}

/// From units to the world.
struct Scale {
    /// That a line stands for, in square units.
    area: f64,
    volume: f64,
    length: f64,
    /// Height of unit 0.
    base: f64,
}

/// What is summed over strata.
#[derive(Clone)]
struct Sums {
    all: StratumMoments<4>,
    layers: Vec<StratumMoments<2>>,
}

/// Working memory for one line.
#[derive(Clone, Default)]
struct Line {
    crossings: Vec<LineCrossing>,
    /// Where the pass at hand lies, and the one before it.
    pass: Vec<(f64, f64)>,
    before: Vec<(f64, f64)>,
}

impl Sums {
    fn new(layers: usize) -> Sums {
        Sums { all: StratumMoments::default(), layers: vec![StratumMoments::default(); layers] }
    }

    fn merge(&mut self, other: &Sums) {
        self.all.merge(&other.all);
        self.layers.iter_mut().zip(&other.layers).for_each(|(layer, other)| layer.merge(other));
    }

    /// Adds strata that have these intervals, of which lines are counted from `first`; the others have nothing to add.
    fn add_strata(&mut self, strata: &Strata, first: u32, intervals: &[Interval], tops: &[f64]) {
        let stratum = |interval: &Interval| interval.line as usize / LINES;
        let of_block = |block: &[Interval]| {
            let mut sums = Sums::new(tops.len());
            let mut line = Line::default();
            for intervals in block.chunk_by(|a, b| stratum(a) == stratum(b)) {
                let second =
                    intervals.partition_point(|interval| (interval.line as usize).is_multiple_of(LINES));
                let (a, b) = intervals.split_at(second);
                let values = [a, b].map(|intervals| line.lengths(intervals).values());
                sums.all.add(values);
                let number = first + (stratum(&intervals[0]) * LINES) as u32;
                let heights = [number, number + 1].map(|line| f64::from(strata.position(line)[0]));
                sums.add_layers(values, heights, tops);
            }
            sums
        };
        // Blocks are cut where the numbers of strata say, so that sums are rounded alike whatever the threads are.
        let blocks: Vec<&[Interval]> =
            intervals.chunk_by(|a, b| stratum(a) / STRATA_AT_ONCE == stratum(b) / STRATA_AT_ONCE).collect();
        // A few at a time, as each has sums for all layers.
        for group in blocks.chunks(2 * rayon::current_num_threads()) {
            let parts: Vec<Sums> = group.par_iter().map(|block| of_block(block)).collect();
            parts.iter().for_each(|part| self.merge(part));
        }
    }

    /// Adds the lines of a stratum, which are this high, to the layers that they lie in.
    fn add_layers(&mut self, values: [[f64; 4]; LINES], heights: [f64; LINES], tops: &[f64]) {
        if tops.is_empty() {
            return;
        }
        // What rounding leaves above the last top is the last layer's.
        let layer = |z: f64| tops.partition_point(|&top| top <= z).min(tops.len() - 1);
        let [a, b] = values.map(|[union, overlap, ..]| [union, overlap]);
        match heights.map(layer) {
            [first, second] if first == second => self.layers[first].add([a, b]),
            [first, second] => {
                self.layers[first].add([a, [0.0; 2]]);
                self.layers[second].add([[0.0; 2], b]);
            }
        }
    }

    fn volumes(&self, scale: &Scale, known: f64, lines: u64, tops: &[f64]) -> SourceVolumes {
        let world = |estimate: Estimate| estimate.scaled(scale.volume);
        let of_all = |i| world(self.all.controlled(i, (3, known), scale.area));
        let of_layer = |(layer, &top): (&StratumMoments<2>, &f64)| LayerVolumes {
            top: scale.base + top * scale.length,
            union: world(layer.estimate(0, scale.area)),
            overlap: world(layer.estimate(1, scale.area)),
        };
        SourceVolumes {
            union: of_all(0),
            overlap: of_all(1),
            negative: Estimate::default(),
            lines,
            swept: None,
            layers: self.layers.iter().zip(tops).map(of_layer).collect(),
        }
    }
}

impl Line {
    /// The lengths on a line with these intervals.
    fn lengths(&mut self, intervals: &[Interval]) -> LineLengths {
        self.crossings.clear();
        let mut lengths = LineLengths::default();
        let mut before = None;
        for of_pass in intervals.chunk_by(|a, b| a.pass == b.pass) {
            let (segments, joint) = of_pass.split_at(of_pass.partition_point(|interval| !interval.is_joint));
            lengths.control += segments.iter().map(|interval| interval.prism).sum::<f64>();
            std::mem::swap(&mut self.before, &mut self.pass);
            unite(segments, &mut self.pass);
            let pass = of_pass[0].pass;
            if before.is_some_and(|before: u32| before + 1 == pass) {
                self.push_joint(joint);
            }
            before = Some(pass);
            let ends = self.pass.iter().flat_map(|&(from, to)| [(from, 1), (to, -1)]);
            self.crossings.extend(ends.map(|(at, jump)| LineCrossing { at, jump }));
        }
        self.crossings.sort_unstable_by(|a, b| a.at.total_cmp(&b.at).then(a.jump.cmp(&b.jump)));
        walk(&self.crossings, |w, from, to| lengths.add(w, from, to));
        lengths
    }

    /// Takes off what the pass has in common with the one before at their joint.
    fn push_joint(&mut self, joint: &[Interval]) {
        for joint in joint {
            for &(from, to) in &self.pass {
                for &(first, last) in &self.before {
                    let (from, to) = (from.max(first).max(joint.from), to.min(last).min(joint.to));
                    if from < to {
                        self.crossings
                            .extend([(from, -1), (to, 1)].map(|(at, jump)| LineCrossing { at, jump }));
                    }
                }
            }
        }
    }
}

/// Unites overlapping ones of sorted intervals.
fn unite(intervals: &[Interval], united: &mut Vec<(f64, f64)>) {
    united.clear();
    for &Interval { from, to, .. } in intervals {
        match united.last_mut() {
            Some((_, high)) if from <= *high => *high = high.max(to),
            _ => united.push((from, to)),
        }
    }
}
