// Eye against program, and eye against eye: a figure and a table by frames, κ, and the pairs that reviewers dispute.

import { ask, chart, colour, digits, h } from "/page/dom.js";

// What both see, the program alone, the eye alone; what neither sees is the rest of the bar.
const PARTS = [["hits", "both", "#2fbf93"], ["false", "program alone", "#d55e00"], ["missed", "eye alone", "#f0e442"], ["rejected", "neither", "#56b4e9"]];

/** Closed until it is asked for; open(answer) puts the numbers in. go(pair) shows a pair. */
export function agreementSection(app, state, go) {
  const load = () => app.queue(async () => { state.told = await ask("agreement", { at: app.project.at }); app.paint(); });
  return h("details", { id: "agreement", open: state.open, ontoggle: (event) => { if (event.target.open !== state.open) { state.open = event.target.open; if (state.open) load(); } } },
    h("summary", {}, "Eye against program"), state.open && state.told ? body(state.told, go) : null);
}

function body(told, go) {
  if (!told.total) return h("p", {}, "Nothing has been judged yet. Judge pairs with C and N; what eyes and program agree on is counted here.");
  const share = (name, of) => h("div", { class: "fact" }, h("span", {}, name), h("span", {}, of ? `${digits(of.value, 2)} (${digits(of.low, 2)} … ${digits(of.high, 2)})` : "judge more pairs"));
  return h("div", { class: "card" },
    chart(92, (c, width, height) => figure(c, width, height, told.frames)),
    h("div", { class: "keys-row" }, PARTS.map(([, words, style]) => h("span", {}, h("i", { class: "swatch", style: { background: style } }), words))),
    table(["frame", ...PARTS.map(([, words]) => words)], [...told.frames.map((each) => [String(each.frame), ...PARTS.map(([key]) => String(each[key]))]), ["all", ...PARTS.map(([key]) => String(told.total[key]))]]),
    share("precision", told.precision), share("recall", told.recall),
    told.judges.length ? [h("h3", {}, "Agreement of judges"), table(["", "pairs", "agree", "κ"], told.judges.map((each) => [`${each.first} – ${each.second}`, String(each.count), each.observed === null ? "–" : `${Math.round(100 * each.observed)} %`, each.kappa === null ? "–" : `${digits(each.kappa, 2)} ± ${digits(each.standard_error, 1)}`]))] : null,
    told.disputed.length ? [h("h3", {}, "Disputed"), h("div", { class: "list", id: "disputed" }, told.disputed.map((each) => h("button", { onclick: () => go(each) },
      h("span", { class: "two" }, h("span", {}, `photograph ${each.frame} · ${typeof each.j === "number" ? "rods" : "rod"} ${each.i} – ${each.j}`), h("span", { class: "soft" }, Object.entries(each.said).map(([who, said]) => `${who}: ${said}`).join(" · "))))))] : null);
}

const table = (heads, rows) => h("table", { class: "numbers" }, h("thead", {}, h("tr", {}, heads.map((text) => h("th", {}, text)))), h("tbody", {}, rows.map((row) => h("tr", {}, row.map((text) => h("td", {}, text))))));

/** A bar a frame: how many pairs were judged, by who sees a contact. */
function figure(c, width, height, frames) {
  const most = Math.max(1, ...frames.map((each) => PARTS.reduce((sum, [key]) => sum + each[key], 0))), pad = 26, step = (width - pad - 6) / frames.length, wide = Math.min(step - 3, 34), tall = height - 26;
  c.font = "10.5px system-ui, sans-serif"; c.fillStyle = colour("soft"); c.textAlign = "right"; c.fillText(String(most), pad - 5, 14); c.fillText("0", pad - 5, height - 16);
  frames.forEach((each, k) => {
    const x = pad + (k + 0.5) * step - wide / 2;
    let low = height - 18;
    for (const [key, , style] of PARTS) { const part = each[key] / most * tall; c.fillStyle = style; c.fillRect(x, low - part, wide, Math.max(part - (part > 2 ? 1 : 0), 0)); low -= part; }
    c.fillStyle = colour("soft"); c.textAlign = "center"; if (step > 14 || k % 4 === 0) c.fillText(String(each.frame), x + wide / 2, height - 5);
  });
}
