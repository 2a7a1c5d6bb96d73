//! `brickfield thickness`: how thick walls are, at every vertex of the mesh.

use super::mesh_place::{MeshPlace, PlaceWish, ends_in};
use super::thickness_volume::VolumePlan;
use super::{no_unit, of_store, open_store, require_whole_samples, start, unit_of};
use crate::args::OriginArg;
use crate::distance_args::{MeasureArg, ThicknessArgs};
use crate::failure::Failure;
use crate::output::{in_line, print, print_json, require_distinct, warn};
use crate::points::{PointReader, PointWriter};
use crate::progress::Bars;
use crate::table::{Table, TableKind, to_place};
use crate::units::Unit;
use anyhow::anyhow;
use brickfield_engine::analysis::{CoveringPass, beads_at_points};
use brickfield_engine::contour::{ContourOptions, contour};
use brickfield_engine::distance::deviation::at_points;
use brickfield_engine::distance::thickness::{Method, Options, PreviousContact, at_world, thin_regions};
use brickfield_engine::distance::{PointNumbers, Region, SCALAR_ENDINGS, ScalarMesh, Surface};
use brickfield_engine::part::{PartFile, directory_of};
use brickfield_engine::store::{AcceptedStores, MovedTree, Store};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Bars of the histogram.
const BARS: usize = 64;
/// Points read before what is measured at them is printed, which bounds memory.
const BATCH_POINTS: usize = 1 << 16;
/// Fewer cells than this are not resolved.
const CELLS_RESOLVED: f64 = 2.0;

/// Names of the columns, in order.
const COLUMNS: [&str; 10] =
    ["id", "area", "volume", "min_thickness", "mean_thickness", "x", "y", "z", "layer_first", "layer_last"];

/// Runs the command.
pub fn run(args: &ThicknessArgs) -> Result<(), Failure> {
    args.output.as_deref().map(require_numbers).transpose()?;
    let kind = args.regions.as_deref().map(TableKind::of).transpose()?;
    let plan = VolumePlan::of(args)?;
    let points = args.points.as_deref().map(PointReader::open).transpose()?;
    let bars = start(args.work)?;
    let memory = args.surface.memory.0;
    let store = open_store(&args.store, memory / 8, args.surface.io, AcceptedStores::Whole)?;
    let mut outputs: Vec<&Path> = args.output.iter().chain(&args.regions).map(PathBuf::as_path).collect();
    outputs.extend(plan.iter().flat_map(VolumePlan::outputs));
    require_distinct(&outputs, &[&args.store])?;
    require_whole_samples(&store, "thickness cannot be told")?;
    plan.as_ref().map(VolumePlan::require_writable).transpose()?;
    let below =
        args.below.map(|length| length.in_unit_of(&store.meta().unit).ok_or_else(no_unit)).transpose()?;
    let folder = match (&args.surface.temp_dir, outputs.first()) {
        (Some(folder), _) => folder,
        (None, Some(output)) => directory_of(output),
        (None, None) => Path::new("."),
    };
    let table_file = args.regions.as_deref().map(PartFile::create).transpose()?;
    let metres = Unit::of_symbol(&store.meta().unit).map(Unit::metres);
    let ply = |output: &PathBuf| -> Result<_, Failure> {
        let place = place_of(&store, output, args.origin)?;
        let from = (place.base().unwrap_or_default(), place.coordinates());
        let waiting = (memory / 8, folder);
        Ok((ScalarMesh::new(PartFile::create(output)?, "thickness", metres, from, waiting)?, place))
    };
    let ply = args.output.as_ref().map(ply).transpose()?;
    // As in `offset`, the allocator needs some more than pieces have.
    let surface = Surface::new(&store, memory / 8 * 3, folder, &bars)
        .map_err(|error| of_store(&store, "surface", error))?;
    if surface.bounds().is_none() {
        let name = in_line(&args.store);
        return Err(anyhow!("{name}: the store has no surface; build it with finer cells").into());
    }
    if let Some(points) = points {
        return at_given_points(args, &surface, points, &bars);
    }
    let mut document = json!({ "unit": store.meta().unit, "cell": surface.cell() });
    let (mut text, mut mesh) = (String::new(), None);
    if let Some(ply) = ply {
        let (found, mut told) = at_vertices(args, (&store, &surface), ply, below, &bars)?;
        document = found;
        text = std::mem::take(&mut told.text);
        mesh = Some(told);
    }
    if let Some(plan) = &plan {
        let spread = plan.write((&store, &surface), (memory / 8, folder), &bars)?;
        document["volume"] = plan.document(&store, &spread);
        let line = plan.summary(&store, &spread);
        text = if text.is_empty() { line } else { format!("{text}\n{line}") };
    }
    if let (Some(mut told), Some(output)) = (mesh, &args.output) {
        told.mesh.complete()?;
        told.place.tell(&store, output)?;
        if let (Some(mut file), Some(kind), Some(table)) = (table_file, kind, &told.table) {
            table.append_to(&mut file, kind, &document)?;
            file.finish()?;
        }
    }
    bars.clear();
    if args.json {
        return print_json(&document);
    }
    if args.work.quiet { Ok(()) } else { print(&text) }
}

