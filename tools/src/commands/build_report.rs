//! What `brickfield build` prints in the end, for people and for programs.

use super::balance::Balance;
use super::build::BuildRequest;
use super::mesh::MeshReport;
use super::{unit_of, volumes_text};
use crate::devices::BackendArg;
use crate::memory;
use crate::output::{one_line, warn};
use crate::pieces::{inside_out_text, left_text, pieces_text};
use crate::toolpaths::ToolpathReport;
use crate::units::Size;
use brickfield_engine::analysis::{Volumes, winding_range};
use brickfield_engine::backend::DeviceReport;
use brickfield_engine::brick::{Count, POINTS};
use brickfield_engine::build::{
    BeadsSummary, BuildSummary, FacetsSummary, InputSummary, PointsSummary, ResumedBuild, ShardSummary,
    ThinSheetsSummary, ThinSummary,
};
use brickfield_engine::ingest::CloudInput;
use brickfield_engine::lattice::MAX_LEVEL;
use brickfield_engine::store::{BeadsMeta, Store};
use serde::Serialize;

/// What is printed in the end.
#[derive(Serialize)]
pub(super) struct BuildReport {
    output: String,
    unit: String,
    /// Of the box around the input, along x, y and z.
    size: [f64; 3],
    #[serde(flatten)]
    summary: BuildSummary,
    /// Why the processor evaluated the bricks, if a device might have.
    processor: Option<String>,
    /// What the user should know of the device.
    #[serde(skip)]
    device_warning: Option<String>,
    seconds: f64,
    /// Of beads as solids, their segments; of point clouds, their points; of meshes and clouds, both.
    facets_per_second: f64,
    #[serde(skip)]
    count: Count,
    /// Samples of leaves that were evaluated, aprons included; uniform leaves need none.
    samples: u64,
    samples_per_second: f64,
    /// Maps of files included.
    peak_memory_bytes: Option<u64>,
    /// Null for a shard without nodes.
    winding_min: Option<i16>,
    winding_max: Option<i16>,
    warnings: Vec<String>,
    /// Of builds from point clouds.
    pub clouds: Vec<CloudText>,
    /// Of builds from toolpaths.
    pub toolpaths: Option<Vec<ToolpathReport>>,
    /// Of closed input.
    volumes: Option<Volumes>,
    /// Of beads as solids.
    balance: Option<Balance>,
    mesh: Option<MeshReport>,
}

/// What was understood of a point cloud.
#[derive(Serialize)]
pub(super) struct CloudText {
    path: String,
    columns: String,
}

impl CloudText {
    pub fn of(cloud: &CloudInput) -> CloudText {
        CloudText { path: cloud.path().display().to_string(), columns: cloud.columns_text() }
    }
}

impl BuildReport {
    /// Of a build that is done, and of its mesh.
    pub fn new(
        plan: &BuildRequest,
        cpu: Option<String>,
        summary: BuildSummary,
        store: &Store,
        mesh: Option<MeshReport>,
        seconds: f64,
    ) -> BuildReport {
        let winding = winding_range(store);
        // Whether something lies inside is for all shards to say.
        let warnings = match winding.filter(|_| summary.shard.is_none()) {
            Some(range) => warnings(range, plan, &summary),
            None => Vec::new(),
        };
        let samples = samples_of_leaves(store);
        let pieces = summary.input.count();
        let explicit = plan.backend.backend == BackendArg::Vulkan || plan.backend.device.is_some();
        let device_warning = match (&cpu, &summary.device) {
            (Some(why), _) if explicit => Some(format!("--backend vulkan: {why}")),
            (_, Some(DeviceReport { wrong: Some(wrong), .. })) => Some(format!(
                "{wrong}; the device was dropped, and the store was built anew by the processor alone"
            )),
            (_, Some(DeviceReport { name, cpu_bricks, failure: Some(failure), .. })) => Some(format!(
                "{name}: {failure}; the processor evaluated {cpu_bricks} bricks in its place, with the same result"
            )),
            _ => None,
        };
        let mut report = BuildReport {
            processor: cpu,
            device_warning,
            output: plan.output.display().to_string(),
            unit: unit_of(store.meta()).to_owned(),
            size: std::array::from_fn(|a| store.meta().bounds_max[a] - store.meta().bounds_min[a]),
            summary,
            seconds,
            facets_per_second: pieces as f64 / seconds,
            count: store.meta().beads.as_ref().map(BeadsMeta::count).unwrap_or_default(),
            samples,
            samples_per_second: samples as f64 / seconds,
            peak_memory_bytes: memory::peak().map(|size| size.0),
            winding_min: winding.map(|(min, _)| min),
            winding_max: winding.map(|(_, max)| max),
            warnings,
            clouds: Vec::new(),
            toolpaths: None,
            volumes: store.meta().volumes.as_ref().map(Volumes::from),
            balance: store.meta().volumes.as_ref().and_then(Balance::of),
            mesh,
        };
        report.warnings.extend(report.thin_warning());
        report.warnings.extend(report.unseen_warning());
        report
    }

