// The mechanism that runs on this page, in the form in which the pages of runs are drawn.

const TRACED = 8; // paths drawn without being asked for, at most
const TRACE_LENGTH = 240; // frames that a path reaches back
const MOST_POINTS = 600; // of a path
const BEND = 0.2; // rad: an angle that a path shows in one piece
const MOST_PARTS = 12; // points of a path in one frame
const STRIKE = 18; // pixels: a link farther from the pointer is not taken
const RATIOS = ["ratio", "radius", "radius1", "radius2", "factors"]; // numbers of couplings that change the size of wheels

/** A run of one frame, which is now: bodies from the equations of the page, shapes from its numbers. */
class LiveRun {
  constructor(about, motion) {
    this.about = about;
    this.motion = motion;
    this.scene = filled(about.scene);
    this.frames = 1;
    this.t = [0];
    const none = { columns: 0, values: [], get: () => 0, vector: () => [0, 0, 0] };
    const loads = (from) => ({ ...none, vector: (frame, j) => this.load(j, from) });
    this.tables = { force: loads(0), moment: loads(3), measure: none };
    const names = about.bodies.map((name, i) => [name, i]);
    this.place = this.scene.bodies.map(({ name }) => new Map(names).get(name));
    this.order = this.scene.joints.map(({ name }) => about.joints.findIndex((joint) => joint.name === name));
    this.columnOf = about.names.map((name) => this.scene.velocities.indexOf(name));
    this.wheels = this.scene.wheels;
    this.belts = this.scene.lines;
    this.look();
    this.sources = this.scene.bodies.map((body, b) => body.points.map((p) => this.sourceOf(b, p)));
  }

  /** What a point of a body's shape follows: a joint or the end of a rail on it, the end of a spring, or nothing. */
  sourceOf(b, p) {
    const near = (other) => other && length(sub(other, p)) < EQUAL_IN_SIX_DIGITS * this.scene.size;
    for (const [j, joint] of this.scene.joints.entries()) {
      if (joint.child === b && near(joint.at)) return () => this.scene.joints[j].at;
      if (joint.parent === b && near(joint.atParent)) return () => this.scene.joints[j].atParent;
      const end = joint.parent === b && joint.rail ? joint.rail.findIndex(near) : -1;
      if (end >= 0) return () => this.scene.joints[j].rail[end];
    }
    for (const spring of this.scene.springs) {
      for (const end of [1, 2]) if (spring[`body${end}`] === b && near(spring[`point${end}`])) return () => spring[`point${end}`];
    }
    return () => p;
  }

  get parameters() {
    return this.about.parameters;
  }

  /** Reactions at this instant, computed when they are asked for; NaN where the loops lose rank. */
  get reactions() {
    if (this.found) return this.found;
    try {
      this.found = this.motion.reactions();
    } catch (error) {
      if (!(error instanceof this.motion.Fault)) throw error;
      this.found = { wrenches: new Float64Array(6 * this.order.length).fill(NaN), open: this.order.map(() => [false, false]) };
    }
    this.scene.joints.forEach((joint, j) => { joint.open = this.found.open[this.order[j]]; });
    return this.found;
  }

  /** Force (`from` 0) or moment (3) of a joint of the drawing on its child. */
  load(j, from) {
    const at = 6 * this.order[j] + from;
    return Array.from(this.reactions.wrenches.subarray(at, at + 3));
  }

  /** Take up the state, and what follows from numbers that were changed. */
  look() {
    const { motion, scene } = this, state = this.state = motion.look();
    this.found = null;
    scene.joints.forEach((joint, j) => {
      const world = Array.from(state.joints.subarray(3 * this.order[j], 3 * this.order[j] + 3)), before = joint.at;
      joint.at = this.within(joint.child, world);
      if (joint.atParent) joint.atParent = this.within(joint.parent, world);
      if (joint.seat) joint.seat = add(joint.at, sub(joint.seat, before));
      if (joint.rail && this.sources) this.lengthen(joint, this.within(joint.parent, this.seatOf(0, j)));
    });
    for (const spring of scene.springs) {
      for (const end of [1, 2]) {
        const name = `${spring.name}.point${end}`;
        if (Object.hasOwn(this.parameters, name)) spring[`point${end}`] = motion.get(name);
      }
    }
    if (!this.sources) return;
    scene.bodies.forEach((body, b) => { body.points = this.sources[b].map((source) => source()); });
    const same = Object.keys(this.parameters).every((name) => !RATIOS.includes(name.slice(name.lastIndexOf(".") + 1))
      || motion.get(name).every((x, i) => x === this.about.values[name][i]));
    scene.wheels = same ? this.wheels : []; // wheels of another ratio would not touch
    scene.lines = same ? this.belts : [];
  }

