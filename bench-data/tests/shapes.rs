//! Every generated piece is a closed manifold, oriented outward, of the volume its formula says.

use brickfield_bench_data::judge::mesh::{MeshFindings, check, check_soup};
use brickfield_bench_data::pile::{bead_pile, lattice_pile, random_pile};
use brickfield_bench_data::shapes::{
    BeadEnd, ConvexSection, Polygon, cuboid, extrude, helix, icosphere, octahedron, slant, spiked_cube,
    spiral_tube, sweep, tetrahedron, torus,
};
use brickfield_bench_data::{Mesh, Rng};
use proptest::prelude::*;

fn judged(mesh: &Mesh) -> MeshFindings {
    let report = check(&mesh.vertices, &mesh.triangles);
    assert!(report.is_closed_manifold() && report.is_clean(), "{report}");
    assert!((report.area / mesh.area() - 1.0).abs() < 1e-9);
    assert!((report.signed_volume / mesh.signed_volume() - 1.0).abs() < 1e-9);
    report
}

/// Judges the mesh and compares volume and genus.
fn solid(mesh: &Mesh, volume: f64, genus: i64) {
    let report = judged(mesh);
    assert!(
        (report.signed_volume - volume).abs() < 1e-9 * volume,
        "{} is not {volume}",
        report.signed_volume
    );
    assert_eq!(report.genus(), Some(genus));
    assert_eq!(report.components, 1);
}

#[test]
fn exact_volumes() {
    solid(&cuboid([1.0, 2.0, 3.0], [3.0, 5.0, 7.0]), 24.0, 0);
    solid(&slant([3.0, 2.0, 4.0]), 24.0, 0);
    solid(&octahedron(3.0), 36.0, 0);
    solid(&tetrahedron([[0.0; 3], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 5.0]]), 5.0, 0);
    solid(&tetrahedron([[2.0, 0.0, 0.0], [0.0; 3], [0.0, 3.0, 0.0], [0.0, 0.0, 5.0]]), 5.0, 0);
    // A pyramid of height h on each side of the cube 2a adds 6·(4a²·h/3).
    solid(&spiked_cube(2.0, 2.0), 64.0 + 64.0, 0);
    solid(&spiked_cube(2.0, 6.0), 64.0 + 192.0, 0);
    solid(&spiked_cube(2.0, -1.0), 64.0 - 32.0, 0);
}

#[test]
fn prisms_have_their_polygons_area() {
    for (polygon, area) in [
        (Polygon::ell(5.0, 2.0), 16.0),
        (Polygon::slotted(7.0, 2.0), 49.0 - 15.0),
        (Polygon::diamond(3.0), 18.0),
        (Polygon::gear(1.0), 64.0 - 8.0),
        (Polygon::rack(4, 1.0), 18.0 - 4.0),
        (Polygon::regular(4, 1.0), 2.0),
    ] {
        assert!((polygon.area() - area).abs() < 1e-12);
        let prism = extrude(&polygon, -1.0, 2.0);
        assert_eq!(prism.triangles.len(), 4 * polygon.0.len() - 4);
        solid(&prism, 3.0 * area, 0);
    }
    let star = Polygon::star(7, 1.0, 3.0);
    solid(&extrude(&star, 0.0, 2.0), 2.0 * star.area(), 0);
}

#[test]
fn round_pieces_approach_their_formulas() {
    use std::f64::consts::PI;
    let sphere = icosphere(5, 2.0);
    assert_eq!(sphere.triangles.len(), 20 * 1024);
    assert_eq!(judged(&sphere).genus(), Some(0));
    assert!((sphere.signed_volume() / (PI * 32.0 / 3.0) - 1.0).abs() < 2e-3);
    let ring = torus(3.0, 1.0, 200, 100);
    assert_eq!(judged(&ring).genus(), Some(1));
    assert!((ring.signed_volume() / (6.0 * PI * PI) - 1.0).abs() < 2e-3);
    let spiral = spiral_tube(3, 32, 5.0, 0.7, 1.0);
    let length = helix(3, 32, 5.0, 0.7)
        .windows(2)
        .map(|p| (0..3).map(|a| (p[1][a] - p[0][a]).powi(2)).sum::<f64>().sqrt())
        .sum::<f64>();
    // Mitred joints keep section area times centre line: 16 sides of radius ½.
    let section = 8.0 * (PI / 8.0).sin() * 0.25;
    assert!((judged(&spiral).signed_volume / (section * length) - 1.0).abs() < 1e-9);
}

