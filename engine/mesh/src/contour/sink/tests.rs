//! Files of meshes, read by code of their own.

use super::*;
use crate::part::outputs::{NAME, cut_everywhere, fail_everywhere};

const POSITIONS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 2.0, 1e-7], [-3.25, 0.1, 7e8]];
const TRIANGLES: [[u32; 3]; 2] = [[0, 1, 2], [1, 3, 2]];

const FORMATS: [&str; 6] = ["a.stl", "a.ply", "a.obj", "a.3mf", "a.glb", "a.vtp"];
const FORMATS_WITH_NORMALS: [&str; 3] = ["a.ply", "a.obj", "a.glb"];
const NORMALS: [[f32; 3]; 4] = [[0.0, 0.0, 1.0], [0.6, 0.0, -0.8], [1.0, 0.0, 0.0], [0.1, -0.7, 1e-3]];

fn facets() -> Vec<MeshTriangle> {
    TRIANGLES.iter().map(|&ids| MeshTriangle { ids, corners: ids.map(|n| POSITIONS[n as usize]) }).collect()
}

fn write(path: &Path) -> Vec<u8> {
    write_in(path, None)
}

fn write_in(path: &Path, metres: Option<f64>) -> Vec<u8> {
    let mut sink = create_sink(path, metres).unwrap();
    // As of a leaf without any.
    sink.vertices(&[]).unwrap();
    sink.vertices(&[]).unwrap();
    sink.vertices(&POSITIONS[..3]).unwrap();
    sink.vertices(&POSITIONS[3..]).unwrap();
    sink.triangles(&facets()[..1]).unwrap();
    sink.triangles(&facets()[1..]).unwrap();
    assert!(!path.exists());
    sink.finish().unwrap();
    drop(sink);
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    bytes
}

fn write_with_normals(path: &Path) -> Vec<u8> {
    let mut sink = create_sink_with_normals(path, None).unwrap();
    sink.vertices_with_normals(&[], &[]).unwrap();
    sink.vertices_with_normals(&POSITIONS[..3], &NORMALS[..3]).unwrap();
    assert!(sink.vertices(&POSITIONS[3..]).unwrap_err().to_string().contains("0 normals for 1"));
    sink.vertices_with_normals(&POSITIONS[3..], &NORMALS[3..]).unwrap();
    sink.triangles(&facets()).unwrap();
    sink.finish().unwrap();
    std::fs::read(path).unwrap()
}

/// Positions and normals by turns.
fn both() -> Vec<f32> {
    POSITIONS.into_iter().zip(NORMALS).flat_map(|(p, n)| [p, n].concat()).collect()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn stl_round_trips() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = write(&dir.path().join("a.STL"));
    assert_eq!(bytes[80..84], 2u32.to_le_bytes());
    assert_eq!(bytes.len(), 84 + 2 * 50);
    assert!(!bytes.starts_with(b"solid"));
    for (record, facet) in bytes[84..].chunks_exact(50).zip(facets()) {
        let values = floats(&record[..48]);
        assert_eq!(values[3..], facet.corners.concat());
        let length = values[..3].iter().map(|n| n * n).sum::<f32>();
        assert!((length - 1.0).abs() < 1e-5);
        assert_eq!(record[48..], [0, 0]);
    }
    assert!(floats(&bytes[84..96])[2] > 0.99);
}

fn ply_header(bytes: &[u8]) -> &str {
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    std::str::from_utf8(&bytes[..at]).unwrap()
}

#[test]
fn ply_round_trips() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = write(&dir.path().join("a.ply"));
    let header = ply_header(&bytes);
    let at = header.len();
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
    assert!(header.contains("\nelement vertex 4\n") && header.contains("\nelement face 2\n"));
    assert_eq!(floats(&bytes[at..at + 48]), POSITIONS.concat());
    let faces: Vec<_> = bytes[at + 48..].chunks_exact(13).collect();
    assert_eq!(faces.len(), 2);
    for (face, ids) in faces.iter().zip(TRIANGLES) {
        assert_eq!(face[0], 3);
        assert_eq!(face[1..], ids.map(u32::to_le_bytes).concat());
    }
}

