"""Docking with MuJoCo's own contact solver: a contact is a spring of k N/m when its reference
acceleration is k/m_eff times its depth, with the effective mass at that contact."""

from __future__ import annotations

import time
from dataclasses import dataclass

import mujoco
import numpy as np

from . import docking, shapes
from .scene import rotation

# As near to a hard constraint as the regularisation allows: the spring is k times this.
IMPEDANCE = 0.9999


def model(scene, step_s: float, capsules: int, strips: int, stiffness_per_mass: float,
          integrator: str = "RK4", friction: float = 0.0, states: bool = True):
    """The scene with collision shapes and MuJoCo's solver; law and attenuator of the kernel are not
    part of it, but its activation states are, so that the kernel may carry the ring."""
    solver = (
        f'solref="{-stiffness_per_mass!r} 0" '
        f'solimp="{IMPEDANCE!r} {IMPEDANCE!r} 1e-12 0.5 1" '
    )
    solver += f'condim="3" friction="{friction!r} 0 0"' if friction else 'condim="1"'
    attributes = lambda radius: f'margin="{radius!r}" gap="0" {solver}'  # noqa: E731
    m = scene.mechanism
    if m.attenuation is None:
        c = scene.chaser
        r1 = c.r_body_port @ m.r_mount_active
        p1 = c.p_body_port_m + c.r_body_port @ m.p_mount_active_m
        carrier = "chaser"
    else:
        r1, p1, carrier = np.eye(3), np.zeros(3), "ring"
    t = scene.target
    r2 = t.r_body_port @ m.r_mount_passive
    p2 = t.p_body_port_m + t.r_body_port @ m.p_mount_passive_m
    g1, a1 = shapes.side(m.active, "a", r1, p1, capsules, strips, attributes)
    g2, a2 = shapes.side(m.passive, "b", r2, p2, capsules, strips, attributes)
    xml = docking.mjcf(
        scene, step_s, {carrier: g1, "target": g2}, 'solver="Newton" tolerance="1e-12"',
        f"<asset>{a1}{a2}</asset>", "enable", integrator,
    )
    if not states:
        i = xml.index("<actuator>")
        xml = xml[:i] + "</mujoco>"
    return mujoco.MjModel.from_xml_string(xml)


@dataclass
class Impact:
    """What a single-point impact gave."""

    peak_n: float
    exit_m_s: np.ndarray
    """Velocity of the passive ring's centre against the active one's, world."""
    target_impulse_ns: np.ndarray
    most_contacts: int
    step_us: float


def effective_mass(scene, data, point, normal, with_ring):
    """Seen along the normal at a point, both bodies free, kg. `with_ring`: mass properties of the
    chaser with its rigid ring."""
    inverse = 0.0
    for name, (mass, com, inertia) in (
        ("chaser", with_ring),
        ("target", (scene.target.mass_kg, np.zeros(3), scene.target.inertia_kg_m2)),
    ):
        body = data.body(name)
        r = body.xmat.reshape(3, 3)
        arm = r.T @ (point - body.xpos) - com
        turn = np.cross(arm, r.T @ normal)
        inverse += 1.0 / mass + turn @ np.linalg.solve(inertia, turn)
    return 1.0 / inverse


def chaser_with_ring(scene):
    """Mass, mass centre and inertia about it of chaser and rigid ring, chaser's axes."""
    c, m = scene.chaser, scene.mechanism
    ring = m.ring_body
    r = c.r_body_port @ m.r_mount_active
    at = c.p_body_port_m + c.r_body_port @ m.p_mount_active_m + r @ ring.com_m
    mass = c.mass_kg + ring.mass_kg
    com = at * ring.mass_kg / mass

    def steiner(x):
        return (x @ x) * np.eye(3) - np.outer(x, x)

    inertia = (
        c.inertia_kg_m2 + c.mass_kg * steiner(com)
        + r @ ring.inertia_kg_m2 @ r.T + ring.mass_kg * steiner(at - com)
    )
    return mass, com, inertia


