//! Where the parts of the mechanism are, from what was recorded.

use docktwin_core::{DQuat, DVec3, Pose, Twist};
use docktwin_model::{
    Attenuator, DockingMechanism, PetalGeometry, SideGeometry, Surface, SurfaceCore, SurfaceGrid,
};
use docktwin_record::{Cell, RunReader};
use docktwin_scenario::Scenario;

/// Motion of the three bodies at one tick, as recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bodies {
    /// Mass centres and attitudes in the world: chaser, active ring, target.
    pub(crate) pose: [Pose; 3],
    /// Velocity of the mass centre (m/s) and angular velocity (rad/s), both in the world.
    pub(crate) twist: [Twist; 3],
    /// `p_34` in `e3`, m.
    pub(crate) relative: DVec3,
}

impl Bodies {
    /// Velocity of a body at a point of the world, m/s.
    pub(crate) fn velocity(&self, body: usize, at: DVec3) -> DVec3 {
        let t = &self.twist[body];
        t.v + t.w.cross(at - self.pose[body].p)
    }
}

/// Columns of [`Bodies`].
#[derive(Clone, Debug)]
pub(crate) struct BodyColumns {
    position: [[usize; 3]; 3],
    velocity: [[usize; 3]; 3],
    rate: [[usize; 3]; 3],
    attitude: [[usize; 4]; 3],
    relative: [usize; 3],
}

impl BodyColumns {
    /// `None` where the recording has not all of them.
    pub(crate) fn find(r: &RunReader) -> Option<Self> {
        let three = |name: String, unit: &str| -> Option<[usize; 3]> {
            let at = |a: &str| r.column_index(&format!("{name}_{a}_{unit}"));
            Some([at("x")?, at("y")?, at("z")?])
        };
        let bodies = ["chaser", "ring", "target"];
        let of = |what: &str, unit: &str| -> Option<[[usize; 3]; 3]> {
            let [a, b, c] = bodies.map(|n| three(format!("{n}_{what}"), unit));
            Some([a?, b?, c?])
        };
        let [a, b, c] = bodies.map(|n| {
            let at = |k: &str| r.column_index(&format!("{n}_attitude_{k}"));
            Some([at("x")?, at("y")?, at("z")?, at("w")?])
        });
        Some(Self {
            position: of("position", "m")?,
            velocity: of("velocity", "m_s")?,
            rate: of("rate", "rad_s")?,
            attitude: [a?, b?, c?],
            relative: three("relative_position".to_owned(), "m")?,
        })
    }

    /// `None` where a number is not finite.
    pub(crate) fn read(&self, row: &[Cell]) -> Option<Bodies> {
        let get = |i: usize| row.get(i).map_or(f64::NAN, |c| c.as_f64());
        let vector = |i: [usize; 3]| DVec3::from_array(i.map(get));
        let pose: [Pose; 3] = core::array::from_fn(|b| {
            let q = DQuat::from_array(self.attitude[b].map(get));
            Pose::new(vector(self.position[b]), q.normalize())
        });
        let twist = core::array::from_fn(|b| Twist {
            v: vector(self.velocity[b]),
            // Rates are recorded in body axes.
            w: pose[b].q * vector(self.rate[b]),
        });
        let relative = vector(self.relative);
        let ok = pose.iter().all(Pose::is_finite)
            && twist.iter().all(|t: &Twist| t.v.is_finite() && t.w.is_finite());
        (ok && relative.is_finite()).then_some(Bodies { pose, twist, relative })
    }
}

/// World poses of the frames of the mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Poses {
    pub(crate) x_w3: Pose,
    /// `r3`, the active ring.
    pub(crate) x_wr: Pose,
    pub(crate) x_w4: Pose,
    /// `r4`, the passive ring.
    pub(crate) x_wp: Pose,
}

/// The mechanism with the frames it hangs on.
#[derive(Clone, Debug)]
pub(crate) struct Geometry {
    pub(crate) mechanism: DockingMechanism,
    x_13: Pose,
    x_24: Pose,
}

impl Geometry {
    pub(crate) fn new(s: &Scenario) -> Self {
        let m = s.mechanism.clone();
        let mut x_13 = s.chaser.x_body_port;
        if m.attenuator == Attenuator::Rigid {
            // Chaser and ring are then one body, recorded at their joint mass centre.
            let ring = x_13.transform_point(DVec3::X * m.ring_rest_offset_m + m.ring_body.com_m);
            x_13.p -= ring * (m.ring_body.mass_kg / (m.ring_body.mass_kg + s.chaser.mass_kg));
        }
        Self { mechanism: m, x_13, x_24: s.target.x_body_port }
    }

