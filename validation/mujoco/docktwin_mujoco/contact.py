"""Wrench between the two sides of a mechanism.

Each pair of surfaces is looked at along a one-parameter family (azimuth of a ring, rulings of a
petal), densely sampled. The samples of one place count once, by a soft maximum of the depths with
the model's `merge_depth_m` as its temperature, so that a touch spread evenly around a ring acts at
its centre and the stiffness stays k. A dense family shifts the surface by some tenths of a
millimetre against a sparse one, which moves the instant of contact but not its strength.

Two places of one pair are separate where the surfaces part between them; with a saddle of depth
d_s between peaks d_1, d_2 the stored energy is (1 - C)(U_1 + U_2) + C U_12, C = (d_s/d)^2 with d
the soft minimum of d_1 and d_2. Around a ring there are two saddles; d_s is their soft maximum.

Friction of a place is one bristle vector for sliding and for turning about the normal n: the slip
is v_t + n (rho w_n), where rho is the root-mean-square distance of the samples from the place's
point; the component of the bristle force along n, times rho, is a moment about n.

Petal on petal touches edge on edge: its deepest place is found exactly and is the only one.

Elastic forces are the gradient of the stored energy, so a stiffness that varies along a petal leaves
a small tangential part. All vectors are in the active side's ring frame, about its origin.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .geometry import TAU, Pair, PetalCore, RingCore
from .law import ContactLaw, petal_stiffness

RING_SAMPLES = 1440
RULING_SAMPLES = 241
# Samples this many temperatures below the peak weigh less than 1e-15 and are left out.
FAINT = 35.0


@dataclass
class Side:
    """Surfaces of one side in its ring frame; `petals` as in the model file, or None."""

    ring_mean_radius_m: float
    ring_section_radius_m: float
    petals: object | None = None

    def cores(self):
        """The ring, then the petals."""
        out = [RingCore(self.ring_mean_radius_m, self.ring_section_radius_m)]
        if self.petals is not None:
            out += [PetalCore(self.petals, i) for i in range(self.petals.count)]
        return out


@dataclass
class Family:
    """Samples of one pair. `at` is the position in the family (azimuth, ruling), `detail(indices)`
    gives stiffness (N/m^n) and its gradient by displacement of the passive side (6 each)."""

    depth: np.ndarray
    normal: np.ndarray
    point: np.ndarray
    at: np.ndarray
    closed: bool
    detail: object

    def gradient(self, idx):
        """Change of depth per displacement of the passive side (translation, rotation about the
        origin): moving it along its normal opens the gap."""
        n, p = self.normal[idx], self.point[idx]
        return -np.concatenate([n, _cross(p, n)], axis=-1)


@dataclass
class Push:
    """One place that pushes: force and moment on the passive side without friction, and what
    friction needs; `normal_n` is the part of the normal force that rubs."""

    wrench: np.ndarray
    normal_n: float
    spread_m: float
    depth_m: float
    point_m: np.ndarray
    normal: np.ndarray
    at: float
    energy_j: float


@dataclass
class PairState:
    """What is remembered of a pair between evaluations."""

    pair: Pair
    name: str
    slots: list = field(default_factory=lambda: [None, None])


class Contact:
    """All pairs of two sides under one law."""

    slots_per_pair = 2

    def __init__(self, active: Side, passive: Side, law: ContactLaw) -> None:
        self.law = law
        self.active, self.passive = active, passive
        names_a = ["ring"] + [f"petal{i}" for i in range(9)]
        self.pairs = [
            PairState(Pair(a, b), f"{na}-{nb}")
            for a, na in zip(active.cores(), names_a)
            for b, nb in zip(passive.cores(), names_a)
        ]

    @property
    def bristles(self) -> int:
        """Number of bristles, three components each."""
        return len(self.pairs) * self.slots_per_pair

    def evaluate(self, r_ab, p_ab, v_ab, w_ab, bristle):
        """Wrench on the passive side about the origin of the active ring frame.

        `v_ab` is the velocity of the passive side's material point at that origin and `w_ab` its
        rate, both relative to the active side. Returns (wrench 6, bristle rates, places)."""
        rates = np.zeros_like(bristle)
        wrench = np.zeros(6)
        pushes = []
        for i, state in enumerate(self.pairs):
            here = self._pair(state, r_ab, p_ab, v_ab, w_ab)
            for slot, push in self._slots(state, here):
                j = i * self.slots_per_pair + slot
                wrench += push.wrench
                if self.law.friction is not None and push.normal_n > 0.0:
                    n, rho = push.normal, push.spread_m
                    v = v_ab + _cross(w_ab, push.point_m)
                    slip = v - n * (n @ v) + n * (rho * (n @ w_ab))
                    f, rates[j] = self.law.friction.force_and_rate(push.normal_n, slip, bristle[j])
                    along = n @ f
                    slide = f - n * along
                    wrench[:3] += slide
                    wrench[3:] += _cross(push.point_m, slide) + n * (rho * along)
                pushes.append((state.name, j, push))
        return wrench, rates, pushes

    def clearance_m(self, r_ab, p_ab) -> float:
        """Least distance of any pair, negative in contact."""
        return -max(s.pair.deepest(r_ab, p_ab).depth_m for s in self.pairs)

    def _slots(self, state: PairState, pushes):
        """Gives every place the bristle of the place nearest to it before."""
        if not pushes:
            state.slots = [None, None]
            return []
        order = [0, 1][: len(pushes)]
        if len(pushes) == 1:
            if state.slots[1] is not None and (
                state.slots[0] is None
                or abs(pushes[0].at - state.slots[1]) < abs(pushes[0].at - state.slots[0])
            ):
                order = [1]
        elif pushes[0].at > pushes[1].at:
            order = [1, 0]
        state.slots = [None, None]
        for slot, push in zip(order, pushes):
            state.slots[slot] = push.at
        return list(zip(order, pushes))

    # -- one pair ------------------------------------------------------------------------------

    def _pair(self, state, r_ab, p_ab, v_ab, w_ab) -> list[Push]:
        pair = state.pair
        eps = self.law.merge_depth_m
        a_ring, b_ring = isinstance(pair.a, RingCore), isinstance(pair.b, RingCore)
        if not a_ring and not b_ring:
            return self._petal_on_petal(pair, r_ab, p_ab, v_ab, w_ab)
        # A dense family's soft maximum lies above the deepest point by at most eps ln(samples).
        if not pair.touches(r_ab, p_ab, -10.0 * eps):
            return []
        if a_ring and b_ring:
            family = _ring_on_ring(pair, r_ab, p_ab, self.law.normal.stiffness)
        else:
            family = _ring_on_petal(pair, r_ab, p_ab, self.law.normal.stiffness)
        return self._merge(family, np.concatenate([v_ab, w_ab]))

    def _petal_on_petal(self, pair, r_ab, p_ab, v_ab, w_ab) -> list[Push]:
        found = pair.follow(r_ab, p_ab, 0.0)
        if not found:
            return []
        k, grad_k = zip(*(self._series(pair, q, r_ab, p_ab) for q in found))
        k, grad_k = np.array(k), np.array(grad_k)
        family = Family(
            np.array([q.depth_m for q in found]),
            np.array([q.normal for q in found]),
            np.array([q.point_m for q in found]),
            np.array([q.z_a[0] for q in found]),
            False,
            lambda idx: (k[idx], grad_k[idx]),
        )
        # Two petals are one place, however many maxima there are.
        one = self._soft(family, slice(None))
        return [self._alone(one, np.concatenate([v_ab, w_ab]))]

    def _series(self, pair, place, r_ab, p_ab):
        """Stiffness of a place with both petals in series, and its gradient."""
        c = 1.0 / self.law.normal.stiffness
        d_c = []
        for core, z in ((pair.a, place.z_a), (pair.b, place.z_b)):
            ei = core.petals.flexural_rigidity_n_m2
            s, ds = core.along(z)
            c += s**3 / (3.0 * ei)
            d_c.append(s**2 / ei * ds)
        return 1.0 / c, -np.concatenate(d_c) @ pair.parameter_gradient(place, r_ab, p_ab) / c**2

    def _merge(self, fam: Family, twist) -> list[Push]:
        if fam.depth.max() <= -10.0 * self.law.merge_depth_m:
            return []
        peaks = _two_peaks(fam)
        if len(peaks) == 1:
            one = self._soft(fam, slice(None))
            return [self._alone(one, twist)] if one.depth > 0.0 else []
        (hi, in_hi), (lo, in_lo), saddles = peaks
        eps = self.law.merge_depth_m
        basins = self._soft(fam, in_hi), self._soft(fam, in_lo)
        # The higher of the saddles, the lower of the peaks, softly: nothing jumps as they change
        # places.
        d_s, grad_s, _ = _soft_extreme(fam, saddles, eps)
        lower, grad_lower, share_lower = _soft_extreme(fam, np.array([hi, lo]), -eps)
        if lower <= 0.0 or d_s <= 0.0:
            return [self._alone(s, twist) for s in basins if s.depth > 0.0]
        both = self._soft(fam, slice(None))
        sigma = min(d_s / lower, 1.0)
        c = sigma**2
        # What merging costs: as C grows, force goes from the saddle to the lower peak.
        change = sum(s.energy for s in basins) - both.energy
        lift = 2.0 * c / lower * change if sigma < 1.0 else 0.0
        pull = -2.0 * sigma / lower * change if sigma < 1.0 else 0.0
        stands = [max(fam.depth[i] - d_s, 0.0) + 1e-12 for i in (hi, lo)]
        pushes = []
        for i, s in enumerate(basins):
            share = float(np.exp((s.depth - both.depth) / eps))
            elastic = (1.0 - c) * s.elastic + c * share * both.elastic + lift * share_lower[i]
            # The pull is no surface of its own: the lower peak loses its friction first.
            rubs = elastic + pull * stands[1 - i] / sum(stands)
            push = self._push(
                s, elastic, (1.0 - c) * s.energy + c * share * both.energy, twist,
                min(max(rubs / elastic, 0.0), 1.0) if elastic > 0.0 else 0.0,
            )
            push.wrench += (1.0 - c) * s.elastic_wrench()
            pushes.append(push)
        pushes[0].wrench += c * both.elastic_wrench() - lift * grad_lower - pull * grad_s
        return pushes

    def _soft(self, fam: Family, members) -> "_Soft":
        eps, law = self.law.merge_depth_m, self.law.normal
        members = np.arange(len(fam.depth))[members]
        depth = fam.depth[members]
        top = depth.max()
        heavy = depth > top - FAINT * eps
        members, depth = members[heavy], depth[heavy]
        e = np.exp((depth - top) / eps)
        total = e.sum()
        w = e / total
        grad_i = fam.gradient(members)
        k_i, grad_k_i = fam.detail(members)
        out = _Soft()
        out.depth = top + eps * np.log(total)
        out.grad = w @ grad_i
        k = float(w @ k_i)
        # k is a mean by weights that move themselves as the place wanders over the family.
        grad_k = w @ grad_k_i + (w * (k_i - k)) @ (grad_i - out.grad) / eps
        out.k, out.grad_k = k, grad_k
        out.elastic = law.elastic(k, out.depth)
        out.energy = law.energy(k, out.depth)
        at = fam.point[members]
        out.point = w @ at
        out.spread = float(np.sqrt(w @ ((at - out.point) ** 2).sum(1)))
        n = w @ fam.normal[members]
        length = float(np.linalg.norm(n))
        out.normal = n / length if length > 0.0 else n
        out.size = length
        out.at = float(fam.at[members][depth.argmax()])
        return out

    def _alone(self, s, twist) -> Push:
        """A place that is merged with nothing."""
        push = self._push(s, s.elastic, s.energy, twist, 1.0)
        push.wrench += s.elastic_wrench()
        return push

    def _push(self, s, elastic: float, energy: float, twist, rubbing: float) -> Push:
        """A place with the dissipative part of its normal force only."""
        total = self.law.normal.total(elastic, float(s.grad @ twist)) if elastic > 0.0 else 0.0
        lost = total - elastic if elastic > 0.0 else 0.0
        return Push(
            -lost * s.grad, total * s.size * rubbing, s.spread, s.depth, s.point, s.normal, s.at,
            energy,
        )


class _Soft:
    """Soft maximum over some samples."""

    def elastic_wrench(self):
        """Minus the gradient of the stored energy."""
        return -self.elastic * self.grad - self.energy / self.k * self.grad_k


def _soft_extreme(fam: Family, idx, temperature: float):
    """Soft maximum of some samples (minimum, with a negative temperature), t ln sum exp(d/t), its
    gradient, and the weight of each."""
    d = fam.depth[idx]
    x = d / temperature
    e = np.exp(x - x.max())
    w = e / e.sum()
    value = temperature * float(x.max() + np.log(e.sum()))
    return value, w @ fam.gradient(idx), w


def _cross(a, b):
    """Cross product over the last axis; numpy's own is slow for this."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def _ring_on_ring(pair: Pair, r_ab, p_ab, k: float) -> Family:
    """Azimuths of the active circle; the nearest point of the passive one is a closed form."""
    at = np.linspace(0.0, TAU, RING_SAMPLES, endpoint=False)
    ra, rb = pair.a.mean_radius_m, pair.b.mean_radius_m
    pa = np.stack([np.zeros_like(at), ra * np.cos(at), ra * np.sin(at)], 1)
    local = (pa - p_ab) @ r_ab
    rho = np.hypot(local[:, 1], local[:, 2])
    near = np.stack([np.zeros_like(at), rb * local[:, 1] / rho, rb * local[:, 2] / rho], 1)
    pb = near @ r_ab.T + p_ab
    depth, n, point = _overlap(pair, pa, pb)
    return Family(
        depth, n, point, at, True, lambda idx: (np.full(len(idx), k), np.zeros((len(idx), 6)))
    )


