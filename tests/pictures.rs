//! Sections and ray-cast pictures of real trees, against what geometry says.

use brickfield_bench_data::Mesh;
use brickfield_bench_data::shapes::{cuboid, icosphere};
use brickfield_engine::Silent;
use brickfield_engine::build::{TreeOptions, build_in_memory};
use brickfield_engine::lattice::{Axis, NodeKey, RootCube};
use brickfield_engine::render::{
    CutPlane, Focus, IsoSurface, Paint, Ray, RenderOptions, Scene, Stops, Style, View, VolumeStyle,
};
use brickfield_engine::section::{Contour, ContourLimits, Plane, contour, straighten};
use brickfield_engine::store::{BrickTree, MemoryTree, Refine};

type Soup = Vec<[[f64; 3]; 3]>;

fn soup(mesh: &Mesh) -> Soup {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize])).collect()
}

fn tree(soup: &Soup, options: TreeOptions) -> MemoryTree {
    let all = || soup.iter().flatten();
    let min = std::array::from_fn(|a| all().fold(f64::MAX, |m, v| m.min(v[a])));
    let max = std::array::from_fn(|a| all().fold(f64::MIN, |m, v| m.max(v[a])));
    let root = RootCube::around(min, max).expect("an extent");
    build_in_memory(&[soup], root, options).unwrap_or_else(|e| panic!("{e}"))
}

fn depth(depth: u8) -> TreeOptions {
    TreeOptions { depth, ..TreeOptions::default() }
}

fn cell(tree: &MemoryTree) -> f64 {
    tree.root().spacing(tree.keys().last().unwrap().level())
}

fn section(tree: &MemoryTree, axis: Axis, at: f64) -> Contour {
    let limits = ContourLimits { level: None, memory_bytes: 1 << 30 };
    contour(tree, Plane { axis, at }, limits, &Silent).unwrap_or_else(|e| panic!("{e}"))
}

/// Area of the cut through a soup: by Green's theorem over the stretches in which the plane meets triangles.
fn area_of_cut(soup: &Soup, axis: Axis, at: f64) -> f64 {
    let [u, v] = Plane { axis, at }.sides().map(Axis::index);
    let mut area = 0.0;
    for triangle in soup {
        let mut ends = Vec::new();
        for n in 0..3 {
            let (a, b) = (triangle[n], triangle[(n + 1) % 3]);
            let (da, db) = (a[axis.index()] - at, b[axis.index()] - at);
            if (da < 0.0) != (db < 0.0) {
                let t = da / (da - db);
                ends.push(([u, v].map(|c| a[c] + t * (b[c] - a[c])), da < 0.0));
            }
        }
        if let [(a, upward), (b, _)] = ends[..] {
            let (from, to) = if upward { (b, a) } else { (a, b) };
            area += (from[0] * to[1] - to[0] * from[1]) / 2.0;
        }
    }
    // Which way is left depends on the axes of the picture.
    area.abs()
}

#[test]
fn sections_have_the_area_of_the_cut_and_their_inside_to_the_left() {
    let mesh = soup(&icosphere(4, 10.0));
    let mut errors = Vec::new();
    for level in [1, 2, 3] {
        let tree = tree(&mesh, depth(level));
        let mut worst: f64 = 0.0;
        for axis in Axis::ALL {
            for at in [-9.1, -3.137, 0.0, 0.05, 6.6] {
                let found = section(&tree, axis, at);
                assert_eq!(found.loops.len(), 1, "{axis:?} {at}");
                let expected = area_of_cut(&mesh, axis, at);
                worst = worst.max((found.area - expected).abs() / expected);
            }
        }
        errors.push(worst);
    }
    // Of the second order: a quarter for each level.
    assert!(errors[0] < 5e-3 && errors[1] < 2e-3 && errors[2] < 5e-4, "{errors:?}");
    assert_eq!(section(&tree(&mesh, depth(2)), Axis::Z, 10.2), Contour::default());
}

/// A cone about z from z = 0 to `height`, of so many sides.
fn cone(radius: f64, height: f64, sides: usize) -> Soup {
    let at = |n: usize| {
        let (sin, cos) = (std::f64::consts::TAU * n as f64 / sides as f64).sin_cos();
        [radius * cos, radius * sin, 0.0]
    };
    (0..sides).flat_map(|n| [[at(n), at(n + 1), [0.0, 0.0, height]], [at(n + 1), at(n), [0.0; 3]]]).collect()
}

