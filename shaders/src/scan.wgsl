// Crossings of triangles with the axis-parallel lines of the bricks that they touch; twin of `winding/scan.rs`.
//
// `find` lists the spans of lines that pass through a triangle, `jump` follows those along which samples are found and
// adds up what the winding number jumps by at each crossing, an invocation a span: triangles have few spans or many, and
// spans that follow each other in the list are about as long, so that the invocations that run in step end together.

// An edge function of a projected triangle along a row of lines.
struct EdgeFunction {
    // At the first line, less one where a tie counts as outside: not negative where the line is inside.
    at: i64,
    // From line to line, and from row to row.
    step: i64,
    step_row: i64,
    // One over the step's magnitude.
    per_step: f32,
}

fn edge_function(p: vec3<i32>, q: vec3<i32>, side: i32, u_first: bool, line: vec2<i32>, shift: u32) -> EdgeFunction {
    let along_u = side * (p.z - q.z);
    let along_v = side * (q.y - p.y);
    // ε belongs to the axis that comes first in x, y, z.
    let first = select(along_v, along_u, u_first);
    let second = select(along_u, along_v, u_first);
    let outside = i32(select(second, first, first != 0i) <= 0i);
    let value = i64(along_v) * i64(line.y - p.z) + i64(along_u) * i64(line.x - p.y);
    let step = i64(along_u) << shift;
    return EdgeFunction(value - i64(outside), step, i64(along_v) << shift, 1.0 / f32(magnitude(step)));
}

// The first and the last line of a row on the inside of an edge, among those from 0 to 32: the other end is out of their
// range, both if all are inside, and if none is, the first lies behind the last.
fn inside(edge: EdgeFunction) -> vec2<i32> {
    if edge.step == 0li {
        return select(vec2(64i, -64i), vec2(-64i, 64i), edge.at >= 0li);
    }
    let divisor = magnitude(edge.step);
    // The estimate is off by a 2^15th at most where it is within bounds; beyond them, an exact one is of no use.
    var lines = i32(floor(clamp(f32(edge.at) * edge.per_step, -64.0, 64.0)));
    let rest = edge.at - i64(lines) * divisor;
    lines += i32(rest >= divisor) - i32(rest < 0li);
    return select(vec2(-64i, lines), vec2(-lines, 64i), edge.step > 0li);
}

// Where spans of a triangle are written: those on the way to a sample, and the others.
struct Places {
    way: u32,
    other: u32,
}

// The spans of lines along an axis. Vertices are relative to sample 0 of the brick and rotated. Writes those that lie before
// the ends, and returns where the next ones belong.
fn spans_along(axis: u32, pair: u32, a: vec3<i32>, b: vec3<i32>, c: vec3<i32>, side: i32, shift: u32, ends: Places, from_places: Places) -> Places {
    var places = from_places;
    let low = min(min(a, b), c);
    let high = max(max(a, b), c);
    let below = (1i << shift) - 1i;
    let first = max((low.yz + below) >> vec2(shift), vec2(0i));
    let last = min(high.yz >> vec2(shift), vec2(i32(CELLS)));
    if any(first > last) || side == 0i {
        return places;
    }
    let line = first << vec2(shift);
    var ab = edge_function(a, b, side, axis != 1u, line, shift);
    var bc = edge_function(b, c, side, axis != 1u, line, shift);
    var ca = edge_function(c, a, side, axis != 1u, line, shift);
    for (var v = first.y; v <= last.y; v++) {
        let of_ab = inside(ab);
        let of_bc = inside(bc);
        let of_ca = inside(ca);
        let begin = first.x + max(max(max(of_ab.x, of_bc.x), of_ca.x), 0i);
        let end = min(first.x + min(min(of_ab.y, of_bc.y), of_ca.y), last.x);
        if begin <= end {
            // Along x samples are found from every line, along y in the face x = 0, along z in the column x = y = 0.
            let is_way = axis == 0u || (v == 0i && (axis == 1u || begin == 0i));
            let place = select(places.other, places.way, is_way);
            if place < select(ends.other, ends.way, is_way) {
                let lines = u32(end + 1i - begin);
                let what = axis | (u32(begin) << 2u) | (u32(v) << 8u) | (lines << 14u);
                spans[place] = both(pair, what);
            }
            places.way += u32(is_way);
            places.other += u32(!is_way);
        }
        ab.at += ab.step_row;
        bc.at += bc.step_row;
        ca.at += ca.step_row;
    }
    return places;
}

@compute @workgroup_size(WORKGROUP)
fn find(@builtin(global_invocation_id) id: vec3<u32>) {
    let way_max = batch.way_max;
    let other_max = batch.other_max;
    if id.x >= batch.pairs {
        return;
    }
    let pair = pair_of(id.x);
    var a = pair.a;
    var b = pair.b;
    var c = pair.c;
    let n = normal_of(a, b, c);
    let sides = vec3(sign_of(n[0]), sign_of(n[1]), sign_of(n[2]));
    // Counted first, so that there is one place to take for all.
    var places = Places(0u, 0u);
    var ends = Places(0u, 0u);
    for (var turn = 0u; turn < 6u; turn++) {
        if turn == 3u {
            if (places.way | places.other) == 0u {
                break;
            }
            let way = atomicAdd(&batch.way_spans, places.way);
            let other = atomicAdd(&batch.other_spans, places.other);
            // Whatever fits is written, so that no span of the batch before is left among these.
            if way + places.way > way_max || other + places.other > other_max {
                atomicOr(&bricks[pair.brick].flags, FULL);
            }
            places = Places(way, way_max + other);
            ends = Places(way_max, way_max + other_max);
            normals[id.x] = encode_normal(n);
        }
        let axis = turn % 3u;
        let side = select(select(sides.z, sides.y, axis == 1u), sides.x, axis == 0u);
        places = spans_along(axis, id.x, a, b, c, side, pair.shift, ends, places);
        a = a.yzx;
        b = b.yzx;
        c = c.yzx;
    }
}

// Adds up the jumps of the crossings with the lines of a span.
fn jump_one(packed: u64) {
    let span = span_of(packed);
    var depth = span.depth;
    // Along z only the first line leads to samples.
    let lines = select(span.lines, 1u, span.axis == 2u);
    var is_crowded = false;
    for (var number = 0u; number < lines; number++) {
        let lower = edge_at(span, depth).x;
        if lower >= 0i && lower < i32(CELLS) {
            let u = span.line.x + number;
            let edge = u32(lower);
            let row = span.line.y * POINTS + u;
            let line = select(select(COLUMN_LINE, face_line(u), span.axis == 1u), row, span.axis == 0u);
            atomicOr(&jumps[touched_at(span.brick, line)], 1u << edge);
            let jump = bitcast<u32>(span.jump) << (8u * (edge & 3u));
            let sum = jump_in(atomicAdd(&jumps[jump_at(span.brick, line, edge)], jump), edge) + span.jump;
            is_crowded |= sum != extractBits(sum, 0u, 8u);
        }
        depth = next_depth(span, depth);
    }
    // A loop, because llvmpipe goes through conditions whether they hold or not.
    while is_crowded {
        atomicOr(&bricks[span.brick].flags, CROWDED);
        is_crowded = false;
    }
}

@compute @workgroup_size(WORKGROUP)
fn jump(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) me: u32) {
    let count = min(atomicLoad(&batch.way_spans), batch.way_max);
    let part = part_of(count, group.x, groups.x);
    for (var number = part.x + me; number < part.y; number += WORKGROUP) {
        jump_one(spans[number]);
    }
}
