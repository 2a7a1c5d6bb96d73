//! Compute shaders as SPIR-V, and what host and device agree on.
//!
//! A shader has the name of its twin among the engine's sources: `scan` finds the crossings of triangles with
//! lattice lines, `evaluate` the samples of bricks, `hermite` their Hermite edges, `brute` sums solid angles.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod layout;

pub use layout::*;

/// A module with its entry points.
#[derive(Clone, Copy, Debug)]
pub struct Shader {
    /// The stem of its source.
    pub name: &'static str,
    /// SPIR-V 1.3.
    pub words: &'static [u32],
}

include!(concat!(env!("OUT_DIR"), "/modules.rs"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_are_spir_v() {
        for shader in [SCAN, EVALUATE, HERMITE, BRUTE] {
            assert_eq!(shader.words[..2], [0x0723_0203, 0x0001_0300], "{}", shader.name);
        }
    }
}
