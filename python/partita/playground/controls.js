// The page: fields for all that can be changed, the pointer, the clock.

const $ = (id) => document.getElementById(id);
const about = JSON.parse($("data").textContent);
const fault = (words) => { $("fault").hidden = !words; $("fault").textContent = words; };
let motion;
try {
  motion = makeMotion(await loadProgram($("module").textContent), about);
  motion.reset(about.start);
} catch (error) {
  fault(error.message);
  throw error;
}
const drawing = makeDrawing($("view"), about, motion);
let running = true, pull = null, stopped = "";

// five digits, by powers of ten where a field would cut them off
const nice = (x) => {
  const five = Number(x.toPrecision(5)), plain = five.toString();
  return plain.length > 9 ? five.toExponential() : plain;
};
const UNITS = { mass: "kg", stiffness: "N/m", damping: "N s/m", length: "m", radius: "m", radius1: "m", radius2: "m", pitch: "m" };
const refresh = [];
function attempt(doIt) {
  let words = "";
  try {
    words = doIt() || "";
  } catch (error) {
    if (!(error instanceof motion.Fault)) throw error;
    words = error.message;
  }
  if (!words) stopped = "";
  fault(words || stopped);
  refresh.forEach((f) => f());
  return !words;
}
// a number with a slider about the value as drawn
function field(parent, words, unit, read, write, slider) {
  const id = `f${document.querySelectorAll(".field").length}`;
  const box = document.createElement("div");
  box.className = "field";
  const label = document.createElement("label");
  label.htmlFor = id;
  label.textContent = words;
  const input = document.createElement("input");
  Object.assign(input, { type: "number", id, step: "any" });
  const of = document.createElement("span");
  of.className = "unit";
  of.textContent = unit;
  box.append(label, input, of);
  let range = null;
  if (slider) {
    const x = read();
    range = document.createElement("input");
    Object.assign(range, { type: "range", min: slider[0], max: slider[1], step: (slider[1] - slider[0]) / 400, value: x });
    range.setAttribute("aria-label", words);
    box.append(range);
  }
  const take = (x) => {
    const fits = Number.isFinite(x) && attempt(() => write(x));
    input.classList.toggle("bad", !fits);
    if (!Number.isFinite(x)) fault(`${words} needs a number.`);
  };
  input.addEventListener("change", () => take(input.valueAsNumber));
  if (range) range.addEventListener("input", () => take(range.valueAsNumber));
  const show = () => {
    if (document.activeElement !== input || !input.classList.contains("bad")) input.value = nice(read());
    if (range && document.activeElement !== range) range.value = read();
  };
  refresh.push(show);
  show();
  parent.append(box);
}
const has = (name) => name in about.parameters;

