"""The command that measures the method against truth: study."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import tyro

from ...process.atomic import write_atomically
from ...process.errors import InputError
from ...synthetic.scenarios.preset_names import ScenarioName
from ..arguments import AsJson, Quiet, Settings
from ..terminal import print_line, progress_of, table_console
from .run import Request, open_run

# Of the simulated apparatus on which --program compares.
APPARATUS_GRAINS, APPARATUS_FRAMES, APPARATUS_RADIUS_ERROR = 300, 60, -0.02

if TYPE_CHECKING:
    from ...study.scenarios.scenario_score import StudyPlan


@dataclass(frozen=True, slots=True)
class _StudyRequest:
    """The arguments that studies of scenarios share."""

    plan: StudyPlan
    scenarios: tuple[ScenarioName, ...]  # empty: the default of the study
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
            "trust",
            "mixture",
            "numbers",
            "intervals",
            "report",
            "budget",
            "real",
            "fringes",
            "perturbation",
        ],
        tyro.conf.Positional,
        tyro.conf.arg(
            help="the paper's claims; r against noise; fit of trust and status; coverage of error bars; simulated "
            "scenarios of laboratory data; trust against r by kind of input, and its fit; fit of the weights of "
            "the two estimates; every statistic against the truth; coverage of the intervals of forces by "
            "groups of contacts, and a fit of their constants; all of that as one page, with what is outside "
            "its limits; the accuracy that `check` predicts from the first photographs beside the result; a run "
            "against measured forces; simulated photoelastic discs with and without "
            "fringes; the change of forces by small changes of input"
        ),
    ],
    folder: Annotated[
        Path | None,
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="PATH",
            help="real: a run, or files of PeGS, to be solved; perturbation, paper --program: an experiment with truth",
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
            help="solutions with resampled input; uncertainty: default 8; intervals: adds their standard deviation",
        ),
    ] = None,
    scenarios: Annotated[
        tuple[ScenarioName, ...], tyro.conf.arg(name="worlds", help="only these scenarios; default: all")
    ] = (),
    varied: Annotated[
        tuple[int, ...], tyro.conf.arg(metavar="SEED", help="seeds that draw step, stiffness, friction, noise … too")
    ] = (),
    jobs: Annotated[int, tyro.conf.arg(metavar="N", help="worlds, trust: processes")] = 1,
    fit: Annotated[
        tuple[int, ...],
        tyro.conf.arg(metavar="SEED", help="trust, intervals, numbers: also fit the constants on these seeds"),
    ] = (),
    settings: Settings = (),
    out: Annotated[Path, tyro.conf.arg(metavar="DIR", help="cache of simulated truths and scores")] = Path(
        "runs/study"
    ),
    as_json: AsJson = False,
    page: Annotated[
        Path | None,
        tyro.conf.arg(
            metavar="OUT.html",
            help="real: pictures side by side, true, inferred and baseline; report: the page, default report.html",
        ),
    ] = None,
    frame: Annotated[int | None, tyro.conf.arg(help="real: the frame of the pictures; default: the middle one")] = None,
    program: Annotated[
        Literal["authors"] | None,
        tyro.conf.arg(
            help="paper: score the recipe of the authors' own program beside the paper's and this one, on PATH or on "
            "the apparatus of the preset 1g2e with radii 2 % too small"
        ),
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Measure the method on simulated truth: minutes for each packing, stored for the next time.

    Finished scores are stored; --worlds, --jobs, --set and --json apply to worlds, --json also to real and report.

    Some scenarios: rodsight study worlds --seeds 1 --worlds shear gravity; an experiment: rodsight study perturbation
    sample_data/shear

    The recipe of the authors' program: rodsight study paper --program authors --seeds 0

    Photoelastic forces, files of PeGS: rodsight study real FOLDER --page real.html; of a run: rodsight study real
    runs/my_test

    Example: rodsight study worlds --worlds shear --seeds 1 --grains 150
    """
    if subject in ("real", "fringes"):
        from ..measured_forces import study_fringes, study_measured

        if subject == "fringes":
            return study_fringes(seeds, 200 if grains is None else grains, out, quiet=quiet)
        return study_measured(folder, page, frame, as_json=as_json)
    from ...study.scenarios.scenario_score import StudyPlan
    from ...synthetic.scenarios.scenario_folder import GRAINS

    chosen = (*settings, "solver.estimator=nlgs") if subject == "worlds" and estimator == "nlgs" else settings
    plan = StudyPlan(GRAINS if grains is None else grains, out / "worlds", chosen, frozenset(varied))
    request = _StudyRequest(plan, scenarios, seeds, out, quiet)
    if unused := sorted(set(varied) - {*seeds, *fit}):
        raise InputError("--varied", " ".join(map(str, unused)), "is neither one of --seeds nor of --fit")
    if subject == "report" and frame is None:
        return _study_report(request, page, as_json=as_json)
    for option, value in (("--page", page), ("--frame", frame)):
        if value is not None:
            raise InputError("study", f"{option} with {subject}", "applies to real only")
    if program is not None:
        if subject != "paper":
            raise InputError("study", f"--program with {subject}", "applies to paper only")
        return _study_programs(folder, request, APPARATUS_GRAINS if grains is None else grains)
    if subject == "perturbation":
        return _study_perturbation(folder, request)
    if folder is not None:
        raise InputError("study", f"{folder} with {subject}", "a path applies to real, perturbation, paper --program")
    if subject == "worlds":
        return _study_worlds(request, jobs=jobs, as_json=as_json)
    if subject == "trust":
        return _study_trust(request, jobs=jobs, fit=fit)
    if subject == "mixture":
        return _study_mixture(request)
    if subject == "numbers":
        return _study_numbers(request, fit=fit)
    if subject == "intervals":
        return _study_intervals(request, fit=fit, members=ensemble or 0)
    if subject == "budget":
        return _study_budget(request)
    for option, given in (("--worlds", scenarios), ("--jobs", jobs != 1), ("--set", settings), ("--json", as_json)):
        if given:
            raise InputError("study", f"{option} with {subject}", "applies to worlds only")
    grains = 1172 if grains is None else grains
    from ...study.accuracy import study_accuracy
    from ...study.claims import study_claims
    from ...study.report.status import refit_status
    from ...study.report.uncertainty import study_uncertainty

    console = table_console()
    if subject in ("status", "uncertainty") and len(seeds) < 2:
        raise InputError("--seeds", " ".join(map(str, seeds)), "must be two or more: one half to fit, one to judge")
    half = (len(seeds) + 1) // 2
    with progress_of(quiet) as progress:
        if subject == "accuracy":
            study_accuracy(seeds, grains=grains, folder=out, estimator=estimator, console=console, progress=progress)
        elif subject == "uncertainty":
            study_uncertainty(
                (seeds[:half], seeds[half:]), members=8 if ensemble is None else ensemble, grains=grains,
                estimator=estimator, folder=out, console=console, progress=progress,
            )  # fmt: skip
        elif subject == "status":
            refit_status(seeds[:half], seeds[half:], grains=(grains,), folder=out, console=console, progress=progress)
        else:
            study_claims(seeds, grains=grains, folder=out, console=console, progress=progress)
    return 0


