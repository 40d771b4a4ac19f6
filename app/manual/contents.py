"""The pages of the documentation in their order, grouped under headings."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent.parent / "docs"

CONTENTS: dict[str, dict[str, str]] = {
    "Begin": {
        "index.md": "Start",
        "install.md": "Install, update, cite",
        "photographs.md": "Your own photographs",
        "apparatus.md": "Your 1γ2ε test",
        "workbench.md": "The workbench",
        "views.md": "What the views show",
        "trust.md": "How far to trust it",
        "troubleshooting.md": "Troubleshooting",
    },
    "Understand": {
        "how_it_works.md": "How it works",
        "accuracy.md": "How exact, how fast",
        "speed.md": "Speed, stage by stage",
        "gallery.md": "Gallery",
        "paper.md": "In one page",
    },
    "Work with results": {
        "python.md": "Python and notebooks",
        "exchange.md": "From and to other programs",
        "campaigns.md": "Many experiments",
    },
    "Look up": {
        "commands.md": "Commands",
        "settings.md": "Settings",
        "schema.md": "results.h5",
        "api.md": "Python, name by name",
        "glossary.md": "Glossary",
    },
    "Take part": {
        "contributing.md": "Contributing",
        "architecture.md": "Architecture",
        "conventions.md": "Conventions",
        "robustness.md": "Robustness, counted",
        "threats.md": "Threat model",
    },
}


def pages() -> dict[str, str]:
    """Return the titles of all pages by file name."""
    return {file: title for group in CONTENTS.values() for file, title in group.items()}
