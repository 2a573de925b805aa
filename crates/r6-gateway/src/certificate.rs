//! The certificate of the gateway: given to it, or made by it.

use std::fmt;
use std::io;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use r6_http::{BadCertificate, Tls};
use rcgen::{CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, KeyPair, KeyUsagePurpose};
use sha2::{Digest, Sha256};

use crate::files;

/// The folder of a certificate that the gateway makes, in that of the store.
pub const FOLDER: &str = "tls";

/// Its files there: the certificate and its key.
pub const FILES: [&str; 2] = ["certificate.pem", "key.pem"];

/// The longest file with certificates or a key: a chain takes some kilobytes.
const MAX_BYTES: u64 = 1024 * 1024;

/// How often the files are looked at. A program that renews certificates need not tell the gateway.
const LOOK: Duration = Duration::from_secs(2);

/// From how long before its end on the log tells of it: time for people to get another one.
const TOLD_BEFORE: i64 = 30 * 86_400;

/// How often the log tells that a certificate ends soon or has ended.
const TOLD_EVERY: Duration = Duration::from_secs(86_400);

/// The year before which no clock is right. A computer without a battery begins in 1970, and a certificate
/// that is made then ends before clients look at it.
const FIRST_YEAR: i32 = 2026;

/// How many years a certificate is valid that the gateway makes.
const YEARS: i32 = 10;

/// Where the certificate comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum TlsSettings {
    /// There is no TLS.
    #[default]
    Off,
    /// Files in PEM. If they change, new connections use what they say then.
    Files {
        /// The certificate of the gateway, then those of its issuers.
        certificate: PathBuf,
        /// Its private key.
        key: PathBuf,
    },
    /// The gateway makes one at its first start, which signs itself. Clients have to be told to trust it.
    Made,
}

/// A certificate that is used.
#[derive(Clone, Debug)]
pub struct Certificate {
    tls: Tls,
    files: CertificateFiles,
    fingerprint: String,
    /// The SHA-256 of the certificate that is used now.
    now: Arc<Mutex<String>>,
    missing: Vec<String>,
    /// The end of the certificate that is used now, in seconds since 1970.
    expires: Arc<AtomicI64>,
    /// The hash of the files that were read at the start.
    read: [u8; 32],
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct CertificateFiles {
    certificate: PathBuf,
    key: PathBuf,
}

/// Why a certificate cannot be used.
#[derive(Debug)]
pub enum CertificateError {
    /// The system says that a file cannot be read or written.
    File(PathBuf, io::Error),
    /// The files are not a certificate and its key.
    Bad(PathBuf, BadCertificate),
    /// One of two files is there.
    Half {
        /// The file that is there.
        there: PathBuf,
        /// The file that is not.
        missing: PathBuf,
    },
    /// None could be made for these names.
    Make(rcgen::Error),
    /// None was made, because the clock of the machine says this year.
    Clock(i32),
}

impl fmt::Display for CertificateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path, error) => write!(f, "{}: {error}", path.display()),
            Self::Bad(path, error) => write!(f, "{}: {error}", path.display()),
            Self::Half { there, missing } => write!(
                f,
                "there is {}, but not {}: put it back, or remove both; then the gateway makes new ones",
                there.display(),
                missing.display()
            ),
            Self::Make(error) => write!(f, "no certificate can be made: {error}"),
            Self::Clock(year) => {
                write!(f, "no certificate is made while the clock of this machine says {year}: set the clock")
            }
        }
    }
}

impl std::error::Error for CertificateError {}

impl Certificate {
    /// The certificate that these settings name. `names` are the host names by which clients reach the
    /// gateway, besides the address that it listens on and those of this machine.
    ///
    /// # Errors
    /// [`CertificateError`].
    pub fn open(
        settings: &TlsSettings,
        data: &Path,
        listens: IpAddr,
        names: &[String],
    ) -> Result<Option<Self>, CertificateError> {
        let files = match settings {
            TlsSettings::Off => return Ok(None),
            TlsSettings::Files { certificate, key } => {
                CertificateFiles { certificate: certificate.clone(), key: key.clone() }
            }
            TlsSettings::Made => made(&data.join(FOLDER), &hosts(listens, names), SystemTime::now())?,
        };
        let (certificate, key) = files.read()?;
        let bad = |error| CertificateError::Bad(files.certificate.clone(), error);
        let tls = Tls::new(&certificate, &key).map_err(bad)?;
        let mut missing = Vec::new();
        for name in names {
            if !r6_http::is_for(&certificate, name).map_err(bad)? {
                missing.push(name.clone());
            }
        }
        let der = r6_http::first_der(&certificate).map_err(bad)?;
        let (fingerprint, expires) = (fingerprint_of(&der), Arc::new(AtomicI64::new(end_of(&der))));
        let read = hash(&(certificate, key));
        let now = Arc::new(Mutex::new(fingerprint.clone()));
        Ok(Some(Self { tls, files, fingerprint, now, missing, expires, read }))
    }

