// Decodes level by level, so that each is seen as soon as it is there, and draws where no graphics processor does. The bytes come with
// the page, or by ranges from a server.
// The first request asks for so many bytes beyond what is needed first: they are wanted next.
const HEAD = 512, ENTRY = 24, FIRST = 16384, AHEAD = 1 << 20, TRIES = 4, SPLATS = 4e6;
// So many splats are drawn while the view moves, and so many milliseconds may pass until others are heard.
const MOVING = 5e5, HEARD = 40;
// What is in view is refined until its cells are a pixel, within so many splats, by so many bytes at a time; seen in pictures whose
// sides are so many times smaller. A directory of more bytes is not read for that.
const VIEWED = { processor: 3e6, graphics: 6e6 }, PORTION = 1 << 19, GAP = 1 << 14, SMALLER = 3, DIRECTORY = 1 << 22;

// What a server did not send; it may be asked again.
class Lost extends Error {}

// A file in memory.
class Here {
  constructor(bytes) { Object.assign(this, { bytes, received: bytes.length, size: bytes.length, ranges: true, patient: true }) }
  async *read(from, to) { yield this.bytes.subarray(from, to) }
}

// A file on a server. One that knows no ranges sends all of it, from the beginning: that answer is read on as long as places go up.
class There {
  constructor(address, ahead) { Object.assign(this, { address, ahead, received: 0, ranges: true, patient: false, tag: null, size: null, answer: null }) }
  stop() { this.abort?.abort(); this.answer = null }
  async *read(from, to) {
    for (let tries = 0; from < Math.min(to, this.size ?? to);) {
      try {
        for await (const bytes of this.some(from, to)) { from += bytes.length; tries = 0; yield bytes }
        if (from < Math.min(to, this.size ?? from, this.answer?.end ?? to)) throw new Lost("the server ended early");
      } catch (error) {
        this.answer = null;
        if (!(error instanceof Lost) || ++tries === TRIES) throw error;
        await new Promise((go) => setTimeout(go, 250 << tries));
        if (stopped) throw error;
      }
    }
  }
  async *some(from, to) {
    // An answer that comes is read on, unless there is much between.
    const { answer: old } = this;
    const is_on_way = old && old.at <= from && from < old.end && (!this.ranges || from - old.at < FIRST);
    if (old && !is_on_way) this.stop();
    if (!is_on_way) this.answer = await this.ask(from, this.size === null ? Math.max(to, this.ahead) : to);
    const { answer } = this;
    while (from < to) {
      let piece = answer.kept;
      answer.kept = null;
      if (!piece) {
        const { value, done } = await answer.reader.read().catch((error) => { throw lost(error) });
        if (done) return;
        this.received += value.length;
        piece = value;
      }
      // What comes before is passed over, what comes behind is kept.
      const skip = Math.min(piece.length, Math.max(0, from - answer.at)), end = Math.min(piece.length, to - answer.at);
      if (end < piece.length) answer.kept = piece.subarray(end);
      answer.at += Math.max(end, 0);
      if (end > skip) { from += end - skip; yield piece.subarray(skip, end) }
    }
  }
  async ask(from, to) {
    this.abort = new AbortController();
    const headers = { Range: "bytes=" + from + "-" + (to - 1) };
    if (this.tag) headers["If-Range"] = this.tag;
    const got = await fetch(this.address, { headers, signal: this.abort.signal }).catch((error) => { throw lost(error) });
    if (got.status >= 500) throw new Lost("the server says " + got.status);
    if (got.status !== 206 && got.status !== 200) throw Error("the server says " + got.status);
    const part = got.status === 206, of = /^bytes (\d+)-\d+\/(\d+)$/.exec(got.headers.get("Content-Range") || "");
    if (part && (!of || Number(of[1]) !== from)) throw Error("the server sent another range than was asked for");
    const length = got.headers.get("Content-Encoding") ? null : got.headers.get("Content-Length");
    const size = part ? Number(of[2]) : length && Number(length), tag = got.headers.get("ETag");
    const changed = this.size !== null && (part !== this.ranges || size !== this.size || (this.tag && tag !== this.tag));
    if (changed) throw Error("it has changed on the server; load the page again");
    Object.assign(this, { ranges: part, size });
    if (tag && !tag.startsWith("W/")) this.tag = tag;
    return { at: part ? from : 0, end: part ? Math.min(to, size) : size ?? Infinity, kept: null, reader: got.body.getReader() };
  }
}
const lost = (error) => error.name === "AbortError" ? error : new Lost("the server does not answer");

