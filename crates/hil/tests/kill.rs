//! Processes of the rig port that are killed: the other side notices, a new one can start, and nothing
//! is left to be cleaned by hand.

mod common;

use std::{
    io::{BufRead as _, BufReader},
    path::PathBuf,
    sync::{Mutex, MutexGuard, mpsc},
    time::Duration,
};

use common::*;
use docktwin_rigport::{
    clock::monotonic_ns,
    ipc::{IpcRig, RigEvent, RigServer, ServeOptions},
    message::{RigCommand, RigMeasurement, RigMode, Status},
    rig::{CommandForm, Plant, Rig, RigError},
    validate::SILENT_PERIODS,
};

const ROUNDS: usize = 20;

/// iceoryx2 with files of its own, so that what is left over can be counted; one test at a time.
/// Processes started later inherit the working directory, from which iceoryx2 reads its settings.
struct Apart {
    home: PathBuf,
    _alone: MutexGuard<'static, ()>,
}

impl Apart {
    fn new() -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let home = std::env::temp_dir().join(prefix());
        std::fs::create_dir_all(home.join("config")).expect("a directory");
        let root = home.join("root");
        let settings =
            format!("[global]\nroot-path = \"{}\"\nprefix = \"{}\"\n", root.display(), prefix());
        std::fs::write(home.join("config/iceoryx2.toml"), settings).expect("a file");
        std::env::set_current_dir(&home).expect("a directory");
        Self { home, _alone: alone }
    }

    /// Files and shared memory of iceoryx2 that are there. Directories and the counter that all
    /// processes of a machine share, 4 KiB in all, belong to no process.
    fn left_over(&self) -> Vec<PathBuf> {
        let mut found = shared_memory();
        let mut open = vec![self.home.join("root")];
        while let Some(directory) = open.pop() {
            for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
                let path = entry.path();
                if path.is_dir() { open.push(path) } else { found.push(path) }
            }
        }
        found.retain(|p| p.extension().is_none_or(|e| e != "global_mgmt"));
        found
    }
}

impl Drop for Apart {
    fn drop(&mut self) {
        let _ = std::env::set_current_dir(std::env::temp_dir());
        let _ = std::fs::remove_dir_all(&self.home);
        for file in shared_memory() {
            let _ = std::fs::remove_file(file);
        }
    }
}

fn prefix() -> String {
    format!("docktwin-kill-{}-", std::process::id())
}

fn shared_memory() -> Vec<PathBuf> {
    let all = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let ours = |e: &std::fs::DirEntry| e.file_name().to_string_lossy().starts_with(&prefix());
    all.filter(ours).map(|e| e.path()).collect()
}

#[test]
#[ignore = "the rig's process of this suite, not a test"]
fn rig_process() {
    if let Some(name) = role() {
        serve_until_orphaned(&name, PATIENCE);
    }
}

/// Follows at 1 kHz until it is killed.
#[test]
#[ignore = "the loop's process of this suite, not a test"]
fn loop_process() {
    let Some(name) = role() else { return };
    let orphaned = orphaned();
    let mut rig = IpcRig::connect(&name, PATIENCE).expect("the rig comes");
    let session = u64::from(std::process::id());
    let mut answered = 0;
    for tick in 0.. {
        answered += u64::from(step(&mut rig, session, tick).is_ok_and(|m| m.is_some()));
        if answered == 5 {
            println!("the loop follows");
            answered += 1;
        }
        if orphaned.load(std::sync::atomic::Ordering::Relaxed) {
            return;
        }
    }
}

/// Waits until the loop of another process runs.
fn wait_for_running(process: &mut Process) {
    let out = process.0.stdout.take().expect("piped");
    let mut lines = BufReader::new(out).lines().map_while(Result::ok);
    assert!(lines.any(|l| l.contains("the loop follows")), "the loop has ended early");
}

