// Step 1: which photographs, in which order, when, and what of them is looked at.

import { colour, digits, fact, h, numberField, parse, tell } from "/page/dom.js";

let cutting = null;

export const photographs = {
  name: "photographs", title: "Photographs", frames: true,
  hint: () => (cutting ? "Drag over the part that is to be looked at" : ""),
  leave: () => { cutting = null; },
  panel(app) {
    const { project } = app, told = project.photographs;
    return [
      h("p", {}, "They are taken in the natural order of their names: 2 comes before 10."),
      fact("photographs", String(project.files.length)),
      fact("size", project.width ? `${project.width} × ${project.height} px` : "–"),
      h("div", { class: "field" }, h("label", { htmlFor: "field-name" }, "name"), h("input", { id: "field-name", value: project.name, onchange: (event) => app.change("set_photographs", { name: event.target.value }) })),
      told.times ? fact("times", told.times) : numberField("interval", told.interval, "s", (text) => app.queue(async () => {
        app.change("set_photographs", { interval: parse(text, "interval") });
      })),
      h("div", { class: "field" }, h("label", { htmlFor: "field-channel" }, "channel"), h("select", { id: "field-channel", onchange: (event) => app.change("set_photographs", { channel: event.target.value }) },
        ["grey", "red", "green", "blue"].map((name) => h("option", { value: name, selected: name === (told.channel ?? "grey") }, name)))),
      h("div", { class: "row" },
        h("button", { class: cutting ? "on" : "", id: "cut", onclick: () => { cutting = cutting ? null : []; app.tool(cutting ? cutTool(app) : null); app.paint(); } }, told.region ? "Change the region" : "Cut to a region"),
        told.region ? h("button", { onclick: () => app.change("set_photographs", { region: "all" }) }, "Use all of it") : null),
      h("h3", {}, "Order"),
      h("div", { class: "list" }, project.files.slice(0, 400).map((name, k) => h("button", { class: k === app.frame ? "here" : "", onclick: () => app.show(k) },
        h("span", { class: "soft" }, String(k)), h("span", { style: { flex: "1" } }, name), h("span", { class: "soft" }, told.interval ? `${digits(k * told.interval, 4)} s` : "")))),
    ];
  },
  draw(app, c, k) {
    const region = cutting?.length ? cutting : app.project.photographs.region;
    if (!region) return;
    const [x0, y0, x1, y1] = region;
    c.fillStyle = "#000a";
    c.beginPath(); c.rect(-0.5, -0.5, app.project.width, app.project.height); c.rect(x0, y0, x1 - x0, y1 - y0); c.fill("evenodd");
    c.strokeStyle = colour("accent"); c.lineWidth = 2 / k; c.strokeRect(x0, y0, x1 - x0, y1 - y0);
  },
};

function cutTool(app) {
  const box = (a, b) => [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[0], b[0]), Math.max(a[1], b[1])];
  return {
    cross: true, down: () => true,
    drag: (p, event, from) => { cutting = box(from, p); },
    up: (p, event, from, moved) => {
      if (!moved) return;
      const { width, height } = app.project;
      const [x0, y0, x1, y1] = box(from, p).map(Math.round);
      const region = [Math.max(x0, 0), Math.max(y0, 0), Math.min(x1, width - 1), Math.min(y1, height - 1)];
      cutting = null; app.tool(null);
      if (region[2] - region[0] < 20 || region[3] - region[1] < 20) { tell("That region is too small", true); app.paint(); return; }
      app.change("set_photographs", { region });
    },
  };
}
