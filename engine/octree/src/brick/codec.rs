//! The stored form of a brick: what a record of the store holds, without knowing of files.
//!
//! A brick of counts is mostly runs: its samples change by one where a row crosses a facet and are constant elsewhere.
//! So a row is stored as its first sample, a mask of the places where it changes, and the changes.
//!
//! Hermite edges follow as byte planes; how many there are is derived from the samples. LZ4 goes on top of each of the
//! two parts where it helps. `range` codes either part in fewer bytes. The byte diagrams are in `FORMAT.md`.
//!
//! Chosen by measurement: twelve bricks of balls, planes and crossing beads with 2,195 Hermite edges on average, one core,
//! mean bytes and time a brick. A test compares the bytes.
//!
//! | stored                             | bytes | encode  | decode  |
//! |------------------------------------|-------|---------|---------|
//! | i8 samples, LZ4                    | 3,214 | 11.0 µs | 17.9 µs |
//! | i8 differences along x, LZ4        | 2,524 |  9.2 µs | 26.0 µs |
//! | rows as masks and changes, LZ4     | 1,078 | 19.8 µs | 13.0 µs |
//! | with Hermite edges, words of normals | 5,586 | 41.4 µs | 24.0 µs |
//!
//! The first two lines leave out the range check and the sign classification that the others include. Normals as whole
//! words take 1,962 bytes of LZ4, as four byte planes 2,949.
//!
//! The range coder makes 264 bytes of the samples and 1,386 with Hermite edges, in 20 times LZ4's time to write and 10
//! times to read, taken on a busy machine.

use super::hermite_part::{self, EDGE_BYTES, Palette};
use super::range::{self, Layers};
use super::{Brick, Hermite, Samples, SamplesInOrder, SignChanges, fractions, inside_from};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use crate::wide::{Simd, SimdBase, SimdMask, dispatch, i16x16, level};
use lz4_flex::block::{CompressTable, compress_into_with_table, decompress_into, get_maximum_output_size};
use std::fmt;

/// Rows of samples along x in a brick.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;
/// Most changes within the rows of a brick.
const STEPS_MAX: usize = ROWS * BRICK_CELLS;
/// Byte planes of the change masks: 32 places in a row.
const MASK_PLANES: usize = 4;
/// Length prefix of the samples part where a Hermite part follows it.
const PART_LENGTH_BYTES: usize = 4;
/// Largest samples part before LZ4: two planes each of first samples and changes, and the masks.
const SAMPLES_PART_MAX: usize = ROWS * (2 + MASK_PLANES) + 2 * STEPS_MAX;

/// How a payload is laid out: the type in the low half byte, flags in the high one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PayloadKind(u8);

impl PayloadKind {
    /// No payload: every sample has the value that stands in the index.
    pub const UNIFORM: PayloadKind = PayloadKind(0);
    /// Type of counts whose differences fit 8 bits.
    pub const NARROW: u8 = 1;
    /// Type of counts whose differences need 16 bits.
    pub const WIDE: u8 = 2;
    /// Type of samples with binary places.
    pub const FRACTIONS: u8 = 3;
    /// Type of counts, and of their Hermite edges, as the range coder has them.
    pub const RANGE_COUNTS: u8 = 4;
    /// Type of samples with binary places, and of their Hermite edges, as the range coder has them.
    pub const RANGE_FRACTIONS: u8 = 5;
    /// Flag: Hermite edges follow the samples.
    pub const HERMITE: u8 = 0x10;
    /// Flag: the samples part is an LZ4 block.
    pub const LZ4_SAMPLES: u8 = 0x20;
    /// Flag: the Hermite part is an LZ4 block.
    pub const LZ4_HERMITE: u8 = 0x40;
    /// Flag: the normals of Hermite edges are indices into a palette.
    pub const PALETTE: u8 = 0x80;

