// One frame of the mechanism: bodies, joints, springs, traces, reactions.

const SUPPORT = 1.4; // height of a support with its hatching, in parts of its size
const TAIL = 0.08; // of a tangled path the last part of the run is shown
const FLASH = 0.04; // of the run: how long an impulse is seen
const MOST_ARROW = 1.5; // an arrow longer than this many times a large one is cut, and marked

function largestForce(table, frames) {
  let most = 0;
  for (let f = 0; f < frames; f++) most = Math.max(most, length(table.vector(f, 1)) || 0);
  return most;
}

/** Whether the ground holds the point of a joint, which rests then: on the ground as child, or as a parent on which it does not slide. */
function isSupported(joint) {
  return joint.kind !== "free" && (joint.child < 0 || (joint.parent < 0 && joint.atParent !== null && !joint.rail));
}

class Scene {
  constructor(run, canvas) {
    this.run = run;
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    const s = run.scene;
    this.camera = new Camera(s.view, s.flat);
    this.jointOf = new Map(); // velocity -> joint
    s.joints.forEach((joint, j) => joint.velocities.forEach((v) => this.jointOf.set(v, j)));
    this.extent = findExtent(run);
    this.near = travelling(run, this.extent, spreadFrames(run, 24).map((f) => aboutMiddle(run, f)));
    const sizes = findSizes(run, this.near || this.extent);
    this.size = sizes.size;
    this.typical = sizes.typical;
    this.radius = sizes.radius;
    this.arrowSpan = sizes.arrow;
    this.paths = findPaths(run);
    this.forceUnit = this.unitOf("force", "N");
    // One scale for all forces, where there are reactions to measure loads by.
    const pushes = s.loads.map((_, n) => largestForce(run.tables[`load${n}`], run.frames));
    this.loadUnit = this.forceUnit || Math.max(0, ...pushes);
    this.momentUnit = this.unitOf("moment", "N m");
    const struck = (s.events ? s.events.rows : []).flatMap((row) => row[3] || []);
    this.impulseUnit = Math.max(0, ...struck.map(([, ...impulse]) => length(impulse)));
    this.options = {
      names: s.joints.length <= 24, traces: this.paths.length <= 6, forces: true, moments: false, loads: true, arrows: 1,
      follow: this.near !== null, whole: false,
    };
    this.ratio = 1;
    this.hits = [];
    this.covered = []; // boxes of the canvas under tools
    this.positions = new Map(); // last position of the name of a joint, so that it does not jump
    this.unlike = { cut: false }; // what of this frame is not to scale
    this.reach = this.findTips();
    this.part = false; // whether the first view is of a part
  }

  /** A large value among the reactions of a run; 0 where they are all round-off. */
  unitOf(table, unit) {
    const typical = this.run.typicalLength(table, 0.95), { scales } = this.run.scene;
    return scales && typical < NEGLIGIBLE * (scales[unit] || 0) ? 0 : typical;
  }

  /** Ends of arrows over the run, as the first view should hold them. */
  findTips() {
    const { run } = this, tips = [], step = Math.max(1, Math.ceil((run.frames * run.scene.joints.length) / 5000));
    for (let f = 0; f < run.frames && this.forceUnit > 0; f += step) {
      run.scene.joints.forEach((joint, j) => {
        tips.push(this.tipOf(run.jointPoint(f, j), run.tables.force.vector(f, j)));
      });
    }
    return tips.filter(Boolean);
  }

  /** End of the arrow of a force; null where there is none. */
  tipOf(point, force) {
    const size = length(force);
    if (!isFinite3(point) || !isFinite3(force) || !(size > 0) || !(this.forceUnit > 0)) return null;
    return add(point, scaled(force, (Math.min(MOST_ARROW, size / this.forceUnit) * this.arrowSpan) / size));
  }

  /** Lowest points of supports, which are upright in the picture. */
  feet() {
    const { run, radius } = this, found = [];
    const foot = (point, size) => found.push(sub(point, scaled(this.camera.up, (SUPPORT * size - 3) * radius)));
    run.scene.joints.forEach((joint, j) => {
      if (isSupported(joint)) foot(run.seatOf(0, j), 3.4);
    });
    for (const { body1, point1, body2, point2 } of run.scene.springs) {
      for (const [body, point] of [[body1, point1], [body2, point2]]) if (body < 0) foot(point, 2.6);
    }
    return found.filter(isFinite3);
  }

  resize() {
    const first = this.camera.width === 1;
    this.ratio = this.camera.fillBox(this.canvas);
    if (first) this.resetView();
  }

