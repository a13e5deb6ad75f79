"""The check cases through both engines. Every case gives rows: what is measured, its closed form or
published figure, and what each engine found.

docktwin runs a scenario, with `--set` where a case needs other numbers than the file's, in both of its
twins; MuJoCo starts from the first recorded row and goes its own way with the law rewritten in
`kernel.py`. The last column is MuJoCo's own contact solver, where the case is within its reach.
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from docktwin_mujoco import kernel as k
from docktwin_mujoco.docking import FullDocking
from docktwin_mujoco.law import Friction
from docktwin_mujoco.peer import MODELS, ROOT, Refused, rehearse, states
from docktwin_mujoco.scene import Body, State, build, set_state

from . import closed_forms as cf

ENGINES = ("reduced", "full", "mujoco", "own")
STEP_S = 2e-4
G = 9.81


@dataclass
class Row:
    """One measured quantity."""

    case: str
    quantity: str
    unit: str
    want: float
    found: dict = field(default_factory=dict)
    """By engine; a text where there is no figure."""
    scale: float | None = None
    """What errors are relative to; the closed form if None."""

    def off(self, engine: str) -> float | None:
        """Relative error of an engine, None without a figure."""
        value = self.found.get(engine)
        if not isinstance(value, float):
            return None
        return abs(value - self.want) / abs(self.scale if self.scale is not None else self.want)


# -- one impact in three ways --------------------------------------------------------------------


def _impact(times, gap, speed_in, speed_out, depth):
    """Time between the two crossings of zero depth, from the free flights before and after: depth is
    taken from the least distance of the bodies and the deepest overlap."""
    i = int(np.argmin(gap))
    least = gap[i]
    if 0 < i < len(gap) - 1:
        a, b, c = gap[i - 1 : i + 2]
        least = b - (a - c) ** 2 / (8.0 * (a - 2.0 * b + c))
    touch = least + depth
    start = times[0] + (gap[0] - touch) / -speed_in
    end = times[-1] - (gap[-1] - touch) / speed_out
    return end - start


def head_on(binary, out: Path, scenario="basic_central_impact", sets=(), twins=("reduced", "full")):
    """Peak force, deepest overlap, restitution, duration and roll taken, by engine. Of the coaxial
    rings, along X."""
    found = {}
    for twin in twins:
        path = ROOT / "scenarios" / f"{scenario}.toml" if isinstance(scenario, str) else scenario
        run = rehearse(binary, path, sets, twin, out / "run")
        col, s = run.columns, run.summary
        gap = col["target_position_x_m"] - col["chaser_position_x_m"]
        speed = col["target_velocity_x_m_s"] - col["chaser_velocity_x_m_s"]
        found[twin] = {
            "force": s["peak_force_n"], "depth": s["peak_penetration_m"],
            "e": float(-speed[-1] / speed[0]), "impulse": s["impulse_ns"],
            "time": float(_impact(col["time_s"], gap, speed[0], speed[-1], s["peak_penetration_m"])),
            "roll": float(
                (col["target_rate_x_rad_s"][0] - col["chaser_rate_x_rad_s"][0])
                - (col["target_rate_x_rad_s"][-1] - col["chaser_rate_x_rad_s"][-1])
            ),
            "momentum": s["momentum_error"],
        }
        if col["contact_depth_m"][-1] != 0.0:
            raise ValueError(f"{scenario}: still in contact at the end, make it longer")
        last = run
    got = FullDocking(last.scene, STEP_S).run(
        states(last), float(last.columns["time_s"][-1]), float(last.columns["time_s"][0])
    )
    rows, b = got.rows, k.BODIES
    gap, speed = rows[:, b + 26] - rows[:, b], rows[:, b + 33] - rows[:, b + 7]
    found["mujoco"] = {
        "force": got.peak_force_n, "depth": got.peak_depth_m, "e": float(-speed[-1] / speed[0]),
        "impulse": got.impulse_ns,
        "time": float(_impact(rows[:, k.TIME], gap, speed[0], speed[-1], got.peak_depth_m)),
        "roll": float((rows[0, b + 36] - rows[0, b + 10]) - (rows[-1, b + 36] - rows[-1, b + 10])),
    }
    return found


def own_impact(v: float, stiffness: float, damping: float = 0.0, step: float = 1e-4):
    """8 t against 12 t on MuJoCo's own soft contact, solref = (-k/m_eff, -c/m_eff)."""
    soft = (f'solref="{-stiffness / cf.MASS_KG!r} {-damping / cf.MASS_KG!r}" '
            f'solimp="0.9999 0.9999 1e-12 0.5 1" condim="1"')
    m = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" timestep="{step!r}" gravity="0 0 0" tolerance="1e-14"/>'
        f'<worldbody><body><joint type="slide" axis="1 0 0"/>'
        f'<geom type="sphere" size="0.1" mass="8000" {soft}/></body><body pos="0.2005 0 0">'
        f'<joint type="slide" axis="1 0 0"/><geom type="sphere" size="0.1" mass="12000" {soft}/>'
        f"</body></worldbody></mujoco>"
    )
    d = mujoco.MjData(m)
    d.qvel[0] = v
    force = depth = 0.0
    times, gap = [0.0], [0.2005]
    while d.time < 0.4:
        mujoco.mj_step(m, d)
        times.append(d.time)
        gap.append(0.2005 + d.qpos[1] - d.qpos[0])
        depth = max(depth, 0.2 - gap[-1])
        if d.nefc:
            force = max(force, float(d.efc_force[0]))
    e = float((d.qvel[1] - d.qvel[0]) / v)
    gap = np.array(gap)
    return {"force": force, "depth": depth, "e": e,
            "time": float(_impact(times, gap, -v, e * v, depth))}


