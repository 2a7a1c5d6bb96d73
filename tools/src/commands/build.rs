//! `brickfield build`: meshes to a store, and its boundary on request.

use super::mesh::{MeshReport, mesh_sink, write_mesh};
use super::{open_inputs, start, unit_of, volumes_text};
use crate::args::{BackendArg, BackendArgs, BeadsArg, BuildArgs, RefineArg, WorkArgs};
use crate::cache_args::CompressionArg;
use crate::clouds::open_clouds;
use crate::devices::{Chosen, choose};
use crate::failure::Failure;
use crate::kinds::require_inputs;
use crate::memory;
use crate::output::{one_line, print, print_json, warn};
use crate::pieces::{OrientArg, inside_out_text, left_text, pieces_text};
use crate::toolpaths::{ToolpathReport, solids};
use crate::units::{GwnError, Size, Unit};
use brickfield_engine::analysis::{Volumes, volume, winding_range};
use brickfield_engine::backend::DeviceReport;
use brickfield_engine::brick::POINTS;
use brickfield_engine::build::{
    BuildOptions, Keeping, Resolution, Resources, ShareSummary, Summary, ThinDepth, ThinSheetsSummary,
    ThinSummary, build_clouds, build_opened,
};
use brickfield_engine::contour::ContourOptions;
use brickfield_engine::ingest::{CloudInput, Input, OpenOptions};
use brickfield_engine::store::{Refine, Store};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Largest error of the samples of open meshes.
const OPEN_ERROR: f64 = 1e-3;
/// That of point clouds: where points lie moves w near them by more, and a tenth of it takes four times as long.
const CLOUD_ERROR: f64 = 1e-2;
/// Each of the two caches of --mesh, decoded bricks and contoured cells, where no --memory is given.
const MESH_CACHE_BYTES: u64 = 512 << 20;

/// A checked command line.
struct Plan {
    inputs: Vec<PathBuf>,
    output: PathBuf,
    open: OpenOptions,
    beads: Option<BeadsArg>,
    estimate_normals: bool,
    orient: Option<OrientArg>,
    gwn_error: Option<GwnError>,
    units: Unit,
    options: BuildOptions,
    backend: BackendArgs,
    memory: Option<Size>,
    mesh: Option<PathBuf>,
    json: bool,
    work: WorkArgs,
}

impl TryFrom<BuildArgs> for Plan {
    type Error = Failure;

    fn try_from(args: BuildArgs) -> Result<Plan, Failure> {
        if !(args.stddev >= 0.0 && args.stddev.is_finite()) {
            return Err(Failure::Usage("--stddev takes a number of 0 or more".to_owned()));
        }
        let decides_otherwise = args.stddev > 0.0 || !matches!(args.refine, RefineArg::Hidden);
        let units = args.units.unwrap_or(Unit::Mm);
        if args.tolerance.in_unit(units) > 0.0 && decides_otherwise {
            let what = "--tolerance: it decides which bricks are divided; leave --stddev and --refine out";
            return Err(Failure::Usage(what.to_owned()));
        }
        if args.shard.is_some() && args.compression != CompressionArg::Lz4 {
            let what = "--compression: shares take lz4; give it to `cache repack` when they are joined";
            return Err(Failure::Usage(what.to_owned()));
        }
        let open = args.toolpath.options(args.units)?;
        let Ok(pace) = Duration::try_from_secs_f64(args.commit_every) else {
            return Err(Failure::Usage("--commit-every takes a number of seconds of 0 or more".to_owned()));
        };
        let options = BuildOptions {
            resolution: match args.cell {
                Some(cell) => Resolution::Cell(cell.in_unit(units)),
                None => args.depth.map_or(Resolution::Auto, Resolution::Depth),
            },
            refine: match args.refine {
                RefineArg::Hidden => Refine::Hidden,
                RefineArg::Stddev => Refine::Stddev,
                RefineArg::Surface => Refine::Surface,
            },
            stddev: args.stddev,
            tolerance: args.tolerance.in_unit(units),
            thin: match (args.max_depth, args.thin) {
                (Some(level), _) => ThinDepth::Level(level),
                (None, Some(levels)) => ThinDepth::Deeper(levels),
                (None, None) => ThinDepth::None,
            },
            gwn_error: args.gwn_error.map_or(OPEN_ERROR, |error| error.0),
            unit: units.symbol().to_owned(),
            solids: None,
            orient: args.orient.map(Into::into),
            share: args.shard.map(|shard| shard.0),
            compression: args.compression.into(),
            resources: Resources { temp_dir: args.temp_dir, ..Resources::default() },
            keeping: Keeping { pace, restart: args.restart, settings: args.toolpath.settings(&open) },
            identity: args.identity,
            program: concat!("brickfield ", env!("CARGO_PKG_VERSION")).to_owned(),
        };
        let work = WorkArgs { threads: args.threads, quiet: args.quiet, progress: args.progress };
        let BuildArgs {
            inputs,
            output,
            backend,
            memory,
            mesh,
            json,
            beads,
            estimate_normals,
            orient,
            gwn_error,
            ..
        } = args;
        Ok(Plan {
            inputs,
            output,
            open,
            beads,
            estimate_normals,
            orient,
            gwn_error,
            units,
            options,
            backend,
            memory,
            mesh,
            json,
            work,
        })
    }
}

