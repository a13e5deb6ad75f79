"""The motion simulator with closed loops, leg masses and gravity: MuJoCo, virtual work and docktwin's
reduced rig."""

from __future__ import annotations

import dataclasses
import functools
import json
import subprocess

import numpy as np
import pytest

from docktwin_mujoco import platform, virtual_work
from docktwin_mujoco.platform import Platform, Settings
from docktwin_mujoco.rig import FREQUENCIES_HZ, plate_pose, read_rig, trajectory
from docktwin_mujoco.scene import angle_between

STATICS_N = 0.1
# What is promised of leg forces, and what three sides that only round differently must reach.
PROMISED_RMS, RMS = 5e-3, 1e-8
TIMES_S = np.linspace(0.0, 10.0, 101)
UNTIL_S, SAMPLE_S = 2.0, 0.01
# A corner where no leg is like another, in half-widths of the docking workspace.
CORNER = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
# Place of release in corners, stiffness of a leg (None: the file's oil), the motion it makes at least,
# and how far both sides may be apart at the finest steps, m and rad.
MOTIONS = {
    "large": (0.8, 1e5, 0.3, 2e-7),
    "oil": (0.004, None, 1e-3, 5e-6),
}


def massless(rig):
    """Legs that MuJoCo still accepts and no statics can feel."""
    return rig.with_leg_masses_times(1e-9)


@functools.cache
def forces(path):
    """Leg forces along the trajectory, by MuJoCo and by virtual work."""
    rig = read_rig(path)
    return platform.leg_forces(rig, TIMES_S), virtual_work.leg_forces(rig, TIMES_S)


def rms(got, want) -> float:
    """Of the leg that differs most, of that leg's forces."""
    return float((np.sqrt(np.mean((got - want) ** 2, axis=0) / np.mean(want**2, axis=0))).max())


def apart(a, b) -> tuple[float, float]:
    """Largest difference of two series of poses, m and rad."""
    return (
        float(np.linalg.norm(a[:, :3] - b[:, :3], axis=1).max()),
        max(angle_between(x[3:], y[3:]) for x, y in zip(a, b)),
    )


