// The page: tools, pointer, keyboard, properties, messages, files, running.

const { drawing, empty } = JSON.parse($("data").textContent);
const sketch = new Sketch(drawing);
const picture = new Picture(sketch, $("view"));
const CLICK = 7; // pixels: a shorter drag is a click
const DIRECTIONS_APART = Math.PI / 12; // slides lie at multiples of this

const HINTS = {
  select: "Drag a point or a bar to move it; drag beside it to move the view. A point dropped on another, or on a bar, is pinned to it.",
  bar: "Press where the bar begins, drag to where it ends. An end on a point or a bar is pinned to it.",
  pin: "Click a bar, or where bars cross: they are pinned there.",
  ground: "Click a point, a bar or an empty place: it is held by the ground. Again: it is free.",
  slide: "Press at a point and drag along the direction in which it slides, or to the bar along which it slides.",
  motor: "Click a pin, near the bar that it turns, or a slide.",
  spring: "Press where the spring begins, drag to where it ends. An end beside the bars is held by the ground.",
  delete: "Click what is to go.",
};
let tool = "bar", saying = null, answer = null;
let pending = null, grabbed = null; // a line that was begun; what the pointer drags

function say(words, kind) {
  $("said").textContent = words;
  $("said").dataset.kind = kind;
}

function heard(found) {
  answer = found;
  if (found.closed) { // the lengths that were asked for, reached by moving nodes
    sketch.close(found.closed);
    answer.gaps = [];
  }
  picture.gaps = found.gaps || [];
  if (picture.gaps.length && !picture.touched) picture.resetView();
  say(found.message, found.kind);
  $("redundancy").textContent = found.redundancy || "";
  $("remarks").replaceChildren(...(found.remarks || []).map((words) => element("li", "", words)));
  $("run").disabled = !runs();
  for (const id of ["toml", "python"]) $(id).disabled = !found[id];
  if (found.closed) { letGo(); refresh(); link.changed(); } else picture.draw();
}
const runs = () => answer !== null && ["moves", "rigid"].includes(answer.kind);
const link = new Link(sketch, heard, (words) => say(words, "open"));

/** Show the drawing anew; what the core says follows. */
function refresh() {
  if (picture.selected !== null && !sketch.find(picture.selected)) picture.selected = null;
  $("undo").disabled = !sketch.past.length;
  $("redo").disabled = !sketch.future.length;
  showProperties();
  picture.draw();
}

/** Forget a line that was begun and what is dragged: the drawing changes under them. */
function letGo() {
  if (grabbed && grabbed.moved) sketch.unchanged(grabbed.future);
  grabbed = pending = picture.preview = null;
}

/** Carry out a change that can be undone; one that changes nothing leaves no trace. */
function change(make, word = "") {
  letGo();
  const { future } = sketch;
  sketch.remember(word);
  make();
  sketch.unchanged(future);
  picture.gaps = [];
  refresh();
  link.changed();
}

// ---- tools

function choose(name) {
  tool = name;
  letGo();
  for (const button of document.querySelectorAll("#tools [data-tool]")) {
    button.setAttribute("aria-pressed", String(button.dataset.tool === name));
  }
  $("hint").textContent = HINTS[name];
  $("view").style.cursor = name === "select" ? "" : "crosshair";
  picture.draw();
}
for (const button of document.querySelectorAll("#tools [data-tool]")) button.addEventListener("click", () => choose(button.dataset.tool));

/** Where the pointer means: a node, a point of bars, or a point of the grid; a point that is drawn upon a node is that node. */
function aimed(x, y, near, except = null) {
  const node = picture.nodeAt(x, y, near, except);
  if (node) return { node, at: [node.x, node.y] };
  const bars = picture.barsAt(x, y, 0.7 * near).filter(({ bar }) => !sketch.nodesOf(bar).includes(except));
  const found = bars.length ? onBars(bars, near) : { at: picture.snapped(picture.at(x, y)) };
  const p = picture.pixel(found.at), there = picture.nodeAt(p.x, p.y, PIN), under = found.bars ? [] : picture.barsAt(p.x, p.y, ROD);
  if (there) return { node: there, at: [there.x, there.y] };
  return under.length ? onBars(under, ROD) : found;
}

