//! PNG files, written row by row, and animated ones, written picture by picture.

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
    let failed = |error| failed(path, error);
    let mut writer = encoder(&mut file, size, opaque).write_header().map_err(failed)?;
    let mut stream = writer.stream_writer().map_err(failed)?;
    let width = size[0] as usize;
    draw(&mut PngRows { path, out: &mut stream, width, opaque, bytes: Vec::new() })?;
    stream.finish().map_err(failed)?;
    writer.finish().map_err(failed)?;
    file.finish()
}

/// Pictures that follow each other.
#[derive(Clone, Copy, Debug)]
pub struct Animation {
    /// Width and height of each in pixels, up to [`ANIMATED_SIDE_MAX`].
    pub size: [u32; 2],
    /// Whether the opacity is left out.
    pub opaque: bool,
    /// How many.
    pub frames: usize,
    /// How long all of them are seen, before they begin anew.
    pub seconds: f64,
}

/// Most pixels along a side of an animated picture, of which one at a time is in memory: 64 MiB.
pub const ANIMATED_SIDE_MAX: u32 = 4096;

/// Writes an animated PNG, of which `draw` hands over the rows of each picture, told its number from 0; it has its name
/// only when all of them are safe on the disk. Programs that know no animations show the first.
///
/// # Errors
/// [`Error::Setting`] if there are no pictures, or too many, or too large ones; what `draw` and writing give.
pub fn write_apng(
    path: &Path,
    what: Animation,
    mut draw: impl FnMut(usize, &mut PngRows<'_>) -> Result<()>,
) -> Result<()> {
    let Animation { size, opaque, frames, seconds } = what;
    let count = u32::try_from(frames).ok().filter(|count| (1..=65_535).contains(count));
    let fits = size.iter().all(|side| (1..=ANIMATED_SIDE_MAX).contains(side));
    let Some(count) = count.filter(|_| fits) else {
        let what = format!("{frames} pictures of {} × {} pixels cannot be animated", size[0], size[1]);
        return Err(Error::setting(
            what,
            format!("choose sides from 1 to {ANIMATED_SIDE_MAX} pixels, or a folder"),
        ));
    };
    let mut file = PartFile::create(path)?;
    let failed = |error| failed(path, error);
    let mut encoder = encoder(&mut file, size, opaque);
    encoder.set_animated(count, 0).map_err(failed)?;
    let delay = (seconds * 1000.0 / f64::from(count) + 0.5).clamp(1.0, 65_535.0);
    encoder.set_frame_delay(delay as u16, 1000).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    let mut pixels = Vec::new();
    for number in 0..frames {
        pixels.clear();
        let width = size[0] as usize;
        draw(number, &mut PngRows { path, out: &mut pixels, width, opaque, bytes: Vec::new() })?;
        // The encoder's stream of rows would carry the last row of a picture over to the next one's filters.
        writer.write_image_data(&pixels).map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    file.finish()
}

fn encoder<W: Write>(out: W, size: [u32; 2], opaque: bool) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(out, size[0], size[1]);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder
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
    fn animated_pictures_come_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.apng");
        let row = |n: usize, y: u8| -> Vec<Rgba> { (0..7).map(|x| [x, y, 90 * n as u8, 200 - x]).collect() };
        let what = Animation { size: [7, 5], opaque: true, frames: 3, seconds: 6.0 };
        write_apng(&path, what, |n, rows| (0..5).try_for_each(|y| rows.row(&row(n, y)))).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        for n in 0..3 {
            let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut bytes).unwrap();
            let shown = reader.info().frame_control().unwrap();
            assert_eq!((shown.delay_num, shown.delay_den), (2000, 1000));
            let expected: Vec<u8> = (0..5).flat_map(|y| row(n, y)).flat_map(|p| [p[0], p[1], p[2]]).collect();
            assert_eq!(bytes, expected, "{n}");
        }
        let failed = |what, rows: u8| {
            let draw = |n, out: &mut PngRows<'_>| (0..rows).try_for_each(|y| out.row(&row(n, y)));
            write_apng(&directory.path().join("b.apng"), what, draw).unwrap_err().to_string()
        };
        for (what, rows) in [
            (what, 4),
            (Animation { frames: 0, ..what }, 5),
            (Animation { frames: 70_000, ..what }, 5),
            (Animation { size: [7, 5000], ..what }, 5),
        ] {
            let error = failed(what, rows);
            assert!(!error.contains('\n'), "{error}");
        }
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
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
