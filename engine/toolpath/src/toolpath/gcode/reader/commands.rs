//! Codes: G, M and T words.

use super::INCH;
use super::firmware::Firmware;
use super::machine::MachineState;
use super::neutral;
use super::offsets::OffsetCode;
use super::settings::m200_diameters;
use super::words::{MalformedWord, Word, Words, token};
use crate::error::Result;

/// What is to be done after a code.
pub(super) enum CodeEffect {
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

/// Carries out a G, M or T word; `first` if no other code stands before it.
pub(super) fn code(
    machine: &mut MachineState<'_, '_>,
    word: &Word<'_>,
    value: f64,
    first: bool,
    words: &mut Words<'_>,
) -> Result<CodeEffect> {
    let tenfold = (value * 10.0).round();
    let is_code = (0.0..100_000.0).contains(&tenfold) && (tenfold / 10.0 - value).abs() < 1e-9;
    if is_code && !machine.by_extruder && machine.switch.code(word, value, words) {
        return Ok(if first && !goes_on(words) { CodeEffect::LineDone } else { CodeEffect::Modal });
    }
    match word.letter {
        b'T' => tool(machine, word, value),
        _ if !is_code => {
            machine.beads.report.unknown(word.text, machine.line);
            Ok(if first { CodeEffect::LineDone } else { CodeEffect::Modal })
        }
        b'G' => general(machine, word, tenfold as u32, first, words),
        _ => miscellaneous(machine, word, tenfold as u32, first, words),
    }
}

fn general(
    machine: &mut MachineState<'_, '_>,
    word: &Word<'_>,
    tenfold: u32,
    first: bool,
    words: &mut Words<'_>,
) -> Result<CodeEffect> {
    match tenfold {
        0 | 10 | 20 | 30 => {
            machine.motion = Some((tenfold / 10) as u8);
            return Ok(CodeEffect::Motion);
        }
        50 | 51 => {
            let what = "is a spline, which is not read: export straight moves or arcs";
            return Err(machine.malformed(&MalformedWord { text: word.text, what }));
        }
        100 => return Ok(CodeEffect::SetOffsets(OffsetCode::G10)),
        110 => return Ok(CodeEffect::LineDone),
        170 | 180 | 190 => machine.plane = (tenfold / 10 - 17) as usize,
        200 | 7000 => machine.set_unit(INCH),
        210 | 7100 => machine.set_unit(1.0),
        // On lathes they are cycles, with words P and Q.
        700 | 710 if !has_letter(words, b"PQ") => machine.set_unit(if tenfold == 700 { INCH } else { 1.0 }),
        430..=440 => machine.use_tool_length(),
        520 => return Ok(CodeEffect::SetOffsets(OffsetCode::G52)),
        530 | 1530 => machine.in_machine = true,
        541 => return Ok(CodeEffect::SetOffsets(OffsetCode::G54Extended)),
        540 | 550 | 560 | 570 | 580 | 590 => machine.position.select_system((tenfold / 10 - 53) as u16),
        591..=593 => machine.position.select_system((tenfold - 584) as u16),
        280 => {
            machine.home(words.rest())?;
            return Ok(CodeEffect::LineDone);
        }
        900 | 910 => {
            machine.position.relative = tenfold == 910;
            machine.extruder.set_axes_relative(tenfold == 910);
        }
        901 => machine.absolute_centres = true,
        911 => machine.absolute_centres = false,
        920 => return Ok(CodeEffect::SetPosition),
        921 => machine.position.clear_offset(false),
        922 => machine.position.clear_offset(true),
        923 => machine.position.restore_offset(),
        _ => {
            if !neutral::is_general(tenfold) && !is_neutral_machine_code(tenfold) {
                machine.beads.report.unknown(word.text, machine.line);
            }
            // Their words have meanings of their own, unless other codes follow.
            let ends = first && !has_letter(words, b"G");
            return Ok(if ends { CodeEffect::LineDone } else { CodeEffect::Modal });
        }
    }
    Ok(CodeEffect::Modal)
}

fn miscellaneous(
    machine: &mut MachineState<'_, '_>,
    word: &Word<'_>,
    tenfold: u32,
    first: bool,
    words: &mut Words<'_>,
) -> Result<CodeEffect> {
    match tenfold {
        // Spindles, where something else deposits.
        30 | 40 | 50 => {
            return Ok(if first && !goes_on(words) { CodeEffect::LineDone } else { CodeEffect::Modal });
        }
        820 => machine.extruder.set_relative(false),
        830 => machine.extruder.set_relative(true),
        // The firmware changes, loads or unloads the filament.
        6000 | 7010 | 7020 => {
            machine.extruder.is_loaded();
            return Ok(if first { CodeEffect::LineDone } else { CodeEffect::Modal });
        }
        2000 => volumetric(machine, words),
        2210 => machine.set_flow(words),
        _ if neutral::is_miscellaneous(tenfold) => {
            // What follows may be any text.
            let ends = first && !(matches!(tenfold, 60..=90) && has_letter(words, b"GM"));
            return Ok(if ends { CodeEffect::LineDone } else { CodeEffect::Modal });
        }
        // Codes of large machines: operators, servos, purging, relays, materials.
        100..=160 | 520..=690 | 1000..=1030 | 2220 | 2370 | 2700 => {
            return Ok(if first { CodeEffect::LineDone } else { CodeEffect::Modal });
        }
        _ => {
            machine.beads.report.unknown(word.text, machine.line);
            return Ok(if first { CodeEffect::LineDone } else { CodeEffect::Modal });
        }
    }
    Ok(if first { CodeEffect::LineDone } else { CodeEffect::Modal })
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

/// M200: with a diameter above 0 or S1, E counts mm³ from now on; with a diameter of 0 or S0 it counts lengths.
fn volumetric(machine: &mut MachineState<'_, '_>, words: &mut Words<'_>) {
    let firmware = machine.extruder.firmware;
    if !firmware.knows_m200() {
        let note = format!("M200 (E counts volume) is left out: {} does not know it", firmware.name());
        return machine.beads.report.note(&note, machine.line);
    }
    let rest = words.rest();
    let (tool, diameters) = m200_diameters(rest);
    let code = &rest[..rest.iter().position(|b| matches!(b, b';' | b'(')).unwrap_or(rest.len())];
    let switch = code.iter().position(|b| b.eq_ignore_ascii_case(&b'S')).map(|at| code[at + 1..].first());
    let switch = switch.map(|digit| digit != Some(&b'0'));
    let has_diameter = diameters.first().map(|diameter| *diameter > 0.0);
    let Some(asked) = switch.or(has_diameter) else { return };
    let on = asked && has_diameter != Some(false);
    let tool = tool.and_then(|tool| u16::try_from(tool).ok()).unwrap_or(machine.extruder.tool);
    machine.extruder.set_volumetric(on, firmware.m200_is_by_tool().then_some(tool));
    if firmware == Firmware::RepRapFirmware && diameters.len() > 1 {
        for (tool, diameter) in diameters.iter().enumerate() {
            let on = switch != Some(false) && *diameter > 0.0;
            machine.extruder.set_volumetric(on, u16::try_from(tool).ok());
        }
    }
}

fn tool(machine: &mut MachineState<'_, '_>, word: &Word<'_>, value: f64) -> Result<CodeEffect> {
    if value.fract() == 0.0 && (0.0..65536.0).contains(&value) {
        machine.select_tool(value as u16);
    } else {
        machine.beads.report.unknown(token(word.text), machine.line);
    }
    Ok(CodeEffect::Modal)
}
