//! The file of `r6 up --cell`: virtual robots, what happens to them, and the shifts of their hall.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use r6_controller::program::MAX_TEXT_BYTES;
use r6_controller::settings::REMOTE_MOLD;
use r6_controller::{Library, Program, RobotModel, Scenario, StartState};
use r6_controller::{LibraryError, Profile};
use r6_gateway::{Hall, RobotConfig, RobotName};
use r6_program::form::{self, Fields, Found, Node, Table, Wrong};
use r6_program::{Mistake, Mistakes, MotionProgram};
use r6_sim::SimSettings;

use crate::cmd::gateway::config;
use crate::cmd::gateway::twins::SUFFIX;
use crate::cmd::sim::given;
use crate::exit::Failure;
use crate::{robot, text_file};

/// The longest file: a hundred robots with forty entries each.
const MAX_FILE_BYTES: usize = 1024 * 1024;

/// The most robots. Each has a twin beside it, in one process.
const MAX_ROBOTS: usize = 100;

/// The most programs for the library of the gateway: they are checked and stored before the first line.
const MAX_LIBRARY: usize = 100;

/// The programs that a robot starts with, if the file names none.
const USUAL_PROGRAMS: [&str; 1] = [REMOTE_MOLD];

const PROGRAMS: &str =
    "programs in brackets, built-in ones and files beside this file, such as [\"press.toml\", \"remote\"]";

/// What the file says.
#[derive(Debug)]
pub struct HallFile {
    /// `[[robot]]`.
    pub robots: Vec<HallRobot>,
    /// `[hall]` and `[[shift]]`, if there is any.
    pub hall: Option<Hall>,
    /// `library`: the names and texts of programs that the gateway keeps.
    pub library: Vec<(String, String)>,
}

/// One robot of the file.
#[derive(Debug)]
pub struct HallRobot {
    /// How the gateway reads it. Its address is known once it runs.
    pub config: RobotConfig,
    /// The virtual controller.
    pub settings: SimSettings,
}

/// Reads the file.
///
/// # Errors
/// It cannot be read, or it or a file of a program in it has mistakes. All are told.
pub fn read(path: &Path) -> Result<HallFile, Failure> {
    let name = path.display().to_string();
    let text = text_file::read(path, "a file of a hall", MAX_FILE_BYTES)
        .map_err(|error| Failure::usage(format!("{name}: {error}")))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = |name: &str| text_file::read(&folder.join(name), "a program", MAX_TEXT_BYTES);
    parse(&text, &beside).map_err(|mistakes| Failure::in_file(&name, &mistakes))
}

/// Reads the text. `beside` reads the file of a program.
fn parse(text: &str, beside: &dyn Fn(&str) -> Result<String, String>) -> Result<HallFile, Mistakes> {
    let (document, mut found) = form::parse(text);
    let top = Fields::of(&document, &[], "");
    let seed = top.whole("seed", i64::MAX).and_then(|seed| u64::try_from(seed).ok()).unwrap_or_default();
    let hall = top.optional("hall", "a table: [hall]", Node::table);
    let hall = config::hall_and_shifts(hall, &top.tables("shift"), &mut found);
    let library = library(&top, beside);
    let tables = top.tables("robot");
    if tables.is_empty() && !top.has("robot") {
        found.note("there is no [[robot]]: a hall has one or more".into());
    }
    if tables.len() > MAX_ROBOTS {
        found.note(format!("there are {} robots; {MAX_ROBOTS} are possible", tables.len()).into());
    }
    let mut reader = Reader { beside, programs: BTreeMap::new(), names: Vec::new(), robots: Vec::new() };
    for (number, table) in (0..).zip(tables.into_iter().take(MAX_ROBOTS)) {
        reader.robot(table, number, seed, &mut found);
    }
    top.finish(Ok(()), &mut found);
    found.finish(Some(HallFile { robots: reader.robots, hall, library }))
}

