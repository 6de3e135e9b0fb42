// Small plots over time under the scene, with a cursor at the instant shown.

// Curves that vary by less are drawn as constant. Scale: fraction of their largest value. Reason: as in figures.
const CONSTANT = 1e-4;
const MOST_PLOTS = 8;
const MOST_LINES = 30; // of events; more would hide the curves
const MOST_TURNS = 8; // turns of the motion on a plot at first; of a run with many more a part is shown at a time

class Plots {
  constructor(run, rate, jumpTo, events) {
    this.run = run;
    this.events = events;
    this.jumpTo = jumpTo;
    this.curves = run.scene.curves;
    this.list = []; // shown: {curve, canvas, still}
    this.largest = new Map(); // of each unit, once it is asked for
    this.home = document.getElementById("multiples");
    this.start = run.t[0];
    this.whole = run.t[run.frames - 1] - run.t[0];
    this.span = this.whole; // of time on a plot
    this.fill();
    this.fillSpans(rate);
    for (const i of run.scene.firstCurves) this.add(i);
    document.getElementById("plots").hidden = !this.curves.length || run.frames < 2;
  }

  fill() {
    const select = document.getElementById("add"), groups = new Map();
    select.append(new Option("choose …", ""));
    this.curves.forEach((curve, i) => {
      if (!groups.has(curve.group)) {
        groups.set(curve.group, element("optgroup"));
        groups.get(curve.group).label = curve.group;
        select.append(groups.get(curve.group));
      }
      groups.get(curve.group).append(new Option(curve.name, i));
    });
    select.addEventListener("change", () => {
      if (select.value !== "") this.add(Number(select.value));
      select.value = "";
    });
  }

  /** How much of the run a plot shows: of a fast motion a few turns, else a plot would be a solid bar. */
  fillSpans(rate) {
    const select = document.getElementById("span"), turns = (rate * this.whole) / (2 * Math.PI);
    select.append(new Option("whole run", this.whole));
    document.getElementById("spans").hidden = !(turns > 2 * MOST_TURNS);
    if (!(turns > 2 * MOST_TURNS)) return;
    const usual = roundBelow((MOST_TURNS * 2 * Math.PI) / rate);
    for (const span of [10 * usual, usual, 0.2 * usual].filter((x) => x < this.whole)) {
      select.append(new Option(`${Number(span.toPrecision(1))} s`, span));
    }
    select.value = String(this.span = usual);
    select.addEventListener("change", () => {
      this.span = Number(select.value);
      if (this.frame !== undefined) this.draw(this.frame);
    });
  }

  /** First and last time on the plots: the part of the run that holds a time. */
  part(time) {
    const first = this.start + Math.floor(Math.min(time - this.start, this.whole * (1 - EQUAL)) / this.span) * this.span;
    return [first, Math.min(first + this.span, this.start + this.whole)];
  }

