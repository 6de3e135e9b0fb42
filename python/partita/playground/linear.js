// Linear algebra for the page: sparse elimination that is planned once and then followed, and small dense kernels.

// Rows of a sparse (m x columns) matrix are lists of [column, value]; `scale` [rows], [columns] makes entries comparable.
// Picks m pivots and returns the order, the fill and each operation; null where fewer than m can be found.
//   careful   the largest entry of all, which shows the rank; else of those at most ten times smaller than the largest of
//             their column the one that fills least
// Pivots below this are lost. Scale: fraction of the first. Reason: a hundred thousand roundings.
const LOST_PIVOT = 1e-11;

function planElimination(m, rows, careful, scale) {
  const active = rows.map((list) => new Map(list)), left = new Set(active.keys()), pivots = [];
  const touches = new Map();
  active.forEach((row, r) => row.forEach((_, j) => touches.set(j, (touches.get(j) || new Set()).add(r))));
  const multipliers = [], width = Int32Array.from(active, (row) => row.size);
  let first = 0;
  for (let step = 0; step < m; step++) {
    let best = null, least = Infinity, largest = 0;
    const looked = (r) => {
      for (const [j, x] of active[r]) {
        const over = touches.get(j), size = Math.abs(x);
        if (!over || !(size > 0)) continue;
        if (careful) {
          const scaled = size * scale[0][r] * scale[1][j];
          if (scaled > largest) { largest = scaled; best = [r, j]; }
          continue;
        }
        const fill = (width[r] - 1) * (over.size - 1);
        if (fill > least || (fill === least && size <= largest)) continue;
        let top = 0;
        for (const i of over) top = Math.max(top, Math.abs(active[i].get(j)));
        if (size >= 0.1 * top) { least = fill; largest = size; best = [r, j]; }
      }
    };
    // the shortest rows fill least; the others are tried only where these have no pivot
    let short = Infinity, asked = 0;
    for (const r of left) short = Math.min(short, width[r]);
    if (!careful) for (const r of left) if (width[r] <= short + 1 && asked++ < 12) looked(r);
    if (!best) left.forEach(looked);
    if (!best) return null;
    if (careful) {
      first = first || largest;
      if (largest < LOST_PIVOT * first) return null;
    }
    const [r, j] = best, pivot = active[r].get(j), below = [];
    left.delete(r);
    touches.get(j).delete(r);
    for (const i of touches.get(j)) {
      const f = active[i].get(j) / pivot;
      below.push(i);
      width[i] -= 1;
      for (const [l, x] of active[r]) {
        if (l === j || !touches.has(l)) continue;
        if (!active[i].has(l)) width[i] += 1;
        active[i].set(l, (active[i].get(l) || 0) - f * x);
        touches.get(l).add(i);
      }
    }
    touches.delete(j);
    for (const [l] of active[r]) if (touches.has(l)) touches.get(l).delete(r);
    pivots.push([r, j]);
    multipliers.push(below);
  }
  return { pivots, multipliers, rows: active.map((row) => [...row.keys()]) };
}

