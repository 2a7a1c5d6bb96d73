//! zlib streams of data with long runs and few values, much faster than a compressor for anything (RFC 1950 and 1951).
//!
//! A match is looked for in few places: the value before, the last place with the same eight bytes, and where the caller says
//! that equal data may lie, as the row before. The longest is taken at once.

use super::huffman::{Code, lengths};

/// Bytes that one match repeats at most.
const MATCH_MAX: usize = 258;
/// Longer ones are taken without looking for a better one.
const GOOD: usize = 32;
/// Shorter ones are not worth their distance.
const MATCH_MIN: usize = 4;
/// Farthest that a match reaches back.
const DISTANCE_MAX: usize = 32768;
const HASH_BITS: u32 = 12;
/// Bytes that are hashed.
const HASHED: usize = 8;
/// Tokens of a block, which has codes of its own.
const TOKENS_MAX: usize = 4096;
/// Codes of literals and lengths, of which the last two are never used, of distances, and of the lengths of codes.
const LITERALS: usize = 288;
const DISTANCES: usize = 30;
const LENGTHS: usize = 19;
const END: usize = 256;
/// The order in which lengths of the codes of lengths stand.
const LENGTH_ORDER: [usize; LENGTHS] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];

/// A literal byte, or a match.
#[derive(Clone, Copy)]
struct Token(u32);

impl Token {
    const MATCH: u32 = 1 << 31;

    fn repeat(length: usize, distance: usize) -> Token {
        Token(Token::MATCH | ((length - 3) as u32) << 16 | (distance - 1) as u32)
    }

    /// Symbols and extra bits: of a literal or length, and of a distance.
    #[inline]
    fn parts(self) -> (Part, Option<Part>) {
        if self.0 & Token::MATCH == 0 {
            return (Part { symbol: self.0 as usize, bits: 0, extra: 0 }, None);
        }
        let (length, distance) = (self.0 >> 16 & 0xff, self.0 & 0x7fff);
        let length = match length {
            0..8 => Part { symbol: 257 + length as usize, bits: 0, extra: 0 },
            255 => Part { symbol: 285, bits: 0, extra: 0 },
            _ => {
                let bits = length.ilog2() - 2;
                let symbol = 257 + 4 * (bits + 1) + (length >> bits & 3);
                Part { symbol: symbol as usize, bits, extra: length & ((1 << bits) - 1) }
            }
        };
        let distance = if distance < 4 {
            Part { symbol: distance as usize, bits: 0, extra: 0 }
        } else {
            let bits = distance.ilog2() - 1;
            let symbol = 2 * (bits + 1) + (distance >> bits & 1);
            Part { symbol: symbol as usize, bits, extra: distance & ((1 << bits) - 1) }
        };
        (length, Some(distance))
    }
}

/// A symbol with bits that follow it.
#[derive(Clone, Copy)]
struct Part {
    symbol: usize,
    bits: u32,
    extra: u32,
}

/// Bits, the lowest of each byte first.
struct Bits<'a> {
    out: &'a mut Vec<u8>,
    held: u64,
    count: u32,
}

impl Bits<'_> {
    #[inline]
    fn put(&mut self, bits: u32, count: u32) {
        self.held |= u64::from(bits) << self.count;
        self.count += count;
        if self.count >= 32 {
            self.out.extend_from_slice(&(self.held as u32).to_le_bytes());
            self.held >>= 32;
            self.count -= 32;
        }
    }

    fn finish(self) {
        let bytes = self.count.div_ceil(8) as usize;
        self.out.extend_from_slice(&self.held.to_le_bytes()[..bytes]);
    }
}

/// Makes streams, one after the other; the same for the same data.
pub(in crate::export) struct Deflate {
    /// Places of the last data with a hash, plus `base`.
    places: Vec<u32>,
    /// What places of this stream begin at; those of earlier ones are below.
    base: u32,
    tokens: Vec<Token>,
}

impl Deflate {
    /// A compressor.
    pub(in crate::export) fn new() -> Deflate {
        Deflate { places: vec![0; 1 << HASH_BITS], base: 1, tokens: Vec::new() }
    }

