// The equations of a mechanism at one instant, from the recorded program of its equations.
//
//   (S1) M v' = h + C^T lambda   (S2) q' = N v   (S3) Phi = 0   (S4) C v + a = 0   (S5) C v' + b = 0
//
// The state is (q, v_I): all coordinates, and the velocities chosen to be independent. Of the others
//   v_D = A v_I + eta,  A = -C_D^-1 C_I,  eta = -C_D^-1 a        (P1, P2)
//   M_d = D M D^T,      h_d = D (h - M [0; xi])                   (P3)
// The work of an evaluation is in proportion to the entries of C, M and D that are not 0: they are eliminated along plans,
// each made when the choice is.

class Fault extends Error {}
// Loops whose rows are less regular have lost rank. Scale: least pivot, rows and coordinates scaled. Reason: rounding of an elimination.
const LOST_RANK = 1e-13;
// Below this the quotient of a sine by its angle is its limit. Scale: rad. Reason: the remainder, of the square, is below rounding.
const SHORT_ANGLE = 1e-8;

const NO_MASS = "No mass moves with one of the degrees of freedom: its acceleration is not determined.";

function makeEquations(run, about) {
  const w = new Float64Array(run.memory.buffer);
  const nq = about.coordinates, n = about.velocities, rows = about.rows, holonomic = about.holonomic;
  // rows in use, those of them that close loops, and those that are redundant; which is which may change in a run
  const kept = [], closing = [], dropped = [];
  function keep(chosen) {
    kept.length = closing.length = dropped.length = 0;
    for (let i = 0; i < rows; i++) (chosen.has(i) ? kept : dropped).push(i);
    for (const i of kept) if (i < holonomic) closing.push(i);
  }
  const asDrawn = new Set(Array.from({ length: rows }, (_, i) => i).filter((i) => !about.dropped.includes(i)));
  keep(asDrawn);
  const m = kept.length, k = n - m;
  const offset = (name) => about.outputs[name][0];
  const PHI = offset("phi"), C = offset("c"), A = offset("a"), B = offset("b"), H = offset("h");
  // massless bodies have mass in the metric alone
  const massless = about.outputs.metric[1] > 0, MASS = offset("mass"), METRIC = massless ? offset("metric") : MASS;
  const Q = 1, V = 1 + nq;
  const balls = [], plain = [];
  for (let i = 0; i < n;) {
    const [from, to] = about.coordinates_of[i];
    if (to - from === 4) { balls.push([from, i]); i += 3; } else { plain.push([from, i]); i += 1; }
  }
  const displacement = about.displacement, rowStart = Int32Array.from(about.row_start), columns = Int32Array.from(about.columns);
  const closureScale = about.conditions.map((c) => 1 / (c.displacement > 0 ? c.displacement : c.angle ? 1 : about.length || 1));

  let independent = [], dependent = [], evaluations = 0;
  const all = Array.from({ length: n }, (_, i) => i);
  const rates = about.drives.map((d) => ({ ...d, factor: 1, clock: 0, since: 0, shift: 0 }));
  const phi = new Float64Array(rows), a = new Float64Array(rows), b = new Float64Array(rows);
  const md = new Float64Array(k * k), hd = new Float64Array(k);
  const sides = new Float64Array(m * k), moved = new Float64Array(n * k);
  const mass = makeSymmetric(n, about.patterns.mass), metric = massless ? makeSymmetric(n, about.patterns.metric) : mass;
  const xi = new Float64Array(n), right = new Float64Array(m), force = new Float64Array(n), slope = new Float64Array(n);

  // ---- what the drives prescribe: value, rate and second derivative at time s
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
  // ---- P1: C_D factored, D^T by rows: what is not always 0 of row i stands in `dt` from dtStart[i], in the columns dtColumn
  let elimination = null;
  let dtColumn = new Int32Array(0), dt = new Float64Array(0);
  const dtStart = new Int32Array(n + 1);
  const dofIndex = new Int32Array(n).fill(-1);
  const entriesOf = (i, of) => {
    const list = [];
    for (let e = rowStart[i]; e < rowStart[i + 1]; e++) list.push([of(columns[e]), C + e]);
    return list;
  };
  function plan() {
    const columnOf = new Int32Array(n);
    dependent.forEach((j, i) => { columnOf[j] = i; });
    independent.forEach((j, i) => { columnOf[j] = m + i; });
    elimination = makeElimination(m, kept.map((i) => entriesOf(i, (j) => columnOf[j])), w);
    if (!elimination) return false;
    const over = new Array(n);
    dependent.forEach((j, i) => { over[j] = elimination.reaching[i]; });
    dofIndex.fill(-1);
    independent.forEach((j, i) => { over[j] = [i]; dofIndex[j] = i; });
    for (let i = 0; i < n; i++) dtStart[i + 1] = dtStart[i] + over[i].length;
    dtColumn = Int32Array.from(over.flat());
    dt = new Float64Array(dtColumn.length);
    for (const j of independent) dt[dtStart[j]] = 1;
    pairUp();
    wide = worthwhile();
    return true;
  }
  // The accelerations solve  [M C^T; C 0] [v'; -lambda] = [h; -b]  as well, sparse however many degrees of freedom there are: taken
  // where that costs less than D M D^T. The order of its elimination does not depend on the choice.
  let whole = null, wide = false;
  function worthwhile() {
    let projection = elimination.operations + k * k * k / 6;
    const over = (i) => dtStart[i + 1] - dtStart[i];
    for (let e = 0; e < mass.row.length; e++) projection += over(mass.row[e]) + over(mass.column[e]);
    projection += dt.length * k / 2;
    if (massless || projection < 10000) return false;
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
  let regular = 1;
  // false where C_D is singular; a plan whose pivots have become small is replaced
  function factor() {
    if (!elimination && !plan()) return false;
    regular = elimination.factor();
    if (!(regular > LOST_RANK && elimination.steep < 1e3)) regular = plan() ? elimination.factor() : 0;
    return regular > LOST_RANK;
  }
  function tangent() {
    if (!factor()) return false;
    elimination.solveSides(sides, k);
    for (let r = 0; r < m; r++) {
      const at = elimination.rowOf[r] * k, i = dependent[r];
      for (let s = dtStart[i]; s < dtStart[i + 1]; s++) dt[s] = sides[at + dtColumn[s]];
    }
    return true;
  }
  // these coordinates become independent, and these rows are used; false where C_D is singular with them
  function adopt(chosen, used = null) {
    if (used) {
      keep(used);
      whole = null;
    }
    independent = chosen;
    const free = new Set(chosen);
    dependent = all.filter((i) => !free.has(i));
    elimination = null;
    return tangent();
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
      for (let e = rowStart[i]; e < rowStart[i + 1]; e++) {
        const f = dofIndex[columns[e]];
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
      const s = angle > SHORT_ANGLE ? Math.sin(angle / 2) / angle : 0.5, r = Math.cos(angle / 2);
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
  // P3: the lower triangle of D X D^T of a symmetric X. Where rows of D^T are short that of M is the sum of products
  //   out[pair.to] += w[pair.entry] dt[pair.first] dt[pair.second], those from pair.twice on twice
  let pair = null;
  function pairUp() {
    let count = 0, parts = (n + dt.length / 2) * k;
    for (let e = 0; e < mass.row.length; e++) {
      const i = mass.row[e], j = mass.column[e], p = dtStart[i + 1] - dtStart[i], r = dtStart[j + 1] - dtStart[j];
      count += p * r;
      parts += p + r;
    }
    pair = null;
    if (count > parts) return;
    const once = [], twice = [];
    for (let e = 0; e < mass.row.length; e++) {
      const i = mass.row[e], j = mass.column[e];
      for (let s = dtStart[i]; s < dtStart[i + 1]; s++) {
        for (let u = dtStart[j]; u < dtStart[j + 1]; u++) {
          const p = dtColumn[s], r = dtColumn[u];
          if (i === j && p < r) continue;
          (i !== j && p === r ? twice : once).push([Math.max(p, r) * k + Math.min(p, r), MASS + e, s, u]);
        }
      }
    }
    const column = (c) => Int32Array.from([...once, ...twice], (one) => one[c]);
    pair = { to: column(0), entry: column(1), first: column(2), second: column(3), twice: once.length };
  }
  function projected(x, from, out) {
    out.fill(0);
    if (pair && from === MASS) {
      const { to, entry, first, second, twice } = pair;
      for (let e = 0; e < twice; e++) out[to[e]] += w[entry[e]] * dt[first[e]] * dt[second[e]];
      for (let e = twice; e < to.length; e++) out[to[e]] += 2 * w[entry[e]] * dt[first[e]] * dt[second[e]];
      return;
    }
    moved.fill(0);
    for (let e = 0; e < x.row.length; e++) {
      const i = x.row[e], j = x.column[e], z = w[from + e];
      for (let s = dtStart[j]; s < dtStart[j + 1]; s++) moved[i * k + dtColumn[s]] += z * dt[s];
      if (i !== j) for (let s = dtStart[i]; s < dtStart[i + 1]; s++) moved[j * k + dtColumn[s]] += z * dt[s];
    }
    for (let i = 0; i < n; i++) {
      for (let s = dtStart[i]; s < dtStart[i + 1]; s++) {
        const p = dtColumn[s], d = dt[s], to = p * k, from = i * k;
        for (let r = 0; r <= p; r++) out[to + r] += d * moved[from + r];
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
    for (let i = 0; i < n; i++) for (let s = dtStart[i]; s < dtStart[i + 1]; s++) hd[dtColumn[s]] += dt[s] * force[i];
    projected(mass, MASS, md);
    if (!cholesky(md, k)) throw new Fault(NO_MASS);
    forward(md, k, hd);
    backward(md, k, hd);
    for (let j = 0; j < k; j++) out[nq + j] = hd[j];
    for (let i = 0; i < n; i++) {
      slope[i] = xi[i];
      for (let s = dtStart[i]; s < dtStart[i + 1]; s++) slope[i] += dt[s] * hd[dtColumn[s]];
    }
  }
  // R1 for the accelerations computed last, by rows; those of redundant rows are 0
  function multipliers(out) {
    out.fill(0);
    if (wide) {
      for (let r = 0; r < m; r++) out[kept[r]] = -both[whole.rowOf[n + r]];
      return;
    }
    for (let i = 0; i < n; i++) force[i] = -w[H + i];
    for (let e = 0; e < mass.row.length; e++) {
      const i = mass.row[e], j = mass.column[e], z = w[MASS + e];
      force[i] += z * slope[j];
      if (i !== j) force[j] += z * slope[i];
    }
    balanced(force, out);
  }
  // C_D^T x = force_D over the rows in use
  function balanced(load, out) {
    for (let r = 0; r < m; r++) right[elimination.rowOf[r]] = load[dependent[r]];
    elimination.solveTransposed(right);
    for (let r = 0; r < m; r++) out[kept[r]] = right[r];
  }
  // a self-stress: 1 on a redundant row, balanced by the rows in use
  function balance(row, out) {
    force.fill(0);
    for (let e = rowStart[row]; e < rowStart[row + 1]; e++) force[columns[e]] = -w[C + e];
    out.fill(0);
    balanced(force, out);
    out[row] = 1;
  }

  return {
    run, about, w, nq, n, m, k, rows, holonomic, kept, closing, dropped, balls, plain, displacement, closureScale, all, rates,
    rowStart, columns, phi, mass, metric, massless, slope, C, METRIC,
    position, velocity, multipliers, balance, entriesOf, factor, tangent, evaluated, adopt, expand, derivative, accelerate, projected, move, normalise,
    // row i of D^T: columns and values from start[i] to start[i + 1]
    get tangents() { return { start: dtStart, column: dtColumn, value: dt }; },
    forget() {
      independent = dependent = [];
      keep(asDrawn);
      whole = null;
    },
    get independent() { return independent; },
    get dependent() { return dependent; },
    get evaluations() { return evaluations; },
    get elimination() { return elimination; },
    // how regular C_D is: its smallest pivot in parts of the largest
    get regular() { return regular; },
    // whether accelerations are taken from the sparse system of multipliers, which needs no D
    get wide() { return wide; },
  };
}
