//! Pages that show splats: one file with its data, the decoder as WebAssembly and a viewer, which asks for nothing else; or a
//! folder for any static server, of which the page reads the file of splats by ranges.

use super::levels::SplatLevels;
use super::picks::PickBeads;
use super::write::{BspSummary, bsp_bytes};
use crate::error::{Error, Result};
use crate::part::PartFile;
use crate::progress::Progress;
use std::path::Path;

/// The page, with places to fill.
const PAGE: &str = include_str!("../../page/page.html");
const WORKER: &str = include_str!("../../page/worker.js");
const SHADERS: &str = include_str!("../../page/shaders.js");
const WEBGL: &str = include_str!("../../page/webgl.js");
const VIEWER: &str = include_str!("../../page/viewer.js");
/// What decodes and draws, compiled and packed by `coding/page/build.sh`.
const DECODER: &[u8] = include_bytes!("../../page/decoder.wasm.gz");
/// What finds the beads of picks, likewise.
const FINDER: &[u8] = include_bytes!("../../page/picks.wasm.gz");
/// The places of the page, in order.
const PLACES: [&str; 11] = [
    "CONNECT", "WORKER", "PART", "DECODER", "DATA", "SHADERS", "WEBGL", "VIEWER", "FINDER", "BESIDE", "PICKS",
];
/// Bytes that are written at once; a multiple of 3.
const CHUNK: usize = 3 << 14;
/// The page of a folder, and its files of splats and of beads, whose names the page knows.
const INDEX: &str = "index.html";
const PART: &str = "part.bsp";
const PICKS: &str = "part.picks";

/// Bytes of a page with picks of beads beside its data.
#[must_use]
pub fn viewer_bytes() -> usize {
    [PAGE, WORKER, SHADERS, WEBGL, VIEWER].map(str::len).iter().sum::<usize>() + DECODER.len() + FINDER.len()
}

/// What a page shows.
#[derive(Clone, Copy)]
enum PageData<'a> {
    /// A file of splats and a table of beads, in the page itself; without beads the table is empty.
    Here(&'a [u8], &'a [u8]),
    /// Files beside the page, of beads or not.
    Beside { has_beads: bool },
}

/// Bytes of what was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PageBytes {
    /// All files together.
    pub all: u64,
    /// Of these the table of beads, before it became letters; 0 where there is none.
    pub beads: u64,
}

/// Writes a page that shows the file of splats `bytes`, and tells the beads of picks by a table as [`PickBeads::bytes`] gives it; an
/// empty one if it is to tell none. It gets its name when it is complete.
///
/// # Errors
/// What writing gives.
pub fn write_page(bytes: &[u8], beads: &[u8], path: &Path) -> Result<PageBytes> {
    let all = write_viewer(PageData::Here(bytes, beads), path)?;
    Ok(PageBytes { all, beads: beads.len() as u64 })
}

/// Writes a folder with a file of splats, and a page that reads it by ranges from any server of files. With `beads` there is a table
/// of them beside it, of which the page reads what a pick needs. The folder is made if there is none; other files in it stay.
///
/// # Errors
/// What writing gives; [`crate::error::Error::Interrupted`].
pub fn write_page_folder(
    levels: &SplatLevels,
    unit: &str,
    bounds: [[f64; 3]; 2],
    folder: &Path,
    beads: Option<&PickBeads>,
    progress: &dyn Progress,
) -> Result<(PageBytes, BspSummary)> {
    if !folder.is_dir() {
        std::fs::create_dir(folder).map_err(Error::io(folder, "make the folder"))?;
    }
    // A folder that cannot be written to is told before the work.
    let mut file = PartFile::create(&folder.join(PART))?;
    let (splats, summary) = bsp_bytes(levels, unit, bounds, progress)?;
    let table = beads.map(|beads| beads.bytes(&splats));
    file.append(&splats)?;
    file.finish()?;
    if let Some(table) = &table {
        let mut file = PartFile::create(&folder.join(PICKS))?;
        file.append(table)?;
        file.finish()?;
    }
    let page = write_viewer(PageData::Beside { has_beads: table.is_some() }, &folder.join(INDEX))?;
    let beads = table.map_or(0, |table| table.len() as u64);
    Ok((PageBytes { all: page + summary.bytes + beads, beads }, summary))
}

/// A page with the data in it, or without.
fn write_viewer(data: PageData<'_>, path: &Path) -> Result<u64> {
    let mut file = PartFile::create(path)?;
    let (splats, beads, connect, part, beside) = match data {
        PageData::Here(splats, beads) => (splats, beads, "", "", ""),
        PageData::Beside { has_beads } => {
            (&[][..], &[][..], "; connect-src 'self'", PART, if has_beads { PICKS } else { "" })
        }
    };
    let has_beads = !beside.is_empty() || !beads.is_empty();
    let fill = |file: &mut PartFile, place: &str| match place {
        "CONNECT" => file.append(connect.as_bytes()),
        "PART" => file.append(part.as_bytes()),
        "BESIDE" => file.append(beside.as_bytes()),
        "WORKER" => file.append(WORKER.as_bytes()),
        "SHADERS" => file.append(SHADERS.as_bytes()),
        "WEBGL" => file.append(WEBGL.as_bytes()),
        "VIEWER" => file.append(VIEWER.as_bytes()),
        "DECODER" => append_letters(file, DECODER),
        "FINDER" if has_beads => append_letters(file, FINDER),
        "FINDER" => Ok(()),
        "PICKS" => append_letters(file, beads),
        _ => append_letters(file, splats),
    };
    let mut rest = PAGE;
    for place in PLACES {
        let (before, after) = rest.split_once(&format!("@{place}@")).expect("the page has a place for it");
        file.append(before.as_bytes())?;
        fill(&mut file, place)?;
        rest = after;
    }
    file.append(rest.as_bytes())?;
    let written = file.appended();
    file.finish()?;
    Ok(written)
}

fn append_letters(file: &mut PartFile, bytes: &[u8]) -> Result<()> {
    bytes.chunks(CHUNK).try_for_each(|chunk| file.append(base64(chunk).as_bytes()))
}

/// Bytes as letters, four for three.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let number = (0..3).fold(0u32, |sum, n| sum << 8 | u32::from(*three.get(n).unwrap_or(&0)));
        for n in 0..4 {
            let letter = LETTERS[(number >> (18 - 6 * n) & 63) as usize];
            text.push(if n > three.len() { '=' } else { char::from(letter) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_those_of_the_standard() {
        let pairs = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        assert!(pairs.iter().all(|(plain, letters)| base64(plain.as_bytes()) == *letters));
    }

    #[test]
    fn the_decoder_is_what_the_compiler_makes_of_the_source() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let library = Path::new("/usr/lib/rustlib/wasm32-unknown-unknown");
        let rustc = std::process::Command::new("/usr/bin/rustc").arg("--version").output();
        let version = rustc.map(|out| String::from_utf8_lossy(&out.stdout).into_owned()).unwrap_or_default();
        if !version.starts_with("rustc 1.63") || !library.is_dir() {
            println!("skipped: no compiler of Debian 12 for WebAssembly is installed");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        for (name, kept) in [("decoder", DECODER), ("picks", FINDER)] {
            let made = folder.path().join("made.wasm.gz");
            let script = here.join("../coding/page/build.sh");
            let done = std::process::Command::new(script).arg(name).arg(&made).output().unwrap();
            assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
            assert!(
                std::fs::read(&made).unwrap() == kept,
                "compile it anew: engine/coding/page/build.sh {name}"
            );
        }
    }
}
