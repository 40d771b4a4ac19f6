// Step 4: the rods of the first photograph: detected, added, deleted, moved, resized; their radii in classes.

import { request, chart, colour, digits, fact, h, parse, strokeCircles, notify } from "/page/dom.js";
import { siOf, measured, typed, unit, within } from "/page/units.js";

export const CLASS_COLOURS = ["#d8c641", "#1c7afa", "#9bffb4", "#e581b0", "#b4a5ff", "#b43c4b", "#695aa5", "#d20000"];
let chosen = null, held = null, quality = null, typedRadii = null, proposed = null;

export const rods = {
  name: "rods", title: "Rods", ofPhotographs: true, edits: 0,
  layers: ["photograph", "mask", "walls", "marks"], below: ["mask", "walls"],
  hint: (app) => (app.project.rods ? "Click chooses a rod or adds one; drag moves, Shift+wheel resizes, Delete removes it" : ""),
  keyHelp: [["Delete", "delete the chosen rod"], ["[ ]", "make it smaller, larger"], ["Shift+arrows", "move it by a quarter pixel"], ["N", "the next doubtful rod"]],
  enter: (app) => { chosen = null; held = null; proposed = null; typedRadii = (app.project.photographs.radii ?? []).map((r) => within("length", r, 6)).join(", "); },
  tool,
  panel(app) {
    const { project } = app, found = project.rods;
    typedRadii ??= "";
    const radii = () => typedRadii.split(/[,; ]+/).filter(Boolean).map((text) => typed("length", text, "radius"));
    return [
      h("p", {}, "Give the radii if you know them: detection is then reliable and fast. Without them rods of any size are detected, which takes a minute."),
      h("div", { class: "field" }, h("label", { htmlFor: "field-radii" }, "known radii"), h("div", { class: "with-unit" }, h("input", { id: "field-radii", value: typedRadii, placeholder: "7, 8, 11", onchange: (event) => { typedRadii = event.target.value; } }), h("span", {}, unit("length")))),
      h("button", { class: found ? "" : "primary", id: "detect", disabled: Boolean(typedRadii) && !project.pixel, onclick: () => app.queue(async () => {
        const answer = await request("detect_rods", { at: project.at, radii: radii() });
        quality = answer.quality; chosen = null; proposed = null; app.take(answer); notify(`${answer.rods?.id.length ?? 0} rods found`);
      }, "Detecting rods …", "detect") }, found ? "Detect them again" : "Detect rods"),
      found ? [
        h("div", { class: "fact" }, h("span", {}, "rods"), h("span", { class: "big" }, String(found.id.length))),
        chart(96, "histogram of the radii", (c, width, height) => histogram(app, c, width, height)),
        h("div", { class: "row" },
          h("button", { disabled: !project.pixel, onclick: () => app.queue(async () => { proposed = (await request("classes", { at: project.at })).radii; app.paint(); }) }, "Find classes"),
          proposed ? h("button", { class: "primary", onclick: () => { const radii = proposed; typedRadii = radii.map((r) => within("length", r, 4)).join(", "); proposed = null; app.change("set_classes", { radii }, "", () => notify("Every rod has the nearest class's radius")); } }, `Use ${proposed.map((r) => digits(r * 1e3, 4)).join(", ")} mm`) : null,
          radiiDiffer(project, typedRadii) && !proposed ? h("button", { onclick: () => app.queue(async () => { app.change("set_classes", { radii: radii() }); }) }, "Snap to the known radii") : null),
        project.outside.length ? h("button", { id: "drop-outside", onclick: () => app.change("drop_outside", {}, "", () => { chosen = null; notify("Dropped. Undo brings them back"); }) }, `Drop the ${project.outside.length} outside the walls`) : null,
        chosenCard(app),
      ] : null,
    ];
  },
  draw(app, c, k) {
    const found = app.project.rods;
    if (!found) return;
    const outside = new Set(app.project.outside), classes = classesOf(app.project), groups = new Map();
    found.id.forEach((id, n) => {
      const at = held && held.id === id && held.pose ? held.pose : [found.x[n], found.y[n], found.r[n]];
      if (!app.stage.sees(...at)) return;
      const weak = quality && quality.length === found.id.length && quality[n] < 0.45, style = id === chosen ? "#ffffff" : outside.has(id) ? "#d55e00" : classes(found.r[n]), name = `${style} ${Boolean(weak)}`;
      if (!groups.has(name)) groups.set(name, { style, weak, circles: [] });
      groups.get(name).circles.push(at);
    });
    for (const { style, weak, circles } of groups.values()) strokeCircles(c, k, circles, style, style === "#ffffff" ? 3 : 1.6, { dash: weak ? [5, 4] : null, under: "#000a" });
    if (held?.adding) { c.beginPath(); c.arc(held.p[0], held.p[1], held.r, 0, 2 * Math.PI); c.lineWidth = 2 / k; c.strokeStyle = "#fff"; c.stroke(); }
  },
  key(app, event) {
    const found = app.project.rods, n = found ? found.id.indexOf(chosen) : -1;
    if (event.key === "n" && found) { nextDoubtful(app); return true; }
    if (event.key === "Escape") { chosen = null; held = null; app.paint(); return true; }
    if (n < 0) return false;
    if (event.key === "Delete" || event.key === "Backspace") { const id = chosen; chosen = null; app.change("delete_rods", { ids: [id] }); return true; }
    const by = { ArrowLeft: [-0.25, 0, 0], ArrowRight: [0.25, 0, 0], ArrowUp: [0, -0.25, 0], ArrowDown: [0, 0.25, 0] }[event.shiftKey ? event.key : ""] ?? { "[": [0, 0, -0.25], "]": [0, 0, 0.25] }[event.key];
    if (!by) return false;
    found.x[n] += by[0]; found.y[n] += by[1]; found.r[n] += by[2]; // at once: the next press begins there, however slow the answer
    app.change("move_rod", { id: chosen, x: found.x[n], y: found.y[n], radius: found.r[n] });
    app.stage.redraw();
    return true;
  },
};

