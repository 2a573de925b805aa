//! Programs: their check, their plan, and those that the gateway keeps.

use serde::{Deserialize, Serialize};

use super::Signal;

/// The text of a program to check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ProgramText {
    /// What a file of `r6 run` or a taught program has in it, TOML or JSON.
    pub program: String,
}

/// Which kind of program a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ProgramType {
    /// Instructions that a PC sends: `[[instruction]]` tables or AddRCC frames.
    Instructions,
    /// A taught program, which runs on a controller: `[[step]]` tables.
    Taught,
    /// Neither of them.
    Neither,
}

impl ProgramType {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Instructions, Self::Taught, Self::Neither];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Instructions => "instructions",
            Self::Taught => "taught",
            Self::Neither => "neither",
        }
    }

    /// The kind with this word.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.word() == word)
    }
}

/// Where a step can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum StepRuns {
    /// It can be sent to an arm over the wire.
    Sent,
    /// Only a controller runs it, in a taught program.
    OnController,
}

/// One step of a program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ProgramStep {
    /// Its number, from 1.
    pub number: usize,
    /// Its line, from 1; `null` in an AddRCC frame.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub line: Option<usize>,
    /// Its `do`; `null` if there is no such word.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "axis-move"))]
    pub r#do: Option<String>,
    /// Where it can run; `null` if it has a mistake.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub runs: Option<StepRuns>,
}

/// A mistake of a program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ProgramProblem {
    /// Its line, from 1; `null` if it is about the whole program.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub line: Option<usize>,
    /// Its column in characters, from 1; `null` if it is about the whole program.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub column: Option<usize>,
    /// What is wrong.
    pub message: String,
    /// How to correct it.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub advice: Option<String>,
}

/// What a check found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ProgramChecked {
    /// Whether there is no mistake.
    pub ok: bool,
    /// Which kind of program it is.
    pub kind: ProgramType,
    /// Its steps, also those with a mistake. Empty for AddRCC frames with a mistake.
    pub steps: Vec<ProgramStep>,
    /// The mistakes in the order of their places, the first 20.
    pub problems: Vec<ProgramProblem>,
    /// How many mistakes there are besides.
    pub more_problems: usize,
    /// Hints: old spellings, unknown keys of frames.
    pub remarks: Vec<String>,
}

/// A program to plan. Give either a model or a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PlanRequest {
    /// What a file of `r6 run` or a taught program has in it, TOML or JSON.
    pub program: String,
    /// The model of the arm, one of `r6 plot --help`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(example = "BRTIRUS0707A"))]
    pub model: Option<String>,
    /// The robot whose model it is. The plan begins where its axes stand now, unless `from` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(example = "press-4"))]
    pub robot: Option<String>,
    /// Where the axes stand at the beginning, J1 first, degrees or mm; 0 for those that are missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_items = 6))]
    pub from: Option<Vec<f64>>,
    /// The global speed in percent, above 0 to 100; 100 if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(maximum = 100))]
    pub global_speed_percent: Option<f64>,
    /// The time between two samples of a moving arm, 2 to 10 000 ms; 20 if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 2, maximum = 10_000, example = 20))]
    pub sample_ms: Option<u32>,
}

/// What the arm would do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ProgramPlan {
    /// The model of the arm.
    pub model: String,
    /// Which kind of program it is. Of a taught program, one pass was played.
    pub kind: ProgramType,
    /// How it ended.
    pub ended: PlanEnd,
    /// How long it takes, or took until it ended early.
    pub duration_ms: f64,
    /// The length of the tool's path.
    pub tool_path_mm: f64,
    /// What each axis does, J1 first.
    pub axes: Vec<PlannedAxis>,
    /// When each step ran, in the order in which they began. Steps of a taught program that take no time are
    /// missing.
    pub steps: Vec<PlannedStep>,
    /// Why it does not run to its end: limits, singularities, waits. The plan ends at the first.
    pub problems: Vec<PlanProblem>,
    /// The time between two samples of a moving arm: longer than asked for, if there would be more than 5000.
    pub sample_ms: f64,
    /// The arm over time. While it rests there are no samples.
    pub samples: Vec<PlanSample>,
    /// Hints about the program.
    pub remarks: Vec<String>,
}

/// How a plan ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PlanEnd {
    /// The program runs to its end. A list that repeats was played once.
    Done,
    /// An alarm ends it.
    Alarm,
    /// It waits for a signal that nothing sets.
    Waiting,
    /// It is longer than an hour.
    TooLong,
    /// One pass does not come to its end.
    Endless,
}

