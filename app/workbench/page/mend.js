// Step 7: rods that tracking lost or took for others: picked, dragged, turned, correlated again from there at once.

import { ask, at, digits, fact, h, strokeCircles, tell } from "/page/dom.js";
import { showDoubts } from "/page/lanes.js";

const KEPT = "#2fbf93", WEAK = "#f0e442", SEEN = "#56b4e980";
let told = null, chosen = null, ghost = null, held = null, mended = null, patch = null, wanted = "", waiting = false, next = null, only = false, jumping = 0, lacking = "";
const log = { open: false, told: null };

export const mend = {
  name: "mend", title: "Mend", frames: true,
  mark: (app) => (app.project.run?.lost ? "doubtful" : app.project.run?.frames !== undefined ? "good" : "missing"),
  hint: (app) => (!told ? "" : app.frame === told.first ? "The first photograph is what all others are compared with: mend its rods in step 4" : chosen === null ? "Click a rod; yellow ones are doubtful or lost" : "Drag the rod, turn it by its handle; it is correlated again from there. Enter keeps it"),
  keyHelp: [["Enter", "keep the mended pose"], ["Shift+Enter", "keep it, and follow the rod through the next photographs"], ["X", "say that the rod is not to be seen"], ["Q E", "turn it by 1°"], ["Shift+arrows", "move it by a pixel"], ["N", "the next doubtful rod, in the next photographs, too"], ["Esc", "let go"]],
  enter(app) { letGo(); told = null; jumping = 0; load(app); },
  moved(app) { ghost = null; mended = null; load(app); },
  taken(app) { load(app); },
  chosen: () => chosen, // for tests, as are the next ones
  rods: () => told.rods,
  ghost: () => (ghost ? [ghost.x, ghost.y, ghost.angle] : null),
  tool,
  panel(app) {
    if (app.project.run === null) return [h("p", {}, "There are no tracks yet: rods are followed when the experiment is run."), h("button", { class: "primary", onclick: () => app.goTo("run") }, "To the run")];
    if (!told) return lacking ? h("div", { class: "says" }, h("p", {}, h("span", { class: "sign doubtful" }, "!"), lacking)) : h("p", {}, "Reading tracks …");
    const waits = told.corrections.filter((each) => !each.obeyed).length;
    return [
      chosen === null ? h("p", {}, "Where tracking lost a rod or took another for it, put it right here: what is kept is a row of corrections.csv, which the next run obeys.") : null,
      chosen === null ? [fact("rods seen", String(told.rods.id.length)), fact("lost here", String(told.lost.length)), fact("doubtful here", String(told.doubtful.length))] : null,
      h("div", { class: "row" }, h("button", { id: "next-doubtful", title: "N", onclick: () => nextDoubtful(app) }, "Next doubtful"), h("button", { class: only ? "on" : "", onclick: () => { only = !only; app.paint(); } }, "Show these only")),
      chosen !== null ? card(app) : null,
      h("h3", {}, "Corrections"),
      told.corrections.length ? h("div", { class: "list", id: "corrections" }, told.corrections.map((each) => h("div", { class: each.frame === app.frame && each.id === chosen ? "here" : "" },
        h("button", { class: "quiet", style: { flex: "1", textAlign: "left" }, title: "Show it", onclick: () => goTo(app, each) }, `photograph ${each.frame} · rod ${each.id}${each.x === null ? " hidden" : ""}`),
        each.obeyed ? h("span", { class: "sign good", title: "the last run obeyed it" }, "✓") : null,
        h("button", { class: "quiet", title: "Take it back", onclick: () => settle(app, "take_back", { frame: each.frame, id: each.id }) }, "undo")))) : h("p", {}, "None yet."),
      waits ? h("div", { class: "says" }, h("p", { id: "waits" }, h("span", { class: "sign doubtful" }, "!"), `${waits === 1 ? "One correction waits" : `${waits} corrections wait`} for the next run. What does not hang on ${waits === 1 ? "it" : "them"} is not computed again.`)) : null,
      waits ? h("button", { onclick: () => app.goTo("run") }, "To the run") : null,
      logSection(app),
    ];
  },
  draw(app, c, k) {
    if (!told || told.frame !== app.frame) return;
    const weak = new Set(told.doubtful), corrected = correctedHere(app);
    const sure = [], doubtful = [];
    told.rods.id.forEach((id, n) => {
      if ((id === chosen && ghost) || corrected.has(id) || (only && !weak.has(id)) || !app.stage.sees(told.rods.x[n], told.rods.y[n], told.rods.r[n])) return;
      (weak.has(id) ? doubtful : sure).push([told.rods.x[n], told.rods.y[n], told.rods.r[n], told.rods.angle[n]]);
    });
    strokeCircles(c, k, sure, SEEN, 1.3); strokeCircles(c, k, doubtful, WEAK, 2.2);
    for (const rod of told.lost) if (rod.id !== chosen && !corrected.has(rod.id)) circle(c, k, rod.x, rod.y, rod.r, rod.angle, WEAK, 2, [6, 5]);
    for (const [id, each] of corrected) {
      const rod = rodOf(id);
      if (!rod || (id === chosen && ghost)) continue;
      if (each.x === null) { circle(c, k, rod.x, rod.y, rod.r, null, KEPT, 2, [3, 4]); continue; }
      circle(c, k, each.x, each.y, rod.r, each.angle, KEPT, 2.4);
    }
    if (ghost) drawGhost(c, k);
  },
  key(app, event) {
    if (event.key === "n") { nextDoubtful(app); return true; }
    if (!ghost) return false;
    if (event.key === "Escape") { letGo(); app.paint(); return true; }
    if (event.key === "Enter") { keep(app, event.shiftKey); return true; }
    if (event.key === "x") { if (app.frame !== told.first) settle(app, "mark_lost", { frame: app.frame, id: chosen }); return true; }
    const by = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, -1, 0], ArrowDown: [0, 1, 0] }[event.shiftKey ? event.key : ""] ?? { q: [0, 0, -Math.PI / 180], e: [0, 0, Math.PI / 180] }[event.key];
    if (!by) return false;
    ghost = { ...ghost, x: ghost.x + by[0], y: ghost.y + by[1], angle: ghost.angle + by[2] };
    correlate(app);
    return true;
  },
  timeline(app) { if (app.project.run !== null) showDoubts(app, told); else at("time").classList.remove("shown"); },
};

