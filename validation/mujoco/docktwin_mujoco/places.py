"""How deep two surfaces overlap in every cell, on every border between two cells and at every corner of
four: the depths that the law of `docs/physics-notes.md` is stated for, in compiled code.

A petal has 4 x 2 cells, a ring 32 arcs. For a petal the deepest point of every *ruling* is found first,
over the half of the ruling that belongs to a row of cells and over all of the other surface; along u
this profile is looked at in steps and, where its slope changes sign, followed to its highest point.
Nothing is remembered from call to call, so the depths depend on the pose alone.

An *element* is a cell, a border or a corner; a row of an element array has the columns below. A row with
an effective depth of nought or less is not filled in further. All in the frame of the surface that is
divided.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .vec import add, axpy, back, dot, mul, norm, put3, sub, turn

# Columns of an element: effective depth, depth, d(effective)/d(depth), point, normal from the divided
# surface to the other, parameters of the deepest point (ring: azimuth; petal: u, w and, on a petal, v, t).
ETA, DEPTH, GAIN, POINT, NORMAL, AT, ELEMENT = 0, 1, 2, 3, 6, 9, 13
ACROSS, ALONG = 4, 2
CELLS, BORDERS, CORNERS = 8, 10, 3
# Cell (i, h): 2 i + h, i across and h along. Borders across u: `SIDE_BORDER` + 2 b + h between columns b
# and b + 1; along: `ROW_BORDER` + i between the two rows of column i. Corners: `CORNER` + b.
SIDE_BORDER, ROW_BORDER, CORNER, PETAL_ELEMENTS = 8, 14, 18, 21
# Arcs, then the borders at which they begin.
ARCS, RING_ELEMENTS = 32, 64
MOST_ELEMENTS = 64
TAU = 2.0 * math.pi
# Looks at a profile per cell, and along the half of a ruling.
LOOKS, STEPS = 5, 4
# From a look to the next, in u.
WIDTH = 2.0 / (ACROSS * LOOKS)
# Looks on the other petal: `COARSE` intervals of `FINE`.
COARSE, FINE = 5, 4
# What is this much less deep than nought is followed as if it touched: so gaps are known, m.
AROUND = 2e-3
NOTHING = -1e300

_AZIMUTHS = TAU / (4 * ARCS) * np.arange(4 * ARCS)
_COS, _SIN = np.cos(_AZIMUTHS), np.sin(_AZIMUTHS)


# -- rings -----------------------------------------------------------------------------------------


@njit(cache=True)
def _towards(c, s, ra, rb, r, p):
    """Point of the active circle at an azimuth, in the passive ring's frame, how far it stands from
    that ring's axis, and half the squared distance from its circle."""
    x = back(r, (-p[0], ra * c - p[1], ra * s - p[2]))
    rho = math.hypot(x[1], x[2])
    return x, rho, 0.5 * ((rho - rb) * (rho - rb) + x[0] * x[0])


@njit(cache=True)
def _ring_slope(c, s, ra, rb, r, p):
    """First and second derivative by the azimuth of half the squared distance."""
    x, rho, _ = _towards(c, s, ra, rb, r, p)
    t = back(r, (0.0, -ra * s, ra * c))
    m = back(r, (0.0, -ra * c, -ra * s))
    xt, tt = x[1] * t[1] + x[2] * t[2], t[1] * t[1] + t[2] * t[2]
    along = xt / rho
    bend = (tt + x[1] * m[1] + x[2] * m[2] - along * along) / rho
    return (
        (rho - rb) * along + x[0] * t[0],
        along * along + (rho - rb) * bend + t[0] * t[0] + x[0] * m[0],
    )


@njit(cache=True)
def _ring_element(row, phi, ra, ta, rb, tb, r, p):
    c, s = math.cos(phi), math.sin(phi)
    x, rho, half = _towards(c, s, ra, rb, r, p)
    d = max(math.sqrt(2.0 * half), 1e-12)
    n = turn(r, (-x[0] / d, (rb - rho) / d * x[1] / rho, (rb - rho) / d * x[2] / rho))
    depth = ta + tb - d
    row[ETA], row[DEPTH], row[GAIN], row[AT] = depth, depth, 1.0, phi
    put3(row, POINT, axpy((0.0, ra * c, ra * s), ta - 0.5 * depth, n))
    put3(row, NORMAL, n)


