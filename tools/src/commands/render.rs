//! `brickfield render`: the part in space as a picture, or as pictures from all around.

use super::findings::{Findings, Search, require_own_options, search, shares};
use super::{make_folder, no_unit, of_store, open_store, require_level, start};
use crate::devices::{BackendArg, choose};
use crate::failure::Failure;
use crate::finding_args::{Finding, ShownArg};
use crate::memory;
use crate::output::{in_line, print, print_json, require_distinct, warn};
use crate::picture_args::{ColourArg, FocusArg, RenderArgs, StyleArg};
use crate::progress::Bars;
use crate::style_file::{self, StyleFile};
use brickfield_engine::backend::Vulkan;
use brickfield_engine::lattice::Axis;
use brickfield_engine::render::{
    Caster, CasterReport, CutPlane, Frame, RenderOptions, Scene, Style, View, write_frame, write_turn,
};
use brickfield_engine::store::{AcceptedStores, Store};
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// Most for bricks as the store decodes them: those that cuts ask for again.
const BRICK_CACHE_BYTES: u64 = 8 << 20;
/// How long a turn of an animation takes.
const TURN_SECONDS: f64 = 6.0;
/// Coarsest pictures: beyond it a cell of the root fills any screen.
const LOD_MAX: f64 = 4096.0;

/// Endings of pictures and films that are not written, in lower case.
const OTHER_FORMATS: [&str; 26] = [
    "avi", "avif", "bmp", "dxf", "exr", "gif", "heic", "jpeg", "jpg", "jxl", "m4v", "mkv", "mng", "mov",
    "mp4", "mpeg", "mpg", "ogv", "pdf", "ppm", "svg", "tga", "tif", "tiff", "webm", "webp",
];

/// What is written, by the output's name.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Picture,
    Animation,
    Folder,
}

impl Kind {
    fn of(args: &RenderArgs) -> Result<Kind, Failure> {
        let ends = |path: &Path, with: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(with));
        let refused = |path: &Path, what: &str| Err(Failure::Usage(format!("{}: {what}", in_line(path))));
        if let Some(preview) = args.preview.as_ref().filter(|preview| !ends(preview, "png")) {
            return refused(preview, "the coarse picture's name must end in .png");
        }
        match (args.turntable, ends(&args.output, "png"), ends(&args.output, "apng")) {
            (None, true, _) => Ok(Kind::Picture),
            (None, ..) => refused(&args.output, "the picture's name must end in .png, or take --turntable"),
            (Some(_), _, true) => Ok(Kind::Animation),
            (Some(_), true, _) => refused(
                &args.output,
                "--turntable makes many pictures; give a name that ends in .apng, or a folder",
            ),
            (Some(_), ..) if OTHER_FORMATS.iter().any(|ending| ends(&args.output, ending)) => refused(
                &args.output,
                "--turntable writes an animated PNG, whose name ends in .apng, or .png files in a folder; choose such a name",
            ),
            (Some(_), ..) => Ok(Kind::Folder),
        }
    }
}

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    let wanted = Search {
        shown: args.style.finding(),
        finding: &args.finding,
        output: &args.output,
        memory: args.memory.0,
        io: args.io,
        quiet: args.work.quiet,
    };
    let kind = checked(args, &wanted)?;
    if args.splats {
        return super::render_splats::run(args);
    }
    let started = Instant::now();
    let bars = start(args.work)?;
    let device = device(args)?;
    let store = open_store(&args.store, BRICK_CACHE_BYTES, args.io, AcceptedStores::Whole)?;
    let is_animated = kind == Kind::Animation;
    let caches = memory::render_caches(args.memory, device.as_ref(), &store, args.size.0, is_animated);
    if let Some(level) = args.level {
        require_level(&store, level)?;
    }
    let outputs: Vec<&Path> =
        [Some(&args.output), args.preview.as_ref()].into_iter().flatten().map(AsRef::as_ref).collect();
    require_distinct(&outputs, &[&args.store])?;
    let found = search(&wanted, &store, &bars)?;
    let (label_bytes, brick_bytes) = shares(found.as_ref(), args.memory.0, caches - BRICK_CACHE_BYTES);
    let options = options(args, &store, found.as_ref().map(Findings::style), brick_bytes)?;
    let sides = found.as_ref().map(|found| found.sides(&store)).transpose()?.flatten();
    let colours =
        found.as_ref().map(|found| found.colours(&store, sides.as_ref(), label_bytes)).transpose()?;
    let mut scene = Scene::new(&store, &options).map_err(|error| of_store(&store, "picture", error))?;
    if let (Some(colours), Some(found)) = (&colours, &found) {
        scene = scene.tinted(colours.tint());
        if !args.no_legend {
            scene = scene.with_legend(found.legend(&store, options.size[0] as usize));
        }
    }
    let caster = device.as_ref().map(|device| Caster::new(&scene, device.gpu()));
    let mut drawing = Drawing { args, store: &store, scene: &scene, caster, bars: &bars, started, told: 0 };
    drawing.write(kind, |frame| match colours.as_ref().zip(found.as_ref()) {
        Some((colours, found)) if args.numbers => colours.numbered(frame, found, &store),
        _ => Ok(frame),
    })?;
    let report = drawing.caster.as_ref().map(Caster::report);
    if let Some(CasterReport { name, failure: Some(failure), .. }) = report {
        warn(&format!("{name}: {failure}; the processor drew in its place"));
    }
    Ok(())
}

