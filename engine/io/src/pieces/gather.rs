//! Facets joined to pieces over their edges, and what each piece encloses.

use super::Consistency;
use super::edges::{Edges, FacetSide, for_edges};
use super::oriented::Bits;
use super::sets::ParitySets;
use crate::check::{IndexedMesh, is_whole};
use crate::error::Result;
use crate::lattice::Units;
use crate::progress::Progress;

/// What belongs to no piece.
pub(super) const NO_PIECE: u32 = u32::MAX;

/// Facets that hang together.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SurfacePiece {
    /// Number of the first facet.
    pub first: u32,
    pub facets: u32,
    /// Of these, those that run against the rest.
    pub against: u32,
    /// Six times the volume, in cubes of two units: exact, and of a closed piece only.
    pub six_volumes: i128,
    pub low: Units,
    pub high: Units,
    /// A facet is missing at an edge.
    pub open: bool,
    /// Facets face both sides, and cannot be, or are not to be, made consistent.
    pub mixed: bool,
}

impl SurfacePiece {
    fn new(first: u32) -> SurfacePiece {
        SurfacePiece {
            first,
            facets: 0,
            against: 0,
            six_volumes: 0,
            low: [i32::MAX; 3],
            high: [i32::MIN; 3],
            open: false,
            mixed: false,
        }
    }

    /// Whether its volume has a sign.
    pub fn is_solid(&self) -> bool {
        !self.open && !self.mixed && self.six_volumes != 0
    }

    /// Whether it is a solid that faces inward.
    pub fn is_reversed(&self) -> bool {
        self.is_solid() && self.six_volumes < 0
    }
}

/// All pieces.
pub(super) struct PieceTable {
    /// In the order of their first facets.
    pub pieces: Vec<SurfacePiece>,
    /// The piece of each facet, or [`NO_PIECE`].
    pub of_facet: Vec<u32>,
    /// Facets that are to be turned over for their piece to be consistent.
    against: Bits,
}

impl PieceTable {
    /// Whether a facet is to be turned over for its piece to be consistent.
    pub fn is_against(&self, facet: u32) -> bool {
        self.against.has(facet as usize)
    }

    /// The facets that are turned over if so are the pieces for which `turned` holds.
    pub fn turned(&self, turned: &[bool]) -> Bits {
        let mut bits = Bits::new(self.of_facet.len());
        for (facet, &piece) in self.of_facet.iter().enumerate() {
            if piece != NO_PIECE && self.against.has(facet) != turned[piece as usize] {
                bits.set(facet);
            }
        }
        bits
    }
}

/// Facets with a mark, and their sets.
struct FacetUnion {
    sets: ParitySets,
    consistency: Consistency,
    open: Bits,
    mixed: Bits,
    /// Sides at edges of more than two facets, edge by edge.
    crowded: Vec<FacetSide>,
    ends: Vec<u32>,
}

/// Finds the pieces of a mesh.
///
/// # Errors
/// If the user interrupts.
pub(super) fn gather(
    mesh: &IndexedMesh<Units>,
    consistency: Consistency,
    progress: &dyn Progress,
) -> Result<PieceTable> {
    let facets = mesh.triangles.len();
    let mut joining = FacetUnion {
        sets: ParitySets::new(facets),
        consistency,
        open: Bits::new(facets),
        mixed: Bits::new(facets),
        crowded: Vec::new(),
        ends: Vec::new(),
    };
    for_edges(mesh, progress, |edges| joining.take(edges))?;
    joining.drop_matched();
    progress.check()?;
    joining.match_crowded();
    progress.check()?;
    Ok(joining.pieces(mesh))
}

impl FacetUnion {
    /// Joins the facets at edges of two, and keeps those at edges of more.
    fn take(&mut self, edges: Edges) {
        for side in edges.lone {
            self.open.set(side.facet() as usize);
        }
        for [a, b] in edges.pairs {
            self.join(a, b);
        }
        let before = self.crowded.len() as u32;
        self.crowded.extend(edges.crowded);
        self.ends.extend(edges.ends.iter().map(|end| before + end));
    }

    /// Joins two facets at an edge.
    fn join(&mut self, a: FacetSide, b: FacetSide) {
        let same = a.upward() == b.upward();
        let fits = match self.consistency {
            Consistency::Given => self.sets.unite(a.facet(), b.facet(), false) && !same,
            Consistency::Sought => self.sets.unite(a.facet(), b.facet(), same),
        };
        if !fits {
            self.mixed.set(a.facet() as usize);
        }
    }

    /// Whether a facet runs along its edge upward, once its set is consistent, and the set.
    fn seen(&mut self, side: FacetSide) -> (u32, bool) {
        let (set, against) = self.sets.find(side.facet());
        (set, side.upward() != against)
    }

