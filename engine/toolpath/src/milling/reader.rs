//! The reader: commands line by line, moves out.

use super::compensation::Compensation;
use super::cycle::Cycle;
use super::frame::{WorkFrame, is_far};
use super::moves::{Moves, Program};
use super::tilted::PlaneWords;
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

/// Motion that lines with coordinates alone repeat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    Rapid,
    Straight,
    Arc { clockwise: bool },
    Cycle,
}

pub(super) struct Reader<'a> {
    pub out: Moves<'a>,
    pub(super) motion: Option<Motion>,
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
        self.require_right_frame(codes, values, machine)?;
        if machine.iter().any(|(code, _)| *code == 6) {
            self.out.tool = self.next;
        }
        let mut takes_words = false;
        let mut in_machine = false;
        for &(code, text) in codes {
            match code {
                0 => self.motion = Some(Motion::Rapid),
                10 => self.motion = Some(Motion::Straight),
                20 | 30 => self.motion = Some(Motion::Arc { clockwise: code == 20 }),
                170 => self.normal = 2,
                180 => self.normal = 1,
                190 => self.normal = 0,
                200 => self.set_unit(25.4),
                210 => self.set_unit(1.0),
                900 => self.relative = false,
                910 => self.relative = true,
                901 => self.absolute_centres = true,
                911 => self.absolute_centres = false,
                540..=590 if code % 10 == 0 => self.frame.system = (code / 10 - 54) as usize,
                591..=593 => self.frame.system = (code - 591 + 6) as usize,
                541 | 1540 => {
                    let [first, second] = WorkFrame::FURTHER;
                    let (base, most) = if code == 541 { (first, 300.0) } else { (second, 99.0) };
                    let Some(number) =
                        values.get(b'P').filter(|p| (1.0..=most).contains(p) && p.fract() == 0.0)
                    else {
                        let what = format!("needs P with a whole number from 1 to {most}");
                        return Err(self.out.fault(text, &what));
                    };
                    self.frame.system = base + number as usize;
                }
                800 => {
                    self.cycle.on = false;
                    self.motion = self.motion.filter(|motion| *motion != Motion::Cycle);
                }
                980 => self.cycle.back_to_start = true,
                990 => self.cycle.back_to_start = false,
                100 => {
                    self.set_system(values, text)?;
                    takes_words = true;
                }
                920 => {
                    self.set_shift(values);
                    takes_words = true;
                }
                921 | 922 => self.frame.forget_places(),
                520 => {
                    self.set_local(values);
                    takes_words = true;
                }
                680 => {
                    self.begin_rotation(values, text)?;
                    takes_words = true;
                }
                510 | 511 => {
                    if code == 510 {
                        self.begin_scale(values, text)?
                    } else {
                        self.mirror(values, text)?
                    }
                    takes_words = true;
                }
                500 => self.frame.end_scale(),
                501 => {
                    self.end_mirror(values);
                    takes_words = true;
                }
                682 | 684 => {
                    self.define_plane(code, values, text)?;
                    takes_words = true;
                }
                683 => {
                    let what = "takes a plane from the axis of the tool, which is not read";
                    return Err(self.out.refused(
                        text,
                        what,
                        "give the plane by G68.2 with angles, points or vectors",
                    ));
                }
                531 | 536 => {
                    self.orient(code, values, text)?;
                    takes_words = true;
                }
                690 => {
                    self.frame.end_turn();
                    self.set_plane(None);
                }
                // The way home leads over the place that is named; where home is, no program tells.
                280 | 300 => {
                    self.go_home(code, values, text)?;
                    takes_words = true;
                }
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
                    self.motion = Some(Motion::Cycle);
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

    /// G10 L2 P… sets a work offset.
    fn set_system(&mut self, values: &Values, text: &[u8]) -> Result<()> {
        let number = values.get(b'P').map(|p| p as usize);
        match (values.get(b'L').map(|l| l as i64), number) {
            (Some(2), Some(number @ 0..=9)) => {
                for (a, value) in values.axes() {
                    self.frame.set_system(number.checked_sub(1), a, value * self.unit);
                }
                Ok(())
            }
            (Some(1 | 12), Some(number)) => {
                if let Some(radius) = values.get(b'R') {
                    self.radii.insert(number as u32, radius * self.unit);
                }
                Ok(())
            }
            (Some(1 | 10 | 11), _) => Ok(()),
            _ => Err(self.out.fault(text, "sets what is not read; use L2 with P1 to P9")),
        }
    }

    /// G92 names the present place.
    fn set_shift(&mut self, values: &Values) {
        for (a, value) in values.axes() {
            if let Some(at) = self.at[a] {
                self.frame.name_place(a, at, value * self.unit);
            }
        }
    }

    /// G52 moves the zero of all work offsets.
    fn set_local(&mut self, values: &Values) {
        values.axes().for_each(|(a, value)| self.frame.set_local(a, value * self.unit));
    }

    /// Home, along the axes that are named, or all: where that is, no program tells. Of axes that turn the head it is 0.
    fn go_home(&mut self, code: i64, values: &Values, text: &[u8]) -> Result<()> {
        if code == 300 && values.any(b"ABC") {
            return Err(self.out.fault(text, "turns the head to an angle that no program tells"));
        }
        self.tip = None;
        if values.any(b"XYZ") {
            self.forget(values)
        } else {
            self.at = [None; 3]
        }
        self.rest_head(values, |_| 0.0, text)
    }

    /// A move in the machine's coordinates, which say nothing of the part.
    fn forget(&mut self, values: &Values) {
        self.tip = None;
        let plane = self.frame.plane;
        self.set_plane(None);
        values.axes().for_each(|(a, _)| self.at[a] = None);
        self.set_plane(plane);
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
