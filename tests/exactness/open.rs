//! Winding numbers of soups that are not closed, against the judge's sum of solid angles.

use crate::scene::{Scene, bounds};
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::{Mesh, Rng};
use brickfield_engine::Silent;
use brickfield_engine::ingest::{Facet, Input};
use brickfield_engine::winding::{OpenPart, open_winding_at};
use std::path::Path;

pub fn spot() -> Vec<Facet> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/stl/spot40_model.stl");
    let input = Input::open(&path, &Silent).expect("readable");
    let mut facets = Vec::new();
    input.read(0..input.facets(), &mut facets);
    facets
}

/// Compares at random samples in and around the soup, and beside its open edges; returns the largest error.
fn compare(soup: Vec<Facet>, seed: u64, points: usize, bound: f64) -> f64 {
    let scene = Scene::around(soup);
    let oracle = scene.oracle();
    let (min, max) = bounds(&scene.soup);
    let [low, high] = [min, max].map(|corner| scene.root.to_units(corner));
    let part = OpenPart::of(&[&scene.soup], scene.root, &Silent).expect("not interrupted");
    let mut rng = Rng::new(seed);
    let mut samples: Vec<[i32; 3]> = (0..points)
        .map(|_| std::array::from_fn(|a| rng.range(low[a] - 1e6, high[a] + 1e6) as i32 | 1))
        .collect();
    for n in 0..points.min(part.caps.len()) {
        // A random point of a cap, at most a few units off.
        let t = part.caps[(n * 7919) % part.caps.len()];
        let (u, v) = (rng.range(0.0, 0.5), rng.range(0.0, 0.5));
        samples.push(std::array::from_fn(|a| {
            let at = |i: usize| f64::from(t[i][a]);
            (at(0) + u * (at(1) - at(0)) + v * (at(2) - at(0))) as i32 | 1
        }));
    }
    samples.retain(|p| !oracle.may_lie_on_a_facet(*p));
    let world: Vec<[f64; 3]> = samples.iter().map(|p| scene.root.to_world(p.map(f64::from))).collect();
    let found = open_winding_at(&[&scene.soup], scene.root, &part, &world, bound, &Silent).expect("answers");
    let mut worst = 0f64;
    for (w, p) in found.iter().zip(&samples) {
        let error = (w - oracle.solid_angles(*p)).abs();
        assert!(error <= bound, "at {p:?}: {w} is off by {error}");
        worst = worst.max(error);
    }
    worst
}

#[test]
fn lost_flipped_and_torn_facets() {
    let spot = spot();
    let mut worst = 0f64;
    for (n, share) in [0.001, 0.01, 0.1, 0.5, 0.9, 0.999].into_iter().enumerate() {
        let mut rng = Rng::new(n as u64);
        let lost = without(spot.clone(), share, n as u64);
        worst = worst.max(compare(lost, n as u64, 60, 1e-3));
        let mut flipped = spot.clone();
        flipped.iter_mut().for_each(|t| {
            if rng.range(0.0, 1.0) < share.min(0.5) {
                t.swap(1, 2);
            }
        });
        worst = worst.max(compare(flipped, n as u64, 60, 1e-3));
        // Every corner moved by about a unit: most edges are torn, and the caps are slivers.
        let mut torn = spot.clone();
        torn.iter_mut().flatten().flatten().for_each(|c| *c += rng.range(-3e-6, 3e-6));
        worst = worst.max(compare(torn, n as u64, 60, 1e-3));
    }
    // A bound that is never nearly reached would be idle.
    assert!(worst > 1e-5, "{worst}");
}

#[test]
fn overlapping_pieces_with_lost_facets() {
    for seed in 0..4 {
        let pile: Vec<Facet> = Mesh::merged(&random_pile(seed, 10)).facets().collect();
        let lost = without(pile, 0.2, seed);
        compare(lost, seed, 150, 1e-4);
    }
}

/// A soup less a share of its facets.
pub fn without(soup: Vec<Facet>, share: f64, seed: u64) -> Vec<Facet> {
    let mut rng = Rng::new(seed);
    soup.into_iter().filter(|_| rng.range(0.0, 1.0) >= share).collect()
}

/// A band with half a turn has no sides: its edges cancel nowhere along one line across it.
pub fn moebius() -> Vec<Facet> {
    let at = |step: i32, side: f64| -> [f64; 3] {
        let angle = f64::from(step) / 60.0 * std::f64::consts::TAU;
        let (radius, height) = (10.0 + side * (angle / 2.0).cos(), side * (angle / 2.0).sin());
        [radius * angle.cos(), radius * angle.sin(), height]
    };
    let band = |i| {
        let quad = [at(i, -3.0), at(i + 1, -3.0), at(i + 1, 3.0), at(i, 3.0)];
        [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    };
    (0..60).flat_map(band).collect()
}

#[test]
fn a_moebius_band() {
    compare(moebius(), 1, 400, 1e-3);
}
