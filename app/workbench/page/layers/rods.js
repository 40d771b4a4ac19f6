// Layers of the rods: outlines, walls, contacts by their state, displacement as arrows, values of rods as discs, a track.

import { digits, request, strokeCircles } from "/page/dom.js";
import { rangeOfValues, scaleOf } from "/page/layers/colours.js";
import { meanRadius } from "/page/layers/network.js";
import { layers, paintLayer } from "/page/layers/settings.js";

const ARROW = 2.2; // [mean radii] of the longest arrows, where no magnification is chosen
const POINT = 0.13; // [mean radii] of a contact's mark
const LEVELS = 32; // of a colour map, so that many arrows or discs are one stroke

export const SINCE = { window: "the window of the results", before: "the photograph before", first: "the first photograph" };

export const VALUES = {
  shear: { words: "shear strain", unit: "%", of: (motion) => motion.shear, map: "uncertainty", zero: true },
  volume: { words: "volume strain, + looser", unit: "%", of: (motion) => motion.volume, map: "difference", signed: true },
  d2min: { words: "√D²min / mean diameter", unit: "%", of: (motion) => motion.d2min, map: "uncertainty", zero: true },
  rotation: { words: "rotation, + counter-clockwise", unit: "°", of: (motion) => motion.rotation, map: "difference", signed: true },
  pressure: { words: "pressure in the rod", unit: "kPa", of: (motion) => motion.pressure, map: "force", zero: true },
  coordination: { words: "contacts that bear force", unit: "", of: (motion) => motion.coordination, map: "probability", low: 0, high: 6 },
  fringes: { words: "Σ f_n on the disc by its fringes", unit: "× mean", of: (motion) => motion.fringes?.measured, map: "force", zero: true, needs: "fringes" },
  forces: { words: "Σ f_n on the disc by the forces", unit: "× mean", of: (motion) => motion.fringes?.inferred, map: "force", zero: true, needs: "fringes" },
  residual: { words: "Σ f_n by fringes − by forces", unit: "× mean", of: (motion) => motion.fringes?.residual, map: "difference", signed: true, needs: "fringes" },
};
/** The chosen values of rods; shear strain where the run lacks those that were chosen in another one. */
const chosenValues = (motion) => (VALUES[layers.strain.by].of(motion) ? VALUES[layers.strain.by] : VALUES.shear);

export const CONTACTS = {
  state: { words: "sticking, sliding, open" },
  gap: { words: "gap, − overlap", unit: "µm", of: (net, n) => (net.gap[n] === null ? null : net.gap[n] * 1e6), map: "gap", signed: true },
  probability: { words: "P(touch)", unit: "", of: (net, n) => net.probability[n], map: "probability", low: 0, high: 1 },
  age: { words: "age", unit: "photographs", of: (net, n) => net.age[n], map: "uncertainty", zero: true },
};
/** States differ in shape as well as colour: a disc, a bar along the tangent, a ring. */
export const STATES = { sticking: "#f8f6ea", sliding: "#40d6de", open: "#6f7683" };

const known = new Map(); // motion by experiment, photograph and the one it is measured from

/** The motion of the rods that the shown layers need; null where they need none, or it is not there yet. */
export function motionOf(app, facts) {
  const wanted = ["strain", "displacement"].filter((name) => layers[name].on).map((name) => layers[name].since);
  const found = {};
  for (const since of wanted) {
    const from = since === "window" ? null : Math.max(since === "first" ? facts.first : app.frame - 1, facts.first), name = `${app.project.at} ${app.project.stamp} ${app.frame} ${from}`;
    if (!known.has(name)) {
      if (known.size > 24) known.clear();
      known.set(name, null);
      request("motion", { at: app.project.at, frame: app.frame, since: from }).then((answer) => { known.set(name, answer); app.stage.redraw(); }, (error) => app.notify(error.message, true));
    }
    found[since] = known.get(name);
  }
  return found;
}

export const isLoaded = () => [...known.values()].every((each) => each !== null); // for tests

export function scaleOfValues(motion) {
  const how = chosenValues(motion), [low, high] = how.high !== undefined ? [how.low, how.high] : rangeOfValues(how.of(motion), how);
  return scaleOf("strain", { map: how.map, low, high });
}