    /// Reads the byte stored in an index; `None` if this version has no such kind.
    pub const fn from_bits(bits: u8) -> Option<PayloadKind> {
        let flags = match bits & 0x0f {
            0 => 0,
            Self::NARROW | Self::WIDE | Self::FRACTIONS if bits & Self::HERMITE == 0 => Self::LZ4_SAMPLES,
            Self::NARROW | Self::WIDE | Self::FRACTIONS => {
                Self::HERMITE | Self::LZ4_SAMPLES | Self::LZ4_HERMITE | Self::PALETTE
            }
            Self::RANGE_COUNTS | Self::RANGE_FRACTIONS => Self::HERMITE,
            _ => return None,
        };
        if bits & 0xf0 & !flags == 0 { Some(PayloadKind(bits)) } else { None }
    }

    /// The byte stored in an index.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// True if all samples are equal and there is no payload.
    pub const fn is_uniform(self) -> bool {
        self.0 == 0
    }

    /// True if the payload holds Hermite edges.
    pub const fn has_hermite(self) -> bool {
        self.0 & Self::HERMITE != 0
    }

    /// True if differences of samples take 16 bits.
    pub const fn is_wide(self) -> bool {
        self.0 & 0x0f == Self::WIDE
    }

    /// True if samples have binary places.
    pub const fn has_fractions(self) -> bool {
        matches!(self.0 & 0x0f, Self::FRACTIONS | Self::RANGE_FRACTIONS)
    }

    /// True if the payload is the range coder's.
    pub const fn is_range_coded(self) -> bool {
        matches!(self.0 & 0x0f, Self::RANGE_COUNTS | Self::RANGE_FRACTIONS)
    }

    const fn has(self, flag: u8) -> bool {
        self.0 & flag != 0
    }
}

impl std::fmt::Display for PayloadKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.is_uniform() {
            return f.write_str("uniform");
        }
        f.write_str(match self.0 & 0x0f {
            Self::FRACTIONS | Self::RANGE_FRACTIONS => "fractions",
            Self::RANGE_COUNTS => "counts",
            Self::WIDE => "counts16",
            _ => "counts8",
        })?;
        f.write_str(if self.has_hermite() { "+hermite" } else { "" })?;
        f.write_str(if self.has(Self::PALETTE) { "+palette" } else { "" })?;
        f.write_str(match self.has(Self::LZ4_SAMPLES | Self::LZ4_HERMITE) {
            true => "+lz4",
            false if self.is_range_coded() => "+range",
            false => "",
        })
    }
}

/// What the index says of a brick beside its payload's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PayloadHead {
    /// Layout of the payload.
    pub kind: PayloadKind,
    /// Smallest sample, apron included.
    pub min: i16,
    /// Largest sample, apron included; equal to `min` on uniform bricks.
    pub max: i16,
}

/// An encoded brick.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Payload {
    /// Kind and range.
    pub head: PayloadHead,
    /// Stored bytes; none for a uniform brick.
    pub bytes: Vec<u8>,
}

/// Why a payload is not one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Payload bytes on a uniform brick.
    #[error("a uniform brick has payload bytes")]
    UniformBytes,
    /// The payload ends before its first part does.
    #[error("the payload is shorter than its samples")]
    Short,
    /// LZ4 refuses a part.
    #[error("the compressed bytes are damaged")]
    Lz4,
    /// The range coder refuses a part.
    #[error("the range-coded bytes are damaged")]
    Range,
    /// A part has another size than its type and its samples ask for.
    #[error("the samples have the wrong size")]
    SamplesSize,
    /// The number of Hermite edges is not that of the samples' sign changes.
    #[error("the Hermite edges do not match the samples")]
    HermiteSize,
}

/// How the parts of a payload are compressed. Bricks are the same in either; readers follow the flags of each part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// LZ4 where a part becomes shorter by it: what a build writes.
    #[default]
    Lz4,
    /// None: twice to ten times the bytes, for file systems that compress by themselves.
    None,
    /// A range coder: a quarter to a half of the bytes of LZ4, many times the work to write and to read.
    Range,
}