def _rows(case, found, own, wanted):
    out = []
    for key, quantity, unit, want, factor in wanted:
        row = Row(case, quantity, unit, want * factor)
        for engine in ENGINES[:3]:
            row.found[engine] = found[engine][key] * factor
        if own and key in own:
            row.found["own"] = own[key] * factor
        out.append(row)
    return out


def _law(normal, exponent=1.0, stiffness=1e6, **more):
    values = {"normal_law": f'"{normal}"', "stiffness_n_m": stiffness, **more}
    if normal == "hunt_crossley":
        values["exponent"] = exponent
    return [f"mechanism.contact.{name}={value}" for name, value in values.items()]


def spring_8_12(binary, out):
    """The case of the paper."""
    time, depth, force = cf.spring(1e6, 0.35)
    return _rows(
        "8 t on 12 t, spring 1e6 N/m, 0.35 m/s", head_on(binary, out), own_impact(0.35, 1e6),
        [("time", "duration", "s", time, 1.0), ("depth", "depth", "mm", depth, 1e3),
         ("force", "peak", "N", force, 1.0), ("e", "restitution", "", 1.0, 1.0)],
    )


def hertz(binary, out):
    """F = k d^1.5."""
    time, depth, force = cf.hertz(1e9, 0.1)
    found = head_on(binary, out, sets=_law("hunt_crossley", 1.5, 1e9) + [
        "initial.axial_speed_m_s=0.1", "initial.gap_m=0.01", "run.duration_s=0.3"])
    return _rows(
        "Hertz, 1e9 N/m^1.5, 0.1 m/s", found, None,
        [("time", "duration", "ms", time, 1e3), ("depth", "depth", "mm", depth, 1e3),
         ("force", "peak", "N", force, 1.0), ("e", "restitution", "", 1.0, 1.0)],
    )


def hunt_crossley(binary, out, d, exponent):
    """Restitution over d = a v."""
    stiffness = 1e6 if exponent == 1.0 else 1e9
    found = head_on(binary, out, sets=_law(
        "hunt_crossley", exponent, stiffness, damping_s_m=d / 0.1
    ) + ["initial.axial_speed_m_s=0.1", "initial.gap_m=0.01", "run.duration_s=0.6"])
    return _rows(f"Hunt–Crossley, exponent {exponent:g}, a v = {d:g}", found, None,
                 [("e", "restitution", "", cf.hunt_crossley_restitution(d), 1.0)])


