//! The rig port between processes of one machine, in shared memory (iceoryx2).
//!
//! A rig of name N has two publish-subscribe services, `docktwin/N/command` and
//! `docktwin/N/measurement`, and two event services of the same names that wake the other side. Each
//! has one publisher, so a second rig or a second loop of the name cannot start. What processes left
//! behind that were killed is cleaned whenever a side starts.

use core::{fmt, time::Duration};
use std::{fs::DirEntry, path::Path, time::Instant};

use iceoryx2::{
    node::NodeView as _,
    port::{
        listener::Listener, notifier::Notifier, publisher::Publisher,
        publisher::PublisherCreateError, subscriber::Subscriber,
        update_connections::UpdateConnections,
    },
    prelude::*,
    service::{
        builder::{
            event::{EventOpenError, EventOpenOrCreateError},
            publish_subscribe::{PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError},
        },
        port_factory::{event, publish_subscribe},
        service_hash::ServiceHash,
        static_config::messaging_pattern::MessagingPattern as StaticPattern,
    },
};

use crate::{
    clock::monotonic_ns,
    message::{Flags, PROTOCOL_VERSION, Refusal, RigCommand, RigMeasurement, Status},
    rig::{Plant, Rig, RigError},
    validate::{RigEnd, RigEndCounts, SILENT_PERIODS, Sequence},
};

/// Messages that wait for a slow reader; then the oldest is lost. Fixed by the protocol. A rig in its safe
/// state sends one a period for observers, and the answer among them must not be lost while the
/// kernel has preempted the reader.
const BUFFER: usize = 64;
/// Readers of each service: the other side, and observers. Fixed by the protocol.
const READERS: usize = 4;
/// Processes on each service. Fixed by the protocol.
const NODES: usize = 8;
/// Longest name of a rig, characters.
const LONGEST_NAME: usize = 64;

/// How long a side tries to start while others clean up, or are about to vanish.
const START_PATIENCE: Duration = Duration::from_secs(5);
/// Where Linux shows shared memory.
const SHARED_MEMORY: &str = "/dev/shm";
/// What a living process makes or cleans is finished by then.
const FINISHED_BY: Duration = Duration::from_secs(1);
/// Between two tries.
const START_PAUSE: Duration = Duration::from_millis(5);
/// The kernel rounds waits on sockets up to its own ticks, mostly 4 ms: the rest is slept away.
const SOCKET_ROUNDING: Duration = Duration::from_millis(9);
/// One sleep of such a rest.
const SHORT_SLEEP: Duration = Duration::from_micros(20);
/// A rig looks this often whether it is to stop.
const STOP_CHECK: Duration = Duration::from_millis(50);

/// Why a side did not start.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IpcError {
    /// Not a name.
    #[error(
        "`{0}` is no name for a rig: take 1 to 64 of the letters a-z and A-Z, digits, `-`, `_` and `.`"
    )]
    Name(String),
    /// The name is taken.
    #[error(
        "there is a {side} of this name, {holder}: stop it, or take another name than `{name}`"
    )]
    Second {
        /// What is there.
        side: Side,
        /// Of which process.
        holder: String,
        /// Name of the rig.
        name: String,
    },
    /// No rig.
    #[error("there is no rig of the name `{0}`: start the rig first, or mend the name")]
    NoRig(String),
    /// The other side speaks another version of the port.
    #[error(
        "`{service}` is of version {theirs} of the port, this side speaks version {PROTOCOL_VERSION}: \
         change that side as the section `From version 2 to version 3` of docs/rig-protocol.md says, \
         build it again, and stop the one that still runs"
    )]
    Version {
        /// Name of the service.
        service: String,
        /// Version of its type.
        theirs: u32,
    },
    /// The service carries something else.
    #[error(
        "`{0}` carries another type, or one of another size: build both sides from the same protocol \
         page, and stop what still runs of another version"
    )]
    Payload(String),
    /// The service was made with other settings.
    #[error(
        "`{service}` was made with other settings ({what}): see the table in the protocol page"
    )]
    Settings {
        /// Name of the service.
        service: String,
        /// As iceoryx2 says it.
        what: String,
    },
    /// Whatever the transport says besides.
    #[error(
        "iceoryx2 cannot open `{service}` ({what}): look at the rights on /tmp/iceoryx2 and /dev/shm"
    )]
    Transport {
        /// Name of the service.
        service: String,
        /// As iceoryx2 says it.
        what: String,
    },
}

