//! The page that rigs in other languages are written from says what the structures are.

use core::mem::{align_of, offset_of};

use docktwin_rigport::{
    guard::GuardLimits,
    message::{
        Capabilities, DriveKind, Flags, MechanismMode, PROTOCOL_VERSION, Refusal, RigCommand,
        RigMeasurement, RigMode, Status,
    },
};
use iceoryx2::prelude::ZeroCopySend;

/// Offset, size, name and type of a field.
type Field = (usize, usize, String, String);

fn page() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rig-protocol.md");
    std::fs::read_to_string(path).expect("the page is there")
}

/// What stands under the heading that begins with `heading`, to the next one of any level.
fn section<'a>(page: &'a str, heading: &str) -> &'a str {
    let from = page.find(heading).unwrap_or_else(|| panic!("no `{heading}`"));
    let body = &page[from + heading.len()..];
    &body[..body.find("\n#").unwrap_or(body.len())]
}

/// Cells of the tables in a section, rows of headings and rules left out.
fn rows(section: &str) -> Vec<Vec<String>> {
    let cells = |l: &str| l.split('|').map(|c| c.trim().replace('`', "")).collect::<Vec<_>>();
    let rows = section.lines().filter(|l| l.starts_with('|')).map(cells);
    rows.filter(|c| c[1].starts_with(|d: char| d.is_ascii_digit())).collect()
}

fn fields(section: &str) -> Vec<Field> {
    let field = |c: Vec<String>| {
        let number = |s: &str| s.parse().expect("a number");
        (number(&c[1]), number(&c[2]), c[3].clone(), c[4].clone())
    };
    rows(section).into_iter().map(field).collect()
}

/// Type as the page writes it.
trait OnPage {
    const NAME: &'static str;
    const COUNT: usize = 1;
}

macro_rules! on_page {
    ($($type:ty: $name:literal),+) => { $(
        impl OnPage for $type {
            const NAME: &'static str = $name;
        }
    )+ };
}

on_page!(u32: "u32", u64: "u64", f64: "f64");
on_page!(Capabilities: "u32", Flags: "u32", GuardLimits: "u32", Status: "u32");

impl<T: OnPage, const N: usize> OnPage for [T; N] {
    const NAME: &'static str = T::NAME;
    const COUNT: usize = N;
}

fn written<T: OnPage>(_of: &T) -> String {
    if T::COUNT == 1 { T::NAME.to_owned() } else { format!("{}[{}]", T::NAME, T::COUNT) }
}

macro_rules! layout {
    ($zero:expr, $type:ident: $($field:ident),+ $(,)?) => {{
        let zero = $zero;
        // Without `..`: a new field does not compile until it is named here.
        let $type { $($field: _),+ } = zero;
        vec![$((
            offset_of!($type, $field),
            size_of_val(&zero.$field),
            stringify!($field).to_owned(),
            written(&zero.$field),
        )),+]
    }};
}

#[test]
fn invariant_the_page_gives_every_byte_of_a_command() {
    let layout: Vec<Field> = layout!(RigCommand::zero(), RigCommand:
        protocol_version, mode, flags, leg_count, session, tick, loop_time_ns, wakeup_ns, period_ns,
        leg_length_m, leg_speed_m_s, leg_flow_speed_m_s, leg_force_n, flow_ahead_s, force_ahead_s,
        plate_position_m, plate_attitude, plate_velocity_m_s, plate_rate_rad_s, plate_acceleration,
        plate_wrench, mechanism_mode, guard_limits, mechanism, guard_reference_a, guard_reference_b,
        guard_force_n, guard_moment_nm, guard_leg_speed_m_s, guard_speed_m_s, guard_rate_rad_s,
        guard_point_m, guard_box_middle_m, guard_box_attitude, guard_box_half_m, guard_box_turn_rad,
        reserved);
    let page = page();
    assert_eq!(fields(section(&page, "### RigCommand")), layout);
    check_whole::<RigCommand>(&page, "RigCommand", &layout);
}

