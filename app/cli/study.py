"""Commands that ask how far the forces may be trusted: sensitivity, study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ..errors import InputError
from .arguments import ExperimentPath, Frames, Out, Quiet, Settings
from .run import Request, open_run
from .terminal import progress_of, table_console


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
    from .. import pipeline
    from ..sensitivity import design as designs
    from ..sensitivity import report
    from ..sensitivity import study as runs
    from ..sensitivity.execution import available_cores, reach_scheduler

    if workers is not None and workers < 1:
        raise InputError("--workers", str(workers), "must be at least one")
    console = table_console(report.WIDTH, quiet=quiet)
    request = Request(experiment, settings, quiet, out, frames)
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


def study(
    subject: Annotated[
        Literal["paper", "accuracy", "status", "uncertainty"],
        tyro.conf.Positional,
        tyro.conf.arg(help="the paper's claims; r against noise; trust and status refitted; coverage of error bars"),
    ],
    /,
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="of the simulated packings")] = (0, 1, 2),
    grains: Annotated[int, tyro.conf.arg(help="rods of a packing")] = 1172,
    estimator: Literal["ensemble", "nlgs"] = "ensemble",
    ensemble: Annotated[int, tyro.conf.arg(metavar="K", help="uncertainty: sequences solved again")] = 8,
    out: Annotated[Path, tyro.conf.arg(metavar="DIR", help="where simulated truths are kept")] = Path("runs/study"),
    quiet: Quiet = False,
) -> int:
    """Measure the method on simulated truth: minutes for each packing, kept for the next time.

    Example: rodsight study paper --seeds 0 1 --grains 400
    """
    from ..study.accuracy import study_accuracy
    from ..study.claims import study_claims
    from ..study.status import refit_status
    from ..study.uncertainty import study_uncertainty

    console = table_console()
    if subject in ("status", "uncertainty") and len(seeds) < 2:
        raise InputError("--seeds", " ".join(map(str, seeds)), "must be two or more: to fit on, and to judge on")
    half = (len(seeds) + 1) // 2
    with progress_of(quiet) as progress:
        if subject == "accuracy":
            study_accuracy(seeds, grains=grains, folder=out, estimator=estimator, console=console, progress=progress)
        elif subject == "uncertainty":
            study_uncertainty(
                seeds[:half], seeds[half:], members=ensemble, grains=grains, estimator=estimator, folder=out,
                console=console, progress=progress,
            )  # fmt: skip
        elif subject == "status":
            refit_status(seeds[:half], seeds[half:], grains=(grains,), folder=out, console=console, progress=progress)
        else:
            study_claims(seeds, grains=grains, folder=out, console=console, progress=progress)
    return 0
