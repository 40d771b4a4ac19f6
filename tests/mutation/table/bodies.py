"""Grains, walls and how they moved."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/solver/bodies"

MUTANTS = [
    *mutants_of(
        "solver/bodies/cell.py",
        "tests/solver/bodies/test_cell.py",
        ("return -np.rint(share) @ upright", "return np.rint(share) @ upright"),
        ("self.vectors)) @ self.velocity", "self.vectors)) @ self.vectors"),
        ("last[known] = each[known]", "last[known] = 0.5"),
        ("steps[1] - times * steps[0]", "steps[1] + times * steps[0]"),
        ("product((-1, 0, 1), repeat=2)", "product((0, 1), repeat=2)"),
    ),
    *mutants_of(
        "solver/bodies/outer.py",
        "tests/solver/bodies/test_outer.py",
        ("        if not meets:", "        if meets:"),
        ("WIDE = 2.0", "WIDE = 0.5"),
        ("ahead >= 0.9 * room", "ahead >= -0.9 * room"),
    ),
    *mutants_of(
        "solver/bodies/grains.py",
        TESTS,
        ("density * length * np.pi * radius**2", "density * length * np.pi * radius"),
        ("return 0.5 * self.mass * self.radius**2", "return 0.4 * self.mass * self.radius**2"),
        ("self.mass[:, None] * np.asarray(gravity)", "self.radius[:, None] * np.asarray(gravity)"),
    ),
    *mutants_of(
        "solver/bodies/walls.py",
        (TESTS, "tests/solver/contacts"),
        ("np.stack([d[:, 1], -d[:, 0]], axis=1)", "np.stack([-d[:, 1], d[:, 0]], axis=1)"),
        ("velocity = v0 + s[:, None] * (v1 - v0)", "velocity = v0 + 0.5 * (v1 - v0)"),
        ("velocity = v0 + s[:, None] * (v1 - v0)", "velocity = v1 + s[:, None] * (v0 - v1)"),
    ),
    *mutants_of(
        "solver/bodies/wall_shapes.py",
        TESTS,
        ("side * (radius - apart), distance", "radius - apart, distance"),
        ("np.where(apart > 0.0, side, np.nan)[..., None]", "np.where(apart > 0.0, 1.0, np.nan)[..., None]"),
        ("by = (turn - former_turn + np.pi) % (2.0 * np.pi) - np.pi", "by = turn - former_turn"),
        ("return beside if side is None else beside | (side != STRAIGHT)", "return beside"),
        ("circle_ends(centre - moved.mean(axis=-2), radius - widened", "circle_ends(centre, radius - widened"),
        ("moved_back(two, (1.0 - share) * walls_moved", "moved_back(two, share * walls_moved"),
    ),
    *mutants_of(
        "solver/bodies/packing.py",
        TESTS,
        ("face * self.length", "face"),
        ("if not 0.0 <= self.formal_weight <= 0.5:", "if not 0.0 <= self.formal_weight <= 1.0:"),
    ),
    *mutants_of(
        "solver/bodies/motion.py",
        TESTS,
        ("back = (1.0 - fraction) * self.interval", "back = fraction * self.interval"),
        ("self.endpoints, back * self.wall_velocity", "self.endpoints, -back * self.wall_velocity"),
        ("return max(measured, self.sigma / self.interval, 1e-30)", "return max(measured, 1e-30)"),
        ("np.mean(np.sum(v**2, axis=1))", "np.mean(v**2)"),
        ("lapse = snapshot.time - seen.time[known]", "lapse = snapshot.time - np.max(seen.time[known])"),
        ("spin[known] = (snapshot.rotation[known] - seen.rotation[known]) / lapse", "spin[known] = 0.0"),
        (
            "walls_moved(former_endpoints, snapshot.endpoints, snapshot.side)",
            "walls_moved(snapshot.endpoints, former_endpoints, snapshot.side)",
        ),
        ("velocity[~both], spin[~both] = 0.0, 0.0", "spin[~both] = 0.0"),
        ("strain = 0.5 * (gradient + gradient.T)", "strain = gradient + gradient.T"),
        (".mean(axis=1)\n    return velocity, spin", ".max(axis=1)\n    return velocity, spin"),
    ),
    *mutants_of(
        "solver/bodies/bridging.py",
        TESTS,
        ("share = (here.time - first.time) / (last.time - first.time)", "share = 0.5"),
        ("bridged = whole & ~here.present", "bridged = whole"),
        ("+ _carried(nearest, here, nearest.position[grain])", "+ np.zeros(2)"),
        ("position=(1.0 - share) * one.position + share * two.position", "position=one.position"),
    ),
    *mutants_of(
        "solver/bodies/holes.py",
        TESTS,
        ("FITTING = 0.97", "FITTING = 0.6"),
        ("NATURAL = 0.6", "NATURAL = 1.2"),
        ("np.hypot(*(place[k] - each)) >= least for", "True for"),
    ),
]
