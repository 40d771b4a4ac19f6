"""The command that varies what nobody knows exactly: sensitivity."""

from __future__ import annotations

import json
from typing import Annotated, Literal

import tyro

from ...errors import InputError
from ..arguments import ExperimentPath, Frames, Out, Quiet, Settings
from ..terminal import table_console
from .run import Request, open_run


def sensitivity(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    frames: Frames = None,
    settings: Settings = (),
    design: Annotated[
        Literal["oat", "sobol"], tyro.conf.arg(help="one factor at a time, or all at once in a space-filling design")
    ] = "oat",
    factors: Annotated[
        tuple[str, ...],
        tyro.conf.arg(metavar="NAME[=LOW:HIGH]", help="what is varied, and over what range; default: everything"),
    ] = (),
    samples: Annotated[int | None, tyro.conf.arg(metavar="N", help="runs of --design sobol; default 64")] = None,
    seed: Annotated[int, tyro.conf.arg(help="of the noise and of the design")] = 0,
    workers: Annotated[int | None, tyro.conf.arg(metavar="N", help="processes; default: one for every core")] = None,
    scheduler: Annotated[
        str | None, tyro.conf.arg(metavar="ADDRESS", help="run on the machines of this dask scheduler instead")
    ] = None,
    budget: Annotated[
        bool,
        tyro.conf.FlagCreatePairsOff,
        tyro.conf.arg(help="instead divide each frame's error among its causes, and store that with the results"),
    ] = False,
    as_json: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(name="json", help="print JSON")] = False,
    quiet: Quiet = False,
) -> int:
    """Vary what nobody knows exactly, and see how much the forces depend on it.

    Factors and their ranges: friction, wall_friction (× 0.8 to 1.2); precision, overlap, kappa, sweeps, and threshold
    of a single chain (× 0.5 to 2); position_noise, rotation_noise (1 to 2 standard deviations more); radius_scatter
    (0.05 to 0.1 %); radius_error, pixel_size (± 0.05 %); reset (at rearrangements, at one photograph); spacing (every
    second photograph); first_frame (1 to 3 later). In experiment.toml: [sensitivity.ranges] friction = [0.7, 1.3].

    Example: rodsight sensitivity sample_data/shear --factors friction=0.7:1.3 kappa
    """
    from solver.together import available_cores

    from ... import pipeline
    from ...sensitivity import design as designs
    from ...sensitivity import report
    from ...sensitivity import study as runs
    from ...sensitivity.execution import reach_scheduler

    if workers is not None and workers < 1:
        raise InputError("--workers", str(workers), "must be at least one")
    console = table_console(report.WIDTH, quiet=quiet)
    request = Request(experiment, settings, quiet, out, frames)
    if budget:
        return _divide_error(request, workers or available_cores(), as_json=as_json)
    with open_run(request) as run:
        varied, cases = designs.plan(run.experiment, design, factors, samples, seed)
        if scheduler is not None:
            reach_scheduler(scheduler)
        nominal, fingerprint = pipeline.nominal_run(run)
        effects = runs.run_study(
            nominal, cases, runs.Diary(run.file(runs.DIARY), fingerprint),
            workers=available_cores() if workers is None else workers, scheduler=scheduler, progress=run.progress,
        )  # fmt: skip
        own = runs.compare(nominal.networks, nominal)
        findings = report.Findings(run.experiment.name, design, varied, cases, effects, own)
        report.save_findings(findings, run.folder)
    if as_json:
        print(json.dumps(report.as_json(findings), indent=1))
        return 0
    report.print_findings(console, findings)
    console.print(f"Tables in {run.folder}/: {', '.join(report.FILES)}.", highlight=False)
    return 0


def _divide_error(request: Request, workers: int, *, as_json: bool) -> int:
    from ... import pipeline
    from ...results.summary import summarize
    from ..summary_table import budget_lines

    with open_run(request) as run:
        summary = summarize(pipeline.add_error_budget(run, workers), None, {})
    if as_json:
        print(json.dumps(summary["error_budget"], indent=1))
        return 0
    console = table_console(quiet=request.quiet)
    for line in budget_lines(summary):
        console.print(line, highlight=False, soft_wrap=True)
    console.print(
        f"Shares by frame: frames/error_budget in {run.folder}/results.h5; rodsight record draws them.",
        highlight=False,
        soft_wrap=True,
    )
    return 0
