// The recording in the web viewer of the installed wheel, loaded at the first request. Its handle is no documented
// interface and is used only here. The page and the viewer show the same frame: a change of one moves the other.

import { request, h } from "/page/dom.js";

const TIMELINE = "frame", PANELS = ["top", "blueprint", "selection", "time"];

/** A whole number, text or bytes as a field of a protocol buffer. */
function field(number, value) {
  const varint = (n) => { const out = []; let rest = BigInt.asUintN(64, BigInt(n)); do { const low = Number(rest & 127n); rest >>= 7n; out.push(rest ? low | 128 : low); } while (rest); return out; };
  if (typeof value === "number") return [...varint(number << 3), ...varint(value)];
  return [...varint((number << 3) | 2), ...varint(value.length), ...value];
}

/** rerun.viewer_control.v1alpha1.ViewerControlRequest.set_time_cursor: this timeline, there, paused. */
function cursorAt(frame) {
  const name = [...new TextEncoder().encode(TIMELINE)];
  return new Uint8Array(field(6, [...field(2, field(1, name)), ...field(3, field(1, frame)), ...field(5, 1)]));
}

/**
 * The viewer sizes its canvas by the device pixels that a ResizeObserver reports. Where the browser reports pixels of the
 * page instead (a zoomed or emulated screen), everything is drawn at double size: here they are corrected.
 */
export function correctDevicePixels() {
  const Native = globalThis.ResizeObserver;
  if (Native.corrected) return;
  const over = (object, values) => new Proxy(object, { get: (target, key) => { if (Object.hasOwn(values, key)) return values[key]; const value = target[key]; return typeof value === "function" ? value.bind(target) : value; } });
  const correct = (entry) => {
    const page = entry.contentBoxSize?.[0], device = entry.devicePixelContentBoxSize?.[0];
    if (!page || !device) return entry;
    const inlineSize = Math.round(page.inlineSize * devicePixelRatio), blockSize = Math.round(page.blockSize * devicePixelRatio);
    if (Math.abs(device.inlineSize - inlineSize) <= 1 && Math.abs(device.blockSize - blockSize) <= 1) return entry;
    return over(entry, { devicePixelContentBoxSize: [over(device, { inlineSize, blockSize })] });
  };
  globalThis.ResizeObserver = class extends Native { constructor(callback) { super((entries, observer) => callback(entries.map(correct), observer)); } };
  globalThis.ResizeObserver.corrected = true;
}

const RETRY = 150; // [ms] until the next attempt where the viewer was busy

export class Recording {
  /** listener: { frame(k), clicked(x, y, path) }, called at actions in the viewer; x, y in pixels of the photograph. */
  constructor(box, at, listener) { Object.assign(this, { box, at, listener, handle: null, wanted: 0, reported: null, opened: false, sending: false, closed: false, panels: false, shrink: 1, timeline: TIMELINE }); }

  async open(frame) {
    this.wanted = frame;
    const note = h("p", { class: "note", role: "status" }, "Opening the recording …");
    this.box.replaceChildren(note);
    this.box.hidden = false;
    console.debug = () => {}; // the viewer writes so much there that a slow machine loses seconds
    try {
      const { addresses, shrink, bytes } = await request("recording", { at: this.at });
      this.shrink = shrink;
      note.textContent = `Opening the recording (${(bytes / 1e6).toFixed(0)} MB) …`;
      correctDevicePixels();
      const { default: viewer } = await import("/viewer/script.js");
      await viewer({ module_or_path: "/viewer/module.wasm" });
      if (this.closed) return;
      const canvas = h("canvas", { id: "viewer", tabIndex: 0, role: "application", "aria-label": "The recording" });
      this.box.prepend(canvas);
      this.handle = new viewer.WebHandle({
        url: addresses.map((address) => location.origin + address), hide_welcome_screen: true, render_backend: "webgl", persist: false, notebook: false,
        enable_history: false, theme: "dark", // whatever the page is: labels over dark pictures are hard to read in light
        panel_state_overrides: Object.fromEntries(PANELS.map((name) => [name, "Hidden"])),
        on_viewer_event: (event) => { this.onEvent(typeof event === "string" ? JSON.parse(event) : event); },
      });
      await this.handle.start(canvas);
      note.remove();
    } catch (error) {
      note.textContent = `The recording cannot be shown here: ${error.message ?? error}. The viewer needs WebAssembly and WebGL 2; rodsight view shows it in a window of its own.`;
    }
  }

  onEvent(event) {
    if (this.closed) return;
    if (event.type === "recording_open") { this.opened = true; this.send(); }
    if (event.type === "timeline_change" || event.type === "time_update") this.moved(event);
    if (event.type !== "selection_change") return;
    const item = event.items?.find((each) => each.type === "entity" && each.position);
    if (item) this.listener.clicked(item.position[0] * this.shrink - 0.5, item.position[1] * this.shrink - 0.5, item.entity_path);
  }

  /** The viewer shows another frame: the one that was sent, or one that the user chose. */
  moved(event) {
    this.timeline = event.timeline ?? this.timeline;
    const frame = Math.round(event.time);
    if (this.timeline !== TIMELINE || !Number.isFinite(frame)) return;
    this.reported = frame;
    if (this.sending || !this.opened || frame === this.wanted) return;
    this.wanted = frame;
    this.listener.frame(frame);
  }

  /** Go to a frame; a viewer that is still opening goes there when it has opened. */
  show(frame) { if (frame !== this.wanted) { this.wanted = frame; this.send(); } }

  async send() {
    if (this.sending || !this.opened) return;
    this.sending = true;
    while (!this.closed && this.reported !== this.wanted) {
      const frame = this.wanted;
      try { await this.handle.viewer_control(cursorAt(frame)); } catch { await new Promise((done) => setTimeout(done, RETRY)); continue; }
      if (!this.closed && this.reported !== frame) await new Promise((done) => setTimeout(done, RETRY)); // it reports the frame after painting
    }
    this.sending = false;
  }

  /** The viewer's own panels: entities, selection, time. */
  toggle() { this.panels = !this.panels; this.handle?.toggle_panel_overrides(!this.panels); }

  close() {
    this.closed = true;
    if (this.handle) { this.handle.destroy(); this.handle.free(); this.handle = null; }
    this.box.hidden = true;
    this.box.replaceChildren();
  }
}
