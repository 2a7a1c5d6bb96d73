//! G-code in a ZIP archive, as `.gcode.3mf` files of printers hold it: one toolpath a plate.

use crate::error::{Error, Result};
use flate2::Crc;
use flate2::read::DeflateDecoder;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Take};
use std::path::Path;
use zip::{CompressionMethod, ZipArchive};

/// How an archive begins.
const MAGIC: &[u8] = b"PK\x03\x04";
const REMEDY: &str = "export or copy the file again";

/// Whether a file is a ZIP archive.
pub(super) fn is_archive(file: &mut File) -> io::Result<bool> {
    let mut start = Vec::new();
    file.take(MAGIC.len() as u64).read_to_end(&mut start)?;
    file.rewind()?;
    Ok(start == MAGIC)
}

/// Where a toolpath lies in an archive.
#[derive(Clone, Copy)]
pub(super) struct ArchiveMember {
    at: u64,
    packed_bytes: u64,
    bytes: u64,
    is_packed: bool,
    crc: u32,
}

impl ArchiveMember {
    /// The toolpath of a plate, or the only one.
    ///
    /// # Errors
    /// If it is no sound archive, holds no toolpath, not that one, or several and none is chosen.
    pub(super) fn find(path: &Path, file: File, plate: Option<u32>) -> Result<ArchiveMember> {
        let damaged = |what: String| Error::input(path, "archive", what, REMEDY);
        let sound = |error: zip::result::ZipError| damaged(format!("is no sound ZIP archive: {error}"));
        let mut archive = ZipArchive::new(file).map_err(sound)?;
        let names = archive.file_names().filter_map(|name| Some(name.ok()?.into_owned()));
        let mut plates = names.filter_map(|name| Some((plate_of(&name)?, name))).collect::<Vec<_>>();
        plates.sort();
        let list = plates.iter().map(|(number, _)| number.to_string()).collect::<Vec<_>>().join(", ");
        let found = match (plate, &plates[..]) {
            (_, []) => {
                let what = "is a ZIP archive without a toolpath (plate_1.gcode)";
                let remedy = "slice it first, or give its mesh to a command that takes meshes";
                return Err(Error::input(path, "archive", what, remedy));
            }
            (None, [(_, name)]) => name,
            (None, _) => {
                let what = format!("holds the toolpaths of plates {list}");
                return Err(Error::input(path, "archive", what, "choose one by `plate` N"));
            }
            (Some(plate), all) => match all.iter().find(|(number, _)| *number == plate) {
                Some((_, name)) => name,
                None => {
                    let what = format!("has no plate {plate}, but {list}");
                    return Err(Error::input(path, "archive", what, "choose one of these by `plate` N"));
                }
            },
        };
        let entry = archive.by_name(found).map_err(sound)?;
        let is_packed = match entry.compression() {
            CompressionMethod::Stored => false,
            CompressionMethod::Deflated => true,
            other => return Err(damaged(format!("{found} is compressed by {other}, which is not read"))),
        };
        let at = entry.data_start().ok_or_else(|| damaged(format!("{found} is not there")))?;
        let (packed_bytes, bytes, crc) = (entry.compressed_size(), entry.size(), entry.crc32());
        Ok(ArchiveMember { at, packed_bytes, bytes, is_packed, crc })
    }

    /// Its text, read from `file`.
    pub(super) fn open<R: Read + Seek>(&self, mut file: R) -> io::Result<Text<R>> {
        file.seek(SeekFrom::Start(self.at))?;
        let packed = file.take(self.packed_bytes);
        let inner =
            if self.is_packed { Inner::Packed(DeflateDecoder::new(packed)) } else { Inner::Plain(packed) };
        Ok(Text { inner, crc: Crc::new(), member: *self })
    }
}

/// The number of a plate by its file's name; 1 of a toolpath that has none.
fn plate_of(name: &str) -> Option<u32> {
    let stem = name.strip_suffix(".gcode")?;
    let stem = stem.rsplit('/').next().unwrap_or(stem);
    Some(stem.strip_prefix("plate_").and_then(|number| number.parse().ok()).unwrap_or(1))
}

