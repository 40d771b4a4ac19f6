"""Times of the first run of the sample after an installation, from the wheel and from a checkout."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.timing import Duration, Row
from tests.first_run import CHECKOUT, FirstRun, build_wheel, run_first, unpack_wheel

AIMS = {"wheel": "≤ 20 s on two idle cores", "checkout": "≤ 45 s on two idle cores"}
ROUNDS = 3  # on a shared machine the least of several is the nearest to that of an idle one


def first_run_rows() -> Iterator[Row]:
    """Build a wheel, and run the sample several times from it and from the checkout, each time without kernels."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        site = unpack_wheel(build_wheel(folder / "built"), folder / "site")
        size = sum(each.stat().st_size for each in (site / "rodsight/shipped_kernels").iterdir())
        yield Row("kernels in the wheel", f"{size / 1e6:.1f} MB")
        for place, path in (("wheel", site), ("checkout", CHECKOUT)):
            yield from _rows(place, [run_first(path, folder / f"{place}_{n}") for n in range(ROUNDS)])


def _rows(place: str, runs: list[FirstRun]) -> Iterator[Row]:
    best = Duration(min(run.processor for run in runs), min(run.clock for run in runs))
    every = ", ".join(f"{run.clock:.1f}" for run in runs)
    label = f"first run of the sample from the {place}, least of {len(runs)} ({every} s; load {os.getloadavg()[1]:.1f})"
    yield Row(label, str(best), AIMS[place], (best.processor,), "s")
    yield Row(f"compilations in its own process, from the {place}", str(max(run.compilations for run in runs)), "0")
    yield Row(
        f"import of the command, from the {place}", f"{min(run.imported for run in runs):.2f} s of processor",
        "≤ .15 s",
    )  # fmt: skip
    yield Row(
        f"`rodsight run` to the first photograph, from the {place}",
        f"{min(run.first_photograph for run in runs):.2f} s of processor", "≤ 1 s",
    )  # fmt: skip