    /// Appends the stream of `bytes`, which are values of `unit` bytes. Equal data are looked for at the distances `near`.
    pub(in crate::export) fn zlib(&mut self, bytes: &[u8], unit: usize, near: &[usize], out: &mut Vec<u8>) {
        // Deflate with a window of 32 KiB, the fastest kind.
        out.extend([0x78, 0x01]);
        let mut bits = Bits { out, held: 0, count: 0 };
        if bytes.len() as u64 >= u64::from(u32::MAX - self.base) {
            self.places.fill(0);
            self.base = 1;
        }
        let mut at = 0;
        loop {
            at = self.tokens(bytes, at, unit, near);
            put_block(&self.tokens, at >= bytes.len(), &mut bits);
            if at >= bytes.len() {
                break;
            }
        }
        self.base += bytes.len() as u32;
        bits.finish();
        out.extend(adler32(bytes).to_be_bytes());
    }

    /// The tokens of a block that begins at `at`. Returns where it ends.
    fn tokens(&mut self, bytes: &[u8], mut at: usize, unit: usize, near: &[usize]) -> usize {
        self.tokens.clear();
        while at < bytes.len() && self.tokens.len() < TOKENS_MAX {
            let (length, distance) = self.longest(bytes, at, unit, near);
            if distance == unit && length == MATCH_MAX / unit * unit {
                // A long run, such as of zeros, is measured as a whole.
                let count = run(&bytes[at - unit..], unit) / length;
                self.tokens.extend(std::iter::repeat_n(Token::repeat(length, distance), count));
                at += count * length;
            } else if length >= MATCH_MIN {
                self.tokens.push(Token::repeat(length, distance));
                at += length;
            } else {
                let end = (at + unit).min(bytes.len());
                self.tokens.extend(bytes[at..end].iter().map(|&byte| Token(u32::from(byte))));
                at = end;
            }
        }
        at
    }

    /// The longest match that is found, and how far back it lies.
    #[inline]
    fn longest(&mut self, bytes: &[u8], at: usize, unit: usize, near: &[usize]) -> (usize, usize) {
        let (mut length, mut distance) = (0, 0);
        if at >= unit {
            (length, distance) = (equal(bytes, at - unit, at), unit);
        }
        let far = self.last_place(bytes, at);
        for from in far.into_iter().chain(near.iter().filter_map(|near| at.checked_sub(*near))) {
            if length >= GOOD {
                break;
            }
            let found = equal(bytes, from, at);
            if found > length {
                (length, distance) = (found, at - from);
            }
        }
        // A whole number of values, so that the next match begins with one.
        (length - length % unit, distance)
    }

    /// The last place that had the same eight bytes, or others with the same hash. Remembers this one.
    #[inline]
    fn last_place(&mut self, bytes: &[u8], at: usize) -> Option<usize> {
        let word = u64::from_le_bytes(*bytes.get(at..)?.first_chunk::<HASHED>()?);
        let hash = word.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - HASH_BITS);
        let place = std::mem::replace(&mut self.places[hash as usize], self.base + at as u32);
        let place = place.checked_sub(self.base)? as usize;
        (at - place <= DISTANCE_MAX).then_some(place)
    }
}

/// How many bytes are the same from two places on, as far as a match may go; `from` is before `at`.
#[inline]
fn equal(bytes: &[u8], from: usize, at: usize) -> usize {
    let max = (bytes.len() - at).min(MATCH_MAX);
    let (a, b) = (&bytes[from..from + max], &bytes[at..at + max]);
    let mut n = 0;
    for (a, b) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0) {
        let differ = u64::from_le_bytes(*a) ^ u64::from_le_bytes(*b);
        if differ != 0 {
            return n + (differ.trailing_zeros() / 8) as usize;
        }
        n += 8;
    }
    n + a[n..].iter().zip(&b[n..]).take_while(|(a, b)| a == b).count()
}

