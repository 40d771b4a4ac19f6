// The panel: one candidate at a time, a key for every action. Texts of the experiment enter the page as text only.

import { drawInterval, drawOutlines, drawScale } from "/crop.js";
import { startViewer } from "/viewer.js";

const at = (id) => document.getElementById(id);
const VERDICTS = { contact: "contact", "no-contact": "no contact", unsure: "unsure" };
const FLAGS = ["rearrangement", "reset", "ignore"];
const LONGEST = 300; // seconds of one judgement: beyond it the reviewer was away

const state = {
  about: null, frame: 0, pair: null, sampled: false, blind: false, outlines: true, zoom: 1, whole: false,
  since: performance.now(), viewer: null, shownFrame: null, reviewer: "", busy: Promise.resolve(), drawn: 0,
};
globalThis.review = state; // for the curious, and for tests

// ---------------------------------------------------------------- talking to the server

async function ask(question, more = {}) {
  const view = { reviewer: state.reviewer, frame: state.frame, sampled: state.sampled, blind: state.blind };
  const answer = await fetch(`/ask/${question}`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ ...view, ...more }),
  });
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

async function bytes(path, values) {
  const answer = await fetch(`${path}?${new URLSearchParams(values)}`);
  if (!answer.ok) throw new Error(await answer.text());
  return new Uint8Array(await answer.arrayBuffer());
}

/** One action after the other: two quick keys must not overtake each other. */
function queue(work) {
  state.busy = state.busy.then(work).catch((error) => toast(error.message || String(error), 6000));
  return state.busy;
}

// ---------------------------------------------------------------- showing

let toastTimer = 0;
function toast(text, time = 2200) {
  at("toast").textContent = text;
  at("toast").classList.add("shown");
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => at("toast").classList.remove("shown"), time);
}

function named(body) {
  return typeof body === "number" ? `grain ${body}` : body;
}

function both(pair) {
  return typeof pair.b === "number" ? `grains ${pair.a} – ${pair.b}` : `grain ${pair.a} – ${pair.b}`;
}

function showPair() {
  const pair = state.pair;
  state.since = performance.now();
  at("bodies").textContent = pair ? both(pair) : "";
  at("empty").textContent = pair ? "" : state.sampled ? "The whole sample is judged." : "Every candidate of this frame is judged. Next frame: ]";
  const told = pair && pair.detected !== undefined;
  const chance = told && pair.probability !== null ? `, P ${pair.probability.toFixed(2)}` : "";
  at("detector").textContent = told ? (pair.detected ? "detected" : "not detected") + chance : "";
  at("detector").className = told ? (pair.detected ? "detected-text" : "undetected-text") : "";
  at("said").textContent = pair && pair.verdict ? `● ${pair.verdict}` : "";
  at("said").className = pair && pair.verdict ? `${pair.verdict.replace(" ", "-")}-text` : "";
  const gap = at("gap");
  gap.replaceChildren();
  if (pair && Number.isFinite(pair.gap_um)) {
    const value = document.createElement("b");
    value.textContent = `gap ${signed(pair.gap_um)} ± ${pair.sigma_um.toFixed(1)} µm`;
    const sigmas = pair.sigma_um > 0 ? ` = ${signed(pair.gap_um / pair.sigma_um)} σ` : "";
    gap.append(value, `${sigmas}, threshold ${pair.threshold_um.toFixed(0)} µm`);
  }
  for (const [id, verdict] of Object.entries(VERDICTS)) {
    at(id).disabled = !pair;
    at(id).classList.toggle("given", Boolean(pair && pair.verdict === verdict));
  }
  drawScale(at("scale"), pair);
  return showCrop();
}