/** The crossing of the nearest bars, if it is near, else the foot on the nearest; with all bars that pass there. */
function onBars(found, near) {
  const [first, second] = found, apart = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]);
  const cross = second ? sketch.crossing(first.bar, second.bar) : null;
  const at = cross && apart(cross, first.at) * picture.camera.scale < 2 * near ? cross : first.at;
  const passes = ({ bar }) => apart(sketch.nearestOn(bar, ...at), at) <= EQUAL_IN_SIX_DIGITS * sketch.drawnLength(bar);
  return { bars: found.filter(passes).map(({ bar }) => bar), at };
}

/** The node that is meant, made where there is none. */
function nodeFor({ node, bars, at }) {
  if (node) return node;
  return bars ? sketch.addOn(bars, at) : sketch.addNode(at);
}

function endLine(from, to) {
  if (Math.hypot(to.at[0] - from.at[0], to.at[1] - from.at[1]) * picture.camera.scale < CLICK) return;
  change(() => {
    const a = nodeFor(from), b = nodeFor(to);
    if (a.id === b.id) return;
    const made = tool === "spring" ? sketch.addSpring(a.id, b.id) : sketch.addBar(a.id, b.id);
    if (tool === "bar") pinUnder([made]);
    picture.selected = made.id;
  });
}

function endSlide(from, x, y, near) {
  const own = ({ bar }) => (from.bars || []).includes(bar) || (from.node && sketch.nodesOf(bar).includes(from.node.id));
  const target = picture.barsAt(x, y, near).find((found) => !own(found));
  const p = picture.pixel(from.at), dx = x - p.x, dy = p.y - y, moved = Math.hypot(dx, dy) > 2 * CLICK;
  const angle = moved && !target ? Math.round(Math.atan2(dy, dx) / DIRECTIONS_APART) * DIRECTIONS_APART : 0;
  change(() => { picture.selected = sketch.addSlide(nodeFor(from).id, angle, target ? target.bar.id : null).id; });
}

function click(x, y, near) {
  const target = aimed(x, y, near);
  if (tool === "pin") {
    if (target.node || !target.bars) {
      const why = target.node ? "Bars that share a point are pinned there already." : "There is no bar here.";
      $("hint").textContent = `${why} ${HINTS.pin}`;
      return;
    }
    change(() => { picture.selected = sketch.addOn(target.bars, target.at).id; });
  } else if (tool === "ground") {
    change(() => {
      const node = nodeFor(target);
      const old = sketch.slideAt(node.id);
      node.ground = !(target.node && node.ground);
      if (old && node.ground) sketch.remove(old.id);
      picture.selected = node.id;
      sketch.sweep();
    });
  } else if (tool === "motor") {
    if (!target.node) { $("hint").textContent = "There is no pin or slide here. " + HINTS.motor; return; }
    const bars = sketch.barsAt(target.node.id), slide = sketch.slideAt(target.node.id);
    const nearest = picture.barsAt(x, y, 400).find(({ bar }) => bars.includes(bar));
    if (!slide && !nearest) { $("hint").textContent = "Nothing is pinned here. " + HINTS.motor; return; }
    change(() => {
      const made = sketch.addMotor(target.node.id, slide ? null : nearest.bar.id);
      picture.selected = made ? made.id : target.node.id;
    });
  } else if (tool === "delete") {
    const found = picture.pick(x, y, near);
    if (found) change(() => sketch.remove(found.id));
  }
}

// ---- pointer: one finger draws, two move and zoom

const pointers = new Map();
let several = false; // more than one finger, or another button, since the first was pressed

const local = (event) => {
  const box = $("view").getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};
const nearOf = (event) => (event.pointerType === "touch" ? NEAR_TOUCH : NEAR);

function grab(x, y, near) {
  const found = picture.pick(x, y, near), at = picture.at(x, y);
  picture.selected = found ? found.id : null;
  if (!found) return null;
  const nodes = { nodes: [found.id], bars: [found.a, found.b], slides: [found.node] }[sketch.tableOf(found.id)] || [];
  return { nodes, from: nodes.map((id) => [sketch.node(id).x, sketch.node(id).y]), at, moved: false, future: [], before: "" };
}

