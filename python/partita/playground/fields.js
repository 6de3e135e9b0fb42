// Fields for all numbers that can be changed, in groups that can be searched; undo and redo.

const FIRST_SHOWN = 12; // fields of a group; the rest are folded
const MOST_LENGTHS = 60, MOST_BODIES = 40;
const MOST_UNDO = 100;
const UNITS = { mass: "kg", stiffness: "N/m", damping: "N s/m", length: "m", radius: "m", radius1: "m", radius2: "m", pitch: "m" };

/** Five digits, by powers of ten where a field would cut them off. */
function nice(x) {
  const five = Number(x.toPrecision(5)), plain = five.toString();
  return plain.length > 9 ? five.toExponential() : plain;
}

/** All numbers, and those of drives, as they are now. */
class Numbers {
  constructor(about, motion) {
    this.about = about;
    this.motion = motion;
    this.names = Object.keys(about.values).filter((name) => Object.hasOwn(about.parameters, name) && !name.startsWith("pull "));
    this.past = [];
    this.future = [];
    this.last = "";
  }

  now() {
    const values = Object.fromEntries(this.names.map((name) => [name, this.motion.get(name)]));
    return { values, rates: this.motion.rates.map(({ value, factor }) => ({ value, factor })) };
  }

  /** Numbers that differ from the drawing. */
  changed() {
    const found = {};
    for (const name of this.names) {
      const now = this.motion.get(name);
      if (now.some((x, i) => x !== this.about.values[name][i])) found[name] = now;
    }
    return found;
  }

  /** Drives that differ from the drawing: by name, a value or a factor of time. */
  changedDrives() {
    const found = {};
    this.motion.rates.forEach((drive, i) => {
      if (drive.breaks.length ? drive.factor !== 1 : drive.value !== this.about.drives[i].value) {
        found[drive.name] = drive.breaks.length ? drive.factor : drive.value;
      }
    });
    return found;
  }

  /** Before a change: what `undo` comes back to. Changes of one field in a row are one. */
  remember(field) {
    if (field && field === this.last) return;
    this.last = field;
    this.past.push(this.now());
    if (this.past.length > MOST_UNDO) this.past.shift();
    this.future = [];
  }

  /** Numbers as they were; returns why they cannot be, else "". */
  restore({ values, rates }) {
    const different = {};
    for (const name of this.names) {
      const now = this.motion.get(name);
      if (now.some((x, i) => x !== values[name][i])) different[name] = values[name];
    }
    const before = this.now(), words = Object.keys(different).length ? this.motion.change(different) : "";
    if (words) return words;
    for (const [i, { value, factor }] of rates.entries()) {
      const drive = this.motion.rates[i];
      if (drive.factor !== factor) this.motion.pace(i, factor);
      const fault = drive.value === value ? "" : this.motion.prescribe(i, value);
      if (!fault) continue;
      this.motion.change(Object.fromEntries(Object.keys(different).map((name) => [name, before.values[name]])));
      before.rates.forEach((old, j) => {
        if (this.motion.rates[j].factor !== old.factor) this.motion.pace(j, old.factor);
        if (this.motion.rates[j].value !== old.value) this.motion.prescribe(j, old.value);
      });
      return fault;
    }
    return "";
  }

  step(from, to) {
    if (!from.length) return "";
    this.last = "";
    const now = this.now(), words = this.restore(from[from.length - 1]);
    if (words) return words;
    from.pop();
    to.push(now);
    return "";
  }

  undo() {
    return this.step(this.past, this.future);
  }

  redo() {
    return this.step(this.future, this.past);
  }
}

/** Groups of fields. `attempt(change)` carries out a change, reports why it cannot be, and shows all numbers anew. */
class Fields {
  constructor(about, motion, numbers, attempt, fault) {
    Object.assign(this, { about, motion, numbers, attempt, fault });
    this.refresh = [];
    this.home = document.getElementById("groups");
    this.lengths();
    this.bodies();
    this.others();
    this.drives();
    this.all();
    document.getElementById("search").addEventListener("input", (e) => this.find(e.target.value.trim().toLowerCase()));
  }

