//! `brickfield build`: meshes to a store, and its boundary on request.

use super::build_report::{BuildReport, CloudText};
use super::mesh::{MeshReport, mesh_sink, require_mesh_space, write_mesh};
use super::{build_plan, build_volume};
use super::{features_of, open_inputs, open_store, start};
use crate::args::{BeadsArg, BuildArgs, CountArg, IoArg, OriginArg, RefineArg};
use crate::cache_args::CompressionArg;
use crate::clouds::{TypedInputs, open_clouds};
use crate::devices::{BackendArgs, ComputeDevice, DeviceCheckArg, choose};
use crate::failure::Failure;
use crate::kinds::{require_inputs, require_store_name};
use crate::memory;
use crate::output::{print, print_json, require_distinct, warn};
use crate::pieces::OrientArg;
use crate::progress::Bars;
use crate::space::tell_left_behind;
use crate::toolpaths::{ToolpathArgs, ToolpathReport, solids};
use crate::units::{GwnError, Size, Unit};
use crate::work::WorkArgs;
use brickfield_engine::build::{
    BuildOptions, BuildSummary, CommitOptions, Resolution, Resources, ThinDepth, build_clouds, build_mixed,
    build_opened, build_planned,
};
use brickfield_engine::contour::{ContourOptions, MeshSink};
use brickfield_engine::ingest::{CloudInput, Input, OpenOptions};
use brickfield_engine::large_array::ArrayRoom;
use brickfield_engine::store::{AcceptedStores, BrickTree, Refine, Store};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Largest error of the samples of open meshes.
const OPEN_ERROR: f64 = 1e-3;
/// That of point clouds: where points lie moves w near them by more, and a tenth of it takes four times as long.
const CLOUD_ERROR: f64 = 5e-2;
/// Each of the two caches of --mesh, decoded bricks and contoured cells, where no --memory is given.
const MESH_CACHE_BYTES: u64 = 512 << 20;

/// A checked command line.
pub(super) struct BuildRequest {
    pub(super) inputs: Vec<PathBuf>,
    pub(super) output: PathBuf,
    pub(super) open: OpenOptions,
    pub(super) toolpath: ToolpathArgs,
    beads: Option<BeadsArg>,
    count: Option<CountArg>,
    estimate_normals: bool,
    pub(super) orient: Option<OrientArg>,
    gwn_error: Option<GwnError>,
    pub(super) units: Unit,
    pub(super) options: BuildOptions,
    pub(super) backend: BackendArgs,
    device_check: DeviceCheckArg,
    pub(super) memory: Option<Size>,
    mesh: Option<PathBuf>,
    origin: Option<OriginArg>,
    pub(super) json: bool,
    pub(super) work: WorkArgs,
}

/// Refuses options that contradict each other.
fn require_compatible(args: &BuildArgs, units: Unit) -> Result<(), Failure> {
    if !(args.stddev >= 0.0 && args.stddev.is_finite()) {
        return Err(Failure::Usage("--stddev takes a number of 0 or more".to_owned()));
    }
    let decides_otherwise = args.stddev > 0.0 || !matches!(args.refine, RefineArg::Hidden);
    if args.boundary_error.in_unit(units) > 0.0 && decides_otherwise {
        let what = "--boundary-error: it decides which bricks are divided; leave --stddev and --refine out";
        return Err(Failure::Usage(what.to_owned()));
    }
    if args.shard.is_some() && args.compression != CompressionArg::Lz4 {
        let what = "--compression: shards take lz4; give it to `cache repack` when they are joined";
        return Err(Failure::Usage(what.to_owned()));
    }
    Ok(())
}

/// What the engine is told; what follows from the inputs comes later.
fn build_options(args: &BuildArgs, units: Unit, open: &OpenOptions) -> Result<BuildOptions, Failure> {
    let Ok(pace) = Duration::try_from_secs_f64(args.commit_every) else {
        return Err(Failure::Usage("--commit-every takes a number of seconds of 0 or more".to_owned()));
    };
    Ok(BuildOptions {
        resolution: match (args.cell, &args.like) {
            (Some(cell), _) => Resolution::Cell(cell.in_unit(units)),
            (None, Some(like)) => like_store(like)?,
            (None, None) => args.depth.map_or(Resolution::Auto, Resolution::Depth),
        },
        refine: match args.refine {
            RefineArg::Hidden => Refine::Hidden,
            RefineArg::Stddev => Refine::Stddev,
            RefineArg::Surface => Refine::Surface,
        },
        stddev: args.stddev,
        tolerance: args.boundary_error.in_unit(units),
        thin: match (args.max_depth, args.thin) {
            (Some(level), _) => ThinDepth::Level(level),
            (None, Some(levels)) => ThinDepth::Deeper(levels),
            (None, None) => ThinDepth::None,
        },
        gwn_error: args.gwn_error.map_or(OPEN_ERROR, |error| error.0),
        unit: units.symbol().to_owned(),
        solids: None,
        count: args.count.map(Into::into).unwrap_or_default(),
        orient: args.orient.map(Into::into),
        shard: args.shard.map(|shard| shard.0),
        compression: args.compression.into(),
        resources: Resources { temp_dir: args.temp_dir.clone(), ..Resources::default() },
        keeping: CommitOptions { pace, restart: args.restart, settings: args.toolpath.settings(open) },
        identity: args.identity,
        program: concat!("brickfield ", env!("CARGO_PKG_VERSION")).to_owned(),
    })
}

