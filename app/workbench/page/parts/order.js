// The order of the photographs: rows are dragged, left out and used again; places in time by names or the camera's clock.

import { digits, h, notify } from "/page/dom.js";

const SHOWN = 400; // rows
let dragged = null;

export function orderSection(app) {
  const { project } = app, { series, photographs: section } = project, last = project.files.length - 1;
  const time = (k) => (section.interval ? `${digits((series.number[k] - series.number[0]) * section.interval, 4)} s` : "");
  const bad = new Set(series.unusable);
  return [
    h("h2", {}, "Order"),
    h("p", {}, section.order ? "In the order of order.csv. Drag a row to move it." : "By the numbers in their names: 2 before 10, and 0000 after 9999. Drag a row to move it."),
    h("div", { class: "row" },
      h("button", { id: "earlier", disabled: app.frame < 1, title: "Alt+←", onclick: () => shift(app, -1) }, "Earlier"),
      h("button", { id: "later", disabled: app.frame >= last, title: "Alt+→", onclick: () => shift(app, 1) }, "Later"),
      h("button", { id: "leave-out", disabled: last < 1, title: "Del: it keeps its place in time, and the others theirs", onclick: () => leaveOut(app) }, `Leave out photograph ${app.frame}`)),
    bad.size > 1 ? h("button", { id: "leave-out-unusable", onclick: () => order(app, series.names.filter((_, k) => !bad.has(k)), `${bad.size} photographs left out`) }, `Leave out all ${bad.size} that cannot be used`) : null,
    series.missing ? h("button", { id: "number-by-names", title: "Where a number is missing, two intervals pass", onclick: () => app.change("number_by_names", {}, "", () => notify("Times follow the numbers of the names")) }, "Times by the numbers of the names") : null,
    series.clock ? h("button", { id: "camera-times", title: "Order and times from the notes in the files (EXIF)", onclick: () => app.change("use_camera_times", {}, "", () => notify("Order and times are those of the camera's clock")) }, "Order and times by the camera's clock") : null,
    h("div", { class: "list", id: "order" }, project.files.slice(0, SHOWN).map((name, k) => h("button", {
      class: k === app.frame ? "here" : "", draggable: true, "aria-current": k === app.frame ? "true" : null, onclick: () => app.show(k),
      ondragstart: (event) => { dragged = k; event.dataTransfer.effectAllowed = "move"; },
      ondragover: (event) => { if (dragged !== null) event.preventDefault(); },
      ondrop: (event) => { event.preventDefault(); const from = dragged; dragged = null; if (from !== null) move(app, from, k); },
      ondragend: () => { dragged = null; },
    }, h("span", { class: "soft" }, String(k)), h("span", { style: { flex: "1" } }, bad.has(k) ? `${name}: cannot be used` : name), h("span", { class: "soft" }, time(k))))),
    series.left_out.length ? [h("h2", {}, "Left out"), h("div", { class: "list", id: "left-out" }, series.left_out.slice(0, SHOWN).map((name) => h("div", {}, h("span", { style: { flex: "1" } }, name),
      h("button", { class: "quiet", title: "At its place by name", onclick: () => useAgain(app, name) }, "use again"))))] : null,
  ];
}

const order = (app, files, change, then = null) => app.change("set_order", { files, change }, "", then);

function move(app, from, to) {
  const { names } = app.project.series;
  if (from === to || to < 0 || to >= names.length) return;
  const files = [...names];
  files.splice(to, 0, ...files.splice(from, 1));
  order(app, files, `photograph ${from} moved to ${to}`, () => app.show(to));
}

/** The photograph that is shown, so many places later. */
export const shift = (app, by) => move(app, app.frame, app.frame + by);

export function leaveOut(app) {
  const { names } = app.project.series;
  if (names.length < 2) { notify("It is the only photograph", true); return; }
  const name = names[app.frame];
  order(app, names.filter((each) => each !== name), `${name} left out`, () => notify(`Left out: ${name}. The others keep their times`));
}

/** A photograph is put back where its name belongs. */
function useAgain(app, name) {
  const { names } = app.project.series;
  const collator = new Intl.Collator("en", { numeric: true }), at = names.findIndex((each) => collator.compare(each, name) > 0);
  order(app, at < 0 ? [...names, name] : [...names.slice(0, at), name, ...names.slice(at)], `${name} used again`);
}
