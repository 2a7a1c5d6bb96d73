//! Is the input closed, and if not, where is it open?

use crate::error::{Error, Result};
use crate::ingest::{Facet, Facets, Input, runs};
use crate::lattice::RootCube;
use crate::progress::Progress;
use crate::winding::{Boundary, EdgeBalance, OpenEdge};
use rayon::prelude::*;

/// Whether the soup of all inputs is closed. One pass over the input, on all threads.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn is_closed(inputs: &[Input], root: RootCube, progress: &dyn Progress) -> Result<bool> {
    progress.phase("checking edges", Some(inputs.iter().map(Input::facets).sum()), "facets");
    let sources = sources(inputs);
    let snapper = root.snapper();
    let sum_of_run = |world: &mut Vec<Facet>, (source, range): (usize, std::ops::Range<u64>)| {
        progress.check()?;
        sources[source].read(range, world);
        let mut balance = EdgeBalance::default();
        world.iter().for_each(|t| balance.add(&t.map(snapper)));
        progress.advance(world.len() as u64);
        Ok(balance)
    };
    let add = |mut a: EdgeBalance, b: EdgeBalance| {
        a.merge(b);
        Ok(a)
    };
    let sums = runs(&sources).into_par_iter().map_init(Vec::new, sum_of_run);
    Ok(sums.try_reduce(EdgeBalance::default, add)?.is_closed())
}

/// The error for inputs whose edges do not balance.
pub(super) fn open_input(inputs: &[Input], root: RootCube, progress: &dyn Progress) -> Error {
    progress.phase("finding open edges", None, "facets");
    let open = match Boundary::of(&sources(inputs), root, progress) {
        Ok(open) => open,
        Err(error) => return error,
    };
    let Some(OpenEdge { from, to, mut facet }) = open.first() else {
        // A closed soup whose hashes do not cancel: no chance of that is left.
        return Error::setting("internal error: the edge balance is off", "report this with the input");
    };
    let mut input = &inputs[0];
    for candidate in inputs {
        input = candidate;
        if facet < candidate.facets() {
            break;
        }
        facet -= candidate.facets();
    }
    let [from, to] = [from, to].map(|p| root.to_world(p.map(f64::from)));
    let point = |p: [f64; 3]| format!("({:.6}, {:.6}, {:.6})", p[0], p[1], p[2]);
    Error::input(
        input.path(),
        format!("facet {}", facet + 1),
        format!(
            "the input is not closed: {} open edges, the first from {} to {}",
            open.edges.len(),
            point(from),
            point(to)
        ),
        "close the mesh or orient its facets alike; this version takes closed input only",
    )
}

fn sources(inputs: &[Input]) -> Vec<&dyn Facets> {
    inputs.iter().map(|input| input as &dyn Facets).collect()
}
