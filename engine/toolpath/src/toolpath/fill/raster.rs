//! The raster of a layer: parallel lines at one distance.

use crate::toolpath::Section;

/// Sine of the angle within which lines are parallel: 1°.
const PARALLEL: f64 = 0.0175;
/// Distances of neighbours from which they are a raster.
const DISTANCES_LEAST: usize = 3;
/// Part of the median between a quarter and three quarters of all distances.
const SPREAD: f64 = 0.15;
/// Part of all straight lines that a raster takes.
const SHARE: f64 = 0.5;
/// Part of a line's width within which another one lies upon it.
const UPON: f64 = 0.02;
/// Lines beyond a line that may be its neighbour.
const AHEAD: usize = 64;

/// A straight piece of a bead in its layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct RasterLine {
    a: [f64; 2],
    b: [f64; 2],
    pub length: f64,
    section: Section,
}

impl RasterLine {
    pub fn new(a: [f64; 3], b: [f64; 3], section: Section) -> RasterLine {
        let d = [0, 1, 2].map(|i| b[i] - a[i]);
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        RasterLine { a: [a[0], a[1]], b: [b[0], b[1]], length, section }
    }

    /// A unit vector along it, with x ≥ 0.
    fn direction(&self) -> [f64; 2] {
        let sign = if self.b[0] < self.a[0] { -1.0 } else { 1.0 };
        [0, 1].map(|i| sign * (self.b[i] - self.a[i]) / self.length)
    }
}

/// Parallel lines at one distance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Raster {
    /// Medians of the lines, mm.
    pub width: f64,
    pub height: f64,
    /// Median distance of neighbours, mm.
    pub pitch: f64,
    /// Length of all its lines, mm.
    pub length: f64,
}

impl Raster {
    /// Area of a line's section by that of its room.
    pub fn fill(&self) -> f64 {
        let section = Section { width: self.width, height: self.height };
        section.stadium_area() / (self.pitch * self.height)
    }
}

/// The raster that most of these lines make, if they do.
pub(super) fn of(lines: Vec<RasterLine>) -> Option<Raster> {
    let all: f64 = lines.iter().map(|line| line.length).sum();
    let along = main_direction(&lines)?;
    let cross = |d: [f64; 2]| along[0] * d[1] - along[1] * d[0];
    let dot = |p: [f64; 2]| along[0] * p[0] + along[1] * p[1];
    let mut parallel: Vec<Parallel> = lines
        .iter()
        .filter(|line| cross(line.direction()).abs() < PARALLEL)
        .map(|line| {
            let (p, q) = (dot(line.a), dot(line.b));
            let across = 0.5 * (cross(line.a) + cross(line.b));
            Parallel { across, from: p.min(q), to: p.max(q), section: line.section }
        })
        .collect();
    parallel.sort_by(|a, b| a.across.total_cmp(&b.across).then(a.from.total_cmp(&b.from)));
    let length: f64 = parallel.iter().map(|line| line.to - line.from).sum();
    if parallel.is_empty() || length < SHARE * all {
        return None;
    }
    let mut distances: Vec<f64> =
        (0..parallel.len()).filter_map(|n| parallel[n].distance(&parallel[n + 1..])).collect();
    if distances.len() < DISTANCES_LEAST {
        return None;
    }
    distances.sort_by(f64::total_cmp);
    let at = |part: usize| distances[(distances.len() - 1) * part / 4];
    if at(3) - at(1) > SPREAD * at(2) {
        return None;
    }
    let middle =
        |size: fn(&Section) -> f64| median(parallel.iter().map(|line| size(&line.section)).collect());
    Some(Raster { width: middle(|s| s.width), height: middle(|s| s.height), pitch: at(2), length })
}

/// A line of the main direction.
struct Parallel {
    across: f64,
    from: f64,
    to: f64,
    section: Section,
}

impl Parallel {
    /// To the next line beside it.
    fn distance(&self, beyond: &[Parallel]) -> Option<f64> {
        let is_beside = |other: &&Parallel| {
            let shared = self.to.min(other.to) - self.from.max(other.from);
            let shorter = (self.to - self.from).min(other.to - other.from);
            other.across - self.across > UPON * self.section.width && shared > 0.5 * shorter
        };
        beyond.iter().take(AHEAD).find(is_beside).map(|other| other.across - self.across)
    }
}

/// That of the longest line among those of the angle that has the most length.
fn main_direction(lines: &[RasterLine]) -> Option<[f64; 2]> {
    const BINS: usize = 90;
    // The slope of x ≥ 0 grows with the angle, and needs no trigonometry.
    let bin = |line: &RasterLine| {
        let [x, y] = line.direction();
        let place = match y.abs() < x {
            true => 1.0 + y / x,
            false => 3.0 - x / y,
        };
        ((place / 4.0 * BINS as f64) as usize).min(BINS - 1)
    };
    let mut lengths = [0.0; BINS];
    lines.iter().for_each(|line| lengths[bin(line)] += line.length);
    let most = (0..BINS).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b]))?;
    let of_bin = lines.iter().filter(|line| bin(line) == most);
    of_bin.max_by(|a, b| a.length.total_cmp(&b.length)).map(RasterLine::direction)
}

/// The middle value; of an even number of values the lower one of two.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
}
