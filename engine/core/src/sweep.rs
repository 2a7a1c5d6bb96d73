//! How much of their sweeps over seeds, depths and threads the tests do: a part that has every kind of case, or all.

/// The variable of the environment that asks for all.
const VARIABLE: &str = "BRICKFIELD_SWEEP";

/// The first value of two, or the second where `BRICKFIELD_SWEEP` is set to anything but `0`: seeds or numbers of cases,
/// and what a test then expects to have seen.
///
///     use brickfield_core::sweep::part_or_all;
///     for seed in part_or_all(0..3, 0..12) {
///         println!("{seed}");
///     }
pub fn part_or_all<T>(part: T, all: T) -> T {
    let is_all = std::env::var_os(VARIABLE).is_some_and(|value| !value.is_empty() && value != *"0");
    if is_all { all } else { part }
}
