// Layers over the photograph: which are shown, how strongly, in which colours and range; kept in this browser.

const KEPT = "layers of the picture";
const SCALED = { map: null, low: null, high: null }; // a colour map and a range; null: those of the quantity

const DEFAULTS = {
  photograph: { on: true, opacity: 1, brightness: 1, contrast: 1, gamma: 1 },
  mask: { on: true, opacity: 1 },
  strain: { on: false, opacity: 0.75, by: "shear", since: "window", ...SCALED },
  walls: { on: true, opacity: 1 },
  rods: { on: true, opacity: 1 },
  displacement: { on: false, opacity: 1, by: "all", since: "window", times: 0, ...SCALED },
  forces: { on: true, opacity: 1, by: "fn", ...SCALED },
  uncertainty: { on: false, opacity: 1, ...SCALED },
  contacts: { on: false, opacity: 1, by: "state", ...SCALED },
  marks: { on: true, opacity: 1 },
};

const copy = (values) => JSON.parse(JSON.stringify(values));

function stored() {
  try { return JSON.parse(localStorage.getItem(KEPT)) ?? {}; } catch { return {}; }
}

function merged() {
  const kept = stored(), all = copy(DEFAULTS);
  for (const [name, values] of Object.entries(all)) for (const key of Object.keys(values)) if (typeof kept[name]?.[key] === typeof values[key] || values[key] === null) values[key] = kept[name]?.[key] ?? values[key];
  return all;
}

/** The settings of every layer by its name. */
export const layers = merged();

function keep() { try { localStorage.setItem(KEPT, JSON.stringify(layers)); } catch { /* they hold until the page is left */ } }

export function setLayer(name, values) { Object.assign(layers[name], values); keep(); }

/** A layer as it is at first, or all of them. */
export function resetLayers(names = Object.keys(DEFAULTS)) { for (const name of names) layers[name] = copy(DEFAULTS[name]); keep(); }

export const isChanged = (name) => JSON.stringify(layers[name]) !== JSON.stringify(DEFAULTS[name]);

/** Draw a layer with its opacity, unless it is hidden. */
export function paintLayer(c, name, draw, strength = 1) {
  const { on, opacity } = layers[name];
  if (!on || opacity <= 0) return;
  const before = c.globalAlpha;
  c.globalAlpha = before * opacity * strength;
  draw();
  c.globalAlpha = before;
}
