use super::*;
use crate::brick::Count;
use crate::ingest::Facet;
use crate::progress::Silent;
use crate::solid::{Outline, passes_of};
use crate::soup::Facets;
use crate::store::SourceVolumes;
use crate::toolpath::{Attributes, BeadView, Section, Toolpath};
use std::f64::consts::PI;

const ALL: u64 = 1 << 30;

/// A box as twelve facets, faces outward.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Facet> {
    let corner = |n: usize| [0, 1, 2].map(|a| if n >> a & 1 == 1 { high[a] } else { low[a] });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]].map(|t| t.map(corner));
    faces.into_iter().flat_map(halves).collect()
}

fn volumes_of(facets: &Vec<Facet>, bounds: ([f64; 3], [f64; 3]), memory: u64) -> SourceVolumes {
    facet_volumes(&[facets as &dyn Facets], bounds, memory, &Silent).unwrap().unwrap()
}

#[test]
fn overlapping_boxes_are_within_their_errors_and_as_far_apart_as_these_say() {
    let (mut squares, mut most) = (0.0, 0.0f64);
    const TRIALS: u32 = 40;
    for trial in 0..TRIALS {
        // The lines are the same, the boxes are not.
        let at = f64::from(trial) * 0.031;
        let mut facets = cuboid([0.0; 3], [10.0, 8.0, 6.0]);
        facets.extend(cuboid([5.0 + at, 3.0 - at, 2.0], [12.0, 9.0, 7.5]));
        let common = (5.0 - at) * (5.0 + at) * 4.0;
        let second = (7.0 - at) * (6.0 + at) * 5.5;
        let SourceVolumes { union, overlap, negative, .. } =
            volumes_of(&facets, ([0.0; 3], [12.0, 9.0, 7.5]), ALL);
        assert!((union.value + overlap.value - 480.0 - second).abs() < 1e-3, "what is known is exact");
        let off = (overlap.value - common) / overlap.standard_error;
        assert!(overlap.standard_error < 1e-3 * union.value && negative.value.abs() < 1e-6);
        squares += off * off;
        most = most.max(off.abs());
    }
    let rms = (squares / f64::from(TRIALS)).sqrt();
    assert!((0.5..1.5).contains(&rms) && most < 4.0, "{rms} {most}");
}

#[test]
fn what_is_inside_out_is_negative() {
    let mut facets = cuboid([0.0; 3], [4.0; 3]);
    facets.extend(cuboid([5.0; 3], [7.0; 3]).into_iter().map(|[a, b, c]| [a, c, b]));
    let volumes = volumes_of(&facets, ([0.0; 3], [7.0; 3]), ALL);
    let SourceVolumes { union, overlap, negative, .. } = volumes;
    assert!((union.value - 64.0).abs() <= union.bound() && union.bound() < 0.5, "{union:?}");
    assert!((negative.value - 8.0).abs() <= negative.bound() && overlap.value.abs() < 1e-6, "{negative:?}");
}

/// Corners snapped to the lattice enclose another volume; what is told is that of the facets.
#[test]
fn a_turned_plate_has_the_volume_of_its_facets() {
    let turned = |[x, y, z]: [f64; 3]| {
        let (a, b) = (0.6 * x - 0.8 * z, 0.8 * x + 0.6 * z);
        [a, (5.0 * y - 12.0 * b) / 13.0, (12.0 * y + 5.0 * b) / 13.0]
    };
    let facets: Vec<Facet> =
        cuboid([1.3, 2.7, 0.9], [101.3, 102.7, 1.0]).into_iter().map(|facet| facet.map(turned)).collect();
    let all = || facets.iter().flatten();
    let bound = |a: usize, by: fn(f64, f64) -> f64| all().map(|p| p[a]).reduce(by).unwrap();
    let bounds = ([0, 1, 2].map(|a| bound(a, f64::min)), [0, 1, 2].map(|a| bound(a, f64::max)));
    let SourceVolumes { union, overlap, .. } = volumes_of(&facets, bounds, ALL);
    assert!((union.value - 1000.0).abs() <= union.bound() && union.bound() < 1e-5, "{union:?}");
    assert_eq!((overlap.value, overlap.standard_error), (0.0, 0.0));
    // A second plate across the first: what both cover is as uncertain as their places.
    let mut both = facets.clone();
    both.extend(cuboid([20.0, -40.0, -2.0], [20.1, 40.0, 60.0]));
    let bounds = ([bounds.0[0].min(20.0), -200.0, -200.0], bounds.1.map(|c| c.max(60.0)));
    let SourceVolumes { overlap, .. } = volumes_of(&both, bounds, ALL);
    assert!(overlap.bound() > 1e-4, "{overlap:?}");
}

#[test]
fn memory_and_threads_change_no_bit() {
    let mut facets = cuboid([0.0; 3], [10.0, 8.0, 6.0]);
    facets.extend(cuboid([1.0, 2.0, 3.0], [9.0, 12.0, 11.0]));
    let bounds = ([0.0; 3], [10.0, 12.0, 11.0]);
    let whole = volumes_of(&facets, bounds, ALL);
    assert_eq!(volumes_of(&facets, bounds, 1 << 16), whole);
    let path = toolpath(&[square_wave(), square_wave()], 0.6);
    let beads = beads_of(&path, ALL);
    assert_eq!(beads_of(&path, 1 << 16), beads);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(pool.install(|| volumes_of(&facets, bounds, ALL)), whole);
    assert_eq!(pool.install(|| beads_of(&path, ALL)), beads);
}

