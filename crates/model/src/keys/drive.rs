//! Keys of what moves the legs of a rig.

use super::{Group, Need, Shape, key, names, table};
use crate::drive::{DRIVES, HydraulicPreset};
use crate::toml_check::Range;

const KINDS: [&str; 3] = names(&DRIVES);
const PRESETS: [&str; 3] = names(&HydraulicPreset::WORDS);
const PART: Shape = Shape::Number(Range::within(0.0, 0.9));

/// Where there is oil.
pub(super) const WITH_OIL: &str = "drive.kind is hydraulic, or there is no [drive]";

pub(super) const DRIVE: Group = Group {
    tables: &[table(
        "drive",
        Need::Optional("the legs are hydraulic"),
        "What moves the legs, all six alike. A drive with a position loop of its own follows the commanded \
         lengths whatever the load; the largest speed and force of a leg are `velocity` and `effort` of the \
         prismatic joints of the URDF, its encoder is `sensors.length_quantum_m`.",
    )],
    keys: &[
        key(
            "kind",
            Shape::Words(&KINDS),
            "\"position_loop\"",
            "hydraulic: the tables `[hydraulics]`, `[valve]` and `[friction]`; position_loop: by its \
             parameters; measured: by its response, from `rig identify`.",
            "Decides what loop, emulated rig, `rig identify` and `analyze` can use.",
        ),
        key(
            "order",
            Shape::Count(1, 2),
            "2",
            "Order of the closed position loop.",
            "A first order has no resonance and no damping ratio.",
        )
        .only("kind is position_loop"),
        key(
            "natural_frequency_hz",
            Shape::Number(Range::within(0.5, 500.0)),
            "12.0",
            "Natural frequency of the loop; of a first order its corner.",
            "Lower makes the rig later, by 2 ζ/ω or 1/ω.",
        )
        .only("kind is position_loop"),
        key(
            "damping_ratio",
            Shape::Number(Range::within(0.05, 5.0)),
            "0.7",
            "Damping ratio of the loop.",
            "As the natural frequency.",
        )
        .only("kind is position_loop and order 2"),
        key(
            "delay_s",
            Shape::Number(Range::within(0.0, 0.05)),
            "0.004",
            "Transport delay: from a command to the loop.",
            "The part of the rig's delay that is the same at all frequencies.",
        )
        .only("kind is position_loop"),
        key(
            "lag_s",
            Shape::Number(Range::within(-0.001, 0.1)),
            "0.0215",
            "`delay_s` of `rig identify`: from the instant a command is for to the plate on slow moves.",
            "Parts delay from lag at low frequencies, with the response.",
        )
        .only("kind is measured"),
        key(
            "response_hz_1_deg",
            Shape::Rows(None, 3, Range::within(-720.0, 720.0)),
            "[[0.5, 1.0, -3.9], [5.0, 1.0, -39.4]]",
            "The response of `rig identify`: rows of frequency, gain and phase (late is negative), of any \
             degrees of freedom together. An emulated rig has the loop of second order with a delay that is \
             nearest; `model check` says by how much it misses, and more than 5 % is refused.",
            "What the legs do in the band of dockings.",
        )
        .only("kind is measured"),
        key(
            "acceleration_m_s2",
            Shape::Number(Range::within(0.1, 1000.0)),
            "15.0",
            "Largest acceleration of a leg.",
            "What large fast motions are cut by.",
        )
        .optional("no limit; not with a hydraulic drive"),
    ],
};

pub(super) const HYDRAULICS: Group = Group {
    tables: &[table(
        "hydraulics",
        Need::Where(WITH_OIL),
        "Oil and cylinder of every leg, (10) and Table 1 of the paper.",
    )],
    keys: &[
        key(
            "default",
            Shape::Words(&PRESETS),
            "\"printed\"",
            "The oil volume that is meant when none is named.",
            "Three volumes stand in the file; one of them must be meant.",
        ),
        key(
            "area_m2",
            Shape::Number(Range::positive(1.0)),
            "0.06",
            "Effective piston area A, both sides alike.",
            "Force per pressure and speed per flow; the oil spring goes with its square.",
        ),
        key(
            "bulk_modulus_pa",
            Shape::Number(Range::within(1e7, 3e9)),
            "6.9e8",
            "Bulk modulus β_e of the oil, air in it included.",
            "The oil spring goes with it: K_h = 4 β_e A²/V_t.",
        ),
        key(
            "viscous_n_s_m",
            Shape::Number(Range::within(0.0, 1e6)),
            "20.0",
            "Viscous friction B_c of a cylinder.",
            "Damping of the oil spring; the paper's is small.",
        ),
        key(
            "dead_volume_m3",
            Shape::Number(Range::within(0.0, 10.0)),
            "0.006",
            "Oil that no piston position expels, both chambers and lines to the valve together.",
            "With area and stroke it is the volume that belongs to the rig; presets that differ are \
             flagged.",
        ),
    ],
};

pub(super) const OIL_VOLUMES: Group = Group {
    tables: &[
        table(
            "hydraulics.printed",
            Need::Where(WITH_OIL),
            "Oil volume: Table 1 of the paper as printed.",
        ),
        table("hydraulics.consistent", Need::Where(WITH_OIL), "Oil volume that fits the stroke."),
        table(
            "hydraulics.stiff",
            Need::Where(WITH_OIL),
            "A tenth of the printed volume, with a bypass leak.",
        ),
    ],
    keys: &[
        key(
            "total_volume_m3",
            Shape::Number(Range::positive(10.0)),
            "0.36",
            "Total volume V_t.",
            "Decides the rig's stiffness more than anything else.",
        ),
        key(
            "leakage_m3_s_pa",
            Shape::Number(Range::within(0.0, 1e-6)),
            "9e-12",
            "Total flow–pressure coefficient K_ce.",
            "Larger damps the oil spring more and reduces the static stiffness.",
        ),
    ],
};

