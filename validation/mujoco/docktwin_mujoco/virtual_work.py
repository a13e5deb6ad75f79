"""Leg forces of a moving platform by virtual work: the momentum of all nineteen bodies, and how each
of them moves when the plate does. Nothing but numpy and the kinematics of `rig.py`."""

from __future__ import annotations

import numpy as np

from .rig import Part, Rig, derivatives, leg_joints, plate_pose, rotation, trajectory, vee

# Steps of the central differences, s and m or rad: rounding and truncation both below 1e-9.
TIME_STEP_S, VIRTUAL_STEP = 4e-3, 2e-3


def parts(rig: Rig) -> list[Part]:
    """In the order of `motion`: the plate, then cross, cylinder and rod of every leg."""
    return [rig.plate] + [b for leg in rig.legs for b in (leg.cross, leg.cylinder, leg.rod)]


def motion(rig: Rig, r_bp, p_bp):
    """Attitudes (..., 19, 3, 3) and mass centres (..., 19, 3) in the ground, and leg lengths."""
    joints, lengths = leg_joints(rig, r_bp, p_bp)
    r, p = [r_bp], [p_bp + r_bp @ rig.plate.com_m]
    for i, leg in enumerate(rig.legs):
        swing, tilt = joints[..., i, 0], joints[..., i, 1]
        cross = leg.r_b_leg @ rotation(2, swing)
        cylinder = cross @ rotation(1, tilt)
        tip = leg.base_joint_m + cylinder[..., :, 0] * lengths[..., i, None]
        r += [cross, cylinder, cylinder]
        p += [
            leg.base_joint_m + cross @ leg.cross.com_m,
            leg.base_joint_m + cylinder @ leg.cylinder.com_m,
            tip + cylinder @ leg.rod.com_m,
        ]
    return np.stack(r, axis=-3), np.stack(p, axis=-2), lengths


def leg_forces(rig: Rig, times_s) -> np.ndarray:
    """Leg forces (n, 6), N, along the trajectory; positive when a leg pushes."""
    times_s = np.asarray(times_s, float)
    bodies = parts(rig)
    mass = np.array([b.mass_kg for b in bodies])
    inertia = np.stack([b.inertia_kg_m2 for b in bodies])

    def along(t):
        return motion(rig, *plate_pose(rig, trajectory(t)))

    r = along(times_s)[0]
    _, _, a = derivatives(lambda t: along(t)[1], times_s, TIME_STEP_S)

    def spin(t):
        r, r_rate, _ = derivatives(lambda s: along(s)[0], t, TIME_STEP_S)
        w = vee(np.swapaxes(r, -1, -2) @ r_rate)
        return np.einsum("...ij,...jk,...k->...i", r, inertia, w)

    # Rates of momentum less weight, and of angular momentum about each mass centre.
    force = mass[:, None] * (a - rig.gravity_m_s2)
    _, moment, _ = derivatives(spin, times_s, TIME_STEP_S)

    r_bp, p_bp = plate_pose(rig, trajectory(times_s))
    work, lengths = [], []
    for k in range(6):
        def moved(x, k=k):
            if k < 3:
                return motion(rig, r_bp, p_bp + x * np.eye(3)[k])
            return motion(rig, rotation(k - 3, x) @ r_bp, p_bp)

        _, turn, _ = derivatives(lambda x: moved(x)[0], 0.0, VIRTUAL_STEP)
        _, shift, _ = derivatives(lambda x: moved(x)[1], 0.0, VIRTUAL_STEP)
        _, longer, _ = derivatives(lambda x: moved(x)[2], 0.0, VIRTUAL_STEP)
        turn = vee(turn @ np.swapaxes(r, -1, -2))
        work.append(np.sum(force * shift + moment * turn, axis=(-1, -2)))
        lengths.append(longer)
    # Sum over legs of F dL equals the work of what moves, for each of six displacements.
    return np.linalg.solve(np.stack(lengths, axis=-2), np.stack(work, axis=-1)[..., None])[..., 0]
