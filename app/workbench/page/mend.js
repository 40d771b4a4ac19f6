// Step 7: rods that tracking lost or took for others: picked, dragged, turned, correlated again from there at once.

import { ask, colour, digits, fact, h, tell } from "/page/dom.js";

let told = null, chosen = null, ghost = null, held = null, mended = null, patch = null, wanted = "", waiting = false, next = null, only = false;

export const mend = {
  name: "mend", title: "Mend", frames: true,
  mark: (app) => (app.project.run?.lost ? "doubtful" : app.project.run?.frames !== undefined ? "good" : "missing"),
  hint: () => (chosen === null ? "Click a rod; yellow ones are doubtful or lost" : "Drag the rod, turn it by its handle; it is correlated again from there. Enter keeps it"),
  keyHelp: [["Enter", "keep the mended pose"], ["X", "say that the rod is not to be seen"], ["Q E", "turn it by 1°"], ["Shift+arrows", "move it by a pixel"], ["N", "the next doubtful rod"], ["Esc", "let go"]],
  enter(app) { chosen = null; ghost = null; mended = null; told = null; load(app); },
  moved(app) { ghost = null; mended = null; load(app); },
  tool,
  panel(app) {
    if (app.project.run === null) return h("p", {}, "There are no tracks yet: run the experiment first (step 6).");
    if (!told) return h("p", {}, "Reading tracks …");
    const doubtful = doubts();
    return [
      h("p", {}, "A mended pose is a row of corrections.csv, which the next run obeys."),
      fact("rods seen", String(told.rods.id.length)), fact("lost here", String(told.lost.length)),
      h("div", { class: "row" }, h("button", { onclick: () => nextDoubtful(app) }, `Next doubtful (${doubtful.length})`), h("button", { class: only ? "on" : "", onclick: () => { only = !only; app.paint(); } }, "Show these only")),
      chosen !== null ? card(app) : null,
      h("h3", {}, "Corrections"),
      told.corrections.length ? h("div", { class: "list", id: "corrections" }, told.corrections.map((each) => h("div", {},
        h("span", { style: { flex: "1", cursor: "pointer" }, onclick: () => { app.show(each.frame); pick(app, each.id); } }, `photograph ${each.frame}, rod ${each.id}${each.x === null ? ": lost" : ""}`),
        h("button", { class: "quiet", title: "Take it back", onclick: () => settle(app, "take_back", { frame: each.frame, id: each.id }) }, "undo")))) : h("p", {}, "None yet."),
    ];
  },
  draw(app, c, k) {
    if (!told || told.frame !== app.frame) return;
    const corrected = new Set(told.corrections.filter((each) => each.frame === app.frame).map((each) => each.id));
    told.rods.id.forEach((id, n) => {
      const weak = told.rods.status[n] === "suspect" || told.rods.status[n] === "robust" || (told.rods.zncc[n] ?? 1) < 0.75;
      if ((id === chosen && ghost) || (only && !weak)) return;
      circle(c, k, told.rods.x[n], told.rods.y[n], told.rods.r[n], told.rods.angle[n], corrected.has(id) ? "#2fbf93" : weak ? "#f0e442" : "#56b4e980", weak || corrected.has(id) ? 2.2 : 1.3);
    });
    for (const rod of told.lost) circle(c, k, rod.x, rod.y, rod.r, rod.angle, "#f0e442", 2, [6, 5]);
    if (ghost) {
      if (patch) {
        c.save(); c.beginPath(); c.arc(ghost.x, ghost.y, ghost.r, 0, 7); c.clip();
        c.globalAlpha = held ? 0.85 : 0.55; c.translate(ghost.x, ghost.y); c.rotate(ghost.angle);
        c.drawImage(patch.image, -patch.x, -patch.y, patch.width, patch.height); c.restore(); c.globalAlpha = 1;
      }
      circle(c, k, ghost.x, ghost.y, ghost.r, ghost.angle, "#ffffff", 2.6);
      const [hx, hy] = handle(ghost);
      c.strokeStyle = "#fff"; c.lineWidth = 2 / k; c.beginPath(); c.moveTo(ghost.x + ghost.r * Math.cos(ghost.angle), ghost.y + ghost.r * Math.sin(ghost.angle)); c.lineTo(hx, hy); c.stroke();
      c.fillStyle = "#fff"; c.beginPath(); c.arc(hx, hy, 6 / k, 0, 7); c.fill();
    }
  },
  key(app, event) {
    if (event.key === "n") { nextDoubtful(app); return true; }
    if (!ghost) return false;
    if (event.key === "Escape") { chosen = null; ghost = null; mended = null; app.paint(); return true; }
    if (event.key === "Enter") { keep(app); return true; }
    if (event.key === "x") { settle(app, "mark_lost", { frame: app.frame, id: chosen }); return true; }
    const by = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, -1, 0], ArrowDown: [0, 1, 0] }[event.shiftKey ? event.key : ""] ?? { q: [0, 0, -Math.PI / 180], e: [0, 0, Math.PI / 180] }[event.key];
    if (!by) return false;
    ghost = { ...ghost, x: ghost.x + by[0], y: ghost.y + by[1], angle: ghost.angle + by[2] };
    correlate(app);
    return true;
  },
};

