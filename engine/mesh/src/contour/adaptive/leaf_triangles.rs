//! The triangles of a leaf while it is found out which of them meet.

use super::super::field::LevelSet;
use super::super::polygons::{MergeMark, named_facets};
use super::super::triangle_names::{TriangleNames, each_whole};
use super::super::vertices::LeafVertices;
use super::bounds::{Bounds, bounds};
use super::cross_leaf::{CrossLeafMerges, Merge, MergeTarget, is_wide};
use super::edge_filter::EdgeFilter;
use super::triangle_grid::TriangleGrid;
use super::vertex_merge::NONE;
use crate::error::Result;

/// Triangles of a leaf.
#[derive(Default)]
pub(super) struct LeafTriangles {
    /// World positions of their corners.
    places: Vec<[f32; 3]>,
    /// What stands there, if that is merged.
    merges: Vec<Option<Merge>>,
    triangles: Vec<[u32; 3]>,
    /// For triangles without a merged corner, of polygons that have one, what has the largest node there. Sorted.
    lone: Vec<(u32, Merge)>,
}

impl LeafTriangles {
    /// Those that are wanted of a leaf, with what is merged so far.
    pub(super) fn of(
        field: &LevelSet,
        leaf: u32,
        across: &CrossLeafMerges,
        wanted: &EdgeFilter,
    ) -> Result<LeafTriangles> {
        let mut made = LeafTriangles::default();
        // No other leaf has polygons.
        if !field.leaves.get(leaf).changes {
            return Ok(made);
        }
        let (bytes, names) = named_facets(field, leaf, wanted)?;
        if bytes.is_empty() {
            return Ok(made);
        }
        let mut numbering = Numbering::new(field, across, &names)?;
        let facets = each_whole(&bytes);
        made.triangles.reserve(facets.len());
        // The triangles so far of the last polygon that has a merged vertex, and whether all of them have.
        let (mut polygon, mut is_whole, mut last): (Vec<u32>, bool, u32) = (Vec::new(), true, 0);
        for (triangle, facet) in (0..).zip(facets) {
            let mut corners = [0; 3];
            for (n, corner) in corners.iter_mut().enumerate() {
                *corner = numbering.number(&mut made, MergeMark::split(facet.ids[n]).0, facet.corners[n])?;
            }
            made.triangles.push(corners);
            let (_, mark) = MergeMark::split(facet.ids[0]);
            if mark == 0 {
                continue;
            }
            if mark != last {
                made.add_lone(&polygon, is_whole);
                polygon.clear();
                (is_whole, last) = (true, mark);
            }
            polygon.push(triangle);
            is_whole &= corners.iter().any(|corner| made.merges[*corner as usize].is_some());
        }
        made.add_lone(&polygon, is_whole);
        Ok(made)
    }

    /// Notes what is merged at the triangles of a polygon for those that have no merged corner, unless it `is_whole`: none.
    fn add_lone(&mut self, polygon: &[u32], is_whole: bool) {
        if is_whole {
            return;
        }
        let merges =
            |triangle: u32| self.triangles[triangle as usize].map(|corner| self.merges[corner as usize]);
        let largest = polygon.iter().flat_map(|triangle| merges(*triangle)).fold(None, larger);
        let Some(largest) = largest else { return };
        let is_lone = |triangle: &&u32| merges(**triangle).iter().all(Option::is_none);
        let lone: Vec<(u32, Merge)> = polygon.iter().filter(is_lone).map(|n| (*n, largest)).collect();
        self.lone.extend(lone);
    }

