// Time and input: the slider, playing, the keyboard, the pointer.

const byId = (id) => document.getElementById(id);
const run = new Run(JSON.parse(byId("data").textContent));
const canvas = byId("view");
const scene = new Scene(run, canvas);
// of a motion between outputs that is not known, nothing is gained by showing it slowly
const rate = run.scene.apart ? 0 : motionRate(run, spanOf(scene.near || scene.extent));
const jumpTo = (t) => { play(false); show(run.frameAt(t)); };
const events = new Events(run);
const plots = new Plots(run, rate, jumpTo, events);
const panel = new Panel(run, events, jumpTo);

const duration = run.t[run.frames - 1] - run.t[0];
let frame = 0, playing = false, instant = run.t[0], before = 0, speed = 1, waiting = false, ticking = 0;

/** Draw soon, once, however often asked. */
function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    scene.draw(frame, playing);
    plots.draw(frame);
  });
}

/** Show a frame; `time` where it is played through, else that of the frame. Numbers are those of the nearest output. */
function show(wanted, time) {
  frame = run.between.drawn(Math.max(0, Math.min(run.frames - 1, wanted)));
  instant = time === undefined ? run.timeOf(frame) : time;
  const output = Math.round(frame);
  byId("slider").value = output;
  byId("slider").setAttribute("aria-valuetext", `t = ${short(run.t[output])} s`);
  byId("clock").textContent = `t = ${run.timeOf(frame).toFixed(decimals)} s`;
  panel.show(output);
  plots.frame = frame; // keys count from here, drawn yet or not
  redraw();
}

// ---- playing

/** Digits of the clock: enough to tell two outputs apart. */
const decimals = duration > 0 ? Math.max(2, Math.min(9, Math.ceil(-Math.log10(duration / run.frames)) + 1)) : 3;

function play(on) {
  playing = on && run.frames > 1;
  cancelAnimationFrame(ticking); // one that was asked for before would go on beside the next
  byId("start").textContent = playing ? "❚❚ Pause" : "▶ Play";
  if (!playing) {
    if (!Number.isInteger(frame)) show(Math.round(frame)); // at rest a computed output is shown
    return;
  }
  if (frame === run.frames - 1) show(0);
  before = performance.now();
  ticking = requestAnimationFrame(tick);
}

function tick(now) {
  if (!playing) return;
  instant += (Math.max(0, Math.min(200, now - before)) / 1000) * speed;
  before = now;
  const end = run.t[run.frames - 1];
  if (instant > end) {
    if (byId("loop").checked) {
      instant = run.t[0];
    } else {
      show(run.frames - 1);
      play(false);
      return;
    }
  }
  show(run.instantAt(instant), instant);
  ticking = requestAnimationFrame(tick);
}

function fillSpeeds() {
  const usual = usualSpeed(duration, rate);
  const offered = [...new Set([...PACES.map((factor) => Number((usual * factor).toPrecision(2))), 1])].sort((a, b) => a - b);
  for (const value of offered) {
    const option = element("option", "", paceText(value));
    option.value = value;
    option.selected = value === usual;
    byId("speed").append(option);
  }
  speed = usual;
  byId("speed").addEventListener("change", (e) => { speed = Number(e.target.value); });
}

/** From one of these times to the next, or to the one before. */
function jumpAmong(times, direction) {
  play(false);
  const now = run.timeOf(frame), near = 0.5 * duration / run.frames;
  const found = direction > 0
    ? times.find((t) => run.frameAt(t) > frame)
    : times.filter((t) => t < now - near && run.frameAt(t) < frame).pop();
  if (found !== undefined) jumpTo(found);
}

function fillTicks() {
  for (const s of run.scene.switches) {
    const mark = element("i");
    mark.style.left = `${(100 * run.frameAt(s.t)) / Math.max(1, run.frames - 1)}%`;
    byId("ticks").append(mark);
  }
  events.mark(byId("marks"), jumpTo);
}

// ---- tools

function setLens(parallel) {
  scene.camera.parallel = parallel;
  byId("lens").textContent = parallel ? "Parallel" : "Perspective";
  byId("lens").setAttribute("aria-pressed", String(!parallel));
  redraw();
}

