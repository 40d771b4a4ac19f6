"""The mutants, room by room. Chosen by what would be wrong mechanics, not by what the tests happen to see."""

from tests.mutation.mutant import Mutant
from tests.mutation.table import (
    bodies,
    calibration,
    contacts,
    convex,
    dem,
    detection,
    nlgs,
    results,
    sequence,
    statistics,
)

MUTANTS: tuple[Mutant, ...] = tuple(
    mutant
    for part in (bodies, contacts, detection, calibration, nlgs, convex, statistics, sequence, dem, results)
    for mutant in part.MUTANTS
)
