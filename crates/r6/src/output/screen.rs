//! The screen of `r6 up`: one virtual controller, live.

use std::collections::VecDeque;
use std::net::SocketAddr;

use r6_controller::{AxisMotion, ControllerSnapshot};
use r6_proto::AxisIndex;
use r6_proto::readiness::Unmet;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

use crate::output::hall_screen::HallView;
use crate::output::{alarm, hall_screen};

/// How many log lines are kept: more than any terminal is high.
pub const KEPT_LINES: usize = 200;

/// The height below which frames give their room to lines of text.
const LOW: u16 = 30;

/// The content of the screen besides the controller's state.
#[derive(Debug)]
pub struct View {
    address: SocketAddr,
    hints: Vec<String>,
    lines: VecDeque<String>,
}

impl View {
    /// A view without log lines.
    pub fn new(address: SocketAddr, hints: Vec<String>) -> Self {
        Self { address, hints, lines: VecDeque::new() }
    }

    /// Adds a line of the log.
    pub fn add_line(&mut self, line: String) {
        if self.lines.len() >= KEPT_LINES {
            self.lines.pop_front();
        }
        self.lines.push_back(line);
    }
}

/// The terminal while r6 draws on it. Dropping it restores the terminal.
pub struct Screen {
    terminal: ratatui::DefaultTerminal,
}

impl Screen {
    /// Takes over the terminal. A panic restores it too.
    pub fn open() -> std::io::Result<Self> {
        Ok(Self { terminal: ratatui::try_init()? })
    }

    /// Draws the state of one robot.
    pub fn draw(&mut self, view: &View, state: &ControllerSnapshot) -> std::io::Result<()> {
        self.terminal.draw(|frame| draw(frame, view, state)).map(|_| ())
    }

    /// Draws the states of the robots of a hall, each with its name.
    pub fn draw_hall(
        &mut self,
        view: &HallView,
        robots: &[(&str, ControllerSnapshot)],
    ) -> std::io::Result<()> {
        self.terminal.draw(|frame| hall_screen::draw(frame, view, robots)).map(|_| ())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // The terminal may be gone, and stderr with it: `ratatui::restore` would complain there, and panic.
        let _ = ratatui::try_restore();
    }
}

fn draw(frame: &mut Frame<'_>, view: &View, state: &ControllerSnapshot) {
    let axes = u16::try_from(state.axis_limits.len()).unwrap_or(8).min(8);
    // On a low screen frames give way, then the last hints, so that all axes and a line of the log stay.
    let (borders, edge) = if frame.area().height < LOW { (Borders::TOP, 1) } else { (Borders::ALL, 2) };
    let [of_head, of_axes, least_of_log] = [5 + edge, axes + edge, 1 + edge];
    let wanted = u16::try_from(view.hints.len()).unwrap_or(u16::MAX).saturating_add(edge);
    let left = frame.area().height.saturating_sub(of_head + of_axes + least_of_log);
    let [head, middle, log, hints] = Layout::vertical([
        Constraint::Length(of_head),
        Constraint::Length(of_axes),
        Constraint::Min(least_of_log),
        Constraint::Length(wanted.min(left)),
    ])
    .areas(frame.area());
    let [bars, pose] = Layout::horizontal([Constraint::Min(40), Constraint::Length(24)]).areas(middle);
    let block = |title: &str| Block::new().borders(borders).title(format!(" {title} "));
    let title = format!("{} at {}", state.machine_name, view.address);
    draw_head(frame, head, block(&title), state);
    draw_axes(frame, bars, block("axes within soft limits"), state);
    draw_pose(frame, pose, block("pose"), state);
    draw_log(frame, log, block("log"), view);
    draw_hints(frame, hints, block("try in a second shell — q ends"), view);
}

fn bold(text: impl Into<String>) -> Span<'static> {
    Span::styled(text.into(), Style::new().add_modifier(Modifier::BOLD))
}

