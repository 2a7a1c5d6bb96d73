//! Where the material of a toolpath goes.

use crate::measured::measured;
use brickfield_engine::store::{SourceVolumes, SweptVolumes};
use serde::Serialize;

/// Material fed = union + overlap between passes + what corners cover more than once − round ends, in mm³.
#[derive(Serialize)]
pub(super) struct Balance {
    /// By the E axis, if it tells for all beads.
    fed: Option<f64>,
    /// Sections of beads times lengths.
    sections: f64,
    union: f64,
    union_error: f64,
    overlap: f64,
    overlap_error: f64,
    /// Within passes, at corners and joints, round ends included.
    within_corners: f64,
    within_corners_error: f64,
    /// What round ends add to sections times lengths.
    round_ends: f64,
}

impl Balance {
    /// Of beads as solids.
    pub fn of(volumes: &SourceVolumes) -> Option<Balance> {
        let SweptVolumes { sections, ends, fed } = volumes.swept?;
        let corners = volumes.within_corners()?;
        Some(Balance {
            fed,
            sections,
            union: volumes.union.value,
            union_error: volumes.union.bound(),
            overlap: volumes.overlap.value,
            overlap_error: volumes.overlap.bound(),
            within_corners: corners.value,
            within_corners_error: corners.bound(),
            round_ends: ends,
        })
    }

    /// As one line.
    pub fn text(&self, unit: &str) -> String {
        let Balance { fed, sections, round_ends, .. } = *self;
        let union = measured(self.union, self.union_error);
        let overlap = measured(self.overlap, self.overlap_error);
        let corners = measured(self.within_corners, self.within_corners_error);
        // What is exact has the digits of what is not.
        let rounded = |value: f64| {
            let text = measured(value, self.union_error);
            text.split(" ±").next().unwrap_or_default().to_owned()
        };
        let ends = rounded(round_ends);
        let parts = format!(
            "{union} of union + {overlap} of overlap between passes + {corners} within corners − {ends} of round ends"
        );
        let swept = rounded(sections);
        match fed {
            Some(fed) if (fed - sections).abs() > 1e-3 * fed => {
                let (fed, off) = (rounded(fed), 100.0 * (fed / sections - 1.0));
                format!("{swept} {unit}³ of beads = {parts}; fed were {fed}, {off:+.2}%")
            }
            Some(fed) => format!("{} {unit}³ fed = {parts}", rounded(fed)),
            None => format!("{swept} {unit}³ of beads = {parts}"),
        }
    }
}
