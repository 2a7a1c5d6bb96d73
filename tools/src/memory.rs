//! How much memory work needs and may take.

use crate::failure::Failure;
use crate::units::Size;
use brickfield_engine::backend::Vulkan;
use brickfield_engine::build::{BYTES_A_POINT, BuildOptions};
use brickfield_engine::ingest::{CloudInput, Input};
use brickfield_engine::render::NODE_BYTES;
use brickfield_engine::store::{Refine, Store};
use brickfield_engine::winding::FAR_FIELD_BYTES;
pub use brickfield_terminal::memory::{available, peak};

/// A build that decides brick by brick whether to divide holds the facets of two levels at once: 90 bytes a facet,
/// measured on 3 million facets of beads at depth 4.
const BYTES_A_FACET_DECIDED: u64 = 100;
/// Beads as solids: 32 bytes a segment, twice while they are sorted. Measured on 849,000 segments at depth 6: 60
/// bytes a segment beside the toolpath.
const BYTES_A_SEGMENT_FOLLOWED: u64 = 120;
/// The same where each brick decides, with the formulas of one brick's segments: up to 320 bytes each.
const BYTES_A_SEGMENT_DECIDED: u64 = 480;
/// What telling beads apart adds: the segments of two levels again.
const BYTES_A_SEGMENT_IDENTIFIED: u64 = 120;
/// A point of a cloud whose arrays lie in temporary files: its number in two levels, and in lists of them.
const BYTES_A_POINT_KEPT: u64 = 24;
/// Buckets of points in work while normals are found, with their edges.
const BYTES_OF_EDGES: u64 = 64 << 20;
/// Share of the memory that what is left in memory of such arrays takes at most.
const ARRAYS_SHARE: u64 = 4;
/// What a thread needs beside pieces and records: a brick in work, its crossings, tables.
const BYTES_A_THREAD: u64 = 8 << 20;
/// Buffers, the program, what the allocator cannot return.
const BYTES_BESIDE: u64 = 48 << 20;
/// Least for pieces and records.
const BYTES_TO_WORK_WITH: u64 = 16 << 20;

/// The memory that a build may take: `limit`, or half of what there is.
pub fn budget(limit: Option<Size>) -> Option<Size> {
    limit.or_else(|| available().map(|size| Size(size.0 / 2)))
}

/// A thread's share of contouring, beside its caches: the triangles of sixteen leaves as bytes. Measured on a mesh of 108 million triangles
/// with two threads: 75 to 125 MiB with [`BYTES_BESIDE`].
const BYTES_MESH_A_THREAD: u64 = 40 << 20;
/// A thread's share of drawing: its part of a band of tiles, the bricks it looks at. Measured with two threads: 40 MiB
/// with [`BYTES_BESIDE`].
const BYTES_PICTURE_A_THREAD: u64 = 8 << 20;
/// Least for caches; less would make the same bricks over and over.
const BYTES_CACHES: u64 = 32 << 20;

/// What of the memory for contouring is left for caches, beside the index of the store.
pub fn mesh_caches(memory: Size, store: &Store) -> u64 {
    let held = store.index_bytes() + store.source_bytes();
    caches(Size(memory.0.saturating_sub(held)), BYTES_MESH_A_THREAD)
}

/// What there is when contouring is done: its caches and what threads worked with.
pub fn after_contouring(caches: u64) -> u64 {
    caches + rayon::current_num_threads() as u64 * BYTES_MESH_A_THREAD
}

/// What of the memory for a picture in space is left for bricks. What is taken of the device may be this machine's, as in
/// builds.
pub fn render_caches(
    memory: Size,
    device: Option<&Vulkan>,
    store: &Store,
    size: [u32; 2],
    is_animated: bool,
) -> u64 {
    let of_device = device.map_or(0, |device| device.gpu().memory().min(memory.0 / 2));
    let held = of_device + index_drawn(store, NODE_BYTES) + pixels_drawn(size, is_animated);
    picture_caches(memory, held)
}

/// What of the memory for a picture is left for bricks, of which `held` is taken by the index of the store, by pixels and by
/// the device.
/// The allocator does not find room again for all that is dropped: with 446 MiB of bricks allowed a picture of overlaps held
/// 544 MiB in all, with 404 MiB 496.
pub fn picture_caches(memory: Size, held: u64) -> u64 {
    caches(Size(memory.0.saturating_sub(held)), BYTES_PICTURE_A_THREAD) / 12 * 11
}

/// What the index of a store takes while its nodes are drawn, each of which takes `bytes_a_node` beside its entry.
pub fn index_drawn(store: &Store, bytes_a_node: u64) -> u64 {
    store.index_bytes() + store.source_bytes() + store.entries().len() as u64 * bytes_a_node
}

/// What a picture in space takes for pixels: three bands of 32 rows, of colours and depths, and one that is being made,
/// measured as 2074 bytes for each pixel of the width; and all of a picture that is one of an animation.
fn pixels_drawn([width, height]: [u32; 2], is_animated: bool) -> u64 {
    let [width, height] = [u64::from(width), u64::from(height)];
    2100 * width + if is_animated { 4 * width * height } else { 0 }
}

