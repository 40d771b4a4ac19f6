// Tables of other programs, chosen as files of this machine and copied into the experiment.

import { h, notify } from "/page/dom.js";

const TABLES = {
  times: { words: "times", columns: "frame,time [s]", instead: "instead of the interval" },
  load: { words: "measured load", columns: "frame,wall,force [N]", instead: "instead of a pressure" },
  forces: { words: "forces to compare with", columns: "frame,wall,fx,fy [N]", instead: "never used" },
};

export function tableField(app, name) {
  const { words, columns, instead } = TABLES[name], file = app.project.tables[name];
  const input = h("input", { type: "file", accept: ".csv,text/csv", id: `table-${name}`, hidden: true, onchange: (event) => {
    const [file] = event.target.files;
    if (file) app.queue(async () => { const table = await file.text(); app.change("set_table", { name, table }, "", () => notify(`${words}: ${file.name}`)); });
  } });
  return h("div", { class: "fact" }, h("span", { title: `${columns}, ${instead}` }, words), h("span", { class: "row", style: { flexWrap: "nowrap" } }, input,
    h("button", { title: `a table ${columns}, ${instead}`, onclick: () => input.click() }, file ?? "A table …"),
    file ? h("button", { class: "quiet", title: "Remove it", onclick: () => app.change("set_table", { name, table: null }) }, "✕") : null));
}
