"""The pages are complete, linked and current; their commands and Python code work."""

from __future__ import annotations

import functools
import html.parser
import inspect
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
import rodsight
from rodsight.cli import command_list, commands_page
from rodsight.manual.contents import CONTENTS, FOLDER, pages
from rodsight.manual.finding import find_sections
from rodsight.manual.messages import find_messages
from rodsight.manual.reading import write_pages
from rodsight.manual.troubleshooting import topic_of, troubleshooting_page

from tests.program import ROOT
from tests.program import rodsight as command

TEXTS = {file: (FOLDER / file).read_text(encoding="utf-8") for file in pages()}
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(text: str, kind: str) -> list[str]:
    return [found[2] for found in BLOCK.finditer(text) if found[1] == kind]


def commands(text: str) -> list[list[str]]:
    """Return the words after `rodsight` in the shell blocks of a page."""
    found = []
    for block in blocks(text, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|;", line.split("  #")[0]):
                words = shlex.split(part, comments=True)
                if words and words[0].endswith("rodsight"):
                    found.append(words[1:])
    return found


class Page(html.parser.HTMLParser):
    """The anchors and the link targets of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.targets: list[str] = []
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.anchors |= {given["id"] or ""} if "id" in given else set()
        self.targets += [given[name] or "" for name in ("href", "src") if name in given]


def test_the_site_lists_all_pages():
    navigation = (ROOT / "app" / "manual" / "mkdocs.yml").read_text(encoding="utf-8").split("nav:\n")[-1]
    lines = []
    for group, listed in CONTENTS.items():
        lines += [f"  - {group}:", *(f'      - "{title}": {file}' for file, title in listed.items())]
    assert navigation.splitlines() == lines
    assert {file.name for file in FOLDER.glob("*.md")} == set(pages())


@pytest.mark.thorough
def test_every_link_has_a_target_and_no_page_loads_from_another_site(tmp_path):
    write_pages(tmp_path)
    found = {file.name: Page(file) for file in tmp_path.glob("*.html")}
    assert len(found) == len(pages())
    for name, page in found.items():
        for target in page.targets:
            if "://" in target:
                continue
            file, _, mark = target.partition("#")
            assert not file or (tmp_path / file).is_file(), f"{name}: {target}"
            if mark:
                assert mark in found[file or name].anchors, f"{name}: {target}"
        assert not re.search(r'src="https?:|@import|<script', (tmp_path / name).read_text(encoding="utf-8"))
    assert "rodsight.solve(tracks" in (tmp_path / "api.html").read_text(encoding="utf-8")


def test_every_message_has_its_cure():
    messages = find_messages()
    assert len(messages) > 300
    for message in messages:
        topic = topic_of(message)
        assert topic is not None, f"no topic in cures.toml for {message.source}"
        assert topic.cure(message), f"no cure for {message}"
        assert re.search(r"[^\W\d_]{2,}.*[^\W\d_]{2,}", message.text), f"{message} names no fault"


def test_the_page_of_commands_keeps_paragraphs():
    assert "\n\nFactors and their ranges: " in TEXTS["commands.md"]


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("app/process/lock.py", "…: process … works in it; wait for it, or choose another --out"),
        ("app/experiment/reading/tables.py", "stands twice in its frame"),
        ("app/experiment/config/input_sections.py", "give either interval or times"),
        ("solver/assessment/status.py", "the mean stress jumped by … % (> … %)"),
        ("solver/assessment/penalties.py", "rods that were inferred: …"),
        ("app/run_folder.py", "… is damaged or was changed: it is made again."),
    ],
)
def test_messages_are_found_in_all_forms_of_code(source, text):
    assert (source, text) in {(each.source, each.text) for each in find_messages()}


def test_generated_pages_are_current():
    assert TEXTS["troubleshooting.md"] == troubleshooting_page(), "python -m rodsight.manual.troubleshooting"
    assert TEXTS["commands.md"] == commands_page.commands_page(), "python -m rodsight.cli.commands_page"


@pytest.fixture
def called_commands(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of called commands, whose arguments are parsed without running them."""
    called: list[str] = []

    def stub_of(original: command_list.Command) -> command_list.Command:
        @functools.wraps(original)
        def stub(*given: object, **named: object) -> int:
            inspect.signature(original).bind(*given, **named)
            called.append(command_list.name_of(original))
            return 0

        return stub

    groups = {group: tuple(map(stub_of, members)) for group, members in command_list.GROUPS.items()}
    monkeypatch.setattr(command_list, "GROUPS", groups)
    return called


@pytest.mark.thorough
@pytest.mark.parametrize("page", [*TEXTS, "README.md"])
def test_every_command_of_a_page_has_valid_arguments(page, called_commands):
    typed = [words for words in commands(TEXTS.get(page, README)) if words and not words[0].startswith("-")]
    for words in typed:
        assert command(*words) == 0, words
    assert called_commands == [words[0] for words in typed]


@pytest.fixture(scope="module")
def folder(examples: Path) -> Path:
    """The examples, and the output of a campaign of one run."""
    (examples / "runs/campaign").mkdir(exist_ok=True)
    frames = rodsight.open(examples / "runs/shear").frames()
    frames.assign(run="shear").to_parquet(examples / "runs/campaign/frames.parquet")
    return examples


def python_blocks() -> Iterator[Any]:
    """Yield each page with the number and the text of a Python block."""
    for page, text in TEXTS.items():
        for number, block in enumerate(blocks(text, "python")):
            campaign = "rodsight.campaign(" in block  # which tests/app/campaigns runs
            marks = pytest.mark.slow if campaign else ()
            yield pytest.param(page, number, block, id=f"{page}-{number}", marks=marks)


@pytest.mark.thorough
@pytest.mark.parametrize(("page", "number", "block"), list(python_blocks()))
def test_the_python_of_a_page_runs(page, number, block, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    mpl.use("agg")
    exec(compile(block, f"{page}, block {number}", "exec"), {})
    plt.close("all")
    capsys.readouterr()


@pytest.mark.parametrize(
    ("question", "page", "heading"),
    [
        ("how do I get walls?", "photographs.md", "How to get walls"),
        ("what if I do not know μ?", "photographs.md", "What you may not know"),
        ("what if I do not know mu?", "photographs.md", "What you may not know"),
        ("friction unknown", "photographs.md", "What you may not know"),
        ("pixel size", "photographs.md", "What you may not know"),
        ("lost rod", "photographs.md", "When rods are lost or mistaken"),
        ("may I believe frame 12?", "trust.md", "May I believe frame 12?"),
        ("how do I plot P(f) for my paper?", "python.md", "P(f) for a paper"),
        ("how do I run fifty experiments?", "campaigns.md", "Many experiments"),
        ("cite", "install.md", "Cite"),
        ("update", "install.md", "Update"),
        ("install", "install.md", "Install"),
        ("not round", "install.md", "Rods that are not round"),
        ("Windows", "install.md", "Platforms: Linux, macOS, Windows"),
    ],
)
def test_a_question_finds_the_section_with_its_answer(question, page, heading, capsys):
    found = find_sections(question)[0]
    assert (found.page, found.heading) == (page, heading)
    assert command("docs", "--find", question) == 0
    assert heading in capsys.readouterr().out.splitlines()[0]


def test_words_without_a_match_are_reported(capsys):
    assert command("docs", "--find", "photosynthesis") == 2
    assert "try fewer words" in capsys.readouterr().err
    assert not find_sections("how do I")


@pytest.mark.thorough
def test_the_command_writes_or_prints_the_pages(tmp_path, capsys):
    assert command("docs", "troubleshooting", "--out", tmp_path) == 0
    assert (tmp_path / "troubleshooting.html").is_file()
    assert f"{tmp_path}/troubleshooting.html" in capsys.readouterr().out
    assert command("docs", "trust", "--text") == 0
    assert "Status of the frame" in capsys.readouterr().out
    assert command("docs", "api", "--text") == 0
    assert "run(experiment, *, out=None" in capsys.readouterr().out
    assert command("docs", "trubleshooting") == 2
    assert "did you mean troubleshooting?" in capsys.readouterr().err
