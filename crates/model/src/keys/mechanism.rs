//! Keys of the TOML beside each side of a docking mechanism.

use super::{
    Group, Key, Need, Need::Required, SCHEMA, Shape, any_number, key, names, table, tables,
};
use crate::mechanism::{AttenuationChoice, LatchAxes};
use crate::toml_check::Range;

/// Ranges of the contact law, shared with scenarios that override parts of it.
pub mod contact_ranges {
    use crate::toml_check::Range;

    /// Stiffness, N/mⁿ.
    pub const STIFFNESS: Range = Range::positive(1e12);
    /// Exponent of Hunt–Crossley.
    pub const EXPONENT: Range = Range::within(1.0, 3.0);
    /// Damping of Hunt–Crossley, s/m.
    pub const DAMPING_S_M: Range = Range::within(0.0, 100.0);
    /// Damping of Kelvin–Voigt, N·s/m.
    pub const DAMPING_N_S_M: Range = Range::within(0.0, 1e7);
    /// Friction coefficients.
    pub const FRICTION: Range = Range::within(0.0, 2.0);
    /// Stribeck velocity, m/s.
    pub const STRIBECK_VELOCITY: Range = Range::within(1e-6, 1.0);
    /// Break-away displacement of the bristle, m.
    pub const BRISTLE_BREAKAWAY: Range = Range::within(1e-8, 0.01);
    /// Damping time of the bristle, s.
    pub const BRISTLE_DAMPING: Range = Range::within(0.0, 1.0);
    /// Merging depth, m.
    pub const MERGE_DEPTH: Range = Range::within(1e-7, 0.01);
}
use contact_ranges as contact;

/// A word of `contact.normal_law`, and whether it is Hunt–Crossley.
pub(crate) const NORMAL_LAWS: [(&str, bool); 2] =
    [("hunt_crossley", true), ("kelvin_voigt", false)];

/// Words of `surface.kind`.
pub(crate) const SURFACE_KINDS: [(&str, SurfaceKind); 8] = [
    ("sphere", SurfaceKind::Sphere),
    ("capsule", SurfaceKind::Capsule),
    ("torus", SurfaceKind::Torus),
    ("box", SurfaceKind::Box),
    ("cylinder", SurfaceKind::Cylinder),
    ("cone", SurfaceKind::Cone),
    ("hull", SurfaceKind::Hull),
    ("hollow", SurfaceKind::Hollow),
];

/// A kind of surface, before its sizes are read.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SurfaceKind {
    Sphere,
    Capsule,
    Torus,
    Box,
    Cylinder,
    Cone,
    Hull,
    Hollow,
}

const SURFACE_KIND_NAMES: [&str; 8] = names(&SURFACE_KINDS);
const NORMAL_LAW_NAMES: [&str; 2] = names(&NORMAL_LAWS);
const ATTENUATION_NAMES: [&str; 3] = names(&AttenuationChoice::WORDS);
const LATCH_AXES_NAMES: [&str; 2] = names(&LatchAxes::WORDS);

const fn kind(word: &'static [&'static str], example: &'static str) -> Key {
    key(
        "kind",
        Shape::Words(word),
        example,
        "What the file describes.",
        "Decides which keys are read; `model check` finds the loader by it.",
    )
}

const DAMPING: Range = Range::within(0.0, 1e8);
const FORCE: Range = Range::within(0.0, 1e8);
const CURVE: Range = Range::within(0.0, 1e9);
const LENGTH: Range = Range::positive(1.0);
const LOAD: Range = Range::positive(1e9);
const STIFFNESS: Range = Range::positive(1e12);
const PART: Shape = Shape::Number(Range::within(0.0, 0.9));
const POSITION: Shape = Shape::Number(Range::within(0.0, 0.01));

// Both sides -----------------------------------------------------------------------------------

const REFERENCE_RADIUS: Key = key(
    "reference_radius_m",
    Shape::Number(Range::positive(5.0)),
    "0.6",
    "Radius that stands for the ring of a side without one: rotations count at it, and pictures are drawn to it.",
    "As `ring.mean_radius_m`, of a ring that nothing touches.",
)
.only("[ring] is not there");

const RING: Group = Group {
    tables: &[table(
        "ring",
        Need::Optional("without it the side has no ring, and what touches are its surfaces"),
        "The guide ring of this side: a torus about X of its ring frame (`r3` of the active side, `r4` \
         of the passive one).",
    )],
    keys: &[
        key(
            "mean_radius_m",
            Shape::Number(Range::positive(5.0)),
            "0.6",
            "Radius of the centre circle.",
            "Rings of both sides meet at it. Latches stand on the active side's circle, and rotations \
             count at it against `limits.overtravel_m`.",
        ),
        key(
            "section_radius_m",
            Shape::Number(Range::positive(0.5)),
            "0.025",
            "Radius of the section; below `mean_radius_m`.",
            "The ring faces meet at this height over the centre circles: it is part of the docked length. \
             Thicker rings leave less clearance to the petals of the other side.",
        ),
        key(
            "segments",
            Shape::Count(8, 720),
            "48",
            "Straight pieces by which meshes, and engines without a torus, approximate the ring.",
            "Only for pictures and for the comparison with MuJoCo: the contact law uses the exact circle.",
        ),
    ],
};

