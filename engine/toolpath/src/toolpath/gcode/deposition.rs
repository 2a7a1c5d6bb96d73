//! What marks deposition in files without an extruder's axis: the spindle, relays, commands of a machine, or the
//! codes that the user gives.

use super::words::{Word, Words, identifier, number};
use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// A code or a word of a program that switches deposition.
#[derive(Clone, Debug, PartialEq)]
pub struct DepositionCode {
    /// In upper case.
    text: String,
    /// `None` for a command's name.
    code: Option<Code>,
}

/// A code and its parameters.
#[derive(Clone, Debug, PartialEq)]
struct Code {
    letter: u8,
    number: f64,
    /// Words that must follow on its line.
    parameters: Vec<(u8, f64)>,
}

impl FromStr for DepositionCode {
    type Err = Error;

    /// A code with its parameters (`M64 P8`, `G441`), or a command's name (`EXTRUDER`).
    fn from_str(text: &str) -> Result<DepositionCode> {
        let upper = text.trim().to_ascii_uppercase();
        let refused = || {
            let what = format!("\"{}\" is neither a code nor a command's name", text.escape_debug());
            Error::setting(what, "give it as it stands in the file: M101, M64P8, EXTRUDER")
        };
        let name = identifier(upper.as_bytes());
        if name.len() > 1 && !name[1].is_ascii_digit() {
            return match name.len() == upper.len() {
                true => Ok(DepositionCode { text: upper, code: None }),
                false => Err(refused()),
            };
        }
        let mut found = Vec::new();
        let mut words = Words::new(upper.as_bytes());
        while let Some(word) = words.next() {
            match word.map(|word| (word.letter, word.value)) {
                Ok((letter @ b'A'..=b'Z', Some(value))) => found.push((letter, value)),
                _ => return Err(refused()),
            }
        }
        if found.is_empty() || !words.rest().is_empty() {
            return Err(refused());
        }
        let (letter, number) = found.remove(0);
        Ok(DepositionCode { text: upper, code: Some(Code { letter, number, parameters: found }) })
    }
}

impl fmt::Display for DepositionCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl DepositionCode {
    /// Whether it is a command's name, whose argument 0 switches off.
    pub(super) fn takes_argument(&self) -> bool {
        self.code.is_none()
    }
}

/// What switches deposition in the files of a kind of machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum MachineFamily {
    /// `EXTRUDER(n)`.
    Ingersoll,
    /// `BEAD_AREA=` and `EXTR_END=`.
    Siemens,
    /// G441 and G442.
    Mazak,
    /// Pulses of the relays 8 and 9.
    Meltio,
    /// M34 or M24, and M35, M25 or M5.
    Meld,
    /// M100 and M101.
    Welder,
    /// M101 and M103.
    Extruder,
    /// M3, M4 and M5, with S.
    Spindle,
    /// M52 and M53.
    Gun,
    /// M64 P0 and M65 P0.
    Relay,
}

/// All of them; if a file has the codes of several, the first one counts.
pub(super) const FAMILIES: [MachineFamily; 10] = [
    MachineFamily::Ingersoll,
    MachineFamily::Siemens,
    MachineFamily::Mazak,
    MachineFamily::Meltio,
    MachineFamily::Meld,
    MachineFamily::Welder,
    MachineFamily::Extruder,
    MachineFamily::Gun,
    MachineFamily::Spindle,
    MachineFamily::Relay,
];

