//! An adaptive binary range coder in integers (Martin 1979): one decision at a time, each with a probability of its own that
//! learns.
//!
//! A model is written once, for both directions: it asks a [`Coder`] to code a decision and goes on with the answer,
//! which of an encoder is the one that was given, of a decoder the one that was read. So the two cannot disagree.

/// Fraction bits of a probability as it divides the range.
const SPLIT_BITS: u32 = 15;
/// The range stays above this: a byte is shifted out as soon as it would not.
const RANGE_MIN: u32 = 1 << 24;
/// Bytes that a decoder holds ahead, and with which an encoder ends.
const WINDOW_BYTES: usize = 4;
/// Decisions after which a probability learns no slower. Bricks are short and change from place to place: of 8, 16, 30, 60
/// and 120 the store of a pile is smallest with 16, by 1 % to 3 %.
const LEARNED: usize = 16;
/// How fast a probability follows after so many decisions: 1/(n + 1.5), in 1/65536.
const RATES: [i32; LEARNED + 1] = {
    let mut rates = [0; LEARNED + 1];
    let mut n = 0;
    while n <= LEARNED {
        rates[n] = 131_072 / (2 * n as i32 + 3);
        n += 1;
    }
    rates
};

/// The probability that a decision is a one, in 1/65536, and how many decisions it has learnt from.
#[derive(Clone, Copy)]
pub struct Bit {
    one: u16,
    seen: u8,
}

impl Bit {
    /// Nothing is known yet.
    pub const NEW: Bit = Bit { one: 1 << 15, seen: 0 };

    /// The part of the range that stands for a one: at least a 2^-15th and never all of it.
    #[inline(always)]
    fn split(self, range: u32) -> u32 {
        (range >> SPLIT_BITS) * (u32::from(self.one) >> 1 | 1)
    }

    #[inline(always)]
    fn learn(&mut self, one: bool) {
        let target = if one { 65_535 } else { 0 };
        let rate = RATES[usize::from(self.seen)];
        self.one = (i32::from(self.one) + (((target - i32::from(self.one)) * rate) >> 16)) as u16;
        self.seen = (self.seen + 1).min(LEARNED as u8);
    }
}

/// The part of the range that stands for a one of probability `one` in 1/65536.
#[inline(always)]
fn given_split(range: u32, one: u32) -> u32 {
    (range >> 16) * one
}

/// One direction of coding.
pub trait Coder {
    /// Whether what a model gives is what is coded, rather than of no meaning.
    const ENCODES: bool;

    /// Codes a decision; gives it back as it is or was.
    fn bit(&mut self, bit: &mut Bit, value: bool) -> bool;

    /// Codes a decision that is a one with the probability `one` in 1/65536, 1 to 65,535.
    fn given(&mut self, one: u32, value: bool) -> bool;

    /// Codes the low `bits` bits of a number, at most 14, all values being equally likely.
    fn raw(&mut self, value: u32, bits: u32) -> u32;

    /// Notes that what was read means nothing.
    fn refuse(&mut self);
}

/// Appends to a byte vector.
pub struct Encoder<'a> {
    low: u32,
    range: u32,
    out: &'a mut Vec<u8>,
}

impl Encoder<'_> {
    /// Codes behind what `out` holds.
    pub fn new(out: &mut Vec<u8>) -> Encoder<'_> {
        Encoder { low: 0, range: u32::MAX, out }
    }

    /// Writes what is still held back.
    pub fn finish(self) {
        self.out.extend_from_slice(&self.low.to_be_bytes());
    }

    /// Codes a decision of which a one has this part of the range.
    #[inline(always)]
    fn decide(&mut self, split: u32, value: bool) {
        if value {
            self.range = split;
        } else {
            self.raise(split);
            self.range -= split;
        }
        self.shift();
    }

    #[inline(always)]
    fn raise(&mut self, by: u32) {
        let (low, carries) = self.low.overflowing_add(by);
        self.low = low;
        if carries {
            self.carry();
        }
    }

    /// Adds one to the bytes written so far. The number they begin is below one, so a byte below 255 is among them.
    #[cold]
    fn carry(&mut self) {
        for byte in self.out.iter_mut().rev() {
            *byte = byte.wrapping_add(1);
            if *byte != 0 {
                break;
            }
        }
    }

    #[inline(always)]
    fn shift(&mut self) {
        while self.range < RANGE_MIN {
            self.out.push((self.low >> 24) as u8);
            self.low <<= 8;
            self.range <<= 8;
        }
    }
}

