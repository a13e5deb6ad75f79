//! What a fault does to a command on its way to the rig, and to what the rig measures.

use docktwin_physics::sensor::Noise;
use docktwin_rigport::message::{Capabilities, LEGS, RigCommand, RigMeasurement, RigMode, Status};

use super::{Fault, FaultKind as K, Instrument};

/// What the rig gets of a command. `first` is the command with which the fault began, `since_s` ago.
pub(super) fn on_command(fault: &Fault, c: &mut RigCommand, first: &RigCommand, since_s: f64) {
    let size = fault.size;
    match fault.what {
        K::LegStuck(i) if i < LEGS => {
            c.leg_length_m[i] = first.leg_length_m[i];
            (c.leg_speed_m_s[i], c.leg_flow_speed_m_s[i]) = (0.0, 0.0);
        }
        K::LegRunaway(i) if i < LEGS => {
            c.leg_length_m[i] += size * since_s;
            c.leg_speed_m_s[i] += size;
            c.leg_flow_speed_m_s[i] += size;
        }
        K::ValveOpen(i) if i < LEGS => {
            c.leg_length_m[i] = first.leg_length_m[i] + size * since_s;
            (c.leg_speed_m_s[i], c.leg_flow_speed_m_s[i]) = (size, size);
        }
        K::ValveBias(i) if i < LEGS => c.leg_flow_speed_m_s[i] += size,
        K::ValveGain(i) if i < LEGS => c.leg_flow_speed_m_s[i] *= size,
        // What reads too long is driven in until it reads as commanded.
        K::LegReference(i) if i < LEGS => c.leg_length_m[i] -= size,
        K::LegReferences => c.leg_length_m.iter_mut().for_each(|l| *l -= size),
        K::LegsTurned => {
            for values in [
                &mut c.leg_length_m,
                &mut c.leg_speed_m_s,
                &mut c.leg_flow_speed_m_s,
                &mut c.leg_force_n,
            ] {
                values.rotate_left(1);
            }
        }
        K::SupplyLost | K::EmergencyStop | K::SafeState if c.mode != RigMode::Idle as u32 => {
            c.mode = RigMode::Stop as u32;
        }
        _ => {}
    }
}

/// What becomes of a measurement. `first` is the one with which the fault began.
pub(super) fn on_measurement(
    fault: &Fault,
    m: &mut RigMeasurement,
    first: &RigMeasurement,
    noise: &mut Noise,
) {
    let size = fault.size;
    match fault.what {
        K::LegReference(i) if i < LEGS => m.leg_length_m[i] += size,
        K::LegReferences | K::LengthsSlip => m.leg_length_m.iter_mut().for_each(|l| *l += size),
        K::LegsTurned => {
            for values in
                [&mut m.leg_length_m, &mut m.leg_speed_m_s, &mut m.leg_force_n, &mut m.valve_spool]
            {
                values.rotate_right(1);
            }
        }
        K::LengthsFrozen => {
            (m.leg_length_m, m.leg_speed_m_s) = (first.leg_length_m, first.leg_speed_m_s);
        }
        K::LengthsTorn => {
            for (i, l) in m.leg_length_m.iter_mut().enumerate() {
                *l += if i % 3 == 2 { size } else { -size };
            }
        }
        K::LengthReads(i) if i < LEGS => m.leg_length_m[i] = size,
        K::SpeedReads(i) if i < LEGS => m.leg_speed_m_s[i] = size,
        K::ForceReads(i) if i < LEGS => m.leg_force_n[i] = size,
        K::LimitSwitch => m.status |= Status::LIMIT_SWITCH,
        K::SupplyLost => m.status.remove(Status::ENABLED),
        K::EmergencyStop => m.status |= Status::EMERGENCY_STOP,
        K::SafeState => m.status |= Status::SAFE_STATE,
        K::LatchReads(i) => {
            m.capabilities |= Capabilities::LATCHES;
            m.latch_count = m.latch_count.max(i as u32 + 1);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 3")]
            if let Some(phase) = m.latch_phase.get_mut(i) {
                *phase = size as u32;
            }
        }
        K::JoinedReads => {
            m.capabilities |= Capabilities::JOINED;
            m.status |= Status::JOINED;
        }
        what => on_instrument(what, size, m, first, noise),
    }
}

/// What happens to one of the sensors with six numbers.
fn on_instrument(
    what: K,
    size: f64,
    m: &mut RigMeasurement,
    first: &RigMeasurement,
    noise: &mut Noise,
) {
    match what {
        K::Sign(s) => s.readings(m).iter_mut().for_each(|x| *x = -*x),
        K::AxisSign(s, axis) => {
            if let Some(x) = s.readings(m).get_mut(axis) {
                *x = -*x;
            }
        }
        K::AxesSwapped(s) => s.readings(m).swap(1, 2),
        K::Gain(s) => s.readings(m).iter_mut().for_each(|x| *x *= size),
        K::Offset(s, axis) => {
            if let Some(x) = s.readings(m).get_mut(axis) {
                *x += size;
            }
        }
        K::Silent(s) => {
            *s.readings(m) = s.read(first);
            s.readings(m).iter_mut().for_each(|x| *x += size * noise.normal());
        }
        K::Noisy(s) => s.readings(m).iter_mut().for_each(|x| *x += size * noise.normal()),
        K::Frozen(s) => *s.readings(m) = s.read(first),
        K::Saturated(s) => m.status |= s.saturated(),
        K::Absent(s) => {
            *s.readings(m) = [0.0; 6];
            m.capabilities.remove(s.capability());
        }
        K::NotFinite(s) => s.readings(m)[0] = f64::NAN,
        _ => {}
    }
}

impl Instrument {
    const fn readings(self, m: &mut RigMeasurement) -> &mut [f64; 6] {
        match self {
            Self::SensorA => &mut m.sensor_a,
            Self::SensorB => &mut m.sensor_b,
            Self::Accelerometer => &mut m.plate_acceleration,
        }
    }

    const fn read(self, m: &RigMeasurement) -> [f64; 6] {
        match self {
            Self::SensorA => m.sensor_a,
            Self::SensorB => m.sensor_b,
            Self::Accelerometer => m.plate_acceleration,
        }
    }

    const fn saturated(self) -> Status {
        match self {
            Self::SensorA => Status::SENSOR_A_SATURATED,
            Self::SensorB => Status::SENSOR_B_SATURATED,
            Self::Accelerometer => Status::ACCELEROMETER_SATURATED,
        }
    }

    const fn capability(self) -> Capabilities {
        match self {
            Self::SensorA => Capabilities::SENSOR_A,
            Self::SensorB => Capabilities::SENSOR_B,
            Self::Accelerometer => Capabilities::ACCELEROMETER,
        }
    }
}
