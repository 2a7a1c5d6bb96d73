//! Tables of analyses: CSV with a header, or JSON with totals and rows of the same names.

use crate::failure::Failure;
use crate::output::{in_line, print_json};
use brickfield_engine::Error;
use brickfield_engine::part::PartFile;
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Map, Value, json};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Kind of a table's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableKind {
    Csv,
    Json,
}

impl TableKind {
    /// By the ending of the name.
    ///
    /// # Errors
    /// Usage, for other endings than .csv and .json.
    pub fn of(path: &Path) -> Result<TableKind, Failure> {
        match path.extension().map(|e| e.to_string_lossy().to_lowercase()) {
            Some(ending) if ending == "csv" => Ok(TableKind::Csv),
            Some(ending) if ending == "json" => Ok(TableKind::Json),
            _ => Err(Failure::Usage(format!("{}: the name must end in .csv or .json", in_line(path)))),
        }
    }
}

/// Rows of values under names, each made when it is written: tables may have millions of them.
pub struct Table<'a> {
    /// Names of the columns, in order.
    columns: &'a [&'a str],
    /// How many rows there are.
    count: usize,
    row: RowMaker<'a>,
}

/// Makes a row: a value for each column, null where it is not known.
type RowMaker<'a> = Box<dyn Fn(usize) -> Vec<Value> + 'a>;

impl<'a> Table<'a> {
    /// A table of so many rows.
    pub fn new(columns: &'a [&'a str], count: usize, row: impl Fn(usize) -> Vec<Value> + 'a) -> Table<'a> {
        Table { columns, count, row: Box::new(row) }
    }

    /// A table of rows that are there.
    pub fn of_rows(columns: &'a [&'a str], rows: Vec<Vec<Value>>) -> Table<'a> {
        Table::new(columns, rows.len(), move |n| rows[n].clone())
    }

    /// How many rows it has.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Writes lines of values, the first with the names.
    fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        let cell = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) if text.contains([',', '"', '\n']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Value::String(text) => text.clone(),
            value => value.to_string(),
        };
        writeln!(out, "{}", self.columns.join(","))?;
        (0..self.count).try_for_each(|n| {
            writeln!(out, "{}", (self.row)(n).iter().map(cell).collect::<Vec<_>>().join(","))
        })
    }

    /// One object a row.
    pub fn objects(&self) -> Value {
        let names = || self.columns.iter().map(|c| (*c).to_owned());
        let object = |n: usize| Value::Object(names().zip((self.row)(n)).collect::<Map<_, _>>());
        (0..self.count).map(object).collect()
    }

    /// Appends the table to a file of a kind; `document` is what JSON has.
    ///
    /// # Errors
    /// What writing gives.
    pub fn append_to(
        &self,
        file: &mut PartFile,
        kind: TableKind,
        document: &impl Serialize,
    ) -> Result<(), Failure> {
        let written = match kind {
            TableKind::Csv => self.write_csv(file),
            TableKind::Json => serde_json::to_writer_pretty(&mut *file, document)
                .map_err(io::Error::from)
                .and_then(|()| writeln!(file)),
        };
        Ok(written.map_err(Error::io(file.path(), "write"))?)
    }

    /// Writes the table to a file that has been created, or prints it where there is none; prints `document` beside a file if
    /// that was asked for.
    ///
    /// # Errors
    /// What writing gives.
    pub fn deliver(
        &self,
        file: Option<(PartFile, TableKind)>,
        document: &impl Serialize,
        json: bool,
    ) -> Result<(), Failure> {
        let Some((mut file, kind)) = file else {
            if json {
                return print_json(document);
            }
            let mut out = BufWriter::new(io::stdout().lock());
            return self.write_csv(&mut out).and_then(|()| out.flush()).map_err(Failure::stdout);
        };
        self.append_to(&mut file, kind, document)?;
        file.finish()?;
        if json { print_json(document) } else { Ok(()) }
    }
}

/// Objects, one a row.
impl Serialize for Table<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer
            .collect_seq((0..self.count).map(|n| TableRow { columns: self.columns, row: (self.row)(n) }))
    }
}

struct TableRow<'a> {
    columns: &'a [&'a str],
    row: Vec<Value>,
}

impl Serialize for TableRow<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.columns.iter().zip(&self.row))
    }
}

/// Totals, and a table under a name behind them.
pub struct TableDocument<'a> {
    totals: Value,
    name: &'a str,
    table: &'a Table<'a>,
}

impl<'a> TableDocument<'a> {
    /// `totals` is an object.
    pub fn new(totals: Value, name: &'a str, table: &'a Table<'a>) -> TableDocument<'a> {
        TableDocument { totals, name, table }
    }
}

impl Serialize for TableDocument<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        let totals = self.totals.as_object().into_iter().flatten();
        totals.into_iter().try_for_each(|(name, value)| map.serialize_entry(name, value))?;
        map.serialize_entry(self.name, self.table)?;
        map.end()
    }
}

/// A number rounded to the decimal place of a step, so that it has no more digits than it deserves.
pub fn to_place(value: f64, step: f64) -> Value {
    if !(value.is_finite() && step > 0.0) {
        return json!(value);
    }
    let place = step.log10().floor() as i32;
    let power = 10f64.powi(place.abs());
    let rounded = if place < 0 { (value * power).round() / power } else { (value / power).round() * power };
    // Without the sign of a 0.
    json!(rounded + 0.0)
}

/// A number with six digits.
pub fn six_digits(value: f64) -> Value {
    to_place(value, value.abs() * 1e-6)
}

/// The length of an outline in the digits that it is told in: no bound on its error is known, and it changes by a few
/// thousandths with the cells.
pub fn length_told(length: f64) -> Value {
    to_place(length, length * 1e-3)
}
