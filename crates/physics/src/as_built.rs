//! A mechanism as built: parameters and places of parts drawn within the spread of its files.
//!
//! Each quantity has a stream of its own: a draw is a function of its number and of that quantity alone, so
//! that a quantity that is added, or a spread of zero, moves no other.

use core::fmt;

use docktwin_core::{DQuat, DVec3, Pose};
use docktwin_model::{Attenuator, AxisChannel, DockingMechanism, NormalLaw, PiecewiseCurve};
use serde::{Deserialize, Serialize};

use crate::hydraulics::Draws;

/// First stream of the quantities drawn here; rigs have those below.
const FIRST_STREAM: u64 = 1024;
/// Streams of one kind of quantity.
const STREAMS: u64 = 64;

/// How well petals, latches and mounts are aligned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Within `spread.position_fine_m`.
    #[default]
    Fine,
    /// Within `spread.position_coarse_m`.
    Coarse,
}

impl Grade {
    /// Words by which recordings and command lines name the grades.
    pub const WORDS: [(&'static str, Self); 2] = [("fine", Self::Fine), ("coarse", Self::Coarse)];

    /// Its word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fine => "fine",
            Self::Coarse => "coarse",
        }
    }
}

/// Which mechanism is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MechanismDraw {
    /// Seed of the draw.
    pub number: u64,
    /// How well its parts are aligned.
    pub grade: Grade,
}

impl fmt::Display for MechanismDraw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", self.number, self.grade.name())
    }
}

/// A quantity that was drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drawn {
    /// What it is: a factor where it has no unit at its end.
    pub name: String,
    /// Factor on the value of the file, or metres or radians off its place.
    pub value: f64,
}

/// A mechanism as built.
#[derive(Clone, Debug, PartialEq)]
pub struct AsBuilt {
    /// With its parameters, and its parts where they stand.
    pub mechanism: DockingMechanism,
    /// Mounting planes `e3` and `e4` as they stand on a rig, seen from where its file has them.
    pub mounts: [Pose; 2],
    /// Everything that was drawn.
    pub drawn: Vec<Drawn>,
}

/// Kinds of quantities, each with streams of its own.
#[derive(Clone, Copy)]
enum Kind {
    Contact,
    Friction,
    PetalRigidity,
    Curves,
    Brake,
    RingMass,
    ActivePetals,
    PassivePetals,
    Latches,
    Mounts,
}

/// Draws, and remembers what.
struct Drawing {
    number: u64,
    drawn: Vec<Drawn>,
}

impl Drawing {
    fn draws(&self, kind: Kind, which: usize) -> Draws {
        Draws::new(self.number, FIRST_STREAM + STREAMS * kind as u64 + which as u64)
    }

    fn note(&mut self, name: String, value: f64) {
        self.drawn.push(Drawn { name, value });
    }

    /// A factor of `1 ± half_width`.
    fn factor(&mut self, kind: Kind, which: usize, half_width: f64, name: String) -> f64 {
        let factor = 1.0 + half_width * self.draws(kind, which).uniform();
        self.note(name, factor);
        factor
    }

    /// A displacement of `± half_width` along each of three axes with these names, m.
    fn place(
        &mut self,
        (kind, which): (Kind, usize),
        half_width_m: f64,
        name: &str,
        axes: [&str; 3],
    ) -> DVec3 {
        let mut draws = self.draws(kind, which);
        let d = [0.0; 3].map(|_: f64| half_width_m * draws.uniform());
        for (axis, value) in axes.into_iter().zip(d) {
            self.note(format!("{name}_{axis}_m"), value);
        }
        DVec3::from_array(d)
    }
}

/// Axes of a part at its azimuth of a ring.
const AT_AZIMUTH: [&str; 3] = ["axial", "radial", "tangential"];