def _overlap(pair: Pair, pa, pb):
    d = pb - pa
    dist = np.sqrt((d**2).sum(1))
    if dist.min() <= 0.0:
        raise ValueError("cores meet: the pair is deeper than its radii")
    n = d / dist[:, None]
    point = 0.5 * (pa + pair.a.radius_m * n + pb - pair.b.radius_m * n)
    return pair.reach_m - dist, n, point


def _ring_on_petal(pair: Pair, r_ab, p_ab, k0: float) -> Family:
    """Rulings of the petal, each with its own point nearest to the circle."""
    petal_is_a = isinstance(pair.a, PetalCore)
    petal, ring = (pair.a, pair.b) if petal_is_a else (pair.b, pair.a)
    # Circle and rulings in the ring's own frame.
    g = petal.petals
    u = np.linspace(-1.0, 1.0, RULING_SAMPLES)

    def end(x, r, half):
        a = petal.azimuth + u * half
        return np.stack([np.full_like(u, x), r * np.cos(a), r * np.sin(a)], 1)

    base = end(0.0, g.base_radius_m, g.base_half_angle_rad)
    tip = end(g.height_m, g.tip_radius_m, g.tip_half_angle_rad)
    if petal_is_a:
        base, tip = (base - p_ab) @ r_ab, (tip - p_ab) @ r_ab
    else:
        base, tip = base @ r_ab.T + p_ab, tip @ r_ab.T + p_ab
    t = tip - base
    length = np.sqrt((t**2).sum(1))
    w = _nearest_on_rulings(base, t, ring.mean_radius_m)
    p = base + w[:, None] * t
    rho = np.hypot(p[:, 1], p[:, 2])
    e_rho = np.stack([np.zeros_like(rho), p[:, 1] / rho, p[:, 2] / rho], 1)
    e_az = np.stack([np.zeros_like(rho), -e_rho[:, 2], e_rho[:, 1]], 1)
    q = ring.mean_radius_m * e_rho
    pa, pb = (p @ r_ab.T + p_ab, q @ r_ab.T + p_ab) if petal_is_a else (q, p)
    depth, n, point = _overlap(pair, pa, pb)

    def detail(i):
        # How w moves per displacement of the petal: phi'(w) = r . t = 0, differentiated.
        p_i, t_i, w_i, az = p[i], t[i], w[i], e_az[i]
        r = p_i - q[i]
        ratio = (ring.mean_radius_m / rho[i])[:, None]
        t_eff = t_i - ratio * (t_i * az).sum(1)[:, None] * az
        slope = (r * t_i).sum(1)
        held = ((w_i <= 0.0) & (slope >= 0.0)) | ((w_i >= 1.0) & (slope <= 0.0))
        t_free = np.where(held[:, None], 0.0, 1.0)
        # v_P = tau + theta x P and dt = theta x t.
        dw = -np.concatenate([t_eff, _cross(p_i, t_eff) + _cross(t_i, r)], axis=1)
        curvature = (t_i * t_eff).sum(1)
        dw = t_free * dw / curvature[:, None]
        k, dk_ds = petal_stiffness(k0, g.flexural_rigidity_n_m2, w_i * length[i])
        grad_k = (dk_ds * length[i])[:, None] * dw
        if petal_is_a:
            # Displacing the ring is displacing the petal the other way; then to the petal's frame.
            force = -grad_k[:, :3] @ r_ab.T
            moment = -grad_k[:, 3:] @ r_ab.T + _cross(p_ab, force)
            grad_k = np.concatenate([force, moment], axis=1)
        return k, grad_k

    return Family(depth, n, point, u, False, detail)