/// By how many cells the radius of the circle with a section's area is off, at 50 heights: the mean and the greatest; and
/// in how many sections the area is off by more than is said.
fn errors_of_radius(soup: &Soup, tree: &MemoryTree, axis: Axis, [low, high]: [f64; 2]) -> ([f64; 2], usize) {
    let (mut sum, mut worst, mut beyond) = (0.0, 0.0f64, 0);
    for n in 0..50 {
        let at = low + (high - low) * (f64::from(n) + 0.5) / 50.0;
        let (found, expected) = (section(tree, axis, at), area_of_cut(soup, axis, at));
        let radius = |area: f64| (area / std::f64::consts::PI).sqrt();
        let error = (radius(found.area) - radius(expected)).abs() / cell(tree);
        (sum, worst) = (sum + error, worst.max(error));
        beyond += usize::from((found.area - expected).abs() > found.area_error);
    }
    ([sum / 50.0, worst], beyond)
}

/// Between layers of samples as on them, along each axis.
#[test]
fn sections_at_any_height_are_the_part_s() {
    let (sphere, cone) = (soup(&icosphere(5, 10.0)), cone(10.0, 12.0, 240));
    let [of_sphere, of_cone] = [&sphere, &cone].map(|soup| tree(soup, depth(1)));
    let ends = cell(&of_sphere);
    for (name, soup, tree, axis, range, most) in [
        ("sphere", &sphere, &of_sphere, Axis::X, [ends - 10.0, 10.0 - ends], [0.002, 0.02]),
        ("sphere", &sphere, &of_sphere, Axis::Y, [ends - 10.0, 10.0 - ends], [0.002, 0.02]),
        ("sphere", &sphere, &of_sphere, Axis::Z, [ends - 10.0, 10.0 - ends], [0.002, 0.02]),
        ("cone", &cone, &of_cone, Axis::Z, [0.0, 12.0 - 3.0 * ends], [0.003, 0.03]),
    ] {
        let ([mean, worst], beyond) = errors_of_radius(soup, tree, axis, range);
        println!("{name} {axis:?}: mean {mean:.5}, worst {worst:.5} cells; {beyond} beyond what is said");
        assert!(mean < most[0] && worst < most[1] && beyond <= 2, "{name} {axis:?}: {mean} {worst} {beyond}");
    }
}

/// Round and straight boundaries of a real section: few points are left, and they are the section within the tolerance.
#[test]
fn straight_runs_are_merged_within_the_tolerance() {
    let mut mesh = soup(&icosphere(4, 10.0));
    mesh.extend(soup(&cuboid([4.0, -3.0, -9.0], [14.0, 3.0, 9.0])));
    let tree = tree(&mesh, depth(1));
    let whole = section(&tree, Axis::Z, 1.3);
    for (cells, fewer) in [(0.01, 3), (0.3, 10)] {
        let tolerance = cells * cell(&tree);
        let mut merged = whole.clone();
        straighten(&mut merged, tolerance);
        let points = |contour: &Contour| contour.loops.iter().map(Vec::len).sum::<usize>();
        assert!(points(&merged) * fewer < points(&whole), "{} of {}", points(&merged), points(&whole));
        assert_eq!((merged.area, merged.loops.len()), (whole.area, whole.loops.len()));
        for (before, after) in whole.loops.iter().zip(&merged.loops) {
            let farthest = before.iter().map(|point| from_line(after, *point)).fold(0.0, f64::max);
            assert!(
                farthest <= tolerance * (1.0 + 1e-9) && farthest > tolerance / 10.0,
                "{farthest} for {tolerance}"
            );
        }
    }
    let mut kept = whole.clone();
    straighten(&mut kept, 0.0);
    assert_eq!(kept, whole);
}

