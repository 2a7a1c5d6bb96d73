//! Cells of a cube with their splats, found by place.

/// A splat as a file has it: a plane through a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Splat {
    /// Direction: the sum of its magnitudes is the radius of [`super::Directions`].
    pub normal: [i8; 3],
    /// Signed distance of the plane from the centre of the cell along the normal, in 1/16 of the cell.
    pub offset: i8,
}

/// A splat to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplatInput {
    /// Unit normal in 1/16384.
    pub normal: [i16; 3],
    /// A point of its plane, from the centre of the cell in 1/4096 of the cell.
    pub mean: [i16; 3],
    /// Greatest distance of what it stands for from its plane, in 1/4096 of the cell.
    pub error: u32,
}

/// How two splats of a cell cut each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Clip {
    /// They do not.
    None,
    /// Of each remains what is behind the other's plane: an edge that stands out.
    Convex,
    /// Of each remains what is before the other's plane: an edge that goes in.
    Concave,
}

impl Clip {
    /// Its bits in [`Cell::clips`], as of a pair of [`PAIRS`].
    pub fn of_pair(self, pair: usize) -> u8 {
        (self as u8) << (2 * pair)
    }
}

/// Most splats of a cell.
pub const SPLATS_MAX: usize = 3;
/// Cells of a node along each axis.
pub const NODE_SIDE: usize = 32;
/// Pairs of splats of a cell.
pub const PAIRS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// A cell with splats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// Its place in the cube.
    pub at: [u8; 3],
    /// Its first splat.
    pub first: u32,
    /// How many it has, 1 to [`SPLATS_MAX`].
    pub count: u8,
    /// How they cut each other, two bits for each of [`PAIRS`]: see [`Clip::of_pair`].
    pub clips: u8,
    /// Whether cells of half the size say more.
    pub divided: bool,
}

impl Cell {
    /// How a pair of [`PAIRS`] cuts each other.
    pub fn clip(&self, pair: usize) -> Clip {
        match self.clips >> (2 * pair) & 3 {
            0 => Clip::None,
            1 => Clip::Convex,
            _ => Clip::Concave,
        }
    }
}

/// Cells before one in the order of a unit: three beside it, then those across edges and the corner.
pub const BEFORE: [[i8; 3]; 7] =
    [[-1, 0, 0], [0, -1, 0], [0, 0, -1], [-1, -1, 0], [-1, 0, -1], [0, -1, -1], [-1, -1, -1]];

/// Which of the cells before one there are.
#[derive(Clone, Copy)]
pub struct CellsBefore {
    /// One more than the number of each cell, or 0.
    numbers: [u32; BEFORE.len()],
}

impl CellsBefore {
    /// The cell of a place in `BEFORE`.
    #[inline]
    pub fn get<'a, S>(&self, cells: &'a Cells<S>, n: usize) -> Option<&'a Cell> {
        match self.numbers[n] {
            0 => None,
            number => Some(&cells.piece.cells[number as usize - 1]),
        }
    }

    /// A bit for each that there is.
    #[inline]
    pub fn bits(&self) -> usize {
        self.numbers.iter().enumerate().map(|(n, number)| usize::from(*number != 0) << n).sum()
    }

    /// Those that there are, with their places in `BEFORE`.
    #[inline]
    pub fn each<'a, S>(&'a self, cells: &'a Cells<S>) -> impl Iterator<Item = (usize, &'a Cell)> {
        (0..BEFORE.len()).filter_map(move |n| Some((n, self.get(cells, n)?)))
    }
}

/// Cells of a cube.
#[derive(Clone, Debug)]
pub struct Cells<S> {
    side: usize,
    /// For each place one more than the number of its cell, or 0.
    grid: Vec<u32>,
    /// In the order in which they came.
    pub piece: NodeCells<S>,
}

impl<S: Copy> Cells<S> {
    /// A cube with so many places along each axis, at most 64, with no cells yet.
    pub fn new(side: usize) -> Cells<S> {
        Cells { side, grid: vec![0; side * side * side], piece: NodeCells::new() }
    }

    /// Places along each axis.
    pub fn side(&self) -> usize {
        self.side
    }

