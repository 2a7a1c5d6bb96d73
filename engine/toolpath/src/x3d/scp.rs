//! Spine-aligned cross-section planes (SCP) of ISO/IEC 19775-1, 13.3.5.3 and 13.3.5.4.
//!
//! Where the text is silent, this is what is done:
//! - Points closer than [`COINCIDENT`] to the one before are one point; "previous" and "next" mean distinct
//!   points.
//! - Where the spine turns back on itself, so that the chord vanishes, Y keeps the incoming direction.
//! - A wholly collinear spine turns the Z axis by the smallest rotation that takes +Y to the spine's
//!   direction; a spine along −Y keeps Z and flips X.

use glam::{DMat3, DVec3};

/// Distance up to which consecutive points, and the two ends of a closed spine, count as one.
pub const COINCIDENT: f64 = 1e-9;

/// Sine of the angle up to which two segments count as collinear.
const COLLINEAR: f64 = 1e-7;

/// Hands `plane` the planes along `spine` in order: the number of each spine point and its columns X, Y and Z,
/// right-handed and orthonormal; coincident points get equal ones. Tells whether the spine ends where it
/// begins, or `None` if it has fewer than two distinct points, for which the specification renders nothing.
pub fn planes(spine: &[DVec3], mut plane: impl FnMut(usize, &DMat3)) -> Option<bool> {
    let starts = distinct_points(spine);
    let count = starts.len();
    if count < 2 {
        return None;
    }
    let point = |g: usize| spine[starts[g] as usize];
    let closed = count > 2 && point(0).distance(point(count - 1)) <= COINCIDENT;
    let at = |g| neighbours(&point, count, closed, g);
    let mut z = (0..count).find_map(|g| bend(at(g))).unwrap_or_else(|| collinear_z(point(1) - point(0)));
    let first_z = z;
    for g in 0..count {
        // The ends of a closed spine have one plane, also where its seam is straight.
        let inherited = if closed && g == count - 1 { first_z } else { z };
        let turned = bend(at(g)).unwrap_or(inherited);
        z = if turned.dot(z) < 0.0 { -turned } else { turned };
        let y = tangent(at(g));
        let x = unit(y.cross(z));
        let frame = DMat3::from_cols(x, y, x.cross(y));
        let end = starts.get(g + 1).map_or(spine.len(), |&next| next as usize);
        (starts[g] as usize..end).for_each(|i| plane(i, &frame));
    }
    Some(closed)
}

/// The first point of each run of coincident ones.
fn distinct_points(spine: &[DVec3]) -> Vec<u32> {
    let differs = |i: usize| i == 0 || spine[i].distance(spine[i - 1]) > COINCIDENT;
    (0..spine.len()).filter(|&i| differs(i)).map(|i| i as u32).collect()
}

/// The distinct points before, at and after number `g` of `count`.
fn neighbours(
    point: &impl Fn(usize) -> DVec3,
    count: usize,
    closed: bool,
    g: usize,
) -> (Option<DVec3>, DVec3, Option<DVec3>) {
    if closed && (g == 0 || g == count - 1) {
        return (Some(point(count - 2)), point(0), Some(point(1)));
    }
    (g.checked_sub(1).map(point), point(g), (g + 1 < count).then(|| point(g + 1)))
}

/// Y: the direction of the chord.
fn tangent((before, here, after): (Option<DVec3>, DVec3, Option<DVec3>)) -> DVec3 {
    let from = before.unwrap_or(here);
    let chord = after.unwrap_or(here) - from;
    if chord.length() <= COINCIDENT { unit(here - from) } else { unit(chord) }
}

/// Z where the spine bends.
fn bend((before, here, after): (Option<DVec3>, DVec3, Option<DVec3>)) -> Option<DVec3> {
    let (out, back) = (after? - here, before? - here);
    let normal = out.cross(back);
    (normal.length() > COLLINEAR * out.length() * back.length()).then(|| unit(normal))
}

/// Z of a collinear spine in `direction`: the Z axis, turned as +Y is turned into that direction.
fn collinear_z(direction: DVec3) -> DVec3 {
    let d = unit(direction);
    let sine_squared = d.x * d.x + d.z * d.z;
    if sine_squared <= COINCIDENT * COINCIDENT {
        return DVec3::Z;
    }
    // Rodrigues' formula about Y × d. 1 / (1 + cos) cancels near −Y; (1 − cos) / sin² is the same number.
    let k = if d.y > 0.0 { 1.0 / (1.0 + d.y) } else { (1.0 - d.y) / sine_squared };
    unit(DVec3::new(-d.x * d.z * k, -d.z, 1.0 - d.z * d.z * k))
}

fn unit(v: DVec3) -> DVec3 {
    v / v.length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::x3d::affine::rotation;
    use proptest::prelude::*;

    #[test]
    fn collinear_spines_turn_the_z_axis_least() {
        for d in [
            [0.3, 0.9, -0.2],
            [0.3, -0.9, -0.2],
            [1e-6, -1.0, 2e-6],
            [1e-8, -1.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, -1.0],
        ] {
            let d = DVec3::from(d).normalize();
            let axis = DVec3::Y.cross(d);
            let turned = rotation([axis.x, axis.y, axis.z, axis.length().atan2(d.y)]) * DVec3::Z;
            let z = collinear_z(d);
            assert!((z - turned).length() < 1e-7, "{d}: {z} is not {turned}");
            assert!(z.dot(d).abs() < 1e-15);
        }
        assert_eq!(collinear_z(DVec3::Y), DVec3::Z);
        assert_eq!(collinear_z(-DVec3::Y), DVec3::Z);
    }

    proptest! {
        /// Small integers make collinear runs, coincident points, reversals and closed spines frequent.
        #[test]
        fn frames_are_right_handed_and_z_never_turns_over(
            spine in prop::collection::vec(prop::array::uniform3(-1i8..=1), 0..12),
            ends_meet: bool,
        ) {
            let mut spine: Vec<DVec3> =
                spine.into_iter().map(|p| DVec3::from(p.map(f64::from))).collect();
            if ends_meet && let Some(first) = spine.first().copied() {
                spine.push(first);
            }
            let distinct = spine.windows(2).filter(|w| w[0] != w[1]).count();
            let mut frames = Vec::new();
            let closed = planes(&spine, |i, frame| {
                assert_eq!(i, frames.len());
                frames.push(*frame);
            });
            prop_assert_eq!(closed.is_none(), distinct == 0);
            prop_assert_eq!(frames.len(), if closed.is_some() { spine.len() } else { 0 });
            for frame in &frames {
                prop_assert!((*frame * frame.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
                prop_assert!((frame.determinant() - 1.0).abs() < 1e-12);
            }
            for (pair, points) in frames.windows(2).zip(spine.windows(2)) {
                prop_assert!(pair[0].z_axis.dot(pair[1].z_axis) > -1e-12);
                prop_assert!(points[0] != points[1] || pair[0] == pair[1]);
            }
            if closed == Some(true) {
                let (first, last) = (frames[0], frames[spine.len() - 1]);
                prop_assert_eq!(first.y_axis, last.y_axis);
                prop_assert!(first.z_axis == last.z_axis || first.z_axis == -last.z_axis);
            }
        }
    }
}
