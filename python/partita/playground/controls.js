// The page: drawing and plots of what moves now, the pointer, the clock, links and files.

const $ = (id) => document.getElementById(id);
const about = JSON.parse($("data").textContent);
const fault = (words) => { $("fault").hidden = !words; $("fault").textContent = words; };
const MOST_TRIED = 4; // speeds
const EXPLORED = 3, EXPLORING = 150; // seconds of motion looked at before the first picture; milliseconds spent on them
const PLOTTED = 6; // seconds on the screen that plots reach back
const SPEEDS = [0.001, 0.01, 0.03, 0.1, 0.3, 1, 3];
let motion;
try {
  motion = makeMotion(await loadProgram($("module").textContent), about);
  motion.reset(about.start);
} catch (error) {
  fault(error.message);
  throw error;
}
let running = true, stopped = "";
const numbers = new Numbers(about, motion);
const live = new LiveRun(about, motion);
const scene = new LiveScene(live, $("view"));

/** The first view holds where the mechanism goes in the next seconds at this speed; returns how fast it usually turns. */
function explore(speed) {
  const deadline = performance.now() + EXPLORING, loads = { force: [], moment: [] }, arrows = [], rates = [], shapes = [];
  try {
    for (let i = 1; i <= 30 && performance.now() < deadline; i++) {
      motion.advance(motion.t + (EXPLORED * speed) / 30, deadline);
      live.look();
      scene.extent.push(...findExtent(live));
      shapes.push(aboutMiddle(live, 0));
      live.scene.joints.forEach((_, j) => {
        loads.force.push(length(live.load(j, 0)));
        arrows.push([live.jointPoint(0, j), live.load(j, 0)]);
        loads.moment.push(length(live.load(j, 3)));
      });
      rates.push(live.turning);
    }
  } catch (error) {
    if (!(error instanceof motion.Fault)) throw error; // it will be reported when it happens
  }
  scene.scaleTo(loads);
  scene.reach = arrows.map((arrow) => scene.tipOf(...arrow)).filter(Boolean);
  scene.near = travelling(live, scene.extent, shapes);
  scene.options.follow = scene.near !== null;
  scene.options.whole = true;
  motion.reset(about.start);
  live.look();
  rates.sort((a, b) => a - b);
  return rates.length ? rates[rates.length >> 1] : 0;
}
// where none is asked for, a speed at which turns can be followed; slower ones are tried while the motion found is faster
let firstSpeed = about.speed || 1;
for (let i = 0; i < MOST_TRIED; i++) {
  const followed = usualSpeed(LONGEST, explore(firstSpeed));
  if (about.speed || followed > 0.6 * firstSpeed) break;
  firstSpeed = followed;
}
const plots = new LivePlots(about, motion, live, PLOTTED * firstSpeed);

/** Carry out a change: report why it cannot be, and show all numbers anew. */
function attempt(change) {
  let words = "";
  try {
    words = change() || "";
  } catch (error) {
    if (!(error instanceof motion.Fault)) throw error;
    words = error.message;
  }
  if (!words) stopped = "";
  fault(words || stopped);
  fields.show();
  $("undo").disabled = !numbers.past.length;
  $("redo").disabled = !numbers.future.length;
  return !words;
}
const fields = new Fields(about, motion, numbers, attempt, fault);

// bars of rho: the first forty
const bars = about.names.slice(0, 40).map((name) => {
  const row = element("div", "row"), mark = element("span", "mark", "◆"), track = element("span", "track");
  const fill = element("span", "fill"), value = element("span", "value"), label = element("span", "name", name);
  mark.setAttribute("aria-hidden", "true");
  fill.style.display = "block";
  label.title = name;
  track.append(fill);
  row.append(mark, label, track, value);
  $("bars").append(row);
  return { row, fill, value };
});
const readouts = ["energy", "switches", "frames a second"].map((name) => {
  const box = element("div"), dd = element("dd");
  box.append(element("dt", "", name), dd);
  $("readouts").append(box);
  return dd;
});
for (const x of [...new Set([...SPEEDS, firstSpeed])].sort((a, b) => a - b)) $("speed").add(new Option(paceText(x), x));
$("speed").value = firstSpeed;
$("speed").addEventListener("change", () => { plots.seconds = PLOTTED * Number($("speed").value); });

