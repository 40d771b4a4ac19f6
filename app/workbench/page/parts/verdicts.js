// Verdicts on pairs, shared by the steps Inspect and Review: names, colours, marks, and the verdicts already given.

import { digits, fact, h, notify, request } from "/page/dom.js";
import { force as inUnit } from "/page/units.js";

export const VERDICTS = { c: "contact", n: "no contact", u: "unsure" };
// Verdicts differ in shape as well as colour. Okabe and Ito's colours, brighter for a dark ground.
export const COLOURS = { detected: "#5cbeff", undetected: "#ffb020", hidden: "#d0d4dc", contact: "#28e096", "no contact": "#ff5482", unsure: "#f6e854" };
const RING = 0.24; // [mean radius] of a mark

/** The reviewer, and this reviewer's verdicts in all photographs with the forces before and after. */
export const verdicts = { reviewer: null, given: null };

export async function loadReviewer() { verdicts.reviewer ??= (await request("reviewer")).name; }

export async function loadGiven(app) { verdicts.given = await request("reviewed_pairs", { at: app.project.at, reviewer: verdicts.reviewer || "reviewer" }); }

/** The reviewer and settings of a request; frame: the photograph. */
export const viewOf = (frame, { order = "influence", blind = false } = {}) => ({ reviewer: verdicts.reviewer || "reviewer", frame, order, blind });

/** Verdicts carry a name: without one the field is focused and nothing is sent. */
export function hasReviewer() {
  if (verdicts.reviewer) return true;
  document.getElementById("reviewer")?.focus();
  notify("Give your name first: every verdict carries it", true);
  return false;
}

export const reviewerField = (onchange) => h("div", { class: "field" }, h("label", { htmlFor: "reviewer" }, "reviewer"), h("input", { id: "reviewer", value: verdicts.reviewer ?? "", placeholder: "your name", maxLength: 60, autocomplete: "off", spellcheck: false,
  onkeydown: (event) => event.key === "Enter" && event.target.blur(),
  onchange: (event) => { verdicts.reviewer = event.target.value.trim(); onchange(); } }));

export const bodyName = (body) => (typeof body === "number" ? `rod ${body}` : `wall ${body}`);
export const pairName = (pair) => (typeof pair.j === "number" ? `rods ${pair.i} – ${pair.j}` : `rod ${pair.i} – ${pair.j}`);
export const samePair = (a, b) => a.i === b.i && a.j === b.j;
export const swatch = (verdict) => h("span", { class: "swatch", style: { background: COLOURS[verdict] } });

/** A mark of a pair: ring; with a bond along the normal for a contact, a bar across it for no contact, a dot for unsure. */
export function drawMark(c, k, pair, radius, kind) {
  const r = Math.max(RING * radius, 5 / k), wide = Math.max((kind === "undetected" ? 0.03 : 0.05) * radius, 1.4 / k), [x, y] = pair.point;
  const path = new Path2D();
  path.arc(x, y, r, 0, 2 * Math.PI);
  const [nx, ny] = kind === "contact" ? pair.normal : kind === "no contact" ? [-pair.normal[1], pair.normal[0]] : [0, 0];
  if (nx || ny) { path.moveTo(x - nx * r, y - ny * r); path.lineTo(x + nx * r, y + ny * r); }
  c.strokeStyle = "#000a"; c.lineWidth = wide + 2 / k; c.stroke(path);
  c.strokeStyle = COLOURS[kind]; c.lineWidth = wide; c.stroke(path);
  if (kind === "unsure") { c.fillStyle = COLOURS[kind]; c.beginPath(); c.arc(x, y, 0.4 * r, 0, 2 * Math.PI); c.fill(); } // as yellow as undetected for some
}

/** The selected pair: its bodies, and a ring around its point. */
export function drawSelected(c, k, point, circles, radius) {
  const path = new Path2D();
  for (const [x, y, r] of circles) { path.moveTo(x + r, y); path.arc(x, y, r, 0, 2 * Math.PI); }
  if (point) { const r = Math.max(0.4 * radius, 9 / k); path.moveTo(point[0] + r, point[1]); path.arc(...point, r, 0, 2 * Math.PI); }
  c.lineWidth = 4.2 / k; c.strokeStyle = "#000b"; c.stroke(path);
  c.lineWidth = 2.1 / k; c.strokeStyle = "#fff"; c.stroke(path);
}

const force = (value) => (value === null ? "none" : inUnit(value));

/** The forces of a judged pair: before the verdict, and since a run has applied it. */
export function beforeAfter(frame, pair) {
  const word = verdicts.given?.pairs.find((each) => each.frame === frame && samePair(each, pair));
  if (!word?.before) return null;
  return h("div", { class: "card", id: "before-after" }, h("div", { class: "fact" }, h("span", {}, word.applied ? "applied by the run: before → after" : "before the verdict"), word.applied ? h("span", { class: "sign good" }, "✓") : null),
    word.applied ? [fact("f_n", `${force(word.before.fn)} → ${force(word.now.fn)}`), fact("f_t", `${force(word.before.ft)} → ${force(word.now.ft)}`)]
      : [fact("f_n", force(word.before.fn)), h("p", {}, "The next run applies the verdict; the new force is shown here.")]);
}

/** The reviewer's verdicts in all photographs, with the forces before and after; a click shows the pair. */
export function givenSection(app, show) {
  const { given } = verdicts;
  if (!given?.pairs.length) return null;
  return [h("h2", {}, "Your verdicts"),
    given.waiting ? h("div", { class: "messages" }, h("p", { id: "verdicts-wait" }, h("span", { class: "sign doubtful" }, "!"), `${given.waiting === 1 ? "One verdict waits" : `${given.waiting} verdicts wait`} for the next run.`)) : null,
    given.waiting ? h("button", { onclick: () => app.goTo("run") }, "To the run") : null,
    h("div", { class: "list", id: "judged" }, given.pairs.slice(0, 40).map((each) => h("button", { onclick: () => show(each) },
      h("span", { class: "two" }, h("span", {}, `photograph ${each.frame} · ${pairName(each)}`), h("span", { class: "soft" }, each.before ? `${each.verdict}: f_n ${force(each.before.fn)} → ${each.applied ? force(each.now.fn) : "next run"}` : each.verdict)),
      swatch(each.verdict))))];
}
