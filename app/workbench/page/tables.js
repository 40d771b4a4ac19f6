// Tables that were written elsewhere, chosen as files of this machine: they become tables of the experiment.

import { h, tell } from "/page/dom.js";

const TABLES = {
  times: { words: "times", columns: "frame,time [s]", instead: "instead of the interval" },
  load: { words: "measured load", columns: "frame,wall,force [N]", instead: "instead of a pressure" },
  forces: { words: "forces to compare with", columns: "frame,wall,fx,fy [N]", instead: "never used" },
};

export function tableField(app, name) {
  const { words, columns, instead } = TABLES[name], told = app.project.tables[name];
  const input = h("input", { type: "file", accept: ".csv,text/csv", id: `table-${name}`, hidden: true, onchange: (event) => {
    const [file] = event.target.files;
    if (file) app.queue(async () => { const table = await file.text(); app.change("set_table", { name, table }, "", () => tell(`${words}: ${file.name}`)); });
  } });
  return h("div", { class: "fact" }, h("span", { title: `${columns}, ${instead}` }, words), h("span", { class: "row", style: { flexWrap: "nowrap" } }, input,
    h("button", { title: `a table ${columns}, ${instead}`, onclick: () => input.click() }, told ?? "A table …"),
    told ? h("button", { class: "quiet", title: "Take it away", onclick: () => app.change("set_table", { name, table: null }) }, "✕") : null));
}
