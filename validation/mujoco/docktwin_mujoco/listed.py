"""Listed surfaces and latches with places of their own, written again from `docs/physics-notes.md`: spheres, capsules,
toruses and hollows. Extremes along a capsule are found by sampling and golden sections, not as docktwin finds them.

A hollow or torus is a line in the half-plane (x, rho), turned about X: walls between points, or one point.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from . import docking, kernel as k
from .vec import add, at3, at9, axpy, back, chain, cross, dot, matrix, mul, norm, put3, sub, transposed, turn

SAMPLES = 96
# Distances from the axis below this are rounded off.
SEAT = 2e-6
# A pair's numbers: first surface (1: the passive one), its pose (12), pieces (8 of 4), how many are walls, how many
# pieces, radii together and the second's, half length of the second and its pose (12), stiffness, friction.
TURNED, FIRST, PIECES, WALLS, COUNT, SUM, BALL, HALF, SECOND, STIFF, MU = 0, 1, 13, 61, 62, 63, 64, 65, 66, 78, 79
PAIR_SIZE = 80
MOST_PLACES, CELLS = 12, 8
# Latch, striker, gaps (approach, strike, catch), zones (across, angle), stiffness before, after, damping.
LATCH_SIZE = 14


@njit(cache=True)
def seated(rho):
    """Distance from the axis."""
    return 0.5 * (rho * rho / SEAT + SEAT) if rho < SEAT else rho


@njit(cache=True)
def apart(pair, i, p):
    """Distance of a point from piece i, and the normal toward the point."""
    a = PIECES + 6 * i
    x0, r0, x1, r1 = pair[a], pair[a + 1], pair[a + 2], pair[a + 3]
    off = math.hypot(p[1], p[2])
    rho = seated(off)
    length = (x1 - x0) ** 2 + (r1 - r0) ** 2
    t = 0.0
    if length > 0.0:
        t = min(max(((p[0] - x0) * (x1 - x0) + (rho - r0) * (r1 - r0)) / length, 0.0), 1.0)
    dx, dr = p[0] - x0 - t * (x1 - x0), rho - r0 - t * (r1 - r0)
    d = max(math.hypot(dx, dr), 1e-12)
    side = dr / d / max(off, SEAT)
    return d, (dx / d, side * p[1], side * p[2])


@njit(cache=True)
def golden(pair, i, p, d, lo, hi, sign):
    """Where the distance times `sign` is least between lo and hi."""
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    a, b = hi - ratio * (hi - lo), lo + ratio * (hi - lo)
    fa = sign * apart(pair, i, axpy(p, a, d))[0]
    fb = sign * apart(pair, i, axpy(p, b, d))[0]
    for _ in range(40):
        if fa < fb:
            hi, b, fb = b, a, fa
            a = hi - ratio * (hi - lo)
            fa = sign * apart(pair, i, axpy(p, a, d))[0]
        else:
            lo, a, fa = a, b, fb
            b = lo + ratio * (hi - lo)
            fb = sign * apart(pair, i, axpy(p, b, d))[0]
    return 0.5 * (lo + hi)


@njit(cache=True)
def along(pair, i, p, d, out):
    """Extremes of the distance from piece i along p + s d: rows (s, 1 for a minimum). Returns how many."""
    if dot(d, d) == 0.0:
        out[0, 0], out[0, 1] = 0.0, 1.0
        return 1
    f = np.empty(SAMPLES + 1)
    for j in range(SAMPLES + 1):
        f[j] = apart(pair, i, axpy(p, j / SAMPLES, d))[0]
    n = 0
    for j in range(SAMPLES + 1):
        before = f[j - 1] if j > 0 else math.inf
        after = f[j + 1] if j < SAMPLES else math.inf
        least = f[j] < before and f[j] <= after
        most = 0 < j < SAMPLES and f[j] > before and f[j] >= after
        if (least or most) and n < out.shape[0]:
            lo, hi = max(j - 1, 0) / SAMPLES, min(j + 1, SAMPLES) / SAMPLES
            out[n, 0] = golden(pair, i, p, d, lo, hi, 1.0 if least else -1.0)
            out[n, 1] = 1.0 if least else 0.0
            n += 1
    return n


@njit(cache=True)
def force_at(P, stiffness, depth):
    """Elastic force."""
    return stiffness * depth ** P[k.EXPONENT] if depth > 0.0 else 0.0


@njit(cache=True)
def pair_places(P, pair, r, p, places):
    """Elastic force and moment of a pair on its second surface in the frame of its first, deepest depth, and places that
    rub: cell, depth, force that rubs, part of a damper, point, normal. (r, p): second in first."""
    half = mul(turn(r, (1.0, 0.0, 0.0)), pair[HALF])
    start, d = sub(p, half), mul(half, 2.0)
    walls, count = int(pair[WALLS]), int(pair[COUNT])
    force, moment, deepest, n, net = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0, 0.0
    found = np.empty((8, 2))
    best = np.full(8, -1)
    of_wall = np.zeros(8)
    for i in range(count):
        before = -1
        waiting = (0.0, (0.0, 0.0, 0.0))
        seen = along(pair, i, start, d, found)
        for e in range(seen):
            x = axpy(start, found[e, 0], d)
            gap, normal = apart(pair, i, x)
            depth = pair[SUM] - gap
            least = found[e, 1] == 1.0
            place = i < walls and least
            if place:
                of_wall[i] += 1.0
            if depth <= 0.0:
                if place:
                    before = -1
                continue
            size = force_at(P, pair[STIFF], depth)
            # Places of walls and what edges take off twice are added; saddles and edges are taken off.
            sign = 1.0 if (i < walls) == least else -1.0
            point = axpy(x, -(pair[BALL] - 0.5 * depth), normal)
            f = mul(normal, sign * size)
            force, moment = add(force, f), add(moment, cross(point, f))
            net += sign * size * norm(normal)
            if place and n < places.shape[0]:
                deepest = max(deepest, depth)
                places[n, 0] = 8 * i + min(of_wall[i] - 1.0, 7.0)
                places[n, 1], places[n, 2], places[n, 3] = depth, size, 1.0
                put3(places[n], 4, point)
                put3(places[n], 7, normal)
                if before >= 0 and waiting[0] > 0.0:
                    share(places, before, n, waiting[0], force_at(P, pair[STIFF], waiting[0]))
                if best[i] < 0 or depth > places[best[i], 1]:
                    best[i] = n
                before = n
                n += 1
            elif i < walls:
                waiting = (depth, normal)
            elif least:
                share(places, best[i - walls], best[i - walls + 1], depth, size)
    total = 0.0
    for i in range(n):
        total += places[i, 2]
    scale = min(max(net, 0.0) / total, 1.0) if total > 0.0 else 0.0
    for i in range(n):
        places[i, 2] *= scale
        places[i, 3] *= scale
    return force, moment, deepest, n


@njit(cache=True)
def share(places, a, b, depth, size):
    """What rubs less because of a saddle or edge between two places."""
    x = max(places[a, 1] - depth, 0.0) + 1e-6 if a >= 0 else 1e-6
    y = max(places[b, 1] - depth, 0.0) + 1e-6 if b >= 0 else 1e-6
    for place, part in ((a, y / (x + y)), (b, x / (x + y))):
        if place >= 0:
            before = places[place, 2]
            places[place, 2] = max(before - size * part, 0.0)
            if before > 0.0:
                places[place, 3] *= places[place, 2] / before


@njit(cache=True)
def relative(P, qpos, qvel):
    """Attitude of the active ring, and the passive ring's pose and motion in it."""
    rc, pc = matrix(qpos[3], qpos[4], qpos[5], qpos[6]), at3(qpos, 0)
    if P[k.RIGID] != 0.0:
        rr = chain(rc, at9(P, k.MOUNT_C + 3))
        pr = add(add(pc, turn(rc, at3(P, k.MOUNT_C))), turn(rr, (P[k.OFFSET_A], 0.0, 0.0)))
        wr = turn(rc, at3(qvel, 3))
        vr = add(at3(qvel, 0), cross(wr, sub(pr, pc)))
        q, v = 7, 6
    else:
        rr, pr = matrix(qpos[10], qpos[11], qpos[12], qpos[13]), at3(qpos, 7)
        vr, wr = at3(qvel, 6), turn(rr, at3(qvel, 9))
        q, v = 14, 12
    rt, pt = matrix(qpos[q + 3], qpos[q + 4], qpos[q + 5], qpos[q + 6]), at3(qpos, q)
    wt = turn(rt, at3(qvel, v + 3))
    r4 = chain(rt, at9(P, k.MOUNT_T + 3))
    rp = chain(r4, ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)))
    pp = add(add(pt, turn(rt, at3(P, k.MOUNT_T))), turn(r4, (-P[k.OFFSET_B], 0.0, 0.0)))
    v_ab = sub(add(at3(qvel, v), cross(wt, sub(pr, pt))), vr)
    r_ab, p_ab = chain(transposed(rr), rp), back(rr, sub(pp, pr))
    return r_ab, p_ab, back(rr, v_ab), back(rr, sub(wt, wr))


