"""Softness that gaps do not show: a few photographs are solved with either assumption, and compared.

A wrong scale, a stretched picture or wrong radii hide the overlaps of soft grains among gaps that scatter. Solved as
soft, forces from overlaps then agree with the motion; those that errors of hard grains imitate do not.
"""

from __future__ import annotations

import math
from dataclasses import replace

from .corrected_sequence import CorrectedSequence
from .correction.correct_sequence import correct_sequence
from .diagnosis.trial import PREDICTED_PHOTOGRAPHS, select_window, solve_trial, trial_score
from .inputs import Inputs

FITS = 0.95  # expected r from which on grains are taken for hard without a comparison
# Least rise of arctanh r. Of 55 tests with parameters drawn at random (seeds 60 to 63, eighteen kinds with errors, 150
# rods), five with soft grains raise it by .37 to 1.51, and r by .08 to .46; the other soft ones by at most .2, and hard
# ones by at most .21, but for one with wrong radii (.33). Seeds 65 and 66 judge it.
SHOWN = 0.35


def with_softness(inputs: Inputs) -> Inputs:
    """Inputs of the first photographs of a test as a run uses them. Raises UndeterminedError."""
    if inputs.material.stiffness is not None:  # a stated one hides nothing
        return inputs
    few, _ = select_window(inputs, PREDICTED_PHOTOGRAPHS)
    return replace(inputs, material=correct_by_trial(few)[0].material)


def correct_by_trial(inputs: Inputs) -> tuple[Inputs, CorrectedSequence]:
    """Correct a sequence, as one of soft grains where a trial shows that they are; also return the inputs used.

    Raises
    ------
    UndeterminedError
        A requested friction coefficient or coordination number cannot be determined.
    """
    sequence = correct_sequence(inputs)
    if not sequence.softness_hidden:
        return inputs, sequence
    # Rods that no photograph shows are not sought for it: errors that scatter the gaps look like many.
    few = replace(inputs, settings=replace(inputs.settings, infer_unseen=False))
    trial = solve_trial(few)
    if trial is None or not trial.expected[0] < FITS:
        return inputs, sequence
    soft = replace(inputs, material=replace(inputs.material, stiffness="estimate"))
    rise = trial_score(replace(few, material=soft.material)) - trial.score
    if not rise > SHOWN:
        return inputs, sequence
    remark = (
        "overlaps are read as forces of soft grains, since what the forces leave unexplained then falls to "
        f'{100.0 * math.exp(-2.0 * rise):.0f} % (if grains are hard: material.stiffness = "rigid")'
    )
    changed = correct_sequence(soft)
    return soft, replace(changed, remark="; ".join(filter(None, (changed.remark, remark))))
