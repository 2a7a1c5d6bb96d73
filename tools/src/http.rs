//! A file on a web server, read by ranges of bytes (RFC 9110, section 14).
//!
//! Every answer is compared with the first one: the file's size, `ETag` and `Last-Modified`. A file that was replaced is
//! an error, not bytes of two files.

use brickfield_engine::store::{ByteRanges, RangeFault};
use std::io::{ErrorKind, Read};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;
use ureq::http::{Response, StatusCode, Uri, header};
use ureq::tls::{Certificate, RootCerts, TlsConfig};
use ureq::{Agent, Body, ResponseExt};

/// Bytes that the first request asks for: header and commit slots of a store.
const FIRST_BYTES: u64 = 12 << 10;
/// Requests at once. Browsers take six; a server that counts them allows more.
const AT_ONCE: usize = 16;
/// Longest wait for a connection, and for something to come over it.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(20);
/// How often the first request is given, and how long the first wait is; each is twice as long as the one before.
const TRIES: u32 = 5;
const FIRST_WAIT: Duration = Duration::from_millis(100);

const COPY: &str = "copy the file here first, as by `curl -O`, and give the copy";
const LATER: &str = "check the network and the server, and give the command again";
const CHANGED: &str = "the file has been replaced since it was opened";
const AGAIN: &str = "give the command again";

/// A file on a web server.
pub struct WebFile {
    agent: Agent,
    /// As the user gave it.
    address: Uri,
    /// Where redirects led.
    target: RwLock<Uri>,
    version: FileVersion,
    /// Its first bytes.
    first: Vec<u8>,
}

/// What tells a file from another one under the same address.
#[derive(Clone, Debug, PartialEq, Eq)]
struct FileVersion {
    bytes: u64,
    etag: Option<String>,
    modified: Option<String>,
}

fn fault(what: impl ToString, remedy: &str) -> RangeFault {
    RangeFault { what: what.to_string(), remedy: remedy.to_owned(), may_pass: false }
}

fn passing(what: impl ToString) -> RangeFault {
    RangeFault { may_pass: true, ..fault(what, LATER) }
}

impl WebFile {
    /// Asks for the first bytes of a file.
    ///
    /// # Errors
    /// What the server says, or why there is no answer.
    pub fn open(address: &str) -> Result<WebFile, RangeFault> {
        let wrong = |what: &str| {
            fault(format!("this is no address: {what}"), "give http://HOST/PATH or https://HOST/PATH")
        };
        let uri: Uri = address.parse().map_err(|error| wrong(&format!("{error}")))?;
        let Some(authority) = uri.authority() else { return Err(wrong("it names no host")) };
        if authority.as_str().contains('@') {
            let what = "user and password in the address are not sent";
            return Err(fault(what, "give an address that may be read without them"));
        }
        let is_safe = uri.scheme_str() == Some("https");
        let agent = agent(is_safe)?;
        let mut wait = FIRST_WAIT;
        for _ in 1..TRIES {
            match WebFile::ask_first(&agent, &uri) {
                Err(fault) if fault.may_pass => std::thread::sleep(wait),
                answered => return answered,
            }
            wait *= 2;
        }
        WebFile::ask_first(&agent, &uri)
    }

    fn ask_first(agent: &Agent, address: &Uri) -> Result<WebFile, RangeFault> {
        let mut answer = ask(agent, address, 0, FIRST_BYTES - 1)?;
        match answer.status() {
            StatusCode::PARTIAL_CONTENT => {}
            StatusCode::OK => {
                return Err(fault("the server sends whole files only, not ranges of bytes", COPY));
            }
            StatusCode::RANGE_NOT_SATISFIABLE => {
                return Err(fault("the file is empty", "look whether it was copied to the server whole"));
            }
            status => return Err(refused(status)),
        }
        let version = FileVersion::of(&answer)?;
        let mut first = vec![0; FIRST_BYTES.min(version.bytes) as usize];
        take(&mut answer, 0, version.bytes, &mut first)?;
        let target = answer.get_uri().clone();
        if address.scheme_str() == Some("https") && target.scheme_str() != Some("https") {
            let what = format!("the server leads to an address without encryption, {target}");
            return Err(fault(what, "give that one, if you trust it"));
        }
        Ok(WebFile {
            agent: agent.clone(),
            address: address.clone(),
            target: RwLock::new(target),
            version,
            first,
        })
    }

