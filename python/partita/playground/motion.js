// The motion of a mechanism, computed from the recorded program of its equations.
//
//   (S1) M v' = h + C^T lambda   (S2) q' = N v   (S3) Phi = 0   (S4) C v + a = 0   (S5) C v' + b = 0
//
// The state is (q, v_I): all coordinates, and the velocities chosen to be independent. Of the others
//   v_D = A v_I + eta,  A = -C_D^-1 C_I,  eta = -C_D^-1 a        (P1, P2)
//   M_d = D M D^T,      h_d = D (h - M [0; xi])                   (P3)
// Steps are those of Dormand and Prince, of order 5, with control of their error; at the end of each the dependent
// coordinates are closed by Newton's method, and the choice is looked at.

function makeMotion(program, about) {
  const w = new Float64Array(about.work);
  const run = program(w);
  const nq = about.coordinates, n = about.velocities, rows = about.rows, holonomic = about.holonomic;
  const kept = [];
  for (let i = 0; i < rows; i++) if (!about.dropped.includes(i)) kept.push(i);
  const m = kept.length, k = n - m;
  const closing = kept.filter((i) => i < holonomic), mh = closing.length;
  const place = (name) => about.outputs[name][0];
  const PHI = place("phi"), C = place("c"), A = place("a"), B = place("b"), MASS = place("mass"), H = place("h"),
    METRIC = place("metric");
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
  const c = new Float64Array(rows * n), lu = new Float64Array(m * m), pivot = new Int32Array(m);
  const dt = new Float64Array(n * k), md = new Float64Array(k * k), hd = new Float64Array(k);
  const gamma = new Float64Array(n), xi = new Float64Array(n), right = new Float64Array(m), force = new Float64Array(n);
  const mass = new Float64Array(n * n), ny = nq + k;
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
    for (let i = 0; i < holonomic; i++) phi[i] = w[PHI + i];
    for (let i = 0; i < rows; i++) a[i] = w[A + i];
    c.fill(0);
    for (let i = 0; i < rows; i++) {
      for (let e = about.row_start[i]; e < about.row_start[i + 1]; e++) c[i * n + about.columns[e]] = w[C + e];
    }
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
  function symmetric(from, out) {
    for (let i = 0, e = from; i < n; i++) for (let j = 0; j <= i; j++, e++) out[i * n + j] = out[j * n + i] = w[e];
  }

  // ---- dense kernels
  // L U of an (m x m) matrix, rows exchanged; the ratio of its smallest to its largest pivot
  function factor() {
    let small = Infinity, large = 0;
    for (let j = 0; j < m; j++) {
      let best = j;
      for (let i = j + 1; i < m; i++) if (Math.abs(lu[i * m + j]) > Math.abs(lu[best * m + j])) best = i;
      pivot[j] = best;
      if (best !== j) {
        for (let l = 0; l < m; l++) {
          const x = lu[j * m + l];
          lu[j * m + l] = lu[best * m + l];
          lu[best * m + l] = x;
        }
      }
      const p = lu[j * m + j], size = Math.abs(p);
      if (!(size > 0)) return 0;
      small = Math.min(small, size);
      large = Math.max(large, size);
      for (let i = j + 1; i < m; i++) {
        const f = lu[i * m + j] / p;
        if (f === 0) continue;
        lu[i * m + j] = f;
        for (let l = j + 1; l < m; l++) lu[i * m + l] -= f * lu[j * m + l];
      }
    }
    return m === 0 ? 1 : small / large;
  }
  function solve(x) {
    for (let j = 0; j < m; j++) {
      const p = pivot[j], z = x[p];
      if (p !== j) { x[p] = x[j]; x[j] = z; }
    }
    for (let i = 0; i < m; i++) {
      let z = x[i];
      for (let j = 0; j < i; j++) z -= lu[i * m + j] * x[j];
      x[i] = z;
    }
    for (let i = m - 1; i >= 0; i--) {
      let z = x[i];
      for (let j = i + 1; j < m; j++) z -= lu[i * m + j] * x[j];
      x[i] = z / lu[i * m + i];
    }
  }
  function cholesky(l, size) {
    for (let j = 0; j < size; j++) {
      let d = l[j * size + j];
      for (let p = 0; p < j; p++) d -= l[j * size + p] * l[j * size + p];
      if (!(d > 0)) return false;
      const root = Math.sqrt(d);
      l[j * size + j] = root;
      for (let i = j + 1; i < size; i++) {
        let z = l[i * size + j];
        for (let p = 0; p < j; p++) z -= l[i * size + p] * l[j * size + p];
        l[i * size + j] = z / root;
      }
    }
    return true;
  }
  function forward(l, size, x) {
    for (let i = 0; i < size; i++) {
      let z = x[i];
      for (let j = 0; j < i; j++) z -= l[i * size + j] * x[j];
      x[i] = z / l[i * size + i];
    }
  }
  function backward(l, size, x) {
    for (let i = size - 1; i >= 0; i--) {
      let z = x[i];
      for (let j = i + 1; j < size; j++) z -= l[j * size + i] * x[j];
      x[i] = z / l[i * size + i];
    }
  }

  // ---- P1: C_D factored, D^T
  function loadDependent() {
    for (let r = 0; r < m; r++) for (let j = 0; j < m; j++) lu[r * m + j] = c[kept[r] * n + dependent[j]];
    return factor();
  }
  function tangent() {
    if (!(loadDependent() > 1e-13)) {
      throw new Fault(`Singular position at t = ${t.toPrecision(5)} s: the loops do not single out one motion here.`);
    }
    dt.fill(0);
    for (let j = 0; j < k; j++) {
      dt[independent[j] * k + j] = 1;
      for (let r = 0; r < m; r++) right[r] = -c[kept[r] * n + independent[j]];
      solve(right);
      for (let r = 0; r < m; r++) dt[dependent[r] * k + j] = right[r];
    }
  }
  // [0; -C_D^-1 x]
  function particular(x, out) {
    for (let r = 0; r < m; r++) right[r] = -x[kept[r]];
    solve(right);
    out.fill(0);
    for (let r = 0; r < m; r++) out[dependent[r]] = right[r];
  }
  function expand(state, out) {
    particular(a, gamma);
    for (let i = 0; i < n; i++) {
      let z = gamma[i];
      for (let j = 0; j < k; j++) z += dt[i * k + j] * state[nq + j];
      out[i] = z;
    }
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
  // y' of P1 to P3
  const vHere = new Float64Array(n);
  function derivative(s, state, out) {
    position(s, state);
    tangent();
    expand(state, vHere);
    velocity(s, vHere);
    particular(b, xi);
    symmetric(MASS, mass);
    for (let i = 0; i < n; i++) {
      let f = w[H + i];
      for (let j = 0; j < n; j++) f -= mass[i * n + j] * xi[j];
      force[i] = f;
    }
    hd.fill(0);
    md.fill(0);
    for (let i = 0; i < n; i++) {
      for (let p = 0; p < k; p++) {
        const d = dt[i * k + p];
        if (d === 0) continue;
        hd[p] += d * force[i];
        for (let j = 0; j < n; j++) {
          const f = d * mass[i * n + j];
          if (f !== 0) for (let r = 0; r <= p; r++) md[p * k + r] += f * dt[j * k + r];
        }
      }
    }
    if (!cholesky(md, k)) throw new Fault("No mass moves with one of the freedoms: its acceleration is not determined.");
    forward(md, k, hd);
    backward(md, k, hd);
    turn(state, vHere, out);
    for (let j = 0; j < k; j++) out[nq + j] = hd[j];
  }

  // ---- closing
  const dv = new Float64Array(n), size = new Float64Array(m * m);
  function openness(list) {
    let worst = 0;
    for (const i of list) if (i < holonomic) worst = Math.max(worst, Math.abs(phi[i]) * opening[i]);
    return worst;
  }
  // Newton's method on the dependent coordinates; conditions on rates close nothing, so there the least move does
  function closeDependent(s, at) {
    let before = Infinity;
    for (let step = 0; step < 12; step++) {
      position(s, at);
      const open = openness(closing);
      if (!(open < 1e3)) return open;
      dv.fill(0);
      if (mh === m) {
        // the factors of the first step serve as long as it closes quickly
        if (!(open < 0.05 * before) && !(loadDependent() > 1e-13)) return open;
        for (let r = 0; r < m; r++) right[r] = -phi[kept[r]];
        solve(right);
        for (let r = 0; r < m; r++) dv[dependent[r]] = right[r];
      } else if (!least(dependent, 0)) {
        return open;
      }
      before = open;
      let far = 0;
      for (let i = 0; i < n; i++) far = Math.max(far, Math.abs(dv[i]) / reach[i]);
      move(at, dv);
      if (far < 1e-11) {
        position(s, at);
        return openness(closing);
      }
    }
    position(s, at);
    return openness(closing);
  }
  // dv = -S^2 C^T (C S^2 C^T + damping)^-1 Phi over some velocities, S the reaches
  function least(which, damping) {
    for (let r = 0; r < mh; r++) {
      for (let p = 0; p <= r; p++) {
        let z = 0;
        for (const j of which) {
          z += c[closing[r] * n + j] * c[closing[p] * n + j] * reach[j] * reach[j];
        }
        size[r * mh + p] = z * opening[closing[r]] * opening[closing[p]];
      }
      size[r * mh + r] += damping + 1e-14 * size[r * mh + r];
      right[r] = -phi[closing[r]] * opening[closing[r]];
    }
    if (!cholesky(size, mh)) return false;
    forward(size, mh, right);
    backward(size, mh, right);
    dv.fill(0);
    for (const j of which) {
      let z = 0;
      for (let r = 0; r < mh; r++) z += c[closing[r] * n + j] * opening[closing[r]] * right[r];
      dv[j] = z * reach[j] * reach[j];
    }
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

  // ---- the projective criterion (P4, P5): rho, and the choice by Cholesky with diagonal pivoting
  const metric = new Float64Array(n * n), wide = new Float64Array(Math.max(1, m) * n), inner = new Float64Array(m * m),
    tangential = new Float64Array(n * n), column = new Float64Array(Math.max(n, 1)), length = new Float64Array(n);
  function measure() {
    run.velocity();
    run.metric();
    symmetric(METRIC, metric);
    if (!cholesky(metric, n)) throw new Fault("The mass matrix is not positive definite here.");
    // columns of L^-1 and of L^-1 C^T: M^-1 = L^-T L^-1
    for (let r = 0; r < m; r++) {
      for (let i = 0; i < n; i++) column[i] = c[kept[r] * n + i];
      forward(metric, n, column);
      for (let i = 0; i < n; i++) wide[r * n + i] = column[i];
    }
    for (let r = 0; r < m; r++) {
      for (let p = 0; p <= r; p++) {
        let z = 0;
        for (let i = 0; i < n; i++) z += wide[r * n + i] * wide[p * n + i];
        inner[r * m + p] = z;
      }
    }
    const regular = cholesky(inner, m);
    // orthonormal rows
    for (let r = 0; regular && r < m; r++) {
      for (let p = 0; p < r; p++) {
        const f = inner[r * m + p];
        if (f !== 0) for (let i = 0; i < n; i++) wide[r * n + i] -= f * wide[p * n + i];
      }
      for (let i = 0; i < n; i++) wide[r * n + i] /= inner[r * m + r];
    }
    // unit vectors e_i as columns of L^-1, less their part along the rows
    for (let i = 0; i < n; i++) {
      column.fill(0);
      column[i] = 1;
      forward(metric, n, column);
      let whole = 0;
      for (let j = 0; j < n; j++) whole += column[j] * column[j];
      if (regular) {
        for (let r = 0; r < m; r++) {
          let z = 0;
          for (let j = 0; j < n; j++) z += wide[r * n + j] * column[j];
          if (z !== 0) for (let j = 0; j < n; j++) column[j] -= z * wide[r * n + j];
        }
      }
      let left = 0;
      for (let j = 0; j < n; j++) {
        tangential[i * n + j] = column[j] / Math.sqrt(whole);
        left += column[j] * column[j];
      }
      length[i] = left / whole;
      rho[i] = Math.min(1, Math.sqrt(length[i]));
    }
    return regular;
  }
  // the volume that a choice spans, by Gram and Schmidt; `wanted` null: the best, one after the other
  function span(wanted) {
    const left = Float64Array.from(length), rowsOf = Float64Array.from(tangential), chosen = [];
    let volume = 1;
    for (let step = 0; step < k; step++) {
      let best = -1;
      if (wanted) best = wanted[step];
      else for (let i = 0; i < n; i++) if (!chosen.includes(i) && (best < 0 || left[i] > left[best] * (1 + 1e-9))) best = i;
      const norm = Math.sqrt(Math.max(left[best], 0));
      volume *= norm;
      chosen.push(best);
      if (!(norm > 0)) continue;
      for (let i = 0; i < n; i++) {
        if (i === best) continue;
        let z = 0;
        for (let j = 0; j < n; j++) z += rowsOf[i * n + j] * rowsOf[best * n + j];
        z /= norm * norm;
        if (z === 0) continue;
        let rest = 0;
        for (let j = 0; j < n; j++) {
          rowsOf[i * n + j] -= z * rowsOf[best * n + j];
          rest += rowsOf[i * n + j] ** 2;
        }
        left[i] = rest;
      }
      left[best] = 0;
      rowsOf.fill(0, best * n, best * n + n);
    }
    return { chosen: chosen.sort((x, z) => x - z), volume };
  }
  const EXCHANGE = 0.7;
  let exchanges = 0;
  function choose() {
    if (!measure()) {
      throw new Fault(`Singular position at t = ${t.toPrecision(5)} s: the loops lose rank, and branches meet here.`);
    }
    const best = span(null);
    if (dependent.length === m && independent.length === k) {
      if (span(independent).volume >= EXCHANGE * best.volume) return;
      exchanges += 1;
    }
    independent = best.chosen;
    dependent = all.filter((i) => !independent.includes(i));
  }
  // rates that satisfy S4 next to v, in the independent coordinates
  function settle() {
    position(t, q);
    choose();
    tangent();
    for (let i = 0; i < nq; i++) y[i] = q[i];
    for (let j = 0; j < k; j++) y[nq + j] = v[independent[j]];
    expand(y, v);
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
  // `deadline` [ms of the page]: where it is passed, the rest is left out, and the mechanism runs slower than asked
  function advance(until, deadline = Infinity) {
    let refused = 0;
    while (t < until) {
      if (deadline < Infinity && performance.now() > deadline) return;
      const rest = until - t;
      if (!(h > 0)) h = Math.min(rest, 1e-3);
      const step = h >= rest * (1 - 1e-9) ? rest : h;
      derivative(t, y, stage[0]);
      for (let i = 1; i < 7; i++) {
        for (let j = 0; j < ny; j++) {
          let z = 0;
          for (let l = 0; l < i; l++) z += weights[i][l] * stage[l][j];
          trial[j] = y[j] + step * z;
        }
        if (i === 6) y1.set(trial);
        derivative(t + nodes[i] * step, trial, stage[i]);
      }
      let error = 0;
      for (let j = 0; j < ny; j++) {
        let z = 0;
        for (let l = 0; l < 7; l++) z += errors[l] * stage[l][j];
        const scale = accuracy.absolute * typical(j) + accuracy.relative * Math.max(Math.abs(y[j]), Math.abs(y1[j]));
        error = Math.max(error, Math.abs(step * z) / scale);
      }
      if (!(error <= 1)) {
        refused += 1;
        h = step * (error > 0 && error < Infinity ? Math.max(0.2, 0.9 * error ** -0.2) : 0.1);
        if (h < 1e-12 * Math.max(1, Math.abs(t)) || refused > 200) {
          throw new Fault(`The step became too small at t = ${t.toPrecision(5)} s.`);
        }
        continue;
      }
      refused = 0;
      normalise(y1);
      for (let i = 0; i < nq; i++) q[i] = y1[i];
      const open = closeDependent(t + step, q);
      if (!(open < 1e-8)) {
        throw new Fault(`The loops cannot be kept closed at t = ${t.toPrecision(5)} s: ${told(gaps())}.`);
      }
      if (openness(about.dropped) > about.loose) {
        throw new Fault(`A condition that was redundant as drawn is not with these lengths: ${told(gaps())}.`);
      }
      t = step === rest ? until : t + step;
      for (let i = 0; i < nq; i++) y[i] = q[i];
      for (let j = 0; j < k; j++) y[nq + j] = y1[nq + j];
      tangent();
      expand(y, v);
      steps += 1;
      if (n <= 24 || steps % 8 === 0) settle();
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
      return `${g.owner} stays open by ${by.join(" and ")}`;
    }).join("; ");
  }
  function put(name, values) {
    const [at, count] = about.parameters[name];
    for (let i = 0; i < count; i++) w[at + i] = values[i];
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
    choose() { position(t, q); measure(); },
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
