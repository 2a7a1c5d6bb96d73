//! All sites: where they begin, what is whose, and how they move.

use super::bend::{BendTensor, bend};
use super::ellipse::{Ellipse, EllipseOptions};
use super::fit::{SiteShape, fit};
use super::samples::{SurfaceSample, SurfaceSamples};
use super::site::{Site, SiteSums};
use crate::error::{Error, Result};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Samples a site with which sites are moved; all of them judge the ellipses.
const SAMPLES: usize = 256;
/// Bytes of such a sample: itself, its tensor, whose it is, and what its neighbours say of it.
const SAMPLE_BYTES: u64 = 320;
/// How thickly discs of one size must overlap to cover a plane: the area of a circle by that of its hexagon.
const HEXAGONS: f64 = 1.209_199_576_156_145_2;
/// Radii of flat parts are at most so many of the mean radius.
const RADII_MAX: f64 = 4.0;
/// Samples within so much of the mean radius tell how the surface bends.
const BEND_RADIUS: f64 = 0.5;
/// Rounds, and the power of the cost by which far samples count in them. The first ones order the sites; the last come near to
/// the centres of the smallest ellipses.
const ROUNDS: [(u32, u32); 5] = [(50, 0), (20, 1), (30, 3), (40, 7), (40, 15)];
/// Samples are sought within so much of the expected width.
const WITHIN: f64 = 2.0;
/// How much of what was measured is learnt in a round.
const LEARNING: f64 = 0.3;
/// How fast sites with wide slabs lose samples to others.
const EVENING: f64 = 0.2;
/// Sites are asked at once.
const AT_ONCE: usize = 256;

/// Sites, and the samples that are theirs.
pub(super) struct SiteCover {
    options: EllipseOptions,
    samples: SurfaceSamples,
    tensors: Vec<BendTensor>,
    /// How many sites an area wants, up to a factor.
    density: Vec<f64>,
    /// What tensors have along each direction, at least.
    floor: f64,
    /// The width of a slab that is expected.
    expected: f64,
    sites: Vec<Site>,
}

/// What is whose: a site for each sample, and the cost.
struct Owners {
    of: Vec<u32>,
    costs: Vec<f64>,
}

impl SiteCover {
    pub fn new(all: &SurfaceSamples, options: EllipseOptions, progress: &dyn Progress) -> Result<SiteCover> {
        let number = (options.number as usize).min(all.list.len());
        let wanted = number.saturating_mul(SAMPLES).min(all.list.len());
        if wanted as u64 * SAMPLE_BYTES > options.memory {
            let what = format!("{number} ellipses take more than the {} bytes that they may", options.memory);
            return Err(Error::setting(what, "allow more `memory`, or ask for a smaller `number`"));
        }
        let samples = all.thinned(wanted);
        let radius = samples.radius;
        progress.phase("finding how the part bends", None, "crossings");
        progress.check()?;
        let tensors: Vec<BendTensor> = samples
            .list
            .par_iter()
            .map(|sample| bend(&samples, sample, radius * BEND_RADIUS, options.circles))
            .collect();
        let mut cover = SiteCover {
            options,
            samples,
            tensors,
            density: Vec::new(),
            floor: 0.0,
            expected: 0.0,
            sites: Vec::new(),
        };
        cover.expect(number, radius);
        cover.seed(number);
        Ok(cover)
    }

    /// What widths of slabs are to be expected: so many ellipses, hexagon by hexagon.
    fn expect(&mut self, number: usize, radius: f64) {
        let least = self.samples.cell * 1e-6;
        for _ in 0..4 {
            let floor = self.floor;
            let density = |t: &BendTensor| {
                let minors =
                    t[0] * t[3] - t[1] * t[1] + t[0] * t[5] - t[2] * t[2] + t[3] * t[5] - t[4] * t[4];
                (minors.max(0.0) + floor * (t[0] + t[3] + t[5]) + floor * floor).sqrt()
            };
            self.density = self.tensors.iter().map(density).collect();
            let sum: f64 = self.masses().sum();
            self.expected = (HEXAGONS * sum / (2.0 * PI * number as f64)).max(least);
            self.floor = 2.0 * self.expected / (RADII_MAX * RADII_MAX * radius * radius);
        }
    }

    fn masses(&self) -> impl Iterator<Item = f64> {
        self.samples.list.iter().zip(&self.density).map(|(sample, density)| f64::from(sample.area) * density)
    }

    /// Sites along the Morton curve, each after as much as the others.
    fn seed(&mut self, number: usize) {
        let step = self.masses().sum::<f64>() / number as f64;
        let (mut sites, mut sum) = (Vec::with_capacity(number), 0.0);
        for (n, mass) in self.masses().enumerate() {
            sum += mass;
            if sum > (sites.len() as f64 + 0.5) * step && sites.len() < number {
                sites.push(self.site_at(n));
            }
        }
        self.sites = sites;
    }

    fn site_at(&self, sample: usize) -> Site {
        let mut sums = SiteSums::NONE;
        sums.add(&self.samples.list[sample], &self.tensors[sample], 1.0);
        sums.site(self.floor).expect("a sample has a weight")
    }

