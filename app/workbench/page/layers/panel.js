// The list of layers in the corner of the picture: what is shown, how strongly, in which colours and range.

import { at, digits, h } from "/page/dom.js";
import { MAPS } from "/page/layers/colours.js";
import { COLOURINGS } from "/page/layers/network.js";
import { CONTACTS, SINCE, VALUES } from "/page/layers/rods.js";
import { isChanged, layers, resetLayers, setLayer } from "/page/layers/settings.js";

const NAMES = { photograph: "photograph", mask: "mask", walls: "walls", rods: "rods", forces: "forces", contacts: "contacts", uncertainty: "uncertainty", displacement: "displacement", strain: "strain and load", marks: "marks and selection" };
const LIGHT = [["brightness", 0.2, 5, 0.05], ["contrast", 0.2, 8, 0.05], ["gamma", 0.2, 4, 0.05]];
const named = (choices) => Object.fromEntries(Object.entries(choices).map(([name, { words }]) => [name, words]));
const CHOICES = {
  forces: { by: ["coloured by", named(COLOURINGS)] },
  contacts: { by: ["coloured by", named(CONTACTS)] },
  displacement: { by: ["of", { all: "rods", fluctuation: "rods, less the mean deformation" }], since: ["since", SINCE] },
  strain: { by: ["of rods", named(VALUES)], since: ["since", SINCE] },
};
const SCALED = ["forces", "contacts", "uncertainty", "displacement", "strain"];

const shown = { open: false, details: new Set(["photograph"]) };

/** The rows that are open now, read before the list is drawn anew: the event of a row that opens comes later than its opening. */
function noteDetails() {
  for (const row of document.querySelectorAll("#layers-panel details")) shown.details[row.open ? "add" : "delete"](row.dataset.layer);
}

/** The button in the corner of the picture, and the list that it opens. */
export function showLayers(app) {
  const names = app.step?.layers ?? ["photograph", "marks"];
  const focused = document.activeElement?.id;
  noteDetails();
  at("layers").replaceChildren(
    h("button", { id: "layers-button", class: names.some(isChanged) ? "on" : "", "aria-expanded": String(shown.open), "aria-controls": "layers-panel", title: "Layers: brightness, colours, ranges (Y)", onclick: () => { shown.open = !shown.open; showLayers(app); } }, "Layers"),
    h("div", { id: "layers-panel", role: "group", "aria-label": "Layers", hidden: !shown.open },
      names.map((name) => row(app, name)),
      h("button", { id: "layers-reset", onclick: () => { resetLayers(names); changed(app); } }, "As at first")));
  if (focused && at("layers").contains(at(focused))) at(focused).focus({ preventScroll: true });
}

export function toggleLayers(app) { shown.open = !shown.open; showLayers(app); }

function changed(app) { showLayers(app); app.stage.redraw(); app.step.restyled?.(app); }

function row(app, name) {
  const set = (values) => { setLayer(name, values); app.stage.redraw(); }, layer = layers[name], more = details(app, name);
  return h("div", { class: "layer" },
    h("input", { type: "checkbox", id: `layer-${name}`, checked: layer.on, onchange: (event) => { setLayer(name, { on: event.target.checked }); changed(app); } }),
    h("label", { htmlFor: `layer-${name}` }, NAMES[name]),
    h("input", { type: "range", id: `opacity-${name}`, "aria-label": `opacity of ${NAMES[name]}`, title: "opacity", min: 0, max: 1, step: 0.05, value: layer.opacity, oninput: (event) => set({ opacity: Number(event.target.value) }) }),
    more.length ? h("details", { open: shown.details.has(name), "data-layer": name }, h("summary", { "aria-label": `more of ${NAMES[name]}` }, "more"), more) : null);
}

function details(app, name) {
  const layer = layers[name], set = (values) => { setLayer(name, values); changed(app); };
  const choices = Object.entries(CHOICES[name] ?? {}).map(([key, [words, options]]) => select(`${name}-${key}`, words, key === "by" && name === "strain" ? available(app, options) : options, layer[key], (value) => set({ [key]: value, ...(key === "by" ? { map: null, low: null, high: null } : {}) })));
  if (name === "photograph") return [
    LIGHT.map(([key, min, max, step]) => h("label", { class: "slider" }, h("span", {}, key), h("input", { type: "range", id: `layer-${key}`, min, max, step, value: layer[key], oninput: (event) => { setLayer(name, { [key]: Number(event.target.value) }); app.stage.request(); } }))),
    h("button", { id: "layer-stretch", title: "the darkest and the brightest hundredth become black and white", onclick: () => set(app.stage.picture.stretched()) }, "Stretch"),
  ];
  if (name === "displacement") choices.push(number(app, name, "times", "enlarged", "by itself", (value) => (value === null ? 0 : value)));
  if (SCALED.includes(name)) choices.push(
    select(`${name}-map`, "colours", { "": "its own", ...MAPS }, layer.map ?? "", (value) => set({ map: value || null })),
    h("div", { class: "range" }, number(app, name, "low", "from", "auto"), number(app, name, "high", "to", "auto")));
  return choices;
}

/** The values of rods that this run has. */
const available = (app, options) => Object.fromEntries(Object.entries(options).filter(([value]) => !VALUES[value].needs || app.step.has?.(VALUES[value].needs)));

function select(id, words, options, value, onvalue) {
  return h("label", { class: "choice" }, h("span", {}, words), h("select", { id: `layer-${id}`, onchange: (event) => onvalue(event.target.value) }, Object.entries(options).map(([name, text]) => h("option", { value: name, selected: name === value }, text))));
}

/** A number of a layer's settings; an empty field is the default. */
function number(app, name, key, words, placeholder, of = (value) => value) {
  const value = layers[name][key];
  return h("label", { class: "choice" }, h("span", {}, words), h("input", { type: "text", inputMode: "decimal", id: `layer-${name}-${key}`, placeholder, value: value === null || value === 0 ? "" : digits(value, 6), onkeydown: (event) => event.key === "Enter" && event.target.blur(),
    onchange: (event) => {
      const text = event.target.value.trim().replace(",", "."), typed = Number(text);
      if (text !== "" && !Number.isFinite(typed)) { app.notify(`${words}: ${text} is not a number`, true); return; }
      setLayer(name, { [key]: of(text === "" ? null : typed) });
      changed(app);
    } }));
}
