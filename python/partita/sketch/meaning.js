// What a drawing means: its bodies, joints, springs and drives; as a description for the core, a script and a model file.
// It is that of `calls.py`, to which the tests compare it.

const GROUND = "ground";
const DRAWING = "drawing"; // the name of the mechanism
const BLOCK = 0.1; // m: edge of the block of a slide, which gives it its inertia
const SECONDS = 10; // s: length of a run
// How far a drawing may be off. Scale: rad, fraction of lengths. Reason: that of mechanisms, `drawing_tolerance`.
const DRAWING_TOLERANCE = 1e-4;

class Refused extends Error {}
const refuse = (kind, name, why) => { throw new Refused(`${kind} "${name}": ${why}`); };
const spaced = ([x, y]) => [x, y, 0];

const SPLIT = 2 ** 27 + 1; // halves the digits of a number

/** The length of (x, y), the nearest number to it, as Python's: `Math.hypot` of browsers is off by one or two in the last digit. */
function hypot(x, y) {
  const h = Math.sqrt(x * x + y * y);
  if (!(h > 0 && h < Infinity)) return h;
  const square = (a) => { // a * a exactly, in two numbers
    const high = a * SPLIT - (a * SPLIT - a), low = a - high, all = a * a;
    return [all, high * high - all + 2 * high * low + low * low];
  };
  const [a, a1] = square(x), [b, b1] = square(y), [c, c1] = square(h);
  const [most, least] = a >= b ? [a, b] : [b, a];
  return h + (most - c + least + (a1 + b1 - c1)) / (2 * h);
}

class Meaning {
  constructor(data) {
    this.data = data;
    this.nodes = new Map(data.nodes.map((node) => [node.id, node]));
    this.bars = new Map(data.bars.map((bar) => [bar.id, bar]));
    this.at = new Map(data.nodes.map((node) => [node.id, []]));
    for (const bar of data.bars) {
      for (const node of [bar.a, bar.b, ...bar.more]) {
        if (this.at.get(node).includes(bar)) refuse("bar", bar.name, `it has ${this.nodes.get(node).name} twice; draw it between two points`);
        this.at.get(node).push(bar);
      }
    }
    this.slides = new Map();
    for (const slide of data.slides) {
      const at = this.nodes.get(slide.node);
      if (this.slides.has(slide.node)) refuse("slide", slide.name, `${at.name} is on another slide; remove one`);
      if (at.ground) refuse("slide", slide.name, `${at.name} is held by the ground; remove the ground or the slide`);
      if (this.at.get(slide.node).some((bar) => bar.id === slide.along)) {
        refuse("slide", slide.name, `${at.name} is a point of the bar it should slide along; choose another`);
      }
      this.slides.set(slide.node, slide);
    }
    this.jointOf = new Map(); // "node bar" -> the joint that holds the bar there
    this.bodies = data.bars.map((bar) => ({ kind: "rod", name: bar.name, start: spaced(this.on(bar, bar.a)), end: spaced(this.on(bar, bar.b)), mass: bar.mass }));
    this.joints = [];
    for (const slide of data.slides) this.addSlide(slide);
    for (const node of data.nodes) this.addPins(node.id);
    this.addPlanes();
    this.springs = data.springs.map((spring) => this.spring(spring));
    this.drives = data.motors.map((motor) => this.drive(motor));
  }

  world(node) {
    const { x, y } = this.nodes.get(node);
    return [x, y];
  }

  /** Where a bar has its point of a node: beside it where the bar is given another length than drawn. */
  on(bar, node) {
    if (bar.length === null || node !== bar.b) return this.world(node);
    const [x0, y0] = this.world(bar.a), [x1, y1] = this.world(bar.b), part = bar.length / (hypot(x1 - x0, y1 - y0) || 1);
    return [x0 + part * (x1 - x0), y0 + part * (y1 - y0)];
  }

  block(slide) { return `block of ${slide.name}`; }