    pub(crate) fn poses(&self, b: &Bodies) -> Poses {
        let half_turn = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
        let x_w4 = b.pose[2] * self.x_24;
        let x_4r = Pose::new(DVec3::X * -self.mechanism.passive_ring_offset_m, half_turn);
        Poses {
            x_w3: b.pose[0] * self.x_13,
            x_wr: b.pose[1] * Pose::from_translation(-self.mechanism.ring_body.com_m),
            x_w4,
            x_wp: x_w4 * x_4r,
        }
    }

    /// How far the ports are from where they were recorded, m: more than rounding means that the
    /// models are not those of the run.
    pub(crate) fn mismatch_m(&self, b: &Bodies) -> f64 {
        let p = self.poses(b);
        (p.x_w3.inverse() * p.x_w4).p.distance(b.relative)
    }
}

/// A patch of a surface, seen from outside counter-clockwise.
pub(crate) struct Patch {
    pub(crate) corners: [DVec3; 4],
    pub(crate) two_sided: bool,
    /// Seen through: something may be in it.
    pub(crate) glass: bool,
}

/// The ring, in its frame.
pub(crate) fn ring_patches(side: &SideGeometry) -> Vec<Patch> {
    const AROUND: u32 = 60;
    const SECTION: u32 = 8;
    let (r, s) = (side.ring.mean_radius_m, side.ring.section_radius_m);
    let at = |i: u32, j: u32| {
        let (sa, ca) = (f64::from(i) / f64::from(AROUND) * core::f64::consts::TAU).sin_cos();
        let (sb, cb) = (f64::from(j) / f64::from(SECTION) * core::f64::consts::TAU).sin_cos();
        let radius = r + s * cb;
        DVec3::new(s * sb, radius * ca, radius * sa)
    };
    (0..AROUND)
        .flat_map(|i| (0..SECTION).map(move |j| (i, j)))
        .map(|(i, j)| Patch {
            corners: [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
            two_sided: false,
            glass: false,
        })
        .collect()
}

/// A listed surface, in its ring frame.
pub(crate) fn surface_patches(s: &Surface) -> Vec<Patch> {
    let hollow = matches!(s.core, SurfaceCore::Hollow { .. });
    let of = |grid: SurfaceGrid| {
        let at = |i: usize, j: usize| grid.points[i * grid.columns + j % grid.columns][0];
        let cells = (1..grid.rows).flat_map(|i| (0..grid.columns).map(move |j| (i, j)));
        let corners = |(i, j)| [at(i - 1, j), at(i - 1, j + 1), at(i, j + 1), at(i, j)];
        cells
            .map(|cell| Patch { corners: corners(cell), two_sided: hollow, glass: hollow })
            .collect::<Vec<_>>()
    };
    s.grids(24).into_iter().flat_map(of).collect()
}

/// The mid-surface of a petal, in its ring frame.
pub(crate) fn petal_patches(p: &PetalGeometry, i: u32) -> Vec<Patch> {
    const ACROSS: u32 = 10;
    const ALONG: u32 = 5;
    let at = |a: u32, b: u32| {
        let [base, tip] = p.ruling(i, 2.0 * f64::from(a) / f64::from(ACROSS) - 1.0);
        base.lerp(tip, f64::from(b) / f64::from(ALONG))
    };
    (0..ACROSS)
        .flat_map(|a| (0..ALONG).map(move |b| (a, b)))
        .map(|(a, b)| Patch {
            corners: [at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)],
            two_sided: true,
            glass: false,
        })
        .collect()
}

/// Where a point of the ring frame lies among the petals of a side: `between petals P1 and P2`.
pub(crate) fn among_petals(side: &SideGeometry, letter: char, point: DVec3) -> Option<String> {
    let petals = side.petals.as_ref().filter(|p| p.count > 0)?;
    let azimuth = point.z.atan2(point.y);
    let off = |i: u32| wrapped(azimuth - petals.azimuth_rad(i));
    let half = petals.base_half_angle_rad.max(petals.tip_half_angle_rad);
    let n = petals.count;
    if let Some(i) = (0..n).find(|i| off(*i).abs() <= half) {
        return Some(format!("where petal {letter}{} stands", i + 1));
    }
    let after = (0..n).filter(|i| off(*i) > 0.0).min_by(|a, b| off(*a).total_cmp(&off(*b)));
    let before = (0..n).filter(|i| off(*i) < 0.0).max_by(|a, b| off(*a).total_cmp(&off(*b)));
    match (after, before) {
        (Some(a), Some(b)) if a != b => {
            let (low, high) = (a.min(b) + 1, a.max(b) + 1);
            Some(format!("between petals {letter}{low} and {letter}{high}"))
        }
        _ => Some(format!("beside petal {letter}1")),
    }
}

