//! `brickfield view`: a window on an X server without a screen, whose pictures are those of `render`.

use super::overlays::block;
use crate::support::*;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ConnectionExt, ImageFormat, MapState};

/// An X server that draws into memory, and nowhere else.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    fn new() -> Display {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x1024x24", "-nolisten", "tcp"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb is installed");
        let mut number = String::new();
        BufReader::new(server.stdout.take().expect("it is piped"))
            .read_line(&mut number)
            .expect("its number");
        Display { server, name: format!(":{}", number.trim()) }
    }

    /// The program with this display, in `dir`, with a script on its standard input.
    fn view(&self, dir: &Scratch, store: &Path, script: &str, more: &[&str]) -> Command {
        dir.file("script.txt", script);
        let mut command = program();
        command.env("DISPLAY", &self.name).current_dir(dir.path(".")).stdin(Stdio::null());
        command.arg("view").arg(store).args(["--script", "script.txt"]).args(more);
        command
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

fn output(mut command: Command) -> Run {
    command.output().expect("it runs").into()
}

/// The options that were printed with a screenshot, as a shell splits them.
fn words(options: &str) -> Vec<String> {
    options.split_whitespace().map(|word| word.trim_matches('\'').to_owned()).collect()
}

#[test]
fn without_a_display_one_line_says_so() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let without = |set: &[(&str, &str)]| {
        let mut command = program();
        for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(name);
        }
        command.envs(set.iter().copied()).arg("view").arg(&store);
        output(command).failed()
    };
    for set in [&[][..], &[("DISPLAY", ":4711")]] {
        let message = without(set);
        assert!(
            message.contains("there is no display") && message.contains("`brickfield render`"),
            "{message}"
        );
        assert!(!message.contains(".rs:"), "{message}");
    }
}

#[test]
fn scripts_and_options_that_make_no_sense_are_refused_before_a_window_opens() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    for (script, expected) in [
        ("orbit 1\n", "script.txt: line 1: expected two angles"),
        ("fit\n\ncut z 99mm\n", "script.txt: line 3: a cut at z = 99 leaves all or nothing"),
        ("style none.toml\n", "none.toml"),
        ("screenshot overlap_boxes-1.brf\n", "line 1"),
    ] {
        let file = dir.file("script.txt", script);
        let message = run(&[&"view", &store, &"--script", &file]).failed();
        assert!(message.contains(expected), "{message}");
    }
    let message = run(&[&"view", &store, &"--script", &dir.path("none.txt")]).failed();
    assert!(message.contains("none.txt: cannot open the script"), "{message}");
    let message = run(&[&"view", &store, &"--layer-height", &"0"]).misused();
    assert!(message.contains("--layer-height"), "{message}");
    let message = run(&[&"view", &store, &"--closing", &"1"]).misused();
    assert!(message.contains("--closing belongs to --style voids"), "{message}");
    let script = dir.file("script.txt", "fit\nstyle voids\n");
    let message = run(&[&"view", &store, &"--script", &script]).failed();
    assert!(message.contains("line 2: voids have not been looked for"), "{message}");
}

/// Runs a script, and draws what was printed with each screenshot by `render`: to have the same bytes. Returns the lines.
#[track_caller]
fn compare(display: &Display, dir: &Scratch, store: &Path, script: &str, more: &[&str]) -> Vec<String> {
    let done = output(display.view(dir, store, script, more));
    assert_eq!(done.status, Some(0), "{}", done.stderr);
    let lines: Vec<String> = done.stdout.lines().map(str::to_owned).collect();
    for line in &lines {
        let (name, options) = line.split_once(": ").expect("a name");
        let (_, options) = options.split_once("as render ").expect("options");
        let mut command = program();
        command.current_dir(dir.path(".")).arg("render").arg(store).args(["-o", "drawn.png", "--quiet"]);
        command.args(words(options));
        output(command).ok();
        let same = std::fs::read(dir.path(name)).unwrap() == std::fs::read(dir.path("drawn.png")).unwrap();
        assert!(same, "{line}");
    }
    lines
}

