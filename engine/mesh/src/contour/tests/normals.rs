//! Normals of vertices, whatever these stand for.

use super::*;

/// A mesh with normals.
#[derive(Default, PartialEq)]
struct Shaded {
    mesh: TestMesh,
    normals: Vec<[f32; 3]>,
}

impl MeshSink for Shaded {
    fn wants_normals(&self) -> bool {
        true
    }
    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<()> {
        assert_eq!(positions.len(), normals.len());
        self.normals.extend_from_slice(normals);
        self.mesh.vertices(positions)
    }
    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        MeshSink::triangles(&mut self.mesh, facets)
    }
    fn finish(&mut self) -> Result<()> {
        self.mesh.finish()
    }
}

/// The mesh with normals, which are of length one and without it would have been none else.
fn shaded(tree: &MemoryTree, options: &ContourOptions) -> (Shaded, MeshSummary) {
    let mut shaded = Shaded::default();
    let summary = contour(tree, options, &mut shaded, &Silent).unwrap();
    assert!((shaded.mesh == mesh(tree, options).0), "normals change the mesh");
    for normal in &shaded.normals {
        assert!((dot(*normal, *normal).sqrt() - 1.0).abs() < 1e-6, "{normal:?}");
    }
    (shaded, summary)
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|n| f64::from(a[n]) * f64::from(b[n])).sum()
}

/// Least cosine of the angle between a vertex' normal and the direction from the centre of [`sphere`].
fn least_radial(shaded: &Shaded) -> f64 {
    let radial = |(p, normal): (&[f32; 3], &[f32; 3])| {
        let from = [p[0] - 0.13, p[1] + 0.21, p[2] - 0.08];
        dot(from, *normal) / dot(from, from).sqrt()
    };
    shaded.mesh.positions.iter().zip(&shaded.normals).map(radial).fold(1.0, f64::min)
}

fn cosine(degrees: f64) -> f64 {
    degrees.to_radians().cos()
}

#[test]
fn normals_of_spheres_point_outward_and_converge() {
    for (level, degrees) in [(0, 8.0), (1, 4.0), (2, 2.0)] {
        let least = least_radial(&shaded(&tree(&sphere(5.0), &uniform(level)), &options(0.0)).0);
        assert!(least > cosine(degrees), "level {level}: {}", least.acos().to_degrees());
    }
}

fn options(tolerance: f64) -> ContourOptions {
    ContourOptions { tolerance, ..Default::default() }
}

/// Vertices of mixed cells, on split faces, and on edges.
#[test]
fn normals_across_levels_point_outward() {
    let (mut on_faces, mut on_edges, mut mixed) = (0, 0, 0);
    for seed in part_or_all(0..2, 0..6) {
        let tree = tree(&sphere(5.5), &random_divide(seed, (1, 3), 60 + 10 * seed));
        let (shaded, summary) = shaded(&tree, &options(0.0));
        let least = least_radial(&shaded);
        assert!(least > cosine(9.0), "seed {seed}: {}", least.acos().to_degrees());
        mixed += summary.mixed_cells;
        on_edges += summary.edge_vertices;
        on_faces += summary.face_vertices;
    }
    assert!(mixed > 100 && on_edges > 100 && on_faces > 100, "{mixed} {on_edges} {on_faces}");
}

/// Marching cubes' vertices have their edge's own normal.
#[test]
fn normals_of_marched_spheres_are_those_of_the_sphere() {
    let marching = ContourOptions { method: ContourMethod::MarchingCubes, ..options(0.0) };
    let least = least_radial(&shaded(&tree(&sphere(5.0), &uniform(1)), &marching).0);
    assert!(least > cosine(0.02), "{}", least.acos().to_degrees());
    let everywhere = NoiseField {
        seed: 3,
        boxes: vec![[[1 << 19; 3], [31 << 19; 3]]],
        density: 120,
        radius: 0.0,
        quiet_bits: 24,
    };
    let (_, summary) = shaded(&tree(&everywhere, &uniform(0)), &marching);
    assert!(summary.edge_vertices > 100);
}

/// The sides of a box are what codes of normals make of them; all around an edge or corner it is a mean that no side
/// turns from.
#[test]
fn normals_of_a_box_are_those_of_its_sides() {
    let half = [4.03, 3.11, 2.07];
    let (tree, cell) = (tree(&rotated_box(half), &uniform(1)), root().spacing(1));
    for tolerance in [0.0, 0.01 * cell] {
        let (shaded, _) = shaded(&tree, &options(tolerance));
        let (mut flat, mut creased) = (0, 0);
        for (p, normal) in shaded.mesh.positions.iter().zip(&shaded.normals) {
            let (q, turned) = (to_box(p.map(f64::from)), to_box(normal.map(f64::from)));
            let near = |a: usize| q[a].abs() > half[a] - 2.0 * cell;
            let sides: Vec<usize> = (0..3).filter(|&a| near(a)).collect();
            for &a in &sides {
                let expected = if sides.len() == 1 { 1.0 - 1e-7 } else { -0.1 };
                assert!(turned[a] * q[a].signum() > expected, "{q:?} {turned:?}");
            }
            *(if sides.len() == 1 { &mut flat } else { &mut creased }) += 1;
        }
        let is_merged = tolerance > 0.0;
        assert!(creased > 0 && (is_merged || flat > 2 * creased), "{flat} {creased}");
    }
}