/// What is written, if the options fit each other.
fn checked(args: &RenderArgs, wanted: &Search<'_>) -> Result<Kind, Failure> {
    require_own_options(wanted)?;
    if args.no_legend && wanted.shown.is_none() {
        let what = "--no-legend belongs to --style voids, thickness, deviation and changes";
        return Err(Failure::Usage(what.to_owned()));
    }
    let kind = if args.splats { Kind::Picture } else { Kind::of(args)? };
    if args.numbers && (wanted.shown != Some(Finding::Voids) || kind == Kind::Animation) {
        let what = "--numbers belongs to --style voids and to pictures that do not move";
        return Err(Failure::Usage(what.to_owned()));
    }
    Ok(kind)
}

/// The device that draws, if one does: colours of their own are the processor's.
fn device(args: &RenderArgs) -> Result<Option<Vulkan>, Failure> {
    match args.style {
        ShownArg::Finding(_) if args.draws.backend == BackendArg::Vulkan => {
            let what =
                "the processor draws voids, thickness, deviations and changes; leave --backend vulkan out";
            Err(Failure::Usage(what.to_owned()))
        }
        ShownArg::Finding(_) => Ok(None),
        ShownArg::Style(_) => Ok(choose(&args.draws.backend(), Some(args.memory), None)?.device()),
    }
}

/// Pictures of a scene as they are written.
struct Drawing<'s> {
    args: &'s RenderArgs,
    store: &'s Store,
    scene: &'s Scene<'s>,
    caster: Option<Caster<'s>>,
    bars: &'s Bars,
    /// When the last picture was told of, or the command began.
    started: Instant,
    /// Bricks that were made until then.
    told: u64,
}

impl<'s> Drawing<'s> {
    /// Writes all pictures, with the numbers that they are to have.
    fn write(
        &mut self,
        kind: Kind,
        numbered: impl Fn(Frame<'s>) -> brickfield_engine::Result<Frame<'s>>,
    ) -> Result<(), Failure> {
        let (args, store) = (self.args, self.store);
        let refused = |error| of_store(store, "picture", error);
        match kind {
            Kind::Picture => {
                for frame in self.scene.frames() {
                    let frame = numbered(frame).map_err(refused)?;
                    if let Some(preview) = &args.preview {
                        self.frame(&frame.coarse(), preview)?;
                    }
                    self.frame(&frame, &args.output)?;
                }
            }
            Kind::Animation => {
                let (scene, caster) = (self.scene, self.caster.as_mut());
                write_turn(scene, caster, &args.output, TURN_SECONDS, self.bars).map_err(refused)?;
                self.say(&args.output, args.turntable)?;
            }
            Kind::Folder => {
                make_folder(&args.output)?;
                for (number, frame) in self.scene.frames().enumerate() {
                    let frame = numbered(frame).map_err(refused)?;
                    self.frame(&frame, &args.output.join(format!("{:04}.png", number + 1)))?;
                }
            }
        }
        Ok(())
    }

    fn frame(&mut self, frame: &Frame<'_>, path: &Path) -> Result<(), Failure> {
        write_frame(frame, self.caster.as_mut(), path, self.bars)
            .map_err(|error| of_store(self.store, "picture", error))?;
        self.say(path, None)
    }

    /// Tells of what was written since the last time.
    fn say(&mut self, path: &Path, frames: Option<u32>) -> Result<(), Failure> {
        self.bars.clear();
        let made = self.scene.summary().made + self.caster.as_ref().map_or(0, |caster| caster.summary().made);
        let bricks = made - std::mem::replace(&mut self.told, made);
        let seconds = std::mem::replace(&mut self.started, Instant::now()).elapsed().as_secs_f64();
        let drawn = RenderReport { path, size: self.scene.file_size(), frames, bricks, seconds };
        drawn.say(self.args, self.caster.as_ref().map(Caster::report))
    }
}

/// What was written: how many bricks were read for it, and how long it took.
struct RenderReport<'a> {
    path: &'a Path,
    size: [u32; 2],
    frames: Option<u32>,
    bricks: u64,
    seconds: f64,
}