  has(name) {
    return Object.hasOwn(this.about.parameters, name);
  }

  group(name, id, open = true) {
    const box = element("details", "group"), inside = element("div");
    box.open = open;
    box.append(element("summary", "", name), inside);
    box.id = `group-${id}`;
    inside.id = id;
    this.home.append(box);
    return inside;
  }

  /** Where field number `i` of `count` goes: the first dozen visible, the rest folded. */
  part(parent, i, count) {
    if (i < FIRST_SHOWN || count <= FIRST_SHOWN + 3) return parent;
    if (!parent.querySelector("details")) {
      const fold = element("details");
      fold.append(element("summary", "", `${count - FIRST_SHOWN} more`));
      parent.append(fold);
    }
    return parent.querySelector("details");
  }

  /** A number, with a slider about the value as drawn. */
  field(parent, words, unit, read, write, slider) {
    const id = `f${this.refresh.length}`, box = element("div", "field"), label = element("label", "", words), input = element("input");
    label.htmlFor = id;
    Object.assign(input, { type: "number", id, step: "any" });
    box.append(label, input, element("span", "unit", unit));
    box.dataset.words = words.toLowerCase();
    let range = null;
    if (slider) {
      range = element("input");
      Object.assign(range, { type: "range", min: slider[0], max: slider[1], step: (slider[1] - slider[0]) / 400, value: read() });
      range.setAttribute("aria-label", words);
      box.append(range);
    }
    const take = (x, drag) => {
      if (!Number.isFinite(x)) {
        input.classList.add("bad");
        this.fault(`${words} needs a number.`);
        return;
      }
      const { past, future, last } = this.numbers, saved = [past.length, future.slice(), last];
      this.numbers.remember(drag ? id : "");
      const fits = this.attempt(() => write(x));
      if (!fits) { // nothing was changed
        past.length = saved[0];
        this.numbers.future = saved[1];
        this.numbers.last = saved[2];
      }
      input.classList.toggle("bad", !fits);
    };
    input.addEventListener("change", () => take(input.valueAsNumber, false));
    if (range) {
      range.addEventListener("input", () => take(range.valueAsNumber, true));
      range.addEventListener("change", () => { this.numbers.last = ""; });
    }
    const show = () => {
      const value = read();
      if (document.activeElement !== input || !input.classList.contains("bad")) input.value = nice(value);
      if (range && document.activeElement !== range) range.value = value;
    };
    this.refresh.push(show);
    show();
    parent.append(box);
  }

  lengths() {
    const { about, motion } = this, shown = about.lengths.slice(0, MOST_LENGTHS);
    if (!shown.length) return;
    const home = this.group("Lengths", "lengths");
    shown.forEach((one, i) => {
      const words = `${one.body}: ${one.what}`;
      const set = (x) => (x > 0 ? motion.change(motion.lengthened(one, x)) : `${words} must be above 0.`);
      this.field(this.part(home, i, shown.length), words, "m", () => motion.lengthOf(one), set, [0.3 * one.drawn, 2 * one.drawn]);
    });
  }

  /** What the drawing refuses as well. */
  outside(name, words, x) {
    if (name.endsWith(".mass") && !(x > 0)) return `${words} must be above 0.`;
    if (this.about.bounds[name] === "above" && !(x > 0)) return `${words} must be above 0.`;
    return this.about.bounds[name] === "not" && x === 0 ? `${words} must not be 0.` : "";
  }

  scalar(parent, name, words, unit) {
    const x = this.about.values[name][0], { motion } = this;
    const set = (value) => this.outside(name, words, value) || motion.change({ [name]: [value] });
    this.field(parent, words, unit, () => motion.get(name)[0], set, x > 0 ? [0.1 * x, 4 * x] : null);
  }

