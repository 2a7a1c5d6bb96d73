//! Tests over whole files, which they write themselves.

mod cases;
mod hostile;
mod roundtrip;
mod toolpaths;

use super::{Facet, Input};
use crate::error::Result;
use crate::progress::Silent;
use std::fmt::Write;
use std::path::PathBuf;

/// Vertices and faces of any number of corners.
#[derive(Clone, Debug)]
struct Mesh {
    vertices: Vec<[f32; 3]>,
    faces: Vec<Vec<u32>>,
}

/// Two triangles and a quad over five vertices, with coordinates that a decimal text cannot hold exactly.
fn small() -> Mesh {
    Mesh {
        vertices: vec![
            [0.0, 0.1, 1e-9],
            [1.0, -0.3, 0.0],
            [1.5, 2.0e7, 0.7],
            [0.0, 1.0, 3.0],
            [2.0, 2.0, 2.0],
        ],
        faces: vec![vec![0, 1, 2], vec![0, 2, 3, 4], vec![4, 3, 2]],
    }
}

impl Mesh {
    /// The fan of each face, written down independently of the reader.
    fn facets(&self) -> Vec<Facet> {
        let at = |v: u32| self.vertices[v as usize].map(f64::from);
        let fan = |f: &Vec<u32>| -> Vec<Facet> {
            (2..f.len()).map(|i| [at(f[0]), at(f[i - 1]), at(f[i])]).collect()
        };
        self.faces.iter().flat_map(fan).collect()
    }

    fn stl(&self) -> Vec<u8> {
        let mut bytes = b"solid, says the header of this binary file".to_vec();
        bytes.resize(80, b' ');
        let facets = self.facets();
        bytes.extend((facets.len() as u32).to_le_bytes());
        for facet in facets {
            bytes.extend([f32::NAN; 3].map(f32::to_le_bytes).as_flattened());
            for c in facet.as_flattened() {
                bytes.extend((*c as f32).to_le_bytes());
            }
            bytes.extend([0x12, 0x34]);
        }
        bytes
    }

    fn stl_text(&self) -> Vec<u8> {
        let mut text = String::from("solid of facets and such\r\n");
        for (i, facet) in self.facets().iter().enumerate() {
            text += " FACET normal 0 -nan(ind) 1e0\r\n  outer Loop\r\n";
            // The shortest text of the f64 that equals the f32, for text is read in double precision.
            for [x, y, z] in *facet {
                writeln!(text, "\tvertex {x:e} +{y:e} {z}").unwrap();
            }
            text += "endloop endfacet\n";
            if i == 1 {
                text += "endsolid\n\nsolid\n";
            }
        }
        text = text.replace("+-", "-");
        (text + "endsolid of facets").into_bytes()
    }

    fn obj(&self) -> Vec<u8> {
        let mut text = String::from("# c:\\models\\\nmtllib a\nvn 0 0 1\nvt 0 0\n");
        for (i, [x, y, z]) in self.vertices.iter().enumerate() {
            let [x, y, z] = [x, y, z].map(|c| f64::from(*c));
            writeln!(text, "v {x:e} {y} {z}{}", ["", " 1.0", " 0.5 0.5 0.5"][i % 3]).unwrap();
        }
        text += "o part\ng a b\ns off\n";
        for (i, face) in self.faces.iter().enumerate() {
            text += "f";
            for &v in face {
                let (v, back) = (v + 1, i64::from(v) - self.vertices.len() as i64);
                match i % 6 {
                    0 => write!(text, " {v}"),
                    1 => write!(text, " {v}/1"),
                    2 => write!(text, " {v}//1"),
                    3 => write!(text, " {v}/1/1"),
                    4 => write!(text, " {back}/-1"),
                    _ => write!(text, " \\\r\n {back}"),
                }
                .unwrap();
            }
            text += ["\n", "\r\n", " # end\n"][i % 3];
        }
        text.into_bytes()
    }

