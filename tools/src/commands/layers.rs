//! `brickfield layers`: a table of the layers of a part.

use super::slice_layer::toolpath;
use super::{no_unit, of_store, open_inputs, open_store, require_whole_samples, start, unit_of};
use crate::failure::Failure;
use crate::layer_args::LayersArgs;
use crate::measured::measured;
use crate::output::{in_line, note, print, require_distinct};
use crate::progress::Bars;
use crate::table::{Table, TableDocument, TableKind, length_told, six_digits, to_place};
use anyhow::anyhow;
use brickfield_engine::analysis::volume;
use brickfield_engine::lattice::Axis;
use brickfield_engine::part::PartFile;
use brickfield_engine::section::{Contour, ContourLimits, Plane, contour};
use brickfield_engine::store::{AcceptedStores, BrickTree, Estimate, LayerVolumes, Store};
use brickfield_engine::voids::{Connectivity, Labelling, Slab, Total, label, slabs};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Decoded bricks that are kept from section to section.
const CACHE_BYTES: u64 = 256 << 20;
/// Memory for the points of a section.
const SECTION_BYTES: u64 = 1 << 30;
/// Most rows.
const STEPS_MAX: f64 = 100_000.0;

/// Samples in an outline are off by this many for each root of the number of its crossings, by chance.
const CHANCE: f64 = 0.5;

/// Names of the columns, in order.
const COLUMNS: [&str; 18] = [
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
    "area_error",
    "volume_error",
    "void_volume_error",
    "porosity_error",
    "overlap_volume_error",
];

/// What is known of one layer.
struct Row {
    slab: Slab,
    section: Contour,
    source: Option<LayerVolumes>,
    fed: Option<f64>,
}

impl Row {
    /// What the solid's volume may be off by: twice what lines along x or y tell otherwise, and what all may miss alike by chance.
    fn error(&self) -> f64 {
        let [x, y] = self.slab.apart;
        2.0 * x.abs().max(y.abs()) + CHANCE * self.slab.by_chance
    }
}

