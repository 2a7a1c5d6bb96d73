//! What the user types for the window.

use crate::args::IoArg;
use crate::finding_args::{FindingArgs, ShownArg};
use crate::picture_args::{DrawArgs, PixelsArg, ViewArg};
use crate::units::{Length, Size};
use crate::work::WorkArgs;
use clap::Args;
use std::path::PathBuf;

/// Look at the part in a window: turn it, cut it open, go through its layers
#[derive(Args)]
#[command(after_help = "\
A coarse picture follows every movement, and gets finer while nothing moves, until it has the very pixels of `render` with \
the same --backend. The window needs an X11 display, or Xwayland, and a Vulkan driver, GPU or software, whatever casts the \
rays; should a device fail, the processor goes on in its place.

With --style voids, thickness, deviation or changes the window opens when they are found. The processor shows them, as `render` \
does without legend; t changes to other styles and back.

Mouse: left drag turns, right or middle drag (or with shift) moves, the wheel zooms. The strip at the right edge is the \
height of the cutting plane: drag it to go through the layers.

  1 to 7        iso, top, bottom, front, back, left, right
  f             the whole part
  p             in perspective, or with parallel rays
  t             the next style
  x y z         cut across an axis, above the plane; again: below it
  up, down      move the plane by a layer; page up, page down by ten; home, end
  c             no cut
  n, b          next void of --voids, the one before, cut through the middle
  s             screenshot: PART-0001.png and so on in the working folder, without strip and letters; the next movement \
is seen when it is written
  h             list of keys
  q, escape     quit, when screenshots are written; twice, at once

A script is a command a line, of which each begins when the one before is done; # begins a comment. The window stays \
open behind the last one unless that is quit.

  orbit AZ EL            turn the eye by degrees, from the x axis towards y, and upward
  pan X Y                move the part by pixels to the right and upward
  zoom FACTOR            make it so many times as large
  view NAME|AZ,EL        the whole part from there
  perspective DEG|off    degrees between upper and lower border
  fit                    the whole part
  cut AXIS AT            cut across x, y or z, as in cut z 12mm; what lies above goes. cut z<12mm: what lies below
  cut off                no cut
  layer N                cut at the upper end of the N-th layer
  void N                 look at void N of --voids, and cut through its middle
  style NAME|FILE.toml   solid, boundary, overlap, a file's, or what --style found
  size WxH               pixels of the window
  key KEY                as if typed: a letter or digit, up, down, pageup, pagedown, home, end, escape
  drag BUTTON X Y X Y    as if dragged with the left, right or middle button
  wheel N                so many notches
  screenshot FILE.png    when the picture is as fine as it gets; prints the options of `render` that draw the same
  wait                   until the picture is as fine as it gets
  pause SECONDS
  quit

Examples:
  brickfield view part.brf
  brickfield view part.brf --style boundary --layer-height 0.2mm
  brickfield view part.brf --voids voids.csv
  brickfield view part.brf --style voids --closing 0.4mm
  brickfield view part.brf --style thickness --below 0.8mm
  brickfield view part.brf --backend vulkan --script tour.txt")]
#[cfg_attr(not(feature = "view"), allow(dead_code))]
pub struct WindowArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The style to begin with: solid, boundary, overlap, what a file says, or what is found, as in `render`: voids,
    /// thickness, deviation, changes
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "solid")]
    pub style: ShownArg,
    /// From where to begin: iso, top, bottom, front, back, left, right; or degrees from the x axis towards y, and above
    /// the xy plane, as in 30,20
    #[arg(long, value_name = "NAME|AZ,EL", default_value = "iso", allow_hyphen_values = true)]
    pub view: ViewArg,
    /// Distance of the layers through which the cutting plane goes; by default the cell of the finest level
    #[arg(long, value_name = "LEN")]
    pub layer_height: Option<Length>,
    /// Voids to look at one by one, from a table that `voids` wrote; with --style voids those that are found
    #[arg(long, value_name = "VOIDS.csv|.json")]
    pub voids: Option<PathBuf>,
    /// Width and height of the window in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    pub size: PixelsArg,
    /// Do what this file says, `-` for standard input
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
    /// Rays along each side of a pixel of the final picture, 1 to 8
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub supersample: u32,
    /// Memory to stay within, as in 256MiB, maps of files and the window's own 24 bytes a pixel not counted
    ///
    /// Used in any case: 100 MiB with two threads, 8 MiB more for each further one, 60 bytes a node of the store, and 2 KiB a
    /// pixel of the width.
    #[arg(long, value_name = "SIZE", default_value = "512MiB")]
    pub memory: Size,
    #[command(flatten)]
    pub draws: DrawArgs,
    #[command(flatten)]
    pub finding: FindingArgs,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print what screenshots show as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}
