// The motion of a mechanism: its state, steps in time, and what users change meanwhile.
//
// Steps are those of Dormand and Prince with error control: of order 5, and of order 8 where a long time is asked for at
// once. At the end of each the dependent coordinates are closed by Newton's method, and the choice is examined.

// Relative tolerance of steps. Scale: fraction of what is integrated. Reason: that of runs.
const RTOL = 1e-8;
// Absolute tolerance of steps. Scale: characteristic displacement. Reason: that of runs.
const ATOL = 1e-10;
// First step after a change. Unit: s. Reason: a page knows nothing else of a motion, and errors correct it at once.
const FIRST_STEP = 1e-3;
// Shorter steps end a motion. Scale: s, and the time. Reason: some thousand units in the last place of the time.
const LEAST_STEP = 1e-12;
// Smaller errors of a step let it grow no more. Scale: tolerance. Reason: a step grows fivefold at most.
const LEAST_ERROR = 1e-10;
// A step whose loops are violated by more is refused. Scale: size of the row. Reason: ten times what is met.
const OPEN = 1e-8;
// Relative tolerance of a step across a place where branches meet. Scale: fraction of what is integrated. Reason: rates lose digits there.
const NEAR_BRANCHES = 1e-11;
// A step that loses more regularity ends too near to where branches meet. Scale: that before the step. Reason: three digits of rates are lost.
const LESS_REGULAR = 1e-3;
// Parameters are reached where loops are violated by less. Scale: size of the row. Reason: a tenth of what is met.
const REACHED = 1e-10;
// Changes of parameters are not divided further. Scale: fraction of the change. Reason: a thousand positions on the way.
const LEAST_PART = 1e-3;

