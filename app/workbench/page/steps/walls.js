// Step 3: the bars around the packing: drawn or found, named, loaded or tracked.

import { h, numberField, notify } from "/page/dom.js";
import { label } from "/page/steps/scale.js";
import { tableField } from "/page/parts/tables.js";
import { choice, measured, typed, unit, within } from "/page/units.js";

let chosen = null, line = null, held = null, snap = true, round = null, points = []; // round: the circle that is dragged; points: of a new one, null while bars are drawn
const drawing = { circle: false, corner: false };
const KINDS = [["Straight bars", "draw-bars", "bars"], ["Circle", "draw-circle", "circle"], ["Corner disc", "draw-corner", "corner"]];
const kindDrawn = () => (drawing.corner ? "corner" : drawing.circle ? "circle" : "bars");
const draw = (kind) => { letGo(); drawing.circle = kind === "circle"; drawing.corner = kind === "corner"; };
const TURNED = 0.2; // [rad] by which two bars meet no more

export const walls = {
  name: "walls", title: "Walls", ofPhotographs: true, edits: 0,
  layers: ["photograph", "mask", "rods", "marks"], below: ["mask", "rods"],
  hint: (app) => (app.project.pixel ? drawing.corner ? "Click a disc in a corner of the frame: its rim is found" : drawing.circle ? `Click three points on the rim, far apart (${points.length} of 3); drag its centre or rim to correct it` : "Drag along the inner edge of a bar, or an end to correct it" : "Set the scale first"),
  keyHelp: [["Delete", "delete the chosen wall"], ["S", "snap to the edge, or not"], ["C", "draw circles, corner discs, or bars"]],
  enter: (app) => { chosen = null; draw(app.project.walls.length > 0 && app.project.walls.every((wall) => wall.circle) ? "circle" : "bars"); },
  tool: (app) => (app.project.pixel ? tool(app) : null),
  panel(app) {
    const { project } = app;
    if (!project.pixel) return h("p", {}, "Walls are given in metres. Set the scale first (step 2); then the bars can be drawn or found here.");
    return [
      h("p", {}, "The packing lies between bars. Give a pressure where a plate loads it; every other bar has its measured motion."),
      h("div", { class: "chips", role: "group", "aria-label": "kind of wall" }, KINDS.map(([words, id, kind]) => h("button", { class: kindDrawn() === kind ? "on" : "", "aria-pressed": String(kindDrawn() === kind), id, onclick: () => { draw(kind); app.paint(); } }, words))),
      drawing.circle ? h("div", { class: "row" }, h("button", { class: project.walls.length ? "" : "primary", id: "find-circle", disabled: !project.rods, title: project.rods ? "the least circle that holds them all" : "needs the rods: step 4", onclick: () => app.change("draw_circle", { name: project.walls.find((wall) => wall.name === chosen)?.circle ? chosen : null }, "", (given) => { chosen = given.wall; app.paint(); notify("The least circle around the rods"); }) }, "Around the rods"),
        snapButton(app))
        : h("div", { class: "row" },
        h("button", { class: project.walls.length ? "" : "primary", id: "find-walls", disabled: !project.rods, title: project.rods ? "" : "needs the rods: step 4", onclick: () => app.change("find_walls", {}, "Finding the bars …", (given) => notify(given.discs ? `${given.bars} bars and ${given.discs} discs in their corners found` : `${given.bars} bars found`)) }, "Find the bars around the rods"),
        snapButton(app)),
      project.walls.map((wall, k) => card(app, wall, k)),
      project.walls.length ? [h("h2", {}, "Measured at walls"), tableField(app, "load"), tableField(app, "forces"), choice("pressure", app)] : null,
    ];
  },
  draw(app, c, k) {
    const drawn = app.project.walls.map((wall) => (held && wall.name === held.name ? { ...wall, line: line ?? wall.line, circle: round ?? wall.circle } : wall));
    drawn.forEach((wall) => (wall.circle ? drawCircle : drawWall)(app, c, k, wall));
    for (const p of points) { c.fillStyle = "#fff"; c.beginPath(); c.arc(p[0], p[1], 5 / k, 0, 7); c.fill(); c.strokeStyle = "#000"; c.lineWidth = 1.5 / k; c.stroke(); }
    if (line && !held?.name) drawWall(app, c, k, { name: "", line, pressure: null, colour: "#ffffff", dash: [] });
  },
  key(app, event) {
    if (event.key === "Delete" && chosen) { app.change("delete_wall", { name: chosen }); chosen = null; return true; }
    if (event.key === "s") { snap = !snap; app.paint(); return true; }
    if (event.key === "c") { draw({ bars: "circle", circle: "corner", corner: "bars" }[kindDrawn()]); app.paint(); return true; }
    if (event.key === "Escape") { letGo(); chosen = null; app.paint(); return true; }
    return false;
  },
};

