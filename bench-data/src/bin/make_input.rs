//! `make-input`: writes generated inputs to files, and judges meshes.

use brickfield_bench_data::inputs;
use brickfield_bench_data::passes::{PassFile, pass_files};
use brickfield_bench_data::pile::{bead_pile, lattice_pile, random_pile, sharp_part};
use brickfield_bench_data::shapes::{
    Polygon, cuboid, extrude, icosphere, octahedron, slant, spiked_cube, spiral_tube, torus,
};
use brickfield_bench_data::write::{self, HashingWriter, StlWriter};
use brickfield_bench_data::{Mesh, judge};
use clap::{Args, Parser, Subcommand};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Generated test and benchmark inputs, the same bytes on every machine.
///
/// The ending of the output names the format: .stl and .ply are binary, .obj is text.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Args)]
struct Output {
    /// File to write: .stl, .ply or .obj
    #[arg(short, long)]
    output: PathBuf,
    /// Write STL and PLY as text
    #[arg(long)]
    ascii: bool,
}

#[derive(Subcommand)]
enum Command {
    /// The benchmark's pile of deposited beads (STL only, streamed)
    Pile {
        /// Facets, rounded to a multiple of 500
        #[arg(long, default_value_t = 1_000_000)]
        triangles: u64,
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Sides of the box to fill, mm
        #[arg(long, num_args = 3, default_values_t = [100.0, 100.0, 12.0])]
        size: Vec<f64>,
        #[command(flatten)]
        to: Output,
    },
    /// Random overlapping, nested, reversed and doubled pieces
    Random {
        #[arg(long, default_value_t = 20)]
        pieces: usize,
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        to: Output,
    },
    /// The same on a coarse integer grid: faces coincide, in lattice planes and at 45 degrees
    Lattice {
        #[arg(long, default_value_t = 20)]
        pieces: usize,
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        to: Output,
    },
    /// A block with bosses and pockets in its sides: boxes, wedges and cylinders, turned at random; all edges sharp
    Part {
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        to: Output,
    },
    /// A box of 10 mm
    Box(Output),
    /// The box turned by 0.5 rad about (1, 2, 3)
    RotatedBox(Output),
    /// A sphere of radius 10 mm with 20·4^n facets
    Sphere {
        #[arg(long, default_value_t = 5)]
        subdivisions: u32,
        #[command(flatten)]
        to: Output,
    },
    /// A torus of radii 10 and 3 mm
    Torus(Output),
    /// A tube along a helix that overlaps itself
    Spiral(Output),
    /// A prism with square teeth, every face parallel to two axes
    Gear(Output),
    /// An L-shaped prism
    Ell(Output),
    /// A star with 24 facets
    Star(Output),
    /// The rhombic dodecahedron: every face at 45 degrees to two axes
    Dodecahedron(Output),
    /// |x| + |y| + |z| = 10
    Octahedron(Output),
    /// A box sheared by 45 degrees
    Slant(Output),
    /// An input of `brickfield-bench` by its file's name, but for those that are swept along toolpaths
    Bench {
        name: String,
        /// The file of what it is made from, of those with cracks
        #[arg(long)]
        base: Option<PathBuf>,
        #[arg(short, long)]
        output: PathBuf,
    },
    /// The toolpaths of `tests/data/passes`, with a table of their volumes in closed form
    Passes {
        /// Folder to write to
        #[arg(short, long)]
        output: PathBuf,
    },
    /// Judge the mesh in a binary STL, binary PLY or OBJ file; exit status 1 unless closed and manifold
    Check {
        /// File to read
        file: PathBuf,
    },
}

