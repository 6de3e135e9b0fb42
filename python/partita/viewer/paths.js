// Paths of points over a run, as strokes: smooth through the outputs, dots where these lie too far apart for a line.

// Paths that move by less are not drawn, and bends of less are straight. Scale: fraction of the size. Reason: two pixels of a thousand.
const STROKE = 2e-3;

const FARTHEST = Math.cos(Math.PI / 4); // where a path turns farther than this at both ends of a step, no line is drawn
const FINEST = 0.12; // a stroke turns by less than this angle [rad] from point to point
const CELLS = 50; // resolution of a path: this many cells over the whole extent
const RETRACED = 250; // a path is retraced where it stays within this fraction of the size of what it drew before
const CLOSING = 0.02; // of a stroke, kept beyond its last new point: so a closed curve is closed
const TANGLE = 9; // a path that goes through so many more cells than its extent counts is a tangle

/** Paths of moving joints and of free ends of bodies, thinned for drawing. */
function findPaths(run) {
  const s = run.scene, sources = [];
  s.joints.forEach((joint, j) => sources.push((f) => run.seatOf(f, j)));
  s.bodies.forEach((body, b) => {
    const held = s.joints.map((j) => (j.child === b ? j.at : j.parent === b ? j.atParent : null)).filter(Boolean);
    if (body.points.length > 2) return;
    for (const p of body.points) {
      if (held.every((h) => length(sub(h, p)) > VISIBLE * s.size)) sources.push((f) => run.placed(f, b, p));
    }
  });
  for (const { body, at } of s.points) sources.push((f) => run.placed(f, body, at));
  const most = Math.max(200, Math.min(1500, 60000 / Math.max(1, sources.length))); // per path: smooth, yet quick to draw
  const instants = instantsOf(run, Math.max(1, Math.ceil(run.frames / most)), 8 * most), paths = [], seen = new Set();
  const times = instants.map((f) => run.timeOf(f));
  for (const source of sources) {
    const path = instants.map(source);
    const moves = path.some((p) => length(sub(p, path[0])) > STROKE * s.size);
    const key = path.filter((_, i) => i % 7 === 0).flat().map((x) => Math.round((1e4 * x) / s.size)).join();
    if (moves && !seen.has(key)) {
      seen.add(key);
      const strokes = strokesOf(path, times, STROKE * s.size), tangled = isTangled(strokes, s.size);
      paths.push({ strokes: tangled ? strokes : drawnOnce(strokes, s.size), tangled });
    }
  }
  return paths;
}

/** Frames at which paths are read: outputs, and so many between two that no body turns by more than `FINEST` to the next. */
function instantsOf(run, step, most) {
  const found = [];
  for (let f = 0; f < run.frames; f += step) {
    found.push(f);
    const vectors = step === 1 && found.length < most && f + 1 < run.frames && !run.scene.apart && run.between.vectors(f);
    const pieces = vectors ? Math.min(12, Math.ceil(Math.max(0, ...vectors.map(length)) / FINEST)) : 1;
    for (let k = 1; k < pieces; k++) found.push(f + k / pieces);
  }
  return found;
}

/** Strokes of a path through `points` at `times`: points {p, t} in order, a single point where no line continues. */
function strokesOf(points, times, least) {
  const n = points.length, turns = new Array(n).fill(0), rates = new Array(n).fill([0, 0, 0]), whole = points.map(isFinite3);
  for (let i = 1; i + 1 < n; i++) {
    if (!whole[i - 1] || !whole[i] || !whole[i + 1]) continue;
    const a = sub(points[i], points[i - 1]), b = sub(points[i + 1], points[i]), la = length(a), lb = length(b);
    if (la > least && lb > least) turns[i] = Math.acos(Math.max(-1, Math.min(1, dot(a, b) / (la * lb))));
    rates[i] = scaled(sub(points[i + 1], points[i - 1]), 1 / (times[i + 1] - times[i - 1] || 1));
  }
  const strokes = [];
  let stroke = [];
  const flush = () => { if (stroke.length) strokes.push(stroke); stroke = []; };
  for (let i = 0; i < n; i++) {
    if (!whole[i]) { flush(); continue; }
    stroke.push({ p: points[i], t: times[i] });
    if (i + 1 === n || !whole[i + 1]) continue;
    const first = i > 0 && whole[i - 1], last = i + 2 < n && whole[i + 2], turn = Math.max(turns[i], turns[i + 1]);
    if (!first && !last) { flush(); continue; } // of two outputs alone nothing between is known
    if (Math.cos(first && last ? Math.min(turns[i], turns[i + 1]) : turn) < FARTHEST) { flush(); continue; }
    if (!first || !last) continue;
    const h = times[i + 1] - times[i], pieces = Math.min(12, Math.ceil(turn / FINEST));
    for (let k = 1; k < pieces; k++) { // Hermite: through both outputs, with rates estimated from their neighbours
      const s = k / pieces, r = 1 - s;
      const ends = add(scaled(points[i], r * r * (1 + 2 * s)), scaled(points[i + 1], s * s * (3 - 2 * s)));
      const offset = sub(scaled(rates[i], r * r * s * h), scaled(rates[i + 1], s * s * r * h));
      stroke.push({ p: add(ends, offset), t: times[i] + s * h });
    }
  }
  flush();
  return strokes;
}

/** Does a path go everywhere, so that all of it at once says nothing? */
function isTangled(strokes, size) {
  const cells = new Set(), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const stroke of strokes) for (const { p } of stroke) {
    cells.add(p.map((x) => Math.floor((CELLS * x) / size)).join());
    p.forEach((x, k) => { low[k] = Math.min(low[k], x); high[k] = Math.max(high[k], x); });
  }
  const own = (CELLS * length(sub(high, low))) / size;
  return own > 5 && cells.size > TANGLE * own;
}

/** Strokes up to the last point that adds to the picture: a path that goes round a hundred times is painted once. */
function drawnOnce(strokes, size) {
  const cell = size / RETRACED, reached = new Map(); // cell -> length of the path where it was first entered
  let travelled = 0, last = null, end = [0, 0];
  strokes.forEach((stroke, n) => stroke.forEach(({ p }, i) => {
    if (last) travelled += length(sub(p, last));
    last = p;
    const [x, y, z] = p.map((c) => Math.floor(c / cell));
    let seen = false;
    for (let k = 0; k < 27 && !seen; k++) {
      const first = reached.get(`${x + (k % 3) - 1},${y + (Math.floor(k / 3) % 3) - 1},${z + Math.floor(k / 9) - 1}`);
      seen = first !== undefined && travelled - first > 12 * cell;
    }
    if (!seen) end = [n, i];
    const key = `${x},${y},${z}`;
    if (!reached.has(key)) reached.set(key, travelled);
  }));
  const [n, i] = end, kept = strokes.slice(0, n + 1);
  kept[n] = strokes[n].slice(0, i + 1 + Math.ceil(CLOSING * strokes[n].length));
  return kept;
}
