//! Firmwares: which one a file is for, and where they read the same words differently.
//!
//! Each rule follows the firmware's own source:
//!
//! - G90, G91 and E: `gcode_move.py` of Klipper, `Marlin_main.cpp` of Marlin 1 and of Prusa's 8-bit boards,
//!   `gcode.h` of Marlin 2, `GCodes2.cpp` of RepRapFirmware, `Robot.cpp` of Smoothieware.
//! - P of arcs: `G2_G3.cpp` of Marlin (with `ARC_P_CIRCLES`), LinuxCNC's G2 and G3, `gcode_arcs.py` of Klipper.
//! - M200: `M200-M205.cpp` of Marlin.

use serde::Serialize;

/// A machine's firmware or controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Firmware {
    /// Not named: Klipper's rules for E, and RS-274's for the turns of arcs.
    #[default]
    Unnamed,
    /// Marlin 1, or any Marlin where the file does not tell its version.
    Marlin,
    /// Marlin 2.
    Marlin2,
    /// Klipper.
    Klipper,
    /// RepRapFirmware of Duet boards.
    RepRapFirmware,
    /// Prusa's firmware for 8-bit boards (MK2, MK3).
    Prusa,
    /// Repetier.
    Repetier,
    /// Smoothieware.
    Smoothie,
    /// Sprinter.
    Sprinter,
    /// Teacup.
    Teacup,
    /// Printers of Bambu Lab.
    Bambu,
    /// Ultimaker 2: the slicer calls its files UltiGCode.
    UltiGCode,
    /// Ultimaker 3 and S.
    Griffin,
    /// MakerBot and Sailfish.
    MakerBot,
    /// Mach3.
    Mach3,
    /// LinuxCNC and Machinekit.
    LinuxCnc,
    /// grbl, grblHAL, FluidNC.
    Grbl,
}

/// What decides whether E is relative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ExtruderRule {
    /// E is relative while G91 holds, and after M83.
    WhileRelative,
    /// G90, G91, M82, M83: the last one decides.
    LastCommand,
    /// M82 and M83 alone.
    Own,
}

/// What P of an arc means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TurnsRule {
    /// The arc ends in its P-th turn, as RS-274 has it.
    Total,
    /// P full turns stand before the arc.
    Additional,
    /// Nothing.
    Ignored,
}

/// Names by which a firmware goes, in small letters and digits alone; the first one is its name in messages.
const NAMES: [(Firmware, &str, &[&str]); 17] = [
    (Firmware::Unnamed, "marlin or klipper", &[]),
    (Firmware::Marlin, "marlin", &["marlin1", "marlinlegacy", "marlinvolumetric", "cheetah"]),
    (Firmware::Marlin2, "marlin2", &[]),
    (Firmware::Klipper, "klipper", &["kalico"]),
    (Firmware::RepRapFirmware, "reprapfirmware", &["reprap", "rrf", "duet"]),
    (Firmware::Prusa, "prusa", &["prusafirmware"]),
    (Firmware::Repetier, "repetier", &["repetierfirmware"]),
    (Firmware::Smoothie, "smoothie", &["smoothieware"]),
    (Firmware::Sprinter, "sprinter", &["reprapsprinter", "rapid"]),
    (Firmware::Teacup, "teacup", &[]),
    (Firmware::Bambu, "bambu", &["bambulab", "bbl"]),
    (Firmware::UltiGCode, "ultigcode", &["ultimaker2"]),
    (Firmware::Griffin, "griffin", &["ultimaker3", "ultimakers"]),
    (Firmware::MakerBot, "makerbot", &["sailfish", "makerware", "x3g", "bfb"]),
    (Firmware::Mach3, "mach3", &["mach4"]),
    (Firmware::LinuxCnc, "linuxcnc", &["machinekit", "emc2"]),
    (Firmware::Grbl, "grbl", &["grblhal", "fluidnc"]),
];

impl Firmware {
    /// A firmware by its name, in any case, with or without spaces and signs; `None` if it is not known.
    pub fn by_name(name: &str) -> Option<Firmware> {
        let plain: String =
            name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect();
        let found = NAMES[1..].iter().find(|(_, name, others)| *name == plain || others.contains(&&*plain));
        found.map(|(firmware, ..)| *firmware)
    }