/// One tick in real time: read what has come, send, wait for the next.
fn step(rig: &mut IpcRig, session: u64, tick: u64) -> Result<Option<RigMeasurement>, RigError> {
    let due_ns = monotonic_ns();
    let got = rig.receive(Duration::ZERO, due_ns);
    let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
    let sent = rig.send(&now(command(session, tick, mode, start())));
    std::thread::sleep(Duration::from_nanos(MS));
    sent.and(got)
}

/// A loop of this process: runs until it has heard the rig a few times. On a machine under load the
/// rig may be silent for a while meanwhile.
fn run(rig: &mut IpcRig, session: u64) -> u64 {
    let mut heard = 0;
    for tick in 0.. {
        match step(rig, session, tick) {
            Ok(Some(_)) => heard += 1,
            Ok(None) | Err(RigError::Gone) => (),
            Err(e) => panic!("tick {tick}: {e}"),
        }
        if heard == 5 {
            return tick;
        }
    }
    unreachable!("the loop is endless")
}

/// A whole session in lockstep, which a machine under load does not disturb.
fn works(rig: &mut IpcRig) {
    let session = new_session();
    let m = begin(rig, session, start());
    assert!(m.is(Status::ENABLED), "{m:?}");
}

#[test]
fn invariant_a_loop_survives_the_death_of_its_rig() {
    let _apart = Apart::new();
    let name = unique("rig-dies");
    let mut child = start_again("rig_process", &name);
    let mut rig = IpcRig::connect(&name, PATIENCE).expect("the rig comes");
    for round in 0..ROUNDS {
        let session = new_session();
        let mut tick = run(&mut rig, session);
        child.kill();
        let mut unheard = 0;
        loop {
            tick += 1;
            match step(&mut rig, session, tick) {
                Ok(Some(_)) => unheard = 0,
                Ok(None) => unheard += 1,
                Err(e) => {
                    assert_eq!(e, RigError::Gone, "round {round}");
                    break;
                }
            }
            assert!(unheard < SILENT_PERIODS, "round {round}: nothing told for {unheard} ticks");
        }
        // The same loop goes on with a new rig of the name, which holds still until it is idle.
        child = start_again("rig_process", &name);
        let waited = monotonic_ns();
        while !matches!(step(&mut rig, session, tick + 1), Ok(Some(m)) if m.is(Status::SAFE_STATE))
        {
            tick += 1;
            assert!(monotonic_ns() - waited < 20_000 * MS, "the new rig does not answer");
        }
        works(&mut rig);
    }
}

#[test]
fn invariant_a_loop_in_lockstep_is_told_of_the_death_of_its_rig_within_its_patience() {
    let _apart = Apart::new();
    let name = unique("rig-dies-in-lockstep");
    for _ in 0..5 {
        let mut child = start_again("rig_process", &name);
        let mut rig = IpcRig::connect(&name, PATIENCE).expect("the rig comes");
        works(&mut rig);
        child.kill();
        rig.send(&command(new_session(), 0, RigMode::Idle, start())).expect("sent");
        let got = rig.receive(Duration::from_millis(20), u64::MAX);
        assert_eq!(got, Err(RigError::Gone));
    }
}

/// Tells when it is left alone.
struct Told<P>(P, mpsc::Sender<()>);

impl<P: Plant> Plant for Told<P> {
    fn command_form(&self) -> CommandForm {
        self.0.command_form()
    }

    fn answer(&mut self, command: &RigCommand) -> RigMeasurement {
        self.0.answer(command)
    }

    fn alone(&mut self, period_ns: u64) -> RigMeasurement {
        let _ = self.1.send(());
        self.0.alone(period_ns)
    }
}

