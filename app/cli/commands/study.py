"""The command that measures the method against truth: study."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import tyro

from ...errors import InputError
from ...synthetic.worlds.names import WorldName
from ..arguments import Quiet, Settings
from ..terminal import progress_of, table_console
from .run import Request, open_run

if TYPE_CHECKING:
    from ...study.worlds.world_score import WorldPlan


@dataclass(frozen=True, slots=True)
class _Asked:
    """What studies of worlds are asked for."""

    plan: WorldPlan
    worlds: tuple[WorldName, ...]  # none: those that the study chooses
    seeds: tuple[int, ...]
    out: Path
    quiet: bool


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
            "budget",
            "real",
            "perturbation",
        ],
        tyro.conf.Positional,
        tyro.conf.arg(
            help="the paper's claims; r against noise; trust and status refitted; coverage of error bars; what "
            "laboratories bring, as simulated worlds; every statistic against the truth's; what stated "
            "intervals of forces cover, by groups of contacts, and their constants fitted anew; all of that as one "
            "page, and what does not hold; what `check` promises from the first photographs beside what comes out; a "
            "run against forces that were measured; how far forces move when next to nothing is changed"
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
    ensemble: Annotated[
        int | None,
        tyro.conf.arg(
            metavar="K",
            help="uncertainty: sequences solved again, default 8; intervals: what they add to the deviations",
        ),
    ] = None,
    worlds: Annotated[tuple[WorldName, ...], tyro.conf.arg(help="of them only these")] = (),
    jobs: Annotated[int, tyro.conf.arg(metavar="N", help="worlds: processes")] = 1,
    fit: Annotated[
        tuple[int, ...],
        tyro.conf.arg(metavar="SEED", help="intervals, numbers, budget: fit constants on these, too"),
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
    from ...study.worlds.world_score import WorldPlan
    from ...synthetic.worlds.making import GRAINS

    chosen = (*settings, "solver.estimator=nlgs") if subject == "worlds" and estimator == "nlgs" else settings
    plan = WorldPlan(GRAINS if grains is None else grains, out / "worlds", chosen)
    asked = _Asked(plan, worlds, seeds, out, quiet)
    if subject == "report" and frame is None:
        return _study_report(asked, page, as_json=as_json)
    for option, value in (("--page", page), ("--frame", frame)):
        if value is not None:
            raise InputError("study", f"{option} with {subject}", "is for real only")
    if subject == "perturbation":
        return _study_perturbation(folder, asked)
    if folder is not None:
        raise InputError("study", f"{folder} with {subject}", "a path is for real and perturbation only")
    if subject == "worlds":
        return _study_worlds(asked, jobs=jobs, as_json=as_json)
    if subject == "numbers":
        return _study_numbers(asked, fit=fit)
    if subject == "intervals":
        return _study_intervals(asked, fit=fit, members=ensemble or 0)
    if subject == "budget":
        return _study_budget(asked, fit=fit)
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
                seeds[:half], seeds[half:], members=8 if ensemble is None else ensemble, grains=grains,
                estimator=estimator, folder=out,
                console=console, progress=progress,
            )  # fmt: skip
        elif subject == "status":
            refit_status(seeds[:half], seeds[half:], grains=(grains,), folder=out, console=console, progress=progress)
        else:
            study_claims(seeds, grains=grains, folder=out, console=console, progress=progress)
    return 0


def _study_real(folder: Path | None, page: Path | None, frame: int | None, *, as_json: bool) -> int:
    from ...experiment.experiment import load_experiment
    from ...results.hdf5.store import load_results, origin_of
    from ...run_folder import RESULTS, Run, find_experiment
    from ...run_truth import load_truth
    from ...study.real import real_forces, real_page

    if folder is None:
        raise InputError("study real", "RUN", "is missing: the folder of a run, such as runs/my_test")
    file = folder / RESULTS if folder.is_dir() else folder
    results, origin = load_results(file), origin_of(file)
    run = Run(load_experiment(find_experiment(file, origin)), file.parent, origin.frames)
    truth = load_truth(run, results)
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


def _study_perturbation(experiment: Path | None, asked: _Asked) -> int:
    from ... import pipeline
    from ...study.worlds.perturbation import on_told_grains, perturb_world, print_perturbations, study_perturbations

    console = table_console()
    if experiment is not None:
        with open_run(Request(experiment, asked.plan.settings, asked.quiet)) as run:
            inputs, results, truth = pipeline.solved_inputs(run)
            bodies, walls = results.grains.count + results.walls.count, results.walls.count
            true = None if truth is None else truth.by_frame(bodies, len(results.frames))
            told = inputs.tracks.grain_count
            known = None if true is None else [on_told_grains(*each, bodies, walls, told) for each in true]
            effects = study_perturbations(inputs, known, progress=run.progress)
        print_perturbations(console, run.experiment.name, effects)
        return 0
    for world in asked.worlds or get_args(WorldName):
        for seed in asked.seeds:
            with progress_of(asked.quiet) as progress:
                effects = perturb_world(
                    world,
                    seed,
                    grains=asked.plan.grains,
                    folder=asked.plan.folder,
                    settings=asked.plan.settings,
                    progress=progress,
                )
            print_perturbations(console, f"{world}, seed {seed}", effects)
    return 0


def _study_worlds(asked: _Asked, *, jobs: int, as_json: bool) -> int:
    from ...study.worlds.world_table import WIDTH, print_worlds, study_worlds
    from ...study.worlds.world_table import as_json as worlds_as_json

    if jobs < 1:
        raise InputError("--jobs", str(jobs), "must be at least one")
    worlds = asked.worlds or get_args(WorldName)
    with progress_of(asked.quiet) as progress:
        scores = study_worlds(asked.plan, worlds, asked.seeds, jobs=jobs, progress=progress)
    if as_json:
        print(json.dumps(worlds_as_json(scores), indent=1))
    else:
        print_worlds(table_console(WIDTH), scores)
    return 0


def _study_numbers(asked: _Asked, *, fit: tuple[int, ...]) -> int:
    from ...study.worlds.numbers import (
        FIT_WORLDS,
        WORLDS,
        compare_numbers,
        fit_deviations,
        print_by_world,
        print_numbers,
    )
    from ...study.worlds.solved_world import solve_worlds
    from ...study.worlds.world_table import WIDTH

    console = table_console(WIDTH)
    with progress_of(asked.quiet) as progress:
        if fit:
            known = [
                each for one in solve_worlds(asked.plan, FIT_WORLDS, fit, progress) for each in compare_numbers(one)
            ]  # fmt: skip
            for name, told in fit_deviations(known).items():
                console.print(f"{name}: {', '.join(f'{each:.2g}' for each in told)}", highlight=False)
        solved = solve_worlds(asked.plan, asked.worlds or WORLDS, asked.seeds, progress)
        found = [each for one in solved for each in compare_numbers(one)]
    print_numbers(console, found)
    print_by_world(console, found, "sliding_fraction")
    return 0


def _study_intervals(asked: _Asked, *, fit: tuple[int, ...], members: int) -> int:
    from ...study.worlds import interval_fit, intervals
    from ...study.worlds.contact_errors import ContactErrors, measure_errors
    from ...study.worlds.solved_world import solve_worlds
    from ...study.worlds.world_table import WIDTH

    console = table_console(WIDTH)
    with progress_of(asked.quiet) as progress:
        if fit:
            known = interval_fit.errors_of_fit(asked.plan, fit, progress)
            interval_fit.print_fit(console, interval_fit.fit_intervals(known))
            intervals.print_intervals(console, "On the worlds and seeds of the fit, constants in use", known)
        worlds = asked.worlds or intervals.JUDGE_WORLDS
        judged, widened = [], []
        for each in solve_worlds(asked.plan, worlds, asked.seeds, progress, members=members):
            judged.append(measure_errors(each))
            widened += [measure_errors(each, widened=True)] if members else []
    title = "Share of contacts within one and two stated deviations, %"
    intervals.print_intervals(console, title, ContactErrors.joined(judged))
    if members:
        told = f"The same with the spread of {members} sequences solved again"
        intervals.print_intervals(console, told, ContactErrors.joined(widened))
    return 0


def _study_budget(asked: _Asked, *, fit: tuple[int, ...]) -> int:
    from ...study.worlds import promises

    console = table_console()
    worlds = asked.worlds or promises.WORLDS
    with progress_of(asked.quiet) as progress:
        if fit:
            found = promises.fit_promise(promises.study_promises(asked.plan, worlds, fit, progress))
            console.print(f"Fitted on seeds {' '.join(map(str, fit))}: {found}", highlight=False)
        kept = promises.study_promises(asked.plan, worlds, asked.seeds, progress)
    promises.print_promises(console, kept)
    return 0


def _study_report(asked: _Asked, page: Path | None, *, as_json: bool) -> int:
    """Write the calibration report. Exit status 1 where something that is stated does not hold."""
    from ...study.report.calibration_report import study_calibration
    from ...study.report.report_page import report_page
    from ...study.worlds.numbers import WORLDS

    with progress_of(asked.quiet) as progress:
        found = study_calibration(asked.plan, asked.worlds or WORLDS, asked.seeds, progress)
    facts = found.facts()
    file = asked.out / "report.html" if page is None else page
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(report_page(found), encoding="utf-8")
    if as_json:
        print(json.dumps(facts, indent=1))
    else:
        told = facts["broken"] or ["all that is stated holds within its limits"]
        table_console().print(f"{file}: {'; '.join(told)}.", highlight=False, soft_wrap=True)
    return 1 if facts["broken"] else 0
