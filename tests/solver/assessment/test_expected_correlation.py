"""Expected correlation and its bound: monotone in every measure, with the fitted values."""

import math
from dataclasses import replace

import pytest
from rodsight.solver.assessment import expected_correlation
from rodsight.solver.assessment.expected_correlation import (
    CLOSED_BY_FORCES,
    CONTRADICTED,
    MEASURES,
    UNLOADED_GAIN,
    WIDEST,
    bound_correlation,
    closed_overlap,
    confirmed_correlation,
    correlation_score,
    expect_correlation,
    losses,
    predict_correlation,
    unexplained_correction,
)
from rodsight.solver.assessment.fitted import FITTED

from tests.solver.assessment.test_penalties import ASSESSED

BOTH = replace(ASSESSED, agreement=0.9, position_agreement=0.9, overlap_agreement=0.85, force_change=0.05)
WORSE = {
    "agreement": 0.3, "correction": 1.0, "old_unbalance": 0.15, "disagreement": 0.8,
    "force_change": 0.5,
}  # fmt: skip


@pytest.mark.parametrize("name", WORSE)
def test_both_measures_fall_with_every_contradiction(name):
    worse = replace(BOTH, **{name: WORSE[name]})
    assert expect_correlation(worse) < expect_correlation(BOTH)
    assert bound_correlation(worse) < bound_correlation(BOTH)


def test_the_bound_is_below_the_expectation_and_the_gap_widens():
    bad = replace(BOTH, agreement=0.5, correction=0.5)
    for each in (BOTH, bad):
        assert 0.0 <= bound_correlation(each) < expect_correlation(each) < 1.0
    assert expect_correlation(bad) - bound_correlation(bad) > expect_correlation(BOTH) - bound_correlation(BOTH)


def test_every_table_is_monotone_and_the_score_is_their_sum():
    for title in ("both", "unloaded", "motion", "overlaps", "prediction", "unloaded_prediction"):
        table = FITTED["expected_correlation"][title]
        terms = {name: each for name, each in table.items() if isinstance(each, dict) and name != "bound"}
        assert terms.keys() <= MEASURES.keys()
        for each in terms.values():
            assert each["at"] == sorted(each["at"])
            assert each["value"] == sorted(each["value"], reverse=True)
    # at knots of the tables no interpolation is needed
    table = FITTED["expected_correlation"]["motion"]
    correction, members = table["correction"], table["disagreement_of_members"]
    alone = replace(
        ASSESSED, correction=correction["at"][3], disagreement=members["at"][2], old_unbalance=math.nan,
        force_change=math.nan, load_fraction=math.nan,
        information=replace(ASSESSED.information, gap_error=math.nan, slide_signal=math.nan),
    )  # fmt: skip
    score = table["constant"] + correction["value"][3] + members["value"][2]
    assert expect_correlation(alone) == pytest.approx(math.tanh(score))
    bound = table["bound"]
    margin = bound["constant"] + bound["score"] * score
    assert bound_correlation(alone) == pytest.approx(max(math.tanh(score - margin), 0.0))


def test_the_distance_of_the_bound_follows_the_score(monkeypatch):
    table = FITTED["expected_correlation"]["both"]
    monkeypatch.setitem(table, "bound", {"constant": 0.1, "score": 0.2})
    for each in (BOTH, replace(BOTH, agreement=0.7)):
        score = correlation_score(each)
        assert bound_correlation(each) == pytest.approx(math.tanh(0.8 * score - 0.1))


def test_a_photograph_beyond_the_range_of_the_fit_counts_as_its_end_in_a_mean():
    last = FITTED["expected_correlation"]["prediction"]["correction"]["at"][-1]
    far, end = (replace(BOTH, correction=each) for each in (1e3 * last, last))
    assert predict_correlation([BOTH, far]) == pytest.approx(predict_correlation([BOTH, end]))


def test_a_prediction_reads_the_mean_evidence_and_knows_its_interval():
    bad = replace(BOTH, agreement=0.3, correction=1.0)
    good, mixed, worse = (predict_correlation(each) for each in ([BOTH], [BOTH, bad], [bad, bad]))
    assert good[0] > mixed[0] > worse[0]
    assert predict_correlation([BOTH, BOTH]) == pytest.approx(good)
    sd = FITTED["expected_correlation"]["prediction"]["sd"]
    contradicted = predict_correlation([BOTH], contradicted=True)
    assert math.atanh(good[0]) - math.atanh(contradicted[0]) == pytest.approx(-CONTRADICTED)
    assert CONTRADICTED < 0.0
    for r, low, high in (good, mixed):
        assert math.atanh(r) - math.atanh(low) == pytest.approx(sd)
        assert math.atanh(high) - math.atanh(r) == pytest.approx(sd)