impl IpcError {
    /// The reason as the port numbers it, where it has a number.
    #[must_use]
    pub const fn refusal(&self) -> Option<Refusal> {
        match self {
            Self::Second { .. } => Some(Refusal::Second),
            Self::Version { .. } => Some(Refusal::Version),
            Self::Payload(_) => Some(Refusal::Size),
            _ => None,
        }
    }
}

/// An end of the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Sends measurements.
    Rig,
    /// Sends commands.
    Loop,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rig => "rig",
            Self::Loop => "loop",
        })
    }
}

/// A name that can stand in the name of a service.
fn checked(name: &str) -> Result<&str, IpcError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if (1..=LONGEST_NAME).contains(&name.len()) && name.chars().all(allowed) {
        Ok(name)
    } else {
        Err(IpcError::Name(name.to_owned()))
    }
}

/// One direction: its data service and its event service (the bell).
#[derive(Debug)]
struct Direction<T: fmt::Debug + ZeroCopySend + 'static> {
    service: String,
    data: publish_subscribe::PortFactory<ipc::Service, T, ()>,
    bell: event::PortFactory<ipc::Service>,
}

impl<T: fmt::Debug + ZeroCopySend + 'static> Direction<T> {
    fn open(node: &Node<ipc::Service>, name: &str, what: &str) -> Result<Self, Start> {
        let service = format!("docktwin/{name}/{what}");
        let service_name =
            service.as_str().try_into().map_err(|e| Start::Refused(transport(&service, &e)))?;
        let data = node
            .service_builder(&service_name)
            .publish_subscribe::<T>()
            .history_size(1)
            .subscriber_max_buffer_size(BUFFER)
            .subscriber_max_borrowed_samples(2)
            .max_publishers(1)
            .max_subscribers(READERS)
            .max_nodes(NODES)
            .enable_safe_overflow(true)
            .open_or_create()
            .map_err(|e| data_failed(&service, e))?;
        let bell = node
            .service_builder(&service_name)
            .event()
            .max_notifiers(READERS)
            .max_listeners(READERS)
            .max_nodes(NODES)
            .open_or_create()
            .map_err(|e| bell_failed(&service, e))?;
        Ok(Self { service, data, bell })
    }

    fn writer(&self) -> Result<Publisher<ipc::Service, T, ()>, PublisherCreateError> {
        self.data
            .publisher_builder()
            .max_loaned_samples(1)
            // Nobody waits: the oldest message goes.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
    }

    fn notifier(&self) -> Result<Notifier<ipc::Service>, Start> {
        let made = self.bell.notifier_builder().create();
        made.map_err(|e| Start::Retry(transport(&self.service, &e)))
    }

    fn reader(&self) -> Result<Reader<T>, Start> {
        let bell = self.bell.listener_builder().create();
        let bell = bell.map_err(|e| Start::Retry(transport(&self.service, &e)))?;
        let data = self.data.subscriber_builder().buffer_size(BUFFER).create();
        Ok(Reader { data: data.map_err(|e| Start::Retry(transport(&self.service, &e)))?, bell })
    }

    /// Process that writes, if it lives.
    fn holder(&self) -> Option<String> {
        let mut writer = None;
        self.data.dynamic_config().list_publishers(|p| {
            writer = Some(p.node_id);
            CallbackProgression::Stop
        });
        match Node::<ipc::Service>::state_of(Config::global_config(), writer?) {
            Ok(Some(NodeState::Alive(view))) => Some(match view.details() {
                Some(d) => format!("process {} ({})", d.process_id(), d.executable()),
                None => "a process that gives no details of itself".to_owned(),
            }),
            Ok(Some(NodeState::Inaccessible(_) | NodeState::Undefined(_))) => {
                Some("a process of another user".to_owned())
            }
            Ok(Some(NodeState::Dead(_)) | None) | Err(_) => None,
        }
    }
}

/// Why a try to start failed.
enum Start {
    /// What another process does at this moment may be the cause.
    Retry(IpcError),
    /// A process was killed while it made this service, or has left itself in it.
    Stuck {
        service: String,
        pattern: MessagingPattern,
        what: String,
    },
    Refused(IpcError),
}

