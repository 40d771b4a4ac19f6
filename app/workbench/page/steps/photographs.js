// Step 1: the photographs, their order, their times, and the region that is used.

import { polygonsOf } from "/page/layers/setup.js";
import { request, chart, colour, digits, fact, h, numberField, parse, sign, notify } from "/page/dom.js";
import { leaveOut, orderSection, shift } from "/page/parts/order.js";
import { saveScript } from "/page/parts/take_away.js";
import { tableField } from "/page/parts/tables.js";

const SOON = 400; // [ms]
const EDITED = "#f0e442";
let soon = 0, cutting = null, masking = null, brush = null, brushSize = 0, measured = null; // quality: { at, facts, faults, frame, light, contrast }, or { at, failed }; null while it is measured

export const photographs = {
  name: "photographs", title: "Photographs", frames: true, ofPhotographs: true,
  withTracks: (app) => [nameField(app), keepSection(app)],
  hint: () => (brush ? `Drag over what is to be ignored; brush of ${digits(2 * brush.radius, 3)} px, Shift+wheel or [ ] changes it; Esc ends` : cutting ? "Drag over the region to use" : masking ? `Click the corners of the part to be ignored (${masking.length}); Enter closes it, Esc ends` : ""),
  keyHelp: [["M", "mask a part: click its corners, Enter closes it"], ["B", "mask by a brush: drag; [ ] or Shift+wheel changes its size, Esc ends"], ["Alt+← Alt+→", "this photograph earlier, later in the order"], ["Del", "leave this photograph out"]],
  key(app, event) {
    if (event.key === "m") { maskBegins(app); return true; }
    if (event.key === "b" || (event.key === "Escape" && brush)) { brushBegins(app); return true; }
    if (brush && (event.key === "[" || event.key === "]")) { resizeBrush(app, event.key === "[" ? 1 / 1.15 : 1.15); return true; }
    if (event.key === "Delete") { leaveOut(app); return true; }
    if (event.altKey && (event.key === "ArrowLeft" || event.key === "ArrowRight")) { shift(app, event.key === "ArrowLeft" ? -1 : 1); return true; }
    if (!masking) return false;
    if (event.key === "Escape") { masking = null; app.tool(null); app.paint(); return true; }
    if (event.key === "Enter") { maskCloses(app); return true; }
    return false;
  },
  enter: (app) => { measured = null; measureSoon(app); },
  taken: measureSoon,
  leave: () => { cutting = null; masking = null; brush = null; },
  panel(app) {
    const { project } = app, section = project.photographs;
    return [
      fact("photographs", String(project.files.length)),
      fact("size", project.width ? `${project.width} × ${project.height} px` : "–"),
      nameField(app),
      section.times ? null : numberField("interval", section.interval, "s", (text) => app.queue(async () => {
        app.change("set_photographs", { interval: parse(text, "interval") });
      })),
      tableField(app, "times"),
      h("div", { class: "field" }, h("label", { htmlFor: "field-channel" }, "channel"), h("select", { id: "field-channel", onchange: (event) => app.change("set_photographs", { channel: event.target.value }) },
        ["grey", "red", "green", "blue"].map((name) => h("option", { value: name, selected: name === (section.channel ?? "grey") }, name)))),
      h("div", { class: "row" },
        h("button", { class: cutting ? "on" : "", id: "cut", onclick: () => { masking = null; brush = null; cutting = cutting ? null : []; app.tool(cutting ? cutTool(app) : null); app.paint(); } }, section.region ? "Change the region" : "Cut to a region"),
        section.region ? h("button", { onclick: () => app.change("set_photographs", { region: "all" }) }, "Use all of it") : null,
        h("button", { class: masking ? "on" : "", id: "mask", title: "M", onclick: () => maskBegins(app) }, "Mask a part"),
        h("button", { class: brush ? "on" : "", id: "brush", title: "B", onclick: () => brushBegins(app) }, "Mask by a brush"),
        polygonsOf(section).length ? h("button", { id: "unmask", onclick: () => app.change("set_photographs", { mask: polygonsOf(section).slice(0, -1) }) }, `Remove the last of ${polygonsOf(section).length} masks`) : null),
      h("div", { class: "field" }, h("label", { htmlFor: "field-rotation" }, "rotated by"), h("select", { id: "field-rotation", title: "Clockwise, with everything that is drawn on them", onchange: (event) => app.change("rotate", { rotation: Number(event.target.value) }) },
        [0, 90, 180, 270].map((angle) => h("option", { value: angle, selected: angle === (section.rotation ?? 0) }, `${angle}°`)))),
      project.files.length ? [h("h2", {}, "Quality"), quality(app)] : null,
      orderSection(app),
      keepSection(app),
    ];
  },
  layers: ["photograph", "mask", "walls", "rods", "marks"], below: ["mask", "rods", "walls"],
  draw: drawEdited,
};