@njit(cache=True)
def ring_on_ring(out, ra, ta, rb, tb, r, p):
    """Arcs and borders of the active ring against the passive one posed by (r, p); not smoothed.
    Returns the largest depth, or what it is surely not above."""
    n = 4 * ARCS
    half = np.empty(n)
    least = 1e300
    for i in range(n):
        half[i] = _towards(_COS[i], _SIN[i], ra, rb, r, p)[2]
        least = min(least, half[i])
    # Between two looks the square of the distance is lower by no more than this.
    width = TAU / n
    dip = 0.25 * (ra * width) ** 2 * (1.0 + math.sqrt(2.0 * least) / ra)
    reach = ta + tb
    bound = reach - math.sqrt(max(2.0 * least - dip, 0.0))
    if bound <= -AROUND:
        return bound
    deepest = NOTHING
    for i in range(ARCS):
        _ring_element(out[ARCS + i], width * 4 * i, ra, ta, rb, tb, r, p)
    for i in range(ARCS):
        best, phi = 1e300, 0.0
        for j in range(5):
            f = half[(4 * i + j) % n]
            if f < best:
                best, phi = f, width * (4 * i + j)
        for j in range(4):
            a, b = 4 * i + j, (4 * i + j + 1) % n
            if 2.0 * min(half[a], half[b]) - dip > min(2.0 * best, (reach + AROUND) ** 2):
                continue
            lo, hi = width * a, width * (a + 1)
            if _ring_slope(_COS[a], _SIN[a], ra, rb, r, p)[0] >= 0.0:
                continue
            if _ring_slope(_COS[b], _SIN[b], ra, rb, r, p)[0] <= 0.0:
                continue
            x = 0.5 * (lo + hi)
            for _ in range(60):
                slope, curve = _ring_slope(math.cos(x), math.sin(x), ra, rb, r, p)
                if slope < 0.0:
                    lo = x
                else:
                    hi = x
                new = x - slope / curve if curve > 0.0 else 0.5 * (lo + hi)
                if not (lo <= new <= hi):
                    new = 0.5 * (lo + hi)
                done = abs(new - x) < 1e-12
                x = new
                if done:
                    break
            f = _towards(math.cos(x), math.sin(x), ra, rb, r, p)[2]
            if f < best:
                best, phi = f, x
        _ring_element(out[i], phi, ra, ta, rb, tb, r, p)
        deepest = max(deepest, out[i, ETA])
    return deepest


# -- petals ----------------------------------------------------------------------------------------
# A petal is (base radius, tip radius, height, base half-angle, tip half-angle, ball radius, EI,
# azimuth, length of the middle ruling).


@njit(cache=True)
def ruling(g, u):
    """Foot and vector of the ruling u in [-1, 1], in its ring's frame."""
    a, b = g[7] + u * g[3], g[7] + u * g[4]
    foot = (0.0, g[0] * math.cos(a), g[0] * math.sin(a))
    tip = (g[2], g[1] * math.cos(b), g[1] * math.sin(b))
    return foot, sub(tip, foot)


@njit(cache=True)
def ruling_rates(g, u):
    """The ruling u, its derivative by u and its second derivative."""
    a, b = g[7] + u * g[3], g[7] + u * g[4]
    ca, sa, cb, sb = math.cos(a), math.sin(a), math.cos(b), math.sin(b)
    foot, tip = (0.0, g[0] * ca, g[0] * sa), (g[2], g[1] * cb, g[1] * sb)
    x, y = g[0] * g[3], g[1] * g[4]
    foot1, tip1 = (0.0, -x * sa, x * ca), (0.0, -y * sb, y * cb)
    x, y = x * g[3], y * g[4]
    foot2, tip2 = (0.0, -x * ca, -x * sa), (0.0, -y * cb, -y * sb)
    return foot, sub(tip, foot), foot1, sub(tip1, foot1), foot2, sub(tip2, foot2)


