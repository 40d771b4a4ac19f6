"""The mutants, room by room. Chosen by what would be wrong mechanics, not by what the tests happen to see."""

from tests.mutation.mutant import Mutant
from tests.mutation.table import (
    assessment,
    baselines,
    belonging,
    bodies,
    calibration,
    contacts,
    convex,
    dem,
    detection,
    exchange,
    factor,
    following,
    inference,
    mixture,
    nlgs,
    posterior,
    recording,
    redistribution,
    results,
    sequence,
    statistics,
    tracking,
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
        posterior,
        redistribution,
        mixture,
        assessment,
        nlgs,
        convex,
        statistics,
        sequence,
        following,
        inference,
        dem,
        results,
        baselines,
        exchange,
        tracking,
        workbench,
        belonging,
        recording,
    )
    for mutant in part.MUTANTS
)
