// Step 2: the size of a pixel: two points and their distance, rods of known radius, or the number.

import { request, digits, fact, h, numberField, notify, sign } from "/page/dom.js";
import { lensForm } from "/page/parts/lens.js";
import { choice, measured, typed, unit, within } from "/page/units.js";

const ALIKE = 0.02; // greatest relative difference of the scales of two rods
let mode = "distance", line = null, metres = null, rods = [], drawn = null, held = null;

export const scale = {
  name: "scale", title: "Scale", ofPhotographs: true, edits: 0,
  layers: ["photograph", "mask", "walls", "rods", "marks"], below: ["mask", "rods", "walls"],
  hint: () => (mode === "distance" ? "Drag from one end of a known length to the other; drag an end to correct it" : mode === "rods" ? "Drag from the middle of a rod to its rim; it snaps to the outline" : ""),
  enter(app) {
    const given = app.project.photographs.distance;
    rods = []; drawn = null;
    if (given) { line = [given.start, given.end]; metres = given.metres; mode = "distance"; } else { line = null; metres = null; }
  },
  drawn: () => line, // for tests
  tool: (app) => tools(app)[mode],
  panel(app) {
    const { project } = app, pixel = project.pixel;
    const length = line ? Math.hypot(line[1][0] - line[0][0], line[1][1] - line[0][1]) : null;
    const pick = (name, words) => h("button", { class: mode === name ? "on" : "", onclick: () => { mode = name; app.tool(tools(app)[mode]); app.paint(); } }, words);
    return [
      h("div", { class: "chips" }, pick("distance", "A known length"), pick("rods", "Known rods"), pick("number", "The number")),
      mode === "distance" ? [
        h("p", {}, "The farther apart the two points, the better: the whole frame, or a ruler in the rods' plane."),
        fact("drawn", length ? `${digits(length, 5)} px` : "nothing yet"),
        numberField("distance", metres === null ? "" : within("length", metres, 7), unit("length"), (text) => { app.queue(async () => { metres = typed("length", text, "distance"); send(app); }); }, { disabled: !line }),
      ] : null,
      mode === "rods" ? [
        h("p", {}, "Measure a few rods of radii that you know; their sum sets the scale."),
        rods.map((rod, k) => h("div", { class: "row known" }, fact(`rod ${k + 1}`, `${digits(rod.r, 5)} px${rod.seen ? "" : ", as drawn"}`), numberField(`radius ${"abcdefghij"[k] ?? ""}`, rod.radius ? within("length", rod.radius, 6) : "", unit("length"), (text) => app.queue(async () => { rod.radius = typed("length", text, "radius"); app.paint(); })),
          h("button", { class: "quiet", title: "Remove it", onclick: () => { rods.splice(k, 1); app.paint(); } }, "✕"))),
        disagreeing().length ? h("div", { class: "messages", id: "disagreeing" }, h("p", {}, sign("doubtful"), `The radii disagree: rod ${disagreeing().join(", ")} by more than ${100 * ALIKE} %. Is its radius another one, or its circle beside the rim?`)) : null,
        rods.length ? h("button", { class: "primary", disabled: rods.some((rod) => !rod.radius), onclick: () => app.change("set_scale", { rods: rods.map((rod) => ({ radius: rod.radius, pixels: rod.r })) }, "", reportScale) }, "Set the scale by these") : null,
      ] : null,
      mode === "number" ? numberField("pixel size", pixel ? within("length", pixel, 7) : "", unit("length"), (text) => app.queue(async () => { const size = typed("length", text, "pixel size"); app.change("set_scale", { pixel_size: size }, "", reportScale); })) : null,
      h("h2", {}, "Found"),
      h("div", { class: "fact" }, h("span", {}, "one pixel"), h("span", { class: "big" }, pixel ? measured("length", pixel) : "–")),
      pixel ? fact("picture", `${within("length", pixel * project.width)} × ${measured("length", pixel * project.height)}`) : null,
      choice("length", app),
      lensForm(app),
    ];
  },
  draw(app, c, k) {
    if (mode === "distance" && line) drawLength(c, k, line, metres);
    if (mode === "rods") for (const rod of [...rods, ...(drawn ? [drawn] : [])]) {
      c.beginPath(); c.arc(rod.x, rod.y, rod.r, 0, 2 * Math.PI); c.strokeStyle = "#f0e442"; c.lineWidth = 2 / k; c.stroke();
      c.beginPath(); c.moveTo(rod.x - 5 / k, rod.y); c.lineTo(rod.x + 5 / k, rod.y); c.moveTo(rod.x, rod.y - 5 / k); c.lineTo(rod.x, rod.y + 5 / k); c.stroke();
    }
  },
  legend(app, c, k) { if (app.project.pixel) drawBar(app, c, k); },
  key(app, event) {
    if (event.key !== "Escape") return false;
    drawn = null; rods = []; app.paint();
    return true;
  },
};

