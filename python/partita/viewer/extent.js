// What a run covers, over all its frames: the space to show, and lengths to draw with.

const BAR = 0.1; // a mechanism flatter than this in the picture
const SPECK = 16; // and with a typical body of fewer pixels than this is shown in part:
const SHOWN = 0.3; // as flat as this,
const MOST_TIMES = 20; // at most so many times as large
const FAR = 2; // a mechanism that travels over more than this many times its own extent is followed by the camera

/** Points to keep in the picture: all joints and the corners of bodies, over all time or in the frames given. */
function findExtent(run, frames) {
  const s = run.scene, points = [];
  const step = Math.max(1, Math.ceil((run.frames * (s.joints.length + s.bodies.length)) / 20000));
  for (let f = frames ? frames[0] : 0; f < (frames ? frames[1] : run.frames); f += step) {
    s.joints.forEach((joint, j) => points.push(run.jointPoint(f, j), run.seatOf(f, j)));
    s.bodies.forEach((body, b) => {
      for (const p of body.points) points.push(run.placed(f, b, p));
    });
    for (const joint of s.joints) {
      if (joint.rail) for (const p of joint.rail) points.push(run.placed(f, joint.parent, p));
    }
    for (const { body, parts } of s.solids) {
      for (const part of parts) {
        const corners = cornersOf(part), stride = Math.max(1, Math.ceil(corners.length / 50));
        for (let i = 0; i < corners.length; i += stride) points.push(run.placed(f, body, corners[i]));
      }
    }
    for (const { body, part } of s.parts) for (const p of cornersOf(part)) points.push(run.placed(f, body, p));
    for (const { body, points: ends } of s.floors.concat(s.stops)) for (const p of ends) points.push(run.placed(f, body, p));
    for (const wheel of s.wheels) {
      for (const p of cornersOf({ ...wheel, length: wheel.width, radius: 1.1 * wheel.radius })) points.push(run.placed(f, wheel.body, p));
    }
    for (const { body, points: line } of s.lines) for (let i = 0; i < line.length; i += 6) points.push(run.placed(f, body, line[i]));
    for (const rod of s.rods) points.push(run.placed(f, rod.body1, rod.point1), run.placed(f, rod.body2, rod.point2));
    for (const { body, at } of s.points) points.push(run.placed(f, body, at));
    for (const spring of s.springs) {
      points.push(run.placed(f, spring.body1, spring.point1), run.placed(f, spring.body2, spring.point2));
    }
  }
  return points.filter(isFinite3);
}

/** How many times larger than whole a mechanism is shown at first: once, unless it is so long that its bodies would be specks. */
function partShown(camera, points, typical) {
  if (typical * camera.scale >= SPECK) return 1;
  const seen = points.map((point) => camera.project(point)).filter(Boolean);
  const range = (of) => seen.reduce(([low, high], p) => [Math.min(low, of(p)), Math.max(high, of(p))], [Infinity, -Infinity]);
  const sides = [range((p) => p.x), range((p) => p.y)].map(([low, high]) => high - low);
  const slim = Math.min(...sides) / Math.max(...sides);
  return slim < BAR ? Math.min(SHOWN / slim, MOST_TIMES, (SHOWN * Math.max(...sides)) / (typical * camera.scale)) : 1;
}

/** The middle of all bodies in a frame. */
function middleOf(run, frame) {
  let sum = [0, 0, 0], count = 0;
  run.scene.bodies.forEach((body, b) => {
    const p = run.placed(frame, b, body.com);
    if (isFinite3(p)) { sum = add(sum, p); count++; }
  });
  return count ? scaled(sum, 1 / count) : sum;
}

/** Diagonal of the box around points. */
function spanOf(points) {
  const spread = [0, 1, 2].map((i) => {
    let low = Infinity, high = -Infinity;
    for (const p of points) { low = Math.min(low, p[i]); high = Math.max(high, p[i]); }
    return high - low;
  });
  return points.length ? length(spread) : 0;
}

/** The extent in a frame about the middle that moves. */
function aboutMiddle(run, frame) {
  const middle = middleOf(run, frame);
  return findExtent(run, [frame, frame + 1]).map((p) => sub(p, middle));
}

/** The extent about the middle that moves, from that in some frames, where a mechanism travels far; null where it stays. */
function travelling(run, extent, shapes) {
  if (run.scene.joints.some((j) => j.kind !== "free" && (j.parent < 0 || j.child < 0))) return null;
  const spans = shapes.map(spanOf).sort((a, b) => a - b), usual = spans[spans.length >> 1];
  return spans.length > 1 && usual > 0 && spanOf(extent) > FAR * usual ? shapes.flat() : null;
}

/** Frames spread over a run, at most so many. */
function spreadFrames(run, most) {
  const count = Math.min(run.frames, most);
  return Array.from({ length: count }, (_, i) => Math.round((i * (run.frames - 1)) / Math.max(1, count - 1)));
}

/** Points of a solid in body axes that hold it in the picture. */
function cornersOf(part) {
  if (part.kind === "plate") return part.points;
  if (part.kind === "mesh") {
    if (!part.corners) part.corners = Array.from({ length: part.points.length / 3 }, (_, i) => part.points.slice(3 * i, 3 * i + 3));
    return part.corners;
  }
  if (part.kind === "rod") return [part.start, part.end];
  if (part.axis) { // round: the rims of both faces
    const u = perpendicular(part.axis), v = cross(part.axis, u), half = scaled(part.axis, (part.length || 0) / 2), rim = [];
    for (let i = 0; i < 8; i++) {
      const out = add(scaled(u, part.radius * Math.cos((i * Math.PI) / 4)), scaled(v, part.radius * Math.sin((i * Math.PI) / 4)));
      rim.push(add(part.center, add(out, half)), add(part.center, sub(out, half)));
    }
    return rim;
  }
  const r = part.kind === "box" ? length(part.size) / 2 : part.radius;
  return [[r, 0, 0], [-r, 0, 0], [0, r, 0], [0, -r, 0], [0, 0, r], [0, 0, -r]].map((v) => add(part.center, v));
}

/** Lengths [m] that suit the mechanism: `size` of it all, `typical` of a body, `radius` of rods, `arrow` for a large reaction. */
function findSizes(run, extent) {
  const s = run.scene, size = spanOf(extent) || s.size;
  const lengths = s.bodies.filter((b) => b.points.length > 1)
    .map((b) => Math.max(...b.points.map((p) => length(sub(p, b.points[0]))))).sort((a, b) => a - b);
  const typical = lengths.length ? lengths[lengths.length >> 1] : size;
  // Slender against the whole and against a typical body: a long chain has thin rods and short arrows.
  return { size, typical, radius: Math.min(0.013 * size, 0.07 * typical), arrow: Math.min(0.2 * size, 1.5 * typical) };
}
