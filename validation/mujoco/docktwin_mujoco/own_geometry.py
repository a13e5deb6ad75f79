"""Our law on MuJoCo's collision geometry: MuJoCo finds distance, normal and point of every pair of
capsules and convex pieces, and the law makes forces of them.

How its contacts become the samples that the law is stated for: a capsule of the active ring belongs to
the interval of azimuth in which it lies, a strip of a petal to its interval across the rulings, and of
two petals a strip to its half of the active petal. The deepest contact of an interval is its sample.
Two petals so have two samples at most, not ten, and the small force along the sheet (N6) is left out:
it is below a thousandth of the normal force at the depths met here.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numba import njit

from . import docking, kernel as k, shapes
from .places import PIECES, SAMPLE
from .vec import add, at3, axpy, back, dot, matrix, mul, norm, put3, sub, turn

# Columns of the table of geoms: side (0 active, 1 passive), surface (-1 ring, else petal), middle of
# its stretch of the family, radius about the core, radius of the core itself.
SIDE, SURFACE, MIDDLE, RADIUS, CORE = range(5)
# Contacts are looked for this far beyond touching, m.
BEYOND = 2e-4


@njit(cache=True)
def samples(given, table, n, dist, pos, frame, geoms, pr, rr, p_ab, r_ab, P):
    """Fills `given` from MuJoCo's contacts; poses of the active ring and of the passive one in it."""
    given[:, 0, 0] = 0.0
    m_ring, m_ruling = int(P[k.M_RING]), int(P[k.M_RULING])
    most = given.shape[1] - 1
    best = np.full((k.PAIRS, most), -1e300)
    rows = np.zeros((k.PAIRS, most, SAMPLE))
    for i in range(n):
        a, b = table[geoms[i, 0]], table[geoms[i, 1]]
        sign = 1.0
        if a[SIDE] > b[SIDE]:
            a, b, sign = b, a, -1.0
        if a[SIDE] == b[SIDE]:
            continue
        depth = a[RADIUS] + b[RADIUS] - dist[i] - a[CORE] - b[CORE]
        normal = back(rr, mul((frame[i, 0], frame[i, 1], frame[i, 2]), sign))
        point = back(rr, sub((pos[i, 0], pos[i, 1], pos[i, 2]), pr))
        point = axpy(point, a[RADIUS] - 0.5 * depth - a[CORE] - 0.5 * dist[i], normal)
        sa, sb = int(a[SURFACE]), int(b[SURFACE])
        if sa < 0 and sb < 0:
            pair, u = 0, a[MIDDLE]
            at = int(u / (2.0 * np.pi) * m_ring)
        elif sb < 0:
            pair, u = 1 + sa, a[MIDDLE]
            at = int(0.5 * (u + 1.0) * m_ruling)
        elif sa < 0:
            pair, u = 4 + sb, b[MIDDLE]
            at = int(0.5 * (u + 1.0) * m_ruling)
        else:
            pair, u = 7 + 3 * sa + sb, a[MIDDLE]
            at = 0 if u < 0.0 else 1
        if depth <= best[pair, at]:
            continue
        c = 1.0 / P[k.STIFFNESS]
        if sa >= 0:
            s = _along(P, k.PETAL_A, point)
            c += s**3 / (3.0 * P[k.PETAL_A + 6])
        if sb >= 0:
            s = _along(P, k.PETAL_B, back(r_ab, sub(point, p_ab)))
            c += s**3 / (3.0 * P[k.PETAL_B + 6])
        best[pair, at] = depth
        row = rows[pair, at]
        row[0], row[1], row[8] = u, depth, 1.0 / c
        put3(row, 2, point)
        put3(row, 5, normal)
    for pair in range(k.PAIRS):
        count = 0
        # All intervals of a ring or petal keep their places: neighbours are told by them.
        size = m_ring if pair == 0 else (m_ruling if pair < 7 else 2)
        touched = False
        for at in range(size):
            touched = touched or best[pair, at] > -1e299
        if not touched:
            continue
        for at in range(size):
            if best[pair, at] > -1e299:
                given[pair, 1 + count] = rows[pair, at]
                count += 1
            elif pair < 7:
                given[pair, 1 + count] = 0.0
                given[pair, 1 + count, 1] = -1e-2
                count += 1
        given[pair, 0, 0] = count


@njit(cache=True)
def _along(P, first, x):
    """Distance of a point of a petal's ring frame from the root, along the slope."""
    h, dr = P[first + 2], P[first + 1] - P[first]
    s = (x[0] * h + (np.hypot(x[1], x[2]) - P[first]) * dr) / P[first + 8]
    return min(max(s, 0.0), P[first + 8])


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
        # Detected, never part of MuJoCo's own solver: only cores that overlap would be.
        extra = lambda radius: f'margin="0" gap="{radius + BEYOND!r}" condim="1"'  # noqa: E731
        g1, a1 = shapes.side(m.active, "a", r1, p1, capsules, strips, extra)
        g2, a2 = shapes.side(m.passive, "b", r2, p2, capsules, strips, extra)
        model = mujoco.MjModel.from_xml_string(docking.mjcf(
            scene, step_s, {carrier: g1, "target": g2}, "", f"<asset>{a1}{a2}</asset>", "enable"
        ))
        super().__init__(scene, step_s, tick_s, None, model)
        self.table = np.zeros((model.ngeom, 5))
        for i in range(model.ngeom):
            side, surface, number = model.geom(i).name.split("_")
            mech = m.active if side == "a" else m.passive
            ring = surface == "ring"
            self.table[i] = [
                float(side == "b"), -1.0 if ring else float(surface.removeprefix("petal")),
                (int(number) + 0.5) / capsules * 2.0 * np.pi if ring
                else -1.0 + (2.0 * int(number) + 1.0) / strips,
                mech.ring_section_radius_m if ring else 0.5 * mech.petals.thickness_m,
                shapes.WIRE_M if ring else shapes.PLATE_M,
            ]
        self.given = np.zeros((k.PAIRS, 1 + max(docking.RING_INTERVALS, 2 * PIECES), SAMPLE))
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
            samples(self.given, self.table, n, np.ascontiguousarray(c.dist),
                    np.ascontiguousarray(c.pos), np.ascontiguousarray(c.frame),
                    np.ascontiguousarray(c.geom), tuple(pr), rows(rr), tuple(p_ab), rows(r_ab),
                    self.P)
        else:
            self.given[:, 0, 0] = 0.0
        k.scene(self.P, self.S, self.T, d.qpos, d.qvel, d.act, d.ctrl, d.qfrc_passive, self.given)
