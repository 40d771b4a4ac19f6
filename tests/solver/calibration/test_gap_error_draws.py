import numpy as np
from rodsight.solver.calibration.gap_error_draws import GapErrorDraws
from rodsight.solver.calibration.gaps import GapRows, MeasuredSequence

FRAMES, GRAINS, FACTOR = 3, 4, 1.5


def test_noise_of_a_position_enters_all_gaps_of_its_grain_in_that_frame() -> None:
    rng = np.random.default_rng(0)
    present = np.ones((FRAMES, GRAINS), bool)
    present[2, 3] = False
    sigma, position = rng.uniform(1e-6, 2e-6, (FRAMES, GRAINS)), rng.normal(0.0, 1.0, (FRAMES, GRAINS, 2))
    ends = np.zeros((FRAMES, 1, 2, 2))
    sequence = MeasuredSequence(np.ones(GRAINS), position, np.zeros((FRAMES, GRAINS)), present, ends, sigma)
    frame, i, j = np.array([[0, 0, 1], [1, 0, 1], [1, 2, 4], [2, 1, 3]], np.int32).T
    rows = GapRows(frame, i, j, np.arange(4, dtype=np.int32))
    angle = rng.uniform(0.0, 6.0, 4)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = GapErrorDraws(sequence, rows, normal, FACTOR).draw(np.random.default_rng(7))

    noise = np.random.default_rng(7).standard_normal(position.shape) * FACTOR * np.where(present, sigma, 0.0)[..., None]
    for c, (k, i, j) in enumerate(zip(rows.frame, rows.i, rows.j, strict=True)):
        moved = (noise[k, j] if j < GRAINS else 0.0) - noise[k, i]  # a wall has no noise
        np.testing.assert_allclose(found[c], normal[c] @ moved, rtol=1e-12)
