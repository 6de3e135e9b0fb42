// The list of coordinates with their measure, the read-outs, and the log of switches.

const FEW = 12; // up to this many coordinates are all shown
const MATTER = 10; // of more, those that matter, until all are asked for
const MOST_LOG_ROWS = 400;

const READOUTS = [
  // table, words, title, unit
  ["closure", "closure error", "closure: largest closure error of the loops"],
  ["energy", "energy", "kinetic and potential energy together", "J"],
  ["kinetic", "kinetic", "kinetic energy", "J"], ["potential", "potential", "potential energy", "J"],
  ["sigma", "quality of choice σ", "smallest singular value of the choice; small near a position where it fails"],
  ["sqrt_mu", "√μ", "smallest cosine between the choice and the motions that the loops allow; small where it fails"],
];

/** A new element with a class and text; names only ever become text, never markup. */
function element(tag, className, text) {
  const e = document.createElement(tag);
  if (className) e.className = className;
  if (text !== undefined) e.textContent = text;
  return e;
}

class Panel {
  constructor(run, jumpTo) {
    this.run = run;
    this.list = document.getElementById("bars");
    const names = run.scene.velocities;
    this.query = "";
    this.all = names.length <= FEW;
    this.order = this.byImportance();
    this.rows = names.map((name) => this.row(name));
    if (!names.length) this.list.append(element("p", "", "This run has no coordinates."));
    this.marked = [];
    this.empty = element("p", "", "No coordinate has this in its name.");
    this.list.append(this.empty);
    this.list.addEventListener("scroll", () => this.bars(this.frame));
    this.bindFind(names.length);
    this.choose();
    this.readouts = this.makeReadouts();
    this.makeLog(jumpTo);
  }

  /** Coordinates in order of interest: those most often independent, then those whose measure varies most. */
  byImportance() {
    const { run } = this, table = run.tables.measure, count = run.scene.velocities.length;
    const often = new Array(count).fill(0), low = new Array(count).fill(1), high = new Array(count).fill(0);
    run.scene.independent.forEach(([first, indices], n) => {
      const next = run.scene.independent[n + 1], frames = (next ? next[0] : run.frames) - first;
      for (const i of indices) often[i] += frames;
    });
    const step = Math.max(1, Math.floor(run.frames / 200));
    for (let f = 0; f < run.frames; f += step) {
      for (let i = 0; i < count; i++) {
        const rho = table.get(f, i);
        if (rho < low[i]) low[i] = rho;
        if (rho > high[i]) high[i] = rho;
      }
    }
    const worth = (i) => (often[i] ? 2 + often[i] / run.frames : Math.max(0, high[i] - low[i]));
    return often.map((_, i) => i).sort((a, b) => worth(b) - worth(a) || a - b);
  }

  bindFind(count) {
    document.getElementById("find").hidden = count <= FEW;
    const all = document.getElementById("all"), search = document.getElementById("search");
    all.textContent = `Show all ${count}`;
    all.addEventListener("click", () => {
      this.all = !this.all;
      all.setAttribute("aria-pressed", String(this.all));
      all.textContent = this.all ? `Show ${MATTER}` : `Show all ${count}`;
      this.choose();
    });
    search.addEventListener("input", () => {
      this.query = search.value.trim().toLowerCase();
      this.choose();
    });
  }

  /** Which rows are shown: all, those found, or the ten that matter, in the order of the coordinates. */
  choose() {
    let shown = this.rows.map((_, i) => i);
    if (this.query) {
      shown = shown.filter((i) => this.rows[i].name.toLowerCase().includes(this.query));
    } else if (!this.all) {
      const now = this.marked.slice(0, MATTER), rest = this.order.filter((i) => !now.includes(i));
      shown = now.concat(rest).slice(0, MATTER).sort((a, b) => a - b);
    }
    const set = new Set(shown);
    this.rows.forEach((r, i) => { r.row.hidden = !set.has(i); });
    this.shown = shown.map((i) => [this.rows[i], i]);
    this.empty.hidden = shown.length > 0 || !this.rows.length;
    if (this.frame !== undefined) this.bars(this.frame);
  }