#[test]
fn obj_round_trips() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = write(&dir.path().join("a.obj"));
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for line in std::str::from_utf8(&bytes).unwrap().lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "v" => positions.push([1, 2, 3].map(|n: usize| words[n].parse::<f32>().unwrap())),
            "f" => faces.push([1, 2, 3].map(|n: usize| words[n].parse::<u32>().unwrap() - 1)),
            _ => assert_eq!(words[0], "#"),
        }
    }
    assert_eq!(positions, POSITIONS);
    assert_eq!(faces, TRIANGLES);
}

#[test]
fn ply_and_obj_round_trip_with_normals() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = write_with_normals(&dir.path().join("a.ply"));
    let header = ply_header(&bytes);
    let at = header.len();
    let normals =
        "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 2\n";
    assert!(header.contains("\nelement vertex 4\n") && header.contains(normals));
    assert_eq!(floats(&bytes[at..at + 96]), both());
    assert_eq!(bytes[at + 96..at + 109], [vec![3], TRIANGLES[0].map(u32::to_le_bytes).concat()].concat());
    assert_eq!(bytes.len(), at + 4 * 24 + 2 * 13);

    let bytes = write_with_normals(&dir.path().join("a.obj"));
    let (mut numbers, mut faces) = (Vec::new(), Vec::new());
    for line in std::str::from_utf8(&bytes).unwrap().lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "v" | "vn" => numbers.extend(words[1..].iter().map(|word| word.parse::<f32>().unwrap())),
            "f" => faces.push(words[1..].join(" ")),
            _ => assert_eq!(words[0], "#"),
        }
    }
    assert_eq!(numbers, both());
    assert_eq!(faces, ["1//1 2//2 3//3", "2//2 4//4 3//3"]);
}

#[test]
fn glb_round_trips_with_normals() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = write_with_normals(&dir.path().join("a.glb"));
    let (json, data) = read_glb(&bytes);
    let attributes = &json["meshes"][0]["primitives"][0]["attributes"];
    let stride = json["bufferViews"][0]["byteStride"].as_u64().unwrap() as usize;
    assert_eq!((stride, &json["bufferViews"][0]["byteLength"]), (24, &96.into()));
    let read = |attribute: &str| -> Vec<f32> {
        let accessor = &json["accessors"][attributes[attribute].as_u64().unwrap() as usize];
        assert_eq!((&accessor["componentType"], &accessor["type"]), (&5126.into(), &"VEC3".into()));
        assert_eq!((&accessor["count"], &accessor["bufferView"]), (&4.into(), &0.into()));
        let at = accessor["byteOffset"].as_u64().unwrap_or(0) as usize;
        (0..4).flat_map(|n| floats(&data[n * stride + at..][..12])).collect()
    };
    assert_eq!((read("POSITION"), read("NORMAL")), (POSITIONS.concat(), NORMALS.concat()));
    let bound = |name| -> Vec<f32> { serde_json::from_value(json["accessors"][0][name].clone()).unwrap() };
    assert_eq!((bound("min"), bound("max")), (vec![-3.25, 0.0, 0.0], vec![1.5, 2.0, 7e8]));
    let indices = &json["bufferViews"][1];
    assert_eq!((&indices["byteOffset"], &indices["byteLength"]), (&96.into(), &24.into()));
    assert_eq!(data[96..], TRIANGLES.as_flattened().iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>());
    assert_eq!(json["buffers"][0]["byteLength"], data.len());
}

