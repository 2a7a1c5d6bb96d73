//! `brickfield layers`: a table of the layers of a part.

use super::slice_layer::toolpath;
use super::{no_unit, of_store, open_inputs, open_store, require_whole_samples, start, unit_of};
use crate::failure::Failure;
use crate::layer_args::LayersArgs;
use crate::output::{in_line, note, print, require_distinct};
use crate::progress::Bars;
use crate::table::{Table, TableKind, six_digits, to_place};
use anyhow::anyhow;
use brickfield_engine::lattice::Axis;
use brickfield_engine::part::PartFile;
use brickfield_engine::section::{Contour, ContourLimits, Plane, contour};
use brickfield_engine::store::{Accept, BrickTree, LayerVolumes, Store};
use brickfield_engine::voids::{Connectivity, Slab, label, slabs};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Decoded bricks that are kept from section to section.
const CACHE_BYTES: u64 = 256 << 20;
/// Memory for the points of a section.
const SECTION_BYTES: u64 = 1 << 30;
/// Most rows.
const STEPS_MAX: f64 = 100_000.0;

/// Names of the columns, in order.
const COLUMNS: [&str; 13] = [
    "layer",
    "z_bottom",
    "z_top",
    "area",
    "volume",
    "void_volume",
    "porosity",
    "overlap_volume",
    "fed_volume",
    "perimeter",
    "fed_minus_union",
    "source_volume",
    "source_volume_error",
];

/// What is known of one layer.
struct Row {
    slab: Slab,
    section: Contour,
    source: Option<LayerVolumes>,
    fed: Option<f64>,
}

/// Runs the command.
pub fn run(args: &LayersArgs) -> Result<(), Failure> {
    let kind = args.output.as_deref().map(TableKind::of).transpose()?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, Accept::Whole)?;
    if let Some(output) = &args.output {
        require_distinct(&[output], &[&args.store])?;
    }
    require_whole_samples(&store, "what is enclosed cannot be told")?;
    let heights = heights(args, &store)?;
    let fed = if args.pitch.is_none() { fed(args, &store, &bars)? } else { None };
    let file = match (&args.output, kind) {
        (Some(output), Some(kind)) => Some((PartFile::create(output)?, kind)),
        _ => None,
    };
    let labelling = label(&store, Connectivity::VoidSix, &bars)?;
    let slabs = slabs(&store, &labelling, &heights, &bars)?;
    let mut rows = Vec::with_capacity(slabs.len());
    for (n, slab) in slabs.into_iter().enumerate() {
        let plane = Plane { axis: Axis::Z, at: 0.5 * (heights[n] + heights[n + 1]) };
        let limits = ContourLimits { level: None, memory_bytes: SECTION_BYTES };
        let section =
            contour(&store, plane, limits, &bars).map_err(|error| of_store(&store, "section", error))?;
        let section = Contour { loops: Vec::new(), ..section };
        let volumes = store.meta().volumes.as_ref().filter(|_| args.pitch.is_none());
        let source = volumes.and_then(|volumes| volumes.layers.get(n).copied());
        let fed = fed.as_ref().and_then(|fed| fed.get(n).copied());
        rows.push(Row { slab, section, source, fed });
    }
    let table = table(&rows, &heights, store.root().spacing(store.meta().depth));
    let document = document(&store, &rows, &table);
    bars.clear();
    let is_file = file.is_some();
    table.deliver(file, &document, args.json)?;
    if let (true, false, false, Some(output)) = (is_file, args.json, args.work.quiet, &args.output) {
        let porosity = 100.0 * document["porosity"].as_f64().unwrap_or_default();
        let unit = unit_of(store.meta());
        let name = in_line(output);
        let volume: f64 = rows.iter().map(|row| row.slab.solid).sum();
        print(&format!(
            "{name}: {} layers, {volume:.6} {unit}³ of union, porosity {porosity:.4} %",
            rows.len()
        ))?;
    }
    Ok(())
}

/// Where layers begin and end: one more than there are.
fn heights(args: &LayersArgs, store: &Store) -> Result<Vec<f64>, Failure> {
    let meta = store.meta();
    let [low, high] = [meta.bounds_min, meta.bounds_max].map(|corner| corner[2]);
    let Some(pitch) = args.pitch else {
        let layers = meta.volumes.as_ref().map_or(&[][..], |volumes| &volumes.layers);
        if layers.is_empty() {
            let what = "it tells no layers that lie one above the other";
            let name = in_line(&args.store);
            return Err(anyhow!("{name}: {what}; give the height of a step with --pitch").into());
        }
        return Ok(std::iter::once(low).chain(layers.iter().map(|layer| layer.top)).collect());
    };
    let pitch = pitch.in_unit_of(&meta.unit).ok_or_else(no_unit)?;
    let count = ((high - low) / pitch * (1.0 - 1e-12)).ceil().max(1.0);
    if count > STEPS_MAX {
        return Err(anyhow!("{count} steps are too many for one table; choose a larger --pitch").into());
    }
    Ok((0..=count as usize).map(|n| low + n as f64 * pitch).collect())
}

