// Events of a run: marks over the time line, a list in the panel, lines in the plots.

const FEW_MARKS = 60; // of more, each is narrower
const MOST_NAMES = 4; // in the words of one mark

class Events {
  constructor(run) {
    const { names, count, rows } = run.scene.events || { names: [], count: 0, rows: [] };
    this.run = run;
    this.names = names; // of all that was looked for
    this.count = count;
    this.all = rows.map(([t, name, direction]) => ({ t, name: names[name], sense: direction > 0 ? "rising" : "falling" }));
  }

  /** Times from one to another; none where not all of them are known. */
  times(start, end) {
    if (this.all.length < this.count && end > this.all[MOST_LOG_ROWS - 1].t) return [];
    return this.all.map((event) => event.t).filter((t) => t >= start && t <= end);
  }

  /** A mark for each output next to which something happened, with the names of that. */
  mark(home, jumpTo) {
    const at = new Map();
    for (const event of this.all) {
      const frame = this.run.frameAt(event.t);
      at.set(frame, [...(at.get(frame) || []), event]);
    }
    home.hidden = !at.size;
    home.classList.toggle("many", at.size > FEW_MARKS);
    for (const [frame, events] of at) {
      const mark = element("i"), more = events.length - MOST_NAMES;
      mark.title = events.slice(0, MOST_NAMES).map((event) => `${event.name}: t = ${short(event.t, 6)} s`).join("\n")
        + (more > 0 ? `\nand ${more} more` : "");
      mark.setAttribute("role", "img");
      mark.setAttribute("aria-label", mark.title);
      mark.style.left = `${(100 * frame) / Math.max(1, this.run.frames - 1)}%`;
      mark.addEventListener("click", () => jumpTo(events[0].t));
      home.append(mark);
    }
  }

  /** A row for each, which shows its instant. */
  list(home, jumpTo) {
    const list = home.querySelector("ol");
    home.hidden = !this.names.length;
    home.querySelector("summary").textContent = `Events: ${this.count}`;
    for (const { t, name, sense } of this.all.slice(0, MOST_LOG_ROWS)) {
      const item = element("li"), button = element("button", "", `t = ${short(t, 6)} s: ${name}`);
      button.type = "button";
      button.title = `${name}, ${sense}; shows the output next to it`;
      button.addEventListener("click", () => jumpTo(t));
      item.append(button);
      list.append(item);
    }
    const rest = this.count - Math.min(this.count, MOST_LOG_ROWS);
    if (rest > 0) list.append(element("li", "", `and ${rest} later ones not listed here`));
    if (!this.count) list.append(element("li", "", `None of these happened: ${this.names.slice(0, FEW).join(", ")}${this.names.length > FEW ? ", …" : ""}`));
  }
}
