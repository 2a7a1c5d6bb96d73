//! Codes: G, M and T words.

use super::firmware::Firmware;
use super::machine::Machine;
use super::neutral;
use super::settings::m200_diameters;
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
        100 | 110 => {
            if tenfold == 100 && words.clone().next().is_some_and(|next| next.is_ok_and(|w| w.letter == b'L'))
            {
                machine.beads.report.note("offsets set by G10 are left out", machine.line);
            } else if tenfold == 100 {
                machine.retract_by_firmware();
            }
            return Ok(Effect::LineDone);
        }
        170 | 180 | 190 => machine.plane = (tenfold / 10 - 17) as usize,
        200 => machine.position.unit = 25.4,
        210 => machine.position.unit = 1.0,
        280 => {
            machine.home(words.rest())?;
            return Ok(Effect::LineDone);
        }
        530..=599 => machine.beads.report.note("work offsets (G53 to G59) are taken for zero", machine.line),
        900 | 910 => {
            machine.position.relative = tenfold == 910;
            machine.extruder.set_axes_relative(tenfold == 910);
        }
        901 => machine.absolute_centres = true,
        911 => machine.absolute_centres = false,
        920 => return Ok(Effect::SetPosition),
        921 => machine.position.clear_offset(),
        _ => {
            if !neutral::is_general(tenfold) {
                machine.beads.report.unknown(word.text, machine.line);
            }
            // Their words have meanings of their own.
            return Ok(if first { Effect::LineDone } else { Effect::Modal });
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
        // Machines of the first years have M101 and M103 beside E, or for it.
        30 | 40 | 1010 => machine.depositing = true,
        50 | 1030 => machine.depositing = false,
        820 => machine.extruder.set_relative(false),
        830 => machine.extruder.set_relative(true),
        // The firmware changes, loads or unloads the filament.
        6000 | 7010 | 7020 => {
            machine.extruder.is_loaded();
            return Ok(if first { Effect::LineDone } else { Effect::Modal });
        }
        2000 => volumetric(machine, words),
        2210 => machine.beads.report.note("a flow factor (M221) is left out", machine.line),
        _ if neutral::is_miscellaneous(tenfold) => {
            // What follows may be any text.
            return Ok(if first { Effect::LineDone } else { Effect::Modal });
        }
        _ => {
            machine.beads.report.unknown(word.text, machine.line);
            return Ok(if first { Effect::LineDone } else { Effect::Modal });
        }
    }
    let is_switch = matches!(tenfold, 30 | 40 | 50 | 1010 | 1030);
    Ok(if is_switch || !first { Effect::Modal } else { Effect::LineDone })
}

/// M200: with a diameter above 0 or S1, E counts mm³ from now on; with a diameter of 0 or S0 it counts lengths.
fn volumetric(machine: &mut Machine<'_, '_>, words: &mut Words<'_>) {
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

fn tool(machine: &mut Machine<'_, '_>, word: &Word<'_>, value: f64) -> Result<Effect> {
    if value.fract() == 0.0 && (0.0..65536.0).contains(&value) {
        machine.select_tool(value as u16);
    } else {
        machine.beads.report.unknown(token(word.text), machine.line);
    }
    Ok(Effect::Modal)
}
