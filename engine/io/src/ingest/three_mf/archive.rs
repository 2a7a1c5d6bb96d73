//! The archive of a 3MF file: its models, unpacked and walked element by element.

use crate::error::{Error, Result};
use crate::progress::Progress;
use quick_xml::Reader;
use quick_xml::events::Event;
use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;
use zip::ZipArchive;

/// Largest element of a model.
const ELEMENT_BYTES_MAX: usize = 1 << 20;
/// Most that a byte of the archive may become: deflate reaches 1,032, models some 20.
const RATIO_MAX: u64 = 200;
/// Models of up to this size may become more.
const MODEL_BYTES: u64 = 1 << 24;
/// Bytes between two looks at whether the user wants to stop.
const REPORT_BYTES: usize = 1 << 20;

const REMEDY: &str = "export or copy the file again";
/// The model that names what is built.
const MAIN: &str = "3D/3dmodel.model";

/// A file that is open.
pub(super) struct Archive<'a> {
    path: &'a Path,
    zip: ZipArchive<Cursor<&'a [u8]>>,
    /// All files.
    names: Vec<String>,
    /// The model that names what is built, then those that it takes from.
    models: Vec<String>,
}

/// Takes an event of a model, the end of it included.
type EventSink<'a> = dyn FnMut(&str, &Event<'_>) -> std::result::Result<(), String> + 'a;

impl<'a> Archive<'a> {
    /// Of the bytes of a file.
    ///
    /// # Errors
    /// If it is no ZIP archive with a model.
    pub(super) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Archive<'a>> {
        let zip = ZipArchive::new(Cursor::new(bytes))
            .map_err(|error| damaged(path, "archive", &format!("is no sound ZIP archive: {error}")))?;
        let names: Vec<String> = zip.file_names().filter_map(|name| Some(name.ok()?.into_owned())).collect();
        let is_model = |name: &&String| name.to_ascii_lowercase().ends_with(".model");
        let mut models: Vec<String> = names.iter().filter(is_model).cloned().collect();
        models.sort_by_key(|name| (!name.eq_ignore_ascii_case(MAIN), name.clone()));
        if models.is_empty() {
            return Err(damaged(path, "archive", "holds no model (a file .model)"));
        }
        Ok(Archive { path, zip, names, models })
    }

    /// The model that names what is built.
    pub(super) fn main(&self) -> &str {
        &self.models[0]
    }

    /// All files.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Walks through all models.
    ///
    /// # Errors
    /// If a model is no well-formed XML, or unpacks to far more than any model does; what `take` says is wrong with it; if the
    /// user interrupts.
    pub(super) fn walk(&mut self, progress: &dyn Progress, take: &mut EventSink<'_>) -> Result<()> {
        for name in &self.models {
            progress.check()?;
            let wrong = |what: String| damaged(self.path, name, &what);
            let entry = self.zip.by_name(name).map_err(|error| wrong(error.to_string()))?;
            let left = MODEL_BYTES.max(entry.compressed_size().saturating_mul(RATIO_MAX));
            let since = Cell::new(0);
            let mut xml =
                Reader::from_reader(LimitedReader { inner: BufReader::new(entry), since: &since, left });
            let (mut buffer, mut read) = (Vec::new(), 0);
            loop {
                buffer.clear();
                read += since.replace(0);
                if read >= REPORT_BYTES {
                    read = 0;
                    progress.check()?;
                }
                let event = xml.read_event_into(&mut buffer);
                let event = event.map_err(|error| wrong(format!("is no well-formed XML: {error}")))?;
                take(name, &event).map_err(wrong)?;
                if event == Event::Eof {
                    break;
                }
            }
        }
        Ok(())
    }

    /// The text of a file, up to as much as a small model may have.
    ///
    /// # Errors
    /// If it cannot be unpacked.
    pub(super) fn text(&mut self, name: &str) -> Result<String> {
        let mut text = String::new();
        let entry = self.zip.by_name(name).map_err(|error| damaged(self.path, name, &error.to_string()))?;
        let read = entry.take(MODEL_BYTES).read_to_string(&mut text);
        read.map_err(|error| damaged(self.path, name, &error.to_string()))?;
        Ok(text)
    }
}

/// The error of a file of the archive.
pub(super) fn damaged(path: &Path, place: &str, what: &str) -> Error {
    Error::input(path, one_line(place), one_line(what), REMEDY)
}

/// Text of the file as it may stand in a line.
pub(super) fn one_line(text: &str) -> String {
    const SHOWN: usize = 200;
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(SHOWN).collect()
}

/// A model that is unpacked, with an end to what it and each of its elements may become.
struct LimitedReader<'a, R> {
    inner: BufReader<R>,
    /// Bytes since the last element.
    since: &'a Cell<usize>,
    left: u64,
}

impl<R: Read> Read for LimitedReader<'_, R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(out.len());
        out[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl<R: Read> BufRead for LimitedReader<'_, R> {
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