let e, compiled, source, base, part_crc = 0, ready = false, running = false, stopped = false, shown = true, given = 0, began = 0;
// Units that are known and decoded, the deepest level that is whole, the one that is wanted; what was drawn last.
let directory = [], next = 0, whole = 0, wanted = 0, count = 0, units = 0, ends = [0];
// What the page looks at and whether it draws itself; the level that was given, that of the splats which are laid out; splats of each
// level, and the last one of the head.
let look = null, arrays = false, shown_level = -1, laid = -1, splats_of = [], head_level = 0, deepest = 0;
// Whether all that is in view is as fine as it gets, how often the page looked elsewhere, and whether a coarser level was asked for.
let refined = false, looks = 0, limited = false;

const put = (...parts) => put_into(e, ...parts);
function put_into(program, ...parts) {
  const length = parts.reduce((sum, part) => sum + part.length, 0);
  let at = program.input(length);
  for (const part of parts) {
    new Uint8Array(program.memory.buffer, at, part.length).set(part);
    at += part.length;
  }
}
// What is there of a range.
async function bytesOf(from, to, file = source) {
  const pieces = [];
  for await (const piece of file.read(from, to)) pieces.push(piece);
  return joined(pieces);
}
function joined(pieces) {
  const out = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
  let at = 0;
  for (const piece of pieces) { out.set(piece, at); at += piece.length }
  return out;
}
// Bytes that were packed with gzip.
const unpacked = (bytes) => new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();

