// Reactions of all joints at a state, each a force and a moment on the joint's child about its point, world axes.
//
//   (R1) C_D^T lambda = (M v' - h)_D          (R3) wrenches w of v' and lambda: the recorded stage `reactions`
//   (R2) S: self-stresses, one for each redundant row. Of all reactions that rigid bodies allow those are taken that are
//        least:  w* = w - S (S^T W S)^-1 S^T W w,  W: forces by 1, moments by 1 over the square of a body's length
//
// The loads of S are also what marks a reaction as not determined.

function makeReactions(eq) {
  const { run, about, w, n, rows, dropped } = eq, count = about.joints.length;
  const [VDOT] = about.inputs.vdot, [LAMBDA] = about.inputs.lambda, [FOUND] = about.outputs.reactions;
  const lambda = new Float64Array(rows), stress = new Float64Array(rows), perLength = 1 / (about.length || 1);
  const wrenches = new Float64Array(6 * count), bare = new Float64Array(6 * count);
  // joints in a plane that hold each other across it say nothing about loads there
  const normal = about.normal && about.conditions.some(({ owner }) => owner.startsWith("joint ")) ? about.normal : null;

  function evaluate(multipliers, out) {
    for (let i = 0; i < rows; i++) w[LAMBDA + i] = multipliers[i];
    run.reactions();
    for (let i = 0; i < out.length; i++) out[i] = w[FOUND + i];
  }
  const weight = (i) => (i % 6 < 3 ? 1 : perLength * perLength);
  function product(x, y) {
    let z = 0;
    for (let i = 0; i < x.length; i++) z += weight(i) * x[i] * y[i];
    return z;
  }
  // self-stresses of length 1, each perpendicular to those before it
  function selfStresses() {
    const found = [];
    if (!dropped.length) return found;
    const still = new Float64Array(rows);
    evaluate(still, bare);
    let top = 1;
    for (const x of lambda) top = Math.max(top, Math.abs(x));
    for (const row of dropped) {
      eq.balance(row, stress);
      let most = 0;
      for (const x of stress) most = Math.max(most, Math.abs(x));
      for (let i = 0; i < rows; i++) stress[i] *= top / most;
      const one = new Float64Array(6 * count);
      evaluate(stress, one);
      for (let i = 0; i < one.length; i++) one[i] -= bare[i];
      const whole = Math.sqrt(product(one, one));
      for (let pass = 0; pass < 2; pass++) for (const other of found) take(one, other);
      const size = Math.sqrt(product(one, one));
      if (!(size > NEGLIGIBLE * whole)) continue;
      for (let i = 0; i < one.length; i++) one[i] /= size;
      found.push(one);
    }
    return found;
  }
  function take(x, unit) {
    const z = product(x, unit);
    for (let i = 0; i < x.length; i++) x[i] -= z * unit[i];
  }
  // whether loads in these directions change the vector at `at`
  function changes(found, at) {
    const base = [], size = Math.hypot(wrenches[at], wrenches[at + 1], wrenches[at + 2]);
    if (!(size > 0)) return false;
    const scale = at % 6 < 3 ? 1 : perLength;
    for (const one of found) {
      const d = [0, 1, 2].map((i) => one[at + i]), whole = Math.hypot(...d);
      if (!(scale * whole > NEGLIGIBLE)) continue;
      for (const b of base) {
        const z = b[0] * d[0] + b[1] * d[1] + b[2] * d[2];
        for (let i = 0; i < 3; i++) d[i] -= z * b[i];
      }
      const rest = Math.hypot(...d);
      if (rest > NEGLIGIBLE * whole) base.push(d.map((x) => x / rest));
    }
    return base.some((b) => Math.abs(b[0] * wrenches[at] + b[1] * wrenches[at + 1] + b[2] * wrenches[at + 2]) > NEGLIGIBLE * size);
  }
  function within(at, along) {
    const z = normal[0] * wrenches[at] + normal[1] * wrenches[at + 1] + normal[2] * wrenches[at + 2];
    for (let i = 0; i < 3; i++) wrenches[at + i] = along ? z * normal[i] : wrenches[at + i] - z * normal[i];
  }

  // at the state whose accelerations are the last that were computed; `open`: for each joint, force and moment
  return function reactions() {
    eq.multipliers(lambda);
    // a stage may use what those before it have computed
    if (eq.massless) run.metric();
    run.look();
    for (let i = 0; i < n; i++) w[VDOT + i] = eq.slope[i];
    evaluate(lambda, wrenches);
    const found = selfStresses();
    for (let pass = 0; pass < 2; pass++) for (const one of found) take(wrenches, one);
    const open = Array.from({ length: count }, (_, j) => [changes(found, 6 * j), changes(found, 6 * j + 3)]);
    if (normal) for (let j = 0; j < count; j++) { within(6 * j, false); within(6 * j + 3, true); }
    return { wrenches, open };
  };
}
