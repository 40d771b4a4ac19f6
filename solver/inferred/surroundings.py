"""Grains and walls around a hole of a packing, in every photograph."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from ..bodies.grains import Array
from ..bodies.holes import equidistant_points
from ..bodies.wall_shapes import IN, STRAIGHT, Sides, all_sides, bounding_distance, circle_parameters

NEIGHBOURS = 8  # whose mean motion a place follows
NEAREST = 12  # centres that are tested for contact with a rod
SAME_PLACE = 0.02  # radii: nearer places count as one
AROUND_HOLE = 8  # bodies, by any three of which a rod of unknown size may be held
TRIPLES = np.array(list(combinations(range(AROUND_HOLE), 3)))
NARROWED = 0.7  # of the least size: three corners of a triangulation leave a circle of this size in a hole at least
LEAST_GRAINS = 4  # that a triangulation needs
UNCERTAIN_SIZE = 10.0  # standard deviations of a gap: three bodies on one side do not determine a size
FLAT = 1e4  # radius of the circle that replaces a wall, over that of the greatest rod
AROUND = 0.35  # of its radius: greatest gap of bodies that may hold a rod
ROUNDS = 30  # of re-weighting
MOVED = 1.0  # radii by which a place may change in all rounds, with the bodies around its start
LARGEST_STEP = 0.2  # radii in a round
DRIFT = 0.1  # radii: standard deviation of a rod's motion relative to its neighbours between photographs


class Surroundings:
    """Grains and walls of a sequence, with a search tree per photograph. Walls are circles of very large radius."""

    def __init__(
        self,
        radius: Array,
        position: Array,
        present: NDArray[np.bool_],
        endpoints: Array,
        noise: float,
        side: Sides = None,
        free: NDArray[np.bool_] | None = None,
    ) -> None:
        """radius (n,), position (f, n, 2), endpoints (f, w, 2, 2) and noise in metres; present (f, n); side (w,).

        free (n,): grains whose motion is not imposed; None: all.
        """
        self.radius, self.position, self.present, self.noise = radius, position, present, noise
        self._widest = float(radius.max())
        self._rows = [np.flatnonzero(here) for here in present]
        self._tree = [KDTree(position[k][rows]) for k, rows in enumerate(self._rows)]
        self._depth: dict[int, Array] = {}  # of grains (n, w) [m] from walls in a photograph
        self._free = np.ones(len(radius), np.bool_) if free is None else free
        self._walls, self._side = endpoints, all_sides(side, endpoints.shape[1])

    @property
    def frame_count(self) -> int:
        return len(self.position)

    def carry(self, place: Array, k: int, to: int) -> Array:
        """Move a place (2,) of photograph k with the mean motion of its neighbours to photograph `to`."""
        _, near = self._tree[k].query(place, k=min(NEIGHBOURS, len(self._rows[k])))
        rows = self._rows[k][np.atleast_1d(near)]
        rows = rows[self.present[to, rows]]
        if not len(rows):
            return place
        return place + np.mean(self.position[to, rows] - self.position[k, rows], axis=0)

    def find_places(self, k: int, size: float, apart: float, deep: float, near: Array | None) -> Array:
        """Find places (p, 2) in photograph k where a rod touches at least three bodies and overlaps none.

        Parameters
        ----------
        k : int
            Photograph.
        size : float
            Radius [m] of the rod.
        apart, deep : float
            Greatest gap and greatest overlap [m] of a body that touches.
        near : array (q, 2), optional
            Search around these places [m] only; None: everywhere.

        Returns
        -------
        array (p, 2)
            Places [m], those with most contacts first, without duplicates.
        """
        crossing = self._crossings(k, size, near)
        if not len(crossing):
            return crossing
        rows = self._rows[k]
        # Most places overlap the grain with the nearest centre: this fast test removes them.
        away, nearest = self._tree[k].query(crossing)
        crossing = crossing[away - self.radius[rows[nearest]] - size > -deep]
        if not len(crossing):
            return crossing
        _, nearest = self._tree[k].query(crossing, k=min(NEAREST, len(rows)))
        distance = np.linalg.norm(crossing[:, None] - self.position[k][rows[nearest]], axis=2)
        gap = np.column_stack([
            distance - self.radius[rows[nearest]] - size,
            self._reach(k, crossing)[0] - size,
        ])  # fmt: skip
        touches = np.count_nonzero(gap < apart, axis=1)
        fits = (gap.min(axis=1) > -deep) & (touches > 2)
        crossing, touches = crossing[fits], touches[fits]
        places: list[Array] = []
        for q in np.argsort(-touches, kind="stable"):
            if all(np.hypot(*(crossing[q] - each)) > SAME_PLACE * size for each in places):
                places.append(crossing[q])
        return np.array(places).reshape(-1, 2)

    def find_circles(
        self, k: int, sizes: tuple[float, float], deep: float, near: Array | None
    ) -> list[tuple[Array, float]]:
        """Find places in photograph k where a rod of unknown size would touch three bodies and overlap none.

        Parameters
        ----------
        k : int
            Photograph.
        sizes : (float, float)
            Least and greatest radius [m] of the rod.
        deep : float
            Greatest overlap [m] of a body that touches.
        near : array (q, 2), optional
            Search around these places [m] only; None: everywhere.

        Returns
        -------
        list of (array (2,), float)
            Places and radii [m], without duplicates.
        """
        least, greatest = sizes
        found: list[tuple[Array, float]] = []
        for hole in self._holes(k, sizes, near):
            centre, rim = self._bodies(hole, k, 2.0 * greatest)
            nearest = np.argsort(np.linalg.norm(centre - hole, axis=1) - rim)[:AROUND_HOLE]
            three = nearest[TRIPLES[TRIPLES.max(axis=1) < len(nearest)]]
            place = equidistant_points(centre[three], rim[three], hole)
            clearance = np.linalg.norm(place[:, None] - centre, axis=2) - rim
            size = np.take_along_axis(clearance, three, axis=1).mean(axis=1)
            with np.errstate(invalid="ignore"):
                fits = (size >= least) & (size <= greatest) & (clearance.min(axis=1) > size - deep)
                fits &= np.linalg.norm(place - hole, axis=1) < greatest
            for at, radius in zip(place[fits], size[fits].tolist(), strict=True):
                if not any(np.hypot(*(at - x)) + abs(radius - r) < SAME_PLACE * radius for x, r in found):
                    found.append((at, radius))
        return found

    def _holes(self, k: int, sizes: tuple[float, float], near: Array | None) -> Array:
        """Find points (h, 2) in the holes of photograph k that may hold a rod of these sizes; near: as `find_circles`.

        Notes
        -----
        Each triangle of a triangulation of the centres, and of their mirror images in the walls, leaves a circle
        between its corners.
        """
        rows, (least, greatest) = self._rows[k], sizes
        centre, rim = [self.position[k][rows]], [self.radius[rows]]
        depth, outward = self._reach(k, centre[0])
        for w in range(depth.shape[1]):
            at = np.flatnonzero(depth[:, w] < rim[0] + 2.0 * greatest)
            centre.append(centre[0][at] + 2.0 * depth[at, w, None] * outward[at, w])
            rim.append(rim[0][at])
        centre, rim = np.concatenate(centre), np.concatenate(rim)
        if len(centre) < LEAST_GRAINS:
            return np.empty((0, 2))
        corner = Delaunay(centre).simplices
        point = equidistant_points(centre[corner], rim[corner])
        clearance = np.linalg.norm(point - centre[corner[:, 0]], axis=1) - rim[corner[:, 0]]
        with np.errstate(invalid="ignore"):
            point = point[(clearance > NARROWED * least) & (clearance < 2.0 * greatest)]
        if near is not None and len(point):
            point = point[np.asarray(KDTree(near).query(point)[0]) < self._widest + 2.0 * greatest]
        one_of_each = np.unique(np.rint(point / (AROUND * least)), axis=0, return_index=True)[1]
        return point[np.sort(one_of_each)]

    def fit_size(self, place: Array, k: int, size: float, apart: float) -> tuple[float, float]:
        """Fit the radius [m] of a rod near a place (2,) to the bodies within `apart` of it; return it and its weight.

        The weight is the inverse of its variance over that of a gap; 0: fewer than three bodies determine it.
        """
        centre, rim = self._bodies(place, k, 2.0 * size)
        away = centre - place
        distance = np.linalg.norm(away, axis=1)
        gap = distance - rim - size
        touches = np.abs(gap) < apart
        design = np.column_stack([away[touches] / distance[touches, None], np.ones(np.count_nonzero(touches))])
        normal = design.T @ design
        if len(design) < 3 or np.linalg.cond(normal) > UNCERTAIN_SIZE**4:
            return size, 0.0
        covariance = np.linalg.inv(normal)
        if covariance[2, 2] > UNCERTAIN_SIZE**2:
            return size, 0.0
        return size + float(covariance[2] @ design.T @ gap[touches]), 1.0 / float(covariance[2, 2])

    def count_free(self, position: Array, size: float, within: tuple[float, float]) -> float:
        """Mean number of free grains that touch a rod; arguments as of `count_rearranged`."""
        gap = np.linalg.norm(self.position - position[:, None], axis=2) - self.radius - size
        touching = self.present & self._free & (gap > -within[0]) & (gap < within[1])
        return float(touching.sum(axis=1).mean())

    def count_rearranged(self, position: Array, size: float, within: tuple[float, float], least: float) -> int:
        """Count contacts beyond two of a rod in photographs between which the bodies that touch it rearrange.

        Parameters
        ----------
        position : array (f, 2)
            Of the rod [m].
        size : float
            Radius of the rod [m].
        within : (float, float)
            Greatest overlap and greatest gap of a body that touches [m].
        least : float
            Least change [m] of a distance between two touching bodies since the photograph that was counted last.
        """
        last, total = -1, 0
        for k, place in enumerate(position):
            gap = np.linalg.norm(self.position[k] - place, axis=1) - self.radius - size
            grains = np.flatnonzero(self.present[k] & (gap > -within[0]) & (gap < within[1]))
            gap = self._reach(k, place[None])[0][0] - size
            walls = np.flatnonzero((gap > -within[0]) & (gap < within[1]))
            further = len(grains) + len(walls) - 2
            if further <= 0:
                continue
            if last >= 0:
                change = np.abs(self._spacing(k, grains, walls) - self._spacing(last, grains, walls))
                if not np.max(change, initial=0.0, where=np.isfinite(change)) > least:
                    continue
            last, total = k, total + further
        return total

    def _spacing(self, k: int, grains: NDArray[np.intp], walls: NDArray[np.intp]) -> Array:
        """Distances [m] between grains, and of these from walls, in photograph k; NaN of grains that it lacks."""
        place = np.where(self.present[k, grains, None], self.position[k, grains], np.nan)
        between = np.linalg.norm(place[:, None] - place, axis=2)
        return np.concatenate([between.ravel(), self._reach(k, place)[0][:, walls].ravel()])

    def _crossings(self, k: int, size: float, near: Array | None) -> Array:
        """Compute places (p, 2) where a rod of this size touches two grains, or a grain and a wall."""
        rows, tree = self._rows[k], self._tree[k]
        centre, rim = self.position[k][rows], self.radius[rows]
        if near is None:
            pairs = tree.query_pairs(2.0 * (self._widest + size), output_type="ndarray")
            beside = np.arange(len(rows))
        else:
            reach = self._widest + 2.0 * size
            beside = np.unique(np.concatenate([np.empty(0, int), *tree.query_ball_point(near, reach)])).astype(int)
            local = KDTree(centre[beside]).query_pairs(2.0 * (self._widest + size), output_type="ndarray")
            pairs = beside[local]
        one, two = pairs[:, 0], pairs[:, 1]
        found = [_cross(centre[one], rim[one] + size, centre[two], rim[two] + size)]
        depth, outward = self._reach(k, centre[beside])
        for w, side in enumerate(self._side):
            close = depth[:, w] < rim[beside] + 2.0 * size
            at = beside[close]
            if side == STRAIGHT:
                wall, wide = self._flat(depth[close, w], outward[close, w], centre[at]), FLAT * self._widest + size
            else:  # circle of the centres of rods that touch the wall
                middle, wide, _ = circle_parameters(self._walls[k, w])
                wall, wide = np.broadcast_to(middle, (len(at), 2)), float(wide) + (-size if side == IN else size)
            found.append(_cross(centre[at], rim[at] + size, wall, np.full(len(at), wide)))
        return np.concatenate(found)

    def bodies(self, place: Array, k: int, size: float) -> tuple[Array, Array]:
        """Return centres (b, 2) and radii (b,) [m] of what a rod of this size may touch near a place (2,)."""
        return self._bodies(place, k, (2.0 + MOVED) * size)

    def hold(self, bodies: tuple[Array, Array], start: Array, size: float) -> tuple[Array, float]:
        """Fit the place of a rod near `start` (2,) to the bodies around it; return it and its standard deviation [m].

        Notes
        -----
        The place x minimises Σ w g²/σ² + |x − start|²/(0.1 R)² by Gauss-Newton steps, g the gaps and σ their noise;
        w = 1 for overlaps, (1 + (g/s)²)⁻² for gaps, with s shrinking to the noise.
        """
        x, y, variance = _hold(*bodies, start, size, self.noise)
        return np.array([x, y]), float(np.sqrt(variance))

    def _bodies(self, place: Array, k: int, reach: float) -> tuple[Array, Array]:
        """Return centres (b, 2) and radii (b,) [m] of grains with rims within reach of a place and of all walls."""
        rows = self._rows[k][self._tree[k].query_ball_point(place, reach + self._widest)]
        if len(rows) and self._is_far_from_walls(k, place, rows[0], reach):
            return self.position[k][rows], self.radius[rows]
        depth, outward = self._reach(k, place[None])
        bounds = np.isfinite(depth[0])
        flat = self._flat(depth[0, bounds], outward[0, bounds], np.broadcast_to(place, (int(bounds.sum()), 2)))
        return (
            np.concatenate([self.position[k][rows], flat]),
            np.concatenate([self.radius[rows], np.full(len(flat), FLAT * self._widest)]),
        )

    def _is_far_from_walls(self, k: int, place: Array, row: int, reach: float) -> bool:
        """Whether a place (2,) is farther than `reach` from all walls, as its distance from a grain shows."""
        if k not in self._depth:
            self._depth[k] = np.full((len(self.radius), self._walls.shape[1]), np.nan)
            self._depth[k][self._rows[k]] = self._reach(k, self.position[k][self._rows[k]])[0]
        depth = self._depth[k][row]
        return bool(np.isfinite(depth).all() and depth.min() - np.hypot(*(self.position[k, row] - place)) > reach)

    def _reach(self, k: int, place: Array) -> tuple[Array, Array]:
        """Compute distances (p, w) [m] of places (p, 2) from the walls in photograph k, and outward normals."""
        return bounding_distance(self._walls[k], self._side, place)

    def _flat(self, depth: Array, outward: Array, near: Array) -> Array:
        """Compute centres (m, 2) of large circles that replace the wall at `depth` (m,) [m] beyond places (m, 2)."""
        return near + (depth + FLAT * self._widest)[:, None] * outward


def gaps(bodies: tuple[Array, Array], place: Array, size: float) -> Array:
    """Compute the gaps (b,) [m] of a rod of this size at a place (2,) to bodies."""
    centre, rim = bodies
    return np.linalg.norm(centre - place, axis=1) - rim - size


@njit(cache=True, nogil=True, error_model="numpy")
def _hold(centre, rim, start, size, noise):
    """Compute place x, y and mean variance of a rod among bodies (b, 2) with radii (b,), as `Surroundings.hold`."""
    x, y, scale = start[0], start[1], AROUND * size
    finest, prior = 2.0 * noise + 1e-4 * size, 1.0 / (DRIFT * size) ** 2
    xx, xy, yy = prior, 0.0, prior
    for _ in range(ROUNDS):
        xx, xy, yy = prior, 0.0, prior
        right_x, right_y = (start[0] - x) * prior, (start[1] - y) * prior
        for b in range(len(rim)):
            apart_x, apart_y = centre[b, 0] - x, centre[b, 1] - y
            distance = np.sqrt(apart_x**2 + apart_y**2)
            gap = distance - rim[b] - size
            if gap < AROUND * size:
                # Wide gaps have little weight: those bodies may not touch.
                weight = (1.0 if gap < 0.0 else 1.0 / (1.0 + (gap / scale) ** 2) ** 2) / noise**2
                u, v = apart_x / distance, apart_y / distance
                xx, xy, yy = xx + weight * u * u, xy + weight * u * v, yy + weight * v * v
                right_x, right_y = right_x + weight * gap * u, right_y + weight * gap * v
        determinant = xx * yy - xy * xy
        step_x, step_y = (yy * right_x - xy * right_y) / determinant, (xx * right_y - xy * right_x) / determinant
        part = min(1.0, LARGEST_STEP * size / max(np.sqrt(step_x**2 + step_y**2), 1e-300))
        x, y = x + part * step_x, y + part * step_y
        scale = max(finest, 0.7 * scale)
    return x, y, 0.5 * (xx + yy) / (xx * yy - xy * xy)


def _cross(one: Array, first: Array, two: Array, second: Array) -> Array:
    """Compute the intersections (p, 2) of circles about one and two (m, 2), of radii first and second (m,)."""
    apart = two - one
    distance = np.linalg.norm(apart, axis=1)
    meet = (distance < first + second) & (distance > np.abs(first - second)) & (distance > 0.0)
    one, apart, distance, first, second = one[meet], apart[meet], distance[meet], first[meet], second[meet]
    unit = apart / distance[:, None]
    along = 0.5 * (distance + (first - second) * (first + second) / distance)
    across = np.sqrt(np.maximum(first**2 - along**2, 0.0))
    base, side = one + along[:, None] * unit, across[:, None] * np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    return np.concatenate([base + side, base - side])