// Splats of a level into where pictures and picks take them from.
function lay(level) {
  if (laid !== level) count = e.splats(level);
  laid = level;
}
// Tells the page of a level, with its splats if it draws them itself; else draws it.
function give(level) {
  laid = -1;
  lay(shown_level = level);
  shown = !arrays;
  given = performance.now();
  const told = { level: Math.min(level, whole), whole, count, last: whole >= wanted, refined: refined || whole >= deepest, finer: level > whole, received: source.received, milliseconds: given - began, at: performance.timeOrigin + given };
  if (arrays) {
    const packed = textures();
    return postMessage({ ...told, ...packed }, [packed.places.buffer, packed.others.buffer]);
  }
  postMessage(told);
  paint();
}
// A picture of what was given last, as the page looks at it.
function paint() {
  if (arrays || !look || shown_level < 0) return;
  let level = shown_level;
  if (look.moving) while (level > head_level && splats_of[level] > MOVING) level--;
  lay(level);
  const [width, height] = look.look;
  put(new Uint8Array(look.look.buffer));
  if (!e.draw()) return;
  const pixels = new Uint8Array(e.memory.buffer, e.pixels(), width * height * 4).slice();
  postMessage({ pixels: pixels.buffer, width, height, turn: look.turn }, [pixels.buffer]);
}
// Splats as textures have them, in rows of 4096.
function textures() {
  const five = new Uint32Array(e.memory.buffer, e.output(), count * 5);
  const rows = Math.max(1, Math.ceil(count / 4096)), places = new Uint32Array(rows * 16384), others = new Uint32Array(rows * 4096);
  for (let n = 0, from = 0, to = 0; n < count; n++) {
    places[to++] = five[from++];
    places[to++] = five[from++];
    places[to++] = five[from++];
    places[to++] = five[from++];
    others[n] = five[from++];
  }
  return { rows, places, others };
}
// Entries of the directory, which say where units are.
function learn(bytes) {
  const of = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  for (let at = 0; at < bytes.length; at += ENTRY) {
    const key = of.getBigUint64(at, true);
    directory.push(Math.floor((key.toString(2).length - 1) / 3));
    ends.push(ends[ends.length - 1] + of.getUint32(at + 8, true));
  }
}
async function open() {
  const first = await bytesOf(0, HEAD);
  if (first.length < HEAD) throw Error("it ends within its header");
  const view = new DataView(first.buffer, first.byteOffset, first.length);
  if (view.getUint32(0) !== 0x89425350) throw Error("it does not begin as a file of splats does");
  part_crc = view.getUint32(508, true);
  units = view.getUint32(108, true);
  const start = HEAD + ENTRY * units;
  base = start + view.getUint32(112, true);
  if (source.size && base > source.size) throw Error("it ends within its head");
  whole = head_level = view.getUint8(106);
  deepest = Math.min(16, view.getUint8(104));
  for (let level = 0; level <= deepest; level++) splats_of.push(Number(view.getBigUint64(128 + 16 * level, true)));
  // As deep as a browser likes; more where the reader asks.
  wanted = deepest;
  while (!source.patient && wanted > whole && splats_of[wanted] > SPLATS) wanted--;
  // The page finds its view while the rest comes.
  await has_decoder;
  postMessage({ header: first.slice(0, HEAD), wanted });
  // Without ranges all of the directory comes first.
  const entries = source.ranges && !source.patient ? Math.min(units, Math.floor((FIRST - HEAD) / ENTRY)) : units;
  const begin = await bytesOf(HEAD, HEAD + ENTRY * entries), head = await bytesOf(start, base);
  e = (await compiled).instance.exports;
  put(first, begin, head);
  if (!e.open(entries)) throw Error("its head is damaged");
  learn(begin);
  ready = true;
  give(whole);
}
// Reads units until the wanted level is there.
async function load() {
  while (whole < wanted && !stopped) {
    if (next === directory.length && next < units) {
      await know(Math.min(units, directory.length * 4));
    }
    let last = next;
    while (last < directory.length && directory[last] < wanted) last++;
    await decode(last);
    if (next === units || (next < directory.length && directory[next] >= wanted)) {
      whole = wanted;
      give(whole);
    }
  }
}
// Entries of the directory up to so many.
async function know(more) {
  const bytes = await bytesOf(HEAD + ENTRY * directory.length, HEAD + ENTRY * more);
  put(bytes);
  if (!e.entries()) throw Error("its directory is damaged");
  learn(bytes);
}
// Reads what refines the picture that the page looks at, the most urgent first. A server without ranges would send all of it for each.
async function refine() {
  const most = HEAD + ENTRY * units > DIRECTORY ? 0 : units;
  while (wanted < deepest && source.ranges && !limited && look && !look.moving && !stopped && !refined) {
    if (directory.length < most) await know(most);
    const of = looks, found = survey();
    let read = 0;
    for (const run of found) {
      await unitsOf(run);
      read++;
      if (stopped || looks !== of) break;
    }
    refined = !found.length && looks === of;
    if (read || refined) give(deepest);
    await heard();
  }
}
const heard = () => new Promise((go) => setTimeout(go));
// What refines the picture and has room: runs of units that lie so near each other in the file that one request costs less than two.
function survey() {
  lay(deepest);
  const numbers = look.look.slice();
  [0, 1].forEach((a) => { numbers[a] = Math.max(1, Math.ceil(numbers[a] / SMALLER)) });
  numbers[18] *= SMALLER;
  put(new Uint8Array(numbers.buffer));
  const length = e.survey(1 / SMALLER), found = new Uint32Array(e.memory.buffer, e.found(), length).slice(), chosen = [], runs = [];
  let bytes = 0, most = arrays ? VIEWED.graphics : VIEWED.processor;
  for (const unit of found) {
    const splats = bytes > PORTION ? 0 : e.room(unit, most, wanted);
    if (!splats) break;
    most -= splats;
    bytes += ends[unit + 1] - ends[unit];
    chosen.push(unit);
  }
  for (const unit of chosen.sort((a, b) => a - b)) {
    const last = runs[runs.length - 1];
    if (last && ends[unit] - ends[last[last.length - 1] + 1] <= GAP) last.push(unit);
    else runs.push([unit]);
  }
  return runs;
}
async function unitsOf(run) {
  const first = ends[run[0]], bytes = await bytesOf(base + first, base + ends[run[run.length - 1] + 1]);
  for (const unit of run) {
    put(bytes.subarray(ends[unit] - first, ends[unit + 1] - first));
    if (!e.unit(unit)) throw Error("unit " + unit + " is damaged");
  }
  laid = -1;
}
async function decode(last) {
  let rest = new Uint8Array(0), paused = performance.now();
  for await (const piece of source.read(base + ends[next], base + ends[last])) {
    rest = rest.length ? joined([rest, piece]) : piece;
    let at = 0;
    while (next < last && ends[next + 1] - ends[next] <= rest.length - at) {
      if (directory[next] > whole) give(whole = directory[next]);
      const length = ends[next + 1] - ends[next];
      put(rest.subarray(at, at + length));
      if (!e.unit(next)) throw Error("unit " + next + " is damaged");
      at += length;
      next++;
      // Others want to be heard, and to see what is there.
      if (performance.now() - paused > HEARD) {
        await heard();
        paused = performance.now();
        if (stopped) return;
        postMessage({ received: source.received });
        if (shown && paused - given > 2000) give(directory[next - 1] + 1);
      }
    }
    rest = rest.subarray(at);
  }
  if (next < last) throw Error("it ends within unit " + next);
}
async function run() {
  if (running) return;
  running = true;
  stopped = false;
  try {
    if (!ready) await open();
    await load();
    await refine();
    if (stopped) postMessage({ stopped: true });
  } catch (error) {
    const text = String(error.message || error);
    // The page hears nothing before it has given the decoder.
    await has_decoder;
    if (stopped || error.name === "AbortError") postMessage({ stopped: true });
    else postMessage(error instanceof Lost ? { lost: text } : { error: text });
  }
  running = false;
}