def kelvin_voigt(binary, out, damping):
    """Restitution of a spring and damper that cannot pull."""
    zeta = damping / (2.0 * math.sqrt(1e6 * cf.MASS_KG))
    # The file's `damping_s_m` belongs to the other law and cannot be taken away by `--set`.
    text = (ROOT / "scenarios" / "basic_central_impact.toml").read_text()
    out.mkdir(parents=True, exist_ok=True)
    path = out / "basic_central_impact.toml"
    path.write_text(text.replace("damping_s_m = 0.0\n", "").replace('"models/', f'"{ROOT}/models/'))
    found = head_on(binary, out, path, _law("kelvin_voigt", damping_n_s_m=damping))
    return _rows(f"Kelvin–Voigt, F ≥ 0, c = {damping:.6g} N·s/m, ζ = {zeta:.4f}", found,
                 own_impact(0.35, 1e6, damping),
                 [("e", "restitution", "", cf.kelvin_voigt_restitution(zeta), 1.0)])


def roll(binary, out):
    """Friction between turning rings."""
    found = head_on(binary, out, "basic_impact_with_roll", [
        "mechanism.contact.bristle_breakaway_m=3e-6", "initial.gap_m=0.005", "run.duration_s=0.4"])
    return _rows("roll lost to friction, bristle of 3 µm", found, None,
                 [("roll", "relative rate lost", "°/s", cf.roll_lost(0.1, 0.6, 0.1), 180.0 / math.pi)])


def oblique(binary, out, case):
    """Levers and bending petals; slow, so that the geometry stands still."""
    speed, duration = cf.SLOW[case]
    found = head_on(binary, out, case, [
        f"initial.axial_speed_m_s={speed}", f"initial.gap_m={0.2 * speed}",
        f"run.duration_s={duration}"])
    mass, stiffness, along = cf.oblique(case)
    v = along * speed
    return _rows(f"{case}, {1e3 * speed:g} mm/s", found, None,
                 [("force", "peak", "N", v * math.sqrt(stiffness * mass), 1.0),
                  ("impulse", "impulse", "N·s", 2.0 * mass * v, 1.0)])


# -- tumbling ------------------------------------------------------------------------------------


def _tumbler(binary, out: Path, inertia, rates, duration, twin):
    """docktwin's target with these principal moments, free, far beside the chaser: times and body
    rates. The rates start as given, but for the nanosecond before the plane of first contact."""
    out.mkdir(parents=True, exist_ok=True)
    urdf = (MODELS / "test_12t.urdf").read_text()
    for name, value in zip(("ixx", "iyy", "izz"), inertia):
        urdf = urdf.replace(f'{name}="12000.0"', f'{name}="{value!r}"')
    urdf = urdf.replace("../../meshes/", "")
    shutil.copy(ROOT / "meshes" / "test_12t_hull.obj", out)
    (out / "tumbler.urdf").write_text(urdf)
    (out / "tumbler.toml").write_text((MODELS / "test_12t.toml").read_text())
    deg = [float(x) for x in np.degrees(rates)]
    (out / "tumble.toml").write_text(f"""schema = 1
name = "tumble"
description = "A body that tumbles freely."
[chaser]
model = "{MODELS / 'test_8t.urdf'}"
[target]
model = "{out / 'tumbler.urdf'}"
[mechanism]
active = "{MODELS / 'ring_active.urdf'}"
passive = "{MODELS / 'ring_passive.urdf'}"
attenuation = "rigid"
[initial]
axial_speed_m_s = 2.0
lateral_y_m = 2.0
lateral_z_m = -2.0
roll_rate_deg_s = {deg[0]!r}
pitch_rate_deg_s = {deg[1]!r}
yaw_rate_deg_s = {deg[2]!r}
gap_m = 1e-9
[run]
duration_s = {duration!r}
[expect]
outcome = "missed"
because = "the target tumbles past the chaser, 2.8 m beside it."
""")
    done = subprocess.run(
        [str(binary), "rehearse", str(out / "tumble.toml"), "--out", str(out / "run"), "--twin", twin,
         "--json", "--no-rrd"], capture_output=True, text=True, cwd=ROOT)
    if done.returncode != 0:
        raise Refused(done.stderr + done.stdout)
    if json.loads((out / "run" / "summary.json").read_text())["peak_force_n"] != 0.0:
        raise ValueError("the tumbling target must touch nothing")
    import pyarrow.parquet as pq

    names = ["time_s", *(f"target_rate_{a}_rad_s" for a in "xyz")]
    table = pq.read_table(out / "run" / "telemetry.parquet", columns=names)
    col = [table.column(n).to_numpy() for n in names]
    return col[0], np.stack(col[1:], 1)


