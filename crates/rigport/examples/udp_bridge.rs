//! A rig on another machine: both ends of a bridge over UDP.
//!
//! ```text
//! loop ── shared memory ── near end ── UDP ── far end ── shared memory ── rig
//! ```
//!
//! On the rig's machine, where a rig `steel` runs:
//! `cargo run --release -p docktwin-rigport --example udp_bridge -- far steel 10.0.0.2:5600 10.0.0.1:5600`
//!
//! On the loop's machine:
//! `cargo run --release -p docktwin-rigport --example udp_bridge -- near steel 10.0.0.1:5600 10.0.0.2:5600`,
//! then `docktwin hil SCENARIO --rig ipc:steel`.
//!
//! The ends validate nothing; the rig does, and the loop. They only take time stamps from one
//! `CLOCK_MONOTONIC` to the other. Use a cable of its own: nothing here is encrypted or authenticated.

use std::{
    io::ErrorKind,
    net::UdpSocket,
    process::ExitCode,
    time::{Duration, Instant},
};

use docktwin_rigport::{
    clock::monotonic_ns,
    ipc::{IpcRig, RigPort},
    message::{Flags, RigCommand, RigMeasurement},
    rig::{Rig, RigError},
};

/// What a datagram is: its first four bytes.
const PING: u32 = 1;
const PONG: u32 = 2;
const COMMAND: u32 = 3;
const MEASUREMENT: u32 = 4;

/// Kind, four bytes of zero, number of the datagram, offset of the clocks.
const HEADER: usize = 24;
const LARGEST: usize = HEADER + RigMeasurement::WIRE_BYTES;

/// Between two looks at the other clock, and as long as there are too few.
const PING_PERIOD: Duration = Duration::from_millis(50);
const FIRST_PING_PERIOD: Duration = Duration::from_millis(2);
/// Looks at the other clock of which the quickest counts; before so many nothing is passed on.
const LOOKS: usize = 16;
/// How long the far end waits for the rig in lockstep.
const LOCKSTEP_PATIENCE: Duration = Duration::from_secs(30);
/// An end that was started anew counts from another number; silence as long as this lets it in.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(1);

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// What precedes every message.
#[derive(Clone, Copy)]
struct Header {
    kind: u32,
    /// Rises with every datagram of an end: copies and late ones are dropped by it.
    number: u64,
    /// Far clock less near clock, ns, as it was used for this command and its answer.
    offset_ns: i64,
}

fn datagram(header: Header, body: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(LARGEST);
    out.extend(header.kind.to_le_bytes());
    out.extend([0; 4]);
    out.extend(header.number.to_le_bytes());
    out.extend(header.offset_ns.to_le_bytes());
    out.extend(body);
    out
}

fn opened(datagram: &[u8]) -> Option<(Header, &[u8])> {
    let (header, body) = datagram.split_at_checked(HEADER)?;
    let kind = u32::from_le_bytes(header[..4].try_into().ok()?);
    let number = u64::from_le_bytes(header[8..16].try_into().ok()?);
    let offset_ns = i64::from_le_bytes(header[16..24].try_into().ok()?);
    Some((Header { kind, number, offset_ns }, body))
}

/// A socket that hears one peer, and each datagram of it once.
struct Wire {
    socket: UdpSocket,
    number: u64,
    heard: u64,
    heard_at: Instant,
}

impl Wire {
    fn new(socket: UdpSocket) -> Self {
        // Above the numbers of an earlier end on this machine.
        Self { socket, number: monotonic_ns(), heard: 0, heard_at: Instant::now() }
    }

    fn send(&mut self, kind: u32, offset_ns: i64, body: &[u8]) -> Result<(), Failure> {
        self.number += 1;
        let header = Header { kind, number: self.number, offset_ns };
        match self.socket.send(&datagram(header, body)) {
            Ok(_) => Ok(()),
            // Nobody there yet: as if the datagram were lost.
            Err(e) if e.kind() == ErrorKind::ConnectionRefused => Ok(()),
            Err(e) => Err(e.into()),
        }
    }

    /// The next datagram into `buffer`, if one is there that is new.
    fn receive<'a>(
        &mut self,
        buffer: &'a mut [u8; LARGEST + 1],
    ) -> Result<Option<(Header, &'a [u8])>, Failure> {
        let length = match self.socket.recv(buffer) {
            Ok(length) => length,
            Err(e) => match e.kind() {
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::ConnectionRefused => {
                    return Ok(None);
                }
                _ => return Err(e.into()),
            },
        };
        let Some((header, body)) = opened(&buffer[..length]) else { return Ok(None) };
        if header.number <= self.heard && self.heard_at.elapsed() < FORGOTTEN_AFTER {
            return Ok(None);
        }
        (self.heard, self.heard_at) = (header.number, Instant::now());
        Ok(Some((header, body)))
    }
}

