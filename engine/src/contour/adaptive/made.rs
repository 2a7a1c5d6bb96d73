//! The triangles of a leaf while it is found out which of them meet.

use super::super::field::Field;
use super::super::later::Names;
use super::super::polygons::{Facet, Mark, named_facets};
use super::super::vertices::LeafVertices;
use super::NONE;
use super::across::{Across, Taken};
use super::bounds::{Bounds, bounds, meets};
use crate::error::Result;
use std::collections::HashSet;
use std::ops::Range;

/// What stands for several vertices, and the level of its node.
pub(super) type Merge = (Taken, u8);

/// Which triangles of a leaf are others than they were.
#[derive(Clone, Copy)]
pub(in super::super) enum Fresh<'a> {
    All,
    /// Those of polygons that reach into one of these boxes.
    In(&'a [Bounds]),
    None,
}

/// The triangles of a leaf.
#[derive(Default)]
pub(in super::super) struct Made {
    /// World positions of their corners.
    pub(super) places: Vec<[f32; 3]>,
    /// What stands there, if that is merged.
    pub(super) merges: Vec<Option<Merge>>,
    /// Those of each [`Kind`] follow each other.
    pub(super) triangles: Vec<[u32; 3]>,
    /// For triangles without a merged corner, of polygons that have one, what has the largest node there. Sorted.
    lone: Vec<(u32, Merge)>,
    /// Where those of each kind end.
    ends: [usize; 5],
    /// Which of them are fresh; empty unless the leaf was asked for [`Fresh::In`].
    is_fresh: Vec<bool>,
    /// As [`super::Merged::has_moved`].
    pub(super) has_moved: bool,
    /// As [`super::Merged::crowding`].
    pub(super) crowding: Vec<u32>,
}

/// Which triangles are listed together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// At a vertex of several leaves.
    Wide,
    /// Another one of a polygon with a merged vertex, reaching beyond the leaf's cube.
    MergedOuter,
    /// The same, within the cube.
    Merged,
    /// Of a polygon without, reaching beyond the cube.
    PlainOuter,
    /// The same, within the cube.
    Plain,
}

impl Made {
    /// Of a leaf, with what is merged so far.
    pub(in super::super) fn of(field: &Field, leaf: u32, across: &Across, fresh: Fresh) -> Result<Made> {
        let (facets, names) = named_facets(field, leaf)?;
        let mut made = Made::default();
        if facets.is_empty() {
            return Ok(made);
        }
        let polygons = polygons_of(&facets);
        let mut numbering = Numbering::new(field, across, &names)?;
        let mut triangles = Vec::with_capacity(facets.len());
        // Of each polygon.
        let mut largest: Vec<Option<Merge>> = Vec::new();
        for (facet, polygon) in facets.iter().zip(&polygons) {
            let mut corners = [0; 3];
            for (n, corner) in corners.iter_mut().enumerate() {
                *corner = numbering.number(&mut made, Mark::split(facet.ids[n]).0, facet.corners[n])?;
            }
            triangles.push(corners);
            if let Some(polygon) = polygon {
                let merges = corners.iter().filter_map(|corner| made.merges[*corner as usize]);
                let most = merges.fold(None, |most, one| larger(most, Some(one)));
                largest.resize(largest.len().max(polygon + 1), None);
                largest[*polygon] = larger(largest[*polygon], most);
            }
        }
        let lone = |n: usize| {
            let is_lone = triangles[n].iter().all(|corner| made.merges[*corner as usize].is_none());
            polygons[n].filter(|_| is_lone).and_then(|polygon| largest[polygon])
        };
        let lone: Vec<Option<Merge>> = (0..facets.len()).map(lone).collect();
        if let Some(merged) = field.vertices(leaf)?.what_is_merged() {
            (made.has_moved, made.crowding) = (merged.has_moved, merged.crowding.clone());
        }
        let fresh = match fresh {
            Fresh::In(boxes) => {
                of_polygons(&facets, &polygons, |own| boxes.iter().any(|one| meets(one, own)))
            }
            Fresh::All | Fresh::None => Vec::new(),
        };
        let cube = field.frame(field.leaves.get(leaf).key).bounds();
        let kind = |n: usize| made.kind(&facets[n], &triangles[n], polygons[n].is_some(), &cube);
        let mut order: Vec<(Kind, u32)> = (0..facets.len()).map(|n| (kind(n), n as u32)).collect();
        order.sort_unstable();
        made.ends = [Kind::Wide, Kind::MergedOuter, Kind::Merged, Kind::PlainOuter, Kind::Plain]
            .map(|kind| order.partition_point(|(other, _)| *other <= kind));
        made.triangles = order.iter().map(|(_, n)| triangles[*n as usize]).collect();
        let lone = (0..).zip(&order).filter_map(|(at, (_, n))| Some((at, lone[*n as usize]?)));
        made.lone = lone.collect();
        if !fresh.is_empty() {
            made.is_fresh = order.iter().map(|(_, n)| fresh[*n as usize]).collect();
        }
        Ok(made)
    }

