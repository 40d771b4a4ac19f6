// The photograph on the stage: a small picture at once, then the part that is looked at, as sharp as the screen; its
// brightness, contrast and gamma.

import { layers } from "/page/layers/settings.js";

const SMALL = 1400, ENOUGH = 1.2; // [px] of the small picture; enlargement above which a sharper part is requested
const AROUND = 0.25; // [of the window] of the photograph beside it, so that a small movement needs no new part
const WIDEST = 3600; // [px] of a part: what a screen of four thousand pixels shows without the panels
const PIXELS = 3; // screen pixels per pixel from which pixels are shown as squares
const FINER = 1.5; // enlargement of a part above which a finer one is requested

async function fetchPicture(url, priority = "auto") {
  const answer = await fetch(url, { priority });
  if (!answer.ok) throw new Error(await answer.text());
  return createImageBitmap(await answer.blob());
}

const small = (url, priority) => fetchPicture(`${url}&size=${SMALL}`, priority);

export class Picture {
  /** box: the element that shows it; changed: called when a sharper part has come. */
  constructor(box, changed) {
    this.box = box; this.changed = changed;
    this.canvases = ["whole", "part"].map((name) => { const canvas = document.createElement("canvas"); canvas.className = name; box.append(canvas); return { canvas, shown: null }; });
    this.url = ""; this.image = null; this.part = null; this.requested = ""; this.foreseen = new Map();
  }

  /** Show a photograph; the answer is false where another one has been requested meanwhile. */
  async show(url) {
    this.url = url; this.part = null; this.requested = "";
    if (!url) { this.image = null; return true; }
    let image = null;
    try { image = (await this.foreseen.get(url)) ?? (await small(url)); } catch (error) { if (this.url === url) { this.image = null; throw error; } }
    if (this.url !== url) return false;
    this.foreseen.delete(url); // each is used once: a file that changes is read anew when one comes back to it
    this.image = image;
    return true;
  }

  /** Request pictures that are likely to be shown next. */
  foresee(urls) { this.foreseen = new Map(urls.map((each) => [each, this.foreseen.get(each) ?? small(each, "low").catch(() => null)])); }

  clear() { this.url = ""; this.image = null; this.part = null; this.foreseen = new Map(); }

  /** Load the part of a window [left, top, right, bottom] at so many screen pixels per pixel, where it is not there. */
  async sharpen(window, k, width, height) {
    const { url, image } = this;
    if (!url || !image || image.width >= width || k * width <= ENOUGH * image.width) return;
    if (this.part && covers(this.part.window, clip(window, width, height, 0)) && Math.min(k, 1) <= FINER * this.part.scale) return;
    const place = clip(window, width, height, AROUND), wide = Math.max(place[2] - place[0], place[3] - place[1]);
    if (wide <= 0) return;
    const size = Math.min(Math.ceil(wide * Math.min(k, 1)), WIDEST), wanted = [...place, size].join();
    if (wanted === this.requested) return;
    this.requested = wanted;
    const query = new URLSearchParams({ size, left: place[0], top: place[1], right: place[2], bottom: place[3] });
    const sharp = await fetchPicture(`${url}&${query}`).catch(() => null);
    if (!sharp || this.url !== url || this.requested !== wanted) return;
    this.part = { image: sharp, window: place, scale: size / wide };
    this.changed();
  }

  /** The sharper part, where the screen shows more than the small picture has. */
  finer(k, width) { return this.part && k * width > ENOUGH * this.image.width ? this.part : null; }

  /** Show it in its element: the canvases are filled where their picture has changed, and moved. */
  place(view, width, height, dense, dim) {
    const { on, opacity } = layers.photograph, { image } = this, fine = image && this.finer(view.k * dense, width);
    this.box.style.opacity = String(opacity * dim);
    this.box.hidden = !on || !image;
    if (!image) return;
    for (const [place, source, left, top, wide] of [[this.canvases[0], image, 0, 0, width], [this.canvases[1], fine?.image, fine?.window[0], fine?.window[1], fine ? fine.window[2] - fine.window[0] : 0]]) {
      place.canvas.hidden = !source;
      if (!source) continue;
      const name = look(source);
      if (place.shown !== name) { fill(place.canvas, source); place.shown = name; }
      const by = wide * view.k / source.width;
      place.canvas.style.imageRendering = by * dense < PIXELS ? "auto" : "pixelated";
      moveTo(place.canvas, (left - 0.5 - view.x) * view.k, (top - 0.5 - view.y) * view.k, by);
    }
  }

