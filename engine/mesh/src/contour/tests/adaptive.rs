//! Meshes with merged vertices against those without.

use super::meetings::{pairs, report};
use super::*;
use crate::contour::adaptive::EdgeFilter;
use crate::contour::polygons::{MergeMark, named_facets};
use crate::contour::stages;
use crate::contour::triangle_names::each_whole;

/// Edge of a cell of a level of the tests' root.
fn cell(level: u8) -> f64 {
    root().spacing(level)
}

fn merged(tree: &MemoryTree, tolerance: f64) -> (TestMesh, MeshSummary) {
    merged_where(tree, tolerance, false)
}

fn merged_where(tree: &MemoryTree, tolerance: f64, follow_creases: bool) -> (TestMesh, MeshSummary) {
    let (mesh, summary) = mesh(tree, &ContourOptions { tolerance, follow_creases, ..Default::default() });
    mesh.check();
    (mesh, summary)
}

fn root_of(parent: &mut [u32], mut n: u32) -> u32 {
    while parent[n as usize] != n {
        parent[n as usize] = parent[parent[n as usize] as usize];
        n = parent[n as usize];
    }
    n
}

/// Euler characteristics of the shells, sorted: V − E + F with 2·E = 3·F.
fn shells(mesh: &TestMesh) -> Vec<i64> {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for [a, b, c] in mesh.triangles() {
        for other in [b, c] {
            let (x, y) = (root_of(&mut parent, a), root_of(&mut parent, other));
            parent[x as usize] = y;
        }
    }
    let mut doubled = std::collections::BTreeMap::new();
    for n in 0..parent.len() as u32 {
        *doubled.entry(root_of(&mut parent, n)).or_insert(0) += 2;
    }
    for [a, ..] in mesh.triangles() {
        *doubled.entry(root_of(&mut parent, a)).or_insert(0) -= 1;
    }
    let mut all: Vec<i64> = doubled.into_values().map(|twice| twice / 2).collect();
    all.sort_unstable();
    all
}

/// Merges with three tolerances; the surface must keep its shells and their genera, and what it encloses within
/// `slack` times the tolerance times its area.
fn keeps_its_topology(tree: &MemoryTree, level: u8, slack: f64) -> [u64; 3] {
    let (plain, expected) = checked(tree);
    let expected_shells = shells(&plain);
    [0.01, 0.1, 0.5].map(|cells| {
        let tolerance = cells * cell(level);
        let (mesh, summary) = merged(tree, tolerance);
        assert_eq!(shells(&mesh), expected_shells, "at {cells} cells");
        assert!(summary.triangles <= expected.triangles);
        let moved = (summary.volume - expected.volume).abs();
        // A tenth of a cell is what the crossings do not see.
        let most = slack * (tolerance + 0.1 * cell(level)) * expected.area;
        assert!(moved <= most, "{moved} of {most} at {cells} cells");
        summary.triangles
    })
}

#[test]
fn smooth_shapes_keep_their_topology() {
    let mut mixed = 0;
    for seed in (0..4).step_by(part_or_all(3, 1)) {
        let tree = tree(&sphere(5.5), &random_divide(seed, (1, 3), 60 + 30 * seed));
        mixed += checked(&tree).1.mixed_cells;
        keeps_its_topology(&tree, 1, 1.0);
    }
    assert!(mixed > 0);
    let overlap = Overlap(rotated_box([3.0, 5.0, 0.4]), sphere(3.0));
    let [.., coarsest] = keeps_its_topology(&tree(&overlap, &uniform(2)), 2, 1.0);
    assert!(coarsest * 8 < checked(&tree(&overlap, &uniform(2))).1.triangles);
    for seed in part_or_all(0..1, 0..3) {
        let needle = rotated_box([0.06, 6.0, 0.09]);
        keeps_its_topology(&tree(&needle, &random_divide(seed, (0, 4), 100)), 0, 1.0);
    }
}

