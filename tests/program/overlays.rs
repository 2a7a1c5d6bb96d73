//! `render --style` and `slice --style` of what analyses find: colours held against tables and against shapes whose
//! thickness and deviation are known.

use super::voids::cavity_behind_a_throat;
use crate::support::*;
use brickfield_bench_data::{Mesh, shapes, write};
use brickfield_engine::overlay::{Change, DeviationScale, ThicknessScale, class_colour, size_along};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A picture without its opacity, row by row from the top.
struct Pixels {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Pixels {
    fn read(path: &Path) -> Pixels {
        let file = std::io::BufReader::new(std::fs::File::open(path).expect("it is there"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        let mut bytes = vec![0; reader.output_buffer_size().expect("it fits")];
        let info = reader.next_frame(&mut bytes).expect("all of it");
        Pixels { width: info.width as usize, pixels: bytes.as_chunks::<3>().0.to_vec() }
    }

    fn middle(&self) -> [u8; 3] {
        self.pixels[self.pixels.len() / self.width / 2 * self.width + self.width / 2]
    }

    fn count(&self, colour: [u8; 3]) -> usize {
        self.pixels.iter().filter(|pixel| **pixel == colour).count()
    }
}

fn build(dir: &Scratch, name: &str, pieces: &[Mesh], more: &[&str]) -> PathBuf {
    let (mesh, store) = (dir.path(&format!("{name}.stl")), dir.path(&format!("{name}.brf")));
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &Mesh::merged(pieces)).unwrap();
    std::fs::write(&mesh, bytes).unwrap();
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &mesh, &"-o", &store, &"-q"];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    run(&args).ok();
    store
}

fn draw(command: &str, store: &Path, out: &Path, more: &[&str]) -> Pixels {
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&command, &store, &"-o", &out, &"-q"];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    run(&args).ok();
    Pixels::read(out)
}

/// A block of 20³ with two cavities out of step with the cells, of 48 and of 27.
pub fn block(dir: &Scratch) -> PathBuf {
    let small = shapes::cuboid([-1.5; 3], [1.5; 3]).rotated([1.0, 2.0, 3.0], 0.7).translated([5.1, 6.2, 7.3]);
    let large = shapes::cuboid([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]).rotated([0.3, -1.0, 0.5], 0.4);
    let large = large.translated([13.3, 12.7, 11.9]);
    let pieces = [shapes::cuboid([0.0; 3], [20.0; 3]), small.flipped(), large.flipped()];
    build(dir, "block", &pieces, &["--depth", "2"])
}

/// Whether a colour in light is another one, but for its brightness and what haze adds to it.
fn is_lit(seen: [u8; 3], colour: [u8; 3]) -> bool {
    let share = |c: [u8; 3]| c.map(|part| f64::from(part) / c.map(f64::from).iter().sum::<f64>());
    (0..3).all(|n| (share(seen)[n] - share(colour)[n]).abs() < 0.06)
}

#[test]
fn each_void_is_seen_where_the_table_has_it_in_the_colour_of_its_size() {
    let dir = Scratch::new();
    let (store, table, out) = (block(&dir), dir.path("v.json"), dir.path("v.png"));
    run(&[&"voids", &store, &"-o", &table, &"-q"]).ok();
    let table: Value = serde_json::from_str(&std::fs::read_to_string(&table).unwrap()).unwrap();
    let number = |row: usize, name: &str| table["voids"][row][name].as_f64().unwrap();
    let style = ["--style", "voids", "--no-legend", "--size", "40x30"];
    for row in 0..2 {
        let at = ["x", "y", "z"].map(|axis| number(row, axis).to_string()).join(",") + ",6";
        for view in ["front", "top", "-60,20"] {
            let seen =
                draw("render", &store, &out, &[&style[..], &["--view", view, "--focus", &at]].concat());
            let share = number(row, "equivalent_diameter") / number(0, "equivalent_diameter");
            assert!(is_lit(seen.middle(), size_along(share)), "void {row}, {view}: {:?}", seen.middle());
        }
    }
    // Beside them there is nothing but haze.
    let seen = draw("render", &store, &out, &[&style[..], &["--focus", "3,15,15,1"]].concat());
    assert!(seen.middle().iter().all(|part| *part > 200), "{:?}", seen.middle());
    // A cut through both shows the same.
    let cut = ["--view", "top", "--cut", "z>11.9", "--focus", "13.3,12.7,11.9,1"];
    let seen = draw("render", &store, &out, &[&style[..], &cut].concat());
    assert!(is_lit(seen.middle(), size_along(1.0)), "{:?}", seen.middle());
}

