//! Messages of the library name settings, as code; the program puts options in their place.

use super::{engine, sources, top};
use std::collections::BTreeSet;
use std::fs;

/// Code in messages that is no setting: commands of the program, functions and features of the library.
const OTHERS: [&str; 6] = ["build", "gcode", "in_memory", "vulkan", "winding", "write"];

/// Lines that may hold messages: code of the engine without comments and tests.
fn lines() -> Vec<(String, String)> {
    let is_test = |file: &str| ["tests", "faults", "testing"].iter().any(|part| file.contains(part));
    let mut lines = Vec::new();
    for (name, file, text) in engine().into_iter().filter(|(_, file, _)| !is_test(file)) {
        let code = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
        let code = code.lines().map(|line| line.split("// ").next().unwrap_or_default());
        let code = code.filter(|line| !line.trim_start().starts_with("//"));
        lines.extend(code.map(|line| (format!("engine/{name}/src/{file}"), line.to_owned())));
    }
    lines
}

/// What stands in a line as code, in backticks.
fn spans(line: &str) -> impl Iterator<Item = &str> {
    let pieces: Vec<&str> = line.split('`').collect();
    let last = pieces.len() - 1;
    pieces.into_iter().enumerate().filter(move |(n, _)| n % 2 == 1 && *n < last).map(|(_, span)| span)
}

/// Whether a text has the form of a setting's name.
fn is_name(span: &str) -> bool {
    !span.is_empty() && span.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_')
}

/// The settings for which the program has options of the same names.
fn settings() -> BTreeSet<String> {
    let text = fs::read_to_string(top().join("tools/terminal/src/options.rs")).expect("readable");
    let list = text.split("const SETTINGS").nth(1).and_then(|rest| rest.split("];").next()).expect("a list");
    list.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn the_library_names_no_options() {
    let lines = lines();
    assert!(lines.len() > 10_000, "the search finds nothing");
    for (file, line) in &lines {
        // A whole command is no option: it says what to run.
        let line = spans(line)
            .filter(|span| span.starts_with("brickfield "))
            .fold(line.clone(), |rest, command| rest.replace(command, ""));
        let mut tails = line.match_indices("--").map(|(at, _)| &line[at + 2..]);
        let has_option = tails.any(|tail| tail.starts_with(|c: char| c.is_ascii_lowercase()));
        assert!(
            !has_option,
            "{file}: {line}: name the setting as code, and its option in tools/terminal/src/options.rs"
        );
    }
}

#[test]
fn settings_that_messages_name_have_options() {
    let mut known = settings();
    let lines = lines();
    let named: BTreeSet<String> = lines
        .iter()
        .flat_map(|(_, line)| spans(line))
        .filter(|span| is_name(span))
        .map(str::to_owned)
        .collect();
    known.extend(OTHERS.map(str::to_owned));
    assert_eq!(named, known, "tools/terminal/src/options.rs");
    let program: String = sources(&top().join("tools/src"))
        .iter()
        .map(|path| fs::read_to_string(path).expect("readable"))
        .collect();
    for name in settings() {
        let field = format!(" {name}: ");
        assert!(program.contains(&field), "no option --{name}");
    }
}

#[test]
fn spans_are_found() {
    assert_eq!(spans("a `b` c `d e` f ` g").collect::<Vec<_>>(), ["b", "d e"]);
    assert!(is_name("temp_dir") && !is_name("d e") && !is_name(""));
}