// The nearest splat on a ray, in coordinates around the middle of the part.
function pick({ from, along, highest, open, origin, edge, middle }) {
  const words = new Uint32Array(e.memory.buffer, e.output(), count * 5), bytes = new Int8Array(e.memory.buffer, e.output(), count * 20);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const plane = (at) => {
    const n = [bytes[at], bytes[at + 1], bytes[at + 2]], length = Math.hypot(...n) || 1;
    return [n.map((c) => c / length), bytes[at + 3] / 16];
  };
  let best = null;
  for (let n = 0; n < count; n++) {
    const xy = words[5 * n], zl = words[5 * n + 1], level = zl >>> 16 & 31, cell = edge / (32 << level);
    const x = origin[0] + ((xy & 65535) + 0.5) * cell - from[0], y = origin[1] + ((xy >>> 16) + 0.5) * cell - from[1];
    const z = origin[2] + ((zl & 65535) + 0.5) * cell - from[2], near = x * along[0] + y * along[1] + z * along[2];
    if (x * x + y * y + z * z - near * near > 1.27 * cell * cell || (best && near - 1.2 * cell > best.far)) continue;
    const [normal, offset] = plane(20 * n + 8), slope = dot(normal, along);
    if (slope === 0 || (!open && slope > 0)) continue;
    const middle = [x, y, z], far = (dot(normal, middle) + offset * cell) / slope;
    if (far <= 0 || (best && far >= best.far)) continue;
    const inCell = middle.map((c, a) => (along[a] * far - c) / cell);
    const share = inCell.reduce((sum, c, a) => sum + (c - normal[a] * offset) ** 2, 0) / 0.75;
    const cut = (at, bit) => {
      if (words[at / 4] === 0) return false;
      const [other, d] = plane(at), sign = bytes[20 * n + 7] >> bit & 1 ? -1 : 1;
      return sign * dot(other, inCell) > sign * d;
    };
    if (share > 1 || inCell.some((c) => Math.abs(c) > 0.65) || cut(20 * n + 12, 0) || cut(20 * n + 16, 1)) continue;
    const place = from.map((c, a) => c + along[a] * far);
    if (place.every((c, a) => c <= highest[a])) best = { far, place, normal, level };
  }
  last_pick++;
  postMessage({ picked: best });
  if (best) tell(best, edge, middle);
}

