// Shapes on a 2-D canvas. Each puts primitives {z, draw} into a painter, which draws them from far to near.

const shades = new Map();

/** A colour #rrggbb mixed with white (amount > 0) or black (amount < 0). */
function shade(colour, amount) {
  const key = colour + amount.toFixed(2);
  if (!shades.has(key)) {
    const other = amount > 0 ? 255 : 0, part = Math.abs(amount);
    const mixed = [1, 3, 5].map((i) => Math.round(parseInt(colour.slice(i, i + 2), 16) * (1 - part) + other * part));
    shades.set(key, `rgb(${mixed.join(",")})`);
  }
  return shades.get(key);
}

class Painter {
  constructor(context, camera, grain) {
    this.c = context;
    this.camera = camera;
    this.grain = grain; // depths nearer than this count as equal, so that a flat mechanism does not flicker
    this.list = [];
    this.drawnRods = []; // ends in the picture, and half the width
    this.hatched = []; // lines of the ground, which rest
    this.drawnMarks = []; // boxes of supports and of arrows around a point
    this.drawnSprings = []; // ends in the picture, and half the width
  }

  push(z, draw) {
    if (!Number.isNaN(z)) this.list.push({ z: Math.round(z / this.grain), draw });
  }

  /** Triangles, three numbers of corners each, every one at its own depth. */
  mesh(points, { faces, closed }, colour) {
    const { camera, c, grain } = this, seen = points.map((p) => camera.project(p));
    const shades = Array.from({ length: 12 }, (_, i) => shade(colour, -0.35 + i * 0.06));
    for (let i = 0; i < faces.length; i += 3) {
      const a = points[faces[i]], b = points[faces[i + 1]], d = points[faces[i + 2]];
      const p = seen[faces[i]], q = seen[faces[i + 1]], r = seen[faces[i + 2]];
      if (!p || !q || !r) continue;
      const n = unit(cross(sub(b, a), sub(d, a)));
      if (closed && dot(n, camera.toEye(a)) < 0) continue;
      const light = Math.abs(dot(n, camera.back));
      const fill = shades[Math.min(11, Math.floor(12 * light))];
      this.list.push({ z: (p.z + q.z + r.z) / 3 / grain, draw: () => {
        c.beginPath();
        c.moveTo(p.x, p.y); c.lineTo(q.x, q.y); c.lineTo(r.x, r.y);
        c.closePath();
        c.fillStyle = c.strokeStyle = fill; // the stroke closes the seams between neighbours
        c.lineWidth = 0.7;
        c.fill(); c.stroke();
      } });
    }
  }

  paint() {
    this.list.sort((a, b) => a.z - b.z); // stable: equal depths keep the order of drawing
    for (const item of this.list) item.draw();
    this.list = [];
  }

  polygon(points, fill, stroke, width = 1) {
    const c = this.c;
    c.beginPath();
    points.forEach((p, i) => (i ? c.lineTo(p.x, p.y) : c.moveTo(p.x, p.y)));
    c.closePath();
    c.lineJoin = "round";
    if (fill) { c.fillStyle = fill; c.fill(); }
    if (stroke) { c.strokeStyle = stroke; c.lineWidth = width; c.stroke(); }
  }

  circle(x, y, radius, fill, stroke, width = 1) {
    const c = this.c;
    c.beginPath();
    c.arc(x, y, radius, 0, 2 * Math.PI);
    if (fill) { c.fillStyle = fill; c.fill(); }
    if (stroke) { c.strokeStyle = stroke; c.lineWidth = width; c.stroke(); }
  }

  line(points, colour, width, cap = "round") {
    const c = this.c;
    c.beginPath();
    points.forEach((p, i) => (i ? c.lineTo(p.x, p.y) : c.moveTo(p.x, p.y)));
    c.lineCap = cap;
    c.lineJoin = "round";
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.stroke();
  }

