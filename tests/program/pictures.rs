//! `brickfield slice` and `brickfield render`, held against `winding`, the truth, and pictures that somebody has looked at.

use crate::support::*;
use brickfield_engine::picture::Scale;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A picture: width, height, and pixels without their opacity.
struct Pixels(usize, usize, Vec<[u8; 3]>);

fn read(path: &Path) -> Pixels {
    let file = std::io::BufReader::new(std::fs::File::open(path).expect("it is there"));
    let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("it fits")];
    let info = reader.next_frame(&mut bytes).expect("all of it");
    assert_eq!(info.color_type, png::ColorType::Rgb);
    Pixels(info.width as usize, info.height as usize, bytes.as_chunks::<3>().0.to_vec())
}

fn slice(store: &Path, out: &Path, more: &[&str]) -> Value {
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"slice", &store, &"-o", &out, &"--json"];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    run(&args).json()
}

#[test]
fn pixels_are_the_exact_winding_numbers() {
    let dir = Scratch::new();
    for (name, axis, at) in
        [("clover_beads", "--z", "9.1"), ("overlap_boxes", "--x", "8"), ("clover_beads", "--y", "97.3")]
    {
        let store = dir.store(name, 2);
        let out = dir.path("s.png");
        let said = slice(&store, &out, &[axis, at, "--no-legend", "--samples"]);
        let Pixels(width, height, pixels) = read(&out);
        assert_eq!(said["size"], serde_json::json!([width, height]));
        let number = |value: &Value| value.as_f64().expect("a number");
        let (pixel, origin) = (number(&said["pixel"]), [0, 1, 2].map(|a| number(&said["origin"][a])));
        let sides = [[1, 2], [0, 2], [0, 1]][["--x", "--y", "--z"].iter().position(|a| *a == axis).unwrap()];
        // The layer of samples that is nearest to the plane.
        let across = 3 - sides[0] - sides[1];
        let spacing =
            run(&[&"export", &store, &"--level", &"2", &"-o", &dir.path("w.npy"), &"--json"]).json();
        let first = number(&spacing["origin"][across]);
        let layer = first + ((origin[across] - first) / pixel + 0.5).floor() * pixel;
        let chosen: Vec<usize> = (0..width * height).step_by(11).collect();
        // w at all chosen pixels, at some coordinate of the third axis.
        let exact_at = |coordinate: f64| -> Vec<f64> {
            let mut csv = String::new();
            for n in &chosen {
                let mut point = [coordinate; 3];
                point[sides[0]] = origin[sides[0]] + (n % width) as f64 * pixel;
                point[sides[1]] = origin[sides[1]] + (height - 1 - n / width) as f64 * pixel;
                csv += &format!("{},{},{}\n", point[0], point[1], point[2]);
            }
            let exact = run_with(&[&"winding", &stl(name), &"--points", &"-"], &csv).ok();
            exact.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
        };
        let (there, nearest) = (exact_at(origin[across]), exact_at(layer));
        let (mut seen, mut wrong) = (std::collections::BTreeSet::new(), [0, 0]);
        for ((n, there), nearest) in chosen.iter().zip(there).zip(nearest) {
            // Inside and outside are the plane's own, and w that of the nearest sample on the same side.
            if (there >= 1.0) == (nearest >= 1.0) {
                assert_eq!(Scale::Counted.colour(nearest)[..3], pixels[*n], "{name}: pixel {n}");
            }
            let is_inside = pixels[*n] != Scale::Counted.colour(0.0)[..3];
            wrong[0] += usize::from((there >= 1.0) != is_inside);
            wrong[1] += usize::from((there >= 1.0) != (nearest >= 1.0));
            seen.insert(there as i32);
        }
        // Gaps that hide between two samples do so in pictures.
        assert!(wrong[0] <= wrong[1] && wrong[0] * 20 < chosen.len(), "{name}: {wrong:?}");
        assert!(seen.len() >= 2, "{seen:?}");
    }
}