#[test]
fn numbers_stand_at_the_voids_that_are_seen() {
    let dir = Scratch::new();
    let (store, out) = (block(&dir), dir.path("n.png"));
    let style = ["--style", "voids", "--no-legend", "--size", "240x180"];
    // From the direction in which the large void hides the small one there is one number, else there are two.
    let black = |view: &str| {
        let [bare, numbered] = [&[] as &[&str], &["--numbers"]].map(|more| {
            draw("render", &store, &out, &[&style[..], &["--view", view], more].concat()).count([0; 3])
        });
        assert_eq!(bare, 0);
        numbered
    };
    let (one, two) = (black("38,24"), black("-60,20"));
    // Strokes of a 1, and of a 1 and a 2, of dots of 4 pixels.
    assert!((30..=60).contains(&one) && (70..=130).contains(&two), "{one} {two}");
    // It stands where the table has the void.
    let at = "13.3,12.7,11.9,20";
    let seen = draw(
        "render",
        &store,
        &out,
        &[&style[..], &["--numbers", "--view", "front", "--focus", at]].concat(),
    );
    let centre = seen.pixels.chunks(seen.width).enumerate().flat_map(|(y, row)| {
        row.iter()
            .enumerate()
            .filter(|(_, pixel)| **pixel == [0; 3])
            .map(move |(x, _)| (x, y))
            .collect::<Vec<_>>()
    });
    let near = centre.filter(|(x, y)| x.abs_diff(120) < 20 && y.abs_diff(90) < 20).count();
    assert!(near >= 30, "{near}");
}

#[test]
fn sections_fill_voids_and_number_them_as_the_table_does() {
    let dir = Scratch::new();
    let (store, out) = (dir.store("box_with_cavity", 3), dir.path("v.png"));
    let seen =
        draw("slice", &store, &out, &["--z", "5.01", "--style", "voids", "--pixel", "0.05mm", "--no-legend"]);
    // 4 × 4 mm, less a label of 9 × 18 pixels.
    let filled = seen.count(size_along(1.0)) + 9 * 18;
    assert!((filled as f64 / 6400.0 - 1.0).abs() < 0.02, "{filled}");
    let black = seen.count([0; 3]);
    assert!((10..60).contains(&black), "{black} pixels of a 1");
    // Where the plane passes beside it there is neither.
    let seen = draw("slice", &store, &out, &["--z", "1", "--style", "voids", "--side", "100", "--no-legend"]);
    assert_eq!((seen.count(size_along(1.0)), seen.count([0; 3])), (0, 0));
}

#[test]
fn voids_behind_throats_are_filled_if_they_are_asked_for() {
    let dir = Scratch::new();
    let (store, out) = (cavity_behind_a_throat(&dir), dir.path("v.png"));
    let section = ["--z", "10.2", "--style", "voids", "--pixel", "0.05", "--no-legend"];
    for (closing, few, many) in [("1", 0.0, 0.0), ("2", 36.0, 48.0)] {
        let seen = draw("slice", &store, &out, &[&section[..], &["--closing", closing]].concat());
        let filled = (seen.count(size_along(1.0)) as f64 + if few > 0.0 { 162.0 } else { 0.0 }) * 0.0025;
        assert!((few * 0.97..=many).contains(&filled), "{closing}: {filled}");
    }
    // In space it is seen through the haze, in the middle and not beside.
    let style = ["--style", "voids", "--no-legend", "--size", "40x30", "--closing", "2", "--view", "front"];
    let seen = draw("render", &store, &out, &[&style[..], &["--focus", "10,10,10,5"]].concat());
    assert!(is_lit(seen.middle(), size_along(1.0)), "{:?}", seen.middle());
    let seen = draw("render", &store, &out, &[&style[..], &["--focus", "3,10,3,1"]].concat());
    assert!(seen.middle().iter().all(|part| *part > 200), "{:?}", seen.middle());
}