    fn kind(&self, facet: &Facet, corners: &[u32; 3], of_merged: bool, [low, high]: &Bounds) -> Kind {
        if corners.iter().any(|corner| is_wide(self.merges[*corner as usize])) {
            return Kind::Wide;
        }
        let own = bounds(&facet.corners);
        let is_inner = (0..3).all(|a| low[a] < own[0][a] && own[1][a] < high[a]);
        match (of_merged, is_inner) {
            (true, false) => Kind::MergedOuter,
            (true, true) => Kind::Merged,
            (false, false) => Kind::PlainOuter,
            (false, true) => Kind::Plain,
        }
    }

    /// What has the largest node at the polygon of a triangle that has no merged corner itself.
    pub(super) fn lone(&self, triangle: usize) -> Option<Merge> {
        let at = self.lone.binary_search_by_key(&(triangle as u32), |(at, _)| *at).ok()?;
        Some(self.lone[at].1)
    }

    /// The numbers of the triangles of a kind.
    pub(super) fn of_kind(&self, kind: Kind) -> Range<usize> {
        let end = |n: usize| self.ends[n];
        match kind as usize {
            0 => 0..end(0),
            n => end(n - 1)..end(n),
        }
    }

    /// Corners of a triangle.
    #[inline]
    pub(super) fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        let [a, b, c] = self.triangles[triangle];
        [self.places[a as usize], self.places[b as usize], self.places[c as usize]]
    }

    /// Whether a triangle is, if the leaf was asked for these.
    pub(super) fn is_fresh(&self, triangle: usize, fresh: Fresh) -> bool {
        match fresh {
            Fresh::All => true,
            Fresh::In(_) => self.is_fresh.get(triangle).is_none_or(|is_fresh| *is_fresh),
            Fresh::None => false,
        }
    }

    /// Heap bytes.
    pub(in super::super) fn heap_bytes(&self) -> usize {
        self.places.capacity() * size_of::<[f32; 3]>()
            + self.merges.capacity() * size_of::<Option<Merge>>()
            + self.triangles.capacity() * size_of::<[u32; 3]>()
            + self.lone.capacity() * size_of::<(u32, Merge)>()
            + self.is_fresh.capacity()
            + 4 * self.crowding.capacity()
            + size_of::<Made>()
    }
}

/// Whether it stands for vertices of several leaves.
pub(super) fn is_wide(merge: Option<Merge>) -> bool {
    matches!(merge, Some((Taken::Wide(_), _)))
}

/// What has the larger node.
fn larger(a: Option<Merge>, b: Option<Merge>) -> Option<Merge> {
    a.into_iter().chain(b).max_by_key(|(taken, level)| (*level, *taken))
}

/// For each triangle which polygon with a merged vertex it is of, if any.
fn polygons_of(facets: &[Facet]) -> Vec<Option<usize>> {
    let (mut count, mut last) = (0, 0);
    let mut polygon = |facet: &Facet| {
        let (_, mark) = Mark::split(facet.ids[0]);
        if mark == 0 {
            return None;
        }
        count += usize::from(mark != last);
        last = mark;
        Some(count - 1)
    };
    facets.iter().map(&mut polygon).collect()
}

/// Which triangles are so, or another one of the same polygon, since one that loses a corner may be cut along another
/// diagonal; polygons without a merged vertex lie about their edge.
fn of_polygons(facets: &[Facet], polygons: &[Option<usize>], is_so: impl Fn(&Bounds) -> bool) -> Vec<bool> {
    let mut are_so: Vec<bool> = facets.iter().map(|facet| is_so(&bounds(&facet.corners))).collect();
    let so: HashSet<usize> =
        are_so.iter().zip(polygons).filter_map(|(is_so, polygon)| polygon.filter(|_| *is_so)).collect();
    for (is_so, polygon) in are_so.iter_mut().zip(polygons) {
        *is_so |= polygon.is_some_and(|polygon| so.contains(&polygon));
    }
    are_so
}

/// Numbers the corners of a leaf's triangles by their names.
struct Numbering<'a> {
    field: &'a Field<'a>,
    across: &'a Across,
    places: &'a [(u32, u32)],
    /// By place, the vertices of its leaf and the numbers of those met.
    known: Vec<(Option<LeafVertices>, Vec<u32>)>,
}

impl<'a> Numbering<'a> {
    fn new(field: &'a Field, across: &'a Across, names: &'a Names) -> Result<Numbering<'a>> {
        let places = names.places(Mark::MOST_PLACES)?;
        let known = places.iter().map(|_| (None, Vec::new())).collect();
        Ok(Numbering { field, across, places, known })
    }

    /// The number of the vertex with a name, which is added when it is first met.
    fn number(&mut self, made: &mut Made, name: u32, position: [f32; 3]) -> Result<u32> {
        let [place, within] = Names::split(name);
        let (vertices, numbers) = &mut self.known[place];
        if numbers.len() <= within {
            numbers.resize(within + 1, NONE);
        }
        if numbers[within] == NONE {
            let (leaf, first) = self.places[place];
            let vertices = match vertices {
                Some(vertices) => vertices,
                None => vertices.insert(self.field.vertices(leaf)?),
            };
            let number = first + within as u32;
            let merged = vertices.what_is_merged();
            numbers[within] = made.places.len() as u32;
            made.places.push(position);
            made.merges.push(merged.and_then(|merged| self.across.taken(leaf, number, merged)));
        }
        Ok(numbers[within])
    }
}
