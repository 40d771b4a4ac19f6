"""Whoever waits for kernels to be compiled is told, and nobody else."""

import numba
import pytest
from numba import njit
from rodsight.cli import terminal
from rodsight.cli.compiling import SENTENCE, hearing_of_compilation

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs compiled kernels")


def kernel():
    return njit(lambda x: x + 1)


def test_kernels_are_counted_as_they_are_compiled_and_not_again():
    compiled, heard = kernel(), []
    with hearing_of_compilation(heard.append):
        assert compiled(1) == 2
        assert compiled(2) == 3
        assert heard == [1]
        kernel()(1)
    kernel()(1)
    assert heard == [1, 2]


def test_the_bars_say_why_it_takes_so_long(capsys):
    with terminal.progress_bars() as progress:
        progress("solving", 0, 3)
    assert "compil" not in capsys.readouterr().err
    with terminal.progress_bars():
        kernel()(1)
    told = " ".join(capsys.readouterr().err.split())
    assert SENTENCE in told
    assert "compiling" in told
