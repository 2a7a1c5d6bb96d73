//! Marching cubes.

use super::*;

fn marching(iso: f64) -> ContourOptions {
    ContourOptions { iso, method: ContourMethod::MarchingCubes, ..Default::default() }
}

#[test]
fn marched_spheres_are_manifold_and_their_volumes_converge() {
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 5.0f64.powi(3);
    let mut error = 1e9;
    for level in 0..=2 {
        let tree = tree(&sphere(5.0), &uniform(level));
        let (mesh, summary) = mesh(&tree, &marching(0.5));
        mesh.check();
        check(&mesh.welded()).unwrap();
        assert!(summary.volume > 0.0, "outward");
        let now = (summary.volume / exact - 1.0).abs();
        assert!(now < error / 3.0, "level {level}: {now} after {error}");
        error = now;
        assert_eq!(mesh.positions.len() * 2 - 4, mesh.facets.len());
        // Every vertex is on a lattice edge, hence on the sphere.
        for p in &mesh.positions {
            let [x, y, z] = p.map(f64::from);
            let r = ((x - 0.13).powi(2) + (y + 0.21).powi(2) + (z - 0.08).powi(2)).sqrt();
            assert!((r - 5.0).abs() < 1e-4, "{p:?}");
        }
    }
    assert!(error < 5e-4);
}

/// Random signs, so that all corner masks come next to each other, and normals that decide ambiguous faces at random.
#[test]
fn marched_noise_is_manifold_for_all_threads_and_sinks() {
    let mut middles = 0;
    for seed in 0..6 {
        let density = 30 + 45 * seed;
        let boxes = vec![[[1 << 19; 3], [31 << 19; 3]]];
        let everywhere = NoiseField { seed, boxes, density, radius: 0.0, quiet_bits: 24 };
        for (shape, level) in [(everywhere, 0), (noise(seed, 1, 5, density, 3.9), 1)] {
            let tree = tree(&shape, &uniform(level));
            for iso in [0.5, 1.5] {
                let (mesh, summary) = mesh(&tree, &marching(iso));
                mesh.check();
                middles += summary.edge_vertices;
                gives_the_same(&tree, &marching(iso), 3, (&mesh, &summary));
            }
        }
    }
    assert!(middles > 1000, "{middles}");
}

#[test]
fn surfaces_across_levels_are_refused() {
    let refused = |tree: &MemoryTree, options| contour(tree, &options, &mut TestMesh::default(), &Silent);
    let uneven = tree(&sphere(5.5), &random_divide(3, (1, 3), 128));
    let message = refused(&uneven, marching(0.5)).unwrap_err().to_string();
    assert!(message.contains("different sizes") && message.contains("`level`"), "{message}");
    // Coarse leaves beside the surface, none of which it meets.
    let shell = |key: NodeKey| {
        let half = root().spacing(key.level()) * 16.0;
        let centre = world(key.base().map(f64::from)).map(|c| c + half);
        let r = centre.iter().map(|c| c * c).sum::<f64>().sqrt();
        key.level() < 3 && (r - 5.5).abs() < 1.8 * half + 0.3
    };
    let (mesh, _) = mesh(&tree(&sphere(5.5), &shell), &marching(0.5));
    mesh.check();
    let merged = ContourOptions { tolerance: 0.1, ..marching(0.5) };
    assert!(refused(&tree(&sphere(5.0), &uniform(0)), merged).unwrap_err().to_string().contains("keeps all"));
}