def _study_perturbation(experiment: Path | None, request: _StudyRequest) -> int:
    from ... import pipeline
    from ...study.scenarios.perturbation import (
        on_given_grains,
        perturb_scenario,
        print_perturbations,
        study_perturbations,
    )

    console, plan = table_console(), request.plan
    if experiment is not None:
        with open_run(Request(experiment, plan.settings, request.quiet)) as run:
            inputs, results, truth = pipeline.solved_inputs(run)
            bodies, walls = results.grains.count + results.walls.count, results.walls.count
            true = None if truth is None else truth.by_frame(bodies, len(results.frames))
            given = inputs.tracks.grain_count
            known = None if true is None else [on_given_grains(*each, bodies, walls, given) for each in true]
            effects = study_perturbations(inputs, known, progress=run.progress)
        print_perturbations(console, run.experiment.name, effects)
        return 0
    for scenario in request.scenarios or get_args(ScenarioName):
        for seed in request.seeds:
            with progress_of(request.quiet) as progress:
                effects = perturb_scenario(
                    scenario, seed, grains=plan.grains, folder=plan.folder, settings=plan.settings, progress=progress
                )
            print_perturbations(console, f"{scenario}, seed {seed}", effects)
    return 0


def _study_programs(experiment: Path | None, request: _StudyRequest, grains: int) -> int:
    from ... import pipeline
    from ...study.program_comparison import RecipeScore, compare_programs, mean_scores, print_programs
    from ...synthetic.synthesis import SynthesisSettings, synthesize

    def score(folder: Path, out: Path | None) -> list[RecipeScore]:
        with open_run(Request(folder, request.plan.settings, request.quiet, out)) as run:
            inputs, results, truth = pipeline.solved_inputs(run)
            if truth is None:
                raise InputError(run.experiment.file, "key truth", "is missing: there are no forces to compare with")
            return compare_programs(inputs, results, truth, run.progress)

    console = table_console()
    if experiment is not None:
        print_programs(console, f"{experiment}: mean over the frames, errors rms", score(experiment, None))
        return 0
    found = []
    for seed in request.seeds:
        folder = request.out / "1g2e" / f"{grains}_{seed}"
        if not (folder / "experiment.toml").exists():
            with progress_of(request.quiet) as progress:
                synthesize(
                    folder,
                    SynthesisSettings(
                        preset="1g2e",
                        seed=seed,
                        photographs=False,
                        grains=grains,
                        frames=APPARATUS_FRAMES,
                        radius_error=APPARATUS_RADIUS_ERROR,
                    ),
                    progress=progress,
                )
        found.append(score(folder, folder.with_name(f"{folder.name}_run")))
    title = (
        f"Apparatus 1γ2ε, {grains} rods, radii 2 % too small, noise 10 µm, seeds {' '.join(map(str, request.seeds))}"
    )
    print_programs(console, title, mean_scores(found))
    return 0


