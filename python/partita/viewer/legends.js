// What is written on the drawing: names of joints, the world axes, the scales of length and of arrows.

class Legends {
  constructor(scene, painter) {
    this.scene = scene;
    this.painter = painter;
    this.c = painter.c;
    this.c.font = "12px system-ui, sans-serif";
    this.labels = new Labels(this.c, scene.camera.width, scene.camera.height);
    for (const box of scene.covered) this.labels.take(box);
    this.labels.soft.push(...painter.drawnMarks);
    for (const [p, q] of scene.shafts) this.keepClear(this.labels.soft, p, q, 4);
    for (const [p, q, half] of painter.drawnSprings) this.keepClear(this.labels.soft, p, q, half);
    for (const [p, q, half] of painter.drawnRods) this.keepClear(this.labels.softer, p, q, half);
  }

  /** Boxes along a line in the picture, where words should not stand. */
  keepClear(boxes, p, q, half) {
    const count = Math.max(1, Math.min(60, Math.ceil(Math.hypot(q.x - p.x, q.y - p.y) / (2 * half))));
    for (let i = 0; i <= count; i++) {
      boxes.push(boxAround(p.x + ((q.x - p.x) * i) / count, p.y + ((q.y - p.y) * i) / count, half));
    }
  }

  /** Names of joints, those at one point together; a name for which there is no room is left out and counted. */
  names(moving) {
    const { camera, radius, hits, positions } = this.scene, groups = [];
    for (const hit of hits) {
      const p = hit.kind === "spring" ? null : camera.project(hit.point);
      if (!p || p.x < 0 || p.y < 0 || p.x > camera.width || p.y > camera.height) continue;
      const same = groups.find((g) => Math.abs(g.x - p.x) < 10 && Math.abs(g.y - p.y) < 10);
      const away = Math.max(8, Math.min(24, (hit.kind === "prismatic" ? 3 : 2.2) * radius * p.s));
      if (same) {
        same.names.push(hit.label);
        same.away = Math.max(same.away, away);
      } else groups.push({ x: p.x, y: p.y, away, names: [hit.label], hit });
    }
    for (const g of groups) this.labels.take(boxAround(g.x, g.y, Math.min(7, 0.7 * g.away)));
    for (const g of groups) {
      const rest = g.names.length > 3 ? ` and ${g.names.length - 3} more` : "";
      const text = this.labels.fitted(g.names.slice(0, 3).join(", ") + rest, Math.min(230, 0.6 * camera.width));
      const found = this.labels.place(text, g.x, g.y, g.away, positions.get(g.names[0]), moving);
      if (!found) { this.labels.hidden += g.names.length; continue; }
      positions.set(g.names[0], found.position);
      if (found.far) {
        const { box } = found, x = Math.max(box.left, Math.min(box.right, g.x)), y = Math.max(box.top, Math.min(box.bottom, g.y));
        this.painter.line([{ x: g.x, y: g.y }, { x, y }], COLOURS.quiet, 0.8);
      }
      this.labels.write(text, found.x, found.y);
    }
  }

  words(text, x, y, colour) {
    this.labels.write(this.labels.fitted(text, this.scene.camera.width - 2 * x), x, y, colour);
  }

  /** World axes, in the lower left corner. */
  axes() {
    const { painter } = this, { camera } = this.scene, x0 = 44, y0 = camera.height - 44;
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis, i) => ({ axis, name: "xyz"[i], z: dot(axis, camera.back) }))
      .sort((a, b) => a.z - b.z)
      .forEach(({ axis, name }) => {
        const dx = dot(axis, camera.right), dy = -dot(axis, camera.up), l = Math.hypot(dx, dy);
        if (l < 0.08) { painter.circle(x0, y0, 2.5, COLOURS.quiet); return; }
        painter.line([{ x: x0, y: y0 }, { x: x0 + 26 * dx, y: y0 + 26 * dy }], COLOURS.quiet, 1.6);
        if (l > 0.35) this.labels.write(name, x0 + 35 * dx - 3, y0 + 35 * dy + 4);
      });
    this.labels.take({ left: 0, right: 90, top: camera.height - 90, bottom: camera.height });
  }

  /** Round lengths, forces and moments as drawn, in the lower right corner, and what unlike arrows mean. */
  scales() {
    const { camera, arrowSpan, options, forceUnit, momentUnit, impulseUnit, unlike, run } = this.scene, { painter } = this;
    const rows = [[1 / camera.scale, COLOURS.ink, "m"]];
    const span = arrowSpan * options.arrows * camera.scale; // pixels of a large reaction
    if (options.forces && forceUnit > 0) rows.push([forceUnit / span, COLOURS.force, "N"]);
    if (options.moments && momentUnit > 0) rows.push([momentUnit / span, COLOURS.moment, "N m"]);
    if (options.forces && impulseUnit > 0) rows.push([impulseUnit / span, COLOURS.impulse, "N s"]);
    const right = camera.width - 16;
    let y = camera.height - 18;
    for (const [perPixel, colour, name] of rows) {
      const value = roundBelow(Math.min(110, 0.25 * camera.width) * perPixel), px = value / perPixel;
      const text = withUnit(value, name);
      painter.line([{ x: right - px, y }, { x: right, y }], colour, 2, "butt");
      for (const x of [right - px, right]) painter.line([{ x, y: y - 4 }, { x, y: y + 4 }], colour, 1.4, "butt");
      this.labels.write(text, right - px - 8 - this.c.measureText(text).width, y + 4);
      this.labels.take({ left: right - px - 4, right: camera.width, top: y - 8, bottom: y + 8 });
      y -= 20;
    }
    const open = run.scene.joints.some((j) => (options.forces && j.open[0]) || (options.moments && j.open[1]));
    const notes = [];
    if (open) notes.push(["hollow: not unique, shared by least squares", "hollow: not unique"]);
    if (unlike.cut) notes.push(["double stroke: arrow longer than drawn", "double stroke: longer"]);
    for (const [note, less] of notes) {
      const text = this.c.measureText(note).width <= 0.5 * camera.width ? note : less;
      this.labels.write(text, right - this.c.measureText(text).width, y + 4, COLOURS.force);
      y -= 18;
    }
  }
}
