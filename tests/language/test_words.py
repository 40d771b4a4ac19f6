"""The project uses the field's words: none of the banned ones stands outside the exceptions."""

from __future__ import annotations

import pytest

from tests.language.banned_words import _find_in, find_banned


def test_no_banned_word_stands_in_the_tree() -> None:
    places = [f"{each.file}:{each.line}: {each.word} → {each.instead}" for each in find_banned()]
    assert places == []


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("told = 1\n", "told"),
        ("x = 1  # what the file says\n", "says"),
        ("x = 1  # What is stored\n", "what"),
        ('"""It asks for a number."""\n', "asks"),
        ('message = f"the {x} promises nothing"\n', "promises"),
        ("def find_doubts(): ...\n", "doubts"),
        ("class Room: ...\n", "Room"),
        ("def push_node(): ...\n", "push_node"),
    ],
)
def test_a_banned_word_is_found_in_names_comments_docstrings_and_messages(tmp_path, monkeypatch, line, word) -> None:
    monkeypatch.setattr("tests.language.banned_words.ROOT", tmp_path)
    (tmp_path / "module.py").write_text(line)
    assert word in [each.word for each in _find_in("module.py")]


@pytest.mark.parametrize("line", ["shared = 1\n", "task = 1\n", "x = settled  # uncertain\n", "mask = 1  # essay\n"])
def test_other_words_are_left_alone(tmp_path, monkeypatch, line) -> None:
    monkeypatch.setattr("tests.language.banned_words.ROOT", tmp_path)
    (tmp_path / "module.py").write_text(line)
    assert list(_find_in("module.py")) == []


def test_pages_are_read_too(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("tests.language.banned_words.ROOT", tmp_path)
    (tmp_path / "page.md").write_text("Forces that are brought into balance.\nThe promise holds.\n")
    assert [each.line for each in _find_in("page.md")] == [1, 2]