function drag(x, y) {
  const [wx, wy] = picture.at(x, y), dx = wx - grabbed.at[0], dy = wy - grabbed.at[1];
  if (!grabbed.nodes.length || (!grabbed.moved && Math.hypot(dx, dy) * picture.camera.scale < CLICK)) return;
  if (!grabbed.moved) {
    grabbed.future = sketch.future;
    grabbed.before = JSON.stringify(sketch.data);
    sketch.remember();
    grabbed.moved = true;
  }
  const first = picture.snapped([grabbed.from[0][0] + dx, grabbed.from[0][1] + dy]);
  const by = [first[0] - grabbed.from[0][0], first[1] - grabbed.from[0][1]];
  grabbed.nodes.forEach((id, i) => sketch.move(id, [grabbed.from[i][0] + by[0], grabbed.from[i][1] + by[1]]));
  picture.gaps = [];
  refresh();
  link.changed();
}

/** Pin bars to the nodes nearer than so many pixels to them, over which they were drawn or moved. */
function pinUnder(bars, near = ROD) {
  for (const bar of bars) {
    for (const node of sketch.data.nodes) {
      const p = picture.pixelOf(node.id), q = picture.pixel(sketch.nearestOn(bar, node.x, node.y));
      if (Math.hypot(p.x - q.x, p.y - q.y) < near && !sketch.holds(bar, node.id)) bar.more.push(node.id);
    }
  }
}

/**
 * Pin what came to lie upon each other as nodes were moved, from a drawing `before` as text: a node to the node or bar under
 * it, bars to nodes that they were moved over; nodes on bars went along. `meant`: a node that the one moved is to become as
 * well, though it is farther away. `exact`: only what lies there to round-off, however small it is seen. Returns why two
 * points that look like one cannot be, else nothing.
 */
function joinMoved(ids, before, meant = null, exact = false) {
  const old = new Map(JSON.parse(before).nodes.map((node) => [node.id, node]));
  const all = sketch.data.nodes.filter(({ id, x, y }) => x !== old.get(id).x || y !== old.get(id).y).map(({ id }) => id);
  const stays = new Map(all.map((id) => [id, id])); // the node that each has become
  const [pin, rod] = exact ? [EQUAL_IN_SIX_DIGITS * CELL, EQUAL_IN_SIX_DIGITS * CELL] : [PIN, ROD];
  for (const id of all) {
    const p = picture.pixelOf(id), under = picture.nodeAt(p.x, p.y, pin, id), other = under || (ids.includes(id) ? meant : null);
    const held = other && sketch.barsAt(id).some((bar) => sketch.nodesOf(bar).includes(other.id)); // by a bar that has both
    const both = other && (ids.includes(id) ? ids.includes(other.id) : held);
    if (!other || other.id === id || both) continue;
    const why = sketch.merge(id, other.id);
    if (!why) stays.set(id, other.id);
    else if (under) return `${sketch.node(id).name} stays apart from ${other.name}: ${why}.`;
  }
  const now = new Set([...stays.values()].filter((id) => sketch.node(id)));
  for (const id of now) {
    const p = picture.pixelOf(id);
    for (const { bar } of picture.barsAt(p.x, p.y, rod)) if (!sketch.holds(bar, id)) sketch.pinTo(id, bar);
  }
  pinUnder(sketch.data.bars.filter(({ a, b }) => now.has(a) || now.has(b)), rod);
  if (picture.selected !== null && !sketch.find(picture.selected)) picture.selected = stays.get(picture.selected) ?? null;
  return "";
}

function drop(x, y, near) {
  if (!grabbed.moved) { grabbed = null; refresh(); return; }
  const { nodes, before } = grabbed, alone = nodes.length === 1;
  const why = joinMoved(nodes, before, alone ? picture.nodeAt(x, y, near, nodes[0]) : null);
  if (why) {
    sketch.data = JSON.parse(before);
    $("hint").textContent = why;
  }
  letGo();
  refresh();
  link.changed();
}