const nameField = (app) => h("div", { class: "field" }, h("label", { htmlFor: "field-name" }, "name"), h("input", { id: "field-name", value: app.project.name, onchange: (event) => app.change("set_photographs", { name: event.target.value }) }));

/** A copy of the experiment, and its actions as a script. */
const keepSection = (app) => h("div", { class: "row" }, h("button", { id: "duplicate", title: "A new experiment beside this one, or below the folder that was opened, with the same settings, tables and photographs, without its run", onclick: () => app.queue(async () => { app.open(await request("duplicate", { at: app.project.at }), "photographs"); notify(`Duplicated: ${app.project.name}`); }, "Duplicating …", "duplicate") }, "Duplicate the experiment"),
  h("button", { id: "save-script", disabled: !app.project.undo, title: "Everything that was done here, verdicts included, as a Python script that does it again", onclick: () => saveScript(app) }, "Save the actions as a script"));

/** The corners of a new mask, a stroke of the brush and the brush, a new region. */
function drawEdited(app, c, k) {
  if (masking?.length) {
    c.beginPath(); masking.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y)));
    c.strokeStyle = EDITED; c.lineWidth = 2 / k; c.stroke();
    for (const [x, y] of masking) { c.fillStyle = EDITED; c.beginPath(); c.arc(x, y, 4 / k, 0, 7); c.fill(); }
  }
  if (brush) {
    c.strokeStyle = "#f0e442a0"; c.lineWidth = 2 * brush.radius; c.lineCap = c.lineJoin = "round";
    c.beginPath(); brush.stroke.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y))); c.stroke();
    c.lineCap = "butt"; c.lineJoin = "miter";
    const [x, y] = brush.stroke.at(-1) ?? brush.at ?? [NaN, NaN];
    for (const [wide, style] of [[4, "#000a"], [2, EDITED]]) { c.strokeStyle = style; c.lineWidth = wide / k; c.beginPath(); c.arc(x, y, brush.radius, 0, 7); c.stroke(); }
  }
  if (cutting?.length) { const [x0, y0, x1, y1] = cutting; c.strokeStyle = EDITED; c.lineWidth = 2 / k; c.strokeRect(x0, y0, x1 - x0, y1 - y0); }
}

/** Light, noise and pattern are measured in the background, once the photograph is shown. */
function measureSoon(app) { clearTimeout(soon); soon = setTimeout(() => measure(app), SOON); }

async function measure(app) {
  const { project } = app;
  if (!project?.files.length || app.step !== photographs) return;
  try {
    const answer = await request("quality", { at: project.at });
    if (app.project?.at === project.at && app.step === photographs) { measured = { at: project.at, ...answer }; app.paint(); }
  } catch { // the messages of the step state what is wrong
    if (app.project?.at === project.at && app.step === photographs) { measured = { at: project.at, failed: true }; app.paint(); }
  }
}

function quality(app) {
  if (measured?.at !== app.project.at) return h("p", { id: "measuring", role: "status" }, "Measuring light and pattern …");
  if (measured.failed) return h("p", { id: "not-measured" }, "Light and pattern are measured when every photograph can be read.");
  return [
    h("div", { class: "messages", id: "quality" }, [["good", measured.facts], ["doubtful", measured.faults]].flatMap(([mark, texts]) => texts.map((text) => h("p", {}, sign(mark), text)))),
    measured.frame.length > 1 ? [h("span", { class: "soft" }, "light (line) and contrast (dashed) over the photographs [of 255]"), chart(64, "light and contrast over the photographs", (c, width, height) => curves(app, c, width, height))] : null,
  ];
}

