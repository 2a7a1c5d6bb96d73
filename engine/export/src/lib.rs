//! Volumes in the files of other tools: OpenVDB, VTKHDF, VTK images, MetaImage, TIFF, Zarr.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod export;

use brickfield_analysis::{analysis, distance};
use brickfield_core::{error, lattice, part, progress, schedule};
use brickfield_octree::store;