impl fmt::Display for Compression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Compression::Lz4 => "lz4",
            Compression::None => "none",
            Compression::Range => "range",
        })
    }
}

/// Reusable buffers of [`encode_into`] and [`decode`]: some 100 KB for surface bricks, at most 0.8 MB.
pub struct Scratch {
    masks: Box<[u32; ROWS]>,
    firsts: Box<[i16; ROWS]>,
    steps: Vec<i16>,
    signs: SignChanges,
    plain: Vec<u8>,
    palette: Palette,
    layers: Option<Layers>,
    /// The next brick's memory.
    spare: Option<Samples>,
    small_table: CompressTable,
    large_table: CompressTable,
}

impl Default for Scratch {
    fn default() -> Scratch {
        Scratch::new()
    }
}

impl Scratch {
    /// Empty buffers.
    pub fn new() -> Scratch {
        Scratch {
            masks: vec![0; ROWS].into_boxed_slice().try_into().expect("the length is ROWS"),
            firsts: vec![0; ROWS].into_boxed_slice().try_into().expect("the length is ROWS"),
            steps: Vec::new(),
            signs: SignChanges::outside(),
            plain: Vec::new(),
            palette: Palette::default(),
            layers: None,
            spare: None,
            small_table: CompressTable::small(),
            large_table: CompressTable::large(),
        }
    }

    /// Takes the samples' memory of a brick that nobody needs any more for the next one that [`decode`] makes.
    pub fn reuse(&mut self, brick: Brick) {
        if let Brick::Counts { samples, .. } = brick {
            self.spare = Some(samples);
        }
    }
}

/// Encodes `brick` with buffers of its own. Use [`encode_into`] for many bricks.
///
/// # Panics
/// As [`encode_into`].
pub fn encode(brick: &Brick) -> Payload {
    let mut bytes = Vec::new();
    let head = encode_into(brick, &mut Scratch::new(), &mut bytes);
    bytes.shrink_to_fit();
    Payload { head, bytes }
}

/// Appends the payload of `brick` to `out`. The bytes depend on the brick alone. Counts that are all equal
/// and carry no Hermite edges become a uniform brick.
///
/// # Panics
/// If the brick has Hermite edges, but not one for each lattice edge whose ends differ in sign: no reader
/// could take such a record apart.
pub fn encode_into(brick: &Brick, scratch: &mut Scratch, out: &mut Vec<u8>) -> PayloadHead {
    encode_with(brick, Compression::Lz4, scratch, out)
}

/// As [`encode_into`], with the compression asked for.
///
/// # Panics
/// As [`encode_into`].
pub fn encode_with(
    brick: &Brick,
    compression: Compression,
    scratch: &mut Scratch,
    out: &mut Vec<u8>,
) -> PayloadHead {
    let (min, max) = brick.range();
    let (samples, hermite) = match brick {
        Brick::Counts { samples, hermite } if min != max || samples.1 > 0 || !hermite.is_empty() => {
            (samples, hermite)
        }
        _ => return PayloadHead { kind: PayloadKind::UNIFORM, min, max },
    };
    scratch.signs = SignChanges::of(samples);
    if !hermite.is_empty() {
        let counts = Axis::ALL.map(|axis| hermite.edges[axis.index()].len());
        assert_eq!(counts, scratch.signs.counts(), "one Hermite edge per sign-changing lattice edge");
    }
    let start = out.len();
    if !hermite.is_empty() {
        out.extend_from_slice(&[0; PART_LENGTH_BYTES]);
    }
    let part = out.len();
    let mut bits = encode_samples(samples, compression, scratch, out);
    if !hermite.is_empty() {
        let length = (out.len() - part) as u32;
        out[start..part].copy_from_slice(&length.to_le_bytes());
        bits |= PayloadKind::HERMITE | encode_hermite(hermite, compression, scratch, out);
    }
    PayloadHead { kind: PayloadKind(bits), min, max }
}