fn transport(service: &str, e: &dyn fmt::Debug) -> IpcError {
    IpcError::Transport { service: service.to_owned(), what: format!("{e:?}") }
}

fn data_failed(service: &str, e: PublishSubscribeOpenOrCreateError) -> Start {
    use PublishSubscribeOpenError as Open;
    use PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError as NotOpened;
    match e {
        NotOpened(Open::IncompatibleTypes) => Start::Refused(other_type(service)),
        NotOpened(
            Open::DoesNotSupportRequestedMinBufferSize
            | Open::DoesNotSupportRequestedMinHistorySize
            | Open::DoesNotSupportRequestedMinSubscriberBorrowedSamples
            | Open::DoesNotSupportRequestedAmountOfPublishers
            | Open::DoesNotSupportRequestedAmountOfSubscribers
            | Open::DoesNotSupportRequestedAmountOfNodes
            | Open::IncompatibleOverflowBehavior,
        ) => Start::Refused(other_settings(service, &e)),
        NotOpened(Open::HangsInCreation | Open::ServiceInCorruptedState) => {
            stuck(service, MessagingPattern::PublishSubscribe, &e)
        }
        _ => Start::Retry(transport(service, &e)),
    }
}

fn bell_failed(service: &str, e: EventOpenOrCreateError) -> Start {
    use EventOpenError as Open;
    use EventOpenOrCreateError::EventOpenError as NotOpened;
    match e {
        NotOpened(
            Open::DoesNotSupportRequestedAmountOfNotifiers
            | Open::DoesNotSupportRequestedAmountOfListeners
            | Open::DoesNotSupportRequestedAmountOfNodes,
        ) => Start::Refused(other_settings(service, &e)),
        NotOpened(Open::HangsInCreation | Open::ServiceInCorruptedState) => {
            stuck(service, MessagingPattern::Event, &e)
        }
        _ => Start::Retry(transport(service, &e)),
    }
}

/// Which other type a service carries: an older version's structure, or anything.
fn other_type(service: &str) -> IpcError {
    let config = Config::global_config();
    let details = service.try_into().ok().and_then(|name| {
        <ipc::Service as iceoryx2::service::Service>::details(
            &name,
            config,
            MessagingPattern::PublishSubscribe,
        )
        .ok()?
    });
    let type_name = details.and_then(|d| match d.static_details.messaging_pattern() {
        StaticPattern::PublishSubscribe(p) => {
            Some(p.message_type_details().payload.type_name().to_string())
        }
        _ => None,
    });
    let version = type_name.and_then(|name| {
        let of = |what| name.strip_prefix(what)?.parse().ok();
        of("DocktwinRigCommandV").or_else(|| of("DocktwinRigMeasurementV"))
    });
    match version {
        Some(theirs) if theirs != PROTOCOL_VERSION => {
            IpcError::Version { service: service.to_owned(), theirs }
        }
        _ => IpcError::Payload(service.to_owned()),
    }
}

fn stuck(service: &str, pattern: MessagingPattern, e: &dyn fmt::Debug) -> Start {
    Start::Stuck { service: service.to_owned(), pattern, what: format!("{e:?}") }
}

fn other_settings(service: &str, e: &dyn fmt::Debug) -> IpcError {
    IpcError::Settings { service: service.to_owned(), what: format!("{e:?}") }
}

/// Removes shared memory of processes that were killed between making and sizing it, which takes a
/// living one microseconds. iceoryx2 waits for a size without an end, at the start of every process.
fn sweep() {
    let prefix = &Config::global_config().global.prefix;
    let begun = Instant::now();
    loop {
        let all = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        let ours = |e: &DirEntry| e.file_name().to_string_lossy().starts_with(prefix.as_str());
        let sizeless = |e: &DirEntry| e.metadata().is_ok_and(|m| m.is_file() && m.len() == 0);
        let mut young = false;
        for file in all.filter(|e| ours(e) && sizeless(e)).map(|e| e.path()) {
            if is_old(&file) {
                // One that stays is named by the try that meets it.
                let _ = std::fs::remove_file(file);
            } else {
                young = true;
            }
        }
        if !young || begun.elapsed() > START_PATIENCE {
            return;
        }
        std::thread::sleep(START_PAUSE);
    }
}

/// True when nobody can be about to finish this file.
fn is_old(file: &Path) -> bool {
    let made = std::fs::metadata(file).and_then(|m| m.modified());
    made.is_ok_and(|m| m.elapsed().is_ok_and(|age| age > FINISHED_BY))
}

