//! Toolpaths as segments on the lattice.

use super::body::{Body, frame};
use super::profile::{Outline, SolidProfile};
use super::segment::Segment;
use crate::brick::Count;
use crate::error::{Error, Result};
use crate::lattice::{ROOT_BITS, RootCube, Units};
use crate::toolpath::{Passes, Section, Toolpath};
use std::collections::HashMap;

/// What segments share: their cross-sections.
#[derive(Clone, Debug, Default)]
pub struct Solids {
    profiles: Vec<SolidProfile>,
    /// Where passes follow another of their bead: their first round end, as a segment without length, by pass.
    joints: Vec<Segment>,
}

impl Solids {
    /// The segments of all beads of several toolpaths on the lattice of `root`, in order, with the passes or beads to be
    /// counted.
    ///
    /// # Errors
    /// [`Error::Setting`] if there are more passes than 32 bits count.
    #[inline]
    pub fn new(
        paths: &[&Toolpath],
        root: RootCube,
        outline: Outline,
        count: Count,
    ) -> Result<(Solids, Vec<Segment>)> {
        let passes = passes_of(paths, count);
        let paths: Vec<_> = paths.iter().copied().zip(&passes).collect();
        Solids::of_passes(&paths, root, outline)
    }

    /// As [`Solids::new`], of toolpaths of which the passes are known.
    ///
    /// # Errors
    /// [`Error::Setting`] if there are more passes than 32 bits count.
    pub fn of_passes(
        paths: &[(&Toolpath, &Passes)],
        root: RootCube,
        outline: Outline,
    ) -> Result<(Solids, Vec<Segment>)> {
        let mut table = Table::new(root, outline);
        let mut segments = Vec::new();
        let mut joints = Vec::new();
        let mut pass = 0u32;
        for (path, passes) in paths {
            for bead in 0..path.len() {
                for numbers in passes.of_bead(bead, path.points(bead).len() - 1) {
                    let (first, start) = (segments.len(), numbers.start);
                    segments.extend(numbers.map(|number| table.segment(path, bead, number, pass)));
                    let begin: Option<&Segment> = segments.get(first).filter(|_| start > 0);
                    joints.extend(begin.map(|begin| Segment { b: begin.a, ..*begin }));
                    pass = pass.checked_add(1).ok_or_else(too_many)?;
                }
            }
        }
        Ok((Solids { profiles: table.profiles, joints }, segments))
    }

    /// With these cross-sections.
    #[inline]
    pub fn of_profiles(profiles: Vec<SolidProfile>) -> Solids {
        Solids { profiles, joints: Vec::new() }
    }

    /// The solid of a segment.
    #[inline]
    pub fn body(&self, segment: &Segment) -> Body {
        Body::new(segment, self.profile(segment))
    }

    /// The cross-section of a segment.
    #[inline]
    pub fn profile(&self, segment: &Segment) -> &SolidProfile {
        &self.profiles[segment.profile as usize]
    }

    /// All cross-sections.
    #[inline]
    pub fn profiles(&self) -> &[SolidProfile] {
        &self.profiles
    }

    /// The round end with which a pass begins that follows another of its bead: what of it the pass before covers as well
    /// is the joint of the two, and counts once.
    #[inline]
    pub fn joint(&self, pass: u32) -> Option<&Segment> {
        let at = self.joints.binary_search_by_key(&pass, |joint| joint.pass).ok()?;
        self.joints.get(at)
    }

    /// All of them, by pass.
    #[inline]
    pub fn joints(&self) -> &[Segment] {
        &self.joints
    }

    /// A box around the segment's solid, with a margin of more than a unit.
    #[inline]
    pub fn bounds(&self, segment: &Segment) -> (Units, Units) {
        let SolidProfile { axis, half_width, half_height, .. } = *self.profile(segment);
        let (a, b) = (segment.a, segment.b);
        if axis[0] == 0.0 && axis[1] == 0.0 && a[2] == b[2] {
            let reach = [half_width, half_width, half_height].map(|r| r as i32 + 2);
            return (
                [0, 1, 2].map(|i| a[i].min(b[i]) - reach[i]),
                [0, 1, 2].map(|i| a[i].max(b[i]) + reach[i]),
            );
        }
        let extent = [0, 1, 2].map(|i| self.body(segment).extent(i));
        ([0, 1, 2].map(|i| a[i] + extent[i].0 as i32 - 2), [0, 1, 2].map(|i| a[i] + extent[i].1 as i32 + 2))
    }

    /// Whether the segment may touch the closed cube `low..low + size`.
    #[inline]
    pub fn touches_cube(&self, segment: &Segment, low: Units, size: i32) -> bool {
        let from_a = [0, 1, 2].map(|i| f64::from(low[i] - segment.a[i]));
        !self.body(segment).misses_cube(from_a, f64::from(size))
    }

