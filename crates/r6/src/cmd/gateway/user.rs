//! `r6 gateway user`: makes, lists and disables users, and makes one-time links, whether the gateway runs or
//! not.

use std::path::{Path, PathBuf};

use clap::Args;
use r6_api::gateway::Role;
use r6_gateway::{Account, At, UserName};

use super::place::{self, StoreUrl};
use super::{DEFAULT_DATA, DEFAULT_LISTEN, URL_FILE, tell_new_folder, token};
use crate::exit::{Exit, Failure};
use crate::output::{self, table::Table};
use crate::text_file;

/// The longest URL of a gateway: scheme, IPv6 address, port.
const MAX_URL: usize = 100;

/// Make a user, list or disable users, or print a link with which a user sets a password
#[derive(Debug, Args)]
#[command(after_help = "\
A new user has no password yet: the link that is printed lets the user set one. A link works once and for an \
hour. It does not matter whether the gateway runs. Open the link in a browser on a computer that reaches the \
gateway, with --url if that is not this one or the gateway has a certificate of your own.

An admin who forgot the password: --link NAME. If no admin can sign in, a gateway that starts prints a link \
that makes one.

Roles are those of tokens: `r6 gateway token --help`. Admins change users over HTTP too.

Examples:
  r6 gateway user --add anna --role operator
  r6 gateway user --add ben --role engineer --robot 'press-4,*=viewer'
  r6 gateway user --link anna --url https://hall-pc.local:9780
  r6 gateway user --list
  r6 gateway user --disable ben")]
pub struct UserArgs {
    /// Folder of the gateway
    #[arg(long, value_name = "DIR", default_value = DEFAULT_DATA)]
    data: PathBuf,
    /// The database of gateways that share their store, in place of the folder
    #[arg(long, value_name = "URL", value_parser = StoreUrl::read, conflicts_with = "data")]
    store: Option<StoreUrl>,
    /// Make a user with this name, and print a link for the password
    #[arg(long, value_name = "NAME", requires = "role", required_unless_present_any = ["list", "disable", "link"])]
    add: Option<String>,
    /// What the user may do
    #[arg(long, value_parser = token::role(), requires = "add")]
    role: Option<Role>,
    /// The robots that the user is for, with commas between them: NAME, or NAME=ROLE for a lower role; * for
    /// all others
    // The id is that of the global option, so that this one stands in its place.
    #[arg(id = "robot", short = 'r', long = "robot", value_name = "NAMES")]
    robots: Option<String>,
    /// Print the users
    #[arg(long, conflicts_with_all = ["add", "disable", "link"])]
    list: bool,
    /// Disable the user with this name: a running gateway ends the sessions within a second
    #[arg(long, value_name = "NAME", conflicts_with_all = ["add", "link"])]
    disable: Option<String>,
    /// Print a link with which the user with this name sets a new password
    #[arg(long, value_name = "NAME", conflicts_with = "add")]
    link: Option<String>,
    /// The address of the gateway in links; required with --store [default: where the gateway of the folder
    /// listens on this machine, or listened last; before its first start http://127.0.0.1:9780]
    #[arg(long, value_name = "URL")]
    url: Option<String>,
}

impl UserArgs {
    /// Where the store is.
    fn at(&self) -> Result<At, Failure> {
        place::at(self.store.as_ref(), &self.data)
    }
}

/// Makes, lists or disables users, or makes a link.
pub fn run(args: UserArgs, robot_typed: bool) -> Result<Exit, Failure> {
    // Beside another action, `requires` of clap does not count.
    if args.add.is_none() && (args.role.is_some() || robot_typed) {
        return Err(Failure::usage("--role and --robot go with --add alone")
            .advise("an admin changes a user on the dashboard or with `PUT /v1/users/NAME`"));
    }
    if let Some(name) = &args.disable {
        r6_gateway::disable_user(args.at()?, user(name)?).map_err(Failure::usage)?;
        output::line(format_args!("user {name} is disabled"));
        return Ok(Exit::Done);
    }
    if let Some(name) = &args.link {
        return link(&args, user(name)?, &url(&args)?);
    }
    let (Some(name), Some(role)) = (&args.add, args.role) else {
        return list(args.at()?);
    };
    let (name, url) = (user(name)?, url(&args)?);
    let grant = token::grant(role, args.robots.as_deref().filter(|_| robot_typed))?;
    let (what, named) = (token::what(&grant), token::names_of(&grant));
    if args.store.is_none() {
        tell_new_folder(&args.data);
    }
    r6_gateway::add_user(args.at()?, name.clone(), grant).map_err(Failure::usage)?;
    for robot in &named {
        token::tell_if_unknown(args.at()?, robot);
    }
    output::note(format_args!("user {name}: {what}. The link sets the password, once and within an hour"));
    link(&args, name, &url)
}

fn user(name: &str) -> Result<UserName, Failure> {
    UserName::new(name).ok_or_else(|| Failure::usage(format!("`{name}`: it has to be {}", UserName::WANTED)))
}

/// The URL in links. A database does not say where a gateway listens, and which one people reach.
fn url(args: &UserArgs) -> Result<String, Failure> {
    match (&args.url, &args.store) {
        (Some(url), _) => Ok(url.clone()),
        (None, None) => Ok(here(&args.data)),
        (None, Some(_)) => Err(Failure::usage("with --store, a link needs --url: the address of a gateway")
            .advise("such as --url https://hall-pc.local:9780; the browser of the user has to reach it")),
    }
}

fn link(args: &UserArgs, name: UserName, url: &str) -> Result<Exit, Failure> {
    let link = r6_gateway::make_link(args.at()?, name)
        .map_err(|error| Failure::usage(error).advise("`r6 gateway user --list` prints the users"))?;
    output::line(format_args!("{}/setup{link}", url.trim_end_matches('/')));
    Ok(Exit::Done)
}

/// The URL of the gateway of this folder: where it listens, or listened last. Before its first start, the
/// usual one.
fn here(data: &Path) -> String {
    let kept = text_file::read(&data.join(URL_FILE), "a URL", MAX_URL).ok();
    let kept = kept.map(|text| text.trim().to_owned());
    // The file is of the owner of the folder; what is no URL is not printed as one.
    let kept = kept.filter(|url| url.starts_with("http") && url.bytes().all(|byte| byte.is_ascii_graphic()));
    kept.unwrap_or_else(|| {
        let scheme = if r6_gateway::has_certificate(data) { "https" } else { "http" };
        format!("{scheme}://{DEFAULT_LISTEN}")
    })
}

fn list(at: At) -> Result<Exit, Failure> {
    let users = r6_gateway::list_users(at).map_err(Failure::usage)?;
    let mut table = Table::new();
    for Account { name, grant, disabled, password } in &users {
        let state = match (disabled, password) {
            (true, _) => "disabled",
            (false, None) => "no password yet",
            (false, Some(_)) => "",
        };
        table.row([&name, &token::what(grant), &state]);
    }
    output::line(table);
    Ok(Exit::Done)
}
