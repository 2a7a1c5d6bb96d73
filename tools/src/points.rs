//! Points from CSV, and their winding numbers back.

use crate::failure::Failure;
use crate::interrupt;
use crate::output::Lines;
use anyhow::{Context, anyhow};
use brickfield_engine::ingest::Separators;
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

/// Longest line that makes sense; keeps a file without line breaks from filling the memory.
const LINE_BYTES_MAX: usize = 4096;

/// Reads points a batch at a time.
pub struct PointReader {
    name: String,
    input: Box<dyn BufRead>,
    line: usize,
    /// Columns a line must have: those of the header, of which the first three count, or three.
    columns: Option<usize>,
    /// What the first line has between its values.
    between: Separator,
    separators: Separators,
}

/// What stands between the values of a table.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Separator {
    Commas,
    Semicolons,
    Blanks,
}

impl Separator {
    /// That of a line, and its name.
    fn of(line: &[u8]) -> Separator {
        let is_blank = |piece: &[u8]| piece.trim_ascii().iter().any(u8::is_ascii_whitespace);
        if line.contains(&b';') {
            Separator::Semicolons
        } else if line.contains(&b',') && !line.split(|&byte| byte == b',').any(is_blank) {
            Separator::Commas
        } else {
            Separator::Blanks
        }
    }

    fn name(self) -> &'static str {
        match self {
            Separator::Commas => "commas",
            Separator::Semicolons => "semicolons",
            Separator::Blanks => "blanks",
        }
    }
}

impl PointReader {
    /// Opens a file, or standard input for `-`.
    pub fn open(path: &Path) -> Result<PointReader, Failure> {
        let (name, input): (String, Box<dyn BufRead>) = if path == Path::new("-") {
            ("standard input".to_owned(), Box::new(io::stdin().lock()))
        } else {
            let name = path.display().to_string();
            let cannot_open = || format!("{name}: cannot open");
            if path.is_dir() {
                return Err(anyhow!("{name}: is a directory; give a CSV file of points").into());
            }
            let file = File::open(path).with_context(cannot_open)?;
            (name, Box::new(BufReader::with_capacity(1 << 16, file)))
        };
        let between = Separator::Commas;
        Ok(PointReader { name, input, line: 0, columns: None, between, separators: Separators::default() })
    }

    /// At most `count` more points; none at the end.
    pub fn batch(&mut self, count: usize) -> Result<Vec<[f64; 3]>, Failure> {
        interrupt::end_at_once(true);
        let points = self.read(count);
        interrupt::end_at_once(false);
        points
    }

    fn read(&mut self, count: usize) -> Result<Vec<[f64; 3]>, Failure> {
        let mut points = Vec::new();
        let mut buffer = Vec::new();
        while points.len() < count {
            buffer.clear();
            let mut limited = io::Read::take(&mut self.input, LINE_BYTES_MAX as u64);
            let cannot_read = || format!("{}: cannot read", self.name);
            if limited.read_until(b'\n', &mut buffer).with_context(cannot_read)? == 0 {
                break;
            }
            self.line += 1;
            if buffer.len() == LINE_BYTES_MAX {
                return Err(self.malformed("the line is too long"));
            }
            points.extend(self.parse(&buffer)?);
        }
        Ok(points)
    }

    /// All remaining points.
    pub fn all(mut self) -> Result<Vec<[f64; 3]>, Failure> {
        self.batch(usize::MAX)
    }

    /// The point on a line, if it holds one.
    fn parse(&mut self, line: &[u8]) -> Result<Option<[f64; 3]>, Failure> {
        let line = if self.line == 1 { line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line) } else { line };
        let line = line.trim_ascii();
        if line.is_empty() || line[0] == b'#' {
            return Ok(None);
        }
        if self.columns.is_none() {
            self.between = Separator::of(line);
        }
        let before = self.separators;
        let mut fields = Vec::new();
        match self.between {
            Separator::Commas => fields.extend(line.split(|&byte| byte == b',').map(<[u8]>::trim_ascii)),
            _ => self.separators.split(line, &mut fields).map_err(|what| self.malformed(&what))?,
        }
        let number = |field: &&[u8]| match self.between {
            Separator::Commas => fast_float2::parse(field).ok(),
            _ => self.separators.number(field),
        };
        let numbers: Vec<Option<f64>> = fields.iter().map(number).collect();
        let Some(columns) = self.columns else {
            let is_header = fields.len() >= 3 && numbers.iter().all(Option::is_none);
            self.columns = Some(if is_header { fields.len() } else { 3 });
            if is_header {
                self.separators = before;
                return Ok(None);
            }
            return self.point(&fields, &numbers, 3);
        };
        self.point(&fields, &numbers, columns)
    }

    fn point(
        &self,
        fields: &[&[u8]],
        numbers: &[Option<f64>],
        columns: usize,
    ) -> Result<Option<[f64; 3]>, Failure> {
        if fields.len() != columns {
            let has_points = fields.iter().any(|field| field.contains(&b'.'));
            let is_doubled = self.between == Separator::Commas && fields.len() == 2 * columns && !has_points;
            let hint = if is_doubled { " (decimal commas? separate values by semicolons then)" } else { "" };
            let between = self.between.name();
            return Err(
                self.malformed(&format!("{columns} values separated by {between} were expected{hint}"))
            );
        }
        let mut point = [0.0; 3];
        for (axis, value) in point.iter_mut().enumerate() {
            *value = numbers[axis].filter(|v| v.is_finite()).ok_or_else(|| {
                let field = String::from_utf8_lossy(fields[axis]);
                self.malformed(&format!("\"{field}\" is no finite number"))
            })?;
        }
        Ok(Some(point))
    }

    fn malformed(&self, what: &str) -> Failure {
        anyhow!("{}: line {}: {what}; write a point as x,y,z", self.name, self.line).into()
    }
}

