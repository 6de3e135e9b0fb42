// The drawing: nodes, bars, slides, motors and springs as plain data, changes of it, undo and redo.

const $ = (id) => document.getElementById(id);
const MOST_UNDO = 200;
const TABLES = ["nodes", "bars", "slides", "motors", "springs"];
const DENSITY = 1; // kg a metre of a new bar
const RATE = 3; // rad/s of a new motor, m/s/10 of one on a slide

class Sketch {
  constructor(data) {
    this.data = structuredClone(data);
    this.past = [];
    this.future = [];
    this.last = "";
  }

  /** Before a change; changes with the same word in a row are undone together. */
  remember(word = "") {
    if (word && word === this.last) return;
    this.last = word;
    this.past.push(JSON.stringify(this.data));
    if (this.past.length > MOST_UNDO) this.past.shift();
    this.future = [];
  }

  /** Forget the last `remember` where nothing was changed since; `future` is what could be redone before it. */
  unchanged(future) {
    if (!this.past.length || this.past[this.past.length - 1] !== JSON.stringify(this.data)) return;
    this.past.pop();
    this.future = future;
    this.last = "";
  }

  step(from, to) {
    if (!from.length) return false;
    to.push(JSON.stringify(this.data));
    this.data = JSON.parse(from.pop());
    this.last = "";
    return true;
  }

  undo() { return this.step(this.past, this.future); }
  redo() { return this.step(this.future, this.past); }

  get everything() { return TABLES.flatMap((table) => this.data[table]); }
  find(id) { return this.everything.find((one) => one.id === id) || null; }
  tableOf(id) { return TABLES.find((table) => this.data[table].some((one) => one.id === id)) || null; }
  node(id) { return this.data.nodes.find((one) => one.id === id); }
  bar(id) { return this.data.bars.find((one) => one.id === id); }
  get nextId() { return 1 + Math.max(0, ...this.everything.map((one) => one.id)); }
  barsAt(node) { return this.data.bars.filter((bar) => this.nodesOf(bar).includes(node)); }
  nodesOf(bar) { return [bar.a, bar.b, ...bar.more]; }
  slideAt(node) { return this.data.slides.find((slide) => slide.node === node) || null; }

  /** A name that is free: A, B, ... for nodes, else a word with a number. */
  name(word) {
    const taken = new Set(this.everything.map((one) => one.name));
    for (let i = 0; ; i++) {
      const letter = String.fromCharCode(65 + (i % 26)) + (i < 26 ? "" : Math.floor(i / 26));
      const name = word ? `${word} ${i + 1}` : letter;
      if (!taken.has(name)) return name;
    }
  }

  add(table, word, values) {
    const made = { id: this.nextId, name: this.name(word), ...values };
    this.data[table].push(made);
    return made;
  }

  addNode([x, y], ground = false) {
    return this.add("nodes", "", { x, y, ground });
  }

  /** A node on a bar between its ends. */
  addOn(bars, at) {
    const made = this.addNode(at);
    for (const bar of bars) bar.more.push(made.id);
    return made;
  }

  addBar(a, b) {
    const p = this.node(a), q = this.node(b), mass = Number((DENSITY * Math.hypot(q.x - p.x, q.y - p.y)).toPrecision(3));
    return this.add("bars", "bar", { a, b, more: [], mass: mass || DENSITY, length: null });
  }

  addSpring(a, b) {
    return this.add("springs", "spring", { a, b, stiffness: 100, damping: 0, length: null });
  }

  addSlide(node, angle, along) {
    const old = this.slideAt(node);
    if (old) { Object.assign(old, { angle, along }); return old; }
    this.node(node).ground = false;
    return this.add("slides", "slide", { node, along, angle, mass: 0.1 });
  }

  /** A motor at a node, on the joint of a bar or on the slide there; one that is there already is taken away. */
  addMotor(node, bar) {
    const old = this.data.motors.find((motor) => motor.node === node && motor.bar === bar);
    if (old) { this.remove(old.id); return null; }
    return this.add("motors", "motor", { node, bar, rate: bar === null ? RATE / 10 : RATE });
  }

  /** Take an element away, and what cannot be without it; nodes that nothing uses go too. */
  remove(id) {
    const table = this.tableOf(id);
    if (!table) return;
    const { data } = this, gone = new Set([id]);
    if (table === "nodes") for (const bar of data.bars) if (bar.a === id || bar.b === id) gone.add(bar.id);
    for (const bar of data.bars) bar.more = bar.more.filter((node) => node !== id);
    data.bars = data.bars.filter((bar) => !gone.has(bar.id));
    for (const spring of data.springs) if (spring.a === id || spring.b === id) gone.add(spring.id);
    for (const slide of data.slides) if (slide.node === id || gone.has(slide.along)) gone.add(slide.id);
    for (const name of TABLES) data[name] = data[name].filter((one) => !gone.has(one.id));
    data.motors = data.motors.filter(({ node, bar }) => node !== id && !gone.has(bar) && (bar === null ? this.slideAt(node)
      : this.barsAt(node).some((one) => one.id === bar)));
    this.sweep();
  }

  /** Places that nothing uses, except those on the ground, which were drawn as such. */
  sweep() {
    const { data } = this, used = new Set([...data.bars.flatMap((bar) => this.nodesOf(bar)), ...data.slides.map((s) => s.node),
      ...data.springs.flatMap(({ a, b }) => [a, b])]);
    data.nodes = data.nodes.filter((node) => used.has(node.id) || node.ground);
  }

