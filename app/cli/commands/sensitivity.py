"""The command that varies uncertain inputs: sensitivity."""

from __future__ import annotations

import json
from typing import Annotated, Literal

from tyro.conf import arg

from ..arguments import (
    AsJson,
    ExperimentPath,
    Flag,
    Frames,
    Out,
    Quiet,
    Scheduler,
    Settings,
    Workers,
    refuse_unused,
    worker_count,
)
from ..run_request import Request, open_run
from ..terminal import table_console


def sensitivity(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    frames: Frames = None,
    settings: Settings = (),
    design: Annotated[
        Literal["oat", "sobol"], arg(help="one factor at a time, or all at once in a space-filling design")
    ] = "oat",
    factors: Annotated[
        tuple[str, ...], arg(metavar="NAME[=LOW:HIGH]", help="factors to vary, with their ranges; default: all")
    ] = (),
    samples: Annotated[int | None, arg(metavar="N", help="runs of --design sobol; default 64")] = None,
    seed: Annotated[int, arg(help="of the noise and of the design")] = 0,
    workers: Workers = None,
    scheduler: Scheduler = None,
    budget: Annotated[
        Flag, arg(help="instead attribute each frame's error to its causes, and store that with the results")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Vary uncertain inputs and measure how much the forces depend on them.

    Factors and their ranges: friction, wall_friction (× 0.8 to 1.2); precision, overlap, kappa, sweeps, and threshold
    of a single chain (× 0.5 to 2); position_noise, rotation_noise (1 to 2 standard deviations more); radius_scatter
    (0.05 to 0.1 %); radius_error, pixel_size (± 0.05 %); reset (at rearrangements, at one photograph); spacing (every
    second photograph); first_frame (1 to 3 later). In experiment.toml: [sensitivity.ranges] friction = [0.7, 1.3].

    Example: rodsight sensitivity sample_data/shear --factors friction=0.7:1.3 kappa
    """
    from ... import pipeline
    from ...robustness import design as designs
    from ...robustness import report
    from ...robustness import study as runs
    from ...robustness.execution import reach_scheduler

    if budget:
        given = {"--design": design == "sobol", "--factors": factors, "--samples": samples, "--seed": seed or None}
        refuse_unused("sensitivity", given | {"--scheduler": scheduler}, "with --budget")
    processes = worker_count(workers)
    console = table_console(report.WIDTH, quiet=quiet)
    request = Request(experiment, settings, quiet, out, frames)
    if budget:
        return _attribute_error(request, processes, as_json=as_json)
    with open_run(request) as run:
        pipeline.keep_finished_frames(run)
        varied, cases = designs.plan(run.experiment, design, factors, samples, seed)
        if scheduler is not None:
            reach_scheduler(scheduler)
        nominal, fingerprint = pipeline.nominal_run(run)
        effects = runs.run_study(
            nominal, cases, runs.EffectLog(run.file(runs.EFFECT_LOG), fingerprint),
            workers=processes, scheduler=scheduler, progress=run.progress,
        )  # fmt: skip
        own = runs.compare(nominal.networks, nominal)
        results = report.SensitivityResults(run.experiment.name, design, varied, cases, effects, own)
        report.save_sensitivity(results, run.folder)
    if as_json:
        print(json.dumps(report.as_json(results), indent=1))
        return 0
    report.print_sensitivity(console, results)
    console.print(f"Tables in {run.folder}/: {', '.join(report.FILES)}.", highlight=False)
    return 0


def _attribute_error(request: Request, workers: int, *, as_json: bool) -> int:
    from ... import pipeline
    from ...results.summary import summarize
    from ..summary_table import budget_lines

    with open_run(request) as run:
        pipeline.keep_finished_frames(run)
        summary = summarize(pipeline.add_error_budget(run, workers), None, {})
    if as_json:
        print(json.dumps(summary["error_budget"], indent=1))
        return 0
    console = table_console(quiet=request.quiet)
    for line in budget_lines(summary):
        console.print(line, highlight=False, soft_wrap=True)
    console.print(
        f"Fractions by frame: frames/error_budget in {run.folder}/results.h5; rodsight record draws them.",
        highlight=False,
        soft_wrap=True,
    )
    return 0