  /** A rail reaches as far as its block has slid, and as far beyond as at first. */
  lengthen(joint, at) {
    const [a, b] = joint.rail, l = length(sub(b, a));
    if (!(l > 0) || !isFinite3(at)) return;
    joint.spare ??= l / 2;
    const axis = scaled(sub(b, a), 1 / l), s = dot(sub(at, a), axis);
    joint.rail = [Math.min(0, s - joint.spare), Math.max(l, s + joint.spare)].map((x) => add(a, scaled(axis, x)));
  }

  turned(frame, body, v) {
    if (body < 0) return v;
    const x = this.state.bodies, o = 12 * this.place[body] + 3;
    return [0, 3, 6].map((r) => x[o + r] * v[0] + x[o + r + 1] * v[1] + x[o + r + 2] * v[2]);
  }

  placed(frame, body, p) {
    if (body < 0) return p;
    const x = this.state.bodies, o = 12 * this.place[body];
    return add([x[o], x[o + 1], x[o + 2]], this.turned(frame, body, p));
  }

  /** A point of the world in the axes of a body. */
  within(body, p) {
    if (body < 0) return p;
    const x = this.state.bodies, o = 12 * this.place[body], d = [p[0] - x[o], p[1] - x[o + 1], p[2] - x[o + 2]];
    return [3, 4, 5].map((c) => d[0] * x[o + c] + d[1] * x[o + c + 3] + d[2] * x[o + c + 6]);
  }

  jointPoint(frame, j) {
    return this.placed(frame, this.scene.joints[j].child, this.scene.joints[j].at);
  }

  seatOf(frame, j) {
    const { child, seat } = this.scene.joints[j];
    return seat ? this.placed(frame, child, seat) : this.jointPoint(frame, j);
  }

  /** The fastest rate of a rotation now [rad/s]. */
  get turning() {
    const { motion, about } = this;
    return about.names.reduce((most, name, i) => (about.units[name] === "rad/s" ? Math.max(most, Math.abs(motion.v[i])) : most), 0);
  }

  independent() {
    return this.motion.independent.map((i) => this.columnOf[i]);
  }

  timeOf() {
    return this.motion.t;
  }

  typicalLength() {
    return 0;
  }
}

/** The drawing of a page of a run, with paths of the last seconds, reactions, forces of springs, and the pull of the pointer. */
class LiveScene extends Scene {
  constructor(run, canvas) {
    super(run, canvas);
    const mass = this.run.about.bodies.reduce((sum, body) => sum + (this.number(`${body}.mass`) || 0), 0);
    const gravity = Object.hasOwn(run.parameters, "gravity") ? length(run.motion.get("gravity")) : 0;
    this.forceUnit = mass * (gravity || 9.81); // a weight, until loads of the motion are known
    this.momentUnit = 0;
    this.parts = 1; // points of a path in one frame
    this.traced = this.sources().map((at) => ({ at, points: [] }));
    this.shown = new Shown(this.traced.map(({ at }) => at));
    this.options.traces = this.traced.length <= TRACED;
    this.options.loads = run.scene.springs.length > 0;
    this.lengths = new Map();
    this.touched = false; // whether the view was set by hand
    this.pull = null;
  }

  number(name) {
    return Object.hasOwn(this.run.parameters, name) ? this.run.motion.get(name)[0] : 0;
  }

  /** Points whose paths are drawn: joints between moving bodies, slides, and free ends of links. */
  sources() {
    const { run } = this, s = run.scene, found = [];
    s.joints.forEach((joint, j) => {
      const rests = (joint.parent < 0 || joint.child < 0) && joint.atParent;
      const same = s.joints.findIndex((_, i) => length(sub(run.jointPoint(0, i), run.jointPoint(0, j))) < EQUAL_IN_SIX_DIGITS * s.size);
      if (!rests && same === j) found.push(() => run.seatOf(0, j));
    });
    s.bodies.forEach((body, b) => {
      const held = s.joints.map((joint) => (joint.child === b ? joint.at : joint.parent === b ? joint.atParent : null)).filter(Boolean);
      if (body.points.length > 2) return;
      body.points.forEach((p, i) => {
        if (held.every((h) => length(sub(h, p)) > VISIBLE * s.size)) found.push(() => run.placed(0, b, s.bodies[b].points[i]));
      });
    });
    return found;
  }

