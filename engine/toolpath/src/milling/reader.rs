//! The reader: commands line by line, moves out.

use super::compensation::Compensation;
use super::cycle::Cycle;
use super::frame::{WorkFrame, is_far};
use super::moves::{Moves, Program};
use super::tool::Tool;
use crate::error::Result;
use crate::toolpath::gcode::arc::{Arc, Centre};
use crate::toolpath::gcode::tilt;
use crate::toolpath::gcode::words::{NAMED, Word, Words};
use std::collections::BTreeMap;

/// Most holes of a cycle that is repeated.
const REPEATS_MAX: f64 = 10_000.0;

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
enum Motion {
    Rapid,
    Straight,
    Arc { clockwise: bool },
    Cycle,
}

pub(super) struct Reader<'a> {
    pub out: Moves<'a>,
    motion: Option<Motion>,
    /// Across the plane of arcs: 2 for G17, 1 for G18, 0 for G19.
    pub(super) normal: usize,
    /// mm in the unit of the program.
    pub(super) unit: f64,
    /// Comments before G20 or G21: they name tools in the unit that is still to be told.
    before_unit: Option<Vec<String>>,
    pub(super) relative: bool,
    /// Centres of arcs are given as positions.
    absolute_centres: bool,
    /// Where the tip is, in the part's coordinates; `None` where it is not told.
    pub(super) at: [Option<f64>; 3],
    pub(super) degrees: [f64; 3],
    /// Where the program's coordinates lie.
    pub(super) frame: WorkFrame,
    cycle: Cycle,
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

/// The words of a line that are not codes.
#[derive(Default)]
pub(super) struct Values(BTreeMap<u8, f64>);

impl Values {
    pub fn get(&self, letter: u8) -> Option<f64> {
        self.0.get(&letter).copied()
    }

    fn any(&self, letters: &[u8]) -> bool {
        letters.iter().any(|letter| self.0.contains_key(letter))
    }

