"""The one-period matrix as Hanson and Tsao form it: products of matrices, and lifted blocks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rcbook.loops.periodic.loop import PeriodicLoop

Multiply = Callable[[np.ndarray, np.ndarray], np.ndarray]


def closed_loop_matrix(loop: PeriodicLoop, k: int) -> np.ndarray:
    """State matrix of sample k with every delay written out, states [G_NL, G_L, G_c, G_p].

    It has N + h rows for the two parts of the generator, m - 1 for the compensator and n for the
    plant.  Source: Hanson and Tsao (2000), eqs 6-8; with q as described in their section 4.
    """
    a, b, c, _ = compensated_plant(loop)
    k, short, half = k % loop.period, loop.advance, loop.memory.taps.size // 2
    at_short = loop.period - short + half
    at_plant = at_short + short
    q_long = np.zeros(at_short)
    q_long[at_short - loop.memory.taps.size :] = loop.memory.taps
    matrix = np.eye(at_plant + len(a[k]), k=-1)
    matrix[0], matrix[at_short], matrix[at_plant:] = 0.0, 0.0, 0.0
    matrix[0, at_plant - 1], matrix[0, at_plant:] = 1.0, -c[k][0]
    matrix[at_short, :at_short] = q_long
    matrix[at_plant:, :at_short] = b[k] * q_long
    matrix[at_plant:, at_plant:] = a[k]
    return matrix


def multiplications(left: np.ndarray, right: np.ndarray) -> int:
    """Multiplications of numbers in the product of two full matrices."""
    return left.shape[0] * left.shape[1] * right.shape[1]


def product_of_matrices(loop: PeriodicLoop, multiply: Multiply = np.matmul) -> np.ndarray:
    """Product of the N closed-loop matrices, by brute force: O(N^4) work.

    `multiply` may count what it does.  Source: Hanson and Tsao (2000), eq. 10.
    """
    product = closed_loop_matrix(loop, 0)
    for k in range(1, loop.period):
        product = multiply(closed_loop_matrix(loop, k), product)
    return product


def lift(loop: PeriodicLoop) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, C and D of compensator and plant over one period, states [G_c, G_p].

    Column j of B and D is the answer to a unit input of sample j, formed recursively in O(N^2).
    Source: Hanson and Tsao (2000), eqs 7 and A1-A7.
    """
    parts = compensated_plant(loop)
    states, n = len(parts[0][0]), loop.period
    state, outputs = np.eye(states, states + n), np.zeros((n, states + n))
    for k, (a, b, c, _) in enumerate(zip(*parts, strict=True)):
        outputs[k] = c @ state
        state = a @ state
        state[:, states + k] = b[:, 0]
    return state[:, :states], state[:, states:], outputs[:, :states], outputs[:, states:]


def lift_by_products(
    loop: PeriodicLoop, block: str, multiply: Multiply = np.matmul, carried: bool = False
) -> np.ndarray:
    """Block "A", "B", "C" or "D" of `lift`, as the paper forms it: from products of matrices.

    Each entry forms its own transition matrix, or, `carried`, prolongs that of the one before.
    `multiply` may count what it does.  Source: Hanson and Tsao (2000), eqs 7 and A3-A7.
    Raises ValueError for another block.
    """
    a, b, c, d = compensated_plant(loop)
    n = loop.period
    if block == "A":
        return _products(a, multiply, carried=True)[-1]
    if block == "B":
        back = _products([each.T for each in a[:0:-1]], multiply, carried)
        return np.hstack([*(multiply(back[n - 2 - k].T, b[k]) for k in range(n - 1)), b[-1]])
    if block == "C":
        ahead = _products(a[:-1], multiply, carried)
        return np.vstack([c[0], *(multiply(c[k], ahead[k - 1]) for k in range(1, n))])
    if block != "D":
        raise ValueError(f"block {block!r} is none of A, B, C, D")
    answers = np.diag(d)
    for entered in range(n - 1):
        ahead = _products(a[entered + 1 : -1], multiply, carried)
        states = [b[entered], *(multiply(product, b[entered]) for product in ahead)]
        for k, state in enumerate(states, entered + 1):
            answers[k, entered] = multiply(c[k], state)[0, 0]
    return answers


def _products(matrices: list[np.ndarray], multiply: Multiply, carried: bool) -> list[np.ndarray]:
    """matrices[i] .. matrices[0] for each i."""
    found: list[np.ndarray] = []
    for i, newest in enumerate(matrices):
        if carried and found:
            found.append(multiply(newest, found[-1]))
            continue
        product = matrices[0]
        for following in matrices[1 : i + 1]:
            product = multiply(following, product)
        found.append(product)
    return found


def compensated_plant(loop: PeriodicLoop) -> tuple[np.ndarray, ...]:
    """A2, B2, C2 and D2 of eq. 7 at each sample, states [G_c, G_p]."""
    window = loop.window
    states = [*range(window.order, window.order + window.filter), *range(window.order)]
    a, b = window.matrix[:, states][:, :, states], window.entry[:, states, None].copy()
    c = np.concatenate([np.zeros(window.filter), loop.plant.c])
    return a, b, np.broadcast_to(c, (loop.period, 1, c.size)), np.zeros(loop.period)


def lifted(
    loop: PeriodicLoop, multiply: Multiply = np.matmul, carried: bool | None = None
) -> np.ndarray:
    """One-period matrix of [G_c, G_p, u(0) .. u(N-1)] from the lifted blocks: O(N^3) work.

    The blocks are those of `lift`, or for a `carried` of True or False of `lift_by_products`.
    Source: Hanson and Tsao (2000), eqs A8-A16, with A2 and B2 in A14 and D2 in A15 and A16.
    Raises ValueError when the loop has a q other than 1, which the appendix does not treat.
    """
    if not np.array_equal(loop.memory.taps, [1.0]):
        raise ValueError(f"q = {loop.memory.taps}: the appendix has no q; use one_period_map")
    if carried is None:
        a, b, c, d = lift(loop)
    else:
        a, b, c, d = (lift_by_products(loop, block, multiply, carried) for block in "ABCD")
    ahead, late = loop.advance, loop.period - loop.advance

    def early(block: np.ndarray) -> np.ndarray:  # S^L: rows moved up
        return np.concatenate([block[ahead:], np.zeros_like(block[:ahead])])

    def delayed(block: np.ndarray) -> np.ndarray:  # D^(N-L): rows moved down
        return np.concatenate([np.zeros_like(block[:late]), block[:ahead]])

    m1 = -early(c) - delayed(multiply(c, a))
    m2 = np.eye(loop.period) - early(d) - delayed(multiply(c, b))
    lower, below = np.concatenate([m1, m2], axis=1), delayed(d)
    for k in range(late + 1, loop.period):  # the rows above stand alone
        lower[k] -= multiply(below[k : k + 1, :k], lower[:k])[0]
    return np.block([[a, b], [lower]])
