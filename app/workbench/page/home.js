// The first page: experiments with how they stand, photographs that wait for one, the sample.

import { ask, at, h, sign } from "/page/dom.js";

export function showHome(app) {
  at("home").hidden = false;
  app.queue(async () => {
    const told = await ask("home");
    document.title = "Rodsight";
    const empty = !told.experiments.length && !told.rolls.length;
    at("home").replaceChildren(...[
      h("h1", {}, empty ? "Contact forces, from nothing but photographs" : "Experiments"),
      h("p", {}, empty
        ? `There are no photographs and no experiments in ${told.root} yet. Put the photographs of one test into a folder there (PNG, TIFF, JPEG or raw), then look again; or begin with the sample.`
        : `In ${told.root}. Everything that is done here becomes an ordinary file there; rodsight run obeys it.`),
      told.experiments.length ? h("div", { class: "tiles" }, told.experiments.map((each) => experimentTile(app, each))) : null,
      told.rolls.length ? [h("h2", {}, "New from photographs"), h("div", { class: "tiles" }, told.rolls.map((each) => rollTile(app, each)))] : null,
      told.sample ? [h("h2", {}, "To begin with"), h("div", { class: "tiles" }, sampleTile(app))] : null,
      h("p", { style: { marginTop: "28px" } }, h("button", { class: "quiet", onclick: app.home }, "Look again"), ` Rodsight ${told.version}`),
    ].flat(9).filter(Boolean));
  });
}

function experimentTile(app, each) {
  const picture = each.frames
    ? h("img", { class: "picture", alt: "", src: `/photograph?${new URLSearchParams({ at: each.at, frame: each.frames - 1, size: 480 })}` })
    : h("span", { class: "picture empty" }, "∅");
  const run = each.run;
  const status = each.complaint ? [h("span", { class: "pill bad" }, "cannot be read")]
    : run?.frames !== undefined && run ? Object.entries(run.status ?? {}).map(([name, count]) => h("span", { class: `pill ${TONE[name] ?? ""}` }, `${count} ${name}`))
    : [h("span", { class: "pill" }, run?.unfinished ? "unfinished run" : "not run yet")];
  return h("button", { class: "tile", onclick: () => app.queue(async () => app.open(await ask("project", { at: each.at }))) },
    picture,
    h("span", { class: "words" },
      h("b", {}, each.name),
      h("span", {}, each.complaint ?? (each.frames ? `${each.frames} photographs${run?.rods ? ` · ${run.rods} rods` : ""}` : "given tracks")),
      h("span", { class: "row" }, status, run?.trust !== undefined && run?.trust !== null ? h("span", { class: "pill", title: "the least trust of a frame" }, `T ≥ ${run.trust.toFixed(2)}`) : null),
      h("span", { class: "dots", title: "photographs, scale, walls, rods, material" }, each.steps.map((mark) => sign(mark)))));
}

const TONE = { settled: "good", settling: "good", rearranging: "doubtful", suspect: "bad", failed: "bad", reset: "" };

function rollTile(app, each) {
  return h("button", { class: "tile", onclick: () => app.queue(async () => app.open(await ask("begin", { roll: each.roll, name: each.name })), "Reading photographs …", "begin") },
    h("img", { class: "picture", alt: "", src: `/glimpse?${new URLSearchParams({ roll: each.roll })}` }),
    h("span", { class: "words" }, h("b", {}, each.folder === "." ? each.name : each.folder), h("span", {}, `${each.count} photographs, ${each.first} … ${each.last}`), h("span", {}, "Set up an experiment from these")));
}

function sampleTile(app) {
  return h("button", { class: "tile", onclick: () => app.queue(async () => app.open(await ask("sample")), "Copying the sample …", "sample") },
    h("img", { class: "picture", alt: "", src: "/glimpse" }),
    h("span", { class: "words" }, h("b", {}, "The sample: simple shear"), h("span", {}, "250 rods, 24 photographs, with the true forces to compare with")));
}
