//! `brickfield deviation`: a part against what it should be.

use super::thickness::{layers_of, place_of, require_numbers};
use super::{no_unit, of_file, of_store, open_inputs, open_store, require_whole_samples, start, unit_of};
use crate::args::IoArg;
use crate::distance_args::{AlignArg, DeviationArgs};
use crate::elsewhere::is_address;
use crate::failure::Failure;
use crate::output::{in_line, note, print, print_json, require_distinct, warn};
use crate::progress::Bars;
use crate::table::{Table, TableKind, to_place};
use crate::units::Unit;
use anyhow::anyhow;
use brickfield_engine::contour::{ContourOptions, contour};
use brickfield_engine::distance::deviation::{
    ABSOLUTE_PERCENTILES, Motion, PERCENTILES, Reference, Spread, at_points, of_surface, regions_beyond,
};
use brickfield_engine::distance::{
    ALIGNED_POINTS, Align, PreviousPlace, Region, ScalarMesh, Sides, Surface, Triangles, align,
};
use brickfield_engine::ingest::{Facets, OpenOptions};
use brickfield_engine::part::{PartFile, directory_of};
use brickfield_engine::store::{AcceptedStores, BrickTree, MovedTree, Store, is_store};
use serde_json::{Value, json};
use std::path::Path;

/// Points of the reference that are compared with the part, at most, of each kind.
const POINTS_BACK: usize = 500_000;
/// A shift is told that is larger than this part of the size while the sizes differ by less.
const SHIFTED: f64 = 0.02;
/// Ratios of sizes that come of other units, with what they are called.
const RATIOS: [(f64, &str); 3] = [
    (25.4, "as of inches and millimetres"),
    (1000.0, "as of metres and millimetres"),
    (10.0, "as of centimetres and millimetres"),
];

/// Names of the columns, in order.
const COLUMNS: [&str; 11] = [
    "id",
    "side",
    "area",
    "volume",
    "max_deviation",
    "mean_deviation",
    "x",
    "y",
    "z",
    "layer_first",
    "layer_last",
];

/// What a part is compared with, opened.
pub(super) enum OpenReference {
    Mesh(Box<Triangles>),
    Store(Box<(Surface, Store)>),
}

impl OpenReference {
    /// Where it is inside, if it is a store.
    pub fn sides(&self) -> Result<Option<Sides<'_>>, Failure> {
        match self {
            OpenReference::Mesh(_) => Ok(None),
            OpenReference::Store(opened) => Ok(Some(Sides::new(&opened.1)?)),
        }
    }

    /// What distances are told from, with what [`OpenReference::sides`] gives.
    pub fn reference<'a>(&'a self, sides: Option<&'a Sides<'a>>) -> Reference<'a> {
        match (self, sides) {
            (OpenReference::Mesh(triangles), _) => Reference::Mesh(triangles),
            (OpenReference::Store(opened), Some(sides)) => Reference::Store(&opened.0, sides),
            (OpenReference::Store(_), None) => unreachable!("a store has sides"),
        }
    }
}

/// What a part is compared with, and how, as the user typed it.
pub(super) struct Compared<'a> {
    pub reference: &'a Path,
    /// What is written.
    pub output: &'a Path,
    /// Where temporary files may lie.
    pub folder: &'a Path,
    /// Bytes in all.
    pub memory: u64,
    pub io: IoArg,
    pub align: AlignArg,
}

