// The photograph on its canvas: pan, zoom, a loupe, and whatever is drawn over it. Places are in pixels of the photograph.

import { at } from "/page/dom.js";

const LOUPE = 172, MAGNIFIED = 6;
const IDLE = 300; // [ms] of a picture being looked at before its neighbours are asked for
const SMALL = 1400, ENOUGH = 1.2; // [px] of the small picture; how far it is enlarged before all pixels are asked for

async function fetchPicture(url, size, priority = "auto") {
  const answer = await fetch(`${url}&size=${size}`, { priority });
  return answer.ok ? createImageBitmap(await answer.blob()) : null;
}

export class Stage {
  constructor() {
    this.canvas = at("canvas");
    this.context = this.canvas.getContext("2d");
    this.view = { x: 0, y: 0, k: 1 };
    this.image = null; this.sharp = null; this.asked = false; this.wanted = ""; this.width = 0; this.height = 0;
    this.draw = () => {}; this.tool = {}; this.loupe = false; this.mouse = null;
    this.pending = false; this.drawn = 0; this.fitted = "";
    this.foreseen = new Map(); this.idle = 0;
    new ResizeObserver(() => { this.resize(); }).observe(this.canvas.parentElement);
    this.listen();
  }

  /** Show a picture: a small one at once, all of its pixels once they are looked at. Those beside it are likely next. */
  async show(url, width, height, beside = []) {
    if (width && height) { this.width = width; this.height = height; }
    if (url === this.wanted) { this.redraw(); return; }
    this.wanted = url; this.sharp = null; this.asked = false;
    clearTimeout(this.idle);
    if (!url) { this.image = null; this.redraw(); return; }
    const image = (await this.foreseen.get(url)) ?? (await fetchPicture(url, SMALL)); // none where it could not be foreseen
    if (!image || this.wanted !== url) return;
    // Each is used once: a file that changes is read anew when one comes back to it.
    this.idle = setTimeout(() => { this.foreseen = new Map(beside.map((each) => [each, this.foreseen.get(each) ?? fetchPicture(each, SMALL, "low").catch(() => null)])); }, IDLE);
    this.foreseen.delete(url);
    this.image = image;
    if (this.fitted !== `${this.width}x${this.height}`) this.fit();
    this.redraw();
  }

  /** All pixels, where the small picture shows fewer than the screen could. */
  async sharpen() {
    const { wanted: url, image } = this;
    if (this.asked || !url || !image || image.width >= this.width) return;
    const k = this.loupe && this.mouse ? Math.max(this.view.k * MAGNIFIED, 6) : this.view.k;
    if (k * (devicePixelRatio || 1) * this.width <= ENOUGH * image.width) return;
    this.asked = true;
    const sharp = await fetchPicture(url, 20000);
    if (sharp && this.wanted === url) { this.sharp = sharp; this.redraw(); }
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
    const [left, top, right, bottom] = box ?? [-0.5, -0.5, this.width - 0.5, this.height - 0.5];
    const k = 0.96 * Math.min(this.boxWidth / (right - left), this.boxHeight / (bottom - top));
    this.view = { k, x: (left + right) / 2 - this.boxWidth / 2 / k, y: (top + bottom) / 2 - this.boxHeight / 2 / k };
    this.fitted = `${this.width}x${this.height}`; this.whole = box === null;
    this.redraw();
  }

  /** Bring a place to the middle, at least so many screen pixels per pixel. */
  centre(x, y, k = 0) {
    this.view.k = Math.max(this.view.k, k); this.whole = false;
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
    this.drawn += 1;
    this.sharpen();
  }

  scene(c, view) {
    c.save();
    c.scale(view.k, view.k); c.translate(-view.x, -view.y);
    if (this.image) {
      const fine = this.sharp && view.k * (devicePixelRatio || 1) * this.width > ENOUGH * this.image.width, image = fine ? this.sharp : this.image;
      c.imageSmoothingEnabled = view.k * this.width / image.width < 3;
      c.imageSmoothingQuality = "medium";
      c.globalAlpha = this.dim ?? 1;
      c.drawImage(image, -0.5, -0.5, this.width, this.height);
      c.globalAlpha = 1;
    }
    this.draw(c, view.k);
    c.restore();
  }

  paintLoupe(c, dense) {
    const [x, y] = this.toPhotograph(...this.mouse), k = Math.max(this.view.k * MAGNIFIED, 6);
    const left = this.mouse[0] > this.boxWidth - LOUPE - 40 && this.mouse[1] < LOUPE + 40 ? 14 : this.boxWidth - LOUPE - 14;
    c.save();
    c.beginPath(); c.roundRect(left, 14, LOUPE, LOUPE, 12); c.clip();
    c.fillStyle = "#08090b"; c.fillRect(left, 14, LOUPE, LOUPE);
    c.translate(left, 14);
    this.scene(c, { k, x: x - LOUPE / 2 / k, y: y - LOUPE / 2 / k });
    c.strokeStyle = "#ffffffb0"; c.lineWidth = 1;
    c.beginPath(); c.moveTo(LOUPE / 2, 0); c.lineTo(LOUPE / 2, LOUPE / 2 - 6); c.moveTo(LOUPE / 2, LOUPE / 2 + 6); c.lineTo(LOUPE / 2, LOUPE);
    c.moveTo(0, LOUPE / 2); c.lineTo(LOUPE / 2 - 6, LOUPE / 2); c.moveTo(LOUPE / 2 + 6, LOUPE / 2); c.lineTo(LOUPE, LOUPE / 2); c.stroke();
    c.restore();
    c.strokeStyle = "#ffffff90"; c.lineWidth = 1.5; c.beginPath(); c.roundRect(left, 14, LOUPE, LOUPE, 12); c.stroke();
  }

  /** Whether a circle of the photograph can be seen now. */
  sees(x, y, r) {
    const { view } = this;
    return x + r > view.x && y + r > view.y && x - r < view.x + this.boxWidth / view.k && y - r < view.y + this.boxHeight / view.k;
  }

  use(tool) { this.tool = tool ?? {}; this.canvas.classList.toggle("tool", Boolean(this.tool.cross)); this.loupe = Boolean(this.tool.loupe); this.redraw(); }

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
      this.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0016)), ...place(event));
    }, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.tool.twice?.());
  }
}
