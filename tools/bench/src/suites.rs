//! What each suite measures.

use crate::args::SuiteArg;
use crate::line;
use crate::plan::{Bench, Job, OUT};
use brickfield_bench_data::inputs::{self, Spec};
use brickfield_terminal::failure::Failure;
use serde_json::Value;
use std::path::Path;

/// The jobs of a suite; inputs and what else they need is there afterwards.
pub fn jobs(suite: SuiteArg, bench: &mut Bench<'_>) -> Result<Vec<Job>, Failure> {
    match suite {
        SuiteArg::Paper => crate::paper::jobs(bench),
        SuiteArg::Scale => scale(bench),
        SuiteArg::Mesh => mesh(bench),
        SuiteArg::Store => store(bench),
        SuiteArg::Points => points(bench),
        SuiteArg::Unions => crate::unions::jobs(bench),
    }
}

/// The inputs of a suite; those that have others for a base stand behind them.
pub fn inputs(suite: SuiteArg, quick: bool, full: bool) -> Vec<&'static Spec> {
    let own = match suite {
        SuiteArg::Paper => crate::paper::inputs(quick, full),
        SuiteArg::Scale => piles(quick, full),
        SuiteArg::Mesh => meshed(quick),
        SuiteArg::Store => vec![stored(quick)],
        SuiteArg::Points => asked(quick).to_vec(),
        SuiteArg::Unions => crate::unions::inputs(quick),
    };
    own.into_iter().flat_map(|spec| spec.base().into_iter().chain([spec])).collect()
}

/// Inputs of [`scale`], the smallest first.
fn piles(quick: bool, full: bool) -> Vec<&'static Spec> {
    if quick {
        return vec![&inputs::PILE_50K, &inputs::PILE_200K, &inputs::PILE_400K];
    }
    let mut piles = vec![&inputs::PILE_1M, &inputs::PILE_2M, &inputs::PILE_5M];
    if full {
        piles.extend([&inputs::PILE_10M, &inputs::PILE_20M, &inputs::PILE_45M]);
    }
    piles
}

/// Builds by triangles, depth, threads and memory.
fn scale(bench: &mut Bench<'_>) -> Result<Vec<Job>, Failure> {
    let piles = piles(bench.quick, bench.full);
    let pile = piles[piles.len() - 1];
    let (depths, depth) = match (bench.quick, bench.full) {
        (true, _) => (2..=4, 4),
        (_, false) => (2..=6, 5),
        (_, true) => (2..=7, 5),
    };
    let mut jobs = Vec::new();
    for &input in &piles {
        jobs.push(build(bench, input, depth, None, None)?.in_series("triangles"));
    }
    for level in depths.filter(|&level| level != depth) {
        jobs.push(build(bench, piles[0], level, None, None)?.in_series("depth"));
    }
    let mut threads = 1;
    while threads < bench.threads {
        jobs.push(build(bench, pile, depth, Some(threads), None)?.in_series("threads"));
        threads *= 2;
    }
    // Less than this is refused.
    let least = 72 + 8 * bench.threads as u64;
    let budgets = [96, 128, 192, 256, 512, 1024, 4096].into_iter().filter(|&mib| mib >= least);
    for mib in budgets.take(if bench.quick { 2 } else { 7 }) {
        jobs.push(build(bench, pile, depth, None, Some(mib))?.in_series("memory"));
    }
    Ok(jobs)
}

/// One build of [`scale`].
fn build(
    bench: &mut Bench<'_>,
    input: &'static Spec,
    depth: u8,
    threads: Option<usize>,
    mib: Option<u64>,
) -> Result<Job, Failure> {
    let path = bench.input(input)?;
    let mut words = vec!["--depth".to_owned(), depth.to_string()];
    if let Some(mib) = mib {
        words.extend(["--memory".to_owned(), format!("{mib}MiB")]);
    }
    if let Some(threads) = threads {
        words.extend(["--threads".to_owned(), threads.to_string()]);
    }
    let name = format!("build {}", words.join(" "));
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let line = bench.build(&path, &out("part.brf"), &words);
    let mut at = vec![
        ("triangles", bench.triangles(input) as f64),
        ("depth", f64::from(depth)),
        ("threads", threads.unwrap_or(bench.threads) as f64),
    ];
    at.extend(mib.map(|mib| ("memory", mib as f64 * 1024.0 * 1024.0)));
    Ok(Job::new("scale", input, &name, &at, vec![line]).reading(&[&path]))
}

/// Inputs of [`mesh`].
fn meshed(quick: bool) -> Vec<&'static Spec> {
    if quick { vec![&inputs::PILE_50K] } else { vec![&inputs::PILE_1M, &inputs::SPOT_0_9M] }
}

