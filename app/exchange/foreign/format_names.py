"""Names of the file formats, without imports, for the list of commands."""

from typing import Literal

FileFormat = Literal["table", "trackpy", "trackmate", "rodtracker", "lammps", "yade", "mercury", "pegs", "dic"]
