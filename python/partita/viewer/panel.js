// The list of coordinates with their measure, the read-outs, and the log of exchanges.

const MANY = 24; // more coordinates than this are shown in compact columns
const MOST_LOG_ROWS = 400;

const READOUTS = [
  ["closure", "closure"], ["energy", "energy", "J"], ["kinetic", "kinetic", "J"], ["potential", "potential", "J"],
  ["sigma", "σ"], ["sqrt_mu", "√μ"],
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
    if (names.length > MANY) this.list.classList.add("compact");
    this.rows = names.map((name) => this.row(name));
    if (!names.length) this.list.append(element("p", "", "This run has no coordinates."));
    this.marked = [];
    this.list.addEventListener("scroll", () => this.bars(this.frame));
    this.readouts = this.makeReadouts();
    this.makeLog(jumpTo);
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
    for (const [key, label, unitName] of READOUTS) {
      const table = this.run.tables[key];
      if (!table) continue;
      const box = element("div"), value = element("dd");
      box.append(element("dt", "", label), value);
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
    log.querySelector("summary").textContent = `Exchanges of coordinates: ${switchCount}`;
    if (!switchCount) list.append(element("li", "", "The first choice served the whole run."));
    for (const s of switches.slice(0, MOST_LOG_ROWS)) {
      const item = element("li"), button = element("button");
      button.type = "button";
      button.textContent = `t = ${short(s.t)} s: ${s.entering.join(", ")} in the place of ${s.leaving.join(", ")}`;
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
    if (now.length !== this.marked.length || now.some((v, i) => v !== this.marked[i]) || !this.told) this.mark(now);
    this.bars(frame);
  }

  mark(now) {
    this.told = true;
    const free = new Set(now);
    this.rows.forEach((r, i) => {
      if (r.free !== free.has(i)) r.row.classList.toggle("free", (r.free = free.has(i)));
    });
    this.marked = now;
    const names = now.map((i) => this.rows[i].name), most = 12;
    const rest = names.length > most ? ` and ${names.length - most} more` : "";
    document.getElementById("chosen").textContent = names.length
      ? `Independent: ${names.slice(0, most).join(", ")}${rest} (${names.length} of ${this.rows.length})`
      : "No independent coordinate: the motion is prescribed.";
  }

  /** Set the bars that can be seen; a chain of a thousand loops has thousands. */
  bars(frame) {
    if (!this.rows.length) return;
    const measure = this.run.tables.measure, top = this.list.scrollTop, bottom = top + this.list.clientHeight;
    const height = this.rows[0].row.offsetHeight || 20, origin = this.rows[0].row.offsetTop;
    // Rows stand in equal lines of a grid; how many share a line shows in where the second line begins.
    let perLine = 1;
    while (perLine < Math.min(8, this.rows.length) && this.rows[perLine].row.offsetTop === origin) perLine++;
    const first = Math.max(0, (Math.floor(top / height) - 1) * perLine);
    const last = Math.min(this.rows.length, (Math.ceil(bottom / height) + 1) * perLine);
    for (let i = first; i < last; i++) {
      const rho = measure.get(frame, i), r = this.rows[i];
      r.fill.style.transform = `scaleX(${Number.isFinite(rho) ? Math.max(0, Math.min(1, rho)) : 0})`;
      r.value.textContent = Number.isFinite(rho) ? rho.toFixed(3) : "–";
      r.row.title = `${r.name}: rho = ${short(rho)}${r.free ? ", independent" : ""}`;
    }
  }
}
