"""Sparse matrices of blocks with a dense copy of each."""

import numpy as np

from solver.factor.pattern import Pattern, find_pattern


def couples(side: int, far: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours on a square lattice, some of them named twice or with themselves; far: a last node that many touch."""
    number = np.arange(side * side).reshape(side, side)
    a = np.concatenate([number[:, 1:].ravel(), number[:-1].ravel(), number[0, :2], number[-1, -1:]])
    b = np.concatenate([number[:, :-1].ravel(), number[1:].ravel(), number[0, 1::-1], number[-1, -1:]])
    return np.append(a, np.arange(far)), np.append(b, np.full(far, side * side))


def definite(pattern: Pattern, a: np.ndarray, b: np.ndarray, size: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A positive definite matrix whose nodes a and b are coupled: flat by the pattern's entries, and whole."""
    rng = np.random.default_rng(seed)
    n = pattern.node_count
    whole = np.kron(np.eye(n), 0.1 * np.eye(size))
    place = pattern.place
    for first, second in zip(place[a], place[b], strict=True):
        pull = np.zeros((2, n * size))
        pull[:, first * size : (first + 1) * size] = rng.normal(size=(2, size))
        pull[:, second * size : (second + 1) * size] += rng.normal(size=(2, size))
        whole += pull.T @ pull
    blocks = whole.reshape(n, size, n, size).swapaxes(1, 2)
    return flat(blocks[pattern.row, pattern.column]), whole


def flat(blocks: np.ndarray) -> np.ndarray:
    """Blocks (k, b, b) as the factorisation lays them out."""
    filled = np.zeros((len(blocks), blocks.shape[2], blocks.shape[1] + blocks.shape[1] % 2))
    filled[:, :, : blocks.shape[1]] = blocks.swapaxes(1, 2)
    return filled.ravel()


def square(flat_blocks: np.ndarray, size: int) -> np.ndarray:
    """What `flat` was made of, and that nothing but zeros fills it up."""
    filled = flat_blocks.reshape(-1, size, size + size % 2)
    assert not filled[:, :, size:].any()
    return filled[:, :, :size].swapaxes(1, 2)


def lattice(side: int, size: int, far: int = 0) -> tuple[Pattern, np.ndarray, np.ndarray]:
    """Pattern and matrix of a lattice, flat and whole."""
    a, b = couples(side, far)
    pattern = find_pattern(side * side + bool(far), a, b)
    return (pattern, *definite(pattern, a, b, size))
