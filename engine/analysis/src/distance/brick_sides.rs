//! On which side of the surface the samples of a brick lie, where the store has no sample: within coarser leaves.
//!
//! Near the surface the foot tells it, which is found for the distance anyway. The surface does not pass between two neighbours
//! that both are far from it. So of each connected part of far samples a few are asked, and not all.

use super::brick_feet::BrickFeet;
use crate::brick::{POINTS, point_position};
use crate::lattice::BRICK_POINTS;

/// So many samples of a part are asked. A patch at a corner that no cell resolves may be turned away, so one is not enough.
const WITNESSES: usize = 8;

/// The sides of all samples of a brick: what is known stays, and the rest is found. Of some samples `ask` tells whether the place
/// is inside, in cells; far is what is farther than the reach of `feet`, which is more than a step.
pub(super) fn sides_of(
    feet: &BrickFeet,
    mut known: Vec<Option<bool>>,
    mut ask: impl FnMut([f64; 3]) -> bool,
) -> Vec<bool> {
    for (sample, side) in known.iter_mut().enumerate() {
        if side.is_none() && feet.distance(sample).is_some() {
            *side = feet.side(sample).or_else(|| Some(ask(feet.place(sample))));
        }
    }
    let mut is_waiting: Vec<bool> = known.iter().map(Option::is_none).collect();
    let mut sides: Vec<bool> = known.iter().map(|side| *side == Some(true)).collect();
    for first in 0..POINTS {
        if is_waiting[first] {
            let part = connected(first, &mut is_waiting);
            tell(&part, &mut sides, |sample| ask(feet.place(sample)));
        }
    }
    sides
}

/// The samples that wait and are connected with one, which wait no longer.
fn connected(first: usize, is_waiting: &mut [bool]) -> Vec<usize> {
    let mut part = vec![first];
    is_waiting[first] = false;
    let mut next = 0;
    while next < part.len() {
        let (sample, ijk) = (part[next], point_position(part[next]));
        next += 1;
        for (at, stride) in ijk.into_iter().zip([1, BRICK_POINTS, BRICK_POINTS * BRICK_POINTS]) {
            let below = (at > 0).then(|| sample - stride);
            let above = (at + 1 < BRICK_POINTS).then(|| sample + stride);
            for beside in below.into_iter().chain(above) {
                if std::mem::take(&mut is_waiting[beside]) {
                    part.push(beside);
                }
            }
        }
    }
    part
}

/// Gives a part the side that its witnesses agree on. Where they do not, each sample is asked.
fn tell(part: &[usize], sides: &mut [bool], mut ask: impl FnMut(usize) -> bool) {
    let asked = part.iter().step_by(part.len().div_ceil(WITNESSES));
    let told: Vec<bool> = asked.map(|&sample| ask(sample)).collect();
    let is_one = told.iter().all(|&side| side == told[0]);
    for &sample in part {
        sides[sample] = if is_one { told[0] } else { ask(sample) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::tests::{ball, surface, tree};

    #[test]
    fn few_samples_are_asked_and_all_are_on_the_side_of_their_foot() {
        let surface = surface(&tree(&ball(20.0)));
        let inside = |at| surface.closest(at, f64::INFINITY).unwrap().inside;
        for (first, step) in [([0.0; 3], 1.0), ([16.0; 3], 1.0), ([0.0; 3], 2.0)] {
            let feet = BrickFeet::new(&surface, first, step, 3.0 * step + 0.1).unwrap();
            let mut asked = 0;
            let sides = sides_of(&feet, vec![None; POINTS], |at| {
                asked += 1;
                inside(at)
            });
            assert!(asked <= 200, "{asked} searches of {POINTS} samples");
            for (sample, side) in sides.into_iter().enumerate() {
                assert_eq!(side, inside(feet.place(sample)), "{:?}", feet.place(sample));
            }
        }
    }

    #[test]
    fn what_is_known_stays() {
        let surface = surface(&tree(&ball(20.0)));
        let feet = BrickFeet::new(&surface, [0.0; 3], 1.0, 3.1).unwrap();
        let known: Vec<bool> = (0..POINTS).map(|sample| sample % 3 == 0).collect();
        let sides = sides_of(&feet, known.iter().copied().map(Some).collect(), |_| unreachable!());
        assert_eq!(sides, known);
    }
}