#[test]
fn classes_have_colours_of_their_own_and_are_left_out_on_demand() {
    let dir = Scratch::new();
    // Two walls of two layers whose middle line is missing.
    let mut program = String::from("M83\n;LAYER_CHANGE\n;TYPE:Perimeter\n;WIDTH:0.6\n;HEIGHT:0.4\n");
    for layer in 1..=4 {
        program += &format!("G1 Z{:.1} F600\n", 0.4 * f64::from(layer));
        for y in 0..8 {
            if (2..=3).contains(&layer) && y == 4 {
                continue;
            }
            let y = 0.5 * f64::from(y);
            program += &format!("G1 X0 Y{y}\nG1 X10 Y{y} E0.9\n");
        }
        for x in [0, 10] {
            program += &format!("G1 X{x} Y0\nG1 X{x} Y3.5 E0.3\n");
        }
    }
    let (gcode, store) = (dir.file("a.gcode", program), dir.path("a.brf"));
    run(&[&"build", &gcode, &"-o", &store, &"--cell", &"0.1", &"--identity", &"--quiet"]).ok_but_for("");
    let out = dir.path("v.png");
    let flaw = class_colour(Some(brickfield_engine::voids::Class::Flaw));
    let style = ["--style", "voids", "--z", "0.8", "--side", "200"];
    let seen = draw("slice", &store, &out, &style);
    assert!(seen.count(flaw) > 100, "{}", seen.count(flaw));
    let seen = draw("slice", &store, &out, &[&style[..], &["--classes", "pocket", "--no-legend"]].concat());
    assert_eq!(seen.count(flaw), 0);
}

#[test]
fn bands_of_sections_have_the_colours_of_thickness_and_deviation() {
    let dir = Scratch::new();
    let (plate, out) = (shapes::cuboid([0.0; 3], [10.0, 6.0, 1.0]), dir.path("t.png"));
    let store = build(&dir, "plate", &[plate], &["--cell", "0.13"]);
    let common = ["--y", "3", "--pixel", "0.05mm", "--no-legend"];
    let colour = ThicknessScale { most: 2.0, is_limit: true }.colour(1.0);
    for (limit, expected) in [("--below", colour), ("--range", ThicknessScale::along(0.5))] {
        let thickness = ["--style", "thickness", limit, "2mm"];
        let seen = draw("slice", &store, &out, &[&common[..], &thickness].concat());
        // Five pixels deep along both faces of 200 pixels, but for the corners.
        let near = |pixel: &&[u8; 3]| (0..3).all(|n| pixel[n].abs_diff(expected[n]) <= 1);
        let count = seen.pixels.iter().filter(near).count();
        assert!((1900..=2000).contains(&count), "{limit}: {count}");
    }
    let reference = dir.path("higher.stl");
    let higher = shapes::cuboid([0.0; 3], [10.0, 6.0, 1.5]);
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &higher).unwrap();
    std::fs::write(&reference, bytes).unwrap();
    let deviation = ["--style", "deviation", "--range", "1mm", "--within", "0.1mm", "--reference"];
    let more = [&common[..], &deviation, &[reference.to_str().unwrap()]].concat();
    let seen = draw("slice", &store, &out, &more);
    let scale = DeviationScale { most: 1.0, within: 0.1 };
    let near = |pixel: &[u8; 3], value: f64| (0..3).all(|n| pixel[n].abs_diff(scale.colour(value)[n]) <= 1);
    let under = seen.pixels.iter().filter(|pixel| near(pixel, -0.5)).count();
    let allowed = seen.count(DeviationScale::allowed());
    // One face of 200 pixels is half a millimetre too low, but near its ends; the lower one and most of the sides are right.
    assert!((750..=1000).contains(&under) && (1000..=1250).contains(&allowed), "{under} {allowed}");
    // In space the same from above and from below.
    let more =
        [&deviation[..], &[reference.to_str().unwrap(), "--no-legend", "--size", "40x30", "--view"]].concat();
    let [top, bottom] =
        ["top", "bottom"].map(|view| draw("render", &store, &out, &[&more[..], &[view]].concat()).middle());
    assert!(
        is_lit(top, scale.colour(-0.5)) && is_lit(bottom, DeviationScale::allowed()),
        "{top:?} {bottom:?}"
    );
    let thickness =
        ["--style", "thickness", "--below", "2mm", "--size", "40x30", "--view", "top", "--no-legend"];
    let top = draw("render", &store, &out, &thickness).middle();
    assert!(is_lit(top, colour), "{top:?}");
}

