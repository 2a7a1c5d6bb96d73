const by = (id) => document.getElementById(id);
const stage = by("stage"), said = document.querySelector("output");
const decoded = (id) => Uint8Array.from(atob(by(id).textContent.trim()), (c) => c.charCodeAt(0));
const say = (text) => { said.textContent = text };
// The worker was made further up, and reads by now what does not come with the page.
const data = by("data").textContent.trim(), is_file = !data && location.protocol === "file:";
worker.onmessage = take;
if (!is_file) worker.postMessage({ decoder: decoded("decoder"), ...(data ? { bytes: decoded("data") } : {}) });

// What the file says of itself, once its header is there.
let part = null;
function begin({ header, wanted }) {
  const head = new DataView(header.buffer), f64 = (at) => head.getFloat64(at, true), three = (at) => [f64(at), f64(at + 8), f64(at + 16)];
  const low = three(48), high = three(72), middle = low.map((c, a) => (c + high[a]) / 2), origin = three(16).map((c, a) => c - middle[a]);
  const unit = [...header.subarray(96, 104)].filter((c) => c).map((c) => String.fromCharCode(c)).join("");
  part = { edge: f64(40), low, high, middle, origin, unit, deepest: head.getUint8(104) };
  Object.assign(by("level"), { max: part.deepest, value: wanted });
  // At once: the browser's first frame may be long in coming.
  window_size(drawer ? tell_look : draw);
}

// The state of the view: angles in degrees, what is in the middle, how much of the world the height shows there, the angle that
// it has, 0 for parallel rays.
const view = { azimuth: -45, elevation: 35.264389682754654, opening: 0, centre: [0, 0, 0], height: 0 };
const state = { count: 0, level: 0, style: 0, axis: -1, at: 0.5, done: false, stopped: false, drawn: 0, milliseconds: 0, received: 0, error: null, picked: null, drawer: "processor", log: [] };
// Columns and rows of the picture.
let size = [1, 1];
const asked_view = location.hash.slice(1).split(",").map(Number);
if (location.hash && asked_view.every(Number.isFinite)) [view.azimuth, view.elevation = 0, view.opening = 0] = asked_view;

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
  const frame = axes(), sides = [size[0] * 0.47, size[1] * 0.47];
  const ends = [...Array(8).keys()].map((n) => [0, 1, 2].map((a) => (part.high[a] - part.low[a]) * ((n >> a & 1) - 0.5)))
    .map((end) => [dot(frame.right, end), dot(frame.up, end), dot(frame.towards, end)]);
  const most = (of) => Math.max(...ends.map(of));
  view.centre = [0, 0, 0];
  if (view.opening) {
    const step = slope() * 2 / size[1];
    const needed = (a) => most((end) => end[2] + Math.abs(end[a]) / (step * sides[a]));
    view.height = 2 * slope() * Math.max(needed(0), needed(1), most((end) => end[2]) * 1.01);
  } else view.height = size[1] * Math.max(...[0, 1].map((a) => most((end) => Math.abs(end[a])) / sides[a]));
}
const slope = () => Math.tan(view.opening * Math.PI / 360);
// Where the eye is, and how far from the middle; far away for parallel rays.
function eye() {
  const { towards } = axes(), distance = view.opening ? view.height / 2 / slope() : part.edge * 4;
  return { at: view.centre.map((c, a) => c + towards[a] * distance), distance };
}
const cut_at = () => [0, 1, 2].map((a) => a === state.axis ? part.low[a] + (part.high[a] - part.low[a]) * state.at - part.middle[a] : 1e30);

