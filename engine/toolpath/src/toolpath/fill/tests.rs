use super::{LayerFill, LayerFills, Purpose};
use crate::toolpath::{Attributes, BeadView, Section};

const NAMES: [&str; 5] = ["External perimeter", "Solid infill", "Internal infill", "Skirt/Brim", "unnamed"];
const HEIGHT: f64 = 0.2;

/// Corners and width.
type Path = (Vec<[f64; 2]>, f64);

/// A raster of 20 mm by 20 mm, connected at its ends.
fn raster(width: f64, pitch: f64, degrees: f64) -> Path {
    let (sin, cos) = (libm::sin(degrees.to_radians()), libm::cos(degrees.to_radians()));
    let count = (20.0 / pitch) as usize;
    let ends = |line: usize| if line.is_multiple_of(2) { [0.0, 20.0] } else { [20.0, 0.0] };
    let line = |line| ends(line).map(|x| (x, line as f64 * pitch));
    let points = (0..count).flat_map(line).map(|(x, y)| [cos * x - sin * y, sin * x + cos * y]);
    (points.collect(), width)
}

/// A square with its centre at the origin.
fn square(side: f64) -> Path {
    let h = 0.5 * side;
    (vec![[-h, -h], [h, -h], [h, h], [-h, h], [-h, -h]], 0.4)
}

/// Layers of beads, each with its feature.
fn fills(layers: &[Vec<(u16, Path)>]) -> Vec<LayerFill> {
    let mut fills = LayerFills::default();
    let mut line = 0;
    for (layer, beads) in layers.iter().enumerate() {
        for (feature, (points, width)) in beads {
            let z = HEIGHT * (layer + 1) as f64;
            let points: Vec<[f64; 3]> = points.iter().map(|&[x, y]| [x, y, z]).collect();
            let lines = (line + 1, line + points.len() as u64);
            line = lines.1;
            let attributes = Attributes { layer: layer as u32, tool: 0, feature: *feature, lines, fed: None };
            let sections = vec![Section { width: *width, height: HEIGHT }; points.len() - 1];
            fills.push(&BeadView { points: &points, axes: &[], sections: &sections, lines: &[], attributes });
        }
    }
    fills.finish(&NAMES.map(str::to_owned))
}

#[test]
fn lines_too_far_apart_are_told_with_their_layer() {
    for degrees in [0.0, 45.0, 90.0, 135.0, 17.0, 89.9, 90.1] {
        let good = || vec![(1, raster(0.4, 0.357, degrees))];
        let found = fills(&[good(), vec![(1, raster(0.4, 0.8, degrees))], good()]);
        assert_eq!(found.len(), 1, "{degrees}°: {found:?}");
        let LayerFill { layer, feature, lines, width, pitch, room, empty, .. } = &found[0];
        assert_eq!((*layer, feature.as_str(), *lines), (2, "Solid infill", (113, 162)));
        assert_eq!((*width, *room), (0.4, None));
        assert!((pitch - 0.8).abs() < 1e-9);
        // The section has 0.0714 mm², its room 0.16.
        assert!((empty - 0.5537).abs() < 1e-3, "{empty}");
    }
    assert_eq!(fills(&[vec![(1, raster(0.4, 0.45, 0.0))]]), []);
}

#[test]
fn lines_too_near_are_told() {
    let found = fills(&[vec![(1, raster(0.4, 0.2, 30.0))]]);
    assert!(found.len() == 1 && found[0].empty < -0.7, "{found:?}");
}

/// Infill is sparse on purpose where it is so in most layers, not where it is dense in all others.
#[test]
fn sparse_infill_is_silent_and_a_gap_in_dense_infill_is_not() {
    let layer = |pitch| vec![(2, raster(0.4, pitch, 45.0))];
    assert_eq!(fills(&[layer(3.0), layer(3.0), layer(3.0), layer(6.0), layer(0.4)]), []);
    let found = fills(&[layer(0.8), layer(0.36), layer(0.36), layer(0.36)]);
    assert!(found.len() == 1 && found[0].layer == 1, "{found:?}");
}

#[test]
fn without_names_only_layers_of_one_raster_are_judged() {
    assert_eq!(fills(&[vec![(4, raster(0.4, 0.8, 0.0))]]).len(), 1);
    // A shell and sparse infill.
    let walls = (0..20).map(|n| (4, square(22.0 + 0.8 * f64::from(n))));
    assert_eq!(fills(&[walls.chain([(4, raster(0.4, 3.0, 0.0))]).collect()]), []);
}

#[test]
fn the_room_is_what_the_outline_holds() {
    let hole: Vec<[f64; 2]> = square(10.0).0.into_iter().rev().collect();
    let beads = vec![(3, square(60.0)), (0, square(40.0)), (0, (hole, 0.4)), (1, raster(0.4, 0.8, 0.0))];
    let found = fills(std::slice::from_ref(&beads));
    let room = (40.0 * 40.0 + 0.2 * 160.0 + 0.04 * std::f64::consts::PI)
        - (10.0 * 10.0 - 0.2 * 40.0 + 0.04 * std::f64::consts::PI);
    assert!((found[0].room.unwrap() - room * HEIGHT).abs() < 1e-9, "{found:?} {room}");
    let lengths = 160.0 + 40.0 + (25.0 * 20.0 + 24.0 * 0.8);
    let area = Section { width: 0.4, height: HEIGHT }.stadium_area();
    assert!((found[0].fed - lengths * area).abs() < 1e-9, "{found:?}");
    assert!((found[0].empty - (1.0 - lengths * area / (room * HEIGHT))).abs() < 1e-12);
    // From the outline's first line on: the skirt is not the part's.
    assert_eq!(found[0].lines.0, 6);
    let mut open = beads;
    open[1].1.0.pop();
    assert_eq!(fills(&[open])[0].room, None);
}

#[test]
fn rows_of_outlines_are_no_raster() {
    let fin = |n: u32| {
        let x = 5.0 * f64::from(n);
        (vec![[x, 0.0], [x + 0.4, 0.0], [x + 0.4, 30.0], [x, 30.0], [x, 0.0]], 0.4)
    };
    for feature in [0, 4] {
        assert_eq!(fills(&[(0..10).map(|n| (feature, fin(n))).collect()]), []);
    }
}

#[test]
fn names_tell_what_features_are_for() {
    let cases = [
        ("External perimeter", Purpose::Outline),
        ("WALL-OUTER", Purpose::Outline),
        ("Outer wall", Purpose::Outline),
        ("Overhang perimeter", Purpose::Other),
        ("Bridge infill", Purpose::Other),
        ("Top solid infill", Purpose::Solid),
        ("SKIN", Purpose::Solid),
        ("Bottom surface", Purpose::Solid),
        ("Internal infill", Purpose::Infill),
        ("FILL", Purpose::Infill),
        ("Sparse infill", Purpose::Infill),
        ("Support material interface", Purpose::Aside),
        ("Skirt/Brim", Purpose::Aside),
        ("Gap infill", Purpose::Aside),
        ("unnamed", Purpose::Unknown),
    ];
    for (name, purpose) in cases {
        assert_eq!(Purpose::of(name), purpose, "{name}");
    }
}
