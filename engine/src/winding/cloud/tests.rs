//! Clouds sampled from meshes against the meshes.

use super::*;
use crate::ingest::Facet;
use crate::progress::Silent;
use crate::winding::winding_at;
use brickfield_bench_data::Rng;

/// Points scattered evenly over a mesh, with its normals.
fn scattered(facets: &[Facet], count: usize, rng: &mut Rng) -> PointCloud {
    let normal = |t: &Facet| -> [f64; 3] {
        let e = |i: usize, a: usize| t[i][a] - t[0][a];
        [(1, 2), (2, 0), (0, 1)].map(|(a, b)| e(1, a) * e(2, b) - e(1, b) * e(2, a))
    };
    let area = |t: &Facet| normal(t).iter().map(|c| c * c).sum::<f64>().sqrt();
    let mut sums = vec![0.0];
    facets.iter().for_each(|t| sums.push(sums[sums.len() - 1] + area(t)));
    let mut cloud = PointCloud::default();
    for _ in 0..count {
        let at = rng.range(0.0, sums[facets.len()]);
        let t = &facets[sums.partition_point(|s| *s <= at).clamp(1, facets.len()) - 1];
        let (mut u, mut v) = (rng.range(0.0, 1.0), rng.range(0.0, 1.0));
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        cloud
            .points
            .push(std::array::from_fn(|a| t[0][a] + u * (t[1][a] - t[0][a]) + v * (t[2][a] - t[0][a])));
        cloud.normals.push(normal(t));
    }
    cloud
}

fn torus() -> Vec<Facet> {
    brickfield_bench_data::shapes::torus(10.0, 4.0, 64, 48).facets().collect()
}

fn root_of(cloud: &PointCloud) -> RootCube {
    let (min, max) = cloud.bounds();
    RootCube::around(min, max).unwrap()
}

fn points_around(root: RootCube, count: usize, rng: &mut Rng) -> Vec<[f64; 3]> {
    let unit = |rng: &mut Rng| 2.0 * rng.range(0.0, 8_388_607.0).floor() + 1.0;
    (0..count).map(|_| root.to_world(std::array::from_fn(|_| unit(rng)))).collect()
}

/// Share of the points farther than two spacings from the cloud whose side is that of the mesh.
fn right_share(mesh: &Vec<Facet>, cloud: &PointCloud, rng: &mut Rng) -> f64 {
    let root = root_of(cloud);
    let field = CloudField::new(cloud, root, &Silent).unwrap();
    let nearest = KdTree::new(&cloud.points);
    let spacing = |p: [f64; 3]| nearest.around(p, 2)[1].squared.sqrt();
    let mean = cloud.points.iter().step_by(50).map(|p| spacing(*p)).sum::<f64>()
        / cloud.points.iter().step_by(50).count() as f64;
    let mut points = points_around(root, 4000, rng);
    points.retain(|p| nearest.around(*p, 1)[0].squared.sqrt() > 2.0 * mean);
    let found = field.winding_at(root, &points, 1e-3, &Silent).unwrap();
    let truth = winding_at(&[mesh], root, &points, &Silent).unwrap();
    let right = found.iter().zip(&truth).filter(|(w, t)| (**w > 0.5) == (**t > 0)).count();
    assert!(truth.iter().filter(|t| **t > 0).count() > 200);
    right as f64 / points.len() as f64
}

#[test]
fn oriented_points_tell_the_side_of_the_mesh() {
    let mut rng = Rng::new(1);
    let cloud = scattered(&torus(), 30_000, &mut rng);
    let right = right_share(&torus(), &cloud, &mut rng);
    assert!(right >= 0.999, "{right}");
}

