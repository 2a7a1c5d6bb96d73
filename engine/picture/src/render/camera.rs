//! Where the eye is, and the ray through each point of the picture.

use crate::error::{Error, Result};
pub(super) use crate::lattice::{Vector, cross, dot};

pub(super) fn scaled(a: Vector, by: f64) -> Vector {
    a.map(|c| c * by)
}

pub(super) fn sum(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|n| a[n] + b[n])
}

/// A vector of length 1; zero stays zero.
pub(super) fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    if length > 0.0 { scaled(a, 1.0 / length) } else { a }
}

/// From where the part is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Degrees from the x axis towards the y axis, of the direction in which the eye lies.
    pub azimuth: f64,
    /// Degrees above the xy plane.
    pub elevation: f64,
    /// Degrees between the upper and the lower border of the picture, below 180; 0 for parallel rays.
    pub opening: f64,
}

impl View {
    /// Names with azimuth and elevation.
    pub const NAMED: [(&'static str, [f64; 2]); 7] = [
        ("iso", [-45.0, 35.264_389_682_754_654]),
        ("top", [-90.0, 90.0]),
        ("bottom", [-90.0, -90.0]),
        ("front", [-90.0, 0.0]),
        ("back", [90.0, 0.0]),
        ("left", [180.0, 0.0]),
        ("right", [0.0, 0.0]),
    ];

    /// Views all around the part, so many, this one the first; the eye goes from the x axis towards the y axis.
    pub fn around(self, count: u32) -> Vec<View> {
        let view = |n| View { azimuth: self.azimuth + 360.0 * f64::from(n) / f64::from(count), ..self };
        (0..count).map(view).collect()
    }

    /// The picture's axes in the world: to the right, upward, and towards the eye.
    pub fn axes(self) -> [[f64; 3]; 3] {
        let ([sin_a, cos_a], [sin_e, cos_e]) = (sin_cos(self.azimuth), sin_cos(self.elevation));
        let towards = [cos_e * cos_a, cos_e * sin_a, sin_e];
        let right = [-sin_a, cos_a, 0.0];
        [right, cross(towards, right), towards]
    }

    /// Where to look to see the whole box `corners` as large as a picture of `size` pixels allows.
    ///
    /// # Errors
    /// [`Error::Setting`] if angles are no numbers or the opening is none.
    pub fn fit(self, corners: [[f64; 3]; 2], size: [u32; 2]) -> Result<Focus> {
        let camera = Camera::fit(&[self], corners, size)?.remove(0);
        Ok(Focus { centre: camera.centre, height: camera.pixel * f64::from(size[1]) })
    }

    /// The picture of `size` pixels of the box `corners`, or of a focus in it.
    ///
    /// # Errors
    /// [`Error::Setting`] if angles are no numbers, the opening is none, or the focus shows nothing.
    pub fn screen(self, focus: Option<Focus>, corners: [[f64; 3]; 2], size: [u32; 2]) -> Result<Screen> {
        let camera = match focus {
            Some(focus) => Camera::at(self, focus, corners, size)?,
            None => Camera::fit(&[self], corners, size)?.remove(0),
        };
        Ok(camera.screen())
    }

    fn check(self) -> Result<()> {
        let View { azimuth, elevation, opening } = self;
        let sound = azimuth.is_finite() && (-90.0..=90.0).contains(&elevation);
        if sound && (opening == 0.0 || (1.0..=150.0).contains(&opening)) {
            return Ok(());
        }
        Err(Error::setting(
            format!("nobody can see from {azimuth}, {elevation} degrees with an opening of {opening}"),
            "choose an elevation from -90 to 90, and an opening of 0 or from 1 to 150 degrees",
        ))
    }

    /// A view of that name, with parallel rays.
    pub fn named(name: &str) -> Option<View> {
        let (_, [azimuth, elevation]) = View::NAMED.into_iter().find(|(known, _)| *known == name)?;
        Some(View { azimuth, elevation, opening: 0.0 })
    }
}

/// What of the world a picture shows, whatever the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focus {
    /// What its middle shows, in world coordinates.
    pub centre: [f64; 3],
    /// How much of the world its height shows there, in world units.
    pub height: f64,
}

/// A line from the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it begins, in world coordinates.
    pub origin: Vector,
    /// Its direction, of length 1.
    pub direction: Vector,
}