/// Runs the command.
pub fn run(args: &DeviationArgs) -> Result<(), Failure> {
    require_numbers(&args.output)?;
    let kind = args.regions.as_deref().map(TableKind::of).transpose()?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, args.memory.0 / 8, args.io, AcceptedStores::Whole)?;
    let mut outputs: Vec<&Path> = vec![&args.output];
    outputs.extend(args.regions.as_deref());
    require_distinct(&outputs, &[&args.store, &args.reference])?;
    require_whole_samples(&store, "its deviation cannot be told")?;
    let unit = store.meta().unit.clone();
    let within = args.within.map(|length| length.in_unit_of(&unit).ok_or_else(no_unit)).transpose()?;
    let table_file = args.regions.as_deref().map(PartFile::create).transpose()?;
    let folder = args.temp_dir.as_deref().unwrap_or(directory_of(&args.output));
    let waiting = (args.memory.0 / 8, folder);
    let metres = Unit::of_symbol(&unit).map(Unit::metres);
    let place = place_of(&store, &args.output, args.origin)?;
    let from = (place.base().unwrap_or_default(), place.coordinates());
    let mut ply = ScalarMesh::new(PartFile::create(&args.output)?, "deviation", metres, from, waiting)?;
    let compared = Compared {
        reference: &args.reference,
        output: &args.output,
        folder,
        memory: args.memory.0,
        io: args.io,
        align: args.align,
    };
    let opened = open_reference(&compared, &store, &bars)?;
    let sides_of_reference = opened.sides()?;
    let reference = opened.reference(sides_of_reference.as_ref());
    let surface = Surface::new(&store, args.memory.0 / 4, folder, &bars)
        .map_err(|error| of_store(&store, "surface", error))?;
    let sides = Sides::new(&store)?;
    let cell = surface.cell();
    let Some(bounds) = surface.bounds() else {
        return Err(
            anyhow!("{}: the store has no surface; build it with finer cells", in_line(&args.store)).into()
        );
    };
    require_alike(&compared, bounds, reference.bounds())?;
    let contouring =
        ContourOptions { cache_bytes: (args.memory.0 / 4) as usize, ..ContourOptions::default() };
    let moved = MovedTree::new(&store, place.base().unwrap_or_default());
    contour(&moved, &contouring, &mut ply, &bars)?;
    let (vertices, triangles) = ply.counts();
    let how = Align::from(args.align);
    let (motion, left) = align(&ply.some_positions(ALIGNED_POINTS), bounds, reference, how)?;
    let values = ply.fill(&bars, |last: &mut PreviousPlace, world| {
        Ok(reference.opposite_next(motion.apply(world), last)?.signed as f32)
    })?;
    let samples: Vec<[f64; 3]> =
        reference.samples(POINTS_BACK).into_iter().map(|point| motion.undo(point)).collect();
    let back = at_points(&samples, &bars, |last: &mut PreviousPlace, point| {
        Ok(of_surface(&surface, &sides, point, last)?.signed)
    })?;
    let regions = match (within, kind) {
        (Some(within), Some(_)) => Some(regions_beyond(&surface, reference, (motion, within), &bars)?),
        _ => None,
    };
    let [there, back] = [Spread::of(&values), Spread::of(&back)];
    let table = regions.as_ref().map(|regions| table(&store, regions, cell)).transpose()?;
    let mut document = json!({
        "unit": unit,
        "cell": cell,
        "reference": args.reference.display().to_string(),
        "reference_is": match opened { OpenReference::Mesh(_) => "mesh", OpenReference::Store(_) => "store" },
        "vertices": vertices,
        "triangles": triangles,
        "origin": place.origin(),
        "coordinate_bits": place.bits(),
        "align": {
            "method": match how { Align::No => "none", Align::Shift => "shift", Align::Rigid => "icp" },
            "shift": motion.shift,
            "rotation": motion.rotation,
            "degrees": motion.degrees(),
            "residual": to_place(left, cell / 1e4),
        },
        "part_to_reference": spread(&there, cell),
        "reference_to_part": spread(&back, cell),
    });
    if let Some(within) = within {
        let beyond = values.iter().filter(|value| value.abs() > within).count();
        document["within"] = json!(within);
        document["vertices_beyond"] = json!(beyond);
    }
    if let Some(table) = &table {
        document["regions"] = table.objects();
    }
    bars.clear();
    ply.complete()?;
    place.tell(&store, &args.output)?;
    if let (Some(mut file), Some(kind), Some(table)) = (table_file, kind, &table) {
        table.append_to(&mut file, kind, &document)?;
        file.finish()?;
    }
    if args.json {
        print_json(&document)?;
    } else if !args.work.quiet {
        let mut text = summary(args, &store, (&there, &back), (how, motion, left), regions.as_ref());
        text.extend(place.line(unit_of(store.meta())).map(|line| format!("\norigin {line}")));
        print(&text)?;
    }
    tell_shift(args, bounds, reference.bounds(), unit_of(store.meta()));
    let largest = there.largest().max(back.largest());
    if let Some(within) = within.filter(|within| largest > *within) {
        let name = in_line(&args.store);
        let largest = to_place(largest, cell / 1000.0);
        return Err(anyhow!("{name}: the largest deviation {largest} is above --within {within}").into());
    }
    Ok(())
}

