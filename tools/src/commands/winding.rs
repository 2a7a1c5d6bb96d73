//! `brickfield winding`: w at points, straight from meshes, closed or open, toolpaths and point clouds.

use super::{features_of, open_inputs, start};
use crate::args::{BeadsArg, WindingArgs};
use crate::clouds::{TypedInputs, open_clouds};
use crate::devices::BackendArg;
use crate::devices::choose;
use crate::failure::Failure;
use crate::kinds::require_inputs;
use crate::memory;
use crate::output::warn;
use crate::pieces::left_text;
use crate::points::{PointReader, PointWriter};
use crate::progress::Bars;
use crate::toolpaths::solids;
use anyhow::anyhow;
use brickfield_engine::Progress;
use brickfield_engine::backend::{self, Vulkan};
use brickfield_engine::build::{bead_sources, bounds_of_sources, is_closed, surfels};
use brickfield_engine::ingest::{CloudInput, Facets, Input, bounds_of_all};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::pieces::{FlippedFacets, FlippedSource, study};
use brickfield_engine::solid::{Outline, Solids, beads_at, brute_beads_at};
use brickfield_engine::winding::{CloudField, OpenPart, brute_at, open_winding_at, winding_at};
use std::fmt::Display;
use std::path::Path;

/// Runs the command.
pub fn run(args: &WindingArgs) -> Result<(), Failure> {
    let asks_for_device = args.backend.backend == BackendArg::Vulkan || args.backend.device.is_some();
    if asks_for_device && !args.brute {
        return Err(Failure::Usage("--backend vulkan: only --brute runs on a device".to_owned()));
    }
    require_inputs(&args.inputs, "sample PART.brf --points P.csv")?;
    let bars = start(args.work)?;
    let typed = TypedInputs::of(&args.inputs, args.estimate_normals)?;
    let clouds = open_clouds(&typed.clouds, &args.room.of_arrays(), &bars)?;
    if !clouds.is_empty() {
        refuse_count(args, "it needs toolpaths as solids")?;
    }
    if !clouds.is_empty() && typed.others.is_empty() {
        refuse_orient(args, "points have")?;
        return of_clouds(args, clouds, &bars);
    }
    let open = args.toolpath.options(args.unit)?;
    let inputs = open_inputs(&typed.others, &[], &open, &bars)?;
    args.toolpath.require_features(features_of(&inputs))?;
    if !clouds.is_empty() {
        return of_mixed(args, &inputs, clouds, &bars);
    }
    let points = PointReader::open(&args.points)?.all()?;
    let (outline, note) = solids(args.beads_as, &open.sweep.shape, &inputs)?;
    if outline.is_none() {
        refuse_count(args, note.unwrap_or("it needs toolpaths as solids"))?;
    }
    if let Some(why) = note {
        warn(&format!("beads are swept to triangles: {why} (--beads-as mesh says so without this warning)"));
    }
    match outline {
        Some(outline) => {
            refuse_orient(args, "beads as solids have")?;
            of_solids(args, &inputs, outline, &points, &bars)
        }
        None => of_triangles(args, &inputs, &points, &bars),
    }
}

/// Refuses --orient where nothing can be turned.
fn refuse_orient(args: &WindingArgs, what: &str) -> Result<(), Failure> {
    match args.orient {
        Some(_) => Err(Failure::Usage(format!("--orient: {what} no facets to turn; leave it out"))),
        None => Ok(()),
    }
}

/// Refuses --count where there are no beads as solids.
fn refuse_count(args: &WindingArgs, why: &str) -> Result<(), Failure> {
    match args.count {
        Some(_) => Err(Failure::Usage(format!("--count: {why}; leave it out"))),
        None => Ok(()),
    }
}

fn of_solids(
    args: &WindingArgs,
    inputs: &[Input],
    outline: Outline,
    points: &[[f64; 3]],
    bars: &Bars,
) -> Result<(), Failure> {
    let sources = bead_sources(inputs)?;
    let root = root_around(inputs[0].path(), bounds_of_sources(&sources, outline)?)?;
    let toolpaths: Vec<_> = sources.iter().map(|source| source.toolpath).collect();
    let count = args.count.map(Into::into).unwrap_or_default();
    let (solids, segments) = Solids::new(&toolpaths, root, outline, count)?;
    bars.phase("counting", Some(segments.len() as u64), "segments");
    let values = match args.brute {
        true => brute_beads_at(&solids, &segments, root, points, bars)?,
        false => beads_at(&solids, &segments, root, points, bars)?,
    };
    write(args, bars, points, &values)
}

fn of_triangles(
    args: &WindingArgs,
    inputs: &[Input],
    points: &[[f64; 3]],
    bars: &Bars,
) -> Result<(), Failure> {
    let root = root_around(inputs[0].path(), bounds_of_all(inputs, bars)?)?;
    let given: Vec<&dyn Facets> = inputs.iter().map(|input| input as &dyn Facets).collect();
    let turned = turned(args, &given, root, bars)?;
    let oriented = turned.as_ref().map(|turned| turned.apply(&given));
    let sources = oriented.as_ref().map_or(given, |oriented| FlippedSource::sources(oriented));
    let total = Some(inputs.iter().map(Input::facets).sum());
    if args.brute {
        let device = device(args)?;
        bars.phase("adding up", total, "facets");
        if let Some(device) = device {
            let values = backend::brute_at(&device, &sources, root, points, bars)?;
            return write_of(args, bars, inputs, points, &values);
        }
        write_of(args, bars, inputs, points, &brute_at(&sources, root, points, bars)?)
    } else if is_closed(&sources, root, bars)? {
        bars.phase("counting", total, "facets");
        write_of(args, bars, inputs, points, &winding_at(&sources, root, points, bars)?)
    } else {
        let open = OpenPart::of(&sources, root, bars)?;
        bars.phase("counting", total, "facets");
        let values = open_winding_at(&sources, root, &open, points, args.gwn_error.0, bars)?;
        write_of(args, bars, inputs, points, &values)
    }
}

