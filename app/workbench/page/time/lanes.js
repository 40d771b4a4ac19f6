// The time line below the photograph: status, trust and friction angle of every frame, lost rods; a click goes there.

import { at, colour, digits, h } from "/page/dom.js";
import { verdicts } from "/page/parts/verdicts.js";
import { TONES, begin, dragFrames } from "/page/time/strip.js";
import { drawPlot, plotRow, timeTools } from "/page/time/plot.js";
import { sheetButton } from "/page/time/sheet.js";

/** The time line of a run; chosen: { kind, name, data } of the contact or rod whose values can be plotted below it. */
export function showLanes(app, facts, chosen = null) {
  const count = app.project.frames;
  at("time").classList.add("shown");
  const canvas = lane(app, count, "colours: status; bars: trust; line: friction angle; dots: lost rods", (k) => wordsOf(facts, k));
  const status = facts?.status[app.frame];
  const words = facts && app.frame >= facts.first && app.frame < facts.count
    ? [h("i", { class: "swatch", style: { background: TONES[status] ?? "#888", display: "inline-block" } }), h("b", {}, ` ${status}`), ` · T ${digits(facts.trust[app.frame], 2)} · φ ${digits(facts.friction_angle[app.frame], 3)}°`]
    : ["not solved yet"];
  showTime(lead(app, count, words), canvas, h("div", { class: "row tools" }, flagControls(app, facts), timeTools(app, facts, chosen)), plotRow(app, facts, chosen));
  requestAnimationFrame(() => { draw(app, canvas, facts, count); drawPlot(app, facts, chosen, canvas); });
}

/** The rows of the time line: controls, the strip, tools; a plot below. */
function showTime(first, strip, tools, below = []) {
  const had = document.activeElement, id = at("time").contains(had) ? had.id : "";
  at("time").replaceChildren(first, strip, tools, ...below);
  if (id) at(id)?.focus({ preventScroll: true });
}

function lead(app, count, words) {
  return h("div", { class: "row lead" }, arrows(app), h("div", { class: "frame" }, h("div", {}, app.place()), h("div", { class: "soft", style: { fontSize: "12.5px" } }, words)));
}

/** Lost and uncertain rods of every tracked photograph, and the corrections. */
export function showLost(app, poses) {
  const count = app.project.frames, here = poses && app.frame < poses.lost_count.length;
  const canvas = lane(app, count, "red: lost rods; yellow: uncertain; green dots: corrected", (k) => (poses && k < poses.lost_count.length ? `${poses.lost_count[k]} lost, ${poses.uncertain_count[k]} uncertain` : ""));
  showTime(lead(app, count, here ? `${poses.lost_count[app.frame]} lost · ${poses.uncertain_count[app.frame]} uncertain` : ""), canvas, h("div", { class: "row tools" }, sheetButton(app, null, null)));
  requestAnimationFrame(() => {
    const { c, step, height } = begin(canvas, count);
    const most = Math.max(1, ...(poses?.lost_count ?? []).map((lost, k) => lost + poses.uncertain_count[k]));
    (poses?.lost_count ?? []).forEach((lost, k) => {
      let low = height - 2;
      for (const [number, style] of [[lost, TONES.suspect], [poses.uncertain_count[k], "#f0e442"]]) {
        const tall = number ? Math.max(3, number / most * (height - 14)) : 0;
        c.fillStyle = style; c.fillRect(k * step + 0.5, low - tall, Math.max(step - 1, 1), tall); low -= tall;
      }
    });
    for (const each of poses?.corrections ?? []) { c.fillStyle = colour("good"); c.beginPath(); c.arc((each.frame + 0.5) * step, 7, 3.5, 0, 7); c.fill(); }
    c.strokeStyle = colour("ink"); c.lineWidth = 2; c.strokeRect(app.frame * step + 1, 1, Math.max(step - 2, 2), height - 2);
  });
}

// Flags of photographs: by status, by lost rods, by verdicts.
const FLAGS = {
  any: ["flags", (facts, k) => ["suspect", "failed", "rearranging"].includes(facts.status[k]) || facts.lost[k] > 0],
  suspect: ["suspect", (facts, k) => facts.status[k] === "suspect"], failed: ["failed", (facts, k) => facts.status[k] === "failed"],
  rearranging: ["rearranging", (facts, k) => facts.status[k] === "rearranging"], reset: ["reset", (facts, k) => facts.status[k] === "reset"],
  lost: ["lost rods", (facts, k) => facts.lost[k] > 0], judged: ["verdicts", (facts, k) => Boolean(verdicts.given?.pairs.some((each) => each.frame === k))],
};
const wanted = { flag: "any" };

