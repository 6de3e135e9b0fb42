// A run of the drawing: the picture moves, reactions as arrows and numbers, each with its flag.

const FRAMES = 60, MOST_FRAMES = 3601; // outputs of a second and of a run
const LENGTHS = [2, 5, 10, 30, 60]; // seconds
const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const ARROW = 0.14, MOST_SHOWN = 2.2; // length of a usual arrow over the picture's smaller side, and of the longest over a usual one
const USUAL = 0.95; // a usual force: this part of all forces of the run is not larger
const RESTS = "Nothing moves: the drawing is in balance as it is. Give it a motor, or move a point a little.";
const TRACED = 1.5; // seconds of a path behind a point

class MovingPicture extends Picture {
  constructor(data, canvas, extent) {
    super(new Sketch(data), canvas);
    this.drawn = new Map(data.nodes.map(({ id, x, y }) => [id, [x, y]]));
    this.extent = extent;
    this.after = () => {};
  }

  /** All that the run reaches. */
  resetView() {
    const points = this.extent.map(([x, y]) => [x, y, 0]), spread = Math.max(...[0, 1].map((k) => Math.max(...points.map((p) => p[k])) - Math.min(...points.map((p) => p[k]))));
    this.camera.fit(points, 0.04 * spread);
    this.zoom(0.88);
    this.touched = false;
  }

  /** A rail on the ground stays where it was drawn. */
  railOf(slide) {
    if (slide.along !== null) return super.railOf(slide);
    const node = this.sketch.node(slide.node), now = [node.x, node.y];
    [node.x, node.y] = this.drawn.get(slide.node);
    const rail = super.railOf(slide);
    [node.x, node.y] = now;
    return rail;
  }

  draw() {
    super.draw();
    this.after();
  }
}

class Running {
  /** `again(seconds)` runs it for so long. */
  constructor(run, again) {
    this.again = again;
    this.options = { forces: true, traces: true };
    this.pace = 1;
    this.home = element("section");
    this.home.id = "running";
    this.build();
    $("running").replaceWith(this.home);
    this.resize = new ResizeObserver(() => { this.picture.resize(); this.picture.draw(); });
    this.show(run);
    this.resize.observe(this.canvas);
    this.frame = requestAnimationFrame((now) => this.tick(now));
  }

