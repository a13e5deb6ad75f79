//! What the loop calls in every tick never asks for memory.

mod common;

use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
    hint::black_box,
};

use common::{MS, PATIENCE, Served, command, ideal, now, start, unique};
use docktwin_hil::{
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    histogram::{LatencyHistogram, PhaseHistograms},
    in_process::InProcess,
    ipc::IpcRig,
    port::RigMode,
    rig::Rig,
};

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
        let m = rig.receive(PATIENCE, c.loop_time_ns + c.period_ns).expect("judged good");
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
