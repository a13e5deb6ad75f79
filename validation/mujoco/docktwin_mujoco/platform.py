"""The motion simulator in MuJoCo: six legs of cross, cylinder and rod, the plate a free body, the
loops closed by `connect` at the rod ends, gravity. No reduction of any kind.

MuJoCo's equalities are springs in acceleration: left to themselves, violations die out with the time
constant of `solref`, and a share 1 - d (`solimp`) of the acceleration that would tear the loop open
remains. With a time constant tied to the step the loop error is of the order (1 - d) a tau^2 and
falls with the square of the step, whatever the order of the integrator.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from .rig import Part, Rig, derivatives, leg_joints, plate_pose, rotation, trajectory, vee
from .scene import _inertial, _numbers

# For derivatives of the trajectory, s: rounding and truncation both below 1e-9.
TIME_STEP_S = 4e-3


@dataclass(frozen=True)
class Settings:
    """How MuJoCo integrates and closes loops."""

    timestep_s: float
    integrator: str = "RK4"
    solver: str = "Newton"
    iterations: int = 100
    tolerance: float = 1e-10
    jacobian: str = "dense"
    time_constant_steps: float = 2.0
    """Of the equality constraints, in steps; below 2 MuJoCo's own safeguard is switched off."""
    impedance: float = 0.9999
    """d of `solimp`, MuJoCo's largest."""
    plate_on_leg: bool = False
    """The plate hangs on the first rod by a ball joint: one loop less to close, and cheaper."""

    def option(self, gravity) -> str:
        """As MJCF; nothing here collides, is limited or rubs."""
        safe = "enable" if self.time_constant_steps >= 2.0 else "disable"
        return (
            f'<option timestep="{self.timestep_s!r}" integrator="{self.integrator}" '
            f'solver="{self.solver}" iterations="{self.iterations}" '
            f'tolerance="{self.tolerance!r}" jacobian="{self.jacobian}" '
            f'gravity="{_numbers(gravity)}">'
            f'<flag contact="disable" limit="disable" frictionloss="disable" refsafe="{safe}"/>'
            "</option>"
        )


def _body(name: str, part: Part, joints: str, inside: str = "", pos=np.zeros(3), quat=(1, 0, 0, 0)):
    return (
        f'<body name="{name}" pos="{_numbers(pos)}" quat="{_numbers(quat)}">{joints}'
        f"{_inertial(part.mass_kg, part.com_m, part.inertia_kg_m2)}{inside}</body>"
    )


def _quat(r) -> np.ndarray:
    q = np.empty(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(r).ravel())
    return q


def mjcf(rig: Rig, settings: Settings, spring_n_m: float = 0.0, spring_zero_m=np.zeros(6)) -> str:
    """The rig, every leg with a spring along its stroke that has no force at `spring_zero_m` (from
    the middle)."""
    tau = settings.time_constant_steps * settings.timestep_s
    d = settings.impedance
    soft = f'solref="{tau!r} 1" solimp="{d!r} {d!r} 0.001 0.5 2"'
    r, p = plate_pose(rig, np.zeros(6))
    sites = "".join(
        f'<site name="plate_{i}" pos="{_numbers(leg.plate_joint_m)}"/>'
        for i, leg in enumerate(rig.legs)
    )
    legs = loops = plate = ""
    if not settings.plate_on_leg:
        plate = _body("plate", rig.plate, '<freejoint name="plate"/>', sites, p, _quat(r))
    for i, leg in enumerate(rig.legs):
        slide = (
            f'<joint name="stroke_{i}" type="slide" axis="1 0 0" stiffness="{spring_n_m!r}" '
            f'springref="{float(spring_zero_m[i])!r}"/>'
        )
        end = f'<site name="rod_{i}"/>'
        if settings.plate_on_leg and i == 0:
            ball = f'<joint name="plate" type="ball" pos="{_numbers(leg.plate_joint_m)}"/>'
            r_rod_plate = leg.r_b_leg.T @ r
            end += _body("plate", rig.plate, ball, sites, -r_rod_plate @ leg.plate_joint_m,
                         _quat(r_rod_plate))
        else:
            loops += f'<connect site1="rod_{i}" site2="plate_{i}" {soft}/>'
        rod = _body(f"rod_{i}", leg.rod, slide, end, pos=[leg.middle_length_m, 0.0, 0.0])
        cylinder = _body(f"cylinder_{i}", leg.cylinder,
                         f'<joint name="tilt_{i}" type="hinge" axis="0 1 0"/>', rod)
        legs += _body(f"cross_{i}", leg.cross, f'<joint name="swing_{i}" type="hinge" axis="0 0 1"/>',
                      cylinder, leg.base_joint_m, _quat(leg.r_b_leg))
    return (
        '<mujoco><compiler angle="radian" balanceinertia="false" boundmass="0" boundinertia="0"/>'
        f"{settings.option(rig.gravity_m_s2)}<worldbody>{legs}{plate}</worldbody>"
        f"<equality>{loops}</equality></mujoco>"
    )


