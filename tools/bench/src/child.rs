//! The program that is measured, run anew as its user runs it: its time, its memory, what it printed.

use anyhow::{Context, anyhow};
use brickfield_terminal::failure::Failure;
use brickfield_terminal::interrupt;
use brickfield_terminal::output::one_line;
use std::ffi::OsString;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How often the memory of a process is looked at. Looking takes 20 µs.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// Clock ticks a second in /proc: the same on all Linux systems.
const TICKS: f64 = 100.0;

/// What a process took, and what it printed.
pub struct ProcessRun {
    pub seconds: f64,
    /// User and system time, to 10 ms.
    pub cpu_seconds: f64,
    pub anonymous_bytes: u64,
    pub printed: Vec<u8>,
}

/// Another program than the one beside this.
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// Chooses the program that is measured; the first choice counts.
pub fn measure_program(program: PathBuf) {
    // Runs are in other folders.
    let _ = PROGRAM.set(std::path::absolute(&program).unwrap_or(program));
}

/// The program that is measured.
///
/// # Errors
/// If none was chosen and none stands beside this one.
pub fn program() -> Result<PathBuf, Failure> {
    if let Some(program) = PROGRAM.get() {
        return Ok(program.clone());
    }
    let own = std::env::current_exe().context("cannot find this program's own file")?;
    let beside = own.with_file_name("brickfield");
    if beside.is_file() {
        return Ok(beside);
    }
    let what =
        "is not there; build it with the same profile (`cargo build --release`), or name one with --program";
    Err(anyhow!("{}: the program that is measured {what}", beside.display()).into())
}

/// Its name and version, as it tells them.
///
/// # Errors
/// If it cannot be run.
pub fn version() -> Result<String, Failure> {
    let program = program()?;
    let told = Command::new(&program).arg("--version").output();
    let told = told.with_context(|| format!("cannot run {}", program.display()))?;
    Ok(String::from_utf8_lossy(&told.stdout).trim().to_owned())
}

/// Runs it with `args` in `folder`.
///
/// # Errors
/// If it fails, with what it said, or the user asked to stop.
pub fn run_measured(args: &[OsString], folder: &Path) -> Result<ProcessRun, Failure> {
    let mut command = Command::new(program()?);
    command.args(args);
    run(command, folder, None)
}

/// Runs a command in `folder`, for as long as `limit` at most.
///
/// # Errors
/// As [`run_measured`], or if it takes longer.
pub fn run(mut command: Command, folder: &Path, limit: Option<Duration>) -> Result<ProcessRun, Failure> {
    command.current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let name = told(&command);
    let cpu_before = processor_seconds(CHILDREN);
    let start = Instant::now();
    let mut child = command.spawn().with_context(|| format!("cannot run {name}"))?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    let (id, child, ended) = (child.id(), &Mutex::new(child), &AtomicBool::new(false));
    let (status, seconds, printed, said, anonymous_bytes) = thread::scope(|scope| {
        let late = |start: Instant| limit.is_some_and(|limit| start.elapsed() > limit);
        let watch = scope.spawn(move || watch(id, child, ended, &|| interrupt::requested() || late(start)));
        let said = scope.spawn(|| {
            let mut said = Vec::new();
            // What cannot be read is only missing from a message.
            let _ = stderr.map(|mut pipe| pipe.read_to_end(&mut said));
            said
        });
        let printed = stdout.map_or(Ok(Vec::new()), read_all);
        let status = child.lock().unwrap_or_else(PoisonError::into_inner).wait();
        let seconds = start.elapsed().as_secs_f64();
        ended.store(true, Ordering::Relaxed);
        (status, seconds, printed, said.join().unwrap_or_default(), watch.join().unwrap_or(0))
    });
    if interrupt::requested() {
        return Err(brickfield_engine::Error::Interrupted.into());
    }
    let status = status.with_context(|| format!("cannot wait for {name}"))?;
    if limit.is_some_and(|limit| seconds > limit.as_secs_f64()) {
        return Err(anyhow!("{name}: stopped after {seconds:.0} s").into());
    }
    if !status.success() {
        let said = String::from_utf8_lossy(&said);
        let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it said nothing");
        return Err(anyhow!("{name}: {status}: {last}").into());
    }
    let printed = printed.with_context(|| format!("cannot read what {name} printed"))?;
    Ok(ProcessRun {
        seconds,
        cpu_seconds: processor_seconds(CHILDREN) - cpu_before,
        anonymous_bytes,
        printed,
    })
}

/// Work of this process, timed as if it were one of its own. What it takes of memory cannot be told from what was there.
pub fn here<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<(ProcessRun, T), Failure> {
    let (start, cpu_before) = (Instant::now(), processor_seconds(OWN));
    let done = work()?;
    let (seconds, cpu_seconds) = (start.elapsed().as_secs_f64(), processor_seconds(OWN) - cpu_before);
    Ok((ProcessRun { seconds, cpu_seconds, anonymous_bytes: 0, printed: Vec::new() }, done))
}

fn read_all(mut pipe: ChildStdout) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    pipe.read_to_end(&mut bytes).map(|_| bytes)
}

/// The command as a line of text.
fn told(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or_default();
    let words = std::iter::once(program).chain(command.get_args());
    one_line(&words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" "))
}

/// The largest RssAnon of a process until it has ended; ends it when it must end.
fn watch(id: u32, child: &Mutex<Child>, ended: &AtomicBool, must_end: &dyn Fn() -> bool) -> u64 {
    let status = format!("/proc/{id}/status");
    let mut most = 0;
    while !ended.load(Ordering::Relaxed) {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("RssAnon:"));
        let kib = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
        most = most.max(kib.unwrap_or(0) * 1024);
        // Whoever waits for the process holds the lock only when it has closed its output, and is about to end.
        if must_end()
            && let Ok(mut child) = child.try_lock()
        {
            // It may have ended by itself.
            let _ = child.kill();
        }
        thread::sleep(LOOK_EVERY);
    }
    most
}

/// Where /proc/self/stat tells user and system time, of this process and of all that it has started and that have ended:
/// fields from behind the program's name.
const OWN: usize = 11;
const CHILDREN: usize = 13;

/// User and system time, told from this field on.
fn processor_seconds(first: usize) -> f64 {
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name may hold anything.
    let fields = text.rsplit_once(") ").map_or("", |(_, fields)| fields);
    let ticks: f64 =
        fields.split(' ').skip(first).take(2).filter_map(|field| field.parse::<f64>().ok()).sum();
    ticks / TICKS
}