/// Measures at points, and prints what it finds.
fn at_given_points(
    args: &ThicknessArgs,
    surface: &Surface,
    mut points: PointReader,
    bars: &Bars,
) -> Result<(), Failure> {
    let mut batch = points.batch(BATCH_POINTS)?;
    let mut writer = PointWriter::of(args.json, "thickness")?;
    while !batch.is_empty() {
        let thickness = |last: &mut _, point| Ok(measured(surface, point, options(args), last));
        let values = at_points(&batch, (u64::MAX, Path::new(".")), bars, thickness, |_, _| Ok(()))?;
        for (point, value) in batch.iter().zip(values.all()) {
            match value.is_finite() {
                true => writer.write(*point, to_place(f64::from(*value), surface.cell() / 1000.0))?,
                false => writer.write_none(*point)?,
            }
        }
        writer.flush()?;
        batch = points.batch(BATCH_POINTS)?;
    }
    writer.flush()
}

/// What to measure.
fn options(args: &ThicknessArgs) -> Options {
    let method = match args.measure {
        MeasureArg::Sphere => Method::Sphere { separation: args.separation },
        MeasureArg::Ray => Method::Ray,
    };
    Options { method, gaps: args.gaps }
}

/// Thickness beside a place; not a number where there is none.
fn measured(surface: &Surface, world: [f64; 3], options: Options, last: &mut PreviousContact) -> f64 {
    let found = at_world(surface, world, options, last).map(|measured| measured.value);
    found.filter(|value| value.is_finite()).unwrap_or(f64::NAN)
}

/// What is told of vertices.
struct Told {
    /// It has its name when all else is known.
    mesh: ScalarMesh,
    place: MeshPlace,
    text: String,
    table: Option<Table<'static>>,
}

/// Measures at all vertices and writes the mesh.
fn at_vertices(
    args: &ThicknessArgs,
    (store, surface): (&Store, &Surface),
    (mut ply, place): (ScalarMesh, MeshPlace),
    below: Option<f64>,
    bars: &Bars,
) -> Result<(Value, Told), Failure> {
    let cell = surface.cell();
    if let Some(below) = below.filter(|below| *below < CELLS_RESOLVED * cell) {
        let what = format!(
            "--below {below} is less than {CELLS_RESOLVED} cells of {cell:.6} {}",
            unit_of(store.meta())
        );
        warn(&format!("{}: {what}: thinner walls may be missing; build finer cells", in_line(&args.store)));
    }
    let options = options(args);
    let contouring =
        ContourOptions { cache_bytes: (args.surface.memory.0 / 4) as usize, ..ContourOptions::default() };
    let moved = MovedTree::new(store, place.base().unwrap_or_default());
    contour(&moved, &contouring, &mut ply, bars)?;
    let (vertices, triangles) = ply.counts();
    let values = ply.fill(bars, |last, world| Ok(measured(surface, world, options, last) as f32))?;
    let regions = below.map(|below| thin_regions(surface, options, below, bars)).transpose()?;
    let table = regions.as_deref().map(|regions| table(store, regions, cell)).transpose()?;
    let mut document = document(args, store, &values, cell)?;
    document["vertices"] = json!(vertices);
    document["triangles"] = json!(triangles);
    document["origin"] = json!(place.origin());
    document["coordinate_bits"] = json!(place.bits());
    if let Some(table) = &table {
        document["below"] = json!(below);
        document["regions"] = table.objects();
    }
    let mut text = summary(args, store, &document, below.zip(regions.as_deref()));
    text.extend(place.line(unit_of(store.meta())).map(|line| format!("\norigin {line}")));
    Ok((document, Told { text, table, mesh: ply, place }))
}

/// Where the coordinates of a mesh with numbers count from.
pub(super) fn place_of(
    store: &Store,
    output: &Path,
    origin: Option<OriginArg>,
) -> Result<MeshPlace, Failure> {
    let wish = PlaceWish { origin, double_formats: ".ply or .vtp", ..PlaceWish::default() };
    MeshPlace::of(wish, store, output)
}

/// Refuses a name of another format than those whose vertices have numbers.
pub(super) fn require_numbers(path: &Path) -> Result<(), Failure> {
    let what = "the name must end in .ply, .vtp or .glb, the formats whose vertices have numbers";
    if ends_in(path, &SCALAR_ENDINGS) {
        Ok(())
    } else {
        Err(Failure::Usage(format!("{}: {what}", in_line(path))))
    }
}

