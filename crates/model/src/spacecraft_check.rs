//! Whether a spacecraft's numbers can be those of a body of its size.
//!
//! The hull is what is drawn, so solar panels may reach beyond it: what a body with panels could still
//! be is flagged, what no body can be is refused. Most such numbers come from CAD in other units.

use core::f64::consts::PI;

use docktwin_core::DVec3;

use crate::SpacecraftHull;
use crate::problem::{Findings, Note, Problem};
use crate::urdf::{self, MassProperties};

/// Density of osmium, the densest of all materials, kg/m³ (CRC Handbook of Chemistry and Physics).
const DENSEST_KG_M3: f64 = 22_590.0;
/// Below this mean density of the hull a mass is doubtful, kg/m³: an empty pressure vessel has some 10.
const THIN_KG_M3: f64 = 5.0;
/// A radius of gyration over so many distances from the mass centre to the hull's farthest point is no
/// longer that of panels.
const MOST_GYRATION: f64 = 10.0;
/// A radius of gyration below this share of a homogeneous hull's is doubtful.
const LEAST_GYRATION: f64 = 0.3;
/// What to do about inertias below those of any body.
const SMALL_REMEDY: &str = "give inertias in kg·m² about the mass centre, and masses in kg";
/// A docking axis that points so far past the mass centre, deg, is doubtful: ports look outward.
const MOST_ASIDE_DEG: f64 = 45.0;

/// What is known of a spacecraft before it is put together; places from the origin of the root link.
pub(crate) struct Body<'a> {
    pub(crate) mass: &'a MassProperties,
    pub(crate) hull: SpacecraftHull,
    pub(crate) port_m: DVec3,
    /// +X of the port, which is the docking axis.
    pub(crate) port_axis: DVec3,
}

