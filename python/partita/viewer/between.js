// Poses between two outputs, for drawing at the rate of the screen: cubic Hermite interpolation, from the velocities at both.

// Below this a rate of turning is computed by its series. Scale: rad. Reason: the remainder, of the square, is not seen.
const SHORT_TURN = 1e-3;

const FARTHEST_TURN = Math.PI / 2; // a body that turns farther from output to output is shown in computed outputs only

/** Cubic Hermite polynomial at part s of a step: values a, b; derivatives times the step da, db. */
function hermite(a, b, da, db, s) {
  const r = 1 - s, wa = r * r * (1 + 2 * s), wb = s * s * (3 - 2 * s), wda = r * r * s, wdb = -s * s * r;
  return [0, 1, 2].map((i) => wa * a[i] + wb * b[i] + wda * da[i] + wdb * db[i]);
}

/** Product of two quaternions, scalar last: first b, then a. */
function times(a, b) {
  const [ax, ay, az, aw] = a, [bx, by, bz, bw] = b;
  return [
    aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** The rotation vector of a quaternion, the shorter of two. */
function rotationVector([x, y, z, w]) {
  const sine = Math.hypot(x, y, z), angle = 2 * Math.atan2(sine, Math.abs(w));
  return scaled([x, y, z], sine > 0 ? ((w < 0 ? -1 : 1) * angle) / sine : 0);
}

/** The quaternion of a rotation vector. */
function quaternionOf(v) {
  const angle = length(v), part = angle > EQUAL ? Math.sin(angle / 2) / angle : 0.5;
  return [...scaled(v, part), Math.cos(angle / 2)];
}

/** Rate of a rotation vector r while the body turns at angular velocity w: the inverse of the left Jacobian. */
function rateOfVector(r, w) {
  const angle = length(r), once = cross(r, w);
  const part = angle > SHORT_TURN ? 1 / (angle * angle) - (1 + Math.cos(angle)) / (2 * angle * Math.sin(angle)) : 1 / 12;
  return add(sub(w, scaled(once, 0.5)), scaled(cross(r, once), part));
}

/** Poses of all bodies at any instant: `at(frame)` places them, where `frame` may lie between two outputs. */
class Between {
  constructor(run) {
    this.run = run;
    this.frame = -1;
    this.count = run.scene.bodies.length;
    this.positions = new Array(this.count);
    this.turns = new Array(this.count);
    this.known = new Map(); // of the step in use: the rotation vectors of its bodies; null where one turns too far
    this.step = -1;
  }

  quaternion(frame, body) {
    const { values, columns } = this.run.tables.turn, at = frame * columns + 4 * body;
    return [values[at], values[at + 1], values[at + 2], values[at + 3]];
  }

  /** Rotation vectors of a step, one for each body; null where the motion between its outputs is not known well enough. */
  vectors(first) {
    if (this.step === first) return this.known;
    this.step = first;
    this.known = [];
    const { spin, rate } = this.run.tables, h = this.run.t[first + 1] - this.run.t[first];
    for (let b = 0; b < this.count && this.known; b++) {
      const [x, y, z, w] = this.quaternion(first, b), next = this.quaternion(first + 1, b);
      const vector = rotationVector(times(next, [-x, -y, -z, w]));
      const turned = h * Math.max(length(spin.vector(first, b)), length(spin.vector(first + 1, b)), length(vector) / (h || 1));
      const rates = add(rate.vector(first, b), rate.vector(first + 1, b));
      if (turned <= FARTHEST_TURN && isFinite3(rates)) this.known.push(vector); else this.known = null;
    }
    return this.known;
  }

  /** The instant to be drawn for a wanted one: itself, or an output where nothing is known between two. */
  drawn(frame) {
    const first = Math.floor(frame);
    return frame === first || first + 1 >= this.run.frames || !this.vectors(first) ? Math.round(frame) : frame;
  }

  at(frame) {
    if (frame === this.frame) return;
    this.frame = frame;
    const first = Math.floor(frame), s = frame - first, { position, rate, spin } = this.run.tables;
    const h = this.run.t[first + 1] - this.run.t[first], vectors = this.vectors(first);
    for (let b = 0; b < this.count; b++) {
      const rates = [rate.vector(first, b), rate.vector(first + 1, b)].map((v) => scaled(v, h));
      this.positions[b] = hermite(position.vector(first, b), position.vector(first + 1, b), ...rates, s);
      const r = vectors[b], w = [spin.vector(first, b), spin.vector(first + 1, b)].map((v) => scaled(v, h));
      const vector = hermite([0, 0, 0], r, w[0], rateOfVector(r, w[1]), s);
      this.turns[b] = times(quaternionOf(vector), this.quaternion(first, b));
    }
  }
}
