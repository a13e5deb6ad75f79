"""Telemetry of a run as Parquet, one row a tick, with docktwin's column names where both know the
quantity (the energy account is docktwin's alone)."""

from __future__ import annotations

from pathlib import Path

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
    out["contact_depth_m"] = rows[:, k.DEPTH_NOW]
    out["contact_places"] = rows[:, k.N_PLACES].astype(np.uint64)
    return out


def write(run, scene, path: Path) -> None:
    """Writes a run."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(columns(run, scene)), path)