  /** Paths grow while the motion goes on. */
  record(seconds = 0) {
    this.shown.record(this.run.motion.t, seconds, () => this.outlines());
    for (const { at, points } of this.traced) {
      const p = at();
      if (isFinite3(p)) points.push(p);
      if (points.length > Math.min(MOST_POINTS, TRACE_LENGTH * this.parts)) points.splice(0, points.length > MOST_POINTS ? 1 : 2);
    }
  }

  /** In how many parts a path goes through the next seconds: so many that no coordinate turns far in one of them. */
  partsOf(seconds) {
    const parts = Math.ceil((this.run.turning * seconds) / BEND);
    this.parts = this.options.traces && this.traced.length ? Math.max(1, Math.min(MOST_PARTS, parts)) : 1;
    return this.parts;
  }

  forget() {
    for (const path of this.traced) path.points = [];
    this.lengths.clear();
    this.shown.forget();
  }

  /** Lines of all bodies where they are, with their colours. */
  outlines() {
    return this.run.scene.bodies.map((body, b) => {
      const [first, ...rest] = body.points.map((p) => this.run.placed(0, b, p)), ring = ["plate", "frame"].includes(body.kind);
      const corners = [first, ...rest, first];
      return { colour: this.colourOf(b), lines: ring ? corners.slice(1).map((p, i) => [corners[i], p]) : rest.map((p) => [first, p]) };
    });
  }

  bodies(painter, frame) {
    this.shown.behind(painter, this.radius);
    super.bodies(painter, frame);
  }

  traces(painter, frame, those) {
    if (!those) return; // none of them stays
    for (const { points } of this.traced) {
      const line = points.map((p) => this.camera.project(p)).filter(Boolean);
      if (line.length > 1) painter.line(line, COLOURS.trace, 1.3);
    }
  }

  /** Sizes of reactions that motions have had: one arrow scale for all that follows. */
  scaleTo(loads) {
    for (const [unit, list] of [["forceUnit", loads.force], ["momentUnit", loads.moment]]) {
      const sizes = list.filter((x) => Number.isFinite(x) && x > 0).sort((a, b) => a - b);
      if (sizes.length) this[unit] = sizes[Math.floor(0.95 * (sizes.length - 1))];
    }
    if (this.momentUnit < NEGLIGIBLE * this.forceUnit * this.size) this.momentUnit = 0;
  }

  /** Forces of springs on their second body, and the pull of the pointer. */
  loads(painter) {
    const { run, options } = this, span = this.arrowSpan * options.arrows, now = run.motion.t;
    for (const spring of options.loads ? run.scene.springs : []) {
      const ends = [1, 2].map((i) => run.placed(0, spring[`body${i}`], spring[`point${i}`])), line = sub(ends[0], ends[1]), l = length(line);
      const last = this.lengths.get(spring.name), rate = last && now > last.t ? (l - last.l) / (now - last.t) : last ? last.rate : 0;
      this.lengths.set(spring.name, { t: now, l, rate });
      const name = spring.name, force = this.number(`${name}.stiffness`) * (l - this.number(`${name}.length`)) + this.number(`${name}.damping`) * rate;
      if (!(l > 0) || !Number.isFinite(force)) continue;
      for (const [end, sign] of [[1, 1], [0, -1]]) {
        if (spring[`body${end + 1}`] < 0) continue;
        this.arrowDrawn(painter.arrow(ends[end], scaled(line, (sign * force * span) / (l * this.forceUnit)), COLOURS.load, 1, false, MOST_ARROW * span));
      }
    }
    this.shown.arrows(painter, this.arrowSpan * options.arrows);
    if (!this.pull) return;
    const from = this.camera.project(run.placed(0, this.pull.body, this.pull.point)), to = this.camera.project(this.pull.to);
    if (!from || !to) return;
    painter.push(Infinity, () => {
      painter.c.setLineDash([5, 4]);
      painter.line([from, to], COLOURS.force, 2);
      painter.c.setLineDash([]);
      for (const { x, y } of [from, to]) painter.circle(x, y, 4, COLOURS.force);
    });
  }

