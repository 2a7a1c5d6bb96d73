//! Volumes in the files of other tools: OpenVDB, VTKHDF, VTK images, MetaImage, TIFF, Zarr; and from them.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod export;
pub mod import;

use brickfield_analysis::{analysis, distance};
use brickfield_core::{error, lattice, mmap, part, progress, schedule};
use brickfield_octree::{brick, store};
