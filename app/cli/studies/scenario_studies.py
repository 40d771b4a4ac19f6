"""The subjects of the command study that simulate scenarios of laboratory data: worlds, trust, numbers and others."""

from __future__ import annotations

import json
from typing import get_args

from ...process.atomic import write_atomically
from ...synthetic.scenarios.preset_names import ScenarioName
from ..run_request import Request, open_run
from ..terminal import print_line, progress_of, table_console
from .study_request import StudyRequest


def study_worlds(request: StudyRequest) -> int:
    """Score scenarios and print the table, or JSON. Returns 0."""
    from ...study.scenarios import score_table

    scenarios, jobs = request.scenarios or get_args(ScenarioName), request.jobs or 1
    with progress_of(request.quiet) as progress:
        scores = score_table.score_scenarios(request.plan, scenarios, request.seeds, jobs=jobs, progress=progress)
    if request.as_json:
        print(json.dumps(score_table.as_json(scores), indent=1))
    else:
        score_table.print_scores(table_console(score_table.WIDTH), scores)
    return 0


def study_trust(request: StudyRequest) -> int:
    """Compare trust with r by kind of input, with --fit after fitting its tables. Returns 0."""
    import numpy as np

    from ...inference.diagnosis.trial import PREDICTED_PHOTOGRAPHS
    from ...study.scenarios import trust_study
    from ...study.scenarios.score_table import WIDTH, score_scenarios

    console = table_console(WIDTH)
    scenarios: tuple[ScenarioName, ...] = request.scenarios or get_args(ScenarioName)
    jobs = request.jobs or 1
    fits: dict[str, trust_study.TrustFit] = {}
    with progress_of(request.quiet) as progress:
        if request.fit:
            read: list[ScenarioName] = [name for name in scenarios if name not in trust_study.LEFT_OUT]
            read_scores = score_scenarios(request.plan, read, request.fit, jobs=jobs, progress=progress)
            fits = trust_study.fit_by_title(read_scores)
            closed = trust_study.CLOSED_KINDS if "both" in fits else ()
            closed_scores = score_scenarios(request.plan, closed, request.fit, jobs=jobs, progress=progress)
            for each in trust_study.describe_fits(fits, read_scores, closed_scores, PREDICTED_PHOTOGRAPHS):
                print_line(console, each)
        scores = score_scenarios(request.plan, scenarios, request.seeds, jobs=jobs, progress=progress)
    sample = trust_study.refit(trust_study.TrustSample.of(scores), fits)
    new = np.isin(sample.kind, list(trust_study.LEFT_OUT))
    trust_study.print_trust(console, "Kinds that the fit has read", sample.select(~new))
    trust_study.print_trust(console, "Kinds left out of the fit", sample.select(new))
    trust_study.print_scale(console, scores)
    return 0


def study_mixture(request: StudyRequest) -> int:
    """Fit the weights of the two estimates and print them. Returns 0."""
    from ...study.scenarios.mixture_fit import print_mixture, sample_mixtures

    with progress_of(request.quiet) as progress:
        samples = sample_mixtures(request.plan, request.scenarios or get_args(ScenarioName), request.seeds, progress)
    for each in samples:
        print_mixture(table_console(), each)
    return 0


def study_numbers(request: StudyRequest) -> int:
    """Compare every statistic with the truth, with --fit after fitting standard deviations. Returns 0."""
    from ...study.scenarios import statistic_errors
    from ...study.scenarios.score_table import WIDTH
    from ...study.scenarios.solved_scenario import solve_scenarios

    console = table_console(WIDTH)

    def measure(scenarios: tuple[ScenarioName, ...], seeds: tuple[int, ...]) -> list[statistic_errors.StatisticErrors]:
        solved = solve_scenarios(request.plan, scenarios, seeds, progress)
        return [each for one in solved for each in statistic_errors.measure_statistic_errors(one)]

    with progress_of(request.quiet) as progress:
        if request.fit:
            constants = statistic_errors.fit_sd_constants(measure(statistic_errors.FIT_SCENARIOS, request.fit))
            for name, values in constants.items():
                console.print(f"{name}: {', '.join(f'{each:.2g}' for each in values)}", highlight=False)
        found = measure(request.scenarios or statistic_errors.SCENARIOS, request.seeds)
    statistic_errors.print_statistic_errors(console, found)
    statistic_errors.print_by_scenario(console, found, "sliding_fraction")
    return 0


def study_intervals(request: StudyRequest) -> int:
    """Measure the coverage of the intervals of forces, with --fit after fitting their constants. Returns 0."""
    from ...study.scenarios import interval_coverage, interval_fit
    from ...study.scenarios.contact_errors import ContactErrors, measure_errors
    from ...study.scenarios.score_table import WIDTH
    from ...study.scenarios.solved_scenario import solve_scenarios

    console, members = table_console(WIDTH), request.ensemble or 0
    with progress_of(request.quiet) as progress:
        if request.fit:
            known = interval_fit.errors_of_fit(request.plan, request.fit, progress)
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


def study_budget(request: StudyRequest) -> int:
    """Compare what `check` predicts from the first photographs with the result. Returns 0."""
    from ...study.scenarios import predictions

    console = table_console()
    scenarios = request.scenarios or predictions.COMPARED_SCENARIOS
    with progress_of(request.quiet) as progress:
        outcomes = predictions.study_predictions(request.plan, scenarios, request.seeds, progress)
    predictions.print_predictions(console, outcomes)
    return 0


def study_report(request: StudyRequest) -> int:
    """Write the calibration report. Exit status 1 if a quantity is outside its limits."""
    from ...study.report.calibration_report import study_calibration
    from ...study.report.report_page import report_page
    from ...study.scenarios.statistic_errors import SCENARIOS

    with progress_of(request.quiet) as progress:
        found = study_calibration(request.plan, request.scenarios or SCENARIOS, request.seeds, progress)
    facts = found.facts()
    file = request.page or request.out / "report.html"
    write_atomically(file, report_page(found).encode())
    if request.as_json:
        print(json.dumps(facts, indent=1))
    else:
        verdict = facts["broken"] or ["all stated quantities are within their limits"]
        print_line(table_console(), f"{file}: {'; '.join(verdict)}.")
    return 1 if facts["broken"] else 0


def study_perturbation(request: StudyRequest) -> int:
    """Print the change of forces by small changes of input, of PATH or of scenarios. Returns 0."""
    from ... import pipeline
    from ...study.scenarios.perturbation import (
        on_given_grains,
        perturb_scenario,
        print_perturbations,
        study_perturbations,
    )

    console, plan = table_console(), request.plan
    if request.folder is not None:
        with open_run(Request(request.folder, plan.settings, request.quiet)) as run:
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
