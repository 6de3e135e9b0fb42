// An over-constrained linkage with one hinge that is tilted: the core says whether it moves, and why.

const $ = (id) => document.getElementById(id);
const FRAMES = 60, SECONDS = 6.3, RATE = 2; // of the crank [rad/s]: two turns
const LEAST = -3, MOST = 1, STEPS = 40; // the slider: from 1e-3 degrees to 10 degrees, its first place 0
const TOLERANCES = { rtol: 1e-8, atol: 1e-10 };
const DRAWING_TOLERANCE = 1e-4; // rad, and fractions of lengths
const RADIUS = 0.022; // of rods, over the size of the linkage
const DENSITY = 1; // kg a metre
const SLENDERNESS = 1e-4; // inertia about the axis of a rod, over that across it

const core = await loadCore($("module").textContent).catch((error) => ({ ask: () => ({ error: { kind: "refused", message: error.message } }) }));
const towards = (p, q) => unit(sub(q, p));

const TILTED = 3; // the last hinge, on the ground
const { linkages } = JSON.parse($("data").textContent); // points and axes of four hinges in a ring, as in the catalogue
const NAMES = ["A", "B", "C", "D"], BODIES = ["ground", "crank", "coupler", "rocker"];
const REMEDY = { B: "spherical", C: "cylindrical" };

let linkage = null, motion = null, time = 0, last = null;

/** The description: bodies have the axes of the world as drawn, so that a pose moves every drawn point. */
function description(tilt, remedy, driven) {
  const { points } = linkage;
  const bodies = [1, 2, 3].map((i) => {
    const [p, q] = [points[i - 1], points[i]], u = towards(p, q), l = length(sub(q, p)), mass = DENSITY * l, across = (mass * l * l) / 12;
    const inertia = [0, 1, 2].map((r) => [0, 1, 2].map((c) => across * ((r === c ? 1 : 0) - (1 - SLENDERNESS) * u[r] * u[c])));
    return { name: BODIES[i], mass, com: scaled(add(p, q), 0.5), inertia, position: [0, 0, 0], orientation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], shape: { kind: "auto" } };
  });
  const joints = NAMES.map((name, i) => ({ name, kind: (remedy && REMEDY[name]) || "revolute", parent: BODIES[i], child: BODIES[(i + 1) % 4],
    point: points[i], axis: axisOf(i, tilt), cut: "auto" })).map((joint) => {
    if (joint.kind !== "spherical") return joint;
    const { axis, ...rest } = joint;
    return rest;
  });
  const drives = driven ? [{ name: "motor", measure: { of: "joint", joint: "A", coordinate: 0 }, motion: { constant: RATE }, level: "velocity" }] : [];
  return { partita: 1, name: "linkage", gravity: [0, -9.81, 0], drawing_tolerance: DRAWING_TOLERANCE, bodies, joints, couplings: [], drives, forces: [] };
}

/** The axis of a hinge as drawn; that of the one that is tilted about the link of the ground. */
function axisOf(i, tilt) {
  const axis = linkage.axes[i], about = towards(linkage.points[3], linkage.points[0]);
  return i === TILTED ? unit(add(scaled(axis, Math.cos(tilt)), scaled(cross(about, axis), Math.sin(tilt)))) : axis;
}

/** Degrees of a place of the slider. */
const degrees = (place) => (place === 0 ? 0 : 10 ** (LEAST + ((MOST - LEAST) * (place - 1)) / (STEPS - 1)));
const shownDegrees = (x) => `${Number(x.toPrecision(2))}°`;

function change() {
  const angle = degrees(Number($("tilt").value)), tilt = (angle * Math.PI) / 180, remedy = $("remedy").checked;
  $("angle").textContent = shownDegrees(angle);
  const found = core.ask({ examine: { mechanism: description(tilt, remedy, false) } });
  if (found.error) { say(false, found.error.message, "", ""); return; }
  const { report } = found, moves = report.mobility > 0;
  const untilted = core.ask({ examine: { mechanism: description(0, remedy, false) } }).report;
  const counts = `Constraints of the joints: ${report.joint_rows}, of which ${report.joint_rank} are independent` +
    `${untilted && untilted.joint_rank !== report.joint_rank ? `; without the tilt ${untilted.joint_rank}` : ""}.`;
  say(moves, moves ? `Moves: ${report.mobility} degree${report.mobility === 1 ? "" : "s"} of freedom` : "Locked: 0 degrees of freedom", reason(report, untilted, angle), counts);
  motion = moves ? core.ask({ run: { mechanism: description(tilt, remedy, true), duration: SECONDS, outputs: Math.round(FRAMES * SECONDS) + 1, ...TOLERANCES } }) : null;
  if (motion && (motion.error || motion.t.length < 2)) motion = null;
  if (!moves) time = 0;
  linkage.shown = { tilt, remedy, poses: found.bodies };
}

/** The sentences of the core that matter here. */
function reason(report, untilted, angle) {
  const notes = report.notes.filter((words) => words.includes("geometry") || words.includes("geometric error"));
  if (notes.length) return sentences(notes);
  if (report.mobility > 0) return report.redundancy || "Nothing is redundant: each constraint of the joints is needed, so a small tilt cannot lock it.";
  return `With a hinge tilted by ${shownDegrees(angle)} the linkage is no longer a drawing with an error: it is computed as drawn. One constraint that was` +
    ` redundant without the tilt is independent now, and it takes the last degree of freedom. Without the tilt: ${grounds(untilted.redundant)}.`;
}
/** Redundant constraints with their reasons, each said once. */
function grounds(redundant) {
  const whys = [...new Set(redundant.map(({ why }) => why))];
  return whys.map((why) => `${redundant.filter((one) => one.why === why).map(({ row }) => row).join(", ")}: ${why}`).join("; ");
}
const sentences = (list) => list.map((words) => `${words[0].toUpperCase()}${words.slice(1)}.`).join(" ");

