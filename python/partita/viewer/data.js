// The run: tables unpacked from text, and small vector algebra.

/** A table packed by the page's writer, as rows of numbers: one row per frame. */
function unpack(table, frames) {
  const bytes = Uint8Array.from(atob(table.data), (c) => c.charCodeAt(0));
  const { columns, low, step } = table, count = table.moving.length, moving = [], fixed = [];
  table.moving.forEach((more, m) => moving.push(m ? moving[m - 1] + more : more));
  for (let c = 0, m = 0; c < columns; c++) if (moving[m] === c) m++; else fixed.push(c);
  const stored = low ? new Uint16Array(bytes.buffer) : new Float32Array(bytes.buffer);
  const values = new Float32Array(frames * columns);
  for (let f = 0; f < frames; f++) {
    if (table.still.length) fixed.forEach((c, i) => { values[f * columns + c] = table.still[i]; });
    for (let m = 0; m < count; m++) {
      const x = stored[f * count + m];
      values[f * columns + moving[m]] = !low ? x : x === 65535 ? NaN : low[m] + step[m] * x;
    }
  }
  // Between two outputs on the straight line; next to a value that is not finite, the nearer output.
  const between = (frame, column) => {
    const first = Math.floor(frame), s = frame - first, a = values[first * columns + column];
    if (s === 0) return a;
    const b = values[(first + 1) * columns + column], x = a + s * (b - a);
    return Number.isFinite(x) ? x : s < 0.5 ? a : b;
  };
  return {
    columns, values,
    get: (frame, column = 0) => between(frame, column),
    vector: (frame, i) => [between(frame, 3 * i), between(frame, 3 * i + 1), between(frame, 3 * i + 2)],
  };
}

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const along = (a, b, s) => [a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s, a[2] + (b[2] - a[2]) * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => scaled(a, 1 / (length(a) || 1));
const isFinite3 = (a) => Number.isFinite(a[0] + a[1] + a[2]);

/** Any unit vector perpendicular to a unit vector. */
function perpendicular(a) {
  return unit(cross(a, Math.abs(a[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0]));
}

/** A scene with all that its writer left out because it is usual. */
function filled(scene) {
  const none = { axis: null, axis2: null, atParent: null, rail: null, seat: null, seatParent: null, open: [false, false] };
  const joints = scene.joints.map((joint) => ({ ...none, ...joint }));
  const curves = scene.curves.map((curve) => {
    if (curve.load === undefined) return { labels: [""], size: false, open: false, ...curve };
    const { load, of } = curve, moment = of === "moment";
    return {
      group: `${of}s of joints`, name: `${of} in ${joints[load].name}`, table: of, columns: [3 * load, 3 * load + 1, 3 * load + 2],
      unit: moment ? "N m" : "N", labels: [""], size: true, open: joints[load].open[moment ? 1 : 0],
    };
  });
  return { ...scene, joints, curves };
}

/**
 * The run as the rest of the page sees it: where bodies and joints are in a frame. A frame is the number of an output; with
 * a fraction, an instant between two: poses by `Between`, loads on straight lines.
 */
class Run {
  constructor(scene) {
    this.scene = filled(scene);
    this.frames = scene.frames;
    this.tables = {};
    for (const name of Object.keys(scene.tables)) this.tables[name] = unpack(scene.tables[name], scene.frames);
    this.t = this.tables.t.values;
    this.between = new Between(this);
  }

  /** Vector in body axes, turned into the world; body -1 is the ground. */
  turned(frame, body, v) {
    if (body < 0) return v;
    const whole = Number.isInteger(frame), { values, columns } = this.tables.turn, c = whole ? frame * columns + 4 * body : 0;
    if (!whole) this.between.at(frame);
    const q = whole ? values : this.between.turns[body];
    const u = [q[c], q[c + 1], q[c + 2]], w = q[c + 3];
    const twice = scaled(cross(u, v), 2);
    return add(add(v, scaled(twice, w)), cross(u, twice));
  }

  /** Point in body axes, placed in the world. */
  placed(frame, body, p) {
    if (body < 0) return p;
    if (!Number.isInteger(frame)) this.between.at(frame);
    const origin = Number.isInteger(frame) ? this.tables.position.vector(frame, body) : this.between.positions[body];
    return add(origin, this.turned(frame, body, p));
  }

  jointPoint(frame, joint) {
    const { child, at } = this.scene.joints[joint]; // a joint's point rests on its child
    return this.placed(frame, child, at);
  }

  /** Where a joint is drawn: in its point, or further along its axis. */
  seatOf(frame, joint) {
    const { child, seat } = this.scene.joints[joint];
    return seat ? this.placed(frame, child, seat) : this.jointPoint(frame, joint);
  }

  /** Indices of the independent velocities in a frame. */
  independent(frame) {
    let now = [];
    for (const [first, indices] of this.scene.independent) {
      if (first > frame) break;
      now = indices;
    }
    return now;
  }

  /** The frame at a time, with a fraction where it lies between outputs. */
  instantAt(time) {
    const near = this.frameAt(time), first = Math.max(0, Math.min(this.frames - 2, this.t[near] > time ? near - 1 : near));
    const step = this.t[first + 1] - this.t[first];
    return step > 0 ? first + Math.max(0, Math.min(1, (time - this.t[first]) / step)) : near;
  }

  /** The time of a frame. */
  timeOf(frame) {
    return this.tables.t.get(frame);
  }

  /** The frame nearest to a time. */
  frameAt(time) {
    let low = 0, high = this.frames - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.t[middle] <= time) low = middle; else high = middle;
    }
    return Math.abs(this.t[high] - time) < Math.abs(this.t[low] - time) ? high : low;
  }

  /** The q-th quantile of the lengths of all finite vectors of a table; 0 when all vanish. */
  typicalLength(name, q) {
    const table = this.tables[name], lengths = [];
    const step = Math.max(1, Math.floor(table.values.length / 3 / 50000));
    for (let i = 0; i < table.values.length / 3; i += step) {
      const l = length([table.values[3 * i], table.values[3 * i + 1], table.values[3 * i + 2]]);
      if (Number.isFinite(l) && l > 0) lengths.push(l);
    }
    lengths.sort((a, b) => a - b);
    return lengths.length ? lengths[Math.floor(q * (lengths.length - 1))] : 0;
  }
}

