"""URDF and TOML to numbers, read without the Rust side.

A number in a TOML file is `{ value = ..., source|assumed = "..." }`; angles are degrees in files
and radians here. Only what the cross-check needs is read.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .contact import Side
from .law import ContactLaw, Friction, HuntCrossley, KelvinVoigt


@dataclass(frozen=True)
class Spacecraft:
    """A rigid body; its frame stands at its mass centre."""

    name: str
    mass_kg: float
    inertia_kg_m2: np.ndarray
    r_body_port: np.ndarray
    p_body_port_m: np.ndarray


@dataclass(frozen=True)
class Petals:
    """As `[petals]` of a mechanism file."""

    count: int
    first_azimuth_rad: float
    base_radius_m: float
    tip_radius_m: float
    height_m: float
    base_half_angle_rad: float
    tip_half_angle_rad: float
    thickness_m: float
    flexural_rigidity_n_m2: float


@dataclass(frozen=True)
class RingBody:
    """The active ring with its petals and latches, in the active ring frame."""

    mass_kg: float
    inertia_kg_m2: np.ndarray
    com_m: np.ndarray


@dataclass(frozen=True)
class Channel:
    """One channel of an attenuator; m and N, or rad and N m."""

    loading: tuple
    unloading: tuple
    branch_change: float
    damping_before: float
    damping_after: float
    dry_friction: float
    travel_negative: float
    travel_positive: float
    stop_stiffness: float
    stop_damping: float
    brake: tuple | None
    """Force and viscous part of a brake in series."""


@dataclass(frozen=True)
class Attenuation:
    """What carries the ring: `characteristic` (axial, lateral, roll, tilt) or `differential` (six
    brake coordinates with legs and coupling)."""

    kind: str
    ramp_s: float
    channels: tuple
    base_joints_m: np.ndarray | None = None
    ring_joints_m: np.ndarray | None = None
    coupling: np.ndarray | None = None


@dataclass(frozen=True)
class Latches:
    """As `[latches]` of a mechanism file."""

    azimuths_rad: tuple
    axes: str
    approach_gap_m: float
    strike_gap_m: float
    catch_gap_m: float
    radial_zone_m: float
    tangential_zone_m: float
    hold_stiffness_n_m: float
    joined_stiffness_n_m: float
    joined_damping_n_s_m: float


@dataclass(frozen=True)
class Mechanism:
    """Both sides, their placement on the mounting planes, and the law between them."""

    active: Side
    passive: Side
    ring_body: RingBody
    r_mount_active: np.ndarray
    p_mount_active_m: np.ndarray
    r_mount_passive: np.ndarray
    p_mount_passive_m: np.ndarray
    law: ContactLaw
    attenuation: Attenuation | None = None
    """None: rigid."""
    latches: Latches | None = None
    own_latches: tuple = ()
    """As `[[latch]]`, tables with plain numbers."""
    captured_when: str = "all"
    limits: dict = dataclasses.field(default_factory=dict)
    rules: dict = dataclasses.field(default_factory=dict)


def rotation_rpy(rpy) -> np.ndarray:
    """URDF's fixed-axis roll, pitch, yaw: Rz(yaw) Ry(pitch) Rx(roll)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return rz @ ry @ rx


def _origin(element):
    o = None if element is None else element.find("origin")
    if o is None:
        return np.eye(3), np.zeros(3)
    xyz = np.array([float(x) for x in o.get("xyz", "0 0 0").split()])
    rpy = np.array([float(x) for x in o.get("rpy", "0 0 0").split()])
    return rotation_rpy(rpy), xyz


def _inertial(link):
    """Mass, mass centre and inertia about it in the axes of the link."""
    el = link.find("inertial")
    r, p = _origin(el)
    i = {k: float(v) for k, v in el.find("inertia").attrib.items()}
    m = np.array(
        [
            [i["ixx"], i.get("ixy", 0.0), i.get("ixz", 0.0)],
            [i.get("ixy", 0.0), i["iyy"], i.get("iyz", 0.0)],
            [i.get("ixz", 0.0), i.get("iyz", 0.0), i["izz"]],
        ]
    )
    return float(el.find("mass").get("value")), p, r @ m @ r.T


def _pose_in_root(robot, link: str):
    """Root link and the pose of `link` in it, every joint at zero."""
    parents = {
        j.find("child").get("link"): (j.find("parent").get("link"), _origin(j))
        for j in robot.findall("joint")
    }
    r, p = np.eye(3), np.zeros(3)
    while link in parents:
        link, (r_j, p_j) = parents[link]
        r, p = r_j @ r, r_j @ p + p_j
    return link, r, p


def _robot(path: Path):
    robot = ET.parse(path).getroot()
    return robot, {link.get("name"): link for link in robot.findall("link")}


def _toml(path: Path) -> dict:
    with path.open("rb") as f:
        return tomllib.load(f)