/// Makes iceoryx2 forget a service that nobody can finish or leave any more. It forgets a process that
/// was killed while it made a service, and not the service: its own file stays in the way for ever.
/// A young file may be one that was just begun.
fn forget(service: &str, pattern: MessagingPattern) {
    type Hasher = <ipc::Service as iceoryx2::service::Service>::ServiceNameHasher;
    let global = &Config::global_config().global;
    let Ok(service_name) = service.try_into() else { return };
    let hash = ServiceHash::new::<Hasher>(&service_name, pattern);
    let suffix = &global.service.static_config_storage_suffix;
    let file = format!("{}/{}{hash}{suffix}", global.service_dir(), global.prefix);
    if is_old(Path::new(&file)) {
        // If that fails, so does the next try, with its own reason.
        let _ = std::fs::remove_file(file);
    }
}

#[derive(Debug)]
struct Writer<T: fmt::Debug + ZeroCopySend + 'static> {
    data: Publisher<ipc::Service, T, ()>,
    bell: Notifier<ipc::Service>,
}

impl<T: fmt::Debug + ZeroCopySend + Copy + 'static> Writer<T> {
    fn write(&self, message: &T) -> Result<(), RigError> {
        self.data.send_copy(*message).map_err(|_| RigError::Transport)?;
        // A bell that cannot be rung delays the reader and loses nothing.
        let _ = self.bell.notify();
        Ok(())
    }
}

#[derive(Debug)]
struct Reader<T: fmt::Debug + ZeroCopySend + 'static> {
    data: Subscriber<ipc::Service, T, ()>,
    bell: Listener<ipc::Service>,
}

impl<T: fmt::Debug + ZeroCopySend + Copy + 'static> Reader<T> {
    fn read(&self) -> Result<Option<T>, RigError> {
        let sample = self.data.receive().map_err(|_| RigError::Transport)?;
        Ok(sample.map(|s| *s.payload()))
    }

    /// Waits until the bell may have rung, at most `patience`.
    fn wait(&self, patience: Duration) {
        if patience > SOCKET_ROUNDING {
            let _ = self.bell.timed_wait(|_| (), patience - SOCKET_ROUNDING);
        } else if !matches!(self.bell.try_wait(|_| ()), Ok(1..)) {
            std::thread::sleep(patience.min(SHORT_SLEEP));
        }
    }
}

/// Both directions, and the writing end of one. Ports go before the services they belong to, those
/// before the node: the order of the fields.
#[derive(Debug)]
struct End<R, W>
where
    R: fmt::Debug + ZeroCopySend + Copy + 'static,
    W: fmt::Debug + ZeroCopySend + Copy + 'static,
{
    writer: Writer<W>,
    reader: Reader<R>,
    from: Direction<R>,
    to: Direction<W>,
    _node: Node<ipc::Service>,
}

impl<R, W> End<R, W>
where
    R: fmt::Debug + ZeroCopySend + Copy + 'static,
    W: fmt::Debug + ZeroCopySend + Copy + 'static,
{
    /// Opens a side, as soon as what the dead left is cleaned.
    fn start(name: &str, side: Side) -> Result<Self, IpcError> {
        let name = checked(name)?;
        let begun = Instant::now();
        loop {
            sweep();
            // A new node for every try: nothing of an earlier one stands in the way.
            let failed = match Self::try_start(name, side) {
                Ok(end) => return Ok(end),
                Err(failed) => failed,
            };
            let late = begun.elapsed() > START_PATIENCE;
            match failed {
                Start::Refused(e) => return Err(e),
                Start::Retry(e) if late => return Err(e),
                Start::Stuck { service, what, .. } if late => {
                    return Err(IpcError::Transport { service, what });
                }
                // Before that another process may be at it, one that cleans included.
                Start::Stuck { service, pattern, .. } if begun.elapsed() > FINISHED_BY => {
                    forget(&service, pattern);
                }
                Start::Stuck { .. } | Start::Retry(_) => (),
            }
            std::thread::sleep(START_PAUSE);
        }
    }

    fn try_start(name: &str, side: Side) -> Result<Self, Start> {
        let (reads, writes) = match side {
            Side::Rig => ("command", "measurement"),
            Side::Loop => ("measurement", "command"),
        };
        let node = NodeBuilder::new()
            // Signals belong to the command line.
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|e| Start::Retry(transport("nodes", &e)))?;
        node.blocking_cleanup_dead_nodes(START_PATIENCE);
        let from = Direction::<R>::open(&node, name, reads)?;
        let to = Direction::<W>::open(&node, name, writes)?;
        let writer = match to.writer() {
            Ok(writer) => writer,
            Err(PublisherCreateError::ExceedsMaxSupportedPublishers) => {
                return Err(match to.holder() {
                    Some(holder) => {
                        Start::Refused(IpcError::Second { side, holder, name: name.to_owned() })
                    }
                    None => stuck(
                        &to.service,
                        MessagingPattern::PublishSubscribe,
                        &"held by a process that is gone",
                    ),
                });
            }
            Err(e) => return Err(Start::Retry(transport(&to.service, &e))),
        };
        Ok(Self {
            writer: Writer { data: writer, bell: to.notifier()? },
            reader: from.reader()?,
            from,
            to,
            _node: node,
        })
    }
}