/// Beads are in mm, whatever the program's unit: so are the store and the sizes of its cells.
fn count_in_mm(plan: &mut Plan) {
    let factor = plan.units.millimetres();
    if let Resolution::Cell(cell) = &mut plan.options.resolution {
        *cell *= factor;
    }
    plan.options.tolerance *= factor;
    plan.units = Unit::Mm;
    plan.options.unit = Unit::Mm.symbol().to_owned();
}

/// Runs the command.
pub fn run(args: BuildArgs) -> Result<(), Failure> {
    let mut plan = Plan::try_from(args)?;
    let started = Instant::now();
    require_inputs(&plan.inputs, "info PART.brf")?;
    let bars = start(plan.work)?;
    let outputs: Vec<&Path> =
        [Some(&plan.output), plan.mesh.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    let clouds = open_clouds(&plan.inputs, &outputs, plan.estimate_normals, &bars)?;
    if clouds.is_some() && plan.gwn_error.is_none() {
        plan.options.gwn_error = CLOUD_ERROR;
    }
    let columns = clouds.as_deref().unwrap_or_default().iter().map(CloudText::of).collect();
    let inputs = match &clouds {
        None => open_inputs(&plan.inputs, &outputs, &plan.open, &bars)?,
        Some(_) => Vec::new(),
    };
    let toolpaths = ToolpathReport::of_inputs(&inputs);
    if !toolpaths.is_empty() && plan.units != Unit::Mm {
        if toolpaths.len() < inputs.len() {
            let what =
                "there are meshes and toolpaths, which are read in mm: give meshes in mm, and leave it out";
            return Err(Failure::Usage(format!("--units {}: {what}", plan.units)));
        }
        count_in_mm(&mut plan);
    }
    choose_solids(&mut plan, &inputs, clouds.is_some())?;
    let chosen = choose(&plan.backend, plan.memory, not_for_devices(&plan.options, clouds.is_some()))?;
    plan.options.resources.device = chosen.device();
    let open_seconds = started.elapsed().as_secs_f64();
    let budget = memory::budget(plan.memory);
    plan.options.resources.memory = match &clouds {
        None => memory::require_room(&inputs, &plan.options, budget)?,
        Some(clouds) => memory::require_room_for_points(clouds, budget)?,
    };
    if let Some(device) = &plan.options.resources.device {
        // What batches take of the device's memory is this machine's where the device is a part of it, and half of it is
        // in any case.
        plan.options.resources.memory -= device.gpu().memory().min(plan.options.resources.memory / 2);
    }
    plan.options.resources.index = memory::index_share(plan.options.resources.memory);
    // Made before the long work, so that a name that cannot be written costs no time.
    let mut sink = plan.mesh.as_deref().map(|path| mesh_sink(path, Some(plan.units), false)).transpose()?;
    let mut summary = match clouds {
        None => build_opened(&inputs, &plan.output, &plan.options, &bars)?,
        Some(clouds) => build_clouds(clouds, plan.estimate_normals, &plan.output, &plan.options, &bars)?,
    };
    drop::<Vec<Input>>(inputs);
    summary.phases.insert(0, ("open", open_seconds));
    let cache_bytes = plan.memory.map_or(MESH_CACHE_BYTES, |size| size.0 / 4);
    let store = Store::open_any(&plan.output, cache_bytes)?;
    let mesh = match (&plan.mesh, &mut sink) {
        (Some(path), Some(sink)) => {
            let begun = Instant::now();
            let temp_dir = plan.options.resources.temp_dir.clone();
            let options =
                ContourOptions { cache_bytes: cache_bytes as usize, temp_dir, ..ContourOptions::default() };
            let report = write_mesh(&store, &options, path, sink.as_mut(), &bars)?;
            summary.phases.push(("mesh", begun.elapsed().as_secs_f64()));
            Some(report)
        }
        _ => None,
    };
    let audit = match toolpaths.is_empty() {
        true => None,
        false => {
            let begun = Instant::now();
            // Of a share they would say nothing about the part.
            let volumes = summary.share.is_none().then(|| volume(&store, &bars)).transpose()?;
            summary.phases.push(("audit", begun.elapsed().as_secs_f64()));
            Some(Audit { toolpaths, volumes })
        }
    };
    bars.clear();
    let cpu = why_cpu(&plan, &chosen, &summary);
    let mut report = Report::new(&plan, cpu, summary, &store, audit, mesh, started.elapsed().as_secs_f64());
    report.clouds = columns;
    report.warn();
    if plan.json {
        print_json(&report)
    } else if !plan.work.quiet {
        print(&report.text())
    } else {
        Ok(())
    }
}

/// Decides whether beads become solids.
fn choose_solids(plan: &mut Plan, inputs: &[Input], are_clouds: bool) -> Result<(), Failure> {
    let (solids, note) = match (are_clouds, plan.beads) {
        (false, beads) => solids(beads, &plan.open.sweep.shape, inputs)?,
        (true, Some(BeadsArg::Analytic)) => {
            return Err(Failure::Usage("--beads analytic: points are no beads; leave it out".to_owned()));
        }
        (true, _) => (None, None),
    };
    plan.options.solids = solids;
    if plan.options.tolerance > 0.0 {
        let why = match (are_clouds, solids) {
            (true, _) => Some("points have no facets to measure by; leave it out"),
            (_, Some(_)) => {
                Some("beads as solids have no facets to measure by; use --beads mesh, or leave it out")
            }
            _ => None,
        };
        if let Some(why) = why {
            return Err(Failure::Usage(format!("--tolerance: {why}")));
        }
    }
    let why = match (are_clouds, solids) {
        (true, _) => Some("points have no facets to turn"),
        (_, Some(_)) => Some("beads as solids have no facets to turn"),
        _ => None,
    };
    if let (Some(why), true) = (why, plan.orient.is_some()) {
        return Err(Failure::Usage(format!("--orient: {why}; leave it out")));
    }
    if plan.options.identity && solids.is_none() {
        let why = note.unwrap_or("it needs toolpaths as solids");
        return Err(Failure::Usage(format!("--identity: {why}; leave it out")));
    }
    if let Some(why) = note {
        warn(&format!("beads are swept to triangles: {why} (--beads mesh says so without this warning)"));
    }
    Ok(())
}

/// What is printed in the end.
#[derive(Serialize)]
struct Report {
    output: String,
    unit: String,
    #[serde(flatten)]
    summary: Summary,
    /// Why the processor evaluated the bricks, if a device might have.
    processor: Option<String>,
    /// What the user should know of the device.
    #[serde(skip)]
    device_warning: Option<String>,
    seconds: f64,
    /// Of beads as solids, their segments; of point clouds, their points.
    facets_per_second: f64,
    /// Samples of leaves that were evaluated, aprons included; uniform leaves need none.
    samples: u64,
    samples_per_second: f64,
    /// Maps of files included.
    peak_memory_bytes: Option<u64>,
    /// Null for a share without nodes.
    winding_min: Option<i16>,
    winding_max: Option<i16>,
    warnings: Vec<String>,
    /// Of builds from point clouds.
    clouds: Vec<CloudText>,
    /// Of builds from toolpaths.
    #[serde(flatten)]
    audit: Option<Audit>,
    mesh: Option<MeshReport>,
}

/// What was understood of a point cloud.
#[derive(Serialize)]
struct CloudText {
    path: String,
    columns: String,
}

impl CloudText {
    fn of(cloud: &CloudInput) -> CloudText {
        CloudText { path: cloud.path().display().to_string(), columns: cloud.columns_text() }
    }
}

/// Material fed, volume of the beads, and what the field makes of them.
#[derive(Serialize)]
struct Audit {
    toolpaths: Vec<ToolpathReport>,
    /// Of a whole store only.
    volumes: Option<Volumes>,
}

impl Report {
    fn new(
        plan: &Plan,
        cpu: Option<String>,
        summary: Summary,
        store: &Store,
        audit: Option<Audit>,
        mesh: Option<MeshReport>,
        seconds: f64,
    ) -> Report {
        let winding = winding_range(store);
        // Whether something lies inside is for all shares to say.
        let warnings = match winding.filter(|_| summary.share.is_none()) {
            Some(range) => warnings(range, plan, &summary),
            None => Vec::new(),
        };
        let samples = samples_of_leaves(store);
        let pieces = summary.facets + summary.segments + summary.points;
        let explicit = plan.backend.backend == BackendArg::Vulkan || plan.backend.device.is_some();
        let device_warning = match (&cpu, &summary.device) {
            (Some(why), _) if explicit => Some(format!("--backend vulkan: {why}")),
            (_, Some(DeviceReport { name, cpu_bricks, failure: Some(failure), .. })) => Some(format!(
                "{name}: {failure}; the processor evaluated {cpu_bricks} bricks in its place, with the same result"
            )),
            _ => None,
        };
        Report {
            processor: cpu,
            device_warning,
            output: plan.output.display().to_string(),
            unit: unit_of(store.meta()).to_owned(),
            summary,
            seconds,
            facets_per_second: pieces as f64 / seconds,
            samples,
            samples_per_second: samples as f64 / seconds,
            peak_memory_bytes: memory::peak().map(|size| size.0),
            winding_min: winding.map(|(min, _)| min),
            winding_max: winding.map(|(_, max)| max),
            warnings,
            clouds: Vec::new(),
            audit,
            mesh,
        }
    }

    fn warn(&self) {
        self.warnings.iter().for_each(|message| warn(&format!("{}: {message}", self.output)));
        self.thin_warning().iter().for_each(|message| warn(&format!("{}: {message}", self.output)));
        self.device_warning.iter().for_each(|message| warn(message));
        let toolpaths = self.audit.iter().flat_map(|audit| &audit.toolpaths);
        toolpaths.flat_map(ToolpathReport::warnings).for_each(|message| warn(&message));
    }

    fn text(&self) -> String {
        let Summary {
            facets,
            segments,
            degenerate_facets,
            skipped_faces,
            points,
            void_points,
            spacing,
            depth,
            cell,
            nodes,
            leaves,
            file_bytes,
            ..
        } = &self.summary;
        let mut text = String::new();
        let mut line = |line: String| text += &format!("{line}\n");
        let kept = format!("{} nodes, {} leaves, {}", nodes, leaves, Size(*file_bytes));
        line(format!("{}: {kept}", one_line(&self.output)));
        if let Some(ShareSummary { id, level, cubes, work }) = &self.summary.share {
            let cubes = format!("{cubes} of {} cubes of level {level}", 1u64 << (3 * level));
            line(format!("  share    {id}: {cubes}, {:.1}% of the work", 100.0 * work));
        }
        let (counted, pieces) = match segments {
            0 if *points > 0 => {
                (format!("{points} ({void_points} without area), {spacing:.6} {} apart", self.unit), "points")
            }
            0 => (
                format!("{facets} ({degenerate_facets} without area, {skipped_faces} faces left out)"),
                "facets",
            ),
            _ => (format!("{segments} of beads as solids, w counts beads"), "segments"),
        };
        line(format!("  {pieces:<8} {counted}"));
        for CloudText { path, columns } in &self.clouds {
            line(format!("  columns  {}: {}", one_line(path), one_line(columns)));
        }
        let Summary { open_edges, loops, flipped_patches, .. } = &self.summary;
        if *open_edges > 0 {
            let edges = format!("{open_edges} open edges in {loops} loops");
            line(format!("  surface  open: {edges}, {flipped_patches} flipped patches"));
        }
        if let Some(report) = &self.summary.pieces {
            let turned = report.turned_facets;
            line(format!("  pieces   {}; {turned} facets turned", pieces_text(report)));
        }
        match self.summary.turned_sweeps {
            0 => {}
            1 => line("  sweeps   1 Extrusion was inside out, and is turned".to_owned()),
            n => line(format!("  sweeps   {n} Extrusions were inside out, and are turned")),
        }
        let base = match self.summary.base_depth {
            base if base < *depth => format!("{base}, where walls or gaps are thin "),
            _ => String::new(),
        };
        line(format!("  depth    {base}{depth}, cells of {cell:.6} {}", self.unit));
        if let Some(ThinSummary { walls, gaps }) = &self.summary.thin {
            for (name, sheets) in [("walls", walls), ("gaps", gaps)] {
                let Some(sheets) = sheets else { continue };
                line(format!("  {name:<8} {}", self.thin_text(sheets)));
            }
        }
        if let (Some(min), Some(max)) = (self.winding_min, self.winding_max) {
            line(format!("  winding  {min} to {max}"));
        }
        if let Some(Audit { toolpaths, volumes }) = &self.audit {
            toolpaths.iter().for_each(|toolpath| line(format!("  source   {}", toolpath.text())));
            let volumes = volumes.as_ref();
            volumes.inspect(|volumes| line(format!("  volume   {}", volumes_text(volumes, &self.unit))));
            let all = toolpaths.iter().flat_map(ToolpathReport::warnings);
            all.for_each(|message| line(format!("  warning  {message}")));
        }
        self.warnings.iter().for_each(|message| line(format!("  warning  {message}")));
        self.backend_text().map(&mut line);
        let phases: Vec<String> =
            self.summary.phases.iter().map(|(name, seconds)| format!("{name} {seconds:.2} s")).collect();
        line(format!("  time     {:.2} s: {}", self.seconds, phases.join(", ")));
        let rates = (self.facets_per_second, self.samples_per_second / 1e6);
        line(format!("  rate     {:.0} {pieces}/s, {:.1} million samples/s", rates.0, rates.1));
        if let Some(peak) = self.peak_memory_bytes {
            let disk = match self.summary.temporary_bytes {
                0 => String::new(),
                bytes => format!("; {} in a temporary file", Size(bytes)),
            };
            line(format!("  memory   {} at most, maps of files included{disk}", Size(peak)));
        }
        if let Some(mesh) = &self.mesh {
            line(mesh.text());
        }
        text
    }
}

impl Report {
    /// Walls, or gaps, that no sample shows.
    fn thin_text(&self, sheets: &ThinSheetsSummary) -> String {
        let ThinSheetsSummary { area, thickness, thinnest, .. } = sheets;
        let (unit, cell) = (&self.unit, self.summary.cell);
        // Faces that touch somewhere have no least distance that would mean anything.
        let least = match *thinnest < cell / 1000.0 {
            true => format!("less than {}", rounded(cell / 1000.0)),
            false => rounded(*thinnest),
        };
        let (area, thickness) = (rounded(*area), rounded(*thickness));
        format!(
            "about {area} {unit}² thinner than a cell hide between samples, {thickness} {unit} in the mean, {least} {unit} at least"
        )
    }

    /// The warning of walls that no sample shows, if they are more than the slivers between faces that nearly touch. Gaps
    /// make none: beads that touch have them everywhere.
    fn thin_warning(&self) -> Option<String> {
        let walls = self.summary.thin.as_ref()?.walls.as_ref()?;
        let cell = self.summary.cell;
        let cells = walls.area / (cell * cell);
        let are_slivers = cells < 64.0 || (cells < 1000.0 && walls.thickness < cell / 20.0);
        let remedy = match walls.depth {
            Some(depth) => format!("--max-depth {depth} divides bricks there alone"),
            None => "no depth shows them all".to_owned(),
        };
        (!are_slivers).then(|| format!("walls: {}; {remedy}", self.thin_text(walls)))
    }

    /// What evaluated the bricks, where it was a device or might have been.
    fn backend_text(&self) -> Option<String> {
        let Some(report) = &self.summary.device else {
            return self.processor.as_ref().map(|why| format!("  backend  processor: {why}"));
        };
        let DeviceReport { name, bricks, cpu_bricks, batches, samples, settled, .. } = report;
        let DeviceReport { upload_seconds, kernel_seconds, read_seconds, sum_seconds, .. } = report;
        let kernels: f64 = kernel_seconds.iter().sum::<f64>() + sum_seconds;
        let times = format!("{upload_seconds:.2} s up, {kernels:.2} s computing, {read_seconds:.2} s back");
        let others = match cpu_bricks {
            0 => String::new(),
            n => format!(", {n} by the processor"),
        };
        let close = match samples {
            0 => String::new(),
            _ => format!("; {:.1}% of samples settled here", 100.0 * *settled as f64 / *samples as f64),
        };
        Some(format!("  backend  {name}: {bricks} bricks in {batches} batches{others}; {times}{close}"))
    }
}

/// Why the processor evaluated the bricks, if a device might have.
fn why_cpu(plan: &Plan, chosen: &Chosen, summary: &Summary) -> Option<String> {
    if let Chosen::Cpu { why } = chosen {
        return why.clone();
    }
    if summary.device.is_some() {
        return None;
    }
    not_for_devices(&plan.options, summary.points > 0).map(str::to_owned)
}

/// Why no device evaluates the bricks.
fn not_for_devices(options: &BuildOptions, are_clouds: bool) -> Option<&'static str> {
    if are_clouds {
        Some("the bricks of point clouds are the processor's")
    } else if options.solids.is_some() {
        Some("the bricks of beads as solids are the processor's (see --beads mesh)")
    } else if options.thin != ThinDepth::None {
        Some("with --max-depth or --thin all bricks are the processor's")
    } else {
        None
    }
}

