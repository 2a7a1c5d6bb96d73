//! Features that are printed beside the part and thrown away, by the names of all slicers that are understood.

/// Names, in lower case and with single spaces for all that is neither letter nor digit: PrusaSlicer, SuperSlicer and
/// Slic3r ("Skirt/Brim", "Wipe tower"), OrcaSlicer and Bambu Studio ("Skirt", "Brim", "Inner brim", "Prime tower"), Cura
/// ("SKIRT", "PRIME-TOWER"), Simplify3D ("prime pillar"), KISSlicer ("Skirt Path", "Prime Pillar Path"), ideaMaker
/// ("WIPE-TOWER").
const NAMES: [&str; 12] = [
    "skirt",
    "brim",
    "skirt brim",
    "brim skirt",
    "inner brim",
    "outer brim",
    "prime tower",
    "wipe tower",
    "purge tower",
    "prime pillar",
    "wipe pillar",
    "purge pillar",
];

/// Whether a feature is a skirt, a brim, or a tower at which the nozzle is primed or wiped, by its name in the file.
pub fn is_auxiliary(feature: &str) -> bool {
    let lower = feature.to_lowercase();
    let words: Vec<&str> =
        lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let words = match &words[..] {
        // KISSlicer's.
        [words @ .., "path"] => words,
        words => words,
    };
    NAMES.contains(&words.join(" ").as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_slicers_name_what_is_beside_the_part() {
        for name in [
            "Skirt/Brim",
            "Skirt",
            "SKIRT",
            "skirt",
            "Brim",
            "Inner brim",
            "Wipe tower",
            "Prime tower",
            "PRIME-TOWER",
            "prime pillar",
            "Skirt Path",
            "Prime Pillar Path",
            "WIPE-TOWER",
        ] {
            assert!(is_auxiliary(name), "{name}");
        }
        for name in
            ["External perimeter", "SUPPORT", "Custom", "unnamed", "", "path", "Ironing", "Tower", "Raft"]
        {
            assert!(!is_auxiliary(name), "{name}");
        }
    }
}
