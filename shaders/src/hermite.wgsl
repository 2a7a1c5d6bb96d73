// Hermite edges of bricks; twin of `winding/hermite.rs` and `winding/passages.rs`.
//
// `tag` finds the crossings of sign-changing edges. Most edges have one, which is written where the Hermite edge belongs.
// Others are chained, and `resolve` finds the one where the running count passes 0.5.

// The second crossing of a sign-changing edge: its offset with its way, and its normal. `start` is the sample where the edge
// begins, and in the high half the brick.
fn keep_second(place: u32, crossing: u64, start: u32) {
    seconds[place] = crossing;
    doubles[atomicAdd(&batch.doubles, 1u)] = both(place, start);
}

// One behind the second.
fn keep_more(place: u32, crossing: u64, brick: u32, more_max: u32) {
    let number = atomicAdd(&batch.more, 1u);
    if number >= more_max {
        atomicOr(&bricks[brick].flags, FULL);
        return;
    }
    more[2u * number] = crossing;
    more[2u * number + 1u] = u64(atomicExchange(&chains[place], number + 1u));
}

// A crossing of a sign-changing edge.
struct Tag {
    // Whether there is one, and whether there is one of an edge of the brick, whatever its samples are.
    found: bool,
    is_inside: bool,
    place: u32,
    // Where the edge begins in the brick.
    sample: u32,
    // From the edge's beginning: units, and the rest.
    beyond: i32,
    rest: i64,
}

// A span with the next of its lines.
struct Cursor {
    line: u32,
    depth: Depth,
}

// Looks at the next line.
fn look(span: Span, cursor: Cursor) -> Tag {
    let edge = edge_at(span, cursor.depth);
    let is_inside = edge.x >= 0i && edge.x < i32(CELLS);
    let lower = u32(clamp(edge.x, 0i, i32(CELLS) - 1i));
    let u = span.line.x + cursor.line;
    let v = span.line.y;
    let row = select(select(lower * POINTS + v, u * POINTS + lower, span.axis == 1u), v * POINTS + u, span.axis == 0u);
    let i = select(select(u, v, span.axis == 1u), lower, span.axis == 0u);
    let table = tables[table_at(span.brick, span.axis, row)];
    let bits = low_of(table);
    let rank = high_of(table);
    let is_last = i == CELLS;
    let changes = select((bits >> (i & 31u)) & 1u, rank >> 31u, is_last);
    let below = select(bits & ((1u << (i & 31u)) - 1u), bits, is_last);
    let place = (rank & 0x3fffffffu) + countOneBits(below);
    let found = is_inside && rank != 0u && changes != 0u;
    return Tag(found, is_inside, place, row * POINTS + i, edge.y, cursor.depth.rest);
}

// Loops within loops, so that invocations that run in step come together where less is to be done: llvmpipe goes through
// whatever a loop holds for all of them, and leaves out nothing because it is none's.
// Returns how many crossings the brick's edges have with the span's lines.
fn tag_one(span: Span, more_max: u32) -> u32 {
    let normal = normals[span.pair];
    let way = select(0u, 1u << 16u, span.jump < 0i);
    var cursor = Cursor(0u, span.depth);
    var crossings = 0u;
    loop {
        var tag = Tag(false, false, 0u, 0u, 0i, 0li);
        var crossing = 0lu;
        var before = 0u;
        loop {
            loop {
                if cursor.line >= span.lines {
                    tag.found = false;
                    break;
                }
                tag = look(span, cursor);
                cursor = Cursor(cursor.line + 1u, next_depth(span, cursor.depth));
                crossings += u32(tag.is_inside);
                if tag.found {
                    break;
                }
            }
            before = 0u;
            if !tag.found {
                break;
            }
            let offset = offset_of(tag.beyond, tag.rest, span.across, span.per_n, span.shift);
            crossing = both(offset | way, normal);
            let half = 16u * (tag.place & 1u);
            before = (atomicAdd(&counts[whole(tag.place >> 1u)], 1u << half) >> half) & 0xffffu;
            if before != 0u {
                break;
            }
            hermite[tag.place] = crossing;
        }
        if before == 0u {
            break;
        }
        if before == 1u {
            keep_second(tag.place, crossing, tag.sample | (span.brick << 16u));
        } else {
            keep_more(tag.place, crossing, span.brick, more_max);
        }
    }
    return crossings;
}

