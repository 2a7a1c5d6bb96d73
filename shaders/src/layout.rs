//! What host and device agree on: constants, and structures in buffers. `tests/spirv.rs` writes the constants into the
//! shaders and holds the structures against what naga makes of their twins there.

use bytemuck::{Pod, Zeroable};

/// Constants of the shaders by name, all of them unsigned.
pub const CONSTANTS: &[(&str, u32)] = &[
    ("POINTS", POINTS),
    ("CELLS", CELLS),
    ("ROWS", ROWS),
    ("LINES", LINES),
    ("LINE_WORDS", LINE_WORDS),
    ("JUMP_WORDS", JUMP_WORDS),
    ("JUMP_BIAS", JUMP_BIAS),
    ("WORKGROUP", WORKGROUP),
    ("VARIES", VARIES),
    ("EXCESS", EXCESS),
    ("FULL", FULL),
    ("TORN", TORN),
    ("CROWDED", CROWDED),
    ("STEPS_MAX", STEPS_MAX),
    ("PAIR_WORDS", PAIR_WORDS),
    ("ANGLE_BITS", ANGLE_BITS),
    ("DEGREE", DEGREE),
    ("COEFFICIENTS", COEFFICIENTS),
    ("CLUSTER_WORDS", CLUSTER_WORDS),
    ("ELEMENT_WORDS", ELEMENT_WORDS),
    ("TERM_BITS", TERM_BITS),
    ("UNSURE", UNSURE),
    ("FIELD_WORDS", FIELD_WORDS),
    ("VALUE_WORDS", VALUE_WORDS),
    ("PAGE_HEADER_WORDS", PAGE_HEADER_WORDS),
    ("COUNT_WORDS", COUNT_WORDS),
    ("BLOCKS", BLOCKS),
    ("TILE", TILE),
    ("RAY_STEPS_MAX", RAY_STEPS_MAX),
    ("RESIDENT", RESIDENT),
    ("SEEN", SEEN),
    ("TOLD", TOLD),
    ("UNIFORM", UNIFORM),
    ("OPAQUE", OPAQUE),
    ("COUNTED", COUNTED),
    ("SHADED", SHADED),
    ("PALETTE_AT", PALETTE_AT),
    ("OPACITIES_AT", OPACITIES_AT),
    ("COLOURS_AT", COLOURS_AT),
];

/// Samples along a brick's axis.
pub const POINTS: u32 = 33;
/// Lattice edges along a brick's axis.
pub const CELLS: u32 = 32;
/// Rows of samples in a brick.
pub const ROWS: u32 = POINTS * POINTS;
/// Lines of edges along which the samples of a brick are found: its rows, those along y in the face x = 0, and the column
/// x = y = 0.
pub const LINES: u32 = ROWS + POINTS + 1;
/// 32-bit words of the jumps along a line, four in each: rows are visited out of order, so what counts is how much of the
/// caches a brick takes.
pub const LINE_WORDS: u32 = CELLS / 4;
/// Words of a brick's jumps, with one for each line that tells which edges hold some; whole lines of a cache.
pub const JUMP_WORDS: u32 = (LINES * (LINE_WORDS + 1)).next_multiple_of(16);
/// What is added to a word of jumps, which begins as 0, to have four numbers of 8 bits, each 128 more than a jump.
pub const JUMP_BIAS: u32 = 0x8080_8080;
/// Words of what is known of a brick's rows: for each axis and row bits that say which edges change sign, and how many such
/// edges the rows before hold.
pub const TABLE_WORDS: u32 = 6 * ROWS;
/// Invocations of a workgroup.
pub const WORKGROUP: u32 = 64;
/// Triangles that touch a brick at most: an edge's crossings, of which a triangle has one at most, are counted in 16 bits.
pub const PAIRS_OF_BRICK_MAX: u32 = 0xffff;
/// Words of a [`Pair`].
pub const PAIR_WORDS: u32 = size_of::<Pair>() as u32 / 4;
/// Facets that one invocation of `brute` sums up, and steps that one of `resolve` takes along chains. Mesa's llvmpipe
/// silently ends loops after 65,535 steps, which it counts for up to 16 invocations together.
pub const STEPS_MAX: u32 = 1 << 11;
/// Binary places of sums of solid angles, in steradians.
pub const ANGLE_BITS: u32 = 36;
/// The powers of a polynomial of the far field add up to less than this.
pub const DEGREE: u32 = 8;
/// Coefficients of such a polynomial.
pub const COEFFICIENTS: u32 = DEGREE * (DEGREE + 1) * (DEGREE + 2) / 6;
/// Words of a cluster: its centre, what rounding took of that, its scale, and the factors of its expansion.
pub const CLUSTER_WORDS: u32 = 26;
/// Words of an element: three vertices, and twice the area vector.
pub const ELEMENT_WORDS: u32 = 12;
/// Clusters and elements of a block at most: see [`STEPS_MAX`].
pub const TERMS_MAX: u32 = STEPS_MAX;
/// Binary places of a term of a block's sum.
pub const TERM_BITS: u32 = 30;
/// In place of a sample that single precision does not decide.
pub const UNSURE: u32 = 1 << 31;