// ---- the pointer
let dragging = null, hovered = null; // the pointer pulls or moves the view; it rests at a pixel
const local = (event) => {
  const box = $("view").getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};
const springOf = (body) => `pull ${about.bodies[body]}`;
function release() {
  if (!scene.pull) return;
  const name = springOf(live.place[scene.pull.body]);
  motion.load({ [`${name}.stiffness`]: [0], [`${name}.damping`]: [0] });
  scene.pull = null;
}
function grasp(found) {
  scene.pull = found;
  const name = springOf(live.place[found.body]);
  // in proportion to the mass and size of what moves: half its weight for a displacement by a tenth of its size
  let mass = 0;
  for (const body of about.bodies) mass += scene.number(`${body}.mass`);
  const stiffness = (mass || 1) * 60, damping = 2 * (mass || 1) * 2;
  motion.load({
    [`${name}.point1`]: found.to, [`${name}.point2`]: found.point, [`${name}.stiffness`]: [stiffness], [`${name}.damping`]: [damping],
  });
}
$("view").addEventListener("pointerdown", (event) => {
  $("view").setPointerCapture(event.pointerId);
  const [x, y] = local(event), found = event.button === 0 && !event.shiftKey ? scene.grasped(x, y) : null;
  dragging = { x, y, moves: event.button !== 0 || event.shiftKey };
  hovered = event.pointerType === "touch" ? { x, y } : null; // a finger reads a joint by touching it
  if (found) grasp(found);
  $("hint").hidden = true;
});
$("view").addEventListener("pointermove", (event) => {
  const [x, y] = local(event), { camera } = scene;
  if (!dragging && event.pointerType !== "touch") hovered = { x, y };
  if (!dragging) return;
  if (scene.pull) {
    scene.pull.to = camera.unproject(x, y, scene.pull.to);
    motion.load({ [`${springOf(live.place[scene.pull.body])}.point1`]: scene.pull.to });
  } else {
    scene.touched = true;
    if (live.scene.flat || dragging.moves) camera.move(x - dragging.x, y - dragging.y);
    else camera.turnTo(camera.azimuth - (x - dragging.x) * TURN_OF_PIXEL, camera.elevation + (y - dragging.y) * TURN_OF_PIXEL);
  }
  dragging = { ...dragging, x, y };
});
for (const end of ["pointerup", "pointercancel"]) $("view").addEventListener(end, () => { dragging = null; release(); });
$("view").addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") hovered = null; });
$("view").addEventListener("contextmenu", (event) => event.preventDefault());
function zoom(factor, x = scene.camera.width / 2, y = scene.camera.height / 2 + scene.camera.drop) {
  scene.touched = true;
  scene.camera.zoom(factor, x, y);
}
$("view").addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) * ZOOM_OF_PIXEL), ...local(event));
}, { passive: false });

