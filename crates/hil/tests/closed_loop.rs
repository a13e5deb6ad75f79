//! The whole loop on the emulated rig, in virtual time: Table 4 without compensation.

use std::{path::Path, time::Duration};

use docktwin_control::{
    compensator::Compensation, rig::RigSetup, safety::SafetyLimits, sensing::SensorScheme,
};
use docktwin_hil::{
    clock::VirtualClock,
    emulated::EmulatedRig,
    in_process::InProcess,
    scheduler::{Approach, LegCorrections, Loop, LoopSetup, Phase, TickRecord},
    vibro::{Axis, Contact, TABLE_4, VibroTest},
};
use docktwin_model::{
    DockingMechanism, HydraulicPreset, Rig, Spacecraft, load_mechanism, load_rig, load_spacecraft,
};
use docktwin_physics::{mounted::Payload, programme::Programme};

const TICK_NS: u64 = 1_000_000;

struct Models {
    rig: Rig,
    stick: DockingMechanism,
    body: Spacecraft,
}

fn models() -> Models {
    let at = |f: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf").join(f);
    Models {
        rig: load_rig(&at("stewart.urdf")).unwrap().model,
        stick: load_mechanism(&at("stick_active.urdf"), &at("stick_passive.urdf"), None)
            .unwrap()
            .model,
        body: load_spacecraft(&at("test_2026kg.urdf")).unwrap().model,
    }
}

fn run(
    m: &Models,
    test: &VibroTest,
    compensation: Compensation,
) -> (Vec<TickRecord>, Vec<Contact>) {
    let preset = HydraulicPreset::Printed;
    let believed = RigSetup::of_rig(&m.rig, preset, None);
    let bodies = Programme::new(&test.system, &test.bodies, 1e-3);
    let rest = m.rig.docking.pose([0.0; 6]);
    let emulated = EmulatedRig::new(&m.rig, preset, None, 1, test.system.clone(), &rest).unwrap();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ticks")]
    let ticks = (test.duration_s(1) * 1e3) as u64;
    let setup = LoopSetup {
        feedforward: believed.feedforward(),
        corrections: LegCorrections::default(),
        bodies,
        compensation,
        scheme: SensorScheme::Single,
        payload: Payload::of(m.rig.passive_payload, &m.rig.x_4p.inverse()),
        interface_delay_s: 1e-3,
        limits: SafetyLimits::of_rig(&m.rig, 5e3, 5e3),
        approach: Approach {
            speed_m_s: 0.05,
            rate_rad_s: 0.05,
            settle_s: 0.5,
            run_up_s: test.run_up_s(),
        },
        ticks,
        session: 1,
        patience: Duration::ZERO,
        dry_run: false,
        rig: m.rig.clone(),
    };
    let idle = Loop::new(setup, InProcess::new(emulated), VirtualClock::new(TICK_NS));
    let mut running = idle.arm(Vec::new()).unwrap().start();
    let mut records = Vec::new();
    while !running.finished() {
        records.push(running.tick(&docktwin_physics::reduced::Inputs::default()).unwrap());
    }
    if let Some(t) = running.stop().end().trip {
        panic!("{t:?}");
    }
    let samples: Vec<_> = records
        .iter()
        .filter(|r| r.phase == Phase::Closed)
        .map(|r| test.sample(r, r.closed_tick.unwrap() as f64 * 1e-3))
        .collect();
    let contacts = test.judge(&samples);
    (records, contacts)
}

#[test]
fn probe() {
    let m = models();
    for axis in ["y", "z", "roll", "pitch"] {
        let axis = Axis::ALL.iter().find(|a| a.0 == axis).unwrap().1;
        for row in TABLE_4 {
            let test = VibroTest::new(row, &[axis], &m.body, &m.stick).unwrap();
            for c in [Compensation::None, Compensation::Lead(0.0017)] {
                let begin = std::time::Instant::now();
                let (records, contacts) = run(&m, &test, c);
                let e = begin.elapsed().as_secs_f64();
                println!(
                    "{} {:.3} Hz {c:?} ticks {} {e:.1} s",
                    axis.name(),
                    row.frequency_hz,
                    records.len()
                );
                for c in contacts {
                    println!(
                        "   e {:+.4} t {:+.4} ts {:+.4} pk {:+.4} nf {:.4} nx {:.4}",
                        c.r_e - 1.0,
                        c.r_t - 1.0,
                        c.r_t_sensed - 1.0,
                        c.peak_ratio - 1.0,
                        c.nrms_force,
                        c.nrms_position
                    );
                }
            }
        }
    }
}
