"""Our law on MuJoCo's collision geometry: MuJoCo finds distance, normal and point of every pair of
capsules and convex pieces, and the law makes forces of them.

Every cell, border and corner that the law is stated for is made of geoms of its own (`shapes.py`), and
the deepest contact of an element's geoms with the other surface is its depth. The largest *effective*
depth is taken among contacts of greatest depth, so the small force along the sheet (N6) is left out: it is
below a thousandth of the normal force at the depths met here.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numba import njit

from . import docking, kernel as k, shapes
from .places import (
    ARCS, CELLS, DEPTH, ELEMENT, ETA, GAIN, MOST_ELEMENTS, NORMAL, POINT, gain,
)
from .vec import axpy, back, matrix, mul, put3, sub

# Columns of the table of geoms: side (0 active, 1 passive), surface (-1 ring, else petal), element, whether
# it is a border or a corner, radius about the core, radius of the core itself.
SIDE, SURFACE, NUMBER, BORDER, RADIUS, CORE = range(6)
# Contacts are looked for this far beyond touching, m.
BEYOND = 2e-4
# Depth of what is not in contact, m.
AWAY = -1e-2


@njit(cache=True)
def elements(given, table, n, dist, pos, frame, geoms, pr, rr, p_ab, r_ab, P):
    """Fills `given` from MuJoCo's contacts; poses of the active ring and of the passive one in it."""
    for pair in range(k.PAIRS):
        given[pair, 0, 0] = 0.0
        for i in range(MOST_ELEMENTS):
            given[pair, 1 + i, ETA], given[pair, 1 + i, DEPTH] = AWAY, AWAY
    e = 1.0 / (P[k.EXPONENT] + 1.0)
    for i in range(n):
        a, b = table[geoms[i, 0]], table[geoms[i, 1]]
        sign = 1.0
        if a[SIDE] > b[SIDE]:
            a, b, sign = b, a, -1.0
        if a[SIDE] == b[SIDE]:
            continue
        sa, sb = int(a[SURFACE]), int(b[SURFACE])
        # Which of the two is divided: the petal, of two like surfaces the active one.
        turned = sa < 0 and sb >= 0
        own, other = (b, a) if turned else (a, b)
        if other[BORDER] != 0.0:
            continue
        depth = a[RADIUS] + b[RADIUS] - dist[i] - a[CORE] - b[CORE]
        normal = back(rr, mul((frame[i, 0], frame[i, 1], frame[i, 2]), sign))
        point = back(rr, sub((pos[i, 0], pos[i, 1], pos[i, 2]), pr))
        point = axpy(point, a[RADIUS] - 0.5 * depth - a[CORE] - 0.5 * dist[i], normal)
        pair, ca, cb, wa, wb = 0, 0.0, 0.0, 0.0, 0.0
        if sa >= 0:
            ca = P[k.STIFFNESS] * P[k.PETAL_A + 8] ** 3 / (3.0 * P[k.PETAL_A + 6])
            wa = _along(P, k.PETAL_A, point)
        if sb >= 0:
            cb = P[k.STIFFNESS] * P[k.PETAL_B + 8] ** 3 / (3.0 * P[k.PETAL_B + 6])
            wb = _along(P, k.PETAL_B, back(r_ab, sub(point, p_ab)))
        if sa >= 0 and sb >= 0:
            pair = 7 + 3 * sa + sb
        elif sa >= 0:
            pair = 1 + sa
        elif sb >= 0:
            pair = 4 + sb
        g = gain(ca, e, wa, cb, wb)[0]
        row = given[pair, 1 + int(own[NUMBER])]
        if depth * g <= row[ETA]:
            continue
        if turned:
            point, normal = back(r_ab, sub(point, p_ab)), mul(back(r_ab, normal), -1.0)
        row[ETA], row[DEPTH], row[GAIN] = depth * g, depth, g
        put3(row, POINT, point)
        put3(row, NORMAL, normal)
        if depth > 0.0:
            given[pair, 0, 0] = 1.0


@njit(cache=True)
def _along(P, first, x):
    """Fraction of the way of a point of a petal's ring frame from the root, along the slope."""
    h, dr = P[first + 2], P[first + 1] - P[first]
    s = (x[0] * h + (np.hypot(x[1], x[2]) - P[first]) * dr) / P[first + 8] ** 2
    return min(max(s, 0.0), 1.0)


