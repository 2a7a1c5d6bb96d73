//! Area, volume, bounds and closedness of some of an input's facets.

use crate::error::Result;
use crate::ingest::{Facet, Facets, Input};
use crate::lattice::RootCube;
use crate::progress::Progress;
use crate::winding::EdgeBalance;
use rayon::prelude::*;
use std::ops::Range;

/// Facets whose sums are taken at once; their order decides how sums are rounded, whatever the number of threads.
const RUN_FACETS: u64 = 1 << 14;

/// What facets amount to, in the input's own unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Area of all facets.
    pub area: f64,
    /// Volume within, w counting, if they are closed.
    pub volume: f64,
    /// Lower and upper corner of the box around them.
    pub bounds: ([f64; 3], [f64; 3]),
    /// Whether every directed edge is cancelled, at the precision of the root cube's lattice.
    pub closed: bool,
}

/// Measures the facets of `range`, on all threads. `root` is the cube around the whole input.
///
/// # Errors
/// If the user interrupts.
pub fn measure(
    input: &Input,
    range: Range<u64>,
    root: RootCube,
    progress: &dyn Progress,
) -> Result<Measures> {
    let runs = of_runs(input, range, progress, |facets| of_facets(facets, root))?;
    let mut balance = EdgeBalance::default();
    let mut all = NONE;
    for (run, edges) in runs {
        balance.merge(edges);
        all.area += run.area;
        all.volume += run.volume;
        for a in 0..3 {
            all.bounds.0[a] = all.bounds.0[a].min(run.bounds.0[a]);
            all.bounds.1[a] = all.bounds.1[a].max(run.bounds.1[a]);
        }
    }
    Ok(Measures { closed: balance.is_closed(), ..all })
}

/// What runs of facets amount to, in their order, on all threads.
///
/// # Errors
/// If the user interrupts.
pub(super) fn of_runs<T: Send>(
    source: &dyn Facets,
    range: Range<u64>,
    progress: &dyn Progress,
    of_run: impl Fn(&[Facet]) -> T + Sync,
) -> Result<Vec<T>> {
    let starts: Vec<u64> = range.clone().step_by(RUN_FACETS as usize).collect();
    let of_start = |facets: &mut Vec<Facet>, start: u64| {
        progress.check()?;
        source.read(start..range.end.min(start + RUN_FACETS), facets);
        progress.advance(facets.len() as u64);
        Ok(of_run(facets))
    };
    starts.into_par_iter().map_init(Vec::new, of_start).collect()
}

/// Of no facets.
const NONE: Measures =
    Measures { area: 0.0, volume: 0.0, bounds: ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), closed: true };

fn of_facets(facets: &[Facet], root: RootCube) -> (Measures, EdgeBalance) {
    let snapper = root.snapper();
    // Volumes are taken from here, where those of far corners do not drown them.
    let middle = root.origin.map(|c| c + 0.5 * root.edge);
    let (mut measures, mut balance) = (NONE, EdgeBalance::default());
    for facet in facets {
        balance.add(&facet.map(snapper));
        let [a, b, c] = facet.map(|corner| [0, 1, 2].map(|i| corner[i] - middle[i]));
        let minus = |p: [f64; 3]| [0, 1, 2].map(|i| p[i] - a[i]);
        let (u, v) = (minus(b), minus(c));
        let cross = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| u[i] * v[j] - u[j] * v[i]);
        measures.area += 0.5 * cross.iter().map(|c| c * c).sum::<f64>().sqrt();
        measures.volume += (0..3).map(|i| a[i] * cross[i]).sum::<f64>() / 6.0;
        for corner in facet {
            for (i, &c) in corner.iter().enumerate() {
                measures.bounds.0[i] = measures.bounds.0[i].min(c);
                measures.bounds.1[i] = measures.bounds.1[i].max(c);
            }
        }
    }
    (measures, balance)
}