def _value(entry):
    """The number of an entry, with or without its note."""
    return entry["value"] if isinstance(entry, dict) and "value" in entry else entry


def _get(table: dict, key: str):
    return _value(table[key])


def read_spacecraft(urdf: Path) -> Spacecraft:
    """A spacecraft from its URDF and the TOML beside it."""
    robot, links = _robot(urdf)
    beside = _toml(urdf.with_suffix(".toml"))
    root, r, p = _pose_in_root(robot, _value(beside.get("port_link", "port")))
    heavy = [n for n, link in links.items() if link.find("inertial") is not None]
    if heavy != [root]:
        raise ValueError(f"one inertial, on the root link {root}, expected; found {heavy}: {urdf}")
    mass, com, inertia = _inertial(links[root])
    return Spacecraft(robot.get("name"), mass, inertia, r, p - com)


@dataclass(frozen=True)
class Surface:
    """As `[[surface]]`: a core with a ball swept over it, its frame in the ring frame of its side."""

    name: str
    kind: str
    r: np.ndarray
    p: np.ndarray
    rounding_m: float
    sizes: dict
    stiffness_n_m: float
    friction: float

    def top_m(self) -> float:
        """How far it reaches along X of the ring frame."""
        axis = self.r[:, 0]
        if self.kind == "sphere":
            far = 0.0
        elif self.kind == "capsule":
            far = 0.5 * self.sizes["length_m"] * abs(axis[0])
        else:
            across = math.hypot(axis[1], axis[2])
            points = self.sizes.get("profile_m", [[0.0, self.sizes.get("core_radius_m", 0.0)]])
            far = max(x * axis[0] + rho * across for x, rho in points)
        return float(self.p[0] + far + self.rounding_m)


KINDS = ("sphere", "capsule", "torus", "hollow")


def _surfaces(table: dict, robot) -> tuple:
    _, r_ring, p_ring = _pose_in_root(robot, "ring")
    out = []
    for t in table.get("surface", []):
        if t["kind"] not in KINDS:
            raise ValueError(f"surfaces of kind {t['kind']} are not written here: {', '.join(KINDS)}")
        _, r_link, p_link = _pose_in_root(robot, t["link"])
        r = r_ring.T @ r_link
        p = r_ring.T @ (p_link - p_ring) + r @ np.array(_get(t, "position_m"), float)
        r = r @ rotation_rpy(np.radians(_get(t, "rpy_deg")))
        sizes = {key: _get(t, key) for key in ("length_m", "core_radius_m", "profile_m") if key in t}
        out.append(Surface(
            t["name"], t["kind"], r, p, float(_get(t, "rounding_m")), sizes,
            float(_get(t, "stiffness_n_m")), float(_get(t, "friction")),
        ))
    return tuple(out)


def _side(table: dict, robot) -> Side:
    surfaces = _surfaces(table, robot)
    if "ring" not in table:
        radius = _get(table["placement"], "reference_radius_m")
        return Side(radius, 0.0, None, False, surfaces)
    if surfaces:
        raise ValueError("listed surfaces beside a ring are not written here")
    ring = table["ring"]
    petals = table.get("petals")
    if petals is not None:
        petals = Petals(
            count=int(_get(petals, "count")),
            first_azimuth_rad=math.radians(_get(petals, "first_azimuth_deg")),
            base_radius_m=_get(petals, "base_radius_m"),
            tip_radius_m=_get(petals, "tip_radius_m"),
            height_m=_get(petals, "height_m"),
            base_half_angle_rad=math.radians(_get(petals, "base_half_angle_deg")),
            tip_half_angle_rad=math.radians(_get(petals, "tip_half_angle_deg")),
            thickness_m=_get(petals, "thickness_m"),
            flexural_rigidity_n_m2=_get(petals, "flexural_rigidity_n_m2"),
        )
    return Side(_get(ring, "mean_radius_m"), _get(ring, "section_radius_m"), petals)


def _law(table: dict) -> ContactLaw:
    kind = _get(table, "normal_law")
    k = _get(table, "stiffness_n_m")
    if kind == "hunt_crossley":
        normal = HuntCrossley(k, float(_get(table, "exponent")), _get(table, "damping_s_m"))
    elif kind == "kelvin_voigt":
        normal = KelvinVoigt(k, _get(table, "damping_n_s_m"))
    else:
        raise ValueError(f"unknown normal_law {kind!r}: hunt_crossley or kelvin_voigt")
    friction = Friction(
        kinetic=_get(table, "friction_kinetic"),
        static=_get(table, "friction_static"),
        stribeck_velocity_m_s=_get(table, "stribeck_velocity_m_s"),
        bristle_breakaway_m=_get(table, "bristle_breakaway_m"),
        bristle_damping_s=_get(table, "bristle_damping_s"),
    )
    return ContactLaw(
        normal,
        friction if friction.kinetic > 0.0 or friction.static > 0.0 else None,
        _get(table, "merge_depth_m"),
    )


