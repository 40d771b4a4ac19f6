// The open experiment, the step that is shown, and the keys that work in every step. All data are on the server.

import { context, request, at, digits, dismissRefusal, h, sign, notify } from "/page/dom.js";
import { Stage } from "/page/stage.js";
import { showHome } from "/page/home.js";
import { showLayers, toggleLayers } from "/page/layers/panel.js";
import { paintLayer } from "/page/layers/settings.js";
import { drawSetup } from "/page/layers/setup.js";
import { clearPlot, togglePlot } from "/page/time/plot.js";
import { closeSheet, isSheetOpen, sheetButton, toggleSheet } from "/page/time/sheet.js";
import { givenTracks, lacksPhotographs } from "/page/parts/given_tracks.js";
import { runMark, standing } from "/page/parts/run_state.js";
import { useForcesOf } from "/page/units.js";
import { photographs } from "/page/steps/photographs.js";
import { scale } from "/page/steps/scale.js";
import { walls } from "/page/steps/walls.js";
import { rods } from "/page/steps/rods.js";
import { material } from "/page/steps/material.js";
import { run } from "/page/steps/run.js";
import { inspect } from "/page/steps/inspect.js";
import { review } from "/page/steps/review.js";
import { correct } from "/page/steps/correct.js";
import { share } from "/page/steps/share.js";

export const STEPS = [photographs, scale, walls, rods, material, run, inspect, review, correct, share];

export const app = { stage: new Stage(), project: null, step: STEPS[0], frame: 0, busy: Promise.resolve(), done: 0, looks: 0, notify };
globalThis.workbench = app; // for tests

context.photograph = (at) => (app.project && app.project.at === at && app.project.series.names[app.frame] ? [app.frame, app.project.series.names[app.frame]] : null);

const waiting = new Set(); // actions that are not done: a second one is a double click
const PATIENCE = 250, LOOKS = 1000; // [ms]

let inner = null; // actions that the present one begins at once: they follow it, before those that wait already

/** One action after the other; an error is shown. once: name of an action that must not run twice at a time. */
app.queue = (work, words = "", once = null) => {
  if (once !== null) { if (waiting.has(once)) return app.busy; waiting.add(once); }
  const { field } = app, run = () => perform(work, words, once, field);
  if (inner) return new Promise((done) => inner.push(() => run().then(done)));
  app.busy = app.busy.then(run);
  return app.busy;
};

async function perform(work, words, once, field) {
  const following = [], outer = inner;
  app.field = field; // an action of this one belongs to the same field
  const slow = setTimeout(() => { at("busy-text").textContent = words || "One moment …"; at("busy").hidden = false; }, words ? PATIENCE : 2 * PATIENCE);
  try {
    inner = following;
    let begun;
    try { begun = work(); } finally { inner = outer; }
    await begun;
    if (field?.id === app.refused?.id) app.refused = null;
  } catch (error) {
    if (field) app.refused = { ...field, text: error.message || String(error) };
    notify(error.message || String(error), true); app.paint();
  } finally { app.field = null; clearTimeout(slow); at("busy").hidden = true; app.done += 1; waiting.delete(once); }
  for (const next of following) await next();
}

// The field that an action comes from: a refused value stays in it, with the reason below it.
app.field = null; app.refused = null;
addEventListener("change", (event) => {
  if (!event.target.id) return;
  const field = { id: event.target.id, value: event.target.value };
  app.field = field;
  setTimeout(() => { if (app.field === field) app.field = null; });
}, true);

function showRefused() {
  const { refused } = app, input = refused && at(refused.id);
  if (!input || input.type === "file") return;
  input.value = refused.value;
  input.setAttribute("aria-invalid", "true"); input.setAttribute("aria-describedby", "refused");
  input.closest(".field")?.after(h("p", { class: "refused", id: "refused", role: "alert" }, refused.text));
}

/** Change the open experiment; the answer is its new state. */
app.change = (endpoint, values = {}, words = "", then = null) => app.queue(async () => {
  const answer = await request(endpoint, { at: app.project.at, ...values });
  dismissRefusal();
  app.take(answer);
  then?.(answer);
}, words, endpoint === "undo" || endpoint === "redo" ? null : endpoint + JSON.stringify(values));

/** Load changes of other windows and programs, while this window is visible and no field has the focus. */
async function lookAround() {
  const { project } = app;
  app.looks += 1;
  if (!project || document.hidden || waiting.size || /^(INPUT|SELECT)$/.test(document.activeElement?.tagName ?? "")) return;
  const done = app.done;
  try {
    const answer = await request("stamp", { at: project.at });
    if (answer.stamp === app.project?.stamp || app.project?.at !== project.at || app.done !== done) return;
    app.queue(async () => { const fresh = await request("project", { at: project.at }); if (app.project?.at === project.at) app.take(fresh); });
  } catch { /* the server is gone or busy: the next look finds out */ }
}
setInterval(lookAround, LOOKS);