/** What was changed in the table of corrections, when, before and after: asked for when it is opened. */
function logSection(app) {
  const words = (pose) => (pose === null ? "as tracked" : pose === "lost" ? "not to be seen" : `${digits(pose[0], 5)}, ${digits(pose[1], 5)} px`);
  return h("details", { id: "corrections-log", open: log.open, ontoggle: (event) => { if (event.target.open !== log.open) { log.open = event.target.open; if (log.open) app.queue(async () => { await readLog(app); app.paint(); }); } } },
    h("summary", {}, "What was changed, and when"),
    log.open && log.told ? log.told.length ? h("div", { class: "list" }, log.told.slice(0, 200).map((each) => h("div", {}, h("span", { class: "two" },
      h("span", {}, `photograph ${each.frame} · rod ${each.id} · ${each.how}`), h("span", { class: "soft" }, `${new Date(each.time).toLocaleString()}: ${words(each.before)} → ${words(each.after)}`))))) : h("p", {}, "Nothing yet.") : null);
}

async function readLog(app) { if (log.open) log.told = (await ask("corrections_log", { at: app.project.at })).changes; }

const handle = (g) => [g.x + 1.45 * g.r * Math.cos(g.angle), g.y + 1.45 * g.r * Math.sin(g.angle)];
const letGo = () => { chosen = null; ghost = null; mended = null; };
const correctedHere = (app) => new Map(told.corrections.filter((each) => each.frame === app.frame).map((each) => [each.id, each]));

/** The rods of this photograph that nobody has put right yet. */
function doubts(app) {
  const corrected = correctedHere(app);
  return [...told.lost.map((rod) => rod.id), ...told.doubtful].filter((id) => !corrected.has(id));
}

