//! Surfaces beside ring and petals: a core with a ball swept over it, placed on a link of its side.

use docktwin_core::{DVec3, Pose};

use crate::mechanism::{DockingMechanism, NormalLaw, SideGeometry};

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

impl SideGeometry {
    /// How far its surfaces beside ring and petals reach along +X of the ring frame, m; `None` without any.
    #[must_use]
    pub fn surfaces_top_m(&self) -> Option<f64> {
        self.surfaces.iter().map(Surface::top_m).reduce(f64::max)
    }
}

impl SideGeometry {
    /// How far its surfaces beside ring and petals reach from the ring's centre, m; 0 without any.
    #[must_use]
    pub fn surfaces_reach_m(&self) -> f64 {
        let far = |s: &Surface| {
            let (centre, radius) = s.ball_around();
            centre.length() + radius
        };
        self.surfaces.iter().map(far).fold(0.0, f64::max)
    }
}

/// Two surfaces that may touch, one of each side; in a mechanism's list the first is the active side's.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePairing {
    /// Of both sides.
    pub surfaces: [Surface; 2],
    /// Both in series, N/mⁿ.
    pub stiffness_n_m: f64,
    /// Geometric mean of both.
    pub friction: f64,
}

impl SurfacePairing {
    fn of(a: &Surface, b: &Surface, exponent: f64) -> Self {
        // In series: the same force F = k δⁿ in both, and their depths add up.
        let gives = |s: &Surface| s.stiffness_n_m.powf(-1.0 / exponent);
        Self {
            stiffness_n_m: (gives(a) + gives(b)).powf(-exponent),
            friction: (a.friction * b.friction).sqrt(),
            surfaces: [a.clone(), b.clone()],
        }
    }
}

impl DockingMechanism {
    /// The ring of a side as a surface: a torus of twice the stiffness of `contact`, so that two rings have that
    /// one, and of its kinetic friction.
    fn ring_surface(&self, side: &SideGeometry) -> Option<Surface> {
        side.has_ring.then(|| Surface {
            name: "ring".to_owned(),
            link: "ring".to_owned(),
            x_link: Pose::IDENTITY,
            x_ring: Pose::IDENTITY,
            core: SurfaceCore::Torus { radius: side.ring.mean_radius_m },
            rounding_m: side.ring.section_radius_m,
            stiffness_n_m: 2.0 * self.contact.stiffness(),
            friction: self.contact.friction_kinetic,
        })
    }

    /// Every pair with one of the listed surfaces in it that may touch, in the order of the files: pair
    /// [`RING_AND_PETAL_PAIRS`] of the record is the first. A ring counts as a torus; two rings and petals are
    /// not among them.
    #[must_use]
    pub fn surface_pairs(&self) -> Vec<SurfacePairing> {
        let exponent = match self.contact.normal {
            NormalLaw::HuntCrossley { exponent, .. } => exponent,
            NormalLaw::KelvinVoigt { .. } => 1.0,
        };
        let lawful = self.candidates().filter(|(a, b)| a.core.may_touch(&b.core));
        lawful.map(|(a, b)| SurfacePairing::of(&a, &b, exponent)).collect()
    }

    /// Pairs with one of the listed surfaces in it.
    fn candidates(&self) -> impl Iterator<Item = (Surface, Surface)> {
        let of = |side: &SideGeometry| {
            let ring = self.ring_surface(side).into_iter().map(|r| (true, r));
            ring.chain(side.surfaces.iter().cloned().map(|s| (false, s))).collect::<Vec<_>>()
        };
        let passive = of(&self.passive);
        of(&self.active).into_iter().flat_map(move |(ring, a)| {
            let partners = passive.clone().into_iter().filter(move |(other, _)| !(ring && *other));
            partners.map(move |(_, b)| (a.clone(), b))
        })
    }

    /// Name of a pair of the list.
    #[must_use]
    pub fn surface_pair_name(pair: &SurfacePairing) -> String {
        let [a, b] = &pair.surfaces;
        format!("active {} · passive {}", a.name, b.name)
    }

    /// What follows from the listed surfaces, a line each.
    pub(crate) fn surface_lines(&self) -> Vec<String> {
        let mut out: Vec<String> = self
            .surface_pairs()
            .iter()
            .map(|p| {
                let words = p.surfaces.each_ref().map(|s| s.core.word());
                format!(
                    "pair {} ({} on {}): stiffness = {:.6} N/m, friction = {:.6}",
                    Self::surface_pair_name(p),
                    words[0],
                    words[1],
                    p.stiffness_n_m,
                    p.friction
                )
            })
            .collect();
        if !self.own_latches.is_empty() {
            let names = |which: &[usize]| {
                which
                    .iter()
                    .map(|i| self.own_latches[*i].name.as_str())
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            let all: Vec<usize> = (0..self.own_latches.len()).collect();
            out.push(match &self.captured_when {
                CapturedWhen::All => {
                    format!("captured when all of these have caught: {}", names(&all))
                }
                CapturedWhen::Any => {
                    format!("captured when any of these has caught: {}", names(&all))
                }
                CapturedWhen::These(which) => {
                    format!("captured when these have caught: {}", names(which))
                }
            });
        }
        out
    }

    /// Names of pairs that come within reach of each other on the way to the docked position and have no law, a
    /// petal against a surface among them.
    pub(crate) fn lawless_pairs(&self) -> Vec<[String; 2]> {
        let mut out = Vec::new();
        let named = |s: &Surface| format!("{} `{}`", s.core.word(), s.name);
        for (a, b) in self.candidates() {
            if !a.core.may_touch(&b.core) && self.in_reach(a.ball_around(), b.ball_around()) {
                out.push([named(&a), named(&b)]);
            }
        }
        let petals = |side: &SideGeometry| {
            side.petals.map(|p| {
                let far = p.tip_radius_m.max(p.base_radius_m);
                (DVec3::X * (0.5 * p.height_m), far.hypot(0.5 * p.height_m) + 0.5 * p.thickness_m)
            })
        };
        if let Some(ball) = petals(&self.active) {
            let others =
                self.passive.surfaces.iter().filter(|s| self.in_reach(ball, s.ball_around()));
            out.extend(others.map(|s| ["petals of the active side".to_owned(), named(s)]));
        }
        if let Some(ball) = petals(&self.passive) {
            let others =
                self.active.surfaces.iter().filter(|s| self.in_reach(s.ball_around(), ball));
            out.extend(others.map(|s| [named(s), "petals of the passive side".to_owned()]));
        }
        out
    }

    /// Whether two balls, each in its own ring frame, can meet while the passive side comes along X to its docked
    /// place, off by no more than the guided radius and 15° about the ring's centre.
    fn in_reach(&self, a: (DVec3, f64), b: (DVec3, f64)) -> bool {
        let planes = self.active.ring.section_radius_m + self.passive.ring.section_radius_m;
        // r4 is turned by 180° about Z.
        let docked = DVec3::new(planes - b.0.x, -b.0.y, b.0.z);
        let sum = a.1 + b.1 + self.outcome.guided_radius_m + 0.27 * b.0.length();
        let apart = docked - a.0;
        apart.y.hypot(apart.z) <= sum && apart.x <= sum
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
