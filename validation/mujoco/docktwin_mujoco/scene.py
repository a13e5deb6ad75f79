"""Free bodies in MuJoCo, with the contact wrench as a generalised force at every RK4 stage.

`xfrc_applied` would be held over the four stages of a step. The passive-force callback is called
in each of them, so the law is integrated with the order of the integrator; bristles and the
running integrals (impulse) are activation states of MuJoCo, integrated beside the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco
import numpy as np

from .contact import Contact
from .models import Mechanism, RingBody, Spacecraft


@dataclass
class State:
    """Of one body: position of its frame (m), attitude world-from-body (w, x, y, z), velocity of
    the frame's origin in the world (m/s), rate in body axes (rad/s)."""

    p: np.ndarray
    q: np.ndarray
    v: np.ndarray
    w: np.ndarray


def _numbers(values) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _inertial(mass, com, inertia) -> str:
    i = np.asarray(inertia)
    six = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return f'<inertial pos="{_numbers(com)}" mass="{mass!r}" fullinertia="{_numbers(six)}"/>'


@dataclass
class Body:
    """A free body and a rigid part it may carry: (mass, mass centre, inertia, r, p)."""

    name: str
    mass_kg: float
    inertia_kg_m2: np.ndarray
    carries: list = field(default_factory=list)

    @classmethod
    def of(cls, name: str, craft: Spacecraft) -> "Body":
        """The bare spacecraft."""
        return cls(name, craft.mass_kg, craft.inertia_kg_m2)

    def with_ring(self, craft: Spacecraft, mech: Mechanism) -> "Body":
        """The spacecraft with the active ring fixed to it."""
        r = craft.r_body_port @ mech.r_mount_active
        p = craft.p_body_port_m + craft.r_body_port @ mech.p_mount_active_m
        self.carries.append((mech.ring_body, r, p))
        return self

    def mjcf(self) -> str:
        """The body as an MJCF element."""
        inner = ""
        for i, (part, r, p) in enumerate(self.carries):
            assert isinstance(part, RingBody)
            q = np.empty(4)
            mujoco.mju_mat2Quat(q, r.ravel())
            inner += (
                f'<body name="{self.name}_part{i}" pos="{_numbers(p)}" quat="{_numbers(q)}">'
                f"{_inertial(part.mass_kg, part.com_m, part.inertia_kg_m2)}</body>"
            )
        return (
            f'<body name="{self.name}"><freejoint name="{self.name}"/>'
            f"{_inertial(self.mass_kg, np.zeros(3), self.inertia_kg_m2)}{inner}</body>"
        )


def build(bodies, timestep_s: float, states: int = 0, gravity=(0.0, 0.0, 0.0)):
    """A model of free bodies, RK4, with `states` user-defined activation states."""
    actuators = "".join(
        f'<general name="s{i}" joint="{bodies[0].name}" gear="1 0 0 0 0 0" dyntype="user" '
        f'gaintype="fixed" gainprm="0" biastype="none"/>'
        for i in range(states)
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler autolimits="true" balanceinertia="false" boundmass="0" '
        f'boundinertia="0"/>'
        f'<option integrator="RK4" timestep="{timestep_s!r}" gravity="{_numbers(gravity)}">'
        f'<flag contact="disable"/></option>'
        f'<worldbody>{"".join(b.mjcf() for b in bodies)}</worldbody>'
        f"<actuator>{actuators}</actuator></mujoco>"
    )


def set_state(model, data, name: str, s: State) -> None:
    """Puts a free body somewhere."""
    j = model.joint(name)
    q, v = j.qposadr[0], j.dofadr[0]
    data.qpos[q : q + 3] = s.p
    data.qpos[q + 3 : q + 7] = np.asarray(s.q) / np.linalg.norm(s.q)
    data.qvel[v : v + 3] = s.v
    data.qvel[v + 3 : v + 6] = s.w