/// Words of a field's numbers, two in each, for a brick that rays pass.
pub const VALUE_WORDS: u32 = (ROWS * POINTS).div_ceil(2);
/// Words of such a field with a bit for each cell that is worth a look.
pub const FIELD_WORDS: u32 = VALUE_WORDS + CELLS * CELLS;
/// Words of whole winding numbers at the samples, four in each.
pub const COUNT_WORDS: u32 = (ROWS * POINTS).div_ceil(4);
/// Blocks of 4³ cells along an axis of a brick.
pub const BLOCKS: u32 = CELLS / 4;
/// Words in front of a page: which fields there are and which surfaces the first sample lies within (from bit 8 on), and two
/// words of bits for each layer of blocks.
pub const PAGE_HEADER_WORDS: u32 = 1 + 2 * BLOCKS;
/// Pixels along the side of a tile: a tile has an invocation of a workgroup for each.
pub const TILE: u32 = 8;
/// Steps after which a ray ends its round before the next brick. Those within a brick come on top, up to some 20 for each of
/// the 94 cells that it passes at most; for why see [`STEPS_MAX`].
pub const RAY_STEPS_MAX: u32 = 1 << 10;
/// In a node's word of the page table: it has the page of the lower bits. Otherwise they are the last round that wanted it.
pub const RESIDENT: u32 = 1 << 31;

/// [`TreeNode::flags`]: something in it may be seen.
pub const SEEN: u32 = 1;
/// [`TreeNode::flags`]: it may stand for what is below.
pub const TOLD: u32 = 2;
/// [`TreeNode::flags`]: its own samples are all the number in the high half.
pub const UNIFORM: u32 = 4;

/// [`Shell::flags`]: nothing is seen behind it.
pub const OPAQUE: u32 = 1;
/// [`Shell::flags`]: it has the colour of the largest winding number beside it.
pub const COUNTED: u32 = 2;
/// [`Shell::flags`], and of a haze in [`Sight::haze`]: there is light on it.
pub const SHADED: u32 = 4;

/// Where the colours of winding numbers from -1 to 6 stand among the tables.
pub const PALETTE_AT: u32 = 0;
/// Where the stops of a haze's opacity stand, by rising w; behind the last ones w is beyond all numbers.
pub const OPACITIES_AT: u32 = 8;
/// Where those of its colour stand.
pub const COLOURS_AT: u32 = OPACITIES_AT + STOPS_MAX;
/// Stops of either at most.
pub const STOPS_MAX: u32 = 256;
/// Entries of the tables.
pub const TABLE_ENTRIES: u32 = COLOURS_AT + STOPS_MAX;

/// [`Brick::flags`]: the samples are not all equal.
pub const VARIES: u32 = 1;
/// [`Brick::flags`]: a sample does not fit 16 bits.
pub const EXCESS: u32 = 2;
/// [`Brick::flags`]: the batch's buffers are too small.
pub const FULL: u32 = 4;
/// [`Brick::flags`]: a sign change without a crossing.
pub const TORN: u32 = 8;
/// [`Brick::flags`]: an edge holds too many crossings, or jumps that do not fit 8 bits.
pub const CROWDED: u32 = 16;

/// A structure of 32-bit members with their names and offsets.
macro_rules! shared {
    ($(#[$doc:meta])* $name:ident { $($(#[$member_doc:meta])* $member:ident: $type:ty,)* }) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        pub struct $name { $($(#[$member_doc])* pub $member: $type,)* }

        impl $name {
            /// Members with their offsets in bytes.
            pub const MEMBERS: Members =
                &[$((stringify!($member), std::mem::offset_of!($name, $member)),)*];
        }
    };
}

shared! {
    /// A batch of bricks.
    Batch {
        /// Pairs of a triangle and a brick that it touches.
        pairs: u32,
        /// Spans of lines on the way to a sample for which there is room.
        way_max: u32,
        /// Other spans for which there is room.
        other_max: u32,
        /// Sign-changing edges for which there is room.
        edges_max: u32,
        /// Crossings of such edges behind their second for which there is room.
        more_max: u32,
        /// Spans found on the way to a sample.
        way_spans: u32,
        /// Other spans found.
        other_spans: u32,
        /// Sign-changing edges found.
        edges: u32,
        /// Crossings of such edges found behind their second.
        more: u32,
        /// Sign-changing edges with several crossings.
        doubles: u32,
    }
}

shared! {
    /// A brick, and what became of it.
    Brick {
        /// The winding number at sample 0.
        corner: i32,
        /// What was found.
        flags: u32,
        /// Where its Hermite edges begin in the batch's.
        edges_from: u32,
        /// How many there are.
        edges: u32,
        /// How many of them lie along x.
        edges_x: u32,
        /// How many lie along y.
        edges_y: u32,
        /// Crossings of triangles with its edges, whether these change sign or not.
        crossings: u32,
    }
}

/// A triangle with a brick that it touches. Shaders see it as words of 64 bits.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Pair {
    /// Its vertices relative to sample 0 of the brick.
    pub vertices: [[i32; 3]; 3],
    /// The brick's number in the batch, and in the high half log₂ of the distance of its samples.
    pub owner: u32,
}