def _tumble_mujoco(inertia, rates, duration, step=1e-3):
    m = build([Body("b", 1.0, np.diag(inertia))], step)
    d = mujoco.MjData(m)
    set_state(m, d, "b", State(np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(3), np.array(rates)))
    out = [d.qvel[3:6].copy()]
    for _ in range(round(duration / step)):
        mujoco.mj_step(m, d)
        out.append(d.qvel[3:6].copy())
    return step * np.arange(len(out)), np.array(out)


def nesc(binary, out):
    """docktwin's scenarios turn a target by 20 degrees/s at most: half the rates for twice the time,
    which Euler's equations make the same motion."""
    inertia = np.array([0.001894220, 0.006211019, 0.007194665])
    rates = np.radians([10.0, 20.0, 30.0])
    want = [12.61839077591, -17.39747476161, 31.11958888694]
    rows = [Row("NESC check case 2, 30 s", f"rate {a}", "°/s", w, scale=np.linalg.norm(want))
            for a, w in zip("XYZ", want)]
    for twin in ENGINES[:2]:
        _, w = _tumbler(binary, out / twin, [float(x) for x in 1e6 * inertia], 0.5 * rates, 60.0, twin)
        for i, row in enumerate(rows):
            row.found[twin] = float(np.degrees(2.0 * w[-1, i]))
    _, w = _tumble_mujoco(inertia, rates, 30.0)
    for i, row in enumerate(rows):
        row.found["mujoco"] = float(np.degrees(w[-1, i]))
    return rows


def _period(times, w):
    """Between the first and the third sign change, by the cubic through four samples."""
    at = []
    for i in np.flatnonzero(w[:-1] * w[1:] < 0.0)[:3]:
        t = times[i - 1 : i + 3] - times[i]
        root = np.polynomial.Polynomial.fit(w[i - 1 : i + 3], t, 3)(0.0)
        at.append(times[i] + root)
    return float(at[2] - at[0])


def dzhanibekov(binary, out):
    """A tenth of the rates for ten times as long, as above; two periods at most are flown."""
    row = Row("Dzhanibekov, I = (1, 2, 3)", "full period", "s", 21.955146)
    rates = np.array([0.01, 2.0, 0.01])
    for twin in ENGINES[:2]:
        t, w = _tumbler(binary, out / twin, [4e3, 8e3, 12e3], 0.1 * rates, 300.0, twin)
        row.found[twin] = 0.1 * _period(t, w[:, 1])
    row.found["mujoco"] = _period(*(lambda t, w: (t, w[:, 1]))(
        *_tumble_mujoco([1.0, 2.0, 3.0], rates, 34.0)))
    return [row]


# -- friction on a plane: not a docking, so that docktwin has it as unit tests of its law ----------


def _on_plane(rolling: bool, v0=2.0, mu=0.2, breakaway=1e-4, step=1e-4, end=1.2):
    """A block or ball on a plane with the law rewritten: force at every stage of RK4, bristle as an
    activation state. Radius 0.1 m, 2 kg. Times, places, speeds."""
    turn = '<joint type="hinge" axis="0 1 0"/>' if rolling else ""
    m = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" timestep="{step!r}" gravity="0 0 0">'
        f'<flag contact="disable"/></option><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>'
        f'{turn}<inertial pos="0 0 0" mass="2" diaginertia="0.008 0.008 0.008"/></body></worldbody>'
        f'<actuator><general joint="x" dyntype="integrator" gainprm="0" biastype="none"/></actuator>'
        f"</mujoco>"
    )
    d = mujoco.MjData(m)
    law = Friction(mu, mu, 3e-3, breakaway, 2e-3)

    def stage(_m, d):
        slip = d.qvel[0] - (0.1 * d.qvel[1] if rolling else 0.0)
        f, rate = law.force_and_rate(2.0 * G, np.array([slip, 0.0, 0.0]), np.array([d.act[0], 0, 0]))
        d.qfrc_passive[0] = f[0]
        if rolling:
            d.qfrc_passive[1] = -0.1 * f[0]
        d.ctrl[0] = rate[0]

    d.qvel[0] = v0
    return _slide(m, d, stage, end)


