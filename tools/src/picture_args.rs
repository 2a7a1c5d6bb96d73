//! What the user types for pictures.

use crate::args::IoArg;
use crate::devices::{BackendArg, BackendArgs};
use crate::finding_args::{Finding, FindingArgs, ShownArg};
use crate::toolpaths::ToolpathArgs;
use crate::units::{BoxArg, Length, Position, Size, Tolerance, Unit};
use crate::work::WorkArgs;
use brickfield_engine::lattice::Axis;
use brickfield_engine::render::{BuiltIn, Focus, Style, View};
use clap::{ArgGroup, Args, ValueEnum};
use serde::Deserialize;
use std::path::PathBuf;
use std::str::FromStr;

/// Draw a plane section: w as a picture, or the boundary as closed lines
#[derive(Args)]
#[command(group = ArgGroup::new("plane").required(true).args(["x", "y", "z", "layer", "all"]))]
#[command(after_help = "\
A picture (.png) shows w in colours, to the right and upward x and y, x and z, or y and z. Of closed input and of beads each \
pixel shows the nearest sample of the finest level on its side of the boundary, with a colour for each whole number. Of open \
input and point clouds w is interpolated.

A pixel is a cell of the finest level or, where the longer side would have fewer than \
1,000 of them, a whole part of one. Larger pixels (--pixel, --side) average up to 4 × 4 samples.

A drawing (.svg, .dxf) holds the boundary w = 0.5 as closed polylines in the part's coordinates, the inside to their \
left. Corners lie where the boundary crosses the finest lattice, and where it bends in between: exact where the plane \
holds samples, between two layers of samples from the crossings around and their normals. Straight runs are merged \
(--merge-tolerance).

With --style a picture shows what analyses find: voids filled, with the numbers that `voids` prints, or thickness or deviation in \
a band of 5 pixels along the surface, at its nearest point. The part is grey then.

Numbers that would cover each other are left \
out, the smaller void's first; those of voids that are too small for them stand beside.

The area of every section is printed with what it may be off by: the areas between the chords and the tangents of the \
boundary at its crossings with the lattice. What hides between samples, as a tip thinner than a cell, is not in it.

Examples:
  brickfield slice part.brf --z 12.3mm -o section.png
  brickfield slice part.brf --z 12.3mm -o section.dxf
  brickfield slice part.brf --z 12.3mm -o voids.png --style voids
  brickfield slice print.brf --layer 17 -o section.svg
  brickfield slice part.brf --all z --pitch 0.2mm -o layers --format svg")]
