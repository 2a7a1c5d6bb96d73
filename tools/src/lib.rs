//! The program `brickfield`: triangle soups to brick stores, and answers from them. A library, so that the Python package
//! has it, too.

#![forbid(unsafe_code)]

mod args;
mod bodies;
mod cache_args;
mod clouds;
mod commands;
mod csg_args;
mod devices;
mod distance_args;
mod elsewhere;
mod finding_args;
mod help;
#[cfg(feature = "http")]
mod http;
mod kinds;
mod layer_args;
mod machine_args;
mod measured;
mod memory;
mod mesh_args;
mod picture_args;
mod pieces;
mod points;
mod shell_args;
mod space;
mod splat_args;
mod style_file;
mod table;
mod toolpaths;
#[cfg(feature = "view")]
mod view;
mod view_args;
mod void_args;
mod void_table;

use args::{Cli, Command};
use brickfield_terminal::{failure, interrupt, options, output, progress, units, work};
use clap::FromArgMatches;
use failure::Failure;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the program with its arguments, its name first, and tells on standard error why it failed. `--help` and wrong usage
/// end the process.
pub fn main(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    work::ended("brickfield", || {
        let matches = help::command().get_matches_from(pieces::joined(arguments));
        Cli::from_arg_matches(&matches).map_err(|error| error.exit()).and_then(run)
    })
}

fn run(cli: Cli) -> Result<(), Failure> {
    interrupt::install("brickfield")?;
    match cli.command {
        Command::Build(args) => commands::build::run(args),
        Command::Beads(args) => commands::beads::run(&args),
        Command::Mesh(args) => commands::mesh::run(args),
        Command::Info(args) => commands::info::run(&args),
        Command::Sample(args) => commands::sample::run(&args),
        Command::Winding(args) => commands::winding::run(&args),
        Command::Export(args) => commands::export::run(&args),
        Command::Splats(args) => commands::splats::run(&args),
        Command::Voids(args) => commands::voids::run(&args),
        Command::Layers(args) => commands::layers::run(&args),
        Command::Overlap(args) => commands::overlap::run(&args),
        Command::Thickness(args) => commands::thickness::run(&args),
        Command::Deviation(args) => commands::deviation::run(&args),
        Command::Offset(args) => commands::offset::run(&args),
        Command::Csg(args) => commands::csg::run(&args),
        Command::Machine(args) => commands::machine::run(&args),
        Command::Slice(args) => commands::slice::run(&args),
        Command::Render(args) => commands::render::run(&args),
        #[cfg(feature = "view")]
        Command::View(args) => commands::view::run(&args),
        #[cfg(not(feature = "view"))]
        Command::View(_) => Err(Failure::Run(anyhow::anyhow!(
            "this program has no window, which takes longer to compile; build it with one: \
             cargo build --release --features view"
        ))),
        Command::Verify(args) => commands::verify::run(&args),
        Command::Cache(args) => commands::cache::run(args),
        Command::Completions(args) => commands::shell::completions(&args),
        Command::Man(args) => commands::shell::man(&args),
    }
}