  resetView() {
    this.camera.turnTo(this.run.scene.view.azimuth, this.run.scene.view.elevation);
    if (!this.extent.length) return;
    const { camera } = this, spare = 3.2 * this.radius + VISIBLE * this.size;
    const held = (this.options.follow ? this.near : this.extent).concat(this.feet());
    camera.origin = [0, 0, 0];
    camera.fit(held, spare);
    // Arrows too, unless the mechanism would become small for their sake: those that leave the picture are cut and marked.
    const alone = camera.scale, target = camera.target;
    if (!this.options.follow) camera.fit(held.concat(this.reach), spare);
    if (this.options.follow) camera.scale *= 0.62;
    else if (camera.scale < 0.72 * alone) {
      camera.target = target;
      camera.scale = 0.8 * alone;
    }
    const times = partShown(camera, held, this.typical);
    this.part = times > 1;
    if (!this.options.whole) camera.scale *= times;
  }

  draw(frame, moving = false) {
    const c = this.context, { camera } = this;
    this.unlike.cut = false;
    camera.origin = this.options.follow ? middleOf(this.run, frame) : [0, 0, 0];
    this.shafts = []; // arrows in the picture
    c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    c.clearRect(0, 0, camera.width, camera.height);
    const painter = new Painter(c, camera, 0.5 * this.radius);
    this.hits = [];
    c.drawImage(this.backdrop(), 0, 0, camera.width, camera.height);
    if (this.options.traces) this.traces(painter, frame, true);
    this.bodies(painter, frame);
    for (const { body, parts } of this.run.scene.solids) drawSolids(this, painter, frame, body, parts);
    drawCouplings(this, painter, frame);
    drawAround(this, painter, frame);
    this.springs(painter, frame);
    this.joints(painter, frame);
    painter.paint();
    this.reactions(painter, frame);
    this.impulses(painter, frame, moving);
    this.loads(painter, frame);
    this.points(painter, frame);
    painter.paint();
    const legends = new Legends(this, painter);
    if (!this.extent.length) {
      legends.words("This run has no bodies to draw: its coordinates are in the list.", 16, camera.height / 2);
      return;
    }
    this.hatched = painter.hatched;
    legends.axes();
    legends.scales();
    if (this.options.names) legends.names(moving);
    this.labels = legends.labels;
  }

