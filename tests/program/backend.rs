//! `--backend`, `--device` and `info --devices`: with a device, and without.

use crate::support::*;
use std::ffi::OsStr;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Runs the program where the Vulkan loader finds no driver, or is not there.
fn run_without_drivers(args: &[&dyn AsRef<OsStr>]) -> Run {
    let nowhere = "/nonexistent/driver.json";
    let mut command = program();
    command.args(args.iter().map(AsRef::as_ref));
    command.env("VK_ICD_FILENAMES", nowhere).env("VK_DRIVER_FILES", nowhere).output().expect("it runs").into()
}

#[test]
fn without_a_device_the_program_works_and_says_so() {
    let dir = Scratch::new();
    let out = dir.path("o.brf");
    let build: [&dyn AsRef<OsStr>; 6] = [&"build", &stl("overlap_boxes"), &"-o", &out, &"--depth", &"2"];
    let text = run_without_drivers(&[&build[..], &[&"--backend", &"auto"]].concat()).ok();
    assert!(text.contains("  backend  processor: "), "{text}");
    let expected = std::fs::read(&out).unwrap();
    let text = run_without_drivers(&[&build[..], &[&"--backend", &"cpu"]].concat()).ok();
    assert!(!text.contains("backend"), "{text}");
    assert!(std::fs::read(&out).unwrap() == expected);
    std::fs::remove_file(&out).unwrap();
    let message = run_without_drivers(&[&build[..], &[&"--backend", &"vulkan"]].concat()).failed();
    assert!(message.contains("--backend vulkan: ") && message.contains("use --backend cpu"), "{message}");
    assert!(dir.names().is_empty());
    run_without_drivers(&[&"info", &"--devices"]).failed();
}

#[test]
fn without_a_device_pictures_are_drawn_all_the_same() {
    draws_without_a_device(&[]);
}

/// `auto` draws what the processor draws where there is no driver; asked for a device, a line says that there is none.
#[track_caller]
fn draws_without_a_device(more: &[&str]) {
    let dir = Scratch::new();
    let (store, picture) = (dir.path("o.brf"), dir.path("o.png"));
    run(&[&"build", &stl("overlap_boxes"), &"-o", &store, &"--depth", &"2"]).ok();
    let mut render: Vec<&dyn AsRef<OsStr>> = vec![&"render", &store, &"-o", &picture, &"--size", &"64x48"];
    render.extend(more.iter().map(|option| option as &dyn AsRef<OsStr>));
    let mut pictures = Vec::new();
    for backend in ["auto", "cpu"] {
        run_without_drivers(&[&render[..], &[&"--backend", &backend]].concat()).ok();
        pictures.push(std::fs::read(&picture).unwrap());
    }
    assert!(pictures[0] == pictures[1]);
    std::fs::remove_file(&picture).unwrap();
    let message = run_without_drivers(&[&render[..], &[&"--backend", &"vulkan"]].concat()).failed();
    assert!(message.contains("--backend vulkan: ") && message.contains("use --backend cpu"), "{message}");
    assert_eq!(dir.names(), ["o.brf"]);
}

#[test]
#[ignore = "needs a Vulkan device; run with -- --ignored"]
fn a_device_draws_pictures_and_is_named() {
    let dir = Scratch::new();
    let store = dir.path("o.brf");
    run(&[&"build", &stl("clover_model"), &"-o", &store, &"--depth", &"3"]).ok();
    let devices = run(&[&"info", &"--devices", &"--json"]).json();
    let name = devices[0]["name"].as_str().unwrap().to_owned();
    let mut pictures = Vec::new();
    for room in ["2MiB", "64MiB"] {
        let picture = dir.path("o.png");
        let render: [&dyn AsRef<OsStr>; 10] = [
            &"render",
            &store,
            &"-o",
            &picture,
            &"--size",
            &"64x48",
            &"--backend",
            &"vulkan",
            &"--gpu-memory",
            &room,
        ];
        let json = run(&[&render[..], &[&"--json"]].concat()).json();
        assert!(json["device"]["brought"].as_u64() > Some(0) && json["device"]["cpu_bands"] == 0, "{json}");
        assert!(run(&render).ok().trim_end().ends_with(&format!(", by {name}")));
        pictures.push(std::fs::read(&picture).unwrap());
    }
    assert!(pictures[0] == pictures[1]);
    // With room for no brick it is the processor's, and a line says so.
    let picture = dir.path("p.png");
    let done = run(&[
        &"render",
        &store,
        &"-o",
        &picture,
        &"--backend",
        &"vulkan",
        &"--gpu-memory",
        &"64KiB",
        &"--size",
        &"64x48",
    ]);
    assert_eq!((done.status, done.stderr.lines().count()), (Some(0), 1), "{}", done.stderr);
    assert!(done.stderr.contains("the processor drew in its place"), "{}", done.stderr);
    let turns = [["--device", "0"], ["--backend", "cpu"]].map(|by| {
        let turn = dir.path("t.apng");
        let args: [&dyn AsRef<OsStr>; 8] =
            [&"render", &store, &"-o", &turn, &"--turntable", &"3", &"--size", &"64x48"];
        run(&[&args[..], &[&by[0], &by[1]]].concat()).ok();
        frames_of(&turn)
    });
    assert!(turns[0].len() == 3 && turns[0][0] != turns[0][1] && turns[0][1] != turns[0][2]);
    for (there, here) in turns[0].iter().zip(&turns[1]) {
        let is_off = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 2);
        let off = there.iter().zip(here).filter(|(a, b)| is_off((a, b))).count();
        assert!(off * 1000 <= here.len(), "{off} of {} pixels are off", here.len());
    }
}

