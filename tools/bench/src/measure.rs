//! Suites measured round by round, each job of them once a round, and what is told of it.

use crate::args::{BenchRunArgs, SuiteArg};
use crate::inputs::Cache;
use crate::machine::Machine;
use crate::plan::{Bench, Job};
use crate::result::{Figure, Results, Round, Settings};
use crate::{child, floor, limits, machine, peers, plan, report, suites, table};
use anyhow::{Context, anyhow};
use brickfield_engine::part::PartFile;
use brickfield_terminal::failure::Failure;
use brickfield_terminal::output::{print, print_json, require_distinct, warn};
use brickfield_terminal::progress::Bars;
use brickfield_terminal::work::start;
use clap::ValueEnum;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Measures the suites and tells of them.
pub fn run(args: BenchRunArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let outputs: Vec<&Path> =
        [&args.output, &args.report].into_iter().flatten().map(PathBuf::as_path).collect();
    require_distinct(&outputs, &[])?;
    // Refused before the long work.
    let format = args.report.as_deref().map(report::ReportFormat::of).transpose()?;
    let cache = Cache::open(args.cache)?;
    let mut suites = args.suites.clone();
    if suites.is_empty() {
        suites.extend([SuiteArg::Paper, SuiteArg::Scale]);
    }
    suites.sort_unstable();
    suites.dedup();
    let asked = suites.iter().flat_map(|&suite| suites::inputs(suite, args.quick, args.full));
    let topics = args.peers.as_ref().map(|_| {
        let why = "--peers goes with paper, points, mesh or unions: other programs are not asked for what other suites do";
        peers::Topics::of(&suites).ok_or_else(|| Failure::Usage(why.to_owned()))
    });
    let topics = topics.transpose()?;
    let asked: Vec<_> =
        asked.chain(topics.iter().flat_map(|&topics| peers::inputs(topics, args.quick))).collect();
    cache.require_room(&asked, scratch_bytes(args.quick, args.full))?;
    let begun = Instant::now();
    let (date, load) = (machine::date(), machine::load());
    let mut results = Results {
        format: Results::format(),
        program: child::version()?,
        commit: machine::commit(),
        date,
        machine: Machine::this(),
        settings: Settings {
            suites: suites.iter().copied().map(name_of).collect(),
            quick: args.quick,
            full: args.full,
            rounds: args.rounds,
            threads: rayon::current_num_threads(),
        },
        seconds: 0.0,
        input_seconds: 0.0,
        load: [load, load],
        limits: Vec::new(),
        inputs: Vec::new(),
        figures: Vec::new(),
    };
    for suite in suites {
        let name = name_of(suite);
        with_bench(&cache, &bars, &mut results, |bench, rounds| measure_suite(suite, &name, bench, rounds))?;
    }
    if let (Some(python), Some(topics)) = (&args.peers, topics) {
        let python = python.clone().unwrap_or_else(|| peers::default_python(cache.folder()));
        results.settings.suites.push(peers::PEERS.to_owned());
        with_bench(&cache, &bars, &mut results, |bench, rounds| {
            peers::measure(bench, topics, &python, rounds)
        })?;
    }
    bars.clear();
    results.seconds = begun.elapsed().as_secs_f64();
    results.load[1] = machine::load();
    if results.load[0] > results.machine.cores as f64 * 0.5 {
        let load = results.load[0];
        warn(&format!(
            "the machine was not idle: its load was {load} before; compare such figures as ratios only"
        ));
    }
    if let Some(path) = &args.output {
        write_file(path, &serde_json::to_vec_pretty(&results).context("cannot write JSON")?)?;
    }
    let text = table::of(&results);
    let json = args.json.then(|| serde_json::to_value(&results)).transpose().context("cannot write JSON")?;
    if let (Some(path), Some(format)) = (&args.report, format) {
        report::write(&[results], path, format)?;
    }
    match json {
        Some(json) => print_json(&json),
        None if args.work.quiet => Ok(()),
        None => print(&text),
    }
}

/// The most that is written while measuring, removed before the next job: stores, meshes and temporary files.
fn scratch_bytes(quick: bool, full: bool) -> u64 {
    match (quick, full) {
        (true, _) => 1 << 30,
        (_, false) => 3 << 30,
        (_, true) => 6 << 30,
    }
}