impl Coder for Encoder<'_> {
    const ENCODES: bool = true;

    #[inline(always)]
    fn bit(&mut self, bit: &mut Bit, value: bool) -> bool {
        self.decide(bit.split(self.range), value);
        bit.learn(value);
        value
    }

    #[inline(always)]
    fn given(&mut self, one: u32, value: bool) -> bool {
        self.decide(given_split(self.range, one), value);
        value
    }

    #[inline(always)]
    fn raw(&mut self, value: u32, bits: u32) -> u32 {
        self.range >>= bits;
        self.raise(value * self.range);
        self.shift();
        value
    }

    fn refuse(&mut self) {
        unreachable!("what is coded has a meaning");
    }
}

/// Reads from a slice, of which it takes all or finds fault.
pub struct Decoder<'a> {
    code: u32,
    range: u32,
    rest: &'a [u8],
    is_damaged: bool,
}

impl<'a> Decoder<'a> {
    /// Begins to read.
    pub fn new(bytes: &'a [u8]) -> Decoder<'a> {
        let mut decoder = Decoder { code: 0, range: u32::MAX, rest: bytes, is_damaged: false };
        for _ in 0..WINDOW_BYTES {
            decoder.code = decoder.code << 8 | decoder.next_byte();
        }
        decoder.is_damaged |= decoder.code == u32::MAX;
        decoder
    }

    /// Whether all bytes were those that an encoder makes of what was read: none too few, none too many, and nothing
    /// left of the number they are.
    #[must_use]
    pub fn finish(self) -> bool {
        !self.is_damaged && self.rest.is_empty() && self.code == 0
    }

    /// Reads a decision of which a one has this part of the range.
    #[inline(always)]
    fn decide(&mut self, split: u32) -> bool {
        let value = self.code < split;
        if value {
            self.range = split;
        } else {
            self.code -= split;
            self.range -= split;
        }
        self.shift();
        value
    }

    #[inline(always)]
    fn next_byte(&mut self) -> u32 {
        match self.rest.split_first() {
            Some((&byte, rest)) => {
                self.rest = rest;
                u32::from(byte)
            }
            None => {
                self.is_damaged = true;
                0
            }
        }
    }

    #[inline(always)]
    fn shift(&mut self) {
        while self.range < RANGE_MIN {
            self.code = self.code << 8 | self.next_byte();
            self.range <<= 8;
        }
    }
}

impl Coder for Decoder<'_> {
    const ENCODES: bool = false;

    #[inline(always)]
    fn bit(&mut self, bit: &mut Bit, _: bool) -> bool {
        let value = self.decide(bit.split(self.range));
        bit.learn(value);
        value
    }

    #[inline(always)]
    fn given(&mut self, one: u32, _: bool) -> bool {
        self.decide(given_split(self.range, one))
    }

    #[inline(always)]
    fn raw(&mut self, _: u32, bits: u32) -> u32 {
        self.range >>= bits;
        let mut value = self.code / self.range;
        if value >> bits != 0 {
            self.refuse();
            value = (1 << bits) - 1;
        }
        self.code -= value * self.range;
        self.shift();
        value
    }

    fn refuse(&mut self) {
        self.is_damaged = true;
    }
}

/// Most bits of a magnitude.
const LENGTH_MAX: usize = 16;
/// Bits below the first of a magnitude that are modelled; the rest are taken for noise.
const MODELLED: u32 = 2;

/// A number of 16 bits that is likely small: how many bits its magnitude has, in five decisions along a binary tree;
/// its sign. Then the two bits below the first with probabilities that depend on the length; the rest as they are.
#[derive(Clone)]
pub struct NumberModel {
    lengths: [Bit; 32],
    signs: [Bit; LENGTH_MAX + 1],
    below: [[Bit; 3]; LENGTH_MAX + 1],
}

impl NumberModel {
    /// Nothing is known yet.
    pub const NEW: NumberModel = NumberModel {
        lengths: [Bit::NEW; 32],
        signs: [Bit::NEW; LENGTH_MAX + 1],
        below: [[Bit::NEW; 3]; LENGTH_MAX + 1],
    };

    /// Codes a number.
    #[inline]
    pub fn signed(&mut self, coder: &mut impl Coder, value: i16) -> i16 {
        let magnitude = u32::from(value.unsigned_abs());
        let length = self.length(coder, magnitude);
        if length == 0 {
            return 0;
        }
        let is_negative = coder.bit(&mut self.signs[length as usize], value < 0);
        let magnitude = self.rest(coder, magnitude, length) as i32;
        let value = if is_negative { -magnitude } else { magnitude };
        i16::try_from(value).unwrap_or_else(|_| {
            coder.refuse();
            0
        })
    }

    /// Codes a number that has no sign, at most 65,535.
    #[inline]
    pub fn unsigned(&mut self, coder: &mut impl Coder, value: u32) -> u32 {
        let length = self.length(coder, value);
        if length == 0 {
            0
        } else {
            self.rest(coder, value, length)
        }
    }