#[test]
fn noise_keeps_its_topology() {
    let mut merged = 0;
    for seed in (0..10).step_by(part_or_all(3, 1)) {
        let (top, bottom) = ((seed % 2) as u8, 3);
        let shape = noise_of_several_sizes(seed, 30 + 18 * seed);
        let tree = tree(&shape, &random_divide(seed, (top, bottom), 90));
        let before = checked(&tree).1.triangles;
        // Planes of noise say nothing of what it encloses.
        let [.., after] = keeps_its_topology(&tree, 1, f64::INFINITY);
        merged += usize::from(after < before);
    }
    assert!(merged >= part_or_all(2, 5), "{merged}");
    for seed in (0..4).step_by(part_or_all(2, 1)) {
        let everywhere = NoiseField {
            seed,
            boxes: vec![[[1 << 19; 3], [31 << 19; 3]]],
            density: 10 + 70 * seed,
            radius: 0.0,
            quiet_bits: 24,
        };
        keeps_its_topology(&tree(&everywhere, &uniform(0)), 0, f64::INFINITY);
    }
}

/// On trees of one level nothing meets, whatever the planes let through.
#[test]
fn merged_surfaces_meet_nowhere() {
    let apart = |tree: &MemoryTree, tolerance: f64| {
        let plain = checked(tree).1.triangles;
        let [triangles, _] = [false, true].map(|follow_creases| {
            let (mesh, summary) = merged_where(tree, tolerance, follow_creases);
            check(&mesh.welded()).unwrap();
            assert_eq!(pairs(&mesh), 0, "{} triangles at {tolerance}", summary.triangles);
            summary.triangles
        });
        [triangles, plain]
    };
    let mut all = [0; 2];
    for seed in (0..6).step_by(part_or_all(3, 1)) {
        let density = 20 + 36 * seed;
        for (noise, level) in [(noise(seed, 1, 5, density, 3.9), 1), (noise(seed, 1, 3, density, 0.0), 2)] {
            for tolerance in [0.5 * cell(level), 1e6] {
                let counts = apart(&tree(&noise, &uniform(level)), tolerance);
                (0..2).for_each(|n| all[n] += counts[n]);
            }
        }
    }
    assert!(all[0] < all[1], "{all:?}");
    for half in [[3.0, 2.0, 4.0], [0.4, 5.0, 0.3], [5.0, 4.0, 0.07]] {
        let other = ImplicitField(move |p: [f64; 3]| {
            let q = to_box([p[2] + 0.7, p[0] - 0.3, p[1]]);
            (0..3).map(|a| q[a].abs() - half[(a + 1) % 3]).fold(f64::NEG_INFINITY, f64::max)
        });
        let tree = tree(&Overlap(rotated_box(half), other), &uniform(2));
        for cells in part_or_all(&[0.1, 1.0][..], &[0.01, 0.1, 0.3, 1.0]) {
            let [after, before] = apart(&tree, cells * cell(2));
            assert!(after < before);
        }
    }
}

/// With planes that never object all that the rules of topology let through is merged.
#[test]
fn rules_of_topology_alone_keep_noise_manifold() {
    /// Crossings of noise whose planes are all alike.
    struct Alike(NoiseField);
    impl SampledField for Alike {
        fn winding(&self, at: Units) -> i16 {
            self.0.winding(at)
        }
        fn crossing(&self, _: Units, _: Units) -> ([f64; 3], f64) {
            ([0.6, 0.0, 0.8], 0.5)
        }
    }
    for seed in (0..12).step_by(part_or_all(5, 1)) {
        let noise = noise_of_several_sizes(seed, 20 + 18 * seed);
        let tree = tree(&Alike(noise), &random_divide(seed, ((seed % 2) as u8, 3), 90));
        let (plain, before) = checked(&tree);
        let (mesh, summary) = merged(&tree, 1e6);
        assert_eq!(shells(&mesh), shells(&plain));
        assert!(summary.triangles < before.triangles);
    }
    // A tilted sheet with holes and specks where bricks meet, so that there is something to merge across them.
    struct Torn(NoiseField, [f64; 3]);
    impl SampledField for Torn {
        fn winding(&self, at: Units) -> i16 {
            let below = (0..3).map(|a| self.1[a] * f64::from(at[a] - (1 << 23))).sum::<f64>() < 0.0;
            let is_within = at.iter().all(|&c| (1 << 21..7 << 21).contains(&c));
            i16::from(is_within && below) ^ self.0.winding(at)
        }
        fn crossing(&self, _: Units, _: Units) -> ([f64; 3], f64) {
            ([0.6, 0.0, 0.8], 0.5)
        }
    }
    for seed in (0..12).step_by(part_or_all(5, 1)) {
        let specks = noise(seed, 1, 1 + (seed % 3) as i32, 60, 0.0);
        let tilt = [0.31, -0.2 * (seed % 4) as f64, 0.9];
        let divide = random_divide(seed, (2, 3), if seed % 2 == 0 { 0 } else { 20 });
        let tree = tree(&Torn(specks, tilt), &divide);
        let (plain, before) = checked(&tree);
        let (mesh, summary) = merged(&tree, 1e6);
        assert_eq!(shells(&mesh), shells(&plain));
        println!("{} of {}", summary.triangles, before.triangles);
        assert!(summary.triangles < before.triangles);
    }
}

