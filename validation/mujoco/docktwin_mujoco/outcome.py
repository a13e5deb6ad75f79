"""The outcome of a run from its telemetry, as `docs/physics-notes.md` states it."""

from __future__ import annotations

import math

from . import kernel as k


LIMITS = (
    "compression_n", "tension_n", "shear_n", "torsion_nm", "bending_nm", "depth_m", "overtravel_m",
)


def _height(side) -> float:
    petals = 0.0 if side.petals is None else side.petals.height_m + 0.5 * side.petals.thickness_m
    return max([petals + side.ring_section_radius_m, *(s.top_m() for s in side.surfaces)])


class Monitor:
    """Looks at one row a tick."""

    def __init__(self, mechanism, thrusts=()) -> None:
        self.rules, self.limits = mechanism.rules, mechanism.limits
        self.settled_rate = math.radians(self.rules["settled_rate_deg_s"])
        self.petals = max(_height(mechanism.active), _height(mechanism.passive))
        self.thrusts = thrusts
        self.first = self.last = self.settled = self.separated = self.limit = None
        self.jam_since = self.jammed = self.captured = None
        self.guided = self.touched_guided = False
        self.closest, self.offset = math.inf, 0.0
        self.latched = 0
        self.own = len(mechanism.own_latches)

    def observe(self, row, memory) -> None:
        """Takes a tick in."""
        t, rules = float(row[k.TIME]), self.rules
        x, y, z = (float(v) for v in row[k.X_RING : k.X_RING + 3])
        touching = row[k.TOUCH] > 0.0
        offset = math.hypot(y, z)
        if touching:
            self.first = t if self.first is None else self.first
            self.last = t
        if x < self.closest:
            self.closest, self.offset = x, offset
        if (touching or x <= 2.0 * self.petals) and offset <= rules["guided_radius_m"]:
            self.guided = True
            self.touched_guided |= bool(touching)
        if self.limit is None:
            self._limits(row, t)
        self.latched = int((row[k.PHASES : k.PHASES + 3] == 3.0).sum())
        caught = memory[k.CAPTURED] >= 0.0 if self.own else self.latched == 3
        if self.captured is None and caught:
            self.captured = float(memory[k.CAPTURED])
        v, w = row[k.REL_V : k.REL_V + 3], row[k.REL_W : k.REL_W + 3]
        slow = (
            math.sqrt(float(v @ v)) < rules["settled_speed_m_s"]
            and math.sqrt(float(w @ w)) < self.settled_rate
        )
        if self.captured is not None:
            self.settled = (self.settled if self.settled is not None else t) if slow else None
            return
        if self.latched > 0 or (touching and slow):
            self.jam_since = t if self.jam_since is None else self.jam_since
        else:
            self.jam_since = None
        if self.jam_since is not None and t - self.jam_since > rules["jam_time_s"]:
            self.jammed = t if self.jammed is None else self.jammed
        if v[0] > 0.0 and not touching and x > self.petals and self.first is not None:
            self.separated = t if self.separated is None else self.separated
        elif touching:
            self.separated = None

    def _limits(self, row, t) -> None:
        # Largest of all steps up to this tick.
        for name, reached in zip(LIMITS, row[k.LOADS_ROW : k.LOADS_ROW + k.N_LOADS], strict=True):
            if reached > self.limits[name]:
                self.limit = (name, float(reached), t)
                return

    def _thrust_ahead(self, t) -> bool:
        for th in self.thrusts:
            start = {"start": 0.0, "first_contact": self.first, "capture": self.captured}[th.after]
            if th.until_capture and self.captured is not None:
                continue
            if start is not None and t < start + th.delay_s + th.duration_s:
                return True
        return False

    def decided(self, t) -> bool:
        """Whether nothing can change any more."""
        over = (
            (self.settled is not None and t - self.settled > 1.0)
            or self.jammed is not None
            or self.separated is not None
        )
        return self.limit is not None or (over and not self._thrust_ahead(t))

    def judge(self, end_s):
        """Outcome, time at which it was decided, reason."""
        if self.limit is not None:
            name, reached, t = self.limit
            return "limit_exceeded", t, f"{name} reached {reached:.1f}"
        if self.captured is not None:
            return "captured", self.captured, "all latches caught"
        if self.jammed is not None:
            return "jammed", self.jammed, f"{self.latched} of {self.own or 3} latches caught, and no further"
        if self.separated is None and self.jam_since is not None:
            return "jammed", end_s, f"{self.latched} of {self.own or 3} latches caught at the end"
        if not self.guided or (self.first is not None and not self.touched_guided):
            return "missed", end_s if self.last is None else self.last, "outside the guided zone"
        if self.separated is not None and self.touched_guided:
            return "rebounded", self.separated, "separated, opening, beyond the petal height"
        if self.touched_guided:
            return "jammed", end_s, "inside the guided zone without capture at the end"
        return "missed", end_s, "no contact"