def get_state(model, data, name: str) -> State:
    """Where a free body is."""
    j = model.joint(name)
    q, v = j.qposadr[0], j.dofadr[0]
    return State(
        data.qpos[q : q + 3].copy(),
        data.qpos[q + 3 : q + 7].copy(),
        data.qvel[v : v + 3].copy(),
        data.qvel[v + 3 : v + 6].copy(),
    )


def rotation(q) -> np.ndarray:
    """Matrix of a quaternion (w, x, y, z)."""
    m = np.empty(9)
    mujoco.mju_quat2Mat(m, np.asarray(q, dtype=float))
    return m.reshape(3, 3)


def angle_between(q1, q2) -> float:
    """Angle of the rotation from one attitude to the other, rad; exact for small ones."""
    a, b = np.asarray(q1, float), np.asarray(q2, float)
    conj = np.array([a[0], -a[1], -a[2], -a[3]])
    out = np.empty(4)
    mujoco.mju_mulQuat(out, conj, b)
    return 2.0 * float(np.arctan2(np.linalg.norm(out[1:]), abs(out[0])))


@dataclass
class Result:
    """What a docking run gave."""

    chaser: State
    target: State
    peak_force_n: float
    peak_depth_m: float
    impulse_ns: np.ndarray
    """Of the contact force on the target, in the world."""
    path_impulse_ns: float
    """Integral of the magnitude of the contact force."""
    first_contact_s: float | None
    last_contact_s: float | None
    pairs: set
    energy_j: float
    """Kinetic and stored energy at the end."""
    forces: np.ndarray
    """Rows (time s, |F| N) while in contact."""


