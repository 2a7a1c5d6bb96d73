//! Damaged and lying files: an error or a mesh, never a panic, and never memory that the file does not back.

use super::*;
use crate::ingest::Soup;

/// Opens what may be damaged and, if it opens, uses it in every way.
fn exercise(folder: &Folder, name: &str, bytes: &[u8]) {
    let Ok(input) = folder.open(name, bytes) else { return };
    let held = match &input.soup {
        Soup::Mapped => 0,
        Soup::Facets(facets) => facets.capacity() * 36,
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
            // OBJ has no end mark. An STL text may end after any of its solids, and what follows the last
            // word of a text says nothing.
            let whole_solid = bytes[..length].trim_ascii().ends_with(b"endsolid");
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
