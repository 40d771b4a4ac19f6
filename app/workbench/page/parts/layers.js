// Layers over the photograph: which are shown, how light and how strong; kept in this browser.

import { at, h } from "/page/dom.js";

const DEFAULTS = { photograph: true, brightness: 1, contrast: 1, dim: 1, forces: true, opacity: 1, marks: true };
const KEPT = "layers";

function stored() {
  try { return JSON.parse(localStorage.getItem(KEPT)) ?? {}; } catch { return {}; }
}

export const layers = { ...DEFAULTS, ...stored() };
const shown = { open: false };

const SLIDERS = [["brightness", "brightness", 0.3, 3], ["contrast", "contrast", 0.3, 3], ["dim", "photograph's strength", 0, 1], ["opacity", "forces' strength", 0, 1]];
const CHECKS = [["photograph", "photograph"], ["forces", "forces"], ["marks", "rods, walls and marks"]];

/** The button in the corner of the picture, and what it opens. */
export function showLayers(app) {
  const set = (name, value) => {
    layers[name] = value;
    try { localStorage.setItem(KEPT, JSON.stringify(layers)); } catch { /* it holds until the page is left */ }
    app.stage.redraw();
  };
  const changed = Object.keys(DEFAULTS).some((name) => layers[name] !== DEFAULTS[name]);
  at("layers").replaceChildren(
    h("button", { id: "layers-button", class: changed ? "on" : "", "aria-expanded": String(shown.open), "aria-controls": "layers-panel", title: "Layers, brightness and contrast (Y)", onclick: () => { shown.open = !shown.open; showLayers(app); } }, "Layers"),
    h("div", { id: "layers-panel", role: "group", "aria-label": "Layers", hidden: !shown.open },
      CHECKS.map(([name, words]) => h("label", {}, h("input", { type: "checkbox", id: `layer-${name}`, checked: layers[name], onchange: (event) => { set(name, event.target.checked); showLayers(app); } }), words)),
      SLIDERS.map(([name, words, min, max]) => h("label", {}, h("span", {}, words), h("input", { type: "range", id: `layer-${name}`, min, max, step: 0.05, value: layers[name], oninput: (event) => set(name, Number(event.target.value)) }))),
      h("button", { id: "layers-reset", onclick: () => { for (const [name, value] of Object.entries(DEFAULTS)) set(name, value); showLayers(app); } }, "As at first")));
}

export function toggleLayers(app) { shown.open = !shown.open; showLayers(app); }
