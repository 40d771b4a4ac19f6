"""Every stated statistic against the truth's own: bias, scatter, and whether stated intervals cover.

The truth's statistics are computed by the same functions from the true forces, of which it is known which contacts
bear them and which of those slide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from solver.bodies.grains import Array
from solver.bodies.quantity import quantities
from solver.contacts.contacts import measure_pairs
from solver.contacts.pairs import Keys
from solver.sequence.judging.intervals import Witness, doubt_of, witness_of
from solver.sequence.judging.statistic_intervals import DEVIATION, LEAST_DOUBT, SIZED, size_of
from solver.statistics.frame_statistics import FrameStatistics, Likely, frame_statistics

from ...inference.inference import CorrectedSequence, SolvedFrame
from ...synthetic.worlds.names import WorldName
from ...synthetic.worlds.table import WORLDS as WORLDS_OF
from .intervals import COVERED, JUDGE_WORLDS
from .intervals import FIT_WORLDS as INTERVAL_WORLDS
from .solved_world import SolvedWorld
from .world_score import SETTLED

# Worlds whose truth and input have the same rods, so that every statistic can be compared.
WORLDS: tuple[WorldName, ...] = (
    "shear", "sheared", "biaxial", "isotropic", "gravity", "soft", "corners", "radii_03", "mu_low", "step_05", "step_1",
)  # fmt: skip
# Deviations are fitted on all worlds but those that are told a wrong friction, and judged on other seeds.
FIT_WORLDS: tuple[WorldName, ...] = (
    *INTERVAL_WORLDS,
    *(world for world in JUDGE_WORLDS if not world.startswith("mu_")),
)
FITTED = (Witness.MOTION, Witness.BOTH, Witness.POSITIONS)  # statistics of a first frame have no deviation
BIASED = 0.05  # of the true value: more is a bias to be told
FAR_OFF = 0.15  # of the true value: more in one world is to be covered by the interval …
COVERS = 0.93  # … with this share of its frames within two deviations
CONE = 0.999  # quantile of |f_t| / f_n of true contacts that is their friction, for a fifth of them are on the cone
IN_PI = ("principal_direction",)  # directions: the same after half a turn
SHAPES = ("fn_density", "ft_density", "mobilisation_density")  # compared as a whole: the share that is elsewhere
NOT_COMPARED = ("area",)  # no estimate
DEGREES = ("friction_angle", "wall_ratio_angle", "principal_direction", "friction_angle_of_anisotropies")

NONE_TOLD = "–"  # where no deviation is stated
WORLD_HEADINGS = ("world", "true", "stated", "bias", "deviation", "68 %", "95 %", "")
HEADINGS = ("statistic", "true mean", "bias", "worst world", "bias there", "scatter", "68 %", "95 %", "")


@dataclass(frozen=True, slots=True)
class Compared:
    """One statistic of one world and seed, frame by frame from SETTLED on."""

    world: WorldName
    seed: int
    name: str
    stated: Array  # (f,)
    true: Array  # (f,)
    deviation: Array  # (f,) stated standard deviation, NaN without one
    doubt: Array  # (f,) 1 − T
    witness: NDArray[np.uint8]  # (f,) of Witness

    @property
    def error(self) -> Array:
        """Stated less true (f,), of angles in degrees; of a shape, the share that is elsewhere."""
        difference = self.stated - self.true
        if self.name in IN_PI:
            difference = (difference + 0.5 * np.pi) % np.pi - 0.5 * np.pi
        return np.degrees(difference) if self.name in DEGREES else difference


def compare_numbers(solved: SolvedWorld) -> list[Compared]:
    """Compare every statistic of a solved world, sizes of forces only where something tells them."""
    world, seed, sequence, frames, true = solved.world, solved.seed, solved.sequence, solved.stated, solved.true
    pairs = [(each.statistics, _statistics_of_truth(sequence, each, *true[k])) for k, each in enumerate(frames)]
    late = pairs[SETTLED:]
    doubt = np.array([float(doubt_of(each.forces.trust)) for each in frames[SETTLED:]])
    witness = np.array([witness_of(each.forces.positions_share) for each in frames[SETTLED:]], np.uint8)
    return [
        _compared(world, seed, name, values, doubt, witness)
        for name in compared_names()
        if is_compared(world, name)
        if (values := [_values(name, stated, exact) for stated, exact in late])
    ]


def _compared(
    world: WorldName,
    seed: int,
    name: str,
    values: Sequence[tuple[float, float, float]],
    doubt: Array,
    witness: NDArray[np.uint8],
) -> Compared:
    stated, true, deviation = (np.array(column) for column in zip(*values, strict=True))
    return Compared(world, seed, name, stated, true, deviation, doubt, witness)


def is_compared(world: WorldName, name: str) -> bool:
    """Whether a world tells a statistic: where nothing tells the size of forces, none is stated."""
    return name not in SIZED or WORLDS_OF[world].scale_known


def compared_names() -> list[str]:
    """The statistics that are compared: single numbers, and shapes."""
    names = [each.name for each in quantities(FrameStatistics) if not each.quantity.dims or each.name in SHAPES]
    return [name for name in names if name not in NOT_COMPARED and not name.endswith("_sd")]


def print_numbers(console: Console, found: Sequence[Compared]) -> None:
    """Print one row for every statistic: its mean, its bias over all worlds and at worst in one, and its scatter."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("statistic", "worst world", "") else "right")
    for row in number_rows(found):
        table.add_row(*row)
    console.print(table)
    console.print(
        "Bias: mean of stated less true over the mean true value; of angles in degrees; of densities the share that "
        "lies in another bin. Scatter: the same of single frames, as a standard deviation about the bias. 68 %, 95 %: "
        f"frames within one and two stated standard deviations. Frames from {SETTLED} on.",
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def print_by_world(console: Console, found: Sequence[Compared], name: str) -> None:
    """Print one row for every world: a statistic stated and true, its bias, its interval and how often that covers."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in (name, *WORLD_HEADINGS[1:]):
        table.add_column(heading, justify="left" if heading in (name, "") else "right")
    for row in world_rows(found, name):
        table.add_row(*row)
    console.print(table)


def world_rows(found: Sequence[Compared], name: str) -> list[list[str]]:
    """A row of cells under WORLD_HEADINGS for every world that a statistic is compared in."""
    named = [each for each in found if each.name == name]
    rows = []
    for world in dict.fromkeys(each.world for each in named):
        here = [each for each in named if each.world == world]
        true, stated, deviation = (
            np.concatenate([getattr(each, column) for each in here]) for column in ("true", "stated", "deviation")
        )
        values = (np.nanmean(true), np.nanmean(stated), np.nanmean(deviation))
        true_mean, stated_mean, deviation_mean = (f"{value:.3g}" for value in values)
        bias, covered = relative_bias(here), _covered(here)
        rows.append([
            world, true_mean, stated_mean, _told(bias, name), deviation_mean, *covered, _tell_far_off(bias, covered[1]),
        ])  # fmt: skip
    return rows


def _tell_far_off(bias: float, within_two: str) -> str:
    """Whether a bias in one world is far off, and if it is, whether the interval covers."""
    if not abs(bias) > FAR_OFF:
        return ""
    return "covered" if within_two != NONE_TOLD and float(within_two) >= 100.0 * COVERS else "far off"


def number_rows(found: Sequence[Compared]) -> list[list[str]]:
    """A row of cells under HEADINGS for every statistic."""
    by_name = {name: [each for each in found if each.name == name] for name in compared_names()}
    return [[name, *_cells(rows)] for name, rows in by_name.items() if rows]


def fit_deviations(found: Sequence[Compared]) -> dict[str, tuple[float, ...]]:
    """Constants of `solver.sequence.judging.statistic_intervals`, by what they were read from; NaN of no frame."""
    fitted = {}
    for name in DEVIATION:
        rows = [each for each in found if each.name == name and is_compared(each.world, name)]
        error, doubt = np.abs(_raw(rows)), np.concatenate([each.doubt for each in rows])
        size = np.array([size_of(name, float(value)) for each in rows for value in each.stated])
        ratio = error / (size * np.sqrt(np.maximum(doubt, LEAST_DOUBT)))
        witness = np.concatenate([each.witness for each in rows])
        fitted[name] = tuple(_scale(ratio[(witness == each) & np.isfinite(ratio)]) for each in FITTED)
    return fitted


def _scale(ratio: Array) -> float:
    """What one and two of it cover 68 and 95 % of these (k,) with, as nearly as one number can."""
    return float(np.sqrt(np.prod(np.quantile(ratio, COVERED) / (1.0, 2.0)))) if len(ratio) else float("nan")


def relative_bias(rows: Sequence[Compared]) -> float:
    """Mean error over the mean true value; of angles in degrees, of shapes as it is; NaN without any."""
    error = np.concatenate([each.error for each in rows])
    return float(np.nanmean(error)) / _unit(rows) if np.isfinite(error).any() else float("nan")


def _unit(rows: Sequence[Compared]) -> float:
    if rows[0].name in DEGREES or rows[0].name in SHAPES:
        return 1.0
    return float(np.nanmean(np.abs(np.concatenate([each.true for each in rows])))) or 1.0


def _cells(rows: Sequence[Compared]) -> list[str]:
    name, bias = rows[0].name, relative_bias(rows)
    true = np.concatenate([each.true for each in rows])
    worlds = {world: [each for each in rows if each.world == world] for world in {each.world for each in rows}}
    by_world = {world: relative_bias(some) for world, some in sorted(worlds.items())}
    worst = max(by_world, key=lambda world: -1.0 if np.isnan(by_world[world]) else abs(by_world[world]))
    error = np.concatenate([each.error for each in rows]) / _unit(rows)
    covered = _covered(rows)
    mean = np.degrees(np.nanmean(true)) if name in DEGREES else np.nanmean(true)
    flag = ""
    if name not in DEGREES and name not in SHAPES and abs(bias) > BIASED:
        flag = "biased" if covered[0] == NONE_TOLD else "biased, interval told"
    return [
        "–" if name in SHAPES else f"{mean:.3g}", _told(bias, name), worst, _told(by_world[worst], name),
        _told(float(np.nanstd(error)), name), *covered, flag,
    ]  # fmt: skip


def _covered(rows: Sequence[Compared]) -> list[str]:
    """Percent of the frames within one and within two stated deviations."""
    sigma = np.concatenate([each.deviation for each in rows])
    error = np.abs(_raw(rows))
    known = np.isfinite(sigma) & np.isfinite(error)
    return [f"{100.0 * np.mean(error[known] <= t * sigma[known]):.0f}" if known.any() else NONE_TOLD for t in (1, 2)]


def _raw(rows: Sequence[Compared]) -> Array:
    error = np.concatenate([each.error for each in rows])
    return np.radians(error) if rows[0].name in DEGREES else error


def _told(value: float, name: str) -> str:
    return f"{value:+.1f}°" if name in DEGREES else f"{100.0 * value:+.1f} %"


def _values(name: str, stated: FrameStatistics, exact: FrameStatistics) -> tuple[float, float, float]:
    one, other = getattr(stated, name), getattr(exact, name)
    if name in SHAPES:
        return 0.5 * float(np.abs(one - other).sum() / max(other.sum(), 1e-300)), 0.0, float("nan")
    return float(one), float(other), float(getattr(stated, f"{name}_sd", float("nan")))


def _statistics_of_truth(sequence: CorrectedSequence, solved: SolvedFrame, key: Keys, force: Array) -> FrameStatistics:
    packing, snapshot = sequence.packing, sequence.snapshots[solved.forces.frame]
    walls = packing.walls_of(snapshot)
    order = np.argsort(key)
    contacts = measure_pairs(packing.grains, snapshot.position, walls, key[order])
    fn, ft = force[order].T.copy()
    friction = _friction_of(fn, ft, contacts.with_wall)
    return frame_statistics(
        contacts, fn, ft, Likely.of_known(fn, ft, friction), snapshot.position, snapshot.present, walls, packing.length,
        grains=packing.grains, material=packing.material,
    )  # fmt: skip


def _friction_of(fn: Array, ft: Array, with_wall: NDArray[np.bool_]) -> Array:
    """The friction (c,) that true forces have: of walls and of grains, the greatest ratio that they reach."""
    friction = np.ones_like(fn)
    for kind in (with_wall, ~with_wall):
        if (fn[kind] > 0).any():
            friction[kind] = np.quantile(np.abs(ft[kind])[fn[kind] > 0] / fn[kind][fn[kind] > 0], CONE)
    return friction
