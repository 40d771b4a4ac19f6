// Step 9: rods that tracking lost or confused: picked, dragged and rotated, and correlated from there at once.

import { request, at, digits, fact, h, sign, strokeCircles, notify } from "/page/dom.js";
import { showLost } from "/page/time/lanes.js";

const KEPT = "#2fbf93", WEAK = "#f0e442", SEEN = "#56b4e980";
let poses = null, chosen = null, ghost = null, held = null, fit = null, patch = null, wanted = "", waiting = false, next = null, only = false, jumping = 0, lacking = "", again = null; // again: the photograph as it is tracked with its corrections
const log = { open: false, poses: null };

export const correct = {
  name: "correct", title: "Correct", ofPhotographs: true, frames: true,
  mark: (app) => (app.project.run?.lost ? "doubtful" : app.project.run?.frames !== undefined ? "good" : "missing"),
  hint: (app) => (!poses ? "" : app.frame === poses.first ? "All photographs are compared with the first one: correct its rods in step 4" : chosen === null ? "Click a rod; yellow ones are uncertain or lost" : "Drag the rod, rotate it by its handle; it is correlated from there. Enter keeps it"),
  keyHelp: [["Enter", "keep the fitted pose"], ["Shift+Enter", "keep it, and correct the next photographs as well"], ["X", "mark the rod as not visible"], ["Q E", "rotate it by 1°"], ["Shift+arrows", "move it by a pixel"], ["N", "the next uncertain rod, also in later photographs"], ["Esc", "deselect"]],
  enter(app) { deselect(); poses = null; again = null; jumping = 0; load(app); },
  moved(app) { ghost = null; fit = null; again = null; load(app); },
  taken(app) { load(app); },
  chosen: () => chosen, // for tests, as are the next ones
  rods: () => poses.rods,
  ghost: () => (ghost ? [ghost.x, ghost.y, ghost.angle] : null),
  tool,
  panel(app) {
    if (app.project.run === null) return [h("p", {}, "There are no tracks yet: run the experiment first."), h("button", { class: "primary", onclick: () => app.goTo("run") }, "To the run")];
    if (!poses) return lacking ? h("div", { class: "messages" }, h("p", {}, h("span", { class: "sign doubtful" }, "!"), lacking)) : h("p", {}, "Reading tracks …");
    const waits = poses.corrections.filter((each) => !each.applied).length;
    return [
      chosen === null ? h("p", {}, "Correct the pose of a rod that tracking lost or confused with another. Each correction is a row of corrections.csv, which the next run applies.") : null,
      chosen === null ? [fact("rods seen", String(poses.rods.id.length)), fact("lost here", String(poses.lost.length)), fact("uncertain here", String(poses.uncertain.length))] : null,
      h("div", { class: "row" }, h("button", { id: "next-uncertain", title: "N", onclick: () => nextUncertain(app) }, "Next uncertain"), h("button", { class: only ? "on" : "", onclick: () => { only = !only; app.paint(); } }, "Show these only")),
      chosen !== null ? card(app) : null,
      again?.frame === app.frame ? againCard(app) : null,
      h("h2", {}, "Corrections"),
      poses.corrections.length ? h("div", { class: "list", id: "corrections" }, poses.corrections.map((each) => h("div", { class: each.frame === app.frame && each.id === chosen ? "here" : "" },
        h("button", { class: "quiet", style: { flex: "1", textAlign: "left" }, title: "Show it", onclick: () => goTo(app, each) }, `photograph ${each.frame} · rod ${each.id}${each.x === null ? " not visible" : ""}`),
        each.applied ? h("span", { class: "sign good", title: "the last run applied it" }, "✓") : null,
        h("button", { class: "quiet", title: "Remove the correction", onclick: () => send(app, "undo_correction", { frame: each.frame, id: each.id }) }, "undo")))) : h("p", {}, "None yet."),
      waits ? h("div", { class: "messages" }, h("p", { id: "waits" }, h("span", { class: "sign doubtful" }, "!"), `${waits === 1 ? "One correction waits" : `${waits} corrections wait`} for the next run. Only photographs that depend on ${waits === 1 ? "it" : "them"} are computed again.`)) : null,
      waits ? h("button", { onclick: () => app.goTo("run") }, "To the run") : null,
      logSection(app),
    ];
  },
  draw(app, c, k) {
    if (!poses || poses.frame !== app.frame) return;
    const weak = new Set(poses.uncertain), corrected = correctedHere(app);
    const sure = [], doubtful = [];
    poses.rods.id.forEach((id, n) => {
      if ((id === chosen && ghost) || corrected.has(id) || (only && !weak.has(id)) || !app.stage.sees(poses.rods.x[n], poses.rods.y[n], poses.rods.r[n])) return;
      (weak.has(id) ? doubtful : sure).push([poses.rods.x[n], poses.rods.y[n], poses.rods.r[n], poses.rods.angle[n]]);
    });
    strokeCircles(c, k, sure, SEEN, 1.3); strokeCircles(c, k, doubtful, WEAK, 2.2);
    for (const rod of poses.lost) if (rod.id !== chosen && !corrected.has(rod.id)) circle(c, k, rod.x, rod.y, rod.r, rod.angle, WEAK, 2, [6, 5]);
    for (const [id, each] of corrected) {
      const rod = rodOf(id);
      if (!rod || (id === chosen && ghost)) continue;
      if (each.x === null) { circle(c, k, rod.x, rod.y, rod.r, null, KEPT, 2, [3, 4]); continue; }
      circle(c, k, each.x, each.y, rod.r, each.angle, KEPT, 2.4);
    }
    if (ghost) drawGhost(c, k);
  },
  key(app, event) {
    if (event.key === "n") { nextUncertain(app); return true; }
    if (!ghost) return false;
    if (event.key === "Escape") { deselect(); app.paint(); return true; }
    if (event.key === "Enter") { keep(app, event.shiftKey); return true; }
    if (event.key === "x") { if (app.frame !== poses.first) send(app, "mark_lost", { frame: app.frame, id: chosen }); return true; }
    const by = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, -1, 0], ArrowDown: [0, 1, 0] }[event.shiftKey ? event.key : ""] ?? { q: [0, 0, -Math.PI / 180], e: [0, 0, Math.PI / 180] }[event.key];
    if (!by) return false;
    ghost = { ...ghost, x: ghost.x + by[0], y: ghost.y + by[1], angle: ghost.angle + by[2] };
    correlate(app);
    return true;
  },
  timeline(app) { if (app.project.run !== null) showLost(app, poses); else at("time").classList.remove("shown"); },
};

