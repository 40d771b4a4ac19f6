"""The `rodsight` command: arguments in, a stage called, an exit status out. No logic lives here.

Exit status: 0 done, 1 failed, 2 bad input, 130 interrupted (143 terminated, 129 its terminal was closed).
"""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress

from ..errors import InputError, RunError
from ..signals import Stopped, stopping

SHELLS = ("bash", "zsh", "tcsh")


def main(arguments: list[str] | None = None) -> None:
    """Parse the arguments, run one command, exit."""
    arguments = sys.argv[1:] if arguments is None else arguments
    for stream in (sys.stdout, sys.stderr):  # a terminal that cannot show a sign shows another, and nothing fails
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        with stopping():  # from here on, while modules are imported, too
            status = _run(arguments)
            sys.stdout.flush()
    except InputError as error:
        status = _tell(str(error), 2)
    except RunError as error:
        status = _tell(str(error), 1)
    except Stopped as stopped:
        status = _tell("interrupted; the same command goes on from here", stopped.status)
    except KeyboardInterrupt:
        status = _tell("interrupted; the same command goes on from here", 130)
    except BrokenPipeError:  # who read the output has had enough
        status = 1
        _hear_no_more()
    except MemoryError:
        status = _tell("this machine's memory is too small for it: take fewer frames (--frames A:B)", 1)
    except OSError as error:
        status = _tell(_describe(error), 1)
    sys.exit(status)


def _run(arguments: list[str]) -> int:
    from .. import __version__

    if arguments == ["--version"]:
        print(f"rodsight {__version__}")
        return 0
    from .command_list import command_line, overview

    if arguments in ([], ["-h"], ["--help"], ["help"]):
        print(overview())
        return 0
    if arguments[0] == "--completion":
        if len(arguments) != 2 or arguments[1] not in SHELLS:
            raise InputError("--completion", " ".join(arguments[1:]), f"is not one of {', '.join(SHELLS)}")
        arguments = ["--tyro-print-completion", arguments[1]]
    return command_line().cli(prog="rodsight", description="Contact forces from photographs.", args=arguments)


def _tell(sentence: str, status: int) -> int:
    with suppress(OSError):  # nobody to hear it
        print(f"rodsight: {sentence}", file=sys.stderr, flush=True)
    return status


def _hear_no_more() -> None:
    """Send what is still to be printed nowhere, or Python would complain of the closed pipe at its end."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())


def _describe(error: OSError) -> str:
    """What the outside world refused, in one line: the file, and why."""
    names = " -> ".join(str(name) for name in (error.filename, error.filename2) if name is not None)
    why = error.strerror or " ".join(str(error).split()) or type(error).__name__
    return f"{names}: {why}" if names else why