/// What --orient turns over, if it was asked for.
fn turned(
    args: &WindingArgs,
    given: &[&dyn Facets],
    root: RootCube,
    bars: &Bars,
) -> Result<Option<FlippedFacets>, Failure> {
    let Some(orient) = args.orient else { return Ok(None) };
    let memory = memory::budget(None).map_or(u64::MAX, |size| size.0);
    let (report, turned) = study(given, root, orient.into(), memory, bars)?;
    left_text(&report, orient).iter().for_each(|line| warn(line));
    Ok(Some(turned))
}

/// Of meshes and clouds together: both parts are added up, and share the error where both have one.
fn of_mixed(
    args: &WindingArgs,
    inputs: &[Input],
    clouds: Vec<CloudInput>,
    bars: &Bars,
) -> Result<(), Failure> {
    if args.beads_as == Some(BeadsArg::Analytic) {
        let what = "beads beside point clouds are swept to triangles; leave it out";
        return Err(Failure::Usage(format!("--beads-as analytic: {what}")));
    }
    let points = PointReader::open(&args.points)?.all()?;
    let surfels = surfels(clouds, args.estimate_normals, bars)?;
    let (of_meshes, of_points) = (bounds_of_all(inputs, bars)?, surfels.bounds());
    let low = std::array::from_fn(|a| f64::min(of_meshes.0[a], of_points.0[a]));
    let high = std::array::from_fn(|a| f64::max(of_meshes.1[a], of_points.1[a]));
    let root = root_around(&args.inputs[0], (low, high))?;
    let field = CloudField::new(&surfels, root)?;
    let given: Vec<&dyn Facets> = inputs.iter().map(|input| input as &dyn Facets).collect();
    let turned = turned(args, &given, root, bars)?;
    let oriented = turned.as_ref().map(|turned| turned.apply(&given));
    let sources = oriented.as_ref().map_or(given, |oriented| FlippedSource::sources(oriented));
    let error = args.gwn_error.0;
    let (of_meshes, of_clouds) = if args.brute {
        (brute_at(&sources, root, &points, bars)?, field.brute_at(root, &points))
    } else if is_closed(&sources, root, bars)? {
        let counts = winding_at(&sources, root, &points, bars)?;
        let counts = counts.into_iter().map(|count| count as f64).collect();
        (counts, field.winding_at(root, &points, error, bars)?)
    } else {
        let open = OpenPart::of(&sources, root, bars)?;
        let half = 0.5 * error;
        let of_meshes = open_winding_at(&sources, root, &open, &points, half, bars)?;
        (of_meshes, field.winding_at(root, &points, half, bars)?)
    };
    let values: Vec<f64> = of_meshes.iter().zip(of_clouds).map(|(a, b)| a + b).collect();
    write_of(args, bars, inputs, &points, &values)
}

/// The device for --brute: only one that is asked for, because it computes in single precision.
fn device(args: &WindingArgs) -> Result<Option<Vulkan>, Failure> {
    let is_asked_for = args.backend.backend == BackendArg::Vulkan || args.backend.device.is_some();
    Ok(if is_asked_for { choose(&args.backend, None, None)?.device() } else { None })
}

fn of_clouds(args: &WindingArgs, clouds: Vec<CloudInput>, bars: &Bars) -> Result<(), Failure> {
    let points = PointReader::open(&args.points)?.all()?;
    let surfels = surfels(clouds, args.estimate_normals, bars)?;
    let root = root_around(&args.inputs[0], surfels.bounds())?;
    let field = CloudField::new(&surfels, root)?;
    let values = if args.brute {
        field.brute_at(root, &points)
    } else {
        field.winding_at(root, &points, args.gwn_error.0, bars)?
    };
    write(args, bars, &points, &values)
}

fn root_around(path: &Path, (min, max): ([f64; 3], [f64; 3])) -> Result<RootCube, Failure> {
    RootCube::around(min, max).ok_or_else(|| {
        let path = path.display();
        let spans = format!("the input spans {min:?} to {max:?}, which fits no lattice");
        anyhow!("{path}: bounds: {spans}; give it an extent").into()
    })
}

/// As [`write()`], if the inputs have not changed since they were opened.
fn write_of(
    args: &WindingArgs,
    bars: &Bars,
    inputs: &[Input],
    points: &[[f64; 3]],
    values: &[impl Display + Copy],
) -> Result<(), Failure> {
    inputs.iter().try_for_each(Input::check)?;
    write(args, bars, points, values)
}

fn write(
    args: &WindingArgs,
    bars: &Bars,
    points: &[[f64; 3]],
    values: &[impl Display + Copy],
) -> Result<(), Failure> {
    bars.clear();
    let mut writer = PointWriter::new(args.json)?;
    points.iter().zip(values).try_for_each(|(point, w)| writer.write(*point, *w))?;
    writer.flush()
}
