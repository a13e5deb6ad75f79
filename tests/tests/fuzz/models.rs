//! Models and scenarios: what is refused says why, and what is accepted can be stepped.

use docktwin_model::{Sources, load_mechanism_from, load_rig_from, load_spacecraft_from};
use docktwin_rigport::message::{Flags, RigCommand, RigMeasurement, RigMode, Status};
use docktwin_rigport::rig::Rig;
use docktwin_run::{HilOptions, HilRun};
use docktwin_scenario::{Loader, Scenario};

use crate::damage;
use crate::dice::Dice;
use crate::world::{World, place, refused, refused_run, steps};

/// A shipped file with damage, and its name.
pub(crate) struct Damaged {
    pub(crate) name: String,
    pub(crate) text: Vec<u8>,
}

fn damaged(world: &World, folder: &str, ending: &str, input: &[u8]) -> Damaged {
    let mut dice = Dice::new(input);
    let names = world.names(folder, ending);
    let name = (*dice.of(&names)).to_owned();
    let all: Vec<&[u8]> = names.iter().map(|n| world.files[*n].as_slice()).collect();
    let text = damage::text(&world.files[&name], &all, &mut dice);
    Damaged { name, text }
}

pub(crate) fn urdf(world: &World, input: &[u8]) -> Damaged {
    damaged(world, "models/urdf/", ".urdf", input)
}

pub(crate) fn model_toml(world: &World, input: &[u8]) -> Damaged {
    damaged(world, "models/urdf/", ".toml", input)
}

pub(crate) fn scenario_toml(world: &World, input: &[u8]) -> Damaged {
    damaged(world, "scenarios/", ".toml", input)
}

/// The stem of a model file, without its side.
fn stem(name: &str) -> &str {
    let stem = name.rsplit('/').next().unwrap_or(name);
    stem.split('.').next().unwrap_or(stem)
}

/// A model by itself, then in a run.
pub(crate) fn judge_model(world: &World, d: &Damaged) -> String {
    let sources = world.with(&d.name, &d.text);
    let stem = stem(&d.name);
    let urdf = place(&format!("models/urdf/{stem}.urdf"));
    if ["stewart", "electric_hexapod"].iter().any(|rig| stem.starts_with(rig)) {
        let rig = match load_rig_from(&sources, &urdf) {
            Ok(rig) => rig.model,
            Err(e) => return refused(&e.problems),
        };
        assert!(!format!("{rig:?}").contains("NaN"), "{rig:?}");
        return rig_moves(&sources, stem);
    }
    let loaded = match stem.rsplit_once('_') {
        Some((base, "active" | "passive")) => {
            let side = |s: &str| place(&format!("models/urdf/{base}_{s}.urdf"));
            load_mechanism_from(&sources, &side("active"), &side("passive"), None).map(drop)
        }
        _ => load_spacecraft_from(&sources, &urdf).map(drop),
    };
    if let Err(e) = loaded {
        return refused(&e.problems);
    }
    let named = format!("models/urdf/{stem}.urdf");
    let user = world
        .names("scenarios/", ".toml")
        .into_iter()
        .find(|s| String::from_utf8_lossy(&world.files[*s]).contains(&named));
    let Some(user) = user else { return "accepted, in no scenario".to_owned() };
    // In contact after some milliseconds.
    let loader = Loader::new().set("initial.gap_m", 0.002).set("initial.axial_speed_m_s", 0.3);
    match loader.sources(sources).load(&place(user)) {
        Ok(scenario) => steps(&scenario),
        Err(e) => refused(&e.problems),
    }
}

/// A scenario, with the rig that it names too.
pub(crate) fn judge_scenario(world: &World, d: &Damaged) -> String {
    let loader = Loader::new().sources(world.with(&d.name, &d.text));
    let scenario = match loader.load(&place(&d.name)) {
        Ok(scenario) => scenario,
        Err(e) => return refused(&e.problems),
    };
    if d.text.len().is_multiple_of(8)
        && let Err(e) = HilRun::new(&scenario, HilOptions::default())
    {
        refused_run(&e);
    }
    steps(&scenario)
}

fn nominal(sources: &Sources) -> Scenario {
    let loader = Loader::new().set("run.duration_s", 0.1).sources(sources.clone());
    loader.load(&place("scenarios/apas_nominal.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// The command of a tick.
pub(crate) fn command(mode: RigMode, tick: u64) -> RigCommand {
    RigCommand {
        mode: mode as u32,
        flags: Flags::LOCKSTEP,
        session: 1,
        tick,
        loop_time_ns: tick * 1_000_000,
        wakeup_ns: tick * 1_000_000,
        period_ns: 1_000_000,
        ..RigCommand::zero()
    }
}

/// Follows the plate's pose where it is, a little further on.
pub(crate) fn track(from: &RigMeasurement, tick: u64) -> RigCommand {
    let mut c = command(RigMode::Track, tick);
    c.plate_position_m = from.truth_position_m;
    c.plate_position_m[0] += 1e-5;
    c.plate_attitude = from.truth_attitude;
    c
}

/// The emulated rig of a file holds and follows for 50 ms, and all that it measures is finite.
fn rig_moves(sources: &Sources, stem: &str) -> String {
    let scenario = nominal(sources);
    let model = Some(place(&format!("models/urdf/{stem}.toml")));
    let options = HilOptions { model, ..HilOptions::default() };
    let run = match HilRun::new(&scenario, options) {
        Ok(run) => run,
        Err(e) => return refused_run(&e),
    };
    let mut rig = match run.emulated() {
        Ok(rig) => rig,
        Err(e) => return refused_run(&e),
    };
    let mut last = RigMeasurement::zero();
    for tick in 0..50 {
        let c = match tick {
            0 => command(RigMode::Idle, tick),
            1..25 => command(RigMode::Hold, tick),
            _ => track(&last, tick),
        };
        rig.send(&c).expect("it is in this process");
        let got = rig.receive(core::time::Duration::ZERO, (tick + 1) * 1_000_000);
        last =
            got.unwrap_or_else(|e| panic!("accepted, and in tick {tick}: {e}")).expect("an answer");
    }
    format!("the rig moves, enabled: {}", last.is(Status::ENABLED))
}
