//! Keys of the TOML beside a motion simulator's URDF.

use super::{
    Group, Key, Need,
    Need::Required,
    SCHEMA, Shape,
    drive::{DRIVE, FRICTION, HYDRAULICS, OIL_VOLUMES, SPREAD, VALVE, WITH_OIL},
    key, names, table, tables,
};
use crate::rig::{DeadZoneLaw, FORCE_SENSORS as FORCE_WORDS};
use crate::toml_check::Range;

const FORCE_AT: [&str; 2] = names(&FORCE_WORDS);
const DEAD_ZONES: [&str; 2] = names(&DeadZoneLaw::WORDS);

const PAIR: Shape = Shape::List(2, Range::within(0.0, 1e7));
const POINT: Shape = Shape::List(3, Range::within(-50.0, 50.0));

const fn link(name: &'static str, example: &'static str, meaning: &'static str) -> Key {
    key(
        name,
        Shape::Text("name of a link of the URDF"),
        example,
        meaning,
        "The loader finds the frame and the masses fixed to it by this name.",
    )
}

const fn note(name: &'static str, example: &'static str, meaning: &'static str) -> Key {
    key(
        name,
        Shape::Note,
        example,
        meaning,
        "The number stands in the URDF, which has no place for where it comes from.",
    )
}

const FREQUENCY: Key = key(
    "natural_frequency_hz",
    Shape::Number(Range::within(10.0, 1e5)),
    "350.0",
    "Natural frequency of the sensor as a second-order system.",
    "Lower makes readings later: a delay of about 2 ζ/ω.",
);
const DAMPING_RATIO: Key = key(
    "damping_ratio",
    Shape::Number(Range::within(0.01, 2.0)),
    "0.7",
    "Damping ratio of the same.",
    "0.7 is the flattest band.",
);
const DELAY: Key = key(
    "delay_s",
    Shape::Number(Range::within(0.0, 0.005)),
    "0.0002",
    "From the load to the reading, beside the sensor's own lag.",
    "In a contact a late force cannot be told from negative damping: the loop gains energy.",
);
const DELAY_SPREAD: Key = key(
    "delay_spread_s",
    Shape::Number(Range::within(0.0, 0.005)),
    "0.0002",
    "Half-width within which the delay of an emulated sensor is drawn.",
    "What `rig calibrate` has to find.",
);

