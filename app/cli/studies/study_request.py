"""The arguments of the command study, and the subjects to which each of them applies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ...process.errors import InputError
from ...synthetic.scenarios.preset_names import ScenarioName
from ..arguments import was_given

if TYPE_CHECKING:
    from ...study.scenarios.scenario_score import StudyPlan

StudySubject = Literal[
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
]
OF_SCENARIOS: tuple[StudySubject, ...] = ("worlds", "trust", "mixture", "numbers", "intervals", "report", "budget")
OF_PACKINGS: tuple[StudySubject, ...] = ("paper", "accuracy", "status", "uncertainty", "fringes")
SIMULATED: tuple[StudySubject, ...] = (*OF_PACKINGS, *OF_SCENARIOS, "perturbation")
# The subjects to which an option applies; --quiet applies to all.
APPLIES_TO: Mapping[str, tuple[StudySubject, ...]] = {
    "PATH": ("real", "perturbation", "paper"),
    "--seeds": SIMULATED,
    "--grains": SIMULATED,
    "--estimator": ("accuracy", "uncertainty", "worlds"),
    "--ensemble": ("uncertainty", "intervals"),
    "--worlds": (*OF_SCENARIOS, "perturbation"),
    "--varied": OF_SCENARIOS,
    "--jobs": ("worlds", "trust"),
    "--fit": ("trust", "numbers", "intervals"),
    "--set": (*OF_SCENARIOS, "perturbation", "paper"),
    "--out": SIMULATED,
    "--json": ("worlds", "report", "real"),
    "--page": ("report", "real"),
    "--frame": ("real",),
    "--program": ("paper",),
}
OF_PROGRAM = ("PATH", "--set")  # apply to paper with --program only
OF_SIMULATION = ("--seeds", "--grains", "--worlds", "--out")  # do not apply with PATH, an experiment that exists
SEEDS, OUT = (0, 1, 2), Path("runs/study")


@dataclass(frozen=True, slots=True)
class StudyRequest:
    """The arguments of the command; None, False and an empty tuple stand for an option that was not given."""

    subject: StudySubject
    folder: Path | None = None
    given_seeds: tuple[int, ...] = ()
    grains: int | None = None
    estimator: Literal["ensemble", "nlgs"] | None = None
    ensemble: int | None = None
    scenarios: tuple[ScenarioName, ...] = ()  # empty: the default of the study
    varied: tuple[int, ...] = ()
    jobs: int | None = None
    fit: tuple[int, ...] = ()
    settings: tuple[str, ...] = ()
    given_out: Path | None = None
    as_json: bool = False
    page: Path | None = None
    frame: int | None = None
    program: Literal["authors"] | None = None
    quiet: bool = False

    @property
    def seeds(self) -> tuple[int, ...]:
        return self.given_seeds or SEEDS

    @property
    def out(self) -> Path:
        return OUT if self.given_out is None else self.given_out

    @property
    def plan(self) -> StudyPlan:
        """The inputs that all scenarios of the study have in common."""
        from ...study.scenarios.scenario_score import StudyPlan
        from ...synthetic.scenarios.scenario_folder import GRAINS

        chosen = (*self.settings, "solver.estimator=nlgs") if self.estimator == "nlgs" else self.settings
        grains = GRAINS if self.grains is None else self.grains
        return StudyPlan(grains, self.out / "worlds", chosen, frozenset(self.varied))


def refuse_inapplicable(request: StudyRequest) -> None:
    """Raise InputError for the first option that was given although it does not apply to the subject."""
    subject, existing = request.subject, request.folder is not None
    for option in _given(request):
        if subject not in APPLIES_TO[option]:
            raise InputError("study", f"{option} with {subject}", f"applies to {_listed(APPLIES_TO[option])} only")
        if subject == "paper" and option in OF_PROGRAM and request.program is None:
            raise InputError("study", f"{option} with paper", "applies with --program only")
        if existing and option in OF_SIMULATION:
            raise InputError("study", f"{option} with {request.folder}", "applies to simulated packings only")
    if request.jobs is not None and request.jobs < 1:
        raise InputError("--jobs", str(request.jobs), "must be at least one")
    if unused := sorted(set(request.varied) - {*request.seeds, *request.fit}):
        raise InputError("--varied", " ".join(map(str, unused)), "is neither one of --seeds nor of --fit")


def _given(request: StudyRequest) -> list[str]:
    """Return the options that were given, in the order of the table."""
    values: dict[str, object] = {
        "PATH": request.folder,
        "--seeds": request.given_seeds,
        "--grains": request.grains,
        "--estimator": request.estimator,
        "--ensemble": request.ensemble,
        "--worlds": request.scenarios,
        "--varied": request.varied,
        "--jobs": request.jobs,
        "--fit": request.fit,
        "--set": request.settings,
        "--out": request.given_out,
        "--json": request.as_json,
        "--page": request.page,
        "--frame": request.frame,
        "--program": request.program,
    }
    return [option for option in APPLIES_TO if was_given(values[option])]


def _listed(subjects: tuple[StudySubject, ...]) -> str:
    if subjects == SIMULATED:
        return "simulated packings"
    return " and ".join(filter(None, (", ".join(subjects[:-1]), subjects[-1])))