class Platform:
    """A rig in MuJoCo with its state."""

    def __init__(self, rig: Rig, settings: Settings, spring_n_m: float = 0.0,
                 spring_zero_m=np.zeros(6)) -> None:
        self.rig, self._on_leg = rig, settings.plate_on_leg
        text = mjcf(rig, settings, spring_n_m, spring_zero_m)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        joints = [[self.model.joint(f"{n}_{i}") for n in ("swing", "tilt", "stroke")] for i in range(6)]
        self._leg_q = np.array([[j.qposadr[0] for j in leg] for leg in joints])
        self._leg_v = np.array([[j.dofadr[0] for j in leg] for leg in joints])
        plate = self.model.joint("plate")
        self._q, self._v = plate.qposadr[0], plate.dofadr[0]

    @property
    def strokes(self) -> np.ndarray:
        """Numbers of the six strokes among the degrees of freedom."""
        return self._leg_v[:, 2]

    def place(self, r_bp, p_bp) -> None:
        """Plate and legs at rest at a pose."""
        d = self.data
        mujoco.mj_resetData(self.model, d)
        joints = leg_joints(self.rig, r_bp, p_bp)[0]
        d.qpos[self._leg_q] = joints
        if self._on_leg:
            # Turned against the rod, from the middle.
            swing, tilt, _ = joints[0]
            r_b_leg = self.rig.legs[0].r_b_leg
            r_b_rod = r_b_leg @ rotation(2, swing) @ rotation(1, tilt)
            middle, _ = plate_pose(self.rig, np.zeros(6))
            d.qpos[self._q : self._q + 4] = _quat((r_b_rod @ r_b_leg.T @ middle).T @ r_bp)
        else:
            d.qpos[self._q : self._q + 3] = p_bp
            d.qpos[self._q + 3 : self._q + 7] = _quat(r_bp)

    def pose(self) -> np.ndarray:
        """Plate in the ground: x, y, z (m), then w, x, y, z."""
        mujoco.mj_kinematics(self.model, self.data)
        plate = self.data.body("plate")
        return np.concatenate([plate.xpos, plate.xquat])

    def loop_error_m(self) -> float:
        """Largest distance of a rod end from its joint."""
        mujoco.mj_kinematics(self.model, self.data)
        ends = [
            self.data.site(f"rod_{i}").xpos - self.data.site(f"plate_{i}").xpos for i in range(6)
        ]
        return float(np.linalg.norm(ends, axis=1).max())

    def leg_forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Leg forces (6), N, for the position, velocity and acceleration in `data` (the plate a free
        body), and the singular values of what they were solved from.

        `mj_inverse` of the open tree gives the generalised force of every joint. With the loops closed
        only strokes push and the 18 forces of the rod ends hold the rest: as many unknowns as degrees
        of freedom, so that MuJoCo's soft constraint has no say in it.
        """
        m, d = self.model, self.data
        equality = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        m.opt.disableflags |= equality
        mujoco.mj_inverse(m, d)
        needed = d.qfrc_inverse.copy()
        m.opt.disableflags &= ~equality
        mujoco.mj_fwdPosition(m, d)
        matrix = np.zeros((m.nv, m.nv))
        matrix[self.strokes, np.arange(6)] = 1.0
        matrix[:, 6:] = d.efc_J.reshape(-1, m.nv).T
        solution, _, _, singular = np.linalg.lstsq(matrix, needed, rcond=1e-12)
        return solution[:6], singular

    def move(self, time_s: float) -> None:
        """State and acceleration of the trajectory at an instant, the plate a free body."""
        def along(t):
            return plate_pose(self.rig, trajectory(t))

        r, r_rate, r_second = derivatives(lambda t: along(t)[0], time_s, TIME_STEP_S)
        p, v, a = derivatives(lambda t: along(t)[1], time_s, TIME_STEP_S)
        _, rates, seconds = derivatives(
            lambda t: leg_joints(self.rig, *along(t))[0], time_s, TIME_STEP_S
        )
        self.place(r, p)
        d = self.data
        # A free joint turns in axes of its body: R^T R'' = [w']x + [w]x^2.
        d.qvel[self._v : self._v + 6] = np.concatenate([v, vee(r.T @ r_rate)])
        d.qacc[self._v : self._v + 6] = np.concatenate([a, vee(r.T @ r_second)])
        d.qvel[self._leg_v], d.qacc[self._leg_v] = rates, seconds


def standing_forces(rig: Rig, place=np.zeros(6)) -> tuple[np.ndarray, np.ndarray]:
    """Leg forces (6), N, that hold the plate at rest at a place of the docking workspace, and the
    singular values of their equations."""
    platform = Platform(rig, Settings(1e-3))
    platform.place(*plate_pose(rig, place))
    platform.data.qacc[:] = 0.0
    return platform.leg_forces()


def leg_forces(rig: Rig, times_s) -> np.ndarray:
    """Leg forces (n, 6), N, along the trajectory."""
    platform = Platform(rig, Settings(1e-3))
    out = []
    for t in times_s:
        platform.move(t)
        out.append(platform.leg_forces()[0])
    return np.array(out)


def released(rig: Rig, settings: Settings, place, spring_n_m: float) -> Platform:
    """The plate at rest at a place, on leg springs that would hold it at rest in the middle."""
    zero = standing_forces(rig)[0] / spring_n_m
    platform = Platform(rig, settings, spring_n_m, zero)
    platform.place(*plate_pose(rig, place))
    return platform


def run(platform: Platform, until_s: float, sample_s: float, clock=None):
    """Poses (n, 7) at the samples, the largest loop error at them (m), and what `clock` says the
    steps took."""
    model, data = platform.model, platform.data
    steps = round(sample_s / model.opt.timestep)
    if abs(steps * model.opt.timestep / sample_s - 1.0) > 1e-9:
        raise ValueError(f"a step of {model.opt.timestep} s does not divide {sample_s} s")
    poses, loop, spent = [platform.pose()], 0.0, 0.0
    for _ in range(round(until_s / sample_s)):
        begin = clock() if clock else 0.0
        mujoco.mj_step(model, data, nstep=steps)
        spent += clock() - begin if clock else 0.0
        poses.append(platform.pose())
        loop = max(loop, platform.loop_error_m())
    return np.array(poses), loop, spent
