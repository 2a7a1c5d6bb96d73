//! CL files of APT (.apt, .cls, .ncl): statements of a word, a slash and its values.
//!
//! Positions are those of the tool's tip in mm, or inches after UNITS/INCHES. GOTO, GODLTA and FROM move it, RAPID makes the next
//! move a rapid one, CIRCLE makes it an arc, and CYCLE drills at each place that follows. Three more values are the tool's axis.
//! CUTTER and TLDATA tell its form. Words that would move the tool in other ways are refused; words without motion
//! are left out, and those that are not known counted.

use super::moves::{Moves, POSITION_MAX, Program};
use super::tool::Tool;
use crate::error::Result;
use crate::lattice::{cross, dot};
use crate::toolpath::gcode::arc::{Arc, Centre};
use std::path::Path;

/// Names of CL files end so.
const EXTENSIONS: [&str; 5] = ["apt", "aptsource", "cl", "cls", "ncl"];
/// Lines in which a word of APT is sought.
const LINES_ASKED: usize = 64;
/// Words that say nothing of where the tool goes.
const SILENT: [&str; 40] = [
    "APPLY",
    "AUXFUN",
    "CATMAT",
    "CATPROCESS",
    "CLAMP",
    "CLDATA",
    "CLEARP",
    "COOLNT",
    "CUTCOM",
    "DELAY",
    "DISPLY",
    "END",
    "END-OF-PATH",
    "FEDRAT",
    "INTOL",
    "LEADER",
    "MACHIN",
    "MODE",
    "MULTAX",
    "OPNAME",
    "OPSKIP",
    "OPSTOP",
    "OUTTOL",
    "PAINT",
    "PARTNO",
    "PPRINT",
    "PREFUN",
    "REMARK",
    "RETRCT",
    "SAFPOS",
    "SELECT",
    "SEQNO",
    "SET",
    "SPINDL",
    "STOP",
    "TLAXIS",
    "TMARK",
    "TOLER",
    "TOOL PATH",
    "TPRINT",
];
/// Words that move the tool, or what comes after them, in ways that are not followed.
const MOVING: [&str; 25] = [
    "ARCSLP", "COPY", "GCONTR", "GOBACK", "GOCLF", "GODOWN", "GOFWD", "GOLFT", "GORGT", "GOUP", "INDEX",
    "INDIRP", "INDIRV", "NURBS", "POCKET", "ROTABL", "ROTATE", "ROTHED", "SPLINE", "THREAD", "TLLFT", "TLON",
    "TLRGT", "TRACUT", "TURN",
];

/// Words behind which any text may stand, with a slash or without.
const TEXTS: [&str; 7] = ["DISPLY", "INSERT", "LETTER", "PARTNO", "PPRINT", "REMARK", "TITLES"];

/// Whether a file is a CL file: by its name, or by its first words.
pub(super) fn is_apt(path: &Path, lines: &[&[u8]]) -> bool {
    let extension = path.extension().map(|end| end.to_string_lossy().to_lowercase());
    let words: [&[u8]; 5] = [b"GOTO", b"LOADTL", b"PARTNO", b"TLDATA", b"TOOL PATH"];
    let is_word = |line: &&[u8]| {
        let behind = |word: &[u8]| {
            let rest = line.get(..word.len())?.eq_ignore_ascii_case(word).then(|| &line[word.len()..])?;
            (word == b"PARTNO" || rest.trim_ascii_start().starts_with(b"/")).then_some(())
        };
        words.iter().any(|word| behind(word).is_some())
    };
    extension.is_some_and(|end| EXTENSIONS.contains(&end.as_str()))
        || lines.iter().filter(|line| !line.is_empty()).take(LINES_ASKED).any(is_word)
}