  /** The body to which the others at a node are pinned, and its bar, if it is one. */
  hub(node) {
    const slide = this.slides.get(node), bars = this.at.get(node);
    if (slide) return [this.block(slide), null];
    if (this.nodes.get(node).ground || !bars.length) return [GROUND, null];
    return [bars[0].name, bars[0]];
  }

  addSlide(slide) {
    const at = spaced(this.world(slide.node)), body = this.block(slide), moment = (slide.mass * BLOCK ** 2) / 6;
    let parent = GROUND, axis = [Math.cos(slide.angle), Math.sin(slide.angle)];
    if (slide.along !== null) {
      const guide = this.bars.get(slide.along), [x0, y0] = this.world(guide.a), [x1, y1] = this.world(guide.b);
      const size = hypot(x1 - x0, y1 - y0) || 1;
      [parent, axis] = [guide.name, [(x1 - x0) / size, (y1 - y0) / size]];
    }
    this.bodies.push({ kind: "body", name: body, mass: slide.mass, inertia: [moment, moment, moment], position: at });
    this.joints.push({ kind: "prismatic", name: slide.name, parent, child: body, point: at, axis: spaced(axis) });
  }

  addPins(node) {
    const [parent, own] = this.hub(node), held = this.at.get(node).filter((bar) => bar !== own);
    const where = own ? this.on(own, node) : this.world(node);
    for (const bar of held) {
      const name = held.length === 1 ? this.nodes.get(node).name : `${this.nodes.get(node).name} ${bar.name}`, there = this.on(bar, node);
      this.jointOf.set(`${node} ${bar.id}`, name);
      const apart = there[0] !== where[0] || there[1] !== where[1];
      this.joints.push({ kind: "revolute", name, parent, child: bar.name, point: spaced(where), childPoint: apart ? spaced(there) : null });
    }
  }

  /** A joint to the plane of the drawing for each group of bodies that nothing joins to the ground. */
  addPlanes() {
    const names = [GROUND, ...this.bodies.map(({ name }) => name)], groups = new Map(names.map((name) => [name, new Set([name])]));
    const join = (one, other) => {
      const both = new Set([...groups.get(one), ...groups.get(other)]);
      for (const body of both) groups.set(body, both);
    };
    for (const slide of this.data.slides) join(this.block(slide), slide.along === null ? GROUND : this.bars.get(slide.along).name);
    for (const [node, bars] of this.at) for (const bar of bars) join(this.hub(node)[0], bar.name);
    const first = new Map();
    for (const [body, group] of groups) if (!group.has(GROUND) && !first.has(group)) first.set(group, body);
    for (const body of first.values()) this.joints.push({ kind: "planar", name: `plane of ${body}`, parent: GROUND, child: body });
  }

  spring(spring) {
    const [one, other] = [spring.a, spring.b].map((node) => {
      const [body, bar] = this.hub(node);
      return { body, point: spaced(bar ? this.on(bar, node) : this.world(node)) };
    });
    if (one.body === other.body) refuse("spring", spring.name, `both of its ends are on ${one.body}; move one to another body`);
    return { ...spring, one, other };
  }

  drive(motor) {
    const where = this.nodes.get(motor.node).name, { name } = motor;
    if (motor.bar === null) {
      const slide = this.slides.get(motor.node);
      if (!slide) refuse("motor", name, `there is no slide at ${where}; put it on a pin or a slide`);
      return { name, joint: slide.name, rate: motor.rate };
    }
    const joint = this.jointOf.get(`${motor.node} ${motor.bar}`);
    if (joint !== undefined) return { name, joint, rate: motor.rate };
    const own = this.hub(motor.node)[1], others = [...this.jointOf].filter(([key]) => key.startsWith(`${motor.node} `)).map(([, other]) => other);
    if (!own || own.id !== motor.bar || !others.length) {
      refuse("motor", name, `nothing is pinned at ${where} that it could turn; pin two bars, or ground it`);
    }
    return { name, joint: others[0], rate: -motor.rate }; // the bar itself is what the other one is pinned to
  }

