// Who answers the page where no program serves it: the core inside it. The same questions as in `link.js`.

const WAIT = 60; // milliseconds after a change until the core is asked
const NOTHING = "Draw a bar: press where it begins, drag to where it ends.";
const LOST = { relative: 1e-8, absolute: 1e-10 }; // tolerances of a run, those of `simulate`

const NO_CORE = (error) => ({ ask: () => ({ error: { kind: "refused", message: error.message } }) });
const core = await loadCore($("module").textContent).catch(NO_CORE);

class Link {
  /** `heard(answer)` is called with what is said about the drawing as it is now. */
  constructor(sketch, heard, lost) {
    Object.assign(this, { sketch, heard, lost, timer: 0, waiting: false });
    this.accuracy = { ...LOST };
    this.seconds = SECONDS;
    $("share").hidden = false;
    $("share").addEventListener("click", () => this.share());
    window.addEventListener("hashchange", () => this.openAddress());
  }

  changed() {
    this.waiting = true;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.ask(), WAIT);
  }

  async ask() {
    clearTimeout(this.timer);
    this.waiting = false;
    history.replaceState(null, "", `#${addressOf(this.sketch.data)}`); // a page that is loaded again has its drawing
    this.heard(answerTo(this.sketch.data));
  }

  async run() {
    if (this.waiting) await this.ask();
    const { data } = this.sketch;
    try {
      const meaning = new Meaning(data), outputs = Math.min(MOST_FRAMES, Math.round(FRAMES * this.seconds) + 1), { relative, absolute } = this.accuracy;
      const found = core.ask({ run: { mechanism: meaning.description(), duration: this.seconds, outputs, rtol: relative, atol: absolute } });
      if (found.error) return { message: found.error.message };
      return { run: { found, meaning, data: structuredClone(data) } };
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      return { message: error.message };
    }
  }

  /** The drawing of the address, opened. */
  openAddress() {
    let data = null;
    try {
      data = drawingOf(location.hash);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.lost(`This link cannot be opened: ${error.message}.`);
      return;
    }
    if (data && JSON.stringify(data) !== JSON.stringify(this.sketch.data)) replaced(data);
  }

  share() {
    const address = `${location.href.split("#")[0]}#${addressOf(this.sketch.data)}`;
    const done = () => { $("hint").textContent = "The address of this mechanism is in the clipboard: who opens it has the same one, to the last bit."; };
    const shown = () => { $("hint").textContent = "The address of this page holds the mechanism: copy it from the browser's address field."; };
    if (navigator.clipboard) navigator.clipboard.writeText(address).then(done, shown); else shown();
    return address;
  }
}

/** What the core says about a drawing, in the form of `answer.py`. */
function answerTo(data) {
  const found = { kind: "empty", message: NOTHING, redundancy: "", remarks: [], mobility: null, gaps: [], closed: null, toml: null, python: null };
  if (!data.bars.length && !data.slides.length) return found;
  try {
    const meaning = new Meaning(data), description = meaning.description();
    Object.assign(found, { toml: meaning.toml(), python: meaning.script() });
    const { error, report, bodies } = core.ask({ examine: { mechanism: description } });
    if (error) return { ...found, kind: error.kind, message: error.message, gaps: error.kind === "open" ? gapsOf(meaning) : [] };
    return { ...found, ...judged(report, data), closed: data.bars.some((bar) => bar.length !== null) ? placed(meaning, bodies) : null };
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return { ...found, kind: "refused", message: error.message };
  }
}

function judged({ mobility, redundancy, suspicious, notes }, { motors }) {
  const several = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`, degrees = `${mobility} degree${mobility === 1 ? "" : "s"} of freedom`;
  const moves = mobility > 0 || motors.length > 0;
  let words = motors.length ? `${degrees} besides ${several(motors.length, "motor")}` : degrees;
  if (!moves) words = "Rigid: 0 degrees of freedom. Remove a bar or a ground to let it move";
  return { kind: moves ? "moves" : "rigid", message: `${words}.`, mobility, redundancy, remarks: [...suspicious, ...notes] };
}

/** Joints whose two points differ as drawn. */
function gapsOf(meaning) {
  return meaning.joints.filter(({ childPoint }) => childPoint).map(({ name, point, childPoint }) => {
    const apart = Math.hypot(point[0] - childPoint[0], point[1] - childPoint[1]);
    return { label: `${name}: ${Number(apart.toPrecision(4))} m apart`, points: [point.slice(0, 2), childPoint.slice(0, 2)] };
  });
}

/** Where the nodes are for poses of the bodies, twelve numbers each: id -> [x, y]. */
function placed(meaning, poses) {
  const index = new Map(meaning.bodies.map(({ name }, i) => [name, i])), found = {};
  for (const { id } of meaning.data.nodes) {
    const [body, at] = meaning.carrier(id), i = index.get(body);
    if (i === undefined) { found[id] = at; continue; }
    const [x, y] = meaning.within(body, at), pose = poses.slice(12 * i, 12 * i + 12);
    found[id] = [pose[0] + pose[3] * x + pose[4] * y, pose[1] + pose[6] * x + pose[7] * y];
  }
  return found;
}

/** Show a run in the place of the drawing; the drawing again. */
let running = null;
function showRun(run) {
  running = new Running(run, (seconds) => { link.seconds = seconds; return link.run(); });
}
function hideRun() {
  if (running) running.end();
  running = null;
}

window.inside = { core, Meaning, addressOf, drawingOf, running: () => running, answerTo }; // for tests and for the curious
