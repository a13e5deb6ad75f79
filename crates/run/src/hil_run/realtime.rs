//! The loop in a thread with real-time priority, and the thread that observes its ticks.

use std::{
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, sync_channel},
    },
    time::Duration,
};

use docktwin_hil::{
    clock::RealtimeClock,
    realtime::relax,
    scheduler::{Check, Idle, Loop, TickRecord},
};
use docktwin_rigport::rig::Rig;

use super::{Commands, Ended, keep_time, recorder::HilRecorder};
use crate::{
    control::Control,
    error::RunError,
    rig_place::{Operator, RealtimeOptions, best_effort},
    ring::Ring,
    sink::Sink,
};

/// Slots of the ring buffer between the loop and the observing thread, ticks: two seconds.
const RING_TICKS: usize = 2048;
/// How long the looking thread sleeps when there is nothing new.
const IDLE: Duration = Duration::from_millis(2);

/// A loop about to be armed in this thread.
pub(super) struct LoopThread<'a, R, C> {
    pub(super) idle: Loop<R, RealtimeClock, Idle>,
    pub(super) checks: Vec<Check>,
    pub(super) commands: Commands<C>,
    pub(super) realtime: &'a RealtimeOptions,
}

impl<R: Rig, C: Control> LoopThread<'_, R, C> {
    /// The loop in this thread, with what the machine grants, from arming on; another one looks at the
    /// ticks. Between arming and the first tick nothing is done that could take long: the rig waits.
    pub(super) fn run<S: Sink + Send, O: Operator + Send>(
        self,
        recorder: &mut HilRecorder<'_, S>,
        operator: &mut O,
    ) -> Result<Ended, RunError> {
        let ring = Ring::new(RING_TICKS, || None);
        let stop = AtomicBool::new(false);
        let (passed, checks) = sync_channel::<Vec<Check>>(1);
        std::thread::scope(|scope| {
            // Before the priority is taken: threads started later would share the core.
            let (ring, stop) = (&ring, &stop);
            let looking = scope.spawn(move || look(ring, stop, &checks, recorder, operator));
            let out = self.realtime.apply().and_then(|granted| {
                let armed = self.idle.arm(self.checks)?;
                let checks = armed.checks().to_vec();
                let running = armed.start();
                // Never full: it is sent once.
                let _ = passed.try_send(checks);
                let mut dropped = 0;
                let ended = keep_time(running, self.commands, None, |r| {
                    dropped += u64::from(!ring.write(|slot| *slot = Some(r)));
                    stop.load(Ordering::Relaxed)
                });
                Ok(Ended { dropped, lacking: best_effort(&granted), ..ended })
            });
            relax();
            drop(passed);
            ring.close();
            let _ = looking.join();
            out
        })
    }
}

fn look<S: Sink, O: Operator>(
    ring: &Ring<Option<TickRecord>>,
    stop: &AtomicBool,
    checks: &Receiver<Vec<Check>>,
    recorder: &mut HilRecorder<'_, S>,
    operator: &mut O,
) {
    if let Ok(checks) = checks.recv() {
        operator.checklist(&checks);
    }
    loop {
        let closed = ring.is_closed();
        match ring.read(|r| *r) {
            Some(Some(r)) => {
                if recorder.take(&r) {
                    stop.store(true, Ordering::Relaxed);
                }
            }
            Some(None) => {}
            None if closed => return,
            None => std::thread::sleep(IDLE),
        }
    }
}
