//! A web server of one file, which answers as a test wants it to and counts what it sends.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What a request asks for: where, and which bytes; the first is 0.
pub struct Asked {
    pub number: usize,
    pub path: String,
    pub range: Option<(usize, usize)>,
}

/// An answer.
#[derive(Clone)]
pub struct Reply {
    pub status: &'static str,
    pub head: Vec<(&'static str, String)>,
    pub body: Vec<u8>,
    /// So many bytes of the body are sent; then the connection ends.
    pub cut: Option<usize>,
}

impl Reply {
    /// What a server without ranges answers.
    pub fn status(status: &'static str, body: &[u8]) -> Reply {
        Reply { status, head: Vec::new(), body: body.to_vec(), cut: None }
    }

    /// The range that was asked for, of a file with a tag.
    pub fn range(asked: &Asked, bytes: &[u8], tag: &str) -> Reply {
        let Some((first, last)) = asked.range else { return Reply::status("200 OK", bytes) };
        if first >= bytes.len() {
            return Reply::status("416 Range Not Satisfiable", b"");
        }
        let last = last.min(bytes.len() - 1);
        let mut reply = Reply::status("206 Partial Content", &bytes[first..=last]);
        reply.head.push(("Content-Range", format!("bytes {first}-{last}/{}", bytes.len())));
        reply.head.push(("ETag", format!("\"{tag}\"")));
        reply
    }

    pub fn cut_at(self, bytes: usize) -> Reply {
        Reply { cut: Some(bytes), ..self }
    }

    pub fn with(mut self, name: &'static str, value: &str) -> Reply {
        self.head.retain(|(known, _)| *known != name);
        self.head.push((name, value.to_owned()));
        self
    }
}

type Handler = dyn Fn(&Asked) -> Reply + Send + Sync;

/// A server that runs until the test ends.
pub struct Server {
    pub address: String,
    counts: Arc<Counts>,
}

struct Counts {
    requests: AtomicUsize,
    bytes: AtomicUsize,
    now: AtomicUsize,
    most: AtomicUsize,
    ranges: Mutex<Vec<(usize, usize)>>,
}

impl Server {
    /// A server that takes so long for each answer.
    pub fn new(delay: Duration, handler: impl Fn(&Asked) -> Reply + Send + Sync + 'static) -> Server {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/part.brf", listener.local_addr().unwrap());
        let counts = Arc::new(Counts {
            requests: AtomicUsize::new(0),
            bytes: AtomicUsize::new(0),
            now: AtomicUsize::new(0),
            most: AtomicUsize::new(0),
            ranges: Mutex::default(),
        });
        let (handler, of_server): (Arc<Handler>, _) = (Arc::new(handler), Arc::clone(&counts));
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (handler, counts) = (Arc::clone(&handler), Arc::clone(&of_server));
                std::thread::spawn(move || talk(stream, delay, &*handler, &counts));
            }
        });
        Server { address, counts }
    }

    /// A server of a file that does what servers do.
    pub fn of(bytes: Vec<u8>) -> Server {
        Server::new(Duration::ZERO, move |asked| Reply::range(asked, &bytes, "1"))
    }

    pub fn requests(&self) -> usize {
        self.counts.requests.load(Ordering::SeqCst)
    }

    /// Bytes of files that were sent.
    pub fn bytes(&self) -> usize {
        self.counts.bytes.load(Ordering::SeqCst)
    }

    /// Most requests that were under way at once.
    pub fn most_at_once(&self) -> usize {
        self.counts.most.load(Ordering::SeqCst)
    }

    /// The ranges that were sent.
    pub fn ranges(&self) -> Vec<(usize, usize)> {
        self.counts.ranges.lock().unwrap().clone()
    }
}

/// Answers request after request of one connection.
fn talk(stream: TcpStream, delay: Duration, handler: &Handler, counts: &Counts) -> Option<()> {
    let mut lines = BufReader::new(stream.try_clone().ok()?).lines();
    let mut stream = stream;
    loop {
        let path = lines.next()?.ok()?.split(' ').nth(1)?.to_owned();
        let mut range = None;
        for line in lines.by_ref() {
            let line = line.ok()?;
            if line.is_empty() {
                break;
            }
            if let Some(asked) = line.to_ascii_lowercase().strip_prefix("range: bytes=") {
                let (first, last) = asked.split_once('-')?;
                range = Some((first.parse().ok()?, last.parse().ok()?));
            }
        }
        counts.most.fetch_max(counts.now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
        std::thread::sleep(delay);
        let number = counts.requests.fetch_add(1, Ordering::SeqCst);
        let Reply { status, head, body, cut } = handler(&Asked { number, path, range });
        counts.now.fetch_sub(1, Ordering::SeqCst);
        let mut answer = format!("HTTP/1.1 {status}\r\n");
        head.iter().for_each(|(name, value)| answer += &format!("{name}: {value}\r\n"));
        if !head.iter().any(|(name, _)| *name == "Content-Length") {
            answer += &format!("Content-Length: {}\r\n", body.len());
        }
        let sent = &body[..cut.unwrap_or(body.len()).min(body.len())];
        counts.bytes.fetch_add(sent.len(), Ordering::SeqCst);
        counts.ranges.lock().unwrap().extend(range);
        stream.write_all((answer + "\r\n").as_bytes()).ok()?;
        stream.write_all(sent).ok()?;
        if cut.is_some() {
            return None;
        }
    }
}