pub struct SliceArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The plane across x at this coordinate, as in 12.3mm; a bare number is in the store's unit
    #[arg(long, value_name = "AT", allow_hyphen_values = true)]
    pub x: Option<Position>,
    /// The plane across y at this coordinate
    #[arg(long, value_name = "AT", allow_hyphen_values = true)]
    pub y: Option<Position>,
    /// The plane across z at this coordinate
    #[arg(long, value_name = "AT", allow_hyphen_values = true)]
    pub z: Option<Position>,
    /// The middle of a layer of the toolpath that the store was built from, numbered from 1: half way between the lowest and
    /// the highest side of its beads. The toolpath is read again, from where it was
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub layer: Option<u32>,
    /// Where the toolpath is now, for --layer
    #[arg(long = "toolpath", value_name = "FILE", requires = "layer")]
    pub toolpath_file: Option<PathBuf>,
    /// Sections all along an axis, as 0001.png and so on in the folder given by -o
    ///
    /// The first is half a pitch from the part's lower end, or in the middle of a part that is thinner than the pitch.
    #[arg(long, value_name = "AXIS", value_enum, requires = "pitch")]
    pub all: Option<AxisArg>,
    /// Distance of the sections of --all
    #[arg(long, value_name = "LEN", requires = "all")]
    pub pitch: Option<Length>,
    /// Kind of the files of --all [default: png]
    #[arg(long, value_enum, requires = "all")]
    pub format: Option<SliceFormat>,
    /// The file to write; its ending decides the kind: .png, .svg or .dxf. With --all a folder
    #[arg(long, short, value_name = "OUT")]
    pub output: PathBuf,
    /// Size of a pixel; by default the cell of the finest level, or a whole part of it
    #[arg(long, value_name = "LEN", conflicts_with_all = ["side", "samples"])]
    pub pixel: Option<Length>,
    /// Pixels along the longer side of the picture instead, legend not counted
    #[arg(long, alias = "size", value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(16..=32_768))]
    pub side: Option<u32>,
    /// Let every pixel be one sample of the finest level, however few there are
    #[arg(long, conflicts_with = "side")]
    pub samples: bool,
    /// How far a drawing may be from the section for the sake of fewer points, as in 0.01mm; 0 keeps them all, and by default
    /// it is a hundredth of a cell
    #[arg(long, value_name = "LEN")]
    pub merge_tolerance: Option<Tolerance>,
    /// Leave out title, legend and scale bar: the samples alone
    #[arg(long)]
    pub no_legend: bool,
    /// Write the numbers of the voids that the section meets, from a table that `voids` wrote; where they would cover each other
    /// the larger void's
    #[arg(long, value_name = "VOIDS.csv|.json")]
    pub voids: Option<PathBuf>,
    /// Show what is found in the place of w: voids filled, with their numbers; thickness or deviation in a band along the
    /// surface
    #[arg(long, value_enum, conflicts_with_all = ["voids", "level"])]
    pub style: Option<Finding>,
    #[command(flatten)]
    pub finding: FindingArgs,
    /// Deepest level to use
    #[arg(long, value_name = "L")]
    pub level: Option<u8>,
    /// Memory to stay within, as in 256MiB, maps of files not counted
    ///
    /// 100 MiB with two threads, 8 MiB more for each further one, and 60 bytes a node of the store are used in any case.
    #[arg(long, value_name = "SIZE", default_value = "512MiB")]
    pub memory: Size,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print what was written as JSON, an object a section
    #[arg(long)]
    pub json: bool,
    /// The unit of a toolpath whose program does not tell it, as in `build`, for --layer
    #[arg(long, alias = "units", value_enum, requires = "layer")]
    pub unit: Option<Unit>,
    #[command(flatten)]
    pub toolpath: ToolpathArgs,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// An axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AxisArg {
    /// Planes across x
    X,
    /// Planes across y
    Y,
    /// Planes across z
    Z,
}

impl From<AxisArg> for Axis {
    fn from(axis: AxisArg) -> Axis {
        match axis {
            AxisArg::X => Axis::X,
            AxisArg::Y => Axis::Y,
            AxisArg::Z => Axis::Z,
        }
    }
}

/// Kinds of sections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SliceFormat {
    /// w in colours
    #[default]
    Png,
    /// The boundary, for browsers and drawing programs
    Svg,
    /// The boundary, for CAD and CAM
    Dxf,
}

impl SliceFormat {
    /// As a file's ending.
    pub fn ending(self) -> &'static str {
        match self {
            SliceFormat::Png => "png",
            SliceFormat::Svg => "svg",
            SliceFormat::Dxf => "dxf",
        }
    }

    /// That of a file's ending.
    pub fn of_ending(ending: &str) -> Option<SliceFormat> {
        let all = [SliceFormat::Png, SliceFormat::Svg, SliceFormat::Dxf];
        all.into_iter().find(|format| format.ending().eq_ignore_ascii_case(ending))
    }
}

/// Draw the part in space, by casting rays through the store
#[derive(Args)]
#[command(after_help = "\
Rays go past what the index says is empty and read only the bricks that they meet, so a store may be larger than the memory. \
The picture has the same bytes for any number of threads and any memory.

With --backend vulkan rays are cast on a device, to which bricks are brought as rays come to them. Its pictures do not depend \
on its memory either. Splats are drawn there, too, but with --backend auto by the processor, which takes less time than to open a \
device.

Levels of detail: where the cells of a coarser level are smaller than --lod pixels they stand for what is below. They are samples of the same field, so what is thinner than --lod pixels may be missing or show holes.

No node stands for others where the index says that a wall, a gap or an overlap below passes between all of its samples. \
--lod 0 draws the finest cells everywhere.

What analyses find is shown by the processor: voids, each in a colour within a haze, with the numbers and classes of `voids`; thickness and deviation, measured at \
each point that is seen as `thickness` and `deviation` do it. \
Where a cut opens the part it is grey then.

Voids with less --memory may have no class, as in the table. Voids that open through a throat are not shown.

