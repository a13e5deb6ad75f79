//! The tables of the second engine as a run directory.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use docktwin_core::{ContactChange, ContactSpan, DVec3, SimTime, Tick};
use docktwin_physics::mechanism::pair_names;
use docktwin_record::{
    Cell, Column, ColumnKind, ContactRow, Event, Policy, RecordError, RunWriter, Summary, files,
    read_table,
};
use docktwin_run::{
    RunError,
    provenance::{ModelCopies, digest_keys},
    signals::columns,
};
use docktwin_scenario::Scenario;
use serde_json::json;

use super::second::{EngineResult, engine_summary};

type Table = BTreeMap<String, Vec<f64>>;

/// Makes a run directory of the tables: docktwin's columns as far as MuJoCo knows them, places of
/// contact, events, and a summary whose energies are not numbers. `started_unix_ns` is the date that the
/// recording gets, ns since 1970.
///
/// # Errors
/// Tables that cannot be read or lack a column, model files that cannot be kept, a directory that cannot
/// be written.
pub fn record(
    scenario: &Scenario,
    told: &EngineResult,
    tables: &Path,
    out: &Path,
    started_unix_ns: i128,
) -> Result<Summary, RunError> {
    let path = tables.join(files::TABLE);
    let table = read_table(&path)?;
    let places = read_table(tables.join("contacts.parquet"))?;
    let (known, absent): (Vec<Column>, Vec<Column>) =
        columns().into_iter().partition(|c| table.contains_key(&c.name));
    let absent: Vec<String> = absent.into_iter().map(|c| c.name).collect();
    let mut metadata: BTreeMap<String, String> = [
        ("tool", "docktwin".to_owned()),
        ("tool_version", env!("CARGO_PKG_VERSION").to_owned()),
        ("command", "validate crosscheck".to_owned()),
        ("scenario", scenario.name.clone()),
        ("twin", "mujoco".to_owned()),
        ("engine", told.engine.clone()),
        ("integrator", told.integrator.clone()),
        ("step_s", told.step_s.to_string()),
        ("tick_nanos", scenario.run.tick_nanos.to_string()),
        ("columns_unknown_to_the_engine", absent.join(" ")),
        ("started_unix_ns", started_unix_ns.to_string()),
    ]
    .map(|(k, v)| (k.to_owned(), v))
    .into();
    metadata.extend(digest_keys(&scenario.files).map(|(k, f)| (k, f.digest.to_string())));
    let models = ModelCopies::of(scenario)?;
    let pair_names = pair_names(&scenario.mechanism);
    let mut writer =
        RunWriter::create(out, known.clone(), pair_names.clone(), &metadata, Policy::Wait)?;
    models.write(&writer)?;
    writer.scenario_toml(&models.refer(&scenario.as_run_toml()))?;

    let rows = table.get("time_s").map_or(0, Vec::len);
    let contacts = contact_rows(&places, &path)?;
    let mut told_events = Events { pair_names, ..Events::default() };
    let mut row = Vec::with_capacity(known.len());
    for n in 0..rows {
        row.clear();
        row.extend(known.iter().map(|c| {
            let x = table[&c.name][n];
            match c.kind {
                ColumnKind::F64 => Cell::from(x),
                ColumnKind::U64 => Cell::from(whole(x)),
                ColumnKind::Bool => Cell::from(x > 0.5),
            }
        }));
        let tick = Tick(n as u64);
        let time = SimTime::of_tick(tick, scenario.run.tick_nanos);
        let here = contacts.get(&tick.0).map_or(&[][..], Vec::as_slice);
        let phases = [1, 2, 3]
            .map(|i| table.get(&format!("latch_{i}_phase")).map_or(0, |column| whole(column[n])));
        for e in told_events.at(tick, time, here, phases, told.capture_s) {
            writer.event(&e)?;
        }
        writer.tick(tick, time, &row, here)?;
    }
    let last = Tick(rows.saturating_sub(1) as u64);
    writer.event(&Event::new(
        last,
        SimTime::of_tick(last, scenario.run.tick_nanos),
        "outcome",
        format!("{}: {}", told.outcome, told.reason),
        json!({ "outcome": told.outcome, "decided_s": told.decided_s }),
    ))?;
    let mut summary = engine_summary(scenario, told);
    summary.recording = Some(writer.finish(&summary)?);
    Ok(summary)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts; a negative or absent one becomes 0"
)]
fn whole(x: f64) -> u64 {
    x.round() as u64
}

