"""The mechanism's surfaces as MuJoCo knows them: capsules around the ring circles, convex hulls of
strips of the petals' sheets.

Geoms are *cores*, thin capsules and plates, and the radii about them are margins: MuJoCo then measures
distances between cores that do not overlap, which has smooth normals. A contact's depth is the sum of
the radii less the distance.
"""

from __future__ import annotations

import math

import numpy as np

from .places import ACROSS, ARCS, CORNER, ROW_BORDER, SIDE_BORDER

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


def side(side, name: str, r, p, capsules: int, strips: int, attributes, borders=None):
    """Geoms and assets of one side whose ring frame stands at (r, p) in its body. `attributes(radius)`
    gives a geom's margin, gap and contact attributes for the radius about its core.

    With `borders`, which gives them for borders and corners, every geom belongs to an element of
    `places.py` (its number is the last but one part of its name): arcs and cells are made of whole
    capsules and strips, and spheres and capsules along their edges are added."""
    geoms, assets = [], []

    def at(x):
        return p + r @ x

    def numbers(*points):
        return " ".join(repr(float(x)) for x in np.concatenate(points))

    def sphere(label, x, size, extra):
        geoms.append(f'<geom name="{label}" type="sphere" size="{size!r}" pos="{numbers(at(x))}" '
                     f'mass="0" {extra}/>')

    def capsule(label, x, y, size, extra):
        geoms.append(f'<geom name="{label}" type="capsule" size="{size!r}" '
                     f'fromto="{numbers(at(x), at(y))}" mass="0" {extra}/>')

    if borders is not None and (capsules % ARCS or strips % ACROSS):
        raise ValueError(f"capsules by {ARCS} and strips by {ACROSS}, found {capsules} and {strips}")
    # Chords that swing evenly about the circle: their mean distance from the centre is its radius.
    half = math.pi / capsules
    radius = side.ring_mean_radius_m / (0.5 * (1.0 + math.cos(half)))

    def corner(i):
        return radius * np.array([0.0, math.cos(2 * i * half), math.sin(2 * i * half)])

    about = side.ring_section_radius_m - WIRE_M
    for i in range(capsules):
        part = f"{i}" if borders is None else f"{i * ARCS // capsules}_{i}"
        capsule(f"{name}_ring_{part}", corner(i), corner(i + 1), WIRE_M, attributes(about))
    if borders is not None:
        for i in range(ARCS):
            sphere(f"{name}_ring_{ARCS + i}_0", corner(i * capsules // ARCS), WIRE_M, borders(about))
    if side.petals is None:
        return "".join(geoms), "".join(assets)
    about = 0.5 * side.petals.thickness_m - PLATE_M
    rows = [(0.0, 1.0)] if borders is None else [(0.0, 0.5), (0.5, 1.0)]

    def on(petal, u, w):
        foot, tip = ruling(side.petals, petal, u)
        return foot + w * (tip - foot)

    for petal in range(side.petals.count):
        us = np.linspace(-1.0, 1.0, strips + 1)
        for j in range(strips):
            for h, (lo, hi) in enumerate(rows):
                c = [on(petal, u, w) for u in us[j : j + 2] for w in (lo, hi)]
                n = np.cross(c[1] - c[0], c[2] - c[0])
                n *= PLATE_M / np.linalg.norm(n)
                points = numbers(*(at(x + s * n) for x in c for s in (-1.0, 1.0)))
                part = f"{j}" if borders is None else f"{2 * (j * ACROSS // strips) + h}_{j}"
                mesh = f"{name}_petal{petal}_{part}"
                assets.append(f'<mesh name="{mesh}" vertex="{points}" inertia="convex"/>')
                geoms.append(
                    f'<geom name="{mesh}" type="mesh" mesh="{mesh}" mass="0" {attributes(about)}/>'
                )
        if borders is None:
            continue
        label, extra = f"{name}_petal{petal}", borders(about)
        for b in range(ACROSS - 1):
            u = us[(b + 1) * strips // ACROSS]
            for h, (lo, hi) in enumerate(rows):
                capsule(f"{label}_{SIDE_BORDER + 2 * b + h}_0", on(petal, u, lo), on(petal, u, hi),
                        PLATE_M, extra)
            sphere(f"{label}_{CORNER + b}_0", on(petal, u, 0.5), PLATE_M, extra)
        for j in range(strips):
            capsule(f"{label}_{ROW_BORDER + j * ACROSS // strips}_{j}", on(petal, us[j], 0.5),
                    on(petal, us[j + 1], 0.5), PLATE_M, extra)
    return "".join(geoms), "".join(assets)