  row(name) {
    const row = element("div", "row"), mark = element("span", "mark", "◆"), track = element("span", "track");
    const fill = element("span", "fill"), value = element("span", "value");
    fill.style.display = "block";
    mark.setAttribute("aria-hidden", "true");
    track.append(fill);
    row.append(mark, element("span", "name", name), track, value);
    row.title = name;
    this.list.append(row);
    return { row, fill, value, name, free: false };
  }

  makeReadouts() {
    const home = document.getElementById("readouts"), made = [];
    for (const [key, label, title, unitName] of READOUTS) {
      const table = this.run.tables[key];
      if (!table) continue;
      const box = element("div"), value = element("dd");
      box.append(element("dt", "", label), value);
      box.title = title;
      home.append(box);
      made.push((frame) => {
        const x = table.get(frame);
        value.textContent = short(x) + (unitName && Number.isFinite(x) ? ` ${unitName}` : "");
      });
    }
    return made;
  }

  makeLog(jumpTo) {
    const log = document.getElementById("log"), { switches, switchCount } = this.run.scene;
    const list = log.querySelector("ol");
    log.querySelector("summary").textContent = `Switches of coordinates: ${switchCount}`;
    if (!switchCount) list.append(element("li", "", "The first choice served the whole run."));
    for (const s of switches.slice(0, MOST_LOG_ROWS).filter((one) => one.entering)) {
      const item = element("li"), button = element("button");
      button.type = "button";
      button.textContent = `t = ${short(s.t)} s: ${s.entering.join(", ")} instead of ${s.leaving.join(", ")}`;
      button.title = s.reason;
      button.addEventListener("click", () => jumpTo(s.t));
      item.append(button);
      list.append(item);
    }
    const rest = switchCount - Math.min(switches.length, MOST_LOG_ROWS);
    if (rest > 0) list.append(element("li", "", `and ${rest} later ones not listed here`));
  }

  show(frame) {
    this.frame = frame;
    for (const write of this.readouts) write(frame);
    const now = this.run.independent(frame);
    if (now.length !== this.marked.length || now.some((v, i) => v !== this.marked[i]) || !this.wasMarked) this.mark(now);
    this.bars(frame);
  }

  mark(now) {
    this.wasMarked = true;
    const free = new Set(now);
    this.rows.forEach((r, i) => {
      if (r.free !== free.has(i)) r.row.classList.toggle("free", (r.free = free.has(i)));
    });
    this.marked = now;
    if (!this.all && !this.query) this.choose();
    const names = now.map((i) => this.rows[i].name), most = 12;
    const rest = names.length > most ? ` and ${names.length - most} more` : "";
    document.getElementById("chosen").textContent = names.length
      ? `Independent: ${names.slice(0, most).join(", ")}${rest} (${names.length} of ${this.rows.length})`
      : "No independent coordinate: the motion is prescribed.";
  }

  /** Set the bars that can be seen; a chain of a thousand loops has thousands. */
  bars(frame) {
    if (!this.shown.length) return;
    const measure = this.run.tables.measure, height = this.shown[0][0].row.offsetHeight || 22;
    // On a phone the list does not scroll by itself: then all of it counts as seen.
    const whole = this.list.scrollHeight <= this.list.clientHeight + 1;
    const first = whole ? 0 : Math.max(0, Math.floor(this.list.scrollTop / height) - 1);
    const last = whole ? this.shown.length : first + Math.ceil(this.list.clientHeight / height) + 3;
    for (const [r, i] of this.shown.slice(first, last)) {
      const rho = measure.get(frame, i);
      r.fill.style.transform = `scaleX(${Number.isFinite(rho) ? Math.max(0, Math.min(1, rho)) : 0})`;
      r.value.textContent = Number.isFinite(rho) ? rho.toFixed(3) : "–";
      r.row.title = `${r.name}: rho = ${short(rho)}${r.free ? ", independent" : ""}`;
    }
  }
}