shared! {
    /// A sum over triangles, in parts of [`STEPS_MAX`].
    Sum {
        /// Points at which to sum.
        points: u32,
        /// Triangles to sum.
        facets: u32,
    }
}

shared! {
    /// Samples of a cluster tree's sum, four in a row.
    Sums {
        /// How many rows.
        rows: u32,
        /// Binary places to which they are rounded.
        bits: u32,
    }
}

shared! {
    /// Samples on a lattice that see a cluster tree alike.
    Block {
        /// Position of the first.
        low_x: i32,
        /// Along y.
        low_y: i32,
        /// Along z.
        low_z: i32,
        /// log₂ of their distance.
        spacing: u32,
        /// How many along an axis, at most eight.
        steps: u32,
        /// Where the numbers of its clusters begin; those of its elements follow.
        terms_from: u32,
        /// How many clusters.
        clusters: u32,
        /// How many elements.
        elements: u32,
        /// Constant of the polynomial with [`TERM_BITS`] binary places, the low half.
        base_low: u32,
        /// The high half.
        base_high: u32,
        /// Bound on the error of the polynomial and all clusters.
        bound: f32,
    }
}

shared! {
    /// An eye, what it is shown, and the part of the picture that is drawn. Places are in edges of the root cube from its first
    /// sample, colours from 0 to 255.
    Sight {
        /// The eye; of parallel rays where the one through the picture's upper left corner begins.
        origin: [f32; 4],
        /// From the eye to the picture's upper left corner; the direction of parallel rays.
        corner: [f32; 4],
        /// From a pixel to the next on the right.
        across: [f32; 4],
        /// From a pixel to the one below.
        down: [f32; 4],
        /// Towards the eye.
        towards: [f32; 4],
        /// Towards the stronger lamp.
        key: [f32; 4],
        /// Towards the weaker one.
        fill: [f32; 4],
        /// Half way between the stronger lamp and the eye.
        half: [f32; 4],
        /// Lower corner of what is left by the cuts.
        low: [f32; 4],
        /// Upper corner.
        high: [f32; 4],
        /// What is seen where nothing is, with the opacity from 0 to 1.
        background: [f32; 4],
        /// Light from everywhere, of the stronger lamp, of the weaker one, and gloss.
        lighting: [f32; 4],
        /// Numbers that a haze's field has as 0 and 1, and those between which it is seen.
        volume: [f32; 4],
        /// Length of a haze's opacity; 0 for a cell.
        stretch: f32,
        /// Size of a pixel at the distance below.
        pixel: f32,
        /// From the eye to the middle of the picture.
        distance: f32,
        /// Size in pixels up to which cells stand for those below.
        cell_pixels: f32,
        /// Whether rays are parallel.
        parallel: u32,
        /// Sides that are cuts: bits of lower ones, upper ones from the fourth bit on.
        cuts: u32,
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Rays along the side of a pixel.
        rays: u32,
        /// The first tile that is drawn, by rows of tiles.
        first_tile: u32,
        /// Surfaces.
        shells: u32,
        /// Whether there is a haze (1), and light on it ([`SHADED`]).
        haze: u32,
        /// Stops of its opacity.
        opacities: u32,
        /// Stops of its colour.
        colours: u32,
        /// Words of the winding numbers of a page: none or [`COUNT_WORDS`].
        count_words: u32,
        /// Words of a page.
        page_words: u32,
    }
}

shared! {
    /// A round of rays: each goes on until it ends or comes to a brick that is not there.
    Round {
        /// Its number, from 1 on.
        number: u32,
        /// Rays that go on.
        rays: u32,
        /// Whether they begin.
        first: u32,
        /// Whether coarser bricks stand for those that are not there, or nothing does.
        draft: u32,
        /// Where the numbers of the rays begin in the queue; in the first round they are not there.
        start: u32,
        /// Where those of the rays begin that wait behind this round.
        behind: u32,
        /// Bricks that can be asked for.
        wanted_max: u32,
        /// Rays that wait behind it.
        waiting: u32,
        /// Bricks that rays came to and that were not there.
        wanted: u32,
    }
}

