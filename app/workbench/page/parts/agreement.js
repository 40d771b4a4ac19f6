// Agreement of reviewers with the detector and with each other: counts by frame, κ, disputed pairs, the threshold.

import { request, chart, colour, digits, h } from "/page/dom.js";
import { pairName } from "/page/parts/verdicts.js";

// Contacts that both see, the detector alone, the reviewers alone; the rest of the bar neither sees.
export const PARTS = [["hits", "both", "#1c7afa"], ["false", "detector only", "#e581b0"], ["missed", "reviewers only", "#d8c641"], ["rejected", "neither", "#9bffb4"]];

/** Closed at first; opened, the numbers are requested. go(pair) shows a pair. */
export function agreementSection(app, state, go) {
  const load = () => app.queue(async () => { state.counts = await request("agreement", { at: app.project.at }); app.paint(); });
  return h("details", { id: "agreement", open: state.open, ontoggle: (event) => { if (event.target.open !== state.open) { state.open = event.target.open; if (state.open) load(); } } },
    h("summary", {}, "Agreement"), state.open && state.counts ? body(state.counts, go) : null);
}

function body(counts, go) {
  if (!counts.total) return h("p", {}, "No pair has been judged yet. Verdicts are compared here with the detector and with those of other reviewers.");
  const accuracy = (name, of) => h("div", { class: "fact" }, h("span", {}, name), h("span", {}, of ? `${digits(of.value, 2)} (${digits(of.low, 2)} … ${digits(of.high, 2)})` : "judge more pairs"));
  const fit = counts.threshold;
  return h("div", { class: "card" },
    chart(92, "judged pairs of every photograph, by who sees a contact", (c, width, height) => figure(c, width, height, counts.frames)),
    h("div", { class: "keys-row" }, PARTS.map(([, words, style]) => h("span", {}, h("i", { class: "swatch", style: { background: style } }), words))),
    table(["frame", ...PARTS.map(([, words]) => words)], [...counts.frames.map((each) => [String(each.frame), ...PARTS.map(([key]) => String(each[key]))]), ["all", ...PARTS.map(([key]) => String(counts.total[key]))]]),
    accuracy("precision", counts.precision), accuracy("recall", counts.recall),
    fit ? [h("h2", {}, "Threshold by these verdicts"),
      h("div", { class: "fact", id: "threshold" }, h("span", {}, "touching below"), h("span", {}, `${digits(fit.threshold_um, 3)} µm`)),
      h("div", { class: "fact" }, h("span", {}, "change of all radii"), h("span", {}, `${digits(fit.radius_change_um, 2)} ± ${digits(fit.radius_change_sd_um, 1)} µm`))] : null,
    counts.kappas.length ? [h("h2", {}, "Cohen's κ"), table(["", "pairs", "agree", "κ"], counts.kappas.map((each) => [`${each.first} – ${each.second}`, String(each.count), each.observed === null ? "–" : `${Math.round(100 * each.observed)} %`, each.kappa === null ? "–" : `${digits(each.kappa, 2)} ± ${digits(each.standard_error, 1)}`]))] : null,
    counts.disputed.length ? [h("h2", {}, "Disputed pairs"), h("div", { class: "list", id: "disputed" }, counts.disputed.map((each) => h("button", { onclick: () => go(each) },
      h("span", { class: "two" }, h("span", {}, `photograph ${each.frame} · ${pairName(each)}`), h("span", { class: "soft" }, Object.entries(each.verdicts).map(([who, verdict]) => `${who}: ${verdict}`).join(" · "))))))] : null);
}

const table = (heads, rows) => h("table", { class: "numbers" }, h("thead", {}, h("tr", {}, heads.map((text) => h("th", {}, text)))), h("tbody", {}, rows.map((row) => h("tr", {}, row.map((text) => h("td", {}, text))))));

/** One bar for each frame: the judged pairs by who sees a contact. */
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
