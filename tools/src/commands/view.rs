//! `brickfield view`: the part in a window.

use super::finding_colours::Colours;
use super::findings::{Findings, Search, require_own_options, search, shares};
use super::{no_unit, of_store, open_store, start};
use crate::devices::choose;
use crate::failure::Failure;
use crate::finding_args::{Finding, ShownArg};
use crate::interrupt;
use crate::kinds::typed;
use crate::memory;
use crate::output::{in_line, require_distinct};
use crate::picture_args::{ColourArg, StyleArg};
use crate::style_file::{self, StyleFile};
use crate::view::{
    Appearance, CpuPainter, Painter, ScreenshotLook, ScreenshotMessages, Screenshots, ScriptLine, ScriptStep,
    Session, ViewedStore, VulkanPainter, Window, place, read_script, screenshot_name,
};
use crate::view_args::WindowArgs;
use crate::void_table::{self, VoidPlace};
use anyhow::anyhow;
use brickfield_engine::picture::WHITE;
use brickfield_engine::render::{RenderOptions, Scene, Style};
use brickfield_engine::store::{AcceptedStores, BrickTree, Store};
use std::path::Path;

/// Most for bricks as the store decodes them: those that cuts ask for again.
const BRICK_CACHE_BYTES: u64 = 8 << 20;
/// Size up to which cells of a coarser level stand for those below, as in `render` without --lod.
const CELL_PIXELS: f64 = 0.5;

/// Runs the command.
pub fn run(args: &WindowArgs) -> Result<(), Failure> {
    let script = args.script.as_deref().map(read_script).transpose()?.unwrap_or_default();
    require_size(args.size.0).map_err(Failure::Usage)?;
    let stem = args.store.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let wanted = Search {
        shown: args.style.finding(),
        finding: &args.finding,
        output: &screenshot_name(&stem, 1),
        memory: args.memory.0,
        io: args.io,
        quiet: args.work.quiet,
    };
    require_own_options(&wanted)?;
    let bars = start(args.work)?;
    let device = choose(&args.draws.backend(), Some(args.memory), None)?.device();
    let store = open_store(&args.store, BRICK_CACHE_BYTES, args.io, AcceptedStores::Whole)?;
    let caches = memory::render_caches(args.memory, device.as_ref(), &store, args.size.0, false);
    let mut looks = NamedStyles::new();
    let mut style = match &args.style {
        ShownArg::Style(StyleArg::Named(make)) => {
            Style::NAMED.iter().position(|(_, named)| named() == make()).unwrap_or(0)
        }
        ShownArg::Style(StyleArg::File(path)) => looks.add(path, &store)?,
        ShownArg::Finding(_) => 0,
    };
    let mut part = part(args, &store)?;
    check((args, wanted.shown), &script, &store, &part, &mut looks)?;
    let found = search(&wanted, &store, &bars)?;
    bars.clear();
    let (label_bytes, brick_bytes) = shares(found.as_ref(), args.memory.0, caches - BRICK_CACHE_BYTES);
    let sides = found.as_ref().map(|found| found.sides(&store)).transpose()?.flatten();
    let colours =
        found.as_ref().map(|found| found.colours(&store, sides.as_ref(), label_bytes)).transpose()?;
    if let Some((finding, (found, colours))) = wanted.shown.zip(found.as_ref().zip(colours.as_ref())) {
        style = looks.add_found(finding, found, colours);
        // So that its letters are as large as those of the status line.
        part.legend = Some((style, found.legend(&store, args.size.0[0] as usize * 2 / 3)));
        if args.voids.is_none() {
            part.voids = found.voids_shown().map(VoidPlace::of).collect();
        }
    }
    part.styles = looks.names.clone();
    let options = options(args, &store, &looks.looks[style], brick_bytes);
    let screenshots = screenshots(args, stem, &looks);
    // What makes no picture is refused before a window is opened.
    let scene = Scene::new(&store, &options).map_err(|error| of_store(&store, "picture", error))?;
    let here = CpuPainter::new(scene, looks.looks, options);
    let mut painter: Box<dyn Painter + Send> = match device {
        Some(device) => Box::new(VulkanPainter::new(here, device.gpu())),
        None => Box::new(here),
    };
    let window = Window {
        title: format!("{} - Brickfield", in_line(&args.store)),
        session: Session::new(part, args.view.0, style, args.size.0),
        script,
        screenshots,
    };
    // The first Ctrl-C ends it: there is nothing to be made safe.
    interrupt::end_at_once(true);
    window.run(&mut *painter)
}

/// What all pictures have in common.
fn options(args: &WindowArgs, store: &Store, look: &Appearance<'_>, cache_bytes: u64) -> RenderOptions {
    let meta = store.meta();
    RenderOptions {
        style: look.style.clone(),
        view: args.view.0,
        turn: 1,
        focus: None,
        bounds: [meta.bounds_min, meta.bounds_max],
        cuts: Vec::new(),
        size: args.size.0,
        supersample: args.supersample,
        background: WHITE,
        level: None,
        cell_pixels: CELL_PIXELS,
        cache_bytes,
    }
}