    /// Whether the segment's solid covers a lattice position, by the rule of the samples.
    #[inline]
    pub fn covers(&self, segment: &Segment, p: Units) -> bool {
        let at = [0, 1, 2].map(|i| f64::from(p[i] - segment.a[i]));
        self.body(segment).line(0, at).is_some_and(|(from, to)| from <= at[0] && at[0] < to)
    }

    /// Whether the cube lies inside the segment's solid as a whole, by a margin.
    #[inline]
    pub fn covers_cube(&self, segment: &Segment, low: Units, size: i32) -> bool {
        let from_a = [0, 1, 2].map(|i| f64::from(low[i] - segment.a[i]));
        self.body(segment).covers_cube(from_a, f64::from(size))
    }
}

/// What is counted of the beads of toolpaths.
#[inline]
pub fn passes_of(paths: &[&Toolpath], count: Count) -> Vec<Passes> {
    let of_path = |path: &&Toolpath| match count {
        Count::Passes => Passes::new(path),
        Count::Beads => Passes::whole(path),
    };
    paths.iter().map(of_path).collect()
}

fn too_many() -> Error {
    Error::setting(
        "there are more passes of beads than the program counts",
        "build parts of the toolpath separately",
    )
}

/// Gathers profiles.
struct Table {
    root: RootCube,
    outline: Outline,
    /// Units per world length.
    scale: f64,
    profiles: Vec<SolidProfile>,
    numbers: HashMap<[u64; 5], u32>,
}

impl Table {
    fn new(root: RootCube, outline: Outline) -> Table {
        let scale = f64::from(1u32 << ROOT_BITS) / root.edge;
        Table { root, outline, scale, profiles: Vec::new(), numbers: HashMap::new() }
    }

    /// Segment `number` of a bead. Upper and lower face are snapped each by itself, as the vertices of swept
    /// triangles are, so that the faces of layers that touch meet on the lattice as well.
    fn segment(&mut self, path: &Toolpath, bead: usize, number: usize, pass: u32) -> Segment {
        let section = path.section(bead, number);
        let snap = self.root.snapper();
        let ends = [number, number + 1].map(|point| {
            let axis = path.axis(bead, point);
            let tip = path.points(bead)[point];
            let foot = [0, 1, 2].map(|i| tip[i] - axis[i] * section.height);
            (snap(tip), snap(foot))
        });
        // Both are even, so the middle is on the lattice.
        let [a, b] = ends.map(|(top, foot)| [0, 1, 2].map(|i| (top[i] + foot[i]) / 2));
        let axis = middle_axis(path.axis(bead, number), path.axis(bead, number + 1));
        let half_height = match axis {
            [0.0, 0.0, _] => f64::from((ends[0].0[2] - ends[0].1[2]) / 2),
            _ => 0.5 * section.height * self.scale,
        };
        let half_width = 0.5 * section.width * self.scale;
        Segment { a, b, profile: self.profile(half_width, half_height, axis), pass }
    }

    fn profile(&mut self, half_width: f64, half_height: f64, axis: [f64; 3]) -> u32 {
        let [x, y, z] = axis.map(f64::to_bits);
        let bits = [half_width.to_bits(), half_height.to_bits(), x, y, z];
        let profiles = &mut self.profiles;
        *self.numbers.entry(bits).or_insert_with(|| {
            profiles.push(SolidProfile::new(self.outline, half_width, half_height, axis));
            profiles.len() as u32 - 1
        })
    }
}

/// The direction between two axes.
fn middle_axis(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    if a == b {
        return a;
    }
    let sum = [0, 1, 2].map(|i| a[i] + b[i]);
    let size = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
    if size > 1e-6 { sum.map(|c| c / size) } else { a }
}

/// The box around all solids of a toolpath, in world coordinates.
///
/// # Errors
/// The number of the first bead with a position or a section that is not finite.
pub fn bounds_of_beads(
    path: &Toolpath,
    outline: Outline,
) -> std::result::Result<([f64; 3], [f64; 3]), usize> {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for bead in 0..path.len() {
        let points = path.points(bead);
        for number in 1..points.len() {
            let Section { width, height } = path.section(bead, number - 1);
            let axes = [number - 1, number].map(|point| path.axis(bead, point));
            let axis = middle_axis(axes[0], axes[1]);
            let direction = [0, 1, 2].map(|i| points[number][i] - points[number - 1][i]);
            let is_flat = axis[0] == 0.0 && axis[1] == 0.0 && direction[2] == 0.0;
            let ([_, _, up], _) = frame(direction, axis, is_flat);
            let profile = SolidProfile::new(outline, 0.5 * width, 0.5 * height, axis);
            for (point, axis) in [number - 1, number].into_iter().zip(axes) {
                for i in 0..3 {
                    let centre = points[point][i] - 0.5 * height * axis[i];
                    let reach = profile.reach(up[i]);
                    if !(centre + reach).is_finite() {
                        return Err(bead);
                    }
                    low[i] = low[i].min(centre - reach);
                    high[i] = high[i].max(centre + reach);
                }
            }
        }
    }
    Ok((low, high))
}