const snapButton = (app) => h("button", { class: snap ? "on" : "", onclick: () => { snap = !snap; app.paint(); }, title: "S" }, "Snap to edges");
const letGo = () => { line = null; held = null; round = null; points = []; };

function card(app, wall, k) {
  const long = Math.hypot(wall.line[1][0] - wall.line[0][0], wall.line[1][1] - wall.line[0][1]) * app.project.pixel;
  const plate = (values) => app.change("set_plate", { name: wall.name, pressure: wall.pressure, ends: wall.ends, ...values });
  return h("div", { class: `card ${wall.name === chosen ? "here" : ""}`, id: `wall-${wall.name}`, onclick: (event) => { if (event.target.tagName === "DIV" && chosen !== wall.name) { chosen = wall.name; app.paint(); } } },
    h("div", { class: "row" }, swatch(wall),
      h("input", { value: wall.name, style: { flex: "1", fontWeight: 600 }, "aria-label": "name of the wall", id: `wall-name-${k}`, onchange: (event) => app.change("rename_wall", { name: wall.name, to: event.target.value.trim() }) }),
      h("span", { class: "soft" }, wall.circle ? `r ${measured("length", wall.circle.radius * app.project.pixel)}` : measured("length", long)),
      h("button", { class: "quiet", title: "Delete this wall", onclick: () => app.change("delete_wall", { name: wall.name }) }, "✕")),
    wall.corner ? h("p", { class: "soft" }, "A disc in a corner of the frame: it moves with its bar, and shares its load.") : numberField(`pressure ${wall.name}`, wall.pressure === null ? "" : within("pressure", wall.pressure, 6), unit("pressure"), (text) => app.queue(async () => {
      plate({ pressure: text === "" ? null : typed("pressure", text, "pressure") });
    }), { placeholder: "measured motion" }),
    wall.corner ? null : wall.circle ? h("div", { class: "field" }, h("label", { htmlFor: `side-${k}` }, "packing is"), h("select", { id: `side-${k}`, onchange: (event) => { const { x, y, radius } = wall.circle, side = event.target.value; if (side === "corner") app.change("make_corner", { name: wall.name }); else app.change("draw_circle", { name: wall.name, place: [x, y, radius], side }); } },
      [["in", "inside the circle"], ["out", "outside it"], ["corner", "outside it, a disc in a corner of the frame"]].map(([value, words]) => h("option", { value, selected: value === (wall.corner ? "corner" : wall.circle.side) }, words))))
    : h("div", { class: "field" }, h("label", { htmlFor: `ends-${k}`, title: "points of the bar: they move with it; corners: where bars meet, and the bar slides along; automatic: corners where their distance changes" }, "its ends are"), h("select", { id: `ends-${k}`, onchange: (event) => plate({ ends: event.target.value }) },
      [["auto", "found automatically"], ["bar", "points of the bar"], ["corner", "corners"]].map(([value, words]) => h("option", { value, selected: value === wall.ends }, words)))));
}

