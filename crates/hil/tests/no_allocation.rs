//! What the loop calls in every tick never asks for memory.

use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
    hint::black_box,
};

use docktwin_hil::{
    clock::{Clock, OverrunPolicy, RealtimeClock, VirtualClock},
    histogram::{LatencyHistogram, PhaseHistograms},
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
