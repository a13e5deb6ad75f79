//! Entity paths of the recording, and its timeline. Everything under [`SCENE`] is in `e3`.

/// Simulated time since the start of the run.
pub(crate) const TIMELINE: &str = "sim_time";
pub(crate) const SCENE: &str = "scene";
pub(crate) const CHASER: &str = "scene/chaser";
pub(crate) const TARGET: &str = "scene/target";
/// The frame `r3`.
pub(crate) const ACTIVE: &str = "scene/active_ring";
/// The frame `r4`.
pub(crate) const PASSIVE: &str = "scene/target/passive_ring";
pub(crate) const LATCHES: &str = "scene/active_ring/latches";
pub(crate) const TRACE: &str = "scene/active_ring/trace";
pub(crate) const PEAKS: &str = "scene/active_ring/peaks";
pub(crate) const LEGS: &str = "scene/attenuator_legs";
pub(crate) const CONTACTS: &str = "scene/contacts";
pub(crate) const LABELS: &str = "scene/labels";
pub(crate) const LEGEND: &str = "scene/legend";
/// Labels of the view along the docking axis.
pub(crate) const FACE_LABELS: &str = "scene/face/labels";

/// The motion simulator, in `eb`.
pub(crate) const RIG: &str = "rig";
pub(crate) const RIG_PLATE: &str = "rig/plate";
pub(crate) const RIG_CYLINDERS: &str = "rig/cylinders";
pub(crate) const RIG_RODS: &str = "rig/rods";
pub(crate) const RIG_REACHABLE: &str = "rig/reachable";
pub(crate) const RIG_DOCKING: &str = "rig/docking_workspace";
pub(crate) const RIG_WAY: &str = "rig/way";
pub(crate) const RIG_ROOM: &str = "leg/room";
pub(crate) const RIG_FORCE: &str = "leg/force";
pub(crate) const RIG_TEXT: &str = "rig_state";

pub(crate) const PORT_FORCE: &str = "port/force";
pub(crate) const PORT_MOMENT: &str = "port/moment";
pub(crate) const POSITION: &str = "relative/position";
pub(crate) const ATTITUDE: &str = "relative/attitude";
pub(crate) const VELOCITY: &str = "relative/velocity";
pub(crate) const RATE: &str = "relative/rate";
pub(crate) const RING_DEFLECTION: &str = "ring/deflection";
pub(crate) const RING_TILT: &str = "ring/tilt";
pub(crate) const ENERGY: &str = "energy";
pub(crate) const LATCH_GAP: &str = "latch/gap";
pub(crate) const GAP_ACTIVE: &str = "petal_gap/active";
pub(crate) const GAP_PASSIVE: &str = "petal_gap/passive";
pub(crate) const LATCH_STATES: &str = "latch_state";
pub(crate) const EVENTS: &str = "events";
pub(crate) const TABLE: &str = "contact_table";
/// How near a run against a rig came to the simulated system.
pub(crate) const FIDELITY: &str = "fidelity";
/// Table of the run that is drawn as a ghost.
pub(crate) const GHOST_TABLE: &str = "ghost_contact_table";

/// Where the ghost keeps what the run in the foreground keeps at `path`: below it, so that both
/// share a plot; its table has a view of its own.
pub(crate) fn of_ghost(path: &str) -> String {
    match path.strip_prefix(SCENE) {
        Some(rest) => format!("{SCENE}/ghost{rest}"),
        None if path == TABLE => GHOST_TABLE.to_owned(),
        None => match path.strip_prefix(LATCH_STATES) {
            Some(rest) => format!("{LATCH_STATES}/ghost{rest}"),
            None => format!("{path}/ghost"),
        },
    }
}

/// State of latch `i`, counted from 0 and named from 1.
pub(crate) fn latch_state(i: usize) -> String {
    format!("{LATCH_STATES}/latch_{}", i + 1)
}
