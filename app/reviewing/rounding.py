"""Numbers as JSON and tables carry them: five significant digits, None for NaN and infinities."""

from __future__ import annotations

from typing import Any

import numpy as np


def rounded(values: Any) -> list[float | None]:
    """Round numbers to five significant digits; NaN and infinities become None."""
    given = np.asarray(values, np.float64).ravel()
    finite = np.isfinite(given)
    number = np.where(finite, given, 0.0)
    exponent = np.floor(np.log10(np.where(number == 0.0, 1.0, np.abs(number))))
    # Two factors, each a whole power of ten: both are exact.
    up, down = 10.0 ** np.clip(4.0 - exponent, 0.0, None), 10.0 ** np.clip(exponent - 4.0, 0.0, None)
    result: list[float | None] = (np.round(number * up / down) * down / up).tolist()
    for k in np.flatnonzero(~finite).tolist():
        result[k] = None
    return result


def rounded_one(value: float) -> float | None:
    """Round one number to five significant digits; None for NaN and infinities."""
    return rounded([value])[0]