#[test]
fn a_legend_stands_below_and_larger_pixels_are_means() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 3);
    let (bare, with) = (dir.path("bare.png"), dir.path("with.png"));
    slice(&store, &bare, &["--z", "10", "--no-legend"]);
    slice(&store, &with, &["--z", "10"]);
    let (bare, with) = (read(&bare), read(&with));
    assert!(with.1 > bare.1 && with.0 == bare.0);
    assert!(with.2[..bare.2.len()] == bare.2);
    assert!(with.2[bare.2.len()..].contains(&[40; 3]), "no lettering");
    let small = dir.path("small.png");
    let said = slice(&store, &small, &["--z", "10", "--no-legend", "--size", "64"]);
    let small = read(&small);
    assert_eq!((small.0.max(small.1), &said["size"][0]), (64, &serde_json::json!(small.0)));
    let light = |pixels: &Pixels| {
        pixels.2.iter().flatten().map(|c| u64::from(*c)).sum::<u64>() as f64 / pixels.2.len() as f64
    };
    assert!((light(&small) / light(&bare) - 1.0).abs() < 0.03, "{} and {}", light(&small), light(&bare));
}

/// Loops of a DXF file, as a reader that knows nothing of who wrote it finds them.
fn loops_of(path: &Path) -> Vec<Vec<[f64; 2]>> {
    let text = std::fs::read_to_string(path).expect("text");
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let (mut loops, mut at): (Vec<Vec<[f64; 2]>>, &str) = (Vec::new(), "");
    for pair in lines.chunks_exact(2) {
        match (pair[0], pair[1]) {
            ("0", kind) => {
                at = kind;
                match kind {
                    "POLYLINE" => loops.push(Vec::new()),
                    "VERTEX" => loops.last_mut().expect("a line").push([0.0; 2]),
                    _ => {}
                }
            }
            ("10", x) if at == "VERTEX" => {
                loops.last_mut().unwrap().last_mut().unwrap()[0] = x.parse().unwrap()
            }
            ("20", y) if at == "VERTEX" => {
                loops.last_mut().unwrap().last_mut().unwrap()[1] = y.parse().unwrap()
            }
            ("70", closed) if at == "POLYLINE" => assert_eq!(closed, "1"),
            _ => {}
        }
    }
    assert_eq!(lines[lines.len() - 2..], ["0", "EOF"]);
    loops
}

fn area_of(line: &[[f64; 2]]) -> f64 {
    let next = line.iter().cycle().skip(1);
    line.iter().zip(next).map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum()
}

#[test]
fn drawings_hold_closed_loops_with_the_section_s_area() {
    let dir = Scratch::new();
    let store = dir.store("box_with_cavity", 3);
    let out = dir.path("s.dxf");
    let said = slice(&store, &out, &["--z", "5.01mm"]);
    let loops = loops_of(&out);
    let mut areas: Vec<f64> = loops.iter().map(|line| area_of(line)).collect();
    areas.sort_by(f64::total_cmp);
    assert_eq!((loops.len(), said["loops"].as_u64()), (2, Some(2)));
    assert!((areas[0] + 16.0).abs() < 0.02 && (areas[1] - 100.0).abs() < 0.02, "{areas:?}");
    assert!((said["area"].as_f64().unwrap() - 84.0).abs() < 0.02);
    let svg = dir.path("s.svg");
    slice(&store, &svg, &["--z", "5.01"]);
    let text = std::fs::read_to_string(&svg).unwrap();
    assert!(
        text.contains("width=\"10.4") && text.contains("mm\"") && text.contains("<title>z = 5.01 mm</title>")
    );
    assert_eq!((text.matches('Z').count(), text.matches('M').count()), (2, 2));
    let points = |text: &str| text.matches('L').count() + text.matches('M').count();
    assert_eq!(Some(points(&text) as u64), said["points"].as_u64());
}

