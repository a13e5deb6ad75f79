//! Settings of the leg control other than those of the preset.

use std::collections::BTreeMap;

use docktwin_control::{
    leg::{LegTuning, REFERRED_MASS_KG},
    rig::RigSetup,
};
use serde::{Deserialize, Serialize};

/// A setting of the leg control that an analysis can change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum LegSetting {
    /// Gain of the position loop, 1/s, above 0, at most 200. A larger one is stiffer and nearer to
    /// instability.
    #[serde(rename = "position_gain_1_s")]
    PositionGain,
    /// Damping ratio that the pressure feedback is to give [`REFERRED_MASS_KG`] on one leg, 0 to 5.
    #[serde(rename = "damping_ratio")]
    DampingRatio,
    /// Corner frequency of the high-pass in the pressure feedback, Hz, above 0, at most 100. Below it
    /// a load is not yielded to.
    #[serde(rename = "high_pass_hz")]
    HighPass,
    /// Natural frequency of the lead that makes up for the valve, Hz: 0 for none, or 50 to 1000.
    #[serde(rename = "valve_lead_hz")]
    ValveLead,
    /// Rate of the leg controllers, Hz: 1000, 2000, 4000 or 8000.
    #[serde(rename = "rate_hz")]
    Rate,
    /// From a command to the controllers, s, 0 to 0.010.
    #[serde(rename = "dead_time_s")]
    DeadTime,
}

impl LegSetting {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::PositionGain,
        Self::DampingRatio,
        Self::HighPass,
        Self::ValveLead,
        Self::Rate,
        Self::DeadTime,
    ];

    /// Key, as serialised.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::PositionGain => "position_gain_1_s",
            Self::DampingRatio => "damping_ratio",
            Self::HighPass => "high_pass_hz",
            Self::ValveLead => "valve_lead_hz",
            Self::Rate => "rate_hz",
            Self::DeadTime => "dead_time_s",
        }
    }

    /// The setting with this key.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|s| s.key() == key)
    }

    /// Unit; empty for a ratio.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::PositionGain => "1/s",
            Self::DampingRatio => "",
            Self::HighPass | Self::ValveLead | Self::Rate => "Hz",
            Self::DeadTime => "s",
        }
    }

    /// Range, in words.
    #[must_use]
    pub const fn allowed(self) -> &'static str {
        match self {
            Self::PositionGain => "above 0, at most 200",
            Self::DampingRatio => "0 to 5",
            Self::HighPass => "above 0, at most 100",
            Self::ValveLead => "0 for none, or 50 to 1000",
            Self::Rate => "1000, 2000, 4000 or 8000",
            Self::DeadTime => "0 to 0.010",
        }
    }

    /// Whether a value is in the range.
    fn allows(self, x: f64) -> bool {
        match self {
            Self::PositionGain => x > 0.0 && x <= 200.0,
            Self::DampingRatio => (0.0..=5.0).contains(&x),
            Self::HighPass => x > 0.0 && x <= 100.0,
            Self::ValveLead => x.abs() < f64::MIN_POSITIVE || (50.0..=1000.0).contains(&x),
            Self::Rate => [1000.0, 2000.0, 4000.0, 8000.0].iter().any(|r| (x - r).abs() < 1e-9),
            Self::DeadTime => (0.0..=0.010).contains(&x),
        }
    }
}

/// A setting that was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the leg control takes no {} = {value} {}; give one in the range: {}",
    setting.key(),
    setting.unit(),
    setting.allowed()
)]
pub struct SettingError {
    /// The setting.
    pub setting: LegSetting,
    /// The value that is out of its range.
    pub value: f64,
}

/// Changes to the leg control; what is not named stays as the preset has it. Every value is within
/// its range.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<LegSetting, f64>", into = "BTreeMap<LegSetting, f64>")]
pub struct LegControl(BTreeMap<LegSetting, f64>);

impl TryFrom<BTreeMap<LegSetting, f64>> for LegControl {
    type Error = SettingError;

    fn try_from(settings: BTreeMap<LegSetting, f64>) -> Result<Self, SettingError> {
        let mut out = Self::default();
        settings.into_iter().try_for_each(|(setting, value)| out.set(setting, value))?;
        Ok(out)
    }
}

impl From<LegControl> for BTreeMap<LegSetting, f64> {
    fn from(changes: LegControl) -> Self {
        changes.0
    }
}

impl LegControl {
    /// Changes a setting.
    ///
    /// # Errors
    /// The value is out of its range; nothing is changed.
    pub fn set(&mut self, setting: LegSetting, value: f64) -> Result<(), SettingError> {
        if !setting.allows(value) {
            return Err(SettingError { setting, value });
        }
        self.0.insert(setting, value);
        Ok(())
    }

    /// Whether something is changed that legs with loops of their own do not have.
    pub(crate) fn needs_oil(&self) -> bool {
        self.0.keys().any(|setting| *setting != LegSetting::DeadTime)
    }

    /// The value that a setting is changed to.
    #[must_use]
    pub fn get(&self, setting: LegSetting) -> Option<f64> {
        self.0.get(&setting).copied()
    }

    /// Changes a rig that is ready to run.
    pub(crate) fn apply(&self, setup: &mut RigSetup) {
        for (setting, value) in &self.0 {
            if *setting == LegSetting::DeadTime {
                setup.dead_time_s = *value;
            }
            let Some(oil) = setup.hydraulic_mut() else { continue };
            let t = &mut oil.tuning;
            match setting {
                LegSetting::PositionGain => t.position_gain_1_s = *value,
                LegSetting::DampingRatio => {
                    t.pressure_gain_m_s_n =
                        LegTuning::pressure_gain(&oil.believed_legs[0], REFERRED_MASS_KG, *value);
                }
                LegSetting::HighPass => t.high_pass_hz = *value,
                LegSetting::ValveLead => t.valve_lead = (*value > 0.0).then_some([*value, 0.8]),
                LegSetting::Rate => t.rate_hz = *value,
                LegSetting::DeadTime => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_a_value_out_of_range_never_gets_in() {
        let mut changes = LegControl::default();
        for (setting, wrong, right) in [
            (LegSetting::PositionGain, 0.0, 200.0),
            (LegSetting::DampingRatio, f64::NAN, 0.0),
            (LegSetting::HighPass, 100.5, 0.1),
            (LegSetting::ValveLead, 49.0, 0.0),
            (LegSetting::Rate, 3000.0, 8000.0),
            (LegSetting::DeadTime, -1e-6, 0.010),
        ] {
            let refused = changes.set(setting, wrong).expect_err("out of range");
            assert_eq!(refused.setting, setting);
            assert!(refused.to_string().contains(setting.key()), "{refused}");
            assert_eq!(changes.get(setting), None);
            changes.set(setting, right).expect("in the range");
            assert_eq!(changes.get(setting), Some(right));
            assert_eq!(LegSetting::from_key(setting.key()), Some(setting));
        }
        let text = serde_json::to_string(&changes).expect("JSON");
        assert_eq!(serde_json::from_str::<LegControl>(&text).expect("JSON"), changes);
        let wrong = text.replace("8000", "3000");
        let refused = serde_json::from_str::<LegControl>(&wrong).expect_err("out of range");
        assert!(refused.to_string().contains("rate_hz = 3000"), "{refused}");
        assert!(serde_json::from_str::<LegControl>(r#"{"gain": 1}"#).is_err(), "an unknown key");
    }
}