const handle = (g) => [g.x + 1.45 * g.r * Math.cos(g.angle), g.y + 1.45 * g.r * Math.sin(g.angle)];
const doubts = () => [...told.lost.map((rod) => rod.id), ...told.rods.id.filter((id, n) => told.rods.status[n] === "suspect" || told.rods.status[n] === "robust" || (told.rods.zncc[n] ?? 1) < 0.75)];

function circle(c, k, x, y, r, angle, style, wide, dash = null) {
  c.beginPath(); c.arc(x, y, r, 0, 2 * Math.PI);
  c.setLineDash(dash ? dash.map((each) => each / k) : []);
  c.strokeStyle = "#0009"; c.lineWidth = (wide + 1.6) / k; c.stroke();
  c.strokeStyle = style; c.lineWidth = wide / k; c.stroke(); c.setLineDash([]);
  if (angle !== null && angle !== undefined) { c.beginPath(); c.moveTo(x + 0.78 * r * Math.cos(angle), y + 0.78 * r * Math.sin(angle)); c.lineTo(x + r * Math.cos(angle), y + r * Math.sin(angle)); c.stroke(); }
}

function card(app) {
  const n = told.rods.id.indexOf(chosen);
  return h("div", { class: "card here" },
    h("div", { class: "fact" }, h("b", {}, `Rod ${chosen}`), h("span", { class: "pill" }, n < 0 ? "lost" : told.rods.status[n])),
    mended ? [
      fact("correlation", `${digits(mended.zncc_before, 3)} → ${digits(mended.zncc, 4)}`),
      fact("residual", `${digits(mended.residual_before, 3)} → ${digits(mended.residual, 3)} grey`),
      fact("place", mended.found ? `± ${digits(mended.sigma, 2)} px` : "as the hand put it"),
      mended.found ? null : h("p", {}, "Nothing correlates there: the pose of the hand would be taken as it is."),
    ] : fact("correlation", n < 0 ? "–" : digits(told.rods.zncc[n], 4)),
    h("div", { class: "row" }, h("button", { class: "primary", id: "keep", disabled: !mended || app.frame === 0, onclick: () => keep(app) }, "Keep"), h("button", { disabled: app.frame === 0, onclick: () => settle(app, "mark_lost", { frame: app.frame, id: chosen }) }, "Not to be seen")));
}

function load(app) {
  if (app.project.run === null) return;
  const { frame } = app;
  ask("poses", { at: app.project.at, frame }).then((answer) => {
    if (app.frame !== frame || app.step !== mend) return;
    told = answer; if (chosen !== null) pick(app, chosen); app.paint();
  }, (error) => tell(error.message, true));
}

