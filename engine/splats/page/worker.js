// Decodes level by level, so that each is seen as soon as it is there. The bytes come with the page, or by ranges from a server.
const HEAD = 512, ENTRY = 24, FIRST = 16384, TRIES = 4, SPLATS = 4e6;

// What a server did not send; it may be asked again.
class Lost extends Error {}

// A file in memory.
class Here {
  constructor(bytes) { Object.assign(this, { bytes, received: bytes.length, size: bytes.length, ranges: true, patient: true }) }
  async *read(from, to) { yield this.bytes.subarray(from, to) }
}

// A file on a server. One that knows no ranges sends all of it, from the beginning: that answer is read on as long as places go up.
class There {
  constructor(address) { Object.assign(this, { address, received: 0, ranges: true, patient: false, tag: null, size: null, answer: null, begin: null }) }
  stop() { this.abort?.abort(); this.answer = null }
  async *read(from, to) {
    if (this.begin && from < this.begin.length) {
      const piece = this.begin.subarray(from, to);
      from += piece.length;
      yield piece;
    }
    for (let tries = 0; from < Math.min(to, this.size ?? to);) {
      try {
        for await (const bytes of this.some(from, to)) { from += bytes.length; tries = 0; yield bytes }
        if (from < Math.min(to, this.size ?? from)) throw new Lost("the server ended early");
        return;
      } catch (error) {
        this.answer = null;
        if (!(error instanceof Lost) || ++tries === TRIES) throw error;
        await new Promise((go) => setTimeout(go, 250 << tries));
        if (stopped) throw error;
      }
    }
  }
  async *some(from, to) {
    if (!this.ranges && this.answer && this.answer.at > from) this.stop();
    if (this.ranges || !this.answer) this.answer = await this.ask(from, to);
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
    return { at: part ? from : 0, kept: null, reader: got.body.getReader() };
  }
}
const lost = (error) => error.name === "AbortError" ? error : new Lost("the server does not answer");

let e, compiled, source, base, part_crc = 0, ready = false, running = false, stopped = false, shown = true, given = 0, began = 0;
// Units that are known and decoded, the deepest level that is whole, the one that is wanted; what was drawn last.
let directory = [], next = 0, whole = 0, wanted = 0, count = 0, units = 0, ends = [0];

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
// Puts the splats of a level into what the page draws.
function give(level) {
  count = e.splats(level);
  const five = new Uint32Array(e.memory.buffer, e.output(), count * 5);
  // Rows of 4096, as textures have them.
  const rows = Math.max(1, Math.ceil(count / 4096)), places = new Uint32Array(rows * 16384), others = new Uint32Array(rows * 4096);
  for (let n = 0, from = 0, to = 0; n < count; n++) {
    places[to++] = five[from++];
    places[to++] = five[from++];
    places[to++] = five[from++];
    places[to++] = five[from++];
    others[n] = five[from++];
  }
  shown = false;
  given = performance.now();
  const told = { level, whole, count, rows, places, others, last: whole >= wanted, received: source.received, milliseconds: given - began, at: performance.timeOrigin + given };
  postMessage(told, [places.buffer, others.buffer]);
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
  const first = await bytesOf(0, FIRST);
  if (first.length < HEAD) throw Error("it ends within its header");
  const view = new DataView(first.buffer, first.byteOffset, first.length);
  if (view.getUint32(0) !== 0x89425350) throw Error("it does not begin as a file of splats does");
  source.begin = first;
  part_crc = view.getUint32(508, true);
  units = view.getUint32(108, true);
  const start = HEAD + ENTRY * units;
  base = start + view.getUint32(112, true);
  if (source.size && base > source.size) throw Error("it ends within its head");
  // Without ranges all of the directory comes first.
  const entries = source.ranges && !source.patient ? Math.min(units, Math.floor((FIRST - HEAD) / ENTRY)) : units;
  const begin = await bytesOf(0, HEAD + ENTRY * entries), head = await bytesOf(start, base);
  e = (await compiled).instance.exports;
  put(begin, head);
  if (!e.open(entries)) throw Error("its head is damaged");
  learn(begin.subarray(HEAD));
  whole = view.getUint8(106);
  // As deep as a browser likes; more where the reader asks.
  wanted = view.getUint8(104);
  while (!source.patient && wanted > whole && Number(view.getBigUint64(128 + 16 * wanted, true)) > SPLATS) wanted--;
  ready = true;
  postMessage({ header: first.slice(0, HEAD), wanted });
  give(whole);
}
// Reads units until the wanted level is there.
async function load() {
  while (whole < wanted && !stopped) {
    if (next === directory.length && next < units) {
      const more = Math.min(units, directory.length * 4);
      const bytes = await bytesOf(HEAD + ENTRY * directory.length, HEAD + ENTRY * more);
      put(bytes);
      if (!e.entries()) throw Error("its directory is damaged");
      learn(bytes);
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
      if (performance.now() - paused > 100) {
        await new Promise((go) => setTimeout(go));
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
    if (stopped) postMessage({ stopped: true });
  } catch (error) {
    const text = String(error.message || error);
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
  const first = await bytesOf(0, FIRST, picks);
  // Without ranges all of it comes at once.
  if (!picks.ranges) picks = new Here(joined([first, await bytesOf(first.length, picks.size ?? Infinity, picks)]));
  picks.begin = first;
  if (first.length < PICKS_HEAD) throw Error("it ends within its header");
  const view = new DataView(first.buffer, first.byteOffset, first.length);
  const end = PICKS_HEAD + view.getUint32(68, true) + PICKS_BLOCK * view.getUint32(72, true);
  if (view.getUint32(0) !== 0x8942504b || (picks.size && end > picks.size)) throw Error("it is no table of beads");
  const bytes = await bytesOf(0, end, picks);
  p ||= (await WebAssembly.instantiate(picks_program, {})).instance.exports;
  put_into(p, bytes);
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

onmessage = async ({ data }) => {
  if (data.decoder) {
    began = performance.now();
    compiled = WebAssembly.instantiate(data.decoder, {});
    source = data.bytes ? new Here(data.bytes) : new There(data.address);
    return run();
  }
  if (data.drawn) shown = true;
  if (data.stop) { stopped = true; source.stop?.() }
  if (data.go) run();
  if (data.picks) {
    picks_program = data.picks.program;
    picks = data.picks.bytes ? new Here(data.picks.bytes) : new There(data.picks.address);
  }
  if (data.pick && ready) pick(data.pick);
  if (data.level !== undefined && ready) {
    if (data.level <= whole) return give(data.level);
    wanted = data.level;
    run();
  }
};