impl RenderReport<'_> {
    /// Says so, and what a device did so far.
    fn say(&self, args: &RenderArgs, device: Option<&CasterReport>) -> Result<(), Failure> {
        let RenderReport { path, size: [width, height], frames, bricks, seconds } = *self;
        if args.json {
            let output = path.display().to_string();
            let mut said =
                json!({ "output": output, "size": [width, height], "bricks": bricks, "seconds": seconds });
            if let Some(frames) = frames {
                said["frames"] = frames.into();
            }
            if let Some(device) = device {
                said["device"] = json!(device);
            }
            return print_json(&said);
        }
        if args.work.quiet {
            return Ok(());
        }
        let frames = frames.map_or_else(String::new, |frames| format!("{frames} pictures of "));
        let by = device.filter(|device| device.failure.is_none());
        let by = by.map_or_else(String::new, |device| format!(", by {}", device.name));
        let name = in_line(path);
        print(&format!("{name}: {frames}{width} × {height} pixels, {bricks} bricks, {seconds:.2} s{by}"))
    }
}

/// What is cut away, in a store's unit.
pub(super) fn cuts(args: &RenderArgs, unit: &str) -> Result<Vec<CutPlane>, Failure> {
    let mut cuts = Vec::new();
    for cut in &args.cut {
        let at = cut.at.in_unit_of(unit).ok_or_else(no_unit)?;
        cuts.push(CutPlane { axis: cut.axis.into(), at, above: cut.above });
    }
    if let Some(within) = args.within {
        for (corner, above) in within.corners.into_iter().zip([false, true]) {
            cuts.extend(Axis::ALL.map(|axis| CutPlane { axis, at: corner[axis.index()], above }));
        }
    }
    Ok(cuts)
}

/// From where the part is seen.
pub(super) fn view(args: &RenderArgs) -> Result<View, Failure> {
    let opening = args.perspective.unwrap_or(0.0);
    if args.perspective.is_some() && !(1.0..=150.0).contains(&opening) {
        return Err(Failure::Usage("--perspective takes 1 to 150 degrees".to_owned()));
    }
    if !(0.0..=LOD_MAX).contains(&args.lod) {
        return Err(Failure::Usage(format!("--lod takes 0 to {LOD_MAX} pixels")));
    }
    Ok(View { opening, ..args.view.0 })
}

fn options(
    args: &RenderArgs,
    store: &Store,
    found: Option<Style>,
    cache_bytes: u64,
) -> Result<RenderOptions, Failure> {
    let meta = store.meta();
    let (view, cuts) = (view(args)?, cuts(args, &meta.unit)?);
    let StyleFile { style, background } = match (&args.style, found) {
        (_, Some(style)) => StyleFile { style, background: None },
        (ShownArg::Style(StyleArg::File(path)), _) => style_file::read(path, &meta.unit)?,
        (ShownArg::Style(StyleArg::Named(style)), _) => StyleFile { style: style(), background: None },
        (ShownArg::Finding(_), None) => unreachable!("it was searched"),
    };
    let ColourArg(background) = args.background.or(background).unwrap_or(ColourArg([255; 4]));
    Ok(RenderOptions {
        style,
        focus: args.focus.map(|FocusArg(focus)| focus),
        view,
        turn: args.turntable.unwrap_or(1),
        bounds: [meta.bounds_min, meta.bounds_max],
        cuts,
        size: args.size.0,
        supersample: args.supersample,
        background,
        level: args.level,
        cell_pixels: args.lod,
        cache_bytes,
    })
}
