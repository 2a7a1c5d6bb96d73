//! Other programs asked the same questions, by turns with this one: samples of a grid, meshes of a dense array, the
//! union of all pieces, and contouring alone (`contours`). Each peer is a process of its own that tells how long its answer
//! took, reading not counted.

use crate::args::SuiteArg;
use crate::child::{self, ProcessRun};
use crate::contours;
use crate::floor::read_floor;
use crate::histogram::Histogram;
use crate::line;
use crate::plan::{Bench, CommandLine, figure};
use crate::result::{Figure, Round};
use crate::suites::out;
use anyhow::Context;
use brickfield_bench_data::inputs::{self, Spec};
use brickfield_bench_data::{ASK_PEER, Rng};
use brickfield_engine::check::check;
use brickfield_engine::ingest::Input;
use brickfield_terminal::failure::Failure;
use brickfield_terminal::interrupt;
use serde_json::{Map, Value, json};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// The name of the suite.
pub const PEERS: &str = "peers";
/// The script that asks a peer.
const SCRIPT: &str = "peers.py";
/// Samples an axis of the grids, those of level 1, and of the dense array, those of level 2.
const SAMPLES: u32 = 64;
/// Samples that are judged by the sum over all triangles.
const JUDGED: usize = 200;
/// No peer takes longer.
pub const LIMIT: Duration = Duration::from_secs(600);
/// One that takes longer is asked in one round only.
const LONG: Duration = Duration::from_secs(60);
/// Depth of this program's union, and OpenVDB's cells along the longest side, which are as large.
const UNION_DEPTH: u32 = 4;
/// Facets of a piece of a pile.
const PIECE: u32 = brickfield_bench_data::pile::FACETS_PER_BEAD;

/// Something asked of somebody.
pub struct PeerQuestion {
    figure: Figure,
    input: &'static Spec,
    who: Implementation,
    /// It took so long that once is enough.
    is_long: bool,
    /// What the judged samples are.
    judged: Option<Vec<f64>>,
    /// Who writes the mesh as `out/mesh.ply`, to be checked once.
    check: Option<Implementation>,
}

pub enum Implementation {
    /// This program: the commands, and one that prints the judged samples.
    Us(Vec<CommandLine>, Option<CommandLine>),
    /// A function of this program, called in its own process, and what it tells.
    Here(Box<dyn Fn() -> Result<Value, Failure>>),
    /// A function of the script and the file of its question.
    Peer(&'static str, String),
}

impl PeerQuestion {
    /// With nothing to be judged or checked.
    pub fn new(figure: Figure, input: &'static Spec, who: Implementation) -> PeerQuestion {
        PeerQuestion { figure, input, who, is_long: false, judged: None, check: None }
    }

