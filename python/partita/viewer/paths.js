// Paths of points over a run, as strokes: smooth through the outputs, dots where these lie too far apart for a line.

const FARTHEST = Math.cos(Math.PI / 4); // where a path turns farther than this at both ends of a step, no line is drawn
const FINEST = 0.12; // a stroke turns by less than this angle [rad] from point to point
const CELLS = 50; // resolution of a path: this many cells over the whole extent
const TANGLE = 9; // a path that goes through so many more cells than its extent counts is a tangle

/** Paths of moving joints and of free ends of bodies, thinned for drawing. */
function findPaths(run) {
  const s = run.scene, sources = [];
  s.joints.forEach((joint, j) => sources.push((f) => run.seatOf(f, j)));
  s.bodies.forEach((body, b) => {
    const held = s.joints.map((j) => (j.child === b ? j.at : j.parent === b ? j.atParent : null)).filter(Boolean);
    if (body.points.length > 2) return;
    for (const p of body.points) {
      if (held.every((h) => length(sub(h, p)) > 1e-3 * s.size)) sources.push((f) => run.placed(f, b, p));
    }
  });
  for (const { body, at } of s.points) sources.push((f) => run.placed(f, body, at));
  const most = Math.max(200, Math.min(1500, 60000 / Math.max(1, sources.length))); // per path: smooth, yet quick to draw
  const step = Math.max(1, Math.ceil(run.frames / most)), paths = [], seen = new Set();
  for (const source of sources) {
    const path = [];
    for (let f = 0; f < run.frames; f += step) path.push(source(f));
    const moves = path.some((p) => length(sub(p, path[0])) > 2e-3 * s.size);
    const key = path.filter((_, i) => i % 7 === 0).flat().map((x) => Math.round((1e4 * x) / s.size)).join();
    if (moves && !seen.has(key)) {
      seen.add(key);
      const strokes = strokesOf(path, path.map((_, i) => run.t[i * step]), 2e-3 * s.size);
      paths.push({ strokes, tangled: isTangled(strokes, s.size) });
    }
  }
  return paths;
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