fn main() -> ExitCode {
    match run(Cli::parse().command) {
        Ok(status) => status,
        Err(message) => {
            eprintln!("make-input: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<ExitCode, String> {
    let (mesh, to) = match command {
        Command::Pile { triangles, seed, size, to } => {
            return pile(triangles, seed, [size[0], size[1], size[2]], &to).map(|()| ExitCode::SUCCESS);
        }
        Command::Bench { name, base, output } => {
            return bench(&name, base.as_deref(), &output).map(|()| ExitCode::SUCCESS);
        }
        Command::Passes { output } => return passes(&output).map(|()| ExitCode::SUCCESS),
        Command::Check { file } => return check(&file),
        Command::Random { pieces, seed, to } => (Mesh::merged(&random_pile(seed, pieces)), to),
        Command::Lattice { pieces, seed, to } => (Mesh::merged(&lattice_pile(seed, pieces, 1, 32)), to),
        Command::Part { seed, to } => (Mesh::merged(&sharp_part(seed)), to),
        Command::Sphere { subdivisions, to } => (icosphere(subdivisions.min(11), 10.0), to),
        Command::Box(to) => (cuboid([0.0; 3], [10.0; 3]), to),
        Command::RotatedBox(to) => (cuboid([0.0; 3], [10.0; 3]).rotated([1.0, 2.0, 3.0], 0.5), to),
        Command::Torus(to) => (torus(10.0, 3.0, 96, 32), to),
        Command::Spiral(to) => (spiral_tube(10, 64, 10.0, 1.2, 2.0), to),
        Command::Gear(to) => (extrude(&Polygon::gear(1.0), 0.0, 4.0), to),
        Command::Ell(to) => (extrude(&Polygon::ell(10.0, 4.0), 0.0, 5.0), to),
        Command::Star(to) => (spiked_cube(4.0, 8.0), to),
        Command::Dodecahedron(to) => (spiked_cube(5.0, 5.0), to),
        Command::Octahedron(to) => (octahedron(10.0), to),
        Command::Slant(to) => (slant([10.0, 6.0, 8.0]), to),
    };
    save(&mesh, &to).map(|()| ExitCode::SUCCESS)
}

fn check(file: &Path) -> Result<ExitCode, String> {
    let report = judge::mesh::check_file(file).map_err(|e| format!("{}: {e}", file.display()))?;
    say(format_args!("{report}"))?;
    Ok(if report.is_closed_manifold() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn pile(triangles: u64, seed: u64, size: [f64; 3], to: &Output) -> Result<(), String> {
    if ending(&to.output) != "stl" || to.ascii {
        return Err("a pile is written as binary STL: name the output *.stl, without --ascii".into());
    }
    if size.iter().any(|&s| !(s.is_finite() && s > 0.0)) {
        return Err("--size takes three positive lengths".into());
    }
    let pile = bead_pile(seed, triangles, size);
    say(format_args!(
        "{} beads in {} layers, {:.3} mm wide, {:.3} mm high, {:.2} mm long",
        pile.beads(),
        pile.layers(),
        pile.width(),
        pile.height(),
        pile.length()
    ))?;
    written(to, pile.triangles(), |out| {
        let mut writer = StlWriter::new(out, pile.triangles())?;
        pile.into_iter().try_for_each(|bead| writer.mesh(&bead))?;
        writer.finish().map(drop)
    })
}

fn bench(name: &str, base: Option<&Path>, output: &Path) -> Result<(), String> {
    let spec = inputs::ALL.iter().find(|spec| spec.name == name).ok_or_else(|| {
        let names: Vec<&str> = inputs::ALL.iter().map(|spec| spec.name).collect();
        format!("there is no input {name}; there are {}", names.join(", "))
    })?;
    let written = hashed(output, |out| spec.write(base, out))?;
    say(format_args!("{written}"))
}

fn passes(folder: &Path) -> Result<(), String> {
    say(format_args!("{:<20} {:>6} {:>10} {:>10}", "file", "passes", "union", "overlap"))?;
    for PassFile { name, gcode, passes, union, overlap } in pass_files() {
        let path = folder.join(name);
        std::fs::write(&path, gcode).map_err(|e| format!("cannot write {}: {e}", path.display()))?;
        say(format_args!("{name:<20} {passes:>6} {union:>10.5} {overlap:>10.5}"))?;
    }
    Ok(())
}

fn save(mesh: &Mesh, to: &Output) -> Result<(), String> {
    let kind = ending(&to.output);
    // Before the file is created, or a mistyped name leaves an empty one.
    if !["stl", "ply", "obj"].contains(&kind) {
        return Err(format!("{}: the ending is not .stl, .ply or .obj", to.output.display()));
    }
    written(to, mesh.triangles.len() as u64, |out| match (kind, to.ascii) {
        ("stl", false) => write::stl(out, mesh),
        ("stl", true) => write::stl_ascii(out, "generated", mesh),
        ("ply", false) => write::ply_binary(out, mesh),
        ("ply", true) => write::ply_ascii(out, mesh),
        _ => write::obj(out, mesh),
    })
}

fn ending(path: &Path) -> &str {
    path.extension().and_then(|e| e.to_str()).unwrap_or("")
}

/// Opens the output, lets `body` fill it, and reports what was written.
fn written(
    to: &Output,
    facets: u64,
    body: impl FnOnce(&mut BufWriter<HashingWriter<File>>) -> io::Result<()>,
) -> Result<(), String> {
    let written = hashed(&to.output, body)?;
    say(format_args!("{facets} facets, {written}"))
}

/// Opens the output, lets `body` fill it, and says how many bytes it has and their hash.
fn hashed(
    output: &Path,
    body: impl FnOnce(&mut BufWriter<HashingWriter<File>>) -> io::Result<()>,
) -> Result<String, String> {
    let fail = |e: io::Error| format!("cannot write {}: {e}", output.display());
    let file = File::create(output).map_err(fail)?;
    let mut out = BufWriter::with_capacity(1 << 20, HashingWriter::new(file));
    body(&mut out).and_then(|()| out.flush()).map_err(fail)?;
    let hashed = out.get_ref();
    Ok(format!("{} bytes, FNV-1a {:016x}", hashed.bytes(), hashed.hash()))
}

/// A line on standard output; a reader that went away is an error, not a panic.
fn say(line: std::fmt::Arguments<'_>) -> Result<(), String> {
    writeln!(io::stdout(), "{line}").map_err(|e| format!("cannot write to standard output: {e}"))
}