/** Values of rods as discs below everything else. */
export function drawValues(c, stage, net, motion) {
  if (!motion) return;
  const scale = scaleOfValues(motion), values = chosenValues(motion).of(motion), groups = new Map();
  net.rods.x.forEach((x, n) => {
    if (values[n] === null || !stage.sees(x, net.rods.y[n], net.rods.r[n])) return;
    addCircle(groups, scale.colour(values[n]), x, net.rods.y[n], net.rods.r[n]);
  });
  paintLayer(c, "strain", () => { for (const [style, path] of groups) { c.fillStyle = style; c.fill(path); } });
}

function addCircle(groups, style, x, y, r) {
  if (!groups.has(style)) groups.set(style, new Path2D());
  groups.get(style).moveTo(x + r, y); groups.get(style).arc(x, y, r, 0, 2 * Math.PI);
}

function displacementOf(motion) { return layers.displacement.by === "all" ? [motion.dx, motion.dy] : [motion.fx, motion.fy]; }

export function scaleOfDisplacement(net, motion) {
  const [dx, dy] = displacementOf(motion), long = dx.map((x, n) => (x === null ? null : Math.hypot(x, dy[n]) * motion.pixel * 1e6));
  const [low, high] = rangeOfValues(long, { zero: true }), scale = scaleOf("displacement", { map: "motion", low, high });
  const longest = Math.max(high / motion.pixel / 1e6, 1e-9);
  return { ...scale, long, times: layers.displacement.times || Number((ARROW * meanRadius(net) / longest).toPrecision(2)) };
}

/** Displacements as arrows that end where the rod is. */
export function drawDisplacement(c, k, stage, net, motion) {
  if (!motion) return;
  const scale = scaleOfDisplacement(net, motion), [dx, dy] = displacementOf(motion), groups = new Map(), size = meanRadius(net);
  net.rods.x.forEach((x, n) => {
    if (dx[n] === null) return;
    const y = net.rods.y[n], [u, v] = [dx[n] * scale.times, dy[n] * scale.times], long = Math.hypot(u, v);
    if (long * k < 1.5 || !stage.seesLine([x - u, y - v, x, y], size)) return;
    const step = Math.round(Math.min(Math.max((scale.long[n] - scale.low) / (scale.high - scale.low), 0), 1) * LEVELS) / LEVELS;
    const style = scale.colour(scale.low + step * (scale.high - scale.low)), path = groups.get(style) ?? groups.set(style, new Path2D()).get(style);
    const head = Math.min(0.34 * long, 0.3 * size), [a, b] = [u / long * head, v / long * head];
    path.moveTo(x - u, y - v); path.lineTo(x, y);
    path.moveTo(x - a - 0.5 * b, y - b + 0.5 * a); path.lineTo(x, y); path.lineTo(x - a + 0.5 * b, y - b - 0.5 * a);
  });
  paintLayer(c, "displacement", () => {
    const wide = Math.max(0.09 * size, 2 / k);
    c.strokeStyle = "#000b"; c.lineWidth = wide + 2 / k;
    for (const path of groups.values()) c.stroke(path);
    c.lineWidth = wide;
    for (const [style, path] of groups) { c.strokeStyle = style; c.stroke(path); }
  });
}

/** Over how many photographs a motion is measured. */
const over = (motion) => (motion.frame - motion.since > 1 ? ` over ${motion.frame - motion.since} photographs` : "");

export function rodLegends(net, motions) {
  const found = [], strain = motions[layers.strain.since], moved = motions[layers.displacement.since];
  if (layers.strain.on && strain) { const how = chosenValues(strain); found.push({ words: `${how.words}${how.needs ? "" : over(strain)}`, unit: how.unit, scale: scaleOfValues(strain) }); }
  if (layers.displacement.on && moved) { const scale = scaleOfDisplacement(net, moved); found.push({ words: `${layers.displacement.by === "all" ? "displacement" : "fluctuation"}${over(moved)}, drawn × ${digits(scale.times, 2)}`, unit: "µm", scale }); }
  if (layers.contacts.on && layers.contacts.by === "state") found.push({ words: "contacts", signs: [["sticking", "disc"], ["sliding", "bar"], ["open", "ring"]].map(([state, shape]) => ({ words: state, colour: STATES[state], shape })) });
  if (layers.contacts.on && layers.contacts.by !== "state") { const how = CONTACTS[layers.contacts.by]; found.push({ words: `contacts: ${how.words}`, unit: how.unit, scale: scaleOfContacts(net) }); }
  return found;
}

