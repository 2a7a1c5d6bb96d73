//! Being interrupted, and being no longer listened to.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
use std::ffi::OsStr;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Waits until the program has begun to write and sends it a signal.
pub fn interrupt(mut child: Child, dir: &Scratch, part: &str, signal: &str) -> Run {
    let started = Instant::now();
    while !dir.names().iter().any(|name| name == part) {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it began to write");
        assert!(started.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(2));
    }
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    child.wait_with_output().unwrap().into()
}

#[test]
fn an_interrupted_build_leaves_what_it_has_or_nothing() {
    let dir = Scratch::new();
    for (signal, number) in [("-INT", 2), ("-TERM", 15)] {
        let mut command = program();
        command.arg("build").arg(stl("clover_beads")).arg("-o").arg(dir.path("o.brf"));
        command.args(["--depth", "8", "--threads", "2", "--mesh"]).arg(dir.path("o.ply"));
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let line = interrupt(child, &dir, "o.brf.part", signal).ended_by(number);
        assert!(line.contains("interrupted"), "{line}");
        match line.contains("goes on from there") {
            true => assert_eq!(dir.names(), ["o.brf.journal", "o.brf.part"]),
            false => assert_eq!(dir.names(), [""; 0]),
        }
        dir.names().iter().for_each(|name| std::fs::remove_file(dir.path(name)).unwrap());
    }
}

#[test]
fn an_interrupted_export_leaves_nothing() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 5);
    let mut command = program();
    command.arg("export").arg(store).args(["--level", "5", "--dtype", "f4", "-o"]).arg(dir.path("w.npy"));
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let line = interrupt(child, &dir, "w.npy.part", "-INT").ended_by(2);
    assert!(line.contains("interrupted"), "{line}");
    assert_eq!(dir.names(), ["overlap_boxes-5.brf"]);
}

/// Runs a command to its end, and then interrupts it after parts of that time: it ends with its result, or leaves nothing, or says
/// that it goes on from what it leaves. Returns how often it was interrupted.
fn interrupt_at_parts(dir: &Scratch, output: &str, args: &[&dyn AsRef<OsStr>]) -> u32 {
    let (before, path) = (dir.names(), dir.path(output));
    let run_to = |out: &Path| {
        let mut command = program();
        command.args(args.iter().map(AsRef::as_ref)).arg("-o").arg(out);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let started = Instant::now();
    let first = run_to(&path).spawn().unwrap().wait_with_output().unwrap();
    let time = started.elapsed();
    assert!(first.status.success(), "{output}: {}", String::from_utf8_lossy(&first.stderr));
    let whole = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let mut interrupted = 0;
    for part in [0.3, 0.8, 0.15, 0.5, 0.9, 0.97].into_iter().take(part_or_all(2, 6)) {
        let child = run_to(&path).spawn().unwrap();
        std::thread::sleep(time.mul_f64(part));
        let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let ran = Run::from(child.wait_with_output().unwrap());
        if ran.status == Some(0) {
            assert!(std::fs::read(&path).unwrap() == whole, "{output}");
            std::fs::remove_file(&path).unwrap();
            continue;
        }
        let line = ran.ended_by(2);
        assert!(line.contains("interrupted"), "{output}: {line}");
        interrupted += 1;
        let left = dir.names().into_iter().filter(|name| !before.contains(name)).collect::<Vec<_>>();
        match line.contains("goes on from there") {
            true => assert_eq!(left, [format!("{output}.journal"), format!("{output}.part")]),
            false => assert_eq!(left, [""; 0], "{output} at {part}"),
        }
        left.iter().for_each(|name| std::fs::remove_file(dir.path(name)).unwrap());
    }
    interrupted
}

#[test]
fn interrupted_analyses_leave_nothing() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", part_or_all(1, 2));
    let other = stl(part_or_all("clover_model", "clover_beads"));
    let commands: [(&str, &[&dyn AsRef<OsStr>]); 4] = [
        ("walls.ply", &[&"thickness", &store]),
        ("walls.glb", &[&"thickness", &store, &"--method", &"ray"]),
        ("apart.ply", &[&"deviation", &store, &other, &"--align", &"shift"]),
        ("grown.brf", &[&"offset", &store, &"--by", &"0.5mm"]),
    ];
    for (output, args) in commands {
        let interrupted = interrupt_at_parts(&dir, output, args);
        assert!(interrupted > 0, "{output} was never interrupted");
    }
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let points = dir.file("p.csv", "1,2,3\n".repeat(300_000));
    let mut command = program();
    command.arg("sample").arg(store).arg("--points").arg(points);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut first = [0; 8];
    child.stdout.take().unwrap().read_exact(&mut first).unwrap();
    assert_eq!(&first, b"x,y,z,w\n");
    let ran = Run::from(child.wait_with_output().unwrap());
    assert_eq!((ran.status, ran.stderr.as_str()), (Some(0), ""));
}

#[test]
fn nobody_need_listen() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let name = |name: &str| dir.path(name).into_os_string().into_string().unwrap();
    let (store, mesh, array) = (store.into_os_string().into_string().unwrap(), name("x.stl"), name("x.npy"));
    for args in [
        vec!["info", &store],
        vec!["info", &store, "--json"],
        vec!["verify", &store],
        vec!["mesh", &store, "-o", &mesh],
        vec!["export", &store, "--level", "1", "-o", &array],
        vec!["man"],
        vec!["completions", "bash"],
    ] {
        // Its standard output is a pipe that nobody reads, closed before the program begins.
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let ran = Run::from(program().args(&args).stdout(writer).output().unwrap());
        assert_eq!((ran.status, ran.stderr.as_str()), (Some(0), ""), "{args:?}");
    }
    assert!(dir.path("x.stl").exists() && dir.path("x.npy").exists());
}

#[test]
fn a_second_signal_ends_at_once_and_says_so() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let points = dir.file("p.csv", "1,2,3\n".repeat(300_000));
    for (signal, number) in [("-INT", 2), ("-TERM", 15)] {
        let mut command = program();
        command.arg("sample").arg(&store).arg("--points").arg(&points);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Nobody reads on: the program waits for room in the pipe, where the first signal cannot stop it.
        let mut answers = child.stdout.take().unwrap();
        answers.read_exact(&mut [0; 8]).unwrap();
        let send = || Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
        for _ in 0..2 {
            std::thread::sleep(Duration::from_millis(300));
            assert!(send().success());
        }
        let line = Run::from(child.wait_with_output().unwrap()).ended_by(number);
        assert!(line.contains("stopped at once by a second signal") && line.contains(".part"), "{line}");
        drop(answers);
    }
}

#[test]
fn waiting_for_points_ends_at_the_first_signal() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let mut command = program();
    command.arg("sample").arg(store).args(["--points", "-"]);
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let kept_open = child.stdin.take();
    // Time to reach the read; a signal that comes earlier ends the program as well.
    std::thread::sleep(Duration::from_millis(300));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let started = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        assert!(started.elapsed() < Duration::from_secs(20), "it still waits");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert_eq!(status.code(), Some(130));
    let ran = Run::from(child.wait_with_output().unwrap());
    assert_eq!(ran.stderr, "brickfield: interrupted\n");
    drop(kept_open);
}