/// Difference of two clocks from exchanges as in NTP: far less near. A datagram may be held up on its
/// way, never sped up, so of the last exchanges the quickest is the best; it errs by half the time that
/// the two ways differ, at most by half the round trip.
#[derive(Default)]
struct ClockOffset {
    /// Round trip and offset, ns.
    looks: [(i64, i64); LOOKS],
    count: usize,
}

impl ClockOffset {
    /// Sent at `t0` (near), received at `t1` and answered at `t2` (far), back at `t3` (near), ns.
    fn look(&mut self, [t0, t1, t2, t3]: [i64; 4]) {
        let round_trip_ns = (t3 - t0) - (t2 - t1);
        let offset_ns = ((t1 - t0) + (t2 - t3)) / 2;
        self.looks[self.count % LOOKS] = (round_trip_ns, offset_ns);
        self.count += 1;
    }

    fn is_known(&self) -> bool {
        self.count >= LOOKS
    }

    /// Far clock less near clock, ns; 0 before the first look.
    fn offset_ns(&self) -> i64 {
        self.looks[..self.count.min(LOOKS)].iter().min().map_or(0, |l| l.1)
    }
}

fn signed_now_ns() -> i64 {
    i64::try_from(monotonic_ns()).unwrap_or(i64::MAX)
}

/// The near end's wire, and what it knows of the other clock.
struct NearEnd {
    wire: Wire,
    clocks: ClockOffset,
    pinged: Option<Instant>,
}

impl NearEnd {
    /// Looks at the other clock when it is time to.
    fn ping(&mut self) -> Result<(), Failure> {
        let period = if self.clocks.is_known() { PING_PERIOD } else { FIRST_PING_PERIOD };
        if self.pinged.is_none_or(|p| p.elapsed() > period) {
            self.pinged = Some(Instant::now());
            self.wire.send(PING, 0, &signed_now_ns().to_le_bytes())?;
        }
        Ok(())
    }

    /// The next measurement, its stamp on the near clock; answers to pings are taken on the way.
    fn receive(&mut self) -> Result<Option<RigMeasurement>, Failure> {
        let mut buffer = [0; LARGEST + 1];
        while let Some((header, body)) = self.wire.receive(&mut buffer)? {
            match (header.kind, RigMeasurement::from_bytes(body), looked(body)) {
                (MEASUREMENT, Ok(mut m), _) => {
                    m.stamp_ns = m.stamp_ns.saturating_add_signed(-header.offset_ns);
                    return Ok(Some(m));
                }
                (PONG, _, Some([t0, t1, t2])) => self.clocks.look([t0, t1, t2, signed_now_ns()]),
                // What cannot be read is lost; the loop will say that it is missing.
                _ => (),
            }
        }
        Ok(None)
    }
}

/// The three times of a pong.
fn looked(body: &[u8]) -> Option<[i64; 3]> {
    let at = |i: usize| -> Option<i64> {
        Some(i64::from_le_bytes(body.get(8 * i..8 * i + 8)?.try_into().ok()?))
    };
    Some([at(0)?, at(1)?, at(2)?])
}

/// The end beside the loop: a rig to it, until `stop` says so. It is there for a loop as soon as the
/// other end is, and the clocks are known.
pub(crate) fn near(
    name: &str,
    socket: UdpSocket,
    mut stop: impl FnMut() -> bool,
) -> Result<(), Failure> {
    socket.set_nonblocking(true)?;
    let clocks = ClockOffset::default();
    let mut end = NearEnd { wire: Wire::new(socket), clocks, pinged: None };
    while !end.clocks.is_known() && !stop() {
        end.ping()?;
        end.receive()?;
        std::thread::sleep(Duration::from_micros(50));
    }
    let port = RigPort::open(name)?;
    while !stop() {
        end.ping()?;
        let mut quiet = true;
        while let Some(command) = port.receive()? {
            quiet = false;
            // In lockstep there is no clock but the loop's.
            let lockstep = command.flags.contains(Flags::LOCKSTEP);
            let offset_ns = if lockstep { 0 } else { end.clocks.offset_ns() };
            end.wire.send(COMMAND, offset_ns, &command.to_bytes())?;
        }
        while let Some(m) = end.receive()? {
            quiet = false;
            port.send(&m)?;
        }
        if quiet {
            port.wait(Duration::from_micros(50));
        }
    }
    Ok(())
}