  /** The body that carries a node, and where it is drawn on it. */
  carrier(node) {
    const [body, bar] = this.hub(node);
    return [body, bar ? this.on(bar, node) : this.world(node)];
  }

  /** The frame of a body as drawn: its origin, and the direction of its x axis. */
  frame(name) {
    const body = this.bodies.find((one) => one.name === name);
    if (!body) return { origin: [0, 0, 0], x: [1, 0] };
    if (body.kind === "body") return { origin: body.position, x: [1, 0] };
    const dx = body.end[0] - body.start[0], dy = body.end[1] - body.start[1], l = Math.sqrt(dx * dx + dy * dy);
    if (!(l > 0)) refuse("body", name, "start and end are the same point; a rod needs a length");
    return { origin: body.start, x: [dx / l, dy / l], length: l };
  }

  /** A point of the world as drawn in the axes of a body. */
  within(name, [x, y]) {
    const { origin: [x0, y0], x: [c, s] } = this.frame(name);
    return [c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0), 0];
  }

  /** The description that the core compiles. */
  description() {
    const z = [0, 0, 1], cut = "auto";
    const body = (one) => {
      const { origin, x: [c, s], length: l } = this.frame(one.name), common = { name: one.name, mass: one.mass, position: origin };
      const inertia = one.kind === "rod" ? [0, (one.mass * l ** 2) / 12, (one.mass * l ** 2) / 12] : one.inertia;
      return { ...common, com: one.kind === "rod" ? [0.5 * l, 0, 0] : [0, 0, 0], inertia: inertia.map((x, i) => [0, 1, 2].map((j) => (i === j ? x : 0))),
        orientation: [[c, -s, 0], [s, c, 0], z], shape: one.kind === "rod" ? { kind: "rod", length: l } : { kind: "auto" } };
    };
    const joint = ({ kind, name, parent, child, point, axis, childPoint }) => ({ name, kind, parent, child,
      point: point || this.frame(child).origin, axis: axis || z, ...(childPoint ? { child_point: childPoint } : {}), cut });
    const force = ({ name, one, other, stiffness, damping, length: l }) => {
      const drawn = hypot(other.point[0] - one.point[0], other.point[1] - one.point[1]);
      return { kind: "spring", name, body1: one.body, point1: this.within(one.body, one.point), body2: other.body,
        point2: this.within(other.body, other.point), stiffness, damping, length: l === null ? drawn : l };
    };
    const drive = ({ name, joint: of, rate }) => ({ name, measure: { of: "joint", joint: of, coordinate: 0 }, motion: { constant: rate }, level: "velocity" });
    return { partita: 1, name: DRAWING, gravity: [0, -this.data.gravity, 0], drawing_tolerance: DRAWING_TOLERANCE, bodies: this.bodies.map(body),
      joints: this.joints.map(joint), couplings: [], drives: this.drives.map(drive), forces: this.springs.map(force) };
  }

  /** A Python script that makes the mechanism, runs it and writes its page. */
  script() {
    const call = (method, values, named = {}) => {
      const words = [...values.map(python), ...Object.entries(named).map(([key, x]) => `${key}=${python(x)}`)];
      return `m.${method}(${words.join(", ")})`;
    };
    const onBody = ({ body, point }) => ({ toString: () => (body === GROUND ? python(point) : `m.bodies[${python(body)}].world(${python(point)})`) });
    const bodies = this.bodies.map((x) => (x.kind === "rod" ? ["add_rod", [x.name], { start: x.start, end: x.end, mass: x.mass }]
      : ["add_body", [x.name], { mass: x.mass, inertia: x.inertia, position: x.position }]));
    const joints = this.joints.map(({ kind, name, parent, child, point, axis, childPoint }) => [`add_${kind}`, [name, parent, child],
      { ...(point ? { point } : {}), ...(axis ? { axis } : {}), ...(childPoint ? { child_point: childPoint } : {}) }]);
    const count = this.data.bars.length; // the joint of a slide stands behind its block
    const made = [...bodies.slice(0, count), ...this.data.slides.flatMap((_, i) => [bodies[count + i], joints[i]]), ...joints.slice(this.data.slides.length)];
    const springs = this.springs.map(({ name, one, other, stiffness, damping, length: l }) => ["add_spring",
      [name, one.body, onBody(one), other.body, onBody(other)], { stiffness, damping, ...(l === null ? {} : { length: l }) }]);
    const drives = this.drives.map(({ name, joint, rate }) => ["add_drive", [joint], { velocity: rate, name }]);
    return ['"""A mechanism drawn with Partita."""', "", "import partita as pt", "",
      `m = pt.Mechanism("${DRAWING}", gravity=${python([0, -this.data.gravity, 0])})`, ...[...made, ...springs, ...drives].map((x) => call(...x)), "",
      `run = m.simulate(${python(SECONDS)})`, "print(run.message)", `run.to_html("${DRAWING}.html")`, ""].join("\n");
  }

  /** The model file. */
  toml() {
    const value = (x) => (Array.isArray(x) ? `[${x.map(value).join(", ")}]` : typeof x === "string" ? JSON.stringify(x) : pythonNumber(x));
    const table = (head, entries) => [head, ...Object.entries(entries).filter(([, x]) => x !== null && x !== undefined)
      .map(([key, x]) => `${key} = ${key === "partita" ? x : value(x)}`), ""].join("\n");
    const origin = (at) => (at.some((x) => x !== 0) ? at : null), z = [0, 0, 1];
    const bodies = this.bodies.map((x) => (x.kind === "rod" ? table("[[rod]]", { name: x.name, start: x.start, end: x.end, mass: x.mass })
      : table("[[body]]", { name: x.name, mass: x.mass, inertia: x.inertia, position: origin(x.position) })));
    const joints = this.joints.map(({ kind, name, parent, child, point, axis, childPoint }) => table("[[joint]]", { name, type: kind, parent, child,
      point, ...(kind === "planar" ? { normal: z } : { axis: axis || z }), child_point: childPoint }));
    const drives = this.drives.map(({ name, joint, rate }) => table("[[drive]]", { name, joint, velocity: rate }));
    const springs = this.springs.map(({ name, one, other, stiffness, damping, length: l }) => table("[[spring]]", { name, body1: one.body,
      point1: this.within(one.body, one.point), body2: other.body, point2: this.within(other.body, other.point), stiffness,
      damping: damping || null, length: l }));
    const head = table("[mechanism]", { partita: 1, name: DRAWING, gravity: [0, -this.data.gravity, 0] });
    return [head, ...bodies, ...joints, ...drives, ...springs].join("\n");
  }
}

