//! Point clouds as text: a point a line, in columns that are named or understood by their numbers.
//!
//! ```text
//! # a comment, also after // or %
//! X Y Z R G B Nx Ny Nz          a line of names, perhaps as a comment; any order
//! 2000                          the number of points that follow, as in PTS
//! 0.5 1.5 2.5 200 180 90 0 0 1  numbers between blanks, commas or semicolons
//! ```

use super::columns::{self, CloudColumns, Column, ColumnLayout, NormalLengths, SAMPLE_ROWS};
use super::fields::Separators;
use super::text::{self, TextLines};
use crate::error::{Error, Result};
use crate::large_array::{ArrayRoom, LargeArray};
use crate::progress::{Progress, Silent};
use crate::soup::PointCloud;
use std::path::Path;

/// Most columns of a line.
const COLUMNS_MAX: usize = 64;
/// Lines at the front of a text without a telling ending that must all look like those of a cloud.
const LINES_LOOKED_AT: usize = 20;
/// Points from which on it is strange that no normal has a component below 0.
const MANY_POINTS: usize = 100;

/// True if `start`, the beginning of a text, holds nothing but points, comments, names and counts, and two points at least.
pub(super) fn is_plausible(start: &[u8]) -> bool {
    // The last line may be cut off.
    let Some(end) = start.iter().rposition(|&b| b == b'\n' || b == b'\r') else { return false };
    let mut rows = Rows::new(Path::new(""), &start[..end], &Silent);
    let mut points = 0;
    while rows.lines.number() < LINES_LOOKED_AT as u64 {
        match rows.next() {
            Ok(true) => points += 1,
            Ok(false) => break,
            Err(_) => return false,
        }
    }
    points >= 2
}

/// Reads all points. What is allocated is a small multiple of the size of `bytes`.
///
/// # Errors
/// If a line is no point, or has not as many numbers as the first; if the file counts more points than it has.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<(PointCloud, CloudColumns)> {
    let (layout, mut columns) = understand(path, bytes)?;
    let mut rows = Rows::new(path, bytes, progress);
    let mut cloud = PointCloud::new(room);
    let (mut whole, mut points) = (true, 0u64);
    while rows.next()? {
        let pick = |at: usize| rows.values[at];
        cloud.push(layout.position.map(pick), layout.normal.map(|normal| normal.map(pick)))?;
        whole &= rows.had_commas && rows.values.iter().all(|v| v.fract() == 0.0);
        points += 1;
    }
    if points < rows.claimed {
        let what = format!("counts {} points, but {points} are there", rows.claimed);
        return Err(Error::input(path, "count", what, "copy or export the file again"));
    }
    if rows.claimed > 0 && points > rows.claimed {
        columns.notes.push(format!("counts {} points, but {points} are there; all are read", rows.claimed));
    }
    columns.decimal_commas = rows.separators.has_decimal_commas();
    if !columns.decimal_commas && whole && columns.names.len() >= 6 && !columns.named {
        columns
            .notes
            .push("all numbers are whole, between commas; decimal commas? then write points".to_owned());
    }
    check_normals(&mut cloud, &mut columns);
    Ok((cloud, columns))
}

/// Columns by their names, or by the first rows.
fn understand(path: &Path, bytes: &[u8]) -> Result<(ColumnLayout, CloudColumns)> {
    let mut rows = Rows::new(path, bytes, &Silent);
    let mut sample = Vec::new();
    let mut count = 0;
    while count < SAMPLE_ROWS && rows.next()? {
        sample.extend_from_slice(&rows.values);
        count += 1;
    }
    let Some(width) = rows.width else {
        return Ok((ColumnLayout { position: [0, 1, 2], normal: None }, CloudColumns::default()));
    };
    if let Some((columns, layout)) = rows.names {
        let no_normals = layout.normal.is_none().then(|| "its first line names none".to_owned());
        let columns = CloudColumns { names: columns, named: true, no_normals, ..CloudColumns::default() };
        return Ok((layout, columns));
    }
    let (columns, layout, no_normals) = columns::of_numbers(&sample, width, rows.claimed > 0);
    let names = columns.iter().map(|column| column.name().to_owned()).collect();
    Ok((layout, CloudColumns { names, no_normals, ..CloudColumns::default() }))
}

/// Normals that only the first rows took for such are dropped.
fn check_normals(cloud: &mut PointCloud, columns: &mut CloudColumns) {
    if columns.named || cloud.normals.is_empty() {
        return;
    }
    let lengths = NormalLengths::of(cloud.normals.iter().copied());
    let first = columns.names.iter().position(|name| name == "nx").map_or(0, |at| at + 1);
    if !lengths.are_units() {
        let [min, max] = [lengths.min, lengths.max].map(columns::short);
        columns.no_normals =
            Some(format!("columns {first} to {} have lengths from {min} to {max}, not 1", first + 2));
        columns.names.iter_mut().skip(first - 1).take(3).for_each(|name| *name = "?".to_owned());
        cloud.normals = LargeArray::default();
    } else if !lengths.negative && cloud.points.len() >= MANY_POINTS {
        columns.notes.push(format!(
            "columns {first} to {} are taken for normals, but none points backward along an axis; if they are colours, \
             name the columns in a first line",
            first + 2
        ));
    }
}