def _study_worlds(request: _StudyRequest, *, jobs: int, as_json: bool) -> int:
    from ...study.scenarios import score_table

    if jobs < 1:
        raise InputError("--jobs", str(jobs), "must be at least one")
    scenarios = request.scenarios or get_args(ScenarioName)
    with progress_of(request.quiet) as progress:
        scores = score_table.score_scenarios(request.plan, scenarios, request.seeds, jobs=jobs, progress=progress)
    if as_json:
        print(json.dumps(score_table.as_json(scores), indent=1))
    else:
        score_table.print_scores(table_console(score_table.WIDTH), scores)
    return 0


def _study_trust(request: _StudyRequest, *, jobs: int, fit: tuple[int, ...]) -> int:
    import numpy as np

    from ...inference.diagnosis.trial import PREDICTED_PHOTOGRAPHS
    from ...study.scenarios import trust_study
    from ...study.scenarios.score_table import WIDTH, score_scenarios

    console = table_console(WIDTH)
    scenarios: tuple[ScenarioName, ...] = request.scenarios or get_args(ScenarioName)
    fits: dict[str, trust_study.TrustFit] = {}
    with progress_of(request.quiet) as progress:
        if fit:
            read: list[ScenarioName] = [name for name in scenarios if name not in trust_study.LEFT_OUT]
            read_scores = score_scenarios(request.plan, read, fit, jobs=jobs, progress=progress)
            fits = trust_study.fit_by_title(read_scores)
            closed = trust_study.CLOSED_KINDS if "both" in fits else ()
            still = score_scenarios(request.plan, closed, fit, jobs=jobs, progress=progress)
            for each in trust_study.describe_fits(fits, read_scores, still, PREDICTED_PHOTOGRAPHS):
                print_line(console, each)
        scores = score_scenarios(request.plan, scenarios, request.seeds, jobs=jobs, progress=progress)
    sample = trust_study.refit(trust_study.TrustSample.of(scores), fits)
    new = np.isin(sample.kind, list(trust_study.LEFT_OUT))
    trust_study.print_trust(console, "Kinds that the fit has read", sample.select(~new))
    trust_study.print_trust(console, "Kinds left out of the fit", sample.select(new))
    trust_study.print_scale(console, scores)
    return 0


