//! Pictures by a device beside the processor's: alike up to rounding, whatever room the device has.

use crate::backend::{open, read};
use crate::suite::open_data;
use brickfield_bench_data::Mesh;
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::shapes::{cuboid, icosphere};
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::backend::Vulkan;
use brickfield_engine::build::{TreeOptions, build_in_memory};
use brickfield_engine::gpu::{DeviceFailure, InjectedFailure, Stage};
use brickfield_engine::ingest::Facets;
use brickfield_engine::lattice::{Axis, RootCube};
use brickfield_engine::render::{
    Caster, CasterReport, CutPlane, Focus, IsoSurface, Paint, RenderOptions, Scene, Stops, Style, View,
    VolumeStyle,
};
use brickfield_engine::store::{BrickTree, MemoryTree};
use std::time::Instant;

pub type Soup = Vec<[[f64; 3]; 3]>;
pub type Picture = Vec<[u8; 4]>;

/// A part with the box around it.
pub struct Part {
    pub tree: MemoryTree,
    pub bounds: [[f64; 3]; 2],
}

fn soup(mesh: &Mesh) -> Soup {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize])).collect()
}

pub fn part(soup: &Soup, depth: u8) -> Part {
    let all = || soup.iter().flatten();
    let min = std::array::from_fn(|a| all().fold(f64::MAX, |m, v| m.min(v[a])));
    let max = std::array::from_fn(|a| all().fold(f64::MIN, |m, v| m.max(v[a])));
    let root = RootCube::around(min, max).expect("an extent");
    let options = TreeOptions { depth, ..TreeOptions::default() };
    Part {
        tree: build_in_memory(&[soup], root, options).unwrap_or_else(|e| panic!("{e}")),
        bounds: [min, max],
    }
}

/// A box with a round void.
fn cavity() -> Soup {
    let mut hollow = soup(&cuboid([-10.0; 3], [10.0; 3]));
    hollow.extend(soup(&icosphere(5, 6.0)).into_iter().map(|[a, b, c]| [a, c, b]));
    hollow
}

/// Tubes along a real toolpath.
pub fn clover() -> Soup {
    let input = open_data("stl/clover_beads.stl");
    let mut soup = Soup::new();
    input.read(0..Facets::facets(&input), &mut soup);
    soup
}

pub fn pile() -> Soup {
    soup(&Mesh::merged(&random_pile(3, 60)))
}

fn options(part: &Part, style: Style, opening: f64) -> RenderOptions {
    let view = View { azimuth: -50.0, elevation: 33.0, opening };
    RenderOptions { style, size: [103, 75], cache_bytes: 64 << 20, ..RenderOptions::of(part.bounds, view) }
}

