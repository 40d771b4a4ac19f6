// Part of step 2: the coefficients of a calibrated lens. Otherwise the distortion is estimated from the gaps.

import { h, numberField, parse } from "/page/dom.js";

const MODELS = {
  opencv: { words: "OpenCV's model", required: ["fx", "cx", "cy"], further: ["fy", "k1", "k2", "p1", "p2", "k3"], px: ["fx", "fy", "cx", "cy"] },
  brown: { words: "Brown's model", required: ["xc", "yc"], further: ["K1", "K2", "K3", "P1", "P2", "P3"], px: ["xc", "yc"] },
};
let begun = null; // { at, model, values }: a model whose first numbers are being typed

const modelOf = (lens) => (lens ? ("xc" in lens ? "brown" : "opencv") : "none");

export function lensForm(app) {
  const { project } = app, given = project.photographs.lens ?? null;
  if (begun && begun.at !== project.at) begun = null;
  const model = begun?.model ?? modelOf(given), of = MODELS[model], values = begun?.values ?? given ?? {};
  const choose = (name) => {
    begun = name === "none" || name === modelOf(given) ? null : { at: project.at, model: name, values: {} };
    if (name === "none" && given) app.change("set_lens", { lens: null }); else app.paint();
  };
  const set = (name) => (text) => app.queue(async () => {
    const lens = { ...values };
    if (text === "") delete lens[name]; else lens[name] = parse(text, name);
    if (!of.required.every((each) => each in lens)) { begun = { at: project.at, model, values: lens }; app.paint(); return; }
    begun = null;
    app.change("set_lens", { lens });
  });
  return [
    h("div", { class: "field" }, h("label", { htmlFor: "lens-model" }, "lens"), h("select", { id: "lens-model", onchange: (event) => choose(event.target.value) },
      [["none", "estimated"], ...Object.entries(MODELS).map(([name, each]) => [name, each.words])].map(([value, words]) => h("option", { value, selected: value === model }, words)))),
    of ? [...of.required, ...of.further].map((name) => numberField(name, values[name] ?? "", of.px.includes(name) ? "px" : "", set(name), { id: `lens-${name}`, placeholder: of.required.includes(name) ? "needed" : name === "fy" ? "as fx" : "0" })) : null,
  ];
}
