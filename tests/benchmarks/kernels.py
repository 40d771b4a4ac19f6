"""Write the list of kernels from the compilations of the sample's run and of a few further commands.

    python -m tests.benchmarks.kernels

compiles every kernel anew, in a folder of its own. `app/compilation/kernel_list.jsonl` is then to be committed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "sample_data/shear"


@contextmanager
def recorded(kernels: list[Any]) -> Iterator[None]:
    """Append the kernels that are compiled inside the block to a list, those of a first block as needed by a run."""
    from numba.core import event
    from rodsight.compilation.kernel_list import PACKAGE, Kernel, encode

    first = not kernels

    class Recorder(event.Listener):
        def __init__(self) -> None:
            self.open: list[tuple[float, list[float], list[int]]] = []  # start, times and places of the kernels within

        def on_start(self, event: Any) -> None:
            self.open.append((time.process_time(), [], []))

        def on_end(self, event: Any) -> None:
            start, within, called = self.open.pop()
            whole = time.process_time() - start
            function = event.data["dispatcher"].py_func
            outer = self.open[-1] if self.open else None
            if outer is not None:
                outer[1].append(whole)
            if function.__module__.startswith(f"{PACKAGE}.") and _is_kept(event.data["dispatcher"]):
                try:
                    arguments = tuple(map(encode, event.data["args"]))
                except TypeError:
                    if outer is None:
                        raise
                    called.clear()  # literal arguments: compiled with its caller
                else:
                    module = function.__module__.removeprefix(f"{PACKAGE}.")
                    own = round(whole - sum(within), 2)
                    kernels.append(
                        Kernel(module, function.__qualname__, arguments, own, tuple(sorted(set(called))), first)
                    )
                    called[:] = [len(kernels) - 1]
            if outer is not None:
                outer[2].extend(called)

    with event.install_listener("numba:compile", Recorder()):
        yield


def _is_kept(dispatcher: Any) -> bool:
    """Whether the compiler keeps a kernel, and not only those that call it."""
    return type(dispatcher._cache).__name__ == "FunctionCache"


def commands(folder: Path) -> Iterator[tuple[str, ...]]:
    """Yield the commands whose kernels are listed; the first is the job that must be quick from a checkout."""
    run = ("--quiet", "--out")
    yield ("run", str(SAMPLE), *run, str(folder / "sample"))
    yield ("check", str(SAMPLE), "--json")
    yield ("synth", str(folder / "detected"), "--preset", "small", "--grains", "40", "--frames", "3", "--quiet")
    yield ("run", str(folder / "detected"), *run, str(folder / "detected-run"), "--set", "photographs.follow=outline")
    for name in ("1g2e", "circle", "periodic", "soft", "outer", "theta_absent", "base_friction", "isotropic"):
        made = str(folder / name)
        yield ("synth", made, "--preset", name, "--no-photographs", "--grains", "60", "--quiet")
        yield ("run", made, *run, f"{made}-run", "--frames", "0:4")


def main() -> int:
    """Record the kernels of all commands in a process with an empty folder of kernels."""
    if "record" not in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
            return subprocess.run([sys.executable, "-m", __spec__.name, "record"], env=environment).returncode
    from rodsight.cli.main import main as rodsight
    from rodsight.compilation import ahead
    from rodsight.compilation.kernel_list import write_kernels

    ahead.kernel_folder = lambda: None  # this process compiles everything itself
    kernels: list[Any] = []
    with tempfile.TemporaryDirectory() as folder:
        for command in commands(Path(folder)):
            with recorded(kernels):
                try:
                    rodsight(list(command))
                except SystemExit as ended:
                    if ended.code:
                        return int(ended.code)
            print(len(kernels), "kernels after", *command[:2], flush=True)
            write_kernels(kernels)
    return 0


if __name__ == "__main__":
    sys.exit(main())