/// The eye, its screen, and how large a pixel is.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    /// To the right, upward, and towards the eye.
    pub axes: [Vector; 3],
    /// What the middle of the picture shows.
    centre: Vector,
    /// From there to the eye.
    distance: f64,
    /// Size of a pixel at the centre.
    pixel: f64,
    size: [u32; 2],
    parallel: bool,
}

/// The picture in space, in world coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// The eye; of parallel rays where the one through the upper left corner begins.
    pub origin: [f64; 3],
    /// From the eye to the upper left corner; the direction of parallel rays.
    pub corner: [f64; 3],
    /// From a pixel to the next on the right, and to the one below.
    pub steps: [[f64; 3]; 2],
    /// Size of a pixel in the middle.
    pub pixel: f64,
    /// Distance of the eye from there.
    pub distance: f64,
    /// Whether all rays have one direction.
    pub parallel: bool,
}

/// Free space on each side, as a share of the picture.
const MARGIN: f64 = 0.03;

impl Camera {
    /// One for each of `views`, from all of which the box `corners` has the same size: as large as pictures of `size`
    /// pixels allow, if all of them are to show it whole. The views have one opening.
    ///
    /// # Errors
    /// [`Error::Setting`] if angles are no numbers or the opening is none.
    pub fn fit(views: &[View], corners: [Vector; 2], size: [u32; 2]) -> Result<Vec<Camera>> {
        let centre: Vector = std::array::from_fn(|a| (corners[0][a] + corners[1][a]) / 2.0);
        let (mut cameras, mut pixel, mut distance) = (Vec::new(), 0.0f64, 0.0f64);
        for view in views {
            view.check()?;
            let (axes, opening) = (view.axes(), view.opening);
            // The box from its middle, along the axes of the picture.
            let ends = [0, 1, 2, 3, 4, 5, 6, 7].map(|n: usize| {
                let corner = std::array::from_fn(|a| corners[n >> a & 1][a] - centre[a]);
                axes.map(|axis| dot(axis, corner))
            });
            let [p, d] = fitted(&ends, opening, size);
            (pixel, distance) = (pixel.max(p), distance.max(d));
            cameras.push(Camera { axes, centre, distance, pixel, size, parallel: opening == 0.0 });
        }
        for camera in &mut cameras {
            (camera.pixel, camera.distance) = (pixel, distance);
        }
        Ok(cameras)
    }

    /// One that looks at `focus`. With parallel rays the eye stands before the whole box `corners`.
    ///
    /// # Errors
    /// As [`Camera::fit`], and if the focus is no place or shows nothing of the world.
    pub fn at(view: View, focus: Focus, corners: [Vector; 2], size: [u32; 2]) -> Result<Camera> {
        view.check()?;
        let Focus { centre, height } = focus;
        if !(centre.iter().all(|c| c.is_finite()) && height.is_finite() && height > 0.0) {
            let what = format!("nothing can be seen {height} high around {centre:?}");
            return Err(Error::setting(what, "choose a point, and a height above 0"));
        }
        let (axes, pixel) = (view.axes(), height / f64::from(size[1]));
        let parallel = view.opening == 0.0;
        let distance = if parallel {
            let farthest =
                |a: usize| (corners[0][a] - centre[a]).abs().max((corners[1][a] - centre[a]).abs());
            let reach = [0, 1, 2].map(farthest);
            dot(reach, reach).sqrt() * 2.0
        } else {
            let [sin, cos] = sin_cos(view.opening / 2.0);
            height / 2.0 * cos / sin
        };
        Ok(Camera { axes, centre, distance, pixel, size, parallel })
    }

    /// The ray through a point of the picture, in pixels from its upper left corner.
    pub fn ray(&self, at: [f64; 2]) -> Ray {
        let [right, up, towards] = self.axes;
        let x = (at[0] - f64::from(self.size[0]) / 2.0) * self.pixel;
        let y = (f64::from(self.size[1]) / 2.0 - at[1]) * self.pixel;
        let target = sum(self.centre, sum(scaled(right, x), scaled(up, y)));
        let back = scaled(towards, self.distance);
        if self.parallel {
            return Ray { origin: sum(target, back), direction: scaled(towards, -1.0) };
        }
        let origin = sum(self.centre, back);
        Ray { origin, direction: unit(sum(target, scaled(origin, -1.0))) }
    }

