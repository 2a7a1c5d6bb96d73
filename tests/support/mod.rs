//! Runs the program and reads what it writes.

mod npy;

pub use npy::Array;

use brickfield_bench_data::{pile::bead_pile, write::StlWriter};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};

/// One facet as STL has it.
pub type Facet = [[f32; 3]; 3];

/// What a run gave.
pub struct Run {
    pub status: Option<i32>,
    pub stdout: String,
    /// What it complained about.
    pub stderr: String,
    /// What it told beforehand: the lines of standard error that are notes, or advice on cells and sizes.
    pub notes: String,
}

impl From<Output> for Run {
    fn from(output: Output) -> Run {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("output is text");
        let (mut stderr, mut notes) = (String::new(), String::new());
        for line in text(output.stderr).split_inclusive('\n') {
            // Of cells and sizes, whichever a test has chosen.
            let is_advice = line.starts_with("brickfield: warning: ")
                && (line.contains(" are lost; --cell ") || line.contains(": is that its unit? "));
            if is_advice || line.starts_with("brickfield: note: ") { &mut notes } else { &mut stderr }
                .push_str(line);
        }
        Run { status: output.status.code(), stdout: text(output.stdout), stderr, notes }
    }
}

impl Run {
    /// Standard output of a run that did well and had nothing to complain about.
    #[track_caller]
    pub fn ok(self) -> String {
        assert_eq!((self.status, self.stderr.as_str()), (Some(0), ""), "{}", self.stdout);
        self.stdout
    }

    /// Standard output of a run that did well, with no warnings but those that hold some words.
    #[track_caller]
    pub fn ok_but_for(self, words: &str) -> String {
        let expected = |line: &str| line.starts_with("brickfield: warning: ") && line.contains(words);
        assert!(self.status == Some(0) && self.stderr.lines().all(expected), "{}", self.stderr);
        self.stdout
    }

    /// As [`Run::ok`], read as JSON.
    #[track_caller]
    pub fn json(self) -> Value {
        let text = self.ok();
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }

    /// The only line on standard error of a run that failed and said nothing else.
    #[track_caller]
    pub fn failed(self) -> String {
        assert_eq!(self.status, Some(1), "{}{}", self.stdout, self.stderr);
        assert_eq!(self.stdout, "");
        let lines: Vec<&str> = self.stderr.lines().collect();
        assert_eq!(lines.len(), 1, "{}", self.stderr);
        let names = ["brickfield: ", "brickfield-bench: "];
        assert!(names.iter().any(|name| lines[0].starts_with(name)), "{}", self.stderr);
        self.stderr
    }

    /// The only line on standard error of a run that a signal ended.
    #[track_caller]
    pub fn ended_by(self, signal: i32) -> String {
        assert_eq!(self.status, Some(128 + signal), "{}{}", self.stdout, self.stderr);
        assert_eq!((self.stdout.as_str(), self.stderr.lines().count()), ("", 1), "{}", self.stderr);
        self.stderr
    }

    /// Standard error of a run that was refused as wrong usage.
    #[track_caller]
    pub fn misused(self) -> String {
        assert_eq!((self.status, self.stdout.as_str()), (Some(2), ""), "{}", self.stderr);
        self.stderr
    }
}

/// The program, to be given arguments.
pub fn program() -> Command {
    // Not there in tests of other packages.
    const PROGRAM: Option<&str> = option_env!("CARGO_BIN_EXE_brickfield");
    Command::new(PROGRAM.expect("a test of the program's own package"))
}

/// Runs the program.
pub fn run(args: &[&dyn AsRef<OsStr>]) -> Run {
    program().args(args.iter().map(AsRef::as_ref)).stdin(Stdio::null()).output().expect("it runs").into()
}

/// Runs the program with `input` on its standard input.
pub fn run_with(args: &[&dyn AsRef<OsStr>], input: &str) -> Run {
    let mut command = program();
    command.args(args.iter().map(AsRef::as_ref));
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it runs");
    // It may stop reading at an error.
    let _ = child.stdin.take().expect("it is piped").write_all(input.as_bytes());
    child.wait_with_output().expect("it ends").into()
}

