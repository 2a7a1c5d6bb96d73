//! The reader: commands line by line, moves out.

use super::compensation::Compensation;
use super::cycle::Cycle;
use super::frame::{WorkFrame, is_far};
use super::moves::{Moves, Program};
use super::plane::PlaneWords;
use super::tool::Tool;
use super::values::Values;
use crate::error::Result;
use crate::toolpath::gcode::words::{NAMED, Word, Words};
use std::collections::BTreeMap;

/// What comes after a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum After {
    /// The next one.
    Next,
    /// Nothing: the program ends.
    End,
    /// A subprogram by its number, so often.
    Call { number: u64, repeats: Option<u64> },
    /// What begins at the block with this number, so often.
    CallBlock { number: u64, repeats: Option<u64> },
    /// What called this subprogram.
    Return,
}

/// MotionMode that lines with coordinates alone repeat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MotionMode {
    Rapid,
    Straight,
    Arc { clockwise: bool },
    Cycle,
}

pub(super) struct Reader<'a> {
    pub out: Moves<'a>,
    pub(super) motion: Option<MotionMode>,
    /// Across the plane of arcs: 2 for G17, 1 for G18, 0 for G19.
    pub(super) normal: usize,
    /// mm in the unit of the program.
    pub(super) unit: f64,
    /// Comments before G20 or G21: they name tools in the unit that is still to be told.
    before_unit: Option<Vec<String>>,
    pub(super) relative: bool,
    /// Centres of arcs are given as positions.
    pub(super) absolute_centres: bool,
    /// Where the tip is, in the part's coordinates or those of the tilted plane; `None` where it is not told.
    pub(super) at: [Option<f64>; 3],
    pub(super) degrees: [f64; 3],
    /// The tool's axis since G53.1, until words A, B or C turn it.
    pub(super) oriented: Option<[f64; 3]>,
    /// Lines of G68.2 that define a plane, as far as they have come.
    pub(super) defining: Option<PlaneWords>,
    /// Where the program's coordinates lie.
    pub(super) frame: WorkFrame,
    pub(super) cycle: Cycle,
    /// The tool that T has named.
    next: u32,
    /// The contour of G41 or G42 that is being read.
    pub(super) contour: Option<Compensation>,
    /// The number that D has named, and radii that the program sets, in mm.
    pub(super) register: Option<u32>,
    pub(super) radii: BTreeMap<u32, f64>,
    /// Where the tip is after G40, until the next move leads to a place that is programmed.
    pub(super) tip: Option<[f64; 3]>,
}

