//! Documents: every command in them runs, every picture is drawn by a documented command, every message is one of the
//! program's.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Words of commands that need what a test has not: a window, a device, a server, a batch system, another program.
const NOT_RUN: [&str; 5] = ["brickfield view", "--backend vulkan", "https://", "sbatch ", "parallel "];
/// Words with which commands begin.
const BEGINNINGS: [&str; 9] =
    ["brickfield ", "echo ", "seq ", "timeout ", "parallel ", "sbatch ", "plan=$(", "shards=$(", "merge=$("];

/// The top of the repository.
fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text_of(page: &str) -> String {
    fs::read_to_string(top().join(page)).unwrap_or_else(|error| panic!("{page}: {error}"))
}

/// The pages of a folder of documents, not of those below it.
fn pages(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(top().join(folder)).expect("it can be listed");
    let names = entries.map(|entry| entry.expect("it is there").file_name().into_string().expect("text"));
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".md")).collect();
    names.sort();
    names.iter().map(|name| format!("{folder}/{name}")).collect()
}

/// Lines of indented blocks, and code spans in tables, that are commands.
fn commands(text: &str) -> Vec<String> {
    let mut commands = Vec::new();
    let (mut is_fenced, mut is_block, mut was_blank) = (false, false, true);
    for line in text.lines() {
        let bare = line.trim();
        if bare.starts_with("```") {
            is_fenced = !is_fenced;
        }
        is_block = !is_fenced && line.starts_with("    ") && (was_blank || is_block);
        was_blank = bare.is_empty();
        let spans = bare.split('`').skip(1).step_by(2).filter(|_| bare.starts_with('|') && !is_fenced);
        let lines = spans.chain(is_block.then_some(bare));
        commands.extend(
            lines.filter(|line| BEGINNINGS.iter().any(|begin| line.starts_with(begin))).map(str::to_owned),
        );
    }
    commands
}

fn is_run(command: &str) -> bool {
    NOT_RUN.iter().all(|words| !command.contains(words))
}

/// What documents take for the user's own files, and `bench-data`: as it is, or with three of the seventeen layers of its
/// toolpath, among them the one with the skirt and those that sections pass.
fn with_inputs(is_whole: bool) -> Scratch {
    let dir = Scratch::new();
    dir.file("part.gcode", toolpath());
    let wall = "G20\n(PERIMETER-0.25)\n(LAYER 1)\nG0 X0 Y0 Z0.2 W0\nM64 P8\nG1 X1 F60\nM64 P9\n(LAYER 2)\n\
                G0 X1 Y0 Z0.2 W-0.1\nM64 P8\nG1 X0\nM64 P9\n";
    dir.file("wall.nc", wall);
    let rods = [cuboid([0.0; 3], [8.0, 0.5, 0.5]), cuboid([4.0, 0.1, 0.1], [9.0, 0.4, 0.9])];
    dir.file("body.stl", binary_stl(12, &rods[0]));
    dir.file("lid.stl", binary_stl(12, &rods[1]));
    dir.file("part.stl", binary_stl(24, &rods.concat()));
    let (names, points) = ("xyz", sphere());
    let rows = |with_normals: bool| -> String {
        let row = |n: &[f64; 3]| {
            let [x, y, z] = n.map(|c| 5.0 * c);
            let normal = if with_normals { format!(" {} {} {}", n[0], n[1], n[2]) } else { String::new() };
            format!("{x} {y} {z}{normal}\n")
        };
        points.iter().map(row).collect()
    };
    let columns: String = ["", "n"]
        .iter()
        .flat_map(|n| names.chars().map(move |c| format!("property float {n}{c}\n")))
        .collect();
    dir.file("scan.xyz", rows(false));
    let head = format!("ply\nformat ascii 1.0\nelement vertex {}\n{columns}end_header\n", points.len());
    dir.file("scan.ply", head + &rows(true));
    for (name, seed) in [("scan.e57", "e57/one.e57"), ("site.laz", "las/points1.laz")] {
        dir.file(name, fs::read(top().join("fuzz/seeds").join(seed)).expect("a seed"));
    }
    dir.file("scan.mha", image());
    dir.file("points.csv", "x,y,z\n1,1,0.1\n4.5,0.25,0.25\n");
    dir.file("my.csv", "-0.5,-0.5\n0.5,-0.5\n0.5,0.5\n-0.5,0.5\n");
    let style = text_of("docs/guide/pictures.md");
    let style = style.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a style");
    dir.file("mine.toml", style);
    match is_whole {
        true => symlink(fs::canonicalize(example("")).expect("it is there"), dir.path("bench-data")),
        false => fs::create_dir(dir.path("bench-data"))
            .and_then(|()| fs::write(dir.path("bench-data/clover.gcode"), few_layers()))
            .and_then(|()| symlink(top().join("bench-data/machining"), dir.path("bench-data/machining"))),
    }
    .expect("it can be made");
    // The same for all pages, and their input has the same path from their folder.
    static BUILT: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    let build = |store: &str, more: &str| {
        let mut command = program();
        command.current_dir(dir.path("")).args(["build", "part.gcode", "-o", store, more]);
        command.args(part_or_all(WIDE_CELLS, "").split_whitespace());
        Run::from(command.output().expect("it runs")).ok();
        fs::read(dir.path(store)).expect("it is there")
    };
    let built = BUILT.get_or_init(|| [build("part.brf", "--identity"), build("print.brf", "--quiet")]);
    ["part.brf", "print.brf"].iter().zip(built).for_each(|(name, bytes)| drop(dir.file(name, bytes)));
    dir
}