function signed(value) {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(1)}`;
}

async function showCrop() {
  const pair = state.pair;
  const image = at("cropped");
  drawOutlines(at("outlines"), pair, state.zoom, state.outlines);
  at("outline").setAttribute("aria-pressed", state.outlines);
  if (!pair) {
    image.removeAttribute("src");
    return;
  }
  image.src = `/crop?${new URLSearchParams({ frame: pair.frame, key: pair.key, zoom: state.zoom })}`;
  image.alt = `The photograph around the gap between ${named(pair.a)} and ${named(pair.b)}`;
  await image.decode().catch(() => {});
}

let wakeTimer = 0;
async function showPicture(look = true) {
  if (!state.viewer) return;
  const pair = state.pair && state.pair.frame === state.frame ? state.pair : null;
  const key = pair ? { key: pair.key } : {};
  const stage = at("stage");
  const aspect = Math.round((1000 * stage.clientWidth) / Math.max(stage.clientHeight, 1));
  const wanted = [];
  if (state.shownFrame !== state.frame) wanted.push(bytes("/backdrop", { frame: state.frame }));
  wanted.push(bytes("/marks", { frame: state.frame, reviewer: state.reviewer, blind: state.blind ? 1 : 0, ...key }));
  if (look) wanted.push(bytes("/look", { frame: state.frame, aspect, ...(state.whole ? {} : key) }));
  for (const part of await Promise.all(wanted)) state.viewer.show(part);
  clearTimeout(wakeTimer); // what came last is drawn at the next event: see that there is one
  wakeTimer = setTimeout(() => {
    state.viewer.leave();
    wakeTimer = setTimeout(state.viewer.leave, 500);
  }, 150);
  state.shownFrame = state.frame;
}

async function showStatus() {
  const told = await ask("status");
  const number = state.frame + state.about.first_frame;
  at("frame").textContent = `frame ${number} of ${state.about.first_frame + state.about.frame_count - 1}`;
  at("former").disabled = state.frame === 0;
  at("later").disabled = at("next-frame").disabled = state.frame + 1 >= state.about.frame_count;
  at("count").textContent = `${told.judged} of ${told.total} judged`;
  at("bar").max = Math.max(told.total, 1);
  at("bar").value = told.judged;
  for (const flag of FLAGS) at(flag).setAttribute("aria-pressed", told.flags.includes(flag));
  for (const share of ["precision", "recall"]) {
    const interval = told.estimate && told.estimate.judged > 0 ? told.estimate[share] : null;
    drawInterval(at(share), interval);
    const percent = (value) => (100 * value).toFixed(1);
    at(`${share}-text`).textContent = interval
      ? `${percent(interval.value)} % (${percent(interval.low)} – ${percent(interval.high)})` : "judge some first";
  }
  const kappas = (told.agreement || []).filter((each) => each.kappa !== null && each.count >= 5).slice(0, 2);
  at("agreement").textContent = kappas
    .map((each) => `κ ${each.kappa.toFixed(2)} ± ${each.standard_error.toFixed(2)}: ${each.first} and ${each.second}, ${each.count} pairs`)
    .join("\n") + (told.torn ? `\n${told.torn} torn lines in the log were passed over` : "");
}

/** Put a pair before the reviewer; its frame comes with it. */
async function present(pair, look = true) {
  state.pair = pair;
  if (pair) state.frame = pair.frame;
  await Promise.all([showPair(), showPicture(look)]);
  state.drawn += 1;
  await showStatus();
}

// ---------------------------------------------------------------- acting

const judge = (verdict) => queue(async () => {
  const pair = state.pair;
  if (!pair) return;
  const seconds = Math.min((performance.now() - state.since) / 1000, LONGEST);
  const answer = await ask("judge", { verdict, seconds, origin: pair.origin, pair_frame: pair.frame, key: pair.key });
  toast(`${both(pair)}: ${verdict}`);
  await present(answer.pair);
});

const next = () => queue(async () => {
  const after = state.pair ? { after_frame: state.pair.frame, after_key: state.pair.key } : {};
  await present((await ask("next", after)).pair);
});

const undo = () => queue(async () => {
  const answer = await ask("undo");
  toast(answer.undone ? `Taken back: ${answer.undone}` : "Nothing left to take back");
  if (answer.frame !== undefined) state.frame = answer.frame;
  await present(answer.pair || state.pair);
});

const turn = (by) => queue(async () => {
  const frame = state.frame + by;
  if (frame < 0 || frame >= state.about.frame_count) return;
  state.frame = frame;
  if (state.sampled) {
    state.sampled = false;
    showModes();
  }
  await present((await ask("next")).pair);
});

const pick = (x, y) => queue(async () => {
  const answer = await ask("pick", { x, y });
  if (!answer.pair) return toast("No gap here: click a candidate, or between two grains");
  if (answer.added) toast(`Added a contact: ${both(answer.pair)}.  Z takes it back`, 4000);
  await present(answer.pair, false);
});

const goTo = (text) => queue(async () => {
  const [a, b] = text.trim().split(/[\s,–-]+/);
  await present((await ask("named", { a: a || "", b: b || "" })).pair);
});

const flag = (name) => queue(async () => {
  const on = at(name).getAttribute("aria-pressed") !== "true";
  await ask("flag", { flag: name, on });
  toast(`Frame ${state.frame + state.about.first_frame}: ${name} ${on ? "set" : "taken off"}`);
  await showStatus();
});

const setMode = (sampled) => queue(async () => {
  state.sampled = sampled;
  showModes();
  await present((await ask("next")).pair);
});

const setBlind = (blind) => queue(async () => {
  state.blind = blind;
  state.outlines = !blind;
  showModes();
  const pair = state.pair;
  await present(pair ? (await ask("named", { frame: pair.frame, a: String(pair.a), b: String(pair.b) })).pair : null, false);
  if (pair && state.pair) state.pair.origin = pair.origin;
});

function showModes() {
  at("whole").setAttribute("aria-pressed", !state.sampled);
  at("sampled").setAttribute("aria-pressed", state.sampled);
  at("blind").setAttribute("aria-pressed", state.blind);
  document.body.classList.toggle("blind", state.blind);
}

const setZoom = (by) => queue(() => {
  state.zoom = Math.min(2, Math.max(0, state.zoom + by));
  return showCrop();
});

const setOutlines = () => queue(() => {
  state.outlines = !state.outlines;
  return showCrop();
});

const setWhole = () => queue(() => {
  state.whole = !state.whole;
  return showPicture();
});

const KEYS = {
  c: () => judge("contact"), 1: () => judge("contact"), n: () => judge("no contact"), 2: () => judge("no contact"),
  u: () => judge("unsure"), 3: () => judge("unsure"), z: undo, " ": next, ArrowRight: next,
  "]": () => turn(1), PageDown: () => turn(1), "[": () => turn(-1), PageUp: () => turn(-1),
  m: () => setMode(!state.sampled), b: () => setBlind(!state.blind), o: setOutlines, "+": () => setZoom(1), "=": () => setZoom(1),
  "-": () => setZoom(-1), w: setWhole, g: () => at("named").focus(), r: () => flag("rearrangement"), t: () => flag("reset"),
  i: () => flag("ignore"), "?": () => at("keys").showModal(),
};

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || at("keys").open) return;
  const inField = event.target instanceof HTMLInputElement && event.target.closest("#panel");
  if (inField) {
    event.stopPropagation();
    if (event.key === "Escape" || event.key === "Enter") event.target.blur();
    return;
  }
  if (event.key === " " && event.target instanceof HTMLButtonElement) return; // the button's own key
  const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!act) return;
  event.preventDefault();
  event.stopPropagation(); // the viewer has keys of its own
  if (state.viewer) state.viewer.leave();
  if (!event.repeat) act();
}

function connect() {
  window.addEventListener("keydown", onKey, { capture: true });
  const buttons = {
    contact: () => judge("contact"), "no-contact": () => judge("no contact"), unsure: () => judge("unsure"), undo, next,
    "next-frame": () => turn(1), former: () => turn(-1), later: () => turn(1), whole: () => setMode(false),
    sampled: () => setMode(true), blind: () => setBlind(!state.blind), nearer: () => setZoom(1), farther: () => setZoom(-1),
    outline: setOutlines, help: () => at("keys").showModal(),
  };
  for (const [id, act] of Object.entries(buttons)) at(id).addEventListener("click", act);
  for (const name of FLAGS) at(name).addEventListener("click", () => flag(name));
  at("named").addEventListener("change", (event) => event.target.value.trim() && goTo(event.target.value));
  at("reviewer").addEventListener("change", (event) => queue(async () => {
    state.reviewer = event.target.value.trim() || state.reviewer;
    event.target.value = state.reviewer;
    sessionStorage.setItem("reviewer", state.reviewer);
    await present((await ask("next")).pair);
  }));
  at("crop").addEventListener("click", (event) => {
    if (!state.pair || event.target.closest("button")) return;
    const box = at("crop").getBoundingClientRect();
    const view = state.pair.windows[state.zoom];
    pick(
      view.left + ((event.clientX - box.left) / box.width) * view.width,
      view.top + ((event.clientY - box.top) / box.height) * view.height,
    );
  });
  // Another tab may have spoken meanwhile.
  document.addEventListener("visibilitychange", () => document.hidden || queue(() => Promise.all([showPicture(false), showStatus()])));
}

async function begin() {
  state.about = await ask("open");
  state.reviewer = sessionStorage.getItem("reviewer") || state.about.reviewer || "reviewer";
  at("reviewer").value = state.reviewer;
  at("name").textContent = state.about.name;
  document.title = `${state.about.name} – contact review`;
  connect();
  await queue(async () => present((await ask("next")).pair));
  try {
    state.viewer = await startViewer(at("viewer"), pick);
    await queue(() => showPicture());
    at("loading").hidden = true;
  } catch (error) {
    at("loading").textContent = `The picture could not be started (${error.message || error}). Judging goes on with the crop.`;
  }
}

begin().catch((error) => toast(error.message || String(error), 60000));
