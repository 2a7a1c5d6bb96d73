//! `brickfield render --splats`: a picture of splats.

use super::render::{cuts, view};
use super::{CACHE_BYTES, of_store, open_store, require_level, start};
use crate::devices::choose;
use crate::failure::Failure;
use crate::output::{in_line, print, print_json, require_distinct, warn};
use crate::picture_args::{ColourArg, FocusArg, RenderArgs};
use brickfield_engine::Progress;
use brickfield_engine::draw::{DrawOptions, SplatPicture, SplatScene, draw, draw_on, write_picture};
use brickfield_engine::splats::{LevelsOptions, SplatLevels, read_bsp};
use brickfield_engine::store::{AcceptedStores, BrickTree};
use serde_json::{Value, json};
use std::time::Instant;

/// Why no device is opened unless it is asked for: that takes longer than a picture of splats.
const WHY_NOT: &str = "the processor draws splats sooner than a device is opened";

/// A part as splats.
struct Part {
    scene: SplatScene,
    unit: String,
    bounds: [[f64; 3]; 2],
}

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    if !args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        let name = in_line(&args.output);
        return Err(Failure::Usage(format!("{name}: the picture's name must end in .png")));
    }
    let view = view(args)?;
    let bars = start(args.work)?;
    let device = choose(&args.draws.backend(), Some(args.memory), Some(WHY_NOT))?.device();
    require_distinct(&[&args.output], &[&args.store])?;
    let is_file = args.store.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("bsp"));
    let part = if is_file { of_file(args, &bars)? } else { of_brick_store(args, &bars)? };
    let ColourArg(background) = args.background.unwrap_or(ColourArg([255; 4]));
    let options = DrawOptions {
        view,
        focus: args.focus.map(|FocusArg(focus)| focus),
        bounds: part.bounds,
        cuts: cuts(args, &part.unit)?,
        size: args.size.0,
        supersample: args.supersample,
        background,
    };
    let started = Instant::now();
    let (picture, failure) = match &device {
        Some(device) => draw_on(device.gpu(), &part.scene, &options, &bars)?,
        None => (draw(&part.scene, &options, &bars)?, None),
    };
    let seconds = started.elapsed().as_secs_f64();
    write_picture(&picture, background[3] == 255, &args.output)?;
    bars.clear();
    let by = device.as_ref().map(|device| device.gpu().info().name.as_str());
    let failure = failure.map(|failure| failure.to_string());
    if let (Some(name), Some(failure)) = (by, &failure) {
        warn(&format!("{name}: {failure}; the processor drew in its place"));
    }
    if args.json {
        let mut said = told(args, &picture, part.scene.len(), seconds);
        if let Some(name) = by {
            said["device"] = json!({ "name": name, "failure": failure });
        }
        return print_json(&said);
    }
    if args.work.quiet {
        return Ok(());
    }
    let ([width, height], drawn, name) = (picture.size, picture.drawn, in_line(&args.output));
    let by = by.filter(|_| failure.is_none()).map_or_else(String::new, |by| format!(", by {by}"));
    print(&format!("{name}: {width} × {height} pixels, {drawn} splats, {seconds:.2} s{by}"))
}

/// What was drawn.
fn told(args: &RenderArgs, picture: &SplatPicture, splats: u64, seconds: f64) -> Value {
    let output = args.output.display().to_string();
    json!({ "output": output, "size": picture.size, "splats": splats, "drawn": picture.drawn, "seconds": seconds })
}

fn of_file(args: &RenderArgs, bars: &dyn Progress) -> Result<Part, Failure> {
    let tree = read_bsp(&args.store, args.level, bars)?;
    let header = tree.header();
    let unit = header.unit.iter().take_while(|c| **c != 0).map(|c| char::from(*c)).collect();
    let level = args
        .level
        .unwrap_or_else(|| deepest_seen(args, header.bounds, |level| header.cell(level), header.deepest));
    let scene = SplatScene::of_tree(&tree, Some(level));
    Ok(Part { scene, unit, bounds: header.bounds })
}

fn of_brick_store(args: &RenderArgs, bars: &dyn Progress) -> Result<Part, Failure> {
    let store = open_store(&args.store, CACHE_BYTES, args.io, AcceptedStores::Whole)?;
    if let Some(level) = args.level {
        require_level(&store, level)?;
    }
    let meta = store.meta();
    let bounds = [meta.bounds_min, meta.bounds_max];
    let cell = |level: u8| store.root().spacing(level);
    let level = args.level.unwrap_or_else(|| deepest_seen(args, bounds, cell, store.deepest_level()));
    let options = LevelsOptions { level: Some(level), finest_only: true, ..LevelsOptions::default() };
    let levels =
        SplatLevels::new(&store, options, bars).map_err(|error| of_store(&store, "leaves", error))?;
    let scene = SplatScene::of_levels(&levels, None).map_err(|error| of_store(&store, "leaves", error))?;
    Ok(Part { scene, unit: meta.unit.clone(), bounds })
}

/// The first level whose cells are smaller than `--lod` pixels wherever the part fits the picture; the deepest if there is none.
fn deepest_seen(args: &RenderArgs, bounds: [[f64; 3]; 2], cell: impl Fn(u8) -> f64, deepest: u8) -> u8 {
    let extent = (0..3).map(|axis| bounds[1][axis] - bounds[0][axis]).fold(0.0, f64::max);
    let height = args.focus.map_or(extent, |FocusArg(focus)| focus.height);
    let pixel = height / f64::from(args.size.0[0].max(args.size.0[1]));
    (0..deepest).find(|&level| cell(level) < pixel * args.lod).unwrap_or(deepest)
}
