//! Numbers that look random, from numbers that do not.

/// Odd, and 2^64 over the golden section: multiples of it spread evenly.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A number of which every bit depends on every bit of `z`: the finalizer of SplitMix64 (Steele, Lea & Flood 2014).
#[inline]
pub fn mix(z: u64) -> u64 {
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// A hash of three coordinates by their bits. Each is multiplied into all bits before the next is added: the low half of
/// an f64 that was an f32 is zero. Multiplier: 2^64 divided by the golden ratio.
#[inline]
pub fn hash_bits(bits: [u64; 3]) -> u64 {
    bits.into_iter().fold(0, |hash: u64, bits| {
        let mixed = u128::from(hash ^ bits ^ 0x5851_f42d_4c95_7f2d) * 0x9e37_79b9_7f4a_7c15;
        (mixed >> 64) as u64 ^ mixed as u64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_split_mix() {
        // What the generator of the paper gives for the seed 0.
        let sequence = [1u64, 2, 3].map(|n| mix(GOLDEN.wrapping_mul(n)));
        assert_eq!(sequence, [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f]);
    }
}
