//! Colours of what analyses find, and what they mean.

use super::findings::Findings;
use super::unit_of;
use super::voids::length_told;
use crate::failure::Failure;
use crate::finding_args::ColourByArg;
use crate::progress::Bars;
use brickfield_engine::distance::Sides;
use brickfield_engine::lattice::NodeKey;
use brickfield_engine::overlay::{
    BandTint, Change, ChangesTint, DeviationScale, DeviationTint, ThicknessScale, ThicknessTint, VoidTint,
    class_colour, numbers_in, numbers_seen, size_along, size_colour,
};
use brickfield_engine::picture::{Bar, Canvas, Legend};
use brickfield_engine::render::{Frame, Style, Tint};
use brickfield_engine::section::{
    SectionPicture, SectionSummary, Tinted, plain, write_picture, write_tinted_picture,
};
use brickfield_engine::store::{BrickTree, Store};
use brickfield_engine::voids::{Class, Void};
use std::path::Path;

/// Width of the band along the surface in sections, in pixels.
const BAND_PIXELS: f64 = 5.0;

/// Colours of what was found.
pub(super) enum Colours<'a> {
    Voids(VoidTint<'a>),
    Thickness(ThicknessTint<'a>),
    Deviation(DeviationTint<'a>),
    Changes(Box<ChangesTint<'a>>),
}

impl Colours<'_> {
    /// For pictures in space.
    pub fn tint(&self) -> &dyn Tint {
        match self {
            Colours::Voids(tint) => tint,
            Colours::Thickness(tint) => tint,
            Colours::Deviation(tint) => tint,
            Colours::Changes(tint) => &**tint,
        }
    }

    /// The same picture with the numbers of voids.
    pub fn numbered<'s>(
        &self,
        frame: Frame<'s>,
        found: &Findings,
        store: &Store,
    ) -> Result<Frame<'s>, brickfield_engine::Error> {
        let (Colours::Voids(tint), Findings::Voids { found, .. }) = (self, found) else { return Ok(frame) };
        let cell = store.root().spacing(store.meta().depth);
        let labels = numbers_seen(&frame, tint, &found.voids, cell)?;
        Ok(frame.with_labels(labels))
    }

    /// Writes a section in these colours, with the numbers of voids.
    pub fn write_section(
        &self,
        store: &Store,
        what: &SectionPicture,
        (legend, path): (Option<&dyn Fn(usize) -> Canvas>, &Path),
        bars: &Bars,
    ) -> Result<SectionSummary, brickfield_engine::Error> {
        let pixel = what.pixel.unwrap_or_else(|| store.root().spacing(store.meta().depth));
        let width = BAND_PIXELS * pixel;
        let write = |tint: Tinted<'_>, what: &SectionPicture| {
            write_tinted_picture(store, what, Some(&tint), path, bars)
        };
        match self {
            Colours::Voids(tint) => {
                let labels = numbers_in(store, tint, what, bars)?;
                write(Tinted { tint, legend }, &SectionPicture { labels, ..what.clone() })
            }
            Colours::Thickness(tint) => {
                write(Tinted { tint: &BandTint::new(tint.surface, tint, width), legend }, what)
            }
            Colours::Deviation(tint) => {
                write(Tinted { tint: &BandTint::new(tint.surface, tint, width), legend }, what)
            }
            Colours::Changes(_) => write_picture(store, what, path, bars),
        }
    }
}

/// Where a part is inside, and its reference if that is a store.
pub(super) struct ComparedSides<'a> {
    part: Sides<'a>,
    reference: Option<Sides<'a>>,
}

impl Findings {
    /// What is drawn of the part itself.
    pub fn style(&self) -> Style {
        match self {
            Findings::Voids { .. } => Style::haze(),
            Findings::Thickness { .. } | Findings::Deviation { .. } | Findings::Changes { .. } => {
                Style::tinted()
            }
        }
    }

