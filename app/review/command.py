"""`rodsight review`: opens the results of a run and serves the page, or moves verdicts in and out."""

from __future__ import annotations

import signal
import webbrowser
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from ..errors import InputError
from ..experiment.photographs import Photographs
from ..experiment.scaling import make_scale
from ..signals import Stopped
from ..verdicts.reviewer_name import account_name
from ..verdicts.table import export_verdicts, import_verdicts
from .judging.candidate_pairs import find_candidate_pairs
from .reviewed_run import Reviewed, open_reviewed
from .service.picture import Picture
from .service.server import ReviewServer
from .service.session import ReviewSession


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
        server = ReviewServer(session, port, reviewer or account_name() or "reviewer")
    except (OSError, OverflowError) as error:
        raise InputError("--port", str(port), f"cannot be used ({error})") from None
    console = Console()
    console.print(f"Review of {reviewed.results.name}: {server.address}", highlight=False, soft_wrap=True)
    console.print(f"Verdicts go to {reviewed.log.file}. Stop with Ctrl-C.", highlight=False, soft_wrap=True)
    if browser:
        webbrowser.open(server.address)
    try:
        server.serve()
    except Stopped as stopped:
        if stopped.number != signal.SIGINT:  # Ctrl-C is how a review ends
            raise
        spoken = len(reviewed.log.last_words())
        console.print(f"{spoken} verdicts and flags in the log. Next: rodsight solve", highlight=False)
    finally:
        server.close()
    return 0


def import_table(path: Path, file: Path, *, reviewer: str | None, complete: bool) -> int:
    """Append a table of verdicts, or of contacts, to the log."""
    reviewed = open_reviewed(path)
    found = [find_candidate_pairs(reviewed.results, k, reviewed.threshold) for k in range(len(reviewed.results.frames))]
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
