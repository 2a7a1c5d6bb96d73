//! Contours as SVG and DXF files.

use super::join::Contour;
use super::plane::Plane;
use crate::error::{Error, Result};
use crate::lattice::millimetres;
use crate::part::PartFile;
use std::fmt::Write as _;
use std::path::Path;

/// Bytes of text that are gathered before they are handed on.
const TEXT_BYTES: usize = 1 << 16;

/// What a drawing says beside its loops.
#[derive(Clone, Debug)]
pub struct Drawing<'a> {
    /// Where the section lies.
    pub plane: Plane,
    /// Least and greatest world coordinates of the sheet, by the axes of [`Plane::sides`].
    pub window: [[f64; 2]; 2],
    /// Symbol of the unit of length; empty if unknown.
    pub unit: &'a str,
    /// Length of a cell: coordinates are written to a ten-thousandth of it.
    pub cell: f64,
}

/// Writes loops to a file whose ending says how: `.svg`, in which y points upward by a transformation, so that paths hold
/// world coordinates, or `.dxf`, closed polylines of release 12.
///
/// # Errors
/// [`Error::Setting`] for other endings; what writing gives.
pub fn write_drawing(contour: &Contour, what: &Drawing<'_>, path: &Path) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_lowercase();
    let write = match ending.as_str() {
        "svg" => svg,
        "dxf" => dxf,
        _ => {
            let name = path.display();
            return Err(Error::setting(format!("{name}: no kind of drawing"), "choose .svg or .dxf"));
        }
    };
    let mut file = PartFile::create(path)?;
    write(contour, what, &mut file)?;
    file.finish()
}

/// Digits after the point: four more than the cell's first.
fn digits(cell: f64) -> usize {
    let mut digits = 4;
    let mut first = cell;
    while first < 1.0 && digits < 17 {
        first *= 10.0;
        digits += 1;
    }
    digits
}

fn svg(contour: &Contour, what: &Drawing<'_>, file: &mut PartFile) -> Result<()> {
    let [low, high] = what.window;
    let size = [high[0] - low[0], high[1] - low[1]];
    let (digits, letter) = (digits(what.cell), what.plane.letter());
    let side = |length: f64| match millimetres(what.unit) {
        Some(mm) => format!("{:.digits$}mm", length * mm),
        None => format!("{length:.digits$}"),
    };
    let stroke = what.cell / 2.0;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {:.digits$} {:.digits$}\">\n\
         <title>{letter} = {} {}</title>\n\
         <path transform=\"matrix(1 0 0 -1 {:.digits$} {:.digits$})\" fill=\"#9ecae1\" fill-rule=\"nonzero\" \
         stroke=\"#08306b\" stroke-width=\"{stroke:.digits$}\" stroke-linejoin=\"round\" d=\"",
        side(size[0]),
        side(size[1]),
        size[0],
        size[1],
        what.plane.at,
        what.unit,
        -low[0],
        high[1],
    );
    for line in &contour.loops {
        for (number, [x, y]) in line.iter().enumerate() {
            let command = if number == 0 { 'M' } else { 'L' };
            // Writing to a string cannot fail.
            let _ = write!(text, "{command}{x:.digits$} {y:.digits$}");
            hand_on(&mut text, file)?;
        }
        text.push_str("Z\n");
    }
    text.push_str("\"/>\n</svg>\n");
    file.append(text.as_bytes())
}

fn dxf(contour: &Contour, what: &Drawing<'_>, file: &mut PartFile) -> Result<()> {
    let units = match what.unit {
        "in" => 1,
        "ft" => 2,
        "mm" => 4,
        "cm" => 5,
        "m" => 6,
        "mil" => 9,
        "um" => 13,
        _ => 0,
    };
    let (digits, letter) = (digits(what.cell), what.plane.letter());
    let [low, high] = what.window;
    let mut text = format!(
        "999\n{letter} = {} {}\n0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n9\n$INSUNITS\n70\n{units}\n\
         9\n$EXTMIN\n10\n{:.digits$}\n20\n{:.digits$}\n30\n0.0\n9\n$EXTMAX\n10\n{:.digits$}\n20\n{:.digits$}\n30\n0.0\n\
         0\nENDSEC\n0\nSECTION\n2\nENTITIES\n",
        what.plane.at, what.unit, low[0], low[1], high[0], high[1],
    );
    for line in &contour.loops {
        text.push_str("0\nPOLYLINE\n8\nboundary\n66\n1\n70\n1\n10\n0.0\n20\n0.0\n30\n0.0\n");
        for [x, y] in line {
            let _ = write!(text, "0\nVERTEX\n8\nboundary\n10\n{x:.digits$}\n20\n{y:.digits$}\n30\n0.0\n");
            hand_on(&mut text, file)?;
        }
        text.push_str("0\nSEQEND\n8\nboundary\n");
    }
    text.push_str("0\nENDSEC\n0\nEOF\n");
    file.append(text.as_bytes())
}

/// Hands on text that has grown long.
fn hand_on(text: &mut String, file: &mut PartFile) -> Result<()> {
    if text.len() >= TEXT_BYTES {
        file.append(text.as_bytes())?;
        text.clear();
    }
    Ok(())
}
