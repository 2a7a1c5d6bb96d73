//! What features are, by the names that slicers have for them.

/// What a feature is in a print, by the names that slicers have for it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    OuterWall,
    SparseInfill,
    Other,
}

/// What a slicer's name means.
pub(super) fn role(feature: &str) -> Role {
    let name = feature.to_lowercase().replace(['-', '_'], " ");
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    let is_dense = has(&["solid", "top", "bottom", "bridge", "gap", "support", "iron", "skin"]);
    if has(&["external perimeter", "outer wall", "wall outer", "outer perimeter", "overhang"]) {
        Role::OuterWall
    } else if !is_dense && has(&["infill", "fill"]) {
        Role::SparseInfill
    } else {
        Role::Other
    }
}

/// Whether a feature is one of infill that may be sparse.
pub(super) fn may_be_sparse(feature: &str) -> bool {
    role(feature) == Role::SparseInfill
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_of_all_slicers_have_their_roles() {
        for name in
            ["External perimeter", "WALL-OUTER", "Outer wall", "outer_perimeter", "Overhang perimeter"]
        {
            assert!(role(name) == Role::OuterWall, "{name}");
        }
        for name in ["Internal infill", "FILL", "Sparse infill", "Sparse Infill Path", "infill"] {
            assert!(role(name) == Role::SparseInfill, "{name}");
        }
        for name in ["Solid infill", "Top solid infill", "Gap fill", "Perimeter", "SKIN", "Bridge infill"] {
            assert!(role(name) == Role::Other, "{name}");
        }
    }
}
