"""The forces of the sample by an earlier version; refactoring must not change them.

TOLERANCE: the sequential sweeps are deterministic, so that one machine gives the same bits. Another instruction set
rounds differently: kernels compiled for a generic processor and another BLAS changed the sample's forces by at most
2e-11 of the mean force. A change of mechanics gives more than 1e-6.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

SETTING = "solver.positions=never"  # draws of a sampler differ permanently if a processor rounds one differently
STORED = Path(__file__).with_name("sample.npz")
TOLERANCE = 1e-9  # of the mean force, and of a metre
DATASETS = ("contacts/offset", "contacts/i", "contacts/j", "forces/fn", "forces/ft", "frames/trust", "frames/status")


def renew(results: Path) -> None:
    """Store the forces of a run of the sample, after an intended change of the forces only."""
    with h5py.File(results) as run:
        plain = {name: np.asarray(run[name][()]) for name in (*DATASETS, "tracks/position")}
    kinds = {"contacts/i": np.int16, "contacts/j": np.int16, "frames/status": np.uint8}
    np.savez_compressed(
        STORED, **{name: values.astype(kinds.get(name, values.dtype.str)) for name, values in plain.items()}
    )


def differences(results: Path) -> dict[str, float]:
    """Return the greatest difference of every dataset of a run from the stored one, forces over their mean."""
    found = {}
    with h5py.File(results) as run, np.load(STORED) as stored:
        for name in stored.files:
            now, then = np.asarray(run[name][()], np.float64), stored[name].astype(np.float64)
            if now.shape != then.shape:
                found[name] = np.inf
                continue
            unit = float(then[then > 0].mean()) if name.startswith("forces/") else 1.0
            known = ~(np.isnan(now) & np.isnan(then))
            found[name] = float(np.abs(now - then)[known].max(initial=0.0)) / unit
    return found