const PETALS: Group = Group {
    tables: &[table(
        "petals",
        Need::Optional("without it the side is a bare ring"),
        "The guide petals of this side, alike and evenly spread. The mid-surface of one is ruled by \
         straight lines from an arc at the base to an arc at the tip; a ball of half the thickness swept \
         over it is the petal.",
    )],
    keys: &[
        key(
            "count",
            Shape::Count(1, 12),
            "3",
            "Number of petals; both sides must have the same.",
            "The petals of both sides interleave around the ring.",
        ),
        key(
            "first_azimuth_deg",
            Shape::Number(Range::within(-360.0, 360.0)),
            "0.0",
            "Azimuth of the middle of petal 0 in the ring frame, from +Y toward +Z.",
            "Azimuth β of the passive side is 180° − β seen from `r3`: it decides whether petals \
             interleave or collide. The URDF's links `petal_0`, `petal_1`, … must be turned by it.",
        ),
        key(
            "base_radius_m",
            Shape::Number(Range::positive(5.0)),
            "0.597",
            "Radius of the mid-surface at the base (x = 0), within the section of the ring.",
            "With the ring of the other side it decides the clearance when docked.",
        ),
        key(
            "tip_radius_m",
            Shape::Number(Range::positive(5.0)),
            "0.41",
            "Radius of the mid-surface at the tip (x = `height_m`).",
            "Below the base radius petals lean inward, above it outward; both sides must lean the same \
             way. The difference is the sideways offset that petals can still guide.",
        ),
        key(
            "height_m",
            Shape::Number(Range::positive(2.0)),
            "0.187",
            "Height of the mid-surface along X of the ring frame.",
            "With both radii it is the slope that turns an offset into a push sideways; beyond this \
             height a departing target counts as separated.",
        ),
        key(
            "base_half_angle_deg",
            Shape::Number(Range::positive(90.0)),
            "28.0",
            "Half of the angle that a petal covers at its base; below 180°/`count`. Side edges are straight from \
             base to tip.",
            "What both sides leave of 180°/`count` is the roll play when docked; `model check` computes it \
             from the surfaces.",
        ),
        key(
            "tip_half_angle_deg",
            Shape::Number(Range::positive(90.0)),
            "14.0",
            "Half of the angle that a petal covers at its tip; below 180°/`count`.",
            "With the base angle it is the slope of the side edges, which turn the ring in roll.",
        ),
        key(
            "thickness_m",
            Shape::Number(Range::positive(0.2)),
            "0.02",
            "Thickness; edges are rounded with half of it. Below `height_m`.",
            "Thicker petals leave less clearance and less roll play.",
        ),
        key(
            "strips",
            Shape::Count(1, 64),
            "8",
            "Strips by which meshes, and engines of convex pieces, approximate a petal.",
            "Only for pictures and for the comparison with MuJoCo: the contact law searches the exact \
             surface.",
        ),
        key(
            "flexural_rigidity_n_m2",
            Shape::Number(Range::positive(1e12)),
            "16000.0",
            "Flexural rigidity EI of a petal as a cantilever, N·m².",
            "At arc length s from the base a petal gives in with s³/(3 EI), in series with the contact \
             stiffness. Smaller makes contacts at the tip softer; very large is a rigid petal.",
        ),
    ],
};

const SURFACES: Group = Group {
    tables: &[any_number(
        "surface",
        "without it only ring and petals touch",
        "Surfaces of this side beside ring and petals, or instead of them: a core with a ball swept over it. \
         Convex surfaces (sphere, capsule, box, cylinder, cone, hull) touch convex ones; a torus touches spheres, \
         capsules and toruses; a hollow touches spheres, capsules and toruses; a ring counts as a torus. Any other pair that can come \
         within reach is refused. At most 48 such pairs, which are 64 with the 16 numbers of rings and petals. A pair stores \
         energy by its two surfaces in series (1/k = 1/k₁ + 1/k₂ for a linear law), and rubs by the geometric mean √(μ₁ μ₂) of \
         both frictions; everything else of its law stands in [contact] of the active side. A ring has \
         2ⁿ times the stiffness of [contact], so that two rings have that one.",
    )],
    keys: &[
        key(
            "name",
            Shape::Text("text, unlike that of any other surface of the side, not `ring`"),
            "\"probe_head\"",
            "Name in records and messages.",
            "A pair is called by the names of both surfaces.",
        ),
        key(
            "kind",
            Shape::Words(&SURFACE_KIND_NAMES),
            "\"sphere\"",
            "Core over which the ball is swept. sphere: the origin of the surface's frame; capsule: a segment along X \
             about it; torus: a circle about X; box, cylinder and cone about X, hull of points; hollow: the wall of a \
             cone or cup, straight lines in the half-plane (x, radius) turned about X, with a surface on both of its sides.",
            "Decides the sizes below and which partners it may have.",
        ),
        key(
            "link",
            Shape::Text("name of a link of the URDF"),
            "\"ring\"",
            "Link on which it stands. On the active side `ring` or a link fixed to it: what touches moves with the ring.",
            "Its forces act on that body.",
        ),
        key(
            "position_m",
            Shape::List(3, Range::within(-10.0, 10.0)),
            "[0.3, 0.0, 0.0]",
            "Origin of the surface's frame in the frame of its link.",
            "Where it touches.",
        ),
        key(
            "rpy_deg",
            Shape::List(3, Range::within(-360.0, 360.0)),
            "[0.0, 0.0, 0.0]",
            "Axes of the surface's frame in those of its link: turned about the fixed axes X, Y, Z in this order, as in URDF.",
            "X is the axis of all kinds but sphere, box and hull.",
        ),
        key(
            "rounding_m",
            Shape::Number(Range::positive(10.0)),
            "0.04",
            "Radius of the swept ball: of a sphere its radius, of capsule and torus that of the section, of a \
             hollow half of the wall. It comes on top of the sizes below.",
            "`limits.depth_m` must stay below the radii of both surfaces of a pair together: beyond it their cores would meet.",
        ),
        key(
            "core_radius_m",
            Shape::Number(Range::positive(10.0)),
            "0.05",
            "Radius of the core: of the circle of a torus, of a cylinder, of the base of a cone.",
            "Size without the rounding.",
        )
        .only("kind is torus, cylinder or cone"),
        key(
            "length_m",
            Shape::Number(Range::positive(20.0)),
            "0.2",
            "Length of the core along X, half of it to either side of the origin; a cone has its tip at +X.",
            "Size without the rounding.",
        )
        .only("kind is capsule, cylinder or cone"),
        key(
            "size_m",
            Shape::List(3, Range::within(0.0, 20.0)),
            "[0.1, 0.2, 0.2]",
            "Edges of the core along X, Y, Z, about the origin.",
            "Size without the rounding.",
        )
        .only("kind is box"),
        key(
            "points_m",
            Shape::Rows(None, 3, Range::within(-10.0, 10.0)),
            "[[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.1, 0.0, 0.1]]",
            "Points whose convex hull is the core; at most 64.",
            "Size without the rounding.",
        )
        .only("kind is hull"),
        key(
            "profile_m",
            Shape::Rows(None, 2, Range::within(-10.0, 10.0)),
            "[[0.0, 0.05], [0.3, 0.35]]",
            "Points (x, radius ≥ 0) of the middle of the wall from one end to the other; at most 6. Two points are a cone; a \
             point on the axis closes a cup.",
            "Size without the rounding.",
        )
        .only("kind is hollow"),
        key(
            "stiffness_n_m",
            Shape::Number(contact::STIFFNESS),
            "2000000.0",
            "Stiffness of this surface alone, N/m (N/mⁿ with the exponent n of [contact]).",
            "Two alike give a pair half of it with a linear law.",
        ),
        key(
            "friction",
            Shape::Number(contact::FRICTION),
            "0.1",
            "Friction coefficient of this surface, sticking and sliding.",
            "0 makes every pair of it free of friction.",
        ),
    ],
};

