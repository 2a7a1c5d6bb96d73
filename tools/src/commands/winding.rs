//! `brickfield winding`: w at points, straight from meshes and toolpaths.

use super::{open_inputs, start};
use crate::args::WindingArgs;
use crate::failure::Failure;
use crate::output::warn;
use crate::points::{PointReader, PointWriter};
use crate::progress::Bars;
use crate::toolpaths::solids;
use anyhow::anyhow;
use brickfield_engine::Progress;
use brickfield_engine::build::{bead_sources, bounds_of_sources, require_closed};
use brickfield_engine::ingest::{Facets, Input, bounds_of_all};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::solid::{Outline, Solids, beads_at, brute_beads_at};
use brickfield_engine::winding::{brute_at, winding_at};

/// Runs the command.
pub fn run(args: &WindingArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let open = args.toolpath.options()?;
    let inputs = open_inputs(&args.inputs, &[], &open, &bars)?;
    let points = PointReader::open(&args.points)?.all()?;
    let (outline, note) = solids(args.beads, &open.sweep.shape, &inputs)?;
    if let Some(why) = note {
        warn(&format!("beads are swept to triangles: {why} (--beads mesh says so without this warning)"));
    }
    match outline {
        Some(outline) => of_solids(args, &inputs, outline, &points, &bars),
        None => of_triangles(args, &inputs, &points, &bars),
    }
}

fn root_of(inputs: &[Input], (min, max): ([f64; 3], [f64; 3])) -> Result<RootCube, Failure> {
    RootCube::around(min, max).ok_or_else(|| {
        let path = inputs[0].path().display();
        let what = format!("the input spans {min:?} to {max:?}, which fits no lattice");
        anyhow!("{path}: bounds: {what}; give it an extent").into()
    })
}

fn of_solids(
    args: &WindingArgs,
    inputs: &[Input],
    outline: Outline,
    points: &[[f64; 3]],
    bars: &Bars,
) -> Result<(), Failure> {
    let sources = bead_sources(inputs)?;
    let root = root_of(inputs, bounds_of_sources(&sources, outline)?)?;
    let toolpaths: Vec<_> = sources.iter().map(|source| source.toolpath).collect();
    let (solids, segments) = Solids::new(&toolpaths, root, outline)?;
    bars.phase("counting", Some(segments.len() as u64), "segments");
    let values = match args.brute {
        true => brute_beads_at(&solids, &segments, root, points, bars)?,
        false => beads_at(&solids, &segments, root, points, bars)?,
    };
    bars.clear();
    let mut writer = PointWriter::new(args.json)?;
    points.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, w))?;
    writer.flush()
}

fn of_triangles(
    args: &WindingArgs,
    inputs: &[Input],
    points: &[[f64; 3]],
    bars: &Bars,
) -> Result<(), Failure> {
    let root = root_of(inputs, bounds_of_all(inputs, bars)?)?;
    if !args.brute {
        require_closed(inputs, root, bars)?;
    }
    let sources: Vec<&dyn Facets> = inputs.iter().map(|input| input as &dyn Facets).collect();
    bars.phase("counting", Some(inputs.iter().map(Input::facets).sum()), "facets");
    let mut writer = PointWriter::new(args.json)?;
    if args.brute {
        let values = brute_at(&sources, root, points, bars)?;
        bars.clear();
        points.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, w))?;
    } else {
        let values = winding_at(&sources, root, points, bars)?;
        bars.clear();
        points.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, w))?;
    }
    writer.flush()
}