    /// Positions of the corners of the triangles at vertices of several leaves, and what is merged there.
    pub(super) fn wide(&self) -> impl Iterator<Item = ([[f32; 3]; 3], [Option<Merge>; 3])> + '_ {
        let wide = self.triangles.iter().filter(|corners| self.is_wide(corners));
        wide.map(|corners| (self.corners(corners), corners.map(|corner| self.merges[corner as usize])))
    }

    /// Boxes of the other triangles.
    pub(super) fn boxes(&self) -> impl Iterator<Item = Bounds> + '_ {
        let others = self.triangles.iter().filter(|corners| !self.is_wide(corners));
        others.map(|corners| bounds(&self.corners(corners)))
    }

    /// Adds the other triangles to a room, as far as it wants them.
    pub(super) fn add_to(&self, room: &mut TriangleGrid, is_fresh: bool) {
        room.reserve(self.places.len());
        let mut numbers = vec![NONE; self.places.len()];
        let mut lone = self.lone.iter().peekable();
        for (triangle, corners) in (0..).zip(&self.triangles) {
            let lone = lone.next_if(|(at, _)| *at == triangle).map(|(_, merge)| *merge);
            let own = bounds(&self.corners(corners));
            if self.is_wide(corners) || !room.wants(&own) {
                continue;
            }
            let corners = corners.map(|corner| {
                let (number, corner) = (&mut numbers[corner as usize], corner as usize);
                if *number == NONE {
                    *number = room.number(self.places[corner], self.merges[corner]);
                }
                *number
            });
            room.add(corners, &own, lone, is_fresh);
        }
    }

    fn is_wide(&self, corners: &[u32; 3]) -> bool {
        corners.iter().any(|corner| is_wide(self.merges[*corner as usize]))
    }

    /// Positions of the corners of a triangle.
    #[inline]
    fn corners(&self, corners: &[u32; 3]) -> [[f32; 3]; 3] {
        corners.map(|corner| self.places[corner as usize])
    }
}

/// What has the larger node.
fn larger(a: Option<Merge>, b: Option<Merge>) -> Option<Merge> {
    a.into_iter().chain(b).max_by_key(|(taken, level)| (*level, *taken))
}

/// Numbers the corners of a leaf's triangles by their names.
struct Numbering<'a> {
    field: &'a LevelSet<'a>,
    across: &'a CrossLeafMerges,
    places: Vec<Place<'a>>,
}

/// Vertices of one leaf whose names count from the same place.
struct Place<'a> {
    leaf: u32,
    /// The number there of the first one.
    first: u32,
    /// Those that the leaf has for several, its first ones.
    wide: &'a [u32],
    /// All, when they are needed.
    vertices: Option<LeafVertices>,
    /// The numbers of those met.
    numbers: Vec<u32>,
}

impl<'a> Numbering<'a> {
    fn new(
        field: &'a LevelSet<'a>,
        across: &'a CrossLeafMerges,
        names: &TriangleNames,
    ) -> Result<Numbering<'a>> {
        let places = names.places(MergeMark::MOST_PLACES)?.iter().map(|&(leaf, first)| Place {
            leaf,
            first,
            wide: across.numbered(leaf),
            vertices: None,
            numbers: Vec::new(),
        });
        Ok(Numbering { field, across, places: places.collect() })
    }

    /// The number of the vertex with a name, which is added when it is first met.
    #[inline]
    fn number(&mut self, made: &mut LeafTriangles, name: u32, position: [f32; 3]) -> Result<u32> {
        let [place, within] = TriangleNames::split(name);
        if let Some(&number) = self.places[place].numbers.get(within)
            && number != NONE
        {
            return Ok(number);
        }
        let number = made.places.len() as u32;
        made.places.push(position);
        made.merges.push(self.merge(place, within)?);
        let numbers = &mut self.places[place].numbers;
        if numbers.len() <= within {
            numbers.resize(within + 1, NONE);
        }
        numbers[within] = number;
        Ok(number)
    }

    /// What a vertex stands for, if it is merged.
    fn merge(&mut self, place: usize, within: usize) -> Result<Option<Merge>> {
        let Place { leaf, first, wide, vertices, .. } = &mut self.places[place];
        let number = *first + within as u32;
        if let Some(taken) = self.across.taken(wide, number) {
            return Ok(Some(taken));
        }
        let vertices = match vertices {
            Some(vertices) => vertices,
            None => vertices.insert(self.field.vertices(*leaf)?),
        };
        let candidate = vertices.what_is_merged().and_then(|merged| merged.candidate(number));
        Ok(candidate.map(|(candidate, node)| (MergeTarget::Candidate(*leaf, candidate), node.level)))
    }
}
