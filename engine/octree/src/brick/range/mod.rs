//! The stronger coding of a payload's two parts: every decision by its likelihood, given what is around it.
//!
//! Made for stores that are kept or sent: `cache repack --compression range`. Nothing is lost. What it gains and what
//! it costs against LZ4 is in `bench-data/REPORT.md`; the bytes are in `FORMAT.md`.

mod counts;
mod fractions;
mod hermite;

use super::fractions::BITS_MAX;
use super::{Hermite, HermiteEdge, OctNormal, Samples, SignChanges};
use brickfield_coding::range::{Coder, Decoder, Encoder};
pub(super) use hermite::Layers;

/// Bits of the number of binary places.
const PLACES_BITS: u32 = 4;

/// Appends the samples part.
pub(super) fn encode_samples(samples: &Samples, out: &mut Vec<u8>) {
    let mut coder = Encoder::new(out);
    let mut copy = samples.0.clone();
    if samples.1 > 0 {
        coder.raw(u32::from(samples.1), PLACES_BITS);
        fractions::samples(&mut coder, &mut copy);
    } else {
        counts::samples(&mut coder, &mut copy);
    }
    coder.finish();
}

/// Inverse of [`encode_samples`], in the memory of samples that nobody needs; `None` if the part is not what that makes of
/// any samples.
pub(super) fn decode_samples(part: &[u8], has_fractions: bool, spare: Option<Samples>) -> Option<Samples> {
    let mut coder = Decoder::new(part);
    let mut samples = Samples::zeroed(spare, 0);
    if has_fractions {
        samples.1 = coder.raw(0, PLACES_BITS) as u8;
        if !(1..=BITS_MAX).contains(&samples.1) {
            return None;
        }
        fractions::samples(&mut coder, &mut samples.0);
    } else {
        counts::samples(&mut coder, &mut samples.0);
    }
    coder.finish().then_some(samples)
}

/// Appends the Hermite part.
pub(super) fn encode_hermite(signs: &SignChanges, hermite: &Hermite, layers: &mut Layers, out: &mut Vec<u8>) {
    let mut coder = Encoder::new(out);
    hermite::edges(&mut coder, signs, layers, &mut hermite.clone());
    coder.finish();
}

/// Inverse of [`encode_hermite`]; `None` if the part is not what that makes of any edges at these sign changes.
pub(super) fn decode_hermite(signs: &SignChanges, part: &[u8], layers: &mut Layers) -> Option<Hermite> {
    let counts = signs.counts();
    if counts == [0; 3] {
        return None;
    }
    let none = HermiteEdge { offset: 0, normal: OctNormal(0) };
    let mut hermite = Hermite { edges: counts.map(|count| vec![none; count]) };
    let mut coder = Decoder::new(part);
    hermite::edges(&mut coder, signs, layers, &mut hermite);
    coder.finish().then_some(hermite)
}