$("view").addEventListener("pointerdown", (event) => {
  $("view").setPointerCapture(event.pointerId);
  const [x, y] = local(event), near = nearOf(event);
  pointers.set(event.pointerId, { x, y, x0: x, y0: y });
  several = pointers.size > 1 || event.button !== 0;
  if (several) { letGo(); refresh(); return; }
  if (tool === "select") grabbed = grab(x, y, near);
  else if (["bar", "spring", "slide"].includes(tool) && !pending) pending = { from: aimed(x, y, near), clicked: false };
  refresh();
});

$("view").addEventListener("pointermove", (event) => {
  const [x, y] = local(event), last = pointers.get(event.pointerId), { camera } = picture, near = nearOf(event);
  if (last && pointers.size === 2) {
    const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
    const from = Math.hypot(last.x - other.x, last.y - other.y), to = Math.hypot(x - other.x, y - other.y);
    camera.move((x - last.x) / 2, (y - last.y) / 2);
    if (from > 0 && to > 0) picture.zoom(to / from, (x + other.x) / 2, (y + other.y) / 2);
  } else if (last && grabbed) {
    drag(x, y);
  } else if (last && !pending && (tool === "select" || event.buttons > 1)) {
    camera.move(x - last.x, y - last.y);
    picture.touched = true;
  }
  if (last) pointers.set(event.pointerId, { ...last, x, y });
  if (pending && pointers.size < 2) {
    const to = tool === "slide" ? { at: picture.at(x, y) } : aimed(x, y, near, pending.from.node ? pending.from.node.id : null);
    picture.preview = { from: pending.from.at, to: to.at };
  }
  picture.draw();
});

$("view").addEventListener("pointerup", (event) => {
  const [x, y] = local(event), last = pointers.get(event.pointerId), near = nearOf(event);
  pointers.delete(event.pointerId);
  if (!last || several) return; // a finger of several, or another button, draws nothing when it is lifted
  const moved = Math.hypot(x - last.x0, y - last.y0) > CLICK;
  if (grabbed) { drop(x, y, near); return; }
  if (pending && tool === "slide") {
    const { from } = pending;
    pending = picture.preview = null;
    endSlide(from, x, y, near);
  } else if (pending) {
    if (!moved && !pending.clicked) { pending.clicked = true; return; } // the next click is the end
    const { from } = pending;
    pending = picture.preview = null;
    endLine(from, aimed(x, y, near, from.node ? from.node.id : null));
    picture.draw();
  } else if (!moved) click(x, y, near);
});
$("view").addEventListener("pointercancel", (event) => {
  pointers.delete(event.pointerId);
  letGo();
  refresh();
});
$("view").addEventListener("contextmenu", (event) => event.preventDefault());
$("view").addEventListener("wheel", (event) => {
  event.preventDefault();
  picture.zoom(Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) * ZOOM_OF_PIXEL), ...local(event));
  picture.draw();
}, { passive: false });

// ---- properties of what is selected

/** A number of an element, with its unit; `read` finds it, `write` returns what is wrong with a value, else nothing. */
function field(words, unit, read, write) {
  const box = element("div", "field"), label = element("label", "", words), input = element("input");
  input.id = label.htmlFor = `field-${words.replaceAll(" ", "-")}`;
  Object.assign(input, { type: "number", step: "any" });
  let typing = false; // what is being typed is not written over
  input.addEventListener("change", () => {
    typing = false;
    const x = input.valueAsNumber, wrong = Number.isFinite(x) && Math.abs(x) <= 1e6 ? write(x) : `${words} needs a number of at most 1e6.`;
    input.classList.toggle("bad", Boolean(wrong));
    if (wrong) say(wrong, "refused");
  });
  input.addEventListener("input", () => { typing = true; });
  box.append(label, input, element("span", "unit", unit));
  box.show = () => {
    if (typing) return;
    input.value = Number(read().toPrecision(6));
    input.classList.remove("bad");
  };
  return box;
}
const above = (words, x, make) => (x > 0 ? change(make) : `${words} must be above 0.`);
const least = (words, x, make) => (x >= 0 ? change(make) : `${words} must be at least 0.`);

