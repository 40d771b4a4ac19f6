// Step 8: the network under a magnifying glass: any contact or rod with its numbers, its past and its pictures;
// verdicts by keys, those pairs first on which most hangs; blind, where the picture alone shall speak.

import { ask, at, chart, colour, digits, fact, h, tell } from "/page/dom.js";
import { COLOURINGS, drawChange, drawLegend, drawNetwork } from "/page/network.js";
import { showLanes, jump } from "/page/lanes.js";
import { agreementSection } from "/page/agreement.js";
import { Recording } from "/page/recording.js";
import { measured } from "/page/units.js";

const VERDICTS = { c: "contact", n: "no contact", u: "unsure" };
const SAID = { contact: "#2fbf93", "no contact": "#d55e00", unsure: "#f0e442" };
let facts = null, net = null, list = null, chosen = null, past = null, rodPast = null, by = "fn", blind = false, who = null, since = 0, frameOf = -1, without = null, recording = null, wanted = null;
const judges = { open: false, told: null };
let spoken = null; // what this reviewer has said, in every photograph

export const inspect = {
  name: "inspect", title: "Inspect", digits: false,
  mark: (app) => (app.project.run?.frames !== undefined ? "good" : "missing"),
  get dim() { return blind ? 1 : 0.72; },
  hint: (app) => (!facts ? "" : blind ? "Blind: judge by the photograph alone. C contact · N none · U unsure · Z undo" : chosen ? "C contact · N no contact · U unsure · Z undo · Space next at stake" : "Click a contact or a rod; Space goes to the pair on which most hangs"),
  keyHelp: [["C N U", "contact, no contact, unsure"], ["Z", "take the last verdict back"], ["Space", "the pair on which most hangs and nothing is said of"], ["W", "the forces without this contact"], ["B", "blind, or not"], ["V", "the recording, or the photograph"], ["J", "the next flagged frame"]],
  enter(app) { facts = null; net = null; chosen = null; past = null; frameOf = -1; app.queue(async () => { who ??= (await ask("reviewer")).name; facts = (await ask("run_told", { at: app.project.at })).frames; if (facts && app.frame < facts.first) app.frame = facts.first; await load(app); }); },
  leave() { closeRecording(); },
  rodsOfFrame: () => net.rods.x.flatMap((x, n) => [x, net.rods.y[n], net.rods.r[n]]), // for tests
  names: () => net.rods.id, // for tests
  chosen: () => (chosen?.j === undefined ? null : { i: chosen.i, j: chosen.j }), // for tests
  moved(app) { recording?.show(Math.max(app.frame - (facts?.first ?? 0), 0)); app.queue(() => load(app)); },
  taken(app) { if (facts) app.queue(async () => { facts = (await ask("run_told", { at: app.project.at })).frames; await load(app, true); }); },
  tool: (app) => tool(app),
  panel(app) {
    if (!facts) return [h("p", {}, "There is nothing to inspect yet: forces are found when the experiment is run."), h("button", { class: "primary", onclick: () => app.goTo("run") }, "To the run")];
    if (facts.provisional) return h("p", {}, "The run is not finished: what it has found so far is shown in step 6.");
    const judged = list ? list.filter((each) => each.verdict).length : 0;
    return [
      h("div", { class: "field" }, h("label", { htmlFor: "colour-by" }, "colour by"), h("select", { id: "colour-by", disabled: blind, onchange: (event) => { by = event.target.value; app.paint(); } }, Object.entries(COLOURINGS).map(([name, how]) => h("option", { value: name, selected: name === by }, how.words)))),
      h("div", { class: "field" }, h("label", { htmlFor: "who" }, "reviewer"), h("input", { id: "who", value: who ?? "", placeholder: "your name", onchange: (event) => { who = event.target.value.trim(); app.queue(() => load(app, true)); } })),
      h("div", { class: "row" }, h("button", { class: blind ? "on" : "", id: "blind", onclick: () => toggleBlind(app), title: "B" }, "Blind"), h("button", { class: recording ? "on" : "", id: "show-recording", disabled: blind, onclick: () => toggleRecording(app), title: blind ? "It shows what was found: not while you judge blind" : "V" }, recording ? "Photograph" : "Recording"), recording ? h("button", { id: "panels", onclick: () => recording.toggle(), title: "Entities, selection and time of the viewer" }, "Its panels") : null, h("button", { class: "primary", id: "next", onclick: () => nextAtStake(app) }, "Next at stake"), h("span", { class: "soft" }, list ? `${judged} judged of ${list.length}` : "")),
      chosen?.j !== undefined ? pairCard(app) : chosen ? rodCard(app) : h("p", {}, facts.reason[app.frame] ?? ""),
      !blind && list && !chosen ? [h("h3", {}, "Most hangs on"), h("div", { class: "list" }, list.slice(0, 14).map((each) => h("button", { onclick: () => pick(app, each, true) }, h("span", { style: { flex: "1" } }, pairName(each)), h("span", { class: "soft" }, `P ${digits(each.probability, 2)} · ${digits(each.stake, 2)} N`), each.verdict ? h("span", { class: "swatch", style: { background: SAID[each.verdict] } }) : null)))] : null,
      blind || chosen ? null : judgedSection(app),
      blind ? null : agreementSection(app, judges, (each) => show(app, each)),
    ];
  },
  draw(app, c, k) {
    if (!net || net.frame !== app.frame) return;
    if (!blind) drawNetwork(c, k, net, { by, faint: Boolean(without) });
    if (!blind && without) drawChange(c, k, net, without.change);
    for (const each of list ?? []) {
      if (!each.verdict) continue;
      const [x, y] = each.point;
      c.lineWidth = 4 / k; c.strokeStyle = "#000b"; c.beginPath(); c.arc(x, y, 7 / k, 0, 7); c.stroke();
      c.lineWidth = 2 / k; c.strokeStyle = SAID[each.verdict]; c.stroke();
      if (each.verdict === "no contact") { c.beginPath(); c.moveTo(x - 5 / k, y - 5 / k); c.lineTo(x + 5 / k, y + 5 / k); c.stroke(); }
    }
    if (chosen) drawChosen(c, k);
    if (!blind) drawLegend(app, c, k, net, by);
  },
  key(app, event) {
    const key = event.key.toLowerCase();
    if (event.key === " ") { nextAtStake(app); return true; }
    if (key === "b") { toggleBlind(app); return true; }
    if (key === "v") { toggleRecording(app); return true; }
    if (key === "j") { jump(app, facts); return true; }
    if (key === "z") { undo(app); return true; }
    if (event.key === "Escape" && chosen) { chosen = null; past = null; without = null; app.paint(); return true; }
    if (key === "w" && chosen?.j !== undefined && !blind) { askWithout(app); return true; }
    if (VERDICTS[key] && chosen?.j !== undefined) { say(app, VERDICTS[key]); return true; }
    return false;
  },
  timeline(app) { if (facts) showLanes(app, facts); else at("time").classList.remove("shown"); },
};

