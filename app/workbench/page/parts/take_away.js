// What is shown, taken away: the picture as PNG, the contacts of the photograph as a table.

import { h, notify, request } from "/page/dom.js";

export function download(blob, name) {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

export const fileName = (app, ending) => `${app.project.name.replace(/[^\w.-]+/g, "_")}_photograph_${app.frame}.${ending}`;

/** The picture as it is shown, with a line below it that states what it is. */
export function savePicture(app, words) {
  const canvas = app.stage.composed(), dense = devicePixelRatio || 1, line = Math.round(30 * dense);
  const copy = h("canvas", { width: canvas.width, height: canvas.height + line }), c = copy.getContext("2d");
  c.fillStyle = "#08090b"; c.fillRect(0, 0, copy.width, copy.height);
  c.drawImage(canvas, 0, 0);
  c.fillStyle = "#e9ebf0"; c.font = `${13 * dense}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`; c.textBaseline = "middle";
  c.fillText(words, 12 * dense, canvas.height + line / 2, copy.width - 24 * dense);
  copy.toBlob((blob) => download(blob, fileName(app, "png")), "image/png");
}

const COLUMNS = [["fn", "fn_N"], ["ft", "ft_N"], ["fn_sd", "fn_sd_N"], ["ft_sd", "ft_sd_N"], ["gap", "gap_m"], ["probability", "probability"], ["age", "age_frames"], ["state", "state"], ["source", "source"]];

/** The contacts of a photograph, one row each; places in pixels. */
export function saveTable(app, net) {
  const cell = (value) => (value === null || value === undefined ? "" : /[",\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : String(value));
  const rows = net.i.map((i, n) => [net.frame, i, net.j[n], ...net.point[n], ...COLUMNS.map(([key]) => net[key][n])].map(cell).join(","));
  const head = ["frame", "i", "j", "x_px", "y_px", ...COLUMNS.map(([, name]) => name)].join(",");
  download(new Blob([[head, ...rows].join("\n"), "\n"], { type: "text/csv" }), fileName(app, "csv"));
}

/** The forces of the photograph as a figure for a paper: lines that stay lines, text that stays text. */
export const saveFigure = (app) => app.queue(async () => {
  const { svg } = await request("figure", { at: app.project.at, frame: app.frame });
  download(new Blob([svg], { type: "image/svg+xml" }), fileName(app, "svg"));
}, "Drawing the figure …", "figure");

/** Every action that is not undone, as a Python script that does it again. */
export const saveScript = (app) => app.queue(async () => {
  const { script, count } = await request("script", { at: app.project.at });
  download(new Blob([script], { type: "text/x-python" }), `${app.project.name.replace(/[^\w.-]+/g, "_")}.py`);
  notify(`${count} action${count === 1 ? "" : "s"} written`);
}, "", "script");