/** Fields of the element of an id, which undo and redo replace by another object. */
function fieldsOf(id, table) {
  const now = () => sketch.find(id), name = (other) => sketch.find(other).name;
  const put = (key, rule, words = key) => (x) => rule(words, x, () => { now()[key] = x; });
  const mass = () => field("mass", "kg", () => now().mass, put("mass", above));
  if (table === "nodes") {
    return [field("x", "m", () => now().x, (x) => moveNodes([id], ({ y }) => [x, y], "", true)),
      field("y", "m", () => now().y, (y) => moveNodes([id], ({ x }) => [x, y], "", true))];
  }
  if (table === "bars") {
    return [field("length", "m", () => sketch.lengthOf(now()), put("length", above)), mass()];
  }
  if (table === "slides") {
    if (now().along !== null) return [element("p", "quiet", `It slides along ${name(now().along)}.`), mass()];
    const turn = (x) => change(() => { now().angle = (x * Math.PI) / 180; });
    return [field("angle", "°", () => (now().angle * 180) / Math.PI, turn), mass()];
  }
  if (table === "motors") {
    const slides = now().bar === null, words = slides ? "It moves the slide." : `It turns ${name(now().bar)}.`;
    const rate = field("rate", slides ? "m/s" : "rad/s", () => now().rate, (x) => change(() => { now().rate = x; }));
    return [element("p", "quiet", words), rate];
  }
  return [field("stiffness", "N/m", () => now().stiffness, put("stiffness", least)),
    field("damping", "N s/m", () => now().damping, put("damping", least)),
    field("free length", "m", () => sketch.lengthOf(now()), put("length", least, "free length"))];
}

/** What is written about the element selected; fields that are there already stay, and so does the focus in them. */
function showProperties() {
  const one = picture.selected === null ? null : sketch.find(picture.selected), home = $("properties");
  $("remove").disabled = !one;
  const key = JSON.stringify(one && [one.id, one.name, sketch.tableOf(one.id), one.along, one.bar]);
  if (home.dataset.shows !== key) {
    home.dataset.shows = key;
    home.replaceChildren(...(one ? [element("h2", "", one.name), ...fieldsOf(one.id, sketch.tableOf(one.id))]
      : [element("p", "quiet", "Select an element to see its numbers.")]));
  }
  for (const box of home.querySelectorAll(".field")) box.show();
}

$("gravity").addEventListener("change", (event) => {
  const x = event.target.valueAsNumber, right = Math.abs(x) <= 1e6;
  event.target.classList.toggle("bad", !right);
  if (right) change(() => { sketch.data.gravity = x; });
  else say("gravity needs a number of at most 1e6.", "refused");
});
function showGravity() {
  $("gravity").value = sketch.data.gravity;
  $("gravity").classList.remove("bad");
}

// ---- undo, files, running

function step(to) {
  letGo();
  if (!to()) return;
  picture.gaps = [];
  showGravity();
  refresh();
  link.changed();
}
$("undo").addEventListener("click", () => step(() => sketch.undo()));
$("redo").addEventListener("click", () => step(() => sketch.redo()));
$("remove").addEventListener("click", () => { if (picture.selected !== null) change(() => sketch.remove(picture.selected)); });
/** Another drawing in the place of this one. */
function replaced(data) {
  change(() => { sketch.data = structuredClone(data); });
  showGravity();
  picture.resetView();
  picture.draw();
}
$("clear").addEventListener("click", () => replaced(empty));
$("reset").addEventListener("click", () => { picture.resetView(); picture.draw(); });

async function showText(kind) {
  if (link.waiting) await link.ask(); // the drawing has changed since
  if (!answer || !answer[kind]) return;
  saying = { kind, text: answer[kind], file: kind === "toml" ? "drawing.toml" : "drawing.py" };
  $("text-title").textContent = kind === "toml" ? "Model file (TOML)" : "Python script";
  $("text").value = saying.text;
  $("copied").textContent = kind === "toml" ? `m = pt.load("${saying.file}") reads it.` : `python ${saying.file} runs it.`;
  $("texts").showModal();
}
$("toml").addEventListener("click", () => showText("toml"));
$("python").addEventListener("click", () => showText("python"));
$("copy").addEventListener("click", () => {
  $("text").select();
  const done = () => { $("copied").textContent = "It is in the clipboard."; };
  if (navigator.clipboard) navigator.clipboard.writeText(saying.text).then(done, () => document.execCommand("copy") && done());
  else if (document.execCommand("copy")) done();
});
$("save").addEventListener("click", () => {
  const anchor = element("a"), url = URL.createObjectURL(new Blob([saying.text], { type: "text/plain" }));
  Object.assign(anchor, { href: url, download: saying.file });
  anchor.click();
  URL.revokeObjectURL(url);
});
$("close").addEventListener("click", () => $("texts").close());

