//! Which faults there are.

use docktwin_rigport::message::LEGS;

/// A sensor with six numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instrument {
    /// Force sensor on the rack.
    SensorA,
    /// Force sensor on the plate.
    SensorB,
    /// Accelerometers on the plate.
    Accelerometer,
}

impl Instrument {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::SensorA, Self::SensorB, Self::Accelerometer];
}

/// What goes wrong. [`FaultKind::size_unit`] says what the size of a fault means for it.
///
/// Legs count from 0. What happens to legs and valves goes by the leg values of the commands: a rig
/// driven by the pose of its plate alone does not show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    // Legs.
    /// A leg stays where it is commanded when the fault begins.
    LegStuck(usize),
    /// A leg runs away from its command at the size's speed.
    LegRunaway(usize),
    /// A leg's length reference is off: it reads longer by the size and, led by that, stands shorter.
    LegReference(usize),
    /// All references are off alike.
    LegReferences,
    /// Legs are wired in a turned order: each has the command and the readings of the next.
    LegsTurned,
    /// All lengths and their rates repeat what they were when the fault began.
    LengthsFrozen,
    /// All length sensors slip by the size; the legs stay where they are.
    LengthsSlip,
    /// Length sensors slip by the size, every third one the other way: soon no pose has such lengths.
    LengthsTorn,
    /// A leg reads the size as its length.
    LengthReads(usize),
    /// A leg reads the size as its speed.
    SpeedReads(usize),
    /// A leg reads the size as its force.
    ForceReads(usize),
    /// A limit switch is closed.
    LimitSwitch,

    // Valves.
    /// A valve lets the size's speed pass beyond what it is commanded: null bias.
    ValveBias(usize),
    /// A valve lets the size's multiple of its feed-forward pass.
    ValveGain(usize),
    /// A valve stays open: the leg moves at the size's speed whatever is commanded.
    ValveOpen(usize),
    /// The supply fails: the rig comes to rest and is not enabled.
    SupplyLost,

    // Sensors.
    /// The readings have the wrong sign.
    Sign(Instrument),
    /// One reading (0 to 2 along, 3 to 5 about the axes) has the wrong sign.
    AxisSign(Instrument, usize),
    /// The readings along Y and Z are interchanged.
    AxesSwapped(Instrument),
    /// The readings are the size's multiple.
    Gain(Instrument),
    /// One reading (0 to 2 along, 3 to 5 about the axes) jumps by the size.
    Offset(Instrument, usize),
    /// Constant reading of the start of the fault plus noise of the size: not detectable as frozen.
    Silent(Instrument),
    /// Noise of the size is added.
    Noisy(Instrument),
    /// The readings repeat what they were when the fault began, to the last bit.
    Frozen(Instrument),
    /// The sensor reports that it is at the end of its range.
    Saturated(Instrument),
    /// The sensor is gone: its capability bit is clear, its readings are 0.
    Absent(Instrument),
    /// One reading is not a number.
    NotFinite(Instrument),
    /// A latch reports the size as its phase.
    LatchReads(usize),
    /// The rings are reported to be joined.
    JoinedReads,

    // The rig as a whole.
    /// The emergency stop is pressed: the rig comes to rest.
    EmergencyStop,
    /// The rig leaves the commands by itself, comes to rest, and says so.
    SafeState,

    // Communication.
    /// Measurements are lost.
    Missing,
    /// Commands are lost; the rig holds the last one.
    CommandLost,
    /// Measurements come later by the size's ticks, at most [`super::MOST_LATE`].
    Late,
    /// Measurements come later and later, by the size's ticks a second, up to [`super::MOST_LATE`].
    LagGrows,
    /// Every measurement comes a second time instead of the next one.
    Repeated,
    /// Measurements name an earlier tick.
    TickBack,
    /// Measurements are of another session.
    OtherSession,
    /// Measurements are of another version of the port.
    OtherVersion,
    /// Measurements arrive cut short.
    Unreadable,
    /// The rig's process is gone.
    Gone,

    // Clocks.
    /// Time stamps are off by the size: stale below 0, from the future above.
    StampOffset,
    /// Time stamps run away by the size, seconds a second.
    StampDrift,
}

