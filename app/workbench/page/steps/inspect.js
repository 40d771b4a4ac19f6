// Step 7: the force network: any contact or rod with its numbers, its history and its pictures; verdicts by keys.

import { request, at, chart, colour, digits, fact, h, notify, sign, withDeviation } from "/page/dom.js";
import { drawLegends } from "/page/layers/colours.js";
import { COLOURINGS, drawChange, drawNetwork, loadLook, meanRadius as meanRadiusOf, networkLegends } from "/page/layers/network.js";
import { drawContacts, drawDisplacement, drawRods, drawTrack, drawValues, drawWalls, motionOf, rodLegends } from "/page/layers/rods.js";
import { layers, paintLayer, setLayer } from "/page/layers/settings.js";
import { showLayers } from "/page/layers/panel.js";
import { saveFigure, savePicture, saveTable } from "/page/parts/take_away.js";
import { showLanes, jump } from "/page/time/lanes.js";
import { runMark } from "/page/parts/run_state.js";
import { Recording } from "/page/parts/recording.js";
import { VERDICTS, COLOURS, beforeAfter, bodyName, drawMark, drawSelected, givenSection, hasReviewer, loadGiven, loadReviewer, pairName, reviewerField, samePair, viewOf } from "/page/parts/verdicts.js";
import { force, measured, shown } from "/page/units.js";

let facts = null, net = null, list = null, chosen = null, past = null, rodPast = null, wallLines = [], since = 0, frameOf = -1, without = null, recording = null, wanted = null;