// the first dozen visible, the rest folded
const more = (parent, number, count) => {
  if (number < 12 || count <= 15) return parent;
  if (!parent.querySelector("details")) {
    const fold = document.createElement("details"), words = document.createElement("summary");
    words.textContent = `${count - 12} more`;
    fold.append(words);
    parent.append(fold);
  }
  return parent.querySelector("details");
};
about.lengths.slice(0, 60).forEach((one, i) => {
  const words = `${one.body}: ${one.what}`;
  const set = (x) => (x > 0 ? motion.change(motion.lengthened(one, x)) : `${words} must be above 0.`);
  const parent = more($("lengths"), i, Math.min(60, about.lengths.length));
  field(parent, words, "m", () => motion.lengthOf(one), set, [0.3 * one.drawn, 2 * one.drawn]);
});
if (about.lengths.length === 0) $("lengths").textContent = "No body has two rotational joints.";
// what the drawing refuses as well
const outside = (name, words, x) => {
  if (about.bounds[name] === "above" && !(x > 0)) return `${words} must be above 0.`;
  return about.bounds[name] === "not" && x === 0 ? `${words} must not be 0.` : "";
};
const scalar = (parent, name, words, unit, positive) => {
  const x = about.values[name][0];
  const set = (value) =>
    positive && !(value > 0) ? `${words} must be above 0.` : outside(name, words, value) || motion.change({ [name]: [value] });
  field(parent, words, unit, () => motion.get(name)[0], set, x > 0 ? [0.1 * x, 4 * x] : null);
};
if (has("gravity")) {
  const drawn = about.values.gravity, g = Math.hypot(...drawn), direction = g > 0 ? drawn.map((x) => x / g) : [0, -1, 0];
  const size = () => motion.get("gravity").reduce((s, x, i) => s + x * direction[i], 0);
  field($("masses"), "gravity", "m/s²", size, (x) => motion.change({ gravity: direction.map((w) => w * x) }), [0, g > 0 ? 2 * g : 20]);
}
const heavy = about.bodies.slice(0, 40).filter((body) => has(`${body}.mass`));
heavy.forEach((body, i) => scalar(more($("masses"), i, heavy.length), `${body}.mass`, `${body}: mass`, "kg", true));
for (const name of Object.keys(about.parameters)) {
  const [, what] = [name.slice(0, name.lastIndexOf(".")), name.slice(name.lastIndexOf(".") + 1)];
  if (name.startsWith("pull ") || name === "gravity" || what === "mass") continue;
  const owner = name.slice(0, name.lastIndexOf("."));
  if (about.values[name].length === 1) scalar($("masses"), name, `${owner}: ${what}`, UNITS[what] || "", false);
}
// everything else by components, made when it is asked for
$("rest").parentElement.addEventListener("toggle", () => {
  if ($("rest").childElementCount) return;
  for (const [name, [, count]] of Object.entries(about.parameters)) {
    if (name.startsWith("pull ") || count === 1) continue;
    for (let i = 0; i < count; i++) {
      const part = count === 3 ? "xyz"[i] : count === 9 ? "xyz"[Math.floor(i / 3)] + "xyz"[i % 3] : i + 1;
      const set = (x) => {
        const all = motion.get(name);
        all[i] = x;
        // a tensor stays symmetric
        if (count === 9) all[3 * (i % 3) + Math.floor(i / 3)] = x;
        return outside(name, `${name} ${part}`, x) || motion.change({ [name]: all });
      };
      field($("rest"), `${name} ${part}`, "", () => motion.get(name)[i], set, null);
    }
  }
});
$("driven").hidden = motion.rates.length === 0;
motion.rates.forEach((drive, i) => {
  if (drive.breaks.length) {
    field($("drives"), `${drive.name}: times as fast`, "", () => motion.rates[i].factor, (x) => motion.pace(i, x), [0, 3]);
  } else {
    const x = drive.value, wide = Math.max(Math.abs(x), 1);
    const unit = drive.level === "position" ? "" : "/s";
    const set = (value) => motion.prescribe(i, value);
    field($("drives"), `${drive.name}: ${drive.level}`, unit, () => motion.rates[i].value, set, [x - 2 * wide, x + 2 * wide]);
  }
});

// bars of rho: the first forty
const bars = about.names.slice(0, 40).map((name) => {
  const row = document.createElement("div");
  row.className = "row";
  row.innerHTML = '<span class="mark" aria-hidden="true">◆</span><span class="name"></span><span class="track"><span class="fill" style="display:block"></span></span><span class="value"></span>';
  row.querySelector(".name").textContent = name;
  row.querySelector(".name").title = name;
  $("bars").append(row);
  return { row, fill: row.querySelector(".fill"), value: row.querySelector(".value") };
});
const readouts = ["energy", "switches", "frames a second"].map((name) => {
  const box = document.createElement("div"), dt = document.createElement("dt"), dd = document.createElement("dd");
  dt.textContent = name;
  box.append(dt, dd);
  $("readouts").append(box);
  return dd;
});

for (const x of [0.001, 0.01, 0.03, 0.1, 0.3, 1, 3]) $("speed").add(new Option(`× ${x}`, x));
if (![...$("speed").options].some((o) => Number(o.value) === about.speed)) $("speed").add(new Option(`× ${about.speed}`, about.speed));
$("speed").value = about.speed;

// ---- the pointer
let dragging = null;
const local = (event) => {
  const box = $("view").getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};
