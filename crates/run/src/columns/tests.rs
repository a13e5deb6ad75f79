use std::collections::BTreeSet;

use docktwin_record::{ColumnKind, unit_of};
use docktwin_scenario::Loader;

use super::*;
use crate::{
    HilOptions, HilRun, Rehearsal, Sink, SinkError,
    signals::columns,
    sink::{Header, TickView},
};

/// Names, topics and kinds of every column, as recordings and their readers know them. A new column is
/// added here; none may vanish, change or move to another topic.
const RECORDED: &str = include_str!("recorded.txt");

#[test]
fn regress_columns_are_those_of_recordings() {
    let line = |run: &str, c: &Column| {
        let kind = match c.kind {
            ColumnKind::F64 => "f64",
            ColumnKind::U64 => "u64",
            ColumnKind::Bool => "bool",
        };
        format!("{run} {kind} {} {}", c.topic, c.name)
    };
    let docking = columns();
    let rig = columns_of(WITH_RIG);
    let mut got: Vec<String> = docking.iter().map(|c| line("docking", c)).collect();
    got.extend(rig.iter().map(|c| line("rig", c)));
    assert_eq!(got.join("\n"), RECORDED.trim_end());
}

#[test]
fn invariant_the_table_says_all_of_every_signal() {
    let all = DOCKING.iter().chain(WITH_RIG).flat_map(|g| g.signals.iter().map(move |s| (g, s)));
    let mut seen = BTreeSet::new();
    for (group, s) in all {
        let name = s.name;
        assert!(seen.insert(name), "{name} stands twice");
        assert!(s.meaning.ends_with('.'), "{name}");
        assert_eq!(group.count.is_some(), name.contains("{i}"), "{name}");
        // The unit of a column is read off its name by `diff` and by whoever has the file alone.
        for column in s.names(1).filter(|_| s.kind == ColumnKind::F64) {
            assert_eq!(unit_of(&column), s.unit.suffix, "{column}");
        }
        // A vector has axes, a force or velocity acts somewhere.
        assert_eq!(s.components.is_empty(), s.frame.is_empty(), "{name}");
        // Every number has its own meaning, and a status bit is one bit.
        let numbers: BTreeSet<u64> = s.values.iter().chain(s.bits).map(|(n, _)| *n).collect();
        assert_eq!(numbers.len(), s.values.len() + s.bits.len(), "{name}");
        assert!(s.bits.iter().all(|(mask, _)| mask.is_power_of_two()), "{name}");
    }
}

/// Holds every row against the columns, and some cells against what the table says of them.
#[derive(Default)]
struct Rows {
    columns: Vec<Column>,
    rows: usize,
}

impl Sink for Rows {
    fn begin(&mut self, header: &Header<'_>) -> Result<(), SinkError> {
        self.columns = header.columns.to_vec();
        Ok(())
    }

    fn tick(&mut self, t: &TickView<'_>) -> Result<(), SinkError> {
        assert_eq!(t.row.len(), self.columns.len());
        let at = |name: &str| {
            t.row[self
                .columns
                .iter()
                .position(|c| c.name == name)
                .unwrap_or_else(|| panic!("{name}"))]
        };
        let norm = |name: &str, parts: &[&str]| {
            parts.iter().map(|p| at(&format!("{name}_{p}")).as_f64().powi(2)).sum::<f64>().sqrt()
        };
        for body in ["chaser", "ring", "target"] {
            let length = norm(&format!("{body}_attitude"), &["w", "x", "y", "z"]);
            assert!((length - 1.0).abs() < 1e-12, "{body}: {length}");
        }
        // The chaser is on the side of -X, the target comes along -X.
        assert!(at("chaser_position_x_m").as_f64() < at("target_position_x_m").as_f64());
        assert!(at("relative_position_x_m").as_f64() > 0.0);
        assert_eq!(at("latch_1_phase").as_u64(), 0);
        if self.columns.iter().any(|c| c.name == "loop_phase") {
            // The last ticks come to rest.
            assert!([3, 4].contains(&at("loop_phase").as_u64()));
            // Enabled, with accelerometers and truth.
            assert_eq!(at("rig_status").as_u64(), 1);
            let known = 1 << 14 | 1 << 21;
            assert_eq!(at("rig_capabilities").as_u64() & known, known);
            assert!(at("measurement_fresh").as_bool());
            // In free flight an accelerometer reads the weight that it bears, along +X on the rig.
            let specific = at("plate_specific_force_x_m_s2").as_f64();
            assert!(at("loop_phase").as_u64() == 4 || (specific - 9.81).abs() < 0.1);
            assert!(at("leg_6_length_m").as_f64() > 3.0);
            assert_eq!(at("wakeup_lateness_us").as_f64().to_bits(), 0);
        }
        self.rows += 1;
        Ok(())
    }
}

#[test]
fn invariant_rows_have_the_columns() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = path.join("../../scenarios/apas_nominal.toml");
    let scenario = Loader::new().set("run.duration_s", 0.02).load(&path).unwrap();
    let mut rows = Rows::default();
    Rehearsal::new(&scenario).unwrap().run(&mut rows).unwrap();
    assert!(rows.rows >= 20, "{}", rows.rows);
    let mut rows = Rows::default();
    let run = HilRun::new(&scenario, HilOptions::default()).unwrap();
    let rig = run.emulated().unwrap();
    run.run(rig, &mut rows).unwrap();
    assert!(rows.rows >= 20, "{}", rows.rows);
}