/** A rod as it was tracked here, or as it was seen last. */
function rodOf(id) {
  const n = told.rods.id.indexOf(id);
  return n < 0 ? told.lost.find((rod) => rod.id === id) ?? null : { x: told.rods.x[n], y: told.rods.y[n], r: told.rods.r[n], angle: told.rods.angle[n] ?? 0 };
}

function drawGhost(c, k) {
  if (patch) {
    c.save(); c.beginPath(); c.arc(ghost.x, ghost.y, ghost.r, 0, 7); c.clip();
    c.globalAlpha = held ? 0.85 : 0.55; c.translate(ghost.x, ghost.y); c.rotate(ghost.angle);
    c.drawImage(patch.image, -patch.width / 2, -patch.width / 2, patch.width, patch.width); c.restore(); c.globalAlpha = 1;
  }
  circle(c, k, ghost.x, ghost.y, ghost.r, ghost.angle, "#ffffff", 2.6);
  const [hx, hy] = handle(ghost);
  c.strokeStyle = "#fff"; c.lineWidth = 2 / k; c.beginPath(); c.moveTo(ghost.x + ghost.r * Math.cos(ghost.angle), ghost.y + ghost.r * Math.sin(ghost.angle)); c.lineTo(hx, hy); c.stroke();
  c.fillStyle = "#fff"; c.beginPath(); c.arc(hx, hy, 6 / k, 0, 7); c.fill();
}

const circle = (c, k, x, y, r, angle, style, wide, dash = null) => strokeCircles(c, k, [[x, y, r, angle]], style, wide, { dash });

function card(app) {
  const n = told.rods.id.indexOf(chosen), first = app.frame === told.first;
  return h("div", { class: "card here", id: "mending" },
    h("div", { class: "fact" }, h("b", {}, `Rod ${chosen}`), h("span", { class: "pill" }, n < 0 ? "lost" : told.rods.status[n])),
    mended ? [
      pictures(),
      fact("correlation", `${digits(mended.zncc_before, 2)} → ${digits(mended.zncc, 3)}`),
      fact("residual", `${digits(mended.residual_before, 3)} → ${digits(mended.residual, 3)} grey`),
      fact("place", mended.found ? `± ${digits(mended.sigma, 2)} px` : "as the hand put it"),
      mended.found ? null : h("p", {}, "Nothing correlates there: the pose of the hand would be taken as it is."),
    ] : h("p", {}, "Getting the photograph ready …"),
    h("button", { class: "primary", id: "keep", disabled: !mended || first, onclick: () => keep(app) }, h("kbd", {}, "⏎"), " Keep"),
    h("button", { id: "keep-on", disabled: !mended || first || app.frame === app.project.files.length - 1, title: "Shift+Enter: in every photograph that follows, until its track is right by itself", onclick: () => keep(app, true) }, "Keep, and follow it on"),
    h("button", { disabled: first, title: "X", onclick: () => settle(app, "mark_lost", { frame: app.frame, id: chosen }) }, "It is not to be seen"));
}

/** The rod on the first photograph; here, where the hand put it and where it was found, with what is left over. */
function pictures() {
  const [first, given, leftGiven, found, left] = mended.pictures.map((text) => square(text, mended.side));
  const cell = (words, ...of) => h("figure", {}, of, h("figcaption", {}, words));
  return h("div", { class: "evidence" }, cell("first", first, h("span", { class: "soft" }, "what is left over →")), cell("before", given, leftGiven), cell("after", found, left));
}

/** Grey bytes as a picture; what differs is seen against an even grey. */
function square(text, side) {
  const canvas = h("canvas", { width: side, height: side }), bytes = atob(text), c = canvas.getContext("2d"), image = c.createImageData(side, side);
  for (let k = 0; k < bytes.length; k += 1) { const grey = bytes.charCodeAt(k); image.data.set([grey, grey, grey, 255], 4 * k); }
  c.putImageData(image, 0, 0);
  return canvas;
}

