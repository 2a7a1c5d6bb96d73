// Hermite edges of bricks; twin of `winding/hermite.rs` and `winding/passages.rs`.
//
// `tag` finds the crossings of sign-changing edges. Most edges have one, which is written where the Hermite edge belongs.
// Others are chained, and `resolve` finds the one where the running count passes 0.5.

fn tag_one(number: u32) {
    let position = positions[number];
    let edge = low_of(position);
    if edge == NOWHERE {
        return;
    }
    let brick = high_of(position) >> 17u;
    let axis = edge >> 16u;
    let row = (edge & 0xffffu) / POINTS;
    let i = (edge & 0xffffu) % POINTS;
    let rank = tables[rank_at(brick, axis, row)];
    if rank == 0u {
        return;
    }
    let bits = tables[changes_at(brick, axis, row)];
    let is_last = i == CELLS;
    let changes = select((bits >> (i & 31u)) & 1u, rank >> 31u, is_last);
    if changes == 0u {
        return;
    }
    let below = select(bits & ((1u << (i & 31u)) - 1u), bits, is_last);
    let place = (rank & 0x3fffffffu) + countOneBits(below);
    let pair = low_of(crossings[number]);
    let before = atomicAdd(&chains[2u * place], 1u);
    if before == 0u {
        hermite[place] = both(high_of(position) & 0x1ffffu, normals[pair]);
        return;
    }
    crossings[number] = both(pair, atomicExchange(&chains[2u * place + 1u], number + 1u));
    if before == 1u {
        doubles[atomicAdd(&batch.doubles, 1u)] = both(number, place);
    }
}

@compute @workgroup_size(WORKGROUP)
fn tag(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = min(atomicLoad(&batch.crossings), batch.crossings_max);
    for (var number = id.x; number < count; number += groups.x * WORKGROUP) {
        tag_one(number);
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
            let way = (high_of(positions[at - 1u]) >> 16u) & 1u;
            end += select(-1i, 1i, way == 0u);
            rises = rises || way == 0u;
            at = high_of(crossings[at - 1u]);
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
            let offset_and_way = high_of(positions[next - 1u]) & 0x1ffffu;
            let crossing = crossings[next - 1u];
            step = with_crossing(step, last, offset_and_way ^ turned, normals[low_of(crossing)]);
            next = high_of(crossing);
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
        let place = high_of(doubles[double]);
        let position = positions[low_of(doubles[double])];
        let brick = high_of(position) >> 17u;
        // A brick whose crossings found no room has edges that lack some.
        if (atomicLoad(&bricks[brick].flags) & FULL) != 0u {
            continue;
        }
        let start = sample(brick, low_of(position) & 0xffffu);
        let wrong = decide(place, atomicLoad(&chains[2u * place + 1u]), start);
        if wrong != 0u {
            atomicOr(&bricks[brick].flags, wrong);
        }
    }
}