impl<'a> Reader<'a> {
    pub fn new(out: Moves<'a>) -> Reader<'a> {
        Reader {
            out,
            motion: None,
            normal: 2,
            unit: 1.0,
            before_unit: Some(Vec::new()),
            relative: false,
            absolute_centres: false,
            at: [None; 3],
            degrees: [0.0; 3],
            oriented: None,
            defining: None,
            frame: WorkFrame::default(),
            cycle: Cycle { back_to_start: true, ..Cycle::default() },
            next: 0,
            contour: None,
            register: None,
            radii: BTreeMap::new(),
            tip: None,
        }
    }

    /// The program that was read.
    pub fn finished(mut self) -> Result<Program> {
        self.end_contour()?;
        self.out.finished()
    }

    /// Carries a line out.
    pub fn read_line(&mut self, line: &[u8]) -> Result<After> {
        self.read_comments(line);
        self.read_words(line)
    }

    /// Carries the words of a line out.
    pub fn read_words(&mut self, line: &[u8]) -> Result<After> {
        let line = line.trim_ascii();
        // A mark of tapes, and lines that may be skipped.
        let line = line.strip_prefix(b"/").unwrap_or(line);
        if line.starts_with(b"%") {
            return Ok(After::Next);
        }
        let (mut codes, mut values, mut machine) = (Vec::new(), Values::default(), Vec::new());
        let mut words = Words::new(line);
        while let Some(word) = words.next() {
            let word = word.map_err(|malformed| self.out.fault(malformed.text, malformed.what))?;
            let Word { letter, text, .. } = word;
            let value = match word.value {
                Some(value) if letter != NAMED => value,
                _ => {
                    let what = "is an expression or a name, which is not read";
                    return Err(self.out.refused(text, what, "post-process without macros and variables"));
                }
            };
            if value.abs() > 1e9 {
                return Err(self.out.fault(text, "is out of range"));
            }
            match letter {
                b'G' => codes.push((scaled(value), text)),
                b'M' => machine.push((value as i64, text)),
                // Block numbers, speeds, program names.
                b'N' | b'S' | b'F' | b'O' => {}
                // No word of mills: the exponent of a number, or the filament of a printer.
                b'E' => {
                    let what = "is no word of milling programs, and numbers have no exponents without a sign";
                    let remedy = "write numbers without exponents; toolpaths of printers are for `build`";
                    return Err(self.out.refused(text, what, remedy));
                }
                _ => {
                    if !values.add(letter, value, text) {
                        return Err(self.out.fault(text, "stands twice in the line"));
                    }
                }
            }
        }
        self.carry_out(&codes, &values, &machine)
    }

    pub fn read_comments(&mut self, line: &[u8]) {
        let text = String::from_utf8_lossy(line);
        let parts = text.split('(').skip(1).filter_map(|part| part.split(')').next());
        for comment in parts.chain(text.split_once(';').map(|(_, comment)| comment)) {
            if self.name_tool(comment)
                && let Some(before) = &mut self.before_unit
            {
                before.push(comment.to_owned());
            }
        }
    }

    /// Keeps the tool that a comment names; false if it names none.
    fn name_tool(&mut self, comment: &str) -> bool {
        let named = Tool::of_comment(comment, self.unit);
        if let Some((number, tool)) = named {
            self.out.named.insert(number, tool);
        }
        named.is_some()
    }

    /// G20 or G21, which counts for the list of tools in front of it, too.
    fn set_unit(&mut self, unit: f64) {
        self.unit = unit;
        for comment in self.before_unit.take().unwrap_or_default() {
            self.name_tool(&comment);
        }
    }

    fn carry_out(
        &mut self,
        codes: &[(i64, &[u8])],
        values: &Values,
        machine: &[(i64, &[u8])],
    ) -> Result<After> {
        if let Some(number) = values.get(b'T') {
            self.next = number as u32;
        }
        if let Some(number) =
            values.get(b'D').filter(|_| !codes.iter().any(|(code, _)| matches!(code, 411 | 421)))
        {
            self.register = Some(number as u32);
        }
        self.require_outside_contour(codes, machine)?;
        self.require_whole_plane(codes, values, machine)?;
        self.require_right_frame(codes)?;
        if machine.iter().any(|(code, _)| *code == 6) {
            self.out.tool = self.next;
        }
        let mut takes_words = false;
        let mut in_machine = false;
        for &(code, text) in codes {
            if let Some(takes) = self.set_coordinates(code, values, text)? {
                if takes && takes_words {
                    let what = "stands beside another code that takes the words of the line";
                    return Err(self.out.refused(text, what, "give each a line"));
                }
                takes_words |= takes;
                continue;
            }
            match code {
                0 => self.motion = Some(MotionMode::Rapid),
                10 => self.motion = Some(MotionMode::Straight),
                20 | 30 => self.motion = Some(MotionMode::Arc { clockwise: code == 20 }),
                170 => self.normal = 2,
                180 => self.normal = 1,
                190 => self.normal = 0,
                200 => self.set_unit(25.4),
                210 => self.set_unit(1.0),
                900 => self.relative = false,
                910 => self.relative = true,
                901 => self.absolute_centres = true,
                911 => self.absolute_centres = false,
                800 => {
                    self.cycle.on = false;
                    self.motion = self.motion.filter(|motion| *motion != MotionMode::Cycle);
                }
                980 => self.cycle.back_to_start = true,
                990 => self.cycle.back_to_start = false,
                530 => in_machine = true,
                40 => takes_words = true,
                // How smoothly the machine runs, as G05.1 Q1; with places they are splines of LinuxCNC.
                50 | 51 | 80 | 1870 if !values.any(b"XYZABCIJK") => takes_words = true,
                // Length of the tool: the tip goes where it is told to. Speeds, ways to round corners, and the like.
                430 | 434 | 435 | 490 | 610 | 611 | 640 | 930 | 940 | 950 | 960 | 970 | 150 => {}
                // Of mills K repeats the hole, and I and J lead away from its wall.
                760 if b"IJK".iter().all(|letter| values.get(*letter).is_some()) => {
                    let what = "cuts a thread, as on lathes, which is not read";
                    return Err(self.out.refused(text, what, "give a program of a mill, where G76 bores"));
                }
                code if Cycle::begins(code) => {
                    self.motion = Some(MotionMode::Cycle);
                    if !self.cycle.on {
                        self.cycle = Cycle { on: true, depth: None, retract: None, ..self.cycle };
                    }
                }
                400 => self.end_contour()?,
                410 | 420 | 411 | 421 => self.begin_contour(code, values, text)?,
                650 | 660 | 670 => {
                    let what = "calls a macro at each move, or beside other words, which is not read";
                    return Err(self.out.refused(text, what, "post-process without macros and variables"));
                }
                _ => return Err(self.out.fault(text, "is not read")),
            }
        }
        if !takes_words && values.any(b"XYZABCIJKR") {
            if in_machine {
                self.rest_head(values, |value| value, b"G53")?;
                self.forget(values);
            } else {
                self.travel(values)?;
            }
        }
        self.after(values, machine)
    }

    /// What the M codes of a line say of the next one.
    fn after(&self, values: &Values, machine: &[(i64, &[u8])]) -> Result<After> {
        for &(code, text) in machine {
            match code {
                2 | 30 => return Ok(After::End),
                97 | 98 => {
                    let whole =
                        |letter: u8| values.get(letter).filter(|value| *value >= 0.0 && value.fract() == 0.0);
                    let Some(number) = whole(b'P').map(|number| number as u64) else {
                        let what =
                            "calls what stands in another file, or nothing: it needs P with a whole number";
                        let remedy = "put the subprograms into the file, behind the program's end";
                        return Err(self.out.refused(text, what, remedy));
                    };
                    let repeats = whole(b'L').or(whole(b'K')).map(|times| times as u64);
                    return Ok(match code {
                        97 => After::CallBlock { number, repeats },
                        _ => After::Call { number, repeats },
                    });
                }
                99 if values.any(b"PQ") => {
                    return Err(self.out.fault(text, "goes to a block by its number, which is not read"));
                }
                99 => return Ok(After::Return),
                96 | 198 => {
                    return Err(self
                        .out
                        .fault(text, "calls on a signal or from another file, which is not read"));
                }
                _ => {}
            }
        }
        Ok(After::Next)
    }

    /// Where the words of a line lead, axis by axis.
    pub(super) fn target(&self, values: &Values) -> Result<[Option<f64>; 3]> {
        let from = self.frame.programmed(self.at);
        let mut to = from;
        for (a, value) in values.axes() {
            let (value, letter) = (value * self.unit, &b"XYZ"[a..=a]);
            to[a] = match (self.relative, from[a]) {
                (false, _) => Some(value + self.frame.origin(a)),
                (true, Some(at)) => Some(at + value),
                (true, None) => {
                    return Err(self.out.fault(letter, "counts from a place that the program does not tell"));
                }
            };
            if to[a].is_some_and(is_far) {
                return Err(self.out.fault(letter, "is out of range"));
            }
        }
        let placed = self.frame.placed(to);
        if placed.into_iter().flatten().any(is_far) {
            return Err(self.out.fault(b"X Y Z", "leads out of range"));
        }
        // What is not named keeps its place to the last bit.
        let is_moved = |a: usize| {
            values.get(b"XYZ"[a]).is_some() || (a < 2 && self.frame.is_turned() && values.any(b"XY"))
        };
        Ok([0, 1, 2].map(|a| if is_moved(a) { placed[a] } else { self.at[a] }))
    }
}

/// A place of which all coordinates are known.
pub(super) fn known([x, y, z]: [Option<f64>; 3]) -> Option<[f64; 3]> {
    Some([x?, y?, z?])
}

/// A code in tenths, as 591 for G59.1.
fn scaled(code: f64) -> i64 {
    (code * 10.0).round() as i64
}