#[test]
fn invariant_the_page_gives_every_byte_of_a_measurement() {
    let layout: Vec<Field> = layout!(RigMeasurement::zero(), RigMeasurement:
        protocol_version, status, refusal, capabilities, session, tick, stamp_ns, state_digest, drive,
        leg_count, latch_count, guard_tripped, leg_length_m, leg_speed_m_s, leg_force_n, valve_spool,
        sensor_a, sensor_b, plate_acceleration, plate_position_m, plate_attitude, plate_velocity_m_s,
        plate_rate_rad_s, latch_phase, ring_displacement_m, ring_rotation_rad, temperature_c,
        truth_position_m, truth_attitude, truth_twist, truth_port3, truth_port4, reserved);
    let page = page();
    assert_eq!(fields(section(&page, "### RigMeasurement")), layout);
    check_whole::<RigMeasurement>(&page, "RigMeasurement", &layout);
}

/// Size, alignment, type name, absence of gaps, and the structures in C and Python.
fn check_whole<T: ZeroCopySend>(page: &str, name: &str, layout: &[Field]) {
    let mut end = 0;
    for (offset, size, field, _) in layout {
        assert_eq!(*offset, end, "a gap before {field}");
        end += size;
    }
    assert_eq!(end, size_of::<T>(), "a gap at the end");
    assert_eq!(align_of::<T>(), 8);
    let heading = page.lines().find(|l| l.starts_with(&format!("### {name}:"))).expect("there");
    let type_name = format!("`Docktwin{name}V{PROTOCOL_VERSION}`");
    assert!(heading.contains(&type_name), "{heading}");
    assert!(heading.contains(&format!("{} bytes", size_of::<T>())), "{heading}");
    assert!(page.contains(&format!("sizeof({name}) == {}", size_of::<T>())));
    let c = listing(page, &format!("}} {name};"), "typedef struct");
    let python = listing_after(page, &format!("class {name}(ctypes.Structure):"), "    ]");
    let mut from = (0, 0);
    for (_, _, field, of) in layout {
        let (scalar, array) = of.split_once('[').map_or((of.as_str(), ""), |(s, n)| (s, n));
        let array = array.trim_end_matches(']');
        let in_c = match scalar {
            "u32" => "uint32_t",
            "u64" => "uint64_t",
            _ => "double",
        };
        let in_c = match array {
            "" => format!("    {in_c} {field};"),
            n => format!("    {in_c} {field}[{n}];"),
        };
        from.0 += c[from.0..].find(&in_c).unwrap_or_else(|| panic!("C: no `{in_c}` in order"));
        let in_python = match scalar {
            "u32" => "ctypes.c_uint32",
            "u64" => "ctypes.c_uint64",
            _ => "ctypes.c_double",
        };
        let in_python = match array {
            "" => format!("(\"{field}\", {in_python}),"),
            n => format!("(\"{field}\", {in_python} * {n}),"),
        };
        let found = python[from.1..].find(&in_python);
        from.1 += found.unwrap_or_else(|| panic!("Python: no `{in_python}` in order"));
    }
    assert_eq!(c.matches(';').count(), layout.len(), "C has more fields");
    assert_eq!(python.matches("(\"").count(), layout.len(), "Python has more fields");
}

/// What stands between the last `begin` before `end`, and `end`.
fn listing<'a>(page: &'a str, end: &str, begin: &str) -> &'a str {
    let end = page.find(end).unwrap_or_else(|| panic!("no `{end}`"));
    let from = page[..end].rfind(begin).unwrap_or_else(|| panic!("no `{begin}`"));
    &page[from..end]
}

fn listing_after<'a>(page: &'a str, begin: &str, end: &str) -> &'a str {
    let from = page.find(begin).unwrap_or_else(|| panic!("no `{begin}`"));
    let body = &page[from..];
    &body[..body.find(end).expect("it ends")]
}

