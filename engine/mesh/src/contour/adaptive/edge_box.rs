//! Boxes of edges of a leaf, by their lower samples.

/// The least and the greatest lower samples of edges, by axis.
pub(in super::super) type EdgeBox = [[i32; 3]; 2];

/// What two boxes have in common.
pub(super) fn common([low, high]: &EdgeBox, other: &EdgeBox) -> Option<EdgeBox> {
    let low: [i32; 3] = std::array::from_fn(|a| low[a].max(other[0][a]));
    let high = std::array::from_fn(|a| high[a].min(other[1][a]));
    (0..3).all(|a| low[a] <= high[a]).then_some([low, high])
}
