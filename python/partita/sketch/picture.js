// The picture of the drawing: bars, pins, ground, slides, motors, springs, the grid, gaps, and what is being drawn.

const ROD = 5.5; // pixels: half the width of a bar
const NEAR = 14, NEAR_TOUCH = 24; // pixels: what is nearer to the pointer than this is meant
const CELL = 38; // pixels of a cell of the grid, at least
const PIN = 8; // pixels: half the width of a pin, within which a slide is covered by it
const RAIL = 62, MOTION = 34; // pixels: half of a rail, half of the arrow of a motor that moves a slide
const SCALES = [1e-3, 1e6]; // pixels per metre: all of the largest drawing is seen, and a thousandth of a millimetre

class Picture {
  constructor(sketch, canvas) {
    this.sketch = sketch;
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    const view = { right: [1, 0, 0], up: [0, 1, 0], back: [0, 0, 1], azimuth: 0, elevation: 0 };
    this.camera = new Camera(view, true);
    this.selected = null;
    this.preview = null; // {from, to, kind}: what is being drawn
    this.gaps = [];
    this.touched = false;
  }

  resize() {
    const first = this.camera.width === 1;
    this.ratio = this.camera.fillBox(this.canvas);
    if (first || !this.touched) this.resetView();
  }

  /** All of the drawing with its gaps; of an empty one two metres. */
  resetView() {
    const { nodes } = this.sketch.data, points = nodes.map(({ x, y }) => [x, y, 0]), { camera } = this;
    for (const gap of this.gaps) for (const [x, y] of gap.points) points.push([x, y, 0]);
    this.touched = false;
    const spread = (k) => Math.max(...points.map((p) => p[k])) - Math.min(...points.map((p) => p[k]));
    if (points.length < 2 || !(Math.max(spread(0), spread(1)) > 0)) points.push([-0.5, -0.5, 0], [2, 1.5, 0]);
    camera.fit(points, 0.025 * Math.max(spread(0), spread(1)));
    this.zoom(0.85);
    this.touched = false;
  }

  /** Zoom by a factor about a pixel, that in the middle where none is given. */
  zoom(factor, x = this.camera.width / 2, y = this.camera.height / 2 + this.camera.drop) {
    const { camera } = this, [least, most] = SCALES;
    camera.zoom(Math.max(least, Math.min(most, camera.scale * factor)) / camera.scale, x, y);
    this.touched = true;
  }

  /** Length of a cell of the grid [m]: the least 1, 2 or 5 times a power of ten that is wide enough to be seen. */
  get cell() {
    const least = CELL / this.camera.scale, below = roundBelow(least), power = 10 ** Math.floor(Math.log10(least));
    return Number(([below, 2 * power, 5 * power].find((x) => x >= least) || 10 * power).toPrecision(3));
  }

  at(x, y) {
    const p = this.camera.unproject(x, y, [0, 0, 0]);
    return [p[0], p[1]];
  }

  pixel([x, y]) { return this.camera.project([x, y, 0]); }
  pixelOf(id) { const { x, y } = this.sketch.node(id); return this.pixel([x, y]); }

  /** A length or position rounded to what the grid shows. */
  snapped([x, y]) {
    const step = this.cell / 2, near = (z) => Number((Math.round(z / step) * step).toPrecision(12));
    return [near(x), near(y)];
  }

  nodeAt(x, y, near = NEAR, except = null) {
    let best = null, least = near;
    for (const node of this.sketch.data.nodes) {
      const p = this.pixelOf(node.id), d = Math.hypot(p.x - x, p.y - y);
      if (d < least && node.id !== except) { least = d; best = node; }
    }
    return best;
  }

  /** Bars under a pixel, the nearest first, each with the point of it there. */
  barsAt(x, y, near = NEAR) {
    const [wx, wy] = this.at(x, y);
    return this.sketch.data.bars.map((bar) => {
      const at = this.sketch.nearestOn(bar, wx, wy), p = this.pixel(at);
      return { bar, at, d: Math.hypot(p.x - x, p.y - y) };
    }).filter(({ d }) => d < near).sort((a, b) => a.d - b.d);
  }