#[test]
fn formats_without_normals_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.stl", "a.3mf", "a.STL"] {
        let refused = create_sink_with_normals(&dir.path().join(name), None).err().unwrap().to_string();
        assert!(refused.contains(name) && refused.contains(".ply, .obj, .glb"), "{refused}");
        assert!(!refused.contains('\n'));
    }
    let refused = create_sink_with_normals(Path::new("a.step"), None).err().unwrap().to_string();
    assert!(refused.contains("unknown mesh format"), "{refused}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// The JSON of a GLB file, and its data.
fn read_glb(bytes: &[u8]) -> (serde_json::Value, &[u8]) {
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], number(4), number(8)), (&b"glTF"[..], 2, bytes.len()));
    let json = number(12);
    assert_eq!((&bytes[16..20], json % 4), (&b"JSON"[..], 0));
    let data = &bytes[20 + json..];
    if !data.is_empty() {
        assert_eq!((number(20 + json), &data[4..8]), (data.len() - 8, &b"BIN\0"[..]));
    }
    (serde_json::from_slice(&bytes[20..20 + json]).unwrap(), data.get(8..).unwrap_or_default())
}

#[test]
fn glb_round_trips() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = write_in(&dir.path().join("a.glb"), Some(1e-3));
    let (json, data) = read_glb(&bytes);
    let accessors = &json["accessors"];
    assert_eq!((&accessors[0]["count"], &accessors[1]["count"]), (&4.into(), &6.into()));
    let bound = |name: &str| -> Vec<f32> { serde_json::from_value(accessors[0][name].clone()).unwrap() };
    assert_eq!((bound("min"), bound("max")), (vec![-3.25, 0.0, 0.0], vec![1.5, 2.0, 7e8]));
    let view = |n: usize| {
        let at = |name: &str| json["bufferViews"][n][name].as_u64().unwrap_or(0) as usize;
        &data[at("byteOffset")..at("byteOffset") + at("byteLength")]
    };
    assert_eq!(json["buffers"][0]["byteLength"], data.len());
    assert_eq!(floats(view(0)), POSITIONS.concat());
    assert_eq!(view(1), TRIANGLES.as_flattened().iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>());
    // Column by column; a point at the top of the part is up, along y, and a metre is a thousand of its units.
    let matrix: Vec<f64> = serde_json::from_value(json["nodes"][0]["matrix"].clone()).unwrap();
    let place = |p: [f64; 3]| [0, 1, 2].map(|row| (0..3).map(|n| matrix[4 * n + row] * p[n]).sum::<f64>());
    assert_eq!(place([0.0, 0.0, 1000.0]), [0.0, 1.0, 0.0]);
    assert_eq!(place([1000.0, 2000.0, 0.0]), [1.0, 0.0, -2.0]);
}

/// The attributes of the arrays of a `.vtp`, and the raw bytes.
fn read_vtp(bytes: &[u8]) -> (String, &[u8]) {
    let mark = b"<AppendedData encoding=\"raw\">\n_";
    let at = bytes.windows(mark.len()).position(|w| w == mark).unwrap();
    let end = b"\n</AppendedData>\n</VTKFile>\n";
    assert!(bytes.ends_with(end));
    let xml = std::str::from_utf8(&bytes[..at]).unwrap().to_owned() + "</VTKFile>";
    (xml, &bytes[at + mark.len()..bytes.len() - end.len()])
}

/// The bytes of an array.
fn vtp_array<'a>(xml: &str, raw: &'a [u8], name: &str) -> &'a [u8] {
    let arrays = elements(xml, "DataArray");
    let array = arrays.iter().find(|array| array[1] == name).unwrap();
    let at = array[4].parse::<usize>().unwrap();
    let length = u64::from_le_bytes(raw[at..at + 8].try_into().unwrap()) as usize;
    &raw[at + 8..at + 8 + length]
}