fn draw_head(frame: &mut Frame<'_>, area: Rect, block: Block<'_>, state: &ControllerSnapshot) {
    let alarm_style =
        if state.alarm == 0 { Style::new().fg(Color::Green) } else { Style::new().fg(Color::Red) };
    let motion = if state.moving {
        Span::styled("moving", Style::new().fg(Color::Yellow))
    } else {
        Span::raw("at rest")
    };
    let homed = if state.homed { "homed" } else { "not homed" };
    let lines = vec![
        Line::from(vec![
            Span::raw("mode "),
            bold(state.mode.to_string()),
            Span::raw("   alarm "),
            Span::styled(alarm::short(i64::from(state.alarm)), alarm_style),
            Span::raw(format!("   {homed}, ")),
            motion,
            Span::styled(if state.emergency_stop { "   EMERGENCY STOP" } else { "" }, alarm_style),
        ]),
        Line::raw(format!(
            "list {}   global speed {:.1} %   cycle {:.1} s   connections {}",
            state.list_length, state.global_speed_percent, state.cycle_seconds, state.connections
        )),
        Line::from(vec![ready(state), Span::raw("   "), Span::raw(program(state))]),
        Line::raw(points_on(state)),
        Line::raw(format!("firmware {}   profile {}", state.version, state.profile)),
    ];
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// Whether the machine takes instructions, and the first reason why not, in a few words.
fn ready(state: &ControllerSnapshot) -> Span<'static> {
    if state.is_ready() {
        return Span::styled("READY", Style::new().fg(Color::Green).add_modifier(Modifier::BOLD));
    }
    let why = match state.unmet.first() {
        None => "the program is not at its remote step".to_owned(),
        Some(Unmet::Mode { found }) => format!("mode {found}"),
        Some(Unmet::Alarm { code }) => format!("alarm {code}"),
        Some(Unmet::NotHomed) => "not homed".to_owned(),
        Some(Unmet::Moving) => "moving".to_owned(),
        Some(Unmet::LeftoverList { length }) => format!("{length} left in the list"),
        Some(Unmet::OtherProgram) => "another program".to_owned(),
        Some(Unmet::Unknown { address }) => format!("{address} unknown"),
    };
    Span::styled(format!("NOT READY: {why}"), Style::new().fg(Color::Yellow).add_modifier(Modifier::BOLD))
}

/// The program, and the step whose turn it is.
fn program(state: &ControllerSnapshot) -> String {
    match &state.step {
        None => format!("program {}", state.program),
        Some(step) => {
            format!("program {}, step {} of {}: {}", step.program, step.number, step.steps, step.text)
        }
    }
}

/// The names of all points that are on, and the camera points that wait.
fn points_on(state: &ControllerSnapshot) -> String {
    let named = state.io.names_on();
    let on = if named.is_empty() { "no inputs or outputs".to_owned() } else { named.join(" ") };
    let waiting: usize = state.points.iter().map(|(_, count)| count).sum();
    let points = if waiting > 0 { format!("   camera points waiting: {waiting}") } else { String::new() };
    format!("on: {on}{points}")
}

fn draw_axes(frame: &mut Frame<'_>, area: Rect, block: Block<'_>, state: &ControllerSnapshot) {
    // The text before the bar is `J1  -155 `, the text after it ` 155  10.000 deg`; the frame is added.
    let width = usize::from(area.width).saturating_sub(35);
    let lines: Vec<_> = AxisIndex::ALL
        .iter()
        .zip(state.axis_limits.iter().zip(state.axes).zip(&state.axis_motions))
        .map(|(axis, (((lowest, highest), position), motion))| {
            let unit = match motion {
                AxisMotion::Turns => "deg",
                AxisMotion::Slides => "mm",
            };
            Line::raw(format!(
                "{axis} {lowest:6.0} {} {highest:<5.0}{position:10.3} {unit}",
                bar(position, *lowest, *highest, width),
                position = shown(position),
            ))
        })
        .collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// A bar from limit to limit with a mark at the position of the axis.
fn bar(position: f64, lowest: f64, highest: f64, width: usize) -> String {
    let last = width.saturating_sub(1);
    let share = ((position - lowest) / (highest - lowest)).clamp(0.0, 1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "a share of a terminal's width; what is no number becomes 0"
    )]
    let at = (share * last as f64).round() as usize;
    (0..width).map(|column| if column == at { '█' } else { '·' }).collect()
}

/// Removes the sign of a value that three decimals show as zero.
fn shown(value: f64) -> f64 {
    if value.abs() < 0.0005 { 0.0 } else { value }
}

