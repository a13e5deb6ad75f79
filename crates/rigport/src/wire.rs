//! Both structures of the port as bytes, for transports that carry nothing else: the layout of
//! `docs/rig-protocol.md`, little-endian whatever the machine.

use crate::{
    guard::GuardLimits,
    message::{Capabilities, Flags, Refusal, RigCommand, RigMeasurement, Status},
};

/// A field on the wire.
trait Field {
    /// Writes to the front of `out` and leaves the rest.
    fn put(&self, out: &mut &mut [u8]);
    /// Reads from the front of `from` and leaves the rest; `from` is long enough.
    fn take(&mut self, from: &mut &[u8]);
}

macro_rules! number {
    ($($type:ty),+) => { $(
        impl Field for $type {
            fn put(&self, out: &mut &mut [u8]) {
                let (here, rest) = core::mem::take(out).split_at_mut(size_of::<Self>());
                here.copy_from_slice(&self.to_le_bytes());
                *out = rest;
            }

            fn take(&mut self, from: &mut &[u8]) {
                let (here, rest) = from.split_at(size_of::<Self>());
                let mut bytes = [0; size_of::<Self>()];
                bytes.copy_from_slice(here);
                *self = Self::from_le_bytes(bytes);
                *from = rest;
            }
        }
    )+ };
}

number!(u32, u64, f64);

macro_rules! bits {
    ($($type:ty),+) => { $(
        impl Field for $type {
            fn put(&self, out: &mut &mut [u8]) {
                self.bits().put(out);
            }

            fn take(&mut self, from: &mut &[u8]) {
                let mut bits = 0;
                bits.take(from);
                *self = Self::from_bits_retain(bits);
            }
        }
    )+ };
}

bits!(Capabilities, Flags, GuardLimits, Status);

impl<T: Field, const N: usize> Field for [T; N] {
    fn put(&self, out: &mut &mut [u8]) {
        self.iter().for_each(|x| x.put(out));
    }

    fn take(&mut self, from: &mut &[u8]) {
        self.iter_mut().for_each(|x| x.take(from));
    }
}

macro_rules! wire {
    ($type:ident: $($field:ident),+ $(,)?) => {
        impl $type {
            /// Length on the wire, bytes.
            pub const WIRE_BYTES: usize = size_of::<Self>();

            /// As bytes.
            #[must_use]
            pub fn to_bytes(&self) -> [u8; Self::WIRE_BYTES] {
                let mut bytes = [0; Self::WIRE_BYTES];
                let mut out = &mut bytes[..];
                // Without `..`: a new field does not compile until it stands here.
                let Self { $($field),+ } = self;
                $($field.put(&mut out);)+
                bytes
            }

            /// From bytes; what they say is not validated.
            ///
            /// # Errors
            /// [`Refusal::Size`].
            pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
                if bytes.len() != Self::WIRE_BYTES {
                    return Err(Refusal::Size);
                }
                let mut from = bytes;
                let mut out = Self::zero();
                $(out.$field.take(&mut from);)+
                Ok(out)
            }
        }
    };
}

wire!(RigCommand: protocol_version, mode, flags, leg_count, session, tick, loop_time_ns, wakeup_ns,
    period_ns, leg_length_m, leg_speed_m_s, leg_flow_speed_m_s, leg_force_n, flow_ahead_s,
    force_ahead_s, plate_position_m, plate_attitude, plate_velocity_m_s, plate_rate_rad_s,
    plate_acceleration, plate_wrench, mechanism_mode, guard_limits, mechanism, guard_reference_a,
    guard_reference_b, guard_force_n, guard_moment_nm, guard_leg_speed_m_s, guard_speed_m_s,
    guard_rate_rad_s, guard_point_m, guard_box_middle_m, guard_box_attitude, guard_box_half_m,
    guard_box_turn_rad, reserved);

wire!(RigMeasurement: protocol_version, status, refusal, capabilities, session, tick, stamp_ns,
    state_digest, drive, leg_count, latch_count, guard_tripped, leg_length_m, leg_speed_m_s,
    leg_force_n, valve_spool, sensor_a, sensor_b, plate_acceleration, plate_position_m,
    plate_attitude, plate_velocity_m_s, plate_rate_rad_s, latch_phase, ring_displacement_m,
    ring_rotation_rad, temperature_c, truth_position_m, truth_attitude, truth_twist, truth_port3,
    truth_port4, reserved);

#[cfg(test)]
mod tests {
    use core::mem::offset_of;

    use super::*;

    /// Bytes that are all different, near each other.
    fn pattern<const N: usize>() -> [u8; N] {
        core::array::from_fn(|i| u8::try_from(i * 7 % 251).expect("below 251"))
    }

    #[test]
    fn invariant_nothing_is_lost_on_the_wire() {
        let bytes = pattern::<{ RigCommand::WIRE_BYTES }>();
        assert_eq!(RigCommand::from_bytes(&bytes).expect("its size").to_bytes(), bytes);
        let bytes = pattern::<{ RigMeasurement::WIRE_BYTES }>();
        assert_eq!(RigMeasurement::from_bytes(&bytes).expect("its size").to_bytes(), bytes);
    }

    #[test]
    fn oracle_a_field_stands_where_it_stands_in_memory() {
        let mut c = RigCommand::zero();
        (c.tick, c.plate_rate_rad_s[1]) = (0x0102_0304_0506_0708, 1.5);
        let bytes = c.to_bytes();
        assert_eq!(bytes[offset_of!(RigCommand, tick)..][..8], [8, 7, 6, 5, 4, 3, 2, 1]);
        let at = offset_of!(RigCommand, plate_rate_rad_s) + 8;
        assert_eq!(bytes[at..][..8], 1.5_f64.to_le_bytes());
        let mut m = RigMeasurement::zero();
        (m.refusal, m.truth_port4[5]) = (3, -2.5);
        let bytes = m.to_bytes();
        assert_eq!(bytes[offset_of!(RigMeasurement, refusal)..][..4], [3, 0, 0, 0]);
        let at = offset_of!(RigMeasurement, truth_port4) + 40;
        assert_eq!(bytes[at..][..8], (-2.5_f64).to_le_bytes());
    }

    #[test]
    fn invariant_another_length_is_refused() {
        let bytes = RigCommand::zero().to_bytes();
        for wrong in [&bytes[..bytes.len() - 1], &[0; RigCommand::WIRE_BYTES + 1][..], &[]] {
            assert_eq!(RigCommand::from_bytes(wrong), Err(Refusal::Size));
        }
    }
}
