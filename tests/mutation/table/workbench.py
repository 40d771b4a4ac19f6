"""The workbench: what it writes for the solver, and whom it answers."""

from tests.mutation.mutant import mutants_of

MUTANTS = [
    *mutants_of(
        "app/workbench/setup/circles.py",
        "tests/app/workbench/test_setup.py",
        ("if abs(twice) < FLAT * longest:", "if False:"),
        ('return "in" if side == IN else "out"', 'return "in"'),
        ("gone = {each.name for each in circles_of(found)} - {each.name for each in circles}", "gone = set()"),
        ("rods.x[:, None] + rods.radius[:, None] * np.cos(angle)", "rods.x[:, None] + 0.0 * np.cos(angle)"),
    ),
    *mutants_of(
        "app/tracking/walls/round_edge.py",
        "tests/app/tracking/walls/test_round_edge.py",
        ("(1.0 if inside else -1.0)", "1.0"),
        ("if share < SEEN:", "if False:"),
    ),
    *mutants_of(
        "app/workbench/service/server.py",
        "tests/app/workbench/test_gate.py",
        ("if len(request.headers.getlist(name)) > 1:", "if False:"),
        ("named = secrets.compare_digest(beginning, self.named.encode())", "named = beginning[:5] == b'/reco'"),
        ('if not self.gate.opens(request.query_params["token"]):', "if False:"),
        ('changes=request.method != "GET"', "changes=False"),
        ('{"Cache-Control": "no-store"} | SAFE_HEADERS', '{"Cache-Control": "no-store"}'),
        ("> LARGEST_BODY:", "> 1 << 40:"),
    ),
    *mutants_of(
        "app/workbench/service/bench.py",
        ("tests/app/workbench/test_gate.py", "tests/app/workbench/test_setup.py"),
        ("if not folder.is_relative_to(self.root) or not", "if not"),
        ("files += rolls[roll].files[:1] if 0 <= roll < len(rolls) else ()", "files += rolls[0].files[:1]"),
    ),
    *mutants_of(
        "app/workbench/inspecting",
        "tests/app/workbench/test_inspecting.py",
        ("if both <= set(words.values())", "if both & set(words.values())"),
        ("interval.high - interval.low < NARROW else None", "interval.high >= interval.low else None"),
        ("said.setdefault(canonical(pair), {})", "said.setdefault((*canonical(pair)[:2], 0), {})"),
        ("frame, tracks = photograph - found.first, found.tracks", "frame, tracks = 0, found.tracks"),
        ("Verdict.NO_CONTACT: not now[0]}", "Verdict.NO_CONTACT: True}"),
        ("return 0 if origin is None else origin.frames[0]", "return 0"),
    ),
    *mutants_of(
        "app/workbench/mending",
        "tests/app/workbench/test_mending.py",
        ("if old.get(name) != new.get(name)]", "if name in new]"),
        ("fits.kept[0] > KEPT_LEAST and fits.zncc[0] > AGREES", "fits.kept[0] > 2.0"),
    ),
]
