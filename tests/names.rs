//! A name of a type means one thing in the whole workspace, so that a search for it finds it and nothing else.
//!
//! Types that no other file sees may repeat a name: they are short, and the file around them says what they are. The test
//! prints how many do.

use super::{identifier, sources, top};
use std::collections::BTreeMap;
use std::fs;

/// Folders with sources. Judges and harness are among them: whoever searches does not know in which folder.
const FOLDERS: [&str; 4] = ["engine", "tools", "shaders", "bench-data"];

/// Names that several files define, each with the reason.
const SHARED: [(&str, &str); 1] = [("Octree", "the Python class mirrors the library's type")];

/// Files that define the types of others once more, for a library without them.
const STAND_INS: [&str; 1] = ["engine/gpu/src/gpu/absent.rs"];

/// Files by the name of a type that they define.
type Definitions = BTreeMap<String, Vec<String>>;

/// The type that a line defines, and whether other files see it.
fn definition(line: &str) -> Option<(&str, bool)> {
    let code = line.trim_start();
    let (rest, is_visible) = match code.strip_prefix("pub") {
        Some(rest) if rest.starts_with('(') => (rest.split_once(')')?.1, true),
        Some(rest) => (rest, true),
        // What is indented stands in a function, a trait or a test.
        None if code.len() < line.len() => return None,
        None => (code, false),
    };
    let mut words = rest.split_whitespace().filter(|word| *word != "unsafe");
    let is_type = ["struct", "enum", "trait", "type", "union"].contains(&words.next()?);
    let name = identifier(words.next()?);
    (is_type && !name.is_empty()).then_some((name, is_visible))
}

/// All types that other files see, and all others.
fn definitions() -> [Definitions; 2] {
    let mut found = [Definitions::new(), Definitions::new()];
    for path in FOLDERS.iter().flat_map(|folder| sources(&top().join(folder))) {
        let place = path.strip_prefix(top()).expect("below the top").display().to_string();
        if STAND_INS.contains(&&*place) {
            continue;
        }
        let text = fs::read_to_string(&path).expect("readable");
        for (name, is_visible) in text.lines().filter_map(definition) {
            found[usize::from(!is_visible)].entry(name.to_owned()).or_default().push(place.clone());
        }
    }
    found
}

#[test]
fn a_type_name_means_one_thing() {
    let [visible, private] = definitions();
    assert!(visible.len() > 500 && visible.contains_key("BrickTree"), "the search finds nothing");
    let is_shared = |name: &str| SHARED.iter().any(|(shared, _)| *shared == name);
    let twice: Vec<_> =
        visible.iter().filter(|(name, places)| places.len() > 1 && !is_shared(name)).collect();
    assert!(twice.is_empty(), "name one of them for what it is:\n{twice:#?}");
    for (name, _) in SHARED {
        assert!(
            visible.get(name).is_some_and(|places| places.len() > 1),
            "`{name}` needs no exception any more"
        );
    }
    let repeated = |(name, places): &(&String, &Vec<String>)| places.len() > 1 || visible.contains_key(*name);
    let names = private.iter().filter(repeated).count();
    println!("{} types are seen by other files; {names} names of the others repeat", visible.len());
}

#[test]
fn definitions_are_found_in_every_form() {
    assert_eq!(definition("pub struct Ring<T> {"), Some(("Ring", true)));
    assert_eq!(definition("    pub(in super::super) unsafe trait Walk: Sync {"), Some(("Walk", true)));
    assert_eq!(definition("pub(crate) type Row = [f64; 3];"), Some(("Row", true)));
    assert_eq!(definition("enum Kind {"), Some(("Kind", false)));
    for other in ["    type Output = f64;", "/// A struct Kind", "pub fn kind() {", "pub use a::Kind;"] {
        assert_eq!(definition(other), None, "{other}");
    }
}