#[test]
fn open_parts_have_colours_in_between_and_closed_loops() {
    let dir = Scratch::new();
    let store = dir.store("open_box_no_lid", 2);
    let said = slice(&store, &dir.path("s.svg"), &["--z", "5.03"]);
    assert_eq!(said["loops"].as_u64(), Some(1));
    assert!((said["area"].as_f64().unwrap() - 100.0).abs() < 0.1, "{said}");
    let out = dir.path("s.png");
    let said = slice(&store, &out, &["--z", "5.03", "--no-legend"]);
    let Pixels(width, height, pixels) = read(&out);
    let number = |value: &Value| value.as_f64().expect("a number");
    let origin = [0, 1, 2].map(|a| number(&said["origin"][a]));
    for (x, y) in [(width / 2, height / 2), (width / 3, height / 2), (0, 0)] {
        let at = [x, height - 1 - y].map(|n| n as f64 * number(&said["pixel"]));
        let point = format!("{},{},{}\n", origin[0] + at[0], origin[1] + at[1], origin[2]);
        let sampled = run_with(&[&"sample", &store, &"--points", &"-"], &point).ok();
        let w: f64 = sampled.trim().rsplit(',').next().unwrap().parse().unwrap();
        let (colour, pixel) = (Scale::Even(1.0).colour(w), pixels[y * width + x]);
        assert!((0..3).all(|c| colour[c].abs_diff(pixel[c]) <= 1), "w = {w}: {pixel:?} for {colour:?}");
    }
}

#[test]
fn layers_add_up_to_the_part() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 3);
    let folder = dir.path("layers");
    let args: [&dyn AsRef<OsStr>; 11] = [
        &"slice",
        &store,
        &"--all",
        &"z",
        &"--pitch",
        &"0.5mm",
        &"--format",
        &"dxf",
        &"-o",
        &folder,
        &"--quiet",
    ];
    run(&args).ok();
    let mut names: Vec<PathBuf> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
    names.sort();
    assert_eq!(names.len(), 20);
    assert!(names[0].ends_with("0001.dxf") && names[19].ends_with("0020.dxf"));
    let volume: f64 = names.iter().flat_map(|name| loops_of(name)).map(|line| area_of(&line) * 0.5).sum();
    assert!((volume / truth("overlap_boxes", "union_volume") - 1.0).abs() < 1e-3, "{volume}");
    // Again into the same folder.
    run(&args).ok();
}

#[test]
fn a_pitch_beyond_the_part_gives_one_section_in_its_middle() {
    let dir = Scratch::new();
    // From 0 to 10 mm.
    let store = dir.store("overlap_boxes", 2);
    for (pitch, at) in [("100mm", 5.0), ("10.5", 5.0), ("10", 5.0), ("9", 4.5)] {
        let said = slice(&store, &dir.path("layers"), &["--all", "z", "--pitch", pitch, "--format", "svg"]);
        assert!((said["at"].as_f64().unwrap() - at).abs() < 1e-6, "{pitch}: {said}");
    }
}

