//! The table itself.

use docktwin_hil::scheduler::Phase;
use docktwin_physics::mechanism::LatchPhase;
use docktwin_record::ColumnKind;
use docktwin_rigport::message::{Capabilities, Status};

use super::{Group, Signal, Unit};

const XYZ: &[&str] = &["x", "y", "z"];
const WXYZ: &[&str] = &["w", "x", "y", "z"];

const NONE: Unit = Unit { suffix: "", written: "–" };
const M: Unit = Unit { suffix: "m", written: "m" };
const M_S: Unit = Unit { suffix: "m_s", written: "m/s" };
const M_S2: Unit = Unit { suffix: "m_s2", written: "m/s²" };
const RAD: Unit = Unit { suffix: "rad", written: "rad" };
const RAD_S: Unit = Unit { suffix: "rad_s", written: "rad/s" };
const RAD_S2: Unit = Unit { suffix: "rad_s2", written: "rad/s²" };
const N: Unit = Unit { suffix: "n", written: "N" };
const NM: Unit = Unit { suffix: "nm", written: "N·m" };
const J: Unit = Unit { suffix: "j", written: "J" };
const KG_M_S: Unit = Unit { suffix: "kg_m_s", written: "kg·m/s" };
const KG_M2_S: Unit = Unit { suffix: "kg_m2_s", written: "kg·m²/s" };
const US: Unit = Unit { suffix: "us", written: "µs" };

const fn scalar(
    topic: &'static str,
    name: &'static str,
    unit: Unit,
    meaning: &'static str,
) -> Signal {
    Signal {
        topic,
        name,
        kind: ColumnKind::F64,
        components: &[],
        unit,
        frame: "",
        point: "",
        meaning,
        with_rig: "",
        values: &[],
        bits: &[],
    }
}

const fn vector(
    topic: &'static str,
    name: &'static str,
    unit: Unit,
    meaning: &'static str,
) -> Signal {
    Signal { components: XYZ, ..scalar(topic, name, unit, meaning) }
}

const fn count(topic: &'static str, name: &'static str, meaning: &'static str) -> Signal {
    Signal { kind: ColumnKind::U64, ..scalar(topic, name, NONE, meaning) }
}

impl Signal {
    const fn frame(self, frame: &'static str) -> Self {
        Self { frame, ..self }
    }

    const fn at(self, point: &'static str) -> Self {
        Self { point, ..self }
    }

    /// What differs in a run against a rig.
    const fn rig(self, with_rig: &'static str) -> Self {
        Self { with_rig, ..self }
    }

    const fn values(self, values: &'static [(u64, &'static str)]) -> Self {
        Self { values, ..self }
    }
}

// Points and axes that come more than once.
const COM: &str = "mass centre";
const E: &str = "`e`";
const RING_CENTRE_4: &str = "passive ring's centre";

const OF_PROGRAMME: &str = "the body of the programme";
const OF_SENSORS: &str = "the ring as the mechanism's own sensors report it";
const MEASURED_POSE: &str = "the pose that the mechanisms have, as measured";
const MODEL: &str = "the model's at the measured pose: no rig measures it";

const fn once(signals: &'static [Signal]) -> Group {
    Group { count: None, of: "", signals }
}

/// Signals of every run.
pub const DOCKING: &[Group] = &[
    once(BODIES),
    once(RELATIVE),
    once(LOADS),
    once(INPUTS),
    Group { count: Some(3), of: "latch", signals: LATCH_FORCES },
    once(MOMENTUM),
    once(ATTITUDES),
    once(ENERGY),
    Group { count: Some(3), of: "latch", signals: LATCH_PHASES },
    Group { count: Some(3), of: "latch", signals: LATCH_GAPS },
    once(CONTACT),
];

/// Signals of a run against a rig, after those of every run.
pub const WITH_RIG: &[Group] = &[
    once(PROGRAMME),
    once(SENSORS),
    Group { count: Some(6), of: "leg", signals: LEGS },
    once(LOOP),
    once(COMPENSATOR),
];