    /// PLY with tables and columns of no interest before, between and after those that are read.
    fn ply(&self, format: &str) -> Vec<u8> {
        let mut bytes = format!(
            "ply\nformat {format} 1.0\ncomment made by a test\nelement junk 2\nproperty short a\n\
             property list uchar double b\nelement nothing 7\nelement vertex {}\nproperty uchar red\n\
             property float x\nproperty double y\nproperty float32 z\nproperty ushort q\n\
             element face {}\nproperty list ushort char before\nproperty list uint8 int vertex_indices\n\
             property float after\nelement edge 1\nproperty int v\nend_header\n",
            self.vertices.len(),
            self.faces.len()
        )
        .into_bytes();
        let mut body = Body { format, bytes: &mut bytes };
        for junk in 0..2u8 {
            body.row(&[V::I16(-5), V::U8(junk)]);
            body.row(&vec![V::F64(-1.5); junk as usize]);
            body.end();
        }
        for &[x, y, z] in &self.vertices {
            body.row(&[V::U8(200), V::F32(x), V::F64(y.into()), V::F32(z), V::U16(40_000)]);
            body.end();
        }
        for (i, face) in self.faces.iter().enumerate() {
            let before = vec![V::I8(-7); i % 3];
            body.row(&[V::U16(before.len() as u16)]);
            body.row(&before);
            body.row(&[V::U8(face.len() as u8)]);
            body.row(&face.iter().map(|&v| V::I32(v as i32)).collect::<Vec<_>>());
            body.row(&[V::F32(0.5)]);
            body.end();
        }
        body.row(&[V::I32(i32::MIN)]);
        body.end();
        bytes
    }

    /// The mesh in every form that holds it exactly, with the ending and description of each.
    fn files(&self) -> Vec<(&'static str, &'static str, Vec<u8>)> {
        vec![
            ("stl", "STL binary", self.stl()),
            ("stl", "STL ASCII", self.stl_text()),
            ("obj", "OBJ", self.obj()),
            ("ply", "PLY ASCII", self.ply("ascii")),
            ("ply", "PLY binary little-endian", self.ply("binary_little_endian")),
            ("ply", "PLY binary big-endian", self.ply("binary_big_endian")),
        ]
    }
}

/// A value of a PLY body.
#[derive(Clone, Copy, Debug)]
enum V {
    I8(i8),
    U8(u8),
    I16(i16),
    U16(u16),
    I32(i32),
    F32(f32),
    F64(f64),
}

struct Body<'a> {
    format: &'a str,
    bytes: &'a mut Vec<u8>,
}

impl Body<'_> {
    fn row(&mut self, values: &[V]) {
        for value in values {
            let (text, mut binary) = match *value {
                V::I8(v) => (v.to_string(), v.to_le_bytes().to_vec()),
                V::U8(v) => (v.to_string(), v.to_le_bytes().to_vec()),
                V::I16(v) => (v.to_string(), v.to_le_bytes().to_vec()),
                V::U16(v) => (v.to_string(), v.to_le_bytes().to_vec()),
                V::I32(v) => (v.to_string(), v.to_le_bytes().to_vec()),
                V::F32(v) => (v.to_string(), v.to_le_bytes().to_vec()),
                V::F64(v) => (format!("{v:e}"), v.to_le_bytes().to_vec()),
            };
            match self.format {
                "ascii" => self.bytes.extend(format!("{text} ").bytes()),
                "binary_little_endian" => self.bytes.extend(binary),
                _ => {
                    binary.reverse();
                    self.bytes.extend(binary);
                }
            }
        }
    }

    fn end(&mut self) {
        if self.format == "ascii" {
            self.bytes.push(b'\n');
        }
    }
}

/// A folder of its own for files to read.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn open(&self, name: &str, bytes: &[u8]) -> Result<Input> {
        Input::open(&self.write(name, bytes), &Silent)
    }

    /// What is said about a file that cannot be opened.
    fn refusal(&self, name: &str, bytes: &[u8]) -> String {
        match self.open(name, bytes) {
            Ok(input) => panic!("{name} was read as {} with {} facets", input.describe(), input.facets()),
            Err(error) => {
                let text = error.to_string();
                assert!(!text.contains('\n'), "more than one line: {text}");
                text
            }
        }
    }
}

/// All facets of `input`.
fn all(input: &Input) -> Vec<Facet> {
    let mut out = Vec::new();
    input.read(0..input.facets(), &mut out);
    assert_eq!(out.len() as u64, input.facets());
    out
}
