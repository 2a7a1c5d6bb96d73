//! `brickfield sample`: w at points, from a store.

use super::{CACHE_BYTES, start};
use crate::args::SampleArgs;
use crate::failure::Failure;
use crate::points::{PointReader, PointWriter};
use brickfield_engine::Progress;
use brickfield_engine::analysis::sample_at;
use brickfield_engine::store::Store;

/// Points read before their samples are printed, which bounds memory.
const BATCH_POINTS: usize = 1 << 16;

/// Runs the command.
pub fn run(args: &SampleArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let store = Store::open(&args.store, CACHE_BYTES)?;
    let mut points = PointReader::open(&args.points)?;
    let mut writer = PointWriter::new(args.json)?;
    bars.phase("sampling", None, "points");
    loop {
        let batch = points.batch(BATCH_POINTS)?;
        if batch.is_empty() {
            return writer.flush();
        }
        bars.check()?;
        let values = sample_at(&store, &batch)?;
        batch.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, w))?;
        writer.flush()?;
        bars.advance(batch.len() as u64);
    }
}
