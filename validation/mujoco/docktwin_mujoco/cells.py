"""What a pair of surfaces stores and how it pushes and rubs, from the depths of its elements:
U = sum of Phi over cells - borders + corners, of `docs/physics-notes.md`, in compiled code.

All in the frame and with the normals of the elements: from the divided surface to the other.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .places import (
    ARCS, CELLS, CORNER, DEPTH, ETA, GAIN, NORMAL, PETAL_ELEMENTS, POINT, RING_ELEMENTS, ROW_BORDER,
    SIDE_BORDER,
)
from .vec import add, at3, axpy, cross, dot, mul, put3, sub, turn

# Columns of a place, which is a cell of a petal or an eighth of a ring: its number, whether any of it is
# deeper than nought, depth, elastic force that rubs (N), part of a Kelvin-Voigt damper that acts, point,
# mean normal, mean moment of the normals about the point, spread, elastic force with its share of borders.
CELL, TOUCHES, DEEP, RUBS, DAMPS, POINT_OF, DIR, COUPLE, SPREAD, FORCE, PLACE = (
    0, 1, 2, 3, 4, 5, 8, 11, 14, 15, 18
)
PLACES, EIGHTHS, IN_EIGHTH = 8, 8, 4
# Where two cells stand equally high above their border they share its force evenly, m.
EVEN = 1e-6
# Width of (N9) within an arc, as a part of `merge_depth_m`, which is that of the lowest border. At 1 rings
# face to face would store most when they are exactly flat, and tip; at 1/4 they store least.
ARC_WIDTH = 0.25


@njit(cache=True)
def slope(k, exponent, eta):
    """Phi', N."""
    if eta <= 0.0:
        return 0.0
    return k * eta if exponent == 1.0 else k * eta**exponent


@njit(cache=True)
def stored(k, exponent, eta):
    """Phi, J."""
    return slope(k, exponent, eta) * eta / (exponent + 1.0) if eta > 0.0 else 0.0


@njit(cache=True)
def smooth_max(a, b, width):
    """(N9): the larger of two depths, smooth where they differ by less than the width, and its
    derivatives by both."""
    y = abs(a - b) / width
    if y >= 1.0:
        return (a, 1.0, 0.0) if a > b else (b, 0.0, 1.0)
    lean = y * (2.0 - 1.5 * y)
    if a < b:
        lean = -lean
    return 0.5 * (a + b) + width * y * y * (1.0 - 0.5 * y), 0.5 + lean, 0.5 - lean


@njit(cache=True)
def smooth_min(a, b, width):
    """(N9) with the other sign."""
    s, da, db = smooth_max(-a, -b, width)
    return -s, da, db


@njit(cache=True)
def rise(x, width):
    """r of (N9) and its derivative."""
    z = x / width
    if z >= 1.0:
        return x, 1.0
    z = max(z, 0.0)
    return width * z * z * (2.0 - z), z * (4.0 - 3.0 * z)


@njit(cache=True)
def arc_depth(a, b, m, width):
    """Depth of an arc from those of its ends and of its deepest point, and its derivatives by them."""
    s, sa, sb = smooth_max(a, b, width)
    lift, dm = rise(m - s, width)
    return s + lift, (1.0 - dm) * sa, (1.0 - dm) * sb, dm


@njit(cache=True)
def lowest(depths, weights, width):
    """Smooth minimum of twos, of twos of twos and so on, and its derivative by every depth."""
    n = len(depths)
    level = np.empty(2 * n)
    by_a, by_b = np.empty(2 * n), np.empty(2 * n)
    # A heap: node i has the children 2 i and 2 i + 1, the root is 1.
    level[n:] = depths
    for i in range(n - 1, 0, -1):
        level[i], by_a[i], by_b[i] = smooth_min(level[2 * i], level[2 * i + 1], width)
    whole = np.empty(2 * n)
    whole[1] = 1.0
    for i in range(1, n):
        whole[2 * i], whole[2 * i + 1] = whole[i] * by_a[i], whole[i] * by_b[i]
    weights[:] = whole[n:]
    return level[1]


@njit(cache=True)
def share(first, second, border):
    """The part of a border's force that the first cell loses: who stands less above it loses more."""
    x, y = max(first - border, 0.0) + EVEN, max(second - border, 0.0) + EVEN
    return y / (x + y)


