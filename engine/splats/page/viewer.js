const by = (id) => document.getElementById(id);
const canvas = document.querySelector("canvas"), said = document.querySelector("output");
const decoded = (id) => Uint8Array.from(atob(by(id).textContent.trim()), (c) => c.charCodeAt(0));
const say = (text) => { said.textContent = text };
// The worker begins before all else: it has the longest way.
const data = by("data").textContent.trim(), is_file = !data && location.protocol === "file:";
const worker = new Worker(URL.createObjectURL(new Blob([by("worker").textContent], { type: "text/javascript" })));
worker.onmessage = take;
if (!is_file) worker.postMessage({ decoder: decoded("decoder"), ...(data ? { bytes: decoded("data") } : { address: new URL("part.bsp", location.href).href }) });

// What the file says of itself, once its header is there.
let part = null;
function begin({ header, wanted }) {
  const head = new DataView(header.buffer), f64 = (at) => head.getFloat64(at, true), three = (at) => [f64(at), f64(at + 8), f64(at + 16)];
  const low = three(48), high = three(72), middle = low.map((c, a) => (c + high[a]) / 2), origin = three(16).map((c, a) => c - middle[a]);
  const unit = [...header.subarray(96, 104)].filter((c) => c).map((c) => String.fromCharCode(c)).join("");
  part = { edge: f64(40), low, high, middle, origin, unit, deepest: head.getUint8(104) };
  Object.assign(by("level"), { max: part.deepest, value: wanted });
  window_size();
}

// The state of the view: angles in degrees, what is in the middle, how much of the world the height shows there, the angle that
// it has, 0 for parallel rays.
const view = { azimuth: -45, elevation: 35.264389682754654, opening: 0, centre: [0, 0, 0], height: 0 };
const state = { count: 0, level: 0, style: 0, axis: -1, at: 0.5, done: false, stopped: false, drawn: 0, milliseconds: 0, received: 0, error: null, picked: null, log: [] };
const asked_view = location.hash.slice(1).split(",").map(Number);
if (location.hash && asked_view.every(Number.isFinite)) [view.azimuth, view.elevation = 0, view.opening = 0] = asked_view;

const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
if (!gl || !(gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float"))) {
  say("this browser has no WebGL 2 with float colours");
  state.error = "no WebGL 2";
}

function program(vertexText, fragmentText) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertexText], [gl.FRAGMENT_SHADER, fragmentText]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw Error(gl.getShaderInfoLog(shader));
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(made));
  const at = {};
  for (let n = 0; n < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); n++) {
    const { name } = gl.getActiveUniform(made, n);
    at[name] = gl.getUniformLocation(made, name);
  }
  return { made, at };
}

let passes, splats, squares, screen, frame, sums, depth;
function texture(at, format, width, rows, shape, kind, numbers) {
  const made = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + at);
  gl.bindTexture(gl.TEXTURE_2D, made);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, rows);
  if (numbers) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, rows, shape, kind, numbers);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  return made;
}
function prepare() {
  passes = { depth: program(vertex, depthPass), blend: program(vertex, blendPass), light: program(screenVertex, lightPass) };
  const corners = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, corners);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
  squares = gl.createVertexArray();
  screen = gl.createVertexArray();
  gl.bindVertexArray(screen);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  frame = gl.createFramebuffer();
}

// As large as the window; the pictures between are made anew.
function resize(width, height) {
  canvas.width = width;
  canvas.height = height;
  gl.deleteTexture(sums);
  gl.deleteRenderbuffer(depth);
  sums = texture(0, gl.RGBA16F, width, height);
  depth = gl.createRenderbuffer();
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, sums, 0);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unitOf = (a) => { const l = Math.hypot(...a); return a.map((c) => c / l) };
function axes() {
  const a = view.azimuth * Math.PI / 180, e = view.elevation * Math.PI / 180;
  const towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)], right = [-Math.sin(a), Math.cos(a), 0];
  return { right, up: cross(towards, right), towards };
}
// The whole part, with 3 % of the picture free on each side.
function fit() {
  const frame = axes(), sides = [canvas.width * 0.47, canvas.height * 0.47];
  const ends = [...Array(8).keys()].map((n) => [0, 1, 2].map((a) => (part.high[a] - part.low[a]) * ((n >> a & 1) - 0.5)))
    .map((end) => [dot(frame.right, end), dot(frame.up, end), dot(frame.towards, end)]);
  const most = (of) => Math.max(...ends.map(of));
  view.centre = [0, 0, 0];
  if (view.opening) {
    const step = slope() * 2 / canvas.height;
    const needed = (a) => most((end) => end[2] + Math.abs(end[a]) / (step * sides[a]));
    view.height = 2 * slope() * Math.max(needed(0), needed(1), most((end) => end[2]) * 1.01);
  } else view.height = canvas.height * Math.max(...[0, 1].map((a) => most((end) => Math.abs(end[a])) / sides[a]));
}
const slope = () => Math.tan(view.opening * Math.PI / 360);
// Where the eye is, and how far from the middle; far away for parallel rays.
function eye() {
  const { towards } = axes(), distance = view.opening ? view.height / 2 / slope() : part.edge * 4;
  return { at: view.centre.map((c, a) => c + towards[a] * distance), distance };
}
const cut_at = () => [0, 1, 2].map((a) => a === state.axis ? part.low[a] + (part.high[a] - part.low[a]) * state.at - part.middle[a] : 1e30);

