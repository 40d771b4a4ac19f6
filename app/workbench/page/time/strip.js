// A strip of photographs beside one another: its canvas, its mouse, the colours of their states.

import { colour } from "/page/dom.js";

// Those of the recording (STATUS_COLOURS), which differ in every kind of colour vision.
export const TONES = { reset: "#bcb4f4", suspect: "#e56d7a", rearranging: "#f9dd73", settling: "#3288e7", settled: "#0f6a31", failed: "#52102c" };

/** A press on a canvas, and a movement after it, go to the photograph that is there. */
export function dragFrames(app, canvas, count) {
  const go = (event) => { const { left, width } = canvas.getBoundingClientRect(); app.show(Math.floor((event.clientX - left) / width * count)); };
  canvas.addEventListener("pointerdown", (event) => { go(event); const move = (later) => go(later); addEventListener("pointermove", move); addEventListener("pointerup", () => removeEventListener("pointermove", move), { once: true }); });
}

/** An empty strip, sharp on every screen: its context, the width of a photograph, its size. */
export function begin(canvas, count) {
  const dense = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight, c = canvas.getContext("2d");
  canvas.width = width * dense; canvas.height = height * dense;
  c.scale(dense, dense);
  c.fillStyle = colour("ground"); c.fillRect(0, 0, width, height);
  return { c, step: width / count, width, height };
}
