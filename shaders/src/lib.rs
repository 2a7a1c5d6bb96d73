//! Compute shaders as SPIR-V, and what host and device agree on.
//!
//! A shader has the name of its twin among the engine's sources: `scan` finds the crossings of triangles with
//! lattice lines, `evaluate` the samples of bricks, `hermite` their Hermite edges, `brute` sums solid angles. Those of an
//! open soup's caps have a module of several files, named after their twins: `cells` sums over the tree of their clusters. So have those
//! that cast rays: `trace` follows them through tree and bricks, `frame` makes pixels of what they gather. `raster` draws splats.
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

/// Words of `N` times four bytes, the low byte first.
const fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
    assert!(bytes.len() == 4 * N);
    let mut words = [0; N];
    let mut n = 0;
    while n < N {
        words[n] = u32::from_le_bytes([bytes[4 * n], bytes[4 * n + 1], bytes[4 * n + 2], bytes[4 * n + 3]]);
        n += 1;
    }
    words
}

/// Modules of the folder `spirv`, which `tests/spirv.rs` writes and compares.
macro_rules! shaders {
    ($($constant:ident $name:literal;)*) => {
        $(
            #[doc = concat!("`", $name, ".wgsl`.")]
            pub const $constant: Shader = {
                const BYTES: &[u8] = include_bytes!(concat!("../spirv/", $name, ".spv"));
                static WORDS: [u32; BYTES.len() / 4] = words(BYTES);
                Shader { name: $name, words: &WORDS }
            };
        )*
    };
}

shaders! {
    SCAN "scan";
    EVALUATE "evaluate";
    HERMITE "hermite";
    BRUTE "brute";
    OPEN "open";
    RAYS "rays";
    RASTER "raster";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_are_spir_v() {
        for shader in [SCAN, EVALUATE, HERMITE, BRUTE, OPEN, RAYS, RASTER] {
            assert_eq!(shader.words[..2], [0x0723_0203, 0x0001_0300], "{}", shader.name);
        }
    }

    /// Numbers of the results of additions and the like, or of what is decorated with NoContraction, in order.
    fn numbers(shader: Shader, is_meant: fn(&[u32]) -> Option<u32>) -> std::collections::BTreeSet<u32> {
        let mut found = std::collections::BTreeSet::new();
        let mut left = &shader.words[5..];
        while let Some(first) = left.first() {
            let (instruction, rest) = left.split_at((first >> 16) as usize);
            found.extend(is_meant(instruction));
            left = rest;
        }
        found
    }

    #[test]
    fn arithmetic_with_proven_bounds_is_as_written() {
        let sums = |i: &[u32]| [129, 131, 133, 136].contains(&(i[0] & 0xffff)).then(|| i[2]);
        let decorated = |i: &[u32]| (i[0] & 0xffff == 71 && i[2] == 42).then(|| i[1]);
        let (all, exact) = (numbers(OPEN, sums), numbers(OPEN, decorated));
        assert!(all.len() > 100 && all.is_subset(&exact));
        assert!(numbers(BRUTE, decorated).is_empty());
    }
}
