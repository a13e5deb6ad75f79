//! What a method may be made of.

use docktwin_model::{Rig, SixAxisSensor};
use docktwin_physics::mechanism::System;

use crate::{one_sided::Interface, sensing::SensorScheme};

/// What is believed of a rig and of what stands on it: all that a method may be made of.
#[derive(Clone, Copy, Debug)]
pub struct Believed<'a> {
    /// The rig as its file says.
    pub rig: &'a Rig,
    /// The mechanism between its spacecraft, as their files say.
    pub system: &'a System,
    /// Where the loop has F4, M4 from.
    pub scheme: SensorScheme,
    /// Sensors A and B, with the delay that was calibrated; `None` where they are taken for perfect.
    pub sensors: Option<[SixAxisSensor; 2]>,
}

impl Believed<'_> {
    /// Lag of the sensor that F4, M4 come from, s.
    #[must_use]
    pub fn sensor_lag_s(&self) -> f64 {
        self.sensors.as_ref().map_or(0.0, |[a, b]| {
            Interface::of_sensor(if self.scheme == SensorScheme::Two { b } else { a }).lag_s()
        })
    }
}
