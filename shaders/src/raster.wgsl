// Splats to pixels, tile by tile: the nearest of each pixel, then the sum of the normals of those that lie with it; twin of
// `draw/raster.rs`. A workgroup has a tile, an invocation a pixel, which meets the tile's splats in their order. So sums do
// not depend on threads.

struct SplatView {
    origin: vec4<f32>,
    corner: vec4<f32>,
    across: vec4<f32>,
    down: vec4<f32>,
    low: vec4<f32>,
    high: vec4<f32>,
    parallel: u32,
    open: u32,
    first: u32,
    unused: u32,
}

struct SplatTile {
    column: u32,
    row: u32,
    splats_from: u32,
    splats: u32,
    pixels_from: u32,
}

struct TileSplat {
    centre: vec4<f32>,
    normal: vec4<f32>,
    first_cut: vec4<f32>,
    second_cut: vec4<f32>,
    columns: u32,
    rows: u32,
    size: u32,
    cuts: u32,
}

@group(0) @binding(0) var<storage, read> view: SplatView;
// By size of cells: how far splats reach along the axes, one divided by the square of the radius, and how far behind the
// nearest splat others belong to it, along a ray.
@group(0) @binding(1) var<storage, read> sizes: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> tiles: array<SplatTile>;
@group(0) @binding(3) var<storage, read> splats: array<TileSplat>;
// By pixel of the tiles: the sum of normals by weight, and how far along the ray the nearest splat is.
@group(0) @binding(4) var<storage, read_write> pixels: array<vec4<f32>>;

// How far along the ray nothing is.
const NOTHING: f32 = 1e30;

// A pixel with its ray.
struct PixelRay {
    column: u32,
    row: u32,
    start: vec3<f32>,
    along: vec3<f32>,
}

fn ray_of(tile: u32, lane: u32) -> PixelRay {
    let column = tiles[tile].column + lane % TILE;
    let row = tiles[tile].row + lane / TILE;
    let over = view.across.xyz * (f32(column) + 0.5) + view.down.xyz * (f32(row) + 0.5);
    if view.parallel != 0u {
        return PixelRay(column, row, view.origin.xyz + over, view.corner.xyz);
    }
    return PixelRay(column, row, view.origin.xyz, view.corner.xyz + over);
}

// How far along a ray a splat's plane is, and how much the splat counts there: 0 where it is not.
fn meet(splat: u32, ray: PixelRay) -> vec2<f32> {
    let columns = splats[splat].columns;
    let rows = splats[splat].rows;
    if ray.column < (columns & 0xffffu) || ray.column > columns >> 16u
        || ray.row < (rows & 0xffffu) || ray.row > rows >> 16u {
        return vec2(0.0);
    }
    let centre = splats[splat].centre;
    let normal = splats[splat].normal.xyz;
    let to = centre.xyz - ray.start;
    let slope = dot(normal, ray.along);
    if slope == 0.0 {
        return vec2(0.0);
    }
    let along = dot(normal, to) / slope;
    if !(along > 0.0 && along < NOTHING) {
        return vec2(0.0);
    }
    let place = ray.along * along - to;
    let size = sizes[splats[splat].size];
    let share = dot(place, place) * size.y;
    var is_in = share <= 1.0 && all(abs(place + normal * centre.w) <= vec3(size.x));
    let cuts = splats[splat].cuts;
    if cuts > 0u {
        let cut = splats[splat].first_cut;
        is_in = is_in && dot(cut.xyz, place) <= cut.w;
    }
    if cuts > 1u {
        let cut = splats[splat].second_cut;
        is_in = is_in && dot(cut.xyz, place) <= cut.w;
    }
    if view.open != 0u {
        let world = place + centre.xyz;
        is_in = is_in && all(world >= view.low.xyz) && all(world <= view.high.xyz);
    }
    let rest = 1.0 - share;
    return select(vec2(0.0), vec2(along, rest * rest + 1e-4), is_in);
}

// The nearest splat of each pixel; sums begin.
@compute @workgroup_size(WORKGROUP)
fn nearest(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let ray = ray_of(group.x, lane);
    let pixel = tiles[group.x].pixels_from + lane;
    var depth = NOTHING;
    if view.first == 0u {
        depth = pixels[pixel].w;
    }
    let begin = tiles[group.x].splats_from;
    let count = min(tiles[group.x].splats, STEPS_MAX);
    for (var n = 0u; n < count; n++) {
        let met = meet(begin + n, ray);
        if met.y > 0.0 {
            depth = min(depth, met.x);
        }
    }
    pixels[pixel] = vec4(0.0, 0.0, 0.0, depth);
}

// What lies with the nearest is added up.
@compute @workgroup_size(WORKGROUP)
fn blend(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let ray = ray_of(group.x, lane);
    let pixel = tiles[group.x].pixels_from + lane;
    let depth = pixels[pixel].w;
    var sum = pixels[pixel].xyz;
    let begin = tiles[group.x].splats_from;
    let count = min(tiles[group.x].splats, STEPS_MAX);
    for (var n = 0u; n < count; n++) {
        let met = meet(begin + n, ray);
        if met.y > 0.0 && met.x <= depth + sizes[splats[begin + n].size].z {
            sum += splats[begin + n].normal.xyz * met.y;
        }
    }
    pixels[pixel] = vec4(sum, depth);
}
