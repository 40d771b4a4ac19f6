"""The modules of the page import every function that they call: a browser finds a missing one at the call only."""

import re
from pathlib import Path

import rodsight.workbench

PAGE = Path(rodsight.workbench.__file__).parent / "page"
EXPORTED = re.compile(r"^export (?:async )?(?:function|const) (\w+)", re.MULTILINE)
IMPORTED = re.compile(r"^import \{([^}]*)\}", re.MULTILINE)
TEXTS = re.compile(r"//[^\n]*|/\*.*?\*/|\"[^\"\n]*\"", re.DOTALL)


def called(source: str, name: str) -> bool:
    """Whether a module calls a function of this name that is neither its own, a parameter, a method nor CSS."""
    if not re.search(rf"(?<![\w.$#]){name}\((?!\$\{{|[^()]*\) \{{)", source):
        return False
    defined = rf"(?:function|const|let) (?:\w+ = [^;]*, )?{name}\b|\b{name} ="
    parameter = rf"[({{,] ?{name}(?: = [^,)}}]*)?[,)}}][^;]*?=>|{name} =>"
    return re.search(f"{defined}|{parameter}", source) is None


def missing_imports(folder: Path) -> list[str]:
    modules = {path: TEXTS.sub('""', path.read_text()) for path in sorted(folder.rglob("*.js"))}
    exported = {name for source in modules.values() for name in EXPORTED.findall(source)}
    missing = []
    for path, source in modules.items():
        names = {each.split(" as ")[-1].strip() for group in IMPORTED.findall(source) for each in group.split(",")}
        missing += [f"{path.relative_to(folder)}: {name}" for name in sorted(exported - names) if called(source, name)]
    return missing


def test_every_called_function_is_imported():
    assert missing_imports(PAGE) == []


def test_a_missing_import_is_found(tmp_path):
    (tmp_path / "dom.js").write_text("export const sign = (mark) => mark;\nexport function h(tag) { return tag; }\n")
    (tmp_path / "step.js").write_text('import { h } from "/dom.js";\nexport const a = () => h(sign("doubtful"));\n')
    assert missing_imports(tmp_path) == ["step.js: sign"]
