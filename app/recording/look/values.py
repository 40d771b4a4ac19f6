"""Values in the form of the recording: unknown numbers are null, lengths have 32 bits, colours are packed.

The viewer shows a null as absent, curves have a gap there, and two recordings of one run compare equal (NaN differs
from itself).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from ...solver.bodies.grains import Array
from .clock import Clock
from .colours import Rgba, packed_one

Colours = Rgba | NDArray[np.uint32] | np.uint32  # one for all, or packed ones


def nullable(values: NDArray[np.floating]) -> pa.Array:
    """Return values (k,) as an array with nulls where they are not finite."""
    finite = np.isfinite(values)
    # The value below a null is not shown but is compared, so that it must not be NaN either.
    return pa.array(np.where(finite, values, 0.0).astype(values.dtype), mask=~finite)


def strips(lines: Sequence[Any] | NDArray[Any], radius: ArrayLike, colour: Colours, order: float) -> rr.LineStrips2D:
    """Return lines with half widths [px]; those of a higher order are drawn above others."""
    lines = np.asarray(lines, np.float32) if isinstance(lines, np.ndarray) else lines
    return rr.LineStrips2D(lines, radii=_single(radius), colors=_packed(colour), draw_order=order)


def dots(points: ArrayLike, radius: ArrayLike, colour: Colours, order: float) -> rr.Points2D:
    """Return points with radii [px]; those of a higher order are drawn above others."""
    return rr.Points2D(_single(points), radii=_single(radius), colors=_packed(colour), draw_order=order)


def log_curve_style(stream: rr.RecordingStream, path: str, name: str, colour: Rgba, width: float = 2.0) -> None:
    """Log the name and the look of a curve, static."""
    stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=width), static=True)


def _single(values: Any) -> Any:
    return np.float32(values) if np.ndim(values) == 0 else np.asarray(values, np.float32)


def _packed(colour: Colours) -> Any:
    return packed_one(colour) if isinstance(colour, tuple) else colour


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