@njit(cache=True)
def petal_ball(g):
    """Radius about the middle of the middle ruling that holds the whole sheet."""
    foot, t = ruling(g, 0.0)
    mid = axpy(foot, 0.5, t)
    foot, t = ruling(g, 1.0)
    return max(norm(sub(foot, mid)), norm(sub(add(foot, t), mid)), 0.5 * g[8])


@njit(cache=True)
def _dip(g, du):
    """Between two rulings du apart the square of a distance is lower than at both by no more than this."""
    w = max(abs(g[0]) * g[3], abs(g[1]) * g[4]) * du
    return 0.275 * w * w


@njit(cache=True)
def gain(c, e, wa, cb, wb):
    """(k(s)/k_c)^(1/(n+1)) and the first and second derivatives of its logarithm by w on either petal
    (aa, ab, bb). `c`, `cb`: k_c s^3/(3EI) at the tips; e = 1/(n+1)."""
    x = 1.0 + c * wa * wa * wa + cb * wb * wb * wb
    xa, xb = 3.0 * c * wa * wa / x, 3.0 * cb * wb * wb / x
    g = 1.0 / math.sqrt(x) if e == 0.5 else x**-e
    return (
        g, -e * xa, -e * xb, -e * (6.0 * c * wa / x - xa * xa), e * xa * xb,
        -e * (6.0 * cb * wb / x - xb * xb),
    )


# Two surfaces and their pose: whether the other one is a petal, the divided petal, the other surface,
# compliances at the tips, 1/(n+1), sum of the radii, pose of the other one. Handed on as `pose`.
# Room to work in: rulings of the other petal (feet, vectors) and their dips, looks (squared distance, w,
# t), a place, its bounds, another place. Handed on as `room`.
# A profile is followed for one of three tracks: rows of cells 0 and 1 and, as a row of no width, the
# border between them.
@njit(cache=True)
def _track(h):
    if h == 2:
        return 0.5, 0.5
    return 0.5 * h, 0.5 * h + 0.5


# -- a petal against a circle ----------------------------------------------------------------------


@njit(cache=True)
def _from_circle(foot, t, w, radius):
    """Point of a line, its distance from the axis, half its squared distance from the circle."""
    x = axpy(foot, w, t)
    rho = math.hypot(x[1], x[2])
    return x, rho, 0.5 * ((rho - radius) * (rho - radius) + x[0] * x[0])


@njit(cache=True)
def _best_on_ruling(foot, t, lo, hi, radius, reach, c, e):
    """Where a ruling's effective depth against the circle is largest: (effective depth, w). The circle's
    frame."""
    x, rho, f = _from_circle(foot, t, lo, radius)
    if lo == hi:
        return (reach - math.sqrt(2.0 * f)) * gain(c, e, lo, 0.0, 0.0)[0], lo
    h = (hi - lo) / STEPS
    f0 = f
    f1 = _from_circle(foot, t, lo + h, radius)[2]
    f2 = _from_circle(foot, t, lo + 2.0 * h, radius)[2]
    f3 = _from_circle(foot, t, lo + 3.0 * h, radius)[2]
    f4 = _from_circle(foot, t, hi, radius)[2]
    fs = (f0, f1, f2, f3, f4)
    tt = dot(t, t)
    least = min(min(f0, f1), min(f2, min(f3, f4)))
    limit = least + 0.125 * h * h * tt
    # The gain may move the place by a few millimetres where the distance hardly changes.
    limit += 1e-6
    best, at = NOTHING, lo
    for j in range(STEPS + 1):
        f = fs[j]
        if f > limit or (j > 0 and fs[j - 1] < f) or (j < STEPS and fs[j + 1] < f):
            continue
        a, b = max(lo + (j - 1) * h, lo), min(lo + (j + 1) * h, hi)
        w = lo + j * h
        tyz = t[1] * t[1] + t[2] * t[2]
        for _ in range(60):
            x, rho, f = _from_circle(foot, t, w, radius)
            d = math.sqrt(2.0 * f)
            along = (x[1] * t[1] + x[2] * t[2]) / rho
            g, g1, _, g11, _, _ = gain(c, e, w, 0.0, 0.0)
            first = (rho - radius) * along + x[0] * t[0]
            slope = first - d * (reach - d) * g1
            if slope < 0.0:
                a = w
            else:
                b = w
            curve = along * along + (rho - radius) * (tyz - along * along) / rho + t[0] * t[0]
            curve -= d * (reach - d) * g11 + (reach - 2.0 * d) * (first / max(d, 1e-12)) * g1
            new = w - slope / curve if curve > 0.0 else 0.5 * (a + b)
            if (w == lo and slope >= 0.0) or (w == hi and slope <= 0.0):
                break
            if not (a <= new <= b):
                new = 0.5 * (a + b)
            done = abs(new - w) < 1e-11
            w = new
            if done:
                break
        f = _from_circle(foot, t, w, radius)[2]
        eta = (reach - math.sqrt(2.0 * f)) * gain(c, e, w, 0.0, 0.0)[0]
        if eta > best:
            best, at = eta, w
    return best, at


