//! Tables of analyses: CSV with a header, or JSON with totals and rows of the same names.

use crate::failure::Failure;
use crate::output::{in_line, print_json};
use anyhow::Context;
use brickfield_engine::part::PartFile;
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

/// Rows of values under names.
pub struct Table<'a> {
    /// Names of the columns, in order.
    pub columns: &'a [&'a str],
    /// A value for each of them, null where it is not known.
    pub rows: Vec<Vec<Value>>,
}

impl Table<'_> {
    /// Lines of values, the first with the names.
    pub fn csv(&self) -> String {
        let mut text = self.columns.join(",") + "\n";
        let cell = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) if text.contains([',', '"', '\n']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Value::String(text) => text.clone(),
            value => value.to_string(),
        };
        for row in &self.rows {
            text += &row.iter().map(cell).collect::<Vec<_>>().join(",");
            text.push('\n');
        }
        text
    }

    /// One object a row.
    pub fn objects(&self) -> Value {
        let names = || self.columns.iter().map(|c| (*c).to_owned());
        let object =
            |row: &Vec<Value>| Value::Object(names().zip(row.iter().cloned()).collect::<Map<_, _>>());
        self.rows.iter().map(object).collect()
    }

    /// The text of a file of a kind; `document` is what JSON has.
    ///
    /// # Errors
    /// If the document cannot be written, which does not happen.
    pub fn text(&self, kind: TableKind, document: &Value) -> Result<String, Failure> {
        Ok(match kind {
            TableKind::Csv => self.csv(),
            TableKind::Json => serde_json::to_string_pretty(document).context("cannot write JSON")? + "\n",
        })
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
            return out.write_all(self.csv().as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout);
        };
        file.append(self.text(kind, document)?.as_bytes())?;
        file.finish()?;
        if json { print_json(document) } else { Ok(()) }
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
