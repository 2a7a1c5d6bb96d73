//! How much material do beads and meshes hold? See `judge-volumes --help`.

mod against;

use brickfield_bench_data::judge::gcode::{self, GcodeBeads, ReadOptions};
use brickfield_bench_data::judge::monte_carlo::{
    BeadSegments, CountBy, SampleMean, VolumeEstimates, soup_volumes,
};
use brickfield_bench_data::judge::read::{FileMesh, read};
use clap::{Parser, ValueEnum};
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Volumes of toolpaths and closed meshes by random points, and a table of them beside what brickfield says.
///
/// Prints the volume of the union, the integral of w and the overlap, the integral of w - 1 where w is 1 or more, each
/// with three standard errors. A G-code file has its beads as stadiums with round ends, and w counts passes by the rule of
/// docs/passes.md. The reader, the rule and the points are the judge's own: no code is brickfield's.
#[derive(Parser)]
#[command(version)]
struct Cli {
    /// G-code (not compressed), binary STL, binary PLY or OBJ
    file: PathBuf,
    /// Points, drawn in pairs
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(2..=1 << 30))]
    points: u32,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Leave out a feature, as "Skirt/Brim"; may be given again
    #[arg(long)]
    skip: Vec<String>,
    /// What w counts
    #[arg(long, value_enum, default_value_t = Counted::Passes)]
    count: Counted,
    /// Diameter of the filament, mm, instead of the file's or 1.75
    #[arg(long)]
    filament: Option<f64>,
    /// A brickfield program: build stores of the file with it and print its volumes beside the judge's; exit status 1 if
    /// one is off by more than both errors
    #[arg(long, value_name = "PROGRAM")]
    against: Option<PathBuf>,
    /// Cells of those stores, in layers
    #[arg(long, value_delimiter = ',', default_values_t = [0.5, 0.75, 1.0, 1.05, 1.5, 3.0])]
    cells: Vec<f64>,
    /// Height of a layer in mm [default: that of most of the beads' length]
    #[arg(long)]
    layer: Option<f64>,
    /// Seconds that a store may take
    #[arg(long, default_value_t = 180)]
    limit: u64,
    /// Folder for the stores; each is removed when it has been asked
    #[arg(long, default_value_os_t = std::env::temp_dir())]
    folder: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Counted {
    /// Stretches that do not come back onto themselves
    Passes,
    /// Runs without travel
    Beads,
}

/// What the judge knows of a file.
struct JudgedFile {
    volumes: VolumeEstimates,
    /// Fed, and sections times lengths, mm³: of toolpaths.
    fed: Option<[f64; 2]>,
    /// The height of most of the beads' length.
    layer: Option<f64>,
    /// What was counted, in words.
    what: String,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let judged = run(&cli).and_then(|(text, agrees)| {
        let written = write!(io::stdout(), "{text}");
        written.map_err(|e| format!("cannot write to standard output: {e}")).map(|()| agrees)
    });
    match judged {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("judge-volumes: {message}");
            ExitCode::FAILURE
        }
    }
}

/// What to print, and whether the program that was asked agrees.
fn run(cli: &Cli) -> Result<(String, bool), String> {
    let verdict = judge(cli)?;
    let mut text = format!("{}: {}\n", cli.file.display(), verdict.what);
    if let Some([fed, sections]) = verdict.fed {
        let _ = writeln!(text, "fed {fed:.4} mm³, sections times lengths {sections:.4} mm³");
    }
    let VolumeEstimates { union, winding, overlap } = verdict.volumes;
    for (name, estimate) in [("union", union), ("integral of w", winding), ("overlap", overlap)] {
        let _ = writeln!(text, "{name} {} mm³", told(estimate));
    }
    let Some(program) = &cli.against else { return Ok((text, true)) };
    let (table, agrees) = against::table(cli, program, &verdict)?;
    Ok((text + &table, agrees))
}

fn judge(cli: &Cli) -> Result<JudgedFile, String> {
    let ending = cli.file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    if ["gcode", "nc", "g", "gco"].contains(&ending.as_str()) {
        return judge_toolpath(cli);
    }
    let said = |e| format!("{}: {e}", cli.file.display());
    let soup = match read(&cli.file).map_err(|e| said(e.to_string()))? {
        FileMesh::Soup(facets) => facets,
        FileMesh::Indexed(vertices, triangles) => {
            let corner = |v: u32| vertices.get(v as usize).map(|p| p.map(|c| c as f32));
            let facet = |t: &[u32; 3]| Some([corner(t[0])?, corner(t[1])?, corner(t[2])?]);
            let facets: Option<Vec<_>> = triangles.iter().map(facet).collect();
            facets.ok_or_else(|| said("a triangle has a vertex that is not there".into()))?
        }
    };
    if soup.iter().flatten().flatten().any(|c| !c.is_finite()) {
        return Err(said("a coordinate is not a number".into()));
    }
    let what = format!("{} facets, {} points", soup.len(), cli.points);
    Ok(JudgedFile { volumes: soup_volumes(soup, cli.points / 2, cli.seed), fed: None, layer: None, what })
}

fn judge_toolpath(cli: &Cli) -> Result<JudgedFile, String> {
    let said = |e: String| format!("{}: {e}", cli.file.display());
    let text = std::fs::read(&cli.file).map_err(|e| said(format!("cannot read the file: {e}")))?;
    let options = ReadOptions { skip: cli.skip.clone(), filament: cli.filament };
    let path = gcode::read(&text, &options).map_err(|e| said(e.to_string()))?;
    let (count, name) = match cli.count {
        Counted::Passes => (CountBy::Passes, "passes"),
        Counted::Beads => (CountBy::Beads, "beads"),
    };
    let beads = BeadSegments::new(&path, count);
    if beads.segments() == 0 {
        return Err(said("no move lays material".into()));
    }
    let what = format!(
        "{} beads, {} segments, {} {name}, {} points",
        path.beads.len(),
        beads.segments(),
        beads.owners(),
        cli.points
    );
    let (sections, layer) = sections(&path);
    let volumes = beads.volumes(cli.points / 2, cli.seed);
    Ok(JudgedFile { volumes, fed: Some([path.fed, sections]), layer: Some(layer), what })
}

/// Sections times lengths, and the height of most of the length, in hundredths of a mm.
fn sections(path: &GcodeBeads) -> (f64, f64) {
    let (mut sum, mut heights) = (0.0, std::collections::BTreeMap::<u64, f64>::new());
    for bead in &path.beads {
        for (ends, section) in bead.points.windows(2).zip(&bead.sections) {
            let length = (0..3).map(|k| (ends[1][k] - ends[0][k]).powi(2)).sum::<f64>().sqrt();
            sum += section.area() * length;
            *heights.entry((section.height * 100.0).round() as u64).or_default() += length;
        }
    }
    let most = heights.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    (sum, most.map_or(0.0, |(height, _)| height as f64 / 100.0))
}

/// A value with three standard errors, and as many digits as they leave.
fn told(SampleMean { value, error }: SampleMean) -> String {
    value_with(value, 3.0 * error)
}

fn value_with(value: f64, error: f64) -> String {
    let digits = if error > 0.0 { (1.0 - error.log10().floor()).clamp(0.0, 6.0) as usize } else { 3 };
    format!("{value:.digits$} ± {error:.digits$}")
}

/// A path's last part, for tables.
fn short(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
