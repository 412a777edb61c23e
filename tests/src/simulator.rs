//! A simulator with a control socket, and `sevenbot sim`.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use crate::ArmClient;
use crate::process::{self, RunningProgram};
use crate::programs::{host_sim, tool};

/// A running simulator, and a temporary folder for its sockets and the files of a test.
#[derive(Debug)]
pub struct Simulator {
    /// The process of `host-sim`.
    pub process: RunningProgram,
    /// The ports of its arms, the first arm first.
    pub ports: Vec<PathBuf>,
    /// Holds its sockets and the files of the test.
    pub folder: TempDir,
}

impl Simulator {
    /// Starts a simulator with these arguments. Without `--eeprom` it keeps no settings.
    #[must_use]
    pub fn start(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut command = Command::new(host_sim());
        let settings: &[&str] = if arguments.contains(&"--eeprom") { &[] } else { &["--eeprom", "none"] };
        command.args(settings).args(arguments).env("XDG_RUNTIME_DIR", folder.path());
        let arms = arguments.iter().position(|&argument| argument == "--arms");
        let count = arms.map_or(1, |index| arguments[index + 1].parse().expect("a number"));
        let (process, ports) = process::start(&mut command, count).expect("host-sim starts");
        Self { process, ports, folder }
    }

    /// A client of the first arm.
    #[must_use]
    pub fn client(&self) -> ArmClient {
        ArmClient::open(&self.ports[0], 115_200)
    }

    /// The control sockets, in the order of their names.
    #[must_use]
    pub fn sockets(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.folder.path().join("7bot")).expect("the folder of the sockets");
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
        paths.sort();
        paths
    }

    /// Runs `sevenbot sim`, which may fail.
    #[must_use]
    pub fn sim(&self, arguments: &[&str]) -> Output {
        let mut tool = tool();
        tool.env("XDG_RUNTIME_DIR", self.folder.path()).env_remove("SEVENBOT_PORT");
        tool.arg("sim").args(arguments).output().expect("sevenbot runs")
    }

    /// Runs `sevenbot sim`, which must succeed. Returns its standard output.
    #[track_caller]
    pub fn says(&self, arguments: &[&str]) -> String {
        let output = self.sim(arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text")
    }

    /// Runs `sevenbot sim`, which must fail with this exit status. Returns its standard error.
    #[track_caller]
    pub fn refuses(&self, arguments: &[&str], status: i32) -> String {
        let output = self.sim(arguments);
        assert_eq!(output.status.code(), Some(status), "{}", String::from_utf8_lossy(&output.stdout));
        String::from_utf8(output.stderr).expect("text")
    }

    /// The state of the arm as the simulator knows it, not as the controller measured it.
    #[must_use]
    pub fn state(&self) -> Value {
        serde_json::from_str(&self.says(&["state", "--json"])).expect("JSON")
    }

    /// The value of `key` in the state of joint `number`, 1 to 7.
    #[must_use]
    pub fn joint(&self, number: usize, key: &str) -> Value {
        self.state()["joints"][number - 1][key].clone()
    }
}
