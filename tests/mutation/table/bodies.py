"""Grains, walls and how they moved."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/solver/bodies"

MUTANTS = [
    *mutants_of(
        "solver/bodies/cell.py",
        "tests/solver/bodies/test_cell.py",
        ("return -np.rint(fraction) @ reduced", "return np.rint(fraction) @ reduced"),
        ("self.vectors)) @ self.velocity", "self.vectors)) @ self.vectors"),
        ("last[known] = each[known]", "last[known] = 0.5"),
        ("steps[1] - times * steps[0]", "steps[1] + times * steps[0]"),
        ("product((-1, 0, 1), repeat=2)", "product((0, 1), repeat=2)"),
    ),
    *mutants_of(
        "solver/bodies/outer_grains.py",
        "tests/solver/bodies/test_outer_grains.py",
        ("        if not touches_third:", "        if touches_third:"),
        ("HOLE_RADII = 2.0", "HOLE_RADII = 0.5"),
        ("distance >= 0.9 * clearance", "distance >= -0.9 * clearance"),
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
        ("((carrier != wall) | at_end)", "(carrier != wall)"),
    ),
    *mutants_of(
        "solver/bodies/wall_shapes.py",
        TESTS,
        ("side * (radius - apart), distance", "radius - apart, distance"),
        ("np.where(apart > 0.0, side, np.nan)[..., None]", "np.where(apart > 0.0, 1.0, np.nan)[..., None]"),
        ("rotation = (angle - former_angle + np.pi) % (2.0 * np.pi) - np.pi", "rotation = angle - former_angle"),
        ("return beside if side is None else beside | (side != STRAIGHT)", "return beside"),
        ("touched = past & (overlap > NEAR_END * radius)", "touched = past & (overlap > 0.0)"),
        ("(np.abs(distance - radius) < overlap)", "(np.abs(distance - radius) < 0.0)"),
        ("circle_ends(centre - moved.mean(axis=-2), radius - widened", "circle_ends(centre, radius - widened"),
        ("walls_before(two, (1.0 - fraction) * wall_displacement", "walls_before(two, fraction * wall_displacement"),
    ),
    *mutants_of(
        "solver/bodies/packing.py",
        TESTS,
        ("face * self.length", "face"),
        ("if not 0.0 <= self.formal_weight <= 0.5:", "if not 0.0 <= self.formal_weight <= 1.0:"),
        ("return bool(np.isfinite(self.pressure).any()) or weight_alone", "return weight_alone"),
        ("any(self.material.gravity) and bool(self.grains.free.all())", "any(self.material.gravity)"),
    ),
    *mutants_of(
        "solver/bodies/motion.py",
        TESTS,
        ("back = (1.0 - fraction) * self.interval", "back = fraction * self.interval"),
        ("self.endpoints, back * self.wall_velocity", "self.endpoints, -back * self.wall_velocity"),
        ("return max(measured, self.sigma / self.interval, 1e-30)", "return max(measured, 1e-30)"),
        ("np.mean(np.sum(v**2, axis=1))", "np.mean(v**2)"),
        ("elapsed = snapshot.time - seen.time[known]", "elapsed = snapshot.time - np.max(seen.time[known])"),
        ("spin[known] = (snapshot.rotation[known] - seen.rotation[known]) / elapsed", "spin[known] = 0.0"),
        (
            "wall_displacement(former_endpoints, snapshot.endpoints, snapshot.side)",
            "wall_displacement(snapshot.endpoints, former_endpoints, snapshot.side)",
        ),
        ("velocity[~both], spin[~both] = 0.0, 0.0", "spin[~both] = 0.0"),
        ("strain = 0.5 * (gradient + gradient.T)", "strain = gradient + gradient.T"),
        (".mean(axis=1)\n    return velocity, spin", ".max(axis=1)\n    return velocity, spin"),
    ),
    *mutants_of(
        "solver/bodies/interpolation.py",
        TESTS,
        ("fraction = (here.time - first.time) / (last.time - first.time)", "fraction = 0.5"),
        ("interpolated = completed & ~here.present", "interpolated = completed"),
        ("nearest.position[grain] + moved", "nearest.position[grain]"),
        ("position=(1.0 - fraction) * one.position + fraction * two.position", "position=one.position"),
    ),
    *mutants_of(
        "solver/bodies/holes.py",
        TESTS,
        ("SMALLEST_FRACTION = 0.97", "SMALLEST_FRACTION = 0.6"),
        ("LARGEST_FRACTION = 0.6", "LARGEST_FRACTION = 1.2"),
        ("point = point[apart - radius.min() >= least_radius]", "point = point[apart - radius.max() >= least_radius]"),
        ("np.hypot(*(point[k] - each)) >= least_radius for", "True for"),
    ),
]