    /// The file with the certificate, which clients can be told to trust.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.files.certificate
    }

    /// The SHA-256 of the certificate at the start, as browsers show it.
    #[must_use]
    pub fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    /// The SHA-256 of the certificate that is used now.
    pub(crate) fn fingerprint_now(&self) -> String {
        self.now.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The names of the gateway that the certificate is not for. Clients refuse it under these.
    #[must_use]
    pub fn missing_names(&self) -> &[String] {
        &self.missing
    }

    /// When the certificate that is used now ends, in seconds since 1970. Clients refuse it from then on.
    #[must_use]
    pub fn expires(&self) -> i64 {
        self.expires.load(Ordering::Relaxed)
    }

    /// What people have to know about the end of the certificate at this time, in seconds since 1970; `None`
    /// if it is valid for long.
    fn ending(&self, now: i64) -> Option<String> {
        let left = self.expires().saturating_sub(now);
        let file = self.path().display();
        if left > TOLD_BEFORE {
            return None;
        }
        let what = if left <= 0 {
            "has expired: clients refuse it".to_owned()
        } else {
            format!("expires in {} days", left / 86_400)
        };
        Some(format!("the certificate {file} {what}; put another one there, or make a new one"))
    }

    /// What the server needs.
    pub(crate) fn tls(&self) -> Tls {
        self.tls.clone()
    }

    /// Looks at the files again and again, and uses what they say. If they cannot be used, the last ones go
    /// on. Tells once a day that the certificate ends soon or has ended.
    pub(crate) async fn follow(self) {
        // Files that changed since the start are used, too.
        let mut last = Some(self.read);
        let mut told: Option<Instant> = None;
        loop {
            if told.is_none_or(|told| told.elapsed() >= TOLD_EVERY)
                && let Some(text) = self.ending(seconds(SystemTime::now()))
            {
                tracing::warn!("{text}");
                told = Some(Instant::now());
            }
            tokio::time::sleep(LOOK).await;
            let files = self.files.clone();
            let Ok(read) = tokio::task::spawn_blocking(move || files.read()).await else { continue };
            match read {
                // Two files are not changed at once. A half of the change is tried once, and fails.
                Ok(read) if last != Some(hash(&read)) => {
                    match self.tls.replace(&read.0, &read.1) {
                        Ok(()) => {
                            let der = r6_http::first_der(&read.0).unwrap_or_default();
                            self.expires.store(end_of(&der), Ordering::Relaxed);
                            *self.now.lock().unwrap_or_else(PoisonError::into_inner) = fingerprint_of(&der);
                            told = None;
                            tracing::info!(file = %self.path().display(), "the certificate has changed");
                        }
                        Err(error) => tracing::error!(
                            file = %self.path().display(), %error,
                            "the certificate has changed and cannot be used: the last one goes on"
                        ),
                    }
                    last = Some(hash(&read));
                }
                Ok(_) => {}
                Err(error) => {
                    if last.take().is_some() {
                        tracing::error!(%error, "the certificate cannot be read: the last one goes on");
                    }
                }
            }
        }
    }
}

impl CertificateFiles {
    fn read(&self) -> Result<(Vec<u8>, Vec<u8>), CertificateError> {
        let read = |path: &PathBuf| {
            files::read(path, MAX_BYTES).map_err(|error| CertificateError::File(path.clone(), error))
        };
        Ok((read(&self.certificate)?, read(&self.key)?))
    }
}

/// The certificate in this folder. It is made if it is not there.
fn made(folder: &Path, names: &[String], now: SystemTime) -> Result<CertificateFiles, CertificateError> {
    let files = CertificateFiles { certificate: folder.join("certificate.pem"), key: folder.join("key.pem") };
    match (files.certificate.exists(), files.key.exists()) {
        (true, true) => return Ok(files),
        (true, false) => {
            return Err(CertificateError::Half { there: files.certificate, missing: files.key });
        }
        (false, _) if year(now) < FIRST_YEAR => return Err(CertificateError::Clock(year(now))),
        // A key alone: the process ended before it wrote the certificate. No client trusts this key yet.
        (false, true) => {
            let failed = |error| CertificateError::File(files.key.clone(), error);
            std::fs::remove_file(&files.key).map_err(failed)?;
        }
        (false, false) => {}
    }
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |error| CertificateError::File(path, error)
    };
    let (certificate, key) = make(names, now).map_err(CertificateError::Make)?;
    files::make_folder(folder).map_err(failed(folder))?;
    files::write(&files.key, key.as_bytes()).map_err(failed(&files.key))?;
    files::write(&files.certificate, certificate.as_bytes()).map_err(failed(&files.certificate))?;
    Ok(files)
}

