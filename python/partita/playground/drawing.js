// The picture: links between the points of their joints, in a view that can be turned, moved and pulled at.

function makeDrawing(canvas, about, motion) {
  const pen = canvas.getContext("2d");
  const { view } = about;
  const eye = { azimuth: view.azimuth, elevation: view.elevation, zoom: 1, right: 0, up: 0 };
  const number = new Map(about.bodies.map((name, i) => [name, i]));
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  let axes = [view.right, view.up, view.back], centre = [0, 0, 0], scale = 1, width = 1, height = 1;
  let places = null;

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
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const { joints, bodies } = motion.look();
    const all = [];
    for (let i = 0; i < joints.length; i += 3) all.push(joints.subarray(i, i + 3));
    for (let i = 0; i < bodies.length; i += 12) all.push(bodies.subarray(i, i + 3));
    for (const p of all) for (let c = 0; c < 3; c++) { low[c] = Math.min(low[c], p[c]); high[c] = Math.max(high[c], p[c]); }
    const middle = low.map((x, c) => (all.length ? (x + high[c]) / 2 : 0));
    const size = Math.hypot(...low.map((x, c) => (all.length ? high[c] - x : 1))) || 1;
    frame = { middle, size };
  }
  const screen = (p) => {
    const d = [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
    return [width / 2 + scale * dot(d, axes[0]) + eye.right, height / 2 - scale * dot(d, axes[1]) + eye.up];
  };
  // the world point under a place of the canvas, as deep as another one
  const world = (x, y, like) => {
    const right = (x - eye.right - width / 2) / scale, up = -(y - eye.up - height / 2) / scale;
    const depth = dot([like[0] - centre[0], like[1] - centre[1], like[2] - centre[2]], axes[2]);
    return centre.map((c, i) => c + right * axes[0][i] + up * axes[1][i] + depth * axes[2][i]);
  };
  const onBody = (i, p) => {
    const x = places.bodies, o = 12 * i;
    return [0, 1, 2].map((r) => x[o + r] + x[o + 3 + 3 * r] * p[0] + x[o + 4 + 3 * r] * p[1] + x[o + 5 + 3 * r] * p[2]);
  };
  const inBody = (i, p) => {
    const x = places.bodies, o = 12 * i, d = [0, 1, 2].map((r) => p[r] - x[o + r]);
    return [0, 1, 2].map((c) => d[0] * x[o + 3 + c] + d[1] * x[o + 6 + c] + d[2] * x[o + 9 + c]);
  };
  const jointPoint = (j) => Array.from(places.joints.subarray(3 * j, 3 * j + 3));
  const shapes = about.bodies.map((name) => about.joints.flatMap((joint, j) => (joint.child === name || joint.parent === name ? [j] : [])));
  const ground = about.joints.flatMap((joint, j) => (joint.child === "ground" || joint.parent === "ground" ? [j] : []));
  const slides = (j) => ["prismatic", "cylindrical"].includes(about.joints[j].kind);
  const bodyPoints = (i) => {
    const points = shapes[i].map(jointPoint);
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
    if (!frame) fit();
    centre = frame.middle;
    scale = (0.62 * Math.min(width, height) * eye.zoom) / frame.size;
    turned();
    places = motion.look();
    pen.lineCap = pen.lineJoin = "round";
    for (const joint of ground) {
      const [x, y] = screen(jointPoint(joint));
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
        pen.strokeStyle = colours["--edge"];
        pen.lineWidth = 2;
        line([[x, y], [x - 11, y + 18], [x + 11, y + 18]], true);
        pen.stroke();
        line([[x - 16, y + 18], [x + 16, y + 18]], false);
        pen.stroke();
      }
    }
    for (const spring of about.springs) {
      const ends = [1, 2].map((e) => {
        const point = motion.get(`${spring.name}.point${e}`), body = number.get(spring[`body${e}`]);
        return screen(body === undefined ? point : onBody(body, point));
      });
      const [a, b] = ends, dx = b[0] - a[0], dy = b[1] - a[1], l = Math.hypot(dx, dy) || 1, coil = [a];
      for (let i = 1; i < 16; i++) {
        const s = i / 16, out = (i % 2 ? 1 : -1) * Math.min(7, l / 8) * (i > 1 && i < 15 ? 1 : 0);
        coil.push([a[0] + dx * s - (dy / l) * out, a[1] + dy * s + (dx / l) * out]);
      }
      pen.strokeStyle = colours["--quiet"];
      pen.lineWidth = 1.5;
      line([...coil, b], false);
      pen.stroke();
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
      pen.lineWidth = 6;
      line(points, points.length > 2);
      pen.stroke();
      if (points.length === 1) {
        pen.beginPath();
        pen.rect(points[0][0] - 13, points[0][1] - 9, 26, 18);
        pen.fill();
      }
    });
    const written = [];
    about.joints.forEach((joint, j) => {
      if (joint.kind === "free") return;
      const [x, y] = screen(jointPoint(j));
      pen.fillStyle = colours["--paper"];
      pen.strokeStyle = colours["--ink"];
      pen.lineWidth = 1.8;
      pen.beginPath();
      if (slides(j)) pen.rect(x - 12, y - 8, 24, 16); else pen.arc(x, y, 5, 0, 7);
      pen.fill();
      pen.stroke();
      if (about.joints.length > 24) return;
      pen.fillStyle = colours["--quiet"];
      pen.font = "12px system-ui, sans-serif";
      // one below the other where they would meet
      const long = pen.measureText(joint.name).width, left = Math.min(x + 9, width - long - 4);
      let down = Math.max(y - 9, 14);
      for (const box of written) {
        if (left < box.right && left + long > box.left && Math.abs(down - box.down) < 14) down = box.down + 15;
      }
      written.push({ left, right: left + long, down });
      pen.fillText(joint.name, left, down);
    });
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
  // the link nearest to a place of the canvas, within a finger's breadth
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
  return { draw, pick, world, eye };
}