    /// Where a point is seen, in pixels from the upper left corner, and the size of a pixel there; `None` behind the eye.
    pub fn seen_at(&self, world: Vector) -> Option<([f64; 2], f64)> {
        let away = sum(world, scaled(self.centre, -1.0));
        let [right, up, towards] = self.axes.map(|axis| dot(axis, away));
        let distance = self.distance - towards;
        if distance <= 0.0 {
            return None;
        }
        let pixel = self.pixel_at(distance);
        let [width, height] = self.size.map(f64::from);
        Some(([width / 2.0 + right / pixel, height / 2.0 - up / pixel], pixel))
    }

    /// The same rays as places and steps.
    pub fn screen(&self) -> Screen {
        let [right, up, towards] = self.axes;
        let steps = [scaled(right, self.pixel), scaled(up, -self.pixel)];
        let halves = [0, 1].map(|n| scaled(steps[n], -f64::from(self.size[n]) / 2.0));
        let to_corner = sum(halves[0], halves[1]);
        let eye = sum(self.centre, scaled(towards, self.distance));
        let [origin, corner] = match self.parallel {
            true => [sum(eye, to_corner), scaled(towards, -1.0)],
            false => [eye, sum(to_corner, scaled(towards, -self.distance))],
        };
        let Camera { pixel, distance, parallel, .. } = *self;
        Screen { origin, corner, steps, pixel, distance, parallel }
    }

    /// Size of a pixel at a distance from the eye.
    pub fn pixel_at(&self, distance: f64) -> f64 {
        if self.parallel { self.pixel } else { self.pixel * distance / self.distance }
    }
}

/// Size of a pixel at the centre, and distance of the eye from it, at which a box with these corners fills a picture.
fn fitted(ends: &[Vector; 8], opening: f64, size: [u32; 2]) -> [f64; 2] {
    let most = |f: &dyn Fn(&Vector) -> f64| ends.iter().map(f).fold(0.0, f64::max);
    let share = 1.0 - 2.0 * MARGIN;
    let halves = size.map(|side| f64::from(side) / 2.0 * share);
    let nearest = most(&|end| end[2]);
    if opening == 0.0 {
        let pixel = (0..2).map(|a| most(&|end| end[a].abs()) / halves[a]).fold(0.0, f64::max);
        return [pixel, nearest * 2.0];
    }
    let [sin, cos] = sin_cos(opening / 2.0);
    // Height of a pixel at a distance of 1.
    let pixel = sin / cos / (f64::from(size[1]) / 2.0);
    let needed = |a: usize| most(&|end| end[2] + end[a].abs() / (pixel * halves[a]));
    let distance = needed(0).max(needed(1)).max(nearest * 1.01);
    [pixel * distance, distance]
}

