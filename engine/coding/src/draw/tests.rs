//! Pictures judged by the silhouette and the normals of a ball, and by a plane that is known.

use super::*;

/// Planes that touch a ball of radius 1 around the middle of a cube with an edge of 4, in cells of a level; normals of 31 steps.
fn ball(level: u32) -> Vec<PackedSplat> {
    let side = 32u32 << level;
    let cell = 4.0 / f64::from(side);
    let mut splats = Vec::new();
    for n in 0..side.pow(3) {
        let at = [n % side, n / side % side, n / side / side];
        let middle = at.map(|c| (f64::from(c) + 0.5) * cell - 2.0);
        let length = middle.iter().map(|c| c * c).sum::<f64>().sqrt();
        let support = middle.iter().map(|c| c.abs()).sum::<f64>() / length * cell / 2.0;
        let sum = middle.iter().map(|c| c.abs()).sum::<f64>();
        if (length - 1.0).abs() <= support * 1.05 {
            let normal = middle.map(|c| (c / sum * 127.0).round() as i8 as u8);
            let offset = ((1.0 - length) / cell * 16.0).round() as i8 as u8;
            let plane = u32::from_le_bytes([normal[0], normal[1], normal[2], offset]);
            splats.push([at[0] | at[1] << 16, at[2] | level << 16, plane, 0, 0]);
        }
    }
    splats
}

fn view(distance: f64) -> DrawView {
    let (a, e) = (25f64.to_radians(), 30f64.to_radians());
    let towards = [e.cos() * a.cos(), e.cos() * a.sin(), e.sin()];
    let right = [-a.sin(), a.cos(), 0.0];
    let up = [-e.sin() * a.cos(), -e.sin() * a.sin(), e.cos()];
    DrawView {
        size: [100, 120],
        origin: [-2.0; 3],
        edge: 4.0,
        axes: [right, up, towards],
        centre: [0.0; 3],
        pixel: 0.025,
        distance,
        highest: None,
        style: DrawStyle::Light,
        deepest: 4,
    }
}

fn drawn(splats: &[PackedSplat], view: &DrawView) -> Vec<[u8; 4]> {
    let mut canvas = PageCanvas::default();
    // What an earlier, larger picture left does no harm.
    canvas.draw(splats, &DrawView { size: [130, 130], ..view.clone() });
    canvas.draw(splats, view);
    canvas.pixels().to_vec()
}

#[test]
fn a_ball_has_its_silhouette_and_no_holes() {
    for (distance, level) in [(0.0, 0), (0.0, 1), (0.0, 2), (3.0, 0), (3.0, 1), (3.0, 2)] {
        let pixels = drawn(&ball(level), &view(distance));
        let cell = 4.0 / f64::from(32u32 << level);
        // Of parallel rays the silhouette is a circle of 40 pixels; with perspective a larger one.
        let radius =
            if distance == 0.0 { 40.0 } else { distance / (distance * distance - 1.0f64).sqrt() * 40.0 };
        for (n, pixel) in pixels.iter().enumerate() {
            let from = [(n % 100) as f64 - 49.5, (n / 100) as f64 - 59.5];
            let off = (from[0] * from[0] + from[1] * from[1]).sqrt() - radius;
            // Planes that touch a ball reach beyond it; offsets have steps of a sixteenth of a cell.
            let slack = 0.7 + 40.0 * (cell * cell + cell / 16.0);
            assert!(
                off > -0.7 - 40.0 * cell / 16.0 || *pixel != [255; 4],
                "a hole at {:?}, {}, {}",
                from,
                distance,
                level
            );
            assert!(off < slack || *pixel == [255; 4], "{} beyond the ball, {}, {}", off, distance, level);
        }
    }
}

#[test]
fn normals_are_those_of_the_ball() {
    let view = DrawView { style: DrawStyle::Normals, ..view(0.0) };
    let pixels = drawn(&ball(2), &view);
    let mut count = 0;
    for (n, pixel) in pixels.iter().enumerate() {
        let [x, y] = [((n % 100) as f64 - 49.5) / 40.0, (59.5 - (n / 100) as f64) / 40.0];
        let square = x * x + y * y;
        if square > 0.9 {
            continue;
        }
        let z = (1.0 - square).sqrt();
        for (a, seen) in pixel[..3].iter().enumerate() {
            let normal = view.axes[0][a] * x + view.axes[1][a] * y + view.axes[2][a] * z;
            let seen = f64::from(*seen) / 127.5 - 1.0;
            assert!((normal - seen).abs() < 0.06, "{} beside {}", seen, normal);
        }
        count += 1;
    }
    assert!(count > 4000);
}

#[test]
fn a_cut_shows_the_inside_and_splats_cut_each_other() {
    let mut view = view(0.0);
    let whole = drawn(&ball(1), &view);
    view.highest = Some([1e30, 1e30, 0.0]);
    let open = drawn(&ball(1), &view);
    let is_inner = |p: &[u8; 4]| p[0] > p[2];
    assert!(!whole.iter().any(is_inner));
    assert!(open.iter().filter(|p| is_inner(p)).count() > 1000);
    // Nothing is left above the cut: the upper part of the picture is empty.
    assert!(open[..100 * 35].iter().all(|p| *p == [255; 4]));
    // A plane seen from the front, of which another takes the left half.
    let level = 0;
    let front = u32::from_le_bytes([0, 0, 31, 0]);
    let left = u32::from_le_bytes([(-31i8) as u8, 0, 0, 0]);
    let at = [16 | 16 << 16, 16 | level << 16];
    let above = DrawView { axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], pixel: 0.005, ..view };
    let above = DrawView { highest: None, centre: [0.0625; 3], ..above };
    for (inward, cut, halves) in [(0, 0, [true, true]), (0, left, [false, true]), (1, left, [true, false])] {
        let pixels = drawn(&[[at[0], at[1] | inward << 24, front, cut, 0]], &above);
        let is_there = |column: usize| pixels[60 * 100 + column] != [255; 4];
        assert_eq!([is_there(44), is_there(55)], halves);
    }
}

#[test]
fn nothing_is_drawn_of_nothing_and_what_is_behind_the_eye() {
    let is_empty = |pixels: Vec<[u8; 4]>| pixels.iter().all(|p| *p == [255; 4]);
    assert!(is_empty(drawn(&[], &view(0.0))));
    // The eye looks away.
    let mut behind = view(1.0);
    behind.centre = behind.axes[2].map(|c| -3.0 * c);
    assert!(is_empty(drawn(&ball(1), &behind)));
}