/// The hosts that a certificate is made for.
fn hosts(listens: IpAddr, names: &[String]) -> Vec<String> {
    let mut hosts: Vec<_> = ["localhost", "127.0.0.1", "::1"].map(str::to_owned).to_vec();
    hosts.extend((!listens.is_unspecified()).then(|| listens.to_string()));
    hosts.extend(names.iter().cloned());
    hosts.sort();
    hosts.dedup();
    hosts
}

/// A certificate and its key in PEM.
fn make(names: &[String], now: SystemTime) -> Result<(String, String), rcgen::Error> {
    let mut params = CertificateParams::new(names)?;
    params.distinguished_name.push(DnType::CommonName, "r6 gateway");
    // With this key alone, no certificates of other servers can be signed.
    params.is_ca = IsCa::ExplicitNoCa;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    // Clocks of halls are wrong: a client whose clock is late has to take it.
    let year = year(now);
    params.not_before = rcgen::date_time_ymd(year - 1, 1, 1);
    params.not_after = rcgen::date_time_ymd(year + YEARS, 1, 1);
    let key = KeyPair::generate()?;
    let certificate = params.self_signed(&key)?;
    Ok((certificate.pem(), key.serialize_pem()))
}

/// The year of a time, UTC.
fn year(time: SystemTime) -> i32 {
    let text = humantime::format_rfc3339_seconds(time.max(UNIX_EPOCH)).to_string();
    text.split('-').next().and_then(|year| year.parse().ok()).unwrap_or(1970)
}

/// A time in seconds since 1970.
fn seconds(time: SystemTime) -> i64 {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_secs()).unwrap_or(i64::MAX)
}

/// When a certificate in DER ends, in seconds since 1970. If it cannot be read, so that TLS would not have
/// taken it, this is 0: it counts as expired.
fn end_of(der: &[u8]) -> i64 {
    x509_parser::parse_x509_certificate(der).map_or(0, |(_, read)| read.validity().not_after.timestamp())
}

/// The hash of a certificate and its key. The key itself is not kept.
fn hash((certificate, key): &(Vec<u8>, Vec<u8>)) -> [u8; 32] {
    let mut hash = Sha256::new();
    hash.update(Sha256::digest(certificate));
    hash.update(key);
    hash.finalize().into()
}