fn screenshots(args: &WindowArgs, stem: String, looks: &NamedStyles<'_>) -> Screenshots {
    let look = |look: &Appearance<'_>| ScreenshotLook {
        opaque: look.background[3] == 255,
        options: if look.tint.is_some() { args.finding.options() + " --no-legend" } else { String::new() },
    };
    Screenshots {
        stem,
        looks: looks.looks.iter().map(look).collect(),
        options: if args.supersample == 2 {
            String::new()
        } else {
            format!(" --supersample {}", args.supersample)
        },
        device: match &args.draws.device {
            Some(name) => format!(" --device {}", typed(name.as_ref())),
            None => " --backend vulkan".to_owned(),
        },
        saying: match (args.json, args.work.quiet) {
            (true, _) => ScreenshotMessages::Json,
            (false, true) => ScreenshotMessages::Nothing,
            (false, false) => ScreenshotMessages::Text,
        },
    }
}

/// Styles by their names.
struct NamedStyles<'a> {
    names: Vec<String>,
    looks: Vec<Appearance<'a>>,
}

impl<'a> NamedStyles<'a> {
    /// Those that are built in.
    fn new() -> NamedStyles<'a> {
        let named = Style::NAMED.iter();
        let (names, looks) = named
            .map(|(name, style)| {
                ((*name).to_owned(), Appearance { style: style(), background: WHITE, tint: None })
            })
            .unzip();
        NamedStyles { names, looks }
    }

    /// That of a file as well; its number.
    fn add(&mut self, path: &Path, store: &Store) -> Result<usize, Failure> {
        let name = path.display().to_string();
        if let Some(known) = self.names.iter().position(|known| *known == name) {
            return Ok(known);
        }
        let StyleFile { style, background } = style_file::read(path, &store.meta().unit)?;
        let ColourArg(background) = background.unwrap_or(ColourArg(WHITE));
        self.looks.push(Appearance { style, background, tint: None });
        self.names.push(name);
        Ok(self.names.len() - 1)
    }

    /// What was found as well; its number.
    fn add_found(&mut self, finding: Finding, found: &Findings, colours: &'a Colours<'a>) -> usize {
        self.looks.push(Appearance { style: found.style(), background: WHITE, tint: Some(colours.tint()) });
        self.names.push(finding.name().to_owned());
        self.names.len() - 1
    }
}

/// Most layers that are told apart.
const LAYERS_MAX: f64 = 1e9;
/// Most pixels of a window: 24 bytes are held for each.
const PIXELS_MAX: u64 = 1 << 26;

fn require_size([width, height]: [u32; 2]) -> Result<(), String> {
    if u64::from(width) * u64::from(height) <= PIXELS_MAX {
        return Ok(());
    }
    Err(format!("no window has {width} × {height} pixels; choose fewer, at most {PIXELS_MAX} in all"))
}

fn part(args: &WindowArgs, store: &Store) -> Result<ViewedStore, Failure> {
    let meta = store.meta();
    let deepest = store.deepest_level();
    let pitch = match args.layer_height {
        Some(height) => height.in_unit_of(&meta.unit).ok_or_else(no_unit)?,
        None => store.root().spacing(deepest),
    };
    let bounds = [meta.bounds_min, meta.bounds_max];
    let longest = (0..3).map(|a| bounds[1][a] - bounds[0][a]).fold(0.0, f64::max);
    if !(pitch > 0.0 && longest / pitch <= LAYERS_MAX) {
        return Err(Failure::Usage(format!(
            "--layer-height {pitch} makes too many layers; choose thicker ones"
        )));
    }
    let voids = args.voids.as_deref().map(void_table::read).transpose()?.unwrap_or_default();
    Ok(ViewedStore { bounds, unit: meta.unit.clone(), pitch, styles: Vec::new(), voids, legend: None })
}

/// Refuses a script that will not do, before a window is opened.
fn check(
    (args, shown): (&WindowArgs, Option<Finding>),
    script: &[ScriptLine],
    store: &Store,
    part: &ViewedStore,
    looks: &mut NamedStyles<'_>,
) -> Result<(), Failure> {
    let mut outputs: Vec<&Path> = Vec::new();
    for ScriptLine { number, step } in script {
        let refused = |what: String| {
            let name = args.script.as_deref().map_or_else(String::new, in_line);
            anyhow!("{name}: line {number}: {what}")
        };
        match step {
            ScriptStep::Size(size) => require_size(*size).map_err(refused)?,
            ScriptStep::Cut(Some(cut)) => drop(place(*cut, part).map_err(refused)?),
            // Those that are found are not known yet.
            ScriptStep::Void(_) if args.voids.is_none() && shown == Some(Finding::Voids) => {}
            ScriptStep::Void(id) if !part.voids.iter().any(|void| void.id == *id) => {
                let what = format!("there is no void {id} in the table; give one that has it with --voids");
                return Err(refused(what).into());
            }
            ScriptStep::Style(name) if Finding::named(name).is_some_and(|found| Some(found) != shown) => {
                let what = format!("{name} have not been looked for; begin with --style {name}");
                return Err(refused(what).into());
            }
            ScriptStep::Style(name) if Finding::named(name).is_none() && !looks.names.contains(name) => {
                looks.add(Path::new(name), store)?;
            }
            ScriptStep::Screenshot(path) if !outputs.contains(&path.as_path()) => outputs.push(path),
            _ => {}
        }
    }
    let inputs: Vec<&Path> = [Some(args.store.as_path()), args.script.as_deref(), args.voids.as_deref()]
        .into_iter()
        .flatten()
        .collect();
    require_distinct(&outputs, &inputs)
}