function toggleBlind(app) { blind = !blind; if (blind) closeRecording(); app.paint(); }

function closeRecording() { recording?.close(); recording = null; }

/** The recording in the place of the photograph, at the page's frame; a contact that is clicked there has its card here. */
function toggleRecording(app) {
  if (recording) { closeRecording(); app.paint(); return; }
  if (!facts || facts.provisional || blind) return;
  const clicked = (x, y, what) => { if (net && list) choose(app, [x, y], what.startsWith("/contacts")); };
  recording = new Recording(at("recording"), app.project.at, { frame: (frame) => app.show(frame + facts.first), clicked });
  recording.open(Math.max(app.frame - facts.first, 0));
  app.recording = recording;
  app.paint();
}

const shuffled = (pair) => { let x = 2166136261; for (const letter of `${pair.i} ${pair.j}`) x = Math.imul(x ^ letter.charCodeAt(0), 16777619); return (x ^ (x >>> 15)) >>> 0; };
const named = (body) => (typeof body === "number" ? `rod ${body}` : `wall ${body}`);
const pairName = (pair) => (typeof pair.j === "number" ? `rods ${pair.i} – ${pair.j}` : `rod ${pair.i} – ${pair.j}`);

async function load(app, again = false) {
  if (!facts || facts.provisional || app.frame >= facts.count || app.frame < facts.first) { net = null; list = null; chosen = null; frameOf = -1; app.paint(); return; }
  if (frameOf === app.frame && !again) return;
  const { at } = app.project, { frame } = app;
  [net, list, spoken] = await Promise.all([ask("network", { at, frame }), ask("candidates", { at, frame, reviewer: who }).then((answer) => answer.pairs), ask("judged", { at, reviewer: who })]);
  frameOf = frame; without = null; since = performance.now();
  if (wanted?.frame === frame) { const named = wanted; wanted = null; const same = list.find((each) => each.i === named.i && each.j === named.j); if (same) { pick(app, same, true); return; } }
  if (chosen?.j !== undefined) { const same = list.find((each) => each.i === chosen.i && each.j === chosen.j); if (same) chosen = same; else chosen = past?.point[frame] ? { ...chosen, point: past.point[frame], verdict: null, fn: null } : null; }
  app.paint();
}

