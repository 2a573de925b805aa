//! What a profile chooses between.

/// What AddRCC does while no program waits for remote commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unarmed {
    /// It is answered with `err` and dropped.
    Refuse,
    /// It is neither answered nor executed.
    Silent,
    /// In automatic it starts by itself (reported, unit B); elsewhere it is refused.
    Arm,
}

/// What an AddRCC that replaces the list in mid-motion does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplaceInMotion {
    /// Alarm 200; the arm stops.
    Alarm200,
    /// The arm goes over to the new list without a stop, where its first step is a move that can be gone to in mid-move;
    /// else it stops and goes on with the new list.
    TakeOver,
}

/// The mode after `actionStop`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopMode {
    /// 2: automatic, not running.
    Auto,
    /// 3: stop.
    Stop,
}

/// What the first press of the stop button does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopButton {
    /// The cycle is finished; a second press stops at once.
    FinishCycle,
    /// The arm stops at once.
    AtOnce,
}

/// What a curve (action 17) does that has no line (action 10) before it in its run of the remote list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoneCurve {
    /// Nothing: AddRCC is answered ok, the step counts as done, and the arm stays where it is.
    Skip,
    /// It moves the arm as any other curve.
    Run,
}

/// What AddRCC answers to a list in which a line (action 10) stands behind a path speed (action 51).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathSpeedAnswer {
    /// `ok`, as to any other list.
    Ok,
    /// `err`, although the list is taken and runs.
    Err,
}

/// When the signal of action 52 stops a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalStop {
    /// While the signal is there: a move that begins then stops at once.
    Level,
    /// When the signal comes during a move.
    Edge,
}

/// What an instruction without `oneshot` is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingOneshot {
    /// As with `oneshot` 0: it stays, and the list runs again and again.
    Keep,
    /// As with `oneshot` 1: it is removed once it has run.
    Remove,
}

/// What `actionSingleCycle` does while a program waits for remote commands and the list is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdleSingleCycle {
    /// Mode 9: the program waits for a list, runs it once, and ends with its pass.
    Wait,
    /// The program ends at once.
    End,
}
