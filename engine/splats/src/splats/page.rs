//! Pages that show splats: one file with its data, the decoder as WebAssembly and a viewer, which asks for nothing else; or a
//! folder for any static server, of which the page reads the file of splats by ranges.

use super::levels::SplatLevels;
use super::write::{BspSummary, write_bsp};
use crate::error::{Error, Result};
use crate::part::PartFile;
use crate::progress::Progress;
use std::path::Path;

/// The page, with places to fill.
const PAGE: &str = include_str!("../../page/page.html");
const WORKER: &str = include_str!("../../page/worker.js");
const SHADERS: &str = include_str!("../../page/shaders.js");
const VIEWER: &str = include_str!("../../page/viewer.js");
/// The decoder, compiled by `coding/page/build.sh`.
const DECODER: &[u8] = include_bytes!("../../page/decoder.wasm");
/// Bytes that are written at once; a multiple of 3.
const CHUNK: usize = 3 << 14;
/// The page of a folder, and its file of splats, whose name the page knows.
const INDEX: &str = "index.html";
const PART: &str = "part.bsp";

/// Writes a page that shows the file of splats `bytes`. It gets its name when it is complete.
///
/// # Errors
/// What writing gives.
pub fn write_page(bytes: &[u8], path: &Path) -> Result<u64> {
    write_viewer(Some(bytes), path)
}

/// Writes a folder with a file of splats, and a page that reads it by ranges from any server of files. The folder is made if
/// there is none; other files in it stay.
///
/// # Errors
/// What writing gives; [`crate::error::Error::Interrupted`].
pub fn write_page_folder(
    levels: &SplatLevels,
    unit: &str,
    bounds: [[f64; 3]; 2],
    folder: &Path,
    progress: &dyn Progress,
) -> Result<(u64, BspSummary)> {
    if !folder.is_dir() {
        std::fs::create_dir(folder).map_err(Error::io(folder, "make the folder"))?;
    }
    let summary = write_bsp(levels, unit, bounds, &folder.join(PART), progress)?;
    let page = write_viewer(None, &folder.join(INDEX))?;
    Ok((page + summary.bytes, summary))
}

/// A page with the data in it, or without.
fn write_viewer(data: Option<&[u8]>, path: &Path) -> Result<u64> {
    let mut file = PartFile::create(path)?;
    let connect = if data.is_some() { "" } else { "; connect-src 'self'" };
    let fill = |file: &mut PartFile, place: &str| match place {
        "CONNECT" => file.append(connect.as_bytes()),
        "WORKER" => file.append(WORKER.as_bytes()),
        "SHADERS" => file.append(SHADERS.as_bytes()),
        "VIEWER" => file.append(VIEWER.as_bytes()),
        "DECODER" => append_letters(file, DECODER),
        _ => append_letters(file, data.unwrap_or_default()),
    };
    let mut rest = PAGE;
    for place in ["CONNECT", "DECODER", "DATA", "WORKER", "SHADERS", "VIEWER"] {
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
        let made = folder.path().join("decoder.wasm");
        let script = here.join("../coding/page/build.sh");
        let done = std::process::Command::new(script).arg(&made).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        assert!(std::fs::read(&made).unwrap() == DECODER, "compile it anew: engine/coding/page/build.sh");
    }
}