function pick(app, pair, look = false) {
  chosen = pair; past = null; rodPast = null; without = null; since = performance.now();
  if (look) app.stage.centre(...pair.point, 55 / meanRadius());
  app.paint();
  at("panel").scrollTop = 0;
  ask("pair", { at: app.project.at, i: pair.i, j: pair.j }).then((answer) => { if (chosen === pair) { past = answer; app.paint(); } }, (error) => tell(error.message, true));
}

const meanRadius = () => net.rods.r.reduce((a, b) => a + b, 0) / Math.max(net.rods.r.length, 1);

const tool = (app) => ({ click: (p) => { if (net && list) choose(app, p); } });

/** The contact near a place, or the rod that is there; line: what was clicked is drawn from centre to centre. */
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
  if (chosen) { const { id } = chosen; ask("rod", { at: app.project.at, id }).then((answer) => { if (chosen?.id === id) { rodPast = answer; app.paint(); } }, (error) => tell(error.message, true)); }
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

function askWithout(app) {
  if (without) { without = null; app.paint(); return; }
  const pair = chosen;
  app.queue(async () => { const answer = await ask("without", { at: app.project.at, frame: app.frame, i: pair.i, j: pair.j }); if (chosen === pair) { without = answer; app.paint(); } });
}

function nextAtStake(app) {
  // Blind, the order tells nothing, either: it is that of the names, shuffled, the same in every session.
  const order = blind ? [...(list ?? [])].sort((a, b) => shuffled(a) - shuffled(b)) : list ?? [];
  const left = order.filter((each) => !each.verdict);
  if (!left.length) { tell("Everything in this frame has been judged"); return; }
  pick(app, left[(left.indexOf(chosen) + 1) % left.length], true);
}

function say(app, verdict) {
  if (!who) { at("who").focus(); tell("Say who judges: verdicts are signed", true); return; }
  const pair = chosen, seconds = (performance.now() - since) / 1e3;
  app.queue(async () => {
    await ask("judge", { at: app.project.at, frame: app.frame, i: pair.i, j: pair.j, verdict, reviewer: who, seconds: Math.round(seconds * 10) / 10, blind });
    pair.verdict = verdict;
    spoken = await ask("judged", { at: app.project.at, reviewer: who });
    if (judges.open) judges.told = await ask("agreement", { at: app.project.at });
    tell(`${pairName(pair)}: ${verdict}. The next run obeys it`);
    nextAtStake(app); app.paint();
  }, "", `judge ${app.frame} ${pair.i} ${pair.j}`);
}

function undo(app) {
  app.queue(async () => {
    const told = await ask("unjudge", { at: app.project.at, reviewer: who });
    if (!told.undone) { tell("There is no verdict to take back"); return; }
    if (told.frame !== app.frame) { app.frame = told.frame; frameOf = -1; }
    await load(app, true);
    const same = list.find((each) => each.i === told.i && each.j === told.j);
    if (same) pick(app, same, true);
    tell(`Taken back: ${told.undone}`);
  });
}

