//! Toolpaths that come back onto themselves, with the volumes of their passes and of their union in closed form.
//!
//! Beads are stadiums of w × h with round ends. At the height z above its middle a bead is a strip of half the width
//! r(z) = (w − h)/2 + √(h²/4 − z²), and a pass of the length L with corners that turn by θ covers the area
//!
//! 2 r L + π r² + Σ (θ/2 − tan(θ/2)) r²,
//!
//! both ends and the outsides of its corners being round. A union is such an area, too, with what neighbours share taken
//! off. Where a pass follows another both have a round end, which counts once. Volumes are the integrals of areas over z, by the midpoint rule in an angle, which has no error that shows.

use crate::trig::sin_cos;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// Width of the beads, mm.
pub const WIDTH: f64 = 0.45;
/// Their height, mm.
pub const HEIGHT: f64 = 0.2;
/// Points of a turn of a circle.
const STEPS: u32 = 360;

/// A toolpath of one bead.
#[derive(Clone, Debug)]
pub struct PassFile {
    /// Its file's name.
    pub name: &'static str,
    /// The G-code.
    pub gcode: String,
    /// How many passes the bead has.
    pub passes: u64,
    /// Volume of the union, mm³.
    pub union: f64,
    /// The overlap, mm³: volumes of all passes together, less that of the union and the round ends that two share.
    pub overlap: f64,
}

/// All of them.
pub fn pass_files() -> Vec<PassFile> {
    vec![
        retraced(),
        raster("raster.gcode", 12, 30.0, 0.4, 0.0),
        raster("zigzag45.gcode", 12, 30.0, 0.4, 45.0),
        raster("u_turn.gcode", 2, 30.0, 0.25, 0.0),
        concentric(),
        vase(),
        circle(),
        corner("corner90.gcode", 90.0),
        corner("corner30.gcode", 30.0),
    ]
}

/// ∫ `area`(r(z)) dz over a bead's height.
fn volume(area: impl Fn(f64) -> f64) -> f64 {
    const PARTS: u32 = 20_000;
    let part = |n: u32| {
        let (_, cos) = sin_cos(PI * (f64::from(n) + 0.5) / f64::from(PARTS) - 0.5 * PI);
        area(0.5 * (WIDTH - HEIGHT) + 0.5 * HEIGHT * cos) * cos
    };
    (0..PARTS).map(part).sum::<f64>() * 0.5 * HEIGHT * PI / f64::from(PARTS)
}

/// Volume of a whole round end: a section turned about its middle.
fn round_end() -> f64 {
    volume(|r| PI * r * r)
}

/// Area of a pass of this length with so many right-angled corners.
fn pass_area(r: f64, length: f64, corners: f64) -> f64 {
    2.0 * r * length + PI * r * r + corners * (0.25 * PI - 1.0) * r * r
}

/// Three times the same line.
fn retraced() -> PassFile {
    let line = volume(|r| pass_area(r, 30.0, 0.0));
    let points = [[0.0, 0.0], [30.0, 0.0], [0.0, 0.0], [30.0, 0.0]];
    let gcode = gcode("three times the same line", points.map(|[x, y]| [x, y, HEIGHT]));
    PassFile { name: "retraced.gcode", gcode, passes: 3, union: line, overlap: 2.0 * (line - round_end()) }
}

