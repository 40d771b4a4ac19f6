"""Mutants of the workbench: files for the solver, access control, the review."""

from tests.mutation.mutant import mutants_of

MUTANTS = [
    *mutants_of(
        "app/workbench/setup/walls/circles.py",
        "tests/app/workbench/test_setup.py",
        ("if abs(twice) < FLAT * longest:", "if False:"),
        ('return "in" if side == IN else "out"', 'return "in"'),
        ("removed = {each.name for each in circles_of(found)} - {each.name for each in circles}", "removed = set()"),
        ("rods.x[:, None] + rods.radius[:, None] * np.cos(angle)", "rods.x[:, None] + 0.0 * np.cos(angle)"),
    ),
    *mutants_of(
        "app/workbench/setup/walls/bars.py",
        "tests/app/workbench/test_init.py",
        ("if np.mean(((places >= 0.0) & (places < size)).all(axis=1)) < 0.5:", "if False:"),
        ("return bool(np.any((beyond > 0.0) & (beyond", "return bool(np.all((beyond > 0.0) & (beyond"),
        ("len(rods.id) < FEWEST_INSIDE", "len(rods.id) < 1"),
    ),
    *mutants_of(
        "app/workbench/setup/found_walls.py",
        "tests/app/workbench/test_init.py",
        ("if len(named) < FEWEST_BARS and not loaded:", "if False:"),
        ("followed = seen if len(images) > 1 else barred", "followed = barred"),
        ("if followed.all():", "if False:"),
    ),
    *mutants_of(
        "app/workbench/setup/edits.py",
        "tests/app/workbench/test_init.py",
        ("return detection.select((x >= -0.5)", "return detection.select((x >= -99.0)"),
    ),
    *mutants_of(
        "app/tracking/walls/round_edge.py",
        "tests/app/tracking/walls/test_round_edge.py",
        ("(1.0 if inside else -1.0)", "1.0"),
        ("if fraction < MIN_AGREEMENT:", "if False:"),
    ),
    *mutants_of(
        "app/workbench/service/guard.py",
        "tests/app/workbench/test_gate.py",
        ("if len(request.headers.getlist(name)) > 1:", "if False:"),
        ("is_open = secrets.compare_digest(beginning, self.open_path.encode())", "is_open = beginning[:5] == b'/reco'"),
        ("if refusal is not None:", "if False:"),
        ('changes=request.method != "GET"', "changes=False"),
        ('{"Cache-Control": "no-store"} | SAFE_HEADERS', '{"Cache-Control": "no-store"}'),
    ),
    *mutants_of(
        "app/workbench/service/server.py",
        "tests/app/workbench/test_gate.py",
        ("> largest:", "> 1 << 40:"),
    ),
    *mutants_of(
        "app/workbench/service/workbench.py",
        ("tests/app/workbench/test_gate.py", "tests/app/workbench/test_setup.py"),
        ("if not folder.is_relative_to(self.root) or not", "if not"),
        (
            "list(find_series(self.root, folder, suffix).files[:1])",
            "list(find_series(self.root, folder, suffix).files[1:2])",
        ),
    ),
    *mutants_of(
        "app/reviewing",
        "tests/app/workbench/test_inspecting.py",
        ("if both <= set(given.values())", "if both & set(given.values())"),
        ("interval.high - interval.low < NARROW else None", "interval.high >= interval.low else None"),
        ("verdicts.setdefault(canonical(pair), {})", "verdicts.setdefault((*canonical(pair)[:2], 0), {})"),
        ("Verdict.NO_CONTACT: not now[0]}", "Verdict.NO_CONTACT: True}"),
    ),
    *mutants_of(
        "app/reviewing/judging/queue.py",
        "tests/app/reviewing/test_statistics_of_verdicts.py",
        ("np.lexsort((-candidates.ambiguity, -priority))", "np.arange(candidates.count)"),
        ("np.argsort(drawn) if blind else", "np.argsort(stratum) if blind else"),
    ),
    *mutants_of(
        "app/workbench/inspecting",
        "tests/app/workbench/test_inspecting.py",
        ("frame, tracks = photograph - data.first, data.tracks", "frame, tracks = 0, data.tracks"),
        ("return 0 if origin is None else origin.frames.start", "return 0"),
    ),
    *mutants_of(
        "app/workbench/correcting",
        "tests/app/workbench/test_correcting.py",
        ("if old.get(name) != new.get(name)]", "if name in new]"),
        ("fits.kept[0] > KEPT_LEAST and fits.zncc[0] > AGREES", "fits.kept[0] > 2.0"),
    ),
    *mutants_of(
        "app/workbench/setup/found_walls.py",
        "tests/app/workbench/test_corner_discs.py",
        (
            "        barred = validate(draft)\n        discs = find_discs(draft, image, barred)\n    return",
            "        discs = find_discs(draft, image, found)\n    return",
        ),
        ('with draft.one_step("walls found"):', "if True:"),
        ("return len(named), discs", "return discs, discs"),
        ("bars.find_named(image, found)", "(list(zip(bars.NAMES, bars.find_walls(image, found))), [])"),
        ("        add_discs(draft, found, discs)\n    return", "        pass\n    return"),
        (
            "on |= np.hypot(rods.x - disc.x, rods.y - disc.y) < disc.radius",
            "on = np.hypot(rods.x - disc.x, rods.y - disc.y) < disc.radius",
        ),
        ("rods.y - disc.y) < disc.radius", "rods.y - disc.y) > disc.radius"),
        (
            "GrainGuess(rods.id[~on], rods.x[~on], rods.y[~on], rods.radius[~on])",
            "GrainGuess(rods.id[~on], rods.x[~on], rods.y[~on], rods.radius[on])",
        ),
    ),
    *mutants_of(
        "app/workbench/setup/walls/circles.py",
        "tests/app/workbench/test_corner_discs.py",
        ("return [each for each in discs if each.name not in taken]", "return discs"),
    ),
]