def _study_mixture(request: _StudyRequest) -> int:
    from ...study.scenarios.mixture_fit import print_mixture, sample_mixtures

    with progress_of(request.quiet) as progress:
        samples = sample_mixtures(request.plan, request.scenarios or get_args(ScenarioName), request.seeds, progress)
    for each in samples:
        print_mixture(table_console(), each)
    return 0


def _study_numbers(request: _StudyRequest, *, fit: tuple[int, ...]) -> int:
    from ...study.scenarios import statistic_errors
    from ...study.scenarios.score_table import WIDTH
    from ...study.scenarios.solved_scenario import solve_scenarios

    console = table_console(WIDTH)

    def measure(scenarios: tuple[ScenarioName, ...], seeds: tuple[int, ...]) -> list[statistic_errors.StatisticErrors]:
        solved = solve_scenarios(request.plan, scenarios, seeds, progress)
        return [each for one in solved for each in statistic_errors.measure_statistic_errors(one)]

    with progress_of(request.quiet) as progress:
        if fit:
            constants = statistic_errors.fit_sd_constants(measure(statistic_errors.FIT_SCENARIOS, fit))
            for name, values in constants.items():
                console.print(f"{name}: {', '.join(f'{each:.2g}' for each in values)}", highlight=False)
        found = measure(request.scenarios or statistic_errors.SCENARIOS, request.seeds)
    statistic_errors.print_statistic_errors(console, found)
    statistic_errors.print_by_scenario(console, found, "sliding_fraction")
    return 0


def _study_intervals(request: _StudyRequest, *, fit: tuple[int, ...], members: int) -> int:
    from ...study.scenarios import interval_coverage, interval_fit
    from ...study.scenarios.contact_errors import ContactErrors, measure_errors
    from ...study.scenarios.score_table import WIDTH
    from ...study.scenarios.solved_scenario import solve_scenarios

    console = table_console(WIDTH)
    with progress_of(request.quiet) as progress:
        if fit:
            known = interval_fit.errors_of_fit(request.plan, fit, progress)
            interval_fit.print_fit(console, interval_fit.fit_intervals(known))
            title = "On the scenarios and seeds of the fit, with the constants in use"
            interval_coverage.print_intervals(console, title, known)
        scenarios = request.scenarios or interval_coverage.JUDGE_SCENARIOS
        judged, widened = [], []
        for each in solve_scenarios(request.plan, scenarios, request.seeds, progress, members=members):
            judged.append(measure_errors(each))
            widened += [measure_errors(each, widened=True)] if members else []
    title = "Percentage of contacts within one and two stated standard deviations"
    interval_coverage.print_intervals(console, title, ContactErrors.joined(judged))
    if members:
        title = f"The same with the standard deviation of {members} solutions with resampled input"
        interval_coverage.print_intervals(console, title, ContactErrors.joined(widened))
    return 0


def _study_budget(request: _StudyRequest) -> int:
    from ...study.scenarios import predictions

    console = table_console()
    scenarios = request.scenarios or predictions.COMPARED_SCENARIOS
    with progress_of(request.quiet) as progress:
        outcomes = predictions.study_predictions(request.plan, scenarios, request.seeds, progress)
    predictions.print_predictions(console, outcomes)
    return 0


def _study_report(request: _StudyRequest, page: Path | None, *, as_json: bool) -> int:
    """Write the calibration report. Exit status 1 if a quantity is outside its limits."""
    from ...study.report.calibration_report import study_calibration
    from ...study.report.report_page import report_page
    from ...study.scenarios.statistic_errors import SCENARIOS

    with progress_of(request.quiet) as progress:
        found = study_calibration(request.plan, request.scenarios or SCENARIOS, request.seeds, progress)
    facts = found.facts()
    file = request.out / "report.html" if page is None else page
    write_atomically(file, report_page(found).encode())
    if as_json:
        print(json.dumps(facts, indent=1))
    else:
        verdict = facts["broken"] or ["all stated quantities are within their limits"]
        print_line(table_console(), f"{file}: {'; '.join(verdict)}.")
    return 1 if facts["broken"] else 0