/// Sine and cosine of degrees, the same on every machine, and exact where they are 0 or 1.
fn sin_cos(degrees: f64) -> [f64; 2] {
    let angle = degrees.to_radians();
    [libm::sin(angle), libm::cos(angle)].map(|c| {
        let nearest = c.round();
        if (c - nearest).abs() < 1e-14 { nearest } else { c }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_views_look_where_they_say() {
        let axes = |name| {
            let view = View::named(name).unwrap();
            Camera::fit(&[view], [[0.0; 3], [1.0, 2.0, 3.0]], [100, 50]).unwrap()[0].axes
        };
        assert_eq!(axes("top"), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(axes("front"), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]);
        assert_eq!(axes("right"), [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
        assert_eq!(View::named("inside"), None);
        for (name, _) in View::NAMED {
            let [right, up, towards] = axes(name);
            assert!(dot(cross(right, up), towards) > 0.999_999, "{name}");
        }
    }

    #[test]
    fn a_focus_on_all_of_the_box_is_what_fits() {
        let corners = [[-3.0, 1.0, 5.0], [4.0, 2.0, 9.0]];
        for opening in [0.0, 30.0] {
            let view = View { azimuth: 20.0, elevation: 40.0, opening };
            let fitted = Camera::fit(&[view], corners, [200, 100]).unwrap().remove(0);
            let focus = view.fit(corners, [200, 100]).unwrap();
            let camera = Camera::at(view, focus, corners, [200, 100]).unwrap();
            for at in [[0.0, 0.0], [100.0, 50.0], [170.5, 3.0]] {
                let (a, b) = (fitted.ray(at), camera.ray(at));
                let off = sum(a.direction, scaled(b.direction, -1.0));
                let beside = cross(sum(a.origin, scaled(b.origin, -1.0)), a.direction);
                assert!(dot(off, off) < 1e-18 && dot(beside, beside) < 1e-18, "{opening} {at:?}");
            }
            let close = Focus { height: focus.height / 4.0, ..focus };
            let [whole, close] =
                [focus, close].map(|focus| Camera::at(view, focus, corners, [200, 100]).unwrap());
            assert!((whole.pixel / close.pixel - 4.0).abs() < 1e-12);
        }
        let nowhere = Focus { centre: [0.0, f64::NAN, 0.0], height: 1.0 };
        for bad in [nowhere, Focus { centre: [0.0; 3], height: 0.0 }] {
            assert!(Camera::at(View::named("iso").unwrap(), bad, corners, [200, 100]).is_err());
        }
    }

    #[test]
    fn the_screen_has_the_same_rays() {
        for opening in [0.0, 50.0] {
            let view = View { azimuth: 20.0, elevation: -35.0, opening };
            let camera =
                Camera::fit(&[view], [[-3.0, 1.0, 5.0], [4.0, 2.0, 9.0]], [200, 100]).unwrap().remove(0);
            let Screen { origin, corner, steps, parallel, .. } = camera.screen();
            for at in [[0.0, 0.0], [17.5, 99.5], [200.0, 3.25]] {
                let over = sum(scaled(steps[0], at[0]), scaled(steps[1], at[1]));
                let (ray, expected) = match parallel {
                    true => (Ray { origin: sum(origin, over), direction: corner }, camera.ray(at)),
                    false => (Ray { origin, direction: unit(sum(corner, over)) }, camera.ray(at)),
                };
                for (a, b) in [(ray.origin, expected.origin), (ray.direction, expected.direction)] {
                    assert!((0..3).all(|n| (a[n] - b[n]).abs() < 1e-12), "{ray:?} {expected:?}");
                }
            }
        }
    }

    #[test]
    fn the_whole_box_is_seen_and_fills_the_picture() {
        let corners = [[-3.0, 1.0, 5.0], [4.0, 2.0, 9.0]];
        for opening in [0.0, 1.0, 30.0, 120.0] {
            for (_, [azimuth, elevation]) in View::NAMED {
                let view = View { azimuth, elevation, opening };
                let camera = Camera::fit(&[view], corners, [200, 100]).unwrap().remove(0);
                let [right, up, towards] = camera.axes;
                let mut fullest: f64 = 0.0;
                for n in 0..8 {
                    let corner: Vector = std::array::from_fn(|a| corners[n >> a & 1][a]);
                    let from = sum(corner, scaled(camera.centre, -1.0));
                    let near = if opening == 0.0 { 1.0 } else { 1.0 - dot(towards, from) / camera.distance };
                    let x = dot(right, from) / near / camera.pixel / 100.0;
                    let y = dot(up, from) / near / camera.pixel / 50.0;
                    fullest = fullest.max(x.abs()).max(y.abs());
                    // The ray through the corner's place in the picture meets it.
                    let ray = camera.ray([100.0 + x * 100.0, 50.0 - y * 50.0]);
                    let to = sum(corner, scaled(ray.origin, -1.0));
                    let off = sum(to, scaled(ray.direction, -dot(to, ray.direction)));
                    assert!(dot(off, off) < 1e-18 && dot(to, ray.direction) > 0.0);
                }
                assert!((0.93..=0.9401).contains(&fullest), "{fullest} {azimuth} {elevation} {opening}");
            }
        }
    }

    #[test]
    fn a_part_that_turns_keeps_its_size_and_stays_whole() {
        let corners = [[-3.0, 1.0, 5.0], [4.0, 2.0, 9.0]];
        for opening in [0.0, 30.0] {
            let view = View { azimuth: 10.0, elevation: 20.0, opening };
            let cameras = Camera::fit(&view.around(12), corners, [200, 100]).unwrap();
            assert_eq!(cameras.len(), 12);
            for (camera, next) in cameras.iter().zip(&cameras[1..]) {
                assert_eq!((camera.pixel, camera.distance), (next.pixel, next.distance));
                let turned = dot(camera.axes[0], next.axes[0]);
                assert!((turned - 0.75f64.sqrt()).abs() < 1e-12, "{turned}");
            }
            let alone: Vec<f64> = view
                .around(12)
                .into_iter()
                .map(|view| Camera::fit(&[view], corners, [200, 100]).unwrap()[0].distance)
                .collect();
            assert_eq!(cameras[0].distance, alone.iter().copied().fold(0.0, f64::max));
            assert!(alone.iter().any(|distance| *distance < cameras[0].distance));
        }
    }
}