enum Inner<R> {
    Plain(Take<R>),
    Packed(DeflateDecoder<Take<R>>),
}

/// The text of a member, which must fit its checksum.
pub(super) struct Text<R> {
    inner: Inner<R>,
    crc: Crc,
    member: ArchiveMember,
}

impl<R: Read> Read for Text<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = match &mut self.inner {
            Inner::Plain(reader) => reader.read(buffer)?,
            Inner::Packed(reader) => reader.read(buffer)?,
        };
        self.crc.update(&buffer[..count]);
        let is_whole = u64::from(self.crc.amount()) == self.member.bytes & 0xffff_ffff
            && self.crc.sum() == self.member.crc;
        if count == 0 && !buffer.is_empty() && !is_whole {
            let what = "the toolpath in the archive does not fit its checksum";
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use crate::toolpath::gcode::{GcodeOptions, read_gcode};
    use brickfield_core::progress::Silent;
    use std::io::Write;
    use std::path::Path;
    use zip::write::{SimpleFileOptions, ZipWriter};

    const TEXT: &str = "G90\nM83\n;WIDTH:0.5\n;HEIGHT:0.2\nG1 X0 Y0 Z0.2\nG1 X10 E1\n";

    fn archive(path: &Path, members: &[(&str, &str)]) {
        let mut zip = ZipWriter::new(std::fs::File::create(path).unwrap());
        for (n, (name, text)) in members.iter().enumerate() {
            let method =
                if n % 2 == 0 { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
            zip.start_file(*name, SimpleFileOptions::default().compression_method(method)).unwrap();
            zip.write_all(text.as_bytes()).unwrap();
        }
        zip.finish().unwrap();
    }

    /// Length of what is laid, or the error.
    fn laid(path: &Path, plate: Option<u32>) -> Result<f64, String> {
        let options = GcodeOptions { plate, ..GcodeOptions::default() };
        let mut length = 0.0;
        let report = read_gcode(path, &options, &Silent, &mut |bead| {
            length += bead.points.windows(2).map(|p| (p[1][0] - p[0][0]).abs()).sum::<f64>();
            Ok(())
        });
        report.map(|_| length).map_err(|error| error.to_string())
    }

    #[test]
    fn plates_are_read_by_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gcode.3mf");
        let longer = TEXT.replace("X10", "X30");
        archive(&path, &[("Metadata/plate_1.gcode", TEXT), ("Metadata/plate_1.gcode.md5", "0")]);
        assert_eq!(laid(&path, None), Ok(10.0));
        archive(&path, &[("Metadata/plate_1.gcode", TEXT), ("Metadata/plate_2.gcode", &longer)]);
        assert_eq!((laid(&path, Some(1)), laid(&path, Some(2))), (Ok(10.0), Ok(30.0)));
        let said = laid(&path, None).unwrap_err();
        assert!(said.contains("plates 1, 2; choose one by `plate` N"), "{said}");
        let said = laid(&path, Some(3)).unwrap_err();
        assert!(said.contains("has no plate 3, but 1, 2"), "{said}");
        archive(&path, &[("3D/3dmodel.model", "<model/>")]);
        assert!(laid(&path, None).unwrap_err().contains("without a toolpath"));
    }

    #[test]
    fn damage_in_a_toolpath_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gcode.3mf");
        archive(&path, &[("a.txt", ""), ("plate_1.gcode", TEXT)]);
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.windows(3).position(|bytes| bytes == b"X10").unwrap();
        bytes[at + 1] = b'2';
        std::fs::write(&path, &bytes).unwrap();
        let said = laid(&path, None).unwrap_err();
        assert!(said.contains("does not fit its checksum") && !said.contains('\n'), "{said}");
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(laid(&path, None).unwrap_err().contains("is no sound ZIP archive"));
    }
}
