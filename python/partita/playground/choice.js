// The choice of coordinates by the projective criterion (P4, P5): rho of each, and the best by Gram and Schmidt with pivoting.
//
//   rho_i^2 = d_i (D X D^T)^-1 d_i^T / (X^-1)_ii,  d_i row i of D^T, X the mass matrix with light links
//
// The rows of D^T, made orthonormal by the factor of D X D^T, stand for the tangential parts of unit velocities.

function makeChoice(eq) {
  const { w, n, m, k, kept, reach, opening, all, dt, light, metric, METRIC, adopt, tangent, projected, entriesOf } = eq;
  const rho = new Float64Array(n).fill(1);
  const unit = new Float64Array(n * k), length = new Float64Array(n), rest = new Float64Array(n * k), left = new Float64Array(n),
    taken = new Uint8Array(n), row = new Float64Array(k), gram = new Float64Array(k * k);
  // at the position evaluated last, after `tangent`, with M there
  function measure() {
    if (light) eq.run.metric();
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
  // any regular choice at the position evaluated last: what an elimination with the largest pivots leaves
  function anyChoice() {
    const numbers = kept.map((i) => entriesOf(i, (j) => j).map(([j, at]) => [j, w[at]]));
    const found = planElimination(m, numbers, true, [kept.map((i) => opening[i]), reach]);
    const used = found && new Set(found.pivots.map(([, j]) => j));
    if (!found || !adopt(all.filter((i) => !used.has(i)))) {
      throw new Fault(`Singular position at t = ${w[0].toPrecision(5)} s: the loops lose rank, and branches meet here.`);
    }
  }
  // with M of the position evaluated last
  function choose(known = false) {
    const { dependent, independent } = eq, first = dependent.length !== m || independent.length !== k;
    let any = first;
    if (first || (!known && !tangent()) || !measure()) {
      any = true;
      anyChoice();
      if (!measure()) throw new Fault(NO_MASS);
    }
    const best = span(null);
    if (!any && span(eq.independent).volume >= EXCHANGE * best.volume) return;
    if (!first) exchanges += 1;
    const old = eq.independent;
    if (!adopt(best.chosen) || !measure()) adopt(old);
  }

  return { rho, choose, get exchanges() { return exchanges; }, set exchanges(x) { exchanges = x; } };
}
