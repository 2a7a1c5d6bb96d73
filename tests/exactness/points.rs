//! Winding numbers at single points, straight from the soup.

use crate::piles::{Place, Step, on_lattice};
use crate::scene::Scene;
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::{Mesh, Rng};
use brickfield_engine::Silent;
use brickfield_engine::winding::{brute_at, winding_at};

fn compare(scene: &Scene, seed: u64, points: usize) -> usize {
    let oracle = scene.oracle();
    let (min, max) = crate::scene::bounds(&scene.soup);
    let mut rng = Rng::new(seed);
    // Odd positions in and a little around the soup.
    let [low, high] = [min, max].map(|corner| scene.root.to_units(corner));
    let mut sample =
        || -> [i32; 3] { std::array::from_fn(|a| rng.range(low[a] - 9.0, high[a] + 9.0) as i32 | 1) };
    let samples: Vec<[i32; 3]> = (0..points).map(|_| sample()).collect();
    let world: Vec<[f64; 3]> = samples.iter().map(|p| scene.root.to_world(p.map(f64::from))).collect();
    let exact = winding_at(&[&scene.soup], scene.root, &world, &Silent).expect("not interrupted");
    let brute = brute_at(&[&scene.soup], scene.root, &world, &Silent).expect("not interrupted");
    for (n, p) in samples.iter().enumerate() {
        assert_eq!(exact[n], oracle.at(*p), "{p:?}");
        if !oracle.may_lie_on_a_facet(*p) {
            assert!((brute[n] - exact[n] as f64).abs() < 1e-6, "{p:?}: {} {}", brute[n], exact[n]);
            assert!((brute[n] - oracle.solid_angles(*p)).abs() < 1e-6, "{p:?}: {}", brute[n]);
        }
    }
    exact.iter().filter(|&&w| w != 0).count()
}

#[test]
fn points_equal_the_oracle() {
    let mut covered = 0;
    for seed in 0..8 {
        covered += compare(&Scene::of(&random_pile(seed, 10)), seed, 1_000);
    }
    let beads: Vec<Mesh> = brickfield_bench_data::pile::bead_pile(1, 20_000, [20.0, 20.0, 4.0]).collect();
    covered += compare(&Scene::of(&beads), 9, 200);
    for seed in 0..8 {
        let place = Place { level: 16, step: Step::Half, shift: [false; 3], corner: seed };
        covered += compare(&on_lattice(seed, 6, place), seed, 1_000);
    }
    assert!(covered > 1_500, "{covered}");
}

/// Points between the lattice's positions count as the odd position of their pair of units; far ones as
/// outside.
#[test]
fn points_are_snapped_and_may_lie_anywhere() {
    let scene = Scene::of(&random_pile(3, 8));
    let oracle = scene.oracle();
    let mut rng = Rng::new(4);
    let units: Vec<[f64; 3]> = (0..2_000).map(|_| std::array::from_fn(|_| rng.range(1e5, 1.66e7))).collect();
    let mut world: Vec<[f64; 3]> = units.iter().map(|u| scene.root.to_world(*u)).collect();
    let far = [[1e30; 3], [-1e30, 0.0, 0.0], [f64::INFINITY; 3], [f64::NAN; 3], scene.root.origin];
    world.extend(far);
    let exact = winding_at(&[&scene.soup], scene.root, &world, &Silent).expect("not interrupted");
    for (u, w) in units.iter().zip(&exact) {
        let pair = u.map(|c| (c / 2.0).floor());
        // Converting back and forth may cross into the next pair; leave those points out.
        let clear = u.iter().zip(pair).all(|(c, p)| (c - 2.0 * p).clamp(1e-3, 1.999) == c - 2.0 * p);
        if clear {
            let p = pair.map(|c| 2 * c as i32 + 1);
            assert_eq!(*w, oracle.at(p), "{u:?}");
        }
    }
    assert_eq!(exact[units.len()..], [0; 5]);
}