const force = (value) => (value === null ? "none" : `${digits(value, 3)} N`);

/** What was said, and what the forces were when it was said and are now; a click shows the pair. */
function judgedSection(app) {
  if (!spoken?.pairs.length) return null;
  return [h("h3", {}, "Judged"),
    spoken.waiting ? h("div", { class: "says" }, h("p", { id: "verdicts-wait" }, h("span", { class: "sign doubtful" }, "!"), `${spoken.waiting === 1 ? "One verdict waits" : `${spoken.waiting} verdicts wait`} for the next run.`)) : null,
    spoken.waiting ? h("button", { onclick: () => app.goTo("run") }, "To the run") : null,
    h("div", { class: "list", id: "judged" }, spoken.pairs.slice(0, 40).map((each) => h("button", { onclick: () => show(app, each) },
      h("span", { class: "two" }, h("span", {}, `photograph ${each.frame} · ${pairName(each)}`), h("span", { class: "soft" }, each.before ? `${each.verdict}: f_n ${force(each.before.fn)} → ${each.obeyed ? force(each.now.fn) : "the next run"}` : each.verdict)),
      h("span", { class: "swatch", style: { background: SAID[each.verdict] } }))))];
}

function show(app, each) { chosen = null; wanted = each; if (each.frame === app.frame) app.queue(() => load(app, true)); else app.show(each.frame); }

/** The forces of a pair that was judged: before the verdict, and since a run obeys it. */
function beforeAfter(app) {
  const word = spoken?.pairs.find((each) => each.frame === app.frame && each.i === chosen.i && each.j === chosen.j);
  if (!word?.before) return null;
  return h("div", { class: "card", id: "before-after" }, h("div", { class: "fact" }, h("span", {}, word.obeyed ? "the run obeyed: before → after" : "when it was judged"), word.obeyed ? h("span", { class: "sign good" }, "✓") : null),
    word.obeyed ? [fact("f_n", `${force(word.before.fn)} → ${force(word.now.fn)}`), fact("f_t", `${force(word.before.ft)} → ${force(word.now.ft)}`)]
      : [fact("f_n", force(word.before.fn)), h("p", {}, "The next run obeys it; what comes out is shown here.")]);
}

function pairCard(app) {
  const seen = past, k = app.frame, row = net ? net.i.findIndex((i, n) => i === chosen.i && net.j[n] === chosen.j) : -1;
  const with_ = (value, sd, unit, count = 3) => (value === null || value === undefined ? "–" : `${digits(value, count)}${sd !== null && sd !== undefined ? ` ± ${digits(sd, 2)}` : ""} ${unit}`);
  return h("div", { class: "card here", id: "card" },
    h("div", { class: "fact" }, h("b", {}, pairName(chosen)), chosen.verdict ? h("span", { class: "pill", style: { color: SAID[chosen.verdict], borderColor: "currentColor" } }, chosen.verdict) : null),
    past ? strip(app) : h("div", { class: "strip" }),
    h("div", { class: "verdicts" }, Object.entries(VERDICTS).map(([key, verdict]) => h("button", { class: chosen.verdict === verdict ? "on" : "", onclick: () => say(app, verdict) }, h("kbd", {}, key.toUpperCase()), ` ${verdict}`))),
    blind ? null : beforeAfter(app),
    blind ? null : [
      row >= 0 ? [fact("f_n", with_(net.fn[row], net.fn_sd[row], "N")), fact("f_t", with_(net.ft[row], net.ft_sd[row], "N")), fact("it is", /reviewer/.test(net.source[row]) ? net.source[row] : `${net.state[row]}, ${net.age[row]} frames old`)] : fact("force", "none: not taken for a contact"),
      past ? fact("gap", with_(past.gap[k] === null ? null : past.gap[k] * 1e6, past.gap_sd[k] * 1e6, "µm")) : null,
      fact("P(touch)", digits(chosen.probability, 3)),
      past ? [h("span", { class: "soft" }, "normal force over the frames"), chart(58, (c, w, hh) => spark(app, c, w, hh, seen.fn, seen.fn_sd, true)), h("span", { class: "soft" }, "gap over the frames [µm]"), chart(58, (c, w, hh) => spark(app, c, w, hh, seen.gap.map((v) => (v === null ? null : v * 1e6)), seen.gap_sd.map((v) => v * 1e6), false))] : null,
    ],
    blind || row < 0 ? null : without ? [
      h("p", {}, without.stands ? `Without it, the nearest forces in balance move ${digits(without.share, 3)} times the mean force (orange: more, blue: less).` : `Without it nothing near balances the rods: ${digits(without.unbalance, 2)} of the mean force is left over. It is needed.`),
      without.stands ? h("div", { class: "list" }, without.most.slice(0, 4).map((each) => h("div", {}, h("span", { style: { flex: "1" } }, pairName(each)), h("span", {}, `${each.change > 0 ? "+" : ""}${digits(each.change, 3)} N`)))) : null,
    ] : h("button", { id: "without", onclick: () => askWithout(app) }, h("kbd", {}, "W"), " What if it were not there?"),
  );
}

