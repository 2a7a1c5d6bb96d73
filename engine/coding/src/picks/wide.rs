//! Whole numbers of up to 62 bits, of which most are small.

use crate::range::{Bit, Coder};

/// Lengths that a number may have, none among them.
const LENGTHS: usize = 64;
/// Bits below the first that are modelled; the rest are taken for noise.
const MODELLED: u32 = 2;
/// Most bits that are coded as they are at once.
const RAW_BITS: u32 = 14;

/// A number by the bits of its magnitude, its sign, the two bits below the first, and the rest as they are.
#[derive(Clone)]
pub struct WideNumber {
    lengths: [Bit; LENGTHS],
    signs: [Bit; LENGTHS],
    below: [[Bit; 3]; LENGTHS],
}

impl WideNumber {
    /// Nothing is known yet.
    pub const NEW: WideNumber = WideNumber {
        lengths: [Bit::NEW; LENGTHS],
        signs: [Bit::NEW; LENGTHS],
        below: [[Bit::NEW; 3]; LENGTHS],
    };

    /// Codes a number whose magnitude has at most 62 bits.
    pub fn signed<C: Coder>(&mut self, coder: &mut C, value: i64) -> i64 {
        let magnitude = value.unsigned_abs();
        let length = self.length(coder, magnitude);
        if length == 0 {
            return 0;
        }
        let is_negative = coder.bit(&mut self.signs[length as usize], value < 0);
        let magnitude = self.rest(coder, magnitude, length) as i64;
        if is_negative {
            -magnitude
        } else {
            magnitude
        }
    }

    /// How many bits the magnitude has: six decisions along a binary tree.
    fn length<C: Coder>(&mut self, coder: &mut C, magnitude: u64) -> u32 {
        let length = u64::BITS - magnitude.leading_zeros();
        let mut node = 1;
        for shift in (0..6).rev() {
            let bit = coder.bit(&mut self.lengths[node], length >> shift & 1 != 0);
            node = node * 2 + usize::from(bit);
        }
        let length = (node - LENGTHS) as u32;
        if length > 62 {
            coder.refuse();
        }
        length.min(62)
    }

    /// The bits below the first.
    fn rest<C: Coder>(&mut self, coder: &mut C, magnitude: u64, length: u32) -> u64 {
        let below = &mut self.below[length as usize];
        let (mut read, mut left, mut node) = (1, length - 1, 0);
        for _ in 0..MODELLED.min(left) {
            left -= 1;
            let bit = coder.bit(&mut below[node], magnitude >> left & 1 != 0);
            node = 1 + usize::from(bit);
            read = read << 1 | u64::from(bit);
        }
        while left > 0 {
            let bits = left.min(RAW_BITS);
            left -= bits;
            let noise = (magnitude >> left) as u32 & ((1 << bits) - 1);
            read = read << bits | u64::from(coder.raw(noise, bits));
        }
        read
    }
}
