"""Photographs count once they are whole, in order, and late ones are waited for."""

import cv2
import numpy as np
import pytest
from rodsight.following.arrivals import LATE, STEADY, Arrivals


class Clock:
    now = 0.0

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
    """What is ready once everything has stayed as it is for a while."""
    arrivals.look()
    clock.now += 2 * STEADY
    return [file.name for file in arrivals.look()]


def test_a_file_counts_once_it_has_stayed_as_it_is(arrivals, tmp_path, clock):
    (tmp_path / "a1.png").write_bytes(PICTURE)
    assert arrivals.look() == []
    clock.now += 0.5 * STEADY
    assert arrivals.look() == []
    clock.now += STEADY
    assert [file.name for file in arrivals.look()] == ["a1.png"]


def test_half_a_file_is_waited_for_however_long_it_stays_so(arrivals, tmp_path, clock):
    (tmp_path / "a1.png").write_bytes(PICTURE[: len(PICTURE) // 2])
    assert settled(arrivals, clock) == []
    clock.now += 1000.0
    assert settled(arrivals, clock) == []
    (tmp_path / "a1.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png"]


def test_what_comes_after_half_a_file_waits_for_it(arrivals, tmp_path, clock):
    (tmp_path / "a1.png").write_bytes(PICTURE)
    (tmp_path / "a2.png").write_bytes(PICTURE[:100])
    (tmp_path / "a3.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png"]


def test_a_late_photograph_is_waited_for_and_then_done_without(arrivals, tmp_path, clock):
    for number in (8, 10, 12, 16):
        (tmp_path / f"a{number}.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a8.png", "a10.png", "a12.png"]
    clock.now += 0.5 * LATE
    assert len(arrivals.look()) == 3
    clock.now += LATE
    assert len(arrivals.look()) == 4


def test_a_late_photograph_that_comes_fills_its_gap(arrivals, tmp_path, clock):
    for number in (1, 2, 4):
        (tmp_path / f"a{number}.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png", "a2.png"]
    (tmp_path / "a3.png").write_bytes(PICTURE)
    assert settled(arrivals, clock) == ["a1.png", "a2.png", "a3.png", "a4.png"]