#[test]
#[ignore = "a sweep of half a minute and more: .ci/run has it"]
fn threads_and_cache_do_not_change_what_is_merged() {
    let noisy = tree(&noise(5, 2, 4, 90, 4.0), &random_divide(5, (1, 3), 128));
    let flat = tree(&rotated_box([4.03, 3.11, 2.07]), &uniform(2));
    for (tree, cells, follow_creases) in
        [(&noisy, 0.1, false), (&noisy, 0.1, true), (&flat, 0.02, false), (&flat, 0.02, true)]
    {
        let options = ContourOptions { tolerance: cells * cell(2), follow_creases, ..Default::default() };
        let (expected, summary) = mesh(tree, &options);
        let all = mesh(tree, &ContourOptions { tolerance: 0.0, ..options.clone() }).1.triangles;
        assert!(summary.triangles < all, "{} of {all}", summary.triangles);
        for (threads, cache_bytes) in [(1, 0), (2, 1 << 16), (3, 1 << 20), (2, usize::MAX)] {
            let options = ContourOptions { cache_bytes, ..options.clone() };
            gives_the_same(tree, &options, threads, (&expected, &summary));
        }
    }
}

/// The mesh is as manifold as ever, by place too, and has the triangles that would have been given up.
#[test]
fn what_meets_stays_where_it_is_not_looked_for() {
    let mut left = 0;
    let noisy = (part_or_all(1, 0)..6)
        .step_by(part_or_all(2, 1))
        .map(|seed| (tree(&noise(seed, 1, 5, 20 + 36 * seed, 3.9), &uniform(1)), 0.3 * cell(1)));
    let flat = (tree(&rotated_box([4.03, 3.11, 2.07]), &uniform(2)), 0.02 * cell(2));
    for (tree, tolerance) in noisy.chain([flat]) {
        let options = ContourOptions { tolerance, ..Default::default() };
        let (_, free) = mesh(&tree, &options);
        let options = ContourOptions { intersection_free: false, ..options };
        let (with_pairs, summary) = mesh(&tree, &options);
        with_pairs.check();
        check(&with_pairs.welded()).unwrap();
        assert!(summary.vertices <= free.vertices, "{} {}", summary.vertices, free.vertices);
        left += report(&with_pairs).intersections.pairs;
        for (threads, cache_bytes) in [(1, 0), (2, 1 << 16)] {
            let options = ContourOptions { cache_bytes, ..options.clone() };
            gives_the_same(&tree, &options, threads, (&with_pairs, &summary));
        }
    }
    assert!(left > part_or_all(5, 20), "{left}");
}

/// What is given up for a triangle without a merged vertex is at its own polygon.
#[test]
fn polygons_with_merged_vertices_are_told_apart() {
    let tree = tree(&sphere(5.5), &uniform(1));
    let options = ContourOptions { tolerance: 0.2 * cell(1), ..Default::default() };
    let mut field = stages::field(&tree, level(options.iso).unwrap(), &options).unwrap();
    stages::merge_across(&mut field, false, &Silent).unwrap();
    let mut count = 0;
    for leaf in 0..field.leaves.len() as u32 {
        let (bytes, _) = named_facets(&field, leaf, &EdgeFilter::default()).unwrap();
        let facets: Vec<MeshTriangle> = each_whole(&bytes).collect();
        let mark = |facet: &MeshTriangle| MergeMark::split(facet.ids[0]).1;
        for polygon in facets.chunk_by(|a, b| mark(a) == mark(b)).filter(|all| mark(&all[0]) != 0) {
            assert!(polygon.len() <= 2, "{polygon:?}");
            count += 1;
        }
    }
    assert!(count > 300, "{count}");
}