fn draw_pose(frame: &mut Frame<'_>, area: Rect, block: Block<'_>, state: &ControllerSnapshot) {
    let lines: Vec<_> = AxisIndex::ALL
        .iter()
        .zip(state.world)
        .map(|(component, value)| {
            let unit = if component.number() < 3 { "mm" } else { "deg" };
            let value = shown(value);
            Line::raw(format!("{}  {value:12.3} {unit}", component.world_name()))
        })
        .collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn draw_log(frame: &mut Frame<'_>, area: Rect, block: Block<'_>, view: &View) {
    let room = usize::from(block.inner(area).height);
    let skipped = view.lines.len().saturating_sub(room);
    let lines: Vec<_> = view.lines.iter().skip(skipped).map(|line| Line::raw(line.as_str())).collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn draw_hints(frame: &mut Frame<'_>, area: Rect, block: Block<'_>, view: &View) {
    let lines: Vec<_> = view.hints.iter().map(|hint| Line::raw(hint.as_str())).collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::*;
    use r6_proto::alarm::AlarmCode;

    fn state() -> ControllerSnapshot {
        ControllerSnapshot {
            version: "v".to_owned(),
            machine_name: "r6 virtual BRTIRUS0707A".to_owned(),
            profile: "hc1".to_owned(),
            model: "BRTIRUS0707A".to_owned(),
            mode: r6_controller::OperationMode::Running,
            alarm: AlarmCode(135),
            emergency_stop: true,
            power_off: false,
            homed: true,
            moving: true,
            program: "remote".to_owned(),
            programs: vec!["remote".to_owned()],
            step: Some(r6_controller::ProgramStep {
                program: "remote".to_owned(),
                number: 2,
                steps: 4,
                text: "wait for remote commands".to_owned(),
            }),
            unmet: vec![Unmet::Alarm { code: 135 }],
            takes_remote: true,
            points: vec![(0, 2)],
            list_length: 3,
            axes: [10.0, 0.0, 0.0, 0.0, 30.0, 0.0, 0.0, 0.0],
            axis_limits: vec![(-155.0, 155.0); 6],
            axis_motions: vec![AxisMotion::Turns; 6],
            world: [400.0, -50.0, 500.0, 180.0, 0.0, 0.0],
            global_speed_percent: 100.0,
            cycle_seconds: 1.5,
            last_cycle_seconds: 0.0,
            io: r6_controller::io::Io { outputs: [1, 0, 0, 0, 0, 0, 0, 0], ..Default::default() },
            connections: 2,
        }
    }

    fn drawn(width: u16, height: u16) -> String {
        let mut view = View::new(
            SocketAddr::from(([127, 0, 0, 1], 9760)),
            ["open", "r6 status", "r6 move", "r6 panel status", "curl", "raw port", "r6 watch"]
                .map(str::to_owned)
                .to_vec(),
        );
        for number in 0..300 {
            view.add_line(format!("line {number}"));
        }
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, &view, &state())).unwrap();
        let buffer = terminal.backend().buffer().clone();
        let cells: Vec<_> = buffer.content().iter().map(ratatui::buffer::Cell::symbol).collect();
        cells.chunks(usize::from(width)).map(|row| row.concat() + "\n").collect()
    }

    #[test]
    fn everything_that_matters_is_on_a_usual_terminal() {
        let text = drawn(100, 30);
        for part in [
            "127.0.0.1:9760",
            "(7)",
            "J6: positive soft limit",
            "moving",
            "EMERGENCY STOP",
            "list 3",
            "NOT READY: alarm 135",
            "program remote, step 2 of 4: wait for remote commands",
            "on: Y010   camera points waiting: 2",
            "10.000 deg",
            "-50.000 mm",
            "line 299",
            "r6 status",
            "r6 panel status",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        assert!(!text.contains("line 200"), "{text}");
    }

    #[test]
    fn a_terminal_of_24_lines_shows_every_hint() {
        let text = drawn(80, 24);
        for part in ["J6  ", "line 299", "open", "r6 move", "r6 panel status", "curl", "raw port", "r6 watch"]
        {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn on_a_lower_terminal_hints_give_way_to_axes_and_the_log() {
        let text = drawn(80, 22);
        for part in ["J6  ", "line 299", "r6 status", "curl"] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        assert!(!text.contains("r6 watch"), "{text}");
    }

    #[test]
    fn a_tiny_terminal_is_no_error() {
        for (width, height) in [(1, 1), (10, 3), (40, 8)] {
            assert_eq!(drawn(width, height).lines().count(), usize::from(height));
        }
    }

    #[test]
    fn the_mark_stands_where_the_axis_does() {
        assert_eq!(bar(0.0, -10.0, 10.0, 5), "··█··");
        assert_eq!(bar(-99.0, -10.0, 10.0, 5), "█····");
        assert_eq!(bar(10.0, -10.0, 10.0, 5), "····█");
        assert_eq!(bar(f64::NAN, -10.0, 10.0, 3), "█··");
        assert_eq!(bar(0.0, -10.0, 10.0, 0), "");
    }
}