// The active side ------------------------------------------------------------------------------

const fn key_ring_rest() -> Key {
    key(
        "ring_rest_offset_m",
        Shape::Number(Range::positive(2.0)),
        "0.3",
        "Distance along +X3 from the mounting plane `e3` to the ring's centre circle, the ring at rest.",
        "Origin of `r3` at rest, and part of the docked length. The joint of the URDF's link `ring` \
             must stand there.",
    )
}

pub(super) const ACTIVE: &[Group] = &[
    Group {
        tables: &[table("", Required, "The file itself.")],
        keys: &[
            SCHEMA,
            kind(&["mechanism_active"], "\"mechanism_active\""),
            key(
                "captured_when",
                Shape::Text("`all`, `any`, or names of latches with commas between them, all of which must hold"),
                "\"all\"",
                "Which of the latches in [[latch]] must have caught for a capture.",
                "A capture is an outcome; attenuation then goes over to its damping after capture.",
            )
            .only("[[latch]] is there"),
        ],
    },
    Group {
        tables: &[table("placement", Required, "Where the ring stands.")],
        keys: &[key_ring_rest(), REFERENCE_RADIUS],
    },
    RING,
    PETALS,
    SURFACES,
    Group {
        tables: &[table(
            "ring_body",
            Required,
            "The active ring with its petals and latches as one rigid body between the spacecraft. The \
             inertial of the URDF's link `ring` must agree; no other link of the file may have one.",
        )],
        keys: &[
            key(
                "mass_kg",
                Shape::Number(Range::within(1e-4, 1e5)),
                "39.1",
                "Mass of ring, petals and latches together.",
                "It is not part of the chaser's mass: the chaser's URDF is without it. With the \
                 attenuation `rigid` it is added to the chaser. Larger makes first contacts harder, since \
                 the ring has to be pushed aside before the attenuator gives in.",
            ),
            key(
                "com_m",
                Shape::List(3, Range::within(-5.0, 5.0)),
                "[0.032, 0.0, 0.0]",
                "Mass centre in `r3`.",
                "Lever of the ring's inertia about its own centre.",
            ),
            key(
                "inertia_kg_m2",
                Shape::Rows(Some(3), 3, Range::within(-1e7, 1e7)),
                "[[12.7, 0.0, 0.0], [0.0, 6.4, 0.0], [0.0, 0.0, 6.4]]",
                "Inertia about the mass centre, axes of `r3`; symmetric, as of a body.",
                "How fast the ring tilts and rolls under a contact at its rim.",
            ),
        ],
    },
    CONTACT,
    Group {
        tables: &[table("attenuation", Required, "What carries the active ring.")],
        keys: &[
            key(
                "default",
                Shape::Words(&ATTENUATION_NAMES),
                "\"characteristic\"",
                "The attenuation of a scenario that names none: six tables, six coupled screw legs, or \
                 none (the ring is a part of the chaser).",
                "A file may describe both tables and legs; one of them must be meant.",
            ),
            key(
                "damping_ramp_s",
                Shape::Number(Range::within(0.0, 100.0)),
                "0.2",
                "Time over which damping goes from its value before capture to that after it.",
                "0 makes it a step, at which the forces jump.",
            )
            .only("[attenuation.characteristic] or [attenuation.differential] is there"),
        ],
    },
    Group {
        tables: &[table(
            "attenuation.characteristic",
            Need::Optional("without it the attenuation `characteristic` cannot be chosen"),
            "Six independent force–displacement characteristics, one per axis of `e3`; Y and Z share one, \
             pitch and yaw share one (the paper, Fig. 6–9).",
        )],
        keys: &[],
    },
    Group {
        tables: &[
            table(
                "attenuation.characteristic.axial",
                Need::Where("[attenuation.characteristic] is there"),
                "Along X3; positive deflection is extension, toward the target.",
            ),
            table(
                "attenuation.characteristic.lateral",
                Need::Where("[attenuation.characteristic] is there"),
                "Across X3, alike in every direction: the deflection is the length of (Y, Z), so that \
                 only the positive travel counts.",
            ),
        ],
        keys: TRANSLATION,
    },
    Group {
        tables: &[
            table(
                "attenuation.characteristic.axial.series_brake",
                Need::Optional("without it spring and damper act alone"),
                "A friction brake in series with table and damper: it slips above its force and keeps \
                 what it has slipped.",
            ),
            table(
                "attenuation.characteristic.lateral.series_brake",
                Need::Optional("as in the axial channel"),
                "As in the axial channel.",
            ),
            table(
                "attenuation.differential.channels.series_brake",
                Need::Optional("as in the axial channel"),
                "As in the axial channel.",
            ),
        ],
        keys: &[
            key(
                "force_n",
                Shape::Number(Range::positive(1e8)),
                "2500.0",
                "Force above which the brake slips.",
                "Limits the force of the channel: the stroke times this force is the energy that it takes.",
            ),
            key(
                "viscous_n_s_m",
                Shape::Number(DAMPING),
                "500.0",
                "Viscous part while it slips; above 0 where the channel has no damping.",
                "Larger makes the force rise with the speed of slipping.",
            ),
        ],
    },
    Group {
        tables: &[
            table(
                "attenuation.characteristic.axial.backlash",
                Need::Optional("without it there is no play"),
                "Play between the ring and the element of spring, damper and brake: inside it the element \
                 does not act. Dry friction and end stops act beside it.",
            ),
            table(
                "attenuation.differential.channels.backlash",
                Need::Optional("as in the axial channel"),
                "As in the axial channel, of the brake coordinate.",
            ),
        ],
        keys: &[key(
            "width_m",
            Shape::Number(Range::positive(0.1)),
            "0.001",
            "Width of the play, from the element being pushed one way to its being pushed the other.",
            "The ring moves so far without force before the element takes the load, with a step of the \
             damper's force.",
        )],
    },
    Group {
        tables: &[
            table(
                "attenuation.characteristic.tilt",
                Need::Where("[attenuation.characteristic] is there"),
                "Pitch and yaw, alike in every direction: the deflection is the length of the rotation \
                 vector's (Y, Z), so that only the positive travel counts.",
            ),
            table(
                "attenuation.characteristic.roll",
                Need::Where("[attenuation.characteristic] is there"),
                "About X3, by the X component of the rotation vector.",
            ),
        ],
        keys: ROTATION,
    },
    Group {
        tables: &[
            table(
                "attenuation.characteristic.tilt.series_brake",
                Need::Optional("without it spring and damper act alone"),
                "A friction brake in series with table and damper.",
            ),
            table(
                "attenuation.characteristic.roll.series_brake",
                Need::Optional("without it spring and damper act alone"),
                "A friction brake in series with table and damper.",
            ),
        ],
        keys: &[
            key(
                "force_nm",
                Shape::Number(Range::positive(1e8)),
                "300.0",
                "Moment above which the brake slips.",
                "Limits the moment of the channel.",
            ),
            key(
                "viscous_nm_s_rad",
                Shape::Number(DAMPING),
                "50.0",
                "Viscous part while it slips; above 0 where the channel has no damping.",
                "Larger makes the moment rise with the rate of slipping.",
            ),
        ],
    },
    Group {
        tables: &[table(
            "attenuation.differential",
            Need::Optional("without it the attenuation `differential` cannot be chosen"),
            "Six screw legs between chaser and ring, coupled by differentials (the paper, 3.4): brake \
             coordinates are `coupling` times the legs' changes of length.",
        )],
        keys: &[
            key(
                "base_joints_m",
                Shape::Rows(Some(6), 3, Range::within(-5.0, 5.0)),
                "[[0.0, 0.512, 0.400], [0.0, 0.512, -0.400], …]",
                "Leg joints on the chaser, in `e3`.",
                "With the ring joints they are the directions of the legs, and so how far the axes are \
                 coupled.",
            ),
            key(
                "ring_joints_m",
                Shape::Rows(Some(6), 3, Range::within(-5.0, 5.0)),
                "[[0.0, 0.342, 0.468], [0.0, 0.342, -0.468], …]",
                "Leg joints on the ring, in `r3`, in the order of the base joints.",
                "Legs that are parallel or meet in one line do not hold the ring, and are refused.",
            ),
            key(
                "coupling",
                Shape::Rows(Some(6), 6, Range::within(-100.0, 100.0)),
                "[[0.1667, 0.1667, 0.1667, 0.1667, 0.1667, 0.1667], …]",
                "Rows: brake coordinates; columns: legs. Row 0 is the longitudinal coordinate.",
                "What the differentials do. A singular matrix leaves a motion without any brake, and is \
                 refused.",
            ),
        ],
    },
    Group {
        tables: &[tables(
            "attenuation.differential.channels",
            6,
            "One channel for every brake coordinate, in the order of the rows of `coupling`; force over \
             the coordinate in metres.",
        )],
        keys: TRANSLATION,
    },
    LATCHES,
    OWN_LATCHES,
    STICK,
    LIMITS,
    OUTCOME,
    SPREAD,
];