/** To the next photograph with the chosen flag, or to the one before. */
export function jump(app, facts, by = 1) {
  if (!facts) return;
  const [words, has] = FLAGS[wanted.flag], { first, count } = facts, long = count - first;
  for (let k = 1; k <= long; k += 1) { const next = first + ((app.frame - first + by * k) % long + long) % long; if (has(facts, next)) { app.show(next); return; } }
  app.notify(wanted.flag === "any" ? "No frame is flagged" : `No photograph: ${words}`);
}

function flagControls(app, facts) {
  return [
    h("button", { class: "quiet", id: "flag-before", "aria-label": "to the flag before", title: "Shift+J", onclick: () => jump(app, facts, -1) }, "◂"),
    h("select", { id: "flag-kind", "aria-label": "flags to jump to", onchange: (event) => { wanted.flag = event.target.value; jump(app, facts); } }, Object.entries(FLAGS).map(([name, [words]]) => h("option", { value: name, selected: name === wanted.flag }, words))),
    h("button", { class: "quiet", id: "flag-next", "aria-label": "to the next flag", title: "J", onclick: () => jump(app, facts) }, "▸"),
  ];
}

function draw(app, canvas, facts, count) {
  const { c, step, height } = begin(canvas, count);
  for (let k = facts?.first ?? 0; k < (facts?.count ?? 0); k += 1) {
    c.fillStyle = TONES[facts.status[k]] ?? "#888"; c.fillRect(k * step + 0.5, 0, Math.max(step - 1, 1), 9);
    const trust = facts.trust[k];
    if (trust !== null) { c.globalAlpha = 0.5; c.fillStyle = colour("accent"); c.fillRect(k * step + 0.5, height - trust * (height - 13), Math.max(step - 1, 1), trust * (height - 13)); c.globalAlpha = 1; }
    if (facts.lost[k] > 0) { c.fillStyle = "#f0e442"; c.beginPath(); c.arc((k + 0.5) * step, 14, 3, 0, 7); c.fill(); }
  }
  if (facts?.count > 1) {
    const angles = facts.friction_angle.filter((v) => v !== null), first = facts.friction_angle.findIndex((v) => v !== null), top = Math.max(...angles) * 1.1 || 1;
    c.strokeStyle = colour("ink"); c.lineWidth = 1.4; c.beginPath();
    facts.friction_angle.forEach((v, k) => { if (v === null) return; const x = (k + 0.5) * step, y = height - 3 - v / top * (height - 18); if (k > first) c.lineTo(x, y); else c.moveTo(x, y); });
    c.stroke();
  }
  c.strokeStyle = colour("ink"); c.lineWidth = 2; c.strokeRect(app.frame * step + 1, 1, Math.max(step - 2, 2), height - 2);
}

const arrows = (app) => [["◂", -1, "←"], ["▸", 1, "→"]].map(([words, by, key]) => h("button", { class: "quiet", onclick: () => app.show(app.frame + by), title: key, "aria-label": by < 0 ? "before" : "next" }, words));

/** The values of a photograph that the strip draws. */
const wordsOf = (facts, k) => (facts && k >= facts.first && k < facts.count ? [facts.status[k], `T ${digits(facts.trust[k], 2)}`, `φ ${digits(facts.friction_angle[k], 3)}°`, facts.lost[k] ? `${facts.lost[k]} lost` : ""].filter(Boolean).join(", ") : "");

/** An empty strip of frames; a press goes to a frame, as the arrow keys do; values: those of the frame under the mouse. */
function lane(app, count, title, values) {
  const canvas = h("canvas", { id: "lanes", title, tabIndex: 0, role: "slider", "aria-label": title, "aria-valuemin": "0", "aria-valuemax": String(count - 1), "aria-valuenow": String(app.frame), "aria-valuetext": app.place() });
  dragFrames(app, canvas, count);
  canvas.addEventListener("pointermove", (event) => {
    const { left, width } = canvas.getBoundingClientRect(), k = Math.min(Math.max(Math.floor((event.clientX - left) / width * count), 0), count - 1), words = values(k);
    canvas.title = `${words ? `${k}: ${words}\n` : ""}${title}`;
  });
  return canvas;
}
