//! `rig calibrate` and `rig identify`: what was found, in a file and in words.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use docktwin_hil::{
    calibrate::{Calibration, SensorB},
    identify::Identification,
};
use docktwin_run::{
    commission::{self, CalibrateOptions, DriveOptions, IdentifyOptions, Stand},
    rigfile::{DOFS, RigFile, can_write_in, write, write_new},
};

use super::{CalibrateArgs, IdentifyArgs, MeasureArgs};
use crate::{
    args::PresetArg, failure::Failure, inputs::loader, observers::AtTerminal, results::timestamp,
};

impl MeasureArgs {
    fn stand(&self) -> Result<Stand, Failure> {
        Ok(Stand::load(&self.built.options(&self.model)?)?)
    }

    fn drive(&self) -> DriveOptions {
        DriveOptions {
            place: self.rig.clone(),
            clock: self.led.clock.kind(),
            realtime: self.led.realtime.options(),
        }
    }

    fn at_x_m(&self) -> Option<f64> {
        self.at_x_mm.map(|mm| mm * 1e-3)
    }

    /// Whether a file can be written once it is found: looked at before minutes of rig time, not after.
    fn can_write(&self, path: Option<&Path>, option: &str) -> Result<(), Failure> {
        let path = path.unwrap_or_else(|| Path::new("calibrations/file"));
        if path.exists() {
            return Err(Failure::Usage {
                what: format!("{} is there already", path.display()),
                remedy: format!("name a new file with {option}, or move that one away"),
            });
        }
        can_write_in(path.parent().unwrap_or(Path::new("."))).map_err(|e| Failure::Usage {
            what: format!("{} cannot be written: {e}", path.display()),
            remedy: format!("name a file in a folder of yours with {option}"),
        })
    }