/// Meshes of stores.
fn mesh(bench: &mut Bench<'_>) -> Result<Vec<Job>, Failure> {
    let depth = if bench.quick { 2 } else { 4 };
    let mut jobs = Vec::new();
    for (number, input) in meshed(bench.quick).into_iter().enumerate() {
        let store = format!("{number}.brf");
        let cell = prepared(bench, input, &store, depth)?["cell"].as_f64().unwrap_or(1.0);
        let kinds = [("stl", "dual", 0.0), ("ply", "dual", 0.0), ("stl", "mc", 0.0), ("ply", "mc", 0.0)];
        for (ending, method, tolerance) in
            kinds.into_iter().chain([("stl", "dual", 0.1), ("ply", "dual", 0.1)])
        {
            let how = match (method, tolerance > 0.0) {
                ("mc", _) => ", marching cubes".to_owned(),
                (_, true) => format!(", --tolerance {tolerance} cells"),
                (_, false) => String::new(),
            };
            let name = format!("mesh of depth {depth} to {ending}{how}");
            let mut line = line!["mesh", &store, "-o", out(&format!("mesh.{ending}")), "--quiet", "--json"];
            line.extend(bench.threads());
            line.extend(line!["--tolerance", (tolerance * cell).to_string(), "--method", method]);
            let at = [("depth", f64::from(depth)), ("tolerance", tolerance)];
            jobs.push(Job::new("mesh", input, &name, &at, vec![line]).reading(&[&store]));
        }
    }
    Ok(jobs)
}

/// The input of [`store`].
fn stored(quick: bool) -> &'static Spec {
    if quick { &inputs::PILE_50K } else { &inputs::PILE_1M }
}

/// Stores as files.
fn store(bench: &mut Bench<'_>) -> Result<Vec<Job>, Failure> {
    let (input, depth): (_, u8) = (stored(bench.quick), if bench.quick { 2 } else { 4 });
    let path = bench.input(input)?;
    let depth_word = depth.to_string();
    let mut jobs = Vec::new();
    let mut job = |name: &str, line, reads: &[&Path]| {
        let job = Job::new("store", input, name, &[("depth", f64::from(depth))], vec![line]);
        jobs.push(job.reading(reads));
    };
    for coding in ["lz4", "range"] {
        let words = ["--depth", &depth_word, "--compression", coding];
        bench.prepare(bench.build(&path, &format!("{coding}.brf"), &words))?;
        job(
            &format!("build --depth {depth} --compression {coding}"),
            bench.build(&path, &out("part.brf"), &words),
            &[path.as_path()],
        );
    }
    let with_threads = |mut line: Vec<_>| {
        line.extend(bench.threads());
        line.extend(line!["--quiet", "--json"]);
        line
    };
    for coding in ["lz4", "range"] {
        let store = format!("{coding}.brf");
        let whole = [Path::new(&store)];
        job(&format!("verify, {coding}"), with_threads(line!["verify", &store]), &whole);
        job(&format!("cache stat, {coding}"), with_threads(line!["cache", "stat", &store]), &whole);
        let array = line!["export", &store, "--level", "2", "-o", out("w.npy")];
        // Only the records of some levels are read.
        job(&format!("export --level 2, {coding}"), with_threads(array), &[]);
        let other = if coding == "lz4" { "range" } else { "lz4" };
        let repack = line!["cache", "repack", &store, "-o", out("part.brf"), "--compression", other];
        job(&format!("cache repack, {coding} to {other}"), with_threads(repack), &whole);
    }
    Ok(jobs)
}

/// Inputs of [`points`]: closed, open, a point cloud.
fn asked(quick: bool) -> [&'static Spec; 3] {
    match quick {
        true => [&inputs::PILE_50K, &inputs::CRACKED_50K, &inputs::TORUS_2K],
        false => [&inputs::PILE_1M, &inputs::CRACKED_1M, &inputs::TORUS_20K],
    }
}

/// Answers at points.
fn points(bench: &mut Bench<'_>) -> Result<Vec<Job>, Failure> {
    let [pile, cracked, cloud] = asked(bench.quick);
    let (depth, counts) = match bench.quick {
        true => (2, [10_000, 10_000, 100]),
        false => (4, [1_000_000, 1_000_000, 1_000]),
    };
    let [of_store, of_closed, of_open] = counts;
    prepared(bench, pile, "pile.brf", depth)?;
    let (closed, open) = (bench.input(pile)?, bench.input(cracked)?);
    let scan = bench.input(cloud)?;
    let mut jobs = Vec::new();
    let mut job = |input, name: String, count: u64, mut line: Vec<_>| {
        line.extend(bench.threads());
        line.push("--quiet".into());
        jobs.push(Job::new("points", input, &name, &[("points", count as f64)], vec![line]));
    };
    let file = bench.points(of_store)?;
    let line = line!["sample", "pile.brf", "--points", file];
    job(pile, format!("sample of depth {depth}, {of_store} points"), of_store, line);
    let file = bench.points(of_closed)?;
    let line = line!["winding", closed, "--points", file];
    job(pile, format!("winding, closed, {of_closed} points"), of_closed, line);
    let file = bench.points(of_open)?;
    let line = line!["winding", open, "--points", file];
    job(cracked, format!("winding, open, {of_open} points"), of_open, line);
    let line = line!["build", scan, "-o", out("cloud.brf"), "--json"];
    job(cloud, "build of a point cloud".to_owned(), 0, line);
    Ok(jobs)
}

/// Builds a store of `input` in the suite's folder, and gives what the build told.
fn prepared(bench: &mut Bench<'_>, input: &'static Spec, store: &str, depth: u8) -> Result<Value, Failure> {
    let path = bench.input(input)?;
    bench.prepare(bench.build(&path, store, &["--depth", &depth.to_string()]))
}

/// The name of a file that a job writes.
pub fn out(name: &str) -> String {
    format!("{OUT}/{name}")
}
