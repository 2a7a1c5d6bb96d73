//! Swept beads are closed, of the right volume, and nowhere inside out.

use super::{BeadPath, Joints, ProfileShape, StlBeads, Sweep, SweepOptions, SweptToolpath};
use crate::Silent;
use crate::part::PartFile;
use crate::part::outputs::{NAME, cut_everywhere, fail_everywhere};
use crate::toolpath::{Attributes, BeadView, Section, Toolpath, UP};
use brickfield_bench_data::judge::mesh::{self, MeshFindings};
use brickfield_bench_data::judge::winding::solid_angle_sum;
use glam::DVec3;
use proptest::prelude::*;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::Path;

const NO_ATTRIBUTES: Attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 1), fed: None };
const FLAT: Section = Section { width: 0.6, height: 0.2 };

fn one_bead(points: &[[f64; 3]], axes: &[[f64; 3]], sections: &[Section]) -> Toolpath {
    let mut toolpath = Toolpath::default();
    toolpath.push(BeadView { points, axes, sections, lines: &[], attributes: NO_ATTRIBUTES });
    toolpath
}

fn sweep(points: &[[f64; 3]], section: Section, options: SweepOptions) -> SweptToolpath {
    let sections = vec![section; points.len() - 1];
    SweptToolpath::new(one_bead(points, &[], &sections), Sweep::new(&options).unwrap())
}

fn all_facets(swept: &SweptToolpath) -> Vec<[[f64; 3]; 3]> {
    let mut facets = Vec::new();
    swept.read(0..u64::MAX, &mut facets);
    assert_eq!(facets.len() as u64, swept.facets());
    facets
}

/// Judges a soup welded by exact bits.
fn judge(facets: &[[[f64; 3]; 3]]) -> MeshFindings {
    let (mut numbers, mut vertices) = (HashMap::new(), Vec::new());
    let mut number = |corner: &[f64; 3]| {
        *numbers.entry(corner.map(f64::to_bits)).or_insert_with(|| {
            vertices.push(*corner);
            vertices.len() as u32 - 1
        })
    };
    let triangles: Vec<[u32; 3]> = facets.iter().map(|f| [0, 1, 2].map(|v| number(&f[v]))).collect();
    mesh::check(&vertices, &triangles)
}

/// Volume of both caps, a chain of frusta from the full section to a point.
fn caps(sweep: &Sweep, section: Section) -> f64 {
    let mut before = [0.0, 1.0];
    let mut volume = 0.0;
    for step in &sweep.caps {
        let [[d, s], [e, t]] = [before, *step];
        let t = if e == 1.0 { 0.0 } else { t };
        volume += (e - d) * (s * s + s * t + t * t) / 3.0;
        before = *step;
    }
    2.0 * volume * section.width / 2.0 * sweep.profile.area(section)
}

#[track_caller]
fn assert_volume(swept: &SweptToolpath, length: f64, tubes: u64) {
    let report = judge(&all_facets(swept));
    assert!(report.is_closed_manifold() && report.is_clean(), "{report}");
    assert_eq!((report.components, swept.tubes()), (tubes, tubes));
    let section = swept.toolpath().section(0, 0);
    let expected = swept.sweep().profile.area(section) * length + tubes as f64 * caps(swept.sweep(), section);
    let found = report.signed_volume;
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} for {expected}");
    assert!((swept.bead_volume() / swept.sweep().profile.area(section) - length).abs() < 1e-9);
}

fn every_shape() -> [ProfileShape; 4] {
    let arrow = vec![[-0.5, -0.5], [0.5, -0.5], [0.3, 0.5], [0.0, 0.0], [-0.5, 0.5]];
    [ProfileShape::Stadium, ProfileShape::Ellipse, ProfileShape::Rectangle, ProfileShape::Outline(arrow)]
}

#[test]
fn straight_beads_have_the_volume_of_their_section_times_length_and_their_caps() {
    for shape in every_shape() {
        for sides in [6, 8, 12, 14, 16, 40] {
            let options = SweepOptions { shape: shape.clone(), sides, ..SweepOptions::default() };
            assert_volume(&sweep(&[[1.0, 2.0, 0.2], [4.0, 6.0, 0.2]], FLAT, options), 5.0, 1);
        }
    }
}

