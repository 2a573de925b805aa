//! The value of each query address (manual 4.1.1 and later).

use std::cell::OnceCell;

use r6_proto::message::reading::Counter;
use r6_proto::message::{Header, TypeKey};
use r6_proto::reply::{DataWriter, ReplyWriter};
use r6_proto::value::Values;
use r6_proto::{AXES, Address, AxisIndex, Body, Decoder, Reading, RequestType};

use r6_motion::drive::torques;
use r6_motion::{Axes, AxisMotions};

use crate::io::Io;
use crate::machine::Machine;

/// Rated torque on the wire (manual 4.1.1 #16).
pub const RATED_TORQUE: f64 = 2580.0;

/// Answers the addresses of one query. It computes the position of the arm once, and only if an address needs
/// it.
pub(crate) struct Answers<'m> {
    machine: &'m Machine,
    place: OnceCell<(Axes, [f64; AXES])>,
    pose: OnceCell<[f64; 6]>,
}

impl<'m> Answers<'m> {
    pub fn of(machine: &'m Machine) -> Self {
        Self { machine, place: OnceCell::new(), pose: OnceCell::new() }
    }

    /// Appends the value of an address. Appends nothing if this firmware lacks the address; the values then
    /// no longer line up with the addresses (captured, unit C).
    pub fn append(&self, address: Address, data: &mut DataWriter<'_, '_>) {
        let machine = self.machine;
        if !machine.profile.answers(address) {
            return;
        }
        match address {
            Address::Version => data.text(&machine.profile.version),
            Address::CurMold => data.text(&machine.programs.mold),
            Address::CounterList => {
                let ids: Vec<String> = machine.counters.keys().map(u32::to_string).collect();
                data.texts(ids.iter().map(String::as_str));
            }
            Address::Counter(id) => {
                if let Some(counter) = machine.counters.get(&id) {
                    data.counter(&Counter {
                        id: i64::from(id),
                        target: counter.target,
                        current: counter.current,
                        name: data.names_counters().then(|| format!("counter{id}")),
                    });
                }
            }
            Address::CurMode => data.integer(machine.mode.number()),
            Address::BoardIoNum => data.integer(i64::from(machine.io_boards)),
            Address::Input(board) => data.integer(i64::from(Io::word(&machine.io.inputs, board))),
            Address::Output(board) => data.integer(i64::from(Io::word(&machine.io.outputs, board))),
            Address::M(board) => data.integer(i64::from(Io::word(&machine.io.m, board))),
            Address::AxisNum => data.integer(i64::try_from(machine.model.axis_count()).unwrap_or(0)),
            // No manual documents faxis. We take it as the filtered position; the planned motion is already
            // filtered.
            Address::Axis(axis) | Address::Faxis(axis) => data.decimal(self.axis_position(axis)),
            Address::World(component) => data.decimal(self.world_component(component)),
            Address::CurAlarm => data.integer(i64::from(machine.alarm)),
            Address::CurCycle => data.decimal(machine.cycle_time().as_secs_f64()),
            Address::LastCycle => data.decimal(machine.cycle.last.as_secs_f64()),
            Address::MachineName => data.text(&machine.machine_name),
            Address::CurTorque(axis) => data.integer(whole(self.torque(axis))),
            Address::CurSpeed(axis) => data.integer(whole(self.motor_speed(axis))),
            Address::CurAccount => data.text(&machine.account),
            Address::Origin => data.flag(machine.homed),
            Address::MoldList => data.texts(machine.programs.library.names()),
            Address::IsMoving => data.flag(machine.tells_moving()),
            Address::Addr(register) => {
                data.integer(machine.registers.values.get(&register).copied().unwrap_or(0))
            }
            Address::RemoteCmdLen => data.integer(i64::try_from(machine.list.len()).unwrap_or(i64::MAX)),
            Address::ToolCoord => {
                // No manual names a way to choose a collaborative dispatcher, so the answer is always 0.
                let (tool, bench) = (machine.frames.tool.to_string(), machine.frames.bench.to_string());
                data.texts([tool.as_str(), bench.as_str(), "0"]);
            }
            #[allow(unreachable_patterns, reason = "an address may have its row before it is played here")]
            _ => {}
        }
    }

    /// Axis positions and their speeds.
    fn place(&self) -> &(Axes, [f64; AXES]) {
        self.place.get_or_init(|| self.machine.axes_now())
    }

    /// Position of one axis, in degrees, or mm on a linear axis.
    fn axis_position(&self, axis: AxisIndex) -> f64 {
        at(self.place().0.degrees(), axis)
    }

    /// One component of `world-n`: X, Y, Z in mm, U, V, W in degrees, then the seventh and eighth axis.
    fn world_component(&self, component: AxisIndex) -> f64 {
        let (axes, _) = self.place();
        let pose = self.pose.get_or_init(|| self.machine.pose_of(axes).components());
        pose.get(component.index()).copied().unwrap_or_else(|| at(axes.degrees(), component))
    }

    /// Motor speed in RPM, from the axis speed and the gear ratio.
    fn motor_speed(&self, axis: AxisIndex) -> f64 {
        at(&self.machine.model.motor_rpm(&self.place().1), axis)
    }

    /// Torque in units of 1/2580 of the rated torque. While no program runs and nothing moves, the brakes
    /// hold the arm and the drives show 0 (idle `"0"` reported, unit A). That a running program at rest shows
    /// gravity is our choice.
    fn torque(&self, axis: AxisIndex) -> f64 {
        let machine = self.machine;
        if !machine.runs() && !machine.is_moving() {
            return 0.0;
        }
        let (axes, speeds) = *self.place();
        let accelerations = match machine.run_under_way() {
            Some(run) => run.movement.accelerations_at(run.seconds(machine.now)),
            None => [0.0; AXES],
        };
        let motion = AxisMotions { axes, speeds, accelerations };
        at(&torques(&machine.model, &motion), axis) * RATED_TORQUE
    }
}

/// The value of an address as a client reads it from the wire; `None` if this firmware lacks the address.
pub(crate) fn reading(machine: &Machine, address: Address) -> Option<Reading> {
    let mut frame = Vec::new();
    let header = Header { ds_id: None, type_key: TypeKey::ReqType, type_word: None, pack_id: None };
    let writer = ReplyWriter::new(machine.profile.dialect, header, RequestType::Query);
    writer.query(Values::EMPTY, &mut frame, |data| Answers::of(machine).append(address, data));
    let mut decoder = Decoder::new();
    let Body::QueryReply(reply) = decoder.decode(&frame).ok()?.body else { return None };
    Reading::of(address, reply.values.iter().next()?).ok()
}

fn at(values: &[f64; AXES], axis: AxisIndex) -> f64 {
    values.get(axis.index()).copied().unwrap_or(0.0)
}

fn whole(value: f64) -> i64 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a motor speed or torque, rounded; the cast saturates"
    )]
    let whole = value.round() as i64;
    whole
}
