//! 3MF: a ZIP archive of an XML model (3MF Consortium, Core Specification 1.3).

use super::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, VertexBytes, folder_of};
use crate::error::{Error, Result};
use crate::part::PartFile;
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

/// Most bytes of a line of small numbers, to reserve room by.
const LINE_BYTES: usize = 48;
/// Of deflate: the fastest, for one thread does it all. 40 bytes a line of text become 10 or 11.
const EFFORT: i64 = 1;
/// Indices stay below (Core Specification, §4.1.4).
const MOST_VERTICES: u64 = 1 << 31;

const CONTENT_TYPES: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    "\n",
    r#"<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">"#,
    r#"<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>"#,
    r#"<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>"#,
    "\n",
);
const RELATIONS: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    "\n",
    r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">"#,
    r#"<Relationship Target="/3D/3dmodel.model" Id="model" "#,
    r#"Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#,
    "\n",
);

/// The units that 3MF knows, in metres.
const UNITS: [(f64, &str); 6] = [
    (1e-6, "micron"),
    (1e-3, "millimeter"),
    (1e-2, "centimeter"),
    (0.0254, "inch"),
    (0.3048, "foot"),
    (1.0, "meter"),
];

/// Which part of the model has been begun.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Section {
    Nothing,
    Vertices,
    Triangles,
}

pub(super) struct ThreeMfSink {
    /// `None` when it is finished.
    zip: Option<ZipWriter<Archive>>,
    archive: Archive,
    path: PathBuf,
    vertices: u64,
    section: Section,
    /// What the positions are multiplied by where they are placed.
    scale: f64,
}

impl ThreeMfSink {
    /// `metres` is the length of the unit of the positions; 3MF's own is a millimetre.
    pub(super) fn new(file: PartFile, metres: Option<f64>) -> Result<ThreeMfSink> {
        let path = file.path().to_owned();
        let metres = metres.unwrap_or(1e-3);
        let known = UNITS.into_iter().find(|(length, _)| *length == metres);
        let (unit, scale) = known.map_or(("meter", metres), |(_, unit)| (unit, 1.0));
        let archive = Archive(Arc::new(Mutex::new(Output { file, at: 0, failed: None })));
        let zip = Some(ZipWriter::new(archive.clone()));
        let mut sink = ThreeMfSink { zip, archive, path, vertices: 0, section: Section::Nothing, scale };
        sink.begin("[Content_Types].xml", CONTENT_TYPES)?;
        sink.begin("_rels/.rels", RELATIONS)?;
        let model = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"{unit}\" xml:lang=\"en-US\" \
             xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">\n\
             <metadata name=\"Application\">Brickfield</metadata>\n<resources>\n"
        );
        sink.begin("3D/3dmodel.model", &model)?;
        Ok(sink)
    }

    /// Begins an entry of the archive.
    fn begin(&mut self, name: &str, content: &str) -> Result<()> {
        // The same bytes at any time. An entry may pass 4 GiB.
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(EFFORT))
            .last_modified_time(zip::DateTime::default())
            .unix_permissions(0o644)
            .large_file(true);
        let begun = self.zip.as_mut().map_or(Ok(()), |zip| zip.start_file(name, options));
        self.checked(begun.map_err(io::Error::from))?;
        self.write(content.as_bytes())
    }

    /// Writes a part of the model.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self.zip.as_mut().map_or(Ok(()), |zip| zip.write_all(bytes));
        self.checked(written)
    }

    /// What went wrong with the file, or else with the archive.
    fn checked(&self, done: io::Result<()>) -> Result<()> {
        let failed = self.archive.output().failed.take();
        failed.map_or(done, Err).map_err(Error::io(&self.path, "write"))
    }

    /// Places the objects of these numbers and finishes the file.
    pub(super) fn finish_objects(&mut self, objects: Range<usize>) -> Result<()> {
        let s = self.scale;
        let transform = match s == 1.0 {
            true => String::new(),
            false => format!(" transform=\"{s} 0 0 0 {s} 0 0 0 {s} 0 0 0\""),
        };
        let items: String =
            objects.map(|object| format!("<item objectid=\"{object}\"{transform}/>\n")).collect();
        let build =
            if items.is_empty() { "<build/>\n".to_owned() } else { format!("<build>\n{items}</build>\n") };
        self.write(format!("</resources>\n{build}</model>\n").as_bytes())?;
        let finished = self.zip.take().map_or(Ok(()), |zip| zip.finish().map(drop));
        self.checked(finished.map_err(io::Error::from))?;
        self.archive.output().file.finish()
    }

    /// Writes what stands between the parts of the model up to this one.
    fn enter(&mut self, section: Section) -> Result<()> {
        if self.section == Section::Nothing && section > Section::Nothing {
            self.write(b"<object id=\"1\" type=\"model\">\n<mesh>\n<vertices>\n")?;
        }
        if self.section < Section::Triangles && section == Section::Triangles {
            self.write(b"</vertices>\n<triangles>\n")?;
        }
        self.section = section;
        Ok(())
    }
}