    /// Prints the warnings.
    pub fn warn(&self) {
        self.warnings.iter().for_each(|message| warn(&format!("{}: {message}", self.output)));
        self.device_warning.iter().for_each(|message| warn(message));
        self.toolpaths.iter().flatten().flat_map(ToolpathReport::warnings).for_each(|message| warn(&message));
    }

    /// For people.
    pub fn text(&self) -> String {
        let BuildSummary { nodes, leaves, file_bytes, .. } = &self.summary;
        let kept = format!("{nodes} nodes, {leaves} leaves, {}", Size(*file_bytes));
        let mut lines = vec![format!("{}: {kept}", one_line(&self.output))];
        if let Some(ShardSummary { id, level, cubes, work }) = &self.summary.shard {
            let cubes = format!("{cubes} of {} cubes of level {level}", 1u64 << (3 * level));
            lines.push(format!("  shard    {id}: {cubes}, {:.1}% of the work", 100.0 * work));
        }
        if let Some(ResumedBuild { nodes, part }) = &self.summary.resumed {
            let of =
                format!("{nodes} nodes of an earlier run, {:.0}% of the way through the tree", 100.0 * part);
            let alone = "what is said of hidden walls, gaps and bodies covers the bricks of this run";
            lines.push(format!("  resumed  from {of}; {alone}"));
        }
        self.add_input(&mut lines);
        self.add_field(&mut lines);
        self.add_costs(&mut lines);
        lines.extend(self.mesh.iter().map(MeshReport::text));
        lines.iter().map(|line| format!("{line}\n")).collect()
    }

    /// What the input is counted in, and how many there are.
    fn counted(&self) -> (&'static str, String) {
        match &self.summary.input {
            InputSummary::Points(read) => ("points", points_text(read, &self.unit)),
            InputSummary::Facets(read) => ("facets", facets_text(read)),
            InputSummary::Mixed(facets, points) => (
                "pieces",
                format!("facets {}; points {}", facets_text(facets), points_text(points, &self.unit)),
            ),
            InputSummary::Beads(BeadsSummary { segments }) => {
                ("segments", format!("{segments} of beads as solids, w counts {}", self.count))
            }
        }
    }

    /// Lines about what was read.
    fn add_input(&self, lines: &mut Vec<String>) {
        let (pieces, counted) = self.counted();
        lines.push(format!("  {pieces:<8} {counted}"));
        let [x, y, z] = self.size.map(rounded_length);
        lines.push(format!("  size     {x} × {y} × {z} {}", self.unit));
        for CloudText { path, columns } in &self.clouds {
            lines.push(format!("  columns  {}: {}", one_line(path), one_line(columns)));
        }
        lines.extend(self.summary.input.facets().into_iter().flat_map(surface_lines));
    }

    /// Lines about the samples.
    fn add_field(&self, lines: &mut Vec<String>) {
        let BuildSummary { depth, base_depth, cell, .. } = &self.summary;
        let base = match base_depth < depth {
            true => format!("{base_depth}, where walls or gaps are thin "),
            false => String::new(),
        };
        lines.push(format!("  depth    {base}{depth}, cells of {cell:.6} {}", self.unit));
        if let Some(ThinSummary { walls, gaps, .. }) = &self.summary.thin {
            for (name, sheets) in [("walls", walls), ("gaps", gaps)] {
                lines.extend(sheets.iter().map(|sheets| format!("  {name:<8} {}", self.thin_text(sheets))));
            }
        }
        lines.extend(self.unseen_text().map(|text| format!("  unseen   {text}")));
        if let (Some(min), Some(max)) = (self.winding_min, self.winding_max) {
            lines.push(format!("  winding  {min} to {max}"));
        }
        let toolpaths = || self.toolpaths.iter().flatten();
        lines.extend(toolpaths().map(|toolpath| format!("  source   {}", toolpath.text())));
        let beside = toolpaths().filter_map(ToolpathReport::beside_text);
        lines.extend(beside.map(|text| format!("  beside   {text}")));
        let volumes = self.volumes.iter().map(|volumes| volumes_text(volumes, &self.unit));
        lines.extend(volumes.map(|text| format!("  volume   {text}")));
        lines.extend(self.balance.iter().map(|balance| format!("  balance  {}", balance.text(&self.unit))));
        let all = toolpaths().flat_map(ToolpathReport::warnings);
        lines.extend(all.map(|message| format!("  warning  {message}")));
        lines.extend(self.warnings.iter().map(|message| format!("  warning  {message}")));
    }