#[test]
fn vtp_round_trips() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = write(&dir.path().join("a.vtp"));
    let (xml, raw) = read_vtp(&bytes);
    let piece = &elements(&xml, "Piece")[0];
    assert_eq!((piece[0].as_str(), piece[4].as_str()), ("4", "2"));
    assert_eq!(floats(vtp_array(&xml, raw, "Points")), POSITIONS.concat());
    let long = |bytes: &[u8]| -> Vec<u64> {
        bytes.chunks_exact(8).map(|b| u64::from_le_bytes(b.try_into().unwrap())).collect()
    };
    let ids: Vec<u64> = TRIANGLES.concat().into_iter().map(u64::from).collect();
    assert_eq!(long(vtp_array(&xml, raw, "connectivity")), ids);
    assert_eq!(long(vtp_array(&xml, raw, "offsets")), [3, 6]);
}

/// Numbers that tell triangles apart.
struct Numbered;

impl FaceAttributes for Numbered {
    fn comments(&self) -> Vec<String> {
        vec!["feature 0 Skirt--1".to_owned()]
    }

    fn names(&self) -> Vec<&'static str> {
        vec!["bead", "layer"]
    }

    fn numbers(&mut self, facets: &[MeshTriangle]) -> Result<Vec<i32>> {
        Ok(facets.iter().flat_map(|facet| [facet.ids[2] as i32, -1]).collect())
    }
}

#[test]
fn doubles_and_numbers_of_triangles_round_trip() {
    let dir = tempfile::tempdir().unwrap();
    let base = [5e5, 5e6, -0.125];
    let placed = |name: &str| {
        let path = dir.path().join(name);
        let faces: Option<Box<dyn FaceAttributes>> = Some(Box::new(Numbered));
        let mut sink = PlacedSink::create(&path, Coordinates::DoubleFrom(base), faces).unwrap();
        sink.vertices(&POSITIONS).unwrap();
        facets().chunks(1).for_each(|part| sink.triangles(part).unwrap());
        sink.finish().unwrap();
        std::fs::read(path).unwrap()
    };
    let coordinates: Vec<u8> = POSITIONS
        .iter()
        .flat_map(|p| (0..3).map(|a| base[a] + f64::from(p[a])))
        .flat_map(f64::to_le_bytes)
        .collect();
    let bytes = placed("a.vtp");
    let (xml, raw) = read_vtp(&bytes);
    assert!(xml.contains("<!-- feature 0 Skirt- -1 -->") && xml.contains("<CellData Scalars=\"bead\">"));
    assert_eq!(vtp_array(&xml, raw, "Points"), coordinates);
    assert_eq!(vtp_array(&xml, raw, "bead"), [2, 2].map(i32::to_le_bytes).concat());
    assert_eq!(vtp_array(&xml, raw, "layer"), [-1, -1].map(i32::to_le_bytes).concat());
    let bytes = placed("a.ply");
    let header = ply_header(&bytes);
    assert!(
        header.contains("\ncomment feature 0 Skirt--1\n")
            && header.contains("property int layer\nend_header")
    );
    let (vertices, faces) = bytes[header.len()..].split_at(4 * 24);
    assert_eq!(vertices, coordinates);
    assert_eq!(faces.len(), 2 * 21);
    assert_eq!(faces[13..21], [2, -1].map(i32::to_le_bytes).concat());
}

/// The model of a 3MF file.
fn read_3mf(bytes: &[u8]) -> String {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut text = |name: &str| std::io::read_to_string(archive.by_name(name).unwrap()).unwrap();
    assert!(text("[Content_Types].xml").contains("3dmodel+xml"));
    assert!(text("_rels/.rels").contains("/3D/3dmodel.model"));
    text("3D/3dmodel.model")
}

/// The attributes of each element of a name.
fn elements(xml: &str, name: &str) -> Vec<Vec<String>> {
    let mut reader = quick_xml::Reader::from_str(xml);
    let mut found = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Eof => return found,
            quick_xml::events::Event::Empty(e) | quick_xml::events::Event::Start(e)
                if e.name().as_ref() == name =>
            {
                found.push(e.attributes().map(|a| a.unwrap().value.into_owned()).collect());
            }
            _ => {}
        }
    }
}

