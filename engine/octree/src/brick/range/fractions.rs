//! Samples with binary places, each by how far it is from what its neighbours foretell.
//!
//! Two predictions compete. One is right where the field is a sum of functions of two coordinates each (Ibarria et al.
//! 2003). The plainer one is right where it is linear, which adds up less of the rounding of seven neighbours.
//! Whichever was nearer at the neighbours is taken, and how near tells how far off to expect.

use crate::brick::POINTS;
use crate::lattice::BRICK_POINTS;
use brickfield_coding::range::{Coder, NumberModel, bit_length};

/// How far back in the linear index the neighbour before lies along each axis.
const BACK: [usize; 3] = [1, BRICK_POINTS, BRICK_POINTS * BRICK_POINTS];
/// Errors count no further than this.
const ERROR_MAX: u32 = 4096;
/// Sets of probabilities, by the bit length of the errors nearby.
const SETS: usize = 12;

/// Codes all samples of a brick. Differences wrap modulo 2^16.
pub fn samples<C: Coder>(coder: &mut C, samples: &mut [i16; POINTS]) {
    let mut numbers = vec![NumberModel::NEW; SETS];
    let mut errors = vec![[0u32; 2]; POINTS];
    for index in 0..POINTS {
        let place = [index % BRICK_POINTS, index / BACK[1] % BRICK_POINTS, index / BACK[2]];
        let has = place.map(|v| v > 0);
        let predicted = predict(samples, index, has);
        let mut near = [0; 2];
        for axis in (0..3).filter(|&axis| has[axis]) {
            let errors = errors[index - BACK[axis]];
            near = [near[0] + errors[0], near[1] + errors[1]];
        }
        let which = usize::from(near[0] >= near[1]);
        let set = (bit_length(near[which]) as usize).min(SETS - 1);
        let foretold = predicted[which] as i16;
        let off = numbers[set].signed(coder, samples[index].wrapping_sub(foretold));
        let sample = foretold.wrapping_add(off);
        errors[index] = predicted.map(|p| i32::from(sample).abs_diff(p).min(ERROR_MAX));
        samples[index] = sample;
    }
}

/// Both predictions, from the neighbours that there are.
#[inline(always)]
fn predict(samples: &[i16; POINTS], index: usize, has: [bool; 3]) -> [i32; 2] {
    let [x, y, z] = BACK;
    let at = |back: usize| i32::from(samples[index - back]);
    let pair = |a: usize, b: usize| [at(a) + at(b) - at(a + b), (at(a) + at(b)) >> 1];
    match has {
        [true, true, true] => {
            let singles = at(x) + at(y) + at(z);
            let pairs = at(x + y) + at(x + z) + at(y + z);
            [singles - pairs + at(x + y + z), (2 * singles - pairs).div_euclid(3)]
        }
        [true, true, false] => pair(x, y),
        [true, false, true] => pair(x, z),
        [false, true, true] => pair(y, z),
        [true, false, false] => [at(x); 2],
        [false, true, false] => [at(y); 2],
        [false, false, true] => [at(z); 2],
        [false, false, false] => [0; 2],
    }
}