@njit(cache=True)
def _level(places, net):
    """No more rubs than the net normal force."""
    total = 0.0
    for i in range(PLACES):
        total += places[i, RUBS]
    factor = min(max(net / total, 0.0), 1.0) if total > 0.0 else 0.0
    for i in range(PLACES):
        places[i, RUBS] *= factor
        places[i, DAMPS] *= factor


@njit(cache=True)
def _push(force, moment, row, n):
    f = mul(at3(row, NORMAL), n)
    return add(force, f), add(moment, cross(at3(row, POINT), f))


@njit(cache=True)
def petal_load(elements, k, exponent, places):
    """(energy, force and moment on the other surface, largest depth); `places` are the cells."""
    places[:] = 0.0
    zero = (0.0, 0.0, 0.0)
    force, moment, energy, net, deepest = zero, zero, 0.0, 0.0, 0.0
    own = np.zeros(CELLS)
    for i in range(PETAL_ELEMENTS):
        row = elements[i]
        if row[ETA] <= 0.0:
            continue
        sign = 1.0 if i < CELLS or i >= CORNER else -1.0
        f = slope(k, exponent, row[ETA]) * row[GAIN]
        energy += sign * stored(k, exponent, row[ETA])
        force, moment = _push(force, moment, row, sign * f)
        net += sign * f
        n = at3(row, NORMAL)
        if i < CELLS:
            place = places[i]
            place[CELL], place[TOUCHES], place[DEEP], place[RUBS] = i, 1.0, row[DEPTH], f
            put3(place, POINT_OF, at3(row, POINT))
            put3(place, DIR, n)
            put3(place, FORCE, mul(n, f))
            own[i] = f
            deepest = max(deepest, row[DEPTH])
        elif i < CORNER:
            if i < ROW_BORDER:
                b, h = (i - SIDE_BORDER) // 2, (i - SIDE_BORDER) % 2
                first, second = 2 * b + h, 2 * b + 2 + h
            else:
                first, second = 2 * (i - ROW_BORDER), 2 * (i - ROW_BORDER) + 1
            part = share(elements[first, ETA], elements[second, ETA], row[ETA])
            _take(places[first], n, part * f)
            _take(places[second], n, (1.0 - part) * f)
        else:
            b = i - CORNER
            for cell in range(2 * b, 2 * b + 4):
                _take(places[cell], n, -0.25 * f)
    for i in range(CELLS):
        place = places[i]
        place[RUBS] = max(place[RUBS], 0.0)
        place[DAMPS] = min(place[RUBS] / own[i], 1.0) if own[i] > 0.0 else 0.0
    _level(places, net)
    return energy, force, moment, deepest


@njit(cache=True)
def _take(place, n, f):
    place[RUBS] -= f
    put3(place, FORCE, axpy(at3(place, FORCE), -f, n))


