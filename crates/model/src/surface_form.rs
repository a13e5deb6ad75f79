//! The form of a listed surface as grids of points, for whoever draws it.

use core::f64::consts::{PI, TAU};

use docktwin_core::DVec3;

use crate::surface::{Surface, SurfaceCore};

/// Points of a surface with outward normals, in the ring frame: `rows` of `columns` points, the last column joining
/// the first.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceGrid {
    /// Rows.
    pub rows: usize,
    /// Points in a row.
    pub columns: usize,
    /// Points, m, and their normals, row by row.
    pub points: Vec<[DVec3; 2]>,
}

impl Surface {
    /// Its form, `columns` points around and half as many along.
    #[must_use]
    pub fn grids(&self, columns: usize) -> Vec<SurfaceGrid> {
        let grid = |rows: usize, vertex: &dyn Fn(usize, DVec3) -> [DVec3; 2]| {
            let place = |[p, n]: [DVec3; 2]| [self.x_ring.transform_point(p), self.x_ring.q * n];
            let points = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
            let points = points.map(|(i, j)| place(vertex(i, around(j, columns)))).collect();
            SurfaceGrid { rows, columns, points }
        };
        let r = self.rounding_m;
        let rows = (columns / 2).max(6) + 1;
        match &self.core {
            SurfaceCore::Torus { radius } => vec![grid(rows, &|i, radial| {
                let (s, c) = (part(i, rows) * TAU).sin_cos();
                let n = radial * c + DVec3::X * s;
                [radial * *radius + n * r, n]
            })],
            SurfaceCore::Hollow { profile } => profile
                .windows(2)
                .flat_map(|w| [1.0, -1.0].map(|side| (w, side)))
                .map(|(w, side)| {
                    let [[x0, r0], [x1, r1]] = [w[0], w[1]];
                    let length = (x1 - x0).hypot(r1 - r0);
                    let (nx, nr) = (side * (r0 - r1) / length, side * (x1 - x0) / length);
                    grid(2, &|i, radial| {
                        let (x, rho) = if i == 0 { (x0, r0) } else { (x1, r1) };
                        let n = DVec3::X * nx + radial * nr;
                        [DVec3::X * x + radial * rho + n * r, n]
                    })
                })
                .collect(),
            // The farthest point along every direction.
            core => vec![grid(rows, &|i, radial| {
                let (s, c) = (part(i, rows) * PI).sin_cos();
                let n = radial * s + DVec3::X * c;
                [core.farthest(n) + n * r, n]
            })],
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn part(i: usize, rows: usize) -> f64 {
    i as f64 / (rows - 1) as f64
}

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn around(j: usize, columns: usize) -> DVec3 {
    let (s, c) = (j as f64 / columns as f64 * TAU).sin_cos();
    DVec3::new(0.0, c, s)
}
