//! The suite `paper`: inputs of the sizes in Table 3 of Peelar et al. 2019, whose brute force took the times in
//! [`TABLE_3`], and the same samples by this program.

use crate::line;
use crate::plan::{Bench, Job, figure};
use crate::suites::out;
use brickfield_bench_data::inputs::{self, Spec};
use brickfield_engine::Silent;
use brickfield_engine::gpu::{DeviceKind, devices};
use brickfield_engine::ingest::{Input, bounds_of_all};
use brickfield_terminal::failure::Failure;
use serde_json::Map;
use std::path::Path;

/// Samples an axis of the paper's table.
pub const SAMPLES: [u64; 4] = [32, 64, 96, 128];

/// A row of the paper's Table 3, and the input of ours that stands for it.
pub struct Row {
    pub name: &'static str,
    /// Megabytes of its STL file.
    pub megabytes: f64,
    /// Seconds on a GTX 1080 Ti, upload to download, for each of [`SAMPLES`].
    pub seconds: [f64; 4],
    /// Ours of about the size.
    pub input: &'static Spec,
    /// The same with cracks.
    cracked: &'static Spec,
}

/// The paper's Table 3.
pub static TABLE_3: [Row; 4] = [
    Row {
        name: "multiplane",
        megabytes: 45.0,
        seconds: [0.57, 4.12, 13.81, 34.39],
        input: &inputs::SPOT_0_9M,
        cracked: &inputs::CRACKED_SPOT_0_9M,
    },
    Row {
        name: "widget",
        megabytes: 210.0,
        seconds: [2.61, 20.31, 71.63, 176.8],
        input: &inputs::SPOT_4M,
        cracked: &inputs::CRACKED_SPOT_4M,
    },
    Row {
        name: "IRAP",
        megabytes: 176.0,
        seconds: [2.22, 17.45, 60.64, 153.0],
        input: &inputs::CLOVER_3M,
        cracked: &inputs::CRACKED_CLOVER_3M,
    },
    Row {
        name: "MANIFOLDTP",
        megabytes: 2_240.0,
        seconds: [29.82, 235.3, 854.4, 1976.0],
        input: &inputs::PILE_45M,
        cracked: &inputs::CRACKED_45M,
    },
];

/// Pairs of points and triangles that brute force adds up in a round: a second or two of two cores.
const PAIRS: u64 = 100_000_000;
/// The same on a GPU.
const PAIRS_ON_DEVICE: u64 = 10_000_000_000;
/// Operations of the sum for a pair of a point and a triangle (Van Oosterom & Strackee 1983, eq. 8): 9 for the corners
/// seen from the point, 18 for their lengths, 14 for the numerator, 23 for the denominator, 3 for the angle and the sum.
/// Roots and the arc tangent count as one, so that this is the least.
const OPERATIONS_A_PAIR: f64 = 67.0;
/// Largest error of samples of open input: what libigl's fast winding numbers have as the worst is 0.03.
const OPEN_ERROR: &str = "0.1";
/// Depth of the sparse trees: 1024 cells along the longest side.
const SPARSE_DEPTH: &str = "5";

/// The rows that are measured.
fn rows(quick: bool) -> &'static [Row] {
    if quick { &TABLE_3[..1] } else { &TABLE_3 }
}

impl Row {
    /// What is left of its input with cracks, if that is measured.
    fn open(&self, full: bool) -> Option<&'static Spec> {
        (full || self.megabytes < 1_000.0).then_some(self.cracked)
    }
}

/// The inputs.
pub fn inputs(quick: bool, full: bool) -> Vec<&'static Spec> {
    rows(quick).iter().flat_map(|row| std::iter::once(row.input).chain(row.open(full))).collect()
}

