// Hermite edges of bricks; twin of `winding/hermite.rs` and `winding/passages.rs`.
//
// `tag` finds the crossings of sign-changing edges. Most edges have one, which is written where the Hermite edge belongs.
// Others are chained, and `resolve` finds the one where the running count passes 0.5.

@group(0) @binding(6) var<storage, read_write> tables: array<u64>;

// A crossing of a sign-changing edge: its offset with its way, and its normal.
fn tag_crossing(place: u32, crossing: u64, brick: u32, start: u32) {
    let before = atomicAdd(&chains[2u * place], 1u);
    if before == 0u {
        hermite[place] = crossing;
        return;
    }
    let number = atomicAdd(&batch.more, 1u);
    if number >= batch.more_max {
        atomicOr(&bricks[brick].flags, FULL);
        return;
    }
    more[2u * number] = crossing;
    more[2u * number + 1u] = both(atomicExchange(&chains[2u * place + 1u], number + 1u), start | (brick << 16u));
    if before == 1u {
        doubles[atomicAdd(&batch.doubles, 1u)] = both(number, place);
    }
}

fn tag_one(packed: u64) {
    let span = span_of(packed);
    let normal = normals[span.pair];
    let way = select(0u, 1u << 16u, span.jump < 0i);
    var depth = span.depth;
    for (var number = 0u; number < span.lines; number++) {
        let edge = edge_at(span, depth);
        if edge.x >= 0i && edge.x < i32(CELLS) {
            let lower = u32(edge.x);
            let u = span.line.x + number;
            let v = span.line.y;
            let row = select(select(lower * POINTS + v, u * POINTS + lower, span.axis == 1u), v * POINTS + u, span.axis == 0u);
            let i = select(select(u, v, span.axis == 1u), lower, span.axis == 0u);
            let table = tables[table_at(span.brick, span.axis, row)];
            let bits = low_of(table);
            let rank = high_of(table);
            let is_last = i == CELLS;
            let changes = select((bits >> (i & 31u)) & 1u, rank >> 31u, is_last);
            if rank != 0u && changes != 0u {
                let below = select(bits & ((1u << (i & 31u)) - 1u), bits, is_last);
                let place = (rank & 0x3fffffffu) + countOneBits(below);
                let offset = offset_of(edge.y, depth.rest, span.across, span.per_n, span.shift);
                tag_crossing(place, both(offset | way, normal), span.brick, row * POINTS + i);
            }
        }
        depth = next_depth(span, depth);
    }
}

@compute @workgroup_size(WORKGROUP)
fn tag(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    // The spans that lead to samples, and behind their room the others.
    let ways = min(atomicLoad(&batch.way_spans), batch.way_max);
    let count = ways + min(atomicLoad(&batch.other_spans), batch.other_max);
    for (var number = id.x; number < count; number += groups.x * WORKGROUP) {
        tag_one(spans[select(batch.way_max - ways, 0u, number < ways) + number]);
    }
}

// Steps along chains so far.
var<private> steps: u32;

// The winding number at a sample.
fn sample(brick: u32, index: u32) -> i32 {
    let row = index / POINTS;
    let i = index % POINTS;
    let before = select((1u << (i & 31u)) - 1u, 0xffffffffu, i == CELLS);
    let touched = rows[(2u * brick + 1u) * ROWS + row] & before;
    if touched == 0u {
        return bitcast<i32>(rows[2u * brick * ROWS + row]);
    }
    let behind = firstLeadingBit(touched) + 1u;
    let word = samples[brick * SAMPLE_WORDS + row * ROW_WORDS + (behind >> 1u)];
    return extractBits(bitcast<i32>(word), 16u * (behind & 1u), 16u);
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

// Finds the crossing of an edge at which the running count passes 0.5; `head` is its last crossing, from 1. Returns what
// is wrong, if anything is.
fn decide(place: u32, head: u32, start: i32) -> u32 {
    let first = vec2(low_of(hermite[place]), high_of(hermite[place]));
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
            let way = low_of(more[2u * at - 2u]) >> 16u;
            end += select(-1i, 1i, way == 0u);
            rises = rises || way == 0u;
            at = low_of(more[2u * at - 1u]);
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
            let crossing = more[2u * next - 2u];
            step = with_crossing(step, last, low_of(crossing) ^ turned, high_of(crossing));
            next = low_of(more[2u * next - 1u]);
        }
        if step.offset == 65536i {
            break;
        }
        let before = w;
        w += step.jump;
        if (before >= 1i) != (w >= 1i) {
            let normal = select(step.falling, step.rising, step.jump > 0i);
            hermite[place] = both(u32(step.offset) ^ turned, normal);
            return 0u;
        }
        last = step.offset;
    }
    return TORN;
}

@compute @workgroup_size(WORKGROUP)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = atomicLoad(&batch.doubles);
    steps = 0u;
    for (var double = id.x; double < count; double += groups.x * WORKGROUP) {
        let packed = doubles[double];
        let place = high_of(packed);
        let where_from = high_of(more[2u * low_of(packed) + 1u]);
        let brick = where_from >> 16u;
        // A brick whose crossings found no room has edges that lack some.
        if (atomicLoad(&bricks[brick].flags) & FULL) != 0u {
            continue;
        }
        let start = sample(brick, where_from & 0xffffu);
        let wrong = decide(place, atomicLoad(&chains[2u * place + 1u]), start);
        if wrong != 0u {
            atomicOr(&bricks[brick].flags, wrong);
        }
    }
}