async function run() {
  $("run").disabled = true;
  const found = await link.run();
  $("run").disabled = !runs();
  if (!found.run) { say(found.message, "refused"); return; }
  document.body.dataset.mode = "run";
  showRun(found.run);
}
function back() {
  document.body.dataset.mode = "draw";
  hideRun();
  resized();
}
$("run").addEventListener("click", run);
$("back").addEventListener("click", back);

// ---- keyboard

const KEYS = { v: "select", b: "bar", i: "pin", g: "ground", s: "slide", m: "motor", f: "spring", x: "delete" };
const toTheme = () => { setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"); picture.draw(); };
document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase(), typing = ["INPUT", "TEXTAREA"].includes(event.target.tagName);
  if ($("texts").open || document.body.dataset.mode === "run") return;
  if ((event.ctrlKey || event.metaKey) && !typing && (key === "z" || key === "y")) {
    (key === "y" || event.shiftKey ? $("redo") : $("undo")).click();
    event.preventDefault();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || typing) return;
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (KEYS[key]) choose(KEYS[key]);
  else if (event.key === "Escape") { letGo(); picture.selected = null; refresh(); }
  else if (event.key === "Delete" || event.key === "Backspace") $("remove").click();
  else if (key === "d") toTheme();
  else if (key === "0") $("reset").click();
  else if (key === "+" || key === "=" || key === "-") {
    picture.zoom(key === "-" ? 1 / 1.2 : 1.2);
    picture.draw();
  } else if (arrow) nudge(arrow);
  else return;
  event.preventDefault();
});
/** The node or bar that is selected moves by half a cell of the grid; else the view moves. */
function nudge([dx, dy]) {
  const one = picture.selected === null ? null : sketch.find(picture.selected), table = one && sketch.tableOf(one.id), by = picture.cell / 2;
  if (table !== "nodes" && table !== "bars") { picture.camera.move(-24 * dx, 24 * dy); picture.touched = true; picture.draw(); return; }
  moveNodes(table === "nodes" ? [one.id] : [one.a, one.b], ({ x, y }) => [x + by * dx, y + by * dy], `nudge ${one.id}`);
}

/** Move nodes to where `to` puts them; all of it stays as it was where that would lay points upon each other that cannot be one. */
function moveNodes(ids, to, word = "", exact = false) {
  let why = "";
  change(() => {
    const before = JSON.stringify(sketch.data);
    for (const id of ids) sketch.move(id, to(sketch.node(id)));
    why = joinMoved(ids, before, null, exact);
    if (why) sketch.data = JSON.parse(before);
  }, word);
  if (why) $("hint").textContent = why;
}

// ---- start

$("theme").addEventListener("click", toTheme);
prefersDark.addEventListener("change", (event) => { setTheme(event.matches ? "dark" : "light"); picture.draw(); });
function resized() {
  const stage = $("view").getBoundingClientRect(), box = $("tools").getBoundingClientRect();
  picture.camera.head = Math.max(52, Math.min(0.4 * stage.height, box.bottom - stage.top + 20));
  picture.resize();
  picture.draw();
}
new ResizeObserver(() => { if (document.body.dataset.mode !== "run") resized(); }).observe($("view"));
document.body.dataset.mode = "draw";
setTheme(prefersDark.matches ? "dark" : "light");
showGravity();
resized();
choose("bar");
refresh();
link.openAddress();
link.ask();
// for tests and for the curious
window.drawing = { sketch, picture, link, choose, run, back, answer: () => answer, pixelOf: (id) => picture.pixelOf(id) };
