"""Stored runs of all schema versions."""

from __future__ import annotations

import gzip
from pathlib import Path

FOLDER = Path(__file__).parent
SCHEMAS = (1, 2)


def unpack(schema: int, folder: Path) -> Path:
    """Unpack the run stored in a version of the schema to results.h5 in a folder."""
    file = folder / "results.h5"
    file.write_bytes(gzip.decompress((FOLDER / f"results_schema_{schema}.h5.gz").read_bytes()))
    return file
