//! `mesh -o FOLDER/tileset.json`: 3D Tiles, read as their standard says.

use crate::support::*;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Level, and place in it.
type Place = (u32, [u32; 3]);

fn store(dir: &Scratch, at: [f32; 3], depth: &str) -> PathBuf {
    let moved = |p: [f32; 3]| std::array::from_fn(|a| p[a] + at[a]);
    let mut facets = cuboid(moved([0.0; 3]), moved([10.0, 8.0, 6.0]));
    facets.extend(cuboid(moved([6.0, 2.0, 3.0]), moved([14.0, 6.0, 9.0])));
    let input = dir.file(&format!("{}.stl", at[0]), binary_stl(24, &facets));
    let store = dir.path(&format!("{}.brf", at[0]));
    run(&[&"build", &input, &"-o", &store, &"--depth", &depth, &"--units", &"mm", &"-q"]).ok();
    store
}

fn parsed(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A template with its places filled.
fn named(template: &Value, (level, at): Place) -> String {
    let mut name = template.as_str().unwrap().replace("{level}", &level.to_string());
    for (axis, place) in ["{x}", "{y}", "{z}"].into_iter().zip(at) {
        name = name.replace(axis, &place.to_string());
    }
    name
}

/// Bits of a subtree: all that are there by tiles, files, subtrees below.
fn read_subtree(path: &Path) -> (Value, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap();
    let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], &bytes[4..8]), (&b"subt"[..], &[1, 0, 0, 0][..]));
    let (json, data) = (long(8), long(16));
    assert_eq!((json % 8, data % 8, bytes.len()), (0, 0, 24 + json + data));
    (serde_json::from_slice(&bytes[24..24 + json]).unwrap(), bytes[24 + json..].to_vec())
}

fn is_set(json: &Value, data: &[u8], availability: &Value, place: usize) -> bool {
    if let Some(constant) = availability["constant"].as_u64() {
        return constant == 1;
    }
    let view = &json["bufferViews"][availability["bitstream"].as_u64().unwrap() as usize];
    let [at, len] = ["byteOffset", "byteLength"].map(|name| view[name].as_u64().unwrap() as usize);
    assert!(place / 8 < len && at.is_multiple_of(8));
    data[at + place / 8] >> (place % 8) & 1 == 1
}

/// All tiles, and those that have a file.
fn tiles(folder: &Path) -> (Value, BTreeSet<Place>, BTreeSet<Place>) {
    let tileset = parsed(&folder.join("tileset.json"));
    let implicit = tileset["root"]["implicitTiling"].clone();
    assert_eq!(
        (&tileset["asset"]["version"], &implicit["subdivisionScheme"]),
        (&"1.1".into(), &"OCTREE".into())
    );
    let levels = implicit["subtreeLevels"].as_u64().unwrap() as u32;
    let (mut all, mut with_files, mut open) = (BTreeSet::new(), BTreeSet::new(), vec![(0, [0; 3])]);
    while let Some((level, at)) = open.pop() {
        let (json, data) = read_subtree(&folder.join(named(&implicit["subtrees"]["uri"], (level, at))));
        // x is the lowest bit of each three.
        let below = |depth: u32, n: usize| -> Place {
            let axis = |a: u32| (0..depth).fold(0, |sum, bit| sum | (n as u32 >> (3 * bit + a) & 1) << bit);
            (level + depth, [0, 1, 2].map(|a| at[a as usize] << depth | axis(a)))
        };
        for depth in 0..levels {
            for n in 0..1usize << (3 * depth) {
                let place = ((1 << (3 * depth)) - 1) / 7 + n;
                if is_set(&json, &data, &json["tileAvailability"], place) {
                    all.insert(below(depth, n));
                }
                if is_set(&json, &data, &json["contentAvailability"][0], place) {
                    with_files.insert(below(depth, n));
                }
            }
        }
        let goes_on = |n: &usize| is_set(&json, &data, &json["childSubtreeAvailability"], *n);
        open.extend((0..1usize << (3 * levels)).filter(goes_on).map(|n| below(levels, n)));
    }
    let most = implicit["availableLevels"].as_u64().unwrap() as u32;
    assert_eq!(all.last().unwrap().0 + 1, most);
    (tileset, all, with_files)
}

/// Triangles of a file with z up, each corner with its normal.
fn corners(path: &Path) -> Vec<[[[f64; 3]; 2]; 3]> {
    let bytes = std::fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(8), bytes.len() % 8), (&b"glTF"[..], bytes.len(), 0));
    let end = 20 + word(12);
    assert_eq!((end + 8) % 8, 0);
    let json: Value = serde_json::from_slice(&bytes[20..end]).unwrap();
    let data = &bytes[end + 8..];
    let indices = &json["accessors"][2];
    let first = json["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    let index = |n: usize| match indices["componentType"].as_u64().unwrap() {
        5123 => usize::from(u16::from_le_bytes(data[first + 2 * n..][..2].try_into().unwrap())),
        _ => u32::from_le_bytes(data[first + 4 * n..][..4].try_into().unwrap()) as usize,
    };
    let three = |at: usize| {
        [0, 1, 2].map(|a| f64::from(f32::from_le_bytes(data[at + 4 * a..][..4].try_into().unwrap())))
    };
    // y up to z up.
    let vertex = |n: usize| [three(24 * n), three(24 * n + 12)].map(|[x, y, z]| [x, -z, y]);
    let count = indices["count"].as_u64().unwrap() as usize;
    (0..count / 3).map(|n| [0, 1, 2].map(|c| vertex(index(3 * n + c)))).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|c| c.as_f64().unwrap()).collect()
}

