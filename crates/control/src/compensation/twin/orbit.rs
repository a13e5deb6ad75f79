//! The mechanism in orbit: between chaser and target as the programme moves them.
//!
//! It stands on the chaser, so everything is seen from there: no weight, and the ring feels the acceleration of
//! the chaser, `−m (a + α × r)`. Without that force a ring of 39 kg on 8 t costs 1.6 to 3 % of the force, in hard
//! cases a third of it.

use docktwin_core::{DVec3, PERIOD_NS, StateHasher, Twist};
use docktwin_model::MOST_LATCHES;
use docktwin_physics::{
    mechanism::LatchRule,
    mounted::{Mounted, Ports},
};

use super::{Believed, STEPS, plate::Plate};

/// Part of the difference between two joints that a tick takes away: gone in 50 ms.
const JOINING: f64 = 0.02;

/// The orbit twin.
#[derive(Clone, Debug)]
pub(in crate::compensation) struct Orbit {
    mounted: Mounted,
    plate: Option<Plate>,
    ports: Ports,
}

/// A step of either twin, s.
#[expect(clippy::cast_precision_loss, reason = "a period is far below 2^53 ns")]
pub(super) fn step_s() -> f64 {
    PERIOD_NS as f64 * 1e-9 / f64::from(STEPS)
}

impl Orbit {
    pub(in crate::compensation) fn new(believed: &Believed<'_>) -> Self {
        let mut rig = believed.rig.clone();
        rig.gravity_m_s2 = DVec3::ZERO;
        rig.offload = None;
        let mounted = Mounted::new(believed.system.clone(), &rig, step_s());
        let mut out = Self { mounted, plate: None, ports: Ports::default() };
        out.reset();
        out
    }

    pub(in crate::compensation) fn reset(&mut self) {
        self.mounted.reset();
        self.mounted.accelerate_rack(&Twist::default());
        (self.plate, self.ports) = (None, Ports::default());
    }

    /// To the end of a tick, at which the bodies stand at `now`; `chaser` is the acceleration of the chaser in it, in
    /// `e1`. The middle of the last step is that instant, so that the ports' wrenches are of the tick itself.
    pub(in crate::compensation) fn advance(
        &mut self,
        now: &Plate,
        chaser: &Twist,
        latches: [LatchRule; MOST_LATCHES],
    ) {
        self.mounted.accelerate_rack(chaser);
        self.mounted.rule_latches(latches);
        let before = self.plate.unwrap_or(*now);
        for i in 1..=STEPS {
            let at = Plate::between(&before, now, f64::from(i) / f64::from(STEPS));
            self.ports = self.mounted.advance(&at.x_bp, &at.twist).1;
        }
        self.plate = Some(*now);
    }

    /// Lets joined rings come to the place in which the rig's are joined, as far as the ground twin knows it. Otherwise
    /// the hardware would bear for good what both captures differ by: 0.4 mm are 125 N.
    pub(super) fn draw_joint_to(&mut self, ground: &Mounted) {
        self.mounted.draw_joint_to(ground, JOINING);
    }

    /// F3, M3 and F4, M4 at the tick.
    pub(in crate::compensation) const fn ports(&self) -> &Ports {
        &self.ports
    }

    pub(in crate::compensation) fn hash_into(&self, h: &mut StateHasher) {
        self.mounted.hash_into(h);
    }
}
