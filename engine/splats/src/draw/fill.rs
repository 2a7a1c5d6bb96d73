//! Pixels that splats leave empty among them.

use crate::page_draw::each_hole;
use crate::picture::{Rgba, mean};

/// Gives holes the mean colour of what is around them.
pub(super) fn fill_holes(pixels: &mut [Rgba], width: usize, background: Rgba) {
    let mut filled = Vec::new();
    each_hole(
        [width, pixels.len() / width.max(1)],
        |at| pixels[at] == background,
        |at, covered| {
            let covered: Vec<Rgba> = covered.iter().map(|&at| pixels[at]).collect();
            filled.push((at, mean(&covered)));
        },
    );
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
