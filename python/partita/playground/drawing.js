// The picture: links between the points of their joints, in a view that can be turned, moved and pulled at.

function makeDrawing(canvas, about, motion) {
  const pen = canvas.getContext("2d");
  const { view } = about;
  const eye = { azimuth: view.azimuth, elevation: view.elevation, zoom: 1, right: 0, up: 0 };
  const number = new Map(about.bodies.map((name, i) => [name, i]));
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  let axes = [view.right, view.up, view.back], centre = [0, 0, 0], scale = 1, width = 1, height = 1;
  let state = null;

  function turned() {
    const mix = (a, x, b, y) => a.map((_, i) => a[i] * x + b[i] * y);
    const ca = Math.cos(eye.azimuth), sa = Math.sin(eye.azimuth), ce = Math.cos(eye.elevation), se = Math.sin(eye.elevation);
    const across = mix(view.right, ca, view.back, -sa), level = mix(view.back, ca, view.right, sa);
    const back = mix(level, ce, view.up, se), up = mix(view.up, ce, level, -se);
    axes = [across, up, back];
  }
  // the frame is that of the start, so that a longer link looks longer
  let frame = null;
  function fit() {
    const all = [];
    for (let j = 0; j < about.joints.length; j++) all.push(jointPoint(j));
    about.bodies.forEach((_, i) => all.push(...bodyPoints(i)));
    for (const spring of about.springs) all.push(...springEnds(spring));
    if (all.length === 0) all.push([0, 0, 0]);
    const span = (axis) => {
      const along = all.map((p) => dot(p, axis));
      return [Math.min(...along), Math.max(...along)];
    };
    const spans = [view.right, view.up, view.back].map(span);
    const middle = [0, 1, 2].map((c) => [view.right, view.up, view.back].reduce((z, axis, i) => z + axis[c] * (spans[i][0] + spans[i][1]) / 2, 0));
    const [across, high, deep] = spans.map(([low, top]) => top - low);
    const lengths = about.bodies.map((_, i) => {
      const points = bodyPoints(i);
      return points.length < 2 ? 0 : Math.hypot(...points[0].map((x, c) => x - points[1][c]));
    }).filter((l) => l > 0).sort((x, z) => x - z);
    const size = Math.hypot(across, high, deep) || 1;
    frame = { middle, size, across, high, link: lengths.length ? lengths[Math.floor(lengths.length / 2)] : size };
  }
  // links swing out of the frame of the start: room for that, and as large as it may be
  function fitted() {
    const whole = (0.62 * Math.min(width, height)) / frame.size;
    if (!view.planar) return whole;
    return Math.max(whole, Math.min((0.82 * width) / (frame.across || frame.size), (0.5 * height) / Math.max(frame.high, 0.25 * frame.size)));
  }
  // what leaves the picture makes it smaller, unless the view was set by hand
  let shrunk = 1;
  function shrink() {
    if (eye.zoom !== 1 || eye.right !== 0 || eye.up !== 0) return;
    let out = 1;
    for (let j = 0; j < about.joints.length; j++) {
      const [x, y] = screen(jointPoint(j));
      out = Math.max(out, Math.abs(x - width / 2) / Math.max(20, width / 2 - 30), Math.abs(y - height / 2) / Math.max(20, height / 2 - 30));
    }
    shrunk = Math.max(0.1, shrunk / out);
    scale = fitted() * shrunk;
  }
  const screen = (p) => {
    const d = [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
    return [width / 2 + scale * dot(d, axes[0]) + eye.right, height / 2 - scale * dot(d, axes[1]) + eye.up];
  };
  // the world point under a point of the canvas, as deep as another one
  const world = (x, y, like) => {
    const right = (x - eye.right - width / 2) / scale, up = -(y - eye.up - height / 2) / scale;
    const depth = dot([like[0] - centre[0], like[1] - centre[1], like[2] - centre[2]], axes[2]);
    return centre.map((c, i) => c + right * axes[0][i] + up * axes[1][i] + depth * axes[2][i]);
  };
  const onBody = (i, p) => {
    const x = state.bodies, o = 12 * i;
    return [0, 1, 2].map((r) => x[o + r] + x[o + 3 + 3 * r] * p[0] + x[o + 4 + 3 * r] * p[1] + x[o + 5 + 3 * r] * p[2]);
  };
  const inBody = (i, p) => {
    const x = state.bodies, o = 12 * i, d = [0, 1, 2].map((r) => p[r] - x[o + r]);
    return [0, 1, 2].map((c) => d[0] * x[o + 3 + c] + d[1] * x[o + 6 + c] + d[2] * x[o + 9 + c]);
  };
  const jointPoint = (j) => Array.from(state.joints.subarray(3 * j, 3 * j + 3));
  const shapes = about.bodies.map((name) => about.joints.flatMap((joint, j) => (joint.child === name || joint.parent === name ? [j] : [])));
  const ground = about.joints.flatMap((joint, j) => (joint.child === "ground" || joint.parent === "ground" ? [j] : []));
  const slides = (j) => ["prismatic", "cylindrical"].includes(about.joints[j].kind);
  const springEnds = (spring) => [1, 2].map((e) => {
    const point = motion.get(`${spring.name}.point${e}`), body = number.get(spring[`body${e}`]);
    return body === undefined ? point : onBody(body, point);
  });
  // points where springs are attached to a body, beside its joints
  const held = about.bodies.map((name) => about.springs.flatMap((spring) => [1, 2].flatMap((e) => (spring[`body${e}`] === name ? [`${spring.name}.point${e}`] : []))));
  const bodyPoints = (i) => {
    const points = shapes[i].map(jointPoint);
    for (const name of held[i]) {
      const point = onBody(i, motion.get(name));
      if (points.length && points.every((p) => Math.hypot(...p.map((x, c) => x - point[c])) > 1e-6 * about.length)) points.push(point);
    }
    const com = about.parameters[`${about.bodies[i]}.com`] && onBody(i, motion.get(`${about.bodies[i]}.com`));
    if (points.length < 2 && com) points.push(com);
    if (points.length === 0) points.push(onBody(i, [0, 0, 0]));
    return points;
  };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  let colours = {};
  function restyle() {
    colours = Object.fromEntries(["--ink", "--quiet", "--paper", "--line", "--force", "--edge"].map((n) => [n, colour(n)]));
    colours.links = [1, 2, 3, 4, 5, 6].map((i) => colour(`--link${i}`));
  }
  function line(points, closed) {
    pen.beginPath();
    points.forEach((p, i) => (i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
    if (closed) pen.closePath();
  }
  // whether a line passes a box
  function passes([p, r], box) {
    let from = 0, to = 1;
    for (const [x, d, low, high] of [[p[0], r[0] - p[0], box.left, box.right], [p[1], r[1] - p[1], box.top, box.bottom]]) {
      if (Math.abs(d) < 1e-9) {
        if (x < low || x > high) return false;
      } else {
        const one = (low - x) / d, other = (high - x) / d;
        from = Math.max(from, Math.min(one, other));
        to = Math.min(to, Math.max(one, other));
      }
    }
    return from <= to;
  }
  // names beside their joints, where they cover least; a name keeps its side while it is as good as free there
  const sides = new Map();
  const around = [[1, -1], [-1, -1], [1, 1], [-1, 1], [1, 0], [-1, 0], [0, -1], [0, 1]];
  let written = [];
  function write(pins, lines) {
    pen.fillStyle = colours["--quiet"];
    pen.font = "12px system-ui, sans-serif";
    written = [];
    const named = new Set();
    pins.forEach((pin, j) => {
      if (!pin || named.has(j)) return;
      // one label for joints at one point
      const here = pins.flatMap((other, i) => (other && Math.hypot(other[0] - pin[0], other[1] - pin[1]) < 3 ? [i] : []));
      here.forEach((i) => named.add(i));
      const word = here.map((i) => about.joints[i].name).join(", "), long = pen.measureText(word).width, half = here.some(slides) ? 14 : 8;
      const cost = (side) => {
        const [dx, dy] = around[side % 8], far = half + (side < 8 ? 0 : 14);
        const left = pin[0] + dx * far - (dx < 0 ? long : dx === 0 ? long / 2 : 0), middle = pin[1] + dy * (far + 2);
        const box = { left, right: left + long, top: middle - 7, bottom: middle + 7, word };
        let z = 0.02 * side;
        if (box.left < 2 || box.right > width - 2 || box.top < 2 || box.bottom > height - 2) z += 10;
        for (const one of lines) if (passes(one, box)) z += 1;
        for (const other of pins) if (other && other[0] > box.left - 6 && other[0] < box.right + 6 && other[1] > box.top - 6 && other[1] < box.bottom + 6) z += 1;
        for (const other of written) if (box.left < other.right + 2 && other.left < box.right + 2 && box.top < other.bottom && other.top < box.bottom) z += 5;
        return { z, box, side };
      };
      const tried = around.flatMap((_, side) => [cost(side), cost(side + 8)]).sort((a, b) => a.z - b.z);
      const kept = sides.has(j) ? cost(sides.get(j)) : null;
      const best = kept && kept.z < tried[0].z + 0.9 ? kept : tried[0];
      sides.set(j, best.side);
      written.push(best.box);
      pen.fillText(word, best.box.left, best.box.bottom - 3);
    });
  }
  function draw(pull) {
    const ratio = window.devicePixelRatio || 1;
    width = canvas.clientWidth;
    height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    state = motion.look();
    if (!frame) fit();
    centre = frame.middle;
    scale = fitted() * shrunk * eye.zoom;
    turned();
    shrink();
    // pins and marks shrink with links that are short on the screen
    const slim = Math.min(1, Math.max(0.3, (scale * frame.link) / 45));
    const lines = [];
    const foot = ([x, y]) => {
      pen.strokeStyle = colours["--edge"];
      pen.lineWidth = 2 * slim;
      line([[x, y], [x - 11 * slim, y + 18 * slim], [x + 11 * slim, y + 18 * slim]], true);
      pen.stroke();
      line([[x - 16 * slim, y + 18 * slim], [x + 16 * slim, y + 18 * slim]], false);
      pen.stroke();
    };
    pen.lineCap = pen.lineJoin = "round";
    for (const joint of ground) {
      if (slides(joint)) {
        const axis = about.joints[joint].axis;
        if (!axis) continue;
        const p = jointPoint(joint), far = 0.5 * frame.size / Math.hypot(...axis);
        pen.strokeStyle = colours["--edge"];
        pen.lineWidth = 1.5;
        pen.setLineDash([7, 5]);
        line([-1, 1].map((s) => screen(p.map((c, i) => c + s * far * axis[i]))), false);
        pen.stroke();
        pen.setLineDash([]);
      } else {
        foot(screen(jointPoint(joint)));
      }
    }
    for (const spring of about.springs) {
      const [a, b] = springEnds(spring).map(screen);
      const dx = b[0] - a[0], dy = b[1] - a[1], l = Math.hypot(dx, dy) || 1, coil = [a];
      [a, b].forEach((end, e) => { if (spring[`body${e + 1}`] === "ground") foot(end); });
      for (let i = 1; i < 16; i++) {
        const s = i / 16, out = (i % 2 ? 1 : -1) * Math.min(7, l / 8) * (i > 1 && i < 15 ? 1 : 0);
        coil.push([a[0] + dx * s - (dy / l) * out, a[1] + dy * s + (dx / l) * out]);
      }
      pen.strokeStyle = colours["--quiet"];
      pen.lineWidth = 1.5;
      line([...coil, b], false);
      pen.stroke();
      lines.push([a, b]);
    }
    about.bodies.forEach((_, i) => {
      const points = bodyPoints(i).map(screen);
      pen.strokeStyle = pen.fillStyle = colours.links[i % 6];
      if (points.length > 2) {
        pen.globalAlpha = 0.22;
        line(points, true);
        pen.fill();
        pen.globalAlpha = 1;
      }
      pen.lineWidth = 6 * slim;
      points.forEach((p, e) => { if (e) lines.push([points[e - 1], p]); });
      if (points.length > 2) lines.push([points[points.length - 1], points[0]]);
      line(points, points.length > 2);
      pen.stroke();
      if (points.length === 1) {
        pen.beginPath();
        pen.rect(points[0][0] - 13, points[0][1] - 9, 26, 18);
        pen.fill();
      }
    });
    const pins = about.joints.map((joint, j) => (joint.kind === "free" ? null : screen(jointPoint(j))));
    about.joints.forEach((_, j) => {
      if (!pins[j]) return;
      const [x, y] = pins[j];
      pen.fillStyle = colours["--paper"];
      pen.strokeStyle = colours["--ink"];
      pen.lineWidth = 1.8 * slim;
      pen.beginPath();
      if (slides(j)) pen.rect(x - 12 * slim, y - 8 * slim, 24 * slim, 16 * slim); else pen.arc(x, y, 5 * slim, 0, 7);
      pen.fill();
      pen.stroke();
    });
    if (about.joints.length <= 24) write(pins, lines);
    if (pull) {
      const from = screen(onBody(pull.body, pull.point)), to = screen(pull.to);
      pen.strokeStyle = pen.fillStyle = colours["--force"];
      pen.lineWidth = 2;
      pen.setLineDash([5, 4]);
      line([from, to], false);
      pen.stroke();
      pen.setLineDash([]);
      for (const [x, y] of [from, to]) {
        pen.beginPath();
        pen.arc(x, y, 4, 0, 7);
        pen.fill();
      }
    }
  }
  // the link nearest to a point of the canvas, within a finger's breadth
  function pick(x, y) {
    let best = null, least = 18;
    about.bodies.forEach((_, i) => {
      const points = bodyPoints(i);
      const sides = points.length > 2 ? points.length : Math.max(1, points.length - 1);
      for (let s = 0; s < sides; s++) {
        const a = points[s], b = points[(s + 1) % points.length], A = screen(a), B = screen(b);
        const dx = B[0] - A[0], dy = B[1] - A[1], l2 = dx * dx + dy * dy;
        const part = l2 > 0 ? Math.min(1, Math.max(0, ((x - A[0]) * dx + (y - A[1]) * dy) / l2)) : 0;
        const off = Math.hypot(x - A[0] - part * dx, y - A[1] - part * dy);
        if (off < least) {
          least = off;
          best = { body: i, at: a.map((c, k) => c + part * (b[k] - c)) };
        }
      }
    });
    return best && { body: best.body, point: inBody(best.body, best.at), to: best.at };
  }
  restyle();
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);
  return { draw, pick, world, eye, get written() { return written; }, get state() { return state; } };
}
