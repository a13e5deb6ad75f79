"""Depths and forces of this side's own contact, against brute force, MuJoCo's shapes and closed forms."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from docktwin_mujoco import cells, kernel as k, places as pl
from docktwin_mujoco.contact import Contact, Side
from docktwin_mujoco.law import ContactLaw, Friction, HuntCrossley, KelvinVoigt
from docktwin_mujoco.models import Petals, read_mechanism

TAU = 2.0 * math.pi
# +X of the passive ring points back to the active one.
TURNED = np.diag([-1.0, -1.0, 1.0])
RINGS = Side(0.6, 0.025)
ELASTIC = ContactLaw(HuntCrossley(1e6), None, 5e-5)
ROUGH = ContactLaw(HuntCrossley(1e6), Friction(0.1, 0.1, 3e-3, 3e-4, 0.0), 5e-5)
ZERO = np.zeros(3)


def turn(v):
    """Rotation vector to matrix."""
    q, m = np.empty(4), np.empty(9)
    angle = np.linalg.norm(v)
    mujoco.mju_axisAngle2Quat(q, np.asarray(v) / angle if angle > 0 else np.array([1.0, 0, 0]), angle)
    mujoco.mju_quat2Mat(m, q)
    return m.reshape(3, 3)


def straight():
    """Bristles before the first touch."""
    return np.zeros((Contact.bristles, 3))


def still(contact, r, p):
    """Contact at rest, of a pose alone."""
    contact.forget()
    return contact.evaluate(r, p, ZERO, ZERO, straight())


@pytest.fixture(scope="module")
def apas(models):
    return read_mechanism(models / "apas_active.urdf", models / "apas_passive.urdf")


# -- surfaces again, in numpy ------------------------------------------------------------------------


def on_petal(petals, i, u, w):
    """Points of a petal's middle surface."""
    a = petals.first_azimuth_rad + i * TAU / petals.count
    b, t = a + u * petals.base_half_angle_rad, a + u * petals.tip_half_angle_rad
    foot = np.stack([0.0 * u, petals.base_radius_m * np.cos(b), petals.base_radius_m * np.sin(b)], -1)
    tip = np.stack(
        [petals.height_m + 0.0 * u, petals.tip_radius_m * np.cos(t), petals.tip_radius_m * np.sin(t)], -1
    )
    return foot + w[..., None] * (tip - foot)


def on_ring(side, a):
    """Points of a ring's circle."""
    return np.stack([0.0 * a, side.ring_mean_radius_m * np.cos(a), side.ring_mean_radius_m * np.sin(a)], -1)


def compliance(petals, w):
    """k_c/k(s) - 1 of a petal, k_c = 1e6 N/m."""
    s = w * math.hypot(petals.height_m, petals.tip_radius_m - petals.base_radius_m)
    return 1e6 * s**3 / (3.0 * petals.flexural_rigidity_n_m2)


