// Step 10: the recording as one HTML file that any browser opens, without a network, a server or this program.

import { request, fact, h, parse, notify } from "/page/dom.js";
import { runMark } from "/page/parts/run_state.js";

let file = null, first = "", last = "", scale = 1, of = null;

export const share = {
  name: "share", title: "Share",
  dim: 0.75,
  ofRun: true, mark: (app) => (file?.file && !file.old ? runMark(app) : "missing"),
  enter(app) {
    if (of !== app.project.at) { of = app.project.at; file = null; first = ""; last = ""; scale = 1; }
    app.queue(async () => { file = await request("shared", { at: app.project.at }); app.paint(); });
  },
  panel(app) {
    if (!file) return h("p", {}, "Looking …");
    if (!file.ready) return [h("p", {}, "There is no recording to share yet: it is written at the end of a run."), h("button", { class: "primary", onclick: () => app.goTo("run") }, "To the run")];
    const frames = app.project.run?.frames ?? app.project.frames;
    const field = (id, words, value, placeholder, onchange) => h("div", { class: "field" }, h("label", { htmlFor: id }, words), h("input", { id, value, placeholder, inputMode: "numeric", onchange: (event) => onchange(event.target.value.trim()) }));
    return [
      h("p", {}, "One HTML file with the recording and its viewer in it. Any browser opens it, without an installation and without a network."),
      field("share-first", "first frame", first, "0", (text) => { first = text; }),
      field("share-last", "last frame", last, String(frames - 1), (text) => { last = text; }),
      h("div", { class: "field" }, h("label", { htmlFor: "share-scale" }, "photographs"), h("select", { id: "share-scale", onchange: (event) => { scale = Number(event.target.value); } },
        [[1, "as they are recorded"], [0.5, "half as wide and high"], [0.25, "a quarter"]].map(([value, words]) => h("option", { value, selected: value === scale }, words)))),
      h("button", { class: file.file && !file.old ? "" : "primary", id: "write-page", onclick: () => write(app) }, file.file ? "Write it again" : "Write the file"),
      file.file ? h("div", { class: `card ${file.old ? "" : "here"}`, id: "shared" },
        h("b", {}, file.name), fact("size", `${(file.bytes / 1e6).toFixed(1)} MB, viewer included`),
        h("p", { style: { overflowWrap: "anywhere" } }, file.file),
        file.old ? h("div", { class: "messages" }, h("p", {}, h("span", { class: "sign doubtful" }, "!"), "The recording has changed since it was written.")) : null,
        h("div", { class: "row" }, h("a", { class: "button", href: `/shared?${new URLSearchParams({ at: app.project.at })}`, download: file.name }, "Download"), h("button", { onclick: () => navigator.clipboard.writeText(file.file).then(() => notify("Copied"), () => notify("This browser does not let pages copy", true)) }, "Copy where it is"))) : null,
      h("p", {}, "The same as ", h("kbd", {}, "rodsight share RUN --html"), "."),
    ];
  },
};

function write(app) {
  app.queue(async () => {
    const values = { at: app.project.at, scale };
    if (first) values.first = parse(first, "first frame");
    if (last) values.stop = parse(last, "last frame") + 1;
    file = await request("share", values);
    app.paint();
    notify(`Written: ${file.frames} frames, ${(file.bytes / 1e6).toFixed(1)} MB`);
  }, "Packing the recording and the viewer …");
}
