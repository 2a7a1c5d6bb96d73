//! Counts of instructions as valgrind's callgrind writes them.

use crate::child;
use crate::plan::CommandLine;
use anyhow::{Context, anyhow};
use brickfield_terminal::failure::Failure;
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The file of counts.
const OUT: &str = "callgrind.out";
/// Without line numbers, files and places, which take as long to write as the program runs, and with whole names.
const OPTIONS: [&str; 5] = [
    "--tool=callgrind",
    "--dump-line=no",
    "--compress-strings=no",
    "--compress-pos=no",
    "--callgrind-out-file=callgrind.out",
];

/// What a run executed.
#[derive(Debug, PartialEq, Eq)]
pub struct InstructionProfile {
    /// Instructions of the whole process.
    pub total: u64,
    /// Instructions of each function and of all that it calls, by its path in the source. Those that call themselves
    /// count too often.
    inclusive: HashMap<String, u64>,
}

/// The version of valgrind.
///
/// # Errors
/// If it cannot be run.
pub fn version() -> Result<String, Failure> {
    let told = Command::new("valgrind").arg("--version").output();
    let told = told.map_err(|error| anyhow!("cannot run valgrind: {error}; install it"))?;
    Ok(String::from_utf8_lossy(&told.stdout).trim().to_owned())
}

/// Runs the program that is measured with `args` in `folder` under callgrind.
///
/// # Errors
/// As [`child::run`], or if valgrind wrote no counts.
pub fn profile(args: &CommandLine, folder: &Path) -> Result<InstructionProfile, Failure> {
    let mut command = Command::new("valgrind");
    command.args(OPTIONS).arg(child::program()?).args(args);
    child::run(command, folder, None)?;
    let text = fs::read_to_string(folder.join(OUT)).with_context(|| format!("{OUT}: cannot be read"))?;
    Ok(InstructionProfile::parse(&text)
        .ok_or_else(|| anyhow!("{OUT}: no counts; is this valgrind's callgrind?"))?)
}

impl InstructionProfile {
    /// Of a file without compressed names: costs stand below the function, also those of calls, which are inclusive.
    fn parse(text: &str) -> Option<InstructionProfile> {
        let (mut total, mut inclusive) = (None, HashMap::<&str, u64>::new());
        let mut function = "";
        for line in text.lines() {
            if let Some(name) = line.strip_prefix("fn=") {
                function = name;
            } else if let Some(sum) = line.strip_prefix("totals: ") {
                total = sum.trim().parse().ok();
            } else if line.starts_with(|first: char| first.is_ascii_digit())
                && let Some(cost) = line.split(' ').nth(1).and_then(|cost| cost.parse::<u64>().ok())
            {
                *inclusive.entry(function).or_default() += cost;
            }
        }
        let inclusive = inclusive.into_iter().map(|(name, sum)| (name.to_owned(), sum)).collect();
        Some(InstructionProfile { total: total?, inclusive })
    }

    /// Instructions of a function in any crate of the engine, named from the crate's root, and of all that it calls; none if it was not called, or is part of
    /// those that call it.
    pub fn of(&self, function: &str) -> Option<u64> {
        let is_it = |name: &str| {
            name.starts_with("brickfield_") && name.split_once("::").is_some_and(|(_, path)| path == function)
        };
        self.inclusive.iter().find(|(name, _)| is_it(name)).map(|(_, sum)| *sum)
    }

    /// The vectors that were chosen when the program ran.
    pub fn vectors(&self) -> Option<&'static str> {
        const KINDS: [(&str, &str); 4] = [
            ("vectorize_avx512", "AVX-512"),
            ("vectorize_avx2", "AVX2"),
            ("vectorize_sse4_2", "SSE4.2"),
            ("vectorize_neon", "NEON"),
        ];
        let ran = |part: &str| self.inclusive.keys().any(|name| name.contains(part));
        KINDS.into_iter().find(|(part, _)| ran(part)).map(|(_, name)| name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_are_added_up() {
        let text = "# callgrind format\nversion: 1\npositions: line\nevents: Ir\nsummary: 60\n\n\
            fl=a.rs\nfn=brickfield_mesh::a::outer\n0 10\ncfn=brickfield_core::a::inner\ncalls=2 0\n0 30\n\
            fn=brickfield_core::a::inner\n0 25\ncfn=x::vectorize::vectorize_avx2\ncalls=1 0\n0 5\n\
            fn=x::vectorize::vectorize_avx2\n0 5\nfn=main\n0 20\ntotals: 60\n";
        let profile = InstructionProfile::parse(text).unwrap();
        assert_eq!((profile.total, profile.of("a::outer"), profile.of("a::inner")), (60, Some(40), Some(30)));
        assert_eq!((profile.of("a::none"), profile.vectors()), (None, Some("AVX2")));
        assert_eq!(InstructionProfile::parse("solid"), None);
    }
}