/// The distance of a point from a closed polyline.
fn from_line(line: &[[f64; 2]], [x, y]: [f64; 2]) -> f64 {
    let next = line.iter().cycle().skip(1);
    let off = |([ax, ay], [bx, by]): (&[f64; 2], &[f64; 2])| {
        let (run, rise) = (bx - ax, by - ay);
        let t = (((x - ax) * run + (y - ay) * rise) / (run * run + rise * rise)).clamp(0.0, 1.0);
        ((ax + t * run - x).powi(2) + (ay + t * rise - y).powi(2)).sqrt()
    };
    line.iter().zip(next).map(off).fold(f64::MAX, f64::min)
}

#[test]
fn flat_sides_are_exact_and_cavities_run_the_other_way() {
    let mut soup_of_boxes = soup(&cuboid([-5.0, -4.0, -3.0], [5.0, 4.0, 3.0]));
    let hole = soup(&cuboid([-1.03, -2.0, -1.0], [1.0, 2.011, 1.0]));
    soup_of_boxes.extend(hole.into_iter().map(|[a, b, c]| [a, c, b]));
    let tree = tree(&soup_of_boxes, depth(3));
    for at in [-0.9, 0.0, 0.013, 0.77] {
        let found = section(&tree, Axis::Z, at);
        assert_eq!(found.loops.len(), 2);
        let signed = |line: &[[f64; 2]]| -> f64 {
            let next = line.iter().cycle().skip(1);
            line.iter().zip(next).map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum()
        };
        let mut areas: Vec<f64> = found.loops.iter().map(|line| signed(line)).collect();
        areas.sort_by(f64::total_cmp);
        // Corners are where the sides meet, not cut off within their cell.
        let corner = 1e-3;
        assert!((areas[0] + 2.03 * 4.011).abs() < corner && (areas[1] - 80.0).abs() < corner, "{areas:?}");
        assert!((found.area - areas[0] - areas[1]).abs() < 1e-9);
        for [x, y] in found.loops.concat() {
            let on = |at: f64, side: f64| (at - side).abs() < 1e-4;
            let is_on_side = on(x.abs(), 5.0)
                || on(y.abs(), 4.0)
                || on(x, -1.03)
                || on(x, 1.0)
                || on(y, -2.0)
                || on(y, 2.011);
            assert!(is_on_side, "{x} {y}");
        }
    }
}

#[test]
fn loops_close_where_levels_meet() {
    let mesh = soup(&icosphere(3, 10.0));
    // Every other leaf is left coarse.
    let options = TreeOptions { refine: Refine::Stddev, stddev: 0.35, ..depth(4) };
    let tree = tree(&mesh, options);
    let levels: std::collections::BTreeSet<u8> = tree
        .keys()
        .into_iter()
        .filter(|key| tree.node(*key).is_some_and(|node| node.leaf && node.min < 1 && node.max >= 1))
        .map(|key| key.level())
        .collect();
    assert!(levels.len() > 1, "{levels:?}");
    for at in [-7.0, -2.5, 0.3, 4.4, 8.0] {
        let found = section(&tree, Axis::Z, at);
        let expected = area_of_cut(&mesh, Axis::Z, at);
        println!("{at}: {} for {expected}, ± {}", found.area, found.area_error);
        assert!((found.area / expected - 1.0).abs() < 0.01, "{} for {expected}", found.area);
    }
}

#[test]
fn points_are_bounded() {
    let tree = tree(&soup(&icosphere(3, 10.0)), depth(3));
    let limits = ContourLimits { level: None, memory_bytes: 10_000 };
    let error = contour(&tree, Plane { axis: Axis::X, at: 0.0 }, limits, &Silent).unwrap_err().to_string();
    assert!(error.contains("more than 39 points") && error.contains("`memory`"), "{error}");
}

fn options(style: fn() -> Style, view: View, cuts: Vec<CutPlane>) -> RenderOptions {
    RenderOptions {
        style: style(),
        cuts,
        size: [96, 72],
        supersample: 1,
        cell_pixels: 0.0,
        cache_bytes: 64 << 20,
        ..RenderOptions::of([[-10.0; 3], [10.0; 3]], view)
    }
}

/// Rays through the middle of every pixel, and where they first meet the part.
fn depth_map(tree: &MemoryTree, options: &RenderOptions) -> Vec<(Ray, Option<f64>)> {
    let scene = Scene::new(tree, options).unwrap_or_else(|e| panic!("{e}"));
    let [width, height] = options.size;
    let at = |n: u32| [f64::from(n % width) + 0.5, f64::from(n / width) + 0.5];
    let frame = scene.frames().next().expect("a picture");
    let rays: Vec<Ray> = (0..width * height).map(|n| frame.ray(at(n))).collect();
    let distances = frame.distances(&rays).unwrap_or_else(|e| panic!("{e}"));
    rays.into_iter().zip(distances).collect()
}

