// Layers of the set-up below what a step edits: mask and region, walls, rods.

import { colour, strokeCircles } from "/page/dom.js";
import { drawWalls } from "/page/layers/rods.js";
import { paintLayer } from "/page/layers/settings.js";

// A mask is a picture, named by its file, or polygons.
export const polygonsOf = (section) => (Array.isArray(section.mask) ? section.mask : []);

/** Draw the layers of the set-up that a step names: it draws what it edits itself. */
export function drawSetup(app, c, k, names) {
  const { walls, rods, photographs } = app.project;
  const first = app.frame === 0; // rods and walls are marked on it
  if (names.includes("mask")) paintLayer(c, "mask", () => drawMask(app, c, k, photographs.region));
  if (names.includes("rods") && rods && first) paintLayer(c, "rods", () => strokeCircles(c, k, rods.id.map((_, n) => [rods.x[n], rods.y[n], rods.r[n]]).filter((each) => app.stage.sees(...each)), "#ced4e0a0", 1, { under: null }));
  if (names.includes("walls") && walls.length && first) drawWalls(c, k, walls.map(({ line, circle }) => (circle ? rim(circle) : line)));
}

const rim = ({ x, y, radius }) => Array.from({ length: 73 }, (_, n) => [x + radius * Math.cos(n * Math.PI / 36), y + radius * Math.sin(n * Math.PI / 36)]);

/** The ignored polygons, and what lies outside of the region. */
export function drawMask(app, c, k, region) {
  for (const polygon of polygonsOf(app.project.photographs)) {
    c.beginPath(); polygon.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y))); c.closePath();
    c.fillStyle = "#000b"; c.fill();
    c.strokeStyle = colour("accent"); c.lineWidth = 2 / k; c.stroke();
  }
  if (!region) return;
  const [x0, y0, x1, y1] = region;
  c.fillStyle = "#000a";
  c.beginPath(); c.rect(-0.5, -0.5, app.project.width, app.project.height); c.rect(x0, y0, x1 - x0, y1 - y0); c.fill("evenodd");
  c.strokeStyle = colour("accent"); c.lineWidth = 2 / k; c.strokeRect(x0, y0, x1 - x0, y1 - y0);
}
