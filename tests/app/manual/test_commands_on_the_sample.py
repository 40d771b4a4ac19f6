"""All commands in the pages run one after the other, starting in an empty folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.app.manual.test_pages import TEXTS, commands
from tests.program import ROOT, rodsight

pytestmark = [pytest.mark.slow, pytest.mark.screen]  # minutes long; pictures are drawn

SERVING = ("view", "open", "review")  # commands that wait for a person
MAKING = ("init", "import", "synth")  # commands whose target folder must not exist


def waits(words: list[str]) -> bool:
    """Whether a command needs a person, a running test or photographs that are not ours."""
    return words[0] in SERVING or "--follow" in words or "--view" in words or "photos/*.png" in words


def test_all_commands_succeed(tmp_path, monkeypatch, capsys):
    (tmp_path / "sample_data").symlink_to(ROOT / "sample_data", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    assert rodsight("synth", "my_test", "--grains", 60, "--frames", 6, "--seed", 3) == 0
    assert rodsight("run", "sample_data/shear") == 0
    assert rodsight("run", "sample_data/shear", "--set", "solver.kappa=0.1", "--out", "runs/stiffer") == 0
    written = [words for text in TEXTS.values() for words in commands(text) if words and not words[0].startswith("-")]
    done: list[list[str]] = []
    for words in written:
        if words in done or waits(words):
            continue
        done.append(words)
        if words[0] in MAKING:
            target = Path(next(word for word in words if word in ("my_test", "my_import", "try", "big", "OUT")))
            shutil.rmtree(target, ignore_errors=True)
            if words[0] == "init":
                target.mkdir()
        status = rodsight(*words)
        assert status == 0, (words, capsys.readouterr().err)
    assert len(done) > 25
