//! The order of the rooms, and a few other promises about the source text.

mod circles;
mod messages;
mod names;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A room, with the rooms of the same crate that it may use.
type Room = (&'static str, &'static [&'static str]);

/// The crates of the engine with their rooms, each with the rooms of the same crate that it may use. What crates use of
/// each other is Cargo's to judge.
const CRATES: [(&str, &[Room]); 15] = [
    (
        "core",
        &[
            ("lattice", &[]),
            ("error", &[]),
            ("disk", &[]),
            ("wide", &[]),
            ("predicates", &[]),
            ("sets", &[]),
            ("sweep", &[]),
            ("progress", &["error"]),
            ("mmap", &["error"]),
            ("large_array", &["error", "mmap"]),
            ("soup", &["error", "large_array"]),
            ("schedule", &["error"]),
            ("part", &["disk", "error"]),
        ],
    ),
    ("gpu", &[("gpu", &[])]),
    (
        "toolpath",
        &[
            ("toolpath", &[]),
            ("bead", &["toolpath"]),
            ("x3d", &["toolpath", "bead"]),
            ("milling", &["toolpath"]),
        ],
    ),
    ("io", &[("ingest", &[]), ("check", &["ingest"]), ("pieces", &["ingest", "check"])]),
    ("octree", &[("brick", &[]), ("store", &["brick"]), ("cache", &["brick", "store"])]),
    ("winding", &[("winding", &[]), ("solid", &[]), ("swept", &["solid"])]),
    ("mesh", &[("contour", &[])]),
    ("builder", &[("backend", &[]), ("volumes", &[]), ("build", &["backend", "volumes"])]),
    (
        "analysis",
        &[
            ("analysis", &[]),
            ("csg", &[]),
            ("distance", &["analysis"]),
            ("voids", &["analysis"]),
            ("fraction", &["analysis", "distance"]),
            ("machining", &["analysis", "csg", "voids"]),
        ],
    ),
    ("coding", &[("range", &[]), ("bsp", &["range"]), ("picks", &["range", "bsp"]), ("draw", &["bsp"])]),
    ("export", &[("export", &[]), ("import", &[])]),
    ("splats", &[("ellipses", &[]), ("splats", &["ellipses"]), ("draw", &["splats"])]),
    ("picture", &[("picture", &[]), ("section", &["picture"]), ("render", &["picture"])]),
    ("overlay", &[("overlay", &[])]),
    // The facade.
    (
        "",
        &[
            ("fuzz", &[]),
            ("field", &[]),
            ("octree", &[]),
            ("builder", &["octree"]),
            ("pictures", &["octree"]),
        ],
    ),
];

/// Names at the root of `core`, with the file that each stands in.
const RE_EXPORTED: [(&str, &str); 4] =
    [("Error", "error"), ("Result", "error"), ("Progress", "progress"), ("Silent", "progress")];

/// Longest file, in lines.
const LINES_MAX: usize = 600;

fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// All `.rs` files below a folder, sorted.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Where the sources of a crate of the engine are.
fn source_of(name: &str) -> PathBuf {
    top().join("engine").join(name).join("src")
}

/// The files of a crate of the engine, with their path below `src` and their text.
fn files_of(name: &str) -> Vec<(String, String)> {
    let root = source_of(name);
    let file = |path: PathBuf| {
        let name = path.strip_prefix(&root).expect("below the root").to_str().expect("UTF-8").to_owned();
        (name, fs::read_to_string(&path).expect("readable"))
    };
    sources(&root).into_iter().map(file).collect()
}

/// All files of the engine, with the crate, the path below its `src`, and the text.
fn engine() -> Vec<(&'static str, String, String)> {
    let files = |(name, _): &(&'static str, _)| {
        let name = *name;
        files_of(name).into_iter().map(move |(file, text)| (name, file, text))
    };
    CRATES.iter().flat_map(files).collect()
}

/// A line without its comment and without what stands in string literals.
fn code_of(line: &str) -> String {
    let mut out = String::with_capacity(line.len());
    let mut in_string = false;
    let mut chars = line.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '\\' if in_string => drop(chars.next()),
            // A quotation mark as a character literal opens no string.
            '\'' if !in_string && chars.peek() == Some(&'"') => drop(chars.next()),
            '"' => in_string = !in_string,
            '/' if !in_string && chars.peek() == Some(&'/') => break,
            c if !in_string => out.push(c),
            _ => {}
        }
    }
    out
}

/// The module path of a file: `build/jobs.rs` is build::jobs.
fn module_of(file: &str) -> Vec<String> {
    let mut parts: Vec<String> = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if parts.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
        parts.pop();
    }
    parts
}