pub(super) const RIG: &[Group] = &[
    Group {
        tables: &[table("", Required, "The file itself.")],
        keys: &[
            SCHEMA,
            key(
                "kind",
                Shape::Words(&["rig"]),
                "\"rig\"",
                "What the file describes.",
                "Decides which keys are read; `model check` finds the loader by it.",
            ),
        ],
    },
    Group {
        tables: &[table("links", Required, "Which link of the URDF is which part of the rig.")],
        keys: &[
            link(
                "ground",
                "\"ground\"",
                "Ground of the rig, `eb`: the root; the base joints stand in it.",
            ),
            link("rack", "\"rack\"", "Fixed rack, `e0`, that carries the active mechanism."),
            link(
                "active_mount",
                "\"active_mount\"",
                "Mounting plane of the active mechanism on the rack, `e3`; origin and axes of sensor A.",
            ),
            link(
                "plate",
                "\"plate\"",
                "Moving plate, `ep`, on a floating joint; the plate joints stand in it.",
            ),
            link(
                "passive_mount",
                "\"passive_mount\"",
                "Mounting plane of the passive mechanism on the plate, `e4`; origin and axes of sensor B.",
            ),
        ],
    },
    Group {
        tables: &[table(
            "numbers",
            Required,
            "Notes on the numbers that the URDF holds: `{ source = \"…\" }` or `{ assumed = \"…\" }`, \
             without a value.",
        )],
        keys: &[
            note(
                "base_joints",
                "{ source = \"drawing 12-100\" }",
                "Where the base joints come from (origins of the six crosses).",
            ),
            note(
                "middle_pose",
                "{ source = \"drawing 12-100\" }",
                "Where the plate's pose in the middle comes from (its floating joint).",
            ),
            note(
                "mounts",
                "{ source = \"drawing 12-101\" }",
                "Where both mounting planes come from.",
            ),
            note(
                "plate_inertial",
                "{ source = \"weighed, 2026-11-02\" }",
                "Where mass, mass centre and inertia of the plate come from.",
            ),
            note(
                "passive_payload_inertial",
                "{ source = \"weighed, 2026-11-02\" }",
                "The same of what sensor B carries.",
            ),
            note(
                "active_payload_inertial",
                "{ source = \"weighed, 2026-11-02\" }",
                "The same of what sensor A carries.",
            ),
            note(
                "cross_inertial",
                "{ assumed = \"forged cross of 25 kg\" }",
                "The same of a leg's cross link.",
            ),
            note("cylinder_inertial", "{ source = \"maker's data\" }", "The same of a cylinder."),
            note("rod_inertial", "{ source = \"maker's data\" }", "The same of a rod."),
            note(
                "stroke_m",
                "{ source = \"maker's data\" }",
                "Where the strokes come from (limits of the prismatic joints).",
            ),
            note(
                "swing_limit_rad",
                "{ source = \"maker's data\" }",
                "Where the limits of the universal joints come from (limits of the revolute joints).",
            ),
            note(
                "leg_speed_m_s",
                "{ source = \"no-load speed of the valve\" }",
                "Where the largest speed of a rod comes from (`velocity` of the prismatic joints).",
            ),
            note(
                "leg_force_n",
                "{ assumed = \"set in the controller to spare the mechanism\" }",
                "Where the largest force of a rod comes from (`effort` of the prismatic joints).",
            ),
        ],
    },
    Group {
        tables: &[table("gravity", Required, "Weight on the rig.")],
        keys: &[key(
            "gravity_m_s2",
            Shape::List(3, Range::within(-30.0, 30.0)),
            "[-9.81, 0.0, 0.0]",
            "Gravity in the axes of `eb`.",
            "Loads the legs and both sensors. Off the docking axis it is flagged.",
        )],
    },
    Group {
        tables: &[table(
            "docking_workspace",
            Required,
            "The box of relative poses `X_34` that dockings need, up and down from its middle, where \
             `R_34` = I. The attitude turns about the origin of `e4`.",
        )],
        keys: &[
            key(
                "middle_p_34_m",
                Shape::List(3, Range::within(-10.0, 10.0)),
                "[0.6, 0.0, 0.0]",
                "`p_34` in the middle, in `e3`.",
                "The URDF must have the plate there with its joints at zero.",
            ),
            key(
                "axial_m",
                Shape::Number(Range::positive(5.0)),
                "0.3",
                "Half-width along X3.",
                "A rig that does not reach the box is refused; a larger one costs stroke.",
            ),
            key(
                "lateral_m",
                Shape::Number(Range::positive(5.0)),
                "0.3",
                "Half-width along Y3 and along Z3.",
                "As along X.",
            ),
            key(
                "roll_deg",
                Shape::Number(Range::positive(90.0)),
                "15.0",
                "Half-width in roll.",
                "As along X; roll takes the rig nearest to its singular pose.",
            ),
            key(
                "pitch_yaw_deg",
                Shape::Number(Range::positive(60.0)),
                "7.0",
                "Half-width in pitch and in yaw.",
                "As along X.",
            ),
        ],
    },
    Group {
        tables: &[table("legs", Required, "What all six legs have in common, beside the URDF.")],
        keys: &[
            key(
                "dead_length_m",
                Shape::Number(Range::within(0.0, 10.0)),
                "0.6",
                "Least length of a retracted leg beyond its stroke: piston, glands, joints.",
                "A stroke that does not fit into the retracted leg is refused.",
            ),
            key(
                "radius_m",
                Shape::Number(Range::positive(1.0)),
                "0.18",
                "Radius of the thickest part of a leg.",
                "Legs whose axes come nearer than twice this are refused as crossing.",
            ),
            key(
                "length_error_m",
                Shape::Number(Range::positive(0.1)),
                "0.0003",
                "How far a leg's length may be from what the rig believes: sensor, joints, calibration; a \
                 bound.",
                "`analyze workspace` computes the positional tolerance from it.",
            ),
            key(
                "ball_limit_deg",
                Shape::Number(Range::positive(90.0)),
                "40.0",
                "Largest angle of the spherical joint from the leg's direction in the middle.",
                "URDF has no limits for a joint that closes a loop.",
            ),
        ],
    },
    DRIVE,
    HYDRAULICS,
    OIL_VOLUMES,
    VALVE,
    FRICTION,
    Group {
        tables: &[table(
            "sensors",
            Need::Optional("without it there is no loop: `hil` refuses the rig"),
            "What measures on the rig.",
        )],
        keys: &[
            key(
                "force_sensors",
                Shape::Words(&FORCE_AT),
                "\"rack_and_plate\"",
                "Where there are force–torque sensors: A on the rack, and B on the plate.",
                "With A alone, F4 and M4 come from it by (12) and (13), and `loop.sensors = \"two\"` is \
                 refused.",
            )
            .optional("both are there"),
            key(
                "length_noise_m",
                Shape::Number(Range::within(0.0, 0.01)),
                "3e-6",
                "Standard deviation of a sample of a length sensor.",
                "Noise in the leg loops and in the measured pose.",
            ),
            key(
                "length_quantum_m",
                Shape::Number(Range::within(0.0, 0.01)),
                "1e-6",
                "Step of a length sensor or encoder.",
                "0 for none.",
            ),
            key(
                "pressure_noise_n",
                Shape::Number(Range::within(0.0, 1e6)),
                "40.0",
                "Standard deviation of a leg's force as its pressure sensors report it.",
                "Noise in the pressure feedback.",
            )
            .only(WITH_OIL),
        ],
    },
    FORCE_SENSORS,
    ACCELEROMETERS,
    OFFLOAD,
    SPREAD,
    Group {
        tables: &[tables(
            "closures",
            6,
            "The loops that URDF cannot express: each ties a rod to the plate by a spherical joint.",
        )],
        keys: &[
            key(
                "rod",
                Shape::Text("name of a link of the URDF"),
                "\"rod_0\"",
                "Link of the rod; each rod once.",
                "The order of these tables is the order of the legs everywhere.",
            ),
            key(
                "rod_point_m",
                POINT,
                "[0.0, 0.0, 0.0]",
                "The joint in the frame of the rod.",
                "With the joints of the URDF at zero both points must be one to 1e-6 m.",
            ),
            key(
                "plate_point_m",
                POINT,
                "[0.0, 1.231322950651, -1.576021507213]",
                "The joint in the frame of the plate.",
                "As above; nine decimals or more.",
            ),
        ],
    },
];

