//! Stores of a file by the program under judgement, and its volumes beside the judge's.

use super::{Cli, Counted, JudgedFile, short, value_with};
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What the program says of one store: union and overlap, each with its error, by the source and by the store alone.
struct StatedVolumes {
    source: [[f64; 2]; 2],
    store: [[f64; 2]; 2],
    seconds: f64,
}

/// A table in Markdown, a row a size of cells, and whether all rows agree with the judge.
pub fn table(cli: &Cli, program: &Path, verdict: &JudgedFile) -> Result<(String, bool), String> {
    let layer =
        cli.layer.or(verdict.layer).ok_or("a mesh needs --layer, to which cells are in proportion")?;
    let judged = [verdict.volumes.union, verdict.volumes.overlap].map(|e| [e.value, 3.0 * e.error]);
    let mut text = format!(
        "\n| {} | cells, mm | union | overlap | union by the store alone | overlap | build, s |\n|---|---|---|---|---|---|---|\n",
        short(&cli.file)
    );
    let _ = writeln!(text, "| judge | | {} | {} | | | |", cell(judged[0]), cell(judged[1]));
    let mut agrees = true;
    for &layers in &cli.cells {
        let edge = layers * layer;
        let row = |what: String| format!("| {layers} layers | {edge:.4} | {what} |\n");
        let Some(said) = ask(cli, program, edge)? else {
            text += &row(format!("more than {} s | | | |", cli.limit));
            continue;
        };
        let mut cells = Vec::new();
        for values in [said.source, said.store] {
            for (value, judged) in values.iter().zip(judged) {
                // Coordinates of meshes are rounded to single precision by their files, and to a lattice by the program.
                let rounding = 1e-6 * judged[0];
                let is_near = (value[0] - judged[0]).abs() <= value[1].hypot(judged[1]) + rounding;
                agrees &= is_near;
                cells.push(cell(*value) + if is_near { "" } else { " **off**" });
            }
        }
        text += &row(format!("{} | {:.1}", cells.join(" | "), said.seconds));
    }
    Ok((text, agrees))
}

fn cell([value, error]: [f64; 2]) -> String {
    value_with(value, error)
}

/// Builds a store and asks for its volumes; `None` if that takes too long.
fn ask(cli: &Cli, program: &Path, edge: f64) -> Result<Option<StatedVolumes>, String> {
    let store = cli.folder.join(format!("judge-{}.brf", std::process::id()));
    let mut build = Command::new(program);
    build.arg("build").arg(&cli.file).arg("-o").arg(&store).args(["--cell", &format!("{edge}mm"), "--json"]);
    for name in &cli.skip {
        build.args(["--skip", name]);
    }
    if let Some(filament) = cli.filament {
        build.args(["--filament", &format!("{filament}mm")]);
    }
    if cli.count == Counted::Beads {
        build.args(["--count", "beads"]);
    }
    let began = Instant::now();
    let built = within(cli.limit, build);
    let seconds = began.elapsed().as_secs_f64();
    let answer = built.and_then(|built| match built {
        None => Ok(None),
        Some(_) => {
            let mut info = Command::new(program);
            info.arg("info").arg(&store).args(["--volume", "--json"]);
            within(cli.limit, info)
        }
    });
    // An unfinished store has a second file.
    for ending in ["", ".part"] {
        let mut name = store.clone().into_os_string();
        name.push(ending);
        let _ = std::fs::remove_file(name);
    }
    let Some(json) = answer? else { return Ok(None) };
    let of = |object: &str| {
        let number = |key: &str| number(&json, object, key);
        Some([[number("union")?, number("union_error")?], [number("overlap")?, number("overlap_error")?]])
    };
    match (of("source_volumes"), of("volumes")) {
        (Some(source), Some(store)) => Ok(Some(StatedVolumes { source, store, seconds })),
        _ => Err(format!("{}: no volumes in what info says", program.display())),
    }
}

/// What a command prints, `None` if it has to be ended after so many seconds.
fn within(seconds: u64, mut command: Command) -> Result<Option<String>, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let said = |e: std::io::Error| format!("{name}: {e}");
    let mut child =
        command.stdout(Stdio::piped()).stderr(Stdio::null()).stdin(Stdio::null()).spawn().map_err(said)?;
    let mut output = child.stdout.take().ok_or_else(|| format!("{name}: no output"))?;
    let reader = std::thread::spawn(move || {
        let mut text = String::new();
        std::io::Read::read_to_string(&mut output, &mut text).map(|_| text)
    });
    let end = Instant::now() + Duration::from_secs(seconds);
    let status = loop {
        match child.try_wait().map_err(said)? {
            Some(status) => break status,
            None if Instant::now() > end => {
                child.kill().map_err(said)?;
                child.wait().map_err(said)?;
                return Ok(None);
            }
            None => std::thread::sleep(Duration::from_millis(20)),
        }
    };
    let text = reader.join().map_err(|_| format!("{name}: its output is lost"))?.map_err(said)?;
    if !status.success() {
        return Err(format!("{name} fails: {status}"));
    }
    Ok(Some(text))
}

/// The number of a key in the first object of this name.
fn number(json: &str, object: &str, key: &str) -> Option<f64> {
    let inside = &json[json.find(&format!("\"{object}\":"))?..];
    let key = format!("\"{key}\":");
    let value = inside[inside.find(&key)? + key.len()..].trim_start();
    value[..value.find([',', '\n', '}'])?].trim().parse().ok()
}
