// The web viewer of the installed wheel, embedded. Its handle is no documented interface, so it is touched here only.

const CHANNEL = "review";

/**
 * Keep idle pointer moves from the viewer. It would pick and outline what lies below the pointer at every move, which
 * takes a software renderer more than a second a picture. A click needs its own place only; so does a wheel.
 */
function calm(canvas) {
  let passing = false;
  const hold = (event) => {
    if (event.target !== canvas || event.buttons || passing) return;
    event.stopImmediatePropagation();
  };
  for (const kind of ["mousemove", "pointermove", "mouseover", "pointerover"]) window.addEventListener(kind, hold, { capture: true });
  const tell = (event) => {
    if (event.target !== canvas) return;
    passing = true; // the viewer clicks and zooms at the place that it knows
    canvas.dispatchEvent(new MouseEvent("mousemove", { clientX: event.clientX, clientY: event.clientY, bubbles: true }));
    passing = false;
  };
  for (const kind of ["pointerdown", "wheel"]) window.addEventListener(kind, tell, { capture: true, passive: true });
  return () => canvas.dispatchEvent(new MouseEvent("mouseleave"));
}

/** Start the viewer on a canvas. onClick(x, y, path, instance) is told what was clicked, in pixels of the picture. */
export async function startViewer(canvas, theme, onClick) {
  if (!globalThis.WebAssembly || !canvas.ownerDocument.createElement("canvas").getContext("webgl2")) {
    throw new Error("this browser draws no WebGL");
  }
  console.debug = () => {}; // the viewer tells its inner life there, which costs a slow machine seconds
  await wasm_bindgen({ module_or_path: "/re_viewer_bg.wasm" });
  const leave = calm(canvas);
  const handle = new wasm_bindgen.WebHandle({
    url: [],
    hide_welcome_screen: true,
    render_backend: "webgl",
    persist: false,
    notebook: false,
    enable_history: false,
    theme,
    panel_state_overrides: { top: "Hidden", blueprint: "Hidden", selection: "Hidden", time: "Hidden" },
    on_viewer_event: (told) => {
      const event = typeof told === "string" ? JSON.parse(told) : told;
      if (event.type !== "selection_change") return;
      setTimeout(leave, 50);
      const item = event.items.find((each) => each.type === "entity" && each.position);
      if (item && Number.isFinite(item.position[0]) && Number.isFinite(item.position[1])) {
        onClick(item.position[0], item.position[1], item.entity_path, item.instance_id);
      }
    },
  });
  await handle.start(canvas);
  handle.open_channel(CHANNEL, CHANNEL);
  canvas.addEventListener("pointerup", () => setTimeout(leave, 1500)); // a click that changed no selection
  return { show: (bytes) => handle.send_rrd_to_channel(CHANNEL, bytes), leave };
}