  add(i) {
    if (this.list.some((plot) => plot.curve === this.curves[i])) return;
    if (this.list.length === MOST_PLOTS) this.remove(this.list[0]);
    const curve = this.curves[i], box = element("div", "plot"), canvas = element("canvas"), caption = element("p");
    const close = element("button", "", "×"), plot = { curve, canvas, caption, box, values: this.valuesOf(curve) };
    close.type = "button";
    close.setAttribute("aria-label", `remove the plot of ${curve.name}`);
    close.addEventListener("click", () => { this.remove(plot); });
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.addEventListener("keydown", (e) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
      if (!step) return;
      e.preventDefault();
      e.stopPropagation();
      const stride = Math.max(1, Math.round((this.run.frames * this.span) / this.whole / 100)) * step;
      this.jumpTo(this.run.t[Math.max(0, Math.min(this.run.frames - 1, Math.round(this.frame) + stride))]);
    });
    const set = (e) => this.jumpTo(this.timeAt(plot, e.offsetX));
    canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); set(e); });
    canvas.addEventListener("pointermove", (e) => { if (e.buttons) set(e); });
    box.append(caption, close, canvas);
    this.home.append(box);
    this.list.push(plot);
    if (this.frame !== undefined) this.draw(this.frame);
  }

  remove(plot) {
    plot.box.remove();
    this.list.splice(this.list.indexOf(plot), 1);
  }

  /** Lines of a curve, an array of numbers each; `size` asks for lengths of vectors. */
  valuesOf(curve) {
    const table = this.run.tables[curve.table];
    const line = (column) => Array.from({ length: this.run.frames }, (_, f) => table.get(f, column));
    if (!curve.size) return curve.columns.map(line);
    const [x, y, z] = curve.columns.map(line);
    return [x.map((_, f) => Math.hypot(x[f], y[f], z[f]))];
  }

  /** What is smaller than this is round-off: by the scale of a unit in the run, or the largest value where none is known. */
  negligible(unit) {
    const { scales } = this.run.scene;
    return NEGLIGIBLE * ((scales && scales[unit]) || this.largestIn(unit));
  }

  /** The largest magnitude among all curves of a unit. */
  largestIn(unit) {
    if (!this.largest.has(unit)) {
      let most = 0;
      for (const curve of this.curves) if (curve.unit === unit) for (const line of this.valuesOf(curve)) most = Math.max(most, largest(line));
      this.largest.set(unit, most);
    }
    return this.largest.get(unit);
  }

  frameOf(plot) {
    const width = plot.canvas.clientWidth, height = plot.canvas.clientHeight;
    return { left: plot.left || 46, right: width - 6, top: 6, bottom: height - 17, width, height };
  }

  timeAt(plot, x) {
    const { left, right } = this.frameOf(plot), [first, last] = this.part(this.run.timeOf(this.frame));
    return first + Math.max(0, Math.min(1, (x - left) / (right - left))) * (last - first);
  }

  draw(frame) {
    this.frame = frame;
    for (const plot of this.list) this.drawOne(plot, frame);
  }

  drawOne(plot, frame) {
    const { curve, canvas, values } = plot, box = this.frameOf(plot), ratio = window.devicePixelRatio || 1;
    if (box.width < 60) return;
    const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio), now = this.run.timeOf(frame);
    const [first, last] = this.part(now), key = [width, height, ratio, first, last, COLOURS.paper].join();
    if (plot.key !== key) {
      plot.key = key;
      if (!plot.still) plot.still = document.createElement("canvas");
      for (const each of [canvas, plot.still]) { each.width = width; each.height = height; }
      this.drawStill(plot, box, ratio, first, last);
    }
    const c = canvas.getContext("2d"), { X, Y } = plot, output = Math.round(frame);
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, width, height);
    c.drawImage(plot.still, 0, 0);
    c.scale(ratio, ratio);
    c.strokeStyle = COLOURS.ink;
    c.lineWidth = 1;
    c.beginPath(); c.moveTo(X(now), box.top - 3); c.lineTo(X(now), box.bottom); c.stroke();
    values.forEach((line, n) => {
      if (!Number.isFinite(line[output])) return;
      c.fillStyle = colourOfLine(curve, n);
      c.beginPath(); c.arc(X(this.run.t[output]), Y(line[output]), 3, 0, 2 * Math.PI); c.fill();
    });
    this.describe(plot, output);
  }

  /** Axes and curves, from one time to another. */
  drawStill(plot, box, ratio, start, end) {
    const { curve, values, still } = plot, c = still.getContext("2d"), { t } = this.run;
    c.scale(ratio, ratio);
    c.font = "11px system-ui, sans-serif";
    let low = Infinity, high = -Infinity;
    for (const line of values) for (const y of line) if (Number.isFinite(y)) { low = Math.min(low, y); high = Math.max(high, y); }
    if (!(low <= high)) { low = 0; high = 1; }
    // Round-off is not blown up to a curve, as in figures (`level` in plots/style.py).
    const most = Math.max(Math.abs(low), Math.abs(high)), least = this.negligible(curve.unit), flat = high - low <= Math.max(least, CONSTANT * most);
    const spare = flat ? 0.5 * (Math.max(most, least / CONSTANT) || 1) : 0.06 * (high - low);
    [low, high] = [low - spare, high + spare];
    const marks = ticksOf(low, high, 3).map((y) => [y, tickText(y, high - low)]);
    box.left = plot.left = Math.min(0.4 * box.width, 8 + Math.max(24, ...marks.map(([, text]) => c.measureText(text).width)));
    const X = plot.X = (time) => box.left + ((time - start) / (end - start || 1)) * (box.right - box.left);
    const Y = plot.Y = (y) => box.bottom - ((y - low) / (high - low)) * (box.bottom - box.top);
    c.fillStyle = COLOURS.quiet;
    c.strokeStyle = COLOURS.grid;
    c.lineWidth = 1;
    for (const [y, text] of marks) {
      c.beginPath(); c.moveTo(box.left, Y(y)); c.lineTo(box.right, Y(y)); c.stroke();
      c.textAlign = "right";
      c.fillText(text, box.left - 4, Y(y) + 4);
    }
    plot.ticks = timeTicks(start, end, (text) => c.measureText(text).width, X, box.width);
    for (const { x, text, left } of plot.ticks) {
      c.beginPath(); c.moveTo(X(x), box.top); c.lineTo(X(x), box.bottom); c.stroke();
      c.textAlign = "left";
      c.fillText(text, left, box.height - 4);
    }
    const times = this.events ? this.events.times(start, end) : []; // playgrounds have none
    c.strokeStyle = COLOURS.quiet;
    c.globalAlpha = 0.7;
    c.setLineDash([2, 3]);
    for (const x of times.length > MOST_LINES ? [] : times) {
      c.beginPath(); c.moveTo(X(x), box.top); c.lineTo(X(x), box.bottom); c.stroke();
    }
    c.setLineDash([]);
    c.globalAlpha = 1;
    c.beginPath(); c.rect(box.left, 0, box.right - box.left + 1, box.bottom + 1); c.clip();
    const from = Math.max(0, this.run.frameAt(start) - 1), to = Math.min(this.run.frames, this.run.frameAt(end) + 2);
    values.forEach((line, n) => {
      c.strokeStyle = colourOfLine(curve, n);
      c.lineWidth = 1.5;
      c.lineJoin = "round";
      c.setLineDash(curve.open ? [4, 3] : []);
      c.beginPath();
      if (this.run.scene.apart) { // a line between outputs so far apart would show a motion that was not
        c.fillStyle = c.strokeStyle;
        for (let f = from; f < to; f++) if (Number.isFinite(line[f])) {
          c.moveTo(X(t[f]), Y(line[f]));
          c.arc(X(t[f]), Y(line[f]), 1.2, 0, 2 * Math.PI);
        }
        c.setLineDash([]);
        c.lineWidth = 0.6;
        if (curve.open) c.stroke(); else c.fill();
        return;
      }
      let down = false;
      for (let f = from; f < to; f++) {
        if (!Number.isFinite(line[f])) { down = false; continue; }
        if (down) c.lineTo(X(t[f]), Y(line[f])); else c.moveTo(X(t[f]), Y(line[f]));
        down = true;
      }
      c.stroke();
      c.setLineDash([]);
    });
  }

  /** Name and values now, above the plot and for those who do not see it. */
  describe(plot, frame) {
    const { curve, values, caption } = plot;
    const least = this.negligible(curve.unit), value = (line) => short(Math.abs(line[frame]) < least ? 0 : line[frame], 3);
    const shown = values.map((line, n) => (curve.labels[n] ? `${curve.labels[n]} ` : "") + value(line)).join(", ");
    const text = `${curve.name}: ${shown}${curve.unit ? ` ${curve.unit}` : ""}${curve.open ? " (not unique)" : ""}`;
    if (plot.text === text + COLOURS.paper) return;
    plot.text = text + COLOURS.paper;
    caption.replaceChildren();
    const read = element("span", "read"); // kept whole where the name must be cut
    caption.append(element("span", "what", `${curve.name}: `), read);
    values.forEach((line, n) => {
      const part = element("span", "", (n ? ", " : "") + (curve.labels[n] ? `${curve.labels[n]} ` : "") + value(line));
      part.style.color = colourOfLine(curve, n);
      read.append(part);
    });
    read.append(curve.unit ? ` ${curve.unit}` : "");
    if (curve.open) caption.append(element("span", "open", "(not unique)"));
    caption.title = text;
    plot.canvas.setAttribute("aria-label", `${text} at ${short(this.run.t[frame])} s; arrow keys change the time`);
  }
}