def effective(mech, pair, r, p):
    """Effective depth of a pair as a function of parameters (n, ...), and the bounds of those that belong
    to the divided surface and of the others. Written from the page, n = 1."""
    a, b = mech.active, mech.passive

    def to_circle(points, side):
        rho = np.hypot(points[:, 1], points[:, 2])
        return np.hypot(rho - side.ring_mean_radius_m, points[:, 0])

    if pair == 0:
        def f(z):
            x = (on_ring(a, z[:, 0]) - p) @ r
            return a.ring_section_radius_m + b.ring_section_radius_m - to_circle(x, b)
        return f, []
    if pair <= 6:
        own, other, i = (a, b, pair - 1) if pair <= 3 else (b, a, pair - 4)

        def f(z):
            x = on_petal(own.petals, i, z[:, 0], z[:, 1])
            x = (x - p) @ r if pair <= 3 else x @ r.T + p
            delta = 0.5 * own.petals.thickness_m + other.ring_section_radius_m - to_circle(x, other)
            return delta / np.sqrt(1.0 + compliance(own.petals, z[:, 1]))
        return f, []

    def f(z):
        x = on_petal(a.petals, (pair - 7) // 3, z[:, 0], z[:, 1])
        y = on_petal(b.petals, (pair - 7) % 3, z[:, 2], z[:, 3]) @ r.T + p
        delta = 0.5 * (a.petals.thickness_m + b.petals.thickness_m) - np.linalg.norm(x - y, axis=1)
        return delta / np.sqrt(1.0 + compliance(a.petals, z[:, 1]) + compliance(b.petals, z[:, 3]))
    return f, [(-1.0, 1.0), (0.0, 1.0)]


def boxes(pair):
    """Bounds of every element on the divided surface."""
    if pair == 0:
        h = TAU / 32
        return [[(i * h, (i + 1) * h)] for i in range(32)] + [[(i * h, i * h)] for i in range(32)]
    e, half = np.linspace(-1.0, 1.0, 5), [(0.0, 0.5), (0.5, 1.0)]
    out = [[(e[i], e[i + 1]), half[h]] for i in range(4) for h in range(2)]
    out += [[(e[b], e[b]), half[h]] for b in (1, 2, 3) for h in range(2)]
    out += [[(e[i], e[i + 1]), (0.5, 0.5)] for i in range(4)]
    return out + [[(e[b], e[b]), (0.5, 0.5)] for b in (1, 2, 3)]


def highest(f, bounds, rng, n):
    """Largest value within bounds: samples, then ever smaller random steps from the best of them and from
    the best that is far from it."""
    lo, hi = np.array(bounds, float).T
    ends = np.array(np.meshgrid(*bounds)).reshape(len(bounds), -1).T
    z = np.concatenate([lo + rng.random((n, len(lo))) * (hi - lo), ends])
    v, found = f(z), []
    for _ in range(2):
        at, best = z[v.argmax()], v.max()
        far = (np.abs(z - at) / np.maximum(hi - lo, 1e-12)).max(1) > 0.2
        width = 0.2 * (hi - lo)
        for _ in range(45):
            q = at + (2.0 * rng.random((200, len(lo))) - 1.0) * width * (rng.random((200, len(lo))) < 0.7)
            q = np.clip(q, lo, hi)
            x = f(q)
            if x.max() > best:
                best, at = x.max(), q[x.argmax()]
            else:
                width = 0.6 * width
        found.append(best)
        if not far.any():
            break
        z, v = z[far], v[far]
    return max(found)


def touching_poses(mech, pair, rng, count):
    """Poses at which a pair overlaps by a fifth of a millimetre to two fifths of what its cores allow,
    drawn about those of a docking."""
    contact = Contact(mech.active, mech.passive, ELASTIC)
    f, other = effective(mech, pair, np.eye(3), ZERO)
    reach = 0.05 if pair == 0 else 0.035 if pair <= 6 else 0.02
    found = 0
    for _ in range(20000):
        if found == count:
            return
        r = turn(rng.normal(size=3) * 0.08) @ turn([rng.uniform(-0.9, 0.9), 0, 0]) @ TURNED
        p = np.array([rng.uniform(0.05, 0.35), *rng.normal(size=2) * 0.08])
        want, direction = rng.uniform(2e-4, 0.4 * reach), rng.normal(size=3)
        # Bisection along a line from far away.
        direction[0] = abs(direction[0]) + 0.3
        far, near = 0.4, 0.0
        if contact.elements(pair, r, p)[1] <= want:
            continue
        for _ in range(50):
            mid = 0.5 * (far + near)
            deep = contact.elements(pair, r, p + mid * direction)[1]
            far, near = (mid, near) if deep < want else (far, mid)
        p = p + far * direction
        if 0.5 * want < contact.elements(pair, r, p)[1] < 2.0 * want:
            found += 1
            yield contact, r, p


@pytest.mark.parametrize("pair,count", [(0, 6), (1, 10), (5, 10), (8, 10), (9, 10)])
def test_oracle_depths_of_all_elements_are_those_of_brute_force(apas, figure, pair, count):
    """Every element is a true point of its part of the surface, and no sample is deeper."""
    rng = np.random.default_rng(11 + pair)
    seen, above, off = 0, -np.inf, 0.0
    for contact, r, p in touching_poses(apas, pair, rng, count):
        out, top = contact.elements(pair, r, p)
        f, other = effective(apas, pair, r, p)
        assert top == pytest.approx(max(out[: 32 if pair == 0 else 8, pl.ETA]), abs=1e-15)
        for row, box in zip(out, boxes(pair)):
            bounds = box + other
            if row[pl.ETA] <= 0.0:
                z = np.array([rng.uniform(*b, 4000) for b in bounds]).T
                assert f(z).max() <= 0.0
                continue
            z = row[pl.AT : pl.AT + len(bounds)]
            assert all(a - 1e-12 <= x <= b + 1e-12 for x, (a, b) in zip(z, bounds))
            off = max(off, abs(f(z[None])[0] - row[pl.ETA]))
            above = max(above, highest(f, bounds, rng, 20000 if other else 3000) - row[pl.ETA])
            seen += 1
    figure(f"{seen} elements, brute force deeper by at most {above:.1e} m, values off by {off:.1e} m")
    assert seen >= count
    assert above < 1e-11 and off < 1e-14


def test_oracle_depths_agree_with_mujocos_own_shapes(apas, figure):
    """Third opinion: ring and rulings as chains of capsules, distances by mj_geomDistance."""
    rng = np.random.default_rng(3)
    n_ring, n_petal = 360, 81
    rigid = 1e12

    def chain(side, petal, name):
        if petal is None:
            pts = on_ring(side, np.linspace(0.0, TAU, n_ring + 1))
            ends, radius = list(zip(pts, pts[1:])), side.ring_section_radius_m
        else:
            u = np.linspace(-1.0, 1.0, n_petal)
            feet, tips = (on_petal(side.petals, petal, u, 0.0 * u + w) for w in (0.0, 1.0))
            ends = list(zip(feet, tips))
            radius = 0.5 * side.petals.thickness_m
        geoms = "".join(
            f'<geom type="capsule" size="{radius}" fromto="'
            + " ".join(repr(float(x)) for x in (*a, *b)) + '"/>'
            for a, b in ends
        )
        return f'<body name="{name}" mocap="true">{geoms}</body>'

    worst, seen = 0.0, 0
    for pair, a, b in ((0, None, None), (4, None, 0), (1, 0, None), (9, 0, 2)):
        m = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{chain(apas.active, a, 'a')}{chain(apas.passive, b, 'b')}"
            "</worldbody></mujoco>"
        )
        d = mujoco.MjData(m)
        mid = [m.body(x).mocapid[0] for x in "ab"]
        for contact, r, p in touching_poses(apas, pair, rng, 3):
            # Petals that do not bend: then the effective depth is the depth.
            for first in (k.PETAL_A, k.PETAL_B):
                contact.P[first + 6] = rigid
            out, _ = contact.elements(pair, r, p)
            row = out[out[: 32 if pair == 0 else 8, pl.ETA].argmax()]
            at = row[pl.POINT : pl.POINT + 3]
            if pair == 4:
                at = r @ at + p
            d.mocap_pos[mid[1]] = p
            mujoco.mju_mat2Quat(d.mocap_quat[mid[1]], r.ravel())
            mujoco.mj_kinematics(m, d)

            def near(name):
                # Only pieces near the place can be the closest ones.
                body = m.body(name)
                geoms = np.arange(body.geomadr[0], body.geomadr[0] + body.geomnum[0])
                gap = np.linalg.norm(d.geom_xpos[geoms] - at, axis=1) - m.geom_size[geoms, 1]
                return geoms[gap < 0.1]

            least = min(mujoco.mj_geomDistance(m, d, i, j, 2.0, None) for i in near("a") for j in near("b"))
            seen += 1
            worst = max(worst, abs(least + row[pl.DEPTH]))
    figure(f"{seen} poses, worst difference {worst:.1e} m (chords of a 0.6 m ring: 2.3e-5 m)")
    assert seen == 12
    assert worst < 1e-4