const BODIES: &[Signal] = &[
    vector("/chaser", "chaser_position", M, "Position of the chaser.")
        .frame(E)
        .at(COM)
        .rig(OF_PROGRAMME),
    vector("/chaser", "chaser_velocity", M_S, "Velocity of the chaser.")
        .frame(E)
        .at(COM)
        .rig(OF_PROGRAMME),
    vector("/chaser", "chaser_rate", RAD_S, "Angular velocity of the chaser against `e`.")
        .frame("`e1`")
        .rig(OF_PROGRAMME),
    vector("/ring", "ring_position", M, "Position of the active ring with its petals.")
        .frame(E)
        .at(COM)
        .rig(OF_SENSORS),
    vector("/ring", "ring_velocity", M_S, "Velocity of the active ring.")
        .frame(E)
        .at(COM)
        .rig("as if the ring rested in the chaser: the mechanism's sensors report no velocity"),
    vector("/ring", "ring_rate", RAD_S, "Angular velocity of the active ring against `e`.")
        .frame("`r3`")
        .rig("that of the chaser"),
    vector("/target", "target_position", M, "Position of the target.")
        .frame(E)
        .at(COM)
        .rig(OF_PROGRAMME),
    vector("/target", "target_velocity", M_S, "Velocity of the target.")
        .frame(E)
        .at(COM)
        .rig(OF_PROGRAMME),
    vector("/target", "target_rate", RAD_S, "Angular velocity of the target against `e`.")
        .frame("`e2`")
        .rig(OF_PROGRAMME),
];

const RELATIVE: &[Signal] = &[
    vector("/relative", "relative_position", M, "`p_34`: position of `e4` from `e3`.")
        .frame("`e3`")
        .at("origin of `e4`")
        .rig(MEASURED_POSE),
    vector(
        "/relative",
        "relative_attitude",
        RAD,
        "Euler angles of `R_34`: x is roll φ, y pitch θ, z yaw ψ, `R_34 = Ry(θ) Rz(ψ) Rx(φ)`; zero when \
         docked.",
    )
    .frame("`e3`")
    .rig(MEASURED_POSE),
    vector("/relative", "relative_velocity", M_S, "Velocity of `e4` against `e3`; closing is x < 0.")
        .frame("`e3`")
        .at(RING_CENTRE_4)
        .rig("of the bodies of the programme, at the measured pose"),
    vector("/relative", "relative_rate", RAD_S, "Angular velocity of `e4` against `e3`.")
        .frame("`e3`")
        .rig("of the bodies of the programme"),
    vector(
        "/attenuator",
        "ring_deflection",
        M,
        "Displacement of the active ring's centre from rest; x < 0 is compression.",
    )
    .frame("`e3`")
    .at("active ring's centre")
    .rig(OF_SENSORS),
    vector("/attenuator", "ring_rotation", RAD, "Rotation vector ψ of the active ring from rest.")
        .frame("`e3`")
        .rig(OF_SENSORS),
];

const PORT3: &str =
    "as measured by sensor A and conditioned: tared, less the weight of a ring out of rest";
const PORT4: &str = "from sensor A by (12), (13), or from sensor B less weight and inertia of what it \
                     carries (`loop.sensors = \"two\"`)";

const LOADS: &[Signal] = &[
    vector("/loads", "port3_force", N, "F3: force of the mechanism on the chaser.")
        .frame("`e3`")
        .at("origin of `e3`")
        .rig(PORT3),
    vector("/loads", "port3_moment", NM, "M3: moment of the mechanism on the chaser.")
        .frame("`e3`")
        .at("origin of `e3`")
        .rig(PORT3),
    vector(
        "/loads",
        "port4_force",
        N,
        "F4: force of the mechanism on the target; x > 0 is compression.",
    )
    .frame("`e4`")
    .at("origin of `e4`")
    .rig(PORT4),
    vector("/loads", "port4_moment", NM, "M4: moment of the mechanism on the target.")
        .frame("`e4`")
        .at("origin of `e4`")
        .rig(PORT4),
    vector(
        "/loads",
        "contact_force",
        N,
        "Sum of the contact forces between the surfaces on the target, latches and joined rings left out.",
    )
    .frame(E)
    .rig(MODEL),
];

const INPUTS: &[Signal] = &[
    vector(
        "/inputs",
        "chaser_control_force",
        N,
        "F1: control force on the chaser, held over the tick.",
    )
    .frame("`e1`")
    .at(COM),
    vector("/inputs", "chaser_control_moment", NM, "M1: control moment on the chaser.")
        .frame("`e1`")
        .at(COM),
    vector(
        "/inputs",
        "target_control_force",
        N,
        "F2: control force on the target, held over the tick.",
    )
    .frame("`e2`")
    .at(COM),
    vector("/inputs", "target_control_moment", NM, "M2: control moment on the target.")
        .frame("`e2`")
        .at(COM),
];