#[test]
fn invariant_the_page_names_every_mode_and_refusal() {
    let page = page();
    let modes = rows(section(&page, "### Modes"));
    for (n, row) in modes.iter().enumerate() {
        let number = u32::try_from(n).expect("few");
        assert_eq!(row[1], n.to_string());
        let mode = RigMode::from_number(number).expect("a mode of the page");
        assert_eq!(format!("{mode:?}").to_lowercase(), row[2]);
    }
    assert_eq!(RigMode::from_number(u32::try_from(modes.len()).expect("few")), None);

    let mechanism = rows(section(&page, "### Mechanism modes"));
    for (n, row) in mechanism.iter().enumerate() {
        let mode = MechanismMode::from_number(u32::try_from(n).expect("few"));
        assert_eq!(format!("{:?}", mode.expect("a mode of the page")).to_lowercase(), row[2]);
    }
    assert_eq!(MechanismMode::from_number(u32::try_from(mechanism.len()).expect("few")), None);

    let refusals = rows(section(&page, "### Refusals"));
    assert_eq!(refusals.len(), Refusal::ALL.len());
    for (n, (row, refusal)) in refusals.iter().zip(Refusal::ALL).enumerate() {
        let number = u32::try_from(n + 1).expect("few");
        assert_eq!(row[1], number.to_string());
        assert_eq!(format!("{refusal:?}").to_lowercase(), row[2].replace(' ', ""));
        assert_eq!((refusal as u32, Refusal::from_number(number)), (number, Some(refusal)));
    }
    let beyond = u32::try_from(refusals.len() + 1).expect("few");
    assert_eq!((Refusal::from_number(0), Refusal::from_number(beyond)), (None, None));
    assert_eq!((Flags::LOCKSTEP.bits(), Flags::DRY_RUN.bits()), (1, 2));
    assert!(page.contains("bit 0 lockstep, bit 1 dry run"));
    let kinds = [DriveKind::Unstated, DriveKind::Hydraulic, DriveKind::PositionLoop];
    assert_eq!(kinds.map(|k| k as u32), [0, 1, 2]);
    assert_eq!(DriveKind::from_number(3), None);
    assert!(page.contains("0 not stated, 1 hydraulic, 2 position loop"));
}

/// A row of a table of bits: the bits it names, and its second cell.
fn bits(page: &str, heading: &str) -> Vec<(u32, String)> {
    let named = |row: Vec<String>| {
        let bits = row[1].split(", ").map(|b| 1_u32 << b.parse::<u32>().expect("a bit"));
        (bits.fold(0, |a, b| a | b), row[2].clone())
    };
    rows(section(page, heading)).into_iter().map(named).collect()
}

/// Every bit of a table of the page by its name in the code, and no other.
fn check_names<F: bitflags::Flags<Bits = u32>>(page: &str, heading: &str) {
    let found = bits(page, heading);
    let expected: Vec<(u32, String)> = F::FLAGS
        .iter()
        .map(|f| (f.value().bits(), f.name().to_lowercase().replace('_', " ")))
        .collect();
    assert_eq!(found, expected, "{heading}");
}

#[test]
fn invariant_the_page_names_every_bit() {
    let page = page();
    check_names::<Capabilities>(&page, "### Capability bits");
    check_names::<GuardLimits>(&page, "### The guard");
    let expected = [
        (Status::ENABLED, "enabled"),
        (Status::LIMIT_SWITCH, "limit switch"),
        (Status::EMERGENCY_STOP, "emergency stop"),
        (Status::SENSOR_A_SATURATED | Status::SENSOR_B_SATURATED, "sensor A, sensor B"),
        (Status::SAFE_STATE, "safe state"),
        (Status::REFUSED, "refused"),
        (Status::UNSOLICITED, "unsolicited"),
        (Status::ACCELEROMETER_SATURATED, "end of their range"),
        (Status::JOINED, "joined"),
    ];
    let found = bits(&page, "### Status bits");
    assert_eq!(found.len(), expected.len());
    for ((mask, text), (status, word)) in found.iter().zip(expected) {
        assert_eq!(*mask, status.bits(), "{word}");
        assert!(text.contains(word), "{text}");
    }
    let all = expected.iter().fold(Status::empty(), |a, b| a | b.0);
    assert_eq!(all, Status::all());
}