/// Between two layers of samples, in every kind of output, as the part is.
#[test]
fn every_section_tells_its_area_and_how_sure_it_is() {
    let dir = Scratch::new();
    let store = dir.store("box_with_cavity", 3);
    // Below the cavity, and twice within one layer of samples.
    for (at, expected) in [("1.0", 100.0), ("5.01", 84.0), ("5.09", 84.0)] {
        for name in ["s.png", "s.svg", "s.dxf"] {
            let said = slice(&store, &dir.path(name), &["--z", at]);
            let [area, error] = ["area", "area_error"].map(|key| said[key].as_f64().unwrap());
            assert!((area - expected).abs() <= error.max(1e-3) && error < 0.1, "{at} {name}: {said}");
            let text = run(&[&"slice", &store, &"--z", &at, &"-o", &dir.path(name)]).ok();
            assert!(text.contains(", area ") && text.contains(" mm², "), "{text}");
        }
    }
    let cone = dir.path("cone.stl");
    let mesh = brickfield_bench_data::shapes::icosphere(4, 10.0);
    brickfield_bench_data::write::stl(std::fs::File::create(&cone).unwrap(), &mesh).unwrap();
    let ball = dir.path("ball.brf");
    run(&[&"build", &cone, &"-o", &ball, &"--depth", &"2"]).ok();
    let area =
        |z: &str| slice(&ball, &dir.path("s.png"), &["--z", z, "--size", "64"])["area"].as_f64().unwrap();
    let (low, high) = (area("5.0"), area("5.01"));
    // By 2 π z times the difference of the heights, though no sample lies between them.
    assert!(((low - high) / (std::f64::consts::TAU * 5.0 * 0.01) - 1.0).abs() < 0.2, "{low} {high}");
    // So do pixels, of which one is a third of a cell.
    for z in [9.3, 9.35, 9.4, 9.45] {
        let out = dir.path("s.png");
        let said = slice(&ball, &out, &["--z", &z.to_string(), "--no-legend", "--pixel", "0.05mm"]);
        let inside = read(&out).2.iter().filter(|pixel| **pixel != Scale::Counted.colour(0.0)[..3]).count();
        let area = std::f64::consts::PI * (100.0 - z * z);
        assert!((inside as f64 * 0.0025 / area - 1.0).abs() < 0.02, "{z}: {inside} pixels, {area}, {said}");
    }
    let text = run(&[&"slice", &ball, &"--z", &"5", &"-o", &dir.path("s.svg")]).ok();
    assert!(text.contains(" ± "), "{text}");
}

#[test]
fn layers_are_numbered_from_1_and_cut_in_their_middle() {
    let dir = Scratch::new();
    let path = dir.file("p.gcode", TWO_LAYERS);
    let store = dir.path("p.brf");
    run(&[&"build", &path, &"-o", &store, &"--depth", &"2"]).ok();
    for (layer, at) in [("1", 0.15), ("2", 0.4)] {
        let said = slice(&store, &dir.path("s.svg"), &["--layer", layer]);
        assert!((said["at"].as_f64().unwrap() - at).abs() < 1e-9, "{said}");
    }
    for (layer, status) in [("0", 2), ("3", 1)] {
        let done = run(&[&"slice", &store, &"--layer", &layer, &"-o", &dir.path("s.svg")]);
        assert_eq!(done.status, Some(status), "{}", done.stderr);
        assert!(status == 2 || done.stderr.contains("choose one from 1 to 2"), "{}", done.stderr);
    }
    let moved = dir.path("moved.gcode");
    std::fs::rename(&path, &moved).unwrap();
    let gone = run(&[&"slice", &store, &"--layer", &"1", &"-o", &dir.path("s.svg")]).failed();
    assert!(gone.contains("not there any more; say where it is with --toolpath"), "{gone}");
    slice(&store, &dir.path("s.png"), &["--layer", "1", "--toolpath", moved.to_str().unwrap()]);
    let other = dir.file("other.gcode", TWO_LAYERS.replace("X20", "X21"));
    let other =
        run(&[&"slice", &store, &"--layer", &"1", &"--toolpath", &other, &"-o", &dir.path("s.svg")]).failed();
    assert!(other.contains("was built from another file"), "{other}");
    let mesh = dir.store("overlap_boxes", 1);
    let mesh = run(&[&"slice", &mesh, &"--layer", &"1", &"-o", &dir.path("s.svg")]).failed();
    assert!(mesh.contains("is no toolpath"), "{mesh}");
}

const TWO_LAYERS: &str = "\
;FLAVOR:Marlin
; filament_diameter = 1.75
M83
;LAYER:0
G1 Z0.3 F600
G1 X0 Y0
G1 X20 Y0 E1
;LAYER:1
G1 Z0.5
G1 X0 Y0
G1 X20 Y0 E0.7
";

