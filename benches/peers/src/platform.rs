//! The motion simulator's platform, for the comparison with MuJoCo's closed loops.
//!
//! Trajectory of `forces`: place i of the docking workspace (X, Y, Z, roll, pitch, yaw of `X_34`, in
//! half-widths) is `sin(2π f_i t)` with `f` = [`FREQUENCIES_HZ`]: all six axes at full amplitude,
//! faster than the legs could, so that nothing velocity brings is small.
//!
//! Motion of `release`: oil springs that hold the plate at rest in the middle of the workspace, valves
//! shut, no loss; the plate is let go at rest at another place.

use core::f64::consts::TAU;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use cpu_time::ThreadTime;
use docktwin_core::{DQuat, DVec3, Pose, Twist, Wrench};
use docktwin_model::{DockingWorkspace, HydraulicDrive, Rig, load_rig};
use docktwin_physics::{
    hydraulics::LegParameters,
    platform::Platform,
    rig::{ReducedRig, RigPlant, RigState},
};
use docktwin_twin::rig::FullRig;
use serde_json::{Value, json};

/// Of the six axes of the trajectory; the Python side has the same.
const FREQUENCIES_HZ: [f64; 6] = [0.2, 0.33, 0.47, 0.61, 0.79, 1.0];

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Leg forces along the trajectory, by inverse dynamics of the reduced rig
    Forces(Forces),
    /// Motion of the plate on its leg springs, let go at a place
    Release(Release),
}

#[derive(Debug, Args)]
pub(crate) struct Forces {
    /// Rig file, URDF
    rig: PathBuf,
    /// Length of the trajectory, s
    #[arg(long, default_value_t = 10.0)]
    until_s: f64,
    /// Time between two instants, s
    #[arg(long, default_value_t = 0.01)]
    sample_s: f64,
}

#[derive(Debug, Args)]
pub(crate) struct Release {
    /// Rig file, URDF
    rig: PathBuf,
    /// Where the plate is let go: X, Y, Z, roll, pitch, yaw in half-widths of the docking workspace
    #[arg(long, value_parser = six, allow_hyphen_values = true)]
    place: [f64; 6],
    /// Stiffness of a leg, N/m; the oil spring of the file's default preset if not given
    #[arg(long)]
    spring_n_m: Option<f64>,
    /// Step, ms; whole steps must fit between two poses
    #[arg(long, default_value_t = 0.25)]
    step_ms: f64,
    /// Simulated time, s
    #[arg(long, default_value_t = 2.0)]
    until_s: f64,
    /// Time between two poses in the result, s
    #[arg(long, default_value_t = 0.01)]
    sample_s: f64,
    /// The rig with all its bodies, in rapier, instead of the reduced one
    #[arg(long)]
    full: bool,
    /// How often the motion is repeated for its cost
    #[arg(long, default_value_t = 1)]
    laps: u32,
}

pub(crate) fn run(command: &Command) -> Result<Value, String> {
    match command {
        Command::Forces(args) => forces(args),
        Command::Release(args) => release(args),
    }
}

fn load(path: &Path) -> Result<Rig, String> {
    Ok(load_rig(path).map_err(|e| e.to_string())?.model)
}

/// Six numbers with commas between.
fn six(text: &str) -> Result<[f64; 6], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    let numbers = numbers.map_err(|e| e.to_string())?;
    numbers.try_into().map_err(|_| "give six numbers with commas between".to_owned())
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "times of a run")]
fn count(whole_s: f64, part_s: f64) -> u32 {
    (whole_s / part_s).round() as u32
}

/// `X_34` on the trajectory, its twist (velocity of `e4`'s origin, angular velocity) and the time
/// derivative of that, in `e3`.
fn trajectory(box_34: &DockingWorkspace, time_s: f64) -> (Pose, Twist, Twist) {
    let half = [
        box_34.axial_m,
        box_34.lateral_m,
        box_34.lateral_m,
        box_34.roll_rad,
        box_34.pitch_yaw_rad,
        box_34.pitch_yaw_rad,
    ];
    let w = FREQUENCIES_HZ.map(|f| TAU * f);
    let place = w.map(|w| (w * time_s).sin());
    let rate: [f64; 6] = core::array::from_fn(|i| half[i] * w[i] * (w[i] * time_s).cos());
    let second: [f64; 6] = core::array::from_fn(|i| -half[i] * w[i] * w[i] * place[i]);
    // (1): R = Ry(pitch) Rz(yaw) Rx(roll); each rate turns about an axis that the ones before carry.
    let pitch = DQuat::from_rotation_y(place[4] * half[4]);
    let yaw = pitch * DQuat::from_rotation_z(place[5] * half[5]);
    let (a_pitch, a_yaw, a_roll) = (DVec3::Y, pitch * DVec3::Z, yaw * DVec3::X);
    let w_pitch = a_pitch * rate[4];
    let w_yaw = w_pitch + a_yaw * rate[5];
    let turning = a_pitch * second[4]
        + a_yaw * second[5]
        + w_pitch.cross(a_yaw) * rate[5]
        + a_roll * second[3]
        + w_yaw.cross(a_roll) * rate[3];
    (
        box_34.pose(place),
        Twist { v: DVec3::new(rate[0], rate[1], rate[2]), w: w_yaw + a_roll * rate[3] },
        Twist { v: DVec3::new(second[0], second[1], second[2]), w: turning },
    )
}

