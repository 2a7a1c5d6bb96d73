//! What reads files is fed with any bytes: it must end, within bounded memory, in a result or a one-line error.
//!
//! The fuzzers (`fuzz/` at the top of the repository) and the test beside this call the same functions.

mod toolpaths;

#[cfg(test)]
mod tests;

/// Feeds a reader; panics if what comes of it is neither.
pub type Target = fn(&[u8]);

/// All readers. The small files to begin with are in `fuzz/seeds/NAME`.
pub const TARGETS: [(&str, Target); 19] = [
    ("stl", crate::ingest::fuzz::stl),
    ("obj", crate::ingest::fuzz::obj),
    ("ply", crate::ingest::fuzz::ply),
    ("xyz", crate::ingest::fuzz::xyz),
    ("las", crate::ingest::fuzz::las),
    ("e57", crate::ingest::fuzz::e57),
    ("three_mf", crate::ingest::fuzz::three_mf),
    ("off", crate::ingest::fuzz::off),
    ("amf", crate::ingest::fuzz::amf),
    ("glb", crate::ingest::fuzz::glb),
    ("gcode", toolpaths::gcode),
    ("bgcode", toolpaths::gcode),
    ("x3d", toolpaths::x3d),
    ("store", crate::store::fuzz::store),
    ("journal", crate::store::fuzz::journal),
    ("brick", crate::store::fuzz::brick),
    ("bsp", crate::splats::fuzz::bsp),
    ("picks", crate::splats::fuzz::picks),
    ("volume", crate::import::fuzz::volume),
];

/// The reader of that name.
pub fn target(name: &str) -> Option<Target> {
    TARGETS.iter().find(|(known, _)| *known == name).map(|(_, target)| *target)
}