/// Opens the reference.
pub(super) fn open_reference(
    args: &Compared<'_>,
    part: &Store,
    bars: &Bars,
) -> Result<OpenReference, Failure> {
    let name = in_line(args.reference);
    if is_address(args.reference) || is_store(args.reference) {
        let store = open_store(args.reference, args.memory / 8, args.io, AcceptedStores::Whole)?;
        require_whole_samples(&store, "distances from it cannot be told")?;
        if store.meta().unit != part.meta().unit {
            let (own, other) = (unit_of(store.meta()), unit_of(part.meta()));
            return Err(anyhow!(
                "{name}: it is in {own} and the part in {other}; build one with the other's --unit"
            )
            .into());
        }
        let surface = Surface::new(&store, args.memory / 4, args.folder, bars)
            .map_err(|error| of_store(&store, "surface", error))?;
        if surface.bounds().is_none() {
            return Err(anyhow!("{name}: the store has no surface; build it with finer cells").into());
        }
        return Ok(OpenReference::Store(Box::new((surface, store))));
    }
    let inputs = open_inputs(&[args.reference.to_owned()], &[args.output], &OpenOptions::default(), bars)?;
    if inputs.iter().any(|input| input.beads().is_some() || input.sweeps().is_some()) {
        return Err(anyhow!("{name}: it is a toolpath; build a store of it and give that").into());
    }
    let sources: Vec<&dyn Facets> = inputs.iter().map(|input| input as &dyn Facets).collect();
    let triangles = Triangles::new(&sources, (args.memory / 2, args.folder), bars)
        .map_err(|error| of_file(args.reference, error))?;
    inputs.iter().try_for_each(|input| input.check())?;
    if !triangles.is_closed() {
        warn(&format!("{name}: the mesh is not closed, so the nearest triangle tells the side of a point"));
    }
    if triangles.is_inside_out() {
        warn(&format!("{name}: the mesh is inside out, so distances have the wrong sign; turn its facets"));
    }
    Ok(OpenReference::Mesh(Box::new(triangles)))
}

fn sizes([low, high]: [[f64; 3]; 2]) -> [f64; 3] {
    std::array::from_fn(|a| high[a] - low[a])
}

/// A box, for people.
fn box_text([low, high]: [[f64; 3]; 2]) -> String {
    format!("{} to {}", point_text(low), point_text(high))
}

/// Three coordinates, for people, without the sign of a 0.
fn point_text(p: [f64; 3]) -> String {
    format!("({})", p.map(|c| format!("{:.3}", (c * 1e3).round() / 1e3 + 0.0)).join(", "))
}

/// Refuses a reference in another unit, and one elsewhere that is not to be aligned.
pub(super) fn require_alike(
    args: &Compared<'_>,
    part: [[f64; 3]; 2],
    reference: [[f64; 3]; 2],
) -> Result<(), Failure> {
    let name = in_line(args.reference);
    let (own, others) = (sizes(part), sizes(reference));
    for (ratio, units) in RATIOS {
        for (ratio, how) in [(ratio, "larger"), (1.0 / ratio, "smaller")] {
            let is_so = |a: usize| (others[a] / own[a] / ratio - 1.0).abs() < 0.02;
            if (0..3).all(is_so) {
                let times = ratio.max(1.0 / ratio);
                let what = format!("it is {times} times {how} than the part, {units}");
                return Err(
                    anyhow!("{name}: {what}; scale one of them, or build the part with --unit").into()
                );
            }
        }
    }
    let apart = (0..3).any(|a| part[1][a] < reference[0][a] || reference[1][a] < part[0][a]);
    if apart && args.align == AlignArg::None {
        let boxes = format!("the part is at {}, the reference at {}", box_text(part), box_text(reference));
        return Err(anyhow!(
            "{name}: it does not overlap the part; {boxes}; add --align shift to compare shapes"
        )
        .into());
    }
    Ok(())
}

