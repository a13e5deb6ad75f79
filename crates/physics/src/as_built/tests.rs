use std::path::Path;

use docktwin_model::load_mechanism;

use super::*;

fn apas() -> DockingMechanism {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/urdf");
    let [a, p] = ["active", "passive"].map(|side| models.join(format!("apas_{side}.urdf")));
    load_mechanism(&a, &p, None).expect("shipped").model
}

fn drawn(m: &DockingMechanism, number: u64, grade: Grade) -> AsBuilt {
    draw(m, MechanismDraw { number, grade }).expect("it has a spread")
}

/// Half-width of a quantity, by its name, and the middle about which it is drawn.
fn about(m: &DockingMechanism, name: &str, grade: Grade) -> (f64, f64) {
    let s = m.spread.expect("it has a spread");
    let place = if grade == Grade::Fine { s.position_fine_m } else { s.position_coarse_m };
    let starts = |with: &str| name.starts_with(with);
    match name {
        "contact_stiffness" => (1.0, s.contact_stiffness),
        "friction" => (1.0, s.friction),
        "ring_mass" => (1.0, s.ring_mass),
        _ if starts("petal_rigidity") => (1.0, s.petal_rigidity),
        _ if starts("curves") => (1.0, s.attenuator_curves),
        _ if starts("brake") => (1.0, s.brake),
        _ if name.ends_with("_m") => (0.0, place),
        _ if name.ends_with("_rad") => (0.0, place / m.active.ring.mean_radius_m),
        _ => panic!("{name} is not known here"),
    }
}

/// Every quantity fills its half-width evenly: mean and deviation of a uniform draw, w/√3.
#[test]
fn oracle_every_quantity_is_uniform_within_its_spread() {
    let m = apas();
    for grade in [Grade::Fine, Grade::Coarse] {
        let draws: Vec<AsBuilt> = (1..=400).map(|i| drawn(&m, i, grade)).collect();
        assert_eq!(draws[0].drawn.len(), 3 + 2 + 4 + 1 + 3 * (3 + 3 + 3) + 2 * 6);
        for (i, first) in draws[0].drawn.iter().enumerate() {
            let (middle, half) = about(&m, &first.name, grade);
            let x: Vec<f64> = draws.iter().map(|d| (d.drawn[i].value - middle) / half).collect();
            let n = 400.0;
            let mean = x.iter().sum::<f64>() / n;
            let deviation = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
            let name = &first.name;
            assert!(x.iter().all(|x| x.abs() <= 1.0), "{name} leaves its spread");
            // Four standard errors of each.
            assert!(mean.abs() < 4.0 * (1.0 / 3.0 / n).sqrt(), "{name}: mean {mean}");
            assert!((deviation - 1.0 / 3f64.sqrt()).abs() < 0.05, "{name}: {deviation}");
        }
        // No two quantities are one draw.
        for i in 0..draws[0].drawn.len() {
            for j in 0..i {
                let of = |d: &AsBuilt, k: usize| {
                    let (middle, half) = about(&m, &d.drawn[k].name, grade);
                    (d.drawn[k].value - middle) / half
                };
                let r = draws.iter().map(|d| 3.0 * of(d, i) * of(d, j)).sum::<f64>() / 400.0;
                assert!(
                    r.abs() < 0.25,
                    "{} and {}",
                    draws[0].drawn[i].name,
                    draws[0].drawn[j].name
                );
            }
        }
    }
}

/// What the record says was drawn is what the mechanism has.
#[test]
fn oracle_the_mechanism_has_what_was_drawn() {
    let m = apas();
    let d = drawn(&m, 7, Grade::Coarse);
    let value = |name: &str| {
        d.drawn.iter().find(|x| x.name == name).unwrap_or_else(|| panic!("no {name}")).value
    };
    let law = |m: &DockingMechanism| crate::contact::law::stiffness(&m.contact.normal);
    let b = &d.mechanism;
    assert!((law(b) - law(&m) * value("contact_stiffness")).abs() < 1e-6);
    assert!(
        (b.contact.friction_kinetic - m.contact.friction_kinetic * value("friction")).abs() < 1e-15
    );
    assert!(b.contact.friction_static >= b.contact.friction_kinetic);
    assert!((b.ring_body.mass_kg - m.ring_body.mass_kg * value("ring_mass")).abs() < 1e-12);
    let rigidity = |m: &DockingMechanism| m.passive.petals.expect("petals").flexural_rigidity_n_m2;
    assert!((rigidity(b) - rigidity(&m) * value("petal_rigidity_passive")).abs() < 1e-9);
    let axial = |m: &DockingMechanism| match &m.attenuator {
        Attenuator::Characteristic(a) => a.axial.clone(),
        _ => panic!("by tables"),
    };
    let (was, is) = (axial(&m), axial(b));
    let scaled = was.loading.points[1][1] * value("curves_axial");
    assert!((is.loading.points[1][1] - scaled).abs() < 1e-9 && is.loading == is.unloading);
    let force = |c: &AxisChannel| c.series_brake.expect("a brake").force;
    assert!((force(&is) - force(&was) * value("brake_axial")).abs() < 1e-9);
    assert!((b.offsets.passive_petals_m[2].y - value("petal_passive_2_radial_m")).abs() < 1e-18);
    assert!((b.offsets.latches_m[1].z - value("latch_1_tangential_m")).abs() < 1e-18);
    assert!((d.mounts[1].p.x - value("mount_e4_x_m")).abs() < 1e-18);
    assert!((d.mounts[0].q.to_scaled_axis().z - value("mount_e3_about_z_rad")).abs() < 1e-15);
}

#[test]
fn invariant_a_draw_repeats_and_a_number_is_a_draw() {
    let mut m = apas();
    assert_eq!(drawn(&m, 3, Grade::Fine), drawn(&m, 3, Grade::Fine));
    assert_ne!(drawn(&m, 3, Grade::Fine), drawn(&m, 4, Grade::Fine));
    // The grade scales the places and moves nothing else.
    let [fine, coarse] = [Grade::Fine, Grade::Coarse].map(|g| drawn(&m, 3, g));
    assert_eq!(fine.mechanism.contact, coarse.mechanism.contact);
    let ratio = coarse.mounts[0].p.x / fine.mounts[0].p.x;
    assert!((ratio - 1e-3 / 3e-4).abs() < 1e-9, "{ratio}");
    // A spread of zero takes one quantity out and moves no other.
    let spread = m.spread.as_mut().expect("it has a spread");
    spread.friction = 0.0;
    let without = drawn(&m, 3, Grade::Fine);
    let friction = |m: &DockingMechanism| m.contact.friction_kinetic;
    assert!((friction(&without.mechanism) - friction(&m)).abs() < 1e-15);
    assert_eq!(without.mechanism.contact.normal, fine.mechanism.contact.normal);
    assert_eq!(without.mechanism.offsets, fine.mechanism.offsets);
    m.spread = None;
    assert_eq!(draw(&m, MechanismDraw { number: 3, grade: Grade::Fine }), None);
}
