//! `brickfield sample`: w at points, from a store.

use super::{CACHE_BYTES, of_store, open_store, start};
use crate::args::SampleArgs;
use crate::failure::Failure;
use crate::points::{PointBead, PointReader, PointWriter};
use brickfield_engine::analysis::{CoveringPass, beads_at_points, sample_at};
use brickfield_engine::store::{AcceptedStores, BeadTables, Store};
use brickfield_engine::{Error, Progress};

/// Points read before their samples are printed, which bounds memory. Those of a batch are asked in the order of bricks.
const BATCH_POINTS: usize = 1 << 18;

/// Runs the command.
pub fn run(args: &SampleArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let open = |accept| open_store(&args.store, CACHE_BYTES, args.io, accept);
    // An unfinished store has leaves, but neither tables nor lists of beads.
    let store = open(if args.beads { AcceptedStores::Whole } else { AcceptedStores::Unfinished })?;
    if store.meta().shard.is_some() {
        // Refused, with what to do about it.
        open(AcceptedStores::Whole)?;
    }
    let tables = args.beads.then(|| tables_of(&store)).transpose()?;
    let mut points = PointReader::open(&args.points)?;
    let mut writer = match tables {
        Some(_) => PointWriter::with_beads(args.json)?,
        None => PointWriter::new(args.json)?,
    };
    bars.phase("sampling", None, "points");
    loop {
        let batch = points.batch(BATCH_POINTS)?;
        if batch.is_empty() {
            return writer.flush();
        }
        bars.check()?;
        let values = sample_at(&store, &batch).map_err(|error| of_store(&store, "points", error))?;
        match &tables {
            Some(tables) => {
                let beads = beads_at_points(&store, tables, &batch)?;
                for ((point, w), beads) in batch.iter().zip(values).zip(beads) {
                    writer.write_beads(
                        *point,
                        w,
                        &beads.iter().map(|&found| bead(tables, found)).collect::<Vec<_>>(),
                    )?;
                }
            }
            None => batch.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, w))?,
        }
        writer.flush()?;
        bars.advance(batch.len() as u64);
    }
}

/// What tells beads apart.
///
/// # Errors
/// If the store does not.
pub(super) fn tables_of(store: &Store) -> Result<BeadTables, Failure> {
    store.bead_tables()?.ok_or_else(|| {
        let remedy = "build it from toolpaths with --identity";
        Error::store(store.path(), "metadata", "the store does not tell beads apart", remedy).into()
    })
}

fn bead(tables: &BeadTables, CoveringPass { number, lines }: CoveringPass) -> PointBead<'_> {
    let (bead, pass) = tables.bead_of(number);
    let row = tables.beads[bead as usize];
    PointBead {
        bead,
        pass,
        source: row.source,
        // Of the store's layers the first is 0; people count from 1.
        layer: row.layer + 1,
        tool: row.tool,
        feature: &tables.features[usize::from(row.feature)],
        first_line: lines.0,
        last_line: lines.1,
    }
}