// ---- view
function setLens(parallel) {
  scene.camera.parallel = parallel;
  $("lens").textContent = parallel ? "Parallel" : "Perspective";
  $("lens").setAttribute("aria-pressed", String(!parallel));
}
const toTheme = () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
function resetView() {
  scene.touched = false;
  scene.resetView();
}
for (const name of ["names", "traces", "forces", "moments", "loads"]) {
  $(name).checked = scene.options[name];
  $(name).addEventListener("change", (event) => { scene.options[name] = event.target.checked; });
}
for (const name of ["velocities", "accelerations", "ghosts"]) {
  $(name).addEventListener("change", (event) => { scene.shown.options[name] = event.target.checked; });
}
$("loads").parentElement.hidden = !live.scene.springs.length;
$("reset").addEventListener("click", resetView);
$("lens").addEventListener("click", () => setLens(!scene.camera.parallel));
$("theme").addEventListener("click", toTheme);
/** The mechanism alone, as large as the screen; again: the page as it was. */
function present(on) {
  document.body.dataset.present = on ? "yes" : "no";
  $("present").setAttribute("aria-pressed", String(on));
  $("present").textContent = on ? "All" : "Present";
  const full = document.fullscreenElement;
  if (on && !full && document.documentElement.requestFullscreen) document.documentElement.requestFullscreen().catch(() => {});
  if (!on && full) document.exitFullscreen().catch(() => {});
}
const presents = () => document.body.dataset.present === "yes";
$("present").addEventListener("click", () => present(!presents()));
document.addEventListener("fullscreenchange", () => { if (!document.fullscreenElement && presents()) present(false); });
prefersDark.addEventListener("change", (event) => setTheme(event.matches ? "dark" : "light"));
function resized() {
  const stage = $("view").getBoundingClientRect(), box = $("tools").getBoundingClientRect();
  scene.covered = [{ left: box.left - stage.left, right: box.right - stage.left, top: box.top - stage.top, bottom: box.bottom - stage.top }];
  scene.camera.head = Math.max(52, Math.min(0.4 * stage.height, box.bottom - stage.top + 20));
  scene.resize();
  if (!scene.touched) scene.resetView();
}
new ResizeObserver(resized).observe($("view"));

// ---- clock and buttons
const play = (on) => { running = on; $("play").textContent = on ? "Pause" : "Run"; };
function restart() {
  return attempt(() => {
    release();
    motion.reset(about.start);
    scene.forget();
    plots.forget();
    play(true);
  });
}
$("play").addEventListener("click", () => { stopped = ""; fault(""); play(!running); });
$("restart").addEventListener("click", restart);
$("drawn").addEventListener("click", () => {
  numbers.remember("");
  motion.load(about.values);
  motion.rates.forEach((d, i) => { d.factor = 1; d.value = about.drives[i].value; });
  restart();
});
$("halt").addEventListener("click", () => attempt(() => motion.halt()));
$("undo").addEventListener("click", () => attempt(() => numbers.undo()));
$("redo").addEventListener("click", () => attempt(() => numbers.redo()));
document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase(), typing = event.target.type === "number" || event.target.type === "search";
  if ((event.ctrlKey || event.metaKey) && !typing && (key === "z" || key === "y")) {
    (key === "y" || event.shiftKey ? $("redo") : $("undo")).click();
    event.preventDefault();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || ["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName)) return;
  const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key], { camera } = scene;
  if (event.key === " ") $("play").click();
  else if (key === "r") restart();
  else if (key === "d") toTheme();
  else if (key === "p") present(!presents());
  else if (event.key === "Escape" && presents()) present(false);
  else if (key === "0") resetView();
  else if (key === "+" || key === "=") zoom(1.2);
  else if (key === "-") zoom(1 / 1.2);
  else if (turn) {
    scene.touched = true;
    if (live.scene.flat) camera.move(20 * turn[0], 20 * turn[1]);
    else camera.turnTo(camera.azimuth - 0.1 * turn[0], camera.elevation + 0.1 * turn[1]);
  } else return;
  event.preventDefault();
});

