"""Closed forms and published figures of the check cases. SI units and radians."""

from __future__ import annotations

import math

import numpy as np

# The pair of the test bodies: 8 t against 12 t.
MASS_KG = 4800.0


def hunt_crossley_restitution(d: float) -> float:
    """e of ln((1 + d) / (1 - e d)) = d (1 + e), d = a v, whatever the exponent."""
    low, high = 0.0, min(1.0, 1.0 / d)
    for _ in range(200):
        e = 0.5 * (low + high)
        if math.log1p(d) - math.log1p(-e * d) < d * (1.0 + e):
            low = e
        else:
            high = e
    return 0.5 * (low + high)


def kelvin_voigt_restitution(zeta: float) -> float:
    """e of a spring and damper that cannot pull."""
    root = math.sqrt(1.0 - zeta * zeta)
    return math.exp(-zeta * math.atan2(2.0 * zeta * root, 2.0 * zeta * zeta - 1.0) / root)


def spring(k: float, v: float):
    """Duration, depth and force of an impact on k d."""
    omega = math.sqrt(k / MASS_KG)
    return math.pi / omega, v / omega, v * math.sqrt(k * MASS_KG)


def hertz(k: float, v: float):
    """Duration, depth and force of an impact on k d^1.5."""
    depth = (5.0 * MASS_KG * v * v / (4.0 * k)) ** 0.4
    whole = 2.0 * math.sqrt(math.pi) * math.gamma(0.4) / (5.0 * math.gamma(0.9))
    return 2.0 * whole * depth / v, depth, k * depth**1.5


def roll_lost(mu: float, radius_m: float, v: float) -> float:
    """Relative roll rate that ideal friction takes in an elastic head-on impact, rad/s."""
    turn = mu * radius_m * 2.0 * MASS_KG * v
    return turn / 8e3 + turn / 12e3


def effective_mass(lever_chaser_m, lever_target_m):
    """Of the test bodies, 8 t and 12 t with 1 m of gyration, seen along the normal, kg."""
    return 1.0 / ((1.0 + lever_chaser_m**2) / 8e3 + (1.0 + lever_target_m**2) / 12e3)


def bending(petals, s):
    """Stiffness of 1e6 N/m in series with petals of EI = 16000 N m2 loaded at s, N/m."""
    return 1.0 / (1e-6 + petals * s**3 / (3.0 * 16e3))


# Port 2 m from the mass centres, rings 0.3 m and 0.1 m ahead of the ports.
TO_1, TO_2 = 2.3, 2.1


def _ring_on_flank():
    """Levers of a normal at 45 degrees through a petal at s from its base and a ring 60 mm off,
    and s. The ring's centre line is 35 mm (radii 10 and 25 mm) from that of the petal."""
    h = np.sqrt(0.5)
    ring_y = -0.06 + 0.6
    # The petal runs along (1, -1) from (0, 0.597); its normal is (1, 1).
    s = (0.597 - (ring_y - 0.035 * h)) / h
    return h * (TO_1 + s * h - (0.597 - s * h)), h * (TO_2 + 0.6), s


def oblique(case):
    """Effective mass, stiffness, and the part of the closing speed along the normal; the geometry
    held still during the contact."""
    if case == "basic_guide_guide":
        # Tips meet at y = 0.41 m; the petals are 0.187 m high and as wide.
        slant = 0.187 * np.sqrt(2.0)
        off = 0.014043 + TO_2 * np.sin(np.radians(4.0))
        return effective_mass(0.41, 0.41 - off), bending(2, slant), 1.0
    if case == "basic_guide_ring":
        lever_1, lever_2, s = _ring_on_flank()
        return effective_mass(lever_1, lever_2), bending(1, s), np.sqrt(0.5)
    off = 0.002283 + TO_2 * np.sin(np.radians(5.0))
    return effective_mass(0.6, 0.6 - off), 1e6, 1.0


# Of each oblique case: speed, gap, duration at which that stillness holds to 0.2 %.
SLOW = {
    "basic_guide_guide": (0.0025, 0.8),
    "basic_guide_ring": (0.01, 0.6),
    "basic_ring_ring": (0.01, 0.8),
}
