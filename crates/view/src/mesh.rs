use core::f64::consts::{PI, TAU};

use docktwin_core::DVec3;
use docktwin_model::{PetalGeometry, RingGeometry, Surface};

/// Triangles with a normal at every vertex; metres, in the frame of the part.
#[derive(Default)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Points around a ring or a hull: a chord of 0.6 m radius then errs by 0.3 mm.
const AROUND: u32 = 96;

pub(crate) fn f32x3(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

impl Mesh {
    /// A grid of `rows × columns` vertices, the columns closed into a loop if `wrap`.
    fn push_grid(
        &mut self,
        rows: u32,
        columns: u32,
        wrap: bool,
        vertex: impl Fn(u32, u32) -> (DVec3, DVec3),
    ) {
        let first = u32::try_from(self.positions.len()).unwrap_or(u32::MAX);
        for i in 0..rows {
            for j in 0..columns {
                let (p, n) = vertex(i, j);
                self.positions.push(f32x3(p));
                self.normals.push(f32x3(n));
            }
        }
        let at = |i: u32, j: u32| first + i * columns + j % columns;
        for i in 1..rows {
            for j in 0..if wrap { columns } else { columns - 1 } {
                let (a, b, c, d) = (at(i - 1, j), at(i - 1, j + 1), at(i, j + 1), at(i, j));
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }

    /// The torus about X, in the ring frame.
    pub(crate) fn torus(g: &RingGeometry) -> Self {
        const SECTION: u32 = 24;
        let mut m = Self::default();
        m.push_grid(SECTION + 1, AROUND, true, |i, j| {
            let (s, c) = (f64::from(i) / f64::from(SECTION) * TAU).sin_cos();
            let radial = around(j);
            let n = radial * c + DVec3::X * s;
            (radial * g.mean_radius_m + n * g.section_radius_m, n)
        });
        m
    }

    /// Petal `i` as its mid-surface swept by a ball of half the thickness, in the ring frame.
    pub(crate) fn petal(g: &PetalGeometry, i: u32) -> Self {
        const ACROSS: u32 = 24;
        const ALONG: u32 = 8;
        const ROUND: u32 = 8;
        let half = 0.5 * g.thickness_m;
        let sample = |u: f64, v: f64| Sample::of(g, i, u, v);
        let u_of = |k: u32| 2.0 * f64::from(k) / f64::from(ACROSS) - 1.0;
        let v_of = |k: u32| f64::from(k) / f64::from(ALONG);

        let mut m = Self::default();
        for side in [1.0, -1.0] {
            m.push_grid(ALONG + 1, ACROSS + 1, false, |a, b| {
                let s = sample(u_of(b), v_of(a));
                let n = s.normal * side;
                (s.point + n * half, n)
            });
        }

        // Once around the edge; a corner comes twice, with the outward direction of either edge,
        // so that the rim between is a piece of the ball.
        let mut edge = Vec::new();
        edge.extend((0..=ACROSS).map(|k| (sample(u_of(k), 0.0), -1.0, 0.0)));
        edge.extend((0..=ALONG).map(|k| (sample(1.0, v_of(k)), 0.0, 1.0)));
        edge.extend((0..=ACROSS).rev().map(|k| (sample(u_of(k), 1.0), 1.0, 0.0)));
        edge.extend((0..=ALONG).rev().map(|k| (sample(-1.0, v_of(k)), 0.0, -1.0)));
        let columns = u32::try_from(edge.len()).unwrap_or(0);
        m.push_grid(ROUND + 1, columns, true, |a, b| {
            let (s, along, across) = &edge[b as usize];
            let (sin, cos) = (f64::from(a) / f64::from(ROUND) * PI).sin_cos();
            let n = s.normal * cos + (s.to_tip * *along + s.across * *across) * sin;
            (s.point + n * half, n)
        });
        m
    }

    /// A listed surface, in the ring frame.
    pub(crate) fn surface(s: &Surface) -> Self {
        let mut m = Self::default();
        for grid in s.grids(48) {
            let size = |n: usize| u32::try_from(n).unwrap_or(0);
            m.push_grid(size(grid.rows), size(grid.columns), true, |i, j| {
                let [p, n] = grid.points[i as usize * grid.columns + j as usize];
                (p, n)
            });
        }
        m
    }

    /// A closed surface around the origin: its distance in every direction.
    pub(crate) fn star(distance: impl Fn(DVec3) -> f64) -> Self {
        const ROWS: u32 = 32;
        let mut m = Self::default();
        m.push_grid(ROWS + 1, AROUND, true, |i, j| {
            let (s, c) = (f64::from(i) / f64::from(ROWS) * PI).sin_cos();
            let direction = around(j) * s + DVec3::X * c;
            (direction * distance(direction), direction)
        });
        m
    }

    /// A body of revolution about X through (x, radius) points from its +X end to its −X end,
    /// creased at each of them.
    pub(crate) fn revolution(profile: &[[f64; 2]]) -> Self {
        let mut m = Self::default();
        for pair in profile.windows(2) {
            let ([x0, r0], [x1, r1]) = (pair[0], pair[1]);
            let slope = DVec3::new(r1 - r0, x0 - x1, 0.0).normalize_or(DVec3::X);
            m.push_grid(2, AROUND, true, |i, j| {
                let (x, r) = if i == 0 { (x0, r0) } else { (x1, r1) };
                let radial = around(j);
                (DVec3::X * x + radial * r, DVec3::X * slope.x + radial * slope.y)
            });
        }
        m
    }
}

/// Unit vector at azimuth step `j`, from +Y toward +Z.
fn around(j: u32) -> DVec3 {
    let (s, c) = (f64::from(j % AROUND) / f64::from(AROUND) * TAU).sin_cos();
    DVec3::new(0.0, c, s)
}

/// A place of the petal's mid-surface with directions in it: square to the arc toward the tip,
/// square to the ruling toward growing azimuth; and the normal.
struct Sample {
    point: DVec3,
    to_tip: DVec3,
    across: DVec3,
    normal: DVec3,
}

impl Sample {
    fn of(g: &PetalGeometry, i: u32, u: f64, v: f64) -> Self {
        let at = |u: f64| {
            let [base, tip] = g.ruling(i, u);
            base.lerp(tip, v)
        };
        let [base, tip] = g.ruling(i, u);
        let along = (tip - base).normalize_or(DVec3::X);
        let arc = (at(u + 1e-4) - at(u - 1e-4)).normalize_or(DVec3::Y);
        let across = (arc - along * arc.dot(along)).normalize_or(DVec3::Y);
        let to_tip = (along - arc * along.dot(arc)).normalize_or(DVec3::X);
        Self { point: at(u), to_tip, across, normal: along.cross(across) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distances(m: &Mesh, to: impl Fn(DVec3) -> f64) -> (f64, f64) {
        m.positions.iter().fold((f64::MAX, 0.0f64), |(lo, hi), p| {
            let d = to(DVec3::new(p[0].into(), p[1].into(), p[2].into()));
            (lo.min(d), hi.max(d))
        })
    }

    /// Every edge of a closed surface belongs to two triangles; vertices at one place count once.
    fn open_edges(m: &Mesh) -> usize {
        let key = |i: u32| m.positions[i as usize].map(|x| (f64::from(x) * 1e6).round() as i64);
        let mut count = std::collections::BTreeMap::new();
        for t in &m.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let (a, b) = (key(a), key(b));
                if a != b {
                    *count.entry((a.min(b), a.max(b))).or_insert(0) += 1;
                }
            }
        }
        count.values().filter(|n| **n % 2 == 1).count()
    }

    const PETAL: PetalGeometry = PetalGeometry {
        count: 3,
        first_azimuth_rad: 0.3,
        base_radius_m: 0.597,
        tip_radius_m: 0.410,
        height_m: 0.187,
        base_half_angle_rad: 0.489,
        tip_half_angle_rad: 0.244,
        thickness_m: 0.020,
        strips: 4,
        flexural_rigidity_n_m2: 1.6e4,
    };

    #[test]
    fn oracle_torus_vertices_lie_on_the_torus() {
        let g = RingGeometry { mean_radius_m: 0.6, section_radius_m: 0.025, segments: 48 };
        let m = Mesh::torus(&g);
        let (lo, hi) = distances(&m, |p| (p.y.hypot(p.z) - 0.6).hypot(p.x));
        assert!((lo - 0.025).abs() < 1e-6 && (hi - 0.025).abs() < 1e-6, "{lo} {hi}");
        assert_eq!(open_edges(&m), 0);
    }

    #[test]
    fn oracle_petal_vertices_are_half_a_thickness_off_the_mid_surface() {
        for i in 0..3 {
            let m = Mesh::petal(&PETAL, i);
            // Distance to the mid-surface by search over rulings, each a segment.
            let (lo, hi) = distances(&m, |p| {
                (0..=400)
                    .map(|k| {
                        let [a, b] = PETAL.ruling(i, f64::from(k) / 200.0 - 1.0);
                        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                        p.distance(a.lerp(b, t))
                    })
                    .fold(f64::MAX, f64::min)
            });
            assert!(lo > 0.0098 && hi < 0.0101, "petal {i}: {lo} {hi}");
            assert_eq!(open_edges(&m), 0, "petal {i}");
        }
    }

    #[test]
    fn invariant_normals_are_unit_vectors() {
        let hull =
            Mesh::revolution(&[[0.0, 0.0], [0.0, 0.8], [-0.5, 1.3], [-6.0, 1.3], [-6.0, 0.0]]);
        for m in [hull, Mesh::petal(&PETAL, 1)] {
            assert!(!m.triangles.is_empty());
            assert_eq!(open_edges(&m), 0);
            for n in &m.normals {
                let l = n.iter().map(|x| x * x).sum::<f32>().sqrt();
                assert!((l - 1.0).abs() < 1e-3, "{l}");
            }
        }
    }
}