const LATCH_FORCES: &[Signal] = &[vector(
    "/latches",
    "latch_{i}_force",
    N,
    "Force of the latch on the target: a caught latch pulls along −X, joined rings push and hold sideways \
     too; 0 while it is free.",
)
.frame("`r3`")
.at("striker of the latch")
.rig("the pull of a caught latch by the model; forces of the joined rings are not among them")];

const MOMENTUM: &[Signal] = &[
    vector("/momentum", "linear_momentum", KG_M_S, "Linear momentum of all bodies.").frame(E),
    vector("/momentum", "angular_momentum", KG_M2_S, "Angular momentum of all bodies.")
        .frame(E)
        .at("origin of `e`"),
];

const TURNS: &str =
    "Attitude as a unit quaternion: takes components in the body's axes to components in `e`.";

const ATTITUDES: &[Signal] = &[
    Signal { components: WXYZ, ..scalar("/chaser", "chaser_attitude", NONE, TURNS) }
        .frame("`e1` in `e`")
        .rig(OF_PROGRAMME),
    Signal { components: WXYZ, ..scalar("/ring", "ring_attitude", NONE, TURNS) }
        .frame("`r3` in `e`")
        .rig(OF_SENSORS),
    Signal { components: WXYZ, ..scalar("/target", "target_attitude", NONE, TURNS) }
        .frame("`e2` in `e`")
        .rig(OF_PROGRAMME),
];

const IN_ONE: &str = "0: what is lost is one figure, `energy_lost_contact_j`";

const ENERGY: &[Signal] = &[
    scalar("/energy", "energy_kinetic", J, "Kinetic energy of all bodies in `e`.")
        .rig("of chaser and target alone"),
    scalar("/energy", "energy_stored", J, "Stored in contacts, attenuator, latches and joined rings.")
        .rig("0: no rig measures it"),
    scalar("/energy", "energy_lost_contact", J, "Lost so far in the damping of contacts.").rig(
        "all that has left the motion of the bodies through the ports since the loop was closed; below \
         zero the loop has put energy in",
    ),
    scalar("/energy", "energy_lost_friction", J, "Lost so far in friction between the surfaces.")
        .rig(IN_ONE),
    scalar("/energy", "energy_lost_attenuator", J, "Lost so far in brakes, dampers and end stops.")
        .rig(IN_ONE),
    scalar("/energy", "energy_lost_joint", J, "Lost so far in the damping of the joined rings.")
        .rig(IN_ONE),
    scalar(
        "/energy",
        "energy_lost_capture",
        J,
        "Stored energy that vanished when the rings were joined.",
    )
    .rig(IN_ONE),
    scalar("/energy", "energy_work_in", J, "Work of the control wrenches so far."),
];

const LATCH_PHASES: &[Signal] =
    &[count("/latches", "latch_{i}_phase", "How far the latch has come.")
        .rig("as the mechanism's own sensors report it")
        .values(&[
            (LatchPhase::Free as u64, "free: no striker near"),
            (LatchPhase::Approach as u64, "approach: the striker is within the approach gap"),
            (
                LatchPhase::Struck as u64,
                "struck: the striker is within the strike gap and the zone",
            ),
            (LatchPhase::Latched as u64, "latched: caught; a caught latch stays so"),
        ])];

const LATCH_GAPS: &[Signal] = &[scalar(
    "/latches",
    "latch_{i}_gap",
    M,
    "Gap between latch and striker along X of `r3`; 0 when the ring faces meet, below that they overlap.",
)
.at("striker of the latch")
.rig(MODEL)];

const CONTACT: &[Signal] = &[
    scalar("/contact", "contact_depth", M, "Depth of the deepest place of contact; 0 without contact.")
        .rig(MODEL),
    count("/contact", "contact_places", "Places of contact; what each is like stands in `/contacts`.")
        .rig(MODEL),
    count(
        "/digest",
        "state_digest",
        "First 8 bytes of the digest of the state at the tick and the control wrenches held from it: two \
         runs that agree in it agree in every bit.",
    )
    .rig("of the bodies, the rig's own digest and the control wrenches"),
];

