// Rays through the picture, and the part of each that cuts leave; twin of `render/camera.rs` and `render/clip.rs`. Places
// are in edges of the root cube from its first sample, so single precision tells apart what is 2^-23 of it: at level 8
// a thousandth of a cell.

struct Sight {
    origin: vec4<f32>,
    corner: vec4<f32>,
    across: vec4<f32>,
    down: vec4<f32>,
    towards: vec4<f32>,
    key: vec4<f32>,
    fill: vec4<f32>,
    half: vec4<f32>,
    low: vec4<f32>,
    high: vec4<f32>,
    background: vec4<f32>,
    lighting: vec4<f32>,
    volume: vec4<f32>,
    stretch: f32,
    pixel: f32,
    distance: f32,
    cell_pixels: f32,
    parallel: u32,
    cuts: u32,
    width: u32,
    height: u32,
    rays: u32,
    first_tile: u32,
    shells: u32,
    haze: u32,
    opacities: u32,
    colours: u32,
    count_words: u32,
    page_words: u32,
}

@group(0) @binding(0) var<storage, read> sight: Sight;

// Farther than anything.
const FAR = 1e30;

struct Line {
    origin: vec3<f32>,
    direction: vec3<f32>,
    // Of the direction's parts; FAR where they are 0.
    inverse: vec3<f32>,
    // The part that is looked at.
    start: f32,
    end: f32,
    // Where it comes in through the plane of a cut: the normal of that plane towards the eye, or zero.
    cut: vec3<f32>,
    // The place there.
    opening: vec3<f32>,
}

// The pixel of a place in a tile: neighbours in number are neighbours in the picture.
fn pixel_of(tile: u32, n: u32) -> vec2<u32> {
    let across = (sight.width + TILE - 1u) / TILE;
    let x = (n & 1u) | (n >> 1u & 2u) | (n >> 2u & 4u);
    let y = (n >> 1u & 1u) | (n >> 2u & 2u) | (n >> 3u & 4u);
    return vec2(tile % across, tile / across) * TILE + vec2(x, y);
}

// The ray through a point of the picture, in pixels from its upper left corner, whose part to look at may be empty.
fn line_through(at: vec2<f32>) -> Line {
    var line: Line;
    let over = at.x * sight.across.xyz + at.y * sight.down.xyz;
    if sight.parallel != 0u {
        line.origin = sight.origin.xyz + over;
        line.direction = sight.corner.xyz;
    } else {
        line.origin = sight.origin.xyz;
        line.direction = normalize(sight.corner.xyz + over);
    }
    // What is this close to 0 is 0 but for rounding.
    let is_along = abs(line.direction) < vec3(1e-12);
    line.direction = select(line.direction, vec3(0.0), is_along);
    line.inverse = select(1.0 / line.direction, vec3(FAR), is_along);
    clip(&line);
    return line;
}

// Where a line passes planes across the axes; FAR where it never does.
fn passes(line: Line, planes: vec3<f32>) -> vec3<f32> {
    return select((planes - line.origin) * line.inverse, vec3(FAR), line.direction == vec3(0.0));
}

// Leaves of a line what lies within the cuts and the root cube.
fn clip(line: ptr<function, Line>) {
    let origin = (*line).origin;
    let is_along = (*line).direction == vec3(0.0);
    let rises = (*line).direction > vec3(0.0);
    let low = sight.low.xyz;
    let high = sight.high.xyz;
    let enters = select(passes(*line, select(high, low, rises)), vec3(-FAR), is_along);
    let leaves = passes(*line, select(low, high, rises));
    var start = max(0.0, max(enters.x, max(enters.y, enters.z)));
    var end = min(leaves.x, min(leaves.y, leaves.z));
    // The axis whose plane it passes last, the first of several.
    let is_x = enters.x == start;
    let is_y = enters.y == start && !is_x;
    let is_last = vec3(is_x, is_y, enters.z == start && !is_x && !is_y);
    let sides = (vec3(sight.cuts) >> select(vec3(3u, 4u, 5u), vec3(0u, 1u, 2u), rises)) & vec3(1u);
    var cut = select(vec3(0.0), -sign((*line).direction), is_last & (sides != vec3(0u)));
    // The place at a cut lies in its plane, whatever rounding says.
    let is_cut = cut != vec3(0.0);
    (*line).opening = select(origin + start * (*line).direction, select(high, low, rises), is_cut);
    // The root's cells begin at its first sample.
    let p = passes(*line, vec3(0.0));
    let q = passes(*line, vec3(1.0));
    let begins = select(min(p, q), vec3(-FAR), is_along);
    let ends = max(p, q);
    let first = max(begins.x, max(begins.y, begins.z));
    cut = select(cut, vec3(0.0), first > start);
    start = max(start, first);
    end = min(end, min(ends.x, min(ends.y, ends.z)));
    let is_beside = is_along & ((origin < max(low, vec3(0.0))) | (origin >= min(high, vec3(1.0))));
    (*line).start = start;
    (*line).end = select(end, -1.0, any(is_beside));
    (*line).cut = cut;
}

// Size of a pixel at a distance from the eye.
fn pixel_at(distance: f32) -> f32 {
    return select(sight.pixel * distance / sight.distance, sight.pixel, sight.parallel != 0u);
}
