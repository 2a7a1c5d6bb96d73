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
        atomicOr(&jumps[touched_at(brick, line.y * POINTS + line.x)], bitcast<i32>(1u << lower));
    } else if axis == 1u {
        index = (line.x * POINTS + lower + 1u) * POINTS;
    } else {
        index = (lower + 1u) * POINTS * POINTS;
    }
    atomicAdd(&jumps[brick * JUMP_WORDS + index], jump[axis]);
}

@compute @workgroup_size(WORKGROUP)
fn collect(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= batch.pairs {
        return;
    }
    let brick = owners[id.x];
    let shift = bricks[brick].shift;
    let origin = origin_of(brick);
    let a = vertex(id.x, 0u) - origin;
    let b = vertex(id.x, 1u) - origin;
    let c = vertex(id.x, 2u) - origin;
    let n = normal_of(a, b, c);
    let lead = leading_sign(n);
    jump = array<i32, 3>(-sign_of(n[0]), -sign_of(n[1]), -sign_of(n[2]));
    scan(0u, brick, a, b, c, lead, shift, vec2(i32(CELLS), i32(CELLS)), false);
    scan(1u, brick, a.yzx, b.yzx, c.yzx, lead, shift, vec2(i32(CELLS), 0i), false);
    scan(2u, brick, a.zxy, b.zxy, c.zxy, lead, shift, vec2(0i, 0i), false);
}

// By row: its first sample, later how many sign-changing edges begin there, eight bits an axis.
var<workgroup> row_words: array<i32, ROWS>;
// By row: which samples are inside, those of 0 to 31 as bits, and that of 32.
var<workgroup> low_bits: array<u32, ROWS>;
var<workgroup> high_bit: array<u32, ROWS>;
// Sign-changing edges of each invocation's rows, by axis; then of those before them.
var<workgroup> sums: array<vec3<u32>, WORKGROUP>;

fn jump_to(brick: u32, index: u32) -> i32 {
    return atomicLoad(&jumps[brick * JUMP_WORDS + index]);
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

// The samples of a row, which are written down if they are not all its first one; returns what was found. What is 0 is
// 0 already.
fn walk_row(brick: u32, corner: i32, row: u32) -> u32 {
    let start = row_words[row];
    var found = found_at(start, corner);
    if start != 0i {
        rows[2u * brick * ROWS + row] = bitcast<u32>(start);
    }
    let touched = bitcast<u32>(atomicLoad(&jumps[touched_at(brick, row)]));
    if touched == 0u {
        low_bits[row] = select(0u, 0xffffffffu, start >= 1i);
        high_bit[row] = u32(start >= 1i);
        return found;
    }
    rows[(2u * brick + 1u) * ROWS + row] = touched;
    // The edge before sample 0 holds nothing.
    let to_word = brick * SAMPLE_WORDS + row * ROW_WORDS;
    let from_jump = row * POINTS;
    var w = start;
    var bits = u32(w >= 1i);
    var word = bitcast<u32>(w) & 0xffffu;
    for (var i = 1u; i < POINTS; i++) {
        if ((touched >> (i - 1u)) & 1u) != 0u {
            w += jump_to(brick, from_jump + i);
            found |= found_at(w, corner);
        }
        if (i & 1u) != 0u {
            samples[to_word + (i >> 1u)] = word | (bitcast<u32>(w) << 16u);
        } else {
            word = bitcast<u32>(w) & 0xffffu;
        }
        if i < CELLS {
            bits |= u32(w >= 1i) << i;
        }
    }
    samples[to_word + (CELLS >> 1u)] = word;
    low_bits[row] = bits;
    high_bit[row] = u32(w >= 1i);
    return found;
}

// Which edges change sign that begin in a row, written down if any do; returns how many there are by axis.
fn find_changes(brick: u32, row: u32) -> vec3<u32> {
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
    if x != 0u { tables[changes_at(brick, 0u, row)] = x; }
    if y.x != 0u { tables[changes_at(brick, 1u, row)] = y.x; }
    if y.y != 0u { tables[changes_at(brick, 2u, row)] = y.y; }
    if z.x != 0u { tables[changes_at(brick, 3u, row)] = z.x; }
    if z.y != 0u { tables[changes_at(brick, 4u, row)] = z.y; }
    return vec3(countOneBits(x), countOneBits(y.x) + y.y, countOneBits(z.x) + z.y);
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
        return;
    }
    bricks[brick].edges = edges;
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
        let counts = find_changes(brick, row);
        row_words[row] = i32(counts.x | (counts.y << 8u) | (counts.z << 16u));
        sum += counts;
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
        if packed != 0u {
            tables[rank_at(brick, 0u, row)] = next.x;
            tables[rank_at(brick, 1u, row)] = next.y;
            tables[rank_at(brick, 2u, row)] = next.z;
            next += vec3(packed & 0xffu, (packed >> 8u) & 0xffu, packed >> 16u);
        }
    }
}
