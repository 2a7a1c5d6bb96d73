//! A range coder in integers, the units of files of splats, tables of beads, and pictures of splats: what the program and its pages share.
//!
//! The crate has no dependencies and keeps to what a compiler of 2022 knows, since that makes WebAssembly of it.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod bsp;
pub mod draw;
pub mod picks;
pub mod range;