    #[inline]
    fn length<C: Coder>(&mut self, coder: &mut C, magnitude: u32) -> u32 {
        let length = bit_length(magnitude);
        let mut node = 1;
        for shift in (0..5).rev() {
            let bit = coder.bit(&mut self.lengths[node], length >> shift & 1 != 0);
            node = node * 2 + usize::from(bit);
        }
        let length = node - 32;
        if length > LENGTH_MAX {
            coder.refuse();
        }
        length.min(LENGTH_MAX) as u32
    }

    /// The bits below the first of a magnitude of so many.
    #[inline]
    fn rest<C: Coder>(&mut self, coder: &mut C, magnitude: u32, length: u32) -> u32 {
        let below = &mut self.below[length as usize];
        let mut read = 1;
        let mut left = length - 1;
        let mut node = 0;
        for _ in 0..MODELLED.min(left) {
            left -= 1;
            let bit = coder.bit(&mut below[node], magnitude >> left & 1 != 0);
            node = 1 + usize::from(bit);
            read = read << 1 | u32::from(bit);
        }
        if left > 0 {
            read = read << left | coder.raw(magnitude & ((1 << left) - 1), left);
        }
        read
    }
}

/// How many bits a number has; 0 of 0.
#[inline]
pub fn bit_length(number: u32) -> u32 {
    u32::BITS - number.leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Values = (bool, i16, u16, u32);

    /// Codes decisions, numbers and raw bits by turns.
    fn model(coder: &mut impl Coder, values: &mut [Values]) {
        let mut common = Bit::NEW;
        let mut numbers = [NumberModel::NEW, NumberModel::NEW];
        for (bit, signed, unsigned, noise) in values {
            *bit = coder.bit(&mut common, *bit);
            *signed = numbers[0].signed(coder, *signed);
            *unsigned = numbers[1].unsigned(coder, u32::from(*unsigned)) as u16;
            *noise = coder.raw(*noise, 14);
        }
    }

    fn encoded(values: &[Values]) -> Vec<u8> {
        // What lies before is not touched by carries.
        let mut out = vec![0xff; 3];
        let mut encoder = Encoder::new(&mut out);
        model(&mut encoder, &mut values.to_vec());
        encoder.finish();
        assert_eq!(out[..3], [0xff; 3]);
        out.split_off(3)
    }

    fn decoded(bytes: &[u8], count: usize) -> Option<Vec<Values>> {
        let mut decoder = Decoder::new(bytes);
        let mut values = vec![(false, 0, 0, 0); count];
        model(&mut decoder, &mut values);
        decoder.finish().then_some(values)
    }

    proptest! {
        #[test]
        fn what_was_coded_is_read_and_nothing_else(
            values in prop::collection::vec((prop::bool::weighted(0.01), any::<i16>(), any::<u16>(), 0u32..1 << 14), 0..200),
            shift in 0u32..16, at in any::<prop::sample::Index>(), flip in 1u8..,
        ) {
            let values: Vec<_> = values.into_iter().map(|(b, s, u, n)| (b, s >> shift, u >> shift, n)).collect();
            let mut bytes = encoded(&values);
            prop_assert_eq!(decoded(&bytes, values.len()), Some(values.clone()));
            for end in 0..bytes.len() {
                prop_assert!(decoded(&bytes[..end], values.len()).is_none());
            }
            let at = at.index(bytes.len());
            bytes[at] ^= flip;
            // Bytes are those of one sequence only: a changed byte is a fault or another sequence with these bytes.
            if let Some(other) = decoded(&bytes, values.len()) {
                prop_assert!(other != values);
                prop_assert_eq!(encoded(&other), bytes.clone());
            }
            bytes[at] ^= flip;
            bytes.push(0);
            prop_assert!(decoded(&bytes, values.len()).is_none());
        }
    }

    #[test]
    fn what_is_likely_takes_next_to_nothing() {
        let bytes = encoded_bits(&vec![true; 40_000]);
        assert!(bytes.len() < 30, "{} bytes", bytes.len());
        // A carry may run through many bytes.
        let mut bits = vec![true; 20_000];
        bits.extend([false; 40]);
        assert!(encoded_bits(&bits).len() < 60);
    }

    fn encoded_bits(bits: &[bool]) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = Encoder::new(&mut out);
        let mut model = Bit::NEW;
        assert!(bits.iter().all(|&bit| encoder.bit(&mut model, bit) == bit));
        encoder.finish();
        let mut decoder = Decoder::new(&out);
        let mut model = Bit::NEW;
        assert!(bits.iter().all(|&bit| decoder.bit(&mut model, false) == bit) && decoder.finish());
        out
    }
}
