//! Pictures judged by the silhouette and the normals of a ball.

use super::*;
use crate::bsp::{Cell, Clip};
use crate::progress::Silent;
use crate::splats::CellPlanes;

/// A node of one cell, with planes: unit normals, and distances from the middle in cells.
fn node(corner: [f64; 3], size: f64, planes: &[([f64; 3], f64)], clips: u8) -> SceneNode {
    let cell = Cell { at: [0; 3], first: 0, count: planes.len() as u8, clips, divided: false };
    let mut all = [([0.0; 3], 0.0); 3];
    all[..planes.len()].copy_from_slice(planes);
    SceneNode::new(corner, size, &mut std::iter::once(CellPlanes { cell, planes: all }))
}

/// Splats that touch a ball of radius 1, in cells of a size.
fn ball(size: f64) -> SplatScene {
    let mut nodes = Vec::new();
    let count = (1.2 / size) as i32;
    for n in 0..(2 * count).pow(3) {
        let at = [n % (2 * count), n / (2 * count) % (2 * count), n / (2 * count) / (2 * count)];
        let middle = at.map(|c| (f64::from(c - count) + 0.5) * size);
        let length = middle.iter().map(|c| c * c).sum::<f64>().sqrt();
        let normal = middle.map(|c| c / length);
        let support = normal.iter().map(|c| c.abs()).sum::<f64>() * size / 2.0;
        if (length - 1.0).abs() <= support * 1.05 {
            nodes.push(node(middle.map(|c| c - size / 2.0), size, &[(normal, (1.0 - length) / size)], 0));
        }
    }
    SplatScene::new(nodes)
}

fn options(opening: f64) -> DrawOptions {
    DrawOptions {
        view: View { azimuth: 25.0, elevation: 30.0, opening },
        focus: Some(Focus { centre: [0.0; 3], height: 2.5 }),
        bounds: [[-1.0; 3], [1.0; 3]],
        cuts: Vec::new(),
        size: [100, 100],
        supersample: 1,
        background: [255; 4],
    }
}

#[test]
fn a_ball_has_its_silhouette_and_no_holes() {
    for (opening, cell) in [(0.0, 0.05), (0.0, 0.15), (40.0, 0.05), (40.0, 0.15)] {
        let picture = draw(&ball(cell), &options(opening), &Silent).unwrap();
        // Of parallel rays the silhouette is a circle of 40 pixels; with perspective a larger one.
        let distance = 1.25 / (opening.to_radians() / 2.0).tan();
        let radius = match opening {
            0.0 => 40.0,
            _ => distance / (distance * distance - 1.0).sqrt() * 40.0,
        };
        for (n, pixel) in picture.pixels.iter().enumerate() {
            let from = [(n % 100) as f64 - 49.5, (n / 100) as f64 - 49.5];
            let off = (from[0] * from[0] + from[1] * from[1]).sqrt() - radius;
            // Planes that touch a ball reach beyond it.
            let slack = 0.7 + 40.0 * cell * cell;
            assert!(off > -0.7 || *pixel != [255; 4], "a hole at {from:?}, {opening}, {cell}");
            assert!(off < slack || *pixel == [255; 4], "{off} beyond the ball, {opening}, {cell}");
        }
        assert!(picture.drawn < ball(cell).len() * 3 / 4);
    }
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let made = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draw(&ball(0.1), &options(30.0), &Silent).unwrap().pixels)
    };
    let one = made(1);
    assert!(made(3) == one);
}

