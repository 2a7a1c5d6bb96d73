//! `brickfield voids`: a table of the regions that a part encloses.

use super::void_outputs::VoidOutputs;
use super::{no_unit, open_inputs, open_store, require_whole_samples, start, unit_of};
use crate::args::IoArg;
use crate::failure::Failure;
use crate::measured::measured;
use crate::output::{in_line, note, print, print_json, require_distinct, warn};
use crate::progress::Bars;
use crate::table::{Table, TableDocument, TableKind, to_place};
use crate::void_args::{VoidConnectivityArg, VoidsArgs};
use anyhow::anyhow;
use brickfield_engine::ingest::{Facets, Input, OpenOptions};
use brickfield_engine::part::PartFile;
use brickfield_engine::store::{AcceptedStores, BrickTree, Store};
use brickfield_engine::voids::{Class, Connectivity, Detail, Seal, Void, VoidOptions, Voids, find};
use serde_json::{Value, json};
use std::path::Path;

/// Lines of a toolpath that are named of a void.
const MOST_LINES: usize = 64;

/// Names of the columns, in order.
const COLUMNS: [&str; 35] = [
    "id",
    "class",
    "volume",
    "surface",
    "equivalent_diameter",
    "inner_diameter",
    "diameter",
    "sphericity",
    "compactness",
    "x",
    "y",
    "z",
    "xmin",
    "ymin",
    "zmin",
    "xmax",
    "ymax",
    "zmax",
    "throat",
    "sealed",
    "volume_error",
    "euler",
    "gap",
    "edge_distance",
    "layer_first",
    "layer_last",
    "lines",
    "features",
    "line_shares",
    "missing_between",
    "cad_share",
    "elongation",
    "area_x",
    "area_y",
    "area_z",
];

/// Runs the command.
pub fn run(args: &VoidsArgs) -> Result<(), Failure> {
    let kind = TableKind::of(&args.output)?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, args.memory.0 / 4, args.io, AcceptedStores::Whole)?;
    require_distinct(&[&args.output], &[&args.store])?;
    require_whole_samples(&store, "what is enclosed cannot be told")?;
    let has_identity = store.meta().beads.as_ref().is_some_and(|beads| beads.identity.is_some());
    if args.lines && !has_identity {
        let what = "the store does not tell beads apart, so voids have no lines";
        return Err(
            anyhow!("{}: {what}; build it from toolpaths with --identity", in_line(&args.store)).into()
        );
    }
    let cad = args
        .cad
        .as_deref()
        .map(|cad| open_cad((cad, &args.output), &store, (args.memory.0 / 8, args.io)))
        .transpose()?;
    let mut file = PartFile::create(&args.output)?;
    let most =
        args.max_equivalent_diameter.map(|most| most.in_unit_of(&store.meta().unit).ok_or_else(no_unit));
    let most = most.transpose()?;
    let connectivity = match args.connectivity {
        VoidConnectivityArg::Six => Connectivity::VoidSix,
        VoidConnectivityArg::TwentySix => Connectivity::VoidTwentySix,
    };
    let closing =
        args.closing.map(|length| length.in_unit_of(&store.meta().unit).ok_or_else(no_unit)).transpose()?;
    let outputs = VoidOutputs::create(args, &store)?;
    let source = source(args, &store, &bars)?;
    let source: Option<Vec<&dyn Facets>> =
        source.as_ref().map(|inputs| inputs.iter().map(|input| input as &dyn Facets).collect());
    let options = VoidOptions {
        connectivity,
        min_volume: args.min_volume,
        memory: args.memory.0,
        cad: cad.as_ref(),
        closing,
        detail: Detail::All,
        source: source.as_deref(),
    };
    let found = find(&store, &options, &bars)?;
    let table = table(&found, cell_of(&store));
    let document = document(&store, &found, &table);
    table.append_to(&mut file, kind, &document)?;
    file.finish()?;
    outputs.write(&store, &found, &bars)?;
    bars.clear();
    if args.json {
        print_json(&document)?;
    } else if !args.work.quiet {
        print(&summary(&store, &found, args))?;
    }
    if !has_identity && store.meta().beads.is_some() && !args.work.quiet {
        note(
            "the store does not tell beads apart, so lines and features are empty; build it with --identity",
        );
    }
    if found.source_differs {
        let what =
            "the store has other samples than --source, as after --orient, so seals were not asked of it";
        warn(&format!("{}: {what}; give --source for stores of meshes as they are", in_line(&args.store)));
    }
    require_limits(args, &found, most)
}

