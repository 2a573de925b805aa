//! A hall in a few numbers, and a reader that loses its connection wherever it hurts.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::follower::{Begin, Follower, Step, Top};
use super::numbers::Numbers;

const ROBOTS: [&str; 3] = ["a", "b", "c"];
const VALUES: usize = 3;

/// One robot: its numbers and its values.
#[derive(Clone, Debug)]
struct Robot {
    numbers: Numbers,
    values: [u64; VALUES],
}

#[derive(Debug, Default)]
struct Hall {
    epoch: u64,
    number: u64,
    removed: u64,
    /// All robots that ever were: a reader goes on with those of its pass, even if they are removed.
    all: Vec<Robot>,
    /// The place in `all` of each robot that is there.
    robots: BTreeMap<&'static str, usize>,
    /// Never used twice, so that an old value never looks like a new one.
    value: u64,
}

impl Hall {
    fn next(&mut self) -> u64 {
        self.number += 1;
        self.number
    }

    /// Adds a robot, or configures it anew: its values begin anew.
    fn add(&mut self, robot: &'static str) {
        let born = self.next();
        let values = [0; VALUES].map(|_| self.draw());
        let anew = Robot { numbers: Numbers::new(born, VALUES), values };
        match self.robots.get(robot) {
            Some(place) => self.all[*place] = anew,
            None => {
                self.robots.insert(robot, self.all.len());
                self.all.push(anew);
            }
        }
    }

    fn draw(&mut self) -> u64 {
        self.value += 1;
        self.value
    }

    fn change(&mut self, robot: &'static str, place: usize) {
        if !self.robots.contains_key(robot) {
            return;
        }
        let (number, value) = (self.next(), self.draw());
        let robot = &mut self.all[self.robots[robot]];
        robot.values[place] = value;
        robot.numbers.change(&[place], number);
    }

    fn remove(&mut self, robot: &'static str) {
        if self.robots.remove(robot).is_some() {
            self.removed = self.next();
        }
    }

    fn top(&self) -> Top {
        Top { number: self.number, removed: self.removed }
    }
}

#[derive(Clone, Debug)]
enum Message {
    Reset(Option<String>),
    Removed(String),
    Snapshot(String, u64, [u64; VALUES]),
    Change { robot: String, after: u64, number: u64, values: Vec<(usize, u64)> },
}