#[test]
fn flat_faces_collapse_and_edges_stay_sharp() {
    let half = [4.03, 3.11, 2.07];
    let tree = tree(&rotated_box(half), &uniform(2));
    let (plain, _) = checked(&tree);
    let size = cell(2);
    let (mesh, summary) = merged(&tree, 0.01 * size);
    let exact = 8.0 * half.iter().product::<f64>();
    assert!((summary.volume / exact - 1.0).abs() < 2e-3, "{}", summary.volume / exact);
    let in_box = |p: &[f32; 3]| to_box(p.map(f64::from));
    // Distances of a point of the surface from the faces beside its own.
    let from_crease = |q: [f64; 3]| {
        let mut off = [0, 1, 2].map(|a: usize| (q[a].abs() - half[a]).abs());
        off.sort_by(f64::total_cmp);
        off[1]
    };
    let flat = |mesh: &TestMesh| {
        let is_flat = |f: &&MeshTriangle| f.corners.iter().all(|p| from_crease(in_box(p)) > 2.0 * size);
        mesh.facets.iter().filter(is_flat).count()
    };
    let (before, after) = (flat(&plain), flat(&mesh));
    // Triangles that face against the face that they are on.
    let folded = |mesh: &TestMesh| {
        let is_folded = |f: &&MeshTriangle| {
            let [a, b, c] = f.corners.each_ref().map(|p| glam::DVec3::from(in_box(p)));
            let middle = (a + b + c) / 3.0;
            let off = [0, 1, 2].map(|n| (middle[n].abs() - half[n]).abs());
            let face = (0..3).min_by(|&m, &n| off[m].total_cmp(&off[n])).unwrap();
            (b - a).cross(c - a)[face] * middle[face] < 0.0
        };
        mesh.facets.iter().filter(is_folded).count()
    };
    println!("{} of {} triangles, {after} of {before} flat ones", mesh.facets.len(), plain.facets.len());
    println!("{} of {} are folded", folded(&mesh), folded(&plain));
    assert!(folded(&mesh) <= folded(&plain) + 2);
    assert!(after * 100 < before, "{after} of {before}");
    // No vertex is farther from the surface than before but by the tolerance.
    let off = |mesh: &TestMesh| {
        let error = |p| {
            let q = in_box(p);
            let signed = [0, 1, 2].map(|a: usize| q[a].abs() - half[a]);
            let inside = signed.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let outside = signed.iter().map(|c| c.max(0.0).powi(2)).sum::<f64>().sqrt();
            if inside > 0.0 { outside } else { -inside }
        };
        mesh.positions.iter().map(error).fold(0.0, f64::max)
    };
    assert!(off(&mesh) <= off(&plain) + 0.02 * size);
    for corner in 0..8 {
        let at: [f64; 3] = std::array::from_fn(|a| if corner >> a & 1 == 1 { half[a] } else { -half[a] });
        let all = mesh.positions.iter().map(|p| distance(in_box(p), at) / size);
        assert!(all.fold(f64::INFINITY, f64::min) < 0.05);
    }
    // The mesh follows every crease, but for the places where no cell that the crease passes knows of it.
    let mut missed = 0;
    for (crease, step) in (0..12).flat_map(|crease| (1..20).map(move |step| (crease, step))) {
        let along = crease / 4;
        let mut at: [f64; 3] = std::array::from_fn(|a| {
            let bit = crease >> usize::from((a + 2 - along) % 3 == 0) & 1;
            if bit == 1 { half[a] } else { -half[a] }
        });
        at[along] = half[along] * (f64::from(step) / 10.0 - 1.0);
        let nearest = to_mesh(&mesh, at, in_box);
        if nearest > 0.02 * size {
            let before = to_mesh(&plain, at, in_box);
            assert!(nearest < before + 0.05 * size, "{at:?}: {} after {}", nearest / size, before / size);
            missed += 1;
        }
    }
    assert!(missed < 24, "{missed}");
}

