// The stage: pan, zoom, a loupe, and the drawing of a step over the photograph. Places are in pixels of the photograph.

import { at } from "/page/dom.js";
import { paintLayer } from "/page/layers/settings.js";
import { Picture, moveTo } from "/page/picture.js";

const LOUPE = 172, LOUPE_TOP = 52, MAGNIFIED = 6;
const HINT = 36; // [px] above the picture, for the hint and the layers
const LARGE = 2200, ENLARGED = 1.5; // [px] of the stage, beyond which the page is enlarged (style.css)
const IDLE = 300; // [ms] without a change, after which a new picture is drawn sharply and its neighbours are requested
const MARGIN = 0.12; // [of the stage] drawn around it, so that a movement uncovers what is there already
const SETTLED = 180; // [ms] without a movement, after which the drawing is made anew
const MAGNIFICATION = [0.4, 2.5]; // of a former drawing, beyond which it is made anew at once

/** Two fingers on a touchpad pan, and pinched they zoom (the browser sets Ctrl); a wheel's notch is longer and straight. */
const isTouchpad = (event) => !event.ctrlKey && event.deltaMode === 0 && (event.deltaX !== 0 || Math.abs(event.deltaY) < 40);

export class Stage {
  constructor() {
    // Photograph and drawing are canvases of their own that the browser moves and enlarges: a movement paints nothing.
    this.canvas = at("canvas"); // what is fixed to the screen, and all input
    this.context = this.canvas.getContext("2d");
    this.view = { x: 0, y: 0, k: 1 };
    this.picture = new Picture(at("photograph"), () => this.shift());
    this.wanted = ""; this.width = 0; this.height = 0;
    this.draw = () => {}; this.waits = () => false; this.fixed = () => {}; this.tool = {}; this.loupe = false; this.mouse = null;
    this.pending = false; this.drawn = 0; this.fitted = ""; this.beside = null;
    this.drawing = { canvas: at("drawing"), view: null, stale: true, settling: 0, dense: 1, coarse: false };
    this.window = [0, 0, 0, 0]; // [px] left, top, right, bottom of what is being drawn
    this.cursor = null; this.pressed = null; // of the keyboard: a place, and where it was pressed
    new ResizeObserver(() => { this.resize(); }).observe(this.canvas.parentElement);
    this.listen();
  }

  /** Show a picture; beside: pictures to request in advance. */
  async show(url, width, height, beside = [], bounds = null) {
    if (width && height) { this.width = width; this.height = height; }
    this.bounds = bounds;
    if (!url && !this.isFitted()) this.fit();
    if (url === this.wanted) { this.redraw(); return; }
    this.wanted = url;
    this.drawing.coarse = true; // four times the pixels cost the browser more than twice the time: they come once it is still
    this.beside = null;
    clearTimeout(this.drawing.settling);
    this.unreadable("");
    try { if (!(await this.picture.show(url))) return; } catch (error) { this.unreadable(error.message); this.redraw(); return; } // never the picture of another one
    if (this.wanted !== url) return;
    if (url) this.beside = beside;
    if (!this.isFitted()) this.fit();
    this.redraw();
  }

  /** Forget the picture and the view: another experiment is opened, whose photographs may be as large. */
  clear() { this.wanted = ""; this.fitted = ""; this.picture.clear(); this.unreadable(""); this.redraw(); }

  unreadable(text) {
    at("unreadable").hidden = !text;
    at("unreadable").textContent = text ? `This photograph cannot be shown. ${text}` : "";
  }

  resize() {
    const dense = devicePixelRatio || 1, box = this.canvas.parentElement;
    const first = !this.canvas.width || this.boxWidth === undefined, [x, y] = first ? [] : this.toPhotograph(this.boxWidth / 2, this.boxHeight / 2);
    this.boxWidth = box.clientWidth; this.boxHeight = box.clientHeight;
    this.canvas.width = Math.round(this.boxWidth * dense); this.canvas.height = Math.round(this.boxHeight * dense);
    if (first || this.whole || !this.isFitted()) this.fit(); else this.centre(x, y); // what was in the middle stays there
    this.redraw();
  }

  /** Whether a picture of this size has been brought into view; before, no place of it is in the middle. */
  isFitted() { return this.fitted === `${this.width}x${this.height}`; }