  /** Round rod between two points, cut into pieces so that rods can pass before and behind each other. */
  rod(a, b, radius, colour, pieces) {
    const ends = [this.camera.project(a), this.camera.project(b)];
    if (ends[0] && ends[1]) this.drawnRods.push([...ends, Math.max(3, radius * ends[0].s)]);
    for (let i = 0; i < pieces; i++) {
      const p = this.camera.project(along(a, b, i / pieces)), q = this.camera.project(along(a, b, (i + 1) / pieces));
      if (p && q) this.push((p.z + q.z) / 2, () => this.rodPiece(p, q, radius, colour, i === 0, i === pieces - 1));
    }
  }

  rodPiece(p, q, radius, colour, first, last) {
    const w = radius * (p.s + q.s), dark = shade(colour, -0.45);
    if (w < 3) { this.line([p, q], dark, Math.max(1.3, w)); return; }
    const dx = q.x - p.x, dy = q.y - p.y, l = Math.hypot(dx, dy);
    const ends = [[p, first], [q, last]].filter((end) => end[1]).map((end) => end[0]);
    for (const end of ends) this.circle(end.x, end.y, w / 2 + 1, dark);
    if (l > 0.01) {
      this.line([p, q], dark, w + 2, "butt");
      // Light from the upper left, across the rod.
      let nx = -dy / l, ny = dx / l;
      if (nx + ny > 0) { nx = -nx; ny = -ny; }
      const g = this.c.createLinearGradient(p.x + nx * w / 2, p.y + ny * w / 2, p.x - nx * w / 2, p.y - ny * w / 2);
      g.addColorStop(0, shade(colour, 0.12));
      g.addColorStop(0.3, shade(colour, 0.42));
      g.addColorStop(1, shade(colour, -0.18));
      for (const end of ends) this.circle(end.x, end.y, w / 2, g);
      const over = Math.min(1, 1 / l);
      const from = first ? p : { x: p.x - dx * over, y: p.y - dy * over };
      const to = last ? q : { x: q.x + dx * over, y: q.y + dy * over };
      this.line([from, to], g, w, "butt");
    } else {
      this.circle(p.x, p.y, w / 2, shade(colour, 0.2));
    }
  }

  /** Flat plate with rounded corners through points in order. */
  plate(points, radius, colour, lift = 0) {
    const ring = points.map((p) => this.camera.project(p));
    if (ring.includes(null)) return;
    const normal = unit(cross(sub(points[1], points[0]), sub(points[2], points[0])));
    const light = Math.abs(dot(normal, this.camera.back));
    const z = ring.reduce((sum, p) => sum + p.z, 0) / ring.length, w = 2 * radius * ring[0].s;
    this.push(z + lift, () => {
      const face = shade(colour, 0.05 + 0.3 * light);
      this.polygon(ring, null, shade(colour, -0.45), Math.max(2, w + 2));
      this.polygon(ring, face, face, Math.max(0.5, w));
    });
  }

  ball(centre, radius, colour, lift) {
    const p = this.camera.project(centre);
    if (!p) return;
    const r = Math.max(1.6, radius * p.s);
    this.push(p.z + lift, () => {
      if (r < 2.5) { this.circle(p.x, p.y, r, shade(colour, -0.3)); return; }
      const g = this.c.createRadialGradient(p.x - r / 3, p.y - r / 3, r / 8, p.x, p.y, r);
      g.addColorStop(0, shade(colour, 0.6));
      g.addColorStop(1, shade(colour, -0.12));
      this.circle(p.x, p.y, r, g, COLOURS.edge, 1.2);
    });
  }