def test_evidence_beyond_the_range_of_the_fit_counts_as_its_end():
    table = FITTED["expected_correlation"]["both"]
    worst = replace(BOTH, correction=table["correction"]["at"][-1])
    assert bound_correlation(replace(worst, correction=1e3)) == pytest.approx(bound_correlation(worst))


def test_one_confirmation_of_the_motion_suffices_in_part():
    confirmed = replace(BOTH, agreement=0.4, overlap_agreement=0.9)
    alone = replace(BOTH, agreement=0.4, overlap_agreement=0.4)
    assert expect_correlation(alone) < expect_correlation(confirmed) < expect_correlation(BOTH)


def test_losses_name_what_lowers_the_bound():
    found = losses(replace(BOTH, correction=1.9))
    assert max(found, key=found.__getitem__) == "correction"
    assert all(value >= 0.0 for value in found.values())


def test_the_bound_falls_with_gaps_wider_than_any_that_was_fitted():
    def with_gaps(ratio: float):
        return replace(BOTH, information=replace(BOTH.information, gap_error=ratio * BOTH.information.diameter))

    widest = with_gaps(WIDEST)
    assert bound_correlation(with_gaps(0.9 * WIDEST)) == pytest.approx(bound_correlation(widest))
    assert bound_correlation(with_gaps(2.0 * WIDEST)) == pytest.approx(0.5 * bound_correlation(widest))
    assert losses(with_gaps(4.0 * WIDEST))["gap_error"] > 0.5 * bound_correlation(widest)
    assert bound_correlation(with_gaps(math.nan)) > 0.0
    wide = with_gaps(2.0 * WIDEST)
    overlaps = replace(wide.information, unexplained_gap=0.5 * WIDEST * wide.information.diameter)
    assert bound_correlation(replace(wide, information=overlaps)) == pytest.approx(bound_correlation(widest))


def test_agreement_without_sliding_is_no_evidence():
    def score(signal: float, **changes: float) -> float:
        return correlation_score(replace(BOTH, information=replace(BOTH.information, slide_signal=signal), **changes))

    calm, usual = {"disagreement": 0.05, "force_change": 0.01, "power_gap": 0.01, "agreement": 0.98}, {
        "disagreement": 0.2, "force_change": 0.035, "power_gap": 0.08, "agreement": 0.9
    }  # fmt: skip
    rise = {signal: score(signal, **calm) - score(signal, **usual) for signal in (0.0, 0.5, 1.0, 9.0)}
    assert 0.0 <= rise[0.0] < 0.1 < 0.3 < rise[0.5] < rise[1.0]  # at rest, differences of negative parts alone
    assert rise[9.0] == pytest.approx(rise[1.0])
    worse = {"disagreement": 0.5, "force_change": 0.3, "power_gap": 0.5}
    against = {signal: score(signal, **usual) - score(signal, **worse) for signal in (0.0, 9.0)}
    assert against[0.0] == pytest.approx(against[9.0], abs=0.1)  # evidence against the forces counts as before
    assert (
        predict_correlation([replace(BOTH, information=replace(BOTH.information, slide_signal=0.0), **calm)])[0]
        < predict_correlation([replace(BOTH, information=replace(BOTH.information, slide_signal=0.1), **calm)])[0]
    )


def test_a_correction_counts_as_far_as_sliding_is_seen():
    moving, half, still = (
        replace(BOTH, information=replace(BOTH.information, slide_signal=each)) for each in (2.0, 0.5, 0.0)
    )  # fmt: skip
    assert unexplained_correction(replace(moving, correction=0.8)) == pytest.approx(0.8)
    assert unexplained_correction(replace(still, correction=0.8)) == pytest.approx(0.0)
    assert unexplained_correction(replace(still, correction=5.0)) == pytest.approx(0.0)
    assert unexplained_correction(replace(half, correction=0.8)) == pytest.approx(0.8 - 0.6)
    assert unexplained_correction(replace(half, correction=5.0)) == pytest.approx(2.5)
    assert math.isnan(unexplained_correction(replace(still, correction=math.nan)))
    assert expect_correlation(replace(still, correction=0.8)) == expect_correlation(replace(still, correction=0.2))


def test_gaps_that_were_closed_count_where_forces_rest_on_them_and_nothing_slides():
    still = replace(BOTH, position_weight=0.8, information=replace(BOTH.information, slide_signal=0.0))
    noise, diameter = still.information.noise, still.information.diameter
    closed = replace(still, corrected_gap=noise + 0.01 * diameter)
    assert closed_overlap(closed) == pytest.approx(0.8 * 0.01)
    assert closed_overlap(replace(still, corrected_gap=noise)) == 0.0
    assert closed_overlap(replace(closed, position_weight=0.0)) == 0.0
    sliding = replace(closed, information=replace(BOTH.information, slide_signal=3.0))
    assert closed_overlap(sliding) == 0.0
    assert bound_correlation(closed) < bound_correlation(still)
    assert losses(closed)["closed_overlap"] > 0.1
    by_forces = replace(closed, centres_by_forces=True)
    assert closed_overlap(by_forces) == pytest.approx(CLOSED_BY_FORCES * closed_overlap(closed))