/// Where a ray enters a sphere about the origin.
fn sphere(ray: &Ray, radius: f64) -> Option<f64> {
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|n| a[n] * b[n]).sum::<f64>();
    let along = -dot(ray.origin, ray.direction);
    let beside = dot(ray.origin, ray.origin) - along * along;
    (beside < radius * radius).then(|| along - (radius * radius - beside).sqrt())
}

fn all_views() -> impl Iterator<Item = View> {
    View::NAMED
        .into_iter()
        .flat_map(|(_, [azimuth, elevation])| [0.0, 40.0].map(|opening| View { azimuth, elevation, opening }))
}

#[test]
fn every_ray_meets_a_sphere_within_half_a_cell_of_where_it_is() {
    let tree = tree(&soup(&icosphere(5, 10.0)), depth(2));
    let half = cell(&tree) / 2.0;
    let (mut met, mut worst): (usize, f64) = (0, 0.0);
    for view in all_views() {
        for (ray, found) in depth_map(&tree, &options(Style::solid, view, vec![])) {
            // The mesh lies within 0.01 of the sphere, and no ray says much of what it only touches: there the distance
            // from the surface counts, not that along the ray.
            let point =
                |t: f64| (0..3).map(|a| (ray.origin[a] + t * ray.direction[a]).powi(2)).sum::<f64>().sqrt();
            match (found, sphere(&ray, 10.0)) {
                (Some(found), Some(truth)) => {
                    let error = (found - truth).abs();
                    let grazing = sphere(&ray, 10.0 - half).is_none();
                    let off = if grazing { (point(found) - 10.0).abs() } else { error };
                    assert!(off < half, "{off} at {ray:?}");
                    worst = worst.max(off);
                    met += 1;
                }
                (Some(found), None) => assert!((point(found) - 10.0).abs() < half),
                (None, Some(_)) => assert!(sphere(&ray, 10.0 - half).is_none(), "a hole at {ray:?}"),
                (None, None) => {}
            }
        }
    }
    assert!(met > 20_000, "{met}");
    println!("{met} rays, at most {:.3} cells off", worst / half / 2.0);
}

#[test]
fn coarser_levels_are_off_by_less_than_a_pixel() {
    let tree = tree(&soup(&icosphere(5, 10.0)), depth(4));
    for view in all_views() {
        let fine = RenderOptions { size: [64, 48], ..options(Style::solid, view, vec![]) };
        // Twenty units of the part and its margins are 48 pixels high, and in perspective less than twice as large.
        let pixel = 2.0 * 20.0 / 48.0;
        let coarse = RenderOptions { cell_pixels: 1.0, ..fine.clone() };
        for (ray, found) in depth_map(&tree, &coarse) {
            match (found, sphere(&ray, 10.0 - pixel)) {
                (Some(found), Some(_)) => {
                    let truth = sphere(&ray, 10.0).expect("it meets the smaller one");
                    let slope = sphere(&ray, 10.0 - pixel).map_or(0.0, |inner| inner - truth);
                    assert!((found - truth).abs() < slope, "{found} for {truth} at {ray:?}");
                }
                (found, None) => assert!(found.is_none() || sphere(&ray, 10.0 + pixel).is_some(), "{ray:?}"),
                (None, Some(_)) => panic!("a hole at {ray:?}"),
            }
        }
        let read = |options: &RenderOptions| {
            let scene = Scene::new(&tree, options).unwrap();
            scene.frames().next().unwrap().draw(&Silent, |_| Ok(())).unwrap();
            scene.summary().made
        };
        let (coarse, fine) = (read(&coarse), read(&fine));
        assert!(coarse * 20 < fine, "{coarse} of {fine} bricks");
    }
}