  fit(box = null) {
    if (!this.width || !this.boxWidth) return;
    const [left, top, right, bottom] = box ?? this.bounds ?? [-0.5, -0.5, this.width - 0.5, this.height - 0.5];
    const k = 0.96 * Math.min(this.boxWidth / (right - left), Math.max(this.boxHeight - HINT, 40) / (bottom - top));
    this.view = { k, x: (left + right) / 2 - this.boxWidth / 2 / k, y: (top + bottom) / 2 - (this.boxHeight + HINT) / 2 / k };
    this.fitted = `${this.width}x${this.height}`; this.whole = box === null;
    this.shift();
  }

  /** Bring a place to the middle, at least so many screen pixels per pixel. */
  centre(x, y, k = 0) {
    this.view.k = Math.max(this.view.k, k); this.whole = false; this.fitted = `${this.width}x${this.height}`;
    this.view.x = x - this.boxWidth / 2 / this.view.k; this.view.y = y - this.boxHeight / 2 / this.view.k;
    this.shift();
  }

  zoom(factor, x = this.boxWidth / 2, y = this.boxHeight / 2) {
    const { view } = this, k = Math.min(Math.max(view.k * factor, 0.02), 60);
    view.x += x / view.k - x / k; view.y += y / view.k - y / k; view.k = k; this.whole = false;
    this.shift();
  }

  /** Move the view by so many screen pixels. */
  pan(dx, dy) { this.view.x -= dx / this.view.k; this.view.y -= dy / this.view.k; this.whole = false; this.shift(); }

  /** How much larger texts, lines and marks are on a screen of four thousand pixels that the system does not enlarge. */
  get enlarged() { return this.boxWidth > LARGE ? ENLARGED : 1; }

  get image() { return this.picture.image; } // for tests

  toScreen(p) { return [(p[0] - this.view.x) * this.view.k, (p[1] - this.view.y) * this.view.k]; }
  toPhotograph(x, y) { return [x / this.view.k + this.view.x, y / this.view.k + this.view.y]; }

  /** What is drawn has changed. */
  redraw() { this.drawing.stale = true; this.request(); }

  /** The view alone has changed: the drawing is moved, and made anew once the view is still. */
  shift() { this.settle(SETTLED); this.request(); }

  /** Once nothing has changed for a while: make the drawing anew, as sharp as the screen; request the pictures beside. */
  settle(after) {
    clearTimeout(this.drawing.settling);
    this.drawing.settling = setTimeout(() => {
      if (this.beside) this.picture.foresee(this.beside);
      this.beside = null;
      if (this.waits() || this.drawing.stale) return; // what it waits for is drawn when it comes, and then this is done again
      this.drawing.coarse = false;
      if (this.isExact()) this.request(); else this.redraw();
    }, after);
  }

