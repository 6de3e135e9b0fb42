// The core inside the page: a WebAssembly module, compressed; a request goes in as JSON, an answer comes out as JSON.

const STOPPED = "The core stopped at an error of its own, which should not happen; the drawing is kept.";

class Core {
  constructor(module) {
    this.module = module;
    this.start();
  }

  start() { this.exports = new WebAssembly.Instance(this.module, {}).exports; }

  /** The answer to a request; an object with the key `error` where there is none. */
  ask(request) {
    const bytes = new TextEncoder().encode(JSON.stringify(request));
    try {
      const { memory } = this.exports, from = this.exports.request(bytes.length); // memory grows: its buffer is read after calls
      new Uint8Array(memory.buffer, from, bytes.length).set(bytes);
      const count = this.exports.answer(), at = this.exports.answered();
      return JSON.parse(new TextDecoder().decode(new Uint8Array(memory.buffer, at, count)));
    } catch {
      this.start(); // what stopped in the middle is not used again
      return { error: { kind: "refused", message: STOPPED } };
    }
  }
}

/** The core from its text in the page: base 64 of the module as gzip makes it. */
async function loadCore(text) {
  if (typeof WebAssembly === "undefined") throw new Error("This page computes with WebAssembly, which is switched off here.");
  const packed = new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))]);
  const bytes = await new Response(packed.stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  return new Core(await WebAssembly.compile(bytes)); // beside the page: browsers refuse large modules on their main thread
}