const SPREAD: Group = Group {
    tables: &[table(
        "spread",
        Need::Optional("without it no mechanism can be drawn (`--mechanism-draw`)"),
        "Half-widths within which the mechanism of an emulated rig is drawn away from the files of both \
         sides, uniformly. The loop goes on believing the files; a run is compared with the simulated system \
         that has the drawn mechanism.",
    )],
    keys: &[
        key(
            "contact_stiffness",
            PART,
            "0.2",
            "Of the stiffness of the contact law, relative.",
            "Peak of the first contacts.",
        ),
        key(
            "friction",
            PART,
            "0.5",
            "Of both friction coefficients together, relative.",
            "Whether petals slide on or jam.",
        ),
        key(
            "petal_rigidity",
            PART,
            "0.3",
            "Of the flexural rigidity of the petals, one draw a side, relative.",
            "Stiffness of contacts near the tips.",
        ),
        key(
            "attenuator_curves",
            PART,
            "0.15",
            "Of the forces of loading and unloading curves together, one draw a channel, relative.",
            "Springs as built and as set.",
        ),
        key(
            "brake",
            PART,
            "0.1",
            "Of the holding force of the series brakes, one draw a brake, relative.",
            "Largest force of the channel.",
        ),
        key(
            "ring_mass",
            PART,
            "0.05",
            "Of mass and inertia of the active ring together, relative.",
            "Mass as built; its weight on the rig.",
        ),
        key(
            "position_fine_m",
            POSITION,
            "0.0003",
            "Of the places of petals and latches and of both mounting planes on the rig along each axis, well \
             aligned. A mount is turned about each axis by as much at the ring's mean radius.",
            "The grade of `--mechanism-grade fine`.",
        ),
        key(
            "position_coarse_m",
            POSITION,
            "0.001",
            "The same, coarsely aligned; not below the fine grade.",
            "The grade of `--mechanism-grade coarse`.",
        ),
    ],
};