impl TryFrom<BuildArgs> for BuildRequest {
    type Error = Failure;

    fn try_from(args: BuildArgs) -> Result<BuildRequest, Failure> {
        let units = args.unit.unwrap_or(Unit::Mm);
        require_compatible(&args, units)?;
        let open = args.toolpath.options(args.unit)?;
        let options = build_options(&args, units, &open)?;
        let work = WorkArgs { threads: args.threads, quiet: args.quiet, progress: args.progress };
        let BuildArgs {
            inputs,
            output,
            backend,
            device_check,
            memory,
            mesh,
            origin,
            json,
            beads_as,
            count,
            estimate_normals,
            orient,
            gwn_error,
            toolpath,
            ..
        } = args;
        Ok(BuildRequest {
            inputs,
            output,
            open,
            toolpath,
            beads: beads_as,
            count,
            estimate_normals,
            orient,
            gwn_error,
            units,
            options,
            backend,
            device_check,
            memory,
            mesh,
            origin,
            json,
            work,
        })
    }
}

impl BuildRequest {
    /// The room in memory for each array of points, where all may take so much.
    fn array_room(&self, budget: Option<Size>) -> ArrayRoom {
        let memory = budget.map_or(u64::MAX, |size| size.0);
        let resources =
            Resources { memory, temp_dir: self.options.resources.temp_dir.clone(), ..Resources::default() };
        resources.array_room(&self.output)
    }

    /// Gives the build the device that was asked for, if one is of use.
    fn choose_device(&mut self, are_clouds: bool) -> Result<ComputeDevice, Failure> {
        let why_not = not_for_devices(&self.options, are_clouds);
        let chosen = choose(&self.backend, self.memory, Some(why_not))?;
        let device = chosen.device().map(|device| device.with_check(self.device_check.into()));
        self.options.resources.device = device;
        Ok(chosen)
    }

    /// Gives the build its memory, beside that of its device.
    pub(super) fn take_memory(&mut self, memory: u64) {
        let resources = &mut self.options.resources;
        // What batches take of the device's memory is this machine's where the device is a part of it, and half of it is in
        // any case.
        let of_device = resources.device.as_ref().map_or(0, |device| device.gpu().memory().min(memory / 2));
        resources.memory = memory - of_device;
        resources.index = memory::index_share(resources.memory);
    }

    /// Memory for each of the two caches of --mesh.
    fn cache_bytes(&self) -> u64 {
        self.memory.map_or(MESH_CACHE_BYTES, |size| size.0 / 4)
    }
}

/// The lattice of another store.
fn like_store(path: &Path) -> Result<Resolution, Failure> {
    let store = open_store(path, 0, IoArg::default(), AcceptedStores::Unfinished)?;
    Ok(Resolution::Like(store.root(), store.meta().depth))
}

/// Beads are in mm, whatever the program's unit: so are the store and the sizes of its cells. E57 counts in metres and is read
/// in mm, as every input that says its unit.
pub(super) fn settle_unit(
    request: &mut BuildRequest,
    inputs: &[Input],
    clouds: &[CloudInput],
) -> Result<(), Failure> {
    let toolpaths = inputs.iter().filter(|input| input.beads().is_some()).count();
    let in_mm = toolpaths + clouds.iter().filter(|cloud| cloud.is_in_millimetres()).count();
    if in_mm == 0 || request.units == Unit::Mm {
        return Ok(());
    }
    if in_mm < inputs.len() + clouds.len() {
        let what = match (inputs.is_empty(), clouds.is_empty()) {
            (_, true) => {
                "there are meshes and toolpaths, which are read in mm: give meshes in mm, and leave it out"
            }
            (true, _) => "E57 is read in mm, from its metres: give the other clouds in mm, and leave it out",
            _ => "toolpaths and E57 are read in mm: give the other inputs in mm, and leave it out",
        };
        return Err(Failure::Usage(format!("--unit {}: {what}", request.units)));
    }
    count_in_mm(request);
    Ok(())
}

