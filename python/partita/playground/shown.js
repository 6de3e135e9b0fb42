// What a lecture shows besides: velocities and accelerations of points, positions a moment ago, a page without its numbers.

const KNOWN = 5; // positions of a point from which its rates are taken
const GHOSTS = 7; // positions shown behind the present one
const GHOST_EVERY = 0.25; // seconds on the screen between two of them
const PALE = 0.22; // opacity of the oldest ghost; younger ones are darker
const RATE_SPAN = 1.0; // arrow of a usual rate, over that of a usual force
const USUAL_RATE = 0.98; // by so much of itself the usual rate is kept from frame to frame, where the present one is smaller

/** Velocity and acceleration at the last of some times, from positions there: derivatives of the polynomial through them. */
function ratesOf(samples) {
  const n = samples.length;
  if (n < 3) return null;
  const now = samples[n - 1].t, velocity = [0, 0, 0], acceleration = [0, 0, 0];
  for (let i = 0; i < n; i++) {
    // the i-th Lagrange polynomial about now: its coefficients of the first and the second power
    let c = [1, 0, 0];
    for (let j = 0; j < n; j++) {
      if (j === i) continue;
      const scale = 1 / (samples[i].t - samples[j].t), a = (now - samples[j].t) * scale;
      c = [c[0] * a, c[1] * a + c[0] * scale, c[2] * a + c[1] * scale];
    }
    for (let k = 0; k < 3; k++) {
      velocity[k] += c[1] * samples[i].p[k];
      acceleration[k] += 2 * c[2] * samples[i].p[k];
    }
  }
  return { velocity, acceleration };
}

class Shown {
  static rates(samples) { return ratesOf(samples); } // for tests

  /** `points`: functions that give the points whose rates are shown, now. */
  constructor(points) {
    this.points = points;
    this.options = { velocities: false, accelerations: false, ghosts: false };
    this.usual = { velocity: 0, acceleration: 0 };
    this.forget();
  }

  forget() {
    this.samples = this.points.map(() => []);
    this.ghosts = [];
  }

  /** The positions at a time of the motion; `bodies` gives lines of all bodies, `seconds` passed on the screen. */
  record(t, seconds, bodies) {
    this.points.forEach((at, i) => {
      const list = this.samples[i], p = at();
      if (list.length && !(t > list[list.length - 1].t)) return;
      if (isFinite3(p)) list.push({ t, p });
      if (list.length > KNOWN) list.shift();
    });
    if (!this.options.ghosts) { this.ghosts = []; return; }
    const last = this.ghosts[this.ghosts.length - 1];
    if (last && seconds - last.seconds < GHOST_EVERY) return;
    this.ghosts.push({ seconds, bodies: bodies() });
    if (this.ghosts.length > GHOSTS + 1) this.ghosts.shift(); // the last is nearly where the mechanism is
  }

  behind(painter, radius) {
    const { c, camera } = painter, count = this.ghosts.length - 1;
    this.ghosts.slice(0, -1).forEach(({ bodies }, i) => {
      c.globalAlpha = PALE * (0.4 + (0.6 * (i + 1)) / count);
      for (const { colour, lines } of bodies) {
        for (const line of lines) {
          const ends = line.map((p) => camera.project(p));
          if (ends.every(Boolean)) painter.line(ends, colour, 2 * radius * ends[0].s);
        }
      }
    });
    c.globalAlpha = 1;
  }

  /** Arrows of the rates; one scale for all points, which follows the largest of late. */
  arrows(painter, span) {
    const found = this.samples.map((list) => ratesOf(list));
    for (const [key, word, colour] of [["velocities", "velocity", COLOURS.free], ["accelerations", "acceleration", COLOURS.load]]) {
      const largest = Math.max(0, ...found.filter(Boolean).map((rates) => length(rates[word])));
      this.usual[word] = Math.max(USUAL_RATE * this.usual[word], largest);
      if (!this.options[key] || !(this.usual[word] > 0)) continue;
      found.forEach((rates, i) => {
        if (!rates) return;
        const list = this.samples[i], drawn = scaled(rates[word], (RATE_SPAN * span) / this.usual[word]);
        painter.arrow(list[list.length - 1].p, drawn, colour, word === "velocity" ? 1 : 2, false, span);
      });
    }
  }
}
