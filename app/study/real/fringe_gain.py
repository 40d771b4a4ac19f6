"""How much the fringes of simulated photoelastic discs improve the forces: the same tracks with and without them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rich.console import Console
from rich.table import Table

from ...inference.infer_sequence import infer_sequence
from ...inference.inputs import Inputs
from ...process.counts import mean_of_known
from ...results.results import Results, TruthContacts
from .real_forces import study_real


@dataclass(frozen=True, slots=True)
class FringeGain:
    """Agreement with the truth of one packing, means over its photographs."""

    seed: int
    without: float  # r(f_n) of the same tracks without fringes
    with_fringes: float  # r(f_n)
    pressure: float  # correlation of the discs' pressures, with fringes
    balance: float  # r(f_n) of the better equilibrium field from neither motion nor fringes
    trust: float  # least excess of r over the trust, with fringes


def measure_gain(seed: int, inputs: Inputs, results: Results, truth: TruthContacts) -> FringeGain:
    """Infer the forces of the tracks of a solved run once more without their fringes, and compare both with the truth.

    Parameters
    ----------
    seed : int
        Of the packing.
    inputs : Inputs
        Of the run.
    results : Results
        Of the run, with fringes.
    truth : TruthContacts
    """
    plain = infer_sequence(replace(inputs, tracks=replace(inputs.tracks, fringes=None)), diagnosis=())
    sides = [float("nan")] * len(results.frames)
    fringed, bare = (study_real(each, truth, sides).frames for each in (results, plain))
    static, overlap = (mean_of_known([getattr(row, source).r for row in fringed]) for source in ("static", "overlap"))
    return FringeGain(
        seed, mean_of_known([row.ours.r for row in bare]), mean_of_known([row.ours.r for row in fringed]),
        mean_of_known([row.ours.pressure for row in fringed]), max(static, overlap),
        min(row.ours.r - row.trust for row in fringed),
    )  # fmt: skip


def print_gains(console: Console, found: Mapping[str, Sequence[FringeGain]]) -> None:
    """Print a row per packing, by preset, and the means of every preset."""
    table = Table(title="Fringes of simulated discs", box=None, pad_edge=False)
    table.add_column("preset, seed", no_wrap=True)
    for heading in ("balance alone", "without fringes", "with fringes", "gain", "pressures", "least r − T"):
        table.add_column(heading, justify="right", no_wrap=True)
    for preset, rows in found.items():
        named = [(f"{preset}, {row.seed}", row) for row in rows]
        without, fringed, pressure, balance = (
            mean_of_known([getattr(row, name) for row in rows])
            for name in ("without", "with_fringes", "pressure", "balance")
        )
        mean = FringeGain(-1, without, fringed, pressure, balance, min(row.trust for row in rows))
        for name, row in [*named, (f"{preset}, mean", mean)]:
            table.add_row(
                name, f"{row.balance:.3f}", f"{row.without:.3f}", f"{row.with_fringes:.3f}",
                f"{row.with_fringes - row.without:+.3f}", f"{row.pressure:.3f}", f"{row.trust:+.3f}",
            )  # fmt: skip
    console.print(table)