shared! {
    /// A node of a tree that rays pass.
    TreeNode {
        /// Number of its first child, the others following; 0 for none.
        children: u32,
        /// What is known of it.
        flags: u32,
    }
}

shared! {
    /// A surface where w passes a number.
    Shell {
        /// Its colour.
        colour: [f32; 4],
        /// The number.
        w: f32,
        /// The least whole number within.
        least: f32,
        /// Opacity seen from the front.
        opacity: f32,
        /// How much more opaque it is seen from its edge.
        rim: f32,
        /// What it is like.
        flags: u32,
        /// Nothing.
        unused: [u32; 3],
    }
}

shared! {
    /// An eye that sees splats. Places are relative to the middle of what is seen.
    SplatView {
        /// The eye; of parallel rays where the one through the picture's upper left corner begins.
        origin: [f32; 4],
        /// From the eye to the picture's upper left corner; the direction of parallel rays.
        corner: [f32; 4],
        /// From a pixel to the next on the right.
        across: [f32; 4],
        /// From a pixel to the one below.
        down: [f32; 4],
        /// Lower corner of what is left by the cuts.
        low: [f32; 4],
        /// Upper corner.
        high: [f32; 4],
        /// Whether rays are parallel.
        parallel: u32,
        /// Whether there are cuts.
        open: u32,
        /// Whether pixels begin with nothing.
        first: u32,
        /// Nothing.
        unused: u32,
    }
}

shared! {
    /// A tile of [`TILE`]² pixels with some of the splats that may touch it.
    SplatTile {
        /// Its first column of pixels.
        column: u32,
        /// Its first row.
        row: u32,
        /// Where its splats begin.
        splats_from: u32,
        /// How many there are, at most [`STEPS_MAX`].
        splats: u32,
        /// Where its pixels begin.
        pixels_from: u32,
    }
}

shared! {
    /// A splat as it is drawn in a tile.
    TileSplat {
        /// Its centre; how far that is from the middle of its cell, along the normal.
        centre: [f32; 4],
        /// Its unit normal.
        normal: [f32; 4],
        /// A plane n, d that cuts it: of it remains where n · (p - centre) ≤ d.
        first_cut: [f32; 4],
        /// Another.
        second_cut: [f32; 4],
        /// First and last column of pixels that it may touch, in the low and the high half.
        columns: u32,
        /// First and last row.
        rows: u32,
        /// Number of its cell's size.
        size: u32,
        /// How many planes cut it, at most two.
        cuts: u32,
    }
}

/// Names of members with their offsets in bytes.
pub type Members = &'static [(&'static str, usize)];

/// Structures with their names in the shaders, their sizes and their members.
pub const STRUCTURES: &[(&str, usize, Members)] = &[
    ("Batch", size_of::<Batch>(), Batch::MEMBERS),
    ("Brick", size_of::<Brick>(), Brick::MEMBERS),
    ("Sum", size_of::<Sum>(), Sum::MEMBERS),
    ("Sums", size_of::<Sums>(), Sums::MEMBERS),
    ("Block", size_of::<Block>(), Block::MEMBERS),
    ("Sight", size_of::<Sight>(), Sight::MEMBERS),
    ("Round", size_of::<Round>(), Round::MEMBERS),
    ("TreeNode", size_of::<TreeNode>(), TreeNode::MEMBERS),
    ("Shell", size_of::<Shell>(), Shell::MEMBERS),
    ("SplatView", size_of::<SplatView>(), SplatView::MEMBERS),
    ("SplatTile", size_of::<SplatTile>(), SplatTile::MEMBERS),
    ("TileSplat", size_of::<TileSplat>(), TileSplat::MEMBERS),
];

/// Buffers of the kernels that evaluate bricks, by binding.
pub const BRICK_BUFFERS: [&str; 14] = [
    "batch", "bricks", "pairs", "jumps", "counts", "rows", "tables", "chains", "hermite", "spans", "more",
    "normals", "doubles", "seconds",
];
/// Buffers of the kernel that sums solid angles, by binding.
pub const BRUTE_BUFFERS: [&str; 4] = ["sum", "facets", "points", "angles"];
/// Buffers of the kernel that sums over a cluster tree, by binding.
pub const SUM_BUFFERS: [&str; 8] =
    ["clusters", "elements", "sums", "blocks", "coefficients", "terms", "rows", "quanta"];
/// Buffers of the kernels that cast rays, by binding.
pub const RAY_BUFFERS: [&str; 13] = [
    "sight", "shells", "tables", "nodes", "pages", "pool", "used", "round", "wanted", "queue", "light",
    "along", "pixels",
];
/// Buffers of the kernels that draw splats, by binding.
pub const SPLAT_BUFFERS: [&str; 5] = ["view", "sizes", "tiles", "splats", "pixels"];