#[test]
fn invariant_a_rig_survives_the_death_of_its_loop() {
    let _apart = Apart::new();
    let name = unique("loop-dies");
    let (events, told) = mpsc::channel();
    let (alone, is_alone) = mpsc::channel();
    let (stop, stopped) = mpsc::channel::<()>();
    let served = std::thread::spawn({
        let name = name.clone();
        move || {
            let mut server = RigServer::open(&name).expect("a rig of a new name");
            let stop = || stopped.try_recv() == Err(mpsc::TryRecvError::Disconnected);
            let options = ServeOptions { lockstep_patience: PATIENCE };
            let tell = |e| events.send(e).expect("someone listens");
            server.serve(&mut Told(ideal(), alone), options, stop, tell)
        }
    });
    for round in 0..ROUNDS {
        let mut child = start_again("loop_process", &name);
        wait_for_running(&mut child);
        while is_alone.try_recv().is_ok() {}
        child.kill();
        // Every period from now on, until a new session.
        for _ in 0..5 {
            is_alone.recv_timeout(PATIENCE).expect("the rig leaves the commands");
        }
        let mut last = told.try_iter();
        assert!(last.any(|e| matches!(e, RigEvent::SafeState { .. })), "round {round}: not told");
        // A new loop of the name.
        works(&mut IpcRig::connect(&name, PATIENCE).expect("the name is free"));
    }
    drop(stop);
    let counts = served.join().expect("no panic").expect("the transport holds");
    assert!(counts.safe_states >= ROUNDS as u64, "{counts:?}");
    assert_eq!(counts.refused_in_all(), 0, "{counts:?}");
}

#[test]
fn invariant_nothing_is_left_of_those_that_were_killed() {
    let apart = Apart::new();
    let name = unique("both-die");
    for _ in 0..ROUNDS {
        let mut rig = start_again("rig_process", &name);
        let mut its_loop = start_again("loop_process", &name);
        wait_for_running(&mut its_loop);
        rig.kill();
        its_loop.kill();
    }
    let killed = apart.left_over();
    assert!(!killed.is_empty(), "the counting is blind");
    // Whoever starts next cleans.
    let served = Served::of(&name, ideal());
    works(&mut IpcRig::connect(&name, PATIENCE).expect("the name is free"));
    drop(served);
    let left = apart.left_over();
    assert!(left.is_empty(), "{left:?}");
}

/// Whatever a process was just making when it was killed stands in nobody's way.
#[test]
fn invariant_processes_killed_while_they_start_are_in_nobodys_way() {
    let _apart = Apart::new();
    let name = unique("young");
    // The first process of all makes what they share.
    drop(RigServer::open(&name).expect("a rig of a new name"));
    for round in 0..ROUNDS {
        let mut rig = start_again("rig_process", &name);
        let mut its_loop = start_again("loop_process", &name);
        std::thread::sleep(Duration::from_millis(round as u64 % 10));
        rig.kill();
        its_loop.kill();
    }
    let _served = Served::of(&name, ideal());
    works(&mut IpcRig::connect(&name, PATIENCE).expect("the name is free"));
}

/// What a process leaves that is killed in the few microseconds between making shared memory, or the
/// file of a service, and filling it; iceoryx2 alone would wait for ever for the first, and never open
/// a service again for the second.
#[test]
fn regress_half_made_files_are_removed_when_they_are_old() {
    let apart = Apart::new();
    let name = unique("half-made");
    let hour = Duration::from_secs(3600);
    let make_old = |path: &std::path::Path| {
        let file = std::fs::File::create(path).expect("a file");
        file.set_modified(std::time::SystemTime::UNIX_EPOCH + hour).expect("it is ours");
        file.set_permissions(std::os::unix::fs::PermissionsExt::from_mode(0o200)).expect("ours");
    };
    // Their names are learned from a rig that lives.
    let served = Served::of(&name, ideal());
    let services: Vec<PathBuf> = apart
        .left_over()
        .into_iter()
        .filter(|p| p.extension().is_some_and(|e| e == "service"))
        .collect();
    assert_eq!(services.len(), 4, "two services, two bells: {services:?}");
    drop(served);
    for service in &services {
        make_old(service);
    }
    let memory = PathBuf::from("/dev/shm").join(format!("{}1.dynamic", prefix()));
    make_old(&memory);
    let _served = Served::of(&name, ideal());
    assert!(!memory.exists());
    works(&mut IpcRig::connect(&name, PATIENCE).expect("the rig is there"));
}
