"""In an editable install: the folder app/ under the name that it is installed by. The wheel needs no such file."""

from pathlib import Path

_HERE = Path(__file__).resolve().parent
_FACE = _HERE.parents[1] / "app" / "__init__.py"
__path__ = [str(_FACE.parent), str(_HERE)]  # the second holds rodsight.solver
__file__ = str(_FACE)
exec(compile(_FACE.read_text(encoding="utf-8"), __file__, "exec"))
