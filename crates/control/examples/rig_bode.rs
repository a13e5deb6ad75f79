//! Measures the running rig over the docking workspace and says which requirements hold.
//!
//! ```text
//! cargo run -p docktwin-control --example rig_bode                  # all, about half an hour
//! cargo run -p docktwin-control --example rig_bode -- stiff sample  # one preset, six places
//! cargo run -p docktwin-control --example rig_bode -- quick         # 1, 4 and 10 Hz only
//! cargo run -p docktwin-control --example rig_bode -- poles         # linear model only
//! cargo run -p docktwin-control --example rig_bode -- seed=7        # a perturbed rig
//! cargo run -p docktwin-control --example rig_bode -- foreseen      # motion known 1 ms ahead
//! cargo run -p docktwin-control --example rig_bode -- kp=20 zeta=0.5 hp=3 lead=0 rate=2000
//! ```
#![expect(clippy::unwrap_used, reason = "an example stops where something is wrong")]

use std::{path::Path, thread};

use docktwin_control::{leg::LegTuning, response::Bench, rig::RigSetup};
use docktwin_core::DVec3;
use docktwin_model::{DockingWorkspace, HydraulicPreset, Place, load_rig};

const DOFS: [&str; 6] = ["X", "Y", "Z", "roll", "pitch", "yaw"];

/// Worst figures of a set of measurements, and where.
#[derive(Clone, Debug)]
struct Worst {
    db: [f64; 2],
    deg: [f64; 2],
    cross_10: f64,
    flat: (f64, String),
    cross: (f64, String),
    coherence: f64,
    failed: usize,
}

impl Worst {
    const fn new() -> Self {
        Self {
            db: [f64::MAX, f64::MIN],
            deg: [f64::MAX, f64::MIN],
            cross_10: 0.0,
            flat: (0.0, String::new()),
            cross: (0.0, String::new()),
            coherence: 1.0,
            failed: 0,
        }
    }

