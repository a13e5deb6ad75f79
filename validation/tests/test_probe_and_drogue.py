"""A mechanism of listed surfaces: docktwin against MuJoCo, with geometry, law and latch written again."""

from __future__ import annotations

import numpy as np
import pytest

from docktwin_mujoco.dockings import compare
from docktwin_mujoco.listed import ListedDocking

LIMIT = 0.01


@pytest.mark.parametrize(
    "sets",
    [
        [],
        ["initial.lateral_y_m=0.15", "initial.lateral_z_m=0.1", "initial.pitch_deg=5.0"],
        ["initial.lateral_y_m=0.02", "initial.lateral_z_m=0.0", "initial.axial_speed_m_s=0.1"],
    ],
)
def test_oracle_probe_and_drogue(binary, tmp_path, figure, sets):
    f = compare(binary, "probe_drogue", "", tmp_path / "run", 2e-4, ["run.duration_s=4.0", *sets],
                ListedDocking)
    figure(
        f"{f.summary['outcome']}; {f.mujoco.outcome}, capture {f.summary['capture_s']} s; {f.mujoco.captured_s} s, peak "
        f"{f.summary['peak_force_n']:.1f} N off by {100 * f.peak:.3f} % and impulse "
        f"{f.summary['impulse_ns']:.2f} N s by {100 * f.impulse:.3f} % (limits 1 %), pose until the {f.until} "
        f"{1e3 * f.pose_m:.4f} mm, {np.degrees(f.angle_rad):.5f} degrees (limits 1 mm, 0.1 degrees)"
    )
    assert f.mujoco.outcome == f.summary["outcome"] == "captured"
    assert f.mujoco.latch_order == f.latches == [1]
    assert f.peak <= LIMIT and f.impulse <= LIMIT
    # Two engines, not one compared with itself.
    assert f.peak > 0.0 and f.impulse > 0.0
    assert f.pose_m <= 1e-3 and f.angle_rad <= np.radians(0.1)
