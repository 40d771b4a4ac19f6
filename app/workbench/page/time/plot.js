// Values over the photographs below the time line: of the chosen contact or rod, of others that are kept, or of the frames.

import { at, colour, digits, h, withDeviation } from "/page/dom.js";
import { download, fileName } from "/page/parts/take_away.js";
import { sheetButton } from "/page/time/sheet.js";
import { begin, dragFrames } from "/page/time/strip.js";
import { shown } from "/page/units.js";

const MOST = 4; // series at a time
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]]; // series differ in dashes as well as colour
const times = (values, factor) => values?.map((value) => (value === null ? null : value * factor)) ?? null;
const QUANTITIES = {
  pair: {
    fn: ["normal force", "N", (data) => [data.fn, data.fn_sd]], ft: ["tangential force", "N", (data) => [data.ft, data.ft_sd]],
    mobilised: ["|f_t| / f_n", "", (data) => [data.fn.map((fn, k) => (fn > 0 ? Math.abs(data.ft[k]) / fn : null)), null]],
    gap: ["gap", "µm", (data) => [times(data.gap, 1e6), times(data.gap_sd, 1e6)]], probability: ["P(touch)", "", (data) => [data.probability, null]],
  },
  rod: {
    displacement: ["distance from its first place", "mm", (data) => [times(data.displacement, 1e3), times(data.sigma, 1e3)]],
    rotation: ["rotation", "°", (data) => [times(data.rotation, 180 / Math.PI), null]], zncc: ["correlation", "", (data) => [data.zncc, null]],
    unbalance: ["force residual / mean f_n", "", (data) => [data.unbalance, null]],
  },
  frame: {
    trust: ["trust", "", (data) => [data.trust, null]], friction_angle: ["friction angle", "°", (data) => [data.friction_angle, null]], mean_fn: ["mean f_n", "N", (data) => [data.mean_fn, null]],
    coordination: ["coordination number", "", (data) => [data.coordination, null]], contacts: ["contacts", "", (data) => [data.contacts, null]], lost: ["lost rods", "", (data) => [data.lost, null]],
  },
};
const quantityOf = (kind) => { const [words, unit, of] = QUANTITIES[kind][plot.quantity[kind]]; return [words, shown(unit), of]; };

const plot = { open: false, quantity: { pair: "fn", rod: "displacement", frame: "trust" }, kept: [] };

export function togglePlot(app) { plot.open = !plot.open; app.timeline(); app.stage.resize(); }

/** Forget what was kept: another experiment is opened. */
export function clearPlot() { plot.kept = []; }

export const timeTools = (app, facts, chosen) => [
  h("button", { id: "show-plot", class: plot.open ? "on" : "", "aria-pressed": String(plot.open), title: "Values over the photographs (P)", onclick: () => togglePlot(app) }, "Plot"),
  sheetButton(app, facts, chosen),
];

/** What is plotted: the chosen contact or rod and those that are kept, all of one kind; otherwise the frames. */
function seriesOf(facts, chosen) {
  const here = chosen?.data ? chosen : null, kind = here?.kind ?? plot.kept.at(-1)?.kind ?? "frame";
  const items = [...plot.kept.filter((each) => each.kind === kind && each.name !== here?.name), ...(here ? [here] : [])];
  if (!items.length && facts) items.push({ kind: "frame", name: "all rods", data: facts });
  return { kind: items[0]?.kind ?? "frame", items: items.slice(-MOST).map((item, n) => ({ ...item, line: { style: colour(`series-${n + 1}`), dash: DASHES[n] } })) };
}

/** The row of the plot, empty where it is closed. */
export function plotRow(app, facts, chosen) {
  if (!plot.open || !facts) return [];
  const { kind, items } = seriesOf(facts, chosen), [words, unit, values] = quantityOf(kind);
  const kept = (name) => plot.kept.some((each) => each.kind === kind && each.name === name);
  const spoken = items.map((item) => `${item.name}: ${valueAt(values(item.data), app.frame, unit)}`).join("; ");
  const canvas = h("canvas", { id: "plot", role: "img", "aria-label": `${words} over the photographs; at photograph ${app.frame} ${spoken}` });
  dragFrames(app, canvas, app.project.frames);
  return [
    h("div", { class: "plot-keys" },
      h("select", { id: "plot-quantity", "aria-label": "what is plotted", onchange: (event) => { plot.quantity[kind] = event.target.value; app.timeline(); } }, Object.entries(QUANTITIES[kind]).map(([name, [text]]) => h("option", { value: name, selected: name === plot.quantity[kind] }, text))),
      items.map((item) => h("div", { class: "fact" }, h("span", {}, sample(item.line), item.name),
        h("span", {}, valueAt(values(item.data), app.frame, unit), kind === "frame" ? null : h("button", { class: "quiet", "aria-label": `${kept(item.name) ? "drop" : "keep"} ${item.name}`, title: kept(item.name) ? "Take it out of the plot" : "Keep it in the plot, to compare", onclick: () => keep(app, item) }, kept(item.name) ? "✕" : "+"))))),
    canvas,
    h("div", { class: "row tools" }, h("button", { id: "save-plot", title: "What is plotted, as CSV", onclick: () => save(app, facts, chosen) }, "CSV")),
  ];
}