  /** Draw it into the coordinates of the photograph, at so many screen pixels per pixel. */
  draw(c, k, width, height) {
    c.imageSmoothingQuality = "medium";
    paint(c, this.image, -0.5, -0.5, width, height, k);
    const fine = this.finer(k, width);
    if (fine) { const [left, top, right, bottom] = fine.window; paint(c, fine.image, left - 0.5, top - 0.5, right - left, bottom - top, k); }
  }

  /** Brightness and contrast with which the darkest and the brightest hundredth become black and white. */
  stretched() {
    const { image } = this, canvas = new OffscreenCanvas(256, 256), c = canvas.getContext("2d");
    if (!image) return { brightness: 1, contrast: 1 };
    c.drawImage(image, 0, 0, 256, 256);
    const { data } = c.getImageData(0, 0, 256, 256), grey = Array.from({ length: 65536 }, (_, n) => data[4 * n]).sort((a, b) => a - b);
    const low = grey[655] / 255, high = Math.max(grey[64880] / 255, low + 0.02), brightness = 1 / (low + high);
    return { brightness, contrast: Math.min((low + high) / (high - low), 8) };
  }
}

function paint(c, image, x, y, width, height, k) {
  c.imageSmoothingEnabled = k * width / image.width < PIXELS;
  c.drawImage(adjusted(image), x, y, width, height);
}

const clip = ([left, top, right, bottom], width, height, more) => {
  const [dx, dy] = [more * (right - left), more * (bottom - top)];
  return [Math.max(Math.floor(left - dx), 0), Math.max(Math.floor(top - dy), 0), Math.min(Math.ceil(right + dx), width), Math.min(Math.ceil(bottom + dy), height)];
};
const covers = (a, b) => a[0] <= b[0] && a[1] <= b[1] && a[2] >= b[2] && a[3] >= b[3];

/** Move a canvas to a place of the stage, enlarged. */
export function moveTo(canvas, x, y, by) { canvas.style.transform = `translate(${x}px, ${y}px) scale(${by})`; }

const pictures = new WeakMap(); // numbers of pictures, by which canvases know what they show
let count = 0;

/** A name of a picture with its brightness. */
function look(image) {
  if (!pictures.has(image)) pictures.set(image, ++count);
  const { brightness, contrast, gamma } = layers.photograph;
  return `${pictures.get(image)} ${brightness} ${contrast} ${gamma}`;
}

/** A grey level with the chosen brightness, contrast and gamma. */
export function level(value, { brightness, contrast, gamma }) {
  const straight = (value / 255 * brightness - 0.5) * contrast + 0.5;
  return Math.round(255 * Math.min(Math.max(straight, 0), 1) ** (1 / gamma));
}

function fill(canvas, image) {
  canvas.width = image.width; canvas.height = image.height;
  const { brightness, contrast, gamma } = layers.photograph, plain = brightness === 1 && contrast === 1 && gamma === 1;
  const c = canvas.getContext("2d", { willReadFrequently: !plain });
  c.drawImage(image, 0, 0);
  if (plain) return;
  const pixels = c.getImageData(0, 0, image.width, image.height), { data } = pixels;
  const table = Uint8ClampedArray.from({ length: 256 }, (_, value) => level(value, layers.photograph));
  for (let n = 0; n < data.length; n += 4) { data[n] = table[data[n]]; data[n + 1] = table[data[n + 1]]; data[n + 2] = table[data[n + 2]]; }
  c.putImageData(pixels, 0, 0);
}

const made = new WeakMap(); // pictures with another brightness, by the ones that were sent

function adjusted(image) {
  const name = look(image), had = made.get(image);
  if (had?.name === name) return had.canvas;
  const canvas = had?.canvas ?? document.createElement("canvas");
  fill(canvas, image);
  made.set(image, { name, canvas });
  return canvas;
}
