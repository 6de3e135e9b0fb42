// Solids that a person asked for: boxes, cylinders, wheels, balls, plates, rods, drawn in the place of what is guessed.

/** Draw the parts of one body in a frame. */
function drawSolids(scene, painter, frame, body, parts) {
  const { run } = scene, colour = scene.colourOf(body);
  const place = (p) => run.placed(frame, body, p), turn = (v) => run.turned(frame, body, v);
  for (const part of parts) {
    if (part.kind === "rod") painter.rod(place(part.start), place(part.end), scene.radius, colour, 6);
    else if (part.kind === "plate") painter.plate(part.points.map(place), 0.4 * scene.radius, colour);
    else if (part.kind === "ball") painter.ball(place(part.center), part.radius, colour, 0);
    else if (part.kind === "box") {
      const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(turn);
      painter.box(place(part.center), axes, part.size.map((x) => x / 2), colour, -0.5 * Math.min(...part.size));
    } else {
      const axis = turn(part.axis), centre = place(part.center);
      painter.drum(centre, axis, part.radius, part.length / 2, colour);
      if (part.kind === "wheel") spokes(painter, centre, axis, turn(perpendicular(part.axis)), part);
    }
  }
}

/** Hub and spokes on the side of a wheel that is seen, so that its turning shows. */
function spokes(painter, centre, axis, first, part) {
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
  painter.push(back.z, () => {
    for (const end of ends) painter.line([middle, end], COLOURS.edge, width);
    painter.circle(middle.x, middle.y, 1.8 * width, COLOURS.edge);
  });
}
