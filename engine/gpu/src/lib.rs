//! Vulkan devices: choice, memory, batches of work and their failures, ray casting, pictures in a window. Bricks are
//! buffers here; what they mean is known by the crates above.
#![warn(missing_docs)]

pub mod gpu;