# -- stored energy and its gradient ------------------------------------------------------------------


@pytest.mark.parametrize(
    "pair,at,most,flat",
    [
        ("ring-ring", ((0.02, 0.01, -0.015), (0.035, 0.02, 0.03)), 2, False),
        ("ring-ring", ((0.0, 0.0002, 0.0001), (0.045, 0.0001, 0.0)), 8, True),
        ("ring-ring", ((0.0, 0.00005, 0.00007), (0.045, 0.0, 0.0)), 8, True),
        ("ring-ring", ((0.0, 0.0, 0.0), (0.045, 0.01, 0.004)), 8, True),
        ("ring-ring", ((0.0, 0.002, 0.001), (0.045, 0.02, 0.0)), 8, False),
        ("ring-petal0", ((0.3, 0.02, 0.03), (0.15, 0.02, -0.1)), 8, False),
        ("petal0-ring", ((0.03, 0.02, 0.05), (0.09, -0.047, 0.004)), 8, False),
        ("petal1-ring", ((0.0, 0.0, 0.0), (0.12, -0.05, 0.0866)), 8, False),
        ("petal0-petal2", ((0.25, 0.02, 0.01), (0.22, 0.0, 0.0)), 8, False),
    ],
)
def test_invariant_force_is_the_gradient_of_the_stored_energy(apas, figure, pair, at, most, flat):
    """Displaces the passive side by 1e-7 along each of the six freedoms; friction and damping off.
    Without it sliding along a petal would make or lose energy."""
    contact = Contact(apas.active, apas.passive, ELASTIC, [pair])
    number = contact.pairs[0]
    r0, p0 = turn(at[0]) @ TURNED, np.array(at[1])
    # Bring the pair to 3 mm of depth along its own force.
    for _ in range(40):
        touch = still(contact, r0, p0)
        if touch.depth_m > 0.0:
            n = touch.wrench[:3] / np.linalg.norm(touch.wrench[:3])
            p0 = p0 + (touch.depth_m - 3e-3) * n
        else:
            p0 = p0 + 3e-3 * _inward(contact, number, r0, p0)

    def energy(r, p):
        return still(contact, r, p).energy_j

    touch = still(contact, r0, p0)
    numeric, h = np.empty(6), 1e-7
    for i in range(6):
        e = np.zeros(3)
        e[i % 3] = h
        if i < 3:
            up, down = energy(r0, p0 + e), energy(r0, p0 - e)
        else:
            up, down = energy(turn(e) @ r0, turn(e) @ p0), energy(turn(-e) @ r0, turn(-e) @ p0)
        numeric[i] = -(up - down) / (2 * h)
    error = np.abs(touch.wrench - numeric).max() / np.abs(touch.wrench).max()
    figure(
        f"{len(touch.places)} place(s), {np.linalg.norm(touch.wrench[:3]):.1f} N, error {error:.1e}"
    )
    assert np.linalg.norm(touch.wrench[:3]) > 1000.0
    assert 1 <= len(touch.places) <= most
    # Curvature of U over the step: some 1e-6 where smooth extremes of 50 um are passed through.
    assert error < (1e-8 if not flat else 3e-6)