#[test]
fn the_tree_keeps_its_bound_and_ignores_threads_and_order() {
    let mut rng = Rng::new(2);
    let mut cloud = scattered(&torus(), 3_000, &mut rng);
    // Twice the same point, and one without direction.
    cloud.points.push(cloud.points[5]);
    cloud.normals.push(cloud.normals[5]);
    cloud.points.push([1.0, 2.0, 3.0]);
    cloud.normals.push([0.0; 3]);
    let root = root_of(&cloud);
    let field = CloudField::new(&cloud, root, &Silent).unwrap();
    assert_eq!(field.tree.elements().len(), 3_000);
    let mut points = points_around(root, 500, &mut rng);
    points.extend([[1e3, 0.0, 0.0], [1e9, 1.0, 1.0]]);
    let brute = field.brute_at(root, &points);
    for error in [1e-2, 1e-3, 1e-5] {
        let found = field.winding_at(root, &points, error, &Silent).unwrap();
        let worst = found.iter().zip(&brute).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst <= error, "{worst}");
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let found = one.install(|| {
        CloudField::new(&cloud, root, &Silent).unwrap().winding_at(root, &points, 1e-3, &Silent).unwrap()
    });
    assert_eq!(found, field.winding_at(root, &points, 1e-3, &Silent).unwrap());
}

#[test]
fn estimated_normals_point_outward() {
    let mut rng = Rng::new(3);
    let cloud = scattered(&torus(), 20_000, &mut rng);
    let mut bare = PointCloud { points: cloud.points.clone(), normals: Vec::new() };
    assert!(CloudField::new(&bare, root_of(&bare), &Silent).is_err());
    estimate_normals(&mut bare, &Silent).unwrap();
    let outward = |(a, b): &(&[f64; 3], &[f64; 3])| (0..3).map(|i| a[i] * b[i]).sum::<f64>() > 0.0;
    let right = bare.normals.iter().zip(&cloud.normals).filter(outward).count() as f64 / 20_000.0;
    assert!(right >= 0.995, "{right}");
    let side = right_share(&torus(), &bare, &mut rng);
    assert!(side >= 0.995, "{side}");
}

#[test]
fn parts_are_oriented_on_their_own_and_coinciding_points_have_no_normal() {
    let mut rng = Rng::new(4);
    let one = scattered(&torus(), 4_000, &mut rng);
    let mut two = PointCloud::default();
    for shift in [0.0, 100.0] {
        two.points.extend(one.points.iter().map(|p| [p[0] + shift, p[1], p[2] - shift]));
        two.normals.extend(&one.normals);
    }
    let mut bare = PointCloud { points: two.points.clone(), normals: Vec::new() };
    bare.points.extend([[500.0; 3]; 20]);
    estimate_normals(&mut bare, &Silent).unwrap();
    let outward = |(a, b): &(&[f64; 3], &[f64; 3])| (0..3).map(|i| a[i] * b[i]).sum::<f64>() > 0.0;
    assert!(bare.normals.iter().zip(&two.normals).filter(outward).count() > 7_900);
    assert!(bare.normals[8_000..].iter().all(|n| *n == [0.0; 3]));
}

/// A million points, with their normals and without: run with `cargo test -p brickfield-engine --lib
/// a_million_points -- --ignored --nocapture`.
#[test]
#[ignore = "a minute"]
fn a_million_points() {
    let mut rng = Rng::new(5);
    let mesh: Vec<Facet> = brickfield_bench_data::shapes::torus(10.0, 4.0, 192, 96).facets().collect();
    let cloud = scattered(&mesh, 1_000_000, &mut rng);
    let side = right_share(&mesh, &cloud, &mut rng);
    let mut bare = PointCloud { points: cloud.points.clone(), normals: Vec::new() };
    estimate_normals(&mut bare, &Silent).unwrap();
    let outward = |(a, b): &(&[f64; 3], &[f64; 3])| (0..3).map(|i| a[i] * b[i]).sum::<f64>() > 0.0;
    let right = bare.normals.iter().zip(&cloud.normals).filter(outward).count() as f64 / 1e6;
    println!("side of the mesh: {side}, normals: {right}");
    assert!(side >= 0.999 && right >= 0.995, "{side} {right}");
}