/** Boxes of the canvas under the tools: no word is written there. */
function findCovered() {
  const stage = canvas.getBoundingClientRect(), box = byId("tools").getBoundingClientRect();
  scene.covered = byId("tools").hidden ? [] : [{
    left: box.left - stage.left, right: box.right - stage.left, top: box.top - stage.top, bottom: box.bottom - stage.top,
  }];
  scene.camera.head = byId("tools").hidden ? 52 : Math.max(52, Math.min(0.4 * stage.height, box.bottom - stage.top + 20));
}

function toTheme(name) {
  setTheme(name);
  redraw();
}

const otherTheme = () => (document.documentElement.dataset.theme === "dark" ? "light" : "dark");

function bindTools() {
  prefersDark.addEventListener("change", (e) => toTheme(e.matches ? "dark" : "light"));
  byId("theme").addEventListener("click", () => toTheme(otherTheme()));
  for (const name of ["names", "traces", "forces", "moments", "loads"]) {
    byId(name).checked = scene.options[name];
    byId(name).addEventListener("change", (e) => { scene.options[name] = e.target.checked; redraw(); });
  }
  byId("follow").checked = scene.options.follow;
  byId("follow").parentElement.hidden = !scene.near;
  for (const name of ["follow", "whole"]) {
    byId(name).addEventListener("change", (e) => { scene.options[name] = e.target.checked; scene.resetView(); redraw(); });
  }
  // What there is nothing of is not offered.
  const some = {
    traces: run.frames > 1, forces: scene.forceUnit > 0, moments: scene.momentUnit > 0, loads: run.scene.loads.length > 0,
  };
  for (const name of Object.keys(some)) byId(name).parentElement.hidden = !some[name];
  byId("arrows").parentElement.hidden = !(some.forces || some.moments || some.loads);
  byId("arrows").addEventListener("input", (e) => {
    scene.options.arrows = 10 ** (Number(e.target.value) / 1.5);
    redraw();
  });
  byId("reset").addEventListener("click", () => { scene.resetView(); redraw(); });
  byId("lens").addEventListener("click", () => setLens(!scene.camera.parallel));
  byId("start").addEventListener("click", () => play(!playing));
  byId("slider").addEventListener("input", (e) => show(Number(e.target.value)));
  byId("slider").addEventListener("pointerdown", () => play(false));
}

// ---- keyboard

function onKey(e) {
  if (e.ctrlKey || e.metaKey || e.altKey || byId("certificate").open) return;
  const tag = e.target.tagName;
  if (e.target.type === "search") return;
  const control = ["BUTTON", "SELECT", "SUMMARY"].includes(tag) || e.target.type === "checkbox";
  const scrolls = e.target.type === "range" || tag === "SELECT" || e.target.id === "bars"; // uses Home, End itself
  const camera = scene.camera, turn = 0.09;
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
  if (arrows && e.target === canvas) {
    if (e.shiftKey) camera.move(24 * arrows[0], 24 * arrows[1]);
    else camera.turnTo(camera.azimuth - turn * arrows[0], camera.elevation + turn * arrows[1]);
  } else if (e.key === " " && !control) play(!playing);
  else if (e.key === "," || e.key === ".") { play(false); show(frame + (e.key === "." ? 1 : -1)); }
  else if (e.key === "[" || e.key === "]") jumpAmong(run.scene.switches.map((s) => s.t), e.key === "]" ? 1 : -1);
  else if ((e.key === "e" || e.key === "E") && tag !== "SELECT") jumpAmong(events.all.map((one) => one.t), e.shiftKey ? -1 : 1);
  else if (e.key === "Home" && !scrolls) show(0);
  else if (e.key === "End" && !scrolls) show(run.frames - 1);
  else if (e.key === "d" || e.key === "D") toTheme(otherTheme());
  else if (e.key === "j" || e.key === "J") nextJoint(e.shiftKey ? -1 : 1);
  else if (e.key === "Escape") byId("tip").hidden = true;
  else if (e.key === "0") scene.resetView();
  else if (e.key === "+" || e.key === "=") camera.zoom(1.15, camera.width / 2, camera.height / 2 + camera.drop);
  else if (e.key === "-") camera.zoom(1 / 1.15, camera.width / 2, camera.height / 2 + camera.drop);
  else if (e.key === "p" || e.key === "P") setLens(!camera.parallel);
  else if ((e.key === "f" || e.key === "F") && tag !== "SELECT") byId("forces").click();
  else return;
  e.preventDefault();
  redraw();
}