// Who draws: the worker, by the processor, as long as there is no `drawer`. What it was asked for last, whether its picture is awaited,
// and whether another is wanted by then; while the view moves it may take coarser splats.
let drawer = null, asked_look = 0, awaited = false, again = false, moving = false, resting, waiting = [];
function look() {
  if (awaited) { again = true; return }
  awaited = true;
  tell_look();
}
// Tells the worker what the page looks at.
function tell_look() {
  const { right, up, towards } = axes(), distance = view.opening ? eye().distance : 0;
  const numbers = [...size, ...part.origin, part.edge, ...right, ...up, ...towards, ...view.centre, view.height / size[1], distance, state.style, part.deepest, ...cut_at()];
  if (state.level < part.deepest) state.refined = false;
  worker.postMessage({ look: Float64Array.from(numbers), moving, turn: ++asked_look });
}
// A picture of the worker's.
function paint({ pixels, width, height, turn: of_turn }) {
  if (of_turn === asked_look) awaited = false;
  if (!drawer) {
    const surface = by("picture");
    if (surface.width !== width || surface.height !== height) Object.assign(surface, { width, height });
    surface.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(pixels), width, height), 0, 0);
    drawn();
    // To look for a graphics processor takes half a second where there is none: not while the first pictures come.
    if (!looked_for && (state.done || state.drawn === 1)) {
      looked_for = state.done;
      setTimeout(() => use_graphics(false), state.done ? 0 : 3000);
    }
  }
  waiting.filter(([asked]) => asked <= of_turn).forEach(([, done]) => done(shown_picture()));
  waiting = waiting.filter(([asked]) => asked > of_turn);
  if (again && !awaited) { again = false; draw() }
}
// `?draw=processor` and `?draw=webgl` force a drawer, `?keep` keeps each picture.
const asked_of = new URLSearchParams(location.search), asked_drawer = asked_of.get("draw");
let looked_for = asked_drawer === "processor";
function use_graphics(forced) {
  if (drawer) return;
  let made = null;
  looked_for = true;
  // A driver may refuse the programs.
  try { made = graphics(by("graphics"), forced) } catch (error) { if (forced) throw error }
  if (!made) return forced;
  drawer = made;
  state.drawer = made.name;
  state.done = awaited = again = false;
  made.surface.addEventListener("webglcontextlost", () => {
    drawer = null;
    state.drawer = "processor";
    made.surface.hidden = true;
    worker.postMessage({ arrays: false });
    window_size();
  });
  worker.postMessage({ arrays: true });
  if (part) window_size();
}

let asked = false;
const redraw = () => { if (!asked) { asked = true; requestAnimationFrame(() => { asked = false; draw() }) } };
// The same while hands move the view.
function stir() {
  moving = true;
  clearTimeout(resting);
  resting = setTimeout(() => { moving = false; redraw() }, 250);
  redraw();
}
function draw() {
  if (state.error || !part) return;
  if (!drawer) look();
  else if (drawer.draw()) {
    drawer.surface.hidden = false;
    if (news) drawer.finished();
    else tell_look();
    drawn();
  }
}
// A picture is there.
function drawn() {
  state.drawn++;
  mark();
  if (!news) return;
  state.log.push({ ...news, seen: performance.now(), ...(asked_of.has("keep") ? { picture: shown_picture() } : {}) });
  if (news.last) {
    state.done = true;
    by("level").value = news.level;
    flow(news.refined ? "" : "Stop");
  }
  news = null;
  worker.postMessage({ drawn: true });
}
// What was drawn last, as the address of a PNG.
const shown_picture = () => (drawer ? drawer.surface : by("picture")).toDataURL();
// The picture of now.
function picture() {
  if (drawer) { draw(); return Promise.resolve(shown_picture()) }
  return new Promise((done) => {
    waiting.push([asked_look + 1, done]);
    look();
  });
}

let news = null;
const megabytes = () => data ? "" : "; " + (state.received / 1e6).toFixed(1) + " MB";
function tell() {
  if (state.error || !part) return;
  const size = part.high.map((c, a) => (c - part.low[a]).toFixed(2)).join(" × ");
  const picked = state.picked ? "\n" + state.picked.text : "";
  const finer = state.finer ? ", finer in view" : "";
  say(state.count.toLocaleString("en") + " splats, level " + state.level + " of " + part.deepest + finer + "; " + size + " " + part.unit + megabytes() + picked);
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
  if (told.pixels) return paint(told);
  if (told.count !== undefined) show(told);
  tell();
}
function show({ level, whole, count, last, refined, finer, received, milliseconds, at, ...packed }) {
  if (drawer && packed.places && !drawer.take({ count, ...packed })) {
    state.done = true;
    worker.postMessage({ stop: true, drawn: true });
    return say("this browser holds no more than level " + state.level);
  }
  Object.assign(state, { level, count, milliseconds, refined, finer });
  news = { level, whole, count, received, decoded: at - performance.timeOrigin, refined, last: last && (!drawer || Boolean(packed.places)) };
  // The worker draws what is new by itself.
  if (drawer) redraw();
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
  const { right, up, towards } = axes(), { at, distance } = eye(), step = view.height / stage.clientHeight;
  const across = [(x - stage.clientWidth / 2) * step, (stage.clientHeight / 2 - y) * step];
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
  const share = view.opening ? distance / (distance - dot(from, towards)) : 1, scale = stage.clientHeight / view.height * share;
  ring.hidden = share <= 0;
  ring.style.left = stage.clientWidth / 2 + dot(from, right) * scale + "px";
  ring.style.top = stage.clientHeight / 2 - dot(from, up) * scale + "px";
}