function tool(app) {
  const close = (x, y, p) => Math.hypot(x - p[0], y - p[1]) * app.stage.view.k < 11;
  const near = (p) => {
    for (const wall of app.project.walls) {
      if (wall.circle) {
        const { x, y, radius } = wall.circle;
        if (close(x, y, p)) return { name: wall.name, part: "centre", circle: wall.circle };
        if (Math.abs(Math.hypot(x - p[0], y - p[1]) - radius) * app.stage.view.k < 8) return { name: wall.name, part: "rim", circle: wall.circle };
      } else for (const end of [0, 1]) if (close(...wall.line[end], p)) return { name: wall.name, end };
    }
    return null;
  };
  return {
    cross: true, loupe: true,
    down: (p) => {
      const found = near(p);
      if (drawing.corner || (!found && drawing.circle)) return false; // the picture is moved, or a click is a point of the rim
      held = found ?? { name: null, end: 1 };
      if (found && !found.part) held.old = app.project.walls.find((wall) => wall.name === found.name).line;
      if (held.part) round = { ...held.circle };
      else line = found ? app.project.walls.find((wall) => wall.name === found.name).line.map((end) => [...end]) : [p, p];
      if (found) chosen = found.name;
      return true;
    },
    drag: (p, event, from) => {
      if (held.part === "centre") round = { ...round, x: held.circle.x + p[0] - from[0], y: held.circle.y + p[1] - from[1] };
      else if (held.part) round = { ...round, radius: Math.hypot(p[0] - round.x, p[1] - round.y) };
      else if (held.old && (held.name === null || turned(held.old, held.end, p))) { line = [held.old[held.end], p]; held.name = null; } // the next bar begins where this one ends
      else line = line.map((end, k) => (k === held.end ? p : end));
    },
    click: (p) => {
      if (drawing.corner) {
        app.change("find_corner", { x: p[0], y: p[1] }, "Finding its rim …", (given) => { chosen = given.wall; app.paint(); notify(`${given.wall}: a disc of radius ${measured("length", given.walls.find((wall) => wall.name === given.wall).circle.radius * given.pixel)}`); });
        return;
      }
      if (!drawing.circle) return;
      points.push(p);
      if (points.length < 3) { app.paint(); return; }
      const through = points;
      points = [];
      app.change("draw_circle", { points: through, snap }, "", (given) => { chosen = given.wall; app.paint(); unseen(given); }).then(() => app.paint());
    },
    up: (p, event, from, moved) => {
      const { name, part } = held;
      if (part) {
        const { x, y, radius, side } = round;
        if (!moved) { letGo(); app.paint(); return; }
        app.change("draw_circle", { name, place: [x, y, radius], side, snap: snap && !event.shiftKey }, "", unseen).then(() => { letGo(); app.paint(); });
        return;
      }
      const drawn = line;
      if (!moved || Math.hypot(drawn[1][0] - drawn[0][0], drawn[1][1] - drawn[0][1]) < 20) {
        letGo();
        chosen = name ?? nearest(app, p) ?? null;
        app.paint();
        return;
      }
      app.change("draw_wall", { line: drawn, name, snap: snap && !event.shiftKey }, "", (given) => {
        chosen = given.wall; letGo(); app.paint();
        unseen(given);
      }).then(() => { letGo(); app.stage.redraw(); });
    },
  };
}

/** A notice that no edge was found to snap to. */
function unseen(given) { if (given.snapped !== null && given.snapped < 0.34) notify("No clear edge beside it: the line is kept as drawn", true); }

/** A bar with its end there would have another direction: such a drag draws a new bar. */
function turned(old, end, p) {
  const far = old[1 - end], a = [old[end][0] - far[0], old[end][1] - far[1]], b = [p[0] - far[0], p[1] - far[1]];
  return Math.abs(Math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])) > TURNED;
}

