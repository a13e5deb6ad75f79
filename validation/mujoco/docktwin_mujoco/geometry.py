"""Closest places of the guiding surfaces: a torus and a ruled petal swept by a ball.

A surface is a *core* (a circle, or a sheet of straight rulings) and a radius about it. The depth
of a pair is the sum of the radii less the distance between the cores, so it stays smooth until the
cores themselves meet. Distances are found by sampling both cores and then refining every promising
start by a projected Newton iteration on all core parameters at once.

In a ring frame +X points to the other side and the azimuth runs from +Y toward +Z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

TAU = 2.0 * math.pi
# Below this distance of the cores the direction between them is no longer to be believed, m.
CORE_CLEARANCE_M = 1e-9


class RingCore:
    """The centre circle of a torus about X; parameter: azimuth."""

    def __init__(self, mean_radius_m: float, section_radius_m: float) -> None:
        self.radius_m = section_radius_m
        self.mean_radius_m = mean_radius_m
        self.lower = np.array([-np.inf])
        self.upper = np.array([np.inf])
        self.z_samples = np.linspace(0.0, TAU, 180, endpoint=False)[:, None]
        self.samples = np.array([self.at(z)[0] for z in self.z_samples])
        self.grid = (180,)
        self.periodic = True
        # No point of the core is farther than this from a sample, m.
        self.cover_m = mean_radius_m * TAU / 360.0
        self.slant_m = 0.0

    def at(self, z):
        """Point, first and second derivatives: shapes (3,), (3, 1), (3, 1, 1)."""
        r, c, s = self.mean_radius_m, math.cos(z[0]), math.sin(z[0])
        p = np.array([0.0, r * c, r * s])
        d = np.array([[0.0], [-r * s], [r * c]])
        return p, d, -p[:, None, None]

    def distance_from(self, points):
        """Distances of points given in this ring's frame from the circle, exact."""
        rho = np.hypot(points[:, 1], points[:, 2])
        return np.hypot(rho - self.mean_radius_m, points[:, 0])

    def nearest_parameter(self, point):
        """Azimuth of the closest point of the circle."""
        return np.array([math.atan2(point[2], point[1])])


class PetalCore:
    """The ruled mid-surface of one petal; parameters: u in [-1, 1] across, w in [0, 1] along."""

    def __init__(self, petals, index: int) -> None:
        self.radius_m = 0.5 * petals.thickness_m
        self.petals = petals
        self.azimuth = petals.first_azimuth_rad + index * TAU / petals.count
        self.lower = np.array([-1.0, 0.0])
        self.upper = np.array([1.0, 1.0])
        self.grid = (13, 7)
        us, ws = np.linspace(-1.0, 1.0, 13), np.linspace(0.0, 1.0, 7)
        self.z_samples = np.array([(u, w) for u in us for w in ws])
        self.samples = np.array([self.at(z)[0] for z in self.z_samples])
        self.periodic = False
        widest = max(
            petals.base_radius_m * petals.base_half_angle_rad,
            petals.tip_radius_m * petals.tip_half_angle_rad,
        )
        longest = max(self.slant_at(u) for u in us)
        # Half the diagonal of a cell, with the arc in place of the chord.
        self.cover_m = math.hypot(widest / 12.0, longest / 12.0)

    def _end(self, u: float, x: float, r: float, half: float):
        a = self.azimuth + u * half
        c, s = math.cos(a), math.sin(a)
        p = np.array([x, r * c, r * s])
        d = half * np.array([0.0, -r * s, r * c])
        dd = -half * half * np.array([0.0, r * c, r * s])
        return p, d, dd

    def at(self, z):
        """Point, first and second derivatives: shapes (3,), (3, 2), (3, 2, 2)."""
        u, w = z
        g = self.petals
        b, b1, b2 = self._end(u, 0.0, g.base_radius_m, g.base_half_angle_rad)
        t, t1, t2 = self._end(u, g.height_m, g.tip_radius_m, g.tip_half_angle_rad)
        p = b + w * (t - b)
        d = np.empty((3, 2))
        d[:, 0] = b1 + w * (t1 - b1)
        d[:, 1] = t - b
        h = np.zeros((3, 2, 2))
        h[:, 0, 0] = b2 + w * (t2 - b2)
        h[:, 0, 1] = h[:, 1, 0] = t1 - b1
        return p, d, h

    def slant_at(self, u: float) -> float:
        """Length of the ruling u, m."""
        g = self.petals
        b = self._end(u, 0.0, g.base_radius_m, g.base_half_angle_rad)[0]
        t = self._end(u, g.height_m, g.tip_radius_m, g.tip_half_angle_rad)[0]
        return float(np.linalg.norm(t - b))

    def along(self, z):
        """Distance s from the base along the ruling, m, and its derivatives by u and w."""
        u, w = z
        g = self.petals
        b, b1, _ = self._end(u, 0.0, g.base_radius_m, g.base_half_angle_rad)
        t, t1, _ = self._end(u, g.height_m, g.tip_radius_m, g.tip_half_angle_rad)
        length = float(np.linalg.norm(t - b))
        by_u = w * float((t - b) @ (t1 - b1)) / length
        return w * length, np.array([by_u, length])