#[test]
fn straight_runs_of_drawings_are_merged() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let points = |more: &[&str]| {
        let out = dir.path("s.dxf");
        let said = slice(&store, &out, &[&["--z", "5.03"], more].concat());
        let loops = loops_of(&out);
        let count = loops.iter().map(Vec::len).sum::<usize>();
        assert_eq!(said["points"].as_u64(), Some(count as u64));
        (count, loops.iter().map(|line| area_of(line)).sum::<f64>(), said["area"].as_f64().unwrap())
    };
    let (all, merged) = (points(&["--merge-tolerance", "0"]), points(&[]));
    // Eight corners of two boxes.
    assert!(all.0 > 100 && merged.0 <= 16, "{all:?} {merged:?}");
    assert!((all.1 - merged.1).abs() < 0.05 && all.2 == merged.2, "{all:?} {merged:?}");
    let refused =
        run(&[&"slice", &store, &"--z", &"5", &"--merge-tolerance", &"1", &"-o", &dir.path("s.png")]);
    assert!(refused.misused().contains("--merge-tolerance belongs to drawings"));
}

#[test]
fn coordinates_are_printed_with_the_digits_that_they_need() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let said = run(&[&"slice", &store, &"--z", &"0.4999999999999998mm", &"-o", &dir.path("s.png")]).ok();
    assert!(said.contains(": z = 0.5 mm, "), "{said}");
    let said = run(&[&"slice", &store, &"--z", &"0.1234567", &"-o", &dir.path("s.svg")]).ok();
    assert!(said.contains(": z = 0.123457 mm, "), "{said}");
}

#[test]
fn pictures_have_the_same_bytes_for_any_threads_and_memory() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 3);
    let style = dir.file(
        "mine.toml",
        b"[[surface]]\nw = 1.5\ncolour = \"counted\"\nopacity = 0.5\n[volume]\nopacity = [[0, 0.1], [3, 0.9]]\n\
          colour = [[0, \"#ff0000\"], [2, \"#0000ff\"]]\nstretch = \"5mm\"\n",
    );
    let mine = style.to_str().unwrap();
    let cases: [&[&str]; 8] = [
        &["render", "--size", "120x90", "--style", mine, "--lod", "0.3", "--cut", "z>9", "a.png"],
        &["render", "--size", "60x40", "--turntable", "5", "--view", "10,30", "a.apng"],
        &["slice", "--z", "9.3", "a.png"],
        &["slice", "--x", "100", "--size", "100", "a.png"],
        &["slice", "--z", "9.3", "a.svg"],
        &["render", "--size", "120x90", "--cut", "y<100", "a.png"],
        &["render", "--size", "120x90", "--style", "overlap", "--perspective", "20", "a.png"],
        &["render", "--size", "120x90", "--style", "boundary", "--background", "#203040", "a.png"],
    ];
    for case in cases {
        let (name, options) = case[1..].split_last().unwrap();
        let made = |more: &[&str]| {
            let out = dir.path(name);
            let mut args: Vec<&dyn AsRef<OsStr>> = vec![&case[0], &store, &"-o", &out, &"--quiet"];
            args.extend(options.iter().chain(more).map(|arg| arg as &dyn AsRef<OsStr>));
            run(&args).ok();
            std::fs::read(out).unwrap()
        };
        let one = made(&["--threads", "1"]);
        assert!(one == made(&["--threads", "3", "--memory", "1MiB"]), "{case:?}");
        assert!(one == made(&["--io", "mmap"]), "{case:?}");
    }
}

