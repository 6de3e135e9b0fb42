// Words beside points, placed so that none covers another, a joint or a legend, and none leaves the picture.

const DIRECTIONS = [[1, -1], [1, 0], [-1, -1], [-1, 0], [1, 1], [-1, 1], [0, -1], [0, 1]];
const PLACES = [0, 14, 30].flatMap((more) => DIRECTIONS.map(([x, y]) => [x, y, more])); // near ones first

const GAP = 6; // pixels beside a word: more than a space, so that two words of two points are not read as one

const overlaps = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
const boxAround = (x, y, half) => ({ left: x - half, right: x + half, top: y - half, bottom: y + half });

class Labels {
  constructor(context, width, height) {
    this.c = context;
    this.width = width;
    this.height = height;
    this.taken = []; // boxes where no word may stand
    this.soft = []; // boxes where a word should not stand: arrows
    this.softer = []; // where it should not stand unless all else is taken: rods
    this.written = []; // what was written where, for this frame
    this.hidden = 0;
  }

  take(box) {
    this.taken.push(box);
  }

  /** Text no wider than `most` pixels, cut in the middle. */
  fitted(text, most) {
    if (this.c.measureText(text).width <= most) return text;
    let keep = text.length;
    const cut = () => `${text.slice(0, Math.ceil(keep / 2))}…${text.slice(text.length - Math.floor(keep / 2))}`;
    while (keep > 2 && this.c.measureText(cut()).width > most) keep--;
    return cut();
  }

  /**
   * Best position of a text at a distance from a point. `last` is the one it had before: while the mechanism moves it keeps
   * it as long as no other word is there, so that words do not jump; at rest it keeps it only where it is clear.
   */
  place(text, x, y, away, last, moving) {
    const width = this.c.measureText(text).width;
    if (moving && last !== undefined) {
      const kept = this.at(last, width, x, y, away, this.taken);
      if (kept) return kept;
    }
    for (const taken of [this.taken.concat(this.soft, this.softer), this.taken.concat(this.soft), this.taken]) {
      const order = PLACES.map((_, i) => i);
      if (last !== undefined) order.unshift(last);
      for (const place of order) {
        const found = this.at(place, width, x, y, away, taken);
        if (found) return found;
      }
    }
    return null;
  }

  /** A text in one of the places around a point; null where that is taken or outside the picture. */
  at(place, width, x, y, away, taken) {
    const [dx, dy, more] = PLACES[place], d = away + more, height = 15;
    const cx = x + (dx ? dx * (d * (dy ? 0.8 : 1) + width / 2) : 0), cy = y + dy * (d * (dx ? 0.8 : 1) + height / 2);
    const left = cx - width / 2, right = cx + width / 2, box = { left: left - GAP, right: right + GAP, top: cy - height / 2, bottom: cy + height / 2 };
    if (left < 5 || right > this.width - 5 || box.top < 3 || box.bottom > this.height - 3) return null;
    if (taken.some((other) => overlaps(box, other))) return null;
    return { box, x: left, y: cy + 4, position: place, far: more > 0 };
  }

  /** Write at a position already chosen, and keep others off it. */
  write(text, x, y, colour) {
    const { c } = this, width = c.measureText(text).width;
    const box = { left: x - 1, right: x + width + 1, top: y - 11, bottom: y + 4 };
    this.taken.push(box);
    this.written.push({ text, colour: colour || COLOURS.ink, ...box });
    c.lineJoin = "round";
    c.lineWidth = 3.5;
    c.strokeStyle = COLOURS.halo;
    c.strokeText(text, x, y);
    c.fillStyle = colour || COLOURS.ink;
    c.fillText(text, x, y);
  }
}
