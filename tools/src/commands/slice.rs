//! `brickfield slice`: plane sections as pictures and drawings.

use super::finding_colours::Colours;
use super::findings::{Findings, Search, require_own_options, search};
use super::slice_layer::plane_of_layer;
use super::{make_folder, no_unit, of_store, open_store, require_level, start, unit_of};
use crate::failure::Failure;
use crate::measured::measured;
use crate::memory;
use crate::output::{in_line, print, print_json, require_distinct};
use crate::picture_args::{SliceArgs, SliceFormat};
use crate::progress::Bars;
use crate::table::length_told;
use crate::void_table::{self, VoidPlace};
use anyhow::anyhow;
use brickfield_engine::Error;
use brickfield_engine::lattice::Axis;
use brickfield_engine::picture::Canvas;
use brickfield_engine::section::{
    Contour, ContourLimits, Drawing, Plane, SectionLabel, SectionPicture, SectionSummary, contour, plain,
    straighten, write_drawing, write_picture,
};
use brickfield_engine::store::{AcceptedStores, BrickTree, Store};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Most sections of one run.
const SECTIONS_MAX: f64 = 99_999.0;
/// What a node takes beside its entry: its place while the store is opened, and its key while the tree is surveyed.
const BYTES_A_NODE: u64 = 24;

/// How far a drawing may be from the section, in cells, unless the user says otherwise.
const MERGED_CELLS: f64 = 0.01;

/// Pixels that the longer side of a picture has at least, unless the user says otherwise.
const PIXELS_LEAST: f64 = 1000.0;

/// A checked command line, but for what depends on the store.
struct Plan<'a> {
    args: &'a SliceArgs,
    format: SliceFormat,
}

impl<'a> TryFrom<&'a SliceArgs> for Plan<'a> {
    type Error = Failure;

    fn try_from(args: &SliceArgs) -> Result<Plan<'_>, Failure> {
        let ending = args.output.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let format = match args.all {
            Some(_) => Some(args.format.unwrap_or_default()),
            None => SliceFormat::of_ending(ending),
        };
        let format = format.ok_or_else(|| {
            let name = args.output.display();
            Failure::Usage(format!("{name}: the section's name must end in .png, .svg or .dxf"))
        })?;
        if format != SliceFormat::Png
            && (args.pixel.is_some()
                || args.side.is_some()
                || args.samples
                || args.no_legend
                || args.voids.is_some()
                || args.style.is_some())
        {
            let what = "--pixel, --side, --samples, --no-legend, --voids and --style belong to pictures; drawings have the finest lattice's corners";
            return Err(Failure::Usage(what.to_owned()));
        }
        if format == SliceFormat::Png && args.merge_tolerance.is_some() {
            let what = "--merge-tolerance belongs to drawings: .svg and .dxf";
            return Err(Failure::Usage(what.to_owned()));
        }
        Ok(Plan { args, format })
    }
}

/// Runs the command.
pub fn run(args: &SliceArgs) -> Result<(), Failure> {
    let plan = Plan::try_from(args)?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, 0, args.io, AcceptedStores::Whole)?;
    let caches = memory::picture_caches(args.memory, memory::index_drawn(&store, BYTES_A_NODE));
    let wanted = Search {
        shown: args.style,
        finding: &args.finding,
        output: &args.output,
        memory: args.memory.0,
        io: args.io,
        quiet: args.work.quiet,
    };
    require_own_options(&wanted)?;
    // Points of the boundary are kept beside bricks, and so is what is found.
    let brick_bytes = match plan.format {
        SliceFormat::Png if args.style.is_none() => caches / 4 * 3,
        SliceFormat::Png => caches / 4,
        SliceFormat::Svg | SliceFormat::Dxf => caches / 2,
    };
    let store = store.with_cache(brick_bytes);
    if let Some(level) = args.level {
        require_level(&store, level)?;
    }
    require_distinct(&[&args.output], &[&args.store])?;
    let sections = plan.sections(&store, &bars)?;
    let found = search(&wanted, &store, &bars)?;
    let left = caches - brick_bytes;
    let left =
        left.saturating_sub(found.as_ref().map_or(0, |found| found.bytes(args.memory.0))).max(left / 4);
    let sides = found.as_ref().map(|found| found.sides(&store)).transpose()?.flatten();
    let colours = found.as_ref().map(|found| found.colours(&store, sides.as_ref(), left / 2)).transpose()?;
    let shown = found.as_ref().zip(colours.as_ref());
    for (plane, path) in sections {
        let said = plan.write((&store, shown), plane, &path, left, &bars)?;
        bars.clear();
        if args.json {
            print_json(&said.json)?;
        } else if !args.work.quiet {
            print(&format!("{}: {}", in_line(&path), said.text))?;
        }
    }
    Ok(())
}

