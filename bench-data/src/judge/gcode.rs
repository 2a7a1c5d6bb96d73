//! A small reader of G-code for the judge: straight moves and arcs in layers, E, and what slicers say in comments.
//!
//! It reads what PrusaSlicer, OrcaSlicer, Slic3r and Cura write, and refuses what it has no rule for, so that it never
//! judges by another toolpath than the file's. It shares no code with the engine.

use super::bead::BeadSize;
use crate::vector::{V3, add, norm, scale, sub};
use std::collections::{BTreeSet, HashMap};
use std::f64::consts::{PI, TAU};

/// Filament's diameter where the file does not tell, mm.
const FILAMENT: f64 = 1.75;
/// Filament owed after retractions that is rounding, mm.
const ROUNDING: f64 = 2e-4;
/// How far chords may deviate from an arc, mm.
const CHORD: f64 = 1e-3;
/// Moves that are shorter are none, mm.
const SHORTEST: f64 = 1e-6;
const INCH: f64 = 25.4;

/// What is laid without travel within one layer and one feature, by one tool.
#[derive(Clone, Debug)]
pub struct Bead {
    /// The way of the tool's tip: the middle of the bead's upper side.
    pub points: Vec<V3>,
    /// Of each segment, one fewer than points.
    pub sections: Vec<BeadSize>,
    /// What the slicer calls it, an index into [`GcodeBeads::features`].
    pub feature: usize,
}

/// The beads of a file.
#[derive(Clone, Debug, Default)]
pub struct GcodeBeads {
    /// In the order of the file.
    pub beads: Vec<Bead>,
    /// Names of features, empty for beads without one.
    pub features: Vec<String>,
    /// Volume fed while they were laid, mm³.
    pub fed: f64,
}

/// What the caller decides.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Features to leave out.
    pub skip: Vec<String>,
    /// Filament's diameter, mm.
    pub filament: Option<f64>,
}

/// Why a file cannot be judged.
#[derive(Debug, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct GcodeError {
    line: usize,
    what: String,
}

/// Reads a toolpath.
///
/// # Errors
/// If a line has a code that changes where material goes and that this reader does not know, or a word without a number.
pub fn read(text: &[u8], options: &ReadOptions) -> Result<GcodeBeads, GcodeError> {
    let text = String::from_utf8_lossy(text);
    let mut machine = Machine::new(options, &text);
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        machine.line(line).map_err(|what| GcodeError { line: number + 1, what })?;
    }
    machine.end_bead();
    Ok(machine.out)
}

/// The state of the machine.
struct Machine<'a> {
    options: &'a ReadOptions,
    filaments: Vec<f64>,
    out: GcodeBeads,
    /// Of the tip, in the machine's coordinates, and what G92 added to the file's, mm.
    place: V3,
    offset: V3,
    extruder: f64,
    unit: f64,
    relative: bool,
    relative_extruder: bool,
    /// The last of G0 to G3.
    motion: u32,
    tool: usize,
    /// Filament retracted and not fed again, by tool, mm.
    owed: HashMap<usize, f64>,
    width: Option<f64>,
    height: Option<f64>,
    layer: u64,
    feature: usize,
    /// Heights at which material was laid, in bits: positive numbers are in their order.
    levels: BTreeSet<u64>,
    bead: Bead,
    /// Layer, tool and feature of the bead that grows.
    kind: (u64, usize, usize),
}

