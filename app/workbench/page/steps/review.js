// Step 8: contacts judged by eye, one pair after the other, a key for every action. The photograph shows the candidate
// pairs of a frame, the panel the magnified gap. Blind, everything that reveals the detector's answer is left out.

import { at, h, notify, request, strokeCircles } from "/page/dom.js";
import { agreementSection } from "/page/parts/agreement.js";
import { jump, showLanes } from "/page/time/lanes.js";
import { CROP, cropAddress, cropWindow, drawOutlines, gapScale, intervalBar, svg } from "/page/parts/pair_drawing.js";
import { runMark } from "/page/parts/run_state.js";
import { force } from "/page/units.js";
import { COLOURS, beforeAfter, drawMark, drawSelected, givenSection, hasReviewer, loadGiven, loadReviewer, pairName, reviewerField, samePair, verdicts, viewOf } from "/page/parts/verdicts.js";

const ORDERS = { influence: "By influence", frame: "Whole frame", sample: "Sample of all" };
const ABOUT = {
  influence: "Pairs of this photograph: influence on the forces times ambiguity, the highest first",
  frame: "Every candidate pair of this photograph, the most ambiguous first; accuracy is estimated from these verdicts",
  sample: "A random sample of all photographs; accuracy is estimated from these verdicts",
};
const FLAGS = { rearrangement: ["R", "Rearrangement"], reset: ["T", "Reset"], ignore: ["I", "Ignore"] };
const LONGEST = 300; // [s] of one verdict: beyond it the reviewer was away
const AROUND = 9; // [mean diameters] height of the photograph's part around a pair
const OUTLINE = "#ced4e070";

const settings = { order: "influence", blind: false };
const state = { pair: null, status: null, frame: null, facts: null, error: "", zoom: 1, outlines: true, whole: false, since: 0, visited: [], presented: 0, listed: false };
const agreement = { open: false, counts: null };
globalThis.review = state; // for tests