export const inspect = {
  name: "inspect", title: "Inspect",
  ofRun: true, mark: runMark,
  layered: true, layers: ["photograph", "rods", "walls", "forces", "uncertainty", "contacts", "displacement", "strain", "marks"],
  dim: 0.72,
  hint: (app) => (!facts ? "" : chosen ? "C contact · N no contact · U unsure · Z undo · W without this contact" : "Click a contact or a rod"),
  reverted: (app, pair) => (pair.i === null ? app.queue(() => load(app, true)) : show(app, pair)),
  keyHelp: [["C N U", "contact, no contact, unsure"], ["Z", "undo the last action"], ["W", "the forces without this contact"], ["V", "the recording, or the photograph"], ["J, Shift+J", "the next flagged frame, the one before"]],
  enter(app) { facts = null; net = null; chosen = null; past = null; frameOf = -1; app.queue(async () => { await Promise.all([loadReviewer(), loadLook()]); facts = (await request("run_state", { at: app.project.at })).frames; if (facts && app.frame < facts.first) app.frame = facts.first; await load(app); }); },
  leave() { closeRecording(); },
  rodsOfFrame: () => net.rods.x.flatMap((x, n) => [x, net.rods.y[n], net.rods.r[n]]), // for tests
  names: () => net.rods.id, // for tests
  isLoaded: (app) => net?.frame === app.frame, // for tests
  contactAt: (row) => net.point[row], // for tests
  chosen: () => (chosen?.j === undefined ? null : { i: chosen.i, j: chosen.j }), // for tests
  has: (name) => Boolean(facts?.[name]),
  moved(app) { recording?.show(Math.max(app.frame - (facts?.first ?? 0), 0)); app.queue(() => load(app)); },
  taken(app) { if (facts) app.queue(async () => { facts = (await request("run_state", { at: app.project.at })).frames; await load(app, true); }); },
  tool: (app) => tool(app),
  panel(app) {
    if (!facts) return [h("p", {}, "There are no forces yet: run the experiment first."), h("button", { class: "primary", onclick: () => app.goTo("run") }, "To the run")];
    if (facts.provisional) return h("p", {}, "The run is not finished: step 6 shows the frames that are solved.");
    return [
      chosen || !app.project.run?.corrected.length ? null : h("div", { class: "messages", id: "corrected" }, app.project.run.corrected.map((text) => h("p", {}, sign("good"), text))),
      h("div", { class: "field" }, h("label", { htmlFor: "colour-by" }, "colour by"), h("select", { id: "colour-by", onchange: (event) => { setLayer("forces", { by: event.target.value, map: null, low: null, high: null }); showLayers(app); app.paint(); } }, Object.entries(COLOURINGS).map(([name, how]) => h("option", { value: name, selected: name === layers.forces.by }, how.words)))),
      h("div", { class: "row" }, h("button", { class: recording ? "on" : "", id: "show-recording", onclick: () => toggleRecording(app), title: "V" }, recording ? "Photograph" : "Recording"), recording ? h("button", { id: "panels", onclick: () => recording.toggle(), title: "Entities, selection and time of the viewer" }, "Its panels") : null),
      net && !recording ? h("div", { class: "row" }, h("button", { id: "save-picture", title: "What is shown, as PNG", onclick: () => savePicture(app, caption(app)) }, "Save picture"), h("button", { id: "save-table", title: "The contacts of this photograph, as CSV", onclick: () => saveTable(app, net) }, "Save table"), h("button", { id: "save-figure", title: "The forces of this photograph as a figure for a paper, SVG", disabled: facts.provisional, onclick: () => saveFigure(app) }, "Save figure")) : null,
      chosen?.j !== undefined ? pairCard(app) : chosen ? rodCard(app) : reasonsOf(app),
      chosen ? null : [list ? h("button", { id: "to-review", onclick: () => app.goTo("review") }, "Review contacts") : null, givenSection(app, (each) => show(app, each))],
      chosen || !facts.camera ? null : h("p", { id: "camera", class: "hint" }, `Camera and radii: ${facts.camera}.`),
    ];
  },
  waits: (app) => net?.frame !== app.frame,
  draw(app, c, k) {
    if (!net || net.frame !== app.frame) return;
    const { stage } = app, motions = motionOf(app, facts);
    drawValues(c, stage, net, layers.strain.on ? motions[layers.strain.since] : null);
    drawWalls(c, k, wallLines);
    drawRods(c, k, stage, net);
    drawNetwork(c, k, stage, net, { faint: Boolean(without) });
    if (without) drawChange(c, k, net, without.change);
    drawDisplacement(c, k, stage, net, layers.displacement.on ? motions[layers.displacement.since] : null);
    drawContacts(c, k, stage, net);
    paintLayer(c, "marks", () => {
      if (rodPast && chosen?.id !== undefined) drawTrack(c, k, rodPast.place, app.frame);
      for (const each of list ?? []) if (each.verdict) drawMark(c, k, each, meanRadius(), each.verdict);
      if (chosen) drawChosen(c, k);
    });
  },
  legend(app, c, k) { if (net && net.frame === app.frame) drawLegends(app, c, k, [...networkLegends(net), ...rodLegends(net, motionOf(app, facts))]); },
  restyled(app) { app.paint(); },
  key(app, event) {
    const key = event.key.toLowerCase();
    if (key === "v") { toggleRecording(app); return true; }
    if (key === "j") { jump(app, facts, event.shiftKey ? -1 : 1); return true; }
    if (key === "z") { app.undo(); return true; }
    if (event.key === "Escape" && chosen) { chosen = null; past = null; without = null; app.paint(); return true; }
    if (key === "w" && chosen?.j !== undefined) { toggleWithout(app); return true; }
    if (VERDICTS[key] && chosen?.j !== undefined) { judge(app, VERDICTS[key]); return true; }
    return false;
  },
  timeline(app) { if (facts) showLanes(app, facts, plotted()); else at("time").classList.remove("shown"); },
};

/** What a picture shows: experiment, photograph, time, status, trust. */
function caption(app) {
  const { interval } = app.project.photographs, k = app.frame;
  return [app.project.name, app.place(), interval ? `${digits(k * interval, 4)} s` : "", facts.status[k], `trust ${digits(facts.trust[k], 2)}`, COLOURINGS[layers.forces.by].words].filter(Boolean).join(" · ");
}

function closeRecording() { recording?.close(); recording = null; }

/** The recording in place of the photograph, at the page's frame; a click on a contact there opens its card here. */
function toggleRecording(app) {
  if (recording) { closeRecording(); app.paint(); return; }
  if (!facts || facts.provisional) return;
  const clicked = (x, y, what) => { if (net && list) choose(app, [x, y], what.startsWith("/contacts")); };
  recording = new Recording(at("recording"), app.project.at, { frame: (frame) => app.show(frame + facts.first), clicked });
  recording.open(Math.max(app.frame - facts.first, 0));
  app.recording = recording;
  app.paint();
}

