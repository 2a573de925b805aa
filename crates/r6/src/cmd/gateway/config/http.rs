//! `[http]` in the file of a gateway: how clients reach it.

use std::path::PathBuf;

use r6_gateway::TlsSettings;
use r6_program::form::{Fields, Found, Table, Wrong};

/// The most host names. A machine has one or two.
const MAX_NAMES: usize = 32;

/// What a host name is.
pub const HOST_NAME: &str = "a host name: letters, digits, - and dots, such as hall-pc.local";

/// How clients reach the gateway.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HttpSettings {
    /// The names, besides localhost and the addresses of the machine.
    pub host_names: Vec<String>,
    /// The certificate.
    pub tls: TlsSettings,
}

/// Reads the table.
pub(super) fn read(table: &Table, found: &mut Found<'_>) -> Option<HttpSettings> {
    let fields = Fields::of(table, &["host_names", "tls", "certificate", "key"], "[http]: ");
    let wanted = format!("at most {MAX_NAMES} host names in brackets, such as [\"hall-pc.local\"]");
    let names = fields.optional("host_names", &wanted, |value| {
        let names = value.list()?.iter().map(|name| host_name(name.text()?)).collect::<Option<Vec<_>>>()?;
        Some(names).filter(|names| names.len() <= MAX_NAMES)
    });
    let tls = tls(&fields);
    let settings = tls.map(|tls| HttpSettings { host_names: names.unwrap_or_default(), tls });
    fields.finish(settings, found)
}

fn tls(fields: &Fields<'_>) -> Result<TlsSettings, Wrong> {
    let is_made = fields.optional("tls", "true or false", |value| value.flag());
    let file = |name| fields.optional(name, "the path of a file", |value| value.text().map(PathBuf::from));
    match (file("certificate"), file("key"), is_made) {
        (Some(_), _, Some(_)) => {
            Err(fields.wrong("tls", "a certificate of your own is named: leave this out".to_owned()))
        }
        (Some(certificate), Some(key), None) => Ok(TlsSettings::Files { certificate, key }),
        (Some(_), None, None) => {
            Err(fields.wrong("certificate", "its private key is missing: key = \"FILE\"".to_owned()))
        }
        (None, Some(_), _) => {
            Err(fields.wrong("key", "its certificate is missing: certificate = \"FILE\"".to_owned()))
        }
        (None, None, Some(true)) => Ok(TlsSettings::Made),
        (None, None, Some(false) | None) => Ok(TlsSettings::Off),
    }
}

/// The text as a host name.
pub fn host_name(text: &str) -> Option<String> {
    let is_label = |label: &str| {
        (1..=63).contains(&label.len())
            && !label.starts_with('-')
            && !label.ends_with('-')
            && label.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
    };
    // Digits alone would be an address, and those of this machine are known.
    let has_letter = text.bytes().any(|byte| byte.is_ascii_alphabetic());
    (text.len() <= 253 && has_letter && text.split('.').all(is_label)).then(|| text.to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    #[test]
    fn names_and_a_certificate() {
        let http = |text: &str| parse(&format!("[http]\n{text}")).map(|config| config.http);
        let made = http("host_names = [\"Hall-PC.local\"]\ntls = true").unwrap();
        assert_eq!(
            made,
            HttpSettings { host_names: vec!["hall-pc.local".to_owned()], tls: TlsSettings::Made }
        );
        let files = http("certificate = \"c.pem\"\nkey = \"k.pem\"").unwrap();
        let (certificate, key) = ("c.pem".into(), "k.pem".into());
        assert_eq!(files.tls, TlsSettings::Files { certificate, key });
        assert_eq!(http("tls = false").unwrap(), HttpSettings::default());
        for (text, part) in [
            ("certificate = \"c.pem\"", "its private key is missing"),
            ("key = \"k.pem\"", "its certificate is missing"),
            ("tls = true\ncertificate = \"c.pem\"\nkey = \"k.pem\"", "leave this out"),
            ("tls = 1", "true or false"),
            ("host_names = [\"a b\"]", "host names in brackets"),
            ("host_names = [\"192.168.1.1\"]", "host names in brackets"),
            ("cert = \"c.pem\"", "cert"),
        ] {
            let mistakes = format!("{:?}", http(text).unwrap_err());
            assert!(mistakes.contains(part), "{text}: {mistakes}");
        }
    }
}