/// The inside of a box along the axes, none of whose faces lies on samples.
fn cuboid(half: [f64; 3]) -> impl SampledField {
    ImplicitField(move |p: [f64; 3]| (0..3).map(|a| p[a].abs() - half[a]).fold(f64::NEG_INFINITY, f64::max))
}

/// How many leaves have cells whose vertices are those of other leaves.
fn sharing_leaves(tree: &MemoryTree, tolerance: f64) -> usize {
    let options = ContourOptions { tolerance, ..Default::default() };
    let mut field = stages::field(tree, level(options.iso).unwrap(), &options).unwrap();
    stages::merge_across(&mut field, false, &Silent).unwrap();
    let is_sharing = |leaf: &u32| {
        let vertices = field.vertices(*leaf).unwrap();
        let count = vertices.cells.len() as u32;
        let is_kept = |vertex: &u32| !vertices.cells.extras.iter().any(|extra| extra.vertex == *vertex);
        (0..count).filter(is_kept).any(|vertex| vertices.vertex(vertex).leaf != *leaf)
    };
    (0..field.leaves.len() as u32).filter(is_sharing).count()
}

#[test]
fn flat_faces_merge_across_bricks() {
    let half = [5.03, 4.11, 3.07];
    let size = cell(3);
    for (name, tree) in
        [("along", tree(&cuboid(half), &uniform(3))), ("turned", tree(&rotated_box(half), &uniform(3)))]
    {
        let (plain, before) = checked(&tree);
        let (mesh, summary) = merged(&tree, 0.01 * size);
        check(&mesh.welded()).unwrap();
        assert_eq!(shells(&mesh), shells(&plain));
        let place = |p: &[f32; 3]| match name {
            "along" => p.map(f64::from),
            _ => to_box(p.map(f64::from)),
        };
        // Vertices in the middle of a face, more than a brick away from its edges.
        let is_inner = |p: &&[f32; 3]| {
            let at = place(p);
            let mut off: Vec<f64> = (0..3).map(|a| (at[a].abs() - half[a]).abs()).collect();
            off.sort_by(f64::total_cmp);
            off[1] > 40.0 * size
        };
        let inner = |mesh: &TestMesh| mesh.positions.iter().filter(is_inner).count();
        for p in plain.positions.iter().filter(is_inner).step_by(997) {
            let p = p.map(f64::from);
            let off = to_mesh(&mesh, p, |p| p.map(f64::from)) / size;
            assert!(off < 0.012, "{name}: {off} at {p:?}");
        }
        let sharing = sharing_leaves(&tree, 0.01 * size);
        println!(
            "{name}: {} of {} triangles, {} of {} vertices within faces, {sharing} leaves share vertices",
            summary.triangles,
            before.triangles,
            inner(&mesh),
            inner(&plain)
        );
        assert!(name == "turned" || sharing > 0);
        assert!(summary.triangles * 100 < before.triangles);
        let exact = 8.0 * half.iter().product::<f64>();
        assert!((summary.volume / exact - 1.0).abs() < 1e-3, "{}", summary.volume / exact);
        // No vertex is farther from the surface than it was but by the tolerance.
        let off = |mesh: &TestMesh| {
            let one = |p| (0..3).map(|a| place(p)[a].abs() - half[a]).fold(f64::NEG_INFINITY, f64::max).abs();
            mesh.positions.iter().map(one).fold(0.0, f64::max)
        };
        assert!(
            off(&mesh) <= off(&plain) + 0.01 * size,
            "{} after {}",
            off(&mesh) / size,
            off(&plain) / size
        );
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|n| (a[n] - b[n]).powi(2)).sum::<f64>().sqrt()
}

