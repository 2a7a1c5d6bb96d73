//! How fast pictures of a file of splats are drawn, the best of some: `measure_drawing PART.bsp [WIDTH HEIGHT [TIMES]]`
//!
//! On all threads, or as many as `RAYON_NUM_THREADS` says. A splat counts as drawn that faces the eye and touches the picture, hidden
//! or not. Pictures have one ray a pixel.

use brickfield_core::Silent;
use brickfield_picture::render::View;
use brickfield_splats::draw::{DrawOptions, SplatScene, draw};
use brickfield_splats::splats::read_bsp;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let number = |n: usize, or: u32| args.get(n).map_or(or, |arg| arg.parse().expect("a number"));
    let (size, times) = ([number(2, 1920), number(3, 1080)], number(4, 7));
    let began = Instant::now();
    let tree = read_bsp(args[1].as_ref(), None, &Silent).expect("a file of splats");
    println!("decoded: {:.2} s", began.elapsed().as_secs_f64());
    let began = Instant::now();
    let scene = SplatScene::of_tree(&tree, None);
    println!("laid out: {:.3} s, {} splats", began.elapsed().as_secs_f64(), scene.len());
    for (name, azimuth, elevation, opening) in [
        ("iso", -45.0, 35.264_389_682_754_654, 0.0),
        ("grazing", 10.0, 2.0, 0.0),
        ("top", -90.0, 90.0, 0.0),
        ("perspective", -45.0, 35.264_389_682_754_654, 30.0),
    ] {
        let options = DrawOptions {
            view: View { azimuth, elevation, opening },
            focus: None,
            bounds: tree.header().bounds,
            cuts: Vec::new(),
            size,
            supersample: 1,
            background: [255; 4],
        };
        let (mut best, mut drawn, processor) = (f64::MAX, 0, processor_seconds());
        for _ in 0..times {
            let began = Instant::now();
            drawn = draw(&scene, &options, &Silent).expect("a picture").drawn;
            best = best.min(began.elapsed().as_secs_f64());
        }
        let processor = (processor_seconds() - processor) / f64::from(times);
        println!(
            "{name}: {drawn} drawn in {:.1} ms at best, {:.1} M/s; {:.1} ms of processor in the mean, {:.1} M/s of one core",
            best * 1e3,
            drawn as f64 / best / 1e6,
            processor * 1e3,
            drawn as f64 / processor / 1e6
        );
    }
}

/// Seconds of processor of this process so far, of the user and of the system, as Linux tells; 0 elsewhere.
fn processor_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = text.rsplit(')').next().unwrap_or_default();
    let ticks = fields.split_whitespace().skip(11).take(2).filter_map(|field| field.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}