/// A rig in another process, from the loop.
///
/// Stays in the thread that made it: connect on the loop's own thread, before its first tick. From
/// then on nothing here locks or logs, and nothing allocates but iceoryx2 0.10 itself: one block of 48
/// bytes a command, given back at once. All that holds as long as the other side stays.
#[derive(Debug)]
pub struct IpcRig {
    end: End<RigMeasurement, RigCommand>,
    sequence: Sequence,
    lockstep: bool,
    /// Tick of the last command.
    sent: u64,
    /// Commands since the rig was last heard.
    unanswered: u64,
}

impl IpcRig {
    /// Joins the rig `name`; waits up to `patience` for it to be there.
    ///
    /// # Errors
    /// See [`IpcError`]; [`IpcError::NoRig`] after `patience`.
    pub fn connect(name: &str, patience: Duration) -> Result<Self, IpcError> {
        let begun = Instant::now();
        let end = End::<RigMeasurement, RigCommand>::start(name, Side::Loop)?;
        let there = || {
            let readers = end.to.data.dynamic_config().number_of_subscribers();
            end.from.holder().is_some() && readers > 0
        };
        while !there() {
            if begun.elapsed() >= patience {
                return Err(IpcError::NoRig(name.to_owned()));
            }
            std::thread::sleep(START_PAUSE);
        }
        // Connections are made here, so that the first tick need not make them.
        let made = end.writer.data.update_connections();
        made.map_err(|e| transport(&end.to.service, &e))?;
        end.writer.bell.notify().map_err(|e| transport(&end.to.service, &e))?;
        // What a rig answered an earlier loop is not for this one.
        while let Ok(Some(_)) = end.reader.read() {}
        Ok(Self { end, sequence: Sequence::default(), lockstep: false, sent: 0, unanswered: 0 })
    }

    /// The newest measurement that is for the loop.
    fn newest(&self) -> Result<Option<RigMeasurement>, RigError> {
        let mut newest = None;
        while let Some(m) = self.end.reader.read()? {
            let answers = !m.is(Status::UNSOLICITED);
            // In lockstep, what comes late answers a command that was given up.
            if answers && (!self.lockstep || m.tick == self.sent || m.is(Status::REFUSED)) {
                newest = Some(m);
            }
        }
        Ok(newest)
    }

    /// What it means that none came.
    fn none(&self) -> Result<Option<RigMeasurement>, RigError> {
        let gone =
            if self.lockstep { self.unanswered > 0 } else { self.unanswered >= SILENT_PERIODS };
        if gone { Err(RigError::Gone) } else { Ok(None) }
    }
}

impl Rig for IpcRig {
    fn send(&mut self, command: &RigCommand) -> Result<(), RigError> {
        if command.session != self.sequence.session {
            self.sequence = Sequence { session: command.session, tick: None };
            self.unanswered = 0;
        }
        self.lockstep = command.flags.contains(Flags::LOCKSTEP);
        self.sent = command.tick;
        self.unanswered += 1;
        self.end.writer.write(command)
    }

