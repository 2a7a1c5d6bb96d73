//! How much memory there is, is needed and was used.

use crate::failure::Failure;
use crate::units::Size;
use brickfield_engine::build::BuildOptions;
use brickfield_engine::ingest::Input;
use brickfield_engine::store::Refine;
use std::fs;
use std::path::Path;

/// A build that follows the facets keeps them snapped, 36 bytes each, repeated where they touch several parts
/// of the tree, and sorted by lists. Measured on 3 million facets of beads: 46 bytes a facet at depth 4.
const BYTES_A_FACET_FOLLOWED: u64 = 60;
/// A build that decides brick by brick whether to divide holds the facets of two levels at once: 90 bytes a
/// facet in the same measurement.
const BYTES_A_FACET_DECIDED: u64 = 100;
/// Beads as solids: 32 bytes a segment, twice while they are sorted. Measured on 849,000 segments at depth 6: 60
/// bytes a segment beside the toolpath.
const BYTES_A_SEGMENT_FOLLOWED: u64 = 120;
/// The same where each brick decides, with the formulas of one brick's segments: up to 320 bytes each.
const BYTES_A_SEGMENT_DECIDED: u64 = 480;
/// What telling beads apart adds: the segments of two levels again.
const BYTES_A_SEGMENT_IDENTIFIED: u64 = 120;
/// What a thread needs beside: bricks in work and one part's facets again.
const BYTES_A_THREAD: u64 = 24 << 20;
/// Buffers, the program, its index.
const BYTES_FIXED: u64 = 64 << 20;

/// Refuses a build that would need more memory than `limit` or, without one, than there is.
pub fn require_room(inputs: &[Input], options: &BuildOptions, limit: Option<Size>) -> Result<(), Failure> {
    let need = estimate(inputs, options, rayon::current_num_threads());
    let (pieces, kind) = match options.solids {
        Some(_) => (segments(inputs), "segments"),
        None => (inputs.iter().map(Input::facets).sum(), "facets"),
    };
    let refuse = |room: Size, place: &str, remedy: &str| {
        Err(Failure::Run(anyhow::anyhow!(
            "{pieces} {kind} need about {need} of memory and {place} {room}; {remedy}"
        )))
    };
    match (limit, available()) {
        (Some(limit), _) if need > limit => {
            refuse(limit, "--memory allows", "allow more, or build parts of the input separately")
        }
        (None, Some(room)) if need > room => {
            refuse(room, "this machine has", "use a larger one, or set --memory to build regardless")
        }
        _ => Ok(()),
    }
}

fn estimate(inputs: &[Input], options: &BuildOptions, threads: usize) -> Size {
    let follows = options.refine == Refine::Hidden && options.stddev == 0.0;
    let parsed: u64 = inputs.iter().map(Input::heap_bytes).sum();
    let fixed = BYTES_FIXED + threads as u64 * BYTES_A_THREAD + parsed;
    if options.solids.is_some() {
        let bytes = if follows { BYTES_A_SEGMENT_FOLLOWED } else { BYTES_A_SEGMENT_DECIDED };
        let identity = if options.identity { BYTES_A_SEGMENT_IDENTIFIED } else { 0 };
        return Size(fixed + segments(inputs) * (bytes + identity));
    }
    let bytes_a_facet = if follows { BYTES_A_FACET_FOLLOWED } else { BYTES_A_FACET_DECIDED };
    let facets: u64 = inputs.iter().map(Input::facets).sum();
    Size(fixed + facets * bytes_a_facet)
}

fn segments(inputs: &[Input]) -> u64 {
    inputs.iter().filter_map(Input::beads).map(|beads| beads.report.segments).sum()
}

/// Memory of the machine, or of the control group that the program runs in if that is less.
fn available() -> Option<Size> {
    let machine = field(Path::new("/proc/meminfo"), "MemTotal:");
    machine.into_iter().chain(group_limits()).min()
}

/// Limits of all control groups around this process, of both versions.
fn group_limits() -> Vec<Size> {
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let mut limits = Vec::new();
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (parts.next(), parts.next()) else { continue };
        let (mount, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            _ if controllers.split(',').any(|name| name == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        for group in Path::new(group.trim_start_matches('/')).ancestors() {
            let text = fs::read_to_string(Path::new(mount).join(group).join(file)).unwrap_or_default();
            limits.extend(text.trim().parse().ok().map(Size));
        }
    }
    limits
}

/// The most memory that this process has held, maps of files included.
pub fn peak() -> Option<Size> {
    field(Path::new("/proc/self/status"), "VmHWM:")
}

/// A value in kB from a file of `name: value kB` lines; `None` where the system has no such file.
fn field(path: &Path, name: &str) -> Option<Size> {
    let text = fs::read_to_string(path).ok()?;
    let value = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(Size(value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024))
}
