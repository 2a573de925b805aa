//! The screen of `r6 up --cell`: a line for each robot of the hall, live.

use std::collections::VecDeque;

use r6_controller::{ControllerSnapshot, OperationMode};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

use crate::output::alarm;
use crate::output::screen::KEPT_LINES;

/// The lines below which frames give their room to lines of text.
const LOW: u16 = 30;

/// The width of a name: longer ones are cut.
const NAME: usize = 14;

/// The content of the screen besides the states of the robots.
#[derive(Debug)]
pub struct HallView {
    title: String,
    hints: Vec<String>,
    lines: VecDeque<String>,
}

impl HallView {
    /// A view without log lines.
    pub fn new(title: String, hints: Vec<String>) -> Self {
        Self { title, hints, lines: VecDeque::new() }
    }

    /// Adds a line of the log.
    pub fn add_line(&mut self, line: String) {
        if self.lines.len() >= KEPT_LINES {
            self.lines.pop_front();
        }
        self.lines.push_back(line);
    }
}

/// Draws the robots, the log and the hints. Robots come first: on a low screen the others give way.
pub fn draw(frame: &mut Frame<'_>, view: &HallView, robots: &[(&str, ControllerSnapshot)]) {
    let (borders, edge) = if frame.area().height < LOW { (Borders::TOP, 1) } else { (Borders::ALL, 2) };
    let lines = |count: usize| u16::try_from(count).unwrap_or(u16::MAX).saturating_add(edge);
    let least_of_log = edge + 2;
    // The heads of the columns take a line.
    let of_robots = lines(robots.len() + 1).min(frame.area().height.saturating_sub(least_of_log));
    let left = frame.area().height.saturating_sub(of_robots + least_of_log);
    let [hall, log, hints] = Layout::vertical([
        Constraint::Length(of_robots),
        Constraint::Min(least_of_log),
        Constraint::Length(lines(view.hints.len()).min(left)),
    ])
    .areas(frame.area());
    let block = |title: &str| Block::new().borders(borders).title(format!(" {title} "));
    draw_robots(frame, hall, block(&view.title), robots);
    draw_log(frame, log, block("log"), view);
    let lines: Vec<_> = view.hints.iter().map(|hint| Line::raw(hint.as_str())).collect();
    frame.render_widget(Paragraph::new(lines).block(block("try in a second shell — q ends")), hints);
}

fn draw_robots(frame: &mut Frame<'_>, area: Rect, block: Block<'_>, robots: &[(&str, ControllerSnapshot)]) {
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let heads = format!("{:NAME$} {:13} {:>7}  {}", "ROBOT", "MODE", "CYCLE", "NOW");
    // Without room for all, the last line counts the others.
    let room = usize::from(block.inner(area).height).saturating_sub(1);
    let shown = if robots.len() > room { room.saturating_sub(1) } else { robots.len() };
    let mut lines = vec![Line::styled(heads, bold)];
    lines.extend(robots.iter().take(shown).map(|(name, state)| line(name, state)));
    if shown < robots.len() {
        lines.push(Line::raw(format!("and {} more", robots.len() - shown)));
    }
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// The line of a robot. Colour says that it needs a person.
fn line(name: &str, state: &ControllerSnapshot) -> Line<'static> {
    let name: String = name.chars().take(NAME).collect();
    let red = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
    let yellow = Style::new().fg(Color::Yellow);
    let (text, style) = if state.emergency_stop {
        ("EMERGENCY STOP".to_owned(), red)
    } else if state.alarm != 0 {
        (format!("alarm {}", alarm::short(i64::from(state.alarm))), red)
    } else if state.mode == OperationMode::Running {
        (doing(state), Style::new())
    } else {
        ("the program does not run".to_owned(), yellow)
    };
    let cycle = match state.last_cycle_seconds {
        0.0 => String::new(),
        seconds => format!("{seconds:.1} s"),
    };
    let head = format!("{name:NAME$} {:13} {cycle:>7}  ", state.mode.to_string());
    Line::from(vec![Span::raw(head), Span::styled(text, style)])
}

/// The step of the program.
fn doing(state: &ControllerSnapshot) -> String {
    match &state.step {
        None => format!("program {}", state.program),
        Some(step) => format!("{} {}/{}: {}", step.program, step.number, step.steps, step.text),
    }
}

fn draw_log(frame: &mut Frame<'_>, area: Rect, block: Block<'_>, view: &HallView) {
    let room = usize::from(block.inner(area).height);
    let skipped = view.lines.len().saturating_sub(room);
    let lines: Vec<_> = view.lines.iter().skip(skipped).map(|line| Line::raw(line.as_str())).collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

#[cfg(test)]
mod tests {
    use r6_controller::{Controller, ControllerSettings, Profile, RobotModel};
    use r6_proto::alarm::AlarmCode;
    use r6_proto::time::Instant;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::*;

    fn drawn(width: u16, height: u16, count: usize) -> String {
        let settings = ControllerSettings::new(Profile::hc1(), RobotModel::default());
        let state = Controller::new(settings, Instant::ORIGIN).snapshot(Instant::ORIGIN);
        let names: Vec<_> = (1..=count).map(|number| format!("press-{number:02}")).collect();
        let robots = names.iter().enumerate().map(|(number, name)| {
            let state = state.clone();
            let state = match number {
                1 => ControllerSnapshot { alarm: AlarmCode(135), ..state },
                2 => ControllerSnapshot { emergency_stop: true, ..state },
                3 => ControllerSnapshot { mode: OperationMode::Manual, last_cycle_seconds: 12.34, ..state },
                _ => state,
            };
            (name.as_str(), state)
        });
        let robots: Vec<_> = robots.collect();
        let hints = ["open http://127.0.0.1:9780/#x", "r6 -g … status", "raw port", "curl"];
        let mut view = HallView::new("12 robots".to_owned(), hints.map(str::to_owned).to_vec());
        for number in 0..300 {
            view.add_line(format!("line {number}"));
        }
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, &view, &robots)).unwrap();
        let buffer = terminal.backend().buffer().clone();
        let cells: Vec<_> = buffer.content().iter().map(ratatui::buffer::Cell::symbol).collect();
        cells.chunks(usize::from(width)).map(|row| row.concat() + "\n").collect()
    }

    #[test]
    fn a_usual_terminal_shows_twelve_robots_the_log_and_all_hints() {
        let text = drawn(80, 24, 12);
        for part in [
            "12 robots",
            "press-01       running (7)            remote 1/1: wait for remote commands",
            "alarm 135 (J6: positive soft limit)",
            "EMERGENCY STOP",
            "press-04       manual (1)     12.3 s  the program does not run",
            "press-12",
            "line 299",
            "open http://127.0.0.1:9780/#x",
            "curl",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn robots_without_room_are_counted() {
        let text = drawn(80, 24, 40);
        assert!(text.contains("press-18") && text.contains("and 22 more"), "{text}");
        assert!(!text.contains("press-19") && text.contains("line 299"), "{text}");
    }

    #[test]
    fn a_tiny_terminal_is_no_error() {
        for (width, height) in [(1, 1), (10, 3), (40, 8)] {
            assert_eq!(drawn(width, height, 12).lines().count(), usize::from(height));
        }
    }
}
