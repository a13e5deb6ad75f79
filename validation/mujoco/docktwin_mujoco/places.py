"""Where surfaces touch and what a pair of them stores: the law of `docs/physics-notes.md`, with the
intervals that it is stated for, in compiled code.

A *sample* is the deepest point of one interval of a pair's family. Rows of sample arrays: position in
the family, depth, point (3), normal from active to passive (3), stiffness, direction in which it
falls (3, -d ln k/dx, 1/m). All in the active ring's frame.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .vec import add, at3, axpy, chain, cross, dot, mul, norm, put3, sub, transposed, turn, back

SAMPLE, PLACE = 12, 18
# Columns of a place.
AT, DEPTH, POINT, DIR, COUPLE, ELASTIC, RUBS, SLIDE, SPREAD, ENERGY = 0, 1, 2, 5, 8, 11, 12, 13, 16, 17
TAU = 2.0 * math.pi
FAINT = 23.0
# Pieces into which a ruling is divided where two petals touch.
PIECES = 5
# Looks per interval before the deepest point is closed in on.
LOOKS = 4


# -- cores -----------------------------------------------------------------------------------------
# A petal is (base radius, tip radius, height, base half-angle, tip half-angle, ball radius, EI,
# azimuth, length of a ruling).


@njit(cache=True)
def ruling(g, u):
    """Foot and vector of the ruling u in [-1, 1], in its ring's frame."""
    a, b = g[7] + u * g[3], g[7] + u * g[4]
    foot = (0.0, g[0] * math.cos(a), g[0] * math.sin(a))
    tip = (g[2], g[1] * math.cos(b), g[1] * math.sin(b))
    return foot, sub(tip, foot)


@njit(cache=True)
def petal_ball(g):
    """Radius about the middle of the middle ruling that holds the whole sheet."""
    foot, t = ruling(g, 0.0)
    mid = axpy(foot, 0.5, t)
    foot, t = ruling(g, 1.0)
    return max(norm(sub(foot, mid)), norm(sub(add(foot, t), mid)), 0.5 * g[8])


@njit(cache=True)
def to_circle(p, radius):
    """Squared distance of a point from the circle about X."""
    rho = math.hypot(p[1], p[2])
    return (rho - radius) * (rho - radius) + p[0] * p[0]


@njit(cache=True)
def on_circle(p, radius):
    """Point of the circle about X nearest to p."""
    s = radius / math.hypot(p[1], p[2])
    return (0.0, p[1] * s, p[2] * s)


@njit(cache=True)
def line_to_circle(foot, t, radius):
    """Fraction 0..1 of a line's point nearest to the circle: best of five looks, then Newton held
    between its neighbours."""
    w, best = 0.0, 1e300
    for i in range(5):
        f = to_circle(axpy(foot, 0.25 * i, t), radius)
        if f < best:
            w, best = 0.25 * i, f
    lo, hi = max(w - 0.25, 0.0), min(w + 0.25, 1.0)
    tyz = t[1] * t[1] + t[2] * t[2]
    for _ in range(40):
        p = axpy(foot, w, t)
        rho = math.hypot(p[1], p[2])
        along = (p[1] * t[1] + p[2] * t[2]) / rho
        slope = (rho - radius) * along + p[0] * t[0]
        if slope < 0.0:
            lo = w
        else:
            hi = w
        curve = along * along + (rho - radius) * (tyz - along * along) / rho + t[0] * t[0]
        new = w - slope / curve if curve > 0.0 else 0.5 * (lo + hi)
        if not (lo <= new <= hi):
            new = 0.5 * (lo + hi)
        done = abs(new - w) < 1e-9
        w = new
        if done:
            break
    return w