/// The rows of a text, one after the other.
struct Rows<'a> {
    path: &'a Path,
    lines: TextLines<'a>,
    separators: Separators,
    fields: Vec<&'a [u8]>,
    /// Of the row read last.
    values: Vec<f64>,
    had_commas: bool,
    /// Numbers in every row.
    width: Option<usize>,
    /// Columns that a line of names gives, and the line.
    header: Option<(Vec<String>, ColumnLayout, u64)>,
    /// The same, once it is known to fit the rows.
    names: Option<(Vec<String>, ColumnLayout)>,
    /// Points that the file counts.
    claimed: u64,
}

impl<'a> Rows<'a> {
    fn new(path: &'a Path, bytes: &'a [u8], progress: &'a dyn Progress) -> Rows<'a> {
        Rows {
            path,
            lines: TextLines::new(text::without_mark(bytes), 0, progress),
            separators: Separators::default(),
            fields: Vec::new(),
            values: Vec::new(),
            had_commas: false,
            width: None,
            header: None,
            names: None,
            claimed: 0,
        }
    }

    /// Reads the next point; false after the last.
    fn next(&mut self) -> Result<bool> {
        while let Some(line) = self.lines.next()? {
            let mut rest = line;
            let Some(word) = text::token(&mut rest) else { continue };
            if let Some(said) = comment(line) {
                if self.width.is_none() {
                    self.take_names(said, true);
                }
                continue;
            }
            let before = self.separators;
            let split = self.separators.split(line, &mut self.fields);
            if self.width.is_none() && text::number::<f64>(word).is_none() && self.take_names(line, false) {
                self.separators = before;
                continue;
            }
            split.map_err(|what| self.error(what))?;
            if let ([count], None | Some(3..)) = (&self.fields[..], self.width)
                && let Some(count) = text::integer(count).and_then(|count| u64::try_from(count).ok())
            {
                self.claimed = self.claimed.saturating_add(count);
                continue;
            }
            self.row()?;
            self.had_commas = line.contains(&b',');
            return Ok(true);
        }
        Ok(false)
    }

    /// Takes the fields of a line as a point.
    fn row(&mut self) -> Result<()> {
        let count = self.fields.len();
        if self.width.is_none() {
            self.begin(count)?;
        }
        if self.width != Some(count) {
            let expected = self.width.unwrap_or(3);
            return Err(self.error(format!(
                "{count} numbers where {expected} were expected, as in the first line of points"
            )));
        }
        self.values.clear();
        for at in 0..count {
            let field = self.fields[at];
            let value = match self.separators.number(field) {
                Some(value) => value,
                // An empty cell of a table.
                None if field.is_empty() && at >= 3 => f64::NAN,
                None => {
                    let what = format!("{} is not a number{}", text::quote(field), text::hint(field));
                    return Err(self.error(what));
                }
            };
            self.values.push(value);
        }
        Ok(())
    }

    /// The first row says how many columns there are, and whether the names fit.
    fn begin(&mut self, count: usize) -> Result<()> {
        if !(3..=COLUMNS_MAX).contains(&count) {
            return Err(self.error(format!("{count} numbers where at least 3, x y z, were expected")));
        }
        self.width = Some(count);
        match self.header.take() {
            Some((names, layout, _)) if names.len() == count => self.names = Some((names, layout)),
            Some((names, _, line)) if line > 0 => {
                let what = format!("{count} numbers, but line {line} names {} columns", names.len());
                return Err(self.error(what));
            }
            // A comment that is no list of columns after all.
            _ => {}
        }
        Ok(())
    }

    /// Takes a line for the names of the columns, if it is one.
    fn take_names(&mut self, line: &[u8], is_comment: bool) -> bool {
        let words = line.split(|b| text::is_space(*b) || b",;".contains(b)).filter(|word| !word.is_empty());
        let words: Vec<&[u8]> = words.take(COLUMNS_MAX + 1).collect();
        let columns: Vec<Column> = words.iter().map(|word| Column::of_name(word)).collect();
        let Some(layout) = columns::of_names(&columns) else { return false };
        let name = |(word, column): (&&[u8], &Column)| match column {
            Column::Other => String::from_utf8_lossy(word).escape_debug().to_string(),
            known => known.name().to_owned(),
        };
        let names = words.iter().zip(&columns).map(name).collect();
        self.header = Some((names, layout, if is_comment { 0 } else { self.lines.number() }));
        true
    }

    fn error(&self, what: String) -> Error {
        let place = format!("line {}", self.lines.number());
        let remedy =
            "write a point a line, as x y z or x y z nx ny nz, or name the columns in the first line";
        Error::input(self.path, place, what, remedy)
    }
}

/// What a line says that is a comment.
fn comment(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii_start();
    let marks: [&[u8]; 4] = [b"#", b"//", b"%", b"!"];
    marks.into_iter().find_map(|mark| line.strip_prefix(mark))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_all(content: &str) -> Result<(PointCloud, CloudColumns)> {
        read(Path::new("a.xyz"), content.as_bytes(), &ArrayRoom::unbounded(), &Silent)
    }

    #[test]
    fn columns_of_scanners() {
        for (content, names, normals) in [
            ("1 2 3\n4 5 6\n", "x y z", 0),
            ("2\n1 2 3 -5 10 20 30\n4 5 6 7 40 50 60\n", "x y z intensity red green blue", 0),
            ("1;2;3;0;0;1\n4;5;6;0;1;0\n", "x y z nx ny nz", 2),
            ("X Y Z Nx Ny Nz\n1 2 3 0 0 2\n4 5 6 0 3 0\n", "x y z nx ny nz", 2),
            (
                "//X Y Z R G B Scalar_field\n2\n1 2 3 9 9 9 0.5\n4 5 6 9 9 9 0.25\n",
                "x y z red green blue Scalar_field",
                0,
            ),
            ("# a scan of x y z and more\n1 2 3 .5 .5 .5\n4 5 6 1 .1 .2\n", "x y z red green blue", 0),
            ("1 2 3 200 180 90 0 0 1\n4 5 6 0 0 0 0 1 0\n", "x y z red green blue nx ny nz", 2),
            ("x,y,z,r,g,b\n1,2,3,0,0,1\n4,5,6,0,1,0\n", "x y z red green blue", 0),
            ("y\tx\tz\n1\t2\t3\n4\t5\t6\n", "y x z", 0),
        ] {
            let (cloud, columns) = read_all(content).unwrap_or_else(|error| panic!("{content}: {error}"));
            assert_eq!((&columns.names.join(" ")[..], cloud.normals.len()), (names, normals), "{content}");
            assert_eq!(cloud.points.len(), 2, "{content}");
            assert_eq!(columns.no_normals.is_some(), normals == 0, "{content}");
            let first = if names.starts_with('y') { [2.0, 1.0, 3.0] } else { [1.0, 2.0, 3.0] };
            assert_eq!(cloud.points[0], first, "{content}");
        }
    }

    #[test]
    fn what_the_first_rows_look_like_is_held_against_all() {
        let mut content = "1 2 3 0 0 1\n".repeat(SAMPLE_ROWS);
        let (cloud, columns) = read_all(&content).unwrap();
        assert_eq!((cloud.normals.len(), columns.notes.len()), (SAMPLE_ROWS, 1), "{:?}", columns.notes);
        content += &"1 2 3 0.5 0.5 0.1\n".repeat(100);
        let (cloud, columns) = read_all(&content).unwrap();
        let why = columns.no_normals.unwrap();
        assert!(
            cloud.normals.is_empty() && why.contains("columns 4 to 6 have lengths from 0.714 to 1"),
            "{why}"
        );
    }

    #[test]
    fn what_is_wrong_is_named_by_line() {
        for (content, what) in [
            ("1 2\n", "line 1: 2 numbers where at least 3"),
            ("1 2 3\n1 2\n", "line 2: 2 numbers where 3"),
            ("C 1 2 3\n", "line 1: \"C\" is not a number"),
            ("1 2 x\n", "line 1: \"x\" is not a number"),
            ("3\n1 2 3\n1 2 3\n", "count: counts 3 points, but 2 are there"),
            ("X Y Z R G B\n1 2 3\n", "line 2: 3 numbers, but line 1 names 6 columns"),
            ("1,,3\n", "line 1: \"\" is not a number"),
            ("1 2 3\n1,5 2.5 3,5\n", "line 2: commas and blanks both separate numbers (decimal commas?)"),
        ] {
            let said = read_all(content).unwrap_err().to_string();
            assert!(said.contains(what), "{said}");
        }
        let (cloud, columns) = read_all("1\n1,5 2 3\n4 5 6\n").unwrap();
        assert_eq!(cloud.points[..], [[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert!(columns.decimal_commas && columns.notes.len() == 1, "{columns:?}");
    }

    #[test]
    fn clouds_are_told_from_other_texts() {
        for (text, is_one) in [
            ("1 2 3\n4 5 6\n", true),
            ("# scan\n1;2;3\n4;5;6\n", true),
            ("x,y,z\n1,2,3\n4,5,6\n", true),
            ("1 2 3\n", false),
            ("G1 X1\nG1 X2\n", false),
            ("Dear diary,\n1 2 3\n1 2 3\n", false),
            ("1 2\n3 4\n", false),
        ] {
            assert_eq!(is_plausible(text.as_bytes()), is_one, "{text}");
        }
    }
}