// L U of the square part of a sparse matrix along a plan, and solutions with one and with many right-hand sides.
//   entries   of each row: [column, index of its number in w]; columns from 0 to m - 1 are eliminated, those from m on are
//             right-hand sides
function makeElimination(m, entries, w) {
  const load = entries.map((list) => list.filter(([j]) => j < m)), sides = entries.map((list) => list.filter(([j]) => j >= m));
  const plan = planElimination(m, load.map((list) => list.map(([j, at]) => [j, w[at]])), false, null);
  if (!plan) return null;
  const slot = new Map(), key = (r, j) => r * m + j;
  plan.rows.forEach((row, r) => row.forEach((j) => slot.set(key(r, j), slot.size)));
  const values = new Float64Array(slot.size);
  const to = [], from = [];
  load.forEach((list, r) => list.forEach(([j, at]) => { to.push(slot.get(key(r, j))); from.push(at); }));
  const To = Int32Array.from(to), From = Int32Array.from(from);
  const step = new Int32Array(m);
  plan.pivots.forEach(([, j], p) => { step[j] = p; });
  const pivotRow = Int32Array.from(plan.pivots, ([r]) => r), pivotAt = Int32Array.from(plan.pivots, ([r, j]) => slot.get(key(r, j)));
  // for each pivot the entries to its right, the rows below, and what is subtracted from what
  const upperStart = [0], upperAt = [], upperRow = [], lowerStart = [0], lowerAt = [], lowerRow = [], target = [];
  plan.pivots.forEach(([r, j], p) => {
    const right = plan.rows[r].filter((l) => step[l] > p);
    for (const l of right) { upperAt.push(slot.get(key(r, l))); upperRow.push(pivotRow[step[l]]); }
    upperStart.push(upperAt.length);
    for (const i of plan.multipliers[p]) {
      lowerAt.push(slot.get(key(i, j)));
      lowerRow.push(i);
      for (const l of right) target.push(slot.get(key(i, l)));
    }
    lowerStart.push(lowerAt.length);
  });
  const [uStart, uAt, uRow, lStart, lAt, lRow, Target] = [upperStart, upperAt, upperRow, lowerStart, lowerAt, lowerRow, target]
    .map((list) => Int32Array.from(list));
  // which right-hand sides reach a row on the way down, and on the way up
  const union = (into, more) => more.forEach((x) => into.add(x));
  const reached = sides.map((list) => new Set(list.map(([j]) => j - m)));
  const down = [];
  plan.pivots.forEach(([r], p) => {
    down.push([...reached[r]].sort((x, y) => x - y));
    for (const i of plan.multipliers[p]) union(reached[i], reached[r]);
  });
  for (let p = m - 1; p >= 0; p--) for (let e = uStart[p]; e < uStart[p + 1]; e++) union(reached[pivotRow[p]], reached[uRow[e]]);
  const concatenated = (lists) => {
    const start = new Int32Array(lists.length + 1);
    lists.forEach((list, i) => { start[i + 1] = start[i] + list.length; });
    return [start, Int32Array.from(lists.flat())];
  };
  const [downStart, downOf] = concatenated(down), [upStart, upOf] = concatenated(plan.pivots.map(([r]) => [...reached[r]].sort((x, y) => x - y)));
  const sideRow = [], sideOf = [], sideFrom = [];
  sides.forEach((list, r) => list.forEach(([j, at]) => { sideRow.push(r); sideOf.push(j - m); sideFrom.push(at); }));

  // the signs of all pivots together: that of the determinant, up to one that the plan fixes
  let sign = 1, steep = 0;
  // the ratio of the smallest to the largest pivot; 0 where the plan no longer serves or the matrix is singular
  function factor() {
    values.fill(0);
    for (let e = 0; e < To.length; e++) values[To[e]] = w[From[e]];
    let small = Infinity, large = 0, next = 0;
    sign = 1;
    steep = 0;
    for (let p = 0; p < m; p++) {
      const pivot = values[pivotAt[p]], size = Math.abs(pivot), u0 = uStart[p], u1 = uStart[p + 1];
      if (!(size > 0)) return 0;
      if (pivot < 0) sign = -sign;
      if (size < small) small = size;
      if (size > large) large = size;
      for (let l = lStart[p]; l < lStart[p + 1]; l++) {
        const f = values[lAt[l]] / pivot;
        values[lAt[l]] = f;
        if (f > steep) steep = f; else if (-f > steep) steep = -f;
        for (let u = u0; u < u1; u++) values[Target[next++]] -= f * values[uAt[u]];
      }
    }
    return m === 0 ? 1 : small / large;
  }
  // x, by rows, becomes the solution: the unknown of column j is at the row of its pivot
  function solve(x) {
    for (let p = 0; p < m; p++) {
      const z = x[pivotRow[p]];
      if (z !== 0) for (let l = lStart[p]; l < lStart[p + 1]; l++) x[lRow[l]] -= values[lAt[l]] * z;
    }
    for (let p = m - 1; p >= 0; p--) {
      let z = x[pivotRow[p]];
      for (let u = uStart[p]; u < uStart[p + 1]; u++) z -= values[uAt[u]] * x[uRow[u]];
      x[pivotRow[p]] = z / values[pivotAt[p]];
    }
  }
  // x, by unknowns at the rows of their pivots, becomes the solution of the transposed equations, by rows
  function solveTransposed(x) {
    for (let p = 0; p < m; p++) {
      const z = x[pivotRow[p]] / values[pivotAt[p]];
      x[pivotRow[p]] = z;
      for (let u = uStart[p]; u < uStart[p + 1]; u++) x[uRow[u]] -= values[uAt[u]] * z;
    }
    for (let p = m - 1; p >= 0; p--) {
      let z = x[pivotRow[p]];
      for (let l = lStart[p]; l < lStart[p + 1]; l++) z -= values[lAt[l]] * x[lRow[l]];
      x[pivotRow[p]] = z;
    }
  }
  // the same for the right-hand sides, with their sign turned, k numbers a row
  function solveSides(x, k) {
    x.fill(0);
    for (let e = 0; e < sideRow.length; e++) x[sideRow[e] * k + sideOf[e]] = -w[sideFrom[e]];
    for (let p = 0; p < m; p++) {
      const own = pivotRow[p] * k, d0 = downStart[p], d1 = downStart[p + 1];
      for (let l = lStart[p]; l < lStart[p + 1]; l++) {
        const f = values[lAt[l]], other = lRow[l] * k;
        for (let d = d0; d < d1; d++) x[other + downOf[d]] -= f * x[own + downOf[d]];
      }
    }
    for (let p = m - 1; p >= 0; p--) {
      const own = pivotRow[p] * k, pivot = values[pivotAt[p]], d0 = upStart[p], d1 = upStart[p + 1];
      for (let u = uStart[p]; u < uStart[p + 1]; u++) {
        const f = values[uAt[u]], other = uRow[u] * k;
        for (let d = d0; d < d1; d++) x[own + upOf[d]] -= f * x[other + upOf[d]];
      }
      for (let d = d0; d < d1; d++) x[own + upOf[d]] /= pivot;
    }
  }
  const rowOf = Int32Array.from({ length: m }, (_, j) => pivotRow[step[j]]);
  // of each unknown the right-hand sides that reach it
  const reaching = Array.from({ length: m }, (_, j) => [...reached[rowOf[j]]].sort((x, y) => x - y));
  const operations = Target.length + lAt.length + uAt.length + m + upOf.length + downOf.length;
  return { factor, solve, solveSides, solveTransposed, rowOf, reaching, operations, get sign() { return sign; }, get steep() { return steep; } };
}