/** Forces, moments and loads have the colours of their arrows, energies and coordinates each their own. */
function colourOfLine(curve, n) {
  if (curve.size) return COLOURS[curve.table];
  const group = { coordinates: 1, velocities: 0, drives: 2, sensors: 3, energy: 4 }[curve.group] || 0;
  return COLOURS.lines[(group + n) % COLOURS.lines.length];
}

const TICK_GAP = 12; // pixels between two numbers of an axis

/** Ticks of time with the places of their numbers, as many as stand beside each other. */
function timeTicks(start, end, widthOf, X, width) {
  for (let count = 4; ; count--) {
    const found = ticksOf(start, end, count).map((x) => {
      const text = `${tickText(x, end - start)} s`, size = widthOf(text);
      const left = Math.max(0, Math.min(width - size, X(x) - size / 2));
      return { x, text, left, right: left + size };
    });
    const apart = found.every(({ left }, i) => i === 0 || left >= found[i - 1].right + TICK_GAP);
    if (apart) return found;
    if (count === 1) return found.slice(0, 1);
  }
}

/** Round numbers between two others, about `count`. */
function ticksOf(low, high, count) {
  if (!(high > low)) return [low];
  let step = roundBelow((high - low) / count);
  while ((high - low) / step > count + 1.5) step *= 2;
  const found = [];
  for (let n = Math.ceil(low / step - EQUAL); n * step <= high + EQUAL * step; n++) found.push(n * step);
  return found;
}

function tickText(x, span) {
  if (Math.abs(x) < NEGLIGIBLE * span) return "0";
  const size = Math.abs(x);
  if (size >= 1e5 || size < SHORT_NUMBER) return x.toExponential(span / size < 0.2 ? 2 : 1).replace("e+", "e");
  return String(Number(x.toFixed(Math.max(0, Math.min(9, 1 - Math.floor(Math.log10(span)))))));
}