    /// Moves the sites until what is farthest from them is near; keeps the best that was found.
    pub fn relax(&mut self, progress: &dyn Progress) -> Result<()> {
        let rounds = ROUNDS.iter().map(|(rounds, _)| u64::from(*rounds)).sum();
        progress.phase("moving ellipses", Some(rounds), "rounds");
        let (mut least, mut best) = (f64::INFINITY, self.sites.clone());
        for power in ROUNDS.into_iter().flat_map(|(rounds, power)| (0..rounds).map(move |_| power)) {
            progress.check()?;
            let owners = owners(&self.sites, &self.samples, WITHIN * self.expected);
            if power > 0 {
                let worst = self.measure(&by_site(&owners.of, self.sites.len()));
                if worst < least {
                    (least, best) = (worst, self.sites.clone());
                }
            }
            self.advance(power, &owners);
            progress.advance(1);
        }
        self.sites = best;
        Ok(())
    }

    /// Measures the ellipse of each site; gives the greatest width.
    fn measure(&mut self, of: &[Vec<u32>]) -> f64 {
        let samples = &self.samples;
        self.sites.par_iter_mut().zip(of).for_each(|(site, of)| {
            if let Some(shape) = fit(site, of, samples, self.options.circles) {
                if shape.expected > 0.0 {
                    let share = (shape.width / shape.expected).clamp(0.5, 2.0);
                    site.factor += LEARNING * (share - site.factor);
                }
                site.width = shape.width;
            }
        });
        self.sites.iter().map(|site| site.width).fold(0.0, f64::max)
    }

    /// Moves each site towards the mean of what is its, in which what is far counts by a power of its cost.
    fn advance(&mut self, power: u32, owners: &Owners) {
        let mut worst = vec![f64::MIN_POSITIVE; self.sites.len()];
        for (&of, cost) in owners.of.iter().zip(&owners.costs) {
            worst[of as usize] = cost.max(worst[of as usize]);
        }
        let mut sums = vec![SiteSums::NONE; self.sites.len()];
        for (n, mass) in self.masses().enumerate() {
            let site = owners.of[n] as usize;
            let weight = mass * raised(owners.costs[n] / worst[site], power);
            sums[site].add(&self.samples.list[n], &self.tensors[n], weight);
        }
        let mean = self.sites.iter().map(|site| site.width).sum::<f64>() / self.sites.len() as f64;
        // The mean in which far samples count more is beyond the middle that it tends to.
        let step = 1.0 / f64::from(power + 1);
        for (site, sums) in self.sites.iter_mut().zip(&sums) {
            let Some(moved) = sums.site(self.floor) else { continue };
            let place = std::array::from_fn(|a| site.place[a] + (moved.place[a] - site.place[a]) * step);
            let mut weight = site.weight;
            if power > 0 && mean > 0.0 {
                weight *= 1.0 + EVENING * (site.width / mean - 1.0).clamp(-0.5, 0.5);
            }
            *site = Site { place, weight, factor: site.factor, width: site.width, ..moved };
        }
    }

    /// The ellipses of the sites around all samples.
    pub fn ellipses(&self, all: &SurfaceSamples, progress: &dyn Progress) -> Result<Vec<Ellipse>> {
        progress.phase("measuring ellipses", None, "ellipses");
        let owners = owners(&self.sites, all, WITHIN * self.expected);
        progress.check()?;
        let of = by_site(&owners.of, self.sites.len());
        let fitted: Vec<Option<SiteShape>> = self
            .sites
            .par_iter()
            .zip(&of)
            .map(|(site, of)| fit(site, of, all, self.options.circles))
            .collect();
        progress.check()?;
        Ok(fitted.into_iter().flatten().map(|shape| shape.ellipse()).collect())
    }
}

/// A share to a power.
fn raised(share: f64, power: u32) -> f64 {
    (0..power).fold(1.0, |product, _| product * share)
}

/// The nearest site of each sample, by cost.
fn owners(sites: &[Site], samples: &SurfaceSamples, within: f64) -> Owners {
    let mut owners =
        Owners { of: vec![u32::MAX; samples.list.len()], costs: vec![f64::INFINITY; samples.list.len()] };
    let mut within = within;
    loop {
        for first in (0..sites.len()).step_by(AT_ONCE) {
            let some = &sites[first..(first + AT_ONCE).min(sites.len())];
            let near = |site: &Site| {
                let [low, high] = site.reach(within);
                let mut found = Vec::new();
                samples.near(low, high, |n, sample: &SurfaceSample| {
                    let cost = site.cost(sample.place, sample.normal.map(f64::from));
                    if cost <= within {
                        found.push((n as u32, cost));
                    }
                });
                found
            };
            let found: Vec<Vec<(u32, f64)>> = some.par_iter().map(near).collect();
            for (number, found) in found.into_iter().enumerate() {
                for (n, cost) in found {
                    let n = n as usize;
                    if cost < owners.costs[n] {
                        (owners.of[n], owners.costs[n]) = ((first + number) as u32, cost);
                    }
                }
            }
        }
        if owners.of.iter().all(|&of| of != u32::MAX) {
            return owners;
        }
        assert!(within.is_finite(), "costs are finite");
        within *= 4.0;
    }
}

/// Numbers of samples by site.
fn by_site(of: &[u32], sites: usize) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); sites];
    of.iter().enumerate().for_each(|(n, &site)| lists[site as usize].push(n as u32));
    lists
}