/// Material fed by layer, from the toolpath; `None` if that is not there or does not tell.
fn fed(args: &LayersArgs, store: &Store, bars: &Bars) -> Result<Option<Vec<f64>>, Failure> {
    let Some(known) = store.meta().volumes.as_ref().and_then(|volumes| volumes.swept?.fed) else {
        return Ok(None);
    };
    let path = match (&args.toolpath_file, &store.meta().sources[..]) {
        (Some(path), _) => path.clone(),
        (None, [source]) => PathBuf::from(&source.path),
        _ => return Ok(None),
    };
    let missing = |why: &str| {
        if !args.work.quiet {
            note(&format!(
                "{}: {why}, so fed_volume is empty; say where it is with --toolpath",
                in_line(&path)
            ));
        }
        Ok(None)
    };
    if args.toolpath_file.is_none() && !path.exists() {
        return missing("the toolpath is not there any more");
    }
    let outputs: Vec<_> = args.output.iter().map(PathBuf::as_path).collect();
    let inputs =
        open_inputs(std::slice::from_ref(&path), &outputs, &args.toolpath.options(args.units)?, bars);
    let toolpath = match inputs.as_deref() {
        Ok([input]) => match toolpath(input, store) {
            Err(_) if args.toolpath_file.is_none() => return missing("the toolpath has been changed"),
            found => found?,
        },
        Ok(_) => return Ok(None),
        Err(_) if args.toolpath_file.is_none() => return missing("the toolpath cannot be read"),
        Err(_) => return inputs.map(|_| None),
    };
    // Layers in the order in which they are laid, as the store's volumes have them.
    let mut layers: Vec<(u32, f64)> = Vec::new();
    for bead in 0..toolpath.len() {
        let attributes = toolpath.attributes(bead);
        let Some(fed) = attributes.fed else { return Ok(None) };
        match layers.last_mut() {
            Some((layer, sum)) if *layer == attributes.layer => *sum += fed,
            _ => layers.push((attributes.layer, fed)),
        }
    }
    let all: f64 = layers.iter().map(|(_, fed)| fed).sum();
    let count = store.meta().volumes.as_ref().map_or(0, |volumes| volumes.layers.len());
    if layers.len() != count || (all - known).abs() > 1e-6 * known.abs() {
        let what =
            "the toolpath was read with other options than the store was built with, so fed_volume is empty";
        note(&format!("{}: {what}; give those options", in_line(&path)));
        return Ok(None);
    }
    Ok(Some(layers.into_iter().map(|(_, fed)| fed).collect()))
}

fn porosity(void: f64, solid: f64) -> f64 {
    if void + solid > 0.0 { void / (void + solid) } else { 0.0 }
}

fn table(rows: &[Row], heights: &[f64], cell: f64) -> Table<'static> {
    let known = |value: Option<f64>| value.map_or(Value::Null, six_digits);
    let row = |(n, row): (usize, &Row)| {
        let Slab { solid, void, overlap } = row.slab;
        let source = row.source;
        vec![
            json!(n + 1),
            to_place(heights[n], cell / 1e4),
            to_place(heights[n + 1], cell / 1e4),
            six_digits(row.section.area),
            six_digits(solid),
            six_digits(void),
            six_digits(porosity(void, solid)),
            six_digits(source.map_or(overlap, |source| source.overlap.value)),
            known(row.fed),
            six_digits(row.section.length),
            known(row.fed.map(|fed| fed - source.map_or(solid, |source| source.union.value))),
            known(source.map(|source| source.union.value)),
            known(source.map(|source| source.union.bound())),
        ]
    };
    Table { columns: &COLUMNS, rows: rows.iter().enumerate().map(row).collect() }
}

fn document(store: &Store, rows: &[Row], table: &Table<'_>) -> Value {
    let sum = |of: fn(&Row) -> f64| rows.iter().map(of).sum::<f64>();
    let (solid, void) = (sum(|row| row.slab.solid), sum(|row| row.slab.void));
    let fed: Option<f64> = rows.iter().map(|row| row.fed).sum();
    json!({
        "unit": store.meta().unit,
        "cell": store.root().spacing(store.meta().depth),
        "count": rows.len(),
        "volume": solid,
        "void_volume": void,
        "porosity": porosity(void, solid),
        "overlap_volume": sum(|row| row.source.map_or(row.slab.overlap, |source| source.overlap.value)),
        "overlap_of_samples": sum(|row| row.slab.overlap),
        "fed_volume": fed.filter(|_| !rows.is_empty()),
        "layers": table.objects(),
    })
}