const springOf = (body) => `pull ${about.bodies[body]}`;
function release() {
  if (!pull) return;
  const name = springOf(pull.body);
  motion.load({ [`${name}.stiffness`]: [0], [`${name}.damping`]: [0] });
  pull = null;
}
function grasp(found) {
  pull = found;
  const name = springOf(found.body);
  // in proportion to the mass and size of what moves: half its weight for a displacement by a tenth of its size
  let mass = 0;
  for (const body of about.bodies) if (has(`${body}.mass`)) mass += motion.get(`${body}.mass`)[0];
  const stiffness = (mass || 1) * 60, damping = 2 * (mass || 1) * 2;
  motion.load({
    [`${name}.point1`]: found.to, [`${name}.point2`]: found.point, [`${name}.stiffness`]: [stiffness], [`${name}.damping`]: [damping],
  });
}
$("view").addEventListener("pointerdown", (event) => {
  $("view").setPointerCapture(event.pointerId);
  const [x, y] = local(event), found = event.button === 0 && !event.shiftKey ? drawing.pick(x, y) : null;
  dragging = { x, y, moves: event.button !== 0 || event.shiftKey };
  if (found) grasp(found);
  $("hint").hidden = true;
});
$("view").addEventListener("pointermove", (event) => {
  if (!dragging) return;
  const [x, y] = local(event);
  if (pull) {
    pull.to = drawing.world(x, y, pull.to);
    motion.load({ [`${springOf(pull.body)}.point1`]: pull.to });
  } else if (about.view.planar || dragging.moves) {
    drawing.eye.right += x - dragging.x;
    drawing.eye.up += y - dragging.y;
  } else {
    drawing.eye.azimuth -= (x - dragging.x) * 0.008;
    drawing.eye.elevation = Math.max(-1.57, Math.min(1.57, drawing.eye.elevation + (y - dragging.y) * 0.008));
  }
  dragging = { ...dragging, x, y };
});
for (const end of ["pointerup", "pointercancel"]) $("view").addEventListener(end, () => { dragging = null; release(); });
$("view").addEventListener("contextmenu", (event) => event.preventDefault());
const zoom = (factor) => { drawing.eye.zoom = Math.max(0.05, Math.min(40, drawing.eye.zoom * factor)); };
$("view").addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY * 0.0012)); }, { passive: false });

// ---- clock and buttons
const play = (on) => { running = on; $("play").textContent = on ? "Pause" : "Run"; };
const restart = () => attempt(() => { release(); motion.reset(about.start); play(true); });
$("play").addEventListener("click", () => { stopped = ""; fault(""); play(!running); });
$("restart").addEventListener("click", restart);
$("drawn").addEventListener("click", () => {
  motion.load(about.values);
  motion.rates.forEach((d, i) => { d.factor = 1; d.value = about.drives[i].value; });
  restart();
});
$("halt").addEventListener("click", () => attempt(() => motion.halt()));
document.addEventListener("keydown", (event) => {
  if (["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName)) return;
  const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  if (event.key === " ") $("play").click();
  else if (event.key === "r" || event.key === "R") restart();
  else if (event.key === "+") zoom(1.2);
  else if (event.key === "-") zoom(1 / 1.2);
  else if (turn && about.view.planar) { drawing.eye.right += 20 * turn[0]; drawing.eye.up += 20 * turn[1]; }
  else if (turn) { drawing.eye.azimuth -= 0.1 * turn[0]; drawing.eye.elevation += 0.1 * turn[1]; }
  else return;
  event.preventDefault();
});

let last = 0, rate = 60, asked = 0;
function frame(now) {
  const passed = Math.min(0.05, last ? (now - last) / 1000 : 1 / 60);
  if (last && now > last) rate += 0.05 * (1000 / (now - last) - rate);
  last = now;
  if (running) {
    const speed = Number($("speed").value);
    try {
      // time that a step covered beyond the last frame is not computed again; what could not be computed in time is left out
      asked = Math.max(asked, motion.t - 0.1 * speed) + passed * speed;
      if (Math.abs(asked - motion.t) > 0.2 * speed) asked = motion.t + passed * speed;
      motion.advance(asked, performance.now() + 200);
      asked = Math.min(asked, motion.t);
    } catch (error) {
      if (!(error instanceof motion.Fault)) throw error;
      stopped = error.message;
      fault(stopped);
      play(false);
    }
  }
  drawing.draw(pull);
  show(drawing.state.energy);
  requestAnimationFrame(frame);
}
let frames = 0;
function show(energy) {
  frames += 1;
  // many bars are read no faster
  if (about.names.length > 24 && frames % 6) return;
  try { motion.choose(); } catch (error) { if (!(error instanceof motion.Fault)) throw error; }
  const chosen = new Set(motion.independent);
  bars.forEach(({ row, fill, value }, i) => {
    row.classList.toggle("free", chosen.has(i));
    fill.style.transform = `scaleX(${motion.rho[i]})`;
    value.textContent = motion.rho[i].toFixed(2);
  });
  readouts[0].textContent = `${(energy[0] + energy[1]).toPrecision(5)} J`;
  readouts[1].textContent = motion.switches;
  readouts[2].textContent = rate.toFixed(0);
  $("clock").textContent = `${motion.t.toFixed(3)} s`;
}
// for tests and for the curious
window.playground = { motion, about, drawing, grasp, release };
requestAnimationFrame(frame);
