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
