// The list of coordinates with their measure, the read-outs, the log of switches, and the events.

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

/** A bar of the list: its name, a reading {part, text} of a frame, and the velocity it stands for, if any. */
const entry = (name, read, velocity) => ({ name, read, velocity });

/** A reading of a line: its magnitude in the largest one, zero where it is round-off. */
function magnitude(line, least, unit) {
  const most = largest(line), value = (f) => (Math.abs(line[f]) < least ? 0 : line[f]);
  return (f) => ({ part: most > least ? Math.abs(value(f)) / most : 0, text: short(value(f), 3), unit });
}

class Panel {
  constructor(run, events, jumpTo) {
    this.run = run;
    this.list = document.getElementById("bars");
    this.curveOf = new Map(run.scene.curves.map((curve) => [curve.name, curve]));
    const { scene } = run, table = run.tables.measure, { values } = table;
    const driven = scene.drives.length > 0 && scene.independent.every(([, indices]) => !indices.length);
    const open = !driven && scene.velocities.length > 0 && values.every((rho) => rho > 1 - EQUAL_IN_SIX_DIGITS);
    const entries = driven ? this.transmission() : open ? this.coordinates() : this.measures();
    document.getElementById("about").replaceChildren(...(entries.length ? this.heading(driven, open) : ["Coordinates"]));
    document.querySelector(".legend").hidden = driven || open || !entries.length;
    this.list.classList.toggle("wide", driven || open);
    this.makeEfforts();
    this.query = "";
    this.all = entries.length <= FEW;
    this.order = driven || open ? entries.map((_, i) => i) : this.byImportance();
    this.rows = entries.map((each) => this.row(each, this.list));
    if (!entries.length) this.list.append(element("p", "", "There are no coordinates to show."));
    this.marked = [];
    this.empty = element("p", "", "No coordinate has this in its name.");
    this.list.append(this.empty);
    this.list.addEventListener("scroll", () => this.bars(this.frame));
    this.bindFind(entries.length);
    this.choose();
    this.readouts = this.makeReadouts();
    this.makeLog(jumpTo);
    events.list(document.getElementById("happened"), jumpTo);
  }

  /** What the bars show, in words. */
  heading(driven, open) {
    if (open) return ["Coordinates: position in the range of the run"];
    if (!driven) return ["How free each coordinate is: measure ", element("i", "", "ρ")];
    const { drives, velocities } = this.run.scene;
    const leader = drives.length === 1 && drives[0].velocity !== null ? velocities[drives[0].velocity] : null;
    return [leader ? `Transmission: velocities relative to ${leader}` : "Velocities that the drives cause"];
  }

  /** How mobile each coordinate is with the loops closed. */
  measures() {
    const table = this.run.tables.measure;
    return this.run.scene.velocities.map((name, i) => entry(name, (frame) => {
      const rho = table.get(frame, i);
      return { part: rho, text: Number.isFinite(rho) ? rho.toFixed(3) : "–" };
    }, i));
  }

  /** Of a prescribed motion, velocities: relative to the drive where there is one, else as they are. */
  transmission() {
    const { drives, velocities } = this.run.scene, line = (i) => this.lineOf(`velocity of ${velocities[i]}`);
    const single = drives.length === 1 && drives[0].velocity !== null ? line(drives[0].velocity) : null;
    const ranked = velocities.map((_, i) => line(i)), still = single ? NEGLIGIBLE * largest(single) : 0;
    return velocities.map((name, i) => {
      if (!ranked[i] || (single && i === drives[0].velocity)) return null;
      const { unit } = this.curveOf.get(`velocity of ${name}`), least = this.negligible(unit);
      const own = (f) => (Math.abs(ranked[i][f]) < least ? 0 : ranked[i][f]);
      const value = (f) => (single ? (Math.abs(single[f]) > still ? own(f) / single[f] : NaN) : own(f));
      const most = largest(ranked[i].map((_, f) => value(f)));
      return entry(name, (frame) => {
        const x = value(frame);
        return { part: Math.abs(x) / (most || 1), text: short(x, 3), unit: single ? "" : unit };
      });
    }).filter(Boolean);
  }

  /** Of a mechanism without loops all coordinates are free: where each is between its extremes. */
  coordinates() {
    return this.run.scene.curves.filter((curve) => curve.group === "coordinates").map(({ name, unit }) => {
      const line = this.lineOf(name), finite = line.filter(Number.isFinite);
      const low = Math.min(...finite), high = Math.max(...finite), least = this.negligible(unit);
      return entry(name, (frame) => (
        { part: high - low > least ? (line[frame] - low) / (high - low) : 0, text: short(line[frame], 3), unit }));
    });
  }

