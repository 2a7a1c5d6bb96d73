//! PNG files, written row by row.

use super::SIDE_MAX;
use super::colour::Rgba;
use crate::error::{Error, Result};
use crate::part::PartFile;
use std::io::{self, Write};
use std::path::Path;

/// Takes the rows of a picture from the top.
pub struct PngRows<'a> {
    path: &'a Path,
    out: &'a mut dyn Write,
    width: usize,
    opaque: bool,
    bytes: Vec<u8>,
}

impl PngRows<'_> {
    /// The next row, which has the picture's width. The opacity of an opaque picture is left out.
    ///
    /// # Errors
    /// If it cannot be written, or its width is another.
    pub fn row(&mut self, row: &[Rgba]) -> Result<()> {
        if row.len() != self.width {
            return Err(wrong_rows(self.path));
        }
        self.bytes.clear();
        match self.opaque {
            true => self.bytes.extend(row.iter().flat_map(|&[r, g, b, _]| [r, g, b])),
            false => self.bytes.extend(row.iter().flatten()),
        }
        self.out.write_all(&self.bytes).map_err(Error::io(self.path, "write"))
    }
}

/// Writes a PNG of `size` (width, height) pixels whose rows `draw` hands over; it has its name only when all of them are
/// safe on the disk. Memory is that of a few rows.
///
/// # Errors
/// [`Error::Setting`] if a side is 0 or above [`SIDE_MAX`]; what `draw` and writing give.
pub fn write_png(
    path: &Path,
    size: [u32; 2],
    opaque: bool,
    draw: impl FnOnce(&mut PngRows<'_>) -> Result<()>,
) -> Result<()> {
    if size.iter().any(|side| !(1..=SIDE_MAX).contains(side)) {
        let what = format!("a picture of {} × {} pixels cannot be written", size[0], size[1]);
        return Err(Error::setting(what, format!("choose sides from 1 to {SIDE_MAX} pixels")));
    }
    let mut file = PartFile::create(path)?;
    let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let failed = |error| failed(path, error);
    let mut writer = encoder.write_header().map_err(failed)?;
    let mut stream = writer.stream_writer().map_err(failed)?;
    let width = size[0] as usize;
    draw(&mut PngRows { path, out: &mut stream, width, opaque, bytes: Vec::new() })?;
    stream.finish().map_err(failed)?;
    writer.finish().map_err(failed)?;
    file.finish()
}

fn failed(path: &Path, error: png::EncodingError) -> Error {
    match error {
        png::EncodingError::IoError(error) => Error::io(path, "write")(error),
        // Too few rows.
        _ => wrong_rows(path),
    }
}

fn wrong_rows(path: &Path) -> Error {
    Error::io(path, "write")(io::Error::other("the rows are not those of the picture"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(path: &Path) -> (png::OutputInfo, Vec<u8>) {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        (info, bytes)
    }

    #[test]
    fn rows_come_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        let row = |y: u8| -> Vec<Rgba> { (0..7).map(|x| [x, y, 3 * x + y, 200 - x]).collect() };
        for opaque in [false, true] {
            write_png(&path, [7, 5], opaque, |rows| (0..5).try_for_each(|y| rows.row(&row(y)))).unwrap();
            let (info, bytes) = read(&path);
            assert_eq!((info.width, info.height), (7, 5));
            let kept = if opaque { 3 } else { 4 };
            let expected: Vec<u8> = (0..5).flat_map(row).flat_map(|p| p[..kept].to_vec()).collect();
            assert_eq!(bytes, expected);
        }
    }

    #[test]
    fn what_is_no_whole_picture_gets_no_name() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        let row = [[0; 4]; 3];
        for (size, count) in [([3, 4], 3), ([2, 2], 2), ([0, 3], 0), ([3, 70_000], 1)] {
            let drawn = write_png(&path, size, true, |rows| (0..count).try_for_each(|_| rows.row(&row)));
            let error = drawn.unwrap_err().to_string();
            assert!(!error.contains('\n'), "{error}");
        }
        let failed = write_png(&path, [3, 2], true, |_| Err(Error::Interrupted)).unwrap_err();
        assert!(matches!(failed, Error::Interrupted));
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }
}