Styles: solid shows the boundary w = 0.5, and where a cut opens the part, how many pieces cover each point. boundary shows w \
between 0 and 1 in rainbow colours, so that closed voids are seen within. overlap shows where w is 2 or more within a faint \
boundary.

A file that ends in .toml makes another, of surfaces where w passes a number above 0 (up to \
4) and of haze where it lies between two. Of a surface w and colour must be given, of a volume opacity and colour:

  background = \"white\"         # --background goes first
  [[surface]]
  w = 0.5
  colour = \"#78879b\"           # or \"counted\": by the largest w beside it, as in sections
  opacity = 0.03               # 1 by default: opaque, and shows w where a cut opens it
  rim = 0.3                    # more opaque by this where it is seen from its edge
  shaded = false               # no light on it
  [volume]
  opacity = [[0.02, 0.35], [1.0, 0.35]]   # [w, opacity], rising; not seen at the ends and beyond
  colour = [[0.0, \"#283cdc\"], [1.0, \"#d71e23\"]]
  stretch = \"0.5mm\"            # the length that has this opacity; a cell by default
  shaded = true                # darker where w rises across the line of sight
  [light]
  from = [-0.55, 0.65, 0.55]   # to the right, upward, towards the eye
  ambient = 0.3                # light from everywhere,
  strength = 0.62              # of the lamp,
  fill = 0.22                  # of a weaker one on the right
  gloss = 0.133

Examples:
  brickfield render part.brf -o view.png
  brickfield render part.brf -o inside.png --cut 'z>12mm' --cut 'y<0' --perspective
  brickfield render part.brf -o voids.png --style voids --classes pocket,flaw --size 1920x1080
  brickfield render part.brf -o thin.png --style thickness --below 0.8mm
  brickfield render part.brf -o off.png --style deviation --reference cad.stl --align shift --within 0.1mm
  brickfield render part.brf -o turn.apng --turntable 36 --style mine.toml
  brickfield render part.brf -o view.png --backend vulkan --gpu-memory 1GiB
  brickfield render part.bsp -o view.png --splats")]
pub struct RenderArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The picture to write; its name ends in .png. With --turntable an animation whose name ends in .apng, or a
    /// folder, whose name has no other format's ending
    #[arg(long, short, value_name = "OUT")]
    pub output: PathBuf,
    /// First write a coarse picture here, a .png of the same size: one ray a pixel, cells of up to 4 pixels
    #[arg(long, value_name = "COARSE.png", conflicts_with = "turntable")]
    pub preview: Option<PathBuf>,
    /// N pictures from all around, at one size, --view the first: an animation of 6 seconds, or 0001.png and so on in a
    /// folder
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=9999))]
    pub turntable: Option<u32>,
    /// Draw splats, as of a file that `splats` wrote, or of the store itself. --lod and --level choose their size
    #[arg(long, conflicts_with_all = ["preview", "turntable", "style"])]
    pub splats: bool,
    /// What is shown: solid, boundary, overlap, what a file says, or what is found: voids, thickness, deviation,
    /// changes
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "solid")]
    pub style: ShownArg,
    /// From where: iso, top, bottom, front, back, left, right; or degrees from the x axis towards y, and above the xy
    /// plane, as in 30,20
    #[arg(long, value_name = "NAME|AZ,EL", default_value = "iso", allow_hyphen_values = true)]
    pub view: ViewArg,
    /// What the middle of the picture shows, and how much of the world its height shows there, in the store's unit: `view`
    /// prints it. By default the box around all that is left of the part, as large as fits
    #[arg(long, value_name = "X,Y,Z,HEIGHT", allow_hyphen_values = true)]
    pub focus: Option<FocusArg>,
    /// See it in perspective, with so many degrees between upper and lower border; parallel by default
    #[arg(long, value_name = "DEGREES", num_args = 0..=1, default_missing_value = "30")]
    pub perspective: Option<f64>,
    /// Cut away what lies on one side of a plane, as in z>12mm or x<0; may be given several times
    #[arg(long, value_name = "AXIS<|>AT")]
    pub cut: Vec<CutArg>,
    /// Show the inside of a box only, as x0,y0,z0,x1,y1,z1 in the store's unit
    #[arg(long = "box", value_name = "BOX", allow_hyphen_values = true)]
    pub within: Option<BoxArg>,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    pub size: PixelsArg,
    /// Rays along each side of a pixel, 1 to 8: more for smoother edges
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub supersample: u32,
    /// What lies behind: white, black, transparent, or a colour as #rrggbb [default: the style's, or white]
    #[arg(long, value_name = "COLOUR")]
    pub background: Option<ColourArg>,
    /// Size in pixels up to which the cells of a coarser level stand for those below; 0 for the finest everywhere
    #[arg(long, value_name = "PIXELS", default_value_t = 0.5)]
    pub lod: f64,
    /// Deepest level to use; coarser is faster
    #[arg(long, value_name = "L")]
    pub level: Option<u8>,
    /// Memory to stay within, as in 256MiB, maps of files not counted
    ///
    /// Used in any case: 100 MiB with two threads, 8 MiB more for each further one, 60 bytes a node of the store, 2 KiB a pixel of
    /// the width, and all pixels of one picture of an animation.
    #[arg(long, value_name = "SIZE", default_value = "512MiB")]
    pub memory: Size,
    #[command(flatten)]
    pub draws: DrawArgs,
    #[command(flatten)]
    pub finding: FindingArgs,
    /// Write the numbers of voids into pictures of --style voids, where they are seen; where they would cover each other the
    /// larger void's
    #[arg(long, conflicts_with = "splats")]
    pub numbers: bool,
    /// Leave out the legend that stands below pictures of what is found
    #[arg(long)]
    pub no_legend: bool,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print what was drawn as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// What draws.
