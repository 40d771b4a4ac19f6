"""Numbers in the recording: unknown values are null, never NaN.

The viewer shows a null as absent, curves have a gap there, and two recordings of one run compare equal (NaN differs
from itself).
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from .clock import Clock


def nullable(values: NDArray[np.floating]) -> pa.Array:
    """Return values (k,) as an array with nulls where they are not finite."""
    finite = np.isfinite(values)
    # The value below a null is not shown but is compared, so that it must not be NaN either.
    return pa.array(np.where(finite, values, 0.0).astype(values.dtype), mask=~finite)


def log_scalar(clock: Clock, path: str, value: float) -> None:
    """Log one point of a curve, a gap if the value is not finite."""
    clock.send_point(path, [value] if np.isfinite(value) else [])


def log_scalars(clock: Clock, path: str, values: Array) -> None:
    """Log one point of several curves of one path, a gap if any value is not finite."""
    clock.send_point(path, values.tolist() if np.all(np.isfinite(values)) else [])


def send_scalars(clock: Clock, path: str, when: rr.TimeColumn, values: Array) -> None:
    """Send many points (k,) of a curve, with gaps where values are not finite."""
    finite = np.isfinite(values)
    columns = rr.Scalars.columns(scalars=values[finite])
    clock.send(path, [when], columns.partition(finite.astype(np.int64)))