@dataclass
class Place:
    """One place where a pair is closest, in the frame of the first surface."""

    depth_m: float
    """Sum of the radii less the core distance; positive in contact."""
    normal: np.ndarray
    """From the first core to the second, unit."""
    point_m: np.ndarray
    """Middle of the overlap (of the gap)."""
    z_a: np.ndarray
    z_b: np.ndarray


class Pair:
    """Two surfaces, the second posed in the frame of the first by (r_ab, p_ab)."""

    def __init__(self, a, b) -> None:
        self.a, self.b = a, b
        self.reach_m = a.radius_m + b.radius_m
        self._na = len(a.lower)
        self._lower = np.concatenate([a.lower, b.lower])
        self._upper = np.concatenate([a.upper, b.upper])
        self._cleared = None
        self._tracked = self._touched = None
        self._far_m = float(np.sqrt((b.samples**2).sum(1).max())) + b.cover_m

    # -- distance ------------------------------------------------------------------------------

    def _coarse(self, r_ab, p_ab):
        """For every sample of one core the distance to the other; the core that was sampled, and
        the start parameters of a sample."""
        a, b = self.a, self.b
        if isinstance(a, RingCore):
            pts = b.samples @ r_ab.T + p_ab
            dist = a.distance_from(pts)

            def start(i):
                return np.concatenate([a.nearest_parameter(pts[i]), b.z_samples[i]])

            return dist, b, start
        if isinstance(b, RingCore):
            pts = (a.samples - p_ab) @ r_ab
            dist = b.distance_from(pts)

            def start(i):
                return np.concatenate([a.z_samples[i], b.nearest_parameter(pts[i])])

            return dist, a, start
        pts = b.samples @ r_ab.T + p_ab
        sq = (
            (a.samples**2).sum(1)[:, None] + (pts**2).sum(1)[None, :] - 2.0 * a.samples @ pts.T
        )
        nearest = sq.argmin(1)
        dist = np.sqrt(np.maximum(sq[np.arange(len(sq)), nearest], 0.0))

        def start(i):
            return np.concatenate([a.z_samples[i], b.z_samples[nearest[i]]])

        return dist, a, start

    def _gap(self, r_ab, p_ab):
        """Sampled distances, how much less the true distance can be, and where they were taken."""
        dist, sampled, start = self._coarse(r_ab, p_ab)
        cover = sampled.cover_m
        if not isinstance(self.a, RingCore) and not isinstance(self.b, RingCore):
            cover += self.b.cover_m
        return dist, cover, (sampled, start)

    def places(self, r_ab, p_ab, depth_above_m: float = -np.inf, most: int = 6) -> list[Place]:
        """All distinct local maxima of depth above the bound, deepest first."""
        if self._is_clear(r_ab, p_ab, depth_above_m):
            return []
        dist, cover, (sampled, start) = self._gap(r_ab, p_ab)
        at_most = self.reach_m - (float(dist.min()) - cover)
        if at_most < depth_above_m:
            self._cleared = (r_ab.copy(), p_ab.copy(), at_most)
            return []
        found: list[Place] = []
        for i in _grid_minima(dist, sampled.grid, sampled.periodic)[:most]:
            if dist[i] - cover > self.reach_m - depth_above_m:
                break
            place = self._refine(start(i), r_ab, p_ab)
            if place.depth_m <= depth_above_m:
                continue
            if all(np.linalg.norm(place.point_m - q.point_m) > 1e-5 for q in found):
                found.append(place)
        return sorted(found, key=lambda q: -q.depth_m)

    def near(self, r_ab, p_ab, depth_above_m: float) -> bool:
        """False when the pair is surely not deeper than the bound; cheap, errs on the safe side."""
        if self._is_clear(r_ab, p_ab, depth_above_m):
            return False
        dist, cover, _ = self._gap(r_ab, p_ab)
        at_most = self.reach_m - (float(dist.min()) - cover)
        if at_most < depth_above_m:
            self._cleared = (r_ab.copy(), p_ab.copy(), at_most)
        return at_most >= depth_above_m

    def deepest(self, r_ab, p_ab) -> Place:
        """The place of least distance."""
        return self.places(r_ab, p_ab)[0]

    def _is_clear(self, r_ab, p_ab, depth_above_m) -> bool:
        """True when the pair has moved less than the gap seen at the last search."""
        if self._cleared is None:
            return False
        r0, p0, depth = self._cleared
        return depth + self._moved(r_ab, p_ab, r0, p0) < depth_above_m

    def _moved(self, r_ab, p_ab, r0, p0) -> float:
        """Bound on how far any point of B has moved, m: |dp| + |dR| times its farthest point."""
        dr, dp = r_ab - r0, p_ab - p0
        return math.sqrt(float(dp @ dp)) + math.sqrt(float((dr * dr).sum())) * self._far_m

    def _search(self, r_ab, p_ab, depth_above_m: float, margin_m: float) -> list[Place]:
        """Places deeper than the bound less a margin; none, and clearance noted, when nothing is
        deeper than the bound itself."""
        found = self.places(r_ab, p_ab, depth_above_m - 0.06)
        deepest = found[0].depth_m if found else depth_above_m - 0.06
        if deepest <= depth_above_m:
            self._cleared = (r_ab.copy(), p_ab.copy(), deepest)
            return []
        return [q for q in found if q.depth_m > depth_above_m - margin_m]

    def touches(self, r_ab, p_ab, depth_above_m: float) -> bool:
        """False when the pair is not deeper than the bound. For a motion in small steps: true
        answers hold for another half millimetre."""
        if self._is_clear(r_ab, p_ab, depth_above_m):
            self._touched = None
            return False
        t = self._touched
        if t is not None and self._moved(r_ab, p_ab, t[0], t[1]) < 5e-4:
            return True
        self._touched = None
        if self._search(r_ab, p_ab, depth_above_m, 0.0):
            self._touched = (r_ab.copy(), p_ab.copy())
            return True
        return False

    def follow(self, r_ab, p_ab, depth_above_m: float) -> list[Place]:
        """As `places`, for a motion in small steps: minima found before are refined from where
        they were, and searched for anew after every half millimetre."""
        if self._is_clear(r_ab, p_ab, depth_above_m):
            self._tracked = None
            return []
        old = self._tracked
        if old is None or self._moved(r_ab, p_ab, old[0], old[1]) > 5e-4:
            # Minima that may surface before the next search are kept too.
            starts = self._search(r_ab, p_ab, depth_above_m, 1e-3)
            if not starts:
                self._tracked = None
                return []
            self._tracked = (r_ab.copy(), p_ab.copy(), starts)
            found = starts
        else:
            found = []
            for q in old[2]:
                new = self._refine(np.concatenate([q.z_a, q.z_b]), r_ab, p_ab)
                if all(np.linalg.norm(new.point_m - o.point_m) > 1e-5 for o in found):
                    found.append(new)
            self._tracked = (old[0], old[1], found)
        return sorted((q for q in found if q.depth_m > depth_above_m), key=lambda q: -q.depth_m)

    def _residual(self, z, r_ab, p_ab):
        pa, da, ha = self.a.at(z[: self._na])
        pb, db, hb = self.b.at(z[self._na :])
        pb = r_ab @ pb + p_ab
        db = r_ab @ db
        return pa - pb, pa, pb, da, db, ha, hb

    def _grad_hess(self, r, da, db, ha, hb, r_ab):
        na = self._na
        n = na + db.shape[1]
        g = np.empty(n)
        g[:na] = r @ da
        g[na:] = -(r @ db)
        h = np.empty((n, n))
        h[:na, :na] = da.T @ da + np.tensordot(r, ha, 1)
        h[na:, na:] = db.T @ db - np.tensordot(r @ r_ab, hb, 1)
        h[:na, na:] = -(da.T @ db)
        h[na:, :na] = h[:na, na:].T
        return g, h

    def _free(self, z, g):
        return ~(((z <= self._lower) & (g >= 0.0)) | ((z >= self._upper) & (g <= 0.0)))

    def _refine(self, z, r_ab, p_ab) -> Place:
        """Projected Newton with a Levenberg shift on half the squared distance."""
        shift = 1e-9
        r, pa, pb, da, db, ha, hb = self._residual(z, r_ab, p_ab)
        f = 0.5 * float(r @ r)
        for _ in range(80):
            g, h = self._grad_hess(r, da, db, ha, hb, r_ab)
            free = self._free(z, g)
            if not free.any() or np.abs(g[free]).max() < 1e-15:
                break
            idx = np.flatnonzero(free)
            hf = h[np.ix_(idx, idx)]
            trial = last = None
            for _ in range(25):
                try:
                    step = -np.linalg.solve(hf + shift * np.eye(len(idx)), g[idx])
                except np.linalg.LinAlgError:
                    step = None
                gain = -1.0 if step is None else -float(step @ g[idx])
                if gain > 0.0:
                    trial = z.copy()
                    trial[idx] += step
                    np.clip(trial, self._lower, self._upper, out=trial)
                    new = self._residual(trial, r_ab, p_ab)
                    f_new = 0.5 * float(new[0] @ new[0])
                    # Where only rounding is left to gain, the step is taken and the search ends.
                    last = gain < 1e-14 * f
                    if last or f_new < f:
                        break
                trial = None
                shift = max(10.0 * shift, 1e-9)
            if trial is None:
                break
            shift = max(0.1 * shift, 1e-12)
            z, f = trial, f_new
            r, pa, pb, da, db, ha, hb = new
            if last:
                break
        dist = math.sqrt(2.0 * f)
        if dist < CORE_CLEARANCE_M:
            raise ValueError("cores meet: the pair is deeper than its radii")
        n = (pb - pa) / dist
        point = 0.5 * ((pa + self.a.radius_m * n) + (pb - self.b.radius_m * n))
        return Place(self.reach_m - dist, n, point, z[: self._na], z[self._na :])

    # -- how the place moves -------------------------------------------------------------------

    def parameter_gradient(self, place: Place, r_ab, p_ab):
        """Change of the core parameters at the closest place per small displacement of B (frame of
        A): translation, then rotation about A's origin. Shape (n, 6); rows held by a bound are 0.
        Implicit differentiation of "gradient of the squared distance = 0"."""
        z = np.concatenate([place.z_a, place.z_b])
        r, _, pb, da, db, ha, hb = self._residual(z, r_ab, p_ab)
        g, h = self._grad_hess(r, da, db, ha, hb, r_ab)
        out = np.zeros((len(z), 6))
        # A parameter resting on its bound stays there; one pressed with no force may leave it.
        free = self._free(z, np.where(np.abs(g) < 1e-9, 0.0, g))
        idx = np.flatnonzero(free)
        if len(idx) == 0:
            return out
        # r = pA - pB, so displacing B by e (or e x pB) changes r by minus that.
        d_g = np.zeros((len(z), 6))
        for k in range(3):
            e = np.zeros(3)
            e[k] = 1.0
            turn = np.cross(e, pb)
            d_g[: self._na, k] = -(e @ da)
            d_g[self._na :, k] = e @ db
            d_g[: self._na, 3 + k] = -(turn @ da)
            d_g[self._na :, 3 + k] = turn @ db - r @ np.cross(e, db.T).T
        hf = h[np.ix_(idx, idx)]
        out[idx] = -np.linalg.lstsq(hf, d_g[idx], rcond=1e-9)[0]
        return out


def _grid_minima(values, shape, periodic: bool):
    """Indices of the samples no larger than their neighbours, least first."""
    v = values.reshape(shape)
    low = np.ones(shape, dtype=bool)
    if periodic:
        low &= (v <= np.roll(v, 1)) & (v <= np.roll(v, -1))
    else:
        big = np.pad(v, 1, constant_values=np.inf)
        core = (slice(1, -1),) * v.ndim
        for axis in range(v.ndim):
            for step in (-1, 1):
                low &= v <= np.roll(big, step, axis=axis)[core]
    idx = np.flatnonzero(low.ravel())
    return idx[np.argsort(values[idx], kind="stable")]