#[test]
fn three_mf_round_trips() {
    for (metres, unit, scale) in [
        (None, "millimeter", None),
        (Some(0.0254), "inch", None),
        (Some(2.54e-5), "meter", Some("0.0000254")),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let model = read_3mf(&write_in(&dir.path().join("a.3mf"), metres));
        assert_eq!(elements(&model, "model")[0][0], unit);
        let numbers = |name| -> Vec<f32> {
            elements(&model, name).concat().iter().map(|number| number.parse().unwrap()).collect()
        };
        assert_eq!(numbers("vertex"), POSITIONS.concat());
        assert_eq!(numbers("triangle"), TRIANGLES.concat().iter().map(|&n| n as f32).collect::<Vec<_>>());
        let item = &elements(&model, "item")[0];
        assert_eq!(item[0], elements(&model, "object")[0][0]);
        let transform = scale.map(|s| format!("{s} 0 0 0 {s} 0 0 0 {s} 0 0 0"));
        assert_eq!(item.get(1), transform.as_ref());
    }
}

#[test]
fn empty_meshes_are_files_too() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let path = dir.path().join(name);
        create_sink(&path, None).unwrap().finish().unwrap();
        std::fs::read(path).unwrap()
    };
    let glb = write("a.glb");
    let (json, data) = read_glb(&glb);
    assert!(data.is_empty() && json.get("meshes").is_none() && json["scenes"][0].is_object());
    let model = read_3mf(&write("a.3mf"));
    assert!(elements(&model, "object").is_empty() && elements(&model, "build").len() == 1);
}

#[test]
fn arrays_hold_what_they_are_given() {
    let mut arrays = MeshArrays::default();
    arrays.vertices(&POSITIONS[..3]).unwrap();
    arrays.vertices(&POSITIONS[3..]).unwrap();
    facets().chunks(1).for_each(|part| arrays.triangles(part).unwrap());
    arrays.finish().unwrap();
    assert_eq!(arrays, MeshArrays { positions: POSITIONS.to_vec(), triangles: TRIANGLES.to_vec() });
}

#[test]
fn an_unfinished_mesh_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    for name in FORMATS {
        std::fs::write(dir.path().join(name), "old").unwrap();
        let mut sink = create_sink(&dir.path().join(name), None).unwrap();
        sink.vertices(&POSITIONS).unwrap();
        drop(sink);
        assert_eq!(std::fs::read(dir.path().join(name)).unwrap(), b"old");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), FORMATS.len());
}

#[test]
fn every_call_may_fail_and_the_power_go() {
    let plain = FORMATS.map(|format| (format, false));
    for (format, normals) in plain.into_iter().chain(FORMATS_WITH_NORMALS.map(|format| (format, true))) {
        let &MeshFormat { begin, has_normals, .. } = format_of(Path::new(format)).unwrap();
        assert!(has_normals || !normals);
        // Enough for several writes.
        let many = vec![facets(); 1000].concat();
        let write = |disk| {
            let mut sink = begin(PartFile::create_on(disk, Path::new(NAME))?, None, normals)?;
            sink.vertices_with_normals(&POSITIONS, &NORMALS)?;
            (0..4).try_for_each(|_| sink.triangles(&many))?;
            sink.finish()
        };
        assert!(fail_everywhere(&write) >= 24, "{format}");
        assert!(cut_everywhere(&write, 10) > 100, "{format}");
    }
}

#[test]
fn errors_are_one_line_and_name_the_way_out() {
    let message = |path: &str| create_sink(Path::new(path), None).err().unwrap().to_string();
    assert!(message("a.step").contains(".stl (binary), .ply (binary), .obj, .3mf, .glb, .vtp"));
    let missing = message("/nonexistent/a.stl");
    assert!(missing.contains("/nonexistent/a.stl") && !missing.contains('\n'), "{missing}");
}
