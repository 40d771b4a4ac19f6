// The first page: experiments with the state of their steps, photographs without one, the sample.

import { request, at, h, sign } from "/page/dom.js";

export function showHome(app) {
  at("home").hidden = false;
  app.queue(async () => {
    const folder = await request("home");
    document.title = "Rodsight";
    const empty = !folder.experiments.length && !folder.series.length;
    at("home").replaceChildren(...[
      h("h1", {}, empty ? "Contact forces, from nothing but photographs" : "Experiments"),
      h("p", {}, empty
        ? `There are no photographs and no experiments in ${folder.root} yet. Put the photographs of one test into a folder there (PNG, TIFF, JPEG or raw), then reload; or begin with the sample.`
        : `In ${folder.root}. Every action writes ordinary files there, which rodsight run reads.`),
      folder.experiments.length ? h("div", { class: "tiles" }, folder.experiments.map((each) => experimentTile(app, each))) : null,
      folder.series.length ? [h("h2", {}, "New from photographs"), likeField(folder.experiments), h("div", { class: "tiles" }, folder.series.map((each) => seriesTile(app, each)))] : null,
      folder.sample ? [h("h2", {}, "To begin with"), h("div", { class: "tiles" }, sampleTile(app))] : null,
      h("p", { style: { marginTop: "28px" } }, h("button", { class: "quiet", onclick: app.home }, "Reload"), ` Rodsight ${folder.version}`),
    ].flat(9).filter(Boolean));
  });
}

/** The experiment whose set-up a new one takes over: scale, lens, walls, material, not its rods. */
function likeField(experiments) {
  const known = experiments.filter((each) => !each.error);
  if (!known.length) return null;
  return h("div", { class: "field", style: { maxWidth: "420px" } }, h("label", { htmlFor: "like" }, "set up like"),
    h("select", { id: "like", title: "Scale, lens, walls, material and settings are taken over; rods are detected anew" }, h("option", { value: "" }, "nothing: from the beginning"), known.map((each) => h("option", { value: each.at }, each.at === "." ? each.name : each.at))));
}

function experimentTile(app, each) {
  const picture = each.frames
    ? h("img", { class: "picture", alt: "", src: `/photograph?${new URLSearchParams({ at: each.at, frame: each.frames - 1, size: 480 })}` })
    : h("span", { class: "picture empty" }, "∅");
  const run = each.run;
  const status = each.error ? [h("span", { class: "pill bad" }, "cannot be read")]
    : run?.frames !== undefined && run ? [...(run.out_of_date?.length ? [["out of date", ""]] : []), ...(run.causes ? [["something is wrong", ""]] : []), ...Object.entries(run.status ?? {})].map(([name, count]) => h("span", { class: `pill ${TONE[name] ?? ""}` }, `${count} ${name}`.trim()))
    : [h("span", { class: "pill" }, run?.unfinished ? "unfinished run" : "not run yet")];
  return h("button", { class: "tile", onclick: () => app.queue(async () => app.open(await request("project", { at: each.at }))) },
    picture,
    h("span", { class: "words" },
      h("b", {}, each.name, [".", each.name].includes(each.at) ? null : h("span", { class: "soft" }, ` in ${each.at}`)),
      h("span", {}, each.error ?? (each.frames ? `${photographs(each.frames)}${run?.rods ? ` · ${run.rods} rods` : ""}` : "given tracks")),
      h("span", { class: "row" }, status, run?.trust !== undefined && run?.trust !== null ? h("span", { class: "pill", title: "the least trust of a frame" }, `T ≥ ${run.trust.toFixed(2)}`) : null),
      h("span", { class: "dots", title: "photographs, scale, walls, rods, material" }, each.steps.map((mark) => sign(mark)))));
}

const photographs = (count) => `${count} photograph${count === 1 ? "" : "s"}`;
const TONE = { settled: "good", settling: "good", rearranging: "doubtful", suspect: "bad", failed: "bad", reset: "", "out of date": "doubtful", "something is wrong": "bad" };

function seriesTile(app, each) {
  return h("button", { class: "tile", onclick: () => app.queue(async () => app.open(await request("begin", { folder: each.folder, suffix: each.suffix, name: each.name, like: at("like")?.value || null })), "Reading photographs …", `begin ${each.folder} ${each.suffix}`) },
    h("img", { class: "picture", alt: "", src: `/thumbnail?${new URLSearchParams({ folder: each.folder, suffix: each.suffix })}` }),
    h("span", { class: "words" }, h("b", {}, each.folder === "." ? each.name : each.folder), h("span", {}, `${photographs(each.count)}, ${each.first} … ${each.last}`), h("span", {}, "Set up an experiment from these")));
}

function sampleTile(app) {
  return h("button", { class: "tile", onclick: () => app.queue(async () => app.open(await request("sample")), "Copying the sample …", "sample") },
    h("img", { class: "picture", alt: "", src: "/thumbnail" }),
    h("span", { class: "words" }, h("b", {}, "The sample: simple shear"), h("span", {}, "250 rods, 24 photographs, with the true forces to compare with")));
}
