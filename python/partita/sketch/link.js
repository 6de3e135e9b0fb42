// What the page asks of the program that serves it: what the core says about the drawing, and a page on which it runs.

const WAIT = 120; // milliseconds after a change until the core is asked
const SILENCE = "The program that serves this page does not answer. Is it still running?";

class Link {
  /** `heard(answer)` is called with what is said about the drawing as it is now; `lost(words)` where nobody answers. */
  constructor(sketch, heard, lost) {
    Object.assign(this, { sketch, heard, lost, timer: 0, asked: 0, waiting: false, open: null });
  }

  async post(what) {
    const response = await fetch(what, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(this.sketch.data),
    });
    if (!response.ok) throw new Error(`${response.status} ${response.statusText}`);
    return response.json();
  }

  /** The drawing has changed: what is still to be heard is about another one. */
  changed() {
    this.asked += 1;
    this.waiting = true;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.ask(), WAIT);
  }

  async ask() {
    clearTimeout(this.timer);
    const number = ++this.asked, before = this.open;
    let answer = null, done;
    this.open = new Promise((end) => { done = end; });
    await before; // one question at a time: while the core answers, drawings that are older than the last are not sent
    if (number === this.asked) answer = await this.post("drawing").catch(() => null); // what is lost is said below
    done();
    if (number !== this.asked) return; // it is about an older drawing
    if (answer?.kind === "superseded") { this.changed(); return; } // by another page of the same program
    this.waiting = false;
    if (answer) this.heard(answer); else this.lost(SILENCE);
  }

  async run() {
    try {
      return await this.post("run");
    } catch {
      return { message: SILENCE };
    }
  }

  openAddress() {}
}

/** Show a run in the place of the drawing, and the drawing again. By another frame each time: the browser's Back button
 * leaves this page, as it did before. */
function showRun(address) {
  const old = $("running"), made = old.cloneNode();
  made.src = address;
  old.replaceWith(made);
}
const hideRun = () => showRun("about:blank");