def _inward(contact, pair, r, p):
    """Where to move the passive side for a pair to come nearer, by differences of its gap."""
    def gap(q):
        return contact.elements(pair, r, q)[1]

    g = np.array([gap(p + h) - gap(p - h) for h in 1e-4 * np.eye(3)])
    size = np.linalg.norm(g)
    return g / size if size > 0.0 else np.array([-1.0, 0.0, 0.0])


def test_oracle_a_touch_spread_around_the_ring_pushes_with_k_through_its_centre(figure):
    contact = Contact(RINGS, RINGS, ELASTIC)
    f = [still(contact, TURNED, np.array([x, 0, 0])) for x in (0.03, 0.029)]
    figure(f"{f[0].wrench[0]:.9f} N at 20 mm, moment {np.abs(f[0].wrench[3:]).max():.1e} N m")
    for touch, depth in zip(f, (0.02, 0.021)):
        assert touch.wrench[0] == pytest.approx(1e6 * depth, rel=1e-12)
        assert touch.energy_j == pytest.approx(0.5e6 * depth**2, rel=1e-12)
        assert np.abs(touch.wrench[1:]).max() < 1e-12 * touch.wrench[0]


def test_oracle_crossing_rings_push_at_two_places_with_k_each(figure):
    contact = Contact(RINGS, RINGS, ELASTIC)
    f = [still(contact, TURNED, np.array([x, 0.1, 0])) for x in (0.047, 0.046)]
    figure(f"{f[0].wrench[0]:.6f} and {f[1].wrench[0]:.6f} N at 3 and 4 mm, two places")
    for touch, depth in zip(f, (3e-3, 4e-3)):
        assert touch.wrench[0] == pytest.approx(2e6 * depth, rel=1e-12)
        assert touch.energy_j == pytest.approx(1e6 * depth**2, rel=1e-12)


