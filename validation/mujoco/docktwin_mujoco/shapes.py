"""The mechanism's surfaces as MuJoCo knows them: capsules around the ring circles, convex hulls of
strips of the petals' sheets.

Geoms are *cores*, thin capsules and plates, and the radii about them are margins: MuJoCo then measures
distances between cores that do not overlap, which has smooth normals. A contact's depth is the sum of
the radii less the distance.
"""

from __future__ import annotations

import math

import numpy as np

# Radius of a ring's capsules and half-thickness of a petal's plates, taken off the margins.
WIRE_M, PLATE_M = 1e-3, 1e-4


def ruling(petals, i: int, u: float):
    """Foot and tip of the ruling u of petal i."""
    a = petals.first_azimuth_rad + 2.0 * math.pi * i / petals.count
    b, t = a + u * petals.base_half_angle_rad, a + u * petals.tip_half_angle_rad
    return (
        np.array([0.0, petals.base_radius_m * math.cos(b), petals.base_radius_m * math.sin(b)]),
        np.array([petals.height_m, petals.tip_radius_m * math.cos(t),
                  petals.tip_radius_m * math.sin(t)]),
    )


def side(side, name: str, r, p, capsules: int, strips: int, attributes):
    """Geoms and assets of one side whose ring frame stands at (r, p) in its body. `attributes(radius)`
    gives a geom's margin, gap and contact attributes for the radius about its core."""
    geoms, assets = [], []
    # Chords that swing evenly about the circle: their mean distance from the centre is its radius.
    half = math.pi / capsules
    radius = side.ring_mean_radius_m / (0.5 * (1.0 + math.cos(half)))
    extra = attributes(side.ring_section_radius_m - WIRE_M)
    for i in range(capsules):
        ends = []
        for a in (2 * i * half, 2 * (i + 1) * half):
            ends.append(p + r @ np.array([0.0, radius * math.cos(a), radius * math.sin(a)]))
        numbers = " ".join(repr(float(x)) for x in np.concatenate(ends))
        geoms.append(
            f'<geom name="{name}_ring_{i}" type="capsule" size="{WIRE_M!r}" fromto="{numbers}" '
            f'mass="0" {extra}/>'
        )
    if side.petals is not None:
        extra = attributes(0.5 * side.petals.thickness_m - PLATE_M)
        for petal in range(side.petals.count):
            for j in range(strips):
                u0, u1 = -1.0 + 2.0 * j / strips, -1.0 + 2.0 * (j + 1) / strips
                corners = [*ruling(side.petals, petal, u0), *ruling(side.petals, petal, u1)]
                n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
                n *= PLATE_M / np.linalg.norm(n)
                points = [p + r @ (c + s * n) for c in corners for s in (-1.0, 1.0)]
                numbers = " ".join(repr(float(x)) for x in np.concatenate(points))
                mesh = f"{name}_petal{petal}_{j}"
                assets.append(f'<mesh name="{mesh}" vertex="{numbers}" inertia="convex"/>')
                geoms.append(
                    f'<geom name="{mesh}" type="mesh" mesh="{mesh}" mass="0" {extra}/>'
                )
    return "".join(geoms), "".join(assets)
