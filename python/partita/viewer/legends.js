// What is written on the drawing: names of joints, the world axes, the scales of length and of arrows.

class Legends {
  constructor(scene, painter) {
    this.scene = scene;
    this.painter = painter;
    this.c = painter.c;
    this.c.font = "12px system-ui, sans-serif";
  }

  /** Names of joints, those at one place together. */
  names() {
    const { camera, radius, hits } = this.scene, written = [];
    const offset = (s) => Math.max(8, 2.2 * radius * s);
    for (const hit of hits) {
      const p = hit.kind === "spring" ? null : camera.project(hit.point);
      if (!p) continue;
      const x = p.x + offset(p.s), y = p.y - offset(p.s);
      const same = written.find((w) => Math.abs(w.x - x) < 10 && Math.abs(w.y - y) < 10);
      if (same) same.label += `, ${hit.label}`;
      else written.push({ x, y, label: hit.label });
    }
    for (const w of written) this.words(w.label, w.x, w.y);
  }

  words(text, x, y) {
    const { c } = this;
    c.lineJoin = "round";
    c.lineWidth = 3.5;
    c.strokeStyle = "rgba(255,255,255,0.9)";
    c.strokeText(text, x, y);
    c.fillStyle = COLOURS.ink;
    c.fillText(text, x, y);
  }

  /** World axes, in the lower left corner. */
  axes() {
    const { painter } = this, { camera } = this.scene, x0 = 44, y0 = camera.height - 44;
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis, i) => ({ axis, name: "xyz"[i], z: dot(axis, camera.back) }))
      .sort((a, b) => a.z - b.z)
      .forEach(({ axis, name }) => {
        const dx = dot(axis, camera.right), dy = -dot(axis, camera.up);
        if (Math.hypot(dx, dy) < 0.08) { painter.circle(x0, y0, 2.5, "#5d6b78"); return; }
        painter.line([{ x: x0, y: y0 }, { x: x0 + 26 * dx, y: y0 + 26 * dy }], "#5d6b78", 1.6);
        this.words(name, x0 + 35 * dx - 3, y0 + 35 * dy + 4);
      });
  }

  /** Round lengths, forces and moments as drawn, in the lower right corner. */
  scales() {
    const { camera, arrowSpan, options, forceUnit, momentUnit } = this.scene, { painter } = this;
    const rows = [[1 / camera.scale, COLOURS.ink, "m"]];
    const span = arrowSpan * options.arrows * camera.scale; // pixels of a large reaction
    if (options.forces && forceUnit > 0) rows.push([forceUnit / span, COLOURS.force, "N"]);
    if (options.moments && momentUnit > 0) rows.push([momentUnit / span, COLOURS.moment, "N m"]);
    rows.forEach(([perPixel, colour, name], i) => {
      const value = roundBelow(110 * perPixel), px = value / perPixel, y = camera.height - 18 - 20 * i;
      const text = `${Number(value.toPrecision(1))} ${name}`, right = camera.width - 16;
      painter.line([{ x: right - px, y }, { x: right, y }], colour, 2, "butt");
      for (const x of [right - px, right]) painter.line([{ x, y: y - 4 }, { x, y: y + 4 }], colour, 1.4, "butt");
      this.words(text, right - px - 8 - this.c.measureText(text).width, y + 4);
    });
  }
}
