//! What the user types for machining.

use crate::args::IoArg;
use crate::csg_args::CommitArgs;
use crate::units::Length;
use crate::work::WorkArgs;
use brickfield_engine::milling::Tool;
use clap::Args;
use std::path::PathBuf;
use std::str::FromStr;

/// Take off a part what the tools of a milling program sweep, and tell what that does to its voids
#[derive(Args)]
#[command(after_help = "\
The program is G-code: G0 to G3 in the planes of G17 to G19, helices, work offsets, G43, G52, G92, rotations (G68), scales and \
mirrors (G51, G51.1), tilted planes (G68.2). Cycles drill, tap and bore: G73, G74, G76, G81 to G86, G88, G89.

Subprograms stand in the same file (M97, M98 and M99, or o100 sub). Macros have variables, [ ], IF, GOTO, WHILE and G65, or \
o100 while and o100 if.

Or it is a CL file of APT (.apt, .cls, .ncl): GOTO, GODLTA, FROM, RAPID, CIRCLE, CYCLE, CUTTER, TLDATA, LOADTL, UNITS.

Positions are the tip's, in the coordinates of the part.

G41 and G42 correct for a radius that --radius gives by its number D, or G10 or G41.1; 0mm if the path is the centre's already.

Words A, B and C turn the head, as in toolpaths, and axes in GOTO the tool; where these change on a move it is cut in steps. \
The summary tells how far these are off.

Tools are ball:D, flat:D, bull:D,CORNER, drill:D,ANGLE and chamfer:D,ANGLE,TIP, each with length=L if it does not leave the \
part. Without --tool comments name them, as in (T1 D=6. CR=3. - ball end mill).

On a straight move balls, cylinders and cones sweep solids with exact formulas. Arcs become chords, rounded corners of \
bull-nose mills cones; the summary tells how far these are off.

A rapid move that takes something off is told with its line and how deep. The volume of each tool is measured, that of \
each move (--json) is its share along rows of samples.

A void is untouched, opened, or consumed if all of it is cut away. The ligament is what is left between an untouched void and \
the cut. Columns: id, volume, state, ligament, move_first, x, y, z, line_first, in the store's unit.

Examples:
  brickfield machine part.brf program.nc --tool ball:6mm -o cut.brf
  brickfield machine part.brf program.nc --tool 1=flat:10mm --tool 2=drill:5mm -o cut.brf --voids opened.csv")]
pub struct MachineArgs {
    /// The store of the part
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The milling program
    #[arg(value_name = "PROGRAM.nc")]
    pub program: PathBuf,
    /// The store to write
    #[arg(long, short, value_name = "CUT.brf")]
    pub output: PathBuf,
    /// A tool; behind its number in the program and an equals sign, or of all numbers that have none
    #[arg(long, value_name = "[N=]FORM:D")]
    pub tool: Vec<NumberedTool>,
    /// A table of tools in TOML: under [tools] lines such as 3 = "bull:10mm,1mm"
    #[arg(long, value_name = "TOOLS.toml")]
    pub tools: Option<PathBuf>,
    /// A radius that G41 and G42 correct for: its number D in the program, an equals sign, and what the machine's table holds
    #[arg(long, value_name = "N=LEN")]
    pub radius: Vec<NumberedRadius>,
    /// Also write what becomes of each void; the name ends in .csv or .json
    #[arg(long, value_name = "OPENED.csv|.json")]
    pub voids: Option<PathBuf>,
    /// How far chords may be from arcs [default: 1/200 of a cell]
    #[arg(long, value_name = "LEN")]
    pub arc_tolerance: Option<Length>,
    /// Keep the counts of the part where it remains, in place of 1
    #[arg(long)]
    pub keep_counts: bool,
    #[command(flatten)]
    pub keeping: CommitArgs,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print the summary as JSON, with what each move takes off
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// A tool, of a number or of all.
#[derive(Clone, Copy, Debug)]
pub struct NumberedTool(pub Option<u32>, pub Tool);

impl FromStr for NumberedTool {
    type Err = String;

    fn from_str(text: &str) -> Result<NumberedTool, String> {
        let (number, form) = match text.split_once('=') {
            Some((number, form)) if !number.contains(':') => {
                let number = number.trim().trim_start_matches(['T', 't']);
                let number =
                    number.parse().map_err(|_| format!("{number}: expected the number of a tool"))?;
                (Some(number), form)
            }
            _ => (None, text),
        };
        Ok(NumberedTool(number, form.parse()?))
    }
}

/// A radius of the machine's table.
#[derive(Clone, Copy, Debug)]
pub struct NumberedRadius(pub u32, pub Length);

impl FromStr for NumberedRadius {
    type Err = String;

    fn from_str(text: &str) -> Result<NumberedRadius, String> {
        let (number, radius) = text
            .split_once('=')
            .ok_or_else(|| format!("{text}: expected a number and a radius, as in 3=5mm"))?;
        let number = number.trim().trim_start_matches(['D', 'd']);
        let number = number.parse().map_err(|_| format!("{number}: expected the number of a radius"))?;
        Ok(NumberedRadius(number, radius.trim().parse()?))
    }
}
