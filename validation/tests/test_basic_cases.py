"""The five basic contact cases: docktwin against MuJoCo with geometry and law written again, and
both against closed forms, because two programmes may share a mistake."""

from __future__ import annotations

import numpy as np
import pytest

from docktwin_mujoco.scenario import Telemetry, read_scene
from docktwin_mujoco.scene import Docking, rotation
from oracles.closed_forms import SLOW, oblique

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


def pct(value, limit):
    return f"{100 * value:.3f} % (limit {100 * limit:g} %)"


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
        f"{'+'.join(sorted(got.pairs))}: "
        f"peak {summary['peak_force_n']:.1f} N off by {pct(peak, PEAK)}, "
        f"impulse {np.linalg.norm(want_impulse):.2f} N s {pct(vector, IMPULSE)}, "
        f"of |F| {pct(path_impulse, IMPULSE)}, "
        f"exit {np.linalg.norm(want_exit):.5f} m/s {pct(exit_v, EXIT)}, rates {pct(rates, EXIT)}"
    )
    assert summary["verdict"] == "pass"
    assert got.pairs, "nothing touched"
    assert np.linalg.norm(want_exit - approach) > 0.1 * np.linalg.norm(approach)
    assert docking.force_n == 0.0, "the run must last until the sides have parted"
    assert peak <= PEAK
    assert vector <= IMPULSE and path_impulse <= IMPULSE
    assert exit_v <= EXIT and rates <= EXIT


LIMIT_PEAK, LIMIT_IMPULSE = 0.002, 0.005


@pytest.mark.parametrize("case,speed,duration", [(c, *x) for c, x in SLOW.items()])
def test_oracle_slow_oblique_impacts_tend_to_their_closed_forms(
    rehearse, models, figure, case, speed, duration
):
    """The closed forms hold the geometry still during the contact, which is right for slow
    motion: lever arms then change by less than the limits."""
    path, summary, columns = rehearse(
        case, f"initial.axial_speed_m_s={speed}", f"initial.gap_m={0.2 * speed}",
        f"run.duration_s={duration}",
    )
    scene = read_scene(path, models)
    tele = Telemetry(columns, scene)
    docking = Docking(scene.chaser, scene.target, scene.mechanism, 2.0 * STEP_S)
    got = docking.run(
        tele.state("chaser", 0), tele.state("target", 0), tele.time_s[-1], tele.time_s[0]
    )
    assert docking.force_n == 0.0, "the run must last until the sides have parted"
    mass, k, along = oblique(case)
    want_peak, want_impulse = along * speed * np.sqrt(k * mass), 2.0 * mass * along * speed
    found = {
        "docktwin": (summary["peak_force_n"], summary["impulse_ns"]),
        "MuJoCo": (got.peak_force_n, got.path_impulse_ns),
    }
    off = {n: (abs(f / want_peak - 1), abs(i / want_impulse - 1)) for n, (f, i) in found.items()}
    figure(
        f"wanted {want_peak:.2f} N, {want_impulse:.3f} N s; "
        + "; ".join(
            f"{n} peak {pct(f, LIMIT_PEAK)}, impulse {pct(i, LIMIT_IMPULSE)}"
            for n, (f, i) in off.items()
        )
    )
    for peak, impulse in off.values():
        assert peak <= LIMIT_PEAK and impulse <= LIMIT_IMPULSE


def test_oracle_roll_lost_to_friction_tends_to_coulomb(rehearse, models, figure):
    """mu r 2 m v of angular impulse; the bristle takes its share of it, which shrinks with the
    break-away displacement."""
    turn = 0.1 * 0.6 * 2.0 * 4800.0 * 0.1
    want = np.degrees(turn / 8e3 + turn / 12e3)
    lost = {}
    for breakaway in (3e-5, 3e-6):
        path, _, columns = rehearse(
            "basic_impact_with_roll", f"mechanism.contact.bristle_breakaway_m={breakaway}",
            "initial.gap_m=0.005", "run.duration_s=0.4",
        )
        scene = read_scene(path, models)
        tele = Telemetry(columns, scene)
        start = {n: tele.state(n, 0) for n in ("chaser", "target")}
        docking = Docking(scene.chaser, scene.target, scene.mechanism, STEP_S)
        got = docking.run(start["chaser"], start["target"], tele.time_s[-1], tele.time_s[0])
        assert docking.force_n == 0.0, "the run must last until the sides have parted"

        def relative_roll(chaser, target):
            return np.degrees(target.w[0] - chaser.w[0])

        last = len(tele.time_s) - 1
        before = relative_roll(start["chaser"], start["target"])
        lost[breakaway] = [
            abs((before - after) / want - 1.0)
            for after in (
                relative_roll(tele.state("chaser", last), tele.state("target", last)),
                relative_roll(got.chaser, got.target),
            )
        ]
    figure(
        f"wanted {want:.4f} deg/s; docktwin {pct(lost[3e-6][0], 1e-3)}, MuJoCo "
        f"{pct(lost[3e-6][1], 1e-3)}; with ten times the break-away displacement "
        f"{100 * lost[3e-5][0]:.3f} % and {100 * lost[3e-5][1]:.3f} %"
    )
    for coarse, fine in zip(lost[3e-5], lost[3e-6]):
        assert fine <= 1e-3 and fine < coarse
