//! Random poses and approaches, the same on every machine.
#![allow(dead_code, unreachable_pub, reason = "every test file uses its own part")]

use docktwin_core::{DQuat, DVec3, Euler, Pose};
use docktwin_physics::{contact::Scene, initial::ContactConditions};

/// Half-width of what is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    pub name: &'static str,
    pub roll_deg: f64,
    pub tilt_deg: f64,
    pub lateral_m: f64,
}

/// Approaches that a mission might see, and well beyond.
pub const USUAL: Region = Region { name: "usual", roll_deg: 30.0, tilt_deg: 15.0, lateral_m: 0.3 };
/// Anything.
pub const WILD: Region = Region { name: "wild", roll_deg: 60.0, tilt_deg: 60.0, lateral_m: 0.6 };

/// Steele, Lea and Flood's splitmix64.
pub struct Draws(u64);

impl Draws {
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 0 … 1.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 53) as f64
    }

    /// −`half` … `half`.
    pub fn within(&mut self, half: f64) -> f64 {
        half * (2.0 * self.unit() - 1.0)
    }

    pub fn vector(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.within(half), self.within(half), self.within(half))
    }

    fn attitude(&mut self, r: &Region) -> Euler {
        let (roll, tilt) = (r.roll_deg, r.tilt_deg);
        Euler::from_degrees(self.within(roll), self.within(tilt), self.within(tilt))
    }

    /// Pose of the passive ring in the active one's frame; it need not touch.
    pub fn pose(&mut self, r: &Region) -> Pose {
        let q = self.attitude(r).to_quat() * DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);
        let x = -0.05 + 0.5 * self.unit();
        Pose::new(DVec3::new(x, self.within(r.lateral_m), self.within(r.lateral_m)), q)
    }

    /// Conditions at the first touch.
    pub fn conditions(&mut self, r: &Region) -> ContactConditions {
        ContactConditions {
            attitude: self.attitude(r),
            lateral_m: DVec3::new(0.0, self.within(r.lateral_m), self.within(r.lateral_m)),
            velocity_m_s: DVec3::new(
                -(0.02 + 0.38 * self.unit()),
                self.within(0.1),
                self.within(0.1),
            ),
            rate_rad_s: self.vector(1f64.to_radians()),
            ..ContactConditions::default()
        }
    }

    /// A small motion, and the most that any surface point within `reach` of the ring's centre moves.
    pub fn step(&mut self, x: Pose, size: f64, reach: f64) -> (Pose, f64) {
        let (dp, turn) = (self.vector(size), self.vector(size / reach));
        let y = Pose::new(x.p + dp, (DQuat::from_scaled_axis(turn) * x.q).normalize());
        (y, dp.length() + turn.length() * reach)
    }
}

/// Depth of the deepest pair, m.
pub fn top(scene: &Scene, x: Pose) -> f64 {
    let depths = scene.depths(x, -5e-3);
    depths.into_iter().filter(|d| d.is_finite()).fold(f64::NEG_INFINITY, f64::max)
}

/// Moves a pose along the axis until its deepest pair is about `depth` deep; `None` where it cannot be.
pub fn touching(scene: &Scene, mut x: Pose, depth: f64) -> Option<Pose> {
    for _ in 0..80 {
        let now = top(scene, x);
        if (now - depth).abs() < 2e-4 {
            return Some(x);
        }
        if now > 0.018 || x.p.x < -0.5 {
            return None;
        }
        x.p.x -= if now < depth { (depth - now).max(1e-4) } else { -(now - depth).min(2e-3) };
    }
    None
}

/// A pose of the region in contact, between 0 and 5 mm deep.
pub fn in_contact(scene: &Scene, draws: &mut Draws, r: &Region) -> Pose {
    loop {
        let (x, depth) = (draws.pose(r), 5e-3 * draws.unit());
        if let Some(x) = touching(scene, x, depth)
            && scene.touches(x)
        {
            return x;
        }
    }
}