/// Whether two pictures look the same: a few pixels may differ, as where another processor's last bit decides on which
/// side of an edge a ray passes.
#[track_caller]
fn alike(path: &Path, golden: &str) {
    let known = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden").join(golden);
    let (a, b) = (read(path), read(&known));
    assert_eq!((a.0, a.1), (b.0, b.1));
    let differs = |(a, b): &(&[u8; 3], &[u8; 3])| (0..3).any(|c| a[c].abs_diff(b[c]) > 12);
    let different = a.2.iter().zip(&b.2).filter(differs).count();
    assert!(different * 200 <= a.2.len(), "{golden}: {different} of {} pixels differ", a.2.len());
    let colours: std::collections::HashSet<_> = b.2.iter().collect();
    assert!(colours.len() > 20, "{golden} shows nothing");
}

#[test]
fn pictures_look_as_they_did() {
    let dir = Scratch::new();
    let sphere = brickfield_bench_data::shapes::icosphere(4, 10.0);
    let mut bytes = Vec::new();
    brickfield_bench_data::write::stl(&mut bytes, &sphere).unwrap();
    let sphere = dir.file("sphere.stl", bytes);
    let store = |input: &Path, depth: &str| {
        let out = input.with_extension("brf");
        let out = dir.path(out.file_name().unwrap().to_str().unwrap());
        run(&[&"build", &input, &"-o", &out, &"--depth", &depth, &"--quiet"]).ok();
        out
    };
    let pile = dir.pile("pile.stl", 20_000);
    let (sphere, pile) = (store(&sphere, "2"), store(&pile, "3"));
    let (clover, cavity) = (store(&stl("clover_beads"), "3"), store(&stl("box_with_cavity"), "3"));
    let cases: [(&Path, &str, &[&str]); 6] = [
        (&sphere, "sphere.png", &[]),
        (&clover, "clover.png", &["--perspective"]),
        (&clover, "clover_overlap.png", &["--style", "overlap"]),
        (&cavity, "cavity_open.png", &["--cut", "y<5mm"]),
        (&cavity, "cavity_boundary.png", &["--style", "boundary", "--view", "30,25"]),
        (&pile, "pile.png", &["--perspective", "30"]),
    ];
    for (store, golden, more) in cases {
        let out = dir.path(golden);
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"render", &store, &"-o", &out, &"--size", &"160x120"];
        args.extend([&"--quiet" as &dyn AsRef<OsStr>]);
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args).ok();
        if std::env::var_os("BRICKFIELD_NEW_PICTURES").is_some() {
            let known = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden").join(golden);
            std::fs::copy(&out, known).unwrap();
        }
        alike(&out, golden);
    }
}

#[test]
fn styles_come_from_files() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 2);
    let out = dir.path("a.png");
    let drawn = |style: &dyn AsRef<OsStr>, more: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"render", &store, &"-o", &out, &"--style", style];
        args.extend([&"--size" as &dyn AsRef<OsStr>, &"90x60", &"--quiet"]);
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args).ok();
        std::fs::read(&out).unwrap()
    };
    for name in ["solid", "boundary", "overlap"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("styles").join(name).with_extension("toml");
        assert!(drawn(&file, &[]) == drawn(&name, &[]), "{name}");
    }
    let text = "background = \"#203040\"\n[[surface]]\nw = 0.5\ncolour = \"#ff0000\"\nshaded = false\n";
    let red = dir.file("red.toml", text);
    drawn(&red, &[]);
    let seen = |colour| read(&out).2.contains(&colour);
    assert!(seen([255, 0, 0]) && seen([0x20, 0x30, 0x40]) && !seen([255; 3]));
    drawn(&red, &["--background", "white"]);
    assert!(seen([255, 0, 0]) && !seen([0x20, 0x30, 0x40]) && seen([255; 3]));

    std::fs::remove_file(&out).unwrap();
    let bad = dir.file("bad.toml", format!("{text}opacity = 2\n"));
    let line = run(&[&"render", &store, &"-o", &out, &"--style", &bad]).failed();
    assert!(line.contains("bad.toml: line 6: surface.opacity: expected a number from 0 to 1"), "{line}");
    let bad = dir.file("bad.toml", text.replace("w = 0.5", "w = -0.5"));
    let line = run(&[&"render", &store, &"-o", &out, &"--style", &bad]).failed();
    assert!(line.contains("bad.toml: line 3: surface.w: expected a winding number above 0"), "{line}");
    let line = run(&[&"render", &store, &"-o", &out, &"--style", &dir.path("none.toml")]).failed();
    assert!(line.contains("none.toml: cannot open the style"), "{line}");
    let line = run(&[&"render", &store, &"-o", &out, &"--style", &"plaid"]).misused();
    assert!(line.contains("choose solid, boundary, overlap, or a file that ends in .toml"), "{line}");
    assert_eq!(dir.names(), ["bad.toml", "clover_beads-2.brf", "red.toml"]);
}