fn forces(args: &Forces) -> Result<Value, String> {
    let rig = load(&args.rig)?;
    let platform = Platform::new(&rig);
    let n = count(args.until_s, args.sample_s);
    let states: Vec<_> = (0..=n)
        .map(|k| {
            let (x_34, t_34, a_34) = trajectory(&rig.docking, f64::from(k) * args.sample_s);
            (
                platform.plate_from_docking(&x_34),
                platform.plate_twist(&x_34, &t_34),
                platform.plate_acceleration(&x_34, &t_34, &a_34),
            )
        })
        .collect();
    let clock = ThreadTime::now();
    let forces_n: Option<Vec<_>> = states
        .iter()
        .map(|(x, t, a)| platform.inverse_dynamics(&platform.at(x), t, a, &Wrench::ZERO))
        .collect();
    let cpu_s = clock.elapsed().as_secs_f64();
    Ok(json!({
        "frequencies_hz": FREQUENCIES_HZ,
        "sample_s": args.sample_s,
        "cpu_s": cpu_s,
        "poses": states.iter().map(|(x, ..)| numbers(x)).collect::<Vec<_>>(),
        "forces_n": forces_n.ok_or("the trajectory passes a singular pose")?,
    }))
}

/// The leg of a file as a mere spring.
fn spring(oil: &HydraulicDrive, stiffness_n_m: Option<f64>) -> LegParameters {
    let mut leg = LegParameters::of_drive(oil, oil.hydraulics.default_preset).ideal();
    leg.oil.leakage_m3_s_pa = 0.0;
    leg.oil.viscous_n_s_m = 0.0;
    if let Some(k) = stiffness_n_m {
        // K_h = 4 β_e A² / V_t.
        leg.oil.total_volume_m3 *= leg.oil.oil_spring_n_m() / k;
    }
    leg
}

/// The reduced rig at rest at a place, its springs as they are when they hold the plate in the middle.
fn let_go(rig: &ReducedRig, file: &Rig, place: [f64; 6]) -> Result<RigState, String> {
    let platform = rig.platform();
    let held = rig.at_rest(&platform.middle(), &Wrench::ZERO).map_err(|e| e.to_string())?;
    let mut s = held;
    s.x_bp = platform.plate_from_docking(&file.docking.pose(place));
    let c = platform.at(&s.x_bp);
    s.length_m = c.length_m;
    let mut forces = [0.0; 6];
    for (i, leg) in rig.legs().iter().enumerate() {
        leg.compress(&mut s.legs[i], c.length_m[i] - held.length_m[i]);
        forces[i] = leg.force(&s.legs[i], 0.0);
    }
    s.acceleration = platform
        .forward_dynamics(&c, &s.twist, &forces, &Wrench::ZERO)
        .ok_or("the rig's numbers are not finite")?;
    Ok(s)
}

fn release(args: &Release) -> Result<Value, String> {
    let file = load(&args.rig)?;
    let step_s = args.step_ms * 1e-3;
    let per_sample = count(args.sample_s, step_s);
    if (f64::from(per_sample) * step_s / args.sample_s - 1.0).abs() > 1e-9 {
        return Err(format!(
            "a step of {} ms does not divide the {} s between two poses; give a whole part of it",
            args.step_ms, args.sample_s
        ));
    }
    let oil = file.drive.hydraulic().ok_or("no oil moves this rig")?;
    let leg = spring(oil, args.spring_n_m);
    let rig = ReducedRig::new(Platform::new(&file), &[leg; 6], step_s);
    let start = let_go(&rig, &file, args.place)?;
    let samples = count(args.until_s, args.sample_s);
    let (poses, cpu_s) = if args.full {
        laps(&mut FullRig::new(&file, &[leg; 6], step_s), start, samples, per_sample, args.laps)?
    } else {
        laps(&mut rig.clone(), start, samples, per_sample, args.laps)?
    };
    Ok(json!({
        "spring_n_m": leg.oil.oil_spring_n_m(),
        "step_s": step_s,
        "sample_s": args.sample_s,
        "sim_s": f64::from(samples) * args.sample_s,
        "cpu_s": cpu_s,
        "poses": poses,
    }))
}

/// Poses at all samples, and the processor time of the steps of one lap, s.
fn laps(
    rig: &mut impl RigPlant,
    start: RigState,
    samples: u32,
    per_sample: u32,
    laps: u32,
) -> Result<(Vec<[f64; 7]>, f64), String> {
    let laps = laps.max(1);
    let mut poses = Vec::new();
    let mut spent = 0.0;
    for _ in 0..laps {
        rig.rest(&start.x_bp, &Wrench::ZERO).map_err(|e| e.to_string())?;
        let mut s = start;
        poses = vec![numbers(&s.x_bp)];
        for _ in 0..samples {
            let clock = ThreadTime::now();
            for _ in 0..per_sample {
                rig.advance(&mut s, &[0.0; 6], |_, _| Wrench::ZERO).map_err(|e| e.to_string())?;
            }
            spent += clock.elapsed().as_secs_f64();
            poses.push(numbers(&s.x_bp));
        }
    }
    Ok((poses, spent / f64::from(laps)))
}

/// Plate in the ground, `X_bp`: x, y, z (m), then the quaternion x, y, z, w.
fn numbers(x: &Pose) -> [f64; 7] {
    let [i, j, k, w] = x.q.to_array();
    [x.p.x, x.p.y, x.p.z, i, j, k, w]
}
