//! What the loop calls in every tick never asks for memory.

mod common;

use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
    hint::black_box,
};

use common::{
    MS, PATIENCE, Served, command, ideal, now, start,
    stick::{Models, axis, emulated, models, settings},
    unique,
};
use docktwin_control::{
    compensation::{Compensation, Residual},
    sensing::SensorScheme,
};
use docktwin_core::PERIOD_NS;
use docktwin_hil::{
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    faults::{Fault, FaultKind, FaultyRig, Instrument, When},
    histogram::{LatencyHistogram, PhaseHistograms},
    scheduler::{Idle, Loop, Phase},
};
use docktwin_physics::reduced::Inputs;
use docktwin_rigport::{in_process::InProcess, ipc::IpcRig, message::RigMode, rig::Rig};
use docktwin_study::table4::{TABLE_4, VibroSettings, VibroTest};

thread_local! {
    // Of this thread only: the test harness has threads of its own.
    static REQUESTS: Cell<u64> = const { Cell::new(0) };
}

/// The system's heap, counting.
struct Counting;

#[expect(unsafe_code, reason = "an allocator cannot be written without; it only counts")]
// SAFETY: every call goes unchanged to the system's allocator; the counter is a thread-local `Cell`
// without destructor, which needs no memory of its own.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        // SAFETY: as promised by the caller.
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        // SAFETY: as promised by the caller.
        unsafe { Heap.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        // SAFETY: as promised by the caller.
        unsafe { Heap.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as promised by the caller.
        unsafe { Heap.dealloc(block, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Requests for memory while `f` runs.
fn requests(f: impl FnOnce()) -> u64 {
    let before = REQUESTS.get();
    f();
    REQUESTS.get() - before
}

/// The negative control: a counter that never counts would pass everything.
#[test]
fn invariant_the_counter_counts() {
    assert!(requests(|| drop(black_box(vec![0_u8; 1000]))) > 0);
}

#[test]
fn invariant_clocks_and_histograms_never_ask_for_memory() {
    let mut lateness = LatencyHistogram::new();
    let mut phases = PhaseHistograms::new(&["read", "work", "write"]);
    let mut real = RealtimeClock::new(100_000, OverrunPolicy::Skip);
    let mut fast = VirtualClock::new(100_000);
    let asked = requests(|| {
        real.start();
        fast.start();
        for k in 0..50_u64 {
            lateness.record_ns(real.wait().lateness_ns);
            let w = fast.wait();
            // Over the whole range, beyond it too.
            lateness.record_ns(1 << k);
            phases.record_ns((w.tick % 4) as usize, u64::MAX >> k);
        }
        black_box(lateness.latencies());
    });
    assert_eq!(asked, 0);
}

/// A session in lockstep, where the loop waits, and one in real time, where it does not.
fn sessions(rig: &mut dyn Rig) {
    for tick in 0..100 {
        let mode = if tick == 0 { RigMode::Idle } else { RigMode::Track };
        let c = command(1, tick, mode, start());
        rig.send(&c).expect("sent");
        let m = rig.receive(PATIENCE, c.loop_time_ns + c.period_ns).expect("validated");
        assert_eq!(m.map(|m| m.tick), Some(tick));
    }
    let mut heard = 0;
    for tick in 0..100 {
        let c = now(command(2, tick, RigMode::Idle, start()));
        let _ = rig.send(&c);
        std::thread::sleep(std::time::Duration::from_nanos(MS));
        heard += u64::from(matches!(rig.receive(std::time::Duration::ZERO, u64::MAX), Ok(Some(_))));
    }
    assert!(heard > 0);
}

/// iceoryx2 0.10 takes a block of 48 bytes for every message that is sent, and gives it back at once;
/// nothing else.
#[test]
fn regress_a_rig_in_another_process_costs_one_small_block_a_command() {
    let name = unique("allocation");
    let _served = Served::of(&name, ideal());
    let mut rig = IpcRig::connect(&name, PATIENCE).expect("the rig is there");
    let commands = 200;
    assert!(requests(|| sessions(&mut rig)) <= commands);
}

#[test]
fn invariant_a_rig_in_process_never_asks_for_memory() {
    let mut rig = InProcess::new(ideal());
    assert_eq!(requests(|| sessions(&mut rig)), 0);
}

#[test]
fn invariant_a_rig_with_faults_never_asks_for_memory() {
    let faults = [
        FaultKind::Noisy(Instrument::SensorA),
        FaultKind::Frozen(Instrument::SensorB),
        FaultKind::LegRunaway(2),
        FaultKind::StampDrift,
    ];
    let faults = faults.map(|what| Fault::from(what, When::Time(0.01)).sized(-1e-3));
    let mut rig = FaultyRig::new(InProcess::new(ideal()), &faults);
    assert_eq!(requests(|| sessions(&mut rig)), 0);
}

fn test(m: &Models, row: usize, axes: &[&str]) -> VibroTest {
    let axes: Vec<_> = axes.iter().map(|a| axis(a)).collect();
    VibroTest::new(TABLE_4[row], &axes, &m.body, &m.stick).expect("a stick")
}

/// Requests of a run from arming to rest, of this thread, and its ticks; the run has everything in it.
fn requests_of_a_run<R: Rig, K: Clock>(idle: Loop<R, K, Idle>) -> (u64, u64) {
    let armed = idle.arm(Vec::new()).expect("armed");
    let (mut seen, mut strongest_n, mut trip) = ([false; PHASES], 0.0_f64, None);
    let (mut ended, mut ticks) = (None, 0);
    let asked = requests(|| {
        let mut running = armed.start();
        while !running.finished() {
            let r = running.tick(&Inputs::default()).expect("the rig answers");
            seen[r.phase as usize] = true;
            strongest_n = strongest_n.max(r.ports.port4.f.length());
            trip = r.trip;
            ticks += 1;
        }
        ended = Some(running.stop());
    });
    assert!(ended.is_some_and(|l| l.end().closed_ticks > 100));
    assert_eq!(seen, [true; PHASES]);
    assert!(strongest_n > 100.0, "no contact: {strongest_n} N");
    assert_eq!(trip, None);
    (asked, ticks)
}

const PHASES: usize = Phase::Stop as usize + 1;

/// Loop and emulated rig together.
#[test]
fn invariant_a_run_on_the_emulated_rig_never_asks_for_memory_after_arming() {
    let m = models();
    let led = Compensation::Lead(0.0018);
    let twin = Compensation::Twin { lead_s: 0.0018, residual: Residual::Felt };
    for (scheme, compensation, row, axes) in [
        (SensorScheme::Single, Compensation::None, 5, ["x", "y", "roll"].as_slice()),
        (SensorScheme::Single, led, 5, &["z", "pitch", "yaw"]),
        (SensorScheme::Two, led, 2, &["x"]),
        (SensorScheme::Single, twin, 5, &["x", "y", "roll"]),
    ] {
        let test = test(&m, row, axes);
        let s = VibroSettings { scheme, ..settings(compensation) };
        let rig = InProcess::new(emulated(&m, &test));
        let clock = VirtualClock::new(PERIOD_NS);
        let setup = test.setup(&m.rig, &s).expect("it can be run");
        assert_eq!(requests_of_a_run(Loop::new(setup, rig, clock)).0, 0);
    }
}

/// The loop and its end of the port; the rig is in another thread.
#[test]
fn invariant_a_run_over_shared_memory_asks_for_nothing_of_its_own() {
    let m = models();
    let test = test(&m, 5, &["x", "y", "roll"]);
    let s = VibroSettings { patience: PATIENCE, ..settings(Compensation::Lead(0.0018)) };
    let name = unique("allocation");
    let _served = Served::of(&name, emulated(&m, &test));
    let rig = IpcRig::connect(&name, PATIENCE).expect("the rig is there");
    let setup = test.setup(&m.rig, &s).expect("it can be run");
    let idle = Loop::new(setup, rig, VirtualClock::new(PERIOD_NS));
    let (asked, ticks) = requests_of_a_run(idle);
    assert_eq!(asked, ticks, "besides the block of every message");
}