const CONTACT: Group = Group {
    tables: &[table(
        "contact",
        Required,
        "The law of contact, one for every pair of surfaces at one place of contact. A scenario may \
         override each of its keys. Laws: [physics-notes.md](physics-notes.md).",
    )],
    keys: &[
        key(
            "normal_law",
            Shape::Words(&NORMAL_LAW_NAMES),
            "\"hunt_crossley\"",
            "F = k δⁿ (1 + a δ') (Hunt and Crossley 1975), or F = k δ + c δ' (Kelvin–Voigt); neither pulls.",
            "Hunt–Crossley begins and ends without a step of force; Kelvin–Voigt is there for comparison.",
        ),
        key(
            "stiffness_n_m",
            Shape::Number(contact::STIFFNESS),
            "1000000.0",
            "k, N/m (N/mⁿ with an exponent n).",
            "The peak of a first contact goes with its square root. Larger needs smaller steps.",
        ),
        key(
            "exponent",
            Shape::Number(contact::EXPONENT),
            "1.0",
            "n: 1 is linear, 1.5 that of Hertz for two balls.",
            "Decides how the stiffness grows with depth.",
        )
        .only("normal_law = \"hunt_crossley\""),
        key(
            "damping_s_m",
            Shape::Number(contact::DAMPING_S_M),
            "1.0",
            "a, s/m.",
            "0 makes contact elastic; with the closing speed it gives the restitution.",
        )
        .only("normal_law = \"hunt_crossley\""),
        key(
            "damping_n_s_m",
            Shape::Number(contact::DAMPING_N_S_M),
            "4000.0",
            "c, N·s/m.",
            "0 makes contact elastic; larger begins every contact with a larger step of force.",
        )
        .only("normal_law = \"kelvin_voigt\""),
        key(
            "friction_kinetic",
            Shape::Number(contact::FRICTION),
            "0.1",
            "Kinetic friction coefficient.",
            "0 switches friction off. Larger makes petals jam rather than slide.",
        ),
        key(
            "friction_static",
            Shape::Number(contact::FRICTION),
            "0.1",
            "Static friction coefficient, at least the kinetic one.",
            "What holds until sliding begins.",
        ),
        key(
            "stribeck_velocity_m_s",
            Shape::Number(contact::STRIBECK_VELOCITY),
            "0.003",
            "Sliding speed at which the static coefficient has faded to 1/e of its excess.",
            "Without effect where both coefficients are equal, but for the damping of the bristle.",
        ),
        key(
            "bristle_breakaway_m",
            Shape::Number(contact::BRISTLE_BREAKAWAY),
            "0.0003",
            "Displacement over which sticking gives way to sliding.",
            "Smaller is nearer to ideal Coulomb friction, and needs smaller steps.",
        ),
        key(
            "bristle_damping_s",
            Shape::Number(contact::BRISTLE_DAMPING),
            "0.002",
            "Time constant of the damping while a contact sticks.",
            "0 lets a stuck contact swing; it fades as sliding begins.",
        ),
        key(
            "merge_depth_m",
            Shape::Number(contact::MERGE_DEPTH),
            "5e-5",
            "Width within which neighbouring depths of two rings merge smoothly into one.",
            "Rings that lie flat on each other are up to 1/27 of it less deep than the exact ones. Smaller is \
             nearer to the exact surface and less smooth.",
        ),
    ],
};

