//! The ellipse of a site: the smallest of its shape around what is the site's, and the width of the slab that holds the
//! samples in it.

use super::bend::principal;
use super::ellipse::Ellipse;
use super::samples::SurfaceSamples;
use super::site::{Site, square_between};
use crate::lattice::{cross, dot, minus, unit};

/// Halvings of the step by which planes are tilted.
const HALVINGS: usize = 10;
/// What is farther from a slab than so many of its widths is another sheet.
const SHEETS: f64 = 3.0;
/// Least variance of places across a direction, as a share of that along it.
const SLENDER: f64 = 1e-3;
/// Samples that face away by more than 60 degrees are of another surface.
const SAME_SURFACE: f64 = 0.5;

/// An ellipse of a site.
#[derive(Clone, Copy, Debug)]
pub(super) struct SiteShape {
    centre: [f64; 3],
    normal: [f64; 3],
    axes: [[f64; 3]; 2],
    radii: [f64; 2],
    /// Width of the slab, and that by the site's tensor.
    pub width: f64,
    pub expected: f64,
}

impl SiteShape {
    pub fn ellipse(&self) -> Ellipse {
        let SiteShape { centre, normal, axes, radii, width, .. } = *self;
        Ellipse { centre, normal, axes, radii, error: width / 2.0 }
    }
}

/// The ellipse of a site around samples that are its; none if there are none.
pub(super) fn fit(site: &Site, of: &[u32], samples: &SurfaceSamples, circles: bool) -> Option<SiteShape> {
    if of.is_empty() {
        return None;
    }
    let own: Vec<[f64; 3]> = of.iter().map(|&n| samples.list[n as usize].place).collect();
    if circles {
        let width = (site.widths[0] + site.widths[1]) / 2.0;
        return Some(around(Site { widths: [width; 2], ..*site }, &own, samples));
    }
    let bent = around(*site, &own, samples);
    // Where little bends, what is the site's is not as long as its tensor would have it.
    let spread = around(spread(site, &own), &own, samples);
    let best = if spread.width < bent.width { spread } else { bent };
    Some(SiteShape { expected: bent.expected, ..best })
}

/// The smallest ellipse of a site's shape around places, in the plane of the narrowest slab.
fn around(mut site: Site, own: &[[f64; 3]], samples: &SurfaceSamples) -> SiteShape {
    let points: Vec<[f64; 2]> = own.iter().map(|place| site.round(*place)).collect();
    site.place = site.flat(Site::centre(&points));
    let farthest = |site: &Site| {
        own.iter().map(|place| square_between(site.round(*place), [0.0; 2])).fold(0.0, f64::max)
    };
    let expected = farthest(&site) / 2.0;
    // Between samples, too, there is surface.
    let margin = samples.cell / 2.0;
    let radii = site.widths.map(|width| (2.0 * expected / width).sqrt() + margin);
    site.widths = radii.map(|radius| 1.0 / (radius * radius));
    let inside = inside(&site, own, samples);
    site.normal = tilted(&site, &inside);
    site.axes[0] = unit(cross(site.axes[1], site.normal));
    site.axes[1] = cross(site.normal, site.axes[0]);
    let beyond = farthest(&site).max(1.0).sqrt();
    let [low, high] = range(site.place, site.normal, &inside);
    let shift = (low + high) / 2.0;
    SiteShape {
        centre: std::array::from_fn(|a| site.place[a] + site.normal[a] * shift),
        normal: site.normal,
        axes: site.axes,
        radii: radii.map(|radius| radius * beyond),
        width: high - low,
        expected,
    }
}

/// The site with the shape of how places spread in its plane.
fn spread(site: &Site, own: &[[f64; 3]]) -> Site {
    let (mut sums, mut means) = ([0.0; 3], [0.0; 2]);
    for place in own {
        let from = minus(*place, site.place);
        let [x, y] = site.axes.map(|axis| dot(axis, from));
        (means[0], means[1]) = (means[0] + x, means[1] + y);
        sums = [sums[0] + x * x, sums[1] + x * y, sums[2] + y * y];
    }
    let count = own.len() as f64;
    let [x, y] = means.map(|sum| sum / count);
    let ([long, short], [c, s]) =
        principal([sums[0] / count - x * x, sums[1] / count - x * y, sums[2] / count - y * y]);
    // A line has no width.
    if short <= long * SLENDER {
        return *site;
    }
    let [u, v] = site.axes;
    let along = std::array::from_fn(|a| u[a] * c + v[a] * s);
    Site { axes: [along, cross(site.normal, along)], widths: [1.0 / long, 1.0 / short], ..*site }
}

/// Places of all samples that an ellipse covers, where coordinates of [`Site::round`] are shares of radii.
fn inside(site: &Site, own: &[[f64; 3]], samples: &SurfaceSamples) -> Vec<[f64; 3]> {
    let [low, high] = range(site.place, site.normal, own);
    // What is far above or below is another sheet.
    let slack = SHEETS * (high - low) + samples.cell;
    let mut found = own.to_vec();
    let half: [f64; 3] = std::array::from_fn(|a| {
        let along = |n: usize| site.axes[n][a] * site.axes[n][a] / site.widths[n];
        (along(0) + along(1)).sqrt() + (slack + low.abs().max(high.abs())) * site.normal[a].abs()
    });
    let corners = [-1.0, 1.0].map(|s| std::array::from_fn(|a| site.place[a] + s * half[a]));
    samples.near(corners[0], corners[1], |_, sample| {
        let above = dot(site.normal, minus(sample.place, site.place));
        let faces = dot(site.normal, sample.normal.map(f64::from));
        if faces > SAME_SURFACE
            && above > low - slack
            && above < high + slack
            && square_between(site.round(sample.place), [0.0; 2]) <= 1.0
        {
            found.push(sample.place);
        }
    });
    found
}

/// Least and greatest heights above a plane.
fn range(place: [f64; 3], normal: [f64; 3], points: &[[f64; 3]]) -> [f64; 2] {
    points.iter().fold([f64::MAX, f64::MIN], |[low, high], point| {
        let above = dot(normal, minus(*point, place));
        [low.min(above), high.max(above)]
    })
}

/// The normal near the site's of the narrowest slab around points.
fn tilted(site: &Site, points: &[[f64; 3]]) -> [f64; 3] {
    let width = |normal: [f64; 3]| {
        let [low, high] = range(site.place, normal, points);
        high - low
    };
    let (mut best, mut least) = (site.normal, width(site.normal));
    // A slab that is as wide as the ellipse is long cannot be mended.
    let mut steps = site.axes.map(|axis| {
        let reach = points.iter().map(|point| dot(axis, minus(*point, site.place)).abs()).fold(0.0, f64::max);
        if reach > 0.0 { (least / reach).min(0.5) } else { 0.0 }
    });
    for _ in 0..HALVINGS {
        for (axis, step) in site.axes.into_iter().zip(steps) {
            for sign in [-1.0, 1.0] {
                let normal = unit(std::array::from_fn(|a| best[a] + axis[a] * step * sign));
                let found = width(normal);
                if found < least {
                    (best, least) = (normal, found);
                    break;
                }
            }
        }
        steps = steps.map(|step| step / 2.0);
    }
    best
}