const FORCE_SENSORS: Group = Group {
    tables: &[table(
        "sensors.force",
        Need::Where("[sensors] is there"),
        "The force–torque sensors, alike: A under the active mechanism (origin and axes of `e3`), B \
         over the passive one (`e4`). Pairs are of force and moment.",
    )],
    keys: &[
        FREQUENCY,
        DAMPING_RATIO,
        key(
            "noise_n_nm",
            PAIR,
            "[0.3, 0.15]",
            "Standard deviation of a sample.",
            "Decides from which force on a contact is seen.",
        ),
        key(
            "drift_per_s_n_nm",
            PAIR,
            "[0.01, 0.005]",
            "Drift of the zero per second.",
            "Adds up in the momentum of the pair over minutes.",
        ),
        key(
            "dead_zone_n_nm",
            PAIR,
            "[0.5, 0.25]",
            "Threshold below which a reading is zero.",
            "Hides the beginning of a soft contact.",
        ),
        key(
            "dead_zone_law",
            Shape::Words(&DEAD_ZONES),
            "\"zeroing\"",
            "What happens above the threshold: readings pass whole, or less the threshold.",
            "`subtractive` acts like a larger gap at the contact.",
        ),
        key("quantum_n_nm", PAIR, "[0.1, 0.05]", "Step of a reading.", "0 for none."),
        key(
            "range_n_nm",
            PAIR,
            "[40000.0, 20000.0]",
            "End of the range.",
            "A reading at its end stops the rig.",
        ),
        DELAY,
        DELAY_SPREAD,
        key(
            "zero_spread_n_nm",
            PAIR,
            "[20.0, 10.0]",
            "Half-width within which the zero of an emulated sensor is drawn.",
            "What the tare before every run has to find.",
        ),
    ],
};

