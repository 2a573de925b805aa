//! The classes of faults in a world, and the promises that are checked.

/// One class of the catalogue (`docs/SIMULATION.md` has the table).
#[expect(missing_docs, reason = "the table tells what each is")]
#[rustfmt::skip]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    T1, T2, T3, T4, T5, T6, T7, T8, T9, T10, T11, T13, T14,
    P1, P2, P3, P4, P5, P6, P7, P8, P9, P10, P11, P12, P13, P14,
    C1, C2, C3, C4, C5, C6, C7, C8, C9, C10,
    K1, K2, K3, K4, S1, V1, V6,
    E1, E2, E3, E4, E5, E6, E7, E8,
    G1, G5, G6, G10, G13, S4, S5,
}

/// For each class: what it does here, and what is counted as one strike. "Done" means that it happened at the
/// machine or the host; it is not known whether anything noticed.
pub const CLASSES: [(Class, &str, &str); 59] = {
    use Class::*;
    [
        (T1, "connections are refused", "an attempt that was refused"),
        (T2, "attempts to connect get no answer", "an attempt that ended without an answer"),
        (T3, "accepted, then silence", "a connection that was struck"),
        (T4, "reset within a frame", "a connection that was struck"),
        (T5, "closed in place of a reply", "a connection that was struck"),
        (T6, "connections that are there go deaf for ever", "a connection that was struck"),
        (T7, "byte by byte, and several frames at once", "a connection that was struck"),
        (T8, "latency and jitter", "a connection that was struck"),
        (T9, "some bytes a second", "a connection that was struck"),
        (T10, "nothing is read at one end for a time", "a time after which bytes had waited"),
        (T11, "bytes changed, lost, added", "a connection that was struck"),
        (T13, "the network is away for a time", "a time in which something left"),
        (T14, "the second half of a frame comes late", "a connection that was struck"),
        (P1, "replies that are no JSON", "a reply"),
        (P2, "fields missing, renamed, of another type", "a reply"),
        (P3, "packID wrong, repeated, out of order, late", "a reply"),
        (P4, "replies to other clients", "a reply"),
        (P5, "lists of another length, shifted", "a reply"),
        (P6, "the request comes back", "a reply"),
        (P7, "frames that nobody asked for", "a reply"),
        (P8, "other dialects", "a connection over which something came"),
        (P9, "alarms that nobody knows", "an alarm: done"),
        (P10, "accepted and not done, done and not acknowledged", "a request"),
        (P11, "the list is full, or frozen", "a list that was refused, a time in which one waited"),
        (P12, "half a list is taken", "a list"),
        (P13, "only heartbeats are answered", "a request"),
        (P14, "another master", "a command into another's motion"),
        (C1, "the mode key", "a turn: done"),
        (C2, "the emergency stop", "a press: done"),
        (C3, "alarms, one and many", "an alarm: done"),
        (C4, "the mains of a cabinet fail, or its process is killed", "a failure: done"),
        (C5, "counters jump", "a jump: done"),
        (C6, "places that cannot be reached", "an alarm that stopped the arm at its limit"),
        (C7, "another speed, a pause, in the middle of a move", "a change while the arm moved"),
        (C8, "inputs bounce, outputs are set by others", "a change: done"),
        (C9, "values stand still although replies come", "a query that got old values"),
        (C10, "the program is overwritten", "a program that was loaded: done"),
        (K1, "calls are dropped where they wait", "a call"),
        (K2, "the program of a client is killed", "a program: done"),
        (K3, "calls that drive for others are dropped", "a call that was polled before"),
        (K4, "calls that drive for others are slow", "a call that was polled and then not for a time"),
        (S1, "the disk is full for a time", "a write that failed"),
        (V1, "a camera answers nothing, or rubbish", "rubbish that was sent"),
        (V6, "a camera answers late, or with no parts", "a photo that was asked for"),
        (E1, "a stop without effect", "a stop that was answered and not carried out"),
        (E2, "the arm dwells at each point", "a dwell"),
        (E3, "the first connection is deaf when a stop is asked for", "a stop that was asked for then"),
        (E4, "a list is taken after its answer timed out", "a list"),
        (E5, "another client clears the list", "a list that was cleared while a motion was under way"),
        (E6, "another robot answers at the address", "a connection to another robot"),
        (E7, "the program's own output fails while a motion is under way", "a motion that lost its program"),
        (E8, "the owner of a motion is interrupted", "a motion that lost its owner"),
        (
            G1,
            "one robot of a gateway answers hardly or not at all for half a minute",
            "a look at another robot meanwhile",
        ),
        (G5, "a reader of the gateway reads nothing", "a reader that was given up"),
        (G6, "robots are added, changed and removed while the gateway runs", "a change: done"),
        (G10, "the gateway gets no sockets", "a connection that was not made"),
        (G13, "a client of the gateway sends what it must not", "an attack: done"),
        (S4, "the gateway is killed", "a kill: done"),
        (S5, "the disk of the gateway is slow", "a time of that: done"),
    ]
};

/// A promise that is checked.
#[expect(missing_docs, reason = "the table tells what each is")]
#[rustfmt::skip]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Promise {
    I1, I2, I3, I4, I5, I6, I7, I9, I10, I11, Once, Recovery, NoPanic,
    Stopped, Whole, Gapless, Fresh, Meant, Owned, Soon, Driven,
    I8, I12,
}

/// The text of each promise.
pub const PROMISES: [(Promise, &str); 23] = {
    use Promise::*;
    [
        (I1, "nothing is delivered that was not received whole"),
        (I2, "a reply answers one request, and no late one answers any"),
        (I3, "no motion leaves without a look on the same connection"),
        (I4, "nothing moves without a command"),
        (I5, "every value has an age and a quality that fits it"),
        (I6, "tasks, lists, points, connections, files and frames are bounded"),
        (I7, "what was acknowledged as kept survives kill -9 and power cuts"),
        (I9, "the same seed gives the same bytes and the same log"),
        (I10, "what is shown as fresh is what the machine was"),
        (I11, "soft limits, speed, acceleration and jerk are kept"),
        (Once, "no list leaves twice, no instruction is carried out twice"),
        (Recovery, "when the faults are over all works again by itself"),
        (NoPanic, "nothing panics, nothing hangs"),
        (Stopped, "after a stop that was told as confirmed the arm does not move until a new command"),
        (Whole, "a motion told as done was carried out whole, by that robot, over that connection"),
        (Gapless, "no step in the middle of a motion told as done was left out"),
        (Fresh, "a value told as fresh is of the connection that is alive, and of that robot"),
        (Meant, "no stop and no clear reaches a robot that it was not meant for"),
        (Owned, "a motion without an owner is stopped or carried to its end, never cut silently"),
        (Soon, "a stop takes effect within 1.5 s where the first connection is deaf"),
        (Driven, "what comes is read, and heartbeats leave, whichever call drives"),
        (I8, "one robot or caller of a gateway does no harm to the others"),
        (I12, "nothing that changes or moves leaves a gateway but audited commands of authorised callers"),
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