export const review = {
  name: "review", title: "Review", digits: "123",
  ofRun: true, mark: runMark,
  hint: () => (!state.status ? "" : settings.blind ? "Blind, in random order: judge by the photograph alone. C contact · N no contact · U unsure · Z undo" : "C contact · N no contact · U unsure · Z undo · Space next · click: select or add a pair"),
  keyHelp: [["C N U, 1 2 3", "contact, no contact, unsure; then the next pair"], ["Z", "undo the last action"], ["Space, →", "next pair without a verdict"], ["←", "back to the pair before"], ["[ ], PageUp PageDown", "photograph before, next photograph"], ["M", "order: by influence, whole frame, sample of all"], ["B", "blind: the detector's answer is hidden"], ["O", "outlines on the crop"], ["+ −", "crop closer, farther"], ["W", "the whole photograph, or around the pair"], ["G", "go to a pair by name: two rods, or a rod and a wall"], ["R T I", "flag this photograph: rearrangement, reset, ignore"], ["J", "the next flagged frame"], ["click", "selects a candidate pair; in a gap without one adds the missed contact; on the crop as well"]],
  enter(app) { Object.assign(state, { pair: null, status: null, frame: null, visited: [], error: "" }); app.queue(() => begin(app)); },
  taken(app) { if (state.status) app.queue(() => refresh(app)); },
  moved(app) { app.queue(() => toFrame(app)); },
  reverted: (app, pair) => reverted(app, pair),
  tool: (app) => ({ click: (p) => pick(app, p) }),
  pairs: () => state.frame?.pairs ?? [], // for tests
  panel(app) {
    if (state.error) return [h("p", {}, app.project.run === null ? "There are no contacts to review yet: run the experiment first." : state.error), h("button", { class: "primary", onclick: () => app.goTo("run") }, "To the run")];
    if (!state.status) return h("p", {}, "Reading results …");
    return [
      cropFigure(app), pairLines(), beforeAfterOf(),
      h("div", { class: "verdicts large" }, [["C", "contact"], ["N", "no contact"], ["U", "unsure"]].map(([key, verdict]) => h("button", { id: verdict.replace(" ", "-"), class: state.pair?.verdict === verdict ? "given" : "", disabled: !state.pair, style: { borderColor: COLOURS[verdict] }, onclick: () => judge(app, verdict) }, h("kbd", {}, key), ` ${verdict}`))),
      h("div", { class: "verdicts" }, h("button", { id: "undo-verdict", onclick: () => app.undo() }, h("kbd", {}, "Z"), " Undo"), h("button", { id: "next", onclick: () => next(app) }, h("kbd", {}, "Space"), " Next"), h("button", { id: "next-frame", disabled: app.frame + 1 >= state.status.stop, onclick: () => step(app, 1) }, h("kbd", {}, "]"), " Next frame")),
      progress(app),
      h("div", { class: "verdicts flags", role: "group", "aria-label": "Flags of this photograph" }, Object.entries(FLAGS).map(([name, [key, words]]) => h("button", { id: name, class: state.status.flags.includes(name) ? "flagged" : "", "aria-pressed": String(state.status.flags.includes(name)), onclick: () => flag(app, name) }, h("kbd", {}, key), ` ${words}`))),
      h("div", { class: "reviewer-row" }, reviewerField(() => { agreement.counts = null; app.queue(() => begin(app)); }), h("button", { id: "blind", class: settings.blind ? "on" : "", "aria-pressed": String(settings.blind), title: "Hide the detector's answer (B)", onclick: () => setBlind(app) }, h("kbd", {}, "B"), " Blind")),
      h("div", { class: "field" }, h("label", { htmlFor: "pair-name" }, "pair"), h("input", { id: "pair-name", placeholder: "12 34", title: "Two names, then Enter (G)", autocomplete: "off", spellcheck: false, onkeydown: (event) => event.key === "Enter" && event.target.blur(), onchange: (event) => event.target.value.trim() && goToPair(app, event.target.value) })),
      state.status.damaged_lines ? h("p", {}, `${state.status.damaged_lines} damaged lines of the log are skipped.`) : null,
      settings.blind ? null : [candidateList(app), givenSection(app, (each) => show(app, each)), agreementSection(app, agreement, (each) => show(app, each))],
    ];
  },
  draw(app, c, k) {
    const { frame, pair } = state;
    if (!frame || frame.frame !== app.frame) return;
    const { rods } = frame, radius = meanRadius();
    if (state.outlines || !app.project.files.length) {
      strokeCircles(c, k, rods.x.map((x, n) => [x, rods.y[n], rods.r[n]]).filter((each) => app.stage.sees(...each)), OUTLINE, 1, { under: null });
      c.strokeStyle = OUTLINE; c.lineWidth = 2 / k;
      for (const wall of frame.walls) { c.beginPath(); wall.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y))); c.stroke(); }
    }
    for (const each of frame.pairs) if (app.stage.sees(...each.point, radius)) drawMark(c, k, each, radius, each.verdict ?? (settings.blind ? "hidden" : each.detected ? "detected" : "undetected"));
    if (pair && pair.frame === app.frame) drawSelected(c, k, pair.point, pair.circles, radius);
  },
  legend(app, c, k) { if (state.frame?.frame === app.frame) drawLegend(app, c, k); },
  key(app, event) {
    if (!state.status || event.altKey || event.repeat || (event.key === " " && event.target.tagName === "BUTTON")) return false; // the button's own key
    const act = {
      c: () => judge(app, "contact"), 1: () => judge(app, "contact"), n: () => judge(app, "no contact"), 2: () => judge(app, "no contact"),
      u: () => judge(app, "unsure"), 3: () => judge(app, "unsure"), z: () => app.undo(), " ": () => next(app), ArrowRight: () => next(app), ArrowLeft: () => back(app),
      "]": () => step(app, 1), PageDown: () => step(app, 1), "[": () => step(app, -1), PageUp: () => step(app, -1),
      m: () => setOrder(app, Object.keys(ORDERS)[(Object.keys(ORDERS).indexOf(settings.order) + 1) % 3]), b: () => setBlind(app), o: () => setOutlines(app),
      "+": () => setZoom(app, 1), "=": () => setZoom(app, 1), "-": () => setZoom(app, -1), w: () => { state.whole = !state.whole; look(app); }, g: () => at("pair-name").focus(),
      r: () => flag(app, "rearrangement"), t: () => flag(app, "reset"), i: () => flag(app, "ignore"), j: () => jump(app, state.facts),
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    act?.();
    return Boolean(act);
  },
  timeline(app) { if (state.status) showLanes(app, state.facts); else at("time").classList.remove("shown"); },
};

