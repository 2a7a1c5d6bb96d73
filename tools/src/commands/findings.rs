//! What analyses find, made ready for pictures: searched once, then a colour for every point that is seen.

use super::reference::{Compared, OpenReference, open_reference, require_alike};
use super::voids::open_cad;
use super::{no_unit, open_store, require_whole_samples};
use crate::args::IoArg;
use crate::distance_args::{AlignArg, MeasureArg};
use crate::failure::Failure;
use crate::finding_args::{ColourByArg, Finding, FindingArgs};
use crate::output::{in_line, note, require_distinct};
use crate::progress::Bars;
use crate::units::Length;
use anyhow::anyhow;
use brickfield_engine::contour::{ContourOptions, PositionsSink, contour};
use brickfield_engine::distance::deviation::{Motion, Reference};
use brickfield_engine::distance::thickness::{Method, Options};
use brickfield_engine::distance::{Sides, Surface, align};
use brickfield_engine::overlay::{
    DeviationScale, ThicknessScale, rounded_up, usual_deviation, usual_thickness,
};
use brickfield_engine::part::directory_of;
use brickfield_engine::store::{AcceptedStores, BrickTree, Store};
use brickfield_engine::voids::{Class, Detail, Void, VoidOptions, Voids, find};
use std::path::Path;

/// What the user wants to be found.
pub(super) struct Search<'a> {
    pub shown: Option<Finding>,
    pub finding: &'a FindingArgs,
    /// What is written; beside it lie temporary files.
    pub output: &'a Path,
    /// Bytes in all.
    pub memory: u64,
    pub io: IoArg,
    pub quiet: bool,
}

/// What was found in a store.
pub(super) enum Findings {
    Voids {
        found: Box<Voids>,
        by: ColourByArg,
        shown: Vec<bool>,
    },
    Thickness {
        surface: Box<Surface>,
        options: Options,
        scale: ThicknessScale,
    },
    Deviation {
        surface: Box<Surface>,
        opened: Box<OpenReference>,
        motion: Motion,
        scale: DeviationScale,
    },
    /// The store as it was, and its voids.
    Changes {
        before: Box<Store>,
        voids: Box<Voids>,
    },
}

/// Refuses options that belong to what is not shown.
pub(super) fn require_own_options(args: &Search<'_>) -> Result<(), Failure> {
    let shown = args.shown;
    if let Some((option, owner)) = args.finding.given().find(|(_, owner)| Some(*owner) != shown) {
        return Err(Failure::Usage(format!("{option} belongs to --style {}", owner.name())));
    }
    if args.finding.range.is_some() && !matches!(shown, Some(Finding::Thickness | Finding::Deviation)) {
        return Err(Failure::Usage("--range belongs to --style thickness and deviation".to_owned()));
    }
    if shown == Some(Finding::Changes) && args.finding.before.is_none() {
        return Err(Failure::Usage("--style changes needs --before, the store as it was".to_owned()));
    }
    if shown == Some(Finding::Deviation) && args.finding.reference.is_none() {
        return Err(Failure::Usage(
            "--style deviation needs --reference, a mesh, a store, or points".to_owned(),
        ));
    }
    Ok(())
}

/// Least bytes for what is looked up while a picture is drawn.
const CACHES_MIN: u64 = 8 << 20;

/// Bytes for labels, and for bricks, of what caches of a picture have beside what was found: labels are asked for beside bricks.
pub(super) fn shares(found: Option<&Findings>, memory: u64, caches: u64) -> (u64, u64) {
    let held = found.map_or(0, |found| found.bytes(memory));
    let caches = caches.saturating_sub(held).max(CACHES_MIN);
    if found.is_some() { (caches / 4, caches / 4 * 3) } else { (0, caches) }
}

/// Searches the store.
pub(super) fn search(args: &Search<'_>, store: &Store, bars: &Bars) -> Result<Option<Findings>, Failure> {
    let Some(finding) = args.shown else { return Ok(None) };
    Ok(Some(match finding {
        Finding::Voids => voids(args, store, bars)?,
        Finding::Thickness => {
            require_whole_samples(store, "thickness cannot be told")?;
            let below = length(args.finding.below, store)?;
            let method = match args.finding.measure.unwrap_or_default() {
                MeasureArg::Sphere => Method::Sphere { separation: args.finding.separation.unwrap_or(100.0) },
                MeasureArg::Ray => Method::Ray,
            };
            let options = Options { method, gaps: args.finding.gaps };
            let surface = surface(args, store, bars)?;
            let most = match below.or(length(args.finding.range, store)?) {
                Some(most) => most,
                None => rounded_up(usual_thickness(&surface, options)?),
            };
            let scale = ThicknessScale { most, is_limit: below.is_some() };
            Findings::Thickness { surface: Box::new(surface), options, scale }
        }
        Finding::Deviation => deviation(args, store, bars)?,
        Finding::Changes => changes(args, store, bars)?,
    }))
}