#[test]
fn without_a_device_splats_are_drawn_all_the_same() {
    draws_without_a_device(&["--splats"]);
}

#[test]
#[ignore = "needs a Vulkan device; run with -- --ignored"]
fn a_device_draws_splats_and_is_named() {
    let dir = Scratch::new();
    let store = dir.path("o.brf");
    run(&[&"build", &stl("clover_model"), &"-o", &store, &"--depth", &"3"]).ok();
    let devices = run(&[&"info", &"--devices", &"--json"]).json();
    let name = devices[0]["name"].as_str().unwrap().to_owned();
    let draw = |out: &Path, by: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"render", &store, &"-o", &out, &"--splats"];
        args.extend(["--size", "64x48"].iter().chain(by).map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args)
    };
    let [here, there] = ["here.png", "there.png"].map(|name| dir.path(name));
    let told = draw(&here, &[]).ok();
    assert!(!told.contains(&name), "{told}");
    let told = draw(&there, &["--device", "0"]).ok();
    assert!(told.trim_end().ends_with(&format!(", by {name}")), "{told}");
    let json = draw(&there, &["--backend", "vulkan", "--json"]).json();
    assert!(json["device"]["name"] == *name && json["device"]["failure"].is_null(), "{json}");
    // Rounding aside they are the same.
    let pixels = |path: &Path| {
        let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        bytes
    };
    let (expected, found) = (pixels(&here), pixels(&there));
    let off = expected.iter().zip(&found).filter(|(a, b)| a.abs_diff(**b) > 2).count();
    assert!(expected.len() == found.len() && off <= 9, "{off} of {} are off", expected.len());
    // Without room the processor draws, and a line says so.
    let done = draw(&there, &["--backend", "vulkan", "--gpu-memory", "16KiB"]);
    assert_eq!((done.status, done.stderr.lines().count()), (Some(0), 1), "{}", done.stderr);
    assert!(done.stderr.contains("the processor drew in its place"), "{}", done.stderr);
    assert!(std::fs::read(&there).unwrap() == std::fs::read(&here).unwrap());
}

/// The pictures of an opaque animation.
fn frames_of(path: &Path) -> Vec<Vec<[u8; 3]>> {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let count = reader.info().animation_control().expect("it moves").num_frames;
    let mut frame = vec![0; reader.output_buffer_size().unwrap()];
    let mut next = || {
        let info = reader.next_frame(&mut frame).unwrap();
        assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
        frame.as_chunks::<3>().0.to_vec()
    };
    (0..count).map(|_| next()).collect()
}

#[test]
#[ignore = "needs a Vulkan device; run with -- --ignored"]
fn bricks_of_a_device_are_checked_as_asked_for() {
    let dir = Scratch::new();
    let mut stores = Vec::new();
    for check in ["all", "some", "none"] {
        let out = dir.path("o.brf");
        let json = run(&[
            &"build",
            &stl("clover_model"),
            &"-o",
            &out,
            &"--depth",
            &"3",
            &"--backend",
            &"vulkan",
            &"--device-check",
            &check,
            &"--json",
        ])
        .json();
        let [bricks, checked] = ["bricks", "checked"].map(|key| json["device"][key].as_u64().unwrap());
        let is_right = match check {
            "all" => checked == bricks,
            "some" => (1..bricks / 4).contains(&checked),
            _ => checked == 0,
        };
        assert!(is_right && json["device"]["wrong"].is_null(), "{check}: {json}");
        stores.push(std::fs::read(&out).unwrap());
    }
    assert!(stores[0] == stores[1] && stores[1] == stores[2]);
    let message =
        run(&[&"build", &stl("clover_model"), &"-o", &dir.path("p.brf"), &"--device-check", &"few"])
            .misused();
    assert!(message.contains("all, some, none"), "{message}");
}

#[test]
fn what_runs_on_no_device_is_refused() {
    let dir = Scratch::new();
    let points = dir.file("p.csv", "0,0,0\n");
    let box_ = stl("overlap_boxes");
    let out = dir.path("o.brf");
    let message = run(&[&"build", &box_, &"-o", &out, &"--backend", &"cpu", &"--device", &"0"]).misused();
    assert!(message.contains("--device"), "{message}");
    let message = run(&[&"winding", &box_, &"--points", &points, &"--backend", &"vulkan"]).misused();
    assert!(message.contains("--brute"), "{message}");
    let message = run(&[&"info"]).misused();
    assert!(message.contains("PART.brf"), "{message}");
}

