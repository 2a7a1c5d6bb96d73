//! Header and directory of a file of splats.

/// First bytes of a file.
pub const MAGIC: [u8; 8] = *b"\x89BSP\r\n\x1a\n";
/// Version of the format.
pub const VERSION: u32 = 1;
/// Bytes of the header.
pub const HEADER_BYTES: usize = 512;
/// Bytes of an entry of the directory.
pub const ENTRY_BYTES: usize = 24;
/// Most levels of a file.
pub const LEVELS_MAX: usize = 17;
/// Where the table of levels is, and the bytes of a level in it.
const LEVELS_OFFSET: usize = 128;
const LEVEL_BYTES: usize = 16;
/// Where the header's own checksum is.
const CRC_OFFSET: usize = HEADER_BYTES - 4;
/// Most units of a file.
const UNITS_MAX: u32 = 1 << 26;

/// Why bytes are no file of splats, or no sound one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault(pub &'static str);

/// What a level holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Level {
    /// Splats of its cells.
    pub splats: u64,
    /// Greatest distance of the part's crossings from the splats that stand for them, in 1/4096 of the level's cell.
    pub error: u32,
}

/// What a file says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// World position of the lowest corner of the root's cells.
    pub origin: [f64; 3],
    /// World length of the root's edge.
    pub edge: f64,
    /// Least and greatest world coordinates of the part.
    pub bounds: [[f64; 3]; 2],
    /// The unit of length, as in `mm`; padded with zeros.
    pub unit: [u8; 8],
    /// Deepest level, of which the root has 0.
    pub deepest: u8,
    /// Radius of the directions.
    pub radius: u8,
    /// Levels 0 to this one are in the head.
    pub head: u8,
    /// Number of units behind the head.
    pub units: u32,
    /// Bytes of the head.
    pub head_bytes: u32,
    /// Checksum of the head.
    pub head_crc: u32,
    /// Checksum of the directory.
    pub directory_crc: u32,
    /// By level.
    pub levels: [Level; LEVELS_MAX],
}

/// A unit behind the head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The node whose cells it divides, as in FORMAT.md of the store.
    pub key: u64,
    /// Its bytes.
    pub bytes: u32,
    /// Checksum of key (u64) and bytes.
    pub crc: u32,
    /// Its splats.
    pub splats: u32,
    /// As [`Level::error`].
    pub error: u32,
}

impl Header {
    /// The header's bytes.
    pub fn to_bytes(&self) -> [u8; HEADER_BYTES] {
        let mut out = Vec::with_capacity(HEADER_BYTES);
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        out.extend_from_slice(&(HEADER_BYTES as u32).to_le_bytes());
        let floats = self.origin.iter().chain([&self.edge]).chain(self.bounds.iter().flatten());
        floats.for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
        out.extend_from_slice(&self.unit);
        out.extend_from_slice(&[self.deepest, self.radius, self.head, 0]);
        for value in [self.units, self.head_bytes, self.head_crc, self.directory_crc, 0] {
            out.extend_from_slice(&value.to_le_bytes());
        }
        debug_assert_eq!(out.len(), LEVELS_OFFSET);
        for level in &self.levels {
            out.extend_from_slice(&level.splats.to_le_bytes());
            out.extend_from_slice(&level.error.to_le_bytes());
            out.extend_from_slice(&[0; 4]);
        }
        out.resize(CRC_OFFSET, 0);
        let crc = crc32(0, &out);
        out.extend_from_slice(&crc.to_le_bytes());
        let mut bytes = [0; HEADER_BYTES];
        bytes.copy_from_slice(&out);
        bytes
    }