#[test]
fn a_wall_between_the_samples_of_coarse_levels_is_drawn_all_the_same() {
    let thin = 0.05;
    let mut missed = 0;
    for z in [-7.77, -2.4, 1.31, 5.01] {
        let plate = soup(&cuboid([-10.0, -10.0, z], [10.0, 10.0, z + thin]));
        // Not about the plate, whose middle would be a sample.
        let root = RootCube::around([-10.0; 3], [10.0; 3]).expect("an extent");
        let tree = build_in_memory(&[&plate], root, depth(4)).unwrap_or_else(|e| panic!("{e}"));
        assert!(cell(&tree) < thin);
        missed += usize::from(tree.node(NodeKey::ROOT).expect("a root").max == 0);
        let view = View::named("top").unwrap();
        // A pixel is 1.2 units, so every level's cells are smaller.
        let some = RenderOptions { size: [24, 18], cell_pixels: 1.0, ..options(Style::solid, view, vec![]) };
        let mut met = 0;
        for (ray, found) in depth_map(&tree, &some) {
            if ray.origin[0].abs() < 9.5 && ray.origin[1].abs() < 9.5 {
                let found = ray.origin[2] - found.expect("a plate");
                assert!((found - z).abs() < 1.0, "{found} for {z}");
                met += 1;
            }
        }
        assert!(met > 100);
    }
    assert!(missed > 1, "the root's samples have all of them");
}

#[test]
fn cuts_and_boxes_open_the_part_where_they_say() {
    let tree = tree(&soup(&icosphere(5, 10.0)), depth(2));
    let half = cell(&tree) / 2.0;
    let cut = CutPlane { axis: Axis::Z, at: 2.5, above: true };
    let view = View::named("top").unwrap();
    let mut caps = 0;
    for (ray, found) in depth_map(&tree, &options(Style::solid, view, vec![cut])) {
        let beside = (ray.origin[0].powi(2) + ray.origin[1].powi(2)).sqrt();
        let rim = (100.0f64 - 2.5 * 2.5).sqrt();
        if beside < rim - 2.0 * half {
            let z = ray.origin[2] - found.expect("the sphere is below");
            assert!((z - 2.5).abs() < 1e-9, "{z}");
            caps += 1;
        }
    }
    assert!(caps > 1000);
    let nothing = vec![cut, CutPlane { axis: Axis::Z, at: 3.0, above: false }];
    let error = Scene::new(&tree, &options(Style::solid, view, nothing)).err().unwrap().to_string();
    assert!(error.contains("leave nothing"), "{error}");
}

#[test]
fn a_cavity_that_is_cut_open_is_as_deep_as_it_is() {
    let mut hollow = soup(&cuboid([-10.0; 3], [10.0; 3]));
    hollow.extend(soup(&icosphere(5, 6.0)).into_iter().map(|[a, b, c]| [a, c, b]));
    let tree = tree(&hollow, depth(2));
    let half = cell(&tree) / 2.0;
    let cut = CutPlane { axis: Axis::Z, at: 1.0, above: true };
    let view = View { azimuth: 25.0, elevation: 70.0, opening: 20.0 };
    let (mut caps, mut walls) = (0, 0);
    for (ray, found) in depth_map(&tree, &options(Style::solid, view, vec![cut])) {
        let at = |t: f64| [0, 1, 2].map(|a| ray.origin[a] + t * ray.direction[a]);
        let radius = |p: [f64; 3]| p.iter().map(|c| c * c).sum::<f64>().sqrt();
        // Where the ray passes the plane of the cut.
        let opening = at((1.0 - ray.origin[2]) / ray.direction[2]);
        if opening[0].abs().max(opening[1].abs()) > 10.0 - half || (radius(opening) - 6.0).abs() < half {
            continue;
        }
        let found = at(found.expect("a wall"));
        if radius(opening) > 6.0 {
            assert!((found[2] - 1.0).abs() < 1e-9, "{found:?}");
            caps += 1;
        } else {
            assert!((radius(found) - 6.0).abs() < half && found[2] < 1.0, "{found:?}");
            walls += 1;
        }
    }
    assert!(caps > 500 && walls > 500, "{caps} and {walls}");
}

/// Boxes that overlap for |x| < 4, |y| < 2, |z| < 2.
fn two_boxes() -> MemoryTree {
    let mut both = soup(&cuboid([-10.0, -3.0, -3.0], [4.0, 3.0, 3.0]));
    both.extend(soup(&cuboid([-4.0, -2.0, -2.0], [10.0, 2.0, 2.0])));
    tree(&both, depth(3))
}

