//! Walls and gaps thinner than a cell: how far bricks are divided for them, and what is told of those that are left.

use crate::brick::{ThinFeatures, ThinSheets};
use crate::error::{Error, Result};
use crate::lattice::{MAX_LEVEL, RootCube};
use crate::store::Refine;
use serde::Serialize;

/// How far bricks are divided in which a wall or a gap hides between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ThinDepth {
    /// No farther than all others.
    #[default]
    None,
    /// To this level, which is not less than that of all others.
    Level(u8),
    /// So many levels deeper than all others.
    Deeper(u8),
}

impl ThinDepth {
    /// The deepest level and the criterion, given the level to which all is divided and the criterion above it.
    pub(super) fn of(self, base: u8, refine: Refine) -> Result<(u8, Refine)> {
        let depth = match self {
            ThinDepth::None => return Ok((base, refine)),
            ThinDepth::Level(depth) => depth,
            ThinDepth::Deeper(levels) => base.saturating_add(levels),
        };
        if refine != Refine::Hidden {
            return Err(Error::setting(
                format!("a depth of {depth} for thin walls does not go together with the criterion {refine}"),
                "leave one of them out",
            ));
        }
        if depth > MAX_LEVEL {
            return Err(Error::setting(
                format!("a depth of {depth} for thin walls is beyond the lattice"),
                format!("use a depth of at most {MAX_LEVEL}"),
            ));
        }
        Ok((depth, Refine::Thin { base }))
    }

    /// Fails if it is asked for, of a field that does not know what hides between its samples.
    pub(super) fn require_none(self, of: &str) -> Result<()> {
        if self == ThinDepth::None {
            return Ok(());
        }
        Err(Error::setting(
            format!("walls between samples are known of closed meshes and beads, and not {of}"),
            "leave `max_depth` and `thin` out, and choose a greater `depth`",
        ))
    }
}

/// Walls and gaps that no sample shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ThinSummary {
    /// Inside between two faces.
    pub walls: Option<ThinSheetsSummary>,
    /// Outside between two faces.
    pub gaps: Option<ThinSheetsSummary>,
    /// Bricks without a sample inside that hold a piece of solid which is no wall: a rod, or a small body.
    pub unseen_bricks: u64,
}

/// All walls, or all gaps, that no sample shows: estimates from the lattice edges that hold both faces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ThinSheetsSummary {
    /// Lattice edges that hold both faces of one.
    pub edges: u64,
    /// Area of their mid-surfaces, in the input's unit squared.
    pub area: f64,
    /// Volume between their faces, in the input's unit cubed.
    pub volume: f64,
    /// Their mean thickness, in the input's unit.
    pub thickness: f64,
    /// The least distance of two faces, in the input's unit.
    pub thinnest: f64,
    /// The level whose samples would show 99% of their area; `None` if it is beyond the lattice.
    pub depth: Option<u8>,
}

impl ThinSummary {
    /// In the unit of the input, of leaves that are no deeper than `depth`.
    pub(super) fn new(thin: &ThinFeatures, root: RootCube, depth: u8) -> ThinSummary {
        let unit = root.unit();
        let summary = |sheets: &ThinSheets| {
            let (area, volume) = (sheets.area(unit), sheets.volume(unit));
            ThinSheetsSummary {
                edges: sheets.edges,
                area,
                volume,
                thickness: volume / area,
                thinnest: sheets.thinnest(unit),
                depth: Some(depth.saturating_add(sheets.levels_needed())).filter(|depth| *depth <= MAX_LEVEL),
            }
        };
        let some = |sheets: &ThinSheets| (sheets.edges > 0).then(|| summary(sheets));
        ThinSummary { walls: some(&thin.walls), gaps: some(&thin.gaps), unseen_bricks: thin.unseen }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_for_thin_walls() {
        let hidden = |thin: ThinDepth| thin.of(4, Refine::Hidden);
        assert_eq!(hidden(ThinDepth::None).unwrap(), (4, Refine::Hidden));
        assert_eq!(hidden(ThinDepth::Level(7)).unwrap(), (7, Refine::Thin { base: 4 }));
        assert_eq!(hidden(ThinDepth::Deeper(2)).unwrap(), (6, Refine::Thin { base: 4 }));
        assert!(hidden(ThinDepth::Deeper(200)).is_err());
        assert!(ThinDepth::Level(7).of(4, Refine::Surface).is_err());
        assert!(ThinDepth::Level(7).require_none("of open ones").is_err());
        ThinDepth::None.require_none("of open ones").unwrap();
    }
}
