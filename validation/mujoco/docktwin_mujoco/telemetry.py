"""Telemetry of a run as Parquet, one row a tick, with docktwin's column names where both know the
quantity (the energy account is docktwin's alone)."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from . import kernel as k
from .vec import matrix


def columns(run, scene) -> dict:
    """Column by name."""
    rows = run.rows
    out = {"time_s": rows[:, k.TIME]}

    def vector(name, unit, at):
        for i, a in enumerate("xyz"):
            out[f"{name}_{a}_{unit}"] = rows[:, at + i]

    for i, body in enumerate(("chaser", "ring", "target")):
        b = k.BODIES + 13 * i
        vector(f"{body}_position", "m", b)
        vector(f"{body}_velocity", "m_s", b + 7)
        vector(f"{body}_rate", "rad_s", b + 10)
        for j, a in enumerate("wxyz"):
            out[f"{body}_attitude_{a}"] = rows[:, b + 3 + j]
    if scene.mechanism.attenuation is None:
        out |= _with_rigid_ring(rows, scene)
    c, t, b = scene.chaser, scene.target, k.BODIES
    place, euler = np.empty((len(rows), 3)), np.empty((len(rows), 3))
    for n, row in enumerate(rows):
        rc, rt = np.array(matrix(*row[b + 3 : b + 7])), np.array(matrix(*row[b + 29 : b + 33]))
        r3, r4 = rc @ c.r_body_port, rt @ t.r_body_port
        place[n] = r3.T @ (
            row[b + 26 : b + 29] + rt @ t.p_body_port_m - row[b : b + 3] - rc @ c.p_body_port_m
        )
        # R = Ry(pitch) Rz(yaw) Rx(roll)
        r = r3.T @ r4
        euler[n] = (
            np.arctan2(-r[1, 2], r[1, 1]), np.arctan2(-r[2, 0], r[0, 0]),
            np.arcsin(np.clip(r[1, 0], -1.0, 1.0)),
        )
    for i, a in enumerate("xyz"):
        out[f"relative_position_{a}_m"] = place[:, i]
        out[f"relative_attitude_{a}_rad"] = euler[:, i]
    for name, unit, at in (
        ("relative_velocity", "m_s", k.REL_V), ("relative_rate", "rad_s", k.REL_W),
        ("ring_deflection", "m", k.DEFLECTION), ("ring_rotation", "rad", k.PSI),
        ("port3_force", "n", k.PORT3), ("port3_moment", "nm", k.PORT3 + 3),
        ("port4_force", "n", k.PORT4), ("port4_moment", "nm", k.PORT4 + 3),
        ("contact_force", "n", k.CONTACT),
        ("chaser_control_force", "n", k.CONTROLS), ("chaser_control_moment", "nm", k.CONTROLS + 3),
        ("target_control_force", "n", k.CONTROLS + 6), ("target_control_moment", "nm", k.CONTROLS + 9),
    ):
        vector(name, unit, at)
    for i in range(3):
        out[f"latch_{i + 1}_phase"] = rows[:, k.PHASES + i].astype(np.uint64)
        out[f"latch_{i + 1}_gap_m"] = rows[:, k.GAPS + i]
        vector(f"latch_{i + 1}_force", "n", k.LATCH_FORCE + 3 * i)
    out["contact_depth_m"] = rows[:, k.DEPTH_NOW]
    out["contact_places"] = rows[:, k.N_PLACES].astype(np.uint64)
    return out


def _with_rigid_ring(rows, scene) -> dict:
    """With a rigid ring docktwin records the mass centre of chaser and ring together, and the ring's
    attitude; the rows have the chaser's own and none."""
    mech, c = scene.mechanism, scene.chaser
    ring = mech.ring_body
    r_ring = c.r_body_port @ mech.r_mount_active
    at = c.p_body_port_m + c.r_body_port @ mech.p_mount_active_m + r_ring @ ring.com_m
    at = at * ring.mass_kg / (ring.mass_kg + c.mass_kg)
    turn = np.empty(4)
    mujoco.mju_mat2Quat(turn, np.ascontiguousarray(r_ring).ravel())
    b, n = k.BODIES, len(rows)
    place, speed, attitude = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 4))
    for i, row in enumerate(rows):
        r = np.array(matrix(*row[b + 3 : b + 7]))
        place[i] = row[b : b + 3] + r @ at
        speed[i] = row[b + 7 : b + 10] + r @ np.cross(row[b + 10 : b + 13], at)
        mujoco.mju_mulQuat(attitude[i], np.ascontiguousarray(row[b + 3 : b + 7]), turn)
    out = {f"chaser_position_{a}_m": place[:, i] for i, a in enumerate("xyz")}
    out |= {f"chaser_velocity_{a}_m_s": speed[:, i] for i, a in enumerate("xyz")}
    return out | {f"ring_attitude_{a}": attitude[:, i] for i, a in enumerate("wxyz")}


def contacts(run) -> dict:
    """Places of contact, one row each: tick, pair of surfaces in docktwin's numbering, point (m),
    normal force and friction on the passive side (N), world axes, and depth (m)."""
    rows = run.rows
    counts = rows[:, k.N_SHOWN].astype(np.int64)
    tick = np.repeat(np.arange(len(rows)), counts)
    each = rows[:, k.SHOWN_ROW : k.LOADS_ROW].reshape(len(rows), k.MOST_SHOWN, k.SHOWN_SIZE)
    found = each[np.arange(k.MOST_SHOWN)[None, :] < counts[:, None]]
    out = {"tick": tick.astype(np.uint64), "pair": found[:, 0].astype(np.uint64)}
    for name, unit, at in (("point", "m", 1), ("normal_force", "n", 4), ("friction", "n", 7)):
        out |= {f"{name}_{a}_{unit}": found[:, at + i] for i, a in enumerate("xyz")}
    return out | {"depth_m": found[:, 10]}


def write(run, scene, path: Path) -> None:
    """Writes a run."""
    _table(columns(run, scene), path)


def write_contacts(run, path: Path) -> None:
    """Writes its places of contact."""
    _table(contacts(run), path)


def _table(named: dict, path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    # Zstandard, because docktwin reads no other compression.
    pq.write_table(pa.table(named), path, compression="zstd", use_dictionary=False)