function load(app) {
  if (app.project.run === null) return;
  app.queue(async () => {
    const { frame } = app;
    if (app.step !== mend) return;
    try { told = await ask("poses", { at: app.project.at, frame }); await readLog(app); lacking = ""; } catch (error) { told = null; lacking = error.message; }
    if (told && jumping) { jumping = 0; nextDoubtful(app, true); } else if (told && chosen !== null) pick(app, chosen);
    app.paint();
    if (told) ask("make_ready", { at: app.project.at, frame }).catch(() => {});
  });
}

function pick(app, id) {
  chosen = id; mended = null;
  const from = rodOf(id), here = correctedHere(app).get(id);
  ghost = from ? { x: from.x, y: from.y, r: from.r, angle: from.angle ?? 0 } : null;
  if (ghost && here && here.x !== null) ghost = { ...ghost, x: here.x, y: here.y, angle: here.angle ?? ghost.angle };
  if (ghost) correlate(app); else chosen = null;
  app.paint();
}

function goTo(app, each) {
  letGo(); chosen = each.id;
  if (each.frame === app.frame) pick(app, each.id); else app.show(each.frame);
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
async function show(app, [x, y, r]) {
  const width = Math.max(Math.ceil(2.2 * r), 4), url = `/crop?${new URLSearchParams({ at: app.project.at, frame: told.first, x: Math.max(0, Math.round(x * 100)), y: Math.max(0, Math.round(y * 100)), width })}`;
  if (wanted === url) return;
  wanted = url; patch = null;
  const answer = await fetch(url);
  if (answer.ok && wanted === url) patch = { image: await createImageBitmap(await answer.blob()), width };
}

function keep(app, following = false) {
  if (ghost && mended && app.frame !== told.first) settle(app, "mend", { frame: app.frame, id: chosen, x: ghost.x, y: ghost.y, angle: ghost.angle, following }, following ? "Following it through the photographs …" : "");
}

function settle(app, what, values, words = "") {
  app.queue(async () => {
    const answer = await ask(what, { at: app.project.at, ...values });
    told.corrections = answer.corrections; if (what !== "take_back") letGo();
    app.take(answer.project);
    tell(what === "take_back" ? "Taken back" : answer.ended ? `Kept in ${answer.count === 1 ? "this photograph" : `${answer.count} photographs`}: ${answer.ended}` : "Kept: the next run obeys it");
  }, words, what + JSON.stringify(values));
}

/** The next doubtful rod here; where there is none, in the next photograph that has one. */
function nextDoubtful(app, arrived = false) {
  if (!told) return;
  const list = doubts(app), at = list.indexOf(chosen);
  if (list.length && (arrived || at + 1 < list.length)) {
    pick(app, list[arrived ? 0 : at + 1]);
    if (ghost) app.stage.centre(ghost.x, ghost.y, 90 / ghost.r);
    return;
  }
  const done = (frame) => told.corrections.filter((each) => each.frame === frame).length, count = told.lost_count.length;
  for (let step = 1; step < count; step += 1) {
    const frame = (app.frame + step) % count;
    if (told.lost_count[frame] + told.doubtful_count[frame] > done(frame)) { letGo(); jumping = 1; app.show(frame); return; }
  }
  if (list.length) pick(app, list[0]); else tell("No rod is in doubt, in any photograph");
}

function tool(app) {
  return {
    cross: false,
    down: (p) => {
      if (!told || told.frame !== app.frame) return false;
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
      if (!told || told.frame !== app.frame) return;
      let best = null, least = 1;
      const rods = told.rods.id.map((id, n) => [id, told.rods.x[n], told.rods.y[n], told.rods.r[n]]);
      for (const [id, x, y, r] of [...rods, ...told.lost.map((rod) => [rod.id, rod.x, rod.y, rod.r])]) { const away = Math.hypot(x - p[0], y - p[1]) / r; if (away < least) { least = away; best = id; } }
      if (best === null) { chosen = null; ghost = null; mended = null; app.paint(); } else pick(app, best);
    },
  };
}

const turns = (old, fresh) => Math.round((old - fresh) / (2 * Math.PI)) * 2 * Math.PI;