#[test]
fn cuts_are_new_and_voids_that_they_open_are_marked() {
    let dir = Scratch::new();
    let (before, after, out) = (block(&dir), dir.path("cut.brf"), dir.path("c.png"));
    // Through the large void, above the small one.
    run(&[&"csg", &before, &"--minus", &"z>12", &"-o", &after, &"-q"]).ok();
    let style =
        ["--style", "changes", "--before", before.to_str().unwrap(), "--size", "30x20", "--no-legend"];
    for (view, focus, expected) in [
        ("top", "13.3,12.7,12,1", Change::Opened),
        ("top", "3,15,12,1", Change::New),
        ("top", "5.1,6.2,12,1", Change::New),
        ("bottom", "10,10,0,1", Change::Kept),
        ("front", "10,0,6,1", Change::Kept),
    ] {
        let seen = draw("render", &after, &out, &[&style[..], &["--view", view, "--focus", focus]].concat());
        // Grey is grey whatever the light; the others differ from it by far.
        assert!(is_lit(seen.middle(), expected.colour()), "{view} {focus}: {:?}", seen.middle());
    }
    // A bump is new, too.
    let bump =
        build(&dir, "bump", &[shapes::cuboid([8.0, 8.0, 19.0], [12.0, 12.0, 22.0])], &["--cell", "0.3"]);
    run(&[&"csg", &before, &"--plus", &bump, &"-o", &dir.path("b.brf"), &"-q"]).failed();
    let coarse = build(&dir, "coarse", &[shapes::cuboid([0.0; 3], [20.0; 3])], &["--depth", "1"]);
    let line = run(&[&"render", &after, &"--style", &"changes", &"--before", &coarse, &"-o", &out]).failed();
    assert!(line.contains("samples do not stand"), "{line}");
    run(&[&"render", &after, &"--style", &"changes", &"-o", &out]).misused();
    run(&[&"slice", &after, &"--z", &"5", &"--style", &"changes", &"-o", &out]).misused();
}

#[test]
fn pictures_of_findings_have_the_same_bytes_for_any_threads() {
    let dir = Scratch::new();
    let plate = shapes::cuboid([0.0; 3], [10.0, 6.0, 1.0]).rotated([1.0, 2.0, 3.0], 0.3);
    let (block, plate, reference) =
        (block(&dir), build(&dir, "plate", &[plate], &["--cell", "0.3"]), dir.path("plate.stl"));
    let deviation =
        ["render", "--style", "deviation", "--reference", reference.to_str().unwrap(), "--size", "60x40"];
    let cases: [(&Path, &[&str]); 6] = [
        (&block, &["render", "--style", "voids", "--size", "60x40", "--perspective"]),
        (&plate, &["render", "--style", "thickness", "--size", "48x32", "--method", "ray"]),
        (&plate, &deviation),
        (&block, &["slice", "--style", "voids", "--z", "8", "--side", "100"]),
        (&plate, &["slice", "--style", "thickness", "--z", "0.5", "--side", "60", "--below", "4mm"]),
        (&block, &["render", "--style", "voids", "--size", "30x20", "--turntable", "2"]),
    ];
    for (store, case) in cases {
        let is_turn = case.contains(&"--turntable");
        let made = |more: &[&str]| {
            let out = dir.path(if is_turn { "a.apng" } else { "a.png" });
            draw(case[0], store, &out, &[&case[1..], more].concat());
            std::fs::read(out).unwrap()
        };
        let one = made(&["--threads", "1"]);
        assert!(one == made(&["--threads", "2"]), "{case:?}");
        assert!(one == made(&["--memory", "64MiB"]), "{case:?}");
    }
}