#[test]
fn cuts_show_the_inside_and_splats_cut_each_other() {
    let cut = CutPlane { axis: crate::lattice::Axis::Z, at: 0.0, above: true };
    let mut options = options(0.0);
    options.view = View::named("top").unwrap();
    options.cuts.push(cut);
    let picture = draw(&ball(0.1), &options, &Silent).unwrap();
    let [r, _, b, _] = picture.pixels[50 * 100 + 50];
    assert!(r > b, "the inside has a colour of its own");
    // Half of a splat is what another leaves of it.
    let planes = [([0.0, 0.0, 1.0], 0.0), ([1.0, 0.0, 0.0], 0.0)];
    let half = node([-0.5; 3], 1.0, &planes, Clip::Convex.of_pair(0));
    options.cuts.clear();
    let picture = draw(&SplatScene::new(vec![half]), &options, &Silent).unwrap();
    let is_drawn = |column: usize| picture.pixels[50 * 100 + column] != [255; 4];
    assert!(is_drawn(48) && !is_drawn(52) && is_drawn(26) && !is_drawn(20));
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let mut bad = options(0.0);
    bad.size = [0, 5];
    assert!(draw(&SplatScene::default(), &bad, &Silent).is_err());
    bad.size = [60_000, 60_000];
    assert!(draw(&SplatScene::default(), &bad, &Silent).is_err());
    bad.size = [9, 9];
    assert!(
        draw(&SplatScene::default(), &bad, &Silent).unwrap().pixels.iter().all(|pixel| *pixel == [255; 4])
    );
}

/// A picture pixel by pixel, each against every splat: lengths of 64 bits, no boxes, no tiles.
fn pixel_by_pixel(scene: &SplatScene, options: &DrawOptions) -> Vec<Option<[f64; 3]>> {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let screen = options.view.screen(options.focus, left_of(options), options.size).unwrap();
    let pixel = |n: u32| {
        let at = [n % options.size[0], n / options.size[0]].map(|c| f64::from(c) + 0.5);
        let over: [f64; 3] = std::array::from_fn(|a| screen.steps[0][a] * at[0] + screen.steps[1][a] * at[1]);
        let add = |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|a| p[a] + over[a]) };
        let (from, along) = match screen.parallel {
            true => (add(screen.origin), screen.corner),
            false => (screen.origin, add(screen.corner)),
        };
        let mut met = Vec::new();
        for node in &scene.nodes {
            let normal: [f64; 3] = std::array::from_fn(|a| f64::from(node.normals[a][0]));
            let middle = node.corner.map(|c| c + node.cell / 2.0);
            let off = f64::from(node.offsets[0]) * node.cell;
            let centre: [f64; 3] = std::array::from_fn(|a| middle[a] + normal[a] * off);
            let t = dot(normal, std::array::from_fn(|a| centre[a] - from[a])) / dot(normal, along);
            let p: [f64; 3] = std::array::from_fn(|a| from[a] + along[a] * t);
            let q: [f64; 3] = std::array::from_fn(|a| p[a] - centre[a]);
            let share = dot(q, q) / (0.75 * node.cell * node.cell);
            let is_in = (0..3).all(|a| (p[a] - middle[a]).abs() <= 0.65 * node.cell);
            let is_kept = options.cuts.iter().all(|cut| (p[cut.axis.index()] <= cut.at) == cut.above);
            // With perspective the far edge of a disc may face the eye while its centre does not.
            let to_centre: [f64; 3] = std::array::from_fn(|a| centre[a] - screen.origin[a]);
            let is_front = match screen.parallel {
                _ if !options.cuts.is_empty() => true,
                true => dot(normal, along) <= 0.0,
                false => dot(normal, to_centre) <= 0.75f64.sqrt() * node.cell,
            };
            if t > 0.0 && share <= 1.0 && is_in && is_kept && is_front {
                met.push((t, normal, (1.0 - share).powi(2) + 1e-4));
            }
        }
        let together = 0.65 * 1.1 * scene.nodes[0].cell / if screen.parallel { 1.0 } else { screen.distance };
        let nearest = met.iter().map(|part| part.0).reduce(f64::min)?;
        met.retain(|part| part.0 <= nearest + together);
        Some(std::array::from_fn(|a| met.iter().map(|(_, n, weight)| n[a] * weight).sum()))
    };
    (0..options.size[0] * options.size[1]).map(pixel).collect()
}

