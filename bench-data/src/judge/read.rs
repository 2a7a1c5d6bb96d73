//! Small readers for the files that the program writes: binary STL, binary PLY, OBJ.
//!
//! Kept apart from the engine's readers so that a writer and a reader that share a mistake do not agree.

use crate::StlFacet;
use std::path::Path;

/// A file's mesh as the file holds it.
#[derive(Clone, Debug, PartialEq)]
pub enum FileMesh {
    /// Facets without shared vertices.
    Soup(Vec<StlFacet>),
    /// Vertices and triangles.
    Indexed(Vec<[f64; 3]>, Vec<[u32; 3]>),
}

/// Why a file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The operating system's reason.
    #[error("cannot read the file: {0}")]
    Io(#[from] std::io::Error),
    /// The file is not what its ending says.
    #[error("{0}")]
    Format(String),
}

fn bad<T>(what: impl Into<String>) -> Result<T, ReadError> {
    Err(ReadError::Format(what.into()))
}

/// Reads a `.stl`, `.ply` or `.obj` file.
///
/// # Errors
/// If the file cannot be opened, has another ending, or does not follow its format.
pub fn read(path: &Path) -> Result<FileMesh, ReadError> {
    let bytes = std::fs::read(path)?;
    match path.extension().and_then(|e| e.to_str()) {
        Some("stl") => stl(&bytes).map(FileMesh::Soup),
        Some("ply") => ply(&bytes).map(|(v, t)| FileMesh::Indexed(v, t)),
        Some("obj") => obj(&bytes).map(|(v, t)| FileMesh::Indexed(v, t)),
        _ => bad("the ending is not .stl, .ply or .obj"),
    }
}

fn word<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|i| bytes[at + i])
}

/// Reads a binary STL file: exactly 84 + 50·n bytes. Stored normals are ignored.
///
/// # Errors
/// If the length does not fit the count.
pub fn stl(bytes: &[u8]) -> Result<Vec<StlFacet>, ReadError> {
    if bytes.len() < 84 {
        return bad("a binary STL file has at least 84 bytes");
    }
    let count = u32::from_le_bytes(word(bytes, 80)) as usize;
    if bytes.len() != 84 + 50 * count {
        return bad(format!("{count} facets take {} bytes, the file has {}", 84 + 50 * count, bytes.len()));
    }
    Ok(bytes[84..].chunks_exact(50).map(record).collect())
}

/// The corners of an STL record of 50 bytes.
fn record(bytes: &[u8]) -> StlFacet {
    let float = |i: usize| f32::from_le_bytes(word(bytes, 12 + 4 * i));
    std::array::from_fn(|v| std::array::from_fn(|a| float(3 * v + a)))
}

/// The same in double precision.
pub(crate) fn facet(bytes: &[u8]) -> [[f64; 3]; 3] {
    record(bytes).map(|v| v.map(f64::from))
}

type Indexed = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Reads an OBJ file: `v` and `f` lines (triangles, quads and larger convex faces as fans), the rest is skipped.
///
/// # Errors
/// If a line cannot be parsed or refers to a vertex that is not there.
pub fn obj(bytes: &[u8]) -> Result<Indexed, ReadError> {
    let Ok(text) = std::str::from_utf8(bytes) else { return bad("the OBJ file is not UTF-8") };
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f64> = words.map_while(|w| w.parse().ok()).take(3).collect();
                let Ok(vertex) = numbers.try_into() else {
                    return bad(format!("line {}: a vertex has three numbers", number + 1));
                };
                vertices.push(vertex);
            }
            Some("f") => {
                let corners: Option<Vec<u32>> = words.map(|w| corner(w, vertices.len())).collect();
                let Some(corners) = corners.filter(|c| c.len() >= 3) else {
                    return bad(format!("line {}: no face of at least three known vertices", number + 1));
                };
                triangles.extend(corners[1..].windows(2).map(|c| [corners[0], c[0], c[1]]));
            }
            _ => {}
        }
    }
    Ok((vertices, triangles))
}

/// The vertex of `v`, `v/t`, `v//n` or `v/t/n`, counted from 1, or back from the last if negative.
fn corner(word: &str, count: usize) -> Option<u32> {
    let index: i64 = word.split('/').next()?.parse().ok()?;
    let index = if index < 0 { index + count as i64 } else { index - 1 };
    (0..count as i64).contains(&index).then_some(index as u32)
}

