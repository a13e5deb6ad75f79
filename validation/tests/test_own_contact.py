"""MuJoCo's own contact solver and its own collision shapes, with the stiffness set from the effective
mass at the place of contact: no line of our law. And our law on these shapes: the geometry apart."""

from __future__ import annotations

import numpy as np
import pytest

from docktwin_mujoco import own_solver
from docktwin_mujoco.dockings import compare
from docktwin_mujoco.own_geometry import OnOwnGeometry
from docktwin_mujoco.peer import ROOT, rehearse, states
from docktwin_mujoco.scene import rotation

PEAK, EXIT = 0.02, 0.01


@pytest.mark.parametrize(
    "case,sets",
    [
        ("basic_ring_ring", ["run.duration_s=1.6"]),
        ("basic_guide_ring", []),
        ("basic_guide_guide", ["initial.gap_m=0.001", "run.duration_s=0.9"]),
    ],
)
def test_oracle_single_point_impact(binary, tmp_path, figure, case, sets):
    run = rehearse(binary, ROOT / "scenarios" / f"{case}.toml", sets, out=tmp_path / "run")
    last = len(run.columns["time_s"]) - 1
    end, scene = states(run, last), run.scene
    got = own_solver.impact(
        scene, states(run), float(run.columns["time_s"][last]), 1e-3, capsules=384, strips=48
    )
    mech, c, t = scene.mechanism, scene.chaser, scene.target
    p1 = c.p_body_port_m + c.r_body_port @ mech.p_mount_active_m
    p2 = t.p_body_port_m + t.r_body_port @ mech.p_mount_passive_m

    def at(s, p):
        return s.v + rotation(s.q) @ np.cross(s.w, p)

    want = at(end["target"], p2) - at(end["chaser"], p1)
    peak = abs(got.peak_n / run.summary["peak_force_n"] - 1.0)
    exit_v = float(np.linalg.norm(got.exit_m_s - want) / np.linalg.norm(want))
    figure(
        f"peak {run.summary['peak_force_n']:.1f} N off by {100 * peak:.3f} % (limit 2 %), exit "
        f"{np.linalg.norm(want):.5f} m/s off by {100 * exit_v:.3f} % (limit 1 %), up to "
        f"{got.most_contacts} contacts at once, {got.step_us:.0f} us a step"
    )
    assert run.columns["contact_depth_m"][last] == 0.0, "the run must last until the sides parted"
    assert got.most_contacts > 0
    assert peak <= PEAK and exit_v <= EXIT


@pytest.mark.parametrize("case,until_s", [("basic_ring_ring", 1.6), ("apas_fast", 1.0)])
def test_oracle_our_law_on_mujocos_geometry(binary, tmp_path, figure, case, until_s):
    """MuJoCo's collision detection finds depth, normal and point; the law makes forces of them. To
    capture and a little beyond, with petals and friction, not only single places."""
    f = compare(binary, case, "", tmp_path / "run", 5e-4, [f"run.duration_s={until_s}"],
                OnOwnGeometry)
    figure(
        f"{f.summary['outcome']}, peak {f.summary['peak_force_n']:.1f} N off by {100 * f.peak:.3f} % "
        f"(limit 5 %), impulse {100 * f.impulse:.3f} %, pose until the {f.until} "
        f"{1e3 * f.pose_m:.4f} mm, {np.degrees(f.angle_rad):.5f} degrees (limits 1 mm, 0.1 degrees)"
    )
    assert f.mujoco.outcome == f.summary["outcome"] and f.mujoco.latch_order == f.latches
    assert f.peak <= 0.05
    assert f.pose_m <= 1e-3 and f.angle_rad <= np.radians(0.1)