/// How many bytes repeat the first `unit` bytes.
fn run(bytes: &[u8], unit: usize) -> usize {
    const WIDE: usize = 64;
    let (before, after) = (&bytes[..bytes.len() - unit], &bytes[unit..]);
    let wide =
        before.chunks_exact(WIDE).zip(after.chunks_exact(WIDE)).take_while(|(a, b)| a == b).count() * WIDE;
    wide + before[wide..].iter().zip(&after[wide..]).take_while(|(a, b)| a == b).count()
}

/// Writes a block, with the codes of the format or with codes of its own, whichever is shorter.
fn put_block(tokens: &[Token], last: bool, bits: &mut Bits<'_>) {
    let (mut literals, mut distances) = ([0u32; LITERALS], [0u32; DISTANCES]);
    literals[END] = 1;
    for token in tokens {
        let (first, second) = token.parts();
        literals[first.symbol] += 1;
        if let Some(second) = second {
            distances[second.symbol] += 1;
        }
    }
    let own = (lengths::<LITERALS>(&literals, 15), lengths::<DISTANCES>(&distances, 15));
    let fixed = (fixed_literals(), [5; DISTANCES]);
    let head = Head::new(&own.0, &own.1);
    let cost = |codes: &([u8; LITERALS], [u8; DISTANCES])| {
        let sum = |counts: &[u32], lengths: &[u8]| {
            counts.iter().zip(lengths).map(|(&n, &length)| u64::from(n) * u64::from(length)).sum::<u64>()
        };
        sum(&literals, &codes.0) + sum(&distances, &codes.1)
    };
    let is_own = cost(&own) + head.bits() < cost(&fixed);
    bits.put(u32::from(last), 1);
    bits.put(if is_own { 2 } else { 1 }, 2);
    let lengths = if is_own { own } else { fixed };
    if is_own {
        head.put(bits);
    }
    let literals = Code::new(&lengths.0);
    let distances = Code::new(&lengths.1);
    for token in tokens {
        let (first, second) = token.parts();
        let (code, count) = literals.of(first.symbol);
        bits.put(code | first.extra << count, count + first.bits);
        if let Some(second) = second {
            let (code, count) = distances.of(second.symbol);
            bits.put(code | second.extra << count, count + second.bits);
        }
    }
    let (code, count) = literals.of(END);
    bits.put(code, count);
}

fn fixed_literals() -> [u8; LITERALS] {
    std::array::from_fn(|n| match n {
        0..144 => 8,
        144..256 => 9,
        256..280 => 7,
        _ => 8,
    })
}

/// Lengths of a block's own codes, packed: what stands before its tokens.
struct Head {
    /// Numbers of lengths of literals and distances.
    counts: [usize; 2],
    /// Symbols with extra bits.
    symbols: Vec<Part>,
    lengths: [u8; LENGTHS],
    /// How many of `lengths` are written.
    written: usize,
}

impl Head {
    fn new(literals: &[u8; LITERALS], distances: &[u8; DISTANCES]) -> Head {
        let used = |lengths: &[u8]| lengths.iter().rposition(|&length| length > 0).map_or(0, |n| n + 1);
        let counts = [used(literals).max(257), used(distances).max(1)];
        let all = [&literals[..counts[0]], &distances[..counts[1]]].concat();
        let symbols = packed_lengths(&all);
        let mut uses = [0; LENGTHS];
        symbols.iter().for_each(|part| uses[part.symbol] += 1);
        let lengths = lengths::<LENGTHS>(&uses, 7);
        let written = LENGTH_ORDER.iter().rposition(|&n| lengths[n] > 0).map_or(4, |n| (n + 1).max(4));
        Head { counts, symbols, lengths, written }
    }

    fn bits(&self) -> u64 {
        let symbols =
            self.symbols.iter().map(|part| u64::from(self.lengths[part.symbol]) + u64::from(part.bits));
        14 + 3 * self.written as u64 + symbols.sum::<u64>()
    }