#[test]
fn caps_converge_to_round_ones() {
    let volume = |sides| {
        let options = SweepOptions { sides, ..SweepOptions::default() };
        let swept = sweep(&[[0.0; 3], [1.0, 0.0, 0.0]], FLAT, options);
        judge(&all_facets(&swept)).signed_volume
    };
    // ∫ cos²θ over d = (w/2) sin θ is two thirds of w/2.
    let area = 0.2 * 0.4 + PI * 0.01;
    let exact = area * (1.0 + 2.0 * 0.3 * 2.0 / 3.0);
    let errors = [12, 24, 48, 96].map(|sides| (exact - volume(sides)) / exact);
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0] / 2.0) && errors[3] < 0.001, "{errors:?}");
}

#[test]
fn beads_lie_under_the_tip_as_high_and_wide_as_they_should() {
    let swept = sweep(&[[0.0, 0.0, 0.2], [3.0, 0.0, 0.2]], FLAT, SweepOptions::default());
    let report = judge(&all_facets(&swept));
    let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.003);
    assert!(near(report.min, [-0.3, -0.3, 0.0]) && near(report.max, [3.3, 0.3, 0.2]), "{report}");
    assert_eq!((report.min[2], report.max[2]), (0.0, 0.2));
}

#[test]
fn bends_are_mitred_up_to_the_limit_and_split_beyond() {
    let corner = [[0.0; 3], [5.0, 0.0, 0.0], [5.0, 5.0, 0.0]];
    let mitred = sweep(&corner, FLAT, SweepOptions { bend: 91.0, ..SweepOptions::default() });
    // What a mitre adds outside it takes away inside.
    assert_volume(&mitred, 10.0, 1);
    assert_eq!(mitred.joints(), Joints { mitred: 1, ..Joints::default() });
    let split = sweep(&corner, FLAT, SweepOptions { bend: 89.0, ..SweepOptions::default() });
    assert_volume(&split, 10.0, 2);
    assert_eq!(split.joints(), Joints { split_bends: 1, ..Joints::default() });
    let reversal = sweep(&[[0.0; 3], [5.0, 0.0, 0.0], [0.0; 3]], FLAT, SweepOptions::default());
    assert_eq!(reversal.tubes(), 2);
}

#[test]
fn arcs_keep_the_volume_of_their_length() {
    let arc: Vec<[f64; 3]> = (0..=60)
        .map(|i| (f64::from(i) * 0.1).sin_cos())
        .map(|(sin, cos)| [4.0 * cos, 4.0 * sin, 0.2])
        .collect();
    let length = 60.0 * 8.0 * 0.05f64.sin();
    for shape in [ProfileShape::Stadium, ProfileShape::Ellipse, ProfileShape::Rectangle] {
        assert_volume(&sweep(&arc, FLAT, SweepOptions { shape, ..SweepOptions::default() }), length, 1);
    }
}

#[test]
fn upright_and_rising_paths_do_not_roll() {
    let upright = [[1.0, 1.0, 0.0], [1.0, 1.0, 2.0], [1.0, 1.0, 5.0]];
    assert_volume(&sweep(&upright, FLAT, SweepOptions::default()), 5.0, 1);
    // A wave of three decimals: the corner that is highest on the left stays it.
    let rising: Vec<[f64; 3]> = (0..40)
        .map(|i| f64::from(i) * 0.5)
        .map(|x| [x, 0.15 * x, ((0.2 + 0.3 * (x * 0.7).sin()) * 1e3).round() / 1e3])
        .collect();
    let swept = sweep(&rising, FLAT, SweepOptions::default());
    assert_eq!(swept.tubes(), 1);
    let across = DVec3::new(-0.15, 1.0, 0.0).normalize();
    let along = DVec3::new(1.0, 0.15, 0.0).normalize();
    for facet in all_facets(&swept) {
        for corner in facet.map(DVec3::from) {
            // Caps aside, half the width to the side at most, and half the height up and down.
            let off = corner.dot(across).abs();
            assert!(off < 0.31, "{corner}: {off}");
            let beneath =
                rising.iter().map(|p| (DVec3::from(*p) - corner).dot(along).abs()).fold(9.0, f64::min);
            assert!(beneath <= 0.5, "{corner}");
        }
    }
}