pub(super) const VALVE: Group = Group {
    tables: &[table("valve", Need::Where(WITH_OIL), "Servo valve and supply of every leg.")],
    keys: &[
        key(
            "natural_frequency_hz",
            Shape::Number(Range::within(1.0, 1000.0)),
            "80.0",
            "Natural frequency of the spool.",
            "Lower delays every command: about 2 ζ/ω.",
        ),
        key(
            "damping_ratio",
            Shape::Number(Range::within(0.05, 2.0)),
            "0.7",
            "Damping ratio of the spool.",
            "As the natural frequency.",
        ),
        key(
            "no_load_flow_m3_s",
            Shape::Number(Range::positive(1.0)),
            "0.042",
            "Flow at full spool without load.",
            "Over the piston area it is the fastest speed of a rod.",
        ),
        key(
            "slew_full_strokes_per_s",
            Shape::Number(Range::within(0.1, 1e4)),
            "10.0",
            "Fastest motion of the spool, full strokes per second.",
            "Limits amplitude at high frequency.",
        ),
        key(
            "null_bias",
            Shape::Number(Range::within(-0.1, 0.1)),
            "0.0",
            "Spool position at zero command, as a part of full stroke.",
            "Makes legs creep; 0.003 looks like 2 to 12 ms of delay at docking speeds.",
        ),
        key(
            "supply_pressure_pa",
            Shape::Number(Range::within(1e5, 5e7)),
            "1.0e7",
            "Supply over return pressure.",
            "Over the load pressure it is how far flow depends on load.",
        ),
        key(
            "dead_time_s",
            Shape::Number(Range::within(0.0, 0.1)),
            "0.002",
            "From a command to the valve.",
            "The part of the rig's delay that no controller takes back.",
        ),
    ],
};

pub(super) const FRICTION: Group = Group {
    tables: &[table(
        "friction",
        Need::Where(WITH_OIL),
        "Friction of a leg's seals, a bristle after LuGre (Canudas de Wit et al. 1995).",
    )],
    keys: &[
        key(
            "coulomb_n",
            Shape::Number(Range::within(0.0, 1e5)),
            "500.0",
            "Friction while sliding.",
            "Where the rig differs most from a linear one at small amplitudes.",
        ),
        key(
            "static_n",
            Shape::Number(Range::within(0.0, 1e5)),
            "650.0",
            "Break-away friction, at least the sliding one.",
            "Makes a leg stick at reversals.",
        ),
        key(
            "stribeck_velocity_m_s",
            Shape::Number(Range::positive(1.0)),
            "0.005",
            "Speed at which the excess of the break-away friction has faded to 1/e.",
            "As the break-away friction.",
        ),
        key(
            "bristle_n_m",
            Shape::Number(Range::positive(1e12)),
            "1.0e7",
            "Stiffness of the bristle.",
            "Break-away friction over it is the presliding displacement.",
        ),
        key(
            "bristle_damping_n_s_m",
            Shape::Number(Range::within(0.0, 1e9)),
            "3.0e4",
            "Damping of the bristle.",
            "Lets the bristle follow without ringing.",
        ),
    ],
};

pub(super) const SPREAD: Group = Group {
    tables: &[table(
        "spread",
        Need::Required,
        "Half-widths within which an emulated rig is drawn away from this file (`--perturb`, `--seed`); \
         the loop goes on believing the file.",
    )],
    keys: &[
        key(
            "flow_gain",
            PART,
            "0.05",
            "Of the valves' flow gain, relative.",
            "A leg that is too fast or slow.",
        )
        .only(WITH_OIL),
        key(
            "null_bias",
            Shape::Number(Range::within(0.0, 0.1)),
            "0.003",
            "Of the valves' null bias, parts of full stroke.",
            "A leg that creeps.",
        )
        .only(WITH_OIL),
        key(
            "friction",
            PART,
            "0.5",
            "Of both frictions, relative.",
            "Seals change with pressure and age.",
        )
        .only(WITH_OIL),
        key("bulk_modulus", PART, "0.1", "Of the bulk modulus, relative.", "Dissolved air.")
            .only(WITH_OIL),
        key(
            "plate_mass",
            PART,
            "0.03",
            "Of the plate's mass and inertia, relative.",
            "Mass as built.",
        ),
        key(
            "valve_frequency",
            PART,
            "0.05",
            "Of the spool's natural frequency, relative.",
            "Delay of the legs.",
        )
        .only(WITH_OIL),
        key(
            "loop_frequency",
            PART,
            "0.05",
            "Of the natural frequency of the legs' position loops, relative.",
            "Lag of the legs.",
        )
        .only("drive.kind is position_loop or measured"),
        key(
            "loop_damping",
            PART,
            "0.2",
            "Of the damping ratio of the legs' position loops, relative.",
            "Lag of the legs.",
        )
        .optional("all legs are damped as the file says; not with oil"),
        key(
            "dead_time_s",
            Shape::Number(Range::within(0.0, 0.1)),
            "0.0005",
            "Of the dead time.",
            "Delay of the whole rig, which the lead must match.",
        ),
    ],
};
