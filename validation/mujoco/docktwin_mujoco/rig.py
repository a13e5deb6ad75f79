"""The motion simulator from its URDF and TOML, and its kinematics, without the Rust side.

Frames: `b` the ground of the rig, `3` and `4` the mounting planes of the active and the passive
mechanism, `p` the plate. Angles of the file are degrees, radians here.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .models import _get, _inertial, _origin, _pose_in_root, _robot, _toml

# Of X, Y, Z, roll, pitch, yaw on the trajectory; the Rust side has the same.
FREQUENCIES_HZ = np.array([0.2, 0.33, 0.47, 0.61, 0.79, 1.0])


@dataclass(frozen=True)
class Part:
    """A rigid body: mass centre and inertia about it, in the frame of its link."""

    mass_kg: float
    com_m: np.ndarray
    inertia_kg_m2: np.ndarray


@dataclass(frozen=True)
class Leg:
    """Cross, cylinder and rod; their frames coincide in axes with the plate in the middle: +X along
    the leg, the cross turns about Z, the cylinder in it about Y, the rod slides along X."""

    name: str
    r_b_leg: np.ndarray
    base_joint_m: np.ndarray
    """In the ground."""
    middle_length_m: float
    """From base joint to plate joint with the plate in the middle."""
    plate_joint_m: np.ndarray
    """In the plate."""
    cross: Part
    cylinder: Part
    rod: Part


@dataclass(frozen=True)
class Rig:
    """Platform and docking workspace."""

    name: str
    gravity_m_s2: np.ndarray
    """In the ground."""
    plate: Part
    """With everything fixed to it, in `p`."""
    legs: tuple
    r_b3: np.ndarray
    p_b3_m: np.ndarray
    r_4p: np.ndarray
    p_4p_m: np.ndarray
    middle_p_34_m: np.ndarray
    half_widths: np.ndarray
    """Of the docking workspace: X, Y, Z, m, roll, pitch, yaw, rad."""
    oil_spring_n_m: float
    """K_h = 4 beta_e A^2 / V_t of the default preset."""

    def with_leg_masses_times(self, factor: float) -> "Rig":
        """The same rig with lighter or heavier legs."""
        def scaled(part):
            return Part(factor * part.mass_kg, part.com_m, factor * part.inertia_kg_m2)

        legs = tuple(
            dataclasses.replace(leg, cross=scaled(leg.cross), cylinder=scaled(leg.cylinder),
                                rod=scaled(leg.rod))
            for leg in self.legs
        )
        return dataclasses.replace(self, legs=legs)


def _lump(parts) -> Part:
    """Bodies in one frame as one: (part, r, p) each."""
    mass = sum(part.mass_kg for part, _, _ in parts)
    coms = [p + r @ part.com_m for part, r, p in parts]
    com = sum(part.mass_kg * c for (part, _, _), c in zip(parts, coms)) / mass
    inertia = np.zeros((3, 3))
    for (part, r, _), c in zip(parts, coms):
        d = c - com
        inertia += r @ part.inertia_kg_m2 @ r.T + part.mass_kg * (d @ d * np.eye(3) - np.outer(d, d))
    return Part(mass, com, inertia)


def _vector(text: str) -> np.ndarray:
    return np.array([float(x) for x in text.split()])


def _leg(path: Path, robot, links: dict, closure: dict) -> Leg:
    """The chain from the ground to the rod that a closure names."""
    above = {j.find("child").get("link"): j for j in robot.findall("joint")}
    rod = _get(closure, "rod")
    stroke = above[rod]
    tilt = above[stroke.find("parent").get("link")]
    swing = above[tilt.find("parent").get("link")]
    # The closed form of the joint angles below stands on this.
    wanted = (
        (swing, "revolute", [0, 0, 1]), (tilt, "revolute", [0, 1, 0]), (stroke, "prismatic", [1, 0, 0])
    )
    for joint, kind, axis in wanted:
        if joint.get("type") != kind or np.any(_vector(joint.find("axis").get("xyz")) != axis):
            raise ValueError(f"joint {joint.get('name')} must be {kind} about {axis}: {path}")
    r_tilt, p_tilt = _origin(tilt)
    r_stroke, p_stroke = _origin(stroke)
    straight = np.all(r_tilt == np.eye(3)) and np.all(r_stroke == np.eye(3))
    if not straight or np.any(p_tilt != 0.0) or np.any(p_stroke[1:] != 0.0):
        raise ValueError(f"axes of the leg of {rod} do not meet as in a universal joint: {path}")
    if np.any(np.array(_get(closure, "rod_point_m"), float) != 0.0):
        raise ValueError(f"the frame of {rod} must stand in its spherical joint: {path}")
    r, p = _origin(swing)
    parts = [Part(*_inertial(links[j.find("child").get("link")])) for j in (swing, tilt, stroke)]
    return Leg(rod, r, p, p_stroke[0], np.array(_get(closure, "plate_point_m"), float), *parts)


def read_rig(urdf: Path) -> Rig:
    """A rig from its URDF and the TOML beside it."""
    robot, links = _robot(urdf)
    beside = _toml(urdf.with_suffix(".toml"))
    if beside.get("kind") != "rig":
        raise ValueError(f"kind = \"rig\" expected: {urdf.with_suffix('.toml')}")
    named = {key: _get(beside["links"], key) for key in beside["links"]}
    plate = named["plate"]
    # The plate ends where a joint moves.
    fixed = _fixed_to(robot, plate)
    parts = []
    for name, (r, p) in fixed.items():
        if links[name].find("inertial") is not None:
            parts.append((Part(*_inertial(links[name])), r, p))
    _, r_b3, p_b3 = _pose_in_root(robot, named["active_mount"])
    _, r_bp, p_bp = _pose_in_root(robot, plate)
    r_p4, p_p4 = fixed[named["passive_mount"]]
    box, oil = beside["docking_workspace"], beside["hydraulics"]
    axial, lateral = _get(box, "axial_m"), _get(box, "lateral_m")
    roll, tilt = math.radians(_get(box, "roll_deg")), math.radians(_get(box, "pitch_yaw_deg"))
    volume = _get(oil[_get(oil, "default")], "total_volume_m3")
    rig = Rig(
        robot.get("name"),
        np.array(_get(beside["gravity"], "gravity_m_s2"), float),
        _lump(parts),
        tuple(_leg(urdf, robot, links, c) for c in beside["closures"]),
        r_b3, p_b3, r_p4.T, -r_p4.T @ p_p4,
        np.array(_get(box, "middle_p_34_m"), float),
        np.array([axial, lateral, lateral, roll, tilt, tilt]),
        4.0 * _get(oil, "bulk_modulus_pa") * _get(oil, "area_m2") ** 2 / volume,
    )
    # Joints at zero: the plate in the middle, and every rod at its joint.
    r, p = plate_pose(rig, np.zeros(6))
    if max(np.abs(r - r_bp).max(), np.abs(p - p_bp).max()) > 1e-9:
        raise ValueError(f"the plate does not stand in the middle of the docking workspace: {urdf}")
    if np.abs(leg_joints(rig, r, p)[0]).max() > 1e-9:
        raise ValueError(f"a rod does not reach its point of the plate with all joints at zero: {urdf}")
    return rig


def _fixed_to(robot, link: str) -> dict:
    """Poses in `link` of all that is fixed to it, itself included."""
    poses, grows = {link: (np.eye(3), np.zeros(3))}, True
    while grows:
        grows = False
        for j in robot.findall("joint"):
            parent, child = j.find("parent").get("link"), j.find("child").get("link")
            if j.get("type") == "fixed" and parent in poses and child not in poses:
                (r, p), (r_j, p_j) = poses[parent], _origin(j)
                poses[child], grows = (r @ r_j, r @ p_j + p), True
    return poses


# -- kinematics, for any number of instants at once ------------------------------------------------


def rotation(axis: int, angle) -> np.ndarray:
    """Matrices of rotations about a coordinate axis."""
    angle = np.asarray(angle, float)
    c, s = np.cos(angle), np.sin(angle)
    out = np.zeros(angle.shape + (3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., i, i] = out[..., j, j] = c
    out[..., i, j], out[..., j, i] = -s, s
    return out


def plate_pose(rig: Rig, place) -> tuple[np.ndarray, np.ndarray]:
    """Plate in the ground, `r_bp` and `p_bp`, at places of the docking workspace (X, Y, Z, roll,
    pitch, yaw in half-widths). Attitude by (1): pitch about Y, then yaw about Z, then roll about X."""
    x = np.asarray(place, float) * rig.half_widths
    r_34 = rotation(1, x[..., 4]) @ rotation(2, x[..., 5]) @ rotation(0, x[..., 3])
    p_34 = rig.middle_p_34_m + x[..., :3]
    return rig.r_b3 @ r_34 @ rig.r_4p, rig.p_b3_m + (p_34 + r_34 @ rig.p_4p_m) @ rig.r_b3.T


def trajectory(time_s) -> np.ndarray:
    """Places of the docking workspace in time: every axis over its full width, sin(2 pi f t)."""
    return np.sin(2.0 * np.pi * FREQUENCIES_HZ * np.asarray(time_s, float)[..., None])


def leg_joints(rig: Rig, r_bp, p_bp) -> tuple[np.ndarray, np.ndarray]:
    """Swing and tilt angle and stroke of every leg (..., 6, 3), rad and m from the middle, and the
    lengths from joint to joint (..., 6), m."""
    joints, lengths = [], []
    for leg in rig.legs:
        v = (p_bp + r_bp @ leg.plate_joint_m - leg.base_joint_m) @ leg.r_b_leg
        length = np.linalg.norm(v, axis=-1)
        swing = np.arctan2(v[..., 1], v[..., 0])
        tilt = np.arctan2(-v[..., 2], np.hypot(v[..., 0], v[..., 1]))
        joints.append(np.stack([swing, tilt, length - leg.middle_length_m], axis=-1))
        lengths.append(length)
    return np.stack(joints, axis=-2), np.stack(lengths, axis=-1)


# Central differences of sixth order: weights of the first and second derivative.
_FIRST = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60.0
_SECOND = np.array([2, -27, 270, -490, 270, -27, 2]) / 180.0


def derivatives(f, at, step):
    """Value, first and second derivative of an array-valued function of arrays, by sixth-order
    central differences."""
    at = np.asarray(at, float)
    values = [np.asarray(f(at + k * step)) for k in range(-3, 4)]
    first = sum(w * v for w, v in zip(_FIRST, values)) / step
    second = sum(w * v for w, v in zip(_SECOND, values)) / step**2
    return values[3], first, second


def vee(m) -> np.ndarray:
    """Vector of the skew part of matrices."""
    m = 0.5 * (m - np.swapaxes(m, -1, -2))
    return np.stack([m[..., 2, 1], m[..., 0, 2], m[..., 1, 0]], axis=-1)