/// Appends the samples part; gives its type and flags.
fn encode_samples(
    samples: &Samples,
    compression: Compression,
    scratch: &mut Scratch,
    out: &mut Vec<u8>,
) -> u8 {
    let has_fractions = samples.1 > 0;
    if compression == Compression::Range {
        range::encode_samples(samples, out);
        return if has_fractions { PayloadKind::RANGE_FRACTIONS } else { PayloadKind::RANGE_COUNTS };
    }
    let bits = if has_fractions {
        fractions::to_plain(samples, &mut scratch.plain);
        PayloadKind::FRACTIONS
    } else {
        let narrow = split_rows(samples, scratch);
        samples_plain(narrow, scratch);
        if narrow { PayloadKind::NARROW } else { PayloadKind::WIDE }
    };
    if compress_plain(compression, scratch, out) { bits | PayloadKind::LZ4_SAMPLES } else { bits }
}

/// Appends the Hermite part of edges that fit the signs; gives its flags.
fn encode_hermite(
    hermite: &Hermite,
    compression: Compression,
    scratch: &mut Scratch,
    out: &mut Vec<u8>,
) -> u8 {
    if compression == Compression::Range {
        let Scratch { signs, layers, .. } = scratch;
        range::encode_hermite(signs, hermite, layers.get_or_insert_default(), out);
        return 0;
    }
    let indexed = hermite_part::to_plain(hermite, &mut scratch.palette, &mut scratch.plain);
    let palette = if indexed { PayloadKind::PALETTE } else { 0 };
    if compress_plain(compression, scratch, out) { palette | PayloadKind::LZ4_HERMITE } else { palette }
}

/// Takes a payload apart. `uniform` is the value of a brick without payload. Any bytes give a brick or an
/// error; memory is bounded by the largest possible brick, and by the samples once they are known.
///
/// # Errors
/// [`DecodeError`] if the bytes are not a payload of that kind.
pub fn decode(
    kind: PayloadKind,
    uniform: i16,
    bytes: &[u8],
    scratch: &mut Scratch,
) -> Result<Brick, DecodeError> {
    if kind.is_uniform() {
        return if bytes.is_empty() { Ok(Brick::Uniform(uniform)) } else { Err(DecodeError::UniformBytes) };
    }
    let [samples_part, hermite_bytes] = parts(kind, bytes)?;
    if kind.is_range_coded() {
        return decode_range(kind, samples_part, hermite_bytes, scratch);
    }
    let Scratch { plain, signs, spare, .. } = scratch;
    let lz4 = kind.has(PayloadKind::LZ4_SAMPLES);
    let plain_samples = unpack(samples_part, lz4, SAMPLES_PART_MAX, plain)?;
    let samples = if kind.has_fractions() {
        let samples = fractions::from_plain(plain_samples, spare.take()).ok_or(DecodeError::SamplesSize)?;
        *signs = SignChanges::of(&samples);
        samples
    } else {
        join_rows(kind, plain_samples, signs, spare)?
    };
    if !kind.has_hermite() {
        return Ok(Brick::Counts { samples, hermite: Hermite::default() });
    }
    let counts = signs.counts();
    // With a palette a part is shorter than without.
    let size_max = counts.iter().sum::<usize>() * EDGE_BYTES;
    let part = unpack(hermite_bytes, kind.has(PayloadKind::LZ4_HERMITE), size_max, plain)?;
    let hermite = hermite_part::from_plain(part, kind.has(PayloadKind::PALETTE), counts);
    Ok(Brick::Counts { samples, hermite: hermite.ok_or(DecodeError::HermiteSize)? })
}