@compute @workgroup_size(WORKGROUP)
fn tag(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) me: u32) {
    let more_max = batch.more_max;
    let all = all_spans();
    let part = part_of(all.count, group.x, groups.x);
    // Spans of a brick mostly follow each other, so their crossings are added to its own at once.
    var brick = 0u;
    var crossings = 0u;
    for (var number = part.x + me; number < part.y; number += WORKGROUP) {
        let span = span_of(listed(all, number));
        while brick != span.brick {
            atomicAdd(&bricks[brick].crossings, crossings);
            crossings = 0u;
            brick = span.brick;
        }
        crossings += tag_one(span, more_max);
    }
    while crossings != 0u {
        atomicAdd(&bricks[brick].crossings, crossings);
        crossings = 0u;
    }
}

// Steps along chains so far.
var<private> steps: u32;

// The winding number at a sample.
fn sample(brick: u32, index: u32) -> i32 {
    let row = index / POINTS;
    let i = index % POINTS;
    let before = select((1u << (i & 31u)) - 1u, 0xffffffffu, i == CELLS);
    let packed = rows[row_at(brick, row)];
    var w = bitcast<i32>(low_of(packed));
    for (var left = high_of(packed) & before; left != 0u; left &= left - 1u) {
        w += jump_to(brick, row, countTrailingZeros(left));
    }
    return w;
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

// Finds the crossing of an edge at which the running count passes 0.5. `head` is the last of its crossings behind the
// second, from 1. Returns what is wrong, if anything is.
fn decide(place: u32, head: u32, start: i32) -> u32 {
    let first = vec2(low_of(hermite[place]), high_of(hermite[place]));
    let second = vec2(low_of(seconds[place]), high_of(seconds[place]));
    var w = start;
    var last = -1i;
    // Towards 0 from above, by crossings that all go one way, the farthest one counts: offsets are turned round.
    var turned = 0u;
    if start >= 1i {
        var falls = (first.x >> 16u) + (second.x >> 16u);
        var crossings = 2u;
        for (var at = head; at != 0u; at = low_of(more[2u * at - 1u])) {
            steps += 1u;
            if steps > STEPS_MAX {
                return CROWDED;
            }
            falls += low_of(more[2u * at - 2u]) >> 16u;
            crossings += 1u;
        }
        if falls == crossings && start == i32(falls) {
            turned = 0xffffu;
            w = 1i;
        }
    }
    loop {
        // All crossings at the next offset count as one step.
        var step = with_crossing(Step(65536i, 0i, 0u, 0u), last, first.x ^ turned, first.y);
        step = with_crossing(step, last, second.x ^ turned, second.y);
        for (var at = head; at != 0u; at = low_of(more[2u * at - 1u])) {
            steps += 1u;
            if steps > STEPS_MAX {
                return CROWDED;
            }
            let crossing = more[2u * at - 2u];
            step = with_crossing(step, last, low_of(crossing) ^ turned, high_of(crossing));
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
fn resolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) me: u32) {
    let count = atomicLoad(&batch.doubles);
    steps = 0u;
    let part = part_of(count, group.x, groups.x);
    for (var double = part.x + me; double < part.y; double += WORKGROUP) {
        let packed = doubles[double];
        let place = low_of(packed);
        let brick = high_of(packed) >> 16u;
        let head = atomicLoad(&chains[place]);
        // Loops, because llvmpipe goes through conditions whether they hold or not.
        for (var is_chained = head != 0u; is_chained; is_chained = false) {
            atomicStore(&chains[place], 0u);
        }
        // A brick whose crossings found no room has edges that lack some, one with too large jumps wrong samples; that
        // such an edge may be torn says nothing new of it.
        let start = sample(brick, high_of(packed) & 0xffffu);
        for (var wrong = decide(place, head, start); wrong != 0u; wrong = 0u) {
            atomicOr(&bricks[brick].flags, wrong);
        }
    }
}
