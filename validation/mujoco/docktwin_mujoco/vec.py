"""Three-vectors as tuples and rotations as three rows, for compiled code: no arrays, no heap."""

from __future__ import annotations

import math

from numba import njit

_fast = njit(cache=True, inline="never")


@_fast
def add(a, b):
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@_fast
def sub(a, b):
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@_fast
def mul(a, s):
    """s a."""
    return (a[0] * s, a[1] * s, a[2] * s)


@_fast
def axpy(a, s, b):
    """a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@_fast
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_fast
def cross(a, b):
    """a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@_fast
def norm(a):
    """|a|."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@_fast
def turn(r, v):
    """R v."""
    return (dot(r[0], v), dot(r[1], v), dot(r[2], v))


@_fast
def back(r, v):
    """R transposed times v."""
    return (
        r[0][0] * v[0] + r[1][0] * v[1] + r[2][0] * v[2],
        r[0][1] * v[0] + r[1][1] * v[1] + r[2][1] * v[2],
        r[0][2] * v[0] + r[1][2] * v[1] + r[2][2] * v[2],
    )


@_fast
def chain(a, b):
    """A B."""
    return (back(b, a[0]), back(b, a[1]), back(b, a[2]))


@_fast
def transposed(r):
    """R transposed."""
    return (
        (r[0][0], r[1][0], r[2][0]),
        (r[0][1], r[1][1], r[2][1]),
        (r[0][2], r[1][2], r[2][2]),
    )


@_fast
def at3(x, i):
    """Three numbers of an array as a vector."""
    return (x[i], x[i + 1], x[i + 2])


@_fast
def at9(x, i):
    """Nine numbers of an array as rows."""
    return (at3(x, i), at3(x, i + 3), at3(x, i + 6))


@_fast
def put3(x, i, v):
    """A vector into an array."""
    x[i] = v[0]
    x[i + 1] = v[1]
    x[i + 2] = v[2]


@_fast
def matrix(w, x, y, z):
    """Rotation of a unit quaternion, normalised here."""
    n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w * n, x * n, y * n, z * n
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@_fast
def rotation_vector(r):
    """Of a rotation by less than half a turn."""
    a = (0.5 * (r[2][1] - r[1][2]), 0.5 * (r[0][2] - r[2][0]), 0.5 * (r[1][0] - r[0][1]))
    s = norm(a)
    c = 0.5 * (r[0][0] + r[1][1] + r[2][2] - 1.0)
    angle = math.atan2(s, c)
    return mul(a, angle / s) if s > 1e-12 else a


@_fast
def solve3(a, b):
    """x with A x = b, by Cramer."""
    c0 = (a[0][0], a[1][0], a[2][0])
    c1 = (a[0][1], a[1][1], a[2][1])
    c2 = (a[0][2], a[1][2], a[2][2])
    det = dot(c0, cross(c1, c2))
    return (
        dot(b, cross(c1, c2)) / det,
        dot(c0, cross(b, c2)) / det,
        dot(c0, cross(c1, b)) / det,
    )
