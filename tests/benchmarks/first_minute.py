"""Times of the first run of the sample after an installation, from the wheel and from a checkout."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.timing import Duration, Row
from tests.first_run import CHECKOUT, FirstRun, build_wheel, run_first, unpack_wheel

AIMS = {"wheel": "≤ 20 s on two idle cores", "checkout": "≤ 45 s on two idle cores"}


def first_run_rows() -> Iterator[Row]:
    """Build a wheel, run the sample from it, from the checkout, and from the checkout once more."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        site = unpack_wheel(build_wheel(folder / "built"), folder / "site")
        size = sum(each.stat().st_size for each in (site / "rodsight/shipped_kernels").iterdir())
        yield Row("kernels in the wheel", f"{size / 1e6:.1f} MB")
        for place, path in (("wheel", site), ("checkout", CHECKOUT)):
            yield from _rows(place, run_first(path, folder / place))


def _rows(place: str, run: FirstRun) -> Iterator[Row]:
    duration = Duration(run.processor, run.clock)
    yield Row(f"first run of the sample from the {place}", str(duration), AIMS[place], (run.processor,), "s")
    yield Row(f"compilations in its own process, from the {place}", str(run.compilations), "0")
    yield Row(f"import of the command, from the {place}", f"{run.imported:.2f} s of processor", "≤ .15 s")
    yield Row(
        f"`rodsight run` to the first photograph, from the {place}", f"{run.first_photograph:.2f} s of processor",
        "≤ 1 s",
    )  # fmt: skip
