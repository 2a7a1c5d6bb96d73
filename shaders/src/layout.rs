//! What host and device agree on: constants, and structures in buffers. `build.rs` writes the constants into the
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
    ("TAKEN_WORDS", TAKEN_WORDS),
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
/// caches a brick takes. With 32 bits a jump, and samples beside them, llvmpipe took an eighth more time in all.
pub const LINE_WORDS: u32 = CELLS / 4;
/// Words of a brick's jumps, with one for each line that tells which edges hold some; whole lines of a cache.
pub const JUMP_WORDS: u32 = (LINES * (LINE_WORDS + 1)).next_multiple_of(16);
/// What is added to a word of jumps, which begins as 0, to have four numbers of 8 bits, each 128 more than a jump.
pub const JUMP_BIAS: u32 = 0x8080_8080;
/// Words of a brick in which a bit tells of each sign-changing edge whether it has a crossing: one for each axis and row, and
/// behind those the edges at the rows' last samples.
pub const TAKEN_WORDS: u32 = 3 * ROWS + (3 * ROWS).div_ceil(32);
/// Words of what is known of a brick's rows: for each axis and row bits that say which edges change sign, and how many such
/// edges the rows before hold.
pub const TABLE_WORDS: u32 = 6 * ROWS;
/// Invocations of a workgroup.
pub const WORKGROUP: u32 = 64;
/// Words of a [`Pair`].
pub const PAIR_WORDS: u32 = size_of::<Pair>() as u32 / 4;
/// Facets that one invocation of `brute` sums up, and steps that one of `resolve` takes along chains. Mesa's llvmpipe
/// silently ends loops after 65,535 steps, which it counts for up to 16 invocations together.
pub const STEPS_MAX: u32 = 1 << 11;
/// Binary places of sums of solid angles, in steradians.
pub const ANGLE_BITS: u32 = 36;
/// The powers of a polynomial of the far field add up to less than this.
pub const DEGREE: u32 = 6;
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

/// Names of members with their offsets in bytes.
pub type Members = &'static [(&'static str, usize)];

/// Structures with their names in the shaders, their sizes and their members.
pub const STRUCTURES: &[(&str, usize, Members)] = &[
    ("Batch", size_of::<Batch>(), Batch::MEMBERS),
    ("Brick", size_of::<Brick>(), Brick::MEMBERS),
    ("Sum", size_of::<Sum>(), Sum::MEMBERS),
    ("Sums", size_of::<Sums>(), Sums::MEMBERS),
    ("Block", size_of::<Block>(), Block::MEMBERS),
];

/// Buffers of the kernels that evaluate bricks, by binding.
pub const BRICK_BUFFERS: [&str; 14] = [
    "batch", "bricks", "pairs", "jumps", "taken", "rows", "tables", "chains", "hermite", "spans", "more",
    "normals", "doubles", "seconds",
];
/// Buffers of the kernel that sums solid angles, by binding.
pub const BRUTE_BUFFERS: [&str; 4] = ["sum", "facets", "points", "angles"];
/// Buffers of the kernel that sums over a cluster tree, by binding.
pub const SUM_BUFFERS: [&str; 8] =
    ["clusters", "elements", "sums", "blocks", "coefficients", "terms", "rows", "quanta"];