    /// Writes the file and says where it is.
    fn finish<T: RigFile>(
        &self,
        content: &T,
        words: &[String],
        json: bool,
    ) -> Result<ExitCode, Failure> {
        let path = self.out.clone().unwrap_or_else(|| {
            let rig = &content.origin().rig;
            Path::new("calibrations").join(format!("{rig}-{}-{}.toml", T::COMMAND, timestamp()))
        });
        let digest = write(&path, content).map_err(docktwin_run::RunError::from)?;
        if json {
            println!(
                "{}",
                serde_json::json!({ "file": path, "digest": digest.to_string(), "found": content })
            );
        } else {
            words.iter().for_each(|l| println!("{l}"));
            println!("written      {}, digest {digest}", path.display());
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Runs `rig identify`.
pub(super) fn identify(args: &IdentifyArgs, json: bool) -> Result<ExitCode, Failure> {
    let m = &args.measure;
    let asked = IdentifyOptions {
        at_x_m: m.at_x_m(),
        dofs: args.dof.iter().map(|d| *d as usize).collect(),
        room_m: args.room_mm * 1e-3,
    };
    if let Some(drive) = &args.drive {
        m.can_write(Some(drive), "--drive")?;
        if m.out.as_ref() == Some(drive) {
            return Err(Failure::Usage {
                what: format!("{} is to be both files", drive.display()),
                remedy: "name different files with --out and --drive".to_owned(),
            });
        }
    }
    m.can_write(m.out.as_deref(), "--out")?;
    let mut operator = AtTerminal { yes: m.led.yes, quiet: json };
    let (found, file) = commission::identify(m.stand()?, &m.drive(), &asked, &mut operator)?;
    let done = m.finish(&file, &identified(&found), json)?;
    if let Some(path) = &args.drive {
        write_new(path, &file.drive_table()).map_err(docktwin_run::RunError::from)?;
        if !json {
            println!("drive        {}: the table [drive] of a measured rig", path.display());
        }
    }
    Ok(done)
}

fn identified(found: &Identification) -> Vec<String> {
    let mut words = vec![format!(
        "delay        {:.3} ms from the instant a command is for to the plate ({:.3} ms before \
         corrections)",
        found.delay_s() * 1e3,
        found.found.lag_s * 1e3
    )];
    let (a, b) = (&found.found, &found.corrected);
    if let Some((was, is)) = a.legs.as_ref().zip(b.legs.as_ref()) {
        for i in 0..6 {
            let at_rest = was.hold_error_m[i] * 1e6;
            words.push(a.valves.map_or_else(
                || {
                    let late = was.lag_s[i] * 1e3;
                    format!("leg {i}        {late:.3} ms behind; at standstill {at_rest:+.1} um")
                },
                |v| {
                    format!(
                        "leg {i}        null bias {:+.4} % of stroke, flow gain {:.4}, friction {:.0} N; at standstill \
                         {at_rest:+.1} um, corrected {:+.1} um",
                        v.null_bias[i] * 100.0,
                        v.flow_gain[i],
                        v.friction_n[i],
                        is.hold_error_m[i] * 1e6
                    )
                },
            ));
        }
    }
    if a.valves.is_none() {
        words.push(
            "valves       none, or their openings are not reported: nothing to correct".to_owned(),
        );
    }
    words.extend(found.response.iter().map(|p| {
        format!(
            "{:<5} {:>6.3} Hz  |G| {:.4}, {:+.2} deg, coupling {:.3}",
            DOFS[p.dof],
            p.hz,
            p.gain.norm(),
            p.gain.arg().to_degrees(),
            p.coupling
        )
    }));
    words
}

/// Runs `rig calibrate`.
pub(super) fn calibrate(args: &CalibrateArgs, json: bool) -> Result<ExitCode, Failure> {
    let m = &args.measure;
    m.can_write(m.out.as_deref(), "--out")?;
    let asked = CalibrateOptions {
        at_x_m: m.at_x_m(),
        identification: args.identification.clone(),
        touch_m: args.touch_mm.map(|mm| mm * 1e-3),
        corrections: None,
    };
    let mut operator = AtTerminal { yes: m.led.yes, quiet: json };
    let (found, file) = commission::calibrate(m.stand()?, &m.drive(), &asked, &mut operator)?;
    m.finish(&file, &calibrated(&found), json)
}

fn calibrated(found: &Calibration) -> Vec<String> {
    let us = |s: f64| s * 1e6;
    let tare = &found.tare_a;
    let mut words = found.of_b.as_ref().map(of_b).unwrap_or_default();
    words.push(format!("tare of A    ({:.2}, {:.2}, {:.2}) N", tare.f.x, tare.f.y, tare.f.z));
    words.push(found.delay_a_s.map_or_else(
        || "delay of A   not looked at: it needs a touch (--touch-mm)".to_owned(),
        |s| format!("delay of A   {:.1} us behind positions of the same stamp", us(s)),
    ));
    if let Some(b) = found.of_b {
        words.push(format!(
            "delay of B   {:.1} us behind positions of the same stamp",
            us(b.delay_s)
        ));
    }
    if let Some(s) = found.accelerometer_delay_s {
        words.push(format!("accelerometers {:.1} us behind positions of the same stamp", us(s)));
    }
    words
}

fn of_b(b: &SensorB) -> Vec<String> {
    let (p, c, zero) = (&b.payload, b.payload.com_m, &b.zero);
    let i = p.inertia_kg_m2.to_cols_array_2d();
    vec![
        format!(
            "B carries    {:.3} kg, mass centre ({:.4}, {:.4}, {:.4}) m",
            p.mass_kg, c.x, c.y, c.z
        ),
        format!("             inertia {:.2}, {:.2}, {:.2} kg m2", i[0][0], i[1][1], i[2][2]),
        format!(
            "zero of B    ({:.2}, {:.2}, {:.2}) N, ({:.2}, {:.2}, {:.2}) N m",
            zero.f.x, zero.f.y, zero.f.z, zero.m.x, zero.m.y, zero.m.z
        ),
        format!("unexplained  {:.3} N, {:.3} N m", b.rest[0], b.rest[1]),
    ]
}

/// Options of an emulated rig.
impl super::BuiltArgs {
    pub(super) fn options(&self, model: &Path) -> Result<commission::StandOptions, Failure> {
        Ok(commission::StandOptions {
            model: PathBuf::from(model),
            scenario: self.scenario.clone(),
            loader: loader(&self.set)?,
            seed: self.seed,
            perturb: self.perturb,
            mechanism: self.mechanism.options()?,
            preset: self.preset.map(PresetArg::preset),
        })
    }
}
