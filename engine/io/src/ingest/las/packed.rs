//! The packed points of LAZ: chunks that threads unpack by themselves.

use super::header::{LasHeader, REMEDY, array};
use super::point::{Decoded, PointLayout};
use crate::error::Result;
use crate::ingest::guarded::guarded;
use crate::large_array::ArrayRoom;
use crate::progress::Progress;
use laz::laszip::ChunkTable;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{LazItemType, LazVlr};
use rayon::prelude::*;
use std::io::Cursor;

/// Points that one packed byte can stand for, at most: those of grids whose lines are all alike are packed most.
const POINTS_A_BYTE: u64 = 1024;
/// How the description of a packing begins that has no chunks: all points are one, and there is no table.
const ONE_CHUNK: [u8; 2] = [1, 0];
/// Chunks of this many threads' work wait to be put in order.
const CHUNKS_A_THREAD: usize = 4;

/// Some points packed together.
struct Chunk<'a> {
    bytes: &'a [u8],
    points: u64,
}

/// Unpacks the points.
///
/// # Errors
/// If a chunk is not there, or does not unpack; if the user interrupts.
pub(super) fn unpacked(
    header: &LasHeader<'_>,
    bytes: &[u8],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<Decoded> {
    let damaged = || header.error("does not say how its points are packed");
    let packing = header.packing.ok_or_else(damaged)?;
    let packing = guarded(|| LazVlr::from_buffer(packing).ok()).flatten().ok_or_else(damaged)?;
    let stride = stride(&packing);
    if stride != header.stride {
        let what = format!("has points of {} bytes, packed as {stride} bytes", header.stride);
        return Err(header.error(what));
    }
    let chunks = chunks(header, &packing, bytes).map_err(|what| header.error(what))?;
    let (layout, mut all) = (PointLayout::of(header), Decoded::new(room));
    for (at, some) in chunks.chunks(CHUNKS_A_THREAD * rayon::current_num_threads()).enumerate() {
        progress.check()?;
        let first = at * CHUNKS_A_THREAD * rayon::current_num_threads();
        let decoded: Vec<Option<Decoded>> =
            some.par_iter().map(|chunk| unpack(chunk, &packing, &layout)).collect();
        for (number, decoded) in decoded.into_iter().enumerate() {
            let Some(Decoded { cloud, withheld }) = decoded else {
                let what = "is damaged or cut off, so its points cannot be unpacked";
                let place = format!("chunk {} of {}", first + number + 1, chunks.len());
                return Err(crate::error::Error::input(header.path, place, what, REMEDY));
            };
            all.cloud.append(&cloud)?;
            all.withheld += withheld;
        }
    }
    Ok(all)
}

/// Bytes of a point.
fn stride(packing: &LazVlr) -> usize {
    packing.items().iter().map(|item| usize::from(item.size())).sum()
}

/// Where the chunks are, and how many points each has; all that is counted is there, in bytes that may hold it.
fn chunks<'a>(
    header: &LasHeader<'_>,
    packing: &LazVlr,
    bytes: &'a [u8],
) -> std::result::Result<Vec<Chunk<'a>>, String> {
    let points = header.points;
    if header.packing.is_some_and(|packing| packing.starts_with(&ONE_CHUNK)) {
        let bytes = bytes.get(header.points_at..).unwrap_or_default();
        return checked(vec![Chunk { bytes, points }], points);
    }
    let table =
        table(header, packing, bytes).ok_or("has no table of its chunks: it was not written to its end")?;
    let mut at = header.points_at + ChunkTable::OFFSET_SIZE;
    let mut left = points;
    let mut chunks = Vec::new();
    for (size, most) in table {
        let of_chunk = most.min(left);
        let packed = usize::try_from(size).ok().and_then(|size| bytes.get(at..at.checked_add(size)?));
        let Some(packed) = packed else { return Err(format!("ends within chunk {}", chunks.len() + 1)) };
        at += packed.len();
        left -= of_chunk;
        if of_chunk > 0 {
            chunks.push(Chunk { bytes: packed, points: of_chunk });
        }
    }
    if left > 0 {
        return Err(format!("counts {points} points, but its chunks hold {}", points - left));
    }
    checked(chunks, points)
}