/** Changes of the table of corrections with time, before and after; requested when it is opened. */
function logSection(app) {
  const words = (pose) => (pose === null ? "as tracked" : pose === "lost" ? "not visible" : `${digits(pose[0], 5)}, ${digits(pose[1], 5)} px`);
  return h("details", { id: "corrections-log", open: log.open, ontoggle: (event) => { if (event.target.open !== log.open) { log.open = event.target.open; if (log.open) app.queue(async () => { await readLog(app); app.paint(); }); } } },
    h("summary", {}, "Changes"),
    log.open && log.poses ? log.poses.length ? h("div", { class: "list" }, log.poses.slice(0, 200).map((each) => h("div", {}, h("span", { class: "two" },
      h("span", {}, `photograph ${each.frame} · rod ${each.id} · ${each.how}`), h("span", { class: "soft" }, `${new Date(each.time).toLocaleString()}: ${words(each.before)} → ${words(each.after)}`))))) : h("p", {}, "None yet.") : null);
}

async function readLog(app) { if (log.open) log.poses = (await request("corrections_log", { at: app.project.at })).changes; }

const handle = (g) => [g.x + 1.45 * g.r * Math.cos(g.angle), g.y + 1.45 * g.r * Math.sin(g.angle)];
const deselect = () => { chosen = null; ghost = null; fit = null; };
const correctedHere = (app) => new Map(poses.corrections.filter((each) => each.frame === app.frame).map((each) => [each.id, each]));