function say(moves, verdict, why, counts) {
  $("verdict").textContent = verdict;
  $("verdict").dataset.moves = moves ? "yes" : "no";
  $("why").textContent = why;
  $("counts").textContent = counts;
}

// ---- the picture

const view = { right: [1, 0, 0], up: [0, 1, 0], back: [0, 0, 1], azimuth: -0.5, elevation: 0.35 };
const camera = new Camera(view, false), context = $("view").getContext("2d");
let ratio = 1;

function resized() {
  camera.head = 30;
  ratio = camera.fillBox($("view"));
  camera.fit(linkage.extent, 0.05);
}

function placed(poses, body, p, turnOnly = false) {
  if (body === 0) return p;
  const x = poses.slice(12 * (body - 1), 12 * body);
  return [0, 1, 2].map((i) => (turnOnly ? 0 : x[i]) + x[3 + 3 * i] * p[0] + x[4 + 3 * i] * p[1] + x[5 + 3 * i] * p[2]);
}

function draw() {
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, camera.width, camera.height);
  if (!linkage.shown) return;
  const painter = new Painter(context, camera, 1), { points, shown, size } = linkage, r = RADIUS * size;
  const i = motion ? Math.min(motion.t.length - 1, Math.floor(time * FRAMES)) : 0, poses = motion ? motion.bodies[i] : shown.poses;
  for (const body of [1, 2, 3]) painter.rod(placed(poses, body, points[body - 1]), placed(poses, body, points[body]), r, COLOURS.bodies[body - 1], 6);
  painter.rod(points[3], points[0], 0.6 * r, COLOURS.ground, 6);
  NAMES.forEach((name, j) => {
    const kind = (shown.remedy && REMEDY[name]) || "revolute", body = j === 0 ? 0 : j, at = placed(poses, body, points[j]);
    const axis = placed(poses, body, axisOf(j, shown.tilt), true), tilted = j === TILTED;
    if (kind === "spherical") painter.ball(at, 2.4 * r, COLOURS.load, 2 * r);
    else painter.pin(at, axis, 1.7 * r, (kind === "cylindrical" ? 4 : 2.4) * r, kind === "cylindrical" ? COLOURS.load : tilted ? COLOURS.free : COLOURS.joint, 2 * r, j === 0 || j === 3);
    if (tilted || kind === "cylindrical") {
      const [p, q] = [-1, 1].map((s) => camera.project(add(at, scaled(axis, s * 0.22 * size))));
      painter.push(Infinity, () => { context.setLineDash([6, 4]); painter.line([p, q], tilted ? COLOURS.free : COLOURS.load, 2); context.setLineDash([]); });
    }
    const p = camera.project(at);
    painter.push(Infinity, () => {
      context.font = "600 14px system-ui, sans-serif";
      for (const [style, width] of [[COLOURS.halo, 4], [null, 0]]) {
        if (style) { context.strokeStyle = style; context.lineWidth = width; context.strokeText(name, p.x + 16, p.y - 14); } else { context.fillStyle = COLOURS.ink; context.fillText(name, p.x + 16, p.y - 14); }
      }
    });
  });
  painter.paint();
}

function tick(now) {
  if (motion) {
    if (last !== null) time += (now - last) / 1000;
    if (time > motion.t[motion.t.length - 1]) time = 0;
  }
  last = now;
  draw();
  requestAnimationFrame(tick);
}

/** All that the linkage reaches, from a turn without a tilt. */
function choose(name) {
  linkage = { ...linkages[name] };
  linkage.size = Math.max(...linkage.points.flatMap((p) => linkage.points.map((q) => length(sub(p, q)))));
  linkage.extent = linkage.points;
  const turn = core.ask({ run: { mechanism: description(0, false, true), duration: SECONDS, outputs: 64, ...TOLERANCES } });
  if (!turn.error) linkage.extent = turn.bodies.flatMap((poses) => linkage.points.map((p, i) => placed(poses, i, p)));
  $("which").textContent = NAMES[TILTED];
  $("remedy-words").textContent = "Remedy: a ball joint at B and a cylindrical joint, which also slides, at C";
  resized();
  change();
}

for (const name of Object.keys(linkages)) $("linkage").append(element("option", "", name));
$("linkage").addEventListener("change", () => { time = 0; choose($("linkage").value); });
$("tilt").addEventListener("input", change);
$("remedy").addEventListener("change", change);
$("view").addEventListener("pointermove", (event) => {
  if (event.buttons) camera.turnTo(camera.azimuth - 0.008 * event.movementX, camera.elevation + 0.008 * event.movementY);
});
$("view").style.touchAction = "pan-y";
const toTheme = () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
$("theme").addEventListener("click", toTheme);
prefersDark.addEventListener("change", (event) => setTheme(event.matches ? "dark" : "light"));
setTheme(prefersDark.matches ? "dark" : "light");
choose(Object.keys(linkages)[0]);
new ResizeObserver(resized).observe($("view"));
requestAnimationFrame(tick);
window.tilting = { change, state: () => ({ moves: $("verdict").dataset.moves, why: $("why").textContent, running: Boolean(motion) }) };