impl Body<'_> {
    fn volume_m3(&self) -> f64 {
        PI * self.hull.radius_m.powi(2) * self.hull.length_m
    }

    /// Mass over the volume of the hull, kg/m³.
    fn density_kg_m3(&self) -> f64 {
        self.mass.mass_kg / self.volume_m3()
    }

    /// About the axes of the body frame, m.
    fn gyration_m(&self) -> DVec3 {
        let i = self.mass.inertia_kg_m2;
        let k = |moment: f64| (moment / self.mass.mass_kg).max(0.0).sqrt();
        DVec3::new(k(i.x_axis.x), k(i.y_axis.y), k(i.z_axis.z))
    }

    /// Of the hull filled evenly, m.
    fn homogeneous_m(&self) -> DVec3 {
        let (r, l) = (self.hull.radius_m, self.hull.length_m);
        let across = ((3.0 * r * r + l * l) / 12.0).sqrt();
        DVec3::new(r / 2.0_f64.sqrt(), across, across)
    }

    /// The farthest that a point of the hull lies from each axis through the mass centre, m.
    fn farthest_m(&self) -> DVec3 {
        let c = self.mass.com_m;
        let along = c.x.abs() + 0.5 * self.hull.length_m;
        let from_axis = c.y.hypot(c.z) + self.hull.radius_m;
        let side = |offset: f64| along.hypot(offset.abs() + self.hull.radius_m);
        DVec3::new(from_axis, side(c.z), side(c.y))
    }

    /// From a point to the hull, m; 0 inside of it.
    fn outside_m(&self, p: DVec3) -> f64 {
        let along = (p.x.abs() - 0.5 * self.hull.length_m).max(0.0);
        let aside = (p.y.hypot(p.z) - self.hull.radius_m).max(0.0);
        along.hypot(aside)
    }

    fn size_m(&self) -> f64 {
        self.hull.length_m.hypot(2.0 * self.hull.radius_m)
    }

    /// What was read, as a person would check it.
    pub(crate) fn lines(&self) -> Vec<String> {
        let (c, k, p) = (self.mass.com_m, self.gyration_m(), self.port_m - self.mass.com_m);
        let on_hull = match self.outside_m(self.port_m) {
            d if d > 0.0 => format!("{d:.3} m outside of the hull"),
            _ => "on or in the hull".to_owned(),
        };
        vec![
            format!(
                "mass = {:.3} kg, {:.1} kg/m³ in the hull; a chaser's docking ring comes on top",
                self.mass.mass_kg,
                self.density_kg_m3()
            ),
            format!("mass centre = [{:.4}, {:.4}, {:.4}] m from the root link", c.x, c.y, c.z),
            format!(
                "radii of gyration = [{:.3}, {:.3}, {:.3}] m about X, Y, Z; the hull filled evenly has \
                 [{:.3}, {:.3}, {:.3}] m",
                k.x,
                k.y,
                k.z,
                self.homogeneous_m().x,
                self.homogeneous_m().y,
                self.homogeneous_m().z
            ),
            format!("port = {:.3} m from the mass centre, {on_hull}", p.length()),
        ]
    }

    /// Refuses and flags.
    pub(crate) fn check(&self, urdf: &std::path::Path, line: Option<usize>, out: &mut Findings) {
        let before = out.problems.len();
        let mut refuse = |key: &str, what: String, remedy: &str| {
            out.problems.push(Problem {
                file: urdf.into(),
                line,
                key: key.into(),
                what,
                remedy: remedy.into(),
                ..Problem::default()
            });
        };
        self.refuse_density(&mut refuse);
        self.refuse_inertia(&mut refuse);
        if out.problems.len() > before {
            // What follows from numbers in other units means nothing.
            return;
        }
        for what in self.doubts() {
            out.flags.push(Note { file: urdf.into(), line, what, flagged: true });
        }
    }

    fn refuse_density(&self, refuse: &mut dyn FnMut(&str, String, &str)) {
        let density = self.density_kg_m3();
        if density > DENSEST_KG_M3 {
            refuse(
                "mass",
                format!(
                    "{:.4e} kg in a hull of {:.4} m³ are {density:.3e} kg/m³; the densest material has \
                     {DENSEST_KG_M3:.0}",
                    self.mass.mass_kg,
                    self.volume_m3()
                ),
                "give masses in kg (CAD often writes g), and the hull its size in m",
            );
        }
    }

    fn refuse_inertia(&self, refuse: &mut dyn FnMut(&str, String, &str)) {
        let (k, far) = (self.gyration_m(), self.farthest_m());
        let axes = [("X", k.x, far.x), ("Y", k.y, far.y), ("Z", k.z, far.z)];
        if let Some((axis, k, far)) = axes.into_iter().find(|(_, k, f)| *k > MOST_GYRATION * f) {
            refuse(
                "inertia",
                format!(
                    "its radius of gyration about {axis} is {k:.1} m, and no point of the hull is more \
                     than {far:.2} m from that axis"
                ),
                "give inertias in kg·m² about the mass centre (CAD often writes kg·mm² or g·mm²), and the \
                 hull its size in m",
            );
            return;
        }
        // Of all bodies of a mass, the densest sphere has the least polar moment: 3/5 m r².
        let m = self.mass.mass_kg;
        let sphere_m = (3.0 * m / (4.0 * PI * DENSEST_KG_M3)).cbrt();
        let polar = 0.5 * (k.x * k.x + k.y * k.y + k.z * k.z);
        if polar < 0.6 * sphere_m * sphere_m {
            refuse(
                "inertia",
                format!(
                    "its radii of gyration are [{:.2e}, {:.2e}, {:.2e}] m: even a sphere of the densest \
                     material with this mass has {:.2e} m",
                    k.x,
                    k.y,
                    k.z,
                    (0.4_f64).sqrt() * sphere_m
                ),
                SMALL_REMEDY,
            );
            return;
        }
        // Of all bodies no longer than this, the solid rod of the densest material has the least moment about
        // an axis: k² = m / (2π ρ L).
        let long_m = MOST_GYRATION * self.size_m();
        let rod_m = (m / (2.0 * PI * DENSEST_KG_M3 * long_m)).sqrt();
        let least_m = (urdf::principal_moments(self.mass.inertia_kg_m2)[0] / m).max(0.0).sqrt();
        if least_m < rod_m {
            refuse(
                "inertia",
                format!(
                    "its least radius of gyration is {least_m:.2e} m: a rod of the densest material with this \
                     mass, {long_m:.0} m long, has {rod_m:.2e} m"
                ),
                SMALL_REMEDY,
            );
        }
    }

    fn doubts(&self) -> Vec<String> {
        let mut out = Vec::new();
        let (k, far, even) = (self.gyration_m(), self.farthest_m(), self.homogeneous_m());
        for (axis, k, far, even) in
            [("X", k.x, far.x, even.x), ("Y", k.y, far.y, even.y), ("Z", k.z, far.z, even.z)]
        {
            if k > far {
                out.push(format!(
                    "radius of gyration about {axis} {k:.2} m: more than if all mass were where the \
                     hull is farthest from that axis, {far:.2} m; right only with large panels, else \
                     look at the unit of the inertia"
                ));
            } else if k < LEAST_GYRATION * even {
                out.push(format!(
                    "radius of gyration about {axis} {k:.3} m: a body that fills the hull evenly has \
                     {even:.3} m; look at the units of mass and inertia"
                ));
            }
        }
        let density = self.density_kg_m3();
        if density < THIN_KG_M3 {
            out.push(format!(
                "mass {:.4} kg: {density:.2} kg/m³ in the hull, less than an empty tank; look at its \
                 unit (t instead of kg?)",
                self.mass.mass_kg
            ));
        }
        for (what, at) in [("mass centre", self.mass.com_m), ("port", self.port_m)] {
            let away = self.outside_m(at);
            let millimetres =
                if away > 100.0 * self.size_m() { "; looks like millimetres" } else { "" };
            if away > 0.5 * self.size_m() {
                out.push(format!(
                    "{what} at [{:.3}, {:.3}, {:.3}] m: {away:.1} m from a hull of {:.1} m by {:.1} m\
                     {millimetres}",
                    at.x,
                    at.y,
                    at.z,
                    self.hull.length_m,
                    2.0 * self.hull.radius_m
                ));
            }
        }
        let out_of_port = (self.port_m - self.mass.com_m).normalize_or_zero();
        let aside_deg = self.port_axis.dot(out_of_port).abs().min(1.0).acos().to_degrees();
        if out_of_port != DVec3::ZERO && aside_deg > MOST_ASIDE_DEG {
            out.push(format!(
                "the port's +X lies {aside_deg:.0} deg off the line from the mass centre to the port; rpy is in \
                 radians"
            ));
        }
        out
    }
}
