"""Synthetic results: a sheared hexagonal packing with chains of strong forces that converge over sweeps."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from rodsight.results.results import Results, TruthContacts
from rodsight.solver.assessment.changes import find_changes
from rodsight.solver.assessment.fringe_pressures import compare_with_fringes
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, ContactState, detect_contacts
from rodsight.solver.contacts.radius_tuning import RadiusTuning
from rodsight.solver.frame_forces import FrameForces, FrameStatus
from rodsight.solver.nlgs.force_memory import ForceMemory
from rodsight.solver.nlgs.start_residuals import COLD_SWEEPS
from rodsight.solver.nlgs.sweep_record import SweepHistory
from rodsight.solver.statistics.balance import grain_unbalance, sum_on_grains
from rodsight.solver.statistics.force_statistics import FORCE_BINS, MOBILISATION_BINS
from rodsight.solver.statistics.frame_statistics import FrameStatistics
from rodsight.tracks import Tracks, TrackStatus, WallTracks

RADIUS = 0.008  # [m]
FRICTION = 0.25
WALL_NAMES = ("bottom", "right", "top", "left")
CONFIGURATION = 'name = "fake"\n[material]\nlength = 0.06\nfriction = 0.25\n'
STATUSES = (FrameStatus.RESET, FrameStatus.SETTLING, FrameStatus.SETTLING, FrameStatus.SETTLED)


def make_results(
    frame_count: int = 4,
    columns: int = 8,
    rows: int = 7,
    *,
    sweeps: int = 60,
    recorded: np.ndarray | None = None,
    seed: int = 7,
    lost: tuple[int, int] | None = None,
) -> Results:
    """Make the results of a run; forces of the sweeps `recorded` are kept (default all), lost: (grain, first frame)."""
    rng = np.random.default_rng(seed)
    tracks, walls = _shear(frame_count, columns, rows, rng)
    if lost is not None:
        grain, start = lost
        tracks.position[start:, grain] = np.nan
        tracks.rotation[start:, grain] = np.nan
        tracks.status[start:, grain] = TrackStatus.LOST
    grains = Grains.of_rods(tracks.radius, density=2700.0, length=0.06)
    kept = np.arange(sweeps) if recorded is None else np.asarray(recorded)
    waves = rng.uniform(-np.pi, np.pi, (6, 2)), rng.uniform(0.0, 2.0 * np.pi, 6)
    frames, statistics = [], []
    for frame in range(frame_count):
        contacts = contacts_at(tracks, walls, grains, frame)
        forces = _frame(frame, contacts, waves, sweeps, kept, rng)
        frames.append(_compared(forces, frames[-1] if frames else None, grains, tracks.present[frame]))
        statistics.append(_statistics(forces, grains.count))
    return Results("fake", tracks, walls, grains, FRICTION, frames, statistics, CONFIGURATION)


def contacts_at(tracks: Tracks, walls: WallTracks, grains: Grains, frame: int) -> Contacts:
    endpoints = walls.endpoints[frame]
    fixed = Walls.at_rest(endpoints)
    return detect_contacts(grains, tracks.position[frame], tracks.present[frame], fixed, 0.03 * RADIUS)


def make_tuning() -> RadiusTuning:
    """Return a curve z(δR) that reaches 3.5 at 12 µm."""
    change = np.linspace(-1e-4, 1e-4, 21)
    number = 3.5 + 0.4 * np.tanh((change - 1.2e-5) / 4e-5)
    return RadiusTuning(change, number, number[:, None], 3.5, 1.2e-5, 3.5)


def with_fringes(results: Results) -> Results:
    """Return the results with fringes that grow with the root of the forces on a disc."""
    fringes = np.zeros((results.tracks.frame_count, results.tracks.grain_count))
    for k, forces in enumerate(results.frames):
        fringes[k] = np.sqrt(sum_on_grains(forces.contacts, forces.fn)[: results.tracks.grain_count])
    found = compare_with_fringes(fringes, results.tracks.present, results.frames)
    return replace(results, tracks=replace(results.tracks, fringes=fringes), fringes=found)


def make_truth(results: Results, rng: np.random.Generator) -> TruthContacts:
    """Return the forces of the results with 10 % of noise, on all but a few of the weaker half of the contacts."""
    parts = []
    for forces in results.frames:
        weak = forces.fn < np.median(forces.fn)
        kept = (rng.random(forces.contacts.count) > 0.06) | ~weak
        noise = 1.0 + 0.1 * rng.standard_normal((2, int(kept.sum())))
        i, j = forces.contacts.i[kept], forces.contacts.j[kept]
        parts.append((np.full(len(i), forces.frame), i, j, forces.fn[kept] * noise[0], forces.ft[kept] * noise[1]))
    frame, i, j, fn, ft = (np.concatenate(column) for column in zip(*parts, strict=True))
    return TruthContacts(frame.astype(np.int64), i.astype(np.int64), j.astype(np.int64), fn, ft)


def _shear(frame_count: int, columns: int, rows: int, rng: np.random.Generator) -> tuple[Tracks, WallTracks]:
    row, column = np.divmod(np.arange(rows * columns), columns)
    step = 2.0 * RADIUS * 1.008
    rest = np.stack([column * step + (row % 2) * 0.5 * step, row * step * np.sqrt(0.75)], axis=1) + RADIUS
    rest = rest + rng.normal(0.0, 0.008 * RADIUS, rest.shape)
    shear = np.radians(0.25) * np.arange(frame_count)
    position = np.repeat(rest[None], frame_count, axis=0)
    position[:, :, 0] += np.tan(shear)[:, None] * rest[:, 1]
    position += rng.normal(0.0, 0.003 * RADIUS, position.shape).cumsum(axis=0)
    rotation = (rng.normal(0.0, 0.08, (frame_count, len(rest)))).cumsum(axis=0)
    rotation -= rotation[0]
    f, n = rotation.shape
    ids = np.arange(n, dtype=np.int64) + 100
    tracks = Tracks(
        ids, np.full(n, RADIUS), 30.0 * np.arange(f), position, rotation, np.full((f, n), 1e-5),
        np.full((f, n), 0.97), np.full((f, n), TrackStatus.OK, np.uint8),
    )  # fmt: skip
    right, top = (columns - 0.5) * step + 2.0 * RADIUS, (rows - 1) * step * np.sqrt(0.75) + 2.0 * RADIUS
    corner = np.array([[0.0, 0.0], [right, 0.0], [right, top], [0.0, top]])
    corners = np.repeat(corner[None], frame_count, axis=0)
    corners[:, :, 0] += np.tan(shear)[:, None] * corner[:, 1]
    endpoints = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    return tracks, WallTracks(WALL_NAMES, endpoints, np.array([np.nan, np.nan, 50e3, np.nan]))


def _frame(
    frame: int,
    contacts: Contacts,
    waves: tuple[np.ndarray, np.ndarray],
    sweeps: int,
    recorded: np.ndarray,
    rng: np.random.Generator,
) -> FrameForces:
    """Return forces that vary smoothly over the packing and are greater along one direction."""
    number, phase = waves
    ripple = np.sin(contacts.point / RADIUS @ (0.45 * number.T) + phase + 0.05 * frame).sum(axis=1)
    along = (contacts.normal @ np.array([np.cos(2.2), np.sin(2.2)])) ** 2
    fn = 40.0 * np.exp(0.45 * ripple + 1.2 * along - 0.6) * rng.uniform(0.85, 1.15, contacts.count)
    fn[rng.random(contacts.count) < 0.12] = 0.0
    mobilisation = np.clip(rng.normal(0.0, 0.5, contacts.count), -1.0, 1.0)
    ft = FRICTION * fn * mobilisation
    state = np.where(np.abs(mobilisation) >= 1.0, ContactState.SLIDING, ContactState.STICKING)
    state = np.where(fn == 0.0, ContactState.OPEN, state).astype(np.uint8)
    progress = 1.0 - 0.9 * np.exp(-recorded / (0.15 * sweeps + 1.0))
    wobble = 1.0 + np.exp(-recorded / (0.1 * sweeps + 1.0))[:, None] * rng.normal(0.0, 0.4, (len(recorded), len(fn)))
    history_fn = np.maximum(fn * progress[:, None] * wobble, 0.0).astype(np.float32)
    decay = np.exp(-np.arange(sweeps) / (0.08 * sweeps + 1.0))
    history = SweepHistory(decay + 1e-6, 0.3 * decay + 1e-7, 5.0 * decay + 1e-4, recorded.astype(np.int64),
                           history_fn, (0.1 * history_fn).astype(np.float32))  # fmt: skip
    reached = (float(history.natural_map[-1]), float(history.unbalance[-1])) if sweeps else (np.nan, np.nan)
    status = STATUSES[min(frame, len(STATUSES) - 1)]
    nan = np.full(contacts.count, np.nan)
    return FrameForces(
        frame, contacts, fn, ft, fn.copy(), ft.copy(), 1e-9 * nan, 1e-9 * nan, state,
        np.full(contacts.count, frame, np.int32), np.zeros(contacts.count, np.uint8), nan, 0.1 * fn + 4.0,
        0.1 * np.abs(ft) + 1.0, status, f"{status.name.lower()}: invented", sweeps, reached[0],
        reached[1], 0.02, 0.06 + 0.1 * np.exp(-frame), 0.03 if frame else np.nan,
        0.95 - 0.3 * float(np.exp(-frame)), frame, history,
        strain=0.5 * np.radians(0.25) * frame * np.array([[0.0, 1.0], [1.0, 0.0]]),
    )  # fmt: skip


def _compared(forces: FrameForces, former: FrameForces | None, grains: Grains, present: np.ndarray) -> FrameForces:
    """Add the comparison with the frame before and the unbalance of the grains."""
    weightless = np.zeros((grains.count, 2))
    unbalance = grain_unbalance(forces.contacts, forces.fn, forces.ft, weightless, present)
    cold = 0.5 / np.sqrt(COLD_SWEEPS)
    forces = replace(
        forces, grain_unbalance=unbalance, cold_residual=cold, new_contact_count=0.0, lost_contact_count=0.0
    )
    if former is None:
        return forces
    memory = ForceMemory(former.contacts.key, np.column_stack([former.fn, former.ft]))
    changes = find_changes(memory, forces.contacts, forces.fn, present)
    return replace(
        forces, similarity=changes.similarity, new_contact_count=changes.new, lost_contact_count=changes.lost,
        warm_residual=1e-3, sweeps_saved=100.0,
    )  # fmt: skip


def _statistics(forces: FrameForces, grain_count: int) -> FrameStatistics:
    contacts, loaded = forces.contacts, forces.fn > 0.0
    stress = np.einsum("c,ca,cb->ab", forces.fn, contacts.normal, contacts.normal)
    pressure = 0.5 * np.trace(stress)
    stress = stress * 50e3 / pressure
    low, high = np.linalg.eigvalsh(stress)
    axis = np.linalg.eigh(stress)[1][:, 1]
    fabric = np.einsum("ca,cb->ab", contacts.normal[loaded], contacts.normal[loaded]) / loaded.sum()
    values = np.linalg.eigvalsh(fabric)
    sliding = float((forces.state == ContactState.SLIDING).sum() / loaded.sum())
    known = {
        "area": 0.01, "stress": stress, "pressure": 50e3, "wall_ratio_angle": 0.2,
        "friction_angle": float(np.arcsin((high - low) / (high + low))),
        "principal_direction": float(np.arctan2(axis[1], axis[0])),
        "coordination_number": 2.0 * float(loaded.sum()) / grain_count,
        "coordination_number_without_rattlers": 2.1 * float(loaded.sum()) / grain_count,
        "rattler_count": 3, "contact_count": int(loaded.sum()), "sliding_fraction": sliding,
        "mean_fn": float(forces.fn[loaded].mean()), "max_fn": float(forces.fn.max()), "fabric": fabric,
        "fabric_anisotropy": 2.0 * float(values[1] - values[0]),
        "sigma_1": float(high), "sigma_2": float(low), "wall_force": _wall_forces(forces),
        "wall_normal_force": np.arange(4.0), "wall_tangential_force": 0.1 * np.arange(4.0),
        "contact_anisotropy": 0.2, "branch_anisotropy": 0.01, "normal_force_anisotropy": 0.3,
        "tangential_force_anisotropy": 0.05, "friction_angle_of_anisotropies": 0.25, "mobilisation": 0.5,
        "tail_exponent": 1.2, "plateau_ratio": 1.1, "strong_fraction": 0.4, "strong_pressure_fraction": 0.75,
        "strong_deviator_fraction": 0.95, "chain_count": 7, "chain_grain_fraction": 0.4,
    }  # fmt: skip
    unread = {field.name: np.nan for field in fields(FrameStatistics)}  # not shown by a recording
    unread |= {"fn_density": np.full(FORCE_BINS, np.nan), "ft_density": np.full(FORCE_BINS, np.nan)}
    unread |= {"mobilisation_density": np.full(MOBILISATION_BINS, np.nan), "anisotropy_direction": np.full(4, np.nan)}
    return FrameStatistics(**(unread | known))


def _wall_forces(forces: FrameForces) -> np.ndarray:
    contacts, walls = forces.contacts, forces.contacts.with_wall
    force = np.zeros((contacts.wall_count, 2))
    np.add.at(force, contacts.j[walls] - contacts.grain_count, (forces.fn[:, None] * contacts.normal)[walls])
    return force
