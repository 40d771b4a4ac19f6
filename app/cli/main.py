"""The `rodsight` command: arguments in, a stage called, an exit status out. No logic lives here.

Exit status: 0 done, 1 failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import tyro

from .. import __version__
from ..errors import InputError
from .export import export, share
from .look import compare, review, score, view
from .make import import_, synth
from .run import check, record, run, solve, track
from .settings import settings
from .study import sensitivity, study

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
    settings,
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