    fn target(&self) -> Uri {
        self.target.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The answer to a request, from where redirects led before; if that refuses, as addresses that are given for a while do,
    /// from where they lead now.
    fn answer(&self, from: u64, last: u64) -> Result<Response<Body>, RangeFault> {
        let target = self.target();
        let answer = ask(&self.agent, &target, from, last)?;
        if target == self.address || !answer.status().is_client_error() {
            return Ok(answer);
        }
        let answer = ask(&self.agent, &self.address, from, last)?;
        if answer.status() == StatusCode::PARTIAL_CONTENT {
            *self.target.write().unwrap_or_else(PoisonError::into_inner) = answer.get_uri().clone();
        }
        Ok(answer)
    }
}

impl ByteRanges for WebFile {
    fn bytes(&self) -> u64 {
        self.version.bytes
    }

    fn read(&self, offset: u64, to: &mut [u8]) -> Result<(), RangeFault> {
        let end = offset + to.len() as u64;
        if let Some(first) = self.first.get(offset as usize..end as usize) {
            to.copy_from_slice(first);
            return Ok(());
        }
        let mut answer = self.answer(offset, end - 1)?;
        match answer.status() {
            StatusCode::PARTIAL_CONTENT => {}
            // It answered ranges before.
            StatusCode::OK | StatusCode::RANGE_NOT_SATISFIABLE | StatusCode::PRECONDITION_FAILED => {
                return Err(fault(CHANGED, AGAIN));
            }
            status => return Err(refused(status)),
        }
        if FileVersion::of(&answer)? != self.version {
            return Err(fault(CHANGED, AGAIN));
        }
        take(&mut answer, offset, self.version.bytes, to)
    }