/// The layers of the clover that end 1.5, 13.5 and 21 mm above the bed, none upon another, between the beginning of the file
/// and its end, which has the slicer's settings. What voids there are is a question of `voids.rs`.
fn few_layers() -> String {
    let begin = ";LAYER_CHANGE\n";
    let whole = text_of("bench-data/clover.gcode");
    let parts: Vec<&str> = whole.split(begin).collect();
    assert!(parts.len() == 18 && parts[14].starts_with(";Z:21\n"));
    let (_, end) = parts[17].split_once("M107\n").expect("the fan is turned off");
    // Each layer begins with what the one before it has fed.
    let fed =
        |layer: &str| layer.lines().filter_map(|line| line.split(" E").nth(1)).next_back().map(str::to_owned);
    let layer = |n: usize| format!("G92 E{}\n{begin}{}", fed(parts[n - 1]).expect("it feeds"), parts[n]);
    parts[0].to_owned() + &[1, 9, 14].map(layer).concat() + end
}

/// Three layers of two loops each, and a skirt.
fn toolpath() -> String {
    let layer = |n: u32| {
        let z = 0.2 * f64::from(n);
        let skirt = match n {
            1 => ";TYPE:Skirt/Brim\n;WIDTH:0.6\nG1 X-1 Y-1\nG1 X9 Y-1 E0.4632\n",
            _ => "",
        };
        format!(
            ";LAYER_CHANGE\n;Z:{z:.1}\n;HEIGHT:0.2\nG1 Z{z:.1} F600\n{skirt};TYPE:Perimeter\n;WIDTH:0.6\nG1 X0.5 Y0.5\n\
             G1 X8 Y0.5 E0.3474\nG1 X8 Y2.9 E0.1112\nG1 X0.5 Y2.9 E0.3474\nG1 X0.5 Y0.5 E0.1112\n;TYPE:Support material\n\
             ;WIDTH:0.6\nG1 X1 Y1.0\nG1 X7.5 Y1.0 E0.3011\nG1 X7.5 Y2.2 E0.0556\nG1 X1 Y2.2 E0.3011\n"
        )
    };
    let head = "; filament_diameter = 1.75\n; layer_height = 0.2\nG21\nG90\nM83\n".to_owned();
    head + &(1..=3).map(layer).collect::<String>()
}

/// An image of a ball of 8 steps of 0.05 in the rods, 40,000 within and 20,000 without.
fn image() -> Vec<u8> {
    let head = "ObjectType = Image\nNDims = 3\nOffset = 3 -0.3 -0.3\nElementSpacing = 0.05 0.05 0.05\nDimSize = 24 24 24\n\
                ElementType = MET_USHORT\nElementDataFile = LOCAL\n";
    let grey = |n: i32| {
        let away = [n % 24 - 12, n / 24 % 24 - 12, n / 576 - 12];
        if away.iter().map(|c| c * c).sum::<i32>() < 64 { 40_000u16 } else { 20_000 }
    };
    head.bytes().chain((0..24 * 24 * 24).flat_map(|n| grey(n).to_le_bytes())).collect()
}

