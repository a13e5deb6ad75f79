"""The five basic contact cases: docktwin against MuJoCo with geometry and law written again."""

from __future__ import annotations

import numpy as np
import pytest

from docktwin_mujoco.scenario import Telemetry, read_scene
from docktwin_mujoco.scene import Docking, rotation

CASES = (
    "basic_central_impact",
    "basic_impact_with_roll",
    "basic_guide_guide",
    "basic_guide_ring",
    "basic_ring_ring",
)
PEAK, IMPULSE, EXIT = 0.01, 0.005, 0.005
STEP_S = 5e-4


def ring_velocity(docking: Docking, chaser, target):
    """Velocity of the passive ring's centre less that of the active one's, world, m/s."""
    v1 = chaser.v + rotation(chaser.q) @ np.cross(chaser.w, docking.p_1)
    v2 = target.v + rotation(target.q) @ np.cross(target.w, docking.p_2)
    return v2 - v1


def relative(a, b):
    return float(np.linalg.norm(np.asarray(a) - np.asarray(b)) / np.linalg.norm(b))


@pytest.mark.parametrize("case", CASES)
def test_oracle_basic_case(rehearse, models, figure, case):
    path, summary, columns = rehearse(case)
    scene = read_scene(path, models)
    tele = Telemetry(columns, scene)
    last = len(tele.time_s) - 1
    start = {n: tele.state(n, 0) for n in ("chaser", "target")}
    end = {n: tele.state(n, last) for n in ("chaser", "target")}
    docking = Docking(scene.chaser, scene.target, scene.mechanism, STEP_S)
    got = docking.run(start["chaser"], start["target"], tele.time_s[last], tele.time_s[0])

    approach = ring_velocity(docking, start["chaser"], start["target"])
    want_exit = ring_velocity(docking, end["chaser"], end["target"])
    got_exit = ring_velocity(docking, got.chaser, got.target)
    # Impulse on the target from its own momentum: exact on both sides, whatever is sampled.
    want_impulse = scene.target.mass_kg * (end["target"].v - start["target"].v)
    peak = abs(got.peak_force_n / summary["peak_force_n"] - 1.0)
    vector = relative(got.impulse_ns, want_impulse)
    path_impulse = abs(got.path_impulse_ns / summary["impulse_ns"] - 1.0)
    exit_v = relative(got_exit, want_exit)
    # Rates as speeds at the ring, against the same exit velocity.
    rates = max(
        np.linalg.norm(getattr(got, n).w - end[n].w) * scene.mechanism.active.ring_mean_radius_m
        for n in ("chaser", "target")
    ) / float(np.linalg.norm(want_exit))
    figure(
        f"{'+'.join(sorted(got.pairs))}: peak {summary['peak_force_n']:.1f} N {100 * peak:.3f} %, "
        f"impulse {np.linalg.norm(want_impulse):.2f} N s {100 * vector:.3f} % "
        f"(of |F| {100 * path_impulse:.3f} %), exit {np.linalg.norm(want_exit):.5f} m/s "
        f"{100 * exit_v:.3f} %, rates {100 * rates:.3f} %"
    )
    assert got.pairs, "nothing touched"
    assert np.linalg.norm(want_exit - approach) > 0.1 * np.linalg.norm(approach)
    assert docking.force_n == 0.0, "the run must last until the sides have parted"
    assert peak <= PEAK
    assert vector <= IMPULSE and path_impulse <= IMPULSE
    assert exit_v <= EXIT and rates <= EXIT
