//! A recorded loop once more: the recorded control wrenches, the same emulated rig, a virtual clock.

use docktwin_hil::{
    clock::VirtualClock,
    scheduler::{Loop, Phase},
};
use docktwin_physics::as_built::{Grade, MechanismDraw};
use docktwin_scenario::{CompensatorChoice, load_scenario};

use super::{Comparison, Replay, Replayed};
use crate::{
    article::RigMechanism,
    error::RunError,
    hil_run::{
        HilOptions, HilRecorder, HilRun, MECHANISM_DIGEST, PERIOD_NS, kept_mechanism, kept_name,
    },
    provenance::same_files,
};

/// Options with which the recording was made.
fn options(replay: &Replay) -> Result<HilOptions, RunError> {
    let (run, metadata) = (replay.path(), replay.metadata());
    let of = |key: &str| metadata.get(key).map_or("", String::as_str);
    if !docktwin_record::repeats(metadata) {
        return Err(RunError::usage(
            format!(
                "a run against `{}` with the {} clock does not repeat bit by bit: {}",
                of("rig"),
                of("clock"),
                run.display()
            ),
            "replay runs with --rig emulated and the virtual clock; `diff` compares others",
        ));
    }
    let kept = |name: &str| {
        metadata.contains_key(&format!("digest:{name}")).then(|| run.join(kept_name(name)))
    };
    let words = CompensatorChoice::WORDS;
    Ok(HilOptions {
        compensator: words.into_iter().find(|(w, _)| *w == of("compensator")).map(|(_, c)| c),
        lead_s: of("lead_s").parse().ok(),
        seed: of("seed").parse().map_err(|_| damaged(replay, "no seed"))?,
        perturb: of("perturb").parse().ok(),
        mechanism: mechanism(replay)?,
        identification: kept("identification"),
        calibration: kept("calibration"),
        ..HilOptions::default()
    })
}

/// The mechanism that the rig had.
fn mechanism(replay: &Replay) -> Result<RigMechanism, RunError> {
    let metadata = replay.metadata();
    let file =
        metadata.contains_key(MECHANISM_DIGEST).then(|| replay.path().join(kept_mechanism()));
    let Some(number) = metadata.get("mechanism_draw") else {
        return Ok(RigMechanism { file, draw: None });
    };
    let grade = metadata.get("mechanism_grade").map_or("", String::as_str);
    let draw = number
        .parse()
        .ok()
        .zip(Grade::WORDS.into_iter().find(|(word, _)| *word == grade))
        .map(|(number, (_, grade))| MechanismDraw { number, grade })
        .ok_or_else(|| damaged(replay, "the draw of the rig's mechanism cannot be read"))?;
    Ok(RigMechanism { file, draw: Some(draw) })
}

/// What the recording says of the rig's mechanism, drawn values included, and what comes out now.
fn same_mechanism(replay: &Replay, run: &HilRun<'_>) -> Result<(), RunError> {
    let metadata = replay.metadata();
    let digest = run.article.digest.map(|d| d.to_string());
    let values = run.article.drawn.iter().all(|d| {
        metadata.get(&format!("drawn:{}", d.name)).is_some_and(|then| *then == d.value.to_string())
    });
    if metadata.get(MECHANISM_DIGEST) == digest.as_ref() && values {
        return Ok(());
    }
    Err(damaged(replay, "the rig's mechanism is not the one of the recording"))
}

fn damaged(replay: &Replay, what: &str) -> RunError {
    RunError::usage(
        format!("{what}: {}", replay.path().display()),
        "run.mcap and the models are not of one run, or damaged; use another copy",
    )
}

/// Replays into `found`.
pub(super) fn replay(replay: &mut Replay, found: &mut Replayed) -> Result<(), RunError> {
    let options = options(replay)?;
    if !replay.has_phase() {
        return Err(damaged(replay, "the recording has no column `loop_phase`"));
    }
    let scenario = load_scenario(&replay.path().join("scenario.toml"), &[])?;
    same_files(&scenario.files, replay.metadata(), replay.path())?;
    let prepared = HilRun::new(&scenario, options)?;
    let of = |key: &str| replay.metadata().get(key).map_or("", String::as_str);
    if of("digest:rig") != prepared.rig.digest.to_string()
        || of("preset") != prepared.rig.oil_word(prepared.preset)
    {
        return Err(damaged(replay, "the rig is not the one of the recording"));
    }
    same_mechanism(replay, &prepared)?;
    replay.check_files()?;
    let mut recorder = HilRecorder::begin(&prepared, Comparison::with(&replay.reader), false)?;
    let rig = prepared.emulated()?;
    let checks = prepared.checks(&mut ())?;
    let mut running = Loop::new(prepared.setup, rig, VirtualClock::new(PERIOD_NS))
        .arm(checks)
        .map_err(|e| damaged(replay, &e.to_string()))?
        .start();
    let mut next = replay.next()?;
    while let Some(then) = &next {
        if then.phase == Phase::Stop as u64 && running.phase() == Phase::Closed {
            running.end();
        }
        let r = running.tick(&then.control).map_err(|e| damaged(replay, &e.to_string()))?;
        recorder.sink_mut().expect(then.whole.clone());
        recorder.take(&r);
        // The way to the initial condition is not recorded.
        if !recorder.sink_mut().has_come() {
            continue;
        }
        if recorder.sink_mut().differs() {
            break;
        }
        next = replay.next()?;
    }
    recorder.sink_mut().give(found);
    if replay.all_compared(found) {
        replay.compare_summary(&recorder.judged().0, found);
    }
    Ok(())
}