/// Lines of a raster in the direction of an angle, connected at their ends by turns.
fn raster(name: &'static str, lines: u32, length: f64, pitch: f64, degrees: f64) -> PassFile {
    let (sin, cos) = sin_cos(degrees * PI / 180.0);
    let ends = |line: u32| if line.is_multiple_of(2) { [0.0, length] } else { [length, 0.0] };
    let point = |x: f64, line: u32| {
        let y = pitch * f64::from(line);
        [cos * x - sin * y, sin * x + cos * y, HEIGHT]
    };
    let points = (0..lines).flat_map(|line| ends(line).map(|x| point(x, line)));
    let what = format!("{lines} lines of {length} mm, {pitch} mm apart, at {degrees} degrees");
    let turns = f64::from(lines - 1);
    // Each pass ends with the step to the next line.
    let passes =
        turns * volume(|r| pass_area(r, length + pitch, 1.0)) + volume(|r| pass_area(r, length, 0.0));
    let union = volume(|r| {
        let half = 0.5 * pitch;
        if r <= half {
            // Lines that do not meet at this height.
            return pass_area(r, f64::from(lines) * length + turns * pitch, 2.0 * turns);
        }
        // At one end of each pair of lines there is the step; at the other, two round ends meet.
        let root = (r * r - half * half).sqrt();
        let ends = half * root + r * r * asin(half / r);
        length * (turns * pitch + 2.0 * r) + turns * (r * pitch + ends) + PI * r * r
    });
    let overlap = passes - union - turns * round_end();
    PassFile { name, gcode: gcode(&what, points), passes: u64::from(lines), union, overlap }
}

/// Circles around each other, from the outside inward, with a straight step from each to the next.
fn concentric() -> PassFile {
    const CIRCLES: u32 = 8;
    const PITCH: f64 = 0.4;
    let radius = |circle: u32| 8.0 - PITCH * f64::from(circle);
    let points =
        (0..CIRCLES).flat_map(|circle| (0..=STEPS).map(move |n| on_circle(radius(circle), n, HEIGHT)));
    // At the heights where neighbours meet: the ring that both cover, and the part of the step beside it.
    let overlap = volume(|r| {
        let step = 2.0 * r * r.min(PITCH - r) + 0.5 * PI * r * r;
        let ring =
            |circle: u32| around(0.5 * (radius(circle) + radius(circle + 1))) * positive(2.0 * r - PITCH);
        (0..CIRCLES - 1).map(|circle| ring(circle) + step).sum()
    }) - f64::from(CIRCLES - 1) * round_end();
    let gaps = f64::from(CIRCLES - 1);
    let union = volume(|r| {
        let rings: f64 = (0..CIRCLES).map(|circle| around(radius(circle)) * 2.0 * r).sum();
        let shared: f64 = (0..CIRCLES - 1)
            .map(|circle| around(0.5 * (radius(circle) + radius(circle + 1))) * positive(2.0 * r - PITCH))
            .sum();
        rings - shared + gaps * 2.0 * r * positive(PITCH - 2.0 * r)
    });
    let gcode = gcode("circles around each other, 0.4 mm apart, with steps between them", points);
    PassFile { name: "concentric.gcode", gcode, passes: u64::from(CIRCLES), union, overlap }
}

/// A wall of one bead that climbs by three quarters of its height a turn, so that turns overlap by a quarter.
fn vase() -> PassFile {
    const TURNS: u32 = 10;
    const RADIUS: f64 = 8.0;
    let climb = 0.75 * HEIGHT;
    let z = |n: u32| HEIGHT + climb * f64::from(n) / f64::from(STEPS);
    let points = (0..=TURNS * STEPS).map(|n| on_circle(RADIUS, n, z(n)));
    let turn = around(RADIUS);
    let turns = f64::from(TURNS);
    // What a section has in common with itself, lifted by the climb.
    const PARTS: u32 = 20_000;
    let low = climb - 0.5 * HEIGHT;
    let step = (0.5 * HEIGHT - low) / f64::from(PARTS);
    let width_at = |z: f64| WIDTH - HEIGHT + 2.0 * positive(0.25 * HEIGHT * HEIGHT - z * z).sqrt();
    let at = |n: u32| low + step * (f64::from(n) + 0.5);
    let width = |n: u32| width_at(at(n)).min(width_at(at(n) - climb));
    let shared: f64 = (0..PARTS).map(|n| width(n) * step).sum();
    // A pass ends above its own beginning: there the round ends of both are within the pass.
    let closing: f64 = (0..PARTS).map(|n| 0.25 * PI * width(n) * width(n) * step).sum();
    let (ends, line) = (volume(|r| PI * r * r), volume(|r| 2.0 * r * turn));
    // What both have of their round ends where a pass ends and the next begins counts once.
    let overlap = (turns - 1.0) * (shared * turn - closing);
    let union = turns * line + ends - (turns - 1.0) * shared * turn - closing;
    let gcode = gcode("a vase of 10 turns, 0.15 mm each", points);
    PassFile { name: "vase.gcode", gcode, passes: u64::from(TURNS), union, overlap }
}

