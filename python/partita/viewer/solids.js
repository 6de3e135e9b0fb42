// Solids: boxes, cylinders, wheels, balls, plates, rods, meshes.

/** Draw the parts of one body. */
function drawSolids(scene, painter, frame, body, parts) {
  const { run } = scene, colour = scene.colourOf(body);
  const place = (p) => run.placed(frame, body, p), turn = (v) => run.turned(frame, body, v);
  for (const part of parts) {
    if (part.kind === "rod") painter.rod(place(part.start), place(part.end), scene.radius, colour, 6);
    else if (part.kind === "mesh") painter.mesh(cornersOf(part).map(place), part, colour);
    else if (part.kind === "plate") painter.plate(part.points.map(place), 0.4 * scene.radius, colour);
    else if (part.kind === "ball") {
      painter.ball(place(part.center), part.radius, colour, 0);
      meridians(painter, place(part.center), [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(turn), part.radius);
    } else if (part.kind === "box") {
      const axes = (part.axes || [[1, 0, 0], [0, 1, 0], [0, 0, 1]]).map(turn);
      painter.box(place(part.center), axes, part.size.map((x) => x / 2), colour, -0.5 * Math.min(...part.size));
    } else {
      const axis = turn(part.axis), centre = place(part.center);
      const first = turn(perpendicular(part.axis));
      painter.drum(centre, axis, part.radius, part.length / 2, colour, -0.1 * scene.radius);
      if (part.kind === "wheel") spokes(painter, centre, axis, first, part);
      else diameter(painter, centre, axis, first, part);
    }
  }
}

/** Hub and spokes on the side of a wheel that is seen, so that its turning shows. */
function spokes(painter, centre, axis, first, part, lift = 0) {
  const camera = painter.camera, facing = dot(axis, camera.toEye(centre)) < 0 ? scaled(axis, -1) : axis;
  const side = add(centre, scaled(facing, part.length / 2)), second = cross(axis, first);
  const middle = camera.project(side), back = camera.project(centre);
  if (!middle || !back) return;
  const ends = [0, 1, 2, 3, 4].map((i) => {
    const angle = (2 * Math.PI * i) / 5, r = 0.86 * part.radius;
    return camera.project(add(side, add(scaled(first, r * Math.cos(angle)), scaled(second, r * Math.sin(angle)))));
  });
  if (ends.includes(null) || dot(facing, camera.toEye(centre)) < 0.05) return;
  const width = Math.max(1.2, 0.05 * part.radius * middle.s);
  painter.push(back.z + lift, () => {
    for (const end of ends) painter.line([middle, end], COLOURS.edge, width);
    painter.circle(middle.x, middle.y, 1.8 * width, COLOURS.edge);
  });
}

/** Two great circles of a ball, the half that is seen, so that its turning shows. */
function meridians(painter, centre, axes, radius) {
  const { camera } = painter, eye = camera.toEye(centre), middle = camera.project(centre);
  if (!middle || radius * middle.s < 6) return;
  for (const [u, v] of [[axes[0], axes[1]], [axes[1], axes[2]]]) {
    const pieces = [];
    let piece = [];
    for (let i = 0; i <= 64; i++) {
      const angle = (i * Math.PI) / 32, out = add(scaled(u, Math.cos(angle)), scaled(v, Math.sin(angle)));
      const p = dot(out, eye) > 0 ? camera.project(add(centre, scaled(out, radius))) : null;
      if (p) piece.push(p);
      if ((!p || i === 64) && piece.length > 1) pieces.push(piece);
      if (!p) piece = [];
    }
    painter.push(middle.z, () => pieces.forEach((points) => painter.line(points, COLOURS.edge, 1.1)));
  }
}

/** A line across the face of a drum that is seen. */
function diameter(painter, centre, axis, first, part) {
  const { camera } = painter, facing = dot(axis, camera.toEye(centre)) < 0 ? scaled(axis, -1) : axis;
  const side = add(centre, scaled(facing, part.length / 2)), middle = camera.project(centre);
  const ends = [0.85, 0.25].map((r) => camera.project(add(side, scaled(first, r * part.radius))));
  if (!middle || ends.includes(null) || dot(facing, camera.toEye(centre)) < 0.05) return;
  painter.push(middle.z, () => painter.line(ends, COLOURS.edge, 1.6));
}

/** Wheels of gears and belts, what runs over them, racks and cams, rods without mass, and links that have no picture. */
function drawCouplings(scene, painter, frame) {
  const { run } = scene, s = run.scene, back = -6 * scene.radius; // behind the links of their plane
  for (const wheel of s.wheels) {
    const centre = run.placed(frame, wheel.body, wheel.center), axis = run.turned(frame, wheel.body, wheel.axis);
    const first = run.turned(frame, wheel.body, wheel.first);
    painter.gear(centre, axis, first, wheel, wheel.ring ? COLOURS.ground : scene.colourOf(wheel.body), back);
    if (!wheel.teeth) spokes(painter, centre, axis, first, { radius: wheel.radius, length: wheel.width }, back);
  }
  for (const { body, points, closed, look } of s.lines) {
    const line = points.map((p) => scene.camera.project(run.placed(frame, body, p)));
    if (line.includes(null)) continue;
    const z = line.reduce((sum, p) => sum + p.z, 0) / line.length;
    if (closed) line.push(line[0]);
    if (look === "belt") line.slice(1).forEach((p, i) => painter.drawnRods.push([line[i], p, 4])); // no words on it
    painter.push(z + back, () => {
      if (look === "cam") painter.polygon(line, closed ? scene.colourOf(body) : null, COLOURS.edge, 1.2);
      else painter.line(line, look === "belt" ? COLOURS.spring : shade(scene.colourOf(body), -0.3), look === "belt" ? 3.2 : 2);
    });
  }
  for (const rod of s.rods) {
    const a = run.placed(frame, rod.body1, rod.point1), b = run.placed(frame, rod.body2, rod.point2);
    scene.rods(painter, a, b, rod.rods);
    if (rod.body1 !== rod.body2) for (const end of [a, b]) painter.ball(end, 0.9 * scene.radius, COLOURS.joint, scene.radius);
  }
  for (const [a, b] of s.links) {
    const p = scene.camera.project(run.jointPoint(frame, a)), q = scene.camera.project(run.jointPoint(frame, b));
    if (!p || !q) continue;
    painter.push(-Infinity, () => {
      painter.c.setLineDash([2, 5]);
      painter.line([p, q], COLOURS.quiet, 1.3);
      painter.c.setLineDash([]);
    });
  }
}