    /// The name, in small letters.
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(firmware, ..)| *firmware == self).map_or("", |(_, name, _)| name)
    }

    /// The names that [`Firmware::by_name`] is meant to be asked for.
    pub fn names() -> Vec<&'static str> {
        NAMES[1..].iter().map(|(_, name, _)| *name).collect()
    }

    /// A firmware by what `M115` answers: its name, a version, and perhaps more.
    pub(super) fn by_answer(text: &str) -> Option<Firmware> {
        let text = text.trim().to_ascii_lowercase();
        let begins = |name: &str| text.starts_with(name);
        if begins("marlin") {
            let version = text["marlin".len()..].trim_start_matches([' ', '-', '_', 'v', ':', '"']);
            let is_2 = version.starts_with('2') || version.contains("bugfix-2");
            return Some(if is_2 { Firmware::Marlin2 } else { Firmware::Marlin });
        }
        if begins("prusa-firmware-buddy") {
            return Some(Firmware::Marlin2);
        }
        [
            ("klipper", Firmware::Klipper),
            ("kalico", Firmware::Klipper),
            ("reprapfirmware", Firmware::RepRapFirmware),
            ("duet", Firmware::RepRapFirmware),
            ("prusa", Firmware::Prusa),
            ("repetier", Firmware::Repetier),
            ("smoothie", Firmware::Smoothie),
            ("sprinter", Firmware::Sprinter),
            ("teacup", Firmware::Teacup),
            ("bambu", Firmware::Bambu),
            ("sailfish", Firmware::MakerBot),
            ("makerbot", Firmware::MakerBot),
            ("linuxcnc", Firmware::LinuxCnc),
            ("mach3", Firmware::Mach3),
            ("grbl", Firmware::Grbl),
            ("fluidnc", Firmware::Grbl),
        ]
        .into_iter()
        .find(|(name, _)| begins(name))
        .map(|(_, firmware)| firmware)
    }

    pub(super) fn extruder_rule(self) -> ExtruderRule {
        match self {
            Firmware::RepRapFirmware | Firmware::Prusa => ExtruderRule::Own,
            Firmware::Marlin2 | Firmware::Smoothie => ExtruderRule::LastCommand,
            _ => ExtruderRule::WhileRelative,
        }
    }

    pub(super) fn turns_rule(self) -> TurnsRule {
        match self {
            Firmware::Unnamed | Firmware::Bambu | Firmware::Mach3 | Firmware::LinuxCnc | Firmware::Grbl => {
                TurnsRule::Total
            }
            Firmware::Marlin | Firmware::Marlin2 => TurnsRule::Additional,
            _ => TurnsRule::Ignored,
        }
    }

    /// Whether M200 says that E counts volume.
    pub(super) fn knows_m200(self) -> bool {
        !matches!(self, Firmware::Klipper | Firmware::Mach3 | Firmware::LinuxCnc | Firmware::Grbl)
    }

    /// Whether M200 concerns the tool that it names, or else the present one; not all tools.
    pub(super) fn m200_is_by_tool(self) -> bool {
        matches!(self, Firmware::Repetier | Firmware::Smoothie)
    }

    /// Whether E counts volume from the start.
    pub(super) fn is_volumetric(self) -> bool {
        self == Firmware::UltiGCode
    }

    /// The filament's diameter where nothing tells it, in mm: what most printers with this firmware take.
    pub(super) fn usual_filament(self) -> f64 {
        match self {
            Firmware::UltiGCode | Firmware::Griffin => 2.85,
            _ => 1.75,
        }
    }
}

impl Serialize for Firmware {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_slicers_options_and_answers() {
        for (name, firmware) in [
            ("Marlin", Firmware::Marlin),
            ("Marlin(Volumetric)", Firmware::Marlin),
            ("marlin2", Firmware::Marlin2),
            ("RepRap", Firmware::RepRapFirmware),
            ("RepRapFirmware", Firmware::RepRapFirmware),
            ("UltiGCode", Firmware::UltiGCode),
            ("LinuxCNC", Firmware::LinuxCnc),
        ] {
            assert_eq!(Firmware::by_name(name), Some(firmware), "{name}");
        }
        assert_eq!(Firmware::by_name("marlin or klipper"), None);
        assert_eq!(Firmware::by_name(""), None);
        for name in Firmware::names() {
            assert_eq!(Firmware::by_name(name).map(Firmware::name), Some(name));
        }
        for (answer, firmware) in [
            ("Marlin 2.0.9.3 (Github)", Firmware::Marlin2),
            ("Marlin bugfix-2.1.x", Firmware::Marlin2),
            ("Marlin 1.1.9", Firmware::Marlin),
            ("RepRapFirmware for Duet 2 WiFi", Firmware::RepRapFirmware),
            ("Prusa-Firmware 3.13.2", Firmware::Prusa),
            ("Prusa-Firmware-Buddy 6.0", Firmware::Marlin2),
            ("Klipper", Firmware::Klipper),
        ] {
            assert_eq!(Firmware::by_answer(answer), Some(firmware), "{answer}");
        }
        assert_eq!(Firmware::by_answer("nothing known"), None);
    }
}