/** Numbers of the rods whose scale differs from the median of all. */
function disagreeing() {
  const size = rods.map((rod) => rod.radius / rod.r), ordered = size.filter((each) => each > 0).sort((a, b) => a - b);
  if (ordered.length < 2) return [];
  const middle = ordered[Math.floor(ordered.length / 2)];
  return size.flatMap((each, k) => (each > 0 && Math.abs(each / middle - 1) > ALIKE ? [k + 1] : []));
}

const reportScale = (project) => notify(`One pixel is ${measured("length", project.pixel, 5)}`);

function send(app) {
  if (line && metres) app.change("set_scale", { line, metres }, "", reportScale);
  else app.paint();
}

function tools(app) {
  const near = (p) => line?.findIndex((end) => Math.hypot(end[0] - p[0], end[1] - p[1]) * app.stage.view.k < 12) ?? -1;
  return {
    distance: {
      cross: true, loupe: true,
      down: (p) => { held = near(p); if (held < 0) { line = [p, p]; held = 1; } return true; },
      drag: (p) => { line = line.map((end, k) => (k === held ? p : end)); },
      up: (p, event, from, moved) => {
        if (!moved && Math.hypot(line[1][0] - line[0][0], line[1][1] - line[0][1]) < 5) line = null;
        send(app);
        if (line && !metres) document.getElementById("field-distance")?.focus();
      },
    },
    rods: {
      cross: true, loupe: true,
      down: (p) => { drawn = { x: p[0], y: p[1], r: 1 }; return true; },
      drag: (p, event, from) => { drawn = { x: from[0], y: from[1], r: Math.hypot(p[0] - from[0], p[1] - from[1]) }; },
      up: (p, event, from, moved) => {
        const rough = drawn;
        if (!moved || rough.r < 3) { drawn = null; return; }
        app.queue(async () => {
          const found = await request("measure_rod", { at: app.project.at, x: rough.x, y: rough.y, radius: rough.r });
          rods.push({ ...found, radius: rods.at(-1)?.radius ?? null }); drawn = null; app.paint();
          if (!found.seen) notify("No rim is seen there: the radius is as drawn", true);
        }, "Looking for the rim …");
      },
    },
    number: {},
  };
}

function drawLength(c, k, [a, b], metres) {
  const along = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1, n = [-(b[1] - a[1]) / along * 9 / k, (b[0] - a[0]) / along * 9 / k];
  for (const [width, style] of [[4.5, "#000b"], [2, "#f0e442"]]) {
    c.lineWidth = width / k; c.strokeStyle = style; c.beginPath();
    c.moveTo(...a); c.lineTo(...b);
    for (const end of [a, b]) { c.moveTo(end[0] - n[0], end[1] - n[1]); c.lineTo(end[0] + n[0], end[1] + n[1]); }
    c.stroke();
  }
  label(c, k, (a[0] + b[0]) / 2 + n[0] * 2, (a[1] + b[1]) / 2 + n[1] * 2, metres ? measured("length", metres, 6) : `${digits(along, 5)} px`);
}

/** A round length in the corner of the picture. */
function drawBar(app, c, k) {
  const { stage, project } = app, wide = 150 / k * project.pixel;
  const power = 10 ** Math.floor(Math.log10(wide)), metres = [5, 2, 1].map((m) => m * power).find((m) => m <= wide) ?? power;
  const [x, y] = stage.toPhotograph(stage.boxWidth - 24 * stage.enlarged, stage.boxHeight - 22 * stage.enlarged);
  const left = x - metres / project.pixel;
  c.fillStyle = "#000a"; c.fillRect(left - 8 / k, y - 24 / k, x - left + 16 / k, 34 / k);
  c.fillStyle = "#fff"; c.fillRect(left, y, x - left, 3 / k);
  c.font = `${13 / k}px system-ui, sans-serif`; c.textAlign = "center"; c.fillText(measured("length", metres, 3), (left + x) / 2, y - 7 / k);
}

export function label(c, k, x, y, text, style = "#fff") {
  c.font = `600 ${13 / k}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`; c.textAlign = "center"; c.textBaseline = "middle";
  const wide = c.measureText(text).width + 14 / k;
  c.fillStyle = "#0c0e12e0"; c.beginPath(); c.roundRect(x - wide / 2, y - 11 / k, wide, 22 / k, 6 / k); c.fill();
  c.fillStyle = style; c.fillText(text, x, y + 0.5 / k);
  c.textBaseline = "alphabetic";
}