WELL_KNOWN = replace(
    BOTH, interior=300, information=replace(BOTH.information, undetermined=0.05, noise=5e-6, diameter=0.02)
)


@pytest.mark.parametrize(
    "little",
    [
        replace(WELL_KNOWN, information=replace(WELL_KNOWN.information, undetermined=0.4)),
        replace(WELL_KNOWN, information=replace(WELL_KNOWN.information, noise=6e-5)),
        replace(WELL_KNOWN, interior=22),
    ],
    ids=["balance leaves more open", "more noise", "few rods inside"],
)
def test_without_a_load_what_shows_little_lowers_the_trust(little, monkeypatch):
    """A packing whose outermost rods stand for its walls has the evidence of others, and less accurate forces."""
    monkeypatch.setattr(expected_correlation, "UNLOADED_GAIN", 9.0)
    well, little_known = (replace(each, loaded=False) for each in (WELL_KNOWN, little))
    assert bound_correlation(little_known) < bound_correlation(well)
    assert predict_correlation([little_known]) < predict_correlation([well])
    assert bound_correlation(little) == bound_correlation(WELL_KNOWN)
    assert predict_correlation([little]) == predict_correlation([WELL_KNOWN])


def test_without_a_load_few_interior_grains_lower_the_bound_and_not_the_expectation(monkeypatch):
    eighty, twenty = (replace(WELL_KNOWN, loaded=False, interior=n) for n in (80, 20))
    lowered, reasons = [bound_correlation(each) for each in (eighty, twenty)], losses(twenty)
    monkeypatch.setattr(expected_correlation, "FEW_INTERIOR_MARGIN", 0.0)
    assert bound_correlation(eighty) == lowered[0]
    assert math.atanh(bound_correlation(twenty)) - math.atanh(lowered[1]) == pytest.approx(8.0 * (1 / 20 - 1 / 80))
    rise = reasons["few_interior"] - losses(twenty)["few_interior"]
    assert rise == pytest.approx(bound_correlation(twenty) - lowered[1])
    monkeypatch.undo()
    assert bound_correlation(replace(twenty, loaded=True)) == bound_correlation(WELL_KNOWN)


def test_a_load_that_is_not_known_is_no_evidence(monkeypatch):
    contradicted = replace(WELL_KNOWN, correction=0.9, power_gap=0.8, unbalance=0.1)
    unloaded = replace(contradicted, loaded=False)
    for measure in (bound_correlation, expect_correlation):
        limited = measure(unloaded)
        assert math.atanh(limited) == pytest.approx(math.atanh(measure(contradicted)) + UNLOADED_GAIN)
    reasons = losses(unloaded)
    assert reasons.keys() > losses(contradicted).keys()
    assert all(reasons[name] >= loss for name, loss in losses(contradicted).items())
    monkeypatch.setattr(expected_correlation, "UNLOADED_GAIN", 9.0)
    assert bound_correlation(unloaded) > limited - 0.1
    assert losses(unloaded) != reasons


def test_one_photograph_without_a_load_makes_a_prediction_without_one():
    without = replace(BOTH, loaded=False)
    assert predict_correlation([BOTH, without]) == pytest.approx(predict_correlation([without, without]))
    assert predict_correlation([BOTH, BOTH]) != pytest.approx(predict_correlation([without, without]))


def test_overlaps_that_the_motion_confirms_are_trusted_by_that_agreement():
    soft = replace(BOTH.information, soft=True, slide_signal=3.0)
    poor = replace(BOTH, agreement=0.94, position_agreement=0.3, old_unbalance=0.15, force_change=0.5)
    overlaps = replace(poor, information=soft, position_weight=0.9)
    assert confirmed_correlation(overlaps) == pytest.approx(0.94 - 0.05)
    assert bound_correlation(overlaps) == pytest.approx(0.94 - 0.05)
    assert expect_correlation(overlaps) >= bound_correlation(overlaps)
    assert max(losses(overlaps).values()) < max(losses(replace(overlaps, agreement=0.2)).values())
    for other in (
        replace(overlaps, position_weight=0.1),
        replace(overlaps, agreement=math.nan),
        replace(overlaps, information=replace(soft, soft=False)),
    ):
        assert confirmed_correlation(other) == 0.0
    wide = replace(soft, gap_error=2.0 * WIDEST * soft.diameter, unexplained_gap=2.0 * WIDEST * soft.diameter)
    assert confirmed_correlation(replace(overlaps, information=wide)) == pytest.approx(0.5 * 0.94 - 0.05)
    hidden = replace(overlaps, information=replace(soft, slide_signal=0.1))
    assert confirmed_correlation(hidden) == pytest.approx(0.1 * 0.94 - 0.05)
