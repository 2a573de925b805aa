//! A hostile controller on its own port, for tests in other languages and of the command line.
//!
//! `r6-hostile '{"dwell": 0.3}'` prints `{"port": n}` on its first line. The argument is a [`Character`] in
//! JSON; the default is `{}`. It answers each line of its input with one line of JSON:
//!
//! | line | answer |
//! |---|---|
//! | `log` | everything that happened, as a list |
//! | `carried [robot]` | the steps that a robot began |
//! | `now` | `{"now": seconds}` |
//! | `position [seconds]` | the axes of the robot that answers, at this time or now |
//! | `path seconds` | how far each axis has moved since this time |
//! | `foreign-clear` | another client clears the list |
//! | `foreign-list [..]` | another client appends instructions |
//! | `swap`, `reboot` | another robot answers; the controller restarts |
//! | `quit` | it ends, as at the end of its input |

use std::io::Write;
use std::sync::Arc;
use std::time::Duration;

use r6_testkit::hostile::Character;
use r6_testkit::hostile::serve::HostileController;
use serde_json::{Value, json};
use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::net::TcpListener;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = std::env::args().nth(1).unwrap_or_else(|| "{}".to_owned());
    let character: Character = serde_json::from_str(&argument).map_err(|error| {
        format!("usage: r6-hostile [CHARACTER], in JSON, such as {{\"dwell\": 0.3}}; {error}")
    })?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let served = runtime.block_on(serve(character));
    // A pending read of the standard input cannot be cancelled.
    runtime.shutdown_background();
    served
}

async fn serve(character: Character) -> Result<(), Box<dyn std::error::Error>> {
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let port = listener.local_addr()?.port();
    let controller = HostileController::new(character);
    tell(&json!({ "port": port }))?;
    let listening = Arc::clone(&controller).listen(listener);
    tokio::select! {
        ended = listening => ended?,
        ended = obey(&controller) => ended?,
    }
    Ok(())
}

async fn obey(controller: &HostileController) -> Result<(), Box<dyn std::error::Error>> {
    let mut lines = BufReader::new(tokio::io::stdin()).lines();
    while let Some(line) = lines.next_line().await? {
        let (word, rest) = line.trim().split_once(' ').unwrap_or((line.trim(), ""));
        if word == "quit" {
            tell(&json!({ "ok": true }))?;
            return Ok(());
        }
        tell(&answer(controller, word, rest).unwrap_or_else(|problem| json!({ "problem": problem })))?;
    }
    Ok(())
}

fn answer(controller: &HostileController, word: &str, rest: &str) -> Result<Value, String> {
    let seconds = || -> Result<Duration, String> {
        let seconds: f64 = rest.parse().map_err(|error| format!("`{rest}`: {error}"))?;
        Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
    };
    let ok = json!({ "ok": true });
    controller.arm(|arm, now| {
        Ok(match word {
            "log" => json!(arm.log()),
            "carried" => match rest.parse().unwrap_or(1) {
                robot if (1..=arm.robots()).contains(&robot) => json!(arm.carried(robot)),
                robot => return Err(format!("there is no robot {robot}")),
            },
            "now" => json!({ "now": now.as_secs_f64() }),
            "position" if rest.is_empty() => json!(arm.position_at(arm.present(), now)),
            "position" => json!(arm.position_at(arm.present(), seconds()?)),
            "path" => json!(arm.path_since(arm.present(), seconds()?)),
            "foreign-clear" => {
                arm.foreign_list(now, true, Vec::new());
                ok
            }
            "foreign-list" => {
                arm.foreign_list(now, false, serde_json::from_str(rest).map_err(|error| error.to_string())?);
                ok
            }
            "swap" => {
                arm.swap(now);
                ok
            }
            "reboot" => {
                arm.reboot(now);
                ok
            }
            other => return Err(format!("`{other}` is not known")),
        })
    })
}

fn tell(value: &Value) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{value}")?;
    out.flush()
}
