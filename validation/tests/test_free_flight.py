"""Flight of both spacecraft without contact, 60 s: docktwin's twins against MuJoCo."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from docktwin_mujoco.models import read_mechanism, read_spacecraft, rotation_rpy
from docktwin_mujoco.scenario import Telemetry, read_scene
from docktwin_mujoco.scene import Body, State, angle_between, build, get_state, set_state

POSE_M = POSE_RAD = 1e-6
# The full twin integrates with rapier, whose gyroscopic term is explicit: its error is of first
# order in the step, and the bound is what the comparison of both twins allows at first contact.
FULL_M, FULL_RAD = 1e-4, np.radians(0.01)
STEP_S = 1e-3


def bodies(chaser, target, mech):
    return [Body.of("chaser", chaser).with_ring(chaser, mech), Body.of("target", target)]


def fly(model, states, times, step, moments=None):
    """States of both bodies at the given times, from those at the first of them. `moments` gives
    for each body the moment (N m, body axes) held from each time to the next."""
    data = mujoco.MjData(model)
    for name, s in states.items():
        set_state(model, data, name, s)
    out = [dict(states)]
    for k, (t0, t1) in enumerate(zip(times, times[1:])):
        for name, held in (moments or {}).items():
            # The rotational freedoms of a free joint are in body axes.
            v = model.joint(name).dofadr[0]
            data.qfrc_applied[v + 3 : v + 6] = held[k]
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


def control(columns, what, unit):
    return {
        n: np.stack([columns[f"{n}_control_{what}_{a}_{unit}"] for a in "xyz"], 1)
        for n in ("chaser", "target")
    }


@pytest.mark.parametrize(
    "twin,bound_m,bound_rad", [("reduced", POSE_M, POSE_RAD), ("full", FULL_M, FULL_RAD)]
)
def test_oracle_sixty_seconds_of_free_flight(rehearse, models, figure, twin, bound_m, bound_rad):
    path, summary, columns = rehearse("free_flight", twin=twin)
    scene = read_scene(path, models)
    for craft in (scene.chaser, scene.target):
        i = craft.inertia_kg_m2
        assert min(abs(i[0, 1]), abs(i[0, 2]), abs(i[1, 2])) > 0.03 * i[0, 0], "products of inertia"
        assert np.diff(np.linalg.eigvalsh(i)).min() > 0.1 * i[0, 0], "three unequal moments"
    assert summary["verdict"] == "pass" and summary["outcome"] == "missed"
    assert summary["first_contact_s"] is None and summary["peak_force_n"] == 0.0
    tele = Telemetry(columns, scene)
    time = tele.time_s
    assert time[-1] - time[0] >= 60.0 - 2e-3, "the scenario must last 60 s"
    moments = control(columns, "moment", "nm")
    assert all((f == 0.0).all() for f in control(columns, "force", "n").values()), "moments only"
    # An instant every second, and wherever the recorded moment changes.
    both = np.hstack([moments[n] for n in moments])
    changes = 1 + np.flatnonzero((both[1:] != both[:-1]).any(1))
    rows = np.union1d(np.linspace(0, len(time) - 1, 61).astype(int), changes)
    want = [{n: tele.state(n, i) for n in ("chaser", "target")} for i in rows]
    m = build(bodies(scene.chaser, scene.target, scene.mechanism), STEP_S)
    held = {n: moments[n][rows] for n in moments}
    got = fly(m, want[0], time[rows], STEP_S, held)
    worst = np.max([difference(a, b) for a, b in zip(got, want)], axis=0)
    rates = [[np.degrees(np.linalg.norm(s[n].w)) for s in want] for n in ("chaser", "target")]
    # How far the rate wanders in body axes once the moment is over: tumbling, not spinning.
    free = [s for s, i in zip(want, rows) if i >= changes.max(initial=0)]
    wander = [
        max(np.linalg.norm(s[n].w - free[0][n].w) for s in free) / np.linalg.norm(free[0][n].w)
        for n in ("chaser", "target")
    ]
    figure(
        f"worst of {len(rows)} instants {worst[0]:.2e} m (limit {bound_m:.0e}), {worst[1]:.2e} rad "
        f"(limit {bound_rad:.1e}); at the end {rates[0][-1]:.2f} and {rates[1][-1]:.2f} deg/s, "
        f"wandering by {100 * wander[0]:.0f} and {100 * wander[1]:.0f} %"
    )
    assert min(max(r) for r in rates) > 1.0 and min(wander) > 0.1, "both bodies must tumble"
    assert worst[0] <= bound_m
    assert worst[1] <= bound_rad


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
