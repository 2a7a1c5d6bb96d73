//! What analyses find, made ready for pictures: searched once, then a colour for every point that is seen.

use super::deviation::{Compared, Opened, open_reference, require_alike};
use super::voids::length_told;
use super::{no_unit, require_whole_samples, unit_of};
use crate::distance_args::{AlignArg, MeasureArg};
use crate::failure::Failure;
use crate::finding_args::{ColourByArg, Finding, ShownArg};
use crate::output::{in_line, note};
use crate::picture_args::RenderArgs;
use crate::progress::Bars;
use crate::units::Length;

use anyhow::anyhow;
use brickfield_engine::contour::{ContourOptions, contour};
use brickfield_engine::distance::deviation::{Motion, Reference};
use brickfield_engine::distance::thickness::{Method, Options};
use brickfield_engine::distance::{Align, ScalarPly, Sides, Surface, align};
use brickfield_engine::overlay::{
    DeviationScale, DeviationTint, ThicknessScale, ThicknessTint, VoidTint, class_colour, rounded_up,
    size_along, size_colour, usual_deviation, usual_thickness,
};
use brickfield_engine::part::{PartFile, directory_of};
use brickfield_engine::picture::{Bar, Canvas, Legend};
use brickfield_engine::render::{Style, Tint};
use brickfield_engine::section::plain;
use brickfield_engine::store::Store;
use brickfield_engine::voids::{Class, Detail, Void, VoidOptions, Voids, find};

/// What was found in a store.
pub(super) enum Found {
    Voids { found: Box<Voids>, by: ColourByArg, shown: Vec<bool> },
    Thickness { surface: Box<Surface>, options: Options, scale: ThicknessScale },
    Deviation { surface: Box<Surface>, opened: Opened, motion: Motion, scale: DeviationScale },
}

/// Refuses options that belong to what is not shown.
pub(super) fn require_own_options(args: &RenderArgs) -> Result<(), Failure> {
    let shown = match &args.style {
        ShownArg::Finding(finding) => Some(*finding),
        ShownArg::Style(_) => None,
    };
    if let Some((option, owner)) = args.finding.given().find(|(_, owner)| Some(*owner) != shown) {
        let name =
            Finding::NAMED.into_iter().find(|(_, finding)| *finding == owner).map_or("", |(name, _)| name);
        return Err(Failure::Usage(format!("{option} belongs to --style {name}")));
    }
    if args.finding.range.is_some() && !matches!(shown, Some(Finding::Thickness | Finding::Deviation)) {
        return Err(Failure::Usage("--range belongs to --style thickness and deviation".to_owned()));
    }
    if shown == Some(Finding::Deviation) && args.finding.reference.is_none() {
        return Err(Failure::Usage("--style deviation needs --reference, a mesh or a store".to_owned()));
    }
    Ok(())
}

/// Searches the store.
pub(super) fn search(
    args: &RenderArgs,
    finding: Finding,
    store: &Store,
    bars: &Bars,
) -> Result<Found, Failure> {
    match finding {
        Finding::Voids => voids(args, store, bars),
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
            Ok(Found::Thickness { surface: Box::new(surface), options, scale })
        }
        Finding::Deviation => deviation(args, store, bars),
    }
}

fn voids(args: &RenderArgs, store: &Store, bars: &Bars) -> Result<Found, Failure> {
    require_whole_samples(store, "what is enclosed cannot be told")?;
    let name = in_line(store.path());
    let has_identity = store.meta().beads.as_ref().is_some_and(|beads| beads.identity.is_some());
    let asks_classes = !args.finding.classes.is_empty() || args.finding.colour_by == Some(ColourByArg::Class);
    if asks_classes && !has_identity {
        let what = "the store does not tell beads apart, so voids have no class";
        return Err(anyhow!("{name}: {what}; build it from toolpaths with --identity").into());
    }
    let by = args.finding.colour_by;
    let by = by.unwrap_or(if has_identity { ColourByArg::Class } else { ColourByArg::Size });
    let needs_classes = by == ColourByArg::Class || !args.finding.classes.is_empty();
    let detail = if needs_classes { Detail::Classes } else { Detail::Volumes };
    let found = find(store, &VoidOptions { memory: args.memory.0, detail, ..VoidOptions::default() }, bars)?;
    if found.voids.is_empty() {
        bars.clear();
        note(&format!("{name}: it has no voids, so the picture shows none"));
    }
    let classes: Vec<Class> = args.finding.classes.iter().map(|&class| class.into()).collect();
    let is_shown =
        |void: &Void| classes.is_empty() || void.class.is_some_and(|class| classes.contains(&class));
    let shown = found.voids.iter().map(is_shown).collect();
    Ok(Found::Voids { found: Box::new(found), by, shown })
}

