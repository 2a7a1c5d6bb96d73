//! The suite `unions`: Table 2 of Peelar et al. 2019, the union of more and more beads, from an STL to a durable STL. How
//! far each mesh is from the true union is found once, before times are measured.

use crate::line;
use crate::plan::{Bench, CommandLine, Job};
use crate::suites::out;
use anyhow::Context;
use brickfield_bench_data::inputs::{self, PILE_SIZE, Spec};
use brickfield_bench_data::judge::boundary::Union;
use brickfield_bench_data::judge::distance::{DistanceQuery, MeshComparison, TriangleSource, compare};
use brickfield_bench_data::judge::read::{FileMesh, read};
use brickfield_bench_data::pile::{FACETS_PER_BEAD, bead_pile};
use brickfield_terminal::failure::Failure;
use serde_json::{Map, Value};
use std::path::Path;

/// Beads, and the depth of their mesh.
struct Row {
    input: &'static Spec,
    beads: u64,
    /// The least at which 999 of 1000 points of the mesh are within a twentieth of a bead's width of the true union.
    depth: u8,
}

/// The paper's took 20 s, 4 min, 40 min and 6 h.
static TABLE_2: [Row; 4] = [
    Row { input: &inputs::PILE_5K, beads: 10, depth: 1 },
    Row { input: &inputs::PILE_50K, beads: 100, depth: 2 },
    Row { input: &inputs::PILE_500K, beads: 1_000, depth: 4 },
    Row { input: &inputs::PILE_5M, beads: 10_000, depth: 5 },
];

/// Points on either side, and of quick runs.
const SAMPLES: [u64; 2] = [100_000, 10_000];

/// The rows that are measured.
fn rows(quick: bool) -> &'static [Row] {
    if quick { &TABLE_2[..2] } else { &TABLE_2 }
}

/// The inputs.
pub fn inputs(quick: bool) -> Vec<&'static Spec> {
    rows(quick).iter().map(|row| row.input).collect()
}

/// The jobs.
pub fn jobs(bench: &mut Bench<'_>) -> Result<Vec<Job>, Failure> {
    let mut jobs = Vec::new();
    for row in rows(bench.quick) {
        let path = bench.input(row.input)?;
        let build = bench.build(&path, &out("union.brf"), &["--depth", &row.depth.to_string()]);
        let mut mesh = line!["mesh", out("union.brf"), "-o", out("union.stl"), "--quiet", "--json"];
        mesh.extend(bench.threads());
        let known = truth(bench, row, &path, [&build, &mesh])?;
        let at = [("beads", row.beads as f64), ("depth", f64::from(row.depth))];
        let name = format!("union of {} beads, depth {}", row.beads, row.depth);
        let job = Job::new("unions", row.input, &name, &at, vec![build, mesh]).reading(&[&path]);
        jobs.push(Job { known, ..job });
    }
    Ok(jobs)
}

/// How far the mesh and the true union are from each other, in widths of a bead.
fn truth(
    bench: &Bench<'_>,
    row: &Row,
    pile: &Path,
    [build, mesh]: [&CommandLine; 2],
) -> Result<Map<String, Value>, Failure> {
    bench.empty_out()?;
    let cell = bench.prepare(build.clone())?["cell"].as_f64().context("build told no cell")?;
    bench.prepare(mesh.clone())?;
    bench.progress.phase("comparing with the true union", None, "");
    let told = || format!("{}: the mesh cannot be compared with the true union", row.input.name);
    let FileMesh::Soup(soup) = read(pile).with_context(told)? else { unreachable!("an STL file") };
    let asked = DistanceQuery {
        samples: SAMPLES[usize::from(bench.quick)],
        crease_samples: 0,
        crease_degrees: 20.0,
        seed: 1,
        cell,
        thin: 2.0 * cell,
    };
    let triangles = TriangleSource::open(&bench.folder.join(out("union.stl"))).with_context(told)?;
    let MeshComparison { mesh, boundary, .. } =
        compare(&Union::new(soup), &triangles, &asked).with_context(told)?;
    let width = bead_pile(1, row.beads * u64::from(FACETS_PER_BEAD), PILE_SIZE).width();
    let facts = [
        ("width_cells", width / cell),
        ("mesh_p999_widths", mesh.p999 / width),
        ("mesh_max_widths", mesh.max / width),
        ("boundary_p999_widths", boundary.p999 / width),
        ("boundary_clear_p999_widths", boundary.clear_p999 / width),
    ];
    Ok(facts.into_iter().map(|(name, value)| (name.to_owned(), value.into())).collect())
}