function pick(app, id) {
  chosen = id; mended = null;
  const n = told.rods.id.indexOf(id), lost = told.lost.find((rod) => rod.id === id);
  const from = n >= 0 ? { x: told.rods.x[n], y: told.rods.y[n], r: told.rods.r[n], angle: told.rods.angle[n] ?? 0 } : lost;
  ghost = from ? { x: from.x, y: from.y, r: from.r, angle: from.angle ?? 0 } : null;
  if (ghost) correlate(app);
  app.paint();
}

/** The newest pose is asked about; those in between are skipped. */
function correlate(app) {
  next = { at: app.project.at, frame: app.frame, id: chosen, x: ghost.x, y: ghost.y, angle: ghost.angle };
  app.stage.redraw();
  if (waiting) return;
  waiting = true;
  const asked = next;
  next = null;
  ask("correlate", asked).then(async (answer) => {
    if (asked.id === chosen && asked.frame === app.frame) {
      mended = answer; await show(app, answer.first);
      if (!held && !next && answer.found && ghost) ghost = { ...ghost, x: answer.x, y: answer.y, angle: answer.angle };
      app.paint();
    }
  }, (error) => tell(error.message, true)).finally(() => { waiting = false; if (next && ghost) correlate(app); });
}

/** The rod as the first photograph shows it, to be turned and laid over the present one. */
async function show(app, [x, y]) {
  const url = `/photograph?${new URLSearchParams({ at: app.project.at, frame: 0, size: 20000 })}`;
  if (wanted !== url) { wanted = url; const answer = await fetch(url); patch = { image: await createImageBitmap(await answer.blob()), width: app.project.width, height: app.project.height }; }
  if (patch) { patch.x = x + 0.5; patch.y = y + 0.5; }
}

function keep(app) { if (ghost && mended) settle(app, "mend", { frame: app.frame, id: chosen, x: ghost.x, y: ghost.y, angle: ghost.angle }); }

function settle(app, what, values) {
  app.queue(async () => {
    const answer = await ask(what, { at: app.project.at, ...values });
    told.corrections = answer.corrections; if (what !== "take_back") { chosen = null; ghost = null; mended = null; }
    app.take(answer.project);
    tell(what === "take_back" ? "Taken back" : "Kept: the next run obeys it");
  });
}

function nextDoubtful(app) {
  const list = doubts();
  if (!list.length) { tell("No rod of this photograph is in doubt"); return; }
  pick(app, list[(list.indexOf(chosen) + 1) % list.length]);
  if (ghost) app.stage.centre(ghost.x, ghost.y, 90 / ghost.r);
}

function tool(app) {
  return {
    cross: false,
    down: (p) => {
      if (!told) return false;
      if (ghost) {
        const [hx, hy] = handle(ghost);
        if (Math.hypot(p[0] - hx, p[1] - hy) * app.stage.view.k < 14) { held = { turn: true }; return true; }
        if (Math.hypot(p[0] - ghost.x, p[1] - ghost.y) < ghost.r) { held = { x: ghost.x, y: ghost.y }; return true; }
      }
      return false;
    },
    drag: (p, event, from) => {
      if (held.turn) ghost = { ...ghost, angle: Math.atan2(p[1] - ghost.y, p[0] - ghost.x) + turns(ghost.angle, Math.atan2(p[1] - ghost.y, p[0] - ghost.x)) };
      else ghost = { ...ghost, x: held.x + p[0] - from[0], y: held.y + p[1] - from[1] };
      correlate(app);
    },
    up: () => { held = null; correlate(app); },
    click: (p) => {
      if (!told) return;
      let best = null, least = 1;
      const rods = told.rods.id.map((id, n) => [id, told.rods.x[n], told.rods.y[n], told.rods.r[n]]);
      for (const [id, x, y, r] of [...rods, ...told.lost.map((rod) => [rod.id, rod.x, rod.y, rod.r])]) { const away = Math.hypot(x - p[0], y - p[1]) / r; if (away < least) { least = away; best = id; } }
      if (best === null) { chosen = null; ghost = null; mended = null; app.paint(); } else pick(app, best);
    },
  };
}

const turns = (old, fresh) => Math.round((old - fresh) / (2 * Math.PI)) * 2 * Math.PI;