  build() {
    const choice = (words, values, value, name) => {
      const label = element("label", "", `${words} `), select = element("select");
      for (const x of values) select.append(Object.assign(element("option", "", name(x)), { value: x, selected: x === value }));
      label.append(select);
      return [label, select];
    };
    const tick = (words, key) => {
      const label = element("label"), box = Object.assign(element("input"), { type: "checkbox", checked: this.options[key] });
      box.addEventListener("change", () => { this.options[key] = box.checked; this.picture.draw(); });
      label.append(box, ` ${words}`);
      return label;
    };
    const [lengths, seconds] = choice("seconds", LENGTHS, link.seconds, String), [paces, pace] = choice("speed", SPEEDS, 1, (x) => `${x}×`);
    this.canvas = element("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "the mechanism in motion; drag moves the view, the wheel zooms");
    this.play = Object.assign(element("button", "", "❚❚"), { type: "button", id: "play", title: "play or pause (space)" });
    this.slider = Object.assign(element("input"), { type: "range", id: "instant", min: 0, step: 1 });
    this.slider.setAttribute("aria-label", "time");
    this.clock = element("output", "clock");
    this.verdict = element("p", "verdict");
    this.table = element("table");
    this.words = element("p", "quiet");
    const bar = element("div", "bar"), side = element("aside"), stage = element("div", "stage");
    bar.append(this.play, this.slider, this.clock, lengths, paces, tick("forces", "forces"), tick("paths", "traces"));
    side.setAttribute("aria-label", "reactions");
    side.append(element("h2", "", "Reactions on the second body of each joint"), this.table, this.words, this.verdict);
    stage.append(this.canvas);
    this.home.append(stage, side, bar);
    this.play.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => { this.playing = false; this.time = this.found.t[this.slider.value]; this.look(); });
    pace.addEventListener("change", () => { this.pace = Number(pace.value); });
    seconds.addEventListener("change", async () => {
      const next = await this.again(Number(seconds.value));
      if (next.run) this.show(next.run); else this.verdict.textContent = next.message;
    });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.picture.zoom(Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) * ZOOM_OF_PIXEL), event.offsetX, event.offsetY);
      this.picture.draw();
    }, { passive: false });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      this.picture.camera.move(event.movementX, event.movementY);
      this.picture.touched = true;
      this.picture.draw();
    });
  }

  show({ found, meaning, data }) {
    this.found = found;
    this.meaning = meaning;
    this.nodes = found.bodies.map((poses) => placed(meaning, poses));
    const points = this.nodes.flatMap((at) => Object.values(at)), xs = points.map(([x]) => x), ys = points.map(([, y]) => y);
    const least = (list) => list.reduce((a, b) => Math.min(a, b)), most = (list) => list.reduce((a, b) => Math.max(a, b));
    this.size = Math.max(most(xs) - least(xs), most(ys) - least(ys));
    this.picture = new MovingPicture(data, this.canvas, [[least(xs), least(ys)], [most(xs), most(ys)]]);
    this.picture.after = () => this.overlay();
    this.joints = meaning.joints.map((joint, j) => ({ ...joint, j })).filter(({ kind }) => kind !== "planar");
    const sizes = found.force.flatMap((row) => this.joints.map(({ j }) => Math.hypot(row[3 * j], row[3 * j + 1]))).filter((x) => x > 0).sort((a, b) => a - b);
    this.usual = sizes.length ? sizes[Math.floor(USUAL * (sizes.length - 1))] : 0;
    this.slider.max = found.t.length - 1;
    const rests = this.nodes.every((at) => Object.entries(at).every(([id, [x, y]]) => Math.hypot(x - this.nodes[0][id][0], y - this.nodes[0][id][1]) < EQUAL_IN_SIX_DIGITS * this.size));
    this.verdict.textContent = [found.success ? "" : `The run stopped: ${found.message}.`, rests ? RESTS : "", ...found.notes].filter(Boolean).join(" ");
    this.words.textContent = this.flagsInWords();
    this.time = 0;
    this.last = null;
    this.playing = true;
    this.picture.resize();
    this.look();
  }

  /** Which components are undetermined, of all joints and instants. */
  flagsInWords() {
    const open = (component) => this.joints.some(({ j }) => this.found.determined.some((row) => row[6 * j + component] === 0));
    const inPlane = [[0, "x"], [1, "y"]].filter(([i]) => open(i)).map(([, word]) => `force ${word}`), moment = open(5) ? ["moment z"] : [];
    const own = [...inPlane, ...moment], across = [2, 3, 4].some(open);
    const first = own.length ? `Not determined in the plane, of some joints: ${own.join(", ")}; rigid bodies share such loads in many ways, and one of them is shown, dashed.`
      : "All reactions in the plane are determined: they follow from the motion alone.";
    return `${first}${across ? " Across the plane (force z, moments x and y) hinges share the load in many ways: do not size a bearing by these." : ""}`;
  }

  /** Index of the output at or before the time. */
  get index() {
    const { t } = this.found, last = t.length - 1;
    return Math.max(0, Math.min(last, Math.floor((this.time - t[0]) / ((t[last] - t[0]) / last || 1) + EQUAL_IN_SIX_DIGITS)));
  }

  look() {
    const i = this.index;
    for (const node of this.picture.sketch.data.nodes) [node.x, node.y] = this.nodes[i][node.id];
    this.slider.value = i;
    this.clock.textContent = `${this.found.t[i].toFixed(2)} s`;
    this.play.textContent = this.playing ? "❚❚" : "▶";
    this.numbers(i);
    this.picture.draw();
  }

  numbers(i) {
    const { found } = this, cell = (x, known) => {
      const made = element("td", known ? "" : "open", `${Math.abs(x) < TINY * this.usual ? 0 : Number(x.toPrecision(4))}`);
      if (!known) made.title = "not determined by rigid bodies";
      return made;
    };
    const head = element("tr");
    for (const words of ["joint", "x [N]", "y [N]", "about z [N m]"]) head.append(element("th", "", words));
    this.table.replaceChildren(head, ...this.joints.map(({ name, j }) => {
      const row = element("tr"), flags = found.determined[i];
      row.append(element("th", "", name), cell(found.force[i][3 * j], flags[6 * j]), cell(found.force[i][3 * j + 1], flags[6 * j + 1]),
        cell(found.moment[i][3 * j + 2], flags[6 * j + 5]));
      return row;
    }));
  }

  /** Paths, and forces as arrows. */
  overlay() {
    const { found, picture, options } = this, i = this.index, painter = new Painter(picture.context, picture.camera, 1);
    if (options.traces) {
      const first = Math.max(0, i - Math.round(TRACED * FRAMES));
      for (const { id, ground } of picture.sketch.data.nodes) {
        const line = ground ? [] : this.nodes.slice(first, i + 1).map((at) => picture.pixel(at[id]));
        if (line.length > 1) painter.line(line, COLOURS.trace, 1.3);
      }
    }
    if (!options.forces || !this.usual) return;
    const { width, height, scale } = picture.camera, span = (ARROW * Math.min(width, height)) / scale;
    for (const { j } of this.joints) {
      const f = found.force[i].slice(3 * j, 3 * j + 2), known = found.determined[i][6 * j] && found.determined[i][6 * j + 1];
      const at = [...found.points[i].slice(3 * j, 3 * j + 2), 0];
      if (Math.hypot(...f) > TINY * this.usual) painter.arrow(at, scaled([...f, 0], span / this.usual), COLOURS.force, 1, !known, MOST_SHOWN * span);
    }
    painter.paint();
  }

  toggle() {
    if (!this.playing && this.index >= this.found.t.length - 1) this.time = 0;
    this.playing = !this.playing;
    this.last = null;
    this.look();
  }

  tick(now) {
    const end = this.found.t[this.found.t.length - 1];
    if (this.playing) {
      if (this.last !== null) this.time += (this.pace * (now - this.last)) / 1000;
      this.last = now;
      if (this.time >= end) [this.time, this.playing] = [end, false];
      this.look();
    }
    this.frame = requestAnimationFrame((next) => this.tick(next));
  }

  end() {
    cancelAnimationFrame(this.frame);
    this.resize.disconnect();
  }
}
// Forces and moments below this are shown as 0. Scale: the usual force of the run. Reason: far above rounding, below four digits.
const TINY = 1e-9;