@njit(cache=True)
def _on_circle(u, h, pose, z):
    """A ruling's largest effective depth against a circle and its slope along u; z says where."""
    _, g, ring, c, _, e, reach, r, p = pose
    foot, t, foot1, t1, _, _ = ruling_rates(g, u)
    foot, t = back(r, sub(foot, p)), back(r, t)
    lo, hi = _track(h)
    eta, w = _best_on_ruling(foot, t, lo, hi, ring[0], reach, c, e)
    x, rho, f = _from_circle(foot, t, w, ring[0])
    d = max(math.sqrt(2.0 * f), 1e-12)
    xu = back(r, axpy(foot1, w, t1))
    away = (rho - ring[0]) * (x[1] * xu[1] + x[2] * xu[2]) / rho + x[0] * xu[0]
    z[0], z[1], z[2], z[3] = u, w, 0.0, 0.0
    return eta, -gain(c, e, w, 0.0, 0.0)[0] * away / d


# -- a petal against a petal -----------------------------------------------------------------------


@njit(cache=True)
def line_to_line(p, d, q, e):
    """Fractions of the nearest points of two pieces of lines, p + s d and q + t e."""
    r = sub(p, q)
    a, b, c = dot(d, d), dot(d, e), dot(e, e)
    f, g = dot(d, r), dot(e, r)
    det = a * c - b * b
    s = 0.0
    if det > 1e-14 * a * c:
        s = min(max((b * g - c * f) / det, 0.0), 1.0)
    elif a > 0.0:
        s = 0.5
    t = (b * s + g) / c
    if t < 0.0:
        t = 0.0
        s = min(max(-f / a, 0.0), 1.0) if a > 0.0 else 0.0
    elif t > 1.0:
        t = 1.0
        s = min(max((b - f) / a, 0.0), 1.0) if a > 0.0 else 0.0
    return s, t


@njit(cache=True)
def _solve4(m, y, free, shift, step):
    """Cholesky of the free rows and columns with a shift; False where it is not positive definite."""
    l = np.zeros((4, 4))
    for i in range(4):
        if not free[i]:
            continue
        for j in range(i + 1):
            if not free[j]:
                continue
            v = m[i, j]
            if i == j:
                v += shift
            for k in range(j):
                v -= l[i, k] * l[j, k]
            if i == j:
                if v <= 1e-14:
                    return False
                l[i, i] = math.sqrt(v)
            else:
                l[i, j] = v / l[j, j]
    for i in range(4):
        step[i] = 0.0
        if free[i]:
            v = y[i]
            for k in range(i):
                v -= l[i, k] * step[k]
            step[i] = v / l[i, i]
    for i in range(3, -1, -1):
        if free[i]:
            v = step[i]
            for k in range(i + 1, 4):
                v -= l[k, i] * step[k]
            step[i] = v / l[i, i]
    return True