def _nearest_on_rulings(base, t, radius: float):
    """Parameter 0..1 of each line's point nearest to the circle of `radius` about X: the best of a
    few samples, then safeguarded Newton on all lines at once."""
    ws = np.linspace(0.0, 1.0, 9)
    pts = base[None] + ws[:, None, None] * t[None]
    rho = np.hypot(pts[..., 1], pts[..., 2])
    f = (rho - radius) ** 2 + pts[..., 0] ** 2
    w = ws[f.argmin(0)]
    lo, hi = np.maximum(w - 0.125, 0.0), np.minimum(w + 0.125, 1.0)
    for _ in range(60):
        p = base + w[:, None] * t
        rho = np.hypot(p[:, 1], p[:, 2])
        along = (p[:, 1] * t[:, 1] + p[:, 2] * t[:, 2]) / rho
        slope = (rho - radius) * along + p[:, 0] * t[:, 0]
        lo = np.where(slope < 0.0, w, lo)
        hi = np.where(slope > 0.0, w, hi)
        t_yz = t[:, 1] ** 2 + t[:, 2] ** 2
        curve = along**2 + (rho - radius) * (t_yz - along**2) / rho + t[:, 0] ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            new = w - slope / curve
        outside = ~((new >= lo) & (new <= hi))
        new = np.where(outside, 0.5 * (lo + hi), new)
        done = np.abs(new - w).max() < 1e-13
        w = new
        if done:
            break
    return w


