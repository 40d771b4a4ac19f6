"""Hook of the build: a wheel with the compiled kernels of a folder, named by RODSIGHT_KERNELS; without it, none.

Kernels fit one version of Python and one platform; numba, which they need, states the platform in its own wheel.
"""

from __future__ import annotations

import os
import sys
from importlib.metadata import distribution
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

VARIABLE = "RODSIGHT_KERNELS"


class KernelHook(BuildHookInterface):
    """Adds kernels to the wheel and names the wheel accordingly."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        folder = os.environ.get(VARIABLE)
        if not folder or version == "editable":
            return
        tags = (distribution("numba").read_text("WHEEL") or "").splitlines()
        platforms = [line.split("-")[-1] for line in tags if line.startswith("Tag: ")]
        build_data["pure_python"] = False
        build_data["tag"] = f"cp{sys.version_info.major}{sys.version_info.minor}-none-{'.'.join(platforms)}"
        build_data["force_include"][folder] = "rodsight/shipped_kernels"
