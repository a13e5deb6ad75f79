//! What the models of a scenario come to together, as a person would check it before anything runs.

use std::path::PathBuf;

use docktwin_core::{DVec3, Pose};
use docktwin_model::{SAG_REMEDY, Sag, Spacecraft, load_rig_from, sag_refusal, static_sag};
use docktwin_physics::body::MassProperties;
use docktwin_scenario::Scenario;
use serde::{Deserialize, Serialize};

use crate::{error::RunError, hil_run::rig_path};

/// A spacecraft as it flies: the chaser with the active ring at its rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weighed {
    /// `chaser` or `target`.
    pub role: String,
    /// Mass of all, kg.
    pub mass_kg: f64,
    /// Mass of the active ring in it, kg; 0 for the target.
    pub ring_kg: f64,
    /// Mass centre from the port, in axes of the port (`e3` or `e4`), m.
    pub mass_centre_m: [f64; 3],
    /// Radii of gyration about the body axes through the mass centre, m.
    pub gyration_m: [f64; 3],
}

impl Weighed {
    fn new(role: &str, craft: &Spacecraft, ring: Option<(&MassProperties, Pose)>) -> Self {
        let alone = MassProperties::new(craft.mass_kg, craft.inertia_kg_m2);
        let (all, com) = ring.map_or((alone, DVec3::ZERO), |(m, x)| alone.joined(m, x));
        let i = all.inertia();
        let k = |moment: f64| (moment / all.mass()).sqrt();
        Self {
            role: role.to_owned(),
            mass_kg: all.mass(),
            ring_kg: ring.map_or(0.0, |(m, _)| m.mass()),
            mass_centre_m: craft.x_body_port.inverse().transform_point(com).to_array(),
            gyration_m: [k(i.x_axis.x), k(i.y_axis.y), k(i.z_axis.z)],
        }
    }

    /// From the mass centre to the port, m.
    #[must_use]
    pub fn port_distance_m(&self) -> f64 {
        DVec3::from_array(self.mass_centre_m).length()
    }

    /// In words.
    #[must_use]
    pub fn line(&self) -> String {
        let ring = if self.ring_kg > 0.0 {
            format!(" with the ring of {:.3} kg", self.ring_kg)
        } else {
            String::new()
        };
        let (c, k) = (self.mass_centre_m, self.gyration_m);
        let port = if self.role == "chaser" { "e3" } else { "e4" };
        format!(
            "{}: {:.3} kg{ring}, mass centre [{:.4}, {:.4}, {:.4}] m in {port}, {:.3} m from the port, radii of \
             gyration [{:.3}, {:.3}, {:.3}] m about X, Y, Z",
            self.role,
            self.mass_kg,
            c[0],
            c[1],
            c[2],
            self.port_distance_m(),
            k[0],
            k[1],
            k[2]
        )
    }
}

/// Chaser and target as they fly.
#[must_use]
pub fn weighed(scenario: &Scenario) -> [Weighed; 2] {
    let m = &scenario.mechanism;
    let ring = MassProperties::new(m.ring_body.mass_kg, m.ring_body.inertia_kg_m2);
    let rest = DVec3::X * m.ring_rest_offset_m + m.ring_body.com_m;
    let x_ring = scenario.chaser.x_body_port * Pose::from_translation(rest);
    [
        Weighed::new("chaser", &scenario.chaser, Some((&ring, x_ring))),
        Weighed::new("target", &scenario.target, None),
    ]
}

/// The mechanism of a scenario on its rig.
#[derive(Clone, Debug, PartialEq)]
pub struct OnItsRig {
    /// URDF of the rig: the scenario's `loop.rig`, or the default.
    pub rig: PathBuf,
    /// Static sag of every channel that bears weight there.
    pub sags: Vec<Sag>,
    /// Why `hil` refuses it, if it does.
    pub refused: Option<String>,
}

impl OnItsRig {
    /// What to do where it is refused.
    #[must_use]
    pub const fn remedy() -> &'static str {
        SAG_REMEDY
    }
}

/// How the mechanism of a scenario stands on the rig that `hil` would take.
///
/// # Errors
/// The rig is not found, or problems of its files.
pub fn on_its_rig(scenario: &Scenario) -> Result<OnItsRig, RunError> {
    let rig_path = rig_path(None, scenario)?;
    let rig = load_rig_from(&scenario.sources, &rig_path)?.model;
    let mechanism = &scenario.mechanism;
    let sags = static_sag(&rig, mechanism).into_iter().filter(|s| s.load > 1e-6).collect();
    Ok(OnItsRig { sags, refused: sag_refusal(&rig, mechanism), rig: rig_path })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8000 kg with 3.5 m to its port, and the ring of 39.1 kg at 0.28 + 0.032 m before it.
    #[test]
    fn oracle_the_chaser_is_weighed_with_its_ring() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let s = Scenario::from_path(root.join("scenarios/apas_nominal.toml")).expect("shipped");
        let [chaser, target] = weighed(&s);
        let (m, r) = (s.chaser.mass_kg, s.mechanism.ring_body.mass_kg);
        assert!(
            (chaser.mass_kg - m - r).abs() < 1e-9
                && (target.mass_kg - s.target.mass_kg).abs() < 1e-9
        );
        let out = s.chaser.x_body_port.p.x;
        let ahead = s.mechanism.ring_rest_offset_m + s.mechanism.ring_body.com_m.x;
        let centre = (m * -out + r * ahead) / (m + r);
        assert!((chaser.mass_centre_m[0] - centre).abs() < 1e-12, "{chaser:?} {centre}");
        assert!((target.port_distance_m() - s.target.x_body_port.p.length()).abs() < 1e-12);
        // About X the ring adds its own moment alone.
        let i = s.chaser.inertia_kg_m2.x_axis.x + s.mechanism.ring_body.inertia_kg_m2.x_axis.x;
        assert!((chaser.gyration_m[0] - (i / (m + r)).sqrt()).abs() < 1e-12);
        // About Y: both moments and the reduced mass times the square of the distance.
        let i = s.chaser.inertia_kg_m2.y_axis.y
            + s.mechanism.ring_body.inertia_kg_m2.y_axis.y
            + m * r / (m + r) * (out + ahead).powi(2);
        assert!((chaser.gyration_m[1] - (i / (m + r)).sqrt()).abs() < 1e-9);
        assert!(chaser.line().contains("with the ring of 39.100 kg"), "{}", chaser.line());
    }
}