def _channel(t: dict, angular: bool) -> Channel:
    force, rate = ("nm", "nm_s_rad") if angular else ("n", "n_s_m")
    x, scale = ("deg", math.pi / 180.0) if angular else ("m", 1.0)
    over = "rad" if angular else "m"
    brake = t.get("series_brake")
    if "backlash" in t:
        raise ValueError("a channel has `backlash`, which this engine does not know: leave it out")
    return Channel(
        tuple(map(tuple, _get(t, f"loading_{force}_over_{over}"))),
        tuple(map(tuple, _get(t, f"unloading_{force}_over_{over}"))),
        _get(t, f"branch_change_{x}") * scale,
        _get(t, f"damping_before_capture_{rate}"),
        _get(t, f"damping_after_capture_{rate}"),
        _get(t, f"dry_friction_{force}"),
        _get(t, f"travel_negative_{x}") * scale,
        _get(t, f"travel_positive_{x}") * scale,
        _get(t, "stop_stiffness_nm_rad" if angular else "stop_stiffness_n_m"),
        _get(t, f"stop_damping_{rate}"),
        None if brake is None else (
            _get(brake, f"force_{force}"), _get(brake, f"viscous_{rate}")
        ),
    )


def _attenuation(table: dict, kind: str | None) -> Attenuation | None:
    kind = kind or _get(table, "default")
    if kind == "rigid":
        return None
    ramp = _get(table, "damping_ramp_s")
    t = table[kind]
    if kind == "characteristic":
        parts = [("axial", False), ("lateral", False), ("roll", True), ("tilt", True)]
        return Attenuation(kind, ramp, tuple(_channel(t[n], a) for n, a in parts))
    if kind == "differential":
        return Attenuation(
            kind, ramp, tuple(_channel(c, False) for c in t["channels"]),
            np.array(_get(t, "base_joints_m")), np.array(_get(t, "ring_joints_m")),
            np.array(_get(t, "coupling")),
        )
    raise ValueError(f"unknown attenuation {kind!r}: characteristic, differential or rigid")


def _latches(table: dict | None) -> Latches | None:
    if table is None:
        return None
    if "catch_delay_s" in table and float(_get(table, "catch_delay_s")) > 0.0:
        raise ValueError("`latches.catch_delay_s` is not known to this engine: leave it out")
    names = [f.name for f in dataclasses.fields(Latches) if f.name not in ("azimuths_rad", "axes")]
    return Latches(
        tuple(math.radians(a) for a in _get(table, "azimuths_deg")),
        table.get("axes", "active"),
        **{n: float(_get(table, n)) for n in names},
    )


def read_mechanism(
    active_urdf: Path, passive_urdf: Path, contact: dict | None = None, petals: bool = True,
    attenuation: str | None = None,
) -> Mechanism:
    """Both sides of a mechanism; placements come from the URDF and must agree with the TOML.
    `contact` replaces keys of the law, `petals=False` leaves bare rings, `attenuation` names another
    model than the file's default."""
    a, b = _toml(active_urdf.with_suffix(".toml")), _toml(passive_urdf.with_suffix(".toml"))
    (robot_a, links_a), (robot_b, _) = _robot(active_urdf), _robot(passive_urdf)
    _, r_a, p_a = _pose_in_root(robot_a, "ring")
    _, r_b, p_b = _pose_in_root(robot_b, "ring")
    offsets = (
        (p_a[0], _get(a["placement"], "ring_rest_offset_m"), active_urdf),
        (-p_b[0], _get(b["placement"], "passive_ring_offset_m"), passive_urdf),
    )
    for got, want, path in offsets:
        if abs(got - want) > 1e-12:
            raise ValueError(f"ring at {got} m in the URDF, {want} m in the TOML: {path}")
    mass, com, inertia = _inertial(links_a["ring"])
    body = a["ring_body"]
    if abs(mass - _get(body, "mass_kg")) > 1e-12 * mass or np.abs(
        inertia - np.array(_get(body, "inertia_kg_m2"))
    ).max() > 1e-12 * np.abs(inertia).max():
        raise ValueError(f"ring masses of URDF and TOML differ: {active_urdf}")
    sides = (_side(a, robot_a), _side(b, robot_b))
    if not petals:
        sides = tuple(dataclasses.replace(s, petals=None) for s in sides)
    return Mechanism(
        *sides, RingBody(mass, inertia, com), r_a, p_a, r_b, p_b,
        _law({**a["contact"], **(contact or {})}),
        _attenuation(a["attenuation"], attenuation),
        _latches(a.get("latches")),
        tuple({key: _value(v) for key, v in t.items()} for t in a.get("latch", [])),
        a.get("captured_when", "all"),
        {key: float(_value(v)) for key, v in a["limits"].items()},
        {key: float(_value(v)) for key, v in a["outcome"].items()},
    )