#[test]
fn normals_of_merged_vertices_are_the_mean_of_what_they_stand_for() {
    let (sphere, cell) = (tree(&sphere(5.0), &uniform(2)), root().spacing(2));
    let plain = mesh(&sphere, &options(0.0)).0;
    let (merged, _) = shaded(&sphere, &options(0.2 * cell));
    assert!(merged.normals.len() * 2 < plain.positions.len());
    let least = least_radial(&merged);
    assert!(least > cosine(12.0), "{}", least.acos().to_degrees());
}

/// A slab along the lattice with a ball on each quarter of its rim: of what is merged there are vertices of several leaves
/// in the middle of its sides.
#[test]
fn normals_of_vertices_of_several_leaves_are_those_of_their_sides() {
    let slab = ImplicitField(|p: [f64; 3]| {
        let q = p.map(f64::abs);
        let side = (q[0] - 5.3).max(q[1] - 5.3).max(q[2] - 1.1);
        let ball = [q[0] - 4.9, q[1] - 1.0, q[2] - 1.1].iter().map(|c| c * c).sum::<f64>().sqrt() - 0.4;
        side.min(ball)
    });
    let (merged, _) = shaded(&tree(&slab, &uniform(3)), &options(0.01));
    let in_the_middle = |p: &[f32; 3]| p[0].abs() < 3.9 && p[1].abs() < 3.9;
    let all = merged.mesh.positions.iter().zip(&merged.normals);
    let middle: Vec<_> = all.filter(|(p, _)| in_the_middle(p)).collect();
    // One for each node of 64 cells.
    assert_eq!(middle.len(), 8);
    for (p, normal) in middle {
        assert_eq!(*normal, [0.0, 0.0, p[2].signum()], "{p:?}");
    }
}

/// The normals of all edges of one sample, three at each of its cells, cancel.
#[test]
fn normals_that_cancel_leave_the_first() {
    struct Cancelling;
    impl SampledField for Cancelling {
        fn winding(&self, at: Units) -> i16 {
            i16::from(at == [16 << 19; 3])
        }
        fn crossing(&self, low: Units, high: Units) -> ([f64; 3], f64) {
            let axis = (0..3).position(|a| low[a] != high[a]).unwrap();
            let half = 3f64.sqrt() / 2.0;
            ([[1.0, 0.0, 0.0], [-0.5, half, 0.0], [-0.5, -half, 0.0]][axis], 0.5)
        }
    }
    let (shaded, _) = shaded(&tree(&Cancelling, &uniform(0)), &options(0.0));
    assert_eq!(shaded.normals[..8], [[1.0, 0.0, 0.0]; 8]);
}

/// Two sheets in one cell have normals of their own, and vertices on faces between them those of their sheet.
#[test]
fn normals_of_two_sheets_in_a_cell_are_their_own() {
    // A gap of 0.7 cells, turned so that it meets cells in all ways.
    let gap = ImplicitField(|p: [f64; 3]| {
        let q = to_box(p);
        let aside = (0..3).map(|a| q[a].abs() - 4.0).fold(f64::NEG_INFINITY, f64::max);
        aside.max(0.35 * 0.25 - q[2].abs())
    });
    let (shaded, summary) = shaded(&tree(&gap, &uniform(1)), &options(0.0));
    assert!(summary.face_vertices > 5, "{}", summary.face_vertices);
    let mut inner = 0;
    for (p, normal) in shaded.mesh.positions.iter().zip(&shaded.normals) {
        let (q, turned) = (to_box(p.map(f64::from)), to_box(normal.map(f64::from)));
        if q[2].abs() < 0.25 && q[0].abs() < 3.5 && q[1].abs() < 3.5 && q[2].abs() > 0.06 {
            assert!(-turned[2] * q[2].signum() > 1.0 - 1e-6, "{q:?} {turned:?}");
            inner += 1;
        }
    }
    assert!(inner > 1000, "{inner}");
}

/// Signs and normals of every kind, many splits, mixed cells and levels that have no Hermite edges.
#[test]
fn threads_and_cache_do_not_change_normals() {
    let noise = tree(&noise(5, 2, 4, 90, 4.0), &random_divide(5, (1, 3), part_or_all(64, 128)));
    let merging = tree(&rotated_box([4.0, 3.1, 2.0]), &random_divide(2, part_or_all((1, 2), (2, 3)), 128));
    for (tree, iso, tolerance) in [(&noise, 0.5, 0.0), (&noise, 1.0, 0.0), (&merging, 0.5, 0.02)] {
        let options = ContourOptions { iso, ..options(tolerance) };
        let (expected, _) = shaded(tree, &options);
        let all = [(1, 0), (3, 1 << 16), (2, 1 << 20), (3, usize::MAX)];
        for (threads, cache_bytes) in all.into_iter().take(part_or_all(2, 4)) {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut other = Shaded::default();
            let options = ContourOptions { cache_bytes, ..options.clone() };
            pool.install(|| contour(tree, &options, &mut other, &Silent)).unwrap();
            assert!(other == expected, "{threads} threads, {cache_bytes} bytes");
        }
    }
}
