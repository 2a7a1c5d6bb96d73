//! What Brickfield's programs share on a terminal: options of all work, progress, signals, errors with their exit
//! status, lengths and sizes as they are typed, the machine's memory.

#![forbid(unsafe_code)]

pub mod failure;
pub mod interrupt;
pub mod memory;
pub mod options;
pub mod output;
pub mod progress;
pub mod units;
pub mod work;
