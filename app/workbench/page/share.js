// Step 9: the recording as one HTML file that any browser opens, without a network, a server or this program.

import { ask, fact, h, parse, tell } from "/page/dom.js";

let told = null, first = "", last = "", scale = 1, of = null;

export const share = {
  name: "share", title: "Share",
  dim: 0.75,
  mark: () => (told?.file && !told.old ? "good" : "missing"),
  enter(app) {
    if (of !== app.project.at) { of = app.project.at; told = null; first = ""; last = ""; scale = 1; }
    app.queue(async () => { told = await ask("shared", { at: app.project.at }); app.paint(); });
  },
  panel(app) {
    if (!told) return h("p", {}, "Looking …");
    if (!told.ready) return [h("p", {}, "There is no recording to share yet: it is written at the end of a run."), h("button", { class: "primary", onclick: () => app.goTo("run") }, "To the run")];
    const frames = app.project.run?.frames ?? app.project.files.length;
    const field = (id, words, value, placeholder, onchange) => h("div", { class: "field" }, h("label", { htmlFor: id }, words), h("input", { id, value, placeholder, inputMode: "numeric", onchange: (event) => onchange(event.target.value.trim()) }));
    return [
      h("p", {}, "One HTML file with the recording and its viewer in it. Whoever gets it opens it in a browser: nothing is installed, no network is asked."),
      field("share-first", "first frame", first, "0", (text) => { first = text; }),
      field("share-last", "last frame", last, String(frames - 1), (text) => { last = text; }),
      h("div", { class: "field" }, h("label", { htmlFor: "share-scale" }, "photographs"), h("select", { id: "share-scale", onchange: (event) => { scale = Number(event.target.value); } },
        [[1, "as they are recorded"], [0.5, "half as wide and high"], [0.25, "a quarter"]].map(([value, words]) => h("option", { value, selected: value === scale }, words)))),
      h("button", { class: told.file && !told.old ? "" : "primary", id: "write-page", onclick: () => write(app) }, told.file ? "Write it again" : "Write the file"),
      told.file ? h("div", { class: `card ${told.old ? "" : "here"}`, id: "shared" },
        h("b", {}, told.name), fact("size", `${(told.bytes / 1e6).toFixed(1)} MB, viewer included`),
        h("p", { style: { overflowWrap: "anywhere" } }, told.file),
        told.old ? h("div", { class: "says" }, h("p", {}, h("span", { class: "sign doubtful" }, "!"), "The recording has changed since it was written.")) : null,
        h("div", { class: "row" }, h("a", { class: "button", href: `/shared?${new URLSearchParams({ at: app.project.at })}`, download: told.name }, "Download"), h("button", { onclick: () => navigator.clipboard.writeText(told.file).then(() => tell("Copied"), () => tell("This browser does not let pages copy", true)) }, "Copy where it is"))) : null,
      h("p", {}, "The same as ", h("kbd", {}, "rodsight share RUN --html"), "."),
    ];
  },
};

function write(app) {
  app.queue(async () => {
    const values = { at: app.project.at, scale };
    if (first) values.first = parse(first, "first frame");
    if (last) values.stop = parse(last, "last frame") + 1;
    told = await ask("share", values);
    app.paint();
    tell(`Written: ${told.frames} frames, ${(told.bytes / 1e6).toFixed(1)} MB`);
  }, "Packing the recording and the viewer …");
}