async function load(app, again = false) {
  if (!facts || facts.provisional || app.frame >= facts.count || app.frame < facts.first) { net = null; list = null; chosen = null; frameOf = -1; app.paint(); return; }
  if (frameOf === app.frame && !again) return;
  const { at } = app.project, { frame } = app;
  [net, list] = await Promise.all([request("network", { at, frame }), request("candidate_pairs", { at, view: viewOf(frame) }).then((answer) => { wallLines = answer.walls; return answer.pairs; }), loadGiven(app)]);
  frameOf = frame; without = null; since = performance.now();
  if (wanted?.frame === frame) { const target = wanted; wanted = null; const same = list.find((each) => samePair(each, target)); if (same) { pick(app, same, true); return; } }
  if (chosen?.j !== undefined) { const same = list.find((each) => samePair(each, chosen)); if (same) chosen = same; else chosen = past?.point[frame] ? { ...chosen, point: past.point[frame], normal: [0, 0], verdict: null, fn: null } : null; }
  app.paint();
}

function pick(app, pair, look = false) {
  chosen = pair; past = null; rodPast = null; without = null; since = performance.now();
  if (look) app.stage.centre(...pair.point, 55 / meanRadius());
  app.paint();
  at("panel").scrollTop = 0;
  request("pair", { at: app.project.at, i: pair.i, j: pair.j }).then((answer) => { if (chosen === pair) { past = answer; app.paint(); } }, (error) => notify(error.message, true));
}

const meanRadius = () => meanRadiusOf(net);

/** What the plot and the contact sheet show: the chosen contact or rod in all photographs. */
function plotted() {
  if (!chosen || !net) return null;
  if (chosen.j !== undefined) return { kind: "pair", name: pairName(chosen), data: past, radius: meanRadius() };
  return { kind: "rod", name: bodyName(chosen.id), data: rodPast, radius: net.rods.r[net.rods.id.indexOf(chosen.id)] ?? meanRadius() };
}

const tool = (app) => ({ click: (p) => { if (net && list) choose(app, p); } });

/** The contact near a place, or the rod that is there; line: the clicked contact is drawn from centre to centre. */
function choose(app, p, line = false) {
  const drawn = line ? nearestLine(p) : null;
  if (drawn) { pick(app, drawn); return; }
  const reach = 0.42 * meanRadius();
  let best = null, least = reach;
  for (const each of list) { const away = Math.hypot(each.point[0] - p[0], each.point[1] - p[1]); if (away < least) { least = away; best = each; } }
  if (best) { pick(app, best); return; }
  const n = net.rods.id.findIndex((_, k) => Math.hypot(net.rods.x[k] - p[0], net.rods.y[k] - p[1]) < net.rods.r[k]);
  past = null; rodPast = null; without = null; chosen = n < 0 ? null : { id: net.rods.id[n] };
  app.paint();
  if (chosen) { const { id } = chosen; request("rod", { at: app.project.at, id }).then((answer) => { if (chosen?.id === id) { rodPast = answer; app.paint(); } }, (error) => notify(error.message, true)); }
}

function nearestLine(p) {
  let best = -1, least = 0.7 * meanRadius();
  net.line.forEach(([x1, y1, x2, y2], n) => {
    const along = [x2 - x1, y2 - y1], square = along[0] ** 2 + along[1] ** 2 || 1, t = Math.min(Math.max(((p[0] - x1) * along[0] + (p[1] - y1) * along[1]) / square, 0), 1);
    const away = Math.hypot(x1 + t * along[0] - p[0], y1 + t * along[1] - p[1]);
    if (away < least) { least = away; best = n; }
  });
  return best < 0 ? null : list.find((each) => each.i === net.i[best] && each.j === net.j[best]) ?? null;
}

function toggleWithout(app) {
  if (without) { without = null; app.paint(); return; }
  const pair = chosen;
  app.queue(async () => { const answer = await request("without_contact", { at: app.project.at, frame: app.frame, i: pair.i, j: pair.j }); if (chosen === pair) { without = answer; app.paint(); } });
}

function judge(app, verdict) {
  if (!hasReviewer()) return;
  const pair = chosen, seconds = (performance.now() - since) / 1e3;
  app.queue(async () => {
    await request("judge", { at: app.project.at, view: viewOf(app.frame), pair: { frame: app.frame, i: pair.i, j: pair.j }, verdict, seconds, origin: "click" });
    pair.verdict = verdict;
    await loadGiven(app);
    await app.refresh();
    notify(`${pairName(pair)}: ${verdict}. The next run applies it`);
    app.paint();
  }, "", `judge ${app.frame} ${pair.i} ${pair.j}`);
}