/// An estimate to three digits.
fn rounded(value: f64) -> String {
    let digits = 2 - value.abs().max(1e-300).log10().floor() as i32;
    match digits {
        0.. => format!("{value:.*}", digits.min(12) as usize),
        _ => {
            let unit = 10f64.powi(-digits);
            format!("{:.0}", (value / unit).round() * unit)
        }
    }
}

/// How many samples the leaves that are not uniform have.
fn samples_of_leaves(store: &Store) -> u64 {
    let evaluated =
        store.entries().iter().filter(|entry| entry.leaf && !entry.head.kind.is_uniform()).count();
    evaluated as u64 * POINTS as u64
}

/// What the user should know of a field with this range, and of the pieces behind it.
fn warnings((min, max): (i16, i16), plan: &Plan, summary: &Summary) -> Vec<String> {
    let empty = match (min, max) {
        (min, max) if min < 0 && max <= 0 => Some("nothing lies inside: facets, or normals, face inwards"),
        (0, 0) => Some("nothing lies inside: no body is large enough for a sample"),
        _ => None,
    };
    let is_closed_mesh = summary.open_edges == 0 && summary.points == 0;
    let negative = match &summary.inside_out {
        Some(found) => {
            let input = plan.inputs[found.source].display().to_string();
            Some(inside_out_text(found, &input, plan.units.symbol()))
        }
        None if min < 0 && is_closed_mesh => Some(match plan.orient {
            None => format!(
                "w falls to {min}: pieces are inside out, or cavities overlap; turn pieces with --orient"
            ),
            Some(_) => {
                format!("w falls to {min}, where cavities overlap each other; unite them in the input")
            }
        }),
        None => None,
    };
    let field: Vec<String> = empty.map(str::to_owned).into_iter().chain(negative).collect();
    let left = plan.orient.zip(summary.pieces.as_ref());
    let left = left.map_or(Vec::new(), |(asked, report)| left_text(report, asked));
    let field = Some(field.join("; ")).filter(|line| !line.is_empty());
    field.into_iter().chain(left).collect()
}
