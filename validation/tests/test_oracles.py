"""What this side must get right on its own, against closed forms, before it may judge docktwin."""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np
import pytest

from docktwin_mujoco.law import ContactLaw, Friction, HuntCrossley, KelvinVoigt
from docktwin_mujoco.models import Spacecraft, read_mechanism, read_spacecraft
from docktwin_mujoco.scene import Body, Docking, State, build, get_state, set_state

ZERO, UPRIGHT = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])


def tumble(inertia, rate, step, end):
    m = build([Body("b", 1.0, np.diag(inertia))], step)
    d = mujoco.MjData(m)
    set_state(m, d, "b", State(ZERO, UPRIGHT, ZERO, np.array(rate)))
    mujoco.mj_step(m, d, nstep=round(end / step))
    return m, d


def test_oracle_nesc_check_case_2(figure):
    _, d = tumble((0.001894220, 0.006211019, 0.007194665), np.radians([10.0, 20.0, 30.0]), 1e-3, 30)
    got = np.degrees(d.qvel[3:6])
    error = np.abs(got - [12.61839077591, -17.39747476161, 31.11958888694]).max()
    figure(f"{got} deg/s, error {error:.1e}")
    assert error < 1e-6


def test_oracle_dzhanibekov_full_period(figure):
    m = build([Body("b", 1.0, np.diag([1.0, 2.0, 3.0]))], 1e-3)
    d = mujoco.MjData(m)
    set_state(m, d, "b", State(ZERO, UPRIGHT, ZERO, np.array([0.01, 2.0, 0.01])))
    crossings, before = [], 2.0
    while len(crossings) < 3:
        mujoco.mj_step(m, d)
        now = d.qvel[4]
        if before * now < 0.0:
            crossings.append(d.time - m.opt.timestep * now / (now - before))
        before = now
    period = crossings[2] - crossings[0]
    figure(f"{period:.6f} s")
    assert period == pytest.approx(21.955146, abs=2e-6)


@pytest.fixture(scope="module")
def rings(models):
    """The test bodies of 8 t and 12 t with bare rings."""
    return (
        read_spacecraft(models / "test_8t.urdf"),
        read_spacecraft(models / "test_12t.urdf"),
        read_mechanism(models / "ring_active.urdf", models / "ring_passive.urdf"),
    )


def head_on(rings, law, step, v=0.35, end=0.3, masses=None, start_depth=-1e-3, t0=0.0):
    """Coaxial rings. Face to face they store a little more than tilted by some tens of micrometres, so
    that rounding would grow into a tilt: bodies too heavy to turn keep them flat."""
    chaser, target, mech = rings
    masses = masses or (chaser.mass_kg, target.mass_kg)
    chaser, target = (
        dataclasses.replace(c, mass_kg=m, inertia_kg_m2=1e9 * m * np.eye(3))
        for c, m in zip((chaser, target), masses)
    )
    mech = dataclasses.replace(
        mech, law=law, ring_body=dataclasses.replace(
            mech.ring_body, mass_kg=1e-6, inertia_kg_m2=1e-6 * np.eye(3)
        ),
    )
    dock = Docking(chaser, target, mech, step)
    x = dock.p_1[0] + 0.05 - start_depth - dock.p_2[0]
    a = State(ZERO, UPRIGHT, np.array([v, 0.0, 0.0]), ZERO)
    b = State(np.array([x, 0.0, 0.0]), UPRIGHT, ZERO, ZERO)
    result = dock.run(a, b, end, t0)
    return dock, result, (result.target.v - result.chaser.v)[0] / v


def contact_time(r):
    """Edges by extrapolating the force of the first and of the last two samples to zero."""
    (t0, f0), (t1, f1) = r.forces[:2]
    start = t0 - f0 * (t1 - t0) / (f1 - f0)
    (t0, f0), (t1, f1) = r.forces[-2:]
    return t1 - f1 * (t1 - t0) / (f1 - f0) - start


def test_oracle_8_t_against_12_t_on_a_spring(rings, figure):
    _, r, e = head_on(rings, ContactLaw(HuntCrossley(1e6)), 5e-4)
    time = contact_time(r)
    depth = r.peak_force_n / 1e6
    figure(f"T {time:.6f} s, depth {1e3 * depth:.4f} mm, {r.peak_force_n:.1f} N, e {e:.7f}")
    assert time == pytest.approx(0.2176559, rel=1e-5)
    # The step does not fall on the very crest: 1 - (omega h / 2)^2 / 2 at worst.
    assert r.peak_force_n == pytest.approx(24248.71, rel=4e-5)
    assert e == pytest.approx(1.0, abs=1e-6)
    assert r.impulse_ns[0] == pytest.approx(4800 * 0.35 * 2, rel=1e-6)


