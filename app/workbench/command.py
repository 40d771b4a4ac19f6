"""`rodsight open` and `rodsight review` serve the page until interrupted; `rodsight init` sets up from flags."""

from __future__ import annotations

import signal
from pathlib import Path
from urllib.parse import urlencode

from rich.console import Console

from ..experiment.experiment import CONFIG_NAME
from ..process.errors import InputError
from ..process.machine.browser import open_page
from ..process.machine.free_memory import return_large_blocks
from ..process.signals import Stopped
from ..results.hdf5.store import origin_of
from ..reviewing.reviewed_run import find_reviewed_results
from ..run_folder import RESULTS, find_experiment
from ..verdicts.log import VERDICTS, VerdictLog
from ..verdicts.reviewer_name import account_name
from .service.server import WorkbenchServer
from .service.workbench import Workbench
from .setup.initialise import PICTURE, SetupFlags, initialise
from .setup.validation import ValidationResult

SIGNS = {"good": "✓", "doubtful": "!", "missing": "·"}


def initialise_experiment(folder: Path, flags: SetupFlags, *, quiet: bool) -> int:
    """Set an experiment up from flags, and print the state of every step; return the exit status."""
    found = initialise(folder, flags)
    console = Console(quiet=quiet)
    for step in found.steps.values():
        heading = f"{SIGNS[step.mark.value]} {step.name}: {_summary(found, step.name)}"
        for text in (heading, *(f"    {sentence}" for sentence in step.messages)):  # with sections in brackets
            console.print(text, highlight=False, soft_wrap=True, markup=False)
    console.print(f"Written: {folder / CONFIG_NAME}. Look at {folder / PICTURE}, then: rodsight check {folder}",
                  highlight=False, soft_wrap=True, markup=False)  # fmt: skip
    return 0


def open_workbench(folder: Path, *, port: int, browser: bool) -> int:
    """Serve the page of a folder until it is interrupted; return the exit status.

    Raises
    ------
    InputError
        There is no such folder, or the port is in use.
    """
    if not folder.is_dir():
        raise InputError(folder, "", "is no folder; open the one that holds your photographs or experiments")
    return_large_blocks()
    server = _make_server(Workbench(folder), port, "open")
    console = Console()
    console.print(f"Workbench of {server.workbench.root}: {server.address}", highlight=False, soft_wrap=True)
    console.print("Everything done there is a file of the experiment's folder. Stop with Ctrl-C.", highlight=False)
    _serve(server, browser=browser)
    return 0


def open_review(path: Path, *, port: int, browser: bool, reviewer: str | None) -> int:
    """Serve the page with the review of one run until it is interrupted; return the exit status.

    Parameters
    ----------
    path : Path
        An experiment, a run's folder, or results.h5.
    port : int
        Port on 127.0.0.1; 0 takes a free one.
    browser : bool
        Open the page.
    reviewer : str or None
        Name of the reviewer; default: the user of the account.

    Raises
    ------
    InputError
        There are no results, their experiment is not there, or the port is in use.
    """
    return_large_blocks()
    file = find_reviewed_results(path).resolve()
    if file.name != RESULTS:
        raise InputError(file, "", f"is not called {RESULTS}; give the folder of a run")
    experiment = find_experiment(file, origin_of(file))
    workbench = Workbench(experiment.parent, run=file.parent, reviewer=reviewer or account_name() or "reviewer")
    name = workbench.project(".").reviewed_run().results.name
    entry = f"/#{urlencode({'at': '.', 'step': 'review'})}"
    server = _make_server(workbench, port, "review", entry)
    log = VerdictLog(file.parent / VERDICTS)
    console = Console()
    console.print(f"Review of {name}: {server.address}", highlight=False, soft_wrap=True)
    console.print(f"Verdicts go to {log.file}. Stop with Ctrl-C.", highlight=False, soft_wrap=True)
    _serve(server, browser=browser)
    console.print(f"Verdicts and flags in the log: {len(log.latest_entries())}. Next: rodsight solve", highlight=False)
    return 0


def _make_server(workbench: Workbench, port: int, command: str, entry: str = "/") -> WorkbenchServer:
    try:
        return WorkbenchServer(workbench, port, command=command, entry=entry)
    except (OSError, OverflowError) as error:
        raise InputError("--port", str(port), f"cannot be used ({error})") from None


def _serve(server: WorkbenchServer, *, browser: bool) -> None:
    """Serve until Ctrl-C, which is how the command ends."""
    if browser:
        open_page(server.address)
    try:
        server.serve()
    except Stopped as stopped:
        if stopped.number != signal.SIGINT:
            raise
    except KeyboardInterrupt:
        pass
    finally:
        server.close()


def _summary(found: ValidationResult, step: str) -> str:
    """The values of a step in words."""
    rods, walls, scale = found.rods, found.walls, found.scale
    values = {
        "photographs": f"{len(found.files)} of {found.shape[1]} x {found.shape[0]} px" if found.shape else "none",
        "scale": "not known" if scale is None else f"{1e3 * scale.mean_size:.5g} mm per pixel",
        "walls": "none" if walls is None else ", ".join(walls.name),
        "rods": "none" if rods is None else f"{len(rods.id)} found",
        "material": ", ".join(f"{key} {value}" for key, value in found.data.get("material", {}).items()) or "assumed",
    }
    return values[step]