    fn at_once(&self) -> usize {
        AT_ONCE
    }
}

impl FileVersion {
    fn of(answer: &Response<Body>) -> Result<FileVersion, RangeFault> {
        let Some((_, _, bytes)) = range_of(answer) else { return Err(no_range(answer)) };
        let [etag, modified] = [header::ETAG, header::LAST_MODIFIED].map(|name| text(answer, name));
        Ok(FileVersion { bytes, etag, modified })
    }
}

fn agent(is_safe: bool) -> Result<Agent, RangeFault> {
    // Those that the system trusts, or that SSL_CERT_FILE names. A redirect may need them, too.
    let roots = rustls_native_certs::load_native_certs().certs;
    if is_safe && roots.is_empty() {
        return Err(fault("no certificates are found to know servers by", "install ca-certificates"));
    }
    let roots = roots.iter().map(|der| Certificate::from_der(der).to_owned()).collect();
    let tls = TlsConfig::builder()
        .root_certs(RootCerts::Specific(Arc::new(roots)))
        .unversioned_rustls_crypto_provider(Arc::new(rustls::crypto::ring::default_provider()));
    let config = Agent::config_builder()
        .http_status_as_error(false)
        .max_idle_connections(AT_ONCE)
        .max_idle_connections_per_host(AT_ONCE)
        .timeout_connect(Some(CONNECT_TIMEOUT))
        .timeout_recv_response(Some(ANSWER_TIMEOUT))
        .timeout_per_read(Some(ANSWER_TIMEOUT))
        .user_agent(concat!("brickfield/", env!("CARGO_PKG_VERSION")))
        .tls_config(tls.build());
    Ok(config.build().new_agent())
}

fn ask(agent: &Agent, address: &Uri, from: u64, last: u64) -> Result<Response<Body>, RangeFault> {
    let request = agent
        .get(address)
        .header(header::RANGE, format!("bytes={from}-{last}"))
        .header(header::ACCEPT_ENCODING, "identity");
    request.call().map_err(|error| match error {
        ureq::Error::Io(error) => no_answer(&error),
        ureq::Error::Timeout(_) => passing("the server does not answer"),
        ureq::Error::HostNotFound => fault("there is no such host", "check the address and the network"),
        ureq::Error::TooManyRedirects => fault("the server leads on and on", "check the address"),
        ureq::Error::Rustls(error) => fault(
            format!("there is no safe connection to the server: {error}"),
            "check the address, and the certificates of this machine",
        ),
        error => fault(format!("the server cannot be asked: {error}"), "check the address"),
    })
}

fn no_answer(error: &std::io::Error) -> RangeFault {
    match error.kind() {
        ErrorKind::ConnectionRefused => passing("the server takes no connection"),
        // Of a certificate, which does not pass.
        ErrorKind::InvalidData => fault(
            format!("there is no safe connection to the server: {error}"),
            "check the address, and the certificates of this machine",
        ),
        ErrorKind::TimedOut | ErrorKind::WouldBlock => passing("the server does not answer"),
        ErrorKind::ConnectionReset
        | ErrorKind::ConnectionAborted
        | ErrorKind::BrokenPipe
        | ErrorKind::UnexpectedEof => passing(format!("the connection was cut ({error})")),
        _ => passing(format!("there is no connection to the server ({error})")),
    }
}

/// An answer that has no bytes of the file.
fn refused(status: StatusCode) -> RangeFault {
    match status {
        StatusCode::NOT_FOUND | StatusCode::GONE => {
            fault(format!("the server has no such file ({status})"), "check the address")
        }
        StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN => {
            let remedy = "give an address that may be read without signing in";
            fault(format!("the server does not let this be read ({status})"), remedy)
        }
        StatusCode::TOO_MANY_REQUESTS | StatusCode::REQUEST_TIMEOUT => {
            passing(format!("the server is busy ({status})"))
        }
        status if status.is_server_error() && status != StatusCode::NOT_IMPLEMENTED => {
            passing(format!("the server has failed ({status})"))
        }
        status => fault(format!("the server does not send the file ({status})"), COPY),
    }
}

fn text(answer: &Response<Body>, name: header::HeaderName) -> Option<String> {
    Some(answer.headers().get(name)?.to_str().ok()?.to_owned())
}

/// The first and the last byte that an answer says it has, and the size of the file.
fn range_of(answer: &Response<Body>) -> Option<(u64, u64, u64)> {
    let text = text(answer, header::CONTENT_RANGE)?;
    let (range, bytes) = text.strip_prefix("bytes")?.trim_start().split_once('/')?;
    let (first, last) = range.split_once('-')?;
    Some((first.trim().parse().ok()?, last.trim().parse().ok()?, bytes.trim().parse().ok()?))
}

fn no_range(answer: &Response<Body>) -> RangeFault {
    let range = text(answer, header::CONTENT_RANGE).unwrap_or_else(|| "no range".to_owned());
    fault(format!("the server's answer is not the range that was asked for, but {range:?}"), COPY)
}

/// The bytes of an answer, which must be those from `offset` on of a file of that size, and no others.
fn take(answer: &mut Response<Body>, offset: u64, bytes: u64, to: &mut [u8]) -> Result<(), RangeFault> {
    let length = to.len() as u64;
    if range_of(answer) != Some((offset, (offset + length).saturating_sub(1), bytes)) {
        return Err(no_range(answer));
    }
    if text(answer, header::CONTENT_ENCODING).is_some_and(|encoding| encoding != "identity") {
        return Err(fault("the server packs what it sends, so ranges are not those of the file", COPY));
    }
    let told = text(answer, header::CONTENT_LENGTH).and_then(|length| length.parse::<u64>().ok());
    if let Some(told) = told.filter(|told| *told != length) {
        return Err(fault(
            format!("the server sends {told} bytes in place of the {length} it was asked for"),
            COPY,
        ));
    }
    let mut body = answer.body_mut().as_reader();
    body.read_exact(to).map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof => passing("the connection was cut in the middle of an answer"),
        _ => no_answer(&error),
    })?;
    // To the end, or the connection is of no further use.
    match body.read(&mut [0]) {
        Ok(0) => Ok(()),
        Ok(_) => Err(fault("the server sends more bytes than it was asked for", COPY)),
        Err(error) => Err(no_answer(&error)),
    }
}
