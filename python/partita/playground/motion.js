// The motion of a mechanism, computed from the recorded program of its equations.
//
//   (S1) M v' = h + C^T lambda   (S2) q' = N v   (S3) Phi = 0   (S4) C v + a = 0   (S5) C v' + b = 0
//
// The state is (q, v_I): all coordinates, and the velocities chosen to be independent. Of the others
//   v_D = A v_I + eta,  A = -C_D^-1 C_I,  eta = -C_D^-1 a        (P1, P2)
//   M_d = D M D^T,      h_d = D (h - M [0; xi])                   (P3)
// Steps are those of Dormand and Prince, of order 5, with control of their error; at the end of each the dependent
// coordinates are closed by Newton's method, and the choice is looked at. The work of a step is in proportion to the
// entries of C, M and D that are not 0: they are eliminated along plans, each made when the choice is.

function makeMotion(run, about) {
  const w = new Float64Array(run.memory.buffer);
  const nq = about.coordinates, n = about.velocities, rows = about.rows, holonomic = about.holonomic;
  const kept = [];
  for (let i = 0; i < rows; i++) if (!about.dropped.includes(i)) kept.push(i);
  const m = kept.length, k = n - m;
  const closing = kept.filter((i) => i < holonomic), mh = closing.length;
  const place = (name) => about.outputs[name][0];
  const PHI = place("phi"), C = place("c"), A = place("a"), B = place("b"), H = place("h");
  // what light links count with is in the metric alone
  const light = about.outputs.metric[1] > 0, MASS = place("mass"), METRIC = light ? place("metric") : MASS;
  const Q = 1, V = 1 + nq;
  const balls = [], plain = [];
  for (let i = 0; i < n;) {
    const [from, to] = about.coordinates_of[i];
    if (to - from === 4) { balls.push([from, i]); i += 3; } else { plain.push([from, i]); i += 1; }
  }
  const reach = about.reach;
  const opening = about.conditions.map((c) => 1 / (c.reach > 0 ? c.reach : c.angle ? 1 : about.length || 1));

  let t = 0;
  const q = new Float64Array(nq), v = new Float64Array(n), rho = new Float64Array(n).fill(1);
  let independent = [], dependent = [];
  const rates = about.drives.map((d) => ({ ...d, factor: 1, clock: 0, since: 0, shift: 0 }));
  const phi = new Float64Array(rows), a = new Float64Array(rows), b = new Float64Array(rows);
  const dt = new Float64Array(n * k), md = new Float64Array(k * k), hd = new Float64Array(k);
  const sides = new Float64Array(m * k), moved = new Float64Array(n * k);
  const mass = makeSymmetric(n, about.patterns.mass), metric = light ? makeSymmetric(n, about.patterns.metric) : mass;
  const gamma = new Float64Array(n), xi = new Float64Array(n), right = new Float64Array(m), force = new Float64Array(n), slope = new Float64Array(n);
  const ny = nq + k;
  const stage = Array.from({ length: 7 }, () => new Float64Array(ny));
  const y = new Float64Array(ny), y1 = new Float64Array(ny), trial = new Float64Array(ny);

  class Fault extends Error {}

  // ---- what the drives prescribe: value, rate and its rate at time s
  function course(d, s, out) {
    const x = d.clock + d.factor * (s - d.since);
    if (d.breaks.length === 0) { out[0] = d.value; out[1] = 0; out[2] = 0; return; }
    const last = d.breaks.length - 2;
    if (x < d.breaks[0] || x > d.breaks[last + 1]) {
      throw new Fault(`The table of ${d.name} ends at ${d.breaks[last + 1]} s: nothing is prescribed beyond.`);
    }
    let i = 0;
    while (i < last && x >= d.breaks[i + 1]) i++;
    const [c3, c2, c1, c0] = d.coefficients[i], z = x - d.breaks[i];
    out[0] = ((c3 * z + c2) * z + c1) * z + c0;
    out[1] = ((3 * c3 * z + 2 * c2) * z + c1) * d.factor;
    out[2] = (6 * c3 * z + 2 * c2) * d.factor * d.factor;
  }
  const drawn = new Float64Array(3);

  // ---- levels
  function position(s, at) {
    w[0] = s;
    for (let i = 0; i < nq; i++) w[Q + i] = at[i];
    run.position();
    evaluations += 1;
    for (let i = 0; i < holonomic; i++) phi[i] = w[PHI + i];
    for (let i = 0; i < rows; i++) a[i] = w[A + i];
    for (const d of rates) {
      course(d, s, drawn);
      if (d.level === "position") {
        phi[d.row] -= drawn[0] - d.recorded;
        a[d.row] -= drawn[1];
      } else {
        a[d.row] -= drawn[0] * d.factor;
      }
    }
  }
  function velocity(s, at) {
    for (let i = 0; i < n; i++) w[V + i] = at[i];
    run.velocity();
    for (let i = 0; i < rows; i++) b[i] = w[B + i];
    for (const d of rates) {
      course(d, s, drawn);
      b[d.row] -= d.level === "position" ? drawn[2] : drawn[1] * d.factor;
    }
  }

  // ---- P1: C_D factored, D^T; a row of D^T has entries at `over` of it
  let elimination = null, over = [];
  const freedom = new Int32Array(n).fill(-1);
  const NO_MASS = "No mass moves with one of the freedoms: its acceleration is not determined.";
  const entriesOf = (i, of) => {
    const list = [];
    for (let e = about.row_start[i]; e < about.row_start[i + 1]; e++) list.push([of(about.columns[e]), C + e]);
    return list;
  };
  function plan() {
    const place = new Int32Array(n);
    dependent.forEach((j, i) => { place[j] = i; });
    independent.forEach((j, i) => { place[j] = m + i; });
    elimination = makeElimination(m, kept.map((i) => entriesOf(i, (j) => place[j])), w);
    if (!elimination) return false;
    over = new Array(n);
    dependent.forEach((j, i) => { over[j] = Int32Array.from(elimination.reach[i]); });
    independent.forEach((j, i) => { over[j] = Int32Array.of(i); });
    dt.fill(0);
    freedom.fill(-1);
    independent.forEach((j, i) => { dt[j * k + i] = 1; freedom[j] = i; });
    wide = worthwhile();
    return true;
  }
  // The accelerations solve  [M C^T; C 0] [v'; -lambda] = [h; -b]  as well, sparse however many freedoms there are: taken
  // where that costs less than D M D^T. The order of its elimination does not depend on the choice.
  let whole = null, wide = false;
  function worthwhile() {
    let projection = elimination.operations + k * k * k / 6;
    for (let e = 0; e < mass.row.length; e++) projection += over[mass.row[e]].length + over[mass.column[e]].length;
    for (let i = 0; i < n; i++) projection += over[i].length * k / 2;
    if (light || projection < 10000) return false;
    if (!whole) {
      run.velocity();
      const entries = Array.from({ length: n + m }, () => []);
      for (let e = 0; e < mass.row.length; e++) {
        const i = mass.row[e], j = mass.column[e];
        entries[i].push([j, MASS + e]);
        if (i !== j) entries[j].push([i, MASS + e]);
      }
      kept.forEach((i, r) => {
        for (const [j, at] of entriesOf(i, (x) => x)) {
          entries[j].push([n + r, at]);
          entries[n + r].push([j, at]);
        }
      });
      whole = makeElimination(n + m, entries, w);
    }
    return whole !== null && whole.operations < projection;
  }
  const both = new Float64Array(n + m);
  function solveWhole() {
    for (let i = 0; i < n; i++) both[i] = w[H + i];
    for (let r = 0; r < m; r++) both[n + r] = -b[kept[r]];
    if (!(whole.factor() > 0) || whole.steep > 1e5) {
      whole = null;
      if (!worthwhile() || !(whole.factor() > 0)) throw new Fault(NO_MASS);
    }
    whole.solve(both);
    for (let i = 0; i < n; i++) slope[i] = both[whole.rowOf[i]];
  }
  // how regular C_D is: its smallest pivot in parts of the largest
  let regular = 1;
  // false where C_D is singular; a plan whose pivots have become small is made anew
  function factor() {
    if (!elimination && !plan()) return false;
    regular = elimination.factor();
    if (!(regular > 1e-13 && elimination.steep < 1e3)) regular = plan() ? elimination.factor() : 0;
    return regular > 1e-13;
  }
  function tangent() {
    if (!factor()) return false;
    elimination.solveSides(sides, k);
    for (let r = 0; r < m; r++) {
      const at = elimination.rowOf[r] * k, to = dependent[r] * k;
      for (const j of over[dependent[r]]) dt[to + j] = sides[at + j];
    }
    return true;
  }
  // [0; -C_D^-1 x]
  function particular(x, out) {
    for (let r = 0; r < m; r++) right[r] = -x[kept[r]];
    elimination.solve(right);
    out.fill(0);
    for (let r = 0; r < m; r++) out[dependent[r]] = right[elimination.rowOf[r]];
  }
  // P2
  function expand(state, out) {
    for (let r = 0; r < m; r++) {
      const i = kept[r];
      let z = a[i];
      for (let e = about.row_start[i]; e < about.row_start[i + 1]; e++) {
        const f = freedom[about.columns[e]];
        if (f >= 0) z += w[C + e] * state[nq + f];
      }
      right[r] = -z;
    }
    elimination.solve(right);
    for (let r = 0; r < m; r++) out[dependent[r]] = right[elimination.rowOf[r]];
    for (let j = 0; j < k; j++) out[independent[j]] = state[nq + j];
  }
  function turn(at, dv, out) {
    for (const [i, j] of plain) out[i] = dv[j];
    for (const [i, j] of balls) {
      const p = at[i], e = at[i + 1], f = at[i + 2], g = at[i + 3], x = dv[j], u = dv[j + 1], z = dv[j + 2];
      out[i] = -0.5 * (e * x + f * u + g * z);
      out[i + 1] = 0.5 * (p * x + f * z - g * u);
      out[i + 2] = 0.5 * (p * u + g * x - e * z);
      out[i + 3] = 0.5 * (p * z + e * u - f * x);
    }
  }
  function move(at, dv) {
    for (const [i, j] of plain) at[i] += dv[j];
    for (const [i, j] of balls) {
      const x = dv[j], u = dv[j + 1], z = dv[j + 2], angle = Math.hypot(x, u, z);
      const s = angle > 1e-8 ? Math.sin(angle / 2) / angle : 0.5, r = Math.cos(angle / 2);
      const p = at[i], e = at[i + 1], f = at[i + 2], g = at[i + 3], X = s * x, U = s * u, Z = s * z;
      at[i] = p * r - e * X - f * U - g * Z;
      at[i + 1] = p * X + e * r + f * Z - g * U;
      at[i + 2] = p * U - e * Z + f * r + g * X;
      at[i + 3] = p * Z + e * U - f * X + g * r;
    }
    normalise(at);
  }
  function normalise(at) {
    for (const [i] of balls) {
      const l = Math.hypot(at[i], at[i + 1], at[i + 2], at[i + 3]) || 1;
      for (let j = 0; j < 4; j++) at[i + j] /= l;
    }
  }
  // what an evaluation needs of C_D
  const evaluated = () => (wide ? factor() : tangent());
  // P3: D X D^T of a symmetric X
  function projected(x, from, out) {
    moved.fill(0);
    for (let e = 0; e < x.row.length; e++) {
      const i = x.row[e], j = x.column[e], z = w[from + e];
      for (const p of over[j]) moved[i * k + p] += z * dt[j * k + p];
      if (i !== j) for (const p of over[i]) moved[j * k + p] += z * dt[i * k + p];
    }
    out.fill(0);
    for (let i = 0; i < n; i++) {
      for (const p of over[i]) {
        const d = dt[i * k + p];
        for (let r = 0; r <= p; r++) out[p * k + r] += d * moved[i * k + r];
      }
    }
  }
  // y' of P1 to P3; false where the choice is singular
  const vHere = new Float64Array(n);
  function derivative(s, state, out) {
    position(s, state);
    if (!evaluated()) return false;
    expand(state, vHere);
    velocity(s, vHere);
    accelerate(state, vHere, out);
    return true;
  }
  function accelerate(state, rate, out) {
    turn(state, rate, out);
    if (wide) {
      solveWhole();
      for (let j = 0; j < k; j++) out[nq + j] = slope[independent[j]];
      return;
    }
    particular(b, xi);
    for (let i = 0; i < n; i++) force[i] = w[H + i];
    for (let e = 0; e < mass.row.length; e++) {
      const i = mass.row[e], j = mass.column[e], z = w[MASS + e];
      force[i] -= z * xi[j];
      if (i !== j) force[j] -= z * xi[i];
    }
    hd.fill(0);
    for (let i = 0; i < n; i++) for (const p of over[i]) hd[p] += dt[i * k + p] * force[i];
    projected(mass, MASS, md);
    if (!cholesky(md, k)) throw new Fault(NO_MASS);
    forward(md, k, hd);
    backward(md, k, hd);
    for (let j = 0; j < k; j++) out[nq + j] = hd[j];
    for (let i = 0; i < n; i++) {
      slope[i] = xi[i];
      for (const j of over[i]) slope[i] += dt[i * k + j] * hd[j];
    }
  }

  // ---- closing
  const dv = new Float64Array(n), size = new Float64Array(mh * mh), spread = new Float64Array(n);
  function openness(list) {
    let worst = 0;
    for (const i of list) if (i < holonomic) worst = Math.max(worst, Math.abs(phi[i]) * opening[i]);
    return worst;
  }
  // Newton's method on the dependent coordinates; conditions on rates close nothing, so there the least move does
  function closeDependent(s, at) {
    let before = Infinity, settled = false;
    for (let step = 0; step < 12; step++) {
      position(s, at);
      const open = openness(closing);
      if (settled || !(open < 1e3)) return open;
      let fresh = true;
      if (mh === m) {
        // the factors of the first step serve as long as it closes quickly
        fresh = !(open < 0.05 * before);
        if (fresh && !factor()) return Infinity;
        for (let r = 0; r < m; r++) right[r] = -phi[kept[r]];
        elimination.solve(right);
        dv.fill(0);
        for (let r = 0; r < m; r++) dv[dependent[r]] = right[elimination.rowOf[r]];
      } else if (!least(dependent, 0)) {
        return open;
      }
      before = open;
      let far = 0;
      for (let i = 0; i < n; i++) far = Math.max(far, Math.abs(dv[i]) / reach[i]);
      move(at, dv);
      // with the matrix of the place itself the next remainder is the square of this one
      settled = far < (fresh ? 1e-8 : 1e-11);
    }
    position(s, at);
    return openness(closing);
  }
  // dv = -S^2 C^T (C S^2 C^T + damping)^-1 Phi over some velocities, S the reaches
  function least(which, damping) {
    const weight = (j) => reach[j] * reach[j];
    spread.fill(0);
    dv.fill(0);
    for (const j of which) dv[j] = weight(j);
    for (let r = 0; r < mh; r++) {
      const [r0, r1] = [about.row_start[closing[r]], about.row_start[closing[r] + 1]];
      for (let e = r0; e < r1; e++) spread[about.columns[e]] = w[C + e] * dv[about.columns[e]];
      for (let p = 0; p <= r; p++) {
        let z = 0;
        for (let e = about.row_start[closing[p]]; e < about.row_start[closing[p] + 1]; e++) z += w[C + e] * spread[about.columns[e]];
        size[r * mh + p] = z * opening[closing[r]] * opening[closing[p]];
      }
      for (let e = r0; e < r1; e++) spread[about.columns[e]] = 0;
      size[r * mh + r] += damping + 1e-14 * size[r * mh + r];
      right[r] = -phi[closing[r]] * opening[closing[r]];
    }
    dv.fill(0);
    if (!cholesky(size, mh)) return false;
    forward(size, mh, right);
    backward(size, mh, right);
    for (let r = 0; r < mh; r++) {
      const i = closing[r];
      for (let e = about.row_start[i]; e < about.row_start[i + 1]; e++) dv[about.columns[e]] += w[C + e] * opening[i] * right[r];
    }
    spread.fill(0);
    for (const j of which) spread[j] = dv[j] * weight(j);
    dv.set(spread);
    return true;
  }
  const all = Array.from({ length: n }, (_, i) => i);
  // closes with all coordinates, by damped steps that never open it further; what stays open
  function closeAll(s, at) {
    const from = new Float64Array(nq);
    const residual = () => {
      let z = 0;
      for (const i of closing) z += (phi[i] * opening[i]) ** 2;
      return z;
    };
    position(s, at);
    let before = residual(), damping = 0;
    for (let step = 0; step < 200 && before > 1e-30; step++) {
      from.set(at);
      if (!least(all, damping)) { damping = damping ? damping * 10 : 1e-12; position(s, at); continue; }
      let far = 0;
      for (let i = 0; i < n; i++) far = Math.max(far, Math.abs(dv[i]) / reach[i]);
      if (far > 0.3) for (let i = 0; i < n; i++) dv[i] *= 0.3 / far;
      move(at, dv);
      position(s, at);
      const now = residual();
      if (now < before) {
        const settled = now > 0.9999 * before && damping > 0;
        before = now;
        damping = damping > 1e-10 ? damping / 10 : 0;
        if (settled) break;
      } else {
        at.set(from);
        position(s, at);
        if (far < 1e-13) break;
        damping = damping ? damping * 10 : 1e-8;
        if (damping > 1e6) break;
      }
    }
    return openness(closing);
  }
  // what stands open, by what it belongs to, the worst first
  function gaps() {
    const found = new Map();
    for (let i = 0; i < holonomic; i++) {
      const { owner, angle } = about.conditions[i];
      const gap = found.get(owner) || { owner, length: 0, angle: 0, part: 0 };
      if (angle) gap.angle = Math.hypot(gap.angle, phi[i]); else gap.length = Math.hypot(gap.length, phi[i]);
      gap.part = Math.max(gap.part, Math.abs(phi[i]) * opening[i]);
      found.set(owner, gap);
    }
    return [...found.values()].filter((g) => g.part > 1e-9).sort((x, z) => z.part - x.part);
  }

  // ---- the projective criterion (P4, P5): rho, and the choice by Gram and Schmidt with pivoting
  //   rho_i^2 = d_i (D X D^T)^-1 d_i^T / (X^-1)_ii,  d_i row i of D^T, X the mass matrix with light links
  // The rows of D^T, made orthonormal by the factor of D X D^T, stand for the tangential parts of unit velocities.
  const unit = new Float64Array(n * k), length = new Float64Array(n), rest = new Float64Array(n * k), left = new Float64Array(n),
    taken = new Uint8Array(n), row = new Float64Array(k), gram = new Float64Array(k * k);
  // at the position evaluated last, after `tangent`, with M there
  function measure() {
    if (light) run.metric();
    if (!metric.factor(w, METRIC)) throw new Fault("The mass matrix is not positive definite here.");
    projected(metric, METRIC, gram);
    if (!cholesky(gram, k)) return false;
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < k; j++) row[j] = dt[i * k + j];
      forward(gram, k, row);
      const whole = metric.inverse(i), scale = 1 / Math.sqrt(whole);
      let sum = 0;
      for (let j = 0; j < k; j++) {
        unit[i * k + j] = row[j] * scale;
        sum += row[j] * row[j];
      }
      length[i] = sum / whole;
      rho[i] = Math.min(1, Math.sqrt(length[i]));
    }
    return true;
  }
  // the volume that a choice spans; `wanted` null: the best, one after the other
  function span(wanted) {
    left.set(length);
    rest.set(unit);
    taken.fill(0);
    const chosen = [];
    let volume = 1;
    for (let step = 0; step < k; step++) {
      let best = -1;
      if (wanted) best = wanted[step];
      else for (let i = 0; i < n; i++) if (!taken[i] && (best < 0 || left[i] > left[best] * (1 + 1e-9))) best = i;
      const norm = Math.sqrt(Math.max(left[best], 0));
      volume *= norm;
      chosen.push(best);
      taken[best] = 1;
      if (!(norm > 0)) continue;
      for (let i = 0; i < n; i++) {
        if (taken[i]) continue;
        let z = 0;
        for (let j = 0; j < k; j++) z += rest[i * k + j] * rest[best * k + j];
        z /= norm * norm;
        if (z === 0) continue;
        let sum = 0;
        for (let j = 0; j < k; j++) {
          rest[i * k + j] -= z * rest[best * k + j];
          sum += rest[i * k + j] ** 2;
        }
        left[i] = sum;
      }
    }
    return { chosen: chosen.sort((x, z) => x - z), volume };
  }
  const EXCHANGE = 0.7;
  let exchanges = 0;
  function adopt(chosen) {
    independent = chosen;
    const free = new Set(chosen);
    dependent = all.filter((i) => !free.has(i));
    elimination = null;
    return tangent();
  }
  // any regular choice at the position evaluated last: what an elimination with the largest pivots leaves
  function anyChoice() {
    const numbers = kept.map((i) => entriesOf(i, (j) => j).map(([j, at]) => [j, w[at]]));
    const found = planElimination(m, numbers, true, [kept.map((i) => opening[i]), reach]);
    const used = found && new Set(found.pivots.map(([, j]) => j));
    if (!found || !adopt(all.filter((i) => !used.has(i)))) {
      throw new Fault(`Singular position at t = ${t.toPrecision(5)} s: the loops lose rank, and branches meet here.`);
    }
  }
  // with M of the position evaluated last
  function choose(known = false) {
    const first = dependent.length !== m || independent.length !== k;
    let any = first;
    if (first || (!known && !tangent()) || !measure()) {
      any = true;
      anyChoice();
      if (!measure()) throw new Fault(NO_MASS);
    }
    const best = span(null);
    if (!any && span(independent).volume >= EXCHANGE * best.volume) return;
    if (!first) exchanges += 1;
    const old = independent;
    if (!adopt(best.chosen) || !measure()) adopt(old);
  }
  // rates that satisfy S4 next to v, in the independent coordinates; all levels at (t, q, v)
  function settle() {
    position(t, q);
    velocity(t, v);
    choose();
    for (let i = 0; i < nq; i++) y[i] = q[i];
    for (let j = 0; j < k; j++) y[nq + j] = v[independent[j]];
    expand(y, v);
    velocity(t, v);
    ready = true;
    ahead = Infinity;
    past.plan = null;
  }

  // ---- steps
  const nodes = [0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1];
  const weights = [
    [], [1 / 5], [3 / 40, 9 / 40], [44 / 45, -56 / 15, 32 / 9],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
  ];
  const errors = [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40];
  let h = 0, steps = 0;
  // a large move of an entry of the state: 1 for an angle, a length for a slide
  const sizes = new Float64Array(nq).fill(1);
  for (const [i, j] of plain) sizes[i] = reach[j];
  const typical = (j) => (j < nq ? sizes[j] : reach[independent[j - nq]]);
  const accuracy = { relative: 1e-8, absolute: 1e-10 };
  const closed = new Float64Array(nq), next = new Float64Array(n), first = new Float64Array(n);
  // whether all levels have been evaluated at the state
  let ready = false, evaluations = 0, regularBefore = 1;
  const costly = n * k * k > 20000;
  // one step; the estimate of its error in parts of the tolerance, infinite where a choice became singular on the way
  function attempt(step) {
    if (ready) accelerate(y, v, stage[0]);
    else if (!derivative(t, y, stage[0])) return Infinity;
    ready = false;
    regularBefore = regular;
    first.set(slope);
    for (let i = 1; i < 7; i++) {
      for (let j = 0; j < ny; j++) {
        let z = 0;
        for (let l = 0; l < i; l++) z += weights[i][l] * stage[l][j];
        trial[j] = y[j] + step * z;
      }
      if (i === 6) y1.set(trial);
      if (!derivative(t + nodes[i] * step, trial, stage[i])) return Infinity;
    }
    let error = 0;
    for (let j = 0; j < ny; j++) {
      let z = 0;
      for (let l = 0; l < 7; l++) z += errors[l] * stage[l][j];
      const scale = accuracy.absolute * typical(j) + accuracy.relative * Math.max(Math.abs(y[j]), Math.abs(y1[j]));
      error = Math.max(error, Math.abs(step * z) / scale);
    }
    return error;
  }
  // Steps pass over singular positions, where branches meet. On its branch a motion has rates that follow from those before
  // it; thrown to another one they jump, however small the step. `next` against the rates and accelerations at its start.
  function jumps(step) {
    let off = 0, whole = 0;
    for (let i = 0; i < n; i++) {
      off = Math.max(off, Math.abs(next[i] - v[i] - step * first[i]) / reach[i]);
      whole = Math.max(whole, Math.abs(next[i]) / reach[i], Math.abs(v[i]) / reach[i], Math.abs(step * first[i]) / reach[i]);
    }
    return off > 0.3 * whole;
  }
  // C_D at the steps before: where its smallest pivot goes through 0 on its way, if it does
  const past = { t: 0, pivot: 0, plan: null };
  let ahead = Infinity;
  function foresee() {
    const pivot = elimination.sign * regular;
    ahead = Infinity;
    if (past.plan === elimination && past.t < t && Math.abs(pivot) < Math.abs(past.pivot)) {
      ahead = (t - past.t) * pivot / (past.pivot - pivot);
    }
    Object.assign(past, { t, pivot, plan: elimination });
  }
  // A singular position foreseen shall lie between the stages of one step, whose nodes leave a gap from 0.3 to 0.8, and far
  // from its ends: that step, or the one that leads before it; it may go beyond the time that was asked for.
  function across(h, rest) {
    if (ahead > 2 * h || ahead > rest + 0.5 * h) return [0, false];
    if (ahead > 0.72 * h) return [Math.min(rest, ahead - 0.5 * h), false];
    return [ahead > 0.3 * h ? ahead / 0.55 : ahead > 0.05 * h ? ahead / 0.1 : 0.6 * h, true];
  }
  // `deadline` [ms of the page]: where it is passed, the rest is left out, and the mechanism runs slower than asked
  function advance(until, deadline = Infinity) {
    let refused = 0, beyond = 0;
    const whole = 1.2 * (until - t);
    while (t < until) {
      if (deadline < Infinity && performance.now() > deadline) return;
      const rest = until - t;
      if (!(h > 0)) h = Math.min(rest, 1e-3);
      const [over, cross] = beyond ? [beyond, true] : across(Math.min(h, whole), rest);
      const step = over || (h >= rest * (1 - 1e-9) ? rest : h);
      let error = attempt(step);
      // so near to where branches meet rates are good to a hundred-thousandth of a millionth
      if (cross) error *= Math.min(1, accuracy.relative / 1e-11);
      let words = "the loops lose rank, and branches meet here";
      if (error <= 1) {
        normalise(y1);
        for (let i = 0; i < nq; i++) closed[i] = y1[i];
        const open = closeDependent(t + step, closed);
        if (!(open < 1e-8)) words = `the loops cannot be kept closed: ${told(gaps())}`;
        // too near to where branches meet rates are not accurate: a step ends before it or beyond
        if (!(open < 1e-8) || !evaluated() || regular < 1e-3 * regularBefore) error = Infinity;
      } else if (error < Infinity) {
        words = "the step became too small";
      }
      if (error <= 1) {
        expand(y1, next);
        if (jumps(step)) {
          error = Infinity;
          words = "branches meet here, and the motion cannot be kept on its own";
        }
      }
      if (!(error <= 1)) {
        refused += 1;
        h = Math.min(h, step) * (error > 0 && error < Infinity ? Math.max(0.2, 0.9 * error ** -0.2) : 0.3);
        // a step that ends where branches meet is tried a little longer once, then shorter
        beyond = error === Infinity && refused === 1 ? 1.1 * step : 0;
        if (h < 1e-12 * Math.max(1, Math.abs(t)) || refused > 60) {
          h = 0;
          // all is as it was after the step before
          settle();
          throw new Fault(`It stops at t = ${t.toPrecision(5)} s: ${words}.`);
        }
        continue;
      }
      refused = beyond = 0;
      if (openness(about.dropped) > about.loose) {
        const words = told(gaps());
        settle();
        throw new Fault(`A condition that was redundant as drawn is not with these lengths: ${words}.`);
      }
      q.set(closed);
      t = step === rest ? until : t + step;
      for (let i = 0; i < nq; i++) y[i] = q[i];
      for (let j = 0; j < k; j++) y[nq + j] = y1[nq + j];
      v.set(next);
      velocity(t, v);
      ready = true;
      steps += 1;
      if (!costly || steps % 8 === 0) {
        choose(!wide);
        for (let j = 0; j < k; j++) y[nq + j] = v[independent[j]];
      }
      foresee();
      if (step === h || error > 0) h = Math.max(step === rest ? h : 0, step * Math.min(5, 0.9 * Math.max(error, 1e-10) ** -0.2));
    }
  }

  const digits = (x) => Number(x.toPrecision(3)).toString();
  function told(list) {
    if (list.length === 0) return "nothing stands open";
    return list.slice(0, 3).map((g) => {
      const by = [];
      if (g.length > 0) by.push(`${digits(g.length)} m`);
      if (g.angle > 0) by.push(`${digits(g.angle)} rad`);
      const cut = /^joint "(.*)"$/.exec(g.owner), loop = cut && about.loops[cut[1]];
      return `${g.owner} stays open by ${by.join(" and ")}${loop ? ` (loop of ${loop.join(", ")})` : ""}`;
    }).join("; ");
  }
  function put(name, values) {
    const [at, count] = about.parameters[name];
    for (let i = 0; i < count; i++) w[at + i] = values[i];
    ready = false;
  }
  function get(name) {
    const [at, count] = about.parameters[name];
    return Array.from(w.subarray(at, at + count));
  }
  // a length of a body: the distance of two points along the line on which they were drawn, and what changes it
  function lengthOf(one) {
    const a = get(one.origin), b = get(one.moves);
    return one.along.reduce((z, e, i) => z + e * (b[i] - a[i]), 0);
  }
  function lengthened(one, x) {
    const more = x - lengthOf(one);
    return { [one.moves]: get(one.moves).map((c, i) => c + more * one.along[i]) };
  }
  // a planar mechanism keeps to its plane: the sides of a joint may not miss each other across it
  function leavesPlane(values) {
    if (!about.normal) return "";
    for (const { name } of about.joints) {
      const sides = [`${name}.point`, `${name}.child_point`];
      if (!sides.every((s) => s in about.parameters) || !sides.some((s) => s in values)) continue;
      const [p, r] = sides.map((s) => values[s] || get(s));
      const off = about.normal.reduce((z, e, i) => z + e * (p[i] - r[i]), 0);
      if (Math.abs(off) > 1e-9 * about.length) {
        return `It cannot be assembled with this: joint "${name}" opens by ${digits(Math.abs(off))} m across the plane.`;
      }
    }
    return "";
  }
  // other parameters: the way there in parts, so that the mechanism stays on its branch
  function change(values) {
    const across = leavesPlane(values);
    if (across) return across;
    const names = Object.keys(values), old = names.map(get), oldQ = Float64Array.from(q), oldV = Float64Array.from(v);
    let done = 0, part = 1;
    const at = Float64Array.from(q);
    while (done < 1) {
      const next = Math.min(1, done + part);
      names.forEach((name, i) => put(name, old[i].map((x, j) => (next === 1 ? values[name][j] : x + next * (values[name][j] - x)))));
      run.prepare();
      const tried = Float64Array.from(at);
      const open = closeAll(t, tried);
      const dropped = openness(about.dropped);
      let far = 0;
      for (const [i, j] of plain) far = Math.max(far, Math.abs(tried[i] - at[i]) / reach[j]);
      if (open < 1e-10 && dropped < about.loose && (far < 0.3 || part < 1e-3)) {
        at.set(tried);
        done = next;
        part *= 2;
      } else if (part > 1e-3) {
        part /= 2;
      } else {
        names.forEach((name, i) => put(name, values[name]));
        run.prepare();
        closeAll(t, tried);
        const words = told(gaps());
        names.forEach((name, i) => put(name, old[i]));
        run.prepare();
        q.set(oldQ);
        v.set(oldV);
        settle();
        return `It cannot be assembled with this: at the best ${words}.`;
      }
    }
    q.set(at);
    try {
      settle();
    } catch (fault) {
      if (!(fault instanceof Fault)) throw fault;
      names.forEach((name, i) => put(name, old[i]));
      run.prepare();
      q.set(oldQ);
      v.set(oldV);
      settle();
      return fault.message;
    }
    h = Math.min(h, 1e-3);
    return "";
  }
  function reset(start) {
    t = start.t;
    q.set(start.q);
    v.set(start.v);
    for (const d of rates) { d.clock = t; d.since = t; }
    independent = dependent = [];
    h = 0;
    exchanges = 0;
    const open = closeAll(t, q);
    if (!(open < 1e-9)) throw new Fault(`It cannot be assembled: ${told(gaps())}.`);
    settle();
  }

  for (const [name, values] of Object.entries(about.values)) put(name, values);
  run.prepare();
  return {
    Fault, q, v, rho, accuracy, put, get, change, lengthOf, lengthened, reset, advance, rates,
    get t() { return t; },
    get steps() { return steps; },
    get exchanges() { return exchanges; },
    get independent() { return independent; },
    // loads that change nothing of the geometry
    load(values) {
      for (const [name, x] of Object.entries(values)) put(name, x);
      run.prepare();
    },
    pace(i, factor) {
      const d = rates[i];
      d.clock += d.factor * (t - d.since);
      d.since = t;
      d.factor = factor;
      settle();
      h = Math.min(h, 1e-3);
    },
    prescribe(i, value) {
      const d = rates[i], old = d.value;
      d.value = value;
      const words = change({});
      if (words) d.value = old;
      return words;
    },
    halt() {
      v.fill(0);
      settle();
      h = Math.min(h, 1e-3);
    },
    get evaluations() { return evaluations; },
    // multiplications of one elimination with its solutions
    get operations() { return elimination ? elimination.operations : 0; },
    // rho at this state
    choose() { if (costly || !ready) settle(); },
    // poses of bodies (12 each), points of joints (3 each), kinetic and potential energy
    look() {
      w[0] = t;
      for (let i = 0; i < nq; i++) w[Q + i] = q[i];
      for (let i = 0; i < n; i++) w[V + i] = v[i];
      run.position();
      run.velocity();
      run.look();
      const part = (name) => w.subarray(place(name), place(name) + about.outputs[name][1]);
      return { bodies: part("bodies"), joints: part("joints"), energy: part("energy") };
    },
  };
}