def test_oracle_one_place_has_k_wherever_the_cells_lie(apas, figure):
    """A ring that slides across a petal: U = Phi(largest). A tilted ring, the tilt going round: within what r
    of (N9) takes from the depth of an arc whose deepest point stands less than w above its ends, 4w/27."""
    contact, worst, low = Contact(RINGS, RINGS, ELASTIC), 0.0, []
    for a in np.linspace(0.0, TAU / 16, 41):
        r = turn([0.0, 0.05 * math.cos(a), 0.05 * math.sin(a)]) @ TURNED
        touch = still(contact, r, np.array([0.078, 0.0, 0.0]))
        assert touch.depth_m > 1e-3
        low.append(touch.depth_m - math.sqrt(touch.energy_j / 0.5e6))
    assert min(low) > -1e-12 and 1e-6 < max(low) < 4 * 5e-5 / 27
    crossed = set()
    contact = Contact(apas.active, apas.passive, ELASTIC, ["petal0-ring"])
    for a in np.linspace(-0.3, 0.3, 41):
        for x in np.linspace(0.05, 0.14, 16):
            # The ring about the petal, moved against it until it is 1 mm deep.
            far, near = 0.0, 0.2
            for _ in range(50):
                mid = 0.5 * (far + near)
                p = np.array([x, -mid * math.cos(a), -mid * math.sin(a)])
                far, near = (mid, near) if contact.elements(1, TURNED, p)[1] < 1e-3 else (far, mid)
            touch, (out, top) = still(contact, TURNED, p), contact.elements(1, TURNED, p)
            assert top == pytest.approx(1e-3, rel=1e-6)
            crossed |= {int(c) for c in np.flatnonzero(out[:21, pl.ETA] > 0.0)}
            worst = max(worst, abs(touch.energy_j / (0.5e6 * top**2) - 1.0))
    figure(f"stored energy off by at most {worst:.1e}, over {len(crossed)} elements; rings lower by at "
           f"most {1e6 * max(low):.2f} um")
    assert crossed == set(range(21))
    assert worst < 1e-10


def test_oracle_smooth_extremes():
    """(N9): exact at a tie and beyond the width, up to 2w/27 low between; five levels add up."""
    w = 5e-5
    for a, b in ((1e-3, 1e-3), (1e-3, 1e-3 - w), (1e-3, 5e-4), (-2e-3, 1e-3)):
        assert cells.smooth_max(a, b, w)[0] == pytest.approx(max(a, b), abs=1e-18)
        assert cells.smooth_min(a, b, w)[0] == pytest.approx(min(a, b), abs=1e-18)
    low = [1e-3 - cells.smooth_max(1e-3, 1e-3 - w * y, w)[0] for y in np.linspace(0, 1, 301)]
    assert max(low) == pytest.approx(2 * w / 27, rel=1e-4)
    rng = np.random.default_rng(5)
    weights, h = np.empty(32), 1e-9
    for _ in range(200):
        depths = rng.uniform(0.0, 10.0 ** rng.uniform(-6, -3), 32)
        value = cells.lowest(depths, weights, w)
        assert 0.0 <= value - depths.min() < 5 * 2 * w / 27
        assert weights.sum() == pytest.approx(1.0, abs=1e-12)
        i = int(weights.argmax())
        up, down = depths.copy(), depths.copy()
        up[i] += h
        down[i] -= h
        slope = (cells.lowest(up, np.empty(32), w) - cells.lowest(down, np.empty(32), w)) / (2 * h)
        assert slope == pytest.approx(weights[i], abs=1e-3)
        a, b, m = np.sort(rng.uniform(0.0, 10.0 ** rng.uniform(-6, -3), 3))
        value, *parts = cells.arc_depth(a, b, m, w)
        assert sum(parts) == pytest.approx(1.0, abs=1e-12)
        for j in range(3):
            e = h * np.eye(3)[j]
            up, down = (cells.arc_depth(*([a, b, m] + x * e), w)[0] for x in (1.0, -1.0))
            slope = (up - down) / (2 * h)
            assert slope == pytest.approx(parts[j], abs=1e-3)