@njit(cache=True)
def _sheets(z, ga, gb, r, p):
    """Effective depth without its gain: distance and points of two sheets at (u, w, v, t)."""
    fa, ta = ruling(ga, z[0])
    fb, tb = ruling(gb, z[2])
    x = axpy(fa, z[1], ta)
    y = add(turn(r, axpy(fb, z[3], tb)), p)
    return x, y


@njit(cache=True)
def climb(z, lo, hi, pose):
    """Largest effective depth near z = (u, w, v, t) within the box, by Newton's method on
    D dD = D delta d(ln gain), D the distance. Returns it and its slope along u; z moves there."""
    _, ga, gb, ca, cb, e, reach, r, p = pose
    m, y, step, trial = np.empty((4, 4)), np.empty(4), np.empty(4), np.empty(4)
    free = np.empty(4, dtype=np.bool_)
    shift = 0.0
    value, slope = NOTHING, 0.0
    for _ in range(60):
        f, t, f1, t1, f2, t2 = ruling_rates(ga, z[0])
        x, xu, xw, xuu, xuw = axpy(f, z[1], t), axpy(f1, z[1], t1), t, axpy(f2, z[1], t2), t1
        f, t, f1, t1, f2, t2 = ruling_rates(gb, z[2])
        q = add(turn(r, axpy(f, z[3], t)), p)
        yv, yt = turn(r, axpy(f1, z[3], t1)), turn(r, t)
        yvv, yvt = turn(r, axpy(f2, z[3], t2)), turn(r, t1)
        gap = sub(x, q)
        d = max(norm(gap), 1e-12)
        delta = reach - d
        g, la, lb, laa, lab, lbb = gain(ca, e, z[1], cb, z[3])
        value, slope = delta * g, -g * dot(gap, xu) / d
        dd = d * delta
        y[0], y[1] = dot(gap, xu), dot(gap, xw) - dd * la
        y[2], y[3] = -dot(gap, yv), -dot(gap, yt) - dd * lb
        bend = (reach - 2.0 * d) * delta
        m[0, 0], m[1, 0], m[1, 1] = dot(xu, xu) + dot(gap, xuu), dot(xu, xw) + dot(gap, xuw), (
            dot(xw, xw) - dd * laa - bend * la * la
        )
        m[2, 0], m[2, 1], m[2, 2] = -dot(yv, xu), -dot(yv, xw), dot(yv, yv) - dot(gap, yvv)
        m[3, 0], m[3, 1] = -dot(yt, xu), -dot(yt, xw) - dd * lab - bend * la * lb
        m[3, 2], m[3, 3] = dot(yt, yv) - dot(gap, yvt), dot(yt, yt) - dd * lbb - bend * lb * lb
        any_free, steep = False, 0.0
        for i in range(4):
            held = hi[i] <= lo[i] or (z[i] <= lo[i] and y[i] >= 0.0) or (z[i] >= hi[i] and y[i] <= 0.0)
            free[i] = not held
            if free[i]:
                any_free, steep = True, max(steep, abs(y[i]))
        if not any_free or steep < 1e-13:
            break
        moved, size = False, 0.0
        for _ in range(40):
            if _solve4(m, y, free, shift, step):
                size = 0.0
                for i in range(4):
                    trial[i] = min(max(z[i] - step[i], lo[i]), hi[i]) if free[i] else z[i]
                    size = max(size, abs(trial[i] - z[i]))
                a, b = _sheets(trial, ga, gb, r, p)
                new = (reach - norm(sub(b, a))) * gain(ca, e, trial[1], cb, trial[3])[0]
                # Where only rounding is left to gain the step is taken.
                if new > value or (size < 1e-7 and new > value - 1e-15):
                    moved = True
                    break
            shift = max(10.0 * shift, 1e-6)
        if not moved:
            break
        shift = 0.1 * shift if shift > 1e-7 else 0.0
        z[:] = trial
        if size < 1e-11:
            break
    return value, slope


