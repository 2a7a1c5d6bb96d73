//! The read floor: what no job on a file can do without.

use brickfield_engine::ingest::{Facet, Input, runs};
use brickfield_engine::lattice::{RootCube, Units};
use brickfield_engine::{Error, Silent};
use rayon::prelude::*;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::Instant;

/// Root cube of the snapping: near enough that nothing overflows, whatever the input.
pub const ROOT: RootCube = RootCube { origin: [-1024.0; 3], edge: 4096.0 };

/// Seconds to stream a mesh once with all cores and to snap every vertex to a lattice, number by number in plain code.
/// That code stays what it is when the engine's own becomes faster. Of any other file: seconds to read its bytes.
pub fn read_floor(path: &Path, is_mesh: bool) -> Result<f64, Error> {
    let start = Instant::now();
    let sum = if is_mesh { read_and_snap(path, snap_plainly)? } else { read_all(path)? };
    std::hint::black_box(sum);
    Ok(start.elapsed().as_secs_f64())
}

/// Reads everything and snaps it with `snap`. Returns a sum of everything, so that nothing is optimised away.
pub fn read_and_snap(path: &Path, snap: impl Fn([f64; 3]) -> Units + Copy + Sync) -> Result<i64, Error> {
    let input = Input::open(path, &Silent)?;
    let of_run = |world: &mut Vec<Facet>, (_, range): (usize, std::ops::Range<u64>)| -> i64 {
        input.read(range, world);
        world.iter().map(|t| t.map(snap).as_flattened().iter().map(|&c| i64::from(c)).sum::<i64>()).sum()
    };
    let sum = runs(&[&input]).into_par_iter().map_init(Vec::new, of_run).sum();
    input.check()?;
    Ok(sum)
}

/// To the nearest even units, one number after the other.
fn snap_plainly(p: [f64; 3]) -> Units {
    const SCALE: f64 = (1 << 23) as f64 / ROOT.edge;
    std::array::from_fn(|axis| {
        let shifted = (p[axis] - ROOT.origin[axis]) * SCALE + 0.5;
        let truncated = shifted as i32;
        2 * (truncated - i32::from(f64::from(truncated) > shifted))
    })
}

fn read_all(path: &Path) -> Result<i64, Error> {
    let read = || {
        let (mut file, mut buffer, mut sum) = (File::open(path)?, vec![0; 1 << 20], 0);
        loop {
            match file.read(&mut buffer)? {
                0 => return Ok(sum),
                bytes => sum += buffer[..bytes].iter().map(|&byte| i64::from(byte)).sum::<i64>(),
            }
        }
    };
    read().map_err(Error::io(path, "read"))
}

#[cfg(test)]
mod tests {
    // No imports: where this file is part of a benchmark, `cfg(test)` holds and tests are left out.
    #[test]
    fn plain_snapping_is_the_engines() {
        let file =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bench-data/stl/spot40_model.stl");
        let plain = super::read_and_snap(&file, super::snap_plainly).map_err(|error| error.to_string());
        let own = super::read_and_snap(&file, super::ROOT.snapper()).map_err(|error| error.to_string());
        assert!(plain.is_ok(), "{plain:?}");
        assert_eq!(plain, own);
    }
}
