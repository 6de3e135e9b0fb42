// The choice of coordinates by the projective criterion (P4, P5): rho of each, and the best by Gram and Schmidt with pivoting.
//
//   rho_i^2 = d_i (D X D^T)^-1 d_i^T / (X^-1)_ii,  d_i row i of D^T, X the mass matrix with massless bodies
//
// The rows of D^T, made orthonormal by the factor of D X D^T, stand for the tangential parts of unit velocities.

// Volumes of which no choice may fall short are compared with this much to spare. Scale: logarithm. Reason: rounding of some ten lengths.
const LOG_ROUNDING = 1e-8;

function makeChoice(eq) {
  const { w, n, m, k, kept, closing, dropped, holonomic, phi, displacement, closureScale, all, massless, metric, METRIC, adopt, tangent, projected, entriesOf } = eq;
  const rho = new Float64Array(n).fill(1);
  const unit = new Float64Array(n * k), length = new Float64Array(n), rest = new Float64Array(n * k), left = new Float64Array(n),
    taken = new Uint8Array(n), gram = new Float64Array(k * k), turned = new Float64Array(k * k);
  // ln of the volume that the choice in use spans: its rows of D^T are those of the unit matrix
  let spanned = 0;
  // at the position evaluated last, after `tangent`, with M there
  function measure() {
    if (massless) eq.run.metric();
    if (!metric.factor(w, METRIC)) throw new Fault("The mass matrix is not positive definite here.");
    projected(metric, METRIC, gram);
    if (!cholesky(gram, k)) return false;
    // row j of `turned` is column j of the inverse of the factor
    for (let j = 0; j < k; j++) {
      turned[j * k + j] = 1 / gram[j * k + j];
      for (let i = j + 1; i < k; i++) {
        let z = 0;
        for (let r = j; r < i; r++) z += gram[i * k + r] * turned[j * k + r];
        turned[j * k + i] = -z / gram[i * k + i];
      }
    }
    const { start, column, value } = eq.tangents;
    unit.fill(0);
    for (let i = 0; i < n; i++) {
      const whole = metric.inverse(i), scale = 1 / Math.sqrt(whole), own = i * k;
      for (let s = start[i]; s < start[i + 1]; s++) {
        const j = column[s], f = value[s] * scale;
        for (let r = j; r < k; r++) unit[own + r] += f * turned[j * k + r];
      }
      let sum = 0;
      for (let j = 0; j < k; j++) sum += unit[own + j] * unit[own + j];
      length[i] = sum;
      rho[i] = Math.min(1, Math.sqrt(sum));
    }
    spanned = 0;
    eq.independent.forEach((i, j) => { spanned += Math.log(unit[i * k + j]); });
    return true;
  }
  // the choice with the largest volume, coordinate by coordinate; null where that is found to be less than `enough` (ln)
  function best(enough) {
    left.set(length);
    rest.set(unit);
    taken.fill(0);
    const chosen = [];
    let volume = 0;
    for (let step = 0; step < k; step++) {
      let top = -1;
      for (let i = 0; i < n; i++) if (!taken[i] && (top < 0 || left[i] > left[top] * (1 + EQUAL))) top = i;
      const norm2 = Math.max(left[top], 0), own = top * k;
      volume += Math.log(norm2) / 2;
      // the remaining rows are no longer than this one
      if (volume + (k - step - 1) * (Math.log(norm2) / 2 + LOG_ROUNDING) < enough) return null;
      chosen.push(top);
      taken[top] = 1;
      if (!(norm2 > 0)) continue;
      for (let i = 0; i < n; i++) {
        if (taken[i]) continue;
        const row = i * k;
        let z = 0;
        for (let j = 0; j < k; j++) z += rest[row + j] * rest[own + j];
        z /= norm2;
        if (z === 0) continue;
        let sum = 0;
        for (let j = 0; j < k; j++) {
          const x = rest[row + j] - z * rest[own + j];
          rest[row + j] = x;
          sum += x * x;
        }
        left[i] = sum;
      }
    }
    return volume < enough ? null : chosen.sort((x, z) => x - z);
  }
  const SWITCH_RATIO = 0.7;
  let switches = 0;
  // Any regular choice at the position evaluated last: the columns that an elimination with the largest pivots leaves.
  // Consistent redundant rows may replace those in use: which rows are redundant depends on the position.
  function anyChoice() {
    const agree = dropped.every((i) => i < holonomic && Math.abs(phi[i]) * closureScale[i] < CLOSED_IN_RUN);
    const from = agree ? [...kept, ...dropped] : [...kept], numbers = from.map((i) => entriesOf(i, (j) => j).map(([j, at]) => [j, w[at]]));
    const found = planElimination(m, numbers, true, [from.map((i) => closureScale[i]), displacement]);
    const used = found && new Set(found.pivots.map(([, j]) => j));
    const rows = found && new Set(found.pivots.map(([r]) => from[r])), closes = closing.length;
    if (!found || !adopt(all.filter((i) => !used.has(i)), dropped.length ? rows : null) || closing.length !== closes) {
      throw new Fault(`Singular position at t = ${w[0].toPrecision(5)} s: the loops lose rank, and branches meet here.`);
    }
  }
  // how regular C_D was with the rows in use when they were chosen; where it is far less, other rows are tried
  let regular = 0;
  // with M of the position evaluated last
  function choose(known = false) {
    const { dependent, independent } = eq, first = dependent.length !== m || independent.length !== k;
    let any = first;
    if (first || (!known && !tangent()) || (dropped.length > 0 && eq.regular < 0.3 * regular) || !measure()) {
      any = true;
      anyChoice();
      if (!measure()) throw new Fault(NO_MASS);
    }
    const chosen = best(any ? -Infinity : spanned - Math.log(SWITCH_RATIO));
    if (!chosen) return;
    const old = eq.independent;
    if (!first && chosen.some((i, j) => i !== independent[j])) switches += 1;
    if (!adopt(chosen) || !measure()) adopt(old);
    regular = eq.regular;
  }

  return { rho, choose, get switches() { return switches; }, set switches(x) { switches = x; } };
}
