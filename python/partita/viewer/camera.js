// A camera that orbits a target: turned about the scene's up, tilted, moved and zoomed.

const OPENING = (28 * Math.PI) / 180; // vertical angle of view in perspective

class Camera {
  constructor(view, parallel) {
    this.base = view;
    this.parallel = parallel;
    this.width = this.height = 1;
    this.head = 68; // pixels of the picture under tools
    this.scale = 1; // pixels per metre at the target
    this.target = [0, 0, 0];
    this.origin = [0, 0, 0]; // the target is relative to this point, which moves where the camera follows
    this.turnTo(view.azimuth, view.elevation);
  }

  turnTo(azimuth, elevation) {
    const limit = Math.PI / 2 - VISIBLE;
    this.azimuth = azimuth;
    this.elevation = Math.max(-limit, Math.min(limit, elevation));
    const { right, up, back } = this.base;
    const level = add(scaled(back, Math.cos(azimuth)), scaled(right, Math.sin(azimuth)));
    this.back = add(scaled(level, Math.cos(this.elevation)), scaled(up, Math.sin(this.elevation)));
    this.right = sub(scaled(right, Math.cos(azimuth)), scaled(back, Math.sin(azimuth)));
    this.up = cross(this.back, this.right);
  }

  resize(width, height) {
    this.scale *= Math.min(width / this.width, height / this.height);
    this.width = width;
    this.height = height;
  }

  /** Give a canvas the pixels of its box, and this camera its size; returns pixels of the screen per pixel of the page. */
  fillBox(canvas) {
    const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(box.width * ratio));
    canvas.height = Math.max(1, Math.round(box.height * ratio));
    this.resize(Math.max(1, box.width), Math.max(1, box.height));
    return ratio;
  }

  /** How far the middle of what is shown lies below the middle of the picture, in pixels. */
  get drop() {
    return (this.head - 52) / 2;
  }

  /** Distance of the eye from the target [m]; in perspective it follows the zoom. */
  get distance() {
    return this.height / 2 / Math.tan(OPENING / 2) / this.scale;
  }

  /** Bring points into the picture, with room for tools above and legends below. */
  fit(points, spare) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const p of points) {
      [this.right, this.up, this.back].forEach((axis, i) => {
        low[i] = Math.min(low[i], dot(p, axis) - spare);
        high[i] = Math.max(high[i], dot(p, axis) + spare);
      });
    }
    const wide = this.width - Math.max(36, 0.1 * this.width), tall = Math.max(60, this.height - this.head - 52);
    this.scale = Math.min(wide / (high[0] - low[0]), tall / (high[1] - low[1]));
    if (!this.parallel) this.scale /= 1 + (high[2] - low[2]) / 2 / this.distance;
    const middle = [0, 1, 2].map((i) => (low[i] + high[i]) / 2);
    this.target = add(add(scaled(this.right, middle[0]), scaled(this.up, middle[1])), scaled(this.back, middle[2]));
    for (let pass = 0; pass < 4 && !this.parallel; pass++) this.tighten(points, spare, wide, tall);
  }

  /** One correction of size and position by the points in perspective. */
  tighten(points, spare, wide, tall) {
    let left = Infinity, top = Infinity, right = -Infinity, bottom = -Infinity;
    for (const point of points) {
      const p = this.project(point);
      if (!p) return;
      left = Math.min(left, p.x - spare * p.s);
      right = Math.max(right, p.x + spare * p.s);
      top = Math.min(top, p.y - spare * p.s);
      bottom = Math.max(bottom, p.y + spare * p.s);
    }
    this.move(this.width / 2 - (left + right) / 2, this.height / 2 + this.drop - (top + bottom) / 2);
    this.scale *= Math.min(wide / (right - left), tall / (bottom - top));
  }

  /** Picture of a point: x, y in pixels, z towards the viewer [m], s pixels per metre there; null behind the eye. */
  project(p) {
    const v = sub(sub(p, this.origin), this.target), z = dot(v, this.back);
    let s = this.scale;
    if (!this.parallel) {
      const d = this.distance;
      if (d - z < 0.02 * d) return null;
      s *= d / (d - z);
    }
    return { x: this.width / 2 + s * dot(v, this.right), y: this.height / 2 + this.drop - s * dot(v, this.up), z, s };
  }

  /** The point of the world at a pixel, as deep as another one. */
  unproject(x, y, like) {
    const p = this.project(like);
    if (!p) return like;
    return add(like, add(scaled(this.right, (x - p.x) / p.s), scaled(this.up, (p.y - y) / p.s)));
  }

  /** Direction from a point to the eye. */
  toEye(p) {
    return this.parallel ? this.back : unit(sub(add(add(this.origin, this.target), scaled(this.back, this.distance)), p));
  }

  move(dx, dy) {
    this.target = add(this.target, add(scaled(this.right, -dx / this.scale), scaled(this.up, dy / this.scale)));
  }

  /** Zoom by a factor, keeping the point at pixel (x, y) fixed. */
  zoom(factor, x, y) {
    const dx = x - this.width / 2, dy = y - this.height / 2 - this.drop;
    this.move(-dx, -dy);
    this.scale *= factor;
    this.move(dx, dy);
  }
}