/// One turn that closes.
fn circle() -> PassFile {
    let points = (0..=STEPS).map(|n| on_circle(8.0, n, HEIGHT));
    let union = volume(|r| around(8.0) * 2.0 * r);
    let gcode = gcode("a circle that closes", points);
    PassFile { name: "circle.gcode", gcode, passes: 1, union, overlap: 0.0 }
}

/// Two sides with an angle between them.
fn corner(name: &'static str, degrees: f64) -> PassFile {
    let (sin, cos) = sin_cos(degrees * PI / 180.0);
    let points = [[20.0, 0.0], [0.0, 0.0], [20.0 * cos, 20.0 * sin]].map(|[x, y]| [x, y, HEIGHT]);
    let half = 0.5 * (PI - degrees * PI / 180.0);
    let (sin, cos) = sin_cos(half);
    let union = volume(|r| pass_area(r, 40.0, 0.0) + (half - sin / cos) * r * r);
    let gcode = gcode(&format!("a corner of {degrees} degrees"), points);
    PassFile { name, gcode, passes: 1, union, overlap: 0.0 }
}

/// Length of a turn as it is drawn.
fn around(radius: f64) -> f64 {
    let (sin, _) = sin_cos(PI / f64::from(STEPS));
    2.0 * radius * sin * f64::from(STEPS)
}

fn on_circle(radius: f64, n: u32, z: f64) -> [f64; 3] {
    let (sin, cos) = sin_cos(TAU * f64::from(n % STEPS) / f64::from(STEPS));
    [radius * cos, radius * sin, z]
}

fn positive(value: f64) -> f64 {
    if value > 0.0 { value } else { 0.0 }
}

/// By bisection, so that every machine has the same.
fn asin(value: f64) -> f64 {
    let (mut low, mut high) = (0.0, 0.5 * PI);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if sin_cos(middle).0 < value { low = middle } else { high = middle }
    }
    low
}

/// One bead along these points, moved into the middle of a table. Coordinates have four decimals, E six.
fn gcode(what: &str, points: impl IntoIterator<Item = [f64; 3]>) -> String {
    let section = HEIGHT * (WIDTH - HEIGHT) + 0.25 * PI * HEIGHT * HEIGHT;
    let filament = 0.25 * PI * 1.75 * 1.75;
    let mut out = format!(
        "; {what} (CC0-1.0)\n; filament_diameter = 1.75\nG21\nG90\nM83\n;LAYER_CHANGE\n;TYPE:Solid infill\n;WIDTH:{WIDTH}\n;HEIGHT:{HEIGHT}\n"
    );
    let mut before: Option<[f64; 3]> = None;
    for point in points {
        let [x, y, z] = point;
        let (x, y) = (x + 50.0, y + 50.0);
        let moved = match before {
            None => writeln!(out, "G0 X{x:.4} Y{y:.4} Z{z:.4} F6000"),
            Some(from) => {
                let length = (0..3).map(|a| (point[a] - from[a]) * (point[a] - from[a])).sum::<f64>().sqrt();
                let height = if z == from[2] { String::new() } else { format!(" Z{z:.4}") };
                writeln!(out, "G1 X{x:.4} Y{y:.4}{height} E{:.6}", length * section / filament)
            }
        };
        // Writing to a string does not fail.
        moved.unwrap_or_default();
        before = Some(point);
    }
    out
}