#[test]
fn pictures_are_those_of_every_splat_in_every_pixel() {
    let cut = CutPlane { axis: crate::lattice::Axis::X, at: 0.35, above: true };
    for (opening, cell, cuts) in
        [(0.0, 0.3, vec![]), (40.0, 0.3, vec![]), (0.0, 0.12, vec![cut]), (40.0, 0.12, vec![cut])]
    {
        let scene = ball(cell);
        let options = DrawOptions { cuts, size: [90, 70], ..options(opening) };
        let picture = draw(&scene, &options, &Silent).unwrap();
        let light = light::SplatLight::new(options.view.axes());
        let (mut others, mut covered) = (0, 0);
        for (n, expected) in pixel_by_pixel(&scene, &options).into_iter().enumerate() {
            let pixel = picture.pixels[n];
            covered += usize::from(expected.is_some());
            // What is lit from behind has another colour: the sign is the picture's own.
            let is_alike = expected.map_or(pixel == [255; 4], |normal| {
                let normal = light::unit(normal.map(|c| c as f32));
                [(normal, false), (normal.map(|c| -c), true)].into_iter().any(|(normal, within)| {
                    let colour = light.colour(normal, within);
                    (0..3).all(|a| colour[a].abs_diff(pixel[a]) <= 1)
                })
            });
            others += usize::from(!is_alike);
        }
        // Edges of splats are where rounding tells.
        assert!(covered > 1200 && others <= 8, "{others} of {covered}, {opening}, {cell}");
    }
}

#[test]
fn what_a_page_draws_is_what_the_program_draws() {
    use brickfield_coding::draw::{DrawStyle, DrawView, PageCanvas, packed_splats};
    let torus = include_bytes!("../../golden/v1/torus.bsp").as_slice();
    let block = include_bytes!("../../../../fuzz/seeds/bsp/box.bsp").as_slice();
    for (bytes, opening, at) in [
        (torus, 0.0, None),
        (torus, 30.0, None),
        (torus, 30.0, Some(0.1)),
        (block, 0.0, None),
        (block, 60.0, None),
    ] {
        let tree = crate::splats::read_tree(bytes, None, &Silent).unwrap().unwrap();
        let header = tree.header();
        let level = u32::from(header.deepest);
        let view = View { azimuth: 25.0, elevation: 30.0, opening };
        let [low, high] = header.bounds;
        let middle: [f64; 3] = std::array::from_fn(|a| (low[a] + high[a]) / 2.0);
        let (size, height) = ([150u32, 130u32], 1.2 * (high[0] - low[0]));
        let around = |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|a| p[a] - middle[a]) };
        let cuts = at.map(|at| CutPlane { axis: crate::lattice::Axis::Z, at: middle[2] + at, above: true });
        let options = DrawOptions {
            view,
            focus: Some(Focus { centre: middle, height }),
            bounds: header.bounds,
            cuts: cuts.into_iter().collect(),
            size,
            supersample: 1,
            background: [255; 4],
        };
        let expected = draw(&SplatScene::of_tree(&tree, Some(header.deepest)), &options, &Silent).unwrap();
        let mut splats = Vec::new();
        packed_splats(&tree, level, |_, _| true, &mut splats);
        let mut canvas = PageCanvas::default();
        canvas.draw(
            &splats,
            &DrawView {
                size: size.map(|side| side as usize),
                origin: around(header.origin),
                edge: header.edge,
                axes: view.axes(),
                centre: [0.0; 3],
                pixel: height / f64::from(size[1]),
                distance: if opening > 0.0 { height / 2.0 / (opening.to_radians() / 2.0).tan() } else { 0.0 },
                highest: at.map(|at| [1e30, 1e30, at]),
                style: DrawStyle::Light,
                deepest: level,
            },
        );
        let is_alike = |(a, b): &(&Rgba, &Rgba)| a.iter().zip(*b).all(|(a, b)| a.abs_diff(*b) <= 2);
        let pairs = || canvas.pixels().iter().zip(&expected.pixels);
        let covered = pairs().filter(|(_, pixel)| **pixel != [255; 4]).count();
        let others = pairs().filter(|pair| !is_alike(pair)).count();
        // Edges of splats are where rounding tells.
        assert!(covered > 3000 && others <= covered / 500, "{others} of {covered}, {opening}, {at:?}");
    }
}