/// Reads one.
pub(super) fn read(out: Moves<'_>, lines: &[&[u8]]) -> Result<Program> {
    let mut reader = Reader {
        out,
        unit: first_unit(lines),
        at: None,
        axis: [0.0, 0.0, 1.0],
        rapid: false,
        circle: None,
        cycle: None,
        form: None,
    };
    let (mut statement, mut begin) = (String::new(), 0);
    for (number, line) in lines.iter().enumerate() {
        let text = String::from_utf8_lossy(line);
        // One $ ends a line that goes on, two begin a comment.
        let (text, mark) = text.split_once('$').map_or((&*text, None), |(text, mark)| (text, Some(mark)));
        let text = text.trim();
        let goes_on = mark.is_some_and(|mark| !mark.starts_with('$'));
        if statement.is_empty() {
            begin = number as u64 + 1;
        } else if text.is_empty() {
            continue;
        }
        statement.push_str(text);
        if goes_on {
            continue;
        }
        reader.out.line = begin;
        if !statement.is_empty() && !reader.statement(&statement)? {
            statement.clear();
            break;
        }
        statement.clear();
    }
    if !statement.trim().is_empty() {
        reader.out.line = begin;
        return Err(reader
            .out
            .fault(word_of(&statement).as_bytes(), "goes on in a line that the file has not"));
    }
    reader.out.finished()
}

/// The word of a statement, in capitals.
fn word_of(statement: &str) -> String {
    let first = statement.split([' ', '\t', '/']).next().unwrap_or_default().to_uppercase();
    if TEXTS.contains(&first.as_str()) {
        return first;
    }
    statement.split(['/', ',']).next().unwrap_or_default().trim().to_uppercase()
}

/// A statement without the number of its block, as in N10 GOTO/1,2,3 or 10 GOTO/1,2,3, and without a label, as in L1) GOTO/1,2,3.
fn without_number(statement: &str) -> &str {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if let Some((label, rest)) = statement.split_once(')')
        && !label.is_empty()
        && label.chars().all(word)
    {
        return rest.trim_start();
    }
    let Some((first, rest)) = statement.split_once([' ', '\t']) else { return statement };
    let digits = first.strip_prefix(['N', 'n']).unwrap_or(first);
    let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    if is_number { rest.trim_start() } else { statement }
}

/// What CYCLE drills at each place; lengths in mm along the tool's axis.
#[derive(Clone, Copy)]
struct Holes {
    depth: f64,
    clear: f64,
    retract: f64,
}

/// The arc that the next GOTO ends.
#[derive(Clone, Copy)]
struct Circle {
    centre: [f64; 3],
    normal: [f64; 3],
    radius: f64,
}

struct Reader<'a> {
    out: Moves<'a>,
    /// mm in the unit of the file.
    unit: f64,
    at: Option<[f64; 3]>,
    axis: [f64; 3],
    rapid: bool,
    circle: Option<Circle>,
    cycle: Option<Holes>,
    /// The form of the tool that CUTTER or TLDATA has told last, and whether it could be read.
    form: Option<Option<Tool>>,
}

