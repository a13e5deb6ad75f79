"""Geometry and weights of a rig file, as far as an ideal plate needs them."""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ET

import numpy as np


def multiply(a, b):
    """Product of quaternions w, x, y, z."""
    v = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], v])


def conjugate(q):
    """Of a quaternion w, x, y, z."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotation(q):
    """Matrix of a unit quaternion w, x, y, z."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(rpy):
    """Of roll, pitch, yaw as URDF has them."""
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in zip((2, 1, 0), reversed(list(rpy))):
        turn = np.zeros(4)
        turn[0], turn[1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
        q = multiply(q, turn)
    return q


def compose(a, b):
    """`X_AC` of `X_AB` and `X_BC`, each position and quaternion."""
    return a[0] + rotation(a[1]) @ b[0], multiply(a[1], b[1])


def inverse(x):
    """`X_BA` of `X_AB`."""
    q = conjugate(x[1])
    return -rotation(q) @ x[0], q


class RigFile:
    """A rig's URDF with the TOML beside it."""

    def __init__(self, urdf):
        robot = ET.parse(urdf).getroot()
        with open(urdf.with_suffix(".toml"), "rb") as file:
            toml = tomllib.load(file)
        joints = {j.find("child").get("link"): j for j in robot.findall("joint")}
        links = {link.get("name"): link for link in robot.findall("link")}
        names = toml["links"]

        def origin(link):
            at = joints[link].find("origin")
            numbers = [[float(x) for x in at.get(k).split()] for k in ("xyz", "rpy")]
            return np.array(numbers[0]), quaternion(numbers[1])

        def carried(link):
            inertial = links[link].find("inertial")
            com = [float(x) for x in inertial.find("origin").get("xyz").split()]
            return float(inertial.find("mass").get("value")), np.array(com)

        self.x_b3 = compose(origin(names["rack"]), origin(names["active_mount"]))
        self.x_p4 = origin(names["passive_mount"])
        self.x_4p = inverse(self.x_p4)
        self.q_b3 = self.x_b3[1]
        self.middle_p_34 = np.array(toml["docking_workspace"]["middle_p_34_m"]["value"])
        self.gravity = np.array(toml["gravity"]["gravity_m_s2"]["value"])
        self.carried = [carried(names["active_mount"]), carried(names["passive_mount"])]
        rods = [c["rod"] for c in toml["closures"]]
        parents = {child: j.find("parent").get("link") for child, j in joints.items()}
        self.plate_joints = np.array([c["plate_point_m"]["value"] for c in toml["closures"]])
        # The first link of a leg stands in its base joint; its parent is the ground.
        self.base_joints = np.array([self._base(rod, parents, origin, names) for rod in rods])

    @staticmethod
    def _base(link, parents, origin, names):
        while parents[link] != names["ground"]:
            link = parents[link]
        return origin(link)[0]

    def plate_in_the_middle(self):
        """`X_bp` with the mechanisms in the middle of the docking workspace."""
        x_34 = (self.middle_p_34, np.array([1.0, 0.0, 0.0, 0.0]))
        return compose(compose(self.x_b3, x_34), self.x_4p)

    def docking(self, p, q):
        """`X_34` of a pose of the plate."""
        return compose(compose(inverse(self.x_b3), (p, q)), self.x_p4)

    def legs(self, p, q, v, w):
        """Lengths, m, and their rates, m/s."""
        arms = self.plate_joints @ rotation(q).T
        legs = p + arms - self.base_joints
        lengths = np.linalg.norm(legs, axis=1)
        speeds = np.einsum("ij,ij->i", v + np.cross(w, arms), legs) / lengths
        return lengths, speeds

    def weight_a(self):
        """What sensor A measures of the weight it carries, about `e3`, in `e3`."""
        mass, com = self.carried[0]
        force = mass * rotation(self.q_b3).T @ self.gravity
        return np.concatenate([force, np.cross(com, force)])

    def specific_force_at_b(self, q, acceleration):
        """Specific force at `e4`, in `e4`: what an accelerometer measures; the plate does not turn fast."""
        turned = rotation(multiply(q, self.x_p4[1])).T
        return turned @ (acceleration - self.gravity)

    def weight_b(self, q, acceleration):
        """What sensor B measures of weight and inertia, about `e4`, in `e4`; the plate does not turn fast."""
        mass, com = self.carried[1]
        force = -mass * self.specific_force_at_b(q, acceleration)
        return np.concatenate([force, np.cross(com, force)])
