//! What a result says of where it comes from.

use super::chain::Operation;
use crate::store::{BuildCounts, Meta, Refine, Source, Store};

/// The metadata of a chain's result. `first` is the store whose lattice it has; `stores` are all that take part, each with
/// its operation, and `bounds` those of the operands that are none, likewise. `sources` name all operands.
pub fn meta_of(
    first: &Store,
    stores: &[(Operation, &Store)],
    bounds: &[(Operation, [[f64; 3]; 2])],
    sources: Vec<Source>,
    program: &str,
) -> Meta {
    let of_store = |store: &Store| [store.meta().bounds_min, store.meta().bounds_max];
    let mut around = of_store(first);
    let others = stores.iter().map(|(operation, store)| (*operation, of_store(store)));
    for (operation, [low, high]) in others.chain(bounds.iter().copied()) {
        match operation {
            Operation::Plus => {
                around[0] = [0, 1, 2].map(|a| around[0][a].min(low[a]));
                around[1] = [0, 1, 2].map(|a| around[1][a].max(high[a]));
            }
            Operation::Minus => {}
            Operation::And => {
                let both = [
                    [0, 1, 2].map(|a| around[0][a].max(low[a])),
                    [0, 1, 2].map(|a| around[1][a].min(high[a])),
                ];
                // Where nothing is common the box says where to look.
                if (0..3).all(|a| both[0][a] < both[1][a]) {
                    around = both;
                }
            }
        }
    }
    let metas = || std::iter::once(first.meta()).chain(stores.iter().map(|(_, store)| store.meta()));
    let depth = metas().map(|meta| meta.depth).max().unwrap_or(0);
    let base = metas().filter_map(|meta| match meta.refine {
        Refine::Thin { base } => Some(base),
        _ => None,
    });
    let refine = match base.min() {
        Some(base) => Refine::Thin { base: base.min(depth) },
        None if metas().all(|meta| meta.refine == first.meta().refine) => first.meta().refine,
        None => Refine::Hidden,
    };
    Meta {
        program: program.to_owned(),
        sources,
        unit: first.meta().unit.clone(),
        root: first.meta().root,
        bounds_min: around[0],
        bounds_max: around[1],
        depth,
        refine,
        stddev: metas().map(|meta| meta.stddev).fold(0.0, f64::max),
        tolerance: metas().filter_map(|meta| meta.tolerance).reduce(f64::max),
        numbers: BuildCounts::default(),
        beads: None,
        shard: None,
        volumes: None,
    }
}
