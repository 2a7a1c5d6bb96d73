//! Reads a cross-section that the user gives as a polygon.

use super::profile::{OUTLINE_MAX, ProfileShape, moments};
use crate::error::{Error, Result};
use std::path::Path;

/// Corners are rounded to multiples of 2⁻³⁰ of the bead's width or height, so that integers decide whether
/// sides cross.
const STEPS: f64 = (1u64 << 30) as f64;
/// Longest file that is looked at: a thousand lines of any sensible length.
const BYTES_MAX: u64 = 1 << 20;
/// Least area, in units of width times height; anything smaller is a drawing mistake.
const AREA_MIN: f64 = 1e-3;

type Corner = [i64; 2];

/// Reads the polygon of a cross-section: a text of lines `across,up`, in units of the bead's width and height
/// from its middle, so that the bead's box is ±0.5. The last corner is joined to the first; either
/// orientation will do. A header line, empty lines and lines that begin with # are skipped.
///
/// # Errors
/// If the file cannot be read or a line is not two numbers within ±0.5; if the polygon has fewer than three
/// corners or more than 1,024, touches or crosses itself, or is nearly without area. The line is named.
pub fn read_outline(path: &Path) -> Result<ProfileShape> {
    let inspect = std::fs::metadata(path).map_err(Error::io(path, "open"))?;
    if !inspect.is_file() || inspect.len() > BYTES_MAX {
        let what = "is no text of at most 1 MiB";
        return Err(Error::input(path, "section", what, "give lines of two numbers, across,up"));
    }
    let text = std::fs::read_to_string(path).map_err(Error::io(path, "read"))?;
    let mut corners: Vec<(usize, Corner)> = Vec::new();
    let mut saw_header = false;
    for (number, line) in text.lines().enumerate().map(|(n, line)| (n + 1, line.trim())) {
        let line = line.trim_start_matches('\u{feff}');
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        match corner(line) {
            Some(at) if corners.last().is_none_or(|last| last.1 != at) => corners.push((number, at)),
            Some(_) => {}
            None if corners.is_empty() && !saw_header => saw_header = true,
            None => {
                let remedy = "write across,up in units of the bead's width and height, each from -0.5 to 0.5";
                let what = format!("\"{line}\" is not a corner");
                return Err(Error::input(path, format!("line {number}"), what, remedy));
            }
        }
    }
    if corners.len() > 1 && corners.first().map(|c| c.1) == corners.last().map(|c| c.1) {
        corners.pop();
    }
    polygon(path, &corners)
}

/// Two numbers within ±0.5, rounded.
fn corner(line: &str) -> Option<Corner> {
    let (across, up) = line.split_once([',', ';', ' ', '\t'])?;
    let number = |text: &str| {
        let value: f64 = text.trim().parse().ok()?;
        (value.abs() <= 0.5).then_some((value * STEPS).round() as i64)
    };
    Some([number(across)?, number(up)?])
}

/// Checks the corners, each with its line, and turns them counter-clockwise.
fn polygon(path: &Path, corners: &[(usize, Corner)]) -> Result<ProfileShape> {
    let count = corners.len();
    if !(3..=OUTLINE_MAX).contains(&count) {
        let what = format!("has {count} corners");
        return Err(Error::input(path, "section", what, format!("give 3 to {OUTLINE_MAX} different ones")));
    }
    let side = |i: usize| (corners[i].1, corners[(i + 1) % count].1);
    for i in 0..count {
        for j in i + 1..count {
            let bad = if j == i + 1 || (i == 0 && j == count - 1) {
                let (first, second) = if j == i + 1 { (side(i), side(j)) } else { (side(j), side(i)) };
                folds_back(first.0, first.1, second.1)
            } else {
                touch(side(i), side(j))
            };
            if bad {
                let place = format!("line {}", corners[j].0);
                let what = format!("the side from here meets that from line {}", corners[i].0);
                return Err(Error::input(path, place, what, "give a polygon that does not touch itself"));
            }
        }
    }
    let mut points: Vec<[f64; 2]> = corners.iter().map(|c| c.1.map(|v| v as f64 / STEPS)).collect();
    let (area, _) = moments(&points);
    if area.abs() < AREA_MIN {
        let remedy = "give a polygon that fills the bead's box";
        return Err(Error::input(path, "section", "is nearly without area", remedy));
    }
    if area < 0.0 {
        points.reverse();
    }
    Ok(ProfileShape::Outline(points))
}

/// Twice the signed area of a triangle.
fn turn(a: Corner, b: Corner, c: Corner) -> i128 {
    let [u, v] = [b, c].map(|p| [i128::from(p[0] - a[0]), i128::from(p[1] - a[1])]);
    u[0] * v[1] - u[1] * v[0]
}

/// Whether the side b→c runs back along a→b.
fn folds_back(a: Corner, b: Corner, c: Corner) -> bool {
    let along = (0..2).map(|n| i128::from(b[n] - a[n]) * i128::from(c[n] - b[n])).sum::<i128>();
    turn(a, b, c) == 0 && along < 0
}

/// Whether two sides have a point in common.
fn touch((a, b): (Corner, Corner), (c, d): (Corner, Corner)) -> bool {
    let apart = |n: usize| a[n].max(b[n]) < c[n].min(d[n]) || c[n].max(d[n]) < a[n].min(b[n]);
    let straddles = |p, q, r, s| turn(p, q, r).signum() * turn(p, q, s).signum() <= 0;
    !apart(0) && !apart(1) && straddles(a, b, c, d) && straddles(c, d, a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> std::result::Result<Vec<[f64; 2]>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        match read_outline(file.path()) {
            Ok(ProfileShape::Outline(corners)) => Ok(corners),
            Ok(other) => panic!("{other:?}"),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn either_orientation_with_or_without_a_header_and_the_closing_corner() {
        let square = vec![[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
        assert_eq!(read("-0.5,-0.5\n0.5,-0.5\n0.5,0.5\n-0.5,0.5\n"), Ok(square.clone()));
        let text = "\u{feff}y,z\r\n# a square\r\n-.5 .5\r\n.5; .5\r\n.5\t-.5\r\n-.5,-.5\r\n-.5,.5\r\n";
        assert_eq!(read(text), Ok(square));
        let notched = read("-.5,-.5\n.5,-.5\n.5,.5\n0,0\n-.5,.5").unwrap();
        assert_eq!(notched.len(), 5);
    }

    #[test]
    fn what_is_no_simple_polygon_is_refused_by_line() {
        for (text, why) in [
            ("", "0 corners"),
            ("0,0\n.5,0\n", "2 corners"),
            ("0,0\n.5,0\nx,y\n", "line 3"),
            ("0,0\n.5,0\n.6,.5\n", "line 3"),
            ("0,0\n.5,0\nnan,.5\n", "line 3"),
            ("a\nb\n0,0", "line 2"),
            ("-.5,-.5\n.5,.5\n.5,-.5\n-.5,.5\n", "line 3: the side from here meets that from line 1"),
            ("-.5,0\n.5,0\n0,0\n0,.5\n", "line 2"),
            ("-.5,-.5\n.5,-.5\n.5,.5\n0,-.5\n-.5,.5\n", "meets that from line 1"),
            ("-.5,0\n0,0.0005\n.5,0\n", "without area"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(why), "{text:?}: {message}");
        }
    }
}
