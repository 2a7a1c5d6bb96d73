//! Values of a node: those that are active, packed or not, and what the others are.

use super::blosc::unpack_blosc;
use super::cursor::Cursor;
use super::half::half;
use crate::error::Result;
use crate::import::grid::SampleType;
use flate2::{Decompress, FlushDecompress, Status};

/// Bits of a grid's compression.
const ZIP: u32 = 1;
const ACTIVE_MASK: u32 = 2;
const BLOSC: u32 = 4;
/// All values stand there, active or not.
const ALL_VALUES: u8 = 6;

/// The type of a grid's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct VdbNumber {
    pub kind: SampleType,
    /// Active values have 16 bits.
    pub is_half: bool,
}

impl VdbNumber {
    /// Of the name of a tree.
    pub fn of_tree(name: &str) -> Option<VdbNumber> {
        let kind = match name.strip_suffix("_HalfFloat").unwrap_or(name) {
            "Tree_float_5_4_3" => SampleType::F32,
            "Tree_double_5_4_3" => SampleType::F64,
            "Tree_int32_5_4_3" => SampleType::I32,
            "Tree_int64_5_4_3" => SampleType::I64,
            _ => return None,
        };
        Some(VdbNumber { kind, is_half: name.ends_with("_HalfFloat") })
    }

    /// Bytes of an active value.
    fn packed_bytes(self) -> usize {
        if self.is_half { 2 } else { self.kind.bytes() }
    }

    fn decode(self, bytes: &[u8], out: &mut Vec<f64>) {
        match self.is_half {
            true => out.extend(bytes.as_chunks().0.iter().map(|&chunk| half(u16::from_le_bytes(chunk)))),
            false => self.kind.decode(bytes, out),
        }
    }
}

/// How the values of a grid are written.
#[derive(Clone, Copy, Debug)]
pub(super) struct ValueCoding {
    pub number: VdbNumber,
    pub compression: u32,
    pub background: f64,
}

/// What is needed while values are unpacked.
#[derive(Default)]
pub(super) struct Unpacker {
    zlib: Option<Decompress>,
    bytes: Vec<u8>,
    packed: Vec<f64>,
}

/// Whether the bit of an entry is set.
pub(super) fn is_set(mask: &[u8], index: usize) -> bool {
    mask[index / 8] >> (index % 8) & 1 == 1
}

impl ValueCoding {
    /// A single value.
    pub fn one(self, cursor: &mut Cursor<'_>) -> Result<f64> {
        let mut value = Vec::with_capacity(1);
        self.number.kind.decode(cursor.take(self.number.kind.bytes())?, &mut value);
        Ok(value[0])
    }

    /// What the values that are not active are: two numbers, and where the second one is.
    fn inactive<'a>(
        self,
        code: u8,
        mask_bytes: usize,
        cursor: &mut Cursor<'a>,
    ) -> Result<([f64; 2], &'a [u8])> {
        let mut values = [if code == 0 { self.background } else { -self.background }, self.background];
        if [2, 4, 5].contains(&code) {
            values[0] = self.one(cursor)?;
        }
        if code == 5 {
            values[1] = self.one(cursor)?;
        }
        let second: &[u8] = if [3, 4, 5].contains(&code) { cursor.take(mask_bytes)? } else { &[] };
        Ok((values, second))
    }

    /// How many values stand there.
    fn count(self, code: u8, mask: &[u8]) -> usize {
        if self.compression & ACTIVE_MASK == 0 || code == ALL_VALUES {
            return 8 * mask.len();
        }
        mask.iter().map(|byte| byte.count_ones() as usize).sum()
    }

    fn code(self, cursor: &mut Cursor<'_>) -> Result<u8> {
        let code = cursor.byte()?;
        if code > ALL_VALUES {
            return Err(cursor.damaged(format!("{code} is no code of inactive values")));
        }
        Ok(code)
    }

    /// Passes over the values of a node.
    pub fn skip(self, mask: &[u8], cursor: &mut Cursor<'_>) -> Result<()> {
        let code = self.code(cursor)?;
        self.inactive(code, mask.len(), cursor)?;
        let count = self.count(code, mask);
        self.stored(count, cursor).map(|_| ())
    }

    /// The bytes of active values as they stand there, and whether they are packed.
    fn stored<'a>(self, count: usize, cursor: &mut Cursor<'a>) -> Result<(&'a [u8], bool)> {
        let bytes = count * self.number.packed_bytes();
        if self.compression & (ZIP | BLOSC) == 0 || self.number.is_half && count == 0 {
            return Ok((cursor.take(bytes)?, false));
        }
        let length = cursor.long()? as i64;
        if length <= 0 {
            if length.unsigned_abs() != bytes as u64 {
                return Err(
                    cursor.damaged(format!("has {} bytes of values, not {bytes}", length.unsigned_abs()))
                );
            }
            return Ok((cursor.take(bytes)?, false));
        }
        let length = usize::try_from(length).map_err(|_| cursor.damaged("has no such length"))?;
        Ok((cursor.take(length)?, true))
    }

    /// Puts the values of a node's entries into a list, those behind the mask's set bits active.
    pub fn read(
        self,
        mask: &[u8],
        cursor: &mut Cursor<'_>,
        unpacker: &mut Unpacker,
        out: &mut Vec<f64>,
    ) -> Result<()> {
        let code = self.code(cursor)?;
        let (inactive, second) = self.inactive(code, mask.len(), cursor)?;
        let count = self.count(code, mask);
        let start = cursor.clone();
        let (stored, is_packed) = self.stored(count, cursor)?;
        let bytes = count * self.number.packed_bytes();
        let unpacked = match is_packed {
            false => stored,
            true if self.compression & BLOSC != 0 => {
                unpack_blosc(stored, bytes, &mut unpacker.bytes)
                    .map_err(|what| start.error(what, BLOSC_REMEDY))?;
                &unpacker.bytes
            }
            true => {
                unzip(stored, bytes, &mut unpacker.zlib, &mut unpacker.bytes)
                    .ok_or_else(|| start.damaged(format!("does not unpack to {bytes} bytes")))?;
                &unpacker.bytes
            }
        };
        out.clear();
        if count == 8 * mask.len() {
            self.number.decode(unpacked, out);
            return Ok(());
        }
        unpacker.packed.clear();
        self.number.decode(unpacked, &mut unpacker.packed);
        let mut active = unpacker.packed.iter();
        out.extend((0..8 * mask.len()).map(|n| match active.as_slice() {
            [_, ..] if is_set(mask, n) => active.next().copied().unwrap_or(0.0),
            _ => inactive[usize::from(!second.is_empty() && is_set(second, n))],
        }));
        Ok(())
    }
}

/// What helps where Blosc holds what is not read.
const BLOSC_REMEDY: &str =
    "copy the file again, or write it with zip: vdb_tool -read IN.vdb -write codec=zip OUT.vdb";

/// Unpacks a stream of zlib that holds so many bytes.
fn unzip(stored: &[u8], bytes: usize, zlib: &mut Option<Decompress>, out: &mut Vec<u8>) -> Option<()> {
    let zlib = zlib.get_or_insert_with(|| Decompress::new(true));
    zlib.reset(true);
    out.clear();
    out.resize(bytes, 0);
    let status = zlib.decompress(stored, out, FlushDecompress::Finish).ok()?;
    (status == Status::StreamEnd && zlib.total_out() == bytes as u64).then_some(())
}