fn voids(args: &Search<'_>, store: &Store, bars: &Bars) -> Result<Findings, Failure> {
    require_whole_samples(store, "what is enclosed cannot be told")?;
    let name = in_line(store.path());
    let has_identity = store.meta().beads.as_ref().is_some_and(|beads| beads.identity.is_some());
    let cad = args.finding.cad.as_deref();
    let cad = cad.map(|cad| open_cad((cad, args.output), store, (args.memory / 8, args.io))).transpose()?;
    let has_classes = has_identity || cad.is_some();
    let asks_classes = !args.finding.classes.is_empty() || args.finding.colour_by == Some(ColourByArg::Class);
    if asks_classes && !has_classes {
        let what = "the store does not tell beads apart, so voids have no class";
        return Err(anyhow!("{name}: {what}; build it from toolpaths with --identity, or give --cad").into());
    }
    let by = args.finding.colour_by;
    let by = by.unwrap_or(if has_classes { ColourByArg::Class } else { ColourByArg::Size });
    let needs_classes = by == ColourByArg::Class || !args.finding.classes.is_empty();
    let detail = if needs_classes { Detail::Classes } else { Detail::Volumes };
    let min_volume = args.finding.min_volume.unwrap_or(0.0);
    let cad = cad.as_ref();
    let closing = length(args.finding.closing, store)?;
    let options =
        VoidOptions { memory: args.memory, detail, min_volume, cad, closing, ..VoidOptions::default() };
    let found = find(store, &options, bars)?;
    if found.voids.is_empty() && !args.quiet {
        bars.clear();
        let which = if found.left_out > 0 { " so large" } else { "" };
        note(&format!("{name}: it has no voids{which}, so the picture shows none"));
    }
    let classes: Vec<Class> = args.finding.classes.iter().map(|&class| class.into()).collect();
    let is_shown =
        |void: &Void| classes.is_empty() || void.class.is_some_and(|class| classes.contains(&class));
    let shown = found.voids.iter().map(is_shown).collect();
    Ok(Findings::Voids { found: Box::new(found), by, shown })
}

/// A length in the store's unit.
fn length(length: Option<Length>, store: &Store) -> Result<Option<f64>, Failure> {
    length.map(|length| length.in_unit_of(&store.meta().unit).ok_or_else(no_unit)).transpose()
}

fn surface(args: &Search<'_>, store: &Store, bars: &Bars) -> Result<Surface, Failure> {
    let folder = args.finding.temp_dir.as_deref().unwrap_or(directory_of(args.output));
    Ok(Surface::new(store, args.memory / 4, folder, bars)?)
}

fn changes(args: &Search<'_>, store: &Store, bars: &Bars) -> Result<Findings, Failure> {
    let Some(path) = &args.finding.before else {
        return Err(Failure::Usage("--style changes needs --before".to_owned()));
    };
    require_whole_samples(store, "what is new cannot be told")?;
    require_distinct(&[args.output], &[path])?;
    let before = open_store(path, args.memory / 8, args.io, AcceptedStores::Whole)?;
    require_whole_samples(&before, "what is new cannot be told")?;
    let lattice = |store: &Store| (store.root(), store.meta().depth, store.meta().unit.clone());
    if lattice(&before) != lattice(store) {
        let (name, own) = (in_line(path), in_line(store.path()));
        let what = format!("its samples do not stand where those of {own} do");
        return Err(anyhow!("{name}: {what}; give the store that `csg` or `machine` made it of").into());
    }
    let options = VoidOptions { memory: args.memory / 2, detail: Detail::Volumes, ..VoidOptions::default() };
    let voids = find(&before, &options, bars)?;
    Ok(Findings::Changes { before: Box::new(before), voids: Box::new(voids) })
}

fn deviation(args: &Search<'_>, store: &Store, bars: &Bars) -> Result<Findings, Failure> {
    require_whole_samples(store, "its deviation cannot be told")?;
    let Some(reference) = &args.finding.reference else {
        return Err(Failure::Usage("--style deviation needs --reference".to_owned()));
    };
    let how = args.finding.align.unwrap_or_default();
    let compared = Compared {
        reference,
        output: args.output,
        folder: args.finding.temp_dir.as_deref().unwrap_or(directory_of(args.output)),
        memory: args.memory,
        io: args.io,
        align: how,
    };
    let (within, range) = (length(args.finding.within, store)?, length(args.finding.range, store)?);
    let opened = open_reference(&compared, store, bars)?;
    let surface = surface(args, store, bars)?;
    let Some(bounds) = surface.bounds() else {
        let name = in_line(store.path());
        return Err(anyhow!("{name}: the store has no surface; build it with finer cells").into());
    };
    let (motion, most) = {
        let (sides, sides_of_part) = (opened.sides()?, Sides::new(store)?);
        let reference = |motion: Motion| opened.reference(sides.as_ref(), (&surface, &sides_of_part), motion);
        let first = reference(Motion::NONE);
        require_alike(&compared, bounds, first)?;
        let motion = motion(args, store, (how, bounds), first, bars)?;
        let reference = reference(motion);
        let most = range.map_or_else(|| usual_deviation(&surface, reference, motion), Ok)?;
        (motion, most)
    };
    let within = within.unwrap_or(0.0);
    if range.is_some_and(|range| range <= within) {
        return Err(Failure::Usage("--range must be larger than --within".to_owned()));
    }
    let most = if range.is_some() { most } else { rounded_up(most.max(2.0 * within)) };
    let scale = DeviationScale { most, within };
    Ok(Findings::Deviation { surface: Box::new(surface), opened: Box::new(opened), motion, scale })
}

/// What lays the part over the reference: by the vertices of its mesh, as `deviation` does it.
fn motion(
    args: &Search<'_>,
    store: &Store,
    (how, bounds): (AlignArg, [[f64; 3]; 2]),
    reference: Reference<'_>,
    bars: &Bars,
) -> Result<Motion, Failure> {
    if how == AlignArg::None {
        return Ok(Motion::NONE);
    }
    let mut mesh = PositionsSink::default();
    let contouring = ContourOptions { cache_bytes: (args.memory / 4) as usize, ..ContourOptions::default() };
    contour(store, &contouring, &mut mesh, bars)?;
    let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|p| p.map(f64::from)).collect();
    Ok(align(&positions, bounds, reference, how.into())?.0)
}