// The table of beads: the file, what reads it, whether its directory was read, and what is wrong with it.
let picks = null, p = null, picks_ready = false, picks_fault = null, picks_program = null, picks_turn = Promise.resolve(), last_pick = 0;
const PICKS_HEAD = 112, PICKS_BLOCK = 36;
function tell(best, edge, middle) {
  const pick = last_pick, say = (told) => { if (pick === last_pick) postMessage(told) };
  if (!picks) return picks_fault && say({ bead: null, fault: picks_fault });
  const at = best.place.map((c, a) => c + middle[a]), reach = 1.5 * edge / (32 << best.level);
  // One after the other: they share what is read.
  picks_turn = picks_turn.then(async () => {
    if (pick !== last_pick || !picks) return;
    try {
      if (!picks_ready) await open_picks();
      for (let block; (block = p.wanted(...at, reach)) >= 0;) {
        put_into(p, await bytesOf(p.start(block), p.start(block + 1), picks));
        if (!p.block(block)) throw Error("it is damaged");
      }
      say({ bead: bead_at(at, reach) });
    } catch (error) {
      const text = String(error.message || error);
      say({ bead: null, fault: text });
      // What a server did not send is asked for again by the next pick.
      if (!(error instanceof Lost)) { picks = null; picks_fault = text }
    }
  });
}
async function open_picks() {
  const first = await bytesOf(0, PICKS_HEAD, picks);
  // Without ranges all of it comes at once.
  if (!picks.ranges) picks = new Here(joined([first, await bytesOf(first.length, picks.size ?? Infinity, picks)]));
  if (first.length < PICKS_HEAD) throw Error("it ends within its header");
  const view = new DataView(first.buffer, first.byteOffset, first.length);
  const end = PICKS_HEAD + view.getUint32(68, true) + PICKS_BLOCK * view.getUint32(72, true);
  if (view.getUint32(0) !== 0x8942504b || (picks.size && end > picks.size)) throw Error("it is no table of beads");
  const bytes = await bytesOf(PICKS_HEAD, end, picks);
  p ||= (await WebAssembly.instantiate(await unpacked(picks_program), {})).instance.exports;
  put_into(p, first, bytes);
  const opened = p.open(part_crc);
  if (opened !== 1) throw Error(opened ? "it belongs to another part" : "it is damaged");
  picks_ready = true;
}
function bead_at(at, reach) {
  const length = p.nearest(...at, reach);
  if (!length) return null;
  const bytes = new Uint8Array(p.memory.buffer, p.found(), length).slice(), view = new DataView(bytes.buffer);
  const [bead, layer, first, last, bottom, top, distance, step, feature, source] = [...Array(10).keys()].map((n) => view.getFloat64(8 * n, true));
  const text = (from, to) => new TextDecoder().decode(bytes.subarray(from, to));
  return { bead, layer: layer + 1, lines: [first, last], bottom, top, distance, step, feature: text(80, 80 + feature), source: text(80 + feature, 80 + feature + source) };
}

let compile, has_decoder = new Promise((done) => { compile = done });
compiled = has_decoder.then(unpacked).then((bytes) => WebAssembly.instantiate(bytes, {}));
compiled.catch(() => {});
onmessage = async ({ data }) => {
  if (data.address) source = new There(data.address, AHEAD);
  if (data.bytes) source = new Here(data.bytes);
  if (data.decoder) compile(data.decoder);
  if (data.address || data.bytes) {
    began = performance.now();
    return run();
  }
  if (data.arrays !== undefined) {
    arrays = data.arrays;
    if (ready) give(shown_level);
    if (ready && !stopped) run();
  }
  if (data.look) {
    const is_other = !look || look.moving !== data.moving || data.look.some((number, n) => number !== look.look[n]);
    look = data;
    if (is_other) { looks++; refined = false }
    paint();
    if (is_other && !look.moving && ready && whole >= wanted && !stopped) run();
  }
  if (data.drawn) shown = true;
  if (data.stop) { stopped = true; source.stop?.() }
  if (data.go) run();
  if (data.picks) {
    picks_program = data.picks.program;
    picks = data.picks.bytes ? new Here(data.picks.bytes) : new There(data.picks.address, FIRST);
  }
  if (data.pick && ready) {
    lay(shown_level);
    pick(data.pick);
  }
  if (data.level !== undefined && ready) {
    limited = data.level < whole;
    if (data.level <= whole) give(data.level);
    else wanted = data.level;
    refined = false;
    if (!limited) run();
  }
};
