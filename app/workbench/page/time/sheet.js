// The contact sheet: all photographs beside one another, or the same rod or contact in all of them; a click goes there.

import { at, digits, h } from "/page/dom.js";
import { TONES } from "/page/time/strip.js";

const SIDE = 180; // [px] of a picture, at first
const SIDES = [110, SIDE, 300];
const AROUND = 3.4; // [radii] beside a rod or contact
const sheet = { open: false, side: SIDE, around: true };

/** Open and close it; facts: of the run, for the status; chosen: what is shown in all photographs. */
export function sheetButton(app, facts, chosen) {
  sheet.facts = facts; sheet.chosen = chosen;
  if (sheet.open) requestAnimationFrame(() => showSheet(app));
  return h("button", { id: "show-sheet", class: sheet.open ? "on" : "", "aria-pressed": String(sheet.open), title: "All photographs beside one another (A)", onclick: () => toggleSheet(app) }, "Sheet");
}

export function toggleSheet(app) { sheet.open = !sheet.open; app.timeline(); if (sheet.open) showSheet(app, true); else closeSheet(app); }

/** Close it, as any step does that is left. */
export function closeSheet(app) { sheet.open = false; sheet.shown = ""; at("sheet").hidden = true; at("sheet").replaceChildren(); if (app.project) at("show-sheet")?.classList.remove("on"); }

export const isSheetOpen = () => sheet.open;

/** The places and width [px] of what is chosen in every photograph; null for whole photographs. */
function placesOf() {
  const { chosen } = sheet;
  if (!sheet.around || !chosen?.data) return null;
  return chosen.kind === "rod" ? chosen.data.place : chosen.data.point;
}

function showSheet(app, focus = false) {
  const { project } = app, places = placesOf(), width = Math.max(Math.round(AROUND * (sheet.chosen?.radius ?? 30)), 16);
  const key = JSON.stringify([project.at, project.stamp, project.frames, sheet.side, Boolean(places), sheet.chosen?.name]);
  if (sheet.shown !== key || focus) {
    sheet.shown = key;
    at("sheet").replaceChildren(
      h("div", { class: "row head" }, h("h2", {}, places ? `${sheet.chosen.name} in all photographs` : "All photographs"), h("span", { class: "grow" }),
        sheet.chosen?.data ? h("button", { id: "sheet-around", class: sheet.around ? "on" : "", "aria-pressed": String(sheet.around), onclick: () => { sheet.around = !sheet.around; showSheet(app); } }, `Around ${sheet.chosen.name}`) : null,
        h("button", { class: "quiet", "aria-label": "smaller pictures", onclick: () => resize(app, -1) }, "−"), h("button", { class: "quiet", "aria-label": "larger pictures", onclick: () => resize(app, 1) }, "+"),
        h("button", { id: "close-sheet", title: "Esc", onclick: () => { closeSheet(app); at("canvas").focus(); } }, "Close")),
      h("div", { class: "sheet", style: { gridTemplateColumns: `repeat(auto-fill, minmax(${sheet.side}px, 1fr))` } }, Array.from({ length: project.frames }, (_, k) => cell(app, k, places, width))));
    at("sheet").hidden = false;
  }
  for (const each of at("sheet").querySelectorAll(".cell")) { const here = Number(each.dataset.frame) === app.frame; each.classList.toggle("here", here); if (here) { each.setAttribute("aria-current", "true"); each.scrollIntoView({ block: "nearest" }); if (focus) each.focus(); } else each.removeAttribute("aria-current"); }
}

function resize(app, by) {
  sheet.side = SIDES[Math.min(Math.max(SIDES.indexOf(sheet.side) + by, 0), SIDES.length - 1)];
  showSheet(app);
}

function cell(app, k, places, width) {
  const { facts } = sheet, status = facts && k >= facts.first && k < facts.count ? facts.status[k] : null, p = places ? places[k] : null;
  const side = Math.min(Math.round(sheet.side * (devicePixelRatio || 1)), 600), source = places
    ? p && `/crop?${new URLSearchParams({ at: app.project.at, frame: k, x: p[0], y: p[1], width, columns: side, rows: side })}`
    : app.project.files.length ? `${app.photograph(k)}&size=${side}` : null;
  const words = [`photograph ${k}`, status, status && facts.trust[k] !== null ? `T\u00a0${digits(facts.trust[k], 2)}` : null, facts?.lost[k] ? `${facts.lost[k]} lost` : null].filter(Boolean);
  return h("button", { class: "cell", "data-frame": String(k), style: { borderTopColor: status ? TONES[status] : "var(--edge)" }, onclick: () => app.show(k), ondblclick: () => { app.show(k); closeSheet(app); } },
    source ? h("img", { alt: "", loading: "lazy", src: source, style: { aspectRatio: places ? "1" : `${app.project.width} / ${app.project.height}` } }) : h("span", { class: "nothing", style: { aspectRatio: "1" } }, places ? "not seen" : "∅"),
    h("span", {}, words.join(" · ")));
}