impl<'a> Machine<'a> {
    fn new(options: &'a ReadOptions, text: &str) -> Machine<'a> {
        Machine {
            options,
            filaments: options.filament.map_or_else(|| filaments(text), |d| vec![d]),
            out: GcodeBeads { features: vec![String::new()], ..GcodeBeads::default() },
            place: [0.0; 3],
            offset: [0.0; 3],
            extruder: 0.0,
            unit: 1.0,
            relative: false,
            relative_extruder: false,
            motion: 0,
            tool: 0,
            owed: HashMap::new(),
            width: None,
            height: None,
            layer: 0,
            feature: 0,
            levels: BTreeSet::new(),
            bead: Bead { points: Vec::new(), sections: Vec::new(), feature: 0 },
            kind: (0, 0, 0),
        }
    }

    fn line(&mut self, line: &str) -> Result<(), String> {
        let (code, comment) = line.split_once(';').unwrap_or((line, ""));
        self.comment(comment.trim())?;
        let mut code = without_parentheses(code);
        code.truncate(code.find('*').unwrap_or(code.len()));
        let mut rest = code.trim().to_ascii_uppercase();
        if let Some((number, after)) = word(&rest, 'N') {
            number?;
            rest = after.trim_start().to_owned();
        }
        let Some(letter) = rest.chars().next() else { return Ok(()) };
        // Anything else is text, as EXCLUDE_OBJECT_START.
        let Some((Ok(code), after)) = word(&rest, letter) else { return Ok(()) };
        match letter {
            'G' | 'M' | 'T' => self.command(letter, code, after),
            'X' | 'Y' | 'Z' | 'E' | 'I' | 'J' | 'R' | 'F' => self.moves(&rest),
            _ => Ok(()),
        }
    }

    fn command(&mut self, letter: char, code: f64, after: &str) -> Result<(), String> {
        let code = (code * 10.0).round() as u64;
        match (letter, code) {
            ('G', 0 | 10 | 20 | 30) => {
                self.motion = code as u32 / 10;
                return self.moves(after);
            }
            ('G', 200) => self.unit = INCH,
            ('G', 210) => self.unit = 1.0,
            ('G', 280) => self.home(after)?,
            ('G', 900) => self.relative = false,
            ('G', 910) => self.relative = true,
            ('G', 920) => self.rename(after)?,
            ('M', 820) => self.relative_extruder = false,
            ('M', 830) => self.relative_extruder = true,
            ('T', _) => self.tool = code as usize / 10,
            ('G', 170 | 40 | 290 | 800) => {}
            ('G', 100 | 110) if after.trim().is_empty() => {}
            ('G', _) => return Err(format!("the judge does not know G{}", code as f64 / 10.0)),
            ('M', 30 | 40 | 2000 | 6000 | 7010 | 7020) => {
                return Err(format!("the judge does not know M{}", code as f64 / 10.0));
            }
            _ => {}
        }
        Ok(())
    }

    fn home(&mut self, after: &str) -> Result<(), String> {
        let named: Vec<usize> =
            "XYZ".chars().enumerate().filter(|(_, c)| after.contains(*c)).map(|p| p.0).collect();
        for axis in 0..3 {
            if named.is_empty() || named.contains(&axis) {
                (self.place[axis], self.offset[axis]) = (0.0, 0.0);
            }
        }
        Ok(())
    }

    fn rename(&mut self, after: &str) -> Result<(), String> {
        let words = words(after)?;
        let all = words.is_empty();
        for axis in 0..3 {
            if let Some(value) = words.get(&['X', 'Y', 'Z'][axis]).copied().or(all.then_some(0.0)) {
                self.offset[axis] = self.place[axis] - value * self.unit;
            }
        }
        if let Some(value) = words.get(&'E').copied().or(all.then_some(0.0)) {
            self.extruder = value * self.unit;
        }
        Ok(())
    }

    fn moves(&mut self, text: &str) -> Result<(), String> {
        let words = words(text)?;
        if let Some(other) = words.keys().find(|c| !"XYZEFIJRSP".contains(**c)) {
            return Err(format!("the judge does not know the word {other}"));
        }
        let target = [0, 1, 2].map(|axis| match words.get(&['X', 'Y', 'Z'][axis]) {
            Some(value) if self.relative => self.place[axis] + value * self.unit,
            Some(value) => value * self.unit + self.offset[axis],
            None => self.place[axis],
        });
        let fed = match words.get(&'E') {
            Some(value) if self.relative || self.relative_extruder => value * self.unit,
            Some(value) => value * self.unit - self.extruder,
            None => 0.0,
        };
        self.extruder += fed;
        if self.motion < 2 {
            self.step(target, fed);
            return Ok(());
        }
        if words.contains_key(&'P') {
            return Err("the judge does not know turns of arcs".into());
        }
        let from = self.place;
        let centre = match (words.get(&'R'), words.get(&'I'), words.get(&'J')) {
            (Some(radius), None, None) => centre_of(from, target, radius * self.unit, self.motion == 2)?,
            (None, None, None) => return Err("an arc without I, J and R".into()),
            (None, i, j) => [0, 1].map(|k| from[k] + [i, j][k].copied().unwrap_or(0.0) * self.unit),
            _ => return Err("an arc with R and I or J".into()),
        };
        for (place, part) in arc(from, target, centre, self.motion == 2) {
            self.step(place, fed * part);
        }
        Ok(())
    }

    /// A straight move that feeds so much filament.
    fn step(&mut self, target: V3, fed: f64) {
        let way = sub(target, self.place);
        let length = norm(way);
        let owed = self.owed.entry(self.tool).or_insert(0.0);
        if fed <= 0.0 || length < SHORTEST {
            // Standing: filament is taken back, or what was taken back is fed again.
            *owed = if (*owed - fed) > ROUNDING { *owed - fed } else { 0.0 };
            self.place = target;
            return;
        }
        let again = owed.min(fed);
        *owed -= again;
        let (from, laid) = (add(self.place, scale(way, again / fed)), fed - again);
        self.place = target;
        let length = length * (laid / fed);
        if length >= SHORTEST {
            self.lay(from, target, length, laid);
        }
    }

    fn lay(&mut self, from: V3, to: V3, length: f64, laid: f64) {
        let diameter = self.filaments[self.tool.min(self.filaments.len() - 1)];
        let volume = laid * 0.25 * PI * diameter * diameter;
        let height = self.height.unwrap_or_else(|| self.above_the_last(to[2]));
        let width = self.width.unwrap_or_else(|| BeadSize::width_of(volume / length, height));
        let kind = (self.layer, self.tool, self.feature);
        if self.bead.points.last() != Some(&from) || self.kind != kind {
            self.end_bead();
            (self.kind, self.bead.feature) = (kind, self.feature);
            self.bead.points.push(from);
        }
        self.bead.points.push(to);
        self.bead.sections.push(BeadSize { width, height });
        let skipped = |name: &String| name.eq_ignore_ascii_case(&self.out.features[self.feature]);
        if !self.options.skip.iter().any(skipped) {
            self.out.fed += volume;
        }
    }

    /// Height above the next lower level at which material was laid.
    fn above_the_last(&mut self, z: f64) -> f64 {
        let key = z.max(0.0).to_bits();
        self.levels.insert(key);
        z - self.levels.range(..key).next_back().map_or(0.0, |bits| f64::from_bits(*bits))
    }

    fn end_bead(&mut self) {
        let empty = Bead { points: Vec::new(), sections: Vec::new(), feature: 0 };
        let bead = std::mem::replace(&mut self.bead, empty);
        let skipped = |name: &String| name.eq_ignore_ascii_case(&self.out.features[bead.feature]);
        if !bead.sections.is_empty() && !self.options.skip.iter().any(skipped) {
            self.out.beads.push(bead);
        }
    }

    fn comment(&mut self, text: &str) -> Result<(), String> {
        let after = |names: &[&str]| names.iter().find_map(|name| text.strip_prefix(name)).map(str::trim);
        let length = |text: &str| text.parse().map_err(|_| format!("{text} is no length"));
        if let Some(name) = after(&["TYPE:", "FEATURE:"]) {
            let known = self.out.features.iter().position(|feature| feature == name);
            self.feature = known.unwrap_or_else(|| {
                self.out.features.push(name.to_owned());
                self.out.features.len() - 1
            });
        } else if let Some(width) = after(&["WIDTH:", "LINE_WIDTH:"]) {
            self.width = Some(length(width)?);
        } else if let Some(height) = after(&["HEIGHT:", "LAYER_HEIGHT:"]) {
            self.height = Some(length(height)?);
        } else if after(&["FLAVOR:"])
            .is_some_and(|flavor| flavor.contains("olumetric") || flavor == "UltiGCode")
            || after(&["use_volumetric_e"]).is_some_and(|value| value.ends_with('1'))
        {
            return Err("the judge does not know E in mm³".into());
        } else if after(&["LAYER_CHANGE", "CHANGE_LAYER", "LAYER:"]).is_some() {
            self.layer += 1;
        }
        Ok(())
    }
}

/// Diameters of filaments from the file's settings, by tool.
fn filaments(text: &str) -> Vec<f64> {
    let told = text.lines().filter_map(|line| line.trim().strip_prefix(';')).find_map(|comment| {
        let value = comment.trim().strip_prefix("filament_diameter")?.trim().strip_prefix(['=', ':'])?;
        value.split(',').map(|d| d.trim().parse().ok()).collect::<Option<Vec<f64>>>()
    });
    told.unwrap_or_else(|| vec![FILAMENT])
}

fn without_parentheses(text: &str) -> String {
    let mut depth = 0;
    let keep = |c: &char| {
        depth += i32::from(*c == '(');
        let outside = depth == 0;
        depth -= i32::from(*c == ')' && depth > 0);
        outside
    };
    text.chars().filter(keep).collect()
}

/// A word that begins the text, and what follows; `None` if the text begins with another letter.
fn word(text: &str, letter: char) -> Option<(Result<f64, String>, &str)> {
    let after = text.strip_prefix(letter)?.trim_start();
    let end = after.find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c))).unwrap_or(after.len());
    let number = after[..end].parse().map_err(|_| format!("{letter} has no number"));
    Some((number, &after[end..]))
}

