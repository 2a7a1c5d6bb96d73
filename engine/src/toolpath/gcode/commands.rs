//! Codes: G, M and T words.

use super::machine::Machine;
use super::offsets::OffsetCode;
use super::signs::INCH;
use super::words::{Malformed, Word, Words, token};
use crate::error::Result;

/// What is to be done after a code.
pub(super) enum Effect {
    /// Go on with the line's words.
    Modal,
    /// The line moves the tool.
    Motion,
    /// The rest of the line does not matter.
    LineDone,
    /// The rest of the line says what the position is called (G92).
    SetPosition,
    /// The rest of the line sets offsets.
    SetOffsets(OffsetCode),
}

/// G codes, times ten, that change nothing that matters here: dwell, bed levelling, parking, feed modes.
const NEUTRAL_G: [u32; 16] = [40, 120, 270, 290, 340, 400, 490, 600, 610, 640, 690, 800, 930, 940, 950, 990];

/// M codes that change nothing that matters here: heat, fans, messages, speeds, acceleration, progress, the
/// host's business.
const NEUTRAL_M: [(u32, u32); 34] = [
    (0, 2),
    (6, 9),
    (17, 18),
    (20, 36),
    (42, 42),
    (73, 80),
    (84, 86),
    (92, 92),
    (104, 117),
    (118, 123),
    (125, 128),
    (140, 145),
    (149, 150),
    (155, 155),
    (163, 165),
    (190, 193),
    (201, 205),
    (207, 211),
    (220, 220),
    (226, 226),
    (240, 240),
    (250, 260),
    (280, 282),
    (300, 305),
    (350, 355),
    (400, 413),
    (420, 425),
    (486, 486),
    (500, 504),
    (569, 575),
    (592, 593),
    (600, 605),
    (701, 702),
    (862, 1002),
];

/// Klipper's commands that change nothing that matters here.
const NEUTRAL_EXTENDED: [&str; 7] = [
    "EXCLUDE_OBJECT_DEFINE",
    "EXCLUDE_OBJECT_END",
    "SET_FAN_SPEED",
    "SET_HEATER_TEMPERATURE",
    "SET_PRESSURE_ADVANCE",
    "SET_PRINT_STATS_INFO",
    "SET_VELOCITY_LIMIT",
];

/// Whether a command of several letters changes nothing that matters here.
pub(super) fn is_neutral_extended(name: &[u8]) -> bool {
    NEUTRAL_EXTENDED.iter().any(|known| name.eq_ignore_ascii_case(known.as_bytes()))
}

/// Carries out a G, M or T word; `first` if no other code stands before it.
pub(super) fn code(
    machine: &mut Machine<'_, '_>,
    word: &Word<'_>,
    value: f64,
    first: bool,
    words: &mut Words<'_>,
) -> Result<Effect> {
    let tenfold = (value * 10.0).round();
    let is_code = (0.0..100_000.0).contains(&tenfold) && (tenfold / 10.0 - value).abs() < 1e-9;
    if is_code && !machine.by_extruder && machine.switch.code(word, value, words) {
        return Ok(if first && !goes_on(words) { Effect::LineDone } else { Effect::Modal });
    }
    match word.letter {
        b'T' => tool(machine, word, value),
        _ if !is_code => {
            machine.beads.report.unknown(word.text, machine.line);
            Ok(if first { Effect::LineDone } else { Effect::Modal })
        }
        b'G' => general(machine, word, tenfold as u32, first, words),
        _ => miscellaneous(machine, word, tenfold as u32, first, words),
    }
}

