//! Clouds sampled from meshes against the meshes.

use super::nearest::KdTree;
use super::*;
use crate::progress::Silent;
use crate::soup::{Facet, PointCloud};
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
        let at = std::array::from_fn(|a| t[0][a] + u * (t[1][a] - t[0][a]) + v * (t[2][a] - t[0][a]));
        cloud.push(at, Some(normal(t))).unwrap();
    }
    cloud
}

fn torus() -> Vec<Facet> {
    brickfield_bench_data::shapes::torus(10.0, 4.0, 64, 48).facets().collect()
}

fn root_of(surfels: &Surfels) -> RootCube {
    let (min, max) = surfels.bounds();
    RootCube::around(min, max).unwrap()
}

fn surfels_of(cloud: &PointCloud) -> Surfels {
    Surfels::of(cloud.clone(), &Silent).unwrap()
}

fn points_around(root: RootCube, count: usize, rng: &mut Rng) -> Vec<[f64; 3]> {
    let unit = |rng: &mut Rng| 2.0 * rng.range(0.0, 8_388_607.0).floor() + 1.0;
    (0..count).map(|_| root.to_world(std::array::from_fn(|_| unit(rng)))).collect()
}

/// Share of the points farther than two spacings from the cloud whose side is that of the mesh.
fn right_share(mesh: &Vec<Facet>, cloud: &PointCloud, rng: &mut Rng) -> f64 {
    let surfels = surfels_of(cloud);
    let root = root_of(&surfels);
    let field = CloudField::new(&surfels, root).unwrap();
    let nearest = KdTree::new(cloud.points.clone());
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
fn parts_with_sharp_edges_are_as_full_as_smooth_ones() {
    let mut rng = Rng::new(4);
    let cube = brickfield_bench_data::shapes::cuboid([-5.0; 3], [5.0; 3]);
    let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
    let tetrahedron: Vec<Facet> =
        faces.map(|face| face.map(|n: usize| corners[n].map(|c: f64| 5.0 * c))).to_vec();
    let straight: Vec<Facet> = cube.facets().collect();
    let turned: Vec<Facet> = cube.rotated([1.0, 2.0, 3.0], 0.7).facets().collect();
    for facets in [straight, turned, tetrahedron] {
        let cloud = scattered(&facets, 3_000, &mut rng);
        let surfels = surfels_of(&cloud);
        let root = root_of(&surfels);
        let w = CloudField::new(&surfels, root).unwrap().brute_at(root, &[[0.0; 3], [0.6, -0.3, 0.2]]);
        // Cells that went on beyond the edges made 1.15 of it, and 1.11 of the tetrahedron.
        assert!(w.iter().all(|w| (w.abs() - 1.0).abs() < 0.01), "{w:?}");
    }
}

#[test]
fn the_tree_keeps_its_bound_and_ignores_threads_and_order() {
    let mut rng = Rng::new(2);
    let mut cloud = scattered(&torus(), 3_000, &mut rng);
    // Twice the same point, and one without direction.
    cloud.push(cloud.points[5], Some(cloud.normals[5])).unwrap();
    cloud.push([1.0, 2.0, 3.0], Some([0.0; 3])).unwrap();
    let surfels = surfels_of(&cloud);
    assert_eq!((surfels.all.len(), surfels.void), (3_000, 2));
    let root = root_of(&surfels);
    let field = CloudField::new(&surfels, root).unwrap();
    let mut points = points_around(root, 500, &mut rng);
    // In the balls, at their middles and on their borders.
    for surfel in surfels.all.iter().step_by(10) {
        for share in [0.0, 0.4, 1.0] {
            points.push(std::array::from_fn(|a| {
                surfel.position[a] + share * surfel.radius * (0.3 + 0.4 * a as f64)
            }));
        }
    }
    points.extend([[1e3, 0.0, 0.0], [1e9, 1.0, 1.0]]);
    let brute = field.brute_at(root, &points);
    for error in [1e-2, 1e-3, 1e-5] {
        let found = field.winding_at(root, &points, error, &Silent).unwrap();
        let worst = found.iter().zip(&brute).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst <= error, "{worst}");
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let found = one.install(|| {
        CloudField::new(&surfels_of(&cloud), root).unwrap().winding_at(root, &points, 1e-3, &Silent).unwrap()
    });
    assert_eq!(found, field.winding_at(root, &points, 1e-3, &Silent).unwrap());
}

#[test]
fn estimated_normals_point_outward() {
    let mut rng = Rng::new(3);
    let cloud = scattered(&torus(), 20_000, &mut rng);
    let mut bare = PointCloud { points: cloud.points.clone(), ..PointCloud::default() };
    assert!(Surfels::of(bare.clone(), &Silent).is_err());
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
        let moved = |p: &[f64; 3]| [p[0] + shift, p[1], p[2] - shift];
        let oriented = one.points.iter().map(moved).zip(one.normals.iter());
        oriented.for_each(|(p, n)| two.push(p, Some(*n)).unwrap());
    }
    let mut bare = PointCloud { points: two.points.clone(), ..PointCloud::default() };
    bare.points.extend_from_slice(&[[500.0; 3]; 20]).unwrap();
    estimate_normals(&mut bare, &Silent).unwrap();
    let outward = |(a, b): &(&[f64; 3], &[f64; 3])| (0..3).map(|i| a[i] * b[i]).sum::<f64>() > 0.0;
    assert!(bare.normals.iter().zip(&two.normals).filter(outward).count() > 7_900);
    assert!(bare.normals[8_000..].iter().all(|n| *n == [0.0; 3]));
}

