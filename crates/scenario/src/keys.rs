//! Every key of a scenario file once: its range, its default, its meaning. Checking and `explain`
//! both read this table.

use core::fmt::Write as _;

use docktwin_model::keys::{UnknownKey, contact_ranges as contact, without_indices};
use docktwin_model::toml_check::{Range, unit_of};

/// What may stand behind a key.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// A number that must be there.
    Number(Range),
    /// A number with a default.
    Default(Range, f64),
    /// A number that may be absent.
    Maybe(Range),
    /// A whole number that may be absent.
    Count(u32, u32),
    /// A text that must be there.
    Text,
    /// A file that must be there.
    Path,
    /// A file that may be absent.
    MaybePath,
    /// One of a few words; whether it must be there.
    Words(&'static [&'static str], bool),
    /// True or false, with its default.
    Flag(bool),
}

/// One key.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Key {
    /// Dotted path; the index of an array of tables is left out.
    pub(crate) key: &'static str,
    pub(crate) shape: Shape,
    pub(crate) meaning: &'static str,
}

const fn key(key: &'static str, shape: Shape, meaning: &'static str) -> Key {
    Key { key, shape, meaning }
}

pub(crate) const OUTCOMES: &[&str] =
    &["captured", "rebounded", "missed", "jammed", "limit_exceeded", "stopped"];
const ANY: Range = Range::within(-1e6, 1e6);
const LOAD: Range = Range::positive(1e9);
const TIME: Range = Range::within(0.0, 1e6);
const TOLERANCE: Range = Range::within(1e-9, 1.0);
const RATIO: Range = Range::within(0.0, 100.0);
const NRMS: Range = Range::positive(100.0);
const GAIN: Range = Range::within(-100.0, 100.0);
const DIFFERENCE: Range = Range::positive(100.0);