class Docking:
    """Chaser (carrying the active ring) against target under the contact law, by MuJoCo."""

    def __init__(self, chaser: Spacecraft, target: Spacecraft, mech: Mechanism,
                 timestep_s: float = 2e-4) -> None:
        self.mech, self.step_s = mech, timestep_s
        self.contact = Contact(mech.active, mech.passive, mech.law)
        self.n_y = 3 * self.contact.bristles if mech.law.friction is not None else 0
        # Then the impulse on the target (3) and the integral of its magnitude.
        self.model = build(
            [Body.of("chaser", chaser).with_ring(chaser, mech), Body.of("target", target)],
            timestep_s, self.n_y + 4,
        )
        self.data = mujoco.MjData(self.model)
        # Ring frames in the body frames.
        self.r_1 = chaser.r_body_port @ mech.r_mount_active
        self.p_1 = chaser.p_body_port_m + chaser.r_body_port @ mech.p_mount_active_m
        self.r_2 = target.r_body_port @ mech.r_mount_passive
        self.p_2 = target.p_body_port_m + target.r_body_port @ mech.p_mount_passive_m
        self.id_1, self.id_2 = self.model.body("chaser").id, self.model.body("target").id
        self._act_rate = np.zeros(self.n_y + 4)
        self._first_stage = True
        self.force_n, self.depth_m, self.energy_j, self.places = 0.0, -np.inf, 0.0, []

    # -- callbacks, at every stage -------------------------------------------------------------

    def _relative(self, data):
        q = data.qpos
        r_w1, r_w2 = rotation(q[3:7]), rotation(q[10:14])
        r_wa, r_wb = r_w1 @ self.r_1, r_w2 @ self.r_2
        p_wa, p_wb = q[0:3] + r_w1 @ self.p_1, q[7:10] + r_w2 @ self.p_2
        return r_w1, r_w2, r_wa, r_wb, p_wa, p_wb

    def _passive(self, model, data) -> None:
        r_w1, r_w2, r_wa, r_wb, p_wa, p_wb = self._relative(data)
        v = data.qvel
        w1, w2 = r_w1 @ v[3:6], r_w2 @ v[9:12]
        # Velocity at the active ring's origin of the target's material less the chaser's.
        v_ab = (v[6:9] + np.cross(w2, p_wa - data.qpos[7:10])) - (
            v[0:3] + np.cross(w1, p_wa - data.qpos[0:3])
        )
        bristle = data.act[: self.n_y] if self.n_y else np.zeros(3 * self.contact.bristles)
        touch = self.contact.evaluate(
            r_wa.T @ r_wb, r_wa.T @ (p_wb - p_wa), r_wa.T @ v_ab, r_wa.T @ (w2 - w1), bristle,
            self._first_stage,
        )
        f, m = r_wa @ touch.wrench[:3], r_wa @ touch.wrench[3:]
        magnitude = float(np.linalg.norm(f))
        if self._first_stage:
            # The state itself; later stages are trial states.
            self._first_stage = False
            self.force_n, self.places = magnitude, touch.places
            self.depth_m, self.energy_j = touch.depth_m, touch.energy_j
        if self.n_y:
            self._act_rate[: self.n_y] = touch.rates.ravel()
        self._act_rate[self.n_y : self.n_y + 3] = f
        self._act_rate[self.n_y + 3] = magnitude
        if touch.depth_m > 0.0:
            mujoco.mj_applyFT(model, data, f, m, p_wa, self.id_2, data.qfrc_passive)
            mujoco.mj_applyFT(model, data, -f, -m, p_wa, self.id_1, data.qfrc_passive)

    def _act(self, model, data, i) -> float:
        return float(self._act_rate[i])

    # -- running -------------------------------------------------------------------------------

    def kinetic_j(self) -> float:
        """Kinetic energy of everything."""
        self._first_stage = True
        mujoco.mj_forward(self.model, self.data)
        m = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, m)
        return 0.5 * float(self.data.qvel @ m @ self.data.qvel)

    def clearance_m(self) -> float:
        """Least distance between the sides, negative in contact."""
        _, _, r_wa, r_wb, p_wa, p_wb = self._relative(self.data)
        return self.contact.clearance_m(r_wa.T @ r_wb, r_wa.T @ (p_wb - p_wa))

    def run(self, chaser: State, target: State, end_s: float, t0_s: float = 0.0,
            free_step_s: float = 1e-3, on_step=None) -> Result:
        """From a state at `t0_s` to `end_s`: long steps while the sides are surely apart."""
        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        set_state(m, d, "chaser", chaser)
        set_state(m, d, "target", target)
        d.time = t0_s
        rows, contacts, pairs = [], [], set()
        peak = depth = 0.0
        mujoco.set_mjcb_passive(self._passive)
        mujoco.set_mjcb_act_dyn(self._act)
        try:
            self._first_stage = True
            mujoco.mj_forward(m, d)
            while d.time < end_s - 1e-9:
                in_contact = self.force_n > 0.0
                near = in_contact or self._near(5e-3)
                step = self.step_s if near else free_step_s
                m.opt.timestep = min(step, end_s - d.time)
                before = d.time
                self._first_stage = True
                mujoco.mj_step(m, d)
                if self.force_n > 0.0:
                    contacts.append(before)
                    rows.append((before, self.force_n))
                    peak, depth = max(peak, self.force_n), max(depth, self.depth_m)
                    pairs |= {p.pair for p in self.places}
                if on_step is not None:
                    on_step(d.time, self)
            energy = self.kinetic_j() + self.energy_j
        finally:
            mujoco.set_mjcb_passive(None)
            mujoco.set_mjcb_act_dyn(None)
        return Result(
            get_state(m, d, "chaser"), get_state(m, d, "target"), peak, depth,
            d.act[self.n_y : self.n_y + 3].copy(), float(d.act[self.n_y + 3]),
            contacts[0] if contacts else None, contacts[-1] if contacts else None, pairs, energy,
            np.array(rows),
        )

    def _near(self, gap_m: float) -> bool:
        _, _, r_wa, r_wb, p_wa, p_wb = self._relative(self.data)
        r, p = r_wa.T @ r_wb, r_wa.T @ (p_wb - p_wa)
        return self.contact.clearance_m(r, p) < gap_m
