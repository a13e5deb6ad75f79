//! Reading what moves the legs of a rig: `[drive]`, and the tables that go with its kind.

use nalgebra::Complex;

use crate::drive::{DRIVES, DriveWord};
use crate::keys::read::Section;
use crate::{
    Drive, HydraulicDrive, HydraulicPreset, Hydraulics, MeasuredDrive, MeasuredPoint, OilVolume,
    PositionLoop, SealFriction, ServoValve, Spread,
};

/// Largest distance of the fitted from the measured response, over the measured one.
const MOST_RESIDUAL: f64 = 0.05;

/// A loop behind a problem that was reported.
const PLACEHOLDER: PositionLoop = PositionLoop {
    natural_frequency_hz: f64::NAN,
    damping_ratio: None,
    delay_s: f64::NAN,
    acceleration_m_s2: None,
};

/// `[drive]`, hydraulic without it, and the tables of oil, valves and seals where there is oil.
pub(crate) fn read_drive(t: Section<'_, '_, '_>) -> Drive {
    let without_oil = t.optional_section("drive", |d| match d.choice("kind", &DRIVES) {
        Some(DriveWord::PositionLoop) => Some(Drive::PositionLoop(read_loop(d))),
        Some(DriveWord::Measured) => Some(Drive::Measured(read_measured(d))),
        Some(DriveWord::Hydraulic) | None => None,
    });
    let Some(drive) = without_oil.flatten() else {
        return Drive::Hydraulic(HydraulicDrive {
            hydraulics: t.section("hydraulics", read_hydraulics),
            valve: t.section("valve", read_valve),
            friction: t.section("friction", read_friction),
        });
    };
    for table in ["hydraulics", "valve", "friction"] {
        if t.has(table) {
            t.refuse(
                table,
                "belongs to a hydraulic drive, and drive.kind is another",
                "remove the table",
            );
        }
    }
    drive
}

fn read_loop(t: Section<'_, '_, '_>) -> PositionLoop {
    let order = t.count("order");
    PositionLoop {
        natural_frequency_hz: t.number("natural_frequency_hz"),
        damping_ratio: (order == 2).then(|| t.number("damping_ratio")),
        delay_s: t.number("delay_s"),
        acceleration_m_s2: t.optional_number("acceleration_m_s2"),
    }
}

/// Most points of a response.
const MOST_ROWS: usize = 1000;
/// How far `lag_s` and the lag of the response may be apart: so much, s, and so large a part of it.
const LEAST_LAG_S: f64 = 0.001;
const LAG_SHARE: f64 = 0.1;
/// Frequencies (Hz) and gains that a drive may have been measured at and with.
const HZ: core::ops::RangeInclusive<f64> = 0.01..=200.0;
const GAIN: core::ops::RangeInclusive<f64> = 0.01..=10.0;

fn read_measured(t: Section<'_, '_, '_>) -> MeasuredDrive {
    let lag_s = t.number("lag_s");
    let rows = t.rows::<3>("response_hz_1_deg");
    let acceleration_m_s2 = t.optional_number("acceleration_m_s2");
    let failed =
        || MeasuredDrive { lag_s, response: Vec::new(), fitted: PLACEHOLDER, residual: f64::NAN };
    if rows.len() > MOST_ROWS {
        t.refuse(
            "response_hz_1_deg",
            format!("has {} rows, of which an identification has 54", rows.len()),
            "give 2 to 1000 rows",
        );
        return failed();
    }
    let wrong = rows.iter().find(|[hz, gain, _]| !(HZ.contains(hz) && GAIN.contains(gain)));
    if let Some([hz, gain, _]) = wrong {
        t.refuse(
            "response_hz_1_deg",
            format!("has a gain of {gain} at {hz} Hz"),
            "give rows of frequency (0.01 to 200 Hz), gain (0.01 to 10) and phase in degrees",
        );
        return failed();
    }
    let points = |[hz, gain, deg]: &[f64; 3]| MeasuredPoint {
        hz: *hz,
        gain: Complex::from_polar(*gain, deg.to_radians()),
    };
    let response: Vec<_> = rows.iter().map(points).collect();
    let first = response.first().map_or(0.0, |p| p.hz);
    if response.len() >= 2 && response.iter().all(|p| (p.hz - first).abs() < 1e-9) {
        t.refuse(
            "response_hz_1_deg",
            format!("has the one frequency of {first} Hz, which tells no delay from a lag"),
            "give rows of two frequencies or more",
        );
        return failed();
    }
    if response.len() < 2 || !lag_s.is_finite() {
        return failed();
    }
    let found = MeasuredDrive::fit(lag_s, response, acceleration_m_s2);
    match found {
        Some(fit) if fit.residual <= MOST_RESIDUAL => {
            let of_fit_s = fit.fitted_lag_s();
            if (of_fit_s - lag_s).abs() > LEAST_LAG_S + LAG_SHARE * lag_s.abs() {
                t.refuse(
                    "lag_s",
                    format!("is not that of the response, which is {:.3} ms late", of_fit_s * 1e3),
                    "give frequencies in Hz, phases in degrees with late negative, and `delay_s` of the same \
                     identification",
                );
            }
            fit
        }
        other => {
            let what = other.map_or_else(
                || "is near to no stable position loop".to_owned(),
                |m| {
                    format!(
                        "is not that of a position loop with a delay: the nearest one ({}) misses it \
                         by {:.1} %, at most {:.0} % are taken",
                        m.fitted.words(),
                        100.0 * m.residual,
                        100.0 * MOST_RESIDUAL
                    )
                },
            );
            t.refuse(
                "response_hz_1_deg",
                what,
                "leave out frequencies above those that dockings have, 5 Hz, or measure it again with \
                 `rig identify`",
            );
            failed()
        }
    }
}

