// What a mechanism meets and what moves it: floors, balls and wheels of contacts, stops, drives, torsion springs.

/** Floors behind all else; balls and wheels that touch them; marks of stops. */
function drawAround(scene, painter, frame) {
  const { run } = scene, s = run.scene;
  for (const { body, points, normal } of s.floors) {
    drawFloor(painter, points.map((p) => run.placed(frame, body, p)), run.turned(frame, body, normal), body < 0 ? 3.4 * scene.radius : 0);
  }
  for (const { body, part } of s.parts) drawSolids(scene, painter, frame, body, [part]);
  for (const { body, points } of s.stops) {
    const [p, q] = points.map((point) => painter.camera.project(run.placed(frame, body, point)));
    if (!p || !q) continue;
    painter.push((p.z + q.z) / 2 + scene.radius, () => {
      painter.line([p, q], COLOURS.ground, Math.max(2.5, 0.7 * scene.radius * p.s));
    });
  }
}

/** A plane that is touched: seen from the side a line, hatched where it is the ground (`size` above 0), else a sheet with a rim. */
function drawFloor(painter, corners, normal, size) {
  const ring = corners.map((corner) => painter.camera.project(corner));
  if (ring.includes(null)) return;
  if (Math.abs(dot(normal, painter.camera.back)) > 0.08) {
    painter.push(-Infinity, () => {
      painter.c.globalAlpha = 0.45;
      painter.polygon(ring, COLOURS.foot, null);
      painter.c.globalAlpha = 1;
      painter.polygon(ring, null, COLOURS.ground, 1.2);
    });
    return;
  }
  // From the side a rectangle is a line: between its corners that are farthest apart.
  let ends = [ring[0], ring[1]];
  for (const p of ring) for (const q of ring) {
    if (Math.hypot(p.x - q.x, p.y - q.y) > Math.hypot(ends[0].x - ends[1].x, ends[0].y - ends[1].y)) ends = [p, q];
  }
  // Strokes of the hatching lie to the right of its direction, which is the side away from the normal.
  const down = { x: -dot(normal, painter.camera.right), y: dot(normal, painter.camera.up) };
  const [p, q] = ends, side = (q.x - p.x) * down.y - (q.y - p.y) * down.x;
  painter.push(-Infinity, () => (size > 0 ? painter.ground(side > 0 ? p : q, side > 0 ? q : p, size * p.s) : painter.line([p, q], COLOURS.ground, 1.6)));
}

/** Marks at a joint: an arrow around a hinge or along a slide that is driven, a spiral for a torsion spring. */
function drawMarks(scene, painter, j, point, axis) {
  const { motors, coils } = scene.run.scene, p = painter.camera.project(point), r = scene.radius;
  if (!p || !axis) return;
  const kind = scene.run.scene.joints[j].kind, lift = p.z + 5 * r;
  if (motors.includes(j)) {
    const out = scaled(axis, 7 * r), ends = [sub(point, out), add(point, out)].map((end) => painter.camera.project(end));
    const along = kind === "prismatic";
    painter.push(lift, () => (along ? painter.doubleArrow(...ends, COLOURS.load) : painter.turnArrow(p, 4.2 * r * p.s, COLOURS.load)));
  }
  if (coils.includes(j) && kind !== "prismatic") painter.push(lift, () => painter.spiral(p, 3.6 * r * p.s, COLOURS.spring));
}
