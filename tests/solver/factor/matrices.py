"""Sparse block matrices, each with a dense copy."""

import numpy as np
from rodsight.solver.factor.pattern import Pattern, find_pattern


def coupled_nodes(side: int, far: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours on a square lattice, some repeated or coupled with themselves; far: neighbours of one further node."""
    number = np.arange(side * side).reshape(side, side)
    a = np.concatenate([number[:, 1:].ravel(), number[:-1].ravel(), number[0, :2], number[-1, -1:]])
    b = np.concatenate([number[:, :-1].ravel(), number[1:].ravel(), number[0, 1::-1], number[-1, -1:]])
    return np.append(a, np.arange(far)), np.append(b, np.full(far, side * side))


def definite(pattern: Pattern, a: np.ndarray, b: np.ndarray, size: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A positive definite matrix with coupled nodes a and b: blocks on the pattern, and dense."""
    rng = np.random.default_rng(seed)
    n = pattern.node_count
    dense = np.kron(np.eye(n), 0.1 * np.eye(size))
    place = pattern.place
    for first, second in zip(place[a], place[b], strict=True):
        row = np.zeros((2, n * size))
        row[:, first * size : (first + 1) * size] = rng.normal(size=(2, size))
        row[:, second * size : (second + 1) * size] += rng.normal(size=(2, size))
        dense += row.T @ row
    blocks = dense.reshape(n, size, n, size).swapaxes(1, 2)
    return flat(blocks[pattern.row, pattern.column]), dense


def flat(blocks: np.ndarray) -> np.ndarray:
    """Blocks (k, b, b) in the layout of the factorisation."""
    padded = np.zeros((len(blocks), blocks.shape[2], blocks.shape[1] + blocks.shape[1] % 2))
    padded[:, :, : blocks.shape[1]] = blocks.swapaxes(1, 2)
    return padded.ravel()


def square(flat_blocks: np.ndarray, size: int) -> np.ndarray:
    """Inverse of `flat`; asserts that the padding is zero."""
    padded = flat_blocks.reshape(-1, size, size + size % 2)
    assert not padded[:, :, size:].any()
    return padded[:, :, :size].swapaxes(1, 2)


def lattice(side: int, size: int, far: int = 0) -> tuple[Pattern, np.ndarray, np.ndarray]:
    """Pattern and matrix of a lattice, as blocks and dense."""
    a, b = coupled_nodes(side, far)
    pattern = find_pattern(side * side + bool(far), a, b)
    return (pattern, *definite(pattern, a, b, size))
