"""Sections of the pages by words: an answer where no page is known yet, and no network or browser is there."""

from __future__ import annotations

import re
from typing import NamedTuple

from .contents import pages
from .reading import anchor, page_text

HEADING = re.compile(r"^#{1,3} +(.+)$", re.MULTILINE)
LEAD = re.compile(r"^- \*\*(.+?)\*\*", re.MULTILINE)  # of an item of a list: a heading of its own
CODE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
IN_HEADING, IN_TITLE = 10, 5  # what a word counts there, beside 1 in the text, where more than the latter are as many
LOOKED_UP = {"commands.md", "settings.md", "schema.md", "api.md", "troubleshooting.md"}  # come after pages to read
SMALL = "a an and are as at by can do does for from get how i if in is it may my of on or the to what with"
SIGNS = {"mu": "μ", "phi": "φ"}  # the pages write the sign
LITTLE = frozenset(re.findall(r"\w+", SMALL))  # words that say nothing of what is sought


class Section(NamedTuple):
    """A part of a page, down to the next heading."""

    page: str  # its file
    title: str  # of the page
    heading: str
    text: str

    @property
    def address(self) -> str:
        """The HTML page and the place in it."""
        return f"{self.page.removesuffix('.md')}.html#{anchor(self.heading)}"


def find_sections(words: str, most: int = 8) -> list[Section]:
    """Sections that hold all words (or their beginnings), the likeliest first; none where there are no words."""
    told = map(str, re.findall(r"[^\s,;?!]+", words.lower()))
    wanted = [SIGNS.get(word, word) for word in told if word not in LITTLE]
    if not wanted:
        return []
    found = [(_worth(section, wanted), section) for section in _sections()]
    found.sort(key=lambda each: (each[1].page in LOOKED_UP, -each[0]))
    return [section for worth, section in found if worth > 0][:most]


def _sections() -> list[Section]:
    found = []
    for page, title in pages().items():
        text = page_text(page)
        plain = CODE.sub(
            lambda block: re.sub(r"^#", " ", block[0], flags=re.MULTILINE), text
        )  # remarks are no headings
        starts = [*HEADING.finditer(plain)]
        for start, end in zip(starts, [*(each.start() for each in starts[1:]), len(text)], strict=True):
            found.append(Section(page, title, start[1].strip(), text[start.end() : end].strip()))
    return found


def _worth(section: Section, wanted: list[str]) -> int:
    heading, title, text = section.heading.lower(), section.title.lower(), section.text.lower()
    leads = " ".join(LEAD.findall(text))
    worth = 0
    for word in wanted:
        here = IN_HEADING * (word in heading or word in leads) + IN_TITLE * (word in title)
        here += min(text.count(word), IN_TITLE)
        if not here:
            return 0
        worth += here
    return worth