/// Cuts through the middle of a part: across z, and a corner of it.
pub fn cuts(part: &Part) -> Vec<Vec<CutPlane>> {
    let at = |axis: Axis, share: f64| {
        let [low, high] = part.bounds.map(|corner| corner[axis.index()]);
        CutPlane { axis, at: low + share * (high - low), above: axis == Axis::Z }
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
pub fn off(a: &Picture, b: &Picture) -> f64 {
    assert_eq!(a.len(), b.len());
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 2);
    a.iter().zip(b).filter(differs).count() as f64 * 1000.0 / a.len() as f64
}

/// Fails if the validation layer said anything.
pub fn silent(device: &Vulkan) {
    let messages = read(&device.gpu().messages());
    assert!(messages.is_empty(), "{}", messages.join("\n"));
}

/// Draws a part in all built-in styles, parallel and in perspective, whole and cut. `turn` is 0 or 1: a part of the sweep
/// has each style with each cut of every part, and with both openings over two parts.
fn is_alike(soup: &Soup, depth: u8, turn: usize) {
    let part = part(soup, depth);
    let device = open(0);
    let openings = Style::NAMED.into_iter().flat_map(|style| [(style, 0.0), (style, 35.0)]);
    for (n, ((name, style), opening)) in openings.enumerate() {
        for cuts in cuts(&part).into_iter().skip(part_or_all((n + turn) % 2, 0)).step_by(part_or_all(2, 1)) {
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
    is_alike(&soup(&icosphere(5, 10.0)), 3, 0);
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_cavity_looks_alike() {
    is_alike(&cavity(), 3, 1);
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_pile_looks_alike() {
    is_alike(&pile(), 3, 0);
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn beads_of_a_toolpath_look_alike() {
    is_alike(&clover(), 4, 1);
}

/// Four surfaces with a haze between them, over a background that is seen through.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn styles_of_ones_own_look_alike() {
    let part = part(&pile(), 3);
    let device = open(0);
    let pane = |w: f64, shaded| IsoSurface { w, paint: Paint::Counted, opacity: 0.2, rim: 0.5, shaded };
    let stops: Vec<(f64, [f64; 1])> =
        (0..256).map(|n| (f64::from(n) / 80.0, [f64::from(n % 7) / 30.0])).collect();
    for (shaded, stretch) in [(true, None), (false, Some(0.3))] {
        let volume = VolumeStyle {
            opacity: Stops::new(stops.clone()).unwrap(),
            colour: Stops::new(vec![(0.5, [20.0, 160.0, 230.0]), (2.5, [240.0, 30.0, 50.0])]).unwrap(),
            shaded,
            stretch,
        };
        let surfaces = vec![
            pane(0.5, shaded),
            pane(1.5, true),
            pane(2.0, false),
            IsoSurface::opaque(3.0, Paint::Counted),
        ];
        let style = Style { surfaces, volume: Some(volume), ..Style::solid() };
        let background = [30, 60, 90, 100];
        let options = RenderOptions {
            background,
            supersample: 1,
            cuts: cuts(&part)[1].clone(),
            ..options(&part, style, 20.0)
        };
        let (picture, report) = there(&device, &part, &options);
        assert!(report.failure.is_none() && report.cpu_bands == 0 && report.bands > 0, "{report:?}");
        let off = off(&picture, &here(&part, &options));
        assert!(off <= 1.0, "{off} of 1000 pixels are off");
    }
    silent(&device);
}

/// Where pixels are as small as what single precision tells apart, the processor draws.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn closest_views_are_the_processors() {
    let part = part(&pile(), 3);
    let device = open(0);
    let edge = part.tree.root().edge;
    let options = options(&part, Style::solid(), 0.0);
    let centre = std::array::from_fn(|a| 0.5 * (options.bounds[0][a] + options.bounds[1][a]));
    let height = f64::from(options.size[1]);
    for (pixel, is_there) in [(2f64.powi(-12), true), (2f64.powi(-14), false)] {
        let focus = Some(Focus { centre, height: pixel * edge * height });
        let options = RenderOptions { focus, ..options.clone() };
        let (picture, report) = there(&device, &part, &options);
        assert!(report.failure.is_none() && (report.bands > 0) == is_there, "{pixel}: {report:?}");
        assert_eq!(report.cpu_bands > 0, !is_there, "{pixel}");
        let off = off(&picture, &here(&part, &options));
        assert!(off <= if is_there { 1.0 } else { 0.0 }, "{pixel}: {off} of 1000 pixels are off");
    }
    silent(&device);
}

/// Bricks come and go where there are few pages, or rays in small parts; pixels are the same.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn pictures_do_not_depend_on_the_room_for_bricks() {
    let part = part(&pile(), 2);
    for (name, style) in Style::NAMED {
        let options = RenderOptions { cuts: cuts(&part)[1].clone(), ..options(&part, style(), 30.0) };
        let roomy = open(0);
        let (expected, all) = there(&roomy, &part, &options);
        for memory in [1 << 20, 2 << 20, 5 << 20] {
            let device = open(memory);
            let (picture, report) = there(&device, &part, &options);
            assert!(picture == expected, "{name}, {memory} bytes: {report:?}");
            assert_eq!((report.cpu_bands, &report.failure), (0, &None));
            assert!(device.gpu().allocated().1 <= memory);
            if memory == 1 << 20 {
                assert!(report.pages < 12 && report.brought > all.brought, "{report:?} {all:?}");
            }
            silent(&device);
        }
        silent(&roomy);
    }
}

/// Bricks stay where they are for the next picture.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn a_second_picture_brings_nothing() {
    let part = part(&pile(), 2);
    let device = open(0);
    let scene = Scene::new(&part.tree, &options(&part, Style::solid(), 0.0)).unwrap();
    let mut caster = Caster::new(&scene, device.gpu());
    let frame = scene.frames().next().unwrap();
    caster.draw(&frame, &Silent, |_| Ok(())).unwrap();
    let brought = caster.report().brought;
    caster.draw(&frame, &Silent, |_| Ok(())).unwrap();
    assert!(brought > 0 && caster.report().brought == brought);
    silent(&device);
}

/// Whatever happens on the device, there is a picture.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn failures_end_in_a_picture() {
    let part = part(&pile(), 2);
    let options = options(&part, Style::overlap(), 0.0);
    let expected = here(&part, &options);
    let fault = |stage, after, failure| InjectedFailure { stage, after, times: 1, failure };
    let mut cases = vec![(0, None)];
    for fault in [
        fault(Stage::Allocate, 1, DeviceFailure::OutOfMemory),
        fault(Stage::Submit, 2, DeviceFailure::Lost),
        fault(Stage::Submit, 7, DeviceFailure::Lost),
        fault(Stage::Wait, 6, DeviceFailure::Timeout),
        fault(Stage::Wait, 8, DeviceFailure::OutOfMemory),
    ] {
        cases.push((0, Some(fault)));
    }
    cases[0].0 = 100_000;
    for (memory, fault) in cases {
        let device = open(memory);
        fault.into_iter().for_each(|fault| device.gpu().inject(fault));
        let (picture, report) = there(&device, &part, &options);
        assert!(off(&picture, &expected) <= 1.0, "{fault:?}");
        assert!(report.failure.is_some() && report.cpu_bands > 0, "{fault:?}: {report:?}");
        silent(&device);
    }
}

/// Nothing is left on the device behind a picture, the validation layer says.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn pictures_leave_nothing_behind() {
    let part = part(&pile(), 2);
    let device = open(0);
    let (gpu, messages) = (device.gpu().clone(), device.gpu().messages());
    let (_, report) = there(&device, &part, &options(&part, Style::solid(), 0.0));
    assert!(report.failure.is_none() && report.bands > 0, "{report:?}");
    assert_eq!(gpu.allocated().0, 0);
    drop((device, gpu));
    assert_eq!(read(&messages), Vec::<String>::new());
}

/// Without time there is a picture all the same, which calls make complete one after the other.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn sketches_come_closer_to_the_picture() {
    let part = part(&pile(), 3);
    let options = options(&part, Style::solid(), 30.0);
    let device = open(0);
    let (expected, all) = there(&device, &part, &options);
    let scene = Scene::new(&part.tree, &options).unwrap();
    let mut caster = Caster::new(&scene, device.gpu());
    let frame = scene.frames().next().unwrap();
    let mut errors = Vec::new();
    let mut calls = 0;
    loop {
        let mut picture = Picture::new();
        let row = |row: &[[u8; 4]]| {
            picture.extend_from_slice(row);
            Ok(())
        };
        let is_complete = caster.sketch(&frame, Instant::now(), &Silent, row).unwrap();
        errors.push(off(&picture, &expected));
        calls += 1;
        if is_complete {
            assert!(picture == expected);
            break;
        }
        // Each call brings a brick at least.
        assert!(calls <= all.brought, "{calls} calls, {errors:?}");
    }
    assert!(calls > 2 && errors[0] > errors[calls as usize / 2], "{errors:?}");
    silent(&device);
}
