"""The solution of (L, h) = 𝓜u where some rates are given and the shell may not turn as it likes.

Like formulas.py on floats, on columns and inside numba: `...` is the shape of the scalars.
"""

import numpy as np

from robotball.mechanics.formulas import Numbers


def solve(matrix: Numbers, given: Numbers, right: Numbers, u: Numbers) -> None:
    """u (k, c, ...) of 𝓜u = right in the rows whose u is not given (k,); there u is what it is.

    𝓜 is positive, so that no rows need to be exchanged.
    """
    k, columns = right.shape[0], right.shape[1]
    left = np.copy(matrix)
    for i in range(k):
        if not given[i]:
            for c in range(columns):
                u[i, c] = right[i, c]
                for j in range(k):
                    if given[j]:
                        u[i, c] -= matrix[i, j] * u[j, c]
    for i in range(k):
        for j in range(i + 1, k):
            if not (given[i] or given[j]):
                factor = left[j, i] / left[i, i]
                for l in range(i + 1, k):
                    left[j, l] -= factor * left[i, l]
                for c in range(columns):
                    u[j, c] -= factor * u[i, c]
    for i in range(k - 1, -1, -1):
        if not given[i]:
            for c in range(columns):
                for j in range(i + 1, k):
                    if not given[j]:
                        u[i, c] -= left[i, j] * u[j, c]
                u[i, c] = u[i, c] / left[i, i]


def solve_rolling(
    matrix: Numbers, given: Numbers, directions: Numbers, right: Numbers, u: Numbers
) -> None:
    """u (k, 1, ...) as `solve` gives it, where torques along D_k (c, 3, ...) make (D_k, ω_s) = 0.

    For the rates of momenta these are L's parts along D_k, which the momenta do not tell.
    """
    k, count = len(matrix), len(directions)
    columns = np.zeros_like(matrix[:, : 1 + count])
    answers = np.zeros_like(columns)
    for i in range(k):
        columns[i, 0] = right[i, 0]
        answers[i, 0] = u[i, 0]
    for c in range(count):
        for i in range(3):
            columns[i, 1 + c] = directions[c, i]
    solve(matrix, given, columns, answers)
    small = np.zeros_like(matrix[:count, :count])
    off = np.zeros_like(matrix[:count, :1])
    torques = np.zeros_like(off)
    for c in range(count):
        for i in range(3):
            off[c, 0] -= directions[c, i] * answers[i, 0]
            for other in range(count):
                small[c, other] += directions[c, i] * answers[i, 1 + other]
    solve(small, np.zeros(count, dtype=np.bool_), off, torques)
    for i in range(k):
        u[i, 0] = answers[i, 0]
        for c in range(count):
            u[i, 0] += torques[c, 0] * answers[i, 1 + c]
