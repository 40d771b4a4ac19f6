"""The tests. Their bytecode is stored, even where the environment forbids it, as images of containers often do.

Every process of the tests would otherwise compile all modules anew, which takes longer than most tests.
"""

import os
import sys

if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    sys.dont_write_bytecode = False