class OnOwnGeometry(docking.FullDocking):
    """A docking whose contacts MuJoCo's collision detection finds. Python runs at every stage."""

    def __init__(self, scene, step_s: float = 5e-4, tick_s: float = 1e-3, capsules: int = 192,
                 strips: int = 24) -> None:
        m = scene.mechanism
        c, t = scene.chaser, scene.target
        r2 = t.r_body_port @ m.r_mount_passive
        p2 = t.p_body_port_m + t.r_body_port @ m.p_mount_passive_m
        if m.attenuation is None:
            carrier, r1 = "chaser", c.r_body_port @ m.r_mount_active
            p1 = c.p_body_port_m + c.r_body_port @ m.p_mount_active_m
        else:
            carrier, r1, p1 = "ring", np.eye(3), np.zeros(3)
        # Detected, never part of MuJoCo's own solver: only cores that overlap would be. Cells meet the
        # other side's cells and borders, borders only its cells.
        def bits(own, wanted):
            return lambda radius: (
                f'margin="0" gap="{radius + BEYOND!r}" condim="1" contype="{own}" conaffinity="{wanted}"'
            )

        g1, a1 = shapes.side(m.active, "a", r1, p1, capsules, strips, bits(1, 10), bits(4, 0))
        g2, a2 = shapes.side(m.passive, "b", r2, p2, capsules, strips, bits(2, 5), bits(8, 0))
        model = mujoco.MjModel.from_xml_string(docking.mjcf(
            scene, step_s, {carrier: g1, "target": g2}, "", f"<asset>{a1}{a2}</asset>", "enable"
        ))
        super().__init__(scene, step_s, tick_s, model)
        self.table = np.zeros((model.ngeom, 6))
        for i in range(model.ngeom):
            side, surface, number, _ = model.geom(i).name.split("_")
            mech = m.active if side == "a" else m.passive
            ring = surface == "ring"
            self.table[i] = [
                float(side == "b"), -1.0 if ring else float(surface.removeprefix("petal")), int(number),
                float(int(number) >= (ARCS if ring else CELLS)),
                mech.ring_section_radius_m if ring else 0.5 * mech.petals.thickness_m,
                shapes.WIRE_M if ring else shapes.PLATE_M,
            ]
        self.given = np.zeros((k.PAIRS, 1 + MOST_ELEMENTS, ELEMENT))
        self._kept = self._stage
        self.callback = self._kept
        self.most_contacts = 0

    def _frames(self, d):
        """Active ring (position, rotation) and the passive one in it."""
        m, q = self.scene.mechanism, d.qpos
        if self.rigid:
            c = self.scene.chaser
            rc = np.array(matrix(*q[3:7]))
            rr = rc @ c.r_body_port @ m.r_mount_active
            pr = q[0:3] + rc @ (c.p_body_port_m + c.r_body_port @ m.p_mount_active_m)
            at = 7
        else:
            rr, pr, at = np.array(matrix(*q[10:14])), q[7:10].copy(), 14
        t = self.scene.target
        rt = np.array(matrix(*q[at + 3 : at + 7]))
        rp = rt @ t.r_body_port @ m.r_mount_passive
        pp = q[at : at + 3] + rt @ (t.p_body_port_m + t.r_body_port @ m.p_mount_passive_m)
        return pr, rr, rr.T @ (pp - pr), rr.T @ rp

    def _stage(self, _model, d) -> None:
        pr, rr, p_ab, r_ab = self._frames(d)
        c, n = d.contact, d.ncon
        self.most_contacts = max(self.most_contacts, n)
        rows = lambda x: tuple(map(tuple, x))  # noqa: E731
        if n:
            elements(self.given, self.table, n, np.ascontiguousarray(c.dist),
                     np.ascontiguousarray(c.pos), np.ascontiguousarray(c.frame),
                     np.ascontiguousarray(c.geom), tuple(pr), rows(rr), tuple(p_ab), rows(r_ab),
                     self.P)
        else:
            self.given[:, 0, 0] = 0.0
        k.scene(self.P, self.S, self.T, d.qpos, d.qvel, d.act, d.ctrl, d.qfrc_passive, self.given)
