//! Single pixels that no splat covers although splats are all around them.
//!
//! Where two surfaces meet in a groove that is thinner than a cell, planes end before they meet, and rays of a grazing view
//! slip through. Such a hole is a pixel or two. A slit that is seen through a part stays, for it is empty on two opposite sides.

/// Pixels around one, each before the one on its other side.
const AROUND: [[isize; 2]; 8] = [[-1, 0], [1, 0], [0, -1], [0, 1], [-1, -1], [1, 1], [-1, 1], [1, -1]];
/// So many of them are covered around a hole, at least.
const COVERED_MIN: usize = 6;

/// Calls for each hole of a picture of so many columns and rows: which pixel it is, and which around it are covered.
pub fn each_hole(
    [width, height]: [usize; 2],
    is_empty: impl Fn(usize) -> bool,
    mut each: impl FnMut(usize, &[usize]),
) {
    for row in 1..height.saturating_sub(1) {
        for column in 1..width.saturating_sub(1) {
            let at = row * width + column;
            // Most of what is empty lies beside the part.
            if !is_empty(at) || (is_empty(at - 1) && is_empty(at + 1)) {
                continue;
            }
            let around = AROUND.map(|[x, y]| (at as isize + y * width as isize + x) as usize);
            let is_slit = around.chunks_exact(2).any(|pair| pair.iter().all(|&at| is_empty(at)));
            let (mut covered, mut count) = ([0; AROUND.len()], 0);
            for at in around.iter().filter(|&&at| !is_empty(at)) {
                covered[count] = *at;
                count += 1;
            }
            if !is_slit && count >= COVERED_MIN {
                each(at, &covered[..count]);
            }
        }
    }
}
