//! Samples with binary places as bytes: the number of places, then the change from sample to sample along each row,
//! with its sign in the lowest bit. A row's first sample changes from the row before. All low bytes before all high
//! ones. The field is smooth between jumps, so most high bytes are 0 and LZ4 takes them away.

use super::{POINTS, Samples};
use crate::lattice::BRICK_POINTS;

/// Most binary places.
pub(super) const BITS_MAX: u8 = 14;

/// Replaces the content of `plain` by the samples' bytes.
#[inline]
pub(super) fn to_plain(samples: &Samples, plain: &mut Vec<u8>) {
    plain.clear();
    plain.resize(1 + 2 * POINTS, samples.1);
    let (low, high) = plain[1..].split_at_mut(POINTS);
    for (index, &w) in samples.0.iter().enumerate() {
        let change = w.wrapping_sub(before(&samples.0, index));
        let code = (change << 1 ^ change >> 15) as u16;
        (low[index], high[index]) = (code as u8, (code >> 8) as u8);
    }
}

/// The sample from which the one at `index` is counted.
#[inline]
fn before(samples: &[i16; POINTS], index: usize) -> i16 {
    match (index % BRICK_POINTS, index) {
        (_, 0) => 0,
        (0, _) => samples[index - BRICK_POINTS],
        _ => samples[index - 1],
    }
}

/// Inverse of [`to_plain`], in the memory of samples that nobody needs; `None` if the bytes are too few or too many, or the
/// number of places is none.
#[inline]
pub(super) fn from_plain(plain: &[u8], spare: Option<Samples>) -> Option<Samples> {
    let (&bits, changes) = plain.split_first()?;
    if changes.len() != 2 * POINTS || !(1..=BITS_MAX).contains(&bits) {
        return None;
    }
    let (low, high) = changes.split_at(POINTS);
    let mut samples = Samples::zeroed(spare, bits);
    for index in 0..POINTS {
        let code = u16::from_le_bytes([low[index], high[index]]);
        let change = (code >> 1) as i16 ^ -((code & 1) as i16);
        samples.0[index] = before(&samples.0, index).wrapping_add(change);
    }
    Some(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::codec::{Compression, Scratch, decode, encode_with};
    use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, SignChanges};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn fractions_survive(bits in 1u8..=BITS_MAX, seed in any::<u64>(), spread in 0u32..16, leaf in any::<bool>()) {
            let mut rng = brickfield_bench_data::Rng::new(seed);
            let mut samples = Samples::fractions(bits);
            samples.0.iter_mut().for_each(|w| *w = (rng.below(1 << spread) as i32 - (1 << spread >> 1)) as i16);
            let mut hermite = Hermite::default();
            if leaf {
                let counts = SignChanges::of(&samples).counts();
                hermite.edges = counts.map(|n| {
                    vec![HermiteEdge { offset: 7, normal: OctNormal::from_integer([1, 2, 3]) }; n]
                });
            }
            let brick = Brick::Counts { samples, hermite };
            for compression in [Compression::Lz4, Compression::Range] {
                let mut bytes = Vec::new();
                let head = encode_with(&brick, compression, &mut Scratch::new(), &mut bytes);
                prop_assert!(head.kind.has_fractions());
                prop_assert_eq!((head.min, head.max), brick.range());
                let back = decode(head.kind, 0, &bytes, &mut Scratch::new());
                prop_assert_eq!(back.as_ref(), Ok(&brick));
                prop_assert!(decode(head.kind, 0, &bytes[..bytes.len() - 1], &mut Scratch::new()).is_err());
            }
        }
    }

    #[test]
    fn halves_are_inside_and_damage_is_refused() {
        let mut samples = Samples::fractions(11);
        (samples.0[0], samples.0[1], samples.0[2]) = (1024, 1023, -1025);
        let brick = Brick::from_samples(samples.clone(), Hermite::default());
        assert_eq!([0, 1, 2].map(|i| brick.sample([i, 0, 0])), [1, 0, -1]);
        assert_eq!(brick.value([0, 0, 0]), 0.5);
        let signs = SignChanges::of(&samples);
        assert!(signs.is_inside([0; 3]) && !signs.is_inside([1, 0, 0]));
        let mut plain = Vec::new();
        to_plain(&samples, &mut plain);
        assert_eq!(from_plain(&plain, None), Some(samples));
        assert_eq!(from_plain(&plain[1..], None), None);
        for bits in [0, 15, 255] {
            plain[0] = bits;
            assert_eq!(from_plain(&plain, None), None);
        }
        let whole = Samples(vec![-2048; POINTS].into_boxed_slice().try_into().unwrap(), 10);
        assert_eq!(Brick::from_samples(whole, Hermite::default()), Brick::Uniform(-2));
    }
}