#[test]
#[ignore = "needs Xvfb and a Vulkan driver; run with -- --ignored view"]
fn a_scripted_session_shows_what_render_draws() {
    // The last but one is so close that the processor draws it in any case.
    let script = "screenshot a.png\norbit 30 -10\nzoom 2\npan 40 -15\nscreenshot b.png\nview front\nperspective 30\n\
                  cut z 9.1mm\nstyle boundary\nscreenshot c.png\nsize 200x150\nkey 7\nkey x\nkey x\nstyle mine.toml\n\
                  drag left 50 50 80 65\nwheel 2\nscreenshot d.png\nkey h\nkey s\nwait\nlayer 3\nstyle overlap\n\
                  screenshot e.png\nzoom 300\nscreenshot f.png\ncut off\nfit\nscreenshot g.png\nquit\n";
    let display = Display::new();
    for (backend, more) in [("cpu", &[][..]), ("vulkan", &["--gpu-memory", "4MiB"]), ("vulkan", &[])] {
        let dir = Scratch::new();
        let store = dir.store("clover_beads", 3);
        dir.file("mine.toml", "background = \"#203040\"\n[[surface]]\nw = 0.5\ncolour = \"#d71e23\"\n");
        let more = [&["--size", "320x240", "--backend", backend], more].concat();
        let lines = compare(&display, &dir, &store, script, &more);
        assert_eq!(lines.len(), 8, "{lines:?}");
        assert!(lines.iter().all(|line| line.ends_with(&format!(" --backend {backend}"))), "{lines:?}");
        let names = dir.names();
        assert!(names.contains(&"clover_beads-3-0001.png".to_owned()), "{names:?}");
        // They differ from each other.
        let mut pictures: Vec<Vec<u8>> = ["a", "b", "c", "d", "e", "f", "g"]
            .iter()
            .map(|n| std::fs::read(dir.path(&format!("{n}.png"))).unwrap())
            .collect();
        pictures.sort();
        pictures.dedup();
        assert_eq!(pictures.len(), 7);
    }
}

/// What analyses find is one style among the others. The processor paints it, whatever paints these.
#[test]
#[ignore = "needs Xvfb and a Vulkan driver; run with -- --ignored view"]
fn a_window_shows_what_is_found() {
    let dir = Scratch::new();
    let store = block(&dir);
    let display = Display::new();
    let reference = dir.path("block.stl").display().to_string();
    let voids = "void 2\nscreenshot a.png\nkey n\nscreenshot b.png\nstyle solid\nscreenshot c.png\nkey t\nkey t\n\
                 key t\ncut off\nview front\nscreenshot d.png\nquit\n";
    let others = "cut x 5\nscreenshot a.png\nstyle boundary\nscreenshot b.png\nquit\n";
    for (script, backend, finding, by) in [
        (voids, "cpu", &["--style", "voids", "--colour-by", "size", "--min-volume", "30"][..], "cpu cpu cpu"),
        (voids, "vulkan", &["--style", "voids"], "cpu cpu vulkan cpu"),
        (others, "vulkan", &["--style", "thickness", "--below", "2.5", "--method", "ray"], "cpu vulkan"),
        (others, "cpu", &["--style", "deviation", "--reference", &reference, "--within", "0.1"], "cpu cpu"),
    ] {
        // Of one void alone there is no second.
        let script = if finding.contains(&"--min-volume") {
            script.replacen("void 2\nscreenshot a.png\n", "", 1)
        } else {
            script.to_owned()
        };
        let more = [&["--size", "160x120", "--backend", backend], finding].concat();
        let lines = compare(&display, &dir, &store, &script, &more);
        let painted: Vec<&str> =
            lines.iter().filter_map(|line| line.rsplit_once("--backend ")).map(|(_, by)| by).collect();
        assert_eq!(painted.join(" "), by, "{lines:?}");
    }
}

#[test]
#[ignore = "needs Xvfb and a Vulkan driver; run with -- --ignored view"]
fn screenshots_show_what_was_seen_as_they_were_asked_for() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 3);
    let display = Display::new();
    let script = "screenshot a.png\nkey s\norbit 40 0\nkey s\nview top\nkey s\nstyle overlap\nkey q\n";
    let lines = compare(&display, &dir, &store, script, &["--size", "320x240", "--backend", "cpu"]);
    assert_eq!(lines.len(), 4, "{lines:?}");
    let [a, first, second, third] =
        ["a", "clover_beads-3-0001", "clover_beads-3-0002", "clover_beads-3-0003"]
            .map(|name| std::fs::read(dir.path(&format!("{name}.png"))).unwrap());
    assert!(a == first && second != first && third != second);
    assert!(lines[3].contains("--view=-90,90 ") && lines[3].contains("--style solid"), "{lines:?}");
}

#[test]
#[ignore = "needs Xvfb and a Vulkan driver; run with -- --ignored view"]
fn the_processor_paints_in_place_of_a_device_that_fails() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let display = Display::new();
    let script = "screenshot a.png\norbit 10 5\nscreenshot b.png\nquit\n";
    // There is no room for a brick.
    let more = ["--size", "160x120", "--backend", "vulkan", "--gpu-memory", "64KiB"];
    let lines = compare(&display, &dir, &store, script, &more);
    assert!(lines.len() == 2 && lines.iter().all(|line| line.ends_with(" --backend cpu")), "{lines:?}");
    let done = output(display.view(&dir, &store, script, &more));
    assert_eq!(done.stderr.lines().count(), 1, "{}", done.stderr);
    assert!(done.stderr.contains("the processor draws in its place"), "{}", done.stderr);
}