  /** What stays while only time goes on, behind all else: the floor, and paths that are shown whole. */
  backdrop() {
    const { camera, ratio, canvas, options } = this, { target, origin, azimuth, elevation, scale, drop, parallel } = camera;
    const key = [target, origin, azimuth, elevation, scale, drop, parallel, canvas.width, canvas.height, options.traces, COLOURS.paper].join();
    if (!this.behind) this.behind = document.createElement("canvas");
    if (this.behindKey === key) return this.behind;
    this.behindKey = key;
    this.behind.width = canvas.width;
    this.behind.height = canvas.height;
    const c = this.behind.getContext("2d"), painter = new Painter(c, camera, 1);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!this.run.scene.flat) this.floor(painter);
    if (options.traces) this.traces(painter, 0, false);
    return this.behind;
  }

  /** Faint grid under a spatial mechanism, so that heights can be judged; the plane on which it rolls, if it does. */
  floor(painter) {
    const { base, origin } = this.camera, { ground } = this.run.scene, up = ground ? ground.normal : base.up;
    const right = unit(cross(up, Math.abs(dot(up, base.back)) < 0.99 ? base.back : base.up)), back = cross(right, up);
    const grid = [[Infinity, -Infinity], [Infinity, -Infinity]];
    let level = Infinity;
    for (const p of this.extent) level = Math.min(level, dot(p, up));
    for (const p of this.options.follow ? this.near.map((q) => add(q, origin)) : this.extent) {
      [right, back].forEach((axis, i) => {
        grid[i][0] = Math.min(grid[i][0], dot(p, axis));
        grid[i][1] = Math.max(grid[i][1], dot(p, axis));
      });
    }
    if (!Number.isFinite(level)) return;
    level = ground ? dot(ground.point, up) : level - 3 * this.radius;
    const cell = roundBelow(this.size / 5);
    const ends = grid.map(([low, high]) => [Math.floor(low / cell) - VISIBLE, Math.ceil(high / cell) + VISIBLE]);
    const at = (x, z) => this.camera.project(add(scaled(up, level), add(scaled(right, x * cell), scaled(back, z * cell))));
    const draw = (p, q) => { if (p && q) painter.line([p, q], COLOURS.grid, 1); };
    for (let x = Math.ceil(ends[0][0]); x <= ends[0][1]; x++) draw(at(x, ends[1][0]), at(x, ends[1][1]));
    for (let z = Math.ceil(ends[1][0]); z <= ends[1][1]; z++) draw(at(ends[0][0], z), at(ends[0][1], z));
  }

  /** Paths that are shown whole or, `tangled`, those that go everywhere, of which the last stretch is shown. */
  traces(painter, frame, those) {
    const now = this.run.timeOf(frame), recent = TAIL * (this.run.t[this.run.frames - 1] - this.run.t[0]);
    for (const { strokes, tangled } of this.paths) {
      if (tangled !== those) continue;
      for (const stroke of strokes) {
        let line = [];
        const flush = () => {
          if (line.length > 1) painter.line(line, COLOURS.trace, 1.1);
          else if (line.length) painter.circle(line[0].x, line[0].y, 1.2, COLOURS.trace);
          line = [];
        };
        for (const { p: point, t } of stroke) {
          const p = tangled && (t > now || t < now - recent) ? null : this.camera.project(point);
          if (p) line.push(p); else flush();
        }
        flush();
      }
    }
  }

  /** Of how many pieces a rod is drawn: one where a flat mechanism is seen face-on, without depth to sort. */
  piecesOf(a, b) {
    if (this.run.scene.flat && dot(this.camera.back, this.camera.base.back) > 0.98) return 1;
    return Math.max(1, Math.min(10, Math.ceil(length(sub(a, b)) / (5 * this.radius))));
  }

  bodies(painter, frame) {
    const { run, radius } = this, s = run.scene;
    const rod = (a, b, r, colour) => painter.rod(a, b, r, colour, this.piecesOf(a, b));
    const given = new Set(s.solids.map(({ body }) => body));
    for (const { body } of s.parts) if (body >= 0 && s.bodies[body].kind === "ball") given.add(body);
    for (const { body, look } of s.lines) if (look === "cam" && s.bodies[body] && s.bodies[body].kind === "ball") given.add(body);
    for (const { body, ring } of s.wheels) if (!ring && body >= 0 && s.bodies[body].kind === "ball") given.add(body);
    const coloured = s.bodies.map((body, b) => [body, this.colourOf(b), body.points.map((p) => run.placed(frame, b, p)), b])
      .filter(([, , , b]) => !given.has(b));
    // Plates first: in a flat mechanism they lie behind the rods.
    for (const [body, colour, points] of coloured) if (body.kind === "plate") painter.plate(points, radius, colour, s.flat ? -7 * radius : 0);
    for (const [body, colour, points, b] of coloured) {
      if (body.kind === "rod") rod(points[0], points[1], radius, colour);
      if (body.kind === "star") for (const tip of points.slice(1)) rod(points[0], tip, 0.8 * radius, colour);
      if (body.kind === "frame") points.forEach((p, i) => rod(p, points[(i + 1) % points.length], 0.6 * radius, colour));
      if (body.kind === "arc") this.arc(painter, points, colour);
      if (body.kind === "hammer") {
        rod(points[0], points[1], 0.6 * radius, colour);
        painter.ball(points[1], 2 * radius, colour, radius);
      }
      if (body.kind === "ball") {
        // A cross through the ball shows how it turns; the box of a slide shows that already.
        if (!s.joints.some((j) => j.child === b && j.rail)) for (const axis of [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) {
          const arm = scaled(run.turned(frame, b, axis), 3.4 * radius);
          rod(sub(points[0], arm), add(points[0], arm), 0.3 * radius, colour);
        }
        painter.ball(points[0], 2 * radius, colour, radius);
      }
    }
  }

  /** A link of a spherical mechanism: from hinge to hinge on a ball about the first point. */
  arc(painter, [centre, ...seats], colour) {
    const { radius } = this, turns = seats.length > 2 ? seats.length : 1;
    for (let i = 0; i < turns; i++) {
      const a = sub(seats[i], centre), b = sub(seats[(i + 1) % seats.length], centre), count = 12;
      const angle = Math.acos(Math.max(-1, Math.min(1, dot(unit(a), unit(b))))), sine = Math.sin(angle);
      if (sine < VISIBLE) { painter.rod(add(centre, a), add(centre, b), 0.7 * radius, colour, this.piecesOf(a, b)); continue; }
      const at = (s) => add(centre, add(scaled(a, Math.sin((1 - s) * angle) / sine), scaled(b, Math.sin(s * angle) / sine)));
      for (let k = 0; k < count; k++) painter.rod(at(k / count), at((k + 1) / count), 0.8 * radius, colour, 1);
    }
  }

  springs(painter, frame) {
    const { run } = this;
    for (const spring of run.scene.springs) {
      const a = run.placed(frame, spring.body1, spring.point1), b = run.placed(frame, spring.body2, spring.point2);
      if (spring.body1 < 0) painter.support(a, 2.6 * this.radius);
      if (spring.body2 < 0) painter.support(b, 2.6 * this.radius);
      if (spring.rods) this.rods(painter, a, b, spring.rods);
      else if (spring.rope) painter.rope(a, b, spring.rope, scaled(run.scene.view.up, -1));
      else painter.spring(a, b, 1.5 * this.radius);
      this.hits.push({ point: a, label: spring.name, kind: "spring" }, { point: b, label: spring.name, kind: "spring" });
    }
  }

  /** Rods along the line from a to b: where each begins and ends from a, null at b, and its radius. */
  rods(painter, a, b, pieces) {
    const along = unit(sub(b, a)), at = (x) => (x === null ? b : add(a, scaled(along, x)));
    for (const [from, to, radius] of pieces) painter.rod(at(from), at(to), radius * this.radius, COLOURS.spring, this.piecesOf(a, b));
  }

  joints(painter, frame) {
    const { run, radius } = this, now = run.independent(frame), all = now.length === run.scene.velocities.length;
    const free = new Set(all ? [] : now.map((v) => this.jointOf.get(v))); // what holds for all marks none
    run.scene.joints.forEach((joint, j) => {
      const point = run.seatOf(frame, j);
      if (!isFinite3(point)) return;
      if (joint.rail) this.rail(painter, joint, frame);
      if (isSupported(joint)) painter.support(point, 3.4 * radius);
      this.glyph(painter, joint, point, frame);
      drawMarks(this, painter, j, point, joint.axis ? unit(run.turned(frame, joint.parent, joint.axis)) : null);
      if (free.has(j)) this.ring(painter, point);
      this.hits.push({ point, joint: j, label: joint.name, kind: joint.kind });
    });
  }

  /** Line on the parent along which a joint slides; hatched where the parent is the ground, and so rests. */
  rail(painter, joint, frame) {
    const [a, b] = joint.rail.map((p) => this.run.placed(frame, joint.parent, p));
    const p = this.camera.project(a), q = this.camera.project(b);
    if (!p || !q) return;
    painter.push((p.z + q.z) / 2 - this.radius, () => {
      painter.line([p, q], COLOURS.ground, Math.max(1.5, 0.5 * this.radius * p.s));
      if (joint.parent >= 0) return;
      const r = 3.4 * this.radius * p.s, l = Math.hypot(q.x - p.x, q.y - p.y) || 1, side = q.x >= p.x ? 1 : -1;
      const shift = { x: (-side * (q.y - p.y) * 1.6) / l, y: (side * (q.x - p.x) * 1.6) / l };
      const w = this.radius * p.s;
      const low = (e) => ({ x: e.x + shift.x * w, y: e.y + shift.y * w });
      painter.hatch(low(p), low(q), r);
    });
  }

  glyph(painter, joint, point, frame) {
    const r = this.radius, lift = 2.5 * r, { run } = this;
    const colour = COLOURS.joint;
    const axis = joint.axis ? unit(run.turned(frame, joint.parent, joint.axis)) : null;
    if (joint.kind === "free") return;
    if (joint.kind === "fixed") {
      painter.box(point, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [r, r, r], COLOURS.ground, lift);
    } else if (joint.kind === "revolute" && axis) {
      painter.pin(point, axis, 1.35 * r, 1.5 * r, colour, lift, true);
    } else if (joint.kind === "universal" && axis) {
      const other = joint.axis2 ? unit(run.turned(frame, joint.child, joint.axis2)) : perpendicular(axis);
      painter.pin(point, axis, 0.75 * r, 2.5 * r, colour, lift, false);
      painter.pin(point, other, 0.75 * r, 2.5 * r, colour, lift + 0.5 * r, false);
      painter.ball(point, 1.1 * r, colour, lift + r);
    } else if ((joint.kind === "cylindrical" || joint.kind === "screw") && axis) {
      painter.pin(point, axis, 1.8 * r, 3.4 * r, colour, lift, false);
    } else if (joint.kind === "prismatic" && axis) {
      const across = this.across(axis);
      painter.box(point, [axis, across, cross(axis, across)], [3 * r, 1.8 * r, 1.8 * r], this.colourOf(joint.child), lift);
    } else if (joint.kind === "planar" && axis) {
      const across = this.across(axis);
      painter.box(point, [axis, across, cross(axis, across)], [0.4 * r, 2.6 * r, 2.6 * r], colour, -lift); // behind its body
    } else if (joint.kind === "generic") {
      painter.octahedron(point, 2 * r, colour, lift);
    } else {
      painter.ball(point, 1.7 * r, colour, lift);
    }
  }

  colourOf(body) {
    return body < 0 ? COLOURS.ground : COLOURS.bodies[body % COLOURS.bodies.length];
  }

  /** Unit vector across an axis, along the first view or the up direction where possible, so that boxes sit square. */
  across(axis) {
    const { back, up } = this.camera.base, wanted = Math.abs(dot(back, axis)) < 0.9 ? back : up;
    return unit(sub(wanted, scaled(axis, dot(wanted, axis))));
  }

  /** Mark of a joint that holds an independent coordinate: a ring, not colour alone. */
  ring(painter, point) {
    const p = this.camera.project(point);
    if (!p) return;
    const r = Math.max(5, 2.7 * this.radius * p.s);
    painter.push(p.z + 6 * this.radius, () => {
      painter.circle(p.x, p.y, r, null, COLOURS.halo, 4.5);
      painter.circle(p.x, p.y, r, null, COLOURS.free, 2.4);
    });
  }

  reactions(painter, frame) {
    const { run, options } = this, span = this.arrowSpan * options.arrows;
    run.scene.joints.forEach((joint, j) => {
      const point = run.jointPoint(frame, j);
      for (const [on, name, unitLength, colour, heads] of [
        [options.moments, "moment", this.momentUnit, COLOURS.moment, 2],
        [options.forces, "force", this.forceUnit, COLOURS.force, 1],
      ]) {
        const vector = run.tables[name].vector(frame, j);
        if (on && unitLength > 0 && isFinite3(vector) && isFinite3(point)) {
          const drawn = scaled(vector, span / unitLength), most = MOST_ARROW * span;
          this.arrowDrawn(painter.arrow(point, drawn, colour, heads, joint.open[heads - 1], most));
        }
      }
    });
  }

  /** Impulses of joints where velocities jump: arrows that flash and shrink. At rest those of the output next to it. */
  impulses(painter, frame, moving) {
    const { run, impulseUnit } = this, span = this.arrowSpan * this.options.arrows;
    if (!this.options.forces || !(impulseUnit > 0)) return;
    const now = run.timeOf(frame), lasts = FLASH * (run.t[run.frames - 1] - run.t[0]);
    for (const [t, , , impulses] of run.scene.events.rows) {
      const left = moving ? 1 - (now - t) / lasts : Number(run.frameAt(t) === Math.round(frame));
      if (!impulses || !(left > 0 && left <= 1)) continue;
      for (const [j, ...impulse] of impulses) {
        const point = run.jointPoint(frame, j), drawn = scaled(impulse, (left * span) / impulseUnit);
        if (isFinite3(point)) this.arrowDrawn(painter.arrow(point, drawn, COLOURS.impulse, 1, false, MOST_ARROW * span));
      }
    }
  }

  /** Applied forces: their arrows end where they act. */
  loads(painter, frame) {
    if (!this.options.loads) return;
    const span = this.arrowSpan * this.options.arrows;
    this.run.scene.loads.forEach((name, n) => {
      const table = this.run.tables[`load${n}`], at = table.vector(frame, 0), force = table.vector(frame, 1);
      if (!isFinite3(at) || !isFinite3(force) || !this.loadUnit) return;
      this.arrowDrawn(painter.arrow(at, scaled(force, span / this.loadUnit), COLOURS.load, 1, false, MOST_ARROW * span));
      this.hits.push({ point: at, label: name, kind: "load", load: n });
    });
  }

  /** Points that are traced: small squares, named. */
  points(painter, frame) {
    for (const { name, body, at } of this.run.scene.points) {
      const point = this.run.placed(frame, body, at), p = this.camera.project(point);
      if (!p) continue;
      const square = [[-4, 0], [0, -4], [4, 0], [0, 4]].map(([x, y]) => ({ x: p.x + x, y: p.y + y }));
      painter.push(Infinity, () => painter.polygon(square, COLOURS.ink, COLOURS.paper, 1.2));
      this.hits.push({ point, label: name, kind: "point" });
    }
  }

  arrowDrawn(arrow) {
    if (!arrow) return;
    this.shafts.push([arrow.p, arrow.q]);
    if (arrow.cut) this.unlike.cut = true;
  }

  /** What is drawn nearest to pixel (x, y), within reach; null otherwise. */
  pick(x, y) {
    let best = null, reach = 16;
    for (const hit of this.hits) {
      const p = this.camera.project(hit.point), d = p ? Math.hypot(p.x - x, p.y - y) : Infinity;
      if (d < reach) { reach = d; best = hit; }
    }
    return best;
  }
}
