//! The program as its users run it.

mod bad_input;
mod build;
mod determinism;
mod export;
mod mesh;
mod points;
mod shell;
mod signals;
mod store;
mod support;
mod usage;
