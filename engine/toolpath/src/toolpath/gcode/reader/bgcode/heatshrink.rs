//! LZSS as *heatshrink* packs it: bits from the highest down, a 1 before a byte, a 0 before a distance and a length.

/// Unpacks up to `limit` bytes with a window of `2^window` bytes and lengths of `2^length`.
pub(super) fn unpack(packed: &[u8], (window, length): (u32, u32), limit: usize, out: &mut Vec<u8>) {
    let mut bits = Bits { bytes: packed, at: 0 };
    while out.len() < limit {
        let Some(tag) = bits.take(1) else { return };
        if tag == 1 {
            let Some(byte) = bits.take(8) else { return };
            out.push(byte as u8);
            continue;
        }
        let (Some(distance), Some(count)) = (bits.take(window), bits.take(length)) else { return };
        let distance = distance as usize + 1;
        for _ in 0..(count + 1).min((limit - out.len()) as u32) {
            // What lies before the first byte is 0.
            let byte = out.len().checked_sub(distance).map_or(0, |from| out[from]);
            out.push(byte);
        }
    }
}

struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Bits<'_> {
    fn take(&mut self, count: u32) -> Option<u32> {
        let mut value = 0;
        for _ in 0..count {
            let byte = self.bytes.get(self.at / 8)?;
            value = value << 1 | u32::from(byte >> (7 - self.at % 8) & 1);
            self.at += 1;
        }
        Some(value)
    }
}
