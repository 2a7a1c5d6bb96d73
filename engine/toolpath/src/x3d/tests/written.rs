//! What is written is read back as the solid that was meant.

use super::*;
use crate::part::PartFile;
use crate::part::outputs::{NAME, cut_everywhere, fail_everywhere};
use crate::toolpath::{Attributes, BeadView, Section};
use crate::x3d::{ExtrusionStyle, Writer};
use proptest::prelude::*;

const SQUARE: [[f64; 2]; 4] = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
/// Wide below, narrow above, and heavier on the left: shows every roll and mirroring.
const SKEW: [[f64; 2]; 4] = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.0], [-0.25, 0.5]];
const SKEW_AREA: f64 = 0.6875;
const ATTRIBUTES: Attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (3, 9), fed: None };
const SECTION: Section = Section { width: 0.4, height: 0.2 };

fn written(
    points: &[[f64; 3]],
    axes: &[[f64; 3]],
    sections: &[Section],
    outline: &[[f64; 2]],
    style: ExtrusionStyle,
) -> String {
    let mut writer = Writer::new(Vec::new(), Path::new("out.x3d"), style).unwrap();
    writer.bead(BeadView { points, axes, sections, lines: &[], attributes: ATTRIBUTES }, outline).unwrap();
    String::from_utf8(writer.finish().unwrap()).unwrap()
}

fn swept(points: &[[f64; 3]], outline: &[[f64; 2]], style: ExtrusionStyle) -> (u64, Vec<Triangle>) {
    let sections = vec![SECTION; points.len() - 1];
    let sweeps = opened(&written(points, &[], &sections, outline, style)).unwrap();
    assert!(sweeps.report().warnings().is_empty());
    (sweeps.report().extrusions, all(&sweeps))
}

const FLAT: ExtrusionStyle = ExtrusionStyle { bend_degrees: 100.0, cap_rings: 0 };

#[test]
fn a_straight_bead_hangs_below_its_path_with_rounded_ends() {
    let style = ExtrusionStyle::default();
    let (count, triangles) = swept(&[[1.0, 2.0, 3.0], [11.0, 2.0, 3.0]], &SQUARE, style);
    assert_eq!((count, open_edges(&triangles)), (1, 0));
    let [low, high] = bounds(&triangles);
    assert!((low - DVec3::new(0.8, 1.8, 2.8)).length() < 2e-6, "{low}");
    assert!((high - DVec3::new(11.2, 2.2, 3.0)).length() < 2e-6, "{high}");
    // Frusta between the scales 1, cos 45° and 0.05 at the half width times 0, sin 45° and 1.
    let frustum = |d: f64, a: f64, b: f64| d * (a * a + a * b + b * b) / 3.0;
    let c = std::f64::consts::FRAC_1_SQRT_2;
    let end = 0.2 * (frustum(c, 1.0, c) + frustum(1.0 - c, c, 0.05));
    let expected = 0.4 * 0.2 * (10.0 + 2.0 * end);
    assert!((volume(&triangles) - expected).abs() < 1e-5, "{} is not {expected}", volume(&triangles));
}

#[test]
fn outlines_stand_upright_whichever_way_the_path_bends() {
    // Left and right bends of unequal segments: the specification's plane turns over and leans.
    let path = [
        [0.0, 0.0, 1.0],
        [3.0, 0.0, 1.0],
        [4.0, 1.0, 1.0],
        [6.0, 1.0, 1.0],
        [6.0, 4.0, 1.0],
        [7.0, 3.5, 1.0],
    ];
    let (count, triangles) = swept(&path[..5], &SKEW, FLAT);
    assert_eq!((count, open_edges(&triangles)), (1, 0));
    let [low, high] = bounds(&triangles);
    assert!((low.z - 0.8).abs() < 1e-6 && (high.z - 1.0).abs() < 1e-6, "{low} {high}");
    // The lower side is whole and reaches 0.2 to either side, the upper one stops 0.1 right of the path.
    let at = |x: f64, y: f64| {
        triangles.as_flattened().iter().filter(move |c| (c[0] - x).abs() < 1e-5 && (c[1] - y).abs() < 1e-5)
    };
    assert!(
        at(0.0, 0.2).any(|c| (c[2] - 0.9).abs() < 1e-5) && at(0.0, -0.2).any(|c| (c[2] - 0.8).abs() < 1e-5)
    );
    assert!(at(0.0, -0.1).any(|c| (c[2] - 1.0).abs() < 1e-5));
    // A mitred prism has the volume of its parts, each as long as the path of the section's centroid; left and
    // right bends of the same angle keep that length.
    let both = [path[0], path[1], path[2], path[3]];
    let (_, triangles) = swept(&both, &SKEW, FLAT);
    let length = 5.0 + 2f64.sqrt();
    let expected = SKEW_AREA * 0.4 * 0.2 * length;
    assert!((volume(&triangles) - expected).abs() < 1e-6, "{} is not {expected}", volume(&triangles));
}