/** The uncertain rods of this photograph without a correction. */
function uncertainHere(app) {
  const corrected = correctedHere(app);
  return [...poses.lost.map((rod) => rod.id), ...poses.uncertain].filter((id) => !corrected.has(id));
}

/** A rod as it was tracked here, or where it was seen last. */
function rodOf(id) {
  const n = poses.rods.id.indexOf(id);
  return n < 0 ? poses.lost.find((rod) => rod.id === id) ?? null : { x: poses.rods.x[n], y: poses.rods.y[n], r: poses.rods.r[n], angle: poses.rods.angle[n] ?? 0 };
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
  const n = poses.rods.id.indexOf(chosen), first = app.frame === poses.first;
  return h("div", { class: "card here", id: "correction" },
    h("div", { class: "fact" }, h("b", {}, `Rod ${chosen}`), h("span", { class: "pill" }, n < 0 ? "lost" : poses.rods.status[n])),
    fit ? [
      pictures(),
      fact("correlation", `${digits(fit.zncc_before, 2)} → ${digits(fit.zncc, 3)}`),
      fact("residual", `${digits(fit.residual_before, 3)} → ${digits(fit.residual, 3)} grey`),
      fact("place", fit.found ? `± ${digits(fit.sigma, 2)} px` : "as given by hand"),
      fit.warnings.length ? h("div", { class: "messages", id: "warnings", role: "alert" }, fit.warnings.map((text) => h("p", {}, sign("doubtful"), text))) : null,
    ] : h("p", {}, "Preparing the photograph …"),
    h("button", { class: fit?.warnings.length ? "" : "primary", id: "keep", disabled: !fit || first, onclick: () => keep(app) }, h("kbd", {}, "⏎"), fit?.warnings.length ? " Keep it all the same" : " Keep"),
    h("button", { id: "keep-on", disabled: !fit || first || app.frame === app.project.files.length - 1, title: "Shift+Enter: in the photographs that follow, until its track agrees", onclick: () => keep(app, true) }, "Keep, and correct the next ones"),
    h("button", { disabled: first, title: "X", onclick: () => send(app, "mark_lost", { frame: app.frame, id: chosen }) }, "It is not visible"));
}

/** The photograph tracked again: the corrected rod, its neighbours, and every rod whose state has changed. */
function againCard(app) {
  const worse = again.lost_after > again.lost_before, value = (number) => digits(number, 3);
  return h("div", { class: "card", id: "again" },
    h("div", { class: "fact" }, h("b", {}, "Tracked again at once"), sign(worse ? "doubtful" : "good")),
    fact("rods lost here", `${again.lost_before} → ${again.lost_after}`),
    h("table", { class: "numbers" }, h("thead", {}, h("tr", {}, ["rod", "correlation", "moved", "state"].map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, again.changes.slice(0, 12).map((each) => h("tr", {}, [String(each.id), `${value(each.zncc[0])} → ${value(each.zncc[1])}`, each.moved === null ? "–" : each.moved < 0.001 ? "< 0.001 px" : `${digits(each.moved, 2)} px`, each.status[0] === each.status[1] ? each.status[1] : `${each.status[0]} → ${each.status[1]}`].map((text) => h("td", {}, text)))))),
    h("p", {}, "Nothing is stored of this: the next run computes it for all photographs."));
}

/** The rod on the first photograph, at the given pose and at the fitted pose, with the differences. */
function pictures() {
  const [first, given, leftGiven, found, left] = fit.pictures.map((text) => square(text, fit.side));
  const cell = (words, ...of) => { of.forEach((each, n) => { if (each.tagName === "CANVAS") { each.setAttribute("role", "img"); each.setAttribute("aria-label", n ? `difference, ${words}` : `the rod, ${words}`); } }); return h("figure", {}, of, h("figcaption", {}, words)); };
  return h("div", { class: "evidence" }, cell("first", first, h("span", { class: "soft" }, "difference →")), cell("before", given, leftGiven), cell("after", found, left));
}

/** Grey bytes as a picture; differences are relative to uniform grey. */
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
    if (app.step !== correct) return;
    try { poses = await request("poses", { at: app.project.at, frame }); await readLog(app); lacking = ""; } catch (error) { poses = null; lacking = error.message; }
    if (poses && jumping) { jumping = 0; nextUncertain(app, true); } else if (poses && chosen !== null) pick(app, chosen);
    app.paint();
    if (poses) request("prepare_photograph", { at: app.project.at, frame }).catch(() => {});
  });
}