#[test]
fn a_bead_is_a_stadium_times_its_length() {
    let (width, height) = (2.0, 1.0);
    let section = ConvexSection::stadium(400, width, height);
    let path = [[0.0; 3], [5.0, 0.0, 0.0], [5.0, 4.0, 0.0], [9.0, 7.0, 0.0]];
    let bead = sweep(&path, &section, [0.0, 0.0, 1.0], BeadEnd::Flat);
    let area = height * (width - height) + std::f64::consts::PI * height * height / 4.0;
    assert!((judged(&bead).signed_volume / (area * 14.0) - 1.0).abs() < 1e-4);
    let (low, high) = bead.bounds();
    assert!((high[2] - 0.5).abs() < 1e-3 && (low[2] + 0.5).abs() < 1e-3);
    for steps in 1..5 {
        let round =
            sweep(&path, &ConvexSection::stadium(12, width, height), [0.0, 0.0, 1.0], BeadEnd::Fused(steps));
        assert_eq!(round.triangles.len() as u32, 2 * 12 * 3 + 4 * 12 * steps + 20);
        judged(&round);
    }
    let turned = [[0.0; 3], [0.0, 0.0, 2.0], [1.0, 0.0, 2.5]];
    judged(&sweep(&turned, &ConvexSection::ellipse(5, 0.3, 0.2), [0.0, 0.0, 1.0], BeadEnd::Flat));
}

#[test]
fn beads_of_the_pile_survive_rounding_to_f32() {
    for triangles in [1_000_000, 45_000_000] {
        let pile = bead_pile(1, triangles, [100.0, 100.0, 12.0]);
        for index in (0..pile.beads()).step_by(pile.beads() as usize / 50) {
            let report = check_soup(&pile.bead(index).soup());
            assert!(report.is_closed_manifold() && report.is_clean(), "bead {index}: {report}");
            assert_eq!((report.genus(), report.components), (Some(0), 1));
            assert!(report.signed_volume > 0.0);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn moving_a_piece_keeps_it_closed(seed: u64, size in 0.01..100.0f64, place in prop::array::uniform3(-1e3..1e3f64)) {
        let mut rng = Rng::new(seed);
        let piece = spiked_cube(1.0, 2.0);
        let volume = piece.signed_volume();
        let moved = piece.scaled([-size, size, size]).rotated_by(rng.quaternion()).translated(place);
        let moved = moved.rotated([1.0, rng.range(-1.0, 1.0), 0.5], rng.range(-9.0, 9.0));
        let report = judged(&moved);
        prop_assert!((report.signed_volume / (volume * size.powi(3)) - 1.0).abs() < 1e-6);
        prop_assert!((moved.flipped().signed_volume() / report.signed_volume + 1.0).abs() < 1e-9);
    }

    #[test]
    fn random_beads_are_closed(seed: u64, points in 2usize..30, sides in 3u32..20, rings in 0u32..4) {
        let mut rng = Rng::new(seed);
        let mut at = [0.0; 3];
        let mut path = vec![at];
        for _ in 1..points {
            at = [at[0] + 1.0, at[1] + rng.range(-0.7, 0.7), at[2] + rng.range(-0.7, 0.7)];
            path.push(at);
        }
        let cap = if rings == 0 { BeadEnd::Flat } else { BeadEnd::Fused(rings) };
        let bead = sweep(&path, &ConvexSection::ellipse(sides, 0.4, 0.3), [0.0, 0.0, 1.0], cap);
        let report = judged(&bead);
        prop_assert_eq!(report.genus(), Some(0));
        prop_assert!(report.signed_volume > 0.0);
    }

    #[test]
    fn random_stars_are_triangulated(seed: u64, corners in 3u32..40) {
        let mut rng = Rng::new(seed);
        let mut polygon = Polygon::regular(corners, 1.0);
        // Star-shaped about the origin, hence simple.
        for corner in &mut polygon.0 {
            let r = rng.range(0.1, 3.0);
            *corner = corner.map(|c| c * r);
        }
        let area = polygon.area();
        prop_assume!(area > 1e-3);
        solid(&extrude(&polygon, 0.0, 1.5), 1.5 * area, 0);
    }

    #[test]
    fn pieces_of_piles_are_closed(seed: u64, pieces in 1usize..20) {
        for piece in random_pile(seed, pieces) {
            judged(&piece);
        }
        prop_assert_eq!(random_pile(seed, pieces), random_pile(seed, pieces));
        for piece in lattice_pile(seed, pieces, 2, 16) {
            judged(&piece);
            let inside = |c: i32| (0..=32).contains(&c) && c % 2 == 0;
            prop_assert!(piece.lattice().iter().flatten().flatten().all(|&c| inside(c)));
        }
    }
}