/** A number as Python writes it: the same bits, with a point or an exponent of two digits. */
function pythonNumber(x) {
  if (Object.is(x, -0)) return "-0.0";
  const [digits, power] = x.toExponential().split("e"), e = Number(power);
  if (x !== 0 && (e < -4 || e >= 16)) return `${digits}e${e < 0 ? "-" : "+"}${String(Math.abs(e)).padStart(2, "0")}`;
  return Number.isInteger(x) ? `${x.toFixed(0)}.0` : String(x);
}

function python(x) {
  if (Array.isArray(x)) return `(${x.map(python).join(", ")})`;
  return typeof x === "string" ? JSON.stringify(x) : typeof x === "number" ? pythonNumber(x) : String(x);
}

// ---- drawings that come from elsewhere

const MOST = 100; // elements of one kind
const LARGEST_DRAWN = 1e6; // SI units
const NAMED = /^[A-Za-z0-9][A-Za-z0-9 _-]{0,39}$/;
const SHARED = 200000; // characters of an address

/** A drawing from plain data that is not known to be one; throws `Refused` with what does not fit, as `drawing.py` does. */
function checkedDrawing(data) {
  const fail = (where, why) => { throw new Refused(`${where}: ${why}`); };
  const table = (where, one, keys) => {
    const own = one && typeof one === "object" && !Array.isArray(one) ? Object.keys(one) : [];
    if (own.length !== keys.length || !keys.every((key) => own.includes(key))) fail(where, `must be an object with the keys ${keys.join(", ")}`);
  };
  const number = (where, one, key, { above = -Infinity, least = -Infinity } = {}) => {
    const x = one[key];
    if (typeof x !== "number" || !(Math.abs(x) <= LARGEST_DRAWN) || !(x > above && x >= least)) fail(where, `${key} is not a number that it may be`);
  };
  const maybe = (where, one, key, bounds) => one[key] === null || number(where, one, key, bounds);
  const keys = { nodes: ["id", "name", "x", "y", "ground"], bars: ["id", "name", "a", "b", "more", "mass", "length"],
    slides: ["id", "name", "node", "along", "angle", "mass"], motors: ["id", "name", "node", "bar", "rate"],
    springs: ["id", "name", "a", "b", "stiffness", "damping", "length"] };
  table("drawing", data, ["gravity", ...TABLES]);
  number("drawing", data, "gravity");
  const ids = new Map(TABLES.map((name) => [name, new Set()])), seen = { id: new Set(), name: new Set() };
  for (const name of TABLES) {
    if (!Array.isArray(data[name]) || data[name].length > MOST) fail("drawing", `${name} must be a list of at most ${MOST}`);
    data[name].forEach((one, i) => {
      const where = `${name.slice(0, -1)} ${i + 1}`;
      table(where, one, keys[name]);
      if (!Number.isInteger(one.id) || one.id <= 0 || one.id >= 1e9) fail(where, "id must be a positive integer");
      if (typeof one.name !== "string" || !NAMED.test(one.name) || one.name.trim() !== one.name || one.name === GROUND) fail(where, "name is not a name");
      for (const what of ["id", "name"]) {
        if (seen[what].has(one[what])) fail("drawing", `two elements have the same ${what}`);
        seen[what].add(one[what]);
      }
      ids.get(name).add(one.id);
    });
  }
  const known = (where, one, key, of) => { if (!ids.get(of).has(one[key])) fail(where, `${key} is no element of this drawing`); };
  for (const one of data.nodes) {
    number(one.name, one, "x");
    number(one.name, one, "y");
    if (typeof one.ground !== "boolean") fail(one.name, "ground must be true or false");
  }
  for (const one of [...data.bars, ...data.springs]) for (const key of ["a", "b"]) known(one.name, one, key, "nodes");
  for (const one of data.bars) {
    if (!Array.isArray(one.more) || one.more.length > MOST || !one.more.every((id) => ids.get("nodes").has(id))) fail(one.name, "more must list elements of this drawing");
    number(one.name, one, "mass", { above: 0 });
    maybe(one.name, one, "length", { above: 0 });
  }
  for (const one of data.slides) {
    known(one.name, one, "node", "nodes");
    if (one.along !== null) known(one.name, one, "along", "bars");
    number(one.name, one, "angle");
    number(one.name, one, "mass", { above: 0 });
  }
  for (const one of data.motors) {
    known(one.name, one, "node", "nodes");
    if (one.bar !== null) known(one.name, one, "bar", "bars");
    number(one.name, one, "rate");
  }
  for (const one of data.springs) {
    number(one.name, one, "stiffness", { least: 0 });
    number(one.name, one, "damping", { least: 0 });
    maybe(one.name, one, "length", { least: 0 });
  }
  return data;
}

/** A drawing as the part of an address behind #: its JSON, whose numbers are read back to the bit, in base 64 for addresses. */
function addressOf(data) {
  return btoa(JSON.stringify(data)).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, ""); // names are ASCII
}

/** The drawing of an address; null where it has none; throws `Refused` where it is none. */
function drawingOf(hash) {
  const text = hash.replace(/^#/, "");
  if (!text) return null;
  if (text.length > SHARED) throw new Refused("the address is too long for a drawing");
  let data;
  try {
    data = JSON.parse(atob(text.replaceAll("-", "+").replaceAll("_", "/")));
  } catch {
    throw new Refused("the address does not hold a drawing");
  }
  return checkedDrawing(data);
}
