//! No two files of a crate import each other, directly or through others: what a file needs can be read before it.

use super::{CRATES, files_of};
use std::collections::{BTreeMap, BTreeSet};

/// A module of a crate, as its path from the root.
type Module = Vec<String>;

/// The modules that a file imports.
type Graph = BTreeMap<Module, BTreeSet<Module>>;

/// The code of a file without comments and unit tests.
fn code_of(text: &str) -> String {
    let mut code = String::new();
    let mut is_test = false;
    for line in text.lines().map(super::code_of) {
        if is_test && line.starts_with("mod ") && line.ends_with('{') {
            break;
        }
        is_test = line == "#[cfg(test)]";
        code.push_str(&line);
        code.push('\n');
    }
    code
}

/// The `use` declarations of some code: whether they are public, and each path with its groups spelled out.
fn uses(code: &str) -> Vec<(bool, String)> {
    let mut found = Vec::new();
    for statement in code.split(';') {
        // What stands before a declaration ends a line.
        let Some(at) = statement.match_indices("use ").map(|(at, _)| at).find(|&at| {
            let before = statement[..at].rsplit('\n').next().unwrap_or_default().trim();
            before.is_empty() || before.starts_with("pub")
        }) else {
            continue;
        };
        let is_public = statement[..at].rsplit('\n').next().is_some_and(|line| line.contains("pub"));
        let path: String = statement[at + 4..].split_whitespace().collect();
        expand(&path, &mut |path| found.push((is_public, path)));
    }
    found
}

/// Calls `each` with the paths that `a::{b, c::{d, e}}` stands for.
fn expand(path: &str, each: &mut dyn FnMut(String)) {
    let Some(open) = path.find('{') else { return each(path.to_owned()) };
    let (head, group) = (&path[..open], &path[open + 1..path.len() - 1]);
    let (mut depth, mut start) = (0, 0);
    for (at, c) in group.char_indices().chain([(group.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                if start < at {
                    expand(&format!("{head}{}", &group[start..at]), each);
                }
                start = at + 1;
            }
            _ => {}
        }
    }
}

/// A path as seen from the crate's root; `None` if it is another crate's.
fn absolute(module: &Module, path: &str, files: &BTreeMap<Module, String>) -> Option<Module> {
    let parts: Vec<String> = path.split("::").map(str::to_owned).collect();
    let ups = parts.iter().take_while(|part| *part == "super").count();
    match parts[0].as_str() {
        "crate" => Some(parts[1..].to_vec()),
        "self" => Some([module, &parts[1..]].concat()),
        _ if ups > 0 => Some([&module[..module.len().checked_sub(ups)?], &parts[ups..]].concat()),
        _ => {
            let child = [module, &parts[..1]].concat();
            files.contains_key(&child).then(|| [module, &parts[..]].concat())
        }
    }
}

/// Which files of a crate import which.
fn graph_of(name: &str) -> Graph {
    let is_test = |module: &Module| module.iter().any(|part| part == "tests" || part.ends_with("_tests"));
    let all = files_of(name).into_iter().map(|(file, text)| (super::module_of(&file), code_of(&text)));
    let files: BTreeMap<Module, String> = all.filter(|(module, _)| !is_test(module)).collect();
    // What a module passes on of others, by the name that it has there.
    let mut passed_on: BTreeMap<Module, Module> = BTreeMap::new();
    for (module, code) in &files {
        for (_, path) in uses(code).into_iter().filter(|(is_public, _)| *is_public) {
            if let Some(target) = absolute(module, &path, &files) {
                let name = path.rsplit("::").next().unwrap_or_default().to_owned();
                passed_on.insert([&module[..], &[name]].concat(), target);
            }
        }
    }
    let file_of = |mut path: Module| {
        for _ in 0..8 {
            let known = (1..=path.len())
                .rev()
                .find(|&n| passed_on.contains_key(&path[..n]) && !files.contains_key(&path[..n]));
            let Some(n) = known else { break };
            path = [&passed_on[&path[..n]][..], &path[n..]].concat();
        }
        while !files.contains_key(&path) && path.pop().is_some() {}
        path
    };
    let mut graph = Graph::new();
    for (module, code) in &files {
        let private = uses(code).into_iter().filter(|(is_public, _)| !is_public);
        let targets = private.filter_map(|(_, path)| absolute(module, &path, &files)).map(file_of);
        graph.insert(module.clone(), targets.filter(|target| target != module).collect());
    }
    graph
}

/// The files that can be reached from one.
fn reached<'a>(graph: &'a Graph, from: &'a Module) -> BTreeSet<&'a Module> {
    let (mut found, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(module) = open.pop() {
        open.extend(graph.get(module).into_iter().flatten().filter(|next| found.insert(*next)));
    }
    found
}

/// The files of the largest circle.
fn largest_circle(graph: &Graph) -> Vec<String> {
    let all: BTreeMap<&Module, BTreeSet<&Module>> =
        graph.keys().map(|module| (module, reached(graph, module))).collect();
    let circle = |module: &&Module| -> Vec<String> {
        let own =
            all[*module].iter().filter(|other| all.get(**other).is_some_and(|back| back.contains(*module)));
        own.map(|other| other.join("/")).collect()
    };
    all.keys().map(circle).max_by_key(Vec::len).unwrap_or_default()
}

#[test]
fn no_files_form_a_circle() {
    for (name, _) in CRATES.iter().filter(|(name, _)| !name.is_empty()) {
        let graph = graph_of(name);
        assert!(!graph.is_empty(), "engine/{name}");
        let circle = largest_circle(&graph);
        assert!(circle.is_empty(), "engine/{name}: {circle:?} import each other");
    }
}

#[test]
fn imports_are_found_in_every_form() {
    let code = code_of(
        "//! use super::a;\nuse super::{b::{C, D}, e};\npub(super) use f::G;\nfn h() {\n    use crate::i;\n}\n#[cfg(test)]\nmod tests {\n    use super::j;\n}\n",
    );
    let found: BTreeSet<(bool, String)> = uses(&code).into_iter().collect();
    let expected = [
        (false, "crate::i"),
        (false, "super::b::C"),
        (false, "super::b::D"),
        (false, "super::e"),
        (true, "f::G"),
    ];
    assert_eq!(
        found.into_iter().collect::<Vec<_>>(),
        expected.map(|(public, path)| (public, path.to_owned()))
    );
    let circle = [("a", "b"), ("b", "c"), ("c", "b")]
        .map(|(a, b)| (vec![a.to_owned()], BTreeSet::from([vec![b.to_owned()]])));
    assert_eq!(largest_circle(&Graph::from(circle)), ["b", "c"]);
}