def test_oracle_8_t_against_12_t_with_4000_n_s_m(rings, figure):
    _, _, e = head_on(rings, ContactLaw(KelvinVoigt(1e6, 4000.0)), 2.5e-4)
    zeta = 4000.0 / (2.0 * math.sqrt(1e6 * 4800.0))
    phi = math.atan2(2 * zeta * math.sqrt(1 - zeta**2), 2 * zeta**2 - 1)
    want = math.exp(-zeta * phi / math.sqrt(1 - zeta**2))
    figure(f"e {e:.6f}, closed form {want:.6f}")
    assert want == pytest.approx(0.9148, abs=5e-5)
    # The damper starts with a step of force, at a place between two steps.
    assert e == pytest.approx(want, rel=1e-4)


@pytest.mark.parametrize("zeta,printed", [(0.05, 0.8588), (0.2, 0.5717)])
def test_oracle_kelvin_voigt_restitution(rings, figure, zeta, printed):
    law = ContactLaw(KelvinVoigt(1e6, 2.0 * zeta * math.sqrt(1e6 * 4800.0)))
    _, _, e = head_on(rings, law, 1.25e-4)
    phi = math.atan2(2 * zeta * math.sqrt(1 - zeta**2), 2 * zeta**2 - 1)
    want = math.exp(-zeta * phi / math.sqrt(1 - zeta**2))
    figure(f"e {e:.6f}, closed form {want:.6f}")
    assert want == pytest.approx(printed, abs=5e-5)
    # As above, and a larger step of force.
    assert e == pytest.approx(want, rel=3e-4)


@pytest.mark.parametrize(
    "d,printed", [(0.05, 0.96774), (0.1, 0.93748), (0.2, 0.88219), (0.5, 0.74843), (1.0, 0.59362)]
)
def test_oracle_hunt_crossley_restitution(rings, figure, d, printed):
    _, _, e = head_on(rings, ContactLaw(HuntCrossley(1e6, 1.0, d / 0.35)), 5e-4)
    residual = math.log((1 + d) / (1 - e * d)) - d * (1 + e)
    figure(f"e {e:.6f}, printed {printed}, residual of the closed form {residual:.1e}")
    assert e == pytest.approx(printed, abs=2e-5)


def test_oracle_hertz_sphere_law(rings, figure):
    law = ContactLaw(HuntCrossley(1e9, 1.5, 0.0))
    _, r, e = head_on(rings, law, 1e-4, v=0.1, end=0.055)
    # The law of exponent 1.5 starts flat: take the time between equal forces from the impulse.
    depth = (r.peak_force_n / 1e9) ** (2 / 3)
    figure(f"depth {1e3 * depth:.5f} mm, {r.peak_force_n:.1f} N, e {e:.8f}")
    assert depth == pytest.approx(1.29199e-3, rel=1e-5)
    assert r.peak_force_n == pytest.approx(46440.0, rel=1e-4)
    assert e == pytest.approx(1.0, abs=1e-6)


def test_invariant_the_force_is_integrated_with_the_order_of_rk4(rings, figure):
    """In contact from start to end, so that nothing but the callback's order shows. A force held
    over the step would converge with the step itself."""
    law = ContactLaw(HuntCrossley(1e6))
    omega = math.sqrt(1e6 / 4800.0)
    errors = []
    for step in (8e-3, 4e-3, 2e-3):
        dock, _, _ = head_on(rings, law, step, end=0.0, start_depth=1e-3)
        start = dock.data
        f0 = dock.force_n
        assert f0 > 900.0
        a, b = (get_state(dock.model, start, n) for n in ("chaser", "target"))
        r = dock.run(a, b, 0.16)
        # Depth (f/k) swings as A sin; the end is still in contact.
        phase = math.atan2(f0 / 1e6, 0.35 / omega)
        amp = math.hypot(f0 / 1e6, 0.35 / omega)
        want = -amp * omega * math.cos(omega * 0.16 + phase)
        errors.append(abs((r.target.v - r.chaser.v)[0] - want))
    orders = [math.log2(a / b) for a, b in zip(errors, errors[1:])]
    figure(f"errors {', '.join(f'{e:.1e}' for e in errors)} m/s, orders {orders[0]:.2f}, {orders[1]:.2f}")
    assert min(orders) > 3.7


def test_oracle_mujocos_own_contact_gives_the_same_spring(figure):
    """A third way: MuJoCo's soft contact with solref = (-k/m_eff, -b/m_eff)."""
    k, m_eff = 1e6, 4800.0
    m = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" timestep="0.001" gravity="0 0 0" cone="elliptic">'
        f'<flag contact="enable"/></option><worldbody>'
        f'<body name="a"><joint type="slide" axis="1 0 0"/><geom type="sphere" size="0.1" '
        f'mass="8000" solref="{-k / m_eff!r} 0" solimp="0 0.9999 1e-12 0.5 1" condim="1"/></body>'
        f'<body name="b" pos="0.2005 0 0"><joint type="slide" axis="1 0 0"/><geom type="sphere" '
        f'size="0.1" mass="12000" solref="{-k / m_eff!r} 0" solimp="0.9999 0.9999 1e-12 0.5 1" '
        f'condim="1"/></body></worldbody></mujoco>'
    )
    m.geom_solimp[:] = [0.9999, 0.9999, 1e-12, 0.5, 1]
    d = mujoco.MjData(m)
    d.qvel[0] = 0.35
    deepest = 0.0
    for _ in range(300):
        mujoco.mj_step(m, d)
        deepest = max(deepest, d.qpos[0] - d.qpos[1] - 0.0005)
    e = (d.qvel[1] - d.qvel[0]) / 0.35
    figure(f"depth {1e3 * deepest:.3f} mm, e {e:.5f}")
    assert deepest == pytest.approx(24.249e-3, rel=1e-3)
    assert e == pytest.approx(1.0, abs=2e-3)