function pick(app, id) {
  chosen = id; fit = null;
  const from = rodOf(id), here = correctedHere(app).get(id);
  ghost = from ? { x: from.x, y: from.y, r: from.r, angle: from.angle ?? 0 } : null;
  if (ghost && here && here.x !== null) ghost = { ...ghost, x: here.x, y: here.y, angle: here.angle ?? ghost.angle };
  if (!ghost) chosen = null;
  else if (!here && uncertainHere(app).includes(id)) propose(app, id);
  else correlate(app);
  app.paint();
}

/** An uncertain rod begins where its neighbours' motion since its last good photograph leads, not where it was tracked. */
function propose(app, id) {
  const { frame } = app;
  app.queue(async () => {
    const { pose, since } = await request("propose_pose", { at: app.project.at, frame, id });
    if (chosen !== id || app.frame !== frame || !ghost) return;
    if (pose) { ghost = { ...ghost, x: pose[0], y: pose[1], angle: pose[2] }; app.stage.centre(ghost.x, ghost.y, 90 / ghost.r); }
    else notify(since === null ? `Rod ${id} has no good photograph before this one: drag it to its place` : `Where rod ${id} is expected lies another rod: drag it to its place`);
    correlate(app);
  }, "Looking for the rod …", `propose ${frame} ${id}`);
}

function goTo(app, each) {
  deselect(); chosen = each.id;
  if (each.frame === app.frame) pick(app, each.id); else app.show(each.frame);
}

/** The newest pose is correlated; those in between are skipped. */
function correlate(app) {
  next = { at: app.project.at, frame: app.frame, id: chosen, x: ghost.x, y: ghost.y, angle: ghost.angle };
  app.stage.redraw();
  if (waiting) return;
  waiting = true;
  const sent = next;
  next = null;
  request("correlate", sent).then(async (answer) => {
    if (sent.id === chosen && sent.frame === app.frame) {
      fit = answer; await show(app, answer.first);
      if (!held && !next && answer.found && ghost) ghost = { ...ghost, x: answer.x, y: answer.y, angle: answer.angle };
      app.paint();
    }
  }, (error) => notify(error.message, true)).finally(() => { waiting = false; if (next && ghost) correlate(app); });
}

/** The rod on the first photograph, to be rotated and drawn over the present one. */
async function show(app, [x, y, r]) {
  const width = Math.max(Math.ceil(2.2 * r), 4), url = `/crop?${new URLSearchParams({ at: app.project.at, frame: poses.first, x, y, width })}`;
  if (wanted === url) return;
  wanted = url; patch = null;
  const answer = await fetch(url);
  if (answer.ok && wanted === url) patch = { image: await createImageBitmap(await answer.blob()), width };
}

function keep(app, following = false) {
  if (ghost && fit && app.frame !== poses.first) send(app, "correct_pose", { frame: app.frame, id: chosen, x: ghost.x, y: ghost.y, angle: ghost.angle, following }, following ? "Correcting the next photographs …" : "");
}

