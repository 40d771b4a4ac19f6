// Elements, requests to the server, messages to the user. Texts enter the page as text only.

export const at = (id) => document.getElementById(id);

/** An element: h("button", { class: "primary", onclick }, "text", child). */
export function h(tag, values = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(values ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "style") Object.assign(element.style, value);
    else if (name in element && name !== "list") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
    if (name === "class") element.className = value;
  }
  element.append(...children.flat(9).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** The photograph that is shown, [number, name]: a request about it is refused where another one has its number by now. */
export const context = { photograph: () => null };

export async function request(endpoint, values = {}) {
  const photograph = context.photograph(values.at);
  let answer;
  try {
    answer = await fetch(`/api/${endpoint}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(photograph ? { ...values, photograph } : values) });
  } catch {
    dispatchEvent(new Event("unanswered"));
    throw new Error("The workbench does not answer: nothing was changed");
  }
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

let timer = 0;
export function notify(text, wrong = false) {
  at("toast").textContent = text;
  at("toast").className = wrong ? "shown wrong" : "shown";
  clearTimeout(timer);
  timer = setTimeout(() => { at("toast").className = ""; }, wrong ? 7000 : 2600);
}

/** Take a refusal away that no longer holds. */
export function dismissRefusal() { if (at("toast").classList.contains("wrong")) at("toast").className = ""; }

export const SIGNS = { good: "✓", doubtful: "!", missing: "○" };
export const sign = (mark) => h("span", { class: `sign ${mark}`, title: mark, role: "img", "aria-label": mark }, SIGNS[mark] ?? "");

/** A number field; onvalue gets its text when it is left or Enter is pressed. */
export function numberField(label, value, unit, onvalue, more = {}) {
  const input = h("input", { type: "text", inputMode: "decimal", value: value === null || value === undefined ? "" : String(value), ...more,
    onchange: () => onvalue(input.value.trim()), onkeydown: (event) => event.key === "Enter" && input.blur() });
  input.id = more.id ?? `field-${label.toLowerCase().replace(/[^a-z]+/g, "-")}`;
  return h("div", { class: "field" }, h("label", { htmlFor: input.id }, label), h("div", { class: "with-unit" }, input, unit && h("span", {}, unit)));
}

export const fact = (name, value) => h("div", { class: "fact" }, h("span", {}, name), h("span", {}, value));

/** A number with so many significant digits. */
export function digits(value, count = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return String(Number(value.toPrecision(count)));
}

const RECEIVED = 4; // significant digits of the values of a run that the server sends
/** A value with its standard deviation: two digits of it, and as many decimals of the value as it has, as 2.00 ± 0.10. */
export function withDeviation(value, deviation, unit = "", count = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (deviation === null || deviation === undefined || !(deviation > 0)) return `${digits(value, count)} ${unit}`.trim();
  const places = Math.min(Math.max(1 - Math.floor(Math.log10(Number(deviation.toPrecision(2)))), 0), 12);
  const sent = Math.max(RECEIVED - 1 - Math.floor(Math.log10(Math.abs(value) || 1)), 0);
  return `${value.toFixed(Math.min(places, sent))} ± ${Number(deviation.toPrecision(2)).toFixed(places)} ${unit}`.trim();
}

export function parse(text, what) {
  const value = Number(text.replace(",", "."));
  if (text === "" || !Number.isFinite(value)) throw new Error(`${what}: ${text || "nothing"} is not a number`);
  return value;
}

/** The canvas of a chart, sharp on every screen; words: what it shows; draw gets (context, width, height). */
export function chart(height, words, draw) {
  const canvas = h("canvas", { class: "chart", style: { height: `${height}px` }, role: "img", "aria-label": words });
  requestAnimationFrame(() => {
    const width = canvas.clientWidth, dense = devicePixelRatio || 1;
    canvas.width = width * dense; canvas.height = height * dense;
    const context = canvas.getContext("2d");
    context.scale(dense, dense);
    draw(context, width, height);
  });
  return canvas;
}

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

const TOGETHER = 60; // circles in one stroke: a thousand single strokes take ten times as long, one of thousands a quarter more
const TICK = 2; // [px on the screen] of a mark that turns with a circle, at least

/** Many circles [x, y, r, angle or null] in a style, over a dark one. */
export function strokeCircles(c, k, circles, style, wide, { dash = null, under = "#0009" } = {}) {
  c.setLineDash(dash ? dash.map((each) => each / k) : []);
  for (let first = 0; first < circles.length; first += TOGETHER) {
    const path = new Path2D();
    for (const [x, y, r, angle] of circles.slice(first, first + TOGETHER)) {
      path.moveTo(x + r, y); path.arc(x, y, r, 0, 2 * Math.PI);
      if (angle === null || angle === undefined || 0.22 * r * k < TICK) continue;
      path.moveTo(x + 0.78 * r * Math.cos(angle), y + 0.78 * r * Math.sin(angle)); path.lineTo(x + r * Math.cos(angle), y + r * Math.sin(angle));
    }
    if (under) { c.strokeStyle = under; c.lineWidth = (wide + 1.6) / k; c.stroke(path); }
    c.strokeStyle = style; c.lineWidth = wide / k; c.stroke(path);
  }
  c.setLineDash([]);
}