/// One connection, as the shell drives it: messages are made one at a time, and what happens between them is
/// not known to it.
#[derive(Debug)]
struct Connection {
    follower: Follower,
    /// Robots that the pass has not come to yet, and what is still to be said of those before.
    pass: Option<(u64, Vec<(&'static str, usize)>)>,
    waiting: Vec<Message>,
    followed: Vec<usize>,
}

impl Connection {
    fn new(begin: Begin, followed: &[usize]) -> Self {
        Self { follower: Follower::new(begin), pass: None, waiting: Vec::new(), followed: followed.to_vec() }
    }

    /// The next message, if this step makes one; at the end of a pass the number up to which everything was
    /// sent.
    fn next(&mut self, hall: &Hall) -> (Option<Message>, Option<u64>) {
        if !self.waiting.is_empty() {
            return (Some(self.waiting.remove(0)), None);
        }
        let Some((number, robots)) = &mut self.pass else {
            let there = hall.robots.iter().map(|(name, place)| (*name, *place)).collect();
            let (reset, gone) = self.follower.begin_pass(hall.top(), |robot| hall.robots.contains_key(robot));
            self.waiting.extend(reset.then_some(Message::Reset(None)));
            self.waiting.extend(gone.into_iter().map(Message::Removed));
            self.pass = Some((hall.number, there));
            return (None, None);
        };
        if robots.is_empty() {
            let number = *number;
            self.pass = None;
            self.follower.end_pass();
            return (None, Some(number));
        }
        let (name, place) = robots.remove(0);
        let robot = &hall.all[place];
        let at = robot.numbers.span();
        let step = self.follower.step(name, at);
        let own = name.to_owned();
        let message = match step {
            Step::Nothing => None,
            Step::Snapshot { reset } => {
                let snapshot = Message::Snapshot(own.clone(), at.number, robot.values);
                if reset {
                    self.waiting.push(snapshot);
                    Some(Message::Reset(Some(own)))
                } else {
                    Some(snapshot)
                }
            }
            Step::Changes { after } => {
                let changed = robot.numbers.since(after).filter(|place| self.followed.contains(place));
                let values: Vec<_> = changed.map(|place| (place, robot.values[place])).collect();
                let change = Message::Change { robot: own, after, number: at.number, values };
                matches!(&change, Message::Change { values, .. } if !values.is_empty()).then_some(change)
            }
        };
        self.follower.done(name, at, step, message.is_some());
        (message, None)
    }
}

/// What a client does that follows the documentation, and nothing more.
#[derive(Clone, Debug, Default)]
struct Client {
    epoch: u64,
    robots: BTreeMap<String, (u64, [u64; VALUES])>,
    /// Everything up to here has come.
    all: Option<u64>,
    /// The number that the client said when it came back.
    resumed: u64,
    resets: usize,
}

impl Client {
    fn take(&mut self, message: Message) {
        match message {
            Message::Reset(None) => {
                (self.all, self.resets) = (None, self.resets + 1);
                self.robots.clear();
            }
            Message::Reset(Some(robot)) => {
                self.robots.remove(&robot);
                self.resets += 1;
            }
            Message::Removed(robot) => {
                self.robots.remove(&robot);
            }
            Message::Snapshot(robot, number, values) => {
                self.robots.insert(robot, (number, values));
            }
            Message::Change { robot, after, number, values } => {
                let (mine, mut all) = self.robots[&robot];
                assert!(after <= mine.max(self.resumed), "{robot}: after {after}, and the client has {mine}");
                assert!(number > after);
                for (place, value) in values {
                    all[place] = value;
                }
                self.robots.insert(robot, (number, all));
            }
        }
    }

    fn take_all(&mut self, connection: &mut Connection, hall: &Hall, most: usize) {
        for _ in 0..most {
            let (message, end) = connection.next(hall);
            message.into_iter().for_each(|message| self.take(message));
            self.all = end.or(self.all);
        }
    }
}

#[derive(Clone, Debug)]
enum Act {
    Change(usize, usize),
    Add(usize),
    Remove(usize),
    /// The reader takes this many steps of its connection.
    Read(usize),
    /// The connection is lost, and the reader comes back with the last place, or with its numbers.
    Back {
        with_numbers: bool,
    },
    /// The gateway ends and starts again; the reader comes back.
    Restart {
        with_numbers: bool,
    },
    /// The reader comes back with a number that was never given out.
    Ahead {
        with_numbers: bool,
    },
}

fn act() -> impl Strategy<Value = Act> {
    let robot = || 0..ROBOTS.len();
    prop_oneof![
        8 => (robot(), 0..VALUES).prop_map(|(robot, place)| Act::Change(robot, place)),
        1 => robot().prop_map(Act::Add),
        1 => robot().prop_map(Act::Remove),
        6 => (1..8_usize).prop_map(Act::Read),
        2 => any::<bool>().prop_map(|with_numbers| Act::Back { with_numbers }),
        1 => any::<bool>().prop_map(|with_numbers| Act::Restart { with_numbers }),
        1 => any::<bool>().prop_map(|with_numbers| Act::Ahead { with_numbers }),
    ]
}

/// What the client sends back, and whether it is of this start of the gateway.
fn begin(client: &Client, hall: &Hall, with_numbers: bool, ahead: u64) -> Begin {
    if with_numbers {
        let numbers = client.robots.iter().map(|(robot, (number, _))| (robot.clone(), number + ahead));
        return if client.epoch == hall.epoch { Begin::Each(numbers.collect()) } else { Begin::Lost };
    }
    match client.all {
        None => Begin::New,
        Some(number) if client.epoch == hall.epoch => Begin::After(number + ahead),
        Some(_) => Begin::Lost,
    }
}

fn run(acts: Vec<Act>, followed: &[usize]) {
    let mut hall = Hall { epoch: 1, ..Hall::default() };
    hall.add("a");
    hall.add("b");
    let mut client = Client { epoch: 1, ..Client::default() };
    let mut connection = Connection::new(Begin::New, followed);
    for act in acts {
        let (with_numbers, ahead) = match act {
            Act::Change(robot, place) => {
                hall.change(ROBOTS[robot], place);
                continue;
            }
            Act::Add(robot) => {
                hall.add(ROBOTS[robot]);
                continue;
            }
            Act::Remove(robot) => {
                hall.remove(ROBOTS[robot]);
                continue;
            }
            Act::Read(most) => {
                client.take_all(&mut connection, &hall, most);
                continue;
            }
            Act::Back { with_numbers } => (with_numbers, 0),
            Act::Restart { with_numbers } => {
                let (epoch, value) = (hall.epoch + 1, hall.value);
                let robots: Vec<_> = hall.robots.keys().copied().collect();
                hall = Hall { epoch, value, ..Hall::default() };
                robots.into_iter().for_each(|robot| hall.add(robot));
                (with_numbers, 0)
            }
            Act::Ahead { with_numbers } => (with_numbers, 1_000_000),
        };
        let begin = begin(&client, &hall, with_numbers, ahead);
        // Robots that are there, and of which the client has more than there can be.
        let there = |robot: &String| hall.robots.contains_key(robot.as_str());
        let wrong = (ahead > 0 || begin == Begin::Lost)
            && match &begin {
                Begin::New => false,
                Begin::After(_) | Begin::Lost => true,
                Begin::Each(robots) => robots.keys().any(there),
            };
        // A client that begins anew throws away what it has.
        if begin == Begin::New {
            client.robots.clear();
        }
        client.resumed = if let Begin::After(number) = begin { number } else { 0 };
        client.epoch = hall.epoch;
        connection = Connection::new(begin, followed);
        if wrong {
            let before = client.resets;
            client.take_all(&mut connection, &hall, 20);
            assert!(client.resets > before, "what cannot be resumed is told");
        }
    }
    // Nothing changes any more. Two passes are enough: one may have been under way.
    client.take_all(&mut connection, &hall, 60);
    let mine: Vec<_> = client.robots.keys().map(String::as_str).collect();
    let there: Vec<_> = hall.robots.keys().copied().collect();
    assert_eq!(mine, there);
    for (name, at) in &hall.robots {
        for place in followed {
            assert_eq!(client.robots[*name].1[*place], hall.all[*at].values[*place], "{name} {place}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// Wherever a reader loses its connection and however it comes back, it ends with the values of the
    /// robots, no message leaves a gap, and what cannot be resumed is told.
    #[test]
    fn a_reader_that_comes_back_has_what_the_robots_have(acts in prop::collection::vec(act(), 0..80)) {
        run(acts, &[0, 1, 2]);
    }

    /// The same for a reader that follows some values.
    #[test]
    fn so_has_one_that_follows_some_values(acts in prop::collection::vec(act(), 0..80)) {
        run(acts, &[1]);
    }
}

#[test]
fn a_robot_that_goes_to_another_gateway_begins_anew_whatever_its_numbers_are() {
    let mut follower = Follower::new(Begin::New);
    let mut far = Numbers::new(5, 1);
    far.change(&[0], 11);
    let told = follower.step("press", far.span());
    assert_eq!(told, Step::Snapshot { reset: false });
    follower.done("press", far.span(), told, true);
    assert_eq!(follower.step("press", far.span()), Step::Nothing);
    // It was begun with here before the last change was told there.
    let mut here = Numbers::new(10, 1);
    assert_eq!(follower.step("press", here.span()), Step::Snapshot { reset: false });
    here.change(&[0], 12);
    assert_eq!(follower.step("press", here.span()), Step::Snapshot { reset: false });
}