/// Runs the command.
pub fn run(args: &LayersArgs) -> Result<(), Failure> {
    let kind = args.output.as_deref().map(TableKind::of).transpose()?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, AcceptedStores::Whole)?;
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
    let totals = Totals::of(&store, &labelling, &rows, &bars)?;
    let table = table(&rows, &totals, &heights, store.root().spacing(store.meta().depth));
    let document = document(&store, &rows, &totals, &table);
    bars.clear();
    let is_file = file.is_some();
    table.deliver(file, &document, args.json)?;
    if let (true, false, false, Some(output)) = (is_file, args.json, args.work.quiet, &args.output) {
        print(&format!("{}: {}", in_line(output), totals.text(rows.len(), unit_of(store.meta()))))?;
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

/// What the whole part has, by chords along z.
struct Totals {
    solid: Total,
    void: Total,
    /// The union by lines through the source, which is nearer.
    source: Option<Total>,
    /// Of samples alone an error is not known.
    overlap: (f64, Option<f64>),
}

impl Totals {
    fn of(store: &Store, labelling: &Labelling, rows: &[Row], bars: &Bars) -> Result<Totals, Failure> {
        let sum = |of: fn(&Slab) -> f64| rows.iter().map(|row| of(&row.slab)).sum::<f64>();
        let by_axes = |solid: bool| labelling.total(store.root(), solid);
        let volumes = store.meta().volumes.as_ref();
        let source = volumes.map(|v| Total { value: v.union.value, error: v.union.bound() });
        let nearest = match source {
            Some(source) => source,
            None => {
                let of_store = volume(store, bars)?;
                Total { value: of_store.union, error: of_store.union_error }
            }
        };
        let z = |value: f64| Total { value, error: 0.0 };
        let overlap = match volumes {
            Some(volumes) => (volumes.overlap.value, Some(volumes.overlap.bound())),
            None => (sum(|slab| slab.overlap), None),
        };
        Ok(Totals {
            solid: z(sum(|slab| slab.solid)).not_nearer_than(nearest),
            void: z(sum(|slab| slab.void)).not_nearer_than(by_axes(false)),
            source,
            overlap,
        })
    }

    fn union(&self) -> Total {
        self.source.unwrap_or(self.solid)
    }

    fn porosity(&self) -> Total {
        self.void.share_beside(self.solid)
    }

    fn text(&self, layers: usize, unit: &str) -> String {
        let volume = |total: Total| measured(total.value, total.error);
        let (union, void) = (volume(self.union()), volume(self.void));
        let Total { value, error } = self.porosity();
        let percent = measured(100.0 * value, 100.0 * error);
        format!("{layers} layers, {union} {unit}³ of union, {void} {unit}³ of void, porosity {percent} %")
    }
}

/// A part of a volume. Errors of parts are independent, so the whole's is theirs by the root of their number.
fn part(value: f64, whole: Total) -> Total {
    let share = if whole.value > 0.0 { (value / whole.value).clamp(0.0, 1.0) } else { 0.0 };
    Total { value, error: whole.error * share.sqrt() }
}

fn table(rows: &[Row], totals: &Totals, heights: &[f64], cell: f64) -> Table<'static> {
    let row = |(n, row): (usize, &Row)| {
        let Slab { solid, void, overlap, .. } = row.slab;
        let source = row.source.map(|source| {
            let total = |estimate: Estimate| Total { value: estimate.value, error: estimate.bound() };
            [total(source.union), total(source.overlap)]
        });
        let solid = match source {
            Some([union, _]) => Total { value: solid, error: 0.0 }.not_nearer_than(union),
            None => Total { value: solid, error: row.error() },
        };
        let void = part(void, totals.void);
        let porosity = void.share_beside(solid);
        let value = |total: Total| to_place(total.value, total.error / 10.0);
        let error = |total: Total| to_place(total.error * 1.05, total.error / 10.0);
        let known = |total: Option<Total>, of: &dyn Fn(Total) -> Value| total.map_or(Value::Null, of);
        let [union, own_overlap] = [0, 1].map(|n| source.map(|source| source[n]));
        let area = Total { value: row.section.area, error: row.section.area_error };
        let less = |fed: f64| Total { value: fed - union.unwrap_or(solid).value, ..union.unwrap_or(solid) };
        vec![
            json!(n + 1),
            to_place(heights[n], cell / 1e4),
            to_place(heights[n + 1], cell / 1e4),
            value(area),
            value(solid),
            value(void),
            value(porosity),
            own_overlap.map_or_else(|| to_place(overlap, overlap * 1e-2), value),
            row.fed.map_or(Value::Null, six_digits),
            length_told(row.section.length),
            known(row.fed.map(less), &value),
            known(union, &value),
            known(union, &error),
            error(area),
            error(solid),
            error(void),
            error(porosity),
            known(own_overlap, &error),
        ]
    };
    Table::of_rows(&COLUMNS, rows.iter().enumerate().map(row).collect())
}

fn document<'a>(store: &Store, rows: &[Row], totals: &Totals, table: &'a Table<'_>) -> TableDocument<'a> {
    let fed: Option<f64> = rows.iter().map(|row| row.fed).sum();
    let porosity = totals.porosity();
    let all = json!({
        "unit": store.meta().unit,
        "cell": store.root().spacing(store.meta().depth),
        "count": rows.len(),
        "volume": totals.solid.value,
        "volume_error": totals.solid.error,
        "source_volume": totals.source.map(|source| source.value),
        "source_volume_error": totals.source.map(|source| source.error),
        "void_volume": totals.void.value,
        "void_volume_error": totals.void.error,
        "porosity": porosity.value,
        "porosity_error": porosity.error,
        "overlap_volume": totals.overlap.0,
        "overlap_volume_error": totals.overlap.1,
        "overlap_of_samples": rows.iter().map(|row| row.slab.overlap).sum::<f64>(),
        "fed_volume": fed.filter(|_| !rows.is_empty()),
    });
    TableDocument::new(all, "layers", table)
}