  /** Short cylinder about an axis; its cap carries an eye, as pins are drawn. */
  pin(centre, axis, radius, half, colour, lift, eye) {
    const camera = this.camera, p = camera.project(centre);
    if (!p) return;
    if (radius * p.s < 2.5) { this.ball(centre, radius, colour, lift); return; }
    const facing = dot(axis, camera.toEye(centre)) < 0 ? scaled(axis, -1) : axis;
    const u = perpendicular(axis), v = cross(axis, u), near = [], far = [];
    for (let i = 0; i < 24; i++) {
      const angle = (i * Math.PI) / 12;
      const rim = add(scaled(u, radius * Math.cos(angle)), scaled(v, radius * Math.sin(angle)));
      near.push(camera.project(add(centre, add(rim, scaled(facing, half)))));
      far.push(camera.project(add(centre, sub(rim, scaled(facing, half)))));
    }
    if (near.includes(null) || far.includes(null)) return;
    const face = camera.project(add(centre, scaled(facing, half)));
    this.push(p.z + lift, () => {
      this.polygon(hull(near.concat(far)), shade(colour, -0.2), COLOURS.edge, 1.2);
      this.polygon(near, colour, COLOURS.edge, 1);
      if (eye && dot(facing, camera.toEye(centre)) > 0.4) {
        this.circle(face.x, face.y, Math.max(1, 0.3 * radius * p.s), COLOURS.edge);
      }
    });
  }

  /** Cylinder of any size about an axis. */
  drum(centre, axis, radius, half, colour, lift = 0) {
    const camera = this.camera, p = camera.project(centre);
    if (!p) return;
    const facing = dot(axis, camera.toEye(centre)) < 0 ? scaled(axis, -1) : axis;
    const u = perpendicular(axis), v = cross(axis, u), near = [], far = [];
    for (let i = 0; i < 48; i++) {
      const angle = (i * Math.PI) / 24;
      const rim = add(scaled(u, radius * Math.cos(angle)), scaled(v, radius * Math.sin(angle)));
      near.push(camera.project(add(centre, add(rim, scaled(facing, half)))));
      far.push(camera.project(add(centre, sub(rim, scaled(facing, half)))));
    }
    if (near.includes(null) || far.includes(null)) return;
    this.push(p.z + lift, () => {
      this.polygon(hull(near.concat(far)), shade(colour, -0.2), COLOURS.edge, 1.2);
      this.polygon(near, colour, COLOURS.edge, 1);
    });
  }

  /** A wheel with teeth, or a ring with teeth inside; `first` is where its angles begin. */
  gear(centre, axis, first, wheel, colour, lift) {
    const { camera } = this, p = camera.project(centre);
    if (!p) return;
    const { radius, width, teeth, phase, ring } = wheel, facing = dot(axis, camera.toEye(centre)) < 0 ? -1 : 1;
    const second = cross(axis, first), module = teeth ? (2 * radius) / teeth : 0, inwards = ring ? -1 : 1;
    const fine = module * p.s > 1.2; // teeth that can be seen
    const rim = [];
    for (let k = 0; k < (fine ? teeth : 96); k++) {
      const steps = fine ? [[-0.28, -1.1], [-0.13, 0.9], [0.13, 0.9], [0.28, -1.1]] : [[0, 0]];
      for (const [part, height] of steps) {
        const angle = phase + ((k + part) * 2 * Math.PI) / (fine ? teeth : 96);
        rim.push([angle, radius + inwards * height * (fine ? module : 0)]);
      }
    }
    const at = (angle, r, side) => camera.project(add(add(centre, scaled(axis, side * facing * width / 2)),
      add(scaled(first, r * Math.cos(angle)), scaled(second, r * Math.sin(angle)))));
    const slices = Math.max(2, Math.min(8, Math.round((width * p.s) / 4))), layers = [];
    for (let i = 0; i < slices; i++) layers.push(rim.map(([angle, r]) => at(angle, r, (2 * i) / (slices - 1) - 1)));
    const outer = ring ? Array.from({ length: 64 }, (_, i) => at((-i * Math.PI) / 32, radius + 3 * (module || 0.05 * radius), 1)) : null;
    if (layers.some((layer) => layer.includes(null)) || (outer && outer.includes(null))) return;
    const face = layers[slices - 1];
    this.push(p.z + lift, () => {
      if (ring) { this.annulus(outer, face, shade(colour, 0.35), COLOURS.edge); return; }
      for (const layer of layers.slice(0, -1)) this.polygon(layer, shade(colour, -0.3), shade(colour, -0.45), 1);
      this.polygon(face, colour, COLOURS.edge, 1);
      if (teeth) this.polygon(rim.map(([angle]) => at(angle, 0.72 * radius, 1)), shade(colour, 0.2), null);
    });
    if (!ring && teeth) {
      const spot = [0.66, 0.2].map((r) => at(phase, r * radius, 1));
      this.push(p.z + lift, () => this.line(spot, shade(colour, -0.45), Math.max(1.2, 0.05 * radius * p.s)));
    }
  }

