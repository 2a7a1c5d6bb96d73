// Rays through the tree, from node to node and from cell to cell; twin of `render/trace.rs`. A ray goes on from where it is
// by going down from the root, so all that it keeps between rounds is how far it has come and what it has gathered. It
// waits in front of bricks only, and what it sees of one depends on nothing that happened before: so pictures do not
// depend on which bricks are there when.

struct TreeNode {
    children: u32,
    flags: u32,
}

struct Round {
    number: u32,
    rays: u32,
    first: u32,
    draft: u32,
    start: u32,
    behind: u32,
    wanted_max: u32,
    waiting: atomic<u32>,
    wanted: atomic<u32>,
}

@group(0) @binding(3) var<storage, read> nodes: array<TreeNode>;
// By node: the page of its brick, or the last round that wanted it.
@group(0) @binding(4) var<storage, read_write> pages: array<atomic<u32>>;
// By page: the last round that used it.
@group(0) @binding(6) var<storage, read_write> used: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> round: Round;
// Nodes whose bricks are wanted.
@group(0) @binding(8) var<storage, read_write> wanted: array<u32>;
// Rays of this round, and of the next.
@group(0) @binding(9) var<storage, read_write> queue: array<u32>;
// By ray: what it has gathered.
@group(0) @binding(10) var<storage, read_write> light: array<vec4<f32>>;
// By ray: how far it has come, and where it met the first opaque thing.
@group(0) @binding(11) var<storage, read_write> along: array<vec2<f32>>;

// Steps through a stretch of haze, or through a cell if that is longer.
const STEPS_A_STRETCH = 3.0;
// What rounding may add to a number of steps.
const STEPS_SLACK = 1e-3;

var<private> line: Line;
// Where the ray met the first opaque thing, along its length.
var<private> hit: f32;
// Whether nothing behind is seen any more.
var<private> is_done: bool;
// Whether it comes to a brick that is not there.
var<private> waits: bool;
// Steps of this round.
var<private> steps: u32;

// A stretch of the ray in a brick, in cells from where it enters.
struct Place {
    page: u32,
    // Where it enters, along the ray, and in cells from the brick's first sample.
    start: f32,
    entry: vec3<f32>,
    // Size of a cell.
    cell: f32,
    // Where it leaves.
    end: f32,
}

fn meet(t: f32, colour: vec3<f32>) {
    add(colour, 1.0);
    hit = t;
    is_done = true;
}

fn local(place: Place, s: f32) -> vec3<f32> {
    return place.entry + s * line.direction;
}

fn within(place: Place, ijk: vec3<u32>, s: f32) -> vec3<f32> {
    return clamp(local(place, s) - vec3<f32>(ijk), vec3(0.0), vec3(1.0));
}

// The cube of a row of `across` that holds a place, or the nearest.
fn cube(at: vec3<f32>, across: u32) -> vec3<u32> {
    return min(vec3<u32>(max(at, vec3(0.0))), vec3(across - 1u));
}

// Where the ray passes the faces of cubes of a size, those that it leaves them by.
fn faces(place: Place, cubes: vec3<u32>, size: f32) -> vec3<f32> {
    let rises = line.direction > vec3(0.0);
    let planes = (vec3<f32>(cubes) + select(vec3(0.0), vec3(1.0), rises)) * size;
    return select((planes - place.entry) * line.inverse, vec3(FAR), line.direction == vec3(0.0));
}

// The axis of the first of three places, as a mask.
fn first_of(next: vec3<f32>) -> vec3<bool> {
    let is_x = next.x <= next.y && next.x <= next.z;
    let is_y = !is_x && next.y <= next.z;
    return vec3(is_x, is_y, !is_x && !is_y);
}

// A step of halving a stretch of a cell on which the boundary lies.
fn halved(range: vec2<f32>, cell: Cell, place: Place, ijk: vec3<u32>, was_inside: bool) -> vec2<f32> {
    let middle = (range.x + range.y) / 2.0;
    let is_before = (value(cell, within(place, ijk, middle)) >= 0.0) == was_inside;
    return select(vec2(range.x, middle), vec2(middle, range.y), is_before);
}