/** A server that is gone is a state of the page, until it answers again. */
async function listen() {
  let state = "";
  try {
    const answer = await fetch("/page/icon.svg", { cache: "no-store" });
    if (answer.status === 403) state = "The workbench was started again. Open the address that it printed: this page belongs to the one before.";
  } catch {
    state = "The workbench does not answer: was it stopped? Nothing is lost, every action is a file of the experiment's folder. Start rodsight open again, and open the address that it prints.";
  }
  at("lost").textContent = state;
  at("lost").hidden = !state;
  document.body.classList.toggle("lost", Boolean(state));
}
setInterval(() => { if (!document.hidden) listen(); }, 2 * LOOKS);
addEventListener("unanswered", listen);

/** The state of the experiment after an action that does not answer with it, so that its undo is known. */
app.refresh = async () => { hold(await request("project", { at: app.project.at })); };

/** Make this the experiment that all steps show. */
function hold(project) {
  app.project = project;
  useForcesOf(project);
}

app.take = (project) => {
  hold(project);
  app.frame = Math.min(app.frame, Math.max(project.frames - 1, 0));
  if (!lacksPhotographs(app)) app.step.taken?.(app);
  app.paint();
};

app.goTo = (name) => app.go(STEPS.find((each) => each.name === name));

app.open = (project, step = null) => {
  document.body.classList.remove("at-home");
  if (project.at !== app.project?.at) { app.stage.clear(); clearPlot(); }
  at("home").hidden = true;
  app.frame = 0; app.looked = 0;
  hold(project);
  const first = STEPS.find((each) => markOf(each) !== "good" && project.steps.some((s) => s.name === each.name));
  app.go(STEPS.find((each) => each.name === step) ?? first ?? STEPS[0]);
};

/** A step shows the photograph that it edits; the others show the one that was looked at last. */
app.edits = (step = app.step) => (step.edits === undefined ? null : Math.min(step.edits, Math.max(app.project.frames - 1, 0)));

app.go = (step) => {
  app.step.leave?.(app);
  app.refused = null; dismissRefusal();
  if (app.edits() === null) app.looked = app.frame;
  app.step = step;
  app.frame = app.edits() ?? Math.min(app.looked ?? 0, Math.max(app.project.frames - 1, 0));
  location.hash = new URLSearchParams({ at: app.project.at, step: step.name }).toString();
  closeSheet(app);
  showLayers(app);
  if (!lacksPhotographs(app)) step.enter?.(app);
  app.stage.use(lacksPhotographs(app) ? null : step.tool?.(app));
  app.paint();
};

app.tool = (tool) => app.stage.use(tool);

app.home = () => {
  app.step.leave?.(app);
  app.project = null;
  app.stage.draw = app.stage.fixed = () => {}; app.stage.waits = () => false; // the drawing of a step needs its project
  if (location.hash) location.hash = "";
  document.body.classList.add("at-home");
  for (const id of ["steps", "panel", "time"]) at(id).replaceChildren();
  at("crumb").replaceChildren(); at("standing").replaceChildren();
  for (const id of ["undo", "redo"]) at(id).hidden = true;
  showHome(app);
};

app.hint = (text) => { at("hint").textContent = text ?? ""; };

/** Which photograph is shown; they are counted from 0. */
app.place = () => `${app.project.files.length ? "photograph" : "frame"} ${app.frame} (0 to ${Math.max(app.project.frames - 1, 0)})`;

app.photograph = (frame) => {
  const { project } = app;
  if (!project.files.length) return "";
  const { channel = "grey", rotation = 0 } = project.photographs; // a photograph that is kept belongs to its file, as it is used
  return `/photograph?${new URLSearchParams({ at: project.at, frame, channel, rotation, file: project.series.names[frame] ?? "" })}`;
};

function markOf(step) {
  if (step.mark) return step.mark(app);
  return app.project.steps.find((each) => each.name === step.name)?.mark ?? "missing";
}

const CONTROLS = "button, input, select, summary, a[href]";

let typing = null; // the field whose text is not yet given to the server
addEventListener("input", (event) => { typing = event.target; });
addEventListener("change", () => { typing = null; });

