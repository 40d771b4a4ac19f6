// The units of the page; the files hold metres and pascals. The choice is stored in this browser.

import { digits, h, parse } from "/page/dom.js";

const KINDS = {
  length: { mm: 1e-3, "µm": 1e-6, cm: 1e-2, m: 1, in: 0.0254 },
  pressure: { kPa: 1e3, Pa: 1, MPa: 1e6, psi: 6894.757293168361 },
};
const chosen = {};
for (const kind of Object.keys(KINDS)) {
  let stored = null;
  try { stored = localStorage.getItem(`unit ${kind}`); } catch { /* a browser that keeps nothing */ }
  chosen[kind] = Object.hasOwn(KINDS[kind], stored ?? "") ? stored : Object.keys(KINDS[kind])[0];
}

/** What one of the chosen unit is in SI. */
export const siOf = (kind) => KINDS[kind][chosen[kind]];

export const unit = (kind) => chosen[kind];
/** A number of the chosen unit, without its name, of a value in SI. */
export const within = (kind, value, count = 4) => digits(value / siOf(kind), count);
/** The same with its name. */
export const measured = (kind, value, count = 4) => `${within(kind, value, count)} ${chosen[kind]}`;
/** What a person typed, in SI; twelve digits, so that 0.1 mm is not 0.00010000000000000002 m. */
export const typed = (kind, text, what) => Number((parse(text, what) * siOf(kind)).toPrecision(12));

let forces = "N";
/** The unit of the forces of the run: arbitrary where neither a load nor the weight sets their scale. */
export const useForcesOf = (project) => { forces = project?.run?.force_unit ?? "N"; };
/** The unit that is shown for a unit of a quantity. */
export const shown = (unit) => (unit === "N" ? forces : unit);
export const force = (value, count = 3) => `${digits(value, count)} ${forces}`;

export function choice(kind, app) {
  return h("div", { class: "field" }, h("label", { htmlFor: `unit-${kind}` }, `${kind}s in`), h("select", { id: `unit-${kind}`, onchange: (event) => {
    chosen[kind] = event.target.value;
    try { localStorage.setItem(`unit ${kind}`, chosen[kind]); } catch { /* it holds until the page is left */ }
    app.step.enter?.(app);
    app.paint();
  } }, Object.keys(KINDS[kind]).map((name) => h("option", { value: name, selected: name === chosen[kind] }, name))));
}