  /** What moves out of the picture makes it smaller, unless the view was set by hand. */
  keepInView() {
    if (this.touched || this.options.follow || !this.extent.length) return;
    const { camera } = this, margin = 8;
    const out = findExtent(this.run).filter((p) => {
      const seen = camera.project(p);
      return !seen || seen.x < margin || seen.y < camera.head - 20 || seen.x > camera.width - margin || seen.y > camera.height - margin;
    });
    if (!out.length) return;
    this.extent.push(...out);
    this.resetView();
  }

  draw(frame, moving) {
    this.run.look();
    this.keepInView();
    super.draw(0, moving);
  }

  /** The link nearest to a pixel, within a finger's breadth: its body, the point of it, and where that is. */
  grasped(x, y) {
    let best = null, least = STRIKE;
    this.run.scene.bodies.forEach((body, b) => {
      const points = body.points.map((p) => this.run.placed(0, b, p)), count = points.length;
      for (let i = 0; i < (count > 2 ? count : Math.max(1, count - 1)); i++) {
        const a = points[i], z = points[(i + 1) % count], p = this.camera.project(a), q = this.camera.project(z);
        if (!p || !q) continue;
        const dx = q.x - p.x, dy = q.y - p.y, l2 = dx * dx + dy * dy;
        const part = l2 > 0 ? Math.min(1, Math.max(0, ((x - p.x) * dx + (y - p.y) * dy) / l2)) : 0;
        const off = Math.hypot(x - p.x - part * dx, y - p.y - part * dy);
        if (off < least) {
          least = off;
          best = { body: b, at: along(a, z, part) };
        }
      }
    });
    return best && { body: best.body, point: this.run.within(best.body, best.at), to: best.at };
  }
}

const HISTORY = 900; // samples of a plot
const MOST_CURVES = 60;

/** Curves of the last seconds: energies, coordinates, velocities and reactions. */
class LivePlots extends Plots {
  constructor(about, motion, live, seconds) {
    const { names } = about, shown = names.slice(0, MOST_CURVES), t = [];
    const curve = (group, name, unit, read) => ({
      group, name, unit, labels: [""], columns: [0], size: false, open: false, table: "", read, values: [],
    });
    const unitOf = (name) => about.units[name] || "";
    const curves = [
      ...shown.map((name, i) => curve("velocities", `velocity of ${name}`, unitOf(name), () => motion.v[i])),
      ...about.plain.slice(0, MOST_CURVES).map(([name, i, unit]) => curve("coordinates", name, unit, () => motion.q[i])),
      ...live.scene.joints.slice(0, MOST_CURVES / 2).flatMap(({ name }, j) => [["force", "N"], ["moment", "N m"]].map(
        ([what, unit], i) => curve(`${what}s of joints`, `${what} in ${name}`, unit, () => length(live.load(j, 3 * i))))),
      curve("energy", "kinetic energy", "J", (energy) => energy[0]), curve("energy", "potential energy", "J", (energy) => energy[1]),
      curve("energy", "total energy", "J", (energy) => energy[0] + energy[1]),
    ];
    const leads = motion.independent.length ? [motion.independent[0]].filter((i) => i < shown.length) : [];
    const run = {
      scene: { curves, firstCurves: [...leads, curves.length - 3], apart: null }, t, tables: {},
      get frames() { return t.length; },
      frameAt: (time) => Run.prototype.frameAt.call(run, time), timeOf: (frame) => t[frame],
    };
    super(run, 0, () => {});
    this.seconds = seconds;
    document.getElementById("plots").hidden = false;
    document.getElementById("spans").hidden = true;
  }

  record(t, energy) {
    const times = this.run.t;
    if (times.length && t <= times[times.length - 1]) return;
    times.push(t);
    for (const curve of this.curves) {
      const x = curve.read(energy);
      curve.values.push(x);
      if (!(Math.abs(x) <= this.largest.get(curve.unit))) this.largest.set(curve.unit, Math.abs(x) || 0);
    }
    if (times.length > HISTORY) {
      times.shift();
      for (const curve of this.curves) curve.values.shift();
    }
  }

  forget() {
    this.run.t.length = 0;
    for (const curve of this.curves) curve.values.length = 0;
    this.largest.clear();
    for (const plot of this.list) plot.key = "";
  }

  valuesOf(curve) {
    return [curve.values];
  }

  part(time) {
    return [Math.max(this.run.t[0], time - this.seconds), Math.max(time, this.run.t[0] + this.seconds)];
  }

  draw() {
    if (!this.run.t.length) return;
    for (const plot of this.list) plot.key = ""; // what is shown goes on with time
    super.draw(this.run.t.length - 1);
  }
}