/// Distance of a point from the mesh, whose vertices `place` puts into the point's frame.
fn to_mesh(mesh: &TestMesh, p: [f64; 3], place: impl Fn(&[f32; 3]) -> [f64; 3]) -> f64 {
    let p = glam::DVec3::from(p);
    let one = |facet: &MeshTriangle| {
        let [a, b, c] = facet.corners.each_ref().map(|corner| glam::DVec3::from(place(corner)));
        let n = (b - a).cross(c - a);
        let is_inside = [(a, b), (b, c), (c, a)].iter().all(|&(s, t)| (t - s).cross(p - s).dot(n) >= 0.0);
        if is_inside && n.length_squared() > 0.0 {
            return (p - a).dot(n).abs() / n.length();
        }
        let to_segment = |(s, t): (glam::DVec3, glam::DVec3)| {
            let along = (p - s).dot(t - s) / (t - s).length_squared().max(1e-300);
            (s + along.clamp(0.0, 1.0) * (t - s)).distance(p)
        };
        [(a, b), (b, c), (c, a)].map(to_segment).into_iter().fold(f64::INFINITY, f64::min)
    };
    mesh.facets.iter().map(one).fold(f64::INFINITY, f64::min)
}

/// The distance that one in a thousand exceeds.
fn percentile(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() * 999 / 1000]
}

#[test]
fn both_ways_the_surface_is_within_the_tolerance() {
    type Distance = Box<dyn Fn([f64; 3]) -> f64 + Sync>;
    let ball =
        |centre: [f64; 3], radius: f64| -> Distance { Box::new(move |p| distance(p, centre) - radius) };
    let first = ball([0.13, -0.21, 0.08], 4.0);
    let both: Distance = {
        let (a, b) = (ball([0.13, -0.21, 0.08], 4.0), ball([2.63, 0.97, 1.11], 3.0));
        Box::new(move |p| a(p).min(b(p)))
    };
    let half = [4.03, 3.11, 2.07];
    let cuboid: Distance = Box::new(move |p| {
        let q: [f64; 3] = std::array::from_fn(|a| to_box(p)[a].abs() - half[a]);
        let outside = q.iter().map(|c| c.max(0.0).powi(2)).sum::<f64>().sqrt();
        outside + q.into_iter().fold(f64::NEG_INFINITY, f64::max).min(0.0)
    });
    for (name, shape) in [("sphere", first), ("box", cuboid), ("union", both)] {
        let tree = tree(&ImplicitField(&shape), &uniform(2));
        let (plain, _) = checked(&tree);
        for cells in [0.01, 0.1, 0.5] {
            let size = cell(2);
            let (mesh, summary) = merged(&tree, cells * size);
            let mut there = Vec::new();
            for facet in &mesh.facets {
                for n in 0..4u64 {
                    let [mut s, mut t] = [1, 2].map(|salt| (hash(n ^ salt << 32) & 0xffff) as f64 / 65536.0);
                    if s + t > 1.0 {
                        (s, t) = (1.0 - s, 1.0 - t);
                    }
                    let [a, b, c] = facet.corners.map(|p| p.map(f64::from));
                    let p = std::array::from_fn(|k| a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]));
                    there.push(shape(p).abs() / size);
                }
            }
            // Points of the exact surface: vertices of the finer mesh, pulled onto it.
            let step = plain.positions.len() / part_or_all(250, 1000) + 1;
            let back = plain.positions.iter().step_by(step).map(|p| {
                let mut p = p.map(f64::from);
                for _ in 0..3 {
                    let slope: [f64; 3] = std::array::from_fn(|a| {
                        let (mut q, mut r) = (p, p);
                        q[a] += 1e-6;
                        r[a] -= 1e-6;
                        (shape(q) - shape(r)) / 2e-6
                    });
                    let off = shape(p) / slope.iter().map(|c| c * c).sum::<f64>().max(0.1);
                    p = std::array::from_fn(|a| p[a] - off * slope[a]);
                }
                to_mesh(&mesh, p, |p| p.map(f64::from)) / size
            });
            let (there, back) = (percentile(there), percentile(back.collect()));
            println!(
                "{name} at {cells} cells: {} of {} triangles, {there:.4} there, {back:.4} back",
                summary.triangles,
                plain.facets.len()
            );
            assert!(there <= cells + 0.1 && back <= cells + 0.1);
        }
    }
}

#[test]
fn a_tolerance_is_a_length() {
    for tolerance in [-1.0, f64::NAN, f64::INFINITY] {
        let options = ContourOptions { tolerance, ..Default::default() };
        let result = contour(&tree(&sphere(1.0), &uniform(0)), &options, &mut TestMesh::default(), &Silent);
        assert!(matches!(result, Err(Error::Setting { .. })));
    }
}
