"""Torque-free flight of both spacecraft, 60 s: docktwin's reduced twin against MuJoCo."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from docktwin_mujoco.models import read_mechanism, read_spacecraft, rotation_rpy
from docktwin_mujoco.scenario import Telemetry, read_scene
from docktwin_mujoco.scene import Body, State, angle_between, build, get_state, set_state

POSE_M = POSE_RAD = 1e-6
STEP_S = 1e-3


def bodies(chaser, target, mech):
    return [Body.of("chaser", chaser).with_ring(chaser, mech), Body.of("target", target)]


def fly(model, states, times, step):
    """States of both bodies at the given times, from those at the first of them."""
    data = mujoco.MjData(model)
    for name, s in states.items():
        set_state(model, data, name, s)
    out = [dict(states)]
    for t0, t1 in zip(times, times[1:]):
        n = max(1, round((t1 - t0) / step))
        model.opt.timestep = (t1 - t0) / n
        mujoco.mj_step(model, data, nstep=n)
        out.append({name: get_state(model, data, name) for name in states})
    return out


def difference(a, b):
    return (
        max(np.linalg.norm(a[n].p - b[n].p) for n in a),
        max(angle_between(a[n].q, b[n].q) for n in a),
    )


def test_invariant_the_reference_itself_has_converged(models, figure):
    """What is left of the step after 60 s, at ten times the rates of a docking and with products of
    inertia: the order by halving, and the error at the step used below from it."""
    chaser = read_spacecraft(models / "chaser_8t.urdf")
    target = read_spacecraft(models / "target_12t.urdf")
    mech = read_mechanism(models / "apas_active.urdf", models / "apas_passive.urdf")
    r = rotation_rpy([0.2, 0.3, -0.1])
    chaser, target = (
        dataclasses.replace(
            c, inertia_kg_m2=r @ np.diag(c.inertia_kg_m2[1, 1] * np.array([0.5, 1.0, 1.2])) @ r.T
        )
        for c in (chaser, target)
    )
    m = build(bodies(chaser, target, mech), 1e-3)
    start = {
        "chaser": State(np.zeros(3), np.array([1.0, 0, 0, 0]), np.array([0.1, 0.02, -0.03]),
                        np.radians([5.0, -8.0, 4.0])),
        "target": State(np.array([20.0, 1, 2]), np.array([0.6, 0.0, 0.8, 0.0]),
                        np.array([-0.05, 0.01, 0.0]), np.radians([-3.0, 6.0, 8.0])),
    }
    h = 32 * STEP_S
    ends = [fly(m, start, [0.0, 60.0], step)[-1] for step in (2 * h, h, STEP_S)]
    coarse, fine = difference(ends[0], ends[2]), difference(ends[1], ends[2])
    order = np.log2(coarse[1] / fine[1])
    left = [e * (STEP_S / h) ** 4 for e in fine]
    figure(f"order {order:.2f}; left at {STEP_S} s: {left[0]:.1e} m, {left[1]:.1e} rad")
    assert order > 3.7
    assert left[0] < 0.01 * POSE_M and left[1] < 0.01 * POSE_RAD


def test_oracle_sixty_seconds_of_free_flight(rehearse, models, figure):
    path, _, columns = rehearse("free_flight")
    scene = read_scene(path, models)
    tele = Telemetry(columns, scene)
    assert tele.time_s[-1] - tele.time_s[0] >= 60.0 - 2e-3, "the scenario must last 60 s"
    rows = np.unique(np.linspace(0, len(tele.time_s) - 1, 61).astype(int))
    want = [{n: tele.state(n, i) for n in ("chaser", "target")} for i in rows]
    m = build(bodies(scene.chaser, scene.target, scene.mechanism), STEP_S)
    got = fly(m, want[0], tele.time_s[rows], STEP_S)
    worst = np.max([difference(a, b) for a, b in zip(got, want)], axis=0)
    turned = [angle_between(want[0][n].q, want[-1][n].q) for n in ("chaser", "target")]
    rates = [np.degrees(np.linalg.norm(want[0][n].w)) for n in ("chaser", "target")]
    figure(f"worst of {len(rows)} instants {worst[0]:.2e} m, {worst[1]:.2e} rad; "
           f"rates {rates[0]:.2f}, {rates[1]:.2f} deg/s; chaser recorded {tele.chaser_point}")
    assert min(rates) > 0.05 and max(turned) > 0.05, "both bodies must tumble"
    assert worst[0] <= POSE_M
    assert worst[1] <= POSE_RAD


@pytest.mark.parametrize("step,bound", [(1e-3, 1e-9)])
def test_invariant_angular_momentum_of_the_reference(models, figure, step, bound):
    chaser = read_spacecraft(models / "chaser_8t.urdf")
    m = build([Body.of("chaser", chaser)], step)
    d = mujoco.MjData(m)
    set_state(m, d, "chaser", State(np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(3),
                                    np.radians([2.0, -3.0, 1.5])))

    def momentum():
        mujoco.mj_forward(m, d)
        r = d.xmat[1].reshape(3, 3)
        return r @ chaser.inertia_kg_m2 @ d.qvel[3:6]

    before = momentum()
    mujoco.mj_step(m, d, nstep=round(60.0 / step))
    drift = np.linalg.norm(momentum() - before) / np.linalg.norm(before)
    figure(f"drift in 60 s {drift:.1e}")
    assert drift < bound