const radiiDiffer = (project, text) => Boolean(text) && project.rods && project.pixel;

function classesOf(project) {
  const radii = [...(project.photographs.radii ?? [])].sort((a, b) => a - b);
  if (!radii.length || !project.pixel) return () => CLASS_COLOURS[0];
  return (r) => { let best = 0; radii.forEach((each, k) => { if (Math.abs(each - r * project.pixel) < Math.abs(radii[best] - r * project.pixel)) best = k; }); return CLASS_COLOURS[best % CLASS_COLOURS.length]; };
}

function chosenCard(app) {
  const found = app.project.rods, n = found.id.indexOf(chosen), pixel = app.project.pixel;
  if (n < 0) return h("p", {}, "Click a rod in the photograph to see it here.");
  return h("div", { class: "card here" }, fact("rod", String(chosen)), fact("centre", `${digits(found.x[n], 6)}, ${digits(found.y[n], 6)} px`),
    fact("radius", `${digits(found.r[n], 5)} px${pixel ? ` · ${measured("length", found.r[n] * pixel)}` : ""}`),
    quality && quality.length === found.id.length ? fact("outline seen", `${Math.round(quality[n] * 100)} %`) : null,
    h("div", { class: "row" }, h("button", { onclick: () => { const id = chosen; chosen = null; app.change("delete_rods", { ids: [id] }); } }, "Delete"), h("button", { onclick: () => nextDoubtful(app) }, "Next doubtful")));
}

function nextDoubtful(app) {
  const found = app.project.rods;
  if (!quality || quality.length !== found.id.length) { notify("Detect the rods first: their quality is known then"); return; }
  const order = [...quality.keys()].sort((a, b) => quality[a] - quality[b]);
  const n = order[(order.indexOf(found.id.indexOf(chosen)) + 1) % order.length];
  chosen = found.id[n];
  app.stage.centre(found.x[n], found.y[n], 120 / found.r[n]);
  app.paint();
}

