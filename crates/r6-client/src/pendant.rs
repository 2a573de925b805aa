//! What the pendant has, in its words: the start button, points by their names, the pose.

use r6_proto::Address;
use r6_proto::axis::AxisIndex;
use r6_proto::error::EncodeError;
use r6_proto::io_point::IoPoint;
use r6_proto::message::{Command, Reading};

use crate::error::{Invalid, RequestError};
use crate::job::Accepted;
use crate::robot::Robot;
use crate::units::{Degrees, Millimetres, Pose};

/// The components of a pose: X, Y, Z, U, V, W.
const COMPONENTS: usize = 6;

/// A point that no command sets.
const NO_OUTPUT: EncodeError = EncodeError {
    field: "point",
    wanted: "an output that the command reaches: Y of boards 0 to 3, M of boards 0 to 2, or EUY",
    nearest: None,
};

/// A point that no query address tells.
const NO_WORD: EncodeError = EncodeError {
    field: "point",
    wanted: "an input X, an output Y or an M point: no query address tells EU points",
    nearest: None,
};

impl Robot {
    /// Presses start (`startButton`): the program runs, and the arm may move. The controller says ok before
    /// anything runs.
    ///
    /// # Errors
    /// [`RequestError`]. The client never sends it twice.
    pub async fn start(&self) -> Result<Accepted, RequestError> {
        self.command(Command::StartButton).await
    }

    /// Sets an output by its name on the pendant (`modifyOutput`): Y on boards 0 to 3, M on boards 0 to 2,
    /// and EUY. A cell may start a motion by it.
    ///
    /// ```no_run
    /// # async fn set(robot: r6_client::Robot) -> Result<(), Box<dyn std::error::Error>> {
    /// robot.set_output("Y010".parse()?, true).await?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`RequestError::Invalid`] for a point that the command cannot set; [`RequestError`].
    pub async fn set_output(&self, point: IoPoint, on: bool) -> Result<Accepted, RequestError> {
        let (board, point) = point.for_command().ok_or(Invalid::Value(NO_OUTPUT))?;
        self.command(Command::ModifyOutput { board, point, on }).await
    }

    /// Whether an input X, an output Y or an M point is on; `None` if the controller does not tell.
    ///
    /// # Errors
    /// [`RequestError::Invalid`] for EU points, which no query address tells; [`RequestError`].
    pub async fn is_on(&self, point: IoPoint) -> Result<Option<bool>, RequestError> {
        let address = point.address().ok_or(Invalid::Value(NO_WORD))?;
        let result = self.query(&[address]).await?;
        let Some(Reading::Word(word)) = result.reading(address) else { return Ok(None) };
        Ok(Some(word >> point.point & 1 == 1))
    }

    /// Reads the pose of the tool in use, in the work frame in use (`world-0` to `world-5`). `None` if the
    /// controller does not tell all six values.
    ///
    /// # Errors
    /// [`RequestError`].
    pub async fn pose(&self) -> Result<Option<Pose>, RequestError> {
        let components: Vec<_> = AxisIndex::ALL.into_iter().take(COMPONENTS).map(Address::World).collect();
        let result = self.query(&components).await?;
        let values: Option<Vec<f64>> =
            components.iter().map(|component| result.decimal(*component)).collect();
        Ok(match values.as_deref() {
            Some([x, y, z, u, v, w]) => {
                Some(Pose::new([*x, *y, *z].map(Millimetres), [*u, *v, *w].map(Degrees)))
            }
            Some(_) | None => None,
        })
    }
}
