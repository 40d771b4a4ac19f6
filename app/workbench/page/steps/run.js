// Step 6: the run: started, paused, resumed, cancelled; forces appear while it is in progress.

import { request, digits, fact, h, sign, notify } from "/page/dom.js";
import { drawLegends } from "/page/layers/colours.js";
import { drawNetwork, loadLook, networkLegends } from "/page/layers/network.js";
import { showLanes } from "/page/time/lanes.js";
import { runMark } from "/page/parts/run_state.js";
import { force } from "/page/units.js";

let source = null, job = null, facts = null, net = null, watching = null, following = true, alarmed = 0, predicted = null;

export const run = {
  name: "run", title: "Run", layered: true, layers: ["photograph", "forces", "uncertainty"],
  dim: 0.75,
  ofRun: true, mark: runMark,
  enter(app) { app.queue(loadLook); listen(app); },
  leave() { source?.close(); source = null; watching = null; net = null; job = null; facts = null; predicted = null; },
  moved(app) { following = facts ? app.frame >= facts.count - 1 : true; load(app); },
  panel(app) {
    const { project } = app, state = job?.state ?? "idle", busy = state === "running" || state === "pausing";
    return [
      project.ready ? h("p", {}, "The same as ", h("kbd", {}, `rodsight run ${quoted(project.at)}`), " typed in this folder. Pausing costs one frame at most.") : [h("p", {}, "Something is missing:"), h("div", { class: "list", id: "lacks" }, lacks(app))],
      h("div", { class: "row" },
        busy
          ? [h("button", { id: "pause", disabled: state === "pausing", onclick: () => act(app, "run_pause") }, state === "pausing" ? "Pausing …" : "Pause"), h("button", { disabled: state === "pausing", onclick: () => act(app, "run_cancel") }, "Cancel")]
          : [h("button", { class: "primary", id: "run", disabled: !project.ready, onclick: () => act(app, "run_start") }, state === "paused" || project.run?.unfinished ? "Go on" : project.run?.frames !== undefined ? "Run again" : "Run"),
            h("button", { id: "follow", disabled: !project.ready, title: "Wait for further photographs in the folder, and solve them as they come", onclick: () => act(app, "run_start", { follow: true }) }, "Follow a running test")]),
      busy ? null : h("div", { class: "row" }, h("button", { id: "prediction", disabled: !project.ready, title: "The first twelve photographs are tracked and solved: their evidence predicts the accuracy of the forces", onclick: () => predict(app) }, "Predict the accuracy")),
      predicted?.at === project.at ? h("div", { class: "messages", id: "predicted" }, predicted.messages.map((text) => h("p", {}, sign(predicted.mark), text))) : null,
      job && state !== "idle" ? h("div", { class: "card" },
        h("div", { class: "fact" }, h("span", {}, "the run"), h("span", { id: "run-state" }, state)),
        job.stages.map((stage) => h("div", {}, h("div", { class: "fact" }, h("span", {}, stage.label), h("span", {}, `${stage.done} of ${stage.total}${stage.left !== null && stage.done < stage.total && busy ? ` · ${time(stage.left)} left` : ""}`)),
          h("div", { class: "meter" }, h("i", { style: { width: `${100 * stage.done / Math.max(stage.total, 1)}%` } }))))) : null,
      job?.alarms.length ? h("div", { class: "messages" }, job.alarms.slice(-5).map((each) => h("p", {}, h("span", { class: "sign doubtful" }, "!"), `Frame ${each.frame}: ${each.alarm}`))) : null,
      facts ? [h("h2", {}, facts.provisional ? "So far" : "Found"),
        fact("frames", `${facts.first ? `${facts.first} to ${facts.count - 1}` : facts.count} of ${project.files.length || project.frames}`),
        solved(app) ? [fact("status", facts.status[app.frame]), fact("trust", digits(facts.trust[app.frame], 2)), fact("contacts", String(facts.contacts[app.frame])), fact("mean f_n", force(facts.mean_fn[app.frame])), fact("friction angle", `${digits(facts.friction_angle[app.frame], 3)}°`), fact("rods lost", String(facts.lost[app.frame]))] : null] : null,
      job?.messages.length ? [h("h2", {}, "Messages"), h("div", { class: "log", id: "log", tabIndex: 0, role: "log", "aria-label": "Messages of the run" }, job.messages.slice(-40).join("\n"))] : null,
    ];
  },
  draw(app, c, k) {
    if (!net || net.frame !== app.frame) return;
    drawNetwork(c, k, app.stage, net);
  },
  legend(app, c, k) { if (net && net.frame === app.frame) drawLegends(app, c, k, networkLegends(net)); },
  timeline(app) { showLanes(app, facts); },
};

/** The steps without which a run cannot begin, each a click away. */
const lacks = (app) => [
  ...app.project.steps.filter((step) => step.mark === "missing").map((step) => h("button", { onclick: () => app.goTo(step.name) }, sign("missing"), h("span", { class: "two" }, h("b", {}, step.name[0].toUpperCase() + step.name.slice(1)), h("span", { class: "soft" }, step.messages[0] ?? "")))),
  ...app.project.other_messages.map((text) => h("div", {}, sign("missing"), h("span", { class: "two" }, text))),
];

const solved = (app) => facts !== null && app.frame >= facts.first && app.frame < facts.count;
const quoted = (text) => (/[^\w./-]/.test(text) ? `"${text}"` : text);
const time = (seconds) => (seconds < 90 ? `${Math.max(1, Math.round(seconds))} s` : `${Math.round(seconds / 60)} min`);

function act(app, what, values = {}) { app.queue(async () => { job = await request(what, { at: app.project.at, ...values }); app.paint(); }, "", what); }

function predict(app) { app.queue(async () => { predicted = { at: app.project.at, ...await request("prediction", { at: app.project.at }) }; app.paint(); }, "Tracking the first photographs …"); }

function listen(app) {
  const { at } = app.project;
  following = true; alarmed = 0;
  source?.close();
  source = new EventSource(`/events?${new URLSearchParams({ at })}`);
  source.onmessage = (event) => {
    if (app.step !== run || app.project?.at !== at) return;
    const news = JSON.parse(event.data);
    const finished = job && job.state !== "finished" && news.job.state === "finished";
    job = news.job; facts = news.frames ?? facts;
    if (news.files !== undefined && news.files !== app.project.files.length) finishedNow(app);
    if (job.alarms.length > alarmed) { alarmed = job.alarms.length; const last = job.alarms.at(-1); notify(`Frame ${last.frame}: ${last.alarm}`, true); }
    if (facts && following && facts.count) app.frame = facts.count - 1;
    app.paint(); load(app);
    if (finished) finishedNow(app);
  };
}

function finishedNow(app) { app.queue(async () => { const project = await request("project", { at: app.project.at }); net = null; app.take(project); load(app); }); }

/** The network of the frame that is shown: the newest, unless another one was chosen. */
function load(app) {
  if (!solved(app)) return;
  const wanted = `${app.frame} ${facts.provisional}`;
  if (watching === wanted && net?.frame === app.frame) return;
  watching = wanted;
  request("network", { at: app.project.at, frame: app.frame }).then((answer) => { if (watching === wanted) { net = answer; app.stage.redraw(); } }, () => { watching = null; });
}
