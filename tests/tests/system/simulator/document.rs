//! The shell blocks of docs/simulation.md: each command is run, and prints what the page shows, apart from numbers, paths and
//! the width of spaces.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::Command;

use system_tests::process::{self, RunningProgram, Signal};
use system_tests::programs::{host_sim, tool};
use system_tests::wait::wait_until;
use tempfile::TempDir;

const PAGE: &str = include_str!("../../../../docs/simulation.md");

/// The terminals of a user: one for a simulator, and one for everything else.
struct Terminals {
    folder: TempDir,
    simulator: Option<RunningProgram>,
}

impl Terminals {
    fn in_folder(&self, mut command: Command, words: &[&str]) -> Command {
        command.args(words).current_dir(self.folder.path()).env_remove("SEVENBOT_PORT");
        command.env("XDG_RUNTIME_DIR", self.own_folder()).env("XDG_STATE_HOME", self.own_folder());
        command
    }

    /// The folder for sockets and settings.
    fn own_folder(&self) -> PathBuf {
        self.folder.path().join("own")
    }

    /// Runs a command. Returns what the terminal shows.
    fn run(&mut self, line: &str) -> String {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["host-sim", "--replay", ..] => {
                self.end_simulator();
                output(self.in_folder(Command::new(host_sim()), &words[1..]))
            }
            ["host-sim", arguments @ ..] => {
                self.end_simulator();
                self.start_simulator(arguments)
            }
            ["sevenbot", arguments @ ..] => {
                // Let virtual time pass, as it does while a user types.
                output(self.in_folder(tool(), &["sim", "advance", "200ms"]));
                output(self.in_folder(tool(), arguments))
            }
            // The test sends the request itself, because not every machine has socat.
            ["echo", request, "|", "socat", ..] => self.ask(request.trim_matches('\'')),
            _ => panic!("the test does not know this command: {line}"),
        }
    }

    /// Starts a simulator, and waits until its servos have started.
    fn start_simulator(&mut self, arguments: &[&str]) -> String {
        let log = self.folder.path().join("log");
        let mut command = self.in_folder(Command::new(host_sim()), arguments);
        command.stderr(File::create(&log).expect("a file"));
        let (simulator, ports) = process::start(&mut command, 1).expect("host-sim starts");
        self.simulator = Some(simulator);
        wait_until("the servos start", || {
            let state = output(self.in_folder(tool(), &["sim", "state", "--json"]));
            let state: serde_json::Value = serde_json::from_str(&state).expect("JSON");
            state["time_us"].as_u64() > Some(1_000_000)
        });
        let log = fs::read_to_string(&log).expect("text");
        format!("ready {}\n{log}", ports[0].display())
    }

    /// Ends the simulator as Ctrl-C does.
    fn end_simulator(&mut self) {
        if let Some(mut simulator) = self.simulator.take() {
            process::send_signal(&simulator, Signal::INT);
            assert!(process::wait_for_exit(&mut simulator).success());
        }
    }

    /// Sends a request to the control socket, and returns the answer. Starts a simulator if none is running.
    fn ask(&mut self, request: &str) -> String {
        if self.simulator.is_none() {
            self.start_simulator(&[]);
        }
        let mut stream = UnixStream::connect(self.control_socket()).expect("a control socket");
        writeln!(stream, "{request}").expect("it is sent");
        let mut answer = String::new();
        BufReader::new(stream).read_line(&mut answer).expect("an answer");
        answer
    }

    fn control_socket(&self) -> PathBuf {
        let mut entries = fs::read_dir(self.own_folder().join("7bot")).expect("the folder of sockets");
        let is_socket = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "sock");
        entries.find_map(|entry| Some(entry.ok()?.path()).filter(is_socket)).expect("a control socket")
    }
}

fn output(mut command: Command) -> String {
    let output = command.output().expect("it runs");
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// The commands of the shell blocks, each with the lines that it prints.
fn commands() -> Vec<(&'static str, Vec<&'static str>)> {
    let mut commands: Vec<(&str, Vec<&str>)> = Vec::new();
    for block in PAGE.split("```text\n").skip(1) {
        let (block, _) = block.split_once("```").expect("the end of the block");
        assert!(block.starts_with("$ "), "a block without a command: {block}");
        for line in block.lines() {
            match line.strip_prefix("$ ") {
                Some(command) => commands.push((command, Vec::new())),
                None => commands.last_mut().expect("a command").1.push(line),
            }
        }
    }
    commands
}

/// A line without its numbers, paths and the width of its spaces.
fn shape(line: &str) -> String {
    let word = |word: &str| {
        if word.starts_with('/') {
            return "PATH".to_owned();
        }
        let mut shape = word.replace(|letter: char| letter.is_ascii_digit() || letter == '.', "#");
        while shape.contains("##") {
            shape = shape.replace("##", "#");
        }
        shape.replace("-#", "#")
    };
    line.split_whitespace().map(word).collect::<Vec<String>>().join(" ")
}

#[test]
fn each_command_prints_what_the_page_shows() {
    let mut terminals = Terminals { folder: tempfile::tempdir().expect("a folder"), simulator: None };
    let scene = PAGE.split("```scene\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a scene");
    fs::write(terminals.folder.path().join("cubes.txt"), scene).expect("a file");
    let commands = commands();
    assert!(commands.len() > 10, "{commands:?}");
    for (command, shown) in commands {
        let printed = terminals.run(command);
        let mut printed: Vec<String> = printed.lines().map(shape).collect();
        if command.starts_with("host-sim --link") && shown.is_empty() {
            continue;
        }
        // `...` stands for the remaining lines.
        let is_cut = shown.last() == Some(&"...");
        let shown: Vec<String> =
            shown.iter().take(shown.len() - usize::from(is_cut)).map(|line| shape(line)).collect();
        if is_cut {
            printed.truncate(shown.len());
        }
        assert_eq!(printed, shown, "{command}");
    }
}