impl Reader<'_> {
    /// Carries a statement out; false at the file's end.
    fn statement(&mut self, statement: &str) -> Result<bool> {
        let statement = without_number(statement);
        let word = word_of(statement);
        let values: Vec<&str> = match statement.split_once('/') {
            Some((_, values)) => values.split(',').map(str::trim).collect(),
            None => Vec::new(),
        };
        match word.as_str() {
            "FINI" => return Ok(false),
            "GOTO" => self.go_to(&word, &values)?,
            "GODLTA" => self.go_by(&word, &values)?,
            "FROM" => {
                (self.at, self.axis) = self.place(&word, &values).map(|(at, axis)| (Some(at), axis))?;
            }
            "GOHOME" => self.at = None,
            "RAPID" => self.rapid = true,
            "CIRCLE" => self.circle = Some(self.circle_of(&word, &values)?),
            "CYCLE" => self.cycle = self.cycle_of(&word, &values)?,
            "UNITS" => self.set_units(&word, &values)?,
            "CUTTER" => self.form = Some(self.cutter(&word, &values)?),
            "TLDATA" => self.form = Some(self.tool_data(&word, &values)?),
            "LOADTL" | "TOOLNO" => self.load(&word, values.first().copied())?,
            "LOAD" if values.first().is_some_and(|v| v.eq_ignore_ascii_case("TOOL")) => {
                self.load(&word, values.get(1).copied())?;
            }
            "MSYS" => self.stay(&word, &values, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0])?,
            "ORIGIN" | "TRANS" => self.stay(&word, &values, &[0.0; 3])?,
            "CUTCOM" if values.iter().any(|v| !v.eq_ignore_ascii_case("OFF")) => {
                let what = "corrects for the radius of the tool, which is not read";
                return Err(self.out.refused(word.as_bytes(), what, "output the path of the tool's centre"));
            }
            _ if MOVING.contains(&word.as_str()) => {
                let what = "moves the tool in a way that is not read";
                return Err(self.out.refused(word.as_bytes(), what, "output the path as GOTO statements"));
            }
            _ if SILENT.contains(&word.as_str()) => {}
            _ => self.skip(&word)?,
        }
        Ok(true)
    }

    /// Counts a word that is not known.
    fn skip(&mut self, word: &str) -> Result<()> {
        const LONGEST: usize = 24;
        const WORDS_MOST: usize = 1000;
        // What ends in the name of a motion was meant as one.
        let last = word.rsplit([' ', ')', '=']).next().unwrap_or_default();
        let moves = ["GOTO", "GODLTA", "FROM", "CIRCLE", "RAPID", "CYCLE"];
        if moves.contains(&last) || MOVING.contains(&last) {
            let short: String = word.chars().take(LONGEST).collect();
            return Err(self.out.fault(short.as_bytes(), "has words before the motion, which are not read"));
        }
        let is_word = word.starts_with(|c: char| c.is_ascii_alphabetic())
            && word.len() <= LONGEST
            && word.chars().all(|c| c.is_ascii_alphanumeric() || " _-.=()".contains(c));
        let skipped = &mut self.out.program.skipped;
        if !is_word || (skipped.len() == WORDS_MOST && !skipped.contains_key(word)) {
            let short: String = word.chars().take(LONGEST).collect();
            return Err(self.out.fault(short.as_bytes(), "is no word of APT"));
        }
        *skipped.entry(word.to_owned()).or_default() += 1;
        Ok(())
    }

    fn number(&self, word: &str, text: &str) -> Result<f64> {
        match text.parse::<f64>() {
            Ok(value) if value.abs() <= POSITION_MAX => Ok(value),
            _ => {
                let short: String = text.chars().take(24).collect();
                Err(self.out.fault(word.as_bytes(), &format!("has {short:?} where a number should stand")))
            }
        }
    }

    fn numbers(&self, word: &str, values: &[&str]) -> Result<Vec<f64>> {
        values.iter().map(|text| self.number(word, text)).collect()
    }

    /// Position and axis: 3 or 6 numbers.
    fn place(&self, word: &str, values: &[&str]) -> Result<([f64; 3], [f64; 3])> {
        let numbers = self.numbers(word, values)?;
        let at = |n: usize| [numbers[n], numbers[n + 1], numbers[n + 2]];
        match numbers.len() {
            3 => Ok((at(0).map(|c| c * self.unit), self.axis)),
            6 => Ok((at(0).map(|c| c * self.unit), self.direction(word, at(3))?)),
            count => Err(self
                .out
                .fault(word.as_bytes(), &format!("has {count} numbers; it takes 3, or 6 with an axis"))),
        }
    }

    fn direction(&self, word: &str, v: [f64; 3]) -> Result<[f64; 3]> {
        // Rounded to a few digits.
        let length = dot(v, v).sqrt();
        if (0.9..1.1).contains(&length) {
            return Ok(v.map(|c| c / length));
        }
        Err(self.out.fault(word.as_bytes(), "has a direction whose length is not 1"))
    }

    fn go_to(&mut self, word: &str, values: &[&str]) -> Result<()> {
        let (to, axis) = self.place(word, values)?;
        if let Some(holes) = self.cycle {
            return self.drill(to, axis, holes);
        }
        match self.circle.take() {
            Some(circle) => self.arc(to, axis, circle),
            None => {
                let rapid = std::mem::take(&mut self.rapid);
                self.go(to, axis, rapid)
            }
        }
    }

    /// Along all axes, or by one number along the tool's.
    fn go_by(&mut self, word: &str, values: &[&str]) -> Result<()> {
        let numbers = self.numbers(word, values)?;
        let Some(at) = self.at else {
            return Err(self.out.fault(word.as_bytes(), "counts from a place that the file does not tell"));
        };
        let by = match numbers[..] {
            [along] => self.axis.map(|c| c * along),
            [x, y, z] => [x, y, z],
            _ => return Err(self.out.fault(word.as_bytes(), "takes 3 numbers, or 1 along the tool's axis")),
        };
        let rapid = std::mem::take(&mut self.rapid);
        self.go([0, 1, 2].map(|a| at[a] + by[a] * self.unit), self.axis, rapid)
    }

    /// Goes straight to a place.
    fn go(&mut self, to: [f64; 3], axis: [f64; 3], rapid: bool) -> Result<()> {
        self.take_form()?;
        match self.at {
            Some(from) => self.turning((from, to), (self.axis, axis), rapid)?,
            None => self.out.program.unplaced += 1,
        }
        (self.at, self.axis) = (Some(to), axis);
        Ok(())
    }

    /// A straight move in halves, and these again, until the tool turns no farther in one than is allowed.
    fn turning(
        &mut self,
        (from, to): ([f64; 3], [f64; 3]),
        (a, b): ([f64; 3], [f64; 3]),
        rapid: bool,
    ) -> Result<()> {
        let apart = [0, 1, 2].map(|n| a[n] - b[n]);
        let chord = dot(apart, apart).sqrt();
        let sum = [0, 1, 2].map(|n| a[n] + b[n]);
        let length = dot(sum, sum).sqrt();
        if length < 1e-6 {
            return Err(self
                .out
                .fault(b"GOTO", "turns the tool upside down, about an axis that is not told"));
        }
        let middle = sum.map(|c| c / length);
        if chord <= self.out.options.turn.max(1e-9) {
            let axis = if chord == 0.0 { a } else { middle };
            return self.out.push((from, to), rapid, chord, |_| axis);
        }
        let half = [0, 1, 2].map(|n| (from[n] + to[n]) * 0.5);
        self.turning((from, half), (a, middle), rapid)?;
        self.turning((half, to), (middle, b), rapid)
    }

    fn circle_of(&self, word: &str, values: &[&str]) -> Result<Circle> {
        let Some(values) = values.get(..7) else {
            return Err(self.out.fault(word.as_bytes(), "takes 7 numbers: centre, direction and radius"));
        };
        let n = self.numbers(word, values)?;
        let centre = [n[0], n[1], n[2]].map(|c| c * self.unit);
        Ok(Circle {
            centre,
            normal: self.direction(word, [n[3], n[4], n[5]])?,
            radius: n[6].abs() * self.unit,
        })
    }

    /// An arc, counter-clockwise seen against the circle's direction, along which it may rise.
    fn arc(&mut self, to: [f64; 3], axis: [f64; 3], circle: Circle) -> Result<()> {
        let Some(from) = self.at else {
            return Err(self.out.fault(b"CIRCLE", "begins at a place that the file does not tell"));
        };
        let rapid = std::mem::take(&mut self.rapid);
        let Circle { centre, normal, radius } = circle;
        let (u, v) = across(normal);
        let local = |p: [f64; 3]| {
            let off = [0, 1, 2].map(|a| p[a] - centre[a]);
            [dot(off, u), dot(off, v), dot(off, normal)]
        };
        let (start, mut end) = (local(from), local(to));
        if (start[0] - end[0]).hypot(start[1] - end[1]) < 1e-6 {
            (end[0], end[1]) = (start[0], start[1]);
        }
        let offset = [-start[0], -start[1]];
        let ends = ([start[0], start[1]], [end[0], end[1]]);
        let arc =
            Arc { start: ends.0, end: ends.1, centre: Centre::Offset(offset), clockwise: false, turns: 0 };
        let chords = self.out.chords(&arc, b"CIRCLE")?;
        let off = (start[0].hypot(start[1]) - radius).abs().max((end[0].hypot(end[1]) - radius).abs());
        if off > 0.05_f64.max(0.001 * chords.length) {
            return Err(self.out.fault(b"CIRCLE", "is not where the arc's ends are"));
        }
        let begin = self.axis;
        for (point, part) in chords.inner_points() {
            let height = start[2] + (end[2] - start[2]) * part;
            let place = [0, 1, 2].map(|a| centre[a] + u[a] * point[0] + v[a] * point[1] + normal[a] * height);
            let mixed = [0, 1, 2].map(|a| begin[a] + (axis[a] - begin[a]) * part);
            let length = dot(mixed, mixed).sqrt();
            let there = if begin == axis || length < 1e-6 { axis } else { mixed.map(|c| c / length) };
            self.go(place, there, rapid)?;
        }
        self.go(to, axis, rapid)?;
        self.out.program.arcs += 1;
        Ok(())
    }

    fn cycle_of(&self, word: &str, values: &[&str]) -> Result<Option<Holes>> {
        let is = |text: &str, name: &str| text.eq_ignore_ascii_case(name);
        match values.first() {
            Some(first) if is(first, "OFF") => return Ok(None),
            // Again as before.
            Some(first) if is(first, "ON") => return Ok(self.cycle),
            _ => {}
        }
        let value = |names: &[&str]| {
            let at = values.iter().position(|text| names.iter().any(|name| is(text, name)))?;
            Some(self.number(word, values.get(at + 1).copied().unwrap_or_default()))
        };
        let length = |names: &[&str]| value(names).transpose().map(|found| found.map(|n| n * self.unit));
        let Some(depth) = length(&["DEPTH", "FEDTO"])? else {
            return Err(self.out.fault(word.as_bytes(), "has no DEPTH or FEDTO, the depth of the hole"));
        };
        let clear = length(&["CLEAR", "RAPTO"])?.unwrap_or(0.0);
        let retract = length(&["RETURN", "RTRCTO"])?.unwrap_or(clear).max(clear);
        Ok(Some(Holes { depth: depth.abs(), clear, retract }))
    }

    /// A hole below a place.
    fn drill(&mut self, place: [f64; 3], axis: [f64; 3], holes: Holes) -> Result<()> {
        let at = |height: f64| [0, 1, 2].map(|a| place[a] + axis[a] * height);
        self.rapid = false;
        self.go(at(holes.clear), axis, true)?;
        self.go(at(-holes.depth), axis, false)?;
        self.go(at(holes.retract), axis, true)
    }

    fn set_units(&mut self, word: &str, values: &[&str]) -> Result<()> {
        let found = unit_of(values.first().copied().unwrap_or_default());
        let what = "names no unit that is read: MM, CM or INCHES";
        self.unit = found.ok_or_else(|| self.out.fault(word.as_bytes(), what))?;
        Ok(())
    }

    /// Coordinates that are the part's own.
    fn stay(&self, word: &str, values: &[&str], still: &[f64]) -> Result<()> {
        let numbers = self.numbers(word, values)?;
        if numbers.iter().zip(still).all(|(number, still)| (number - still).abs() < 1e-9) {
            return Ok(());
        }
        let what = "moves the coordinates, which is not read";
        Err(self.out.refused(word.as_bytes(), what, "output the file in the coordinates of the part"))
    }

    /// A tool by its number.
    fn load(&mut self, word: &str, number: Option<&str>) -> Result<()> {
        let number = self.number(word, number.unwrap_or_default())?;
        if !(0.0..1e9).contains(&number) {
            return Err(self.out.fault(word.as_bytes(), "has no number of a tool"));
        }
        self.out.tool = number as u32;
        Ok(())
    }

    /// Gives the form that was told last to the tool that moves now.
    fn take_form(&mut self) -> Result<()> {
        let Some(form) = self.form.take() else { return Ok(()) };
        let number = self.out.tool;
        let is_given = self.out.options.tools.contains_key(&number);
        let before = self.out.named.get(&number).copied();
        let is_used = self.out.program.tools.iter().any(|(n, _)| *n == number);
        if is_used && !is_given && before != form {
            let what = "tells another form of a tool that has cut already";
            let remedy =
                format!("give each tool a number by LOADTL, or its form by `tool` {number}=flat:6mm");
            return Err(self.out.refused(b"CUTTER", what, &remedy));
        }
        match form {
            Some(tool) => drop(self.out.named.insert(number, tool)),
            None => drop(self.out.named.remove(&number)),
        }
        Ok(())
    }

    /// CUTTER: diameter, corner radius, and of a cutter of seven numbers the centre of the corner, two angles and a height. `None`
    /// of a tapered one.
    fn cutter(&self, word: &str, values: &[&str]) -> Result<Option<Tool>> {
        let n = self.numbers(word, values)?;
        let corner = n.get(1).copied().unwrap_or(0.0);
        match n.len() {
            1 | 2 => Ok(mill(n[0] * self.unit, corner * self.unit)),
            7 if n[4] == 0.0 && n[5] == 0.0 => Ok(mill(n[0] * self.unit, corner * self.unit)),
            7 => Ok(None),
            _ => Err(self.out.fault(word.as_bytes(), "takes 1, 2 or 7 numbers")),
        }
    }

    /// TLDATA/MILL: diameter, corner radius, length, taper, angle of the tip. `None` of other tools, which the caller must tell.
    fn tool_data(&self, word: &str, values: &[&str]) -> Result<Option<Tool>> {
        let Some((kind, values)) = values.split_first() else {
            return Err(self.out.fault(word.as_bytes(), "says nothing"));
        };
        if !kind.eq_ignore_ascii_case("MILL") {
            return Ok(None);
        }
        let n = self.numbers(word, values)?;
        let has_angle = n.iter().skip(3).take(2).any(|angle| *angle != 0.0);
        match n[..] {
            [diameter, ref more @ ..] if !has_angle => {
                Ok(mill(diameter * self.unit, more.first().copied().unwrap_or(0.0) * self.unit))
            }
            [] => Err(self.out.fault(word.as_bytes(), "has no diameter")),
            _ => Ok(None),
        }
    }
}