@njit(cache=True)
def _fan(gb, r, p, feet, vectors):
    """Rulings of the other petal at the looks, in the divided one's frame."""
    n = COARSE * FINE
    for j in range(n + 1):
        f, t = ruling(gb, -1.0 + 2.0 * j / n)
        put3(feet[j], 0, add(turn(r, f), p))
        put3(vectors[j], 0, turn(r, t))


@njit(cache=True)
def _ruling_gap(foot, t, lo, hi, feet, vectors, j):
    """Square of the distance from a piece of a ruling to ruling j of the fan, and where."""
    fb, tb = (feet[j, 0], feet[j, 1], feet[j, 2]), (vectors[j, 0], vectors[j, 1], vectors[j, 2])
    a = axpy(foot, lo, t)
    s, q = line_to_line(a, mul(t, hi - lo), fb, tb)
    w = lo + s * (hi - lo)
    gap = sub(axpy(foot, w, t), axpy(fb, q, tb))
    return dot(gap, gap), w, q


@njit(cache=True)
def _look(foot, t, lo, hi, feet, vectors, dips, limit, sq, ws, ts):
    """Squares of the distances of a piece of a ruling from the fan; those surely above the limit (less the
    finer dip) are left out. Returns what no ruling of the other petal is nearer than, squared."""
    n = COARSE * FINE
    for j in range(n + 1):
        sq[j] = 1e300
    for i in range(COARSE + 1):
        j = FINE * i
        sq[j], ws[j], ts[j] = _ruling_gap(foot, t, lo, hi, feet, vectors, j)
    least = 1e300
    for i in range(COARSE):
        a = FINE * i
        low = min(sq[a], sq[a + FINE]) - dips[0]
        if low > limit:
            least = min(least, low)
            continue
        for j in range(a + 1, a + FINE):
            sq[j], ws[j], ts[j] = _ruling_gap(foot, t, lo, hi, feet, vectors, j)
        for j in range(a, a + FINE):
            least = min(least, min(sq[j], sq[j + 1]) - dips[1])
    return least


@njit(cache=True)
def _on_sheet(u, h, pose, room, limit):
    """A ruling's largest effective depth against the other petal, and its slope along u; the room's place
    says where. Nothing is sought where the square of the distance is surely above the limit."""
    feet, vectors, dips, sq, ws, ts, z, lo, hi, keep = room
    foot, t = ruling(pose[1], u)
    a, b = _track(h)
    if _look(foot, t, a, b, feet, vectors, dips, limit, sq, ws, ts) > limit:
        return NOTHING, 0.0
    n = COARSE * FINE
    low = 1e300
    for j in range(n + 1):
        low = min(low, sq[j])
    best, slope = NOTHING, 0.0
    step = 2.0 / n
    lo[0], hi[0], lo[1], hi[1], lo[3], hi[3] = u, u, a, b, 0.0, 1.0
    for j in range(n + 1):
        if sq[j] > low + dips[1] + 2e-6 or (j > 0 and sq[j - 1] < sq[j]) or (
            j < n and sq[j + 1] < sq[j]
        ):
            continue
        v = -1.0 + j * step
        lo[2], hi[2] = max(v - 1.5 * step, -1.0), min(v + 1.5 * step, 1.0)
        keep[0], keep[1], keep[2], keep[3] = u, ws[j], v, ts[j]
        f, s = climb(keep, lo, hi, pose)
        if f > best:
            best, slope = f, s
            z[:] = keep
    return best, slope


@njit(cache=True)
def _beside(u, h, pose, room):
    """As `_on_sheet`, from a place on a ruling beside it."""
    _, _, _, _, _, _, z, lo, hi, _ = room
    lo[0], hi[0], lo[3], hi[3] = u, u, 0.0, 1.0
    lo[1], hi[1] = _track(h)
    lo[2], hi[2] = max(z[2] - 0.2, -1.0), min(z[2] + 0.2, 1.0)
    z[0] = u
    return climb(z, lo, hi, pose)