// ---- pointer: one turns or moves, two pinch

const pointers = new Map();

function onPointerMove(e) {
  const last = pointers.get(e.pointerId), box = canvas.getBoundingClientRect(), camera = scene.camera;
  if (!last) { hover(e.clientX - box.left, e.clientY - box.top); return; }
  const dx = e.clientX - last.x, dy = e.clientY - last.y;
  if (pointers.size === 2) {
    const other = [...pointers].find(([id]) => id !== e.pointerId)[1];
    const from = Math.hypot(last.x - other.x, last.y - other.y);
    const to = Math.hypot(e.clientX - other.x, e.clientY - other.y);
    const x = (e.clientX + other.x) / 2 - box.left, y = (e.clientY + other.y) / 2 - box.top;
    camera.move(dx / 2, dy / 2);
    if (from > 0 && to > 0) camera.zoom(to / from, x, y);
  } else if (last.moves || e.shiftKey) {
    camera.move(dx, dy);
  } else {
    camera.turnTo(camera.azimuth - dx * TURN_OF_PIXEL, camera.elevation + dy * TURN_OF_PIXEL);
  }
  pointers.set(e.pointerId, { x: e.clientX, y: e.clientY, moves: last.moves });
  byId("tip").hidden = true;
  redraw();
}

/** Name, kind and reaction of the joint under the pointer. */
function hover(x, y) {
  describe(scene.pick(x, y), x, y);
}

function describe(hit, x, y) {
  showTip(byId("tip"), scene, frame, hit, x, y);
}

let shownHit = -1;

/** From joint to joint by the keyboard, each described as under the pointer. */
function nextJoint(step) {
  const hits = scene.hits.filter((hit) => hit.kind !== "spring");
  if (!hits.length) return;
  shownHit = (shownHit + step + hits.length) % hits.length;
  const p = scene.camera.project(hits[shownHit].point);
  if (p) describe(hits[shownHit], p.x, p.y);
}

function bindPointer() {
  canvas.addEventListener("pointerdown", (e) => {
    hover(e.offsetX, e.offsetY);
    canvas.setPointerCapture(e.pointerId);
    pointers.set(e.pointerId, { x: e.clientX, y: e.clientY, moves: e.button !== 0 });
  });
  canvas.addEventListener("pointermove", onPointerMove);
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => pointers.delete(e.pointerId));
  canvas.addEventListener("pointerleave", (e) => { if (e.pointerType !== "touch") byId("tip").hidden = true; });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("dblclick", () => { scene.resetView(); redraw(); });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    scene.camera.zoom(Math.exp(-Math.max(-200, Math.min(200, e.deltaY)) * ZOOM_OF_PIXEL), e.offsetX, e.offsetY);
    redraw();
  }, { passive: false });
}

// ---- start

const NARROW = 500, FEW_NAMES = 10; // pixels of a phone; joints whose names have room there
const SEALS = { valid: "✓ valid", suspect: "? suspect", invalid: "✕ invalid" };

/** The verdict on the run in the header, which opens the certificate; a position has none. */
function showSeal() {
  const { verdict, certificate } = run.scene, seal = byId("seal"), dialog = byId("certificate");
  if (!verdict) return;
  seal.hidden = false;
  seal.textContent = SEALS[verdict];
  seal.dataset.verdict = verdict;
  dialog.querySelector("pre").textContent = certificate;
  byId("trust").hidden = false;
  for (const [name, words] of run.scene.trust) {
    if (name) byId("trust").querySelector("dl").append(element("dt", "", name), element("dd", "", words));
    else byId("trust").append(element("p", "", words));
  }
  seal.addEventListener("click", () => dialog.showModal());
  byId("close").addEventListener("click", () => dialog.close());
}