/// What one axis does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlannedAxis {
    /// `J1` to `J6`.
    #[cfg_attr(feature = "openapi", schema(example = "J1"))]
    pub name: String,
    /// `deg` or `mm`.
    #[cfg_attr(feature = "openapi", schema(example = "deg"))]
    pub unit: String,
    /// The smallest position.
    pub lowest: f64,
    /// The largest position.
    pub highest: f64,
    /// The soft limits of the model.
    pub limits: [f64; 2],
    /// Its highest speed, per second.
    pub top_speed: f64,
    /// Its full speed, per second.
    pub full_speed: f64,
}

/// When a step ran.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlannedStep {
    /// Its number, from 1.
    pub number: usize,
    /// What it does, in English.
    pub text: String,
    /// When it began. A blended move has begun in the corner before that.
    pub begin_ms: f64,
    /// When it was done; `null` if it never was.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub end_ms: Option<f64>,
}

/// Why a plan does not run to its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlanProblem {
    /// What kind of problem it is.
    pub kind: PlanProblemType,
    /// The number of its step, from 1; `null` if that is not known.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub step: Option<usize>,
    /// When.
    pub at_ms: f64,
    /// The axis, for a limit and a singularity.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "J5"))]
    pub axis: Option<String>,
    /// The alarm that the controller raises; `null` if it raises none.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub alarm: Option<u32>,
    /// What is wrong, for people.
    pub message: String,
}

/// What kind of problem a plan has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PlanProblemType {
    /// An axis would leave its soft limits.
    Limit,
    /// No position of the axes puts the tool there.
    OutOfReach,
    /// An axis would have to turn faster than it can: a singularity.
    Singular,
    /// Another alarm.
    Alarm,
    /// It waits for a signal that nothing sets.
    Waiting,
    /// It is too long, or does not end.
    NoEnd,
    /// The controller passes over a step: a curve wants another move before it in the same list.
    PassedOver,
}

/// The arm at one instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlanSample {
    /// The time since the beginning.
    pub time_ms: f64,
    /// The axes, J1 first, degrees or mm.
    pub axes: Vec<f64>,
    /// The speeds of the axes, per second.
    pub axis_speeds: Vec<f64>,
    /// X, Y, Z in mm and U, V, W in degrees, of the tool in use in the work frame in use.
    pub pose: [f64; 6],
    /// The speed of the tool along its path, mm per second.
    pub tool_speed: f64,
}

/// A program to keep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ProgramWanted {
    /// Its text. It may have mistakes.
    pub program: String,
}

/// All programs that the gateway keeps.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Programs {
    /// The latest version of each, in the order of their names.
    pub programs: Vec<ProgramVersion>,
}

/// The versions of a program that the gateway keeps.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ProgramVersions {
    /// The latest first.
    pub versions: Vec<ProgramVersion>,
}

/// One version of a program, without its text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ProgramVersion {
    /// The name of the program.
    #[cfg_attr(feature = "openapi", schema(example = "pick"))]
    pub name: String,
    /// The number of the version, from 1.
    pub version: u64,
    /// What `If-Match` takes to change or remove this version.
    #[cfg_attr(feature = "openapi", schema(example = "\"3-9f86d081884c7d65\""))]
    pub etag: String,
    /// SHA-256 of its text, in hexadecimal digits. A program that was removed and stored again counts its
    /// versions anew: this tells one text from another, and a run takes it.
    pub sha256: String,
    /// When it was stored.
    pub stored_at: String,
    /// Who stored it: the token, its number and name.
    pub stored_by: String,
    /// How long its text is.
    pub bytes: u64,
    /// Which kind of program it is.
    pub kind: ProgramType,
    /// Whether it had no mistake when it was stored.
    pub ok: bool,
    /// How many steps it has.
    pub steps: u64,
}

/// A program that the gateway keeps.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredProgram {
    /// The version.
    #[serde(flatten)]
    pub version: ProgramVersion,
    /// Its text.
    pub program: String,
}

/// Values that were asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Queried {
    /// The values in the order asked, each address once. `none` is the quality of an address without a value.
    pub signals: Vec<Signal>,
    /// Why an address has no value.
    pub problems: Vec<QueryProblem>,
}

/// Why an address has no value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct QueryProblem {
    /// The query address.
    #[cfg_attr(feature = "openapi", schema(example = "curMold"))]
    pub address: String,
    /// Why, for people.
    pub reason: String,
}