/// The pixels of a window of this size, as the X server has them: red, green and blue.
fn shown(display: &Display, [width, height]: [u16; 2]) -> Option<Vec<[u8; 3]>> {
    let (server, screen) = x11rb::connect(Some(&display.name)).expect("the server answers");
    let root = server.setup().roots[screen].root;
    let windows = server.query_tree(root).unwrap().reply().unwrap().children;
    windows.into_iter().find_map(|window| {
        // Whatever closes meanwhile is not the one.
        let place = server.get_geometry(window).ok()?.reply().ok()?;
        let state = server.get_window_attributes(window).ok()?.reply().ok()?;
        if [place.width, place.height] != [width, height] || state.map_state != MapState::VIEWABLE {
            return None;
        }
        let image = server.get_image(ImageFormat::Z_PIXMAP, window, 0, 0, width, height, !0);
        let bytes = image.ok()?.reply().ok()?.data;
        let pixels = bytes.as_chunks::<4>().0;
        assert_eq!(pixels.len(), usize::from(width) * usize::from(height), "Xvfb has 4 bytes a pixel");
        Some(pixels.iter().map(|[blue, green, red, _]| [*red, *green, *blue]).collect())
    })
}

/// The pixels of an opaque PNG file.
fn pixels_of(path: &Path) -> Vec<[u8; 3]> {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    bytes.as_chunks::<3>().0.to_vec()
}

#[test]
#[ignore = "needs Xvfb and a Vulkan driver; run with -- --ignored view"]
fn the_window_shows_the_pixels_of_its_screenshots() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 3);
    let display = Display::new();
    let size = [320, 240];
    // Red, blue and grey, and no two corners alike. The window stays open.
    let script = "cut z 9.1mm\nstyle overlap\nscreenshot a.png\npause 3600\n";
    let mut view = display.view(&dir, &store, script, &["--size", "320x240"]);
    let mut view = view.stdout(Stdio::piped()).spawn().expect("it runs");
    // Said when it is written.
    let mut said = String::new();
    BufReader::new(view.stdout.take().expect("it is piped")).read_line(&mut said).expect("a line");
    let expected = pixels_of(&dir.path("a.png"));
    // Beside the strip with its mark, and above the status line.
    let part = |pixels: &[[u8; 3]]| -> Vec<[u8; 3]> {
        let rows = pixels.chunks_exact(size[0].into()).take(usize::from(size[1]) * 3 / 4);
        rows.flat_map(|row| &row[..row.len() / 2]).copied().collect()
    };
    let began = Instant::now();
    let seen = loop {
        // It may be on its way to the screen.
        let seen = shown(&display, size);
        let is_there = seen.as_ref().is_some_and(|seen| part(seen) == part(&expected));
        if is_there || began.elapsed() > Duration::from_secs(60) {
            break seen.expect("there is a window");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    view.kill().expect("it is still open");
    view.wait().expect("it ends");
    let differ = part(&seen).iter().zip(part(&expected)).filter(|(a, b)| **a != *b).count();
    assert_eq!(differ, 0, "pixels of the window are not the screenshot's");
    assert!(part(&expected).iter().any(|[red, _, blue]| red.abs_diff(*blue) > 100), "red is not blue");
    // The strip's blue.
    assert!(seen.contains(&[49, 130, 189]) && !expected.contains(&[49, 130, 189]));
}

#[test]
#[ignore = "needs Xvfb, a Vulkan driver and the validation layer; run with -- --ignored view"]
fn the_validation_layer_is_silent_while_the_window_changes() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let display = Display::new();
    let script = "wait\nsize 300x200\norbit 10 5\nsize 400x350\nwait\nsize 16x16\nwait\nsize 200x201\nkey z\nwait\nkey t\n\
                  wait\nquit\n";
    let settings = |more: &str| {
        let checks = "enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT";
        let layer = "khronos_validation";
        format!(
            "{layer}.{checks}\n{layer}.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\n{layer}.report_flags = error,warn,perf{more}\n\
             {layer}.log_filename = said.txt\n"
        )
    };
    let validated = |backend: &str, more: &str| {
        dir.file("vk_layer_settings.txt", settings(more));
        let options = ["--size", "160x120", "--quiet", "--backend", backend];
        let mut command = display.view(&dir, &store, script, &options);
        command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
        command.env("VK_LAYER_SETTINGS_PATH", dir.path("vk_layer_settings.txt"));
        output(command).ok();
        std::fs::read_to_string(dir.path("said.txt")).unwrap_or_default()
    };
    for backend in ["cpu", "vulkan"] {
        let said = validated(backend, "");
        assert!(said.is_empty(), "{backend}: {said}");
    }
    // It looks on: asked for what is no mistake, it has something to say.
    assert!(!validated("cpu", ",info").is_empty());
}

#[test]
#[ignore = "needs Xvfb; run with -- --ignored view"]
fn without_a_driver_one_line_says_so() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let display = Display::new();
    let mut command = display.view(&dir, &store, "quit\n", &["--backend", "cpu"]);
    command.env("VK_ICD_FILENAMES", "/nonexistent").env("VK_DRIVER_FILES", "/nonexistent");
    let message = output(command).failed();
    assert!(
        message.contains("no pictures can be shown") && message.contains("install the GPU's Vulkan driver"),
        "{message}"
    );
}
