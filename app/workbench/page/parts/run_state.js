// The run as the steps after it see it: whether there are forces, and the reasons not to take them as they are.

/** good: forces that belong to the files as they are, in every photograph; doubtful: there are faults; missing: none. */
export function runMark(app) {
  const { run } = app.project;
  if (run?.frames === undefined) return run?.unfinished ? "doubtful" : "missing";
  return run.faults.length ? "doubtful" : "good";
}

/** The run in the bar of the page. */
export function standing(project) {
  const { run } = project;
  if (!run || run.frames === undefined) return run?.unfinished ? "unfinished run" : project.ready ? "ready to run" : "being set up";
  const words = [`${run.frames} frames solved`];
  if (run.trust !== null) words.push(`T ≥ ${run.trust.toFixed(2)}`);
  if (run.status?.failed) words.push(`${run.status.failed} failed`);
  if (run.causes) words.push("something is wrong");
  if (run.out_of_date.length) words.push("out of date");
  return words.join(" · ");
}