/// mm in a unit.
fn unit_of(name: &str) -> Option<f64> {
    match name.to_uppercase().as_str() {
        "MM" | "MILLIMETERS" | "MILLIMETRES" => Some(1.0),
        "CM" => Some(10.0),
        "IN" | "INCH" | "INCHES" => Some(25.4),
        _ => None,
    }
}

/// mm in the unit that stands before the first place: it counts for tools in front of it, too.
fn first_unit(lines: &[&[u8]]) -> f64 {
    for line in lines {
        let text = String::from_utf8_lossy(line);
        let statement = without_number(text.trim());
        match word_of(statement).as_str() {
            "FROM" | "GOTO" | "GODLTA" | "CIRCLE" | "CYCLE" => break,
            "UNITS" => {
                let name = statement.split_once('/').and_then(|(_, values)| values.split([',', '$']).next());
                return name.and_then(|name| unit_of(name.trim())).unwrap_or(1.0);
            }
            _ => {}
        }
    }
    1.0
}

/// A mill by its diameter and the radius of its corner.
fn mill(diameter: f64, corner: f64) -> Option<Tool> {
    if corner <= 0.0 {
        Tool::new("flat", diameter, &[], None).ok()
    } else if 2.0 * corner >= diameter * (1.0 - 1e-6) {
        Tool::new("ball", diameter, &[], None).ok()
    } else {
        Tool::new("bull", diameter, &[corner], None).ok()
    }
}

/// Two directions across a third one, each a quarter turn from the other, counter-clockwise.
fn across(normal: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let least = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let side = cross(other, normal);
    let length = dot(side, side).sqrt();
    let u = side.map(|c| c / length);
    (u, cross(normal, u))
}
