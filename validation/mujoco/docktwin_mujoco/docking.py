"""A whole docking: chaser, active ring and target as free bodies of MuJoCo, everything between them
from `kernel.py`. One object runs many dockings of one mechanism."""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass

import mujoco
import numpy as np

from . import kernel as k
from .outcome import Monitor
from .scene import Body, _inertial, get_state, rotation, set_state
from .scenario import Scene

_VOID_P2 = ctypes.CFUNCTYPE(None, ctypes.c_ssize_t, ctypes.c_ssize_t)
_CALLBACK = None
# Words of mjData that are looked through; it is larger than that.
MOST_WORDS = 20200


def _install(data) -> ctypes._CFuncPtr:
    """The compiled callback, once per process; checks where mjData keeps `userdata`."""
    global _CALLBACK
    want = data.userdata.ctypes.data
    words = (ctypes.c_int64 * MOST_WORDS).from_address(data._address)
    found = max((i for i in range(MOST_WORDS) if words[i] == want), default=None)
    if found is None:
        raise RuntimeError("userdata is not where MuJoCo 4.0.0 keeps it: another version?")
    if _CALLBACK is None:
        passive = k.callback(found)
        _CALLBACK = (found, passive, _VOID_P2(passive.address))
    if _CALLBACK[0] != found:
        raise RuntimeError("mjData changed its layout within a process")
    return _CALLBACK[2]


def _petal_numbers(petals):
    """As the kernel wants them; the length is that of the middle ruling."""
    return [
        petals.base_radius_m, petals.tip_radius_m, petals.height_m, petals.base_half_angle_rad,
        petals.tip_half_angle_rad, 0.5 * petals.thickness_m, petals.flexural_rigidity_n_m2,
        petals.first_azimuth_rad,
        math.hypot(petals.height_m, petals.tip_radius_m - petals.base_radius_m),
    ]


def surfaces(active, passive, law) -> np.ndarray:
    """What the kernel needs to know for contact alone."""
    P = np.zeros(k.P_SIZE)
    for side, ring, tube, first, count in (
        (active, k.RING_A, k.TUBE_A, k.PETAL_A, k.PETALS_A),
        (passive, k.RING_B, k.TUBE_B, k.PETAL_B, k.PETALS_B),
    ):
        P[ring], P[tube] = side.ring_mean_radius_m, side.ring_section_radius_m
        if side.petals is not None:
            if side.petals.count > 3:
                raise ValueError(f"at most 3 petals a side, found {side.petals.count}")
            P[count] = side.petals.count
            P[first : first + 9] = _petal_numbers(side.petals)
    P[k.KELVIN_VOIGT] = float(hasattr(law.normal, "damping_n_s_m"))
    P[k.STIFFNESS], P[k.EXPONENT] = law.normal.stiffness, law.normal.exponent
    P[k.DAMPING] = getattr(law.normal, "damping_n_s_m", None) or getattr(
        law.normal, "damping_s_m", 0.0
    )
    P[k.MERGE] = law.merge_depth_m
    P[k.S_0] = P[k.V_S] = 1.0
    if law.friction is not None:
        f = law.friction
        P[k.MU_K : k.MU_K + 5] = [
            f.kinetic, f.static, f.stribeck_velocity_m_s, f.bristle_breakaway_m, f.bristle_damping_s
        ]
        P[k.RUBBING] = 1.0
    return P


