// Samples of bricks from the triangles that touch them; twin of `winding/evaluate.rs`.
//
// `collect` adds up the jumps of the winding number on the way to each sample, `walk` follows them from the corner and
// finds the sign changes on the way.

var<private> jump: array<i32, 3>;

fn hit(axis: u32, brick: u32, line: vec2<u32>, lower: u32, offset: u32) {
    // The line's indices are those of the axes that follow in cyclic order.
    var index: u32;
    if axis == 0u {
        index = (line.y * POINTS + line.x) * POINTS + lower + 1u;
    } else if axis == 1u {
        index = (line.x * POINTS + lower + 1u) * POINTS;
    } else {
        index = (lower + 1u) * POINTS * POINTS;
    }
    atomicAdd(&jumps[brick * ROWS * POINTS + index], jump[axis]);
}

@compute @workgroup_size(WORKGROUP)
fn collect(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= batch.pairs {
        return;
    }
    let brick = owners[id.x];
    let shift = bricks[brick].shift;
    let a = vertex(id.x, 0u, brick);
    let b = vertex(id.x, 1u, brick);
    let c = vertex(id.x, 2u, brick);
    let n = normal_of(a, b, c);
    let lead = leading_sign(n);
    jump = array<i32, 3>(-sign_of(n[0]), -sign_of(n[1]), -sign_of(n[2]));
    scan(0u, brick, a, b, c, lead, shift, vec2(i32(CELLS), i32(CELLS)), false);
    scan(1u, brick, a.yzx, b.yzx, c.yzx, lead, shift, vec2(i32(CELLS), 0i), false);
    scan(2u, brick, a.zxy, b.zxy, c.zxy, lead, shift, vec2(0i, 0i), false);
}

// First samples of all rows.
var<workgroup> row_starts: array<i32, 1089>;
// Sign-changing edges of each invocation's rows, by axis; then of those before them.
var<workgroup> sums: array<vec3<u32>, 64>;
var<workgroup> total: vec3<u32>;
var<workgroup> room_from: u32;

fn jump_to(brick: u32, index: u32) -> i32 {
    return atomicLoad(&jumps[brick * ROWS * POINTS + index]);
}

// The first samples of all rows: up the column, then along the face.
fn start_rows(brick: u32, me: u32) {
    if me == 0u {
        var w = bricks[brick].corner;
        row_starts[0] = w;
        for (var k = 1u; k < POINTS; k++) {
            w += jump_to(brick, k * ROWS);
            row_starts[k * POINTS] = w;
        }
    }
    workgroupBarrier();
    if me < POINTS {
        var w = row_starts[me * POINTS];
        for (var j = 1u; j < POINTS; j++) {
            w += jump_to(brick, (me * POINTS + j) * POINTS);
            row_starts[me * POINTS + j] = w;
        }
    }
    workgroupBarrier();
}

// The samples of two rows, which begin at a whole word; returns what was found.
fn walk_rows(brick: u32, pair: u32) -> u32 {
    let corner = bricks[brick].corner;
    let first = 2u * pair * POINTS;
    let table = brick * TABLE_WORDS + 4u * pair;
    var found = 0u;
    var word = 0u;
    var w = 0i;
    var bits = vec2(0u, 0u);
    for (var step = 0u; step < 2u * POINTS; step++) {
        let second = step >= POINTS;
        let i = select(step, step - POINTS, second);
        let row = 2u * pair + u32(second);
        if row >= ROWS {
            break;
        }
        if i == 0u {
            w = row_starts[row];
            bits = vec2(0u, 0u);
        } else {
            w += jump_to(brick, row * POINTS + i);
        }
        if w != corner { found |= VARIES; }
        if w != ((w << 16u) >> 16u) { found |= EXCESS; }
        let is_inside = u32(w >= 1i);
        if i < 32u { bits.x |= is_inside << i; } else { bits.y = is_inside; }
        let value = bitcast<u32>(w) & 0xffffu;
        if (step & 1u) == 0u {
            word = value;
            // The last row ends in the middle of a word.
            if row == ROWS - 1u && i == CELLS {
                samples[brick * SAMPLE_WORDS + ((first + step) >> 1u)] = word;
            }
        } else {
            samples[brick * SAMPLE_WORDS + ((first + step) >> 1u)] = word | (value << 16u);
        }
        if i == CELLS {
            let at = table + select(0u, 2u, second);
            tables[at] = bits.x;
            tables[at + 1u] = bits.y;
        }
    }
    return found;
}

fn count_bits(bits: vec2<u32>) -> u32 {
    return countOneBits(bits.x) + countOneBits(bits.y);
}

// Edges of the rows that an invocation looks after.
fn count_edges(brick: u32, rows: vec2<u32>) -> vec3<u32> {
    var sum = vec3(0u, 0u, 0u);
    for (var row = rows.x; row < rows.y; row++) {
        sum += vec3(
            count_bits(changes(brick, 0u, row)),
            count_bits(changes(brick, 1u, row)),
            count_bits(changes(brick, 2u, row)),
        );
    }
    return sum;
}

// Gives every edge of those rows its place, and puts down the winding number from which it begins.
fn place_edges(brick: u32, rows: vec2<u32>, before: vec3<u32>) {
    var next = before;
    for (var row = rows.x; row < rows.y; row++) {
        for (var axis = 0u; axis < 3u; axis++) {
            tables[rank_of(brick, axis, row)] = next[axis];
            let both = changes(brick, axis, row);
            for (var half = 0u; half < 2u; half++) {
                var bits = both[half];
                while bits != 0u {
                    let i = 32u * half + firstTrailingBit(bits);
                    bits &= bits - 1u;
                    atomicStore(&heads[next[axis]], NONE);
                    starts[next[axis]] = bitcast<u32>(sample(brick, row * POINTS + i));
                    next[axis] += 1u;
                }
            }
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn walk(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) me: u32) {
    let brick = group.x;
    start_rows(brick, me);
    var found = 0u;
    for (var pair = me; pair < (ROWS + 1u) / 2u; pair += WORKGROUP) {
        found |= walk_rows(brick, pair);
    }
    if found != 0u {
        atomicOr(&bricks[brick].flags, found);
    }
    storageBarrier();
    workgroupBarrier();
    let each = (ROWS + WORKGROUP - 1u) / WORKGROUP;
    let rows = min(vec2(me * each, (me + 1u) * each), vec2(ROWS));
    sums[me] = count_edges(brick, rows);
    workgroupBarrier();
    if me == 0u {
        var before = vec3(0u, 0u, 0u);
        for (var other = 0u; other < WORKGROUP; other++) {
            let own = sums[other];
            sums[other] = before;
            before += own;
        }
        total = before;
        let edges = before.x + before.y + before.z;
        room_from = atomicAdd(&batch.edges, edges);
        bricks[brick].edges_from = room_from;
        bricks[brick].edges_x = before.x;
        bricks[brick].edges_y = before.y;
        if room_from > batch.edges_max || edges > batch.edges_max - room_from {
            room_from = NONE;
            bricks[brick].edges = 0u;
            atomicOr(&bricks[brick].flags, FULL);
        } else {
            bricks[brick].edges = edges;
        }
    }
    workgroupBarrier();
    if room_from != NONE {
        let along = vec3(0u, total.x, total.x + total.y);
        place_edges(brick, rows, sums[me] + along + vec3(room_from));
    }
}
