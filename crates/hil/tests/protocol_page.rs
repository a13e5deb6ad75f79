//! The page that rigs in other languages are written from says what the structures are.

use core::mem::{align_of, offset_of};

use docktwin_hil::port::{
    PROTOCOL_VERSION, Refusal, RigCommand, RigMeasurement, RigMode, flag, status,
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

impl OnPage for u32 {
    const NAME: &'static str = "u32";
}

impl OnPage for u64 {
    const NAME: &'static str = "u64";
}

impl<const N: usize> OnPage for [f64; N] {
    const NAME: &'static str = "f64";
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
        protocol_version, mode, flags, reserved, session, tick, loop_time_ns, wakeup_ns, period_ns,
        leg_length_m, leg_speed_m_s, leg_flow_speed_m_s, leg_force_n, plate_position_m,
        plate_attitude, plate_velocity_m_s, plate_rate_rad_s, mechanism);
    let page = page();
    assert_eq!(fields(section(&page, "### RigCommand")), layout);
    check_whole::<RigCommand>(&page, "RigCommand", &layout);
}

#[test]
fn invariant_the_page_gives_every_byte_of_a_measurement() {
    let layout: Vec<Field> = layout!(RigMeasurement::zero(), RigMeasurement:
        protocol_version, status, refusal, reserved, session, tick, stamp_ns, state_digest,
        leg_length_m, leg_speed_m_s, leg_force_n, valve_spool, sensor_a, sensor_b, plate_acceleration, mechanism,
        temperature_c, truth_position_m, truth_attitude, truth_twist, truth_port3, truth_port4);
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
fn invariant_the_page_names_every_mode_refusal_and_bit() {
    let page = page();
    let modes = rows(section(&page, "### Modes"));
    for (n, row) in modes.iter().enumerate() {
        let number = u32::try_from(n).expect("few");
        assert_eq!(row[1], n.to_string());
        let mode = RigMode::from_number(number).expect("a mode of the page");
        assert_eq!(format!("{mode:?}").to_lowercase(), row[2]);
    }
    assert_eq!(RigMode::from_number(u32::try_from(modes.len()).expect("few")), None);

    let refusals = rows(section(&page, "### Refusals"));
    for (n, row) in refusals.iter().enumerate() {
        let number = u32::try_from(n + 1).expect("few");
        assert_eq!(row[1], number.to_string());
        let refusal = Refusal::from_number(number).expect("a refusal of the page");
        let word = row[2].replace(' ', "");
        assert_eq!(format!("{refusal:?}").to_lowercase(), word);
        assert_eq!(refusal as u32, number);
    }
    let beyond = u32::try_from(refusals.len() + 1).expect("few");
    assert_eq!(Refusal::from_number(beyond), None);

    let bits = rows(section(&page, "### Status bits"));
    let expected = [
        (status::ENABLED, "enabled"),
        (status::LIMIT_SWITCH, "limit switch"),
        (status::EMERGENCY_STOP, "emergency stop"),
        (status::SENSOR_A_SATURATED | status::SENSOR_B_SATURATED, "sensor A, sensor B"),
        (status::SAFE_STATE, "safe state"),
        (status::REFUSED, "refused"),
        (status::TRUTH, "truth_"),
        (status::UNASKED, "unasked"),
        (status::ACCELEROMETER, "accelerometers"),
        (status::ACCELEROMETER_SATURATED, "end of their range"),
    ];
    assert_eq!(bits.len(), expected.len());
    for (row, (mask, word)) in bits.iter().zip(expected) {
        let named = row[1].split(", ").map(|b| 1_u32 << b.parse::<u32>().expect("a bit"));
        assert_eq!(named.fold(0, |a, b| a | b), mask, "{word}");
        assert!(row[2].contains(word), "{row:?}");
    }
    assert_eq!((flag::LOCKSTEP, flag::DRY_RUN), (1, 2));
    assert!(page.contains("bit 0 lockstep, bit 1 dry run"));
}