def parameters(scene: Scene, step_s: float, every: int) -> np.ndarray:
    """Everything constant of a scene, as the kernel reads it."""
    m = scene.mechanism
    P = surfaces(m.active, m.passive, m.law)
    P[k.RIGID] = float(m.attenuation is None)
    c, t = scene.chaser, scene.target
    P[k.MOUNT_C : k.MOUNT_C + 12] = np.concatenate([c.p_body_port_m, c.r_body_port.ravel()])
    P[k.MOUNT_T : k.MOUNT_T + 12] = np.concatenate([t.p_body_port_m, t.r_body_port.ravel()])
    if np.abs(m.r_mount_active - np.eye(3)).max() > 1e-12 or np.abs(
        m.r_mount_passive - np.diag([-1.0, -1.0, 1.0])
    ).max() > 1e-12:
        raise ValueError("rings must stand as `r3` in `e3` and `r4` turned by 180 degrees about Z4")
    P[k.OFFSET_A], P[k.OFFSET_B] = m.p_mount_active_m[0], -m.p_mount_passive_m[0]
    P[k.RING_COM : k.RING_COM + 3] = m.ring_body.com_m
    if m.latches is not None:
        L = m.latches
        P[k.LATCHES] = 1.0
        P[k.AZIMUTH : k.AZIMUTH + 3] = L.azimuths_rad
        P[k.PASSIVE_AXES] = {"active": 0.0, "passive": 1.0}[L.axes]
        P[k.APPROACH : k.APPROACH + 8] = [
            L.approach_gap_m, L.strike_gap_m, L.catch_gap_m, L.radial_zone_m, L.tangential_zone_m,
            L.hold_stiffness_n_m, L.joined_stiffness_n_m, L.joined_damping_n_s_m,
        ]
    if m.attenuation is not None:
        a = m.attenuation
        P[k.ATTENUATION] = {"characteristic": 1.0, "differential": 2.0}[a.kind]
        P[k.RAMP] = a.ramp_s
        for i, ch in enumerate(a.channels):
            at = k.CHANNEL + i * k.CHANNEL_SIZE
            for n, start, points in ((k.N_UP, k.UP, ch.loading), (k.N_DOWN, k.DOWN, ch.unloading)):
                if not 2 <= len(points) <= 8:
                    raise ValueError(f"2 to 8 points of a curve expected, found {len(points)}")
                P[at + n] = len(points)
                P[at + start : at + start + 2 * len(points)] = np.ravel(points)
            P[at + k.BRANCH : at + k.BRANCH + 8] = [
                ch.branch_change, ch.damping_before, ch.damping_after, ch.dry_friction,
                ch.travel_negative, ch.travel_positive, ch.stop_stiffness, ch.stop_damping,
            ]
            if ch.brake is not None:
                P[at + k.BRAKE : at + k.BRAKE + 3] = [1.0, *ch.brake]
        if a.kind == "differential":
            P[k.BASE_JOINTS : k.BASE_JOINTS + 18] = a.base_joints_m.ravel()
            P[k.RING_JOINTS : k.RING_JOINTS + 18] = a.ring_joints_m.ravel()
            P[k.COUPLING : k.COUPLING + 36] = a.coupling.ravel()
    if len(scene.thrusts) > k.MOST_THRUSTS:
        raise ValueError(f"at most {k.MOST_THRUSTS} thrusts, found {len(scene.thrusts)}")
    P[k.THRUSTS] = len(scene.thrusts)
    for i, th in enumerate(scene.thrusts):
        at = k.THRUST + i * k.THRUST_SIZE
        P[at : at + 11] = [
            float(th.on == "target"), {"start": 0.0, "first_contact": 1.0, "capture": 2.0}[th.after],
            th.delay_s, th.duration_s, *th.force_n, *th.moment_nm, float(th.until_capture),
        ]
    P[k.STEP], P[k.EVERY] = step_s, every
    if m.active.surfaces or m.passive.surfaces or m.own_latches:
        P[k.CONTACT_OFF] = 1.0
    return P


def mjcf(scene: Scene, step_s: float, geometry: str = "", options: str = "", assets: str = "",
         contact: str = "disable", integrator: str = "RK4") -> str:
    """The scene as MJCF: free bodies and activation states. `geometry` maps a body to further
    elements inside it."""
    m = scene.mechanism
    inner = geometry or {}
    chaser = Body.of("chaser", scene.chaser)
    bodies = []
    if m.attenuation is None:
        chaser = chaser.with_ring(scene.chaser, m)
    bodies.append(chaser.mjcf().replace("</body>", inner.get("chaser", "") + "</body>", 1)
                  if m.attenuation is not None else
                  chaser.mjcf()[: -len("</body>")] + inner.get("chaser", "") + "</body>")
    if m.attenuation is not None:
        ring = m.ring_body
        bodies.append(
            f'<body name="ring"><freejoint name="ring"/>'
            f"{_inertial(ring.mass_kg, ring.com_m, ring.inertia_kg_m2)}{inner.get('ring', '')}</body>"
        )
    target = Body.of("target", scene.target).mjcf()
    bodies.append(target[: -len("</body>")] + inner.get("target", "") + "</body>")
    states = "".join(
        f'<general name="s{i}" joint="chaser" gear="1 0 0 0 0 0" dyntype="integrator" '
        f'gaintype="fixed" gainprm="0" biastype="none"/>'
        for i in range(k.STATES)
    )
    return (
        f'<mujoco><compiler autolimits="true" balanceinertia="false" boundmass="0" '
        f'boundinertia="0"/><size nuserdata="{k.HEADER}"/>'
        f'<option integrator="{integrator}" timestep="{step_s!r}" gravity="0 0 0" {options}>'
        f'<flag contact="{contact}"/></option>{assets}'
        f'<worldbody>{"".join(bodies)}</worldbody><actuator>{states}</actuator></mujoco>'
    )


@dataclass
class Run:
    """What a docking gave."""

    outcome: str
    reason: str
    decided_s: float
    end_s: float
    first_contact_s: float | None
    captured_s: float | None
    latches_s: list
    """Per latch: times of approach, strike, latched; None where it did not come to it."""
    peak_force_n: float
    peak_moment_nm: float
    peak_depth_m: float
    impulse_ns: float
    rows: np.ndarray

    @property
    def latch_order(self) -> list:
        """Latches that caught, in order, counted from 1."""
        caught = [(t[2], i + 1) for i, t in enumerate(self.latches_s) if t[2] is not None]
        return [i for _, i in sorted(caught)]