/** The contact in this photograph and its neighbours in time, its point always in the middle. */
function strip(app) {
  const width = Math.max(Math.round(1.7 * meanRadius()), 8);
  const frames = [-1, 0, 1].map((d) => app.frame + d).filter((k) => k >= 0 && k < facts.count && past.point[k]);
  return h("div", { class: "strip" }, frames.map((k) => h("img", { alt: `frame ${k}`, title: `frame ${k}`, class: k === app.frame ? "here" : "",
    src: `/crop?${new URLSearchParams({ at: app.project.at, frame: k, x: Math.max(0, Math.round(past.point[k][0] * 100)), y: Math.max(0, Math.round(past.point[k][1] * 100)), width })}` })));
}

function rodCard(app) {
  const n = net.rods.id.indexOf(chosen.id), k = app.frame, seen = rodPast;
  const touching = net.i.map((i, m) => [i, net.j[m], net.fn[m]]).filter(([i, j]) => i === chosen.id || j === chosen.id);
  return h("div", { class: "card here", id: "card" },
    h("div", { class: "fact" }, h("b", {}, named(chosen.id)), h("span", { class: "pill" }, n < 0 ? "lost" : net.rods.status[n])),
    rodPast ? [
      fact("radius", measured("length", rodPast.radius)), fact("turned by", rodPast.rotation[k] === null ? "unknown" : `${digits(rodPast.rotation[k] * 180 / Math.PI, 3)}°`),
      fact("place", rodPast.sigma[k] === null ? "–" : `± ${digits(rodPast.sigma[k] * 1e6, 2)} µm`), blind ? null : fact("unbalance / mean f_n", digits(rodPast.unbalance[k], 2)),
      h("span", { class: "soft" }, "correlation over the frames"), chart(58, (c, w, hh) => spark(app, c, w, hh, seen.zncc, null, false)),
    ] : null,
    blind ? h("p", {}, "What it touches is not told while you judge blind.") : h("span", { class: "soft" }, "touches"),
    blind ? null : h("div", { class: "list" }, touching.map(([i, j, fn]) => h("button", { onclick: () => { const pair = list.find((each) => each.i === i && each.j === j); if (pair) pick(app, pair); } }, h("span", { style: { flex: "1" } }, named(i === chosen.id ? j : i)), h("span", {}, `${digits(fn, 3)} N`)))));
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
  net.rods.id.forEach((id, n) => {
    if (!ids.includes(id)) return;
    c.beginPath(); c.arc(net.rods.x[n], net.rods.y[n], net.rods.r[n], 0, 2 * Math.PI);
    c.lineWidth = 4 / k; c.strokeStyle = "#000b"; c.stroke(); c.lineWidth = 2 / k; c.strokeStyle = "#fff"; c.stroke();
  });
  if (chosen.point) { const [x, y] = chosen.point; c.beginPath(); c.arc(x, y, 12 / k, 0, 7); c.lineWidth = 4.5 / k; c.strokeStyle = "#000b"; c.stroke(); c.lineWidth = 2.2 / k; c.strokeStyle = "#fff"; c.stroke(); }
}