    /// Bytes that it takes.
    pub fn bytes(&self, memory: u64) -> u64 {
        match self {
            Findings::Voids { found, .. } => found.label_bytes(),
            Findings::Thickness { .. } => memory / 4,
            Findings::Deviation { .. } => memory / 2,
            Findings::Changes { voids, .. } => memory / 8 + voids.label_bytes(),
        }
    }

    /// The voids that are coloured, the largest first; none where something else was looked for.
    #[cfg_attr(not(feature = "view"), allow(dead_code))]
    pub fn voids_shown(&self) -> impl Iterator<Item = &Void> {
        let voids = match self {
            Findings::Voids { found, shown, .. } => Some(found.voids.iter().zip(shown)),
            Findings::Thickness { .. } | Findings::Deviation { .. } | Findings::Changes { .. } => None,
        };
        voids.into_iter().flatten().filter(|(_, shown)| **shown).map(|(void, _)| void)
    }

    /// Where parts are inside, for what is compared.
    pub fn sides<'a>(&'a self, store: &'a Store) -> Result<Option<ComparedSides<'a>>, Failure> {
        match self {
            Findings::Deviation { opened, .. } => {
                Ok(Some(ComparedSides { part: Sides::new(store)?, reference: opened.sides()? }))
            }
            Findings::Voids { .. } | Findings::Thickness { .. } | Findings::Changes { .. } => Ok(None),
        }
    }

    /// Its colours.
    pub fn colours<'a>(
        &'a self,
        store: &'a Store,
        sides: Option<&'a ComparedSides<'a>>,
        bytes: u64,
    ) -> Result<Colours<'a>, Failure> {
        Ok(match self {
            Findings::Voids { found, by, shown } => {
                let most = found.voids.first().map_or(0.0, Void::equivalent_diameter);
                let colour = |void: &Void| match by {
                    ColourByArg::Class => class_colour(void.class),
                    ColourByArg::Size => size_colour(void, most),
                };
                let colours = found.voids.iter().zip(shown).map(|(void, shown)| shown.then(|| colour(void)));
                let colours = colours.collect();
                Colours::Voids(VoidTint::new(store, found, colours, bytes))
            }
            Findings::Thickness { surface, options, scale } => {
                Colours::Thickness(ThicknessTint { surface, options: *options, scale: *scale })
            }
            Findings::Deviation { surface, opened, motion, scale } => {
                let sides = sides.expect("what is compared has sides");
                let beside = (&**surface, &sides.part);
                let reference = opened.reference(sides.reference.as_ref(), beside, *motion);
                Colours::Deviation(DeviationTint { surface, reference, motion: *motion, scale: *scale })
            }
            Findings::Changes { before, voids } => {
                // Which void it was has no colour.
                let colours = vec![Some(Change::Opened.colour()); voids.voids.len()];
                let voids = VoidTint::new(&**before, voids, colours, bytes / 4);
                Colours::Changes(Box::new(ChangesTint::new(store, &**before, voids, bytes / 4 * 3)?))
            }
        })
    }

    /// What its colours mean, for a picture of that width.
    pub fn legend(&self, store: &Store, width: usize) -> Canvas {
        let unit = unit_of(store.meta());
        match self {
            Findings::Voids { found, by, shown } => {
                legend_of_voids(store, &found.voids, (*by, shown), unit).draw(width)
            }
            Findings::Thickness { options, scale, .. } => {
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
            Findings::Changes { before, .. } => {
                let is_told = ![store, before].into_iter().any(has_levels);
                let told = Change::ALL.into_iter().filter(|change| !is_told || *change != Change::Untold);
                let swatches = told.map(|change| (change.colour(), change.name().to_owned())).collect();
                Legend { title: String::new(), bar: None, swatches }.draw(width)
            }
            Findings::Deviation { scale, .. } => {
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

/// Whether the surface passes leaves of several levels, or of another than the deepest.
fn has_levels(store: &Store) -> bool {
    let is_coarse = |key: &NodeKey| {
        let node = store.node(*key);
        node.is_some_and(|node| node.leaf && node.uniform().is_none()) && key.level() < store.meta().depth
    };
    store.keys().iter().any(is_coarse)
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
