//! Connected pieces of a soup: which facets hang together, which pieces are inside out, and facets turned over.
//!
//! Vertices are snapped to the lattice of the root, as in a build, so that the answers are about what is built, and
//! all of them are exact. Facets with two equal vertices belong to no piece.
//!
//! # Which facets hang together
//!
//! Two facets that share an edge which no other facet has are of one piece (`edges`, `gather`). So pieces that share
//! only a vertex are two. At an edge of more facets, those that are already of one piece and pair up among each other
//! are done with.
//!
//! The others are matched as brackets are, by their order in the input: each with the nearest before it that runs the
//! other way. So pieces that lie one behind the other in a file stay apart, also where they share edges or whole
//! faces.
//!
//! # Which pieces are turned
//!
//! A piece is closed if its facets cancel each other at every edge; then its volume has a sign. It is *reversed* if
//! that is negative.
//!
//! A closed piece lies *inside* another if it is smaller, no facet of it passes through one of the other, and points
//! of it are inside (`nesting`).
//!
//! Going from large pieces to small ones (`turn`):
//!
//! - a piece that lies in no other is turned outward;
//! - a reversed piece inside others stays reversed, as a cavity, if the field of those, as they are turned by now, is at
//!   least 1 there; otherwise it is turned outward;
//! - a piece inside others that is not reversed stays as it is, with one exception. A file most of whose outermost
//!   pieces are reversed is inside out as a whole. There what faces outward directly inside a reversed piece is taken
//!   for a cavity of it, and treated as a reversed one.
//!
//! So a box in a cavity in a box comes out right whichever of the three were reversed, unless none shows to be.
//! Whether files are read in one order or another changes nothing, nor does the number of threads.
//!
//! # Soups without consistency
//!
//! With [`Consistency::Sought`] two facets at an edge of theirs alone are made to run along it in opposite directions,
//! whatever the file says. Facets at edges of more are matched in the order of the input whichever way they run.
//!
//! Of the two ways in which that can be done piece by piece, fewer facets are turned; if as many, the first one stays.
//! A piece of which no such way exists, as a Möbius strip, stays as it is.
//!
//! Open pieces are made consistent and no more.

mod edges;
mod gather;
mod nesting;
mod oriented;
mod sets;
#[cfg(test)]
mod tests;
mod turn;

pub use oriented::{FlippedFacets, FlippedSource};

use crate::check::{TRIANGLES_MAX, weld_by};
use crate::error::{Error, Result};
use crate::ingest::Facets;
use crate::lattice::RootCube;
use crate::progress::Progress;
use serde::Serialize;

/// How facets at an edge are understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consistency {
    /// Facets face where the input says; only pieces as a whole may be inside out.
    Given,
    /// Any facet may face the wrong way.
    Sought,
}

/// Pieces of a soup, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PiecesReport {
    /// All pieces.
    pub pieces: u64,
    /// Those with edges at which a facet is missing.
    pub open: u64,
    /// Those whose facets do not face the same side, or cannot.
    pub inconsistent: u64,
    /// Closed pieces that stay reversed, or become so, as they lie inside others.
    pub cavities: u64,
    /// Pieces that are inside out.
    pub inside_out: Option<InsideOut>,
    /// Facets that are turned over in all.
    pub turned_facets: u64,
}

/// Pieces that face inward where nothing is around them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InsideOut {
    /// Number of the pieces.
    pub pieces: u64,
    /// Their volume, in the cube of the input's unit.
    pub volume: f64,
    /// The input, from 0, that the largest of them begins in.
    pub source: usize,
    /// The first facet of that one, from 1, as counted in its input.
    pub facet: u64,
}

/// Bytes for each facet: corners by number and by vertex, sets, edges of many facets, and pieces of four facets.
const BYTES_A_FACET: u64 = 56;
/// Bytes for each vertex: position and table, of which either may have room for as many again.
const BYTES_A_VERTEX: u64 = 32;
/// Facets that are read ahead, and bytes for each.
const AHEAD: (u64, u64) = (1 << 21, 32);

/// What is known about `facets` facets with `vertices` vertices takes so much while it is found.
fn bytes_for(facets: u64, vertices: u64) -> u64 {
    let ahead = facets.min(AHEAD.0) * AHEAD.1;
    facets.saturating_mul(BYTES_A_FACET).saturating_add(vertices.saturating_mul(BYTES_A_VERTEX)) + ahead
}

/// Fails if there is too little memory.
fn require_memory(facets: u64, vertices: u64, memory: u64) -> Result<()> {
    let need = bytes_for(facets, vertices);
    if need <= memory {
        return Ok(());
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let (need, memory) = (mib(need), mib(memory));
    Err(Error::setting(
        format!(
            "the pieces of {facets} facets need {need} MiB to be told apart, of the {memory} MiB that there are"
        ),
        "allow more with `memory`, or treat parts of the input separately",
    ))
}

/// Finds the pieces of all sources together and which facets would have to be turned over, on all threads.
///
/// Takes at most `memory` bytes, some 80 a facet of closed pieces.
///
/// # Errors
/// If that does not suffice, if there are more than 1,431,655,765 facets, or if the user interrupts.
pub fn study(
    sources: &[&dyn Facets],
    root: RootCube,
    consistency: Consistency,
    memory: u64,
    progress: &dyn Progress,
) -> Result<(PiecesReport, FlippedFacets)> {
    let facets: u64 = sources.iter().map(|source| source.facets()).sum();
    if facets > TRIANGLES_MAX {
        let what = format!(
            "there are {facets} facets, more than the {TRIANGLES_MAX} whose pieces can be told apart"
        );
        return Err(Error::setting(what, "treat parts of the input separately"));
    }
    // A closed piece has half as many vertices as facets.
    require_memory(facets, facets / 2, memory)?;
    let fits = |vertices: usize, done: usize| {
        let foreseen = vertices as u64 * facets / (done as u64).max(1);
        require_memory(facets, foreseen.max(facets / 2), memory)
    };
    let mesh = weld_by(sources, root.snapper(), fits, progress)?;
    let gathered = gather::gather(&mesh, consistency, progress)?;
    let starts = sources.iter().scan(0, |end, source| Some(std::mem::replace(end, *end + source.facets())));
    let starts: Vec<u64> = starts.collect();
    let decision = turn::decide(&mesh, &gathered, &starts, progress)?;
    let unit = root.unit();
    let report = turn::report(&gathered, &decision, &starts, unit);
    let turned = gathered.turned(&decision.turned);
    let report = PiecesReport { turned_facets: turned.count(), ..report };
    Ok((report, FlippedFacets::new(turned, starts)))
}