class FullDocking:
    """The on-orbit scene under MuJoCo's integrator."""

    def __init__(self, scene: Scene, step_s: float = 2e-4, tick_s: float = 1e-3,
                 model=None) -> None:
        every = round(tick_s / step_s)
        if abs(every * step_s - tick_s) > 1e-12:
            raise ValueError(f"a tick of {tick_s} s is no whole number of steps of {step_s} s")
        self.scene, self.step_s, self.every = scene, step_s, every
        self.tick_s = tick_s
        self.model = model or mujoco.MjModel.from_xml_string(mjcf(scene, step_s))
        self.data = mujoco.MjData(self.model)
        self.P = parameters(scene, step_s, every)
        self.S = np.zeros(k.S_SIZE)
        self.callback = _install(self.data)
        self.rigid = scene.mechanism.attenuation is None

    def start(self, states: dict, t0_s: float = 0.0, rows: int = 1000) -> None:
        """Puts the bodies somewhere. `states`: of the frames of chaser and target at their mass
        centres and of the ring at its centre."""
        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        for name, s in states.items():
            if not (self.rigid and name == "ring"):
                set_state(m, d, name, s)
        self.S[:] = 0.0
        self.S[[k.FIRST, k.CAPTURED]] = -1.0
        self.S[k.TIMES : k.TIMES + 9] = -1.0
        self.P[k.START] = t0_s
        self.T = np.zeros((rows, k.ROW))
        header = d.userdata.view(np.int64)
        header[:11] = [
            self.P.ctypes.data, self.S.ctypes.data, self.T.ctypes.data, rows, d.qpos.ctypes.data,
            d.qvel.ctypes.data, d.act.ctypes.data, d.ctrl.ctypes.data, d.qfrc_passive.ctypes.data,
            m.nq, m.nv,
        ]

    def advance(self, steps: int) -> None:
        """Steps of MuJoCo, all in one call of C."""
        self.S[k.STAGE] = 4.0 * round(self.S[k.STAGE] / 4.0)
        mujoco.set_mjcb_passive(self.callback)
        try:
            mujoco.mj_step(self.model, self.data, nstep=steps)
        finally:
            mujoco.set_mjcb_passive(None)

    def run(self, states: dict, duration_s: float, t0_s: float = 0.0,
            stop_when_decided: bool = False, chunk_s: float = 0.25,
            after_capture_s: float = math.inf) -> Run:
        """From a state to the end of the scenario, judged every tick. A passed limit ends it."""
        ticks = round(duration_s / self.tick_s)
        self.start(states, t0_s, ticks + 1)
        monitor = Monitor(self.scene.mechanism, self.scene.thrusts)
        done = seen = 0
        chunk = round(chunk_s / self.tick_s)
        ended = None
        whole = mujoco.mjtState.mjSTATE_INTEGRATION
        saved = np.empty(mujoco.mj_stateSize(self.model, whole))
        while ended is None:
            n, begun = min(chunk, ticks - done), done
            mujoco.mj_getState(self.model, self.data, saved, whole)
            memory = self.S.copy()
            # The row of a tick is written as its first step begins: one step more for the last.
            if n > 0:
                self.advance(n * self.every)
                done += n
            else:
                self.advance(1)
            upto = int(self.S[k.ROWS])
            for i in range(seen, upto):
                monitor.observe(self.T[i], self.S)
                now = self.T[i][k.TIME]
                if i == ticks or monitor.limit is not None or (
                    stop_when_decided and monitor.decided(now)
                ) or (monitor.captured is not None and now > monitor.captured + after_capture_s):
                    ended = i
                    break
            if ended is not None and ended < done:
                # Peaks and impulse are those up to the end, not up to the end of the chunk.
                mujoco.mj_setState(self.model, self.data, saved, whole)
                self.S[:] = memory
                self.advance((ended - begun) * self.every)
                self.S[k.PEAK_F] = max(self.S[k.PEAK_F], self.T[ended][k.FORCE_NOW])
            seen = upto
            if not np.isfinite(self.data.qpos).all():
                raise FloatingPointError("the state is no longer finite: halve the step")
            if self.S[k.CROSSED] != 0.0:
                raise FloatingPointError("surfaces overlap until their cores meet: not modelled here")
        S, rows = self.S, self.T[: ended + 1]
        name, when, reason = monitor.judge(rows[-1][k.TIME])
        times = S[k.TIMES : k.TIMES + 9].reshape(3, 3)
        some = lambda x: None if x < 0.0 else float(x)  # noqa: E731
        return Run(
            name, reason, when, float(rows[-1][k.TIME]), some(S[k.FIRST]), some(S[k.CAPTURED]),
            [[some(x) for x in row] for row in times], float(S[k.PEAK_F]), float(S[k.PEAK_M]),
            float(S[k.PEAK_D]), float(self.data.act[k.IMPULSE + 3]), rows,
        )
