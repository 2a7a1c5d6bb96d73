//! The program `brickfield`: triangle soups to brick stores, and answers from them.

#![forbid(unsafe_code)]

mod args;
mod bench;
mod bench_args;
mod cache_args;
mod clouds;
mod commands;
mod devices;
mod failure;
mod help;
mod interrupt;
mod kinds;
mod measured;
mod memory;
mod npy;
mod output;
mod picture_args;
mod pieces;
mod points;
mod progress;
mod space;
mod style_file;
mod toolpaths;
mod units;
mod view;
mod view_args;

use args::{Cli, Command};
use clap::FromArgMatches;
use failure::Failure;
use output::one_line;
use std::process::ExitCode;

fn main() -> ExitCode {
    if let Err(lacking) = check_processor() {
        eprintln!("brickfield: {lacking}");
        return ExitCode::FAILURE;
    }
    let matches = help::command().get_matches_from(pieces::joined(std::env::args_os()));
    match Cli::from_arg_matches(&matches).map_err(|error| error.exit()).and_then(run) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read the results has seen enough.
        Err(Failure::ClosedPipe) => ExitCode::SUCCESS,
        Err(Failure::Usage(message)) => {
            eprintln!("brickfield: {}\n\nFor more information, try '--help'.", one_line(&message));
            ExitCode::from(2)
        }
        Err(Failure::Interrupted(message)) => {
            eprintln!("brickfield: {}", one_line(&message));
            ExitCode::from(interrupt::exit_status().unwrap_or(1))
        }
        Err(Failure::Run(error)) => {
            eprintln!("brickfield: {}", one_line(&format!("{error:#}")));
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> Result<(), Failure> {
    interrupt::install()?;
    match cli.command {
        Command::Build(args) => commands::build::run(args),
        Command::Beads(args) => commands::beads::run(&args),
        Command::Mesh(args) => commands::mesh::run(args),
        Command::Info(args) => commands::info::run(&args),
        Command::Sample(args) => commands::sample::run(&args),
        Command::Winding(args) => commands::winding::run(&args),
        Command::Export(args) => commands::export::run(&args),
        Command::Voids(args) => commands::voids::run(&args),
        Command::Slice(args) => commands::slice::run(&args),
        Command::Render(args) => commands::render::run(&args),
        Command::View(args) => commands::view::run(&args),
        Command::Verify(args) => commands::verify::run(&args),
        Command::Cache(args) => commands::cache::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Completions(args) => commands::shell::completions(&args),
        Command::Man(args) => commands::shell::man(&args),
    }
}

/// A program compiled for newer processors dies of an illegal instruction on older ones; better to say why.
fn check_processor() -> Result<(), &'static str> {
    #[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
    if !std::is_x86_feature_detected!("avx2") {
        return Err("this build needs a processor with AVX2; use a build for plain x86-64");
    }
    Ok(())
}
