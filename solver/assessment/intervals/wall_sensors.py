"""Forces on walls that sensors record, compared with the inferred ones: they show what is wrong with the load."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ...bodies.grains import Array

SEEN = 0.1  # of the greatest recorded force: sensors with less are not compared
# Standard deviation of a wall's force over the true one beside that of the scale: .01 to .05 in simulated tests, where
# forces have a correlation of .95 and more; sensors of real walls have friction of their own.
OF_WALL = 0.05
SIGMAS = 2.0  # beyond which all sensors together contradict the scale
LIMIT = 0.3  # relative difference by which a sensor contradicts forces that are expected to be right


def compare_wall_forces(
    inferred: Float[Array, "f w 2"], recorded: Float[Array, "f w 2"], normal: Float[Array, "f w 2"]
) -> Float[Array, " w"]:
    """Compute by how much the inferred normal forces on walls exceed the recorded ones.

    Parameters
    ----------
    inferred, recorded : array (f, w, 2)
        Forces of the packing on the walls [N]; NaN: not recorded.
    normal : array (f, w, 2)
        Unit normals of the walls, outward.

    Returns
    -------
    array (w,)
        Σ N N' / Σ N'² of inferred N and recorded N', sums over the frames: 1 where both agree, negative where a
        recorded force pulls the wall inward; NaN without a sensor, or with less than a tenth of the greatest force.
    """
    along, stated = (np.einsum("fwx,fwx->fw", each, normal) for each in (inferred, recorded))
    known = np.isfinite(stated) & np.isfinite(along)
    product, square = (np.where(known, each * stated, 0.0).sum(axis=0) for each in (along, stated))
    size = np.sqrt(square / np.maximum(known.sum(axis=0), 1))
    seen = (size > 0.0) & (size >= SEEN * size.max(initial=0.0))
    return np.divide(product, square, out=np.full(len(size), np.nan), where=seen)


def contradicting(ratio: Float[Array, " w"]) -> bool:
    """Whether a sensor contradicts the forces, by the ratios of `compare_wall_forces`."""
    return bool((np.abs(ratio[np.isfinite(ratio)] - 1.0) > LIMIT).any())


def scale_error(ratio: Float[Array, " w"], scale_sd: float) -> float:
    """Return the relative error of all forces that sensors show, 0 where they agree with the scale.

    Notes
    -----
    ||m| − 1| with m the median of the ratios, where it exceeds twice the standard deviation of the scale and of a wall;
    the opposite sign of all sensors is another convention.
    """
    known = ratio[np.isfinite(ratio)]
    error = abs(abs(float(np.median(known))) - 1.0) if len(known) else 0.0
    return error if error > SIGMAS * float(np.hypot(scale_sd, OF_WALL)) else 0.0
