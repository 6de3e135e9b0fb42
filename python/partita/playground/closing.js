// Closing the loops: Newton's method on the dependent coordinates at the end of a step, damped steps of all coordinates
// where a parameter was changed, and messages about loops that do not close.

// Conditions that are violated by less are met. Scale: size of the row. Reason: the accuracy required of whole runs.
const CLOSED_IN_RUN = 1e-9;
// Moves by a matrix of this position that are shorter are the last. Scale: characteristic displacement. Reason: what is left is their square.
const LAST_FRESH_MOVE = 1e-8;
// Moves by factors of another position that are shorter are the last. Scale: characteristic displacement. Reason: each leaves a twentieth at most.
const LAST_MOVE = 1e-11;
// Moves that are shorter change nothing. Scale: characteristic displacement. Reason: some hundred units in the last place.
const STANDING = 1e-13;
// Loops are closed by all coordinates if the squares of their errors are less together. Scale: size of the row, squared. Reason: rounding.
const CLOSED_SQUARED = 1e-30;
// Added to the diagonal of a symmetric matrix. Unit: fraction of its entry. Reason: rounding, so that redundant rows have a pivot.
const DIAGONAL = 1e-14;
// Damping where a matrix has no factors. Unit: fraction of the largest entries. Reason: a little above rounding.
const LEAST_DAMPING = 1e-12;
// Damping after a move that did not help. Unit: fraction of the largest entries. Reason: it is raised tenfold until one does.
const DAMPING = 1e-8;
// Less damping is none. Scale: fraction of the largest entries. Reason: a hundredth of `DAMPING`.
const NO_DAMPING = 1e-10;