// The first place in a cell where a field passes 0; FAR if it does not.
fn passage(field: u32, place: Place, ijk: vec3<u32>, start: f32, end: f32) -> f32 {
    let cell = cell_of(field, ijk);
    let middle = (start + end) / 2.0;
    let was_inside = value(cell, within(place, ijk, start)) >= 0.0;
    var range = vec2(start, middle);
    if (value(cell, within(place, ijk, middle)) >= 0.0) == was_inside {
        range = vec2(middle, end);
        if (value(cell, within(place, ijk, end)) >= 0.0) == was_inside { return FAR; }
    }
    // Ten halvings, to 1/2000 of the cell. Not a loop: steps of loops are few.
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    range = halved(range, cell, place, ijk, was_inside);
    return range.y;
}

// Gathers the haze between two places in a cell.
fn haze(field: u32, place: Place, ijk: vec3<u32>, start: f32, end: f32) {
    let cell = cell_of(field, ijk);
    var length = end - start;
    if sight.stretch > 0.0 { length *= place.cell / sight.stretch; }
    let count = max(ceil(min(length, end - start) * STEPS_A_STRETCH - STEPS_SLACK), 1.0);
    for (var step = 0.0; step < count; step += 1.0) {
        steps++;
        let at = within(place, ijk, start + (end - start) * (step + 0.5) / count);
        let w = sight.volume.x + value(cell, at) * (sight.volume.y - sight.volume.x);
        if w > sight.volume.z && w < sight.volume.w {
            let opacity = stops_at(OPACITIES_AT, sight.opacities, w).x;
            var colour = stops_at(COLOURS_AT, sight.colours, w);
            if (sight.haze & SHADED) != 0u { colour = hazy(colour, normal_of(cell, at)); }
            add(colour, min(opacity * length / count, 1.0));
        }
    }
}

fn has_active(page: u32, number: u32, ijk: vec3<u32>) -> bool {
    if !has_field(page, number) { return false; }
    return is_active(field_of(page, number), ijk);
}

// Gathers what is seen in a cell: the surfaces in the order in which the ray meets them, and the haze in between.
fn look(place: Place, ijk: vec3<u32>, start: f32, end: f32) {
    var met = vec4(FAR);
    for (var number = 0u; number < sight.shells; number++) {
        steps++;
        if has_active(place.page, number, ijk) {
            let t = passage(field_of(place.page, number), place, ijk, start, end);
            met = select(met, vec4(t), vec4(0u, 1u, 2u, 3u) == vec4(number));
        }
    }
    let is_hazy = sight.haze != 0u && has_active(place.page, sight.shells, ijk);
    var at = start;
    for (var count = 0u; count <= sight.shells; count++) {
        steps++;
        let t = min(min(met.x, met.y), min(met.z, met.w));
        if is_hazy { haze(field_of(place.page, sight.shells), place, ijk, at, min(t, end)); }
        if t == FAR { break; }
        at = t;
        let is_here = met == vec4(t);
        let number = select(select(select(3u, 2u, is_here.z), 1u, is_here.y), 0u, is_here.x);
        met = select(met, vec4(FAR), vec4(0u, 1u, 2u, 3u) == vec4(number));
        let normal = normal_of(cell_of(field_of(place.page, number), ijk), within(place, ijk, t));
        let seen = surface_of(number, most_for(number, place.page, ijk), normal);
        if is_opaque(number) {
            meet(place.start + t * place.cell, seen.xyz);
            return;
        }
        add(seen.xyz, seen.w);
    }
    is_done = is_full();
}

fn most_for(number: u32, page: u32, ijk: vec3<u32>) -> i32 {
    if (shells[number].flags & COUNTED) == 0u { return 0; }
    return most_of(page, ijk);
}