pub(crate) const KEYS: &[Key] = &[
    key("schema", Shape::Count(1, 1), "Version of this file format; 1, and it must be there."),
    key(
        "name",
        Shape::Text,
        "Name of the scenario; run directories are called after it. Letters, digits, `_`, `-` and \
         `.`, beginning with a letter or digit, at most 100.",
    ),
    key("description", Shape::Text, "What happens, in a sentence or two."),
    key(
        "chaser.model",
        Shape::Path,
        "URDF of the chaser, with a TOML of the same name beside it. Looked for from the folder of \
         the scenario upward.",
    ),
    key("target.model", Shape::Path, "URDF of the target; its port faces −X of its body."),
    key("mechanism.active", Shape::Path, "URDF of the active side, on the chaser."),
    key("mechanism.passive", Shape::Path, "URDF of the passive side, on the target."),
    key(
        "mechanism.attenuation",
        Shape::Words(&["characteristic", "differential", "rigid"], false),
        "What carries the active ring; without it the default of the active side's file. `rigid` \
         makes the ring a part of the chaser.",
    ),
    key(
        "mechanism.petals",
        Shape::Flag(true),
        "false takes the petals off both sides and leaves bare rings.",
    ),
    key(
        "mechanism.contact.normal_law",
        Shape::Words(&["hunt_crossley", "kelvin_voigt"], false),
        "Overrides the normal law of the mechanism: F = k δⁿ (1 + a δ') or F = k δ + c δ', both \
         never below 0.",
    ),
    key(
        "mechanism.contact.stiffness_n_m",
        Shape::Maybe(contact::STIFFNESS),
        "Overrides k, N/m (N/mⁿ with an exponent n); larger is harder and needs smaller steps.",
    ),
    key("mechanism.contact.exponent", Shape::Maybe(contact::EXPONENT), "Overrides n."),
    key(
        "mechanism.contact.damping_s_m",
        Shape::Maybe(contact::DAMPING_S_M),
        "Overrides a of Hunt–Crossley; 0 makes contact elastic.",
    ),
    key(
        "mechanism.contact.damping_n_s_m",
        Shape::Maybe(contact::DAMPING_N_S_M),
        "Overrides c of Kelvin–Voigt.",
    ),
    key(
        "mechanism.contact.friction_kinetic",
        Shape::Maybe(contact::FRICTION),
        "Overrides the kinetic friction coefficient of rings and petals; 0 switches friction off. Listed surfaces keep \
         their own.",
    ),
    key(
        "mechanism.contact.friction_static",
        Shape::Maybe(contact::FRICTION),
        "Overrides the static friction coefficient, at least the kinetic one.",
    ),
    key(
        "mechanism.contact.stribeck_velocity_m_s",
        Shape::Maybe(contact::STRIBECK_VELOCITY),
        "Overrides the Stribeck velocity: how fast the static coefficient fades with sliding.",
    ),
    key(
        "mechanism.contact.bristle_breakaway_m",
        Shape::Maybe(contact::BRISTLE_BREAKAWAY),
        "Overrides the displacement at which sticking ends; smaller is nearer to ideal friction.",
    ),
    key(
        "mechanism.contact.bristle_damping_s",
        Shape::Maybe(contact::BRISTLE_DAMPING),
        "Overrides the time constant of the bristle's damping while it sticks.",
    ),
    key(
        "mechanism.contact.merge_depth_m",
        Shape::Maybe(contact::MERGE_DEPTH),
        "Overrides the width within which neighbouring depths of two rings merge smoothly.",
    ),
    key(
        "initial.axial_speed_m_s",
        Shape::Number(Range::positive(2.0)),
        "Closing speed of the ring centres along X3 at the plane of first contact.",
    ),
    key(
        "initial.lateral_y_m",
        Shape::Default(Range::within(-2.0, 2.0), 0.0),
        "Offset of the target's ring centre from the chaser's along Y3 at first contact.",
    ),
    key("initial.lateral_z_m", Shape::Default(Range::within(-2.0, 2.0), 0.0), "The same along Z3."),
    key(
        "initial.lateral_speed_y_m_s",
        Shape::Default(Range::within(-1.0, 1.0), 0.0),
        "Speed of the target's ring centre relative to the chaser's along Y3 at first contact.",
    ),
    key(
        "initial.lateral_speed_z_m_s",
        Shape::Default(Range::within(-1.0, 1.0), 0.0),
        "The same along Z3.",
    ),
    key(
        "initial.roll_deg",
        Shape::Default(Range::within(-180.0, 180.0), 0.0),
        "Roll φ of R_34 about X; R_34 = Ry(pitch) Rz(yaw) Rx(roll).",
    ),
    key("initial.pitch_deg", Shape::Default(Range::within(-45.0, 45.0), 0.0), "Pitch θ about Y."),
    key("initial.yaw_deg", Shape::Default(Range::within(-45.0, 45.0), 0.0), "Yaw ψ about Z."),
    key(
        "initial.roll_rate_deg_s",
        Shape::Default(Range::within(-60.0, 60.0), 0.0),
        "Angular velocity of the target relative to the chaser, X component in e4. Which of both turns says \
         `initial.turning`.",
    ),
    key(
        "initial.pitch_rate_deg_s",
        Shape::Default(Range::within(-60.0, 60.0), 0.0),
        "The same, Y component.",
    ),
    key(
        "initial.yaw_rate_deg_s",
        Shape::Default(Range::within(-60.0, 60.0), 0.0),
        "The same, Z component.",
    ),
    key(
        "initial.turning",
        Shape::Words(&["target", "chaser", "both"], false),
        "Which body has these rates before contact; without it the target alone: the chaser and its ring do \
         not turn. `chaser`: the chaser with its ring alone, opposite; `both`: half each. At the plane of \
         first contact the motion of the target seen from e3 is the same; the flight there and what follows \
         are not, because a body that turns has angular momentum.",
    ),
    key(
        "initial.gap_m",
        Shape::Default(Range::positive(10.0), 0.05),
        "How far before first contact the run starts: the state at first contact is taken back in \
         free flight until the ring centres are this much farther apart along X3.",
    ),
    key(
        "run.duration_s",
        Shape::Number(Range::positive(1e5)),
        "Simulated time after which the run ends at the latest; at most 1e8 ticks.",
    ),
    key(
        "run.tick_s",
        Shape::Default(Range::within(1e-5, 0.002), 0.001),
        "Period of the recorded ticks, a whole number of nanoseconds. Contacts are recorded once a tick; limits are judged in every physics step.",
    ),
    key(
        "run.steps_per_tick",
        Shape::Count(1, 10_000),
        "Steps of the integrator in one tick; each twin has its own default.",
    ),
    key(
        "run.stop_when_decided",
        Shape::Flag(false),
        "Ends the run as soon as the outcome cannot change any more.",
    ),
    key(
        "loop.rig",
        Shape::MaybePath,
        "URDF of the rig that `hil` runs on, a TOML of the same name beside it; without it \
         models/urdf/stewart.urdf. Looked for from the folder of the scenario upward.",
    ),
    key(
        "loop.preset",
        Shape::Words(&["printed", "consistent", "stiff"], false),
        "Oil volume of the rig's legs; without it the default of the rig's file.",
    ),
    key(
        "loop.compensator",
        Shape::Words(
            &[
                "none",
                "lead",
                "force-lead",
                "pe1",
                "pe2",
                "pe3",
                "state-force-inverse",
                "smith-lead",
                "smith-dob",
                "prior-force",
                "ats",
                "amb",
                "rls-inverse",
                "ukf-inverse",
                "passivity",
                "twin",
                "twin-model-only",
            ],
            false,
        ),
        "Compensator of the delay of the rig and of what it adds; without it `lead`. `twin` corrects the measured \
         wrenches by two twins and leads the command; `twin-model-only` leaves what was measured out, as a \
         control of validations. The others are methods of the literature to compare with (docs/compensation.md).",
    ),
    key(
        "loop.lead_s",
        Shape::Maybe(Range::within(0.0, 0.1)),
        "Lead of the compensator; without it the delay that is believed or was identified. More \
         takes energy out of every contact, less leaves energy in.",
    ),
    key(
        "loop.added_delay_s",
        Shape::Default(Range::within(0.0, 0.03), 0.0),
        "Holds every command back by this much, in whole ticks: makes the rig as slow as another one, \
         to see what that does.",
    ),
    key(
        "loop.sensors",
        Shape::Words(&["single", "two"], false),
        "Whether F4, M4 come from the rack's sensor by (12), (13), or from a sensor of their own on \
         the plate; without it `single`. (12) leaves out what a moving ring resists by its mass; two \
         sensors have it, with accelerometers on the plate, and add up the drift of both zeros.",
    ),
    key(
        "loop.force_limit_n",
        Shape::Maybe(LOAD),
        "Force at a port beyond which the supervisor stops the rig; without it 1.2 times the \
         mechanism's largest.",
    ),
    key(
        "loop.moment_limit_nm",
        Shape::Maybe(LOAD),
        "Moment at a port beyond which the supervisor stops the rig; without it 1.2 times the \
         mechanism's largest.",
    ),
    key(
        "loop.energy_limit",
        Shape::Maybe(Range::positive(1e3)),
        "Energy that the loop may add, over the largest kinetic energy of the relative motion: from a tenth of it on the run \
         says so, from half of it on the relative motion is damped, beyond it the rig is stopped. Without it that energy is not \
         computed. See docs/compensation.md.",
    ),
    key("thrust.on", Shape::Words(&["chaser", "target"], true), "The body that is pushed."),
    key(
        "thrust.after",
        Shape::Words(&["start", "first_contact", "capture"], true),
        "The event after which the delay begins.",
    ),
    key("thrust.delay_s", Shape::Default(TIME, 0.0), "Time from the event to the thrust."),
    key("thrust.duration_s", Shape::Number(Range::positive(1e5)), "How long the thrust lasts."),
    key("thrust.force_x_n", Shape::Default(ANY, 0.0), "Force at the mass centre, body axis X."),
    key("thrust.force_y_n", Shape::Default(ANY, 0.0), "Force at the mass centre, body axis Y."),
    key("thrust.force_z_n", Shape::Default(ANY, 0.0), "Force at the mass centre, body axis Z."),
    key("thrust.moment_x_nm", Shape::Default(ANY, 0.0), "Moment, body axis X."),
    key("thrust.moment_y_nm", Shape::Default(ANY, 0.0), "Moment, body axis Y."),
    key("thrust.moment_z_nm", Shape::Default(ANY, 0.0), "Moment, body axis Z."),
    key("thrust.until_capture", Shape::Flag(false), "Ends the thrust at capture."),
    key("expect.outcome", Shape::Words(OUTCOMES, true), "How the run must end to pass."),
    key(
        "expect.hil_outcome",
        Shape::Words(OUTCOMES, false),
        "How `hil` must end to pass, where that is not `outcome`. Bounds beside it count for `rehearse` \
         alone, those of `[expect.hil]` and `[[expect.fidelity]]` for `hil` alone; the summary names those \
         that a run did not judge. Any bound of a figure that was not computed is not met.",
    ),
    key("expect.because", Shape::Text, "Why physics gives this outcome."),
    key("expect.first_contact_after_s", Shape::Maybe(TIME), "First contact not before this time."),
    key("expect.first_contact_before_s", Shape::Maybe(TIME), "First contact before this time."),
    key("expect.capture_after_s", Shape::Maybe(TIME), "Capture not before this time."),
    key("expect.capture_before_s", Shape::Maybe(TIME), "Capture before this time."),
    key("expect.duration_after_s", Shape::Maybe(TIME), "The run lasts at least this long."),
    key("expect.duration_before_s", Shape::Maybe(TIME), "The run ends before this time."),
    key("expect.peak_force_above_n", Shape::Maybe(LOAD), "Peak force at the port at least this."),
    key("expect.peak_force_below_n", Shape::Maybe(LOAD), "Peak force at the port at most this."),
    key("expect.peak_force_n", Shape::Maybe(LOAD), "Peak force at the port, within its tolerance."),
    key(
        "expect.peak_force_tolerance",
        Shape::Maybe(TOLERANCE),
        "Relative tolerance of peak_force_n.",
    ),
    key(
        "expect.peak_moment_above_nm",
        Shape::Maybe(LOAD),
        "Peak moment at the port at least this.",
    ),
    key("expect.peak_moment_below_nm", Shape::Maybe(LOAD), "Peak moment at the port at most this."),
    key(
        "expect.peak_penetration_below_m",
        Shape::Maybe(Range::positive(1.0)),
        "Greatest contact depth at most this.",
    ),
    key("expect.impulse_above_ns", Shape::Maybe(LOAD), "Contact impulse at least this."),
    key("expect.impulse_below_ns", Shape::Maybe(LOAD), "Contact impulse at most this."),
    key("expect.impulse_ns", Shape::Maybe(LOAD), "Contact impulse, within its tolerance."),
    key("expect.impulse_tolerance", Shape::Maybe(TOLERANCE), "Relative tolerance of impulse_ns."),
    key(
        "expect.exit_speed_m_s",
        Shape::Maybe(Range::within(0.0, 10.0)),
        "Speed at which the ports part after contact, within its tolerance.",
    ),
    key(
        "expect.exit_speed_tolerance",
        Shape::Maybe(TOLERANCE),
        "Relative tolerance of exit_speed_m_s.",
    ),
    // Times and loads of a run with a rig, as `rehearse` has them above.
    key(
        "expect.hil.first_contact_after_s",
        Shape::Maybe(TIME),
        "First contact with the rig, as measured, not before this time.",
    ),
    key("expect.hil.first_contact_before_s", Shape::Maybe(TIME), "The same, before this time."),
    key(
        "expect.hil.capture_after_s",
        Shape::Maybe(TIME),
        "Capture on the rig not before this time.",
    ),
    key("expect.hil.capture_before_s", Shape::Maybe(TIME), "The same, before this time."),
    key(
        "expect.hil.duration_after_s",
        Shape::Maybe(TIME),
        "The run with the rig lasts at least this long.",
    ),
    key("expect.hil.duration_before_s", Shape::Maybe(TIME), "The same, at most."),
    key(
        "expect.hil.peak_force_above_n",
        Shape::Maybe(LOAD),
        "Peak force at port 4, as measured, at least this.",
    ),
    key("expect.hil.peak_force_below_n", Shape::Maybe(LOAD), "The same, at most."),
    key(
        "expect.hil.peak_moment_above_nm",
        Shape::Maybe(LOAD),
        "Peak moment on the target, as measured, at least this.",
    ),
    key("expect.hil.peak_moment_below_nm", Shape::Maybe(LOAD), "The same, at most."),
    key(
        "expect.hil.peak_penetration_below_m",
        Shape::Maybe(Range::positive(1.0)),
        "Greatest contact depth, as the twin has it at the measured pose, at most this.",
    ),
    key(
        "expect.hil.impulse_above_ns",
        Shape::Maybe(LOAD),
        "Contact impulse, as measured, at least this.",
    ),
    key("expect.hil.impulse_below_ns", Shape::Maybe(LOAD), "The same, at most."),
    key(
        "expect.hil.R_e_above",
        Shape::Maybe(RATIO),
        "`fidelity.R_e` of the summary at least this: the restitution over that of the simulated system.",
    ),
    key("expect.hil.R_e_below", Shape::Maybe(RATIO), "The same, at most."),
    key(
        "expect.hil.R_T_above",
        Shape::Maybe(RATIO),
        "`fidelity.R_T` at least this: duration of the first contact over that of the simulated system.",
    ),
    key("expect.hil.R_T_below", Shape::Maybe(RATIO), "The same, at most."),
    key(
        "expect.hil.delta_energy_above",
        Shape::Maybe(GAIN),
        "`fidelity.delta_energy` at least this: kinetic energy that the loop gained by the end, over that at \
         the start; negative where it lost some.",
    ),
    key(
        "expect.hil.delta_energy_below",
        Shape::Maybe(GAIN),
        "The same, at most. Without it, or a bound of it in `[[expect.fidelity]]`, `hil` warns above 0.01.",
    ),
    key(
        "expect.hil.first_contact_difference_below_s",
        Shape::Maybe(DIFFERENCE),
        "Size of `fidelity.first_contact_difference_s` at most this.",
    ),
    key(
        "expect.fidelity.of",
        Shape::Words(&["felt", "hardware"], true),
        "Which comparison with the simulated system is bounded: of what the bodies' programme received, or of \
         what the article on the rig bore, which only an emulated rig tells. The figures are those of \
         `fidelity` in the summary. One table for each comparison and window.",
    ),
    key(
        "expect.fidelity.window",
        Shape::Words(&["to_first_latch", "to_capture", "whole_run"], true),
        "From first contact to the first latch of the simulated system, to 1 s after its capture, or to the \
         end of the run.",
    ),
    key(
        "expect.fidelity.peak_force_ratio_above",
        Shape::Maybe(RATIO),
        "Largest force over that of the simulated system at least this.",
    ),
    key("expect.fidelity.peak_force_ratio_below", Shape::Maybe(RATIO), "The same, at most."),
    key(
        "expect.fidelity.peak_moment_ratio_above",
        Shape::Maybe(RATIO),
        "Largest moment over that of the simulated system at least this.",
    ),
    key("expect.fidelity.peak_moment_ratio_below", Shape::Maybe(RATIO), "The same, at most."),
    key(
        "expect.fidelity.nrms_force_below",
        Shape::Maybe(NRMS),
        "RMS of the difference of the force over the RMS of the simulated force at most this. Without a \
         bound of it in any window `hil` warns above 0.2.",
    ),
    key("expect.fidelity.nrms_moment_below", Shape::Maybe(NRMS), "The same of the moment."),
    key(
        "expect.fidelity.nrms_pose_below",
        Shape::Maybe(NRMS),
        "The same of the relative position.",
    ),
    key(
        "expect.fidelity.nrms_attitude_below",
        Shape::Maybe(NRMS),
        "The same of the relative attitude.",
    ),
    key(
        "expect.fidelity.impulse_ratio_above",
        Shape::Maybe(RATIO),
        "Impulse over that of the simulated system at least this.",
    ),
    key("expect.fidelity.impulse_ratio_below", Shape::Maybe(RATIO), "The same, at most."),
    key(
        "expect.fidelity.delta_energy_above",
        Shape::Maybe(GAIN),
        "Energy that the ports gave the motion, less that of the simulated system, over the kinetic energy at \
         the start, at least this.",
    ),
    key("expect.fidelity.delta_energy_below", Shape::Maybe(GAIN), "The same, at most."),
    key(
        "expect.fidelity.latch_difference_below_s",
        Shape::Maybe(DIFFERENCE),
        "No latch catches earlier or later than in the simulated system by more than this, whatever the \
         window.",
    ),
    key(
        "expect.fidelity.capture_difference_below_s",
        Shape::Maybe(DIFFERENCE),
        "The same of capture.",
    ),
];