impl MachineFamily {
    /// The codes that switch on, and those that switch off.
    pub(super) fn codes(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            MachineFamily::Ingersoll => (&["EXTRUDER"], &[]),
            MachineFamily::Siemens => (&["BEAD_AREA"], &["EXTR_END"]),
            MachineFamily::Mazak => (&["G441"], &["G442"]),
            MachineFamily::Meltio => (&["M64 P8"], &["M64 P9"]),
            MachineFamily::Meld => (&["M34", "M24"], &["M35", "M25", "M5"]),
            MachineFamily::Welder => (&["M100"], &["M101"]),
            MachineFamily::Extruder => (&["M101"], &["M103"]),
            MachineFamily::Spindle => (&["M3", "M4"], &["M5"]),
            MachineFamily::Gun => (&["M52"], &["M53"]),
            MachineFamily::Relay => (&["M64 P0"], &["M65 P0"]),
        }
    }

    /// The machine that is known for it.
    pub(super) fn machine(self) -> Option<&'static str> {
        match self {
            MachineFamily::Ingersoll => Some("Ingersoll"),
            MachineFamily::Siemens => Some("Siemens"),
            MachineFamily::Mazak => Some("Mazak"),
            MachineFamily::Meltio => Some("Meltio"),
            MachineFamily::Meld => Some("MELD"),
            MachineFamily::Gun => Some("MVP"),
            MachineFamily::Welder
            | MachineFamily::Extruder
            | MachineFamily::Spindle
            | MachineFamily::Relay => None,
        }
    }
}

/// A switch's position, and what sets it.
pub(super) struct DepositionSwitch {
    rules: Vec<(DepositionCode, bool)>,
    /// The word S holds the speed of what deposits; at 0 nothing comes.
    has_speed: bool,
    on: bool,
    speed: Option<f64>,
    /// Cross-section that the file gives its beads, mm².
    pub(super) area: Option<f64>,
}

impl DepositionSwitch {
    /// The switch of a family of machines.
    pub(super) fn of(family: MachineFamily) -> DepositionSwitch {
        let (on, off) = family.codes();
        let marks = |codes: &[&str]| {
            codes.iter().filter_map(|code| code.parse().ok()).collect::<Vec<DepositionCode>>()
        };
        let mut switch = DepositionSwitch::new(&marks(on), &marks(off));
        switch.has_speed = family == MachineFamily::Spindle;
        switch
    }

    /// The switch of the user's codes.
    pub(super) fn new(on: &[DepositionCode], off: &[DepositionCode]) -> DepositionSwitch {
        let rule = |mark: &DepositionCode, on| (mark.clone(), on);
        let rules = on.iter().map(|mark| rule(mark, true)).chain(off.iter().map(|mark| rule(mark, false)));
        DepositionSwitch { rules: rules.collect(), has_speed: false, on: false, speed: None, area: None }
    }

    /// The codes that it listens to, for people.
    pub(super) fn text(&self) -> String {
        let list = |on: bool| -> Vec<&str> {
            self.rules.iter().filter(|(_, to)| *to == on).map(|(mark, _)| &*mark.text).collect()
        };
        match list(false).join(", ") {
            off if off.is_empty() => list(true).join(", "),
            off => format!("{} to {off}", list(true).join(", ")),
        }
    }

    pub(super) fn deposits(&self) -> bool {
        self.on && !(self.has_speed && self.speed == Some(0.0))
    }

    /// Takes in an S word.
    pub(super) fn set_speed(&mut self, speed: Option<f64>) {
        self.speed = speed.or(self.speed);
    }

    /// Takes in a code with the words behind it. Returns whether it is one of the switch's.
    pub(super) fn code(&mut self, word: &Word<'_>, value: f64, words: &Words<'_>) -> bool {
        let names = |mark: &DepositionCode| {
            mark.code.as_ref().is_some_and(|code| (code.letter, code.number) == (word.letter, value))
        };
        if !self.rules.iter().any(|(mark, _)| names(mark)) {
            return false;
        }
        let mut behind = Vec::new();
        let mut rest = words.clone();
        while let Some(Ok(word)) = rest.next() {
            behind.push((word.letter, word.value));
        }
        let fits = |mark: &DepositionCode| {
            let needed = mark.code.iter().flat_map(|code| &code.parameters);
            names(mark) && needed.into_iter().all(|(letter, value)| behind.contains(&(*letter, Some(*value))))
        };
        // The one with most parameters is the most specific.
        let rule = self.rules.iter().filter(|(mark, _)| fits(mark));
        let Some(on) = rule.max_by_key(|(mark, _)| mark.text.len()).map(|(_, on)| *on) else { return false };
        let speed = behind.iter().find(|(letter, _)| *letter == b'S').and_then(|(_, value)| *value);
        if on {
            // What stands behind a code that switches off is no speed to go on with.
            self.set_speed(speed);
        }
        self.on = on && (self.has_speed || speed != Some(0.0));
        true
    }

