// Hermite edges of bricks; twin of `winding/hermite.rs` and `winding/passages.rs`.
//
// `tag` finds the crossings of sign-changing edges. Most edges have one, which is written where the Hermite edge belongs.
// Others are chained, and `resolve` finds the one where the running count passes 0.5.

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
    let is_last = i == CELLS;
    let kind = select(2u * axis - 1u, 0u, axis == 0u);
    let bits = tables[changes_at(brick, kind, row)];
    var below = bits & ((1u << (i & 31u)) - 1u);
    var changed = (bits >> (i & 31u)) & 1u;
    if is_last {
        below = bits;
        changed = tables[changes_at(brick, kind + 1u, row)];
    }
    if changed == 0u {
        return;
    }
    let place = tables[rank_at(brick, axis, row)] + countOneBits(below);
    let offset_and_way = offset | (u32(jump_falls[axis]) << 16u);
    if atomicAdd(&chains[2u * place], 1u) == 0u {
        hermite[2u * place] = offset_and_way;
        hermite[2u * place + 1u] = oct_normal;
        return;
    }
    let record = atomicAdd(&batch.records, 1u);
    if record >= batch.records_max {
        atomicOr(&bricks[brick].flags, FULL);
        return;
    }
    let at = RECORD_WORDS * record;
    records[at] = atomicExchange(&chains[2u * place + 1u], record + 1u);
    records[at + 1u] = offset_and_way;
    records[at + 2u] = oct_normal;
    records[at + 3u] = place;
    records[at + 4u] = (brick << 16u) | (row * POINTS + i);
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
    let origin = origin_of(brick);
    var a = vertex(id.x, 0u) - origin;
    var b = vertex(id.x, 1u) - origin;
    var c = vertex(id.x, 2u) - origin;
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

// The winding number at a sample.
fn sample(brick: u32, index: u32) -> i32 {
    let row = index / POINTS;
    let i = index % POINTS;
    if rows[(2u * brick + 1u) * ROWS + row] == 0u {
        return bitcast<i32>(rows[2u * brick * ROWS + row]);
    }
    let word = samples[brick * SAMPLE_WORDS + row * ROW_WORDS + (i >> 1u)];
    return extractBits(bitcast<i32>(word), 16u * (i & 1u), 16u);
}

// Crossings at one offset: how the winding number changes there, and the smallest normal of those where it rises and of
// those where it falls.
struct Step {
    offset: i32,
    jump: i32,
    rising: u32,
    falling: u32,
}

fn with_crossing(step: Step, last: i32, offset_and_way: u32, normal: u32) -> Step {
    var out = step;
    let offset = i32(offset_and_way & 0xffffu);
    if offset <= last || offset > step.offset {
        return out;
    }
    if offset < step.offset {
        out = Step(offset, 0i, 0xffffffffu, 0xffffffffu);
    }
    if (offset_and_way >> 16u) == 0u {
        out.jump += 1i;
        out.rising = min(out.rising, normal);
    } else {
        out.jump -= 1i;
        out.falling = min(out.falling, normal);
    }
    return out;
}

// Finds the crossing of an edge at which the running count passes 0.5; `head` is its last record, from 1. Returns what
// is wrong, if anything is.
fn decide(place: u32, head: u32, start: i32) -> u32 {
    let first = vec2(hermite[2u * place], hermite[2u * place + 1u]);
    var w = start;
    var last = -1i;
    // Towards 0 from above, by crossings that all go one way, the farthest one counts: offsets are turned round.
    var turned = 0u;
    if start >= 1i {
        var end = start + select(-1i, 1i, (first.x >> 16u) == 0u);
        var rises = (first.x >> 16u) == 0u;
        var at = head;
        while at != 0u {
            steps += 1u;
            let way = records[RECORD_WORDS * (at - 1u) + 1u] >> 16u;
            end += select(-1i, 1i, way == 0u);
            rises = rises || way == 0u;
            at = records[RECORD_WORDS * (at - 1u)];
        }
        if end == 0i && !rises {
            turned = 0xffffu;
            w = 1i;
        }
    }
    loop {
        // All crossings at the next offset count as one step.
        var step = with_crossing(Step(65536i, 0i, 0u, 0u), last, first.x ^ turned, first.y);
        var next = head;
        while next != 0u {
            steps += 1u;
            if steps > STEPS_MAX {
                return CROWDED;
            }
            let at = RECORD_WORDS * (next - 1u);
            step = with_crossing(step, last, records[at + 1u] ^ turned, records[at + 2u]);
            next = records[at];
        }
        if step.offset == 65536i {
            break;
        }
        let before = w;
        w += step.jump;
        if (before >= 1i) != (w >= 1i) {
            hermite[2u * place] = u32(step.offset) ^ turned;
            hermite[2u * place + 1u] = select(step.falling, step.rising, step.jump > 0i);
            return 0u;
        }
        last = step.offset;
    }
    return TORN;
}

@compute @workgroup_size(WORKGROUP)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = min(atomicLoad(&batch.records), batch.records_max);
    steps = 0u;
    for (var record = id.x; record < count; record += groups.x * WORKGROUP) {
        let at = RECORD_WORDS * record;
        // Each chain has one record that is its first.
        if records[at] != 0u {
            continue;
        }
        let brick = records[at + 4u] >> 16u;
        // A brick whose crossings found no room has broken chains.
        if (atomicLoad(&bricks[brick].flags) & FULL) != 0u {
            continue;
        }
        let place = records[at + 3u];
        let start = sample(brick, records[at + 4u] & 0xffffu);
        let wrong = decide(place, atomicLoad(&chains[2u * place + 1u]), start);
        if wrong != 0u {
            atomicOr(&bricks[brick].flags, wrong);
        }
    }
}
