// The web viewer of the installed wheel, embedded. Its handle is no documented interface, so it is touched here only.

const CHANNEL = "review";

const DRAG = 5; // pixels from which on a press is a drag

/**
 * Make the pointer easy for a viewer that draws slowly. An idle pointer is kept from it: at every move it would pick
 * and outline what lies below, for more than a second a picture in software. And a press waits for its release, so that
 * both come in one picture: a press that lasts longer than 0.8 s, be it for slow drawing, is no click to the viewer.
 */
function calm(canvas) {
  let passing = false;
  let press = null;
  let waiting = false; // for the answer to a click
  const leave = () => canvas.dispatchEvent(new MouseEvent("mouseleave"));
  const pass = (kind, event, buttons) => {
    passing = true;
    const { clientX, clientY, pointerId, pointerType, shiftKey, ctrlKey, altKey, metaKey } = event;
    const same = { clientX, clientY, pointerId, pointerType, shiftKey, ctrlKey, altKey, metaKey };
    const make = kind.startsWith("pointer") ? PointerEvent : MouseEvent;
    canvas.dispatchEvent(new make(kind, { ...same, button: 0, buttons, bubbles: true, cancelable: true }));
    passing = false;
  };
  const release = () => {
    const event = press;
    press = null;
    pass("mousemove", event, 0);
    pass("pointerdown", event, 1);
  };
  // It tells of a click one picture later, and draws that only when something happens.
  const nudge = (event, times) => setTimeout(() => {
    if (!waiting || !times) return leave();
    pass("mousemove", event, 0);
    nudge(event, times - 1);
  }, 120);
  const on = (kind, act) => window.addEventListener(kind, act, { capture: true, passive: true });
  const still = (event) => {
    if (passing || event.target !== canvas) return;
    if (press && Math.hypot(event.clientX - press.clientX, event.clientY - press.clientY) > DRAG) release();
    if (!event.buttons || press) event.stopImmediatePropagation();
  };
  for (const kind of ["mousemove", "pointermove", "mouseover", "pointerover"]) on(kind, still);
  on("pointerdown", (event) => {
    if (passing || event.target !== canvas || event.button !== 0) return;
    press = event;
    event.stopImmediatePropagation();
  });
  on("pointerup", (event) => {
    if (passing || !press) return;
    press = null;
    event.stopImmediatePropagation();
    pass("mousemove", event, 0); // the viewer must have drawn the pointer there once before it takes a click
    const click = () => {
      pass("pointerdown", event, 1);
      pass("pointerup", event, 0);
    };
    waiting = true;
    requestAnimationFrame(() => requestAnimationFrame(() => {
      click();
      nudge(event, 12);
    }));
  });
  on("pointercancel", () => (press = null));
  on("wheel", (event) => event.target === canvas && pass("mousemove", event, 0)); // it zooms at the place it knows
  const answered = () => {
    waiting = false;
    leave();
  };
  return { leave, answered };
}

/** Start the viewer on a canvas. onClick(x, y) is told what was clicked, in pixels of the picture. */
export async function startViewer(canvas, onClick) {
  if (!globalThis.WebAssembly || !canvas.ownerDocument.createElement("canvas").getContext("webgl2")) {
    throw new Error("this browser draws no WebGL");
  }
  console.debug = () => {}; // the viewer tells its inner life there, which costs a slow machine seconds
  await wasm_bindgen({ module_or_path: "/re_viewer_bg.wasm" });
  const { leave, answered } = calm(canvas);
  const handle = new wasm_bindgen.WebHandle({
    url: [],
    hide_welcome_screen: true,
    render_backend: "webgl",
    persist: false,
    notebook: false,
    enable_history: false,
    theme: "dark", // whatever the page is: labels over dark pictures are hard to read in light
    panel_state_overrides: { top: "Hidden", blueprint: "Hidden", selection: "Hidden", time: "Hidden" },
    on_viewer_event: (told) => {
      const event = typeof told === "string" ? JSON.parse(told) : told;
      if (event.type !== "selection_change") return;
      setTimeout(answered);
      const item = event.items.find((each) => each.type === "entity" && each.position);
      if (item && Number.isFinite(item.position[0]) && Number.isFinite(item.position[1])) {
        onClick(item.position[0], item.position[1]);
      }
    },
  });
  await handle.start(canvas);
  handle.open_channel(CHANNEL, CHANNEL);
  return { show: (bytes) => handle.send_rrd_to_channel(CHANNEL, bytes), leave };
}
