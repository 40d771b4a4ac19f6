// The recording in the web viewer of the installed wheel, loaded when somebody asks for it. Its handle is no documented
// interface, so it is touched here only. The page's frame and the viewer's are one: whoever moves, the other follows.

import { ask, h } from "/page/dom.js";

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

const RETRY = 150; // [ms] after which a viewer that was busy painting is asked again

export class Recording {
  /** told: { frame(k), clicked(x, y, what) } hears what a person does in the viewer; x, y in pixels of the photograph. */
  constructor(box, at, told) { Object.assign(this, { box, at, told, handle: null, wanted: 0, heard: null, opened: false, sending: false, closed: false, panels: false, shrink: 1, timeline: TIMELINE }); }

  async open(frame) {
    this.wanted = frame;
    const note = h("p", { class: "note", role: "status" }, "Opening the recording …");
    this.box.replaceChildren(note);
    this.box.hidden = false;
    console.debug = () => {}; // the viewer tells its inner life there, which costs a slow machine seconds
    try {
      const { addresses, shrink, bytes } = await ask("recording", { at: this.at });
      this.shrink = shrink;
      note.textContent = `Opening the recording (${(bytes / 1e6).toFixed(0)} MB) …`;
      const { default: viewer } = await import("/viewer/script.js");
      await viewer({ module_or_path: "/viewer/module.wasm" });
      if (this.closed) return;
      const canvas = h("canvas", { id: "viewer", tabIndex: 0, "aria-label": "The recording" });
      this.box.prepend(canvas);
      this.handle = new viewer.WebHandle({
        url: addresses.map((address) => location.origin + address), hide_welcome_screen: true, render_backend: "webgl", persist: false, notebook: false,
        enable_history: false, theme: "dark", // whatever the page is: labels over dark pictures are hard to read in light
        panel_state_overrides: Object.fromEntries(PANELS.map((name) => [name, "Hidden"])),
        on_viewer_event: (event) => { this.hear(typeof event === "string" ? JSON.parse(event) : event); },
      });
      await this.handle.start(canvas);
      note.remove();
    } catch (error) {
      note.textContent = `The recording cannot be shown here: ${error.message ?? error}. The viewer needs WebAssembly and WebGL 2; rodsight view shows it in a window of its own.`;
    }
  }

  hear(event) {
    if (this.closed) return;
    if (event.type === "recording_open") { this.opened = true; this.send(); }
    if (event.type === "timeline_change" || event.type === "time_update") this.moved(event);
    if (event.type !== "selection_change") return;
    const item = event.items?.find((each) => each.type === "entity" && each.position);
    if (item) this.told.clicked(item.position[0] * this.shrink - 0.5, item.position[1] * this.shrink - 0.5, item.entity_path);
  }

  /** The viewer is somewhere: where it was sent, or where a person took it. */
  moved(event) {
    this.timeline = event.timeline ?? this.timeline;
    const frame = Math.round(event.time);
    if (this.timeline !== TIMELINE || !Number.isFinite(frame)) return;
    this.heard = frame;
    if (this.sending || !this.opened || frame === this.wanted) return;
    this.wanted = frame;
    this.told.frame(frame);
  }

  /** Go to a frame; a viewer that is still opening goes there when it has opened. */
  show(frame) { if (frame !== this.wanted) { this.wanted = frame; this.send(); } }

  async send() {
    if (this.sending || !this.opened) return;
    this.sending = true;
    while (!this.closed && this.heard !== this.wanted) {
      const frame = this.wanted;
      try { await this.handle.viewer_control(cursorAt(frame)); } catch { await new Promise((done) => setTimeout(done, RETRY)); continue; }
      if (!this.closed && this.heard !== frame) await new Promise((done) => setTimeout(done, RETRY)); // it tells of it once it has painted
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
