"""Photographs are used when they are complete, in order, with a delay for late ones."""

import os

import cv2
import numpy as np
import pytest
from rodsight.following.arrivals import MAX_DELAY, STEADY_TIME, Arrivals


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def arrivals(tmp_path, clock):
    return Arrivals(tmp_path, "*.png", clock=clock)


PICTURE = cv2.imencode(".png", np.random.default_rng(1).integers(0, 255, (40, 50), np.uint8))[1].tobytes()


def settled(arrivals, clock):
    """Return the complete files after the steady time."""
    arrivals.complete_files()
    clock.now += 2 * STEADY_TIME
    return [file.name for file in arrivals.complete_files()]


def test_a_file_is_used_when_it_has_not_changed_for_a_while(arrivals, tmp_path, clock):
    (tmp_path / "a1.png").write_bytes(PICTURE)
    assert arrivals.complete_files() == []
    clock.now += 0.5 * STEADY_TIME
    assert arrivals.complete_files() == []
    clock.now += STEADY_TIME
    assert [file.name for file in arrivals.complete_files()] == ["a1.png"]


def test_an_incomplete_file_is_never_used(arrivals, tmp_path, clock):
    (tmp_path / "a1.png").write_bytes(PICTURE[: len(PICTURE) // 2])
    assert settled(arrivals, clock) == []
    clock.now += 1000.0
    assert settled(arrivals, clock) == []
    (tmp_path / "a1.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png"]


@pytest.mark.parametrize("later", [PICTURE + b"more", PICTURE], ids=["longer", "as long"])
def test_a_file_that_changes_is_waited_for_again(arrivals, tmp_path, clock, later):
    file = tmp_path / "a1.png"
    file.write_bytes(PICTURE)
    assert arrivals.complete_files() == []
    clock.now += 0.8 * STEADY_TIME
    file.write_bytes(later)
    os.utime(file, ns=(1, 1))
    assert arrivals.complete_files() == []
    clock.now += 0.8 * STEADY_TIME
    assert arrivals.complete_files() == []
    clock.now += 0.8 * STEADY_TIME
    assert arrivals.complete_files() == [file]


def test_files_after_an_incomplete_one_are_held_back(arrivals, tmp_path, clock):
    (tmp_path / "a1.png").write_bytes(PICTURE)
    (tmp_path / "a2.png").write_bytes(PICTURE[:100])
    (tmp_path / "a3.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png"]


def test_a_late_photograph_is_waited_for_and_then_skipped(arrivals, tmp_path, clock):
    for number in (8, 10, 12, 16):
        (tmp_path / f"a{number}.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a8.png", "a10.png", "a12.png"]
    clock.now += 0.5 * MAX_DELAY
    assert len(arrivals.complete_files()) == 3
    clock.now += MAX_DELAY
    assert len(arrivals.complete_files()) == 4


def test_a_late_photograph_fills_its_gap(arrivals, tmp_path, clock):
    for number in (1, 2, 4):
        (tmp_path / f"a{number}.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png", "a2.png"]
    (tmp_path / "a3.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png", "a2.png", "a3.png", "a4.png"]


def test_every_gap_is_waited_for(arrivals, tmp_path, clock):
    for number in (1, 2, 4):
        (tmp_path / f"a{number}.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png", "a2.png"]
    (tmp_path / "a3.png").write_bytes(PICTURE)
    assert len(settled(arrivals, clock)) == 4
    clock.now += MAX_DELAY
    (tmp_path / "a7.png").write_bytes(PICTURE)
    assert len(settled(arrivals, clock)) == 4


@pytest.mark.parametrize("names", [("a1", "a5"), ("early", "late", "soon"), ("a1", "b1", "c5")])
def test_too_few_or_unnumbered_files_have_no_gap(arrivals, tmp_path, clock, names):
    for name in names:
        (tmp_path / f"{name}.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == [f"{name}.png" for name in names]
