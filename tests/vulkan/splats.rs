//! Pictures of splats by a device beside the processor's: alike up to rounding, whatever room the device has.

use crate::backend::{open, open_staged, read};
use crate::rays::{Part, Picture, clover, cuts, off, part, pile, silent};
use brickfield_engine::backend::Vulkan;
use brickfield_engine::draw::{DrawOptions, SplatScene, draw, draw_on};
use brickfield_engine::gpu::{DeviceFailure, InjectedFailure, Stage};
use brickfield_engine::render::{Focus, View};
use brickfield_engine::splats::{LevelsOptions, SplatLevels};
use brickfield_engine::{Error, Progress, Silent};
use std::sync::atomic::{AtomicBool, Ordering};

fn splats(part: &Part) -> SplatScene {
    let levels = SplatLevels::new(&part.tree, LevelsOptions::default(), &Silent);
    let levels = levels.unwrap_or_else(|e| panic!("{e}"));
    SplatScene::of_levels(&levels, None).unwrap_or_else(|e| panic!("{e}"))
}

fn options(part: &Part, opening: f64) -> DrawOptions {
    DrawOptions {
        view: View { azimuth: -50.0, elevation: 33.0, opening },
        focus: None,
        bounds: part.bounds,
        cuts: Vec::new(),
        size: [203, 155],
        supersample: 1,
        background: [255; 4],
    }
}

fn there(device: &Vulkan, scene: &SplatScene, options: &DrawOptions) -> (Picture, Option<DeviceFailure>) {
    let (picture, failure) = draw_on(device.gpu(), scene, options, &Silent).unwrap_or_else(|e| panic!("{e}"));
    (picture.pixels, failure)
}

fn here(scene: &SplatScene, options: &DrawOptions) -> Picture {
    draw(scene, options, &Silent).unwrap_or_else(|e| panic!("{e}")).pixels
}

/// Draws splats with parallel rays and in perspective, whole and cut open, with one ray a pixel and with nine.
fn is_alike(part: &Part, device: &Vulkan) {
    let scene = splats(part);
    for (opening, supersample) in [(0.0, 1), (35.0, 1), (0.0, 3), (35.0, 3)] {
        for cuts in cuts(part) {
            let options = DrawOptions { supersample, cuts, ..options(part, opening) };
            let expected = here(&scene, &options);
            let (picture, failure) = there(device, &scene, &options);
            let off = off(&picture, &expected);
            println!("{opening} {supersample} {:?}: {off:.2} of 1000 pixels are off", options.cuts);
            let covered = expected.iter().filter(|pixel| **pixel != [255; 4]).count();
            assert!(failure.is_none() && covered * 10 > expected.len(), "{failure:?}, {covered}");
            assert!(off <= 1.0, "{opening} {supersample} {:?}: {off}", options.cuts);
        }
    }
    silent(device);
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn splats_of_a_pile_look_alike() {
    is_alike(&part(&pile(), 3), &open(0));
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn splats_of_beads_look_alike() {
    is_alike(&part(&clover(), 4), &open_staged(0));
}

/// Tiles with more splats than are drawn at once, and batches of few tiles: pixels are the same.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn pictures_of_splats_do_not_depend_on_the_room() {
    let part = part(&pile(), 3);
    let scene = splats(&part);
    let cut = DrawOptions { cuts: cuts(&part).swap_remove(1), ..options(&part, 30.0) };
    // On the smallest device a tile is drawn with 256 splats at once, and many tiles have more.
    let tiles = 203u64.div_ceil(8) * 155u64.div_ceil(8);
    let drawn = draw(&scene, &cut, &Silent).unwrap().drawn;
    assert!(drawn > 256 * tiles, "{drawn} splats, {tiles} tiles");
    for options in [cut, options(&part, 0.0)] {
        let roomy = open(0);
        let (expected, failure) = there(&roomy, &scene, &options);
        assert_eq!((failure, off(&expected, &here(&scene, &options)) <= 1.0), (None, true));
        silent(&roomy);
        for device in [open(30_000), open(300_000), open(2 << 20), open_staged(60_000)] {
            let (picture, failure) = there(&device, &scene, &options);
            assert!(failure.is_none() && picture == expected, "{failure:?}");
            assert!(device.gpu().allocated().1 <= device.gpu().memory());
            silent(&device);
        }
    }
}

/// What no splat touches is the background, and nothing of it goes to a device.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn views_beside_the_part_are_empty() {
    let part = part(&pile(), 2);
    let device = open(100);
    let centre = part.bounds[1].map(|c| 3.0 * c + 1e3);
    let options = DrawOptions {
        focus: Some(Focus { centre, height: 1.0 }),
        background: [1, 2, 3, 4],
        ..options(&part, 0.0)
    };
    let (picture, failure) = there(&device, &splats(&part), &options);
    assert!(failure.is_none() && picture.iter().all(|pixel| *pixel == [1, 2, 3, 4]));
}

/// Whatever happens on the device there is a picture, the processor's, and nothing is left behind.
#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn failures_end_in_a_picture_of_splats() {
    let part = part(&pile(), 3);
    let (scene, options) = (splats(&part), options(&part, 30.0));
    let expected = here(&scene, &options);
    let fault = |stage, after, failure| InjectedFailure { stage, after, times: 1, failure };
    for (memory, fault) in [
        (20_000, None),
        (0, Some(fault(Stage::Allocate, 0, DeviceFailure::OutOfMemory))),
        (300_000, Some(fault(Stage::Submit, 2, DeviceFailure::Lost))),
        (300_000, Some(fault(Stage::Wait, 1, DeviceFailure::Timeout))),
    ] {
        let device = open(memory);
        fault.into_iter().for_each(|fault| device.gpu().inject(fault));
        let (picture, failure) = there(&device, &scene, &options);
        assert!(failure.is_some() && picture == expected, "{fault:?}: {failure:?}");
        assert_eq!(device.gpu().allocated().0, 0);
        let (messages, gpu) = (device.gpu().messages(), device.gpu().clone());
        drop((device, gpu));
        assert_eq!(read(&messages), Vec::<String>::new(), "{fault:?}");
    }
}

/// Interrupts while tiles are drawn.
struct Impatient(AtomicBool);

impl Progress for Impatient {
    fn phase(&self, name: &str, _: Option<u64>, _: &str) {
        self.0.store(name == "drawing splats", Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

#[test]
#[ignore = "needs a Vulkan device and the validation layer; run with -- --ignored"]
fn drawing_on_a_device_can_be_interrupted() {
    let part = part(&pile(), 2);
    let device = open(0);
    let progress = Impatient(false.into());
    let drawn = draw_on(device.gpu(), &splats(&part), &options(&part, 0.0), &progress);
    assert!(matches!(drawn, Err(Error::Interrupted)));
    assert_eq!(device.gpu().allocated().0, 0);
    silent(&device);
}
