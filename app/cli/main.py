"""The `rodsight` command: arguments in, a stage called, an exit status out. No logic lives here.

Exit status: 0 done, 1 failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from .. import __version__
from ..errors import InputError
from .arguments import Ensemble, ExperimentPath, Frames, FullFrames, MaxSize, Out, Quiet, Settings, Sweeps
from .cli_tools import compare, export, import_, sensitivity, share, study, synth


def run(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    view: Literal["none", "native", "web"] = "none",
    sweeps: Sweeps = None,
    max_size: MaxSize = None,
    full_frames: FullFrames = (),
    ensemble: Ensemble = None,
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Photographs to contact forces and a recording: the main job.

    Example: rodsight run sample_data/shear --view web
    """
    from . import commands

    settings = _with_ensemble(settings, ensemble)
    return commands.run_all(_request(experiment, out, frames, settings, sweeps, quiet, max_size, full_frames), view)


def check(experiment: ExperimentPath, /, settings: Settings = (), quiet: Quiet = False) -> int:
    """Validate an experiment without computing.

    Example: rodsight check sample_data/shear
    """
    from . import commands

    return commands.check(_request(experiment, None, None, settings, None, quiet))


def track(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    frames: Frames = None,
    report: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="write DIR/tracking_report.html: how well it went")
    ] = False,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Follow the grains through the photographs, no more.

    Example: rodsight track sample_data/shear --report
    """
    from . import commands

    return commands.track(_request(experiment, out, frames, settings, None, quiet), report=report)


def solve(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    sweeps: Sweeps = None,
    ensemble: Ensemble = None,
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Find contacts and forces, tracking first where that has not been done.

    Example: rodsight solve sample_data/shear --set contacts.threshold_sigmas=5
    """
    from . import commands

    settings = _with_ensemble(settings, ensemble)
    return commands.solve(_request(experiment, out, frames, settings, sweeps, quiet))


def record(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    sweeps: Sweeps = None,
    max_size: MaxSize = None,
    full_frames: FullFrames = (),
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Write the recording, solving first where that has not been done.

    Example: rodsight record sample_data/shear --sweeps all
    """
    from . import commands

    return commands.record(_request(experiment, out, frames, settings, sweeps, quiet, max_size, full_frames))


def view(
    recording: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RECORDING_OR_DIR")],
    /,
    web: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="in a browser")] = False,
    only_list: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(name="list", help="of a folder: tell what is in it, no more")
    ] = False,
) -> int:
    """Open a recording with its blueprint, or a folder of recordings as a catalogue.

    Example: rodsight view runs/shear --web
    """
    from . import commands

    return commands.view(recording, web=web, only_list=only_list)


def score(
    results: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RESULTS")],
    /,
    truth: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="table frame,i,j,fn,ft; default: the experiment's")
    ] = None,
    as_json: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(name="json", help="print JSON")] = False,
    fit_threshold: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="refit gap threshold and radii from verdicts")
    ] = False,
) -> int:
    """Compare inferred contacts and forces with true ones, and with the verdicts of people.

    Example: rodsight score runs/shear --json
    """
    from . import commands

    return commands.score(results, truth, as_json=as_json, fit_threshold=fit_threshold)


def review(
    experiment: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT_OR_DIR")],
    /,
    port: Annotated[int, tyro.conf.arg(help="on 127.0.0.1; 0 takes a free one")] = 0,
    browser: Annotated[bool, tyro.conf.arg(help="open the page")] = True,
    reviewer: Annotated[str | None, tyro.conf.arg(metavar="NAME", help="default: the user's name")] = None,
    import_csv: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="add verdicts of a table frame,i,j[,verdict], and end")
    ] = None,
    complete: Annotated[
        bool,
        tyro.conf.FlagCreatePairsOff,
        tyro.conf.arg(help="the imported table lists every contact of its frames: all other candidates are none"),
    ] = False,
    export_csv: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="write the verdicts as a table, and end")
    ] = None,
) -> int:
    """Judge contacts by eye on a local page; the solver obeys.

    Example: rodsight review runs/shear
    """
    from . import commands

    return commands.review(
        experiment, port=port, browser=browser, reviewer=reviewer, import_csv=import_csv, complete=complete,
        export_csv=export_csv,
    )  # fmt: skip


COMMANDS: tuple[Callable[..., int], ...] = (
    run,
    check,
    track,
    solve,
    record,
    view,
    review,
    score,
    synth,
    sensitivity,
    study,
    share,
    compare,
    export,
    import_,
)


def main(arguments: list[str] | None = None) -> None:
    """Parse the arguments, run one command, exit."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments == ["--version"]:
        print(f"rodsight {__version__}")
        sys.exit(0)
    app = tyro.extras.SubcommandApp()
    for command in COMMANDS:
        app.command(name=command.__name__.rstrip("_"))(command)
    try:
        status = app.cli(prog="rodsight", description=__doc__, args=arguments)
    except InputError as error:
        print(f"rodsight: {error}", file=sys.stderr)
        status = 2
    except KeyboardInterrupt:
        print("rodsight: interrupted; the same command goes on from here", file=sys.stderr)
        status = 130
    except BrokenPipeError:
        status = 1
    sys.exit(status)


def _with_ensemble(settings: tuple[str, ...], ensemble: int | None) -> tuple[str, ...]:
    return settings if ensemble is None else (*settings, f"solver.ensemble_size={ensemble}")


def _request(
    experiment: Path,
    out: Path | None,
    frames: str | None,
    settings: tuple[str, ...],
    sweeps: str | None,
    quiet: bool,
    max_size: float | None = None,
    full_frames: tuple[int, ...] = (),
):  # type: ignore[no-untyped-def]
    from .commands import Request

    if sweeps is not None:
        settings = (*settings, f"recording.sweeps={json.dumps(sweeps)}")
    console = Console(stderr=False, quiet=quiet)
    return Request(experiment, out, frames, settings, quiet, console, max_size, full_frames)
