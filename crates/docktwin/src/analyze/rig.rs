//! What the analyses of a rig have in common.

use docktwin_control::{
    leg::{LegTuning, REFERRED_MASS_KG},
    rig::RigSetup,
};
use docktwin_model::{DockingWorkspace, HydraulicPreset, Place, Problem, Rig, load_rig};
use docktwin_physics::{hydraulics::LegParameters, rig::PerturbedRig};
use serde_json::{Value, json};

use crate::{cli::RigArgs, failure::Failure};

/// Degrees of freedom of docking.
pub(super) const DOFS: [&str; 6] = ["X", "Y", "Z", "roll", "pitch", "yaw"];

/// A rig file and how it is to be understood.
pub(super) struct Subject {
    /// As the file says.
    pub(super) file: Rig,
    /// As built: the file, or drawn within its spread.
    pub(super) rig: Rig,
    /// Legs as built.
    pub(super) legs: [LegParameters; 6],
    pub(super) preset: HydraulicPreset,
    pub(super) seed: Option<u64>,
}

impl Subject {
    /// Reads a rig; without a preset, with that of the file.
    pub(super) fn load(args: &RigArgs, json: bool) -> Result<Self, Failure> {
        Ok(Self::load_and_change(args, &[], json)?.0)
    }

    /// Reads a rig, and settings of its leg control; all problems of both at once.
    pub(super) fn load_and_change(
        args: &RigArgs,
        set: &[String],
        json: bool,
    ) -> Result<(Self, Changes), Failure> {
        let (loaded, changes) = match (load_rig(&args.rig), Changes::read(set)) {
            (Ok(loaded), Ok(changes)) => (loaded, changes),
            (loaded, changes) => {
                let mut problems = loaded.err().map(|e| e.problems).unwrap_or_default();
                problems.extend(changes.err().unwrap_or_default());
                return Err(Failure::Input { problems });
            }
        };
        if !json {
            loaded.notes.iter().for_each(|n| eprintln!("note: {n}"));
        }
        let file = loaded.model;
        let preset = args.preset.map_or(file.hydraulics.default_preset, |p| p.preset());
        Ok((Self::of(file, preset, args.seed), changes))
    }

    pub(super) fn of(file: Rig, preset: HydraulicPreset, seed: Option<u64>) -> Self {
        let PerturbedRig { rig, legs } = PerturbedRig::of(&file, preset, seed);
        Self { file, rig, legs, preset, seed }
    }

    /// The same rig with another preset.
    pub(super) fn with(&self, preset: HydraulicPreset) -> Self {
        Self::of(self.file.clone(), preset, self.seed)
    }

    /// The rig closed by its controllers.
    pub(super) fn setup(&self, changes: &Changes) -> RigSetup {
        let mut setup = RigSetup::of_rig(&self.file, self.preset, self.seed);
        changes.apply(&mut setup);
        setup
    }

    /// Oil spring, N/m: the mean of the legs.
    pub(super) fn oil_spring_n_m(&self) -> f64 {
        self.legs.iter().map(|l| l.oil.oil_spring_n_m()).sum::<f64>() / 6.0
    }

    /// Natural frequency of the plate's mass on the oil spring of one leg, Hz.
    pub(super) fn lumped_hz(&self) -> f64 {
        (self.oil_spring_n_m() / self.rig.plate.mass_kg).sqrt() / core::f64::consts::TAU
    }

    /// Name, preset and draw in words.
    pub(super) fn title(&self) -> String {
        let drawn = self.seed.map_or(String::new(), |s| format!(", drawn with seed {s}"));
        format!("{}, {}{drawn}", self.rig.name, self.preset.word())
    }

    /// Name, preset and draw for a script.
    pub(super) fn json(&self) -> Value {
        json!({
            "rig": self.rig.name,
            "preset": self.preset.word(),
            "seed": self.seed,
            "oil_spring_n_m": self.oil_spring_n_m(),
            "plate_mass_kg": self.rig.plate.mass_kg,
            "lumped_hz": self.lumped_hz(),
        })
    }

    /// Columns of a place for a table: m and degrees from the middle.
    pub(super) fn place_csv(&self, place: Place) -> String {
        let d = &self.rig.docking;
        let [x, y, z, roll, pitch, yaw] = place.0;
        format!(
            "{},{},{},{},{},{}",
            x * d.axial_m,
            y * d.lateral_m,
            z * d.lateral_m,
            roll * d.roll_rad.to_degrees(),
            pitch * d.pitch_yaw_rad.to_degrees(),
            yaw * d.pitch_yaw_rad.to_degrees()
        )
    }
}

/// Header of [`Subject::place_csv`].
pub(super) const PLACE_COLUMNS: &str = "x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg";

