// Step 5: material of the rods, friction, gravity.

import { request, digits, fact, h, numberField, parse } from "/page/dom.js";
import { measured as measuredAs, typed as lengthOf, unit, within } from "/page/units.js";

let presets = null;
const ASSUMED = { density: 2700, length: 0.06, friction: 0.25 };

export const material = {
  name: "material", title: "Material", edits: 0,
  layers: ["photograph", "mask", "walls", "rods", "marks"], below: ["mask", "rods", "walls"],
  enter: (app) => { if (!presets) app.queue(async () => { presets = await request("materials"); app.paint(); }); },
  panel(app) {
    const given = app.project.material, value = (name) => given[name] ?? ASSUMED[name];
    const set = (values) => app.change("set_material", values);
    const typed = (name) => (text) => app.queue(async () => { set({ [name]: parse(text, name) }); });
    const measured = given.friction === "measured";
    return [
      h("p", {}, "Choose the material of the rods, then enter the values that you have measured."),
      h("div", { class: "chips" }, Object.entries(presets ?? {}).map(([name, of]) => h("button", { class: of.density === given.density && of.friction === given.friction ? "on" : "", onclick: () => set({ ...of, length: value("length") }) }, name))),
      numberField("density", digits(value("density"), 6), "kg/m³", typed("density")),
      numberField("length", within("length", value("length"), 6), unit("length"), (text) => app.queue(async () => { set({ length: lengthOf("length", text, "length") }); })),
      h("h2", {}, "Friction"),
      h("div", { class: "chips" },
        h("button", { class: measured ? "" : "on", onclick: () => set({ friction: ASSUMED.friction }) }, "I know it"),
        h("button", { class: measured ? "on" : "", id: "friction-measured", onclick: () => set({ friction: "measured" }) }, "Estimate it from the motion")),
      measured ? h("p", {}, "It is estimated from sliding contacts, used, and reported with its interval.") : numberField("friction", digits(value("friction"), 4), "", typed("friction")),
      numberField("at walls", given.wall_friction === undefined ? "" : digits(given.wall_friction, 4), "", (text) => app.queue(async () => { set({ wall_friction: text === "" ? "same" : parse(text, "wall friction") }); }), { placeholder: "as between rods" }),
      h("h2", {}, "Gravity in the picture"),
      h("div", { class: "chips" }, [["none: rods lie flat", [0, 0]], ["down: 9.81 m/s²", [0, -9.81]]].map(([words, gravity]) => h("button", { class: String(given.gravity ?? [0, 0]) === String(gravity) ? "on" : "", onclick: () => set({ gravity }) }, words))),
      fact("used as", `ρ ${digits(value("density"))} kg/m³, ${measuredAs("length", value("length"), 3)} long, μ ${measured ? "found" : digits(value("friction"))}`),
    ];
  },
};
