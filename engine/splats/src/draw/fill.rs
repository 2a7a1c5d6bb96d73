//! Single pixels that no splat covers although splats are all around them.
//!
//! Where two surfaces meet in a groove that is thinner than a cell, planes end before they meet, and rays of a grazing view
//! slip through. Such a hole is a pixel or two. A slit that is seen through a part stays, for it is empty on two opposite sides.

use crate::picture::{Rgba, mean};

/// Pixels around one, each before the one on its other side.
const AROUND: [[isize; 2]; 8] = [[-1, 0], [1, 0], [0, -1], [0, 1], [-1, -1], [1, 1], [-1, 1], [1, -1]];
/// So many of them are covered around a hole, at least.
const COVERED_MIN: usize = 6;

/// Gives holes the mean colour of what is around them.
pub(super) fn fill_holes(pixels: &mut [Rgba], width: usize, background: Rgba) {
    let height = pixels.len() / width.max(1);
    let mut filled = Vec::new();
    for row in 1..height.saturating_sub(1) {
        for column in 1..width.saturating_sub(1) {
            let at = row * width + column;
            // Most of what is empty lies beside the part.
            if pixels[at] != background || pixels[at - 1] == background && pixels[at + 1] == background {
                continue;
            }
            let around = AROUND.map(|[x, y]| pixels[at.wrapping_add_signed(y * width as isize + x)]);
            let is_slit = around.chunks_exact(2).any(|pair| pair.iter().all(|pixel| *pixel == background));
            let covered: Vec<Rgba> = around.into_iter().filter(|pixel| *pixel != background).collect();
            if !is_slit && covered.len() >= COVERED_MIN {
                filled.push((at, mean(&covered)));
            }
        }
    }
    filled.into_iter().for_each(|(at, colour)| pixels[at] = colour);
}

#[cfg(test)]
mod tests {
    use super::*;

    const EMPTY: Rgba = [255; 4];
    const FULL: Rgba = [40, 80, 120, 255];

    /// A picture of letters, a dot where nothing is, after filling.
    fn filled(rows: [&str; 5]) -> Vec<String> {
        let mut pixels: Vec<Rgba> =
            rows.concat().chars().map(|letter| if letter == '.' { EMPTY } else { FULL }).collect();
        fill_holes(&mut pixels, 5, EMPTY);
        let letter = |pixel: &Rgba| match *pixel {
            FULL => '#',
            EMPTY => '.',
            _ => '?',
        };
        pixels.chunks_exact(5).map(|row| row.iter().map(letter).collect()).collect()
    }

    #[test]
    fn holes_are_filled_and_slits_and_edges_stay() {
        let all = ["#####"; 5];
        assert_eq!(filled(["#####", "#####", "##.##", "#####", "#####"]), all);
        assert_eq!(filled(["#####", "##.##", "#.###", "#####", "#####"]), all);
        assert_eq!(filled(["#####", "##..#", "#####", "#####", "#####"]), all);
        for same in [
            ["##.##", "##.##", "##.##", "##.##", "##.##"],
            ["#####", ".....", "#####", "#####", "#####"],
            ["#####", "####.", "###..", "##...", "#...."],
            [".....", ".....", "..#..", ".....", "....."],
        ] {
            assert_eq!(filled(same), same);
        }
        // The end of a slit has something on all sides but one.
        let slit = ["##.##", "##.##", "##.##", "#####", "#####"];
        assert_eq!(filled(slit), ["##.##", "##.##", "#####", "#####", "#####"]);
    }
}