#[test]
fn what_cannot_be_shown_is_a_line() {
    let dir = Scratch::new();
    let (boxes, open, png) =
        (dir.store("overlap_boxes", 1), dir.store("open_box_no_lid", 1), dir.path("o.png"));
    // As an empty table.
    run(&[&"render", &boxes, &"--style", &"voids", &"--size", &"30x20", &"-o", &png])
        .ok_but_for("it has no voids");
    run(&[&"slice", &boxes, &"--z", &"5", &"--style", &"voids", &"-o", &png]).ok_but_for("it has no voids");
    let ladder = dir.store("void_ladder", 1);
    let draw: [&dyn AsRef<OsStr>; 6] = [&"render", &ladder, &"--style", &"voids", &"-o", &png];
    run(&[&draw[..], &[&"--size", &"30x20", &"--min-volume", &"1e9"]].concat())
        .ok_but_for("it has no voids so large");
    run(&[&draw[..], &[&"--min-volume=-1"]].concat()).misused();
    std::fs::remove_file(&png).unwrap();
    std::fs::remove_file(&ladder).unwrap();
    for style in ["voids", "thickness"] {
        let line = run(&[&"render", &open, &"--style", &style, &"-o", &png]).failed();
        assert!(line.contains("made from open input"), "{line}");
        let line = run(&[&"slice", &open, &"--z", &"5", &"--style", &style, &"-o", &png]).failed();
        assert!(line.contains("made from open input"), "{line}");
    }
    let line =
        run(&[&"render", &boxes, &"--style", &"voids", &"--colour-by", &"class", &"-o", &png]).failed();
    assert!(line.contains("--identity"), "{line}");
    let far = dir.path("far.stl");
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &shapes::cuboid([500.0; 3], [510.0; 3])).unwrap();
    std::fs::write(&far, bytes).unwrap();
    let line =
        run(&[&"render", &boxes, &"--style", &"deviation", &"--reference", &far, &"-o", &png]).failed();
    assert!(line.contains("does not overlap") && line.contains("--align shift"), "{line}");
    for more in [
        &["render", "--style", "voids", "--below", "1mm"] as &[&str],
        &["render", "--style", "thickness", "--colour-by", "size"],
        &["render", "--style", "deviation"],
        &["render", "--style", "voids", "--range", "1mm"],
        &["render", "--closing", "1mm"],
        &["render", "--style", "thickness", "--range", "1mm", "--below", "1mm"],
        &["render", "--style", "voids", "--backend", "vulkan"],
        &["render", "--within", "1mm"],
        &["render", "--style", "ghosts"],
        &["render", "--style", "thickness", "--numbers"],
        &["render", "--no-legend"],
        &["slice", "--z", "5", "--below", "1mm"],
        &["slice", "--z", "5", "--style", "overlap"],
        &["slice", "--z", "5", "--style", "voids", "--voids", "v.csv"],
    ] {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&more[0], &boxes, &"-o", &png];
        args.extend(more[1..].iter().map(|arg| arg as &dyn AsRef<OsStr>));
        assert!(!run(&args).misused().is_empty(), "{more:?}");
    }
    assert_eq!(dir.names(), ["far.stl", "open_box_no_lid-1.brf", "overlap_boxes-1.brf"]);
}
