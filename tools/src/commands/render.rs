//! `brickfield render`: the part in space as a picture.

use super::{no_unit, of_store, open_store, require_level, start};
use crate::failure::Failure;
use crate::memory;
use crate::output::{in_line, print, print_json, require_distinct};
use crate::picture_args::RenderArgs;
use brickfield_engine::lattice::Axis;
use brickfield_engine::render::{Cut, RenderOptions, Scene, View, write_scene};
use brickfield_engine::store::{Accept, Store};
use serde_json::json;
use std::time::Instant;

/// Most for bricks as the store decodes them: those that cuts ask for again.
const BRICK_CACHE_BYTES: u64 = 8 << 20;

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    let started = Instant::now();
    if args.output.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
        let name = args.output.display();
        return Err(Failure::Usage(format!("{name}: the picture's name must end in .png")));
    }
    let bars = start(args.work)?;
    let caches = memory::picture_caches(args.memory);
    let store = open_store(&args.store, BRICK_CACHE_BYTES, args.io, Accept::Whole)?;
    if let Some(level) = args.level {
        require_level(&store, level)?;
    }
    require_distinct(&[&args.output], &[&args.store])?;
    let options = options(args, &store, caches - BRICK_CACHE_BYTES)?;
    let scene = Scene::new(&store, &options).map_err(|error| of_store(&store, "picture", error))?;
    write_scene(&scene, &args.output, &bars).map_err(|error| of_store(&store, "picture", error))?;
    bars.clear();
    let (seconds, made) = (started.elapsed().as_secs_f64(), scene.summary().made);
    let [width, height] = options.size;
    if args.json {
        let output = args.output.display().to_string();
        print_json(&json!({ "output": output, "size": [width, height], "bricks": made, "seconds": seconds }))
    } else if args.work.quiet {
        Ok(())
    } else {
        let name = in_line(&args.output);
        print(&format!("{name}: {width} × {height} pixels, {made} bricks, {seconds:.2} s"))
    }
}

fn options(args: &RenderArgs, store: &Store, cache_bytes: u64) -> Result<RenderOptions, Failure> {
    let meta = store.meta();
    let mut cuts = Vec::new();
    for cut in &args.cut {
        let at = cut.at.in_unit_of(&meta.unit).ok_or_else(no_unit)?;
        cuts.push(Cut { axis: cut.axis.into(), at, above: cut.above });
    }
    if let Some(within) = args.within {
        for (corner, above) in within.corners.into_iter().zip([false, true]) {
            cuts.extend(Axis::ALL.map(|axis| Cut { axis, at: corner[axis.index()], above }));
        }
    }
    let opening = args.perspective.unwrap_or(0.0);
    if args.perspective.is_some() && !(1.0..=150.0).contains(&opening) {
        return Err(Failure::Usage("--perspective takes 1 to 150 degrees".to_owned()));
    }
    Ok(RenderOptions {
        style: args.style.into(),
        view: View { opening, ..args.view.0 },
        bounds: [meta.bounds_min, meta.bounds_max],
        cuts,
        size: args.size.0,
        supersample: args.supersample,
        background: args.background.0,
        level: args.level,
        cache_bytes,
    })
}