fn count_in_mm(request: &mut BuildRequest) {
    let factor = request.units.millimetres();
    if let Resolution::Cell(cell) = &mut request.options.resolution {
        *cell *= factor;
    }
    request.options.tolerance *= factor;
    request.units = Unit::Mm;
    request.options.unit = Unit::Mm.symbol().to_owned();
}

/// Runs the command.
pub fn run(args: BuildArgs) -> Result<(), Failure> {
    if let Some(volume) = build_volume::volume_of(&args)? {
        return build_volume::run(&args, volume);
    }
    if let Some(plan) = build_plan::plan_of(&args)? {
        let plan = plan.to_owned();
        return build_shard(BuildRequest::try_from(args)?, &plan);
    }
    if args.plan {
        return build_plan::run(BuildRequest::try_from(args)?);
    }
    let mut request = BuildRequest::try_from(args)?;
    let started = Instant::now();
    require_store_name(&request.output, true)?;
    require_inputs(&request.inputs, "info PART.brf")?;
    let bars = start(request.work)?;
    let outputs: Vec<&Path> =
        [Some(&request.output), request.mesh.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    let typed = TypedInputs::of(&request.inputs, request.estimate_normals)?;
    let names: Vec<&Path> = request.inputs.iter().map(PathBuf::as_path).collect();
    require_distinct(&outputs, &names)?;
    let budget = memory::budget(request.memory);
    let clouds = open_clouds(&typed.clouds, &request.array_room(budget), &bars)?;
    if !clouds.is_empty() && request.gwn_error.is_none() {
        request.options.gwn_error = CLOUD_ERROR;
    }
    let columns = clouds.iter().map(CloudText::of).collect();
    let inputs = open_inputs(&typed.others, &outputs, &request.open, &bars)?;
    request.toolpath.require_features(features_of(&inputs))?;
    let toolpaths = ToolpathReport::of_inputs(&inputs);
    settle_unit(&mut request, &inputs, &clouds)?;
    choose_solids(&mut request, &inputs, !clouds.is_empty())?;
    let chosen = request.choose_device(!clouds.is_empty())?;
    let open_seconds = started.elapsed().as_secs_f64();
    request.take_memory(match clouds.is_empty() {
        true => memory::require_room(&inputs, &request.options, budget)?,
        false => memory::require_room_for_points(&clouds, &inputs, budget)?,
    });
    // Made before the long work, so that a name that cannot be written costs no time.
    if let Some(mesh) = &request.mesh {
        tell_left_behind(mesh, request.work.quiet);
    }
    let sink = request.mesh.as_deref().map(|path| mesh_sink(path, Some(request.units), false)).transpose()?;
    let mut summary = build_any(&request, &typed, (inputs, clouds), &bars)?;
    summary.phases.insert(0, ("open", open_seconds));
    let store = Store::open_any(&request.output, request.cache_bytes())?;
    let mesh = mesh_of(&request, &store, sink, &mut summary, &bars)?;
    bars.clear();
    let cpu = why_cpu(&request, &chosen, &summary);
    let mut report = BuildReport::new(&request, cpu, summary, &store, mesh, started.elapsed().as_secs_f64());
    report.clouds = columns;
    report.toolpaths = (!toolpaths.is_empty()).then_some(toolpaths);
    tell(&request, &report)
}

/// Builds the store of inputs of one kind, or of meshes and clouds together.
fn build_any(
    request: &BuildRequest,
    typed: &TypedInputs,
    (inputs, clouds): (Vec<Input>, Vec<CloudInput>),
    bars: &Bars,
) -> Result<BuildSummary, Failure> {
    let BuildRequest { output, options, estimate_normals: estimate, .. } = request;
    Ok(match (inputs.is_empty(), clouds.is_empty()) {
        (_, true) => build_opened(&inputs, output, options, bars)?,
        (true, false) => build_clouds(clouds, *estimate, output, options, bars)?,
        (false, false) => build_mixed(typed.mixed(clouds, inputs), *estimate, output, options, bars)?,
    })
}

/// Builds a shard from a plan.
fn build_shard(mut request: BuildRequest, plan: &Path) -> Result<(), Failure> {
    let started = Instant::now();
    require_store_name(&request.output, true)?;
    require_distinct(&[&request.output], &[plan])?;
    let bars = start(request.work)?;
    let chosen = request.choose_device(false)?;
    let budget = memory::budget(request.memory);
    request.take_memory(memory::require_room(&[], &request.options, budget)?);
    let summary = build_planned(plan, &request.output, &request.options, &bars)?;
    let store = Store::open_any(&request.output, request.cache_bytes())?;
    bars.clear();
    let cpu = why_cpu(&request, &chosen, &summary);
    let report = BuildReport::new(&request, cpu, summary, &store, None, started.elapsed().as_secs_f64());
    tell(&request, &report)
}

fn tell(request: &BuildRequest, report: &BuildReport) -> Result<(), Failure> {
    report.warn();
    if request.json {
        print_json(report)
    } else if !request.work.quiet {
        print(&report.text())
    } else {
        Ok(())
    }
}

/// The mesh that was asked for.
fn mesh_of(
    request: &BuildRequest,
    store: &Store,
    sink: Option<Box<dyn MeshSink>>,
    summary: &mut BuildSummary,
    bars: &Bars,
) -> Result<Option<MeshReport>, Failure> {
    let (Some(path), Some(sink)) = (&request.mesh, sink) else { return Ok(None) };
    let begun = Instant::now();
    let options = ContourOptions {
        cache_bytes: request.cache_bytes() as usize,
        temp_dir: request.options.resources.temp_dir.clone(),
        ..ContourOptions::default()
    };
    require_mesh_space(store, path, (options.iso, None), request.work.quiet)?;
    let mut report = write_mesh(store, &options, path, (sink, request.origin), bars)?;
    summary.phases.push(("mesh", begun.elapsed().as_secs_f64()));
    report.compare(store, &options, bars)?;
    Ok(Some(report))
}

/// Decides whether beads become solids.
pub(super) fn choose_solids(
    request: &mut BuildRequest,
    inputs: &[Input],
    are_clouds: bool,
) -> Result<(), Failure> {
    let (solids, note) = match (are_clouds, request.beads) {
        (false, beads) => solids(beads, &request.open.sweep.shape, inputs)?,
        (true, Some(BeadsArg::Analytic)) => {
            return Err(Failure::Usage("--beads-as analytic: points are no beads; leave it out".to_owned()));
        }
        (true, beads) => {
            let is_swept = inputs.iter().any(|input| input.beads().is_some()) && beads.is_none();
            (None, is_swept.then_some("there are point clouds among the inputs"))
        }
    };
    request.options.solids = solids;
    if request.options.tolerance > 0.0 {
        let why = match (are_clouds, solids) {
            (true, _) => Some("points have no facets to measure by; leave it out"),
            (_, Some(_)) => {
                Some("beads as solids have no facets to measure by; use --beads-as mesh, or leave it out")
            }
            _ => None,
        };
        if let Some(why) = why {
            return Err(Failure::Usage(format!("--boundary-error: {why}")));
        }
    }
    let why = match (are_clouds, solids) {
        (true, _) if inputs.is_empty() => Some("points have no facets to turn"),
        (_, Some(_)) => Some("beads as solids have no facets to turn"),
        _ => None,
    };
    if let (Some(why), true) = (why, request.orient.is_some()) {
        return Err(Failure::Usage(format!("--orient: {why}; leave it out")));
    }
    if request.options.identity && solids.is_none() {
        let why = note.unwrap_or("it needs toolpaths as solids");
        return Err(Failure::Usage(format!("--identity: {why}; leave it out")));
    }
    if request.count.is_some() && solids.is_none() {
        let why = note.unwrap_or("it needs toolpaths as solids");
        return Err(Failure::Usage(format!("--count: {why}; leave it out")));
    }
    if let Some(why) = note {
        warn(&format!("beads are swept to triangles: {why} (--beads-as mesh says so without this warning)"));
    }
    Ok(())
}

/// Why the processor evaluated the bricks, if a device might have.
fn why_cpu(request: &BuildRequest, chosen: &ComputeDevice, summary: &BuildSummary) -> Option<String> {
    if let ComputeDevice::Cpu { why } = chosen {
        return why.clone();
    }
    if summary.device.is_some() {
        return None;
    }
    Some(not_for_devices(&request.options, summary.input.has_points()).to_owned())
}

/// Why no device evaluates the bricks, unless one is asked for.
fn not_for_devices(options: &BuildOptions, are_clouds: bool) -> &'static str {
    if are_clouds {
        "the bricks of point clouds are the processor's"
    } else if options.solids.is_some() {
        "the bricks of beads as solids are the processor's (see --beads-as mesh)"
    } else if options.thin != ThinDepth::None {
        "with --max-depth or --thin all bricks are the processor's"
    } else {
        // Packing and unpacking batches takes the processor longer than evaluating the bricks: see the report on devices.
        "builds take less time on it than on a device (see --backend vulkan)"
    }
}
