// Samples of bricks from the jumps of the winding number; twin of `winding/evaluate.rs`.
//
// `walk` follows the jumps, which `jump` has added up, from the corner to each sample, and finds the sign changes on the
// way. An invocation has a row of samples.

// By z: the sample in the column x = y = 0, and in the high half which edges along y from there on hold crossings.
var<workgroup> starts: array<u64, POINTS>;
// By row: which samples are inside, as bits.
var<workgroup> insides: array<u64, ROWS>;
// Sign-changing edges of each invocation's rows, those along an axis in 16 bits; then of those before them.
var<workgroup> sums: array<u64, WORKGROUP>;
// Whether a sample is inside (INSIDE), and whether one is not (OUTSIDE).
var<workgroup> sides: atomic<u32>;
// Where the brick's edges along each axis begin, and whether there are any and room for them.
var<workgroup> places: vec3<u32>;
var<workgroup> has_room: u32;

fn touched(brick: u32, line: u32) -> u32 {
    return atomicLoad(&jumps[touched_at(brick, line)]);
}

const INSIDE = 1u;
const OUTSIDE = 2u;

// The samples of the column.
fn start_column(brick: u32, me: u32) {
    if me == 0u {
        atomicStore(&sides, 0u);
    }
    if me < POINTS {
        var w = bricks[brick].corner;
        let below = select((1u << (me & 31u)) - 1u, 0xffffffffu, me == CELLS);
        for (var left = touched(brick, COLUMN_LINE) & below; left != 0u; left &= left - 1u) {
            w += jump_to(brick, COLUMN_LINE, countTrailingZeros(left));
        }
        starts[me] = both(bitcast<u32>(w), touched(brick, face_line(me)));
    }
    workgroupBarrier();
}

// The first sample of a row.
fn start_of(brick: u32, row: u32) -> i32 {
    let z = row / POINTS;
    let y = row % POINTS;
    let start = starts[z];
    var w = bitcast<i32>(low_of(start));
    let below = select((1u << (y & 31u)) - 1u, 0xffffffffu, y == CELLS);
    for (var left = high_of(start) & below; left != 0u; left &= left - 1u) {
        w += jump_to(brick, face_line(z), countTrailingZeros(left));
    }
    return w;
}

fn found_at(w: i32, corner: i32) -> u32 {
    return select(0u, VARIES, w != corner) | select(0u, EXCESS, w != extractBits(w, 0u, 16u));
}

// What was found in some rows, and on which sides samples are.
struct Found {
    flags: u32,
    sides: u32,
}

// The samples of a row.
fn walk_row(brick: u32, corner: i32, row: u32, before_row: Found) -> Found {
    let start = start_of(brick, row);
    var found = found_at(start, corner);
    let crossed = touched(brick, row);
    rows[row_at(brick, row)] = both(bitcast<u32>(start), crossed);
    var w = start;
    var bits = select(0lu, 0x1fffffffflu, start >= 1i);
    for (var left = crossed; left != 0u; left &= left - 1u) {
        let edge = countTrailingZeros(left);
        w += jump_to(brick, row, edge);
        found |= found_at(w, corner);
        let before = (2lu << edge) - 1lu;
        bits = (bits & before) | select(0lu, 0x1fffffffflu & ~before, w >= 1i);
    }
    insides[row] = bits;
    let sides = select(0u, INSIDE, bits != 0lu) | select(0u, OUTSIDE, bits != 0x1fffffffflu);
    return Found(before_row.flags | found, before_row.sides | sides);
}

// Which edges change sign that begin in a row, as bits.
struct Changes {
    x: u64,
    y: u64,
    z: u64,
}

// `inside` are the samples of the row, `next` those of the next one.
fn changes_of(row: u32, inside: u64, next: u64) -> Changes {
    let z = insides[min(row + POINTS, ROWS - 1u)];
    return Changes(
        (inside ^ (inside >> 1u)) & 0xfffffffflu,
        select(0lu, inside ^ next, row % POINTS != CELLS),
        select(0lu, inside ^ z, row < CELLS * POINTS),
    );
}

fn count(bits: u64) -> u32 {
    return countOneBits(low_of(bits)) + high_of(bits);
}

// Takes room for the brick's edges; turns the sums into what lies before each invocation's rows.
fn take_room(brick: u32) {
    var total = 0lu;
    for (var other = 0u; other < WORKGROUP; other++) {
        let own = sums[other];
        sums[other] = total;
        total += own;
    }
    let x = low_of(total) & 0xffffu;
    let y = low_of(total) >> 16u;
    let edges = x + y + high_of(total);
    let from_place = atomicAdd(&batch.edges, edges);
    bricks[brick].edges_from = from_place;
    bricks[brick].edges_x = x;
    bricks[brick].edges_y = y;
    if from_place > batch.edges_max || edges > batch.edges_max - from_place {
        atomicOr(&bricks[brick].flags, FULL);
        bricks[brick].edges = 0u;
        has_room = 0u;
        return;
    }
    bricks[brick].edges = edges;
    has_room = edges;
    places = vec3(from_place, from_place + x, from_place + x + y);
}

fn write_table(brick: u32, axis: u32, row: u32, bits: u64, place: u32) {
    tables[table_at(brick, axis, row)] = both(low_of(bits), (1u << 30u) | (high_of(bits) << 31u) | place);
}

@compute @workgroup_size(WORKGROUP)
fn walk(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) me: u32) {
    let brick = group.x;
    let corner = bricks[brick].corner;
    start_column(brick, me);
    var found = Found(0u, 0u);
    for (var row = me; row < ROWS; row += WORKGROUP) {
        found = walk_row(brick, corner, row, found);
    }
    if found.flags != 0u {
        atomicOr(&bricks[brick].flags, found.flags);
    }
    atomicOr(&sides, found.sides);
    workgroupBarrier();
    // An invocation's rows follow each other, so that their edges do. Where all samples are on one side there are none.
    let each = (ROWS + WORKGROUP - 1u) / WORKGROUP;
    let first = min(me * each, ROWS);
    let end = select(first, min(first + each, ROWS), atomicLoad(&sides) == (INSIDE | OUTSIDE));
    var sum = 0lu;
    var inside = insides[min(first, ROWS - 1u)];
    // Rows that have some: a wall along x shows in one of 33, of which the next loop then looks at no other.
    var changing = 0u;
    for (var row = first; row < end; row++) {
        let next = insides[min(row + 1u, ROWS - 1u)];
        let changes = changes_of(row, inside, next);
        sum += both(count(changes.x) | (count(changes.y) << 16u), count(changes.z));
        changing |= u32((changes.x | changes.y | changes.z) != 0lu) << (row - first);
        inside = next;
    }
    sums[me] = sum;
    workgroupBarrier();
    if me == 0u {
        take_room(brick);
    }
    workgroupBarrier();
    if has_room == 0u {
        return;
    }
    let before = sums[me];
    var place = places + vec3(low_of(before) & 0xffffu, low_of(before) >> 16u, high_of(before));
    for (; changing != 0u; changing &= changing - 1u) {
        let row = first + countTrailingZeros(changing);
        let changes = changes_of(row, insides[row], insides[min(row + 1u, ROWS - 1u)]);
        write_table(brick, 0u, row, changes.x, place.x);
        write_table(brick, 1u, row, changes.y, place.y);
        write_table(brick, 2u, row, changes.z, place.z);
        place += vec3(count(changes.x), count(changes.y), count(changes.z));
    }
}