function makeClosing(eq) {
  const { w, n, m, nq, C, rowStart, columns, kept, closing, holonomic, displacement, closureScale, phi, all, about, position, move } = eq;
  const mh = closing.length, right = new Float64Array(m);
  const dv = new Float64Array(n), size = new Float64Array(mh * mh), spread = new Float64Array(n);
  function closureError(list) {
    let worst = 0;
    for (const i of list) if (i < holonomic) worst = Math.max(worst, Math.abs(phi[i]) * closureScale[i]);
    return worst;
  }
  // Newton's method on the dependent coordinates; where there are conditions on rates, the least displacement instead
  function closeDependent(s, at) {
    const { dependent } = eq;
    let before = Infinity, settled = false;
    for (let step = 0; step < 12; step++) {
      position(s, at);
      const open = closureError(closing);
      if (settled || !(open < 1e3)) return open;
      let fresh = true;
      if (mh === m) {
        // the factors of the first step serve as long as it closes quickly
        fresh = !(open < 0.05 * before);
        if (fresh && !eq.factor()) return Infinity;
        for (let r = 0; r < m; r++) right[r] = -phi[kept[r]];
        eq.elimination.solve(right);
        dv.fill(0);
        for (let r = 0; r < m; r++) dv[dependent[r]] = right[eq.elimination.rowOf[r]];
      } else if (!least(dependent, 0)) {
        return open;
      }
      before = open;
      let far = 0;
      for (let i = 0; i < n; i++) far = Math.max(far, Math.abs(dv[i]) / displacement[i]);
      move(at, dv);
      // with the matrix at this position the next residual is the square of this one
      settled = far < (fresh ? LAST_FRESH_MOVE : LAST_MOVE);
    }
    position(s, at);
    return closureError(closing);
  }
  // dv = -S^2 C^T (C S^2 C^T + damping)^-1 Phi over some velocities, S the characteristic displacements
  function least(which, damping) {
    const weight = (j) => displacement[j] * displacement[j];
    spread.fill(0);
    dv.fill(0);
    for (const j of which) dv[j] = weight(j);
    for (let r = 0; r < mh; r++) {
      const [r0, r1] = [rowStart[closing[r]], rowStart[closing[r] + 1]];
      for (let e = r0; e < r1; e++) spread[columns[e]] = w[C + e] * dv[columns[e]];
      for (let p = 0; p <= r; p++) {
        let z = 0;
        for (let e = rowStart[closing[p]]; e < rowStart[closing[p] + 1]; e++) z += w[C + e] * spread[columns[e]];
        size[r * mh + p] = z * closureScale[closing[r]] * closureScale[closing[p]];
      }
      for (let e = r0; e < r1; e++) spread[columns[e]] = 0;
      size[r * mh + r] += damping + DIAGONAL * size[r * mh + r];
      right[r] = -phi[closing[r]] * closureScale[closing[r]];
    }
    dv.fill(0);
    if (!cholesky(size, mh)) return false;
    forward(size, mh, right);
    backward(size, mh, right);
    for (let r = 0; r < mh; r++) {
      const i = closing[r];
      for (let e = rowStart[i]; e < rowStart[i + 1]; e++) dv[columns[e]] += w[C + e] * closureScale[i] * right[r];
    }
    spread.fill(0);
    for (const j of which) spread[j] = dv[j] * weight(j);
    dv.set(spread);
    return true;
  }
  // close with all coordinates, by damped steps that never increase the closure error; returns what remains open
  function closeAll(s, at) {
    const from = new Float64Array(nq);
    const residual = () => {
      let z = 0;
      for (const i of closing) z += (phi[i] * closureScale[i]) ** 2;
      return z;
    };
    position(s, at);
    let before = residual(), damping = 0;
    for (let step = 0; step < 200 && before > CLOSED_SQUARED; step++) {
      from.set(at);
      if (!least(all, damping)) { damping = damping ? damping * 10 : LEAST_DAMPING; position(s, at); continue; }
      let far = 0;
      for (let i = 0; i < n; i++) far = Math.max(far, Math.abs(dv[i]) / displacement[i]);
      if (far > 0.3) for (let i = 0; i < n; i++) dv[i] *= 0.3 / far;
      move(at, dv);
      position(s, at);
      const now = residual();
      if (now < before) {
        const settled = now > 0.9999 * before && damping > 0;
        before = now;
        damping = damping > NO_DAMPING ? damping / 10 : 0;
        if (settled) break;
      } else {
        at.set(from);
        position(s, at);
        if (far < STANDING) break;
        damping = damping ? damping * 10 : DAMPING;
        if (damping > 1e6) break;
      }
    }
    return closureError(closing);
  }
  // closure errors by joint, drive or coupling, the worst first
  function gaps() {
    const found = new Map();
    for (let i = 0; i < holonomic; i++) {
      const { owner, angle } = about.conditions[i];
      const gap = found.get(owner) || { owner, length: 0, angle: 0, part: 0 };
      const part = Math.abs(phi[i]) * closureScale[i];
      if (!(part > CLOSED_IN_RUN)) continue;
      if (angle) gap.angle = Math.hypot(gap.angle, phi[i]); else gap.length = Math.hypot(gap.length, phi[i]);
      gap.part = Math.max(gap.part, part);
      found.set(owner, gap);
    }
    return [...found.values()].sort((x, z) => z.part - x.part);
  }

  const digits = (x) => Number(x.toPrecision(3)).toString();
  function named(list) {
    if (list.length === 0) return "nothing stands open";
    return list.slice(0, 3).map((g) => {
      const by = [];
      if (g.length > 0) by.push(`${digits(g.length)} m`);
      if (g.angle > 0) by.push(`${digits(g.angle)} rad`);
      const cut = /^joint "(.*)"$/.exec(g.owner), loop = cut && about.loops[cut[1]];
      return `${g.owner} stays open by ${by.join(" and ")}${loop ? ` (loop of ${loop.join(", ")})` : ""}`;
    }).join("; ");
  }

  return { closureError, closeDependent, closeAll, gaps, named, digits };
}
