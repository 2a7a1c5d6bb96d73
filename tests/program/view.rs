//! `brickfield view`: a window on an X server without a screen, whose pictures are those of `render`.

use crate::support::*;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

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
}

#[test]
#[ignore = "needs Xvfb and a Vulkan driver; run with -- --ignored view"]
fn a_scripted_session_shows_what_render_draws() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 3);
    dir.file("mine.toml", "background = \"#203040\"\n[[surface]]\nw = 0.5\ncolour = \"#d71e23\"\n");
    let display = Display::new();
    let script = "screenshot a.png\norbit 30 -10\nzoom 2\npan 40 -15\nscreenshot b.png\nview front\nperspective 30\n\
                  cut z 9.1mm\nstyle boundary\nscreenshot c.png\nsize 400x300\nkey 7\nkey x\nkey x\nstyle mine.toml\n\
                  drag left 100 100 160 130\nwheel 2\nscreenshot d.png\nkey h\nkey s\nwait\nlayer 3\nstyle overlap\n\
                  screenshot e.png\nquit\n";
    let said = output(display.view(&dir, &store, script, &["--size", "640x480"])).ok();
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 6, "{said}");
    for line in lines {
        let (name, options) = line.split_once(": ").expect("a name");
        let (_, options) = options.split_once("as render ").expect("options");
        let drawn = dir.path("drawn.png");
        let options = words(options);
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"render", &store, &"-o", &drawn, &"--quiet"];
        args.extend(options.iter().map(|word| word as &dyn AsRef<OsStr>));
        let mut command = program();
        command.current_dir(dir.path(".")).args(args.iter().map(AsRef::as_ref));
        output(command).ok();
        let same = std::fs::read(dir.path(name)).unwrap() == std::fs::read(&drawn).unwrap();
        assert!(same, "{line}");
    }
    let names = dir.names();
    assert!(names.contains(&"clover_beads-3-0001.png".to_owned()), "{names:?}");
    // They differ from each other.
    let mut pictures: Vec<Vec<u8>> = ["a", "b", "c", "d", "e"]
        .iter()
        .map(|n| std::fs::read(dir.path(&format!("{n}.png"))).unwrap())
        .collect();
    pictures.sort();
    pictures.dedup();
    assert_eq!(pictures.len(), 5);
}

#[test]
#[ignore = "needs Xvfb, a Vulkan driver and the validation layer; run with -- --ignored view"]
fn the_validation_layer_is_silent_while_the_window_changes() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let display = Display::new();
    let script = "wait\nsize 500x300\norbit 10 5\nsize 700x650\nwait\nsize 16x16\nwait\nsize 300x301\nkey z\nwait\nquit\n";
    let settings = |more: &str| {
        let checks = "enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT";
        let layer = "khronos_validation";
        format!(
            "{layer}.{checks}\n{layer}.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\n{layer}.report_flags = error,warn,perf{more}\n\
             {layer}.log_filename = said.txt\n"
        )
    };
    let validated = |more: &str| {
        dir.file("vk_layer_settings.txt", settings(more));
        let mut command = display.view(&dir, &store, script, &["--size", "320x240", "--quiet"]);
        command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
        command.env("VK_LAYER_SETTINGS_PATH", dir.path("vk_layer_settings.txt"));
        output(command).ok();
        std::fs::read_to_string(dir.path("said.txt")).unwrap_or_default()
    };
    let said = validated("");
    assert!(said.is_empty(), "{said}");
    // It looks on: asked for what is no mistake, it has something to say.
    assert!(!validated(",info").is_empty());
}

#[test]
#[ignore = "needs Xvfb; run with -- --ignored view"]
fn without_a_driver_one_line_says_so() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let display = Display::new();
    let mut command = display.view(&dir, &store, "quit\n", &[]);
    command.env("VK_ICD_FILENAMES", "/nonexistent").env("VK_DRIVER_FILES", "/nonexistent");
    let message = output(command).failed();
    assert!(
        message.contains("no pictures can be shown") && message.contains("`brickfield render`"),
        "{message}"
    );
}
