//! `r6 man`: the man pages, for packages.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, Command};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};

use crate::exit::{Exit, Failure};
use crate::output;

/// Write the man pages of r6 and of each subcommand to a folder
#[derive(Debug, Args)]
#[command(after_help = "\
For packages of r6: `make dist` puts these pages into the Debian package.

Examples:
  r6 man --to target/man
  man -l target/man/r6-status.1")]
pub struct ManArgs {
    /// The folder; it is made where it is missing, and pages in it are written over
    #[arg(long, value_name = "DIR")]
    to: PathBuf,
}

/// Writes the pages.
pub fn run(args: &ManArgs) -> Result<Exit, Failure> {
    let pages = fs::create_dir_all(&args.to)
        .and_then(|()| {
            let mut command = crate::command_line().disable_help_subcommand(true);
            command.build();
            write_pages(&command, &args.to)
        })
        .map_err(|error| Failure::usage(format!("{} cannot be written: {error}", args.to.display())))?;
    output::line(format_args!("{} in {}", output::counted(pages, "man page"), args.to.display()));
    Ok(Exit::Done)
}

/// Writes the page of `command` and of each subcommand that the help shows; returns how many.
fn write_pages(command: &Command, folder: &Path) -> io::Result<usize> {
    let mut pages = 1;
    for subcommand in command.get_subcommands().filter(|subcommand| !subcommand.is_hide_set()) {
        pages += write_pages(subcommand, folder)?;
    }
    let man =
        Man::new(command.clone()).source(concat!("r6 ", env!("CARGO_PKG_VERSION"))).manual("User Commands");
    fs::write(folder.join(man.get_filename()), page(&man, command)?)?;
    Ok(pages)
}

/// One page. Clap's own page runs the lines of examples and tables together, so what stands after the options
/// is laid out here.
fn page(man: &Man, command: &Command) -> io::Result<Vec<u8>> {
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    man.render_options_section(&mut page)?;
    if command.get_subcommands().any(|subcommand| !subcommand.is_hide_set()) {
        man.render_subcommands_section(&mut page)?;
    }
    let after = command.get_after_long_help().or_else(|| command.get_after_help());
    after_help(&after.map(ToString::to_string).unwrap_or_default()).to_writer(&mut page)?;
    Ok(page)
}

/// The text after the options, by its paragraphs: lines that are indented stay as they are.
fn after_help(text: &str) -> Roff {
    let mut roff = Roff::default();
    let mut section = "";
    for paragraph in text.split("\n\n") {
        let (first, rest) = paragraph.split_once('\n').unwrap_or((paragraph, ""));
        let (heading, lines) = match first {
            "Examples:" => ("EXAMPLES", rest),
            "Exit codes:" => ("EXIT STATUS", rest),
            "" => continue,
            _ => ("NOTES", paragraph),
        };
        if heading == section {
            roff.control("PP", []);
        } else {
            roff.control("SH", [heading]);
            section = heading;
        }
        let mut literal = false;
        for line in lines.lines() {
            if line.starts_with("  ") != literal {
                literal = !literal;
                roff.control(if literal { "nf" } else { "fi" }, []);
            }
            roff.text([roman(line)]);
        }
        if literal {
            roff.control("fi", []);
        }
    }
    roff
}