/// Reads the programs for the library of the gateway. Their names are those of the files, without the ending.
fn library(top: &Fields<'_>, beside: &dyn Fn(&str) -> Result<String, String>) -> Vec<(String, String)> {
    let wanted = format!("at most {MAX_LIBRARY} files of `r6 run` in brackets, such as [\"square.toml\"]");
    let named = top.optional("library", &wanted, |value| {
        let names = value.list()?.iter().map(Node::text).collect::<Option<Vec<_>>>()?;
        Some(names).filter(|names| names.len() <= MAX_LIBRARY)
    });
    let mut library: Vec<(String, String)> = Vec::new();
    for name in named.unwrap_or_default() {
        let stem = Path::new(name).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default().to_owned();
        let is_name = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"-_".contains(&byte);
        if stem.is_empty() || stem.len() > 64 || !stem.bytes().all(is_name) {
            let what = format!("{name}: its name has to be 1 to 64 characters of a to z, digits, - and _");
            top.wrong("library", what);
        }
        if library.iter().any(|(known, _)| *known == stem) {
            top.wrong("library", format!("two programs are called `{stem}`"));
        }
        match beside(name) {
            Err(why) => drop(top.wrong("library", format!("{name}: {why}"))),
            Ok(text) => {
                if let Err(mistakes) = MotionProgram::read(&text) {
                    for line in told(name, &mistakes) {
                        top.wrong("library", line);
                    }
                }
                library.push((stem, text));
            }
        }
    }
    library
}

/// A line for each mistake of another file, with the advice.
fn told(name: &str, mistakes: &Mistakes) -> Vec<String> {
    let line = |mistake: &Mistake| {
        let advice = mistake.advice.as_ref().map(|advice| format!("; {advice}")).unwrap_or_default();
        format!("{}{advice}", mistake.line(name))
    };
    mistakes.iter().map(line).collect()
}

/// Reads one robot after another.
struct Reader<'a> {
    beside: &'a dyn Fn(&str) -> Result<String, String>,
    /// The files of programs so far; `None` for one with mistakes, which were told.
    programs: BTreeMap<String, Option<Program>>,
    /// The names so far, also of robots with mistakes.
    names: Vec<RobotName>,
    robots: Vec<HallRobot>,
}

