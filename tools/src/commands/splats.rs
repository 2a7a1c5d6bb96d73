//! `brickfield splats`: the part as splats in a file.

use super::mesh_place::require_single;
use super::splat_picks::Picks;
use super::{CACHE_BYTES, no_unit, of_store, open_store, require_level, start, unit_of};
use crate::failure::Failure;
use crate::output::{in_line, print, print_json, require_distinct};
use crate::space::tell_left_behind;
use crate::splat_args::SplatsArgs;
use crate::units::{Size, Unit};
use brickfield_engine::Progress;
use brickfield_engine::ellipses::{EllipseOptions, ellipses_of};
use brickfield_engine::part::directory_of;
use brickfield_engine::splats::{
    BspSummary, GaussianSource, LevelsOptions, PageBytes, SplatLevels, bsp_bytes, write_bsp, write_glb,
    write_page, write_page_folder, write_ply,
};
use brickfield_engine::store::{AcceptedStores, BrickTree, Store};
use serde_json::{Value, json};
use std::path::Path;

/// Kinds of files.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Bsp,
    Ply,
    Glb,
    Page,
    Folder,
}

impl Kind {
    fn of(path: &Path) -> Result<Kind, Failure> {
        let is_folder = path.as_os_str().as_encoded_bytes().ends_with(b"/");
        if is_folder || path.is_dir() {
            return Ok(Kind::Folder);
        }
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or("").to_ascii_lowercase();
        match &*ending {
            "bsp" => Ok(Kind::Bsp),
            "ply" => Ok(Kind::Ply),
            "glb" => Ok(Kind::Glb),
            "html" => Ok(Kind::Page),
            _ => Err(Failure::Usage(format!(
                "{}: the name of a file of splats ends in one of .bsp, .html, .ply, .glb, that of a folder with a page in /",
                path.display()
            ))),
        }
    }
}

/// Runs the command.
pub fn run(args: &SplatsArgs) -> Result<(), Failure> {
    let kind = Kind::of(&args.output)?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, AcceptedStores::Whole)?;
    let (file, beside) = match kind {
        Kind::Folder => (&args.output.join("part.bsp"), Some(args.output.join("part.picks"))),
        _ => (&args.output, None),
    };
    let outputs: Vec<&Path> = std::iter::once(file).chain(&beside).map(AsRef::as_ref).collect();
    require_distinct(&outputs, &[&args.store])?;
    if let Some(level) = args.level {
        require_level(&store, level)?;
    }
    if matches!(kind, Kind::Ply | Kind::Glb) {
        require_single(
            &store,
            store.root(),
            &args.output,
            "write .bsp, or move the input nearer to the origin",
        )?;
    }
    if args.number.is_some() && !matches!(kind, Kind::Ply | Kind::Glb) {
        return Err(Failure::Usage("--number: ellipses are written as .ply or .glb".to_owned()));
    }
    if args.picks.is_some() && !matches!(kind, Kind::Page | Kind::Folder) {
        return Err(Failure::Usage("--picks: pages are written as .html, or into a folder".to_owned()));
    }
    tell_left_behind(file, args.work.quiet);
    let written = match args.number {
        Some(number) => of_ellipses(args, (kind, number), &store, &bars)?,
        None => of_cells(args, kind, &store, &bars)?,
    };
    bars.clear();
    if let (false, Some(picks)) = (args.work.quiet, &written.picks) {
        picks.tell();
    }
    if args.json {
        return print_json(&written.json);
    }
    if args.work.quiet { Ok(()) } else { print(&written.text) }
}

/// Writes the splats of cells.
fn of_cells(
    args: &SplatsArgs,
    kind: Kind,
    store: &Store,
    bars: &dyn Progress,
) -> Result<SplatsReport, Failure> {
    let error = match args.error {
        Some(error) => Some(error.in_unit_of(&store.meta().unit).ok_or_else(no_unit)?),
        None => None,
    };
    let folder = args.temp_dir.as_deref().unwrap_or(directory_of(&args.output));
    let memory = Some((args.memory.0, folder));
    let options = LevelsOptions { error, level: args.level, memory, ..LevelsOptions::default() };
    let levels = SplatLevels::new(store, options, bars).map_err(|error| of_store(store, "leaves", error))?;
    if matches!(kind, Kind::Ply | Kind::Glb) {
        let splats = gaussians(args, kind, store, GaussianSource::Cells(&levels, args.level))?;
        let output = args.output.display().to_string();
        let text = format!("{}: {splats} splats", in_line(&args.output));
        return Ok(SplatsReport { text, json: json!({ "output": output, "splats": splats }), picks: None });
    }
    all_levels(args, kind, (store, &levels), bars)
}