def test_oracle_rings_store_what_the_page_says(figure):
    """(N8) and (N9) once more in numpy, over tilts of rings that lie on each other."""
    w, d = 5e-5, 5e-3
    contact = Contact(RINGS, RINGS, ELASTIC)

    def smooth(a, b, width):
        y = np.minimum(np.abs(a - b) / width, 1.0)
        return np.where(y < 1.0, 0.5 * (a + b) + width * (y**2 - 0.5 * y**3), np.maximum(a, b))

    def phi(x):
        return 0.5e6 * np.maximum(x, 0.0) ** 2

    off, least = 0.0, (0.0, 0.0)
    for azimuth in np.linspace(0.0, TAU / 8, 7):
        for tilt in w * np.array([0.0, 0.02, 0.1, 0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 10.0, 120.0]):
            r = turn(tilt / 0.6 * np.array([0.0, math.cos(azimuth), math.sin(azimuth)])) @ TURNED
            p = np.array([0.05 - d, 0.0, 0.0])
            out, _ = contact.elements(0, r, p)
            a, deepest = out[32:64, pl.DEPTH], out[:32, pl.DEPTH]
            s = smooth(a, np.roll(a, -1), cells.ARC_WIDTH * w)
            z = np.maximum(deepest - s, 0.0) / (cells.ARC_WIDTH * w)
            arcs = s + np.where(z < 1.0, cells.ARC_WIDTH * w * (2.0 * z**2 - z**3), deepest - s)
            low = a
            while len(low) > 1:
                low = -smooth(-low[0::2], -low[1::2], w)
            want = phi(arcs).sum() - phi(a).sum() + phi(low[0])
            got = still(contact, r, p).energy_j
            off = max(off, abs(got / want - 1.0))
            least = min(least, ((got - 0.5e6 * d**2) / (1e6 * d), tilt))
    figure(f"off by at most {off:.1e}; least energy at a tilt of {1e6 * least[1]:.0f} um, "
           f"{1e6 * least[0]:.2f} um times the force against flat")
    assert off < 1e-11


def test_invariant_a_petal_on_a_ring_and_rocking_rings_push_without_a_jump(apas, figure):
    """Twice as many steps along the same path: the largest change of the wrench halves."""
    def sweep(contact, path, n):
        contact.forget()
        got = np.array([still(contact, *path(x)).wrench for x in np.linspace(0.0, 1.0, n)])
        return np.abs(np.diff(got, axis=0)).max()

    rings = Contact(RINGS, RINGS, ELASTIC)
    whole = Contact(apas.active, apas.passive, ELASTIC)
    paths = {
        "rock": (rings, lambda x: (
            turn([0.0, 4e-4 * math.sin(7 * x), 4e-4 * math.cos(5 * x) * (1 - 2 * x)]) @ TURNED,
            np.array([0.0499, 1e-4 * x, 0.0]))),
        "petals": (whole, lambda x: (
            turn([0.03 * x, 0.02, 0.05 * x]) @ TURNED,
            _about_petal(0.06 + 0.07 * x, 0.8 * x - 0.4, 2e-3 + 4e-3 * x))),
    }
    for name, (contact, path) in paths.items():
        coarse, fine = sweep(contact, path, 2001), sweep(contact, path, 4001)
        figure(f"{name}: largest change {coarse:.2f} and {fine:.2f} N or N m")
        assert 0.0 < fine < 0.6 * coarse


def _about_petal(x, a, deep):
    """A ring about petal 0, moved against it at an azimuth."""
    s = x - 0.0465 + deep
    return np.array([x, -s * math.cos(a), -s * math.sin(a)])


def test_invariant_what_is_remembered_does_not_change_depths(apas):
    """Along a path in small steps and each pose alone."""
    contact = Contact(apas.active, apas.passive, ELASTIC)
    moving = Contact(apas.active, apas.passive, ELASTIC)
    y = straight()
    touched = 0
    for x in np.linspace(0.0, 1.0, 300):
        r, p = turn([0.05 - 0.1 * x, 0.05 * x, 0.0]) @ TURNED, np.array([0.2 - 0.14 * x, -0.025, 0.005])
        a, b = still(contact, r, p), moving.evaluate(r, p, ZERO, ZERO, y)
        assert a.wrench == pytest.approx(b.wrench, rel=1e-12, abs=1e-9)
        touched += a.depth_m > 0.0
    assert touched > 30


# -- damping and friction ----------------------------------------------------------------------------


