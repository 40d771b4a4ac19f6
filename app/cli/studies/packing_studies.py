"""The subjects of the command study that simulate whole packings: paper, accuracy, status and uncertainty."""

from __future__ import annotations

from pathlib import Path

from ...process.errors import InputError
from ..run_request import Request, open_run
from ..terminal import progress_of, table_console
from .study_request import StudyRequest

GRAINS = 1172  # of a packing, as the paper's
MEMBERS = 8  # of an ensemble
# Of the simulated apparatus on which --program compares.
APPARATUS_GRAINS, APPARATUS_FRAMES, APPARATUS_RADIUS_ERROR = 300, 60, -0.02


def study_paper(request: StudyRequest) -> int:
    """Test the paper's claims, or with --program compare the recipes of programs. Returns 0."""
    from ...study.claims import study_claims

    if request.program is not None:
        return _study_programs(request)
    with progress_of(request.quiet) as progress:
        study_claims(
            request.seeds, grains=_grains(request), folder=request.out, console=table_console(), progress=progress
        )
    return 0


def study_accuracy(request: StudyRequest) -> int:
    """Print r against noise. Returns 0."""
    from ...study import accuracy

    with progress_of(request.quiet) as progress:
        accuracy.study_accuracy(
            request.seeds, grains=_grains(request), folder=request.out, estimator=request.estimator or "ensemble",
            console=table_console(), progress=progress,
        )  # fmt: skip
    return 0


def study_status(request: StudyRequest) -> int:
    """Fit trust and status on one half of the seeds and judge them on the other. Returns 0."""
    from ...study.report.status import refit_status

    fit, judge = _halves(request.seeds)
    with progress_of(request.quiet) as progress:
        refit_status(
            fit, judge, grains=(_grains(request),), folder=request.out, console=table_console(), progress=progress
        )
    return 0


def study_uncertainty(request: StudyRequest) -> int:
    """Fit the coverage of error bars on one half of the seeds and judge it on the other. Returns 0."""
    from ...study.report import uncertainty

    members = MEMBERS if request.ensemble is None else request.ensemble
    with progress_of(request.quiet) as progress:
        uncertainty.study_uncertainty(
            _halves(request.seeds), members=members, grains=_grains(request),
            estimator=request.estimator or "ensemble", folder=request.out, console=table_console(), progress=progress,
        )  # fmt: skip
    return 0


def _grains(request: StudyRequest) -> int:
    return GRAINS if request.grains is None else request.grains


def _halves(seeds: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Divide seeds into those of the fit and those of the judgement. Raises InputError if there is only one."""
    if len(seeds) < 2:
        raise InputError("--seeds", " ".join(map(str, seeds)), "must be two or more: one half to fit, one to judge")
    half = (len(seeds) + 1) // 2
    return seeds[:half], seeds[half:]


def _study_programs(request: StudyRequest) -> int:
    """Score the recipes of the two programs on PATH, or on simulated apparatus. Returns 0."""
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
    if request.folder is not None:
        print_programs(console, f"{request.folder}: mean over the frames, errors rms", score(request.folder, None))
        return 0
    found, grains = [], APPARATUS_GRAINS if request.grains is None else request.grains
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