#[test]
fn small_changes_of_width_taper_and_large_ones_split() {
    let points: Vec<[f64; 3]> = (0..4).map(|i| [f64::from(i), 0.0, 0.0]).collect();
    let widths = |w: [f64; 3]| {
        let sections = w.map(|width| Section { width, height: 0.2 });
        SweptToolpath::new(one_bead(&points, &[], &sections), Sweep::new(&SweepOptions::default()).unwrap())
    };
    let tapered = widths([0.5, 0.53, 0.55]);
    assert_eq!((tapered.tubes(), tapered.joints().mitred), (1, 2));
    let report = judge(&all_facets(&tapered));
    assert!(report.is_closed_manifold());
    let stepped = widths([0.5, 0.6, 0.61]);
    assert_eq!((stepped.tubes(), stepped.joints().split_sections), (2, 1));
    // A stadium on end and one that lies have nothing to do with each other.
    assert_eq!(widths([0.195, 0.205, 0.205]).joints().split_sections, 1);
}

#[test]
fn corners_tighter_than_the_bead_split_instead_of_folding() {
    // A circle with a radius of a sixth of the width.
    let arc: Vec<[f64; 3]> = (0..20)
        .map(|i| (f64::from(i) * 0.3).sin_cos())
        .map(|(sin, cos)| [0.1 * cos, 0.1 * sin, 0.2])
        .collect();
    let swept = sweep(&arc, FLAT, SweepOptions::default());
    assert_eq!(swept.joints().split_folds, 18);
    assert!(judge(&all_facets(&swept)).is_closed_manifold());
}

#[test]
fn a_written_file_holds_what_a_range_reads() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("wave.stl");
    let wave: Vec<[f64; 3]> =
        (0..9000).map(|i| f64::from(i) * 0.05).map(|x| [x, (x * 2.0).sin(), 0.3]).collect();
    let swept = sweep(&wave, FLAT, SweepOptions { sides: 6, ..SweepOptions::default() });
    let mut writer = StlBeads::create(&path, swept.sweep().clone()).unwrap();
    let sections = vec![FLAT; wave.len() - 1];
    let view =
        BeadView { points: &wave, axes: &[], sections: &sections, lines: &[], attributes: NO_ATTRIBUTES };
    writer.push(view, &Silent).unwrap();
    let written = writer.finish(&Silent).unwrap();
    assert_eq!((written.facets, written.tubes), (swept.facets(), swept.tubes()));
    assert_eq!(written.bytes, std::fs::metadata(&path).unwrap().len());
    assert!((written.bead_volume / swept.bead_volume() - 1.0).abs() < 1e-12);
    let report = mesh::check_file(&path).unwrap();
    assert!(report.is_balanced(), "{report}");
    assert!((written.swept_volume / report.signed_volume - 1.0).abs() < 1e-5, "{written:?} {report}");
    // A bead that 32-bit coordinates cannot show is refused, and nothing is left.
    let far = wave[..2].iter().map(|p| [p[0] + 1e6, p[1], p[2]]).collect::<Vec<_>>();
    let mut writer = StlBeads::create(&directory.path().join("far.stl"), swept.sweep().clone()).unwrap();
    let view =
        BeadView { points: &far, axes: &[], sections: &sections[..1], lines: &[], attributes: NO_ATTRIBUTES };
    assert!(writer.push(view, &Silent).unwrap_err().to_string().contains("32 bits"));
    drop(writer);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
}

#[test]
fn every_call_may_fail_and_the_power_go() {
    let write = |disk| {
        let mut beads = StlBeads::new(
            PartFile::create_on(disk, Path::new(NAME))?,
            Sweep::new(&SweepOptions::default())?,
        )?;
        let bent: Vec<[f64; 3]> = (0..40).map(|i| [f64::from(i), f64::from(i % 2), 0.3]).collect();
        let sections = vec![FLAT; bent.len() - 1];
        let view =
            BeadView { points: &bent, axes: &[], sections: &sections, lines: &[], attributes: NO_ATTRIBUTES };
        beads.push(view, &Silent)?;
        beads.finish(&Silent).map(|_| ())
    };
    assert!(fail_everywhere(&write) > 24);
    assert!(cut_everywhere(&write, 10) > 100);
}

/// A bead of anything that a reader may hand over: bends of all kinds, tiny steps, tilting tools.
#[derive(Clone, Debug)]
struct Wild {
    points: Vec<[f64; 3]>,
    axes: Vec<[f64; 3]>,
    sections: Vec<Section>,
}

