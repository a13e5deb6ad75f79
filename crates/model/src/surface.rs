//! Surfaces beside ring and petals: a core with a ball swept over it, placed on a link of its side.

use docktwin_core::{DVec3, Pose};

/// Numbers of pairs that ring and petals of both sides take, whether they are there or not.
pub const RING_AND_PETAL_PAIRS: usize = 16;
/// Most pairs of surfaces of a mechanism, those of ring and petals included.
pub const MOST_PAIRS: usize = 64;
/// Most latches of a mechanism.
pub const MOST_LATCHES: usize = 12;

/// What the ball is swept over, in the surface's own frame, m.
#[derive(Clone, Debug, PartialEq)]
pub enum SurfaceCore {
    /// The origin.
    Sphere,
    /// The segment from −`half` to +`half` on X.
    Capsule {
        /// Half of its length.
        half: f64,
    },
    /// The circle about X through the plane x = 0.
    Torus {
        /// Its radius.
        radius: f64,
    },
    /// A box about the origin.
    Box {
        /// Half of its edges.
        half: DVec3,
    },
    /// A cylinder about X, from −`half` to +`half`.
    Cylinder {
        /// Its radius.
        radius: f64,
        /// Half of its length.
        half: f64,
    },
    /// A cone about X, base at −`half`, tip at +`half`.
    Cone {
        /// Radius of the base.
        radius: f64,
        /// Half of its length.
        half: f64,
    },
    /// The convex hull of points.
    Hull {
        /// The points.
        points: Vec<DVec3>,
    },
    /// The wall of a cone, a cup or the like: straight lines between points (x, radius), turned about X.
    Hollow {
        /// The points, from one end to the other.
        profile: Vec<[f64; 2]>,
    },
}

/// What a surface may touch depends on which of these it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Family {
    /// A sphere or capsule: convex, and a partner of the others too.
    Round,
    Convex,
    Torus,
    Hollow,
}

impl SurfaceCore {
    /// Words by which files name the kinds.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Capsule { .. } => "capsule",
            Self::Torus { .. } => "torus",
            Self::Box { .. } => "box",
            Self::Cylinder { .. } => "cylinder",
            Self::Cone { .. } => "cone",
            Self::Hull { .. } => "hull",
            Self::Hollow { .. } => "hollow",
        }
    }

    const fn family(&self) -> Family {
        match self {
            Self::Sphere | Self::Capsule { .. } => Family::Round,
            Self::Torus { .. } => Family::Torus,
            Self::Hollow { .. } => Family::Hollow,
            _ => Family::Convex,
        }
    }

    /// Whether a pair of such surfaces has a law: convex with convex; torus with sphere, capsule and torus; hollow
    /// with sphere, capsule and torus.
    #[must_use]
    pub const fn may_touch(&self, other: &Self) -> bool {
        matches!(
            (self.family(), other.family()),
            (Family::Round | Family::Convex, Family::Round | Family::Convex)
                | (Family::Torus, Family::Torus | Family::Round)
                | (Family::Torus, Family::Hollow)
                | (Family::Round, Family::Torus | Family::Hollow)
                | (Family::Hollow, Family::Round | Family::Torus)
        )
    }

    /// Whether it has flat faces or straight lines along which it can lie on another one.
    #[must_use]
    pub const fn can_lie_flat(&self) -> bool {
        !matches!(self, Self::Sphere | Self::Torus { .. })
    }

    /// A point of the core that is farthest along `dir`, of any length but zero.
    #[must_use]
    pub fn farthest(&self, dir: DVec3) -> DVec3 {
        let across = DVec3::new(0.0, dir.y, dir.z).normalize_or_zero();
        let by_sign = |half: f64| if dir.x < 0.0 { -half } else { half };
        match self {
            Self::Sphere => DVec3::ZERO,
            Self::Capsule { half } => DVec3::X * by_sign(*half),
            Self::Torus { radius } => across * *radius,
            Self::Box { half } => {
                let sign = |d: f64, h: f64| if d < 0.0 { -h } else { h };
                DVec3::new(sign(dir.x, half.x), sign(dir.y, half.y), sign(dir.z, half.z))
            }
            Self::Cylinder { radius, half } => DVec3::X * by_sign(*half) + across * *radius,
            Self::Cone { radius, half } => {
                let tip = DVec3::X * *half;
                let base = DVec3::X * -half + across * *radius;
                if tip.dot(dir) > base.dot(dir) { tip } else { base }
            }
            Self::Hull { points } => most_along(points.iter().copied(), dir),
            Self::Hollow { profile } => {
                most_along(profile.iter().map(|[x, r]| DVec3::X * *x + across * *r), dir)
            }
        }
    }

    /// Centre and radius of a ball that holds the core, m.
    #[must_use]
    pub fn ball_around(&self) -> (DVec3, f64) {
        let from = |centre: DVec3, points: &mut dyn Iterator<Item = DVec3>| {
            (centre, points.map(|p| (p - centre).length()).fold(0.0, f64::max))
        };
        match self {
            Self::Sphere => (DVec3::ZERO, 0.0),
            Self::Capsule { half } => (DVec3::ZERO, *half),
            Self::Torus { radius } => (DVec3::ZERO, *radius),
            Self::Box { half } => (DVec3::ZERO, half.length()),
            Self::Cylinder { radius, half } | Self::Cone { radius, half } => {
                (DVec3::ZERO, radius.hypot(*half))
            }
            Self::Hull { points } => {
                let (lo, hi) =
                    points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| {
                        (lo.min(*p), hi.max(*p))
                    });
                from(0.5 * (lo + hi), &mut points.iter().copied())
            }
            Self::Hollow { profile } => {
                let xs = profile.iter().map(|p| p[0]);
                let (lo, hi) = (
                    xs.clone().fold(f64::INFINITY, f64::min),
                    xs.fold(f64::NEG_INFINITY, f64::max),
                );
                let points = &mut profile.iter().map(|[x, r]| DVec3::new(*x, *r, 0.0));
                from(DVec3::X * (0.5 * (lo + hi)), points)
            }
        }
    }
}