    #[inline]
    fn place(&self, at: [u8; 3]) -> usize {
        (usize::from(at[2]) * self.side + usize::from(at[1])) * self.side + usize::from(at[0])
    }

    /// Adds a cell with its splats.
    pub fn push(&mut self, at: [u8; 3], splats: &[S], clips: u8, divided: bool) {
        self.piece.add(at, splats, clips, divided);
        let place = self.place(at);
        self.grid[place] = self.piece.cells.len() as u32;
    }

    /// The cell at a place.
    #[inline]
    pub fn get(&self, at: [u8; 3]) -> Option<&Cell> {
        match self.grid[self.place(at)] {
            0 => None,
            number => Some(&self.piece.cells[number as usize - 1]),
        }
    }

    /// The cell at a place beside another; none outside of the cube.
    #[inline]
    pub fn beside(&self, at: [u8; 3], step: [i8; 3]) -> Option<&Cell> {
        let mut place = [0u8; 3];
        for axis in 0..3 {
            let c = i32::from(at[axis]) + i32::from(step[axis]);
            if c < 0 || c >= self.side as i32 {
                return None;
            }
            place[axis] = c as u8;
        }
        self.get(place)
    }

    /// The numbers of the cells before a place, as `BEFORE` has them.
    #[inline]
    pub fn before(&self, at: [u8; 3]) -> CellsBefore {
        let place = self.place(at);
        let beside = [1, self.side, self.side * self.side];
        let mut numbers = [0; BEFORE.len()];
        for (number, step) in numbers.iter_mut().zip(&BEFORE) {
            if (0..3).all(|axis| step[axis] == 0 || at[axis] > 0) {
                let back = (0..3).map(|axis| if step[axis] == 0 { 0 } else { beside[axis] }).sum::<usize>();
                *number = self.grid[place - back];
            }
        }
        CellsBefore { numbers }
    }

    /// The splats of a cell.
    #[inline]
    pub fn of(&self, cell: &Cell) -> &[S] {
        self.piece.of(cell)
    }

    /// The eight halves along all axes, by octant.
    pub fn octants(&self) -> [NodeCells<S>; 8] {
        let half = (self.side / 2) as u8;
        let mut pieces = [0; 8].map(|_| NodeCells::new());
        for cell in &self.piece.cells {
            let octant = (0..3).map(|axis| usize::from(cell.at[axis] / half) << axis).sum::<usize>();
            pieces[octant].add(cell.at.map(|c| c % half), self.of(cell), cell.clips, cell.divided);
        }
        pieces
    }
}

/// The cells of a node, 32 along each axis, in the order in which they came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeCells<S> {
    /// The cells.
    pub cells: Vec<Cell>,
    /// Their splats.
    pub splats: Vec<S>,
}

impl<S: Copy> NodeCells<S> {
    /// No cells.
    pub fn new() -> NodeCells<S> {
        NodeCells { cells: Vec::new(), splats: Vec::new() }
    }

    /// Adds a cell with its splats.
    pub fn add(&mut self, at: [u8; 3], splats: &[S], clips: u8, divided: bool) {
        let (first, count) = (self.splats.len() as u32, splats.len() as u8);
        self.splats.extend_from_slice(splats);
        self.cells.push(Cell { at, first, count, clips, divided });
    }

    /// The splats of a cell.
    #[inline]
    pub fn of(&self, cell: &Cell) -> &[S] {
        &self.splats[cell.first as usize..cell.first as usize + usize::from(cell.count)]
    }

    /// Whether any cell is divided.
    pub fn is_divided(&self) -> bool {
        self.cells.iter().any(|cell| cell.divided)
    }

    /// The cells, found by place.
    pub fn found_by_place(&self) -> Cells<S> {
        let mut cells = Cells::new(NODE_SIDE);
        for cell in &self.cells {
            cells.push(cell.at, self.of(cell), cell.clips, cell.divided);
        }
        cells
    }
}

impl<S: Copy> Default for NodeCells<S> {
    fn default() -> NodeCells<S> {
        NodeCells::new()
    }
}
