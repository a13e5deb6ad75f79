//! When two docking mechanisms are in contact, and when a contact has ended: one definition for the loop,
//! for events and for figures.

use crate::SimTime;

/// Force at a port of a rig beyond which its mechanisms count as in contact, N. Far above the noise of
/// the sensors (0.3 N rms) and what a tare leaves, far below what a docking needs. A twin knows without a
/// force when its surfaces touch.
pub const PORT_CONTACT_N: f64 = 5.0;

/// A contact ends when its surfaces have been apart for longer than this, ns; shorter separations
/// are chatter within one contact.
pub const CONTACT_GAP_NS: u64 = 20_000_000;

/// What an instant did to a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactChange {
    /// It begins at this instant.
    Began,
    /// It is over: it lasted from `begin` to `end`, which is more than [`CONTACT_GAP_NS`] ago.
    Ended {
        /// First instant in contact.
        begin: SimTime,
        /// Last instant in contact.
        end: SimTime,
    },
}

/// Follows one pair of surfaces, or one port, from contact to contact.
///
/// ```
/// use docktwin_core::{ContactChange, ContactSpan, SimTime};
///
/// let ms = |t: u64| SimTime::from_nanos(t * 1_000_000);
/// let mut span = ContactSpan::default();
/// assert_eq!(span.observe(ms(3), true), Some(ContactChange::Began));
/// // Apart for 20 ms is still the same contact, for longer it is over.
/// assert_eq!(span.observe(ms(23), false), None);
/// let over = span.observe(ms(24), false);
/// assert_eq!(over, Some(ContactChange::Ended { begin: ms(3), end: ms(3) }));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactSpan {
    /// First and last instant in contact.
    span: Option<[SimTime; 2]>,
}

impl ContactSpan {
    /// Takes an instant, later than the one before, at which the surfaces touch or not: every tick of a run.
    pub fn observe(&mut self, time: SimTime, touching: bool) -> Option<ContactChange> {
        match (&mut self.span, touching) {
            (None, true) => {
                self.span = Some([time; 2]);
                Some(ContactChange::Began)
            }
            (Some([_, last]), true) => {
                *last = time;
                None
            }
            (Some([begin, end]), false) if time.nanos() - end.nanos() > CONTACT_GAP_NS => {
                let over = ContactChange::Ended { begin: *begin, end: *end };
                self.span = None;
                Some(over)
            }
            (_, false) => None,
        }
    }

    /// First and last instant of the contact that lasts, if one does.
    #[must_use]
    pub const fn span(&self) -> Option<[SimTime; 2]> {
        self.span
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(t: u64) -> SimTime {
        SimTime::from_nanos(t * 1_000_000)
    }

    /// A contact of 5 ms, apart for 20 ms, one tick of contact, apart for 21 ms, and one tick again.
    #[test]
    fn oracle_up_to_twenty_milliseconds_apart_are_one_contact() {
        let mut span = ContactSpan::default();
        let mut seen = Vec::new();
        for t in 0..100 {
            let touching = (10..15).contains(&t) || t == 35 || t == 57;
            if let Some(change) = span.observe(ms(t), touching) {
                seen.push((t, change));
            }
        }
        let expected = [
            (10, ContactChange::Began),
            (56, ContactChange::Ended { begin: ms(10), end: ms(35) }),
            (57, ContactChange::Began),
            (78, ContactChange::Ended { begin: ms(57), end: ms(57) }),
        ];
        assert_eq!(seen, expected);
        assert_eq!(span.span(), None);
    }

    /// The definition does not depend on where in a run the contact lies, as seconds in floating point do.
    #[test]
    fn invariant_the_gap_is_exact_at_every_instant() {
        for begin in (0..1_000_000).step_by(977) {
            let mut span = ContactSpan::default();
            span.observe(ms(begin), true);
            assert_eq!(span.observe(ms(begin + 20), false), None, "{begin}");
            assert!(span.observe(ms(begin + 21), false).is_some(), "{begin}");
        }
    }
}