#[derive(Args, Clone, Debug)]
pub struct DrawArgs {
    /// What draws. A device's pictures are the processor's up to rounding: at least 999 of 1000 pixels are within 2
    /// of 255
    #[arg(long, value_enum, default_value_t)]
    pub backend: BackendArg,
    /// The Vulkan device, by its number or a part of its name; `info --devices` lists them
    #[arg(long, value_name = "NAME|INDEX")]
    pub device: Option<String>,
    /// Most memory to take of the device for bricks and rays, as in 2GiB, taken off --memory; a quarter of that by default
    #[arg(long, value_name = "SIZE")]
    pub gpu_memory: Option<Size>,
}

impl DrawArgs {
    /// As builds have them.
    pub fn backend(&self) -> BackendArgs {
        let DrawArgs { backend, device, gpu_memory } = self.clone();
        BackendArgs { backend, device, gpu_memory }
    }
}

/// What is shown.
#[derive(Clone, Debug)]
pub enum StyleArg {
    /// A style that is built in
    Named(BuiltIn),
    /// One that a file describes
    File(PathBuf),
}

impl FromStr for StyleArg {
    type Err = String;

    fn from_str(text: &str) -> Result<StyleArg, String> {
        if let Some((_, style)) = Style::NAMED.into_iter().find(|(name, _)| *name == text) {
            return Ok(StyleArg::Named(style));
        }
        let path = PathBuf::from(text);
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
            return Ok(StyleArg::File(path));
        }
        let names = Style::NAMED.map(|(name, _)| name).join(", ");
        Err(format!("there is no such style; choose {names}, or a file that ends in .toml"))
    }
}

/// A view with parallel rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewArg(pub View);

impl FromStr for ViewArg {
    type Err = String;

    fn from_str(text: &str) -> Result<ViewArg, String> {
        if let Some(view) = View::named(text) {
            return Ok(ViewArg(view));
        }
        let angle = |text: &str| text.trim().parse::<f64>().ok().filter(|angle| angle.is_finite());
        let angles = text.split_once(',').and_then(|(az, el)| Some([angle(az)?, angle(el)?]));
        match angles {
            Some([azimuth, elevation]) if (-90.0..=90.0).contains(&elevation) => {
                Ok(ViewArg(View { azimuth, elevation, opening: 0.0 }))
            }
            Some(_) => Err("the second angle is the elevation, from -90 to 90 degrees".to_owned()),
            None => {
                let names = View::NAMED.map(|(name, _)| name).join(", ");
                Err(format!("there is no such view; choose {names}, or two angles as in 30,20"))
            }
        }
    }
}

/// What of the world is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocusArg(pub Focus);

impl FromStr for FocusArg {
    type Err = String;

