"""Whole dockings: petals, rings, friction, attenuator, latches, joined rings and thrusts, written again
and integrated by MuJoCo, against docktwin. The law is held equal; nothing else is shared."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

import drawn_approaches as drawn
from docktwin_mujoco.dockings import compare

POSE_M, ANGLE_RAD, PEAK = 1e-3, np.radians(0.1), 0.05


@pytest.mark.parametrize(
    "name,how,until_s",
    [
        ("apas_nominal", "", 8.0),
        ("apas_fast", "", 6.0),
        ("apas_corner_a", "differential", 6.0),
        ("apas_corner_d", "", 8.0),
        ("thrust_assist", "", 8.0),
        ("apas75_paper_corner", "", 4.0),
    ],
)
def test_oracle_whole_docking(binary, tmp_path, figure, name, how, until_s):
    f = compare(binary, name, how, tmp_path / "run", step_s=5e-4,
                overrides=[f"run.duration_s={until_s}"])
    a, b = f.summary, f.mujoco
    figure(
        f"{how or 'default'}, {b.end_s:.1f} s: {a['outcome']}, latches {f.latches}, "
        f"peak {a['peak_force_n']:.1f} N off by {100 * f.peak:.3f} %, pose until the {f.until} "
        f"{1e3 * f.pose_m:.4f} mm {np.degrees(f.angle_rad):.5f} degrees (limits 5 %, 1 mm, 0.1 degrees)"
    )
    assert b.outcome == a["outcome"]
    assert b.latch_order == f.latches
    assert f.pose_m <= POSE_M and f.angle_rad <= ANGLE_RAD
    assert f.peak <= PEAK
    if a["capture_s"] is not None:
        assert b.captured_s == pytest.approx(a["capture_s"], rel=0.005)


@pytest.mark.parametrize("box,number", [(b, n) for b in ("idss", "paper") for n in (1, 3, 4)])
def test_oracle_drawn_approach(binary, figure, tmp_path, monkeypatch, box, number):
    """A few of the approaches of `drawn_approaches.py`."""
    monkeypatch.setattr(drawn, "WORK", tmp_path)
    monkeypatch.setattr(drawn, "DURATION_S", 6.0)
    scenario, values = drawn.draw(box, number)
    r = drawn.both(binary, scenario, values)
    a, b = r["docktwin"], r["mujoco"]
    figure(f"{a['outcome']}, capture {a['capture_s']} and {b['capture_s']} s, "
           f"peak {a['peak_n']:.1f} and {b['peak_n']:.1f} N")
    assert not drawn.disagrees(r)
    assert a["latches"] == b["latches"]
    assert b["peak_n"] == pytest.approx(a["peak_n"], rel=PEAK)


@pytest.mark.parametrize("turning", ["chaser", "both"])
def test_oracle_either_body_may_turn(binary, tmp_path, figure, turning):
    """The other body turns before contact; MuJoCo starts from the recorded state, of which it is true."""
    overrides = ["run.duration_s=4.0", f'initial.turning="{turning}"', "initial.yaw_rate_deg_s=1.0"]
    f = compare(binary, "apas_fast", "", tmp_path / "run", step_s=5e-4, overrides=overrides)
    figure(f"peak off by {100 * f.peak:.3f} %, pose until the {f.until} {1e3 * f.pose_m:.4f} mm")
    assert f.mujoco.outcome == f.summary["outcome"] and f.mujoco.latch_order == f.latches
    assert f.pose_m <= POSE_M and f.angle_rad <= ANGLE_RAD and f.peak <= PEAK


def test_oracle_latches_in_the_axes_of_the_passive_ring(binary, models, tmp_path, figure):
    """Gaps and pull in the axes of the other ring, written a second time. With those of the default it is
    another docking."""
    for part in ("models", "meshes"):
        shutil.copytree(models.parents[1] / part, tmp_path / part)
    file = tmp_path / "models" / "urdf" / "apas_active.toml"
    text = file.read_text()
    assert text.count("\n[latches]\n") == 1
    file.write_text(text.replace("\n[latches]\n", '\n[latches]\naxes = "passive"\n'))
    duration = "run.duration_s=1.2"
    overrides = [duration, f'mechanism.active="{file.with_suffix(".urdf")}"']
    step_s = 2e-4
    f = compare(binary, "apas_fast", "", tmp_path / "run", step_s, overrides)
    default = compare(binary, "apas_fast", "", tmp_path / "default", step_s, [duration])
    # By how much the other axes move each latch, on either side.
    ours = np.subtract(f.summary["latches_s"], default.summary["latches_s"])
    theirs = np.subtract(*([t[2] for t in x.mujoco.latches_s] for x in (f, default)))
    figure(
        f"the other axes move the latches by {1e3 * ours} ms, MuJoCo's by {1e3 * theirs} ms; "
        f"peak off by {100 * f.peak:.3f} %"
    )
    assert f.mujoco.outcome == f.summary["outcome"] and f.mujoco.latch_order == f.latches
    assert f.peak <= PEAK
    assert np.abs(ours).max() > 1.5e-3 and np.abs(ours - theirs).max() <= 2 * step_s