def test_invariant_momentum_and_energy_in_an_oblique_elastic_collision(models, figure):
    """Petals and rings, tilted, off centre, turning; without friction and damping."""
    chaser = read_spacecraft(models / "test_8t.urdf")
    target = read_spacecraft(models / "test_12t.urdf")
    mech = read_mechanism(models / "apas_active.urdf", models / "apas_passive.urdf")
    mech = dataclasses.replace(mech, law=ContactLaw(HuntCrossley(1e6), None, 5e-5))
    dock = Docking(chaser, target, mech, 5e-4)
    x = dock.p_1[0] + 0.2 - dock.p_2[0]
    a = State(ZERO, UPRIGHT, np.array([0.2, 0.01, -0.005]), np.array([0.005, 0.003, -0.004]))
    half = 0.5 * np.array([0.1, 0.02, -0.015])
    q = np.array([math.sqrt(1 - half @ half), *half])
    b = State(np.array([x, 0.03, 0.02]), q, ZERO, np.array([0.0, -0.002, 0.003]))

    def momenta():
        d, m = dock.data, dock.model
        out = np.zeros((2, 3))
        for i in range(1, m.nbody):
            v = np.zeros(6)
            mujoco.mj_objectVelocity(m, d, mujoco.mjtObj.mjOBJ_BODY, i, v, 0)
            # Of mjOBJ_BODY: at the mass centre, in world axes, angular part first.
            v_c = v[3:]
            r_in = d.ximat[i].reshape(3, 3)
            out[0] += m.body_mass[i] * v_c
            out[1] += m.body_mass[i] * np.cross(d.xipos[i], v_c)
            out[1] += r_in @ np.diag(m.body_inertia[i]) @ r_in.T @ v[:3]
        return out

    log = []

    def keep(t, docking):
        if not log:
            energy = docking.kinetic_j() + docking.energy_j
            log.append((energy, momenta()))

    r = dock.run(a, b, 1.2, on_step=keep)
    before, p_before = log[0]
    mujoco.mj_forward(dock.model, dock.data)
    p_after = momenta()
    de = abs(r.energy_j - before) / before
    dp = np.linalg.norm(p_after[0] - p_before[0]) / np.linalg.norm(p_before[0])
    dl = np.linalg.norm(p_after[1] - p_before[1]) / np.linalg.norm(p_before[1])
    figure(f"{sorted(r.pairs)}, peak {r.peak_force_n:.0f} N, energy {de:.1e}, momentum {dp:.1e}, "
           f"angular {dl:.1e}")
    assert r.peak_force_n > 1000.0
    assert de < 1e-4 and dp < 1e-12 and dl < 1e-8


def test_oracle_sliding_block_stops_as_coulomb_says(figure):
    """v0 = 2 m/s, mu = 0.2, g = 9.81: 1.01937 m, 1.01937 s, nearer as the bristle shortens."""
    errors = []
    for s0 in (1e-3, 1e-4):
        law = Friction(0.2, 0.2, 1e-3, s0, 0.0)
        v, x, h, t = 2.0, 0.0, 1e-5, 0.0
        y = np.array([1.0, 0.0, 0.0])
        while v > 0.0:
            f, rate = law.force_and_rate(9.81, np.array([v, 0.0, 0.0]), y)
            x, v, t = x + h * v, v + h * f[0], t + h
            y = y + h * rate
        errors.append((abs(x - 1.01937), abs(t - 1.01937)))
    figure(", ".join(f"{e[0]:.1e} m {e[1]:.1e} s" for e in errors))
    assert max(errors[1]) < 1e-3


def test_invariant_mass_properties_of_the_urdf_reach_mujoco(models):
    craft = read_spacecraft(models / "chaser_8t.urdf")
    skewed = Spacecraft("skewed", craft.mass_kg, craft.inertia_kg_m2 + np.array(
        [[0.0, 120.0, -300.0], [120.0, 0.0, 80.0], [-300.0, 80.0, 0.0]]
    ), craft.r_body_port, craft.p_body_port_m)
    m = build([Body.of("chaser", skewed)], 1e-3)
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)
    full = np.zeros((6, 6))
    mujoco.mj_fullM(m, d, full)
    assert np.abs(full[:3, :3] - craft.mass_kg * np.eye(3)).max() < 1e-9
    assert np.abs(full[3:, 3:] - skewed.inertia_kg_m2).max() < 1e-10 * craft.inertia_kg_m2.max()
