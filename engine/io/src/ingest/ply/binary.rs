//! The body of a binary PLY, in either byte order (`BIG`: big-endian).

use super::Plan;
use super::header::{PlyElement, PlyHeader, PropertyShape, Scalar};
use crate::error::{Error, Result};
use crate::ingest::polygons::Polygons;
use crate::ingest::text;
use crate::progress::Progress;
use std::path::Path;

/// Rows between two reports of progress.
const REPORT_ROWS: u64 = 1 << 16;

/// Reads the body of the file `bytes`.
pub(super) fn read<const BIG: bool>(
    path: &Path,
    bytes: &[u8],
    plan: &Plan,
    progress: &dyn Progress,
) -> Result<Polygons> {
    let mut body = Body { path, bytes, at: plan.header.body_byte, progress };
    let mut polygons = Polygons::default();
    for element in &plan.header.elements {
        body.check_room(element)?;
        let before = body.at;
        match &element.name[..] {
            b"vertex" if element.has_lists() => {
                ragged_vertices::<BIG>(&mut body, element, plan, &mut polygons)?
            }
            b"vertex" => vertices::<BIG>(&mut body, element, plan, &mut polygons)?,
            b"face" => faces::<BIG>(&mut body, element, plan, &mut polygons)?,
            _ if element.has_lists() => {
                for row in 0..element.count {
                    body.row::<BIG>(element, row, |_, _| ())?;
                }
            }
            // The room for the rows was checked just before, so neither the product nor the sum overflows.
            _ => body.at += element.least_bytes() * element.count as usize,
        }
        progress.advance((body.at - before) as u64);
    }
    // Padding is harmless; anything else means that a count is wrong.
    if !bytes[body.at..].iter().all(|&b| b == 0 || text::is_space(b)) {
        let what = format!("{} bytes follow the last element that the header names", bytes.len() - body.at);
        return Err(body.error(what));
    }
    Ok(polygons)
}

/// The number of type `scalar` that `bytes` begin with. Every type fits an f64 exactly.
#[inline]
fn load<const BIG: bool>(scalar: Scalar, bytes: &[u8]) -> f64 {
    #[inline]
    fn ordered<const BIG: bool, const N: usize>(bytes: &[u8]) -> [u8; N] {
        let mut value = [0; N];
        value.copy_from_slice(&bytes[..N]);
        if BIG {
            value.reverse();
        }
        value
    }
    match scalar {
        Scalar::I8 => i8::from_le_bytes(ordered::<BIG, 1>(bytes)).into(),
        Scalar::U8 => u8::from_le_bytes(ordered::<BIG, 1>(bytes)).into(),
        Scalar::I16 => i16::from_le_bytes(ordered::<BIG, 2>(bytes)).into(),
        Scalar::U16 => u16::from_le_bytes(ordered::<BIG, 2>(bytes)).into(),
        Scalar::I32 => i32::from_le_bytes(ordered::<BIG, 4>(bytes)).into(),
        Scalar::U32 => u32::from_le_bytes(ordered::<BIG, 4>(bytes)).into(),
        Scalar::F32 => f32::from_le_bytes(ordered::<BIG, 4>(bytes)).into(),
        Scalar::F64 => f64::from_le_bytes(ordered::<BIG, 8>(bytes)),
    }
}

/// Reads the columns `wanted` of the element `vertex`, calling `row` with their values; elements after it are
/// left alone.
pub(super) fn vertex_columns<const BIG: bool>(
    path: &Path,
    bytes: &[u8],
    header: &PlyHeader,
    wanted: &[(usize, Scalar)],
    progress: &dyn Progress,
    mut row: impl FnMut(&[f64]),
) -> Result<()> {
    let mut body = Body { path, bytes, at: header.body_byte, progress };
    let mut values = vec![0.0; wanted.len()];
    for element in &header.elements {
        body.check_room(element)?;
        let before = body.at;
        for number in 0..element.count {
            body.row::<BIG>(element, number, |column, value| {
                if element.name == b"vertex"
                    && let Some(at) = wanted.iter().position(|(c, _)| *c == column)
                {
                    values[at] = load::<BIG>(wanted[at].1, value);
                }
            })?;
            if element.name == b"vertex" {
                row(&values);
            }
        }
        progress.advance((body.at - before) as u64);
        if element.name == b"vertex" {
            break;
        }
    }
    Ok(())
}

/// Reads the element `vertex` if its rows are all of one size.
fn vertices<const BIG: bool>(
    body: &mut Body,
    element: &PlyElement,
    plan: &Plan,
    out: &mut Polygons,
) -> Result<()> {
    let row_bytes = element.least_bytes();
    let columns = plan.coordinates.map(|(column, scalar)| {
        let before = element.properties[..column].iter().map(|p| match p.shape {
            PropertyShape::One(scalar) => scalar.bytes(),
            PropertyShape::List { count, .. } => count.bytes(),
        });
        (before.sum::<usize>(), scalar)
    });
    // Their room was checked; what is reserved is therefore backed by bytes.
    let count = element.count as usize;
    let table = body.take(count * row_bytes).unwrap_or_default();
    out.vertices.reserve_exact(count);
    for part in table.chunks(row_bytes * REPORT_ROWS as usize) {
        body.progress.check()?;
        let position = |row: &[u8]| columns.map(|(at, scalar)| load::<BIG>(scalar, &row[at..]));
        out.vertices.extend(part.chunks_exact(row_bytes).map(position));
    }
    Ok(())
}