    fn put(&self, bits: &mut Bits<'_>) {
        bits.put(self.counts[0] as u32 - 257, 5);
        bits.put(self.counts[1] as u32 - 1, 5);
        bits.put(self.written as u32 - 4, 4);
        LENGTH_ORDER[..self.written].iter().for_each(|&n| bits.put(u32::from(self.lengths[n]), 3));
        let code = Code::new(&self.lengths);
        for part in &self.symbols {
            let (bits_of, count) = code.of(part.symbol);
            bits.put(bits_of | part.extra << count, count + part.bits);
        }
    }
}

/// Lengths of codes with their runs as symbols.
fn packed_lengths(all: &[u8]) -> Vec<Part> {
    let mut symbols = Vec::with_capacity(64);
    for run in all.chunk_by(|a, b| a == b) {
        let mut left = run.len();
        let plain = Part { symbol: usize::from(run[0]), bits: 0, extra: 0 };
        if run[0] > 0 {
            symbols.push(plain);
            left -= 1;
        }
        while left > 0 {
            let (part, taken) = match (run[0], left) {
                (_, 0..3) => (plain, 1),
                (0, 3..11) => (Part { symbol: 17, bits: 3, extra: left as u32 - 3 }, left),
                (0, _) => {
                    let taken = left.min(138);
                    (Part { symbol: 18, bits: 7, extra: taken as u32 - 11 }, taken)
                }
                _ => {
                    let taken = left.min(6);
                    (Part { symbol: 16, bits: 2, extra: taken as u32 - 3 }, taken)
                }
            };
            symbols.push(part);
            left -= taken;
        }
    }
    symbols
}

/// The checksum of zlib (RFC 1950, 8.2): sixteen sums side by side, or a formula where all bytes are the same.
fn adler32(bytes: &[u8]) -> u32 {
    const MODULUS: u64 = 65521;
    const LANES: usize = 16;
    const PART: usize = 64 * LANES;
    let (mut a, mut b) = (1u64, 0u64);
    for part in bytes.chunks(PART) {
        let (first, count) = (u64::from(part[0]), part.len() as u64);
        if part[1..] == part[..part.len() - 1] {
            b += count * a + first * (count * (count + 1) / 2);
            a += count * first;
        } else {
            let (mut sums, mut weighted) = ([0u32; LANES], [0u32; LANES]);
            let (groups, rest) = part.as_chunks::<LANES>();
            for group in groups {
                for lane in 0..LANES {
                    weighted[lane] += sums[lane];
                    sums[lane] += u32::from(group[lane]);
                }
            }
            b += a * (groups.len() * LANES) as u64;
            for lane in 0..LANES {
                a += u64::from(sums[lane]);
                b += LANES as u64 * u64::from(weighted[lane]) + (LANES - lane) as u64 * u64::from(sums[lane]);
            }
            for &byte in rest {
                a += u64::from(byte);
                b += a;
            }
        }
        (a, b) = (a % MODULUS, b % MODULUS);
    }
    (b as u32) << 16 | a as u32
}

#[cfg(test)]
mod tests {
    use super::{Deflate, adler32};
    use flate2::{Decompress, FlushDecompress, Status};

    /// A decoder that shares nothing with the encoder gives the data back, and the stream ends where it ends.
    fn check(deflate: &mut Deflate, bytes: &[u8], unit: usize, near: &[usize]) -> usize {
        let (mut stream, mut back) = (Vec::new(), Vec::with_capacity(bytes.len() + 16));
        deflate.zlib(bytes, unit, near, &mut stream);
        let mut decoder = Decompress::new(true);
        let status = decoder.decompress_vec(&stream, &mut back, FlushDecompress::Finish);
        assert_eq!(status.ok(), Some(Status::StreamEnd), "{} bytes of unit {unit}", bytes.len());
        assert!(back == bytes && decoder.total_in() as usize == stream.len());
        stream.len()
    }

    /// Numbers that look random; a few values, or all.
    fn noise(count: usize, values: u32, seed: u32) -> Vec<u32> {
        let mut state = seed | 1;
        let mut next = || {
            state = state.wrapping_mul(0x915f_77f5).rotate_left(13) ^ 0x5bd1;
            state
        };
        (0..count).map(|_| if values == 0 { next() } else { next() % values }).collect()
    }