  /** What is under a pixel: a motor, the block of a slide, a node, a slide's rail, a spring, a bar. */
  pick(x, y, near = NEAR) {
    const { data } = this.sketch, to = (p) => Math.hypot(p.x - x, p.y - y);
    const line = (p, q) => {
      const dx = q.x - p.x, dy = q.y - p.y, s = Math.max(0, Math.min(1, ((x - p.x) * dx + (y - p.y) * dy) / (dx * dx + dy * dy || 1)));
      return Math.hypot(x - p.x - s * dx, y - p.y - s * dy);
    };
    for (const motor of data.motors) {
      const moves = this.motionOf(motor);
      if ((moves ? line(...moves) : Math.abs(to(this.pixelOf(motor.node)) - this.motorRadius(motor))) < 7) return motor;
    }
    for (const slide of data.slides) {
      const p = this.pixelOf(slide.node), angle = this.directionOf(slide), c = Math.cos(angle), s = Math.sin(angle);
      const u = c * (x - p.x) - s * (y - p.y), v = s * (x - p.x) + c * (y - p.y);
      if (Math.abs(u) < 3 * ROD && Math.abs(v) < 2 * ROD && to(p) > PIN) return slide;
    }
    const node = this.nodeAt(x, y, near);
    if (node) return node;
    for (const spring of data.springs) if (line(this.pixelOf(spring.a), this.pixelOf(spring.b)) < near) return spring;
    for (const slide of data.slides) {
      const rail = this.railOf(slide);
      if (rail && line(rail[0], rail[1]) < near) return slide;
    }
    const [found] = this.barsAt(x, y, near);
    return found ? found.bar : null;
  }

  /** Ends of the line on the ground along which a slide moves, in pixels. */
  railOf(slide) {
    if (slide.along !== null) return null;
    const p = this.pixelOf(slide.node), dx = RAIL * Math.cos(slide.angle), dy = -RAIL * Math.sin(slide.angle);
    return [{ x: p.x - dx, y: p.y - dy }, { x: p.x + dx, y: p.y + dy }];
  }

  directionOf(slide) {
    if (slide.along === null) return slide.angle;
    const bar = this.sketch.bar(slide.along), p = this.sketch.node(bar.a), q = this.sketch.node(bar.b);
    return Math.atan2(q.y - p.y, q.x - p.x);
  }

  motorRadius(motor) {
    return 17 + 7 * this.sketch.data.motors.filter(({ node }) => node === motor.node).indexOf(motor);
  }

  /** Ends of the arrow of a motor that moves a slide, in pixels; null for one that turns a bar. */
  motionOf(motor) {
    const slide = motor.bar === null ? this.sketch.slideAt(motor.node) : null;
    if (!slide) return null;
    const p = this.pixelOf(motor.node), angle = this.directionOf(slide);
    const dx = MOTION * Math.cos(angle), dy = -MOTION * Math.sin(angle);
    const at = (sign) => ({ x: p.x + sign * dx - 0.6 * dy, y: p.y + sign * dy + 0.6 * dx });
    return [at(-1), at(1)];
  }

  draw() {
    const c = this.context, { camera, sketch } = this, { data } = sketch;
    c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    c.clearRect(0, 0, camera.width, camera.height);
    const painter = new Painter(c, camera, 1), r = ROD / camera.scale, world = (id) => [sketch.node(id).x, sketch.node(id).y, 0];
    this.grid(painter);
    const anchors = new Set(data.springs.flatMap(({ a, b }) => [a, b]).filter((id) => !sketch.barsAt(id).length && !sketch.slideAt(id)));
    for (const node of data.nodes) if (node.ground || anchors.has(node.id)) painter.support(world(node.id), 3.4 * r);
    for (const slide of data.slides) this.rail(painter, slide, r);
    data.bars.forEach((bar, i) => {
      const colour = COLOURS.bodies[i % COLOURS.bodies.length];
      painter.rod(world(bar.a), world(bar.b), r, colour, 1);
      for (const id of bar.more) { // a point beside its bar's line is held by an arm
        const foot = [...sketch.alongBar(bar, sketch.partOf(bar, id)), 0];
        if (length(sub(foot, world(id))) * camera.scale > 1) painter.rod(foot, world(id), r, colour, 1);
      }
    });
    for (const slide of data.slides) {
      const angle = this.directionOf(slide), axis = [Math.cos(angle), Math.sin(angle), 0];
      painter.box(world(slide.node), [axis, [-axis[1], axis[0], 0], [0, 0, 1]], [3 * r, 2 * r, r], COLOURS.foot, r);
    }
    for (const spring of data.springs) painter.spring(world(spring.a), world(spring.b), 1.5 * r);
    for (const node of data.nodes) {
      const pinned = sketch.barsAt(node.id).length > 1 || node.ground || sketch.slideAt(node.id);
      if (pinned) painter.pin(world(node.id), [0, 0, 1], 1.25 * r, r, COLOURS.joint, 2 * r, true);
      else painter.ball(world(node.id), 0.7 * r, COLOURS.joint, 2 * r);
    }
    painter.paint();
    for (const motor of data.motors) this.motor(painter, motor);
    this.marks(painter);
    this.words(painter);
  }

  grid(painter) {
    const { camera } = this, [x0, y1] = this.at(0, 0), [x1, y0] = this.at(camera.width, camera.height), step = this.cell;
    const line = (a, b, strong) => painter.line([this.pixel(a), this.pixel(b)], COLOURS.grid, strong ? 2 : 1);
    for (let i = Math.ceil(x0 / step); i * step <= x1; i++) line([i * step, y0], [i * step, y1], i === 0);
    for (let i = Math.ceil(y0 / step); i * step <= y1; i++) line([x0, i * step], [x1, i * step], i === 0);
  }