let asked = false;
const redraw = () => { if (!asked) { asked = true; requestAnimationFrame(() => { asked = false; draw() }) } };
function draw() {
  if (state.error || !state.count) return;
  const { right, up, towards } = axes(), { at: from, distance } = eye(), lowest = [-1e30, -1e30, -1e30], highest = cut_at();
  // What may be seen lies so far before the eye.
  const around = Math.hypot(...part.high.map((c, a) => c - part.low[a])) * 0.6, of_part = dot(from, towards);
  const far = Math.max(of_part + around, part.edge * 1e-6), range = [Math.max(of_part - around, far * 1e-3), far];
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.clearColor(0, 0, 0, 0);
  gl.clearDepth(1);
  gl.depthMask(true);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.depthFunc(gl.LEQUAL);
  gl.bindVertexArray(squares);
  const pass = ({ made, at }, back) => {
    gl.useProgram(made);
    for (const [name, value] of Object.entries({ origin: part.origin, right, up, towards, centre: view.centre, eye: from, lowest, highest }))
      gl.uniform3fv(at[name] ?? null, value);
    gl.uniform1f(at.edge, part.edge);
    gl.uniform1f(at.distance, distance);
    gl.uniform1i(at.parallel, view.opening ? 0 : 1);
    gl.uniform2fv(at.range, range);
    gl.uniform1f(at.back, back);
    gl.uniform1i(at.open, state.axis >= 0 ? 1 : 0);
    gl.uniform1i(at.places, 1);
    gl.uniform1i(at.others, 2);
    gl.uniform2f(at.scale, 2 / view.height * canvas.height / canvas.width, 2 / view.height);
    gl.drawArrays(gl.TRIANGLES, 0, 6 * state.count);
  };
  // The nearest splats, moved back by what may lie together; then all that are before that.
  gl.colorMask(false, false, false, false);
  gl.disable(gl.BLEND);
  pass(passes.depth, 0.715);
  gl.colorMask(true, true, true, true);
  gl.depthMask(false);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE);
  pass(passes.blend, 0);
  gl.disable(gl.BLEND);
  gl.disable(gl.DEPTH_TEST);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.useProgram(passes.light.made);
  const lamp = ([x, y, z]) => unitOf([0, 1, 2].map((a) => right[a] * x + up[a] * y + towards[a] * z));
  gl.uniform3fv(passes.light.at.key, lamp([-0.55, 0.65, 0.55]));
  gl.uniform3fv(passes.light.at.fill, lamp([0.8, -0.1, 0.5]));
  for (const [name, value] of Object.entries({ towards, right, up })) gl.uniform3fv(passes.light.at[name], value);
  gl.uniform2f(passes.light.at.middle, canvas.width / 2, canvas.height / 2);
  gl.uniform1f(passes.light.at.pixel, view.height / canvas.height);
  gl.uniform1f(passes.light.at.distance, distance);
  gl.uniform1i(passes.light.at.parallel, view.opening ? 0 : 1);
  gl.uniform1i(passes.light.at.style, state.style);
  gl.uniform1i(passes.light.at.deepest, part.deepest);
  gl.bindVertexArray(screen);
  gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  state.drawn++;
  mark();
  if (!news) return;
  // A picture of new splats is there when its pixels can be read.
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  state.log.push({ ...news, seen: performance.now() });
  news = null;
  worker.postMessage({ drawn: true });
}