  bodies() {
    const { about, motion } = this, heavy = about.bodies.slice(0, MOST_BODIES).filter((body) => this.has(`${body}.mass`));
    if (!heavy.length && !this.has("gravity")) return;
    const home = this.group("Masses and gravity", "masses");
    if (this.has("gravity")) {
      const drawn = about.values.gravity, g = length(drawn), direction = g > 0 ? scaled(drawn, 1 / g) : [0, -1, 0];
      const set = (x) => motion.change({ gravity: scaled(direction, x) });
      this.field(home, "gravity", "m/s²", () => dot(motion.get("gravity"), direction), set, [0, g > 0 ? 2 * g : 20]);
    }
    heavy.forEach((body, i) => this.scalar(this.part(home, i, heavy.length), `${body}.mass`, `${body}: mass`, "kg"));
  }

  /** Single numbers of springs, loads and couplings. */
  others() {
    const springs = new Set(this.about.springs.map(({ name }) => name)), found = { springs: [], couplings: [] };
    for (const name of this.numbers.names) {
      const at = name.lastIndexOf("."), what = name.slice(at + 1), owner = name.slice(0, at);
      if (at < 0 || what === "mass" || this.about.values[name].length !== 1) continue;
      const load = springs.has(owner) || ["stiffness", "damping", "angle", "value"].includes(what);
      found[load ? "springs" : "couplings"].push([name, `${owner}: ${what}`, UNITS[what] || ""]);
    }
    for (const [id, title] of [["springs", "Springs and loads"], ["couplings", "Couplings and others"]]) {
      if (!found[id].length) continue;
      const home = this.group(title, id);
      found[id].forEach((one, i) => this.scalar(this.part(home, i, found[id].length), ...one));
    }
  }

  drives() {
    const { motion } = this;
    if (!motion.rates.length) return;
    const home = this.group("Drives", "drives");
    motion.rates.forEach((drive, i) => {
      if (drive.breaks.length) {
        this.field(home, `${drive.name}: times as fast`, "", () => motion.rates[i].factor, (x) => motion.pace(i, x), [0, 3]);
      } else {
        const x = drive.value, wide = Math.max(Math.abs(x), 1), set = (value) => motion.prescribe(i, value);
        const unit = drive.level === "position" ? drive.unit : `${drive.unit || "1"}/s`;
        this.field(home, `${drive.name}: ${drive.level}`, unit, () => motion.rates[i].value, set, [x - 2 * wide, x + 2 * wide]);
      }
    });
  }

  /** Everything else by components, made when it is asked for. */
  all() {
    const home = this.group("All numbers", "rest", false), { motion } = this;
    this.makeAll = () => {
      if (home.childElementCount) return;
      for (const name of this.numbers.names) {
        const count = this.about.values[name].length;
        for (let i = 0; i < count && count > 1; i++) {
          const part = count === 3 ? "xyz"[i] : count === 9 ? "xyz"[Math.floor(i / 3)] + "xyz"[i % 3] : i + 1;
          const set = (x) => {
            const values = motion.get(name);
            values[i] = x;
            if (count === 9) values[3 * (i % 3) + Math.floor(i / 3)] = x; // a tensor stays symmetric
            return this.outside(name, `${name} ${part}`, x) || motion.change({ [name]: values });
          };
          this.field(home, `${name} ${part}`, "", () => motion.get(name)[i], set, null);
        }
      }
    };
    home.parentElement.addEventListener("toggle", () => this.makeAll());
  }

  /** Fields with some text in their name; groups without one are hidden. */
  find(text) {
    if (text) this.makeAll();
    for (const group of this.home.querySelectorAll(".group")) {
      let any = false;
      for (const box of group.querySelectorAll(".field")) {
        box.hidden = !box.dataset.words.includes(text);
        any = any || !box.hidden;
      }
      group.hidden = !any && text !== "";
      if (text && any) for (const fold of [group, ...group.querySelectorAll("details")]) fold.open = true;
    }
    const none = text !== "" && ![...this.home.querySelectorAll(".group")].some((group) => !group.hidden);
    document.getElementById("nothing").hidden = !none;
  }

  show() {
    for (const each of this.refresh) each();
  }
}
