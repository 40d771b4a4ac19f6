// What is open, which step is shown, and the keys that work everywhere. All that is known lies on the server.

import { ask, at, digits, h, sign, tell } from "/page/dom.js";
import { Stage } from "/page/stage.js";
import { showHome } from "/page/home.js";
import { photographs } from "/page/photographs.js";
import { scale } from "/page/scale.js";
import { walls } from "/page/walls.js";
import { rods } from "/page/rods.js";
import { material } from "/page/material.js";
import { run } from "/page/run.js";
import { mend } from "/page/mend.js";
import { inspect } from "/page/inspect.js";
import { share } from "/page/share.js";

export const STEPS = [photographs, scale, walls, rods, material, run, mend, inspect, share];

export const app = { stage: new Stage(), project: null, step: STEPS[0], frame: 0, busy: Promise.resolve(), done: 0, looks: 0, tell };
globalThis.bench = app; // for the curious, and for tests

const waiting = new Set(); // what has been asked for and is not done: asked again meanwhile, it is a double click
const PATIENCE = 250, LOOKS = 1000; // [ms]

/** One action after the other; what goes wrong is said. once: names an action that is not to be done twice at a time. */
app.queue = (work, words = "", once = null) => {
  if (once !== null) { if (waiting.has(once)) return app.busy; waiting.add(once); }
  app.busy = app.busy.then(async () => {
    const slow = setTimeout(() => { at("busy-text").textContent = words || "One moment …"; at("busy").hidden = false; }, words ? PATIENCE : 2 * PATIENCE);
    try { await work(); } catch (error) { tell(error.message || String(error), true); app.paint(); } finally { clearTimeout(slow); at("busy").hidden = true; app.done += 1; waiting.delete(once); }
  });
  return app.busy;
};

/** Ask for a change of the open experiment; the answer is what the experiment is then. */
app.change = (question, values = {}, words = "", then = null) => app.queue(async () => {
  const told = await ask(question, { at: app.project.at, ...values });
  app.take(told);
  then?.(told);
}, words, question === "undo" || question === "redo" ? null : question + JSON.stringify(values));

/** What another window, or another program, has changed: looked for while this one is seen, and nobody types. */
async function lookAround() {
  const { project } = app;
  app.looks += 1;
  if (!project || document.hidden || waiting.size || /^(INPUT|SELECT)$/.test(document.activeElement?.tagName ?? "")) return;
  const done = app.done;
  try {
    const told = await ask("stamp", { at: project.at });
    if (told.stamp === app.project?.stamp || app.project?.at !== project.at || app.done !== done) return;
    app.queue(async () => { const fresh = await ask("project", { at: project.at }); if (app.project?.at === project.at) app.take(fresh); });
  } catch { /* the server has gone, or is busy: the next look tells */ }
}
setInterval(lookAround, LOOKS);

app.take = (project) => {
  app.project = project;
  app.frame = Math.min(app.frame, Math.max(project.files.length - 1, 0));
  app.step.taken?.(app);
  app.paint();
};

app.goTo = (name) => app.go(STEPS.find((each) => each.name === name));

app.open = (project, step = null) => {
  at("home").hidden = true;
  app.frame = 0;
  app.project = project;
  const first = STEPS.find((each) => markOf(each) !== "good" && project.steps.some((s) => s.name === each.name));
  app.go(STEPS.find((each) => each.name === step) ?? first ?? STEPS[0]);
};

app.go = (step) => {
  app.step.leave?.(app);
  app.step = step;
  location.hash = new URLSearchParams({ at: app.project.at, step: step.name }).toString();
  step.enter?.(app);
  app.stage.use(step.tool?.(app));
  app.paint();
};

app.tool = (tool) => app.stage.use(tool);

app.home = () => {
  app.step.leave?.(app);
  app.project = null;
  app.stage.draw = () => {}; // what a step draws is drawn over a photograph of its project
  history.replaceState(null, "", location.pathname);
  at("crumb").replaceChildren(); at("standing").replaceChildren();
  for (const id of ["undo", "redo"]) at(id).hidden = true;
  showHome(app);
};

app.hint = (text) => { at("hint").textContent = text ?? ""; };

app.photograph = (frame) => {
  const { project } = app;
  if (!project.files.length) return "";
  return `/photograph?${new URLSearchParams({ at: project.at, frame, channel: project.photographs.channel ?? "grey" })}`;
};

function markOf(step) {
  if (step.mark) return step.mark(app);
  return app.project.steps.find((each) => each.name === step.name)?.mark ?? "missing";
}

app.paint = () => {
  const { project, step } = app;
  if (!project) return;
  document.title = `${project.name} · Rodsight`;
  at("crumb").replaceChildren("· ", h("b", {}, project.name));
  for (const [id, what] of [["undo", project.undo], ["redo", project.redo]]) {
    at(id).hidden = false; at(id).disabled = !what;
    at(id).title = what ? `${id === "undo" ? "Undo" : "Do again"}: ${what}` : "Nothing to undo";
  }
  at("standing").textContent = standing(project);
  at("steps").replaceChildren(...STEPS.map((each, k) => h("button", {
    class: each === step ? "here" : "", onclick: () => app.go(each), title: `Key ${k + 1}`, id: `step-${each.name}`,
  }, h("span", { class: "number" }, String(k + 1)), each.title, sign(markOf(each)))));
  const says = project.steps.find((each) => each.name === step.name);
  const keep = document.activeElement?.id;
  const top = at("panel").scrollTop;
  at("panel").replaceChildren(h("h2", {}, step.title), ...(says?.says.length ? [h("div", { class: "says" }, says.says.map((text) => h("p", {}, sign(says.mark), text)))] : []), ...[step.panel(app)].flat(9).filter(Boolean));
  at("panel").scrollTop = top;
  if (keep && at(keep) && at("panel").contains(at(keep))) at(keep).focus({ preventScroll: true });
  app.hint(step.hint?.(app) ?? "");
  app.stage.draw = (c, k) => step.draw?.(app, c, k);
  app.stage.dim = step.dim ?? 1;
  const beside = app.step.frames || app.step.timeline ? [app.frame + 1, app.frame - 1].filter((each) => project.files[each]) : [];
  app.stage.show(app.photograph(app.frame), project.width, project.height, beside.map(app.photograph));
  app.timeline();
};

