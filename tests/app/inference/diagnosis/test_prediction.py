"""What `check` names beside its prediction."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from rodsight import prediction
from rodsight.inference.diagnosis.causes import finding
from rodsight.inference.inference_settings import InferenceSettings

pytestmark = pytest.mark.unit


@pytest.mark.parametrize(("expected", "named"), [(0.99, ["wall_friction"]), (0.98, ["friction", "wall_friction"])])
def test_another_friction_is_named_unless_the_forces_fit_the_given_one(monkeypatch, expected, named) -> None:
    found = [finding("friction", "slides"), finding("wall_friction", "slides")]
    monkeypatch.setattr(prediction, "measure_data_quality", lambda *_: None)
    monkeypatch.setattr(prediction, "material_of", lambda _: None)
    monkeypatch.setattr(prediction, "settings_of", lambda _: InferenceSettings())
    monkeypatch.setattr(prediction, "Inputs", lambda *_: None)
    monkeypatch.setattr(prediction, "inputs_as_used", lambda inputs: (inputs, None))
    monkeypatch.setattr(prediction, "solve_trial", lambda *_, **__: SimpleNamespace(expected=(expected, 0.9, 1.0)))
    monkeypatch.setattr(prediction, "diagnose", lambda *_: found)
    predicted = prediction.predict_accuracy(None, SimpleNamespace(frame_count=2), SimpleNamespace())  # type: ignore[arg-type]
    assert [each.cause for each in predicted.diagnosis] == named


def test_nothing_better_is_expected_of_smoothed_tracks_than_of_others() -> None:
    """Their estimates agree, as they share the errors."""
    trial = SimpleNamespace(expect=lambda *, contradicted: (0.98, 0.96, 0.99), stride=1, photographs=12)
    found = finding("smoothed_tracks", "alike"), finding("inertia", "fast")
    smoothed, other = (prediction.Prediction(None, trial, diagnosis=(each,)) for each in found)  # type: ignore[arg-type]
    assert smoothed.expected == (0.9, 0.79, 0.99)
    assert other.expected == (0.98, 0.96, 0.99)