@njit(cache=True)
def contacts(P, S, act, pairs, r_ab, p_ab, v_ab, w_ab, first, rates):
    """Force and moment on the passive side about the active ring's centre, in its frame, and the deepest depth."""
    force, moment, deepest, touching = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0
    places = np.empty((MOST_PLACES, 10))
    slots = S[k.SLOT : k.SLOT + 130].copy()
    bristles = act[k.BRISTLES : k.BRISTLES + 72].copy()
    if first:
        S[k.SLOT : k.SLOT + 130] = 0.0
        act[k.BRISTLES : k.BRISTLES + 72] = 0.0
    for i in range(pairs.shape[0]):
        pair = pairs[i]
        r1, p1 = at9(pair, FIRST + 3), at3(pair, FIRST)
        r2, p2 = at9(pair, SECOND + 3), at3(pair, SECOND)
        if pair[TURNED] != 0.0:
            r1, p1 = chain(r_ab, r1), add(p_ab, turn(r_ab, p1))
        else:
            r2, p2 = chain(r_ab, r2), add(p_ab, turn(r_ab, p2))
        f, m, depth, n = pair_places(P, pair, chain(transposed(r1), r2), back(r1, sub(p2, p1)), places)
        if depth > pair[SUM] - k.MEETING:
            S[k.CROSSED] = 1.0
        if n == 0:
            continue
        deepest = max(deepest, depth)
        # On the passive side, whichever of both is the second.
        sign = -1.0 if pair[TURNED] != 0.0 else 1.0
        f = mul(turn(r1, f), sign)
        force = add(force, f)
        moment = add(moment, add(mul(turn(r1, m), sign), cross(p1, f)))
        for j in range(n):
            cell = int(places[j, 0])
            key = CELLS * i + (cell // 8) + 4 * min(cell % 8, 1)
            was = int(slots[key])
            if was == 0:
                for other in range(CELLS):
                    if slots[CELLS * i + other] > 0.0:
                        was = int(slots[CELLS * i + other])
                        break
            y = at3(bristles, 3 * (was - 1)) if was > 0 else (0.0, 0.0, 0.0)
            slot = int(slots[key])
            touching += 1
            if first and touching <= k.RUBBING_PLACES:
                slot = touching
                S[k.SLOT + key] = slot
                put3(act, k.BRISTLES + 3 * (slot - 1), y)
            f, m = losses(P, pair, places[j], y, slot, r1, p1, sign, v_ab, w_ab, rates)
            force, moment = add(force, f), add(moment, m)
    return force, moment, deepest


@njit(cache=True)
def losses(P, pair, place, y, slot, r1, p1, sign, v_ab, w_ab, rates):
    """Damping and friction of one place on the passive side."""
    point = add(p1, turn(r1, at3(place, 4)))
    direction = mul(turn(r1, at3(place, 7)), sign)
    v = add(v_ab, cross(w_ab, point))
    rate = -dot(direction, v)
    rubs = place[2]
    total = 0.0
    if rubs > 0.0:
        if P[k.KELVIN_VOIGT] != 0.0:
            total = max(rubs + P[k.DAMPING] * place[3] * rate, 0.0)
        else:
            total = rubs * max(1.0 + P[k.DAMPING] * rate, 0.0)
    f = mul(direction, total - rubs)
    size = norm(direction)
    n = mul(direction, 1.0 / size) if size > 1e-9 else (1.0, 0.0, 0.0)
    slip = axpy(v, -dot(v, n), n)
    speed = norm(slip)
    y_rate = mul(axpy(slip, -speed, y), 1.0 / P[k.S_0])
    if slot > 0:
        put3(rates, 3 * (slot - 1), y_rate)
    if total * size > 0.0:
        fade = math.exp(-((speed / P[k.V_S]) ** 2))
        f = add(f, mul(axpy(y, P[k.TAU_B] * fade, y_rate), -pair[MU] * total * size))
    return f, cross(point, f)


def gap_of(latch, r_ab, p_ab):
    """Striker in the active ring's frame, gap along X, distance across it, angle between X3 and X4."""
    striker = r_ab @ latch[3:6] + p_ab
    g = striker - latch[0:3]
    x4 = -r_ab[:, 0]
    return striker, g[0], math.hypot(g[1], g[2]), math.atan2(math.hypot(x4[1], x4[2]), x4[0])


def _pairs(mech) -> np.ndarray:
    rows = []
    n = mech.law.normal.exponent
    for a in mech.active.surfaces:
        for b in mech.passive.surfaces:
            revolved = [s.kind in ("torus", "hollow") for s in (a, b)]
            if all(revolved):
                raise ValueError(f"{a.kind} on {b.kind} is not written here")
            if not any(revolved):
                raise ValueError(f"{a.kind} on {b.kind} is not written here: one must be a torus or hollow")
            turned = revolved[1]
            first, second = (b, a) if turned else (a, b)
            row = np.zeros(PAIR_SIZE)
            row[TURNED] = float(turned)
            row[FIRST : FIRST + 12] = np.r_[first.p, first.r.ravel()]
            row[SECOND : SECOND + 12] = np.r_[second.p, second.r.ravel()]
            line = first.sizes.get("profile_m") or [[0.0, first.sizes["core_radius_m"]]]
            walls = list(zip(line, line[1:])) or [(line[0], line[0])]
            pieces = walls + [(x, x) for x in line[1:-1]]
            if len(walls) > 4:
                raise ValueError(f"at most 4 walls of a hollow are written here, found {len(walls)}")
            for i, ((x0, r0), (x1, r1)) in enumerate(pieces):
                row[PIECES + 6 * i : PIECES + 6 * i + 4] = [x0, r0, x1, r1]
            row[WALLS], row[COUNT] = len(walls), len(pieces)
            row[SUM], row[BALL] = a.rounding_m + b.rounding_m, second.rounding_m
            row[HALF] = 0.5 * second.sizes.get("length_m", 0.0)
            row[STIFF] = sum(s.stiffness_n_m ** (-1.0 / n) for s in (a, b)) ** -n
            row[MU] = math.sqrt(a.friction * b.friction)
            rows.append(row)
    if len(rows) > 16:
        raise ValueError(f"at most 16 pairs of listed surfaces are written here, found {len(rows)}")
    return np.array(rows)


def _latches(mech) -> np.ndarray:
    if len(mech.own_latches) > 3:
        raise ValueError(f"at most 3 latches are written here, found {len(mech.own_latches)}")
    return np.array([
        [*t["latch_m"], *t["striker_m"], t["approach_gap_m"], t["strike_gap_m"], t["catch_gap_m"],
         t["lateral_zone_m"], math.radians(t["angle_zone_deg"]), t["hold_stiffness_n_m"],
         t["joined_stiffness_n_m"], t["joined_damping_n_s_m"]]
        for t in mech.own_latches
    ]).reshape(-1, LATCH_SIZE)


class ListedDocking(docking.FullDocking):
    """A docking of listed surfaces. Python runs at every stage."""

    def __init__(self, scene, step_s: float = 2e-4, tick_s: float = 1e-3) -> None:
        super().__init__(scene, step_s, tick_s)
        mech = scene.mechanism
        self.pairs, self.latches = _pairs(mech), _latches(mech)
        names = [t["name"] for t in mech.own_latches]
        words = mech.captured_when
        self.needed = None if words in ("all", "any") else [
            names.index(n.strip()) for n in words.split(",")
        ]
        self.any = words == "any"
        self.callback = self._kept = self._stage

    def _is_captured(self, caught) -> bool:
        if self.needed is not None:
            return all(caught[i] for i in self.needed)
        return any(caught) if self.any else len(caught) > 0 and all(caught)

    def _stage(self, _model, d) -> None:
        P, S = self.P, self.S
        first = int(S[k.STAGE]) % 4 == 0
        time = P[k.START] + (int(S[k.STAGE]) // 4) * P[k.STEP]
        r_ab, p_ab, v_ab, w_ab = relative(P, d.qpos, d.qvel)
        rates = np.zeros(72)
        force, moment, depth = contacts(
            P, S, d.act, self.pairs, r_ab, p_ab, v_ab, w_ab, first, rates
        )
        P[k.GIVEN_CONTACT : k.GIVEN_CONTACT + 3] = force
        f, m = np.array(force), np.array(moment)
        R, p, v, w = np.array(r_ab), np.array(p_ab), np.array(v_ab), np.array(w_ab)
        for i, latch in enumerate(self.latches):
            striker, gap, _, _ = gap_of(latch, R, p)
            pull = self._force(i, latch, striker, gap, v + np.cross(w, striker))
            P[k.GIVEN_LATCH + 3 * i : k.GIVEN_LATCH + 3 * i + 3] = pull
            P[k.GIVEN_GAP + i] = gap
            f, m = f + pull, m + np.cross(striker, pull)
        P[k.GIVEN_FORCE : k.GIVEN_FORCE + 3], P[k.GIVEN_MOMENT : k.GIVEN_MOMENT + 3] = f, m
        P[k.GIVEN_DEPTH] = depth
        # What changes from step to step changes after the forces of the step's beginning.
        if first:
            self._advance(R, p, v, w, time)
        k.scene(P, S, self.T, d.qpos, d.qvel, d.act, d.ctrl, d.qfrc_passive,
                np.empty((0, 1, k.ELEMENT)))
        d.ctrl[k.BRISTLES : k.BRISTLES + 72] = rates

    def _force(self, i, latch, striker, gap, rate):
        """Of a latch on the target, in the active ring's frame."""
        S = self.S
        if S[k.HELD + i] != 0.0:
            stretch = striker - S[k.ANCHOR + 3 * i : k.ANCHOR + 3 * i + 3]
            return S[k.PRELOAD + 3 * i : k.PRELOAD + 3 * i + 3] - latch[12] * stretch - latch[13] * rate
        if S[k.PHASE + i] == 3.0:
            return np.array([-latch[11] * max(gap - latch[8], 0.0), 0.0, 0.0])
        return np.zeros(3)

    def _advance(self, R, p, v, w, time) -> None:
        S = self.S
        for i, latch in enumerate(self.latches):
            _, gap, across, angle = gap_of(latch, R, p)
            reached = 0.0
            for phase, most, widen in ((1, latch[6], 4.0), (2, latch[7], 1.0), (3, latch[8], 1.0)):
                if gap <= most and across <= widen * latch[9] and angle <= widen * latch[10]:
                    reached = float(phase)
            for j in range(3):
                at = k.TIMES + 3 * i + j
                if reached >= j + 1 and S[at] < 0.0:
                    S[at] = time
            if S[k.PHASE + i] != 3.0:
                S[k.PHASE + i] = reached
        caught = [S[k.PHASE + i] == 3.0 for i in range(len(self.latches))]
        if S[k.CAPTURED] < 0.0 and self._is_captured(caught):
            S[k.CAPTURED] = time
        if S[k.CAPTURED] < 0.0:
            return
        for i, latch in enumerate(self.latches):
            if not caught[i] or S[k.HELD + i] != 0.0:
                continue
            striker, gap, _, _ = gap_of(latch, R, p)
            rate = v + np.cross(w, striker)
            S[k.PRELOAD + 3 * i : k.PRELOAD + 3 * i + 3] = (
                self._force(i, latch, striker, gap, rate) + latch[13] * rate
            )
            S[k.ANCHOR + 3 * i : k.ANCHOR + 3 * i + 3] = striker
            S[k.HELD + i] = 1.0


def engine(scene):
    """What runs a scene: this, for a mechanism of listed surfaces."""
    m = scene.mechanism
    listed = m.active.surfaces or m.passive.surfaces or m.own_latches
    return ListedDocking if listed else docking.FullDocking
