//! Files of all samples of one level, x fastest and z slowest.

mod image;
mod layers;
mod npy;
mod tiff;
mod vti;

pub(super) use image::{Mha, Mhd, Npy, Raw};
pub use npy::npy_header;
pub(super) use tiff::Tiff;
pub(super) use vti::Vti;