// Goes through the cells of a block between two places (Amanatides & Woo 1987).
fn cells(place: Place, start: f32, end: f32) {
    var ijk = cube(local(place, start), CELLS);
    let ahead = vec3<i32>(sign(line.direction));
    var next = faces(place, ijk, 1.0);
    var at = start;
    loop {
        steps++;
        let axis = first_of(next);
        let leaves = clamp(min(next.x, min(next.y, next.z)), at, end);
        look(place, ijk, at, leaves);
        at = leaves;
        let beyond = vec3<i32>(ijk) + select(vec3(0), ahead, axis);
        if is_done || at >= end || any(beyond < vec3(0)) || any(beyond >= vec3(i32(CELLS))) { break; }
        ijk = vec3<u32>(beyond);
        next = select(next, faces(place, ijk, 1.0), axis);
    }
}

// Goes through the blocks of a brick: most of it is not worth a look.
fn blocks(place: Place) {
    let size = f32(CELLS / BLOCKS);
    var block = cube(place.entry / size, BLOCKS);
    let ahead = vec3<i32>(sign(line.direction));
    var next = faces(place, block, size);
    var at = 0.0;
    loop {
        steps++;
        let axis = first_of(next);
        let leaves = clamp(min(next.x, min(next.y, next.z)), at, place.end);
        if has_block(place.page, block) { cells(place, at, leaves); }
        at = leaves;
        let beyond = vec3<i32>(block) + select(vec3(0), ahead, axis);
        if is_done || at >= place.end || any(beyond < vec3(0)) || any(beyond >= vec3(i32(BLOCKS))) { break; }
        block = vec3<u32>(beyond);
        next = select(next, faces(place, block, size), axis);
    }
}

// Whether the ray begins here, at a cut.
fn is_cut(t: f32) -> bool {
    return t <= line.start && any(line.cut != vec3(0.0));
}

// What is seen of an opaque surface that the ray is within as it enters a brick: at a cut, or where the brick before knew
// it less exactly.
fn begin_within(place: Place) {
    let ijk = cube(place.entry, CELLS);
    for (var number = 0u; number < sight.shells; number++) {
        steps++;
        if !is_opaque(number) { continue; }
        let has = has_field(place.page, number);
        var cell: Cell;
        var is_within = is_inside(place.page, number);
        if has {
            cell = cell_of(field_of(place.page, number), ijk);
            is_within = value(cell, within(place, ijk, 0.0)) >= 0.0;
        }
        if !is_within { continue; }
        if is_cut(place.start) {
            // A cap shows what lies just within, not what the cut has taken.
            let sample = min(vec3<u32>(max(place.entry + 0.5, vec3(0.0))), vec3(CELLS));
            let w = max(count_at(place.page, point_index(sample)), i32(shells[number].least));
            meet(place.start, cap(w, line.cut));
        } else {
            let normal = select(sight.towards.xyz, normal_of(cell, within(place, ijk, 0.0)), has);
            meet(place.start, surface_of(number, most_for(number, place.page, ijk), normal).xyz);
        }
        return;
    }
}

// A brick whose samples are all the same.
fn uniform_brick(w: i32, cell: f32, start: f32, end: f32) {
    for (var number = 0u; number < sight.shells; number++) {
        steps++;
        if is_opaque(number) && f32(w) >= shells[number].w {
            if is_cut(start) {
                meet(start, cap(w, line.cut));
            } else {
                meet(start, surface_of(number, w, sight.towards.xyz).xyz);
            }
            return;
        }
    }
    if sight.haze != 0u && f32(w) > sight.volume.z && f32(w) < sight.volume.w {
        let stretches = (end - start) / select(cell, sight.stretch, sight.stretch > 0.0);
        let opacity = stops_at(OPACITIES_AT, sight.opacities, f32(w)).x;
        // As much as the steps through cells would gather.
        let left = pow(1.0 - opacity / STEPS_A_STRETCH, STEPS_A_STRETCH * stretches);
        add(stops_at(COLOURS_AT, sight.colours, f32(w)), 1.0 - left);
        is_done = is_full();
    }
}

// A brick of a page, whose first sample is at `base` and whose cells have this size.
fn paged_brick(number: u32, base: vec3<f32>, cell: f32, start: f32, end: f32) {
    atomicStore(&used[number], round.number);
    let at = select(line.origin + start * line.direction, line.opening, vec3(is_cut(start)));
    let place = Place(number * sight.page_words, start, (at - base) / cell, cell, (end - start) / cell);
    begin_within(place);
    if !is_done { blocks(place); }
}