  /** Move a node; what is on bars between their ends goes along and stays on them. */
  move(id, at) {
    const parts = new Map(this.data.bars.map((bar) => [bar, bar.more.map((more) => [more, this.partOf(bar, more)])]));
    const waiting = [[id, at]], done = new Set();
    while (waiting.length) {
      const [moving, to] = waiting.shift(), node = this.node(moving);
      if (done.has(moving)) continue;
      done.add(moving);
      [node.x, node.y] = this.onBars(moving, to);
      for (const bar of this.data.bars.filter(({ a, b }) => a === moving || b === moving)) {
        bar.length = null;
        for (const [more, part] of parts.get(bar)) waiting.push([more, this.alongBar(bar, part)]);
      }
    }
  }

  /** Where a node may be, nearest to a point: anywhere, on the bar that carries it, where two that do cross. */
  onBars(id, [x, y]) {
    const [first, second] = this.carrying(id);
    if (!first) return [x, y];
    return (second && this.crossing(first, second)) || this.nearestOn(first, x, y);
  }

  /** Bars that have a node between their ends. */
  carrying(id) { return this.data.bars.filter((bar) => bar.more.includes(id)); }

  /** Where two bars cross; null where they do not. */
  crossing(one, other) {
    const p = this.node(one.a), q = this.node(one.b), r = this.node(other.a), s = this.node(other.b);
    const ux = q.x - p.x, uy = q.y - p.y, vx = s.x - r.x, vy = s.y - r.y, det = ux * vy - uy * vx;
    if (Math.abs(det) < EQUAL * Math.hypot(ux, uy) * Math.hypot(vx, vy)) return null;
    const part = ((r.x - p.x) * vy - (r.y - p.y) * vx) / det, of = ((r.x - p.x) * uy - (r.y - p.y) * ux) / det;
    return [part, of].every((x) => x >= -EQUAL && x <= 1 + EQUAL) ? this.alongBar(one, part) : null;
  }

  /** Where the foot of a node is on a bar: 0 at its beginning, 1 at its end. */
  partOf(bar, id) {
    return this.footOf(bar, this.node(id).x, this.node(id).y);
  }

  footOf(bar, x, y) {
    const p = this.node(bar.a), q = this.node(bar.b), dx = q.x - p.x, dy = q.y - p.y;
    return ((x - p.x) * dx + (y - p.y) * dy) / (dx * dx + dy * dy || 1);
  }

  /** The point of a bar that is nearest to another. */
  nearestOn(bar, x, y) { return this.alongBar(bar, Math.max(0, Math.min(1, this.footOf(bar, x, y)))); }

  alongBar(bar, part) {
    const p = this.node(bar.a), q = this.node(bar.b);
    return [p.x + part * (q.x - p.x), p.y + part * (q.y - p.y)];
  }

  /** Two nodes become one, where that which stays on a bar is; returns why they cannot, else nothing. */
  merge(from, to) {
    const { data } = this, swap = (id) => (id === from ? to : id), own = [from, to].map((id) => this.slideAt(id));
    const one = data.bars.find((bar) => this.nodesOf(bar).includes(from) && this.nodesOf(bar).includes(to));
    if (one) return `both are points of ${one.name}`;
    const spring = data.springs.find(({ a, b }) => swap(a) === swap(b));
    if (spring) return `${spring.name} would have no length`;
    if (own[0] && own[1]) return "both are on slides";
    if (own[0] && this.node(to).ground) return "one slides, the other is held by the ground";
    const along = [own[0] && [own[0], to], own[1] && [own[1], from]].find((both) => {
      const guide = both && both[0].along !== null && this.bar(both[0].along);
      return guide && this.nodesOf(guide).includes(both[1]);
    });
    if (along) return `${along[0].name} slides along a bar of the other`;
    const onBar = this.carrying(from).length > 0;
    if (onBar && this.carrying(to).length) return "both are on bars between their ends";
    const { x, y } = this.node(onBar ? from : to);
    this.move(onBar ? to : from, [x, y]);
    this.node(to).ground = this.node(to).ground || this.node(from).ground;
    if (own[1]) this.node(to).ground = false;
    for (const bar of data.bars) Object.assign(bar, { a: swap(bar.a), b: swap(bar.b), more: bar.more.map(swap) });
    for (const spring of data.springs) Object.assign(spring, { a: swap(spring.a), b: swap(spring.b) });
    for (const one of [...data.slides, ...data.motors]) one.node = swap(one.node);
    data.nodes = data.nodes.filter((node) => node.id !== from);
    return "";
  }

  /** Whether a bar has a node already: as a point of it, or sliding along it. */
  holds(bar, id) {
    const slide = this.slideAt(id);
    return this.nodesOf(bar).includes(id) || (slide !== null && slide.along === bar.id);
  }

  /** Pin a node to a bar that it lies on. */
  pinTo(id, bar) {
    const { x, y } = this.node(id);
    bar.more.push(id);
    this.move(id, [x, y]);
  }

  /** Take up where the nodes are once the loops are closed: bars then have the lengths that were asked for. */
  close(nodes) {
    for (const node of this.data.nodes) {
      if (Object.hasOwn(nodes, node.id)) [node.x, node.y] = nodes[node.id];
    }
    for (const bar of this.data.bars) bar.length = null;
  }

  /** Between the ends of a bar or spring, as drawn. */
  drawnLength({ a, b }) {
    const p = this.node(a), q = this.node(b);
    return Math.hypot(q.x - p.x, q.y - p.y);
  }

  lengthOf(one) { return one.length === null ? this.drawnLength(one) : one.length; }
}
