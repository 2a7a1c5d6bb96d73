//! What the machine does at best: how fast all threads read memory, however a job is written, and how fast plain code adds
//! and multiplies numbers.

use crate::result::Limits;
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

/// Numbers of 8 bytes that are read: 256 MiB, more than caches hold of one process.
const NUMBERS: usize = 32 << 20;
/// Of which a thread takes so many at a time: 1 MiB.
const AT_ONCE: usize = 1 << 17;
/// How often each is measured; the best counts.
const TRIES: u32 = 4;

/// Chains of operations that do not wait for each other: as many as hide how long an operation takes where vectors have
/// two numbers.
const CHAINS: usize = 16;
/// Multiplications and additions of each chain: some 10 ms.
const STEPS: usize = 1 << 21;

/// Measures the machine with all threads, which takes a third of a second.
pub fn measure() -> Limits {
    let numbers: Vec<u64> = (0..NUMBERS).into_par_iter().map(|number| number as u64).collect();
    let bytes = (NUMBERS * size_of::<u64>()) as f64;
    let operations = (2 * CHAINS * STEPS * rayon::current_num_threads()) as f64;
    Limits {
        bytes_per_second: bytes / best_of(|| _ = black_box(sum(black_box(&numbers)))),
        operations_per_second: operations / best_of(|| drop(rayon::broadcast(|_| multiply_and_add()))),
    }
}

/// Seconds of the fastest try.
fn best_of(work: impl Fn()) -> f64 {
    let seconds = |_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    (0..TRIES).map(seconds).fold(f64::INFINITY, f64::min)
}

fn sum(numbers: &[u64]) -> u64 {
    let of_part = |part: &[u64]| part.iter().fold(0u64, |sum, &number| sum.wrapping_add(number));
    numbers.par_chunks(AT_ONCE).map(of_part).reduce(|| 0, u64::wrapping_add)
}

/// Plain code in double precision, in vectors as the compiler makes them of it.
fn multiply_and_add() {
    let (factor, term) = (black_box(0.999_999), black_box(1e-6));
    let mut chains: [f64; CHAINS] = black_box([0.5; CHAINS]);
    for _ in 0..STEPS {
        for value in &mut chains {
            *value = *value * factor + term;
        }
    }
    black_box(chains);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_whole() {
        let numbers: Vec<u64> = (0..3 * AT_ONCE as u64 + 5).collect();
        assert_eq!(sum(&numbers), numbers.iter().sum::<u64>());
    }
}