/// The meshes that the store was built from, all of them and no others.
fn source(args: &VoidsArgs, store: &Store, bars: &Bars) -> Result<Option<Vec<Input>>, Failure> {
    if args.source.is_empty() {
        return Ok(None);
    }
    let (name, known) = (in_line(&args.store), &store.meta().sources);
    if store.meta().beads.is_some() {
        let what = "the store was built from toolpaths, whose seals it tells by itself with --identity";
        return Err(anyhow!("{name}: {what}; leave --source out").into());
    }
    let inputs = open_inputs(&args.source, &[&args.output], &OpenOptions::default(), bars)?;
    let mut given = inputs.iter().map(Input::identity).collect::<Result<Vec<_>, _>>()?;
    let mut built: Vec<_> = known.iter().map(|source| source.blake3).collect();
    given.sort_unstable();
    built.sort_unstable();
    if given != built {
        let names: Vec<_> = known.iter().map(|source| source.path.as_str()).collect();
        let what = format!("it was built from {}, as that was then", names.join(", "));
        return Err(anyhow!("{name}: {what}; give that with --source, each file once").into());
    }
    Ok(Some(inputs))
}

/// The store of the CAD part, which must have the part's lattice and not be what is written.
pub(super) fn open_cad(
    (path, output): (&Path, &Path),
    store: &Store,
    (memory, io): (u64, IoArg),
) -> Result<Store, Failure> {
    let cad = open_store(path, memory, io, AcceptedStores::Whole)?;
    require_distinct(&[output], &[path])?;
    require_whole_samples(&cad, "what lies inside cannot be told")?;
    if cad.root() != store.root() || cad.meta().unit != store.meta().unit {
        let (cad, part) = (in_line(path), in_line(store.path()));
        let what = format!("its samples do not stand where those of {part} do");
        return Err(anyhow!("{cad}: {what}; build it with --like {part}").into());
    }
    Ok(cad)
}

/// The limits that make a flaw a defect.
fn require_limits(args: &VoidsArgs, found: &Voids, most: Option<f64>) -> Result<(), Failure> {
    let porosity = found.porosity();
    if let Some(limit) = args.max_porosity
        && porosity.value > limit
    {
        let name = in_line(&args.store);
        let porosity = measured(porosity.value, porosity.error);
        return Err(anyhow!("{name}: porosity {porosity} is above --max-porosity {limit}").into());
    }
    if let Some(limit) = most
        && let Some(void) = found.voids.first()
        && void.equivalent_diameter() > limit
    {
        let largest = measured(void.equivalent_diameter(), void.equivalent_diameter_error());
        let name = in_line(&args.store);
        let what = format!("void 1 has an equivalent diameter of {largest}");
        return Err(anyhow!("{name}: {what}, above --max-equivalent-diameter {limit}").into());
    }
    Ok(())
}

fn summary(store: &Store, found: &Voids, args: &VoidsArgs) -> String {
    let unit = unit_of(store.meta());
    let volume = measured(found.void_volume.value, found.void_volume.error);
    let porosity = found.porosity();
    let percent = measured(100.0 * porosity.value, 100.0 * porosity.error);
    let left_out = match found.left_out {
        0 => String::new(),
        count => format!(", {count} smaller ones left out"),
    };
    let name = in_line(&args.output);
    format!("{name}: {} voids{left_out}; {volume} {unit}³ of void, porosity {percent} %", found.voids.len())
}

/// A length as the table has it: to a hundredth of a cell.
pub(super) fn length_told(store: &Store, length: f64) -> Value {
    to_place(length, cell_of(store) / 100.0)
}

