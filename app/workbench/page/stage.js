// The photograph on its canvas: pan, zoom, a loupe, and the drawing of a step. Places are in pixels of the photograph.

import { at } from "/page/dom.js";
import { layers } from "/page/parts/layers.js";

const LOUPE = 172, LOUPE_TOP = 52, MAGNIFIED = 6;
const HINT = 36; // [px] above the picture, for the hint and the layers
const IDLE = 300; // [ms] after which the neighbours of a picture are requested
const SMALL = 1400, ENOUGH = 1.2; // [px] of the small picture; enlargement above which all pixels are requested

async function fetchPicture(url, size, priority = "auto") {
  const answer = await fetch(`${url}&size=${size}`, { priority });
  if (!answer.ok) throw new Error(await answer.text());
  return createImageBitmap(await answer.blob());
}

/** Two fingers on a touchpad pan, and pinched they zoom (the browser sets Ctrl); a wheel's notch is longer and straight. */
const isTouchpad = (event) => !event.ctrlKey && event.deltaMode === 0 && (event.deltaX !== 0 || Math.abs(event.deltaY) < 40);

export class Stage {
  constructor() {
    this.canvas = at("canvas");
    this.context = this.canvas.getContext("2d");
    this.view = { x: 0, y: 0, k: 1 };
    this.image = null; this.sharp = null; this.requested = false; this.wanted = ""; this.width = 0; this.height = 0;
    this.draw = () => {}; this.tool = {}; this.loupe = false; this.mouse = null;
    this.pending = false; this.drawn = 0; this.fitted = "";
    this.foreseen = new Map(); this.idle = 0;
    this.cursor = null; this.pressed = null; // of the keyboard: a place, and where it was pressed
    new ResizeObserver(() => { this.resize(); }).observe(this.canvas.parentElement);
    this.listen();
  }

  /** Show a picture: a small one at once, all of its pixels at high zoom; beside: pictures to request in advance. */
  async show(url, width, height, beside = [], bounds = null) {
    if (width && height) { this.width = width; this.height = height; }
    this.bounds = bounds;
    if (!url && this.fitted !== `${this.width}x${this.height}`) this.fit();
    if (url === this.wanted) { this.redraw(); return; }
    this.wanted = url; this.sharp = null; this.requested = false;
    clearTimeout(this.idle);
    this.unreadable("");
    if (!url) { this.image = null; this.redraw(); return; }
    let image = null, wrong = "";
    try { image = (await this.foreseen.get(url)) ?? (await fetchPicture(url, SMALL)); } catch (error) { wrong = error.message; }
    if (this.wanted !== url) return;
    if (!image) { this.image = null; this.unreadable(wrong); this.redraw(); return; } // never the picture of another one
    // Each is used once: a file that changes is read anew when one comes back to it.
    this.idle = setTimeout(() => { this.foreseen = new Map(beside.map((each) => [each, this.foreseen.get(each) ?? fetchPicture(each, SMALL, "low").catch(() => null)])); }, IDLE);
    this.foreseen.delete(url);
    this.image = image;
    if (this.fitted !== `${this.width}x${this.height}`) this.fit();
    this.redraw();
  }

  /** Load all pixels, where the small picture has fewer than the screen. */
  async sharpen() {
    const { wanted: url, image } = this;
    if (this.requested || !url || !image || image.width >= this.width) return;
    const k = this.loupe && this.mouse ? Math.max(this.view.k * MAGNIFIED, 6) : this.view.k;
    if (k * (devicePixelRatio || 1) * this.width <= ENOUGH * image.width) return;
    this.requested = true;
    const sharp = await fetchPicture(url, 20000).catch(() => null);
    if (sharp && this.wanted === url) { this.sharp = sharp; this.redraw(); }
  }

  /** Forget the picture: another experiment is opened. */
  clear() { this.wanted = ""; this.image = null; this.sharp = null; this.foreseen = new Map(); this.unreadable(""); this.redraw(); }

  unreadable(text) {
    at("unreadable").hidden = !text;
    at("unreadable").textContent = text ? `This photograph cannot be shown. ${text}` : "";
  }

  resize() {
    const dense = devicePixelRatio || 1, box = this.canvas.parentElement;
    const first = !this.canvas.width || this.boxWidth === undefined;
    this.boxWidth = box.clientWidth; this.boxHeight = box.clientHeight;
    this.canvas.width = Math.round(this.boxWidth * dense); this.canvas.height = Math.round(this.boxHeight * dense);
    if (first || this.whole) this.fit();
    this.redraw();
  }

  fit(box = null) {
    if (!this.width || !this.boxWidth) return;
    const [left, top, right, bottom] = box ?? this.bounds ?? [-0.5, -0.5, this.width - 0.5, this.height - 0.5];
    const k = 0.96 * Math.min(this.boxWidth / (right - left), Math.max(this.boxHeight - HINT, 40) / (bottom - top));
    this.view = { k, x: (left + right) / 2 - this.boxWidth / 2 / k, y: (top + bottom) / 2 - (this.boxHeight + HINT) / 2 / k };
    this.fitted = `${this.width}x${this.height}`; this.whole = box === null;
    this.redraw();
  }