/// A length in the store's unit.
fn length(length: Option<Length>, store: &Store) -> Result<Option<f64>, Failure> {
    length.map(|length| length.in_unit_of(&store.meta().unit).ok_or_else(no_unit)).transpose()
}

fn surface(args: &RenderArgs, store: &Store, bars: &Bars) -> Result<Surface, Failure> {
    let folder = args.finding.temp_dir.as_deref().unwrap_or(directory_of(&args.output));
    Ok(Surface::new(store, args.memory.0 / 4, folder, bars)?)
}

fn deviation(args: &RenderArgs, store: &Store, bars: &Bars) -> Result<Found, Failure> {
    require_whole_samples(store, "its deviation cannot be told")?;
    let Some(reference) = &args.finding.reference else {
        return Err(Failure::Usage("--style deviation needs --reference".to_owned()));
    };
    let how = args.finding.align.unwrap_or_default();
    let compared = Compared {
        reference,
        output: &args.output,
        folder: args.finding.temp_dir.as_deref().unwrap_or(directory_of(&args.output)),
        memory: args.memory.0,
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
        let sides = opened.sides()?;
        let reference = opened.reference(sides.as_ref());
        require_alike(&compared, bounds, reference.bounds())?;
        let motion = motion(args, store, (how, bounds), reference, bars)?;
        let most = range.map_or_else(|| usual_deviation(&surface, reference, motion), Ok)?;
        (motion, most)
    };
    let within = within.unwrap_or(0.0);
    if range.is_some_and(|range| range <= within) {
        return Err(Failure::Usage("--range must be larger than --within".to_owned()));
    }
    let most = if range.is_some() { most } else { rounded_up(most.max(2.0 * within)) };
    let scale = DeviationScale { most, within };
    Ok(Found::Deviation { surface: Box::new(surface), opened, motion, scale })
}

/// What lays the part over the reference: by the vertices of its mesh, as `deviation` does it.
fn motion(
    args: &RenderArgs,
    store: &Store,
    (how, bounds): (AlignArg, [[f64; 3]; 2]),
    reference: Reference<'_>,
    bars: &Bars,
) -> Result<Motion, Failure> {
    let how = match how {
        AlignArg::None => return Ok(Motion::NONE),
        AlignArg::Shift => Align::Shift,
        AlignArg::Icp => Align::Rigid,
    };
    // The mesh itself is dropped.
    let mut ply = ScalarPly::new(PartFile::create(&args.output)?, "deviation")?;
    let contouring =
        ContourOptions { cache_bytes: (args.memory.0 / 4) as usize, ..ContourOptions::default() };
    contour(store, &contouring, &mut ply, bars)?;
    Ok(align(ply.positions(), bounds, reference, how)?.0)
}

impl Found {
    /// What is drawn of the part itself.
    pub fn style(&self) -> Style {
        match self {
            Found::Voids { .. } => Style::haze(),
            Found::Thickness { .. } | Found::Deviation { .. } => Style::tinted(),
        }
    }

    /// Bytes that it takes.
    pub fn bytes(&self, memory: u64) -> u64 {
        match self {
            Found::Voids { found, .. } => found.label_bytes(),
            Found::Thickness { .. } => memory / 4,
            Found::Deviation { .. } => memory / 2,
        }
    }

