"""Information that sliding and gaps carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.motion_information import (
    FEW,
    MotionInformation,
    measure_motion_information,
    motion_scale,
    undetermined_fraction,
)
from rodsight.solver.bodies.motion import FrameMotion, no_motion
from rodsight.solver.contacts.contacts import Contacts, detect_contacts

from tests.solver.posterior.test_sequence_evidence import RADIUS, lattice_sequence

NOISE = 1e-5  # [m]
INTERVAL = 20.0  # [s]


@pytest.fixture(scope="module")
def lattice():
    packing, snapshots = lattice_sequence(0.0)
    snapshot = replace(snapshots[0], sigma=NOISE)
    walls = packing.walls_of(snapshot)
    contacts = detect_contacts(packing.grains, snapshot.position, snapshot.present, walls, 1e-6)
    assert contacts.with_wall.any()
    return packing, snapshot, walls, contacts


def rolling(snapshot, distance: float) -> FrameMotion:
    """All rods turn alike, so that each slides by `distance` [m] at a wall and by twice that at another rod."""
    still = no_motion(snapshot)
    spin = np.full(len(snapshot.present), distance / RADIUS / INTERVAL)
    return replace(still, interval=INTERVAL, grains=replace(still.grains, spin=spin), ends_here=True)


def measure(
    lattice, motion: FrameMotion, contacts: Contacts | None = None, fn=None, *, soft: bool = False
) -> MotionInformation:
    packing, snapshot, walls, known = lattice
    contacts = known if contacts is None else contacts
    fn = np.ones(contacts.count) if fn is None else fn
    return measure_motion_information(packing, snapshot, motion, contacts, fn, walls, soft=soft)


def test_sliding_counts_beyond_three_standard_deviations_of_its_noise(lattice):
    """At a wall only the two components of one rod have noise, at a pair twice as many: 2 σ and √8 σ."""
    _, snapshot, _, contacts = lattice
    between = float((~contacts.with_wall).mean())
    for distance, expected in ((3.5, 0.0), (4.5, between), (6.5, 1.0)):
        assert measure(lattice, rolling(snapshot, distance * NOISE)).sliding == pytest.approx(expected)


def test_the_signal_is_the_sliding_over_its_noise_less_the_noise(lattice):
    _, snapshot, _, contacts = lattice
    wall = contacts.with_wall
    slid, noise = np.where(wall, 5.0, 10.0), np.where(wall, 4.0, 8.0)
    expected = np.sqrt(np.mean(slid**2) / noise.mean() - 1.0)
    assert measure(lattice, rolling(snapshot, 5.0 * NOISE)).slide_signal == pytest.approx(expected)
    assert measure(lattice, rolling(snapshot, 0.0)).slide_signal == 0.0
    none = measure(lattice, rolling(snapshot, 0.0), fn=np.zeros(contacts.count))
    assert np.isnan([none.slide_signal, none.sliding, none.gap_error]).all()


def spinning(lattice, rods: int):
    """Motion in which the first rods turn and all others rest, and their contacts (c,)."""
    _, snapshot, _, contacts = lattice
    motion = rolling(snapshot, 0.0)
    motion.grains.spin[:rods] = 1e3 * NOISE / RADIUS / INTERVAL
    return motion, (contacts.i < rods) | (contacts.j < rods) & ~contacts.with_wall


def test_rods_that_roll_freely_are_no_signal_of_sliding(lattice):
    """They bear nothing, and their sliding shows no force; of a packing at rest it would be nearly all the signal."""
    rods = len(lattice[1].present) // 3
    motion, touched = spinning(lattice, rods)
    assert measure(lattice, motion).slide_signal > 10.0
    assert measure(lattice, motion, fn=np.where(touched, 0.05, 1.0)).slide_signal == 0.0


def test_few_contacts_that_slide_are_no_signal_whatever_they_bear(lattice):
    contacts = lattice[3]
    motion, touched = spinning(lattice, 1)
    rest = np.flatnonzero(~touched)
    few = contacts.select(np.r_[np.flatnonzero(touched)[:1], np.tile(rest, 40 // len(rest) + 1)])
    assert 0.0 < 1.0 / few.count < FEW
    assert measure(lattice, motion, few).slide_signal == 0.0
    half = contacts.select(np.r_[np.flatnonzero(touched), rest[: touched.sum()]])
    assert measure(lattice, motion, half).slide_signal > 10.0


def test_the_error_of_gaps_is_that_of_strong_contacts_without_noise(lattice):
    _, snapshot, _, contacts = lattice
    rng, error = np.random.default_rng(3), 2e-5
    noise = NOISE * np.where(contacts.with_wall, 1.0, np.sqrt(2.0))
    gap = rng.normal(0.0, np.hypot(noise, error))
    fn = np.where(rng.random(contacts.count) < 0.3, 0.1, 1.0)
    gap[fn < 0.5] += 1e-3 * rng.random((fn < 0.5).sum())  # weak contacts may be open
    found = measure(lattice, rolling(snapshot, 0.0), replace(contacts, gap=gap), fn)
    assert found.gap_error == pytest.approx(error, rel=0.1)
    exact = replace(contacts, gap=rng.normal(0.0, 0.5 * noise))
    assert measure(lattice, rolling(snapshot, 0.0), exact, fn).gap_error == 0.0


def test_overlaps_by_the_forces_of_soft_grains_are_explained(lattice):
    _, snapshot, _, contacts = lattice
    rng, error, compliance = np.random.default_rng(4), 2e-5, 1e-4
    fn = rng.uniform(1.0, 3.0, contacts.count)
    noise = NOISE * np.where(contacts.with_wall, 1.0, np.sqrt(2.0))
    gap = rng.normal(0.0, np.hypot(noise, error)) - compliance * fn
    still, seen = rolling(snapshot, 0.0), replace(contacts, gap=gap)
    found = measure(lattice, still, seen, fn, soft=True)
    assert found.gap_error > 2.0 * error
    assert found.unexplained_gap == pytest.approx(error, rel=0.15)
    assert measure(lattice, still, seen, fn).unexplained_gap == found.gap_error  # hard grains have no such overlaps
    opened = measure(lattice, still, replace(contacts, gap=gap + 2.0 * compliance * fn), fn, soft=True)
    assert opened.unexplained_gap == opened.gap_error  # forces open no gaps


def test_displacements_are_those_of_the_whole_interval(lattice):
    _, snapshot, _, _ = lattice
    rng = np.random.default_rng(4)
    motion = rolling(snapshot, 0.0)
    velocity = rng.normal(0.0, 1e-4 / INTERVAL, snapshot.position.shape)
    moving = replace(motion, grains=replace(motion.grains, velocity=velocity))
    assert motion_scale(moving, NOISE) == pytest.approx(1e-4, rel=0.3)
    alone = replace(moving, grains=replace(moving.grains, present=np.arange(len(velocity)) == 3))
    assert np.isnan(motion_scale(alone, NOISE))


def test_only_grains_beside_a_wall_can_be_beyond_it(lattice):
    packing, snapshot, walls, contacts = lattice
    right, top = walls.endpoints[:, :, 0].max(), walls.endpoints[:, :, 1].max()
    position = snapshot.position.copy()
    position[0] = right + RADIUS, 0.5 * top
    position[1] = right + RADIUS, top + RADIUS  # beyond the corner, beside no wall
    moved = packing, replace(snapshot, position=position), walls, contacts
    assert measure(moved, rolling(snapshot, 0.0)).beyond == 1
    imposed = replace(packing.grains, boundary=np.arange(packing.grains.count) == 0)
    moved = replace(packing, grains=imposed), *moved[1:]
    assert measure(moved, rolling(snapshot, 0.0)).beyond == 0
    assert measure(lattice, rolling(snapshot, 0.0)).beyond == 0


def test_grains_that_lie_beside_the_apparatus_are_no_part_of_the_packing(lattice):
    packing, snapshot, walls, contacts = lattice
    position = snapshot.position.copy()
    position[:2, 0] = walls.endpoints[:, :, 0].max() + 5.0 * RADIUS
    beside = packing, replace(snapshot, position=position), walls, contacts
    two = (contacts.i < 2) & (contacts.j < 2) & ~contacts.with_wall
    assert two.any()
    inside = (contacts.i > 1) & (contacts.j > 1)
    for chosen, beyond in ((inside, 0), (inside | two, 0), (np.ones(contacts.count, np.bool_), 2)):
        pairs = contacts.select(chosen)
        assert measure(beside, rolling(snapshot, 0.0), pairs).beyond == beyond


def test_balance_leaves_open_what_grains_do_not_determine(lattice):
    _, snapshot, _, contacts = lattice
    n = len(snapshot.present)
    everything = np.ones(n, np.bool_)
    force = np.ones(contacts.count)
    left = 1.0 - 3.0 * n / (2.0 * contacts.count)
    assert undetermined_fraction(contacts, force, everything) == pytest.approx(left)
    assert measure(lattice, no_motion(snapshot)).undetermined == pytest.approx(left)
    outer = everything.copy()
    outer[: n // 2] = False
    more = 1.0 - 3.0 * (n - n // 2) / (2.0 * contacts.count)
    assert undetermined_fraction(contacts, force, outer) == pytest.approx(more)


def test_contacts_that_hold_nothing_and_grains_without_contact_do_not_count(lattice):
    _, snapshot, _, contacts = lattice
    everything = np.ones(len(snapshot.present), np.bool_)
    force, pair = np.ones(contacts.count), int(np.flatnonzero(~contacts.with_wall)[0])
    force[:] = 1e-6
    force[pair] = 1.0  # of two rods: six equations for two components
    assert undetermined_fraction(contacts, force, everything) == pytest.approx(1.0 - 3.0)
    wall = int(np.flatnonzero(contacts.with_wall)[0])
    assert undetermined_fraction(contacts, np.arange(contacts.count) == wall, everything) == pytest.approx(1.0 - 1.5)
    assert np.isnan(undetermined_fraction(contacts, np.zeros(contacts.count), everything))
