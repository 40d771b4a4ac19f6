"""The entry point of the `rodsight` command: arguments, errors and exit status.

Exit status: 0 done, 1 failed, 2 bad input, 130 interrupted (143 terminated, 129 its terminal was closed).
"""

from __future__ import annotations

import gc
import io
import os
import sys
from contextlib import suppress

from ..process.errors import InputError, RunError
from ..process.signals import Stopped, stop_on_signals
from .unknown_words import refuse_unknown_words

SHELLS = ("bash", "zsh", "tcsh")
# Of linear algebra, read where it is loaded; `process.machine.linear_algebra` states why one thread, and limits callers
# that have loaded it before.
THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
# [ms] after which the allocator of the recording's library returns freed memory, read where it is loaded. By its own
# delay the memory of a recording grows by 30 MB in 1000 photographs of 250 rods; at once it takes 3 % more time.
PURGE_DELAY = ("MIMALLOC_PURGE_DELAY", "0")
# New objects until cycles are looked for (Python: 700). Modules make a million objects, all of which stay.
NEW_OBJECTS = 50_000


def main(arguments: list[str] | None = None) -> None:
    """Parse the arguments, run one command, exit."""
    arguments = sys.argv[1:] if arguments is None else arguments
    gc.set_threshold(NEW_OBJECTS)
    for name in THREADS:
        os.environ.setdefault(name, "1")
    os.environ.setdefault(*PURGE_DELAY)
    for stream in (sys.stdout, sys.stderr):  # unknown characters are replaced
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        with stop_on_signals():  # also while modules are imported
            status = _run(arguments)
            sys.stdout.flush()
    except InputError as error:
        status = _report(str(error), 2)
    except RunError as error:
        status = _report(str(error), 1)
    except Stopped as stopped:
        status = _report("interrupted; the same command resumes from here", stopped.status)
    except KeyboardInterrupt:
        status = _report("interrupted; the same command resumes from here", 130)
    except BrokenPipeError:  # the reader closed the pipe
        status = 1
        _discard_output()
    except MemoryError:
        status = _report("out of memory: use fewer frames (--frames A:B)", 1)
    except OSError as error:
        file = _file_instead_of_folder(error)
        status = _report(_describe(error), 1) if file is None else _report(f"{file}: is a file, not a folder", 2)
    sys.exit(status)


def _run(arguments: list[str]) -> int:
    from .. import __version__

    if arguments == ["--version"]:
        print(f"rodsight {__version__}")
        return 0
    from .command_list import command_names, overview

    if arguments in ([], ["-h"], ["--help"], ["help"]):
        print(overview())
        return 0
    if arguments[0] == "help":
        arguments = [*arguments[1:], "--help"]
    refuse_unknown_words(arguments, command_names())
    if arguments[0] == "--completion":
        if len(arguments) != 2 or arguments[1] not in SHELLS:
            raise InputError("--completion", " ".join(arguments[1:]), f"is not one of {', '.join(SHELLS)}")
        arguments = ["--tyro-print-completion", arguments[1]]
    from .parsing import parse

    return parse(arguments)()


def _report(sentence: str, status: int) -> int:
    with suppress(OSError):  # standard error is closed
        named = sentence if sentence.startswith("rodsight") else f"rodsight: {sentence}"
        print(named, file=sys.stderr, flush=True)
    return status


def _discard_output() -> None:
    """Redirect standard output to the null device, since Python reports a closed pipe at exit."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())


def _file_instead_of_folder(error: OSError) -> str | None:
    """Return the file that stands where a folder is to be made, perhaps above it; None: another error."""
    if not isinstance(error, FileExistsError | NotADirectoryError) or not isinstance(error.filename, str):
        return None
    place = os.path.abspath(error.filename)
    while not os.path.lexists(place):
        place = os.path.dirname(place)
    return place if os.path.isfile(place) else None


def _describe(error: OSError) -> str:
    """Describe an operating system error in one line: the file and the reason."""
    given = dict.fromkeys(str(name) for name in (error.filename, error.filename2) if name is not None)
    names = " -> ".join(given)
    reason = error.strerror or " ".join(str(error).split()) or type(error).__name__
    return f"{names}: {reason}" if names else reason


if __name__ == "__main__":
    main()
