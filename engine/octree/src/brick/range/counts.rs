//! Whole samples, each by whether it is that of its left neighbour, or of the row before, or of the layer before.
//!
//! Around a surface what the neighbours say of each other tells what comes. Each of the 2^9 ways in which they equal
//! the left neighbour or not has a probability of its own, as in the coding of bilevel pictures (JBIG).
//!
//! Where all neighbours agree, a row says once that nothing begins there, and most samples of a brick cost nothing.

use crate::brick::POINTS;
use crate::lattice::BRICK_POINTS;
use brickfield_coding::range::{Bit, Coder, NumberModel};

/// Rows of samples along x in a brick.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;
/// Every sample of a row.
const ALL: u64 = (1 << BRICK_POINTS) - 1;
/// A row with its end samples repeated on both sides.
type Row = [i16; BRICK_POINTS + 2];

/// What is learnt within a brick.
struct Model {
    /// Whether a sample of a row differs though all around it agree, by whether the two rows before had such.
    surprises: [Bit; 4],
    /// Whether a sample is such a one no, where the row has some.
    quiet: Bit,
    /// Whether a sample is its left neighbour's.
    same: Box<[Bit; 512]>,
    /// Whether it is that of the row before.
    up: [Bit; 16],
    /// Whether it is that of the layer before.
    back: [Bit; 16],
    /// By how much it is another.
    step: NumberModel,
}

/// The rows around the one that is coded.
struct Around {
    up: Row,
    back: Row,
    /// Of the row before in the layer before.
    diagonal: Row,
    /// Of the row behind in the layer before.
    next: Row,
}

/// Codes all samples of a brick.
pub fn samples<C: Coder>(coder: &mut C, samples: &mut [i16; POINTS]) {
    let mut model = Model {
        surprises: [Bit::NEW; 4],
        quiet: Bit::NEW,
        same: Box::new([Bit::NEW; 512]),
        up: [Bit::NEW; 16],
        back: [Bit::NEW; 16],
        step: NumberModel::NEW,
    };
    let mut surprises = 0;
    for row in 0..ROWS {
        let around = Around::of(samples, row);
        let at = row * BRICK_POINTS;
        let own = samples[at..].first_chunk_mut::<BRICK_POINTS>().expect("a row");
        let quiet = around.quiet();
        let is_surprising =
            coder.bit(&mut model.surprises[surprises & 3], C::ENCODES && around.surprises(quiet, own));
        surprises = surprises << 1 | usize::from(is_surprising);
        model.row(coder, &around, quiet, is_surprising, own);
    }
}

/// A row with its ends repeated.
#[inline]
fn padded(samples: &[i16; POINTS], row: usize) -> Row {
    let own = samples[row * BRICK_POINTS..].first_chunk::<BRICK_POINTS>().expect("a row");
    let mut padded = [0; BRICK_POINTS + 2];
    padded[1..=BRICK_POINTS].copy_from_slice(own);
    (padded[0], padded[BRICK_POINTS + 1]) = (own[0], own[BRICK_POINTS - 1]);
    padded
}

impl Around {
    /// The rows around one; those that lie outside of the brick are taken from where they are nearest.
    #[inline]
    fn of(samples: &[i16; POINTS], row: usize) -> Around {
        let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
        let of = |row: usize| padded(samples, row);
        if k == 0 {
            let up = if j == 0 { [0; BRICK_POINTS + 2] } else { of(row - 1) };
            return Around { up, back: up, diagonal: up, next: up };
        }
        let back = of(row - BRICK_POINTS);
        let (up, diagonal) = if j == 0 { (back, back) } else { (of(row - 1), of(row - BRICK_POINTS - 1)) };
        let next = if j + 1 == BRICK_POINTS { back } else { of(row - BRICK_POINTS + 1) };
        Around { up, back, diagonal, next }
    }

    /// The samples around which all that is known agrees but for the left neighbour.
    #[inline]
    fn quiet(&self) -> u64 {
        let Around { up, back, diagonal, next } = self;
        let mut differs = [0; BRICK_POINTS];
        for (i, differs) in differs.iter_mut().enumerate() {
            let w = up[i + 1];
            *differs = (up[i] ^ w)
                | (up[i + 2] ^ w)
                | (back[i] ^ w)
                | (back[i + 1] ^ w)
                | (back[i + 2] ^ w)
                | (diagonal[i + 1] ^ w)
                | (next[i + 1] ^ w);
        }
        if differs == [0; BRICK_POINTS] {
            return ALL;
        }
        differs.iter().rev().fold(0, |quiet, &differs| quiet << 1 | u64::from(differs == 0))
    }

    /// Whether a sample is another than all around it.
    fn surprises(&self, quiet: u64, own: &[i16; BRICK_POINTS]) -> bool {
        let left = |i: usize| if i == 0 { self.up[1] } else { own[i - 1] };
        (0..BRICK_POINTS).any(|i| quiet >> i & 1 != 0 && left(i) == self.up[i + 1] && own[i] != left(i))
    }
}

impl Model {
    /// Codes a row. Where nothing surprises, a sample is its left neighbour's if that is what all others around are.
    #[inline]
    fn row<C: Coder>(
        &mut self,
        coder: &mut C,
        around: &Around,
        quiet: u64,
        is_surprising: bool,
        own: &mut [i16; BRICK_POINTS],
    ) {
        let mut left = around.up[1];
        let mut before = left;
        if quiet == ALL && !is_surprising {
            own.fill(left);
            return;
        }
        for (i, value) in own.iter_mut().enumerate() {
            let is_quiet = quiet >> i & 1 != 0 && left == around.up[i + 1];
            *value = match is_surprising || !is_quiet {
                true => self.sample(coder, around, i, [before, left], is_quiet, *value),
                false => left,
            };
            (before, left) = (left, *value);
        }
    }

    #[inline(always)]
    fn sample<C: Coder>(
        &mut self,
        coder: &mut C,
        around: &Around,
        i: usize,
        [before, left]: [i16; 2],
        is_quiet: bool,
        value: i16,
    ) -> i16 {
        let Around { up, back, diagonal, next } = around;
        let x = i + 1;
        let is_same = if is_quiet {
            &mut self.quiet
        } else {
            let near = [
                up[x],
                back[x],
                up[x + 1],
                back[x + 1],
                up[x - 1],
                back[x - 1],
                diagonal[x],
                next[x],
                before,
            ];
            let context = near.iter().rev().fold(0, |bits, &w| bits << 1 | usize::from(w == left));
            &mut self.same[context]
        };
        if coder.bit(is_same, value == left) {
            return left;
        }
        let like_up = [back[x], up[x + 1], back[x + 1]].map(|w| w == up[x]);
        let near = [diagonal[x] == left, like_up[2], like_up[1], like_up[0]];
        let context = near.iter().fold(0, |bits, &is| bits << 1 | usize::from(is));
        if up[x] != left && coder.bit(&mut self.up[context], value == up[x]) {
            return up[x];
        }
        let is_other = back[x] != left && back[x] != up[x];
        if is_other && coder.bit(&mut self.back[context], value == back[x]) {
            return back[x];
        }
        left.wrapping_add(self.step.signed(coder, value.wrapping_sub(left)))
    }
}
