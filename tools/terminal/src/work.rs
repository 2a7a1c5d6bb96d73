//! Options that all work has, and how a program begins and ends.

use crate::failure::Failure;
use crate::interrupt;
use crate::output::one_line;
use crate::progress::Bars;
use anyhow::Context;
use clap::{Args, ValueEnum};
use std::process::ExitCode;

/// Where and how loudly the work is done.
#[derive(Args, Clone, Copy)]
pub struct WorkArgs {
    /// Threads to work with; all processors by default. Results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Show no progress and no summary; results are printed
    #[arg(long, short)]
    pub quiet: bool,
    /// How to show progress on standard error
    #[arg(long, value_enum, default_value_t)]
    pub progress: ProgressArg,
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum ProgressArg {
    /// Bars, where standard error is a terminal
    #[default]
    Auto,
    /// A JSON object a line, as each phase begins and ends and once a second: phase, unit, done, total, seconds,
    /// rate, left, ended. Messages on standard error never begin with a brace
    Json,
}

/// Sets the number of threads and makes the progress bars.
pub fn start(work: WorkArgs) -> Result<Bars, Failure> {
    let threads = work.threads.map_or(0, usize::from);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().context("cannot start threads")?;
    Ok(Bars::new(work.quiet, work.progress))
}

/// Runs a program, and tells on standard error why it failed: a line with its name in front, and its exit status.
pub fn ended(name: &str, run: impl FnOnce() -> Result<(), Failure>) -> ExitCode {
    if let Err(lacking) = check_processor() {
        eprintln!("{name}: {lacking}");
        return ExitCode::FAILURE;
    }
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read the results has seen enough.
        Err(Failure::ClosedPipe) => ExitCode::SUCCESS,
        Err(Failure::Usage(message)) => {
            eprintln!("{name}: {}\n\nFor more information, try '--help'.", one_line(&message));
            ExitCode::from(2)
        }
        Err(Failure::Interrupted(message)) => {
            eprintln!("{name}: {}", one_line(&message));
            ExitCode::from(interrupt::exit_status().unwrap_or(1))
        }
        Err(Failure::Run(error)) => {
            eprintln!("{name}: {}", one_line(&format!("{error:#}")));
            ExitCode::FAILURE
        }
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
