//! The header of a PLY file: which elements follow, and how they are laid out.

use crate::error::{Error, Result};
use crate::ingest::text;
use std::path::Path;

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PlyEncoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &[u8]) -> Option<Scalar> {
        Some(match &word.to_ascii_lowercase()[..] {
            b"char" | b"int8" => Scalar::I8,
            b"uchar" | b"uint8" => Scalar::U8,
            b"short" | b"int16" => Scalar::I16,
            b"ushort" | b"uint16" => Scalar::U16,
            b"int" | b"int32" => Scalar::I32,
            b"uint" | b"uint32" => Scalar::U32,
            b"float" | b"float32" => Scalar::F32,
            b"double" | b"float64" => Scalar::F64,
            _ => return None,
        })
    }

    /// Size in a binary body.
    #[inline]
    pub(super) fn bytes(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    fn is_integer(self) -> bool {
        !matches!(self, Scalar::F32 | Scalar::F64)
    }
}

/// What a property holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PropertyShape {
    /// One number.
    One(Scalar),
    /// A count (of an integer type), then that many items.
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: Vec<u8>,
    pub(super) shape: PropertyShape,
}

/// A table of the body.
#[derive(Debug)]
pub(super) struct PlyElement {
    pub(super) name: Vec<u8>,
    /// Rows that the header claims.
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl PlyElement {
    /// Position of the property `name`, written in any case.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name.eq_ignore_ascii_case(name.as_bytes()))
    }

    /// Size of a row of a binary body if every list is empty.
    pub(super) fn least_bytes(&self) -> usize {
        let least = |p: &Property| match p.shape {
            PropertyShape::One(scalar) => scalar.bytes(),
            PropertyShape::List { count, .. } => count.bytes(),
        };
        self.properties.iter().map(least).sum()
    }

    pub(super) fn has_lists(&self) -> bool {
        self.properties.iter().any(|p| matches!(p.shape, PropertyShape::List { .. }))
    }
}

#[derive(Debug)]
pub(super) struct PlyHeader {
    pub(super) encoding: PlyEncoding,
    pub(super) elements: Vec<PlyElement>,
    /// Where the body begins.
    pub(super) body_byte: usize,
    /// Lines before the body.
    pub(super) lines: u64,
}

impl PlyHeader {
    pub(super) fn element(&self, name: &str) -> Option<&PlyElement> {
        self.elements.iter().find(|e| e.name == name.as_bytes())
    }
}

/// The word that every PLY begins with.
const MAGIC: &[u8] = b"ply";

/// Where the line after the first begins, and the byte that ends the header's lines, which the first line shows; `None` if
/// this is no PLY. The end has to be known, since the first byte of a binary body may look like a part of it. A byte
/// order mark and blank lines may come before the word, blanks after it.
fn first_line(bytes: &[u8]) -> Option<(usize, u8)> {
    let start = bytes.len() - text::without_mark(bytes).trim_ascii_start().len();
    let word = bytes[start..].first_chunk::<3>()?;
    let after = start + word.len();
    let blanks = |bytes: &[u8], blank: &[u8]| bytes.iter().take_while(|b| blank.contains(b)).count();
    let end = after + blanks(&bytes[after..], b" \t");
    let returns = blanks(&bytes[end..], b"\r");
    let next = match bytes.get(end + returns) {
        Some(b'\n') => (end + returns + 1, b'\n'),
        _ if returns > 0 => (end + 1, b'\r'),
        _ => return None,
    };
    word.eq_ignore_ascii_case(MAGIC).then_some(next)
}

/// True if `bytes` begin as a PLY does.
pub(in crate::ingest) fn is_ply(bytes: &[u8]) -> bool {
    first_line(bytes).is_some()
}

/// Reads the header. What is allocated is a small multiple of the header's own size.
///
/// # Errors
/// If it does not follow the format, naming the line.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<PlyHeader> {
    let error = |line: u64, what: String| {
        Error::input(path, format!("line {line}"), what, "repair the header or export the file again")
    };
    let (mut at, end) =
        first_line(bytes).ok_or_else(|| error(1, "does not begin with the line \"ply\"".into()))?;
    let mut encoding = None;
    let mut elements = Vec::new();
    let mut lines = bytes[..at].iter().filter(|b| **b == end).count() as u64;
    loop {
        let rest = &bytes[at..];
        let length = memchr::memchr(end, rest).ok_or_else(|| {
            error(lines + 1, "the file ends inside the header (there is no line \"end_header\")".into())
        })?;
        at += length + 1;
        lines += 1;
        let line = &rest[..length];
        if line.trim_ascii().eq_ignore_ascii_case(b"end_header") {
            let encoding =
                encoding.ok_or_else(|| error(lines, "the header has no line \"format\"".into()))?;
            return Ok(PlyHeader { encoding, elements, body_byte: at, lines });
        }
        statement(line, &mut encoding, &mut elements).map_err(|what| error(lines, what))?;
    }
}

