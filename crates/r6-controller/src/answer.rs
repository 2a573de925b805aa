//! The value of each query address (manual 4.1.1 and later).

use r6_proto::message::reading::Counter;
use r6_proto::reply::DataWriter;
use r6_proto::{AXES, Address, AxisIndex};

use r6_motion::drive::torques;
use r6_motion::{AxisMotions, MotionState};

use crate::io::Io;
use crate::machine::Machine;

/// Rated torque on the wire (manual 4.1.1 #16).
pub const RATED_TORQUE: f64 = 2580.0;

impl Machine {
    /// Appends the value of an address; nothing where this firmware has none, so that the values no longer line up
    /// with the addresses (captured, unit C).
    pub(crate) fn answer(&self, address: Address, data: &mut DataWriter<'_, '_>) {
        if !self.profile.answers(address) {
            return;
        }
        match address {
            Address::Version => data.text(&self.profile.version),
            Address::CurMold => data.text(&self.mold),
            Address::CounterList => {
                let ids: Vec<String> = self.counters.keys().map(u32::to_string).collect();
                data.texts(ids.iter().map(String::as_str));
            }
            Address::Counter(id) => {
                if let Some(counter) = self.counters.get(&id) {
                    data.counter(&Counter {
                        id: i64::from(id),
                        target: counter.target,
                        current: counter.current,
                        name: Some(format!("counter{id}")),
                    });
                }
            }
            Address::CurMode => data.integer(self.mode.number()),
            Address::BoardIoNum => data.integer(i64::from(self.io_boards)),
            Address::Input(board) => data.integer(i64::from(Io::word(&self.io.inputs, board))),
            Address::Output(board) => data.integer(i64::from(Io::word(&self.io.outputs, board))),
            Address::M(board) => data.integer(i64::from(Io::word(&self.io.m, board))),
            Address::AxisNum => data.integer(i64::try_from(self.model.axis_count()).unwrap_or(0)),
            // Nobody documents faxis: taken as the filtered position, and the planned motion is filtered already.
            Address::Axis(axis) | Address::Faxis(axis) => data.decimal(self.axis_position(axis)),
            Address::World(component) => data.decimal(self.world_component(component)),
            Address::CurAlarm => data.integer(i64::from(self.alarm)),
            Address::CurCycle => data.decimal(self.cycle_time().as_secs_f64()),
            Address::LastCycle => data.decimal(self.last_cycle.as_secs_f64()),
            Address::MachineName => data.text(&self.machine_name),
            Address::CurTorque(axis) => data.integer(whole(self.torque(axis))),
            Address::CurSpeed(axis) => data.integer(whole(self.motor_speed(axis))),
            Address::CurAccount => data.text(&self.account),
            Address::Origin => data.flag(self.homed),
            Address::MoldList => data.texts(self.library.names()),
            Address::IsMoving => data.flag(self.is_moving()),
            Address::Addr(register) => data.integer(self.registers.get(&register).copied().unwrap_or(0)),
            Address::RemoteCmdLen => data.integer(i64::try_from(self.list.len()).unwrap_or(i64::MAX)),
            Address::ToolCoord => {
                // A collaborative desk cannot be chosen by anything that a manual knows: none.
                let (tool, bench) = (self.tool.to_string(), self.bench.to_string());
                data.texts([tool.as_str(), bench.as_str(), "0"]);
            }
        }
    }

    /// Degrees, or mm on a linear axis.
    fn axis_position(&self, axis: AxisIndex) -> f64 {
        at(self.motion().axes.degrees(), axis)
    }

    /// X, Y, Z in mm, U, V, W in degrees, then the seventh and eighth axis.
    fn world_component(&self, component: AxisIndex) -> f64 {
        let motion = self.motion();
        let pose = self.pose_of(&motion.axes).components();
        pose.get(component.index()).copied().unwrap_or_else(|| at(motion.axes.degrees(), component))
    }

    /// RPM of the motor, from the axis speed and the gear ratio.
    fn motor_speed(&self, axis: AxisIndex) -> f64 {
        at(&self.model.motor_rpm(&self.motion().axis_speeds), axis)
    }

    /// In units of 1/2580 of the rated torque. While no program runs and nothing moves the brakes hold the arm, and the
    /// drives show 0 (idle `"0"` reported, unit A; that a running program at rest shows gravity is chosen).
    fn torque(&self, axis: AxisIndex) -> f64 {
        if !self.runs() && !self.is_moving() {
            return 0.0;
        }
        let MotionState { axes, axis_speeds: speeds, .. } = self.motion();
        let accelerations = match self.run_under_way() {
            Some(run) => run.movement.accelerations_at(run.seconds(self.now)),
            None => [0.0; AXES],
        };
        let motion = AxisMotions { axes, speeds, accelerations };
        at(&torques(&self.model, &motion), axis) * RATED_TORQUE
    }
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