function sample({ style, dash }) {
  const line = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  line.setAttribute("class", "sample"); line.setAttribute("viewBox", "0 0 26 8"); line.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  for (const [name, value] of [["d", "M0 4H26"], ["stroke", style], ["stroke-width", "2.4"], ["stroke-dasharray", dash.join(" ")]]) path.setAttribute(name, value);
  line.append(path);
  return line;
}

function keep(app, item) {
  const n = plot.kept.findIndex((each) => each.kind === item.kind && each.name === item.name);
  if (n >= 0) plot.kept.splice(n, 1);
  else { plot.kept.push({ kind: item.kind, name: item.name, data: item.data }); plot.kept = plot.kept.slice(-(MOST - 1)); }
  app.timeline();
}

function valueAt([values, sd], frame, unit) {
  return withDeviation(values[frame], sd?.[frame], unit);
}

export function drawPlot(app, facts, chosen) {
  const canvas = at("plot");
  if (!canvas || !facts) return;
  const count = app.project.frames, { c, step, width, height } = begin(canvas, count);
  const { kind, items } = seriesOf(facts, chosen), [, unit, of] = quantityOf(kind);
  const series = items.map((item) => ({ ...item, values: of(item.data) }));
  const all = series.flatMap(({ values: [values, sd] }) => values.flatMap((v, k) => (v === null || v === undefined ? [] : [v - (sd?.[k] ?? 0), v + (sd?.[k] ?? 0)])));
  c.fillStyle = colour("accent"); c.globalAlpha = 0.2; c.fillRect(app.frame * step, 0, Math.max(step, 2), height); c.globalAlpha = 1;
  if (!all.length) { c.fillStyle = colour("soft"); c.font = "12.5px system-ui, sans-serif"; c.fillText("no value in any photograph", 10, height / 2); return; }
  const [low, high] = limits(all), x = (k) => (k + 0.5) * step, y = (v) => height - 8 - (v - low) / (high - low) * (height - 18);
  c.font = "11px system-ui, sans-serif"; c.lineWidth = 1;
  for (const tick of [low, 0.5 * (low + high), high]) {
    c.strokeStyle = colour("edge"); c.beginPath(); c.moveTo(0, y(tick)); c.lineTo(width, y(tick)); c.stroke();
  }
  if (low < 0 && high > 0) { c.strokeStyle = colour("soft"); c.beginPath(); c.moveTo(0, y(0)); c.lineTo(width, y(0)); c.stroke(); }
  for (const { values: [values, sd], line } of series) {
    c.fillStyle = c.strokeStyle = line.style; c.globalAlpha = 0.22;
    if (sd) values.forEach((v, k) => { if (v !== null && v !== undefined && sd[k]) { const top = y(v + sd[k]); c.fillRect(x(k) - Math.max(0.35 * step, 1.5), top, Math.max(0.7 * step, 3), Math.max(y(v - sd[k]) - top, 1)); } });
    c.globalAlpha = 1; c.lineWidth = 2; c.setLineDash(line.dash);
    c.beginPath();
    let open = false;
    values.forEach((v, k) => { if (v === null || v === undefined) { open = false; return; } if (open) c.lineTo(x(k), y(v)); else c.moveTo(x(k), y(v)); open = true; });
    c.stroke(); c.setLineDash([]);
    values.forEach((v, k) => { if (v !== null && v !== undefined) { c.beginPath(); c.arc(x(k), y(v), k === app.frame ? 4.2 : 2.2, 0, 7); c.fill(); } });
  }
  for (const [tick, base] of [[low, "bottom"], [high, "top"]]) { c.textBaseline = base; const text = `${digits(tick, 3)} ${unit}`, wide = c.measureText(text).width; c.fillStyle = colour("ground"); c.globalAlpha = 0.8; c.fillRect(2, y(tick) + (base === "top" ? 0 : -13), wide + 5, 13); c.globalAlpha = 1; c.fillStyle = colour("soft"); c.fillText(text, 4, y(tick)); }
}

function limits(values) {
  const low = Math.min(...values), high = Math.max(...values);
  if (low > -0.02 * high && low < 0.5 * high) return [0, high];
  return high > low ? [low, high] : [low - 0.5 * Math.abs(low) - 1e-9, high + 0.5 * Math.abs(high) + 1e-9];
}

/** The plotted values, one row for a photograph. */
function save(app, facts, chosen) {
  const { kind, items } = seriesOf(facts, chosen), name = plot.quantity[kind], [, unit, of] = quantityOf(kind);
  const columns = items.flatMap((item) => { const [values, sd] = of(item.data), title = `${name}_${item.name.replace(/[^\w]+/g, "_")}${unit ? `_${unit}` : ""}`; return [[title, values], ...(sd ? [[`${title}_sd`, sd]] : [])]; });
  const rows = Array.from({ length: facts.count }, (_, k) => [k, ...columns.map(([, values]) => values[k] ?? "")].join(","));
  download(new Blob([[["frame", ...columns.map(([title]) => title)].join(","), ...rows].join("\n"), "\n"], { type: "text/csv" }), fileName(app, "over_time.csv"));
}