@njit(cache=True)
def ring_load(elements, width, k, exponent, places):
    """As `petal_load`, of two rings; `places` are eighths of the active one."""
    places[:] = 0.0
    zero = (0.0, 0.0, 0.0)
    force, moment, energy, net, deepest = zero, zero, 0.0, 0.0, 0.0
    eta, own, rubs = np.empty(ARCS), np.empty(ARCS), np.empty(ARCS)
    weight, pushes = np.empty((ARCS, 3)), np.zeros(RING_ELEMENTS)
    for i in range(ARCS):
        j = (i + 1) % ARCS
        eta[i], wa, wb, wm = arc_depth(
            elements[ARCS + i, DEPTH], elements[ARCS + j, DEPTH], elements[i, DEPTH],
            ARC_WIDTH * width,
        )
        weight[i, 0], weight[i, 1], weight[i, 2] = wa, wb, wm
        own[i] = rubs[i] = slope(k, exponent, eta[i])
        energy += stored(k, exponent, eta[i])
        net += own[i]
        pushes[ARCS + i] += own[i] * wa
        pushes[ARCS + j] += own[i] * wb
        pushes[i] = own[i] * wm
    for i in range(ARCS):
        before, d = (i - 1) % ARCS, elements[ARCS + i, DEPTH]
        f = slope(k, exponent, d)
        energy -= stored(k, exponent, d)
        net -= f
        pushes[ARCS + i] -= f
        part = share(eta[before], eta[i], d)
        rubs[before] -= part * f
        rubs[i] -= (1.0 - part) * f
    around = np.empty(ARCS)
    low = lowest(elements[ARCS:RING_ELEMENTS, DEPTH], around, width)
    if low > 0.0:
        f = slope(k, exponent, low)
        energy += stored(k, exponent, low)
        net += f
        for i in range(ARCS):
            pushes[ARCS + i] += f * around[i]
            rubs[(i - 1) % ARCS] += 0.5 * f * around[i]
            rubs[i] += 0.5 * f * around[i]
    for i in range(RING_ELEMENTS):
        if pushes[i] != 0.0:
            force, moment = _push(force, moment, elements[i], pushes[i])
            arc = i if i < ARCS else i - ARCS
            place = places[arc // IN_EIGHTH]
            put3(place, FORCE, axpy(at3(place, FORCE), pushes[i], at3(elements[i], NORMAL)))
    for e in range(EIGHTHS):
        place = places[e]
        place[CELL] = e
        total, best = 0.0, IN_EIGHTH * e
        for i in range(IN_EIGHTH * e, IN_EIGHTH * (e + 1)):
            rubs[i] = max(rubs[i], 0.0)
            total += rubs[i]
            if eta[i] > eta[best]:
                best = i
            if own[i] > 0.0:
                place[DAMPS] += min(rubs[i] / own[i], 1.0)
                place[DEEP] = max(place[DEEP], elements[i, DEPTH])
        if eta[best] <= 0.0:
            continue
        place[TOUCHES], place[RUBS] = 1.0, total
        deepest = max(deepest, place[DEEP])
        point, direction, torque, squares = zero, zero, zero, 0.0
        for i in range(IN_EIGHTH * e, IN_EIGHTH * (e + 1)):
            w = rubs[i] / total if total > 0.0 else (1.0 if i == best else 0.0)
            if w <= 0.0:
                continue
            for j in range(3):
                at = i if j == 2 else (ARCS + i if j == 0 else ARCS + (i + 1) % ARCS)
                x, n, v = at3(elements[at], POINT), at3(elements[at], NORMAL), w * weight[i, j]
                point, direction = axpy(point, v, x), axpy(direction, v, n)
                torque, squares = axpy(torque, v, cross(x, n)), squares + v * dot(x, x)
        put3(place, POINT_OF, point)
        put3(place, DIR, direction)
        put3(place, COUPLE, sub(torque, cross(point, direction)))
        place[SPREAD] = math.sqrt(max(squares - dot(point, point), 0.0))
    _level(places, net)
    return energy, force, moment, deepest


@njit(cache=True)
def _as_seen(places, r, p):
    """Places measured from the passive petal, in the active ring's frame and with normals turned round."""
    for i in range(PLACES):
        row = places[i]
        put3(row, POINT_OF, add(turn(r, at3(row, POINT_OF)), p))
        for at in (DIR, COUPLE, FORCE):
            put3(row, at, mul(turn(r, at3(row, at)), -1.0))


@njit(cache=True)
def pair_load(pair, elements, width, k, exponent, r, p, places):
    """Load of a pair from its elements: energy, force and moment on the passive side about the active
    ring's origin, largest depth; (r, p) poses the passive ring in the active one's frame, which
    all results are in. Pairs: 0 rings, 1 to 3 active petal on ring, 4 to 6 ring on passive petal, 7 to 15
    petals."""
    if pair == 0:
        return ring_load(elements, width, k, exponent, places)
    u, f, m, d = petal_load(elements, k, exponent, places)
    if 4 <= pair <= 6:
        f = mul(turn(r, f), -1.0)
        m = add(mul(turn(r, m), -1.0), cross(p, f))
        _as_seen(places, r, p)
    return u, f, m, d


@njit(cache=True)
def neighbours(pair, a, b):
    """Whether two places of a pair lie beside each other."""
    if pair == 0:
        d = abs(a - b)
        return min(d, EIGHTHS - d) <= 1
    return abs(a // 2 - b // 2) <= 1