    /// Says how many pairs of triangles meet in the mesh that `who` writes.
    pub fn checked_by(self, who: Implementation) -> PeerQuestion {
        PeerQuestion { check: Some(who), ..self }
    }
}

/// Which questions belong to the suites that were asked for.
#[derive(Clone, Copy)]
pub struct Topics {
    samples: bool,
    meshes: bool,
    unions: bool,
}

impl Topics {
    /// None if no question belongs to them.
    pub fn of(suites: &[SuiteArg]) -> Option<Topics> {
        let any = |of: &[SuiteArg]| suites.iter().any(|suite| of.contains(suite));
        let topics = Topics {
            samples: any(&[SuiteArg::Paper, SuiteArg::Points]),
            meshes: any(&[SuiteArg::Mesh]),
            unions: any(&[SuiteArg::Unions]),
        };
        (topics.samples || topics.meshes || topics.unions).then_some(topics)
    }
}

/// A closed soup, an open one, a large one; and the pieces that are united.
fn soups(quick: bool) -> ([&'static Spec; 3], &'static Spec) {
    match quick {
        true => ([&inputs::PILE_50K, &inputs::CRACKED_50K, &inputs::PILE_200K], &inputs::PILE_50K),
        false => ([&inputs::PILE_1M, &inputs::CRACKED_1M, &inputs::SPOT_4M], &inputs::PILE_200K),
    }
}

/// All inputs; those that have others for a base stand behind them.
pub fn inputs(topics: Topics, quick: bool) -> Vec<&'static Spec> {
    let (soups, united) = soups(quick);
    let mut inputs = Vec::new();
    inputs.extend(soups.into_iter().filter(|_| topics.samples));
    inputs.extend(contours::inputs(quick).into_iter().chain([soups[0]]).filter(|_| topics.meshes));
    inputs.extend([united].into_iter().filter(|_| topics.unions));
    inputs.into_iter().flat_map(|spec| spec.base().into_iter().chain([spec])).collect()
}

/// Asks all, `rounds` times by turns.
pub fn measure(
    bench: &mut Bench<'_>,
    topics: Topics,
    python: &OsStr,
    rounds: u16,
) -> Result<Vec<Figure>, Failure> {
    fs::write(bench.folder.join(SCRIPT), ASK_PEER).context("peers.py: cannot be written")?;
    let mut questions = Vec::new();
    let (soups, united) = soups(bench.quick);
    if topics.samples {
        for soup in soups {
            ask_for_samples(bench, soup, &mut questions)?;
        }
    }
    if topics.meshes {
        ask_for_meshes(bench, soups[0], &mut questions)?;
        contours::ask(bench, python, &mut questions)?;
    }
    if topics.unions {
        ask_for_union(bench, united, &mut questions)?;
    }
    for round in 1..=rounds {
        bench.progress.phase(&format!("{PEERS} {round}/{rounds}"), Some(questions.len() as u64), "answers");
        for question in &mut questions {
            bench.progress.check()?;
            answer(question, bench, python)?;
            bench.progress.advance(1);
        }
    }
    Ok(questions.into_iter().map(|question| question.figure).collect())
}

/// w at the samples of a grid.
fn ask_for_samples(
    bench: &mut Bench<'_>,
    soup: &'static Spec,
    questions: &mut Vec<PeerQuestion>,
) -> Result<(), Failure> {
    let (path, stem) = (bench.input(soup)?, soup.name.trim_end_matches(".stl"));
    let store = format!("{stem}.brf");
    let words = ["--depth", "1", "--gwn-error", "0.1"];
    bench.prepare(bench.build(&path, &store, &words))?;
    let array = format!("{stem}.npy");
    let grid = bench.prepare(line!["export", &store, "--level", "1", "-o", &array, "--quiet", "--json"])?;
    let check = samples_within(bench, soup, &grid)?;
    let csv: String = check.iter().map(|(_, [x, y, z])| format!("{x},{y},{z}\n")).collect();
    let points = format!("{stem}.csv");
    fs::write(bench.folder.join(&points), csv).with_context(|| format!("{points}: cannot be written"))?;
    bench.progress.phase("adding up what is exact", None, "");
    let brute = line!["winding", &path, "--points", &points, "--brute", "--quiet"];
    let judged = Some(values_of(&child::run_measured(&brute, &bench.folder)?));
    let indices: Vec<usize> = check.iter().map(|(index, _)| *index).collect();
    let (origin, spacing) = (&grid["origin"], &grid["spacing"]);
    let told =
        json!({"soup": path, "samples": SAMPLES, "origin": origin, "spacing": spacing, "check": indices});
    let file = put_question(bench, &format!("{stem}.question"), &told)?;
    let export = line!["export", out("part.brf"), "--level", "1", "-o", out("w.npy"), "--quiet"];
    let ours = vec![bench.build(&path, &out("part.brf"), &words), export];
    let sample = line!["sample", &store, "--points", &points];
    let mut ask = |name: &str, who| {
        let figure = figure(PEERS, soup, &format!("{name}, {SAMPLES}³ samples"), &[]);
        questions.push(PeerQuestion { judged: judged.clone(), ..PeerQuestion::new(figure, soup, who) });
    };
    ask("this program, build and export", Implementation::Us(ours, Some(sample)));
    ask("libigl, fast winding number", Implementation::Peer("libigl-fast", file.clone()));
    ask("libigl, winding number", Implementation::Peer("libigl-exact", file.clone()));
    ask("MeshLib, fast winding number", Implementation::Peer("meshlib-fast", file.clone()));
    ask("trueform, fast winding number", Implementation::Peer("trueform-fast", file.clone()));
    ask("Open3D, occupancy", Implementation::Peer("open3d-occupancy", file));
    Ok(())
}

/// Samples at random among those in the soup's box, where the errors are: flat indices `[z,y,x]` and positions.
fn samples_within(bench: &Bench<'_>, soup: &Spec, grid: &Value) -> Result<Vec<(usize, [f64; 3])>, Failure> {
    let number = |value: &Value| value.as_f64().unwrap_or(0.0);
    let (spacing, origin) = (number(&grid["spacing"]), [0, 1, 2].map(|axis| number(&grid["origin"][axis])));
    let (min, max) = crate::paper::bounds(&bench.cache.path(soup))?;
    let last = f64::from(SAMPLES - 1);
    let range = [0, 1, 2].map(|axis: usize| {
        let at = |value: f64| (value - origin[axis]) / spacing;
        // Samples on the root's own faces count as outside.
        (at(min[axis]).ceil().clamp(1.0, last) as u32, at(max[axis]).floor().clamp(1.0, last) as u32)
    });
    let mut rng = Rng::new(1);
    let mut sample = || {
        let [x, y, z] = range.map(|(low, high)| low + rng.below(high.max(low) - low + 1));
        let position = [x, y, z].map(f64::from);
        let index = ((z * SAMPLES + y) * SAMPLES + x) as usize;
        (index, [0, 1, 2].map(|axis: usize| origin[axis] + spacing * position[axis]))
    };
    Ok((0..JUDGED).map(|_| sample()).collect())
}

/// The surface w = 0.5 of level 2: from the dense array, or from the store.
fn ask_for_meshes(
    bench: &mut Bench<'_>,
    soup: &'static Spec,
    questions: &mut Vec<PeerQuestion>,
) -> Result<(), Failure> {
    let path = bench.input(soup)?;
    bench.prepare(bench.build(&path, "mesh.brf", &["--depth", "2"]))?;
    let export = line!["export", "mesh.brf", "--level", "2", "-o", "mesh.npy", "--quiet", "--json"];
    let grid = bench.prepare(export)?;
    let told = json!({"array": "mesh.npy", "spacing": grid["spacing"]});
    let file = put_question(bench, "mesh.question", &told)?;
    let mut ask = |name: &str, who| {
        let figure = figure(PEERS, soup, &format!("{name}, mesh of 128³ samples"), &[]);
        questions.push(PeerQuestion::new(figure, soup, who));
    };
    let ours = line!["mesh", "mesh.brf", "-o", out("mesh.stl"), "--quiet", "--json"];
    ask("this program, mesh to STL", Implementation::Us(vec![ours], None));
    ask("scikit-image, marching cubes", Implementation::Peer("skimage-cubes", file.clone()));
    ask("VTK, flying edges", Implementation::Peer("vtk-edges", file));
    Ok(())
}

/// The union of all pieces as a mesh.
fn ask_for_union(
    bench: &mut Bench<'_>,
    soup: &'static Spec,
    questions: &mut Vec<PeerQuestion>,
) -> Result<(), Failure> {
    let path = bench.input(soup)?;
    let cells = 32u32 << UNION_DEPTH;
    let told = json!({"soup": path, "piece": PIECE, "cells": cells, "threads": bench.threads});
    let file = put_question(bench, "union.question", &told)?;
    let build = bench.build(&path, &out("part.brf"), &["--depth", &UNION_DEPTH.to_string()]);
    let mesh = line!["mesh", out("part.brf"), "-o", out("mesh.stl"), "--quiet", "--json"];
    let mut ask = |name: &str, who| {
        let figure = figure(PEERS, soup, &format!("{name}, union"), &[]);
        questions.push(PeerQuestion::new(figure, soup, who));
    };
    let ours = format!("this program, build --depth {UNION_DEPTH} and mesh");
    ask(&ours, Implementation::Us(vec![build, mesh], None));
    ask("Manifold, exact Booleans", Implementation::Peer("manifold-union", file.clone()));
    ask("trueform, exact Booleans", Implementation::Peer("trueform-union", file.clone()));
    let openvdb = format!("OpenVDB, level set of {cells}³ cells and mesh");
    ask(&openvdb, Implementation::Peer("openvdb-union", file));
    Ok(())
}

/// Asks once. What goes wrong with a peer is told in its row.
fn answer(question: &mut PeerQuestion, bench: &Bench<'_>, python: &OsStr) -> Result<(), Failure> {
    if question.figure.failed.is_some() || question.is_long {
        return Ok(());
    }
    let floor_seconds = read_floor(&bench.cache.path(question.input), true)?;
    let empty = Round { seconds: 0.0, cpu_seconds: 0.0, floor_seconds, anonymous_bytes: 0 };
    bench.empty_out()?;
    let (round, told) = match &question.who {
        Implementation::Us(lines, sample) => {
            let (mut round, mut told) = (empty, Map::new());
            for line in lines {
                let ran = child::run_measured(line, &bench.folder)?;
                round.add(&ran);
                told.extend(serde_json::from_slice::<Map<_, _>>(&ran.printed).unwrap_or_default());
            }
            if let Some(sample) = sample {
                let values = values_of(&child::run_measured(sample, &bench.folder)?);
                told.insert("values".to_owned(), values.into());
            }
            (round, Value::Object(told))
        }
        Implementation::Here(work) => {
            let (ran, told) = child::here(work)?;
            let mut round = empty;
            round.add(&ran);
            (round, told)
        }
        Implementation::Peer(name, file) => {
            match child::run(command(python, name, file), &bench.folder, Some(LIMIT)) {
                Ok(ran) => {
                    let told: Value = serde_json::from_slice(&ran.printed).unwrap_or(Value::Null);
                    let mut round = empty;
                    round.add(&ran);
                    question.is_long = ran.seconds > LONG.as_secs_f64();
                    round.seconds = told["seconds"].as_f64().unwrap_or(0.0);
                    (round, told)
                }
                Err(failure) if interrupt::requested() => return Err(failure),
                Err(failure) => {
                    question.figure.rounds.clear();
                    question.figure.failed = Some(why(&failure));
                    return Ok(());
                }
            }
        }
    };
    tell(question, round, &told);
    match question.check.take() {
        Some(who) => tell_pairs(question, &who, bench, python),
        None => Ok(()),
    }
}

/// A question to a peer as it is run in the suite's folder.
pub fn command(python: &OsStr, name: &str, file: &str) -> Command {
    let mut command = Command::new(python);
    command.args([SCRIPT, name, file]);
    command
}

/// Writes what a peer is asked.
pub fn put_question(bench: &Bench<'_>, name: &str, told: &Value) -> Result<String, Failure> {
    let written = fs::write(bench.folder.join(name), told.to_string());
    written.with_context(|| format!("{name}: cannot be written"))?;
    Ok(name.to_owned())
}

/// Has the mesh written and counts the pairs of triangles that meet where they must not.
fn tell_pairs(
    question: &mut PeerQuestion,
    who: &Implementation,
    bench: &Bench<'_>,
    python: &OsStr,
) -> Result<(), Failure> {
    bench.empty_out()?;
    match who {
        Implementation::Us(lines, _) => {
            for line in lines {
                child::run_measured(line, &bench.folder)?;
            }
        }
        Implementation::Here(work) => drop(work()?),
        Implementation::Peer(name, file) => {
            child::run(command(python, name, file), &bench.folder, Some(LIMIT))?;
        }
    }
    let mesh = Input::open(&bench.folder.join(out("mesh.ply")), bench.progress)?;
    let pairs = check(&mesh, false, bench.progress)?.intersections.pairs;
    question.figure.facts.insert("pairs".to_owned(), pairs.into());
    Ok(())
}

/// Adds a round, and what was answered.
fn tell(question: &mut PeerQuestion, mut round: Round, told: &Value) {
    let PeerQuestion { figure, judged, .. } = question;
    if !(round.seconds.is_finite() && round.seconds > 0.0) {
        figure.failed = Some("it told no time".to_owned());
        figure.rounds.clear();
        return;
    }
    // A peer that takes long is asked for the judged samples alone.
    if let Some(of) = told["of"].as_f64() {
        figure.extrapolated = true;
        round.seconds *= f64::from(SAMPLES).powi(3) / of;
        // Most of it is reading the file.
        round.cpu_seconds = 0.0;
    }
    // Of the answer alone.
    if let Some(seconds) = told["cpu_seconds"].as_f64() {
        round.cpu_seconds = seconds;
    }
    // Of a program that Python has run.
    if let Some(bytes) = told["anonymous_bytes"].as_u64() {
        round.anonymous_bytes = bytes;
    }
    figure.rounds.push(round);
    for name in ["version", "triangles", "volume", "leaves"] {
        if let Some(value) = told.get(name) {
            figure.facts.insert(name.to_owned(), value.clone());
        }
    }
    if let Some(judged) = judged {
        let values: Vec<f64> =
            told["values"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
        figure.facts.extend(errors(&values, judged));
    }
}

/// Root mean square and greatest error, how many samples are on the wrong side of w = 0.5, and how errors are spread.
fn errors(values: &[f64], judged: &[f64]) -> Map<String, Value> {
    if values.len() != judged.len() {
        return Map::from_iter([("answers".to_owned(), values.len().into())]);
    }
    let off: Vec<f64> = values.iter().zip(judged).map(|(value, exact)| (value - exact).abs()).collect();
    let rms = (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt();
    // What is half-way lies on a face, and on either side.
    let clear = |exact: f64| (exact - 0.5).abs() > 1e-3;
    let wrong = values
        .iter()
        .zip(judged)
        .filter(|&(&value, &exact)| clear(exact) && (value >= 0.5) != (exact >= 0.5));
    let mut facts = Map::from_iter([
        ("rms_error".to_owned(), rms.into()),
        ("worst_error".to_owned(), off.iter().copied().fold(0.0, f64::max).into()),
        ("wrong_side".to_owned(), wrong.count().into()),
        ("judged".to_owned(), judged.len().into()),
    ]);
    Histogram::of(&off).tell(&mut facts);
    facts
}

/// The last column of what `sample` and `winding` print.
fn values_of(ran: &ProcessRun) -> Vec<f64> {
    let text = String::from_utf8_lossy(&ran.printed);
    text.lines().skip(1).filter_map(|line| line.rsplit(',').next()?.parse().ok()).collect()
}

/// The reason, without the command.
fn why(failure: &Failure) -> String {
    let Failure::Run(error) = failure else { return "it failed".to_owned() };
    let text = format!("{error:#}");
    match text.split_once(".question: ") {
        Some((command, reason)) if command.starts_with("cannot run") => {
            format!("cannot run Python: {reason}")
        }
        Some((_, reason)) => reason.trim_start_matches("exit status: 1: ").to_owned(),
        None => text,
    }
}

/// The Python of the environment that `bench-data/peers/setup` makes.
pub fn default_python(cache: &Path) -> OsString {
    cache.join("peers/bin/python").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_told() {
        let told = errors(&[0.0, 1.5, 0.6, 0.4], &[0.0, 1.0, 0.4, 0.5]);
        assert_eq!((&told["worst_error"], &told["wrong_side"]), (&json!(0.5), &json!(1)));
        assert!(errors(&[1.0], &[]).contains_key("answers"));
    }
}