let news = null;
const megabytes = () => data ? "" : "; " + (state.received / 1e6).toFixed(1) + " MB";
function tell() {
  if (state.error || !part) return;
  const size = part.high.map((c, a) => (c - part.low[a]).toFixed(2)).join(" × ");
  const picked = state.picked ? "\n" + state.picked.text : "";
  say(state.count.toLocaleString("en") + " splats, level " + state.level + " of " + part.deepest + "; " + size + " " + part.unit + megabytes() + picked);
}
// What the worker says.
function take({ data: told }) {
  if (told.header) return begin(told);
  if (told.picked !== undefined) return picked(told.picked);
  if (told.bead !== undefined) return bead_of(told);
  if (told.received !== undefined) state.received = told.received;
  if (told.error) {
    state.error = told.error;
    flow("");
    return say((data ? "the data of this page are damaged: " : "part.bsp cannot be shown: ") + told.error);
  }
  if (told.lost || told.stopped) {
    state.stopped = true;
    tell();
    if (told.lost) say(said.textContent + "\n" + told.lost);
    return flow("Go on");
  }
  if (told.count !== undefined) show(told);
  tell();
}
function show({ level, whole, count, rows, places, others, last, received, milliseconds, at }) {
  if (rows > gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
    state.done = true;
    worker.postMessage({ stop: true, drawn: true });
    return say("this browser holds no more than level " + state.level);
  }
  (splats || []).forEach((old) => gl.deleteTexture(old));
  splats = [texture(1, gl.RGBA32UI, 4096, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, places),
    texture(2, gl.R32UI, 4096, rows, gl.RED_INTEGER, gl.UNSIGNED_INT, others)];
  gl.activeTexture(gl.TEXTURE0);
  Object.assign(state, { level, count, milliseconds });
  news = { level, whole, count, received, decoded: at - performance.timeOrigin };
  if (last) {
    state.done = true;
    by("level").value = level;
    flow("");
  }
  redraw();
}
// The button that stops what comes from a server.
function flow(name) {
  by("flow").textContent = name;
  by("flow").hidden = !name || Boolean(data);
}
by("flow").addEventListener("click", () => {
  const stop = by("flow").textContent === "Stop";
  state.stopped = stop;
  if (!stop) flow("Stop");
  worker.postMessage(stop ? { stop } : { go: true });
});

// Where a click meets the part.
function pick(x, y) {
  const { right, up, towards } = axes(), { at, distance } = eye(), step = view.height / canvas.clientHeight;
  const across = [(x - canvas.clientWidth / 2) * step, (canvas.clientHeight / 2 - y) * step];
  const on_plane = view.centre.map((c, a) => c + right[a] * across[0] + up[a] * across[1]);
  const from = view.opening ? at : on_plane.map((c, a) => c + towards[a] * distance);
  give_beads();
  worker.postMessage({ pick: { from, along: unitOf(on_plane.map((c, a) => c - from[a])), highest: cut_at(), open: state.axis >= 0, origin: part.origin, edge: part.edge, middle: part.middle } });
}
// The table of beads goes to the worker with the first pick, and what reads it: they stand at the page's end, or the table beside it.
let beads_given = false;
function give_beads() {
  if (beads_given || document.readyState === "loading") return;
  beads_given = true;
  const { dataset: { beside }, textContent } = by("picks");
  if (!beside && !textContent.trim()) return;
  const table = beside ? { address: new URL(beside, location.href).href } : { bytes: decoded("picks") };
  worker.postMessage({ picks: { program: decoded("finder"), ...table } });
}
// The bead of the last pick, which comes after its place.
function bead_of({ bead, fault }) {
  if (!state.picked) return;
  state.picked.bead = bead;
  if (fault) state.picked.text += "\nno bead: the table of beads cannot be read: " + fault;
  if (bead) {
    const digits = Math.max(0, Math.min(6, Math.floor(-Math.log10(2 * bead.step)))), text = (number) => String(Number(number.toFixed(digits)));
    const [first, last] = bead.lines, lines = first === last ? "line " + first : "lines " + first + " to " + last;
    const of = [bead.feature, bead.source].filter(Boolean).map((name) => ", " + name).join("");
    state.picked.text += "\nlayer " + bead.layer + ", z " + text(bead.bottom) + " to " + text(bead.top) + " " + part.unit + "; bead " + bead.bead + ", " + lines + of;
  }
  tell();
}
function picked(found) {
  const before = state.picked;
  state.picked = null;
  if (found) {
    const at = found.place.map((c, a) => c + part.middle[a]), cell = part.edge / (32 << found.level);
    const digits = Math.max(0, Math.min(6, 1 - Math.floor(Math.log10(cell)))), text = (number) => number.toFixed(digits);
    const names = ["x ", "y ", "z "].map((name, a) => name + text(at[a])).join(", ");
    const apart = before ? ", " + text(Math.hypot(...at.map((c, a) => c - before.at[a]))) + " from the last point" : "";
    const said_of = names + " " + part.unit + "; " + text(at[2] - part.low[2]) + " above the lowest point" + apart;
    state.picked = { at, place: found.place, normal: found.normal, level: found.level, text: said_of };
  }
  tell();
  mark();
}
// The ring around the point that was picked last.
function mark() {
  const ring = document.querySelector("i");
  ring.hidden = !state.picked;
  if (!state.picked) return;
  const { right, up, towards } = axes(), from = state.picked.place.map((c, a) => c - view.centre[a]), { distance } = eye();
  const share = view.opening ? distance / (distance - dot(from, towards)) : 1, scale = canvas.clientHeight / view.height * share;
  ring.hidden = share <= 0;
  ring.style.left = canvas.clientWidth / 2 + dot(from, right) * scale + "px";
  ring.style.top = canvas.clientHeight / 2 - dot(from, up) * scale + "px";
}