/// As it is typed.
fn name_of(suite: SuiteArg) -> String {
    suite.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
}

/// Adds the figures that come of `work` in a folder that is removed afterwards.
fn with_bench(
    cache: &Cache,
    bars: &Bars,
    results: &mut Results,
    work: impl FnOnce(&mut Bench<'_>, u16) -> Result<Vec<Figure>, Failure>,
) -> Result<(), Failure> {
    let scratch = tempfile::Builder::new().prefix("bench-").tempdir_in(cache.folder());
    let scratch = scratch.with_context(|| format!("{}: cannot be written to", cache.folder().display()))?;
    let Settings { quick, full, rounds, threads, .. } = results.settings;
    let (folder, inputs) = (scratch.path().to_owned(), std::mem::take(&mut results.inputs));
    let mut bench = Bench {
        cache,
        folder,
        threads,
        quick,
        full,
        progress: bars,
        inputs,
        input_seconds: 0.0,
        limits: Vec::new(),
    };
    results.figures.extend(work(&mut bench, rounds)?);
    results.inputs = bench.inputs;
    results.limits.extend(bench.limits);
    results.input_seconds += bench.input_seconds;
    Ok(())
}

/// Measures a suite, round by round, each job once a round.
fn measure_suite(
    suite: SuiteArg,
    name: &str,
    bench: &mut Bench<'_>,
    rounds: u16,
) -> Result<Vec<Figure>, Failure> {
    let mut jobs = suites::jobs(suite, bench)?;
    for round in 1..=rounds {
        bench.limits.push(limits::measure());
        bench.progress.phase(&format!("{name} {round}/{rounds}"), Some(jobs.len() as u64), "jobs");
        for job in &mut jobs {
            bench.progress.check()?;
            measure_once(job, bench)?;
            bench.progress.advance(1);
        }
    }
    Ok(jobs.into_iter().flat_map(|job| job.figures).map(|(figure, _)| figure).collect())
}

/// One round of a job.
fn measure_once(job: &mut Job, bench: &Bench<'_>) -> Result<(), Failure> {
    let is_mesh = job.input.name.ends_with(".stl");
    let floor_seconds = floor::read_floor(&bench.cache.path(job.input), is_mesh)?;
    let mut facts = job.known.clone();
    let mut run_all = |lines: &[plan::CommandLine]| -> Result<Round, Failure> {
        bench.empty_out()?;
        let mut round = Round { seconds: 0.0, cpu_seconds: 0.0, floor_seconds, anonymous_bytes: 0 };
        for line in lines {
            let ran = child::run_measured(line, &bench.folder)?;
            round.add(&ran);
            facts.extend(plan::facts_of(&ran));
        }
        Ok(round)
    };
    let fewer = job.fewer.as_deref().map(&mut run_all).transpose()?;
    let whole = run_all(&job.lines)?;
    let moved = job.reads.as_deref().map(|reads| bench.bytes_moved(reads)).transpose();
    let moved = moved.context("what a job wrote cannot be looked at")?;
    for (figure, factor) in &mut job.figures {
        figure.rounds.push(match &fewer {
            None => whole,
            Some(fewer) => extrapolate(fewer, &whole, *factor),
        });
        if figure.rounds.len() > 1 && figure.facts != facts {
            return Err(anyhow!(
                "{}: two rounds gave different results, which is a mistake of the program",
                figure.id()
            )
            .into());
        }
        figure.facts = facts.clone();
        figure.least_bytes = moved;
    }
    Ok(())
}

/// What `factor` times the difference of two runs takes beside the lesser one.
fn extrapolate(fewer: &Round, whole: &Round, factor: f64) -> Round {
    let of = |less: f64, more: f64| less + factor * (more - less).max(0.0);
    Round {
        seconds: of(fewer.seconds, whole.seconds),
        cpu_seconds: of(fewer.cpu_seconds, whole.cpu_seconds),
        ..*whole
    }
}

/// Writes a file that gets its name when it is durable.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let mut file = PartFile::create(path)?;
    file.append(bytes)?;
    Ok(file.finish()?)
}
