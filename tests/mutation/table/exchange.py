"""Other programs' files: which way y counts, which side of a contact tells, on which side of a wall rods lie."""

from tests.mutation.mutant import mutants_of

TABLE = "tests/app/exchange/foreign/test_table.py"
PEGS = "tests/app/exchange/foreign/test_pegs.py"
POSTERIOR = ("tests/solver/posterior/test_sequence_evidence.py", "tests/solver/posterior/test_frame_posterior.py")

MUTANTS = [
    *mutants_of(
        "app/exchange/foreign/observations.py",
        TABLE,
        ("        angle = -angle", "        angle = +angle"),
        ("floor - place[:, 1]]", "place[:, 1] - floor]"),
        ("smooth = np.unwrap(column[told])", "smooth = column[told]"),
    ),
    *mutants_of(
        "app/exchange/foreign/proposed_walls.py",
        TABLE,
        ("inward[..., 0] < 0.0", "inward[..., 0] > 0.0"),
    ),
    *mutants_of(
        "app/exchange/foreign/pegs.py",
        PEGS,
        ("both[int(teller != low)]", "both[int(teller == low)]"),
        ("float(mean[0]), -float(mean[1])", "float(mean[0]), float(mean[1])"),
    ),
    *mutants_of(
        "solver/posterior/sequence_evidence.py",
        POSTERIOR,
        ("& ~are_among(self.key, verdicts.forbidden)", ""),
    ),
]