/// Reads a binary little-endian PLY file of vertices and triangles; other properties are skipped.
///
/// # Errors
/// If the header is another kind of PLY, a face is not a triangle, or the data end early or late.
pub fn ply(bytes: &[u8]) -> Result<Indexed, ReadError> {
    let end = b"end_header\n";
    let Some(at) = bytes.windows(end.len()).position(|w| w == end) else {
        return bad("the PLY header does not end");
    };
    let header = PlyHeader::parse(std::str::from_utf8(&bytes[..at]).unwrap_or(""))?;
    let mut data = Cursor { bytes, at: at + end.len() };
    let mut vertices = Vec::with_capacity(header.vertices.min(bytes.len()));
    for _ in 0..header.vertices {
        let mut vertex = [0.0; 3];
        for (scalar, name) in &header.properties {
            let value = data.scalar(*scalar)?;
            if let Some(axis) = ["x", "y", "z"].iter().position(|a| a == name) {
                vertex[axis] = value;
            }
        }
        vertices.push(vertex);
    }
    let mut triangles = Vec::with_capacity(header.faces.min(bytes.len()));
    for _ in 0..header.faces {
        if data.scalar(header.list.0)? != 3.0 {
            return bad("a PLY face is not a triangle");
        }
        let scalar = header.list.1;
        triangles.push([
            data.scalar(scalar)? as u32,
            data.scalar(scalar)? as u32,
            data.scalar(scalar)? as u32,
        ]);
    }
    if data.at != bytes.len() {
        bad("bytes are left behind the PLY faces")
    } else {
        Ok((vertices, triangles))
    }
}

#[derive(Clone, Copy)]
enum Scalar {
    Int(usize, bool),
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Result<Scalar, ReadError> {
        Ok(match name {
            "char" | "int8" => Scalar::Int(1, true),
            "uchar" | "uint8" => Scalar::Int(1, false),
            "short" | "int16" => Scalar::Int(2, true),
            "ushort" | "uint16" => Scalar::Int(2, false),
            "int" | "int32" => Scalar::Int(4, true),
            "uint" | "uint32" => Scalar::Int(4, false),
            "float" | "float32" => Scalar::F32,
            "double" | "float64" => Scalar::F64,
            _ => return bad(format!("PLY has no type '{name}'")),
        })
    }
}

struct PlyHeader {
    vertices: usize,
    faces: usize,
    properties: Vec<(Scalar, String)>,
    list: (Scalar, Scalar),
}

impl PlyHeader {
    fn parse(text: &str) -> Result<PlyHeader, ReadError> {
        let mut header = PlyHeader {
            vertices: 0,
            faces: 0,
            properties: Vec::new(),
            list: (Scalar::Int(1, false), Scalar::Int(4, true)),
        };
        let mut binary = false;
        for line in text.lines() {
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words.as_slice() {
                ["format", kind, _] => binary = *kind == "binary_little_endian",
                ["element", "vertex", n] => header.vertices = count(n)?,
                ["element", "face", n] => header.faces = count(n)?,
                ["element", other, _] => return bad(format!("no use for the PLY element '{other}'")),
                ["property", "list", n, index, _] => header.list = (Scalar::parse(n)?, Scalar::parse(index)?),
                ["property", kind, name] => header.properties.push((Scalar::parse(kind)?, name.to_string())),
                _ => {}
            }
        }
        if binary { Ok(header) } else { bad("not a binary little-endian PLY file") }
    }
}

fn count(word: &str) -> Result<usize, ReadError> {
    word.parse().or_else(|_| bad(format!("'{word}' is no count")))
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        if self.bytes.len() < self.at + N {
            return bad("the PLY data end early");
        }
        self.at += N;
        Ok(word(self.bytes, self.at - N))
    }

    fn scalar(&mut self, kind: Scalar) -> Result<f64, ReadError> {
        Ok(match kind {
            Scalar::Int(1, true) => f64::from(i8::from_le_bytes(self.take()?)),
            Scalar::Int(1, false) => f64::from(u8::from_le_bytes(self.take()?)),
            Scalar::Int(2, true) => f64::from(i16::from_le_bytes(self.take()?)),
            Scalar::Int(2, false) => f64::from(u16::from_le_bytes(self.take()?)),
            Scalar::Int(_, true) => f64::from(i32::from_le_bytes(self.take()?)),
            Scalar::Int(_, false) => f64::from(u32::from_le_bytes(self.take()?)),
            Scalar::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }
}