/// What is said of a section.
struct SliceReport {
    text: String,
    json: Value,
}

impl Plan<'_> {
    /// Planes and the files for them.
    fn sections(&self, store: &Store, bars: &Bars) -> Result<Vec<(Plane, PathBuf)>, Failure> {
        let args = self.args;
        let [low, high] = [store.meta().bounds_min, store.meta().bounds_max];
        if let (Some(axis), Some(pitch)) = (args.all, args.pitch) {
            let axis = Axis::from(axis);
            let pitch = pitch.in_unit_of(&store.meta().unit).ok_or_else(no_unit)?;
            let [low, high] = [low, high].map(|corner| corner[axis.index()]);
            let count = ((high - low) / pitch + 0.5).floor().max(1.0);
            if count > SECTIONS_MAX {
                let what = format!("{count} sections are too many for one run; choose a larger --pitch");
                return Err(anyhow!("{what}").into());
            }
            make_folder(&args.output)?;
            let name = |n: usize| args.output.join(format!("{:04}.{}", n + 1, self.format.ending()));
            // A part that is thinner than the pitch has one section, in its middle.
            let step = pitch.min(high - low);
            let plane = |n: usize| Plane { axis, at: (low + (n as f64 + 0.5) * step).min(high) };
            return Ok((0..count as usize).map(|n| (plane(n), name(n))).collect());
        }
        if let Some(layer) = args.layer {
            let plane = plane_of_layer(args, layer, store, bars)?;
            return Ok(vec![(within(store, plane)?, args.output.clone())]);
        }
        let given = [(Axis::X, args.x), (Axis::Y, args.y), (Axis::Z, args.z)];
        let (axis, at) = given
            .into_iter()
            .find_map(|(axis, at)| Some((axis, at?)))
            .ok_or_else(|| Failure::Usage("give a plane: --x, --y, --z, --layer or --all".to_owned()))?;
        let plane = Plane { axis, at: at.in_unit_of(&store.meta().unit).ok_or_else(no_unit)? };
        Ok(vec![(within(store, plane)?, args.output.clone())])
    }

    fn write(
        &self,
        (store, shown): (&Store, Option<(&Findings, &Colours<'_>)>),
        plane: Plane,
        path: &Path,
        memory_bytes: u64,
        bars: &Bars,
    ) -> Result<SliceReport, Failure> {
        let window = plane.window([store.meta().bounds_min, store.meta().bounds_max]);
        let refused = |error| of_store(store, "section", error);
        let limits = ContourLimits { level: self.args.level, memory_bytes };
        if self.format == SliceFormat::Png {
            let what = self.picture(store, plane, window)?;
            let drawn = match shown {
                Some((found, colours)) => {
                    let legend = |width: usize| found.legend(store, width);
                    let legend: Option<&dyn Fn(usize) -> Canvas> = (!self.args.no_legend).then_some(&legend);
                    colours.write_section(store, &what, (legend, path), bars)
                }
                None => write_picture(store, &what, path, bars),
            };
            let drawn = drawn.map_err(refused)?;
            let area = match contour(store, plane, limits, bars) {
                Ok(Contour { area, area_error, .. }) => Some((area, area_error)),
                // More points than fit are no reason to be without the picture.
                Err(Error::Setting { .. }) => None,
                Err(error) => return Err(refused(error).into()),
            };
            return Ok(self.say_picture(store, plane, path, &drawn, area));
        }
        let mut lines = contour(store, plane, limits, bars).map_err(refused)?;
        let deepest = store.deepest_level();
        let cell = store.root().spacing(self.args.level.unwrap_or(deepest));
        let tolerance = match self.args.merge_tolerance {
            Some(tolerance) => tolerance.in_unit_of(&store.meta().unit).ok_or_else(no_unit)?,
            None => cell * MERGED_CELLS,
        };
        straighten(&mut lines, tolerance);
        let drawing = Drawing { plane, window, unit: &store.meta().unit, cell };
        write_drawing(&lines, &drawing, path)?;
        Ok(self.say_drawing(store, plane, path, &lines))
    }

    fn picture(&self, store: &Store, plane: Plane, window: [[f64; 2]; 2]) -> Result<SectionPicture, Failure> {
        let args = self.args;
        let longer = (window[1][0] - window[0][0]).max(window[1][1] - window[0][1]);
        let pixel = match (args.pixel, args.side) {
            (Some(pixel), _) => Some(pixel.in_unit_of(&store.meta().unit).ok_or_else(no_unit)?),
            (None, Some(size)) => Some(longer / f64::from(size)),
            (None, None) if args.samples => None,
            (None, None) => {
                let deepest = store.deepest_level();
                let cell = store.root().spacing(args.level.unwrap_or(deepest).min(deepest));
                let parts = (PIXELS_LEAST * cell / longer).ceil();
                (parts > 1.0 && parts.is_finite()).then(|| cell / parts)
            }
        };
        let legend = (!args.no_legend).then(|| unit_of(store.meta()).to_owned());
        let labels = args.voids.as_deref().map(|table| labels(table, plane)).transpose()?.unwrap_or_default();
        Ok(SectionPicture { plane, window, pixel, level: args.level, legend, labels })
    }

    fn say_picture(
        &self,
        store: &Store,
        plane: Plane,
        path: &Path,
        drawn: &SectionSummary,
        area: Option<(f64, f64)>,
    ) -> SliceReport {
        let SectionSummary { size: [width, height], pixel, origin, range: (low, high) } = drawn;
        let (letter, unit) = (plane.letter(), unit_of(store.meta()));
        let area_text = match area {
            Some((area, error)) => format!("area {} {unit}²", measured(area, error)),
            None => "area unknown, which takes more --memory".to_owned(),
        };
        let text = format!(
            "{letter} = {} {unit}, {width} × {height} pixels of {pixel:.6} {unit}, {area_text}, w of the part {low} to {high}",
            plain(plane.at)
        );
        let json = json!({
            "output": path.display().to_string(), "unit": unit, "axis": letter, "at": plane.at,
            "size": [width, height], "pixel": pixel, "origin": origin, "winding": [low, high],
            "area": area.map(|(area, _)| area), "area_error": area.map(|(_, error)| error),
        });
        SliceReport { text, json }
    }

    fn say_drawing(&self, store: &Store, plane: Plane, path: &Path, lines: &Contour) -> SliceReport {
        let Contour { loops, area, area_error, length } = lines;
        let points: usize = loops.iter().map(Vec::len).sum();
        let (letter, unit) = (plane.letter(), unit_of(store.meta()));
        let text = format!(
            "{letter} = {} {unit}, {} loops of {points} points, area {} {unit}², length about {} {unit}",
            plain(plane.at),
            loops.len(),
            measured(*area, *area_error),
            plain(length_told(*length).as_f64().unwrap_or(*length))
        );
        let json = json!({
            "output": path.display().to_string(), "unit": unit, "axis": letter, "at": plane.at,
            "loops": loops.len(), "points": points, "area": area, "area_error": area_error, "length": length,
        });
        SliceReport { text, json }
    }
}

/// A plane that does not pass beside the part.
fn within(store: &Store, plane: Plane) -> Result<Plane, Failure> {
    let [low, high] =
        [store.meta().bounds_min, store.meta().bounds_max].map(|corner| corner[plane.axis.index()]);
    if !(low..=high).contains(&plane.at) {
        let (letter, unit) = (plane.letter(), unit_of(store.meta()));
        let what = format!("{letter} = {} {unit} passes beside the part", plane.at);
        let remedy = format!("choose a coordinate from {low} to {high} {unit}");
        return Err(Error::store(store.path(), "section", what, remedy).into());
    }
    Ok(plane)
}

/// The numbers of the voids that a plane meets, where their centroids lie in it.
fn labels(table: &Path, plane: Plane) -> Result<Vec<SectionLabel>, Failure> {
    let a = plane.axis.index();
    let meets = |void: &VoidPlace| void.low[a] <= plane.at && plane.at <= void.high[a];
    let label = |void: VoidPlace| SectionLabel {
        at: plane.sides().map(|side| void.centre[side.index()]),
        text: void.id.to_string(),
    };
    Ok(void_table::read(table)?.into_iter().filter(meets).map(label).collect())
}
