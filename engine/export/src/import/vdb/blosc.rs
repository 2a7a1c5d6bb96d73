//! Frames of Blosc 1 with LZ4 inside, as OpenVDB writes them: blocks, of which each may be cut into as many streams as a value
//! has bytes, and may have its bytes sorted by their place in the value.

/// Bytes before the blocks.
const HEAD_BYTES: usize = 16;
/// OpenVDB fills shorter data up to so many bytes.
const LEAST_BYTES: usize = 128;
/// Shorter streams are not cut.
const LEAST_STREAM: usize = 128;
const LZ4: u8 = 1;
const DAMAGED: &str = "has a damaged frame of Blosc";

/// Unpacks a frame of so many bytes.
pub(super) fn unpack_blosc(frame: &[u8], bytes: usize, out: &mut Vec<u8>) -> Result<(), String> {
    let damaged = || DAMAGED.to_owned();
    let head = frame.get(..HEAD_BYTES).ok_or_else(damaged)?;
    let word =
        |at: usize| frame.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let (flags, size) = (head[2], usize::from(head[3]));
    let (total, block) = (word(4).ok_or_else(damaged)?, word(8).ok_or_else(damaged)?);
    if total != bytes && (bytes > LEAST_BYTES || total != LEAST_BYTES) || size == 0 {
        return Err(damaged());
    }
    out.clear();
    if flags & 2 != 0 {
        out.extend(frame.get(HEAD_BYTES..HEAD_BYTES + total).ok_or_else(damaged)?);
        out.truncate(bytes);
        return Ok(());
    }
    if flags & 4 != 0 {
        return Err("is packed by Blosc with sorted bits".to_owned());
    }
    if flags >> 5 != LZ4 {
        return Err(format!("is packed by Blosc with the codec of number {}, not LZ4", flags >> 5));
    }
    if block == 0 {
        return Err(damaged());
    }
    let (mut plain, is_sorted) = (Vec::new(), flags & 1 != 0 && size > 1);
    let is_cut = flags & 16 == 0 && size <= 16 && block / size >= LEAST_STREAM;
    for n in 0..total.div_ceil(block) {
        let length = block.min(total - n * block);
        let streams = if is_cut && length == block { size } else { 1 };
        let mut at = word(HEAD_BYTES + 4 * n).ok_or_else(damaged)?;
        plain.clear();
        plain.resize(length, 0);
        if length % streams != 0 {
            return Err(damaged());
        }
        for part in plain.chunks_exact_mut(length / streams) {
            let packed = word(at).ok_or_else(damaged)?;
            let stream = frame.get(at + 4..(at + 4).saturating_add(packed)).ok_or_else(damaged)?;
            at += 4 + packed;
            if packed == part.len() {
                part.copy_from_slice(stream);
            } else if lz4_flex::block::decompress_into(stream, part).ok() != Some(part.len()) {
                return Err(damaged());
            }
        }
        if is_sorted { unsort(&plain, size, out) } else { out.extend(&plain) }
    }
    out.truncate(bytes);
    Ok(())
}

/// Puts the bytes of values together: all first ones come first, then all second ones. What is left at the end stays.
fn unsort(sorted: &[u8], size: usize, out: &mut Vec<u8>) {
    let count = sorted.len() / size;
    out.extend((0..count * size).map(|n| sorted[n % size * count + n / size]));
    out.extend(&sorted[count * size..]);
}
