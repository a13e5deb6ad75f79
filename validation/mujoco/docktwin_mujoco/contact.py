"""Contact between the two sides of a mechanism for Python: what `kernel.contact` does, one pose at a
time, with all that its tests want to see. All vectors are in the active side's ring frame, about its
origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import kernel as k
from .law import ContactLaw


@dataclass
class Side:
    """Surfaces of one side in its ring frame; `petals` as in the model file, or None."""

    ring_mean_radius_m: float
    ring_section_radius_m: float
    petals: object | None = None
    has_ring: bool = True
    surfaces: tuple = ()
    """Surfaces beside ring and petals, see `listed.py`."""


@dataclass
class Place:
    """A cell of a petal or an eighth of a ring that rubs."""

    pair: str
    cell: int
    depth_m: float
    point_m: np.ndarray
    normal: np.ndarray
    normal_n: float
    """Of what rubs, damping included."""
    spread_m: float
    bristle: np.ndarray
    slot: int
    """Number of the bristle."""
    push_n: np.ndarray
    friction_n: np.ndarray


@dataclass
class Touch:
    """All contact at one pose."""

    wrench: np.ndarray
    """On the passive side: force, then moment."""
    rates: np.ndarray
    """Of the bristles."""
    depth_m: float
    energy_j: float
    places: list


def pair_name(pair: int) -> str:
    """Which surfaces a pair is of, the active one first."""
    if pair == 0:
        return "ring-ring"
    if pair <= 3:
        return f"petal{pair - 1}-ring"
    if pair <= 6:
        return f"ring-petal{pair - 4}"
    return f"petal{(pair - 7) // 3}-petal{(pair - 7) % 3}"


def frame(r, p):
    """A pose as the compiled code wants it."""
    return tuple(map(tuple, np.asarray(r, float).tolist())), tuple(np.asarray(p, float).tolist())


class Contact:
    """All pairs of two sides under one law, or those that are named."""

    bristles = k.RUBBING_PLACES

    def __init__(self, active: Side, passive: Side, law: ContactLaw, only=None) -> None:
        from .docking import surfaces

        self.P = surfaces(active, passive, law)
        self.pairs = [i for i in range(k.PAIRS) if k.is_there(self.P, i)]
        if only is not None:
            self.pairs = [i for i in self.pairs if pair_name(i) in only]
        self._given = np.zeros((0, 1, k.ELEMENT))
        if only is not None:
            self._given = np.zeros((k.PAIRS, 1 + k.MOST_ELEMENTS, k.ELEMENT))
        self.forget()

    def forget(self) -> None:
        """As if nothing had touched before."""
        self.S = np.zeros(k.S_SIZE)

    def elements(self, pair: int, r_ab, p_ab):
        """Depths of a pair's cells, borders and corners, and the largest effective one."""
        out = np.zeros((k.MOST_ELEMENTS, k.ELEMENT))
        return out, k.measure(self.P, pair, *frame(r_ab, p_ab), out)

    def clearance_m(self, r_ab, p_ab) -> float:
        """No pair is nearer than this; not above zero in contact."""
        return -max(self.elements(i, r_ab, p_ab)[1] for i in self.pairs)

    def evaluate(self, r_ab, p_ab, v_ab, w_ab, bristle, first: bool = True) -> Touch:
        """Wrench on the passive side about the origin of the active ring frame.

        `v_ab` is the velocity of the passive side's material point at that origin and `w_ab` its rate,
        both relative to the active side. `first`: the pose is that of the state itself, not of a trial
        inside a step; then `bristle` is put in order for the cells that touch now."""
        self._fill(r_ab, p_ab)
        act, rates = np.zeros(k.STATES), np.zeros(k.STATES)
        n = 3 * self.bristles
        act[:n] = np.ravel(bristle)
        record = np.zeros((k.MOST_SHOWN, k.RECORD))
        r, p = frame(r_ab, p_ab)
        force, moment, depth, count, energy = k.contact(
            self.P, self.S, act, rates, r, p, tuple(map(float, v_ab)), tuple(map(float, w_ab)), first,
            self._given, record,
        )
        if first:
            bristle[...] = act[:n].reshape(np.shape(bristle))
        places = [
            Place(
                pair_name(int(x[0])), int(x[k.OF_CELL]), x[10], x[1:4], x[k.OF_DIR : k.OF_DIR + 3],
                x[k.OF_NORMAL], x[k.OF_SPREAD], x[k.OF_BRISTLE : k.OF_BRISTLE + 3],
                int(x[k.OF_SLOT]), x[4:7], x[7:10],
            )
            for x in record[:count]
        ]
        if self.S[k.CROSSED] != 0.0:
            raise ValueError("cores meet: the pair is deeper than its radii")
        return Touch(
            np.array([*force, *moment]), rates[:n].reshape(-1, 3), depth, energy, places
        )

    def _fill(self, r_ab, p_ab) -> None:
        if len(self._given) == 0:
            return
        self._given[:, 0, 0] = 0.0
        for i in self.pairs:
            elements, top = self.elements(i, r_ab, p_ab)
            self._given[i, 1:], self._given[i, 0, 0] = elements, float(top > 0.0)
