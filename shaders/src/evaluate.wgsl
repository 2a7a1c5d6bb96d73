// Samples of bricks from the jumps of the winding number; twin of `winding/evaluate.rs`.
//
// `walk` follows the jumps, which `jump` has added up, from the corner to each sample, and finds the sign changes on the
// way. An invocation has a row of samples.

@group(0) @binding(6) var<storage, read_write> tables: array<u32>;

// By row: its first sample, later what `find_changes` returns.
var<workgroup> row_words: array<i32, ROWS>;
// By row: which samples are inside, those of 0 to 31 as bits, and that of 32.
var<workgroup> low_bits: array<u32, ROWS>;
var<workgroup> high_bit: array<u32, ROWS>;
// Sign-changing edges of each invocation's rows, by axis; then of those before them.
var<workgroup> sums: array<vec3<u32>, WORKGROUP>;

// Whether the brick has edges, and there is room for them.
var<workgroup> has_room: u32;

fn jump_to(brick: u32, index: u32) -> i32 {
    return atomicLoad(&jumps[jump_at(brick, index)]);
}

// The first samples of all rows: up the column, then along the face.
fn start_rows(brick: u32, me: u32) {
    if me == 0u {
        var w = bricks[brick].corner;
        row_words[0] = w;
        for (var k = 1u; k < POINTS; k++) {
            w += jump_to(brick, k * ROWS);
            row_words[k * POINTS] = w;
        }
    }
    workgroupBarrier();
    if me < POINTS {
        var w = row_words[me * POINTS];
        for (var j = 1u; j < POINTS; j++) {
            w += jump_to(brick, (me * POINTS + j) * POINTS);
            row_words[me * POINTS + j] = w;
        }
    }
    workgroupBarrier();
}

fn found_at(w: i32, corner: i32) -> u32 {
    return select(0u, VARIES, w != corner) | select(0u, EXCESS, w != extractBits(w, 0u, 16u));
}

// The samples of a row, of which those behind crossings are written down; returns what was found. What is 0 is 0 already.
fn walk_row(brick: u32, corner: i32, row: u32) -> u32 {
    let start = row_words[row];
    var found = found_at(start, corner);
    if start != 0i {
        rows[2u * brick * ROWS + row] = bitcast<u32>(start);
    }
    let touched = bitcast<u32>(atomicLoad(&jumps[touched_at(brick, row)]));
    if touched != 0u {
        rows[(2u * brick + 1u) * ROWS + row] = touched;
    }
    let to_word = brick * SAMPLE_WORDS + row * ROW_WORDS;
    let from_jump = row * POINTS;
    var w = start;
    var bits = select(0u, 0xffffffffu, start >= 1i);
    var word = 0u;
    var word_at = 0u;
    for (var left = touched; left != 0u; left &= left - 1u) {
        let i = countTrailingZeros(left) + 1u;
        w += jump_to(brick, from_jump + i);
        found |= found_at(w, corner);
        word = select(0u, word, word_at == (i >> 1u)) | ((bitcast<u32>(w) & 0xffffu) << (16u * (i & 1u)));
        word_at = i >> 1u;
        samples[to_word + word_at] = word;
        let behind = select(0xffffffffu << (i & 31u), 0u, i == CELLS);
        bits = select(bits & ~behind, bits | behind, w >= 1i);
    }
    low_bits[row] = bits;
    high_bit[row] = u32(w >= 1i);
    return found;
}

// Which edges change sign that begin in a row, written down if any do but for those at x = 32; returns how many there are
// by axis, eight bits each, and behind these whether those at x = 32 along y and z do.
fn find_changes(brick: u32, row: u32) -> u32 {
    let low = low_bits[row];
    let high = high_bit[row];
    let x = low ^ ((low >> 1u) | (high << 31u));
    var y = vec2(0u, 0u);
    if row % POINTS != CELLS {
        y = vec2(low, high) ^ vec2(low_bits[row + 1u], high_bit[row + 1u]);
    }
    var z = vec2(0u, 0u);
    if row < CELLS * POINTS {
        z = vec2(low, high) ^ vec2(low_bits[row + POINTS], high_bit[row + POINTS]);
    }
    if x != 0u { tables[2u * table_at(brick, 0u, row)] = x; }
    if y.x != 0u { tables[2u * table_at(brick, 1u, row)] = y.x; }
    if z.x != 0u { tables[2u * table_at(brick, 2u, row)] = z.x; }
    let counts = vec3(countOneBits(x), countOneBits(y.x) + y.y, countOneBits(z.x) + z.y);
    return counts.x | (counts.y << 8u) | (counts.z << 16u) | (y.y << 24u) | (z.y << 25u);
}

// What `find_changes` has counted.
fn counted(packed: u32) -> vec3<u32> {
    return (vec3(packed) >> vec3(0u, 8u, 16u)) & vec3(0xffu);
}

// Takes room for the brick's edges; turns the sums into what lies before each invocation's rows.
fn take_room(brick: u32) {
    var total = vec3(0u, 0u, 0u);
    for (var other = 0u; other < WORKGROUP; other++) {
        let own = sums[other];
        sums[other] = total;
        total += own;
    }
    let edges = total.x + total.y + total.z;
    let from_place = atomicAdd(&batch.edges, edges);
    bricks[brick].edges_from = from_place;
    bricks[brick].edges_x = total.x;
    bricks[brick].edges_y = total.y;
    if from_place > batch.edges_max || edges > batch.edges_max - from_place {
        atomicOr(&bricks[brick].flags, FULL);
        bricks[brick].edges = 0u;
        has_room = 0u;
        return;
    }
    bricks[brick].edges = edges;
    has_room = edges;
    for (var other = 0u; other < WORKGROUP; other++) {
        sums[other] += vec3(from_place) + vec3(0u, total.x, total.x + total.y);
    }
}

@compute @workgroup_size(WORKGROUP)
fn walk(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) me: u32) {
    let brick = group.x;
    let corner = bricks[brick].corner;
    start_rows(brick, me);
    var found = 0u;
    for (var row = me; row < ROWS; row += WORKGROUP) {
        found |= walk_row(brick, corner, row);
    }
    if found != 0u {
        atomicOr(&bricks[brick].flags, found);
    }
    workgroupBarrier();
    // An invocation's rows follow each other, so that their edges do.
    let each = (ROWS + WORKGROUP - 1u) / WORKGROUP;
    let first = min(me * each, ROWS);
    let end = min(first + each, ROWS);
    var sum = vec3(0u, 0u, 0u);
    for (var row = first; row < end; row++) {
        let packed = find_changes(brick, row);
        row_words[row] = bitcast<i32>(packed);
        sum += counted(packed);
    }
    sums[me] = sum;
    workgroupBarrier();
    if me == 0u {
        take_room(brick);
    }
    workgroupBarrier();
    var next = sums[me];
    for (var row = first; row < end; row++) {
        let packed = bitcast<u32>(row_words[row]);
        if packed != 0u && has_room != 0u {
            let there = 1u << 30u;
            tables[2u * table_at(brick, 0u, row) + 1u] = there | next.x;
            tables[2u * table_at(brick, 1u, row) + 1u] = there | next.y | ((packed & (1u << 24u)) << 7u);
            tables[2u * table_at(brick, 2u, row) + 1u] = there | next.z | ((packed & (1u << 25u)) << 6u);
            next += counted(packed);
        }
    }
}