def _two_peaks(fam: Family):
    """[(peak, all)] or [(peak, basin), (second peak, basin), saddles]: the second peak is the one
    that stands out most above the saddle towards the highest."""
    d = fam.depth
    n = len(d)
    top = int(d.argmax())
    if n < 3:
        return [(top, slice(None))]
    if fam.closed:
        order = (top + np.arange(n)) % n
        v = d[order]
        # Lowest sample met on the way from the top to each sample, both ways round.
        left, right = np.minimum.accumulate(v), np.minimum.accumulate(np.r_[v[0], v[:0:-1]])
        right = np.r_[right[0], right[:0:-1]]
        saddle_height = np.maximum(left, right)
        rise = v - saddle_height
        j = int(rise.argmax())
        if rise[j] <= 1e-9 * max(1.0, abs(d[top])):
            return [(top, slice(None))]
        cut1, cut2 = int(v[: j + 1].argmin()), j + int(np.r_[v[j:], v[0]].argmin())
        basin_lo = order[cut1 : min(cut2, n)]
        basin_hi = np.setdiff1d(order, basin_lo)
        return [(top, basin_hi), (int(order[j]), basin_lo), order[[cut1, cut2 % n]]]
    found = None
    for direction in (-1, 1):
        idx = np.arange(top, -1, -1) if direction < 0 else np.arange(top, n)
        v = d[idx]
        rise = v - np.minimum.accumulate(v)
        j = int(rise.argmax())
        if rise[j] > 1e-9 and (found is None or rise[j] > found[0]):
            cut = int(v[: j + 1].argmin())
            found = (rise[j], idx[j], idx[cut], direction)
    if found is None:
        return [(top, slice(None))]
    _, lo, cut, direction = found
    index = np.arange(n)
    in_lo = index[index <= cut] if direction < 0 else index[index >= cut]
    in_hi = index[index > cut] if direction < 0 else index[index < cut]
    return [(top, in_hi), (int(lo), in_lo), np.array([cut])]
