// What a run covers, over all its frames: the space to show, lengths to draw with, paths of points.

/** Points to keep in the picture: all joints and the corners of bodies, over all time. */
function findExtent(run) {
  const s = run.scene, points = [];
  const step = Math.max(1, Math.ceil((run.frames * (s.joints.length + s.bodies.length)) / 20000));
  for (let f = 0; f < run.frames; f += step) {
    s.joints.forEach((joint, j) => points.push(run.jointPoint(f, j)));
    s.bodies.forEach((body, b) => {
      for (const p of body.points) points.push(run.placed(f, b, p));
    });
    for (const joint of s.joints) {
      if (joint.rail) for (const p of joint.rail) points.push(run.placed(f, joint.parent, p));
    }
    for (const { body, parts } of s.solids) {
      for (const part of parts) for (const p of cornersOf(part)) points.push(run.placed(f, body, p));
    }
    for (const { body, at } of s.points) points.push(run.placed(f, body, at));
    for (const spring of s.springs) {
      points.push(run.placed(f, spring.body1, spring.point1), run.placed(f, spring.body2, spring.point2));
    }
  }
  return points.filter(isFinite3);
}

/** Points of a solid in body axes that hold it in the picture. */
function cornersOf(part) {
  if (part.kind === "plate") return part.points;
  if (part.kind === "rod") return [part.start, part.end];
  const r = part.kind === "box" ? length(part.size) / 2 : Math.hypot(part.radius, (part.length || 0) / 2);
  return [[r, 0, 0], [-r, 0, 0], [0, r, 0], [0, -r, 0], [0, 0, r], [0, 0, -r]].map((v) => add(part.center, v));
}

/** Lengths [m] that suit the mechanism: `size` of it all, `radius` of rods, `arrow` for a large reaction. */
function findSizes(run, extent) {
  const s = run.scene;
  const low = [0, 1, 2].map((i) => extent.reduce((m, p) => Math.min(m, p[i]), Infinity));
  const high = [0, 1, 2].map((i) => extent.reduce((m, p) => Math.max(m, p[i]), -Infinity));
  const size = extent.length ? length(sub(high, low)) || s.size : s.size;
  const lengths = s.bodies.filter((b) => b.points.length > 1)
    .map((b) => Math.max(...b.points.map((p) => length(sub(p, b.points[0]))))).sort((a, b) => a - b);
  const typical = lengths.length ? lengths[lengths.length >> 1] : size;
  // Slender against the whole and against a typical body: a long chain has thin rods and short arrows.
  return { size, radius: Math.min(0.013 * size, 0.07 * typical), arrow: Math.min(0.2 * size, 1.5 * typical) };
}

/** Paths of moving joints and of free ends of bodies, thinned for drawing. */
function findPaths(run) {
  const s = run.scene, sources = [];
  s.joints.forEach((joint, j) => sources.push((f) => run.jointPoint(f, j)));
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
      paths.push(path);
    }
  }
  return paths;
}
