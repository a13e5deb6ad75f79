"""Everything that acts between chaser, ring and target, as one function that MuJoCo calls at every
stage of its Runge-Kutta steps: contact, attenuator, latches, joined rings, thrusts.

Compiled by numba to a C function and installed as MuJoCo's passive-force callback, so that a run is
one call of `mj_step(nstep)` and no Python runs in between. What the mechanism remembers in continuous
time (bristles, brake slip, impulse) are activation states, integrated by MuJoCo beside the bodies;
what it remembers from step to step (latches, joint, which cell holds which bristle) stands in `S` and
changes at the first stage of a step only.

`P` parameters, `S` memory, `T` telemetry rows. Their addresses, and those of MuJoCo's arrays, stand
in `mjData.userdata`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import cfunc, njit, types

from .cells import (
    COUPLE, DAMPS, DEEP, DIR, FORCE as FORCE_OF, PLACE, PLACES as MOST_PLACES, POINT_OF, RUBS, SPREAD,
    TOUCHES, neighbours, pair_load,
)
from .places import ELEMENT, MOST_ELEMENTS, petal_elements, ring_on_ring
from .raw import pointer, pointer_f
from .vec import (
    add, at3, at9, axpy, back, chain, cross, dot, matrix, mul, norm, put3, rotation_vector, solve3,
    sub, transposed, turn,
)

# -- parameters --------------------------------------------------------------------------------
RIGID, PETALS_A, PETALS_B, RING_A, TUBE_A, RING_B, TUBE_B = range(7)
PETAL_A, PETAL_B = 10, 20  # base, tip, height, base half, tip half, ball, EI, azimuth, length
KELVIN_VOIGT, STIFFNESS, EXPONENT, DAMPING, MU_K, MU_S, V_S, S_0, TAU_B, MERGE, RUBBING = range(30, 41)
MOUNT_C, OFFSET_A, MOUNT_T, OFFSET_B, RING_COM = 50, 62, 63, 75, 76
LATCHES, AZIMUTH, APPROACH, STRIKE, CATCH, RADIAL, TANGENTIAL, HOLD, JOINED_K, JOINED_C = (
    100, 101, 104, 105, 106, 107, 108, 109, 110, 111
)
ATTENUATION, RAMP, CHANNEL, CHANNEL_SIZE = 120, 121, 130, 60
N_UP, UP, N_DOWN, DOWN, BRANCH, C_BEFORE, C_AFTER, DRY, TRAVEL_N, TRAVEL_P, STOP_K, STOP_C, BRAKE, (
    BRAKE_FORCE), BRAKE_VISCOUS = 0, 1, 17, 18, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 44
BASE_JOINTS, RING_JOINTS, COUPLING = 500, 520, 540
THRUSTS, THRUST, THRUST_SIZE, MOST_THRUSTS = 599, 600, 12, 8
STEP, START, EVERY, CONTACT_OFF = 700, 701, 702, 703
# With CONTACT_OFF what acts between the sides comes from outside, at every stage, in the active ring's frame: force of
# the contacts, force and moment of everything, depth, forces and gaps of three latches.
GIVEN_CONTACT, GIVEN_FORCE, GIVEN_MOMENT, GIVEN_DEPTH, GIVEN_LATCH, GIVEN_GAP = 704, 707, 710, 713, 714, 723
# 1.0: latches measure and pull in the axes of the passive ring.
PASSIVE_AXES = 732
P_SIZE = 740

# -- memory ------------------------------------------------------------------------------------
STAGE, FIRST, CAPTURED, PEAK_F, PEAK_M, PEAK_D, ROWS, TOUCHING, FORCE, CROSSED = range(10)
PHASE, TIMES, ANCHOR, PRELOAD = 10, 13, 30, 39
# Of every cell the number of its bristle, counted from 1; how far a pair was apart and at which pose.
SLOT, CLEAR, CONTROL = 50, 180, 390
PLACES = 402
# Largest so far of what limits are about, in the order of `outcome.LIMITS`.
LOADS, N_LOADS = 404, 7
# Whether a latch with a place of its own holds its striker.
HELD = 411
S_SIZE = 416
PAIRS = 16
CLEAR_SIZE = 13
# Cores nearer to each other than this are said to meet: their normal is no longer to be believed, m.
MEETING = 1e-4

# Places for the record: pair, point, normal force on the passive side, friction, depth; for this side's
# own tests also the cell, the normal force that rubs, spread, mean normal, bristle and its number.
# As many as docktwin records: a jam has 13 and more.
SHOWN_SIZE, MOST_SHOWN = 11, 32
OF_CELL, OF_NORMAL, OF_SPREAD, OF_DIR, OF_BRISTLE, OF_SLOT, RECORD = 11, 12, 13, 14, 17, 20, 21
# As many places rub and damp at a time, and each has a bristle.
RUBBING_PLACES = 24

# -- activation states -------------------------------------------------------------------------
BRISTLES, SLIP_DRY, IMPULSE, STATES = 0, 72, 84, 88

# Break-away of dry friction in the attenuator, depth over which a stop's damping sets in; m or rad.
DRY_BREAKAWAY, STOP_ENGAGEMENT = 2e-4, 1e-3

# -- columns of a telemetry row ------------------------------------------------------------------
TIME, BODIES, REL_V, REL_W, X_RING, TOUCH, INTERFACE, DEPTH_NOW, DEPTH_PEAK, OVERTRAVEL = (
    0, 1, 40, 43, 46, 49, 50, 56, 57, 58
)
DEFLECTION, PSI, PORT3, PORT4, CONTACT, PHASES, GAPS, N_PLACES, FORCE_NOW, CONTROLS = (
    59, 62, 65, 71, 77, 80, 83, 86, 87, 88
)
LATCH_FORCE, N_SHOWN, SHOWN_ROW = 100, 109, 110
LOADS_ROW = 110 + SHOWN_SIZE * MOST_SHOWN
ROW = LOADS_ROW + N_LOADS


@njit(cache=True)
def petal_at(P, first, i, count):
    """Numbers of petal i of a side."""
    return (
        P[first], P[first + 1], P[first + 2], P[first + 3], P[first + 4], P[first + 5], P[first + 6],
        P[first + 7] + i * 2.0 * math.pi / max(count, 1.0), P[first + 8],
    )


@njit(cache=True)
def circle(radius, tube):
    """A ring as numbers of the form in which petals come."""
    return (radius, 0.0, 0.0, 0.0, 0.0, tube, 1.0, 0.0, 0.0)


@njit(cache=True)
def is_there(P, pair):
    """Whether the sides have this pair of surfaces."""
    n_a, n_b = int(P[PETALS_A]), int(P[PETALS_B])
    if pair == 0:
        return True
    if pair <= 3:
        return pair - 1 < n_a
    if pair <= 6:
        return pair - 4 < n_b
    return (pair - 7) // 3 < n_a and (pair - 7) % 3 < n_b


@njit(cache=True)
def measure(P, pair, r, p, elements):
    """Depths of a pair's elements, in the frame of the ring whose surface is divided. Returns the largest,
    or what it is surely not above; below zero it is how far the pair is apart."""
    kc, n = P[STIFFNESS], P[EXPONENT]
    n_a, n_b = int(P[PETALS_A]), int(P[PETALS_B])
    if pair == 0:
        return ring_on_ring(elements, P[RING_A], P[TUBE_A], P[RING_B], P[TUBE_B], r, p)
    if pair <= 3:
        g = petal_at(P, PETAL_A, pair - 1, n_a)
        return petal_elements(elements, False, g, circle(P[RING_B], P[TUBE_B]), kc, n, r, p)
    if pair <= 6:
        g = petal_at(P, PETAL_B, pair - 4, n_b)
        return petal_elements(
            elements, False, g, circle(P[RING_A], P[TUBE_A]), kc, n, transposed(r), mul(back(r, p), -1.0)
        )
    ga = petal_at(P, PETAL_A, (pair - 7) // 3, n_a)
    gb = petal_at(P, PETAL_B, (pair - 7) % 3, n_b)
    return petal_elements(elements, True, ga, gb, kc, n, r, p)


@njit(cache=True)
def contact(P, S, act, rates, r, p, v_ab, w_ab, first, given, record):
    """Wrench on the passive side about the active ring's origin, in that ring's frame, of all places
    of contact. (r, p) poses the passive ring frame; `v_ab`, `w_ab` is its motion at the origin. Bristle
    rates go into `rates`, places into `record`. `given[pair]` holds elements measured by somebody else,
    with a number above zero in the first row's first column where there are any; empty: measured here.
    Returns force, moment, deepest depth, number of places that rub, stored energy."""
    elements = np.empty((MOST_ELEMENTS, ELEMENT))
    places = np.empty((MOST_PLACES, PLACE))
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    deepest, rubbing, stored, touching = 0.0, 0, 0.0, 0
    reach = P[RING_B] + P[TUBE_B]
    if P[PETALS_B] > 0.0:
        tip = math.hypot(P[PETAL_B + 2], max(abs(P[PETAL_B]), abs(P[PETAL_B + 1]))) + P[PETAL_B + 5]
        reach = max(reach, tip)
    # Bristles before this step: a cell that begins to touch takes one of them.
    slots = np.empty(PAIRS * MOST_PLACES)
    bristles = np.zeros((RUBBING_PLACES, 3))
    for i in range(PAIRS * MOST_PLACES):
        slots[i] = S[SLOT + i]
        if first:
            S[SLOT + i] = 0.0
    for i in range(RUBBING_PLACES):
        put3(bristles[i], 0, at3(act, BRISTLES + 3 * i))
        if first:
            put3(act, BRISTLES + 3 * i, (0.0, 0.0, 0.0))
    for pair in range(PAIRS):
        if not is_there(P, pair):
            continue
        if given.shape[0] > 0:
            if given[pair, 0, 0] <= 0.0:
                continue
            elements[:] = given[pair, 1:]
        else:
            # The pair is not looked at while the sides have moved less than it was apart.
            c = CLEAR + pair * CLEAR_SIZE
            if S[c] > 0.0:
                moved = norm(sub(p, at3(S, c + 1)))
                was = at9(S, c + 4)
                turned = 0.0
                for i in range(3):
                    for j in range(3):
                        turned += (r[i][j] - was[i][j]) ** 2
                if moved + math.sqrt(turned) * reach < S[c]:
                    continue
            top = measure(P, pair, r, p, elements)
            S[c] = 0.0
            if top <= 0.0:
                S[c] = -top
                put3(S, c + 1, p)
                for i in range(3):
                    put3(S, c + 4 + 3 * i, r[i])
                continue
        u, f, m, depth = pair_load(
            pair, elements, P[MERGE], P[STIFFNESS], P[EXPONENT], r, p, places
        )
        tube = P[TUBE_A] if pair == 0 or 4 <= pair <= 6 else P[PETAL_A + 5]
        tube += P[TUBE_B] if pair <= 3 else P[PETAL_B + 5]
        if depth > tube - MEETING:
            S[CROSSED] = 1.0
        stored += u
        force, moment = add(force, f), add(moment, m)
        deepest = max(deepest, depth)
        for which in range(MOST_PLACES):
            # Rows of cells one after the other, eighths as they are numbered.
            cell = which if pair == 0 else 2 * (which % 4) + which // 4
            if places[cell, TOUCHES] == 0.0:
                continue
            touching += 1
            if touching > RUBBING_PLACES:
                continue
            # The bristle of the same cell, else of a cell beside it, else a straight one.
            slot = int(slots[MOST_PLACES * pair + cell])
            from_slot = slot
            if from_slot == 0:
                for i in range(MOST_PLACES):
                    other = i if pair == 0 else 2 * (i % 4) + i // 4
                    if slots[MOST_PLACES * pair + other] > 0.0 and neighbours(pair, cell, other):
                        from_slot = int(slots[MOST_PLACES * pair + other])
                        break
            y = (0.0, 0.0, 0.0)
            if from_slot > 0:
                y = at3(bristles[from_slot - 1], 0)
            if first:
                # Numbered anew in every step.
                slot = touching
                S[SLOT + MOST_PLACES * pair + cell] = slot
                put3(act, BRISTLES + 3 * (slot - 1), y)
            f, m = apply(P, rates, places[cell], y, slot, v_ab, w_ab, pair, cell, record, rubbing)
            if places[cell, RUBS] > 0.0:
                rubbing += 1
            force, moment = add(force, f), add(moment, m)
    return force, moment, deepest, rubbing, stored


@njit(cache=True)
def apply(P, rates, place, y, slot, v_ab, w_ab, pair, cell, record, number):
    """Damping and friction of one place: force and moment on the passive side. `slot`: its bristle,
    counted from 1; none (0) for a place that began between two steps."""
    point, direction, couple = at3(place, POINT_OF), at3(place, DIR), at3(place, COUPLE)
    v = add(v_ab, cross(w_ab, point))
    rate = -(dot(direction, v) + dot(couple, w_ab))
    rubs = place[RUBS]
    total = 0.0
    if rubs > 0.0:
        if P[KELVIN_VOIGT] != 0.0:
            total = max(rubs + P[DAMPING] * place[DAMPS] * rate, 0.0)
        else:
            total = rubs * max(1.0 + P[DAMPING] * rate, 0.0)
    f, m = mul(direction, total - rubs), mul(couple, total - rubs)
    push = add(at3(place, FORCE_OF), f)
    size = norm(direction)
    normal, rubbing, spread = total * size, (0.0, 0.0, 0.0), place[SPREAD]
    n = mul(direction, 1.0 / size) if size > 1e-9 else (1.0, 0.0, 0.0)
    if P[RUBBING] != 0.0:
        slip = axpy(axpy(v, -dot(v, n), n), dot(w_ab, n) * spread, n)
        speed = norm(slip)
        y_rate = mul(axpy(slip, -speed, y), 1.0 / P[S_0])
        # Where nothing is left to rub the bristle moves on: it may be passed on to the next cell.
        if slot > 0:
            put3(rates, BRISTLES + 3 * (slot - 1), y_rate)
        if normal > 0.0:
            fade = math.exp(-((speed / P[V_S]) ** 2))
            mu = P[MU_K] + (P[MU_S] - P[MU_K]) * fade
            rub = mul(axpy(y, P[TAU_B] * fade, y_rate), -mu * normal)
            twist = dot(rub, n)
            rubbing = axpy(rub, -twist, n)
            f, m = add(f, rubbing), axpy(m, twist * spread, n)
    if rubs > 0.0 and number < record.shape[0]:
        row = record[number]
        row[0], row[10], row[OF_CELL], row[OF_NORMAL], row[OF_SPREAD] = (
            pair, place[DEEP], cell, normal, spread
        )
        put3(row, 1, point)
        put3(row, 4, push)
        put3(row, 7, rubbing)
        put3(row, OF_DIR, n)
        put3(row, OF_BRISTLE, y)
        row[OF_SLOT] = slot - 1
    return f, add(m, cross(point, f))


# -- attenuator ----------------------------------------------------------------------------------


@njit(cache=True)
def _curve(P, at, n, x):
    """Piecewise linear from its points, the last slope beyond."""
    for i in range(n - 1):
        x0, f0, x1, f1 = P[at + 2 * i], P[at + 2 * i + 1], P[at + 2 * i + 2], P[at + 2 * i + 3]
        if x <= x1 or i == n - 2:
            return f0 + (f1 - f0) / (x1 - x0) * (x - x0)
    return 0.0


@njit(cache=True)
def over_travel(P, c, x):
    """How far beyond its travel, and the direction."""
    size = norm(x)
    if size < 1e-15:
        return 0.0, (1.0, 0.0, 0.0)
    travel = P[c + TRAVEL_P]
    if x[1] == 0.0 and x[2] == 0.0 and x[0] < 0.0:
        travel = P[c + TRAVEL_N]
    return max(size - travel, 0.0), mul(x, 1.0 / size)


@njit(cache=True)
def channel(P, c, x, v, phase, slip, dry):
    """Force of one channel and the rates of its brake slip and of its dry bristle."""
    damping = P[c + C_BEFORE] + (P[c + C_AFTER] - P[c + C_BEFORE]) * phase
    e = sub(x, slip)
    size = norm(e)
    up = _curve(P, c + UP, int(P[c + N_UP]), size)
    down = _curve(P, c + DOWN, int(P[c + N_DOWN]), size)
    spring = mul(e, 0.5 * (up + down) / size) if size > 1e-15 else (0.0, 0.0, 0.0)
    pull = axpy(spring, damping, v)
    slip_rate = (0.0, 0.0, 0.0)
    f = norm(pull)
    if P[c + BRAKE] != 0.0 and f > P[c + BRAKE_FORCE]:
        slip_rate = mul(pull, (f - P[c + BRAKE_FORCE]) / (damping + P[c + BRAKE_VISCOUS]) / f)
        pull = axpy(pull, -damping, slip_rate)
    force = mul(pull, -1.0)
    branch = 0.5 * max(up - down, 0.0)
    rub = P[c + DRY] + branch
    dry_rate = (0.0, 0.0, 0.0)
    if rub > 0.0:
        s0 = P[c + BRANCH] if branch > 0.0 else DRY_BREAKAWAY
        dry_rate = mul(axpy(v, -norm(v), dry), 1.0 / s0)
        force = axpy(force, -rub, dry)
    over, unit = over_travel(P, c, x)
    if over > 0.0:
        damp = P[c + STOP_C] * dot(v, unit) * min(over / STOP_ENGAGEMENT, 1.0)
        force = axpy(force, -max(P[c + STOP_K] * over + damp, 0.0), unit)
    return force, slip_rate, dry_rate


@njit(cache=True)
def attenuator(P, act, rates, r3, p3, v, w, phase):
    """Wrench on the ring about its centre, in e3, for its pose and motion there."""
    rest = P[OFFSET_A]
    if P[ATTENUATION] == 1.0:
        d = (p3[0] - rest, p3[1], p3[2])
        psi = rotation_vector(r3)
        # psi' = w - psi x w / 2 + c psi x (psi x w)
        t2 = dot(psi, psi)
        if t2 < 1e-6:
            c = 1.0 / 12.0 + t2 / 720.0
        else:
            t = math.sqrt(t2)
            c = 1.0 / t2 - (1.0 + math.cos(t)) / (2.0 * t * math.sin(t))
        x = cross(psi, w)
        rate = axpy(axpy(w, -0.5, x), c, cross(psi, x))
        force, q = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for i in range(4):
            src, mov = (d, v) if i < 2 else (psi, rate)
            a = SLIP_DRY + (0, 2, 6, 8)[i]
            if i % 2 == 0:
                x, u = (src[0], 0.0, 0.0), (mov[0], 0.0, 0.0)
                slip, dry = (act[a], 0.0, 0.0), (act[a + 1], 0.0, 0.0)
            else:
                x, u = (0.0, src[1], src[2]), (0.0, mov[1], mov[2])
                slip, dry = (0.0, act[a], act[a + 1]), (0.0, act[a + 2], act[a + 3])
            f, ds, dy = channel(P, CHANNEL + i * CHANNEL_SIZE, x, u, phase, slip, dry)
            if i % 2 == 0:
                rates[a], rates[a + 1] = ds[0], dy[0]
            else:
                rates[a], rates[a + 1], rates[a + 2], rates[a + 3] = ds[1], ds[2], dy[1], dy[2]
            if i < 2:
                force = add(force, f)
            else:
                q = add(q, f)
        # The transposed of w -> psi'.
        x = cross(psi, q)
        return force, axpy(axpy(q, 0.5, x), c, cross(psi, x))
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    length, speed, push = np.empty(6), np.empty(6), np.zeros(6)
    for i in range(6):
        joint, foot = at3(P, RING_JOINTS + 3 * i), at3(P, BASE_JOINTS + 3 * i)
        arm = turn(r3, joint)
        leg = sub(add(p3, arm), foot)
        size = norm(leg)
        length[i] = size - norm(sub(add((rest, 0.0, 0.0), joint), foot))
        speed[i] = dot(leg, add(v, cross(w, arm))) / size
    for row in range(6):
        x = u = 0.0
        for i in range(6):
            x += P[COUPLING + 6 * row + i] * length[i]
            u += P[COUPLING + 6 * row + i] * speed[i]
        a = SLIP_DRY + 2 * row
        f, ds, dy = channel(
            P, CHANNEL + row * CHANNEL_SIZE, (x, 0.0, 0.0), (u, 0.0, 0.0), phase,
            (act[a], 0.0, 0.0), (act[a + 1], 0.0, 0.0),
        )
        rates[a], rates[a + 1] = ds[0], dy[0]
        for i in range(6):
            push[i] += P[COUPLING + 6 * row + i] * f[0]
    for i in range(6):
        arm = turn(r3, at3(P, RING_JOINTS + 3 * i))
        leg = sub(add(p3, arm), at3(P, BASE_JOINTS + 3 * i))
        f = mul(leg, push[i] / norm(leg))
        force = add(force, f)
        moment = add(moment, cross(arm, f))
    return force, moment


@njit(cache=True)
def beyond_travel(P, r3, p3):
    """Overtravel of the attenuator, m; rotations at the ring radius."""
    if P[RIGID] != 0.0:
        return 0.0
    rest, worst = P[OFFSET_A], 0.0
    if P[ATTENUATION] == 1.0:
        d, psi = (p3[0] - rest, p3[1], p3[2]), rotation_vector(r3)
        for i in range(4):
            src = d if i < 2 else psi
            x = (src[0], 0.0, 0.0) if i % 2 == 0 else (0.0, src[1], src[2])
            over = over_travel(P, CHANNEL + i * CHANNEL_SIZE, x)[0]
            worst = max(worst, over if i < 2 else over * P[RING_A])
        return worst
    length = np.empty(6)
    for i in range(6):
        joint, foot = at3(P, RING_JOINTS + 3 * i), at3(P, BASE_JOINTS + 3 * i)
        length[i] = norm(sub(add(p3, turn(r3, joint)), foot)) - norm(
            sub(add((rest, 0.0, 0.0), joint), foot)
        )
    for row in range(6):
        x = 0.0
        for i in range(6):
            x += P[COUPLING + 6 * row + i] * length[i]
        worst = max(worst, over_travel(P, CHANNEL + row * CHANNEL_SIZE, (x, 0.0, 0.0))[0])
    return worst


# -- latches ---------------------------------------------------------------------------------------


@njit(cache=True)
def striker(P, i, r, p):
    """Striker i in the active ring's frame and its gap: axial, radial, tangential, in the axes of the
    latches."""
    a = P[AZIMUTH + i]
    c, s = math.cos(a), math.sin(a)
    latch = (P[TUBE_A], P[RING_A] * c, P[RING_A] * s)
    at = add(turn(r, (P[TUBE_B], -latch[1], latch[2])), p)
    g = sub(at, latch)
    if P[PASSIVE_AXES] != 0.0:
        b = back(r, g)
        g = (-b[0], -b[1], b[2])
    return at, (g[0], g[1] * c + g[2] * s, g[2] * c - g[1] * s)


@njit(cache=True)
def pull(P, i, at, r):
    """Where latch i pulls and along what, in the active ring's frame. The energy of a pull is a function of
    the axial gap; with axes that turn with the passive ring its gradient acts at the latch, else at the
    striker."""
    if P[PASSIVE_AXES] == 0.0:
        return at, (1.0, 0.0, 0.0)
    a = P[AZIMUTH + i]
    latch = (P[TUBE_A], P[RING_A] * math.cos(a), P[RING_A] * math.sin(a))
    return latch, turn(r, (-1.0, 0.0, 0.0))


@njit(cache=True)
def _within(P, gap, axial, widen):
    return (
        gap[0] <= axial
        and abs(gap[1]) <= P[RADIAL] * widen
        and abs(gap[2]) <= P[TANGENTIAL] * widen
    )


@njit(cache=True)
def advance(P, S, i, gap, time):
    """Phase of a latch and the times at which it got there."""
    phase = 0
    if _within(P, gap, P[CATCH], 1.0):
        phase = 3
    elif _within(P, gap, P[STRIKE], 1.0):
        phase = 2
    elif _within(P, gap, P[APPROACH], 4.0):
        phase = 1
    for x in range(phase):
        if S[TIMES + 3 * i + x] < 0.0:
            S[TIMES + 3 * i + x] = time
    if S[PHASE + i] < 3.0:
        S[PHASE + i] = phase


@njit(cache=True)
def join(P, S, r, p, force, moment, v_ab, w_ab, time):
    """The rings become one by three point springs that start with the wrench of this instant."""
    points = np.empty((3, 3))
    for i in range(3):
        put3(points[i], 0, striker(P, i, r, p)[0])
    centre = mul(add(add(at3(points[0], 0), at3(points[1], 0)), at3(points[2], 0)), 1.0 / 3.0)
    about = sub(moment, cross(centre, force))
    a = np.zeros((3, 3))
    for i in range(3):
        x = sub(at3(points[i], 0), centre)
        for j in range(3):
            for k in range(3):
                a[j, k] += (dot(x, x) if j == k else 0.0) - x[j] * x[k]
    lam = solve3((at3(a[0], 0), at3(a[1], 0), at3(a[2], 0)), about)
    for i in range(3):
        x = at3(points[i], 0)
        f = add(mul(force, 1.0 / 3.0), cross(lam, sub(x, centre)))
        f = axpy(f, P[JOINED_C], add(v_ab, cross(w_ab, x)))
        put3(S, ANCHOR + 3 * i, x)
        put3(S, PRELOAD + 3 * i, f)
    S[CAPTURED] = time


# -- everything together ---------------------------------------------------------------------------


@njit(cache=True)
def act_on(qfrc, dof, r, f, m):
    """A force and a moment about a body's frame, world axes, as generalised force."""
    qfrc[dof] += f[0]
    qfrc[dof + 1] += f[1]
    qfrc[dof + 2] += f[2]
    local = back(r, m)
    qfrc[dof + 3] += local[0]
    qfrc[dof + 4] += local[1]
    qfrc[dof + 5] += local[2]


