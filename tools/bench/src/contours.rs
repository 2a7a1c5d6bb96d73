//! Contouring alone, asked of other programs: the same surface from the same samples, by turns with this one.
//!
//! Peers take signed distances to this program's own uniform mesh, in cells, at the samples of the store's deepest level: their
//! signs are those of the store, and dual contouring of samples needs distances. Whoever meshes functions is asked for the
//! sharp part as one.

use crate::child;
use crate::line;
use crate::peers::{Implementation, LIMIT, PEERS, PeerQuestion, command, put_question};
use crate::plan::{Bench, figure};
use crate::result::Results;
use crate::suites::out;
use crate::table::{TextTable, memory, number, range};
use brickfield_bench_data::inputs::{self, Spec};
use brickfield_engine::Silent;
use brickfield_engine::contour::{ContourOptions, MeshArrays, contour};
use brickfield_engine::store::Store;
use brickfield_terminal::failure::Failure;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::path::Path;

/// What tells these figures from others of peers.
const CELLS: &str = "cells";
/// Tolerances, in cells, of meshes that are free of intersections or, as the peers' are, not: 0 is uniform.
const TOLERANCES: [(f64, bool); 5] = [(0.0, true), (0.1, true), (0.1, false), (0.3, true), (0.3, false)];
/// Of OpenVDB, which bounds angles: 0 is uniform.
const ADAPTIVITIES: [f64; 3] = [0.0, 0.1, 0.5];
/// Bytes for decoded bricks.
const BRICK_BYTES: u64 = 8 << 20;

/// The input of the samples, and depths of its stores.
fn asked(quick: bool) -> (&'static Spec, [u8; 2]) {
    if quick { (&inputs::PILE_50K, [1, 2]) } else { (&inputs::PILE_1M, [3, 4]) }
}

/// All inputs.
pub fn inputs(quick: bool) -> [&'static Spec; 2] {
    [asked(quick).0, &inputs::PART]
}

/// Adds all questions.
pub fn ask(bench: &mut Bench<'_>, python: &OsStr, questions: &mut Vec<PeerQuestion>) -> Result<(), Failure> {
    let depths = asked(bench.quick).1;
    for input in inputs(bench.quick) {
        for depth in depths {
            let store = ContouredStore::prepare(bench, input, depth)?;
            store.ask_us(bench, questions);
            store.ask_about_samples(bench, python, questions)?;
            if input.name == inputs::PART.name {
                let soup = bench.cache.path(input);
                let told = json!({"soup": soup, "cells": store.cells(), "threads": bench.threads});
                let name = "fidget, dual contouring of a function";
                questions.push(store.ask(name, "fidget-contour", bench, told)?);
            }
        }
    }
    Ok(())
}

/// A store that is contoured.
struct ContouredStore {
    input: &'static Spec,
    depth: u8,
    /// Edge of a cell, in the input's unit.
    cell: f64,
}

impl ContouredStore {
    /// Builds it.
    fn prepare(bench: &mut Bench<'_>, input: &'static Spec, depth: u8) -> Result<ContouredStore, Failure> {
        let path = bench.input(input)?;
        let store = ContouredStore { input, depth, cell: 1.0 };
        let build = bench.build(&path, &store.file("brf"), &["--depth", &depth.to_string()]);
        let cell = bench.prepare(build)?["cell"].as_f64().unwrap_or(1.0);
        Ok(ContouredStore { cell, ..store })
    }

    /// Along the root cube.
    fn cells(&self) -> u32 {
        32 << self.depth
    }

    /// A name in the suite's folder.
    fn file(&self, ending: &str) -> String {
        format!("{}-{}.{ending}", self.input.name.trim_end_matches(".stl"), self.depth)
    }

    fn question(&self, name: &str, who: Implementation) -> PeerQuestion {
        let cells = self.cells();
        let figure = figure(PEERS, self.input, &format!("{name}, {cells}³ cells"), &[(CELLS, cells.into())]);
        PeerQuestion::new(figure, self.input, who)
    }

    /// From the store to arrays, and to a durable file.
    fn ask_us(&self, bench: &Bench<'_>, questions: &mut Vec<PeerQuestion>) {
        for (tolerance, intersection_free) in TOLERANCES {
            let mut how = String::new();
            if tolerance > 0.0 {
                how += &format!(", --tolerance {tolerance} cells");
            }
            if !intersection_free {
                how += ", --intersection-free no";
            }
            let length = tolerance * self.cell;
            let mesh = |ending: &str| {
                let mut line = line!["mesh", self.file("brf"), "-o", out(&format!("mesh.{ending}"))];
                line.extend(line!["--tolerance", length.to_string(), "--quiet", "--json"]);
                line.extend(
                    (!intersection_free).then_some(line!["--intersection-free", "no"]).into_iter().flatten(),
                );
                line.extend(bench.threads());
                Implementation::Us(vec![line], None)
            };
            let store = bench.folder.join(self.file("brf"));
            let arrays =
                Implementation::Here(Box::new(move || into_arrays(&store, length, intersection_free)));
            let name = format!("this program, store to arrays{how}");
            questions.push(self.question(&name, arrays).checked_by(mesh("ply")));
            questions.push(self.question(&format!("this program, store to STL{how}"), mesh("stl")));
        }
    }

