// The web viewer of the installed wheel, embedded. Its handle is no documented interface, so it is touched here only.

const CHANNEL = "review";

/** Start the viewer on a canvas. onClick(x, y, path, instance) is told what was clicked, in pixels of the picture. */
export async function startViewer(canvas, theme, onClick) {
  if (!globalThis.WebAssembly || !canvas.ownerDocument.createElement("canvas").getContext("webgl2")) {
    throw new Error("this browser draws no WebGL");
  }
  await wasm_bindgen({ module_or_path: "/re_viewer_bg.wasm" });
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
      const item = event.items.find((each) => each.type === "entity" && each.position);
      if (item && Number.isFinite(item.position[0]) && Number.isFinite(item.position[1])) {
        onClick(item.position[0], item.position[1], item.entity_path, item.instance_id);
      }
    },
  });
  await handle.start(canvas);
  handle.open_channel(CHANNEL, CHANNEL);
  return { show: (bytes) => handle.send_rrd_to_channel(CHANNEL, bytes) };
}