function send(app, endpoint, values, words = "") {
  app.queue(async () => {
    const answer = await request(endpoint, { at: app.project.at, ...values });
    poses.corrections = answer.corrections; if (endpoint !== "undo_correction") deselect();
    app.take(answer.project);
    if (values.frame === app.frame) trackAgain(app, values.id);
    notify(endpoint === "undo_correction" ? "Removed" : answer.ended ? `Kept in ${answer.count === 1 ? "this photograph" : `${answer.count} photographs`}: ${answer.ended}` : "Kept: the next run applies it");
  }, words, endpoint + JSON.stringify(values));
}

/** Track the photograph again with its corrections, and show it so. */
function trackAgain(app, id) {
  const { frame } = app;
  app.queue(async () => {
    const answer = await request("tracked_again", { at: app.project.at, frame, id });
    if (app.step !== correct || app.frame !== frame || poses?.frame !== frame) return;
    again = answer;
    Object.assign(poses, { rods: answer.rods, lost: answer.lost, uncertain: answer.uncertain });
    app.paint();
  }, "Tracking the photograph again …");
}

/** The next uncertain rod here; where there is none, in the next photograph that has one. */
function nextUncertain(app, arrived = false) {
  if (!poses) return;
  const list = uncertainHere(app), at = list.indexOf(chosen);
  if (list.length && (arrived || at + 1 < list.length)) {
    pick(app, list[arrived ? 0 : at + 1]);
    if (ghost) app.stage.centre(ghost.x, ghost.y, 90 / ghost.r);
    return;
  }
  const done = (frame) => poses.corrections.filter((each) => each.frame === frame).length, count = poses.lost_count.length;
  for (let step = 1; step < count; step += 1) {
    const frame = (app.frame + step) % count;
    if (poses.lost_count[frame] + poses.uncertain_count[frame] > done(frame)) { deselect(); jumping = 1; app.show(frame); return; }
  }
  if (list.length) pick(app, list[0]); else notify("No rod is uncertain in any photograph");
}

function tool(app) {
  return {
    cross: false,
    down: (p) => {
      if (!poses || poses.frame !== app.frame) return false;
      if (ghost) {
        const [hx, hy] = handle(ghost);
        if (Math.hypot(p[0] - ghost.x, p[1] - ghost.y) < ghost.r) { held = { x: ghost.x, y: ghost.y }; return true; } // before the handle, which is close to a small rod
        if (Math.hypot(p[0] - hx, p[1] - hy) * app.stage.view.k < 14) { held = { rotating: true }; return true; }
      }
      return false;
    },
    drag: (p, event, from) => {
      if (held.rotating) ghost = { ...ghost, angle: Math.atan2(p[1] - ghost.y, p[0] - ghost.x) + fullTurns(ghost.angle, Math.atan2(p[1] - ghost.y, p[0] - ghost.x)) };
      else ghost = { ...ghost, x: held.x + p[0] - from[0], y: held.y + p[1] - from[1] };
      correlate(app);
    },
    up: () => { held = null; correlate(app); },
    click: (p) => {
      if (!poses || poses.frame !== app.frame) return;
      let best = null, least = 1;
      const rods = poses.rods.id.map((id, n) => [id, poses.rods.x[n], poses.rods.y[n], poses.rods.r[n]]);
      for (const [id, x, y, r] of [...rods, ...poses.lost.map((rod) => [rod.id, rod.x, rod.y, rod.r])]) { const away = Math.hypot(x - p[0], y - p[1]) / r; if (away < least) { least = away; best = id; } }
      if (best === null) { chosen = null; ghost = null; fit = null; app.paint(); } else pick(app, best);
    },
  };
}

const fullTurns = (old, fresh) => Math.round((old - fresh) / (2 * Math.PI)) * 2 * Math.PI;
