// Programs of the graphics processor: squares in the planes of splats, what is left of them, light.
const vertex = `#version 300 es
precision highp float; precision highp int;
// Of each splat: x and y, z with level and cuts, plane, the first plane that cuts it; and the second.
uniform highp usampler2D places, others;
uniform bool open, parallel;
uniform vec3 origin, right, up, towards, centre, eye;
uniform float edge, back, distance;
uniform vec2 scale, range;
out vec3 from, world;
flat out vec3 normal, cellCentre;
flat out vec4 cutA, cutB;
flat out float cell;
flat out int level;
vec4 plane(uint packed) {
  ivec4 c = ivec4(packed << 24u, packed << 16u, packed << 8u, packed) >> 24;
  return vec4(normalize(vec3(c.xyz)), float(c.w) / 16.0);
}
void main() {
  int splat = gl_VertexID / 6, vertex = gl_VertexID % 6;
  ivec2 at = ivec2(splat & 4095, splat >> 12);
  uvec4 place = texelFetch(places, at, 0);
  uint other = texelFetch(others, at, 0).x;
  vec2 corner = vertex < 3 ? vec2(vertex & 1, vertex >> 1) : vec2(1) - vec2(vertex - 3 & 1, vertex - 3 >> 1);
  corner = corner * 2.0 - 1.0;
  level = int(place.y >> 16u & 31u);
  cell = edge / float(32u << uint(level));
  cellCentre = origin + (vec3(place.x & 0xffffu, place.x >> 16u, place.y & 0xffffu) + 0.5) * cell;
  vec4 own = plane(place.z);
  normal = own.xyz;
  vec3 middle = cellCentre + normal * own.w * cell;
  // With perspective the far edge of a splat may face the eye while its middle does not.
  if (!open && (parallel ? dot(normal, towards) < 0.0 : dot(normal, middle - eye) > 0.8660254 * cell)) {
    gl_Position = vec4(2, 2, 2, 1);
    return;
  }
  // A square in the plane of the splat.
  vec3 side = abs(normal.z) < 0.8 ? normalize(cross(normal, vec3(0, 0, 1))) : normalize(cross(normal, vec3(1, 0, 0)));
  from = (side * corner.x + cross(normal, side) * corner.y) * 0.8660254 * cell;
  world = middle + from;
  uint inward = place.y >> 24u;
  cutA = place.w == 0u ? vec4(0, 0, 0, 1) : plane(place.w) * ((inward & 1u) == 0u ? 1.0 : -1.0);
  cutB = other == 0u ? vec4(0, 0, 0, 1) : plane(other) * ((inward & 2u) == 0u ? 1.0 : -1.0);
  if (parallel) {
    vec3 seen = world - centre - towards * back * cell;
    gl_Position = vec4(dot(seen, right) * scale.x, dot(seen, up) * scale.y, -dot(seen, towards) / edge * 0.25, 1.0);
  } else {
    // How far before the eye; what is moved back stays on its ray.
    float far = distance - dot(world - centre, towards);
    vec3 seen = world + (world - eye) * (back * cell / far) - centre;
    far = distance - dot(seen, towards);
    float clip = (far * (range.y + range.x) - 2.0 * range.x * range.y) / (range.y - range.x);
    gl_Position = vec4(dot(seen, right) * scale.x, dot(seen, up) * scale.y, clip / distance, far / distance);
  }
}`;
const kept = `#version 300 es
precision highp float; precision highp int;
in vec3 from, world;
flat in vec3 normal, cellCentre;
flat in vec4 cutA, cutB;
flat in float cell;
flat in int level;
uniform vec3 lowest, highest;
float weight() {
  float share = dot(from, from) / (0.75 * cell * cell);
  vec3 in_cell = (world - cellCentre) / cell;
  if (share > 1.0 || any(greaterThan(abs(in_cell), vec3(0.65)))) discard;
  if (dot(cutA.xyz, in_cell) > cutA.w || dot(cutB.xyz, in_cell) > cutB.w) discard;
  if (any(lessThan(world, lowest)) || any(greaterThan(world, highest))) discard;
  return (1.0 - share) * (1.0 - share) + 1e-4;
}`;
const depthPass = kept + `
void main() { weight(); }`;
const blendPass = kept + `
layout(location = 0) out vec4 sum;
void main() { float w = weight(); sum = vec4(normal * w, w * (1.0 + float(level))); }`;
const screenVertex = `#version 300 es
layout(location = 0) in vec2 corner;
void main() { gl_Position = vec4(corner, 0, 1); }`;
const lightPass = `#version 300 es
precision highp float;
uniform sampler2D sums;
uniform vec3 key, fill, towards, right, up;
uniform vec2 middle;
uniform float pixel, distance;
uniform bool parallel;
uniform int style, deepest;
out vec4 colour;
const ivec2 sides[4] = ivec2[](ivec2(1, 0), ivec2(0, 1), ivec2(1, 1), ivec2(-1, 1));
vec4 fetched(ivec2 at) { return any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, textureSize(sums, 0))) ? vec4(0) : texelFetch(sums, at, 0); }
vec4 around(ivec2 at) {
  vec4 all = vec4(0);
  int covered = 0;
  for (int n = 0; n < 4; ++n) {
    vec4 a = fetched(at + sides[n]), b = fetched(at - sides[n]);
    if (a == vec4(0) && b == vec4(0)) return vec4(0);
    if (a != vec4(0)) { all += a / length(a.xyz); ++covered; }
    if (b != vec4(0)) { all += b / length(b.xyz); ++covered; }
  }
  return covered < 6 ? vec4(0) : all;
}
void main() {
  vec4 sum = fetched(ivec2(gl_FragCoord.xy));
  if (sum == vec4(0)) sum = around(ivec2(gl_FragCoord.xy));
  if (sum == vec4(0)) { colour = vec4(1); return; }
  vec3 n = normalize(sum.xyz);
  vec2 at = (gl_FragCoord.xy - middle) * pixel;
  bool inside = dot(n, parallel ? towards : towards * distance - right * at.x - up * at.y) < 0.0;
  if (inside) n = -n;
  if (style == 1) { colour = vec4(n * 0.5 + 0.5, 1); return; }
  vec3 base = inside ? vec3(206, 148, 96) : vec3(158, 168, 182);
  if (style == 2) { float l = sum.w / max(length(sum.xyz), 1e-6) - 1.0; base = mix(vec3(220, 120, 70), vec3(70, 130, 200), clamp(l / float(max(deepest, 1)), 0.0, 1.0)); }
  float light = 0.3 + 0.62 * max(dot(n, key), 0.0) + 0.22 * max(dot(n, fill), 0.0);
  float gloss = inside ? 0.0 : 255.0 * 0.133 * pow(max(dot(n, normalize(key + towards)), 0.0), 24.0);
  colour = vec4((base * light + gloss) / 255.0, 1);
}`;
