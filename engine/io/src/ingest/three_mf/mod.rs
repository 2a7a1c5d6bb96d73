//! What is in a 3MF file (3MF Consortium, Core Specification 1.3): its objects and what of them is built. `mesh` reads the
//! meshes themselves.
//!
//! The models in the archive are unpacked and walked element by element, never kept.

mod archive;
mod mesh;
mod slicer;

pub(super) use mesh::read;

use super::xml::attribute;
use crate::error::Result;
use crate::mmap::MappedFile;
use crate::progress::Progress;
use archive::{Archive, one_line};
use quick_xml::events::{BytesStart, Event};
use serde::Serialize;
use std::path::Path;

/// What such a file is called in messages.
pub(super) const WHAT: &str = "a 3MF file";

/// Whether a 3MF file holds what is sliced already: its name says so, or its table of contents where it is short.
pub(super) fn holds_toolpath(path: &Path, bytes: &[u8]) -> bool {
    const TABLE_BYTES: usize = 1 << 16;
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let table = &bytes[bytes.len().saturating_sub(TABLE_BYTES)..];
    name.ends_with(".gcode.3mf") || memchr::memmem::find(table, b".gcode.md5").is_some()
}

/// Most objects and items that are listed; there may be more, which are counted.
const LISTED_MAX: usize = 10_000;

/// The content of a 3MF file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ThreeMf {
    /// Size of the file in bytes.
    pub bytes: u64,
    /// The unit of length of its first model, as in "millimeter".
    pub unit: String,
    /// What wrote it, if it says so.
    pub application: Option<String>,
    /// Its objects.
    pub objects: Vec<ThreeMfObject>,
    /// What is to be built.
    pub items: Vec<ThreeMfItem>,
    /// Vertices of all objects.
    pub vertices: u64,
    /// Triangles of all objects.
    pub triangles: u64,
    /// Objects and items that are not listed, because there are too many.
    pub unlisted: u64,
}

/// A mesh, or a group of others.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ThreeMfObject {
    /// The file in the archive.
    pub model: String,
    /// Its number in the model.
    pub id: String,
    /// Its name, if it has one.
    pub name: Option<String>,
    /// As in "model", "support", "other".
    #[serde(rename = "type")]
    pub kind: String,
    /// Vertices of its mesh.
    pub vertices: u64,
    /// Triangles of its mesh.
    pub triangles: u64,
    /// Other objects that it consists of.
    pub components: u64,
}

/// An object's place on the plate.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ThreeMfItem {
    /// The object.
    pub object: String,
    /// Twelve numbers of a matrix, as they stand in the file.
    pub transform: Option<String>,
}

impl ThreeMf {
    /// Reads what is in the file `path`.
    ///
    /// # Errors
    /// If it is no ZIP archive with a model, if a model is no well-formed XML, or unpacks to far more than any model does;
    /// if the user interrupts.
    pub fn read(path: &Path, progress: &dyn Progress) -> Result<ThreeMf> {
        let file = MappedFile::open(path)?;
        let read = ThreeMf::of_bytes(path, file.bytes(), progress);
        file.check()?;
        read
    }

