//! The formats of meshes that are read. A new one is a file with its reader and a line here: its ending, how a file is told to
//! be one, and what reads it.

use super::polygons::Polygons;
use super::{amf, foreign, gltf, obj, off, ply};
use crate::error::Result;
use crate::progress::Progress;
use std::path::Path;

/// What reads a file: its polygons, and the format in words, as in "PLY binary little-endian".
type Read = fn(&Path, &[u8], &dyn Progress) -> Result<(Polygons, &'static str)>;

/// The beginning of a file that is told apart.
pub(super) struct FileStart<'a> {
    pub path: &'a Path,
    /// All of it.
    pub bytes: &'a [u8],
    /// Its beginning, if that is text.
    pub text: Option<&'a [u8]>,
}

/// How a file is told to be of a format.
pub(super) enum TellTale {
    /// Surely.
    Surely(fn(&FileStart<'_>) -> bool),
    /// By its looks, if it is of no other format.
    Perhaps(fn(&FileStart<'_>) -> bool),
    /// Among other things; see `detect`.
    Elsewhere,
}

/// A format of meshes.
pub(super) struct MeshFormat {
    /// Ending of its files' names, in lower case; in upper case its name in lists.
    pub ending: &'static str,
    /// Its name where a file is one.
    pub name: &'static str,
    pub tell: TellTale,
    /// What a file of that ending is that is none.
    pub denial: Option<&'static str>,
    /// Of formats whose triangles are kept as they stand in the file nothing.
    pub read: Option<Read>,
}

impl PartialEq for MeshFormat {
    fn eq(&self, other: &MeshFormat) -> bool {
        self.ending == other.ending
    }
}

impl Eq for MeshFormat {}

impl std::fmt::Debug for MeshFormat {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.write_str(self.ending)
    }
}

use TellTale::{Elsewhere, Perhaps, Surely};

/// All formats.
#[rustfmt::skip]
pub(super) static FORMATS: [MeshFormat; 7] = [
    MeshFormat { ending: "stl", name: "STL", tell: Elsewhere, denial: None, read: None },
    MeshFormat { ending: "obj", name: "OBJ", tell: Perhaps(|file| file.text.is_some_and(obj::is_plausible)), denial: Some("is not text, as an OBJ mesh is"), read: Some(|path, bytes, bars| Ok((obj::read(path, bytes, bars)?, "OBJ"))) },
    MeshFormat { ending: "ply", name: "PLY", tell: Surely(|file| ply::is_ply(file.bytes)), denial: Some("does not begin with the line \"ply\""), read: Some(ply::read) },
    MeshFormat { ending: "off", name: "OFF", tell: Surely(|file| file.text.is_some_and(off::is_off)), denial: Some("is no OFF file, in spite of its name"), read: Some(|path, bytes, bars| Ok((off::read(path, bytes, bars)?, "OFF"))) },
    MeshFormat { ending: "3mf", name: "3MF", tell: Elsewhere, denial: Some("is no 3MF file, in spite of its name"), read: None },
    MeshFormat { ending: "amf", name: "AMF", tell: Surely(|file| foreign::by_content(file.path, file.bytes) == Some(foreign::AMF)), denial: Some("is no AMF file, in spite of its name"), read: Some(|path, bytes, bars| Ok((amf::read(path, bytes, bars)?, "AMF"))) },
    MeshFormat { ending: "glb", name: "glTF", tell: Surely(|file| gltf::is_glb(file.bytes)), denial: Some("is no binary glTF file, in spite of its name"), read: Some(|path, bytes, bars| Ok((gltf::read(path, bytes, bars)?, "glTF binary"))) },
];

impl MeshFormat {
    /// The format that a file is told to be surely, or by its looks.
    pub(super) fn of(file: &FileStart<'_>, is_sure: bool) -> Option<&'static MeshFormat> {
        FORMATS.iter().find(|format| match format.tell {
            Surely(is_it) => is_sure && is_it(file),
            Perhaps(is_it) => !is_sure && is_it(file),
            Elsewhere => false,
        })
    }

    /// The format of a name.
    pub(super) fn of_name(path: &Path) -> Option<&'static MeshFormat> {
        let ending = path.extension()?.to_str()?;
        FORMATS.iter().find(|format| format.ending.eq_ignore_ascii_case(ending))
    }
}

/// Endings of the names of meshes whose triangles are read, in lower case.
pub fn mesh_endings() -> impl Iterator<Item = &'static str> {
    FORMATS.iter().map(|format| format.ending)
}

/// Formats of meshes as a list, as in "STL, OBJ or PLY".
pub(super) fn listed(last: &str) -> String {
    let all: Vec<String> = mesh_endings().map(str::to_uppercase).collect();
    let (end, others) = all.split_last().expect("there are some");
    format!("{}{last}{end}", others.join(", "))
}

/// What can be given in place of a file that cannot be read.
pub fn readable() -> String {
    let meshes = listed(" or ");
    format!(
        "give a mesh as {meshes}, a toolpath as G-code, beads as X3D, or points as PLY, PCD, LAS, E57 or XYZ"
    )
}
