//! A page with its data: a file of splats, the decoder as WebAssembly, and a viewer, in one HTML file that asks for nothing else.

use crate::error::Result;
use crate::part::PartFile;
use std::path::Path;

/// The page, with two places to fill.
const PAGE: &str = include_str!("../../page/page.html");
/// The decoder, compiled by `coding/page/build.sh`.
const DECODER: &[u8] = include_bytes!("../../page/decoder.wasm");
/// Bytes that are written at once; a multiple of 3.
const CHUNK: usize = 3 << 14;

/// Writes a page that shows the file of splats `bytes`. It gets its name when it is complete.
///
/// # Errors
/// What writing gives.
pub fn write_page(bytes: &[u8], path: &Path) -> Result<u64> {
    let mut file = PartFile::create(path)?;
    let mut rest = PAGE;
    for (place, data) in [("@DECODER@", DECODER), ("@DATA@", bytes)] {
        let (before, after) = rest.split_once(place).expect("the page has a place for it");
        file.append(before.as_bytes())?;
        data.chunks(CHUNK).try_for_each(|chunk| file.append(base64(chunk).as_bytes()))?;
        rest = after;
    }
    file.append(rest.as_bytes())?;
    let written = file.appended();
    file.finish()?;
    Ok(written)
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
