//! `brickfield winding`: w at points, straight from meshes and toolpaths.

use super::{open_inputs, start};
use crate::args::WindingArgs;
use crate::failure::Failure;
use crate::points::{PointReader, PointWriter};
use anyhow::anyhow;
use brickfield_engine::Progress;
use brickfield_engine::build::require_closed;
use brickfield_engine::ingest::{Facets, Input, bounds_of_all};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::winding::{brute_at, winding_at};

/// Runs the command.
pub fn run(args: &WindingArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let inputs = open_inputs(&args.inputs, &[], &args.toolpath.options()?, &bars)?;
    let points = PointReader::open(&args.points)?.all()?;
    let (min, max) = bounds_of_all(&inputs, &bars)?;
    let root = RootCube::around(min, max).ok_or_else(|| {
        let path = inputs[0].path().display();
        anyhow!(
            "{path}: bounds: the input spans {min:?} to {max:?}, which fits no lattice; give it an extent"
        )
    })?;
    if !args.brute {
        require_closed(&inputs, root, &bars)?;
    }
    let sources: Vec<&dyn Facets> = inputs.iter().map(|input| input as &dyn Facets).collect();
    bars.phase("counting", Some(inputs.iter().map(Input::facets).sum()), "facets");
    let mut writer = PointWriter::new(args.json)?;
    if args.brute {
        let values = brute_at(&sources, root, &points, &bars)?;
        bars.clear();
        points.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, w))?;
    } else {
        let values = winding_at(&sources, root, &points, &bars)?;
        bars.clear();
        points.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, w))?;
    }
    writer.flush()
}
