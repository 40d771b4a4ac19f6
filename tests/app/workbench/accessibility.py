"""Rules of accessibility that a script can judge on a page: headings, names, contrast, focus, regions."""

# Returns a list of violations. Contrast after WCAG 2.2: 4.5, or 3 for large text; disabled controls are exempt.
CHECK = """() => {
  const wrong = [], seen = (e) => e.checkVisibility({ checkVisibilityCSS: true }) && e.getClientRects().length > 0;
  const all = (selector) => [...document.querySelectorAll(selector)].filter(seen);
  const label = (e) => `${e.tagName.toLowerCase()}${e.id ? "#" + e.id : ""}.${e.className?.baseVal ?? e.className} "${(e.textContent ?? "").trim().slice(0, 30)}"`;
  const name = (e) => (e.getAttribute("aria-label") || e.labels?.[0]?.textContent || e.getAttribute("title") || e.textContent || e.placeholder || e.alt || "").trim();
  if (all("h1").length !== 1) wrong.push(`${all("h1").length} headings of the first level`);
  const levels = all("h1, h2, h3, h4").map((e) => Number(e.tagName[1]));
  levels.forEach((level, k) => { if (k && level > levels[k - 1] + 1) wrong.push(`a heading of level ${level} after one of ${levels[k - 1]}`); });
  if (!document.documentElement.lang) wrong.push("the page states no language");
  if (!document.title) wrong.push("the page has no title");
  for (const e of all("button, a, input, select, summary, [role=button]")) if (!name(e)) wrong.push(`no name: ${label(e)}`);
  for (const e of all("input, select")) if (!e.labels?.length && !e.getAttribute("aria-label")) wrong.push(`no label: ${label(e)}`);
  for (const e of all("canvas, svg")) if (e.getAttribute("aria-hidden") !== "true" && !(e.getAttribute("role") && name(e))) wrong.push(`no role and name: ${label(e)}`);
  for (const e of all("img")) if (!e.hasAttribute("alt")) wrong.push(`no alternative text: ${label(e)}`);
  const ids = [...document.querySelectorAll("[id]")].map((e) => e.id);
  for (const id of ids.filter((id, k) => ids.indexOf(id) !== k)) wrong.push(`the id ${id} is there twice`);
  for (const e of all("button")) if (e.querySelector("button, a, input, select")) wrong.push(`a control inside a control: ${label(e)}`);
  const steps = all("#steps button");
  if (steps.length && steps.filter((e) => e.getAttribute("aria-current") === "step").length !== 1) wrong.push("no step is marked as the present one");
  if (steps.some((e) => !/good|doubtful|missing/.test(name(e)) && !e.querySelector("[role=img][aria-label]"))) wrong.push("a step does not name its state");
  for (const e of all("[aria-describedby], [aria-controls]")) for (const key of ["aria-describedby", "aria-controls"]) for (const id of (e.getAttribute(key) ?? "").split(" ").filter(Boolean)) if (!document.getElementById(id)) wrong.push(`${key} leads nowhere: ${label(e)}`);
  for (const e of all("body *")) if (e.tabIndex > 0) wrong.push(`an order of its own: ${label(e)}`);
  for (const e of all("p, h1, h2, h3, button, a, label, .list, .card, .messages, .log")) if (!e.closest("main, nav, header, footer, aside, section[aria-label], dialog, [role=status], [role=alert], figure")) wrong.push(`outside every region: ${label(e)}`);
  for (const e of all(".list, .log, #panel, #home")) if (e.scrollHeight > e.clientHeight + 2 && e.tabIndex < 0 && !e.querySelector("button, a, input, select")) wrong.push(`scrolled by mouse only: ${label(e)}`);
  const parse = (text) => { const c = document.createElement("canvas").getContext("2d", { willReadFrequently: true }); c.canvas.width = c.canvas.height = 1; c.fillStyle = text; c.fillRect(0, 0, 1, 1); const [r, g, b, a] = c.getImageData(0, 0, 1, 1).data; return [r, g, b, a / 255]; };
  const cache = new Map(), colour = (text) => { if (!cache.has(text)) cache.set(text, parse(text)); return cache.get(text); };
  const over = ([r, g, b, a], [x, y, z]) => [r * a + x * (1 - a), g * a + y * (1 - a), b * a + z * (1 - a), 1];
  const ground = (e) => { const above = e.parentElement ? ground(e.parentElement) : [255, 255, 255, 1]; return over(colour(getComputedStyle(e).backgroundColor), above); };
  const light = ([r, g, b]) => { const [x, y, z] = [r, g, b].map((v) => { const s = v / 255; return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4; }); return 0.2126 * x + 0.7152 * y + 0.0722 * z; };
  for (const e of all("body *")) {
    if (![...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()) || e.closest(":disabled, [aria-hidden=true], svg, canvas, #toast")) continue;
    const style = getComputedStyle(e), back = ground(e);
    let opacity = 1;
    for (let up = e; up; up = up.parentElement) opacity *= Number(getComputedStyle(up).opacity);
    const [r, g, b, a] = colour(style.color), front = over([r, g, b, a * opacity], back), [hi, lo] = [light(front), light(back)].sort((m, n) => n - m);
    const ratio = (hi + 0.05) / (lo + 0.05), size = parseFloat(style.fontSize), large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    if (ratio < (large ? 3 : 4.5)) wrong.push(`contrast ${ratio.toFixed(2)}: ${label(e)}`);
  }
  return wrong;
}"""  # noqa: E501  a page