fn wild() -> impl Strategy<Value = Wild> {
    let step = (-PI..PI, 0.0..1.0f64, -1.0..1.0f64, 0.0..1.0f64);
    let section = (0.9..1.15f64, 0.95..1.05f64);
    let calm = prop_oneof![Just(0.15), Just(1.0)];
    (calm, prop::bool::ANY, prop::collection::vec((step, section), 1..14)).prop_map(|(calm, tilts, steps)| {
        let (mut at, mut heading) = (DVec3::ZERO, 0.0);
        let mut wild = Wild { points: vec![at.into()], axes: Vec::new(), sections: Vec::new() };
        for (number, ((turn, length, slope, odd), (wider, higher))) in steps.into_iter().enumerate() {
            heading += turn * calm;
            let rise = if odd < 0.1 { 40.0 * slope } else { slope * calm };
            let length = if odd > 0.95 { 1e-7 } else { 0.01 + 2.0 * length * length };
            let direction = DVec3::new(heading.cos(), heading.sin(), rise).normalize();
            at += direction * length;
            wild.points.push(at.into());
            let section = Section { width: 0.6 * wider, height: 0.3 * higher };
            wild.sections.push(if number % 3 == 0 { FLAT } else { section });
        }
        if tilts {
            let axis = |p: &[f64; 3]| DVec3::new(0.3 * p[0].sin(), 0.3 * p[1].cos(), 1.0).normalize().into();
            wild.axes = wild.points.iter().map(axis).collect();
        }
        wild
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_bead_is_closed_and_nowhere_inside_out(
        bead in wild(),
        shape in 0..4usize,
        bend in prop_oneof![Just(45.0), Just(100.0)],
        spots in prop::collection::vec((0.0..1.0f64, prop::array::uniform3(-0.5..0.5f64)), 24),
    ) {
        let options = SweepOptions { shape: every_shape()[shape].clone(), sides: 8, bend };
        let toolpath = one_bead(&bead.points, &bead.axes, &bead.sections);
        let swept = SweptToolpath::new(toolpath, Sweep::new(&options).unwrap());
        let facets = all_facets(&swept);
        let report = judge(&facets);
        prop_assert!(report.is_balanced() && report.repeated_index_triangles == 0, "{report}");
        let segments = bead.sections.len();
        let mut nearby: Vec<DVec3> = spots.iter().map(|(which, off)| {
            let segment = (which * segments as f64) as usize;
            DVec3::from(bead.points[segment]).lerp(bead.points[segment + 1].into(), off[0] + 0.5) + DVec3::from(*off)
        }).collect();
        if shape < 3 {
            let middle = |segment: usize| {
                let ends = [segment, segment + 1].map(|p| {
                    let axis = DVec3::from(bead.axes.get(p).copied().unwrap_or(UP));
                    DVec3::from(bead.points[p]) - axis * (bead.sections[segment].height / 2.0)
                });
                ends[0].lerp(ends[1], 0.5)
            };
            for middle in (0..segments).map(middle) {
                let w = solid_angle_sum(&facets, middle.into());
                prop_assert!(w > 0.999, "{middle} lies on the path, and w is {w}");
            }
        }
        // Beside the corners of rings too, where folds would be.
        nearby.extend(facets.iter().step_by(7).map(|f| (DVec3::from(f[0]) + DVec3::from(f[1])) / 2.0 * 1.000_01));
        for p in nearby {
            let w = solid_angle_sum(&facets, p.into());
            prop_assert!(w > -0.001, "w is {w} at {p}");
        }
    }

    #[test]
    fn any_range_is_the_part_of_the_whole(bead in wild(), from in 0.0..1.0f64, length in 0..400u64) {
        let mut toolpath = one_bead(&bead.points, &bead.axes, &bead.sections);
        toolpath.push(BeadView { points: &bead.points, axes: &[], sections: &bead.sections, lines: &[], attributes: NO_ATTRIBUTES });
        let swept = SweptToolpath::new(toolpath, Sweep::new(&SweepOptions::default()).unwrap());
        let all = all_facets(&swept);
        let from = (from * all.len() as f64) as u64;
        let mut part = Vec::new();
        swept.read(from..from + length, &mut part);
        let end = all.len().min((from + length) as usize);
        prop_assert!(part == all[from as usize..end]);
        let course = (swept.toolpath(), 1);
        prop_assert_eq!(course.points(), &bead.points[..]);
    }
}