/// A scenario file with every key once.
pub(crate) const EXAMPLE: &str = include_str!("example.toml");

/// The line of the example file that gives a key, or an empty text.
fn example(key: &str) -> &'static str {
    let mut table = "";
    for line in EXAMPLE.lines().map(str::trim) {
        if line.starts_with('[') {
            table = line.trim_matches(['[', ']']);
        } else if let Some((name, _)) = line.split_once('=') {
            let rest = if table.is_empty() {
                Some(key)
            } else {
                key.strip_prefix(table).and_then(|k| k.strip_prefix('.'))
            };
            if rest == Some(name.trim()) {
                return line;
            }
        }
    }
    ""
}

/// Every key as its table and its name.
pub(crate) fn places() -> impl Iterator<Item = (&'static str, &'static str)> {
    KEYS.iter().map(|k| k.key.rsplit_once('.').unwrap_or(("", k.key)))
}

/// The entry of a key, given with or without indices of arrays.
pub(crate) fn find(path: &str) -> Option<&'static Key> {
    let plain = without_indices(path);
    KEYS.iter().find(|k| k.key == plain)
}

/// One key as a script sees it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Explained {
    /// Dotted path.
    pub key: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// Unit; empty for none.
    pub unit: &'static str,
    /// Kind of value, unit, range, and whether it is required or what its default is, in words.
    pub allowed: String,
    /// A line of a scenario file that gives it.
    pub example: &'static str,
}