/// The edge of a cell of the finest level.
fn cell_of(store: &Store) -> f64 {
    store.root().spacing(store.meta().depth)
}

fn document<'a>(store: &Store, found: &Voids, table: &'a Table<'_>) -> TableDocument<'a> {
    let porosity = found.porosity();
    let totals = json!({
        "unit": store.meta().unit,
        "cell": cell_of(store),
        "count": found.voids.len(),
        "left_out": found.left_out,
        "void_volume": found.void_volume.value,
        "void_volume_error": found.void_volume.error,
        "solid_volume": found.solid_volume.value,
        "solid_volume_error": found.solid_volume.error,
        "solids": found.solids,
        "porosity": porosity.value,
        "porosity_error": porosity.error,
        "throat_cell": found.throat_cell,
    });
    TableDocument::new(totals, "voids", table)
}

/// A void's values in the order of [`COLUMNS`]; null where one is not known. Lengths are told to a hundredth of a `cell`,
/// areas and ratios to a thousandth of themselves, the volume to a tenth of its error.
fn cells(void: &Void, cell: f64) -> Vec<Value> {
    let [low, high] = void.bounds;
    let length = |value: f64| to_place(value, cell / 100.0);
    let known = |value: Option<f64>| value.map_or(Value::Null, length);
    let ratio = |value: Option<f64>| value.map_or(Value::Null, |value| to_place(value, 1e-3));
    let mut cells = vec![
        json!(void.id),
        json!(void.class.map(Class::name)),
        to_place(void.volume, void.volume_error / 10.0),
    ];
    // Of voids that open through a throat no polygons are known.
    let surface = (void.surface > 0.0).then(|| to_place(void.surface, void.surface / 1e3));
    cells.push(surface.unwrap_or(Value::Null));
    cells.extend([length(void.equivalent_diameter()), known(void.inner_diameter), length(void.diameter)]);
    cells.extend([ratio(void.sphericity()), ratio(void.compactness())]);
    cells.extend(void.centroid.iter().chain(&low).chain(&high).map(|&c| length(c)));
    let sealed = match void.seal {
        Seal::Certain => "certain",
        Seal::ToCell => "to_cell",
        Seal::Open => "no",
    };
    let error = to_place(void.volume_error * 1.05, void.volume_error / 10.0);
    cells.extend([length(void.throat), json!(sealed), error, json!(void.euler)]);
    cells.extend([known(void.gap), known(void.edge_distance)]);
    let Some(trace) = &void.trace else {
        cells.extend(vec![Value::Null; COLUMNS.len() - 5 - cells.len()]);
        cells.extend(shape(void));
        return cells;
    };
    cells.extend([json!(trace.layers.0), json!(trace.layers.1)]);
    let lines = &trace.lines[..trace.lines.len().min(MOST_LINES)];
    let span = |(first, last): (u64, u64)| {
        if first == last { format!("{first}") } else { format!("{first}-{last}") }
    };
    let joined = |parts: Vec<String>| json!(parts.join(";"));
    cells.push(joined(lines.iter().map(|line| span(line.lines)).collect()));
    cells.push(joined(trace.features.iter().map(|(name, _)| name.replace(';', ",")).collect()));
    cells.push(joined(lines.iter().map(|line| format!("{:.4}", line.share)).collect()));
    cells.push(joined(trace.missing.iter().map(|&(a, b)| format!("{a}-{b}")).collect()));
    cells.extend(shape(void));
    cells
}

/// The share inside the CAD part, elongation, and the areas of shadows.
fn shape(void: &Void) -> Vec<Value> {
    let ratio = |value: Option<f64>| value.map_or(Value::Null, |value| to_place(value, 1e-3));
    let mut cells = vec![ratio(void.cad_share), ratio(void.elongation)];
    let areas = void.projected.map_or([Value::Null, Value::Null, Value::Null], |areas| {
        areas.map(|area| to_place(area, area / 1e3))
    });
    cells.extend(areas);
    cells
}

fn table(found: &Voids, cell: f64) -> Table<'_> {
    Table::new(&COLUMNS, found.voids.len(), move |n| cells(&found.voids[n], cell))
}