/// Which part of a petal a point of the ring frame lies on: `near its tip, at the edge`.
pub(crate) fn on_petal(p: &PetalGeometry, i: u32, point: DVec3) -> String {
    let s = (point.x / p.height_m).clamp(0.0, 1.0);
    let half = p.base_half_angle_rad + s * (p.tip_half_angle_rad - p.base_half_angle_rad);
    let u = wrapped(point.z.atan2(point.y) - p.azimuth_rad(i)).abs() / half.max(1e-6);
    let height = if s < 1.0 / 3.0 {
        "near the base"
    } else if s < 2.0 / 3.0 {
        "halfway up"
    } else {
        "near the tip"
    };
    let edge = if u > 0.85 { ", at the edge" } else { "" };
    format!("{height}{edge}")
}

/// The side of the axis on which a point of `e3` lies: `on the +Y −Z side`.
pub(crate) fn side_of_axis(point: DVec3) -> String {
    let r = point.y.hypot(point.z);
    let word = |v: f64, name: char| {
        let share = v / r.max(1e-12);
        // Within 22.5° of an axis the other one is not named.
        if share.abs() < 0.3827 {
            return None;
        }
        Some(format!("{}{name}", if v > 0.0 { '+' } else { '−' }))
    };
    let words: Vec<String> =
        [word(point.y, 'Y'), word(point.z, 'Z')].into_iter().flatten().collect();
    format!("on the {} side", words.join(" "))
}

/// Into −π to π.
fn wrapped(a: f64) -> f64 {
    let turn = core::f64::consts::TAU;
    a - turn * (a / turn).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use docktwin_model::RingGeometry;

    fn side() -> SideGeometry {
        SideGeometry {
            has_ring: true,
            surfaces: Vec::new(),
            ring: RingGeometry { mean_radius_m: 0.6, section_radius_m: 0.025, segments: 48 },
            petals: Some(PetalGeometry {
                count: 3,
                first_azimuth_rad: 0.0,
                base_radius_m: 0.597,
                tip_radius_m: 0.41,
                height_m: 0.187,
                base_half_angle_rad: 28f64.to_radians(),
                tip_half_angle_rad: 14f64.to_radians(),
                thickness_m: 0.02,
                strips: 8,
                flexural_rigidity_n_m2: 1.6e4,
            }),
        }
    }

    fn on_ring(degrees: f64) -> DVec3 {
        let (s, c) = degrees.to_radians().sin_cos();
        DVec3::new(0.0, 0.6 * c, 0.6 * s)
    }

    #[test]
    fn oracle_places_on_a_ring_are_named_by_their_petals() {
        // Petals at 0, 120 and 240 degrees, 28 degrees to each side.
        for (azimuth, want) in [
            (5.0, "where petal P1 stands"),
            (-27.0, "where petal P1 stands"),
            (60.0, "between petals P1 and P2"),
            (180.0, "between petals P2 and P3"),
            (-60.0, "between petals P1 and P3"),
            (330.5, "between petals P1 and P3"),
            (115.0, "where petal P2 stands"),
        ] {
            assert_eq!(among_petals(&side(), 'P', on_ring(azimuth)).unwrap(), want, "{azimuth}");
        }
        let bare = SideGeometry { petals: None, ..side() };
        assert_eq!(among_petals(&bare, 'P', on_ring(0.0)), None);
    }

    #[test]
    fn oracle_places_on_a_petal() {
        let p = side().petals.unwrap();
        let [base, tip] = p.ruling(1, 0.0);
        assert_eq!(on_petal(&p, 1, base.lerp(tip, 0.1)), "near the base");
        assert_eq!(on_petal(&p, 1, base.lerp(tip, 0.5)), "halfway up");
        let [base, tip] = p.ruling(1, -0.95);
        assert_eq!(on_petal(&p, 1, base.lerp(tip, 0.9)), "near the tip, at the edge");
    }

    #[test]
    fn oracle_sides_of_the_axis() {
        assert_eq!(side_of_axis(DVec3::new(9.0, 0.6, 0.1)), "on the +Y side");
        assert_eq!(side_of_axis(DVec3::new(0.0, -0.4, 0.4)), "on the −Y +Z side");
    }

    #[test]
    fn oracle_patches_cover_the_torus_and_look_outward() {
        let mut area = 0.0;
        for p in ring_patches(&side()) {
            let [a, b, c, d] = p.corners;
            let n = (c - a).cross(d - b) * 0.5;
            area += n.length();
            let middle = (a + b + c + d) / 4.0;
            let circle = DVec3::new(0.0, middle.y, middle.z).normalize() * 0.6;
            assert!(n.dot(middle - circle) > 0.0, "outward");
        }
        let exact = 4.0 * core::f64::consts::PI.powi(2) * 0.6 * 0.025;
        assert!((0.93..1.0).contains(&(area / exact)), "{}", area / exact);
    }
}