function resize(width, height) { size = [width, height] }
function window_size(then = redraw) {
  // The processor draws no finer than the window counts.
  const ratio = drawer && window.devicePixelRatio || 1;
  resize(Math.max(1, Math.round(innerWidth * ratio)), Math.max(1, Math.round(innerHeight * ratio)));
  if (!part) return;
  if (!view.height) fit();
  then();
}

// Hands: drag turns, with shift or another button it moves; two fingers move and change the size.
const fingers = new Map();
function turn(x, y) {
  view.azimuth -= x * 0.4;
  view.elevation = Math.min(90, Math.max(-90, view.elevation + y * 0.4));
}
function move(x, y) {
  const { right, up } = axes(), step = view.height / stage.clientHeight;
  view.centre = view.centre.map((c, a) => c - right[a] * x * step + up[a] * y * step);
}
const zoom = (by) => { view.height = Math.min(part.edge * 8, Math.max(part.edge / 1e5, view.height * by)) };
// Where a press began that may be a click.
let press = null;
stage.addEventListener("pointerdown", (e) => {
  if (!part) return;
  stage.setPointerCapture(e.pointerId);
  fingers.set(e.pointerId, [e.clientX, e.clientY]);
  press = fingers.size === 1 && e.button === 0 && !e.shiftKey ? [e.clientX, e.clientY] : null;
});
stage.addEventListener("pointerup", (e) => {
  fingers.delete(e.pointerId);
  if (press) pick(e.clientX, e.clientY);
  press = null;
});
stage.addEventListener("pointercancel", (e) => { fingers.delete(e.pointerId); press = null });
stage.addEventListener("pointermove", (e) => {
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
  stir();
});
stage.addEventListener("contextmenu", (e) => e.preventDefault());
stage.addEventListener("wheel", (e) => { e.preventDefault(); if (!part) return; zoom(Math.exp(e.deltaY * 0.0012)); stir() }, { passive: false });
stage.addEventListener("keydown", (e) => {
  if (!part) return;
  const arrow = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[e.key];
  if (arrow) (e.shiftKey ? move : turn)(...arrow);
  else if (e.key === "+" || e.key === "=") zoom(0.9);
  else if (e.key === "-") zoom(1 / 0.9);
  else if (e.key === "Home") fit();
  else if (e.key === "p") by("perspective").click();
  else if (e.key === "Enter") pick(stage.clientWidth / 2, stage.clientHeight / 2);
  else return;
  e.preventDefault();
  stir();
});
by("view").addEventListener("change", (e) => { if (!part) return; [view.azimuth, view.elevation] = e.target.value.split(",").map(Number); fit(); redraw() });
by("perspective").checked = view.opening > 0;
by("perspective").addEventListener("change", (e) => { view.opening = e.target.checked ? 30 : 0; redraw() });
by("style").addEventListener("change", (e) => { state.style = Number(e.target.value); redraw() });
by("axis").addEventListener("change", (e) => { state.axis = Number(e.target.value); redraw() });
by("at").addEventListener("input", (e) => { state.at = Number(e.target.value); stir() });
by("level").addEventListener("change", (e) => {
  const level = Number(e.target.value);
  state.done = false;
  if (!data) flow("Stop");
  worker.postMessage({ level });
});
// For programs that look at the page.
window.brickfield = { state, view, resize, fit, draw, pick, picture, at: (place) => place.map((c, a) => c + part.middle[a]) };
function started() {
  if (is_file) return "this folder shows itself through a web server only, as of: python3 -m http.server";
  if (typeof DecompressionStream === "undefined") return "this browser is too old: it unpacks nothing";
  return asked_drawer === "webgl" && use_graphics(true) ? "this browser has no WebGL 2 with float colours" : null;
}
state.error = started();
if (state.error) {
  say(state.error);
  worker.terminate();
} else {
  addEventListener("resize", () => window_size());
  window_size();
  if (!data) flow("Stop");
}