#[test]
fn sharp_bends_and_new_sections_split() {
    let path = [[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [3.0, 3.0, 1.0], [6.0, 3.2, 1.0]];
    let (count, triangles) = swept(&path, &SQUARE, ExtrusionStyle::default());
    assert_eq!((count, open_edges(&triangles)), (3, 0));
    let wide = Section { width: 0.8, height: 0.2 };
    let text = written(&path, &[], &[SECTION, SECTION, wide], &SQUARE, FLAT);
    assert_eq!(opened(&text).unwrap().report().extrusions, 2);
    // A mitre between short segments would run backwards on the inner side.
    let short = [[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [3.0, 0.1, 1.0], [6.0, 0.1, 1.0]];
    assert_eq!(swept(&short, &SQUARE, FLAT).0, 3);
}

#[test]
fn a_rising_wall_does_not_roll() {
    // Collinear seen from above, while rounded heights bend it up and down by turns.
    let path: Vec<[f64; 3]> = [0.2, 0.201, 0.203, 0.204, 0.204, 0.206]
        .iter()
        .enumerate()
        .map(|(i, z)| [i as f64 * 0.5, i as f64 * 0.075, *z])
        .collect();
    let (count, triangles) = swept(&path, &SKEW, FLAT);
    assert_eq!((count, open_edges(&triangles)), (1, 0));
    let [low, high] = bounds(&triangles);
    assert!((low.z - 0.0).abs() < 1e-3 && (high.z - 0.206).abs() < 1e-3, "{low} {high}");
    let length: f64 = path.windows(2).map(|w| DVec3::from(w[0]).distance(w[1].into())).sum();
    let expected = SKEW_AREA * 0.4 * 0.2 * length;
    assert!((volume(&triangles) / expected - 1.0).abs() < 1e-3, "{}", volume(&triangles) / expected);
}

#[test]
fn tilted_tools_tilt_the_section() {
    let axis = [0.0, 0.6, 0.8];
    let text = written(&[[0.0; 3], [5.0, 0.0, 0.0]], &[axis; 2], &[SECTION], &SQUARE, FLAT);
    let [low, high] = bounds(&all(&opened(&text).unwrap()));
    // Half width along (0, 0.8, −0.6), the whole height along the axis below the path.
    let (low_yz, high_yz) = ([-0.12 - 0.16, -0.16 - 0.12], [0.16, 0.12]);
    for (found, wanted) in
        [(low.y, low_yz[0]), (low.z, low_yz[1]), (high.y, high_yz[0]), (high.z, high_yz[1])]
    {
        assert!((found - wanted).abs() < 2e-6, "{low} {high}");
    }
}

#[test]
fn what_cannot_be_written_is_refused() {
    let style = ExtrusionStyle { bend_degrees: 170.0, ..FLAT };
    assert!(Writer::new(Vec::new(), Path::new("a"), style).unwrap_err().to_string().contains("150"));
    let mut writer = Writer::new(Vec::new(), Path::new("a"), FLAT).unwrap();
    let far = BeadView {
        points: &[[0.0; 3], [1e10, 0.0, 0.0]],
        axes: &[],
        sections: &[SECTION],
        lines: &[],
        attributes: ATTRIBUTES,
    };
    let told = writer.bead(far, &SQUARE).unwrap_err().to_string();
    assert!(told.contains("the bead of lines 3 to 9"), "{told}");
    // Points that are one when rounded leave nothing.
    let near = BeadView { points: &[[0.0; 3], [1e-9, 0.0, 0.0]], ..far };
    writer.bead(near, &SQUARE).unwrap();
    assert_eq!(writer.extrusions(), 0);
    assert_eq!(file_text(writer).matches("<Extrusion").count(), 0);
}

fn file_text(writer: Writer<Vec<u8>>) -> String {
    String::from_utf8(writer.finish().unwrap()).unwrap()
}

proptest! {
    #[test]
    fn any_path_is_read_back_closed_and_of_its_volume(
        steps in prop::collection::vec((0.3..2.0f64, -1.2..1.2f64, -0.3..0.3f64), 1..12),
        cap_rings in 0u32..4,
        bend_degrees in 0.0..120.0f64,
    ) {
        let (mut at, mut heading) = (DVec3::new(5.0, -3.0, 1.0), 0.0f64);
        let mut points = vec![at.to_array()];
        for (length, turn, rise) in &steps {
            heading += turn;
            at += DVec3::new(heading.cos(), heading.sin(), *rise) * *length;
            points.push(at.to_array());
        }
        let (_, triangles) = swept(&points, &SKEW, ExtrusionStyle { bend_degrees, cap_rings });
        prop_assert_eq!(open_edges(&triangles), 0);
        let length: f64 = points.windows(2).map(|w| DVec3::from(w[0]).distance(w[1].into())).sum();
        // The centroid is beside the path, and rising bends are stretched along the section's axes only.
        let ratio = volume(&triangles) / (SKEW_AREA * 0.4 * 0.2 * length);
        let ends = 0.3 * (steps.len() as f64 + 1.0) / length;
        prop_assert!(ratio > 0.85 && ratio < 1.15 + ends, "{}", ratio);
    }
}

#[test]
fn every_call_may_fail_and_the_power_go() {
    let write = |disk| {
        let part = PartFile::create_on(disk, Path::new(NAME))?;
        let mut writer = Writer::new(part, Path::new(NAME), ExtrusionStyle::default())?;
        let points: Vec<[f64; 3]> = (0..500).map(|i| [f64::from(i), f64::from(i % 3), 1.0]).collect();
        let sections = vec![SECTION; points.len() - 1];
        let view =
            BeadView { points: &points, axes: &[], sections: &sections, lines: &[], attributes: ATTRIBUTES };
        (0..4).try_for_each(|_| writer.bead(view, &SKEW))?;
        writer.finish()?.finish()
    };
    assert!(fail_everywhere(&write) >= 24);
    assert!(cut_everywhere(&write, 10) > 100);
}