function start() {
  const s = run.scene;
  if (s.warning) {
    byId("warning").textContent = s.warning;
    byId("warning").hidden = false;
  }
  showSeal();
  const notes = [];
  if (s.frames < s.outputs) {
    notes.push(`${s.frames} of ${s.outputs} computed outputs are kept in this page, to keep the file small; between them no joint`
      + ` and no centre of mass strays farther than ${short(100 * s.strays, 2)} % of the picture from the straight way.`);
  }
  if (s.apart) {
    notes.push(`${s.apart.name} turns ${Math.round(s.apart.degrees)}° from output to output: what happens between is not seen, and`
      + ` curves are dots. Outputs ${short(s.apart.step, 2)} s apart (t_eval) would show it.`);
  }
  if (s.coarse) notes.push("Numbers are kept to 1/65 000 of the range of each curve.");
  const meshes = s.solids.flatMap(({ parts }) => parts.filter((part) => part.faces && part.faces.length < 3 * part.of));
  if (meshes.length) {
    const sum = (all) => all.reduce((a, b) => a + b, 0);
    notes.push(`Meshes are drawn with ${sum(meshes.map((m) => m.faces.length / 3))} of ${sum(meshes.map((m) => m.of))} triangles.`);
  }
  byId("note").textContent = notes.join(" ");
  byId("slider").max = Math.max(0, run.frames - 1);
  byId("slider").disabled = byId("start").disabled = run.frames < 2;
  document.querySelector("footer").hidden = run.frames < 2 && !notes.length; // one position has no time
  const bare = /[?&]bare\b/.test(location.search);
  document.documentElement.classList.toggle("bare", bare);
  if (canvas.clientWidth < NARROW && s.joints.length > FEW_NAMES) scene.options.names = false; // they would cover the drawing
  if (bare) Object.assign(scene.options, { names: false, whole: true }); // nothing to switch them by
  fillSpeeds();
  fillTicks();
  bindTools();
  bindPointer();
  document.addEventListener("keydown", onKey);
  byId("tools").hidden = !scene.extent.length;
  findCovered();
  scene.resize();
  byId("whole").parentElement.hidden = !scene.part;
  findCovered();
  setLens(s.flat);
  setTheme(prefersDark.matches ? "dark" : "light");
  const resized = () => { scene.resize(); findCovered(); scene.draw(frame); panel.bars(frame); plots.draw(frame); };
  new ResizeObserver(resized).observe(canvas);
  findCovered();
  // A page begins to move; opened as run.html#t=1.5 or #still it rests, with #t=1.5&play it moves from there; as
  // run.html?bare it is the drawing alone.
  // No element has the id "play": a browser would scroll to it, and pages around this one with it.
  const at = /[#&]t=([0-9.eE+-]+)/.exec(location.hash);
  show(at ? run.frameAt(Number(at[1])) : 0);
  const moves = /[#&]play\b/.test(location.hash) || !(at || /[#&]still\b/.test(location.hash));
  if (moves && !window.matchMedia("(prefers-reduced-motion: reduce)").matches) play(true);
}

/** For programs that hold this page: go to a time, play, ask what is written where. */
window.partita = {
  show: (t) => { play(false); show(run.frameAt(t)); }, play, theme: toTheme, frames: run.frames,
  time: () => run.timeOf(frame), between: (t) => { play(false); show(run.instantAt(t)); }, speed: () => speed, playing: () => playing,
  written: () => (scene.labels ? scene.labels.written : []),
  covered: () => scene.covered,
  arrows: () => scene.shafts,
  hatched: () => scene.hatched,
  ticks: () => plots.list.map((plot) => plot.ticks),
  joints: () => scene.hits.map((hit) => ({ ...scene.camera.project(hit.point), name: hit.label })),
  corners: () => findExtent(run, [frame, frame + 0.5]).map((p) => scene.camera.project(p)),
  size: () => [scene.camera.width, scene.camera.height],
  paint: (t) => { scene.draw(run.between.drawn(run.instantAt(t)), true); plots.draw(run.frameAt(t)); },
  place: (t, body, point) => run.placed(run.between.drawn(run.instantAt(t)), body, point),
  strokes: strokesOf, tangled: isTangled, short, withUnit,
};

start();