fn caches(memory: Size, bytes_a_thread: u64) -> u64 {
    let beside = BYTES_BESIDE + rayon::current_num_threads() as u64 * bytes_a_thread;
    memory.0.saturating_sub(beside).max(BYTES_CACHES)
}

/// What is left of `budget` for pieces and records; fails if that is too little.
pub fn require_room(inputs: &[Input], options: &BuildOptions, budget: Option<Size>) -> Result<u64, Failure> {
    let parsed: u64 = inputs.iter().map(Input::heap_bytes).sum();
    let (need, of_what) = pieces(inputs, options);
    left_of(budget, parsed, need, &of_what, "build parts of the input separately")
}

/// As [`require_room`], of point clouds and of the meshes beside them.
pub fn require_room_for_points(
    clouds: &[CloudInput],
    inputs: &[Input],
    budget: Option<Size>,
) -> Result<u64, Failure> {
    let points: u64 = clouds.iter().map(|input| input.cloud.points.len() as u64).sum();
    let facets: u64 = inputs.iter().map(Input::facets).sum();
    let parsed = inputs.iter().map(Input::heap_bytes).sum();
    let left = budget.map_or(u64::MAX / 2, |size| size.0 / ARRAYS_SHARE);
    let in_files = points * BYTES_A_POINT_KEPT + BYTES_OF_EDGES + left;
    let of_points = in_files.min(points * BYTES_A_POINT);
    let need = of_points + facets * BYTES_A_FACET_DECIDED + FAR_FIELD_BYTES + BYTES_TO_WORK_WITH;
    match facets {
        0 => left_of(budget, parsed, need, &format!("{points} points"), "give fewer points"),
        _ => left_of(
            budget,
            parsed,
            need,
            &format!("{points} points and {facets} facets"),
            "build meshes and clouds apart",
        ),
    }
}

/// What is left of `budget` beside the program, its threads and `parsed` bytes; fails if `of_what` needs more.
fn left_of(
    budget: Option<Size>,
    parsed: u64,
    need: u64,
    of_what: &str,
    remedy: &str,
) -> Result<u64, Failure> {
    let Some(budget) = budget else { return Ok(u64::MAX) };
    let beside = BYTES_BESIDE + rayon::current_num_threads() as u64 * BYTES_A_THREAD + parsed;
    if beside + need <= budget.0 {
        return Ok(budget.0 - beside);
    }
    let parsed =
        if parsed > 0 { format!(", {} of them for what was parsed", Size(parsed)) } else { String::new() };
    Err(Failure::Run(anyhow::anyhow!(
        "{of_what} need at least {}{parsed}, and {budget} are allowed; allow more with --memory, or {remedy}",
        Size(beside + need)
    )))
}

/// What of the memory for pieces and records the index of nodes may take: the jobs of two threads need the rest.
pub fn index_share(memory: u64) -> u64 {
    memory / 5 * 4
}

/// What pieces need that have to be in memory, and what they are.
fn pieces(inputs: &[Input], options: &BuildOptions) -> (u64, String) {
    let follows = options.refine == Refine::Hidden && options.stddev == 0.0 && options.tolerance == 0.0;
    if options.solids.is_some() {
        let bytes = if follows { BYTES_A_SEGMENT_FOLLOWED } else { BYTES_A_SEGMENT_DECIDED };
        let identity = if options.identity { BYTES_A_SEGMENT_IDENTIFIED } else { 0 };
        let segments = segments(inputs);
        return (segments * (bytes + identity) + BYTES_TO_WORK_WITH, format!("{segments} segments"));
    }
    let facets: u64 = inputs.iter().map(Input::facets).sum();
    let bytes = if follows { 0 } else { facets * BYTES_A_FACET_DECIDED };
    (bytes + BYTES_TO_WORK_WITH, format!("{facets} facets"))
}

fn segments(inputs: &[Input]) -> u64 {
    inputs.iter().filter_map(Input::beads).map(|beads| beads.report.segments).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bricks_of_a_picture_take_what_index_and_pixels_leave() {
        let beside = BYTES_BESIDE + rayon::current_num_threads() as u64 * BYTES_PICTURE_A_THREAD;
        let memory = Size(beside + (400 << 20));
        for held in [0, 1 << 20, 100 << 20, 368 << 20] {
            let (caches, left) = (picture_caches(memory, held), memory.0 - beside - held);
            assert!(caches <= left && caches >= left / 12 * 10, "{caches} of {left}");
        }
        // Less would make the same bricks over and over.
        for held in [369 << 20, 400 << 20, u64::MAX] {
            assert_eq!(picture_caches(memory, held), BYTES_CACHES / 12 * 11);
        }
        assert!(pixels_drawn([4096, 4096], true) >= pixels_drawn([4096, 4096], false) + (64 << 20));
    }
}