  /** What lies between two outlines. */
  annulus(outer, inner, fill, stroke) {
    const { c } = this;
    c.beginPath();
    for (const ring of [outer, inner]) {
      ring.forEach((p, i) => (i ? c.lineTo(p.x, p.y) : c.moveTo(p.x, p.y)));
      c.closePath();
    }
    c.fillStyle = fill;
    c.fill("evenodd");
    c.strokeStyle = stroke;
    c.lineWidth = 1;
    c.stroke();
  }

  /** Convex solid from its flat faces, each a list of points in order around an outward normal. */
  solid(centre, faces, colour, lift) {
    const p = this.camera.project(centre);
    if (!p) return;
    const eye = this.camera.toEye(centre), seen = [];
    for (const face of faces) {
      const normal = unit(sub(face.reduce(add), scaled(centre, face.length)));
      const ring = face.map((corner) => this.camera.project(corner));
      if (dot(normal, eye) > VISIBLE && !ring.includes(null)) seen.push([ring, dot(normal, eye)]);
    }
    this.push(p.z + lift, () => {
      for (const [ring, light] of seen) this.polygon(ring, shade(colour, -0.25 + 0.45 * light), COLOURS.edge, 1.1);
    });
  }

  box(centre, axes, half, colour, lift) {
    const faces = [];
    for (let k = 0; k < 3; k++) {
      const i = (k + 1) % 3, j = (k + 2) % 3;
      for (const side of [-1, 1]) {
        const middle = add(centre, scaled(axes[k], side * half[k]));
        faces.push([[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([a, b]) =>
          add(middle, add(scaled(axes[i], a * half[i]), scaled(axes[j], b * half[j])))));
      }
    }
    this.solid(centre, faces, colour, lift);
  }

  octahedron(centre, radius, colour, lift) {
    const faces = [];
    for (const x of [-radius, radius]) for (const y of [-radius, radius]) for (const z of [-radius, radius]) {
      faces.push([add(centre, [x, 0, 0]), add(centre, [0, y, 0]), add(centre, [0, 0, z])]);
    }
    this.solid(centre, faces, colour, lift);
  }

  /** Zigzag between two points, of constant width. */
  spring(a, b, radius) {
    const p = this.camera.project(a), q = this.camera.project(b);
    if (!p || !q) return;
    const w = Math.max(2.5, radius * (p.s + q.s) / 2);
    this.drawnSprings.push([p, q, w]);
    this.push((p.z + q.z) / 2, () => {
      const dx = q.x - p.x, dy = q.y - p.y, l = Math.hypot(dx, dy) || 1;
      const at = (s, n) => ({ x: p.x + dx * s - (dy / l) * n * w, y: p.y + dy * s + (dx / l) * n * w });
      const line = [at(0, 0), at(0.12, 0)];
      for (let i = 0; i < 16; i++) line.push(at(0.12 + (0.76 * (i + 0.5)) / 16, i % 2 ? -1 : 1));
      line.push(at(0.88, 0), at(1, 0));
      this.line(line, COLOURS.paper, 4);
      this.line(line, COLOURS.spring, 1.7);
    });
  }

  /** A rope of this length between two points: straight where it is taut, else hanging by what it has to spare. */
  rope(a, b, whole, down) {
    const distance = length(sub(b, a)), spare = Math.max(0, whole - distance);
    const sag = Math.min(0.5 * whole, Math.sqrt(0.375 * Math.max(distance, 0.25 * whole) * spare)), count = spare ? 16 : 1;
    const points = [];
    for (let i = 0; i <= count; i++) {
      const s = i / count;
      points.push(this.camera.project(add(add(a, scaled(sub(b, a), s)), scaled(down, 4 * sag * s * (1 - s)))));
    }
    if (points.some((p) => !p)) return;
    this.push((points[0].z + points[count].z) / 2, () => {
      this.line(points, COLOURS.paper, 4);
      this.line(points, COLOURS.spring, spare ? 1.2 : 2);
    });
  }

  /** An arrow three quarters around a point, clockwise or not: a drive turns it. */
  turnArrow(p, radius, colour, clockwise = true) {
    const c = this.c, r = Math.max(9, radius);
    this.drawnMarks.push(boxAround(p.x, p.y, r + 3));
    const [start, end] = clockwise ? [-0.75 * Math.PI, 0.6 * Math.PI] : [-0.25 * Math.PI, -1.6 * Math.PI];
    for (const [style, width] of [[COLOURS.halo, 4], [colour, 2]]) {
      c.beginPath();
      c.arc(p.x, p.y, r, start, end, !clockwise);
      c.strokeStyle = style;
      c.lineWidth = width;
      c.stroke();
    }
    const x = p.x + r * Math.cos(end), y = p.y + r * Math.sin(end), sense = clockwise ? 1 : -1;
    const ux = -sense * Math.sin(end), uy = sense * Math.cos(end), h = Math.min(8, 0.7 * r);
    this.polygon([{ x: x + ux * h, y: y + uy * h }, { x: x - uy * 0.55 * h, y: y + ux * 0.55 * h },
      { x: x + uy * 0.55 * h, y: y - ux * 0.55 * h }], colour, null);
  }

  /** An arrow with two heads: a drive moves a slide. */
  doubleArrow(p, q, colour) {
    if (!p || !q) return;
    const dx = q.x - p.x, dy = q.y - p.y, l = Math.hypot(dx, dy);
    if (l < 12) return;
    const ux = dx / l, uy = dy / l, h = Math.min(8, 0.25 * l);
    for (const [style, width] of [[COLOURS.halo, 4], [colour, 2]]) this.line([p, q], style, width);
    for (const [end, s] of [[p, -1], [q, 1]]) {
      this.polygon([{ x: end.x + s * ux * h, y: end.y + s * uy * h }, { x: end.x - uy * 0.55 * h, y: end.y + ux * 0.55 * h },
        { x: end.x + uy * 0.55 * h, y: end.y - ux * 0.55 * h }], colour, null);
    }
  }

  /** Two and a half turns about a point: a torsion spring. */
  spiral(p, radius, colour) {
    const line = Array.from({ length: 61 }, (_, i) => {
      const angle = (i * Math.PI) / 12, r = radius * (0.35 + (0.65 * i) / 60);
      return { x: p.x + r * Math.cos(angle), y: p.y - r * Math.sin(angle) };
    });
    if (radius < 7) return;
    this.line(line, COLOURS.halo, 3.2);
    this.line(line, colour, 1.5);
  }

  /** Support under a point at rest: a foot on hatched ground, always upright in the picture. */
  support(point, size) {
    const p = this.camera.project(point);
    if (!p) return;
    const r = size * p.s;
    if (r >= 4) this.drawnMarks.push({ left: p.x - r, right: p.x + r, top: p.y, bottom: p.y + 1.4 * r });
    this.push(p.z - size, () => {
      if (r < 4) return;
      const foot = [p, { x: p.x - 0.62 * r, y: p.y + r }, { x: p.x + 0.62 * r, y: p.y + r }];
      this.polygon(foot, COLOURS.foot, COLOURS.ground, 1.3);
      this.hatch({ x: p.x - r, y: p.y + r }, { x: p.x + r, y: p.y + r }, r);
    });
  }

  /** Ground line between p and q in the picture with strokes below it. */
  hatch(p, q, r) {
    if (q.x >= p.x) this.ground(p, q, r); else this.ground(q, p, r);
  }

  /** Ground line from p to q with strokes on its right. */
  ground(p, q, r) {
    this.hatched.push([p, q]);
    this.line([p, q], COLOURS.ground, 1.6);
    let dx = q.x - p.x, dy = q.y - p.y;
    const l = Math.hypot(dx, dy), count = Math.max(2, Math.min(80, Math.round(l / (0.4 * r))));
    if (!(l > 1)) return;
    dx /= l; dy /= l;
    const h = 0.38 * r;
    for (let i = 0; i < count; i++) {
      const s = ((i + 0.8) * l) / count, x = p.x + s * dx, y = p.y + s * dy;
      this.line([{ x, y }, { x: x - h * (dx + dy), y: y + h * (dx - dy) }], COLOURS.ground, 1.1);
    }
  }

  /**
   * Arrow in the picture, above everything. A double head is a moment. Hollow with a dashed shaft is not unique. An arrow
   * that would leave the picture ends at its border, cut by a double stroke.
   * Returns where it is drawn; null where it is too short to be seen.
   */
  arrow(from, vector, colour, heads, open, most) {
    const whole = length(vector), part = Math.min(1, most / (whole || 1));
    const p = this.camera.project(from), tip = this.camera.project(add(from, scaled(vector, part)));
    if (!p || !tip) return null;
    const margin = 8, { width, height } = this.camera;
    let inside = 1;
    for (const [at, to, high] of [[p.x, tip.x, width], [p.y, tip.y, height]]) {
      if (at < margin || at > high - margin) continue; // its foot is outside: the person has moved it there
      if (to < margin) inside = Math.min(inside, (at - margin) / (at - to));
      if (to > high - margin) inside = Math.min(inside, (high - margin - at) / (to - at));
    }
    const cut = part < 1 || inside < 1, q = { x: p.x + inside * (tip.x - p.x), y: p.y + inside * (tip.y - p.y) };
    const dx = q.x - p.x, dy = q.y - p.y, l = Math.hypot(dx, dy);
    if (l < 3) return null;
    this.push(Infinity, () => {
      const h = Math.min(11, 0.5 * l), ux = dx / l, uy = dy / l;
      const head = (back) => [
        { x: q.x - ux * back, y: q.y - uy * back },
        { x: q.x - ux * (back + h) - uy * h * 0.38, y: q.y - uy * (back + h) + ux * h * 0.38 },
        { x: q.x - ux * (back + h) + uy * h * 0.38, y: q.y - uy * (back + h) - ux * h * 0.38 },
      ];
      const shaft = [p, { x: q.x - ux * h * heads * 0.8, y: q.y - uy * h * heads * 0.8 }];
      this.line(shaft, COLOURS.halo, 4.5);
      this.c.setLineDash(open ? [5, 4] : []);
      this.line(shaft, colour, 2.2, open ? "butt" : "round");
      this.c.setLineDash([]);
      for (let i = 0; i < heads; i++) {
        this.polygon(head(0.7 * h * i), open ? COLOURS.paper : colour, open ? colour : COLOURS.paper, open ? 1.6 : 0.6);
      }
      if (cut && l > 24) {
        const stroke = (s) => {
          const x = p.x + ux * s, y = p.y + uy * s;
          return [{ x: x - uy * 5 - ux * 2, y: y + ux * 5 - uy * 2 }, { x: x + uy * 5 + ux * 2, y: y - ux * 5 + uy * 2 }];
        };
        this.line([{ x: p.x + ux * (0.55 * l - 2), y: p.y + uy * (0.55 * l - 2) },
          { x: p.x + ux * (0.55 * l + 2), y: p.y + uy * (0.55 * l + 2) }], COLOURS.paper, 5, "butt");
        for (const s of [0.55 * l - 2.5, 0.55 * l + 2.5]) this.line(stroke(s), colour, 1.6);
      }
    });
    return { cut, p, q };
  }
}

/** Convex hull of points in the picture. */
function hull(points) {
  const sorted = points.slice().sort((a, b) => a.x - b.x || a.y - b.y);
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1) {
        const a = chain[chain.length - 2], b = chain[chain.length - 1];
        if ((b.x - a.x) * (p.y - b.y) - (b.y - a.y) * (p.x - b.x) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return half(sorted).concat(half(sorted.slice().reverse()));
}