    /// Reads `bytes`, the content of the file `path`.
    pub(super) fn of_bytes(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<ThreeMf> {
        let mut archive = Archive::open(path, bytes)?;
        let mut found = ThreeMf { bytes: bytes.len() as u64, ..ThreeMf::default() };
        let mut in_application = false;
        archive.walk(progress, &mut |model, event| {
            match event {
                Event::Start(tag) | Event::Empty(tag) => in_application = found.element(model, tag),
                Event::Text(said) if in_application => {
                    found.application = Some(one_line(said));
                    in_application = false;
                }
                Event::Eof => in_application = false,
                _ => {}
            }
            Ok(())
        })?;
        Ok(found)
    }

    /// Takes in an element; true if its text names the application.
    fn element(&mut self, model: &str, tag: &BytesStart<'_>) -> bool {
        let field = |wanted: &str| attribute(tag, wanted).map(|value| one_line(&value));
        let (mut vertices, mut triangles, mut components) = (0, 0, 0);
        match tag.local_name().as_ref() {
            "vertex" => vertices = 1,
            "triangle" => triangles = 1,
            "component" => components = 1,
            "model" if self.unit.is_empty() => {
                self.unit = field("unit").unwrap_or_else(|| "millimeter".to_owned());
            }
            "object" if self.objects.len() < LISTED_MAX => self.objects.push(ThreeMfObject {
                model: one_line(model),
                id: field("id").unwrap_or_default(),
                name: field("name"),
                kind: field("type").unwrap_or_else(|| "model".to_owned()),
                ..ThreeMfObject::default()
            }),
            "item" if self.items.len() < LISTED_MAX => self.items.push(ThreeMfItem {
                object: field("objectid").unwrap_or_default(),
                transform: field("transform"),
            }),
            "object" | "item" => self.unlisted += 1,
            "metadata" => return field("name").as_deref() == Some("Application"),
            _ => {}
        }
        self.vertices += vertices;
        self.triangles += triangles;
        if let Some(object) = self.objects.last_mut().filter(|_| self.unlisted == 0) {
            object.vertices += vertices;
            object.triangles += triangles;
            object.components += components;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use std::io::{Cursor, Write};
    use zip::write::{SimpleFileOptions, ZipWriter};

    fn packed(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, content) in files {
            zip.start_file(*name, SimpleFileOptions::default()).unwrap();
            zip.write_all(content).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    fn read(bytes: &[u8]) -> Result<ThreeMf> {
        ThreeMf::of_bytes(Path::new("a.3mf"), bytes, &Silent)
    }

    const MODEL: &[u8] = b"<?xml version=\"1.0\"?><model unit=\"inch\" xmlns:p=\"x\"><metadata name=\"Application\">A \
        program</metadata><resources><object id=\"1\" name=\"lid\"><mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/>\
        <vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"></vertex></vertices><triangles><triangle v1=\"0\" \
        v2=\"1\" v3=\"2\"/></triangles></mesh></object><object id=\"2\" type=\"support\"><components><component \
        objectid=\"1\"/></components></object></resources><build><item objectid=\"2\" transform=\"1 0 0\"/></build></model>";

    #[test]
    fn objects_and_items_are_listed() {
        let bytes = packed(&[("_rels/.rels", b"<x/>"), ("3D/3dmodel.model", MODEL), ("3D/a.model", MODEL)]);
        let found = read(&bytes).unwrap();
        assert_eq!((&found.unit[..], found.application.as_deref()), ("inch", Some("A program")));
        assert_eq!((found.vertices, found.triangles, found.unlisted), (6, 2, 0));
        let first = &found.objects[0];
        assert_eq!((&first.id[..], first.name.as_deref(), &first.kind[..]), ("1", Some("lid"), "model"));
        assert_eq!((first.vertices, first.triangles, first.components), (3, 1, 0));
        assert_eq!((found.objects[1].components, &found.objects[1].kind[..]), (1, "support"));
        let item = ThreeMfItem { object: "2".to_owned(), transform: Some("1 0 0".to_owned()) };
        assert_eq!(found.items, [item.clone(), item]);
    }

    #[test]
    fn damage_is_told_in_a_line() {
        let whole = packed(&[("3D/3dmodel.model", MODEL)]);
        for (bytes, what) in [
            (b"PK\x03\x04".to_vec(), "is no sound ZIP archive"),
            (whole[..whole.len() / 2].to_vec(), "is no sound ZIP archive"),
            (packed(&[("a.txt", b"hello")]), "holds no model"),
            (packed(&[("a.model", b"<model><a></b>")]), "a.model: is no well-formed XML"),
            (packed(&[("a\nb.model", b"<model><a></b>")]), "a b.model: is no well-formed XML"),
            (packed(&[("a.model", &[b'<'; 1][..].repeat(1 << 22))]), "a.model: is no well-formed XML"),
            (packed(&[("a.model", &b"<a/>".repeat(8 << 20))]), "it unpacks to far more"),
        ] {
            let said = read(&bytes).unwrap_err().to_string();
            assert!(said.contains(what) && !said.contains('\n'), "{said}");
        }
    }
}