  /** Bring a place to the middle, at least so many screen pixels per pixel. */
  centre(x, y, k = 0) {
    this.view.k = Math.max(this.view.k, k); this.whole = false; this.fitted = `${this.width}x${this.height}`;
    this.view.x = x - this.boxWidth / 2 / this.view.k; this.view.y = y - this.boxHeight / 2 / this.view.k;
    this.redraw();
  }

  zoom(factor, x = this.boxWidth / 2, y = this.boxHeight / 2) {
    const { view } = this, k = Math.min(Math.max(view.k * factor, 0.02), 60);
    view.x += x / view.k - x / k; view.y += y / view.k - y / k; view.k = k; this.whole = false;
    this.redraw();
  }

  toScreen(p) { return [(p[0] - this.view.x) * this.view.k, (p[1] - this.view.y) * this.view.k]; }
  toPhotograph(x, y) { return [x / this.view.k + this.view.x, y / this.view.k + this.view.y]; }

  redraw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }

  paint() {
    const { context: c, view } = this, dense = devicePixelRatio || 1;
    c.setTransform(dense, 0, 0, dense, 0, 0);
    c.clearRect(0, 0, this.boxWidth, this.boxHeight);
    this.scene(c, view);
    c.setTransform(dense, 0, 0, dense, 0, 0);
    if (this.loupe && this.mouse && this.image) this.paintLoupe(c, dense);
    if (this.cursor) this.paintCursor(c);
    this.drawn += 1;
    this.sharpen();
  }

  scene(c, view) {
    c.save();
    c.scale(view.k, view.k); c.translate(-view.x, -view.y);
    if (this.image && layers.photograph) {
      const fine = this.sharp && view.k * (devicePixelRatio || 1) * this.width > ENOUGH * this.image.width, image = fine ? this.sharp : this.image;
      c.imageSmoothingEnabled = view.k * this.width / image.width < 3;
      c.imageSmoothingQuality = "medium";
      c.globalAlpha = (this.dim ?? 1) * layers.dim;
      if (layers.brightness !== 1 || layers.contrast !== 1) c.filter = `brightness(${layers.brightness}) contrast(${layers.contrast})`;
      c.drawImage(image, -0.5, -0.5, this.width, this.height);
      c.globalAlpha = 1; c.filter = "none";
    }
    this.draw(c, view.k);
    c.restore();
  }

  paintLoupe(c, dense) {
    const [x, y] = this.toPhotograph(...this.mouse), k = Math.max(this.view.k * MAGNIFIED, 6);
    const left = this.mouse[0] > this.boxWidth - LOUPE - 40 && this.mouse[1] < LOUPE + LOUPE_TOP + 26 ? 14 : this.boxWidth - LOUPE - 14;
    c.save();
    c.beginPath(); c.roundRect(left, LOUPE_TOP, LOUPE, LOUPE, 12); c.clip();
    c.fillStyle = "#08090b"; c.fillRect(left, LOUPE_TOP, LOUPE, LOUPE);
    c.translate(left, LOUPE_TOP);
    this.scene(c, { k, x: x - LOUPE / 2 / k, y: y - LOUPE / 2 / k });
    c.strokeStyle = "#ffffffb0"; c.lineWidth = 1;
    c.beginPath(); c.moveTo(LOUPE / 2, 0); c.lineTo(LOUPE / 2, LOUPE / 2 - 6); c.moveTo(LOUPE / 2, LOUPE / 2 + 6); c.lineTo(LOUPE / 2, LOUPE);
    c.moveTo(0, LOUPE / 2); c.lineTo(LOUPE / 2 - 6, LOUPE / 2); c.moveTo(LOUPE / 2 + 6, LOUPE / 2); c.lineTo(LOUPE, LOUPE / 2); c.stroke();
    c.restore();
    c.strokeStyle = "#ffffff90"; c.lineWidth = 1.5; c.beginPath(); c.roundRect(left, LOUPE_TOP, LOUPE, LOUPE, 12); c.stroke();
  }

  /** A circle of the photograph is visible. */
  sees(x, y, r) {
    const { view } = this;
    return x + r > view.x && y + r > view.y && x - r < view.x + this.boxWidth / view.k && y - r < view.y + this.boxHeight / view.k;
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
        if (held.pan) { this.view.x = held.view.x - by[0] / this.view.k; this.view.y = held.view.y - by[1] / this.view.k; if (held.moved > 3) this.whole = false; }
        else this.tool.drag?.(p, event, held.p);
      } else this.tool.hover?.(p, event);
      this.redraw();
    });
    canvas.addEventListener("pointerup", (event) => {
      const p = this.toPhotograph(...place(event));
      canvas.classList.remove("panning");
      if (held && !held.pan) this.tool.up?.(p, event, held.p, held.moved > 3);
      else if (held && held.moved <= 3 && held.button === 0) this.tool.click?.(p, event);
      held = null;
    });
    canvas.addEventListener("pointerleave", () => { this.mouse = null; this.redraw(); });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (this.tool.wheel?.(this.toPhotograph(...place(event)), event)) return;
      if (isTouchpad(event)) { this.view.x += event.deltaX / this.view.k; this.view.y += event.deltaY / this.view.k; this.whole = false; this.redraw(); return; }
      this.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0016)), ...place(event));
    }, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.tool.twice?.());
  }
}