fn read_hydraulics(t: Section<'_, '_, '_>) -> Hydraulics {
    let volume = |p: Section<'_, '_, '_>| OilVolume {
        total_volume_m3: p.number("total_volume_m3"),
        leakage_m3_s_pa: p.number("leakage_m3_s_pa"),
    };
    Hydraulics {
        area_m2: t.number("area_m2"),
        bulk_modulus_pa: t.number("bulk_modulus_pa"),
        viscous_n_s_m: t.number("viscous_n_s_m"),
        dead_volume_m3: t.number("dead_volume_m3"),
        printed: t.section("printed", volume),
        consistent: t.section("consistent", volume),
        stiff: t.section("stiff", volume),
        // A placeholder behind a problem that was reported.
        default_preset: t
            .choice("default", &HydraulicPreset::WORDS)
            .unwrap_or(HydraulicPreset::Printed),
    }
}

fn read_valve(t: Section<'_, '_, '_>) -> ServoValve {
    ServoValve {
        natural_frequency_hz: t.number("natural_frequency_hz"),
        damping_ratio: t.number("damping_ratio"),
        no_load_flow_m3_s: t.number("no_load_flow_m3_s"),
        slew_per_s: t.number("slew_full_strokes_per_s"),
        null_bias: t.number("null_bias"),
        supply_pressure_pa: t.number("supply_pressure_pa"),
        dead_time_s: t.number("dead_time_s"),
    }
}

fn read_friction(t: Section<'_, '_, '_>) -> SealFriction {
    let friction = SealFriction {
        coulomb_n: t.number("coulomb_n"),
        static_n: t.number("static_n"),
        stribeck_velocity_m_s: t.number("stribeck_velocity_m_s"),
        bristle_n_m: t.number("bristle_n_m"),
        bristle_damping_n_s_m: t.number("bristle_damping_n_s_m"),
    };
    if friction.static_n < friction.coulomb_n {
        t.refuse(
            "static_n",
            format!("is below the Coulomb friction, {} N", friction.coulomb_n),
            "make it at least the Coulomb friction",
        );
    }
    friction
}

/// The half-widths of `[spread]` that the kind of drive has.
pub(crate) fn read_spread(t: Section<'_, '_, '_>, drive: &Drive) -> Spread {
    t.section("spread", |s| {
        let both = Spread {
            plate_mass: s.number("plate_mass"),
            dead_time_s: s.number("dead_time_s"),
            ..Spread::default()
        };
        if drive.hydraulic().is_none() {
            return Spread {
                loop_frequency: s.number("loop_frequency"),
                loop_damping: s.optional_number("loop_damping").unwrap_or(0.0),
                ..both
            };
        }
        Spread {
            flow_gain: s.number("flow_gain"),
            null_bias: s.number("null_bias"),
            friction: s.number("friction"),
            bulk_modulus: s.number("bulk_modulus"),
            valve_frequency: s.number("valve_frequency"),
            ..both
        }
    })
}