@njit(cache=True)
def line_to_line(p, d, q, e):
    """Fractions of the nearest points of two pieces of lines, p + s d and q + t e."""
    r = sub(p, q)
    a, b, c = dot(d, d), dot(d, e), dot(e, e)
    f, g = dot(d, r), dot(e, r)
    det = a * c - b * b
    s = min(max((b * g - c * f) / det, 0.0), 1.0) if det > 1e-14 * a * c else 0.5
    t = (b * s + g) / c
    if t < 0.0:
        t = 0.0
        s = min(max(-f / a, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((b - f) / a, 0.0), 1.0)
    return s, t


@njit(cache=True)
def along_first(a, b):
    """How the point where two lines cross moves along the first as the second is displaced."""
    c = dot(a, b)
    return mul(axpy(a, -c, b), 1.0 / max(1.0 - c * c, 0.1))


# -- samples ---------------------------------------------------------------------------------------


@njit(cache=True)
def _ring_depth(u, ra, rb, reach, r, p):
    a = (0.0, ra * math.cos(u), ra * math.sin(u))
    return reach - math.sqrt(to_circle(back(r, sub(a, p)), rb))


@njit(cache=True)
def ring_on_ring(out, m, ra, ta, rb, tb, k, r, p, apart):
    """Samples of two rings, m intervals of the active circle's azimuth. Returns the depth that is
    surely not exceeded; samples are written when that is above -apart."""
    reach = ta + tb
    bound = reach + rb * math.sqrt(max(1.0 - r[0][0] * r[0][0], 0.0)) - abs(p[0])
    if bound < -apart:
        return bound
    width = TAU / m
    n = m * LOOKS
    top = -1e300
    d = np.empty(n)
    for i in range(n):
        d[i] = _ring_depth(i * width / LOOKS, ra, rb, reach, r, p)
        top = max(top, d[i])
    bound = top + 0.5 * ra * width / LOOKS
    if bound < -apart:
        return bound
    for i in range(m):
        best, u = -1e300, 0.0
        for j in range(LOOKS + 1):
            x = d[(i * LOOKS + j) % n]
            if x > best:
                best, u = x, (i + j / LOOKS) * width
        if best > top - 2e-3 or best > -1e-3:
            u = _close_in_ring(u, i * width, (i + 1) * width, width / LOOKS, ra, rb, reach, r, p)
        a = (0.0, ra * math.cos(u), ra * math.sin(u))
        b = add(turn(r, on_circle(back(r, sub(a, p)), rb)), p)
        gap = sub(b, a)
        dist = norm(gap)
        normal = mul(gap, 1.0 / dist)
        depth = reach - dist
        out[i, 0] = u
        out[i, 1] = depth
        put3(out[i], 2, axpy(a, ta - 0.5 * depth, normal))
        put3(out[i], 5, normal)
        out[i, 8] = k
        put3(out[i], 9, (0.0, 0.0, 0.0))
    return bound


@njit(cache=True)
def _peak(l, m, r):
    """Where between -1 and 1 the parabola through three depths is highest."""
    c = r - 2.0 * m + l
    if c < 0.0:
        return min(max(0.5 * (l - r) / c, -1.0), 1.0)
    return 1.0 if r > l else -1.0


@njit(cache=True)
def _close_in_ring(u, lo, hi, h, ra, rb, reach, r, p):
    """Three parabolas, each ten times narrower than the one before."""
    best = _ring_depth(u, ra, rb, reach, r, p)
    for _ in range(3):
        a, b = max(u - h, lo), min(u + h, hi)
        mid = 0.5 * (a + b)
        w = 0.5 * (b - a)
        t = mid + w * _peak(
            _ring_depth(a, ra, rb, reach, r, p),
            _ring_depth(mid, ra, rb, reach, r, p),
            _ring_depth(b, ra, rb, reach, r, p),
        )
        x = _ring_depth(t, ra, rb, reach, r, p)
        if x > best:
            best, u = x, t
        h *= 0.15
    return u


@njit(cache=True)
def _ruling_depth(u, g, radius, reach, r, p):
    """Depth of a ruling against the circle of the frame posed by (r, p) in the petal's frame."""
    foot, t = ruling(g, u)
    foot, t = back(r, sub(foot, p)), back(r, t)
    w = line_to_circle(foot, t, radius)
    return reach - math.sqrt(to_circle(axpy(foot, w, t), radius))


@njit(cache=True)
def petal_on_ring(out, m, g, radius, tube, kc, r, p, apart):
    """Samples of a petal and a ring posed by (r, p) in the petal's ring frame; m intervals across
    the rulings. In the petal's frame, normals from petal to ring."""
    reach = g[5] + tube
    foot, t = ruling(g, 0.0)
    ball = petal_ball(g)
    mid = back(r, sub(axpy(foot, 0.5, t), p))
    bound = reach + ball - math.sqrt(to_circle(mid, radius))
    if bound < -apart:
        return bound
    width = 2.0 / m
    n = m * LOOKS + 1
    d = np.empty(n)
    top = -1e300
    for i in range(n):
        d[i] = _ruling_depth(-1.0 + i * width / LOOKS, g, radius, reach, r, p)
        top = max(top, d[i])
    bound = top + 0.5 * width / LOOKS * max(abs(g[0]) * g[3], abs(g[1]) * g[4])
    if bound < -apart:
        return bound
    for i in range(m):
        best, u = -1e300, 0.0
        for j in range(LOOKS + 1):
            if d[i * LOOKS + j] > best:
                best, u = d[i * LOOKS + j], -1.0 + (i + j / LOOKS) * width
        lo, hi, h = -1.0 + i * width, -1.0 + (i + 1) * width, width / LOOKS
        if best > top - 2e-3 or best > -1e-3:
            for _ in range(3):
                a, b = max(u - h, lo), min(u + h, hi)
                c, w2 = 0.5 * (a + b), 0.5 * (b - a)
                x = c + w2 * _peak(
                    _ruling_depth(a, g, radius, reach, r, p),
                    _ruling_depth(c, g, radius, reach, r, p),
                    _ruling_depth(b, g, radius, reach, r, p),
                )
                f = _ruling_depth(x, g, radius, reach, r, p)
                if f > best:
                    best, u = f, x
                h *= 0.15
        foot, t = ruling(g, u)
        local, lt = back(r, sub(foot, p)), back(r, t)
        w = line_to_circle(local, lt, radius)
        q_local = on_circle(axpy(local, w, lt), radius)
        tangent = turn(r, (0.0, -q_local[2] / radius, q_local[1] / radius))
        x, q = axpy(foot, w, t), add(turn(r, q_local), p)
        gap = sub(q, x)
        dist = norm(gap)
        normal = mul(gap, 1.0 / dist)
        depth = reach - dist
        s = w * g[8]
        k = 1.0 / (1.0 / kc + s * s * s / (3.0 * g[6]))
        out[i, 0] = u
        out[i, 1] = depth
        put3(out[i], 2, axpy(x, g[5] - 0.5 * depth, normal))
        put3(out[i], 5, normal)
        out[i, 8] = k
        soft = (0.0, 0.0, 0.0)
        if 0.0 < w < 1.0:
            soft = mul(along_first(mul(t, 1.0 / norm(t)), tangent), k * s * s / g[6])
        put3(out[i], 9, soft)
    return bound


@njit(cache=True)
def _pair_depth(u, v, ga, gb, r, p):
    fa, ta = ruling(ga, u)
    fb, tb = ruling(gb, v)
    fb, tb = add(turn(r, fb), p), turn(r, tb)
    s, t = line_to_line(fa, ta, fb, tb)
    return ga[5] + gb[5] - norm(sub(axpy(fb, t, tb), axpy(fa, s, ta)))


@njit(cache=True)
def _climb(u, v, lo, hi, h, ga, gb, r, p):
    """Deepest pair of rulings near (u, v), the first held between lo and hi."""
    best = _pair_depth(u, v, ga, gb, r, p)
    while h > 1e-5:
        bu, bv, moved = u, v, False
        for a in range(-1, 2):
            for b in range(-1, 2):
                x = min(max(u + a * h, lo), hi)
                y = min(max(v + b * h, -1.0), 1.0)
                if x == u and y == v:
                    continue
                f = _pair_depth(x, y, ga, gb, r, p)
                if f > best + 1e-12:
                    best, bu, bv, moved = f, x, y, True
        u, v = bu, bv
        if not moved:
            h *= 0.3
    return best, u, v


@njit(cache=True)
def petal_on_petal(out, ga, gb, kc, eps, r, p, apart, known, warm):
    """Samples of two petals: the deepest pair of rulings with the active one in either half of its
    petal, the active ruling cut in PIECES. `warm` keeps the rulings found; with `known` the search
    starts from them. Returns the bound and the number of samples."""
    fa, ta = ruling(ga, 0.0)
    fb, tb = ruling(gb, 0.0)
    ma, mb = axpy(fa, 0.5, ta), add(turn(r, axpy(fb, 0.5, tb)), p)
    ball = petal_ball(ga) + petal_ball(gb)
    bound = ga[5] + gb[5] + ball - norm(sub(mb, ma))
    if bound < -apart:
        return bound, 0
    # Table of both petals' rulings, nine each.
    n = 9
    h0 = 2.0 / (n - 1)
    best2, us, vs = np.empty(2), np.empty(2), np.empty(2)
    if known:
        for half in range(2):
            lo, hi = (-1.0, 0.0) if half == 0 else (0.0, 1.0)
            best2[half], us[half], vs[half] = _climb(
                warm[2 * half], warm[2 * half + 1], lo, hi, 4e-3, ga, gb, r, p
            )
            warm[2 * half], warm[2 * half + 1] = us[half], vs[half]
    else:
        table = np.empty((n, n))
        top = -1e300
        for i in range(n):
            fa, ta = ruling(ga, -1.0 + i * h0)
            for j in range(n):
                fb, tb = ruling(gb, -1.0 + j * h0)
                fb, tb = add(turn(r, fb), p), turn(r, tb)
                s, t = line_to_line(fa, ta, fb, tb)
                table[i, j] = ga[5] + gb[5] - norm(sub(axpy(fb, t, tb), axpy(fa, s, ta)))
                top = max(top, table[i, j])
        cover = 0.5 * h0 * (
            max(abs(ga[0]) * ga[3], abs(ga[1]) * ga[4]) + max(abs(gb[0]) * gb[3], abs(gb[1]) * gb[4])
        )
        bound = top + cover
        if bound < -apart:
            return bound, 0
        for half in range(2):
            first, last = (0, n // 2) if half == 0 else (n // 2, n - 1)
            lo, hi = -1.0 + first * h0, -1.0 + last * h0
            best, u, v = -1e300, 0.0, 0.0
            for i in range(first, last + 1):
                for j in range(n):
                    if table[i, j] > best:
                        best, u, v = table[i, j], -1.0 + i * h0, -1.0 + j * h0
            best2[half], us[half], vs[half] = _climb(u, v, lo, hi, 0.5 * h0, ga, gb, r, p)
            warm[2 * half], warm[2 * half + 1] = us[half], vs[half]
    count = 0
    top = max(best2[0], best2[1])
    for half in range(2):
        if best2[half] < top - 40.0 * eps:
            continue
        u, v = us[half], vs[half]
        fa, ta = ruling(ga, u)
        fb, tb = ruling(gb, v)
        fb, tb = add(turn(r, fb), p), turn(r, tb)
        ua, ub = mul(ta, 1.0 / norm(ta)), mul(tb, 1.0 / norm(tb))
        for i in range(PIECES):
            foot, t = axpy(fa, i / PIECES, ta), mul(ta, 1.0 / PIECES)
            s, w = line_to_line(foot, t, fb, tb)
            x, q = axpy(foot, s, t), axpy(fb, w, tb)
            gap = sub(q, x)
            dist = max(norm(gap), 1e-12)
            normal = mul(gap, 1.0 / dist)
            depth = ga[5] + gb[5] - dist
            fraction = (i + s) / PIECES
            sa, sb = fraction * ga[8], w * gb[8]
            k = 1.0 / (1.0 / kc + sa * sa * sa / (3.0 * ga[6]) + sb * sb * sb / (3.0 * gb[6]))
            soft = (0.0, 0.0, 0.0)
            if 0.0 < fraction < 1.0:
                soft = axpy(soft, k * sa * sa / ga[6], along_first(ua, ub))
            if 0.0 < w < 1.0:
                soft = axpy(soft, -k * sb * sb / gb[6], along_first(ub, ua))
            row = out[count]
            row[0], row[1] = u, depth
            put3(row, 2, axpy(x, ga[5] - 0.5 * depth, normal))
            put3(row, 5, normal)
            row[8] = k
            put3(row, 9, soft)
            count += 1
    return bound, count


@njit(cache=True)
def to_active(out, m, r, p):
    """Samples of a passive petal, measured petal first in its own frame, as seen from the active
    ring: (r, p) poses the passive frame in the active one, normals turn round."""
    for i in range(m):
        row = out[i]
        put3(row, 2, add(turn(r, at3(row, 2)), p))
        put3(row, 5, mul(turn(r, at3(row, 5)), -1.0))
        put3(row, 9, mul(turn(r, at3(row, 9)), -1.0))


# -- merging ---------------------------------------------------------------------------------------


@njit(cache=True)
def elastic(exponent, k, d):
    """Force of the stored energy, N."""
    if d <= 0.0:
        return 0.0
    return k * d if exponent == 1.0 else k * d**exponent


@njit(cache=True)
def energy(exponent, k, d):
    """Stored energy, J."""
    return elastic(exponent, k, d) * d / (exponent + 1.0) if d > 0.0 else 0.0


@njit(cache=True)
def soft(samples, n, side, want, eps, row):
    """Soft maximum of the samples with side == want into `row`; (depth, stiffness)."""
    top = -1e300
    for i in range(n):
        if side[i] == want or want < 0:
            top = max(top, samples[i, 1])
    if top == -1e300:
        return top, 0.0
    total = k = c2 = 0.0
    zero = (0.0, 0.0, 0.0)
    point, direction, torque, slide = zero, zero, zero, zero
    best = -1e300
    for i in range(n):
        if not (side[i] == want or want < 0):
            continue
        x = (samples[i, 1] - top) / eps
        if x < -FAINT:
            continue
        w = math.exp(x)
        c, nrm = at3(samples[i], 2), at3(samples[i], 5)
        total += w
        k += w * samples[i, 8]
        point = axpy(point, w, c)
        c2 += w * dot(c, c)
        direction = axpy(direction, w, nrm)
        torque = axpy(torque, w, cross(c, nrm))
        slide = axpy(slide, w, at3(samples[i], 9))
        if samples[i, 1] > best:
            best = samples[i, 1]
            row[AT] = samples[i, 0]
    s = 1.0 / total
    point, direction = mul(point, s), mul(direction, s)
    row[DEPTH] = top + eps * math.log(total)
    put3(row, POINT, point)
    put3(row, DIR, direction)
    put3(row, COUPLE, sub(mul(torque, s), cross(point, direction)))
    put3(row, SLIDE, mul(slide, s))
    row[SPREAD] = math.sqrt(max(c2 * s - dot(point, point), 0.0))
    row[RUBS] = 1.0
    return row[DEPTH], k * s


@njit(cache=True)
def _soft_max(a, b, eps):
    """Soft maximum of two depths and its derivative by the first."""
    if b == -1e300:
        return a, 1.0
    top = max(a, b)
    ea, eb = math.exp((a - top) / eps), math.exp((b - top) / eps)
    return top + eps * math.log(ea + eb), ea / (ea + eb)


@njit(cache=True)
def _valley(samples, n, i, j):
    """Lowest sample on the way up from i to j, both left out; -1 when they are neighbours."""
    low, at = 1e300, -1
    x = (i + 1) % n
    while x != j:
        if samples[x, 1] < low:
            low, at = samples[x, 1], x
        x = (x + 1) % n
    return at


@njit(cache=True)
def _scale_slide(row, e):
    row[SLIDE] *= e
    row[SLIDE + 1] *= e
    row[SLIDE + 2] *= e


@njit(cache=True)
def merge(samples, n, closed, two, eps, exponent, out):
    """Places of one pair into `out`: rows 0 and 1 push and rub, further rows are saddles. Returns
    (depth of everything, rows that push, all rows)."""
    side = np.zeros(n, dtype=np.int64)
    depth, k = soft(samples, n, side, -1, eps, out[0])
    if depth <= 0.0:
        return depth, 0, 0
    u_all = energy(exponent, k, depth)
    f_all = elastic(exponent, k, depth)
    top = 0
    for i in range(n):
        if samples[i, 1] > samples[top, 1]:
            top = i
    # The peak that stands out most above its higher saddle, in stored energy.
    second, inner, outer, most = -1, -1, -1, 0.0
    if two:
        for j in range(n):
            d = samples[j, 1]
            if j == top or d <= 0.0:
                continue
            if (j > 0 or closed) and samples[(j - 1) % n, 1] > d:
                continue
            if (j < n - 1 or closed) and samples[(j + 1) % n, 1] > d:
                continue
            lo, hi = min(top, j), max(top, j)
            x = _valley(samples, n, lo, hi)
            y = _valley(samples, n, hi, lo) if closed else -1
            if x < 0 or (closed and y < 0):
                continue
            saddle = max(samples[x, 1], samples[y, 1] if y >= 0 else -1e300, 0.0)
            stands = d * d - saddle * saddle
            if stands > most:
                most, second, inner, outer = stands, j, x, y
    if second < 0:
        out[0, ELASTIC], out[0, ENERGY] = f_all, u_all
        _scale_slide(out[0], u_all)
        return depth, 1, 1
    lo, hi = min(top, second), max(top, second)
    for i in range(n):
        if outer < 0:
            side[i] = 1 if i >= inner else 0
        elif outer < lo:
            side[i] = 1 if (i >= inner or i < outer) else 0
        else:
            side[i] = 1 if inner <= i < outer else 0
    da_soft, ka = soft(samples, n, side, 0, eps, out[0])
    db_soft, kb = soft(samples, n, side, 1, eps, out[1])
    ua, ub = energy(exponent, ka, da_soft), energy(exponent, kb, db_soft)
    da, db = samples[lo, 1], samples[hi, 1]
    lower, wa = _soft_max(-da, -db, eps)
    lower = max(-lower, 1e-12)
    saddle, w_in = _soft_max(samples[inner, 1], samples[outer, 1] if outer >= 0 else -1e300, eps)
    saddle = max(saddle, 0.0)
    sigma = min(saddle / lower, 1.0)
    c = sigma * sigma
    excess = ua + ub - u_all
    pull = -2.0 * sigma * excess / lower if sigma < 1.0 else 0.0
    lift = 2.0 * c * excess / lower if sigma < 1.0 else 0.0
    sa, sb = math.exp((da_soft - depth) / eps), math.exp((db_soft - depth) / eps)
    fa = (1.0 - c) * elastic(exponent, ka, da_soft) + c * f_all * sa + lift * wa
    fb = (1.0 - c) * elastic(exponent, kb, db_soft) + c * f_all * sb + lift * (1.0 - wa)
    ga, gb = max(da - saddle, 0.0) + 1e-12, max(db - saddle, 0.0) + 1e-12
    ea, eb = (1.0 - c) * ua + c * u_all * sa, (1.0 - c) * ub + c * u_all * sb
    out[0, ELASTIC], out[0, ENERGY] = fa, ea
    out[1, ELASTIC], out[1, ENERGY] = fb, eb
    _scale_slide(out[0], ea)
    _scale_slide(out[1], eb)
    out[0, RUBS] = min(max(1.0 + pull * gb / (ga + gb) / fa, 0.0), 1.0) if fa > 0.0 else 0.0
    out[1, RUBS] = min(max(1.0 + pull * ga / (ga + gb) / fb, 0.0), 1.0) if fb > 0.0 else 0.0
    rows = 2
    for which in range(2):
        i, f = (inner, pull * w_in) if which == 0 else (outer, pull * (1.0 - w_in))
        if i < 0 or f >= 0.0:
            continue
        row = out[rows]
        row[:] = 0.0
        row[AT], row[DEPTH], row[ELASTIC] = samples[i, 0], samples[i, 1], f
        put3(row, POINT, at3(samples[i], 2))
        put3(row, DIR, at3(samples[i], 5))
        rows += 1
    return depth, 2, rows
