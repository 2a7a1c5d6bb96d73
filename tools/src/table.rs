//! Tables of analyses: CSV with a header, or JSON with totals and rows of the same names.

use crate::failure::Failure;
use crate::output::{in_line, print_json};
use anyhow::Context;
use brickfield_engine::part::PartFile;
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Map, Value, json};
use std::io::Write;
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

/// Bytes of text that are gathered before they are written.
const CHUNK_BYTES: usize = 1 << 16;

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

    /// Hands on lines of values, the first with the names.
    fn csv(&self, mut write: impl FnMut(&[u8]) -> Result<(), Failure>) -> Result<(), Failure> {
        let mut text = self.columns.join(",") + "\n";
        let cell = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) if text.contains([',', '"', '\n']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Value::String(text) => text.clone(),
            value => value.to_string(),
        };
        for n in 0..self.count {
            text += &(self.row)(n).iter().map(cell).collect::<Vec<_>>().join(",");
            text.push('\n');
            if text.len() >= CHUNK_BYTES {
                write(text.as_bytes())?;
                text.clear();
            }
        }
        write(text.as_bytes())
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
        match kind {
            TableKind::Csv => self.csv(|text| Ok(file.append(text)?)),
            TableKind::Json => {
                let mut sink = JsonSink { file, text: Vec::new(), error: None };
                let done = serde_json::to_writer_pretty(&mut sink, document);
                sink.text.push(b'\n');
                sink.hand_on();
                match sink.error {
                    Some(error) => Err(error.into()),
                    None => Ok(done.context("cannot write JSON")?),
                }
            }
        }
    }

    /// Writes the table to a file that has been created, or prints it where there is none; prints `document` beside a file if
    /// that was asked for.
    ///
    /// # Errors
    /// What writing gives.
    pub fn deliver(
        &self,
        file: Option<(PartFile, TableKind)>,
        document: &Value,
        json: bool,
    ) -> Result<(), Failure> {
        let Some((mut file, kind)) = file else {
            if json {
                return print_json(document);
            }
            let mut out = std::io::stdout().lock();
            self.csv(|text| out.write_all(text).map_err(Failure::stdout))?;
            return out.flush().map_err(Failure::stdout);
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
    pub totals: Map<String, Value>,
    pub name: &'a str,
    pub table: &'a Table<'a>,
}

impl Serialize for TableDocument<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.totals.len() + 1))?;
        self.totals.iter().try_for_each(|(name, value)| map.serialize_entry(name, value))?;
        map.serialize_entry(self.name, self.table)?;
        map.end()
    }
}

/// JSON on its way to a file.
struct JsonSink<'a> {
    file: &'a mut PartFile,
    text: Vec<u8>,
    /// Why writing ended.
    error: Option<brickfield_engine::Error>,
}

impl JsonSink<'_> {
    fn hand_on(&mut self) {
        if self.error.is_none() {
            self.error = self.file.append(&self.text).err();
        }
        self.text.clear();
    }
}

impl Write for JsonSink<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.text.extend(bytes);
        if self.text.len() >= CHUNK_BYTES {
            self.hand_on();
        }
        match self.error {
            Some(_) => Err(std::io::Error::other("not written")),
            None => Ok(bytes.len()),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// A number rounded to the decimal place of a step, so that it has no more digits than it deserves.
pub fn to_place(value: f64, step: f64) -> Value {
    if !(value.is_finite() && step > 0.0) {
        return json!(value);
    }
    let place = step.log10().floor() as i32;
    let power = 10f64.powi(place.abs());
    json!(if place < 0 { (value * power).round() / power } else { (value / power).round() * power })
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
