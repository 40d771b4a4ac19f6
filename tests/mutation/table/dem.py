"""The discrete-element truth."""

from tests.mutation.mutant import mutants_of

REFERENCE = "tests/reference/test_dem.py"
PERIODIC = "tests/reference/test_periodic_dem.py"

MUTANTS = [
    *mutants_of(
        "solver/dem/boundaries.py",
        PERIODIC,
        ("work / (2.0 * area * boundary.servo[LENGTH])", "work / (area * boundary.servo[LENGTH])"),
        ("x + dt * (stretch * x + shear * y)", "x"),
    ),
    *mutants_of(
        "solver/dem/time_step.py",
        PERIODIC,
        ("stretch * dx + shear * dy", "shear * dy"),
        ("pairs.image[p, 1] * cell[BY]", "pairs.image[p, 1] * cell[AY]"),
    ),
    *mutants_of(
        "solver/dem/contact_law.py",
        REFERENCE,
        ("fn = law.normal_stiffness * overlap - damping * un", "fn = law.normal_stiffness * overlap + damping * un"),
        ("if fn < 0.0:  # a dashpot does not pull", "if fn < -1e30:"),
        (
            "spring -= law.tangential_stiffness * ut * law.time_step",
            "spring = -law.tangential_stiffness * ut * law.time_step",
        ),
        ("ft = spring - law.tangential_damping * damping * ut", "ft = spring"),
        ("        ft = limit\n        spring = limit", "        ft = limit"),
        ("arms[1] * ft - arms[3] * fn", "-arms[1] * ft - arms[3] * fn"),
        ("arms[0] * ft - arms[2] * fn", "arms[0] * ft"),
        ("arms[0] * ft - arms[1] * fn", "arms[0] * ft + arms[1] * fn"),
        ("moment = spring - law.tangential_damping * damping * rolling", "moment = spring"),
    ),
    *mutants_of(
        "solver/dem/boundaries.py",
        REFERENCE,
        ("+ state[HEIGHT] * drive[SHEAR_RATE] / cosine**2", "+ state[HEIGHT] * drive[SHEAR_RATE]"),
        (
            "(push - plate[LOAD] - plate[PLATE_DAMPING] * velocity)",
            "(push - plate[LOAD])",
        ),
        ("arm * rate * cosine + state[WIDTH_RATE]", "arm * rate * cosine - state[WIDTH_RATE]"),
    ),
    *mutants_of(
        "solver/dem/time_step.py",
        REFERENCE,
        (
            "- arm_i * state[i, OMEGA] - arm_j * state[j, OMEGA]",
            "- arm_i * state[i, OMEGA] + arm_j * state[j, OMEGA]",
        ),
        ("law.wall_friction, law", "law.friction, law"),
        ("            overlap /= cosine\n", ""),
        ("+ (slope_i * state[i, OMEGA] + slope_j * state[j, OMEGA])", ""),
        ("ny * dvy + slope * state[i, OMEGA]", "ny * dvy"),
        ("bodies.axis[j] + state[j, THETA]", "state[j, THETA]"),
        ("2.0 * a * force[k, 2]", "a * force[k, 2]"),
        ("bodies.external[k, 0]) + dt * law.gravity_x", "bodies.external[k, 0])"),
        ("(force[k, 1] + bodies.external[k, 1])", "force[k, 1]"),
        ("BASE_ARM = 2.0 / 3.0", "BASE_ARM = 1.0"),
        ("            base[k, 0] = fx\n", ""),
        ("approach = grain_speed + max(grain_speed, wall_speed)", "approach = grain_speed"),
        (
            "RING_WALL if boundary.kind == RING else TOP",
            "RING_WALL if boundary.kind == RING else RIGHT",
        ),
    ),
    *mutants_of(
        "solver/dem/simulation.py",
        "tests/solver/dem",
        ("mass[i] * mass[j] / (mass[i] + mass[j])", "0.5 * (mass[i] + mass[j])"),
        ("np.sqrt(settings.stiffness_ratio / 3.0)", "np.sqrt(settings.stiffness_ratio)"),
        (
            "resultant = np.linalg.norm(self._bodies.force[:, :2] + self._bodies.external + gravity, axis=1)",
            "resultant = np.linalg.norm(self._bodies.force[:, :2], axis=1)",
        ),
        ("getattr(pairs, name)[row] = getattr(former, name)[former_row]", "getattr(pairs, name)[row] = 0.0"),
        ("inertial_time(self.grains.mass.mean(), pressure,", "inertial_time(self.grains.mass.mean(), 1.0,"),
        ("self._bodies.state[~self.touching, 3:] = 0.0", "self._bodies.state[self.touching, 3:] *= 1.0"),
    ),
    *mutants_of(
        "solver/dem/elliptic_section.py",
        "tests/solver/dem/test_elliptic_section.py",
        ("-2.0 * wave * (odd * cosine - even * sine)", "-wave * (odd * cosine - even * sine)"),
        ("even * cosine + odd * sine", "even * cosine - odd * sine"),
        (
            "cosine * (nx + tilt * ny), cosine * (ny - tilt * nx)",
            "cosine * (nx - tilt * ny), cosine * (ny + tilt * nx)",
        ),
    ),
    *mutants_of(
        "solver/dem/membrane_cell.py",
        "tests/solver/dem",
        ("surface.argmax(axis=0)", "surface.argmin(axis=0)"),
        ("= -self.settings.pressure", "= self.settings.pressure"),
        ("np.arange(0.5 * spacing, height, spacing)", "np.arange(0.5 * spacing, 2.0 * height, spacing)"),
    ),
    *mutants_of(
        "solver/dem/shear_cell.py",
        "tests/solver/dem",
        ("start[row] = self._force_on(wall)", "start[row] = 0.0"),
    ),
]
