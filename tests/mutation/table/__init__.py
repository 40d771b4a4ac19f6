"""The mutants, room by room. Chosen by what would be wrong mechanics, not by what the tests happen to see."""

from tests.mutation.mutant import Mutant
from tests.mutation.table import (
    baselines,
    bodies,
    calibration,
    contacts,
    convex,
    dem,
    detection,
    exchange,
    factor,
    nlgs,
    results,
    sequence,
    statistics,
    workbench,
)

MUTANTS: tuple[Mutant, ...] = tuple(
    mutant
    for part in (
        bodies,
        factor,
        contacts,
        detection,
        calibration,
        nlgs,
        convex,
        statistics,
        sequence,
        dem,
        results,
        baselines,
        exchange,
        workbench,
    )
    for mutant in part.MUTANTS
)