const PROGRAMME: &[Signal] = &[
    vector(
        "/programme",
        "programme_position",
        M,
        "`p_34` of the bodies of the programme: where the mechanisms ought to be.",
    )
    .frame("`e3`")
    .at("origin of `e4`"),
    vector(
        "/programme",
        "programme_rotation",
        RAD,
        "Rotation vector of `R_34` of the same bodies.",
    )
    .frame("`e3`"),
];

const RAW: &str = "Raw reading: weight and zero included.";
const TRUTH: &str = "True, as only emulated rigs know it (`rig_capabilities` bit 21); otherwise 0.";

const SENSORS: &[Signal] = &[
    vector("/sensor_a", "sensor_a_force", N, RAW).frame("`e3`").at("origin of `e3`"),
    vector("/sensor_a", "sensor_a_moment", NM, RAW).frame("`e3`").at("origin of `e3`"),
    vector("/sensor_b", "sensor_b_force", N, RAW).frame("`e4`").at("origin of `e4`"),
    vector("/sensor_b", "sensor_b_moment", NM, RAW).frame("`e4`").at("origin of `e4`"),
    vector("/truth_port3", "truth_port3_force", N, TRUTH).frame("`e3`").at("origin of `e3`"),
    vector("/truth_port3", "truth_port3_moment", NM, TRUTH).frame("`e3`").at("origin of `e3`"),
    vector("/truth_port4", "truth_port4_force", N, TRUTH).frame("`e4`").at("origin of `e4`"),
    vector("/truth_port4", "truth_port4_moment", NM, TRUTH).frame("`e4`").at("origin of `e4`"),
    vector(
        "/plate",
        "plate_specific_force",
        M_S2,
        "Accelerometers on the plate: acceleration less gravity (`rig_capabilities` bit 14); otherwise 0.",
    )
    .frame("`e4`")
    .at("origin of `e4`"),
    vector("/plate", "plate_angular_acceleration", RAD_S2, "The same, angular acceleration.")
        .frame("`e4`"),
];

const LEGS: &[Signal] = &[
    scalar("/legs", "leg_{i}_length", M, "Measured length from joint to joint."),
    scalar("/legs", "leg_{i}_speed", M_S, "Measured rate of the length."),
    scalar(
        "/legs",
        "leg_{i}_force",
        N,
        "Force of the oil on the rod, from pressures; pushing is positive.",
    ),
    scalar("/legs", "leg_{i}_spool", NONE, "Measured opening of the valve, a part of full stroke."),
    scalar("/legs", "leg_{i}_command_length", M, "Commanded length, for the next tick."),
    scalar(
        "/legs",
        "leg_{i}_command_flow_speed",
        M_S,
        "Commanded feed-forward of the flow, as a speed.",
    ),
    scalar(
        "/legs",
        "leg_{i}_command_force",
        N,
        "Force that the command expects; pushing is positive.",
    ),
];