function nearest(app, p) {
  const away = ({ line: [a, b] }) => { const l = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1; return Math.abs((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / l; };
  const [best] = app.project.walls.filter((wall) => !wall.circle).map((wall) => [away(wall), wall.name]).sort((a, b) => a[0] - b[0]);
  return best && best[0] * app.stage.view.k < 14 ? best[1] : null;
}

/** A short piece of a wall's line, beside its name. */
const swatch = ({ colour, dash: [drawn, open] }) => h("span", { class: "swatch", style: { width: "18px", background: drawn ? `repeating-linear-gradient(90deg, ${colour} 0 ${drawn / 2}px, transparent ${drawn / 2}px ${(drawn + open) / 2}px)` : colour } });

/** A wall's line over a dark one; walls of one colour differ by their dashes. */
function strokeWall(c, k, { name, colour, dash }, trace) {
  const wide = name && name === chosen ? [7, 3.5] : [5, 2.2];
  for (const [width, paint, gaps] of [[wide[0], "#000c", []], [wide[1], colour, dash]]) { c.strokeStyle = paint; c.lineWidth = width / k; c.setLineDash(gaps.map((each) => each / k)); c.beginPath(); trace(); c.stroke(); }
  c.setLineDash([]);
}

function drawWall(app, c, k, wall) {
  const [a, b] = wall.line, l = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const n = [(b[1] - a[1]) / l, -(b[0] - a[0]) / l]; // towards the packing: y points down
  const here = wall.name === chosen, style = wall.colour;
  strokeWall(c, k, wall, () => { c.moveTo(...a); c.lineTo(...b); });
  const loaded = wall.pressure !== null && wall.pressure !== undefined, count = loaded ? 7 : 3, size = (loaded ? 26 : 9) / k;
  for (let m = 0; m < count; m += 1) {
    const t = (m + 0.5) / count, x = a[0] + (b[0] - a[0]) * t, y = a[1] + (b[1] - a[1]) * t;
    const from = loaded ? [x - n[0] * size, y - n[1] * size] : [x, y], to = loaded ? [x, y] : [x + n[0] * size, y + n[1] * size];
    c.strokeStyle = style; c.lineWidth = 2 / k; c.beginPath(); c.moveTo(...from); c.lineTo(...to);
    const u = [n[0] * 6 / k, n[1] * 6 / k];
    c.moveTo(to[0] - u[0] + u[1] * 0.7, to[1] - u[1] - u[0] * 0.7); c.lineTo(...to); c.lineTo(to[0] - u[0] - u[1] * 0.7, to[1] - u[1] + u[0] * 0.7); c.stroke();
  }
  c.fillStyle = style;
  for (const end of [a, b]) { c.beginPath(); c.arc(end[0], end[1], (here ? 5.5 : 4) / k, 0, 2 * Math.PI); c.fill(); }
  const low = app.stage.toPhotograph(0, app.stage.boxHeight - 14)[1], high = app.stage.toPhotograph(0, 56)[1];
  if (wall.name) label(c, k, (a[0] + b[0]) / 2 - n[0] * 44 / k, Math.min(Math.max((a[1] + b[1]) / 2 - n[1] * 44 / k, high), low), loaded ? `${wall.name} · ${measured("pressure", wall.pressure)}` : wall.name, style);
}

function drawCircle(app, c, k, wall) {
  const { x, y, radius, side } = wall.circle, here = wall.name === chosen, style = wall.colour, loaded = wall.pressure !== null && wall.pressure !== undefined;
  strokeWall(c, k, wall, () => c.arc(x, y, radius, 0, 2 * Math.PI));
  const to = side === "in" ? -1 : 1, size = (loaded ? 26 : 9) / k;
  for (let m = 0; m < 12; m += 1) {
    const u = [Math.cos((m + 0.5) * Math.PI / 6), Math.sin((m + 0.5) * Math.PI / 6)], foot = loaded ? radius - to * size : radius, tip = loaded ? radius : radius + to * size, head = tip - to * 6 / k;
    c.strokeStyle = style; c.lineWidth = 2 / k; c.beginPath(); c.moveTo(x + u[0] * foot, y + u[1] * foot); c.lineTo(x + u[0] * tip, y + u[1] * tip);
    for (const turn of [-1, 1]) { c.moveTo(x + u[0] * tip, y + u[1] * tip); c.lineTo(x + u[0] * head + turn * u[1] * 4 / k, y + u[1] * head - turn * u[0] * 4 / k); }
    c.stroke();
  }
  c.fillStyle = style; c.beginPath(); c.arc(x, y, (here ? 5.5 : 4) / k, 0, 7); c.fill();
  label(c, k, x, y + 22 / k, loaded ? `${wall.name} · ${measured("pressure", wall.pressure)}` : wall.name, style);
}