const view = (app) => viewOf(app.frame, settings);
const meanRadius = () => { const { r } = state.frame.rods; return r.reduce((a, b) => a + b, 0) / Math.max(r.length, 1); };
const call = (app, endpoint, values = {}) => request(endpoint, { at: app.project.at, view: view(app), ...values });
const named = ({ frame, i, j }) => ({ frame, i, j });

// ---------------------------------------------------------------- data

async function begin(app) {
  await loadReviewer();
  try {
    state.facts = (await request("run_state", { at: app.project.at })).frames;
    if (state.facts && app.frame < state.facts.first) app.frame = state.facts.first;
    if (state.facts && app.frame >= state.facts.count) app.frame = state.facts.count - 1;
    await loadFrame(app);
  } catch (error) { state.error = error.message; app.paint(); return; }
  await loadGiven(app);
  await present(app, (await call(app, "next_pair")).pair);
}

/** Candidate pairs and rods of the photograph, and the progress of the review. */
async function loadFrame(app) {
  const [frame, status] = await Promise.all([call(app, "candidate_pairs"), call(app, "review_status")]);
  Object.assign(state, { frame, status });
}

/** Another window, or another program, has changed something. */
async function refresh(app) {
  await Promise.all([loadFrame(app), loadGiven(app)]);
  app.paint();
}

async function toFrame(app) {
  if (!state.status || app.frame < state.status.first || app.frame >= state.status.stop) { state.pair = null; state.frame = null; app.paint(); return; }
  if (settings.order === "sample") settings.order = "influence";
  await loadFrame(app);
  await present(app, (await call(app, "next_pair")).pair);
}

/** Show a pair; its photograph comes with it. */
async function present(app, pair, moves = true) {
  state.pair = pair;
  state.since = performance.now();
  if (pair) app.frame = pair.frame;
  if (state.frame?.frame !== app.frame) await loadFrame(app); else state.status = await call(app, "review_status");
  if (moves) look(app);
  app.paint();
  await at("cropped")?.decode?.().catch(() => {});
  state.presented += 1;
}

function look(app) {
  const { pair } = state;
  if (!pair || state.whole) app.stage.fit(); else app.stage.centre(...pair.point, app.stage.boxHeight / (AROUND * pair.crop_widths[2]));
}

/** A verdict changes one mark; a pair that is no candidate pair yet is added by reading the frame again. */
async function mark(app, pair, verdict) {
  const listed = state.frame?.frame === pair.frame ? state.frame.pairs.find((each) => samePair(each, pair)) : null;
  if (listed && state.frame.pairs.length) listed.verdict = verdict; else state.frame = null;
}

// ---------------------------------------------------------------- actions

function judge(app, verdict) {
  if (!hasReviewer()) return;
  app.queue(async () => {
    const { pair } = state;
    if (!pair) return;
    const seconds = Math.min((performance.now() - state.since) / 1000, LONGEST);
    const answer = await call(app, "judge", { pair: named(pair), verdict, seconds, origin: pair.origin });
    notify(`${pairName(pair)}: ${verdict}. The next run applies it`);
    mark(app, pair, verdict);
    await app.refresh();
    state.visited.push(pair);
    await present(app, answer.pair);
    await loadGiven(app);
    if (agreement.open) agreement.counts = await request("agreement", { at: app.project.at });
    app.paint();
  });
}

const next = (app) => app.queue(async () => {
  if (state.pair) state.visited.push(state.pair);
  await present(app, (await call(app, "next_pair", state.pair ? { after: named(state.pair) } : {})).pair);
});

const back = (app) => app.queue(async () => {
  const former = state.visited.pop();
  if (!former) { notify("There is no pair before this one"); return; }
  app.frame = former.frame;
  await select(app, former, former.origin);
});

/** A verdict or a flag was undone or repeated: its photograph, and its pair, are shown. */
const reverted = (app, { frame, i, j }) => app.queue(async () => {
  if (!state.status || frame < state.status.first || frame >= state.status.stop) return;
  app.frame = frame;
  state.frame = null;
  if (i === null) await present(app, state.pair?.frame === frame ? state.pair : null); else await select(app, { i, j });
  await loadGiven(app);
  app.paint();
});

function step(app, by) {
  const frame = app.frame + by;
  if (frame >= state.status.first && frame < state.status.stop) app.show(frame);
}