    #[test]
    fn streams_of_any_data_are_read_by_another_decoder() {
        let mut deflate = Deflate::new();
        for count in [0, 1, 2, 3, 7, 64, 511, 512, 5000] {
            for values in [0, 1, 2, 3, 200, 70_000] {
                let values = noise(count, values, count as u32 + 7);
                let floats =
                    values.iter().flat_map(|&value| (value as f32).to_le_bytes()).collect::<Vec<u8>>();
                check(&mut deflate, &floats, 4, &[32, 28, 36, 256]);
                let bytes = values.iter().map(|&value| value as u8).collect::<Vec<u8>>();
                check(&mut deflate, &bytes, 1, &[33, 1089]);
            }
        }
    }

    #[test]
    fn matches_of_all_lengths_and_distances_are_read_back() {
        let mut deflate = Deflate::new();
        for length in 3..600 {
            for distance in [1, 2, 5, 100, 257, 4097] {
                let mut bytes = noise(distance, 0, 5).iter().map(|&n| n as u8).collect::<Vec<u8>>();
                (0..length).for_each(|n| bytes.push(bytes[n]));
                bytes.extend(b"the end");
                check(&mut deflate, &bytes, 1, &[distance]);
            }
        }
        let far = noise(32_768, 0, 3).iter().map(|&n| n as u8).collect::<Vec<u8>>();
        for distance in [16_000, 24_577, 32_767, 32_768] {
            let bytes = [&far[..distance], &far[..300]].concat();
            let once = check(&mut deflate, &far[..distance], 1, &[distance]);
            assert!(check(&mut deflate, &bytes, 1, &[distance]) < once + 64, "{distance}");
        }
    }

    /// Counts like Fibonacci's numbers have the deepest trees; deeper than a code may be long.
    #[test]
    fn codes_are_never_too_long() {
        let (mut bytes, mut counts) = (Vec::new(), [1usize, 1]);
        for value in 0..22 {
            // Values that differ from their neighbours, so that no match hides them.
            bytes.extend((0..counts[0]).map(|_| value));
            counts = [counts[1], counts[0] + counts[1]];
        }
        let order = noise(bytes.len(), 0, 9);
        let mut order = order.into_iter().zip(bytes).collect::<Vec<_>>();
        order.sort_unstable();
        let bytes = order.into_iter().map(|(_, byte)| byte).collect::<Vec<u8>>();
        check(&mut Deflate::new(), &bytes, 1, &[]);
    }

    /// What a stream is does not depend on those before it.
    #[test]
    fn the_same_data_have_the_same_stream() {
        let bytes = noise(3000, 3, 1).iter().map(|&n| n as u8).collect::<Vec<u8>>();
        let (mut first, mut second, mut used) = (Vec::new(), Vec::new(), Deflate::new());
        Deflate::new().zlib(&bytes, 1, &[33], &mut first);
        check(&mut used, &noise(9000, 3, 2).iter().map(|&n| n as u8).collect::<Vec<u8>>(), 1, &[33]);
        used.zlib(&bytes, 1, &[33], &mut second);
        assert!(first == second && first.len() < bytes.len() / 2);
    }

    #[test]
    fn the_checksum_is_that_of_its_standard() {
        assert_eq!(adler32(b"Wikipedia"), 0x11e6_0398);
        let plain = |bytes: &[u8]| {
            let (mut a, mut b) = (1u32, 0u32);
            for &byte in bytes {
                a = (a + u32::from(byte)) % 65521;
                b = (b + a) % 65521;
            }
            b << 16 | a
        };
        let mut bytes = vec![255; 200_000];
        assert_eq!(adler32(&bytes), plain(&bytes));
        bytes.splice(5000..5003, [1, 2, 3]);
        bytes.truncate(9007);
        assert_eq!(adler32(&bytes), plain(&bytes));
    }
}