function under(app, p) {
  const found = app.project.rods;
  if (!found) return -1;
  let best = -1, least = 1;
  found.id.forEach((id, n) => { const away = Math.hypot(found.x[n] - p[0], found.y[n] - p[1]) / found.r[n]; if (away < least) { least = away; best = n; } });
  return best;
}

function tool(app) {
  return {
    cross: true,
    down: (p) => {
      const found = app.project.rods, n = under(app, p);
      if (n < 0) return false; // the picture is moved, or a click adds one
      held = { id: found.id[n], n, from: p, pose: null };
      chosen = found.id[n];
      app.paint();
      return true;
    },
    drag: (p, event, from) => { const found = app.project.rods; held.pose = [found.x[held.n] + p[0] - from[0], found.y[held.n] + p[1] - from[1], found.r[held.n]]; },
    up: (p, event, from, moved) => {
      const done = held;
      if (!moved || !done.pose) { held = null; return; }
      app.change("move_rod", { id: done.id, x: done.pose[0], y: done.pose[1], radius: done.pose[2] }).then(() => { held = null; app.stage.redraw(); });
    },
    click: (p) => {
      const found = app.project.rods;
      const sizes = found ? [...found.r].sort((a, b) => a - b) : [20];
      const inside = under(app, p) >= 0;
      if (inside) return;
      app.queue(async () => {
        const before = new Set(app.project.rods?.id ?? []);
        app.take(await request("add_rod", { at: app.project.at, x: p[0], y: p[1], radius: sizes[sizes.length >> 1] }));
        chosen = app.project.rods.id.find((id) => !before.has(id)) ?? null;
        app.paint();
      }, "Looking for its rim …", `add ${p.map((each) => Math.round(each / 3))}`);
    },
    wheel: (p, event) => {
      if (!event.shiftKey || chosen === null) return false;
      const found = app.project.rods, n = found.id.indexOf(chosen);
      if (n < 0) return false;
      const by = (event.deltaY || event.deltaX) > 0 ? -0.25 : 0.25;
      found.r[n] += by;
      app.change("move_rod", { id: chosen, x: found.x[n], y: found.y[n], radius: found.r[n] });
      app.stage.redraw();
      return true;
    },
  };
}

function histogram(app, c, width, height) {
  const { rods: found, pixel } = app.project, per = pixel ? pixel / siOf("length") : 1, values = found.r.map((r) => r * per);
  const low = Math.min(...values) * 0.9, high = Math.max(...values) * 1.1, bins = 48, counts = new Array(bins).fill(0);
  for (const value of values) counts[Math.min(bins - 1, Math.floor((value - low) / (high - low || 1) * bins))] += 1;
  const most = Math.max(...counts), classes = classesOf(app.project), base = height - 20;
  counts.forEach((count, k) => {
    if (!count) return;
    c.fillStyle = classes((low + (k + 0.5) / bins * (high - low)) / per);
    const tall = Math.max(2, (base - 8) * Math.sqrt(count / most));
    c.fillRect(8 + k / bins * (width - 16), base - tall, (width - 16) / bins - 1, tall);
  });
  c.fillStyle = colour("soft"); c.font = "11px system-ui, sans-serif"; c.textAlign = "left"; c.fillText(`${digits(low, 3)}`, 8, height - 6);
  c.textAlign = "right"; c.fillText(`${digits(high, 3)} ${pixel ? unit("length") : "px"}`, width - 8, height - 6); c.textAlign = "center"; c.fillText("radius", width / 2, height - 6);
  for (const radius of proposed ?? []) { const x = 8 + (radius / siOf("length") - low) / (high - low) * (width - 16); c.strokeStyle = colour("ink"); c.setLineDash([3, 3]); c.beginPath(); c.moveTo(x, 4); c.lineTo(x, base); c.stroke(); c.setLineDash([]); }
}