  /** Values of a curve over all frames; null where the page does not hold it. */
  lineOf(name) {
    const curve = this.curveOf.get(name);
    if (!curve) return null;
    const table = this.run.tables[curve.table];
    return Array.from({ length: this.run.frames }, (_, f) => table.get(f, curve.columns[0]));
  }

  /** Efforts of the drives and the power they supply. */
  makeEfforts() {
    const { drives, velocities } = this.run.scene, home = document.getElementById("efforts");
    home.hidden = !drives.length;
    this.efforts = drives.flatMap((drive, i) => {
      const effort = this.lineOf(`effort of ${drive.name}`), least = this.negligible(drive.unit);
      const rows = [entry(drive.name, magnitude(effort, least, drive.unit))];
      const rate = drive.velocity === null ? null : this.lineOf(`velocity of ${velocities[drive.velocity]}`);
      if (rate) {
        rows.push(entry("power", magnitude(effort.map((x, f) => x * rate[f]), this.negligible("W"), "W")));
      }
      return rows;
    }).map((each) => this.row(each, home));
    const open = drives.filter((drive) => drive.open).map(({ name }) => name);
    if (open.length) home.append(element("p", "legend", `Not unique, shared by least squares: ${open.join(", ")}.`));
  }

  /** A smaller value of a unit is round-off. */
  negligible(unit) { return NEGLIGIBLE * (this.run.scene.scales[unit] || 0); }

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

  row(each, home) {
    const row = element("div", "row"), mark = element("span", "mark", "◆"), track = element("span", "track");
    const fill = element("span", "fill"), value = element("span", "value");
    fill.style.display = "block";
    mark.setAttribute("aria-hidden", "true");
    track.append(fill);
    row.append(mark, nameOf(each.name), track, value);
    row.title = each.name;
    home.append(row);
    return { ...each, row, fill, value, free: false };
  }

  makeReadouts() {
    const home = document.getElementById("readouts"), made = [];
    for (const [key, label, title, unitName] of READOUTS) {
      const table = this.run.tables[key];
      if (!table || !table.values.some(Number.isFinite)) continue;
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
    for (const r of this.rows) {
      if (r.free !== free.has(r.velocity)) r.row.classList.toggle("free", (r.free = free.has(r.velocity)));
    }
    this.marked = now;
    if (!this.all && !this.query) this.choose();
    const { velocities, drives, warning } = this.run.scene, names = now.map((i) => velocities[i]), most = 12;
    const rest = names.length > most ? ` and ${names.length - most} more` : "";
    document.getElementById("chosen").textContent = names.length > FEW / 2 && names.length === velocities.length
      ? `All ${names.length} velocities are independent.`
      : names.length ? `Independent: ${names.slice(0, most).join(", ")}${rest} (${names.length} of ${velocities.length})`
        : drives.length ? "No independent coordinate: the motion is prescribed."
          : warning ? "The drawing does not assemble: no coordinates are chosen."
            : this.run.scene.given ? "The motion is given: no coordinate is independent."
              : "No independent coordinate: nothing can move.";
  }

  /** Set the bars that can be seen; a chain of a thousand loops has thousands. */
  bars(frame) {
    for (const r of this.efforts) this.fillBar(r, frame);
    if (!this.shown.length) return;
    const height = this.shown[0][0].row.offsetHeight || 22;
    // On a phone the list does not scroll by itself: then all of it counts as seen.
    const whole = this.list.scrollHeight <= this.list.clientHeight + 1;
    const first = whole ? 0 : Math.max(0, Math.floor(this.list.scrollTop / height) - 1);
    const last = whole ? this.shown.length : first + Math.ceil(this.list.clientHeight / height) + 3;
    for (const [r] of this.shown.slice(first, last)) this.fillBar(r, frame);
  }

  fillBar(r, frame) {
    const { part, text, unit } = r.read(frame);
    r.fill.style.transform = `scaleX(${Number.isFinite(part) ? Math.max(0, Math.min(1, part)) : 0})`;
    const written = unit ? `${text} ${unit}` : text;
    if (r.written === written && r.wasFree === r.free) return;
    r.written = written;
    r.wasFree = r.free;
    r.value.textContent = written;
    r.row.title = `${r.name}: ${written}${r.free ? ", independent" : ""}`;
  }
}

/** A name that is cut before its end where it is too long: names of a list differ at the end. */
function nameOf(text) {
  const box = element("span", "name"), last = Math.max(text.lastIndexOf("."), text.lastIndexOf(" "));
  const end = last > 0 && text.length - last < 9 ? last : Math.max(0, text.length - 5);
  box.append(element("span", "", text.slice(0, end)), element("span", "end", text.slice(end)));
  return box;
}
