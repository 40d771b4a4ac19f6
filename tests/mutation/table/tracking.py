"""Which fit of a grain is believed: acceptance, neighbours' motion, uniqueness, overlaps."""

from tests.mutation.mutant import mutants_of

REGISTRATION = "app/tracking/registration"
TESTS = f"tests/{REGISTRATION}"

MUTANTS = [
    *mutants_of(
        f"{REGISTRATION}/consistency.py",
        f"{TESTS}/test_consistency.py",
        ("6.0 * median_deviation", "60.0 * median_deviation"),
        ("+ 0.25 * radius[known]", "+ 2.5 * radius[known]"),
        ("known[inconsistent & ~certain]", "known[inconsistent]"),
        ("np.maximum(results.accepted_zncc[known], 0.8)", "results.accepted_zncc[known]"),
        (
            "results.second_zncc[rows] > results.zncc[rows] - settings.margin",
            "results.second_zncc[rows] > results.zncc[rows]",
        ),
        ("i if quality[i] < quality[j] else j", "j if quality[i] < quality[j] else i"),
        ("np.where(results.status == TrackStatus.GIVEN, -1.0, results.zncc)", "results.zncc"),
    ),
    *mutants_of(
        f"{REGISTRATION}/neighbours.py",
        f"{TESTS}/test_neighbours.py",
        ("distance, index = distance[:, 1:], index[:, 1:]", "distance, index = distance[:, :-1], index[:, :-1]"),
        ("(distance / farthest) ** 2) * agree", "(distance / farthest) ** 2)"),
        ("4.0 * median_deviation[:, None] + 0.25", "4.0 * median_deviation[:, None]"),
        ("AFFINE_COUNT = 6", "AFFINE_COUNT = 60"),
        ("np.median(misfit, axis=1)", "median_deviation"),
        ("- allowed * smaller", "- 3.0 * allowed * smaller"),
    ),
    *mutants_of(
        f"{REGISTRATION}/rescue.py",
        (f"{TESTS}/test_rescue.py", "tests/app/tracking/correlation/test_search.py"),
        ("0 if accepted > 0 else 1", "1"),
        ("np.where(same, 0.0, np.maximum(fits.zncc, 0.0))", "np.maximum(fits.zncc, 0.0)"),
        ("results.second_zncc[rows] = 0.0", "results.second_zncc[rows] = np.nan"),
        ("< DISTINCT_ANGLE", "< 10.0"),
        ("SECOND_BEST_STEPS = 2", "SECOND_BEST_STEPS = 0"),
        ("rows = rows[::SAMPLE_STRIDE]", "rows = rows[::1]"),
    ),
    *mutants_of(
        f"{REGISTRATION}/registration_results.py",
        f"{TESTS}/test_registration_results.py",
        ("good &= fits.zncc > self.zncc[rows]", "good &= fits.zncc > 0.0"),
        ("& (fits.zncc > self.zncc[rows])", "& (fits.zncc > 0.0)"),
        ("fits.converged & (fits.zncc > self.accepted_zncc[rows])", "(fits.zncc > self.accepted_zncc[rows])"),
        ("(0.15 * self._contrast[rows]) ** 2", "(15.0 * self._contrast[rows]) ** 2"),
        ("(fits.kept > self.settings.min_kept)", "(fits.kept > 0.0)"),
        ("self.accepted_zncc[rows] / np.sqrt(np.maximum(fits.kept, 1e-3))", "self.accepted_zncc[rows]"),
        ("where, self.offset[clean] - ratio * patches.mean[clean]", "where, self.offset[clean]"),
        ("np.flatnonzero(self.accepted & ~self.poor & ", "np.flatnonzero(self.accepted & "),
        ("self.predicted[rows, :2] = last[rows, :2] + predicted", "self.predicted[rows, :2] = last[rows, :2]"),
    ),
    *mutants_of(
        REGISTRATION,
        f"{TESTS}/test_prediction.py",
        ("np.where(np.isfinite(step), guess + step, guess)", "guess"),
        ("registration.last[rows], TrackStatus.OK", "guess[rows], TrackStatus.OK"),
        ("[first, *history[:-1]]", "[first]"),
        ("before + np.angle(np.exp(1j * (pose[:, 2] - before)))", "pose[:, 2]"),
        ("np.where(leaving, TrackStatus.OUT_OF_FRAME, TrackStatus.LOST)[missing]", "TrackStatus.LOST"),
    ),
    *mutants_of(
        "app/tracking/walls/corner_rims.py",
        "tests/app/tracking/walls/test_corner_rims.py",
        ("- left, place[1] - top", ", place[1]"),
        ("float(best[0]) + left, float(best[1]) + top", "float(best[0]), float(best[1])"),
        ("and away < within * circle[2, 0]", ""),
        ("ROUNDS = 3", "ROUNDS = 0"),
        ("if measured.quality[0] > seen", "if measured.quality[0] > 0.0"),
        ("LEAST_SEEN = 0.4", "LEAST_SEEN = 0.95"),
        ("LEAST_SLOPE = 0.3", "LEAST_SLOPE = 3.0"),
    ),
    *mutants_of(
        "app/tracking/outline/missing_discs.py",
        "tests/app/tracking/outline/test_missing_discs.py",
        ("if len(rows) >= FEWEST:", "if len(rows) >= 1000:"),
        ("ring = ring[np.argsort(-ring[:, 3]", "ring = ring[np.argsort(ring[:, 3]"),
        ("> APART * (one[2] + other[2])", "> 0.0 * (one[2] + other[2])"),
        ("apart &= np.hypot(x - cx, y - cy) > APART * (radius + other)", "pass"),
        ("LEAST_STRENGTH = 0.8", "LEAST_STRENGTH = 0.1"),
        ("LEAST_STRENGTH_PATTERNED = 0.95", "LEAST_STRENGTH_PATTERNED = 0.1"),
        ("STRONG_QUANTILE) > PATTERNED * usual", "STRONG_QUANTILE) > 100.0 * usual"),
        (
            "np.column_stack([places[:, :2], np.full(len(places), radius)",
            "np.column_stack([places[:, :2], np.full(len(places), 1.0)",
        ),
        ("order = np.lexsort((columns[0], columns[1]))", "order = np.arange(len(columns[0]))"),
        ("(measured[:, VIEW] > MIN_VIEW)", "(measured[:, VIEW] > 0.0)"),
        ("(measured[:, QUALITY] > MIN_QUALITY)", "(measured[:, QUALITY] > 0.0)"),
    ),
]