impl FaultKind {
    /// Every kind, with every leg and every sensor it can be of.
    #[must_use]
    pub fn every() -> Vec<Self> {
        use FaultKind as K;
        let mut out = vec![
            K::LegReferences,
            K::LegsTurned,
            K::LengthsFrozen,
            K::LengthsSlip,
            K::LengthsTorn,
            K::LimitSwitch,
            K::SupplyLost,
            K::JoinedReads,
            K::EmergencyStop,
            K::SafeState,
            K::Missing,
            K::CommandLost,
            K::Late,
            K::LagGrows,
            K::Repeated,
            K::TickBack,
            K::OtherSession,
            K::OtherVersion,
            K::Unreadable,
            K::Gone,
            K::StampOffset,
            K::StampDrift,
        ];
        let of_a_leg: [fn(usize) -> Self; 9] = [
            K::LegStuck,
            K::LegRunaway,
            K::LegReference,
            K::LengthReads,
            K::SpeedReads,
            K::ForceReads,
            K::ValveBias,
            K::ValveGain,
            K::ValveOpen,
        ];
        out.extend(of_a_leg.iter().flat_map(|kind| (0..LEGS).map(kind)));
        let of_a_sensor: [fn(Instrument) -> Self; 9] = [
            K::Sign,
            K::AxesSwapped,
            K::Gain,
            K::Silent,
            K::Noisy,
            K::Frozen,
            K::Saturated,
            K::Absent,
            K::NotFinite,
        ];
        for sensor in Instrument::ALL {
            out.extend(of_a_sensor.iter().map(|kind| kind(sensor)));
            out.extend((0..6).map(|axis| K::Offset(sensor, axis)));
            out.extend((0..6).map(|axis| K::AxisSign(sensor, axis)));
        }
        out.extend((0..3).map(K::LatchReads));
        out
    }

    /// What the size of a fault means; `None` where it means nothing.
    #[must_use]
    pub const fn size_unit(self) -> Option<&'static str> {
        use FaultKind as K;
        Some(match self {
            K::LegRunaway(_) | K::SpeedReads(_) | K::ValveBias(_) | K::ValveOpen(_) => "m/s",
            K::LegReference(_)
            | K::LegReferences
            | K::LengthsSlip
            | K::LengthsTorn
            | K::LengthReads(_) => "m",
            K::ForceReads(_) => "N",
            K::ValveGain(_) | K::Gain(_) => "1",
            K::Offset(..) | K::Silent(_) | K::Noisy(_) => "N, N·m, m/s² or rad/s²",
            K::LatchReads(_) => "phase",
            K::Late => "ticks",
            K::LagGrows => "ticks/s",
            K::StampOffset => "s",
            K::StampDrift => "s/s",
            K::LegStuck(_)
            | K::LegsTurned
            | K::LengthsFrozen
            | K::LimitSwitch
            | K::SupplyLost
            | K::Sign(_)
            | K::AxisSign(..)
            | K::AxesSwapped(_)
            | K::Frozen(_)
            | K::Saturated(_)
            | K::Absent(_)
            | K::NotFinite(_)
            | K::JoinedReads
            | K::EmergencyStop
            | K::SafeState
            | K::Missing
            | K::CommandLost
            | K::Repeated
            | K::TickBack
            | K::OtherSession
            | K::OtherVersion
            | K::Unreadable
            | K::Gone => return None,
        })
    }

    /// True for a fault of the way between loop and rig, or of clocks: a plant by itself does not have it.
    #[must_use]
    pub const fn is_of_the_link(self) -> bool {
        use FaultKind as K;
        matches!(
            self,
            K::Missing
                | K::CommandLost
                | K::Late
                | K::LagGrows
                | K::Repeated
                | K::TickBack
                | K::OtherSession
                | K::OtherVersion
                | K::Unreadable
                | K::Gone
                | K::StampOffset
                | K::StampDrift
        )
    }
}