/// The layers of the beads beside the lowest and the highest point of each region, from 1; null where the store does not tell
/// beads apart, or none covers the point.
pub(super) fn layers_of(store: &Store, regions: &[&Region]) -> Result<Vec<[Value; 2]>, Failure> {
    let Some(tables) = store.bead_tables()? else {
        return Ok(vec![[Value::Null, Value::Null]; regions.len()]);
    };
    let places: Vec<[f64; 3]> = regions.iter().flat_map(|region| region.ends).collect();
    let beads = beads_at_points(store, &tables, &places)?;
    let layers = |found: &Vec<CoveringPass>| -> Vec<u32> {
        found.iter().map(|found| tables.beads[tables.bead_of(found.number).0 as usize].layer + 1).collect()
    };
    let told = |layer: Option<u32>| layer.map_or(Value::Null, |layer| json!(layer));
    let pair = |ends: &[Vec<CoveringPass>]| {
        let [low, high] = [0, 1].map(|n| layers(&ends[n]));
        [told(low.into_iter().min()), told(high.into_iter().max())]
    };
    Ok(beads.chunks_exact(2).map(pair).collect())
}

fn table(store: &Store, regions: &[Region], cell: f64) -> Result<Table<'static>, Failure> {
    let layers = layers_of(store, &regions.iter().collect::<Vec<_>>())?;
    let length = |value: f64| to_place(value, cell / 1000.0);
    let row = |(n, region): (usize, &Region)| {
        let mut cells = vec![
            json!(n + 1),
            to_place(region.area, region.area / 1e4),
            to_place(region.volume, region.volume / 1e4),
            length(region.least),
            length(region.mean),
        ];
        cells.extend(region.centre.map(|c| to_place(c, cell / 100.0)));
        cells.extend(layers[n].clone());
        cells
    };
    Ok(Table::of_rows(&COLUMNS, regions.iter().enumerate().map(row).collect()))
}

fn document(args: &ThicknessArgs, store: &Store, values: &PointNumbers, cell: f64) -> Result<Value, Failure> {
    let (count, measured) = values.counts();
    let place = |share: f64| ((measured as f64 * share).ceil() as usize).clamp(1, measured.max(1)) - 1;
    let ranks = [0.0, 0.01, 0.1, 0.5, 0.9, 0.99, 1.0].map(place);
    let told =
        if measured > 0 { values.at_ranks(&ranks, |value| value) } else { vec![f64::NAN; ranks.len()] };
    let most = if measured > 0 { told[6] } else { 0.0 };
    let if_any = |value: f64| if measured > 0 { value } else { f64::NAN };
    let mut bars = vec![0u64; BARS];
    let mut sum = 0.0;
    for value in values.iter() {
        let bar = (value / most.max(f64::from(f32::MIN_POSITIVE)) * BARS as f64) as usize;
        bars[bar.min(BARS - 1)] += 1;
        sum += value;
    }
    let mean = sum / measured.max(1) as f64;
    let length = |value: f64| to_place(value, cell / 1000.0);
    Ok(json!({
        "unit": store.meta().unit,
        "cell": cell,
        "method": match args.measure {
            MeasureArg::Sphere => "sphere",
            MeasureArg::Ray => "ray",
        },
        "separation": if args.measure == MeasureArg::Sphere { json!(args.separation) } else { Value::Null },
        "of": if args.gaps { "gaps" } else { "walls" },
        "measured": measured,
        "without_opposite": count - measured,
        "min": length(told[0]),
        "percentiles": {
            "1": length(told[1]),
            "10": length(told[2]),
            "50": length(told[3]),
            "90": length(told[4]),
            "99": length(told[5]),
        },
        "max": length(if_any(most)),
        "mean": length(if_any(mean)),
        "histogram": { "from": 0.0, "to": most, "counts": bars },
    }))
}

fn summary(
    args: &ThicknessArgs,
    store: &Store,
    document: &Value,
    regions: Option<(f64, &[Region])>,
) -> String {
    let unit = unit_of(store.meta());
    let name = args.output.as_deref().map(in_line).unwrap_or_default();
    let what = if args.gaps { "gaps" } else { "walls" };
    let vertices = &document["vertices"];
    let mut text = if document["measured"] == 0 {
        format!("{name}: {vertices} vertices; no {what}, as nothing is opposite to any of them")
    } else {
        let (least, most, half) = (&document["min"], &document["max"], &document["percentiles"]["50"]);
        format!(
            "{name}: {vertices} vertices; {what} of {least} to {most} {unit}, half of the vertices at most {half}"
        )
    };
    if let Some((below, regions)) = regions {
        let area = regions.iter().fold(0.0, |sum, region| sum + region.area);
        text += &format!(
            "\n{} regions below {below} {unit}, {} {unit}² of surface",
            regions.len(),
            to_place(area, area / 1e4)
        );
    }
    text
}