# -- elements of a petal ---------------------------------------------------------------------------


@njit(cache=True)
def _circle_element(row, z, pose):
    _, g, ring, c, _, e, reach, r, p = pose
    foot, t = ruling(g, z[0])
    x = axpy(foot, z[1], t)
    local = back(r, sub(x, p))
    s = ring[0] / math.hypot(local[1], local[2])
    gap = sub(add(turn(r, (0.0, local[1] * s, local[2] * s)), p), x)
    _fill(row, x, gap, g[5], reach, gain(c, e, z[1], 0.0, 0.0)[0])


@njit(cache=True)
def _fill(row, x, gap, ball, reach, g):
    d = max(norm(gap), 1e-12)
    n = mul(gap, 1.0 / d)
    depth = reach - d
    row[ETA], row[DEPTH], row[GAIN] = depth * g, depth, g
    put3(row, POINT, axpy(x, ball - 0.5 * depth, n))
    put3(row, NORMAL, n)


@njit(cache=True)
def _raise(out, i, eta, z):
    """Takes a point as the deepest of an element if it is."""
    if eta > out[i, ETA]:
        out[i, ETA] = eta
        out[i, AT : AT + 4] = z


@njit(cache=True)
def _count(out, h, i, eta, z):
    """Takes look i of track h into account: cells on both sides of a border have its points."""
    col, edge = i // LOOKS, i % LOOKS == 0
    for c in range(col - 1 if edge else col, col + 1):
        if 0 <= c < ACROSS:
            _raise(out, 2 * c + h if h < 2 else ROW_BORDER + c, eta, z)
    if edge and 0 < col < ACROSS:
        _raise(out, SIDE_BORDER + 2 * (col - 1) + h if h < 2 else CORNER + col - 1, eta, z)


