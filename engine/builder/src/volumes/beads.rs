//! Volumes of beads as solids.

use super::estimate::Moments;
use super::strata::{LINES, Shape, Strata};
use super::tally::{Crossing, Lengths, walk};
use crate::error::Result;
use crate::lattice::{RootCube, Units};
use crate::progress::Progress;
use crate::solid::{Outline, Segment, Solids};
use crate::store::{Estimate, LayerVolumes, SourceVolumes, SweptVolumes};
use crate::toolpath::{Passes, Toolpath};
use rayon::prelude::*;
use std::ops::Range;

/// Most lines.
const LINES_MAX: usize = 1 << 24;
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

/// Where a line along z meets a segment.
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
    let scene = Scene { solids: &solids, segments: &segments };
    let known = scene.known();
    // Vertices are snapped to even units.
    let low = root.to_units(bounds.0).map(|c| c.floor() as i32 - 1);
    let high = root.to_units(bounds.1).map(|c| c.ceil() as i32 + 1);
    let wanted = (segments.len() as f64 * INTERVALS_A_SEGMENT).clamp(INTERVALS.0, INTERVALS.1);
    let mut lines = LINES_MAX;
    let mut strata = Strata::cubes(low, high, lines);
    while lines > 4 * LINES && known.intervals(&strata) > wanted {
        lines = lines / 10 * 9;
        strata = Strata::cubes(low, high, lines);
    }
    let tops: Vec<f64> = tops(paths).iter().map(|top| (top - root.origin[2]) / unit).collect();
    let mut sums = Sums::new(tops.len());
    let bytes = known.intervals(&strata) * 2.0 * size_of::<Interval>() as f64;
    for numbers in strata.parts(bytes, memory, STRATA_AT_ONCE) {
        sums.add_strata(&scene.intervals(&strata, numbers, progress)?, &tops);
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

/// What is known of all segments, in cubic units.
#[derive(Clone, Copy, Default)]
struct Known {
    swept: f64,
    ends: f64,
    /// About the area of their shadows along z, in square units.
    shadow: f64,
    /// The boxes above these, in cubic units.
    boxes: f64,
}

impl Known {
    /// About how many intervals lie on the lines of `strata`: a line meets what its own height and that of a segment reach.
    fn intervals(&self, strata: &Strata) -> f64 {
        let [x, y, z] = strata.cell();
        LINES as f64 * (self.boxes + z * self.shadow) / (x * y * z)
    }
}

#[derive(Clone, Copy)]
struct Scene<'a> {
    solids: &'a Solids,
    segments: &'a [Segment],
}