#[test]
fn tiles_of_a_level_are_its_mesh_and_lie_in_their_boxes() {
    let dir = Scratch::new();
    // Far away, where 32 bits would not do.
    let store = store(&dir, [1_000_000.0, -20.0, 5.0], "3");
    let out = dir.path("tiles");
    let told = run(&[&"mesh", &store, &"-o", &out.join("tileset.json"), &"--json"]).json();
    let (tileset, all, with_files) = tiles(&out);
    assert_eq!(
        (told["tiles"].as_u64().unwrap(), told["levels"].as_u64().unwrap()),
        (with_files.len() as u64, 4)
    );
    let region = numbers(&tileset["root"]["boundingVolume"]["box"]);
    let middle = &numbers(&tileset["root"]["transform"])[12..15];
    let (edge, mut counts) = (2.0 * region[3], BTreeMap::new());
    let cell = |level: u32| edge / f64::from(32u32 << level);
    let mut nearest = [f64::MAX; 3];
    for place @ (level, at) in &with_files {
        assert!(*level == 0 || all.contains(&(level - 1, at.map(|c| c / 2))), "no parent");
        let triangles = corners(&out.join(named(&tileset["root"]["content"]["uri"], *place)));
        *counts.entry(*level).or_insert(0) += triangles.len() as u64;
        let size = edge / f64::from(1u32 << level);
        for triangle in &triangles {
            for [position, normal] in triangle {
                for a in 0..3 {
                    let low = region[a] - edge / 2.0 + size * f64::from(at[a]);
                    // A triangle whose middle is in the box ends a cell beyond it at most.
                    assert!(
                        (low - cell(*level) * 1.5..=low + size + cell(*level) * 1.5).contains(&position[a])
                    );
                    if *level == 3 {
                        nearest[a] = nearest[a].min(position[a] + middle[a]);
                    }
                }
                assert!((normal.iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-3);
            }
        }
    }
    // In metres, where it is.
    for (a, expected) in [1000.0, -0.02, 0.005].into_iter().enumerate() {
        assert!((nearest[a] - expected).abs() < cell(3), "{nearest:?}");
    }
    for level in 0..=3u32 {
        let stl = dir.path("level.ply");
        let mesh = run(&[&"mesh", &store, &"-o", &stl, &"--level", &level.to_string(), &"--json"]).json();
        assert_eq!(mesh["triangles"].as_u64(), counts.get(&level).copied(), "level {level}");
    }
    assert_eq!(told["finest"].as_u64(), counts.get(&3).copied());
    assert_eq!(told["triangles"].as_u64().unwrap(), counts.values().sum::<u64>());
}

#[test]
fn normals_are_those_of_faces_at_sharp_edges() {
    let dir = Scratch::new();
    let store = store(&dir, [0.0; 3], "2");
    let out = dir.path("tiles");
    run(&[&"mesh", &store, &"-o", &out.join("tileset.json"), &"--level", &"1", &"-q"]).ok();
    let (tileset, _, with_files) = tiles(&out);
    assert_eq!(tileset["root"]["implicitTiling"]["availableLevels"], 2);
    let (mut along, mut count) = (0, 0);
    for place in with_files.iter().filter(|(level, _)| *level == 1) {
        for triangle in corners(&out.join(named(&tileset["root"]["content"]["uri"], *place))) {
            for [_, normal] in triangle {
                count += 1;
                along += u32::from(normal.iter().any(|c| c.abs() > 0.999));
            }
        }
    }
    // Boxes along the axes have six directions.
    assert!(count > 1000 && f64::from(along) > 0.98 * f64::from(count), "{along} of {count}");
}

/// All files below a folder.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut found, mut open) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(some) = open.pop() {
        for entry in std::fs::read_dir(some).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().to_path_buf(), std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn tiles_are_the_same_for_any_number_of_threads_and_replace_older_ones_alone() {
    let dir = Scratch::new();
    let store = store(&dir, [0.0; 3], "2");
    let [one, three] = ["one", "three"].map(|name| dir.path(name));
    let name = one.join("tileset.json");
    run(&[&"mesh", &store, &"-o", &name, &"--threads", &"1", &"-q", &"--level", &"1"]).ok();
    run(&[&"mesh", &store, &"-o", &name, &"--threads", &"1", &"-q"]).ok();
    run(&[&"mesh", &store, &"-o", &three.join("tileset.json"), &"--threads", &"3", &"-q"]).ok();
    assert!(files(&one) == files(&three) && files(&one).len() > 20);
    std::fs::write(one.join("notes.txt"), "mine").unwrap();
    let told = run(&[&"mesh", &store, &"-o", &name]).failed();
    assert!(told.contains("notes.txt") && told.contains("a folder of another name"), "{told}");
    assert!(one.join("notes.txt").exists() && one.join("content/0/0/0/0.glb").exists());
}

#[test]
fn what_tiles_cannot_be_is_told_in_a_line() {
    let dir = Scratch::new();
    let store = store(&dir, [0.0; 3], "1");
    let name = dir.path("t").join("tileset.json");
    let told = run(&[&"mesh", &store, &"-o", &name, &"--detail", &"1mm"]).misused();
    assert!(told.contains("leave --detail out"), "{told}");
    assert!(run(&[&"mesh", &store, &"-o", &"tileset.json"]).misused().contains("a folder of their own"));
    let told = run(&[&"mesh", &store, &"-o", &name, &"--memory", &"100KiB"]).failed();
    assert!(told.contains("--level") && !dir.path("t").exists(), "{told}");
    assert!(run(&[&"mesh", &store, &"-o", &name, &"--level", &"7"]).failed().contains("there is no level 7"));
}