const ACCELEROMETERS: Group = Group {
    tables: &[table(
        "sensors.accelerometer",
        Need::Optional(
            "without it `loop.sensors = \"two\"` takes inertia off by the commanded motion",
        ),
        "Accelerometers on the plate beside sensor B: specific force (acceleration less gravity) and \
         angular acceleration at the origin of `e4`, in its axes. Pairs are of both.",
    )],
    keys: &[
        FREQUENCY,
        DAMPING_RATIO,
        key(
            "noise_m_s2_rad_s2",
            PAIR,
            "[0.0007, 0.0005]",
            "Standard deviation of a sample.",
            "Times the carried mass it is noise in the force of contact.",
        ),
        key("quantum_m_s2_rad_s2", PAIR, "[0.0001, 0.0001]", "Step of a reading.", "0 for none."),
        key(
            "range_m_s2_rad_s2",
            PAIR,
            "[50.0, 50.0]",
            "End of the range.",
            "With two sensors a reading at its end stops the rig.",
        ),
        DELAY,
        DELAY_SPREAD,
        key(
            "zero_spread_m_s2_rad_s2",
            PAIR,
            "[0.04, 0.04]",
            "Half-width within which the zero of an emulated accelerometer is drawn.",
            "What the tare has to find.",
        ),
    ],
};

const OFFLOAD: Group = Group {
    tables: &[table(
        "offload",
        Need::Optional("nothing carries the ring, and its whole weight lies on the attenuator"),
        "The balance on which the moving ring of the active mechanism hangs: a constant lift on a small \
         moving mass, from which a rope goes down to the mass centre of the ring. It stands beside the \
         rack, so no sensor carries it, and follows the ring sideways; the docking axis is vertical. \
         `model check RIG --mechanism ACTIVE` tells what the weight that is left takes of every brake and \
         travel.",
    )],
    keys: &[
        key(
            "share",
            Shape::Number(Range::within(0.01, 1.0)),
            "0.98",
            "Part of the ring's weight that the balance lifts.",
            "In orbit the ring has no weight. What is left sags, and uses up the brakes against which the \
             ring is pushed in.",
        ),
        key(
            "friction_n",
            Shape::Number(Range::within(0.0, 500.0)),
            "5.0",
            "Coulomb friction of guides and pulleys, on the moving mass.",
            "A force on the ring against its motion that is not there in orbit; below it the balance sticks.",
        ),
        key(
            "added_mass_kg",
            Shape::Number(Range::within(0.0, 500.0)),
            "2.0",
            "Mass that moves with the ring along the docking axis, reduced to the rope: hook, rope, pulleys, \
             counterweight.",
            "The ring is heavier by it along that axis alone. 0 leaves the rope and the friction.",
        ),
        key(
            "stiffness_n_m",
            Shape::Number(Range::within(1e3, 1e8)),
            "2e5",
            "Stiffness of the hanger: rope and frame between ring and moving mass.",
            "How far the ring moves before the moving mass follows. A rope does not push: it goes slack \
             where the ring rises faster than the balance takes it in. An emulated rig follows the moving \
             mass on its hanger up to 500 Hz.",
        ),
        key(
            "damping_ratio",
            Shape::Number(Range::within(0.0, 1.0)),
            "0.05",
            "Damping of the moving mass on the hanger as a part of the critical one.",
            "How long the moving mass swings on the rope after a blow.",
        ),
    ],
};