/// Beads of width 0.6 and height 0.2, each a layer above the one before.
fn toolpath(beads: &[Vec<[f64; 2]>], width: f64) -> Toolpath {
    let mut path = Toolpath::default();
    for (layer, plan) in beads.iter().enumerate() {
        let z = 0.2 * (layer + 1) as f64;
        let points: Vec<[f64; 3]> = plan.iter().map(|&[x, y]| [x, y, z]).collect();
        let sections = vec![Section { width, height: 0.2 }; points.len() - 1];
        let attributes =
            Attributes { layer: layer as u32, tool: 0, feature: 0, lines: (1, 2), fed: Some(1.0) };
        path.push(BeadView { points: &points, axes: &[], sections: &sections, lines: &[], attributes });
    }
    path
}

fn square_wave() -> Vec<[f64; 2]> {
    (0..40).map(|n| [f64::from(n / 2), f64::from((n / 2 + n) % 2) * 8.0]).collect()
}

fn beads_of(path: &Toolpath, memory: u64) -> SourceVolumes {
    let bounds = crate::solid::bounds_of_beads(path, Outline::Stadium).unwrap();
    let passes = passes_of(&[path], Count::Passes);
    bead_volumes(&[(path, &passes[0])], Outline::Stadium, bounds, memory, &Silent).unwrap()
}

/// Area of a stadium, and the volume of its two half ends.
fn stadium(width: f64) -> (f64, f64) {
    let (r, side) = (0.1, 0.5 * width - 0.1);
    let area = 0.2 * 2.0 * side + PI * r * r;
    (area, 2.0 * PI * (side * side * r + 2.0 * side * PI * r * r / 4.0 + 2.0 / 3.0 * r * r * r))
}

fn is_within(estimate: crate::store::Estimate, truth: f64, part: f64) {
    let off = (estimate.value - truth).abs();
    assert!(
        off <= estimate.bound().max(1e-6 * truth) && estimate.bound() <= part * truth,
        "{estimate:?} {truth}"
    );
}

#[test]
fn a_straight_bead_holds_its_section_times_its_length_and_its_ends() {
    let path = toolpath(&[vec![[1.0, 2.0], [31.0, 2.0]]], 0.6);
    let volumes = beads_of(&path, ALL);
    let (area, ends) = stadium(0.6);
    is_within(volumes.union, area * 30.0 + ends, 2e-3);
    assert!(volumes.overlap.value.abs() < 1e-9);
    let swept = volumes.swept.unwrap();
    assert!((swept.sections / (area * 30.0) - 1.0).abs() < 1e-5 && (swept.ends / ends - 1.0).abs() < 1e-5);
    assert_eq!(swept.fed, Some(1.0));
    let corners = volumes.within_corners().unwrap();
    assert!(corners.value.abs() <= corners.bound().max(1e-6));
}

#[test]
fn what_is_laid_three_times_overlaps_twice() {
    let path = toolpath(&[vec![[0.0, 0.0], [30.0, 0.0], [0.0, 0.0], [30.0, 0.0]]], 0.6);
    let volumes = beads_of(&path, ALL);
    let (area, ends) = stadium(0.6);
    is_within(volumes.union, area * 30.0 + ends, 2e-3);
    // The round ends where a pass follows another count once.
    is_within(volumes.overlap, 2.0 * area * 30.0, 5e-3);
}

#[test]
fn layers_add_up_and_no_layer_height_is_in_step() {
    // A cuboid of 40 layers, each of one wide bead.
    let beads: Vec<Vec<[f64; 2]>> = (0..40).map(|_| vec![[0.0, 0.0], [20.0, 0.0]]).collect();
    let volumes = beads_of(&toolpath(&beads, 6.0), ALL);
    let (area, ends) = stadium(6.0);
    is_within(volumes.union, 40.0 * (area * 20.0 + ends), 2e-3);
    assert_eq!(volumes.layers.len(), 40);
    for (n, layer) in volumes.layers.iter().enumerate() {
        assert!((layer.top - 0.2 * (n + 1) as f64).abs() < 1e-5, "{layer:?}");
        let off = (layer.union.value - area * 20.0 - ends) / layer.union.standard_error;
        assert!(off.abs() < 4.0 && layer.union.bound() < 0.05 * layer.union.value, "{layer:?}");
    }
}

#[test]
fn tilted_beads_are_measured_by_the_same_rule() {
    let mut path = Toolpath::default();
    let points = [[0.0, 0.0, 0.0], [10.0, 3.0, 7.0]];
    let axes = [[0.6, 0.0, 0.8]; 2];
    let attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 2), fed: None };
    let sections = [Section { width: 0.6, height: 0.2 }];
    path.push(BeadView { points: &points, axes: &axes, sections: &sections, lines: &[], attributes });
    let volumes = beads_of(&path, ALL);
    let (area, ends) = stadium(0.6);
    is_within(volumes.union, area * 158f64.sqrt() + ends, 2e-2);
    assert_eq!(volumes.swept.unwrap().fed, None);
}
