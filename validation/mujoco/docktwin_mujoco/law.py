"""Parameters of the contact law, and friction of one place for tests without a mechanism."""

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


@dataclass(frozen=True)
class KelvinVoigt:
    """F = k d + c d' while the surfaces overlap, never negative."""

    stiffness: float
    damping_n_s_m: float = 0.0
    exponent: float = 1.0


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
    """Normal law, friction, and the width of the smooth extremes around a ring."""

    normal: HuntCrossley | KelvinVoigt
    friction: Friction | None = None
    merge_depth_m: float = 5e-5