def test_oracle_a_damper_acts_once_however_the_touch_is_spread(figure):
    """k d + c v of rings face to face, at two places, and at one."""
    contact = Contact(RINGS, RINGS, ContactLaw(KelvinVoigt(1e6, 4000.0), None, 5e-5))
    seen = []
    for r, p, count in (
        (TURNED, [0.045, 0.0, 0.0], 1), (TURNED, [0.046, 0.1, 0.0], 2),
        (turn([0.0, 0.05, 0.0]) @ TURNED, [0.078, 0.0, 0.0], 1),
    ):
        p, v = np.array(p), np.array([-0.01, 0.0, 0.0])
        contact.forget()
        n = still(contact, r, p)
        moving = contact.evaluate(r, p, v, ZERO, straight())
        lost = np.linalg.norm(moving.wrench[:3] - n.wrench[:3])
        direction = n.wrench[:3] / np.linalg.norm(n.wrench[:3])
        seen.append(lost / (4000.0 * 0.01 * abs(direction[0]) * count))
    figure(f"dampers that act: {', '.join(f'{x:.6f}' for x in seen)} of one a place")
    # Beside a place that stands 0.1 to 1 mm above its borders the next cell keeps 1 um of them.
    assert seen[0] == pytest.approx(1.0, rel=1e-9)
    assert seen[1:] == pytest.approx([1.0, 1.0], abs=0.02)


def test_oracle_friction_opposes_sliding_with_mu_times_the_normal_force(figure):
    r, p = turn([0.0, 0.05, 0.0]) @ TURNED, np.array([0.06, 0.0, 0.0])
    v = np.array([0.0, 0.03, 0.02])
    smooth, rough = Contact(RINGS, RINGS, ELASTIC), Contact(RINGS, RINGS, ROUGH)
    base = smooth.evaluate(r, p, v, ZERO, straight())
    y = straight()
    places = rough.evaluate(r, p, v, ZERO, y).places
    want, arms = np.zeros(6), 0.0
    for place in places:
        v_t = v - place.normal * (place.normal @ v)
        # A bristle in the steady state of sliding no longer moves.
        y[place.slot] = v_t / np.linalg.norm(v_t)
        rub = -0.1 * place.normal_n * y[place.slot]
        want += np.concatenate([rub, np.cross(place.point_m, rub)])
    both = rough.evaluate(r, p, v, ZERO, y)
    friction = both.wrench - base.wrench
    total = sum(q.normal_n for q in places)
    figure(f"N {total:.1f} N, friction {np.linalg.norm(friction[:3]):.2f} N")
    assert total == pytest.approx(np.linalg.norm(base.wrench[:3]), rel=1e-3) and total > 1000.0
    assert friction == pytest.approx(want, rel=1e-9, abs=1e-9)
    assert np.abs([both.rates[q.slot] for q in places]).max() < 1e-9


def test_oracle_an_even_touch_resists_roll_with_mu_times_radius_times_the_normal_force(figure):
    """Eight places and the spread of each: the lever of all together is the ring's radius."""
    p, w = np.array([0.045, 0.0, 0.0]), np.array([0.02, 0.0, 0.0])
    contact = Contact(RINGS, RINGS, ROUGH)
    y = straight()
    base = still(Contact(RINGS, RINGS, ELASTIC), TURNED, p)
    places = contact.evaluate(TURNED, p, ZERO, w, y).places
    for q in places:
        slip = np.cross(w, q.point_m)
        slip = slip - q.normal * (q.normal @ slip) + q.normal * (q.normal @ w) * q.spread_m
        y[q.slot] = slip / np.linalg.norm(slip)
        assert np.hypot(np.linalg.norm(q.point_m[1:]), q.spread_m) == pytest.approx(0.6, rel=1e-9)
    rubbed = contact.evaluate(TURNED, p, ZERO, w, y).wrench - base.wrench
    figure(f"moment by mu N: {rubbed[3] / (0.1 * base.wrench[0]):.9f} m")
    assert len(places) == 8
    assert rubbed[3] == pytest.approx(-0.1 * 0.6 * base.wrench[0], rel=1e-9)
    assert np.abs(rubbed[[0, 1, 2, 4, 5]]).max() < 1e-9 * base.wrench[0]


def test_invariant_merging_places_rub_with_no_more_than_the_normal_force(figure):
    """Two places of crossing rings become one as the rings are laid on each other."""
    contact = Contact(RINGS, RINGS, ROUGH)
    ratio, last, jump = [], None, 0.0
    for offset in np.linspace(0.02, 0.0, 2001):
        touch = still(contact, TURNED, np.array([0.046, offset, 0.0]))
        rubbing = sum(q.normal_n for q in touch.places)
        ratio.append(rubbing / np.linalg.norm(touch.wrench[:3]))
        if last is not None:
            jump = max(jump, abs(rubbing - last) / last)
        last = rubbing
    figure(f"rubbing by pushing {min(ratio):.4f} .. {max(ratio):.4f}, largest change {jump:.4f}")
    assert 0.97 < min(ratio) and max(ratio) < 1.03
    assert jump < 0.005


