"""Writes the true forces beside the inferred forces, and their agreement."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ....results.results import TruthContacts
from ....solver.contacts.contacts import ContactSource, measure_contacts
from ....solver.contacts.pairs import align, are_present
from ....solver.frame_forces import FrameForces
from ....solver.statistics.agreement import Agreement, compare_forces
from ...look import entities
from ...look.axes import Axes, log_scatter_axes, scatter
from ...look.clock import Clock
from ...look.colours import SERIES
from ...look.scene import Scene
from ...look.values import log_curve_style, log_scalar, nullable
from .difference import log_difference, log_difference_legend
from .network import body_values


class TruthWriter:
    """Logs the true forces of every frame."""

    def __init__(self, scene: Scene, truth: TruthContacts) -> None:
        self._scene = scene
        self._truth = truth
        top = 1.15 * scene.style.range.top
        self._axes = Axes((0.0, top), (0.0, top), width=400.0, height=400.0)

    def log_axes(self, stream: rr.RecordingStream) -> None:
        """Log axes of the scatter plot and the styles of the curves."""
        log_difference_legend(stream, self._scene, "inferred", "true")
        log_scatter_axes(stream, self._axes, entities.TRUTH_AXES, "true f_n [N]", "inferred f_n [N]")
        for path, name, colour in (
            (entities.TRUTH_R_FN, "r(f_n)", SERIES[0]),
            (entities.TRUTH_R_FT, "r(f_t)", SERIES[1]),
            (entities.TRUTH_ERROR, "relative L2", SERIES[3]),
        ):
            log_curve_style(stream, path, name, colour)

    def log(self, clock: Clock, forces: FrameForces) -> Agreement:
        """Log the true forces of one frame and return their agreement with the inferred forces."""
        scene, truth = self._scene, self._truth
        rows = np.flatnonzero(truth.frame == clock.frame)
        key = truth.i[rows] * (scene.grains.count + scene.walls.count) + truth.j[rows]
        order = np.argsort(key, kind="stable")  # the order of contacts
        rows, key = rows[order], key[order]
        shown = rows[self._drawable(clock.frame, rows)]
        contacts = measure_contacts(
            scene.grains,
            scene.tracks.position[clock.frame],
            scene.walls.at_rest(clock.frame),
            truth.i[shown],
            truth.j[shown],
        )
        fn, ft = truth.fn[shown], truth.ft[shown]
        clock.start()
        clock.log(
            entities.TRUTH_FORCES,
            scene.style.strips(scene.branches(clock.frame, contacts), fn),
            rr.AnyValues(**body_values(scene, contacts), fn=nullable(fn), ft=nullable(ft)),
        )
        clock.end()
        listed = forces.source != ContactSource.FORBIDDEN_BY_REVIEWER
        inferred_key, inferred = (
            forces.contacts.key[listed],
            np.nan_to_num(np.column_stack([forces.fn, forces.ft])[listed]),
        )
        true = np.column_stack([truth.fn[rows], truth.ft[rows]])
        union, on_truth, on_inferred = align(key, true, inferred_key, inferred)
        present = are_present(union, scene.tracks.frame(clock.frame).present[0], scene.grains.count + scene.walls.count)
        both = np.stack([on_inferred, on_truth])[:, present]
        log_difference(clock, scene, entities.TRUTH_DIFFERENCE, union[present], both[..., 0], both[..., 1])
        true_fn, inferred_fn = on_truth[:, 0], on_inferred[:, 0]
        clock.log(entities.TRUTH_SCATTER, scatter(self._axes, true_fn, inferred_fn))
        agreement = compare_forces(inferred_key, inferred, key, true)
        log_scalar(clock, entities.TRUTH_R_FN, agreement.r_fn)
        log_scalar(clock, entities.TRUTH_R_FT, agreement.r_ft)
        log_scalar(clock, entities.TRUTH_ERROR, agreement.relative_l2)
        return agreement

    def _drawable(self, frame: int, rows: np.ndarray) -> np.ndarray:
        """Return which true contacts have both bodies in the frame; the others count as missed but cannot be drawn."""
        n, present = self._scene.grains.count, self._scene.tracks.present_in(frame)
        i, j = self._truth.i[rows], self._truth.j[rows]
        return present[i] & ((j >= n) | present[np.minimum(j, n - 1)])