    fn receive(
        &mut self,
        patience: Duration,
        now_ns: u64,
    ) -> Result<Option<RigMeasurement>, RigError> {
        let begun = Instant::now();
        loop {
            if let Some(mut m) = self.newest()? {
                self.unanswered = 0;
                self.sequence.measurement(&mut m, now_ns).map_err(RigError::Refused)?;
                return Ok(Some(m));
            }
            let left = patience.saturating_sub(begun.elapsed());
            // Measurements answer commands: without one under way none comes.
            if left.is_zero() || self.unanswered == 0 {
                return self.none();
            }
            self.end.reader.wait(left);
        }
    }
}

/// What a rig's end reports to whoever runs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RigEvent {
    /// A loop has begun a session.
    Session(u64),
    /// A command was refused.
    Refused {
        /// Why.
        refusal: Refusal,
        /// As the command says.
        tick: u64,
    },
    /// The rig has left the commands: one was refused, none came in time, or a session did not begin
    /// with idle.
    SafeState {
        /// Last good tick.
        tick: u64,
    },
}

/// How a rig's end runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServeOptions {
    /// Wall time without a command in lockstep, after which the rig goes to its safe state; default
    /// 1 s. In real time it is [`SILENT_PERIODS`] periods.
    pub lockstep_patience: Duration,
}

impl Default for ServeOptions {
    fn default() -> Self {
        Self { lockstep_patience: Duration::from_secs(1) }
    }
}

/// The rig's end as it is, for a bridge that passes messages on to where they are validated. Stays in the
/// thread that made it.
#[derive(Debug)]
pub struct RigPort {
    end: End<RigCommand, RigMeasurement>,
}

impl RigPort {
    /// Opens the rig `name`.
    ///
    /// # Errors
    /// See [`IpcError`].
    pub fn open(name: &str) -> Result<Self, IpcError> {
        Ok(Self { end: End::start(name, Side::Rig)? })
    }

    /// The next command, not validated.
    ///
    /// # Errors
    /// [`RigError::Transport`].
    pub fn receive(&self) -> Result<Option<RigCommand>, RigError> {
        self.end.reader.read()
    }

    /// Sends a measurement and wakes the loop.
    ///
    /// # Errors
    /// [`RigError::Transport`].
    pub fn send(&self, measurement: &RigMeasurement) -> Result<(), RigError> {
        self.end.writer.write(measurement)
    }

    /// Waits until a command may be there, at most `patience`.
    pub fn wait(&self, patience: Duration) {
        self.end.reader.wait(patience);
    }
}

/// The rig's end: drives any plant. Stays in the thread that made it.
#[derive(Debug)]
pub struct RigServer {
    port: RigPort,
    end: RigEnd,
}

impl RigServer {
    /// Opens the rig `name`.
    ///
    /// # Errors
    /// See [`IpcError`].
    pub fn open(name: &str) -> Result<Self, IpcError> {
        Ok(Self { port: RigPort::open(name)?, end: RigEnd::new() })
    }

    /// What was seen so far.
    #[must_use]
    pub const fn counts(&self) -> RigEndCounts {
        self.end.counts()
    }

    /// Serves until `stop` says so, which is asked at least every 50 ms; `report` gets what happens.
    ///
    /// # Errors
    /// [`RigError::Transport`] when measurements cannot be sent or commands not be read.
    pub fn serve(
        &mut self,
        plant: &mut impl Plant,
        options: ServeOptions,
        mut stop: impl FnMut() -> bool,
        mut report: impl FnMut(RigEvent),
    ) -> Result<RigEndCounts, RigError> {
        while !stop() {
            let (session, safe) = (self.end.session(), self.end.is_safe());
            let m = match self.port.receive()? {
                Some(command) => self.end.command(plant, &command, monotonic_ns()),
                None => {
                    let now_ns = monotonic_ns();
                    let due_ns = self.end.due_ns(options.lockstep_patience);
                    if now_ns < due_ns {
                        let patience = Duration::from_nanos(due_ns - now_ns).min(STOP_CHECK);
                        self.port.wait(patience);
                        continue;
                    }
                    self.end.silence(plant, now_ns)
                }
            };
            self.port.send(&m)?;
            if let Some(refusal) = Refusal::from_number(m.refusal) {
                report(RigEvent::Refused { refusal, tick: m.tick });
            }
            if self.end.session() != session {
                report(RigEvent::Session(m.session));
            }
            if self.end.is_safe() && !safe {
                report(RigEvent::SafeState { tick: self.end.tick() });
            }
        }
        Ok(self.end.counts())
    }
}
