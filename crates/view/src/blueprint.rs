//! The layout stored in the recording.
//!
//! Written archetype by archetype: the builder of rerun 0.36 (`rerun::blueprint`) has no way to give
//! a 3-D view its eye, its background or its grid.

use docktwin_core::{DVec3, StateHasher};
use re_chunk::ChunkError;
use re_sdk_types::AsComponents;
use re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EntityBehavior, EyeControls3D, LineGrid3D, PanelBlueprint,
    PlotLegend, TextLogColumns, TimeAxis, TimePanelBlueprint, ViewBlueprint, ViewContents,
    ViewportBlueprint,
};
use re_sdk_types::blueprint::components::{
    BackgroundKind, ColumnShare, ContainerKind, Corner2D, Eye3DKind, IncludedContent, LinkAxis,
    PanelState, PlayState, RootContainer, RowShare, TextLogColumn, TimelineColumn,
};
use re_sdk_types::blueprint::datatypes as bp_datatypes;

use crate::eye::Eye;
use crate::mesh::f32x3;
use crate::paths;
use crate::stream::{self, Sent, Stream};

/// Where a view keeps what it does with one entity; hulls would catch every click.
const CHASER_HULL: &str = "ViewContents/overrides/scene/chaser/hull/visualizers";
const TARGET_HULL: &str = "ViewContents/overrides/scene/target/hull/visualizers";
const REACHABLE: &str = "ViewContents/overrides/rig/reachable/hull/visualizers";

