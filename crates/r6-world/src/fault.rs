//! The classes of faults that a world is broken by, and the promises that it is held to.

/// One class of the catalogue (`docs/SIMULATION.md` has the table).
#[expect(missing_docs, reason = "the table tells what each is")]
#[rustfmt::skip]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    T1, T2, T3, T4, T5, T6, T7, T8, T9, T10, T11, T13, T14,
    P1, P2, P3, P4, P5, P6, P7, P8, P9, P10, P11, P12, P13, P14,
    C1, C2, C3, C4, C5, C6, C7, C8, C9, C10,
    K1, K2, S1, V1, V6,
}

/// What each class does here.
pub const CLASSES: [(Class, &str); 42] = {
    use Class::*;
    [
        (T1, "connections are refused"),
        (T2, "attempts to connect get no answer"),
        (T3, "accepted, then silence"),
        (T4, "reset within a frame"),
        (T5, "closed in place of a reply"),
        (T6, "connections that are there go deaf for ever"),
        (T7, "byte by byte, and several frames at once"),
        (T8, "latency and jitter"),
        (T9, "some bytes a second"),
        (T10, "nothing is read at one end for a time"),
        (T11, "bytes changed, lost, added"),
        (T13, "the network is away for a time"),
        (T14, "the second half of a frame comes late"),
        (P1, "replies that are no JSON"),
        (P2, "fields missing, renamed, of another type"),
        (P3, "packID wrong, repeated, out of order, late"),
        (P4, "replies to other clients"),
        (P5, "lists of another length, shifted"),
        (P6, "the request comes back"),
        (P7, "frames that nobody asked for"),
        (P8, "other dialects"),
        (P9, "alarms that nobody knows"),
        (P10, "accepted and not done, done and not acknowledged"),
        (P11, "the list is full, or frozen"),
        (P12, "half a list is taken"),
        (P13, "only heartbeats are answered"),
        (P14, "another master"),
        (C1, "the mode key"),
        (C2, "the emergency stop"),
        (C3, "alarms, one and many"),
        (C4, "the mains of a cabinet fail, or its process is killed"),
        (C5, "counters jump"),
        (C6, "places that cannot be reached"),
        (C7, "another speed, a pause, in the middle of a move"),
        (C8, "inputs bounce, outputs are set by others"),
        (C9, "values stand still although replies come"),
        (C10, "the program is overwritten"),
        (K1, "calls are dropped where they wait"),
        (K2, "the program of a client is killed"),
        (S1, "the disk is full for a time"),
        (V1, "a camera answers nothing, or rubbish"),
        (V6, "a camera answers late, or with no parts"),
    ]
};

/// A promise that is checked.
#[expect(missing_docs, reason = "the table tells what each is")]
#[rustfmt::skip]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Promise {
    I1, I2, I3, I4, I5, I6, I7, I9, I10, I11, Once, Recovery, NoPanic,
}

/// What each promise says.
pub const PROMISES: [(Promise, &str); 13] = {
    use Promise::*;
    [
        (I1, "nothing is delivered that was not received whole"),
        (I2, "a reply answers one request, and no late one answers any"),
        (I3, "no motion leaves without a look on the same connection"),
        (I4, "after a stop, an alarm, a start or a reconnect nothing moves by itself"),
        (I5, "every value has an age and a quality that fits it"),
        (I6, "tasks, lists, points, connections, files and frames are bounded"),
        (I7, "what was acknowledged as kept survives kill -9 and power cuts"),
        (I9, "the same seed gives the same bytes and the same log"),
        (I10, "what is shown as fresh is what the machine was"),
        (I11, "soft limits, speed, acceleration and jerk are kept"),
        (Once, "no list leaves twice, no instruction is carried out twice"),
        (Recovery, "when the faults are over all works again by itself"),
        (NoPanic, "nothing panics, nothing hangs"),
    ]
};

impl Class {
    /// Its place in [`CLASSES`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

impl Promise {
    /// Its place in [`PROMISES`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}
