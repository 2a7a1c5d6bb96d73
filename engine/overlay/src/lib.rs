//! What analyses find, as colours in pictures: voids, thickness, deviations.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod overlay;

use brickfield_analysis::{distance, voids};
use brickfield_core::{error, lattice, progress};
use brickfield_octree::{brick, store};
use brickfield_picture::{picture, render, section};
