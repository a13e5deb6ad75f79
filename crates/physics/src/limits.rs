//! Limits of a mechanism, and the loads that are held against them.

use docktwin_core::Wrench;
use docktwin_model::DockingMechanism;

/// What the limits of a mechanism are about, of one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loads {
    /// Wrench on the target about the passive ring's centre, in `e4`: N and N·m.
    pub interface: Wrench,
    /// Deepest contact, m.
    pub depth_m: f64,
    /// Attenuator beyond its travel, m.
    pub overtravel_m: f64,
}

/// What a limit is called, its value and what was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitPassed {
    /// Name of the limit in the mechanism file.
    pub name: &'static str,
    /// The limit.
    pub limit: f64,
    /// Reached.
    pub reached: f64,
    /// When, s.
    pub time_s: f64,
}

impl LimitPassed {
    /// The first of a mechanism's limits that these loads pass. A load that is not a number passes it.
    #[must_use]
    pub fn first(m: &DockingMechanism, loads: &Loads, time_s: f64) -> Option<Self> {
        let l = &m.limits;
        let (f, mo) = (loads.interface.f, loads.interface.m);
        // X4 points away from the chaser: pushed along +X4 is compression.
        let checks = [
            ("compression_n", l.compression_n, f.x),
            ("tension_n", l.tension_n, -f.x),
            ("shear_n", l.shear_n, f.y.hypot(f.z)),
            ("torsion_nm", l.torsion_nm, mo.x.abs()),
            ("bending_nm", l.bending_nm, mo.y.hypot(mo.z)),
            ("depth_m", l.depth_m, loads.depth_m),
            ("overtravel_m", l.overtravel_m, loads.overtravel_m),
        ];
        checks
            .into_iter()
            .find(|(_, limit, reached)| reached > limit || reached.is_nan())
            .map(|(name, limit, reached)| Self { name, limit, reached, time_s })
    }
}
