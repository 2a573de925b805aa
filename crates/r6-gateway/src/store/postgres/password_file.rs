//! Passwords in a file, in the form of PostgreSQL's own programs: a line `HOST:PORT:DATABASE:USER:PASSWORD`
//! for each server. `*` stands for any, `\` before a `:` or a `\` of a field, and `#` begins a comment.

/// What a password is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'w> {
    /// The name or the address of the server, or the folder of its socket.
    pub host: &'w str,
    /// Whether it is reached over a socket of this machine, which `localhost` stands for too.
    pub is_socket: bool,
    /// Its port.
    pub port: u16,
    /// The database.
    pub database: &'w str,
    /// The user.
    pub user: &'w str,
}

/// The password of the first line that fits.
pub fn find(text: &str, wanted: Wanted<'_>) -> Option<String> {
    let lines = text.lines().map(|line| line.trim_end_matches('\r')).filter(|line| !line.starts_with('#'));
    lines.filter_map(fields).find_map(|[host, port, database, user, password]| {
        let is = |field: &str, value: &str| field == "*" || field == value;
        let is_host = is(&host, wanted.host) || (wanted.is_socket && host == "localhost");
        let fits = is_host
            && is(&port, &wanted.port.to_string())
            && is(&database, wanted.database)
            && is(&user, wanted.user);
        fits.then_some(password)
    })
}

/// The five fields of a line. The password, which is the last, may have a `:` in it.
fn fields(line: &str) -> Option<[String; 5]> {
    let mut fields = [const { String::new() }; 5];
    let mut at = 0;
    let mut letters = line.chars();
    while let Some(letter) = letters.next() {
        let next = match letter {
            ':' if at < 4 => {
                at += 1;
                continue;
            }
            '\\' => letters.next()?,
            other => other,
        };
        fields.get_mut(at)?.push(next);
    }
    (at == 4).then_some(fields)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALL: Wanted<'_> =
        Wanted { host: "db.local", is_socket: false, port: 5432, database: "hall", user: "r6" };

    #[test]
    fn the_first_line_that_fits_has_the_password() {
        for (text, password) in [
            ("db.local:5432:hall:r6:hush", Some("hush")),
            ("*:*:*:*:hush", Some("hush")),
            (
                "# db.local:5432:hall:r6:no\ndb.local:5433:hall:r6:no\r\n*:5432:hall:*:a b\r\n*:*:*:*:no",
                Some("a b"),
            ),
            ("db.local:5432:hall:r6:a\\:b\\\\c:d", Some("a:b\\c:d")),
            ("localhost:5432:hall:r6:no", None),
            ("db.local:5432:hall:r6", None),
            ("db.local:5432:hall:other:no", None),
            ("db.local:5432:other:r6:no", None),
            ("db.local:5432:hall:r6:no\\", None),
            ("", None),
        ] {
            assert_eq!(find(text, HALL).as_deref(), password, "{text}");
        }
        let socket = Wanted { host: "/run/postgresql", is_socket: true, ..HALL };
        assert_eq!(find("localhost:5432:hall:r6:hush", socket).as_deref(), Some("hush"));
        assert_eq!(find("/run/postgresql:*:hall:r6:hush", socket).as_deref(), Some("hush"));
    }
}
