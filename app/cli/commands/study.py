"""The command that measures the method against truth: study."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from ...synthetic.scenarios.preset_names import ScenarioName
from ..arguments import AsJson, Quiet, Settings
from ..studies import measured_forces, packing_studies, scenario_studies
from ..studies.study_request import StudyRequest, StudySubject, refuse_inapplicable

STUDIES: Mapping[StudySubject, Callable[[StudyRequest], int]] = {
    "paper": packing_studies.study_paper,
    "accuracy": packing_studies.study_accuracy,
    "status": packing_studies.study_status,
    "uncertainty": packing_studies.study_uncertainty,
    "worlds": scenario_studies.study_worlds,
    "trust": scenario_studies.study_trust,
    "mixture": scenario_studies.study_mixture,
    "numbers": scenario_studies.study_numbers,
    "intervals": scenario_studies.study_intervals,
    "report": scenario_studies.study_report,
    "budget": scenario_studies.study_budget,
    "real": measured_forces.study_measured,
    "fringes": measured_forces.study_fringes,
    "perturbation": scenario_studies.study_perturbation,
}


def study(
    subject: Annotated[
        StudySubject,
        Positional,
        arg(
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
        Positional,
        arg(
            metavar="PATH",
            help="real: a run, or files of PeGS, to be solved; perturbation, paper --program: an experiment with truth",
        ),
    ] = None,
    /,
    seeds: Annotated[tuple[int, ...], arg(help="of the simulated packings; default 0 1 2")] = (),
    grains: Annotated[
        int | None,
        arg(
            help="rods of a packing; default: paper, accuracy, status, uncertainty 1172, paper --program 300, "
            "fringes 200, others 450"
        ),
    ] = None,
    estimator: Annotated[
        Literal["ensemble", "nlgs"] | None,
        arg(help="accuracy, uncertainty, worlds: mean of seven solutions (ensemble, the default), or one chain"),
    ] = None,
    ensemble: Annotated[
        int | None,
        arg(
            metavar="K",
            help="solutions with resampled input; uncertainty: default 8; intervals: adds their standard deviation",
        ),
    ] = None,
    scenarios: Annotated[
        tuple[ScenarioName, ...], arg(name="worlds", help="of scenarios: only these; default: those of the study")
    ] = (),
    varied: Annotated[
        tuple[int, ...],
        arg(metavar="SEED", help="of scenarios: seeds that draw step, stiffness, friction, noise … too"),
    ] = (),
    jobs: Annotated[int | None, arg(metavar="N", help="worlds, trust: processes; default 1")] = None,
    fit: Annotated[
        tuple[int, ...], arg(metavar="SEED", help="trust, intervals, numbers: also fit the constants on these seeds")
    ] = (),
    settings: Settings = (),
    out: Annotated[
        Path | None, arg(metavar="DIR", help="cache of simulated truths and scores; default runs/study")
    ] = None,
    as_json: AsJson = False,
    page: Annotated[
        Path | None,
        arg(
            metavar="OUT.html",
            help="real: pictures side by side, true, inferred and baseline; report: the page, default DIR/report.html",
        ),
    ] = None,
    frame: Annotated[int | None, arg(help="real: the frame of the pictures; default: the middle one")] = None,
    program: Annotated[
        Literal["authors"] | None,
        arg(
            help="paper: score the recipe of the authors' own program beside the paper's and this one, on PATH or on "
            "the apparatus of the preset 1g2e with radii 2 % too small"
        ),
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Measure the method on simulated truth: minutes for each packing, stored for the next time.

    Scenarios: worlds, trust, mixture, numbers, intervals, report, budget, perturbation; --set applies to them and to
    paper --program, --json to worlds, report and real. An option that does not apply to the subject is refused.

    Some scenarios: rodsight study worlds --seeds 1 --worlds shear gravity; an experiment: rodsight study perturbation
    sample_data/shear

    The recipe of the authors' program: rodsight study paper --program authors --seeds 0

    Photoelastic forces, files of PeGS: rodsight study real FOLDER --page real.html; of a run: rodsight study real
    runs/my_test

    Example: rodsight study worlds --worlds shear --seeds 1 --grains 150
    """
    request = StudyRequest(
        subject=subject,
        folder=folder,
        given_seeds=seeds,
        grains=grains,
        estimator=estimator,
        ensemble=ensemble,
        scenarios=scenarios,
        varied=varied,
        jobs=jobs,
        fit=fit,
        settings=settings,
        given_out=out,
        as_json=as_json,
        page=page,
        frame=frame,
        program=program,
        quiet=quiet,
    )
    refuse_inapplicable(request)
    return STUDIES[subject](request)
