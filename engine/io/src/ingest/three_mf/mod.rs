//! What is in a 3MF file (3MF Consortium, Core Specification 1.3): its objects and what of them is built. `mesh` reads the
//! meshes themselves.
//!
//! The models in the archive are unpacked and walked element by element, never kept.

mod mesh;
mod slicer;

pub(super) use mesh::read;

use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use crate::progress::Progress;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use serde::Serialize;
use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;
use zip::ZipArchive;

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
/// Largest element of a model.
const ELEMENT_BYTES_MAX: usize = 1 << 20;
/// Most that a byte of the archive may become: deflate reaches 1,032, models some 20.
const RATIO_MAX: u64 = 200;
/// Models of up to this size may become more.
const MODEL_BYTES: u64 = 1 << 24;
/// Bytes between two looks at whether the user wants to stop.
const REPORT_BYTES: usize = 1 << 20;

const REMEDY: &str = "export or copy the file again";

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
        let damaged =
            |place: &str, what: String| Error::input(path, one_line(place), one_line(&what), REMEDY);
        let mut archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|error| damaged("archive", format!("is no sound ZIP archive: {error}")))?;
        let names = archive.file_names().filter_map(|name| Some(name.ok()?.into_owned()));
        let mut names: Vec<String> =
            names.filter(|name| name.to_ascii_lowercase().ends_with(".model")).collect();
        // The one that names what is built, then those that it takes from.
        names.sort_by_key(|name| (!name.eq_ignore_ascii_case("3D/3dmodel.model"), name.clone()));
        let mut found = ThreeMf { bytes: bytes.len() as u64, ..ThreeMf::default() };
        if names.is_empty() {
            return Err(damaged("archive", "holds no model (a file .model)".to_owned()));
        }
        for name in names {
            progress.check()?;
            let entry = archive.by_name(&name).map_err(|error| damaged(&name, error.to_string()))?;
            let most = MODEL_BYTES.max(entry.compressed_size().saturating_mul(RATIO_MAX));
            found.model(&name, entry, most, progress).map_err(|error| match error {
                Failed::Interrupted => Error::Interrupted,
                Failed::Model(what) => damaged(&name, what),
            })?;
        }
        Ok(found)
    }

    /// Walks through one model.
    fn model(
        &mut self,
        name: &str,
        entry: impl Read,
        most: u64,
        progress: &dyn Progress,
    ) -> std::result::Result<(), Failed> {
        let since = Cell::new(0);
        let limited = Limited { inner: BufReader::new(entry), since: &since, left: most };
        let mut xml = Reader::from_reader(limited);
        let mut buffer = Vec::new();
        let (mut in_application, mut read) = (false, 0);
        loop {
            buffer.clear();
            read += since.replace(0);
            if read >= REPORT_BYTES {
                read = 0;
                progress.check().map_err(|_| Failed::Interrupted)?;
            }
            let event = xml.read_event_into(&mut buffer);
            match event.map_err(|error| Failed::Model(format!("is no well-formed XML: {error}")))? {
                Event::Start(tag) | Event::Empty(tag) => {
                    in_application = self.element(name, &tag);
                }
                Event::Text(said) if in_application => {
                    self.application = Some(one_line(&said));
                    in_application = false;
                }
                Event::Eof => return Ok(()),
                _ => {}
            }
        }
    }

    /// Takes in an element; true if its text names the application.
    fn element(&mut self, model: &str, tag: &BytesStart<'_>) -> bool {
        let field = |wanted: &str| {
            let mut all = tag.attributes().flatten();
            let found = all.find(|a| a.key.local_name().as_ref() == wanted)?;
            Some(one_line(&found.value))
        };
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

enum Failed {
    Interrupted,
    Model(String),
}

/// Text of the file as it may stand in a line.
fn one_line(text: &str) -> String {
    const SHOWN: usize = 200;
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(SHOWN).collect()
}

/// A model that is unpacked, with an end to what it and each of its elements may become.
struct Limited<'a, R> {
    inner: BufReader<R>,
    /// Bytes since the last element.
    since: &'a Cell<usize>,
    left: u64,
}

impl<R: Read> Read for Limited<'_, R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(out.len());
        out[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl<R: Read> BufRead for Limited<'_, R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.since.get() > ELEMENT_BYTES_MAX {
            return Err(io::Error::other("an element is larger than any of a model"));
        }
        if self.left == 0 {
            return Err(io::Error::other("it unpacks to far more than any model does"));
        }
        self.inner.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.since.set(self.since.get() + count);
        self.left = self.left.saturating_sub(count as u64);
        self.inner.consume(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use std::io::Write;
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