/// Points spread evenly over the unit sphere, which are their own normals.
fn sphere() -> Vec<[f64; 3]> {
    let count = 300;
    let point = |n: i32| {
        let z = 1.0 - (2.0 * f64::from(n) + 1.0) / f64::from(count);
        let (radius, angle) = ((1.0 - z * z).sqrt(), f64::from(n) * 2.399_963);
        [radius * angle.cos(), radius * angle.sin(), z]
    };
    (0..count).map(point).collect()
}

/// Cells of the user's toolpath in commands that say nothing of them: half as wide again as they would be.
const WIDE_CELLS: &str = " --cell 0.12mm";

/// A command that gives what it gives in the document in a fraction of the time: pictures smaller than their usual size, and
/// wide cells. What the repository has a picture of is made as it says.
fn quicker(page: &str, command: &str) -> String {
    let drawn = command.split_whitespace().find(|word| word.ends_with("png"));
    let is_kept = drawn.is_some_and(|name| example("pictures").join(name).exists());
    let words: Vec<&str> = command.split(' ').collect();
    let mut quicker = command.to_owned();
    if words[0] != "brickfield" || is_kept {
        return quicker;
    }
    match words[1] {
        "render" => {
            let size = words.iter().position(|word| *word == "--size");
            match size {
                Some(at) => quicker = command.replace(words[at + 1], "200x150"),
                None => quicker += " --size 200x150",
            }
        }
        "build" if page.ends_with("/pictures.md") => {}
        "build"
            if words[2] == "part.gcode" && !command.contains("--cell") && !command.contains("--depth") =>
        {
            quicker += WIDE_CELLS;
        }
        "build" => quicker = command.replace("--cell 0.17mm", "--cell 0.4mm"),
        _ => {}
    }
    quicker
}

/// Runs the commands of a page from top to bottom in a folder of its own.
#[track_caller]
fn run_page(page: &str, is_whole: bool) -> Scratch {
    let commands: Vec<String> =
        commands(&text_of(page)).into_iter().filter(|command| is_run(command)).collect();
    let dir = if commands.is_empty() { Scratch::new() } else { with_inputs(is_whole) };
    let folder = Path::new(program().get_program()).parent().expect("a folder").to_owned();
    let path = std::env::join_paths(
        std::iter::once(folder).chain(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())),
    );
    let path = path.expect("paths");
    for command in &commands {
        let mut shell = Command::new("bash");
        let quicker = quicker(page, command);
        shell.arg("-c").arg(part_or_all(&quicker, command)).current_dir(dir.path(""));
        shell.env("PATH", &path).stdin(Stdio::null());
        let output = shell.output().expect("bash is there");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        // A machine without a driver has no devices to list, and says so.
        let no_driver = command.contains("--devices") && told.contains("Vulkan");
        assert!(output.status.success() || no_driver, "{page}: {command}\n{told}");
    }
    dir
}

#[test]
fn commands_are_found() {
    let text = "    brickfield build a.stl -o a.brf\n\nword\n    brickfield is no block\n\n| `brickfield info a` | `w` |\n\n```\n    \
                brickfield fenced\n```\n";
    assert_eq!(commands(text), ["brickfield build a.stl -o a.brf", "brickfield info a"]);
    assert!(commands(&text_of("README.md")).len() >= 12);
}

#[test]
fn commands_of_the_readme_run() {
    run_page("README.md", part_or_all(false, true));
}

#[test]
fn commands_of_guides_run() {
    let pages = pages("docs/guide");
    assert!(pages.len() >= 13);
    for page in pages.iter().filter(|page| !page.ends_with("/pictures.md")) {
        run_page(page, part_or_all(false, true));
    }
}

#[test]
fn commands_of_other_pages_run() {
    pages("docs").iter().for_each(|page| drop(run_page(page, part_or_all(false, true))));
}

