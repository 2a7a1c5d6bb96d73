//! The body of an ASCII PLY: a line per row.

use super::Plan;
use super::header::{PlyElement, PlyHeader, PropertyShape, Scalar};
use crate::error::{Error, Result};
use crate::ingest::polygons::Polygons;
use crate::ingest::text::{self, TextLines};
use crate::progress::Progress;
use std::path::Path;

/// Reads the body of the file `bytes`.
pub(super) fn read(path: &Path, bytes: &[u8], plan: &Plan, progress: &dyn Progress) -> Result<Polygons> {
    let body = &bytes[plan.header.body_byte..];
    let mut rows = Rows { path, lines: TextLines::new(body, plan.header.lines, progress) };
    let mut polygons = Polygons::default();
    for element in &plan.header.elements {
        match &element.name[..] {
            b"vertex" => vertices(&mut rows, element, plan, &mut polygons)?,
            b"face" => faces(&mut rows, element, plan, &mut polygons)?,
            // A row of nothing may have a line or none; blank lines are passed over anyway.
            _ if element.properties.is_empty() => {}
            _ => {
                for row in 0..element.count {
                    rows.next(element, row)?;
                }
            }
        }
    }
    match rows.next_filled()? {
        None => Ok(polygons),
        Some(_) => Err(rows.error("the text goes on after the last element that the header names".into())),
    }
}

/// Reads the columns `wanted` of the element `vertex`, calling `row` with their values; elements after it are
/// left alone.
pub(super) fn vertex_columns(
    path: &Path,
    bytes: &[u8],
    header: &PlyHeader,
    wanted: &[(usize, Scalar)],
    progress: &dyn Progress,
    mut row: impl FnMut(&[f64]),
) -> Result<()> {
    let mut rows = Rows { path, lines: TextLines::new(&bytes[header.body_byte..], header.lines, progress) };
    let mut values = vec![0.0; wanted.len()];
    for element in header.elements.iter().filter(|e| !e.properties.is_empty()) {
        for number in 0..element.count {
            let mut line = rows.next(element, number)?;
            if element.name != b"vertex" {
                continue;
            }
            for (column, property) in element.properties.iter().enumerate() {
                match (property.shape, wanted.iter().position(|(c, _)| *c == column)) {
                    (PropertyShape::One(scalar), Some(at)) => {
                        values[at] = rows.coordinate(&mut line, scalar)?
                    }
                    (shape, _) => rows.skip(&mut line, shape)?,
                }
            }
            rows.end(line)?;
            row(&values);
        }
        if element.name == b"vertex" {
            break;
        }
    }
    Ok(())
}

fn vertices(rows: &mut Rows, element: &PlyElement, plan: &Plan, out: &mut Polygons) -> Result<()> {
    for row in 0..element.count {
        let mut line = rows.next(element, row)?;
        let mut vertex = [0.0; 3];
        for (column, property) in element.properties.iter().enumerate() {
            let axis = plan.coordinates.iter().position(|(coordinate, _)| *coordinate == column);
            match (property.shape, axis) {
                (PropertyShape::One(scalar), Some(axis)) => {
                    vertex[axis] = rows.coordinate(&mut line, scalar)?
                }
                (shape, _) => rows.skip(&mut line, shape)?,
            }
        }
        rows.end(line)?;
        out.vertices.push(vertex);
    }
    Ok(())
}

fn faces(rows: &mut Rows, element: &PlyElement, plan: &Plan, out: &mut Polygons) -> Result<()> {
    let mut corners = Vec::new();
    for row in 0..element.count {
        let mut line = rows.next(element, row)?;
        for (column, property) in element.properties.iter().enumerate() {
            if column == plan.corners.0 {
                corners.clear();
                for _ in 0..rows.count(&mut line)? {
                    let corner = rows.integer(&mut line)?;
                    let vertex = u32::try_from(corner).ok().filter(|v| *v < plan.vertices);
                    corners.push(vertex.ok_or_else(|| {
                        rows.error(format!(
                            "face names vertex {corner} (counted from 0), but there are {} vertices",
                            plan.vertices
                        ))
                    })?);
                }
            } else {
                rows.skip(&mut line, property.shape)?;
            }
        }
        rows.end(line)?;
        out.add_face(&corners);
    }
    Ok(())
}

struct Rows<'a> {
    path: &'a Path,
    lines: TextLines<'a>,
}

impl<'a> Rows<'a> {
    /// The next line that is not blank.
    fn next_filled(&mut self) -> Result<Option<&'a [u8]>> {
        while let Some(line) = self.lines.next()? {
            let mut rest = line;
            if text::token(&mut rest).is_some() {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }

    /// The line of `row` (from 0) of `element`.
    fn next(&mut self, element: &PlyElement, row: u64) -> Result<&'a [u8]> {
        self.next_filled()?.ok_or_else(|| {
            self.error(format!(
                "the file ends after {row} of the {} rows that the header claims for the element {}",
                element.count,
                text::quote(&element.name)
            ))
        })
    }

    fn word(&self, line: &mut &'a [u8]) -> Result<&'a [u8]> {
        text::token(line)
            .ok_or_else(|| self.error("the line has fewer values than the header declares".into()))
    }

    /// A coordinate declared as `scalar`. One declared as `float` is rounded to it, so that the text and the
    /// binary form of a file give the same triangles.
    fn coordinate(&self, line: &mut &'a [u8], scalar: Scalar) -> Result<f64> {
        let word = self.word(line)?;
        let value = match scalar {
            Scalar::F32 => text::number::<f32>(word).map(f64::from),
            _ => text::number::<f64>(word),
        };
        value.ok_or_else(|| {
            let what = format!("coordinate {} is not a number", text::quote(word));
            self.error(what + text::hint(word))
        })
    }

    fn integer(&self, line: &mut &'a [u8]) -> Result<i64> {
        let word = self.word(line)?;
        text::integer(word).ok_or_else(|| self.error(format!("{} is not an integer", text::quote(word))))
    }

    /// The count of a list. Its items need not be there: who reads them meets the end of the line.
    fn count(&self, line: &mut &'a [u8]) -> Result<u64> {
        let count = self.integer(line)?;
        u64::try_from(count).map_err(|_| self.error(format!("a list has the count {count}")))
    }

    fn skip(&self, line: &mut &'a [u8], shape: PropertyShape) -> Result<()> {
        let values = match shape {
            PropertyShape::One(_) => 1,
            PropertyShape::List { .. } => self.count(line)?,
        };
        (0..values).try_for_each(|_| self.word(line).map(drop))
    }

    /// Makes sure that nothing is left of the line.
    fn end(&self, mut line: &[u8]) -> Result<()> {
        match text::token(&mut line) {
            None => Ok(()),
            Some(_) => Err(self.error("the line has more values than the header declares".into())),
        }
    }

    fn error(&self, what: String) -> Error {
        let place = format!("line {}", self.lines.number());
        Error::input(self.path, place, what, "repair the line or export the file again")
    }
}
