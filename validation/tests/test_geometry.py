"""Distances and forces of this side's own geometry, against brute force and MuJoCo's shapes."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from docktwin_mujoco.contact import Contact, Side
from docktwin_mujoco.geometry import TAU, Pair, PetalCore, RingCore
from docktwin_mujoco.law import ContactLaw, Friction, HuntCrossley
from docktwin_mujoco.models import Petals, read_mechanism

# +X of the passive ring points back to the active one.
TURNED = np.diag([-1.0, -1.0, 1.0])


def turn(v):
    """Rotation vector to matrix."""
    q, m = np.empty(4), np.empty(9)
    angle = np.linalg.norm(v)
    mujoco.mju_axisAngle2Quat(q, np.asarray(v) / angle if angle > 0 else np.array([1.0, 0, 0]), angle)
    mujoco.mju_quat2Mat(m, q)
    return m.reshape(3, 3)


def sample(core, n):
    lower = np.where(np.isinf(core.lower), 0.0, core.lower)
    upper = np.where(np.isinf(core.upper), TAU, core.upper)
    axes = [np.linspace(a, b, n) for a, b in zip(lower, upper)]
    z = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))
    return np.array([core.at(i)[0] for i in z])


def poses(rng, count):
    for _ in range(count):
        r = turn(rng.normal(size=3) * 0.05) @ turn([rng.uniform(-0.5, 0.5), 0, 0]) @ TURNED
        yield r, np.array([rng.uniform(0.05, 0.4), *rng.normal(size=2) * 0.05])


@pytest.fixture(scope="module")
def apas(models):
    return read_mechanism(models / "apas_active.urdf", models / "apas_passive.urdf")


@pytest.fixture(scope="module")
def pairs(apas):
    a, b = apas.active.cores(), apas.passive.cores()
    return [Pair(x, y) for x in a[:2] for y in b]


def test_oracle_no_sample_is_closer_than_the_distance_found(pairs, figure):
    rng = np.random.default_rng(7)
    seen, above, below = 0, 0.0, np.inf
    dense = {id(p): (sample(p.a, 600 if len(p.a.lower) == 1 else 31),
                     sample(p.b, 600 if len(p.b.lower) == 1 else 31)) for p in pairs}
    for r, p in poses(rng, 12):
        for pair in pairs:
            pa, pb = dense[id(pair)]
            pb = pb @ r.T + p
            sq = (pa**2).sum(1)[:, None] + (pb**2).sum(1)[None, :] - 2.0 * pa @ pb.T
            brute = math.sqrt(max(float(sq.min()), 0.0))
            if brute < 0.012:
                continue
            found = pair.reach_m - pair.deepest(r, p).depth_m
            seen += 1
            above, below = max(above, found - brute), min(below, found - brute)
    figure(f"{seen} pairs, found less sampled distance {below:.1e} .. {above:.1e} m")
    assert seen > 50
    # Samples can only be farther; by how much depends on their spacing.
    assert above < 1e-9 and below > -5e-3


def test_oracle_depths_agree_with_mujocos_own_shapes(pairs, figure):
    """Third opinion: ring and rulings as chains of capsules, distances by mj_geomDistance."""
    rng = np.random.default_rng(3)
    n_ring, n_petal = 360, 41

    def chain(core, name):
        if isinstance(core, RingCore):
            at = np.linspace(0.0, TAU, n_ring + 1)
            pts = [core.at([a])[0] for a in at]
            ends = list(zip(pts, pts[1:]))
        else:
            ends = [(core.at([u, 0.0])[0], core.at([u, 1.0])[0])
                    for u in np.linspace(-1.0, 1.0, n_petal)]
        geoms = "".join(
            f'<geom type="capsule" size="{core.radius_m}" fromto="'
            + " ".join(repr(float(x)) for x in (*a, *b)) + '"/>'
            for a, b in ends
        )
        return f'<body name="{name}" mocap="true">{geoms}</body>'

    worst, seen = 0.0, 0
    for pair in (pairs[0], pairs[1], pairs[4]):
        m = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{chain(pair.a, 'a')}{chain(pair.b, 'b')}</worldbody></mujoco>"
        )
        d = mujoco.MjData(m)
        mid = [m.body(x).mocapid[0] for x in "ab"]
        for r, p in poses(rng, 4):
            place = pair.deepest(r, p)
            if place.depth_m > 0.9 * pair.reach_m:
                continue
            d.mocap_pos[mid[1]] = p
            mujoco.mju_mat2Quat(d.mocap_quat[mid[1]], r.ravel())
            mujoco.mj_kinematics(m, d)
            ga = range(m.body("a").geomadr[0], m.body("a").geomadr[0] + m.body("a").geomnum[0])
            gb = range(m.body("b").geomadr[0], m.body("b").geomadr[0] + m.body("b").geomnum[0])
            # Only pieces near the place can be the closest ones.
            pt_a, pt_b = place.point_m, place.point_m

            def near(geoms, pt):
                half = m.geom_size[list(geoms), 1]
                gap = np.linalg.norm(d.geom_xpos[list(geoms)] - pt, axis=1) - half
                return [g for g, ok in zip(geoms, gap < 0.3) if ok]

            least = min(
                mujoco.mj_geomDistance(m, d, i, j, 2.0, None)
                for i in near(ga, pt_a) for j in near(gb, pt_b)
            ) if -place.depth_m < 0.2 else None
            if least is None:
                continue
            seen += 1
            worst = max(worst, abs(least + place.depth_m))
    figure(f"{seen} poses, worst difference {worst:.1e} m (chords of a 0.6 m ring: 2.3e-5 m)")
    assert seen >= 6
    assert worst < 3e-4


@pytest.mark.parametrize(
    "pair,at,places",
    [
        ("ring-ring", ((0.02, 0.01, -0.015), (0.035, 0.02, 0.03)), 1),
        ("ring-ring", ((0.0, 0.0002, 0.0001), (0.045, 0.0001, 0.0)), 1),
        ("ring-ring", ((0.0, 0.0, 0.0), (0.045, 0.01, 0.004)), 2),
        ("ring-ring", ((0.0, 0.002, 0.001), (0.045, 0.02, 0.0)), 2),
        ("ring-petal0", ((0.3, 0.02, 0.03), (0.15, 0.02, -0.1)), 1),
        ("petal0-ring", ((0.1, -0.03, 0.01), (0.15, 0.09, 0.03)), 1),
        ("petal1-ring", ((0.0, 0.0, 0.0), (0.12, -0.05, 0.0866)), 1),
        ("petal0-petal2", ((0.25, 0.02, 0.01), (0.22, 0.0, 0.0)), 1),
    ],
)
def test_invariant_force_is_the_gradient_of_the_stored_energy(apas, figure, pair, at, places):
    """Displaces the passive side by 1e-7 along each of the six freedoms; friction and damping off.
    Without it sliding along a petal would make or lose energy."""
    law = ContactLaw(HuntCrossley(1e6), None, 5e-5)
    contact = Contact(apas.active, apas.passive, law)
    contact.pairs = [s for s in contact.pairs if s.name == pair]
    r0, p0 = turn(at[0]) @ TURNED, np.array(at[1])
    # Bring the pair to 3 mm of depth along its own normal.
    for _ in range(20):
        place = contact.pairs[0].pair.deepest(r0, p0)
        p0 = p0 + (place.depth_m - 3e-3) * place.normal
    still, bristle = np.zeros(3), np.zeros((2, 3))

    def energy(r, p):
        return sum(q.energy_j for _, _, q in contact.evaluate(r, p, still, still, bristle)[2])

    wrench, _, pushes = contact.evaluate(r0, p0, still, still, bristle)
    numeric, h = np.empty(6), 1e-7
    for k in range(6):
        e = np.zeros(3)
        e[k % 3] = h
        if k < 3:
            up, down = energy(r0, p0 + e), energy(r0, p0 - e)
        else:
            up, down = energy(turn(e) @ r0, turn(e) @ p0), energy(turn(-e) @ r0, turn(-e) @ p0)
        numeric[k] = -(up - down) / (2 * h)
    error = np.abs(wrench - numeric).max() / np.abs(wrench).max()
    figure(f"{len(pushes)} place(s), {np.linalg.norm(wrench[:3]):.1f} N, error {error:.1e}")
    assert np.linalg.norm(wrench[:3]) > 1000.0
    assert len(pushes) == places
    assert error < 1e-5


def test_oracle_a_touch_spread_around_the_ring_pushes_with_k_through_its_centre(figure):
    side = Side(0.6, 0.025)
    contact = Contact(side, side, ContactLaw(HuntCrossley(1e6), None, 5e-5))
    zero, y = np.zeros(3), np.zeros((2, 3))
    f = [contact.evaluate(TURNED, np.array([x, 0, 0]), zero, zero, y)[0] for x in (0.03, 0.029)]
    figure(f"{(f[1] - f[0])[0]:.9f} N more for 1 mm, moment {np.abs(f[0][3:]).max():.1e} N m")
    assert (f[1] - f[0])[0] == pytest.approx(1000.0, rel=1e-9)
    assert np.abs(f[0][1:]).max() < 1e-9 * f[0][0]


def test_oracle_crossing_rings_push_at_two_places_with_k_each(figure):
    side = Side(0.6, 0.025)
    contact = Contact(side, side, ContactLaw(HuntCrossley(1e6), None, 5e-5))
    zero, y = np.zeros(3), np.zeros((2, 3))
    f = [contact.evaluate(TURNED, np.array([x, 0.1, 0]), zero, zero, y) for x in (0.047, 0.046)]
    slope = (f[1][0] - f[0][0])[0] / 1e-3
    # A place of temperature eps spreads over normals of variance eps/d, d the core distance.
    want = 2e6 * (1.0 - 5e-5 / 0.0465)
    figure(f"{len(f[0][2])} places, {slope:.6e} N/m, wanted {want:.6e}")
    assert len(f[0][2]) == 2
    assert slope == pytest.approx(want, rel=1e-4)


def test_oracle_friction_opposes_sliding_with_mu_times_the_normal_force(figure):
    side = Side(0.6, 0.025)
    r, p = turn([0.0, 0.05, 0.0]) @ TURNED, np.array([0.06, 0.0, 0.0])
    v = np.array([0.0, 0.03, 0.02])
    normal = HuntCrossley(1e6)
    smooth = Contact(side, side, ContactLaw(normal, None, 5e-5))
    rough = Contact(side, side, ContactLaw(normal, Friction(0.1, 0.1, 3e-3, 3e-4, 0.0), 5e-5))
    still, y = np.zeros(3), np.zeros((2, 3))
    base, _, (place,) = smooth.evaluate(r, p, v, still, y)
    n = place[2].normal
    v_t = v - n * (n @ v)
    # A bristle in the steady state of sliding no longer moves.
    y[:] = v_t / np.linalg.norm(v_t)
    both, rates, _ = rough.evaluate(r, p, v, still, y)
    friction = both[:3] - base[:3]
    want = -0.1 * place[2].normal_n * y[0]
    figure(f"N {place[2].normal_n:.1f} N, friction {np.linalg.norm(friction):.2f} N")
    assert place[2].normal_n > 1000.0
    assert friction == pytest.approx(want, rel=1e-9, abs=1e-9)
    assert np.abs(rates[place[1]]).max() < 1e-9
    assert both[3:] - base[3:] == pytest.approx(np.cross(place[2].point_m, want), abs=1e-9)


def test_oracle_an_even_touch_resists_roll_with_mu_times_radius_times_the_normal_force(figure):
    """Sliding and turning share one bristle: at rest relative to the axis the turning takes all of
    it, and sliding sideways while turning they share it like the components of the slip."""
    side = Side(0.6, 0.025)
    p, w = np.array([0.045, 0.0, 0.0]), np.array([0.02, 0.0, 0.0])
    normal, friction = HuntCrossley(1e6), Friction(0.1, 0.1, 3e-3, 3e-4, 0.0)
    smooth = Contact(side, side, ContactLaw(normal, None, 5e-5))
    rough = Contact(side, side, ContactLaw(normal, friction, 5e-5))
    seen = []
    for v in (np.zeros(3), np.array([0.0, 0.009, 0.0])):
        y = np.zeros((2, 3))
        base, _, ((_, slot, place),) = smooth.evaluate(TURNED, p, v, w, y)
        slip = v + 0.6 * w
        y[slot] = slip / np.linalg.norm(slip)
        both, rates, _ = rough.evaluate(TURNED, p, v, w, y)
        limit = 0.1 * place.normal_n
        assert place.spread_m == pytest.approx(0.6, rel=1e-9)
        assert np.abs(rates[slot]).max() < 1e-9
        rubbed = both - base
        assert rubbed[:3] == pytest.approx(-limit * v / np.linalg.norm(slip), abs=1e-9 * limit)
        assert rubbed[3] == pytest.approx(-limit * 0.6 * 0.012 / np.linalg.norm(slip), rel=1e-9)
        seen.append(rubbed[3] / limit)
    figure(f"moment by mu N: {seen[0]:.9f} m turning only, {seen[1]:.9f} m with sliding")


def test_invariant_merging_places_rub_with_no_more_than_the_normal_force(figure):
    """Two places of crossing rings become one as the rings are laid on each other."""
    side = Side(0.6, 0.025)
    contact = Contact(
        side, side, ContactLaw(HuntCrossley(1e6), Friction(0.1, 0.1, 3e-3, 3e-4, 0.0), 5e-5)
    )
    still, y = np.zeros(3), np.zeros((2, 3))
    places, ratio, last, jump = set(), [], None, 0.0
    for offset in np.linspace(0.02, 0.0, 201):
        wrench, _, pushes = contact.evaluate(TURNED, np.array([0.046, offset, 0.0]), still, still, y)
        rubbing = sum(q.normal_n for _, _, q in pushes)
        places.add(len(pushes))
        ratio.append(rubbing / np.linalg.norm(wrench[:3]))
        if last is not None:
            jump = max(jump, abs(rubbing - last) / last)
        last = rubbing
    figure(f"rubbing by pushing {min(ratio):.4f} .. {max(ratio):.4f}, largest change {jump:.4f}")
    assert places == {1, 2}
    assert 0.97 < min(ratio) and max(ratio) < 1.03
    assert jump < 0.05


def test_oracle_petal_is_softer_towards_its_tip_like_a_cantilever():
    from docktwin_mujoco.law import petal_stiffness

    assert petal_stiffness(1e6, 1.6e4, 0.0)[0] == 1e6
    k, slope = petal_stiffness(1e6, 1.6e4, 0.2)
    assert 1.0 / k == pytest.approx(1e-6 + 0.2**3 / 4.8e4, rel=1e-12)
    h = 1e-6
    numeric = (petal_stiffness(1e6, 1.6e4, 0.2 + h)[0] - petal_stiffness(1e6, 1.6e4, 0.2 - h)[0])
    assert slope == pytest.approx(numeric / (2 * h), rel=1e-6)


def test_invariant_a_petal_is_ruled_between_its_two_arcs():
    petals = Petals(3, 0.3, 0.597, 0.41, 0.187, 0.49, 0.24, 0.02, 1.6e4)
    core = PetalCore(petals, 1)
    a = 0.3 + TAU / 3
    for u in (-1.0, 0.4, 1.0):
        base, tip = core.at([u, 0.0])[0], core.at([u, 1.0])[0]
        for p, x, r, half in ((base, 0.0, 0.597, 0.49), (tip, 0.187, 0.41, 0.24)):
            az = a + u * half
            assert p == pytest.approx([x, r * math.cos(az), r * math.sin(az)], abs=1e-15)
        assert core.at([u, 0.25])[0] == pytest.approx(0.75 * base + 0.25 * tip, abs=1e-15)