/// The jobs.
pub fn jobs(bench: &mut Bench<'_>) -> Result<Vec<Job>, Failure> {
    let device = device();
    let mut jobs = Vec::new();
    for row in rows(bench.quick) {
        let path = bench.input(row.input)?;
        let triangles = bench.triangles(row.input) as f64;
        for samples in SAMPLES {
            let (level, size) = resolution(&path, samples)?;
            let build = bench.build(&path, &out("dense.brf"), &[size.0, &size.1]);
            jobs.push(dense(bench, row.input, "dense", samples, triangles, level, build).reading(&[&path]));
        }
        let at = [("triangles", triangles), ("samples", 1024.0)];
        let build = bench.build(&path, &out("sparse.brf"), &["--depth", SPARSE_DEPTH]);
        jobs.push(Job::new("paper", row.input, "sparse 1024³", &at, vec![build]).reading(&[&path]));
        jobs.push(brute(bench, row.input, "brute force", PAIRS, &[])?);
        if let Some(device) = &device {
            let more = ["--backend", "vulkan", "--device", device];
            jobs.push(brute(bench, row.input, "brute force on the GPU", PAIRS_ON_DEVICE, &more)?);
        }
        if let Some(cracked) = row.open(bench.full) {
            let path = bench.input(cracked)?;
            let triangles = bench.triangles(cracked) as f64;
            let words = ["--depth", "2", "--gwn-error", OPEN_ERROR];
            let build = bench.build(&path, &out("open.brf"), &words);
            jobs.push(dense(bench, cracked, "open, dense", 128, triangles, 2, build).reading(&[&path]));
        }
    }
    Ok(jobs)
}

/// The level, and the option of `build`, by which a level has so many samples along the input's longest side. 96 are no
/// level, so the root has 128 there, of which the input spans as many as it does of 96 in a root of its own.
fn resolution(path: &Path, samples: u64) -> Result<(u8, (&'static str, String)), Failure> {
    let level = samples.next_power_of_two().ilog2() as u8 - 5;
    if samples.is_power_of_two() {
        return Ok((level, ("--depth", level.to_string())));
    }
    let (min, max) = bounds(path)?;
    let longest = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f64::max);
    // A root leaves 1/64 of its edge free on both sides.
    let cell = longest * 32.0 / 31.0 / samples as f64;
    Ok((level, ("--cell", cell.to_string())))
}

/// Lower and upper corner of a mesh.
pub fn bounds(path: &Path) -> Result<([f64; 3], [f64; 3]), Failure> {
    Ok(bounds_of_all(&[Input::open(path, &Silent)?], &Silent)?)
}

/// From the file of triangles to the file of samples.
fn dense(
    bench: &Bench<'_>,
    input: &'static Spec,
    name: &str,
    samples: u64,
    triangles: f64,
    level: u8,
    build: Vec<std::ffi::OsString>,
) -> Job {
    let open = name.starts_with("open");
    let store = out(if open { "open.brf" } else { "dense.brf" });
    let mut export = line!["export", store, "--level", level.to_string(), "-o", out("w.npy"), "--quiet"];
    export.extend(line!["--dtype", if open { "f4" } else { "i2" }]);
    export.extend(bench.threads());
    let at = [("triangles", triangles), ("samples", samples as f64)];
    Job::new("paper", input, &format!("{name} {samples}³"), &at, vec![build, export])
}

/// The sum over all triangles at a few points, from which the times for all samples follow: what does not depend on the
/// number of points is known from another run with one point.
fn brute(
    bench: &Bench<'_>,
    input: &'static Spec,
    name: &str,
    pairs: u64,
    more: &[&str],
) -> Result<Job, Failure> {
    let triangles = bench.triangles(input);
    let points = (pairs / triangles).max(2) + 1;
    let path = bench.cache.path(input);
    let line = |count: u64| -> Result<_, Failure> {
        let mut line = line!["winding", &path, "--points", bench.points(count)?, "--brute", "--quiet"];
        line.extend(bench.threads());
        line.extend(more.iter().map(std::ffi::OsString::from));
        Ok(vec![line])
    };
    let of = |samples: u64| {
        let at = [
            ("triangles", triangles as f64),
            ("samples", samples as f64),
            ("points measured", points as f64),
        ];
        let mut figure = figure("paper", input, &format!("{name} {samples}³"), &at);
        figure.extrapolated = true;
        figure.least_operations =
            more.is_empty().then(|| OPERATIONS_A_PAIR * (triangles * samples.pow(3)) as f64);
        (figure, (samples.pow(3) - 1) as f64 / (points - 1) as f64)
    };
    let figures = SAMPLES.into_iter().map(of).collect();
    Ok(Job { input, lines: line(points)?, fewer: Some(line(1)?), reads: None, known: Map::new(), figures })
}

/// The number of a device that is no processor.
fn device() -> Option<String> {
    let usable = |kind: &DeviceKind| {
        matches!(kind, DeviceKind::Discrete | DeviceKind::Integrated | DeviceKind::Virtual)
    };
    let found = devices().ok()?;
    let device = found.iter().find(|device| usable(&device.kind) && device.missing.is_empty())?;
    Some(device.index.to_string())
}