impl Scene<'_> {
    /// Sums over all segments, in the order of the toolpaths.
    fn known(self) -> Known {
        let mut known = Known::default();
        for segment in self.segments {
            let profile = self.solids.profile(segment);
            if !profile.is_solid() {
                continue;
            }
            let length = segment.length();
            known.swept += profile.area() * length;
            known.ends += profile.end_volume();
            let width = 2.0 * profile.half_width;
            let shadow = width * (length + width);
            known.shadow += shadow;
            known.boxes += 2.0 * profile.half_height * shadow;
        }
        known
    }

    /// All intervals on some lines, sorted by line, pass and height.
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
                let (min, max) = self.solids.bounds(segment);
                let body = self.solids.body(segment);
                let base = f64::from(segment.a[2]);
                let corners = [segment.a, segment.b].map(|v| [f64::from(v[0]), f64::from(v[1])]);
                let shape = Shape { bounds: (min, max), corners: &corners, reach: body.reach() };
                strata.near(&shape, &numbers, |line, at| {
                    let from_a: Units = [at[0] - segment.a[0], at[1] - segment.a[1], 0];
                    let from_a = from_a.map(f64::from);
                    let (low, high) = strata.ends(line);
                    let clip = |(from, to): (f64, f64)| ((base + from).max(low), (base + to).min(high));
                    if let Some(interval) = body.line(2, from_a) {
                        let (from, to) = clip(interval);
                        if from < to {
                            let (first, last) = clip(body.between_ends(2, from_a, interval));
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
    all: Moments<4>,
    layers: Vec<Moments<2>>,
}

/// Working memory for one line.
#[derive(Clone, Default)]
struct Line {
    crossings: Vec<Crossing>,
    /// Where the pass at hand lies, and the one before it.
    pass: Vec<(f64, f64)>,
    before: Vec<(f64, f64)>,
    /// Union and overlap by layer.
    layers: Vec<[f64; 2]>,
    /// Layers that are not zero lie in this range.
    met: Range<usize>,
}

impl Sums {
    fn new(layers: usize) -> Sums {
        Sums { all: Moments::default(), layers: vec![Moments::default(); layers] }
    }

    fn merge(&mut self, other: &Sums) {
        self.all.merge(&other.all);
        self.layers.iter_mut().zip(&other.layers).for_each(|(layer, other)| layer.merge(other));
    }

    /// Adds strata that have these intervals; the others have nothing to add.
    fn add_strata(&mut self, intervals: &[Interval], tops: &[f64]) {
        let stratum = |interval: &Interval| interval.line as usize / LINES;
        let of_block = |block: &[Interval]| {
            let mut sums = Sums::new(tops.len());
            let mut lines = [Line::default(), Line::default()];
            lines.iter_mut().for_each(|line| line.layers.resize(tops.len(), [0.0; 2]));
            for intervals in block.chunk_by(|a, b| stratum(a) == stratum(b)) {
                let second =
                    intervals.partition_point(|interval| (interval.line as usize).is_multiple_of(LINES));
                let (a, b) = intervals.split_at(second);
                let mut of_lines = [a, b].into_iter();
                let values = lines
                    .each_mut()
                    .map(|line| line.lengths(of_lines.next().unwrap_or_default(), tops).values());
                sums.all.add(values);
                sums.add_layers(&mut lines);
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

    /// Adds the layers of a stratum's lines, and empties them.
    fn add_layers(&mut self, lines: &mut [Line; LINES]) {
        let [a, b] = lines;
        let met = match (a.met.len(), b.met.len()) {
            (0, _) => b.met.clone(),
            (_, 0) => a.met.clone(),
            _ => a.met.start.min(b.met.start)..a.met.end.max(b.met.end),
        };
        for layer in met {
            let values = [&mut a.layers[layer], &mut b.layers[layer]].map(std::mem::take);
            self.layers[layer].add(values);
        }
        a.met = 0..0;
        b.met = 0..0;
    }

    fn volumes(&self, scale: &Scale, known: f64, lines: u64, tops: &[f64]) -> SourceVolumes {
        let world = |estimate: Estimate| estimate.scaled(scale.volume);
        let of_all = |i| world(self.all.controlled(i, (3, known), scale.area));
        let of_layer = |(layer, &top): (&Moments<2>, &f64)| LayerVolumes {
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
    /// The lengths on a line with these intervals; those by layer are kept.
    fn lengths(&mut self, intervals: &[Interval], tops: &[f64]) -> Lengths {
        self.crossings.clear();
        let mut lengths = Lengths::default();
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
            self.crossings.extend(ends.map(|(at, jump)| Crossing { at, jump }));
        }
        let Line { crossings, layers, met, .. } = self;
        crossings.sort_unstable_by(|a, b| a.at.total_cmp(&b.at).then(a.jump.cmp(&b.jump)));
        let mut layer = 0;
        walk(crossings, |w, from, to| {
            lengths.add(w, from, to);
            if tops.is_empty() {
                return;
            }
            layer += tops[layer..].partition_point(|&top| top <= from).min(tops.len() - 1 - layer);
            let mut from = from;
            let mut at = layer;
            while from < to {
                // What rounding leaves above the last top is the last layer's.
                let end = if at + 1 == tops.len() { to } else { tops[at].min(to) };
                layers[at][0] += end - from;
                layers[at][1] += f64::from(w - 1) * (end - from);
                // Lines go upwards.
                *met = if met.start == met.end { at..at + 1 } else { met.start..at + 1 };
                from = end;
                at = (at + 1).min(tops.len() - 1);
            }
        });
        lengths
    }

    /// Takes off what the pass has in common with the one before at their joint.
    fn push_joint(&mut self, joint: &[Interval]) {
        for joint in joint {
            for &(from, to) in &self.pass {
                for &(first, last) in &self.before {
                    let (from, to) = (from.max(first).max(joint.from), to.min(last).min(joint.to));
                    if from < to {
                        self.crossings.extend([(from, -1), (to, 1)].map(|(at, jump)| Crossing { at, jump }));
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
