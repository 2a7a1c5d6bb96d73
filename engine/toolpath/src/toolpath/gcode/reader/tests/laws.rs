//! What holds for any input.

use super::*;
use crate::toolpath::{Attributes, Section};
use proptest::prelude::*;
use std::fmt::Write;
use std::io::Read;

/// Everything that a sink sees.
type Seen = Vec<(Vec<[f64; 3]>, Vec<Section>, Attributes)>;

fn seen<R: Read>(open: impl FnMut() -> Result<R>) -> (Result<GcodeReport>, Seen) {
    let mut seen = Seen::new();
    let report = read_gcode_from(Path::new("text"), open, &GcodeOptions::default(), &mut |bead| {
        for pair in bead.points.windows(2) {
            assert_ne!(pair[0], pair[1]);
        }
        assert_eq!(bead.points.len(), bead.sections.len() + 1);
        assert!(bead.axes.is_empty() || bead.axes.len() == bead.points.len());
        assert!(bead.points.iter().flatten().all(|x| x.is_finite()));
        assert!(bead.sections.iter().all(|s| s.width > 0.0 && s.height > 0.0 && s.width <= SIZE_MAX));
        seen.push((bead.points.to_vec(), bead.sections.to_vec(), bead.attributes));
        Ok(())
    });
    (report, seen)
}

/// Reads in pieces of changing size.
struct Pieces<'a> {
    rest: &'a [u8],
    sizes: std::iter::Cycle<std::slice::Iter<'a, usize>>,
}

impl Read for Pieces<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let bytes = self.sizes.next().unwrap().min(&self.rest.len()).min(&buffer.len()).to_owned();
        buffer[..bytes].copy_from_slice(&self.rest[..bytes]);
        self.rest = &self.rest[bytes..];
        Ok(bytes)
    }
}

/// A piece of a real file.
fn sample() -> Vec<u8> {
    let mut text = std::fs::read(data("gcode/dialect_torture.gcode")).unwrap();
    text.extend_from_slice(&std::fs::read(data("clover.gcode")).unwrap()[..6000]);
    text
}

/// Letters, digits and marks that lines are made of, in lines.
fn any_lines() -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(prop::sample::select(&b"GGGXYZEIJRMTNABC0123456789.-+ \n\n\n;(*{\r"[..]), 0..400)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_bytes_end_in_beads_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        drop(seen(|| Ok(&bytes[..])));
    }

    #[test]
    fn anything_like_gcode_ends_in_beads_or_an_error(bytes in any_lines()) {
        let text = [b"M83\nG1 Z1\nG1 X1 E1\n", &bytes[..]].concat();
        drop(seen(|| Ok(&text[..])));
    }

    #[test]
    fn damaged_files_end_in_beads_or_an_error(
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
    ) {
        let mut text = sample();
        for (place, byte) in hits {
            let place = place.index(text.len());
            text[place] = byte;
        }
        drop(seen(|| Ok(&text[..])));
    }

    #[test]
    fn how_reads_are_cut_does_not_matter(sizes in prop::collection::vec(1usize..5000, 1..20)) {
        let text = sample();
        let whole = seen(|| Ok(&text[..]));
        let cut = seen(|| Ok(Pieces { rest: &text, sizes: sizes.iter().cycle() }));
        prop_assert_eq!(whole.0.unwrap(), cut.0.unwrap());
        prop_assert_eq!(whole.1, cut.1);
    }

    #[test]
    fn what_is_written_is_read(
        steps in prop::collection::vec((-999_999i32..1_000_000, -999_999i32..1_000_000, 0i32..5), 2..60),
        relative_e: bool, spaced: bool,
    ) {
        let mut text = format!(";WIDTH:0.5\n;HEIGHT:0.2\nG90\nM8{}\n", if relative_e { 3 } else { 2 });
        let mut expected: Vec<Vec<[f64; 3]>> = Vec::new();
        let mut at = [0.0; 3];
        let (mut e, mut open) = (0, false);
        for (x, y, fed) in steps {
            let next = [f64::from(x) / 1000.0, f64::from(y) / 1000.0, 0.0];
            let gap = if spaced { " " } else { "" };
            write!(text, "G1{gap}X{:.3}{gap}Y{:.3}", next[0], next[1]).unwrap();
            e += fed;
            if fed > 0 {
                write!(text, "{gap}E{}", f64::from(if relative_e { fed } else { e }) / 8.0).unwrap();
            }
            text.push('\n');
            if next != at {
                if fed > 0 {
                    if !open {
                        expected.push(vec![at]);
                    }
                    expected.last_mut().unwrap().push(next);
                }
                open = fed > 0;
            }
            at = next;
        }
        let (report, beads) = seen(|| Ok(text.as_bytes()));
        prop_assert_eq!(report.is_ok(), !expected.is_empty());
        let found: Vec<Vec<[f64; 3]>> = beads.into_iter().map(|bead| bead.0).collect();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn numbers_are_rounded_correctly(mantissa in any::<i64>(), decimals in 0usize..22) {
        let digits = format!("{:023}", mantissa.unsigned_abs());
        let (whole, part) = digits.split_at(digits.len() - decimals);
        let sign = if mantissa < 0 { "-" } else { "" };
        let text = format!("{sign}{whole}.{part}");
        let found = words::number(text.as_bytes()).unwrap();
        prop_assert_eq!(found.value.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{}", text);
        prop_assert_eq!((found.length, found.decimals as usize), (text.len(), decimals));
    }

    #[test]
    fn widths_have_the_area_that_was_fed(area in 1e-4f64..50.0, height in 0.01f64..5.0) {
        let width = sizes::width_of(area, height);
        let found = Section { width, height }.stadium_area();
        prop_assert!((found - area).abs() < 1e-9 * area.max(height * height), "{} {}", found, area);
    }
}