/// [`decode`] of what the range coder has made.
fn decode_range(
    kind: PayloadKind,
    samples_part: &[u8],
    hermite_part: &[u8],
    scratch: &mut Scratch,
) -> Result<Brick, DecodeError> {
    let samples = range::decode_samples(samples_part, kind.has_fractions(), scratch.spare.take());
    let samples = samples.ok_or(DecodeError::Range)?;
    if !kind.has_hermite() {
        return Ok(Brick::Counts { samples, hermite: Hermite::default() });
    }
    let signs = SignChanges::of(&samples);
    let layers = scratch.layers.get_or_insert_default();
    let hermite = range::decode_hermite(&signs, hermite_part, layers).ok_or(DecodeError::Range)?;
    Ok(Brick::Counts { samples, hermite })
}

/// The samples part and the Hermite part of a payload, as stored; the latter empty where the kind has none.
///
/// # Errors
/// [`DecodeError::Short`] if the payload ends before its samples do.
pub fn parts(kind: PayloadKind, bytes: &[u8]) -> Result<[&[u8]; 2], DecodeError> {
    if !kind.has_hermite() {
        return Ok([bytes, &[]]);
    }
    let (length, rest) = bytes.split_first_chunk::<PART_LENGTH_BYTES>().ok_or(DecodeError::Short)?;
    let length = u32::from_le_bytes(*length) as usize;
    rest.split_at_checked(length).map(|(samples, hermite)| [samples, hermite]).ok_or(DecodeError::Short)
}

/// Splits the samples into first samples, change masks and changes. True if every difference fits 8 bits.
fn split_rows(samples: &Samples, scratch: &mut Scratch) -> bool {
    let Scratch { masks, firsts, steps, .. } = scratch;
    let rows = samples.0.as_chunks::<BRICK_POINTS>().0;
    dispatch!(level(), simd => change_masks(simd, rows, masks));
    steps.clear();
    let mut before = 0i16;
    let mut wide = 0u16;
    for ((ws, &mask), first) in rows.iter().zip(&**masks).zip(&mut **firsts) {
        *first = ws[0].wrapping_sub(before);
        before = ws[0];
        wide |= needs_16_bits(*first);
        for i in bits_of(mask) {
            let step = ws[i + 1].wrapping_sub(ws[i]);
            wide |= needs_16_bits(step);
            steps.push(step);
        }
    }
    wide == 0
}

/// For each row, a mask whose bit `i` is set where sample `i + 1` differs from sample `i`.
#[inline(always)]
fn change_masks<S: Simd>(simd: S, rows: &[[i16; BRICK_POINTS]], masks: &mut [u32; ROWS]) {
    for (ws, mask) in rows.iter().zip(masks) {
        let samples_from = |i: usize| i16x16::from_slice(simd, &ws[i..i + 16]);
        let changes_from = |i: usize| samples_from(i).simd_ne(samples_from(i + 1)).to_bitmask() as u32;
        *mask = changes_from(0) | changes_from(16) << 16;
    }
}

/// The set bits of a mask, from low to high.
#[inline]
fn bits_of(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let i = (mask != 0).then(|| mask.trailing_zeros() as usize)?;
        mask &= mask - 1;
        Some(i)
    })
}

/// Not zero if `difference` does not fit 8 bits.
#[inline]
fn needs_16_bits(difference: i16) -> u16 {
    (difference ^ i16::from(difference as i8)) as u16
}

/// Lays the split rows out in `scratch.plain`: first samples, masks, changes, each as byte planes.
fn samples_plain(narrow: bool, scratch: &mut Scratch) {
    let Scratch { masks, firsts, steps, plain, .. } = scratch;
    plain.clear();
    let push_words = |plain: &mut Vec<u8>, words: &[i16]| {
        plain.extend(words.iter().map(|&w| w as u8));
        if !narrow {
            plain.extend(words.iter().map(|&w| (w >> 8) as u8));
        }
    };
    push_words(plain, &firsts[..]);
    for shift in [0, 8, 16, 24] {
        plain.extend(masks.iter().map(|&m| (m >> shift) as u8));
    }
    push_words(plain, steps);
}