/** The control that has the focus keeps it when its part of the page is made anew: by its name, else by its place. */
function rememberFocus() {
  const had = document.activeElement, part = had?.closest?.("#panel, #steps");
  if (!part) return () => {};
  const { id } = had, place = [...part.querySelectorAll(CONTROLS)].indexOf(had);
  const text = typing === had && had.type === "text" ? had.value : null, selected = had.type === "text" ? [had.selectionStart, had.selectionEnd] : null;
  typing = null; // a field that is taken away is not left by a person
  return () => {
    if (part.contains(document.activeElement)) return;
    const again = (id && at(id)) || part.querySelectorAll(CONTROLS)[place];
    if (!again || !part.contains(again)) return;
    again.focus({ preventScroll: true });
    if (!selected || again.type !== "text") return;
    if (text !== null) { // what a person is typing stays, and is given to the server as if the field had not been made anew
      again.value = text; typing = again;
      again.addEventListener("blur", () => { if (typing === again) again.dispatchEvent(new Event("change", { bubbles: true })); }, { once: true });
    }
    again.setSelectionRange(...selected);
  };
}

app.paint = () => {
  const { project, step } = app;
  if (!project) return;
  document.title = `${project.name} · Rodsight`;
  at("crumb").replaceChildren("· ", h("b", {}, project.name));
  for (const [id, change] of [["undo", project.undo], ["redo", project.redo]]) {
    at(id).hidden = false; at(id).disabled = !change;
    at(id).title = change ? `${id === "undo" ? "Undo" : "Redo"}: ${change}` : `There is no change to ${id}`;
  }
  at("standing").textContent = standing(project);
  const focused = rememberFocus();
  at("canvas").setAttribute("aria-label", `${app.place()}, step ${step.title}. K: a cursor for the keyboard`);
  at("steps").replaceChildren(...STEPS.map((each, k) => h("button", {
    class: each === step ? "here" : "", "aria-current": each === step ? "step" : null, onclick: () => app.go(each), title: `Key ${(k + 1) % 10}`, id: `step-${each.name}`,
  }, h("span", { class: "number" }, String((k + 1) % 10)), each.title, sign(markOf(each)))));
  const entry = project.steps.find((each) => each.name === step.name) ?? (step.ofRun ? { mark: runMark(app), messages: project.run?.faults ?? [] } : null);
  const top = at("panel").scrollTop;
  at("panel").replaceChildren(h("h1", {}, step.title), ...(entry?.messages.length ? [h("div", { class: "messages" }, entry.messages.map((text) => h("p", {}, sign(entry.mark), text)))] : []), ...[lacksPhotographs(app) ? givenTracks(app) : step.panel(app)].flat(9).filter(Boolean));
  showRefused();
  at("panel").scrollTop = top;
  focused();
  const edited = app.edits(), hint = lacksPhotographs(app) ? "" : step.hint?.(app) ?? "";
  app.hint(edited === null || project.tracked ? hint : [`Photograph ${edited}`, hint].filter(Boolean).join(" · "));
  app.stage.draw = (c, k) => { if (step.below) drawSetup(app, c, k, step.below); if (step.layered) step.draw?.(app, c, k); else if (!lacksPhotographs(app)) paintLayer(c, "marks", () => step.draw?.(app, c, k)); };
  app.stage.waits = () => Boolean(step.waits?.(app));
  app.stage.fixed = (c, k) => (lacksPhotographs(app) ? null : step.legend?.(app, c, k)); // stays where it is when the picture is moved
  app.stage.dim = step.dim ?? 1;
  const beside = app.step.frames || app.step.timeline ? [app.frame + 1, app.frame - 1].filter((each) => project.files[each]) : [];
  app.stage.show(app.photograph(app.frame), project.width, project.height, beside.map(app.photograph), project.bounds);
  app.timeline();
};

app.timeline = () => {
  const { project } = app, count = project.frames;
  at("time").classList.toggle("shown", count > 1 && Boolean(app.step.frames) && !lacksPhotographs(app));
  if (lacksPhotographs(app)) return;
  if (app.step.timeline && count > 1) { app.step.timeline(app); return; }
  if (!app.step.frames || count < 2) return;
  const interval = project.photographs.interval;
  const slider = h("input", { type: "range", min: 0, max: count - 1, value: app.frame, id: "frame-slider", style: { flex: "1" }, "aria-label": "Photograph", oninput: (event) => app.show(Number(event.target.value)) });
  if (document.activeElement?.id !== "frame-slider" || !at("frame-slider")) {
    at("time").replaceChildren(
      h("div", { class: "row lead" }, h("button", { class: "quiet", onclick: () => app.show(app.frame - 1), title: "←", "aria-label": "before" }, "◂"), h("button", { class: "quiet", onclick: () => app.show(app.frame + 1), title: "→", "aria-label": "next" }, "▸"), h("span", { class: "frame", id: "frame-name" })),
      slider, h("div", { class: "row tools" }, h("span", { class: "soft", id: "frame-file" }), sheetButton(app, null, null)));
  }
  at("frame-name").textContent = app.place();
  const number = project.series.number, passed = interval ? digits(interval * ((number[app.frame] ?? app.frame) - (number[0] ?? 0)), 4) : "";
  at("frame-file").textContent = [project.files[app.frame], passed && `${passed} s`].filter(Boolean).join(" · ");
};