/// Refuses more points than bytes may stand for.
fn checked(chunks: Vec<Chunk<'_>>, points: u64) -> std::result::Result<Vec<Chunk<'_>>, String> {
    match chunks.iter().all(|chunk| chunk.points <= chunk.bytes.len() as u64 * POINTS_A_BYTE) {
        true => Ok(chunks),
        false => Err(format!("counts {points} points, more than its bytes can hold")),
    }
}

/// Bytes and points of each chunk, as the file's table has them.
fn table(header: &LasHeader<'_>, packing: &LazVlr, bytes: &[u8]) -> Option<Vec<(u64, u64)>> {
    let place = |at: usize| array(bytes, at).and_then(|b| usize::try_from(i64::from_le_bytes(b)).ok());
    let is_behind = |at: &usize| *at > header.points_at;
    // A writer that could not go back has put it at the end.
    let at = place(header.points_at)
        .filter(is_behind)
        .or_else(|| place(bytes.len().checked_sub(8)?).filter(is_behind))?;
    let count = array(bytes, at.checked_add(4)?).map(u32::from_le_bytes)? as usize;
    // Each begins with a point that is not packed.
    if count > bytes.len() / header.stride {
        return None;
    }
    let is_variable = packing.uses_variable_size_chunks();
    let read = || ChunkTable::read(&mut Cursor::new(&bytes[at..]), is_variable).ok();
    let table = guarded(read).flatten()?;
    let points = |counted: u64| if is_variable { counted } else { u64::from(packing.chunk_size()) };
    Some(table.as_ref().iter().map(|entry| (entry.byte_count, points(entry.point_count))).collect())
}

/// The points of a chunk; nothing if it is damaged.
fn unpack(chunk: &Chunk<'_>, packing: &LazVlr, layout: &PointLayout<'_>) -> Option<Decoded> {
    let is_layered = packing.items().first().is_some_and(|item| item.version() > 2);
    if is_layered && !has_layers(chunk.bytes, packing) {
        return None;
    }
    guarded(|| {
        let source = Cursor::new(chunk.bytes);
        match is_layered {
            true => decode(LayeredPointRecordDecompressor::new(source), chunk.points, packing, layout),
            false => decode(SequentialPointRecordDecompressor::new(source), chunk.points, packing, layout),
        }
    })
    .flatten()
}

fn decode<'a>(
    mut decoder: impl RecordDecompressor<Cursor<&'a [u8]>>,
    points: u64,
    packing: &LazVlr,
    layout: &PointLayout<'_>,
) -> Option<Decoded> {
    decoder.set_fields_from(packing.items()).ok()?;
    let (mut point, mut decoded) = (vec![0; decoder.record_size()], Decoded::default());
    if point.len() != stride(packing) {
        return None;
    }
    for _ in 0..points {
        decoder.decompress_next(&mut point).ok()?;
        layout.take(&point, &mut decoded).ok()?;
    }
    Some(decoded)
}

/// Whether the layers of a chunk are as long as it says: behind its first point and the count of all stand their lengths.
fn has_layers(bytes: &[u8], packing: &LazVlr) -> bool {
    let layers = |kind: LazItemType| match kind {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => usize::from(count),
        _ => 1,
    };
    let items = packing.items();
    let first = stride(packing) + 4;
    let count: usize = items.iter().map(|item| layers(item.item_type())).sum();
    let length = |n: usize| array(bytes, first + 4 * n).map(|b| u64::from(u32::from_le_bytes(b)));
    let total: Option<u64> = (0..count).map(length).sum();
    total.is_some_and(|total| total <= bytes.len() as u64)
}