const LOOP: &[Signal] = &[
    count(
        "/loop",
        "loop_phase",
        "Where the run is. Only the closed loop and the stop after it are recorded.",
    )
    .values(&[
        (Phase::Move as u64, "move: to the beginning of the run-up"),
        (Phase::Settle as u64, "settle: at rest there; sensors are tared"),
        (Phase::RunUp as u64, "run_up: along the free flight to the initial condition"),
        (Phase::Closed as u64, "closed: the bodies answer the measured wrenches"),
        (Phase::Stop as u64, "stop: the rig comes to rest"),
    ]),
    Signal {
        bits: &[
            (Status::ENABLED.bits() as u64, "the drives are on and the rig follows"),
            (Status::LIMIT_SWITCH.bits() as u64, "a limit switch of a leg is closed"),
            (Status::EMERGENCY_STOP.bits() as u64, "the emergency stop is pressed"),
            (Status::SENSOR_A_SATURATED.bits() as u64, "sensor A is at the end of its range"),
            (Status::SENSOR_B_SATURATED.bits() as u64, "sensor B is at the end of its range"),
            (
                Status::SAFE_STATE.bits() as u64,
                "safe state: the rig has left the commands and holds",
            ),
            (Status::REFUSED.bits() as u64, "the rig refused the command that this answers"),
            (Status::UNSOLICITED.bits() as u64, "answers no command; the loop passes over it"),
            (
                Status::ACCELEROMETER_SATURATED.bits() as u64,
                "the accelerometers are at the end of their range",
            ),
            (
                Status::JOINED.bits() as u64,
                "the rings are joined; holds with `rig_capabilities` bit 19",
            ),
        ],
        ..count(
            "/loop",
            "rig_status",
            "Status bits of the measurement ([rig-protocol.md](rig-protocol.md)).",
        )
    },
    Signal {
        bits: &[
            (Capabilities::LEG_COMMAND.bits() as u64, "takes the leg values of a command"),
            (
                Capabilities::POSE_COMMAND.bits() as u64,
                "takes the plate's pose and twist of a command without leg values",
            ),
            (Capabilities::MECHANISM_COMMAND.bits() as u64, "takes the mechanism's command"),
            (Capabilities::GUARD.bits() as u64, "enforces the limits of the guard by itself"),
            (Capabilities::LEG_LENGTH.bits() as u64, "`leg_{i}_length_m` holds"),
            (Capabilities::LEG_SPEED.bits() as u64, "`leg_{i}_speed_m_s` holds"),
            (Capabilities::LEG_FORCE.bits() as u64, "`leg_{i}_force_n` holds"),
            (Capabilities::VALVE_SPOOL.bits() as u64, "`leg_{i}_spool` holds"),
            (Capabilities::SENSOR_A.bits() as u64, "the `sensor_a_` signals hold"),
            (Capabilities::SENSOR_B.bits() as u64, "the `sensor_b_` signals hold"),
            (Capabilities::ACCELEROMETER.bits() as u64, "the accelerometers' signals hold"),
            (Capabilities::PLATE_POSE.bits() as u64, "the rig measures the pose of its plate"),
            (Capabilities::PLATE_TWIST.bits() as u64, "the rig measures the twist of its plate"),
            (Capabilities::LATCHES.bits() as u64, "the latches' signals hold"),
            (Capabilities::RING.bits() as u64, "the ring's signals hold"),
            (Capabilities::JOINED.bits() as u64, "`rig_status` bit 11 holds"),
            (Capabilities::TEMPERATURE.bits() as u64, "the temperature holds"),
            (Capabilities::TRUTH.bits() as u64, "the `truth_` signals hold"),
        ],
        ..count(
            "/loop",
            "rig_capabilities",
            "What the rig takes, and which of its numbers hold ([rig-protocol.md](rig-protocol.md)).",
        )
    },
    Signal {
        kind: ColumnKind::Bool,
        ..scalar(
            "/loop",
            "measurement_fresh",
            NONE,
            "Whether the measurement is of this tick; otherwise the last one is repeated.",
        )
    },
    scalar(
        "/loop",
        "wakeup_lateness",
        US,
        "How late the tick began; 0 with the virtual clock, where it would make two runs differ.",
    ),
    scalar("/loop", "compute_time", US, "Time the tick took; 0 with the virtual clock."),
    count("/loop", "missed_ticks", "Ticks left out before this one."),
];

const COMPENSATOR: &[Signal] = &[
    vector(
        "/compensator",
        "correction_3_force",
        N,
        "What the compensator, and the damping of `loop.energy_limit`, add to F3 for the bodies; 0 where neither does.",
    )
    .frame("`e3`"),
    vector("/compensator", "correction_3_moment", NM, "The same of M3.")
        .frame("`e3`")
        .at("origin of `e3`"),
    vector("/compensator", "correction_4_force", N, "The same of F4.").frame("`e4`"),
    vector("/compensator", "correction_4_moment", NM, "The same of M4.")
        .frame("`e4`")
        .at("origin of `e4`"),
    vector(
        "/compensator",
        "residual_4_force",
        N,
        "F4 as measured less what the compensator's model of the rig expects to measure; 0 without a model.",
    )
    .frame("`e4`"),
    vector("/compensator", "residual_4_moment", NM, "The same of M4.")
        .frame("`e4`")
        .at("origin of `e4`"),
    scalar(
        "/compensator",
        "compensator_trust",
        NONE,
        "Share of the model's correction that is applied, 0 to 1; 1 without a model.",
    ),
    scalar(
        "/compensator",
        "compensator_trust_fast",
        NONE,
        "Share of that which is left of its part above 8 Hz, 0 to 1; 1 without a model.",
    ),
];
