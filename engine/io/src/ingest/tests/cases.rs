//! Particular files, and what is said about those that cannot be read.

use super::*;

#[test]
fn obj_statements() {
    let folder = Folder::new();
    let text = "\u{feff}# a face before its vertices, then every other statement there is\n\
                f 1 2 3\nv 0 0 0\nv 1 0 0 1\nv 0 1 0 .5 .5 .5\nv 0 0 1e0 # tip\nvn 0 0 1\nvt 0 0\nvp 0 0\n\
                o a\ng b c\ns 1\nusemtl d\nmtllib e f\nl 1 2\np 1\nf -4 -3 -2 -1\nf 1 2\nf\nf 1/1 4/1/1 3//1 # x\n";
    let input = folder.open("a.obj", text.as_bytes()).unwrap();
    let v = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // The quad is not planar, and seen from where it is largest not convex.
    let facets = [[0, 1, 2], [1, 2, 3], [3, 0, 1], [0, 3, 2]].map(|t| t.map(|i| v[i]));
    assert_eq!((all(&input), input.skipped_faces()), (facets.to_vec(), 2));
}

#[test]
fn obj_errors_name_the_line() {
    let folder = Folder::new();
    for (text, expected) in [
        ("v 0 0 0\nf 1 1 2\nf 1 1 3\nv 1 1 1", "line 3: face names vertex 3, but there are 2 vertices"),
        ("v 0 0 0\nf 9 1 1\nf 12 1 1", "line 2: face names vertex 9, but there are 1"),
        ("v 0 0 0\n\nf 1 -1 -2", "line 3: face names vertex -2, but there are 1"),
        ("v 0 0 0\nf 0 1 1", "line 2: face names vertex 0"),
        ("v 0 0 0\nf 99999999999 1 1", "line 2: face names vertex 99999999999"),
        ("v 0 0 0\nf 1 1.0 1", "line 2: corner \"1.0\" is not a vertex number"),
        ("v 0 0 0\nf 1 /1 1", "line 2: corner \"/1\" is not a vertex number"),
        ("v 0 0", "line 1: vertex with fewer than three coordinates"),
        ("v 0 \\\n0\nv a 0 0", "line 1: vertex with fewer than three coordinates"),
        ("v 0 \\\n0 0\nv 0,5 0 0", "line 3: coordinate \"0,5\" is not a number (decimal commas? "),
        ("v 0 0 0\n<html>", "line 2: \"<html>\" is not a statement"),
    ] {
        let said = folder.refusal("a.obj", text.as_bytes());
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn stl_text_errors_name_the_line() {
    let folder = Folder::new();
    let good = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n\
                endfacet\nendsolid a\n";
    assert_eq!(folder.open("a.stl", good.as_bytes()).unwrap().facets(), 1);
    assert_eq!(folder.open("a", good.replace('\n', "\r").as_bytes()).unwrap().facets(), 1);
    for (from, to, expected) in [
        ("endsolid a\n", "endsolid a\nfacet", "line 10: expected \"solid\" or the end"),
        ("endfacet\n", "", "line 8: expected \"endfacet\" of an ASCII STL, found \"endsolid\""),
        (
            "endloop\n",
            "vertex 1 1 1\nendloop\n",
            "line 7: expected \"endloop\" of an ASCII STL, found \"vertex\"",
        ),
        ("vertex 1 0 0\n", "", "line 6: expected \"vertex\""),
        ("1 0 0", "1 0", "line 6: expected a number of an ASCII STL, found \"vertex\""),
        ("1 0 0", "1 0 0x", "line 5: expected a number of an ASCII STL, found \"0x\""),
        ("normal 0 0 1", "normal 0 0 1 1", "line 2: expected \"outer\" of an ASCII STL, found \"1\""),
        ("normal 0 0 1", "norm", "line 2: expected \"normal\" of an ASCII STL, found \"norm\""),
        ("vertex 1 0 0", "vertex 1,5 0 0", "found \"1,5\" (decimal commas? write numbers with a point"),
        ("vertex 1 0 0", "vertex 1\x005 0 0", "found \"1\\05\" (there is a control byte in it)"),
    ] {
        let said = folder.refusal("a.stl", good.replacen(from, to, 1).as_bytes());
        assert!(said.contains(expected), "{said}");
    }
    // Read all the same.
    for (from, to) in [
        ("vertex 1 0 0", "vertex\0 1\x01 \x02 0 0\x7f"),
        ("facet normal 0 0 1\nouter", "facet outer"),
        ("normal 0 0 1", "normal 0 0"),
        ("normal 0 0 1", "normal nan nan nan\n# a comment\n// another\n; and one more\n"),
        ("endsolid a\n", "endsolid a\n\0\0\x1a"),
        ("endsolid a\n", ""),
        ("solid a\n", "\u{feff}SOLID \x01\u{e9}\t\n\x0c"),
        ("vertex 1 0 0", "VERTEX +1.0E+00 0e-3 -.0"),
    ] {
        let input = folder.open("a.stl", good.replacen(from, to, 1).as_bytes());
        let input = input.unwrap_or_else(|error| panic!("{to:?}: {error}"));
        assert_eq!(all(&input), [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], "{to:?}");
        assert_eq!(input.warnings().len(), usize::from(to.is_empty()), "{to:?}");
    }
    let empty = folder.open("a.stl", b"solid\nendsolid\n").unwrap();
    assert!(empty.bounds(&Silent).unwrap_err().to_string().contains("has no facets"));
}

#[test]
fn ply_headers() {
    let folder = Folder::new();
    let empty = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 0\nproperty list uchar uint vertex_indices\nend_header\n";
    let mesh = folder.open("a.ply", empty.as_bytes()).unwrap();
    assert!(mesh.bounds(&Silent).unwrap_err().to_string().contains("has no facets"));
    let good = "ply\nformat ascii 1.0\nelement face 1\nproperty list char uint vertex_index\n\
                element vertex 3\nproperty double z\nproperty short y\nproperty int8 x\nend_header\n\
                3 0 1 2\n0.1 0 0\n0 0 1\n\n 0 1 0 \n";
    for text in [good.to_owned(), good.replace('\n', "\r\n"), good.replace('\n', "\r")] {
        let input = folder.open("a.ply", text.as_bytes()).unwrap();
        assert_eq!(all(&input), [[[0.0, 0.0, 0.1], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
    }
    for (from, to) in [
        ("ply", "\u{feff}ply \t"),
        ("ply", "\r\n \nPLY\r"),
        ("format ascii 1.0", "FORMAT\tAscii   1.0  \nobj_info a b\n\ncomment c"),
        ("property double z", "Property Float64 Z "),
        ("vertex_index\n", "Vertex_Indices\nelement edge 0\nproperty list uint ushort e\n"),
        ("char uint", "ushort short"),
        ("end_header", "  end_header\t"),
        (" 0 1 0 \n", " 0 1 0 \n\0\x1a"),
    ] {
        let input = folder.open("a.ply", good.replacen(from, to, 1).as_bytes());
        let input = input.unwrap_or_else(|error| panic!("{to:?}: {error}"));
        assert_eq!(all(&input), [[[0.0, 0.0, 0.1], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], "{to:?}");
    }
    for (from, to, expected) in [
        ("0.1 0 0", "0,1 0 0", "line 11: coordinate \"0,1\" is not a number (decimal commas? "),
        (
            "element face 1\nproperty list char uint vertex_index\n",
            "",
            "is a point cloud (3 vertices, no faces)",
        ),
        ("face 1", "face 0", "is a point cloud"),
        ("face 1", "tristrips 1", "triangle strips"),
        ("vertex_index", "corners", "lacks a list of integers \"vertex_indices\""),
        ("char uint", "char float", "lacks a list of integers \"vertex_indices\""),
        ("char uint", "float uint", "line 4: \"property list float uint"),
        ("property int8 x\n", "", "lacks a plain property x, y or z"),
        ("element vertex 3", "element point 3", "no element \"vertex\""),
        (
            "element vertex",
            "element vertex 3\nelement vertex",
            "line 6: element \"vertex\" is declared twice",
        ),
        ("format ascii 1.0\n", "", "no line \"format\""),
        ("ascii", "binary", "line 2: unknown format"),
        ("end_header", "end_heade", "line 9: \"end_heade\" is not a statement"),
        ("int8 x", "int64 x", "line 8: \"property int64 x\""),
        ("format", "property int a\nformat", "line 2: property before the first element"),
        ("0 1 0 \n", "0 1 0\n1 2 3\n", "line 15: the text goes on"),
        ("0 1 0 \n", "0 1 0 0\n", "line 14: the line has more values"),
        ("0 1 0 \n", "0 1\n", "line 14: the line has fewer values"),
        ("3 0 1 2", "3 0 -1 2", "line 10: face names vertex -1"),
        ("3 0 1 2", "-3 0 1 2", "line 10: a list has the count -3"),
    ] {
        let said = folder.refusal("a.ply", good.replacen(from, to, 1).as_bytes());
        assert!(said.contains(expected), "{said}");
    }
    assert!(folder.refusal("a.ply", b"ply\nformat ascii 1.0\n").contains("line 3: the file ends inside"));
}

#[test]
fn binary_ply_errors_name_the_byte() {
    let folder = Folder::new();
    let mut bytes = small().ply("binary_little_endian");
    let length = bytes.len();
    bytes.push(1);
    let said = folder.refusal("a.ply", &bytes);
    assert!(said.contains(&format!("byte {length}: 1 bytes follow")), "{said}");
    bytes[length] = b'\n';
    assert_eq!(folder.open("a.ply", &bytes).unwrap().facets(), 4);
    // The last index of the last face: before it come a float and the row of the last table.
    bytes[length - 12..length - 8].copy_from_slice(&5i32.to_le_bytes());
    let said = folder.refusal("a.ply", &bytes);
    assert!(said.contains("face 3 names vertex 5 (counted from 0), but there are 5 vertices"), "{said}");
    bytes[length - 12..length - 8].copy_from_slice(&(-1i32).to_le_bytes());
    assert!(folder.refusal("a.ply", &bytes).contains("names vertex -1"));
}

#[test]
fn vertices_with_lists_and_unused_bad_vertices() {
    let folder = Folder::new();
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty list uchar short tags\n\
                      property char x\nproperty uchar y\nproperty float z\nelement face 1\n\
                      property list int ushort vertex_indices\nend_header\n"
        .to_vec();
    for (i, z) in [0.0f32, 1.0, 2.0, f32::NAN].into_iter().enumerate() {
        bytes.push(i as u8);
        bytes.extend(vec![9; 2 * i]);
        bytes.extend([-(i as i8) as u8, 200]);
        bytes.extend(z.to_be_bytes());
    }
    bytes.extend([0, 0, 0, 3, 0, 0, 0, 1, 0, 2]);
    let input = folder.open("a.ply", &bytes).unwrap();
    assert_eq!(all(&input), [[[0.0, 200.0, 0.0], [-1.0, 200.0, 1.0], [-2.0, 200.0, 2.0]]]);
    assert_eq!(input.bounds(&Silent).unwrap(), ([-2.0, 200.0, 0.0], [0.0, 200.0, 2.0]));
}

#[test]
fn not_a_mesh() {
    let folder = Folder::new();
    // A text whose end was overwritten.
    let damaged = [&b"solid "[..], &[b'a'; 80], b"\nfacet normal 0 0 1\n\n", &[0; 300]].concat();
    for (name, bytes, expected) in [
        ("a.stl", &b""[..], "is empty"),
        ("a", b"hello\n", "is neither STL nor OBJ nor PLY nor X3D nor G-code"),
        ("a.stl", &damaged, "line 4: expected \"outer\" of an ASCII STL, found the end of the file"),
        ("a.ply", b"\xff\xfep\0l\0y\0\n\0", "UTF-16"),
        ("a.stl", b"hello\n", "line 1: expected \"solid\""),
        ("a.obj", b"\x7fELF\0\0", "is a program"),
        ("a.obj", b"\0\x01\0\x02\0", "is not text"),
        ("a.ply", b"plywood\n", "does not begin with the line \"ply\""),
        ("a.3mf", b"PK\x03\x04\0\0", "is no sound ZIP archive"),
        ("a.zip", b"PK\x03\x04\0\0", "is a ZIP archive"),
        ("a", &[0; 4096], "is neither"),
        ("a.png", b"\x89PNG\r\n\x1a\n", "is a PNG picture, which cannot be read"),
        ("a.stp", b"nothing known", "is a STEP file, a CAD model, by its name; export the part as a mesh"),
        ("a.stl", &[0; 83], "ends inside the header"),
    ] {
        let said = folder.refusal(name, bytes);
        assert!(said.contains(expected), "{said}");
    }
    let missing = Input::open(&folder.0.path().join("none.stl"), &Silent).unwrap_err().to_string();
    assert!(missing.contains("none.stl: cannot open"), "{missing}");
    let directory = Input::open(folder.0.path(), &Silent).unwrap_err().to_string();
    assert!(directory.contains("is a directory"), "{directory}");
    let no_faces = folder.open("a.obj", b"v 0 0 0\n").unwrap();
    let said = no_faces.bounds(&Silent).unwrap_err().to_string();
    assert!(said.contains("OBJ: has no facets; give a mesh"), "{said}");
}

#[test]
fn text_that_overflows_is_named_by_facet() {
    let folder = Folder::new();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1e999 0\nv 0 nan 0\nf 1 2 1\nf 1 2 3 4\n";
    let said = folder.open("a.obj", text.as_bytes()).unwrap().bounds(&Silent).unwrap_err().to_string();
    assert!(said.contains("facet 2: has the corner (0, inf, 0), which is not finite"), "{said}");
}

#[test]
fn identity_is_of_the_content() {
    let folder = Folder::new();
    let mut bytes = vec![0; 84 + 50 * 200_000];
    bytes[80..84].copy_from_slice(&200_000u32.to_le_bytes());
    let first = folder.open("a.stl", &bytes).unwrap().identity().unwrap();
    assert_eq!(folder.open("b.stl", &bytes).unwrap().identity().unwrap(), first);
    let hashes = bytes.chunks(4 << 20).map(|chunk| *blake3::hash(chunk).as_bytes()).collect::<Vec<_>>();
    assert_eq!(first, *blake3::hash(hashes.concat().as_slice()).as_bytes());
    bytes[9_000_000] = 1;
    assert_ne!(folder.open("a.stl", &bytes).unwrap().identity().unwrap(), first);
}

#[test]
fn stops_when_asked() {
    struct Stop;
    impl crate::progress::Progress for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let folder = Folder::new();
    for (ending, format, bytes) in small().files() {
        let path = folder.write(&format!("a.{ending}"), &bytes);
        let stopped = Input::open(&path, &Stop).and_then(|input| input.bounds(&Stop).map(drop));
        assert!(matches!(stopped, Err(crate::error::Error::Interrupted)), "{format}");
    }
}

#[test]
fn x3d_by_content_and_ending() {
    let folder = Folder::new();
    for (name, bytes, wanted) in [
        ("a.x3dv", &b"#X3D V3.2 utf8\n"[..], "ClassicVRML encoding (save it in the XML encoding, .x3d)"),
        ("a.x3d", b"#X3D V3.2 utf8\n", "ClassicVRML"),
        ("a.wrl", b"#VRML V2.0 utf8\n", "a VRML file"),
        ("a.x3db", b"\xe0\x00\x00\x01\x00", "binary encoding"),
        ("a.x3d", b"", "is empty"),
        ("a.x3d", b"\x1f\x8b\x08", "gzip"),
        ("a.x3d", b"hello", "no element X3D"),
    ] {
        let told = folder.refusal(name, bytes);
        assert!(told.contains(wanted), "{name}: {told}");
    }
    let text = b"<X3D><Scene><Shape><Extrusion/></Shape><Shape><Box/></Shape></Scene></X3D>";
    let input = folder.open("beads.xml", text).unwrap();
    assert_eq!((input.describe(), input.facets(), input.warnings().len()), ("X3D", 12, 1));
    assert_eq!(input.bounds(&Silent).unwrap(), ([-1.0, 0.0, -1.0], [1.0, 1.0, 1.0]));
}