#[test]
fn overlaps_are_met_within_the_part() {
    let tree = two_boxes();
    let view = View::named("front").unwrap();
    let half = cell(&tree);
    let mut met = 0;
    for (ray, found) in depth_map(&tree, &options(Style::overlap, view, vec![])) {
        let inside = |margin: f64| ray.origin[0].abs() < 4.0 - margin && ray.origin[2].abs() < 2.0 - margin;
        if inside(half) {
            let y = ray.origin[1] + found.expect("two boxes");
            assert!((y + 2.0).abs() < half, "{y}");
            met += 1;
        } else if !inside(-half) {
            assert_eq!(found, None);
        }
    }
    assert!(met > 200);
}

/// Pixels of a scene.
fn pixels(tree: &MemoryTree, options: &RenderOptions, threads: usize) -> Vec<[u8; 4]> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let mut pixels = Vec::new();
    pool.install(|| {
        let scene = Scene::new(tree, options).unwrap();
        scene.frames().next().expect("a picture").draw(&Silent, |row| {
            pixels.extend_from_slice(row);
            Ok(())
        })
    })
    .unwrap();
    pixels
}

#[test]
fn neither_threads_nor_memory_show() {
    let mut both = soup(&icosphere(4, 9.0));
    both.extend(soup(&cuboid([-10.0, -3.0, -3.0], [4.0, 3.0, 3.0])));
    let tree = tree(&both, depth(3));
    for (name, style) in Style::NAMED {
        let view = View { azimuth: 20.0, elevation: 30.0, opening: 25.0 };
        let cut = CutPlane { axis: Axis::Y, at: -5.0, above: false };
        let some = RenderOptions { size: [203, 101], ..options(style, view, vec![cut]) };
        let one = pixels(&tree, &some, 1);
        assert_eq!(one.len(), 203 * 101);
        assert!(one.iter().any(|pixel| *pixel != [255; 4]));
        assert!(one == pixels(&tree, &some, 4), "{name}");
        assert!(one == pixels(&tree, &RenderOptions { cache_bytes: 0, ..some }, 3), "{name}");
    }
}

#[test]
fn a_scene_of_other_options_takes_over_what_it_can() {
    let tree = tree(&soup(&icosphere(4, 9.0)), depth(3));
    let drawn = |scene: &Scene<'_>| {
        let mut pixels = Vec::new();
        let frame = scene.frames().next().expect("a picture");
        let row = |row: &[[u8; 4]]| {
            pixels.extend_from_slice(row);
            Ok(())
        };
        frame.draw(&Silent, row).unwrap();
        pixels
    };
    let first = options(Style::solid, View::named("iso").unwrap(), vec![]);
    let scene = Scene::new(&tree, &first).unwrap();
    drawn(&scene);
    let made = scene.summary().made;
    assert!(made > 0);
    // From the other side, closer, cut open: all that the eye meets is there, or is made once.
    let cut = CutPlane { axis: Axis::Z, at: 2.0, above: true };
    let focus = Some(Focus { centre: [1.0, 0.0, 0.0], height: 9.0 });
    let view = View { azimuth: -40.0, elevation: 30.0, opening: 20.0 };
    let same = scene.with(&first).unwrap();
    drawn(&same);
    assert_eq!(same.summary().made, made);
    for other in [
        RenderOptions { view, focus, cuts: vec![cut], size: [61, 47], ..first.clone() },
        RenderOptions { style: Style::boundary(), ..first.clone() },
        RenderOptions { level: Some(1), cell_pixels: 1.0, ..first.clone() },
    ] {
        let expected = drawn(&Scene::new(&tree, &other).unwrap());
        assert!(drawn(&scene.with(&other).unwrap()) == expected, "{other:?}");
    }
    let nothing = RenderOptions { cuts: vec![CutPlane { at: -50.0, ..cut }], ..first.clone() };
    let nowhere = RenderOptions { focus: Some(Focus { centre: [0.0; 3], height: f64::NAN }), ..first };
    assert!(scene.with(&nothing).is_err() && scene.with(&nowhere).is_err());
}

