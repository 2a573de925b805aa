//! `Plot`: the picture of a motion that was played on a virtual controller.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_client::units::AxisCoordinate;
use r6_controller::ControllerSettings;
use r6_plot::play::{self, Cell, Limits};
use r6_plot::{Picture, PlayError, words};
use r6_proto::AxisIndex;

use crate::interpreter;
use crate::pickling::not_pickled;
use crate::raising::Raise;
use crate::simulator::{Source, model_of, profile_of};
use crate::units::{AxisPosition, Given, Percent};

/// The arm and the firmware that are played unless others are given.
const MODEL: &str = "BRTIRUS0707A";
const PROFILE: &str = "hc1";

/// The lowest global speed, percent. A controller at 0 never begins to move.
const LOWEST_GLOBAL_SPEED: f64 = 0.1;

/// What a motion does: axis positions, axis speeds and outputs over time, and the path of the tool. A
/// notebook shows it as a picture.
///
/// ::
///
///     plot = r6.Program.load("square.toml").plot()
///     plot.save("square.svg")
///     assert plot.trouble is None
#[pyclass(frozen, module = "r6._r6")]
pub struct Plot {
    svg: String,
    duration: f64,
    trouble: Option<String>,
}

/// The keywords of `plot`.
pub struct Keywords<'a, 'py> {
    pub model: Option<&'a Bound<'py, PyAny>>,
    pub profile: Option<&'a Bound<'py, PyAny>>,
    pub global_speed: Option<Given<Percent>>,
    pub start: Option<Given<AxisPosition>>,
}

impl Keywords<'_, '_> {
    /// The conditions in which the motion is played.
    fn cell(&self, py: Python<'_>) -> PyResult<Cell> {
        let source = |given: Option<&Bound<'_, PyAny>>, usual: &str| {
            given.map_or_else(|| Ok(Source::Name(usual.to_owned())), Source::of)
        };
        let model = model_of(py, source(self.model, MODEL)?)?;
        let profile = profile_of(py, source(self.profile, PROFILE)?)?;
        let global_speed = self.global_speed.as_ref().map_or(100.0, |speed| speed.0.value());
        if global_speed < LOWEST_GLOBAL_SPEED {
            let what = format!("global_speed is at least {LOWEST_GLOBAL_SPEED} percent");
            return Err(PyValueError::new_err(what));
        }
        let from = self.start.as_ref().map_or_else(Vec::new, |start| {
            let at = |axis| {
                start.0.at(axis).map_or(0.0, |to| match to {
                    AxisCoordinate::Degrees(angle) => angle.value(),
                    AxisCoordinate::Millimetres(length) => length.value(),
                })
            };
            AxisIndex::ALL.into_iter().map(at).collect()
        });
        let (given, beyond) = from.split_at(model.axis_count().min(from.len()));
        if beyond.iter().any(|axis| *axis != 0.0) {
            let what = format!("start names an axis that {} does not have", model.name);
            return Err(PyValueError::new_err(what));
        }
        let from = given.to_vec();
        let settings = ControllerSettings { global_speed, ..ControllerSettings::new(profile, model) };
        Ok(Cell { settings, from, inputs: Vec::new(), limits: Limits::default() })
    }
}

/// Plays a motion and draws it. `name` is what its title calls it.
pub fn plotted(
    py: Python<'_>,
    motion: &r6_client::Motion,
    append: bool,
    name: &str,
    keywords: &Keywords<'_, '_>,
) -> PyResult<Plot> {
    let cell = keywords.cell(py)?;
    let drawn = interpreter::released(py, || {
        let ControllerSettings { model, profile, global_speed, .. } = cell.settings.clone();
        let recording = play::motion(cell, motion, append, &mut |_| ())?;
        let trouble = words::trouble(&recording);
        let summary = words::summary(&recording);
        let svg = r6_plot::svg(&Picture {
            title: &format!("{name} on {}", model.name),
            subtitle: &format!("{summary}; profile {}, global speed {global_speed} %", profile.name),
            trouble: trouble.as_deref(),
            model: &model,
            recording: &recording,
        });
        Ok(Plot { svg, duration: recording.duration, trouble })
    })
    .0;
    drawn.map_err(|error| match error {
        PlayError::Step(error) => error.exception(py),
        other => PyValueError::new_err(other.to_string()),
    })
}

#[pymethods]
impl Plot {
    /// The picture as SVG. The same motion gives the same text.
    #[getter]
    fn svg(&self) -> &str {
        &self.svg
    }

    /// How long the motion takes, seconds.
    #[getter]
    fn duration(&self) -> f64 {
        self.duration
    }

    /// Why the motion does not get to its end: an alarm, or a wait that never ends; ``None`` if it does.
    #[getter]
    fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref()
    }

    /// Shows the picture in a notebook.
    #[pyo3(name = "_repr_svg_")]
    fn repr_svg(&self) -> &str {
        &self.svg
    }

    /// Writes the picture to a file. It replaces an existing file. Errors: ``OSError``.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        Ok(interpreter::released(py, || std::fs::write(path, &self.svg)).0?)
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(not_pickled("Plot"))
    }

    fn __repr__(&self) -> String {
        let trouble = self.trouble.as_ref().map(|trouble| format!(": {trouble}")).unwrap_or_default();
        format!("<Plot of {:.3} s{trouble}>", self.duration)
    }
}