/// The keys that [`explain`] tells about.
///
/// # Errors
/// No key and no table has this name.
pub fn explained(key: Option<&str>) -> Result<Vec<Explained>, UnknownKey> {
    let plain = key.map(without_indices);
    let wanted = |k: &Key| {
        plain.as_ref().is_none_or(|p| {
            k.key == p || k.key.strip_prefix(p.as_str()).is_some_and(|rest| rest.starts_with('.'))
        })
    };
    let found: Vec<Explained> = KEYS
        .iter()
        .filter(|k| wanted(k))
        .map(|k| Explained {
            key: k.key,
            meaning: k.meaning,
            unit: unit_of(k.key),
            allowed: allowed(k),
            example: example(k.key),
        })
        .collect();
    if found.is_empty() {
        let asked = plain.unwrap_or_default();
        return Err(UnknownKey::among("scenario", &asked, KEYS.iter().map(|k| k.key)));
    }
    Ok(found)
}

/// Meaning, unit, range, default and an example of one key, of all keys of one table, or of every
/// key.
///
/// # Errors
/// No key and no table has this name.
pub fn explain(key: Option<&str>) -> Result<String, UnknownKey> {
    let mut text = String::new();
    for k in explained(key)? {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{}\n    {}\n    {}\n    example: {}",
            k.key, k.allowed, k.meaning, k.example
        );
    }
    Ok(text)
}

/// Unit, range and default of a key, on one line.
fn allowed(k: &Key) -> String {
    let unit = match unit_of(k.key) {
        "" => "no unit".to_owned(),
        unit => unit.to_owned(),
    };
    let words = |w: &[&str]| w.join(" | ");
    match k.shape {
        Shape::Number(r) => format!("number, {unit}, {r}; required"),
        Shape::Default(r, d) => format!("number, {unit}, {r}; default {d}"),
        Shape::Maybe(r) => format!("number, {unit}, {r}; optional"),
        Shape::Count(1, 1) => "1; required".into(),
        Shape::Count(lo, hi) => format!("whole number, {lo} to {hi}; optional"),
        Shape::Text => "text; required".into(),
        Shape::Path => "path of a file; required".into(),
        Shape::MaybePath => "path of a file; optional".into(),
        Shape::Words(w, true) => format!("{}; required", words(w)),
        Shape::Words(w, false) => format!("{}; optional", words(w)),
        Shape::Flag(d) => format!("true | false; default {d}"),
    }
}