  rail(painter, slide, r) {
    const rail = this.railOf(slide);
    if (!rail) return;
    painter.push(-1, () => {
      painter.line(rail, COLOURS.ground, 2);
      const [p, q] = rail, side = q.x >= p.x ? 1 : -1, l = Math.hypot(q.x - p.x, q.y - p.y) || 1, away = 2.4 * r * this.camera.scale;
      const low = (e) => ({ x: e.x - (side * away * (q.y - p.y)) / l, y: e.y + (side * away * (q.x - p.x)) / l });
      painter.hatch(low(p), low(q), 3 * ROD);
    });
  }

  motor(painter, motor) {
    const moves = this.motionOf(motor);
    if (moves) painter.doubleArrow(...moves, COLOURS.load);
    else painter.turnArrow(this.pixelOf(motor.node), this.motorRadius(motor), COLOURS.load, motor.rate < 0);
  }

  /** The selection, what is being drawn, and gaps. */
  marks(painter) {
    const { sketch, context: c } = this, one = this.selected === null ? null : sketch.find(this.selected);
    const table = one && sketch.tableOf(one.id);
    const moves = table === "motors" && this.motionOf(one);
    if (moves) painter.line(moves, COLOURS.free, 2.4);
    else if (table === "nodes" || table === "slides" || table === "motors") {
      const p = this.pixelOf(table === "nodes" ? one.id : one.node);
      painter.circle(p.x, p.y, table === "motors" ? this.motorRadius(one) + 5 : 13, null, COLOURS.free, 2.4);
    } else if (one) {
      painter.line([this.pixelOf(one.a), this.pixelOf(one.b)], COLOURS.free, 2.4);
    }
    if (this.preview) {
      const p = this.pixel(this.preview.from), q = this.pixel(this.preview.to);
      c.setLineDash([7, 5]);
      painter.line([p, q], COLOURS.free, 2.2);
      c.setLineDash([]);
      for (const { x, y } of [p, q]) painter.circle(x, y, 5, null, COLOURS.free, 2);
    }
    for (const { points } of this.gaps) {
      const [p, q] = points.map((point) => this.pixel(point));
      c.setLineDash([5, 4]);
      painter.line([p, q], COLOURS.force, 2.4);
      c.setLineDash([]);
      for (const { x, y } of [p, q]) painter.circle(x, y, 5, COLOURS.paper, COLOURS.force, 2);
    }
  }

  words(painter) {
    const { camera, sketch } = this, c = this.context;
    c.font = "12px system-ui, sans-serif";
    const labels = new Labels(c, camera.width, camera.height);
    labels.take({ left: 0, right: camera.width, top: 0, bottom: camera.head - 14 }); // under the tools
    labels.soft.push(...painter.drawnMarks);
    for (const bar of sketch.data.bars) this.clear(labels, this.pixelOf(bar.a), this.pixelOf(bar.b));
    for (const { points: [a, b] } of this.gaps) this.clear(labels, this.pixel(a), this.pixel(b));
    for (const node of sketch.data.nodes) { const p = this.pixelOf(node.id); labels.take(boxAround(p.x, p.y, sketch.slideAt(node.id) ? 17 : 8)); }
    const put = (text, p, away, colour) => {
      const found = labels.place(text, p.x, p.y, away);
      if (found) labels.write(text, found.x, found.y, colour);
    };
    for (const gap of this.gaps) put(gap.label, this.pixel(gap.points[1]), 16, COLOURS.force);
    if (this.preview) {
      const { from, to } = this.preview, size = Math.hypot(to[0] - from[0], to[1] - from[1]);
      put(`${short(size)} m`, this.pixel(to), 14, COLOURS.free);
    }
    for (const node of sketch.data.nodes) put(node.name, this.pixelOf(node.id), sketch.slideAt(node.id) ? 22 : 13);
    const step = this.cell, px = step * camera.scale, right = camera.width - 16, y = camera.height - 18;
    painter.line([{ x: right - px, y }, { x: right, y }], COLOURS.ink, 2, "butt");
    for (const x of [right - px, right]) painter.line([{ x, y: y - 4 }, { x, y: y + 4 }], COLOURS.ink, 1.4, "butt");
    const text = `${step} m`;
    labels.write(text, right - px - 8 - c.measureText(text).width, y + 4);
    this.labels = labels;
  }

  clear(labels, p, q) {
    const count = Math.max(1, Math.ceil(Math.hypot(q.x - p.x, q.y - p.y) / 12));
    for (let i = 0; i <= Math.min(60, count); i++) {
      labels.softer.push(boxAround(p.x + ((q.x - p.x) * i) / count, p.y + ((q.y - p.y) * i) / count, ROD));
    }
  }
}