function show(app, each) { chosen = null; wanted = each; if (each.frame === app.frame) app.queue(() => load(app, true)); else app.show(each.frame); }

/** Why the frame has its status, one reason a line. */
function reasonsOf(app) {
  const reasons = (facts.reason[app.frame] ?? "").split("; ").filter(Boolean);
  return reasons.length ? h("div", { id: "reasons" }, h("h2", {}, `Why ${facts.status[app.frame]}, and how`), h("ul", { class: "reasons" }, reasons.map((text) => h("li", {}, text)))) : null;
}

function pairCard(app) {
  const seen = past, k = app.frame, judging = [reviewerField(() => app.queue(() => load(app, true)))], row = net ? net.i.findIndex((i, n) => i === chosen.i && net.j[n] === chosen.j) : -1;
  return h("div", { class: "card here", id: "card" },
    h("div", { class: "fact" }, h("b", {}, pairName(chosen)), chosen.verdict ? h("span", { class: "pill" }, h("i", { class: "swatch", style: { background: COLOURS[chosen.verdict], display: "inline-block" } }), ` ${chosen.verdict}`) : null),
    app.project.files.length ? (past ? strip(app) : h("div", { class: "strip" })) : null,
    h("div", { class: "verdicts" }, Object.entries(VERDICTS).map(([key, verdict]) => h("button", { class: chosen.verdict === verdict ? "on" : "", onclick: () => judge(app, verdict) }, h("kbd", {}, key.toUpperCase()), ` ${verdict}`))),
    judging,
    beforeAfter(k, chosen),
    [
      row >= 0 ? [fact("f_n", withDeviation(net.fn[row], net.fn_sd[row], shown("N"))), fact("f_t", withDeviation(net.ft[row], net.ft_sd[row], shown("N"))), fact("state", /reviewer/.test(net.source[row]) ? net.source[row] : `${net.state[row]}, ${net.age[row]} frames old`)] : fact("force", "none: no contact"),
      past ? fact("gap", withDeviation(past.gap[k] === null ? null : past.gap[k] * 1e6, past.gap_sd[k] * 1e6, "µm")) : null,
      fact("P(touch)", digits(chosen.probability, 3)),
      past ? [h("span", { class: "soft" }, `normal force over the frames [${shown("N")}]; bars: one standard deviation`), chart(58, "normal force over the frames", (c, w, hh) => spark(app, c, w, hh, seen.fn, seen.fn_sd, true)), h("span", { class: "soft" }, "gap over the frames [µm]"), chart(58, "gap over the frames", (c, w, hh) => spark(app, c, w, hh, seen.gap.map((v) => (v === null ? null : v * 1e6)), seen.gap_sd.map((v) => v * 1e6), false))] : null,
    ],
    row < 0 ? null : without ? [
      h("p", {}, without.balanced ? `Without it, the nearest forces in equilibrium change by ${digits(without.total_change, 3)} times the mean force in total (orange: more, blue: less).` : `Without it the rods around it are not in equilibrium: a residual of ${digits(without.residual, 2)} of the mean force is left. The contact is needed.`),
      without.balanced ? h("div", { class: "list" }, without.largest.slice(0, 4).map((each) => h("div", {}, h("span", { style: { flex: "1" } }, pairName(each)), h("span", {}, `${each.change > 0 ? "+" : ""}${force(each.change)}`)))) : null,
    ] : h("button", { id: "without", onclick: () => toggleWithout(app) }, h("kbd", {}, "W"), " Forces without it"),
  );
}

/** The contact in this photograph, the one before and the next, its point in the middle. */
function strip(app) {
  const width = Math.max(Math.round(1.7 * meanRadius()), 8);
  const frames = [-1, 0, 1].map((d) => app.frame + d).filter((k) => k >= 0 && k < facts.count && past.point[k]);
  return h("div", { class: "strip" }, frames.map((k) => h("img", { alt: `frame ${k}`, title: `frame ${k}`, class: k === app.frame ? "here" : "",
    src: `/crop?${new URLSearchParams({ at: app.project.at, frame: k, x: past.point[k][0], y: past.point[k][1], width })}` })));
}