/// Places of contact by tick.
fn contact_rows(t: &Table, path: &Path) -> Result<BTreeMap<u64, Vec<ContactRow>>, RecordError> {
    let column = |name: &str| {
        t.get(name).ok_or_else(|| RecordError::Absent {
            what: format!("the column `{name}` of the contacts"),
            remedy: "run the second engine again with this version",
            path: path.to_owned(),
        })
    };
    let vector = |name: &str, unit: &str| -> Result<Vec<DVec3>, RecordError> {
        let [x, y, z] = ["x", "y", "z"].map(|a| column(&format!("{name}_{a}_{unit}")));
        let (x, y, z) = (x?, y?, z?);
        Ok((0..x.len()).map(|i| DVec3::new(x[i], y[i], z[i])).collect())
    };
    let (tick, pair, depth) = (column("tick")?, column("pair")?, column("depth_m")?);
    let (point, normal, friction) =
        (vector("point", "m")?, vector("normal_force", "n")?, vector("friction", "n")?);
    let mut out: BTreeMap<u64, Vec<ContactRow>> = BTreeMap::new();
    for i in 0..tick.len() {
        out.entry(whole(tick[i])).or_default().push(ContactRow {
            pair: u16::try_from(whole(pair[i])).unwrap_or(u16::MAX),
            point_w_m: point[i],
            normal_w: normal[i].normalize_or_zero(),
            depth_m: depth[i],
            normal_force_n: normal[i].length(),
            friction_w_n: friction[i],
        });
    }
    Ok(out)
}

/// Events as far as the tables tell them.
#[derive(Default)]
struct Events {
    pair_names: Vec<String>,
    /// By pair.
    touching: BTreeMap<u16, ContactSpan>,
    phases: [u64; 3],
    captured: bool,
}

