//! Running cargo and the `tyndall` program as a user does.
//!
//! Cargo sets `CARGO_BIN_EXE_tyndall` only for tests of the package that owns the program. So the first test that wants
//! it asks cargo to build it, in the profile and target folder of the tests, and takes the path from cargo's messages;
//! after `cargo test --workspace` there is nothing left to build and this takes a fraction of a second.

use serde_json::Value;
use std::env;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;

/// The workspace root.
pub fn workspace() -> &'static Path {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.parent().unwrap_or(manifest)
}

/// The standard output of cargo at the workspace root.
///
/// # Panics
/// If cargo fails, with what it said.
pub fn cargo(arguments: &[&str]) -> String {
    let program = env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
    let mut command = Command::new(program);
    command
        .args(arguments)
        .current_dir(workspace())
        .stderr(Stdio::inherit());
    let output = command.output().expect("cargo can be started");
    assert!(
        output.status.success(),
        "cargo {arguments:?}: {}",
        output.status
    );
    String::from_utf8(output.stdout).expect("cargo writes UTF-8")
}

/// The path of the `tyndall` program, built on the first call.
pub fn tyndall() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let format = "--message-format=json-render-diagnostics";
        // An example beside it asks for the features that tests ask for: alone, the program's libraries would be built once more.
        let mut arguments = vec!["build", "--bin=tyndall", "--example=march", format];
        if !cfg!(debug_assertions) {
            arguments.push("--release");
        }
        let messages = cargo(&arguments);
        let executable = messages.lines().find_map(|line| {
            let message: Value = serde_json::from_str(line).ok()?;
            let executable = message["executable"].as_str()?;
            (message["target"]["name"] == "tyndall").then(|| PathBuf::from(executable))
        });
        executable.expect("cargo names the program it built")
    })
}

/// As [`run_tyndall`], with arguments separated by single spaces.
pub fn run_line(folder: &Path, arguments: &str) -> Output {
    run_tyndall(folder, &arguments.split(' ').collect::<Vec<_>>())
}

/// As [`run_line`]: exit status and standard error.
pub fn ends(folder: &Path, arguments: &str) -> (Option<i32>, String) {
    told(run_line(folder, arguments))
}

/// Exit status and standard error of a program that has ended.
pub fn told(output: Output) -> (Option<i32>, String) {
    let stderr = String::from_utf8(output.stderr).expect("programs write UTF-8");
    (output.status.code(), stderr)
}

/// As [`run_line`], for a command that must succeed; its standard error.
///
/// # Panics
/// If it does not, with what it said.
pub fn succeed(folder: &Path, arguments: &str) -> String {
    let (status, stderr) = ends(folder, arguments);
    assert_eq!(status, Some(0), "tyndall {arguments}\n{stderr}");
    stderr
}

/// Runs `tyndall` with these arguments in `folder`, without a terminal and without colours.
pub fn run_tyndall<A: AsRef<OsStr>>(folder: &Path, arguments: &[A]) -> Output {
    let output = command(folder, arguments).output();
    output.expect("tyndall can be started")
}

/// Starts what [`run_line`] runs, and does not wait for its end.
pub fn start_line(folder: &Path, arguments: &str) -> Child {
    let mut command = command(folder, &arguments.split_whitespace().collect::<Vec<_>>());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("tyndall can be started")
}

/// Sends a signal such as `INT` to a program.
///
/// # Panics
/// If it has ended already and somebody has waited for it.
pub fn signal(program: &Child, name: &str) {
    let mut command = Command::new("kill");
    command.args(["-s", name, &program.id().to_string()]);
    let status = command.status().expect("kill can be started");
    assert!(status.success(), "kill -s {name}: {status}");
}

fn command<A: AsRef<OsStr>>(folder: &Path, arguments: &[A]) -> Command {
    let mut command = Command::new(tyndall());
    command
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .env("NO_COLOR", "1");
    command
}