    fn from_str(text: &str) -> Result<FocusArg, String> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
        match numbers.as_deref() {
            Some(&[x, y, z, height]) if height > 0.0 => Ok(FocusArg(Focus { centre: [x, y, z], height })),
            _ => Err("expected a point and a height above 0, as in 10,20,5,40".to_owned()),
        }
    }
}

/// A plane, and the side of it that goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutArg {
    pub axis: AxisArg,
    pub above: bool,
    pub at: Position,
}

impl FromStr for CutArg {
    type Err = String;

    fn from_str(text: &str) -> Result<CutArg, String> {
        let example = || "expected an axis, < or >, and a coordinate, as in z>12mm".to_owned();
        let sign = text.find(['<', '>']).ok_or_else(example)?;
        let axis = match text[..sign].trim() {
            "x" | "X" => AxisArg::X,
            "y" | "Y" => AxisArg::Y,
            "z" | "Z" => AxisArg::Z,
            _ => return Err(example()),
        };
        let at = text[sign + 1..].trim().parse()?;
        Ok(CutArg { axis, above: text[sign..].starts_with('>'), at })
    }
}

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelsArg(pub [u32; 2]);

impl FromStr for PixelsArg {
    type Err = String;

    fn from_str(text: &str) -> Result<PixelsArg, String> {
        let side = |text: &str| text.trim().parse().ok().filter(|side| (1..=32_768).contains(side));
        let sides = text.split_once(['x', 'X', '×']).and_then(|(w, h)| Some([side(w)?, side(h)?]));
        sides.map(PixelsArg).ok_or_else(|| "expected two numbers from 1 to 32768, as in 1280x720".to_owned())
    }
}

/// A colour and its opacity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct ColourArg(pub [u8; 4]);

impl TryFrom<String> for ColourArg {
    type Error = String;

    fn try_from(text: String) -> Result<ColourArg, String> {
        text.parse()
    }
}

impl FromStr for ColourArg {
    type Err = String;

    fn from_str(text: &str) -> Result<ColourArg, String> {
        let hex = || {
            let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6)?;
            let [_, r, g, b] = u32::from_str_radix(digits, 16).ok()?.to_be_bytes();
            Some(ColourArg([r, g, b, 255]))
        };
        match text {
            "white" => Ok(ColourArg([255; 4])),
            "black" => Ok(ColourArg([0, 0, 0, 255])),
            "transparent" => Ok(ColourArg([0; 4])),
            _ => hex().ok_or_else(|| "expected white, black, transparent, or a colour as #20304a".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_cuts_sizes_and_colours_are_read() {
        assert_eq!("top".parse(), Ok(ViewArg(View::named("top").unwrap())));
        let tilted = View { azimuth: -30.0, elevation: 20.5, opening: 0.0 };
        assert_eq!("-30, 20.5".parse(), Ok(ViewArg(tilted)));
        let cut: CutArg = "z > -12mm".parse().unwrap();
        assert_eq!((cut.axis, cut.above, cut.at.in_unit_of("mm")), (AxisArg::Z, true, Some(-12.0)));
        assert!(!"x<1in".parse::<CutArg>().unwrap().above);
        assert_eq!("1280x720".parse(), Ok(PixelsArg([1280, 720])));
        assert_eq!("#20304a".parse(), Ok(ColourArg([0x20, 0x30, 0x4a, 255])));
        for bad in ["", "inside", "1", "1,91", "1,nan", "1,2,3"] {
            assert!(bad.parse::<ViewArg>().is_err(), "{bad}");
        }
        let focus = Focus { centre: [1.0, -2.0, 3.5], height: 10.0 };
        assert_eq!("1,-2, 3.5,10".parse(), Ok(FocusArg(focus)));
        for bad in ["", "1,2,3", "1,2,3,0", "1,2,3,4,5", "1,2,nan,4"] {
            assert!(bad.parse::<FocusArg>().is_err(), "{bad}");
        }
        for bad in ["", "z", "z=1", "w>1", "z>", "z>1parsec", "z>nan", ">1"] {
            assert!(bad.parse::<CutArg>().is_err(), "{bad}");
        }
        for bad in ["", "1280", "0x10", "10x", "-1x5", "99999x1"] {
            assert!(bad.parse::<PixelsArg>().is_err(), "{bad}");
        }
        for bad in ["", "red", "#12345", "#12345g", "#é2345"] {
            assert!(bad.parse::<ColourArg>().is_err(), "{bad}");
        }
    }
}
