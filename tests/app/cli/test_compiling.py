"""The compilation of kernels is reported, and only then."""

import numba
import pytest
from numba import njit
from rodsight.cli import terminal
from rodsight.cli.compiling import COMPILATION_NOTE, count_compilations

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs compiled kernels")


def kernel():
    return njit(lambda x: x + 1)


def test_kernels_are_counted_as_they_are_compiled_and_not_again():
    compiled, counts = kernel(), []
    with count_compilations(counts.append):
        assert compiled(1) == 2
        assert compiled(2) == 3
        assert counts == [1]
        kernel()(1)
    kernel()(1)
    assert counts == [1, 2]


def test_the_progress_bars_explain_the_compilation(capsys):
    with terminal.progress_bars() as progress:
        progress("solving", 0, 3)
    assert "compil" not in capsys.readouterr().err
    with terminal.progress_bars():
        kernel()(1)
    printed = " ".join(capsys.readouterr().err.split())
    assert COMPILATION_NOTE in printed
    assert "compiling" in printed