function window_size() {
  const ratio = window.devicePixelRatio || 1;
  resize(Math.max(1, Math.round(innerWidth * ratio)), Math.max(1, Math.round(innerHeight * ratio)));
  if (!part) return;
  if (!view.height) fit();
  redraw();
}

// Hands: drag turns, with shift or another button it moves; two fingers move and change the size.
const fingers = new Map();
function turn(x, y) {
  view.azimuth -= x * 0.4;
  view.elevation = Math.min(90, Math.max(-90, view.elevation + y * 0.4));
}
function move(x, y) {
  const { right, up } = axes(), step = view.height / canvas.clientHeight;
  view.centre = view.centre.map((c, a) => c - right[a] * x * step + up[a] * y * step);
}
const zoom = (by) => { view.height = Math.min(part.edge * 8, Math.max(part.edge / 1e5, view.height * by)) };
// Where a press began that may be a click.
let press = null;
canvas.addEventListener("pointerdown", (e) => {
  if (!part) return;
  canvas.setPointerCapture(e.pointerId);
  fingers.set(e.pointerId, [e.clientX, e.clientY]);
  press = fingers.size === 1 && e.button === 0 && !e.shiftKey ? [e.clientX, e.clientY] : null;
});
canvas.addEventListener("pointerup", (e) => {
  fingers.delete(e.pointerId);
  if (press) pick(e.clientX, e.clientY);
  press = null;
});
canvas.addEventListener("pointercancel", (e) => { fingers.delete(e.pointerId); press = null });
canvas.addEventListener("pointermove", (e) => {
  const before = fingers.get(e.pointerId);
  if (!before) return;
  // Hands tremble.
  if (press && Math.hypot(e.clientX - press[0], e.clientY - press[1]) < 4) return;
  press = null;
  const [x, y] = [e.clientX - before[0], e.clientY - before[1]];
  if (fingers.size === 2) {
    const [other] = [...fingers].filter(([id]) => id !== e.pointerId).map(([, at]) => at);
    const apart = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) + 1;
    zoom(apart(before) / apart([e.clientX, e.clientY]));
    move(x / 2, y / 2);
  } else if (e.shiftKey || e.buttons & 6) move(x, y);
  else turn(x, y);
  fingers.set(e.pointerId, [e.clientX, e.clientY]);
  redraw();
});
canvas.addEventListener("contextmenu", (e) => e.preventDefault());
canvas.addEventListener("wheel", (e) => { e.preventDefault(); if (!part) return; zoom(Math.exp(e.deltaY * 0.0012)); redraw() }, { passive: false });
canvas.addEventListener("keydown", (e) => {
  if (!part) return;
  const arrow = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[e.key];
  if (arrow) (e.shiftKey ? move : turn)(...arrow);
  else if (e.key === "+" || e.key === "=") zoom(0.9);
  else if (e.key === "-") zoom(1 / 0.9);
  else if (e.key === "Home") fit();
  else if (e.key === "p") by("perspective").click();
  else if (e.key === "Enter") pick(canvas.clientWidth / 2, canvas.clientHeight / 2);
  else return;
  e.preventDefault();
  redraw();
});
by("view").addEventListener("change", (e) => { if (!part) return; [view.azimuth, view.elevation] = e.target.value.split(",").map(Number); fit(); redraw() });
by("perspective").checked = view.opening > 0;
by("perspective").addEventListener("change", (e) => { view.opening = e.target.checked ? 30 : 0; redraw() });
by("style").addEventListener("change", (e) => { state.style = Number(e.target.value); redraw() });
by("axis").addEventListener("change", (e) => { state.axis = Number(e.target.value); redraw() });
by("at").addEventListener("input", (e) => { state.at = Number(e.target.value); redraw() });
by("level").addEventListener("change", (e) => {
  const level = Number(e.target.value);
  state.done = false;
  if (!data) flow("Stop");
  worker.postMessage({ level });
});
// For programs that look at the page.
window.brickfield = { state, view, resize, fit, draw, pick, picture: () => { draw(); return canvas.toDataURL() } };
if (is_file) {
  state.error = "this folder shows itself through a web server only, as of: python3 -m http.server";
  say(state.error);
} else if (!state.error) {
  prepare();
  addEventListener("resize", window_size);
  window_size();
  if (!data) flow("Stop");
} else worker.terminate();