/// Takes in one line of the header, or says what is wrong with it.
fn statement(
    mut line: &[u8],
    encoding: &mut Option<PlyEncoding>,
    elements: &mut Vec<PlyElement>,
) -> std::result::Result<(), String> {
    let whole = line.trim_ascii();
    let keyword = text::token(&mut line).map(<[u8]>::to_ascii_lowercase);
    match keyword.as_deref() {
        None | Some(b"comment" | b"obj_info") => {}
        Some(b"format") => {
            *encoding = Some(match text::token(&mut line).map(<[u8]>::to_ascii_lowercase).as_deref() {
                Some(b"ascii") => PlyEncoding::Ascii,
                Some(b"binary_little_endian") => PlyEncoding::LittleEndian,
                Some(b"binary_big_endian") => PlyEncoding::BigEndian,
                _ => return Err(format!("unknown format {}", text::quote(whole))),
            });
        }
        Some(b"element") => {
            let name = text::token(&mut line).map(<[u8]>::to_ascii_lowercase);
            let count = text::token(&mut line).and_then(text::integer).filter(|count| *count >= 0);
            let (Some(name), Some(count)) = (name, count) else {
                return Err(format!("{} does not name an element and its count", text::quote(whole)));
            };
            // Only the tables that are read have to be unambiguous.
            if matches!(&name[..], b"vertex" | b"face") && elements.iter().any(|e| e.name == name) {
                return Err(format!("element {} is declared twice", text::quote(&name)));
            }
            elements.push(PlyElement { name, count: count as u64, properties: Vec::new() });
        }
        Some(b"property") => {
            let element = elements.last_mut().ok_or("property before the first element")?;
            let property = property(line).ok_or_else(|| {
                format!("{} does not name a property and types that are known", text::quote(whole))
            })?;
            element.properties.push(property);
        }
        Some(_) => return Err(format!("{} is not a statement of a PLY header", text::quote(whole))),
    }
    Ok(())
}

/// What follows the word "property".
fn property(mut line: &[u8]) -> Option<Property> {
    let shape = match text::token(&mut line)? {
        word if word.eq_ignore_ascii_case(b"list") => {
            let mut next = || Scalar::parse(text::token(&mut line)?);
            let (count, item) = (next()?, next()?);
            count.is_integer().then_some(PropertyShape::List { count, item })?
        }
        word => PropertyShape::One(Scalar::parse(word)?),
    };
    let name = text::token(&mut line)?.into();
    Some(Property { name, shape })
}

/// The property of `face` that lists its corners, and the type of the items.
pub(super) fn corner_list(face: &PlyElement) -> Option<(usize, Scalar)> {
    let index = face.find("vertex_indices").or_else(|| face.find("vertex_index"))?;
    match face.properties[index].shape {
        PropertyShape::List { item, .. } if item.is_integer() => Some((index, item)),
        _ => None,
    }
}

/// The properties of `vertex` that hold x, y and z.
pub(super) fn coordinates(vertex: &PlyElement) -> Option<[(usize, Scalar); 3]> {
    columns(vertex, ["x", "y", "z"])
}

/// The properties of `vertex` that hold its normal, under any of the names in use.
pub(super) fn normals(vertex: &PlyElement) -> Option<[(usize, Scalar); 3]> {
    NORMALS.into_iter().find_map(|names| columns(vertex, names))
}

/// Names of the components of a normal.
const NORMALS: [[&str; 3]; 4] = [
    ["nx", "ny", "nz"],
    ["normal_x", "normal_y", "normal_z"],
    ["normalx", "normaly", "normalz"],
    ["n_x", "n_y", "n_z"],
];

fn columns(vertex: &PlyElement, names: [&str; 3]) -> Option<[(usize, Scalar); 3]> {
    let find = |name| {
        let index = vertex.find(name)?;
        match vertex.properties[index].shape {
            PropertyShape::One(scalar) => Some((index, scalar)),
            PropertyShape::List { .. } => None,
        }
    };
    let [x, y, z] = names.map(find);
    Some([x?, y?, z?])
}