const pick = (app, [x, y]) => app.queue(async () => {
  if (!state.frame) return;
  const answer = await call(app, "pair_at", { x, y });
  if (!answer.pair) { notify("There is no gap here: click a candidate pair, or between two rods"); return; }
  if (answer.added) { state.frame = null; await app.refresh(); notify(`Added a contact: ${pairName(answer.pair)}. Z undoes it`); }
  await present(app, answer.pair, false);
  if (answer.added) { await loadGiven(app); app.paint(); }
});

const goToPair = (app, text) => app.queue(async () => {
  const [i, j] = text.trim().split(/[\s,–-]+/);
  await select(app, { i: i ?? "", j: j ?? "" });
});

const show = (app, each) => app.queue(async () => { app.frame = each.frame; await select(app, each); });

async function select(app, { i, j }, origin = null) {
  const { pair } = await call(app, "pair_named", { i, j });
  if (origin) pair.origin = origin;
  await present(app, pair);
}

const flag = (app, name) => app.queue(async () => {
  if (!hasReviewer()) return;
  const on = !state.status.flags.includes(name);
  await call(app, "flag_frame", { flag: name, on });
  notify(`Photograph ${app.frame}: ${name} ${on ? "set" : "cleared"}`);
  await app.refresh();
  state.status = await call(app, "review_status");
  app.paint();
});

const setOrder = (app, order) => app.queue(async () => {
  settings.order = order;
  await present(app, (await call(app, "next_pair")).pair);
});

const setBlind = (app) => app.queue(async () => {
  settings.blind = !settings.blind;
  state.outlines = !settings.blind;
  state.frame = null;
  if (state.pair) await select(app, state.pair, state.pair.origin); else await present(app, null);
});

function setZoom(app, by) { state.zoom = Math.min(2, Math.max(0, state.zoom + by)); app.paint(); }

function setOutlines(app) { state.outlines = !state.outlines; app.paint(); }

// ---------------------------------------------------------------- panel

let figure = null; // made once: a new image would be read again at every change of the panel

function cropFigure(app) {
  const { pair, zoom } = state;
  if (!figure) {
    const button = (id, words, title, act) => h("button", { id, title, "aria-label": title, onclick: act }, words);
    figure = h("figure", { id: "crop", onclick: (event) => {
      if (!state.pair || event.target.closest("button")) return;
      const box = figure.getBoundingClientRect(), [left, top, width, height] = cropWindow(state.pair, state.zoom);
      pick(app, [left + (event.clientX - box.left) / box.width * width, top + (event.clientY - box.top) / box.height * height]);
    } }, h("img", { id: "cropped", alt: "", width: CROP.columns, height: CROP.rows }), svg(null, "svg", { id: "outlines", "aria-hidden": "true" }), h("figcaption", {}),
    h("div", { class: "corner" }, button("nearer", "+", "Closer (+)", () => setZoom(app, 1)), button("farther", "−", "Farther (−)", () => setZoom(app, -1)), button("outline", "◯", "Outlines (O)", () => setOutlines(app))));
  }
  const [image, outlines, caption] = figure.children, address = pair && app.project.files.length ? cropAddress(app.project.at, pair, zoom) : null;
  if (address === null) { image.removeAttribute("src"); image.dataset.address = ""; } else if (image.dataset.address !== address) { image.dataset.address = address; image.src = address; }
  image.alt = pair ? `The photograph around the gap between ${pairName(pair)}` : "";
  drawOutlines(outlines, pair, zoom, state.outlines);
  caption.textContent = pair ? "" : settings.order === "sample" ? "The whole sample is judged." : "Every candidate pair of this photograph is judged. Next photograph: ]";
  figure.querySelector("#outline").setAttribute("aria-pressed", String(state.outlines));
  return figure;
}