def _on_own_plane(rolling: bool, v0=2.0, mu=0.2, step=1e-4, end=1.2):
    """The same on MuJoCo's own contact and friction: sphere on plane, elliptic cone."""
    joints = '<joint type="slide" axis="1 0 0"/>'
    joints += '<joint type="hinge" axis="0 1 0"/>' if rolling else ""
    m = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" timestep="{step!r}" gravity="0 0 -{G}" cone="elliptic" '
        f'impratio="100" tolerance="1e-14"/><default><geom solref="{4 * step!r} 1" condim="3" '
        f'friction="{mu} 0 0"/></default><worldbody><geom type="plane" size="9 9 1"/>'
        f'<body pos="0 0 0.1"><joint type="slide" axis="0 0 1"/>{joints}<inertial pos="0 0 0" mass="2" '
        f'diaginertia="0.008 0.008 0.008"/><geom type="sphere" size="0.1"/></body></worldbody></mujoco>'
    )
    d = mujoco.MjData(m)
    mujoco.mj_step(m, d, nstep=round(0.1 / step))
    d.time = 0.0
    d.qpos[1] = 0.0
    d.qvel[1] = v0
    return _slide(m, d, None, end, 1)


def _slide(m, d, stage, end, at=0):
    out = [(0.0, d.qpos[at], d.qvel[at])]
    mujoco.set_mjcb_passive(stage)
    try:
        while d.time < end:
            mujoco.mj_step(m, d)
            out.append((d.time, d.qpos[at], d.qvel[at]))
    finally:
        mujoco.set_mjcb_passive(None)
    return np.array(out).T


def block(_binary=None, _out=None):
    """v0 = 2 m/s, mu = 0.2: to rest."""
    want = 2.0 / (0.2 * G)
    rows = [Row("sliding block, 2 m/s, µ = 0.2", q, u, want) for q, u in
            (("distance", "m"), ("time", "s"))]
    for engine, run in (("mujoco", _on_plane(False)), ("own", _on_own_plane(False))):
        t, x, v = run
        # To rest: the straight line of the sliding speed, continued; regularised friction creeps.
        i = int(np.argmax(v < 0.02))
        rows[0].found[engine] = float(x[int(np.argmax(v < 1e-4)) if (v < 1e-4).any() else -1])
        rows[1].found[engine] = float(t[i] + v[i] * (t[i] - t[i - 200]) / (v[i - 200] - v[i]))
    for row in rows:
        row.found["reduced"] = row.found["full"] = "≤ 0.1 %, unit test"
    return rows


def ball(_binary=None, _out=None):
    """From slipping to rolling."""
    row = Row("ball, slip to roll, 2 m/s, µ = 0.2", "speed", "m/s", 2.0 * 5.0 / 7.0)
    row.found["reduced"] = row.found["full"] = "≤ 0.1 %, unit test"
    row.found["mujoco"] = float(_on_plane(True, end=0.6)[2][-1])
    row.found["own"] = float(_on_own_plane(True, end=0.6)[2][-1])
    return [row]


def _bind(function, *args):
    return lambda binary, out: function(binary, out, *args)


CASES = {
    "nesc": nesc,
    "dzhanibekov": dzhanibekov,
    "spring": spring_8_12,
    **{f"hunt_crossley_{n:g}_{d:g}": _bind(hunt_crossley, d, n)
       for n in (1.0, 1.5) for d in (0.05, 0.1, 0.2, 0.5, 1.0)},
    **{f"kelvin_voigt_{name}": _bind(kelvin_voigt, c) for name, c in (
        ("0.05", 2 * 0.05 * math.sqrt(1e6 * cf.MASS_KG)),
        ("0.2", 2 * 0.2 * math.sqrt(1e6 * cf.MASS_KG)), ("4000", 4000.0))},
    "hertz": hertz,
    "roll": roll,
    **{case: _bind(oblique, case) for case in cf.SLOW},
    "block": block,
    "ball": ball,
}