fn general(
    machine: &mut Machine<'_, '_>,
    word: &Word<'_>,
    tenfold: u32,
    first: bool,
    words: &mut Words<'_>,
) -> Result<Effect> {
    match tenfold {
        0 | 10 | 20 | 30 => {
            machine.motion = Some((tenfold / 10) as u8);
            return Ok(Effect::Motion);
        }
        50 | 51 => {
            let what = "is a spline, which is not read: export straight moves or arcs";
            return Err(machine.malformed(&Malformed { text: word.text, what }));
        }
        100 => return Ok(Effect::SetOffsets(OffsetCode::G10)),
        110 => return Ok(Effect::LineDone),
        170 | 180 | 190 => machine.plane = (tenfold / 10 - 17) as usize,
        200 | 7000 => machine.set_unit(INCH),
        210 | 7100 => machine.set_unit(1.0),
        // On lathes they are cycles, with words P and Q.
        700 | 710 if !has_letter(words, b"PQ") => machine.set_unit(if tenfold == 700 { INCH } else { 1.0 }),
        430..=440 => machine.use_tool_length(),
        520 => return Ok(Effect::SetOffsets(OffsetCode::G52)),
        530 => machine.in_machine = true,
        541 => return Ok(Effect::SetOffsets(OffsetCode::G54Extended)),
        540 | 550 | 560 | 570 | 580 | 590 => machine.position.select_system((tenfold / 10 - 53) as u16),
        591..=593 => machine.position.select_system((tenfold - 584) as u16),
        280 => {
            machine.home(words.rest())?;
            return Ok(Effect::LineDone);
        }
        900 => machine.position.relative = false,
        910 => machine.position.relative = true,
        901 => machine.absolute_centres = true,
        911 => machine.absolute_centres = false,
        920 => return Ok(Effect::SetPosition),
        921 => machine.position.clear_offset(false),
        922 => machine.position.clear_offset(true),
        923 => machine.position.restore_offset(),
        _ => {
            if !NEUTRAL_G.contains(&tenfold) && !is_neutral_machine_code(tenfold) {
                machine.beads.report.unknown(word.text, machine.line);
            }
            // Their words have meanings of their own, unless other codes follow.
            let ends = first && !has_letter(words, b"G");
            return Ok(if ends { Effect::LineDone } else { Effect::Modal });
        }
    }
    Ok(Effect::Modal)
}

fn miscellaneous(
    machine: &mut Machine<'_, '_>,
    word: &Word<'_>,
    tenfold: u32,
    first: bool,
    words: &mut Words<'_>,
) -> Result<Effect> {
    match tenfold {
        // Spindles, where something else deposits.
        30 | 40 | 50 => return Ok(if first && !goes_on(words) { Effect::LineDone } else { Effect::Modal }),
        820 => machine.extruder.relative = Some(false),
        830 => machine.extruder.relative = Some(true),
        2000 => volumetric(machine, words)?,
        2210 => machine.set_flow(words),
        _ if tenfold.is_multiple_of(10)
            && NEUTRAL_M.iter().any(|(a, b)| (*a..=*b).contains(&(tenfold / 10))) =>
        {
            // What follows may be any text.
            let ends = first && !(matches!(tenfold, 60..=90) && has_letter(words, b"GM"));
            return Ok(if ends { Effect::LineDone } else { Effect::Modal });
        }
        // Codes of large machines: operators, servos, purging, relays, materials.
        100..=160 | 520..=690 | 1000..=1030 | 2220 | 2370 | 2700 => {
            return Ok(if first { Effect::LineDone } else { Effect::Modal });
        }
        _ => {
            machine.beads.report.unknown(word.text, machine.line);
            return Ok(if first { Effect::LineDone } else { Effect::Modal });
        }
    }
    Ok(if first { Effect::LineDone } else { Effect::Modal })
}

/// Whether a code that changes modes of machines changes nothing that matters here: exact stop, smoothing, feeds.
fn is_neutral_machine_code(tenfold: u32) -> bool {
    matches!(tenfold, 90 | 531 | 611 | 960 | 970 | 5000 | 6010 | 6020 | 6030 | 6400..=6490)
}

/// Whether one of these letters follows in the line.
fn has_letter(words: &Words<'_>, letters: &[u8]) -> bool {
    let mut rest = words.clone();
    std::iter::from_fn(|| rest.next()).map_while(|word| word.ok()).any(|word| letters.contains(&word.letter))
}

/// Whether the line goes on with a code or a coordinate.
fn goes_on(words: &Words<'_>) -> bool {
    has_letter(words, b"GMTXYZEABCUVW")
}

/// M200: with a diameter above 0, E counts mm³ from now on.
fn volumetric(machine: &mut Machine<'_, '_>, words: &mut Words<'_>) -> Result<()> {
    while let Some(word) = words.next() {
        let word = word.map_err(|malformed| machine.malformed(&malformed))?;
        if word.letter == b'D' {
            machine.extruder.volumetric = word.value.is_some_and(|value| value > 0.0);
        }
    }
    Ok(())
}

fn tool(machine: &mut Machine<'_, '_>, word: &Word<'_>, value: f64) -> Result<Effect> {
    if value.fract() == 0.0 && (0.0..65536.0).contains(&value) {
        machine.select_tool(value as u16);
    } else {
        machine.beads.report.unknown(token(word.text), machine.line);
    }
    Ok(Effect::Modal)
}