/// Appends the elements of vertices.
pub(super) fn write_vertices(positions: &[[f32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(positions.len() * LINE_BYTES);
    for [x, y, z] in positions {
        // The shortest digits that read back as the same f32. Writing to memory cannot fail.
        let _ = writeln!(bytes, r#"<vertex x="{x}" y="{y}" z="{z}"/>"#);
    }
}

/// Appends the elements of triangles.
pub(super) fn write_triangles(triangles: &[[u32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(triangles.len() * LINE_BYTES);
    for [a, b, c] in triangles {
        let _ = writeln!(bytes, r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#);
    }
}

impl MeshSink for ThreeMfSink {
    fn encoding(&self) -> Option<MeshEncoding> {
        Some(MeshEncoding {
            vertices: VertexBytes::Positions(write_vertices),
            triangles: TriangleBytes::Numbered(write_triangles),
        })
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(&self.path)
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        let (section, bytes) = match part {
            MeshChunk::Vertices(count, bytes) => {
                self.vertices += count as u64;
                (Section::Vertices, bytes)
            }
            MeshChunk::Triangles(_, bytes) => (Section::Triangles, bytes),
        };
        if self.vertices >= MOST_VERTICES {
            return Err(Error::setting(
                format!("{}: a 3MF file cannot hold 2^31 vertices", self.path.display()),
                "write .ply or choose a coarser level with `level`",
            ));
        }
        if bytes.is_empty() {
            return Ok(());
        }
        self.enter(section)?;
        self.write(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        if self.section == Section::Nothing {
            return self.finish_objects(1..1);
        }
        self.write(b"</triangles>\n</mesh>\n</object>\n")?;
        self.finish_objects(1..2)
    }
}

/// The file as the archive writes it: with a place that it goes back from to correct what it wrote.
#[derive(Clone)]
struct Archive(Arc<Mutex<Output>>);

struct Output {
    file: PartFile,
    at: u64,
    /// The first error. The archive is not told: when it is dropped it tries to finish, and would print one.
    failed: Option<io::Error>,
}

impl Archive {
    /// No code that may panic runs under the lock, so a poisoned one holds sound data.
    fn output(&self) -> MutexGuard<'_, Output> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for Archive {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Output { file, at, failed } = &mut *self.output();
        if failed.is_none() {
            let end = file.appended();
            let done = if *at == end { file.write_all(bytes) } else { file.write_over(*at, bytes) };
            *failed = done.err();
        }
        *at += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Archive {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let Output { file, at, .. } = &mut *self.output();
        let (from, by) = match to {
            SeekFrom::Start(place) => (place, 0),
            SeekFrom::End(by) => (file.appended(), by),
            SeekFrom::Current(by) => (*at, by),
        };
        *at = from.checked_add_signed(by).ok_or(io::ErrorKind::InvalidInput)?;
        Ok(*at)
    }
}
