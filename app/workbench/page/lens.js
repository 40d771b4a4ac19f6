// Part of step 2: the coefficients of a lens that was calibrated. One that was not is found as far as the gaps tell.

import { h, numberField, parse } from "/page/dom.js";

const MODELS = {
  opencv: { words: "OpenCV's model", asked: ["fx", "cx", "cy"], further: ["fy", "k1", "k2", "p1", "p2", "k3"], px: ["fx", "fy", "cx", "cy"] },
  brown: { words: "Brown's model", asked: ["xc", "yc"], further: ["K1", "K2", "K3", "P1", "P2", "P3"], px: ["xc", "yc"] },
};
let begun = null; // { at, model, values }: a model whose first numbers are being typed

const modelOf = (lens) => (lens ? ("xc" in lens ? "brown" : "opencv") : "none");

export function lensForm(app) {
  const { project } = app, told = project.photographs.lens ?? null;
  if (begun && begun.at !== project.at) begun = null;
  const model = begun?.model ?? modelOf(told), of = MODELS[model], values = begun?.values ?? told ?? {};
  const choose = (name) => {
    begun = name === "none" || name === modelOf(told) ? null : { at: project.at, model: name, values: {} };
    if (name === "none" && told) app.change("set_lens", { lens: null }); else app.paint();
  };
  const set = (name) => (text) => app.queue(async () => {
    const lens = { ...values };
    if (text === "") delete lens[name]; else lens[name] = parse(text, name);
    if (!of.asked.every((each) => each in lens)) { begun = { at: project.at, model, values: lens }; app.paint(); return; }
    begun = null;
    app.change("set_lens", { lens });
  });
  return [
    h("div", { class: "field" }, h("label", { htmlFor: "lens-model" }, "lens"), h("select", { id: "lens-model", onchange: (event) => choose(event.target.value) },
      [["none", "as it is found"], ...Object.entries(MODELS).map(([name, each]) => [name, each.words])].map(([value, words]) => h("option", { value, selected: value === model }, words)))),
    of ? [...of.asked, ...of.further].map((name) => numberField(name, values[name] ?? "", of.px.includes(name) ? "px" : "", set(name), { id: `lens-${name}`, placeholder: of.asked.includes(name) ? "needed" : name === "fy" ? "as fx" : "0" })) : null,
  ];
}