/// All words of a text.
fn words(text: &str) -> Result<HashMap<char, f64>, String> {
    let (mut rest, mut words) = (text.trim_start(), HashMap::new());
    let mut before = ' ';
    while let Some(letter) = rest.chars().next() {
        if letter == 'E' && before.is_ascii_digit() && rest[1..].starts_with(['+', '-']) {
            return Err("the judge does not tell E from an exponent here".into());
        }
        // What a slicer's profile left unfilled, as in Y{machine_depth}, moves nothing.
        if let Some((_, after)) = rest[1..].strip_prefix('{').and_then(|name| name.split_once('}')) {
            rest = after.trim_start();
            continue;
        }
        let Some((number, after)) = word(rest, letter).filter(|_| letter.is_ascii_uppercase()) else {
            return Err(format!("{letter:?} is no word"));
        };
        if words.insert(letter, number?).is_some() {
            return Err(format!("{letter} stands twice"));
        }
        let is_apart = after.starts_with(char::is_whitespace);
        before = if is_apart { ' ' } else { rest[..rest.len() - after.len()].chars().last().unwrap_or(' ') };
        rest = after.trim_start();
    }
    Ok(words)
}

/// The centre of an arc by its radius: of a positive one the way round is less than half a turn.
fn centre_of(from: V3, to: V3, radius: f64, clockwise: bool) -> Result<[f64; 2], String> {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let half = 0.5 * x.hypot(y);
    if half == 0.0 || radius.abs() < half * (1.0 - 1e-6) {
        return Err("an arc whose radius reaches no centre".into());
    }
    let height = (radius * radius - half * half).max(0.0).sqrt() / (2.0 * half);
    let left = if clockwise == (radius < 0.0) { height } else { -height };
    Ok([from[0] + 0.5 * x - left * y, from[1] + 0.5 * y + left * x])
}

