//! Winding numbers of soups that are not closed, against the judge's sum of solid angles.

use crate::scene::{Scene, bounds};
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::{Mesh, Rng};
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::ingest::{Facet, Input};
use brickfield_engine::winding::{OpenPart, open_winding_at};
use std::path::Path;

pub fn spot() -> Vec<Facet> {
    file("spot40_model.stl")
}

/// Compares at random samples in and around the soup, and beside its open edges; returns the largest error.
fn compare(soup: Vec<Facet>, seed: u64, points: usize, bound: f64) -> f64 {
    errors(soup, seed, points, bound).into_iter().map(|(error, _)| error).fold(0.0, f64::max)
}

/// The error and the true winding number at those samples.
fn errors(soup: Vec<Facet>, seed: u64, points: usize, bound: f64) -> Vec<(f64, f64)> {
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
    let compared = found.iter().zip(&samples).map(|(w, p)| {
        let truth = oracle.solid_angles(*p);
        let error = (w - truth).abs();
        assert!(error <= bound, "at {p:?}: {w} is off by {error}");
        let sides = (*w > 0.5, truth > 0.5);
        assert!(sides.0 == sides.1 || (truth - 0.5).abs() <= bound, "at {p:?}: {w}, not {truth}");
        (error, truth)
    });
    compared.collect()
}

/// A file of `bench-data/stl`, less facets with corners that are nowhere, which the program refuses.
pub fn file(name: &str) -> Vec<Facet> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/stl").join(name);
    let input = Input::open(&path, &Silent).expect("readable");
    let mut facets = Vec::new();
    input.read(0..input.facets(), &mut facets);
    facets.retain(|t| t.iter().flatten().all(|c| c.abs() < 1e6));
    facets
}

/// Some facets turned over.
fn flipped(mut soup: Vec<Facet>, share: f64, seed: u64) -> Vec<Facet> {
    let mut rng = Rng::new(seed);
    soup.iter_mut().filter(|_| rng.range(0.0, 1.0) < share).for_each(|t| t.swap(1, 2));
    soup
}

/// Open, inside out, doubled and degenerate files, as they are and with facets lost and flipped.
#[test]
fn awkward_files() {
    for (seed, name) in (0..).zip([
        "open_box_no_lid.stl",
        "inverted_box.stl",
        "duplicate_box.stl",
        "degenerate_mix.stl",
        "box_with_cavity.stl",
        "touching_layers.stl",
        "ascii_two_solids.stl",
    ]) {
        compare(file(name), seed, 100, 1e-3);
        compare(without(file(name), 0.2, seed), seed, 60, 1e-3);
        compare(flipped(file(name), 0.3, seed), seed, 60, 1e-3);
    }
}

/// Half of the facets of a torus, at random: the sign of w − 0.5 is right wherever the bound says so.
#[test]
fn a_torus_of_every_second_facet() {
    let torus: Vec<Facet> = brickfield_bench_data::shapes::torus(10.0, 3.0, 48, 24).facets().collect();
    let compared = errors(without(torus, 0.5, 3), 3, 1500, 1e-3);
    let inside = compared.iter().filter(|(_, w)| *w > 0.5).count();
    assert!(inside > 20 && inside + 20 < compared.len(), "{inside} of {}", compared.len());
}

/// How large errors are, by decades: run with `cargo test -p brickfield-engine --test exactness error_histogram --
/// --ignored --nocapture`.
#[test]
#[ignore = "prints the table of the report"]
fn error_histogram() {
    let table = |name: &str, cases: Vec<Vec<Facet>>| {
        let mut counts = [0usize; 8];
        for (seed, soup) in (0..).zip(cases) {
            for (error, _) in errors(soup, seed, 1000, 1e-3) {
                let decade = (0..7).take_while(|n| error < 10f64.powi(-3 - n)).count();
                counts[decade] += 1;
            }
        }
        println!("{name}: from above 1e-3 to below 1e-9: {counts:?}");
    };
    let shares = [0.001, 0.01, 0.1, 0.5, 0.9, 0.999];
    table("lost", shares.iter().map(|&s| without(spot(), s, 1)).collect());
    table("flipped", shares.iter().map(|&s| flipped(spot(), f64::min(s, 0.5), 1)).collect());
    let mut torn = spot();
    let mut rng = Rng::new(9);
    torn.iter_mut().flatten().flatten().for_each(|c| *c += rng.range(-3e-6, 3e-6));
    table("torn", vec![torn]);
    let files = ["open_box_no_lid.stl", "inverted_box.stl", "duplicate_box.stl", "degenerate_mix.stl"];
    table("files", files.iter().map(|name| without(file(name), 0.2, 1)).collect());
}

#[test]
fn lost_flipped_and_torn_facets() {
    let spot = spot();
    let mut worst = 0f64;
    let shares = [0.001, 0.01, 0.1, 0.5, 0.9, 0.999];
    for (n, share) in shares.into_iter().enumerate().step_by(part_or_all(2, 1)) {
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
