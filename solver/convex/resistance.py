"""What resists sliding in a sequence: the given friction, or a rival that leaves a clearly lesser power gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.special import erf

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.contacts import Contacts
from ..detection.touch_probability import ContactProbabilitySettings
from ..nlgs.chain import ChainSettings, force_scale
from .friction_check import LEAST_GAP, MOST_GAP, QUIET, is_clearly_less, on_better_contacts, sliding_frame
from .program import weigh_rows
from .sliding_model import Parameter, ResistedFrame, SlidingModel, compare_models, power_gap

REVERSED = 0.5  # gap of the reversed motion over that of the given one, below which it is named
ABSURD = 1.0  # friction of no rods: the motion reversed is then the better explanation, however large a gap it leaves
# Gap that it may leave where no rival explains the sliding. It left .42 to .61 in five packings with walls, loads or a
# camera that were wrong, and .06 to .13 of reversed motions.
MOST_TURNED = 0.35
AHEAD = 0.85  # gap of the named cause over that of the second
COMPARED_FRAMES = 4  # consecutive photographs on which models are compared
FEWEST = 2  # of these
AS_GIVEN = 0.2  # relative difference of the friction of walls up to which it is the given one
LEAST_WALLS = 12  # contacts with walls from which on their friction is a rival
MOST_FRICTION = 3.0  # times the given friction: with more, forces on a few contacts explain any sliding
# Gap with a rolling resistance over that of the given model and of another friction, below which it is named. On
# sheared packings of 200 rods whose contacts resist rolling it is .39 to .78 (seeds 20 to 22, 30, 40, 44, 45), and
# without it 1.
ROLLING = 0.8
# Weight of torque equations: moments that no contact force exerts, of a base or of flattened contacts, then hardly hide
# the resistance to sliding. On 200 rods the gap of the true cause falls to .1 to .6 of that of the given model, before
# to .1 to .7; that of others stays above .94 of it.
TORQUE_WEIGHT = 0.3
# Parameters of each rival; the friction of grains shifts with the others.
RIVALS: dict[str, tuple[Parameter, ...]] = {
    "friction": ("all_friction",),
    "wall_friction": ("wall_friction", "friction"),
    "base_friction": ("base_drag", "all_friction"),
    "adhesion": ("attraction", "all_friction"),
}
UNSTATED: dict[str, tuple[Parameter, ...]] = {"wall_friction": ("wall_friction",), "base_friction": ("base_drag",)}


@dataclass(frozen=True, slots=True)
class Resistance:
    """The model that explains the sliding."""

    cause: str  # of RIVALS, "photographs_reversed" or "rolling_resistance"; empty: none is better than the given
    given: SlidingModel
    given_gap: float
    found: SlidingModel
    found_gap: float


def find_resistance(frames: Sequence[ResistedFrame], given: SlidingModel, workers: int | None = 1) -> Resistance | None:
    """Compare what may resist the sliding.

    Parameters
    ----------
    frames : sequence of ResistedFrame
    given : SlidingModel
        Of the input.
    workers : int, optional
        Threads.

    Returns
    -------
    Resistance or None
        None where nothing slides. The reversed motion is named if its gap is below half of that of the given one, and
        below .25, below .35 where no rival explains the sliding, or where only rivals with a friction above 1 do.
        Another rival is named if its parameters are determined, its gap is below .62 times that of the given model and
        of another friction alone, .85 times that of every other rival, and below .25. Where none of these is named, a
        resistance to rolling is named that leaves less than .8 of the gap of both.
    """
    before = power_gap(frames, given)
    if not np.isfinite(before):
        return None
    nothing = Resistance("", given, before, given, before)
    turned = power_gap([each.reversed() for each in frames], given)
    backward = turned < min(REVERSED * before, before - LEAST_GAP)
    if backward and turned < MOST_GAP:
        return Resistance("photographs_reversed", given, before, given, turned)
    walls = float(np.mean([each.contacts.with_wall.sum() for each in frames]))
    names = [name for name in RIVALS if name != "wall_friction" or walls >= LEAST_WALLS]
    fitted = dict(zip(names, compare_models(frames, given, [RIVALS[each] for each in names], workers), strict=True))
    sound = {name: each for name, each in fitted.items() if each.enclosed}
    if "friction" in sound and sound["friction"].model.friction > MOST_FRICTION * given.friction:
        del sound["friction"]
    explaining = [each for each in sound.values() if is_clearly_less(each.gap, before)]
    if backward and all(each.model.friction > ABSURD for each in explaining) and (explaining or turned < MOST_TURNED):
        return Resistance("photographs_reversed", given, before, given, turned)
    friction = sound["friction"].gap if "friction" in sound else before
    best = min((name for name in sound if name != "friction"), key=lambda name: sound[name].gap, default="")
    if best and is_clearly_less(sound[best].gap, min(before, friction)):
        others = [each.gap for name, each in sound.items() if name not in (best, "friction")]
        if all(sound[best].gap < AHEAD * other for other in others):
            # Another friction between grains beside walls as they are given: these are not to blame.
            walls_fit = abs(sound[best].model.wall_friction - given.wall_friction) < AS_GIVEN * given.wall_friction
            cause = "friction" if best == "wall_friction" and walls_fit else best
            return Resistance(cause, given, before, sound[best].model, sound[best].gap)
        return nothing  # it is one of two, and friction alone is worse than either
    (rolling,) = compare_models(frames, given, [("rolling",)], workers)
    least = min(MOST_GAP, before - LEAST_GAP, ROLLING * before, ROLLING * friction)
    if rolling.enclosed and rolling.gap < least:
        return Resistance("rolling_resistance", given, before, rolling.model, rolling.gap)
    if "friction" in sound and is_clearly_less(friction, before):
        return Resistance("friction", given, before, sound["friction"].model, friction)
    return nothing


def find_unstated(
    frames: Sequence[ResistedFrame], given: SlidingModel, names: Sequence[str], workers: int | None = 1
) -> SlidingModel:
    """Find resistance that the input does not state, with the friction between grains as given.

    Parameters
    ----------
    frames : sequence of ResistedFrame
    given : SlidingModel
        Of the input.
    names : sequence of str
        "wall_friction", "base_friction": which of them may differ from the input.
    workers : int, optional
        Threads.

    Returns
    -------
    SlidingModel
        The given one unless another friction of walls, or a base that drags the grains, lowers the power gap to below
        .62 times its value, .85 times that of the other, and .25.
    """
    model, left = given, list(names)
    while left:
        before = power_gap(frames, model)
        if not before > QUIET or power_gap([each.reversed() for each in frames], model) < REVERSED * before:
            break
        fitted = compare_models(frames, model, [UNSTATED[name] for name in left], workers)
        gap = np.array([each.gap if each.enclosed else before for each in fitted])
        best = int(np.argmin(gap))
        if not is_clearly_less(gap[best], before) or (np.delete(gap, best) * AHEAD < gap[best]).any():
            break
        model = fitted[best].model
        del left[best]
    return model


def find_in_sequence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    first: int,
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> Resistance | None:
    """Compare what may resist the sliding in COMPARED_FRAMES frames at most, from `first` on, with neighbours.

    Returns
    -------
    Resistance or None
        None with fewer than two such frames, without friction, or where nothing slides.
    """
    numbers = range(first, min(first + COMPARED_FRAMES, len(snapshots) - 1))
    if len(numbers) < FEWEST or packing.material.friction <= 0.0 or packing.material.wall_friction <= 0.0:
        return None
    frames = resisted_frames(packing, snapshots, numbers, settings, workers)
    return find_resistance(frames, model_of(packing), workers)


def resisted_frames(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    numbers: Sequence[int],
    settings: ContactProbabilitySettings,
    workers: int | None = 1,
) -> list[ResistedFrame]:
    """Prepare frames, each with the sliding over (k − 1, k + 1).

    Parameters
    ----------
    packing : Packing
    snapshots : sequence of Snapshot
    numbers : sequence of int
        Consecutive frames with neighbours on both sides.
    settings : ContactProbabilitySettings
    workers : int, optional
        Threads.
    """

    def make(k: int, completed: bool) -> ResistedFrame:
        return _resisted_frame(packing, snapshots, k, settings, completed)

    return on_better_contacts(make, numbers, workers)


def model_of(packing: Packing) -> SlidingModel:
    """The model that a packing states."""
    material, force_unit = packing.material, force_scale(packing, ChainSettings())
    drag = material.base_drag * float(packing.grains.mass.mean()) / force_unit
    return SlidingModel(material.friction, material.wall_friction, drag)


def base_drag_of(packing: Packing, model: SlidingModel) -> float:
    """Drag of the base [m/s²] under a model: coefficient of friction times gravity."""
    return model.base_drag * force_scale(packing, ChainSettings()) / float(packing.grains.mass.mean())


def _resisted_frame(
    packing: Packing, snapshots: Sequence[Snapshot], k: int, settings: ContactProbabilitySettings, completed: bool
) -> ResistedFrame:
    free = replace(packing, grains=replace(packing.grains, drag=None, moment=None, moment_sd=None))
    frame = sliding_frame(free, snapshots, k, settings, completed=completed)
    count = int((snapshots[k].present & packing.grains.free).sum())
    rows = np.ones(len(frame.balance.load))
    rows[2 * count : 3 * count] = TORQUE_WEIGHT
    drag = _unit_drag(packing, snapshots, k, len(rows))
    balance = weigh_rows(frame.balance, rows, count)
    roll = _unit_rolling(packing, snapshots, k, frame.contacts, len(rows))
    return ResistedFrame(balance, frame.contacts, frame.slip, frame.probability, drag, roll, count)


def _unit_drag(packing: Packing, snapshots: Sequence[Snapshot], k: int, rows: int) -> Array:
    """Load b (m,) of a base that drags a mean grain by the force unit, against its motion over (k − 1, k + 1)."""
    before, now, after = snapshots[k - 1 : k + 2]
    present = now.present & packing.grains.free
    moved = np.nan_to_num(after.position - before.position)
    size = np.sqrt((moved**2).sum(axis=1) + 4.0 * now.sigma**2)
    relative_mass = packing.grains.mass / packing.grains.mass.mean()
    against = (relative_mass / np.where(size > 0.0, size, 1.0))[:, None] * moved
    drag, n = np.zeros(rows), int(present.sum())
    drag[:n], drag[n : 2 * n] = against[present, 0], against[present, 1]
    return drag


def _unit_rolling(
    packing: Packing, snapshots: Sequence[Snapshot], k: int, contacts: Contacts, rows: int
) -> sparse.csr_matrix:
    """Moments (m, 2c) of contacts that resist rolling over (k − 1, k + 1) by f_n times their rolling radius.

    Where noise hides the sign of the relative rotation, its expectation counts; unknown rotations resist nothing.
    """
    before, now, after = snapshots[k - 1 : k + 2]
    radius, wall, present = packing.grains.radius, contacts.with_wall, now.present & packing.grains.free
    turned = after.rotation - before.rotation
    i, j = contacts.i, np.where(wall, contacts.i, contacts.j)
    arm = np.where(wall, radius[i], radius[i] * radius[j] / (radius[i] + radius[j]))
    relative = np.where(wall, -turned[i], turned[j] - turned[i])
    noise = 2.0 * now.sigma / radius[i]  # of two rotations in two photographs each
    sign = np.nan_to_num(erf(relative / (np.sqrt(2.0) * noise)))
    moment = TORQUE_WEIGHT * arm * sign / radius.mean()
    count = int(present.sum())
    row = np.where(present, np.cumsum(present) - 1, -1)
    on_i, on_j = np.flatnonzero(row[i] >= 0), np.flatnonzero(~wall & (row[j] >= 0))
    place = 2 * count + np.concatenate([row[i[on_i]], row[j[on_j]]])
    value = np.concatenate([moment[on_i], -moment[on_j]])
    shape = (rows, 2 * contacts.count)
    return sparse.csr_matrix((value, (place, np.concatenate([on_i, on_j]))), shape=shape)