/// Reads the element `vertex` if there are lists in its rows.
fn ragged_vertices<const BIG: bool>(
    body: &mut Body,
    element: &PlyElement,
    plan: &Plan,
    out: &mut Polygons,
) -> Result<()> {
    for row in 0..element.count {
        let mut vertex = [0.0; 3];
        body.row::<BIG>(element, row, |column, value| {
            if let Some(axis) = plan.coordinates.iter().position(|(c, _)| *c == column) {
                vertex[axis] = load::<BIG>(plan.coordinates[axis].1, value);
            }
        })?;
        out.vertices.push(vertex);
    }
    Ok(())
}

fn faces<const BIG: bool>(
    body: &mut Body,
    element: &PlyElement,
    plan: &Plan,
    out: &mut Polygons,
) -> Result<()> {
    let (list, item) = plan.corners;
    // Most faces of most files are triangles; what is reserved for them is backed by bytes.
    let triangle_bytes = element.least_bytes() + 3 * item.bytes();
    out.triangles.reserve((body.left() / triangle_bytes).min(element.count as usize));
    let mut corners = Vec::new();
    for row in 0..element.count {
        let at = body.at;
        let mut missing = None;
        body.row::<BIG>(element, row, |column, items| {
            if column == list {
                corners.clear();
                corners.extend(items.chunks_exact(item.bytes()).map(|bytes| {
                    let corner = load::<BIG>(item, bytes);
                    if !(0.0..f64::from(plan.vertices)).contains(&corner) {
                        missing.get_or_insert(corner);
                    }
                    corner as u32
                }));
            }
        })?;
        if let Some(corner) = missing {
            let what = format!(
                "face {} names vertex {corner} (counted from 0), but there are {} vertices",
                row + 1,
                plan.vertices
            );
            return Err(Body { at, ..*body }.error(what));
        }
        out.add_face(&corners);
    }
    Ok(())
}

/// Reads through the body.
struct Body<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    progress: &'a dyn Progress,
}

impl<'a> Body<'a> {
    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Fails unless the rows that the header claims for `element` can be there, all lists being empty.
    fn check_room(&self, element: &PlyElement) -> Result<()> {
        let row_bytes = element.least_bytes() as u64;
        if element.count.checked_mul(row_bytes).is_some_and(|bytes| bytes <= self.left() as u64) {
            return Ok(());
        }
        let what = format!(
            "the header claims {} rows of at least {row_bytes} bytes for the element {}, but only {} bytes \
             follow, room for {} rows",
            element.count,
            text::quote(&element.name),
            self.left(),
            self.left() as u64 / row_bytes.max(1)
        );
        Err(self.error(what))
    }

    /// The next `count` bytes, if there are that many.
    #[inline]
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes[self.at..].get(..count)?;
        self.at += count;
        Some(taken)
    }

    /// Reads `row` (from 0) of `element`; calls `value` with the column and the bytes of each number, or of
    /// all items of each list.
    #[inline]
    fn row<const BIG: bool>(
        &mut self,
        element: &PlyElement,
        row: u64,
        mut value: impl FnMut(usize, &'a [u8]),
    ) -> Result<()> {
        if row.is_multiple_of(REPORT_ROWS) {
            self.progress.check()?;
        }
        for (column, property) in element.properties.iter().enumerate() {
            let bytes = match property.shape {
                PropertyShape::One(scalar) => self.take(scalar.bytes()),
                PropertyShape::List { count, item } => {
                    let before = self.at;
                    let items = self.take(count.bytes()).map(|bytes| load::<BIG>(count, bytes));
                    let list = items.filter(|n| *n >= 0.0).and_then(|n| self.take(n as usize * item.bytes()));
                    if list.is_none() {
                        self.at = before;
                    }
                    list
                }
            };
            let bytes = bytes.ok_or_else(|| self.cut_off(element, row, column))?;
            value(column, bytes);
        }
        Ok(())
    }

    /// The bytes of `column` in `row` of `element` are not all there.
    #[cold]
    fn cut_off(&self, element: &PlyElement, row: u64, column: usize) -> Error {
        self.error(format!(
            "the file ends inside the property {} of row {} of {} of the element {}, or a list has a wrong count",
            text::quote(&element.properties[column].name),
            row + 1,
            element.count,
            text::quote(&element.name)
        ))
    }

    fn error(&self, what: String) -> Error {
        Error::input(self.path, format!("byte {}", self.at), what, "export or copy the file again")
    }
}
