"""The contact law of one place, written again from its statement in the model's documentation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class HuntCrossley:
    """F = k d^n (1 + a d'), never negative."""

    stiffness: float
    exponent: float = 1.0
    damping_s_m: float = 0.0

    def elastic(self, k: float, depth: float) -> float:
        """Derivative of the stored energy by depth, N."""
        return k * depth**self.exponent if depth > 0.0 else 0.0

    def energy(self, k: float, depth: float) -> float:
        """Stored energy, J."""
        return k * depth ** (self.exponent + 1.0) / (self.exponent + 1.0) if depth > 0.0 else 0.0

    def total(self, elastic: float, depth_rate: float) -> float:
        """Elastic and dissipative force together, N."""
        return elastic * max(0.0, 1.0 + self.damping_s_m * depth_rate)


@dataclass(frozen=True)
class KelvinVoigt:
    """F = k d + c d' while the surfaces overlap, never negative."""

    stiffness: float
    damping_n_s_m: float = 0.0
    exponent: float = 1.0

    def elastic(self, k: float, depth: float) -> float:
        """Derivative of the stored energy by depth, N."""
        return k * max(depth, 0.0)

    def energy(self, k: float, depth: float) -> float:
        """Stored energy, J."""
        return 0.5 * k * max(depth, 0.0) ** 2

    def total(self, elastic: float, depth_rate: float) -> float:
        """Elastic and dissipative force together, N."""
        return max(0.0, elastic + self.damping_n_s_m * depth_rate) if elastic > 0.0 else 0.0


@dataclass(frozen=True)
class Friction:
    """Coulomb-Stribeck friction carried by a bristle of deflection y (in break-away lengths)."""

    kinetic: float
    static: float
    stribeck_velocity_m_s: float
    bristle_breakaway_m: float
    bristle_damping_s: float

    def coefficient(self, speed: float) -> float:
        """Friction coefficient at a sliding speed."""
        fade = math.exp(-((speed / self.stribeck_velocity_m_s) ** 2))
        return self.kinetic + (self.static - self.kinetic) * fade

    def force_and_rate(self, normal_n: float, v_t: np.ndarray, y: np.ndarray):
        """Force on the surface that slides with `v_t` over the other, and y'."""
        speed = float(np.linalg.norm(v_t))
        y_rate = (v_t - speed * y) / self.bristle_breakaway_m
        tau = self.bristle_damping_s * math.exp(-((speed / self.stribeck_velocity_m_s) ** 2))
        return -self.coefficient(speed) * normal_n * (y + tau * y_rate), y_rate


@dataclass(frozen=True)
class ContactLaw:
    """Normal law, friction and the length over which neighbouring places are one."""

    normal: HuntCrossley | KelvinVoigt
    friction: Friction | None = None
    merge_depth_m: float = 5e-5


def petal_stiffness(k: float, flexural_rigidity_n_m2: float, s):
    """Stiffness of the contact in series with a cantilever loaded at s from its base, and its
    derivative by s: 1/k(s) = 1/k + s^3/(3 EI)."""
    c = 1.0 / k + s**3 / (3.0 * flexural_rigidity_n_m2)
    return 1.0 / c, -(s**2 / flexural_rigidity_n_m2) / c**2