  request() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }

  isExact() { const { view, dense } = this.drawing; return Boolean(view) && view.x === this.view.x && view.y === this.view.y && view.k === this.view.k && dense === (devicePixelRatio || 1); }

  paint() {
    const { view, drawing } = this, dense = devicePixelRatio || 1, by = drawing.view ? view.k / drawing.view.k : 0;
    const stretched = by < MAGNIFICATION[0] || by > MAGNIFICATION[1], anew = drawing.stale || stretched;
    // What only the movement has stretched will soon be drawn again, sharply, once the view is still.
    if (anew) this.renew(drawing.coarse || !drawing.stale ? Math.min(dense, 1) : dense);
    this.picture.place(view, this.width, this.height, dense, this.dim ?? 1);
    moveTo(drawing.canvas, (drawing.left - view.x) * view.k, (drawing.top - view.y) * view.k, view.k / drawing.view.k / drawing.dense);
    if (anew || this.loupe || this.cursor) this.paintFixed(dense);
    this.drawn += 1;
    const k = this.loupe && this.mouse ? Math.max(view.k * MAGNIFIED, 6) : view.k;
    this.picture.sharpen(this.visible(), k * dense, this.width, this.height);
  }

  visible(view = this.view) { return [view.x, view.y, view.x + this.boxWidth / view.k, view.y + this.boxHeight / view.k]; }

  /** Draw the step anew, with a margin, at so many pixels of the drawing per pixel of the page. */
  renew(dense) {
    const { drawing, view } = this, { canvas } = drawing, waits = this.waits();
    canvas.style.visibility = waits ? "hidden" : "";
    if (drawing.coarse) this.settle(IDLE);
    if (waits && drawing.view) { drawing.stale = false; return; } // a canvas that is hidden need not be emptied
    const wide = Math.round((1 + 2 * MARGIN) * this.boxWidth * dense), high = Math.round((1 + 2 * MARGIN) * this.boxHeight * dense);
    if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
    const c = canvas.getContext("2d"), left = view.x - MARGIN * this.boxWidth / view.k, top = view.y - MARGIN * this.boxHeight / view.k;
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, wide, high);
    c.setTransform(dense * view.k, 0, 0, dense * view.k, -dense * view.k * left, -dense * view.k * top);
    this.window = [left, top, left + wide / dense / view.k, top + high / dense / view.k];
    this.draw(c, view.k / this.enlarged);
    Object.assign(drawing, { view: { ...view }, left, top, dense, stale: false });
  }

  /** Legends, the loupe, the keyboard's cursor. */
  paintFixed(dense) {
    const { context: c, view } = this;
    c.setTransform(dense, 0, 0, dense, 0, 0);
    c.clearRect(0, 0, this.boxWidth, this.boxHeight);
    this.inPhotograph(c, view, () => this.fixed(c, view.k / this.enlarged));
    if (this.loupe && this.mouse && this.picture.image) this.paintLoupe(c);
    if (this.cursor) this.paintCursor(c);
  }

  inPhotograph(c, view, draw) { c.save(); c.scale(view.k, view.k); c.translate(-view.x, -view.y); draw(); c.restore(); }

  paintPhotograph(c, view) {
    if (this.picture.image) paintLayer(c, "photograph", () => this.picture.draw(c, view.k * (devicePixelRatio || 1), this.width, this.height), this.dim ?? 1);
  }

  /** All that is shown on one canvas, to be taken away. */
  composed() {
    const dense = devicePixelRatio || 1, copy = document.createElement("canvas"), c = copy.getContext("2d");
    copy.width = this.canvas.width; copy.height = this.canvas.height;
    c.fillStyle = "#08090b"; c.fillRect(0, 0, copy.width, copy.height);
    c.setTransform(dense, 0, 0, dense, 0, 0);
    this.window = this.visible();
    this.inPhotograph(c, this.view, () => { this.paintPhotograph(c, this.view); this.draw(c, this.view.k / this.enlarged); this.fixed(c, this.view.k / this.enlarged); });
    return copy;
  }

  paintLoupe(c) {
    const [x, y] = this.toPhotograph(...this.mouse), k = Math.max(this.view.k * MAGNIFIED, 6), half = LOUPE / 2 / k;
    const left = this.mouse[0] > this.boxWidth - LOUPE - 40 && this.mouse[1] < LOUPE + LOUPE_TOP + 26 ? 14 : this.boxWidth - LOUPE - 14;
    c.save();
    c.beginPath(); c.roundRect(left, LOUPE_TOP, LOUPE, LOUPE, 12); c.clip();
    c.fillStyle = "#08090b"; c.fillRect(left, LOUPE_TOP, LOUPE, LOUPE);
    c.translate(left, LOUPE_TOP);
    this.window = [x - half, y - half, x + half, y + half];
    this.inPhotograph(c, { k, x: x - half, y: y - half }, () => { this.paintPhotograph(c, { k }); this.draw(c, k / this.enlarged); });
    c.strokeStyle = "#ffffffb0"; c.lineWidth = 1;
    c.beginPath(); c.moveTo(LOUPE / 2, 0); c.lineTo(LOUPE / 2, LOUPE / 2 - 6); c.moveTo(LOUPE / 2, LOUPE / 2 + 6); c.lineTo(LOUPE / 2, LOUPE);
    c.moveTo(0, LOUPE / 2); c.lineTo(LOUPE / 2 - 6, LOUPE / 2); c.moveTo(LOUPE / 2 + 6, LOUPE / 2); c.lineTo(LOUPE, LOUPE / 2); c.stroke();
    c.restore();
    c.strokeStyle = "#ffffff90"; c.lineWidth = 1.5; c.beginPath(); c.roundRect(left, LOUPE_TOP, LOUPE, LOUPE, 12); c.stroke();
  }

  /** A circle of the photograph is in the part that is being drawn. */
  sees(x, y, r) { const [left, top, right, bottom] = this.window; return x + r > left && y + r > top && x - r < right && y - r < bottom; }

  /** A line of the photograph, so wide, may be in that part. */
  seesLine([x1, y1, x2, y2], wide) {
    const [left, top, right, bottom] = this.window;
    return Math.max(x1, x2) + wide > left && Math.max(y1, y2) + wide > top && Math.min(x1, x2) - wide < right && Math.min(y1, y2) - wide < bottom;
  }

  use(tool) { this.cursor = this.pressed = null; this.tool = tool ?? {}; this.canvas.classList.toggle("tool", Boolean(this.tool.cross)); this.loupe = Boolean(this.tool.loupe); this.redraw(); }

  /** A cursor that the keyboard moves: whatever a step does by mouse, drawing and dragging included, it does by it. */
  toggleCursor() {
    this.cursor = this.cursor ? null : this.toPhotograph(this.boxWidth / 2, this.boxHeight / 2);
    this.pressed = null;
    this.mouse = this.cursor ? this.toScreen(this.cursor) : null;
    this.redraw();
  }

  cursorKey(event) {
    if (!this.cursor) return false;
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (by) {
      const step = (event.shiftKey ? 1 : 12) / this.view.k;
      this.cursor = [this.cursor[0] + by[0] * step, this.cursor[1] + by[1] * step];
      const [x, y] = this.toScreen(this.cursor);
      if (x < 0 || y < 0 || x > this.boxWidth || y > this.boxHeight) this.centre(...this.cursor);
      this.mouse = this.toScreen(this.cursor);
      if (this.pressed) this.tool.drag?.(this.cursor, event, this.pressed); else this.tool.hover?.(this.cursor, event);
    } else if (event.key === "Enter" && this.pressed) {
      const from = this.pressed, away = Math.hypot(this.cursor[0] - from[0], this.cursor[1] - from[1]) * this.view.k;
      this.pressed = null;
      this.tool.up?.(this.cursor, event, from, away > 3);
    } else if (event.key === "Enter") {
      if (this.tool.down?.(this.cursor, event)) this.pressed = [...this.cursor]; else this.tool.click?.(this.cursor, event);
    } else if (event.key === "Escape") {
      if (this.pressed) this.tool.up?.(this.pressed, event, this.pressed, false);
      this.cursor = this.pressed = this.mouse = null;
    } else return false;
    this.redraw();
    return true;
  }

  paintCursor(c) {
    const [x, y] = this.toScreen(this.cursor);
    for (const [width, style] of [[5, "#000c"], [2, this.pressed ? "#f0e442" : "#fff"]]) {
      c.lineWidth = width; c.strokeStyle = style; c.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) { c.moveTo(x + 5 * dx, y + 5 * dy); c.lineTo(x + 17 * dx, y + 17 * dy); }
      c.stroke();
    }
  }

  listen() {
    const { canvas } = this;
    let held = null;
    const place = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId); canvas.focus({ preventScroll: true });
      const screen = place(event), p = this.toPhotograph(...screen);
      const taken = event.button === 0 && !event.altKey && this.tool.down?.(p, event);
      held = { screen, p, pan: !taken, moved: 0, view: { ...this.view }, button: event.button };
      if (!taken) canvas.classList.add("panning");
    });
    canvas.addEventListener("pointermove", (event) => {
      const screen = place(event), p = this.toPhotograph(...screen);
      this.mouse = screen;
      if (held) {
        const by = [screen[0] - held.screen[0], screen[1] - held.screen[1]];
        held.moved = Math.max(held.moved, Math.hypot(...by));
        if (held.pan) { this.view.x = held.view.x - by[0] / this.view.k; this.view.y = held.view.y - by[1] / this.view.k; if (held.moved > 3) this.whole = false; this.shift(); } else { this.tool.drag?.(p, event, held.p); this.redraw(); }
      } else if (this.tool.hover) { this.tool.hover(p, event); this.redraw(); } else if (this.loupe) this.request();
    });
    canvas.addEventListener("pointerup", (event) => {
      const p = this.toPhotograph(...place(event));
      canvas.classList.remove("panning");
      if (held && !held.pan) this.tool.up?.(p, event, held.p, held.moved > 3);
      else if (held && held.moved <= 3 && held.button === 0) this.tool.click?.(p, event);
      held = null;
    });
    canvas.addEventListener("pointerleave", () => { this.mouse = null; if (this.loupe) this.request(); });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (this.tool.wheel?.(this.toPhotograph(...place(event)), event)) return;
      if (isTouchpad(event)) { this.pan(-event.deltaX, -event.deltaY); return; }
      this.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0016)), ...place(event));
    }, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.tool.twice?.());
  }
}
