//! `r6 inspect`: reads captured traffic and names what is wrong with it.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use clap::Args;
use r6_proto::printable;
use r6_traffic::judge::{Finding, Judge};
use r6_traffic::recording::{MAX_BYTES, Place, Recording};
use serde_json::{Value, json};

use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::problem::{self, Code};

/// Read captured traffic and name what is wrong with it
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Reads raw bytes, frames one behind the other, logs with other text around the frames, and \
transcripts (.jsonl). Names unknown, duplicate and misspelt keys, unknown addresses, commands and \
types with the nearest real one, replies with fewer values than were asked for, and what is no \
JSON. No robot is asked. The exit code is 1 if anything is wrong.

Examples:
  r6 inspect capture.bin
  r6 inspect client.log --problems
  tcpdump -A -r cell.pcap port 9760 | r6 inspect -
  r6 inspect vectors/transcripts/connect_and_query.jsonl --json"
)]
pub struct InspectArgs {
    /// The file, or - for stdin
    #[arg(value_name = "FILE|-")]
    file: PathBuf,
    /// Show only the frames with problems
    #[arg(long)]
    problems: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Reads the input and prints what was found.
pub fn run(args: &InspectArgs) -> Result<Exit, Failure> {
    let report = Report::of(read(&args.file)?);
    if args.json {
        output::json_pretty(&report.json(args.problems));
    } else {
        report.print(args.problems);
    }
    Ok(if report.problems() == 0 { Exit::Done } else { Exit::Refused })
}

fn read(file: &Path) -> Result<Recording, Failure> {
    let name = file.display();
    let unreadable = |error: std::io::Error| Failure::usage(format!("{name} cannot be read: {error}"));
    let mut input = Vec::new();
    let stdin = file.as_os_str() == "-";
    let source: Box<dyn Read> = if stdin {
        Box::new(std::io::stdin())
    } else {
        Box::new(std::fs::File::open(file).map_err(unreadable)?)
    };
    let most = u64::try_from(MAX_BYTES).unwrap_or(u64::MAX);
    source.take(most.saturating_add(1)).read_to_end(&mut input).map_err(unreadable)?;
    Recording::read(&input)
        .map_err(|error| Failure::usage(format!("{name} has {error}")).advise("cut the capture into parts"))
}

/// Everything that was found.
struct Report {
    frames: Vec<(Place, Finding)>,
    other_bytes: usize,
}

impl Report {
    fn of(recording: Recording) -> Self {
        let mut judge = Judge::default();
        let frames = recording.frames.into_iter().map(|frame| (frame.place, judge.captured(&frame)));
        Self { frames: frames.collect(), other_bytes: recording.other_bytes }
    }

    fn problems(&self) -> usize {
        self.frames.iter().map(|(_, finding)| finding.problems.len()).sum()
    }

    fn counts(&self) -> BTreeMap<&'static str, usize> {
        let mut counts = BTreeMap::new();
        for (_, finding) in &self.frames {
            *counts.entry(finding.kind.word()).or_default() += 1;
        }
        counts
    }

    /// The frames to show, each with its number, counted from 1.
    fn shown(&self, only_problems: bool) -> impl Iterator<Item = (usize, &Place, &Finding)> {
        let frames = (1..).zip(&self.frames).map(|(number, (place, finding))| (number, place, finding));
        frames.filter(move |(_, _, finding)| !only_problems || !finding.problems.is_empty())
    }

    fn print(&self, only_problems: bool) {
        for (number, place, finding) in self.shown(only_problems) {
            let Finding { direction, kind, summary, problems, notes } = finding;
            let colon = if summary.is_empty() { "" } else { ": " };
            output::line(format_args!(
                "#{number} line {} offset {}  {direction}  {kind}{colon}{}",
                place.line,
                place.offset,
                printable(summary)
            ));
            for problem in problems {
                output::line(format_args!("    problem: {}", printable(&problem.to_string())));
            }
            for note in notes {
                output::line(format_args!("    note: {}", printable(&note.to_string())));
            }
        }
        output::line(self.summary());
    }

    fn summary(&self) -> String {
        let counts: Vec<_> = self.counts().iter().map(|(kind, count)| format!("{count} {kind}")).collect();
        let frames = match self.frames.len() {
            0 => "no frame".to_owned(),
            1 => "1 frame".to_owned(),
            count => format!("{count} frames"),
        };
        let kinds = if counts.is_empty() { String::new() } else { format!(" ({})", counts.join(", ")) };
        let with_problems = self.frames.iter().filter(|(_, finding)| !finding.problems.is_empty()).count();
        let problems = match self.problems() {
            0 => "nothing wrong".to_owned(),
            1 => "1 problem".to_owned(),
            count => format!("{count} problems in {with_problems} of them"),
        };
        let other = match self.other_bytes {
            0 => String::new(),
            bytes => format!("; {bytes} bytes of other text"),
        };
        format!("{frames}{kinds}; {problems}{other}")
    }

    fn json(&self, only_problems: bool) -> Value {
        let frames: Vec<_> = self
            .shown(only_problems)
            .map(|(number, place, finding)| {
                json!({
                    "number": number, "line": place.line, "offset_bytes": place.offset,
                    "direction": finding.direction.word(), "kind": finding.kind.word(),
                    "summary": finding.summary, "problems": texts(&finding.problems),
                    "notes": texts(&finding.notes),
                })
            })
            .collect();
        let mut report = json!({
            "frames": frames,
            "frame_count": self.frames.len(),
            "counts": self.counts(),
            "problem_count": self.problems(),
            "other_bytes": self.other_bytes,
        });
        if self.problems() > 0 {
            let failure = Failure::refused(self.summary()).with_code(Code::ProblemsFound);
            report["problem"] = problem::object(&failure);
        }
        report
    }
}

fn texts(found: &[impl ToString]) -> Vec<String> {
    found.iter().map(ToString::to_string).collect()
}