    /// Lines about what the build took.
    fn add_costs(&self, lines: &mut Vec<String>) {
        lines.extend(self.backend_text());
        let phases: Vec<String> =
            self.summary.phases.iter().map(|(name, seconds)| format!("{name} {seconds:.2} s")).collect();
        lines.push(format!("  time     {:.2} s: {}", self.seconds, phases.join(", ")));
        let rates = (self.facets_per_second, self.samples_per_second / 1e6);
        let pieces = self.counted().0;
        lines.push(format!("  rate     {:.0} {pieces}/s, {:.1} million samples/s", rates.0, rates.1));
        if let Some(peak) = self.peak_memory_bytes {
            let disk = match self.summary.temporary_bytes {
                0 => String::new(),
                bytes => format!("; {} in a temporary file", Size(bytes)),
            };
            lines.push(format!("  memory   {} at most, maps of files included{disk}", Size(peak)));
        }
    }

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
        let gaps =
            self.summary.thin.as_ref().and_then(|thin| thin.gaps.as_ref()).map_or(0.0, |gaps| gaps.area);
        let is_between_gaps = walls.thickness < cell / 20.0 && walls.area < gaps / 10.0;
        let are_slivers = walls.area < 64.0 * cell * cell || is_between_gaps;
        let remedy = match walls.depth {
            Some(depth) => format!("--max-depth {depth} divides bricks there alone"),
            None => "no depth shows them all".to_owned(),
        };
        (!are_slivers).then(|| format!("walls: {}; {remedy}", self.thin_text(walls)))
    }

    /// Bodies that no sample shows.
    fn unseen_text(&self) -> Option<String> {
        let bricks = self.summary.thin.as_ref()?.unseen_bricks;
        let (s, holds) = if bricks == 1 { ("", "holds") } else { ("s", "hold") };
        (bricks > 0).then(|| {
            format!(
                "{bricks} brick{s} {holds} something thinner than a cell that no sample shows, as a rod is"
            )
        })
    }

    /// The warning of bodies that no sample shows. How thin they are is not known.
    fn unseen_warning(&self) -> Option<String> {
        let depth = (self.summary.depth + 3).min(MAX_LEVEL);
        let text = self.unseen_text()?;
        Some(format!(
            "unseen: {text}; --max-depth {depth}, or more, divides these bricks alone, a greater --depth all"
        ))
    }

    /// What evaluated the bricks, where it was a device or might have been.
    fn backend_text(&self) -> Option<String> {
        let Some(report) = &self.summary.device else {
            return self.processor.as_ref().map(|why| format!("  backend  processor: {why}"));
        };
        if report.wrong.is_some() {
            return Some(format!("  backend  processor: {} computed a wrong brick", report.name));
        }
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
        let checked = match report.checked {
            0 => String::new(),
            n => format!(", {n} checked"),
        };
        Some(format!(
            "  backend  {name}: {bricks} bricks in {batches} batches{checked}{others}; {times}{close}"
        ))
    }
}

/// A length to six digits, without zeros at the end.
fn rounded_length(value: f64) -> String {
    let places = (5 - value.abs().max(1e-300).log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.places$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
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

fn facets_text(read: &FacetsSummary) -> String {
    let FacetsSummary { facets, degenerate_facets, skipped_faces, .. } = read;
    format!("{facets} ({degenerate_facets} without area, {skipped_faces} faces left out)")
}

fn points_text(read: &PointsSummary, unit: &str) -> String {
    let PointsSummary { points, void_points, spacing } = read;
    format!("{points} ({void_points} without area), {spacing:.6} {unit} apart")
}

/// Lines about a surface of facets.
fn surface_lines(read: &FacetsSummary) -> Vec<String> {
    let FacetsSummary { open_edges, loops, flipped_patches, pieces, turned_sweeps, .. } = read;
    let mut lines = Vec::new();
    if *open_edges > 0 {
        let edges = format!("{open_edges} open edges in {loops} loops");
        lines.push(format!("  surface  open: {edges}, {flipped_patches} flipped patches"));
    }
    if let Some(report) = pieces {
        let turned = report.turned_facets;
        lines.push(format!("  pieces   {}; {turned} facets turned", pieces_text(report)));
    }
    match turned_sweeps {
        0 => {}
        1 => lines.push("  sweeps   1 Extrusion was inside out, and is turned".to_owned()),
        n => lines.push(format!("  sweeps   {n} Extrusions were inside out, and are turned")),
    }
    lines
}

/// What the user should know of a field with this range, and of the pieces behind it.
fn warnings((min, max): (i16, i16), plan: &BuildRequest, summary: &BuildSummary) -> Vec<String> {
    let empty = match (min, max) {
        (min, max) if min < 0 && max <= 0 => Some("nothing lies inside: facets, or normals, face inwards"),
        (0, 0) => Some("nothing lies inside: no body is large enough for a sample"),
        _ => None,
    };
    let facets = summary.input.facets();
    let is_open = summary.input.has_points() || facets.is_some_and(|read| read.open_edges > 0);
    let negative = match facets.and_then(|read| read.inside_out.as_ref()) {
        Some(found) => {
            let input = plan.inputs[found.source].display().to_string();
            Some(inside_out_text(found, &input, plan.units.symbol()))
        }
        None if min < 0 && !is_open => Some(match plan.orient {
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
    let left = plan.orient.zip(facets.and_then(|read| read.pieces.as_ref()));
    let left = left.map_or(Vec::new(), |(asked, report)| left_text(report, asked));
    let field = Some(field.join("; ")).filter(|line| !line.is_empty());
    field.into_iter().chain(left).collect()
}