impl Events {
    fn at(
        &mut self,
        tick: Tick,
        time: SimTime,
        contacts: &[ContactRow],
        phases: [u64; 3],
        capture_s: Option<f64>,
    ) -> Vec<Event> {
        let t = time.seconds();
        let mut out = Vec::new();
        let mut tell = |kind: &str, text: String, body| {
            out.push(Event::new(tick, time, kind, text, body));
        };
        let here: BTreeSet<u16> = contacts.iter().map(|c| c.pair).collect();
        for pair in &here {
            self.touching.entry(*pair).or_default();
        }
        for (pair, span) in &mut self.touching {
            let name = self.pair_names.get(usize::from(*pair)).cloned().unwrap_or_default();
            match span.observe(time, here.contains(pair)) {
                Some(ContactChange::Began) => tell(
                    "contact_begin",
                    format!("t = {t:.3} s {name} touch"),
                    json!({ "pair": name }),
                ),
                Some(ContactChange::Ended { begin, end }) => {
                    let [since_s, until_s] = [begin.seconds(), end.seconds()];
                    tell(
                        "contact_end",
                        format!("t = {until_s:.3} s {name} part after {:.3} s", until_s - since_s),
                        json!({ "pair": name, "since_s": since_s, "until_s": until_s }),
                    );
                }
                None => {}
            }
        }
        for (i, (seen, now)) in self.phases.iter_mut().zip(phases).enumerate() {
            if *seen == now {
                continue;
            }
            *seen = now;
            let (kind, word) = match now {
                0 => ("latch_free", "is free again"),
                1 => ("latch_approach", "approaches its striker"),
                2 => ("latch_strike", "is struck"),
                _ => ("latched", "has caught"),
            };
            tell(kind, format!("t = {t:.3} s latch {} {word}", i + 1), json!({ "latch": i + 1 }));
        }
        if let (false, Some(at)) = (self.captured, capture_s.filter(|at| *at <= t)) {
            self.captured = true;
            let text = format!("t = {at:.3} s all three latches hold: the rings are joined");
            tell("captured", text, json!({ "capture_s": at }));
        }
        out
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use docktwin_record::{Outcome, RunReader, Verdict};
    use docktwin_scenario::load_scenario;

    use super::{super::second::tests::result, *};

    /// A table as the second engine leaves it, made by the recorder: a row a tick.
    fn table(at: &Path, name: &str, columns: Vec<Column>, rows: &[Vec<Cell>]) {
        let dir = at.join(format!("{name}.run"));
        let none = BTreeMap::new();
        let mut w = RunWriter::create(&dir, columns, Vec::new(), &none, Policy::Wait).unwrap();
        for (n, row) in rows.iter().enumerate() {
            let tick = Tick(n as u64);
            w.tick(tick, SimTime::of_tick(tick, 1_000_000), row, &[]).unwrap();
        }
        drop(w);
        std::fs::rename(dir.join(files::TABLE), at.join(name)).unwrap();
    }

    #[test]
    fn invariant_tables_become_a_run_with_contacts_and_events() {
        let at = tempfile::tempdir().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scenario = load_scenario(&root.join("scenarios/apas_fast.toml"), &[]).unwrap();
        let kept = ["chaser_position_x_m", "latch_2_phase", "contact_places"];
        let known: Vec<Column> =
            columns().into_iter().filter(|c| kept.contains(&c.name.as_str())).collect();
        let rows: Vec<Vec<Cell>> = (0..91u32)
            .map(|n| {
                let cell = |c: &Column| match c.name.as_str() {
                    "chaser_position_x_m" => Cell::from(0.1 * f64::from(n) - 7.3),
                    "latch_2_phase" => Cell::from(if n < 50 { 0u64 } else { 3 }),
                    _ => Cell::from(u64::from((3..10).contains(&n))),
                };
                known.iter().map(cell).collect()
            })
            .collect();
        table(at.path(), files::TABLE, known.clone(), &rows);
        // The recorder's own column counts ticks; contacts begin at tick 0 here.
        let mut names = vec![Column::u64("/c", "pair")];
        for (name, unit) in [("point", "m"), ("normal_force", "n"), ("friction", "n")] {
            names.extend(["x", "y", "z"].map(|a| Column::f64("/c", format!("{name}_{a}_{unit}"))));
        }
        names.push(Column::f64("/c", "depth_m"));
        let place = |pair: u64| -> Vec<Cell> {
            let numbers = [1.0, 2.0, 3.0, 0.0, 4.0, 3.0, 0.5, 0.0, 0.0, 2e-4];
            core::iter::once(Cell::from(pair)).chain(numbers.map(Cell::from)).collect()
        };
        table(at.path(), "contacts.parquet", names, &[place(0), place(0), place(5)]);

        let out = at.path().join("run");
        let s = record(&scenario, &result(), at.path(), &out, 0).unwrap();
        assert_eq!((s.outcome, s.verdict), (Outcome::Jammed, Verdict::Fail));
        let mut r = RunReader::open(&out).unwrap();
        assert_eq!(r.columns(), known);
        assert_eq!(r.metadata()["twin"], "mujoco");
        assert!(r.metadata()["columns_unknown_to_the_engine"].contains("energy_kinetic_j"));
        let mut seen = 0;
        while let Some(t) = r.next_tick().unwrap() {
            assert_eq!(t.row, rows[seen], "tick {seen}");
            assert_eq!(t.contacts.len(), usize::from(seen < 3));
            if let [c] = t.contacts.as_slice() {
                assert_eq!(c.pair, if seen < 2 { 0 } else { 5 });
                assert!((c.normal_force_n - 5.0).abs() < 1e-15);
                assert!((c.normal_w - DVec3::new(0.0, 0.8, 0.6)).length() < 1e-15);
                assert!((c.friction_w_n.x - 0.5).abs() < 1e-15);
            }
            seen += 1;
        }
        assert_eq!(seen, 91);
        let events: Vec<(u64, String)> =
            r.events().unwrap().into_iter().map(|e| (e.tick, e.kind)).collect();
        let named: Vec<(u64, &str)> = events.iter().map(|(t, k)| (*t, k.as_str())).collect();
        let want = [
            (0, "contact_begin"),
            (2, "contact_begin"),
            (22, "contact_end"),
            (23, "contact_end"),
            (50, "latched"),
            (90, "outcome"),
        ];
        assert_eq!(named, want);
    }
}
