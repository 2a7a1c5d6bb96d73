//! Files of the reference encoder against the text that they were made of, and damaged ones.

use super::*;
use crate::toolpath::Toolpath;
use crate::toolpath::gcode::{GcodeOptions, GcodeReport, read_gcode_from};
use brickfield_core::error::Result as CoreResult;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/bgcode")
}

fn beads(bytes: &[u8], options: &GcodeOptions) -> CoreResult<(Toolpath, GcodeReport)> {
    let mut path = Toolpath::default();
    let report = read_gcode_from(Path::new("a.bgcode"), || Ok(bytes), options, &mut |bead| {
        path.push(bead);
        Ok(())
    })?;
    Ok((path, report))
}

fn points(path: &Toolpath) -> Vec<[f64; 3]> {
    (0..path.len()).flat_map(|bead| path.points(bead).to_vec()).collect()
}

/// Without the comments there are no widths and heights.
fn sized() -> GcodeOptions {
    GcodeOptions { width: Some(0.45), height: Some(0.2), ..GcodeOptions::default() }
}

#[test]
fn every_encoding_and_compression_is_the_text() {
    let text = std::fs::read(folder().join("text.gcode")).unwrap();
    let (plain, report) = beads(&text, &GcodeOptions::default()).unwrap();
    let bare = text.split(|&b| b == b'\n').map(|line| line.split(|&b| b == b';').next().unwrap());
    let (sized_plain, _) = beads(&bare.collect::<Vec<_>>().join(&b'\n'), &sized()).unwrap();
    assert!(plain.len() >= 2 && report.features.len() >= 2);
    let mut files = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if !name.ends_with(".bgcode") {
            continue;
        }
        files += 1;
        let bytes = std::fs::read(&path).unwrap();
        if name.starts_with("meatpack_") {
            let (found, _) = beads(&bytes, &sized()).unwrap();
            assert_eq!(points(&found), points(&sized_plain), "{name}");
            continue;
        }
        let (found, told) = beads(&bytes, &GcodeOptions::default()).unwrap();
        assert_eq!(points(&found), points(&plain), "{name}");
        let sections = |path: &Toolpath| {
            let of_bead = |bead: usize| (1..path.points(bead).len()).map(move |segment| (bead, segment - 1));
            (0..path.len())
                .flat_map(of_bead)
                .map(|(b, s)| (path.section(b, s), path.line(b, s)))
                .collect::<Vec<_>>()
        };
        // The header of the text is no line of its G-code.
        let (found, mut expected) = (sections(&found), sections(&plain));
        let header = expected[0].1 - found[0].1;
        expected.iter_mut().for_each(|(_, line)| *line -= header);
        assert_eq!(found, expected, "{name}");
        let features =
            |report: &GcodeReport| report.features.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
        assert_eq!(features(&told), features(&report), "{name}");
        assert_eq!((&told.slicer, told.firmware), (&report.slicer, report.firmware), "{name}");
        assert_eq!(told.filament_diameters, report.filament_diameters, "{name}");
    }
    assert_eq!(files, 12);
}

#[test]
fn every_damaged_byte_is_told_or_harmless() {
    let bytes = std::fs::read(folder().join("meatpackcomments_deflate.bgcode")).unwrap();
    let (whole, _) = beads(&bytes, &GcodeOptions::default()).unwrap();
    let mut refused = 0;
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        match beads(&damaged, &GcodeOptions::default()) {
            Ok((path, _)) => assert_eq!(points(&path), points(&whole), "byte {at}"),
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
    // A file without checksums is told in the header; the flag itself is one bit of it.
    assert!(refused > bytes.len() * 9 / 10, "{refused} of {}", bytes.len());
    for end in (10..bytes.len()).step_by(7) {
        if let Ok((path, _)) = beads(&bytes[..end], &GcodeOptions::default()) {
            // Cut between two blocks of settings behind all beads, or before the last block of them.
            assert!(points(&whole).starts_with(&points(&path)));
        }
    }
}

#[test]
fn heatshrink_refers_to_what_was_before() {
    // "ab", then 4 bytes from 2 before, by 11 and 4 bits.
    let bits = format!("1{:08b}1{:08b}0{:011b}{:04b}", b'a', b'b', 1, 3);
    let packed = bits
        .as_bytes()
        .chunks(8)
        .map(|byte| byte.iter().enumerate().fold(0, |all, (n, &bit)| all | (bit - b'0') << (7 - n)));
    let mut out = Vec::new();
    heatshrink::unpack(&packed.collect::<Vec<u8>>(), (11, 4), 6, &mut out);
    assert_eq!(out, b"ababab");
}