/// Inverse of [`split_rows`] and [`samples_plain`]; also classifies the samples.
fn join_rows(
    kind: PayloadKind,
    plain: &[u8],
    signs: &mut SignChanges,
    spare: &mut Option<Samples>,
) -> Result<Samples, DecodeError> {
    let words = if kind.is_wide() { 2 } else { 1 };
    let (firsts, rest) = plain.split_at_checked(ROWS * words).ok_or(DecodeError::SamplesSize)?;
    let (planes, steps) = rest.split_at_checked(ROWS * MASK_PLANES).ok_or(DecodeError::SamplesSize)?;
    let planes: [&[u8]; MASK_PLANES] = std::array::from_fn(|p| &planes[p * ROWS..][..ROWS]);
    let mask_at = |row: usize| u32::from_le_bytes(planes.map(|plane| plane[row]));
    let steps_count: usize = (0..ROWS).map(|row| mask_at(row).count_ones() as usize).sum();
    if steps.len() != steps_count * words {
        return Err(DecodeError::SamplesSize);
    }
    let word_at = |bytes: &[u8], count: usize, index: usize| match words {
        1 => i16::from(bytes[index] as i8),
        _ => i16::from_le_bytes([bytes[index], bytes[count + index]]),
    };
    let mut samples = SamplesInOrder::new(spare.take());
    let mut before = 0i16;
    let mut step = 0;
    for row in 0..ROWS {
        let mut w = before.wrapping_add(word_at(firsts, ROWS, row));
        before = w;
        let at = row * BRICK_POINTS;
        samples.fill_from(at, w);
        let mut inside = inside_from(i32::from(w), 0);
        for i in bits_of(mask_at(row)) {
            inside ^= inside_from(i32::from(w), i + 1);
            w = w.wrapping_add(word_at(steps, steps_count, step));
            inside ^= inside_from(i32::from(w), i + 1);
            step += 1;
            samples.fill_from(at + i + 1, w);
        }
        signs.set_row(row % BRICK_POINTS, row / BRICK_POINTS, inside);
    }
    Ok(samples.finish())
}

/// Appends `scratch.plain` to `out`, as an LZ4 block if that is asked for and shorter; true if it is.
fn compress_plain(compression: Compression, scratch: &mut Scratch, out: &mut Vec<u8>) -> bool {
    let Scratch { plain, small_table, large_table, .. } = scratch;
    if compression == Compression::None {
        out.extend_from_slice(plain);
        return false;
    }
    // A small table grows for good once it meets a large input, and compresses otherwise afterwards: two
    // tables keep the bytes independent of what was encoded before.
    let table = if plain.len() < usize::from(u16::MAX) { small_table } else { large_table };
    let start = out.len();
    out.resize(start + get_maximum_output_size(plain.len()), 0);
    match compress_into_with_table(plain, &mut out[start..], table) {
        Ok(length) if length < plain.len() => {
            out.truncate(start + length);
            true
        }
        _ => {
            out.truncate(start);
            out.extend_from_slice(plain);
            false
        }
    }
}

/// The part's bytes before LZ4, at most `size_max`.
fn unpack<'a>(
    part: &'a [u8],
    lz4: bool,
    size_max: usize,
    plain: &'a mut Vec<u8>,
) -> Result<&'a [u8], DecodeError> {
    if !lz4 {
        return Ok(part);
    }
    if plain.len() < size_max {
        plain.resize(size_max, 0);
    }
    let length = decompress_into(part, &mut plain[..size_max]).map_err(|_| DecodeError::Lz4)?;
    Ok(&plain[..length])
}

#[cfg(test)]
#[path = "codec_tests.rs"]
mod tests;