#[test]
fn a_turn_is_an_animation_or_a_folder_of_the_same_pictures() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let turn = |out: &Path| {
        let args: [&dyn AsRef<OsStr>; 10] = [
            &"render",
            &store,
            &"-o",
            &out,
            &"--turntable",
            &"6",
            &"--size",
            &"64x48",
            &"--json",
            &"--quiet",
        ];
        run(&args)
    };
    let (folder, apng) = (dir.path("turn"), dir.path("turn.apng"));
    turn(&folder).ok();
    let said = turn(&apng).json();
    assert_eq!((&said["frames"], &said["size"]), (&serde_json::json!(6), &serde_json::json!([64, 48])));
    let file = std::io::BufReader::new(std::fs::File::open(&apng).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let turns = reader.info().animation_control().expect("an animation");
    assert_eq!((turns.num_frames, turns.num_plays), (6, 0));
    let mut pictures = Vec::new();
    for number in 1..=6 {
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        let alone = read(&folder.join(format!("{number:04}.png")));
        assert!(bytes == alone.2.concat(), "{number}");
        pictures.push(bytes);
    }
    assert!(pictures.iter().enumerate().all(|(n, picture)| !pictures[..n].contains(picture)));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 6);
    let many = run(&[&"render", &store, &"-o", &"turn.png", &"--turntable", &"3"]).misused();
    assert!(many.contains("--turntable makes many pictures"), "{many}");
    for name in ["turn.gif", "turn.MP4", "turn.webm", "turn.jpg"] {
        let line = run(&[&"render", &store, &"-o", &dir.path(name), &"--turntable", &"3"]).misused();
        assert!(line.contains(name) && line.contains("ends in .apng, or .png files in a folder"), "{line}");
        assert!(!dir.path(name).exists(), "{name}");
    }
    let one = run(&[&"render", &store, &"-o", &"turn.apng"]).misused();
    assert!(one.contains("take --turntable"), "{one}");
}

#[test]
fn a_coarse_picture_comes_first() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 4);
    let (coarse, fine) = (dir.path("coarse.png"), dir.path("fine.png"));
    let drawn = |more: &[&dyn AsRef<OsStr>]| {
        let args: [&dyn AsRef<OsStr>; 6] = [&"render", &store, &"-o", &fine, &"--size", &"96x72"];
        run(&[args.as_slice(), more].concat()).ok()
    };
    let said = drawn(&[&"--preview", &coarse, &"--lod", &"0"]);
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines[0].contains("coarse.png: 96 × 72 pixels") && lines[1].contains("fine.png: "), "{said}");
    let bricks = |line: &str| -> u64 {
        let (before, _) = line.split_once(" bricks").expect("a count");
        before.rsplit(' ').next().unwrap().parse().unwrap()
    };
    assert!(bricks(lines[0]) * 4 < bricks(lines[1]), "{said}");
    let (a, b) = (read(&coarse), read(&fine));
    assert_eq!((a.0, a.1), (b.0, b.1));
    // They show the same: few pixels are the part in one and background in the other.
    let differs = a.2.iter().zip(&b.2).filter(|(a, b)| (**a == [255; 3]) != (**b == [255; 3])).count();
    assert!(differs * 20 < a.2.len(), "{differs}");
    let both = run(&[&"render", &store, &"-o", &fine, &"--preview", &fine]).failed();
    assert!(both.contains("overwrite another file"), "{both}");
    let jpg = run(&[&"render", &store, &"-o", &fine, &"--preview", &"a.jpg"]).misused();
    assert!(jpg.contains("must end in .png"), "{jpg}");
}