    /// A question to a peer, which writes its mesh only when that is to be checked.
    fn ask(
        &self,
        name: &str,
        peer: &'static str,
        bench: &Bench<'_>,
        told: Value,
    ) -> Result<PeerQuestion, Failure> {
        let stem = name.replace(|letter: char| !letter.is_ascii_alphanumeric(), "-");
        let of = |ending: &str| format!("{stem}-{}", self.file(ending));
        let mut with_mesh = told.clone();
        with_mesh["mesh"] = out("mesh.ply").into();
        let plain = Implementation::Peer(peer, put_question(bench, &of("question"), &told)?);
        let check = Implementation::Peer(peer, put_question(bench, &of("check.question"), &with_mesh)?);
        Ok(self.question(name, plain).checked_by(check))
    }

    /// Distances to the uniform mesh, contoured.
    fn ask_about_samples(
        &self,
        bench: &mut Bench<'_>,
        python: &OsStr,
        questions: &mut Vec<PeerQuestion>,
    ) -> Result<(), Failure> {
        let (store, mesh) = (self.file("brf"), self.file("ply"));
        bench.prepare(line!["mesh", &store, "-o", &mesh, "--quiet"])?;
        let export =
            line!["export", &store, "--level", self.depth.to_string(), "-o", "w.npy", "--quiet", "--json"];
        let grid = bench.prepare(export)?;
        let (origin, spacing) = (&grid["origin"], &grid["spacing"]);
        let told = json!({
            "array": self.file("npy"), "origin": origin, "spacing": spacing, "threads": bench.threads,
        });
        let mut field = told.clone();
        (field["mesh"], field["samples"]) = (mesh.into(), grid["shape"][0].clone());
        let field = put_question(bench, "field.question", &field)?;
        bench.progress.phase("distances to the mesh", None, "");
        // If there are none, peers say so in their rows.
        let _ = child::run(command(python, "distance-field", &field), &bench.folder, Some(LIMIT));
        bench.progress.check()?;
        let plain = [
            ("trueform, dual contouring", "trueform-dual"),
            ("trueform, flying edges", "trueform-edges"),
            ("VTK, flying edges", "vtk-contour"),
        ];
        for (name, peer) in plain {
            questions.push(self.ask(name, peer, bench, told.clone())?);
        }
        for adaptivity in ADAPTIVITIES {
            let how = if adaptivity > 0.0 { format!(", adaptivity {adaptivity}") } else { String::new() };
            let name = format!("OpenVDB, volumeToMesh{how}");
            let mut told = told.clone();
            told["adaptivity"] = adaptivity.into();
            questions.push(self.ask(&name, "openvdb-contour", bench, told)?);
        }
        Ok(())
    }
}

/// Contours a store into memory; tells the triangles.
fn into_arrays(store: &Path, tolerance: f64, intersection_free: bool) -> Result<Value, Failure> {
    let store = Store::open(store, BRICK_BYTES)?;
    let options = ContourOptions { tolerance, intersection_free, ..ContourOptions::default() };
    let summary = contour(&store, &options, &mut MeshArrays::default(), &Silent)?;
    Ok(json!({"triangles": summary.triangles}))
}

/// Who contours how fast.
pub fn table(results: &Results) -> TextTable {
    let mut table = TextTable::new(&[
        "input",
        "who",
        "s",
        "(range)",
        "processor time, s",
        "memory",
        "triangles",
        "million triangles/s",
        "pairs",
    ]);
    for figure in results.figures.iter().filter(|figure| figure.suite == PEERS && figure.at(CELLS).is_some())
    {
        let mut row = vec![figure.input.clone(), figure.job.clone()];
        match &figure.failed {
            Some(why) => {
                row.push(format!("failed: {why}"));
                row.resize(table.head.len(), "–".to_owned());
            }
            None => {
                let seconds = figure.seconds();
                let fact = |name: &str| figure.facts.get(name);
                let triangles = fact("triangles").and_then(Value::as_f64).unwrap_or(0.0);
                if let Some(version) = fact("version").and_then(Value::as_str) {
                    row[1] = row[1].replacen(',', &format!(" {version},"), 1);
                }
                row.extend([
                    number(seconds.median),
                    range(seconds),
                    number(figure.cpu_seconds().median),
                    memory(figure),
                    triangles.to_string(),
                    number(1e-6 * triangles / seconds.median),
                    fact("pairs").map_or("–".to_owned(), Value::to_string),
                ]);
            }
        }
        table.rows.push(row);
    }
    table
}