def peer(peers, *arguments) -> dict:
    """What docktwin-peers says of the platform."""
    command = [str(peers), "platform", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        pytest.fail(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return json.loads(done.stdout)


def poses(answer) -> np.ndarray:
    """x, y, z, w of docktwin's quaternions becomes w, x, y, z."""
    return np.array(answer["poses"])[:, [0, 1, 2, 6, 3, 4, 5]]


def test_what_is_fixed_to_the_plate_is_one_body(models):
    """The file says what plate and payload are together."""
    plate = read_rig(models / "stewart.urdf").plate
    assert plate.mass_kg == pytest.approx(2500.0)
    np.testing.assert_allclose(plate.com_m, [-0.3, 0.0, 0.0], atol=1e-10)
    np.testing.assert_allclose(plate.inertia_kg_m2, np.diag([2800.0, 1600.0, 1600.0]), atol=1e-6)


def test_kinematics_close_the_loops_of_mujoco(models):
    """Joint angles from a pose of the plate bring every rod end to its joint."""
    rig = read_rig(models / "stewart.urdf")
    for hung in (False, True):
        p = Platform(rig, Settings(1e-3, plate_on_leg=hung))
        for t in TIMES_S:
            r_bp, p_bp = plate_pose(rig, trajectory(t))
            p.place(r_bp, p_bp)
            assert p.loop_error_m() < 1e-12
            np.testing.assert_allclose(p.pose()[:3], p_bp, atol=1e-12)


def test_oracle_statics(models, figure):
    """2500 kg on six legs, with and without their masses, standing still by closed form."""
    rig = read_rig(models / "stewart_statics.urdf")
    for what, r, want in (("legs", rig, 4787.55), ("no legs", massless(rig), 4568.27)):
        got, _ = platform.standing_forces(r)
        assert np.abs(got - want).max() < STATICS_N
        figure(f"{what}: {got.mean():.3f} N of {want} N, ± {np.ptp(got):.0e}")


def test_oracle_statics_of_legs_that_meet_in_a_point(models, figure):
    """Not turned by 60 degrees the pose is singular: equal forces are the least of many answers."""
    rig = massless(read_rig(models / "stewart_statics.urdf"))
    azimuths = np.radians([120.0 * (i // 2) + (12.0 if i % 2 else -12.0) for i in range(6)])
    legs = tuple(
        dataclasses.replace(leg, plate_joint_m=1.2 * np.array([0.0, np.cos(a), np.sin(a)]))
        for leg, a in zip(rig.legs, azimuths)
    )
    got, singular = platform.standing_forces(dataclasses.replace(rig, legs=legs))
    assert singular[-1] < 1e-9
    assert np.abs(got - 4291.68).max() < STATICS_N
    figure(f"{got.mean():.3f} N of 4291.68 N, least singular value {singular[-1]:.0e}")


def test_oracle_closed_loops_stand_still_under_these_forces(models, figure):
    """The same forces on the strokes of the closed mechanism: the plate stays, but for the sag of
    soft loops; a newton more can be seen."""
    rig = read_rig(models / "stewart_statics.urdf")
    held, _ = platform.standing_forces(rig)

    def way_m(more_n):
        p = Platform(rig, Settings(5e-4))
        p.place(*plate_pose(rig, np.zeros(6)))
        p.data.qfrc_applied[p.strokes] = held
        p.data.qfrc_applied[p.strokes[0]] += more_n
        found, _, _ = platform.run(p, 0.2, SAMPLE_S)
        return np.linalg.norm(found[:, :3] - found[0, :3], axis=1).max()

    still, moved = way_m(0.0), way_m(1.0)
    figure(f"{still:.1e} m in 0.2 s, {moved:.1e} m with 1 N more on a leg")
    assert still < STATICS_N * moved


def test_oracle_leg_forces_by_virtual_work(models, figure):
    """MuJoCo against the momentum of nineteen bodies, all six axes at full amplitude."""
    path = models / "stewart.urdf"
    got, want = forces(path)
    off = rms(got, want)
    figure(f"{off:.1e} RMS, limit {RMS:.0e}; up to {np.abs(want).max():.0f} N")
    assert off <= RMS
    # The legs' own masses are a good part of it: a side that forgets them does not pass.
    light = platform.leg_forces(massless(read_rig(path)), TIMES_S[::10])
    assert rms(light, want[::10]) > 10.0 * PROMISED_RMS


def test_leg_forces_of_docktwin(models, peers, figure):
    """The reduced rig's inverse dynamics against both."""
    path = models / "stewart.urdf"
    answer = peer(peers, "forces", path, "--until-s", TIMES_S[-1], "--sample-s", TIMES_S[1])
    assert answer["frequencies_hz"] == list(FREQUENCIES_HZ)
    _, p_bp = plate_pose(read_rig(path), trajectory(TIMES_S))
    np.testing.assert_allclose(poses(answer)[:, :3], p_bp, atol=1e-12)
    got = np.array(answer["forces_n"])
    for name, want in zip(("MuJoCo", "virtual work"), forces(path)):
        off = rms(got, want)
        figure(f"{name}: {off:.1e} RMS, limit {RMS:.0e} (promised {PROMISED_RMS:.0e})")
        assert off <= RMS


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_of_the_released_plate(models, peers, figure, name):
    """On leg springs from a corner, 2 s: both sides tend to the same motion, MuJoCo with the square of
    its step for the sake of its soft loops, ours with the square or, on stiff springs, faster."""
    corners, spring, least_m, limit = MOTIONS[name]
    path = models / "stewart.urdf"
    rig = read_rig(path)
    place = corners * CORNER

    def ours(step_ms):
        arguments = ["--place", ",".join(repr(float(x)) for x in place), "--step-ms", step_ms]
        arguments += ["--until-s", UNTIL_S, "--sample-s", SAMPLE_S]
        answer = peer(peers, "release", path, *arguments,
                      *(["--spring-n-m", spring] if spring else []))
        assert answer["spring_n_m"] == pytest.approx(spring or rig.oil_spring_n_m, rel=1e-12)
        return poses(answer)

    def theirs(step_ms, **settings):
        p = platform.released(rig, Settings(step_ms * 1e-3, **settings), place,
                              spring or rig.oil_spring_n_m)
        out, loop_m, _ = platform.run(p, UNTIL_S, SAMPLE_S)
        return out, loop_m

    truth = ours(0.02)
    assert np.ptp(truth[:, :3], axis=0).max() > least_m
    steps_ms = (2.0, 1.0, 0.5, 0.25)
    found = [theirs(h) for h in steps_ms]
    off = [apart(p, truth) for p, _ in found]
    figure("MuJoCo at " + ", ".join(
        f"{h} ms: {m:.1e} m, {a:.1e} rad, loops open by {loop:.0e} m"
        for h, (m, a), (_, loop) in zip(steps_ms, off, found)))
    assert all(3.0 < a / b < 7.0 for (a, _), (b, _) in zip(off, off[1:]))
    assert max(off[-1]) < limit
    assert max(apart(theirs(0.25, plate_on_leg=True)[0], truth)) < limit
    steps_ms = (0.5, 0.25, 0.125)
    own = [apart(ours(h), truth) for h in steps_ms]
    figure("docktwin at " + ", ".join(f"{h} ms: {m:.1e} m, {a:.1e} rad"
                                      for h, (m, a) in zip(steps_ms, own)))
    assert all(a > 3.0 * b for (a, _), (b, _) in zip(own, own[1:]))
