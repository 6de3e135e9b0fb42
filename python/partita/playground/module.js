// The recorded equations: a WebAssembly module with one memory of numbers and functions without arguments.

const MATH = {
  sin: Math.sin,
  cos: Math.cos,
  atan2: Math.atan2,
  hypot: (x, y) => Math.hypot(x, y),
  pow: Math.pow,
  // halves away from zero
  round: (x) => (x < 0 ? -Math.round(-x) : Math.round(x)),
};

// compiled beside the page, since browsers refuse large modules on their main thread
async function loadProgram(text) {
  if (typeof WebAssembly === "undefined") throw new Error("This page computes with WebAssembly, which is switched off here.");
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const { instance } = await WebAssembly.instantiate(bytes, { math: MATH });
  return instance.exports;
}
