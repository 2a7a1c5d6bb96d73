// Bricks in pages: numbers at samples, trilinear in between, and which cells are worth a look; twin of `render/field.rs`
// and `render/bricks.rs`. A page has its header, winding numbers if they are asked for, and then the fields that it has.

@group(0) @binding(5) var<storage, read> pool: array<u32>;

// Steps of a field to one.
const STEPS = 4096.0;

// The field in a cell: its values at the corners, by octant.
struct Cell {
    low: vec4<f32>,
    high: vec4<f32>,
}

fn has_field(page: u32, number: u32) -> bool {
    return (pool[page] >> number & 1u) != 0u;
}

// Whether a surface's first sample lies inside, which tells of all where there is no field.
fn is_inside(page: u32, number: u32) -> bool {
    return (pool[page] >> (8u + number) & 1u) != 0u;
}

// Where a field of a page begins: there are no gaps for those that it lacks.
fn field_of(page: u32, number: u32) -> u32 {
    let before = countOneBits(pool[page] & ((1u << number) - 1u));
    return page + PAGE_HEADER_WORDS + sight.count_words + before * FIELD_WORDS;
}

fn has_block(page: u32, block: vec3<u32>) -> bool {
    let bit = 8u * block.y + block.x;
    return (pool[page + 1u + 2u * block.z + (bit >> 5u)] >> (bit & 31u) & 1u) != 0u;
}

fn is_active(field: u32, cell: vec3<u32>) -> bool {
    return (pool[field + VALUE_WORDS + CELLS * cell.z + cell.y] >> cell.x & 1u) != 0u;
}

fn point_index(at: vec3<u32>) -> u32 {
    return (at.z * POINTS + at.y) * POINTS + at.x;
}

// Two samples that follow each other along x.
fn pair_at(field: u32, index: u32) -> vec2<f32> {
    let word = pool[field + (index >> 1u)];
    let beyond = pool[field + (index + 1u >> 1u)];
    let first = select(word << 16u, word, (index & 1u) != 0u);
    let second = select(word, beyond << 16u, (index & 1u) != 0u);
    return vec2(f32(bitcast<i32>(first) >> 16u), f32(bitcast<i32>(second) >> 16u)) / STEPS;
}

fn cell_of(field: u32, ijk: vec3<u32>) -> Cell {
    let at = point_index(ijk);
    let above = at + POINTS * POINTS;
    return Cell(
        vec4(pair_at(field, at), pair_at(field, at + POINTS)),
        vec4(pair_at(field, above), pair_at(field, above + POINTS)),
    );
}

// At a place in the cell, 0..1 an axis.
fn value(cell: Cell, at: vec3<f32>) -> f32 {
    let along_z = mix(cell.low, cell.high, at.z);
    let along_y = mix(along_z.xy, along_z.zw, at.y);
    return mix(along_y.x, along_y.y, at.x);
}

// Outward normal of the level through a place: against the gradient. Where that is 0 it is 0.
fn normal_of(cell: Cell, at: vec3<f32>) -> vec3<f32> {
    let along_z = mix(cell.low, cell.high, at.z);
    let along_y = mix(along_z.xy, along_z.zw, at.y);
    let rise_y = along_z.zw - along_z.xy;
    let rise_z = cell.high - cell.low;
    let rise_zy = mix(rise_z.xy, rise_z.zw, at.y);
    let gradient =
        vec3(along_y.y - along_y.x, mix(rise_y.x, rise_y.y, at.x), mix(rise_zy.x, rise_zy.y, at.x));
    return unit(-gradient);
}

fn unit(a: vec3<f32>) -> vec3<f32> {
    let squares = dot(a, a);
    return select(vec3(0.0), a * inverseSqrt(max(squares, 1e-30)), squares > 0.0);
}

// The whole winding number at a sample, from -1 to the last that has a colour of its own.
fn count_at(page: u32, index: u32) -> i32 {
    let word = pool[page + PAGE_HEADER_WORDS + (index >> 2u)];
    return bitcast<i32>(word << (24u - 8u * (index & 3u))) >> 24u;
}

// The largest at the corners of a cell, if the style asks for it.
fn most_of(page: u32, ijk: vec3<u32>) -> i32 {
    if sight.count_words == 0u { return 0; }
    var most = -1;
    for (var c = 0u; c < 8u; c++) {
        most = max(most, count_at(page, point_index(ijk + vec3(c & 1u, c >> 1u & 1u, c >> 2u))));
    }
    return most;
}