#[test]
fn rays_meet_surfaces_in_their_order_and_haze_between() {
    let tree = two_boxes();
    let view = View::named("front").unwrap();
    let pane = |w: f64, colour: [u8; 3]| IsoSurface {
        w,
        paint: Paint::Plain(colour),
        opacity: 0.5,
        rim: 0.0,
        shaded: false,
    };
    let style =
        |surfaces: Vec<IsoSurface>, volume: Option<VolumeStyle>| Style { surfaces, volume, ..Style::solid() };
    let middle = |style: Style| {
        let options = RenderOptions { style, ..options(Style::solid, view, vec![]) };
        pixels(&tree, &options, 2)[36 * 96 + 48]
    };
    let near = |[r, g, b, _]: [u8; 4], expected: [f64; 3]| {
        [r, g, b].into_iter().zip(expected).all(|(c, e)| (f64::from(c) - e).abs() <= 1.5)
    };
    // Into the first box, into both, out of one, out of all: each hides half, white lies behind.
    let (red, blue) = ([255, 0, 0], [0, 0, 255]);
    let panes = middle(style(vec![pane(0.5, red), pane(1.5, blue)], None));
    let shares = [0.5, 0.25, 0.125, 0.0625].map(|share: f64| share * 255.0);
    let white = 0.0625 * 255.0;
    assert!(near(panes, [shares[0] + shares[3] + white, white, shares[1] + shares[2] + white]), "{panes:?}");
    // Whichever comes first in the style.
    assert_eq!(panes, middle(style(vec![pane(1.5, blue), pane(0.5, red)], None)));
    // Four units of a haze of a tenth a unit, seen where w is 2; cells at its border count in part.
    let green = VolumeStyle {
        opacity: Stops::new(vec![(1.5, [0.1]), (2.5, [0.1])]).unwrap(),
        colour: Stops::new(vec![(2.0, [0.0, 255.0, 0.0])]).unwrap(),
        shaded: false,
        stretch: Some(1.0),
    };
    let left = 255.0 * (-0.4f64).exp();
    let [r, g, b, _] = middle(style(vec![], Some(green.clone())));
    assert!((f64::from(r) - left).abs() < 8.0 && r == b && g == 255, "{r} {g} {b} for {left}");
    // An opaque surface behind it ends it.
    let [r, _, b, _] = middle(style(vec![IsoSurface::opaque(1.5, Paint::Plain(red))], Some(green)));
    assert!(r > 40 && b < 60, "{r} {b}");
}

#[test]
fn a_turn_sees_all_sides_at_one_size() {
    let tree = tree(&soup(&cuboid([-10.0, -2.0, -3.0], [10.0, 2.0, 3.0])), depth(2));
    let some = RenderOptions {
        turn: 4,
        bounds: [[-10.0, -2.0, -3.0], [10.0, 2.0, 3.0]],
        ..options(Style::solid, View::named("front").unwrap(), vec![])
    };
    let scene = Scene::new(&tree, &some).unwrap();
    let widths: Vec<usize> = scene
        .frames()
        .map(|frame| {
            let row: Vec<Ray> = (0..96).map(|x| frame.ray([f64::from(x) + 0.5, 36.0])).collect();
            frame.distances(&row).unwrap().iter().flatten().count()
        })
        .collect();
    // 20 units in front fill 94 % of 96 pixels; the sides are 4 units wide.
    assert_eq!(widths, [90, 18, 90, 18]);
}

#[test]
fn a_closed_void_shows_through_the_boundary_and_not_through_the_solid() {
    let mut hollow = soup(&cuboid([-10.0; 3], [10.0; 3]));
    let solid = tree(&hollow, depth(2));
    hollow.extend(soup(&icosphere(4, 4.0)).into_iter().map(|[a, b, c]| [a, c, b]));
    let hollow = tree(&hollow, depth(2));
    let view = View::named("front").unwrap();
    for (style, differs) in [(Style::solid as fn() -> Style, false), (Style::boundary, true)] {
        let [a, b] = [&solid, &hollow].map(|tree| pixels(tree, &options(style, view, vec![]), 2));
        let middle = 36 * 96 + 48;
        assert_eq!(a[middle] != b[middle], differs);
        assert_eq!(a[20 * 96 + 20], b[20 * 96 + 20]);
    }
}