    /// Drops the sides at crowded edges whose set has as many that run the one way as the other: the set is closed
    /// there by itself.
    fn drop_matched(&mut self) {
        let (crowded, ends) = (std::mem::take(&mut self.crowded), std::mem::take(&mut self.ends));
        let (mut kept, mut kept_ends) = (Vec::new(), Vec::new());
        let (mut sets, mut begin) = (Vec::new(), 0);
        for end in ends {
            let edge = &crowded[begin as usize..end as usize];
            begin = end;
            sets.clear();
            sets.extend(edge.iter().map(|&side| {
                let (set, upward) = self.seen(side);
                (set, if upward { 1i64 } else { -1 })
            }));
            sets.sort_unstable();
            let excess = |set: u32| {
                let first = sets.partition_point(|(other, _)| *other < set);
                sets[first..].iter().take_while(|(other, _)| *other == set).map(|(_, way)| way).sum::<i64>()
            };
            let before = kept.len();
            for &side in edge {
                let (set, _) = self.sets.find(side.facet());
                if excess(set) != 0 {
                    kept.push(side);
                }
            }
            if kept.len() > before {
                kept_ends.push(kept.len() as u32);
            }
        }
        (self.crowded, self.ends) = (kept, kept_ends);
    }

    /// Joins the other facets at crowded edges: each, in the order of the input, with the nearest before it that is
    /// free and runs the other way, or can be made to.
    fn match_crowded(&mut self) {
        let (crowded, ends) = (std::mem::take(&mut self.crowded), std::mem::take(&mut self.ends));
        let (mut waiting, mut begin) = (Vec::<FacetSide>::new(), 0);
        for end in ends {
            waiting.clear();
            for &side in &crowded[begin as usize..end as usize] {
                match waiting.last() {
                    Some(&before) if self.can_match(before, side) => {
                        waiting.pop();
                        self.join(before, side);
                    }
                    _ => waiting.push(side),
                }
            }
            begin = end;
            // What is left runs the same way, so that every second one would have to be turned.
            for pair in waiting.chunks(2) {
                match *pair {
                    [a, b] => {
                        self.sets.unite(a.facet(), b.facet(), false);
                        self.mixed.set(a.facet() as usize);
                    }
                    _ => self.open.set(pair[0].facet() as usize),
                }
            }
        }
    }

    fn can_match(&mut self, a: FacetSide, b: FacetSide) -> bool {
        let ((set_a, upward_a), (set_b, upward_b)) = (self.seen(a), self.seen(b));
        let may_be_turned = self.consistency == Consistency::Sought && set_a != set_b;
        upward_a != upward_b || may_be_turned
    }

    /// Numbers the sets and adds up what they enclose.
    fn pieces(mut self, mesh: &IndexedMesh<Units>) -> PieceTable {
        let facets = mesh.triangles.len();
        let (mut pieces, mut of_facet) = (Vec::<SurfacePiece>::new(), vec![NO_PIECE; facets]);
        let mut against = Bits::new(facets);
        for (facet, triangle) in mesh.triangles.iter().enumerate() {
            if !is_whole(triangle) {
                continue;
            }
            // A set is named by its first facet, which was here before.
            let (first, is_against) = self.sets.find(facet as u32);
            if first as usize == facet {
                of_facet[facet] = pieces.len() as u32;
                pieces.push(SurfacePiece::new(first));
            }
            let number = of_facet[first as usize];
            of_facet[facet] = number;
            let piece = &mut pieces[number as usize];
            piece.add(triangle.map(|v| mesh.positions[v as usize]), is_against);
            piece.open |= self.open.has(facet);
            piece.mixed |= self.mixed.has(facet);
            if is_against {
                against.set(facet);
            }
        }
        let mut gathered = PieceTable { pieces, of_facet, against };
        gathered.settle();
        gathered
    }
}

impl SurfacePiece {
    /// Adds a facet.
    fn add(&mut self, corners: [Units; 3], is_against: bool) {
        for corner in corners {
            self.low = std::array::from_fn(|a| self.low[a].min(corner[a]));
            self.high = std::array::from_fn(|a| self.high[a].max(corner[a]));
        }
        // Vertices are even. Products of two coordinates stay below 2^47, so cross products fit 64 bits.
        let [p, q, r] = corners.map(|corner| corner.map(|c| i64::from(c / 2)));
        let cross = [q[1] * r[2] - q[2] * r[1], q[2] * r[0] - q[0] * r[2], q[0] * r[1] - q[1] * r[0]];
        let six: i128 = (0..3).map(|a| i128::from(p[a]) * i128::from(cross[a])).sum();
        self.six_volumes += if is_against { -six } else { six };
        self.facets += 1;
        self.against += u32::from(is_against);
    }
}

impl PieceTable {
    /// Chooses the way of each piece in which fewer facets are turned, and leaves those alone that have none.
    fn settle(&mut self) {
        let is_swapped = |piece: &SurfacePiece| 2 * u64::from(piece.against) > u64::from(piece.facets);
        let swapped: Vec<bool> = self.pieces.iter().map(is_swapped).collect();
        for (piece, _) in self.pieces.iter_mut().zip(&swapped).filter(|(_, swapped)| **swapped) {
            piece.against = piece.facets - piece.against;
            piece.six_volumes = -piece.six_volumes;
        }
        let mut against = Bits::new(self.of_facet.len());
        for (facet, &number) in self.of_facet.iter().enumerate() {
            if number == NO_PIECE || self.pieces[number as usize].mixed {
                continue;
            }
            if self.against.has(facet) != swapped[number as usize] {
                against.set(facet);
            }
        }
        self.against = against;
    }
}
