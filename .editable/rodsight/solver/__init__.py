"""In an editable install: the folder solver/ under the name that it is installed by. The wheel needs no such file."""

from pathlib import Path

_FACE = Path(__file__).resolve().parents[3] / "solver" / "__init__.py"
__path__ = [str(_FACE.parent)]
__file__ = str(_FACE)
exec(compile(_FACE.read_text(encoding="utf-8"), __file__, "exec"))