app.show = (frame) => {
  if (app.edits() !== null) { if (frame !== app.frame) notify(`This step edits photograph ${app.frame}: the others are in step 1`); return; }
  const last = app.project.frames - 1, next = Math.min(Math.max(frame, 0), last);
  if (next === app.frame) return;
  app.frame = next;
  if (!lacksPhotographs(app)) app.step.moved?.(app);
  app.paint();
};

export const KEYS = [
  ["1 … 9, 0", "the steps"], ["wheel, + −", "zoom"], ["drag; Alt+drag over things", "move the picture"], ["F", "whole picture"], ["L", "loupe"], ["K", "a cursor for the keyboard: arrows move it (Shift: finely), Enter presses, Enter again lets go or clicks, Esc ends"], ["Y", "layers, brightness, contrast"], ["two fingers", "move the picture on a touchpad; pinch to zoom"],
  ["← →", "photographs"], ["P", "values over the photographs, below the time line"], ["A", "all photographs beside one another, or the chosen rod or contact in all of them"], ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["Esc", "deselect"], ["?", "these keys"],
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
    app.undo(event.shiftKey ? "redo" : "undo");
    return;
  }
  if (typing || event.ctrlKey || event.metaKey) return;
  if (event.key === "?") { showKeys(); return; }
  if (!app.project) return;
  if (event.target === app.stage.canvas || event.target === document.body) {
    if (event.key === "k" && !app.step.digits) { event.preventDefault(); app.stage.toggleCursor(); return; }
    if (app.stage.cursorKey(event)) { event.preventDefault(); return; }
  }
  if (event.key === "Escape" && isSheetOpen()) { closeSheet(app); app.stage.canvas.focus(); return; }
  const number = "1234567890".indexOf(event.key);
  if (number >= 0 && number < STEPS.length && !app.step.digits?.includes(event.key)) { app.go(STEPS[number]); return; }
  if (!lacksPhotographs(app) && app.step.key?.(app, event)) { event.preventDefault(); return; }
  const keys = { y: () => toggleLayers(app), f: () => app.stage.fit(), F: () => app.stage.fit(), l: () => { app.stage.loupe = !app.stage.loupe; app.stage.redraw(); }, "+": () => app.stage.zoom(1.3), "=": () => app.stage.zoom(1.3), "-": () => app.stage.zoom(1 / 1.3), ArrowLeft: () => app.show(app.frame - 1), ArrowRight: () => app.show(app.frame + 1), p: () => togglePlot(app), a: () => toggleSheet(app) };
  if (app.edits() !== null || !at("time").classList.contains("shown")) { delete keys.p; delete keys.a; } // there is no time line
  if (keys[event.key] && event.target.type !== "range") { event.preventDefault(); keys[event.key](); }
});

/** Undo the last action, whatever step it was in, or repeat it; a step shows the photograph and pair of a verdict. */
app.undo = (which = "undo") => app.queue(async () => { // what was typed before it is done first
  if (!app.project?.[which]) { notify(`There is no action to ${which}`); return; }
  const answer = await request(which, { at: app.project.at });
  app.take(answer);
  notify(`${which === "undo" ? "Undone" : "Redone"}: ${answer.undone ?? answer.redone}`);
  if (answer.verdict) app.step.reverted?.(app, answer.verdict);
});

at("brand").addEventListener("click", app.home);
at("undo").addEventListener("click", () => app.undo("undo"));
at("redo").addEventListener("click", () => app.undo("redo"));
at("help").addEventListener("click", showKeys);
matchMedia("(prefers-color-scheme: light)").addEventListener("change", app.paint);

app.queue(async () => {
  const wanted = new URLSearchParams(location.hash.slice(1));
  if (!wanted.get("at")) { app.home(); return; }
  try { app.open(await request("project", { at: wanted.get("at") }), wanted.get("step")); } catch (error) { notify(error.message, true); app.home(); }
});

// Back and Forward of the browser are steps; the first page and other experiments are among them.
addEventListener("hashchange", () => {
  const wanted = new URLSearchParams(location.hash.slice(1)), place = wanted.get("at"), name = wanted.get("step");
  if (!place) { if (app.project) app.home(); return; }
  if (app.project?.at === place) { if (name !== app.step.name && STEPS.some((each) => each.name === name)) app.goTo(name); return; }
  app.queue(async () => app.open(await request("project", { at: place }), name));
});