fn most_along(points: impl Iterator<Item = DVec3>, dir: DVec3) -> DVec3 {
    let mut best = (DVec3::ZERO, f64::NEG_INFINITY);
    for p in points {
        let along = p.dot(dir);
        if along > best.1 {
            best = (p, along);
        }
    }
    best.0
}

/// One surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Name, unlike that of any other surface of its side.
    pub name: String,
    /// Link of the URDF on which it stands.
    pub link: String,
    /// Its frame in the frame of its link.
    pub x_link: Pose,
    /// Its frame in the ring frame of its side (`r3`, `r4`).
    pub x_ring: Pose,
    /// What the ball is swept over.
    pub core: SurfaceCore,
    /// Radius of that ball, m.
    pub rounding_m: f64,
    /// Its own stiffness, N/mⁿ: in series with that of its partner.
    pub stiffness_n_m: f64,
    /// Its own friction coefficient; a pair has the geometric mean of both.
    pub friction: f64,
}

impl Surface {
    /// How far it reaches along +X of its ring frame, m.
    #[must_use]
    pub fn top_m(&self) -> f64 {
        let dir = self.x_ring.q.conjugate() * DVec3::X;
        self.x_ring.transform_point(self.core.farthest(dir)).x + self.rounding_m
    }

    /// Ball that holds it, in its ring frame: centre and radius, m.
    #[must_use]
    pub fn ball_around(&self) -> (DVec3, f64) {
        let (centre, radius) = self.core.ball_around();
        (self.x_ring.transform_point(centre), radius + self.rounding_m)
    }
}

/// One latch on the active side and its striker on the passive one.
#[derive(Clone, Debug, PartialEq)]
pub struct Latch {
    /// Name, unlike that of any other latch.
    pub name: String,
    /// The latch in `r3`, m.
    pub latch_r: DVec3,
    /// Its striker in `r4`, m.
    pub striker_p: DVec3,
    /// It approaches (is logged) below this gap along X of `r3`, in a zone four times as wide, m.
    pub approach_gap_m: f64,
    /// It is struck below this gap, m.
    pub strike_gap_m: f64,
    /// It catches at or below this gap, m.
    pub catch_gap_m: f64,
    /// Radius of the zone in which it is struck and catches, across X of `r3`, m.
    pub lateral_zone_m: f64,
    /// Largest angle between X of `r3` and X of `e4` at which it is struck and catches, rad.
    pub angle_zone_rad: f64,
    /// Tension stiffness of the caught latch beyond the catch gap before capture, N/m.
    pub hold_stiffness_n_m: f64,
    /// Stiffness in every direction of the striker in the latch from capture on, N/m.
    pub joined_stiffness_n_m: f64,
    /// Damping of the same, N·s/m.
    pub joined_damping_n_s_m: f64,
}

/// Which latches must have caught for a capture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CapturedWhen {
    /// All.
    #[default]
    All,
    /// Any one.
    Any,
    /// These, by their places in the list.
    These(Vec<usize>),
}

impl CapturedWhen {
    /// Whether it is a capture, `caught` being told of every latch.
    #[must_use]
    pub fn holds(&self, latches: usize, caught: impl Fn(usize) -> bool) -> bool {
        match self {
            Self::All => latches > 0 && (0..latches).all(caught),
            Self::Any => (0..latches).any(caught),
            Self::These(which) => which.iter().all(|i| caught(*i)),
        }
    }
}