/// Writes so many ellipses.
fn of_ellipses(
    args: &SplatsArgs,
    (kind, number): (Kind, u32),
    store: &Store,
    bars: &dyn Progress,
) -> Result<SplatsReport, Failure> {
    let options = EllipseOptions { number, circles: args.circles, memory: args.memory.0 };
    let ellipses = ellipses_of(store, options, bars).map_err(|error| of_store(store, "leaves", error))?;
    let splats = gaussians(args, kind, store, GaussianSource::Ellipses(&ellipses))?;
    let error = ellipses.iter().map(|ellipse| ellipse.error).fold(0.0, f64::max);
    let what = if args.circles { "circles" } else { "ellipses" };
    // What is stated is never less than it is.
    let shown = (error * 10_000.0).ceil() / 10_000.0;
    let (name, unit) = (in_line(&args.output), unit_of(store.meta()));
    let text =
        format!("{name}: {splats} {what}, at most {shown:.4} {unit} from the crossings that they cover");
    let json = json!({
        "output": args.output.display().to_string(),
        "splats": splats,
        "error": error,
        "unit": store.meta().unit,
    });
    Ok(SplatsReport { text, json, picks: None })
}

/// Writes a file for other viewers; gives how many there are in it.
fn gaussians(
    args: &SplatsArgs,
    kind: Kind,
    store: &Store,
    source: GaussianSource<'_>,
) -> Result<u64, Failure> {
    let is_glb = kind == Kind::Glb;
    let metres = Unit::of_symbol(&store.meta().unit).map(Unit::metres);
    Ok(if is_glb { write_glb(source, metres, &args.output)? } else { write_ply(source, &args.output)? })
}

/// What is said of the file.
struct SplatsReport {
    text: String,
    json: Value,
    /// Of pages.
    picks: Option<Picks>,
}

/// Writes a file, a page or a folder of all levels.
fn all_levels(
    args: &SplatsArgs,
    kind: Kind,
    (store, levels): (&Store, &SplatLevels),
    bars: &dyn Progress,
) -> Result<SplatsReport, Failure> {
    let (unit, bounds) = (&store.meta().unit, [store.meta().bounds_min, store.meta().bounds_max]);
    let is_page = matches!(kind, Kind::Page | Kind::Folder);
    let mut picks = is_page.then(|| Picks::new(args, store, bars)).transpose()?;
    let (written, summary) = match (kind, &mut picks) {
        (Kind::Page, Some(picks)) => {
            let (bytes, summary) = bsp_bytes(levels, unit, bounds, bars)?;
            (write_page(&bytes, &picks.within(&bytes)?, &args.output)?, summary)
        }
        (Kind::Folder, Some(picks)) => {
            write_page_folder(levels, unit, bounds, &args.output, picks.beside(), bars)?
        }
        _ => {
            let summary = write_bsp(levels, unit, bounds, &args.output, bars)?;
            (PageBytes { all: summary.bytes, beads: 0 }, summary)
        }
    };
    Ok(SplatsReport { picks, ..said(args, store, &summary, written) })
}

/// What was written, all levels of it.
fn said(args: &SplatsArgs, store: &Store, summary: &BspSummary, bytes: PageBytes) -> SplatsReport {
    let bits = summary.bytes as f64 * 8.0 / summary.splats as f64;
    let BspSummary { splats, finest, error, .. } = *summary;
    // What is stated is never less than it is.
    let shown = (error * 1000.0).ceil() / 1000.0;
    let (name, unit) = (in_line(&args.output), unit_of(store.meta()));
    let beads = match bytes.beads {
        0 => String::new(),
        beads => format!("; {} of beads for picks", Size(beads)),
    };
    let each = if splats > 0 { format!(", {bits:.2} bits each") } else { String::new() };
    let text = format!(
        "{name}: {splats} splats in {}{each}; {finest} in the finest picture, at most {shown:.3} {unit} from \
         the crossings that they stand for{beads}",
        Size(bytes.all)
    );
    let json = json!({
        "output": args.output.display().to_string(),
        "splats": splats,
        "finest": finest,
        "error": error,
        "bytes": bytes.all,
        "splat_bytes": summary.bytes,
        "bead_bytes": bytes.beads,
        "unit": store.meta().unit,
    });
    SplatsReport { text, json, picks: None }
}
