"""`rodsight open` serves the workbench until it is interrupted; `rodsight init` does its set-up from flags."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from rich.console import Console

from ..errors import InputError
from ..experiment.experiment import CONFIG_NAME
from .service.bench import Bench
from .service.server import WorkbenchServer
from .setup.initialise import PICTURE, Told, initialise
from .setup.steps import Understood

SIGNS = {"good": "✓", "doubtful": "!", "missing": "·"}


def initialise_experiment(folder: Path, told: Told, *, quiet: bool) -> int:
    """Set an experiment up from flags, and say how it stands."""
    if not folder.is_dir():
        raise InputError(folder, "", "is no folder; give the one that holds the photographs, or a folder of them")
    found = initialise(folder, told)
    console = Console(quiet=quiet)
    for step in found.steps.values():
        console.print(f"{SIGNS[step.mark.value]} {step.name}: {_fact(found, step.name)}", highlight=False)
        for sentence in step.says:
            console.print(f"    {sentence}", highlight=False, soft_wrap=True)
    console.print(f"Written: {folder / CONFIG_NAME}. Look at {folder / PICTURE}, then rodsight check {folder}.",
                  highlight=False, soft_wrap=True)  # fmt: skip
    return 0


def _fact(found: Understood, step: str) -> str:
    """What was understood in a step."""
    rods, walls, scale = found.rods, found.walls, found.scale
    facts = {
        "photographs": f"{len(found.files)} of {found.shape[1]} x {found.shape[0]} px" if found.shape else "none",
        "scale": "not known" if scale is None else f"{1e3 * scale.mean_size:.5g} mm per pixel",
        "walls": "none" if walls is None else ", ".join(walls.name),
        "rods": "none" if rods is None else f"{len(rods.id)} found",
        "material": ", ".join(f"{key} {value}" for key, value in found.data.get("material", {}).items()) or "assumed",
    }
    return facts[step]


def open_workbench(folder: Path, *, port: int, browser: bool) -> int:
    """Serve the page of a folder. Raises InputError for a folder that is none, or a port that is taken."""
    if not folder.is_dir():
        raise InputError(folder, "", "is no folder; open the one that holds your photographs or experiments")
    try:
        server = WorkbenchServer(Bench(folder), port)
    except (OSError, OverflowError) as error:
        raise InputError("--port", str(port), f"cannot be used ({error})") from None
    console = Console()
    console.print(f"Workbench of {server.bench.root}: {server.address}", highlight=False, soft_wrap=True)
    console.print("Everything done there is a file of the experiment's folder. Stop with Ctrl-C.", highlight=False)
    if browser:
        webbrowser.open(server.address)
    try:
        server.serve()
    except KeyboardInterrupt:
        pass
    finally:
        server.close()
    return 0
