//! Splats of a brick octree: a part as small clipped planes, level by level, in files and as pictures.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod draw;
pub mod ellipses;
pub mod splats;

use brickfield_coding::{bsp, draw as page_draw, picks, range};
use brickfield_core::{error, lattice, part, progress, schedule, wide};
use brickfield_gpu::gpu;
use brickfield_octree::{brick, store};
use brickfield_picture::{picture, render};
