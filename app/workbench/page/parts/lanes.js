// The time line below the photograph: status, trust and friction angle of every frame, lost rods; a click goes there.

import { at, colour, digits, h } from "/page/dom.js";

export const TONES = { settled: "#2fbf93", settling: "#56b4e9", rearranging: "#e69f00", suspect: "#d55e00", failed: "#b02a6f", reset: "#8a8f9a" };

export function showLanes(app, facts) {
  const count = app.project.frames;
  at("time").classList.add("shown");
  const canvas = lane(app, count, "status · trust · friction angle");
  const status = facts?.status[app.frame];
  const words = facts && app.frame >= facts.first && app.frame < facts.count
    ? [h("i", { class: "swatch", style: { background: TONES[status] ?? "#888", display: "inline-block" } }), h("b", {}, ` ${status}`), ` · T ${digits(facts.trust[app.frame], 2)} · φ ${digits(facts.friction_angle[app.frame], 3)}°`]
    : ["not solved yet"];
  at("time").replaceChildren(...arrows(app),
    h("div", { class: "frame" }, h("div", {}, `photograph ${app.frame} of ${count - 1}`), h("div", { class: "soft", style: { fontSize: "12.5px" } }, words)),
    canvas,
    h("button", { class: "quiet", title: "To the next flagged frame (J)", onclick: () => jump(app, facts) }, "next flag ▸"));
  requestAnimationFrame(() => draw(app, canvas, facts, count));
}

/** Lost and uncertain rods of every tracked photograph, and the corrections. */
export function showLost(app, poses) {
  const count = app.project.frames, here = poses && app.frame < poses.lost_count.length;
  const canvas = lane(app, count, "lost · uncertain · corrected");
  at("time").replaceChildren(...arrows(app),
    h("div", { class: "frame" }, h("div", {}, `photograph ${app.frame} of ${count - 1}`), h("div", { class: "soft", style: { fontSize: "12.5px" } }, here ? `${poses.lost_count[app.frame]} lost · ${poses.uncertain_count[app.frame]} uncertain` : "")),
    canvas);
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
    for (const each of poses?.corrections ?? []) { c.fillStyle = TONES.settled; c.beginPath(); c.arc((each.frame + 0.5) * step, 7, 3.5, 0, 7); c.fill(); }
    c.strokeStyle = colour("ink"); c.lineWidth = 2; c.strokeRect(app.frame * step + 1, 1, Math.max(step - 2, 2), height - 2);
  });
}

/** To the next frame that is suspect, failed, rearranging or has lost rods. */
export function jump(app, facts) {
  if (!facts) return;
  const flagged = facts.status.map((status, k) => ["suspect", "failed", "rearranging"].includes(status) || facts.lost[k] > 0);
  for (let k = 1; k <= facts.count; k += 1) { const next = (app.frame + k) % facts.count; if (flagged[next]) { app.show(next); return; } }
  app.notify("No frame is flagged");
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

/** An empty strip of frames; a press goes to a frame. */
function lane(app, count, title) {
  const canvas = h("canvas", { id: "lanes", title, role: "img", "aria-label": `${title}: photograph ${app.frame} of ${count - 1}` });
  const go = (event) => app.show(Math.floor((event.clientX - canvas.getBoundingClientRect().left) / canvas.clientWidth * count));
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); go(event); canvas.onpointermove = go; });
  canvas.addEventListener("pointerup", () => { canvas.onpointermove = null; });
  return canvas;
}

function begin(canvas, count) {
  const dense = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight, c = canvas.getContext("2d");
  canvas.width = width * dense; canvas.height = height * dense;
  c.scale(dense, dense);
  c.fillStyle = colour("ground"); c.fillRect(0, 0, width, height);
  return { c, step: width / count, height };
}
