//! Keys of the TOML beside a spacecraft's URDF.

use super::{Group, Key, Need::Required, SCHEMA, Shape, key, table};
use crate::toml_check::Range;

const KIND: Key = key(
    "kind",
    Shape::Words(&["spacecraft"]),
    "\"spacecraft\"",
    "What the file describes.",
    "Decides which keys are read; `model check` finds the loader by it.",
);

pub(super) const SPACECRAFT: &[Group] = &[
    Group {
        tables: &[table("", Required, "The file itself.")],
        keys: &[
            SCHEMA,
            KIND,
            key(
                "port_link",
                Shape::Text("name of a link of the URDF"),
                "\"port\"",
                "Link whose frame is the mounting plane of the docking mechanism: `e3` of a chaser, `e4` \
                 of a target; +X from chaser to target.",
                "Everything between the spacecraft acts there: it is the lever of every contact force.",
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
            key(
                "mass_kg",
                Shape::Note,
                "{ source = \"mass budget, issue 4, less the docking ring\" }",
                "Where the masses of all links come from.",
                "A chaser's mass is without the docking ring, which is a body of its own: the note is the \
                 place to say so.",
            ),
            key(
                "inertia_kg_m2",
                Shape::Note,
                "{ source = \"mass budget, issue 4\" }",
                "Where the inertias of all links come from.",
                "Inertia decides how far an off-centre contact turns the spacecraft; CAD exports it in \
                 kg·mm² as often as in kg·m².",
            ),
            key(
                "com_m",
                Shape::Note,
                "{ assumed = \"the body frame stands at the mass centre\" }",
                "Where the mass centres come from.",
                "The lever from the mass centre to the port.",
            ),
            key(
                "port",
                Shape::Note,
                "{ source = \"interface drawing\" }",
                "Where the placement of the port comes from.",
                "As above: a port in millimetres makes levers a thousand times too long.",
            ),
        ],
    },
    Group {
        tables: &[table(
            "hull",
            Required,
            "The cylinder that viewers draw, along X about the origin of the root link. No physics.",
        )],
        keys: &[
            key(
                "radius_m",
                Shape::Number(Range::positive(50.0)),
                "1.35",
                "Radius of the cylinder.",
                "`cargo xtask meshes` makes the hull's mesh from it.",
            ),
            key(
                "length_m",
                Shape::Number(Range::positive(500.0)),
                "7.0",
                "Length of the cylinder.",
                "As the radius.",
            ),
        ],
    },
];