const signed = (value) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(1)}`;

function pairLines() {
  const { pair } = state;
  if (!pair) return h("div", { id: "pair" });
  const known = pair.detected !== undefined, probability = known && pair.probability !== null ? `, P ${pair.probability.toFixed(2)}` : "";
  const deviations = pair.gap_sd_um > 0 ? ` = ${signed(pair.gap_um / pair.gap_sd_um)} sd` : "";
  return h("div", { id: "pair", "aria-live": "polite" },
    h("div", { class: "fact" }, h("b", { id: "bodies" }, pairName(pair)), h("span", { id: "detector" }, known ? `${pair.detected ? "detected" : "not detected"}${probability}` : "")),
    known && Number.isFinite(pair.gap_um) ? [gapScale(pair), h("div", { class: "soft", id: "gap" }, h("b", {}, `gap ${signed(pair.gap_um)} ± ${pair.gap_sd_um.toFixed(1)} µm`), `${deviations}, threshold ${pair.threshold_um.toFixed(0)} µm`)] : null,
    pair.verdict ? h("div", { class: "fact" }, h("span", {}, "your verdict"), h("span", { id: "given" }, h("i", { class: "swatch", style: { background: COLOURS[pair.verdict] } }), ` ${pair.verdict}`)) : null);
}

const beforeAfterOf = () => (state.pair && !settings.blind ? beforeAfter(state.pair.frame, state.pair) : null);

function progress(app) {
  const { status } = state, percent = (value) => (100 * value).toFixed(1);
  const line = (name) => {
    const interval = status.sampled > 0 ? status.estimate[name] : null;
    return [h("dt", {}, name), h("dd", {}, intervalBar(interval), h("span", { id: `${name}-text`, title: "from verdicts in random order: whole frame, or sample of all" }, interval ? `${percent(interval.value)} % (${percent(interval.low)} – ${percent(interval.high)})` : "not known yet"))];
  };
  return h("section", { id: "progress" },
    h("div", { class: "choice", role: "group", "aria-label": "Order of the pairs" }, Object.entries(ORDERS).map(([order, words]) => h("button", { id: `order-${order}`, class: settings.order === order ? "on" : "", "aria-pressed": String(settings.order === order), title: `${ABOUT[order]} (M)`, onclick: () => setOrder(app, order) }, words))),
    h("div", { class: "meter" }, h("i", { style: { width: `${100 * status.judged / Math.max(status.total, 1)}%` } })),
    h("div", { class: "soft", id: "count" }, `${status.judged} of ${status.total} pairs judged`),
    status.estimate ? h("dl", { id: "estimate" }, line("precision"), line("recall")) : null);
}

/** The pairs of this photograph whose verdict may change the forces most. */
function candidateList(app) {
  const listed = (state.frame?.pairs ?? []).filter((each) => each.priority !== null && each.priority !== undefined).slice(0, 14);
  return h("details", { id: "candidates", open: state.listed, ontoggle: (event) => { if (event.target.open !== state.listed) { state.listed = event.target.open; app.paint(); } } }, h("summary", {}, "Influence times ambiguity"), h("div", { class: "list" }, listed.map((each) => h("button", { onclick: () => show(app, { frame: app.frame, ...each }) },
    h("span", { style: { flex: "1" } }, pairName(each)), h("span", { class: "soft" }, `P ${each.probability === null ? "–" : each.probability.toFixed(2)} · ${force(each.priority, 2)}`), each.verdict ? h("span", { class: "swatch", style: { background: COLOURS[each.verdict] } }) : null))));
}

/** Marks and their meaning, in the lower left corner of the photograph. */
function drawLegend(app, c, k) {
  const { stage } = app, kinds = [...(settings.blind ? [["hidden", "candidate pair"]] : [["detected", "detected"], ["undetected", "not detected"]]), ["contact", "contact"], ["no contact", "no contact"], ["unsure", "unsure"]];
  c.font = `${12 / k}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`; c.textAlign = "left"; c.textBaseline = "middle";
  const widths = kinds.map(([, words]) => c.measureText(words).width + 34 / k), total = widths.reduce((a, b) => a + b, 0);
  let [x, y] = stage.toPhotograph(14 * stage.enlarged, stage.boxHeight - 22 * stage.enlarged);
  c.fillStyle = "#0c0e12e0"; c.beginPath(); c.roundRect(x - 6 / k, y - 13 / k, total + 6 / k, 26 / k, 8 / k); c.fill();
  kinds.forEach(([kind, words], n) => {
    drawMark(c, k, { point: [x + 9 / k, y], normal: [1, 0] }, 24 / k, kind);
    c.fillStyle = "#e9ebf0"; c.fillText(words, x + 20 / k, y);
    x += widths[n];
  });
  c.textBaseline = "alphabetic";
}
