//! Sources with some of their facets turned over.

use crate::ingest::{Facet, Facets};
use std::ops::Range;

/// A set of facets, one bit each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Bits(Vec<u64>);

impl Bits {
    pub fn new(count: usize) -> Bits {
        Bits(vec![0; count.div_ceil(64)])
    }

    pub fn set(&mut self, number: usize) {
        self.0[number / 64] |= 1 << (number % 64);
    }

    pub fn has(&self, number: usize) -> bool {
        self.0[number / 64] >> (number % 64) & 1 == 1
    }

    pub fn count(&self) -> u64 {
        self.0.iter().map(|word| u64::from(word.count_ones())).sum()
    }
}

/// Facets of several sources that are to be turned over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FlippedFacets {
    bits: Bits,
    /// Number of each source's first facet among those of all.
    starts: Vec<u64>,
}

impl FlippedFacets {
    pub(super) fn new(bits: Bits, starts: Vec<u64>) -> FlippedFacets {
        FlippedFacets { bits, starts }
    }

    /// The sources, which must be those that were studied, with these facets turned over.
    pub fn apply<'a>(&'a self, sources: &[&'a dyn Facets]) -> Vec<FlippedSource<'a>> {
        let of_source = |(source, &start): (&&'a dyn Facets, &u64)| FlippedSource {
            source: *source,
            turned: &self.bits,
            start,
        };
        sources.iter().zip(&self.starts).map(of_source).collect()
    }
}

/// A source some of whose facets are turned over.
pub struct FlippedSource<'a> {
    source: &'a dyn Facets,
    turned: &'a Bits,
    start: u64,
}

impl FlippedSource<'_> {
    /// The sources as passes over them take them.
    pub fn sources<'a>(oriented: &'a [FlippedSource<'a>]) -> Vec<&'a dyn Facets> {
        oriented.iter().map(|source| source as &dyn Facets).collect()
    }
}

impl Facets for FlippedSource<'_> {
    fn facets(&self) -> u64 {
        self.source.facets()
    }

    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>) {
        let first = (self.start + range.start) as usize;
        self.source.read(range, out);
        for (number, facet) in out.iter_mut().enumerate() {
            if self.turned.has(first + number) {
                facet.swap(1, 2);
            }
        }
    }
}
