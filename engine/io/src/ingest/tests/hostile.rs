//! Damaged and lying files: an error or a mesh, never a panic, and never memory that the file does not back.

use super::*;
use crate::ingest::{OpenOptions, Soup};
use crate::mmap::MappedFile;

/// Opens what may be damaged and, if it opens, uses it in every way.
fn exercise(folder: &Folder, name: &str, bytes: &[u8]) {
    let Ok(input) = folder.open(name, bytes) else { return };
    let held = match &input.soup {
        Soup::Mapped => 0,
        Soup::Facets(facets) => facets.all.capacity() * 36,
        Soup::Polygons(p) => p.vertices.capacity() * 24 + p.triangles.capacity() * 12,
        Soup::Beads(beads) => beads.swept.heap_bytes() as usize,
        Soup::Sweeps(sweeps) => sweeps.heap_bytes() as usize,
    };
    assert!(held <= 12 * bytes.len(), "{held} bytes for a file of {}", bytes.len());
    all(&input);
    input.bounds(&Silent).ok();
}

#[test]
fn every_truncation() {
    let folder = Folder::new();
    for (ending, format, bytes) in small().files() {
        let name = format!("mesh.{ending}");
        for length in 0..bytes.len() {
            exercise(&folder, &name, &bytes[..length]);
            // OBJ has no end mark. An STL text may end after any of its solids or, with a warning, its facets, and what
            // follows the last word of a text says nothing.
            let text = bytes[..length].trim_ascii();
            let whole_solid = text.ends_with(b"endsolid") || text.ends_with(b"endfacet");
            let may_do = format == "OBJ" || format.ends_with("ASCII") && length + 13 > bytes.len();
            if !(whole_solid || may_do) {
                folder.refusal(&name, &bytes[..length]);
            }
        }
    }
}

#[test]
fn every_byte_changed() {
    let folder = Folder::new();
    for (ending, _, bytes) in small().files() {
        let name = format!("mesh.{ending}");
        for at in 0..bytes.len() {
            for value in [0, 0xff, b'9', b'-', b'\n', b' ', bytes[at] ^ 1, bytes[at] ^ 0x80] {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                exercise(&folder, &name, &damaged);
            }
        }
    }
}

#[test]
fn stl_that_claims_what_is_not_there() {
    let folder = Folder::new();
    let mut bytes = vec![0; 84 + 50 * 3 + 17];
    bytes[80..84].fill(0xff);
    let text = folder.refusal("a.stl", &bytes);
    assert!(text.contains("claims 4294967295 facets (214748364834 bytes)"), "{text}");
    assert!(text.contains("after 3 whole facets (251 bytes)"), "{text}");
    let text = folder.refusal("a.stl", &bytes[..50]);
    assert!(text.contains("byte 50: ends inside the header"), "{text}");
}

#[test]
fn stl_with_a_trailer() {
    let folder = Folder::new();
    let bytes = small().stl();
    let with = |more: &[u8]| [&bytes[..], more].concat();
    for padding in [&b"\r\n"[..], &[7; 49], &[0; 1000]] {
        assert_eq!(folder.open("a.stl", &with(padding)).unwrap().facets(), 4);
    }
    for (more, room) in [(vec![7; 50], 1), (vec![7; 120], 2)] {
        let text = folder.refusal("a.stl", &with(&more));
        assert!(text.contains(&format!("byte 284: header claims 4 facets (284 bytes), but {}", more.len())));
        assert!(text.contains(&format!("room for {room} more")), "{text}");
    }
}

