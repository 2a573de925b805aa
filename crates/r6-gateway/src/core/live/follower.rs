//! What a reader has, and what it gets of each robot.

use std::collections::BTreeMap;

use super::numbers::Span;

/// What a reader says that it has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Begin {
    /// Nothing.
    New,
    /// Everything up to this number.
    After(u64),
    /// Each of these robots up to its number.
    Each(BTreeMap<String, u64>),
    /// Something of another start of the gateway, or of no start at all.
    Lost,
}

/// How far the numbers have come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Top {
    /// The last number that was given out.
    pub number: u64,
    /// The number of the last removal of a robot; 0 if there was none.
    pub removed: u64,
}

/// What a reader gets of one robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing: it has everything.
    Nothing,
    /// All values, in place of what it has of this robot.
    Snapshot {
        /// Whether it is told before that it may have missed something.
        reset: bool,
    },
    /// The values that changed after this number.
    Changes {
        /// The number.
        after: u64,
    },
}

/// One reader. It goes through all robots in passes: [`Self::begin_pass`], [`Self::step`] for each robot,
/// [`Self::end_pass`].
#[derive(Clone, Debug)]
pub struct Follower {
    /// At most as many as there are robots, and as the reader named.
    known: BTreeMap<String, Known>,
    /// In the first pass: robots without an entry are known up to this number.
    all_after: Option<u64>,
    /// What the reader has, until the first pass.
    begin: Option<Begin>,
}

#[derive(Clone, Copy, Debug)]
struct Known {
    /// The number with which the values began that it has; `None` if the reader itself named them. A robot
    /// that goes to another gateway begins anew, with numbers that may be among those that the reader has.
    born: Option<u64>,
    /// The number of the last message.
    told: u64,
    /// The number up to which there was nothing else that the reader follows.
    looked: u64,
    /// Whether the reader itself said so, and nothing was sent yet.
    resumed: bool,
}

impl Follower {
    /// A reader that has this.
    #[must_use]
    pub fn new(begin: Begin) -> Self {
        Self { known: BTreeMap::new(), all_after: None, begin: Some(begin) }
    }

    /// Begins a pass. `top` and the robots that are there have to be of the same moment. Returns whether the
    /// reader has to be told that it begins anew with all robots, and the robots that it has and that are not
    /// there any more.
    pub fn begin_pass(&mut self, top: Top, is_there: impl Fn(&str) -> bool) -> (bool, Vec<String>) {
        let reset = match self.begin.take() {
            None | Some(Begin::New) => false,
            Some(Begin::Lost) => true,
            // Which robots were removed meanwhile is not kept, so the reader begins anew.
            Some(Begin::After(number)) if number > top.number || top.removed > number => true,
            Some(Begin::After(number)) => {
                self.all_after = Some(number);
                false
            }
            Some(Begin::Each(robots)) => {
                let known = |told| Known { born: None, told, looked: told, resumed: true };
                self.known = robots.into_iter().map(|(robot, told)| (robot, known(told))).collect();
                false
            }
        };
        let gone: Vec<_> = self.known.keys().filter(|robot| !is_there(robot)).cloned().collect();
        self.known.retain(|robot, _| is_there(robot));
        (reset, gone)
    }

    /// What the reader gets of this robot, whose numbers are these.
    pub fn step(&self, robot: &str, at: Span) -> Step {
        let known = self.known.get(robot);
        let (told, looked, resumed) = match (known, self.all_after) {
            (Some(known), _) => (known.told, known.looked, known.resumed),
            (None, Some(number)) if number < at.born => return Step::Snapshot { reset: true },
            (None, Some(number)) => (number.min(at.number), number.min(at.number), false),
            (None, None) => return Step::Snapshot { reset: false },
        };
        let is_other = known.and_then(|known| known.born).is_some_and(|born| born != at.born);
        if is_other || told < at.born || told > at.number {
            return Step::Snapshot { reset: resumed };
        }
        if looked >= at.number { Step::Nothing } else { Step::Changes { after: told } }
    }

    /// Notes what became of a step: the reader has, or follows, nothing else up to the number of the robot.
    /// `sent`: whether a message was made of it.
    pub fn done(&mut self, robot: &str, at: Span, step: Step, sent: bool) {
        let told = match step {
            Step::Snapshot { .. } => at.number,
            Step::Changes { .. } if sent => at.number,
            Step::Changes { after } => after,
            Step::Nothing => {
                let known = self.known.get(robot).map(|known| known.told);
                known.or(self.all_after).map_or(at.number, |told| told.min(at.number))
            }
        };
        let known = Known { born: Some(at.born), told, looked: at.number, resumed: false };
        self.known.insert(robot.to_owned(), known);
    }

    /// Ends a pass through all robots. Robots without an entry are new from now on.
    pub fn end_pass(&mut self) {
        self.all_after = None;
    }
}