    /// Takes in a command's name with its argument, where it has one. Returns whether it is one of the switch's.
    pub(super) fn named(&mut self, name: &[u8], argument: Option<f64>) -> bool {
        let rule = self
            .rules
            .iter()
            .find(|(mark, _)| mark.takes_argument() && mark.text.as_bytes().eq_ignore_ascii_case(name));
        let Some(on) = rule.map(|(_, on)| *on) else { return false };
        self.on = on && argument != Some(0.0);
        true
    }
}

/// The argument of a command: `EXTRUDER(120)`, `EXTRUDER = 120`, `EXTRUDER 120`.
pub(super) fn argument(behind: &[u8]) -> Option<f64> {
    let text = behind.trim_ascii_start();
    let text = text.strip_prefix(b"(").or_else(|| text.strip_prefix(b"=")).unwrap_or(text);
    number(text.trim_ascii_start()).map(|found| found.value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_typed_as_they_stand_in_files() {
        for (text, code) in [
            ("m101", Some((b'M', 101.0, vec![]))),
            ("M64P8", Some((b'M', 64.0, vec![(b'P', 8.0)]))),
            (" M64 p8 ", Some((b'M', 64.0, vec![(b'P', 8.0)]))),
            ("G441", Some((b'G', 441.0, vec![]))),
            ("extruder", None),
            ("BEAD_AREA", None),
        ] {
            let mark: DepositionCode = text.parse().unwrap();
            let code = code.map(|(letter, number, parameters)| Code { letter, number, parameters });
            assert_eq!((mark.code, mark.text), (code, text.trim().to_uppercase()));
        }
        for text in ["", "M", "M64 Px", "64", "EXTRUDER(5)", "M64;", "(M5)", "M{a}", "M=R1"] {
            assert!(text.parse::<DepositionCode>().is_err(), "{text}");
        }
    }

    #[test]
    fn every_family_has_its_codes() {
        for family in FAMILIES {
            let switch = DepositionSwitch::of(family);
            let (on, off) = family.codes();
            assert_eq!(switch.rules.len(), on.len() + off.len(), "{family:?}");
        }
    }

    #[test]
    fn the_most_specific_code_counts() {
        let mark = |text: &str| text.parse::<DepositionCode>().unwrap();
        let mut switch = DepositionSwitch::new(&[mark("M64"), mark("EXTRUDER")], &[mark("M64 P9")]);
        for (line, deposits) in
            [("M64 P8", true), ("M64 P9", false), ("M64", true), ("M64 S0", false), ("M64 Q1 P9", false)]
        {
            let mut words = Words::new(line.as_bytes());
            let word = words.next().unwrap().unwrap();
            assert!(switch.code(&word, word.value.unwrap(), &words));
            assert_eq!(switch.deposits(), deposits, "{line}");
        }
        for (behind, deposits) in
            [("(120)", true), ("(0)", false), ("", true), (" = 0.0", false), (" 5", true)]
        {
            assert!(switch.named(b"Extruder", argument(behind.as_bytes())));
            assert_eq!(switch.deposits(), deposits, "{behind}");
        }
        assert!(!switch.named(b"EXTRUDERS", None));
        assert_eq!(switch.text(), "M64, EXTRUDER to M64 P9");
    }
}
