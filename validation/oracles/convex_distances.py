"""Distances of convex cores by coal, a collision library of its own (https://pypi.org/project/coal).

Writes crates/physics/tests/surfaces/coal.csv, against which docktwin's depths are held; run by hand in an environment
with `pip install coal numpy`. The cores are those of `convex()` in crates/physics/tests/surfaces.rs, in its order.
"""

import pathlib

import coal
import numpy as np

POINTS = [[0.0, 0.1, 0.0], [0.0, -0.08, 0.05], [0.12, 0.0, 0.1], [-0.1, 0.02, -0.09], [0.05, 0.06, -0.02]]
# coal's axis is Z, ours X: Z to X, X to Y, Y to Z.
TO_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def hull():
    points = coal.StdVec_Vec3s()
    for p in POINTS:
        points.append(np.array(p))
    return coal.Convex.convexHull(points, False, "")


def cores():
    """Shape, its axes in ours, and the radius that it has beyond its core."""
    return [
        (coal.Sphere(0.01), np.eye(3), 0.01),
        (coal.Capsule(0.01, 0.3), TO_X, 0.01),
        (coal.Box(0.2, 0.12, 0.16), np.eye(3), 0.0),
        (coal.Cylinder(0.07, 0.2), TO_X, 0.0),
        (coal.Cone(0.1, 0.16), TO_X, 0.0),
        (hull(), np.eye(3), 0.0),
    ]


def matrix(q):
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def main():
    rng = np.random.default_rng(14)
    shapes = cores()
    rows = ["# kind of a, kind of b, place of b in a (m), its attitude (w, x, y, z), distance of the cores (m): coal "
            + coal.__version__]
    for i, (a, axes_a, ball_a) in enumerate(shapes):
        for j, (b, axes_b, ball_b) in enumerate(shapes):
            found = 0
            while found < 70:
                p = rng.uniform(-0.35, 0.35, 3)
                q = rng.normal(size=4)
                q /= np.linalg.norm(q)
                request, result = coal.DistanceRequest(), coal.DistanceResult()
                request.gjk_tolerance = 1e-12
                request.gjk_max_iterations = 1000
                d = coal.distance(
                    a, coal.Transform3s(axes_a, np.zeros(3)),
                    b, coal.Transform3s(matrix(q) @ axes_b, p), request, result)
                d += ball_a + ball_b
                # Apart, and near enough to matter.
                if not 1e-4 < d < 0.2:
                    continue
                found += 1
                rows.append(",".join([str(i), str(j)] + [repr(float(x)) for x in [*p, *q, d]]))
    out = pathlib.Path(__file__).parents[2] / "crates/physics/tests/surfaces/coal.csv"
    out.write_text("\n".join(rows) + "\n")
    print(len(rows) - 1, "poses")


if __name__ == "__main__":
    main()