    /// Reads a header.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(bytes: &[u8]) -> Result<Header, Fault> {
        if !bytes.starts_with(&MAGIC) {
            return Err(Fault("it does not begin as a file of splats does"));
        }
        if bytes.len() < HEADER_BYTES {
            return Err(Fault("it ends within its header"));
        }
        let u32_at = |at: usize| u32::from_le_bytes(array(bytes, at));
        let f64_at = |at: usize| f64::from_le_bytes(array(bytes, at));
        if u32_at(8) != VERSION {
            return Err(Fault("it has a version that this program does not know"));
        }
        if u32_at(CRC_OFFSET) != crc32(0, &bytes[..CRC_OFFSET]) || u32_at(12) != HEADER_BYTES as u32 {
            return Err(Fault("its header is damaged"));
        }
        let triple = |at: usize| [at, at + 8, at + 16].map(f64_at);
        let mut levels = [Level::default(); LEVELS_MAX];
        for (n, level) in levels.iter_mut().enumerate() {
            let at = LEVELS_OFFSET + n * LEVEL_BYTES;
            *level = Level { splats: u64::from_le_bytes(array(bytes, at)), error: u32_at(at + 8) };
        }
        let header = Header {
            origin: triple(16),
            edge: f64_at(40),
            bounds: [triple(48), triple(72)],
            unit: array(bytes, 96),
            deepest: bytes[104],
            radius: bytes[105],
            head: bytes[106],
            units: u32_at(108),
            head_bytes: u32_at(112),
            head_crc: u32_at(116),
            directory_crc: u32_at(120),
            levels,
        };
        header.check()?;
        Ok(header)
    }

    fn check(&self) -> Result<(), Fault> {
        let mut floats = self.origin.iter().chain([&self.edge]).chain(self.bounds.iter().flatten());
        let is_placed = floats.all(|value| value.is_finite()) && self.edge > 0.0;
        let has_levels = usize::from(self.deepest) < LEVELS_MAX && self.head <= self.deepest;
        let is_text = self.unit.iter().all(|&c| c == 0 || c.is_ascii_alphabetic());
        if is_placed && has_levels && is_text && (1..=127).contains(&self.radius) && self.units <= UNITS_MAX {
            return Ok(());
        }
        Err(Fault("its header says what cannot be"))
    }

    /// Where the head begins.
    pub fn head_start(&self) -> usize {
        HEADER_BYTES + self.units as usize * ENTRY_BYTES
    }

    /// Where the units begin.
    pub fn units_start(&self) -> usize {
        self.head_start() + self.head_bytes as usize
    }

    /// World length of a cell of a level.
    pub fn cell(&self, level: u8) -> f64 {
        self.edge / f64::from(32u32 << level)
    }
}

impl Entry {
    /// The entry's bytes.
    pub fn to_bytes(&self) -> [u8; ENTRY_BYTES] {
        let mut bytes = [0; ENTRY_BYTES];
        bytes[..8].copy_from_slice(&self.key.to_le_bytes());
        for (n, value) in [self.bytes, self.crc, self.splats, self.error].iter().enumerate() {
            bytes[8 + 4 * n..12 + 4 * n].copy_from_slice(&value.to_le_bytes());
        }
        bytes
    }

    /// Reads an entry.
    pub fn read(bytes: &[u8]) -> Entry {
        let u32_at = |at: usize| u32::from_le_bytes(array(bytes, at));
        Entry {
            key: u64::from_le_bytes(array(bytes, 0)),
            bytes: u32_at(8),
            crc: u32_at(12),
            splats: u32_at(16),
            error: u32_at(20),
        }
    }

    /// The checksum that bytes of this unit must have.
    pub fn crc_of(key: u64, bytes: &[u8]) -> u32 {
        crc32(crc32(0, &key.to_le_bytes()), bytes)
    }
}

/// So many bytes from a place on.
pub(crate) fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut out = [0; N];
    out.copy_from_slice(&bytes[at..at + N]);
    out
}

const CRC_TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut n = 0;
    while n < 256 {
        let mut crc = n as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
            bit += 1;
        }
        table[n] = crc;
        n += 1;
    }
    table
};

/// The CRC-32 of zlib, going on from that of what came before.
pub fn crc32(before: u32, bytes: &[u8]) -> u32 {
    let step = |crc: u32, &byte: &u8| crc >> 8 ^ CRC_TABLE[((crc ^ u32::from(byte)) & 0xff) as usize];
    !bytes.iter().fold(!before, step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_its_standard() {
        assert_eq!(crc32(0, b"123456789"), 0xcbf4_3926);
        assert_eq!(crc32(crc32(0, b"1234"), b"56789"), 0xcbf4_3926);
    }
}