const TRANSLATION: &[Key] = &[
    key(
        "loading_n_over_m",
        Shape::Rows(None, 2, CURVE),
        "[[0.0, 0.0], [0.15, 45000.0]]",
        "Force over deflection while the deflection grows, as points [m, N]; linear between them, \
         extended with the last slope. Begins at deflection 0 and rises.",
        "The spring of the channel. A first force above 0 is a preload.",
    ),
    key(
        "unloading_n_over_m",
        Shape::Rows(None, 2, CURVE),
        "[[0.0, 0.0], [0.15, 45000.0]]",
        "The same while the deflection falls; nowhere above the loading branch.",
        "The mean of both branches is stored, the area between them is lost in one cycle.",
    ),
    key(
        "branch_change_m",
        Shape::Number(Range::positive(1.0)),
        "0.001",
        "Displacement over which the force goes from one branch to the other after a reversal.",
        "Without effect while both branches agree. Very small needs smaller steps.",
    ),
    key(
        "damping_before_capture_n_s_m",
        Shape::Number(DAMPING),
        "4000.0",
        "Viscous damping until all latches have caught.",
        "In the soft directions several hundred N·s/m already spoil slow captures.",
    ),
    key(
        "damping_after_capture_n_s_m",
        Shape::Number(DAMPING),
        "4000.0",
        "Viscous damping after capture.",
        "Larger ends the relative motion sooner.",
    ),
    key(
        "dry_friction_n",
        Shape::Number(FORCE),
        "250.0",
        "Dry friction beside everything else.",
        "What the channel holds at rest; 0 for none.",
    ),
    key(
        "travel_negative_m",
        Shape::Number(Range::within(0.0, 5.0)),
        "0.15",
        "Travel in the negative direction (axially: compression), to the end stop.",
        "Beyond it the stop pushes, beyond `limits.overtravel_m` more the run ends.",
    ),
    key(
        "travel_positive_m",
        Shape::Number(Range::within(0.0, 5.0)),
        "0.01",
        "Travel in the positive direction (axially: extension), to the end stop.",
        "As the negative travel.",
    ),
    key(
        "stop_stiffness_n_m",
        Shape::Number(STIFFNESS),
        "1000000.0",
        "Stiffness of the end stops.",
        "Larger gives harder blows at the end of the travel.",
    ),
    key(
        "stop_damping_n_s_m",
        Shape::Number(DAMPING),
        "2000.0",
        "Damping of the end stops, reached over the first millimetre of overtravel.",
        "0 makes the stops elastic.",
    ),
];

const ROTATION: &[Key] = &[
    key(
        "loading_nm_over_rad",
        Shape::Rows(None, 2, CURVE),
        "[[0.0, 0.0], [0.2, 200.0]]",
        "Moment over deflection while the deflection grows, as points [rad, N·m] (radians, while \
         travels are degrees); linear between them, extended with the last slope.",
        "The spring of the channel.",
    ),
    key(
        "unloading_nm_over_rad",
        Shape::Rows(None, 2, CURVE),
        "[[0.0, 0.0], [0.2, 200.0]]",
        "The same while the deflection falls; nowhere above the loading branch.",
        "The mean of both branches is stored, the area between them is lost in one cycle.",
    ),
    key(
        "branch_change_deg",
        Shape::Number(Range::positive(90.0)),
        "0.1",
        "Rotation over which the moment goes from one branch to the other after a reversal.",
        "Without effect while both branches agree.",
    ),
    key(
        "damping_before_capture_nm_s_rad",
        Shape::Number(DAMPING),
        "60.0",
        "Viscous damping until all latches have caught.",
        "Small, so that the ring can turn to the other side.",
    ),
    key(
        "damping_after_capture_nm_s_rad",
        Shape::Number(DAMPING),
        "2500.0",
        "Viscous damping after capture.",
        "Larger ends the relative rotation sooner.",
    ),
    key(
        "dry_friction_nm",
        Shape::Number(FORCE),
        "0.0",
        "Dry friction beside everything else.",
        "What the channel holds at rest; 0 for none.",
    ),
    key(
        "travel_negative_deg",
        Shape::Number(Range::within(0.0, 90.0)),
        "10.0",
        "Travel in the negative direction, to the end stop.",
        "Beyond it the stop pushes, beyond `limits.overtravel_m` (at the ring's radius) the run ends.",
    ),
    key(
        "travel_positive_deg",
        Shape::Number(Range::within(0.0, 90.0)),
        "10.0",
        "Travel in the positive direction, to the end stop.",
        "As the negative travel.",
    ),
    key(
        "stop_stiffness_nm_rad",
        Shape::Number(STIFFNESS),
        "50000.0",
        "Stiffness of the end stops.",
        "Larger gives harder blows at the end of the travel.",
    ),
    key(
        "stop_damping_nm_s_rad",
        Shape::Number(DAMPING),
        "1000.0",
        "Damping of the end stops, reached over the first milliradian of overtravel.",
        "0 makes the stops elastic.",
    ),
];

