//! Commands that change nothing that matters here: heat, fans, messages, levelling, speeds and acceleration, checks of
//! the printer, the host's business.

/// G codes, times ten: dwell, bed levelling, parking, feed modes.
const GENERAL: [(u32, u32); 21] = [
    (40, 40),
    (120, 120),
    (260, 279),
    (290, 329),
    (340, 349),
    (380, 409),
    (490, 490),
    (600, 600),
    (610, 610),
    (640, 640),
    (690, 690),
    (760, 769),
    (800, 819),
    (930, 930),
    (940, 940),
    (950, 950),
    (990, 990),
    (1300, 1319),
    (1500, 1519),
    (3800, 3939),
    (28_140, 28_149),
];

/// M codes that no firmware of printers gives a meaning for what is deposited.
const MISCELLANEOUS: [(u32, u32); 39] = [
    (0, 2),
    (6, 9),
    (17, 18),
    (20, 39),
    (42, 43),
    (73, 81),
    (84, 87),
    (92, 92),
    (104, 128),
    (130, 136),
    (140, 150),
    (155, 156),
    (163, 166),
    (190, 193),
    (201, 206),
    (207, 211),
    (217, 220),
    (226, 226),
    (240, 240),
    (250, 262),
    (280, 292),
    (300, 312),
    (320, 323),
    (350, 363),
    (380, 381),
    (400, 413),
    (420, 430),
    (450, 453),
    (486, 486),
    (500, 512),
    (540, 599),
    (601, 680),
    (700, 712),
    (851, 869),
    (900, 918),
    (928, 929),
    (950, 1199),
    (9700, 9999),
    (99_123, 99_123),
];

/// Commands of Klipper and of its users' macros, by how they begin. A macro may be called anything: these are the
/// names that slicers and their profiles write.
const EXTENDED: [&str; 45] = [
    "ACTIVATE_EXTRUDER",
    "BED_MESH_",
    "BED_MESH",
    "BED_TILT_CALIBRATE",
    "CANCEL_PRINT",
    "CLEAN_NOZZLE",
    "CLEAR_PAUSE",
    "DEFINE_OBJECT",
    "END_OBJECT",
    "END_PRINT",
    "EXCLUDE_OBJECT",
    "G29",
    "HEAT_SOAK",
    "LINE_PURGE",
    "M117",
    "NOZZLE_",
    "PAUSE",
    "PRIME_LINE",
    "PRINT_END",
    "PRINT_START",
    "PURGE_LINE",
    "QUAD_GANTRY_LEVEL",
    "RESPOND",
    "RESUME",
    "SCREWS_TILT_CALCULATE",
    "SDCARD_",
    "SET_",
    "SKEW_PROFILE",
    "SMART_PARK",
    "START_PRINT",
    "STATUS_",
    "SYNC",
    "TEMPERATURE_WAIT",
    "TIMELAPSE_",
    "TUNING_TOWER",
    "TURN_OFF_HEATERS",
    "UPDATE_DELAYED_GCODE",
    "VFLUSH",
    "VG1",
    "VM1",
    "VORON_PURGE",
    "Z_TILT_ADJUST",
    "_CLEAR_",
    "_PRINT_",
    "_SET_",
];

fn is_within(ranges: &[(u32, u32)], code: u32) -> bool {
    ranges.iter().any(|(first, last)| (*first..=*last).contains(&code))
}

/// Whether a G code changes nothing; `tenfold` is ten times its number.
pub(super) fn is_general(tenfold: u32) -> bool {
    is_within(&GENERAL, tenfold)
}

/// Whether an M code changes nothing, with whatever digit behind its point; `tenfold` is ten times its number.
pub(super) fn is_miscellaneous(tenfold: u32) -> bool {
    is_within(&MISCELLANEOUS, tenfold / 10)
}

/// Whether a command of several letters changes nothing.
pub(super) fn is_extended(name: &[u8]) -> bool {
    let begins = |known: &&str| {
        name.len() >= known.len() && name[..known.len()].eq_ignore_ascii_case(known.as_bytes())
    };
    // Prusa's MMU loads filament by Tx and Tc.
    EXTENDED.iter().any(begins) || matches!(name, [b'T', b'x' | b'c'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_slicers_begin_with_is_neutral() {
        // PrusaSlicer, Cura, Orca and Bambu: the start codes of their own profiles.
        for code in [
            17, 73, 84, 104, 105, 106, 107, 109, 115, 117, 140, 190, 201, 203, 204, 205, 355, 400, 412, 486,
            555, 566, 569, 572, 593, 604, 620, 621, 622, 623, 862, 900, 960, 970, 971, 973, 974, 975, 981,
            982, 983, 984, 991, 1002, 1003, 1006, 1007, 9833,
        ] {
            assert!(is_miscellaneous(10 * code), "M{code}");
        }
        // M862.3, M620.1, M9833.2.
        for tenfold in [8623, 6201, 98332] {
            assert!(is_miscellaneous(tenfold), "{tenfold}");
        }
        for tenfold in [40, 290, 291, 292, 394, 3800, 3920, 1503] {
            assert!(is_general(tenfold), "G{tenfold}");
        }
        for name in [
            "START_PRINT",
            "SET_PRESSURE_ADVANCE",
            "print_start",
            "EXCLUDE_OBJECT_START",
            "TIMELAPSE_TAKE_FRAME",
            "Tx",
        ] {
            assert!(is_extended(name.as_bytes()), "{name}");
        }
        assert!(!is_extended(b"FOO") && !is_miscellaneous(30) && !is_general(50));
    }
}
