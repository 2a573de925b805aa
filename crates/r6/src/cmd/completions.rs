//! `r6 completions`: tab completion for shells.

use clap::Args;
use clap_complete::Shell;

use crate::exit::{Exit, Failure};
use crate::output;

/// Print tab completions for a shell
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  r6 completions bash > /etc/bash_completion.d/r6
  r6 completions zsh > ~/.zfunc/_r6
  r6 completions fish > ~/.config/fish/completions/r6.fish")]
pub struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Prints the completions.
pub fn run(args: &CompletionsArgs) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut crate::command_line(), "r6", &mut script);
    output::bytes(&script);
    Ok(Exit::Done)
}