/// Draws a mechanism within the spread of its files; `None` where they have none.
#[must_use]
pub fn draw(m: &DockingMechanism, draw: MechanismDraw) -> Option<AsBuilt> {
    let spread = m.spread?;
    let place_m = match draw.grade {
        Grade::Fine => spread.position_fine_m,
        Grade::Coarse => spread.position_coarse_m,
    };
    let mut d = Drawing { number: draw.number, drawn: Vec::new() };
    let mut out = m.clone();
    let stiffness =
        d.factor(Kind::Contact, 0, spread.contact_stiffness, "contact_stiffness".into());
    match &mut out.contact.normal {
        NormalLaw::HuntCrossley { stiffness: k, .. }
        | NormalLaw::KelvinVoigt { stiffness: k, .. } => {
            *k *= stiffness;
        }
    }
    let friction = d.factor(Kind::Friction, 0, spread.friction, "friction".into());
    out.contact.friction_kinetic *= friction;
    out.contact.friction_static *= friction;
    for surface in out.active.surfaces.iter_mut().chain(&mut out.passive.surfaces) {
        surface.stiffness_n_m *= stiffness;
        surface.friction *= friction;
    }
    let ring = d.factor(Kind::RingMass, 0, spread.ring_mass, "ring_mass".into());
    out.ring_body.mass_kg *= ring;
    out.ring_body.inertia_kg_m2 *= ring;
    for (i, (side, name)) in
        [(&mut out.active, "active"), (&mut out.passive, "passive")].into_iter().enumerate()
    {
        if let Some(p) = &mut side.petals {
            let name = format!("petal_rigidity_{name}");
            p.flexural_rigidity_n_m2 *=
                d.factor(Kind::PetalRigidity, i, spread.petal_rigidity, name);
        }
    }
    for (i, (name, channel)) in channels(&mut out.attenuator).into_iter().enumerate() {
        let factor = d.factor(Kind::Curves, i, spread.attenuator_curves, format!("curves_{name}"));
        scale(&mut channel.loading, factor);
        scale(&mut channel.unloading, factor);
        if let Some(b) = &mut channel.series_brake {
            b.force *= d.factor(Kind::Brake, i, spread.brake, format!("brake_{name}"));
        }
    }
    place_parts(&mut out, &mut d, place_m);
    let mounts = mounts(&mut d, place_m, m.active.ring.mean_radius_m);
    Some(AsBuilt { mechanism: out, mounts, drawn: d.drawn })
}

fn scale(curve: &mut PiecewiseCurve, factor: f64) {
    curve.points.iter_mut().for_each(|p| p[1] *= factor);
}

/// The channels of an attenuator with their names.
fn channels(attenuator: &mut Attenuator) -> Vec<(String, &mut AxisChannel)> {
    match attenuator {
        Attenuator::Rigid => Vec::new(),
        Attenuator::Characteristic(a) => vec![
            ("axial".to_owned(), &mut a.axial),
            ("lateral".to_owned(), &mut a.lateral),
            ("roll".to_owned(), &mut a.roll),
            ("tilt".to_owned(), &mut a.tilt),
        ],
        Attenuator::Differential(a) => {
            a.channels.iter_mut().enumerate().map(|(i, c)| (format!("coordinate_{i}"), c)).collect()
        }
    }
}

fn place_parts(m: &mut DockingMechanism, d: &mut Drawing, half_width_m: f64) {
    for (kind, side, name, offsets) in [
        (Kind::ActivePetals, &m.active, "active", &mut m.offsets.active_petals_m),
        (Kind::PassivePetals, &m.passive, "passive", &mut m.offsets.passive_petals_m),
    ] {
        let count = side.petals.as_ref().map_or(0, |p| p.count as usize);
        *offsets = (0..count)
            .map(|i| d.place((kind, i), half_width_m, &format!("petal_{name}_{i}"), AT_AZIMUTH))
            .collect();
    }
    for (i, latch) in m.own_latches.iter_mut().enumerate() {
        let axes = ["x", "y", "z"];
        latch.latch_r += d.place((Kind::Latches, i), half_width_m, &format!("latch_{i}"), axes);
    }
    if m.latches.is_some() {
        m.offsets.latches_m = core::array::from_fn(|i| {
            d.place((Kind::Latches, i), half_width_m, &format!("latch_{i}"), AT_AZIMUTH)
        });
    }
}

/// Mounting planes: moved, and turned as seats do that are off by as much at the ring's radius.
fn mounts(d: &mut Drawing, half_width_m: f64, radius_m: f64) -> [Pose; 2] {
    let mut out = [Pose::IDENTITY; 2];
    for (i, (mount, name)) in out.iter_mut().zip(["e3", "e4"]).enumerate() {
        let p =
            d.place((Kind::Mounts, 2 * i), half_width_m, &format!("mount_{name}"), ["x", "y", "z"]);
        let mut draws = d.draws(Kind::Mounts, 2 * i + 1);
        let turn = [0.0; 3].map(|_: f64| half_width_m / radius_m * draws.uniform());
        for (axis, value) in ["x", "y", "z"].into_iter().zip(turn) {
            d.note(format!("mount_{name}_about_{axis}_rad"), value);
        }
        *mount = Pose::new(p, DQuat::from_scaled_axis(DVec3::from_array(turn)));
    }
    out
}

#[cfg(test)]
mod tests;