/// Tells of a part that lies elsewhere on the bed.
fn tell_shift(args: &DeviationArgs, part: [[f64; 3]; 2], reference: [[f64; 3]; 2], unit: &str) {
    let (own, others) = (sizes(part), sizes(reference));
    let size = own.iter().copied().fold(0.0, f64::max);
    let shift: [f64; 3] =
        std::array::from_fn(|a| 0.5 * (reference[0][a] + reference[1][a] - part[0][a] - part[1][a]));
    let is_alike = (0..3).all(|a| (own[a] - others[a]).abs() < SHIFTED * size);
    let is_shifted = shift.iter().any(|s| s.abs() > SHIFTED * size);
    if is_alike && is_shifted && args.align == AlignArg::None && !args.work.quiet {
        let shift = point_text(shift);
        note(&format!(
            "the boxes have one size and differ by a shift of {shift} {unit}; --align shift takes it away"
        ));
    }
}

fn spread(spread: &Spread, cell: f64) -> Value {
    let length = |value: f64| to_place(value, cell / 1e4);
    let by_share = |shares: &[f64], values: &[f64]| -> serde_json::Map<String, Value> {
        shares.iter().zip(values).map(|(share, &value)| (share.to_string(), length(value))).collect()
    };
    json!({
        "points": spread.points,
        "mean": length(spread.mean),
        "rms": length(spread.rms),
        "min": length(spread.min),
        "percentiles": by_share(&PERCENTILES, &spread.percentiles),
        "max": length(spread.max),
        "percentiles_abs": by_share(&ABSOLUTE_PERCENTILES, &spread.absolute),
        "max_abs": length(spread.largest()),
    })
}

fn table(store: &Store, sides: &[Vec<Region>; 2], cell: f64) -> Result<Table<'static>, Failure> {
    let layers = layers_of(store, &sides.iter().flatten().collect::<Vec<_>>())?;
    let length = |value: f64| to_place(value, cell / 1000.0);
    let mut rows = Vec::new();
    for (side, regions) in ["over", "under"].into_iter().zip(sides) {
        for region in regions {
            let mut cells = vec![
                json!(rows.len() + 1),
                json!(side),
                to_place(region.area, region.area / 1e4),
                to_place(region.volume, region.volume / 1e4),
                length(region.greatest),
                length(region.mean),
            ];
            cells.extend(region.centre.map(|c| to_place(c, cell / 100.0)));
            cells.extend(layers[rows.len()].clone());
            rows.push(cells);
        }
    }
    Ok(Table::of_rows(&COLUMNS, rows))
}

fn summary(
    args: &DeviationArgs,
    store: &Store,
    (there, back): (&Spread, &Spread),
    (how, motion, left): (Align, Motion, f64),
    regions: Option<&[Vec<Region>; 2]>,
) -> String {
    let unit = unit_of(store.meta());
    let cell = store.root().spacing(store.meta().depth);
    let length = |value: f64| to_place(value, cell / 1000.0);
    let line = |spread: &Spread| {
        format!(
            "{} to {} {unit}, rms {}, 95 % within ±{}, 98 % within {} to {}",
            length(spread.min),
            length(spread.max),
            length(spread.rms),
            length(spread.absolute[1]),
            length(spread.percentiles[1]),
            length(spread.percentiles[3])
        )
    };
    let mut text = format!(
        "{}: {} vertices; deviation {}\nback from {} points of the reference {}",
        in_line(&args.output),
        there.points,
        line(there),
        back.points,
        line(back)
    );
    if how != Align::No {
        let [x, y, z] = motion.shift.map(length);
        let turned = if how == Align::Rigid {
            format!("turned by {:.4}° and ", motion.degrees())
        } else {
            String::new()
        };
        text += &format!("\n{turned}shifted by ({x}, {y}, {z}) {unit}; residual {}", length(left));
    }
    if let Some([over, under]) = regions {
        text += &format!("\n{} regions over, {} under", over.len(), under.len());
    }
    text
}
