"use strict";
async function open() {
  const note = document.getElementById("note");
  try {
    await wasm_bindgen({ module_or_path: "/re_viewer_bg.wasm" });
    const { files, key } = document.body.dataset;
    const handle = new wasm_bindgen.WebHandle({
      url: Array.from({ length: Number(files) }, (_, k) => `${location.origin}/${key}/${k}.rrd`),
      hide_welcome_screen: true, persist: false, notebook: false, enable_history: false, theme: "dark",
      render_backend: new URLSearchParams(location.search).get("renderer") ?? undefined,
    });
    await handle.start(document.getElementById("view"));
    note.remove();
  } catch (error) {
    note.textContent = "This browser cannot show the recording: " + error +
      "\nIt needs WebAssembly and WebGL 2 or WebGPU. Adding &renderer=webgl to the printed address may help.";
  }
}
open();