function rodCard(app) {
  const n = net.rods.id.indexOf(chosen.id), k = app.frame, seen = rodPast;
  const touching = net.i.map((i, m) => [i, net.j[m], net.fn[m]]).filter(([i, j]) => i === chosen.id || j === chosen.id);
  return h("div", { class: "card here", id: "card" },
    h("div", { class: "fact" }, h("b", {}, bodyName(chosen.id)), h("span", { class: "pill" }, n < 0 ? "lost" : net.rods.status[n])),
    rodPast ? [
      fact("radius", measured("length", rodPast.radius)), fact("rotation", rodPast.rotation[k] === null ? "unknown" : `${digits(rodPast.rotation[k] * 180 / Math.PI, 3)}°`),
      rodPast.centre_sigma === null ? null : fact("error of the centre, constant", `± ${digits(rodPast.centre_sigma * 1e6, 2)} µm`),
      fact("error of the motion", rodPast.sigma[k] === null ? "–" : `± ${digits(rodPast.sigma[k] * 1e6, 2)} µm`), fact("force residual / mean f_n", digits(rodPast.unbalance[k], 2)),
      h("span", { class: "soft" }, "correlation over the frames"), chart(58, "correlation over the frames", (c, w, hh) => spark(app, c, w, hh, seen.zncc, null, false)),
    ] : null,
    h("span", { class: "soft" }, "contacts"),
    h("div", { class: "list" }, touching.map(([i, j, fn]) => h("button", { onclick: () => { const pair = list.find((each) => each.i === i && each.j === j); if (pair) pick(app, pair); } }, h("span", { style: { flex: "1" } }, bodyName(i === chosen.id ? j : i)), h("span", {}, force(fn))))));
}

/** A line over the frames with its band of one standard deviation; a bar marks this frame. */
function spark(app, c, width, height, values, sd, zero) {
  const all = values.flatMap((v, k) => (v === null ? [] : sd ? [v - (sd[k] ?? 0), v + (sd[k] ?? 0)] : [v]));
  if (!all.length) return;
  const low = zero ? Math.min(0, ...all) : Math.min(...all), high = Math.max(...all, low + 1e-9), pad = 34;
  const x = (k) => pad + (k + 0.5) / values.length * (width - pad - 6), y = (v) => height - 6 - (v - low) / (high - low) * (height - 12);
  c.fillStyle = colour("accent"); c.globalAlpha = 0.18; c.fillRect(x(app.frame) - 3, 2, 6, height - 4);
  if (sd) { c.globalAlpha = 0.28; values.forEach((v, k) => { if (v !== null && sd[k]) c.fillRect(x(k) - 2, y(v + sd[k]), 4, Math.max(y(v - sd[k]) - y(v + sd[k]), 1)); }); }
  c.globalAlpha = 1;
  if (low < 0 && high > 0) { c.strokeStyle = colour("edge"); c.beginPath(); c.moveTo(pad, y(0)); c.lineTo(width - 6, y(0)); c.stroke(); }
  c.strokeStyle = colour("ink"); c.lineWidth = 1.5; c.beginPath();
  let open = false;
  values.forEach((v, k) => { if (v === null) { open = false; return; } if (open) c.lineTo(x(k), y(v)); else c.moveTo(x(k), y(v)); open = true; });
  c.stroke();
  c.fillStyle = colour("ink"); const now = values[app.frame]; if (now !== null && now !== undefined) { c.beginPath(); c.arc(x(app.frame), y(now), 3, 0, 7); c.fill(); }
  c.fillStyle = colour("soft"); c.font = "10.5px system-ui, sans-serif"; c.textAlign = "left"; const count = high - low < 0.05 * Math.abs(high) ? 4 : 2; c.fillText(digits(high, count), 3, 13); c.fillText(digits(low, count), 3, height - 5);
}

function drawChosen(c, k) {
  const ids = chosen.j === undefined ? [chosen.id] : [chosen.i, chosen.j];
  const circles = net.rods.id.flatMap((id, n) => (ids.includes(id) ? [[net.rods.x[n], net.rods.y[n], net.rods.r[n]]] : []));
  drawSelected(c, k, chosen.point, circles, meanRadius());
}