// A symmetric positive matrix by the entries of its lower triangle that are not always 0, factored from the last row to the
// first as L^T D L: where rows follow a tree from its root that fills nothing.
function makeSymmetric(n, entries) {
  const below = Array.from({ length: n }, () => new Set());
  const row = new Int32Array(entries.length), column = new Int32Array(entries.length);
  let i = 0;
  entries.forEach((at, e) => {
    while ((i + 1) * (i + 2) / 2 <= at) i++;
    row[e] = i;
    column[e] = at - i * (i + 1) / 2;
    if (row[e] !== column[e]) below[i].add(column[e]);
  });
  for (let k = n - 1; k >= 0; k--) for (const a of below[k]) for (const b of below[k]) if (b < a) below[a].add(b);
  // columns of row k to the left of its diagonal, downwards, from start[k]
  const start = new Int32Array(n + 1), list = Int32Array.from(below.flatMap((set) => [...set].sort((x, y) => y - x)));
  below.forEach((set, k) => { start[k + 1] = start[k] + set.size; });
  const l = new Float64Array(n * n), y = new Float64Array(n);
  return {
    row, column,
    factor(w, from) {
      for (let k = 0; k < n; k++) {
        l[k * n + k] = 0;
        for (let p = start[k]; p < start[k + 1]; p++) l[k * n + list[p]] = 0;
      }
      for (let e = 0; e < row.length; e++) l[row[e] * n + column[e]] = w[from + e];
      for (let k = n - 1; k >= 0; k--) {
        const d = l[k * n + k], end = start[k + 1];
        if (!(d > 0)) return false;
        // columns run downwards, so that what is read has not been divided yet
        for (let p = start[k]; p < end; p++) {
          const a = list[p], f = l[k * n + a] / d;
          for (let r = p; r < end; r++) l[a * n + list[r]] -= f * l[k * n + list[r]];
          l[k * n + a] = f;
        }
      }
      return true;
    },
    // (M^-1)_ii
    inverse(i) {
      y.fill(0, 0, i + 1);
      y[i] = 1;
      let z = 0;
      for (let k = i; k >= 0; k--) {
        const x = y[k];
        if (x === 0) continue;
        for (let p = start[k], own = k * n; p < start[k + 1]; p++) y[list[p]] -= l[own + list[p]] * x;
        z += x * x / l[k * n + k];
      }
      return z;
    },
  };
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