def test_invariant_a_place_takes_its_bristle_along_and_parting_forgets_it():
    contact = Contact(RINGS, RINGS, ROUGH)
    y = straight()
    given = np.array([0.3, -0.2, 0.5])
    for a in np.linspace(0.1, 3.0, 400):
        r = turn([0.0, 0.05 * math.cos(a), 0.05 * math.sin(a)]) @ TURNED
        touch = contact.evaluate(r, np.array([0.0785, 0.0, 0.0]), ZERO, ZERO, y)
        assert touch.places
        if a == 0.1:
            for q in touch.places:
                y[q.slot] = given
        else:
            deepest = max(touch.places, key=lambda q: q.normal_n)
            assert deepest.bristle == pytest.approx(given)
    assert not contact.evaluate(TURNED, np.array([0.09, 0.0, 0.0]), ZERO, ZERO, y).places
    assert not y.any()
    for q in contact.evaluate(r, np.array([0.0785, 0.0, 0.0]), ZERO, ZERO, y).places:
        assert not q.bristle.any()


# -- shapes ------------------------------------------------------------------------------------------


def test_oracle_petal_is_softer_towards_its_tip_like_a_cantilever():
    """(N5), (N6): the gain squared is k(s)/k_c = 1/(1 + k_c s^3/(3EI)), and its logarithm's slopes."""
    c = 1e6 * 0.2**3 / (3.0 * 1.6e4)
    assert pl.gain(c, 0.5, 0.0, 0.0, 0.0)[0] == 1.0
    assert pl.gain(c, 0.5, 1.0, 0.0, 0.0)[0] ** 2 == pytest.approx(
        1.0 / (1.0 + 1e6 * 0.2**3 / 4.8e4), rel=1e-12)
    assert pl.gain(c, 0.4, 1.0, c, 1.0)[0] == pytest.approx((1.0 + 2.0 * c) ** -0.4, rel=1e-12)
    h = 1e-5

    def log(a, b):
        return math.log(pl.gain(c, 0.4, a, 2.0 * c, b)[0])

    _, ga, gb, gaa, gab, gbb = pl.gain(c, 0.4, 0.6, 2.0 * c, 0.7)
    assert ga == pytest.approx((log(0.6 + h, 0.7) - log(0.6 - h, 0.7)) / (2 * h), rel=1e-7)
    assert gb == pytest.approx((log(0.6, 0.7 + h) - log(0.6, 0.7 - h)) / (2 * h), rel=1e-7)
    assert gaa == pytest.approx((log(0.6 + h, 0.7) - 2 * log(0.6, 0.7) + log(0.6 - h, 0.7)) / h**2, rel=1e-4)
    assert gbb == pytest.approx((log(0.6, 0.7 + h) - 2 * log(0.6, 0.7) + log(0.6, 0.7 - h)) / h**2, rel=1e-4)
    mixed = log(0.6 + h, 0.7 + h) - log(0.6 + h, 0.7 - h) - log(0.6 - h, 0.7 + h) + log(0.6 - h, 0.7 - h)
    assert gab == pytest.approx(mixed / (4 * h**2), rel=1e-4)


def test_invariant_a_petal_is_ruled_between_its_two_arcs():
    petals = Petals(3, 0.3, 0.597, 0.41, 0.187, 0.49, 0.24, 0.02, 1.6e4)
    contact = Contact(Side(0.6, 0.025, petals), RINGS, ELASTIC)
    g = tuple(k.petal_at(contact.P, k.PETAL_A, 1, 3))
    a = 0.3 + TAU / 3
    for u in (-1.0, 0.4, 1.0):
        foot, t = (np.array(x) for x in pl.ruling(g, u))
        for p, x, r, half in ((foot, 0.0, 0.597, 0.49), (foot + t, 0.187, 0.41, 0.24)):
            az = a + u * half
            assert p == pytest.approx([x, r * math.cos(az), r * math.sin(az)], abs=1e-15)