    /// The axes that are named, with their values.
    fn axes(&self) -> impl Iterator<Item = (usize, f64)> {
        b"XYZ".iter().enumerate().filter_map(|(a, letter)| Some((a, self.get(*letter)?)))
    }
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
        let line = line.trim_ascii();
        self.read_comments(line);
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
                    if values.0.insert(letter, value).is_some() {
                        return Err(self.out.fault(text, "stands twice in the line"));
                    }
                }
            }
        }
        self.carry_out(&codes, &values, &machine)
    }

    fn read_comments(&mut self, line: &[u8]) {
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
        self.require_outside_rotation(codes)?;
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
                690 => self.frame.end_turn(),
                // The way home leads over the place that is named; where home is, no program tells.
                280 | 300 => {
                    self.go_home(values);
                    takes_words = true;
                }
                530 => in_machine = true,
                40 => takes_words = true,
                // Length of the tool: the tip goes where it is told to. Speeds, ways to round corners, and the like.
                430 | 434 | 435 | 490 | 500 | 610 | 611 | 640 | 930 | 940 | 950 | 960 | 970 | 150 => {}
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
                    let what = "calls a macro, which is not read";
                    return Err(self.out.refused(text, what, "post-process without macros and variables"));
                }
                _ => return Err(self.out.fault(text, "is not read")),
            }
        }
        if !takes_words && values.any(b"XYZABCIJKR") {
            if in_machine {
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

    /// Home, along the axes that are named, or all: where that is, no program tells.
    fn go_home(&mut self, values: &Values) {
        self.tip = None;
        if values.any(b"XYZ") { self.forget(values) } else { self.at = [None; 3] }
    }

    /// A move in the machine's coordinates, which say nothing of the part.
    fn forget(&mut self, values: &Values) {
        self.tip = None;
        values.axes().for_each(|(a, _)| self.at[a] = None);
    }

    /// Where the words of a line lead, axis by axis.
    fn target(&self, values: &Values) -> Result<[Option<f64>; 3]> {
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
        // What is not named keeps its place to the last bit.
        if values.any(b"XY") { Ok(self.frame.placed(to)) } else { Ok([self.at[0], self.at[1], to[2]]) }
    }

    fn travel(&mut self, values: &Values) -> Result<()> {
        let Some(motion) = self.motion else {
            return Err(self.out.fault(b"X Y Z", "stand before any of G0 to G3 or a drilling cycle"));
        };
        let degrees = self.turned(values);
        match motion {
            Motion::Cycle if self.contour.is_some() => {
                Err(self.out.fault(b"G81", "drills within a correction for the radius of the tool"))
            }
            Motion::Cycle => self.drill(values),
            Motion::Arc { clockwise } => self.arc(values, clockwise),
            Motion::Rapid | Motion::Straight => {
                let to = self.target(values)?;
                if self.contour.is_some() {
                    return self.along_contour(to, degrees, motion == Motion::Rapid, None);
                }
                self.go(to, degrees, motion == Motion::Rapid)
            }
        }
    }

    /// The angles of the head after a line.
    fn turned(&self, values: &Values) -> [f64; 3] {
        let mut degrees = self.degrees;
        for (a, letter) in b"ABC".iter().enumerate() {
            if let Some(value) = values.get(*letter) {
                degrees[a] = if self.relative { degrees[a] + value } else { value };
            }
        }
        degrees
    }

    /// Goes straight to a place, as far as both ends are known.
    fn go(&mut self, to: [Option<f64>; 3], degrees: [f64; 3], rapid: bool) -> Result<()> {
        let from = self.tip.take().or(known(self.at));
        match (from, known(to)) {
            (Some(from), Some(to)) => self.push(from, to, degrees, rapid)?,
            _ if rapid => self.out.program.unplaced += 1,
            _ => {
                let what = "cuts from a place that the program does not tell: it must be reached by G0 with X, Y and Z first";
                return Err(self.out.fault(b"G1", what));
            }
        }
        (self.at, self.degrees) = (to, degrees);
        Ok(())
    }

    /// Adds a straight move; the angles of the head change evenly along it.
    pub(super) fn push(
        &mut self,
        from: [f64; 3],
        to: [f64; 3],
        degrees: [f64; 3],
        rapid: bool,
    ) -> Result<()> {
        let begin = self.degrees;
        // Turns about several axes at once add up at most.
        let turn: f64 = (0..3).map(|a| (degrees[a] - begin[a]).abs()).sum();
        let axis = |part: f64| tilt::axis([0, 1, 2].map(|a| begin[a] + (degrees[a] - begin[a]) * part));
        self.out.push((from, to), rapid, turn.to_radians(), axis)
    }

    fn arc(&mut self, values: &Values, clockwise: bool) -> Result<()> {
        let to = self.target(values)?;
        let programmed = known(self.frame.programmed(self.at));
        let (Some(from), Some(programmed), Some(end)) = (known(self.at), programmed, known(to)) else {
            return Err(self.out.fault(b"G2", "begins at a place that the program does not tell"));
        };
        // The plane's axes, so that counter-clockwise is seen against its normal.
        let (u, v) = match self.normal {
            2 => (0, 1),
            1 => (2, 0),
            _ => (1, 2),
        };
        let centre = match values.get(b'R') {
            Some(radius) => Centre::Radius(radius * self.unit),
            None => {
                let offset = |a: usize| {
                    let value = values.get(b"IJK"[a]).map(|value| value * self.unit);
                    match (value, self.absolute_centres) {
                        (Some(value), true) => value + self.frame.origin(a) - programmed[a],
                        (Some(value), false) => value,
                        (None, _) => 0.0,
                    }
                };
                Centre::Offset(self.frame.turned([offset(u), offset(v)]))
            }
        };
        // P counts turns; the last one is the arc itself.
        let turns = values.get(b'P').map_or(0, |turns| (turns.clamp(1.0, 1e4) - 1.0) as u32);
        let arc = Arc { start: [from[u], from[v]], end: [end[u], end[v]], centre, clockwise, turns };
        let chords = self.out.chords(&arc, b"G2")?;
        let limit = 0.05_f64.max(0.001 * chords.length);
        if chords.mismatch > limit {
            return Err(self
                .out
                .fault(b"I J K", "are no centre of this arc: its ends are at different distances"));
        }
        let (mut last, degrees) = (from, self.turned(values));
        if self.contour.is_some() {
            let centre = arc.centre_offset().map_err(|what| self.out.fault(b"G2", what))?;
            return self.along_contour(to, degrees, false, Some((centre, clockwise, turns)));
        }
        if self.tip.take().is_some_and(|tip| tip != from) {
            let what = "follows G40, after which a straight move must lead from beside the contour";
            return Err(self.out.fault(b"G2", what));
        }
        for (point, part) in chords.inner_points() {
            let mut place = [0.0; 3];
            (place[u], place[v]) = (point[0], point[1]);
            place[self.normal] = from[self.normal] + (end[self.normal] - from[self.normal]) * part;
            self.push(last, place, degrees, false)?;
            last = place;
        }
        self.push(last, end, degrees, false)?;
        self.out.program.arcs += 1;
        (self.at, self.degrees) = (to, degrees);
        Ok(())
    }

    /// The holes of a line within a cycle.
    fn drill(&mut self, values: &Values) -> Result<()> {
        if self.normal != 2 {
            return Err(self.out.fault(b"G81", "drills in another plane than G17, which is not read"));
        }
        let z = self.frame.origin(2);
        let Some(begin) = self.at[2] else {
            return Err(self.out.fault(b"G81", "drills from a height that the program does not tell"));
        };
        let height = |value: f64, from: f64| if self.relative { from + value } else { value + z };
        if let Some(retract) = values.get(b'R') {
            self.cycle.retract = Some(height(retract * self.unit, begin));
        }
        let Some(retract) = self.cycle.retract else {
            return Err(self.out.fault(b"G81", "has no R, the height from which it feeds"));
        };
        if let Some(depth) = values.get(b'Z') {
            self.cycle.depth = Some(height(depth * self.unit, retract));
        }
        let Some(depth) = self.cycle.depth else {
            return Err(self.out.fault(b"G81", "has no Z, the depth of the hole"));
        };
        let repeats = values.get(b'L').or(values.get(b'K')).unwrap_or(1.0);
        if !(0.0..=REPEATS_MAX).contains(&repeats) {
            return Err(self.out.fault(b"L", "repeats a hole too often"));
        }
        let degrees = self.turned(values);
        for _ in 0..repeats as u32 {
            let plane =
                Values(values.0.iter().filter(|(k, _)| b"XY".contains(k)).map(|(k, v)| (*k, *v)).collect());
            let over = self.target(&plane)?;
            self.go(over, degrees, true)?;
            let [x, y, _] = self.at;
            self.go([x, y, Some(retract)], degrees, true)?;
            self.go([x, y, Some(depth)], degrees, false)?;
            // Out of its own hole.
            let back = if self.cycle.back_to_start { begin.max(retract) } else { retract };
            self.go([x, y, Some(back)], degrees, true)?;
        }
        Ok(())
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
