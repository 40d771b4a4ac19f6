// An experiment that gives tracks has no photographs: what the steps show that set them up or correct them.

import { fact, h } from "/page/dom.js";

/** Whether a step has nothing to work on in the open experiment. */
export const lacksPhotographs = (app, step = app.step) => Boolean(app.project?.tracked && step.ofPhotographs);

export function givenTracks(app) {
  const { project, step } = app, number = project.run?.rods;
  return [
    h("p", { id: "given-tracks" }, `This experiment has no photographs: its rods, their motion and its walls are given by the tables that experiment.toml names. ${step.name === "correct" ? "A wrong track is corrected in its table." : "They are changed in these tables, not in this step."}`),
    fact("frames", String(project.frames)),
    number ? fact("rods", String(number)) : null,
    h("div", { class: "row" }, h("button", { onclick: () => app.goTo("material") }, "To the material"), h("button", { onclick: () => app.goTo("run") }, "To the run")),
    step.withTracks?.(app),
  ];
}