/// A pass of a bead that covers a point, or a bead as a whole.
#[derive(Serialize)]
pub struct PointBead<'a> {
    pub bead: u32,
    /// From 0, within the bead; absent where the store counts beads.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pass: Option<u32>,
    pub source: u32,
    pub layer: u32,
    pub tool: u16,
    pub feature: &'a str,
    pub first_line: u64,
    pub last_line: u64,
}

impl PointBead<'_> {
    fn text(&self) -> String {
        let PointBead { bead, pass, source, layer, tool, feature, first_line, last_line } = self;
        let pass = pass.map_or(String::new(), |pass| format!(".{pass}"));
        format!("{bead}{pass}:{source}:{layer}:{tool}:{first_line}-{last_line}:{feature}")
    }
}

/// Writes points with a number each to standard output.
pub struct PointWriter {
    lines: Lines,
    json: bool,
    /// What the numbers are.
    column: &'static str,
}

impl PointWriter {
    /// CSV with its header, or JSON lines, of winding numbers.
    pub fn new(json: bool) -> Result<PointWriter, Failure> {
        PointWriter::of(json, "w")
    }

    /// The same of other numbers.
    pub fn of(json: bool, column: &'static str) -> Result<PointWriter, Failure> {
        let mut lines = Lines::to_stdout();
        if !json {
            lines.line(format_args!("x,y,z,{column}"))?;
        }
        Ok(PointWriter { lines, json, column })
    }

    /// As [`PointWriter::new`], for lines with beads.
    pub fn with_beads(json: bool) -> Result<PointWriter, Failure> {
        let mut lines = Lines::to_stdout();
        if !json {
            lines.line(format_args!("x,y,z,w,beads,which"))?;
        }
        Ok(PointWriter { lines, json, column: "w" })
    }

    /// One line with the beads or passes that cover the point. In CSV they are one column,
    /// `number:source:layer:tool:first line-last line:feature` each, separated by semicolons. A pass has the number of its
    /// bead and, behind a full stop, its own there.
    pub fn write_beads(
        &mut self,
        [x, y, z]: [f64; 3],
        w: f64,
        beads: &[PointBead<'_>],
    ) -> Result<(), Failure> {
        if self.json {
            let beads = serde_json::to_string(beads).context("cannot print beads")?;
            return self
                .lines
                .line(format_args!("{{\"x\":{x:?},\"y\":{y:?},\"z\":{z:?},\"w\":{w},\"beads\":{beads}}}"));
        }
        let which: Vec<String> = beads.iter().map(PointBead::text).collect();
        // Names come from a file: nothing of them must end the quotation.
        let which = which.join(";").replace('"', "\"\"");
        self.lines.line(format_args!("{x:?},{y:?},{z:?},{w},{},\"{which}\"", beads.len()))
    }

    /// One line.
    pub fn write(&mut self, [x, y, z]: [f64; 3], number: impl std::fmt::Display) -> Result<(), Failure> {
        let column = self.column;
        if self.json {
            self.lines.line(format_args!("{{\"x\":{x:?},\"y\":{y:?},\"z\":{z:?},\"{column}\":{number}}}"))
        } else {
            self.lines.line(format_args!("{x:?},{y:?},{z:?},{number}"))
        }
    }

    /// One line of a point that has no number.
    pub fn write_none(&mut self, point: [f64; 3]) -> Result<(), Failure> {
        self.write(point, if self.json { "null" } else { "" })
    }

    /// Hands on what is buffered.
    pub fn flush(&mut self) -> Result<(), Failure> {
        self.lines.flush()
    }
}
