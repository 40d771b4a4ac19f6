import numpy as np
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.interpolation import interpolate_lost_grains
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.convex.ensemble_members import Slip, advance_convex_member, measured_slip, read_slip, steady_slip
from rodsight.solver.convex.program import Balance, LoadScale, assemble_balance, solve_convex_member
from rodsight.solver.detection.touch_probability import probable_contacts, window_of
from rodsight.solver.nlgs.force_memory import ForceMemory

R = 0.01
SAME = 1e-9  # the same program twice
NOISE_LEFT = 0.02  # of the sliding scale: the threshold is crossed by one contact in ten thousand, by little
SHEAR = 2e-3  # per frame: rows slide over each other by 2 R SHEAR √3 / 2 = 35 µm


def box(width: float, height: float, slant: float) -> np.ndarray:
    corner = np.array([[0, 0], [width, 0], [width + slant * height, height], [slant * height, height]])
    return np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)


def sheared(frames: int, lost: dict[int, list[int]] | None = None, noise: float = 1e-7) -> list[Snapshot]:
    """Rows of a square lattice that slide over each other without rotation."""
    rng = np.random.default_rng(0)
    start = R * (1 + 2 * np.stack(np.meshgrid(np.arange(5), np.arange(5)), axis=-1).reshape(-1, 2))
    snapshots = []
    for f in range(frames):
        position = start + np.outer(start[:, 1], [SHEAR * f, 0.0]) + rng.normal(scale=noise, size=(25, 2))
        present = np.ones(25, bool)
        present[(lost or {}).get(f, [])] = False
        position[~present] = np.nan
        snapshots.append(Snapshot(30.0 * f, position, np.zeros(25), present, box(10 * R, 10 * R, SHEAR * f), noise))
    return snapshots


def problem(frame: Snapshot) -> tuple[Grains, Walls, Contacts, Balance]:
    grains = Grains.of_rods(np.full(25, R), density=2700.0, length=0.06)
    walls = Walls(frame.endpoints, np.zeros((4, 2, 2)), np.array([np.nan, np.nan, 100.0, np.nan]))
    contacts = detect_contacts(grains, frame.position, frame.present, walls, 1e-5)
    balance = assemble_balance(
        contacts, grains, walls, present=frame.present, friction=np.full(contacts.count, 0.25), scale=LoadScale(20.0)
    )
    return grains, walls, contacts, balance


def test_sliding_rows_have_slip():
    frames = sheared(2)
    grains, walls, contacts, _ = problem(frames[1])
    slip = measured_slip(contacts, grains, walls, (frames[0], frames[1]))
    upright = ~contacts.with_wall & (np.abs(contacts.normal[:, 1]) > 0.9)
    level = ~contacts.with_wall & ~upright
    # The upper grain moves to the right, along −t of a contact whose normal points up.
    assert np.all(slip[upright] < -0.1)
    np.testing.assert_allclose(slip[level], 0.0, atol=NOISE_LEFT)


def test_an_unmeasured_motion_has_no_slip():
    frames = sheared(2, lost={0: [12]})
    grains, walls, contacts, _ = problem(frames[1])
    slip = measured_slip(contacts, grains, walls, (frames[0], frames[1]))
    touched = (contacts.i == 12) | (contacts.j == 12)
    assert touched.any()
    np.testing.assert_array_equal(slip[touched], 0.0)
    assert np.any(slip[~touched] != 0)


def test_noise_reduces_the_weight_of_a_member():
    weight = []
    for noise in (1e-7, 4e-6, 4e-5):
        frames = sheared(2, noise=noise)
        grains, walls, contacts, _ = problem(frames[1])
        weight.append(read_slip(contacts, grains, walls, (frames[0], frames[1])).weight)
    assert weight[0] > 0.99
    assert weight[0] > weight[1] > weight[2]
    assert weight[2] < 0.5


def test_only_sliding_on_both_sides_of_a_frame_is_steady():
    before, after = Slip(np.array([1.0, -2.0, 1.0, 0.0]), 0.9), Slip(np.array([0.5, -3.0, -1.0, 1.0]), 0.8)
    steady = steady_slip(before, after)
    assert steady.value.tolist() == [0.5, -2.0, 0.0, 0.0]
    assert steady.weight == 0.8


def test_a_member_uses_its_own_previous_forces():
    frames = sheared(3)
    memory = ForceMemory.empty()
    for k in (1, 2):
        grains, walls, contacts, balance = problem(frames[k])
        previous, sure = memory.recall(contacts), np.ones(contacts.count)
        interval = (frames[k - 1], frames[k])
        slip = read_slip(contacts, grains, walls, interval)
        forces, memory = advance_convex_member(balance, contacts, frames[k], slip, sure, memory)
        noise = 1.0 - slip.weight
        again = solve_convex_member(balance, slip.value, sure, previous[:, 0], previous[:, 1], noise=noise)
        np.testing.assert_allclose(forces.fn, again.fn, atol=SAME)
        np.testing.assert_allclose(memory.recall(contacts)[:, 1], forces.ft, atol=SAME)
    assert forces.converged
    assert previous.any()


def test_a_lost_grain_keeps_its_contacts():
    whole, holed = sheared(5), sheared(5, lost={2: [12]})
    grains = Grains.of_rods(np.full(25, R), density=2700.0, length=0.06)
    window = window_of(2, 5)
    contacts, probability = probable_contacts(grains, [whole[f] for f in window], 2)
    frame, bridged = interpolate_lost_grains([holed[f] for f in window], 2)
    kept, kept_probability = probable_contacts(grains, [holed[f] for f in window], 2, frame=frame)
    dropped, _ = probable_contacts(grains, [holed[f] for f in window], 2)
    assert np.flatnonzero(bridged).tolist() == [12]
    np.testing.assert_array_equal(kept.key, contacts.key)
    of_it = (kept.i == 12) | (kept.j == 12)
    assert of_it.sum() == 4
    assert dropped.count == contacts.count - 4
    # One missing photograph of five does not make the contacts ambiguous.
    assert np.all(kept_probability[of_it] > 0.5)
    assert np.all(probability[of_it] > 0.9)