impl Reader<'_> {
    fn robot(&mut self, table: &Table, number: u64, seed: u64, found: &mut Found<'_>) {
        let name = table.value("name").and_then(Node::text).and_then(RobotName::new);
        let named = name.as_ref().map(|name| format!(" ({name})")).unwrap_or_default();
        let label = format!("[[robot]] {}{named}: ", number + 1);
        let fields = Fields::of(table, &[], label.clone());
        let scenario = Scenario::of_table(&fields, &label, found);
        let groups = config::groups(&fields, &label, found);
        let read = self.fields(&fields).map(|robot| {
            // Each robot draws its own numbers from the seed of the hall.
            let seed = seed.wrapping_add(number);
            let scenario = Some(Arc::new(scenario));
            let config = RobotConfig { groups, ..robot.config };
            HallRobot { settings: SimSettings { seed, scenario, ..robot.settings }, config }
        });
        self.robots.extend(fields.finish(read, found));
    }

    fn fields(&mut self, fields: &Fields<'_>) -> Result<HallRobot, Wrong> {
        let name = fields.due("name", RobotName::WANTED, |value| RobotName::new(value.text()?));
        let name = name.and_then(|name| self.new_name(fields, name));
        let models: Vec<_> =
            RobotModel::names().filter_map(|name| Some((name, RobotModel::named(name)?))).collect();
        let model = fields.word("model", &models);
        let profile = fields.word("profile", &Profile::names().map(|name| (name, name)));
        let start = fields.word(
            "start",
            &[
                ("waiting", StartState::Waiting),
                ("stopped", StartState::Stopped),
                ("manual", StartState::Manual),
                ("auto", StartState::Auto),
            ],
        );
        let programs = self.programs(fields);
        let values = config::values(fields);
        let read = values.of(RobotConfig { settings: robot::settings(), ..RobotConfig::new(name?, "") });
        let (library, mold) = programs?;
        let usual = SimSettings::default();
        let settings = SimSettings {
            model: model.cloned().unwrap_or(usual.model),
            profile: profile.and_then(Profile::named).unwrap_or(usual.profile),
            start: start.unwrap_or(usual.start),
            library,
            mold,
            ..SimSettings::default()
        };
        Ok(HallRobot {
            config: RobotConfig { model: Some(settings.model.name.to_string()), ..read },
            settings,
        })
    }

    /// A name that no other robot and no twin has, and that leaves room for the name of a twin.
    fn new_name(&mut self, fields: &Fields<'_>, name: RobotName) -> Result<RobotName, Wrong> {
        let twin = format!("{name}{SUFFIX}");
        if RobotName::new(&twin).is_none() {
            let what = format!("`{twin}`, the name of its twin, is longer than 32 characters");
            return Err(fields.wrong("name", what));
        }
        for other in &self.names {
            if *other == name {
                return Err(fields.wrong("name", format!("two robots are called `{name}`")));
            }
            if other.as_str() == twin || name.as_str() == format!("{other}{SUFFIX}") {
                return Err(fields
                    .wrong("name", format!("`{name}` and `{other}`: a twin has the longer name already")));
            }
        }
        self.names.push(name.clone());
        Ok(name)
    }

    /// The programs of a robot, and the name of the first one, which runs.
    fn programs(&mut self, fields: &Fields<'_>) -> Result<(Library, String), Wrong> {
        let named = fields.optional("programs", PROGRAMS, |value| {
            let names = value.list()?.iter().map(Node::text).collect::<Option<Vec<_>>>()?;
            Some(names).filter(|names| !names.is_empty())
        });
        let mut library = Library::default();
        let mut mold = None;
        for name in named.unwrap_or_else(|| USUAL_PROGRAMS.to_vec()) {
            let known = match self.program(fields, name)? {
                None => name.to_owned(),
                Some(program) => {
                    let known = program.name().to_owned();
                    library
                        .insert(program.clone())
                        .map_err(|error: LibraryError| fields.wrong("programs", error.to_string()))?;
                    known
                }
            };
            mold.get_or_insert(known);
        }
        let missing =
            library.programs().find_map(|program| Some((program.name(), library.missing_call(program)?)));
        if let Some((name, missing)) = missing {
            return Err(fields.wrong("programs", format!("program `{name}`: {missing}")));
        }
        Ok((library, mold.unwrap_or_else(|| REMOTE_MOLD.to_owned())))
    }

    /// The program of a file; `None` for a built-in one.
    fn program(&mut self, fields: &Fields<'_>, name: &str) -> Result<Option<&Program>, Wrong> {
        let shipped: Vec<_> = Library::shipped().map(|(name, _)| name).collect();
        if shipped.contains(&name) {
            return Ok(None);
        }
        if !given::is_file(name, &["toml", "json"]) {
            let near = r6_program::nearest(name, shipped.iter().copied());
            let known = near.map_or_else(
                || format!("there are: {}, or a .toml or .json file", shipped.join(", ")),
                |near| format!("nearest: `{near}`"),
            );
            return Err(fields.wrong("programs", format!("there is no program `{name}`; {known}")));
        }
        if !self.programs.contains_key(name) {
            let program = self.read_program(name).map_err(|mistakes| {
                for mistake in mistakes {
                    fields.wrong("programs", mistake);
                }
            });
            self.programs.insert(name.to_owned(), program.ok());
        }
        // The mistakes of a file that several robots name are told once.
        self.programs.get(name).and_then(Option::as_ref).map(Some).ok_or_else(|| Wrong::from(""))
    }

    /// Reads the file of a program.
    fn read_program(&self, name: &str) -> Result<Program, Vec<String>> {
        let text = (self.beside)(name).map_err(|why| vec![format!("{name}: {why}")])?;
        let stem = Path::new(name).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        Program::read(stem, &text).map_err(|mistakes| told(name, &mistakes))
    }
}

#[cfg(test)]
mod tests;