// ---- links and files
const driven = motion.rates.map(({ name }) => name);
/** Take numbers from the address; returns what is wrong with them. */
function takeAddress() {
  const found = /^#p=(.*)$/.exec(location.hash);
  if (!found) return "";
  const known = Object.fromEntries(numbers.names.map((name) => [name, about.values[name].length]));
  const read = fromAddress(found[1], known, driven);
  if (read.fault) return read.fault;
  for (const [name, values] of Object.entries(read.numbers)) {
    for (const x of values) {
      const words = fields.outside(name, name, x);
      if (words) return words;
    }
  }
  const rates = motion.rates.map(({ name, value, factor, breaks }) => {
    const given = Object.hasOwn(read.drives, name) ? read.drives[name] : null;
    return { value: given !== null && !breaks.length ? given : value, factor: given !== null && breaks.length ? given : factor };
  });
  return numbers.restore({ values: { ...numbers.now().values, ...read.numbers }, rates });
}
/** The address with the numbers that differ from the drawing. */
function address() {
  const changed = numbers.changed(), drives = numbers.changedDrives();
  return Object.keys(changed).length + Object.keys(drives).length ? `#p=${toAddress(changed, drives)}` : "";
}
function say(words) {
  $("hint").hidden = false;
  $("hint").textContent = words;
}
$("share").addEventListener("click", () => {
  const part = address();
  if (part.length > MOST_LETTERS) { fault("More numbers were changed than an address can hold; save a TOML file."); return; }
  history.replaceState(null, "", part || location.pathname + location.search);
  say(part ? "The address of this page now holds the changed numbers." : "Nothing is changed: the address is that of the drawing.");
  if (part && navigator.clipboard) navigator.clipboard.writeText(location.href).then(() => say("The link is in the clipboard."), () => {});
});
/** The model file as changed, and a sentence on what it cannot hold. */
function model() {
  const drives = {};
  const without = [];
  for (const [name, value] of Object.entries(numbers.changedDrives())) {
    const drive = motion.rates.find((one) => one.name === name);
    if (drive.breaks.length) without.push(name); else drives[name] = { level: drive.level, value };
  }
  const made = toToml(about.toml, numbers.changed(), drives, about.solids);
  made.missing.push(...without);
  return made;
}
function script() {
  const targets = {}, rates = {}, joints = new Set(about.joints.map(({ name }) => name));
  for (const i of motion.independent) {
    const name = about.names[i], entry = about.plain.find(([word]) => word === name);
    if (!joints.has(name) || !entry) continue;
    targets[name] = motion.q[entry[1]];
    rates[name] = motion.v[i];
  }
  return { ...model(), text: toPython(`${file()}.toml`, model().text, targets, rates, 10) };
}
const file = () => about.title.replace(/[^A-Za-z0-9._-]+/g, "-").slice(0, 80) || "mechanism";
function save({ text, missing }, ending) {
  const link = element("a"), url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  link.href = url;
  link.download = `${file()}.${ending}`;
  link.click();
  URL.revokeObjectURL(url);
  say(missing.length ? `Saved without ${missing.join(", ")}, for which the file has no place.` : "Saved.");
}
$("toml").addEventListener("click", () => save(model(), "toml"));
$("python").addEventListener("click", () => save(script(), "py"));
window.addEventListener("hashchange", () => attempt(() => takeAddress()));

// ---- frames
let last = 0, rate = 60, asked = 0, frames = 0;
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
      const from = motion.t, deadline = performance.now() + 200, parts = scene.partsOf(asked - from);
      for (let i = 1; i <= parts; i++) {
        motion.advance(from + ((asked - from) * i) / parts, deadline);
        if (i === parts) break; // this one is drawn below
        live.look();
        scene.record(now / 1000);
      }
      asked = Math.min(asked, motion.t);
    } catch (error) {
      if (!(error instanceof motion.Fault)) throw error;
      stopped = error.message;
      fault(stopped);
      play(false);
    }
  }
  scene.draw(0, running);
  showTip($("tip"), scene, 0, hovered && scene.pick(hovered.x, hovered.y), hovered ? hovered.x : 0, hovered ? hovered.y : 0);
  if (running) {
    scene.record(now / 1000);
    plots.record(motion.t, live.state.energy);
  }
  show(live.state.energy);
  requestAnimationFrame(frame);
}
function show(energy) {
  frames += 1;
  if (frames % 2 === 0 || !running) plots.draw();
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

setTheme(prefersDark.matches ? "dark" : "light");
setLens(live.scene.flat);
resized();
attempt(() => takeAddress());
// for tests and for the curious
const drawing = {
  get written() { return (scene.labels ? scene.labels.written : []).map((one) => ({ ...one, word: one.text })); },
  pick: (x, y) => scene.grasped(x, y), scene,
};
window.playground = {
  motion, about, drawing, grasp, release, numbers, address, takeAddress, toml: model, python: script, plots,
};
requestAnimationFrame(frame);
