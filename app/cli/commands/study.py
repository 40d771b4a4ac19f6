"""Commands that ask how far the forces may be trusted: sensitivity, study."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from ...errors import InputError
from ...synthetic.worlds.names import WorldName
from ..arguments import ExperimentPath, Frames, Out, Quiet, Settings
from ..terminal import progress_of, table_console
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


def study(
    subject: Annotated[
        Literal[
            "paper",
            "accuracy",
            "status",
            "uncertainty",
            "worlds",
            "numbers",
            "intervals",
            "report",
            "real",
            "perturbation",
        ],
        tyro.conf.Positional,
        tyro.conf.arg(
            help="the paper's claims; r against noise; trust and status refitted; coverage of error bars; what "
            "laboratories bring, as simulated worlds; every statistic against the truth's; what stated "
            "intervals of forces cover, by groups of contacts, and their constants fitted anew; all of that as one "
            "page, and what does not hold; a run "
            "against forces that were measured; how far forces move when next to nothing is changed"
        ),
    ],
    folder: Annotated[
        Path | None,
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="PATH",
            help="real: folder of a run, or results.h5; perturbation: an experiment, instead of --worlds",
        ),
    ] = None,
    /,
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(help="of the simulated packings")] = (0, 1, 2),
    grains: Annotated[int | None, tyro.conf.arg(help="rods of a packing; default 1172, of worlds 450")] = None,
    estimator: Annotated[
        Literal["ensemble", "nlgs"], tyro.conf.arg(help="mean of seven solutions, or one chain")
    ] = "ensemble",
    ensemble: Annotated[int, tyro.conf.arg(metavar="K", help="uncertainty: sequences solved again")] = 8,
    worlds: Annotated[tuple[WorldName, ...], tyro.conf.arg(help="of them only these")] = (),
    jobs: Annotated[int, tyro.conf.arg(metavar="N", help="worlds: processes")] = 1,
    fit: Annotated[
        tuple[int, ...], tyro.conf.arg(metavar="SEED", help="intervals, numbers: fit the constants on these seeds, too")
    ] = (),
    settings: Settings = (),
    out: Annotated[Path, tyro.conf.arg(metavar="DIR", help="where simulated truths are kept")] = Path("runs/study"),
    as_json: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(name="json", help="worlds, real: print JSON")
    ] = False,
    page: Annotated[
        Path | None,
        tyro.conf.arg(
            metavar="OUT.html",
            help="real: pictures side by side, true, inferred and baseline; report: the page, default report.html",
        ),
    ] = None,
    frame: Annotated[int | None, tyro.conf.arg(help="real: the frame of the pictures; default: the middle one")] = None,
    quiet: Quiet = False,
) -> int:
    """Measure the method on simulated truth: minutes for each packing, kept for the next time.

    Worlds that are finished are kept; --worlds, --jobs, --set and --json are for worlds.

    Some of them: rodsight study worlds --seeds 1 --worlds shear gravity; of one's own: rodsight study perturbation
    sample_data/shear

    Photoelastic forces: rodsight import pegs, rodsight run, then rodsight study real runs/my_test --page real.html

    Example: rodsight study worlds --worlds shear --seeds 1 --grains 150
    """
    if subject == "real":
        return _study_real(folder, page, frame, as_json=as_json)
    if subject == "report" and frame is None:
        return _study_report(worlds, seeds, grains, out, settings, page, as_json=as_json, quiet=quiet)
    for option, value in (("--page", page), ("--frame", frame)):
        if value is not None:
            raise InputError("study", f"{option} with {subject}", "is for real only")
    if subject == "perturbation":
        return _study_perturbation(folder, worlds, seeds, grains, out, settings, quiet=quiet)
    if folder is not None:
        raise InputError("study", f"{folder} with {subject}", "a path is for real and perturbation only")
    if subject == "worlds":
        if estimator == "nlgs":
            settings = (*settings, "solver.estimator=nlgs")
        return _study_worlds(worlds, seeds, grains, out, settings, jobs=jobs, as_json=as_json, quiet=quiet)
    if subject == "numbers":
        return _study_numbers(worlds, seeds, grains, out, settings, fit=fit, quiet=quiet)
    if subject == "intervals":
        return _study_intervals(worlds, seeds, grains, out, settings, fit=fit, quiet=quiet)
    for option, given in (("--worlds", worlds), ("--jobs", jobs != 1), ("--set", settings), ("--json", as_json)):
        if given:
            raise InputError("study", f"{option} with {subject}", "is for worlds only")
    grains = 1172 if grains is None else grains
    from ...study.accuracy import study_accuracy
    from ...study.claims import study_claims
    from ...study.report.status import refit_status
    from ...study.report.uncertainty import study_uncertainty

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


def _study_real(folder: Path | None, page: Path | None, frame: int | None, *, as_json: bool) -> int:
    from ... import pipeline
    from ...experiment.experiment import load_experiment
    from ...results.hdf5.store import load_results, origin_of
    from ...run_folder import RESULTS, Run, find_experiment
    from ...study.real import real_forces, real_page

    if folder is None:
        raise InputError("study real", "RUN", "is missing: the folder of a run, such as runs/my_test")
    file = folder / RESULTS if folder.is_dir() else folder
    results, origin = load_results(file), origin_of(file)
    run = Run(load_experiment(find_experiment(file, origin)), file.parent, origin.frames)
    truth = pipeline.load_truth(run, results)
    if truth is None or run.experiment.config.truth is None:
        raise InputError(run.experiment.file, "key truth", "is missing: there are no measured forces to compare with")
    sides = real_forces.correlate_sides(
        run.experiment.folder / run.experiment.config.truth, origin.frames[0], len(results.frames)
    )
    found = real_forces.study_real(results, truth, sides, frame)
    if page is not None:
        page.write_text(real_page.real_page(found), encoding="utf-8")
    if as_json:
        print(json.dumps(real_forces.as_json(found), indent=1))
        return 0
    real_page.print_real(table_console(real_page.WIDTH), found)
    if page is not None:
        table_console().print(f"Pictures of frame {found.shown}: {page}", highlight=False)
    return 0


def _study_perturbation(
    experiment: Path | None,
    worlds: tuple[WorldName, ...],
    seeds: tuple[int, ...],
    grains: int | None,
    out: Path,
    settings: tuple[str, ...],
    *,
    quiet: bool,
) -> int:
    from ... import pipeline
    from ...study.worlds.perturbation import on_told_grains, perturb_world, print_perturbations, study_perturbations
    from ...synthetic.worlds.making import GRAINS

    console = table_console()
    if experiment is not None:
        with open_run(Request(experiment, settings, quiet)) as run:
            inputs, results, truth = pipeline.solved_inputs(run)
            bodies, walls = results.grains.count + results.walls.count, results.walls.count
            true = None if truth is None else truth.by_frame(bodies, len(results.frames))
            told = inputs.tracks.grain_count
            known = None if true is None else [on_told_grains(*each, bodies, walls, told) for each in true]
            effects = study_perturbations(inputs, known, progress=run.progress)
        print_perturbations(console, run.experiment.name, effects)
        return 0
    count = GRAINS if grains is None else grains
    for world in worlds or get_args(WorldName):
        for seed in seeds:
            with progress_of(quiet) as progress:
                effects = perturb_world(
                    world, seed, grains=count, folder=out / "worlds", settings=settings, progress=progress
                )
            print_perturbations(console, f"{world}, seed {seed}", effects)
    return 0


def _study_worlds(
    worlds: tuple[WorldName, ...],
    seeds: tuple[int, ...],
    grains: int | None,
    out: Path,
    settings: tuple[str, ...],
    *,
    jobs: int,
    as_json: bool,
    quiet: bool,
) -> int:
    from ...study.worlds.world_score import WorldPlan
    from ...study.worlds.world_table import WIDTH, print_worlds, study_worlds
    from ...study.worlds.world_table import as_json as worlds_as_json
    from ...synthetic.worlds.making import GRAINS

    if jobs < 1:
        raise InputError("--jobs", str(jobs), "must be at least one")
    plan = WorldPlan(GRAINS if grains is None else grains, out / "worlds", settings)
    with progress_of(quiet) as progress:
        scores = study_worlds(plan, worlds or get_args(WorldName), seeds, jobs=jobs, progress=progress)
    if as_json:
        print(json.dumps(worlds_as_json(scores), indent=1))
    else:
        print_worlds(table_console(WIDTH), scores)
    return 0


def _study_numbers(
    worlds: tuple[WorldName, ...],
    seeds: tuple[int, ...],
    grains: int | None,
    out: Path,
    settings: tuple[str, ...],
    *,
    fit: tuple[int, ...],
    quiet: bool,
) -> int:
    from ...study.worlds.numbers import FIT_WORLDS, WORLDS, compare_numbers, fit_deviations, print_numbers
    from ...study.worlds.solved_world import solve_worlds
    from ...study.worlds.world_score import WorldPlan
    from ...study.worlds.world_table import WIDTH
    from ...synthetic.worlds.making import GRAINS

    plan = WorldPlan(GRAINS if grains is None else grains, out / "worlds", settings)
    console = table_console(WIDTH)
    with progress_of(quiet) as progress:
        if fit:
            known = [
                each for one in solve_worlds(plan, FIT_WORLDS, fit, progress) for each in compare_numbers(one)
            ]  # fmt: skip
            for name, told in fit_deviations(known).items():
                console.print(f"{name}: {', '.join(f'{each:.2g}' for each in told)}", highlight=False)
        found = [each for one in solve_worlds(plan, worlds or WORLDS, seeds, progress) for each in compare_numbers(one)]
    print_numbers(console, found)
    return 0


def _study_intervals(
    worlds: tuple[WorldName, ...],
    seeds: tuple[int, ...],
    grains: int | None,
    out: Path,
    settings: tuple[str, ...],
    *,
    fit: tuple[int, ...],
    quiet: bool,
) -> int:
    from ...study.worlds import intervals
    from ...study.worlds.contact_errors import ContactErrors, measure_errors
    from ...study.worlds.solved_world import solve_worlds
    from ...study.worlds.world_score import WorldPlan
    from ...synthetic.worlds.making import GRAINS

    plan = WorldPlan(GRAINS if grains is None else grains, out / "worlds", settings)
    console = table_console()
    with progress_of(quiet) as progress:
        if fit:
            known = ContactErrors.joined([
                measure_errors(each) for each in solve_worlds(plan, intervals.FIT_WORLDS, fit, progress)
            ])  # fmt: skip
            intervals.print_fit(console, intervals.fit_intervals(known))
            intervals.print_intervals(console, "On the worlds and seeds of the fit, constants in use", known)
        judged = [
            measure_errors(each) for each in solve_worlds(plan, worlds or intervals.JUDGE_WORLDS, seeds, progress)
        ]
    intervals.print_intervals(
        console, "Share of contacts within one and two stated deviations, %", ContactErrors.joined(judged)
    )
    return 0


def _study_report(
    worlds: tuple[WorldName, ...],
    seeds: tuple[int, ...],
    grains: int | None,
    out: Path,
    settings: tuple[str, ...],
    page: Path | None,
    *,
    as_json: bool,
    quiet: bool,
) -> int:
    """Write the calibration report. Exit status 1 where something that is stated does not hold."""
    from ...study.report.calibration_report import study_calibration
    from ...study.report.report_page import report_page
    from ...study.worlds.numbers import WORLDS
    from ...study.worlds.world_score import WorldPlan
    from ...synthetic.worlds.making import GRAINS

    plan = WorldPlan(GRAINS if grains is None else grains, out / "worlds", settings)
    with progress_of(quiet) as progress:
        found = study_calibration(plan, worlds or WORLDS, seeds, progress)
    facts = found.facts()
    file = out / "report.html" if page is None else page
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(report_page(found), encoding="utf-8")
    if as_json:
        print(json.dumps(facts, indent=1))
    else:
        told = facts["broken"] or ["all that is stated holds within its limits"]
        table_console().print(f"{file}: {'; '.join(told)}.", highlight=False, soft_wrap=True)
    return 1 if facts["broken"] else 0