@njit(cache=True)
def thrusts(P, S, time):
    """Control wrenches of the tick that starts now, body axes."""
    S[CONTROL : CONTROL + 12] = 0.0
    for i in range(int(P[THRUSTS])):
        t = THRUST + THRUST_SIZE * i
        start = 0.0
        if P[t + 1] == 1.0:
            start = S[FIRST]
        elif P[t + 1] == 2.0:
            start = S[CAPTURED]
        if start < 0.0 or (P[t + 10] != 0.0 and S[CAPTURED] >= 0.0):
            continue
        since = time - start - P[t + 2]
        if since < 0.0 or since >= P[t + 3]:
            continue
        to = CONTROL + (0 if P[t] == 0.0 else 6)
        for j in range(6):
            S[to + j] += P[t + 4 + j]


@njit(cache=True)
def scene(P, S, T, qpos, qvel, act, rates, qfrc, given):
    """Adds all forces to `qfrc` and sets the rates of the activation states."""
    stage = int(S[STAGE])
    first = stage % 4 == 0
    S[STAGE] = stage + 1
    h = P[STEP]
    step = stage // 4
    time = P[START] + (step + (0.0, 0.5, 0.5, 1.0)[stage % 4]) * h
    rigid = P[RIGID] != 0.0
    rates[:] = 0.0
    # Frames. Bodies are posed by their own frames: chaser and target at their mass centres, the
    # ring at its centre.
    rc, pc = matrix(qpos[3], qpos[4], qpos[5], qpos[6]), at3(qpos, 0)
    vc, wc = at3(qvel, 0), turn(rc, at3(qvel, 3))
    r3, p3 = chain(rc, at9(P, MOUNT_C + 3)), add(pc, turn(rc, at3(P, MOUNT_C)))
    if rigid:
        rr, pr = r3, add(p3, turn(r3, (P[OFFSET_A], 0.0, 0.0)))
        vr, wr = add(vc, cross(wc, sub(pr, pc))), wc
        q, v = 7, 6
    else:
        rr, pr = matrix(qpos[10], qpos[11], qpos[12], qpos[13]), at3(qpos, 7)
        vr, wr = at3(qvel, 6), turn(rr, at3(qvel, 9))
        q, v = 14, 12
    rt, pt = matrix(qpos[q + 3], qpos[q + 4], qpos[q + 5], qpos[q + 6]), at3(qpos, q)
    vt, wt = at3(qvel, v), turn(rt, at3(qvel, v + 3))
    r4, p4 = chain(rt, at9(P, MOUNT_T + 3)), add(pt, turn(rt, at3(P, MOUNT_T)))
    # r4 of the ring: half a turn about Z, behind e4.
    rp = chain(r4, ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)))
    pp = add(p4, turn(r4, (-P[OFFSET_B], 0.0, 0.0)))
    r_ab, p_ab = chain(transposed(rr), rp), back(rr, sub(pp, pr))
    v_ab = back(rr, sub(add(vt, cross(wt, sub(pr, pt))), vr))
    w_ab = back(rr, sub(wt, wr))
    if first and step % int(P[EVERY]) == 0:
        thrusts(P, S, time)

    zero = (0.0, 0.0, 0.0)
    force, moment, rubbed = zero, zero, zero
    depth, count = 0.0, 0
    latch = np.zeros((3, 3))
    record = np.empty((MOST_SHOWN if first else 0, RECORD))
    captured = S[CAPTURED] >= 0.0
    joined = captured and P[CONTACT_OFF] == 0.0
    if not joined:
        if P[CONTACT_OFF] == 0.0:
            force, moment, depth, count, _ = contact(
                P, S, act, rates, r_ab, p_ab, v_ab, w_ab, first, given, record
            )
            rubbed = force
        else:
            force, moment = at3(P, GIVEN_FORCE), at3(P, GIVEN_MOMENT)
            rubbed, depth = at3(P, GIVEN_CONTACT), P[GIVEN_DEPTH]
            for i in range(3):
                put3(latch[i], 0, at3(P, GIVEN_LATCH + 3 * i))
        if P[LATCHES] != 0.0:
            caught = 0
            for i in range(3):
                at, gap = striker(P, i, r_ab, p_ab)
                if S[PHASE + i] == 3.0:
                    where, axis = pull(P, i, at, r_ab)
                    f = mul(axis, -P[HOLD] * max(gap[0] - P[CATCH], 0.0))
                    put3(latch[i], 0, f)
                    force, moment = add(force, f), add(moment, cross(where, f))
            if first:
                for i in range(3):
                    advance(P, S, i, striker(P, i, r_ab, p_ab)[1], time)
                    caught += int(S[PHASE + i] == 3.0)
                if caught == 3:
                    join(P, S, r_ab, p_ab, force, moment, v_ab, w_ab, time)
    else:
        for i in range(3):
            at, gap = striker(P, i, r_ab, p_ab)
            f = axpy(at3(S, PRELOAD + 3 * i), -P[JOINED_K] / 3.0, sub(at, at3(S, ANCHOR + 3 * i)))
            f = axpy(f, -P[JOINED_C], add(v_ab, cross(w_ab, at)))
            put3(latch[i], 0, f)
            force, moment = add(force, f), add(moment, cross(at, f))
    if first:
        size = norm(force)
        S[FORCE], S[PLACES] = size, count
        # About the passive ring's centre, as limits are judged.
        about = add(moment, cross(p_ab, mul(force, -1.0)))
        S[PEAK_F], S[PEAK_M] = max(S[PEAK_F], size), max(S[PEAK_M], norm(about))
        S[PEAK_D] = max(S[PEAK_D], depth)
        S[TOUCHING] = 1.0 if depth > 0.0 else 0.0
        if depth > 0.0 and S[FIRST] < 0.0:
            S[FIRST] = time
    put3(rates, IMPULSE, turn(rr, force))
    rates[IMPULSE + 3] = norm(force) if not captured else 0.0

    f_w, m_w = turn(rr, force), turn(rr, moment)
    act_on(qfrc, v, rt, f_w, add(m_w, cross(sub(pr, pt), f_w)))
    a_f, a_m = zero, zero
    if rigid:
        act_on(qfrc, 0, rc, mul(f_w, -1.0), mul(add(m_w, cross(sub(pr, pc), f_w)), -1.0))
    else:
        phase = 0.0
        if captured:
            phase = min(max((time - S[CAPTURED]) / max(P[RAMP], 1e-9), 0.0), 1.0)
        r_3r, p_3r = chain(transposed(r3), rr), back(r3, sub(pr, p3))
        v_3 = back(r3, sub(vr, add(vc, cross(wc, sub(pr, pc)))))
        w_3 = back(r3, sub(wr, wc))
        a_f, a_m = attenuator(P, act, rates, r_3r, p_3r, v_3, w_3, phase)
        a_f, a_m = turn(r3, a_f), turn(r3, a_m)
        act_on(qfrc, 6, rr, sub(a_f, f_w), sub(a_m, m_w))
        act_on(
            qfrc, 0, rc, mul(a_f, -1.0), mul(add(a_m, cross(sub(pr, pc), a_f)), -1.0)
        )
    if first:
        # Limits are judged in every step, by the wrench about the passive ring's centre.
        f_i, m_i = back(r4, f_w), back(r4, add(m_w, cross(sub(pr, pp), f_w)))
        over = beyond_travel(P, chain(transposed(r3), rr), back(r3, sub(pr, p3)))
        loads = (
            f_i[0], -f_i[0], norm((0.0, f_i[1], f_i[2])),
            abs(m_i[0]), norm((0.0, m_i[1], m_i[2])), depth, over,
        )
        for i in range(N_LOADS):
            S[LOADS + i] = max(S[LOADS + i], loads[i])
    fc, ft = turn(rc, at3(S, CONTROL)), turn(rt, at3(S, CONTROL + 6))
    act_on(qfrc, 0, rc, fc, turn(rc, at3(S, CONTROL + 3)))
    act_on(qfrc, v, rt, ft, turn(rt, at3(S, CONTROL + 9)))

    if first and step % int(P[EVERY]) == 0 and S[ROWS] < T.shape[0]:
        row = T[int(S[ROWS])]
        S[ROWS] += 1.0
        row[TIME] = time
        com = turn(rr, at3(P, RING_COM))
        for i in range(3):
            b = BODIES + 13 * i
            p, w_b, vel = pc, at3(qvel, 3), vc
            at = 3
            if i == 1:
                p, vel = add(pr, com), add(vr, cross(wr, com))
                w_b, at = (at3(qvel, 9), 10) if not rigid else (back(rr, wr), -1)
            elif i == 2:
                p, w_b, vel, at = pt, at3(qvel, v + 3), vt, q + 3
            put3(row, b, p)
            if at >= 0:
                for j in range(4):
                    row[b + 3 + j] = qpos[at + j]
            put3(row, b + 7, vel)
            put3(row, b + 10, w_b)
        rel_v = sub(add(vt, cross(wt, sub(pp, pt))), add(vc, cross(wc, sub(pp, pc))))
        put3(row, REL_V, back(r3, rel_v))
        put3(row, REL_W, back(r3, sub(wt, wc)))
        put3(row, X_RING, p_ab)
        row[TOUCH] = S[TOUCHING]
        put3(row, INTERFACE, back(r4, f_w))
        put3(row, INTERFACE + 3, back(r4, add(m_w, cross(sub(pr, pp), f_w))))
        row[DEPTH_NOW], row[DEPTH_PEAK] = depth, S[PEAK_D]
        for i in range(N_LOADS):
            row[LOADS_ROW + i] = S[LOADS + i]
        r_3r, p_3r = chain(transposed(r3), rr), back(r3, sub(pr, p3))
        row[OVERTRAVEL] = beyond_travel(P, r_3r, p_3r)
        put3(row, DEFLECTION, (p_3r[0] - P[OFFSET_A], p_3r[1], p_3r[2]))
        put3(row, PSI, rotation_vector(r_3r))
        on_f, on_m = (mul(f_w, -1.0), mul(m_w, -1.0)) if rigid else (mul(a_f, -1.0), mul(a_m, -1.0))
        put3(row, PORT3, back(r3, on_f))
        put3(row, PORT3 + 3, back(r3, add(on_m, cross(sub(pr, p3), on_f))))
        put3(row, PORT4, back(r4, f_w))
        put3(row, PORT4 + 3, back(r4, add(m_w, cross(sub(pr, p4), f_w))))
        put3(row, CONTACT, turn(rr, rubbed))
        for i in range(3):
            row[PHASES + i] = S[PHASE + i]
            row[GAPS + i] = P[GIVEN_GAP + i]
            if P[LATCHES] != 0.0:
                row[GAPS + i] = striker(P, i, r_ab, p_ab)[1][0]
        row[N_PLACES], row[FORCE_NOW] = count, S[FORCE]
        for i in range(12):
            row[CONTROLS + i] = S[CONTROL + i]
        for i in range(3):
            put3(row, LATCH_FORCE + 3 * i, at3(latch[i], 0))
        n = min(count, MOST_SHOWN)
        row[N_SHOWN] = n
        for i in range(n):
            a, shown = SHOWN_ROW + SHOWN_SIZE * i, record[i]
            row[a], row[a + 10] = shown[0], shown[10]
            put3(row, a + 1, add(pr, turn(rr, at3(shown, 1))))
            put3(row, a + 4, turn(rr, at3(shown, 4)))
            put3(row, a + 7, turn(rr, at3(shown, 7)))


# -- MuJoCo's view ---------------------------------------------------------------------------------

HEADER = 16


def callback(userdata_offset: int):
    """A C function for `mujoco.set_mjcb_passive`. `userdata_offset`: where in mjData the pointer
    `userdata` stands, in units of eight bytes."""
    offset = userdata_offset

    @cfunc(types.void(types.intp, types.intp), cache=True)
    def passive(_model, data):
        fields = pointer(data, offset + 1)
        user = pointer(fields[offset], HEADER)
        n_t, nq, nv = user[3], user[9], user[10]
        P = pointer_f(user[0], P_SIZE)
        S = pointer_f(user[1], S_SIZE)
        T = pointer_f(user[2], n_t * ROW).reshape((n_t, ROW))
        scene(
            P, S, T, pointer_f(user[4], nq), pointer_f(user[5], nv), pointer_f(user[6], STATES),
            pointer_f(user[7], STATES), pointer_f(user[8], nv), np.empty((0, 1, ELEMENT)),
        )

    return passive