function makeMotion(run, about) {
  const eq = makeEquations(run, about), { closureError, closeDependent, closeAll, gaps, named, digits } = makeClosing(eq);
  const choice = makeChoice(eq), { rho, choose } = choice, reactionsOf = makeReactions(eq);
  const { w, nq, n, k, plain, displacement, rates, closing, position, velocity, expand, derivative, accelerate, evaluated, normalise } = eq;
  const ny = nq + k;

  let t = 0;
  const q = new Float64Array(nq), v = new Float64Array(n);
  const stage = Array.from({ length: ORDER8.nodes.length }, () => new Float64Array(ny));
  const y = new Float64Array(ny), y1 = new Float64Array(ny), trial = new Float64Array(ny);

  // rates that satisfy S4 next to v, in the independent coordinates; all levels at (t, q, v)
  function settle() {
    position(t, q);
    velocity(t, v);
    choose();
    for (let i = 0; i < nq; i++) y[i] = q[i];
    for (let j = 0; j < k; j++) y[nq + j] = v[eq.independent[j]];
    expand(y, v);
    velocity(t, v);
    ready = true;
    ahead = Infinity;
    past.plan = null;
  }

  // ---- steps
  let h = 0, steps = 0;
  // a large move of an entry of the state: 1 for an angle, a length for a slide
  const sizes = new Float64Array(nq).fill(1);
  for (const [i, j] of plain) sizes[i] = displacement[j];
  const typical = (j) => (j < nq ? sizes[j] : displacement[eq.independent[j - nq]]);
  const accuracy = { relative: RTOL, absolute: ATOL };
  const closed = new Float64Array(nq), next = new Float64Array(n), first = new Float64Array(n);
  // whether all levels have been evaluated at the state
  let ready = false, regularBefore = 1;
  const costly = n * k * k > 20000;
  const sum = new Float64Array(ny);
  // the first slopes, each times its factor
  function combined(factors) {
    sum.fill(0);
    for (let l = 0; l < factors.length; l++) {
      const f = factors[l], from = stage[l];
      if (f !== 0) for (let j = 0; j < ny; j++) sum[j] += f * from[j];
    }
  }
  // one step; the estimate of its error in parts of the tolerance, infinite where the choice became singular within it
  function attempt(step) {
    if (ready) accelerate(y, v, stage[0]);
    else if (!derivative(t, y, stage[0])) return Infinity;
    ready = false;
    regularBefore = eq.regular;
    first.set(eq.slope);
    const { nodes, weights, end, estimate } = method;
    for (let i = 1; i < nodes.length; i++) {
      combined(weights[i]);
      for (let j = 0; j < ny; j++) trial[j] = y[j] + step * sum[j];
      if (!derivative(t + nodes[i] * step, trial, stage[i])) return Infinity;
    }
    combined(end);
    for (let j = 0; j < ny; j++) y1[j] = y[j] + step * sum[j];
    const [error, other] = estimate.map((factors) => {
      let worst = 0;
      combined(factors);
      for (let j = 0; j < ny; j++) {
        const scale = accuracy.absolute * typical(j) + accuracy.relative * Math.max(Math.abs(y[j]), Math.abs(y1[j]));
        worst = Math.max(worst, Math.abs(step * sum[j]) / scale);
      }
      return worst;
    });
    // NaN where a stage was NaN
    if (other === undefined || error === 0) return error;
    return error * error / Math.hypot(error, 0.1 * other);
  }
  // Steps pass over singular positions, where branches meet. On its branch a motion has rates that follow from those before
  // it; on another one they jump, however small the step. `next` against the rates and accelerations at its start.
  function jumps(step) {
    let off = 0, whole = 0;
    for (let i = 0; i < n; i++) {
      off = Math.max(off, Math.abs(next[i] - v[i] - step * first[i]) / displacement[i]);
      whole = Math.max(whole, Math.abs(next[i]) / displacement[i], Math.abs(v[i]) / displacement[i], Math.abs(step * first[i]) / displacement[i]);
    }
    return off > 0.3 * whole;
  }
  // C_D at the steps before: where its smallest pivot is expected to pass zero, if it does
  const past = { t: 0, pivot: 0, plan: null };
  let ahead = Infinity;
  function foresee() {
    const pivot = eq.elimination.sign * eq.regular;
    ahead = Infinity;
    if (past.plan === eq.elimination && past.t < t && Math.abs(pivot) < Math.abs(past.pivot)) {
      ahead = (t - past.t) * pivot / (past.pivot - pivot);
    }
    Object.assign(past, { t, pivot, plan: eq.elimination });
  }
  // A singular position ahead is crossed between the stages of one step, whose nodes leave a gap from 0.3 to 0.8, far from
  // its ends: returns that step, or the one that approaches it; it may end beyond the time that was asked for.
  function across(h, rest) {
    if (ahead > 2 * h || ahead > rest + 0.5 * h) return [0, false];
    if (ahead > 0.72 * h) return [Math.min(rest, ahead - 0.5 * h), false];
    return [ahead > 0.3 * h ? ahead / 0.55 : ahead > 0.05 * h ? ahead / 0.1 : 0.6 * h, true];
  }
  // Order 8 where `whole` seconds take many steps of order 5, and nothing singular is near: its stages leave no gap.
  let method = ORDER5, wary = 0;
  function order(whole) {
    if (method === ORDER5 && whole > 3 * h && wary === 0 && ahead > 12 * h) {
      method = ORDER8;
      h *= 2.5;
    } else if (method === ORDER8 && (h > 3.5 * whole || ahead < 4 * h)) {
      method = ORDER5;
      h /= 3;
    }
  }
  // `deadline` [ms of the page]: where it is passed, the rest is left out, and the mechanism runs slower than asked
  function advance(until, deadline = Infinity) {
    let refused = 0, beyond = 0;
    const whole = 1.2 * (until - t);
    while (t < until) {
      if (deadline < Infinity && performance.now() > deadline) return;
      const rest = until - t;
      if (!(h > 0)) h = Math.min(rest, FIRST_STEP);
      if (refused === 0) order(whole);
      const [over, cross] = beyond ? [beyond, true] : across(Math.min(h, whole), rest);
      const step = over || (h >= rest * (1 - EQUAL) ? rest : h);
      let error = attempt(step);
      if (cross) error *= Math.min(1, accuracy.relative / NEAR_BRANCHES);
      let words = "the loops lose rank, and branches meet here";
      if (error <= 1) {
        normalise(y1);
        for (let i = 0; i < nq; i++) closed[i] = y1[i];
        const open = closeDependent(t + step, closed);
        if (!(open < OPEN)) words = `the loops cannot be kept closed: ${named(gaps())}`;
        // too near to where branches meet rates are not accurate: a step ends before it or beyond
        if (!(open < OPEN) || !evaluated() || eq.regular < LESS_REGULAR * regularBefore) error = Infinity;
      } else if (error < Infinity) {
        words = "the step became too small";
      }
      if (error <= 1) {
        expand(y1, next);
        if (jumps(step)) {
          error = Infinity;
          words = "branches meet here, and the motion cannot be kept on its branch";
        }
      }
      if (!(error <= 1)) {
        refused += 1;
        h = Math.min(h, step) * (error > 0 && error < Infinity ? Math.max(0.2, 0.9 * error ** -method.power) : 0.3);
        // a step that ends where branches meet is tried a little longer once, then shorter
        beyond = error === Infinity && refused === 1 && method === ORDER5 ? 1.1 * step : 0;
        // nor is order 8 of use where a curve has a kink
        if (error === Infinity || refused > 2) {
          method = ORDER5;
          wary = 10;
        }
        if (h < LEAST_STEP * Math.max(1, Math.abs(t)) || refused > 60) {
          h = 0;
          // all is as it was after the step before
          settle();
          throw new Fault(`It stops at t = ${t.toPrecision(5)} s: ${words}.`);
        }
        continue;
      }
      refused = beyond = 0;
      wary = Math.max(0, wary - 1);
      if (closureError(eq.dropped) > about.loose) {
        const words = named(gaps());
        settle();
        throw new Fault(`With these lengths a constraint that was redundant as drawn contradicts the others: ${words}.`);
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
        choose(!eq.wide);
        for (let j = 0; j < k; j++) y[nq + j] = v[eq.independent[j]];
      }
      foresee();
      if (step === h || error > 0) h = Math.max(step === rest ? h : 0, step * Math.min(5, 0.9 * Math.max(error, LEAST_ERROR) ** -method.power));
    }
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
  // a planar mechanism stays in its plane: the two points of a joint may not differ across it
  function leavesPlane(values) {
    if (!about.normal) return "";
    for (const { name } of about.joints) {
      const sides = [`${name}.point`, `${name}.child_point`];
      if (!sides.every((s) => s in about.parameters) || !sides.some((s) => s in values)) continue;
      const [p, r] = sides.map((s) => values[s] || get(s));
      const off = about.normal.reduce((z, e, i) => z + e * (p[i] - r[i]), 0);
      if (Math.abs(off) > EQUAL * about.length) {
        return `It cannot be assembled with this: joint "${name}" opens by ${digits(Math.abs(off))} m across the plane.`;
      }
    }
    return "";
  }
  // other parameters, reached in small steps, so that the mechanism stays on its branch
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
      const dropped = closureError(eq.dropped);
      let far = 0;
      for (const [i, j] of plain) far = Math.max(far, Math.abs(tried[i] - at[i]) / displacement[j]);
      if (open < REACHED && dropped < about.loose && (far < 0.3 || part < LEAST_PART)) {
        at.set(tried);
        done = next;
        part *= 2;
      } else if (part > LEAST_PART) {
        part /= 2;
      } else {
        names.forEach((name, i) => put(name, values[name]));
        run.prepare();
        closeAll(t, tried);
        const words = named(gaps());
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
    h = Math.min(h, FIRST_STEP);
    return "";
  }
  function reset(start) {
    t = start.t;
    q.set(start.q);
    v.set(start.v);
    for (const d of rates) { d.clock = t; d.since = t; }
    eq.forget();
    h = 0;
    method = ORDER5;
    choice.switches = 0;
    const open = closeAll(t, q);
    if (!(open < CLOSED_IN_RUN)) throw new Fault(`It cannot be assembled: ${named(gaps())}.`);
    settle();
  }

  for (const [name, values] of Object.entries(about.values)) put(name, values);
  run.prepare();
  return {
    Fault, q, v, rho, accuracy, put, get, change, lengthOf, lengthened, reset, advance, rates,
    get t() { return t; },
    get steps() { return steps; },
    get switches() { return choice.switches; },
    get independent() { return eq.independent; },
    get wide() { return eq.wide; },
    // loads that do not change the geometry
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
      h = Math.min(h, FIRST_STEP);
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
      h = Math.min(h, FIRST_STEP);
    },
    get evaluations() { return eq.evaluations; },
    // multiplications of one elimination with its solutions
    get operations() { return eq.elimination ? eq.elimination.operations : 0; },
    // rho at this state
    choose() { if (costly || !ready) settle(); },
    // {wrenches, open}: force and moment of each joint on its child, and which are not determined
    reactions() {
      position(t, q);
      velocity(t, v);
      if (!evaluated()) throw new Fault("The reactions are not determined in this position: the loops lose rank.");
      accelerate(y, v, stage[0]);
      return reactionsOf();
    },
    // poses of bodies (12 each), points of joints (3 each), kinetic and potential energy
    look() {
      w[0] = t;
      for (let i = 0; i < nq; i++) w[1 + i] = q[i];
      for (let i = 0; i < n; i++) w[1 + nq + i] = v[i];
      run.position();
      run.velocity();
      run.look();
      const part = (name) => w.subarray(about.outputs[name][0], about.outputs[name][0] + about.outputs[name][1]);
      return { bodies: part("bodies"), joints: part("joints"), energy: part("energy") };
    },
  };
}
