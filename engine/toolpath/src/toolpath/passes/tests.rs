use super::Passes;
use crate::toolpath::{Attributes, BeadView, Section, Toolpath};
use std::f64::consts::TAU;

const SECTION: Section = Section { width: 0.5, height: 0.2 };

fn path_of(points: &[[f64; 3]]) -> Toolpath {
    let attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 1), fed: None };
    let sections = vec![SECTION; points.len() - 1];
    let mut path = Toolpath::default();
    path.push(BeadView { points, axes: &[], sections: &sections, lines: &[], attributes });
    path
}

fn starts(points: &[[f64; 3]]) -> Vec<u32> {
    let path = path_of(points);
    let passes = Passes::new(&path);
    let ranges: Vec<_> = passes.of_bead(0, points.len() - 1).collect();
    assert_eq!(ranges.len(), passes.starts(0).len() + 1);
    assert!(ranges.iter().all(|range| !range.is_empty()));
    assert_eq!(ranges[ranges.len() - 1].end, points.len() - 1);
    passes.starts(0).to_vec()
}

fn flat(points: &[[f64; 2]]) -> Vec<[f64; 3]> {
    points.iter().map(|&[x, y]| [x, y, 0.2]).collect()
}

/// A path without long steps, as slicers write curves.
fn dense(points: &[[f64; 3]], step: f64) -> Vec<[f64; 3]> {
    let mut out = vec![points[0]];
    for pair in points.windows(2) {
        let d = [0, 1, 2].map(|a| pair[1][a] - pair[0][a]);
        let count = (super::length(d) / step).ceil();
        let part = |n: u32| f64::from(n) / count;
        out.extend((1..=count as u32).map(|n| [0, 1, 2].map(|a| pair[0][a] + d[a] * part(n))));
    }
    out
}

/// Turns about an axis: radius, height and angle as functions of the turn.
fn turns(count: f64, steps: u32, at: impl Fn(f64) -> (f64, f64)) -> Vec<[f64; 3]> {
    let point = |n: u32| {
        let turn = count * f64::from(n) / f64::from(steps);
        let (radius, z) = at(turn);
        [radius * libm::cos(TAU * turn), radius * libm::sin(TAU * turn), z]
    };
    (0..=steps).map(point).collect()
}

/// Lines of a raster, connected at their ends.
fn raster(lines: usize, length: f64, pitch: f64) -> Vec<[f64; 3]> {
    let ends = |line: usize| if line.is_multiple_of(2) { [0.0, length] } else { [length, 0.0] };
    let line = |line| ends(line).map(|x| [x, line as f64 * pitch]);
    flat(&(0..lines).flat_map(line).collect::<Vec<_>>())
}

fn turned(points: &[[f64; 3]], degrees: f64) -> Vec<[f64; 3]> {
    let (sin, cos) = (libm::sin(degrees.to_radians()), libm::cos(degrees.to_radians()));
    points.iter().map(|&[x, y, z]| [cos * x - sin * y, sin * x + cos * y, z]).collect()
}

/// Two sides of 10 mm with this angle between them.
fn corner(degrees: f64) -> Vec<[f64; 3]> {
    let angle = degrees.to_radians();
    flat(&[[10.0, 0.0], [0.0, 0.0], [10.0 * libm::cos(angle), 10.0 * libm::sin(angle)]])
}

#[test]
fn lines_that_are_retraced_are_passes() {
    let line = flat(&[[0.0, 0.0], [20.0, 0.0], [0.0, 0.0], [20.0, 0.0]]);
    assert_eq!(starts(&line), [1, 2]);
    // The turns are where the middle ways are.
    assert_eq!(starts(&dense(&line, 0.1)), [200, 400]);
}

#[test]
fn lines_of_a_raster_are_passes() {
    for degrees in [0.0, 45.0, 90.0, 17.0] {
        for pitch in [0.05, 0.25, 0.45, 0.49] {
            let lines = turned(&raster(5, 20.0, pitch), degrees);
            assert_eq!(starts(&lines), [2, 4, 6, 8], "{degrees}° {pitch}");
        }
        // Beads that touch, or do not even that.
        for pitch in [0.5, 0.6, 2.0] {
            assert_eq!(starts(&turned(&raster(5, 20.0, pitch), degrees)), [0u32; 0], "{degrees}° {pitch}");
        }
    }
}

/// Slanted lines with one step at each end, as where infill follows a slanted wall.
#[test]
fn connections_of_slanted_rasters_make_no_difference() {
    let lines: Vec<[f64; 2]> =
        (0..12).map(|n| [[0.0, 20.0, 20.0, 0.0][n % 4] + 0.4 * n as f64, 0.4 * (n / 2) as f64]).collect();
    assert_eq!(starts(&flat(&lines)), [2, 4, 6, 8, 10]);
}

#[test]
fn round_turns_between_lines_begin_passes_in_their_middle() {
    let arc = |n: u32| {
        let angle = TAU / 4.0 - f64::from(n) * TAU / 32.0;
        [20.0 + 0.2 * libm::cos(angle), 0.2 * libm::sin(angle)]
    };
    let mut points = vec![[0.0, 0.2]];
    points.extend((0..=16).map(arc));
    points.push([0.0, -0.2]);
    // The ends of the half turn are points 1 and 17.
    assert_eq!(starts(&flat(&points)), [9]);
    let steps = dense(&flat(&points), 0.1);
    let middle = steps.iter().position(|p| (p[0] - 20.2).abs() < 1e-9).unwrap();
    assert_eq!(starts(&steps), [middle as u32]);
}

