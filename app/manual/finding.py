"""Search the sections of the documentation for words, in a terminal and offline."""

from __future__ import annotations

import re
from typing import NamedTuple

from .contents import pages
from .reading import anchor, page_text

HEADING = re.compile(r"^#{1,3} +(.+)$", re.MULTILINE)
LEAD = re.compile(r"^- \*\*(.+?)\*\*", re.MULTILINE)  # the lead of a list item counts as a heading
CODE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
HEADING_WEIGHT, TITLE_WEIGHT = 10, 5  # of a word; in the text each occurrence counts 1, at most TITLE_WEIGHT
# Pages that are listed after the others.
MOST_FOUND = 8  # sections
REFERENCE = {"commands.md", "settings.md", "schema.md", "api.md", "glossary.md", "troubleshooting.md"}
STOP_WORDS = "a an and are as at by can do does for from get how i if in is it may my of on or the to what with"
SIGNS = {"mu": "μ", "phi": "φ"}  # the pages print the sign
IGNORED = frozenset(re.findall(r"\w+", STOP_WORDS))  # words without a meaning for the search


class Section(NamedTuple):
    """A part of a page, down to the next heading."""

    page: str  # its file
    title: str  # of the page
    heading: str
    text: str

    @property
    def address(self) -> str:
        """Address of the HTML page with the anchor of the section."""
        return f"{self.page.removesuffix('.md')}.html#{anchor(self.heading)}"


def find_sections(words: str) -> list[Section]:
    """Return sections that contain all words (or their beginnings), best match first; none without words."""
    typed = map(str, re.findall(r"[^\s,;?!]+", words.lower()))
    wanted = [SIGNS.get(word, word) for word in typed if word not in IGNORED]
    if not wanted:
        return []
    found = [(_score(section, wanted), section) for section in _sections()]
    found.sort(key=lambda each: (each[1].page in REFERENCE, -each[0]))
    return [section for score, section in found if score > 0][:MOST_FOUND]


def _sections() -> list[Section]:
    found = []
    for page, title in pages().items():
        text = page_text(page)
        plain = CODE.sub(
            lambda block: re.sub(r"^#", " ", block[0], flags=re.MULTILINE), text
        )  # comments in code are no headings
        starts = [*HEADING.finditer(plain)]
        for start, end in zip(starts, [*(each.start() for each in starts[1:]), len(text)], strict=True):
            found.append(Section(page, title, start[1].strip(), text[start.end() : end].strip()))
    return found


def _score(section: Section, wanted: list[str]) -> int:
    heading, title, text = section.heading.lower(), section.title.lower(), section.text.lower()
    leads = " ".join(LEAD.findall(text))
    score = 0
    for word in wanted:
        here = HEADING_WEIGHT * (word in heading or word in leads) + TITLE_WEIGHT * (word in title)
        here += min(text.count(word), TITLE_WEIGHT)
        if not here:
            return 0
        score += here
    return score