// Asks for a brick, once a round.
fn want(node: u32) {
    if atomicMax(&pages[node], round.number) < round.number {
        let at = atomicAdd(&round.wanted, 1u);
        if at < round.wanted_max { wanted[at] = node; }
    }
}

// Passes the node that the ray comes to at `t`, and says where it leaves it.
fn pass_node(t: f32) -> f32 {
    var node = 0u;
    var base = vec3(0.0);
    var edge = 1.0;
    var start = line.start;
    var end = line.end;
    // Of the deepest brick above that is there.
    var held = 0u;
    var held_base = vec3(0.0);
    var held_edge = 1.0;
    loop {
        steps++;
        let here = nodes[node];
        if (here.flags & SEEN) == 0u { return end; }
        if round.draft != 0u && (here.flags & UNIFORM) == 0u {
            let page = atomicLoad(&pages[node]);
            if (page & RESIDENT) != 0u {
                held = page;
                held_base = base;
                held_edge = edge;
            }
        }
        let cell = edge / f32(CELLS);
        let is_small = (here.flags & TOLD) != 0u && cell <= sight.cell_pixels * pixel_at(start);
        if here.children == 0u || is_small {
            if (here.flags & UNIFORM) != 0u {
                uniform_brick(bitcast<i32>(here.flags) >> 16u, cell, t, end);
                return end;
            }
            break;
        }
        edge = edge / 2.0;
        let middle = base + edge;
        let planes = passes(line, middle);
        let is_along = line.direction == vec3(0.0);
        let is_behind = planes <= vec3(t);
        let upper = select((line.direction > vec3(0.0)) == is_behind, line.origin >= middle, is_along);
        let entered = select(vec3(-FAR), planes, is_behind);
        let left = select(planes, vec3(FAR), is_behind);
        start = max(start, max(entered.x, max(entered.y, entered.z)));
        end = min(end, min(left.x, min(left.y, left.z)));
        base = select(base, middle, upper);
        let octant = select(vec3(0u), vec3(1u, 2u, 4u), upper);
        node = here.children + octant.x + octant.y + octant.z;
    }
    let page = atomicLoad(&pages[node]);
    if (page & RESIDENT) != 0u {
        paged_brick(page & ~RESIDENT, base, edge / f32(CELLS), t, end);
        return end;
    }
    want(node);
    if round.draft == 0u {
        waits = true;
        return t;
    }
    if held != 0u { paged_brick(held & ~RESIDENT, held_base, held_edge / f32(CELLS), t, end); }
    return end;
}

// Sets out on a ray: by tiles, by the ray's place in a pixel, by pixels. Whether there is such a pixel.
fn aim(ray: u32) -> bool {
    let part = ray / (TILE * TILE);
    let of_pixel = part % (sight.rays * sight.rays);
    let pixel = pixel_of(sight.first_tile + part / (sight.rays * sight.rays), ray % (TILE * TILE));
    let place = vec2(of_pixel % sight.rays, of_pixel / sight.rays);
    line = line_through(vec2<f32>(pixel) + (vec2<f32>(place) + 0.5) / f32(sight.rays));
    return pixel.x < sight.width && pixel.y < sight.height;
}

@compute @workgroup_size(WORKGROUP)
fn trace(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= round.rays {
        return;
    }
    var ray = id.x;
    if round.first == 0u { ray = queue[round.start + id.x]; }
    let is_there = aim(ray);
    var t = line.start;
    gathered = vec4(0.0);
    hit = FAR;
    if round.first == 0u {
        gathered = light[ray];
        t = along[ray].x;
    }
    is_done = !is_there;
    waits = false;
    steps = 0u;
    while !is_done && t < line.end {
        if steps > RAY_STEPS_MAX { waits = true; }
        if waits { break; }
        t = pass_node(t);
    }
    light[ray] = gathered;
    along[ray] = vec2(t, hit);
    if waits { queue[round.behind + atomicAdd(&round.waiting, 1u)] = ray; }
}