const LATCHES: Group = Group {
    tables: &[table(
        "latches",
        Need::Optional("without it nothing can be captured"),
        "Three capture latches on the active ring, and their strikers on the passive ring at the points \
         that meet when docked. Gaps are those of a striker against its latch, in the axes that `axes` names: \
         axial along X, radial and tangential at the latch's azimuth.",
    )],
    keys: &[
        key(
            "azimuths_deg",
            Shape::List(3, Range::within(-360.0, 360.0)),
            "[0.0, 120.0, 240.0]",
            "Azimuths of the latches in `r3`, from +Y toward +Z; 30° or more apart. A latch is a point of the active \
             ring's face; its striker is the point of the passive ring's face that it meets when docked.",
            "A latch must not stand where a petal of the passive side does when docked.",
        ),
        key(
            "axes",
            Shape::Words(&LATCH_AXES_NAMES),
            "\"active\"",
            "In whose axes the gaps and the zone of a latch are measured, and along whose X it pulls: those of the \
             active ring, `r3`, or those of the passive ring, with X from chaser to target. The pull acts at the \
             point of the other ring: at the striker, or at the latch.",
            "Where rings meet tilted, a gap in the axes of one is longer or shorter than in those of the other, by \
             the tilt times the offset: it decides which latch catches first.",
        )
        .optional("`active`"),
        key(
            "approach_gap_m",
            Shape::Number(LENGTH),
            "0.05",
            "Axial gap below which a latch counts as approached, in a zone four times as wide.",
            "Only an event in the record. At least `strike_gap_m`.",
        ),
        key(
            "strike_gap_m",
            Shape::Number(LENGTH),
            "0.006",
            "Axial gap below which a latch is struck.",
            "Only an event in the record. At least `catch_gap_m`.",
        ),
        key(
            "catch_gap_m",
            Shape::Number(LENGTH),
            "0.003",
            "Axial gap at or below which a latch catches.",
            "Larger captures sooner. All three caught is capture.",
        ),
        key(
            "catch_delay_s",
            Shape::Number(Range::within(0.0, 10.0)),
            "0.02",
            "Time for which a striker must have stayed within the catch gap and the zones before the latch \
             catches.",
            "A latch with a drive, a damper or a slow spring. One that leaves before is not caught, and the \
             time begins anew.",
        )
        .optional("without it a latch catches at once"),
        key(
            "radial_zone_m",
            Shape::Number(LENGTH),
            "0.01",
            "Half-width of the zone in which it is struck and catches, radially.",
            "How far off centre the rings may still be.",
        ),
        key(
            "tangential_zone_m",
            Shape::Number(LENGTH),
            "0.06",
            "Half-width of the zone in which it is struck and catches, along the ring.",
            "At the ring's radius it is the roll within which the latches catch: not below the roll play \
             of the petals.",
        ),
        key(
            "hold_stiffness_n_m",
            Shape::Number(STIFFNESS),
            "1000000.0",
            "Tension stiffness of one caught latch beyond the catch gap.",
            "What holds before all three have caught.",
        ),
        key(
            "joined_stiffness_n_m",
            Shape::Number(STIFFNESS),
            "1000000.0",
            "Stiffness of the joined rings, all three points together; each has a third.",
            "Larger makes the joined rings stiffer, and needs smaller steps.",
        ),
        key(
            "joined_damping_n_s_m",
            Shape::Number(Range::within(0.0, 1e8)),
            "1500.0",
            "Damping of each of the three points.",
            "0 lets the joined rings swing.",
        ),
    ],
};

const OWN_LATCHES: Group = Group {
    tables: &[any_number(
        "latch",
        "the three latches of [latches], or none",
        "Latches with places and zones of their own, at most 12, instead of [latches]. The gap of a latch is its striker less \
         itself in `r3`: along X, and across X. A caught latch pulls along X of `r3`; from capture on each caught latch \
         holds its striker in every direction, beginning with the force of that instant, and contact goes on.",
    )],
    keys: &[
        key(
            "name",
            Shape::Text("text, unlike that of any other latch"),
            "\"socket\"",
            "Name by which `captured_when` means it.",
            "Recorded signals count latches in the order of the file.",
        ),
        key(
            "latch_m",
            Shape::List(3, Range::within(-10.0, 10.0)),
            "[0.4, 0.0, 0.0]",
            "Place of the latch in `r3`.",
            "Its forces act at the striker, in the axes of `r3`.",
        ),
        key(
            "striker_m",
            Shape::List(3, Range::within(-10.0, 10.0)),
            "[-0.4, 0.0, 0.0]",
            "Place of its striker in `r4`, whose +X points toward the active side.",
            "Where it meets the latch the gap is zero.",
        ),
        key(
            "approach_gap_m",
            Shape::Number(LENGTH),
            "0.05",
            "Gap along X below which it counts as approached, in a zone four times as wide.",
            "Only an event in the record. At least `strike_gap_m`.",
        ),
        key(
            "strike_gap_m",
            Shape::Number(LENGTH),
            "0.006",
            "Gap along X below which it is struck.",
            "Only an event in the record. At least `catch_gap_m`.",
        ),
        key(
            "catch_gap_m",
            Shape::Number(LENGTH),
            "0.003",
            "Gap along X at or below which it catches.",
            "Larger captures sooner.",
        ),
        key(
            "lateral_zone_m",
            Shape::Number(LENGTH),
            "0.01",
            "Radius of the zone across X in which it is struck and catches.",
            "How far off centre it still catches.",
        ),
        key(
            "angle_zone_deg",
            Shape::Number(Range::positive(180.0)),
            "20.0",
            "Largest angle between X of `r3` and X of `e4` at which it is struck and catches.",
            "How far out of line it still catches.",
        ),
        key(
            "hold_stiffness_n_m",
            Shape::Number(STIFFNESS),
            "1000000.0",
            "Tension stiffness of the caught latch beyond the catch gap.",
            "What holds before capture.",
        ),
        key(
            "joined_stiffness_n_m",
            Shape::Number(STIFFNESS),
            "1000000.0",
            "Stiffness of the striker in the latch in every direction from capture on.",
            "Larger needs smaller steps.",
        ),
        key(
            "joined_damping_n_s_m",
            Shape::Number(Range::within(0.0, 1e8)),
            "1500.0",
            "Damping of the same.",
            "0 lets it swing.",
        ),
    ],
};

