//! Which of the listed surfaces may touch, with the law of each pair, and how far they reach.

use docktwin_core::{DVec3, Pose};

use crate::{
    mechanism::{DockingMechanism, SideGeometry},
    surface::{CapturedWhen, Surface, SurfaceCore},
};

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
    /// The ring of a side as a surface: a torus of 2ⁿ times the stiffness of `contact`, so that two rings in series
    /// have that one, and of its kinetic friction.
    fn ring_surface(&self, side: &SideGeometry) -> Option<Surface> {
        side.has_ring.then(|| Surface {
            name: "ring".to_owned(),
            link: "ring".to_owned(),
            x_link: Pose::IDENTITY,
            x_ring: Pose::IDENTITY,
            core: SurfaceCore::Torus { radius: side.ring.mean_radius_m },
            rounding_m: side.ring.section_radius_m,
            stiffness_n_m: self.contact.stiffness() * 2.0_f64.powf(self.contact.exponent()),
            friction: self.contact.friction_kinetic,
        })
    }

    /// Every pair with one of the listed surfaces in it that may touch, in the order of the files: pair
    /// [`RING_AND_PETAL_PAIRS`](crate::surface::RING_AND_PETAL_PAIRS) of the record is the first. A ring
    /// counts as a torus; two rings and petals are not among them.
    #[must_use]
    pub fn surface_pairs(&self) -> Vec<SurfacePairing> {
        let exponent = self.contact.exponent();
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
