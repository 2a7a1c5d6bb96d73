//! `brickfield overlap`: a table of the beads that overlap.

use super::{open_store, start, unit_of};
use crate::failure::Failure;
use crate::layer_args::{OverlapArgs, OverlapByArg};
use crate::measured::measured;
use crate::output::{in_line, print, require_distinct};
use crate::table::{Table, TableDocument, TableKind, six_digits, to_place};
use anyhow::anyhow;
use brickfield_engine::analysis::{OverlapSum, Overlaps, PairOverlap, overlaps};
use brickfield_engine::brick::Count;
use brickfield_engine::part::PartFile;
use brickfield_engine::store::{AcceptedStores, BeadTables, BrickTree, Store};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Decoded bricks that are kept; each is read once.
const CACHE_BYTES: u64 = 64 << 20;

/// Names of the columns, in order.
const COLUMNS: [&str; 17] = [
    "bead_a",
    "bead_b",
    "volume",
    "x",
    "y",
    "z",
    "layer_a",
    "layer_b",
    "lines_a",
    "lines_b",
    "feature_a",
    "feature_b",
    "pass_a",
    "pass_b",
    "volume_error",
    "sampled_volume",
    "pairs",
];

/// Runs the command.
pub fn run(args: &OverlapArgs) -> Result<(), Failure> {
    let kind = args.output.as_deref().map(TableKind::of).transpose()?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, AcceptedStores::Whole)?;
    if let Some(output) = &args.output {
        require_distinct(&[output], &[&args.store])?;
    }
    let Some(tables) = store.bead_tables()? else {
        let what = "the store does not tell beads apart, so overlaps have no beads";
        let name = in_line(&args.store);
        return Err(anyhow!("{name}: {what}; build it from toolpaths with --identity").into());
    };
    let file = match (&args.output, kind) {
        (Some(output), Some(kind)) => Some((PartFile::create(output)?, kind)),
        _ => None,
    };
    let found = overlaps(&store, &tables, &bars)?;
    let table = table(args, &store, &tables, &found);
    let document = document(args, &store, &tables, &found, &table);
    bars.clear();
    table.deliver(file, &document, args.json)?;
    if let (false, false, Some(output)) = (args.json, args.work.quiet, &args.output) {
        let sum = sum(&found);
        let (name, unit) = (in_line(output), unit_of(store.meta()));
        let volume = measured(sum.volume, sum.error());
        print(&format!("{name}: {} rows; {} pairs, {volume} {unit}³", table.count(), sum.pairs))?;
    }
    Ok(())
}

/// All pairs together.
fn sum(found: &Overlaps) -> OverlapSum {
    let mut sum = OverlapSum::default();
    found.pairs.iter().for_each(|pair| sum.add(pair));
    sum
}

/// What a row stands for: bead and pass of each side, layers, features.
fn key_of(by: OverlapByArg, tables: &BeadTables, pair: &PairOverlap) -> [u32; 2] {
    let rows = pair.numbers.map(|number| tables.beads[tables.bead_of(number).0 as usize]);
    let mut key = match by {
        OverlapByArg::Pair => pair.numbers,
        OverlapByArg::Feature => rows.map(|row| u32::from(row.feature)),
        OverlapByArg::Layer => rows.map(|row| row.layer),
    };
    key.sort_unstable();
    key
}

/// Rows are made when they are written: there may be a million pairs.
fn table<'a>(args: &'a OverlapArgs, store: &Store, tables: &'a BeadTables, found: &'a Overlaps) -> Table<'a> {
    let cell = store.root().spacing(store.meta().depth);
    let mut rows: BTreeMap<[u32; 2], (OverlapSum, &PairOverlap)> = BTreeMap::new();
    for pair in &found.pairs {
        rows.entry(key_of(args.by, tables, pair)).or_insert((OverlapSum::default(), pair)).0.add(pair);
    }
    let mut rows: Vec<_> = rows.into_iter().filter(|(_, (row, _))| row.volume >= args.min_volume).collect();
    rows.sort_by(|a, b| b.1.0.volume.total_cmp(&a.1.0.volume).then(a.0.cmp(&b.0)));
    let count = rows.len();
    let values = move |n: usize| {
        let (key, (row, pair)) = &rows[n];
        let beads = pair.numbers.map(|number| tables.bead_of(number));
        let error = row.error();
        let digits = |value: f64| to_place(value, error.min(row.volume) / 10.0);
        let rows = beads.map(|(bead, _)| tables.beads[bead as usize]);
        let is_pair = args.by == OverlapByArg::Pair;
        let of_pair = |value: Value| if is_pair { value } else { Value::Null };
        let span = |side: usize| {
            let lines = if tables.count() == Count::Beads { rows[side].lines } else { pair.lines[side] };
            let text =
                if lines.0 == lines.1 { format!("{}", lines.0) } else { format!("{}-{}", lines.0, lines.1) };
            of_pair(if lines.0 > lines.1 { Value::Null } else { json!(text) })
        };
        let layer = |side: usize| match args.by {
            OverlapByArg::Layer => json!(key[side] + 1),
            OverlapByArg::Pair => json!(rows[side].layer + 1),
            OverlapByArg::Feature => Value::Null,
        };
        let feature = |side: usize| match args.by {
            OverlapByArg::Feature => json!(tables.features[key[side] as usize]),
            OverlapByArg::Pair => json!(tables.features[usize::from(rows[side].feature)]),
            OverlapByArg::Layer => Value::Null,
        };
        let mut cells = vec![of_pair(json!(beads[0].0)), of_pair(json!(beads[1].0)), digits(row.volume)];
        cells.extend(row.moment.map(|m| to_place(m / row.volume.max(f64::MIN_POSITIVE), cell / 100.0)));
        cells.extend([layer(0), layer(1), span(0), span(1), feature(0), feature(1)]);
        cells.extend(beads.map(|(_, pass)| of_pair(json!(pass))));
        cells.extend([digits(error * 1.05), six_digits(row.sampled), json!(row.pairs)]);
        cells
    };
    Table::new(&COLUMNS, count, values)
}

fn document<'a>(
    args: &OverlapArgs,
    store: &Store,
    tables: &BeadTables,
    found: &Overlaps,
    table: &'a Table<'_>,
) -> TableDocument<'a> {
    let sum = sum(found);
    let totals = json!({
        "unit": store.meta().unit,
        "cell": store.root().spacing(store.meta().depth),
        "by": match args.by {
            OverlapByArg::Pair => "pair",
            OverlapByArg::Feature => "feature",
            OverlapByArg::Layer => "layer",
        },
        "counted": if tables.count() == Count::Beads { "beads" } else { "passes" },
        "pairs": sum.pairs,
        "volume": sum.volume,
        "volume_error": sum.error(),
        "pair_samples": found.pair_samples.to_string(),
        "field_samples": found.field_samples.to_string(),
        "unexplained_samples": found.unexplained.to_string(),
        "sampled_volume": Overlaps::volume_of(store.root(), found.field_samples),
    });
    TableDocument::new(totals, "overlaps", table)
}