#[test]
#[ignore = "needs a Vulkan device; run with -- --ignored"]
fn a_device_builds_the_same_store_and_is_named() {
    let dir = Scratch::new();
    let devices = run(&[&"info", &"--devices", &"--json"]).json();
    let name = devices[0]["name"].as_str().unwrap().to_owned();
    assert!(run(&[&"info", &"--devices"]).ok().contains(&name));
    let mut stores = Vec::new();
    for (backend, file) in [("cpu", "a.brf"), ("vulkan", "b.brf")] {
        let out = dir.path(file);
        let args: [&dyn AsRef<OsStr>; 8] =
            [&"build", &stl("clover_model"), &"-o", &out, &"--depth", &"4", &"--backend", &backend];
        let json = run(&[&args[..], &[&"--json"]].concat()).json();
        stores.push(std::fs::read(&out).unwrap());
        if backend == "vulkan" {
            assert!(
                json["device"]["bricks"].as_u64() > Some(0) && json["device"]["cpu_bricks"] == 0,
                "{json}"
            );
            let text = run(&[&args[..], &[&"--device", &"0", &"--gpu-memory", &"32MiB"]].concat()).ok();
            assert!(text.contains(&format!("  backend  {name}: ")), "{text}");
            assert!(std::fs::read(&out).unwrap() == stores[0]);
        } else {
            assert!(json["device"].is_null());
        }
    }
    assert!(stores[0] == stores[1]);
    let unknown = run(&[&"build", &stl("clover_model"), &"-o", &dir.path("c.brf"), &"--device", &"voodoo"]);
    assert!(unknown.failed().contains(&name));
}

#[test]
#[ignore = "needs a Vulkan device; run with -- --ignored"]
fn what_devices_do_not_do_is_said_in_a_line() {
    let dir = Scratch::new();
    let points = "0 0 1 0 0 1\n0 0 -1 0 0 -1\n0 1 0 0 1 0\n0 -1 0 0 -1 0\n1 0 0 1 0 0\n-1 0 0 -1 0 0\n";
    let gcode = example("gcode/nonplanar.gcode");
    for (input, lines) in [(gcode, 1), (dir.file("points.xyz", points), 1), (stl("overlap_boxes"), 0)] {
        let out = dir.path("o.brf");
        let done = run(&[
            &"build",
            &input,
            &"-o",
            &out,
            &"--depth",
            &"1",
            &"--refine",
            &"stddev",
            &"--backend",
            &"vulkan",
        ]);
        let says_why = |line: &&str| line.contains("--backend vulkan: ") && line.contains("the processor's");
        let found = done.stderr.lines().filter(says_why).count();
        assert_eq!((done.status, found), (Some(0), lines), "{}", done.stderr);
    }
}

#[test]
#[ignore = "needs a Vulkan device; run with -- --ignored"]
fn the_sum_over_all_triangles_runs_on_a_device() {
    let dir = Scratch::new();
    let points = dir.file("p.csv", "2,2,2\n0.5,0.5,0.5\n50,0,0\n");
    let values = |backend: &str| -> Vec<f64> {
        let text = run(&[
            &"winding",
            &stl("overlap_boxes"),
            &"--points",
            &points,
            &"--brute",
            &"--backend",
            &backend,
        ])
        .ok();
        text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
    };
    let (here, there) = (values("cpu"), values("vulkan"));
    assert_eq!((here.len(), there.len()), (3, 3));
    assert!(here.iter().zip(&there).all(|(a, b)| (a - b).abs() < 1e-5), "{here:?} {there:?}");
}

/// What a driver takes of the machine for itself, beside the memory that is asked of it: Mesa's llvmpipe 20 MiB.
const DRIVER_MIB: u64 = 32;

/// A software driver's device memory is the machine's: all that a build takes stays within what is allowed, but for what
/// the driver takes for itself.
#[test]
#[cfg(target_os = "linux")]
#[ignore = "needs a Vulkan device; run with -- --ignored"]
fn a_build_on_a_device_stays_within_its_memory() {
    let dir = Scratch::new();
    let (input, out) = (stl("clover_beads"), dir.path("o.brf"));
    for (memory, gpu_memory) in [(90, 22), (256, 128)] {
        let [allowed, on_device] = [memory, gpu_memory].map(|mib| format!("{mib}MiB"));
        let build: [&dyn AsRef<OsStr>; 8] =
            [&"build", &input, &"-o", &out, &"--depth", &"4", &"--threads", &"2"];
        let device: [&dyn AsRef<OsStr>; 6] =
            [&"--backend", &"vulkan", &"--memory", &allowed, &"--gpu-memory", &on_device];
        let peak = peak_anonymous_mib(&[build.as_slice(), &device].concat());
        println!("{peak} MiB of {memory} MiB, {gpu_memory} MiB of which are the device's");
        assert!((1..=memory + DRIVER_MIB).contains(&peak), "{peak} MiB of {memory} MiB");
    }
}