enum Node {
    View {
        class: &'static str,
        name: &'static str,
        origin: &'static str,
        /// What of the origin is not shown.
        without: Vec<&'static str>,
        properties: Vec<(&'static str, Box<dyn AsComponents>)>,
    },
    Container {
        kind: ContainerKind,
        name: &'static str,
        shares: Vec<f32>,
        children: Vec<Node>,
    },
}

/// A plot of three axes in their usual colours needs no legend, which would hide half of it.
fn axes_plot(name: &'static str, origin: &'static str) -> Node {
    plot(name, origin, PlotLegend::new().with_visible(false))
}

fn plot(name: &'static str, origin: &'static str, legend: PlotLegend) -> Node {
    Node::View {
        class: "TimeSeries",
        name,
        origin,
        without: vec![],
        properties: vec![
            ("PlotLegend", Box::new(legend)),
            ("TimeAxis", Box::new(TimeAxis::new().with_link(LinkAxis::LinkToGlobal))),
        ],
    }
}

fn legend() -> PlotLegend {
    PlotLegend::new().with_corner(Corner2D::RightTop)
}

fn row(children: Vec<Node>) -> Node {
    Node::Container { kind: ContainerKind::Horizontal, name: "", shares: vec![], children }
}

/// A 3-D view. `behind`: what would catch every click, being large and in front.
fn space(
    name: &'static str,
    origin: &'static str,
    [position, target, up]: [DVec3; 3],
    without: Vec<&'static str>,
    behind: &[&'static str],
) -> Node {
    let mut properties: Vec<(&'static str, Box<dyn AsComponents>)> = vec![
        (
            "EyeControls3D",
            Box::new(
                EyeControls3D::new()
                    .with_kind(Eye3DKind::Orbital)
                    .with_position(f32x3(position))
                    .with_look_target(f32x3(target))
                    .with_eye_up(f32x3(up)),
            ),
        ),
        (
            "Background",
            Box::new(Background::new(BackgroundKind::SolidColor).with_color(0x14_18_1E_FF)),
        ),
        ("LineGrid3D", Box::new(LineGrid3D::new().with_visible(false))),
    ];
    for path in behind {
        properties.push((path, Box::new(EntityBehavior::update_fields().with_interactive(false))));
    }
    Node::View { class: "3D", name, origin, without, properties }
}

/// A 3-D view of the docking.
fn scene(name: &'static str, eye: &Eye, without: Vec<&'static str>) -> Node {
    let look = [eye.position, eye.target, DVec3::Z];
    space(name, paths::SCENE, look, without, &[CHASER_HULL, TARGET_HULL])
}

/// The layout of a motion simulator, looked at from `position` to `target` with +X up.
pub(crate) fn rig(position: DVec3, target: DVec3) -> Layout {
    Layout(Node::Container {
        kind: ContainerKind::Horizontal,
        name: "docktwin",
        shares: vec![3.0, 2.0],
        children: vec![
            space(
                "Motion simulator (+X up)",
                paths::RIG,
                [position, target, DVec3::X],
                vec![],
                &[REACHABLE],
            ),
            Node::Container {
                kind: ContainerKind::Vertical,
                name: "",
                shares: vec![3.0, 3.0, 2.0],
                children: vec![
                    plot("Room of each leg to its nearer end, m", paths::RIG_ROOM, legend()),
                    plot("Force of each leg, kN (pushing positive)", paths::RIG_FORCE, legend()),
                    text("Where it is", paths::RIG_TEXT),
                ],
            },
        ],
    })
}

fn text(name: &'static str, origin: &'static str) -> Node {
    Node::View { class: "TextDocument", name, origin, without: vec![], properties: vec![] }
}

/// What the layout depends on.
pub(crate) struct Look {
    /// From the side.
    pub(crate) eye: Eye,
    /// Along the docking axis.
    pub(crate) face_on: Eye,
    /// Whether two runs are shown.
    pub(crate) compared: bool,
    /// Whether figures of fidelity come at the end.
    pub(crate) with_rig: bool,
}

/// A whole layout.
pub(crate) struct Layout(Node);

/// The layout of a docking.
pub(crate) fn docking(look: &Look) -> Layout {
    let oblique =
        scene("Mechanism, seen from the chaser's port e3", &look.eye, vec!["/scene/face/**"]);
    let face_on = scene(
        "Along the docking axis, from the chaser",
        &look.face_on,
        vec![
            "/scene/labels/**",
            "/scene/legend/**",
            "/scene/chaser/**",
            "/scene/attenuator_legs/**",
            "/scene/target/hull/**",
            // Without labels, arrows of the past would be taken for those of now.
            "/scene/active_ring/peaks",
        ],
    );
    let table = if look.compared {
        tabs(vec![text("Contacts of A", paths::TABLE), text("Contacts of B", paths::GHOST_TABLE)])
    } else if look.with_rig {
        tabs(vec![
            text("Contacts", paths::TABLE),
            text("Against the simulated system", paths::FIDELITY),
        ])
    } else {
        text("Contacts", paths::TABLE)
    };
    Layout(Node::Container {
        kind: ContainerKind::Horizontal,
        name: "docktwin",
        shares: vec![3.0, 2.0],
        children: vec![
            Node::Container {
                kind: ContainerKind::Vertical,
                name: "",
                shares: vec![11.0, 9.0],
                children: vec![
                    oblique,
                    Node::Container {
                        kind: ContainerKind::Horizontal,
                        name: "",
                        shares: vec![1.0, 1.0],
                        children: vec![
                            face_on,
                            Node::Container {
                                kind: ContainerKind::Vertical,
                                name: "",
                                shares: vec![3.0, 2.0],
                                children: vec![table, log()],
                            },
                        ],
                    },
                ],
            },
            plots(),
        ],
    })
}

/// What happened, without the viewer's own columns.
fn log() -> Node {
    Node::View {
        class: "TextLog",
        name: "Events",
        origin: paths::EVENTS,
        without: vec![],
        properties: vec![(
            "TextLogColumns",
            Box::new(
                TextLogColumns::new()
                    .with_timeline_columns([TimelineColumn(bp_datatypes::TimelineColumn {
                        timeline: paths::TIMELINE.into(),
                        // Every text begins with its time.
                        visible: false.into(),
                    })])
                    .with_text_log_columns([text_log_column(
                        bp_datatypes::TextLogColumnKind::Body,
                    )]),
            ),
        )],
    }
}

/// Forces, gaps, motion, ring, energy and latches over time.
fn plots() -> Node {
    Node::Container {
        kind: ContainerKind::Vertical,
        name: "",
        shares: vec![1.2, 1.1, 1.0, 1.0, 1.5, 1.2],
        children: vec![
            row(vec![
                axes_plot("Force at e3, N (white: Σ contact)", paths::PORT_FORCE),
                axes_plot("Moment at e3, N·m", paths::PORT_MOMENT),
            ]),
            row(vec![
                plot("Gap of petals A1 A2 A3, mm", paths::GAP_ACTIVE, legend()),
                plot("Gap of petals P1' P2' P3', mm", paths::GAP_PASSIVE, legend()),
            ]),
            row(vec![
                tabs(vec![
                    axes_plot("Position, m (X Y Z = r g b)", paths::POSITION),
                    axes_plot("Velocity, m/s", paths::VELOCITY),
                ]),
                tabs(vec![
                    axes_plot("Attitude, ° (roll pitch yaw)", paths::ATTITUDE),
                    axes_plot("Rate, °/s", paths::RATE),
                ]),
            ]),
            row(vec![
                axes_plot("Ring deflection, mm", paths::RING_DEFLECTION),
                axes_plot("Ring tilt, ° (roll pitch yaw)", paths::RING_TILT),
            ]),
            row(vec![
                plot("Energy, J", paths::ENERGY, legend()),
                plot("Latch gaps, mm", paths::LATCH_GAP, legend()),
            ]),
            latches(),
        ],
    }
}

fn latches() -> Node {
    Node::View {
        class: "StateTimeline",
        name: "Latch states",
        origin: paths::LATCH_STATES,
        without: vec![],
        properties: vec![("TimeAxis", Box::new(TimeAxis::new().with_link(LinkAxis::LinkToGlobal)))],
    }
}

fn tabs(children: Vec<Node>) -> Node {
    Node::Container { kind: ContainerKind::Tabs, name: "", shares: vec![], children }
}

fn text_log_column(kind: bp_datatypes::TextLogColumnKind) -> TextLogColumn {
    TextLogColumn(bp_datatypes::TextLogColumn { kind, visible: true.into() })
}

/// Names a part of the layout by its place and what it is. The viewer keeps a user's last layout and
/// the state of its views by these names: a view of another kind must not inherit one.
fn uuid(number: u32, what: &str) -> (String, [u8; 16]) {
    let mut h = StateHasher::new();
    h.u64(number.into());
    h.bytes(what.as_bytes());
    let bytes = h.finish().0;
    let hex: String = bytes.iter().map(|b| format!("{b:02x}")).collect();
    let text = [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]].join("-");
    (text, bytes)
}

impl Node {
    /// Logs the part and what it holds; gives its path and id.
    fn log(&self, rec: &stream::Layout, next: &mut u32) -> Result<(String, [u8; 16]), ChunkError> {
        let (id, bytes) = match self {
            Self::View { class, name, origin, .. } => {
                uuid(*next, &format!("{class} {name} {origin}"))
            }
            Self::Container { kind, name, .. } => uuid(*next, &format!("{kind:?} {name}")),
        };
        *next += 1;
        let path = match self {
            Self::View { class, name, origin, without, properties } => {
                let path = format!("view/{id}");
                let mut shown = vec!["+ $origin/**".to_owned()];
                shown.extend(without.iter().map(|w| format!("- {w}")));
                rec.log(format!("{path}/ViewContents"), &ViewContents::new(shown))?;
                rec.log(
                    path.as_str(),
                    &ViewBlueprint::new(*class).with_display_name(*name).with_space_origin(*origin),
                )?;
                for (property, value) in properties {
                    rec.log(format!("{path}/{property}"), value.as_ref())?;
                }
                path
            }
            Self::Container { kind, name, shares, children } => {
                let path = format!("container/{id}");
                let mut contents = Vec::new();
                for child in children {
                    contents.push(IncludedContent(child.log(rec, next)?.0.into()));
                }
                let mut container = ContainerBlueprint::new(*kind).with_contents(contents);
                if !name.is_empty() {
                    container = container.with_display_name(*name);
                }
                container = match kind {
                    ContainerKind::Vertical => {
                        container.with_row_shares(shares.iter().map(|s| RowShare::from(*s)))
                    }
                    _ => container.with_col_shares(shares.iter().map(|s| ColumnShare::from(*s))),
                };
                rec.log(path.as_str(), &container)?;
                path
            }
        };
        Ok((path, bytes))
    }
}

/// Stores the layout in the recording and makes it the active one.
pub(crate) fn send(rec: &Stream, layout: &Layout) -> Sent {
    rec.layout(|rec| {
        let (_, root) = layout.0.log(rec, &mut 0)?;
        rec.log(
            "viewport",
            &ViewportBlueprint::new()
                .with_root_container(RootContainer(root.into()))
                .with_auto_layout(false)
                .with_auto_views(false),
        )?;
        for panel in ["blueprint_panel", "selection_panel"] {
            rec.log(panel, &PanelBlueprint::new().with_state(PanelState::Collapsed))?;
        }
        rec.log(
            "time_panel",
            &TimePanelBlueprint::new()
                .with_state(PanelState::Collapsed)
                .with_timeline(paths::TIMELINE)
                // Opens at the end, where peaks and trace sum up the run.
                .with_play_state(PlayState::Following),
        )
    })
}