/// Far beyond the ball the field is the dipole's, within it is that of a dipole spread over the ball: here over many
/// small ones.
#[test]
fn a_spread_point_is_what_many_dipoles_add_up_to() {
    let root = RootCube { origin: [0.0; 3], edge: f64::from(1 << 24) };
    let middle = [8.0e6, 8.1e6, 7.9e6];
    let surfel = Surfel { position: middle, area: [3e11, -2e11, 5e11], radius: 1e6 };
    let dipole = Dipole::new(&surfel, root);
    let mut rng = Rng::new(6);
    for way in [[2.2e6, -1.0e6, 0.5e6], [0.6e6, 0.5e6, 0.3e6], [0.2e6, -0.3e6, 0.0]] {
        let p: [f64; 3] = std::array::from_fn(|a| middle[a] + way[a]);
        let (mut sum, mut weights) = (0.0, 0.0);
        for _ in 0..400_000 {
            let shift: [f64; 3] = std::array::from_fn(|_| rng.range(-1.0, 1.0));
            let weight = 1.0 - shift.iter().map(|c| c * c).sum::<f64>();
            let r: [f64; 3] = std::array::from_fn(|a| middle[a] + 1e6 * shift[a] - p[a]);
            let squared: f64 = r.iter().map(|c| c * c).sum();
            // What the nearest ones give has a mean of 0.
            if weight > 0.0 && squared > 1e10 {
                let along: f64 = (0..3).map(|a| surfel.area[a] * r[a]).sum();
                sum += weight * along / (4.0 * std::f64::consts::PI * squared * squared.sqrt());
            }
            weights += weight.max(0.0);
        }
        let found = dipole.seen_from(p);
        assert!((found - sum / weights).abs() < 0.02 * found.abs() + 1e-4, "{found} {}", sum / weights);
    }
}

#[test]
fn few_and_odd_points() {
    let up = [0.0, 0.0, 1.0];
    let cloud = |points: Vec<[f64; 3]>| PointCloud::of(points.clone(), vec![up; points.len()]);
    for none in [cloud(vec![[1.0; 3]]), cloud(vec![[1.0; 3]; 5])] {
        let surfels = surfels_of(&none);
        assert_eq!((surfels.all.len(), surfels.spacing), (0, 0.0));
    }
    // On a line, with normals of any length.
    let mut line = cloud((0..40).map(|i| [f64::from(i), 0.0, 0.0]).collect());
    line.normals.iter_mut().enumerate().for_each(|(i, n)| *n = n.map(|c| c * [1e-300, 1e300][i % 2]));
    let surfels = surfels_of(&line);
    assert!(surfels.all.len() == 40 && surfels.all.iter().all(|s| s.area[2] > 1.0 && s.area[2].is_finite()));
    estimate_normals(&mut line, &Silent).unwrap();
    assert!(line.normals.iter().flatten().all(|c| c.is_finite()));
    // Points that the sign of a zero tells apart coincide, and the order of points does not count.
    let mut grid = cloud((0..100).map(|i| [f64::from(i % 10), f64::from(i / 10), 0.0]).collect());
    grid.push([3.0, 4.0, -0.0], Some(up)).unwrap();
    let surfels = surfels_of(&grid);
    assert_eq!((surfels.all.len(), surfels.void, surfels.spacing), (100, 1, 1.0));
    grid.points.reverse();
    assert_eq!(surfels_of(&grid).all, surfels.all);
}

/// A million points, with their normals and without: run with `cargo test -p brickfield-winding --lib
/// a_million_points -- --ignored --nocapture`.
#[test]
#[ignore = "a minute"]
fn a_million_points() {
    let mut rng = Rng::new(5);
    let mesh: Vec<Facet> = brickfield_bench_data::shapes::torus(10.0, 4.0, 192, 96).facets().collect();
    let cloud = scattered(&mesh, 1_000_000, &mut rng);
    let side = right_share(&mesh, &cloud, &mut rng);
    let mut bare = PointCloud { points: cloud.points.clone(), ..PointCloud::default() };
    estimate_normals(&mut bare, &Silent).unwrap();
    let outward = |(a, b): &(&[f64; 3], &[f64; 3])| (0..3).map(|i| a[i] * b[i]).sum::<f64>() > 0.0;
    let right = bare.normals.iter().zip(&cloud.normals).filter(outward).count() as f64 / 1e6;
    println!("side of the mesh: {side}, normals: {right}");
    assert!(side >= 0.999 && right >= 0.995, "{side} {right}");
}
