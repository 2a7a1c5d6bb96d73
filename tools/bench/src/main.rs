//! The program `brickfield-bench`: how fast the program `brickfield` is on this machine, beside what the machine can do at best.
//!
//! Suites are lists of jobs, jobs are commands of that program (`plan`, `suites`, `paper`) that are run as processes of
//! their own (`child`), on inputs that are made once (`inputs`), beside the read floor (`floor`). What was measured is
//! one file (`result`), for people a table (`table`), compared with another (`compare`) or shown (`report`,
//! `sections`, `plots`). Other programs are asked by `peers` and `contours`. Instructions are counted apart (`instructions`,
//! `callgrind`).

#![forbid(unsafe_code)]

mod args;
mod callgrind;
mod child;
mod compare;
mod contours;
mod floor;
mod histogram;
mod inputs;
mod instructions;
mod limits;
mod machine;
mod measure;
mod paper;
mod peers;
mod plan;
mod plots;
mod report;
mod result;
mod sections;
mod suites;
mod table;
mod unions;

use args::{BenchArgs, BenchCommand};
use brickfield_terminal::failure::Failure;
use brickfield_terminal::{interrupt, work};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    work::ended("brickfield-bench", || run(BenchArgs::parse()))
}

fn run(args: BenchArgs) -> Result<(), Failure> {
    interrupt::install("brickfield-bench")?;
    if let Some(program) = args.program {
        child::measure_program(program);
    }
    match args.command {
        Some(BenchCommand::Compare(args)) => compare::run(&args),
        Some(BenchCommand::Report(args)) => report::run(&args),
        Some(BenchCommand::Instructions(args)) => instructions::run(&args),
        None => measure::run(args.run),
    }
}
