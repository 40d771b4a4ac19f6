"""What `rodsight compare` does: two results, or a result and its truth, as one recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console

from ..errors import InputError
from ..experiment.experiment import load_experiment
from ..pipeline import RESULTS, Run, load_truth
from ..results.comparison import Comparison, DifferentPackingError, compare_runs, compare_with_truth
from ..results.results import Results
from ..results.store import Provenance, load_results, read_origin


def compare(first: Path, second: Path | None, *, truth: bool, out: Path | None, console: Console) -> int:
    """Write the comparison and tell its figures. Exit status 0."""
    if (second is None) != truth:
        raise InputError("compare", "", "give two results, or one and --truth")
    a, origin = _load(first)
    names = _names(first, second)
    if second is None:
        comparison = _with_truth(a, origin, first, names[0])
    else:
        b, other = _load(second)
        try:
            comparison = compare_runs(a, b, names=names, starts=(origin.frames[0], other.frames[0]))
        except DifferentPackingError as error:
            raise InputError(second, "", str(error)) from None
    target = out if out is not None else Path(f"compare-{names[0]}-{names[1]}.rrd")
    from ..recording.comparison_layer import record_comparison

    size = record_comparison(comparison, target)
    _tell(comparison, console)
    console.print(
        f"{target}: {1e-6 * size:.1f} MB. To look at it: rodsight view {target}",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )
    return 0


def _with_truth(results: Results, origin: Provenance, path: Path, name: str) -> Comparison:
    run = Run(load_experiment(Path(origin.experiment)), path if path.is_dir() else path.parent, origin.frames)
    truth = load_truth(run, results)
    if truth is None:
        raise InputError(run.experiment.file, "key truth", "is missing: there is nothing to compare with")
    return compare_with_truth(results, truth, name=name)


def _load(path: Path) -> tuple[Results, Provenance]:
    file = path / RESULTS if path.is_dir() else path
    results, origin = load_results(file), read_origin(file)
    if origin is None:
        raise InputError(file, "", "does not say where it comes from")
    return results, origin


def _names(first: Path, second: Path | None) -> tuple[str, str]:
    """Names of the two sides: their folders, told apart where they are called the same."""
    names = [(path.parent if path.is_file() else path).resolve().name or "run" for path in (first, second) if path]
    if len(names) == 1:
        return names[0], "truth"
    return (names[0], names[1]) if names[0] != names[1] else (f"{names[0]} (1)", f"{names[1]} (2)")


def _tell(comparison: Comparison, console: Console) -> None:
    first, second = comparison.first, comparison.second
    r = np.array([[each.r_fn, each.r_ft, each.relative_l2, each.scale] for each in comparison.agreement])
    angle = np.degrees([[x.friction_angle, y.friction_angle] for x, y in zip(first.frames, second.frames, strict=True)])
    mean = [float(np.nanmean(column)) if np.isfinite(column).any() else float("nan") for column in r.T]
    least = float(np.nanmin(r[:, 0])) if np.isfinite(r[:, 0]).any() else float("nan")
    apart = float(np.sqrt(np.nanmean(np.diff(angle, axis=1) ** 2)))
    console.print(
        f"{first.name} against {second.name}, {len(r)} frames: r(f_n) mean {mean[0]:.3f}, least {least:.3f}; r(f_t) "
        f"mean {mean[1]:.3f}; relative L2 {mean[2]:.3f}; ratio of the sums of f_n {mean[3]:.3f}; friction angles "
        f"apart by {apart:.2f}° rms.",
        markup=False, highlight=False, soft_wrap=True,
    )  # fmt: skip
    for note in comparison.notes:
        console.print(note, markup=False, highlight=False, soft_wrap=True)
