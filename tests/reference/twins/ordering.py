"""The visiting order, computed with lists and strings of bits."""

from __future__ import annotations

from rodsight.solver.bodies.grains import Array


def plain_order(point: Array, i: Array, j: Array, size: int) -> tuple[list[int], int]:
    """Contacts (c,) in groups of `size` that share no body, along the Morton curve; number in complete groups."""
    low = [min(p[k] for p in point) for k in range(2)]
    extent = max(max(p[k] for p in point) - low[k] for k in range(2))

    def morton(c: int) -> str:
        cells = [min(int((point[c][k] - low[k]) / extent * 65536.0), 65535) for k in range(2)]
        x, y = (f"{cell:016b}" for cell in cells)
        return "".join(b + a for a, b in zip(x, y, strict=True))  # y is the more significant of a pair of bits

    remaining = sorted(range(len(point)), key=lambda c: (morton(c), c))
    order: list[int] = []
    while True:
        group: list[int] = []
        bodies: set[int] = set()
        for c in remaining:
            if len(group) < size and not {int(i[c]), int(j[c])} & bodies:
                group.append(c)
                bodies |= {int(i[c]), int(j[c])}
        if len(group) < size:
            return order + remaining, len(order)
        order += group
        remaining = [c for c in remaining if c not in group]
