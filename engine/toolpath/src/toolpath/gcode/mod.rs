//! G-code: a stream of commands becomes a stream of beads.
//!
//! Dialects differ. This reader takes the side of the slicers' firmwares (Marlin and its kin), and of RS-274
//! where they are silent:
//!
//! - Words need no spaces, letters have no case, numbers have no exponent (`X1e1` is X1 and E1)
//!   unless no E word can be meant (`Y1.2e-05`), and then they are told. The same letter
//!   twice in a command is an error. Lines that begin with coordinates repeat the last motion.
//! - Firmwares read G90, G91, M82 and M83, the turns of arcs and M200 each in their way: [`Firmware`] has the rules.
//!   The file's own word for its firmware counts, else E is relative while G91 holds, whatever M82 said, and after M83.
//!   There is one E position, not one a tool.
//! - What was retracted, standing or in a move, must be fed again before anything leaves the nozzle. A move that feeds
//!   it again deposits from where it is made up, by the rest. Each tool has its own retraction, unless the slicer says
//!   that all filaments share a nozzle. M600, M701 and M702 end it.
//! - G92 renames the present position, as do G10 L20, G52, and Klipper's SET_GCODE_OFFSET and states in their ways.
//!   Points are given in the machine's coordinates, with work offsets (G54 to G59.3) as the file sets them by G10 L2,
//!   or else zero. G28 goes to 0. G53 is travel to a place in the machine's coordinates, on its line alone.
//! - A move deposits if E grows on it beyond what was retracted. In files where no move has an E, codes switch deposition:
//!   M3, M4 and M5 with S, or those of [`GcodeOptions::deposit_on`] and of known machines; rapid moves (G0) never deposit.
//! - A table's axis (W) is taken off Z, another axis is added by [`GcodeOptions::layer_axis`].
//! - Comments in parentheses are read like those behind a semicolon: layers, regions, widths.
//! - A, B and C tilt the head, in degrees: the tool's axis is Rz(C)·Ry(B)·Rx(A)·z, or it is the vector `A3= B3= C3=`; X Y Z are the tool tip in
//!   the part's frame. Machines that turn the part instead (rotary tables) are out of scope: their programs must
//!   be converted to the part's frame first.
//! - Arcs lie in the plane of G17, G18 or G19, by I J K or R, also as helices.
//!
//! A bead ends where the tool travels, or where layer, tool or feature change. A change of width or height does
//! not end it.

// What only the reader needs is dead without it.
#![cfg_attr(not(feature = "gcode"), allow(dead_code))]

pub(crate) mod arc;
mod auxiliary;
mod deposition;
mod firmware;
mod layer_axis;
mod options;
#[cfg(feature = "gcode")]
mod reader;
mod report;
pub(crate) mod tilt;
pub(crate) mod words;

pub use auxiliary::is_auxiliary;
pub use deposition::DepositionCode;
pub use firmware::Firmware;
pub use layer_axis::LayerAxis;
pub use options::{ExtruderAxis, GcodeOptions};
#[cfg(feature = "gcode")]
pub use reader::{read_gcode, read_gcode_from};
pub use report::{
    ArcReport, BlobReport, FeatureReport, FilamentSource, FirmwareSource, GcodeFinding, GcodeReport,
    MachineReport, SettingsReport, SizeReport, SkipReport, UnitSource,
};

/// Steps that are shorter, in mm, are joined to the next one: a thousandth of what files can express.
pub const MERGE_MM: f64 = 1e-6;

/// Name of the feature of beads that no comment names.
pub const UNNAMED: &str = "unnamed";

/// mm in an inch.
const INCH: f64 = 25.4;

/// Largest width or height of a bead, in mm.
const SIZE_MAX: f64 = 1e4;

/// Largest number of a coordinate.
const POSITION_MAX: f64 = 1e6;

/// Refuses the file `path`: the library was built without the feature `gcode`.
///
/// # Errors
/// Always.
#[cfg(not(feature = "gcode"))]
pub fn read_gcode(
    path: &std::path::Path,
    _: &GcodeOptions,
    _: &dyn crate::progress::Progress,
    _: &mut super::BeadSink<'_>,
) -> crate::error::Result<GcodeReport> {
    let what = "is G-code, and this program was built without the feature `gcode`";
    Err(crate::error::Error::input(path, "file", what, "build it with that feature"))
}