/** Mean grey level and contrast of the measured photographs; a bar marks the one that is shown. */
function curves(app, c, width, height) {
  if (!app.project || !measured?.frame) return; // drawn a moment later: somebody may have gone on
  const { frame, light, contrast } = measured, pad = 30, last = Math.max(app.project.files.length - 1, 1);
  const high = 1.08 * Math.max(...light, ...contrast, 1), x = (k) => pad + k / last * (width - pad - 8), y = (v) => height - 6 - v / high * (height - 14);
  c.fillStyle = colour("accent"); c.globalAlpha = 0.18; c.fillRect(x(app.frame) - 3, 2, 6, height - 4); c.globalAlpha = 1;
  for (const [values, dash] of [[light, []], [contrast, [4, 3]]]) {
    c.strokeStyle = c.fillStyle = colour("ink"); c.lineWidth = 1.5; c.setLineDash(dash); c.beginPath();
    values.forEach((v, k) => { if (k) c.lineTo(x(frame[k]), y(v)); else c.moveTo(x(frame[k]), y(v)); });
    c.stroke(); c.setLineDash([]);
    values.forEach((v, k) => { c.beginPath(); c.arc(x(frame[k]), y(v), 2, 0, 7); c.fill(); });
  }
  c.fillStyle = colour("soft"); c.font = "10.5px system-ui, sans-serif"; c.textAlign = "left";
  c.fillText(digits(high / 1.08, 3), 3, 13); c.fillText("0", 3, height - 4);
}

/** A round brush: a stroke is a part of the mask. */
function brushBegins(app) {
  cutting = null; masking = null;
  brush = brush ? null : { radius: brushSize || Math.max(Math.min(app.project.width, app.project.height) / 60, 4), stroke: [], at: null };
  app.tool(brush ? {
    cross: true,
    hover: (p) => { brush.at = p; },
    down: (p) => { brush.stroke = [p]; return true; },
    drag: (p) => { const [x, y] = brush.stroke.at(-1); if (Math.hypot(p[0] - x, p[1] - y) > 0.2 * brush.radius) brush.stroke.push(p); },
    up: (p) => {
      const points = [...brush.stroke, p].slice(-5000);
      app.change("brush_mask", { points, radius: brush.radius }).then(() => { if (brush) brush.stroke = []; app.stage.redraw(); });
    },
    wheel: (p, event) => { if (event.shiftKey) resizeBrush(app, (event.deltaY || event.deltaX) > 0 ? 1 / 1.15 : 1.15); return event.shiftKey; },
  } : null);
  app.paint();
}

function resizeBrush(app, by) {
  if (!brush) return;
  brushSize = brush.radius = Math.min(Math.max(brush.radius * by, 0.5), 2000);
  app.paint();
}

function maskBegins(app) {
  cutting = null; brush = null; masking = masking ? null : [];
  const near = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) * app.stage.view.k < 10;
  app.tool(masking ? { cross: true, click: (p) => {
    if (masking.length > 2 && near(p, masking[0])) { maskCloses(app); return; }
    masking.push(p); app.paint();
  } } : null);
  app.paint();
}

function maskCloses(app) {
  if (masking.length < 3) { notify("A mask has three corners or more", true); return; }
  const mask = [...polygonsOf(app.project.photographs), masking];
  masking = null; app.tool(null);
  app.change("set_photographs", { mask });
}

function cutTool(app) {
  const box = (a, b) => [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[0], b[0]), Math.max(a[1], b[1])];
  return {
    cross: true, down: () => true,
    drag: (p, event, from) => { cutting = box(from, p); },
    up: (p, event, from, moved) => {
      if (!moved) return;
      const { width, height } = app.project;
      const [x0, y0, x1, y1] = box(from, p).map(Math.round);
      const region = [Math.max(x0, 0), Math.max(y0, 0), Math.min(x1, width - 1), Math.min(y1, height - 1)];
      cutting = null; app.tool(null);
      if (region[2] - region[0] < 20 || region[3] - region[1] < 20) { notify("That region is too small", true); app.paint(); return; }
      app.change("set_photographs", { region });
    },
  };
}
