//! A whole docking with the default mechanism.
mod common;
use common::*;
use docktwin_physics::{mechanism::System, reduced::Inputs};

#[test]
fn regress_nominal() {
    let sys = System::new(&chaser(), &target(), apas());
    for (v, c) in [
        (0.05, conditions(0.05, 0.05, 0.0, [2.0, 2.0, 0.0])),
        (0.10, conditions(0.10, 0.05, 0.0, [2.0, 2.0, 0.0])),
        (0.35, conditions(0.35, 0.05, 0.0, [15.0, 7.0, 0.0])),
        (0.10, conditions(0.10, 0.10, 0.0, [4.0, 4.0, 0.0])),
    ] {
        let mut s = start(&sys, &c, 0.02);
        let p0 = sys.momentum(&s);
        let m0 = sys.measure(&s.mechanism, &s.poses());
        let e0 = sys.energy(&s, &m0);
        let t0 = std::time::Instant::now();
        let h = 1e-4;
        let n = 200_000;
        let mut worst = 0.0f64;
        for i in 0..n {
            sys.step(&mut s, &Inputs::default(), h);
            if i % 100 == 0 {
                let m = sys.measure(&s.mechanism, &s.poses());
                let e = sys.energy(&s, &m);
                let bal = (e.kinetic + e.stored + e.lost - e0.kinetic) / e0.kinetic;
                if bal.abs() > 1e-3 {
                    println!(
                        "!! t {:.4} bal {bal:.4} {e:?} contact {} {:?} gaps {:?}",
                        f64::from(i) * h,
                        m.contacts().stored_j(),
                        m.contacts(),
                        m.latches
                    );
                }
                worst =
                    worst.max(((e.kinetic + e.stored + e.lost - e0.kinetic) / e0.kinetic).abs());
            }
            if i % 10000 == 0 {
                let m = sys.measure(&s.mechanism, &s.poses());
                let x = m.poses().x_wr.inverse() * m.poses().x_wp;
                println!(
                    "t {:.2} x {:.4} {:.4} {:.4} defl {:?} latch {:?} touch {}",
                    f64::from(i) * h,
                    x.p.x,
                    x.p.y,
                    x.p.z,
                    m.deflection(),
                    s.mechanism.latches.map(|l| l.phase as u8),
                    m.contacts().touching()
                );
            }
        }
        let m = sys.measure(&s.mechanism, &s.poses());
        let e = sys.energy(&s, &m);
        println!(
            "v {v} wall us/step {:.2} peak {} depth {} captured {:?} first {:?} latches {:?}",
            t0.elapsed().as_secs_f64() * 1e6 / f64::from(n),
            s.peak_force_n,
            s.peak_depth_m,
            s.mechanism.captured_s(),
            s.first_contact_s,
            s.mechanism.latches.map(|l| l.times_s[2])
        );
        println!("e0 {:?} e {:?} {:?} worst {worst:e}", e0, e, s.mechanism.losses);
        let p = sys.momentum(&s);
        println!("dp {:?} dl {:?}", (p.f - p0.f).length(), (p.m - p0.m).length());
        assert!(worst < 1.0);
    }
}
