//! Pictures by a device beside the processor's: alike up to rounding, whatever room the device has.

use crate::backend::{open, read};
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::shapes::{cuboid, icosphere};
use brickfield_bench_data::Mesh;
use brickfield_engine::Silent;
use brickfield_engine::backend::Vulkan;
use brickfield_engine::build::{TreeOptions, build_in_memory};
use brickfield_engine::gpu::{Failure, Fault, Stage};
use brickfield_engine::lattice::{Axis, RootCube};
use brickfield_engine::render::{Caster, CasterReport, Cut, Paint, RenderOptions, Scene, Stops, Style, Surface, View, Volume};
use brickfield_engine::store::MemoryTree;
use std::time::{Duration, Instant};

type Soup = Vec<[[f64; 3]; 3]>;
type Picture = Vec<[u8; 4]>;

/// A part with the box around it.
struct Part {
    tree: MemoryTree,
    bounds: [[f64; 3]; 2],
}

fn soup(mesh: &Mesh) -> Soup {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize])).collect()
}

fn part(soup: &Soup, depth: u8) -> Part {
    let all = || soup.iter().flatten();
    let min = std::array::from_fn(|a| all().fold(f64::MAX, |m, v| m.min(v[a])));
    let max = std::array::from_fn(|a| all().fold(f64::MIN, |m, v| m.max(v[a])));
    let root = RootCube::around(min, max).expect("an extent");
    let options = TreeOptions { depth, ..TreeOptions::default() };
    Part { tree: build_in_memory(&[soup], root, options).unwrap_or_else(|e| panic!("{e}")), bounds: [min, max] }
}

/// A box with a round void.
fn cavity() -> Soup {
    let mut hollow = soup(&cuboid([-10.0; 3], [10.0; 3]));
    hollow.extend(soup(&icosphere(5, 6.0)).into_iter().map(|[a, b, c]| [a, c, b]));
    hollow
}

fn pile() -> Soup {
    soup(&Mesh::merged(&random_pile(3, 60)))
}

fn options(part: &Part, style: Style, opening: f64) -> RenderOptions {
    RenderOptions {
        style,
        view: View { azimuth: -50.0, elevation: 33.0, opening },
        turn: 1,
        bounds: part.bounds,
        cuts: vec![],
        size: [203, 150],
        supersample: 2,
        background: [255; 4],
        level: None,
        cell_pixels: 0.5,
        cache_bytes: 64 << 20,
    }
}

/// Cuts through the middle of a part: across z, and a corner of it.
fn cuts(part: &Part) -> Vec<Vec<Cut>> {
    let at = |axis: Axis, share: f64| {
        let [low, high] = part.bounds.map(|corner| corner[axis.index()]);
        Cut { axis, at: low + share * (high - low), above: axis == Axis::Z }
    };
    vec![vec![], vec![at(Axis::Z, 0.55)], vec![at(Axis::Z, 0.713), at(Axis::Y, 0.3), at(Axis::X, 0.41)]]
}

fn here(part: &Part, options: &RenderOptions) -> Picture {
    let scene = Scene::new(&part.tree, options).unwrap_or_else(|e| panic!("{e}"));
    let mut picture = Picture::new();
    let frame = scene.frames().next().expect("a picture");
    frame
        .draw(&Silent, |row| {
            picture.extend_from_slice(row);
            Ok(())
        })
        .unwrap_or_else(|e| panic!("{e}"));
    picture
}

fn there(device: &Vulkan, part: &Part, options: &RenderOptions) -> (Picture, CasterReport) {
    let scene = Scene::new(&part.tree, options).unwrap_or_else(|e| panic!("{e}"));
    let mut caster = Caster::new(&scene, device.gpu());
    let mut picture = Picture::new();
    let frame = scene.frames().next().expect("a picture");
    caster
        .draw(&frame, &Silent, |row| {
            picture.extend_from_slice(row);
            Ok(())
        })
        .unwrap_or_else(|e| panic!("{e}"));
    (picture, caster.report().clone())
}

/// How many of a thousand pixels are off by more than two steps of 255 in a channel.
fn off(a: &Picture, b: &Picture) -> f64 {
    assert_eq!(a.len(), b.len());
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 2);
    a.iter().zip(b).filter(differs).count() as f64 * 1000.0 / a.len() as f64
}

/// Fails if the validation layer said anything.
fn silent(device: &Vulkan) {
    let messages = read(&device.gpu().messages());
    assert!(messages.is_empty(), "{}", messages.join("\n"));
}

/// Draws a part in all built-in styles, parallel and in perspective, whole and cut.
fn is_alike(soup: &Soup, depth: u8) {
    let part = part(soup, depth);
    let device = open(0);
    for ((name, style), opening) in Style::NAMED.into_iter().flat_map(|style| [(style, 0.0), (style, 35.0)]) {
        for cuts in cuts(&part) {
            let options = RenderOptions { cuts: cuts.clone(), ..options(&part, style(), opening) };
            let expected = here(&part, &options);
            let (picture, report) = there(&device, &part, &options);
            let off = off(&picture, &expected);
            println!("{name} {opening} {} cuts: {off:.2} of 1000 pixels are off, {report:?}", cuts.len());
            assert!(expected.iter().any(|pixel| *pixel != [255; 4]));
            assert!(off <= 1.0, "{name} {opening} {cuts:?}: {off} of 1000 pixels are off");
            assert!(report.failure.is_none() && report.bands > 0 && report.cpu_bands == 0, "{report:?}");
        }
    }
    silent(&device);
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_sphere_looks_alike() {
    is_alike(&soup(&icosphere(5, 10.0)), 3);
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_cavity_looks_alike() {
    is_alike(&cavity(), 3);
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_pile_looks_alike() {
    is_alike(&pile(), 3);
}