const STICK: Group = Group {
    tables: &[table(
        "stick",
        Need::Optional("without it rings and petals touch, as in a docking mechanism"),
        "The spring stick of the validation test (the paper, 7.4): a rod in a frame. With it the \
         surfaces of rings and petals do not touch.",
    )],
    keys: &[
        key(
            "stiffness_n_m",
            Shape::Number(Range::positive(1e9)),
            "35400.0",
            "K of (14).",
            "With the reduced mass it is the frequency of a row of Table 4.",
        ),
        key(
            "diameter_m",
            Shape::Number(Range::positive(0.5)),
            "0.0075",
            "Diameter d of the rod.",
            "Free play is (h − d)/2 to either side.",
        ),
        key(
            "frame_opening_m",
            Shape::Number(Range::positive(1.0)),
            "0.0275",
            "Opening h of the frame; above the diameter.",
            "As the diameter.",
        ),
        key(
            "lever_m",
            Shape::Number(Range::positive(10.0)),
            "0.5",
            "Lever r with which rotations count: stiffness K r², play (h − d)/(2 r).",
            "With inertia m r² the frequencies of rotations are those of translations.",
        ),
    ],
};

const LIMITS: Group = Group {
    tables: &[table(
        "limits",
        Required,
        "Passing one of these ends a run as `limit_exceeded`. Loads are those on the passive side about \
         its ring centre, in `e4`: pushed along +X4 is compression.",
    )],
    keys: &[
        key(
            "tension_n",
            Shape::Number(LOAD),
            "3900.0",
            "Force along −X4.",
            "What the latches bear.",
        ),
        key(
            "compression_n",
            Shape::Number(LOAD),
            "6500.0",
            "Force along +X4.",
            "What rings and attenuator bear. The supervisor of `hil` stops at 1.2 times the largest of the \
             three forces unless told otherwise.",
        ),
        key("shear_n", Shape::Number(LOAD), "3200.0", "Force across X4.", "As compression."),
        key("torsion_nm", Shape::Number(LOAD), "1500.0", "Moment about X4.", "As compression."),
        key("bending_nm", Shape::Number(LOAD), "2800.0", "Moment across X4.", "As compression."),
        key(
            "depth_m",
            Shape::Number(Range::positive(10.0)),
            "0.04",
            "Deepest contact; at most 0.04 where a side has a ring or petals, and below the rounding of both surfaces of every \
             listed pair together.",
            "Beyond 40 mm the normals of rings and petals are not to be believed.",
        ),
        key(
            "overtravel_m",
            Shape::Number(Range::positive(5.0)),
            "0.05",
            "How far a channel of the attenuator may be pushed beyond its travel; rotations count at the \
             ring's mean radius.",
            "Beyond it the attenuator is broken, not attenuating.",
        ),
    ],
};

const OUTCOME: Group = Group {
    tables: &[table("outcome", Required, "Thresholds by which a run is judged.")],
    keys: &[
        key(
            "guided_radius_m",
            Shape::Number(Range::positive(5.0)),
            "0.1",
            "Distance sideways of the ring centres within which the petals guide.",
            "Outside it at closest approach a docking is `missed`, whatever touched.",
        ),
        key(
            "settled_speed_m_s",
            Shape::Number(Range::positive(1.0)),
            "0.005",
            "Relative speed of the ports below which attenuation has ended, or a contact is slow.",
            "Together with the rate it decides `jammed` and the end of attenuation.",
        ),
        key(
            "settled_rate_deg_s",
            Shape::Number(Range::positive(60.0)),
            "0.1",
            "Relative rate below which attenuation has ended, or a contact is slow.",
            "As the speed.",
        ),
        key(
            "jam_time_s",
            Shape::Number(Range::positive(1e4)),
            "10.0",
            "Time with one or two latches caught, or in slow contact, after which a docking is jammed.",
            "Shorter calls a slow capture jammed.",
        ),
    ],
};

// The passive side -----------------------------------------------------------------------------

pub(super) const PASSIVE: &[Group] = &[
    Group {
        tables: &[table("", Required, "The file itself.")],
        keys: &[SCHEMA, kind(&["mechanism_passive"], "\"mechanism_passive\"")],
    },
    Group {
        tables: &[table("placement", Required, "Where the ring stands.")],
        keys: &[
            REFERENCE_RADIUS,
            key(
                "passive_ring_offset_m",
                Shape::Number(Range::within(0.0, 2.0)),
                "0.1",
                "Distance along −X4 from the mounting plane `e4` to the ring's centre circle.",
                "Origin of `r4`, and part of the docked length. The joint of the URDF's link `ring` must stand \
             there, turned by 180° about Z.",
            ),
        ],
    },
    RING,
    PETALS,
    SURFACES,
];
