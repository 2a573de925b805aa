//! The alternatives that a profile chooses from.

/// What AddRCC does while no program waits for remote commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unarmed {
    /// It is answered with `err` and dropped.
    Refuse,
    /// It is neither answered nor executed.
    Silent,
    /// In automatic AddRCC starts the program (reported, unit B); in other modes it is refused.
    Arm,
}

/// What an AddRCC does that replaces the list in mid-motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplaceInMotion {
    /// It raises alarm 200, and the arm stops.
    Alarm200,
    /// The arm goes over to the new list without a stop, if its first step is a move that can be reached in
    /// mid-move. Otherwise the arm stops and continues with the new list.
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

/// What a curve (action 17) does without a line (action 10) before it in its run of the remote list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoneCurve {
    /// Nothing: AddRCC is answered ok, the step counts as done, and the arm stays where it is.
    Skip,
    /// It moves the arm like any other curve.
    Run,
}

/// The answer to an AddRCC list with a line (action 10) after a path speed (action 51).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathSpeedAnswer {
    /// `ok`, as for any other list.
    Ok,
    /// `err`, although the list is taken and executed.
    Err,
}

/// When the signal of action 52 stops a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalStop {
    /// While the signal has the level: a move that begins then stops at once.
    Level,
    /// When the signal changes to the level during a move.
    Edge,
}

/// What an instruction without `oneshot` means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingOneshot {
    /// Like `oneshot` 0: it stays, and the list runs again and again.
    Keep,
    /// Like `oneshot` 1: it is removed after it has run.
    Remove,
}

/// What `actionSingleCycle` does while a program waits for remote commands and the list is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdleSingleCycle {
    /// In mode 9 the program waits for a list, runs it once, and ends with its pass.
    Wait,
    /// The program ends at once.
    End,
}
