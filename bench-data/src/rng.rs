//! Random numbers that will never change.

/// splitmix64 (Steele, Lea & Flood 2014): one word of state, any seed is good.
#[derive(Clone, Debug)]
pub struct Rng(u64);

impl Rng {
    /// A generator for `seed`.
    pub fn new(seed: u64) -> Rng {
        Rng(seed)
    }

    /// The generator of item `index` in a series, independent of how many numbers the others drew.
    pub fn nth(seed: u64, index: u64) -> Rng {
        let mut outer = Rng(seed);
        Rng(outer.word() ^ Rng(index).word())
    }

    /// 64 random bits.
    pub fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Uniform in `low..high`, 53 bits.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.word() >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Uniform in `0..count`; `count` must not be 0.
    pub fn below(&mut self, count: u32) -> u32 {
        ((u128::from(self.word()) * u128::from(count)) >> 64) as u32
    }

    /// True once in `count` draws.
    pub fn one_in(&mut self, count: u32) -> bool {
        self.below(count) == 0
    }

    /// A uniformly distributed unit quaternion (w, x, y, z), by rejection from the 4-cube.
    pub fn quaternion(&mut self) -> [f64; 4] {
        loop {
            let q: [f64; 4] = std::array::from_fn(|_| self.range(-1.0, 1.0));
            let square: f64 = q.iter().map(|v| v * v).sum();
            if square > 0.01 && square <= 1.0 {
                return q.map(|v| v / square.sqrt());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        // First outputs of the reference splitmix64 for seed 1234567.
        let mut rng = Rng::new(1234567);
        assert_eq!(rng.word(), 6457827717110365317);
        assert_eq!(rng.word(), 3203168211198807973);
        let q = rng.quaternion();
        assert!((q.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-15);
    }
}
