//! `brickfield-bench instructions`: what the kernels execute, counted by valgrind, beside what they executed when a
//! file was written.
//!
//! Commands of the program itself are run, not benchmarks of the kernels. So nothing is compiled but what users run,
//! the kernels are optimised as they are there, and a kernel is a function of the engine with all that it calls.

use crate::args::BenchInstructionsArgs;
use crate::inputs::Cache;
use crate::line;
use crate::measure::write_file;
use crate::plan::{Bench, CommandLine};
use crate::table::{TextTable, number};
use crate::{callgrind, child};
use anyhow::{Context, anyhow};
use brickfield_bench_data::inputs;
use brickfield_engine::Progress;
use brickfield_terminal::failure::Failure;
use brickfield_terminal::output::{in_line, print, print_json};
use brickfield_terminal::progress::Bars;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// The version of the file's layout.
const FORMAT: u32 = 1;

/// What is counted beside the kernels of a command.
const ALL: &str = "the whole command";

/// What was counted, as it stands in a file.
#[derive(Serialize, Deserialize)]
struct Counts {
    format: u32,
    program: String,
    rustc: String,
    valgrind: String,
    /// That the program chose under valgrind.
    vectors: String,
    counts: Vec<Count>,
}

/// Instructions of a kernel.
#[derive(Serialize, Deserialize)]
struct Count {
    command: String,
    kernel: String,
    /// None if there is no such function: the compiler has made it part of others.
    instructions: Option<u64>,
}

/// A command and the functions in it that are kernels, by what they do.
struct Case {
    name: &'static str,
    line: CommandLine,
    kernels: &'static [(&'static str, &'static str)],
}

/// Runs the command.
pub fn run(args: &BenchInstructionsArgs) -> Result<(), Failure> {
    let baseline = args.baseline.as_deref().map(Counts::read).transpose()?;
    let valgrind = callgrind::version()?;
    let bars = Bars::new(args.quiet, brickfield_terminal::work::ProgressArg::Auto);
    let counts = count(Cache::open(args.cache.clone())?, &bars, valgrind)?;
    bars.clear();
    if let Some(path) = &args.output {
        let json = serde_json::to_vec_pretty(&counts).context("cannot write JSON")?;
        write_file(path, &[&json, &b"\n"[..]].concat())?;
    }
    if args.json { print_json(&counts) } else { print(&counts.as_text(baseline.as_ref())) }
}

/// Runs all commands.
fn count(cache: Cache, bars: &Bars, valgrind: String) -> Result<Counts, Failure> {
    let scratch = tempfile::Builder::new().prefix("bench-").tempdir_in(cache.folder());
    let scratch = scratch.with_context(|| format!("{}: cannot be written to", cache.folder().display()))?;
    let mut bench = Bench {
        cache: &cache,
        folder: scratch.path().to_owned(),
        threads: 1,
        quick: true,
        full: false,
        progress: bars,
        inputs: Vec::new(),
        input_seconds: 0.0,
        limits: Vec::new(),
    };
    let cases = cases(&mut bench)?;
    bars.phase("counting", Some(cases.len() as u64), "commands");
    let (mut counts, mut vectors) = (Vec::new(), None);
    for Case { name, line, kernels } in cases {
        bars.check()?;
        let profile = callgrind::profile(&line, &bench.folder)?;
        vectors = vectors.or(profile.vectors());
        let mut add = |kernel: &str, instructions| {
            counts.push(Count { command: name.to_owned(), kernel: kernel.to_owned(), instructions });
        };
        add(ALL, Some(profile.total));
        kernels.iter().for_each(|(kernel, function)| add(kernel, profile.of(function)));
        bars.advance(1);
    }
    Ok(Counts {
        format: FORMAT,
        program: child::version()?,
        rustc: env!("BRICKFIELD_RUSTC").to_owned(),
        valgrind,
        vectors: vectors.unwrap_or("the least that all processors have").to_owned(),
        counts,
    })
}