/// The middle, then the 64 corners.
pub(super) fn middle_and_corners() -> Vec<Place> {
    core::iter::once(Place([0.0; 6])).chain(DockingWorkspace::corners()).collect()
}

/// A value with its place, for a script.
pub(super) fn at_json((value, place): (f64, Place)) -> Value {
    json!({ "value": value, "at": place.0 })
}

/// What a singular pose ends with; the file was checked, so only a drawn rig could come here.
pub(super) fn singular() -> Failure {
    Failure::Usage {
        what: "a pose of the docking workspace is singular".to_owned(),
        remedy: "`docktwin model check FILE` says where; make the workspace smaller or the \
                 platform larger"
            .to_owned(),
    }
}

/// Settings of the leg control other than those of the preset: `--set`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Changes([Option<f64>; 6]);

/// Keys of `--set` with their units, what is allowed, and the check.
type Key = (&'static str, &'static str, &'static str, fn(f64) -> bool);
const KEYS: [Key; 6] = [
    ("position_gain_1_s", "1/s", "above 0, at most 200", |x| x > 0.0 && x <= 200.0),
    ("damping_ratio", "", "0 to 5", |x| (0.0..=5.0).contains(&x)),
    ("high_pass_hz", "Hz", "above 0, at most 100", |x| x > 0.0 && x <= 100.0),
    ("valve_lead_hz", "Hz", "0 for none, or 50 to 1000", |x| {
        x.abs() < f64::MIN_POSITIVE || (50.0..=1000.0).contains(&x)
    }),
    ("rate_hz", "Hz", "1000, 2000, 4000 or 8000", |x| {
        [1000.0, 2000.0, 4000.0, 8000.0].iter().any(|r| (x - r).abs() < 1e-9)
    }),
    ("dead_time_s", "s", "0 to 0.010", |x| (0.0..=0.010).contains(&x)),
];

impl Changes {
    /// From `KEY=VALUE`.
    fn read(set: &[String]) -> Result<Self, Vec<Problem>> {
        let mut out = Self::default();
        let mut problems = Vec::new();
        for text in set {
            let (key, value) = text.split_once('=').unwrap_or((text, ""));
            let (key, value) = (key.trim(), value.trim());
            let problem = |what: &str, unit: &str, allowed: &str, remedy: &str| Problem {
                file: "--set".into(),
                key: key.to_owned(),
                value: value.to_owned(),
                unit: unit.to_owned(),
                what: what.to_owned(),
                allowed: allowed.to_owned(),
                remedy: remedy.to_owned(),
                ..Problem::default()
            };
            let Some(i) = KEYS.iter().position(|k| k.0 == key) else {
                let known = KEYS.map(|k| k.0).join(", ");
                problems.push(problem("is no setting of the leg control", "", &known, "name one"));
                continue;
            };
            let (_, unit, allowed, right) = KEYS[i];
            match value.parse::<f64>() {
                Ok(x) if right(x) => out.0[i] = Some(x),
                Ok(_) => {
                    let remedy = "give a value in the range";
                    problems.push(problem("is out of range", unit, allowed, remedy));
                }
                Err(_) => {
                    let remedy = "write it as --set KEY=NUMBER";
                    problems.push(problem("is not a number", "", allowed, remedy));
                }
            }
        }
        if problems.is_empty() { Ok(out) } else { Err(problems) }
    }

    fn apply(&self, setup: &mut RigSetup) {
        let [kp, zeta, high_pass, lead, rate, dead_time] = self.0;
        let t = &mut setup.tuning;
        t.position_gain_1_s = kp.unwrap_or(t.position_gain_1_s);
        if let Some(zeta) = zeta {
            t.pressure_gain_m_s_n =
                LegTuning::pressure_gain(&setup.believed_legs[0], REFERRED_MASS_KG, zeta);
        }
        t.high_pass_hz = high_pass.unwrap_or(t.high_pass_hz);
        if let Some(hz) = lead {
            t.valve_lead = (hz > 0.0).then_some([hz, 0.8]);
        }
        t.rate_hz = rate.unwrap_or(t.rate_hz);
        setup.dead_time_s = dead_time.unwrap_or(setup.dead_time_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_wrong_settings_are_told_all_at_once() {
        let read = |set: &[&str]| {
            Changes::read(&set.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>())
                .map_err(|all| all.iter().map(|p| p.key.clone()).collect::<Vec<_>>())
        };
        let wrong =
            ["rate_hz=3000", "kp=20", "dead_time_s=0.001", "high_pass_hz", "damping_ratio=NaN"];
        let told = read(&wrong).expect_err("four are wrong");
        assert_eq!(told, ["rate_hz", "kp", "high_pass_hz", "damping_ratio"]);
        assert_eq!(read(&["rate_hz = 2000"]).expect("right").0[4], Some(2000.0));
    }
}
