// Colour maps of the layers, those of the recording; ranges; legends.

import { digits, request } from "/page/dom.js";
import { layers } from "/page/layers/settings.js";

/** Colours and widths of forces as the recording draws them; null until they are loaded. */
export let look = null;
export async function loadLook() {
  look ??= await request("force_look");
  look.ramps.motion ??= [...look.ramps.probability].reverse();
  look.ramps.grey ??= Array.from({ length: 64 }, (_, n) => `#${Math.round(40 + n / 63 * 215).toString(16).padStart(2, "0").repeat(3)}`);
}

/** Names of the colour maps; every one has monotonic lightness, so that it is read in grey and by everybody. */
export const MAPS = { force: "red to cream, of the recording", uncertainty: "slate to pale", probability: "yellow to blue", motion: "blue to yellow", gap: "cream to blue", difference: "blue, grey, yellow", grey: "grey" };

export const shadeOf = (ramp, t) => ramp[Math.round(Math.min(Math.max(t, 0), 1) * (ramp.length - 1))];

/** A scale from values to colours: the quantity's own map and range, or those that were chosen for the layer. */
export function scaleOf(name, { map, low, high }) {
  const chosen = layers[name], ramp = look?.ramps[chosen.map ?? map] ?? ["#888888"];
  const bottom = chosen.low ?? low, top = Math.max(chosen.high ?? high, bottom + 1e-12);
  return { low: bottom, high: top, ramp, own: chosen.map === null && chosen.low === null && chosen.high === null, colour: (value) => shadeOf(ramp, (value - bottom) / (top - bottom)) };
}

/** The range of finite values that leaves out a fiftieth at either end; about zero, for signed quantities. */
export function rangeOfValues(values, { zero = false, signed = false } = {}) {
  const sorted = values.filter((value) => value !== null && Number.isFinite(value)).sort((a, b) => a - b);
  if (!sorted.length) return [0, 1];
  const at = (part) => sorted[Math.round(part * (sorted.length - 1))];
  if (signed) { const most = Math.max(Math.abs(at(0.02)), Math.abs(at(0.98))) || 1; return [-most, most]; }
  return [zero ? 0 : at(0.02), at(0.98) || 1];
}

/** Signs that differ in shape as well as colour, with their names, in the place of a ramp. */
function drawSigns(c, k, x, y, words, signs) {
  c.font = `${12 / k}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`; c.textAlign = "left";
  c.fillStyle = "#e9ebf0"; c.fillText(words, x, y - 7 / k, WIDE / k);
  signs.forEach(({ words: name, colour, shape }, n) => {
    const [u, v] = [x + (5 + n * WIDE / signs.length) / k, y + 12 / k], path = new Path2D();
    if (shape === "bar") { path.moveTo(u, v - 5 / k); path.lineTo(u, v + 5 / k); } else path.arc(u, v, 3.6 / k, 0, 7);
    c.fillStyle = c.strokeStyle = colour; c.lineWidth = (shape === "bar" ? 3 : 1.6) / k;
    if (shape === "disc") c.fill(path); else c.stroke(path);
    c.fillStyle = "#e9ebf0"; c.fillText(name, u + 7 / k, v + 4 / k, (WIDE / signs.length - 14) / k);
  });
}

const WIDE = 170, TALL = 9, ROW = 58; // [px]

/** Legends of the scales, one above the other in the lower left corner. */
export function drawLegends(app, c, k, scales) {
  const { stage } = app, by = stage.enlarged;
  scales.forEach(({ words, unit = "", below = "", scale, signs = null }, n) => {
    const wide = WIDE / k, tall = TALL / k, [x, y] = stage.toPhotograph(16 * by, stage.boxHeight - (36 + ROW * n) * by);
    c.fillStyle = "#0c0e12e0"; c.beginPath(); c.roundRect(x - 6 / k, y - 22 / k, wide + 12 / k, 53 / k, 8 / k); c.fill();
    if (signs) { drawSigns(c, k, x, y, words, signs); return; }
    for (let m = 0; m < 34; m += 1) { c.fillStyle = shadeOf(scale.ramp, m / 33); c.fillRect(x + m * wide / 34, y, wide / 34 + 0.5 / k, tall); }
    c.fillStyle = "#e9ebf0"; c.font = `${12 / k}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`;
    c.textAlign = "left"; c.fillText(words, x, y - 7 / k, wide); c.fillText(`${below}${digits(scale.low, 3)}`, x, y + 24 / k);
    c.textAlign = "right"; c.fillText(`${digits(scale.high, 3)} ${unit}`, x + wide, y + 24 / k);
  });
  c.textAlign = "left";
}
