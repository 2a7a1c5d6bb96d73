//! How far is a mesh from the union it should be? See `mesh-distance --help`.

use brickfield_bench_data::judge::boundary::Union;
use brickfield_bench_data::judge::distance::{
    DistanceQuery, DistanceStatistics, MeshComparison, TriangleSource, compare,
};
use brickfield_bench_data::judge::read::{FileMesh, read};
use clap::Parser;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// How far a mesh and the boundary of {w >= 0.5} of a closed soup are from each other, both ways.
///
/// The boundary is where a facet separates outside from inside, by winding numbers of the file's own coordinates a
/// little above and below it. Points spread evenly over the mesh look for the nearest point of the boundary, and points
/// spread evenly over the boundary for the nearest triangle of the mesh. Distances to the boundary are up to 10 percent
/// or a fiftieth of a cell too large where facets are buried in other pieces, never too small; those to the mesh are
/// exact. The soup is held, 50 bytes a facet; a mesh in STL is read block by block.
#[derive(Parser)]
#[command(version)]
struct Cli {
    /// The closed soup: binary STL, binary PLY or OBJ
    soup: PathBuf,
    /// The mesh: binary STL, binary PLY or OBJ
    mesh: PathBuf,
    /// Edge of the mesh's cells, in the soup's unit: `cell` in what `brickfield build --json` prints
    #[arg(long)]
    cell: f64,
    /// Points on the mesh, and candidates for points on the boundary: those on buried parts of facets fall away
    #[arg(long, default_value_t = 100_000, value_parser = clap::value_parser!(u64).range(1..))]
    samples: u64,
    /// Also candidates for points on creases: edges of facets, and lines in which facets meet
    #[arg(long, default_value_t = 0)]
    creases: u64,
    /// Faces that meet at less than this many degrees form no crease
    #[arg(long, default_value_t = 20.0)]
    angle: f64,
    /// Walls and gaps are thin below this many cells; figures are also told without points where one is
    #[arg(long, default_value_t = 2.0)]
    thin: f64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print JSON, lengths in the soup's unit
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(&cli).and_then(|text| {
        write!(io::stdout(), "{text}").map_err(|e| format!("cannot write to standard output: {e}"))
    }) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("mesh-distance: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: &Cli) -> Result<String, String> {
    if !(cli.cell.is_finite() && cli.cell > 0.0) {
        return Err("--cell takes a positive length".into());
    }
    let told = |path: &Path, e| format!("{}: {e}", path.display());
    let soup = match read(&cli.soup).map_err(|e| told(&cli.soup, e))? {
        FileMesh::Soup(facets) => facets,
        FileMesh::Indexed(vertices, triangles) => {
            let corner = |v: u32| vertices.get(v as usize).map(|p| p.map(|c| c as f32));
            let facet = |t: &[u32; 3]| Some([corner(t[0])?, corner(t[1])?, corner(t[2])?]);
            let facets: Option<Vec<_>> = triangles.iter().map(facet).collect();
            facets
                .ok_or_else(|| format!("{}: a triangle has a vertex that is not there", cli.soup.display()))?
        }
    };
    if soup.iter().flatten().flatten().any(|c| !c.is_finite()) {
        return Err(format!("{}: a coordinate is not a number", cli.soup.display()));
    }
    let union = Union::new(soup);
    let mesh = TriangleSource::open(&cli.mesh).map_err(|e| told(&cli.mesh, e))?;
    let asked = DistanceQuery {
        samples: cli.samples,
        crease_samples: cli.creases,
        crease_degrees: cli.angle,
        seed: cli.seed,
        cell: cli.cell,
        thin: cli.thin * cli.cell,
    };
    let both = |e| format!("{} and {}: {e}", cli.soup.display(), cli.mesh.display());
    let comparison = compare(&union, &mesh, &asked).map_err(both)?;
    Ok(if cli.json { json(cli, mesh.count(), &comparison) } else { table(cli, mesh.count(), &comparison) })
}

fn sets(comparison: &MeshComparison) -> impl Iterator<Item = (&'static str, DistanceStatistics)> {
    let both = [("mesh", comparison.mesh), ("boundary", comparison.boundary)];
    both.into_iter().chain(comparison.creases.map(|creases| ("creases", creases)))
}

fn table(cli: &Cli, triangles: u64, comparison: &MeshComparison) -> String {
    let mut text =
        format!("{triangles} triangles; distances in cells of {}, and in the soup's unit\n", cli.cell);
    for (name, d) in sets(comparison) {
        let to = if name == "mesh" { "mesh to boundary" } else { &format!("{name} to mesh") };
        let _ = writeln!(
            text,
            "{to}: mean {:.4}, rms {:.4}, 99.9 % {:.4}, max {:.4} ({:.3e}, {:.3e}, {:.3e}, {:.3e}) at {:?}",
            d.mean / cli.cell,
            d.rms / cli.cell,
            d.p999 / cli.cell,
            d.max / cli.cell,
            d.mean,
            d.rms,
            d.p999,
            d.max,
            d.at.map(|c| c as f32)
        );
        if name == "creases" {
            continue;
        }
        let _ = writeln!(
            text,
            "    where walls and gaps are {} cells and more, at {} of {} points: 99.9 % {:.4}, max {:.4} ({:.3e}, {:.3e})",
            cli.thin,
            d.clear,
            d.count,
            d.clear_p999 / cli.cell,
            d.clear_max / cli.cell,
            d.clear_p999,
            d.clear_max
        );
    }
    text
}

fn json(cli: &Cli, triangles: u64, comparison: &MeshComparison) -> String {
    let mut text = format!("{{\"cell\": {}, \"triangles\": {triangles}", cli.cell);
    for (name, d) in sets(comparison) {
        let _ = write!(
            text,
            ", \"{name}\": {{\"samples\": {}, \"mean\": {}, \"rms\": {}, \"p999\": {}, \"max\": {}, \"at\": {:?}, \
             \"clear\": {}, \"clear_p999\": {}, \"clear_max\": {}}}",
            d.count, d.mean, d.rms, d.p999, d.max, d.at, d.clear, d.clear_p999, d.clear_max
        );
    }
    text + "}\n"
}
