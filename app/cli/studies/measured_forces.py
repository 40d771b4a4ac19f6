"""The subjects real and fringes of the command study: forces of photoelastic discs, solved anew and compared."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import get_args

from ...process.atomic import write_atomically
from ...process.errors import InputError
from ...process.frame_range import ALL_FRAMES
from ...synthetic.scenarios.preset_names import FringedPreset
from ..stored_results import load_run
from ..terminal import print_line, progress_of, table_console
from .study_request import StudyRequest

FRINGED_GRAINS = 200  # of simulated photoelastic discs


def study_measured(request: StudyRequest) -> int:
    """Compare a run with measured forces and print the agreement; files of PeGS are solved first. Returns 0."""
    from ...exchange.foreign.pegs import DISCS, POSITIONS, has_forces, is_pegs
    from ...run_truth import load_truth
    from ...study.real import real_forces, real_page

    folder, page = request.folder, request.page
    if folder is None:
        raise InputError("study real", "PATH", "is missing: give the folder of a run, such as runs/my_test")
    if is_pegs(folder):
        if not has_forces(folder):
            raise InputError(folder, "", "holds no measured forces to compare with: PeGS 2 writes Adjacency_list.txt")
        folder = _solve(folder, quiet=request.quiet or request.as_json)
    elif folder.is_dir() and not (folder / "results.h5").exists():
        raise InputError(folder, "", f"is neither a run (results.h5) nor files of PeGS ({POSITIONS}, *{DISCS})")
    run, results = load_run(folder)
    truth = load_truth(run, results)
    if truth is None or run.experiment.config.truth is None:
        raise InputError(run.experiment.file, "key truth", "is missing: there are no measured forces to compare with")
    sides = real_forces.correlate_sides(
        run.experiment.folder / run.experiment.config.truth, run.frames, len(results.frames)
    )
    found = real_forces.study_real(results, truth, sides, request.frame)
    if page is not None:
        write_atomically(page, real_page.real_page(found).encode())
    if request.as_json:
        print(json.dumps(real_forces.as_json(found), indent=1))
        return 0
    real_page.print_real(table_console(real_page.WIDTH), found)
    if page is not None:
        print_line(table_console(), f"Pictures of frame {found.shown}: {page}")
    return 0


def study_fringes(request: StudyRequest) -> int:
    """Compare the forces of simulated photoelastic discs with and without their fringes, and print them. Returns 0."""
    from ... import pipeline
    from ...experiment.experiment import load_experiment
    from ...run_folder import Run, hold_run
    from ...study.real.fringe_gain import FringeGain, measure_gain, print_gains
    from ...synthetic.photoelastic.fringe_photographs import make_fringed

    grains = FRINGED_GRAINS if request.grains is None else request.grains
    found: dict[str, list[FringeGain]] = {}
    for preset in get_args(FringedPreset):
        for seed in request.seeds:
            folder = request.out / "fringes" / f"{preset}_{grains}_{seed}"
            if not (folder / "experiment.toml").is_file():
                with progress_of(request.quiet) as progress:
                    make_fringed(folder, seed, preset=preset, grains=grains, progress=progress)
            with progress_of(request.quiet) as progress:
                run = Run(load_experiment(folder), folder.with_name(f"{folder.name}_run"), ALL_FRAMES, progress)
                with hold_run(run):
                    inputs, results, truth = pipeline.solved_inputs(run)
            assert truth is not None
            found.setdefault(preset, []).append(measure_gain(seed, inputs, results, truth))
    print_gains(table_console(), found)
    return 0


def _solve(folder: Path, *, quiet: bool) -> Path:
    """Import measured forces of photoelastic discs and infer them anew; returns the folder of the run."""
    from ... import pipeline
    from ...exchange.foreign.import_files import ImportRequest, import_files
    from ...experiment.experiment import CONFIG_NAME, load_experiment
    from ...run_folder import Run, hold_run
    from ...run_truth import load_truth

    name = folder.resolve().name
    place, began = Path("runs") / "real" / name, time.perf_counter()
    test = place / name
    made = f"# From {folder.name}, by rodsight import pegs."
    file = test / CONFIG_NAME
    if file.is_file() and file.read_text(encoding="utf-8").startswith(made):
        shutil.rmtree(test)  # the same data may have changed; results of unchanged data are used again
    import_files(ImportRequest("pegs", folder), test)
    with progress_of(quiet) as progress:
        run = Run(load_experiment(test), place / "run", ALL_FRAMES, progress)
        with hold_run(run):
            results = pipeline.solve(run)
            pipeline.conclude(run, results, load_truth(run, results), began)
    return place / "run"