@njit(cache=True)
def _crest(out, h, i, zs, eta, slope, pose, room):
    """Highest point of track h between looks i and i + 1, by regula falsi (Illinois) on the slope. Where
    the looks stand on different parts of the other petal, it is searched as a whole every time."""
    z = room[6]
    a, b = zs[i], zs[i + 1]
    two = pose[0] and (
        abs(a[1] - b[1]) > 0.3 or abs(a[2] - b[2]) > 0.3 or abs(a[3] - b[3]) > 0.3
    )
    row = 2 * (i // LOOKS) + h if h < 2 else ROW_BORDER + i // LOOKS
    ul, ur, sl, sr, side = -1.0 + i * WIDTH, -1.0 + (i + 1) * WIDTH, slope[i], slope[i + 1], 0
    z[:] = a if eta[i] > eta[i + 1] else b
    for _ in range(60):
        u = (ul * sr - ur * sl) / (sr - sl)
        u = min(max(u, ul + 1e-3 * (ur - ul)), ur - 1e-3 * (ur - ul))
        if not pose[0]:
            f, s = _on_circle(u, h, pose, z)
        elif two:
            f, s = _on_sheet(u, h, pose, room, 1e300)
        else:
            f, s = _beside(u, h, pose, room)
        _raise(out, row, f, z)
        if abs(s) * (ur - ul) < 1e-13 or ur - ul < 1e-10:
            break
        if s > 0.0:
            ul, sl = u, s
            if side == 1:
                sr *= 0.5
            side = 1
        else:
            ur, sr = u, s
            if side == -1:
                sl *= 0.5
            side = -1


@njit(cache=True)
def _distant(pose, room, limit, far):
    """Which rulings are surely beyond the limit (of a squared distance), and what none is nearer than."""
    sheet, g, other, _, _, _, _, r, p = pose
    feet, vectors, dips, sq, ws, ts, _, _, _, _ = room
    nearest = 1e300
    for i in range(len(far)):
        foot, t = ruling(g, -1.0 + i * WIDTH)
        least = 1e300
        if sheet:
            least = _look(foot, t, 0.0, 1.0, feet, vectors, dips, limit, sq, ws, ts)
        else:
            x, v = back(r, sub(foot, p)), back(r, t)
            for j in range(2 * STEPS + 1):
                least = min(least, 2.0 * _from_circle(x, v, 0.5 * j / STEPS, other[0])[2])
            least -= 0.25 * (0.5 / STEPS) ** 2 * dot(t, t)
        far[i] = least > limit
        nearest = min(nearest, least)
    return nearest


@njit(cache=True)
def petal_elements(out, sheet, ga, gb, kc, exponent, r, p):
    """Cells, borders and corners of a petal against a petal (`sheet`) or a ring (gb[0], gb[5]) posed by
    (r, p) in the petal's ring frame. Returns the largest effective depth, or what it is surely not
    above."""
    reach = ga[5] + gb[5]
    ca = kc * ga[8] ** 3 / (3.0 * ga[6])
    cb = kc * gb[8] ** 3 / (3.0 * gb[6]) if sheet else 0.0
    foot, t = ruling(ga, 0.0)
    mid = axpy(foot, 0.5, t)
    if sheet:
        foot, t = ruling(gb, 0.0)
        away = norm(sub(add(turn(r, axpy(foot, 0.5, t)), p), mid)) - petal_ball(gb)
    else:
        x = back(r, sub(mid, p))
        away = math.hypot(math.hypot(x[1], x[2]) - gb[0], x[0])
    bound = reach - (away - petal_ball(ga))
    if bound <= -AROUND:
        return bound
    n, m = ACROSS * LOOKS + 1, COARSE * FINE + 1
    feet, vectors = np.empty((m, 3)), np.empty((m, 3))
    dips = (0.0, 0.0)
    if sheet:
        _fan(gb, r, p, feet, vectors)
        dips = (_dip(gb, 2.0 / COARSE), _dip(gb, 2.0 / (COARSE * FINE)))
    z = np.empty(4)
    pose = (sheet, ga, gb, ca, cb, 1.0 / (exponent + 1.0), reach, r, p)
    room = (
        feet, vectors, dips, np.empty(m), np.empty(m), np.empty(m), z, np.empty(4), np.empty(4),
        np.empty(4),
    )
    # What is beyond this is no deeper than -AROUND, on this ruling or between it and the next.
    dip = _dip(ga, WIDTH)
    limit = (reach + AROUND) ** 2 + dip
    far = np.empty(n, dtype=np.bool_)
    nearest = _distant(pose, room, limit, far)
    if nearest > limit:
        return reach - math.sqrt(nearest - dip)
    for i in range(PETAL_ELEMENTS):
        out[i, ETA] = NOTHING
    eta, slope, zs = np.empty(n), np.empty(n), np.zeros((n, 4))
    for h in range(3):
        for i in range(n):
            eta[i], slope[i] = NOTHING, 0.0
            # Beside one that is near, one that is far is followed as well: a crest needs both ends.
            if far[i] and not (i > 0 and not far[i - 1]) and not (i < n - 1 and not far[i + 1]):
                continue
            u = -1.0 + i * WIDTH
            if sheet:
                eta[i], slope[i] = _on_sheet(u, h, pose, room, 1e300 if far[i] else limit)
            else:
                eta[i], slope[i] = _on_circle(u, h, pose, z)
            if eta[i] > NOTHING:
                zs[i] = z
                _count(out, h, i, eta[i], z)
        for i in range(n - 1):
            if slope[i] > 0.0 > slope[i + 1] and eta[i] > NOTHING and eta[i + 1] > NOTHING:
                _crest(out, h, i, zs, eta, slope, pose, room)
    top = -AROUND
    for i in range(PETAL_ELEMENTS):
        top = max(top, out[i, ETA])
        if out[i, ETA] <= 0.0:
            continue
        z[:] = out[i, AT : AT + 4]
        if sheet:
            x, y = _sheets(z, ga, gb, r, p)
            _fill(out[i], x, sub(y, x), ga[5], reach, gain(ca, pose[5], z[1], cb, z[3])[0])
        else:
            _circle_element(out[i], z, pose)
    return top
