//! Several opinions on a decision made one (Mahoney 2005), in integers, so that all machines come to the same one.

use crate::range::Coder;

/// Logarithms of odds are in 1/256.
const STRETCH_MAX: i32 = 2047;
/// Weights are in 1/65536.
const WEIGHT_MAX: i32 = 1 << 22;
/// Decisions after which an opinion learns no slower.
const SEEN_MAX: u16 = 255;
/// After a jump to another place an opinion is taken for one of so few decisions.
const SEEN_KEPT: u16 = 12;
/// e^(-1/256) in 1/2^40.
const DECAY: u128 = 1_095_225_038_175;

/// What is known of a decision in one context: the probability of a one in 1/65536, and of how many decisions.
#[derive(Clone, Copy)]
pub struct AdaptiveProbability {
    one: u16,
    seen: u16,
}

impl AdaptiveProbability {
    /// Nothing is known yet.
    pub const NEW: AdaptiveProbability = AdaptiveProbability { one: 1 << 15, seen: 0 };

    fn learn(&mut self, one: bool, rates: &[i32]) {
        let target = if one { 65_535 } else { 0 };
        let rate = rates[usize::from(self.seen)];
        self.one = (i32::from(self.one) + (((target - i32::from(self.one)) * (rate >> 2)) >> 14)) as u16;
        self.seen = (self.seen + 1).min(SEEN_MAX);
    }

    /// Learns fast again.
    pub fn forget(&mut self) {
        self.seen = self.seen.min(SEEN_KEPT);
    }
}

/// Tables of the logistic function and its inverse.
#[derive(Clone)]
pub struct Logistic {
    /// Probability in 1/65536 of a logarithm of odds, from -STRETCH_MAX on.
    squashed: Vec<u16>,
    /// Logarithm of odds of a probability in 1/4096.
    stretched: Vec<i16>,
    rates: Vec<i32>,
}

impl Logistic {
    /// The tables.
    pub fn new() -> Logistic {
        let one = 1u128 << 40;
        let mut power = one;
        let mut upper = Vec::new();
        for _ in 0..=STRETCH_MAX {
            upper.push((65_536 * one / (one + power)) as u32);
            power = (power * DECAY) >> 40;
        }
        let lower = upper.iter().skip(1).rev().map(|&p| 65_536 - p);
        let squashed = lower.chain(upper.iter().copied()).map(|p| p.clamp(24, 65_536 - 24) as u16);
        let squashed = squashed.collect::<Vec<u16>>();
        let mut stretched = Vec::new();
        let mut at = 0;
        for p in 0..4096u32 {
            while at + 1 < squashed.len() && u32::from(squashed[at]) < p * 16 + 8 {
                at += 1;
            }
            stretched.push((at as i32 - STRETCH_MAX) as i16);
        }
        let rates = (0..=i32::from(SEEN_MAX)).map(|n| 131_072 / (2 * n + 3)).collect();
        Logistic { squashed, stretched, rates }
    }

    fn squash(&self, x: i32) -> u32 {
        u32::from(self.squashed[(x.clamp(-STRETCH_MAX, STRETCH_MAX) + STRETCH_MAX) as usize])
    }
}

impl Default for Logistic {
    fn default() -> Logistic {
        Logistic::new()
    }
}

/// Opinions of `N` contexts with the weights of each, of which there are several sets.
#[derive(Clone)]
pub struct ContextMixer<const N: usize> {
    opinions: [Vec<AdaptiveProbability>; N],
    weights: Vec<[i32; N]>,
}

impl<const N: usize> ContextMixer<N> {
    /// Nothing is known yet: so many contexts of each kind, so many sets of weights.
    pub fn new(sizes: [usize; N], sets: usize) -> ContextMixer<N> {
        let weight = 65_536 * 2 / (N as i32 + 2);
        ContextMixer {
            opinions: sizes.map(|size| vec![AdaptiveProbability::NEW; size]),
            weights: vec![[weight; N]; sets],
        }
    }

    /// Learns fast again, as at the beginning of a unit.
    pub fn forget(&mut self) {
        self.opinions.iter_mut().flatten().for_each(AdaptiveProbability::forget);
    }

    /// Codes a decision.
    #[inline]
    pub fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        logistic: &Logistic,
        contexts: [usize; N],
        set: usize,
        value: bool,
    ) -> bool {
        let mut inputs = [0i32; N];
        let weights = &mut self.weights[set];
        let mut sum = 0i64;
        for n in 0..N {
            let one = self.opinions[n][contexts[n]].one;
            inputs[n] = i32::from(logistic.stretched[usize::from(one >> 4)]);
            sum += i64::from(inputs[n]) * i64::from(weights[n]);
        }
        let one = logistic.squash((sum >> 16) as i32);
        let value = coder.given(one, value);
        let error = if value { 65_535 - one as i32 } else { -(one as i32) };
        for n in 0..N {
            let step = (inputs[n] * (error >> 4) * 3 + 0x4000) >> 15;
            weights[n] = (weights[n] + step).clamp(-WEIGHT_MAX, WEIGHT_MAX);
            self.opinions[n][contexts[n]].learn(value, &logistic.rates);
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_those_of_the_logistic_function() {
        let logistic = Logistic::new();
        for x in -STRETCH_MAX..=STRETCH_MAX {
            let exact = 65_536.0 / (1.0 + (-f64::from(x) / 256.0).exp());
            let exact = exact.clamp(24.0, 65_512.0);
            assert!((f64::from(logistic.squash(x)) - exact).abs() < 1.5, "{x}");
        }
        for p in 1..4095 {
            let back = logistic.squash(i32::from(logistic.stretched[p]));
            assert!(back.abs_diff(p as u32 * 16 + 8) < 80, "{p}");
        }
    }
}