#[test]
fn corners_and_bends_make_no_pass() {
    for degrees in [180.0, 150.0, 120.0, 90.0, 60.0, 45.0, 30.0] {
        assert_eq!(starts(&corner(degrees)), [0u32; 0], "{degrees}°");
        assert_eq!(starts(&dense(&corner(degrees), 0.07)), [0u32; 0], "{degrees}°");
    }
    for degrees in [28.0, 20.0, 5.0, 0.5] {
        assert_eq!(starts(&corner(degrees)), [1], "{degrees}°");
        assert_eq!(starts(&dense(&corner(degrees), 0.1)), [100], "{degrees}°");
    }
    // Waves of all curvatures.
    for amplitude in [0.1, 1.0, 5.0, 20.0] {
        let wave = |n: u32| [f64::from(n) * 0.02, amplitude * libm::sin(f64::from(n) * 0.02)];
        assert_eq!(starts(&flat(&(0..4000).map(wave).collect::<Vec<_>>())), [0u32; 0], "{amplitude}");
    }
}

#[test]
fn a_loop_that_closes_is_one_pass() {
    for (radius, steps) in [(0.3, 40), (1.0, 32), (10.0, 32), (10.0, 5000), (100.0, 360)] {
        assert_eq!(starts(&turns(1.0, steps, |_| (radius, 0.2))), [0u32; 0], "{radius}");
        assert_eq!(starts(&turns(0.99, steps, |_| (radius, 0.2))), [0u32; 0], "{radius}");
    }
    for corners in [3, 4, 6] {
        assert_eq!(starts(&turns(1.0, corners, |_| (10.0, 0.2))), [0u32; 0], "{corners}");
    }
}

#[test]
fn loops_that_go_on_begin_where_the_one_before_closes() {
    // Three times the same circle.
    assert_eq!(starts(&turns(3.0, 3 * 720, |_| (10.0, 0.2))), [720, 1440]);
    assert_eq!(starts(&turns(3.0, 12, |_| (10.0, 0.2))), [4, 8]);
    // A spiral whose turns are a pitch of 0.4 apart: within a step.
    let spiral = starts(&turns(6.0, 6 * 720, |turn| (8.0 + 0.4 * turn, 0.2)));
    assert_eq!(spiral.len(), 5);
    for (turn, start) in spiral.iter().enumerate() {
        assert!(start.abs_diff(720 * (turn as u32 + 1)) <= 12, "{spiral:?}");
    }
    // Too far apart to overlap.
    assert_eq!(starts(&turns(6.0, 6 * 720, |turn| (8.0 + 0.6 * turn, 0.2))), [0u32; 0]);
}

#[test]
fn concentric_squares_that_hang_together_are_passes() {
    let mut points = Vec::new();
    for n in 0..4 {
        let (low, high) = (0.45 * f64::from(n), 20.0 - 0.45 * f64::from(n));
        points.extend([[low, low], [high, low], [high, high], [low, high], [low, low]]);
    }
    // The step to the next square, or its first side.
    let found = starts(&flat(&points));
    assert_eq!(found.len(), 3);
    assert!(found.iter().zip([4, 9, 14]).all(|(found, step)| (step..=step + 1).contains(found)), "{found:?}");
}

#[test]
fn turns_of_a_vase_are_passes() {
    let found = starts(&turns(4.0, 4 * 360, |turn| (10.0, 0.2 + 0.2 * turn)));
    assert_eq!(found, [360, 720, 1080]);
    // Turns that lie apart.
    assert_eq!(starts(&turns(4.0, 4 * 360, |turn| (10.0, 0.2 + 0.25 * turn))), [0u32; 0]);
}

#[test]
fn a_path_that_crosses_itself_begins_a_pass_there() {
    let eight = flat(&[[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]]);
    assert_eq!(starts(&eight), [2]);
}

/// What is near along the path is no overlap: the path must first go somewhere.
#[test]
fn blots_are_one_pass() {
    assert_eq!(starts(&raster(2, 0.3, 0.1)), [0u32; 0]);
    assert_eq!(starts(&raster(2, 0.6, 0.1)), [2]);
}

#[test]
fn tools_that_tilt_see_layers_along_their_axis() {
    let lines = raster(3, 20.0, 0.4);
    let axis = [0.0, 0.6, 0.8];
    // The layer's plane, turned with the tool.
    let tilted: Vec<[f64; 3]> =
        lines.iter().map(|&[x, y, z]| [x, 0.8 * y + 0.6 * z, 0.8 * z - 0.6 * y]).collect();
    let attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 1), fed: None };
    let mut path = Toolpath::default();
    let axes = vec![axis; tilted.len()];
    let sections = vec![SECTION; tilted.len() - 1];
    path.push(BeadView { points: &tilted, axes: &axes, sections: &sections, lines: &[], attributes });
    assert_eq!(Passes::new(&path).starts(0), [2, 4]);
}

#[test]
fn threads_change_nothing() {
    let mut path = Toolpath::default();
    let attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 1), fed: None };
    for n in 0..500 {
        let points = turned(&dense(&raster(2 + n % 5, 3.0 + n as f64 * 0.01, 0.4), 0.3), n as f64);
        let sections = vec![SECTION; points.len() - 1];
        path.push(BeadView { points: &points, axes: &[], sections: &sections, lines: &[], attributes });
    }
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Passes::new(&path))
    };
    let one = with(1);
    assert_eq!(one, with(7));
    assert!((0..500).all(|n| one.starts(n).len() == 1 + n % 5), "as many as turns");
}