/// Places along an arc, each with the part of the arc that leads to it.
fn arc(from: V3, to: V3, centre: [f64; 2], clockwise: bool) -> Vec<(V3, f64)> {
    let [(x0, y0), (x1, y1)] = [from, to].map(|p| (p[0] - centre[0], p[1] - centre[1]));
    let (radius, first) = (x0.hypot(y0), y0.atan2(x0));
    let mut turn = if clockwise { first - y1.atan2(x1) } else { y1.atan2(x1) - first }.rem_euclid(TAU);
    if turn < 1e-9 || (x1 - x0).hypot(y1 - y0) < SHORTEST {
        turn = TAU;
    }
    let step = 2.0 * (1.0 - (CHORD / radius.max(CHORD)).min(0.5)).acos();
    let count = (turn / step).ceil().max(1.0);
    let place = |n: u32| {
        let part = f64::from(n) / count;
        let angle = first + if clockwise { -turn } else { turn } * part;
        let z = from[2] + (to[2] - from[2]) * part;
        [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin(), z]
    };
    let count = count as u32;
    (1..=count).map(|n| (if n == count { to } else { place(n) }, 1.0 / f64::from(count))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> GcodeBeads {
        read(text.as_bytes(), &ReadOptions::default()).unwrap()
    }

    fn lengths(path: &GcodeBeads) -> Vec<f64> {
        let length = |bead: &Bead| bead.points.windows(2).map(|p| norm(sub(p[1], p[0]))).sum();
        path.beads.iter().map(length).collect()
    }

    #[test]
    fn the_torture_has_the_lengths_derived_by_hand() {
        // `gcode/dialect_torture.json`, in the order of the file.
        let path = of(include_str!("../../gcode/dialect_torture.gcode"));
        let total: f64 = lengths(&path).iter().sum();
        assert!((total - 130.843_887).abs() < 0.02, "{total}");
        let volume: f64 = path.beads.iter().map(sections).sum();
        assert!((volume - 12.561_275).abs() < 0.002, "{volume}");
    }

    fn sections(bead: &Bead) -> f64 {
        bead.points.windows(2).zip(&bead.sections).map(|(p, s)| s.area() * norm(sub(p[1], p[0]))).sum()
    }

    #[test]
    fn travel_layers_and_features_end_a_bead_and_widths_do_not() {
        let path =
            of(";HEIGHT:0.2\n;WIDTH:0.5\nM83\nG1 Z0.2\nG1 X5 E1\n;WIDTH:0.6\nG1 X9 E1\nE-1\nE1\nG1 X12 E1\n\
             ;TYPE:Skirt\nG1 X14 E1\n;LAYER_CHANGE\nG1 X15 E1\nG0 Y1\nG1 X16 E1\n");
        assert_eq!(lengths(&path), [12.0, 2.0, 1.0, 1.0]);
        assert_eq!(path.beads[0].sections.iter().map(|s| s.width).collect::<Vec<_>>(), [0.5, 0.6, 0.6]);
        let options = ReadOptions { skip: vec!["skirt".into()], ..ReadOptions::default() };
        let path = read(b";TYPE:Skirt\nM83\nG1 X5 E1\n;TYPE:Fill\nG1 X6 E1\n", &options).unwrap();
        assert_eq!(lengths(&path), [1.0]);
    }

    #[test]
    fn sizes_come_from_e_and_from_levels() {
        let path = of("; filament_diameter = 2\nM83\nG1 Z0.3\nG1 X10 E1\nG1 X0 Z0.5 F900\nG1 X10 E1\n");
        let [first, second] = [0, 1].map(|n| path.beads[n].sections[0]);
        assert!((first.height - 0.3).abs() < 1e-12 && (second.height - 0.2).abs() < 1e-12);
        assert!((first.area() - 0.1 * PI).abs() < 1e-12 && (second.area() - 0.1 * PI).abs() < 1e-12);
        assert!((path.fed - 2.0 * PI).abs() < 1e-12);
    }

    #[test]
    fn retracted_filament_is_fed_before_anything_is_laid() {
        let path = of(";HEIGHT:0.2\n;WIDTH:0.5\nM83\nG1 X10 E1\nE-2\nG1 X20 E3\n");
        assert_eq!(lengths(&path).len(), 2);
        assert!((lengths(&path)[1] - 10.0 / 3.0).abs() < 1e-12, "{:?}", lengths(&path));
    }

    #[test]
    fn words_need_no_spaces_and_unfilled_ones_move_nothing() {
        let path = of(";HEIGHT:0.2\n;WIDTH:0.5\nG1 X0 Y{machine_depth}\ng1x10e0.5*71\n");
        assert_eq!(lengths(&path), [10.0]);
    }

    #[test]
    fn what_has_no_rule_is_refused() {
        for (text, told) in [
            ("G1 X1\nG18\n", "line 2: the judge does not know G18"),
            ("G1 X1 B10\n", "line 1: the judge does not know the word B"),
            ("G1 X\n", "line 1: X has no number"),
            ("G1 X1 X2\n", "line 1: X stands twice"),
            ("M200 D1.75\n", "line 1: the judge does not know M200"),
            ("G1 X1 Y1.2e-05\n", "line 1: the judge does not tell E from an exponent here"),
            (";FLAVOR:Marlin(Volumetric)\n", "line 1: the judge does not know E in mm³"),
            ("G2 X1\n", "line 1: an arc without I, J and R"),
        ] {
            let error = read(text.as_bytes(), &ReadOptions::default()).unwrap_err();
            assert_eq!(error.to_string(), told);
        }
    }
}
