"""`rodsight review`: opens the results of a run and serves the page, or moves verdicts in and out."""

from __future__ import annotations

import getpass
import webbrowser
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from ..errors import InputError
from ..experiment.experiment import CONFIG_NAME, Experiment, load_experiment
from ..experiment.photographs import Photographs
from ..experiment.scaling import make_scale
from ..results.results import Results
from ..results.store import load_results, read_origin
from ..verdicts.decisions import Bodies
from ..verdicts.log import VERDICTS, VerdictLog
from ..verdicts.table import export_verdicts, import_verdicts
from .candidates import find_candidates
from .picture import Picture
from .server import ReviewServer
from .session import ReviewSession

RESULTS = "results.h5"


@dataclass(frozen=True, slots=True)
class Reviewed:
    """Results on disk with what belongs to them."""

    file: Path
    results: Results
    experiment: Experiment
    first_frame: int  # of the experiment

    @property
    def log(self) -> VerdictLog:
        return VerdictLog(self.file.parent / VERDICTS)

    @property
    def bodies(self) -> Bodies:
        return Bodies.of(self.results.tracks, self.results.walls)

    @property
    def threshold(self) -> float | None:
        """The gap threshold [m] that the experiment names; None: six standard deviations of a position."""
        return self.experiment.config.contacts.threshold


def open_reviewed(path: Path) -> Reviewed:
    """Open the results of an experiment (its default folder), of a run's folder, or results.h5 itself."""
    if path.is_dir() and not (path / RESULTS).exists() and (path / CONFIG_NAME).exists():
        path = Path("runs") / load_experiment(path).name
    file = path / RESULTS if path.is_dir() else path
    if not file.exists():
        raise InputError(file, "", "there are no results: run `rodsight run` on the experiment first")
    results, origin = load_results(file), read_origin(file)
    assert origin is not None
    return Reviewed(file, results, load_experiment(Path(origin.experiment)), origin.frames[0])


def open_session(reviewed: Reviewed) -> ReviewSession:
    """Make the session of one run; its log lies beside the results."""
    photograph, scale = None, None
    section = reviewed.experiment.config.photographs
    if section is not None:
        photographs = reviewed.experiment.photographs()
        scale = make_scale(section, photographs.shape[0], reviewed.results.calibration)
        photograph = partial(_grey, photographs, reviewed.first_frame)
    picture = Picture(reviewed.results, photograph, scale)
    return ReviewSession(
        reviewed.results, picture, reviewed.log, first_frame=reviewed.first_frame, threshold=reviewed.threshold
    )


def review(path: Path, *, port: int, browser: bool, reviewer: str | None) -> int:
    """Serve the page until it is interrupted."""
    reviewed = open_reviewed(path)
    session = open_session(reviewed)
    try:
        server = ReviewServer(session, port, reviewer or _user())
    except (OSError, OverflowError) as error:
        raise InputError("--port", str(port), f"cannot be used ({error})") from None
    console = Console()
    console.print(f"Review of {reviewed.results.name}: {server.address}", highlight=False, soft_wrap=True)
    console.print(f"Verdicts go to {reviewed.log.file}. Stop with Ctrl-C.", highlight=False, soft_wrap=True)
    if browser:
        webbrowser.open(server.address)
    try:
        server.serve()
    except KeyboardInterrupt:
        spoken = len(reviewed.log.last_words())
        console.print(f"{spoken} verdicts and flags in the log. Next: rodsight solve", highlight=False)
    finally:
        server.close()
    return 0


def import_table(path: Path, file: Path, *, reviewer: str | None, complete: bool) -> int:
    """Append a table of verdicts, or of contacts, to the log."""
    reviewed = open_reviewed(path)
    found = [find_candidates(reviewed.results, k, reviewed.threshold) for k in range(len(reviewed.results.frames))]
    pairs = {each.frame: list(zip(each.contacts.i.tolist(), each.contacts.j.tolist(), strict=True)) for each in found}
    count = import_verdicts(
        reviewed.log, file, reviewed.bodies, reviewer or file.stem, first_frame=reviewed.first_frame,
        frame_count=len(reviewed.results.frames), candidates=pairs if complete else None,
    )  # fmt: skip
    Console().print(f"{count} verdicts added to {reviewed.log.file}.", highlight=False, soft_wrap=True)
    return 0


def export_table(path: Path, file: Path) -> int:
    """Write the verdicts as a table."""
    count = export_verdicts(open_reviewed(path).log, file)
    Console().print(f"{count} verdicts in {file}.", highlight=False, soft_wrap=True)
    return 0


def _grey(photographs: Photographs, first: int, frame: int) -> NDArray[np.uint8]:
    return np.clip(np.rint(photographs[first + frame]), 0, 255).astype(np.uint8)


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a machine without user names
        return "reviewer"