def impact(scene, states, duration_s: float, step_s: float = 5e-4, capsules: int = 384,
           strips: int = 48) -> Impact:
    """A rigid, frictionless, elastic impact. The stiffness at the place follows the law's series of
    surface and bending petals; with the effective mass it is set anew at every step."""
    law, mech = scene.mechanism.law, scene.mechanism
    m = model(scene, step_s, capsules, strips, 1.0, states=False)
    d = mujoco.MjData(m)
    for name in ("chaser", "target"):
        docking.set_state(m, d, name, states[name])
    # `solref` of all geoms at once: there is one place.
    with_ring = chaser_with_ring(scene)
    petal_of = np.array([
        _petal(mech, m.geom(i).name) for i in range(m.ngeom)
    ], dtype=object)
    peak, most, steps = 0.0, 0, 0
    before = np.concatenate([d.qvel[6:9]])
    begin = time.process_time()
    while d.time < duration_s - 1e-9:
        mujoco.mj_step1(m, d)
        if d.ncon:
            c = min(d.contact, key=lambda c: c.dist - c.includemargin)
            normal = c.frame[:3]
            k = 1.0 / law.normal.stiffness
            for g in c.geom:
                if petal_of[g] is not None:
                    petals, side = petal_of[g]
                    s = _along(scene, d, side, petals, c.pos)
                    k += s**3 / (3.0 * petals.flexural_rigidity_n_m2)
            mass = effective_mass(scene, d, c.pos, normal, with_ring)
            m.geom_solref[:, 0] = -1.0 / (k * mass)
        mujoco.mj_step(m, d)
        steps += 1
        if d.nefc:
            most = max(most, d.ncon)
            # Sum of the contact forces on the target as a vector.
            f = np.zeros(3)
            six = np.zeros(6)
            for i in range(d.ncon):
                mujoco.mj_contactForce(m, d, i, six)
                f += d.contact[i].frame.reshape(3, 3).T @ six[:3]
            peak = max(peak, float(np.linalg.norm(f)))
    spent = time.process_time() - begin
    p1 = scene.chaser.p_body_port_m + scene.chaser.r_body_port @ mech.p_mount_active_m
    p2 = scene.target.p_body_port_m + scene.target.r_body_port @ mech.p_mount_passive_m
    r1, r2 = rotation(d.qpos[3:7]), rotation(d.qpos[10:14])
    v1 = d.qvel[0:3] + r1 @ np.cross(d.qvel[3:6], p1)
    v2 = d.qvel[6:9] + r2 @ np.cross(d.qvel[9:12], p2)
    return Impact(
        peak, v2 - v1, scene.target.mass_kg * (d.qvel[6:9] - before), most, 1e6 * spent / steps
    )


def _petal(mech, name: str):
    if "petal" not in name:
        return None
    return (mech.active.petals, "a") if name.startswith("a") else (mech.passive.petals, "b")


def _along(scene, data, side, petals, point):
    """Distance of a point from the petal's root along its rulings, m."""
    craft, mech = (scene.chaser, scene.mechanism) if side == "a" else (scene.target, scene.mechanism)
    body = data.body("chaser" if side == "a" else "target")
    r_m, p_m = (
        (mech.r_mount_active, mech.p_mount_active_m) if side == "a"
        else (mech.r_mount_passive, mech.p_mount_passive_m)
    )
    r = body.xmat.reshape(3, 3) @ craft.r_body_port
    local = r_m.T @ (r.T @ (point - body.xpos - body.xmat.reshape(3, 3) @ craft.p_body_port_m) - p_m)
    slope = np.array([petals.height_m, petals.tip_radius_m - petals.base_radius_m])
    length = np.linalg.norm(slope)
    at = np.array([local[0], np.hypot(local[1], local[2]) - petals.base_radius_m])
    return float(np.clip(at @ slope / length, 0.0, length))
