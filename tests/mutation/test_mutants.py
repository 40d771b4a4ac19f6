"""Test of the tests: errors of mechanics that they must detect (table/)."""

import pytest

from tests.mutation.mutant import Mutant, StaleMutantError
from tests.mutation.run import MAX_SURVIVAL, ROOT, format_table, judge_mutants, survival
from tests.mutation.table import MUTANTS


def test_a_mutant_without_its_text_is_stale():
    with pytest.raises(StaleMutantError, match="0 times"):
        Mutant("solver/nlgs/sweeping/contact_law.py", "no such line", "", ()).locate(ROOT)
    with pytest.raises(StaleMutantError, match="not once"):
        Mutant("solver/nlgs", "import", "", ()).locate(ROOT)


@pytest.mark.slow
def test_few_mutants_survive(tmp_path):
    verdicts = list(judge_mutants(MUTANTS, tmp_path))
    assert survival(verdicts) <= MAX_SURVIVAL, format_table(verdicts)