app.timeline = () => {
  const { project } = app, count = project.files.length;
  at("time").classList.toggle("shown", count > 1 && Boolean(app.step.frames));
  if (app.step.timeline && count > 1) { app.step.timeline(app); return; }
  if (!app.step.frames || count < 2) return;
  const interval = project.photographs.interval;
  const slider = h("input", { type: "range", min: 0, max: count - 1, value: app.frame, id: "frame-slider", style: { flex: "1" }, "aria-label": "Photograph", oninput: (event) => app.show(Number(event.target.value)) });
  if (document.activeElement?.id !== "frame-slider" || !at("frame-slider")) {
    at("time").replaceChildren(h("button", { class: "quiet", onclick: () => app.show(app.frame - 1), title: "←" }, "◂"), h("button", { class: "quiet", onclick: () => app.show(app.frame + 1), title: "→" }, "▸"), h("span", { class: "frame", id: "frame-name" }), slider, h("span", { class: "soft", id: "frame-file" }));
  }
  at("frame-name").textContent = `photograph ${app.frame} of ${count - 1}`;
  at("frame-file").textContent = `${project.files[app.frame]}${interval ? ` · ${digits(interval * app.frame, 4)} s` : ""}`;
};

app.show = (frame) => {
  const last = app.project.files.length - 1, next = Math.min(Math.max(frame, 0), last);
  if (next === app.frame) return;
  app.frame = next;
  app.step.moved?.(app);
  app.paint();
};

function standing(project) {
  const run = project.run;
  if (!run || run.frames === undefined) return run?.unfinished ? "unfinished run" : project.ready ? "ready to run" : "being set up";
  const worst = run.trust === null ? "" : ` · T ≥ ${run.trust.toFixed(2)}`;
  return `${run.frames} frames solved${worst}`;
}

export const KEYS = [
  ["1 … 9", "the steps"], ["wheel, + −", "zoom"], ["drag; Alt+drag over things", "move the picture"], ["F", "whole picture"], ["L", "loupe"],
  ["← →", "photographs"], ["Ctrl+Z, Ctrl+Shift+Z", "undo, do again"], ["Esc", "let go"], ["?", "these keys"],
];

function showKeys() {
  const own = app.project && app.step.keyHelp ? app.step.keyHelp : [];
  at("keys").replaceChildren(h("h2", {}, "Keys"), h("table", {}, h("tbody", {}, [...KEYS, ...own].map(([key, what]) => h("tr", {}, h("td", {}, h("kbd", {}, key)), h("td", {}, what))))), h("form", { method: "dialog" }, h("button", { class: "primary" }, "Close")));
  at("keys").showModal();
}

addEventListener("keydown", (event) => {
  const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName) && event.target.type !== "range";
  if (event.target.closest?.("dialog, #recording")) return; // the viewer has keys of its own
  if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z" && app.project && !typing) {
    event.preventDefault();
    undo(event.shiftKey ? "redo" : "undo");
    return;
  }
  if (typing || event.ctrlKey || event.metaKey) return;
  if (event.key === "?") { showKeys(); return; }
  if (!app.project) return;
  const number = "123456789".indexOf(event.key);
  if (number >= 0 && number < STEPS.length && !app.step.digits) { app.go(STEPS[number]); return; }
  if (app.step.key?.(app, event)) { event.preventDefault(); return; }
  const keys = { f: () => app.stage.fit(), F: () => app.stage.fit(), l: () => { app.stage.loupe = !app.stage.loupe; app.stage.redraw(); }, "+": () => app.stage.zoom(1.3), "=": () => app.stage.zoom(1.3), "-": () => app.stage.zoom(1 / 1.3), ArrowLeft: () => app.show(app.frame - 1), ArrowRight: () => app.show(app.frame + 1) };
  if (keys[event.key] && event.target.type !== "range") { event.preventDefault(); keys[event.key](); }
});

function undo(which) {
  const what = app.project[which];
  if (what) app.change(which, {}, "", () => tell(which === "undo" ? `Undone: ${what}` : `Done again: ${what}`));
}

at("brand").addEventListener("click", app.home);
at("undo").addEventListener("click", () => undo("undo"));
at("redo").addEventListener("click", () => undo("redo"));
at("help").addEventListener("click", showKeys);
matchMedia("(prefers-color-scheme: light)").addEventListener("change", app.paint);

app.queue(async () => {
  const asked = new URLSearchParams(location.hash.slice(1));
  if (!asked.get("at")) { app.home(); return; }
  try { app.open(await ask("project", { at: asked.get("at") }), asked.get("step")); } catch (error) { tell(error.message, true); app.home(); }
});