fn identifier(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    &text[..end]
}

/// The first segments of what follows a `::`: one name, or those of a group in braces.
fn heads(text: &str) -> Vec<String> {
    if !text.starts_with('{') {
        return vec![identifier(text).to_owned()];
    }
    let mut depth = 0;
    let mut heads = Vec::new();
    let mut expects_name = false;
    for (at, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            break;
        }
        if depth == 1 && (c == '{' || c == ',') {
            expects_name = true;
        } else if expects_name && !c.is_whitespace() {
            heads.push(identifier(&text[at..]).to_owned());
            expects_name = false;
        }
    }
    heads
}

/// Where `word` stands as a whole word.
fn places_of<'a>(text: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word)
        .map(|(at, _)| at)
        .filter(move |&at| !text[..at].ends_with(is_part) && !text[at + word.len()..].starts_with(is_part))
}

/// The top-level names that a file's code refers to by `crate::` or by enough `super::`.
fn used_names(file: &str, text: &str) -> BTreeSet<String> {
    let module = module_of(file);
    let mut names = BTreeSet::new();
    // Depth of inline modules, by their indentation: the formatter sees to it.
    let mut inline: Vec<usize> = Vec::new();
    let lines: Vec<String> = text.lines().map(code_of).collect();
    for (number, line) in lines.iter().enumerate() {
        let indent = line.len() - line.trim_start().len();
        if line.trim() == "}" && inline.last() == Some(&indent) {
            inline.pop();
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.contains(&"mod") && words.last() == Some(&"{") {
            inline.push(indent);
        }
        // Groups may run over several lines.
        let rest = lines[number..(number + 12).min(lines.len())].join("\n");
        for at in places_of(line, "crate") {
            if let Some(path) = rest[at..].strip_prefix("crate::") {
                names.extend(heads(path));
            }
        }
        for at in places_of(line, "super").filter(|&at| !line[..at].ends_with("super::")) {
            let mut path = &rest[at..];
            let mut up = 0;
            while let Some(tail) = path.strip_prefix("super::") {
                path = tail;
                up += 1;
            }
            if up > 0 && up == module.len() + inline.len() {
                names.extend(heads(path));
            }
        }
    }
    // A glob of the crate's root names no room.
    names.remove("");
    names
}

#[test]
fn every_crate_of_the_engine_has_its_place() {
    let folders =
        fs::read_dir(top().join("engine")).expect("the engine").map(|entry| entry.expect("an entry").path());
    let found: BTreeSet<String> = folders
        .filter(|path| path.join("Cargo.toml").exists())
        .map(|path| path.file_name().expect("a name").to_str().expect("UTF-8").to_owned())
        .collect();
    let known: BTreeSet<String> =
        CRATES.iter().filter(|(name, _)| !name.is_empty()).map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(found, known, "give a new crate its place in tests/layering.rs");
}

#[test]
fn no_arrow_between_rooms_of_a_crate_goes_upward() {
    let mut wrong = Vec::new();
    let mut arrows = BTreeSet::new();
    for (name, rooms) in CRATES {
        for (file, text) in files_of(name) {
            let Some(room) = module_of(&file).first().cloned() else { continue };
            let Some((_, allowed)) = rooms.iter().find(|(known, _)| *known == room) else {
                panic!("engine/{name}/src/{file}: give the room `{room}` its place in tests/layering.rs");
            };
            for used in used_names(&file, &text) {
                let used =
                    RE_EXPORTED.iter().find(|(name, _)| *name == used).map_or(&*used, |(_, file)| file);
                let is_here = rooms.iter().any(|(known, _)| *known == used);
                if is_here && used != room && !allowed.contains(&used) {
                    wrong.push(format!("engine/{name}/src/{file}: {room} uses {used}"));
                }
                arrows.insert((room.clone(), used.to_owned()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (room, used) in [("build", "winding"), ("winding", "lattice"), ("store", "brick")] {
        assert!(arrows.contains(&(room.to_owned(), used.to_owned())), "the search finds nothing: {arrows:?}");
    }
}

#[test]
fn uses_are_found_in_every_form() {
    let text = "use crate::{\n    brick::{Brick, Samples},\n    lattice::*,\n};\nuse super::super::store::Store;\n\
                fn f() -> crate::error::Result<()> {}\n// crate::contour::X\nmod tests {\n    \
                use super::super::super::winding;\n    use super::super::own;\n}\n";
    let names = used_names("build/jobs.rs", text);
    assert_eq!(names.into_iter().collect::<Vec<_>>(), ["brick", "error", "lattice", "store", "winding"]);
    assert!(used_names("build/mod.rs", "use super::gpu;").contains("gpu"));
    assert!(used_names("build/jobs.rs", "use super::bins; let s = \"crate::x\";").is_empty());
}

#[test]
fn unsafe_code_stands_in_its_rooms_and_says_why() {
    for (name, file, text) in engine() {
        let lines: Vec<&str> = text.lines().collect();
        for (number, line) in lines.iter().enumerate() {
            if places_of(&code_of(line), "unsafe").next().is_none() {
                continue;
            }
            let place = format!("engine/{name}/src/{file}:{}", number + 1);
            assert!((name, &*file) == ("core", "mmap.rs") || name == "gpu", "{place}: unsafe code");
            let above = lines[..number].iter().rev().map(|l| l.trim());
            let mut comment = above.skip_while(|l| l.starts_with("#[")).take_while(|l| l.starts_with("//"));
            // Of a function the comment says what callers must see to.
            let says_why = |l: &str| l.starts_with("// SAFETY:") || l == "/// # Safety";
            assert!(comment.any(says_why), "{place}: no SAFETY comment above");
        }
    }
    let core = fs::read_to_string(source_of("core").join("lib.rs")).expect("lib.rs");
    assert!(core.lines().any(|l| l == "#![deny(unsafe_code)]"));
    let lines: Vec<&str> = core.lines().collect();
    for pair in lines.windows(2).filter(|pair| pair[0].contains("allow(unsafe_code)")) {
        assert_eq!(pair[1], "pub mod mmap;", "unsafe code allowed elsewhere");
    }
    let safe = CRATES.iter().filter(|(name, _)| !["core", "gpu"].contains(name));
    for (name, _) in safe {
        let text = fs::read_to_string(source_of(name).join("lib.rs")).expect("lib.rs");
        assert!(text.lines().any(|l| l == "#![forbid(unsafe_code)]"), "engine/{name}");
    }
    let crate_roots =
        ["tools/src/main.rs", "tools/terminal/src/lib.rs", "tools/bench/src/main.rs", "shaders/src/lib.rs"];
    for crate_root in crate_roots {
        let text = fs::read_to_string(top().join(crate_root)).expect("a crate root");
        assert!(text.lines().any(|l| l == "#![forbid(unsafe_code)]"), "{crate_root}");
    }
    let judge = fs::read_to_string(top().join("bench-data/src/lib.rs")).expect("a crate root");
    assert!(judge.lines().all(|l| places_of(&code_of(l), "unsafe").next().is_none()));
}

#[test]
fn bincode_is_used_in_one_file() {
    for (name, file, text) in engine() {
        let used = text.lines().any(|l| places_of(&code_of(l), "bincode").next().is_some());
        assert_eq!(used, file == "store/meta.rs", "engine/{name}/src/{file}");
    }
}

#[test]
fn files_stay_readable() {
    for folder in ["engine", "tools", "shaders/src"] {
        for path in sources(&top().join(folder)) {
            let lines = fs::read_to_string(&path).expect("readable").lines().count();
            assert!(lines <= LINES_MAX, "{} has {lines} lines: split it", path.display());
        }
    }
}

#[test]
fn every_room_has_its_line_in_the_architecture() {
    let text = fs::read_to_string(top().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let section = text.split("\n## ").find(|s| s.starts_with("Rooms\n")).expect("a section `## Rooms`");
    let rooms: BTreeSet<String> =
        engine().iter().filter_map(|(_, f, _)| module_of(f).first().cloned()).collect();
    for room in rooms {
        let named = |line: &str| line.contains(&format!("`{room}`")) || line.contains(&format!("`{room}/`"));
        assert!(section.lines().any(named), "the section on rooms does not name `{room}`");
    }
}

/// Tables of files in the heads of modules name files that are there.
#[test]
fn tables_of_files_name_files() {
    let mut wrong = Vec::new();
    // The head of the facade has a table of features.
    for (name, file, text) in engine().into_iter().filter(|(name, ..)| !name.is_empty()) {
        let folder = module_of(&file).join("/");
        for row in text.lines().filter_map(|line| line.strip_prefix("//! | `")) {
            let names = row.split('|').next().unwrap_or_default();
            for named in
                names.split('`').map(|part| part.trim_matches([',', ' '])).filter(|part| !part.is_empty())
            {
                let below = source_of(name).join(&folder).join(named);
                if !below.with_extension("rs").exists() && !below.is_dir() {
                    wrong.push(format!("engine/{name}/src/{file} names `{named}`"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
