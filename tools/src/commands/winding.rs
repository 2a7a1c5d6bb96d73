//! `brickfield winding`: w at points, straight from meshes, closed or open.

use super::{open_inputs, start};
use crate::args::WindingArgs;
use crate::failure::Failure;
use crate::points::{PointReader, PointWriter};
use crate::progress::Bars;
use anyhow::anyhow;
use brickfield_engine::Progress;
use brickfield_engine::build::is_closed;
use brickfield_engine::ingest::{Facets, Input, bounds_of_all};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::winding::{OpenPart, brute_at, open_winding_at, winding_at};
use std::fmt::Display;

/// Runs the command.
pub fn run(args: &WindingArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let inputs = open_inputs(&args.inputs, &[], &bars)?;
    let points = PointReader::open(&args.points)?.all()?;
    let (min, max) = bounds_of_all(&inputs, &bars)?;
    let root = RootCube::around(min, max).ok_or_else(|| {
        let path = inputs[0].path().display();
        anyhow!(
            "{path}: bounds: the input spans {min:?} to {max:?}, which fits no lattice; give it an extent"
        )
    })?;
    let sources: Vec<&dyn Facets> = inputs.iter().map(|input| input as &dyn Facets).collect();
    let total = Some(inputs.iter().map(Input::facets).sum());
    let mut writer = PointWriter::new(args.json)?;
    if args.brute {
        bars.phase("adding up", total, "facets");
        write(&mut writer, &bars, &points, &brute_at(&sources, root, &points, &bars)?)?;
    } else if is_closed(&inputs, root, &bars)? {
        bars.phase("counting", total, "facets");
        write(&mut writer, &bars, &points, &winding_at(&sources, root, &points, &bars)?)?;
    } else {
        let open = OpenPart::of(&sources, root, &bars)?;
        bars.phase("counting", total, "facets");
        let values = open_winding_at(&sources, root, &open, &points, args.gwn_error.0, &bars)?;
        write(&mut writer, &bars, &points, &values)?;
    }
    writer.flush()
}

fn write(
    writer: &mut PointWriter,
    bars: &Bars,
    points: &[[f64; 3]],
    values: &[impl Display + Copy],
) -> Result<(), Failure> {
    bars.clear();
    points.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, *w))
}