    /// Where a reference is inside, if it is a store.
    pub fn sides(&self) -> Result<Option<Sides<'_>>, Failure> {
        match self {
            Found::Deviation { opened, .. } => opened.sides(),
            Found::Voids { .. } | Found::Thickness { .. } => Ok(None),
        }
    }

    /// Its colours.
    pub fn tint<'a>(
        &'a self,
        store: &'a Store,
        sides: Option<&'a Sides<'a>>,
        bytes: u64,
    ) -> Box<dyn Tint + 'a> {
        match self {
            Found::Voids { found, by, shown } => {
                let most = found.voids.first().map_or(0.0, Void::equivalent_diameter);
                let colour = |void: &Void| match by {
                    ColourByArg::Class => class_colour(void.class),
                    ColourByArg::Size => size_colour(void, most),
                };
                let colours = found.voids.iter().zip(shown).map(|(void, shown)| shown.then(|| colour(void)));
                let colours = colours.collect();
                Box::new(VoidTint::new(store, found, colours, bytes))
            }
            Found::Thickness { surface, options, scale } => {
                Box::new(ThicknessTint { surface, options: *options, scale: *scale })
            }
            Found::Deviation { surface, opened, motion, scale } => {
                let reference = opened.reference(sides);
                Box::new(DeviationTint { surface, reference, motion: *motion, scale: *scale })
            }
        }
    }

    /// What its colours mean, for a picture of that width.
    pub fn legend(&self, store: &Store, width: u32) -> Canvas {
        let unit = unit_of(store.meta());
        let width = width as usize;
        match self {
            Found::Voids { found, by, shown } => {
                legend_of_voids(store, &found.voids, (*by, shown), unit).draw(width)
            }
            Found::Thickness { options, scale, .. } => {
                let title = format!("{} in {unit}", if options.gaps { "gaps" } else { "thickness" });
                let end = if scale.is_limit { "" } else { ">" };
                let mut ticks =
                    [0.0, 0.25, 0.5, 0.75].map(|share| (share, plain(scale.most * share))).to_vec();
                ticks.push((1.0, format!("{end}{}", plain(scale.most))));
                let bar = Some(Bar { colour: &ThicknessScale::along, ticks });
                let beyond = if options.gaps { "wider" } else { "thicker" };
                let plain = ThicknessScale::plain();
                let swatches = if scale.is_limit { vec![(plain, beyond.to_owned())] } else { Vec::new() };
                Legend { title, bar, swatches }.draw(width)
            }
            Found::Deviation { scale, .. } => {
                let place = |value: f64| (0.5 + 0.5 * value / scale.most, plain(value));
                let mut values = vec![-0.5 * scale.most, 0.0, 0.5 * scale.most];
                let mut swatches = Vec::new();
                if scale.within > 0.0 {
                    values = vec![-scale.within, scale.within];
                    swatches.push((DeviationScale::allowed(), format!("within {}", plain(scale.within))));
                }
                let mut ticks = vec![(0.0, format!("<{}", plain(-scale.most)))];
                ticks.extend(values.into_iter().map(place));
                ticks.push((1.0, format!(">{}", plain(scale.most))));
                let colour = |share: f64| scale.along(share);
                let bar = Some(Bar { colour: &colour, ticks });
                Legend { title: format!("deviation in {unit}"), bar, swatches }.draw(width)
            }
        }
    }
}

fn legend_of_voids(
    store: &Store,
    voids: &[Void],
    (by, shown): (ColourByArg, &[bool]),
    unit: &str,
) -> Legend<'static> {
    let seen: Vec<&Void> =
        voids.iter().zip(shown).filter(|(_, shown)| **shown).map(|(void, _)| void).collect();
    let Some(largest) = voids.first().filter(|_| !seen.is_empty()) else {
        return Legend { title: "no voids".to_owned(), bar: None, swatches: Vec::new() };
    };
    if by == ColourByArg::Size {
        let count = seen.len();
        let s = if count == 1 { "" } else { "s" };
        let title = format!("equivalent diameter of {count} void{s} in {unit}");
        // As the table has it.
        let diameter = length_told(store, largest.equivalent_diameter()).to_string();
        let ticks = vec![(0.0, "0".to_owned()), (1.0, diameter)];
        return Legend { title, bar: Some(Bar { colour: &size_along, ticks }), swatches: Vec::new() };
    }
    let classes = [Some(Class::Pocket), Some(Class::Infill), Some(Class::Flaw), None];
    let count = |class: Option<Class>| seen.iter().filter(|void| void.class == class).count();
    let there = classes.into_iter().map(|class| (class, count(class))).filter(|(_, count)| *count > 0);
    let name = |class: Option<Class>| class.map_or("no class", Class::name);
    let swatches =
        there.map(|(class, count)| (class_colour(class), format!("{} {count}", name(class)))).collect();
    Legend { title: "voids".to_owned(), bar: None, swatches }
}
