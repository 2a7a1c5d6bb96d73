// Hermite edges of bricks; twin of `winding/hermite.rs` and `winding/passages.rs`.
//
// `tag` chains the crossings of each sign-changing edge, `resolve` finds the one where the running count passes 0.5.

var<private> jump_falls: array<bool, 3>;
var<private> oct_normal: u32;

fn hit(axis: u32, brick: u32, line: vec2<u32>, lower: u32, offset: u32) {
    // The sample at which the edge begins, by its row and its place there.
    var row: u32;
    var i: u32;
    if axis == 0u {
        row = line.y * POINTS + line.x;
        i = lower;
    } else if axis == 1u {
        row = line.x * POINTS + lower;
        i = line.y;
    } else {
        row = lower * POINTS + line.y;
        i = line.x;
    }
    let bits = changes(brick, axis, row);
    let is_high = i == 32u;
    let changed = select((bits.x >> (i & 31u)) & 1u, bits.y, is_high);
    if changed == 0u {
        return;
    }
    let below = select(bits.x & ((1u << (i & 31u)) - 1u), bits.x, is_high);
    let place = tables[rank_of(brick, axis, row)] + countOneBits(below);
    let record = atomicAdd(&batch.records, 1u);
    if record >= batch.records_max {
        atomicOr(&bricks[brick].flags, FULL);
        return;
    }
    records[RECORD_WORDS * record] = atomicExchange(&heads[place], record);
    records[RECORD_WORDS * record + 1u] = offset | (u32(jump_falls[axis]) << 16u);
    records[RECORD_WORDS * record + 2u] = oct_normal;
}

fn magnitude(c: i64) -> i64 {
    return select(c, -c, c < 0li);
}

// A coordinate of the octahedral code, rounded; the divisor is positive.
fn scaled(c: i64, sum: i64) -> i32 {
    let value = c * 65534li + sum;
    var quotient = value / (2li * sum);
    if quotient * (2li * sum) > value {
        quotient -= 1li;
    }
    return i32(quotient);
}

// Twin of `OctNormal::from_integer`.
fn encode_normal(n: array<i64, 3>) -> u32 {
    let largest = max(max(magnitude(n[0]), magnitude(n[1])), magnitude(n[2]));
    if largest == 0li {
        return 0u;
    }
    let high = u32(largest >> 32u);
    let bits = select(64u - countLeadingZeros(high), 32u - countLeadingZeros(u32(largest & 0xffffffffli)), high == 0u);
    let right = max(bits, 31u) - 31u;
    let left = 31u - min(bits, 31u);
    let x = (n[0] >> right) << left;
    let y = (n[1] >> right) << left;
    let z = (n[2] >> right) << left;
    let sum = magnitude(x) + magnitude(y) + magnitude(z);
    var u = scaled(x, sum);
    var v = scaled(y, sum);
    if z < 0li {
        let u_folded = (32767i - abs(v)) * select(1i, -1i, u < 0i);
        let v_folded = (32767i - abs(u)) * select(1i, -1i, v < 0i);
        u = u_folded;
        v = v_folded;
    }
    return (bitcast<u32>(u) & 0xffffu) | (bitcast<u32>(v) << 16u);
}

@compute @workgroup_size(WORKGROUP)
fn tag(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= batch.pairs {
        return;
    }
    let brick = owners[id.x];
    if bricks[brick].edges == 0u {
        return;
    }
    let shift = bricks[brick].shift;
    var a = vertex(id.x, 0u, brick);
    var b = vertex(id.x, 1u, brick);
    var c = vertex(id.x, 2u, brick);
    let n = normal_of(a, b, c);
    let lead = leading_sign(n);
    if lead == 0i {
        return;
    }
    oct_normal = encode_normal(n);
    jump_falls = array<bool, 3>(n[0] > 0li, n[1] > 0li, n[2] > 0li);
    for (var axis = 0u; axis < 3u; axis++) {
        scan(axis, brick, a, b, c, lead, shift, vec2(i32(CELLS), i32(CELLS)), true);
        a = a.yzx;
        b = b.yzx;
        c = c.yzx;
    }
}

// Steps along chains so far.
var<private> steps: u32;

// The crossing of an edge's chain at which the running count passes 0.5; returns what is wrong, if anything is.
fn decide(place: u32) -> u32 {
    let head = atomicLoad(&heads[place]);
    var w = bitcast<i32>(starts[place]);
    var last = -1i;
    var outcome = TORN;
    loop {
        // All crossings at the next offset count as one step; of those that go its way, the smallest normal is taken.
        var nearest = 65536i;
        var jump = 0i;
        var smallest = vec2(NONE, NONE);
        var at = head;
        while at != NONE && steps < STEPS_MAX {
            steps += 1u;
            let offset_and_way = records[RECORD_WORDS * at + 1u];
            let normal = records[RECORD_WORDS * at + 2u];
            at = records[RECORD_WORDS * at];
            let offset = i32(offset_and_way & 0xffffu);
            if offset <= last || offset > nearest {
                continue;
            }
            if offset < nearest {
                nearest = offset;
                jump = 0i;
                smallest = vec2(NONE, NONE);
            }
            if (offset_and_way >> 16u) == 0u {
                jump += 1i;
                smallest.x = min(smallest.x, normal);
            } else {
                jump -= 1i;
                smallest.y = min(smallest.y, normal);
            }
        }
        if at != NONE {
            outcome = CROWDED;
            break;
        }
        if nearest == 65536i {
            break;
        }
        let before = w;
        w += jump;
        if (before >= 1i) != (w >= 1i) {
            atomicStore(&heads[place], select(smallest.y, smallest.x, jump > 0i));
            starts[place] = u32(nearest);
            outcome = 0u;
            break;
        }
        last = nearest;
    }
    return outcome;
}

@compute @workgroup_size(WORKGROUP)
fn resolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) me: u32) {
    let brick = group.x;
    // A brick whose crossings found no room has broken chains.
    if (atomicLoad(&bricks[brick].flags) & FULL) != 0u {
        return;
    }
    let from_place = bricks[brick].edges_from;
    let end = from_place + bricks[brick].edges;
    var wrong = 0u;
    steps = 0u;
    for (var place = from_place + group.y * WORKGROUP + me; place < end; place += RESOLVE_GROUPS * WORKGROUP) {
        wrong |= decide(place);
    }
    if wrong != 0u {
        atomicOr(&bricks[brick].flags, wrong);
    }
}