/// The SHA-256 of a certificate in DER, as browsers show it.
/// The SHA-256 of a certificate, as browsers show it.
pub(crate) fn fingerprint_of(der: &[u8]) -> String {
    let bytes = Sha256::digest(der);
    let bytes: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    bytes.join(":")
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use super::*;

    const LISTENS: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 168, 1, 2));

    fn names() -> Vec<String> {
        vec!["hall.example".to_owned()]
    }

    #[test]
    fn one_is_made_at_the_first_start_and_stays() {
        let data = tempfile::tempdir().unwrap();
        let open = |names: &[String]| Certificate::open(&TlsSettings::Made, data.path(), LISTENS, names);
        let first = open(&names()).unwrap().unwrap();
        assert!(first.missing_names().is_empty(), "{:?}", first.missing_names());
        let pem = std::fs::read(first.path()).unwrap();
        for host in ["localhost", "127.0.0.1", "::1", "192.168.1.2", "hall.example"] {
            assert!(r6_http::is_for(&pem, host).unwrap(), "{host}");
        }
        assert!(!r6_http::is_for(&pem, "192.168.1.3").unwrap());
        assert_eq!(first.fingerprint().len(), 32 * 3 - 1);
        let again = open(&names()).unwrap().unwrap();
        assert_eq!(again.fingerprint(), first.fingerprint());
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
            assert_eq!(mode(&data.path().join("tls/key.pem")), 0o600);
            assert_eq!(mode(&data.path().join("tls")), 0o700);
        }
        // A name that came later is missing, and is told.
        let more = open(&["hall.example".to_owned(), "other.example".to_owned()]).unwrap().unwrap();
        assert_eq!(more.missing_names(), ["other.example"]);

        // Without its key, the certificate is of no use. It is not replaced without a word: clients trust it.
        std::fs::remove_file(data.path().join("tls/key.pem")).unwrap();
        let error = open(&names()).unwrap_err().to_string();
        assert!(error.contains("key.pem") && error.contains("remove both"), "{error}");
        // A key that no certificate was made for: the process ended in between.
        std::fs::remove_file(data.path().join("tls/certificate.pem")).unwrap();
        std::fs::write(data.path().join("tls/key.pem"), "half").unwrap();
        assert_ne!(open(&names()).unwrap().unwrap().fingerprint(), first.fingerprint());
    }

    #[test]
    fn files_that_cannot_be_used_are_named() {
        let data = tempfile::tempdir().unwrap();
        Certificate::open(&TlsSettings::Made, data.path(), LISTENS, &names()).unwrap();
        let (good, key) = (data.path().join("tls/certificate.pem"), data.path().join("tls/key.pem"));
        let other = make(&names(), SystemTime::now()).unwrap().1;
        let (other_key, empty, long) =
            (data.path().join("other"), data.path().join("empty"), data.path().join("long"));
        std::fs::write(&other_key, other).unwrap();
        std::fs::write(&empty, "").unwrap();
        std::fs::write(&long, vec![b'x'; 1024 * 1024 + 1]).unwrap();
        let cases = [
            (&data.path().join("none.pem"), &key, "none.pem: No such file"),
            (&empty, &key, "empty: there is no certificate in PEM"),
            (&key, &key, "there is no certificate in PEM"),
            (&good, &good, "there is no private key in PEM"),
            (&good, &other_key, "certificate and key do not go together"),
            (&long, &key, "longer than 1048576 bytes"),
        ];
        for (certificate, key, part) in cases {
            let settings = TlsSettings::Files { certificate: certificate.clone(), key: key.clone() };
            let error = Certificate::open(&settings, data.path(), LISTENS, &names()).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn its_end_is_known_and_told_in_time() {
        let data = tempfile::tempdir().unwrap();
        let open = || Certificate::open(&TlsSettings::Made, data.path(), LISTENS, &names()).unwrap().unwrap();
        let made = open();
        let end = made.expires();
        // The first of January of the year in ten years.
        let (now, day) = (seconds(SystemTime::now()), 86_400);
        assert_eq!(year(UNIX_EPOCH + Duration::from_secs(end.unsigned_abs())), year(SystemTime::now()) + 10);
        assert!(end > now + 9 * 365 * day && made.ending(now).is_none());
        assert_eq!(made.ending(end - 31 * day), None);
        let soon = made.ending(end - 29 * day - 1).unwrap();
        assert!(soon.contains("certificate.pem expires in 29 days"), "{soon}");
        for late in [end, end + day] {
            let late = made.ending(late).unwrap();
            assert!(late.contains("has expired"), "{late}");
        }
        // A certificate of one's own that has ended is used, because a stop has to go, and is told.
        let old = make(&names(), UNIX_EPOCH + Duration::from_secs(1_000_000_000)).unwrap();
        let files = made.files.clone();
        std::fs::write(&files.certificate, old.0).unwrap();
        std::fs::write(&files.key, old.1).unwrap();
        let old = open();
        assert_eq!(old.expires(), 1_293_840_000, "2011-01-01");
        assert!(old.ending(now).unwrap().contains("has expired"));
        assert_eq!(end_of(b"no certificate"), 0);
    }

    #[test]
    fn none_is_made_while_the_clock_is_wrong() {
        let data = tempfile::tempdir().unwrap();
        let folder = data.path().join("tls");
        let error = made(&folder, &names(), UNIX_EPOCH + Duration::from_secs(7)).unwrap_err().to_string();
        assert!(error.contains("says 1970: set the clock"), "{error}");
        assert!(!folder.exists());
        made(&folder, &names(), SystemTime::now()).unwrap();
        // A certificate from before is used: the gateway must start.
        made(&folder, &names(), UNIX_EPOCH).unwrap();
    }

    #[tokio::test]
    async fn files_that_change_before_the_first_look_are_used() {
        let data = tempfile::tempdir().unwrap();
        let open = Certificate::open(&TlsSettings::Made, data.path(), LISTENS, &names()).unwrap().unwrap();
        let (old, files) = (open.expires(), open.files.clone());
        let (certificate, key) = make(&names(), UNIX_EPOCH + Duration::from_secs(1_000_000_000)).unwrap();
        std::fs::write(&files.certificate, certificate).unwrap();
        std::fs::write(&files.key, key).unwrap();
        let follows = tokio::spawn(open.clone().follow());
        let begun = Instant::now();
        while open.expires() == old {
            assert!(begun.elapsed() < Duration::from_secs(20), "the new files are used");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        follows.abort();
        let text = format!("{open:?}");
        assert!(!text.contains("PRIVATE"), "{text}");
    }

    #[test]
    fn it_is_valid_for_clocks_that_are_a_year_late() {
        assert_eq!(year(UNIX_EPOCH + Duration::from_secs(1_764_000_000)), 2025);
        assert_eq!(year(UNIX_EPOCH), 1970);
    }
}