/** A number in few digits, for people. */
function short(x, digits = 4) {
  if (!Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e5 || size < SHORT_NUMBER) return x.toExponential(digits - 2).replace("e+", "e");
  return size >= 10 ** (digits - 1) ? String(Math.round(x)) : x.toPrecision(digits);
}

const PREFIXES = ["p", "n", "µ", "m", "", "k", "M", "G"];

/** A round value with its unit, with a prefix where it would have many zeros. */
function withUnit(value, unit) {
  if (value >= SHORT_NUMBER && value < 1e5) return `${Number(value.toPrecision(1))} ${unit}`;
  const power = Math.floor(Math.log10(value) / 3 + EQUAL), prefix = PREFIXES[power + 4];
  return prefix === undefined ? `${value.toExponential(0).replace("e+", "e")} ${unit}` : `${Math.round(value / 10 ** (3 * power))} ${prefix}${unit}`;
}

/** The largest magnitude among finite numbers. */
function largest(line) {
  let most = 0;
  for (const x of line) if (Number.isFinite(x)) most = Math.max(most, Math.abs(x));
  return most;
}

/** The largest of 1, 2, 5 times a power of ten not above x. */
function roundBelow(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return (x >= 5 * power ? 5 : x >= 2 * power ? 2 : 1) * power;
}

/** A new element with a class and text; names only ever become text, never markup. */
function element(tag, className, text) {
  const e = document.createElement(tag);
  if (className) e.className = className;
  if (text !== undefined) e.textContent = text;
  return e;
}