#[test]
fn what_cannot_be_drawn_is_said_in_a_line_and_leaves_nothing() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let png = dir.path("o.png");
    let beside = run(&[&"slice", &store, &"--z", &"200mm", &"-o", &png]).failed();
    assert!(
        beside.contains("z = 200 mm passes beside the part") && beside.contains("from 0 to 10 mm"),
        "{beside}"
    );
    let tiny = run(&[&"slice", &store, &"--z", &"5", &"--pixel", &"1e-6mm", &"-o", &png]).failed();
    assert!(tiny.contains("--pixel"), "{tiny}");
    let many =
        run(&[&"slice", &store, &"--all", &"x", &"--pitch", &"1e-6mm", &"-o", &dir.path("all")]).failed();
    assert!(many.contains("--pitch"), "{many}");
    let level = run(&[&"render", &store, &"--level", &"9", &"-o", &png]).failed();
    assert!(level.contains("from 0 to 1"), "{level}");
    let nothing = run(&[&"render", &store, &"--cut", &"x>-100", &"-o", &png]).failed();
    assert!(nothing.contains("leave nothing"), "{nothing}");
    for out in ["none/o.png", "none/o.svg"] {
        let line = run(&[&"slice", &store, &"--z", &"5", &"-o", &dir.path(out)]).failed();
        assert!(line.contains("create the directory first"), "{line}");
    }
    let line = run(&[&"render", &store, &"-o", &dir.path("none/o.png")]).failed();
    assert!(line.contains("create the directory first"), "{line}");
    let line = run(&[&"slice", &store, &"--all", &"z", &"--pitch", &"1", &"-o", &store]).failed();
    assert!(line.contains("overlap_boxes-1.brf"), "{line}");

    let view = run(&[&"render", &store, &"--view", &"inside", &"-o", &png]).misused();
    assert!(view.contains("iso, top, bottom, front, back, left, right"), "{view}");
    for more in [
        &["slice", "--z", "1"] as &[&str],
        &["slice", "--z", "1", "--x", "1", "-o", "o.png"],
        &["slice", "-o", "o.png"],
        &["slice", "--z", "1", "-o", "o.pdf"],
        &["slice", "--z", "1", "--size", "100", "-o", "o.svg"],
        &["slice", "--z", "1", "--samples", "-o", "o.svg"],
        &["slice", "--z", "1", "--samples", "--size", "100", "-o", "o.png"],
        &["slice", "--all", "z", "-o", "all"],
        &["slice", "--z", "nan", "-o", "o.png"],
        &["render", "-o", "o.jpg"],
        &["render", "-o", "o.png", "--size", "0x5"],
        &["render", "-o", "o.png", "--cut", "w>1"],
        &["render", "-o", "o.png", "--perspective", "200"],
        &["render", "-o", "o.png", "--supersample", "9"],
        &["render", "-o", "o.png", "--background", "plaid"],
        &["render", "-o", "o.png", "--lod", "-1"],
        &["render", "-o", "o.png", "--lod", "nan"],
        &["render", "-o", "turn", "--turntable", "0"],
        &["render", "-o", "turn", "--turntable", "2", "--preview", "o.png"],
    ] {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&more[0], &store];
        args.extend(more[1..].iter().map(|arg| arg as &dyn AsRef<OsStr>));
        assert!(!run(&args).misused().is_empty(), "{more:?}");
    }
    assert_eq!(dir.names(), ["overlap_boxes-1.brf"]);
}