/// What is counted: less than two billion instructions each, some seconds under valgrind.
fn cases(bench: &mut Bench<'_>) -> Result<Vec<Case>, Failure> {
    let (closed, open) = (bench.input(&inputs::PILE_50K)?, bench.input(&inputs::CRACKED_50K)?);
    let toolpath = bench.folder.join(inputs::SPOT_TWO_TOOLS.name);
    fs::write(&toolpath, inputs::SPOT_TWO_TOOLS.bytes)
        .with_context(|| format!("{}: cannot be written", in_line(&toolpath)))?;
    let points = bench.points(1_000)?;
    let quiet = |mut line: CommandLine| {
        line.extend(line!["--threads", "1", "--quiet"]);
        line
    };
    Ok(vec![
        Case {
            name: "build --depth 3, closed",
            line: bench.build(&closed, "closed.brf", &["--depth", "3"]),
            kernels: &[
                ("snap, sort into jobs", "build::collect::Collector::push"),
                ("sort into bricks", "build::bins::Binner::sort_some"),
                ("samples", "winding::evaluate::Evaluator::evaluate"),
                ("Hermite edges", "winding::evaluate::Evaluator::hermite"),
                ("interior nodes", "build::subtree::join"),
                ("encode", "brick::codec::encode_with"),
            ],
        },
        Case {
            name: "mesh",
            line: quiet(line!["mesh", "closed.brf", "-o", "mesh.stl"]),
            kernels: &[
                ("decode", "brick::codec::decode"),
                ("vertices", "contour::cells::builder::build"),
                ("facets", "contour::polygons::leaf_facets"),
            ],
        },
        Case {
            name: "mesh --tolerance 0.05mm",
            line: quiet(line!["mesh", "closed.brf", "-o", "merged.stl", "--tolerance", "0.05mm"]),
            kernels: &[("merge vertices", "contour::adaptive::drafting::draft")],
        },
        Case {
            name: "cache repack --compression range",
            line: quiet(line!["cache", "repack", "closed.brf", "-o", "range.brf", "--compression", "range"]),
            kernels: &[("encode", "brick::codec::encode_with")],
        },
        Case {
            name: "verify, range",
            line: quiet(line!["verify", "range.brf"]),
            kernels: &[("decode", "brick::codec::decode")],
        },
        Case {
            name: "winding, closed, 1000 points",
            line: quiet(line!["winding", &closed, "--points", &points]),
            kernels: &[("crossings", "winding::points::Columns::add")],
        },
        Case {
            name: "build --depth 1, open",
            line: bench.build(&open, "open.brf", &["--depth", "1", "--gwn-error", "0.1"]),
            kernels: &[
                ("crossings", "winding::open::brick::OpenBrick::crossings"),
                ("plans of cells", "winding::open::cells::Cells<E>::plan_of"),
                ("sums at samples", "winding::open::cells::Cells<E>::sum"),
            ],
        },
        Case {
            name: "build --depth 2, beads as solids",
            line: bench.build(&toolpath, "beads.brf", &["--depth", "2"]),
            kernels: &[
                ("read G-code", "toolpath::gcode::read_gcode"),
                ("samples", "solid::evaluate::SolidEvaluator::evaluate"),
                ("Hermite edges", "solid::evaluate::SolidEvaluation::into_leaf"),
            ],
        },
    ])
}

impl Counts {
    /// Reads a file.
    fn read(path: &Path) -> Result<Counts, Failure> {
        let name = in_line(path);
        let text = fs::read(path).with_context(|| format!("{name}: cannot be read"))?;
        let remedy = "give what `brickfield-bench instructions -o` wrote";
        let counts: Counts = serde_json::from_slice(&text)
            .map_err(|error| anyhow!("{name}: these are no counts of instructions: {error}; {remedy}"))?;
        if counts.format != FORMAT {
            let version = counts.format;
            let what = format!("its layout is of version {version}, and this program reads {FORMAT}");
            return Err(anyhow!("{name}: {what}; {remedy}").into());
        }
        Ok(counts)
    }

    /// A table, and what makes it less comparable.
    fn as_text(&self, baseline: Option<&Counts>) -> String {
        let of = |counts: &Counts| {
            let Counts { program, rustc, valgrind, vectors, .. } = counts;
            format!("{program}, {rustc}, {valgrind}, vectors: {vectors}")
        };
        let mut text = of(self) + "\n";
        if let Some(before) = baseline.filter(|before| of(before) != of(self)) {
            text += &format!("before: {}\n", of(before));
        }
        let mut table = TextTable::new(&["command", "kernel", "million instructions", "before", "change"]);
        for Count { command, kernel, instructions } in &self.counts {
            let same = |other: &&Count| (&other.command, &other.kernel) == (command, kernel);
            let before =
                baseline.and_then(|b| b.counts.iter().find(same)).and_then(|count| count.instructions);
            table.rows.push(vec![
                command.clone(),
                kernel.clone(),
                millions(*instructions),
                millions(before),
                instructions.zip(before).map_or("–".to_owned(), |(now, before)| change(now, before)),
            ]);
        }
        text + &table.aligned()
    }
}

fn millions(instructions: Option<u64>) -> String {
    instructions.map_or("–".to_owned(), |count| number(count as f64 / 1e6))
}

/// In percent, to a hundredth; what is less is no change: hash maps and the system's answers differ from run to run.
fn change(now: u64, before: u64) -> String {
    let percent = 100.0 * (now as f64 / before as f64 - 1.0);
    if percent.abs() < 0.005 { "same".to_owned() } else { format!("{percent:+.2} %") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_told() {
        let of = |numbers: [Option<u64>; 3], rustc: &str| Counts {
            format: FORMAT,
            program: "p".to_owned(),
            rustc: rustc.to_owned(),
            valgrind: "v".to_owned(),
            vectors: "AVX2".to_owned(),
            counts: std::iter::zip(["a", "b", "c"], numbers)
                .map(|(kernel, instructions)| Count {
                    command: "build".to_owned(),
                    kernel: kernel.to_owned(),
                    instructions,
                })
                .collect(),
        };
        let (before, now) = (
            of([Some(2_000_000), Some(1_000_000), None], "1"),
            of([Some(2_100_000), Some(1_000_001), Some(7)], "2"),
        );
        let text = now.as_text(Some(&before));
        assert!(text.contains("+5.00 %") && text.contains("same") && text.contains("before: p, 1"), "{text}");
        let alone = now.as_text(None);
        assert!(!alone.contains("before: ") && !alone.contains('%'), "{alone}");
    }
}
