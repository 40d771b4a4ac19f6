"""Write the addresses of the project into its files: `python -m rodsight.manual.project`, in the folder of the source.

`project.toml` holds them; an empty one is left out. Written are `[project.urls]` of pyproject.toml, the lines
`repository-code`, `url` and `doi` of CITATION.cff, and `repo_url` and `site_url` of the pages. The requirements of
pyproject.toml are copied into the recipe of conda.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

from ..process.atomic import write_atomically
from ..process.errors import InputError

ADDRESSES = Path(__file__).parent / "project.toml"
URLS = {"repository": "Repository", "issues": "Issues", "documentation": "Documentation"}
CITATION = {"repository": "repository-code", "documentation": "url", "doi": "doi"}
PAGES = {"repository": "repo_url", "documentation": "site_url"}
RECIPE = ".ci/conda/recipe.yaml"
CONDA_NAMES = {  # that differ on conda-forge
    "opencv-python-headless": "py-opencv", "matplotlib": "matplotlib-base", "isal": "python-isal",
}  # fmt: skip
FORMS = {
    **dict.fromkeys(("repository", "issues", "documentation"), r"https://\S+\.\S+"),
    "doi": r"10\.\d{4,9}/\S+",
    **dict.fromkeys(("conduct", "security"), r"[^@\s]+@[^@\s]+\.[^@\s]+"),
}


def read_addresses(file: Path = ADDRESSES) -> dict[str, str]:
    """Return the addresses that are filled in; raise InputError naming one that is unknown or not valid."""
    found = tomllib.loads(file.read_text(encoding="utf-8"))
    for name, text in found.items():
        if name not in FORMS:
            raise InputError(file, f"key {name}", f"is unknown: the keys are {', '.join(FORMS)}")
        if not isinstance(text, str) or (text and not re.fullmatch(FORMS[name], text)):
            raise InputError(file, f"key {name}", f"{text!r} is not of the form {FORMS[name]}")
    return {name: text for name, text in found.items() if text}


def write_addresses(source: Path, addresses: Mapping[str, str]) -> list[Path]:
    """Write addresses into the files of a source folder, replacing earlier ones; return the files that changed."""
    changes = {
        source / "pyproject.toml": lambda text: _with_urls(text, addresses),
        source / "CITATION.cff": lambda text: _with_lines(text, CITATION, addresses, '{}: "{}"'),
        source / "app/manual/mkdocs.yml": lambda text: _with_lines(text, PAGES, addresses, "{}: {}"),
    }
    changed = []
    for file, change in changes.items():
        text = file.read_text(encoding="utf-8")
        if (new := change(text)) != text:
            write_atomically(file, new.encode())
            changed.append(file)
    return changed


def write_requirements(source: Path) -> list[Path]:
    """Copy the requirements of pyproject.toml into the recipe of conda; return the recipe if it changed."""
    file = source / RECIPE
    text = file.read_text(encoding="utf-8")
    required = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    lines = ["    - python >=3.11"]
    for each in required:
        name, bound = re.fullmatch(r"([A-Za-z0-9_.-]+)(.*)", each).groups()  # type: ignore[union-attr]
        lines.append(f"    - {CONDA_NAMES.get(name, name)} {bound}".rstrip())
    new = re.sub(r"(?<=\n  run:\n)(    - .*\n)+", "\n".join(lines) + "\n", text)
    if new == text:
        return []
    write_atomically(file, new.encode())
    return [file]


def _with_urls(text: str, addresses: Mapping[str, str]) -> str:
    """Return pyproject.toml with the table [project.urls] before the scripts, and without an earlier one."""
    text = re.sub(r"^\[project\.urls\]\n(?:.+\n)*\n", "", text, flags=re.MULTILINE)
    lines = [f'{label} = "{addresses[name]}"\n' for name, label in URLS.items() if name in addresses]
    table = "".join(["[project.urls]\n", *lines, "\n"]) if lines else ""
    return text.replace("[project.scripts]\n", f"{table}[project.scripts]\n", 1)


def _with_lines(text: str, keys: Mapping[str, str], addresses: Mapping[str, str], form: str) -> str:
    """Return YAML with a line at its end for every address, and without earlier lines of these keys."""
    kept = [line for line in text.splitlines() if line.partition(":")[0] not in keys.values()]
    kept += [form.format(key, addresses[name]) for name, key in keys.items() if name in addresses]
    return "\n".join(kept) + "\n"


def main() -> int:
    """Write the addresses into the source that this file belongs to; print the files that changed."""
    source = Path(__file__).resolve().parents[2]
    if not (source / "pyproject.toml").is_file():
        print(f"{source}: is not the folder of the source", file=sys.stderr)
        return 2
    for file in [*write_addresses(source, read_addresses()), *write_requirements(source)]:
        print(file.relative_to(source))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