    fn join(&mut self, o: Self) {
        self.db = [self.db[0].min(o.db[0]), self.db[1].max(o.db[1])];
        self.deg = [self.deg[0].min(o.deg[0]), self.deg[1].max(o.deg[1])];
        self.cross_10 = self.cross_10.max(o.cross_10);
        if o.flat.0 > self.flat.0 {
            self.flat = o.flat;
        }
        if o.cross.0 > self.cross.0 {
            self.cross = o.cross;
        }
        self.coherence = self.coherence.min(o.coherence);
        self.failed += o.failed;
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let has = |w: &str| words.iter().any(|x| x == w);
    let number =
        |key: &str| words.iter().find_map(|w| w.strip_prefix(key)?.strip_prefix('=')?.parse().ok());
    let seed: Option<f64> = number("seed");
    let amplitude = number("mm").unwrap_or(2.0) * 1e-3;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf/stewart.urdf");
    let rig = load_rig(&path).unwrap().model;
    let named = HydraulicPreset::WORDS.iter().any(|(w, _)| has(w));
    let lever_m = 2.0;

    let mut places = vec![Place([0.0; 6])];
    places.extend(DockingWorkspace::corners());
    if has("sample") {
        places = [0, 1, 12, 27, 38, 64].map(|i| places[i]).to_vec();
    }
    for (word, preset) in HydraulicPreset::WORDS {
        if named && !has(word) {
            continue;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a seed")]
        let mut setup = RigSetup::of_rig(&rig, preset, seed.map(|s| s as u64));
        let t = &mut setup.tuning;
        let model = setup.believed_legs[0];
        t.position_gain_1_s = number("kp").unwrap_or(t.position_gain_1_s);
        t.high_pass_hz = number("hp").unwrap_or(t.high_pass_hz);
        t.rate_hz = number("rate").unwrap_or(t.rate_hz);
        if let Some(zeta) = number("zeta") {
            t.pressure_gain_m_s_n = LegTuning::pressure_gain(&model, 2500.0, zeta);
        }
        if let Some(lead) = number("lead") {
            t.valve_lead = (lead > 0.0).then_some([lead, number("lz").unwrap_or(0.8)]);
        }
        if let Some(slew) = number("slew") {
            setup.legs.iter_mut().for_each(|l| l.valve.slew_per_s = slew);
        }
        if has("ideal") {
            setup.legs = setup.legs.map(|l| l.ideal());
            setup.believed_legs = setup.believed_legs.map(|l| l.ideal());
        }
        if has("no-friction-feedforward") {
            setup.believed_legs = setup.believed_legs.map(|l| l.ideal());
        }
        println!("\n{word}: {:?}", setup.tuning);
        let payloads = [
            ("none", DVec3::ZERO),
            ("1e6 N/m axial", DVec3::X * 1e6),
            ("1e6 N/m lateral", DVec3::Y * 1e6),
        ];
        for (name, payload_n_m) in payloads {
            let bench = |place: &Place| Bench {
                setup: setup.clone(),
                x_34: rig.docking.pose(place.0),
                payload_n_m,
                lever_m,
                foreseen: has("foreseen"),
            };
            // Linear: poles everywhere.
            let (mut damping, mut slowest, mut linear_10, mut linear_flat) =
                (1.0f64, f64::MAX, 0.0f64, 0.0f64);
            for place in &places {
                let b = bench(place);
                let l = b.linear().unwrap();
                damping = damping.min(l.least_damping(1000.0).unwrap());
                slowest = slowest.min(l.poles().unwrap()[0].frequency_hz);
                for dof in 0..6 {
                    linear_10 =
                        linear_10.max(b.linear_point(&l, dof, 10.0).unwrap().gain_db(dof).abs());
                    for hz in [0.5, 1.0, 2.0, 3.0, 4.0, 5.0] {
                        let p = b.linear_point(&l, dof, hz).unwrap();
                        linear_flat = linear_flat.max((p.response[dof].norm() - 1.0).abs());
                    }
                }
            }
            println!(
                "  payload {name}: least damping {damping:.3}, slowest pole {slowest:.2} Hz; linear \
                 model: 10 Hz {linear_10:.2} dB, 0-5 Hz {:.1} %",
                100.0 * linear_flat
            );
            if has("poles") {
                continue;
            }
            let measure = |places: &[Place]| {
                let mut w = Worst::new();
                for place in places {
                    let b = bench(place);
                    for (dof, dof_name) in DOFS.iter().enumerate() {
                        let a = if dof < 3 { amplitude } else { amplitude / lever_m };
                        // Frequency, time to settle, time to measure.
                        let tests = [
                            (0.5, 1.0, 2.0),
                            (1.0, 0.7, 1.0),
                            (2.0, 0.7, 0.5),
                            (3.0, 0.7, 0.34),
                            (4.0, 0.7, 0.25),
                            (5.0, 0.7, 0.2),
                            (10.0, 0.7, 0.2),
                        ];
                        let some = |hz: f64| !has("quick") || [1.0, 4.0, 10.0].contains(&hz);
                        let tests = tests.into_iter().filter(|t| some(t.0));
                        for (hz, settle, window) in tests {
                            let Ok(p) = b.stepped_sine(dof, a, hz, settle, window) else {
                                w.failed += 1;
                                continue;
                            };
                            let at = || format!("{dof_name} {hz} Hz, {place}");
                            w.coherence = w.coherence.min(p.coherence);
                            if hz > 9.0 {
                                let (db, deg) = (p.gain_db(dof), p.phase_deg(dof));
                                w.db = [w.db[0].min(db), w.db[1].max(db)];
                                w.deg = [w.deg[0].min(deg), w.deg[1].max(deg)];
                                w.cross_10 = w.cross_10.max(p.cross_coupling(dof));
                            } else {
                                let flat = (p.response[dof].norm() - 1.0).abs();
                                if flat > w.flat.0 {
                                    w.flat = (flat, at());
                                }
                                if p.cross_coupling(dof) > w.cross.0 {
                                    w.cross = (p.cross_coupling(dof), at());
                                }
                            }
                        }
                    }
                }
                w
            };
            let mut all = Worst::new();
            let half = places.len().div_ceil(2);
            thread::scope(|s| {
                let parts: Vec<_> =
                    places.chunks(half).map(|part| s.spawn(|| measure(part))).collect();
                for part in parts {
                    all.join(part.join().unwrap());
                }
            });
            println!(
                "    measured at {} mm: 10 Hz {:+.2}..{:+.2} dB, {:.0}..{:.0} deg, coupling {:.3}; \
                 0-5 Hz {:.1} % ({}), coupling {:.3} ({}); coherence over {:.4}; failed {}",
                amplitude * 1e3,
                all.db[0],
                all.db[1],
                all.deg[0],
                all.deg[1],
                all.cross_10,
                100.0 * all.flat.0,
                all.flat.1,
                all.cross.0,
                all.cross.1,
                all.coherence,
                all.failed
            );
        }
    }
}