/// The largest RssAnon of a run, in MiB.
#[cfg(target_os = "linux")]
pub fn peak_anonymous_mib(args: &[&dyn AsRef<OsStr>]) -> u64 {
    let mut command = program();
    command.args(args.iter().map(AsRef::as_ref));
    let mut child = command.stdout(Stdio::null()).spawn().expect("it runs");
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let kib = text.lines().find_map(|line| line.strip_prefix("RssAnon:"));
        let kib = kib.and_then(|kib| kib.trim().strip_suffix(" kB")?.parse::<u64>().ok());
        peak = peak.max(kib.unwrap_or(0));
        if let Some(status) = child.try_wait().expect("it is a child") {
            assert!(status.success());
            return peak >> 10;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data")
}

/// A file of the examples.
pub fn example(name: &str) -> PathBuf {
    data().join(name)
}

/// A toolpath that comes back onto itself.
pub fn of_passes(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/passes").join(name)
}

/// An example mesh.
pub fn stl(name: &str) -> PathBuf {
    data().join("stl").join(name).with_extension("stl")
}

/// What is known of the example meshes.
pub fn truth(name: &str, field: &str) -> f64 {
    let text = fs::read_to_string(data().join("stl_truth.json")).expect("the truth is there");
    let all: Value = serde_json::from_str(&text).expect("the truth is JSON");
    all[format!("{name}.stl")][field].as_f64().expect("the truth is a number")
}

/// A folder for one test.
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    pub fn new() -> Scratch {
        Scratch(tempfile::tempdir().expect("a folder can be made"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), content).expect("it can be written");
        self.path(name)
    }

    /// Writes a pile of beads with about so many facets.
    pub fn pile(&self, name: &str, facets: u64) -> PathBuf {
        let pile = bead_pile(1, facets, [100.0, 100.0, 12.0]);
        let file = BufWriter::new(fs::File::create(self.path(name)).expect("it can be created"));
        let mut writer = StlWriter::new(file, pile.triangles()).expect("it can be written");
        pile.into_iter().try_for_each(|bead| writer.mesh(&bead)).expect("it can be written");
        writer.finish().expect("it can be written");
        self.path(name)
    }

    /// Names in the folder, sorted.
    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("it can be listed");
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("it is there").file_name().into_string().expect("text"))
            .collect();
        names.sort();
        names
    }

    /// A store of an example, which is built once for all tests.
    #[track_caller]
    pub fn store(&self, name: &str, depth: u8) -> PathBuf {
        static BUILT: Mutex<BTreeMap<(String, u8), Vec<u8>>> = Mutex::new(BTreeMap::new());
        let path = self.path(&format!("{name}-{depth}.brf"));
        // A test whose build fails must not be the failure of others.
        let mut built = BUILT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bytes) = built.get(&(name.to_owned(), depth)) {
            fs::write(&path, bytes).expect("it can be written");
            return path;
        }
        // Few levels: beads may be thinner than a cell.
        run(&[&"build", &stl(name), &"-o", &path, &"--depth", &depth.to_string(), &"--quiet"])
            .ok_but_for("walls:");
        built.insert((name.to_owned(), depth), fs::read(&path).expect("it is there"));
        path
    }
}

/// A binary STL that claims to have `count` facets.
pub fn binary_stl(count: u32, facets: &[Facet]) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(count.to_le_bytes());
    for facet in facets {
        bytes.extend([0; 12]);
        facet.iter().flatten().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// The facets of a binary STL.
pub fn facets_of(path: &Path) -> Vec<Facet> {
    let bytes = fs::read(path).expect("it can be read");
    let float = |b: &[u8]| f32::from_le_bytes(b.try_into().expect("four bytes"));
    let facet = |record: &[u8]| -> Facet {
        std::array::from_fn(|v| std::array::from_fn(|a| float(&record[12 + 12 * v + 4 * a..][..4])))
    };
    bytes[84..].chunks_exact(50).map(facet).collect()
}

/// A box with outward faces.
pub fn cuboid(low: [f32; 3], high: [f32; 3]) -> Vec<Facet> {
    let p =
        |c: usize| -> [f32; 3] { std::array::from_fn(|a| if c >> a & 1 == 1 { high[a] } else { low[a] }) };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.iter().flat_map(|q| [[p(q[0]), p(q[1]), p(q[2])], [p(q[0]), p(q[2]), p(q[3])]]).collect()
}