/// The end beside the rig: a loop to it, until `stop` says so.
pub(crate) fn far(
    name: &str,
    socket: UdpSocket,
    mut stop: impl FnMut() -> bool,
) -> Result<(), Failure> {
    let idle = Some(Duration::from_millis(50));
    socket.set_read_timeout(idle)?;
    let mut rig = IpcRig::connect(name, LOCKSTEP_PATIENCE)?;
    let mut wire = Wire::new(socket);
    let mut buffer = [0; LARGEST + 1];
    // Offset of a command whose answer has not come within its tick.
    let mut owed = None;
    while !stop() {
        if let Some(offset_ns) = owed
            && let Some(m) = answer(&mut rig, Duration::ZERO)?
        {
            owed = None;
            wire.socket.set_read_timeout(idle)?;
            wire.send(MEASUREMENT, offset_ns, &m.to_bytes())?;
        }
        let Some((header, body)) = wire.receive(&mut buffer)? else { continue };
        match header.kind {
            PING => {
                let t1 = signed_now_ns().to_le_bytes();
                let mut answer = body.to_vec();
                answer.extend(t1);
                answer.extend(signed_now_ns().to_le_bytes());
                wire.send(PONG, 0, &answer)?;
            }
            COMMAND => {
                // One of another size is lost; silence brings the rig to its safe state.
                let Ok(command) = RigCommand::from_bytes(body) else { continue };
                match exchange(&mut rig, command, header.offset_ns)? {
                    Some(m) => wire.send(MEASUREMENT, header.offset_ns, &m.to_bytes())?,
                    None => {
                        owed = Some(header.offset_ns);
                        wire.socket.set_read_timeout(Some(Duration::from_millis(1)))?;
                    }
                }
            }
            _ => (),
        }
    }
    Ok(())
}

/// Passes a command on and waits for its answer: a tick at most in real time.
fn exchange(
    rig: &mut IpcRig,
    mut command: RigCommand,
    offset_ns: i64,
) -> Result<Option<RigMeasurement>, RigError> {
    command.wakeup_ns = command.wakeup_ns.saturating_add_signed(offset_ns);
    let lockstep = command.flags.contains(Flags::LOCKSTEP);
    let period = Duration::from_nanos(command.period_ns).min(LOCKSTEP_PATIENCE);
    rig.send(&command)?;
    answer(rig, if lockstep { LOCKSTEP_PATIENCE } else { period })
}

/// What the rig answers within `patience`. Whether its time has come is for the loop to say.
fn answer(rig: &mut IpcRig, patience: Duration) -> Result<Option<RigMeasurement>, RigError> {
    match rig.receive(patience, u64::MAX) {
        Err(RigError::Refused(_)) => Ok(None),
        answer => answer,
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [end, name, here, there] = &arguments[..] else {
        eprintln!("usage: udp_bridge near|far NAME OWN_ADDRESS:PORT OTHER_ADDRESS:PORT");
        return ExitCode::from(2);
    };
    let run = || -> Result<(), Failure> {
        let socket = UdpSocket::bind(here)?;
        socket.connect(there)?;
        match end.as_str() {
            "near" => near(name, socket, || false),
            "far" => far(name, socket, || false),
            _ => Err("the first word is near or far".into()),
        }
    };
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two clocks 5 s apart; one exchange of four is not held up.
    #[test]
    fn oracle_the_quickest_exchange_gives_the_offset() {
        let mut clocks = ClockOffset::default();
        assert!(!clocks.is_known());
        let apart = 5_000_000_000;
        for (there, back) in [(900, 40), (50, 50), (40, 2000), (700, 600)] {
            let t0 = 1_000_000;
            let t1 = t0 + there + apart;
            let t2 = t1 + 30;
            clocks.look([t0, t1, t2, t2 - apart + back]);
        }
        assert_eq!(clocks.offset_ns(), apart);
    }

    #[test]
    fn invariant_an_old_look_is_forgotten() {
        let mut clocks = ClockOffset::default();
        clocks.look([0, 10, 10, 0]);
        for _ in 0..LOOKS {
            clocks.look([0, 150, 150, 100]);
        }
        assert!(clocks.is_known());
        assert_eq!(clocks.offset_ns(), 100);
    }

    #[test]
    fn invariant_a_copy_of_a_datagram_is_dropped() {
        let pair = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a port"));
        pair[0].connect(pair[1].local_addr().expect("bound")).expect("there");
        pair[1].connect(pair[0].local_addr().expect("bound")).expect("there");
        let mut here = Wire::new(pair[1].try_clone().expect("a copy"));
        let header = Header { kind: COMMAND, number: 7, offset_ns: -3 };
        let mut buffer = [0; LARGEST + 1];
        for (number, new) in [(7, true), (7, false), (6, false), (8, true)] {
            pair[0].send(&datagram(Header { number, ..header }, &[1, 2])).expect("sent");
            let got = here.receive(&mut buffer).expect("heard");
            assert_eq!(got.is_some(), new, "number {number}");
            if let Some((header, body)) = got {
                assert_eq!((header.offset_ns, body), (-3, &[1, 2][..]));
            }
        }
    }
}