/** Outlines of the rods: uncertain ones dashed and yellow, with a mark that turns with them. */
export function drawRods(c, k, stage, net) {
  const sure = [], unsure = [], { x, y, r, angle, status } = net.rods;
  x.forEach((_, n) => { if (stage.sees(x[n], y[n], r[n])) (status[n] === "suspect" || status[n] === "interpolated" ? unsure : sure).push([x[n], y[n], r[n], angle[n]]); });
  paintLayer(c, "rods", () => { strokeCircles(c, k, sure, "#ced4e0a0", 1, { under: null }); strokeCircles(c, k, unsure, "#f0e442", 1.8, { dash: [6, 4] }); });
}

/** Walls as the photograph shows them. */
export function drawWalls(c, k, lines) {
  paintLayer(c, "walls", () => {
    const path = new Path2D();
    for (const line of lines ?? []) line.forEach(([x, y], n) => (n ? path.lineTo(x, y) : path.moveTo(x, y)));
    c.strokeStyle = "#000a"; c.lineWidth = 4 / k; c.stroke(path);
    c.strokeStyle = "#dee3ec"; c.lineWidth = 2 / k; c.stroke(path);
  });
}

function scaleOfContacts(net) {
  const how = CONTACTS[layers.contacts.by], [low, high] = how.high !== undefined ? [how.low, how.high] : rangeOfValues(net.fn.map((_, n) => how.of(net, n)), how);
  return scaleOf("contacts", { map: how.map, low, high });
}

/** Contacts where the bodies touch: by state, in shapes of their own, or in colours of a quantity. */
export function drawContacts(c, k, stage, net) {
  const { by } = layers.contacts, size = Math.max(POINT * meanRadius(net), 2.2 / k);
  const discs = new Map(), bars = new Path2D(), rings = new Path2D(), scale = by === "state" ? null : scaleOfContacts(net);
  net.point.forEach(([x, y], n) => {
    if (!stage.sees(x, y, 2 * size)) return;
    if (scale) { const value = CONTACTS[by].of(net, n); if (value !== null) addCircle(discs, scale.colour(value), x, y, size); return; }
    if (net.state[n] === "sliding") { const [x1, y1, x2, y2] = net.line[n], long = Math.hypot(x2 - x1, y2 - y1) || 1, [u, v] = [-(y2 - y1) / long * 2 * size, (x2 - x1) / long * 2 * size]; bars.moveTo(x - u, y - v); bars.lineTo(x + u, y + v); }
    else if (net.state[n] === "sticking") addCircle(discs, STATES.sticking, x, y, size);
    else { rings.moveTo(x + size, y); rings.arc(x, y, size, 0, 7); }
  });
  paintLayer(c, "contacts", () => {
    c.strokeStyle = "#000c"; c.lineWidth = 2.4 / k;
    for (const path of discs.values()) c.stroke(path);
    c.lineWidth = 0.8 * size + 2 / k; c.stroke(bars);
    for (const [style, path] of discs) { c.fillStyle = style; c.fill(path); }
    c.strokeStyle = STATES.sliding; c.lineWidth = 0.8 * size; c.stroke(bars);
    c.strokeStyle = STATES.open; c.lineWidth = 1.4 / k; c.stroke(rings);
  });
}

/** The places of a rod in all photographs: behind it drawn through, before it dashed; a dot at this one. */
export function drawTrack(c, k, places, frame) {
  const draw = (from, to, dash) => {
    const path = new Path2D();
    let open = false;
    for (let n = from; n <= to; n += 1) { const p = places[n]; if (!p) { open = false; continue; } if (open) path.lineTo(...p); else path.moveTo(...p); open = true; }
    c.setLineDash(dash.map((each) => each / k));
    c.strokeStyle = "#000c"; c.lineWidth = 4.5 / k; c.stroke(path);
    c.strokeStyle = "#f0e442"; c.lineWidth = 2 / k; c.stroke(path);
    c.setLineDash([]);
  };
  draw(frame, places.length - 1, [3, 4]); draw(0, frame, []);
  places.forEach((p, n) => { if (!p) return; c.beginPath(); c.arc(p[0], p[1], (n === frame ? 5 : 2.4) / k, 0, 7); c.fillStyle = "#000c"; c.fill(); c.beginPath(); c.arc(p[0], p[1], (n === frame ? 3.6 : 1.5) / k, 0, 7); c.fillStyle = n === frame ? "#fff" : "#f0e442"; c.fill(); });
}