#[test]
fn pictures_are_those_that_documented_commands_draw() {
    let dir = run_page("docs/guide/pictures.md", true);
    let folder = example("pictures");
    let names =
        fs::read_dir(&folder).expect("it can be listed").map(|entry| entry.expect("it is there").file_name());
    let names: Vec<_> = names.filter(|name| Path::new(name).extension() == Some(OsStr::new("png"))).collect();
    assert!(names.len() >= 3);
    for name in names {
        let drawn = fs::read(dir.path(name.to_str().expect("text")));
        let drawn = drawn.unwrap_or_else(|_| panic!("no command of docs/guide/pictures.md draws {name:?}"));
        assert!(
            drawn == fs::read(folder.join(&name)).expect("it is there"),
            "{name:?} is drawn otherwise now"
        );
    }
}

#[test]
fn options_of_commands_that_are_not_run_exist() {
    let all = ["README.md".to_owned()].into_iter().chain(pages("docs")).chain(pages("docs/guide"));
    let mut count = 0;
    for page in all {
        for command in commands(&text_of(&page)).iter().filter(|command| !is_run(command)) {
            let words = command[command.find("brickfield ").expect("the program")..].split([' ', '=', '\'']);
            let words: Vec<&str> = words.collect();
            let name = words[1];
            // Its window may have been left out of the program.
            let help = run(&[&name, &"--help"]).ok();
            for option in words.iter().filter(|word| word.starts_with("--")) {
                assert!(
                    help.contains(&format!("{option} ")) || help.contains(&format!("{option}\n")),
                    "{page}: {command}"
                );
                count += 1;
            }
        }
    }
    assert!(count >= 10);
}

/// Sources of the engine and the program, without the breaks of strings.
fn sources(folder: &Path, text: &mut String) {
    for entry in fs::read_dir(folder).expect("it can be listed") {
        let path = entry.expect("it is there").path();
        if path.is_dir() && path.file_name() != Some(OsStr::new("target")) {
            sources(&path, text);
        } else if path.extension() == Some(OsStr::new("rs")) {
            let lines = fs::read_to_string(&path).expect("text");
            let mut is_broken = false;
            for line in lines.lines() {
                let line = if is_broken { line.trim_start() } else { line };
                is_broken = line.ends_with('\\');
                *text += line.trim_end_matches('\\');
                *text += if is_broken { "" } else { "\n" };
            }
        }
    }
}

#[test]
fn messages_of_troubleshooting_are_those_of_the_program() {
    let page = text_of("docs/guide/troubleshooting.md");
    let mut text = String::new();
    ["engine", "tools"].iter().for_each(|folder| sources(&top().join(folder), &mut text));
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    let messages: BTreeSet<&str> = rows.collect();
    assert!(messages.len() >= 30);
    for message in messages {
        for part in message.split("...").map(str::trim).filter(|part| !part.is_empty()) {
            assert!(text.contains(part), "no message of the program has the words {part:?}");
        }
    }
}

#[test]
fn the_snippet_for_numpy_runs() {
    let page = text_of("docs/guide/numbers.md");
    let snippet =
        page.split("```python\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a snippet");
    let python = |code: &str, dir: &Scratch| {
        let output = Command::new("python3").arg("-c").arg(code).current_dir(dir.path("")).output();
        output.ok().filter(|output| output.status.success())
    };
    let dir = with_inputs(true);
    if python("import numpy", &dir).is_none() {
        eprintln!("NOT RUN: python3 has no numpy");
        return;
    }
    run(&[&"export", &dir.path("part.brf"), &"--level", &"2", &"-o", &dir.path("w.npy")]).ok();
    let told = String::from_utf8(python(snippet, &dir).expect("it runs").stdout).expect("text");
    let count = told.split(' ').next().and_then(|word| word.parse::<u32>().ok());
    assert!(count.is_some_and(|count| count > 1000) && told.contains("samples inside, mm"), "{told}");
}

#[test]
fn what_a_page_says_of_the_volumes_is_printed() {
    let dir = Scratch::new();
    let page = text_of("docs/guide/first-ten-minutes.md");
    let said: Vec<&str> =
        page.lines().filter(|line| line.starts_with("  volume ") || line.starts_with("  balance ")).collect();
    let input = example("clover.gcode");
    let store = dir.path("clover.brf");
    let printed = run(&[&"build", &input, &"-o", &store, &"--skip", &"auto", &"--cell", &"0.17mm"]).stdout;
    let lines: Vec<&str> = printed.lines().collect();
    assert!(said.len() == 2 && said.iter().all(|line| lines.contains(line)), "{said:#?} in {printed}");
}
