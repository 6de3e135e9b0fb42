// How fast a run is shown: such that a turn can be followed by eye.

const TURN = 2; // seconds that the fastest usual turn takes on the screen, at least
const SHORTEST = 2, LONGEST = 40; // a run of so many seconds is shown in real time, unless it turns fast
const PACES = [0.1, 0.2, 0.5, 1, 2, 5, 10]; // offered, relative to the usual one

/** The pace [rad/s] of the motion: the largest, over the bodies, of the usual speed at which one turns or crosses the picture. */
function motionRate(run, size) {
  const { spin, rate } = run.tables, step = Math.max(1, Math.ceil(run.frames / 300));
  let most = 0;
  run.scene.bodies.forEach((_, b) => {
    const found = [];
    for (let f = 0; f < run.frames; f += step) {
      const turning = length(spin.vector(f, b)), moving = (Math.PI * length(rate.vector(f, b))) / (size || 1);
      if (Number.isFinite(turning + moving)) found.push(Math.max(turning, moving));
    }
    found.sort((a, b) => a - b);
    if (found.length) most = Math.max(most, found[found.length >> 1]);
  });
  return most;
}

/** The speed at first: real time, slower where the run is short or turns fast, faster where it is long and slow. */
function usualSpeed(duration, rate) {
  if (!(duration > 0)) return 1;
  const whole = duration >= SHORTEST && duration <= LONGEST ? 1 : roundBelow(duration / 8);
  const followed = rate > 0 ? (2 * Math.PI) / TURN / rate : Infinity;
  return followed < whole ? roundBelow(followed) : whole;
}

/** A speed in words. */
function paceText(speed) {
  if (Math.abs(speed - 1) < EQUAL) return "real time";
  const factor = speed > 1 ? speed : 1 / speed, digits = Number(factor.toPrecision(2));
  return speed > 1 ? `${digits} × real time` : `1/${digits} of real time`;
}