#[test]
fn ply_that_claims_what_is_not_there() {
    let folder = Folder::new();
    let header = |format: &str, vertices: &str, faces: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list uint int vertex_indices\nend_header\n"
        )
    };
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for (vertices, faces) in
            [("4294967295", "1"), ("0", "4294967295"), ("0", "999999999999999999"), ("1", "1")]
        {
            let text = folder.refusal("a.ply", header(format, vertices, faces).as_bytes());
            assert!(text.contains("claim") || text.contains("the file ends after 0"), "{text}");
        }
        let text = folder.refusal("a.ply", header(format, "4294967296", "1").as_bytes());
        assert!(text.contains("more than 4,294,967,295"), "{text}");
        folder.refusal("a.ply", header(format, "-1", "1").as_bytes());
        folder.refusal("a.ply", header(format, "99999999999999999999", "1").as_bytes());
    }
    // A list count that nothing backs.
    for count in [u32::MAX, i32::MAX as u32, 5, 1 << 30] {
        let mut bytes = header("binary_little_endian", "0", "1").into_bytes();
        bytes.extend(count.to_le_bytes());
        bytes.extend([0; 16]);
        let text = folder.refusal("a.ply", &bytes);
        assert!(text.contains("ends inside the property \"vertex_indices\" of row 1 of 1"), "{text}");
    }
    let text = folder.refusal("a.ply", (header("ascii", "1", "1") + "0 0 0\n4294967295 0").as_bytes());
    assert!(text.contains("line 11: the line has fewer"), "{text}");
    let text = folder.refusal("a.ply", (header("ascii", "1", "1") + "0 0 0\n3 0 0 1").as_bytes());
    assert!(text.contains("line 11: face names vertex 1"), "{text}");
    // A table whose rows take no bytes may claim any number of them.
    let empty = header("binary_big_endian", "1", "1")
        .replace("end_header", "element void 999999999999999999\nend_header");
    let bytes = [empty.as_bytes(), &[0; 12 + 4]].concat();
    assert_eq!(folder.open("a.ply", &bytes).unwrap().skipped_faces(), 1);
}

#[test]
fn one_face_of_very_many_corners() {
    let folder = Folder::new();
    let corners = 300_000;
    let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}", " 1 2 3".repeat(corners / 3));
    assert_eq!(folder.open("a.obj", text.as_bytes()).unwrap().facets(), corners as u64 - 2);
    // Continued lines are joined once each.
    let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}", " 1 2 3 \\\n".repeat(corners / 3));
    assert_eq!(folder.open("a.obj", text.as_bytes()).unwrap().facets(), corners as u64 - 2);
}

/// A strip of triangles, some hundred pages in each format.
fn strip() -> Mesh {
    let vertex = |n: u32| [n as f32, (n % 2) as f32, (n % 7) as f32 * 0.1];
    let count = 12_000;
    Mesh {
        vertices: (0..count).map(vertex).collect(),
        faces: (2..count).map(|n| vec![n - 2, n - 1, n]).collect(),
    }
}

#[test]
fn inputs_that_are_cut_short_are_errors() {
    let mesh = strip();
    let gcode: String = (0..20_000).map(|n| format!("G1 X{} Y{} E{}\n", n % 200, n / 200, n)).collect();
    let gcode = format!("M82\nG1 Z0.2 F1200\n{gcode}").into_bytes();
    let [little, big, ascii] =
        ["binary_little_endian", "binary_big_endian", "ascii"].map(|format| mesh.ply(format));
    let files = [
        ("a.stl", mesh.stl()),
        ("t.stl", mesh.stl_text()),
        ("a.obj", mesh.obj()),
        ("l.ply", little),
        ("b.ply", big),
        ("a.ply", ascii),
        ("a.gcode", gcode),
    ];
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        let path = dir.path().join(name);
        let half = bytes.len() as u64 / 2;
        let cut = |to| std::fs::File::options().write(true).open(&path).unwrap().set_len(to).unwrap();
        // After it was opened, and before it is read: whatever the readers make of zeros, they end, and the file is to
        // blame.
        std::fs::write(&path, &bytes).unwrap();
        let file = MappedFile::open(&path).unwrap();
        cut(half);
        let _ = Input::parse(&path, &file, &OpenOptions::default(), &Silent);
        let line = file.check().unwrap_err().to_string();
        assert!(line.contains(name) && line.contains("leave the file alone"), "{line}");
        // After it was parsed: who hashes or measures it finds out.
        std::fs::write(&path, &bytes).unwrap();
        let input = Input::open(&path, &Silent).unwrap_or_else(|error| panic!("{error}"));
        assert!(input.check().is_ok() && input.survey(&Silent).is_ok());
        cut(half);
        for told in [input.survey(&Silent).map(drop), input.identity().map(drop), input.check()] {
            let line = told.unwrap_err().to_string();
            assert!(line.contains(name) && !line.contains('\n'), "{line}");
        }
    }
}
