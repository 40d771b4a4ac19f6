"""The discrete-element truth."""

from tests.mutation.mutant import mutants_of

KERNELS = "tests/reference/test_dem.py"

MUTANTS = [
    *mutants_of(
        "solver/dem/periodic_kernels.py",
        "tests/reference/test_periodic_dem.py",
        ("stretch * dx + shear * dy", "shear * dy"),
        ("pairs.image[p, 1] * cell[1, 1]", "pairs.image[p, 1] * cell[0, 1]"),
        ("work / (2.0 * area * servo.length)", "work / (area * servo.length)"),
        ("x + dt * (stretch * x + shear * y)\n            cell[row, 1]", "x\n            cell[row, 1]"),
    ),
    *mutants_of(
        "solver/dem/kernels.py",
        KERNELS,
        ("fn = law.normal_stiffness * overlap - damping * un", "fn = law.normal_stiffness * overlap + damping * un"),
        ("if fn < 0.0:  # a dashpot does not pull", "if fn < -1e30:"),
        (
            "spring -= law.tangential_stiffness * ut * law.time_step",
            "spring = -law.tangential_stiffness * ut * law.time_step",
        ),
        ("ft = spring - law.tangential_damping * damping * ut", "ft = spring"),
        ("        ft = limit\n        spring = limit", "        ft = limit"),
        (
            "- radius[i] * state[i, OMEGA] - radius[j] * state[j, OMEGA]",
            "- radius[i] * state[i, OMEGA] + radius[j] * state[j, OMEGA]",
        ),
        ("force[j, 2] -= radius[j] * ft", "force[j, 2] += radius[j] * ft"),
        ("law.wall_friction, law", "law.friction, law"),
        ("+ height * shear_rate / cosine**2", "+ height * shear_rate"),
        ("2.0 * a * force[k, 2]", "a * force[k, 2]"),
        ("keep * state[k, VX] + a * force[k, 0] + dt * law.gravity_x", "keep * state[k, VX] + a * force[k, 0]"),
        (
            "(push - plate[LOAD] - plate[PLATE_DAMPING] * velocity)",
            "(push - plate[LOAD])",
        ),
        ("BASE_ARM = 2.0 / 3.0", "BASE_ARM = 1.0"),
        ("moment = roll - law.tangential_damping * damping * turning", "moment = roll"),
        (
            "            if wall == RIGHT:\n                wx += spread",
            "            if wall == RIGHT:\n                wx -= spread",
        ),
        ("            base[k, 0] = fx\n", ""),
        ("travel += dt * (grain_speed + max(grain_speed, wall_speed))", "travel += dt * grain_speed"),
        (
            "        if wall == TOP:\n            plate_force += fn",
            "        if wall == RIGHT:\n            plate_force += fn",
        ),
    ),
    *mutants_of(
        "solver/dem/simulation.py",
        "tests/solver/dem",
        ("mass[i] * mass[j] / (mass[i] + mass[j])", "0.5 * (mass[i] + mass[j])"),
        ("np.sqrt(settings.stiffness_ratio / 3.0)", "np.sqrt(settings.stiffness_ratio)"),
        (
            "resultant = np.linalg.norm(self._bodies.force[:, :2] + gravity, axis=1)",
            "resultant = np.linalg.norm(self._bodies.force[:, :2], axis=1)",
        ),
        ("getattr(new, name)[row] = getattr(old, name)[old_row]", "getattr(new, name)[row] = 0.0"),
        (
            "pressure * self.settings.length)))",
            "self.settings.length)))",
        ),
        ("start[row] = walls.fn[walls.j == wall].sum()", "start[row] = 0.0"),
        ("self._bodies.state[~self.touching, 3:] = 0.0", "self._bodies.state[self.touching, 3:] *= 1.0"),
    ),
]
